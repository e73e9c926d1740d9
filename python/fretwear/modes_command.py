"""`fretwear modes`: natural frequencies of a case or a model file, beside the sweep."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from ._native import namelist_values
from .analyses import run
from .case import Case
from .errors import InputError
from .natural_modes import NaturalModes, aligned, read_natural_modes

__all__ = ["add_arguments", "find_modes", "main"]

_TURN = 2.0 * np.pi
#: Endings of model files.
_MODEL_FILES = (".h5", ".hdf5")


def find_modes(case: Case) -> NaturalModes:
    """Natural frequencies of the structure of a case, whatever its analysis.

    Parameters
    ----------
    case : Case
        Its sweep, and what else is of another analysis, does not count.

    Returns
    -------
    NaturalModes
    """
    return read_natural_modes(run(case.replace(case={"analysis": "modes"}), in_memory=True))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `fretwear modes`."""
    parser.add_argument("file", help="namelist of a case, or model file (HDF5)")
    parser.add_argument("-n", type=int, metavar="N", default=10,
                        help="frequencies of each kind (default: %(default)s)")
    parser.add_argument("--sweep", nargs=2, type=float, metavar=("START", "END"),
                        help="mark what lies between [Hz] (default: the sweep of the case)")
    parser.add_argument("--speed", type=float, metavar="OMEGA",
                        help="rotation speed of the structure [rad/s]")


def main(options: argparse.Namespace) -> int:
    """Run `fretwear modes`: the table, and what to know of the sweep."""
    path = Path(options.file)
    case = Case(path) if path.suffix in _MODEL_FILES else Case.from_file(path)
    case = case.replace(cyclic={"n_modes": options.n})
    if options.speed is not None:
        case = case.replace(structure={"rotation_speed": options.speed})
    low, high = _range(case, options.sweep)
    found = find_modes(case)
    print(aligned(found.table(low, high)))
    if np.isfinite(low):
        count = found.within(low, high)
        words = f"{count} of them *" if count else "none of them; the response has no peak there"
        print(f"sweep from {low / _TURN:.6g} to {high / _TURN:.6g} Hz: {words}")
    return 0


def _range(case: Case, given: list[float] | None) -> tuple[float, float]:
    """Ends of the sweep [rad/s]; NaN where there is none."""
    if given is not None:
        if not 0.0 <= given[0] < given[1]:
            raise InputError(f"--sweep {given[0]:g} {given[1]:g}: must be two frequencies, the "
                             "lower one first")
        return given[0] * _TURN, given[1] * _TURN
    values = namelist_values(case.replace(case={"analysis": "modes"}).namelist())
    try:
        ends = sorted((float(values["sweep%start"][0]), float(values["sweep%end"][0])))
    except (KeyError, ValueError):
        return np.nan, np.nan
    if ends[0] <= 0.0:  # one frequency, without an end
        return np.nan, np.nan
    factor = _TURN if values.get("sweep%unit") == ["Hz"] else 1.0
    return factor * ends[0], factor * ends[1]
