"""Maps of the contact on its flanks: one rectangle or dot a pair, one row a flank."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from ..errors import InputError
from ..result import Result
from ..rows import choose_point, pair_areas, pair_fields, status_words
from ..shown import without_round_off
from .style import (
    Floats,
    ScaledFormatter,
    Source,
    as_result,
    label,
    largest_of,
    new_figure,
    scale,
    units_of,
)

__all__ = ["Flank", "find_flanks", "plot_flanks", "plot_maps"]

#: Titles and colour maps of the fields of a pair.
_SHOWN = {
    "stick": ("stick, share of the period", "Blues"),
    "slip": ("slip, share of the period", "Oranges"),
    "open": ("open, share of the period", "Greys"),
    "pressure": ("mean pressure", "viridis"),
    "dissipation": ("dissipation per area and cycle", "magma_r"),
    "wear_depth": ("wear depth", "YlOrBr"),
    "wear_rate": ("wear depth per cycle", "PuRd"),
}
#: Numbers are written into the cells of flanks with no more pairs than this.
_MOST_NUMBERS = 12
#: Share of the extent within which places are in one row.
_ROUND = 1e-6
#: Places with more holes between them than this times their number are on no grid.
_MOST_HOLES = 3


@dataclass(frozen=True)
class Flank:
    """Pairs of one patch, laid out in its plane.

    Attributes
    ----------
    name : str
        Name of the patch.
    pairs : (n,) int
        Its pairs, from 0.
    place : (n, 2)
        Their centres in the plane [length].
    size : (n, 2)
        Width and height of the cell of each.
    axes : tuple of str
        What the two directions are.
    """

    name: str
    pairs: NDArray[np.intp]
    place: Floats
    size: Floats
    axes: tuple[str, str]


def find_flanks(result: Result) -> list[Flank]:
    """Flanks of a result, from the positions and patches of its pairs.

    Raises
    ------
    InputError
        The file holds no positions.
    """
    if "contact/position" not in result:
        raise InputError(f"{result.name}: holds no /contact/position, so there is no map to draw; "
                         "the model file has to hold it")
    position = result["contact/position"]
    patch = (result["contact/patch"] if "contact/patch" in result
             else np.full(len(position), "contact"))
    names = list(dict.fromkeys(str(name) for name in patch))
    return [_lay_out(name, np.flatnonzero(patch == name), position) for name in names]


def _lay_out(name: str, pairs: NDArray[np.intp], position: Floats) -> Flank:
    """Directions in the plane of a patch: one along a global axis where there is one."""
    points = position[pairs] - position[pairs].mean(axis=0)
    # The direction of least extent; rows of vt are orthonormal even for pairs on a line.
    normal = np.linalg.svd(np.vstack((points, np.zeros((3, 3)))))[2][2]
    main = int(np.argmin(np.abs(normal)))
    first = np.eye(3)[main] - normal[main] * normal
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    # Both flanks of a root rise in the same direction, whichever way they lean.
    across = next(k for k in (1, 2, 0) if abs(second[k]) > 0.1)
    second *= np.sign(second[across])
    place = np.column_stack((position[pairs] @ first, points @ second))
    names = tuple("xyz"[k] if abs(direction[k]) > 1.0 - 1e-6 else f"slope, rising in {'xyz'[k]}"
                  for k, direction in ((main, first), (across, second)))
    return Flank(name, pairs, place, _sizes(place), (names[0], names[1]))


def _sizes(place: Floats) -> Floats:
    """Cells (n, 2) of places on a grid; NaN where the places tell no size."""
    span = np.maximum(np.ptp(place, axis=0), 1e-300)
    levels = [_levels(column, _ROUND * wide) for column, wide in zip(place.T, span)]
    # Rows of a grid that leans against these directions lie close together, not on each other.
    gaps = [np.diff(np.sort(column)) / wide for column, wide in zip(place.T, span)]
    for share in [0.0, *np.unique(np.round(np.concatenate(gaps), 6))]:
        leaning = [_levels(column, (share + _ROUND) * wide)
                   for column, wide in zip(place.T, span)]
        if (leaning[0].max() + 1) * (leaning[1].max() + 1) == len(place) and all(
                _apart(column, level) for column, level in zip(place.T, leaning)):
            levels = leaning
            break
    if (levels[0].max() + 1) * (levels[1].max() + 1) > _MOST_HOLES * len(place):
        return np.full(place.shape, np.nan)
    return np.column_stack([_widths(column, level) for column, level in zip(place.T, levels)])


def _levels(values: Floats, apart: float) -> NDArray[np.intp]:
    """Number of the row of every value: a new one begins where the next is further."""
    order = np.argsort(values)
    found = np.empty(len(values), dtype=np.intp)
    found[order] = np.concatenate(([0], np.cumsum(np.diff(values[order]) > apart)))
    return found


def _apart(values: Floats, level: NDArray[np.intp]) -> bool:
    """Whether rows are further from each other than they are thick."""
    ordered = np.sort(values)
    step = np.diff(np.sort(level)) > 0
    first, last = ordered[np.append(True, step)], ordered[np.append(step, True)]
    return bool((last - first).max() <= (first[1:] - last[:-1]).min(initial=np.inf))


def _widths(values: Floats, level: NDArray[np.intp]) -> Floats:
    """Distance between neighbouring rows of a grid, for every point; NaN for a single row."""
    if level.max() == 0:
        return np.full(len(values), np.nan)
    rows = np.bincount(level, values) / np.bincount(level)
    middle = 0.5 * (rows[1:] + rows[:-1])
    edges = np.concatenate(([2 * rows[0] - middle[0]], middle, [2 * rows[-1] - middle[-1]]))
    return np.diff(edges)[level]


def _cells(flank: Flank, area: Floats | None) -> Floats:
    """Width and height of every cell; a single row gets its height from the area."""
    size = flank.size.copy()
    for k in (0, 1):
        missing = np.isnan(size[:, k])
        other = size[:, 1 - k]
        if area is not None:
            size[missing, k] = np.where(np.isnan(other), np.sqrt(area[flank.pairs]),
                                        area[flank.pairs] / other)[missing]
        else:
            size[missing, k] = np.where(np.isnan(other), 1.0, other)[missing]
    return size


def plot_flanks(source: Source, point: int | None = None) -> Figure:
    """Maps of stick, slip and open shares, pressure and dissipation, one row a flank.

    Parameters
    ----------
    source : Result or path
        Needs the positions of the pairs, which come from the model file.
    point : int, optional
        Point from 0; that of the largest amplitude without it.
    """
    result = as_result(source)
    point = choose_point(result, None) if point is None else point
    fields = {name: field for name, field in pair_fields(result, point).items()
              if not name.startswith("wear")}
    if not fields:
        raise InputError(f"{result.name}: holds no contact states; run with output%contact = "
                         ".true.")
    title = f"Contact at point {point + 1}"
    if point < result.n_points:
        title += f", {result.frequency[point]:.6g} Hz{status_words(result, point)}"
    return plot_maps(result, fields, title)


def plot_maps(result: Result, fields: Mapping[str, tuple[Floats, str]], title: str) -> Figure:
    """Maps of any fields of the pairs.

    Parameters
    ----------
    result : Result
        Whose pairs these are.
    fields : mapping
        Values (n_pairs) and units by name, as `pair_fields` gives them.
    title : str
        Above the maps.
    """
    flanks = find_flanks(result)
    area = pair_areas(result)
    ratio = max(np.ptp(f.place[:, 1]) + 1e-9 for f in flanks) / max(
        np.ptp(f.place[:, 0]) + 1e-9 for f in flanks)
    height = float(np.clip(3.2 * ratio, 1.5, 3.0))
    # Maps stand below each other in rows of at most three, so that their numbers stay readable.
    columns = min(3, len(fields))
    blocks = -(-len(fields) // columns)
    rows = blocks * len(flanks)
    figure = new_figure(3.6 * columns + 0.6, (height + 0.25) * rows + 0.7)
    panels = figure.subplots(rows, columns, squeeze=False)
    for axes in panels.ravel():
        axes.set_visible(False)
    for number, (name, (values, units)) in enumerate(fields.items()):
        block, column = divmod(number, columns)
        text, colours = _SHOWN.get(name, (name, "viridis"))
        values = without_round_off(values)
        share = name in ("stick", "slip", "open")
        factor, shown_units = (1.0, "") if share else scale(largest_of(values), units)
        # Where all is zero the bar goes up to one: nothing is coloured as if it were something.
        top = float(values.max())
        limits = (0.0, 1.0) if share else (min(0.0, float(values.min())), top if top > 0.0 else 1.0)
        shown = [panels[block * len(flanks) + row, column] for row in range(len(flanks))]
        for axes, flank in zip(shown, flanks):
            drawn = _draw_map(axes, flank, _cells(flank, area), values, colours, limits,
                              factor)
            axes.set_ylabel(label(f"{flank.name}\n{flank.axes[1]}",
                                  units_of(result, "contact/position")), fontsize=9)
        shown[0].set_title(text, fontsize=10)
        shown[-1].set_xlabel(label(flanks[-1].axes[0], units_of(result, "contact/position")),
                             fontsize=9)
        bar = figure.colorbar(drawn, ax=shown, shrink=0.9, aspect=25, pad=0.02)
        bar.set_label(label("", shown_units).strip(), fontsize=9)
        bar.formatter = ScaledFormatter(factor)
        bar.update_ticks()
        bar.ax.tick_params(labelsize=8)
    figure.suptitle(title, fontsize=11)
    return figure


def _draw_map(axes: Axes, flank: Flank, size: Floats, values: Floats, colours: str,
              limits: tuple[float, float], factor: float) -> PatchCollection:
    """One map; the numbers in its cells are multiplied by the factor."""
    axes.set_visible(True)
    cells = [Rectangle((x - 0.5 * w, y - 0.5 * h), w, h)
             for (x, y), (w, h) in zip(flank.place, size)]
    drawn = PatchCollection(cells, cmap=colours, edgecolors="white", linewidths=0.6)
    drawn.set_array(values[flank.pairs])
    drawn.set_clim(*limits)
    axes.add_collection(drawn)
    low, high = flank.place - 0.5 * size, flank.place + 0.5 * size
    axes.set_xlim(low[:, 0].min(), high[:, 0].max())
    axes.set_ylim(low[:, 1].min(), high[:, 1].max())
    axes.tick_params(labelsize=8)
    if len(flank.pairs) <= _MOST_NUMBERS:
        for (x, y), value in zip(flank.place, values[flank.pairs]):
            colour = drawn.cmap(drawn.norm(value))
            dark = np.dot(colour[:3], (0.299, 0.587, 0.114)) < 0.5
            # What is round-off beside the largest value says no more than a zero.
            text = "0" if abs(value) < 1e-9 * limits[1] else f"{factor * value:.2g}"
            axes.text(x, y, text, ha="center", va="center", fontsize=7,
                      color="white" if dark else "black")
    return drawn
