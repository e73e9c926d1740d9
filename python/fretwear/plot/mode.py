"""A nonlinear mode: frequency and damping against amplitude."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..errors import InputError
from ..nonlinear_mode import NonlinearMode
from .style import CURVE, FAILED, Floats, Source, as_result, label, new_figure, tidy, units_of

__all__ = ["plot_mode"]

#: Colours of limit cycles, unstable and stable, and of the onset.
_CYCLE = (FAILED, "#009e73")
_ONSET = "0.4"
#: Damping ratios that differ by less, as a part of the largest, are one curve.
_SAME = 1e-3


def _draw_forced(axes: Axes, mode: NonlinearMode, amplitude: Floats) -> None:
    """What a forced measurement would call the damping ratio, where the shape changes."""
    forced = np.where(np.isfinite(amplitude), mode.forced_damping_ratio(), np.nan)
    largest = np.nanmax(np.abs(mode.damping_ratio[mode.converged]))
    if np.nanmax(np.abs(forced - mode.damping_ratio), initial=0.0) > _SAME * largest:
        axes.plot(amplitude, forced, "--", color=CURVE, linewidth=1.2,
                  label="of the forced motion, F/(2ma), m of the lowest amplitude")


def plot_mode(source: Source) -> Figure:
    """Frequency and damping ratio against the amplitude, which has a logarithmic axis.

    Dashed, where it differs: F/(2 m a) of a forced motion, with the modal mass m of the lowest
    amplitude.

    The dotted line is the onset of slip or separation; circles are limit cycles, full where they
    are stable.

    Parameters
    ----------
    source : Result or path
        Result of `analysis = 'mode'`.
    """
    result = as_result(source)
    mode = result.mode
    amplitude = np.where(mode.converged, mode.amplitude, np.nan)
    if not np.isfinite(amplitude).any():
        raise InputError(f"{result.name}: no point of the mode has converged")
    figure = new_figure(8.0, 6.0)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, values in zip(panels, (mode.frequency, mode.damping_ratio)):
        axes.plot(amplitude, values, color=CURVE, linewidth=1.6)
        if mode.onset > 0.0:
            axes.axvline(mode.onset, color=_ONSET, linestyle=":", linewidth=1.2,
                         label=f"onset, {mode.onset:.3g}")
        tidy(axes)
    _draw_forced(panels[1], mode, amplitude)
    if (mode.damping_ratio < 0.0).any():
        panels[1].axhline(0.0, color="black", linewidth=0.8)
    for cycle in mode.limit_cycles:
        colour = _CYCLE[cycle.stable]
        name = f"{'stable' if cycle.stable else 'unstable'} limit cycle, {cycle.amplitude:.3g}"
        for axes, height in zip(panels, (cycle.omega / (2.0 * np.pi), 0.0)):
            axes.plot([cycle.amplitude], [height], "o", color=colour, markersize=7,
                      markerfacecolor=colour if cycle.stable else "white", label=name)
    panels[0].set_xscale("log")
    panels[0].set_ylabel("frequency [Hz]")
    panels[0].ticklabel_format(axis="y", useOffset=False)
    panels[1].set_ylabel("damping ratio of the mode, ξ/(2ω)")
    if mode.control == "modal":
        text, units = "modal amplitude", units_of(result, "mode/modal_amplitude")
    else:
        text = f"first harmonic of {result.observed[0]}"
        units = units_of(result, "mode/first_harmonic")
    panels[1].set_xlabel(label(text, units))
    if panels[1].get_legend_handles_labels()[1]:
        # Above the panel, where it covers no curve.
        panels[1].legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0),
                         borderaxespad=0.0, ncols=2)
    figure.suptitle(f"Nonlinear mode {mode.number}, "
                    f"{mode.stuck_omega / (2.0 * np.pi):.6g} Hz with stuck pairs",
                    fontsize=11)
    return figure
