"""Frequency response: amplitude, stability and contact states along a sweep or a branch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..errors import InputError
from ..result import STATES, Result
from ..shown import Highest, Maximum, dissipation, highest_of, maxima_of
from .style import (
    CURVE,
    FAILED,
    PALETTE,
    STATE_COLOURS,
    UNDECIDED,
    UNSTABLE,
    Floats,
    Source,
    as_result,
    label,
    new_figure,
    scale,
    scale_axis,
    tidy,
    units_of,
)

__all__ = ["Response", "friction_damping", "half_power_damping", "plot_response",
           "read_response"]


_MARKERS = {"fold": "D", "period doubling": "s", "Neimark-Sacker": "^",
            "symmetry breaking": "v", "branch point": "P", "nonsmooth": "*", "undecided": "X"}


@dataclass(frozen=True)
class Response:
    """Frequency response of one observed quantity.

    Attributes
    ----------
    name : str
        Observed quantity.
    frequency : (n_points,)
        [Hz], or what the sweep goes over in place of it.
    amplitude : (n_points,)
        Largest absolute value over the period, in the units of the model.
    converged : (n_points,) bool
        Points that did not converge carry no valid amplitude.
    fraction : (n_points, 3) or None
        Stick, slip and open fractions averaged over the pairs.
    dissipation : (n_points,) or None
        Friction loss per cycle summed over the pairs.
    stable : (n_points,) int or None
        1 stable, 0 unstable, -1 undecided or not known.
    units : str
        Of the amplitude; "" where they are not known.
    maxima : tuple of Maximum
        Those that the run has found, between the points too [Hz].
    deviation : (n_points,) or None
        Standard deviation of the amplitude to first order, of runs with `sensitivity%deviation`.
    bifurcations : tuple of (str, float, float)
        Kind, frequency [Hz] and amplitude of every place where it turns or its stability changes.
    parameter : str
        What the sweep goes over in place of the frequency; "" where it is the frequency.
    held : (n_points,) or None
        Amplitude that each point was to have, of runs with `&control`.
    """

    name: str
    frequency: Floats
    amplitude: Floats
    converged: NDArray[np.bool_]
    fraction: Floats | None = None
    dissipation: Floats | None = None
    stable: NDArray[np.int_] | None = None
    units: str = ""
    maxima: tuple[Maximum, ...] = ()
    bifurcations: tuple[tuple[str, float, float], ...] = ()
    deviation: Floats | None = None
    parameter: str = ""
    held: Floats | None = None

    @property
    def starts(self) -> NDArray[np.int_]:
        """Points at which the curve for another amplitude of `&control` begins."""
        return np.flatnonzero(np.diff(() if self.held is None else self.held)) + 1

    @property
    def axis(self) -> str:
        """What stands along the axis."""
        return self.parameter or "frequency [Hz]"

    @property
    def is_branch(self) -> bool:
        """Whether frequencies turn back, so that nothing is a function of them."""
        step = np.diff(self.frequency)
        return bool((step > 0).any() and (step < 0).any())

    @property
    def highest(self) -> Highest | None:
        """Where the curve is highest, and whether that is a peak; None where nothing converged."""
        return highest_of(self.frequency, self.amplitude, self.converged, self.maxima)

    @property
    def peak(self) -> int:
        """Number (from 0) of the converged point of largest amplitude."""
        valid = self.converged & np.isfinite(self.amplitude)
        if not valid.any():
            raise InputError(f"no converged point observes '{self.name}'")
        return int(np.argmax(np.where(valid, self.amplitude, -np.inf)))


def read_response(source: Source, observe: str | None = None) -> Response:
    """Response of one observed quantity of a result.

    Parameters
    ----------
    source : Result or path
        Result of a sweep.
    observe : str, optional
        Name of the quantity; the first one without it.
    """
    result = as_result(source)
    for name in ("omega", "amplitude", "converged", "observed/name"):
        if name not in result:
            raise InputError(f"{result.name}: dataset /{name} is missing (only sweeps have a "
                             "frequency response)")
    column = result.index(observe)
    fraction = result.fraction if "contact/fraction" in result else None
    loss = dissipation(result) if "contact/dissipation" in result else None
    # Rows of a resonance over a parameter have frequencies of their own.
    over = "" if "parameter" not in result or "resonance/phase" in result else (
        result.parameter_name)
    return Response(
        result.observed[column], result.parameter if over else result.frequency,
        result.amplitude[:, column], result.converged,
        None if fraction is None else fraction.mean(axis=1),
        None if loss is None else loss.sum(axis=1),
        result.stable if "floquet/stable" in result else None, units_of(result, "amplitude"),
        () if over else maxima_of(result, column),
        tuple((b.kind, b.frequency if b.parameter is None else b.parameter,
               float(b.amplitude[column])) for b in result.bifurcations),
        _deviation(result, column), over,
        result.control_amplitude if "control/amplitude" in result else None)


def _deviation(result: Result, column: int) -> Floats | None:
    if "sensitivity/deviation/largest" not in result:
        return None
    return np.asarray(result["sensitivity/deviation/largest"][:, column])


def half_power_damping(response: Response) -> float:
    """Damping ratio (f2 - f1) / (2 f_peak) from the width of the peak at 1/sqrt(2) of its height.

    Exact for a lightly damped linear mode; for a friction peak it is the viscous damping that
    gives a peak of the same width. The flanks are interpolated linearly between converged points,
    so the sweep must resolve the peak. NaN where it does not reach the level on both sides, where
    the highest point is at an end of the sweep, where points failed beside it, and where the run
    itself knows no width of its peak.
    """
    highest = response.highest
    if highest is None or not (highest.is_peak and highest.has_width):
        return float("nan")
    keep = response.converged & np.isfinite(response.amplitude)
    order = np.argsort(response.frequency[keep], kind="stable")
    f, a = response.frequency[keep][order], response.amplitude[keep][order]
    top = int(np.argmax(a))
    level = a[top] / np.sqrt(2.0)
    below = np.flatnonzero(a < level)
    left, right = below[below < top], below[below > top]
    if not (left.size and right.size):
        return float("nan")
    i, j = left[-1], right[0]
    lower = f[i] + (level - a[i]) / (a[i + 1] - a[i]) * (f[i + 1] - f[i])
    upper = f[j - 1] + (level - a[j - 1]) / (a[j] - a[j - 1]) * (f[j] - f[j - 1])
    return float((upper - lower) / (2.0 * f[top]))


def friction_damping(response: Response, linear: Response | None = None, *,
                     modal_mass: float | None = None) -> float | None:
    """Equivalent damping ratio of friction at the peak.

    With a modal mass m (of the mode, scaled to 1 at the observed quantity), it is
    ``D / (4 pi E)`` where D is the sum of /contact/dissipation over the pairs at the peak and
    ``E = m (omega A)^2 / 2`` the energy of the motion of amplitude A.

    Otherwise, with the stuck (linear) result under the same force: a mode at its peak obeys
    ``force = 2 zeta m omega^2 A``, so the total damping ratio is
    ``zeta_linear (omega_linear^2 A_linear) / (omega^2 A)``, and friction gives what exceeds
    zeta_linear, the half-power damping of the stuck peak.

    Parameters
    ----------
    response, linear : Response
        Response with friction and with every pair stuck.
    modal_mass : float, optional
        Modal mass in the units of the model.

    Returns
    -------
    float or None
        Damping ratio [-]; None where neither definition can be evaluated, or where a highest point
        is no peak.
    """
    highest = response.highest
    if highest is None or not highest.is_peak:
        return None
    peak = response.peak
    omega, amplitude = 2.0 * np.pi * response.frequency[peak], response.amplitude[peak]
    if modal_mass is not None and response.dissipation is not None:
        energy = 0.5 * modal_mass * (omega * amplitude) ** 2
        return float(response.dissipation[peak] / (4.0 * np.pi * energy))
    if linear is None or linear.highest is None:
        return None
    stuck, at = half_power_damping(linear), linear.peak
    ratio = linear.frequency[at] / response.frequency[peak]
    extra = stuck * (ratio**2 * linear.amplitude[at] / amplitude - 1.0)
    return float(extra) if np.isfinite(extra) else None


def plot_response(source: Source, observe: str | None = None, *, linear: Source | None = None,
                  modal_mass: float | None = None) -> Figure:
    """Amplitude, and below it the contact states, against frequency or a parameter.

    The peak is annotated with its shift from the stuck peak and the equivalent damping ratio of
    friction as ``friction_damping`` defines it (the half-power width of the peak where that cannot
    be evaluated); a highest point at an end of the sweep, or beside points that failed, is a ring
    without these. Points that did not converge are crosses, unstable ones are drawn thin
    and dashed on shaded ground, those whose stability is undecided are ringed. Folds, period
    doublings and other bifurcations have markers. With `sensitivity%deviation` a band shows the
    amplitude give or take its standard deviation. The lower panel shows stick, slip and open
    fractions, averaged over the pairs; along a branch that folds, against the number of the point.
    Amplitudes held by `&control` have a curve each and no peak.

    Parameters
    ----------
    source : Result or path
        Result of a sweep.
    observe : str, optional
        Observed quantity; the first of the file without it.
    linear : Result or path, optional
        The same sweep with every pair stuck, drawn dashed.
    modal_mass : float, optional
        See ``friction_damping``.
    """
    response = read_response(source, observe)
    stuck = None if linear is None else read_response(linear, response.name)
    # Failed points leave no state to show.
    has_states = response.fraction is not None and bool(response.converged.any())
    figure = new_figure(8.0, 6.4 if has_states else 4.4)
    if not has_states:
        upper = figure.subplots()
    else:
        upper, lower = figure.subplots(2, 1, sharex=not response.is_branch,
                                       height_ratios=(2.4, 1.0))
        _draw_states(lower, response)
    largest = _draw_amplitude(upper, response, stuck)
    if response.converged.any() and response.held is None:
        _annotate_peak(upper, response, stuck, modal_mass, largest)
    if not has_states or response.is_branch:
        upper.set_xlabel(response.axis)
    return figure


def _draw_amplitude(axes: Axes, response: Response, stuck: Response | None) -> float:
    """Curves in the order computed, so that a fold of the branch shows as one; the largest."""
    if stuck is not None:
        axes.plot(stuck.frequency, np.where(stuck.converged, stuck.amplitude, np.nan), "--",
                  color="0.45", linewidth=1.3, label="stuck (linear)")
    good = np.where(response.converged, response.amplitude, np.nan)
    if response.deviation is not None:
        axes.fill_between(response.frequency, np.maximum(good - response.deviation, 0.0),
                          good + response.deviation, color=CURVE, alpha=0.18, linewidth=0,
                          label="one standard deviation, to first order")
    unstable = (np.zeros(len(good), dtype=bool) if response.stable is None
                else response.stable == 0)
    # A gap between the curves of two amplitudes.
    axes.plot(np.insert(response.frequency, response.starts, np.nan),
              np.insert(np.where(unstable, np.nan, good), response.starts, np.nan), "-", marker=".",
              markersize=3.5, color=CURVE, linewidth=1.6, label=f"amplitude of {response.name}")
    if unstable.any():
        _draw_unstable(axes, response, good, unstable)
    if response.stable is not None:
        _draw_undecided(axes, response, good)
    _draw_bifurcations(axes, response)
    bad = ~response.converged
    highest = response.highest
    largest = float(np.nanmax(good, initial=highest.height if highest else 0.0))
    if stuck is not None:
        largest = max(largest, float(np.nanmax(stuck.amplitude[stuck.converged], initial=0.0)))
    if response.deviation is not None:
        largest = max(largest, float(np.nanmax(good + response.deviation, initial=0.0)))
    if bad.any():
        height = np.where(np.isfinite(response.amplitude), response.amplitude, 0.0)
        # A failed point may hold anything: kept inside the picture of the valid ones.
        height = np.clip(height, 0.0, largest or np.inf)
        largest = max(largest, height[bad].max())
        axes.plot(response.frequency[bad], height[bad], "x", color=FAILED, markersize=6,
                  clip_on=False, zorder=5, label=f"not converged ({bad.sum()})")
    axes.set_ylabel(label(f"amplitude of {response.name}",
                          scale_axis(axes.yaxis, largest, response.units)))
    axes.set_ylim(0.0, 1.06 * largest or None)
    tidy(axes)
    axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.0,
                fontsize=9, ncols=1 if len(axes.get_legend_handles_labels()[1]) < 4 else 2)
    return largest


def _draw_unstable(axes: Axes, response: Response, good: Floats,
                   unstable: NDArray[np.bool_]) -> None:
    """Unstable stretches, joined to the stable points beside them, on shaded ground."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], unstable.astype(int), [0]))))
    for k, (first, last) in enumerate(zip(edges[::2], edges[1::2])):
        near = slice(max(first - 1, 0), last + 1)
        f = response.frequency[first:last]
        axes.plot(response.frequency[near], good[near], "--", color=UNSTABLE, linewidth=1.1,
                  label="unstable" if k == 0 else None)
        axes.axvspan(f.min(), f.max(), color=UNSTABLE, alpha=0.08, linewidth=0)


