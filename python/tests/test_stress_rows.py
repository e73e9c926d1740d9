"""Stress of generated meshes: exact fields, a bar that rotates, a bent beam, the full sector."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from program import run
from skfem import MeshHex1

from fretwear.disk import DiskParameters, build_full
from fretwear.disk.cli import main
from fretwear.disk.model import FullDisk, reduced_system
from fretwear.disk.stress import find_stress
from fretwear.export import export_mesh
from fretwear.sector.assembly import Assembly
from fretwear.sector.parameters import Material
from fretwear.sector.stress import stress_points

SMALL = DiskParameters(n_sectors=8, disk_rows=2, blade_rows=3, axial_layers=1, n_modes=20)
#: Of solved fields, by the condition of the stiffness; of fields that are given, round-off alone.
SOLVED, GIVEN = 1e-10, 1e-12
LENGTH, DENSITY, YOUNG = 40.0, 7.85e-9, 2.1e5


def bar(*counts: int) -> MeshHex1:
    ends = (LENGTH, 5.0, 4.0)
    mesh = MeshHex1.init_tensor(*(np.linspace(0.0, end, n + 1) for end, n in zip(ends, counts)))
    # Turned inside out as it comes.
    return MeshHex1(np.array([LENGTH, 0.0, 0.0])[:, None] + np.diag([-1.0, 1.0, 1.0]) @ mesh.p,
                    mesh.t)


def one_body(mesh: MeshHex1) -> np.ndarray:
    return np.zeros(mesh.t.shape[1], dtype=int)


def clamped(assembly: Assembly, load: np.ndarray) -> np.ndarray:
    """Static displacement, held at x = 0."""
    free = np.flatnonzero(np.repeat(assembly.nodes[0] > 1e-9, 3))
    found = np.zeros(3 * assembly.n_nodes)
    found[free] = spl.spsolve(sp.csc_matrix(assembly.stiffness()[free][:, free]), load[free])
    return found


def test_quadratic_fields_are_exact_at_every_point() -> None:
    """Sheared elements, any material: stress is linear then, and its extension exact."""
    mesh = bar(2, 2, 1)
    shear = np.array([[1.0, 0.3, -0.1], [0.2, 1.1, 0.2], [0.0, -0.3, 0.9]])
    mesh = MeshHex1(shear @ mesh.p, mesh.t)
    material = Material(young=YOUNG, poisson=0.3, density=DENSITY, mu=0.3)
    points = stress_points(mesh, one_body(mesh), material)
    rng = np.random.default_rng(1)
    linear, square = rng.normal(size=(3, 3)), rng.normal(size=(3, 3, 3))
    nodes = Assembly(mesh, material).nodes.T
    moved = nodes @ linear.T + np.einsum("ijk,nj,nk->ni", square, nodes, nodes)
    slope = linear + np.einsum("ijk,nk->nij", square + square.swapaxes(1, 2), points.position)
    strain = 0.5 * (slope + slope.swapaxes(1, 2))
    shear_modulus = YOUNG / 2.6
    stress = 2.0 * shear_modulus * strain + 2.0 * shear_modulus * 0.3 / 0.4 * np.trace(
        strain, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    wanted = np.stack([stress[:, i, j] for i, j in (
        (0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))], axis=1)
    found = (points.rows @ moved.ravel()).reshape(-1, 6)
    assert np.abs(found - wanted).max() < GIVEN * np.abs(wanted).max()
    # Eight points an element, and each vertex once.
    assert len(found) == 8 * mesh.t.shape[1] + mesh.p.shape[1]
    assert np.array_equal(points.vertex[-mesh.p.shape[1]:], np.arange(mesh.p.shape[1]))


def test_a_bar_that_rotates() -> None:
    """rho Omega^2 (L^2 - x^2)/2 at the points of the elements, without Poisson's ratio."""
    mesh = bar(5, 1, 1)
    material = Material(young=YOUNG, poisson=0.0, density=DENSITY, mu=0.3)
    assembly = Assembly(mesh, material)
    load = np.zeros(3 * assembly.n_nodes)
    load[::3] = assembly.scalar_mass() @ assembly.nodes[0]
    points = stress_points(mesh, one_body(mesh), material)
    found = (points.rows @ clamped(assembly, load)).reshape(-1, 6)
    inside = points.vertex < 0
    wanted = 0.5 * DENSITY * (LENGTH**2 - points.position[:, 0]**2)
    assert np.abs(found[inside, 0] - wanted[inside]).max() < SOLVED * wanted.max()
    assert np.abs(found[:, 1:]).max() < SOLVED * wanted.max()


