"""`fretwear import --contact`: named surfaces of decks become contact pairs, whose constant
pressure passes through meshes that do not match."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from touching_blocks import Block, Pile

from fretwear._native import unread_parts
from fretwear.cli import main

PRESSURE = 3.0
# Forces of solutions with a conditioning of 1e4, and of integrals to 1e-13.
PATCH = 1e-12
KINDS = [("C3D8", "C3D8"), ("C3D4", "C3D8"), ("C3D10", "C3D20"), ("C3D20", "C3D4")]


def pile(kinds: tuple[str, str], gap: float = 0.0) -> Pile:
    """Two blocks of 3 x 2, one on the other."""
    return Pile([Block(kinds[0], (3, 2, 2), (0.0, 0.0, 0.0), (3.0, 2.0, 1.0), 1),
                 Block(kinds[1], (2, 3, 2), (0.0, 0.0, 1.0 + gap), (3.0, 2.0, 2.0 + gap), 2)])


def write(folder: Path, made: Pile, gap: float = 0.0) -> None:
    """Held as a bar is that is pressed along z; both blocks may widen."""
    held = np.concatenate([3 * made.nodes(block, axis, 0.0) + axis
                           for block in (0, 1) for axis in (0, 1)]
                          + [3 * made.nodes(0, 2, 0.0) + 2])
    load = np.concatenate((np.zeros(3 * made.first[1]), PRESSURE * made.blocks[1].top))
    n = len(made.blocks[0].cells)
    deck = [*made.node_set("lower_top", made.nodes(0, 2, 1.0)),
            *made.node_set("UPPER_BOTTOM", made.nodes(1, 2, 1.0 + gap)),
            "*ELSET, ELSET=SOME, GENERATE", f"1, {n}, 1",
            "*SURFACE, NAME=UP, TYPE=ELEMENT", "BLOCK1", "*SURFACE, NAME=LOW", "SOME,",
            "*SURFACE INTERACTION, NAME=RUB", "*FRICTION", "0.35,",
            "*CONTACT PAIR, INTERACTION=RUB, TYPE=SURFACE TO SURFACE", "UP, LOW"]
    made.write(folder, held, load, deck)


def imported(folder: Path, *options: str) -> Path:
    path = folder / "model.h5"
    assert main(["import", str(folder / "k.mtx"), str(folder / "m.mtx"),
                 "--labels", str(folder / "labels.txt"), "--loads", str(folder / "loads.csv"),
                 "--mesh", str(folder / "blocks.inp"), "-o", str(path), *options]) == 0
    assert unread_parts(str(path)) == []
    return path


def held_pairs(made: Pile, block: int) -> int:
    """Corners of the touching side of a block at x = 0 and at y = 0."""
    corners = np.unique(made.blocks[block].cells[:, :4 if made.blocks[block].kind[:4] in
                                                 ("C3D4", "C3D1") else 8])
    place = made.blocks[block].points[corners]
    on = place[np.abs(place[:, 2] - 1.0) < 1e-9]
    return int((on[:, :2] == 0.0).sum())


@pytest.mark.parametrize("kinds", KINDS)
@pytest.mark.parametrize("first", [0, 1])
def test_patch(kinds: tuple[str, str], first: int, tmp_path: Path) -> None:
    """Forces at stuck pairs are the pressure times their areas, whoever carries the pairs."""
    made = pile(kinds)
    write(tmp_path, made)
    names = ["LOWER_TOP", "upper_bottom"]
    path = imported(tmp_path, "--contact", names[first], names[1 - first], "--reduce", "5")
    with h5py.File(path) as file:
        area, side_1 = file["contact/area"][()], file["contact/side_1"][()]
        force = file["load/static"][()]
        assert abs(area.sum() - 6.0) <= 1e-12
        normal = force[side_1[:, 2] - 1]
        # Side 2 pushes side 1 along the normal, which points to side 1; loads press against it.
        assert np.abs(normal / area + PRESSURE).max() <= PATCH * PRESSURE
        # Along the planes of symmetry a direction of each pair is held.
        tangential = side_1[:, :2]
        assert (tangential == 0).sum() == held_pairs(made, first)
        shear = force[tangential[tangential > 0] - 1] / area[np.nonzero(tangential)[0]]
        assert np.abs(shear).max() <= PATCH * PRESSURE
        assert np.abs(file["contact/gap"][()]).max() <= 1e-12


def test_without_reduction_pairs_are_rows(tmp_path: Path) -> None:
    """The same relative displacements as rows behind the degrees of freedom."""
    made = pile(("C3D8", "C3D8"), gap=0.01)
    write(tmp_path, made, gap=0.01)
    path = imported(tmp_path, "--deck-contact")
    with h5py.File(path) as file:
        n = len(file["mass"])
        rows, side_1 = file["row/matrix"][()], file["contact/side_1"][()]
        assert (file["contact/side_2"][()] == 0).all()
        # In order; 0 where the node of a pair is held along a direction.
        assert side_1[side_1 != 0].tolist() == list(range(n + 1, n + len(rows) + 1))
        assert (side_1[:, 2] != 0).all() and (side_1 == 0).sum() == 7
        assert np.abs(file["contact/gap"][()] - 0.01).max() <= 1e-12
        assert (file["contact/mu"][()] == 0.35).all()
        assert abs(file["contact/area"][()].sum() - 6.0) <= 1e-12
        assert {name.decode() for name in file["contact/patch"][()]} == {"UP/LOW"}


def test_names_that_are_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = pile(("C3D8", "C3D8"), gap=0.5)
    write(tmp_path, made, gap=0.5)
    inputs = ["import", str(tmp_path / "k.mtx"), str(tmp_path / "m.mtx"), "--labels",
              str(tmp_path / "labels.txt"), "-o", str(tmp_path / "x.h5"), "--reduce", "3"]
    mesh = ["--mesh", str(tmp_path / "blocks.inp")]
    for options, words in (
            (["--contact", "UP", "LOW"], "needs --mesh FILE or --contact-mesh"),
            ([*mesh, "--contact", "LOWERTOP", "UP"], "did you mean LOWER_TOP"),
            ([*mesh, "--contact", "LOWER_TOP", "UPPER_BOTTOM", "--reach", "0.1"],
             "nearest corners are 0.5"),
            ([*mesh, "--mu", "0.3"], "--mu goes with --contact"),
            ([*mesh, "--contact", "LOW", "UP", "--pairs", str(tmp_path / "loads.csv")],
             "does not go with --pairs")):
        assert main([*inputs, *options]) == 3
        assert words in capsys.readouterr().err
    assert (tmp_path / "x_contact_refused.png").stat().st_size > 5000


def test_table_of_nodes_names_a_surface(tmp_path: Path) -> None:
    made = pile(("C3D10", "C3D8"))
    write(tmp_path, made)
    tables = []
    for block in (0, 1):
        tables.append(tmp_path / f"nodes{block}.csv")
        tables[-1].write_text("node\n" + "".join(
            f"{made.numbers[k]}\n" for k in made.nodes(block, 2, 1.0)))
    path = imported(tmp_path, "--contact", *map(str, tables), "--reduce", "3", "--mu", "0.2",
                    "--tangent", "0", "1", "0")
    with h5py.File(path) as file:
        assert abs(file["contact/area"][()].sum() - 6.0) <= 1e-12
        assert (file["contact/mu"][()] == 0.2).all()
