"""Quantities of a results table: one number or word from a result file.

Written `name` or `name[observed]`; without the bracket the first observed quantity counts.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Optional, Union

import numpy as np

from .._words import did_you_mean
from ..errors import AbsentError, InputError
from ..result import Result

__all__ = ["QUANTITIES", "Value", "check_quantity", "evaluate"]

#: One entry of a table; NaN or '' where a result has no such quantity.
Value = Union[int, float, str]
_Quantity = Callable[[Result, Optional[str]], Value]

_FORM = re.compile(r"(\w+)(?:\[([^\]]+)\])?$")


def _peak_omega(result: Result, observed: str | None) -> float:
    return result.maximum(observed)[0]


def _slipping(result: Result, observed: str | None) -> float:
    """Mean over the pairs of the share of the period in slip."""
    return float(result.fraction[result.peak(observed), :, 1].mean())


def _opening(result: Result, observed: str | None) -> float:
    return float(result.fraction[result.peak(observed), :, 2].mean())


def _steady_state(result: Result, _: str | None) -> str:
    try:
        return result.steady_state
    except AbsentError:  # the run has not come to its end
        return ""


#: Quantity: function, whether it is of an observed quantity, dataset that it needs, meaning.
QUANTITIES: dict[str, tuple[_Quantity, bool, str, str]] = {
    "max_amplitude": (lambda r, o: r.maximum(o)[1], True, "omega",
                      "largest amplitude, of the maxima between the points too [L]"),
    "omega_at_peak": (_peak_omega, True, "omega", "where it is [rad/s]"),
    "frequency_at_peak": (lambda r, o: _peak_omega(r, o) / (2.0 * np.pi), True, "omega",
                          "where it is [Hz]"),
    "dissipation_at_peak": (lambda r, o: float(r.dissipation[r.peak(o)].sum()), True,
                            "contact/dissipation",
                            "friction energy of all pairs per cycle, there [F L]"),
    "slip_at_peak": (_slipping, True, "contact/fraction",
                     "share of the period in slip, mean of the pairs, there"),
    "open_at_peak": (_opening, True, "contact/fraction",
                     "share of the period open, mean of the pairs, there"),
    "last_amplitude": (lambda r, o: float(r.amplitude_of(o)[-1]), True, "omega",
                       "amplitude of the last point or wear step [L]"),
    "max_dissipation": (lambda r, _: float(r.dissipation[r.converged].sum(axis=1).max()), False,
                        "contact/dissipation",
                        "largest friction energy of all pairs per cycle [F L]"),
    "n_points": (lambda r, _: r.n_points, False, "omega", "points"),
    "n_converged": (lambda r, _: int(r.converged.sum()), False, "converged", "of them converged"),
    "iterations": (lambda r, _: int(r.iterations.sum()), False, "iterations",
                   "iterations of the solver, all points"),
    "max_wear_depth": (lambda r, _: float(r.depth[-1].max()), False, "wear/depth",
                       "largest wear depth at the end [L]"),
    "mean_wear_depth": (lambda r, _: float(r.depth[-1].mean()), False, "wear/depth",
                        "mean wear depth at the end [L]"),
    "wear_volume": (lambda r, _: float(r["wear/volume"][-1].sum()), False, "wear/volume",
                    "volume worn off all pairs at the end [L^3]"),
    "max_wear_rate": (lambda r, _: float(r.rate[-1].max()), False, "wear/rate",
                      "largest wear rate at the end [L per cycle]"),
    "cycles": (lambda r, _: float(r.cycles[-1]), False, "wear/cycles", "cycles at the end"),
    "steady_state": (_steady_state, False, "wear/depth",
                     "'reached', 'not reached' or 'none: gross slip'"),
    "status": (lambda r, _: r.status, False, "omega", "status in the result file"),
    "elapsed": (lambda r, _: r.elapsed, False, "omega", "time of the run [s]"),
}
_TEXTS = ("steady_state", "status")


def check_quantity(text: object) -> str | None:
    """What is wrong with the text of a quantity; None where nothing is."""
    match = _FORM.match(text) if isinstance(text, str) else None
    if not match or match[1] not in QUANTITIES:
        return (f"'{text}' is not known; expected some of {', '.join(QUANTITIES)}"
                + did_you_mean(str(text).partition("[")[0], words=QUANTITIES))
    if match[2] and not QUANTITIES[match[1]][1]:
        return f"'{match[1]}' is not of an observed quantity; write it without [{match[2]}]"
    return None


def evaluate(text: str, result: Result | None) -> Value:
    """One quantity of a result; NaN or '' where the result does not hold it.

    Raises
    ------
    InputError
        The quantity is not known, or what it is of is not observed.
    """
    problem = check_quantity(text)
    match = _FORM.match(text)
    if problem or not match:
        raise InputError(problem or text)
    function, _, dataset, _ = QUANTITIES[match[1]]
    absent: Value = "" if match[1] in _TEXTS else float("nan")
    if result is None or dataset not in result or not len(result[dataset]):
        return absent
    if match[2]:
        result.index(match[2])
    if not dataset.startswith("wear/") and "converged" in result and not result.converged.any() \
            and match[1] not in ("n_points", "n_converged", "iterations", "status", "elapsed"):
        return absent
    return function(result, match[2])
