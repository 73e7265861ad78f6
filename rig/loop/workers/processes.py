"""A pool of processes, each of which holds its share of the runs and all that is made of them."""

import pickle
import signal
import traceback
import weakref
from collections.abc import Callable, Iterable, Sequence
from multiprocessing import Pipe, Process
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

from drivers.errors import RigError
from rig.loop.workers.held import Held, counts_of, every, flat, in_order, lists, shares, spread_places

T = TypeVar("T")
R = TypeVar("R")
P = ParamSpec("P")

FIRST = 0
"""Name of the items that a pool was made with."""

PATIENCE = 5.0
"""s that a process is given to end by itself."""


class LostProcessError(RigError):
    """A process of the pool is gone."""

    exit_code = 5


class Processes:
    """Processes that hold items; leaving the context ends them. `items`, of `sizes`, are divided among `count`."""

    def __init__(self, items: Sequence[Any], sizes: Sequence[float], count: int) -> None:
        self._dropped: list[int] = []
        self._last = FIRST
        self._pipes: list[Connection] = []
        self._processes: list[Process] = []
        self._places = shares(sizes, count)
        for share in self._places:
            ours, theirs = Pipe()
            process = Process(
                target=_serve, args=(theirs, [items[k] for k in share], [*self._pipes, ours]), daemon=True
            )
            process.start()
            theirs.close()
            self._pipes.append(ours)
            self._processes.append(process)

    def __enter__(self) -> Held[Any]:
        """Give the items that the pool was made with."""
        return _Elsewhere(self, FIRST, self._places)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for pipe in self._pipes:
            pipe.close()
        for process in self._processes:
            process.join(PATIENCE if kind is None else 0.0)
            if process.is_alive():
                process.kill()
                process.join()

    def new_key(self) -> int:
        """Give a name for results that stay in the processes."""
        self._last += 1
        return self._last

    def drop(self, key: int) -> None:
        """Forget results with the next task; safe wherever garbage is collected."""
        self._dropped.append(key)

    def ask(self, key: int, new: int | None, work: "Callable[..., Any]", *rest: Any) -> list[Any]:
        """Have every process do `work(items, *rest)`; its answers come back, or stay under the name `new`.

        Raises what a process raised.
        """
        dropped, self._dropped = self._dropped, []
        task = pickle.dumps((key, new, work, rest, dropped), protocol=pickle.HIGHEST_PROTOCOL)
        try:
            for pipe in self._pipes:
                pipe.send_bytes(task)
            answers: list[tuple[Any, BaseException | None]] = [pipe.recv() for pipe in self._pipes]
        except (EOFError, OSError):
            raise LostProcessError(
                "A process of the loop ended before its work was done; killed, or out of memory.",
                hint="Give fewer runs at once, or send them to a cluster with --scheduler.",
            ) from None
        errors = [error for _, error in answers if error is not None]
        if errors:
            if new is not None:
                self.drop(new)
            raise errors[0]
        return [answer for answer, _ in answers]


class _Elsewhere(Held[T]):
    """Items in the processes of a pool."""

    def __init__(self, pool: Processes, key: int, places: Sequence[Sequence[int]]) -> None:
        self._pool, self._key, self._places = pool, key, places
        weakref.finalize(self, pool.drop, key)

    def map(self, function: Callable[Concatenate[T, P], R], *args: P.args, **kwargs: P.kwargs) -> list[R]:
        """Give `function(item, ...)` of every item."""
        return in_order(self._places, self._pool.ask(self._key, None, every, function, args, kwargs))

    def keep(self, function: Callable[Concatenate[T, P], R], *args: P.args, **kwargs: P.kwargs) -> Held[R]:
        """Leave the results in the processes."""
        new = self._pool.new_key()
        self._pool.ask(self._key, new, every, function, args, kwargs)
        return _Elsewhere(self._pool, new, self._places)

    def spread(self, function: Callable[Concatenate[T, P], Iterable[R]], *args: P.args, **kwargs: P.kwargs) -> Held[R]:
        """Leave all results in the processes."""
        several, single = self._pool.new_key(), self._pool.new_key()
        self._pool.ask(self._key, several, lists, function, args, kwargs)
        counts = self._pool.ask(several, None, counts_of)
        self._pool.ask(several, single, flat)
        self._pool.drop(several)
        return _Elsewhere(self._pool, single, spread_places(self._places, counts))


def _serve(pipe: Connection, items: list[Any], others: list[Connection]) -> None:
    """Do what comes through the pipe until its other end is closed. Interrupts are for the process there.

    `others`: ends of pipes that came along with the fork; as long as anyone has one open, a pipe does not end.
    """
    for other in others:
        other.close()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    held = {FIRST: items}
    with threadpool_limits(1):
        while True:
            try:
                key, new, work, rest, dropped = pipe.recv()
            except (EOFError, OSError):
                return
            try:
                answer = work(held[key], *rest)
                if new is not None:
                    held[new], answer = answer, None
                reply = pickle.dumps((answer, None), protocol=pickle.HIGHEST_PROTOCOL)
            except Exception as raised:
                reply = pickle.dumps((None, _picklable(raised)))
            for name in dropped:
                held.pop(name, None)
            pipe.send_bytes(reply)


def _picklable(error: Exception) -> Exception:
    """Give the error itself where it can travel, or one that says the same."""
    try:
        again = pickle.loads(pickle.dumps(error))
    except Exception:  # whatever an error's own class does when it is copied
        again = None
    if type(again) is type(error) and str(again) == str(error):
        return error
    return RuntimeError("".join(traceback.format_exception(error)))
