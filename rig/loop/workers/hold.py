"""Choosing where the runs are worked on: here if there are few samples, else in processes, or on a cluster."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import current_process
from typing import TypeVar

from threadpoolctl import threadpool_limits

from rig.loop.workers.held import Held, Here

T = TypeVar("T")

WORTH_A_PROCESS = 60_000
"""Work, in samples, from which on a process of its own pays."""


@contextmanager
def hold(items: Sequence[T], work: Sequence[float], scheduler: str | None = None) -> Iterator[Held[T]]:
    """Hold items where they are worked on, until the context ends; `work`: what each makes, in samples.

    `scheduler`: address of a Dask scheduler; None: this machine, with no more processes than it has cores to give.
    Raises ConfigError where the scheduler is of no use.
    """
    if scheduler is not None:
        from rig.loop.workers.cluster import Cluster

        with Cluster(scheduler) as cluster:
            yield cluster.hold(items, work)
        return
    count = min(cores(), len(items), int(sum(work) // WORTH_A_PROCESS))
    if count < 2:
        with threadpool_limits(1):  # sums of a pool's processes are the same to the last bit only so
            yield Here(items)
        return
    from rig.loop.workers.processes import Processes

    with Processes(items, work, count) as held:
        yield held


def cores() -> int:
    """Give the number of cores that this process may use; 1 where it is one of a pool itself."""
    if current_process().daemon:
        return 1
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
