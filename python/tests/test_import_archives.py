"""Named surfaces of ANSYS archives and of Gmsh: a constant pressure passes through them as through
those of a deck, and what these files may hold is read or refused."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from deck_writers import write_archive, write_gmsh
from test_import_contact import PATCH, PRESSURE, imported, pile, write

from fretwear.cli import main
from fretwear.errors import InputError
from fretwear.importer import read_mesh_file
from fretwear.importer.archive import read_archive
from fretwear.importer.contact import read_named
from fretwear.importer.gmsh import read_gmsh

AREA = 1e-10
KINDS = [("C3D8", "C3D8"), ("C3D4", "C3D8"), ("C3D10", "C3D20"), ("C3D20", "C3D4")]


def pressed(folder: Path, file: Path, *names: str) -> None:
    """Forces at stuck pairs are the pressure times their areas."""
    path = imported(folder, "--contact-mesh", str(file), "--reduce", "5",
                    *(["--contact", *names] if names else ["--deck-contact"]))
    with h5py.File(path) as model:
        area, side_1 = model["contact/area"][()], model["contact/side_1"][()]
        normal = model["load/static"][()][side_1[:, 2] - 1]
        assert abs(area.sum() - 6.0) <= AREA
        assert np.abs(normal / area + PRESSURE).max() <= PATCH * PRESSURE


@pytest.mark.parametrize("kinds", KINDS)
def test_patch_of_archives(tmp_path: Path, kinds: tuple[str, str]) -> None:
    """Contact elements in both forms of EBLOCK, named selections of nodes and of elements, types
    one by one and in a block, tetrahedra as degenerate hexahedra."""
    made = pile(kinds)
    write(tmp_path, made)
    file = tmp_path / "blocks.cdb"
    write_archive(file, made)
    pressed(tmp_path, file)
    write_archive(file, made, solid=False, by_block=True)
    pressed(tmp_path, file, "TARGE_5", "conta_5")
    write_archive(file, made, as_hexahedra=True)
    pressed(tmp_path, file, "top", "BOTTOM")
    # What the boxes have in common of their whole skins is where they touch.
    pressed(tmp_path, file, "LOW", "BOTTOM")


@pytest.mark.parametrize("version", ["2.2", "4.1"])
@pytest.mark.parametrize("kinds", KINDS)
def test_patch_of_gmsh(tmp_path: Path, kinds: tuple[str, str], version: str) -> None:
    """Surfaces and volumes have the same numbers of groups; node numbers have gaps."""
    made = pile(kinds)
    write(tmp_path, made)
    file = tmp_path / "blocks.msh"
    write_gmsh(file, made, version)
    pressed(tmp_path, file, "TOP", "Bottom")
    pressed(tmp_path, file, "HIGH", "TOP")


@pytest.mark.parametrize("kinds", KINDS)
def test_meshes_are_those_of_the_deck(tmp_path: Path, kinds: tuple[str, str]) -> None:
    """Numbers, places, cells and the middles of edges, whoever lists them."""
    made = pile(kinds)
    write(tmp_path, made)
    expected = read_mesh_file(tmp_path / "blocks.inp")
    write_archive(tmp_path / "a.cdb", made)
    write_archive(tmp_path / "b.cdb", made, as_hexahedra=True, solid=False)
    write_gmsh(tmp_path / "c.msh", made, "2.2")
    write_gmsh(tmp_path / "d.msh", made, "4.1")

    def cells(mesh: object) -> set[tuple[int, ...]]:
        return {tuple(sorted(mesh.nodes[row[row >= 0]].tolist()))  # type: ignore[attr-defined]
                for row, kind in zip(mesh.cells, mesh.kind)        # type: ignore[attr-defined]
                if kind >= 10}

    def middles(mesh: object) -> set[tuple[int, ...]]:
        return {(*sorted(row[:2]), row[2])
                for row in mesh.middles.tolist()}                  # type: ignore[attr-defined]

    for name in ("a.cdb", "b.cdb", "c.msh", "d.msh"):
        found = read_mesh_file(tmp_path / name)
        place = dict(zip(found.all_nodes.tolist(), found.all_points))
        assert set(place) == set(made.numbers.tolist())
        for node, point in zip(made.numbers.tolist(), made.points):
            assert place[node] == pytest.approx(point, abs=1e-12)
        assert cells(found) == cells(expected)
        assert middles(found) == middles(expected)
        assert set(found.sets["TOP"]) == set(made.numbers[made.nodes(0, 2, 1.0)].tolist())


def plane(folder: Path) -> Path:
    """Two squares with nodes in the middle of edges, 0.1 apart, and lines where they touch."""
    nodes = [(0, 0), (2, 0), (2, 1), (0, 1), (1, 0), (2, 0.5), (1, 1), (0, 0.5),
             (0, 1.1), (2, 1.1), (2, 2), (0, 2)]
    path = folder / "plane.msh"
    path.write_text(
        '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 "low"\n1 2 "high"\n2 1 "all"'
        "\n$EndPhysicalNames\n$Nodes\n12\n"
        + "".join(f"{3 * k} {x} {y} 0\n" for k, (x, y) in enumerate(nodes, 1))
        + "$EndNodes\n$Elements\n6\n1 8 2 1 1 9 12 21\n2 1 2 2 2 30 27\n"
        "3 16 2 1 1 3 6 9 12 15 18 21 24\n4 3 2 1 1 27 30 33 36\n"
        "5 3 2 7 1 27 30 33 36\n6 15 2 4 1 9\n$EndElements\n")
    return path


def test_lines_of_a_plane_mesh(tmp_path: Path) -> None:
    """Groups of curves are the edges that touch; a cell in two groups is one cell."""
    from fretwear.surfaces import contact_pairs

    named = read_named(plane(tmp_path))
    pairs = contact_pairs(named.surface("LOW"), named.surface("HIGH"), thickness=3.0)
    assert abs(pairs.area.sum() - 6.0) <= AREA and np.abs(pairs.gap - 0.1).max() <= AREA
    assert named.element_sets["GROUP_7"] < named.element_sets["ALL"]
    assert named.node_sets["GROUP_4"] == {9}
    assert sum(len(block.number) for block in named.cells if block.kind == "quad") == 2
    archive = tmp_path / "plane.cdb"
    elements = "".join(
        "".join(f"{v:9d}" for v in [1, kind, real, 1, 0, 0, 0, 0, len(nodes), 0, number, *nodes])
        + "\n" for number, kind, real, nodes in [
            (1, 182, 1, [1, 2, 3, 4]), (2, 182, 1, [5, 6, 7, 8]), (3, 169, 9, [3, 4]),
            (4, 172, 9, [5, 6])])
    archive.write_text(
        "".join(f"ET,{kind},{kind}\n" for kind in (169, 172, 182)) + "NBLOCK,3,,8\n(1i9,3e20.9e3)\n"
        + "".join(f"{k:9d}{x:20.9E}{y:20.9E}\n" for k, (x, y) in enumerate(
            [(0, 0), (2, 0), (2, 1), (0, 1), (0, 1.1), (2, 1.1), (2, 2), (0, 2)], 1))
        + "-1\nEBLOCK,19,SOLID\n(19i9)\n" + elements + "-1\n")
    named = read_named(archive)
    couple, = named.couples
    pairs = contact_pairs(named.surface(couple.one), named.surface(couple.two))
    assert abs(pairs.area.sum() - 2.0) <= AREA and np.abs(pairs.gap - 0.1).max() <= AREA


def test_rotated_nodal_frames(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They turn the components of the matrices: no mesh is refused for them, pairs are."""
    made = pile(("C3D8", "C3D8"))
    write(tmp_path, made)
    write_archive(tmp_path / "blocks.cdb", made, turned=True)
    assert len(read_archive(tmp_path / "blocks.cdb").turned) == len(made.numbers)
    assert len(read_mesh_file(tmp_path / "blocks.cdb").nodes) == len(made.numbers)
    assert main(["import", str(tmp_path / "k.mtx"), str(tmp_path / "m.mtx"), "--labels",
                 str(tmp_path / "labels.txt"), "--mesh", str(tmp_path / "blocks.cdb"),
                 "--deck-contact", "-o", str(tmp_path / "x.h5")]) == 3
    assert "has a rotated nodal frame" in capsys.readouterr().err


