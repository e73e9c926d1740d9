"""`fretwear import --contact-neighbour`: surfaces that touch those of the next sector, judged by
the whole ring and by a cut elsewhere, which has the same surfaces inside of a sector."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from project import PROGRAM
from scipy.sparse.linalg import spsolve
from shrouded_ring import (
    FIRST,
    SHEAR,
    STEP,
    N,
    Ring,
    pressure_load,
    rotation,
    through_blades,
    through_cracks,
    whole,
)

from fretwear._native import unread_parts
from fretwear.cli import main
from fretwear.importer.contact import Couple, pairs_of_surfaces, read_named
from fretwear.importer.labels import Dofs
from fretwear.surfaces import Surface, contact_pairs

#: Gap of the cracks, and how far the meshes on both sides differ, inside and along their edges.
SIZES = GAP, DIFFER, SHIFT = 0.02, 0.8, 0.9
#: Where the load acts and what is observed, in the part that both cuts have in common.
LOADED, SEEN = (1, 3, 2, 0), (1, 2, 0, 0)
ETA, STIFFNESS = 0.02, (4.0e3, 4.0e3, 9.0e3)
FREQUENCIES = (0.0, 1500.0, 4200.0, 9000.0)
#: Between solutions of one structure by two bases, with a conditioning of 1e4 (measured 3e-12).
EXACT = 1e-10
#: All modes that there are, of nodal diameters and of sectors with their interfaces.
ALL = "139"
KEPT = "103"


def load_of(ring: Ring) -> np.ndarray:
    load = np.zeros(3 * len(ring.nodes))
    at = 3 * ring.nodes.index(LOADED)
    load[at:at + 3] = [2.0, 3.0, 5.0]
    return load


def write(ring: Ring, folder: Path) -> list[str]:
    return [*ring.write(folder, {"cosine": load_of(ring)}), "--observe",
            *[f"x={ring.number(SEEN)}:1", "--observe", f"y={ring.number(SEEN)}:2", "--observe",
              f"z={ring.number(SEEN)}:3"]]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """Import of either cut."""
    path = tmp_path_factory.mktemp("ring")
    return {"cracks": write(through_cracks(*SIZES), path / "cracks"),
            "blades": write(through_blades(*SIZES), path / "blades")}


def complexes(values: np.ndarray) -> np.ndarray:
    return np.asarray(values[..., 0] + 1j * values[..., 1])


def springs(area: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Stiffness of each relative displacement: that of a pair by its area."""
    return (np.asarray(STIFFNESS) * area[:, None])[number > 0]


def answers(stiffness: Any, mass: Any, joint: Any, load: np.ndarray,
            seen: np.ndarray) -> np.ndarray:
    return np.array([seen @ spsolve(sp.csc_array(
        (1.0 + 1j * ETA) * stiffness + joint - (2.0 * np.pi * f)**2 * mass), load)
        for f in FREQUENCIES])


@cache
def ring_of_all() -> Ring:
    return whole(*SIZES)


def by_diameter(path: Path, k: int) -> np.ndarray:
    """Observed motion of the sector in a nodal diameter, by the file alone."""
    with h5py.File(path) as file:
        group = file[f"nodal_diameter/{k}"]
        mass, stiffness = complexes(group["mass"][()]), complexes(group["stiffness"][()])
        load, seen = complexes(group["load/cosine"][()]), complexes(group["observe/matrix"][()])
        number = file["contact/side_1"][()]
        assert sorted(number[number > 0]) == list(range(1, file["cyclic"].attrs["n_physical"] + 1))
        joint = np.zeros(len(mass))
        joint[number[number > 0] - 1] = springs(file["contact/area"][()], number)
    return answers(stiffness, mass, np.diag(joint), load, seen)


def of_the_ring(k: int, first: int) -> np.ndarray:
    """The same of all sectors, with pairs of two surfaces of one mesh; `first` carries them."""
    ring = ring_of_all()
    n = len(ring.nodes)
    faces = [Surface(ring.points, {"quad": ring.quads(side, 2)}, str(side)) for side in (1, -1)]
    pairs = contact_pairs(faces[first], faces[1 - first])
    # Nodes of a sector turned by one: the same grid lines, four later.
    later = np.array([ring.nodes.index(((node[0] + 4) % (4 * N), *node[1:]))
                      for node in ring.nodes])
    turn = sp.csr_array(sp.kron(sp.csr_array((np.ones(n), (later, np.arange(n))), (n, n)),
                                rotation(STEP)))
    z = np.exp(-2j * np.pi * k / N)
    joint, load = sp.csr_array((3 * n, 3 * n)), np.zeros(3 * n, dtype=complex)
    rows, part = sp.csr_array(pairs.matrix), load_of(ring).astype(complex)
    for _ in range(N):
        weight = np.repeat(pairs.area, 3) * np.tile(STIFFNESS, len(pairs))
        joint = joint + rows.T @ sp.diags_array(weight) @ rows
        load += part
        rows, part = sp.csr_array(rows @ turn.T), z * (turn @ part)
    seen = np.zeros((3, 3 * n))
    seen[:, 3 * ring.nodes.index(SEEN) + np.arange(3)] = np.eye(3)
    return answers(ring.stiffness, ring.mass, joint, load, seen)


