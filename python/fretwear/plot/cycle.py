"""One period: hysteresis loops of the pairs, displacements over a cycle, harmonics."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ..cycle import Cycle
from ..errors import InputError
from ..result import DIRECTIONS, Result
from ..rows import choose_point, synthesis
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

#: Instants of a period of an observed quantity.
_INSTANTS = 256
#: Pairs drawn unless others are asked for.
_MOST_PAIRS = 6


def _chosen(result: Result, cycle: Cycle, point: int, pairs: Sequence[int] | None) -> list[int]:
    """Pairs to draw: those asked for (from 0), or those that dissipate most."""
    if pairs is not None:
        wrong = [pair + 1 for pair in pairs if not 0 <= pair < cycle.force.shape[1]]
        if wrong:
            raise InputError(f"{result.name}: pair {wrong[0]}: there are {cycle.force.shape[1]}, "
                             "counted from 1")
        return list(pairs)
    order = np.argsort(-result.dissipation[point], kind="stable")
    return sorted(int(pair) for pair in order[:_MOST_PAIRS])


def _direction(cycle: Cycle, pair: int) -> int:
    """Tangential direction in which a pair moves more; the normal of one that has no other."""
    extent = np.ptp(cycle.displacement[:, pair], axis=0)
    return int(np.argmax(extent[:2])) if extent[:2].any() else 2


def _at(result: Result, point: int) -> str:
    return f"point {point + 1}, {result.frequency[point]:.6g} Hz"


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
        histories (`&output histories`), or from the point solved once more.
    point : int, optional
        Point from 0; that of the largest amplitude without it.
    pairs : sequence of int, optional
        Pairs from 0; the six that dissipate most without it. Of the two tangential directions
        the one of larger motion is drawn, of a pair without any the normal one.
    """
    result = as_result(source)
    point = choose_point(result, None) if point is None else point
    cycle = result.cycle(point)
    drawn = _chosen(result, cycle, point, pairs)
    columns = min(3, len(drawn))
    rows = math.ceil(len(drawn) / columns)
    figure = new_figure(max(3.3 * columns + 0.8, 5.6), max(2.9 * rows + 0.6, 3.8))
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, pair in zip(panels, drawn):
        c = _direction(cycle, pair)
        axes.plot(cycle.displacement[:, pair, c], cycle.force[:, pair, c], color=CURVE)
        axes.set_title(f"{pair_name(result, pair)}, {DIRECTIONS[c]}", fontsize=10)
        tidy(axes)
    # One unit for all panels, so that they can be compared.
    moved = largest_of(*(line.get_xdata() for axes in panels for line in axes.lines))
    pressed = largest_of(*(line.get_ydata() for axes in panels for line in axes.lines))
    for axes in panels[:len(drawn)]:
        length = scale_axis(axes.xaxis, moved, units_of(result, "amplitude"))
        force = scale_axis(axes.yaxis, pressed, units_of(result, "contact/force"))
        axes.locator_params(axis="x", nbins=5)
    for axes in panels[len(drawn):]:
        axes.set_visible(False)
    figure.supxlabel(label("relative displacement", length), fontsize=10)
    figure.supylabel(label("contact force", force), fontsize=10)
    figure.suptitle(f"Hysteresis at {_at(result, point)}", fontsize=11)
    return figure


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
    point = choose_point(result, None) if point is None else point
    column = result.index(observe)
    has_contact = "contact/force" in result
    figure = new_figure(8.0, 6.2 if has_contact else 3.8)
    panels = figure.subplots(2 if has_contact else 1, 1, sharex=True, squeeze=False).ravel()
    degrees = np.linspace(0.0, 360.0, _INSTANTS + 1)
    series = synthesis(result.coefficients.shape[1], np.radians(degrees))
    units, name = units_of(result, "amplitude"), result.observed[column]
    history = result.coefficients[point, :, column] @ series
    panels[0].plot(degrees, history, color=CURVE)
    panels[0].set_ylabel(label(name, scale_axis(panels[0].yaxis, largest_of(history), units)))
    panels[0].set_title(f"One cycle at {_at(result, point)}", fontsize=11)
    if has_contact:
        cycle = result.cycle(point)
        for k, pair in enumerate(_chosen(result, cycle, point, pairs)):
            c = _direction(cycle, pair)
            panels[1].plot(cycle.degrees, cycle.displacement[:, pair, c],
                           color=PALETTE[k % len(PALETTE)], linestyle=("-", "--")[k // 6 % 2],
                           label=f"{pair_name(result, pair)}, {DIRECTIONS[c]}")
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
    # Harmonics that vanish by symmetry have no place on a logarithmic axis.
    present = shown > 1e-16 * shown.max()
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
