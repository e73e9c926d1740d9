"""Natural frequencies with the contact free and stuck (`analysis = 'modes'`)."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from .result_file import ResultFile

__all__ = ["NaturalModes", "aligned", "read_natural_modes"]

Floats = NDArray[np.float64]
_TURN = 2.0 * np.pi


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
        return aligned(self.table())

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


def aligned(rows: list[list[str]]) -> str:
    """The rows of a table as lines of columns."""
    # The star after a number stands beside its column.
    texts = [[text if text.endswith("*") or k == 0 else f"{text}  " for text in row]
             for k, row in enumerate(rows)]
    texts[0] = [f"{text}  " for text in rows[0]]
    widths = [max(map(len, column)) for column in zip(*texts)]
    return "\n".join(" ".join(text.rjust(width) for text, width in zip(row, widths)).rstrip()
                     for row in texts)
