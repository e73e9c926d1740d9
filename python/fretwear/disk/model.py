"""Full and reduced model of one sector of the shrouded disk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from ..errors import InputError
from ..reduction import ReducedSystem, reduce
from ..sector.assembly import Assembly
from .mesh import DiskMesh, build_mesh
from .parameters import DiskParameters, ParameterError
from .rows import Patches, held_nodes, interface_rows, patch_rows, point_row

__all__ = ["FullDisk", "ReducedDisk", "build_full", "generate", "reduce_disk", "reduced_system"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FullDisk:
    """Finite-element model of a sector on its free degrees of freedom.

    Attributes
    ----------
    sector : DiskMesh
        The mesh.
    free : (n,) int
        Numbers 3 * node + component of the free degrees of freedom.
    mass, stiffness, rotation : (n, n) sparse
        [tonne], [N/mm] and [N/mm per (rad/s)^2]: stress stiffening by the centrifugal stress, of
        which all sectors have the same, and spin softening.
    centrifugal : (n,)
        Centrifugal load [N per (rad/s)^2].
    rows : (n_rows, n) sparse
        What the reduction keeps: both interfaces, patches of both shroud faces, load point, tip.
    n_interface : int
        Degrees of freedom of an interface.
    patches : Patches
        Of the shroud, on all degrees of freedom.
    """

    parameters: DiskParameters
    sector: DiskMesh
    free: NDArray[np.int64]
    mass: sp.csr_array
    stiffness: sp.csr_array
    rotation: sp.csr_array
    centrifugal: Floats
    rows: sp.csr_array
    n_interface: int
    patches: Patches


@dataclass(frozen=True)
class ReducedDisk:
    """Reduced sector: interfaces, patches, load point and tip as they are, then modes.

    Attributes
    ----------
    mass, stiffness, stiffness_rotation : (n, n)
        [tonne], [N/mm], [N/mm per (rad/s)^2]; modal coordinates are mass-normalised.
    static_rotation : (n,)
        Centrifugal load [N per (rad/s)^2].
    left, right : (n_interface,) int
        Degrees of freedom of both interfaces, from 1.
    side_1, side_2 : (n_patches, 3) int
        Degrees of freedom of the pairs: of this sector, and of the next.
    area, position : (n_patches,), (n_patches, 3)
        [mm^2], [mm].
    load_point, tip : int
        Degrees of freedom of the circumferential displacements there, from 1.
    """

    parameters: DiskParameters
    mass: Floats
    stiffness: Floats
    stiffness_rotation: Floats
    static_rotation: Floats
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    side_1: NDArray[np.int32]
    side_2: NDArray[np.int32]
    area: Floats
    position: Floats
    load_point: int
    tip: int

    def frequencies(self, nodal_diameter: int, *, closed: bool = False, speed: float = 0.0,
                    n: int = 4) -> Floats:
        """Lowest natural frequencies [Hz] of a nodal diameter, shrouds apart or held by springs.

        Parameters
        ----------
        nodal_diameter : int
            Of the wave that all sectors make.
        closed : bool
            Whether the contact stiffness holds every pair.
        speed : float
            Rotation speed [rad/s].
        n : int
            How many.
        """
        z = np.exp(-2j * np.pi * nodal_diameter / self.parameters.n_sectors)
        size = len(self.mass)
        kept = np.setdiff1d(np.arange(size), self.right - 1)
        tie = np.zeros((size, len(kept)), dtype=complex)
        tie[kept, np.arange(len(kept))] = 1.0
        tie[self.right - 1, np.searchsorted(kept, self.left - 1)] = z
        stiffness = (self.stiffness + speed**2 * self.stiffness_rotation).astype(complex)
        if closed:
            for area, one, two in zip(self.area, self.side_1, self.side_2):
                for a, b in zip(one - 1, two - 1):
                    row = np.zeros(size, dtype=complex)
                    row[a], row[b] = 1.0, -z
                    stiffness += self.parameters.contact_stiffness * area * np.outer(
                        row.conj(), row)
        squares = la.eigh(tie.conj().T @ stiffness @ tie, tie.conj().T @ self.mass @ tie,
                          eigvals_only=True, subset_by_index=[0, n - 1])
        return np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi)


def build_full(parameters: DiskParameters) -> FullDisk:
    """Mesh and assemble the sector."""
    sector = build_mesh(parameters)
    assembly = Assembly(sector.mesh, parameters.material)
    free = np.flatnonzero(np.repeat(~held_nodes(assembly, parameters), 3))
    interface, patches = interface_rows(assembly, parameters), patch_rows(assembly, parameters)
    p = parameters
    height = p.rim_radius + p.load_height * (p.shroud_radius - p.rim_radius)
    rows = sp.csr_array(sp.vstack([interface, patches.rows, point_row(assembly, p, height),
                                   point_row(assembly, p, p.shroud_radius)])[:, free])

    def restrict(matrix: sp.csr_array) -> sp.csr_array:
        return sp.csr_array(matrix[free][:, free])

    scalar_mass = assembly.scalar_mass()
    stiffness = restrict(assembly.stiffness())
    in_plane = np.array([1.0, 1.0, 0.0])
    centrifugal = ((scalar_mass @ assembly.nodes.T) * in_plane).ravel()[free]
    static = np.zeros(3 * assembly.n_nodes)
    static[free] = _in_phase(stiffness, rows, interface.shape[0] // 2, centrifugal)
    rotation = restrict(assembly.geometric_stiffness(static)
                        - sp.kron(scalar_mass, sp.diags_array(in_plane)))
    mass = restrict(sp.csr_array(sp.kron(scalar_mass, sp.identity(3))))
    return FullDisk(parameters, sector, free, mass, stiffness, rotation, centrifugal, rows,
                    interface.shape[0] // 2, patches)


def _in_phase(stiffness: sp.csr_array, rows: sp.csr_array, n_interface: int,
              load: Floats) -> Floats:
    """Static displacement where all sectors do the same: right interfaces follow left ones."""
    tie = sp.csr_array(rows[:n_interface] - rows[n_interface:2 * n_interface])
    whole = sp.csc_matrix(sp.block_array([[stiffness, tie.T], [tie, None]]))
    right = np.concatenate((load, np.zeros(n_interface)))
    found: Floats = sp.linalg.spsolve(whole, right)[:len(load)]
    return found


def reduced_system(full: FullDisk) -> ReducedSystem:
    """The kept displacements and modes with all of them held."""
    try:
        return reduce(full.mass, full.stiffness, full.rows, n_modes=full.parameters.n_modes,
                      loads=full.centrifugal, attachments=np.empty((len(full.free), 0)))
    except InputError as error:
        raise ParameterError(f"DiskParameters: {error}") from None


def reduce_disk(full: FullDisk, system: ReducedSystem | None = None) -> ReducedDisk:
    """Reduce to the coordinates of `reduced_system`, which need not be found again."""
    system = reduced_system(full) if system is None else system
    n, p = full.n_interface, full.parameters
    sides = 2 * n + 1 + np.arange(6 * p.n_patches, dtype=np.int32).reshape(2, p.n_patches, 3)
    last = full.rows.shape[0]
    return ReducedDisk(
        p, system.mass, system.stiffness, system.reduction.matrix(full.rotation),
        system.loads[:, 0], np.arange(1, n + 1, dtype=np.int32),
        np.arange(n + 1, 2 * n + 1, dtype=np.int32), sides[0], sides[1], full.patches.area,
        full.patches.position, last - 1, last)


def generate(parameters: DiskParameters | None = None) -> ReducedDisk:
    """Reduced sector with the given parameters (the defaults without any)."""
    return reduce_disk(build_full(parameters or DiskParameters()))
