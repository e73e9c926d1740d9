"""Parameter studies: ``fretwear study study.toml``.

Runs `fw_run` for a grid, a list or a Latin hypercube over any namelist keys, and writes one table.
A run is known by its effective input: what is there is not repeated, and Ctrl-C loses nothing.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

from .errors import InputError
from .study_plan import Plan, read_plan
from .study_pool import core_count, each, run_jobs
from .study_quantities import QUANTITIES
from .study_run import Job, Record, find_program, identify, recorded
from .study_table import build_table, need_writer, read_table, write_table

__all__ = ["Plan", "Record", "add_arguments", "main", "read_plan", "read_table", "run_study"]

#: Called for every point as it is known: how many, of how many, its record, whether it was there.
Progress = Callable[[int, int, Record, bool], None]

_SOME_FAILED = 4
# Failures listed at the end; the table has all.
_LISTED = 20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the subcommand."""
    parser.add_argument("study", type=Path, nargs="?", metavar="STUDY.toml", help="study file")
    parser.add_argument("--workers", type=int, metavar="N",
                        help="runs at once on this machine (default: run.workers, else all cores)")
    parser.add_argument("--scheduler", metavar="WHERE",
                        help="'processes', 'dask' or the address of a Dask scheduler")
    parser.add_argument("--table-only", action="store_true",
                        help="run nothing; write the table from what is there")
    parser.add_argument("--quantities", action="store_true",
                        help="list the quantities that a table can have, and stop")
    parser.add_argument("-q", "--quiet", action="store_true", help="failures only")


def main(options: argparse.Namespace) -> int:
    """Carry out a study; returns the exit status: 4 where some run has failed."""
    if options.quantities:
        for name, (_, of_observed, _, meaning) in QUANTITIES.items():
            print(f"{name + ('[observed]' if of_observed else ''):34}{meaning}")
        return 0
    if options.study is None:
        raise InputError("name the study file, or ask for --quantities")
    plan = read_plan(options.study)
    if options.workers is not None:
        plan = replace(plan, workers=options.workers)
    if options.scheduler is not None:
        plan = replace(plan, scheduler=options.scheduler)
    progress = None if options.quiet else _Lines().show
    records = run_study(plan, progress, table_only=options.table_only)
    failed = [record for record in records if record is not None and record.exit_status != 0]
    for record in failed[:_LISTED]:
        print(f"fretwear study: {_values(record)}: {record.status} (exit status "
              f"{record.exit_status}): {record.message}", file=sys.stderr)
    if len(failed) > _LISTED:
        print(f"fretwear study: and {len(failed) - _LISTED} more, see {plan.table}",
              file=sys.stderr)
    if not options.quiet:
        done = sum(record is not None for record in records)
        print(f"{plan.table}: {done} of {len(records)} runs, {len(failed)} failed")
    return _SOME_FAILED if failed else 0


def run_study(plan: Plan, progress: Progress | None = None, *,
              table_only: bool = False) -> list[Record | None]:
    """Run what is missing, and write the table.

    Parameters
    ----------
    plan : Plan
        From `read_plan`.
    progress : callable, optional
        Told of every point.
    table_only : bool
        Run nothing.

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
    need_writer(plan.table)
    program, workers = find_program(plan.program), plan.workers or core_count()
    case, folder = plan.case.resolve(), plan.results.resolve()

    found = each(lambda point: identify(program, case, folder, point, plan.fixed, plan.timeout),
                 plan.points, workers)
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


class _Lines:
    """Progress on the standard error: one line that changes on a terminal, else some lines."""

    def __init__(self) -> None:
        self.terminal = sys.stderr.isatty()

    def show(self, known: int, total: int, record: Record, was_there: bool) -> None:
        text = f"{known} of {total}: {_values(record)}: {record.status}" + (
            ", was there" if was_there else f", {record.seconds:.1f} s")
        if self.terminal:
            print(f"\r\x1b[K{text[:100]}", end="\n" if known == total else "", file=sys.stderr,
                  flush=True)
        elif known == total or known % max(1, total // 20) == 0 or record.exit_status != 0:
            print(text, file=sys.stderr, flush=True)


def _values(record: Record) -> str:
    items: Iterable[tuple[str, object]] = record.values.items()
    return ", ".join(f"{key}={value:.6g}" if isinstance(value, float) else f"{key}={value}"
                     for key, value in items)