def _draw_undecided(axes: Axes, response: Response, good: Floats) -> None:
    """Points whose multipliers are as near to the unit circle as their error."""
    open_ones = response.converged & (response.stable == -1)
    if open_ones.any():
        axes.plot(response.frequency[open_ones], good[open_ones], "o", color=UNDECIDED,
                  markersize=6, markerfacecolor="none", markeredgewidth=1.0,
                  label="stability undecided")


def _draw_bifurcations(axes: Axes, response: Response) -> None:
    """A marker of its own for every kind, in the order of the response."""
    for kind in dict.fromkeys(kind for kind, _, _ in response.bifurcations):
        f, a = np.array([(f, a) for k, f, a in response.bifurcations if k == kind]).T
        axes.plot(f, a, linestyle="none", marker=_MARKERS.get(kind, "X"), color=PALETTE[1],
                  markersize=8, markeredgecolor="white", markeredgewidth=0.8, zorder=4,
                  label=kind if len(f) == 1 else f"{kind} ({len(f)})")


def _annotate_peak(axes: Axes, response: Response, stuck: Response | None,
                   modal_mass: float | None, largest: float) -> None:
    """What the highest place is, in the unit of an axis that shows values up to `largest`; a ring
    in place of a dot, and no damping, where it is no peak."""
    highest = response.highest
    assert highest is not None  # the caller has looked whether a point has converged
    factor, units = scale(largest, response.units)
    name = "peak" if highest.is_peak and not response.parameter else "largest"
    text = (f"{name} {factor * highest.height:.4g} {units}".strip()
            + f" at {highest.place:.{_digits(response.frequency)}f}"
            + ("" if response.parameter else " Hz"))
    lines = [text + (f",\n{highest.words}" if highest.words else "")]
    if not response.parameter and highest.is_peak:
        lines += _damping_words(response, stuck, modal_mass, highest)
    axes.plot(highest.place, highest.height, "o", color=CURVE, markersize=6,
              markerfacecolor=CURVE if highest.is_peak else "white")
    # Above the panel, where it covers no curve.
    axes.text(1.0, 1.02, "\n".join(lines), transform=axes.transAxes, ha="right", va="bottom",
              fontsize=9, bbox={"boxstyle": "round", "facecolor": "white", "edgecolor": "0.8"})


