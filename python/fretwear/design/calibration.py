"""Parameters of a case from measured curves, with their covariance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from ..case import Case
from ..errors import ConvergenceError, InputError
from .measured import Measured
from .optimum import as_case, several
from .parameters import Bounds, Unknowns, bound_pairs

__all__ = ["Calibration", "Fit", "calibrate"]

Floats = NDArray[np.float64]

#: Parameters whose scaled columns are nearer to each other than this cannot be told apart.
_SINGULAR = 1e-7
#: Residuals are larger than their deviations where this part of good fits is better.
_DOUBTFUL = 0.99


@dataclass(frozen=True)
class Fit:
    """A place that a calibration has looked at.

    Attributes
    ----------
    parameters : (n,)
        Values.
    residual : (m,)
        What the case says, less what was measured, over the deviations.
    """

    parameters: Floats
    residual: Floats

    @property
    def chi_square(self) -> float:
        """Sum of the squares of the residuals."""
        return float(self.residual @ self.residual)


@dataclass(frozen=True)
class Calibration:
    """What a calibration has found.

    Attributes
    ----------
    names : list of str
        Parameters.
    values : (n,)
        Their values, or factors.
    errors : (n,)
        Standard errors; NaN of those at a bound, infinite where the data do not tell.
    covariance : (n, n)
        Of the values, to first order.
    residual : (m,)
        What the case says, less what was measured, over the deviations.
    predicted : list of (m_k,) arrays
        What the case says, for each of the data.
    chi_square, freedom : float, int
        Sum of the squares of the residuals, and how many numbers are left over.
    at_bound : (n,) int
        -1 at the lower bound, 1 at the upper, 0 between.
    converged : bool
        Whether it is a least-squares solution.
    word : str
        How it ended, and what is to be said of the errors.
    is_exact : bool
        Whether derivatives were exact; differences where not.
    history : list of Fit
        What was looked at.
    failures : list of str
        Runs that failed, with why.
    n_evaluations : int
        Values of the parameters that were looked at, failed ones included.
    n_solutions : int
        Solutions, or curves of modes, that they took.
    case : Case
        The first case, with these values.
    """

    names: list[str]
    values: Floats
    errors: Floats
    covariance: Floats
    residual: Floats
    predicted: list[Floats]
    chi_square: float
    freedom: int
    at_bound: NDArray[np.int_]
    converged: bool
    word: str
    is_exact: bool
    history: list[Fit]
    failures: list[str]
    n_evaluations: int
    n_solutions: int
    case: Case
    _logarithmic: NDArray[np.bool_]

    def interval(self, share: float = 0.95) -> Floats:
        """Lower and upper end (n, 2) between which a parameter lies with a probability.

        Of errors that are normally distributed (in the logarithm of positive parameters), one
        parameter at a time; by Student's distribution where the deviations of the data are not
        known.
        """
        stats = import_module("scipy.stats")
        width = float(stats.norm.ppf(0.5 + 0.5 * share) if self._is_known
                      else stats.t.ppf(0.5 + 0.5 * share, self.freedom))
        relative = np.divide(width * self.errors, self.values, where=self._logarithmic,
                             out=np.zeros(len(self.values)))
        spread = width * self.errors
        low = np.where(self._logarithmic, self.values * np.exp(-relative), self.values - spread)
        high = np.where(self._logarithmic, self.values * np.exp(relative), self.values + spread)
        return np.stack((low, high), axis=1)

    _is_known: bool = True

    @property
    def correlation(self) -> Floats:
        """Of the parameters (n, n)."""
        return self.covariance / np.outer(self.errors, self.errors)

    def __str__(self) -> str:
        lines = []
        for name, value, error, (low, high) in zip(self.names, self.values, self.errors,
                                                   self.interval()):
            lines.append(f"{name:32}{value:14.7g} +- {error:.2g}   (95 %: {low:.6g} to "
                         f"{high:.6g})" if np.isfinite(error) else f"{name:32}{value:14.7g}")
        lines.append(f"{'squares over freedom':32}{self.chi_square:.5g} / {self.freedom}")
        correlation = self.correlation
        for k, name in enumerate(self.names):
            lines += [f"correlation {correlation[k, j]:+.3f} of {name} and {self.names[j]}"
                      for j in range(k) if abs(correlation[k, j]) > 0.9]
        lines.append(f"{self.word}; {self.n_evaluations} evaluations, {self.n_solutions} "
                     f"solutions, derivatives {'exact' if self.is_exact else 'by differences'}")
        return "\n".join([*lines, *self.failures])


def calibrate(case: Case | str, data: Measured | Sequence[Measured], *,
              over: str | Sequence[str], bounds: Bounds,
              start: float | Sequence[float] | None = None, factors: bool = False,
              max_evaluations: int = 200,
              progress: Callable[[Fit], object] | bool | None = None) -> Calibration:
    """Find the parameters with which a case comes nearest to measured curves.

    Least squares (scipy's trust-region method) of residuals over their standard deviations, with
    the derivatives of the library; positive parameters are looked for by their logarithm. The
    covariance is that of the linear problem at the solution. Where no deviations are given, the
    residuals tell them.

    Parameters
    ----------
    case : Case or path
        The case that data without one of their own are of.
    data : ModeData, ResponseData, ControlData, or sequence of these
        What was measured.
    over : str or sequence of str
        Parameters, see `optimise`.
    bounds : (low, high), or a sequence of these
        Of each parameter.
    start : float or sequence of float, optional
        Where to begin; without it the values of the case.
    factors : bool
        Whether the parameters are factors of the values of the case.
    max_evaluations : int
        At most.
    progress : callable or bool, optional
        Told of every place that was looked at; True prints a line of each.

    Returns
    -------
    Calibration
        `converged` and `word` say whether it is a solution, and how good.

    Raises
    ------
    InputError
        Names, bounds, data or a case are wrong.
    ConvergenceError
        The first run has failed.
    """
    case = as_case(case)
    names = several(over)
    unknowns = Unknowns(case, names, bound_pairs(bounds, len(names)), factors=factors)
    sets = [data] if isinstance(data, Measured) else list(data)
    search = _Search(unknowns, case, sets, max_evaluations,
                     _Lines(unknowns.names) if progress is True else progress or None)
    first = None if start is None else np.atleast_1d(np.array(start, dtype=float)).tolist()
    return search.run(unknowns.start(first))


class _Search:
    """One calibration at work."""

    def __init__(self, unknowns: Unknowns, case: Case, data: list[Measured], most: int,
                 tell: Callable[[Fit], object] | None) -> None:
        if not data or not all(isinstance(one, Measured) for one in data):
            raise InputError("data: must be ModeData, ResponseData, ControlData, or a list of "
                             "these")
        if len({one.is_known for one in data}) > 1:
            raise InputError("data: deviations are given for some and not for others; give all or "
                             "none")
        self._unknowns, self._case, self._data = unknowns, case, data
        self._most, self._tell = most, tell
        self._measured = np.concatenate([one.values for one in data])
        self._deviation = np.concatenate([one.deviation for one in data])
        if len(self._measured) <= len(unknowns.names):
            raise InputError(f"data: {len(self._measured)} numbers cannot tell "
                             f"{len(unknowns.names)} parameters with their errors")
        self._history: list[Fit] = []
        self._failures: list[str] = []
        self._solved, self._is_exact = 0, True
        self._kept: tuple[Floats, Floats, Floats] | None = None

    def run(self, start: Floats) -> Calibration:
        """Search from values."""
        unknowns = self._unknowns
        low, high = unknowns.to_scaled(unknowns.low), unknowns.to_scaled(unknowns.high)
        # The method wants to begin inside.
        inside = np.clip(unknowns.to_scaled(start), low + 1e-6 * (high - low),
                         high - 1e-6 * (high - low))
        solver = import_module("scipy.optimize").least_squares
        found = solver(self._residual, inside, jac=self._jacobian, bounds=(low, high),
                       method="trf", x_scale="jac", xtol=1e-7, ftol=1e-9, gtol=1e-9,
                       max_nfev=self._most)
        return self._finish(np.asarray(found.x), int(found.status))

    def _residual(self, scaled: Floats) -> Floats:
        values = self._unknowns.to_values(scaled)
        try:
            predicted = self._predict(values, slopes=False)[0]
        except ConvergenceError as error:
            where = ", ".join(f"{name} = {value:.9g}"
                              for name, value in zip(self._unknowns.names, values))
            if not self._history:
                raise ConvergenceError(f"the first run failed, with {where}: {error}",
                                       error.result, error.report) from error
            self._failures.append(f"the run with {where} failed: {error}")
            return np.full(len(self._measured), np.nan)  # the method takes a smaller step
        fit = Fit(values, (predicted - self._measured) / self._deviation)
        self._history.append(fit)
        if self._tell is not None:
            self._tell(fit)
        return fit.residual

    def _jacobian(self, scaled: Floats) -> Floats:
        values = self._unknowns.to_values(scaled)
        slopes = self._predict(values, slopes=True)[1]
        return slopes * self._unknowns.slope(values) / self._deviation[:, None]

    def _predict(self, values: Floats, *, slopes: bool) -> tuple[Floats, Floats]:
        if self._kept is not None and np.array_equal(self._kept[0], values) and (
                not slopes or self._kept[2].size):
            return self._kept[1], self._kept[2]
        parts = [one.predict(self._unknowns, values, one.case or self._case, slopes=slopes)
                 for one in self._data]
        self._solved += sum(part.solved for part in parts)
        blocks = [part.jacobian for part in parts if part.jacobian is not None]
        self._is_exact = all(one.is_exact for one in self._data)
        self._kept = (values.copy(), np.concatenate([part.values for part in parts]),
                      np.concatenate(blocks) if blocks else np.zeros(0))
        return self._kept[1], self._kept[2]

    def _finish(self, scaled: Floats, status: int) -> Calibration:
        unknowns = self._unknowns
        sides = np.where(scaled - unknowns.to_scaled(unknowns.low) < 1e-6, -1,
                         np.where(unknowns.to_scaled(unknowns.high) - scaled < 1e-6, 1, 0))
        values = unknowns.to_values(scaled)
        predicted, slopes = self._predict(values, slopes=True)
        residual = (predicted - self._measured) / self._deviation
        freedom = len(residual) - int((sides == 0).sum())
        known = self._data[0].is_known
        square = float(residual @ residual)
        covariance, remarks = _covariance(slopes / self._deviation[:, None], sides, unknowns)
        if not known:
            covariance = covariance * square / freedom
        remarks = self._remarks(sides, square, freedom, known=known) + remarks
        word = "solution" if status > 0 else f"no solution after {self._most} evaluations"
        ends = np.cumsum([len(one.values) for one in self._data])[:-1]
        return Calibration(
            unknowns.names, values, np.sqrt(np.diag(covariance)), covariance, residual,
            list(np.split(predicted, ends)), square, freedom, sides, status > 0,
            "; ".join([word, *remarks]), self._is_exact, self._history, self._failures,
            len(self._history) + len(self._failures), self._solved, unknowns.case_at(values),
            unknowns.logarithmic, known)

    def _remarks(self, sides: NDArray[np.int_], square: float, freedom: int, *, known: bool
                 ) -> list[str]:
        said = [f"{name} is at its {'upper' if side > 0 else 'lower'} bound and has no error"
                for name, side in zip(self._unknowns.names, sides) if side]
        if known:
            chance = float(import_module("scipy.stats").chi2.cdf(square, freedom))
            if chance > _DOUBTFUL:
                said.append("residuals are larger than their deviations: the case lacks something "
                            "or the deviations are too small, and so are the errors")
        return said


def _covariance(slopes: Floats, sides: NDArray[np.int_], unknowns: Unknowns
                ) -> tuple[Floats, list[str]]:
    """Covariance of the parameters off their bounds (NaN at them), and what it cannot tell."""
    n = slopes.shape[1]
    covariance = np.full((n, n), np.nan)
    free = np.flatnonzero(sides == 0)
    if not len(free):
        return covariance, []
    part = slopes[:, free]
    sizes = np.linalg.norm(part, axis=0)
    blind = sizes <= 1e-14 * max(float(sizes.max(initial=0.0)), 1e-300)
    if blind.any():
        covariance[np.ix_(free, free)] = np.inf
        return covariance, ["the data do not depend on "
                            + ", ".join(unknowns.names[k] for k in free[blind])]
    _, values, directions = np.linalg.svd(part / sizes, full_matrices=False)
    remarks = []
    if values[-1] < _SINGULAR * values[0]:
        worst = [unknowns.names[k] for k, share in zip(free, np.abs(directions[-1]))
                 if share > 0.1]
        remarks.append("the data do not tell apart " + ", ".join(worst))
    scaled = directions.T / np.maximum(values, 1e-300)
    covariance[np.ix_(free, free)] = (scaled @ scaled.T) / np.outer(sizes, sizes)
    return covariance, remarks


class _Lines:
    """A line for each place."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names, self._count = names, 0

    def __call__(self, fit: Fit) -> None:
        self._count += 1
        where = ", ".join(f"{name} = {value:.7g}"
                          for name, value in zip(self._names, fit.parameters))
        print(f"{self._count:3d}  {where}: squares {fit.chi_square:.6g}", flush=True)
