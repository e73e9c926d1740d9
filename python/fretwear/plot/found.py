"""What optimisation and calibration have found: the places looked at, and data beside the fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from ..design import Calibration, ControlData, Measured, ModeData, Optimum, ResponseData
from ..errors import InputError
from .style import CURVE, FAILED, PALETTE, Floats, label_y, new_figure, tidy

__all__ = ["plot_calibration", "plot_optimum"]

#: Half length of a tangent, as a part of the range of the parameter (or of its logarithm).
_TANGENT = 0.06
#: Places between two evaluations at which their curve is drawn.
_BETWEEN = 16
_FORCED = "damping ratio F/(2ma)"
_NAMES = {"frequency": "frequency [Hz]", "damping_ratio": "damping ratio",
          "amplitude": "amplitude", "load": "load factor"}


def plot_optimum(found: Optimum) -> Figure:
    """The evaluations of an optimisation, a panel for each parameter, with their slopes.

    Numbers count the evaluations; the dashed line is at the optimum. The slopes are those along
    the parameter of the panel.

    Parameters
    ----------
    found : Optimum
        Of `fretwear.optimise`.
    """
    n = len(found.names)
    figure = new_figure(max(5.6, 4.2 * n), 4.2)
    panels = figure.subplots(1, n, sharey=True, squeeze=False)[0]
    places = np.array([one.parameters for one in found.history])
    values = np.array([one.value for one in found.history])
    slopes = np.array([one.gradient for one in found.history])
    for k, (axes, name) in enumerate(zip(panels, found.names)):
        x = places[:, k]
        wide = bool(x.min() > 0.0 and x.max() > 5.0 * x.min())
        if wide:
            axes.set_xscale("log")
        if n == 1:
            axes.plot(*_curve(x, values, slopes[:, k], wide=wide), color="0.6", linewidth=1.2,
                      label="through values and slopes")
        for one, value, slope in zip(x, values, slopes[:, k]):
            reach = _TANGENT * (np.log(x.max() / x.min()) * one if wide else np.ptp(x))
            ends = np.array([one - reach, one + reach])
            axes.plot(ends, value + slope * (ends - one), color=CURVE, linewidth=1.2)
        axes.plot(x, values, "o", color=CURVE, markersize=5, linestyle="none")
        for first, last in _clusters(np.log(x) if wide else x, values):
            text = str(first + 1) if first == last else f"{first + 1} - {last + 1}"
            axes.annotate(text, (x[first], values[first]), textcoords="offset points",
                          xytext=(5, 6), fontsize=8)
        axes.axvline(found.values[k], color="0.4", linestyle="--", linewidth=1.0,
                     label=f"{found.word.partition(':')[0]}, {found.values[k]:.6g}")
        axes.set_xlabel(name)
        axes.legend(frameon=False, fontsize=8)
        tidy(axes)
    panels[0].set_ylabel(found.objective)
    return figure


def _curve(x: Floats, values: Floats, slopes: Floats, *, wide: bool) -> tuple[Floats, Floats]:
    """Cubics between neighbours with their values and slopes, over the logarithm where wide."""
    place, first = np.unique(np.log(x) if wide else x, return_index=True)
    along = slopes[first] * (x[first] if wide else 1.0)
    t = np.linspace(0.0, 1.0, _BETWEEN)
    h00, h10 = (1.0 + 2.0 * t) * (1.0 - t) ** 2, t * (1.0 - t) ** 2
    found_x, found_y = [], []
    for k in range(len(place) - 1):
        step = place[k + 1] - place[k]
        found_x.append(place[k] + step * t)
        found_y.append(h00 * values[first][k] + h10 * step * along[k]
                       + h00[::-1] * values[first][k + 1] - h10[::-1] * step * along[k + 1])
    if not found_x:
        return x, values
    line = np.concatenate(found_x)
    return np.exp(line) if wide else line, np.concatenate(found_y)


def _clusters(x: Floats, y: Floats) -> Iterator[tuple[int, int]]:
    """First and last of evaluations in a row that are drawn on top of each other."""
    first = 0
    for k in range(1, len(x) + 1):
        near = k < len(x) and (abs(x[k] - x[first]) < 0.04 * np.ptp(x)
                               and abs(y[k] - y[first]) < 0.04 * np.ptp(y))
        if not near:
            yield first, k - 1
            first = k


def plot_calibration(found: Calibration, data: Measured | Sequence[Measured]) -> Figure:
    """Measured numbers with their deviations, and the case with the parameters found.

    Parameters
    ----------
    found : Calibration
        Of `fretwear.calibrate`.
    data : ModeData, ResponseData, ControlData, or sequence of these
        What it was found from.
    """
    sets = [data] if isinstance(data, Measured) else list(data)
    if len(sets) != len(found.predicted):
        raise InputError(f"data: are {len(sets)}, the calibration was of {len(found.predicted)}")
    kinds = list(dict.fromkeys(name for one in sets for name in one.labels))
    figure = new_figure(8.0, 1.2 + 2.6 * len(kinds))
    panels = dict(zip(kinds, figure.subplots(len(kinds), 1, squeeze=False)[:, 0]))
    for k, (one, predicted) in enumerate(zip(sets, found.predicted)):
        for name in dict.fromkeys(one.labels):
            rows = np.array([label == name for label in one.labels])
            _draw(panels[name], one, rows, predicted, PALETTE[k % len(PALETTE)])
    for name, axes in panels.items():
        forced = {one.damping == "forced" for one in sets if isinstance(one, ModeData)}
        axes.set_ylabel(_FORCED if name == "damping_ratio" and forced == {True} else _NAMES[name])
        if name == "amplitude":
            label_y(axes, "amplitude", "")
        if name in ("amplitude", "load"):
            axes.set_xlabel("frequency [Hz]")
        axes.ticklabel_format(axis="y", useOffset=False)
        tidy(axes)
    first = panels[kinds[0]]
    first.legend(frameon=False, fontsize=8)
    figure.suptitle("\n".join(
        f"{name} = {value:.5g}" + (f" ± {error:.2g}" if np.isfinite(error) else "")
        for name, value, error in zip(found.names, found.values, found.errors)), fontsize=10)
    return figure


def _draw(axes: Axes, one: Measured, rows: NDArray[np.bool_], predicted: Floats,
          colour: str) -> None:
    """One kind of numbers of one set."""
    x = one.amplitude if isinstance(one, ModeData) else None
    if isinstance(one, (ResponseData, ControlData)):
        x = one.frequency
    assert x is not None  # there are no other kinds
    order = np.argsort(x)
    spread = one.deviation[rows][order] if one.is_known else None
    axes.errorbar(x[order], one.values[rows][order], yerr=spread, fmt="o", markersize=3,
                  color=FAILED if colour == CURVE else colour, capsize=5, capthick=1.2,
                  linewidth=1.2, zorder=3,
                  label="measured" + (", one deviation" if one.is_known else ""))
    axes.plot(x[order], predicted[rows][order], color=CURVE, linewidth=1.4, label="calibrated")
    if isinstance(one, ModeData):
        axes.set_xscale("log")
        # Numbers as they are read: 0.5, 1, 2, 5.
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel("amplitude")
