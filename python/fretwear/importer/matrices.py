"""Matrices from the files of other programs, read by their maintained readers where there are.

=================  ===========================================  ==============================
format             written by                                   read by
=================  ===========================================  ==============================
op4                Nastran OUTPUT4, binary or text              pyyeti
dmig               Nastran DMIG bulk or punch section           pyyeti
mat                MATLAB up to 7.2; 7.3                        scipy; h5py
matrix_market      many                                         scipy
harwell_boeing     ANSYS HBMAT and others, RUA and RSA          scipy (symmetric: see `ansys`)
full               ANSYS .full                                  ansys-mapdl-reader
abaqus             Abaqus .mtx                                  `abaqus`, no maintained reader
=================  ===========================================  ==============================
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse as sp

from ..errors import InputError, OutputError
from .labels import Label

__all__ = ["FORMATS", "HELD", "MatrixFile", "mirrored", "need", "read_matrices"]

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
    """

    path: Path
    matrices: dict[str, sp.csr_array]
    labels: list[Label] | None = None
    notes: list[str] = field(default_factory=list)


def read_matrices(path: str | Path, format: str | None = None) -> MatrixFile:
    """Read every real matrix of a file.

    Parameters
    ----------
    path : str or Path
        The file.
    format : str, optional
        One of `FORMATS`; found out from the file where not given.

    Raises
    ------
    InputError
        The format is not known, the file does not hold what its format says, or the package that
        reads it is not installed.
    OutputError
        The file cannot be read.
    """
    path = Path(path)
    try:
        with open(path, "rb") as file:
            start = file.read(4096)
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {error.strerror}") from None
    kind = format or _guess(path, start)
    if kind not in FORMATS:
        raise InputError(f"{path}: format '{kind}' is not known; expected one of "
                         + ", ".join(FORMATS))
    try:
        found = FORMATS[kind](path)
    except (InputError, OutputError):
        raise
    except Exception as error:  # readers of other projects raise whatever they meet
        raise InputError(f"{path}: cannot be read as {kind}: {error or type(error).__name__}"
                         ) from error
    if not found.matrices:
        raise InputError(f"{path}: holds no matrix that can be read as {kind}")
    for name, matrix in found.matrices.items():
        if np.iscomplexobj(matrix.data):
            if np.any(matrix.data.imag):
                raise InputError(f"{path}: matrix {name} is complex; real matrices are expected "
                                 "(structural damping goes into modal_damping)")
            found.matrices[name] = sp.csr_array(matrix.real)
    return found


def need(module: str, package: str, purpose: str) -> ModuleType:
    """Import an optional package, or say how to get it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise InputError(f"{purpose} needs the package {package} ({error}); install it with "
                         f"pip install {package}, or use another format") from None


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


def _guess(path: Path, start: bytes) -> str:
    """Format by content, then by the ending of the name."""
    head = start.lstrip().upper()
    ending = path.suffix.lower()
    if head.startswith(b"%%MATRIXMARKET"):
        return "matrix_market"
    if start.startswith(b"MATLAB") or ending == ".mat":
        return "mat"
    if any(line.startswith((b"DMIG", b"$", b"BEGIN BULK")) for line in head.splitlines()[:1]) \
            or ending in (".dmig", ".pch", ".bdf", ".dat"):
        return "dmig"
    if ending in (".op4", ".op2"):
        return "op4"
    if ending == ".mtx":
        return "abaqus"
    if ending == ".full":
        return "full"
    if _is_harwell_boeing(start):
        return "harwell_boeing"
    raise InputError(f"{path}: the format is not recognized; say which with --format: "
                     + ", ".join(FORMATS))


def _is_harwell_boeing(start: bytes) -> bool:
    lines = start.splitlines()
    return len(lines) > 3 and lines[2][:3].upper() in (b"RUA", b"RSA", b"PSA", b"PUA", b"CUA",
                                                       b"CSA", b"RRA", b"RZA")


def _matrix_market(path: Path) -> MatrixFile:
    return MatrixFile(path, {path.stem.lower(): sp.csr_array(scipy.io.mmread(path))})


def _reader(module: str, function: str) -> Callable[[Path], MatrixFile]:
    """A reader of a module that is imported when it is first needed."""
    def read(path: Path) -> MatrixFile:
        found: MatrixFile = getattr(importlib.import_module(module, __package__), function)(path)
        return found
    return read


#: Readers by the name of their format.
FORMATS: dict[str, Callable[[Path], MatrixFile]] = {
    "op4": _reader(".nastran", "read_op4"),
    "dmig": _reader(".nastran", "read_dmig"),
    "mat": _reader(".matlab", "read_mat"),
    "matrix_market": _matrix_market,
    "harwell_boeing": _reader(".ansys", "read_harwell_boeing"),
    "full": _reader(".ansys", "read_full"),
    "abaqus": _reader(".abaqus", "read_mtx"),
}
