"""The highest peak of a sweep with its derivatives, located between the rows.

At a maximum over the frequency dQ/domega = 0, so that dQ*/dp = dQ/dp at the frequency held (the
envelope theorem). What else is asked at the peak moves with it: dW*/dp = W_p + W_omega omega*_p,
omega*_p = -Q_omega,p / Q_omega,omega. The slopes by omega are those of polynomials through exact
values and derivatives at a few frequencies about the peak.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from .._native import namelist_values
from ..analyses import run
from ..case import Case
from ..errors import ConvergenceError
from ..peaks import Peak
from ..result import Result
from ..steps import Steps
from .parameters import differentiated, has_parts

__all__ = ["OF_INSTANTS", "PeakValues", "peak_values"]

Floats = NDArray[np.float64]

#: Frequencies of a window about a peak, from -1 to 1.
_NODES = -np.cos(np.pi * np.arange(7) / 6.0)
#: Half widths of the first window and of the last, over the width of the peak. In the last, six
#: orders above and below a Lorentzian leave 1e-9 of the slope, and round-off of the solver less.
_FIRST_WIDTH, _LAST_WIDTH = 0.05, 0.02
#: Peaks within this of the highest one are all located: a sweep knows heights to some 1e-4.
_TIED = 1e-3
#: Last coefficients of a window over the largest one, above which contact switches in it: a smaller
#: one is taken, down to this part of the frequency.
_TAIL, _LEAST_WIDTH = 1e-8, 1e-6
#: Windows until a peak counts as not located.
_MOST_WINDOWS = 20
#: Rows from which the peak is come back to, and how near they have to be to the sweep's own.
_APPROACH, _SAME = 4, 1e-5
#: How the remark begins that slopes are those of contact at instants.
OF_INSTANTS = "derivatives of instants"
#: Residual of the solver, so that derivatives are good for an optimum to 1e-6.
_TOLERANCE = 1e-11


@dataclass(frozen=True)
class PeakValues:
    """Quantities at the highest peak with derivatives by key.

    Attributes
    ----------
    omega : float
        Where it is [rad/s].
    value : dict
        Of every quantity, "omega" among them.
    derivative : dict
        By quantity, then by key (n_parts), () of the case as a whole.
    solved : int
        Solutions that this took.
    remarks : tuple of str
        What the program or this search remarked.
    """

    omega: float
    value: dict[str, float]
    derivative: dict[str, dict[str, Floats]]
    solved: int
    remarks: tuple[str, ...]


def peak_values(case: Case, keys: Sequence[str], quantity: str, others: Sequence[str] = (),
                observe: str | None = None) -> PeakValues:
    """The largest value of `quantity` over a sweep, and `others` where it is.

    Parameters
    ----------
    case : Case
        With `analysis = 'frf'`.
    keys : sequence of str
        What to differentiate by.
    quantity : str
        "largest" or "first_harmonic".
    others : sequence of str
        "dissipation", "wear_volume".
    observe : str, optional
        Observed quantity; the first without it.

    Raises
    ------
    ConvergenceError
        A point has not converged, or the peak cannot be located; the message says which.
    """
    swept = run(case, in_memory=True)
    column = swept.index(observe)
    guesses = _first_guesses(swept, quantity, column)
    tight: Case = case.replace(solver={"tolerance": min(_TOLERANCE, _tolerance(case))},
                               sweep={"continuation": "natural"})
    quantities = [quantity, *(other for other in others if other != "omega")]
    with Steps(differentiated(tight, keys, quantities)) as steps:
        solver = _Solver(steps, keys, quantities, column)
        remarks = [*swept.remarks, *_doubts(swept)]
        windows = []
        for start, width in guesses:
            _approach(solver, swept, quantity, column, start)
            windows.append(_located(solver, start, width, _ends(steps), quantity, swept.name)
                           if width > 0.0 else _Window(start, 0.0, [solver.solve(start)]))
        window = max(windows, key=lambda one: one.height(quantity))
        if window.half == 0.0:
            remarks.append("the largest amplitude is at an end of the sweep, not at a peak")
    value, derivative = window.at_peak(quantity, keys, quantities)
    return PeakValues(value["omega"], value, derivative, swept.n_points + solver.solved,
                      tuple(remarks))


def _doubts(swept: Result) -> list[str]:
    """The remark that `&sensitivity` makes where contact is decided at instants."""
    law = namelist_values(swept.namelist)["contact%law"]
    if not swept.n_pairs or swept.attributes["sampling"] != "uniform" or law == ["regularised"]:
        return []
    return [f"{OF_INSTANTS}: contact is decided at instants, and slopes leave out that switches "
            "move; take harmonics%sampling = 'events'"]


def _tolerance(case: Case) -> float:
    with case.open() as session:
        return float(session.part("solver_tolerance")[0])


def _first_guesses(swept: Result, quantity: str, column: int) -> list[tuple[float, float]]:
    """Frequencies and widths of the maxima that may be the highest; no width at an end."""
    if not swept.converged.any():
        raise ConvergenceError(f"{swept.name}: no point has converged")
    step = float(np.abs(np.diff(swept.omega)).max(initial=0.0)) if swept.n_points > 1 else 0.0
    name = swept.observed[column]
    peaks = [peak for peak in swept.peaks if peak.observed == name]
    if not peaks or swept.n_points == 1:
        point = swept.peak(column)
        return [(float(swept.omega[point]), 0.0)]

    def height(peak: Peak) -> float:
        return (peak.amplitude if quantity == "largest"
                else float(np.hypot(*peak.coefficients[1:3])))

    top = max(height(peak) for peak in peaks)
    found = []
    for peak in peaks:
        # As near to each other as the search of the sweep is to their heights.
        if height(peak) < (1.0 - _TIED) * top:
            continue
        if peak.found_by == "jump":
            raise ConvergenceError(
                f"the response of {name} jumps at its highest point, which has no derivative "
                "there: follow it with sweep%continuation = 'arclength' (near "
                f"{peak.omega:.6g} rad/s)")
        if peak.found_by == "not resolved":
            raise ConvergenceError(f"the highest peak of {name}, near {peak.omega:.6g} rad/s, was "
                                   "not resolved: take more points")
        width = peak.bandwidth if np.isfinite(peak.bandwidth) else step
        found.append((peak.omega, 0.0 if peak.found_by == "end of the sweep" else width))
    return found


def _ends(steps: Steps) -> tuple[float, float]:
    omega = steps.frequencies
    return float(omega.min()), float(omega.max())


class _Solver:
    """Values and derivatives of one observed quantity at one frequency after the other."""

    def __init__(self, steps: Steps, keys: Sequence[str], quantities: Sequence[str],
                 column: int) -> None:
        self._steps, self._keys, self._quantities, self._column = steps, keys, quantities, column
        self._n_observed = len(steps.observed)
        self.solved = 0

    def solve(self, omega: float) -> dict[str, Floats]:
        """Arrays by "QUANTITY" and "QUANTITY/KEY"."""
        self.solved += 1
        if not self._steps.advance(omega):
            raise ConvergenceError(f"the point at {omega:.9g} rad/s did not converge")
        found: dict[str, Floats] = {}
        for quantity in self._quantities:
            found[quantity] = self._of(f"sensitivity/value/{quantity}", quantity)
            for key in self._keys:
                name = f"sensitivity/{quantity}/{key.replace('%', '_')}"
                found[f"{quantity}/{key}"] = self._of(name, quantity)
        return found

    def _of(self, name: str, quantity: str) -> Floats:
        values = self._steps.numbers(name)
        if quantity not in ("largest", "first_harmonic"):
            return values
        return values.reshape(self._n_observed, -1)[self._column]


def _approach(solver: _Solver, swept: Result, quantity: str, column: int, start: float) -> None:
    """Come to the peak by rows of the sweep, and make sure that it is the same solution."""
    nearest = int(np.argmin(np.abs(swept.omega - start)))
    rows = range(max(0, nearest - _APPROACH), nearest)
    first = swept.amplitude[:, column] if quantity == "largest" else np.hypot(
        swept.coefficients[:, 1, column], swept.coefficients[:, 2, column])
    for again in (rows, range(nearest)):
        values = [float(solver.solve(float(swept.omega[k]))[quantity][0]) for k in again]
        if not values or abs(values[-1] - first[again[-1]]) <= _SAME * first.max():
            return
    raise ConvergenceError(f"the peak near {start:.6g} rad/s cannot be come back to from the "
                           "frequencies below it: another solution is found there; take more "
                           "points")


@dataclass(frozen=True)
class _Window:
    """Solutions at Chebyshev's points about a peak."""

    centre: float
    half: float
    rows: list[dict[str, Floats]]

    def polynomial(self, name: str) -> Floats:
        """Coefficients (7, n) of a value or derivative over x from -1 to 1."""
        values = np.array([row[name] for row in self.rows])
        if len(values) == 1:
            return values
        return np.asarray(chebyshev.chebfit(_NODES, values, len(_NODES) - 1))

    def top(self, quantity: str) -> float:
        """Where the quantity is largest, from -1 to 1."""
        series = self.polynomial(quantity)[:, 0]
        found = chebyshev.chebroots(chebyshev.chebder(series))
        inside = found.real[(np.abs(found.imag) < 1e-6) & (np.abs(found.real) <= 1.0)]
        places = np.concatenate((inside, [-1.0, 1.0]))
        return float(places[np.argmax(chebyshev.chebval(places, series))])

    def is_smooth(self, quantity: str) -> bool:
        """Whether the polynomial tells the quantity: no switch of contact bends it."""
        series = np.abs(self.polynomial(quantity)[:, 0])
        return bool(series[-2:].max() <= _TAIL * series.max())

    def height(self, quantity: str) -> float:
        """The largest value of the quantity."""
        x = self.top(quantity) if self.half > 0.0 else 0.0
        return float(self._slope(quantity, x, 0)[0])

    def at_peak(self, quantity: str, keys: Sequence[str], quantities: Sequence[str]
                ) -> tuple[dict[str, float], dict[str, dict[str, Floats]]]:
        """Values and derivatives by key where the quantity is largest."""
        x = self.top(quantity) if self.half > 0.0 else 0.0
        value = {"omega": self.centre + self.half * x}
        derivative: dict[str, dict[str, Floats]] = {"omega": {}}
        moves = {key: np.zeros(1) for key in keys}
        if self.half > 0.0:
            curvature = self._slope(quantity, x, 2)
            moves = {key: -self._slope(f"{quantity}/{key}", x, 1) / curvature for key in keys}
        derivative["omega"] = dict(moves)
        for name in quantities:
            value[name] = float(self._slope(name, x, 0)[0])
            derivative[name] = {key: self._slope(f"{name}/{key}", x, 0) for key in keys}
            if name != quantity and self.half > 0.0:
                rate = self._slope(name, x, 1)
                derivative[name] = {key: by + rate * moves[key]
                                    for key, by in derivative[name].items()}
        return value, {name: {key: by if has_parts(key) else by[0] for key, by in slopes.items()}
                       for name, slopes in derivative.items()}

    def _slope(self, name: str, x: float, order: int) -> Floats:
        """A derivative by omega of a value or derivative."""
        series = chebyshev.chebder(self.polynomial(name), order) if order else (
            self.polynomial(name))
        values = np.asarray(chebyshev.chebval(x, series))
        return values / self.half**order if order else values


def _located(solver: _Solver, start: float, width: float, ends: tuple[float, float],
             quantity: str, name: str) -> _Window:
    """The window whose middle part has the peak."""
    centre, half, last = start, _FIRST_WIDTH * width, _LAST_WIDTH * width
    for _ in range(_MOST_WINDOWS):
        centre = min(max(centre, ends[0] + half), ends[1] - half)
        rows = [solver.solve(float(omega)) for omega in centre + half * _NODES]
        window = _Window(centre, half, rows)
        x = window.top(quantity)
        if abs(x) < 0.7 and half <= last:
            last = 0.3 * half
            if window.is_smooth(quantity) or last < _LEAST_WIDTH * centre:
                return window
        centre += half * x
        # At an end of the window the peak is outside.
        half = 2.0 * half if abs(x) == 1.0 else max(last, 0.3 * half)
    raise ConvergenceError(f"{name}: the peak near {start:.6g} rad/s cannot be located")
