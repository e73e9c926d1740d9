"""One period: hysteresis loops of the pairs, displacements over a cycle, harmonics."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..cycle import Cycle
from ..errors import InputError
from ..result import DIRECTIONS, Result
from ..rows import choose_point, status_words, synthesis
from ..shown import Loop, dissipation, known_to, loop_of
from .style import (
    CURVE,
    PALETTE,
    Source,
    as_result,
    label,
    largest_of,
    new_figure,
    pair_name,
    scale_axis,
    tidy,
    units_of,
)

__all__ = ["plot_cycle", "plot_harmonics", "plot_hysteresis"]

Floats = NDArray[np.float64]

#: Instants of a period of an observed quantity.
_INSTANTS = 256
#: Harmonics below this part of the largest are round-off: double precision times a condition.
_ROUND_OFF = 1e-13
#: Pairs drawn unless others are asked for.
_MOST_PAIRS = 6
#: Half the width of the panels of all loops, over the extent of the largest.
_MARGIN = 0.55


def _cycle_of(result: Result, point: int | None, pairs: Sequence[int] | None) -> Cycle:
    """One period: at a point, or without one at the peak, where every sweep keeps the pairs that
    dissipate most; with `histories`, or for other pairs, at the point of the largest amplitude."""
    if point is None and "peak/cycle/force" in result and "history/force" not in result:
        kept = result.peak_cycle
        if pairs is None or set(pairs) <= set(kept.pairs.tolist()):
            return kept
    return result.cycle(choose_point(result, None) if point is None else point)


def _chosen(result: Result, cycle: Cycle, point: int, pairs: Sequence[int] | None) -> list[int]:
    """Places in a cycle of the pairs to draw: those asked for (from 0), or those that dissipate
    most."""
    there = cycle.pairs.tolist()
    if pairs is not None:
        wrong = [pair + 1 for pair in pairs if pair not in there]
        if wrong:
            raise InputError(f"{result.name}: pair {wrong[0]}: there are {len(there)}, "
                             "counted from 1")
        return [there.index(pair) for pair in pairs]
    if len(there) < result.dissipation.shape[1]:
        # Kept are those that dissipate most already.
        return sorted(range(len(there)), key=there.__getitem__)
    order = np.argsort(-dissipation(result)[point], kind="stable")
    return [there.index(pair) for pair in sorted(order[:_MOST_PAIRS].tolist())]


def _loops(result: Result, cycle: Cycle, point: int, drawn: Sequence[int]) -> list[Loop]:
    """Loops of the pairs to draw, at rest where they move by round-off."""
    size, limit = float(np.abs(result.amplitude[point]).max(initial=0.0)), known_to(result)
    return [loop_of(cycle, pair, size, limit) for pair in drawn]


def _at(result: Result, point: int, cycle: Cycle | None = None) -> str:
    if cycle is not None and cycle.frequency != result.frequency[point]:
        return f"the peak, {cycle.frequency:.6g} Hz"
    return f"point {point + 1}, {result.frequency[point]:.6g} Hz{status_words(result, point)}"


def _at_peak(result: Result, cycle: Cycle, column: int) -> Floats | None:
    """Coefficients of a quantity at the frequency of a cycle, where a peak of it holds them."""
    if "peak/omega" not in result:
        return None
    same = np.flatnonzero((result["peak/omega"] / (2.0 * np.pi) == cycle.frequency)
                          & (result["peak/observed"] == column))
    return result["peak/coefficients"][same[0]] if len(same) else None


def _highest(result: Result, point: int) -> int:
    """The highest harmonic of a point; the file has zeros above it where points choose theirs."""
    return int(result["harmonics"][point]) if "harmonics" in result else result.n_harmonics


def plot_hysteresis(source: Source, point: int | None = None,
                    pairs: Sequence[int] | None = None) -> Figure:
    """Contact force against relative displacement, one panel a pair.

    Parameters
    ----------
    source : Result or path
        With contact. What is drawn is what the law gives, never a sum of harmonics: from the
        period that a sweep keeps at its peak, from the histories (`&output histories`), or from
        the point solved once more.
    point : int, optional
        Point from 0; the peak without it, or the point of the largest amplitude.
    pairs : sequence of int, optional
        Pairs from 0; the six that dissipate most without it. Of the two tangential directions
        the one of larger motion is drawn, of a pair without any the normal one. A pair that moves
        by no more than round-off is at rest: a straight line.
    """
    result = as_result(source)
    cycle = _cycle_of(result, point, pairs)
    point = choose_point(result, None) if point is None else point
    drawn = _chosen(result, cycle, point, pairs)
    columns = min(3, len(drawn))
    rows = math.ceil(len(drawn) / columns)
    figure = new_figure(max(3.3 * columns + 0.8, 5.6), max(2.9 * rows + 0.6, 3.8))
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    loops = _loops(result, cycle, point, drawn)
    for axes, pair, loop in zip(panels, drawn, loops):
        axes.plot(loop.displacement, loop.force, color=CURVE)
        axes.set_title(f"{pair_name(result, int(cycle.pairs[pair]))}, "
                       f"{DIRECTIONS[loop.direction]}" + ("" if loop.moves else ", at rest"),
                       fontsize=10)
        tidy(axes)
    # One unit for all panels, so that they can be compared.
    moved = largest_of(*(line.get_xdata() for axes in panels for line in axes.lines))
    pressed = largest_of(*(line.get_ydata() for axes in panels for line in axes.lines))
    # Of all loops about their own middle, so that sizes and shapes can be compared.
    wide = max((float(np.ptp(loop.displacement)) for loop in loops if loop.moves), default=0.0)
    high = max((float(np.ptp(loop.force)) for loop in loops), default=0.0)
    for axes, loop in zip(panels, loops):
        if not loop.moves:
            _room(axes, float(loop.displacement[0]), moved)
        else:
            _same_extent(axes.set_xlim, loop.displacement, wide)
        if high > 0.0:
            _same_extent(axes.set_ylim, loop.force, high)
        length = scale_axis(axes.xaxis, moved, units_of(result, "amplitude"))
        force = scale_axis(axes.yaxis, pressed, units_of(result, "contact/force"))
        axes.locator_params(axis="x", nbins=5)
    for axes in panels[len(drawn):]:
        axes.set_visible(False)
    figure.supxlabel(label("relative displacement", length), fontsize=10)
    figure.supylabel(label("contact force", force), fontsize=10)
    figure.suptitle(f"Hysteresis at {_at(result, point, cycle)}", fontsize=11)
    return figure


def _same_extent(set_limits: Callable[[float, float], Any], values: Floats,
                 extent: float) -> None:
    """Limits of one width for all panels, about the middle of what one of them shows."""
    middle = 0.5 * float(values.min() + values.max())
    set_limits(middle - _MARGIN * extent, middle + _MARGIN * extent)


def _room(axes: Axes, middle: float, extent: float) -> None:
    """Give a pair at rest the width of the others; without any, no numbers along the axis."""
    if extent > 0.0:
        axes.set_xlim(middle - extent, middle + extent)
    else:
        axes.set_xlim(-1.0, 1.0)
        axes.set_xticks([0.0])


def plot_cycle(source: Source, point: int | None = None, pairs: Sequence[int] | None = None,
               observe: str | None = None) -> Figure:
    """An observed quantity and the relative (tangential) displacement of pairs over one cycle.

    Parameters
    ----------
    source : Result or path
        Any result; pairs are drawn where it has contact.
    point, pairs
        See `plot_hysteresis`.
    observe : str, optional
        Observed quantity; the first of the file without it.
    """
    result = as_result(source)
    column = result.index(observe)
    has_contact = "contact/force" in result
    highest = choose_point(result, None) if point is None else point
    coefficients = result.coefficients[highest, :, column]
    cycle = None
    if has_contact:
        cycle = _cycle_of(result, point, pairs)
        if cycle.frequency != result.frequency[highest]:
            at_peak = _at_peak(result, cycle, column)
            if at_peak is None:  # another quantity than the first, whose peak it is
                cycle = result.cycle(highest)
            else:
                coefficients = at_peak
    point = highest
    figure = new_figure(8.0, 6.2 if has_contact else 3.8)
    panels = figure.subplots(2 if has_contact else 1, 1, sharex=True, squeeze=False).ravel()
    degrees = np.linspace(0.0, 360.0, _INSTANTS + 1)
    series = synthesis(len(coefficients), np.radians(degrees))
    units, name = units_of(result, "amplitude"), result.observed[column]
    history = coefficients @ series
    panels[0].plot(degrees, history, color=CURVE)
    panels[0].set_ylabel(label(name, scale_axis(panels[0].yaxis, largest_of(history), units)))
    panels[0].set_title(f"One cycle at {_at(result, point, cycle)}", fontsize=11)
    if cycle is not None:
        drawn = _chosen(result, cycle, point, pairs)
        for k, (pair, loop) in enumerate(zip(drawn, _loops(result, cycle, point, drawn))):
            panels[1].plot(cycle.degrees, loop.displacement,
                           color=PALETTE[k % len(PALETTE)], linestyle=("-", "--")[k // 6 % 2],
                           label=f"{pair_name(result, int(cycle.pairs[pair]))}, "
                                 f"{DIRECTIONS[loop.direction]}"
                                 + ("" if loop.moves else ", at rest"))
        moved = largest_of(*(line.get_ydata() for line in panels[1].lines))
        panels[1].set_ylabel(label("relative displacement",
                                   scale_axis(panels[1].yaxis, moved, units)))
        panels[1].legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    panels[-1].set_xlabel("phase of the excitation [degrees]")
    panels[-1].set(xlim=(0.0, 360.0), xticks=range(0, 361, 60))
    for axes in panels:
        tidy(axes)
    return figure


def plot_harmonics(source: Source, point: int | None = None, observe: str | None = None) -> Figure:
    """Amplitude of every harmonic of an observed quantity at one point, on a logarithmic scale."""
    result = as_result(source)
    point = choose_point(result, None) if point is None else point
    column = result.index(observe)
    highest = _highest(result, point)
    size = [abs(result.harmonic(n, column)[point]) for n in range(highest + 1)]
    figure = new_figure(8.0, 3.6)
    axes = figure.subplots()
    shown = np.array(size)
    # Harmonics that vanish by symmetry, and round-off, have no place on a logarithmic axis.
    present = shown > _ROUND_OFF * shown.max()
    axes.bar(np.flatnonzero(present), shown[present], color=CURVE, width=0.6)
    axes.set_yscale("log")
    axes.set_ylim(bottom=0.3 * shown[present].min())
    axes.set_xlim(-0.6, highest + 0.6)
    axes.locator_params(axis="x", integer=True)
    axes.set_xlabel("harmonic")
    axes.set_ylabel(label(f"amplitude of {result.observed[column]}",
                          units_of(result, "amplitude")))
    axes.set_title(f"Harmonics at {_at(result, point)}", fontsize=11)
    tidy(axes)
    return figure
