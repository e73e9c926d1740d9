"""Full and reduced model of the bladed-disk sector."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..errors import InputError
from ..reduction import Bonded, Progress, ReducedSystem, reduce
from .assembly import Assembly
from .contact import ContactRows, Tip, contact_rows, held_nodes, retention_row, tip_rows
from .mesh import SectorMesh, build_mesh
from .parameters import ParameterError, SectorParameters

__all__ = ["FullModel", "ReducedModel", "build_full", "generate", "needs", "observed_rows",
           "reduce_model", "reduced_system"]

Floats = NDArray[np.float64]
#: Entries of the factors of a sector of so many degrees of freedom, how they grow with these, and
#: bytes of each: value and row, once in SuperLU and once as SciPy hands them out for the pivots.
_FACTORS, _ORDER, _GROWTH, _BYTES = 22.1e6, 28050.0, 1.62, 24.0
#: Time of these factors [s], how it grows, and operations a second of the solutions with them.
_SECONDS, _SLOWER, _RATE = 6.8, 2.2, 2.0e9


@dataclass(frozen=True)
class FullModel:
    """Finite-element model on its free degrees of freedom, before the reduction.

    Attributes
    ----------
    sector : SectorMesh
        The mesh.
    free : (n,) int
        Numbers 3 * node + component of the free degrees of freedom.
    mass, stiffness, rotation : (n, n) sparse
        [tonne], [N/mm] and [N/mm per (rad/s)^2]; the stiffness has that of the axial lock in it,
        where there is one; rotation is stress stiffening by the centrifugal
        stress of the bonded structure plus spin softening. Gyroscopic terms are left out: the
        motion of a stiff blade is nearly normal to the plane in which they act.
    contact : (3 n_pairs, n) sparse
        B on the free degrees of freedom.
    centrifugal : (n,)
        Centrifugal load [N per (rad/s)^2].
    tip_force : (n,)
        Unit force at the tip [N] and, as a row, the displacement it works on.
    rows : ContactRows
        Geometry of the pairs, and B on all degrees of freedom.
    tip : Tip
        Tip averages on all degrees of freedom.
    bonded : Bonded
        Factored structure.
    """

    parameters: SectorParameters
    sector: SectorMesh
    free: NDArray[np.int64]
    mass: sp.csr_array
    stiffness: sp.csr_array
    rotation: sp.csr_array
    contact: sp.csr_array
    centrifugal: Floats
    tip_force: Floats
    rows: ContactRows
    tip: Tip
    bonded: Bonded


@dataclass(frozen=True)
class ReducedModel:
    """Reduced model in q = (u_r, eta): 3 contact coordinates per pair (t1, t2, n), then modes.

    Attributes
    ----------
    mass, stiffness, stiffness_rotation : (n, n)
        [tonne], [N/mm], [N/mm per (rad/s)^2] for the contact part; modal coordinates are
        mass-normalised.
    static_rotation : (n,)
        Centrifugal load [N per (rad/s)^2].
    cosine : (n,)
        Unit harmonic force at the tip [N].
    observe_name, observe_matrix : (n_observed,), (n_observed, n)
        Tip displacement normal to the chord, and in x, y and z [mm].
    area, position, frame, patch
        Of the pairs, as in ContactRows.
    """

    parameters: SectorParameters
    mass: Floats
    stiffness: Floats
    stiffness_rotation: Floats
    static_rotation: Floats
    cosine: Floats
    observe_name: list[str]
    observe_matrix: Floats
    area: Floats
    position: Floats
    frame: Floats
    patch: list[str]

    @property
    def n_pairs(self) -> int:
        """Number of contact pairs."""
        return len(self.area)

    def frequencies(self, speed: float = 0.0, *, state: str = "stuck") -> Floats:
        """Natural frequencies [Hz] with every pair closed.

        Parameters
        ----------
        speed : float
            Rotation speed [rad/s].
        state : {'stuck', 'frictionless'}
            Whether the flanks hold or slide freely. A frictionless blade at rest can slide out
            of its slot: rigid motions give zeros, unstable ones negative numbers -sqrt(-lambda).
        """
        if state not in ("stuck", "frictionless"):
            raise ValueError(f"state = {state!r} is not accepted; expected 'stuck' or "
                             "'frictionless'")
        n_contact = 3 * self.n_pairs
        kept = np.arange(n_contact, len(self.mass))
        if state == "frictionless":
            tangential = np.flatnonzero(np.arange(n_contact) % 3 != 2)
            kept = np.concatenate((tangential, kept))
        stiffness = self.stiffness + speed**2 * self.stiffness_rotation
        block = np.ix_(kept, kept)
        # Mass is definite and well scaled only after Cholesky: contact and modal units differ.
        factor = np.linalg.cholesky(self.mass[block])
        half = np.linalg.solve(factor, stiffness[block])
        squares = np.linalg.eigvalsh(np.linalg.solve(factor, half.T))
        return np.sign(squares) * np.sqrt(np.abs(squares)) / (2.0 * np.pi)


def needs(n_dof: int, n_contact: int) -> tuple[float, float]:
    """About what a sector takes: an estimate, fitted to two small meshes.

    Parameters
    ----------
    n_dof, n_contact : int
        Degrees of freedom of the mesh, and contact coordinates, three for each pair.

    Returns
    -------
    seconds, bytes
        Rough: a large sector is far from both meshes and may take several times as long.
    """
    entries = _FACTORS * (n_dof / _ORDER)**_GROWTH
    seconds = _SECONDS * (n_dof / _ORDER)**_SLOWER + 2.0 * entries * n_contact / _RATE
    return seconds, _BYTES * entries + 8.0 * n_dof * n_contact


def build_full(parameters: SectorParameters, progress: Progress | None = None,
               tell: Callable[[int, int], None] | None = None,
               engine: str = "auto") -> FullModel:
    """Mesh, assemble and factor the sector by an engine of `fretwear.factors`; `progress` is told
    how far that is, `tell` the degrees of freedom and contact coordinates before the long work."""
    sector = build_mesh(parameters)
    assembly = Assembly(sector.mesh, parameters.material)
    rows, tip = contact_rows(sector, parameters), tip_rows(sector, parameters.geometry)
    held = held_nodes(assembly.nodes, parameters.geometry)
    free = np.flatnonzero(np.repeat(~held, 3))

    def restrict(matrix: sp.csr_array) -> sp.csr_array:
        return sp.csr_array(matrix[free][:, free])

    if tell is not None:
        tell(len(free), len(rows.matrix.indptr) - 1)
    scalar_mass = assembly.scalar_mass()
    stiffness, contact = restrict(assembly.stiffness()), sp.csr_array(rows.matrix[:, free])
    if parameters.retention.retention > 0.0:
        lock = sp.csr_array(retention_row(sector, parameters.geometry)[:, free])
        stiffness = sp.csr_array(stiffness + parameters.retention.retention * (lock.T @ lock))
    # The stiffness of an elastic half-space under a patch is of this order.
    kappa = parameters.material.young * np.sqrt(rows.area.mean())
    mass = restrict(sp.csr_array(sp.kron(scalar_mass, sp.identity(3))))
    bonded = Bonded(stiffness, contact, kappa, progress, engine=engine, mass=mass)
    in_plane = np.array([1.0, 1.0, 0.0])
    centrifugal = ((scalar_mass @ assembly.nodes.T) * in_plane).ravel()[free]
    static = np.zeros(3 * assembly.n_nodes)
    static[free] = bonded.solve(centrifugal)
    rotation = restrict(assembly.geometric_stiffness(static)
                        - sp.kron(scalar_mass, sp.diags_array(in_plane)))
    return FullModel(parameters, sector, free, mass, stiffness, rotation, contact, centrifugal,
                     tip.normal[free], rows, tip, bonded)


def reduced_system(full: FullModel) -> ReducedSystem:
    """Contact coordinates, bonded modes and the attachment vector of the tip force."""
    try:
        return reduce(
            full.mass, full.stiffness, full.contact, bonded=full.bonded,
            n_modes=full.parameters.discretisation.n_modes,
            loads=np.column_stack((full.tip_force, full.centrifugal)), attachments=full.tip_force)
    except InputError as error:
        raise ParameterError(f"Discretisation: {error}") from None


def observed_rows(full: FullModel) -> Floats:
    """Tip displacement normal to the chord, and in x, y and z, on the free dofs (4, n)."""
    return np.vstack((full.tip_force, full.tip.mean[:, full.free].toarray()))


def reduce_model(full: FullModel, system: ReducedSystem | None = None) -> ReducedModel:
    """Reduce to the coordinates of `reduced_system`, which is taken where it is there."""
    system = system or reduced_system(full)
    rows, reduction = full.rows, system.reduction
    return ReducedModel(
        full.parameters, system.mass, system.stiffness, reduction.matrix(full.rotation),
        system.loads[:, 1], system.loads[:, 0], ["tip", "tip_x", "tip_y", "tip_z"],
        reduction.row(observed_rows(full)), rows.area, rows.position, rows.frame, rows.patch)


def generate(parameters: SectorParameters | None = None) -> ReducedModel:
    """Reduced model of the sector with the given parameters (the defaults without any)."""
    return reduce_model(build_full(parameters or SectorParameters()))
