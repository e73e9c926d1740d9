"""Whether a minimum of one number is the lowest: gaps between the places that were looked at.

A gap is settled where its ends, their slopes and the slope of the line through both go with one
convex or concave piece that stays above the lowest place, where it is too high to come down there,
or where it is a plateau. All others are looked into, until none is left.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .one_parameter import Line, Place, lowest_of_cubic, meeting

__all__ = ["Gap", "doubtful", "is_plateau", "next_look", "spans", "unit_of"]

#: About the lowest place, to a factor of 1.5 of a positive parameter, gaps are this wide at most;
#: elsewhere the other.
_RADIUS, _NARROW, _WIDE = float(np.log(1.5)), 0.5 * float(np.log(1.52)), float(np.log(2.0))
#: The same of a parameter that may be zero, over its range.
_LINEAR = 0.25
#: How much lower than the lowest place counts.
_LOWER = 1e-6
#: How much steeper than its ends a gap may be.
_STEEPER = 2.0
#: Round-off of slopes and heights on a plateau.
_ROUND = 1e-9


@dataclass(frozen=True)
class Gap:
    """Between two places, or a place and a bound that was not looked at."""

    low: float
    high: float
    below: Place | None
    above: Place | None
    limit: float
    is_near: bool

    @property
    def width(self) -> float:
        """Its length."""
        return self.high - self.low


def doubtful(line: Line, unit: float) -> list[Gap]:
    """Gaps that may hold a lower place, those about the lowest one first, the widest first."""
    best = line.best
    found = [gap for gap in _gaps(line, best, unit) if not _is_settled(gap, line, best)]
    return sorted(found, key=lambda gap: (not gap.is_near, -gap.width))


def next_look(line: Line, gaps: list[Gap]) -> float | None:
    """Where to look next; None where nothing is left but gaps in which runs failed."""
    best = line.best
    for gap in gaps:
        if not any(gap.low <= hole <= gap.high for hole in line.holes):
            return _inside(gap, best)
    return None


def spans(gaps: list[Gap]) -> list[tuple[float, float]]:
    """Ends of gaps, those that touch joined."""
    found: list[tuple[float, float]] = []
    for gap in sorted(gaps, key=lambda one: one.low):
        if found and gap.low <= found[-1][1]:
            found[-1] = (found[-1][0], gap.high)
        else:
            found.append((gap.low, gap.high))
    return found


def is_plateau(line: Line, place: Place) -> tuple[float, float] | None:
    """First and last of the places about one that are as high and flat; None where it is alone."""
    ends = [place, place]
    for k, side in enumerate((-1, 1)):
        other = line.beside(place, side)
        while other is not None and _is_level(line, place, other):
            ends[k], other = other, line.beside(other, side)
    return (ends[0].x, ends[1].x) if ends[0] is not ends[1] else None


def _is_level(line: Line, a: Place, b: Place) -> bool:
    return line.is_flat(a) and line.is_flat(b) and abs(a.height - b.height) <= _ROUND


def unit_of(*, logarithmic: bool) -> float:
    """What widths are multiples of."""
    return 1.0 if logarithmic else _LINEAR


def _gaps(line: Line, best: Place, unit: float) -> Iterator[Gap]:
    places = [one for one in line.places if line.low <= one.x <= line.high]
    ends: list[Place | None] = [*places]
    if places[0].x > line.low:
        ends.insert(0, None)
    if places[-1].x < line.high:
        ends.append(None)
    for below, above in zip(ends, ends[1:]):
        low = line.low if below is None else below.x
        high = line.high if above is None else above.x
        radius = unit * _RADIUS
        is_near = high > best.x - radius and low < best.x + radius
        yield Gap(low, high, below, above, unit * (_NARROW if is_near else _WIDE), is_near)


def _is_settled(gap: Gap, line: Line, best: Place) -> bool:
    """Whether nothing lower is to be expected in a gap."""
    a, b = gap.below, gap.above
    if gap.width <= line.tolerance:
        return True
    if a is None or b is None:
        return False
    floor = best.height - _LOWER
    if _is_level(line, a, b):
        return True
    mean = (b.height - a.height) / gap.width
    steepest = max(abs(a.slope), abs(b.slope), abs(mean))
    if min(a.height, b.height) - floor > _STEEPER * steepest * gap.width:
        return True
    if gap.width > gap.limit * (1.0 + _ROUND):
        return False
    if a.slope - _ROUND <= mean <= b.slope + _ROUND:
        return _height_of_tangents(a, b) >= floor
    if a.slope >= mean >= b.slope:
        return True
    x = lowest_of_cubic(a, b)
    return gap.width <= 0.5 * gap.limit and not (
        a.x < x < b.x and _cubic(a, b, x) < floor)


def _height_of_tangents(a: Place, b: Place) -> float:
    """What a convex function is above of."""
    x = meeting(a, b)
    if not a.x <= x <= b.x:
        return min(a.height, b.height)
    return a.height + a.slope * (x - a.x)


def _cubic(a: Place, b: Place, x: float) -> float:
    """The cubic through two places with their slopes."""
    h = b.x - a.x
    t = (x - a.x) / h
    return ((1.0 + 2.0 * t) * (1.0 - t)**2 * a.height + t**2 * (3.0 - 2.0 * t) * b.height
            + h * t * (1.0 - t) * ((1.0 - t) * a.slope - t * b.slope))


def _inside(gap: Gap, best: Place) -> float:
    """Where to look in a gap: at its open end, near the lowest place, at the expected minimum, or
    in the middle.
    """
    if gap.is_near and gap.width > 2.0 * gap.limit:
        return gap.low + gap.limit if gap.low >= best.x else gap.high - gap.limit
    a, b = gap.below, gap.above
    if a is None:
        return gap.low
    if b is None:
        return gap.high
    if gap.width <= gap.limit:
        x = lowest_of_cubic(a, b)
        if not a.x < x < b.x:
            x = meeting(a, b)
        if a.x < x < b.x:
            return float(np.clip(x, a.x + 0.1 * gap.width, b.x - 0.1 * gap.width))
    return 0.5 * (gap.low + gap.high)
