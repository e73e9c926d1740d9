"""A study: the runs that are missing, and the table of all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from .execution import check_program, find_program
from .plan import Plan
from .pool import core_count, run_jobs
from .run import Job, Record, identify, recorded
from .table import build_table, need_writer, write_table

__all__ = ["Progress", "run_study"]

#: Called for every point as it is known: how many, of how many, its record, whether it was there.
Progress = Callable[[int, int, Record, bool], None]



def run_study(plan: Plan, progress: Progress | None = None, *,
              table_only: bool = False,
              part: tuple[int, int] | None = None) -> list[Record | None]:
    """Run what is missing, and write the table.

    Parameters
    ----------
    plan : Plan
        From `read_plan`.
    progress : callable, optional
        Told of every point.
    table_only : bool
        Run nothing.
    part : tuple of int, optional
        (K, N): every Nth point from the Kth, and no table.

    Returns
    -------
    list of Record or None
        One for each point of the plan; None where it has not been run.

    Raises
    ------
    InputError, OutputError
        What a study needs is not there; said before the first run.
    KeyboardInterrupt
        Ctrl-C; the runs that were complete are kept, and stand in the table.
    """
    if part is None:
        need_writer(plan.table)
    else:
        plan = replace(plan, points=plan.points[part[0] - 1::part[1]])
    by_program = bool(plan.program) or plan.scheduler == "processes"
    program = find_program(plan.program) if by_program else ""
    workers = plan.workers or core_count()
    case, folder = plan.case.resolve(), plan.results.resolve()

    if program:
        check_program(program)
    found = [identify(program, case, folder, point, plan.fixed, plan.timeout)
             for point in plan.points]
    points: dict[str, list[int]] = {}  # by the name of the run: some points may be the same
    for k, one in enumerate(found):
        points.setdefault(one.name, []).append(k)
    records: list[Record | None] = [None] * len(found)
    known = 0

    def keep(record: Record, *, was_there: bool) -> None:
        nonlocal known
        for k in points[record.name]:
            records[k] = replace(record, values=plan.points[k])
            known += 1
            if progress is not None:
                progress(known, len(found), record, was_there)

    jobs: list[Job] = []
    for name in points:
        one = found[points[name][0]]
        earlier = one if isinstance(one, Record) else recorded(one)
        if earlier is not None:
            keep(earlier, was_there=True)
        elif isinstance(one, Job):
            jobs.append(one)
    try:
        if not table_only:
            _run_all(jobs, plan.scheduler, workers, keep)
    finally:
        # What came to its end while Ctrl-C was on its way left its record, and is not in the list.
        for job in jobs:
            ended = recorded(job) if records[points[job.name][0]] is None else None
            if ended is not None:
                for k in points[job.name]:
                    records[k] = replace(ended, values=plan.points[k])
        if part is None:
            write_table(build_table(plan, records), plan.table, plan.path.stem)
    return records


def _run_all(jobs: list[Job], scheduler: str, workers: int,
             keep: Callable[..., None]) -> None:
    running = run_jobs(jobs, scheduler, min(workers, max(len(jobs), 1)))
    try:
        for record in running:
            keep(record, was_there=False)
    finally:
        close = getattr(running, "close", None)
        if close is not None:
            close()
