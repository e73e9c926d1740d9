"""Going on with a natural sweep of which some rows are there: those that a run left which was
killed or stopped.

They are parts of the result like any other. What is solved anew: the rows that are missing, with
some before them, and a few around each maximum, because a run looks for maxima and changes of
stability between its rows when it has come to their end.
"""

from __future__ import annotations

import io
import time
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from .._native import namelist_values
from ..errors import InputError, OutputError
from .cutting import OVERLAP, Piece
from .overlap import Part

__all__ = ["known_rows"]

#: Keys that change no row.
_FREE = ("case%title", "case%threads", "case%max_seconds", "output%file")
#: Rows on either side of a maximum that are solved again; fewer between two such are not worth it.
_AROUND, _BETWEEN = 1, 6
#: Rows of a file are those of the sweep within this, relative.
_SAME_PLACE = 1e-12

Ints = NDArray[np.intp]


def known_rows(path: str | Path, namelist: str, places: NDArray[np.float64]
               ) -> tuple[list[Part], list[Piece]]:
    """Rows that are there, and pieces to be solved.

    Parameters
    ----------
    path : str or Path
        Result file, also of a run that was killed.
    namelist : str
        Effective case.
    places : (n_points,) array
        Of the whole sweep.

    Raises
    ------
    InputError
        The file is of another case, or whole.
    OutputError
        It cannot be read.
    """
    try:
        image = io.BytesIO(Path(path).read_bytes())
        with h5py.File(image, "r+") as file:
            _check(str(path), file, namelist)
            n_rows = _count(file, places)
            again = _marks(file, n_rows)
            # Of the parts of a result the worst counts; this one has no end of its own.
            file.attrs["status"] = "not converged"
    except (OSError, KeyError) as error:
        raise OutputError(f"{path}: cannot be read as a result file: {error}") from None
    if n_rows == len(places):
        raise InputError(f"{path}: has all {n_rows} rows of this sweep: there is nothing to go on "
                         "with")
    n_points = len(places)
    if n_rows <= 2 * OVERLAP:
        return [], [Piece(1, n_points, n_points)]
    rest = Piece(n_rows - OVERLAP + 1, n_points, n_points)
    pieces = [*_pieces(again, rest.first - 1, n_points), rest]
    kept, before = [], 1
    for piece in pieces:
        if piece.first > before:
            kept.append(Part(Piece(before, piece.first - 1, n_points), image.getvalue(), False,
                             (0.0, time.monotonic())))
        before = piece.last + 1
    return kept, pieces


def _check(path: str, file: h5py.File, namelist: str) -> None:
    if "namelist" not in file.attrs or "coefficients" not in file:
        raise InputError(f"{path}: is no result of a sweep: --restart takes one, or what an "
                         "interrupted run has left (name.h5.part)")
    theirs, ours = namelist_values(str(file.attrs["namelist"])), namelist_values(namelist)
    for key in sorted({*theirs, *ours} - {*_FREE}):
        if theirs.get(key) != ours.get(key):
            raise InputError(
                f"{path}: has {key} = {', '.join(theirs.get(key, ['nothing']))}, but this case has "
                f"{', '.join(ours.get(key, ['nothing']))}: --restart goes on with the same case "
                "only; take the value back, or run the case anew")


def _count(file: h5py.File, places: NDArray[np.float64]) -> int:
    """Rows that every quantity of a point has, and that are those of the sweep, from its start."""
    lengths: list[int] = []

    def see(_: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            labels = item.attrs.get("DIMENSION_LABELS", [""])
            if len(labels) and str(labels[0]) == "point":
                lengths.append(len(item))

    file.visititems(see)
    n = min([*lengths, len(places)])
    there = file["parameter" if "parameter" in file else "omega"][:n]
    apart = np.abs(there - places[:n]) > _SAME_PLACE * np.abs(places[:n]).max(initial=0.0)
    return int(apart.argmax()) if apart.any() else n


def _marks(file: h5py.File, n_rows: int) -> Ints:
    """Rows between which a run looks for something at its end, counted from 1."""
    amplitude = file["amplitude"][:n_rows]
    # Where nothing rises from the start, a maximum may be there, of a row that failed too.
    marked = set() if len(amplitude) > 1 and (amplitude[0] < amplitude[1]).all() else {1}
    if len(amplitude) > 2:
        inner = amplitude[1:-1]
        is_top = (inner >= amplitude[:-2]) & (inner >= amplitude[2:])
        marked |= {int(k) + 2 for k in np.flatnonzero(is_top.any(axis=1))}
    if "floquet/stable" in file:
        stable = file["floquet/stable"][:n_rows]
        marked |= {int(k) + 1 for k in np.flatnonzero(np.diff(stable) != 0)}
    return np.array(sorted(marked), dtype=np.intp)


def _pieces(marks: Ints, last: int, n_points: int) -> list[Piece]:
    """Around the marks up to a last row; those that are near each other are one."""
    found: list[Piece] = []
    for mark in marks:
        piece = Piece(max(int(mark) - _AROUND, 1), min(int(mark) + _AROUND, last), n_points)
        if piece.last < piece.first:
            continue
        if found and piece.first - found[-1].last <= _BETWEEN:
            piece = found.pop().with_next(piece)
        found.append(piece)
    return found
