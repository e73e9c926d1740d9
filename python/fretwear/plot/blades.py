"""Disks whose sectors differ: all blades over the sweep, and the waves that they make."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..errors import AbsentError
from ..result import Result
from ..rows import choose_point, status_words
from .style import CURVE, PALETTE, Source, as_result, label_y, new_figure, tidy, units_of

__all__ = ["plot_blades", "plot_content"]


def plot_blades(source: Source, observe: str | None = None) -> Figure:
    """One observed quantity of every sector over the sweep, and the largest of all; of a single
    point over the sectors.

    Parameters
    ----------
    source : Result or path
        Result with ``cyclic%mistuned``.
    observe : str, optional
        Observed quantity, of any sector; the first one without it.
    """
    result = _mistuned(source)
    column = _quantity(result, observe)
    amplitude = np.where(result.converged[:, None], result.sector_amplitude[:, :, column], np.nan)
    figure = new_figure()
    axes = figure.subplots()
    if result.n_points == 1:
        axes.bar(np.arange(amplitude.shape[1]), amplitude[0], color=CURVE)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_xlabel("sector")
    else:
        over = result.parameter_name if "parameter" in result else ""
        place = result.parameter if over else result.frequency
        for blade in amplitude.T:
            axes.plot(place, blade, color="0.7", linewidth=0.7)
        largest = np.where(result.converged, result["blades/largest"][:, column], np.nan)
        axes.plot(place, largest, color=CURVE, linewidth=1.6, label="largest of all")
        axes.legend(frameon=False, fontsize=8)
        axes.set_xlabel(over or "frequency [Hz]")
    label_y(axes, _name(result, column), units_of(result, "amplitude"))
    tidy(axes)
    best = np.unravel_index(int(np.nanargmax(amplitude)), amplitude.shape)
    axes.set_title(f"{amplitude.shape[1]} sectors, the largest is sector {best[1]}", fontsize=11)
    return figure


def plot_content(source: Source, point: int | None = None, observe: str | None = None) -> Figure:
    """Amplitudes of the nodal diameters that the first harmonics of the sectors are made of.

    Parameters
    ----------
    source : Result or path
        Result with ``cyclic%mistuned``.
    point : int, optional
        Solution point from 0; that of the largest amplitude of all sectors without it.
    observe : str, optional
        Observed quantity, of any sector; the first one without it.
    """
    result = _mistuned(source)
    column = _quantity(result, observe)
    point = _largest(result, column) if point is None else point
    diameter, size = result["blades/nodal_diameter"], result["blades/content"][point, column]
    loaded = int(result["cyclic/nodal_diameter"][min(1, result.n_harmonics)])
    figure = new_figure()
    axes = figure.subplots()
    axes.bar(diameter, size, color=[CURVE if k == loaded else PALETTE[5] for k in diameter])
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("nodal diameter, positive towards higher sectors")
    label_y(axes, f"{_name(result, column)}, first harmonic", units_of(result, "amplitude"))
    tidy(axes)
    axes.set_title(f"Waves at {result.frequency[point]:.6g} Hz, the load has nodal diameter "
                   f"{loaded}{status_words(result, point)}", fontsize=11)
    return figure


def _mistuned(source: Source) -> Result:
    result = as_result(source)
    if "blades/largest" not in result:
        raise AbsentError(f"{result.name}: its sectors are alike: run the case with "
                          "cyclic%mistuned = .true.")
    return result


def _largest(result: Result, column: int) -> int:
    """Point of the largest amplitude of any sector; as of other pictures along wear."""
    if "wear/depth" in result or not result.converged.any():
        return choose_point(result, None)
    return int(np.argmax(np.where(result.converged, result["blades/largest"][:, column], -np.inf)))


def _quantity(result: Result, observe: str | None) -> int:
    """Column among the quantities of a sector."""
    return result.index(observe) % result["blades/largest"].shape[1]


def _name(result: Result, column: int) -> str:
    return result.observed[column].rsplit("@", 1)[0]
