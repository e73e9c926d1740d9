"""One point or wear step of a result: which, what it says of the pairs, a period of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .errors import InputError
from .result import STATES, Result
from .shown import dissipation

__all__ = ["choose_point", "pair_areas", "pair_fields", "status_words", "synthesis"]

Floats = NDArray[np.float64]


def choose_point(result: Result, number: int | None) -> int:
    """Index from 0 of a point or wear step counted from 1, or from the end where negative.

    Without a number: the largest amplitude (where nothing converged, the smallest residual), or
    the last wear step.
    """
    n = len(result.depth) if "wear/depth" in result else result.n_points
    if n == 0:
        raise InputError(f"{result.name}: holds no points")
    if number is None:
        if "wear/depth" in result:
            return n - 1
        return result.peak() if result.converged.any() else int(np.nanargmin(result.residual))
    if number == 0 or abs(number) > n:
        raise InputError(f"{result.name}: point {number}: there are {n}, counted from 1")
    return number - 1 if number > 0 else n + number


def status_words(result: Result, point: int) -> str:
    """What the title of a picture of one point has to add: nothing where it has converged."""
    known = "converged" in result and point < len(result.converged)
    return ", not converged" if known and not result.converged[point] else ""


def synthesis(n_coefficients: int, tau: Floats) -> Floats:
    """Values of 1, cos tau, sin tau, cos 2 tau, ... (n_coefficients, n_time)."""
    rows = [np.ones_like(tau)]
    for h in range(1, (n_coefficients - 1) // 2 + 1):
        rows += [np.cos(h * tau), np.sin(h * tau)]
    return np.array(rows)


def pair_areas(result: Result) -> Floats | None:
    """Areas of the pairs (n_pairs), None where the file does not hold them."""
    if "contact/area" not in result:
        return None
    return result["contact/area"]


def pair_fields(result: Result, point: int) -> dict[str, tuple[Floats, str]]:
    """What a result says of every pair at one point.

    Returns
    -------
    dict
        Values (n_pairs) and their units by name: stick, slip, open (shares of the period),
        pressure (mean over the period), dissipation (per area and cycle; zero where there is only
        round-off), wear_depth, wear_rate.
    """
    found: dict[str, tuple[Floats, str]] = {}
    area = pair_areas(result)
    if "contact/fraction" in result and point < len(result.fraction):
        for k, state in enumerate(STATES):
            found[state] = result.fraction[point, :, k], "1"
    if "contact/force" in result and point < len(result.force) and area is not None:
        found["pressure"] = (-result.force[point, 0, :, 2] / area,
                             _ratio(result, "contact/force", "contact/area"))
        found["dissipation"] = (dissipation(result)[point] / area,
                                _ratio(result, "contact/dissipation", "contact/area"))
    if "wear/depth" in result:
        found["wear_depth"] = result.depth[point], result.units("wear/depth")
        found["wear_rate"] = result.rate[point], result.units("wear/rate")
    return found


def _ratio(result: Result, over: str, under: str) -> str:
    upper, lower = result.units(over), result.units(under)
    return f"{upper}/{lower}" if upper and lower else ""
