"""`fretwear population`: many disks whose blades differ at random."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from .case import Case
from .errors import InputError
from .populations import Population, population
from .worst_pattern import worst_pattern

__all__ = ["add_arguments", "main"]

_SOME_FAILED = 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the subcommand."""
    parser.add_argument("case", type=Path, help="namelist with cyclic%%mistuned, &sweep and rows "
                                                "of blade modes")
    parser.add_argument("--patterns", type=int, metavar="N", default=100,
                        help="disks (default: %(default)s)")
    parser.add_argument("--seed", type=int, metavar="K", default=0,
                        help="of the random numbers (default: %(default)s)")
    parser.add_argument("--deviation", type=float, metavar="SHARE", default=0.02,
                        help="standard deviation of the blade frequencies (default: %(default)s)")
    parser.add_argument("--contact", metavar="NAME=SHARE,..",
                        help="standard deviations of values of the pairs, such as mu=0.1,gap=0.2")
    parser.add_argument("--workers", type=int, metavar="N", default=0,
                        help="disks at once (default: all cores)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE",
                        help="a key of the case, as of fw_run")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE",
                        help="result, which goes on where it was ended (default: "
                             "CASE_population.h5)")
    parser.add_argument("--worst", action="store_true",
                        help="in place of drawing disks: look for the pattern that amplifies most, "
                             "by derivatives, from starts drawn by --seed")
    parser.add_argument("--box", type=float, metavar="SHARE", default=0.05,
                        help="of --worst: largest deviation of a blade (default: %(default)s)")
    parser.add_argument("--starts", type=int, metavar="N", default=10,
                        help="of --worst: how many starts (default: %(default)s)")
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress")


def main(options: argparse.Namespace) -> int:
    """Solve the disks and print quantiles; 4 where points have failed."""
    case = Case.from_file(options.case).overridden(options.set)
    if options.worst:
        return _worst(case, options)
    file = options.output or options.case.with_name(f"{options.case.stem}_population.h5")
    found = population(case, options.patterns, seed=options.seed, deviation=options.deviation,
                       contact=_contact(options.contact), workers=options.workers, file=file,
                       progress=None if options.quiet else _show)
    print(_table(found))
    print(f"{file}: {len(found.solved)} disks, {found.converged.sum()} of {found.solved.sum()} "
          "points solved")
    return 0 if (found.converged == found.solved).all() else _SOME_FAILED


def _worst(case: Case, options: argparse.Namespace) -> int:
    """Print the pattern as a case takes it."""
    if options.contact is not None or options.output is not None:
        raise InputError("--worst goes without --contact and --output: it prints the pattern")
    found = worst_pattern(case, options.box, starts=options.starts, seed=options.seed,
                          workers=options.workers,
                          progress=None if options.quiet else _show_step)
    values = ", ".join(f"{value:.6g}" for value in np.ravel(found.pattern))
    print(f"{found}\n&mistuning frequency = {values} /")
    return 0


def _contact(text: str | None) -> dict[str, float]:
    """From mu=0.1,gap=0.2."""
    found = {}
    for word in (text or "").split(","):
        if not word.strip():
            continue
        name, equals, share = word.partition("=")
        try:
            found[name.strip()] = float(share)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"--contact {word}: must be NAME=SHARE, such as mu=0.1")
    return found


def _table(found: Population) -> str:
    """Quantiles of the amplification with their intervals."""
    lines = ["amplification           50 %              95 %              99 %    largest"]
    for name, rows, values in zip(found.names, found.quantiles(), found.amplification.T):
        cells = "".join(f"  {q:.3f} [{low:.3f}, {high:.3f}]" for q, low, high in rows)
        lines.append(f"{name[:14]:14}{cells}  {max(values):.3f}")
    return "\n".join(lines)


def _show(done: int, total: int) -> None:
    end = "\n" if done == total else ""
    if sys.stderr.isatty():
        print(f"\r{done} of {total} disks", end=end, file=sys.stderr, flush=True)
    elif done == total:
        print(f"{done} of {total} disks", file=sys.stderr, flush=True)


def _show_step(step: int, largest: float) -> None:
    if sys.stderr.isatty():
        print(f"\r{step} steps, amplification {largest:.4f}", end="", file=sys.stderr, flush=True)
