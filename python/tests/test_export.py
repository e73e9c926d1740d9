"""`fretwear export`: what ParaView gets is what the result and the finite elements say."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
from program import run

from fretwear import ContactPairs, InputError, Model
from fretwear.cli import main
from fretwear.export import export_mesh, relative_displacement
from fretwear.export.mesh import read_mesh
from fretwear.export.recovery import read_structure, recover_displacement
from fretwear.result import Result
from fretwear.sector import FullModel, ReducedModel, write_model
from fretwear.sector.assembly import Assembly

# Precision of the stored basis, and points in single precision.
STORED = 1e-5


def _volumes(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Volumes of hexahedra in the order of VTK by two Gauss points a direction."""
    local = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0],
                      [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    gauss = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
    volume = np.zeros(len(cells))
    for place in np.array(np.meshgrid(gauss, gauss, gauss)).reshape(3, -1).T:
        factor = np.where(local == 1, place, 1.0 - place)
        sign = np.where(local == 1, 1.0, -1.0)
        gradient = np.stack([sign[:, k] * np.delete(factor, k, axis=1).prod(axis=1)
                             for k in range(3)], axis=1)
        volume += np.linalg.det(np.einsum("cai,aj->cij", points[cells], gradient)) / 8.0
    return volume


def test_the_mesh_is_that_of_the_finite_elements(coarse: Result, full: FullModel,
                                                 assembly: Assembly) -> None:
    mesh = read_mesh(coarse.path.with_name("model.h5"))
    volume = _volumes(mesh.points.astype(float), mesh.cells)
    assert (volume > 0.0).all(), "cells are oriented"
    assert volume == pytest.approx(assembly.weight.sum(axis=1), rel=STORED)
    assert np.array_equal(mesh.body, full.sector.body)


def test_facets_cover_the_flanks_twice(coarse: Result) -> None:
    """Once on the blade, once on the disk, each with the area of its pair, without folds."""
    mesh = read_mesh(coarse.path.with_name("model.h5"))
    corners = mesh.points.astype(float)[mesh.facets]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0],
                                         corners[:, 3] - corners[:, 1]), axis=1)
    assert np.bincount(mesh.pair, area) == pytest.approx(2.0 * coarse["contact/area"], rel=STORED)
    centre = np.array([corners[mesh.pair == k].mean(axis=(0, 1)) for k in range(8)])
    assert centre == pytest.approx(coarse["contact/position"], abs=1e-3)


def test_displacements_are_those_of_the_reduction(coarse: Result, full: FullModel,
                                                  reduced: ReducedModel) -> None:
    """The tip of the mesh moves as the observed tip does: corners against the mean of the face."""
    mesh = read_mesh(coarse.path.with_name("model.h5"))
    point = coarse.peak()
    written = export_mesh(coarse, point)
    q = recover_displacement(coarse, points=[point])[point]
    for name, row in (("static", 0), ("cosine", 1), ("sine", 2)):
        expected = (mesh.basis @ q[row]).reshape(-1, 3)
        assert written.point_data[f"displacement_{name}"] == pytest.approx(expected, rel=1e-12)
    tip = mesh.points[:, 1] > mesh.points[:, 1].max() - 1e-3
    moved = written.point_data["displacement_sine"][tip, 0].mean()
    observed = coarse.coefficients[point, 2, coarse.index("tip_x")]
    # The mean over corners is not the mean over the face; the tip bends little.
    assert moved == pytest.approx(observed, rel=0.03)
    assert np.array_equal(mesh.basis.shape, (3 * len(mesh.points), len(reduced.mass)))


def test_the_instant_is_where_the_tip_is_largest(coarse: Result) -> None:
    point = coarse.peak()
    written = export_mesh(coarse, point)
    tip = written.points[:, 1] > written.points[:, 1].max() - 1e-3
    largest = np.linalg.norm(written.point_data["displacement"][tip].mean(axis=0))
    vibration = written.point_data["vibration"][tip].mean()
    assert largest == pytest.approx(vibration, rel=0.05)
    quarter = export_mesh(coarse, point, 90.0).point_data["displacement"]
    data = written.point_data
    # At 90 degrees the third harmonic of the sine turns round; it is small.
    assert quarter == pytest.approx(data["displacement_static"] + data["displacement_sine"],
                                    abs=0.02 * np.abs(quarter).max())


