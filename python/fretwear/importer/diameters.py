"""One sector of a cyclic structure, reduced on its own in every nodal diameter.

In nodal diameter K the right interface moves as the left one times z = exp(-2 pi i K/N), so that
u = T_K v with v the other degrees of freedom. Kept are the relative displacements of the pairs,
rows B_K = (S_1 - z**sector_2 S_2) T_K, and modes with all of them held: far fewer coordinates than
both interfaces have, and another basis for each nodal diameter.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..errors import InputError
from ..reduction import reduce
from ..sectors import NodalDiameter, Sectors
from .accuracy import Accuracy, mode_options, range_datasets
from .sectors import Interfaces, tie
from .tables import rows_by_sector

if TYPE_CHECKING:
    from .build import FullModel

__all__ = ["reduce_diameters"]


def reduce_diameters(model: FullModel, matrices: Mapping[str, sp.csr_array],
                     n_modes: int | Accuracy,
                     observed: sp.csr_array,
                     engine: str = "auto") -> tuple[Sectors, dict[str, NDArray[Any]]]:
    """Matrices of all nodal diameters, and the datasets of the pairs.

    Parameters
    ----------
    model : FullModel
        A sector with its interfaces and pairs.
    matrices : mapping of role to sparse array
        Symmetric.
    n_modes : int or Accuracy
        Modes of each nodal diameter, with every pair stuck.
    observed : (n_observed, n) sparse array
        Rows of the observed quantities.
    engine : str
        Who factors.
    """
    interfaces, pairs = model.interfaces, model.pairs
    if interfaces is None:
        raise InputError("--by-diameter goes with --sectors")
    if pairs is None:
        raise InputError("--by-diameter needs contact pairs (--pairs): it keeps their relative "
                         "displacements")
    one, two, number, sector = rows_by_sector(pairs, model.dofs.n)
    found, errors = {}, []
    for k in range(interfaces.n_sectors // 2 + 1):
        turns = factor(interfaces.n_sectors, k, sector)
        rows = sp.csr_array(one - sp.diags_array(turns) @ two)
        try:
            found[k], error = _diameter(model, matrices, interfaces, k, rows, n_modes,
                                         observed, engine)
            errors.append(error)
        except InputError as error:
            raise InputError(f"nodal diameter {k}: {error}") from None
    data: dict[str, NDArray[Any]] = {"contact/side_1": number.astype(np.int32)}
    data["contact/side_2"] = np.zeros_like(data["contact/side_1"])
    if isinstance(n_modes, Accuracy):
        data |= range_datasets(2.0 * np.pi * n_modes.up_to,
                               max(error for error in errors if error is not None))
    return Sectors(interfaces.n_sectors, diameters=found, n_physical=one.shape[0]), data


def factor(n_sectors: int, k: int, sectors: NDArray[Any]) -> NDArray[Any]:
    """exp(-2 pi i k sectors/N); real where all are."""
    if 2 * k % n_sectors == 0:
        return np.where(2 * k // n_sectors * sectors % 2 == 0, 1.0, -1.0)
    return np.exp(-2j * np.pi * k * sectors / n_sectors)


def _diameter(model: FullModel, matrices: Mapping[str, sp.csr_array], interfaces: Interfaces,
              k: int, rows: sp.csr_array, n_modes: int | Accuracy, observed: sp.csr_array,
              engine: str) -> tuple[NodalDiameter, float | None]:
    ties = tie(interfaces, model.dofs.n, factor(interfaces.n_sectors, k, np.array([1]))[0])
    back = sp.csr_array(ties.conj().T)
    tied = {role: sp.csr_array(back @ matrix @ ties) for role, matrix in matrices.items()}
    loads = {name: back @ load for name, load in model.loads.items()}
    columns = np.column_stack([*loads.values(), np.zeros((back.shape[0], 0))])
    seen = sp.csr_array(observed @ ties)
    system = reduce(tied["mass"], tied["stiffness"], rows @ ties, **mode_options(n_modes),
                    damping=tied.get("damping"), loads=columns, factor=engine,
                    attachments=np.column_stack((columns, seen.conj().T.toarray())))
    speed = tied.get("stiffness_rotation")
    return (NodalDiameter(
        system.mass, system.stiffness, system.damping,
        None if speed is None else system.reduction.matrix(speed),
        **{name: system.loads[:, i] for i, name in enumerate(loads)},
        observe=dict(zip(model.observe, system.reduction.row(seen))) if model.observe else None),
        system.error)
