"""`fretwear study STUDY.toml`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from ..errors import InputError
from .plan import read_plan
from .quantities import QUANTITIES
from .run import Record
from .study import run_study

__all__ = ["add_arguments", "main"]

_SOME_FAILED = 4
# Failures listed at the end; the table has all.
_LISTED = 20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the subcommand."""
    parser.add_argument("study", type=Path, nargs="?", metavar="STUDY.toml", help="study file")
    parser.add_argument("--workers", type=int, metavar="N",
                        help="runs at once on this machine (default: run.workers, else all cores)")
    parser.add_argument("--scheduler", metavar="WHERE",
                        help="'threads', 'processes', 'dask', the address of a Dask scheduler, or "
                             "its scheduler file (.json)")
    parser.add_argument("--part", metavar="K/N",
                        help="the Kth of N parts of the runs alone, without a table (write it "
                             "with --table-only afterwards)")
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
    part = None if options.part is None else _part(options.part)
    if part is not None and options.table_only:
        raise InputError("--part runs and writes no table, --table-only runs nothing: give one")
    records = run_study(plan, progress, table_only=options.table_only, part=part)
    failed = [record for record in records if record is not None and record.exit_status != 0]
    for record in failed[:_LISTED]:
        print(f"fretwear study: {_values(record)}: {record.status} (exit status "
              f"{record.exit_status}): {record.message}", file=sys.stderr)
    if len(failed) > _LISTED:
        print(f"fretwear study: and {len(failed) - _LISTED} more, see {plan.table}",
              file=sys.stderr)
    if not options.quiet:
        done = sum(record is not None for record in records)
        where = plan.table if part is None else f"part {options.part}"
        print(f"{where}: {done} of {len(records)} runs, {len(failed)} failed")
    return _SOME_FAILED if failed else 0


def _part(text: str) -> tuple[int, int]:
    """From K/N."""
    k, slash, n = text.partition("/")
    if not (slash and k.isdigit() and n.isdigit() and 1 <= int(k) <= int(n)):
        raise InputError(f"--part {text}: expected K/N, such as 3/16 (the third of 16 parts), with "
                         "1 <= K <= N")
    return int(k), int(n)


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
