"""The workers of a Dask cluster, each of which holds its share of the runs and all that is made of them."""

import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from types import TracebackType
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

from drivers.errors import ConfigError, Mistake
from rig.loop.workers.held import Held, counts_of, every, flat, in_order, lists, shares, spread_places

if TYPE_CHECKING:
    from distributed import Client, Future

T = TypeVar("T")
R = TypeVar("R")
P = ParamSpec("P")

ADDRESS = re.compile(r"(\w+://)?\S+:\d+|inproc://\S+")
"""What names a scheduler: a host and a port, or one in this process."""

PATIENCE = 10.0
"""s that a scheduler is given to answer."""


class Cluster(AbstractContextManager["Cluster"]):
    """A client of the scheduler at `address`; leaving the context closes it.

    Raises ConfigError where the extra is not installed, nobody answers, or the cluster has no worker.
    """

    def __init__(self, address: str) -> None:
        self._client = _client(address)

    def hold(self, items: Sequence[T], sizes: Sequence[float]) -> Held[T]:
        """Divide items of these sizes among the threads of all workers."""
        places = shares(sizes, sum(self._client.nthreads().values()))
        futures = self._client.scatter([[items[k] for k in share] for share in places], hash=False)
        return _OnCluster(self._client, futures, places)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close()


class _OnCluster(Held[T]):
    """Items on the workers of a cluster: one future for every share."""

    def __init__(self, client: "Client", futures: "Sequence[Future[Any]]", places: Sequence[Sequence[int]]) -> None:
        self._client, self._futures, self._places = client, futures, places

    def _ask(self, work: Callable[..., Any], *rest: Any) -> "list[Future[Any]]":
        return [self._client.submit(work, future, *rest, pure=False) for future in self._futures]

    def map(self, function: Callable[Concatenate[T, P], R], *args: P.args, **kwargs: P.kwargs) -> list[R]:
        """Give `function(item, ...)` of every item."""
        return in_order(self._places, self._client.gather(self._ask(_every, function, args, kwargs)))

    def keep(self, function: Callable[Concatenate[T, P], R], *args: P.args, **kwargs: P.kwargs) -> Held[R]:
        """Leave the results on the workers."""
        return _OnCluster(self._client, self._ask(_every, function, args, kwargs), self._places)

    def spread(self, function: Callable[Concatenate[T, P], Iterable[R]], *args: P.args, **kwargs: P.kwargs) -> Held[R]:
        """Leave all results on the workers."""
        several = _OnCluster[list[R]](self._client, self._ask(_lists, function, args, kwargs), self._places)
        counts = self._client.gather(several._ask(counts_of))
        return _OnCluster(self._client, several._ask(flat), spread_places(self._places, counts))


def _client(address: str) -> "Client":
    try:
        from distributed import Client
    except ImportError:
        raise ConfigError(
            "--scheduler",
            [Mistake("--scheduler", address, "needs the extra `cluster`, which is not installed")],
            hint="Install the package with its extra: harmonic-rig[cluster].",
        ) from None
    if not ADDRESS.fullmatch(address):
        rule = "is no address of a Dask scheduler, such as tcp://127.0.0.1:8786"
        raise ConfigError("--scheduler", [Mistake("--scheduler", address, rule)])
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        rule = f"no Dask scheduler answers there within {PATIENCE:g} s ({error})"
        raise ConfigError("--scheduler", [Mistake("--scheduler", address, rule)]) from None
    if not client.nthreads():
        client.close()
        raise ConfigError("--scheduler", [Mistake("--scheduler", address, "this cluster has no worker")])
    return client


def _every(items: list[Any], *rest: Any) -> list[Any]:
    with threadpool_limits(1):  # sums are the same to the last bit only so
        return every(items, *rest)


def _lists(items: list[Any], *rest: Any) -> list[list[Any]]:
    with threadpool_limits(1):
        return lists(items, *rest)
