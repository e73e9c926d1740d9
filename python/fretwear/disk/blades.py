"""The blade of a sector alone, held where it stands on the disk: its modes as rows of the sector,
and its matrices, in which the blades of a disk may differ (group /mistuning of a model file)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..blade_modes import held_modes, mode_rows
from ..reduction import Reduction
from ..sector.assembly import Assembly
from .mesh import DISK
from .model import FullDisk
from .parameters import ParameterError

__all__ = ["Blade", "BladeModes", "blade_modes", "find_blade"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Blade:
    """The blade with its shroud, on the coordinates of the reduced sector.

    Attributes
    ----------
    rows : (n_modes, n)
        W = Lambda^-1 Phi^T [K_bb K_br]: the motion of the blade modes beside what the root makes of
        the blade [tonne^0.5 mm]. Phi^T M_bb would count the motion of the root too.
    omega : (n_modes,)
        Circular frequencies of these modes, the root held [rad/s].
    stiffness, mass : (n, n)
        Of the elements of the blade [N/mm], [tonne].

    Notes
    -----
    Component mode mistuning: Lim, Bladh, Castanier, Pierre, AIAA Journal 45 (2007), 2285-2298.
    """

    rows: Floats
    omega: Floats
    stiffness: Floats
    mass: Floats

    def datasets(self) -> dict[str, Floats]:
        """As a model file has them."""
        return {"mistuning/rows": self.rows, "mistuning/row_omega": self.omega,
                "mistuning/blade_stiffness": self.stiffness, "mistuning/blade_mass": self.mass}


@dataclass(frozen=True)
class BladeModes:
    """The blade on the free degrees of freedom of the sector: those off the disk, the eigenvalues
    and shapes (n_inside, n_modes) of mass 1 with the root held, its stiffness and mass (n, n)."""

    inside: NDArray[np.intp]
    squares: Floats
    shapes: Floats
    stiffness: sp.csr_array
    mass: sp.csr_array


def find_blade(full: FullDisk, reduction: Reduction, n_modes: int) -> Blade:
    """Blade modes of a sector, and its matrices in the coordinates of a reduction; errors are those
    of `blade_modes`."""
    modes = blade_modes(full, n_modes)
    rows = mode_rows(modes.stiffness, modes.inside, modes.squares, modes.shapes)
    return Blade(reduction.row(rows), np.sqrt(modes.squares), reduction.matrix(modes.stiffness),
                 reduction.matrix(modes.mass))


def blade_modes(full: FullDisk, n_modes: int) -> BladeModes:
    """Lowest modes of the blade with its shroud, held where it stands on the disk.

    Raises
    ------
    ParameterError
        The blade has fewer degrees of freedom than modes are wanted.
    """
    assembly = Assembly(full.sector.mesh, full.parameters.material)
    of_blade = full.sector.body != DISK
    stiffness = sp.csr_array(assembly.stiffness(of_blade)[full.free][:, full.free])
    mass = sp.csr_array(sp.kron(assembly.scalar_mass(of_blade), sp.identity(3))[
        full.free][:, full.free])
    on_disk = np.unique(assembly.cell_nodes[~of_blade])
    above = np.setdiff1d(np.unique(assembly.cell_nodes[of_blade]), on_disk)
    inside = np.flatnonzero(np.isin(full.free // 3, above))
    if not 0 < n_modes < len(inside):
        raise ParameterError(f"blade modes = {n_modes}: is not accepted; expected 1 to "
                             f"{len(inside) - 1}")
    squares, shapes = held_modes(stiffness, mass, inside, n_modes)
    return BladeModes(inside, squares, shapes, stiffness, mass)
