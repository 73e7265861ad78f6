"""Many plants at once: each advanced in a thread of its own, on all cores that this process may use."""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from sim_backend.errors import ModelError, shown
from sim_backend.plant import Plant


def advance_all(plants: Sequence[Plant], time: float, workers: int | None = None) -> None:
    """Integrate every plant up to the step nearest to `time` (s); the same as one after the other, to the last bit.

    workers: threads; None: one for every core that this process may use. Threads share the cores because compiled
    plants run without the interpreter's lock; a call is worth it from some thousand steps of each plant on.
    Raises ModelError if `workers` is below 1, a plant is in the list twice, or plants refuse `time`; it names these by
    their number from 0, and all others stand at `time`.
    """
    if workers is not None and workers < 1:
        raise ModelError(f"workers = {shown(workers)} must be at least 1.")
    _check_different(plants)
    threads = min(_cores() if workers is None else workers, len(plants))
    if threads > 1:
        with ThreadPoolExecutor(threads) as pool:
            errors = list(pool.map(lambda plant: _advance(plant, time), plants))
    else:
        errors = [_advance(plant, time) for plant in plants]
    failed = {number: error for number, error in enumerate(errors) if error is not None}
    if failed:
        told = " ".join(f"Plant {number}: {error}" for number, error in failed.items())
        message = f"{len(failed)} of {len(plants)} plants were not advanced to {shown(time)} s. {told}"
        raise ModelError(message) from next(iter(failed.values()))


def _advance(plant: Plant, time: float) -> ModelError | None:
    """Advance one plant; its refusal is handed over, so that it does not keep the others from their time."""
    try:
        plant.advance_to(time)
    except ModelError as error:
        return error
    return None


def _check_different(plants: Sequence[Plant]) -> None:
    """Raise ModelError if two threads would work on one plant."""
    first: dict[int, int] = {}
    for number, plant in enumerate(plants):
        before = first.setdefault(id(plant), number)
        if before != number:
            raise ModelError(f"plants {before} and {number} of the batch are one and the same; each must be its own.")


def _cores() -> int:
    """Give the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
