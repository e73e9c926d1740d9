"""The job of example/own_mesh: mesh of Gmsh, matrices of CalculiX, response, files of ParaView."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
from project import ROOT
from test_import_calculix import WRITTEN, frequencies, run_import

import fretwear as fw
from fretwear.cli import main
from fretwear.importer.deck import read_deck
from fretwear.importer.meshes import read_mesh_file
from fretwear.importer.sectors import cut_faces

EXAMPLE = ROOT / "example" / "own_mesh"
PAGE = EXAMPLE / "README.md"
#: The mesh and its motion are kept in single precision.
STORED = 1e-4
MODEL = ["--material", "210000,0.3,7.85e-9", "--fix", "BORE", "--load", "TIP:3=3", "--sectors", 12,
         "--pairs", "pairs.csv", "--observe", "tip=TIP:3"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example with its mesh, by the command of its page."""
    for program in ("gmsh", "ccx"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed (apt install gmsh calculix-ccx)")
    path = tmp_path_factory.mktemp("own_mesh")
    for file in EXAMPLE.iterdir():
        shutil.copy(file, path)
    page = PAGE.read_text()
    for command in re.findall(r"^    (gmsh .*)$", page, re.MULTILINE):
        subprocess.run(command, shell=True, cwd=path, check=True, capture_output=True)
    return path


def test_from_gmsh_to_paraview(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    assert run_import("disk.msh", "-q", "--ccx", *MODEL, "--reduce", 12, "-o", "disk.h5") == 0
    # The lines of the page, but for the picture.
    lines = re.findall(r"```python\n(.*?)result.animate", PAGE.read_text(), re.DOTALL)
    exec(lines[0], {})
    with h5py.File("frf.h5") as file:
        assert (file["converged"][()] == 1).all()
        amplitude, coefficients = file["amplitude"][()][:, 0], file["coefficients"][()][:, :, 0]
    assert main(["export", "frf.h5", "disk.vtu", "--sectors", "all", "--frames", "2"]) == 0
    moved = meshio.read("disk_000.vtu")
    assert Path("disk.pvd").is_file()
    # The tip of sector 0 in the file moves as the response says.
    tip = int(np.argmin(np.linalg.norm(moved.points - [60.0, 0.0, 5.0], axis=1)))
    assert moved.points[tip] == pytest.approx([60.0, 0.0, 5.0], abs=1e-4)
    cosine, sine = (moved.point_data[f"displacement_{part}"] for part in ("cosine", "sine"))
    largest = coefficients[int(np.argmax(amplitude))]
    assert [cosine[tip, 2], sine[tip, 2]] == pytest.approx(largest[1:3], rel=STORED)
    # Twelve sectors later: the same motion, two twelfths of a period behind for each.
    around = moved.points[:, :2] @ np.array([1.0, 1j])
    later = int(np.argmin(np.abs(around - 60.0 * np.exp(2j * np.pi / 12))
                          + np.abs(moved.points[:, 2] - 5.0)))
    motion = cosine[:, 2] - 1j * sine[:, 2]
    assert motion[later] == pytest.approx(motion[tip] * np.exp(-2j * np.pi * 2 / 12),
                                          rel=STORED)


def test_frequencies_are_those_of_the_cyclic_symmetry_of_calculix(
        folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    # The deck that the import of the mesh wrote, imported as one's own.
    assert run_import("disk.msh", "-q", "--ccx", *MODEL, "--check") == 0
    assert run_import("disk_ccx.inp", "-q", "--ccx", "--fix", "BORE", "--sectors", 12, "-o",
                      "free.h5") == 0
    found = frequencies(folder, folder / "free.h5")
    mesh = read_mesh_file("disk_ccx.inp")
    held = set(mesh.sets["BORE"])
    left, right, _ = cut_faces(12, None, None, "z", mesh)
    sets = "".join(f"*SURFACE, NAME={name}, TYPE=NODE\n" + "".join(
        f"{node}\n" for node in face.nodes if node not in held)
        for name, face in (("LEFT", left), ("RIGHT", right)))
    deck = (folder / "disk_ccx.inp").read_text().partition("*STEP")[0] + (
        "*BOUNDARY\nBORE, 1, 3\n")
    (folder / "cyclic.inp").write_text(
        deck + sets + "*TIE, NAME=CUT, CYCLIC SYMMETRY\nLEFT, RIGHT\n"
        "*CYCLIC SYMMETRY MODEL, N=12, TIE=CUT\n0, 0, 0, 0, 0, 1\n" + "".join(
            f"*STEP\n*FREQUENCY\n2\n*SELECT CYCLIC SYMMETRY MODES, NMIN={k}, NMAX={k}\n*END STEP\n"
            for k in (1, 2, 5)))
    subprocess.run(["ccx", "cyclic"], check=True, capture_output=True)
    table = [line.split() for line in (folder / "cyclic.dat").read_text().splitlines()]
    for k in (1, 2, 5):
        own = min(float(words[3]) for words in table
                  if len(words) == 6 and words[0] == str(k) and words[1].isdigit())
        assert found[k, 0] == pytest.approx(own, rel=WRITTEN)


def test_shrouds(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The commands of the page: pairs are the whole face of the shroud, which is not tied."""
    monkeypatch.chdir(folder)
    text, = re.findall(r"^    fretwear import (shroud\.msh (?:.*\\\n)*.*)$", PAGE.read_text(),
                       re.MULTILINE)
    assert run_import("-q", *text.replace("\\\n", " ").split()) == 0
    with h5py.File("shroud.h5") as file:
        assert file["contact/area"][()].sum() == pytest.approx(36.0, rel=1e-6)
        assert np.abs(file["contact/gap"][()]).max() < 1e-6
        n = len(file["contact/side_1"])
    result = fw.frf("shroud.h5", 1900, 2300, 2, unit="Hz", cyclic={"engine_order": 2},
                    structure={"modal_damping": 1e-3}, contact={
                        "law": "penalty", "tangential_stiffness": 2e4, "normal_stiffness": 5e4,
                        "gap": -2e-2})
    assert result.converged.all() and n >= 4


#: A box of tetrahedra, or by layers of wedges or hexahedra.
BOX = """SetFactory("Built-in");
Point(1) = {{0, 0, 0, 0.6}}; Point(2) = {{1.1, 0.1, 0, 0.6}}; Point(3) = {{1, 1, 0, 0.6}};
Point(4) = {{0, 0.9, 0, 0.6}};
Line(1) = {{1, 2}}; Line(2) = {{2, 3}}; Line(3) = {{3, 4}}; Line(4) = {{4, 1}};
Curve Loop(1) = {{1, 2, 3, 4}}; Plane Surface(1) = {{1}};
{recombine}
Extrude {{0, 0, 1.3}} {{ Surface{{1}}; {layers} }}
Physical Volume("BOX") = Volume{{:}}; Physical Surface("SKIN") = Surface{{:}};
Mesh.ElementOrder = {order}; Mesh.SecondOrderIncomplete = 1;
"""
CELLS = {"tetrahedra": ("", ""), "wedges": ("", "Layers{3}; Recombine;"),
         "hexahedra": ("Recombine Surface {1};", "Layers{3}; Recombine;")}


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cells", CELLS)
def test_nodes_of_cells_are_in_the_order_of_calculix(cells: str, order: int, tmp_path: Path,
                                                     monkeypatch: pytest.MonkeyPatch) -> None:
    """Constant strain leaves every inner node without force."""
    for program in ("gmsh", "ccx"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed (apt install gmsh calculix-ccx)")
    monkeypatch.chdir(tmp_path)
    recombine, layers = CELLS[cells]
    Path("box.geo").write_text(BOX.format(recombine=recombine, layers=layers, order=order))
    subprocess.run(["gmsh", "-3", "box.geo"], check=True, capture_output=True)
    assert run_import("box.msh", "-q", "--ccx", "--material", "210000,0.3,7.85e-9", "-o",
                      "box.h5") == 0
    deck = read_deck(Path("box_ccx.inp"))
    assert len(deck.blocks) == 1
    words = [word.split(".") for word in Path("box_ccx.dof").read_text().split()]
    place = {int(node): point for node, point in zip(deck.nodes, deck.points)}
    slope = np.array([[1.0, 0.3, 0.2], [0.1, -0.7, 0.4], [-0.5, 0.6, 0.9]])
    motion = np.array([slope[int(c) - 1] @ place[int(node)] for node, c in words])
    with h5py.File("box.h5") as file:
        force = file["stiffness"][()] @ motion
        size = np.abs(file["stiffness"][()]) @ np.abs(motion)
        mass = file["mass"][()]
    inner = np.array([int(node) not in deck.node_sets["SKIN"] for node, _ in words])
    assert inner.any()
    assert (np.abs(force)[inner] <= WRITTEN * size[inner]).all()
    along = np.array([float(c == "1") for _, c in words])
    assert along @ mass @ along == pytest.approx(7.85e-9 * 1.3 * 0.95, rel=WRITTEN)


def test_the_page_has_the_commands_that_are_tried_here() -> None:
    """What the page says of the import is what the tests above do."""
    page = PAGE.read_text()
    words = " ".join(page.replace("\\\n", " ").split())
    model = " ".join(map(str, MODEL))
    assert f"fretwear import disk.msh --ccx {model} --reduce 12 -o disk.h5" in words
    assert "fretwear export frf.h5 disk.vtu --sectors all" in page
