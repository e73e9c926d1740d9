"""The pattern of blade frequencies in a box that amplifies most, by its derivatives."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._pool import Pool, core_count
from .analyses import run
from .case import Case
from .errors import ConvergenceError, InputError, RunStopped
from .populations import Population, population

__all__ = ["WorstPattern", "worst_pattern"]

Floats = NDArray[np.float64]

#: Steps that are tried at once: along the slope, in parts of the one that moves a blade across the
#: box, and along the way of BFGS, in parts of what that says.
_UPHILL, _CURVED = (1.0, 0.1, 0.01, 1e-3), (2.0, 1.0, 0.5, 0.2, 0.05)
#: Changes of slopes that are kept for it.
_MEMORY = 12
#: A start has ended where a step brings less than this part of its amplification.
_ENOUGH = 1e-6
_MOST_STEPS = 60
#: Starts that end within this of the best one agree with it.
_SAME = 1e-3

#: Called with the steps that were made and the largest amplification until then.
Told = Callable[[int, float], object]


@dataclass(frozen=True)
class WorstPattern:
    """The largest of what ascents from several starts have reached: local maxima where they ended.

    Nothing says that there is no larger one: `agree` tells how many starts came to it.

    Attributes
    ----------
    pattern : (n_sectors,) or (n_sectors, n_rows)
        By which part the blade frequencies are above the tuned ones, inside of the box.
    amplification : float
        Of the largest amplitude to that of the tuned disk.
    omega : float
        Where [rad/s].
    sector : int
        The blade, from 0.
    all : (n_starts,)
        The amplification that each start has reached.
    patterns : (n_starts, ..)
        Its pattern.
    ended : (n_starts,) bool
        Whether it has come to a maximum; others have used up their steps.
    """

    pattern: Floats
    amplification: float
    omega: float
    sector: int
    all: Floats
    patterns: Floats
    ended: NDArray[np.bool_]

    @property
    def agree(self) -> int:
        """Starts that came to this amplification, within a thousandth."""
        return int((self.all >= (1.0 - _SAME) * self.amplification).sum())

    def __str__(self) -> str:
        came = "a local maximum" if self.ended[int(np.nanargmax(self.all))] else (
            "still climbing at its last step")
        return (f"worst pattern: amplification {self.amplification:.4f} of sector {self.sector} at "
                f"{self.omega / (2.0 * np.pi):.6g} Hz; {came}, {self.agree} of "
                f"{len(self.all)} starts come to it, {int(self.ended.sum())} have ended, the "
                f"lowest at {np.nanmin(self.all):.4f}")


def worst_pattern(case: Case | str | Path, box: float = 0.05, *, starts: int | ArrayLike = 10,
                  seed: int = 0, observe: int = 0, workers: int = 0,
                  stop: threading.Event | None = None, progress: Told | None = None
                  ) -> WorstPattern:
    """Look for the pattern that amplifies most, each blade between -box and box.

    From each start the slope of the largest first harmonic, of one adjoint solution, says where to
    go; what lies outside of the box is put onto it.

    Parameters
    ----------
    case : Case, str or Path
        As `population` takes it; its &sweep must hold the peak.
    box : float
        Largest deviation of a blade frequency.
    starts : int or array_like
        How many patterns to start from, drawn by `seed` evenly inside of the box, or patterns, such
        as those of a population with the largest amplification.
    seed : int
        Of the starts.
    observe : int
        Observed quantity of a sector, from 0.
    workers : int
        Runs at once (0: one for each core).
    stop : threading.Event, optional
        Ends the work where it is set.
    progress : callable, optional
        Called with the steps made and the largest amplification.

    Raises
    ------
    InputError
        What the library does not accept; `starts` outside of the box.
    ConvergenceError
        No start was solved.
    RunStopped
        The work was ended.
    """
    base = case if isinstance(case, Case) else Case.from_file(case)
    if not np.isfinite(box) or not 0.0 < box < 1.0:
        raise InputError(f"box: is {box:g}, must be a deviation between 0 and 1, such as 0.05")
    search = _Search(base.replace(population={"quantity": "first_harmonic"}), box, observe, workers,
                     stop)
    at = search.begin(starts, seed)
    for step in range(_MOST_STEPS):
        moving = np.flatnonzero(~at.ended)
        if len(moving) == 0:
            break
        search.climb(at, moving)
        if progress is not None:
            progress(step + 1, float(np.nanmax(at.amplification)))
    best = int(np.nanargmax(at.amplification))
    return WorstPattern(at.patterns[best], float(at.amplification[best]), float(at.omega[best]),
                        int(at.sector[best]), at.amplification, at.patterns, at.ended)


class _Memory:
    """Changes of place and slope along the ascent of a start, by which BFGS bends its way."""

    def __init__(self) -> None:
        self._last: tuple[Floats, Floats] | None = None
        self._pairs: list[tuple[Floats, Floats]] = []

    def remember(self, place: Floats, slope: Floats) -> None:
        """A further place with its slope."""
        if self._last is not None:
            move, change = place - self._last[0], self._last[1] - slope
            # Where the slope grows along the way there is no summit to be told.
            if (move * change).sum() > 1e-10 * np.linalg.norm(move) * np.linalg.norm(change):
                self._pairs = [*self._pairs, (move, change)][-_MEMORY:]
        self._last = place.copy(), slope.copy()

    def way(self, slope: Floats, moves: NDArray[np.bool_]) -> Floats:
        """Slope times the inverse of the curvature, of what may move."""
        way, parts = np.where(moves, slope, 0.0), []
        pairs = [(move * moves, change * moves) for move, change in self._pairs]
        pairs = [(move, change) for move, change in pairs if (move * change).sum() > 0.0]
        for move, change in reversed(pairs):
            parts.append((move * way).sum() / (move * change).sum())
            way = way - parts[-1] * change
        if pairs:
            move, change = pairs[-1]
            way = way * (move * change).sum() / (change * change).sum()
        for (move, change), part in zip(pairs, reversed(parts)):
            way = way + (part - (change * way).sum() / (move * change).sum()) * move
        return np.where(moves, way, 0.0)


@dataclass
class _Places:
    """Where the starts have come."""

    patterns: Floats
    amplification: Floats
    omega: Floats
    sector: NDArray[np.int64]
    ended: NDArray[np.bool_]
    memory: list[_Memory]


class _Search:
    def __init__(self, case: Case, box: float, observe: int, workers: int,
                 stop: threading.Event | None) -> None:
        self.case, self.box, self.observe = case, box, observe
        self.workers, self.stop = workers or core_count(), stop

    def begin(self, starts: int | ArrayLike, seed: int) -> _Places:
        """Amplifications of the starts."""
        if np.ndim(starts) == 0:
            n = int(starts)  # type: ignore[arg-type]
            if n < 1:
                raise InputError(f"starts: is {n}, must be a number of patterns, or patterns")
            shape = population(self.case, 1, seed=seed, deviation=0.0, workers=1,
                               stop=self.stop).patterns.shape[1:]
            patterns = np.random.default_rng(seed).uniform(-self.box, self.box, (n, *shape))
        else:
            patterns = np.array(starts, dtype=np.float64)
            if patterns.ndim < 2 or not (np.abs(patterns) <= self.box).all():
                raise InputError(f"starts: must be (n, n_sectors[, n_rows]) inside of the box, "
                                 f"-{self.box:g} to {self.box:g}")
        found = self._solve(patterns)
        amplification = found.amplification[:, self.observe]
        if not np.isfinite(amplification).any():
            raise ConvergenceError("no start was solved anywhere: take another &sweep, or fewer "
                                   "harmonics", None)
        return _Places(patterns, amplification, found.omega[:, self.observe],
                       found.sector[:, self.observe], ~np.isfinite(amplification),
                       [_Memory() for _ in patterns])

    def _solve(self, patterns: Floats) -> Population:
        return population(self.case, patterns, workers=self.workers, stop=self.stop)

    def climb(self, at: _Places, moving: NDArray[np.int64]) -> None:
        """One step of each start that has not ended: the best of several."""
        slopes = self._slopes(at, moving)
        tried = np.array([self._tried(at, place, slope) for place, slope in zip(moving, slopes)])
        found = self._solve(tried.reshape(-1, *slopes.shape[1:]))
        values = found.amplification[:, self.observe].reshape(len(moving), -1)
        values = np.where(np.isfinite(values), values, -np.inf)
        best = values.argmax(axis=1)
        for k, place in enumerate(moving):
            row = k * tried.shape[1] + int(best[k])
            if not values[k, best[k]] > at.amplification[place]:
                at.ended[place] = True
                continue
            at.ended[place] = values[k, best[k]] < (1.0 + _ENOUGH) * at.amplification[place]
            at.patterns[place] = tried[k, best[k]]
            at.amplification[place] = values[k, best[k]]
            at.omega[place] = found.omega[row, self.observe]
            at.sector[place] = found.sector[row, self.observe]

    def _tried(self, at: _Places, place: int, slope: Floats) -> Floats:
        """Patterns to try from where a start has come (n, ..), inside of the box."""
        here = at.patterns[place]
        at.memory[place].remember(here, slope)
        outward = (np.abs(here) >= self.box) & (here * slope > 0.0)
        free = np.where(outward, 0.0, slope)
        size = np.abs(free).max()
        uphill = 2.0 * self.box * free / size if size > 0.0 else free
        curved = at.memory[place].way(free, ~outward)
        return np.clip(here + np.array([part * way for parts, way in (
            (_UPHILL, uphill), (_CURVED, curved)) for part in parts]), -self.box, self.box)

    def _slopes(self, at: _Places, moving: NDArray[np.int64]) -> Floats:
        """Derivatives of the largest first harmonics by the patterns; 0 where none is known."""
        slopes = np.zeros((len(moving), *at.patterns.shape[1:]))

        def one(item: tuple[int, int], stopped: threading.Event) -> tuple[int, Any]:
            k, place = item
            pattern = at.patterns[place]
            case = self.case.replace(
                case={"analysis": "point", "threads": 1},
                sweep={"start": float(at.omega[place]), "unit": "rad/s"},
                mistuning={"frequency": pattern.ravel().tolist()},
                sensitivity={"parameters": ["mistuning%frequency"],
                             "quantities": ["first_harmonic"]})
            try:
                return k, run(case, stop=stopped, check=False, in_memory=True)
            except RunStopped:
                return k, None

        ended = self.stop if self.stop is not None else threading.Event()
        for k, result in Pool(self.workers).run(one, list(enumerate(moving.tolist())),
                                                tick=ended.is_set):
            if result is None:
                raise RunStopped("the search was ended", None)
            if not result.converged.all():
                continue
            n_own = len(result.observed) // at.patterns.shape[1]
            row = int(at.sector[moving[k]]) * n_own + self.observe
            slope = result["sensitivity/first_harmonic/mistuning_frequency"][0, row]
            # One value of all rows of a blade moves each of them.
            shape = slopes.shape[1:]
            slopes[k] = np.nan_to_num(slope.reshape(shape[0], -1).sum(axis=1) if len(shape) == 1
                                      else slope.reshape(shape))
        return slopes
