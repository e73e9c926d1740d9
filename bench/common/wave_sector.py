"""The bladed-disk sector between its neighbours: matrices of the nodal diameters of a wave.

The sector of `fretwear.sector` with its cut faces tied to those of the next sectors, reduced in
every nodal diameter to the relative displacements of its pairs and modes with all of them stuck.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fretwear.model_file import write_model_file
from fretwear.reduction import reduce
from fretwear.sector.assembly import Assembly
from fretwear.sector.contact import contact_rows, tip_rows
from fretwear.sector.mesh import build_mesh
from fretwear.sector.parameters import Discretisation, SectorParameters, patch_grid
from fretwear.sectors import NodalDiameter, Sectors

__all__ = ["ENGINE_ORDER", "N_SECTORS", "patterns", "wave_file"]

#: No harmonic up to 17 has the nodal diameter of another.
N_SECTORS, ENGINE_ORDER = 47, 4
#: Nodes of a face [mm].
_ON_SURFACE = 1e-6
#: Static load by the speed of the other benchmarks [rad/s], and damping at a frequency [rad/s].
_SPEED, _DAMPING, _FREQUENCY = 460.8, 1e-3, 2.0 * math.pi * 1000.0
_N_MODES = 20


def diameters_of(n_harmonics: int) -> list[int]:
    """Nodal diameters of so many harmonics."""
    return [abs((n * ENGINE_ORDER + N_SECTORS // 2) % N_SECTORS - N_SECTORS // 2)
            for n in range(n_harmonics + 1)]


def patterns(path: Path, n_harmonics: int, share: float) -> int:
    """Patterns in which the static stiffness of the pairs differs between the nodal diameters of
    a wave by more than a share, in units of its diagonal."""
    with h5py.File(path) as file:
        n = 3 * len(file["contact/side_1"])
        parts = [file[f"nodal_diameter/{k}/stiffness"][:n, :n] for k in diameters_of(n_harmonics)]
    scale = 1.0 / np.sqrt(np.diag(parts[0][..., 0]))
    apart = [scale[:, None] * (part[..., i] - (i == 0) * parts[0][..., 0]) * scale
             for part in parts[1:] for i in (0, 1)]
    return int((np.linalg.svd(np.hstack(apart), compute_uv=False) > share).sum())


def wave_file(pairs: int, n_harmonics: int, folder: Path, coarse: dict[str, int]) -> Path:
    """A model file with the nodal diameters that so many harmonics need."""
    path = folder / f"wave_{pairs}_{n_harmonics}.h5"
    if path.exists():
        return path
    axial, slope = patch_grid(pairs)
    mesh = {key.replace("-", "_"): value for key, value in coarse.items()}
    parameters = SectorParameters(discretisation=Discretisation(axial, slope, **mesh))
    numbers = sorted(set(diameters_of(n_harmonics)))
    sectors = Sectors(N_SECTORS, diameters=_diameters(parameters, numbers),
                      n_physical=3 * pairs).checked(3 * pairs)
    rows = np.arange(1, 3 * pairs + 1, dtype=np.int32).reshape(-1, 3)
    write_model_file(path, {
        **sectors.datasets(), "contact/side_1": rows, "contact/side_2": 0 * rows,
        "observe/name": np.array([b"tip"])}, title="", unit_system="",
        groups={"cyclic": sectors.attributes()})
    return path


def _diameters(parameters: SectorParameters, numbers: list[int]) -> dict[int, NodalDiameter]:
    """Reduced matrices of some nodal diameters."""
    sector = build_mesh(parameters)
    assembly = Assembly(sector.mesh, parameters.material)
    geometry, nodes = parameters.geometry, assembly.nodes
    rows = contact_rows(sector, parameters)
    tip = tip_rows(sector, geometry).normal
    scalar_mass = assembly.scalar_mass()
    mass = sp.csr_array(sp.kron(scalar_mass, sp.identity(3)))
    stiffness = assembly.stiffness()
    centrifugal = ((scalar_mass @ nodes.T) * np.array([1.0, 1.0, 0.0])).ravel()
    static = _SPEED**2 * centrifugal
    held = np.hypot(nodes[0], nodes[1]) < geometry.inner_radius + _ON_SURFACE
    found = {}
    for k in numbers:
        tie = _tie(nodes, geometry.half_pitch, geometry.rim_radius, held, k)
        back = sp.csr_array(tie.conj().T)
        loads = back @ np.column_stack((static, tip))
        seen = sp.csr_array(tip[None, :] @ tie)
        system = reduce(sp.csr_array(back @ mass @ tie), sp.csr_array(back @ stiffness @ tie),
                        rows.matrix @ tie, n_modes=_N_MODES, loads=loads,
                        attachments=np.column_stack((loads[:, 1], seen.conj().T.toarray())))
        damping = _DAMPING * (_FREQUENCY * system.mass + system.stiffness / _FREQUENCY)
        found[k] = NodalDiameter(system.mass, system.stiffness, damping, static=system.loads[:, 0],
                                 cosine=system.loads[:, 1],
                                 observe={"tip": system.reduction.row(seen)[0]})
    return found


def _tie(nodes: NDArray[Any], half_pitch: float, rim: float, held: NDArray[np.bool_],
         k: int) -> sp.csr_array:
    """From the degrees of freedom but those held and on the right face to all of them."""
    x, y = nodes[0], nodes[1]
    away = np.abs(x) * math.cos(half_pitch) - y * math.sin(half_pitch)
    cut = (np.abs(away) < _ON_SURFACE) & (y < rim + _ON_SURFACE) & ~held
    left, right = np.flatnonzero(cut & (x > 0.0)), np.flatnonzero(cut & (x < 0.0))
    place = [np.lexsort(np.round(np.array((nodes[2, side], y[side])), 5)) for side in (left, right)]
    left, right = left[place[0]], right[place[1]]
    turn = 2.0 * half_pitch
    rotation = np.array([[math.cos(turn), -math.sin(turn), 0.0],
                         [math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    assert np.allclose(rotation @ nodes[:, left], nodes[:, right], atol=1e-6)
    z = np.exp(-2j * math.pi * k / N_SECTORS) if k else 1.0
    free = ~held
    free[right] = False
    columns = np.cumsum(free) - 1
    follow = sp.coo_array((np.ones(free.sum()), (np.flatnonzero(free), columns[free])),
                          shape=(len(held), free.sum()))
    whole = sp.kron(follow, sp.identity(3))
    tied = sp.coo_array((np.ones(len(left)), (right, columns[left])), shape=follow.shape)
    return sp.csr_array(whole + sp.kron(tied, z * rotation))
