"""`fretwear join OUT.h5 PARTS`: one result of the pieces of a sweep."""

from __future__ import annotations

import argparse
from pathlib import Path

from .pieces import join_files
from .run_command import print_summary

__all__ = ["add_arguments", "main"]

_NOT_CONVERGED = 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the subcommand."""
    parser.add_argument("output", type=Path, metavar="OUT.h5", help="result file to write")
    parser.add_argument("parts", type=Path, nargs="+", metavar="PART",
                        help="pieces that fretwear run CASE.nml --part K/N has written, all of one "
                             "sweep, in any order")
    parser.add_argument("-q", "--quiet", action="store_true", help="errors only")


def main(options: argparse.Namespace) -> int:
    """Join the pieces; returns the exit status: 4 where points have not converged."""
    result = join_files(options.parts, options.output)
    if not options.quiet:
        print_summary(result)
    return _NOT_CONVERGED if result.status == "not converged" else 0
