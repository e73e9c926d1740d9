"""Matrices of one file, and what all readers of such files share."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from .labels import Label

__all__ = ["HELD", "MatrixFile", "mirrored", "need", "one_triangle"]

#: A diagonal stiffness from which a degree of freedom counts as held: Abaqus writes 1e36.
HELD = 1e30


@dataclass(frozen=True)
class MatrixFile:
    """Matrices of one file.

    Attributes
    ----------
    path : Path
        The file.
    matrices : dict of str to sparse array
        By their names in the file, in lower case.
    labels : list of (node, component), optional
        Of the rows of every square matrix, where the file names them.
    notes : list of str
        What the reader has done that the user should know.
    unsymmetric : set of str
        Matrices that the file says to be unsymmetric.
    """

    path: Path
    matrices: dict[str, sp.csr_array]
    labels: list[Label] | None = None
    notes: list[str] = field(default_factory=list)
    unsymmetric: frozenset[str] = frozenset()


def need(module: str, package: str, purpose: str, extra: str = "import") -> ModuleType:
    """Import an optional package, or say how to get it; `extra` of this package brings it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise InputError(f"{purpose} needs the package {package} ({error}); install it with "
                         f"pip install {package} or 'fretwear[{extra}]', or use another "
                         "format") from None


def mirrored(matrix: Any) -> sp.csr_array:
    """The full symmetric matrix of which one triangle is stored."""
    full = sp.coo_array(matrix)
    off = full.row != full.col
    row, col = np.concatenate((full.row, full.col[off])), np.concatenate((full.col, full.row[off]))
    return sp.csr_array((np.concatenate((full.data, full.data[off])), (row, col)), full.shape)


def one_triangle(matrix: sp.csr_array) -> bool:
    """Whether entries stand on one side of the diagonal only."""
    return (matrix.shape[0] == matrix.shape[1]
            and bool(sp.tril(matrix, -1).nnz) != bool(sp.triu(matrix, 1).nnz))
