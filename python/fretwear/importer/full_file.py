"""Assembled matrices of ANSYS (.full): symmetric and unsymmetric, with consistent and lumped mass.

A file is a row of records: number of 4-byte words, flags, values, number again; pointers count
words. Matrices are stored row by row, two records each: numbers of equations, and values. A
symmetric one has a triangle of each row, an unsymmetric one the whole row. A lumped mass is one
record with a value for each equation, or rows of one value.
Source: Ansys Programmer's Reference, "Description of the Full Stiffness-Mass File" (fdfull), and
the file that ansys-mapdl-reader ships.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..errors import InputError
from .labels import Label
from .matrix_file import HELD, MatrixFile, mirrored

__all__ = ["read_full"]

#: Place of the header [words]: behind the standard header of 100 items.
_HEADER = 103
#: Items of the header, from 0; pointers and counts are two words each, the low one first.
_KIND, _N, _LUMPED, _UNSYMMETRIC, _N_NODES = 0, 1, 10, 13, 32
_STIFFNESS, _MASS, _DAMPING, _DOFS = (18, 19), (26, 27), (28, 29), (35, 36)
_TERMS = {"k": (8, 9), "m": (33, 21), "c": (34, 39)}
#: Bits of the flags of a record: integers, half as long, compressed in some way.
_INTEGER, _HALF, _PACKED = 1 << 31, 1 << 30, 0x3C000000
#: Components of displacement are 1 to 6; others are temperatures, voltages and so on.
_LAST = 6


def read_full(path: Path) -> MatrixFile:
    """Stiffness (k), mass (m) and damping (c) of a .full file, with nodes.

    Constrained degrees of freedom are marked as held.

    Raises
    ------
    InputError
        The file is not laid out as its header says, or holds other than displacements.
    """
    file = _Full(path)
    labels, held = file.labels()
    matrices: dict[str, sp.csr_array] = {}
    for name, pointer in (("k", _STIFFNESS), ("m", _MASS), ("c", _DAMPING)):
        if file.long(pointer):
            matrices[name] = file.matrix(name, pointer)
    if "k" not in matrices:
        raise InputError(f"{path}: holds no stiffness")
    order = np.array(sorted(range(len(labels)), key=lambda k: labels[k]), dtype=np.int64)
    marks = np.where(held[order], HELD, 0.0)
    free = sp.diags_array((~held[order]).astype(float))
    # What is stored for held ones, 1 on the diagonal, has no meaning.
    sorted_ = {name: sp.csr_array(free @ matrix[order][:, order] @ free)
               for name, matrix in matrices.items()}
    sorted_["k"] = sp.csr_array(sorted_["k"] + sp.diags_array(marks))
    notes = [f"{path}: the mass is lumped"] if file.lumped else []
    return MatrixFile(path, sorted_, [labels[k] for k in order], notes,
                      unsymmetric=frozenset(matrices) if file.unsymmetric else frozenset())


class _Full:
    def __init__(self, path: Path) -> None:
        self.path = path
        data = path.read_bytes()
        self.words = np.frombuffer(data, dtype="<i4", count=len(data) // 4)
        self.header, _ = self.record(_HEADER)
        if len(self.header) < 40 or self.header[_KIND] >= 0:
            raise InputError(f"{path}: is no .full file of a symbolic assembly; write it by an "
                             "analysis with the sparse, PCG or Block Lanczos solver")
        self.n = int(self.header[_N])
        self.lumped = bool(self.header[_LUMPED])
        self.unsymmetric = bool(self.header[_UNSYMMETRIC])

    def long(self, items: tuple[int, int]) -> int:
        """A count or pointer of two words."""
        low, high = (int(self.header[k]) & 0xFFFFFFFF for k in items)
        return low + (high << 32)

    def record(self, place: int) -> tuple[NDArray[Any], int]:
        """Values of a record and where the next one begins."""
        if not 0 <= place < len(self.words) - 2:
            raise self._broken("ends within its records")
        n, flags = int(self.words[place]), int(self.words[place + 1]) & 0xFFFFFFFF
        after = place + n + 3
        if n < 0 or after > len(self.words) or int(self.words[after - 1]) != n:
            raise self._broken(f"has no record at word {place}")
        if flags & _PACKED:
            raise self._broken("holds compressed records; write it without (/FCOMP,FULL,0)")
        kind = {(True, False): "<i4", (True, True): "<i2", (False, False): "<f8",
                (False, True): "<f4"}[bool(flags & _INTEGER), bool(flags & _HALF)]
        return np.frombuffer(self.words[place + 2:after - 1].tobytes(), dtype=kind), after

    def records(self, place: int) -> Iterator[NDArray[Any]]:
        """One record after the other."""
        while True:
            values, place = self.record(place)
            yield values

    def labels(self) -> tuple[list[Label], NDArray[np.bool_]]:
        """Node and component of each equation, and whether it is constrained."""
        _, after = self.record(_HEADER)
        _, after = self.record(after)   # components that the model has
        nodes, _ = self.record(after)
        stored = self.records(self.long(_DOFS))
        count, component = next(stored), next(stored)
        if len(nodes) != len(count) or count.sum() != self.n or len(component) != self.n:
            raise self._broken(f"names {int(count.sum())} degrees of freedom of {len(nodes)} "
                               f"nodes, where its header says {self.n}")
        kinds = np.abs(component.astype(np.int64))
        if kinds.min(initial=1) < 1 or kinds.max(initial=1) > _LAST:
            strange = int(kinds[(kinds < 1) | (kinds > _LAST)][0])
            raise InputError(f"{self.path}: has degrees of freedom of kind {strange}; expected "
                             "displacements and rotations, 1 to 6")
        return (list(zip(np.repeat(nodes, count).tolist(), kinds.tolist())), component < 0)

    def matrix(self, name: str, pointer: tuple[int, int]) -> sp.csr_array:
        """A matrix by rows, or the diagonal of a lumped mass."""
        stored = self.records(self.long(pointer))
        first = next(stored)
        if first.dtype.kind == "f":
            if len(first) != self.n:
                raise self._broken(f"has a diagonal of {len(first)} values for {self.n} equations")
            return sp.csr_array(sp.diags_array(first.astype(float)))
        columns, values = [first], [next(stored)]
        for _ in range(self.n - 1):
            columns.append(next(stored))
            values.append(next(stored))
        for number, (own, value) in enumerate(zip(columns, values), 1):
            if own.dtype.kind == "f" or value.dtype.kind != "f" or len(own) != len(value):
                raise self._broken(f"has no row {number} of matrix {name}: numbers of equations, "
                                   "then as many values")
        counts = [len(own) for own in columns]
        column = np.concatenate(columns).astype(np.int64) - 1
        n_terms = self.long(_TERMS[name])
        if n_terms not in (0, len(column)):
            raise self._broken(f"has {len(column)} values of matrix {name}, where its header says "
                               f"{n_terms}")
        if column.min(initial=0) < 0 or column.max(initial=0) >= self.n:
            raise self._broken(f"names equation {int(column.max()) + 1} of {self.n}")
        row = np.repeat(np.arange(self.n), counts)
        matrix = sp.csr_array((np.concatenate(values).astype(float), (row, column)),
                              (self.n, self.n))
        if self.unsymmetric:
            return matrix
        if (row > column).any() and (row < column).any():
            raise self._broken(f"has both triangles of matrix {name}, where its header says that "
                               "it is symmetric")
        return mirrored(matrix)

    def _broken(self, text: str) -> InputError:
        return InputError(f"{self.path}: {text}; use HBMAT in its place")
