"""Invariants of the sector generator, against dense algebra on the full model."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import scipy.linalg as la

from fretwear.reduction import bonded_basis
from fretwear.sector import (
    Discretisation,
    FullModel,
    Geometry,
    ReducedModel,
    Retention,
    SectorParameters,
    build_full,
    patch_grid,
    reduce_model,
)
from fretwear.sector.assembly import Assembly
from fretwear.sector.contact import held_nodes
from fretwear.sector.mesh import BLADE

# Sums of a few thousand terms of like sign.
ROUND_OFF = 1e-11
# Asked of the generator; the dense reference itself keeps about eleven digits.
DENSE_EIGENVALUE = 1e-9
# A dense solution with the full stiffness: round-off times its condition number of some 1e8.
DENSE_SOLUTION = 1e-8
# S^-1 - kappa I loses the digits between the compliance of a patch and that of the blade.
COMPLIANCE = 1e-8
SPEED = 8000.0 * math.pi / 30.0


@pytest.fixture(scope="module")
def null_space(full: FullModel) -> np.ndarray:
    """Orthonormal basis of the displacements with every pair stuck."""
    return la.null_space(full.contact.toarray())


def _lowest_frequencies(stiffness: np.ndarray, mass: np.ndarray, n: int) -> np.ndarray:
    """Lowest frequencies [Hz] from the largest 1/omega^2, which a dense solver finds best."""
    last = len(mass) - 1
    inverse = la.eigh(mass, stiffness, eigvals_only=True, subset_by_index=[last - n + 1, last])
    return 1.0 / (2.0 * np.pi * np.sqrt(inverse[::-1]))


def _translate(nodes: np.ndarray, n_nodes: int, direction: np.ndarray) -> np.ndarray:
    """Displacement field that moves some nodes by a vector, (3 n_nodes,)."""
    field = np.zeros((n_nodes, 3))
    field[nodes] = direction
    return field.ravel()


def test_patch_areas_sum_to_flank_area(full: FullModel) -> None:
    g = full.parameters.geometry
    expected = g.flank_length * g.axial_length
    for name in ("intrados", "extrados"):
        area = full.rows.area[np.array(full.rows.patch) == name].sum()
        assert area == pytest.approx(expected, rel=ROUND_OFF)


def test_frames_are_orthonormal_and_point_into_the_blade(full: FullModel) -> None:
    for frame, position in zip(full.rows.frame, full.rows.position, strict=True):
        assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-14)
        assert frame[2] @ position < 0  # towards the axis of the disk: the root lies below


@pytest.mark.parametrize("direction", np.eye(3))
def test_rigid_translation_of_the_blade(full: FullModel, assembly: Assembly,
                                        blade_nodes: np.ndarray, direction: np.ndarray) -> None:
    """The relative displacement is the translation in every local frame."""
    field = _translate(blade_nodes, assembly.n_nodes, direction)
    relative = (full.rows.matrix @ field).reshape(-1, 3)
    assert relative == pytest.approx(full.rows.frame @ direction, abs=ROUND_OFF)


def test_pulling_the_blade_outwards_closes_the_flanks(
        full: FullModel, assembly: Assembly, blade_nodes: np.ndarray) -> None:
    field = _translate(blade_nodes, assembly.n_nodes, np.array([0.0, 1.0, 0.0]))
    relative = (full.rows.matrix @ field).reshape(-1, 3)
    assert (relative[:, 2] < 0).all()
    assert (relative[:, 0] > 0).all()


def test_a_common_translation_leaves_no_relative_displacement(
        full: FullModel, assembly: Assembly) -> None:
    common = np.tile([0.3, -1.0, 0.7], assembly.n_nodes)
    assert np.abs(full.rows.matrix @ common).max() < ROUND_OFF


def test_the_blade_is_held_by_contact_alone(full: FullModel, reduced: ReducedModel) -> None:
    """Rigid motions of the blade cost nothing in K_rr, and only those six."""
    n = 3 * reduced.n_pairs
    contact = reduced.stiffness[:n, :n]
    moves = [reduced.frame @ axis for axis in np.eye(3)]
    moves += [np.einsum("pij,pj->pi", reduced.frame, np.cross(axis, reduced.position))
              for axis in np.eye(3)]
    for move in moves:
        relative = move.ravel() / np.linalg.norm(move)
        assert np.linalg.norm(contact @ relative) < COMPLIANCE * np.linalg.norm(contact)
    values = np.linalg.eigvalsh(contact)
    assert np.abs(values[:6]).max() < COMPLIANCE * values[-1]
    assert values[6] > 1e3 * COMPLIANCE * values[-1]


def test_bonded_frequencies_are_those_of_the_full_model(
        full: FullModel, reduced: ReducedModel, null_space: np.ndarray) -> None:
    stiffness = null_space.T @ (full.stiffness @ null_space)
    mass = null_space.T @ (full.mass @ null_space)
    n_modes = full.parameters.discretisation.n_modes
    expected = _lowest_frequencies(stiffness, mass, n_modes)
    assert reduced.frequencies()[:n_modes] == pytest.approx(expected, rel=DENSE_EIGENVALUE)


def test_rotating_frequencies_follow_the_full_model(
        full: FullModel, reduced: ReducedModel, null_space: np.ndarray) -> None:
    """The basis is that of rest, so rotation is met to the truncation of the modes."""
    stiffness = null_space.T @ ((full.stiffness + SPEED**2 * full.rotation) @ null_space)
    mass = null_space.T @ (full.mass @ null_space)
    expected = _lowest_frequencies(stiffness, mass, 3)
    truncation = 1e-4
    assert reduced.frequencies(SPEED)[:3] == pytest.approx(expected, rel=truncation)
    assert reduced.frequencies(SPEED)[0] > 1.02 * reduced.frequencies()[0]


def test_static_tip_displacement_is_exact(
        full: FullModel, reduced: ReducedModel, null_space: np.ndarray) -> None:
    """The attachment vector completes the modes for the tip force."""
    load = null_space.T @ full.tip_force
    expected = load @ la.solve(null_space.T @ (full.stiffness @ null_space), load, assume_a="pos")
    n = 3 * reduced.n_pairs
    modal = reduced.cosine[n:]
    actual = reduced.observe_matrix[0, n:] @ np.linalg.solve(reduced.stiffness[n:, n:], modal)
    assert actual == pytest.approx(expected, rel=DENSE_SOLUTION)
    without = modal[:-1] @ (modal[:-1] / np.diag(reduced.stiffness)[n:-1])
    assert abs(without / expected - 1.0) > 1e-6


def test_static_contact_forces_are_exact(full: FullModel, reduced: ReducedModel) -> None:
    """T^T f on the contact coordinates against the multipliers of the full saddle problem."""
    rows = full.contact.toarray()
    n_r, n = rows.shape
    # Scaled so that both blocks have numbers of one size.
    scale = full.bonded.kappa
    saddle = np.block([[full.stiffness.toarray(), scale * rows.T],
                       [scale * rows, np.zeros((n_r, n_r))]])
    answer = np.linalg.solve(saddle, np.concatenate((full.centrifugal, np.zeros(n_r))))
    forces = scale * answer[n:]
    assert reduced.static_rotation[:n_r] == pytest.approx(
        forces, abs=COMPLIANCE * np.abs(forces).max())


def test_static_contact_forces_balance_the_centrifugal_load(
        full: FullModel, assembly: Assembly, blade_nodes: np.ndarray,
        reduced: ReducedModel) -> None:
    """Force on the blade by the contact plus its centrifugal load is zero."""
    forces = reduced.static_rotation[:3 * reduced.n_pairs].reshape(-1, 3)
    on_blade = -np.einsum("pi,pij->j", forces, reduced.frame)
    nodal = np.zeros(3 * assembly.n_nodes)
    nodal[full.free] = full.centrifugal
    on_nodes = nodal.reshape(-1, 3)[blade_nodes].sum(axis=0)
    assert on_blade + on_nodes == pytest.approx(np.zeros(3), abs=COMPLIANCE * abs(on_nodes[1]))
    assert 15e3 < on_nodes[1] * SPEED**2 < 30e3  # [N], about 22 kN on the fine mesh


def test_matrices_are_symmetric_to_the_last_bit(full: FullModel, reduced: ReducedModel) -> None:
    for matrix in (reduced.mass, reduced.stiffness, reduced.stiffness_rotation):
        assert np.array_equal(matrix, matrix.T)
    for matrix in (full.mass, full.stiffness, full.rotation):
        assert abs(matrix - matrix.T).max() == 0.0


def test_mass_is_definite_and_modes_are_normalised(reduced: ReducedModel) -> None:
    assert np.linalg.eigvalsh(reduced.mass)[0] > 0.0
    n = 3 * reduced.n_pairs
    assert reduced.mass[n:, n:] == pytest.approx(np.eye(len(reduced.mass) - n), abs=1e-9)


def test_stiffness_equals_the_projected_one(full: FullModel, reduced: ReducedModel) -> None:
    """The block form (K_rr, omega^2) against T^T K T by products."""
    reduction = bonded_basis(full.bonded, full.mass, full.tip_force,
                             full.parameters.discretisation.n_modes)
    product = reduction.matrix(full.stiffness)
    size = np.sqrt(np.outer(np.diag(product), np.diag(product)))
    assert np.abs((product - reduced.stiffness) / size).max() < COMPLIANCE


def test_sliding_flanks_lower_the_first_frequency(reduced: ReducedModel) -> None:
    """Without friction one rigid motion remains: the blade slides along its slot."""
    stuck = reduced.frequencies()
    free = reduced.frequencies(state="frictionless")
    assert abs(free[0]) < 1e-3 * stuck[0]
    assert 0.8 * stuck[0] < free[1] < 0.98 * stuck[0]


def test_volume_of_the_root(full: FullModel, assembly: Assembly) -> None:
    """Below its airfoil the blade is a prism."""
    g = full.parameters.geometry
    cells = full.sector.mesh.p[1][full.sector.mesh.t].max(axis=0) < g.airfoil_radius + 1e-6
    cells &= full.sector.body == BLADE
    volume = assembly.weight[cells].sum()
    rise = g.flank_top_radius - g.flank_radius
    section = (g.root_depth * (2 * g.root_half_width - g.root_taper)
               + rise * (g.root_half_width + g.neck_half_width)
               + 2 * g.neck_half_width * (g.platform_radius - g.flank_top_radius)
               + 2 * g.platform_half_width * g.platform_height)
    assert volume == pytest.approx(section * g.axial_length, rel=ROUND_OFF)


def test_mass_of_a_rigid_translation(full: FullModel, assembly: Assembly) -> None:
    """The row sums of the mass matrix are the mass."""
    total = full.parameters.material.density * assembly.weight.sum()
    assert assembly.scalar_mass().sum() == pytest.approx(total, rel=ROUND_OFF)


def test_held_nodes_leave_the_blade_free(
        full: FullModel, assembly: Assembly, blade_nodes: np.ndarray) -> None:
    held = held_nodes(assembly.nodes, full.parameters.geometry)
    assert held.any()
    assert not held[blade_nodes].any()


def test_patch_grid() -> None:
    assert patch_grid(16) == (4, 2)
    assert patch_grid(48) == (6, 4)
    assert patch_grid(768) == (24, 16)
    with pytest.raises(ValueError, match="even number"):
        patch_grid(7)


@pytest.mark.parametrize(("name", "value"), [
    ("flank_length", -1.0), ("flank_angle", 90.0), ("camber", math.nan), ("n_sectors", 400)])
def test_geometry_that_cannot_be_built_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=r"Geometry: \w+ = .* is not accepted"):
        dataclasses.replace(Geometry(), **{name: value})


def test_whole_patches_of_elements() -> None:
    discretisation = Discretisation(axial_patches=4, slope_patches=2)
    assert (discretisation.n_axial, discretisation.n_slope) == (8, 4)


def test_the_lock_holds_the_blade_along_its_slot(full: FullModel, reduced: ReducedModel) -> None:
    """The axial translation of the blade meets the stiffness of the lock; the bonded frequencies
    hardly know of it."""
    lock = 100.0
    parameters = SectorParameters(discretisation=full.parameters.discretisation,
                                  retention=Retention(lock))
    locked = reduce_model(build_full(parameters))
    n = 3 * reduced.n_pairs
    axial = (reduced.frame @ np.array([0.0, 0.0, 1.0])).ravel()
    # In series with blade and disk, which are some thousand times as stiff.
    assert axial @ locked.stiffness[:n, :n] @ axial == pytest.approx(lock, rel=1e-3)
    across = (reduced.frame @ np.array([1.0, 0.0, 0.0])).ravel()
    assert abs(across @ locked.stiffness[:n, :n] @ across) < 1e-3 * lock
    assert locked.frequencies()[:5] == pytest.approx(reduced.frequencies()[:5], rel=1e-4)
    assert locked.frequencies(state="frictionless")[0] > reduced.frequencies(
        state="frictionless")[0]


def test_a_negative_lock_is_refused() -> None:
    with pytest.raises(ValueError, match=r"Retention: retention = -1\.0"):
        Retention(-1.0)


def test_what_a_sector_takes_is_said_before(capsys: pytest.CaptureFixture[str]) -> None:
    """768 pairs: a quarter of an hour and 16 GB, within a factor of two."""
    from fretwear.sector.cli import _say_what_it_takes
    from fretwear.sector.model import needs

    seconds, memory = needs(147_882, 3 * 768)
    assert 450.0 < seconds < 1800.0 and 8e9 < memory < 32e9
    _say_what_it_takes(147_882, 3 * 768)
    said = capsys.readouterr().err
    assert "147882 degrees of freedom" in said and "min and" in said and "GB" in said
    _say_what_it_takes(28_000, 48)  # the default
    assert capsys.readouterr().err == ""
