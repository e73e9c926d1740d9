"""Optimisation of parameters of a case with the exact gradient."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from ..case import Case
from ..errors import ConvergenceError, InputError
from .objectives import Evaluation, Objective, new_objective
from .one_parameter import descend
from .parameters import Bounds, Unknowns, bound_pairs
from .peak_values import OF_INSTANTS

__all__ = ["Optimum", "as_case", "optimise", "several"]

Floats = NDArray[np.float64]

#: Failed runs after which the search gives up, each with bounds that exclude it.
_MOST_FAILURES = 8
#: First step of one parameter that is looked for by its logarithm.
_FIRST_STEP = 0.5
#: How far beyond a good value a failed one may be tried again.
_SHRINK = 0.5
#: Scaled distance to a run that failed below which the search does not go nearer.
_LEAST_ROOM = 1e-2


@dataclass(frozen=True)
class Optimum:
    """What an optimisation has found.

    Attributes
    ----------
    objective : str
        What was made small or large.
    names : list of str
        Parameters.
    values : (n,)
        Values, or factors, of the parameters at the optimum.
    value : float
        The objective there.
    gradient : (n,)
        Its derivatives by the parameters there.
    omega : float
        Frequency of the peak there [rad/s]; NaN where the objective is of no peak.
    converged : bool
        Whether it is an optimum, perhaps at a bound.
    word : str
        How the search ended: 'optimum', 'optimum at a bound: ...', or why it is none.
    history : list of Evaluation
        Every evaluation in its order; those of runs that failed are not among them.
    failures : list of str
        Runs that failed, with their parameters and why.
    n_evaluations : int
        Evaluations, failed ones included.
    n_solutions : int
        Solutions of the balance that they took.
    remarks : tuple of str
        What was remarked at the optimum.
    case : Case
        The case at the optimum.
    """

    objective: str
    names: list[str]
    values: Floats
    value: float
    gradient: Floats
    omega: float
    converged: bool
    word: str
    history: list[Evaluation]
    failures: list[str]
    n_evaluations: int
    n_solutions: int
    remarks: tuple[str, ...]
    case: Case

    def __str__(self) -> str:
        lines = [f"{name:46}{value:.9g}" for name, value in zip(self.names, self.values)]
        lines.append(f"{self.objective:46}{self.value:.9g}")
        if np.isfinite(self.omega):
            lines.append(f"{'at':46}{self.omega:.9g} rad/s, {self.omega / (2 * np.pi):.9g} Hz")
        lines += [f"{'derivative by ' + name:46}{slope:.3e}"
                  for name, slope in zip(self.names, self.gradient)]
        lines.append(f"{self.word}; {self.n_evaluations} evaluations, {self.n_solutions} solutions")
        return "\n".join([*lines, *self.failures, *(f"remark: {text}" for text in self.remarks)])


def optimise(case: Case | str, *, minimise: Objective | None = None,
             maximise: Objective | None = None, over: str | Sequence[str], bounds: Bounds,
             start: float | Sequence[float] | None = None, factors: bool = False,
             tolerance: float = 1e-6, max_evaluations: int = 100,
             progress: Callable[[Evaluation], object] | bool | None = None) -> Optimum:
    """Find the parameters that make a quantity smallest, or largest, by its exact gradient.

    Works with the logarithm of positive parameters and of positive quantities: of one parameter by
    a bracket of the slope, of several by L-BFGS-B of scipy. It finds one optimum, the one that it
    comes to from the start.

    Parameters
    ----------
    case : Case or path
        The case; its keys are replaced by the parameters at work, and no file is written.
    minimise, maximise : str or callable
        One of the two: a name of `fretwear.design.OBJECTIVES`, such as "max_amplitude" or
        "max_amplitude[tip]", or a function of the `Sensitivities` of a run of the case, which
        returns a number and its derivatives by the quantities it is made of: a dictionary of
        arrays of their shapes.
    over : str or sequence of str
        Parameters, "group%key" as in `sensitivity%parameters`; "contact%mu(1:8)" is of the first
        eight pairs. Each is one number for all its pairs or springs.
    bounds : (low, high), or a sequence of these
        Of each parameter.
    start : float or sequence of float, optional
        Where to begin; without it the values of the case.
    factors : bool
        Whether the parameters are factors of the values of the case.
    tolerance : float
        On the parameters, relative to their sizes (where they are positive) or to their bounds.
    max_evaluations : int
        Evaluations at most.
    progress : callable or bool, optional
        Told of every evaluation; True prints a line of each.

    Returns
    -------
    Optimum
        `converged` and `word` say whether it is one.

    Raises
    ------
    InputError
        Names, bounds or the case are wrong.
    ConvergenceError
        The first run has failed.
    """
    if (minimise is None) == (maximise is None):
        raise InputError("minimise, maximise: give one of the two")
    case, over = as_case(case), several(over)
    unknowns = Unknowns(case, over, bound_pairs(bounds, len(over)), factors=factors)
    what = minimise if minimise is not None else maximise
    assert what is not None  # checked above
    if progress is True:
        progress = _Lines(unknowns.names)
    search = _Search(unknowns, new_objective(what, unknowns, case), maximise is not None,
                     tolerance, max_evaluations, progress or None)
    search.name = what if isinstance(what, str) else "objective"
    first = None if start is None else np.atleast_1d(np.array(start, dtype=float)).tolist()
    return search.run(unknowns.start(first))


class _FailedRun(Exception):
    """A run failed at these scaled parameters."""

    def __init__(self, place: Floats, why: str) -> None:
        super().__init__(why)
        self.place = place


class _End(Exception):
    """No more evaluations, or no need of more: how the search ended."""


@dataclass(frozen=True)
class _Step:
    """An evaluation in scaled parameters: the slope of what is minimised."""

    scaled: Floats
    found: Evaluation
    height: float
    slope: Floats


class _Search:
    """One optimisation at work."""

    def __init__(self, unknowns: Unknowns, evaluate: Callable[[Floats], Evaluation],
                 upwards: bool, tolerance: float, most: int,
                 tell: Callable[[Evaluation], object] | None) -> None:
        self._unknowns, self._evaluate, self._most = unknowns, evaluate, most
        self._sign, self._tolerance, self._tell = -1.0 if upwards else 1.0, tolerance, tell
        self.name = "objective"
        self._steps: list[_Step] = []
        self._failures: list[str] = []
        self._places: list[Floats] = []
        self._logarithmic, self._size = False, 1.0
        self._low = unknowns.to_scaled(unknowns.low)
        self._high = unknowns.to_scaled(unknowns.high)

    def run(self, start: Floats) -> Optimum:
        """Search from values."""
        scaled, word = self._unknowns.to_scaled(start), ""
        while not word:
            try:
                if not self._steps:
                    self._begin(scaled)
                word = self._descend(self._best().scaled)
            except _End as reason:
                word = str(reason)
            except _FailedRun as failure:
                self._places.append(failure.place)
                if len(self._failures) >= _MOST_FAILURES:
                    word = f"no optimum: given up after {len(self._failures)} runs that failed"
            if word == "optimum" and not self._is_stationary(self._best()):
                word = "" if self._leaves_room() else (
                    "no optimum: the search ended where runs begin to fail")
            self._leave_out()
        return self._finish(word)

    def _begin(self, scaled: Floats) -> None:
        """The first evaluation, and another where nothing tells which way to go."""
        first = self._step(scaled)
        if np.abs(self._projected(first)).max() > self._slope_wanted:
            return
        other = 0.5 * (self._low + self._high)
        if np.abs(other - scaled).max() < 0.1 * (self._high - self._low).max():
            other = self._low + 0.25 * (self._high - self._low)
        second = self._step(other)
        if second.height > first.height:
            raise _End("optimum")
        if np.abs(self._projected(second)).max() <= self._slope_wanted:
            raise _End("no optimum: at the start and elsewhere the objective does not depend on "
                       "the parameters; start where it does")

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

    @property
    def _slope_wanted(self) -> float:
        # Where the curvature in logarithms is 0.01 or more, this slope is that close.
        return 1e-2 * self._tolerance

    def _descend(self, scaled: Floats) -> str:
        if len(scaled) == 1:
            span = float(self._high[0] - self._low[0])
            descend(self._asked_one, float(scaled[0]), float(self._low[0]), float(self._high[0]),
                    min(_FIRST_STEP, 0.25 * span), self._tolerance)
            if any(remark.startswith(OF_INSTANTS) for remark in self._best().found.remarks):
                return ("optimum at a corner, or near one: contact is decided at instants, whose "
                        "slopes leave out that switches move; sampling = 'events' tells which")
            return ("optimum at a corner: the slope jumps from one sign to the other, as where "
                    "another peak becomes the highest")
        # scipy's own tests are left to the last: they stop on the value, or wait for its noise.
        minimize = import_module("scipy.optimize").minimize  # where needed: it takes time
        found = minimize(
            self._asked, scaled, jac=True, method="L-BFGS-B",
            bounds=list(zip(self._low, self._high)),
            options={"ftol": 0.0, "gtol": self._slope_wanted, "maxfun": 10 * self._most,
                     "maxiter": 10 * self._most})
        if found.status == 0:
            return "optimum"
        text = found.message if isinstance(found.message, str) else found.message.decode()
        return f"no optimum: {' '.join(text.split()).lower()}"

    def _asked_one(self, scaled: float) -> tuple[float, float]:
        height, slope = self._asked(np.array([scaled]))
        return height, float(slope[0])

    def _asked(self, scaled: Floats) -> tuple[float, Floats]:
        step = self._step(scaled)
        if self._is_there(step):
            raise _End("optimum")
        return step.height, step.slope

    def _is_there(self, step: _Step) -> bool:
        """Whether slopes vanish but for those held by a bound; of one, whether its root is near."""
        slope = self._projected(step)
        if np.abs(slope).max() <= self._slope_wanted:
            return True
        if len(slope) > 1 or len(self._steps) < 2 or slope[0] == 0.0:
            return False
        before = min(self._steps, key=lambda one: abs(one.scaled[0] - step.scaled[0])
                     if one is not step else np.inf)
        change = (step.slope - before.slope)[0] / (step.scaled - before.scaled)[0]
        # Of a minimum, and near enough for the line through both slopes to tell.
        return bool(change > 0.0 and abs(slope[0]) / change <= 0.1 * self._tolerance
                    and abs(before.scaled - step.scaled)[0] < 1e-2)

    def _projected(self, step: _Step) -> Floats:
        """The slope without what leads out of the bounds."""
        out = ((step.scaled <= self._low) & (step.slope > 0.0)) | (
            (step.scaled >= self._high) & (step.slope < 0.0))
        return np.where(out, 0.0, step.slope)

    def _step(self, scaled: Floats) -> _Step:
        for one in self._steps:
            if np.array_equal(one.scaled, scaled):
                return one
        if len(self._steps) + len(self._failures) >= self._most:
            raise _End(f"no optimum: {self._most} evaluations are done")
        values = self._unknowns.to_values(scaled)
        try:
            found = self._evaluate(values)
        except ConvergenceError as error:
            raise self._failed(scaled, values, error) from error
        if not self._steps:
            self._logarithmic = found.value > 0.0
            self._size = abs(found.value) or 1.0
        height, slope = found.value / self._size, found.gradient / self._size
        if self._logarithmic:
            if found.value <= 0.0:
                raise self._failed(scaled, values, ConvergenceError(
                    f"the objective is {found.value:.6g}, was positive"))
            height, slope = np.log(found.value), found.gradient / found.value
        step = _Step(np.array(scaled), found, self._sign * float(height),
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
        self._failures.append(f"the run with {where} failed: {error}")
        return _FailedRun(np.array(scaled), str(error))

    def _best(self) -> _Step:
        return min(self._steps, key=lambda one: one.height)

    def _finish(self, word: str) -> Optimum:
        best, unknowns = self._best(), self._unknowns
        values = best.found.parameters
        sides = unknowns.at_bound(values)
        if word == "optimum" and sides.any():
            word += " at a bound: " + ", ".join(
                f"{name} at its {'upper' if side > 0 else 'lower'} one"
                for name, side in zip(unknowns.names, sides) if side)
        return Optimum(
            self.name, unknowns.names, values, best.found.value, best.found.gradient,
            best.found.omega,
            word.startswith("optimum"), word, [one.found for one in self._steps], self._failures,
            len(self._steps) + len(self._failures), sum(one.found.solved for one in self._steps),
            best.found.remarks, unknowns.case_at(values))

    def _is_stationary(self, step: _Step) -> bool:
        """Whether no bound but the user's own holds the best point."""
        unknowns = self._unknowns
        near = 1e-9 * (self._high - self._low)
        inner_low = self._low > unknowns.to_scaled(unknowns.low)
        inner_high = self._high < unknowns.to_scaled(unknowns.high)
        return not bool((((step.scaled <= self._low + near) & inner_low)
                         | ((step.scaled >= self._high - near) & inner_high)).any())


class _Lines:
    """A line for each evaluation."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names, self._count = names, 0

    def __call__(self, found: Evaluation) -> None:
        self._count += 1
        where = ", ".join(f"{name} = {value:.9g}"
                          for name, value in zip(self._names, found.parameters))
        slope = ", ".join(f"{value:.3e}" for value in found.gradient)
        print(f"{self._count:3d}  {where}: {found.value:.9g}, derivative {slope}", flush=True)


def as_case(case: object) -> Case:
    """A case, or that of a namelist."""
    if isinstance(case, Case):
        return case
    if isinstance(case, (str, bytes)) or hasattr(case, "__fspath__"):
        return Case.from_file(case)  # type: ignore[arg-type]
    raise InputError(f"case: is a {type(case).__name__}, must be a Case or the path of a namelist")


def several(texts: str | Sequence[str]) -> list[str]:
    """A list of one name, or of several."""
    return [texts] if isinstance(texts, str) else list(texts)

