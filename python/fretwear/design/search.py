"""The search of an optimum: evaluations, failed ones, and when it is one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ConvergenceError
from .objectives import Evaluation
from .parameters import Unknowns

__all__ = ["FLAT", "MOST_FAILURES", "End", "FailedRun", "Search", "Spent", "Step"]

Floats = NDArray[np.float64]

#: Failed runs after which the search gives up, each with bounds that exclude it.
MOST_FAILURES = 8
#: How far beyond a good value a failed one may be tried again.
_SHRINK = 0.5
#: Scaled distance to a run that failed below which the search does not go nearer.
_LEAST_ROOM = 1e-2
#: How a search ends that never saw a slope.
FLAT = ("no optimum: at the start and elsewhere the objective does not depend on the parameters; "
        "start where it does")


class FailedRun(Exception):
    """A run failed at these scaled parameters."""

    def __init__(self, place: Floats, why: str) -> None:
        super().__init__(why)
        self.place = place


class Spent(Exception):
    """No more evaluations."""


@dataclass(frozen=True)
class End:
    """How a search has ended.

    Attributes
    ----------
    word : str
        "optimum ...", or why it is none.
    doubt : str
        Where another optimum may exist; empty where the scan excludes it.
    best : Evaluation
        The best one.
    size : (n,)
        Derivatives that count as zero there.
    sides : tuple of Evaluation
        Of a corner, both sides of it.
    """

    word: str
    doubt: str
    best: Evaluation
    size: Floats
    sides: tuple[Evaluation, ...]


@dataclass(frozen=True)
class Step:
    """An evaluation in scaled parameters: the slope of what is minimised."""

    scaled: Floats
    found: Evaluation
    height: float
    slope: Floats


class Search:
    """One optimisation at work; those of one parameter and of several extend it.

    Parameters
    ----------
    unknowns : Unknowns
        The parameters.
    evaluate : callable
        The objective.
    upwards : bool
        Whether it is to be large.
    tolerance : float
        On the scaled parameters.
    most : int
        Evaluations.
    scan : bool
        Whether to look for other optima.
    tell : callable, optional
        Told of every evaluation.
    """

    def __init__(self, unknowns: Unknowns, evaluate: Callable[[Floats], Evaluation], *,
                 upwards: bool, tolerance: float, most: int, scan: bool,
                 tell: Callable[[Evaluation], object] | None) -> None:
        self._unknowns, self._evaluate, self._most, self._scans = unknowns, evaluate, most, scan
        self._sign, self._tolerance, self._tell = -1.0 if upwards else 1.0, tolerance, tell
        self._steps: list[Step] = []
        self.failures: list[str] = []
        self._places: list[Floats] = []
        self._logarithmic, self._size = False, 1.0
        self._low = unknowns.to_scaled(unknowns.low)
        self._high = unknowns.to_scaled(unknowns.high)

    @property
    def history(self) -> list[Evaluation]:
        """Every evaluation in its order."""
        return [one.found for one in self._steps]

    def run(self, start: Floats) -> End:
        """Search from values."""
        self._step(self._unknowns.to_scaled(start))
        return self._searched()

    def _searched(self) -> End:
        raise NotImplementedError

    @property
    def _spent_word(self) -> str:
        return f"no optimum: {self._most} evaluations are done"

    def _attempted(self, descent: Callable[[], str]) -> str:
        """How a descent ends that is begun anew within narrower bounds where a run fails."""
        word = ""
        while not word:
            try:
                word = descent()
            except FailedRun as failure:
                self._places.append(failure.place)
                if len(self.failures) >= MOST_FAILURES:
                    word = f"no optimum: given up after {len(self.failures)} runs that failed"
            if word == "optimum" and not self._is_free(self._best()):
                word = "" if self._leaves_room() else (
                    "no optimum: the search ended where runs begin to fail")
            self._leave_out()
        return word

    def _leave_out(self) -> None:
        """Bounds half way from the best point to where runs failed, in every direction taken."""
        unknowns, best = self._unknowns, self._best().scaled
        self._low, self._high = unknowns.to_scaled(unknowns.low), unknowns.to_scaled(unknowns.high)
        for place in self._places:
            half = best + _SHRINK * (place - best)
            self._low = np.where(place < best, np.maximum(self._low, half), self._low)
            self._high = np.where(place > best, np.minimum(self._high, half), self._high)

    def _leaves_room(self) -> bool:
        """Whether there is any to speak of between the best point and where runs failed."""
        best = self._best().scaled
        return all(np.abs(place - best).max() > _LEAST_ROOM for place in self._places)

    def _is_free(self, step: Step) -> bool:
        """Whether no bound but the user's own holds the best point."""
        unknowns = self._unknowns
        near = 1e-9 * (self._high - self._low)
        inner_low = self._low > unknowns.to_scaled(unknowns.low)
        inner_high = self._high < unknowns.to_scaled(unknowns.high)
        return not bool((((step.scaled <= self._low + near) & inner_low)
                         | ((step.scaled >= self._high - near) & inner_high)).any())

    def _projected(self, step: Step) -> Floats:
        """The slope without what leads out of the bounds."""
        out = ((step.scaled <= self._low) & (step.slope > 0.0)) | (
            (step.scaled >= self._high) & (step.slope < 0.0))
        return np.where(out, 0.0, step.slope)

    def _step(self, scaled: Floats) -> Step:
        for one in self._steps:
            if np.array_equal(one.scaled, scaled):
                return one
        if len(self._steps) + len(self.failures) >= self._most:
            raise Spent
        values = self._unknowns.to_values(scaled)
        try:
            found = self._evaluate(values)
        except ConvergenceError as error:
            raise self._failed(scaled, values, error) from error
        if not self._steps:
            self._logarithmic = found.value > 0.0
            self._size = abs(found.value) or 1.0
        if self._logarithmic and found.value <= 0.0:
            raise self._failed(scaled, values, ConvergenceError(
                f"the objective is {found.value:.6g}, was positive"))
        height, slope = found.value / self._size, found.gradient / self._size
        if self._logarithmic:
            slope, height = slope / height, float(np.log(height))
        step = Step(np.array(scaled), found, self._sign * height,
                     self._sign * slope * self._unknowns.slope(values))
        self._steps.append(step)
        if self._tell is not None:
            self._tell(found)
        return step

    def _failed(self, scaled: Floats, values: Floats, error: ConvergenceError) -> Exception:
        where = ", ".join(f"{name} = {value:.9g}"
                          for name, value in zip(self._unknowns.names, values))
        if not self._steps:
            return ConvergenceError(f"the first run failed, with {where}: {error}", error.result,
                                    error.report)
        self.failures.append(f"the run with {where} failed: {error}")
        return FailedRun(np.array(scaled), str(error))

    def _best(self) -> Step:
        return min(self._steps, key=lambda one: one.height)

    def _size_of(self, step: Step, slopes: Floats) -> Floats:
        """Derivatives of the objective that slopes of what is minimised stand for."""
        height = abs(step.found.value) if self._logarithmic else self._size
        return np.asarray(slopes * height / self._unknowns.slope(step.found.parameters))

    def _at_bounds(self, step: Step) -> str:
        sides = self._unknowns.at_bound(step.found.parameters)
        return ", ".join(f"{name} at its {'upper' if side > 0 else 'lower'} one"
                         for name, side in zip(self._unknowns.names, sides) if side)