def test_round_trip_through_the_file(coarse: Result, tmp_path: Path,
                                     capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "out.vtu"
    assert main(["export", str(coarse.path), str(target)]) == 0
    assert "N/mm^2" in capsys.readouterr().out
    point, mesh = coarse.peak(), read_mesh(coarse.path.with_name("model.h5"))
    written = meshio.read(target)
    assert [block.type for block in written.cells] == ["hexahedron", "quad"]
    assert np.array_equal(written.cells[0].data, mesh.cells)
    expected = export_mesh(coarse, point)
    for name, values in expected.point_data.items():
        assert np.array_equal(written.point_data[name], values), name
    facets = {name: blocks[1] for name, blocks in written.cell_data.items()}
    assert np.array_equal(facets["pair"], mesh.pair + 1)
    for k, state in enumerate(("stick", "slip", "open")):
        assert np.array_equal(facets[state], coarse.fraction[point, mesh.pair, k])
    pressure = -coarse.force[point, 0, :, 2] / coarse["contact/area"]
    assert np.array_equal(facets["pressure"], pressure[mesh.pair])
    assert np.isnan(written.cell_data["slip"][0]).all()


def test_wear(worn: Result, tmp_path: Path) -> None:
    target = tmp_path / "worn.vtu"
    assert main(["export", str(worn.path), str(target), "--point", "9"]) == 0
    written = meshio.read(target)
    pair = written.cell_data["pair"][1] - 1
    assert np.array_equal(written.cell_data["wear_depth"][1], worn.depth[8, pair])
    assert np.array_equal(written.cell_data["wear_rate"][1], worn.rate[8, pair])


def test_frames(coarse: Result, tmp_path: Path) -> None:
    assert main(["export", str(coarse.path), str(tmp_path / "a.vtu"), "--frames", "4"]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "a.pvd", *(f"a_{k:03d}.vtu" for k in range(4))]
    assert 'timestep="0.250000" file="a_001.vtu"' in (tmp_path / "a.pvd").read_text()
    moved = [meshio.read(tmp_path / f"a_{k:03d}.vtu").point_data["displacement"]
             for k in (0, 2)]
    static = export_mesh(coarse).point_data["displacement_static"]
    # Half a period apart odd harmonics cancel; even ones are small.
    assert 0.5 * (moved[0] + moved[1]) == pytest.approx(static, abs=0.01 * np.abs(moved[0]).max())


def test_a_sector_without_a_mesh_is_generated_again(coarse_case: Path, reduced: ReducedModel,
                                                    coarse: Result, tmp_path: Path) -> None:
    write_model(reduced, tmp_path / "model.h5")
    shutil.copy(coarse_case, tmp_path / "case.nml")
    result = run(tmp_path / "case.nml", tmp_path / "a.h5")
    again, stored = export_mesh(result), export_mesh(coarse)
    for name, values in stored.point_data.items():
        assert again.point_data[name] == pytest.approx(
            values, abs=STORED * np.abs(values).max()), name


@pytest.mark.parametrize(("change", "message"), [
    (lambda file: file.__delitem__("mesh/basis"), "holds no dataset /mesh/basis"),
    (lambda file: file["mesh/facets"].__setitem__((0, 0), 10**6), "points that do not exist"),
    (lambda file: (file.__delitem__("mesh"), file.attrs.__delitem__("parameters")),
     "holds no group /mesh"),
])
def test_a_mesh_that_does_not_fit(change: object, message: str, coarse: Result,
                                  tmp_path: Path) -> None:
    model = tmp_path / "model.h5"
    shutil.copy(coarse.path.with_name("model.h5"), model)
    with h5py.File(model, "r+") as file:
        change(file)  # type: ignore[operator]
    with pytest.raises(InputError, match=message):
        read_mesh(model)


def test_models_without_mesh_are_refused(examples: Path, tmp_path: Path,
                                         capsys: pytest.CaptureFixture[str]) -> None:
    result = run(examples.parent / "coulomb" / "coulomb.nml", tmp_path / "a.h5")
    assert main(["export", str(result.path), str(tmp_path / "a.vtu")]) == 3
    assert "has no model file" in capsys.readouterr().err


def test_command_line_refuses(coarse: Result, tmp_path: Path,
                              capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(coarse.path), str(tmp_path / "none" / "a.vtu")]) == 5
    assert main(["export", str(coarse.path), str(tmp_path / "a.vtu"), "--point", "0"]) == 3
    assert main(["export", str(coarse.path), str(tmp_path / "a.xyz")]) == 3
    assert "meshio" in capsys.readouterr().err


