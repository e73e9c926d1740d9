"""The blade of a sector: its modes where it stands on the disk held, as rows in which the blades of
a disk may differ (group /mistuning of a model file)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from numpy.typing import NDArray

from ..blade_modes import held_modes, mode_rows
from ..errors import InputError
from ..reduction import Reduction
from .labels import Dofs
from .tables import read_table

if TYPE_CHECKING:
    from .build import FullModel

__all__ = ["BladeNodes", "blade_datasets", "read_blade"]

Floats = NDArray[np.float64]
#: Of stiffness over mass of single degrees of freedom: squares of frequencies of rigid motions are
#: below it by round-off, those of a blade that is held far above.
_FREE = 1e-13


@dataclass(frozen=True)
class BladeNodes:
    """The blade of a sector.

    Attributes
    ----------
    inside : (n,) int
        Degrees of freedom (from 0) of its nodes above the disk.
    n_modes : int
        Modes that are wanted.
    """

    inside: NDArray[np.int64]
    n_modes: int


def read_blade(path: Path, dofs: Dofs, n_modes: int) -> BladeNodes:
    """The nodes of a table or a set, which hang on no others but those where the blade stands.

    Raises
    ------
    InputError
        A node is not there, or there are not that many modes.
    """
    if dofs.labels is None:
        raise InputError("--blade names nodes, but the files name none; give a label table "
                         "(--labels)")
    if not path.is_file() and str(path).upper() in dofs.sets:
        nodes = set(dofs.nodes(str(path), "--blade"))
    else:
        column = read_table(path, ["node", "x", "y", "z"]).numbers("node")
        if column is None:
            raise InputError(f"{path}: expected the column node")
        nodes = set(column.astype(int).tolist())
    inside = np.array([i for i, (node, _) in enumerate(dofs.labels) if node in nodes], dtype=int)
    missing = nodes - {node for node, _ in dofs.labels}
    held = {node for node, _ in dofs.held}
    if missing - held:
        raise InputError(f"{path}: node {min(missing - held)} is not in the matrices")
    if not 0 < n_modes < len(inside):
        raise InputError(f"--blade-modes {n_modes}: must be 1 to {len(inside) - 1}, fewer than the "
                         f"degrees of freedom of the nodes in {path}")
    return BladeNodes(inside, n_modes)


def blade_datasets(model: FullModel, matrices: Mapping[str, sp.csr_array],
                   reduction: Reduction | None) -> dict[str, NDArray[Any]]:
    """Rows, frequencies and matrices of the blade, on the coordinates of a reduction.

    The matrices of all elements do not tell what the elements of the blade have between the nodes
    that it stands on: the blade is taken to follow these without stiffness and mass of its own, by
    K_rb K_bb^-1 K_br and M_rb M_bb^-1 M_br.
    """
    blade = model.blade
    assert blade is not None
    inside, stiffness = blade.inside, matrices["stiffness"]
    coupling = sp.csr_array(stiffness[inside])
    root = np.setdiff1d(np.unique(coupling.indices[coupling.data != 0.0]), inside)
    if len(root) == 0:
        raise InputError("--blade: no node beside those of the blade is joined to it; leave out "
                         "those where it stands on the disk")
    mass = matrices["mass"]
    largest = (np.abs(stiffness.diagonal()[inside]).max()
               / np.abs(mass.diagonal()[inside]).max())
    try:
        squares, shapes = held_modes(stiffness, mass, inside, blade.n_modes)
    except RuntimeError:   # singular to the last bit
        squares = np.zeros(1)
    if squares[0] <= _FREE * largest:
        raise InputError("--blade: its nodes move without strain where all others are held; name "
                         "all nodes between its tip and the disk")
    rows = mode_rows(stiffness, inside, squares, shapes)
    data = {"mistuning/row_omega": np.sqrt(squares)}
    wholes = {f"mistuning/blade_{role}": _followed(matrices[role], inside)
              for role in ("stiffness", "mass")}
    if reduction is None:
        return data | {"mistuning/rows": rows.toarray()} | {
            name: whole.toarray() for name, whole in wholes.items()}
    return data | {"mistuning/rows": reduction.row(rows)} | {
        name: reduction.matrix(whole) for name, whole in wholes.items()}


def _followed(matrix: sp.csr_array, inside: NDArray[np.int64]) -> sp.csr_array:
    """The part of some degrees of freedom, semidefinite: A_:b A_bb^-1 A_b:."""
    own, across = sp.csc_matrix(matrix[inside][:, inside]), sp.csr_array(matrix[inside])
    root = np.setdiff1d(np.unique(across.indices[across.data != 0.0]), inside)
    to_root = across[:, root]
    corner = to_root.T @ spl.splu(own).solve(to_root.toarray()) if len(root) else np.zeros((0, 0))
    n = matrix.shape[0]
    places = np.concatenate((inside, root))
    whole = sp.block_array([[own, to_root], [to_root.T, sp.csr_array(0.5 * (corner + corner.T))]]
                           if len(root) else [[own]], format="coo")
    found = sp.csr_array((whole.data, (places[whole.row], places[whole.col])), (n, n))
    return sp.csr_array(0.5 * (found + found.T))
