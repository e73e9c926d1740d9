"""Derivatives of a response by numbers of its case, as a run with `&sensitivity` has found them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import AbsentError, InputError
from .result_file import ResultFile

__all__ = ["Sensitivities", "read_sensitivities"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Sensitivities(Mapping[str, Mapping[str, Floats]]):
    """Derivatives by quantity and parameter: `sensitivities["largest"]["contact%mu"]`.

    Attributes
    ----------
    derivative : dict
        Arrays (n_points[, n_observed][, n_pairs or n_springs]) by quantity, then by parameter.
    value : dict
        The quantities (n_points[, n_observed]) and the parameters (n_points[, n_pairs or
        n_springs]) themselves.
    deviation : dict
        Standard deviation of each quantity (n_points[, n_observed]); empty where none was asked
        for.
    """

    derivative: dict[str, dict[str, Floats]]
    value: dict[str, Floats]
    deviation: dict[str, Floats]

    def __getitem__(self, quantity: str) -> dict[str, Floats]:
        return self.derivative[quantity]

    def __iter__(self) -> Iterator[str]:
        return iter(self.derivative)

    def __len__(self) -> int:
        return len(self.derivative)

    def relative(self, quantity: str, parameter: str, point: int, observed: int = 0) -> Floats:
        """p/Q dQ/dp of every pair or spring, or of the one parameter.

        Per cent of the quantity for one per cent of the parameter; the sum is that of all pairs.

        Parameters
        ----------
        quantity, parameter : str
            Such as "first_harmonic" and "contact%mu".
        point : int
            Point from 0.
        observed : int
            Observed quantity from 0, where the quantity is of those.
        """
        if quantity not in self or parameter not in self[quantity]:
            raise InputError(f"there is no derivative of {quantity} by {parameter}")
        slope, size = self[quantity][parameter][point], self.value[quantity][point]
        if size.ndim == 1:
            slope, size = slope[observed], size[observed]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.atleast_1d(self.value[parameter][point] * slope / size)


def read_sensitivities(result: ResultFile) -> Sensitivities:
    """All derivatives of a result; raises AbsentError where it holds none."""
    parts: dict[str, dict[str, Floats]] = {}
    with result.open() as file:
        if "sensitivity" not in file:
            raise AbsentError(f"{result.name}: holds no dataset /sensitivity: run with "
                              "sensitivity%parameters")
        for group, members in file["sensitivity"].items():
            parts[group] = {_key(name): data[()] for name, data in members.items()}
    value, deviation = parts.pop("value", {}), parts.pop("deviation", {})
    return Sensitivities(parts, value, deviation)


def _key(name: str) -> str:
    """contact%mu of contact_mu; quantities keep their names."""
    group, _, key = name.partition("_")
    return f"{group}%{key}" if group in ("load", "contact", "spring", "model") else name
