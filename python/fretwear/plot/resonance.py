"""A resonance against its parameter."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..errors import InputError
from .style import CURVE, FAILED, Floats, Source, as_result, label, new_figure, tidy, units_of

__all__ = ["plot_resonance"]


def plot_resonance(source: Source) -> Figure:
    """Amplitude and frequency of the resonance against the parameter; a circle is the optimum.

    Parameters
    ----------
    source : Result or path
        Result of `analysis = 'resonance'`.
    """
    result = as_result(source)
    track = result.resonance
    good = track.converged
    if not good.any():
        raise InputError(f"{result.name}: no point of the resonance has converged")
    figure = new_figure(8.0, 6.0)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, values in zip(panels, (track.amplitude, track.omega / (2.0 * np.pi))):
        axes.plot(track.parameter, np.where(good, values, np.nan), color=CURVE, linewidth=1.6)
        tidy(axes)
    best = track.optimum()
    if best is not None:
        panels[0].plot(*best, "o", color=FAILED, markersize=7, markerfacecolor="white",
                       label=f"smallest, {best[1]:.3g} near {_to_step(best[0], track.parameter)}")
        panels[0].legend(frameon=False, fontsize=8)
    text = "first harmonic" if track.quantity == "first_harmonic" else "largest value"
    panels[0].set_ylabel(label(f"{text} of {result.observed[0]}",
                               units_of(result, "resonance/value")))
    panels[1].set_ylabel("frequency [Hz]")
    panels[1].ticklabel_format(axis="y", useOffset=False)
    panels[1].set_xlabel(("factor of " if track.by_factor else "") + track.name)
    figure.suptitle(f"Resonance over {track.name}", fontsize=11)
    return figure


def _to_step(value: float, parameter: Floats) -> str:
    """A place between the rows, which are all that is known of it, in digits of their distance."""
    step = float(np.abs(np.diff(parameter)).max())
    return f"{value:.{int(np.clip(np.ceil(-np.log10(step)), 0, 9))}f}"
