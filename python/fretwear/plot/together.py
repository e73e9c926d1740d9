"""Responses of several results in one picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from .._native import namelist_values
from ..errors import AbsentError, InputError, NotBuiltError
from ..result import Result
from .response import Response, read_response
from .style import PALETTE, Source, as_result, label, new_figure, scale_axis, tidy

__all__ = ["plot_envelope", "plot_responses", "told_apart"]


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
    results, curves = _read(sources, observe)
    figure = new_figure(8.0, 4.8)
    axes = figure.subplots()
    for k, (name, curve) in enumerate(zip(_names([result.name for result in results]), curves)):
        good = np.where(curve.converged, curve.amplitude, np.nan)
        style = ("-", "--", "-.", ":")[k // len(PALETTE) % 4]
        axes.plot(curve.frequency, good, style, marker=".", markersize=3.0, linewidth=1.4,
                  color=PALETTE[k % len(PALETTE)], label=name)
    largest = max(_largest(curve) for curve in curves)
    axes.set_ylabel(label(f"amplitude of {curves[0].name}",
                          scale_axis(axes.yaxis, largest, curves[0].units)))
    axes.set_ylim(0.0, 1.08 * largest or None)
    axes.set_xlabel("frequency [Hz]")
    tidy(axes)
    axes.legend(frameon=False)
    return figure


def plot_envelope(sources: Sequence[Source], observe: str | None = None) -> Figure:
    """Largest and smallest amplitude of several sweeps at every frequency that all of them cover.

    Parameters
    ----------
    sources, observe
        See `plot_responses`; natural sweeps, whose frequency goes one way.

    Raises
    ------
    InputError
        As there; or a curve folds back, or the sweeps have no frequency in common.
    """
    results, curves = _read(sources, observe)
    grids = []
    for result, curve in zip(results, curves):
        order = np.argsort(curve.frequency)
        if not (np.diff(curve.frequency[order]) > 0.0).all() or not (
                (np.diff(order) == 1).all() or (np.diff(order) == -1).all()):
            raise InputError(f"{result.name}: its curve folds back: an envelope is drawn of "
                             "natural sweeps")
        grids.append((curve.frequency[order],
                      np.where(curve.converged, curve.amplitude, np.nan)[order]))
    low, high = max(x[0] for x, _ in grids), min(x[-1] for x, _ in grids)
    frequency = np.unique(np.concatenate([x for x, _ in grids]))
    frequency = frequency[(frequency >= low) & (frequency <= high)]
    if not len(frequency):
        raise InputError("the sweeps have no frequency in common")
    values = np.array([np.interp(frequency, x, y) for x, y in grids])
    figure = new_figure(8.0, 4.8)
    axes = figure.subplots()
    top, bottom = values.max(axis=0), values.min(axis=0)
    axes.fill_between(frequency, bottom, top, color=PALETTE[5], alpha=0.35, linewidth=0.0,
                      label=f"range of {len(values)} results")
    axes.plot(frequency, values.T, color="0.55", linewidth=0.7)
    axes.plot(frequency, top, color=PALETTE[0], linewidth=2.0, label="largest")
    largest = float(np.nanmax(top, initial=0.0))
    axes.set_ylabel(label(f"amplitude of {curves[0].name}",
                          scale_axis(axes.yaxis, largest, curves[0].units)))
    axes.set_ylim(0.0, 1.08 * largest or None)
    axes.set_xlabel("frequency [Hz]")
    tidy(axes)
    axes.legend(frameon=False)
    return figure


def told_apart(results: Sequence[Result]) -> list[str]:
    """A name for each result: the one key in which their cases differ, with its value; the names
    of the files where several keys differ, or none."""
    names = _names([result.name for result in results])
    if len(results) < 2:
        return names
    try:
        cases = [namelist_values(result.namelist) for result in results]
    except (AbsentError, NotBuiltError):
        return names
    keys = [key for key in dict.fromkeys(key for case in cases for key in case)
            if not key.startswith("output%")
            and len({tuple(case.get(key, ())) for case in cases}) > 1]
    if len(keys) != 1 or not all(len(case.get(keys[0], ())) == 1 for case in cases):
        return names
    return [f"{keys[0]} = {_number(case[keys[0]][0])}" for case in cases]


def _number(text: str) -> str:
    """A number of a namelist as it is read."""
    try:
        return f"{float(text):.6g}"
    except ValueError:
        return text


def _read(sources: Sequence[Source], observe: str | None) -> tuple[list[Result], list[Response]]:
    """Results and their responses, of one quantity in one unit."""
    if not sources:
        raise InputError("sources: names no result")
    results = [as_result(source) for source in sources]
    curves = [read_response(results[0], observe)]
    curves += [read_response(result, curves[0].name) for result in results[1:]]
    units = sorted({curve.units for curve in curves})
    if len(units) > 1:
        raise InputError("the results have different units: "
                         + ", ".join(one or "not known" for one in units))
    return results, curves


def _largest(curve: Response) -> float:
    good = curve.amplitude[curve.converged]
    return float(np.nanmax(good, initial=0.0))


def _names(paths: Sequence[str]) -> list[str]:
    """Names of the files, with their folders where a name is there twice."""
    stems = [Path(path).stem for path in paths]
    return [stem if stems.count(stem) == 1 else str(Path(path).with_suffix(""))
            for stem, path in zip(stems, paths)]
