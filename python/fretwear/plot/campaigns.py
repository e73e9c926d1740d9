"""Pictures of several runs: frequencies over the speed, and peaks over the load."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .._native import namelist_values
from ..errors import AbsentError, InputError
from ..result import Result
from ..shown import highest
from .disks import rotation_speed
from .style import (
    CURVE,
    FAILED,
    PALETTE,
    Floats,
    Source,
    as_result,
    label,
    new_figure,
    scale_axis,
    tidy,
    units_of,
)

__all__ = ["plot_campbell", "plot_damping", "plot_force", "read_damping"]

#: Lines of engine orders in a Campbell diagram without an order of the case.
_ORDERS = (1, 2, 3, 4, 5, 6)
#: Frequencies of a nodal diameter that are drawn.
_FAMILIES = 4
#: Height of the name of an engine order, over that of the panel.
_NAME_HEIGHT = 0.032


def plot_campbell(sources: Sequence[Source], nodal_diameter: int | None = None) -> Figure:
    """Frequencies of a nodal diameter over the rotation speed, with lines of engine orders.

    Parameters
    ----------
    sources : sequence of Result or path
        Results of ``analysis = 'modes'`` of one structure at several `model%rotation_speed`.
    nodal_diameter : int, optional
        The first of the results without it.

    Raises
    ------
    InputError
        The results hold no frequencies, or have one speed.
    """
    results = sorted((as_result(source) for source in sources), key=rotation_speed)
    speeds = np.array([rotation_speed(result) for result in results])
    for result in results:
        if "modes/open" not in result:
            raise AbsentError(f"{result.name}: holds no frequencies: run with case%analysis = "
                              "'modes'")
    if len(np.unique(speeds)) < 2:
        raise InputError("the results have one rotation speed; run case%analysis = 'modes' with "
                         "several model%rotation_speed")
    known = results[0]["modes/nodal_diameter"].astype(int).tolist()
    chosen = known[0] if nodal_diameter is None else nodal_diameter
    if chosen not in known:
        raise InputError(f"nodal diameter {chosen}: must be among {known[0]} to {known[-1]}")
    rpm = 30.0 / np.pi * speeds
    figure = new_figure(8.0, 5.2)
    axes = figure.subplots()
    curves: list[Floats] = []
    for state, style, colour in (("open", "o--", PALETTE[5]), ("closed", "o-", CURVE)):
        if all(f"modes/{state}" in result for result in results):
            rows = np.array([result[f"modes/{state}"][known.index(chosen), :_FAMILIES]
                             for result in results]) / (2.0 * np.pi)
            axes.plot(rpm, rows, style, color=colour, markersize=3.5, linewidth=1.2)
            curves += [row for row in rows.T if np.isfinite(row).all()]
            axes.plot([], [], style, color=colour, markersize=3.5, label=f"pairs {state}")
    n_sectors = int(results[0].attributes.get("n_sectors", 1))
    lowest = float(min(result["modes/open"][known.index(chosen), 0] for result in results)
                   / (2.0 * np.pi))
    orders = sorted({*_ORDERS, *(o for o in (chosen, n_sectors - chosen) if 0 < o <= 40)})
    # Families far above all crossings would leave no room for these.
    top = 1.08 * max(2.5 * lowest, orders[-1] * rpm[-1] / 60.0)
    _draw_orders(axes, orders, chosen, n_sectors, float(rpm[-1]), top)
    _draw_crossings(axes, rpm, curves, [order for order in orders
                                        if _excites(order, chosen, n_sectors)], top)
    axes.set_xlim(0.0, rpm[-1])
    axes.set_ylim(0.0, top)
    axes.set_xlabel("rotation speed [rpm]")
    axes.set_ylabel("frequency [Hz]")
    tidy(axes)
    axes.legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3,
                borderaxespad=0.0)
    figure.suptitle(f"Campbell diagram of nodal diameter {chosen}", fontsize=11)
    return figure


def _draw_orders(axes: Axes, orders: Sequence[int], chosen: int, n_sectors: int, fastest: float,
                 top: float) -> None:
    """Lines of engine orders up to a speed [rpm]; bold where they excite the nodal diameter."""
    said: set[bool] = set()
    place = -np.inf
    for order in orders:
        meets = _excites(order, chosen, n_sectors)
        end = order * fastest / 60.0
        text = f"engine order that excites {chosen}" if meets else "other engine order"
        axes.plot([0.0, fastest], [0.0, end], "-", linewidth=1.4 if meets else 0.7,
                  color=PALETTE[1] if meets else "0.6", zorder=1,
                  label=None if meets in said else text)
        said.add(meets)
        if end <= top:
            # Names move up where they would cover each other.
            place = max(end, place + _NAME_HEIGHT * top)
            axes.annotate(f"EO {order}", (fastest, place), xytext=(4, -2), fontsize=7,
                          textcoords="offset points", annotation_clip=False,
                          color=PALETTE[1] if meets else "0.35")


def _excites(order: int, diameter: int, n_sectors: int) -> bool:
    """Whether an engine order does work on the modes of a nodal diameter."""
    return n_sectors == 1 or (order - diameter) % n_sectors == 0 or \
        (order + diameter) % n_sectors == 0


def _draw_crossings(axes: Axes, rpm: Floats, curves: Sequence[Floats], orders: Sequence[int],
                    top: float) -> None:
    """Rings where engine orders meet frequencies, linear between the speeds of the results."""
    found = []
    for order in orders:
        for curve in curves:
            apart = curve - order * rpm / 60.0
            for k in np.flatnonzero(apart[:-1] * apart[1:] < 0.0):
                share = apart[k] / (apart[k] - apart[k + 1])
                speed = rpm[k] + share * (rpm[k + 1] - rpm[k])
                found.append((speed, order * speed / 60.0))
    shown = [(x, y) for x, y in found if y <= top]
    if shown:
        axes.plot(*np.transpose(shown), "o", color=CURVE, markerfacecolor="white", markersize=7,
                  zorder=4, linestyle="none", label="crossing")


def read_damping(sources: Sequence[Source], observe: str | None = None) -> NDArray[np.float64]:
    """Peaks of sweeps that differ in their load, by the load.

    Returns
    -------
    (n_results, 5) array
        Amplitude of the load [F], mean interference of the pairs [L] (0: none), largest amplitude
        of harmonic 1 of the observed quantity over the load [L/F], where it is [Hz], and 1 where
        that is a peak, 0 where it is an end of the sweep or where points failed beside it.
    """
    return np.array(sorted(_rows_of([as_result(source) for source in sources], observe)))


def _rows_of(results: Sequence[Result], observe: str | None) -> list[tuple[float, ...]]:
    """The row of each result, in their order."""
    rows: list[tuple[float, ...]] = []
    for result in results:
        if "omega" not in result or result.n_points < 2:
            raise AbsentError(f"{result.name}: is no sweep, which has a peak")
        with result.case.open() as session:
            load = float(np.hypot(session.part("load/cosine"), session.part("load/sine")).max())
            gap: Floats = session.part("contact/gap")
        if load == 0.0:
            raise InputError(f"{result.name}: has no load that vibrates")
        top = highest(result, observe, "first_harmonic")
        if top is None:
            raise InputError(f"{result.name}: no point converged")
        rows.append((load, -float(gap.mean()) if len(gap) else 0.0, top.height / load, top.place,
                     float(top.is_peak)))
    return rows


def plot_damping(sources: Sequence[Source], observe: str | None = None, *,
                 upwards: Sequence[Source] = (),
                 linear: Sequence[tuple[str, Source]] = ()) -> Figure:
    """Peak amplitude over the load, and its frequency, against the load: where friction damps best.

    Against the load over the interference, where pairs have one: only that counts for an elastic
    law; loads stand above where the interference is one. The amplitude is that of harmonic 1,
    without the static displacement. Sweeps that are highest at an end, or beside points that
    failed, have no peak: rings off the curve. Crosses are sweeps in which points failed anywhere.

    Parameters
    ----------
    sources : sequence of Result or path
        Sweeps of one structure that differ in `load%harmonic_scale`, or in `contact%gap`.
    observe : str, optional
        Observed quantity; the first one without it.
    upwards : sequence of Result or path
        The same in the other direction: a curve of its own.
    linear : sequence of (str, Result or path)
        Linear limits with their names, such as every pair stuck: dashed lines.
    """
    results: list[Result] = [as_result(source) for source in sources]
    rows = _rows_of(results, observe)
    by_load = sorted(range(len(rows)), key=rows.__getitem__)
    found = np.array([rows[k] for k in by_load])
    failed = np.array([not results[k].converged.all() for k in by_load])
    length, force = units_of(results[0], "amplitude"), units_of(results[0], "contact/force")
    preloaded = bool((found[:, 1] > 0.0).all())
    abscissa = found[:, 0] / found[:, 1] if preloaded else found[:, 0]
    order = np.argsort(abscissa)
    figure = new_figure(7.6, 6.2 if upwards or linear else 5.8)
    upper, lower = figure.subplots(2, 1, sharex=True)
    _draw_peaks(upper, abscissa[order], found[order, 2], found[order, 4], CURVE,
                _way(results[0]) if upwards else "peak")
    name = results[0].observed[results[0].index(observe)]
    upper.set_ylabel(label(f"peak of {name} over load", _ratio(length, force)))
    upper.set(xscale="log", yscale="log")
    _draw_peaks(lower, abscissa[order], found[order, 3], found[order, 4], PALETTE[1])
    if upwards:
        others: list[Result] = [as_result(source) for source in upwards]
        back = read_damping(others, observe)
        along = back[:, 0] / back[:, 1] if preloaded else back[:, 0]
        # Thin through all: a sweep up from open pairs often has no peak under small loads.
        for axes, column in ((upper, 2), (lower, 3)):
            axes.plot(along, back[:, column], "--", color=PALETTE[2], linewidth=1.0,
                      label=_way(others[0]) if column == 2 else None)
            _draw_peaks(axes, along, back[:, column], back[:, 4], PALETTE[2], "", "s")
    if failed.any():
        # A higher peak may be among the points that failed.
        upper.plot(abscissa[failed], found[failed, 2], "x", color=FAILED, markersize=7, zorder=4,
                   label="some points not converged")
    for k, (text, source) in enumerate(linear):
        (_, _, size, at, _), = read_damping([source], observe)
        for axes, value in ((upper, size), (lower, at)):
            axes.axhline(value, color="0.45", linestyle=("--", ":")[k % 2], linewidth=1.2,
                         label=f"linear, {text}")
    if upwards or linear or len(upper.lines) > 1:
        upper.legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.24),
                     ncols=3, borderaxespad=0.0)
    if preloaded and np.ptp(found[:, 1]) <= 1e-9 * found[:, 1].max():
        gap = float(found[0, 1])
        above = upper.secondary_xaxis("top", functions=(lambda x: x * gap, lambda x: x / gap))
        above.set_xlabel(label("load", force), fontsize=9)
    lower.set_ylabel("frequency of the peak [Hz]")
    lower.set_xlabel(label("load over interference", _ratio(force, length)) if preloaded
                     else label("load", force))
    for axes in (upper, lower):
        tidy(axes)
    figure.suptitle("Damping curve", fontsize=11)
    return figure


def _way(result: Result) -> str:
    """Which way a sweep goes."""
    return "sweep up" if result.omega[-1] > result.omega[0] else "sweep down"


def _draw_peaks(axes: Axes, x: Floats, y: Floats, is_peak: Floats, colour: str,
                text: str = "peak", style: str = "o-") -> None:
    """Peaks joined by a curve; rings for sweeps that have none."""
    peaks = is_peak > 0.0
    axes.plot(x[peaks], y[peaks], style, color=colour, markersize=4.0, label=text or None)
    if not peaks.all():
        axes.plot(x[~peaks], y[~peaks], "o", color=colour, markersize=5.0, markerfacecolor="white",
                  label="largest, no peak" if not text
                  else "largest, no peak: an end of the sweep, or points failed")


def plot_force(sources: Sequence[Source], observe: str | None = None) -> Figure:
    """Peak amplitude over the load, beside what a linear structure would do from the smallest load.

    Parameters
    ----------
    sources, observe
        See `plot_damping`.
    """
    results: list[Result] = [as_result(source) for source in sources]
    load, _, compliance, frequency, is_peak = read_damping(results, observe).T
    length, force = units_of(results[0], "amplitude"), units_of(results[0], "contact/force")
    height = compliance * load
    by_factor = _unit_load(results)
    if by_factor is not None:
        # Loads of a reduced model have no size of their own.
        load, compliance = load / by_factor, compliance * by_factor
    figure = new_figure(7.6, 5.2)
    axes = figure.subplots()
    first = int(np.argmax(is_peak))  # without any peak the smallest load
    name = "the smallest load" if first == 0 else "the smallest load with a peak"
    axes.plot([0.0, load[-1]], [0.0, compliance[first] * load[-1]], "--", color="0.6",
              linewidth=1.2, label=f"in proportion to {name}")
    _draw_peaks(axes, load, height, is_peak, CURVE)
    for k in range(len(load)):
        axes.annotate(f"{frequency[k]:.5g} Hz", (load[k], height[k]), xytext=(4, -12),
                      textcoords="offset points", fontsize=8, annotation_clip=False)
    top = max(float(height.max()), compliance[first] * load[-1])
    axes.set_xlim(0.0, 1.08 * load[-1])
    axes.set_ylim(0.0, 1.08 * top)
    name = results[0].observed[results[0].index(observe)]
    axes.set_ylabel(label(f"peak of {name}, harmonic 1", scale_axis(axes.yaxis, top, length)))
    axes.set_xlabel("factor of the load, load%harmonic_scale" if by_factor is not None
                    else label("load", scale_axis(axes.xaxis, float(load[-1]), force)))
    tidy(axes)
    axes.legend(frameon=False)
    figure.suptitle("Amplitude over force", fontsize=11)
    return figure


def _unit_load(results: Sequence[Result]) -> float | None:
    """The largest entry of the load at `load%harmonic_scale` = 1, where several dofs are loaded;
    None for one dof, whose load is a force, or where it is not the same in all results."""
    found = []
    for result in results:
        with result.case.open() as session:
            size = np.hypot(session.part("load/cosine"), session.part("load/sine"))
        if np.count_nonzero(size) < 2:
            return None
        values = namelist_values(result.namelist)
        factor = float(values.get("load%harmonic_scale", ["1"])[0])
        found.append(float(size.max()) / factor if factor != 0.0 else 0.0)
    alike = min(found) > 0.0 and max(found) - min(found) <= 1e-9 * max(found)
    return found[0] if alike else None


def _ratio(over: str, under: str) -> str:
    return f"{over}/{under}" if over and under else ""
