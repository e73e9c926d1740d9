"""MATLAB files: up to version 7.2 by scipy, version 7.3 (HDF5) by h5py."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io
import scipy.sparse as sp

from .matrix_file import MatrixFile

__all__ = ["read_mat"]


def read_mat(path: Path) -> MatrixFile:
    """Numeric arrays of a .mat file; fields of structures are called structure.field."""
    if h5py.is_hdf5(path):
        with h5py.File(path, "r") as file:
            return MatrixFile(path, dict(_arrays_of_hdf5(file, "")))
    variables = scipy.io.loadmat(path, simplify_cells=True)
    return MatrixFile(path, dict(_arrays(variables, "")))


def _arrays(variables: dict[str, Any], prefix: str) -> Iterator[tuple[str, sp.csr_array]]:
    for name, value in variables.items():
        full = f"{prefix}{name}".lower()
        if isinstance(value, dict):
            yield from _arrays(value, full + ".")
        elif sp.issparse(value):
            yield full, sp.csr_array(value)
        elif not name.startswith("__") and np.asarray(value).dtype.kind in "fciu":
            # simplify_cells takes away the dimension of a column
            array = np.asarray(value)
            yield full, sp.csr_array(array.reshape(len(array), -1) if array.ndim else [[value]])


def _arrays_of_hdf5(group: h5py.Group, prefix: str) -> Iterator[tuple[str, sp.csr_array]]:
    for name, item in group.items():
        full = f"{prefix}{name}".lower()
        if name.startswith("#"):  # what cells and strings refer to
            continue
        if isinstance(item, h5py.Group):
            if "MATLAB_sparse" in item.attrs:
                yield full, _sparse(item)
            else:
                yield from _arrays_of_hdf5(item, full + ".")
        elif "MATLAB_empty" not in item.attrs and item.dtype.kind in "fciu" and item.ndim == 2:
            yield full, sp.csr_array(item[()].T)  # MATLAB counts the first index fastest


def _sparse(group: h5py.Group) -> sp.csr_array:
    """A compressed column matrix; the attribute is its number of rows."""
    n_rows, n_columns = int(group.attrs["MATLAB_sparse"]), len(group["jc"]) - 1
    if "data" not in group:  # no entries
        return sp.csr_array((n_rows, n_columns))
    parts = (group["data"][()], group["ir"][()].astype(np.int64), group["jc"][()].astype(np.int64))
    return sp.csr_array(sp.csc_array(parts, (n_rows, n_columns)))
