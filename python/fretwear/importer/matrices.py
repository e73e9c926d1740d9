"""Matrices from the files of other programs, read by their maintained readers where there are.

=================  ===========================================  ==============================
format             written by                                   read by
=================  ===========================================  ==============================
op4                Nastran OUTPUT4, binary or text              pyyeti
dmig               Nastran DMIG bulk or punch section           pyyeti
mat                MATLAB up to 7.2; 7.3                        scipy; h5py
matrix_market      many                                         scipy
harwell_boeing     ANSYS HBMAT and others, RUA and RSA          scipy (symmetric: see `ansys`)
full               ANSYS .full                                  `full_file`
abaqus             Abaqus .mtx                                  `abaqus`, no maintained reader
calculix           CalculiX .sti, .mas, .dof                    `calculix`, no maintained reader
=================  ===========================================  ==============================
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse as sp

from ..errors import InputError, OutputError
from .abaqus import read_mtx
from .ansys import read_harwell_boeing
from .calculix import SUFFIXES, read_stored
from .full_file import read_full
from .matlab import read_mat
from .matrix_file import MatrixFile
from .nastran import read_dmig, read_op4

__all__ = ["FORMATS", "read_matrices"]

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
    if ending in SUFFIXES:
        return "calculix"
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


#: Readers by the name of their format.
FORMATS: dict[str, Callable[[Path], MatrixFile]] = {
    "op4": read_op4,
    "dmig": read_dmig,
    "mat": read_mat,
    "matrix_market": _matrix_market,
    "harwell_boeing": read_harwell_boeing,
    "full": read_full,
    "abaqus": read_mtx,
    "calculix": read_stored,
}
