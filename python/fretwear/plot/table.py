"""The table of a study: its quantities against a key that varies."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps
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
#: Names in a legend: of more curves every second, third, ... is named.
_MOST_NAMES = 12
#: Units that do not depend on the model; the table does not know those that do.
_KNOWN_UNITS = ("rad/s", "Hz", "s")


def plot_table(path: str | Path, quantities: Sequence[str] | None = None) -> Figure:
    """Quantities of a study, one panel each, against the number that varies most.

    Where other keys vary too, a curve is drawn for each of their values, with a legend. In a random
    sample, where each run has values of its own, the runs are points, coloured by the second key.
    Runs that failed are left out.

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
    is_sample = len(groups) > max(len(PALETTE), len(table[abscissa]) // 2)
    second = _second(table, numeric, abscissa)
    for axes, name in zip(panels, wanted):
        if is_sample:
            _draw_points(axes, table[abscissa], table[name], table.get(second), second)
        else:
            _draw(axes, table[abscissa], table[name], groups)
        label_y(axes, name.replace("[", "\nof ").rstrip("]"), _units(name))
        tidy(axes)
    panels[-1].set_xlabel(abscissa)
    if len(groups) > 1 and not is_sample:
        panels[0].legend(title=", ".join(others), frameon=False, fontsize=8, title_fontsize=8,
                         loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _second(table: dict[str, NDArray[np.generic]], numeric: list[str], abscissa: str) -> str:
    """The number besides the abscissa that varies most; "" without any."""
    return max((key for key in numeric if key != abscissa),
               key=lambda key: len(np.unique(table[key])), default="")


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
    """A curve for each group; beyond the colours from dark to light, some of them named."""
    x, y = abscissa.astype(float), values.astype(float)
    many = len(groups) > len(PALETTE)
    named = -(-len(groups) // _MOST_NAMES)
    for k, (name, rows) in enumerate(groups.items()):
        colour = (colormaps["viridis"](0.95 * k / (len(groups) - 1)) if many else PALETTE[k])
        order = sorted((row for row in rows if np.isfinite(y[row])), key=lambda row: x[row])
        axes.plot(x[order], y[order], "-", marker="o", markersize=3.5, linewidth=1.3,
                  color=colour, label=name if name and k % named == 0 else None)


def _draw_points(axes: Axes, abscissa: NDArray[np.generic], values: NDArray[np.generic],
                 colours: NDArray[np.generic] | None, name: str) -> None:
    """A point for each run of a random sample, coloured by the value of another key."""
    x, y = abscissa.astype(float), values.astype(float)
    if colours is None:
        axes.plot(x, y, "o", markersize=3.5, color=PALETTE[0])
        return
    # The line holds the points for the label of the axis, which looks at lines.
    axes.plot(x, y, linestyle="none")
    drawn = axes.scatter(x, y, c=colours.astype(float), cmap="viridis", s=14.0)
    axes.figure.colorbar(drawn, ax=axes, label=name, pad=0.01)