HEAD = "ET,1,185\nNBLOCK,3,,4\n(1i9,3e20.9e3)\n" + "".join(
    f"{k:9d}{x:20.9E}{y:20.9E}{z:20.9E}\n" for k, (x, y, z) in enumerate(
        [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], 1)) + "-1\n"


@pytest.mark.parametrize(("text", "words"), [
    ("ET,2,285\nEBLOCK,10,,,1\n(15i9)\n" + "".join(f"{v:9d}" for v in (1, 2, 1, 1, 0, 1, 2, 3, 9)),
     "element 1 names node 9"),
    ("ET,2,187\nEBLOCK,10,,,1\n(15i9)\n" + "".join(
        f"{v:9d}" for v in (1, 2, 1, 1, 0, 1, 2, 3, 4, 1, 0, 1, 1, 1, 1)),
     "lacks nodes in the middle"),
    ("EBLOCK,19,SOLID\n(19x9)\n", r"the format '\(19x9\)' of a block is not known"),
    ("EBLOCK,19,SOLID\n(19i9)\n        1        x\n", "is not what EBLOCK has there"),
    ("EBLOCK,19,SOLID\n(19i9)\n        1        1\n", "is not what EBLOCK has there"),
    ("CMBLOCK,A,NODE\n(8i10)\n", "is not what CMBLOCK has there"),
    ("NBLOCK,3,,1\n(1i9,3e20.9e3)\n        2     5.0\n", "names node 2 twice, at different places"),
])
def test_archives_that_are_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "wrong.cdb").write_text(HEAD + text)
    with pytest.raises(InputError, match=words):
        read_archive(tmp_path / "wrong.cdb")


