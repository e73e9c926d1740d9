"""Where a sweep is cut, so that all pieces take the same time."""

from __future__ import annotations

from dataclasses import dataclass, replace

__all__ = ["OVERLAP", "Piece", "cut", "divided"]

#: Rows that a piece solves beyond its own on either side: there two pieces are compared, and a
#: maximum at a cut has its neighbours.
OVERLAP = 2
#: Points over the whole sweep from which those on the way to a piece are taken: from the start of
#: the sweep to its first row, so that it comes to the same solutions as a sweep would.
_LEADS = 12
#: What one of them costs, in rows: its step is longer.
_COST = 2.0
#: Rows below which a piece does not pay, of those that another worker takes over too.
_LEAST = 16


@dataclass(frozen=True)
class Piece:
    """Points of a sweep, counted from 1.

    Attributes
    ----------
    first, last : int
        Its own rows.
    n_points : int
        Of the whole sweep.
    start : int
        The point that its worker has solved and goes on from; 0 is the start of the sweep.
    """

    first: int
    last: int
    n_points: int
    start: int = 0

    @property
    def solved(self) -> tuple[int, int]:
        """First and last point that it solves."""
        return max(self.first - OVERLAP, 1), min(self.last + OVERLAP, self.n_points)

    @property
    def lead(self) -> int:
        """Points on the way to the first of them."""
        before = self.solved[0] - 1 - self.start
        return min(before, -(-_LEADS * before // self.n_points))

    def with_next(self, other: Piece) -> Piece:
        """This piece and those up to another one, as one."""
        return Piece(self.first, other.last, self.n_points)


def cut(n_points: int, n_pieces: int) -> list[Piece]:
    """Pieces of equal cost: their own rows and what leads to them.

    With g_k rows before piece k and a = cost of the lead over a row, a piece of the time T has
    T - a g_k rows, so that 1 - g_k a/T falls by the factor (1 - a) from piece to piece.
    """
    n_pieces = max(min(n_pieces, n_points // _LEAST), 1)
    left = 1.0 - min(_COST * _LEADS / n_points, 0.5)
    before = [round(n_points * (1.0 - left**k) / (1.0 - left**n_pieces))
              for k in range(n_pieces + 1)]
    return [Piece(a + 1, b, n_points) for a, b in zip(before, before[1:])]


def divided(piece: Piece, row: int, solved: int = 0) -> tuple[Piece, Piece] | None:
    """A piece whose worker is at a row, for two workers: what it keeps, and what another takes.

    Both end at once if the rows take the same time: the other one, which has solved up to some
    point, has its lead before it, and solves rows beyond the cut as the first one does. None where
    too few rows are left.
    """
    start = solved if solved < row else 0
    lead = _COST * Piece(piece.last, piece.last, piece.n_points, start).lead
    taken = int(piece.last - row - OVERLAP - lead) // 2
    if taken < _LEAST:
        return None
    cut_at = piece.last - taken
    return (replace(piece, last=cut_at),
            Piece(cut_at + 1, piece.last, piece.n_points, start))
