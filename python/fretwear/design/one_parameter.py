"""The minimum of a function of one number by its slope: a bracket, and cubics in it."""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

__all__ = ["Line", "Place", "descend", "lowest_of_cubic", "meeting"]

#: Steps that leave most of the slope, until the minimum is taken for a corner.
_PATIENCE = 3
#: Nearer points are joined by their slopes alone: their heights differ by round-off.
_NEAR = 1e-3
#: Nearer places tell the curvature of a minimum.
_TELLING = 1e-2
#: A larger slope is none of a minimum, however near another place has the other sign: a corner.
_LARGEST_ZERO = 1e-5
#: The first step, over the range; it is doubled, up to the longest.
_FIRST_STEP, _LONGEST_STEP = 0.5, 1.0
_FIRST_SHARE = 0.25


@dataclass(frozen=True, order=True)
class Place:
    """Height and slope of a function of one number at `x`."""

    x: float
    height: float
    slope: float


class Line:
    """What is known of a function of one number.

    Parameters
    ----------
    at : callable
        Height and slope at a place.
    low, high : float
        Bounds.
    tolerance : float
        Within which a minimum is to be known.
    """

    def __init__(self, at: Callable[[float], tuple[float, float]], low: float, high: float,
                 tolerance: float) -> None:
        self._at, self.low, self.high, self.tolerance = at, low, high, tolerance
        #: In their order along the line.
        self.places: list[Place] = []
        #: Where nothing could be had.
        self.holes: list[float] = []

    def look(self, x: float) -> Place:
        """The function at a place; asked once."""
        for known in self.places:
            if known.x == x:
                return known
        place = Place(x, *self._at(x))
        insort(self.places, place)
        return place

    @property
    def best(self) -> Place:
        """The lowest place, inside of the bounds."""
        return min(self.places, key=lambda one: one.height)

    def beside(self, place: Place, side: int) -> Place | None:
        """The next known place below (-1) or above (1)."""
        k = self.places.index(place) + side
        return self.places[k] if 0 <= k < len(self.places) else None

    @property
    def least_slope(self) -> float:
        """A slope below which nothing is told: it is `tolerance` off where the curvature of the
        logarithms is 0.01.
        """
        return 1e-2 * self.tolerance

    def zero(self, place: Place) -> float:
        """The slope that counts as zero there: a tenth of what `tolerance` changes it by."""
        curvature = 0.0
        for side in (-1, 1):
            other = self.beside(place, side)
            if other is not None and abs(other.x - place.x) < _TELLING:
                curvature = max(curvature, (other.slope - place.slope) / (other.x - place.x))
        return max(self.least_slope, min(0.1 * self.tolerance * curvature, _LARGEST_ZERO))

    def is_flat(self, place: Place) -> bool:
        """Whether the function does not change at a place, as on a plateau."""
        return abs(place.slope) <= self.least_slope

    def is_held(self, place: Place) -> bool:
        """Whether down is out of the bounds."""
        return (place.x <= self.low and place.slope > 0.0) or (
            place.x >= self.high and place.slope < 0.0)

    def is_there(self, place: Place) -> bool:
        """Whether the slope is zero, or leads out of the bounds."""
        return self.is_held(place) or abs(place.slope) <= self.zero(place)

    def across(self, place: Place) -> Place | None:
        """The next place downhill, where it is within the tolerance: the other side of a corner,
        or of a jump.
        """
        other = self.beside(place, -1 if place.slope > 0.0 else 1)
        near = other is not None and abs(other.x - place.x) <= 1.01 * self.tolerance
        return other if near else None


def descend(line: Line, start: Place) -> Place:
    """Go down from a place of a line until the slope is zero, or until a place where it turns is
    known within the tolerance.
    """
    a, b = _bracket(line, start)
    if b is None:
        return a
    before, last, slow = a, b, 0
    while abs(b.x - a.x) > line.tolerance:
        span = b.x - a.x
        x = lowest_of_cubic(before, last)
        if slow >= _PATIENCE:
            x = _beyond(a, b, line.tolerance)
        elif not 0.0 < (x - a.x) / span < 1.0:
            # Outside of what is known to hold the minimum.
            x = lowest_of_cubic(a, b)
            share = (x - a.x) / span if np.isfinite(x) else 0.5
            x = a.x + span * float(np.clip(share, 0.1, 0.9))
        before, last = last, line.look(x)
        if last.slope * span < 0.0 and last.height <= a.height:
            a = last
        else:
            b = last
        if line.is_there(last) and last.height <= min(a.height, b.height):
            return last
        slow = slow + 1 if abs(last.slope) > 0.5 * abs(before.slope) else 0
    return min(a, b, key=lambda one: one.height)


def _bracket(line: Line, a: Place) -> tuple[Place, Place | None]:
    """A place and another, between which a minimum is; the place alone where it is one."""
    step = min(_FIRST_STEP, _FIRST_SHARE * (line.high - line.low))
    while not line.is_there(a):
        side = 1 if a.slope < 0.0 else -1
        limit = line.high if side > 0 else line.low
        x = a.x + side * step
        known = line.beside(a, side)
        if known is not None and abs(known.x - a.x) <= step:
            b = known
        else:
            b = line.look(limit if (x - limit) * side >= 0.0 else x)
        if b.slope * side > 0.0 or b.height >= a.height:
            return a, b
        a, step = b, min(2.0 * step, _LONGEST_STEP)
    return a, None


def _beyond(a: Place, b: Place, width: float) -> float:
    """A place beyond a corner, which is near where the tangents of both ends of a bracket meet:
    twice as far from the nearer end, so that both ends close in.
    """
    span = b.x - a.x
    share = (meeting(a, b) - a.x) / span
    if not 0.0 <= share <= 1.0:
        return a.x + 0.5 * span
    least = min(0.45 * width / abs(span), 0.5)
    if share < 0.5:
        return a.x + span * float(np.clip(2.0 * share, least, 0.5))
    return a.x + span * float(np.clip(2.0 * share - 1.0, 0.5, 1.0 - least))


def meeting(one: Place, other: Place) -> float:
    """Where the tangents of two places meet; NaN where they do not."""
    change = one.slope - other.slope
    if change == 0.0:
        return np.nan
    return (other.height - one.height + one.slope * one.x - other.slope * other.x) / change


def lowest_of_cubic(one: Place, other: Place) -> float:
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
