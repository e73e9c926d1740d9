"""Import of one sector: interfaces paired by turning, checked, tied and reduced."""

from __future__ import annotations

import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from project import PROGRAM
from sector_files import SMALL, command, write_sector

from fretwear.cli import main
from fretwear.disk import FullDisk, build_full, reduce_disk
from fretwear.sector.assembly import Assembly

#: Frequencies of the same matrices in another order, of a condition of 1e7.
SAME = 1e-7
#: Modes of the same tied matrices by two solvers (measured 1.4e-12).
EXACT = 1e-9
#: The mesh is kept in single precision; motions of size one.
SINGLE = 1e-5
#: A pair that holds, and one of the elastic law.
STUCK = "'dlft'"
ELASTIC = "'penalty' tangential_stiffness = 2e4 normal_stiffness = 3e4"
#: Of the lowest families, with the modes that the reduction leaves out.
REDUCED = 1e-3


@pytest.fixture(scope="module")
def full() -> FullDisk:
    return build_full(SMALL)


@pytest.fixture(scope="module")
def folder(full: FullDisk, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sector")
    write_sector(full, path)
    return path


def frequencies(folder: Path, file: Path) -> np.ndarray:
    """Of all nodal diameters [Hz], by the program."""
    (folder / "modes.nml").write_text(f"&case analysis = 'modes' /\n&model source = 'hdf5' file = "
                                      f"'{file}' /\n&cyclic n_modes = 3 /\n")
    subprocess.run([PROGRAM, "-q", "-o", folder / "modes_result.h5", folder / "modes.nml"],
                   check=True)
    with h5py.File(folder / "modes_result.h5") as found:
        values: np.ndarray = found["modes/open"][()] / (2.0 * np.pi)
        return values


@pytest.fixture(scope="module")
def exact(full: FullDisk) -> np.ndarray:
    """With all modes that there are, nearly."""
    model = reduce_disk(full)
    return np.array([model.frequencies(k, n=3) for k in range(7)])


def test_import_of_a_sector(folder: Path, exact: np.ndarray, tmp_path: Path,
                            capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "model.h5"
    assert main(command(folder, "--frames", "cartesian", "-o", str(target))) == 0
    said = capsys.readouterr().err
    assert "frame of the next sector" in said and "of nodal diameter 0" in said
    with h5py.File(target) as file:
        assert file["cyclic"].attrs["n_sectors"] == 12
        assert len(file["cyclic/left"]) == len(file["cyclic/right"]) == 18
    found = frequencies(tmp_path, target)
    assert found.shape == (7, 3)
    # The reduction of the generator keeps 20 modes: from above, by little.
    assert found == pytest.approx(exact, rel=REDUCED)
    reduced = tmp_path / "reduced.h5"
    assert main(command(folder, "--frames", "cartesian", "--reduce", "20", "-o",
                        str(reduced))) == 0
    with h5py.File(reduced) as file:
        assert len(file["mass"]) == 2 * 18 + 20
    assert frequencies(tmp_path, reduced) == pytest.approx(found, rel=REDUCED)


def test_components_in_the_wrong_frames_have_other_frequencies(folder: Path, exact: np.ndarray,
                                                               tmp_path: Path) -> None:
    """A held disk has no rigid motions that would tell: the answer does."""
    target = tmp_path / "model.h5"
    assert main(command(folder, "-q", "-o", str(target))) == 0
    assert np.abs(frequencies(tmp_path, target)[:, 0] / exact[:, 0] - 1.0).max() > 0.01


def test_rigid_motions_tell_the_frames(full: FullDisk, folder: Path, tmp_path: Path,
                                       capsys: pytest.CaptureFixture[str]) -> None:
    """A sector that nothing holds: two motions of the whole disk are left, or the frames are not
    those of the sectors."""
    assembly = Assembly(full.sector.mesh, full.parameters.material)
    mass = sp.kron(assembly.scalar_mass(), sp.identity(3))
    nodes = assembly.nodes
    scipy.io.mmwrite(tmp_path / "mass.mtx", sp.coo_array(mass), symmetry="symmetric")
    scipy.io.mmwrite(tmp_path / "stiffness.mtx", sp.coo_array(assembly.stiffness()),
                     symmetry="symmetric")
    labels = [f"{3 * k + c + 1} {k + 1} {c + 1}" for k in range(assembly.n_nodes)
              for c in range(3)]
    (tmp_path / "labels.txt").write_text("\n".join(labels))
    radius, angle = np.hypot(*nodes[:2]), np.arctan2(nodes[1], nodes[0])
    for side, sign in (("left", -1.0), ("right", 1.0)):
        on = np.flatnonzero((np.abs(angle - sign * np.pi / 12) < 1e-9) & (radius < 120.0 + 1e-6))
        (tmp_path / f"{side}.csv").write_text("\n".join(["node; x; y; z", *(
            f"{k + 1}; {nodes[0, k]}; {nodes[1, k]}; {nodes[2, k]}" for k in on)]))
    capsys.readouterr()
    assert main(command(tmp_path, "--check", "--frames", "cartesian")) == 0
    assert "6 rigid-body motions of the sector, 2 of nodal diameter 0" in capsys.readouterr().out
    assert main(command(tmp_path, "--check")) == 3
    assert "do not turn with the sector" in capsys.readouterr().err


def test_pairs_reach_the_next_sector(full: FullDisk, folder: Path, tmp_path: Path) -> None:
    """A pair between tips of neighbours, by signed degrees of freedom."""
    rows = full.rows[2 * full.n_interface:]
    ends = [full.free[rows[[k]].tocoo().col[0]] // 3 + 1 for k in (0, 3)]
    tokens = [[f"{node}:{c}" for c in (1, 2, 3)] for node in ends]
    (tmp_path / "pairs.csv").write_text(
        "side_1_t1, side_1_t2, side_1_n, side_2_t1, side_2_t2, side_2_n, mu, sector_2\n"
        + ", ".join([*tokens[0], *tokens[1], "0.3", "1"]) + "\n")
    for more in ([], ["--reduce", "20"]):
        target = tmp_path / "model.h5"
        assert main(command(folder, "--frames", "cartesian", "-q", "--pairs",
                            str(tmp_path / "pairs.csv"), "-o", str(target), *more)) == 0
        with h5py.File(target) as file:
            assert file["contact/sector_2"][()].tolist() == [1]
            sides = np.concatenate((file["contact/side_1"], file["contact/side_2"]), axis=None)
            assert sides.min() > 0 and len(set(sides.tolist())) == 6
            # Sector matrices: displacements of the nodes themselves, also where it is reduced.
            assert (sides > 36).all() or not more


@pytest.fixture(scope="module")
def pairs(full: FullDisk, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Options of a pair between the shrouds of neighbours, loads and an observed quantity."""
    path = tmp_path_factory.mktemp("pairs")
    rows = full.rows[2 * full.n_interface:]
    ends = [full.free[rows[[k]].tocoo().col[0]] // 3 + 1 for k in (0, 3)]
    tokens = [[f"{node}:{c}" for c in (1, 2, 3)] for node in ends]
    (path / "pairs.csv").write_text(
        "side_1_t1, side_1_t2, side_1_n, side_2_t1, side_2_t2, side_2_n, mu, gap, sector_2\n"
        + ", ".join([*tokens[0], *tokens[1], "0.3, -1e-3, 1"]) + "\n")
    (path / "loads.csv").write_text(f"dof, cosine, sine, static_rotation\n{ends[0]}:2, 0.3, 0.1, 0"
                                    f"\n{ends[1]}:1, 0, 0.2, 1e-9\n")
    return ["--frames", "cartesian", "-q", "--pairs", str(path / "pairs.csv"), "--loads",
            str(path / "loads.csv"), "--observe", f"tip={ends[0]}:2"]


def test_every_nodal_diameter_on_its_own(folder: Path, pairs: list[str], tmp_path: Path) -> None:
    """Stuck frequencies are those of the whole; open ones and responses tend to them with modes."""
    main(command(folder, *pairs, "-o", str(tmp_path / "whole.h5")))

    def run(name: str, n_modes: int = 3) -> dict[str, np.ndarray]:
        found = {}
        for analysis, sweep in (("modes", ""), ("frf", "&sweep start = 900 end = 1500 unit = 'Hz' "
                                                "n_points = 7 /")):
            (tmp_path / "case.nml").write_text(
                f"&case analysis = '{analysis}' /\n&model source = 'hdf5' file = '{name}.h5' "
                "rayleigh_stiffness = 1e-6 rotation_speed = 100 /\n&contact law = "
                f"{STUCK if analysis == 'modes' else ELASTIC} /\n&cyclic engine_order = 2 "
                f"n_modes = {n_modes} /\n&harmonics n_harmonics = 3 /\n{sweep}\n")
            subprocess.run([PROGRAM, "-q", "-o", tmp_path / "result.h5", tmp_path / "case.nml"],
                           check=True)
            with h5py.File(tmp_path / "result.h5") as file:
                for key in ("modes/open", "modes/closed", "coefficients"):
                    if key in file:
                        found[key] = file[key][()]
        return found

    whole = run("whole")
    errors = []
    for n_modes in (6, 24):
        name = f"reduced_{n_modes}"
        assert main(command(folder, *pairs, "--reduce", str(n_modes), "--by-diameter", "-o",
                            str(tmp_path / f"{name}.h5"))) == 0
        with h5py.File(tmp_path / f"{name}.h5") as file:
            assert sorted(map(int, file["nodal_diameter"])) == list(range(7))
            assert file["cyclic"].attrs["n_physical"] == 3
            assert len(file["nodal_diameter/3/mass"]) <= 3 + n_modes + 4
        found = run(name)
        assert found["modes/closed"] == pytest.approx(whole["modes/closed"], rel=EXACT)
        assert (found["modes/open"] >= whole["modes/open"] * (1.0 - EXACT)).all()
        scale = np.abs(whole["coefficients"]).max()
        errors.append([np.abs(found["modes/open"] / whole["modes/open"] - 1.0).max(),
                       np.abs(found["coefficients"] - whole["coefficients"]).max() / scale])
    assert (np.array(errors[1]) < 1e-3).all()
    assert (np.array(errors[1]) < 0.1 * np.array(errors[0])).all()


def test_nodal_diameters_need_pairs_and_modes(folder: Path, pairs: list[str],
                                              capsys: pytest.CaptureFixture[str]) -> None:
    for options, words in ((["--by-diameter", "--reduce", "3"], "contact pairs"),
                           ([*pairs, "--by-diameter"], "--reduce")):
        assert main(command(folder, *options, "-o", "never.h5")) == 3
        assert words in capsys.readouterr().err


def test_what_is_refused(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    left = (folder / "left.csv").read_text().splitlines()

    def refused(*options: str) -> str:
        assert main(command(folder, "--check", *options)) == 3
        return capsys.readouterr().err

    (tmp_path / "short.csv").write_text("\n".join(left[:-1]))
    assert "equal meshes" in refused("--left", str(tmp_path / "short.csv"))
    assert "is the axis right" in refused("--axis=-z")
    assert "turned by 90 degrees" in refused("--sectors", "4")
    node, *place = left[1].split(",")
    moved = [left[0], ",".join([node, f"{float(place[0]) + 0.1}", *place[1:]]), *left[2:]]
    (tmp_path / "moved.csv").write_text("\n".join(moved))
    assert f"node {node} " in refused("--left", str(tmp_path / "moved.csv"))
    (tmp_path / "other.csv").write_text("\n".join([left[0], "999999," + ",".join(place),
                                                   *left[2:]]))
    assert "both need the same" in refused("--left", str(tmp_path / "other.csv"))
    assert "--sectors" in refused_alone(folder, capsys)


def refused_alone(folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["import", str(folder / "mass.mtx"), str(folder / "stiffness.mtx"), "--check",
                 "--left", str(folder / "left.csv")]) == 3
    return capsys.readouterr().err


def test_mesh_of_cylindrical_and_cartesian_nodes(full: FullDisk, folder: Path,
                                                 tmp_path: Path) -> None:
    """The same sector in nodal systems that turn with it and in global ones: one structure, and a
    motion of its nodes is shown as it is by both."""
    meshio = pytest.importorskip("meshio")
    assembly = Assembly(full.sector.mesh, full.parameters.material)
    nodes = assembly.nodes
    meshio.Mesh(nodes.T, [("hexahedron", full.sector.mesh.t[[0, 3, 6, 2, 1, 5, 7, 4]].T)],
                point_data={"node": np.arange(assembly.n_nodes) + 1}).write(tmp_path / "sector.vtu")
    free = full.free.reshape(-1, 3)
    at = free[:, 0] // 3
    assert (free == 3 * at[:, None] + np.arange(3)).all()
    cosine, sine = nodes[:2, at] / np.hypot(*nodes[:2, at])
    zero, one = np.zeros(len(at)), np.ones(len(at))
    turned = sp.block_diag(np.array([[cosine, sine, zero], [-sine, cosine, zero],
                                     [zero, zero, one]]).transpose(2, 0, 1), format="csr")
    for name, matrix in (("mass", full.mass), ("stiffness", full.stiffness)):
        scipy.io.mmwrite(tmp_path / f"{name}.mtx", sp.coo_array(turned @ matrix @ turned.T),
                         symmetry="symmetric")
    for name in ("labels.txt", "left.csv", "right.csv"):
        (tmp_path / name).write_text((folder / name).read_text())
    motion = np.random.default_rng(3).standard_normal(len(full.free))
    expected = np.zeros((assembly.n_nodes, 3))
    expected[at] = motion.reshape(-1, 3)
    found = {}
    for frames, source in (("cylindrical", tmp_path), ("cartesian", folder)):
        target = tmp_path / f"{frames}.h5"
        assert main(command(source, "-q", "--frames", frames, "--mesh",
                            str(tmp_path / "sector.vtu"), "-o", str(target))) == 0
        found[frames] = frequencies(tmp_path, target)
        q = turned @ motion if frames == "cylindrical" else motion.copy()
        with h5py.File(target) as file:
            if frames == "cartesian":
                # Components of the right interface are those of the next sector.
                right = np.abs(file["cyclic/right"][()]).astype(int) - 1
                step = 2.0 * np.pi / 12
                frame = np.array([[np.cos(step), -np.sin(step), 0.0],
                                  [np.sin(step), np.cos(step), 0.0], [0.0, 0.0, 1.0]])
                own = np.isin(np.arange(len(q)), right).reshape(-1, 3).all(axis=1)
                q = q.reshape(-1, 3)
                q[own] = q[own] @ frame
                q = q.ravel()
            shown = (file["mesh/basis"][()] @ q).reshape(-1, 3)
            points = file["mesh/points"][()]
        order = [int(np.argmin(np.linalg.norm(nodes.T - point, axis=1))) for point in points]
        assert np.abs(shown - expected[order]).max() < SINGLE
    assert found["cylindrical"] == pytest.approx(found["cartesian"], rel=SAME)
