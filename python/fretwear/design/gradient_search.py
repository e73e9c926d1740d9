"""The optimum of several parameters: L-BFGS-B of scipy, then a look along each of them."""

from __future__ import annotations

from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from .one_parameter import Line
from .scan import doubtful, next_look, unit_of
from .search import FLAT, MOST_FAILURES, End, FailedRun, Search, Spent

__all__ = ["SeveralParameters"]

Floats = NDArray[np.float64]

#: Times that the search begins anew from a lower place beside an optimum.
_MOST_RESTARTS = 8
#: How much lower that has to be.
_LOWER = 1e-6
_DOUBT = ("another optimum may exist: of several parameters {what} looked at from the start")


class _There(Exception):
    """An evaluation is an optimum."""


class SeveralParameters(Search):
    """The search of several parameters."""

    def _searched(self) -> End:
        try:
            word = self._attempted(self._descended)
            for _ in range(_MOST_RESTARTS):
                if word != "optimum" or not self._is_lower_beside():
                    break
                word = self._attempted(self._descended)
        except Spent:
            there = np.abs(self._projected(self._best())).max() <= self._least_slope
            word = "optimum" if there else self._spent_word
        return self._ended(word)

    @property
    def _least_slope(self) -> float:
        return 1e-2 * self._tolerance

    def _descended(self) -> str:
        # scipy's own tests are left to the last: they stop on the value, or wait for its noise.
        minimize = import_module("scipy.optimize").minimize  # where needed: it takes time
        try:
            found = minimize(
                self._asked, self._best().scaled, jac=True, method="L-BFGS-B",
                bounds=list(zip(self._low, self._high)),
                options={"ftol": 0.0, "gtol": self._least_slope, "maxfun": 10 * self._most,
                         "maxiter": 10 * self._most})
        except _There:
            return "optimum"
        if found.status == 0:
            return "optimum"
        text = found.message if isinstance(found.message, str) else found.message.decode()
        return f"no optimum: {' '.join(text.split()).lower()}"

    def _asked(self, scaled: Floats) -> tuple[float, Floats]:
        step = self._step(scaled)
        if (np.abs(self._projected(step)).max() <= self._least_slope
                and step.height <= self._best().height):
            raise _There
        return step.height, step.slope

    def _is_lower_beside(self) -> bool:
        """Whether it is lower beside the best point: near it along each parameter, and anywhere
        along those that do not change it there.
        """
        best = self._best()
        for k in range(len(best.scaled)):
            flat = bool(abs(best.slope[k]) <= self._least_slope ** 1.5)
            if (self._scans or flat) and self._is_lower_along(k, everywhere=flat):
                return True
        return False

    def _is_lower_along(self, k: int, *, everywhere: bool) -> bool:
        best = self._best()

        def asked(x: float) -> tuple[float, float]:
            scaled = best.scaled.copy()
            scaled[k] = x
            step = self._step(scaled)
            return step.height, float(step.slope[k])

        line = Line(asked, float(self._low[k]), float(self._high[k]), self._tolerance)
        line.look(float(best.scaled[k]))
        unit = unit_of(logarithmic=bool(self._unknowns.logarithmic[k]))
        while len(self.failures) < MOST_FAILURES:
            gaps = [gap for gap in doubtful(line, unit) if gap.is_near or everywhere]
            x = next_look(line, gaps)
            if x is None:
                return False
            try:
                if line.look(x).height < best.height - _LOWER:
                    return True
            except FailedRun:
                line.holes.append(x)
        return False

    def _ended(self, word: str) -> End:
        best = self._best()
        if word == "optimum":
            held = self._at_bounds(best)
            if all(np.abs(one.slope).max() <= self._least_slope for one in self._steps):
                word = FLAT
            elif held:
                word += f" at a bound: {held}"
        doubt = ""
        if word.startswith("optimum"):
            doubt = _DOUBT.format(what="the way, and the neighbourhood along each, are"
                                  if self._scans else "only the way is")
        size = self._size_of(best, np.full(len(best.scaled), self._least_slope))
        return End(word, doubt, best.found, size, ())
