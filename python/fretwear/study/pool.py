"""Where the runs of a study are carried out: cores of this machine, or a Dask cluster."""

from __future__ import annotations

import importlib
import os
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from typing import Any

from ..errors import InputError
from .execution import run_job
from .run import Job, Record, RunStopped

__all__ = ["core_count", "run_jobs"]


def core_count() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_jobs(jobs: Sequence[Job], scheduler: str, workers: int) -> Iterator[Record]:
    """Run jobs and yield their records as they come.

    Parameters
    ----------
    jobs : sequence of Job
        No two of one name.
    scheduler : str
        'threads' and 'processes' of this machine (what a job names), 'dask', or the address of a
        Dask scheduler.
    workers : int
        Runs at once on this machine.

    Notes
    -----
    Closing the iterator, or Ctrl-C, ends the runs of this machine; those of a cluster that have
    begun come to their end and leave their records, the others are cancelled.
    """
    if scheduler in ("threads", "processes"):
        yield from _run_here(jobs, workers)
    else:
        yield from _run_on_dask(jobs, scheduler, workers)


def _run_here(jobs: Sequence[Job], workers: int) -> Iterator[Record]:
    """A run occupies a thread, in the library or waiting for its program."""
    stop = threading.Event()
    with ThreadPoolExecutor(workers) as pool:
        waiting: set[Future[Record]] = {pool.submit(run_job, job, stop) for job in jobs}
        try:
            while waiting:
                # Woken now and then, or Ctrl-C would not be seen while runs last.
                done, waiting = wait(waiting, timeout=0.2, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
        finally:
            stop.set()
            for future in waiting:
                future.cancel()
            for future in waiting:
                if not future.cancelled():
                    with suppress(RunStopped):
                        future.result()


def _run_on_dask(jobs: Sequence[Job], scheduler: str, workers: int) -> Iterator[Record]:
    distributed: Any = _distributed()
    local = scheduler == "dask"
    try:
        cluster = distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, dashboard_address=None) if local else None
        client = distributed.Client(cluster if local else scheduler)
    except (OSError, ValueError) as error:
        raise InputError(f"run.scheduler = '{scheduler}': no Dask scheduler answers there: {error}"
                         ) from None
    try:
        if not local:
            _require_package(client, scheduler)
        futures = client.map(run_job, jobs, key=[job.name for job in jobs], retries=0, pure=False)
        try:
            for future in distributed.as_completed(futures):
                yield future.result()
        finally:
            client.cancel(futures)
    finally:
        client.close()
        if cluster is not None:
            cluster.close()


#: Evaluated elsewhere: nothing of this package may be needed to read it.
_HAS_PACKAGE = "__import__('importlib.util').util.find_spec('fretwear') is not None"


def _require_package(client: Any, scheduler: str) -> None:
    """Say before the runs that the scheduler, or a worker, could not read them."""
    lacking = [] if client.run_on_scheduler(eval, _HAS_PACKAGE) else ["the scheduler"]
    found: dict[str, bool] = client.run(eval, _HAS_PACKAGE)
    lacking += [f"the worker {address}" for address, has in found.items() if not has]
    if lacking:
        raise InputError(f"run.scheduler = '{scheduler}': {', '.join(lacking)} cannot import "
                         "fretwear: install it there, in the same version as here")


def _distributed() -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError:
        raise InputError("a study on a Dask cluster needs the package distributed; install it with "
                         "pip install distributed, or leave run.scheduler out") from None
