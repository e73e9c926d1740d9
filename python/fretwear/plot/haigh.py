"""Stress amplitude over mean stress of all points, with what they endure."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .._native import namelist_values
from ..errors import AbsentError, InputError
from ..result import Result
from ..rows import status_words
from .style import CURVE, PALETTE, Floats, Source, as_result, label, new_figure, tidy, units_of

__all__ = ["plot_haigh"]

_GERBER = "gerber"


def plot_haigh(source: Source, point: int | None = None) -> Figure:
    """Amplitude over mean of the cycle of every stress point (Haigh's diagram).

    Where all points have the same strengths the limit of the diagram that the case chose is drawn;
    else both axes are in parts of the strengths of each point.

    Parameters
    ----------
    source : Result or path
        Result with stress.
    point : int, optional
        Solution point from 0; that of the largest utilisation, or amplitude, without it.

    Raises
    ------
    AbsentError
        The result holds no stress.
    """
    result = as_result(source)
    if "stress/amplitude" not in result:
        raise AbsentError(f"{result.name}: holds no stress: its model has no rows of it (/stress), "
                          "or stress%output is 'none'")
    judge = result["stress/utilisation" if "stress/utilisation" in result else "stress/amplitude"]
    if point is None:
        known = np.where(result.converged[:, None], judge, -np.inf)
        point = int(known.max(axis=1).argmax())
    if not 0 <= point < result.n_points:
        raise InputError(f"point {point}: must be 0 to {result.n_points - 1}")
    amplitude, mean = (result[f"stress/{name}"][point] for name in ("amplitude", "mean"))
    strengths = _strengths(result, len(amplitude))
    units = units_of(result, "stress/amplitude")
    figure = new_figure(6.4, 4.6)
    axes = figure.subplots()
    worst = int(judge[point].argmax())
    if strengths is None:
        axes.set_xlabel(label("mean stress", units))
        axes.set_ylabel(label("stress amplitude", units))
    elif np.ptp(strengths[0]) == np.ptp(strengths[1]) == 0.0:
        _limit(result, axes, float(strengths[0][0]), float(strengths[1][0]), mean)
        axes.set_xlabel(label("mean stress", units))
        axes.set_ylabel(label("stress amplitude", units))
    else:
        amplitude, mean = amplitude / strengths[0], mean / strengths[1]
        _limit(result, axes, 1.0, 1.0, mean)
        axes.set_xlabel("mean stress / static strength")
        axes.set_ylabel("stress amplitude / endurance")
    axes.plot(mean, amplitude, ".", color=CURVE, markersize=3, alpha=0.5)
    axes.plot(mean[worst], amplitude[worst], "o", color=PALETTE[1], markersize=7,
              label=_name(result, worst, len(amplitude)))
    axes.set_ylim(bottom=0.0)
    tidy(axes)
    axes.legend(frameon=False, fontsize=8)
    title = f"Stress at {result.frequency[point]:.6g} Hz{status_words(result, point)}"
    if "stress/utilisation" in result:
        title += f", largest utilisation {judge[point, worst]:.3f}"
    axes.set_title(title, fontsize=11)
    return figure


def _strengths(result: Result, n: int) -> tuple[Floats, Floats] | None:
    """Endurance and static strength of every point; None where they are not known."""
    values = namelist_values(result.namelist)
    found: list[NDArray[np.float64]] = []
    for name in ("endurance", "ultimate"):
        words = values.get(f"stress%{name}")
        if not words or "stress/utilisation" not in result or n % len(words):
            return None
        found.append(np.tile([float(word) for word in words], n // len(words)))
    return found[0], found[1]


def _limit(result: Result, axes: Axes, endurance: float, ultimate: float, mean: Floats) -> None:
    """Utilisation of 1, from the lowest mean stress on."""
    words = namelist_values(result.namelist).get("stress%diagram", ["goodman"])
    share = np.linspace(0.0, 1.0, 101)
    gerber = words[0].strip("'\"") == _GERBER
    height = endurance * (1.0 - (share**2 if gerber else share))
    lowest = min(0.0, float(mean.min()))
    axes.plot(np.concatenate(([lowest], ultimate * share)), np.concatenate(([endurance], height)),
              "-", color="0.4", linewidth=1.0, label="Gerber" if gerber else "Goodman")


def _name(result: Result, worst: int, n: int) -> str:
    n_sectors = int(result.attributes.get("n_sectors", 1)) if "blades/largest" in result else 1
    own = n // max(n_sectors, 1)
    return f"point {worst % own}" + (f" of sector {worst // own}" if n_sectors > 1 else "")
