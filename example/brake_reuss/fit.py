"""Calibration of the joint on some levels, and its uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np
from record import MASS, Level, Repeatability

import fretwear as fw
from fretwear.beam import ReducedBeam
from fretwear.design import Calibration, ModeData

__all__ = ["Fitted", "Search", "calibrate", "calibrate_friction", "mode_case", "predict", "refine"]

Floats = np.ndarray
#: Of the first bending mode [Hz]: below it is the suspension alone.
NEAR = 80.0
N_HARMONICS = 3
#: Where the exponent begins: from 1 the search ends in a poor local minimum.
EXPONENT = 0.4
#: Where it is looked for with friction alone, for the same reason.
EXPONENTS = (0.2, 0.7)
#: What the four numbers are called, and what the covariance is of.
NAMES = ("limit", "cubic", "exponent", "stiffness")
#: Relative steps of differences, over which the tolerance of the solver stays small.
STEP = 1e-3
#: Steps of Gauss-Newton at most, and a change of the logarithms that ends them.
STEPS, ENOUGH = 12, 1e-4
HALVINGS = 6


def mode_case(beam: ReducedBeam, amplitudes: Sequence[float], **more: object) -> fw.Case:
    """A case of the first bending mode at amplitudes of the driven point [m]."""
    settings: Any = {"case": {"analysis": "mode"}, "harmonics": {"n_harmonics": N_HARMONICS},
                     "mode": {"amplitudes": sorted(set(amplitudes)), "near": NEAR, "unit": "Hz"},
                     **more}
    return beam.case(**settings)


def predict(beam: ReducedBeam, levels: Sequence[Level]) -> Floats:
    """Frequencies [Hz], then F/(2 m a), of the mode at the amplitudes of levels (2 n)."""
    sizes = np.array([one.displacement for one in levels])
    mode = fw.run(mode_case(beam, sizes.tolist()), in_memory=True).mode
    rows = np.searchsorted(mode.amplitude * (1.0 + 1e-12), sizes)
    return np.concatenate((mode.frequency[rows], mode.forced_damping_ratio(MASS)[rows]))


@dataclass(frozen=True)
class Fitted:
    """What a calibration has found.

    Attributes
    ----------
    beam : ReducedBeam
        With the numbers that were found.
    start : ReducedBeam
        The beam that the factor of the stiffness is of.
    values : (4,)
        Of NAMES: limit at the bolts [N/m], cubic spring [N/m^3], exponent, factor of the stiffness.
    free : list of int
        Those of them that were looked for.
    covariance : (n_free, n_free)
        Of the logarithms of these, to first order, with all looked for together.
    inner : Calibration
        The last calibration of limit and cubic spring, at this exponent and stiffness.
    squares, freedom : float, int
        Sum of the squared residuals over their deviations, and how many numbers are left over.
    evaluations : int
        Places of the exponent and the stiffness that were looked at.
    """

    beam: ReducedBeam
    start: ReducedBeam
    values: Floats
    free: list[int]
    covariance: Floats
    inner: Calibration
    squares: float
    freedom: int
    evaluations: int

    @property
    def errors(self) -> Floats:
        """Relative standard errors of the free values."""
        return np.sqrt(np.diag(self.covariance))

    def at(self, change: Floats) -> ReducedBeam:
        """The beam with changes of the logarithms of the free values."""
        values = self.values.copy()
        values[self.free] *= np.exp(change)
        return _beam(self.start, values)

    def slopes(self, levels: Sequence[Level]) -> Floats:
        """Derivatives of `predict` by the logarithms of the free values (2 n, n_free)."""
        return _slopes(self.start, self.values, self.free, levels)

    def deviations(self, levels: Sequence[Level]) -> Floats:
        """Standard deviations of `predict` from those of the values (2 n)."""
        slopes = self.slopes(levels)
        return np.sqrt(np.einsum("ij,jk,ik->i", slopes, self.covariance, slopes))


def calibrate(beam: ReducedBeam, levels: Sequence[Level], noise: Repeatability,
              start: Floats | None = None) -> Fitted:
    """All four numbers from frequency and damping of levels.

    `fw.calibrate` finds limit and cubic spring at a given exponent and stiffness; around it a
    least-squares search over these two takes what is left of the residuals (variable projection).
    """
    guess = (np.array([beam.full.parameters.limit, beam.full.parameters.cubic, EXPONENT, 1.0])
             if start is None else np.array(start, dtype=float))
    search = Search(beam, levels, noise, guess)
    import_module("scipy.optimize").least_squares(
        search.residual, np.log(guess[2:]), jac=search.jacobian,
        bounds=(np.log([0.05, 0.8]), np.log([3.0, 1.25])), xtol=1e-3, ftol=1e-4)
    # Near the solution steps of all four go on, through the valley that the search creeps along.
    rough = Fitted(_beam(beam, search.guess), beam, search.guess, [0, 1, 2, 3], np.zeros((4, 4)),
                   search.last, np.inf, 2 * len(levels) - 4, search.count)
    found = refine(rough, levels, noise)
    # What calibrate says of limit and spring there: their errors at this exponent and stiffness.
    search.guess = found.values.copy()
    return replace(found, inner=search.at(np.log(found.values[2:])), evaluations=search.count)


def refine(fitted: Fitted, levels: Sequence[Level], noise: Repeatability,
           slopes: Floats | None = None) -> Fitted:
    """The same least squares by Gauss-Newton steps of all values at once, from what is known.

    With slopes (2 n, 4), which serve for all steps, it takes less and ends near the solution.
    """
    deviation = _deviations(levels, noise)
    measured = np.array([one.frequency for one in levels] + [one.damping for one in levels])
    best, change = fitted, np.zeros(4)

    def residual(of: Floats) -> Floats:
        return (predict(fitted.at(of), levels) - measured) / deviation

    left = residual(change)
    for _ in range(STEPS):
        weighted = (best.slopes(levels) if slopes is None else slopes) / deviation[:, None]
        step = -np.linalg.lstsq(weighted, left, rcond=None)[0]
        # Half of a step that is too long, down to where it is none.
        for _ in range(HALVINGS):
            new = residual(change + step)
            if new @ new <= left @ left:
                break
            step *= 0.5
        else:
            break
        change, left = change + step, new
        values = fitted.values * np.exp(change)
        best = replace(fitted, beam=_beam(fitted.start, values), values=values,
                       squares=float(left @ left))
        if np.abs(step).max() < ENOUGH:
            break
    weighted = (best.slopes(levels) if slopes is None else slopes) / deviation[:, None]
    return replace(best, covariance=np.linalg.inv(weighted.T @ weighted),
                   squares=float(left @ left))


def calibrate_friction(beam: ReducedBeam, levels: Sequence[Level], noise: Repeatability) -> Fitted:
    """Friction alone: limit and exponent from the damping, the stiffness from the mean frequency.

    The exponent is looked for around `fw.calibrate` of the limit.
    """
    stiffness = 1.0
    squares: dict[float, Calibration] = {}

    def inner(exponent: float) -> float:
        case_beam = beam.changed(stiffness=stiffness, exponent=exponent, cubic=0.0)
        squares[exponent] = fw.calibrate(
            mode_case(case_beam, [one.displacement for one in levels]),
            ModeData([one.displacement for one in levels], None,
                     [one.damping for one in levels], damping="forced", mass=MASS,
                     damping_deviation=[noise.damping * one.damping for one in levels]),
            over="contact%normal_load", bounds=(0.1, 10.0), factors=True)
        return squares[exponent].chi_square

    search = import_module("scipy.optimize").minimize_scalar
    exponent, limit = EXPONENT, beam.full.parameters.limit
    for _ in range(2):
        exponent = float(search(inner, bounds=EXPONENTS, method="bounded",
                                options={"xatol": 1e-3}).x)
        inner(exponent)
        limit = beam.full.parameters.limit * float(squares[exponent].values[0])
        now = predict(beam.changed(stiffness=stiffness, limit=limit, exponent=exponent, cubic=0.0),
                      levels)[:len(levels)]
        stiffness *= float(np.mean([one.frequency for one in levels] / now))**2
    values = np.array([limit, 0.0, exponent, stiffness])
    return Fitted(_beam(beam, values), beam, values, [0, 2, 3], np.full((3, 3), np.nan),
                  squares[exponent], squares[exponent].chi_square, len(levels) - 2, len(squares))


class Search:
    """The calibration of limit and cubic spring, as a function of exponent and stiffness."""

    def __init__(self, beam: ReducedBeam, levels: Sequence[Level], noise: Repeatability,
                 guess: Floats) -> None:
        self._beam, self._levels, self._noise = beam, levels, noise
        self.guess, self.count = guess, 0
        self.last: Any = None

    def at(self, logarithms: Floats) -> Calibration:
        """The calibration there; the next one starts from what it finds."""
        limit, cubic = self.guess[:2]
        exponent, stiffness = np.exp(logarithms)
        beam = self._beam.changed(limit=limit, cubic=cubic, exponent=exponent,
                                  stiffness=stiffness)
        sizes = [one.displacement for one in self._levels]
        n = len(sizes)
        deviation = _deviations(self._levels, self._noise)
        data = ModeData(sizes, [one.frequency for one in self._levels],
                        [one.damping for one in self._levels], damping="forced", mass=MASS,
                        frequency_deviation=deviation[:n], damping_deviation=deviation[n:])
        found = fw.calibrate(mode_case(beam, sizes), data,
                             over=["contact%normal_load", "spring%coefficient"],
                             bounds=[(0.1, 10.0), (0.1, 10.0)], factors=True)
        self.guess = np.array([limit * found.values[0], cubic * found.values[1], exponent,
                               stiffness])
        self.count, self.last = self.count + 1, found
        return found

    def residual(self, logarithms: Floats) -> Floats:
        """What the best limit and spring leave."""
        return self.at(logarithms).residual

    def jacobian(self, logarithms: Floats) -> Floats:
        """Of what is left, by slopes of all four: those by exponent and stiffness, without the
        part that limit and cubic spring take (Kaufman's form of variable projection)."""
        values = np.concatenate((self.guess[:2], np.exp(logarithms)))
        weighted = (_slopes(self._beam, values, [0, 1, 2, 3], self._levels)
                    / _deviations(self._levels, self._noise)[:, None])
        basis = np.linalg.qr(weighted[:, :2])[0]
        return weighted[:, 2:] - basis @ (basis.T @ weighted[:, 2:])


def _slopes(start: ReducedBeam, values: Floats, free: Sequence[int], levels: Sequence[Level]
            ) -> Floats:
    """Derivatives of `predict` by logarithms of values, by central differences (2 n, n_free)."""
    columns = []
    for k in free:
        ends = []
        for sign in (1.0, -1.0):
            moved = values.copy()
            moved[k] *= np.exp(sign * STEP)
            ends.append(predict(_beam(start, moved), levels))
        columns.append((ends[0] - ends[1]) / (2.0 * STEP))
    return np.stack(columns, axis=1)


def _beam(start: ReducedBeam, values: Floats) -> ReducedBeam:
    limit, cubic, exponent, stiffness = values.tolist()
    return start.changed(limit=limit, cubic=cubic, exponent=exponent, stiffness=stiffness)


def _deviations(levels: Sequence[Level], noise: Repeatability) -> Floats:
    return np.concatenate((np.full(len(levels), noise.frequency),
                           noise.damping * np.array([one.damping for one in levels])))
