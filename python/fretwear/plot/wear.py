"""Wear: depth as maps and bars, and its evolution over the cycles."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from ..errors import AbsentError, InputError
from ..result import Result
from ..rows import choose_point, pair_fields, status_words
from ..shown import without_round_off
from .flanks import plot_maps
from .style import (
    CURVE,
    FAILED,
    PALETTE,
    Floats,
    ScaledFormatter,
    Source,
    as_result,
    label,
    largest_of,
    new_figure,
    pair_name,
    scale,
    scale_axis,
    tidy,
    units_of,
)

__all__ = ["plot_wear_bars", "plot_wear_evolution", "plot_wear_maps"]

#: Curves of single pairs in the evolution: those that are worn most.
_MOST_PAIRS = 6
#: Rates that differ by more are shown on a logarithmic axis.
_DECADE = 10.0


def _worn(source: Source) -> Result:
    result = as_result(source)
    if "wear/depth" not in result:
        raise InputError(f"{result.name}: holds no wear; run with case%analysis = 'wear'")
    return result


def _when(result: Result, step: int) -> str:
    return (f"step {step + 1} of {len(result.depth)}, {result.cycles[step]:.4g} "
            f"{_abscissa(result)}{status_words(result, step)}")


def _abscissa(result: Result) -> str:
    """What the steps of the scheme advance in: cycles, or what stands for them."""
    units = result.units("wear/cycles")
    return "cycles" if units in ("", "1") else units


def plot_wear_maps(source: Source, step: int | None = None) -> Figure:
    """Maps of depth and of depth per cycle on the flanks.

    Parameters
    ----------
    source : Result or path
        Result of a wear analysis, with the positions of its pairs.
    step : int, optional
        Wear step from 0; the last one without it.
    """
    result = _worn(source)
    step = choose_point(result, None) if step is None else step
    fields = {name: field for name, field in pair_fields(result, step).items()
              if name.startswith("wear")}
    return plot_maps(result, fields, f"Wear at {_when(result, step)}")


def plot_wear_bars(source: Source, step: int | None = None) -> Figure:
    """Wear depth of every pair as bars, one panel a patch.

    Parameters
    ----------
    source : Result or path
        Result of a wear analysis.
    step : int, optional
        Wear step from 0; the last one without it.
    """
    result = _worn(source)
    step = choose_point(result, None) if step is None else step
    depth = without_round_off(result.depth[step])
    patch = (result["contact/patch"] if "contact/patch" in result
             else np.full(len(depth), "contact"))
    names = list(dict.fromkeys(str(name) for name in patch))
    figure = new_figure(8.0, 2.4 * len(names) + 0.8)
    panels = figure.subplots(len(names), 1, sharey=True, squeeze=False).ravel()
    for k, (axes, name) in enumerate(zip(panels, names)):
        pairs = np.flatnonzero(patch == name)
        axes.bar(pairs + 1, depth[pairs], color=PALETTE[k % len(PALETTE)], width=0.75)
        axes.set_title(name, fontsize=10, loc="left")
        axes.set_xlim(pairs[0] + 0.4, pairs[-1] + 1.6)
        axes.locator_params(axis="x", integer=True)
        units = scale_axis(axes.yaxis, largest_of(depth), units_of(result, "wear/depth"))
        tidy(axes)
    panels[-1].set_xlabel("pair")
    figure.supylabel(label("wear depth", units), fontsize=10)
    figure.suptitle(f"Wear depth at {_when(result, step)}", fontsize=11)
    return figure


def plot_wear_evolution(source: Source) -> Figure:
    """Depth, rate and amplitude over the cycles.

    Parameters
    ----------
    source : Result or path
        Result of a wear analysis. Curves are the pairs that are worn most; the rate is the
        largest of all pairs. Amplitudes are drawn where the file holds one for each step.
    """
    result = _worn(source)
    cycles, depth, rate = result.cycles, result.depth, result.rate
    has_amplitude = "amplitude" in result and len(result.amplitude) == len(cycles)
    n_panels = 3 if has_amplitude else 2
    figure = new_figure(8.0, 2.5 * n_panels + 0.5)
    panels = figure.subplots(n_panels, 1, sharex=True)
    worst = np.argsort(-depth[-1], kind="stable")[:_MOST_PAIRS]
    for k, pair in enumerate(sorted(int(pair) for pair in worst)):
        # Curves on top of each other are all seen: the later the thinner, with other dashes.
        panels[0].plot(cycles, depth[:, pair], ("-", "--", "-.", ":", "-", "--")[k], marker=".",
                       linewidth=2.4 - 0.25 * k, markersize=7.0 - 0.6 * k, color=PALETTE[k],
                       label=pair_name(result, pair))
    panels[0].set_ylabel(label("wear depth", scale_axis(
        panels[0].yaxis, largest_of(depth), units_of(result, "wear/depth"))))
    panels[0].legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    largest = rate.max(axis=1)
    wears = bool((largest > 0.0).any())
    # A joint that sticks has a rate of exactly zero, which has no place on a logarithmic axis.
    shown = np.where(largest > 0.0, largest, np.nan) if wears else largest
    panels[1].plot(cycles, shown, ".-", color=CURVE)
    # In the unit of the depth above, so that one can be reckoned from the other.
    units, factor = _rate_units(result, depth)
    if wears and np.nanmax(shown) > _DECADE * np.nanmin(shown):
        panels[1].set_yscale("log")
        panels[1].yaxis.set_major_formatter(FuncFormatter(
            lambda value, _: "" if value <= 0.0 else _power(factor * value)))
        panels[1].yaxis.set_minor_formatter(NullFormatter())
        panels[1].set_ylabel(label("largest depth\nper cycle", units))
    else:
        further, shown_units = scale(factor * largest_of(shown), units)
        panels[1].yaxis.set_major_formatter(ScaledFormatter(factor * further))
        panels[1].set_ylabel(label("largest depth\nper cycle", shown_units))
    if has_amplitude:
        failed = ~result.converged
        amplitude = np.where(failed, np.nan, result.amplitude[:, 0])
        panels[2].plot(cycles, amplitude, ".-", color=CURVE)
        if failed.any():
            # Where the vibration of a step was not found: at the height of the axis, as a place.
            panels[2].plot(cycles[failed], np.zeros(failed.sum()), "x", color=FAILED, markersize=6,
                           clip_on=False, label=f"not converged ({failed.sum()})")
            panels[2].legend(frameon=False, fontsize=8)
        panels[2].set_ylabel(label(f"amplitude\nof {result.observed[0]}", scale_axis(
            panels[2].yaxis, largest_of(amplitude), units_of(result, "amplitude"))))
        panels[2].set_ylim(0.0, 1.08 * largest_of(amplitude) or None)
    positive = cycles[cycles > 0.0]
    if positive.size and positive[-1] > 100.0 * positive[0]:
        # The rate falls over decades of cycles; the start, at zero, stays in the picture.
        first = 10.0 ** np.ceil(np.log10(positive[0]))
        panels[-1].set_xscale("symlog", linthresh=first, linscale=0.5)
        decades = np.arange(np.log10(first), np.log10(cycles[-1]) + 1e-9)
        panels[-1].set_xticks([0.0, *10.0 ** decades])
        panels[-1].set_xlim(-0.02 * first, 1.3 * cycles[-1])
        abscissa = ""
    else:
        abscissa = scale_axis(panels[-1].xaxis, largest_of(cycles), "")
    panels[-1].set_xlabel(label(_abscissa(result), abscissa))
    for axes in panels:
        tidy(axes)
    try:
        state = f", steady state {result.steady_state}"
    except AbsentError:  # the run is at work, or was killed
        state = ""
    figure.suptitle(f"Wear over the cycles{state}{_duration(result)}", fontsize=11)
    return figure


def _rate_units(result: Result, depth: Floats) -> tuple[str, float]:
    """The unit in which depths are shown, for rates too, and the factor to it."""
    units = units_of(result, "wear/rate")
    if units != units_of(result, "wear/depth"):
        return units, 1.0
    factor, shown = scale(largest_of(depth), units)
    return shown, factor


def _power(value: float) -> str:
    """A power of ten at a tick."""
    return f"$10^{{{round(np.log10(value))}}}$"


def _duration(result: Result) -> str:
    """How long the cycles last at the frequency of the run, which tells whether they mean
    anything; "" where they stand for something else."""
    if _abscissa(result) != "cycles" or not len(result.frequency) or result.frequency[0] <= 0.0:
        return ""
    seconds = float(result.cycles[-1] / result.frequency[0])
    for name, size in (("years", 365.25 * 86400.0), ("days", 86400.0), ("hours", 3600.0)):
        if seconds >= size:
            # Two digits, and no power of ten in a title: 290 years.
            return f"; the last cycle after {float(f'{seconds / size:.2g}'):,.10g} {name}"
    return f"; the last cycle after {seconds:.2g} s"
