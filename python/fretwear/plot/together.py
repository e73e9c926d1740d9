"""Responses of several results in one picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ..errors import InputError
from .response import Response, read_response
from .style import PALETTE, Source, as_result, label, new_figure, scale_axis, tidy

__all__ = ["plot_responses"]


def plot_responses(sources: Sequence[Source], observe: str | None = None) -> Figure:
    """Amplitude of one observed quantity against frequency, a curve for each result.

    Points that did not converge are left out. Each curve has the name of its file, and that of the
    folder where two files have the same.

    Parameters
    ----------
    sources : sequence of Result or path
        Results of sweeps or branches.
    observe : str, optional
        Observed quantity; the first of the first result without it.

    Raises
    ------
    InputError
        There are none, one has no response, or their amplitudes have different units.
    """
    if not sources:
        raise InputError("sources: names no result")
    results = [as_result(source) for source in sources]
    curves = [read_response(results[0], observe)]
    curves += [read_response(result, curves[0].name) for result in results[1:]]
    units = sorted({curve.units for curve in curves})
    if len(units) > 1:
        raise InputError("the results have different units: "
                         + ", ".join(one or "not known" for one in units))
    figure = new_figure(8.0, 4.8)
    axes = figure.subplots()
    for k, (name, curve) in enumerate(zip(_names([result.name for result in results]), curves)):
        good = np.where(curve.converged, curve.amplitude, np.nan)
        style = ("-", "--", "-.", ":")[k // len(PALETTE) % 4]
        axes.plot(curve.frequency, good, style, marker=".", markersize=3.0, linewidth=1.4,
                  color=PALETTE[k % len(PALETTE)], label=name)
    largest = max(_largest(curve) for curve in curves)
    axes.set_ylabel(label(f"amplitude of {curves[0].name}",
                          scale_axis(axes.yaxis, largest, units[0])))
    axes.set_ylim(0.0, 1.08 * largest or None)
    axes.set_xlabel("frequency [Hz]")
    tidy(axes)
    axes.legend(frameon=False)
    return figure


def _largest(curve: Response) -> float:
    good = curve.amplitude[curve.converged]
    return float(np.nanmax(good, initial=0.0))


def _names(paths: Sequence[str]) -> list[str]:
    """Names of the files, with their folders where a name is there twice."""
    stems = [Path(path).stem for path in paths]
    return [stem if stems.count(stem) == 1 else str(Path(path).with_suffix(""))
            for stem, path in zip(stems, paths)]
