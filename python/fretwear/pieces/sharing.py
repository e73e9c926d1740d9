"""Pieces at work: a worker that is ready takes over half of what another one has before it.

Rows near a resonance take several times as long as those far from it, and nobody knows where they
are before they are solved: pieces of as many rows do not end together.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from .._progress import CONTROL, WANTED, State, read_state
from .cutting import OVERLAP, Piece, divided

__all__ = ["AtWork", "Board"]


class AtWork:
    """A piece that is being solved.

    Parameters
    ----------
    piece : Piece
        As it is at first; it loses rows to those who take them over.

    Attributes
    ----------
    control : int array
        What its run and others see each other by.
    """

    def __init__(self, piece: Piece) -> None:
        self.piece = piece
        self.control: NDArray[np.int64] = np.zeros(CONTROL, dtype=np.int64)
        self._started = time.monotonic()

    @property
    def row(self) -> int:
        """The one that is being solved, or the first of its own while it is on the way there."""
        return max(self.piece.solved[0] + int(self.control[1]), self.piece.first)

    @property
    def time_left(self) -> float:
        """If the rows to come take as long as those before [s]."""
        done = max(int(self.control[1]), 1)
        return (time.monotonic() - self._started) * (self.piece.last - self.row) / done

    def give(self, solved: int) -> Piece | None:
        """Rows for a worker that has solved up to some point (0: none); None where sharing does not
        pay."""
        parts = divided(self.piece, self.row, solved)
        if parts is None:
            return None
        self.piece, given = parts
        self.control[WANTED] = self.piece.last + OVERLAP - self.piece.solved[0] + 1
        return given


class Board:
    """All pieces of a sweep that workers of this process solve."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._at_work: list[AtWork] = []
        self._ended: list[State] = []
        self.is_shared = True

    @contextmanager
    def solving(self, piece: Piece) -> Iterator[AtWork]:
        """The piece is at work in the `with` block; behind it, nobody takes of it."""
        work = AtWork(piece)
        with self._lock:
            self._at_work.append(work)
        try:
            yield work
        finally:
            with self._lock:
                self._at_work.remove(work)
                self._ended.append(read_state(work.control))

    def take(self, solved: int = 0) -> Piece | None:
        """Rows of the piece that has the longest way to go, for a worker that has solved up to some
        point (0: none); None where nothing is left to share."""
        with self._lock:
            if not self.is_shared or not self._at_work:
                return None
            return max(self._at_work, key=lambda work: work.time_left).give(solved)

    @property
    def states(self) -> list[State]:
        """How far all pieces are, those at their end too."""
        with self._lock:
            return self._ended + [read_state(work.control) for work in self._at_work]
