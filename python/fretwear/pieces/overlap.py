"""What a worker gives of its piece, and whether two pieces agree where both have solved."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import h5py
import numpy as np
from numpy.typing import NDArray

from .cutting import Piece

__all__ = ["Part", "agree", "tolerance_of"]

Floats = NDArray[np.float64]

#: Difference of two solutions, relative to the largest of the rows, that is none: the tolerance of
#: the solver times what a resonance may make of it.
_SAME, _AMPLIFIED = 1e-5, 1e3
#: Values below this part of the largest one are round-off.
_NOTHING = 1e-9


@dataclass(frozen=True)
class Part:
    """The result of a piece.

    Attributes
    ----------
    piece : Piece
        What it is of.
    image : bytes
        What a result file would hold.
    was_stopped : bool
        Whether it has not come to its end.
    seconds : tuple of float
        When it was begun and when it ended, by the clock of its worker.
    """

    piece: Piece
    image: bytes
    was_stopped: bool
    seconds: tuple[float, float]

    @contextmanager
    def open(self) -> Iterator[h5py.File]:
        """The file, for reading."""
        with h5py.File(h5py.h5f.open_file_image(self.image)) as file:
            yield file

    @cached_property
    def places(self) -> Floats:
        """Of its rows, [rad/s] or values of the parameter."""
        with self.open() as file:
            return np.asarray(file["parameter" if "parameter" in file else "omega"][()])

    @cached_property
    def solutions(self) -> tuple[NDArray[np.bool_], list[Floats]]:
        """Which rows converged, and what two solutions are told apart by."""
        with self.open() as file:
            found = [file["coefficients"][()]]
            # Points with as many harmonics as they need leave out what differs from row to row.
            if "contact/force" in file and "harmonics" not in file:
                found.append(file["contact/force"][()])
            return file["converged"][()].astype(bool), found


def tolerance_of(values: dict[str, list[str]]) -> float:
    """How far two solutions of one point may differ.

    Parameters
    ----------
    values : dict
        The effective case, by "group%key".
    """
    def word(key: str) -> str:
        return (next(iter(values.get(key, [])), "") or "0").lower()

    def real(key: str) -> float:
        return float(word(key).replace("d", "e"))

    # With an accuracy the harmonics of a point depend on those before: twice what each may be off.
    return max(_SAME, _AMPLIFIED * real("solver%tolerance"), 2.0 * real("harmonics%accuracy"))


def agree(one: Part, other: Part) -> float:
    """Largest difference of two parts in the rows of both, relative to the largest value there.

    Infinite where one of them has a solution and the other has none, or nothing can be compared.
    """
    _, here, there = np.intersect1d(one.places, other.places, return_indices=True)
    (converged, values), (converged_too, others) = one.solutions, other.solutions
    if (converged[here] != converged_too[there]).any():
        return np.inf
    both = converged[here]
    if not both.any():
        return np.inf
    here, there = here[both], there[both]
    largest = 0.0
    for value, another in zip(values, others):
        # Of every observed quantity (the last index), as their units may differ; forces together.
        axes = (0, 1) if value.ndim == 3 else None
        size = np.atleast_1d(np.abs(value[here]).max(axis=axes))
        size = np.maximum(size, _NOTHING * np.max(size, initial=0.0))
        difference = np.atleast_1d(np.abs(value[here] - another[there]).max(axis=axes))
        ratio = np.divide(difference, size, out=np.zeros_like(difference), where=size > 0.0)
        largest = max(largest, float(np.max(ratio, initial=0.0)))
    return largest
