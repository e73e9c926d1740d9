"""What of a result may be shown as a peak, a converged point, a loop, or a value.

Pictures, pages and reports ask here, so that none of them says more than the file: an end of a
sweep is no peak, what points that failed may hide is not known, and round-off is zero.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ._native import namelist_values, tolerance_of
from .errors import AbsentError, NotBuiltError

if TYPE_CHECKING:
    from .cycle import Cycle
    from .result import Result

__all__ = ["Highest", "Loop", "Maximum", "dissipation", "highest", "highest_of", "known_to",
           "loop_of", "maxima_of", "without_round_off"]

Floats = NDArray[np.float64]

_END, _MISSING, _NO_SWEEP = "end of the sweep", "points did not converge", "no sweep"
#: What is said of the highest place, by how it was found.
_WORDS = {"row": "", "search": "", "jump": "where the response jumps",
          _END: "at the end of the sweep", "not resolved": "which is not resolved", _NO_SWEEP: "",
          _MISSING: "beside points that did not converge"}
#: Rows that differ by less are of one height, relative.
_EQUAL = 1e-7
#: Points that failed beside a row of at least this part of the largest height may hide a higher
#: one: they are within the half-power width.
_NEAR = np.sqrt(0.5)
#: What is below this part of the largest value is round-off, whatever the tolerance was.
_ROUND_OFF = 1e-9
#: The same of friction work, over the largest force times the largest amplitude: pairs that slip
#: take little of that, and those that stick are told by their states.
_NO_WORK = 1e-13
#: Tolerance of the solver where the file does not tell it.


@dataclass(frozen=True)
class Maximum:
    """A maximum that a run has found, or a point at an end of its sweep."""

    place: float
    height: float
    found_by: str
    bandwidth: float = float("nan")


@dataclass(frozen=True)
class Highest:
    """Where a response is highest, as far as it is known.

    Attributes
    ----------
    place : float
        Frequency [Hz], or what the sweep goes over.
    height : float
        Amplitude there.
    found_by : str
        As in `Peak`, 'points did not converge' where these may hide a higher one, or 'no sweep'.
    point : int
        The converged row that is nearest.
    has_width : bool
        Whether the run knows a half-power width, where it looked for one.
    """

    place: float
    height: float
    found_by: str
    point: int
    has_width: bool = True

    @property
    def is_peak(self) -> bool:
        """Whether it is a maximum that is known: the response falls on both sides."""
        return self.found_by in ("row", "search", "jump")

    @property
    def words(self) -> str:
        """What is to be said of it; nothing of a plain peak."""
        return _WORDS[self.found_by]


def highest(result: Result, observe: str | int | None = None, of: str = "largest"
            ) -> Highest | None:
    """Where one observed quantity is highest; None where nothing has converged.

    Parameters
    ----------
    result : Result
        A sweep or a branch.
    observe : str or int, optional
        Observed quantity; the first without it.
    of : {'largest', 'first_harmonic'}
        What is an amplitude.
    """
    column = result.index(observe)
    first = of == "first_harmonic"
    values = np.abs(result.harmonic(1, column)) if first else result.amplitude[:, column]
    over = "parameter" in result and "resonance/phase" not in result
    is_sweep = "mode/damping_ratio" not in result and "resonance/phase" not in result
    found = highest_of(result.parameter if over else result.frequency, values, result.converged,
                       () if over else maxima_of(result, column, of))
    if found is None or (is_sweep and result.n_points > 1):
        return found
    return replace(found, found_by=_NO_SWEEP)


def maxima_of(result: Result, column: int, of: str = "largest") -> tuple[Maximum, ...]:
    """The maxima of a quantity that the run has looked for; none where it has not."""
    try:
        peaks = result.peaks
    except AbsentError:
        return ()
    name = result.observed[column]
    return tuple(Maximum(peak.frequency,
                         peak.amplitude if of == "largest" else
                         float(np.hypot(*peak.coefficients[1:3])), peak.found_by, peak.bandwidth)
                 for peak in peaks if peak.observed == name)


def highest_of(place: Floats, values: Floats, converged: NDArray[np.bool_],
               maxima: Iterable[Maximum] = ()) -> Highest | None:
    """Where a curve is highest; None where no row has converged.

    Parameters
    ----------
    place, values : (n_points,)
        Frequencies [Hz] or what the sweep goes over, and amplitudes.
    converged : (n_points,)
        Rows that are solutions.
    maxima : iterable of Maximum
        Those between the rows too.
    """
    good = converged & np.isfinite(values)
    if not good.any():
        return None
    step = np.diff(place)
    turns = (step > 0.0).any() and (step < 0.0).any()
    order = np.arange(len(place)) if turns else np.argsort(place, kind="stable")
    heights = np.where(good, values, -np.inf)[order]
    top = int(np.argmax(heights))
    best = Maximum(float(place[order[top]]), float(heights[top]), _word_of_row(heights, top))
    known = sorted(maxima, key=lambda one: one.height)
    if known and known[-1].height >= (1.0 - _EQUAL) * best.height:
        best = known[-1]
        width = bool(np.isfinite(best.bandwidth))
    else:
        width = not known
    word = best.found_by
    if word in ("row", "search", "jump") and _hides_more(heights, best.height):
        word = _MISSING
    near = np.where(good, np.abs(place - best.place), np.inf)
    # Of rows at one place, of a branch, the one of that height.
    near = np.where(near == near.min(), np.abs(values - best.height), np.inf)
    return Highest(best.place, best.height, word, int(np.argmin(near)), width)


def _word_of_row(heights: Floats, top: int) -> str:
    """What the highest row is, -inf being rows that failed: a plateau counts as one row."""
    level = heights[top] - _EQUAL * abs(heights[top])
    first = last = top
    while first > 0 and heights[first - 1] >= level:
        first -= 1
    while last < len(heights) - 1 and heights[last + 1] >= level:
        last += 1
    return _END if first == 0 or last == len(heights) - 1 else "row"


def _hides_more(heights: Floats, top: float) -> bool:
    """Whether rows failed beside high ones."""
    failed = ~np.isfinite(heights)
    high = heights >= _NEAR * top
    return bool((failed[1:] & high[:-1]).any() or (failed[:-1] & high[1:]).any())


# ---------------------------------------------------------------------- round-off


def known_to(result: Result) -> float:
    """What is below this part of the largest displacement of a point is not known to be motion."""
    tolerance = tolerance_of({})
    with contextlib.suppress(NotBuiltError, AbsentError):
        tolerance = tolerance_of(namelist_values(result.namelist))
    return max(tolerance, _ROUND_OFF)


def without_round_off(values: Floats, largest: float | None = None) -> Floats:
    """Values with exact zeros for what is round-off beside the largest one."""
    size = np.nanmax(np.abs(values), initial=0.0) if largest is None else largest
    return np.where(np.abs(values) <= _ROUND_OFF * size, 0.0, values)


def dissipation(result: Result) -> Floats:
    """Friction energy per cycle of every pair (n_points, n_pairs).

    Exactly zero for pairs that are in one state, stick or open, all the period, and where there
    is nothing but round-off.
    """
    values = result.dissipation
    if "contact/fraction" in result:
        stick, _, is_open = np.moveaxis(result.fraction, -1, 0)
        values = np.where((stick == 1.0) | (is_open == 1.0), 0.0, values)
    if "contact/force" in result and "amplitude" in result:
        work = np.abs(result.force).max(axis=(1, 2, 3), initial=0.0) * np.abs(
            result.amplitude).max(axis=1, initial=0.0)
        if len(work) == len(values):
            values = np.where(np.abs(values) <= _NO_WORK * work[:, None], 0.0, values)
    return np.asarray(values)


@dataclass(frozen=True)
class Loop:
    """Contact force over relative displacement of one pair in one direction.

    Attributes
    ----------
    displacement, force : (n_time + 1,)
        The displacement of a pair at rest is one number, and forces of round-off are zero.
    direction : int
        0, 1 (tangential) or 2 (normal).
    moves : bool
        Whether the pair moves by more than round-off.
    """

    displacement: Floats
    force: Floats
    direction: int
    moves: bool


def loop_of(cycle: Cycle, pair: int, size: float, limit: float) -> Loop:
    """The loop of a pair, in the tangential direction in which it moves more.

    Parameters
    ----------
    cycle : Cycle
        A period of the contact.
    pair : int
        Place of the pair in it.
    size : float
        Largest displacement of the structure; that of the pairs counts where it is larger.
    limit : float
        What is round-off, as a part of this: see `known_to`.
    """
    moved, force = cycle.displacement[:, pair], cycle.force[:, pair]
    size = max(size, float(np.ptp(cycle.displacement, axis=0).max(initial=0.0)))
    pressed = float(np.abs(cycle.force).max(initial=0.0))
    extent, pull = np.ptp(moved, axis=0), np.ptp(force[:, :2], axis=0)
    c = 2
    if extent[:2].max() > limit * size:
        c = int(np.argmax(extent[:2]))
    elif pull.max() > limit * pressed:
        c = int(np.argmax(pull))
    moves = bool(extent[c] > limit * size)
    mean = float(moved[:, c].mean())
    at_rest = np.full(len(moved), mean if abs(mean) > limit * size else 0.0)
    quiet = np.abs(force[:, c]).max(initial=0.0) <= _ROUND_OFF * pressed
    return Loop(moved[:, c] if moves else at_rest, np.zeros(len(moved)) if quiet else force[:, c],
                c, moves)
