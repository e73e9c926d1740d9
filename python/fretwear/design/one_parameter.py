"""The minimum of a function of one number by its slope: a bracket, and cubics in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

__all__ = ["descend"]

#: Steps that leave most of the slope, until the minimum is taken for a corner.
_PATIENCE = 3
#: Nearer points are joined by their slopes alone: their heights differ by round-off.
_NEAR = 1e-3


@dataclass(frozen=True)
class _Place:
    x: float
    height: float
    slope: float


def descend(at: Callable[[float], tuple[float, float]], start: float, low: float, high: float,
            first_step: float, width: float) -> None:
    """Go down from `start` until `at` raises, which it does where it is satisfied.

    Returns where the minimum is a corner: known within `width`, with slopes that do not vanish.

    Parameters
    ----------
    at : callable
        Height and slope at a place.
    start, low, high : float
        Where to begin, and the bounds.
    first_step : float
        Doubled until the slope turns.
    width : float
        Of the bracket about a corner.
    """
    a = _Place(start, *at(start))
    limit, step = (high, first_step) if a.slope < 0.0 else (low, -first_step)
    while True:
        x = a.x + step
        b = _Place(limit, *at(limit)) if (x - limit) * step >= 0.0 else _Place(x, *at(x))
        if b.slope * step >= 0.0 or b.height >= a.height:
            break
        a, step = b, 2.0 * step
    before, last, slow = a, b, 0
    while abs(b.x - a.x) > width:
        span = b.x - a.x
        x = _lowest(before, last)
        if slow >= _PATIENCE:
            x = _beyond(a, b, width)
        elif not 0.0 < (x - a.x) / span < 1.0:
            # Outside of what is known to hold the minimum.
            x = _lowest(a, b)
            share = (x - a.x) / span if np.isfinite(x) else 0.5
            x = a.x + span * float(np.clip(share, 0.1, 0.9))
        before, last = last, _Place(x, *at(x))
        if last.slope * span < 0.0 and last.height <= a.height:
            a = last
        else:
            b = last
        slow = slow + 1 if abs(last.slope) > 0.5 * abs(before.slope) else 0


def _beyond(a: _Place, b: _Place, width: float) -> float:
    """A place beyond a corner, which is near where the tangents of both ends of a bracket meet:
    twice as far from the nearer end, so that both ends close in.
    """
    span = b.x - a.x
    share = (_meeting(a, b) - a.x) / span
    if not 0.0 <= share <= 1.0:
        return a.x + 0.5 * span
    least = min(0.45 * width / abs(span), 0.5)
    if share < 0.5:
        return a.x + span * float(np.clip(2.0 * share, least, 0.5))
    return a.x + span * float(np.clip(2.0 * share - 1.0, 0.5, 1.0 - least))


def _meeting(one: _Place, other: _Place) -> float:
    """Where the tangents of two places meet; NaN where they do not."""
    change = one.slope - other.slope
    if change == 0.0:
        return np.nan
    return (other.height - one.height + one.slope * one.x - other.slope * other.x) / change


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
