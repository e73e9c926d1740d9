"""Bladed disks: frequencies over the nodal diameter, with the line of a speed, and the wave."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from .._native import namelist_values
from ..errors import AbsentError
from ..result import Result
from ..rows import choose_point, status_words, synthesis
from .style import (
    CURVE,
    PALETTE,
    Floats,
    Source,
    as_result,
    label,
    largest_of,
    new_figure,
    scale,
    scale_axis,
    tidy,
    units_of,
)

__all__ = ["folded", "plot_nodal_diameters", "plot_safe", "plot_wave", "rotation_speed"]

#: Keeps a name readable over lines.
_BEHIND = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8}
#: Phases of the period at which the wave is drawn [turns].
_PHASES = (0.0, 0.125, 0.25, 0.375)
#: An engine order is near a frequency within this part of it.
_NEAR = 0.01
#: Room above the families of the middle nodal diameter.
_ROOM = 1.6


def rotation_speed(result: Result) -> float:
    """Rotation speed of a run [rad/s]."""
    return float(namelist_values(result.namelist).get("model%rotation_speed", ["0"])[0])


def folded(engine_order: NDArray[np.int_], n_sectors: int) -> NDArray[np.int_]:
    """Nodal diameter that an engine order excites, without its sign."""
    found = np.abs(engine_order) % n_sectors
    return np.minimum(found, n_sectors - found)


def plot_nodal_diameters(source: Source) -> Figure:
    """Natural frequencies over the nodal diameter, with pairs open and closed.

    Parameters
    ----------
    source : Result or path
        Result of ``analysis = 'modes'`` of a cyclic structure.
    """
    result = _modes(source)
    figure = new_figure(8.0, 5.4)
    axes = figure.subplots()
    _draw_families(axes, result)
    _frame(axes, result)
    axes.set_title(f"Natural frequencies of {_sectors(result)} sectors", fontsize=11)
    return figure


def plot_safe(source: Source, speed: float | None = None) -> Figure:
    """The same with the line of a speed: where it meets a frequency at a nodal diameter, an engine
    order excites that mode (SAFE diagram).

    Parameters
    ----------
    source : Result or path
        Result of ``analysis = 'modes'`` of a cyclic structure.
    speed : float, optional
        Rotation speed [rad/s]; that of the run without it.

    Raises
    ------
    AbsentError
        The run has no speed, and none is given.
    """
    result = _modes(source)
    speed = rotation_speed(result) if speed is None else speed
    if speed <= 0.0:
        raise AbsentError(f"{result.name}: was run without model%rotation_speed, so there is no "
                          "line to draw; give a speed")
    figure = new_figure(8.0, 5.4)
    axes = figure.subplots()
    _draw_families(axes, result)
    top = axes.get_ylim()[1]
    n, hertz = _sectors(result), speed / (2.0 * np.pi)
    orders = np.arange(0, int(top / hertz) + 1)
    # Corners where the line turns back lie on nodal diameters 0 and N/2.
    corners = np.arange(0.0, top / hertz + 0.5 * n, 0.5 * n)
    corners = corners[corners * hertz <= top]
    place = np.unique(np.concatenate((orders, corners, [top / hertz])))
    fold = np.abs((place + 0.5 * n) % n - 0.5 * n)
    axes.plot(fold, place * hertz, "-", color="0.45", linewidth=1.0)
    axes.plot(folded(orders, n), orders * hertz, "s", color="0.25", markersize=4.0)
    _draw_resonances(axes, result, orders, hertz)
    for order in orders[1:]:
        if order % max(1, n // 4) == 0 and order * hertz < 0.96 * top:
            axes.annotate(f"EO {order}", (folded(np.array([order]), n)[0], order * hertz),
                          xytext=(0, 8), textcoords="offset points", fontsize=8, color="0.25",
                          ha="center", bbox=_BEHIND)
    _frame(axes, result)
    axes.set_title(f"Engine orders at {speed:.5g} rad/s ({60.0 * hertz:.5g} rpm), folded at "
                   f"nodal diameter {n // 2}", fontsize=11)
    return figure


def _draw_resonances(axes: Axes, result: Result, orders: NDArray[np.int_], hertz: float) -> None:
    """Rings on engine orders that come near a frequency of the nodal diameter that they excite."""
    known = result["modes/nodal_diameter"].astype(int).tolist()
    for state, colour in (("open", PALETTE[5]), ("closed", CURVE)):
        if f"modes/{state}" not in result:
            continue
        near = [(k, order * hertz) for order in orders[1:]
                if (k := int(folded(np.array([order]), _sectors(result))[0])) in known
                and np.nanmin(np.abs(result[f"modes/{state}"][known.index(k)]
                                     / (2.0 * np.pi * order * hertz) - 1.0)) < _NEAR]
        if near:
            axes.plot(*np.transpose(near), "o", color=colour, markerfacecolor="none",
                      markersize=10, markeredgewidth=1.5, linestyle="none", zorder=5)


def plot_wave(source: Source, point: int | None = None, observe: str | None = None) -> Figure:
    """One observed quantity of all sectors, at instants of the period and at its largest.

    Parameters
    ----------
    source : Result or path
        Result of a cyclic structure.
    point : int, optional
        Solution point from 0; the one with the largest amplitude without it.
    observe : str, optional
        Observed quantity; the first one without it.
    """
    result = as_result(source)
    if "engine_order" not in result.attributes:
        raise AbsentError(f"{result.name}: has no sectors: give the case &cyclic n_sectors and "
                          "engine_order")
    point = choose_point(result, None) if point is None else point
    column, n = result.index(observe), _sectors(result)
    width = len(result.observed) // (n if result.is_mistuned else 1)
    sectors = np.arange(n + 1)
    tau = 2.0 * np.pi * np.arange(256) / 256
    waves = np.array([result.sector(j)[point, :, column % width] for j in range(n + 1)])
    history = waves @ synthesis(waves.shape[1], tau)
    # What does not vibrate would take the picture: its value is said beside.
    mean = waves[:, 0].copy()
    waves[:, 0] = 0.0
    history -= mean[:, None]
    figure = new_figure(8.6, 4.6)
    axes = figure.subplots()
    axes.fill_between(sectors, history.min(axis=1), history.max(axis=1), color="0.92", zorder=0,
                      label="range")
    for phase, colour in zip(_PHASES, PALETTE):
        instant = synthesis(waves.shape[1], np.array([2.0 * np.pi * phase]))[:, 0]
        axes.plot(sectors, waves @ instant, "-o", markersize=3.5, linewidth=1.2, color=colour,
                  label=f"{360.0 * phase:g}°")
    axes.set_xlim(0, n)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("sector")
    units = units_of(result, "amplitude")
    axes.set_ylabel(label(f"{result.observed[column]} about its mean", scale_axis(
        axes.yaxis, largest_of(history), units)))
    tidy(axes)
    factor, own = scale(largest_of(mean), units)
    low, high = (f"{factor * value:.4g}" for value in (mean.min(), mean.max()))
    axes.text(0.0, -0.16, f"mean, left out: {low}" + (f" to {high}" if high != low else "")
              + f" {own}".rstrip(), transform=axes.transAxes, fontsize=8, color="0.35")
    axes.legend(title="phase of\nthe period", frameon=False, fontsize=8, title_fontsize=8,
                loc="center left", bbox_to_anchor=(1.0, 0.5))
    order = int(result.attributes["engine_order"])
    signed = int(result["cyclic/nodal_diameter"][min(1, result.n_harmonics)])
    axes.set_title(f"Engine order {order}: {abs(signed)} nodal diameters"
                   + (", towards higher sectors" if signed > 0 and 2 * signed < n else
                      ", towards lower sectors" if signed < 0 else "")
                   + f", at {result.frequency[point]:.6g} Hz{status_words(result, point)}",
                   fontsize=11)
    return figure


def _modes(source: Source) -> Result:
    result = as_result(source)
    if "modes/open" not in result or len(result["modes/open"]) < 2:
        raise AbsentError(f"{result.name}: holds no frequencies of nodal diameters: run a cyclic "
                          "structure with case%analysis = 'modes'")
    return result


def _sectors(result: Result) -> int:
    return int(result.attributes["n_sectors"])


def _draw_families(axes: Axes, result: Result) -> None:
    """A curve for every number of a mode within its nodal diameter."""
    diameters = result["modes/nodal_diameter"]
    for state, style, colour in (("open", "o--", PALETTE[5]), ("closed", "o-", CURVE)):
        if f"modes/{state}" in result:
            values: Floats = result[f"modes/{state}"] / (2.0 * np.pi)
            # Thin: they join modes of one rank, and shapes change over where two come near.
            axes.plot(diameters, values, style, color=colour, markersize=4.0, linewidth=0.6)
    axes.set_ylim(0.0, 1.05 * _top(result) / (2.0 * np.pi))


def _top(result: Result) -> float:
    """The highest of the first four families, or of those that all nodal diameters have: what
    climbs far above the others leaves them no room."""
    states = [result[f"modes/{state}"][:, :4] for state in ("open", "closed")
              if f"modes/{state}" in result]
    tops = np.concatenate([np.nanmax(values, axis=1) for values in states])
    return float(min(np.nanmax(tops), _ROOM * np.nanmedian(tops)))


def _frame(axes: Axes, result: Result) -> None:
    handles = [Line2D([], [], color=PALETTE[5], linestyle="--", marker="o", markersize=3.5,
                      label="pairs open"),
               Line2D([], [], color=CURVE, marker="o", markersize=3.5, label="pairs closed")]
    if any(line.get_markersize() == 10 for line in axes.lines):
        handles += [Line2D([], [], color="0.25", marker="s", markersize=4.0, linewidth=1.0,
                           label="engine orders"),
                    Line2D([], [], color="0.25", marker="o", markersize=10, linestyle="none",
                           markerfacecolor="none",
                           label=f"within {100 * _NEAR:g} % of\na frequency")]
    axes.legend(handles=handles, frameon=False, fontsize=8, loc="center left",
                bbox_to_anchor=(1.0, 0.5))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("nodal diameter")
    axes.set_ylabel("frequency [Hz]")
    tidy(axes)
