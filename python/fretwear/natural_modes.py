"""Natural frequencies with the contact free and stuck, and the command `fretwear modes`."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ._native import namelist_values
from .case import Case
from .errors import InputError
from .result_file import ResultFile

__all__ = ["NaturalModes", "add_arguments", "find_modes", "main", "read_natural_modes"]

Floats = NDArray[np.float64]
_TURN = 2.0 * np.pi
#: Endings of model files.
_MODEL_FILES = (".h5", ".hdf5")


@dataclass(frozen=True)
class NaturalModes:
    """Natural frequencies of a structure, or of all nodal diameters of a disk.

    Attributes
    ----------
    nodal_diameter : (n_nd,) int
        0 alone without sectors.
    free, stuck : (n_nd, n_modes)
        Angular frequencies without contact, and with every pair stuck [rad/s]; NaN where there are
        fewer.
    """

    nodal_diameter: NDArray[np.int_]
    free: Floats
    stuck: Floats

    def within(self, low: float, high: float) -> int:
        """How many frequencies, free or stuck, lie between two angular frequencies [rad/s]."""
        both = np.concatenate((self.free.ravel(), self.stuck.ravel()))
        return int(np.count_nonzero((both >= low) & (both <= high)))

    def table(self, low: float = np.nan, high: float = np.nan) -> list[list[str]]:
        """Rows of texts in Hz, a star at what lies between two angular frequencies [rad/s]."""
        has_diameters = len(self.nodal_diameter) > 1
        head = ["nodal diameter"] * has_diameters + ["mode", "free [Hz]", "stuck [Hz]"]
        rows = [head]
        for diameter, free, stuck in zip(self.nodal_diameter, self.free, self.stuck):
            for k, pair in enumerate(zip(free, stuck)):
                if np.isnan(pair).all():
                    continue
                texts = ["-" if np.isnan(omega) else
                         f"{omega / _TURN:.6g}" + (" *" if low <= omega <= high else "")
                         for omega in pair]
                rows.append([str(diameter)] * has_diameters + [str(k + 1), *texts])
        return rows

    def __repr__(self) -> str:
        return _aligned(self.table())

    def _repr_html_(self) -> str:
        head, *rows = self.table()
        cells = ["<tr>" + "".join(f"<th>{escape(text)}</th>" for text in head) + "</tr>"]
        cells += ["<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>"
                  for row in rows]
        return f"<table>{''.join(cells)}</table>"


def read_natural_modes(result: ResultFile) -> NaturalModes:
    """The natural frequencies in a result of `analysis = 'modes'`."""
    free = result["modes/open"]
    stuck = result["modes/closed"] if "modes/closed" in result else np.full_like(free, np.nan)
    return NaturalModes(result["modes/nodal_diameter"].astype(int), free, stuck)


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
    from .analyses import run

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
    print(_aligned(found.table(low, high)))
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
    factor = _TURN if values.get("sweep%unit") == ["Hz"] else 1.0
    return factor * ends[0], factor * ends[1]


def _aligned(rows: list[list[str]]) -> str:
    # The star after a number stands beside its column.
    texts = [[text if text.endswith("*") or k == 0 else f"{text}  " for text in row]
             for k, row in enumerate(rows)]
    texts[0] = [f"{text}  " for text in rows[0]]
    widths = [max(map(len, column)) for column in zip(*texts)]
    return "\n".join(" ".join(text.rjust(width) for text, width in zip(row, widths)).rstrip()
                     for row in texts)
