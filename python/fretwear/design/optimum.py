"""Optimisation of parameters of a case with the exact gradient."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..case import Case
from ..errors import InputError
from .gradient_search import SeveralParameters
from .line_search import OneParameter
from .objectives import Evaluation, Objective, new_objective
from .parameters import Bounds, Unknowns, bound_pairs

__all__ = ["Optimum", "as_case", "optimise", "several"]

Floats = NDArray[np.float64]


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
    gradient_size : (n,)
        Derivatives below these count as zero: they are of `tolerance` on the parameter.
    sides : tuple of Evaluation
        Both sides of a corner, nearer to each other than `tolerance`; empty elsewhere.
    omega : float
        Frequency of the peak there [rad/s]; NaN where the objective is of no peak.
    converged : bool
        Whether it is an optimum, perhaps at a bound.
    word : str
        How the search ended: 'optimum', 'optimum at a bound: ...', 'optimum at a corner: ...',
        'optimum on a plateau: ...', or why it is none.
    doubt : str
        Where another optimum may exist; empty where the places looked at exclude it.
    history : list of Evaluation
        Every evaluation in its order; those of runs that failed are not among them.
    failures : list of str
        Runs that failed, with their parameters and why.
    n_evaluations : int
        Evaluations, failed ones included.
    n_solutions : int
        Solutions of the balance that they took.
    remarks : tuple of str
        What was remarked at the optimum, and on both sides of a corner.
    case : Case
        The case at the optimum.
    """

    objective: str
    names: list[str]
    values: Floats
    value: float
    gradient: Floats
    gradient_size: Floats
    sides: tuple[Evaluation, ...]
    omega: float
    converged: bool
    word: str
    doubt: str
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
        for k, (name, slope, size) in enumerate(zip(self.names, self.gradient,
                                                    self.gradient_size)):
            there = (", ".join(f"{one.gradient[k]:.3e} at {one.parameters[k]:.9g}"
                               for one in self.sides)
                     or f"{slope:.3e}" + (f" (zero is below {size:.1e})" if abs(slope) <= size
                                          else ""))
            lines.append(f"{'derivative by ' + name:46}{there}")
        lines.append(f"{self.word}; {self.n_evaluations} evaluations, {self.n_solutions} solutions")
        doubt = [self.doubt] if self.doubt else []
        return "\n".join([*lines, *doubt, *self.failures,
                          *(f"remark: {text}" for text in self.remarks)])


def optimise(case: Case | str, *, minimise: Objective | None = None,
             maximise: Objective | None = None, over: str | Sequence[str], bounds: Bounds,
             start: float | Sequence[float] | None = None, factors: bool = False,
             tolerance: float = 1e-6, max_evaluations: int = 100, scan: bool = True,
             progress: Callable[[Evaluation], object] | bool | None = None) -> Optimum:
    """Find the parameters that make a quantity smallest, or largest, by its exact gradient.

    Works with the logarithm of positive parameters and of positive quantities: of one parameter by
    a bracket of the slope, of several by L-BFGS-B of scipy. Then it looks for a better one: of one
    parameter between the bounds, of several along each of them; `doubt` says where that was not
    enough.

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
    scan : bool
        Whether to look for other optima; without it the search ends at the first one.
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
    kind = OneParameter if len(over) == 1 else SeveralParameters
    search = kind(unknowns, new_objective(what, unknowns, case), upwards=maximise is not None,
                  tolerance=tolerance, most=max_evaluations, scan=scan, tell=progress or None)
    first = None if start is None else np.atleast_1d(np.array(start, dtype=float)).tolist()
    end = search.run(unknowns.start(first))
    best = end.best
    # At a corner the other side may have its peak at an end of the sweep.
    remarks = dict.fromkeys(text for one in (best, *end.sides) for text in one.remarks)
    return Optimum(
        what if isinstance(what, str) else "objective", unknowns.names, best.parameters,
        best.value, best.gradient, end.size, end.sides, best.omega,
        end.word.startswith("optimum"), end.word, end.doubt, search.history, search.failures,
        len(search.history) + len(search.failures), sum(one.solved for one in search.history),
        tuple(remarks), unknowns.case_at(best.parameters))


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

