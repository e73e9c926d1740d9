"""The shrouded disk: its frequencies, its rows, its file, and nine of its sectors as an annulus."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from program import run
from project import PROGRAM

from fretwear._native import unread_parts
from fretwear.disk import (
    DiskParameters,
    FullDisk,
    ReducedDisk,
    build_full,
    read_parameters,
    reduce_disk,
    write_model,
)
from fretwear.disk.cli import main
from fretwear.disk.parameters import ParameterError
from fretwear.disk.rows import turn
from fretwear.model_file import write_model_file

EXAMPLE = Path(__file__).resolve().parents[2] / "example" / "shrouded_disk"
#: Another program's disk of the same drawing, first and second family [Hz].
OPEN = {0: (387.9, 852.1), 1: (388.5, 851.7), 2: (388.8, 869.4), 3: (388.9, 929.2),
        4: (388.8, 1000.5), 6: (388.7, 1087.7), 9: (388.5, 1138.7), 12: (388.4, 1159.8),
        18: (388.3, 1172.1)}
CLOSED = {0: 657.9, 1: 863.7, 2: 898.8, 3: 1037.3, 4: 1288.3, 6: 2090.3, 9: 3894.0, 12: 3904.0,
          18: 3478.9}
#: Relative difference: its nodes on the twisted blade stand elsewhere by a little.
DRAWING = 0.0025
#: Of what the reduction leaves; it keeps 30 modes, far above the first families.
REDUCED = 3e-5


@pytest.fixture(scope="module")
def full() -> FullDisk:
    return build_full(DiskParameters())


@pytest.fixture(scope="module")
def reduced(full: FullDisk) -> ReducedDisk:
    return reduce_disk(full)


def test_sizes(full: FullDisk, reduced: ReducedDisk) -> None:
    assert full.sector.mesh.t.shape[1] == 50
    assert len(reduced.left) == len(reduced.right) == 90
    assert len(reduced.mass) == 236 and len(reduced.area) == 4


@pytest.mark.parametrize("k", OPEN)
def test_frequencies_of_nodal_diameters(reduced: ReducedDisk, k: int) -> None:
    assert reduced.frequencies(k, n=2) == pytest.approx(OPEN[k], rel=DRAWING)
    assert reduced.frequencies(k, closed=True, n=1)[0] == pytest.approx(CLOSED[k], rel=DRAWING)


@pytest.mark.parametrize("k", [0, 4, 18])
def test_reduction(full: FullDisk, reduced: ReducedDisk, k: int) -> None:
    """Against the tied finite elements themselves."""
    n, z = full.n_interface, np.exp(-2j * np.pi * k / 36)
    left, right = full.rows[:n].tocsc(), full.rows[n:2 * n].tocsc()
    others = np.setdiff1d(np.arange(left.shape[1]), right.tocoo().col)
    # Interface rows are orthonormal, so their transposes bring them back.
    tie = sp.csc_array(sp.identity(left.shape[1], format="csc")[:, others]
                       + z * (right.T @ left[:, others]))
    stiffness, mass = (sp.csc_matrix(tie.conj().T @ matrix @ tie)
                       for matrix in (full.stiffness, full.mass))
    squares = spl.eigsh(stiffness, k=2, M=mass, sigma=0.0, return_eigenvectors=False)
    exact = np.sqrt(np.sort(squares.real)) / (2.0 * np.pi)
    assert reduced.frequencies(k, n=2) == pytest.approx(exact, rel=REDUCED)


@pytest.mark.parametrize("name", ["along", "around"])
def test_all_sectors_move_as_one(full: FullDisk, name: str) -> None:
    """A motion of the whole disk as a rigid body moves no pair, and both interfaces alike."""
    from fretwear.sector.assembly import Assembly
    nodes = Assembly(full.sector.mesh, full.parameters.material).nodes
    field = np.zeros_like(nodes.T)
    if name == "along":
        field[:, 2] = 1.0
    else:
        field[:, 0], field[:, 1] = -nodes[1], nodes[0]
    moved = full.rows @ field.ravel()[full.free]
    n, pairs = full.n_interface, 3 * full.parameters.n_patches
    scale = np.abs(moved).max()
    assert moved[:n] == pytest.approx(moved[n:2 * n], abs=1e-12 * scale)
    sides = moved[2 * n:2 * n + 2 * pairs]
    assert sides[:pairs] == pytest.approx(sides[pairs:], abs=1e-12 * scale)
    assert turn(0.3) @ turn(-0.3) == pytest.approx(np.eye(3))


def test_the_committed_model_is_the_generated_one(reduced: ReducedDisk, tmp_path: Path) -> None:
    path = EXAMPLE / "disk.h5"
    assert path.stat().st_size < 1e6
    assert read_parameters(path) == DiskParameters()
    begin = time.perf_counter()
    assert main(["-o", str(tmp_path / "disk.h5"), "-q"]) == 0
    assert unread_parts(str(tmp_path / "disk.h5")) == []
    assert time.perf_counter() - begin < 30.0
    with h5py.File(path) as committed, h5py.File(tmp_path / "disk.h5") as made:
        for name in ("mass", "stiffness", "load/cosine", "contact/area", "observe/matrix"):
            size = np.abs(committed[name][()]).max()
            # Signs of modes may turn on another processor.
            assert np.abs(committed[name][()]) == pytest.approx(np.abs(made[name][()]),
                                                                abs=1e-6 * size)


def test_what_no_disk_can_be_made_of(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ParameterError, match="blade_angle"):
        DiskParameters(blade_angle=11.0)
    with pytest.raises(ParameterError, match="rim_radius"):
        DiskParameters(rim_radius=50.0)
    with pytest.raises(ParameterError, match=r"axial_patches = 6 .* at most 5"):
        DiskParameters(axial_patches=6)
    assert main(["-o", str(tmp_path / "a.h5"), "--n-sectors", "2"]) == 3
    assert "n_sectors = 2" in capsys.readouterr().err
    assert main(["-o", str(tmp_path / "none" / "a.h5")]) == 5


CASE = """&case title = 'disk' threads = 1 /
&model source = 'hdf5' file = '{file}' rayleigh_mass = 4.0489 rayleigh_stiffness = 6.1745e-8 /
{cyclic}
&contact law = 'penalty' tangential_stiffness = 73263 normal_stiffness = 73263 /
&load harmonic_scale = 100 /
&harmonics n_harmonics = 3 sampling = 'uniform' n_time = 144 /
&sweep start = 1000 unit = 'Hz' n_points = 1 /
&solver tolerance = 1e-12 /
"""


def solve(folder: Path, name: str, file: Path, cyclic: str) -> h5py.File:
    text = CASE.format(file=file, cyclic=cyclic).replace(
        "&case title", "&case analysis = 'point' title").replace(" n_points = 1", "")
    (folder / f"{name}.nml").write_text(text)
    subprocess.run([PROGRAM, "-q", "-o", folder / f"{name}_result.h5", folder / f"{name}.nml"],
                   check=True)
    return h5py.File(folder / f"{name}_result.h5")


def test_thirty_six_sectors_move_as_nine_and_as_the_annulus_of_nine(reduced: ReducedDisk,
                                                                    tmp_path: Path) -> None:
    """Loaded so much that all pairs slip in every period, which then does not depend on its begin.
    """
    write_model(reduced, tmp_path / "disk.h5")
    nine = tmp_path / "nine.h5"
    nine.write_bytes((tmp_path / "disk.h5").read_bytes())
    with h5py.File(nine, "r+") as file:
        file["cyclic"].attrs["n_sectors"] = np.int32(9)
    annulus(reduced, tmp_path / "annulus.h5")
    first = solve(tmp_path, "first", tmp_path / "disk.h5", "&cyclic engine_order = 4 /")
    second = solve(tmp_path, "second", nine, "&cyclic engine_order = 1 /")
    whole = solve(tmp_path, "whole", tmp_path / "annulus.h5", "")
    assert first["converged"][0] == whole["converged"][0] == 1
    assert np.array_equal(first["coefficients"][()], second["coefficients"][()])
    own, other = first["coefficients"][0], whole["coefficients"][0]
    assert np.abs(own - other).max() < 1e-9 * np.abs(own).max()
    force, around = first["contact/force"][0], whole["contact/force"][0, :, :4]
    assert np.abs(force - around).max() < 1e-8 * np.abs(force).max()
    assert first["contact/fraction"][0, :, 1].min() > 0.05  # all of them slip


def annulus(disk: ReducedDisk, path: Path) -> None:
    """Nine sectors without any cyclic key; the load goes around once."""
    n, size = 9, len(disk.mass)
    kept = np.setdiff1d(np.arange(size), disk.right - 1)
    place = {int(dof): p for p, dof in enumerate(kept)}
    maps = []
    for j in range(n):
        own = np.zeros((size, n * len(kept)))
        own[kept, j * len(kept) + np.arange(len(kept))] = 1.0
        following = (j + 1) % n * len(kept)
        own[disk.right - 1, [following + place[int(left) - 1] for left in disk.left]] = 1.0
        maps.append(own)
    load = np.zeros(size)
    load[disk.load_point - 1] = 1.0
    delayed = [np.exp(-2j * np.pi * j / n) for j in range(n)]
    force = sum(z * (t.T @ load) for z, t in zip(delayed, maps))

    def numbers(side: np.ndarray, ahead: int) -> np.ndarray:
        return np.concatenate([(j + ahead) % n * len(kept)
                               + np.vectorize(place.get)(side - 1) + 1 for j in range(n)])

    write_model_file(path, {
        "mass": sum(t.T @ disk.mass @ t for t in maps),
        "stiffness": sum(t.T @ disk.stiffness @ t for t in maps),
        "contact/side_1": numbers(disk.side_1, 0).astype(np.int32),
        "contact/side_2": numbers(disk.side_2, 1).astype(np.int32),
        "contact/mu": np.full(4 * n, 0.3), "contact/gap": np.full(4 * n, -0.04),
        "load/static": np.zeros(n * len(kept)), "load/cosine": np.asarray(force).real,
        "load/sine": -np.asarray(force).imag,
        "observe/name": np.array([b"tip", b"load_point"]),
        "observe/matrix": maps[0][[disk.tip - 1, disk.load_point - 1]],
    }, title="nine sectors")


def test_the_wave_of_the_example(tmp_path: Path) -> None:
    """The other blades are that of sector 0, later."""
    result = run(EXAMPLE / "wave.nml", tmp_path / "wave.h5", "sweep%n_points=1",
                 "case%analysis=point", "sweep%start=1261")
    first, ninth = result.sector(0)[0, :, 0], result.sector(9)[0, :, 0]
    assert first == pytest.approx(ninth, rel=1e-12)  # 4 times 9 is one turn
    assert result.sector(1)[0, 1, 0] != pytest.approx(first[1], rel=1e-3)
