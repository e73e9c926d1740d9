"""Pieces of a sweep solved at once, compared where they overlap, and joined."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from .._native import NOT_CONVERGED, STOPPED, Session, namelist_values, raise_status
from .._pool import HERE, Pool, open_pool
from .._progress import CONTROL, State
from .._watching import (
    Progress,
    StopFlag,
    Tell,
    run_watched,
    stop_reason,
    stops_on_interrupt,
    teller,
)
from ..case import Case
from ..errors import InputError, RunInterrupted, RunStopped
from ..result import Result
from .cutting import Piece, cut
from .joining import join
from .overlap import Part, agree, tolerance_of
from .restart import known_rows
from .sharing import Board

__all__ = ["plan_of", "run_in_pieces", "solve_piece"]


def run_in_pieces(case: Case, workers: int, scheduler: str, progress: Progress | None,
                  is_stopped: Callable[[], object] | None, *, in_memory: bool,
                  restart: str | Path | None = None,
                  see: Callable[[Sequence[Part]], object] | None = None
                  ) -> tuple[Result, list[str]]:
    """Run a natural sweep in pieces, and join them.

    A worker of this process that is ready takes over half of what another one has before it. Where
    two pieces do not agree in the rows that both have solved, there are several solutions;
    both are then solved again as one, so that the rows are those of a sweep.

    Parameters
    ----------
    case : Case
        A natural sweep.
    workers : int
        Pieces at once (0: as many as the pool has).
    scheduler : str
        See `fretwear.run`.
    progress, is_stopped
        As in `fretwear.run`.
    in_memory : bool
        Write no file.
    restart : str or Path, optional
        Result of the same sweep that was not finished: rows that it has are taken.
    see : callable, optional
        Given the parts before they are joined.

    Returns
    -------
    Result, list of str
        The result, and what is to be told of it.
    """
    if workers < 0:
        raise InputError(f"workers = {workers}: must be at least 0 (0: one for each core)")
    started = time.monotonic()
    with case.open() as session:
        if scheduler not in HERE:
            # Before a cluster is asked; here the first piece is refused for the same.
            session.check()
        plan = plan_of(namelist_values(session.text("namelist")), session.frequencies(),
                       "workers" if restart is None else "--restart")
        text, path = session.text("namelist"), session.text("output")
        with teller(progress, session) as tell:
            control = np.zeros(CONTROL, dtype=np.int64)
            in_main = threading.current_thread() is threading.main_thread()
            watch = _Watch(tell, is_stopped, control, len(plan.places))
            with stops_on_interrupt(control, in_main) as received, \
                    open_pool(scheduler, workers) as pool:
                work = _Work(session, watch.board) if scheduler in HERE else (
                    _WorkElsewhere(case))
                known, wanted = ([], cut(len(plan.places), pool.workers)) if restart is None else (
                    known_rows(restart, text, plan.places))
                parts, remarks = _solve(work, plan, pool, watch, known, wanted)
    if not parts:
        _raise_ended(None, received, remarks)
    if see is not None:
        see(parts)
    image = join(parts, plan.places, text, time.monotonic() - started, remarks,
                 was_stopped=watch.ended)
    result = Result.from_bytes(image, case)
    if not in_memory:
        result = result.save(path)
    if watch.ended:
        _raise_ended(result, received, remarks)
    return result, list(result.remarks)


def _raise_ended(result: Result | None, received: Sequence[int], remarks: Iterable[str]
                 ) -> NoReturn:
    """Of Ctrl-C, of `stop`, or of the time that was given."""
    if received:
        raise RunInterrupted(result)
    raise RunStopped(stop_reason(remarks), result)


@dataclass(frozen=True)
class _Plan:
    """Places of all rows (n_points), frequencies [rad/s] or values of the parameter, and how far
    two solutions of one may differ."""

    places: NDArray[np.float64]
    tolerance: float


def plan_of(values: dict[str, list[str]], frequencies: NDArray[np.float64],
            said_by: str = "workers") -> _Plan:
    """Refuse what does not go in pieces; `said_by` is what asks for them."""
    analysis, continuation = _word(values, "case%analysis"), _word(values, "sweep%continuation")
    if analysis != "frf" or continuation != "natural":
        raise InputError(f"{said_by}: a sweep in pieces is a natural one of analysis = 'frf'; this "
                         f"is analysis = '{analysis}', continuation = '{continuation}': run it "
                         f"without {said_by}")
    places = frequencies
    if _word(values, "sweep%parameter") not in ("", "frequency"):
        listed = values.get("sweep%values", [])
        places = np.array([_real(word) for word in listed]) if listed else np.linspace(
            _real(_word(values, "sweep%start")), _real(_word(values, "sweep%end")),
            int(_word(values, "sweep%n_points")))
    steps = np.diff(places)
    if not ((steps > 0.0).all() or (steps < 0.0).all()):
        raise InputError(f"{said_by}: a sweep in pieces goes up or down all the way; this one does "
                         "neither (sweep%values): sort them, or run it without " + said_by)
    return _Plan(places, tolerance_of(values))


def _word(values: dict[str, list[str]], key: str) -> str:
    return next(iter(values.get(key, [])), "").strip("'\"").lower()


def _real(word: str) -> float:
    return float(word.lower().replace("d", "e"))


@dataclass
class _Watch:
    """Tells of all pieces together, and whether they shall end."""

    tell: Tell | None
    is_stopped: Callable[[], object] | None
    control: NDArray[np.int64]
    total: int
    ended: bool = False
    board: Board = field(default_factory=Board)

    def tick(self) -> bool:
        """Whether to end."""
        states = self.board.states
        if self.tell is not None and states:
            newest = max(states, key=lambda state: state.done)
            self.tell(State(min(sum(state.done for state in states), self.total), self.total,
                            newest.omega, newest.amplitude, newest.cycles, newest.depth))
        if self.control[0] or (self.is_stopped is not None and self.is_stopped()):
            self.ended = True
        return self.ended


def _solve(work: Callable[..., list[Part]], plan: _Plan, pool: Pool, watch: _Watch,
           known: list[Part], wanted: list[Piece]) -> tuple[list[Part], list[str]]:
    """Parts in the order of the sweep that agree with each other, those that are known and those
    that are wanted, and where they did not."""
    parts = {part.piece: part for part in known}
    remarks: list[str] = []
    while wanted and not watch.ended:
        for part in chain.from_iterable(pool.run(work, wanted, tick=watch.tick)):
            watch.ended = watch.ended or part.was_stopped
            if part.image:
                parts[part.piece] = part
        if watch.ended:
            break
        # What is solved again as one shall not be cut once more.
        watch.board.is_shared = False
        in_order = sorted(parts.values(), key=lambda part: part.piece.first)
        groups: list[list[Part]] = []
        for part in in_order:
            difference = agree(groups[-1][-1], part) if groups else np.inf
            if groups and difference > plan.tolerance:
                remarks.append(_told(plan, part.piece, difference))
                groups[-1].append(part)
            else:
                groups.append([part])
        wanted = [group[0].piece.with_next(group[-1].piece) for group in groups if len(group) > 1]
        parts = {group[0].piece: group[0] for group in groups if len(group) == 1}
    return sorted(parts.values(), key=lambda part: part.piece.first), remarks


def _told(plan: _Plan, piece: Piece, difference: float) -> str:
    by_how_much = "one of them did not converge" if np.isinf(difference) else (
        f"they differ by {difference:.2g} of their size")
    return (f"at {plan.places[piece.first - 1]:.7g} pieces of the sweep found different solutions "
            f"({by_how_much}): there are several; those of a sweep from the start were taken")


class _Work:
    """Solves a piece in a session of its own, then what others have left with the same set-up."""

    def __init__(self, session: Session, board: Board) -> None:
        self._session, self._board = session, board

    def __call__(self, piece: Piece, stop: StopFlag) -> list[Part]:
        parts: list[Part] = []
        following: Piece | None = piece
        with Session(self._session) as session:
            while following is not None:
                started = time.monotonic()
                with self._board.solving(following) as work, stop.reaching(work.control):
                    status = session.run_piece(following.solved, following.lead, following.start,
                                               work.control)
                # Others may have taken rows of it meanwhile.
                parts.append(_part(session, work.piece, status, started))
                following = None if status == STOPPED else (
                    self._board.take(work.piece.solved[1]))
        return parts


class _WorkElsewhere:
    """Solves one piece; travels to other processes."""

    def __init__(self, case: Case) -> None:
        self._case = case

    def __call__(self, piece: Piece) -> list[Part]:
        return [solve_piece(self._case, piece)]


def solve_piece(case: Case, piece: Piece, progress: Progress | None = None,
                is_stopped: Callable[[], object] | None = None) -> Part:
    """A piece of a sweep in a session of its own, from points on the way to it."""
    started = time.monotonic()
    with case.open() as session, teller(progress, session) as tell:
        status, received = run_watched(
            lambda control: session.run_piece(piece.solved, piece.lead, 0, control), tell,
            is_stopped)
        part = _part(session, piece, status, started)
    if received:
        raise RunInterrupted(None)
    return part


def _part(session: Session, piece: Piece, status: int, started: float) -> Part:
    """What a run has given; raises what has ended it."""
    if status not in (NOT_CONVERGED, STOPPED):
        raise_status(status, session.text("message"))
    return Part(piece, session.image(), status == STOPPED, (started, time.monotonic()))
