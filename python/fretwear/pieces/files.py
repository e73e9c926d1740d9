"""Pieces of a sweep as files: solved one by one, wherever and whenever, and joined afterwards.

A piece is a result file of its rows that says which they are, and of which sweep.
"""

from __future__ import annotations

import io
import re
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from .._identity import identity
from .._native import namelist_values
from .._watching import Progress
from ..case import Case
from ..errors import ConvergenceError, InputError, OutputError
from ..result import Result
from .cutting import Piece, cut
from .joining import join
from .overlap import Part, agree, tolerance_of
from .running import plan_of, solve_piece

__all__ = ["Share", "join_files", "run_share"]

#: Attributes of a piece: first and last row and their number, the share as it was typed, the whole
#: case, and what that is known by.
_ROWS, _SHARE, _WHOLE, _KNOWN_BY = "piece", "piece_share", "piece_of", "piece_known_by"


@dataclass(frozen=True)
class Share:
    """Pieces first to last of n, counted from 1."""

    first: int
    last: int
    n: int

    @classmethod
    def of(cls, text: str) -> Share:
        """From K/N, or K-L/N for several pieces that are solved as one."""
        found = re.fullmatch(r"(\d+)(?:-(\d+))?/(\d+)", text.strip())
        if found:
            share = cls(int(found[1]), int(found[2] or found[1]), int(found[3]))
            if 1 <= share.first <= share.last <= share.n:
                return share
        raise InputError(f"--part {text}: expected K/N, such as 3/16 (the third of 16 parts), or "
                         "K-L/N for several as one, with 1 <= K <= L <= N")

    def __str__(self) -> str:
        return f"{self.first}{'' if self.last == self.first else f'-{self.last}'}/{self.n}"


def run_share(case: Case, share: Share, path: Path | None = None,
              progress: Progress | None = None,
              is_stopped: Callable[[], object] | None = None) -> Result:
    """Solve a share of a natural sweep, and write it; one that is there already is taken.

    Parameters
    ----------
    case : Case
        The whole sweep.
    share : Share
        Which pieces of it, as one.
    path : Path, optional
        File of the piece; by default that of the case with the share in its name.
    progress, is_stopped
        As in `fretwear.run`.
    """
    with case.open() as session:
        session.check()
        text, usual = session.text("namelist"), session.text("output")
        known_by = identity(session, case.path)
        plan = plan_of(namelist_values(text), session.frequencies(), "--part")
    n_points = len(plan.places)
    pieces = cut(n_points, share.n)
    if len(pieces) < share.n:
        raise InputError(f"--part {share}: {n_points} rows make {len(pieces)} pieces at most, of "
                         f"which each has its way from the start before it; take N = {len(pieces)}")
    piece = pieces[share.first - 1].with_next(pieces[share.last - 1])
    target = path or Path(usual).with_suffix(f".part-{str(share).replace('/', '-of-')}.h5")
    if case.model is None and _is_there(target, piece, known_by):
        return Result(target, case)
    part = solve_piece(case, piece, progress, is_stopped)
    buffer = io.BytesIO(part.image)
    with h5py.File(buffer, "r+") as file:
        file.attrs[_ROWS] = np.array([piece.first, piece.last, n_points], dtype=np.int32)
        file.attrs[_SHARE], file.attrs[_WHOLE] = str(share), text
        file.attrs[_KNOWN_BY] = known_by
    return Result.from_bytes(buffer.getvalue(), case).save(target)


def _is_there(path: Path, piece: Piece, known_by: str) -> bool:
    """Whether a file is this piece, and whole."""
    if not path.is_file():
        return False
    try:
        found = _read(path)
    except (InputError, OutputError):
        return False
    return (found.part.piece == piece and found.known_by == known_by
            and not found.part.was_stopped)


def join_files(paths: Sequence[Path], target: Path) -> Result:
    """Join the pieces of one sweep.

    Raises
    ------
    InputError
        A file is no piece, pieces are of several sweeps, or some are missing.
    ConvergenceError
        Two pieces do not agree in the rows that both have solved; the message has the command that
        solves them as one.
    """
    if not paths:
        raise InputError("fretwear join: name the pieces")
    found = sorted((_read(path) for path in paths), key=lambda one: one.part.piece.first)
    first = found[0]
    for one in found[1:]:
        if one.known_by != first.known_by or (
                one.part.piece.n_points != first.part.piece.n_points):
            raise InputError(f"{one.path} and {first.path} are pieces of different sweeps: their "
                             "cases differ, or the files that they read")
    n_points, row = first.part.piece.n_points, 0
    for one in found:
        if one.part.piece.first != row + 1:
            what = "no piece has" if one.part.piece.first > row + 1 else "two pieces have"
            raise InputError(f"{what} rows {min(row + 1, one.part.piece.first)} to "
                             f"{max(row, one.part.piece.first - 1)} of {n_points}: give each piece "
                             f"once ({one.path} begins at row {one.part.piece.first})")
        row = one.part.piece.last
    if row != n_points:
        raise InputError(f"no piece has rows {row + 1} to {n_points}: give all of them")
    unfinished = [one for one in found if one.part.was_stopped]
    if unfinished:
        raise InputError(f"{unfinished[0].path} was stopped before its last row: solve it again "
                         f"(fretwear run CASE.nml --part {unfinished[0].share})")
    tolerance = tolerance_of(namelist_values(first.whole))
    for one, other in zip(found, found[1:]):
        difference = agree(one.part, other.part)
        if difference > tolerance:
            both = Share(one.share.first, other.share.last, one.share.n)
            raise ConvergenceError(
                f"{one.path} and {other.path} found different solutions in the rows that both "
                f"have (they differ by {difference:.2g} of their size): there are several. Solve "
                f"them as one, as a sweep would (fretwear run CASE.nml --part {both}), and join "
                "with that in place of both")
    places = np.concatenate([one.part.places[one.owned] for one in found])
    image = join([one.part for one in found], places, first.whole,
                 sum(one.elapsed for one in found), [], was_stopped=False)
    buffer = io.BytesIO(image)
    with h5py.File(buffer, "r+") as file:
        for name in (_ROWS, _SHARE, _WHOLE, _KNOWN_BY):
            del file.attrs[name]   # of the first piece, as all its attributes
    return Result.from_bytes(buffer.getvalue()).save(target)


@dataclass(frozen=True)
class _File:
    """A piece that was read, with its share and the whole case."""

    path: Path
    part: Part
    share: Share
    whole: str
    known_by: str
    elapsed: float

    @property
    def owned(self) -> slice:
        """Its own rows among those that it has solved."""
        piece = self.part.piece
        return slice(piece.first - piece.solved[0], piece.last - piece.solved[0] + 1)


def _read(path: Path) -> _File:
    try:
        image = path.read_bytes()
        with h5py.File(io.BytesIO(image)) as file:
            if _ROWS not in file.attrs:
                raise InputError(f"{path}: is no piece of a sweep; fretwear run CASE.nml --part "
                                 "K/N writes them")
            first, last, n_points = (int(number) for number in file.attrs[_ROWS])
            whole, elapsed = str(file.attrs[_WHOLE]), float(file.attrs["elapsed"])
            stopped = str(file.attrs["status"]) == "stopped"
            share, known_by = Share.of(str(file.attrs[_SHARE])), str(file.attrs[_KNOWN_BY])
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error}") from None
    part = Part(Piece(first, last, n_points), image, stopped, (0.0, time.monotonic()))
    return _File(path, part, share, whole, known_by, elapsed)