@pytest.mark.parametrize(("change", "words"), [
    (("4 3 2 1 1 27 30 33 36", "4 3 2 1 1 27 30 33 37"), "names node 37"),
    (("4 3 2 1 1 27 30 33 36", "4 3 2 1 1 27 30 33"), "a quad has 3 nodes; expected 4"),
    (("4 3 2 1 1 27 30 33 36", "4 21 2 1 1 27 30 33 36"), "of an order above 2"),
    (("$Nodes\n12", "$Nodes\n13"), "end too early"),
    (("6 2 0 0", "6 2 0"), "end too early"), (("6 2 0 0", "3 2 0 0"), "names node 3 twice"),
    (("$Nodes", "$PartitionedEntities\n$EndPartitionedEntities\n$Nodes"), "is partitioned")])
def test_meshes_of_gmsh_that_are_refused(tmp_path: Path, change: tuple[str, str],
                                         words: str) -> None:
    path = plane(tmp_path)
    text = path.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change, 1))
    with pytest.raises(InputError, match=words):
        read_gmsh(path)


GEO = """SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 3, 2, 1};
Box(2) = {0, 0, 1, 3, 2, 1};
Mesh.MeshSizeMax = 1.1;
Physical Volume("LOW") = {1};
Physical Volume("HIGH") = {2};
Physical Surface("TOP") = {6};
Physical Surface("BOTTOM") = {11};
"""


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("version", ["msh22", "msh41"])
def test_gmsh_itself(tmp_path: Path, version: str, order: int) -> None:
    """What the program writes: areas, and middles of edges in the middle."""
    from fretwear.surfaces import contact_pairs

    program = shutil.which("gmsh")
    if program is None:
        pytest.skip("gmsh is not installed (apt install gmsh)")
    (tmp_path / "boxes.geo").write_text(GEO)
    subprocess.run([program, "-3", "-order", str(order), "-format", version, "boxes.geo", "-o",
                    "boxes.msh"], cwd=tmp_path, check=True, capture_output=True)
    named = read_named(tmp_path / "boxes.msh")
    pairs = contact_pairs(named.surface("TOP"), named.surface("BOTTOM"))
    assert abs(pairs.area.sum() - 6.0) <= AREA and np.abs(pairs.gap).max() <= AREA
    mesh = read_mesh_file(tmp_path / "boxes.msh")
    place = dict(zip(mesh.all_nodes.tolist(), mesh.all_points))
    assert len(mesh.middles) == 0 or order == 2
    for one, two, middle in mesh.middles.tolist():
        assert 0.5 * (place[one] + place[two]) == pytest.approx(place[middle], abs=1e-9)
