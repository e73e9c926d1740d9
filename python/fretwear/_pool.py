"""Where pieces of work are carried out: threads of this process, or a Dask cluster."""

from __future__ import annotations

import asyncio
import importlib
import os
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import Any, Callable, TypeVar

from ._watching import StopFlag
from .errors import FretwearError, InputError

__all__ = ["HERE", "Pool", "Tick", "core_count", "open_pool"]

#: Schedulers that are threads of this process.
HERE = ("threads", "processes")

_Item = TypeVar("_Item")
_Answer = TypeVar("_Answer")

#: Called now and then; what is true ends the work.
Tick = Callable[[], object]

#: A cluster without a worker for so long [s] is refused.
_WAIT_FOR_WORKERS = 30.0
#: Time between two calls of a tick, and after which Ctrl-C is seen [s].
_BETWEEN_TICKS = 0.1


def core_count() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Pool:
    """Threads of this process.

    Parameters
    ----------
    workers : int
        Pieces at once.
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers

    def run(self, work: Callable[..., _Answer], items: Sequence[_Item],
            names: Sequence[str] | None = None, tick: Tick | None = None) -> Iterator[_Answer]:
        """Yield ``work(item, stop)`` of every item as it comes.

        Parameters
        ----------
        work : callable
            Of an item and a `threading.Event` that is set when it shall end; on a cluster of the
            item alone.
        items : sequence
            What is to be done.
        names : sequence of str, optional
            No two alike.
        tick : callable, optional
            Asked now and then whether to end the work: what has begun then ends in its own way, and
            is given.
        """
        stop = StopFlag()
        with ThreadPoolExecutor(self.workers) as pool:
            futures = [pool.submit(work, item, stop) for item in items]
            waiting: set[Any] = set(futures)
            try:
                for future in _as_they_end(futures, tick, stop):
                    waiting.discard(future)
                    if not future.cancelled():
                        yield future.result()
            finally:
                stop.set()
                for future in waiting:
                    future.cancel()
                for future in waiting:
                    if not future.cancelled():
                        with suppress(Exception):
                            future.result()


def _as_they_end(futures: Sequence[Any], tick: Tick | None, stop: threading.Event) -> Iterator[Any]:
    """Futures as they end, cancelled ones too.

    They come by themselves: asking each of many again and again would take longer than short runs.
    """
    ended: SimpleQueue[Any] = SimpleQueue()
    for future in futures:
        future.add_done_callback(ended.put)
    left = len(futures)
    while left:
        # Woken now and then, or Ctrl-C would not be seen while runs last.
        with suppress(Empty):
            yield ended.get(timeout=_BETWEEN_TICKS)
            left -= 1
        if tick is not None and tick() and not stop.is_set():
            stop.set()
            for future in futures:
                future.cancel()


class _Cluster(Pool):
    """Workers of a Dask cluster; what has begun there comes to its end."""

    def __init__(self, client: Any, workers: int) -> None:
        super().__init__(workers)
        self._client = client

    def run(self, work: Callable[..., _Answer], items: Sequence[_Item],
            names: Sequence[str] | None = None, tick: Tick | None = None) -> Iterator[_Answer]:
        futures = self._client.map(work, items, key=None if names is None else list(names),
                                   retries=0, pure=False)
        try:
            for future in _as_they_end(futures, tick, threading.Event()):
                if not future.cancelled():
                    yield _answer_of(future)
        finally:
            self._client.cancel(futures)


def _answer_of(future: Any) -> Any:
    """What a worker has answered; says in words that workers have died of it."""
    try:
        return future.result()
    except Exception as error:
        if type(error).__name__ != "KilledWorker":
            raise
        raise FretwearError(
            "workers of the cluster were ended while they solved a piece, and it was given up: "
            f"{error}. A likely cause is memory: give each worker more (--memory-limit of dask "
            "worker, or fewer workers on a machine)") from None


@contextmanager
def open_pool(scheduler: str, workers: int, said_by: str = "scheduler") -> Iterator[Pool]:
    """Threads of this process, or a Dask cluster.

    Parameters
    ----------
    scheduler : str
        'threads' (or 'processes', which a thread each waits for), 'dask' for a cluster on this
        machine, the address of a Dask scheduler, or its scheduler file (.json).
    workers : int
        Pieces at once on this machine; 0: one for each core, or thread of the cluster.
    said_by : str, optional
        What messages call the scheduler.

    Raises
    ------
    InputError
        Dask is not installed, or nothing answers, or there is no worker or no package there.
    """
    if scheduler in HERE:
        yield Pool(workers or core_count())
        return
    distributed = _distributed(said_by)
    if scheduler.endswith(".json") and not os.path.isfile(scheduler):
        # Dask would wait for it without a word.
        raise InputError(f"{said_by} = '{scheduler}': there is no such scheduler file; dask "
                         "scheduler --scheduler-file writes it")
    local = scheduler == "dask"
    cluster = None
    try:
        if local:
            cluster = distributed.LocalCluster(n_workers=workers or core_count(),
                                               threads_per_worker=1, dashboard_address=None)
        client = (distributed.Client(scheduler_file=scheduler) if scheduler.endswith(".json")
                  else distributed.Client(cluster if local else scheduler))
    except (OSError, ValueError) as error:
        raise InputError(f"{said_by} = '{scheduler}': no Dask scheduler answers there: {error}"
                         ) from None
    try:
        if not local:
            said = f"{said_by} = '{scheduler}'"
            _require_package(client, said)
            if not client.nthreads():
                _require_worker(client, said)
                _require_package(client, said)
        yield _Cluster(client, workers or max(sum(client.nthreads().values()), 1))
    finally:
        client.close()
        if cluster is not None:
            cluster.close()


#: Evaluated elsewhere: nothing of this package may be needed to read it.
_HAS_PACKAGE = "__import__('importlib.util').util.find_spec('fretwear') is not None"


def _require_package(client: Any, said: str) -> None:
    """Say before the runs that the scheduler, or a worker, could not read them."""
    lacking = [] if client.run_on_scheduler(eval, _HAS_PACKAGE) else ["the scheduler"]
    found: dict[str, bool] = client.run(eval, _HAS_PACKAGE)
    lacking += [f"the worker {address}" for address, has in found.items() if not has]
    if lacking:
        raise InputError(f"{said}: {', '.join(lacking)} cannot import fretwear: install it there, "
                         "in the same version as here")


def _require_worker(client: Any, said: str) -> None:
    """A scheduler without workers takes work, and never does it."""
    try:
        client.wait_for_workers(1, timeout=_WAIT_FOR_WORKERS)
    except Exception as error:
        if not isinstance(error, (TimeoutError, asyncio.TimeoutError)):
            raise
        raise InputError(f"{said}: the scheduler has no workers, and none came within "
                         f"{_WAIT_FOR_WORKERS:.0f} s: start some (dask worker ADDRESS)") from None


def _distributed(said_by: str) -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError:
        raise InputError("work on a Dask cluster needs the package distributed; install it with "
                         f"pip install distributed, or leave {said_by} out") from None
