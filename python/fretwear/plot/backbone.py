"""The backbone of a mode: its amplitude against its frequency, over responses of sweeps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..errors import InputError
from ..result import Result
from .style import (
    CURVE,
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
from .together import told_apart

__all__ = ["plot_backbone"]

#: Amplitudes over a wider range than this have a logarithmic axis.
_WIDE = 50.0
#: Room beside the curve of a mode, over its width, where responses go on.
_ROOM = 0.6


def plot_backbone(sources: Source | Sequence[Source], observe: str | None = None) -> Figure:
    """Amplitude of the first harmonic against frequency: modes, their synthesis, and sweeps.

    Modes are thick, the responses put together from them (`mode%synthesis`) dashed, sweeps thin
    with dots. Dotted: the frequency with stuck pairs.

    Parameters
    ----------
    sources : Result or path, or sequence of these
        Results of `analysis = 'mode'`, one at least, and of sweeps.
    observe : str, optional
        Observed quantity; the first of the first result without it.

    Raises
    ------
    InputError
        No result is of a mode, or their amplitudes have different units.
    """
    given = [sources] if isinstance(sources, (Result, str, Path)) else list(sources)
    results = [as_result(one) for one in given]
    modes = [one for one in results if "mode/damping_ratio" in one]
    if not modes:
        raise InputError("no result is of a mode: run case%analysis = 'mode'")
    name = results[0].observed[results[0].index(observe)]
    units = sorted({units_of(one, "amplitude") for one in results})
    if len(units) > 1:
        raise InputError("the results have different units: "
                         + ", ".join(one or "not known" for one in units))
    figure = new_figure(8.0, 5.0)
    axes = figure.subplots()
    sweeps = [one for one in results if "mode/damping_ratio" not in one]
    for k, (result, text) in enumerate(zip(sweeps, told_apart(sweeps))):
        amplitude = np.where(result.converged, np.abs(result.harmonic(1, name)), np.nan)
        axes.plot(result.frequency, amplitude, "-", marker=".", markersize=3.0, linewidth=1.1,
                  color=PALETTE[1 + k % (len(PALETTE) - 1)], label=text)
    heights = [_draw_mode(axes, result, name, with_name=len(modes) > 1) for result in modes]
    _limit(axes, np.concatenate(heights), units[0], name)
    axes.set_xlabel("frequency [Hz]")
    axes.ticklabel_format(axis="x", useOffset=False)
    tidy(axes)
    axes.legend(frameon=False, fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3,
                borderaxespad=0.0)
    return figure


def _draw_mode(axes: Axes, result: Result, name: str, *, with_name: bool) -> Floats:
    """One mode with its synthesis; its amplitudes."""
    mode, column = result.mode, result.index(name)
    amplitude = np.where(mode.converged, result["mode/first_harmonic"][:, column], np.nan)
    text = f"mode {mode.number}" + (f", {Path(result.name).stem}" if with_name else "")
    axes.axvline(mode.stuck_omega / (2.0 * np.pi), color="0.4", linestyle=":", linewidth=1.0,
                 label="stuck pairs")
    axes.plot(mode.frequency, amplitude, color=CURVE, linewidth=2.2, label=text)
    if "synthesis/omega" in result:
        for k, scale in enumerate(result["synthesis/scale"]):
            for part, (x, y) in enumerate(_responses(result, k, amplitude)):
                axes.plot(x / (2.0 * np.pi), y, "--", color="0.35", linewidth=1.0,
                          label="synthesis from the mode, at the load factor" if k + part == 0
                          else None)
                top = int(np.nanargmax(y))
                axes.annotate(f"{scale:g}", (x[top] / (2.0 * np.pi), y[top]), fontsize=8,
                              textcoords="offset points", xytext=(0, 5), color="0.35",
                              ha="center")
    return np.asarray(amplitude[np.isfinite(amplitude)])


def _responses(result: Result, k: int, amplitude: Floats) -> Iterator[tuple[Floats, Floats]]:
    """Response k put together from a mode: frequencies and amplitudes of each closed piece.

    Both flanks, joined where the load makes the mode a resonance: between the last row that the
    response reaches and the next, where its factor is that of `/mode/resonant_scale`.
    """
    flanks, mode = result["synthesis/omega"][k], result.mode
    needed = result["mode/resonant_scale"]
    scale = float(result["synthesis/scale"][k])
    there = np.isfinite(flanks).any(axis=1) & np.isfinite(amplitude)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], there.astype(int), [0]))))
    for first, past in zip(edges[::2], edges[1::2]):
        above: list[tuple[float, float]] = []
        below: list[tuple[float, float]] = []
        for inside, outside, ends in ((past - 1, past, above), (first, first - 1, below)):
            if not 0 <= outside < len(needed):
                continue
            share = (scale - needed[inside]) / (needed[outside] - needed[inside])
            if 0.0 <= share <= 1.0:
                ends.append(tuple(float(curve[inside] + share * (curve[outside] - curve[inside]))
                                  for curve in (mode.omega, amplitude)))  # type: ignore[arg-type]
        # The one flank may go down to frequency 0 where the other has no bound.
        up, down = ([(x, y) for x, y in zip(flanks[first:past, side], amplitude[first:past])
                     if np.isfinite(x)] for side in (0, 1))
        path = np.array([*below, *up, *above, *down[::-1], *below])
        yield path[:, 0], path[:, 1]


def _limit(axes: Axes, amplitude: Floats, units: str, name: str) -> None:
    """Both axes about the modes and the sweeps, not about the far ends of responses."""
    solid = [line for line in axes.lines if line.get_linestyle() == "-"]
    x = np.concatenate([np.asarray(line.get_xdata(), dtype=float) for line in solid])
    sweeps = [line for line in solid if line.get_marker() == "."]
    low, high = float(np.nanmin(x)), float(np.nanmax(x))
    room = 0.02 * (high - low) if sweeps else _ROOM * max(high - low, 0.01 * high)
    axes.set_xlim(max(0.0, low - room), high + room)
    y = np.concatenate([amplitude, *(np.asarray(line.get_ydata(), dtype=float)
                                     for line in sweeps)])
    top = float(np.nanmax(y))
    if amplitude.max() > _WIDE * amplitude.min():
        axes.set_yscale("log")
        axes.set_ylim(0.8 * amplitude.min(), 1.3 * top)
        axes.set_ylabel(label(f"first harmonic of {name}", units))
    else:
        axes.set_ylim(0.0, 1.08 * top)
        axes.set_ylabel(label(f"first harmonic of {name}", scale_axis(axes.yaxis, top, units)))
