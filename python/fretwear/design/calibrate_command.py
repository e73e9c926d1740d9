"""`fretwear calibrate`: parameters of a case from measured curves in tables of text."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._native import namelist_values
from ..case import Case
from ..errors import InputError, OutputError
from ..plot.found import plot_calibration
from .calibration import calibrate
from .measured import ControlData, Measured, ModeData, ResponseData
from .optimise_command import add_parameters, read_case, write_case, write_picture

__all__ = ["add_arguments", "main", "read_table"]

_NOT_CONVERGED = 4

#: Columns of a table, by the analysis of its case: the first ones are required.
_COLUMNS = {
    "mode": (("amplitude",), ("frequency", "damping_ratio", "frequency_deviation",
                              "damping_deviation")),
    "frf": (("frequency", "amplitude"), ("load", "deviation")),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `fretwear calibrate`."""
    add_parameters(parser)
    parser.add_argument("--data", action="append", default=[], metavar="TABLE",
                        help="measured numbers, a line of column names and rows of numbers, "
                             "separated by commas or blanks: amplitude, frequency [Hz], "
                             "damping_ratio, frequency_deviation, damping_deviation of "
                             "case%%analysis = 'mode'; frequency, amplitude, deviation of 'frf', "
                             "and load, where it is the amplitude that was held")
    parser.add_argument("--observe", metavar="NAME",
                        help="observed quantity of responses (default: the first)")
    parser.add_argument("--forced-mass", type=float, metavar="M",
                        help="damping ratios of modes are F/(2 M a) of forced motions, not those "
                             "of the mode")
    parser.add_argument("--max-evaluations", type=int, default=200, metavar="N",
                        help="default: 200")


def main(options: argparse.Namespace) -> int:
    """Run `fretwear calibrate`; 4 where no solution was found."""
    case = read_case(options)
    if not options.data:
        raise InputError("name a table of measured numbers with --data")
    data = [read_table(path, case, options.observe, options.forced_mass) for path in options.data]
    found = calibrate(case, data, over=options.over, bounds=options.bounds, start=options.start,
                      factors=options.kind == "factor",
                      max_evaluations=options.max_evaluations, progress=not options.quiet)
    print(found)
    write_case(found.case, options.output)
    write_picture(lambda: plot_calibration(found, data), options.picture)
    return 0 if found.converged else _NOT_CONVERGED


def read_table(path: str | Path, case: Case, observe: str | None = None,
               forced_mass: float | None = None) -> Measured:
    """Measured numbers of a table of text, as the analysis of the case has them.

    Raises
    ------
    InputError
        A column is unknown or missing, or something is no number.
    OutputError
        The file cannot be read.
    """
    analysis = namelist_values(case.namelist())["case%analysis"][0]
    if analysis not in _COLUMNS:
        raise InputError(f"case%analysis = '{analysis}': measured numbers are of 'mode' or 'frf'")
    columns = _read_columns(path, *_COLUMNS[analysis])
    if analysis == "mode":
        damping = "mode" if forced_mass is None else "forced"
        return ModeData(**columns, damping=damping, mass=forced_mass)  # type: ignore[arg-type]
    if forced_mass is not None:
        raise InputError("--forced-mass goes with damping ratios of modes")
    if "load" in columns:
        return ControlData(**columns, observe=observe)  # type: ignore[arg-type]
    return ResponseData(**columns, observe=observe)  # type: ignore[arg-type]


def _read_columns(path: str | Path, required: tuple[str, ...], others: tuple[str, ...]
                  ) -> dict[str, NDArray[np.float64]]:
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror}") from None
    lines = [(k + 1, line.replace(",", " ").split()) for k, line in enumerate(text.splitlines())
             if line.strip() and not line.lstrip().startswith("#")]
    if len(lines) < 2:
        raise InputError(f"{path}: must hold a line of column names and rows of numbers")
    names = lines[0][1]
    for name in names:
        if name not in required + others:
            raise InputError(f"{path}: column '{name}': must be among "
                             + ", ".join(required + others))
    if len(set(names)) < len(names) or any(name not in names for name in required):
        raise InputError(f"{path}: its columns are {', '.join(names)}, must be "
                         f"{' and '.join(required)} and others, each once")
    rows = []
    for number, words in lines[1:]:
        try:
            rows.append([float(word) for word in words])
        except ValueError:
            raise InputError(f"{path}:{number}: must be numbers") from None
        if len(words) != len(names):
            raise InputError(f"{path}:{number}: has {len(words)} numbers, must have {len(names)}")
    return dict(zip(names, np.array(rows).T))
