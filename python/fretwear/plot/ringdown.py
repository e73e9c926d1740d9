"""A free decay over time, and its frequency and damping over the amplitude."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..errors import AbsentError
from .style import CURVE, PALETTE, Source, as_result, label, new_figure, tidy, units_of

__all__ = ["plot_ringdown"]

#: Swings below this part of the first are left out of the right side: their damping is round-off.
_LEAST = 1e-6


def plot_ringdown(source: Source) -> Figure:
    """The first observed quantity over time; frequency and damping of its half swings.

    Parameters
    ----------
    source : Result or path
        Result of ``analysis = 'ringdown'``.

    Raises
    ------
    AbsentError
        The result is of another analysis.
    """
    result = as_result(source)
    if "ringdown/observed" not in result:
        raise AbsentError(f"{result.name}: holds no free decay: give case%analysis = 'ringdown'")
    units = units_of(result, "ringdown/observed")
    figure = new_figure(8.4, 4.2)
    left, right = figure.subplots(1, 2)
    left.plot(result["ringdown/time"], result["ringdown/observed"][:, 0], "-", color=CURVE,
              linewidth=0.8)
    left.plot(result["ringdown/extreme/time"], result["ringdown/extreme/value"][:, 0], ".",
              color=PALETTE[1], markersize=5, label="extremes")
    left.set_xlabel("time [s]")
    left.set_ylabel(label(str(result.observed[0]), units))
    left.legend(frameon=False, fontsize=8)
    amplitude = result["ringdown/amplitude"][:, 0]
    known = amplitude[1:-1] > _LEAST * amplitude.max(initial=0.0)
    other = right.twinx()
    lines = right.plot(amplitude[1:-1][known],
                       result["ringdown/omega"][1:-1][known] / (2.0 * np.pi), ".-", color=CURVE,
                       label="frequency")
    lines += other.plot(amplitude[1:-1][known], result["ringdown/damping_ratio"][known], ".-",
                        color=PALETTE[1], label="damping ratio")
    right.set_xlabel(label("amplitude of a half swing", units))
    right.set_ylabel("frequency [Hz]")
    other.set_ylabel("damping ratio")
    other.set_ylim(bottom=min(0.0, other.get_ylim()[0]))
    right.legend(handles=lines, frameon=False, fontsize=8)
    tidy(left)
    tidy(right)
    figure.suptitle("Free decay", fontsize=11)
    return figure
