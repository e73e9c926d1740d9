"""ANSYS matrices: Harwell-Boeing files, by scipy.

scipy reads real unsymmetric matrices without right-hand sides (RUA); HBMAT writes symmetric ones
(RSA) and can add the load. So the header is rewritten for scipy, and the triangle mirrored.
"""

from __future__ import annotations

import io
from pathlib import Path

import scipy.io
import scipy.sparse as sp

from ..errors import InputError
from .matrix_file import MatrixFile, mirrored

__all__ = ["read_harwell_boeing"]

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