DISK = Path(__file__).resolve().parents[2] / "example" / "shrouded_disk" / "wave.nml"


@pytest.fixture(scope="module")
def disk(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """A point of the shrouded disk."""
    return run(DISK, tmp_path_factory.mktemp("disk") / "disk_wave.h5", "case%analysis=point",
               "sweep%start=1285", "solver%tolerance=1e-11")


def test_all_sectors_move_as_one_disk(disk: Result) -> None:
    """Points of neighbours that lie on each other move alike, wherever the disk is in its period;
    the shrouds do not, they only touch."""
    for phase in (0.0, 77.0):
        written = export_mesh(disk, 0, phase, sectors=0)
        radius = np.hypot(*written.points[:, :2].T)
        inside = np.flatnonzero(radius < 121.0)
        _, number, count = np.unique(np.round(written.points[inside], 4), axis=0,
                                          return_inverse=True, return_counts=True)
        assert (count == 2).sum() == 36 * 4 * 3  # four radii, three places along the axis
        moved = written.point_data["displacement"][inside]
        mean = np.array([np.bincount(number.ravel(), moved[:, i]) for i in range(3)]).T
        mean /= count[:, None]
        largest = np.abs(moved).max()
        assert moved == pytest.approx(mean[number.ravel()], abs=STORED * largest)


def test_sectors_are_that_of_the_model_later_and_turned(disk: Result) -> None:
    whole, alone = export_mesh(disk, 0, 0.0, sectors=3), export_mesh(disk, 0, -40.0)
    n = len(alone.points)
    turn = np.radians(10.0)
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    # Four nodal diameters: 40 degrees of the period from a sector to the next.
    assert whole.point_data["displacement"][n:2 * n] == pytest.approx(
        alone.point_data["displacement"] @ matrix.T, abs=1e-12)
    assert whole.points[n:2 * n] == pytest.approx(alone.points @ matrix.T)
    facets = whole.cell_data["sector"][1]
    assert np.array_equal(np.bincount(facets), [4, 4, 4])
    assert np.array_equal(whole.cell_data["slip"][1], np.tile(alone.cell_data["slip"][1], 3))
    back = export_mesh(disk, 0, 0.0, sectors=2, axis="-z")
    assert back.points[n:] == pytest.approx(alone.points @ matrix)


def test_relative_displacements_reach_the_next_sector(disk: Result) -> None:
    """What the elastic law makes of them is the force in the file: in the normal direction, where
    nothing opens at a small load."""
    force, open_share = disk.force[0], disk.fraction[0, :, 2]
    relative = relative_displacement(disk)[0]
    for pair in np.flatnonzero(open_share == 0.0):
        expected = 73263.0 * relative[:, pair, 2]
        expected[0] += 73263.0 * -0.04
        # Displacements of 0.05 mm are recovered to 1e-7 by least squares, then differ.
        assert force[:, pair, 2] == pytest.approx(expected, abs=73263.0 * 0.05 * 1e-7)
    assert (open_share == 0.0).any()


@pytest.mark.parametrize("of", ["open", "stuck"])
def test_forces_of_coriolis_and_of_the_air_are_recovered(tmp_path: Path, of: str) -> None:
    """The motion of the whole disk follows from the forces with all of the structure in them: what
    is observed comes out again, and no longer without one of these parts."""
    model = tmp_path / "disk.h5"
    shutil.copy(DISK.parent / "disk.h5", model)
    rng = np.random.default_rng(17)
    with h5py.File(model, "a") as file:
        mass = file["mass"][()]
        n = len(mass)
        g = np.triu(0.3 * mass * rng.normal(size=(n, n)), 1)
        file["coriolis"] = g - g.T
        file["aero/modes"] = file["observe/matrix"][()]
        for m in (-1, 0, 1):
            file[f"aero/sector/{m}"] = rng.normal(size=(2, 2, 2))
    result = run(DISK, tmp_path / "wave.h5", "case%analysis=point", "sweep%start=1285",
                 "solver%tolerance=1e-11", f"model%file='{model}'", "model%rotation_speed=500",
                 "model%modal_damping=1e-3", f"model%modal_damping_of={of}")
    structure = read_structure(result)
    moved = recover_displacement(result, structure)
    assert moved @ structure.observe.T == pytest.approx(result.coefficients, rel=1e-6, abs=1e-9)
    written = export_mesh(result, 0, 0.0, sectors=0)
    assert np.isfinite(written.point_data["displacement"]).all()
    whirl = structure.whirl
    assert whirl is not None
    for change in ({"coriolis": None}, {"air": np.zeros_like(whirl.air)},
                   {"modal_damping": whirl.modal_damping[:0]}):
        with pytest.raises(InputError, match="does not follow"):
            recover_displacement(result, replace(structure, whirl=replace(whirl, **change)))


@pytest.mark.parametrize("loss_alone", [False, True])
def test_motion_with_matrices_of_any_shape_is_recovered(tmp_path: Path, loss_alone: bool) -> None:
    """Skew parts and hysteretic damping belong to the structure, of harmonic 0 too."""
    rng = np.random.default_rng(5)
    n, eye = 4, np.eye(4)
    skew = np.triu(rng.normal(size=(n, n)), 1)
    skew = skew - skew.T
    parts = {} if loss_alone else {
        "coriolis": 0.3 * skew, "circulatory": 0.1 * rng.normal(size=(n, n)),
        "stiffness_unsymmetric": 0.2 * rng.normal(size=(n, n)),
        "damping_unsymmetric": 0.02 * rng.normal(size=(n, n)), "structural_damping": 0.02 * eye}
    stiffness = 2.0 * eye - 0.5 * (np.eye(4, k=1) + np.eye(4, k=-1))
    pairs = ContactPairs([[2, 0, 0]], [[0, 0, 0]], mu=0.3, normal_load=0.2, law="penalty",
                         tangential_stiffness=0.8, normal_stiffness=0.0)
    Model(eye, 0.05 * eye, stiffness, contact=pairs, static=0.1 * eye[2], cosine=0.2 * eye[0],
          observe={"tip": 4}, **parts).to_hdf5(tmp_path / "m.h5")
    (tmp_path / "case.nml").write_text(
        f"&case analysis = 'point' /\n&model source = 'hdf5' file = 'm.h5' loss_factor = 0.03 "
        f"{'' if loss_alone else 'rotation_speed = 0.6'} /\n"
        "&harmonics n_harmonics = 5 parity = 'all' /\n&sweep start = 0.9 /\n"
        "&solver tolerance = 1e-11 /\n")
    result = run(tmp_path / "case.nml", tmp_path / "case.h5")
    moved = recover_displacement(result)
    assert moved[..., 3:] == pytest.approx(result.coefficients, rel=1e-7, abs=1e-10)


def test_sectors_on_the_command_line(disk: Result, coarse: Result, tmp_path: Path,
                                     capsys: pytest.CaptureFixture[str]) -> None:
    target = str(tmp_path / "disk.vtu")
    assert main(["export", str(disk.path), target, "--sectors", "all"]) == 0
    assert "36 sectors" in capsys.readouterr().out
    assert len(meshio.read(target).points) == 36 * 132
    assert main(["export", str(coarse.path), target, "--sectors", "all"]) == 3
    assert "has no sectors" in capsys.readouterr().err
    assert main(["export", str(disk.path), target, "--sectors", "37"]) == 3
    assert "there are 36" in capsys.readouterr().err
    assert main(["export", str(disk.path), target, "--sectors", "2", "--axis", "w"]) == 3
    assert "must be x, y, z" in capsys.readouterr().err


def test_pyvista_gets_the_same_mesh(coarse: Result) -> None:
    pytest.importorskip("pyvista")
    mesh, grid = export_mesh(coarse, phase=30.0), coarse.to_pyvista(phase=30.0)
    np.testing.assert_array_equal(grid.points, mesh.points)
    assert grid.n_cells == sum(len(block.data) for block in mesh.cells)
    np.testing.assert_array_equal(grid.point_data["displacement"],
                                  mesh.point_data["displacement"])
    slip = np.concatenate(mesh.cell_data["slip"])
    np.testing.assert_array_equal(grid.cell_data["slip"], slip)