def imported(arguments: list[str], path: Path, *options: str) -> Path:
    assert main([*arguments, *options, "-o", str(path)]) == 0
    assert unread_parts(str(path)) == []
    return path


@pytest.mark.parametrize("names", [("RIGHT", "LEFT"), ("LEFT", "RIGHT")])
def test_whole_ring_and_another_cut(files: dict[str, list[str]], names: tuple[str, str],
                                    tmp_path: Path) -> None:
    """Meshes that differ, a gap between them; surface 1 on either side of the crack, so that its
    partner is in the next sector or in the previous one."""
    end = ["--reduce", ALL, "--by-diameter"]
    cracks = imported(files["cracks"], tmp_path / "cracks.h5", "--contact-neighbour", *names, *end)
    blades = imported(files["blades"], tmp_path / "blades.h5", "--contact", *names, *end)
    with h5py.File(cracks) as one, h5py.File(blades) as two:
        for value in ("area", "gap"):
            assert one[f"contact/{value}"][()] == pytest.approx(two[f"contact/{value}"][()],
                                                               rel=1e-12, abs=1e-12)
        # The facing faces are not parallel to the last digit: the gap is along the normal.
        assert np.abs(one["contact/gap"][()] - GAP).max() <= 1e-12
    for k in range(N // 2 + 1):
        found = by_diameter(cracks, k)
        exact = of_the_ring(k, names.index("RIGHT"))
        scale = np.abs(exact).max(axis=1)[:, None]
        assert np.abs((found - by_diameter(blades, k)) / scale).max() <= EXACT
        assert np.abs((found - exact) / scale).max() <= EXACT


@pytest.mark.parametrize("reduced", [True, False])
def test_sector_with_its_interfaces(files: dict[str, list[str]], reduced: bool,
                                    tmp_path: Path) -> None:
    """With a mesh to show, and the response of the program to a wave: as of nodal diameters."""
    end = {"cracks": ["--contact-neighbour", "RIGHT", "LEFT"], "blades": ["--contact", "RIGHT",
                                                                        "LEFT"]}
    found = {}
    for name, options in end.items():
        own = imported(files[name], tmp_path / f"{name}_whole.h5", *options,
                       *(["--reduce", KEPT] if reduced else []))
        with h5py.File(own) as file:
            assert len(file["mesh/points"]) >= len(through_cracks().nodes)
            assert ("contact/sector_2" in file) == (name == "cracks")
            assert len(file["cyclic/left"]) == (18 if name == "cracks" else 36)
        found[name] = response(own, tmp_path)
    # The contact slips: with less friction it is another motion.
    assert np.abs(response(own, tmp_path, mu=0.25) - found[name]).max() > (
        1e-3 * np.abs(found[name]).max())
    split = imported(files["cracks"], tmp_path / "split.h5", *end["cracks"], "--reduce", ALL,
                     "--by-diameter")
    exact = response(split, tmp_path)
    # Equations are solved to 1e-10 of the forces.
    for values in found.values():
        assert np.abs(values - exact).max() <= 1e-7 * np.abs(exact).max()


def response(model: Path, folder: Path, mu: float = 0.3) -> np.ndarray:
    """Coefficients of the observed motion at points where the contact slips."""
    (folder / "case.nml").write_text(
        f"&case analysis = 'frf' /\n&model source = 'hdf5' file = '{model}' rayleigh_stiffness = "
        "2e-7 /\n&contact law = 'penalty' tangential_stiffness = 4e4 normal_stiffness = 9e4 mu = "
        f"{mu} gap = -1e-4 /\n&cyclic engine_order = 2 /\n&harmonics n_harmonics = 3 /\n"
        "&sweep start = 1800 end = 2600 unit = 'Hz' n_points = 7 /\n")
    result = folder / f"{model.stem}_result.h5"
    subprocess.run([PROGRAM, "-q", "-o", result, folder / "case.nml"], check=True)
    with h5py.File(result) as file:
        assert (file["converged"][()] == 1).all()
        values: np.ndarray = file["coefficients"][()]
        return values


def test_patch(tmp_path: Path) -> None:
    """All sectors shrink alike in their plane: forces of stuck pairs are a constant pressure times
    their areas, and nothing along the surfaces."""
    ring = through_cracks(0.0, DIFFER)
    strain = 1e-4
    motion = -strain * ring.points * [1.0, 1.0, 0.0]
    pressure = 2.0 * (FIRST + SHEAR) * strain
    touching = sum(pressure_load(ring.points, ring.quads(side, line))
                   for side, line in ((1, 2), (-1, -2)))
    load = ring.stiffness @ motion.ravel() - pressure * touching
    arguments = ring.write(tmp_path, {"static": load})
    for names in (("RIGHT", "LEFT"), ("LEFT", "RIGHT")):
        path = imported(arguments, tmp_path / "model.h5", "--contact-neighbour", *names,
                        "--reduce", "10", "--by-diameter")
        with h5py.File(path) as file:
            number, area = file["contact/side_1"][()], file["contact/area"][()]
            force = complexes(file["nodal_diameter/0/load/static"][()])[number - 1]
        assert np.abs(force[:, 2] / area + pressure).max() <= EXACT * pressure
        assert np.abs(force[:, :2] / area[:, None]).max() <= EXACT * pressure


def test_rigid_motions_and_partition_of_unity(tmp_path: Path) -> None:
    """Averages of either side add up to one, and the ring as a whole moves no pair."""
    ring = through_cracks(*SIZES)
    ring.write(tmp_path, {"cosine": load_of(ring)})
    n = len(ring.nodes)
    dofs = Dofs(3 * n, [(k // 3 + 1, k % 3 + 1) for k in range(3 * n)])
    deck = read_named(tmp_path / "ring.inp")
    for names, sector in ((("RIGHT", "LEFT"), 1), (("LEFT", "RIGHT"), -1)):
        pairs, _ = pairs_of_surfaces(deck, [Couple(*names)], dofs, n_inside=0, turn=rotation(STEP))
        assert (pairs.sector_2 == sector).all() and len(pairs) == 6
        assert pairs.rows is not None and pairs.rows_2 is not None
        turn = rotation(sector * STEP)
        for c in range(3):
            one = np.tile(np.eye(3)[c], n)
            # Along the axes of the neighbour.
            two = np.tile(turn.T[:, c], n)
            assert np.abs(pairs.rows @ one - pairs.rows_2 @ two).max() <= 1e-13
            assert pairs.rows @ one @ (pairs.rows @ one) > 0.0
            axis = np.eye(3)[c]
            one = np.cross(axis, ring.points).ravel()
            two = (np.cross(axis, ring.points @ turn.T) @ turn).ravel()
            assert np.abs(pairs.rows @ one - pairs.rows_2 @ two).max() <= 1e-11
        size = [np.linalg.norm((rows @ np.tile(np.eye(3), (n, 1))).reshape(-1, 3, 3), axis=2)
                for rows in (pairs.rows, pairs.rows_2)]
        assert np.abs(np.array(size) - 1.0).max() <= 1e-12


def test_shrouds_that_match_are_not_tied(tmp_path: Path) -> None:
    """The cut faces are found by turning although the shrouds, node on node, would fit too; the
    wave of nodal diameter 2 is drawn with their pairs held."""
    ring = through_cracks()
    arguments = ring.write(tmp_path, {"cosine": load_of(ring)})
    path = imported(arguments, tmp_path / "model.h5", "--contact-neighbour", "RIGHT", "LEFT")
    with h5py.File(path) as file:
        assert len(file["cyclic/left"]) == 18
        assert len(file["contact/area"]) == 6
    assert main([*arguments, "--contact-neighbour", "RIGHT", "LEFT", "--check",
                 str(tmp_path / "wave.png"), "--engine-order", "2"]) == 0
    assert (tmp_path / "wave.png").stat().st_size > 5000


def test_crack_that_ends_at_a_tied_face(tmp_path: Path) -> None:
    """Nodes at its end are of surfaces that touch, and of the tied face too."""
    end = ["--reduce", "130", "--by-diameter"]
    found = {}
    for name, ring, option in (("cracks", through_cracks(*SIZES, True), "--contact-neighbour"),
                               ("blades", through_blades(*SIZES, True), "--contact")):
        found[name] = imported(write(ring, tmp_path / name), tmp_path / f"{name}.h5", option,
                               "RIGHT", "LEFT", "--reach", "5", *end)
    for k in range(N // 2 + 1):
        one, two = (by_diameter(path, k) for path in found.values())
        assert np.abs((one - two) / np.abs(one).max(axis=1)[:, None]).max() <= EXACT


def test_what_is_refused(files: dict[str, list[str]], tmp_path: Path,
                         capsys: pytest.CaptureFixture[str]) -> None:
    end = ["--reduce", "5", "--by-diameter", "-o", str(tmp_path / "x.h5")]

    def refused(*options: str) -> str:
        assert main([*files["cracks"], *options, *end]) == 3
        return capsys.readouterr().err

    words = refused("--contact-neighbour", "RIGHT", "BLADE", "--reach", "1")
    assert "BLADE of the" in words and "sector" in words
    assert (tmp_path / "x_contact_refused.png").stat().st_size > 5000
    words = refused("--contact", "RIGHT", "LEFT", "--reach", "1")
    assert "face each other nowhere" in words and "of the next sector: --contact-neighbour" in words
    assert "global axes" in refused("--contact-neighbour", "RIGHT", "LEFT", "--frames",
                                    "cylindrical")
    alone = [word for word in files["cracks"] if word not in ("--sectors", str(N))]
    assert main([*alone, "--contact-neighbour", "RIGHT", "LEFT", *end[:2], *end[3:]]) == 3
    assert "needs --sectors" in capsys.readouterr().err
