"""`fretwear optimise`: parameters of a case that make a quantity smallest or largest."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from ..case import Case
from ..errors import InputError, OutputError
from ..plot.found import plot_optimum
from .objectives import OBJECTIVES
from .optimum import optimise

__all__ = ["add_arguments", "add_parameters", "main", "read_case", "write_case", "write_picture"]

_NOT_CONVERGED = 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `fretwear optimise`."""
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--minimise", metavar="QUANTITY",
                      help="such as max_amplitude or max_amplitude[tip]; --quantities lists them")
    what.add_argument("--maximise", metavar="QUANTITY")
    what.add_argument("--quantities", action="store_true", help="list the quantities, and stop")
    add_parameters(parser)
    parser.add_argument("--max-evaluations", type=int, default=100, metavar="N",
                        help="default: 100")
    parser.add_argument("--tolerance", type=float, default=1e-6, metavar="T",
                        help="relative, on the parameters (default: 1e-6)")
    parser.add_argument("--no-scan", dest="scan", action="store_false",
                        help="end at the first optimum, without a look for others between the "
                             "bounds")


def add_parameters(parser: argparse.ArgumentParser) -> None:
    """Add the case, and what of it is to be found."""
    parser.add_argument("case", nargs="?", metavar="CASE.nml", help="namelist")
    parser.add_argument("--over", action="append", default=[], metavar="GROUP%%KEY",
                        help="parameter, such as contact%%normal_load, or of some pairs "
                             "contact%%mu(1:8); once for each")
    parser.add_argument("--bounds", action="append", default=[], nargs=2, type=float,
                        metavar=("LOW", "HIGH"), help="of each parameter, in the same order")
    parser.add_argument("--start", action="append", type=float, metavar="VALUE",
                        help="of each parameter (default: the values of the case)")
    parser.add_argument("--as", dest="kind", choices=("value", "factor"), default="value",
                        help="what a parameter is: the value of all its pairs, or a factor of "
                             "their values in the case (default: value)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE",
                        help="set a key of the case, as fw_run does")
    parser.add_argument("-o", "--output", metavar="FILE.nml",
                        help="write the case with what was found")
    parser.add_argument("--picture", metavar="FILE",
                        help="draw what was found, its suffix is the format (png, svg, pdf)")
    parser.add_argument("-q", "--quiet", action="store_true", help="the answer only")


def read_case(options: argparse.Namespace) -> Case:
    """The case of the command; refuse what would fail at the end of the work."""
    if options.case is None:
        raise InputError("name a case (CASE.nml)")
    if not options.over:
        raise InputError("name a parameter with --over GROUP%KEY, and its bounds with --bounds")
    if len(options.over) != len(options.bounds):
        raise InputError(f"--over stands {len(options.over)} times and --bounds "
                         f"{len(options.bounds)} times: each parameter needs its bounds")
    for path in (options.output, options.picture):
        if path and not Path(path).absolute().parent.is_dir():
            raise OutputError(f"{path}: there is no folder {Path(path).absolute().parent}")
    return Case.from_file(options.case).overridden(options.set)


def write_case(case: Case, output: str | None) -> None:
    """Write a case as a namelist, where that was asked for."""
    if output:
        Path(output).write_text(case.namelist())
        print(output)


def write_picture(draw: Callable[[], Figure], path: str | None) -> None:
    """Draw, where that was asked for."""
    if not path:
        return
    try:
        draw().savefig(path)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None  # such as a format not known
    print(path)


def main(options: argparse.Namespace) -> int:
    """Run `fretwear optimise`; 4 where no optimum was found."""
    if options.quantities:
        for name, meaning in OBJECTIVES.items():
            print(f"{name:24}{meaning}")
        return 0
    if options.minimise is None and options.maximise is None:
        raise InputError("say what to --minimise or --maximise; --quantities lists the quantities")
    found = optimise(read_case(options), minimise=options.minimise, maximise=options.maximise,
                     over=options.over, bounds=options.bounds, start=options.start,
                     factors=options.kind == "factor", tolerance=options.tolerance,
                     max_evaluations=options.max_evaluations, scan=options.scan,
                     progress=not options.quiet)
    print(found)
    write_case(found.case, options.output)
    write_picture(lambda: plot_optimum(found), options.picture)
    return 0 if found.converged else _NOT_CONVERGED
