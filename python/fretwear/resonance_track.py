"""A resonance as a function of a parameter (`analysis = 'resonance'`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .result_file import ResultFile

__all__ = ["ResonanceTrack", "read_resonance"]

Floats = NDArray[np.float64]
#: Roots of a derivative with a smaller imaginary part than this are places [steps].
_REAL = 1e-6


@dataclass(frozen=True)
class ResonanceTrack:
    """Amplitude and frequency of a resonance, in the order in which it was followed.

    Attributes
    ----------
    name : str
        Of the parameter, such as 'contact%normal_load'.
    by_factor : bool
        Whether `parameter` holds factors of the values of the case.
    condition, quantity : str
        'amplitude' or 'phase'; 'first_harmonic' or 'largest'.
    parameter, amplitude, omega : (n_points,)
        The parameter, the quantity of the first observed, and the angular frequency [rad/s].
    first_harmonic, phase : (n_points,)
        Amplitude of the first harmonic, and how far it is behind the load [rad].
    curvature : (n_points,)
        Second derivative of the quantity by the angular frequency.
    converged : (n_points,)
        Whether the point is a resonance.
    """

    name: str
    by_factor: bool
    condition: str
    quantity: str
    parameter: Floats
    amplitude: Floats
    omega: Floats
    first_harmonic: Floats
    phase: Floats
    curvature: Floats
    converged: NDArray[np.bool_]

    @property
    def frequency(self) -> Floats:
        """Frequency (n_points) [Hz]."""
        return self.omega / (2.0 * np.pi)

    def optimum(self) -> tuple[float, float] | None:
        """Parameter and amplitude where the resonance is smallest between the ends, by the
        polynomial through the smallest point and up to four around it; None where an end is
        smaller, or where points beside it have failed."""
        parameter, amplitude = self.parameter[self.converged], self.amplitude[self.converged]
        if amplitude.size < 3:
            return None
        k = int(np.argmin(amplitude))
        rows = np.flatnonzero(self.converged)
        if k in (0, amplitude.size - 1) or rows[k + 1] - rows[k - 1] != 2:
            return None
        near = slice(max(k - 2, 0), k + 3)
        # About the middle, in steps: far from 0 the coefficients would lose their digits.
        step = 0.5 * (parameter[k + 1] - parameter[k - 1])
        place = (parameter[near] - parameter[k]) / step
        curve = np.polynomial.Polynomial.fit(place, amplitude[near], place.size - 1)
        low, high = np.sort((parameter[[k - 1, k + 1]] - parameter[k]) / step)
        roots = curve.deriv().roots()
        inside = roots.real[(abs(roots.imag) < _REAL) & (roots.real > low) & (roots.real < high)]
        if inside.size == 0:
            return float(parameter[k]), float(amplitude[k])
        best = inside[np.argmin(curve(inside))]
        return float(parameter[k] + best * step), float(curve(best))


def read_resonance(result: ResultFile) -> ResonanceTrack:
    """The track of a result; raises AbsentError where it holds none."""
    amplitude = result["resonance/value"]
    with result.open() as file:
        facts, about = dict(file["parameter"].attrs), dict(file["resonance"].attrs)
    if len(amplitude) != len(result["omega"]):
        raise InputError(f"{result.name}: /resonance and /omega differ in length")
    return ResonanceTrack(
        _text(facts["name"]), _text(facts["as"]) == "factor", _text(about["condition"]),
        _text(about["quantity"]), result["parameter"], amplitude, result["omega"],
        result["resonance/first_harmonic"], result["resonance/phase"],
        result["resonance/curvature"], result["converged"].astype(bool))


def _text(value: object) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)