def test_a_bent_beam() -> None:
    """An end moment: sigma = E k z at every point, at the clamp too without Poisson's ratio."""
    mesh = bar(3, 1, 2)
    material = Material(young=YOUNG, poisson=0.0, density=DENSITY, mu=0.3)
    assembly = Assembly(mesh, material)
    x, y, z = assembly.nodes
    bend = 1e-3
    exact = np.stack((bend * x * (z - 2.0), 0.0 * y, -0.5 * bend * x**2), axis=1).ravel()
    # The load of that field is on the end face alone.
    load = assembly.stiffness() @ exact
    load[np.repeat((x > 1e-9) & (x < LENGTH - 1e-9), 3)] = 0.0
    points = stress_points(mesh, one_body(mesh), material)
    found = (points.rows @ clamped(assembly, load)).reshape(-1, 6)
    wanted = YOUNG * bend * (points.position[:, 2] - 2.0)
    assert np.abs(found[:, 0] - wanted).max() < SOLVED * np.abs(wanted).max()
    assert np.abs(found[:, 1:]).max() < SOLVED * np.abs(wanted).max()


@pytest.fixture(scope="module", name="full")
def build() -> FullDisk:
    return build_full(SMALL)


def solve_whole(full: FullDisk, matrix: sp.csr_array, load: np.ndarray, order: int) -> np.ndarray:
    """The full sector in a wave of all: right interfaces as left ones, later by an engine order."""
    n = full.n_interface
    z = np.exp(-2j * np.pi * order / full.parameters.n_sectors)
    tie = sp.csr_array(full.rows[n:2 * n] - z * full.rows[:n])
    whole = sp.csc_matrix(sp.block_array([[matrix, tie.conj().T], [tie, None]]))
    return spl.spsolve(whole, np.concatenate((load, np.zeros(n))).astype(complex))[:len(load)]


def write_disk(path: Path, n_modes: int, *more: str) -> None:
    options = [word for name in ("n_sectors", "disk_rows", "blade_rows", "axial_layers")
               for word in ("--" + name.replace("_", "-"), str(getattr(SMALL, name)))]
    assert main([*options, "--n-modes", str(n_modes), *more, "-q", "-o", str(path)]) == 0


def test_centrifugal_stress_is_that_of_the_full_sector(full: FullDisk, tmp_path: Path) -> None:
    """All sectors alike: what the modes leave stands in the stress without motion."""
    speed = 1.0   # [rad/s]: stiffening changes 1e-6 of it
    write_disk(tmp_path / "disk.h5", 20, "--stress")
    (tmp_path / "case.nml").write_text(
        "&case analysis = 'point' /\n&model source = 'hdf5' file = 'disk.h5'\n"
        "   rotation_speed = 1.0 rayleigh_stiffness = 1e-6 /\n&cyclic engine_order = 0 /\n"
        "&contact law = 'penalty' tangential_stiffness = 1e4 normal_stiffness = 1e4 gap = 1.0 /\n"
        "&harmonics n_harmonics = 1 /\n&load harmonic_scale = 1e-9 /\n&sweep start = 10.0 /\n"
        "&stress output = 'tensor' /\n")
    found = run(tmp_path / "case.nml", tmp_path / "case.h5")["stress/coefficients"][0, 0]
    matrix = full.stiffness + speed**2 * full.rotation
    moved = solve_whole(full, matrix, speed**2 * full.centrifugal, 0).real
    points = stress_points(full.sector.mesh, full.sector.body, full.parameters.material)
    wanted = (points.rows[:, full.free] @ moved).reshape(-1, 6)
    assert np.abs(found - wanted).max() < 1e-6 * np.abs(wanted).max()
    with h5py.File(tmp_path / "disk.h5", "r+") as file:
        assert np.array_equal(file["stress/mesh_point"][()], points.vertex)
        del file["stress/static_rotation"]
    off = run(tmp_path / "case.nml", tmp_path / "off.h5")["stress/coefficients"][0, 0]
    assert np.abs(off - wanted).max() > 1e-3 * np.abs(wanted).max()


