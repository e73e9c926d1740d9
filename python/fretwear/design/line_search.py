"""The optimum of one parameter: down to the nearest, then into every gap that may hold another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .one_parameter import Line, Place, descend
from .peak_values import OF_INSTANTS
from .scan import doubtful, is_plateau, next_look, spans, unit_of
from .search import FLAT, MOST_FAILURES, End, FailedRun, Search, Spent, Step

__all__ = ["OneParameter"]

#: Slopes of logarithms that jump by less are of no corner: contact that switches near a peak leaves
#: so much of its slope.
_NO_CORNER = 1e-5
_CORNER = ("optimum at a corner: the slope jumps from one sign to the other, as where another peak "
           "becomes the highest")
_NEAR_CORNER = ("optimum at a corner, or near one: contact is decided at instants, whose slopes "
                "leave out that switches move; sampling = 'events' tells which")


class OneParameter(Search):
    """The search of one parameter."""

    def _searched(self) -> End:
        self._line = Line(self._asked, float(self._low[0]), float(self._high[0]), self._tolerance)
        self._line.look(float(self._steps[0].scaled[0]))
        try:
            word = self._attempted(self._descended)
        except Spent:
            word = self._spent_word if not self._is_known(self._line.best) else "optimum"
        line, bounds = self._line, self._unknowns
        line.low, line.high = (float(bounds.to_scaled(end)[0]) for end in (bounds.low,
                                                                           bounds.high))
        line.holes = [float(place[0]) for place in self._places]
        if self._scans and word == "optimum":
            word = self._scanned()
        return self._ended(word)

    def _asked(self, x: float) -> tuple[float, float]:
        step = self._step(np.array([x]))
        return step.height, float(step.slope[0])

    def _is_known(self, place: Place) -> bool:
        """Whether a place is a minimum, or one side of it."""
        return self._line.is_there(place) or self._line.across(place) is not None

    def _descended(self) -> str:
        line = self._line
        line.low, line.high = float(self._low[0]), float(self._high[0])
        self._settle()
        return "optimum"

    def _settle(self) -> None:
        """Go down from the lowest place."""
        while not self._is_known(self._line.best):
            descend(self._line, self._line.best)

    def _scanned(self) -> str:
        """Look into gaps, and go down wherever it is lower."""
        line, unit = self._line, unit_of(logarithmic=bool(self._unknowns.logarithmic[0]))
        while len(self.failures) < MOST_FAILURES:
            x = next_look(line, doubtful(line, unit))
            if x is None:
                break
            try:
                line.look(x)
                self._settle()
            except FailedRun as failure:
                line.holes.append(float(failure.place[0]))
            except Spent:
                break
        if self._is_known(line.best):
            return "optimum"
        return ("no optimum: the search ended where runs begin to fail" if line.holes
                else self._spent_word)

    def _ended(self, word: str) -> End:
        line, best = self._line, self._line.best
        step, sides, size = self._step_at(best), [best], line.zero(best)
        if word == "optimum":
            word, sides = self._kind(best)
            size = max(size, max(abs(one.slope) for one in sides)) if word == "optimum" else size
        logarithmic = bool(self._unknowns.logarithmic[0])
        doubt = ""
        if word.startswith("optimum"):
            gaps = spans(doubtful(line, unit_of(logarithmic=logarithmic)))
            doubt = ", ".join("between " + " and ".join(f"{self._value(x):.6g}" for x in gap)
                              for gap in gaps)
        corner = tuple(self._step_at(one).found for one in sorted(sides)
                       ) if "corner" in word else ()
        return End(word, doubt and f"another optimum may exist {doubt}", step.found,
                   self._size_of(step, np.array([size])), corner)

    def _kind(self, best: Place) -> tuple[str, list[Place]]:
        """What kind of optimum the lowest place is, and the places that it is made of."""
        line = self._line
        if all(line.is_flat(one) for one in line.places):
            return FLAT, [best]
        plateau = is_plateau(line, best)
        if plateau is not None:
            low, high = (f"{self._value(x):.6g}" for x in plateau)
            return (f"optimum on a plateau: from {low} to {high} {self._unknowns.names[0]} changes "
                    "nothing", [best])
        held = self._at_bounds(self._step_at(best))
        if held and line.is_held(best):
            return f"optimum at a bound: {held}", [best]
        other = line.across(best)
        if line.is_there(best) or other is None:
            return "optimum", [best]
        if other.slope * best.slope > 0.0:
            return (f"no optimum: the objective jumps at {self._value(best.x):.9g}, where another "
                    "solution or another peak is found", [best])
        if max(abs(best.slope), abs(other.slope)) <= _NO_CORNER:
            return "optimum", [best, other]
        if any(text.startswith(OF_INSTANTS) for text in self._step_at(best).found.remarks):
            return _NEAR_CORNER, [best, other]
        return _CORNER, [best, other]

    def _step_at(self, place: Place) -> Step:
        return next(one for one in self._steps if one.scaled[0] == place.x)

    def _value(self, x: float) -> float:
        found: NDArray[np.float64] = self._unknowns.to_values(np.array([x]))
        return float(found[0])
