"""ANSYS matrices: Harwell-Boeing files by scipy, .full files by ansys-mapdl-reader.

scipy reads real unsymmetric matrices without right-hand sides (RUA); HBMAT writes symmetric ones
(RSA) and can add the load. So the header is rewritten for scipy, and the triangle mirrored.
"""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import scipy.io
import scipy.sparse as sp

from ..errors import InputError
from .matrix_file import HELD, MatrixFile, mirrored, need

__all__ = ["read_full", "read_harwell_boeing"]

_SYMMETRIC = "RSA"
_ACCEPTED = ("RUA", _SYMMETRIC)


def read_harwell_boeing(path: Path) -> MatrixFile:
    """The matrix of a Harwell-Boeing file; right-hand sides are left out."""
    lines = path.read_text(encoding="latin-1").splitlines()
    if len(lines) < 5:
        raise InputError(f"{path}: has {len(lines)} lines; a Harwell-Boeing file has at least 5")
    kind = lines[2][:3].upper()
    if kind not in _ACCEPTED:
        raise InputError(f"{path}: matrix type '{kind}' is not accepted; expected real assembled "
                         "matrices, RUA or RSA")
    matrix = sp.csr_array(scipy.io.hb_read(io.StringIO(_for_scipy(lines))))
    n_entries = int(lines[2][42:56])
    if matrix.nnz != n_entries:
        raise InputError(f"{path}: holds {matrix.nnz} entries, but its header says {n_entries}")
    notes = []
    if lines[1][56:].strip() not in ("", "0"):
        notes.append(f"{path}: the right-hand side is left out; give loads with --loads")
    return MatrixFile(path, {path.stem.lower(): mirrored(matrix) if kind == _SYMMETRIC
                             else matrix}, notes=notes)


def _for_scipy(lines: list[str]) -> str:
    """The file as RUA without right-hand side, with E exponents and a title and key."""
    counts = [int(lines[1][k:k + 14]) for k in (14, 28, 42)]
    has_right_hand_side = lines[1][56:].strip() not in ("", "0")
    header = [
        f"{lines[0][:72]:<72}{lines[0][72:80].strip() or 'matrix':<8}",
        "".join(f"{value:14d}" for value in (sum(counts), *counts)),
        f"RUA{lines[2][3:70]:<67}",
        lines[3][:52]]
    first = 5 if has_right_hand_side else 4
    values = first + counts[0] + counts[1]
    body = lines[first:values]
    body += [line.upper().replace("D", "E") for line in lines[values:values + counts[2]]]
    header[3] = header[3].upper().replace("D", "E")
    return "\n".join(header + body) + "\n"


def read_full(path: Path) -> MatrixFile:
    """Stiffness (k) and mass (m) of a .full file, with nodes.

    The file has no entries for constrained degrees of freedom; they are marked as held.
    """
    reader = need("ansys.mapdl.reader", "ansys-mapdl-reader", "reading ANSYS .full files",
                  "ansys")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file = reader.read_binary(str(path))
        dofs, stiffness, mass = file.load_km(sort=True)
    labels = [(int(node), int(component) + 1) for node, component in dofs]
    if len(labels) != stiffness.shape[0]:
        raise InputError(f"{path}: {len(labels)} degrees of freedom are named, but the stiffness "
                         f"has {stiffness.shape[0]}")
    constrained = {(int(node), int(component) + 1) for node, component in file.const}
    marks = sp.diags_array([HELD if label in constrained else 0.0 for label in labels])
    return MatrixFile(path, {"k": sp.csr_array(mirrored(stiffness) + marks),
                             "m": mirrored(mass)}, labels)
