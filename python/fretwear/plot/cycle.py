"""One period: hysteresis loops of the pairs, displacements over a cycle, harmonics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from ..errors import InputError
from ..export.recovery import relative_displacement
from ..result import DIRECTIONS, Result
from ..rows import choose_point, synthesis
from .style import (
    CURVE,
    PALETTE,
    Floats,
    Source,
    as_result,
    label,
    new_figure,
    pair_name,
    tidy,
    units_of,
)

__all__ = ["Cycle", "plot_cycle", "plot_harmonics", "plot_hysteresis", "read_cycle"]

#: Instants of a period where the file holds no histories.
_INSTANTS = 256
#: Pairs drawn unless others are asked for.
_MOST_PAIRS = 6


@dataclass(frozen=True)
class Cycle:
    """One period of the contact, closed: the last instant repeats the first.

    Attributes
    ----------
    degrees : (n_time + 1,)
        Phase of the excitation [degrees].
    displacement, force : (n_time + 1, n_pairs, 3)
        Relative displacement [length] and contact force [force] in (t1, t2, n).
    sampled : bool
        Forces as the march gave them; otherwise sums of the stored harmonics.
    """

    degrees: Floats
    displacement: Floats
    force: Floats
    sampled: bool


def read_cycle(result: Result, point: int) -> Cycle:
    """One period at a point (from 0), from the histories of the file or from its harmonics.

    Raises
    ------
    InputError
        There are neither histories nor forces and a model to recover displacements from.
    """
    sampled = "history/relative_displacement" in result
    if sampled:
        displacement = result["history/relative_displacement"][point]
        force = result["history/force"][point]
        sampled = bool(np.isfinite(force).all())
    if not sampled:
        if "contact/force" not in result:
            raise InputError(f"{result.path}: holds no contact forces; run with output%contact = "
                             ".true.")
        tau = 2.0 * np.pi * np.arange(_INSTANTS) / _INSTANTS
        series = synthesis(result.coefficients.shape[1], tau)
        relative = relative_displacement(result, [point])[point]
        displacement = np.einsum("cij,ct->tij", relative, series)
        force = np.einsum("cij,ct->tij", result.force[point], series)
    degrees = np.linspace(0.0, 360.0, len(force) + 1)
    return Cycle(degrees, np.concatenate((displacement, displacement[:1])),
                 np.concatenate((force, force[:1])), sampled)


def _chosen(result: Result, cycle: Cycle, point: int, pairs: Sequence[int] | None) -> list[int]:
    """Pairs to draw: those asked for (from 0), or those that dissipate most."""
    if pairs is not None:
        wrong = [pair + 1 for pair in pairs if not 0 <= pair < cycle.force.shape[1]]
        if wrong:
            raise InputError(f"{result.path}: pair {wrong[0]}: there are {cycle.force.shape[1]}, "
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
        With histories (`&output histories`), forces are drawn as sampled; without, as the sum of
        their harmonics.
    point : int, optional
        Point from 0; that of the largest amplitude without it.
    pairs : sequence of int, optional
        Pairs from 0; the six that dissipate most without it. Of the two tangential directions
        the one of larger motion is drawn, of a pair without any the normal one.
    """
    result = as_result(source)
    point = choose_point(result, None) if point is None else point
    cycle = read_cycle(result, point)
    drawn = _chosen(result, cycle, point, pairs)
    columns = min(3, len(drawn))
    rows = math.ceil(len(drawn) / columns)
    figure = new_figure(max(3.3 * columns + 0.8, 5.6), max(2.9 * rows + 0.6, 3.8))
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, pair in zip(panels, drawn):
        c = _direction(cycle, pair)
        axes.plot(cycle.displacement[:, pair, c], cycle.force[:, pair, c], color=CURVE)
        axes.set_title(f"{pair_name(result, pair)}, {DIRECTIONS[c]}", fontsize=10)
        axes.ticklabel_format(scilimits=(-3, 3), useMathText=True)
        tidy(axes)
    for axes in panels[len(drawn):]:
        axes.set_visible(False)
    figure.supxlabel(label("relative displacement", units_of(result, "amplitude")), fontsize=10)
    figure.supylabel(label("contact force", units_of(result, "contact/force")), fontsize=10)
    kind = "" if cycle.sampled else f"\n(forces up to harmonic {_highest(result, point)})"
    figure.suptitle(f"Hysteresis at {_at(result, point)}{kind}", fontsize=11)
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
    panels[0].plot(degrees, result.coefficients[point, :, column] @ series, color=CURVE)
    name = result.observed[column]
    panels[0].set_ylabel(label(name, units_of(result, "amplitude")))
    panels[0].set_title(f"One cycle at {_at(result, point)}", fontsize=11)
    if has_contact:
        cycle = read_cycle(result, point)
        for k, pair in enumerate(_chosen(result, cycle, point, pairs)):
            c = _direction(cycle, pair)
            panels[1].plot(cycle.degrees, cycle.displacement[:, pair, c],
                           color=PALETTE[k % len(PALETTE)], linestyle=("-", "--")[k // 6 % 2],
                           label=f"{pair_name(result, pair)}, {DIRECTIONS[c]}")
        panels[1].set_ylabel(label("relative displacement", units_of(result, "amplitude")))
        panels[1].ticklabel_format(axis="y", scilimits=(-3, 3), useMathText=True)
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
    axes.set_xlabel("harmonic [1]")
    axes.set_ylabel(label(f"amplitude of {result.observed[column]}",
                          units_of(result, "amplitude")))
    axes.set_title(f"Harmonics at {_at(result, point)}", fontsize=11)
    tidy(axes)
    return figure
