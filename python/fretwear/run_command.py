"""`fretwear run CASE.nml`: a run, of a sweep by many workers if wanted."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from .analyses import run
from .case import Case
from .errors import InputError, RunInterrupted, RunStopped
from .pieces import Share, run_share
from .result import Result
from .shown import highest

__all__ = ["add_arguments", "main", "print_summary"]

_NOT_CONVERGED = 4
#: Observed quantities whose peaks are printed.
_LISTED = 6


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the subcommand."""
    parser.add_argument("case", type=Path, metavar="CASE.nml", help="namelist")
    parser.add_argument("--set", action="append", default=[], metavar="GROUP%KEY=VALUE",
                        dest="settings", help="change one value for this run; may be repeated")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="result file")
    parser.add_argument("--workers", type=int, metavar="N",
                        help="cut a natural sweep into N pieces that are solved at once "
                             "(0: one for each core)")
    parser.add_argument("--scheduler", default="threads", metavar="WHERE",
                        help="who solves them: 'threads' (default), 'dask', the address of a Dask "
                             "scheduler, or its scheduler file (.json)")
    parser.add_argument("--part", metavar="K/N",
                        help="solve the Kth of N pieces of a natural sweep alone, for fretwear "
                             "join; K-L/N: several of them as one")
    parser.add_argument("--restart", metavar="FILE",
                        help="go on with a natural sweep: take the rows of this result of the same "
                             "case, also of one that was killed (NAME.h5.part)")
    parser.add_argument("-q", "--quiet", action="store_true", help="errors only")


def main(options: argparse.Namespace) -> int:
    """Run the case; returns the exit status: 4 where points have not converged."""
    case = Case.from_file(options.case).overridden(options.settings)
    try:
        if options.part is not None:
            if options.workers is not None or options.scheduler != "threads" or options.restart:
                raise InputError("--part is one piece, solved here: leave out --workers, "
                                 "--scheduler and --restart")
            result = run_share(case, Share.of(options.part), options.output,
                               progress=not options.quiet)
        else:
            result = run(case, options.output, check=False, progress=not options.quiet,
                         workers=options.workers, scheduler=options.scheduler,
                         restart=options.restart)
    except (RunInterrupted, RunStopped) as ended:
        if ended.result is not None and not options.quiet:
            print_summary(ended.result)
        raise
    if not options.quiet:
        print_summary(result)
    return _NOT_CONVERGED if result.status == "not converged" else 0


def print_summary(result: Result) -> None:
    """As fw_run has it, in short."""
    if "converged" in result:
        print(f"{'converged':17} {int(result.converged.sum())} of {result.n_points} points")
    if "peak/omega" in result:
        for name in result.observed[:_LISTED]:
            top = highest(result, name)
            if top is not None:
                print(f"{'peak ' + name:17} {top.height:.6E} at "
                      f"{2.0 * np.pi * top.place:.6E} rad/s ({top.place:.6E} Hz)"
                      + (f", {top.words}" if top.words else ""))
    for remark in result.remarks:
        print(f"{'remark':17} {remark}")
    print(f"{'time':17} {result.elapsed:.3f} s")
    print(f"{'result':17} {result.path}")
