"""The minimum of a function of one number by its slope: a bracket, and cubics in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

__all__ = ["descend"]

#: Nearer points are joined by their slopes alone: their heights differ by round-off.
_NEAR = 1e-3
#: Part of a bracket that a new point keeps from its ends.
_MARGIN = 1e-3


@dataclass(frozen=True)
class _Place:
    x: float
    height: float
    slope: float


def descend(at: Callable[[float], tuple[float, float]], start: float, low: float, high: float,
            first_step: float) -> None:
    """Go down from `start` until `at` raises, which it does where it is satisfied.

    Parameters
    ----------
    at : callable
        Height and slope at a place.
    start, low, high : float
        Where to begin, and the bounds.
    first_step : float
        Doubled until the slope turns.
    """
    a = _Place(start, *at(start))
    limit, step = (high, first_step) if a.slope < 0.0 else (low, -first_step)
    while True:
        x = a.x + step
        b = _Place(limit, *at(limit)) if (x - limit) * step >= 0.0 else _Place(x, *at(x))
        if b.slope * step >= 0.0 or b.height >= a.height:
            break
        a, step = b, 2.0 * step
    before, last = a, b
    while True:
        width = b.x - a.x
        if abs(width) < 1e-14 * max(abs(a.x), abs(b.x), 1.0):
            return
        x = _lowest(before, last)
        if not _MARGIN < (x - a.x) / width < 1.0 - _MARGIN:
            # Outside of what is known to hold the minimum, or at its very end.
            x = _lowest(a, b)
            x = a.x + width * float(np.clip((x - a.x) / width if np.isfinite(x) else 0.5, 0.1, 0.9))
        before, last = last, _Place(x, *at(x))
        if last.slope * width < 0.0 and last.height <= a.height:
            a = last
        else:
            b = last


def _lowest(one: _Place, other: _Place) -> float:
    """Minimum of the cubic through two places with their slopes; NaN where it has none."""
    h = other.x - one.x
    if h == 0.0:
        return np.nan
    if abs(h) < _NEAR:
        change = (other.slope - one.slope) / h
        return other.x - other.slope / change if change > 0.0 else np.nan
    theta = 3.0 * (one.height - other.height) / h + one.slope + other.slope
    inside = theta**2 - one.slope * other.slope
    if inside < 0.0:
        return np.nan
    root = np.copysign(np.sqrt(inside), h)
    below = other.slope - one.slope + 2.0 * root
    return other.x - h * (other.slope + root - theta) / below if below != 0.0 else np.nan