def _damping_words(response: Response, stuck: Response | None, modal_mass: float | None,
                   highest: Highest) -> list[str]:
    """How far the peak has moved and what friction damps, each as far as it is known."""
    lines = []
    linear = None if stuck is None else stuck.highest
    if linear is not None and linear.is_peak:
        lines.append(f"shift {100.0 * (highest.place / linear.place - 1.0):+.3f} %")
    damping = friction_damping(response, stuck, modal_mass=modal_mass)
    if damping is not None:
        how = "its energy" if modal_mass is not None else "the heights of both peaks"
        lines.append(f"damping ratio of friction {100.0 * damping:.3g} %, by {how}")
    elif not response.is_branch and np.isfinite(width := half_power_damping(response)):
        # Of a peak that friction bends to one side it is a width, and no damping.
        lines.append(f"half-power width {200.0 * width:.3g} % of the frequency")
    return lines


def _digits(frequency: Floats) -> int:
    """Decimals that tell the points of a sweep apart."""
    span = float(np.ptp(frequency)) / max(len(frequency) - 1, 1)
    return int(np.clip(1 - np.floor(np.log10(span)), 0, 8)) if span > 0.0 else 4


def _draw_states(axes: Axes, response: Response) -> None:
    assert response.fraction is not None  # the caller made room for this panel
    keep = np.flatnonzero(response.converged)
    if response.is_branch:
        abscissa = keep + 1.0
        axes.set_xlabel("point of the branch")
    else:
        keep = keep[np.argsort(response.frequency[keep], kind="stable")]
        abscissa = response.frequency[keep]
        axes.set_xlabel(response.axis)
    axes.stackplot(abscissa, response.fraction[keep].T, labels=STATES, colors=STATE_COLOURS,
                   alpha=0.9)
    axes.set(ylim=(0.0, 1.0), ylabel="share of pairs\nand period")
    axes.margins(x=0.0)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
