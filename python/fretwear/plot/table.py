"""The table of a study: its quantities against a key that varies."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..errors import AbsentError
from ..study.quantities import QUANTITIES
from ..study.table import read_table, table_parts
from .style import PALETTE, label_y, new_figure, tidy

__all__ = ["plot_table"]

#: Panels of a picture: more are too flat to read.
_MOST = 6
#: Units that do not depend on the model; the table does not know those that do.
_KNOWN_UNITS = ("rad/s", "Hz", "s")


def plot_table(path: str | Path, quantities: Sequence[str] | None = None) -> Figure:
    """Quantities of a study, one panel each, against the number that varies most.

    Where other keys vary too, a curve is drawn for each of their values; where these are more than
    the colours, as of a random sample, the runs are points. Runs that failed are left out.

    Parameters
    ----------
    path : str or Path
        Table of a study, .h5 or .parquet.
    quantities : sequence of str, optional
        Columns to draw; the first six that hold numbers without it.

    Raises
    ------
    AbsentError
        No key varies, or no column holds numbers; the message says so.
    """
    table = read_table(path)
    keys, columns = table_parts(table)
    varied = [key for key in keys if len(set(table[key].tolist())) > 1]
    numeric = [key for key in varied if table[key].dtype.kind in "if"]
    if not numeric:
        raise AbsentError(f"{path}: no number varies in this study: there is nothing to draw "
                          "its quantities against")
    wanted = list(quantities) if quantities is not None else [
        name for name in columns if _has_numbers(table[name])][:_MOST]
    if not wanted:
        raise AbsentError(f"{path}: no quantity holds numbers: has any run succeeded?")
    abscissa = max(numeric, key=lambda key: len(np.unique(table[key])))
    others = [key for key in varied if key != abscissa]
    groups = _groups([table[key] for key in others], len(table[abscissa]))
    figure = new_figure(7.5, 1.0 + 2.2 * len(wanted))
    panels = figure.subplots(len(wanted), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, wanted):
        _draw(axes, table[abscissa], table[name], groups)
        label_y(axes, name.replace("[", "\nof ").rstrip("]"), _units(name))
        tidy(axes)
    panels[-1].set_xlabel(abscissa)
    if 1 < len(groups) <= len(PALETTE):
        panels[0].legend(title=", ".join(others), frameon=False, fontsize=8)
    return figure


def _has_numbers(column: NDArray[np.generic]) -> bool:
    return column.dtype.kind in "if" and bool(np.isfinite(column.astype(float)).any())


def _units(name: str) -> str:
    meaning = QUANTITIES[name.partition("[")[0]][3] if name.partition("[")[0] in QUANTITIES else ""
    units = meaning.rpartition("[")[2].rstrip("]") if meaning.endswith("]") else ""
    return units if units in _KNOWN_UNITS else ""


def _groups(columns: list[NDArray[np.generic]], n_rows: int) -> dict[str, list[int]]:
    """Rows by the values that other keys have in them."""
    found: dict[str, list[int]] = {}
    for row in range(n_rows):
        found.setdefault(", ".join(f"{column[row]}" for column in columns), []).append(row)
    return found


def _draw(axes: Axes, abscissa: NDArray[np.generic], values: NDArray[np.generic],
          groups: dict[str, list[int]]) -> None:
    """A curve for each group, or points where the groups are more than the colours."""
    x, y = abscissa.astype(float), values.astype(float)
    if len(groups) > len(PALETTE):
        axes.plot(x, y, "o", markersize=3.5, color=PALETTE[0])
        return
    for (name, rows), colour in zip(groups.items(), PALETTE):
        order = sorted((row for row in rows if np.isfinite(y[row])), key=lambda row: x[row])
        axes.plot(x[order], y[order], "-", marker="o", markersize=3.5, linewidth=1.3,
                  color=colour, label=name or None)