def test_stress_of_a_wave_tends_to_that_of_the_full_sector(full: FullDisk) -> None:
    """A load of engine order 3 between the first families: the error falls with the modes."""
    order, omega, loss = 3, 2.0 * np.pi * 300.0, 0.02
    load = full.rows[[-2]].toarray()[0]
    matrix = sp.csr_array((1.0 + 1j * loss) * full.stiffness - omega**2 * full.mass)
    points = stress_points(full.sector.mesh, full.sector.body, full.parameters.material)
    wanted = points.rows[:, full.free] @ solve_whole(full, matrix, load, order)
    errors = []
    for n_modes in (10, 40, 160):
        parameters = DiskParameters(n_sectors=8, disk_rows=2, blade_rows=3, axial_layers=1,
                                    n_modes=n_modes)
        of_modes = FullDisk(**{**vars(full), "parameters": parameters})
        system = reduced_system(of_modes)
        stress = find_stress(of_modes, system.reduction)
        n, size = full.n_interface, len(system.mass)
        z = np.exp(-2j * np.pi * order / 8)
        kept = np.setdiff1d(np.arange(size), np.arange(n, 2 * n))
        tie = np.zeros((size, len(kept)), dtype=complex)
        tie[kept, np.arange(len(kept))] = 1.0
        tie[np.arange(n, 2 * n), np.arange(n)] = z
        small = (1.0 + 1j * loss) * system.stiffness - omega**2 * system.mass
        right = np.zeros(size)
        right[full.rows.shape[0] - 2] = 1.0
        moved = tie @ np.linalg.solve(tie.conj().T @ small @ tie, tie.conj().T @ right)
        found = (np.asarray(stress.matrix).reshape(-1, size) @ moved)
        errors.append(np.abs(found - wanted).max() / np.abs(wanted).max())
    print("errors of the stress with 10, 40, 160 modes:", errors)
    assert errors[0] < 0.1 and errors[1] < 0.3 * errors[0] and errors[2] < 0.3 * errors[1]


def test_export_shows_the_stress_of_vertices(tmp_path: Path) -> None:
    pytest.importorskip("meshio")
    write_disk(tmp_path / "disk.h5", 20, "--stress", "--mesh")
    (tmp_path / "case.nml").write_text(
        "&case analysis = 'point' /\n&model source = 'hdf5' file = 'disk.h5'\n"
        "   rayleigh_stiffness = 1e-6 rotation_speed = 400.0 /\n&cyclic engine_order = 3 /\n"
        "&contact law = 'penalty' tangential_stiffness = 1e4 normal_stiffness = 1e4 gap = 1.0 /\n"
        "&harmonics n_harmonics = 1 /\n&sweep start = 1500.0 /\n&output contact = .true. /\n"
        "&stress endurance = 250.0 ultimate = 900.0 /\n")
    result = run(tmp_path / "case.nml", tmp_path / "case.h5")
    mesh = export_mesh(result, sectors=2)
    with h5py.File(tmp_path / "disk.h5") as file:
        vertex = file["stress/mesh_point"][()]
        n_points = len(file["mesh/points"])
    for name in ("stress_amplitude", "stress_mean", "utilisation"):
        shown = mesh.point_data[name].reshape(2, n_points)
        assert np.isfinite(shown).all() and np.array_equal(shown[0], shown[1])
        values = result[f"stress/{name.removeprefix('stress_')}"][0]
        # Of the blade and the disk where they meet, the one that vibrates more.
        one = int(np.flatnonzero(np.bincount(vertex[vertex >= 0]) == 2)[0])
        both = np.flatnonzero(vertex == one)
        larger = both[result["stress/amplitude"][0, both].argmax()]
        assert shown[0, one] == values[larger]
        alone = int(np.flatnonzero(np.bincount(vertex[vertex >= 0]) == 1)[0])
        assert shown[0, alone] == values[vertex == alone][0]
