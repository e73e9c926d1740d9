"""Places of a response where it turns or where its stability changes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import h5py
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .result import Result

__all__ = ["Bifurcation"]


@dataclass(frozen=True)
class Bifurcation:
    """One row of the group `/bifurcation` of a result.

    Attributes
    ----------
    kind : str
        "fold", "period doubling", "Neimark-Sacker", "symmetry breaking", "branch point",
        "nonsmooth" or "undecided".
    omega : float
        Where it is [rad/s].
    error : float
        How far that may be off by the error of the multiplier [rad/s]; NaN where it is not known.
    amplitude : (n_observed,)
        Largest magnitude over the period.
    coefficients : (2H+1, n_observed)
        Fourier coefficients 0, c1, s1, ... of the observed quantities.
    multiplier : complex
        The multiplier on the unit circle; NaN where no multipliers were asked for.
    found_by : str
        "turn" of the branch, "multiplier" that was brought to the circle, or "bracket": it lies
        between two solutions, and no nearer ones were found.
    parameter : float or None
        Where it is in the parameter that the sweep goes over in place of the frequency; `error` is
        of it then.
    """

    kind: str
    omega: float
    error: float
    amplitude: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    multiplier: complex
    found_by: str
    parameter: float | None = None

    @property
    def frequency(self) -> float:
        """Where it is [Hz]."""
        return self.omega / (2.0 * np.pi)

    def __str__(self) -> str:
        if self.parameter is not None:
            return f"{self.kind} at {self.parameter:.6g}"
        return f"{self.kind} at {self.frequency:.6g} Hz"


def read_bifurcations(result: Result) -> list[Bifurcation]:
    """All of a result, in the order in which they were found; none of a result without them."""
    if "bifurcation/omega" not in result:
        return []
    with result.open() as file:
        kinds, ways = (_words(file["bifurcation/" + name]) for name in ("kind", "found_by"))
    values = result["bifurcation/multiplier"]
    errors: Iterable[float] = result["bifurcation/error"]
    places: Iterable[float | None] = [None] * len(kinds)
    if "bifurcation/parameter" in result:
        errors, places = result["bifurcation/parameter_error"], result["bifurcation/parameter"]
    return [Bifurcation(kind, float(omega), float(error), amplitude, coefficients,
                        complex(*value), way, None if place is None else float(place))
            for kind, omega, error, amplitude, coefficients, value, way, place in zip(
                kinds, result["bifurcation/omega"], errors, result["bifurcation/amplitude"],
                result["bifurcation/coefficients"], values, ways, places)]


def _words(places: h5py.Dataset) -> list[str]:
    """Places in the words of the attribute `names`."""
    names = [name.decode() if isinstance(name, bytes) else str(name)
             for name in places.attrs["names"]]
    return [names[place] for place in places[:]]
