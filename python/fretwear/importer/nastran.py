"""Nastran OUTPUT4 files and DMIG sections, read by pyyeti."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from .labels import Label
from .matrix_file import MatrixFile, mirrored, need, one_triangle

__all__ = ["read_dmig", "read_op4"]

_SQUARE, _SYMMETRIC = 1, 6  # matrix forms of Nastran


def read_op4(path: Path) -> MatrixFile:
    """Matrices of an OUTPUT4 file, binary or text, dense or sparse; they name no nodes."""
    op4 = need("pyyeti.nastran.op4", "pyyeti", "reading Nastran OP4 files")
    matrices, notes = {}, []
    for name, (matrix, form, _) in op4.load(str(path), into="dct", sparse=True).items():
        found = sp.csr_array(matrix)
        if form == _SYMMETRIC and one_triangle(found):
            found = mirrored(found)
            notes.append(f"{path}: {name} holds one triangle of a symmetric matrix; mirrored")
        matrices[name.lower()] = found
    return MatrixFile(path, matrices, notes=notes)


def read_dmig(path: Path) -> MatrixFile:
    """Matrices of a DMIG section, on the union of their grid components in ascending order."""
    bulk = need("pyyeti.nastran.bulk", "pyyeti", "reading Nastran DMIG sections")
    frames = {name: frame for name, frame in bulk.rddmig(str(path), square=True).items()
              if frame.columns.nlevels == 2}
    if not frames:
        raise InputError(f"{path}: holds no square DMIG matrix")
    labels = sorted({label for frame in frames.values()
                     for label in [*_labels(frame.index), *_labels(frame.columns)]})
    place = {label: i for i, label in enumerate(labels)}
    return MatrixFile(path, {name.lower(): _spread(frame, place)
                             for name, frame in frames.items()}, labels)


def _labels(index: Any) -> list[Label]:
    return [(int(node), int(component)) for node, component in index]


def _spread(frame: Any, place: dict[Label, int]) -> sp.csr_array:
    """A frame on the common degrees of freedom."""
    rows = np.array([place[label] for label in _labels(frame.index)])
    columns = np.array([place[label] for label in _labels(frame.columns)])
    block = sp.coo_array(frame.to_numpy())
    return sp.csr_array((block.data, (rows[block.row], columns[block.col])), (len(place),) * 2)
