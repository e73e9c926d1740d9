"""The newest settings are computed in a thread; older ones are given up within a point."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..analyses import run
from ..case import Case
from ..errors import FretwearError, RunStopped
from ..result import Result

__all__ = ["Answer", "Solver"]

#: A sweep that took longer than this is shown with few points first [s].
_AT_ONCE = 0.25
_FEW_POINTS = 41


@dataclass(frozen=True)
class Answer:
    """What the page shows.

    Attributes
    ----------
    result : Result or None
        With all points that are done; None where the case was refused.
    words : str
        What there is to say about it.
    is_final : bool
        No finer one follows.
    seconds : float
        From the wish to this answer.
    """

    result: Result | None
    words: str
    is_final: bool
    seconds: float


@dataclass
class _Wish:
    groups: dict[str, Any]
    since: float = field(default_factory=time.monotonic)


class Solver:
    """Solves a case again and again with other settings.

    Parameters
    ----------
    case : Case
        A sweep.
    tell : callable
        Called with every `Answer`, from the thread of the solver.
    max_seconds : float
        A sweep is stopped after this time; its points up to there are shown.
    """

    def __init__(self, case: Case, tell: Callable[[Answer], object], max_seconds: float) -> None:
        self._case, self._tell, self._max_seconds = case, tell, max_seconds
        self._wish: _Wish | None = None
        self._changed = threading.Condition()
        self._is_over = False
        #: Time of the last full sweep [s]; None before the first.
        self._took: float | None = None
        self._thread = threading.Thread(target=self._work, name="explore", daemon=True)
        self._thread.start()

    def ask(self, groups: dict[str, Any]) -> None:
        """Wish for other settings; what is at work is given up."""
        with self._changed:
            self._wish = _Wish(groups)
            self._changed.notify()

    def stop(self) -> None:
        """End the thread, within a point."""
        with self._changed:
            self._is_over = True
            self._wish = None
            self._changed.notify()
        self._thread.join()

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._wish is not None or self._is_over)
                if self._is_over:
                    return
                wish, self._wish = self._wish, None
            if wish is not None:
                self._serve(wish)

    def _serve(self, wish: _Wish) -> None:
        case = self._case.replace(**wish.groups)
        if self._took is not None and self._took > _AT_ONCE:
            coarse = case.replace(sweep={"n_points": _FEW_POINTS})
            self._answer(coarse, wish, is_final=False)
            if self._is_stale():
                return
        started = time.monotonic()
        if self._answer(case, wish, is_final=True):
            self._took = time.monotonic() - started

    def _is_stale(self) -> bool:
        return self._wish is not None or self._is_over

    def _answer(self, case: Case, wish: _Wish, *, is_final: bool) -> bool:
        """Solve and tell; whether the sweep came to its end."""
        try:
            result = run(case, check=False, in_memory=True, stop=self._is_stale,
                         max_seconds=self._max_seconds)
        except RunStopped as stopped:
            if self._is_stale():
                return False
            self._tell(Answer(stopped.result, f"stopped after {self._max_seconds:g} s: "
                              "what was computed until then is shown", is_final,
                              time.monotonic() - wish.since))
            return False
        except FretwearError as error:
            self._tell(Answer(None, str(error), True, time.monotonic() - wish.since))
            return False
        self._tell(Answer(result, _words(result), is_final, time.monotonic() - wish.since))
        return True


def _words(result: Result) -> str:
    """Where the maximum is, and what to know about the points."""
    failed = int(np.count_nonzero(~result.converged))
    words = [f"{failed} of {result.n_points} points did not converge and are left out"
             ] if failed else []
    return "; ".join(words + result.remarks[:3])
