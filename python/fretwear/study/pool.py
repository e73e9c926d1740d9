"""Where the runs of a study are carried out: cores of this machine, or a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from .._pool import core_count, open_pool
from .execution import run_job
from .run import Job, Record

__all__ = ["core_count", "run_jobs"]


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
    with open_pool(scheduler, workers, "run.scheduler") as pool:
        yield from pool.run(run_job, jobs, [job.name for job in jobs])
