"""The picture of `fretwear import --check`: the wave that a run would have, and its direction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from stored_wheel import N_SECTORS, StoredWheel
from test_import_calculix import WHEEL, frequencies, run_import

from fretwear.errors import InputError
from fretwear.importer import Dofs, FullModel
from fretwear.importer.matrices import read_matrices
from fretwear.importer.meshes import read_mesh_file
from fretwear.importer.sectors import cut_faces, in_sector_frames, pair_faces
from fretwear.importer.wheel import Wheel, wheel_of

#: Of a mode by two solvers, and of motions that are the same.
EXACT = 1e-8


def sector(folder: Path, axis: str = "z") -> FullModel:
    found, mesh = read_matrices(folder / "sector.dof"), read_mesh_file(folder / "sector.inp")
    assert found.labels is not None
    bore = {(node, c) for node in mesh.sets["BORE"] for c in (1, 2, 3)}
    dofs = Dofs(len(found.labels), found.labels, held=bore)
    left, right, _ = cut_faces(N_SECTORS, None, None, axis, mesh)
    faces = pair_faces(N_SECTORS, left, right, dofs, axis, mesh)
    model = in_sector_frames(FullModel(dict(found.matrices), dofs), faces)
    return replace(model, interfaces=faces, mesh=mesh, axis=axis)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("wheel")
    StoredWheel(path)
    return path


def test_the_wave_is_that_of_a_run(folder: Path, tmp_path: Path) -> None:
    """Frequencies are those of the program; neighbours meet at the cut; each sector is the one
    before it, later by the engine order over their number of a period."""
    assert run_import(folder / "sector.inp", "-q", "--sectors", N_SECTORS, "-o",
                      tmp_path / "sector.h5") == 0
    exact = frequencies(tmp_path, tmp_path / "sector.h5") / (2.0 * np.pi)
    model = sector(folder)
    for order in (0, 1, -2, 7):
        wheel = wheel_of(model, order)
        assert wheel.frequency == pytest.approx(exact[abs(wheel.diameter), 0], rel=EXACT)
        scale = np.abs(wheel.motion).max()
        # Nodes of sector 0 on its right face are nodes of sector 1 on its left face.
        gap = np.linalg.norm(wheel.points[0][:, None] - wheel.points[1][None], axis=2)
        one, other = np.nonzero(gap < 1e-6)
        assert len(one) == 6
        assert np.abs(wheel.motion[0][one] - wheel.motion[1][other]).max() < EXACT * scale
        own = wheel.components()
        later = np.exp(-2j * np.pi * order / N_SECTORS)
        assert np.abs(own[1:] - later * own[:-1]).max() < EXACT * scale


@pytest.mark.parametrize(("order", "diameter"), [(1, 1), (2, 2), (3, -2), (4, -1), (-1, -1),
                                                 (6, 1), (-7, -2)])
def test_the_sense_is_that_of_the_motion(folder: Path, order: int, diameter: int) -> None:
    """The displacements of two instants, matched by turning: the pattern has gone on by a part of
    the circle, towards the side that is told."""
    wheel = wheel_of(sector(folder), order)
    assert wheel.diameter == diameter and wheel.sense == np.sign(diameter)
    # After a sector over its diameter of a period the wave is one sector further.
    step = 2.0 * np.pi * abs(diameter) / N_SECTORS
    now, then = (np.real(wheel.components() * np.exp(1j * phase)) for phase in (0.0, step))
    on, back = (np.abs(then - np.roll(now, k, axis=0)).max() for k in (1, -1))
    small, large = (on, back) if diameter > 0 else (back, on)
    assert small < EXACT * np.abs(now).max() < 0.1 * large
    crests = [wheel.crest(phase) for phase in (0.0, step)]
    assert crests[0] is not None and crests[1] is not None
    assert crests[1] - crests[0] == pytest.approx(np.sign(diameter) * 2.0 * np.pi / N_SECTORS)


def test_another_axis_turns_the_wave(folder: Path) -> None:
    """The same engine order about -z runs the other way in space: the same picture from behind."""
    one, other = (wheel_of(sector(folder, axis), 1) for axis in ("z", "-z"))
    assert one.sense == other.sense == 1
    assert one.frequency == pytest.approx(other.frequency, rel=EXACT)
    assert np.array(one.view()[2]).tolist() == [0.0, 0.0, 1.0]
    assert np.array(other.view()[2]).tolist() == [0.0, 0.0, -1.0]

    def turns(wheel: Wheel) -> float:
        """Sense in space about z, by the places of sectors."""
        first, second = (wheel.points[j].mean(axis=0) for j in (0, 1))
        return wheel.sense * float(np.sign(np.cross(first, second)[2]))

    assert (turns(one), turns(other)) == (1.0, -1.0)
    assert "runs about z, towards higher" in one.texts()[0]
    assert "runs about -z, towards higher" in other.texts()[0]
    assert "turns about z; for one that turns about -z give engine_order = -1" in other.texts()[2]
    still = wheel_of(sector(folder), 0)
    assert still.sense == 0 and still.crest(0.0) is None and "stands" in still.texts()[0]


def _arrow(picture: Path) -> float:
    """Sense of the arrow of the first panel: red pixels from the dot to the head."""
    with Image.open(picture) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)[:, :image.width // 3]
    red = np.argwhere(np.abs(pixels - [192, 57, 43]).max(axis=2) < 3)
    middle = np.argwhere((pixels < 250).any(axis=2)).mean(axis=0)
    angle = np.unwrap(np.sort(np.arctan2(middle[0] - red[:, 0], red[:, 1] - middle[1])))
    # The dot is a disk, wider than the head: most pixels are at the tail.
    return float(np.sign(0.5 * (angle.max() + angle.min()) - np.median(angle)))


def test_pictures(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    senses = []
    for name, more in (("one.png", ["--engine-order", 1]), ("back.png", ["--engine-order", -1])):
        assert run_import(folder / "sector.inp", "--sectors", N_SECTORS, "--check",
                          tmp_path / name, *more) == 0
        senses.append(_arrow(tmp_path / name))
    assert senses == [1.0, -1.0]
    assert "wave runs about -z, towards lower sectors" in capsys.readouterr().out
    assert run_import(folder / "sector.inp", "-q", "--sectors", N_SECTORS, "--check",
                      tmp_path / "one.html") == 0
    page = (tmp_path / "one.html").read_text()
    assert "nodal diameter 1, the wave runs about z" in page
    assert "data:image/gif;base64," in page and "http" not in page
    assert not (tmp_path / "sector.h5").exists()


def test_pictures_that_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_import(WHEEL, "--check", tmp_path / "one.png") == 3
    assert "goes with --sectors and a mesh" in capsys.readouterr().err
    assert run_import(WHEEL, "--sectors", 8, "--check", "--engine-order", 2) == 3
    assert "goes with --check PICTURE" in capsys.readouterr().err
    # What follows --check and is no picture is a file to read.
    assert run_import("--sectors", 8, "--check", WHEEL) == 0
    with pytest.raises(InputError, match="goes with --sectors"):
        wheel_of(FullModel({}, Dofs(0)), 1)


