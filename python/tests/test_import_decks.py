"""Names of decks of Abaqus and CalculiX: one parser for the mesh, the sets, and the surfaces that
touch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fretwear.errors import InputError
from fretwear.importer.contact import read_named
from fretwear.importer.deck import read_deck
from fretwear.surfaces import contact_pairs

#: Areas and gaps of a handful of faces.
AREA = 1e-10
#: Two sheets of one face each, by kind: corners, then middles of the edges.
CORNERS = {3: [(0, 0), (1, 0), (0, 1)], 4: [(0, 0), (1, 0), (1, 1), (0, 1)]}


def places(n: int) -> list[tuple[float, float]]:
    corner = CORNERS[n if n in CORNERS else n // 2]
    middle = [(0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]))
              for a, b in zip(corner, corner[1:] + corner[:1])]
    return (corner + middle)[:n]


def sheets(kind: str, n: int) -> str:
    """Two shells, 0.1 apart, both with their normal along z; element and node numbers have gaps."""
    lines = ["*Node"]
    for k in (0, 1):
        lines += [f"{100 * k + 3 * i + 5}, {x}, {y}, {0.1 * k}"
                  for i, (x, y) in enumerate(places(n))]
    for k in (0, 1):
        nodes = ", ".join(str(100 * k + 3 * i + 5) for i in range(n))
        lines += [f"*Element, type={kind}, elset=Sheet{k}", f"{7 + 10 * k}, {nodes}"]
    return "\n".join(lines) + "\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "deck.inp"
    path.write_text(text)
    return path


@pytest.mark.parametrize(("kind", "n"), [("S3", 3), ("S4R", 4), ("STRI65", 6), ("S6", 6),
                                         ("S8R", 8), ("M3D4", 4)])
@pytest.mark.parametrize("sides", [("SPOS", "SNEG"), ("S2", "S1"), ("", "sneg")])
def test_sides_of_shells(tmp_path: Path, kind: str, n: int, sides: tuple[str, str]) -> None:
    """The lower one touches with its positive side, the upper one with its negative side."""
    one, two = sides
    path = written(tmp_path, sheets(kind, n) + f"*SURFACE, NAME=A\nSHEET0, {one}\n"
                   f"*SURFACE, NAME=B\n17, {two}\n*SURFACE, NAME=C\n17, SPOS\n")
    deck = read_named(path)
    pairs = contact_pairs(deck.surface("A"), deck.surface("b"))
    assert abs(pairs.area.sum() - (0.5 if n in (3, 6) else 1.0)) <= AREA
    assert np.abs(pairs.gap - 0.1).max() <= AREA
    assert pairs.frame[:, 2] == pytest.approx(np.tile([0.0, 0.0, -1.0], (len(pairs), 1)))
    with pytest.raises(InputError, match="inside out"):
        contact_pairs(deck.surface("A"), deck.surface("C"))


CUBES = ("*NODE, NSET=ALL\n" + "".join(
    f"{1 + i + 2 * j + 4 * k + 8 * c}, {i}, {j}, {k + c}\n"
    for c in (0, 1) for k in (0, 1) for j in (0, 1) for i in (0, 1)))
ROWS = ["1, 1, 2, 4, 3, 5, 6, 8, 7", "2, 9, 10, 12, 11, 13, 14, 16, 15"]
SOLIDS = "".join(f"*ELEMENT, TYPE=C3D8R, ELSET={name}\n{row}\n" for name, row in
                 zip(("Low", "High"), ROWS))


def area(path: Path, one: str, two: str) -> float:
    deck = read_named(path)
    return float(contact_pairs(deck.surface(one), deck.surface(two)).area.sum())


@pytest.mark.parametrize("text", [
    "*SURFACE, NAME=A\nLOW, S2\n*SURFACE, NAME=B\nhigh, s1\n",
    "*NSET, NSET=A, GENERATE\n5, 8\n*NSET, NSET=B, GENERATE\n9, 12, 1\n",
    "*NSET, NSET=ODD, GENERATE\n5, 7, 2\n*NSET, NSET=A\nodd, 6, 8\n*SURFACE, TYPE=NODE, NAME=B\n"
    "9\n10,\n11, 1.0\n12\n",
    "*ELSET, ELSET=X\nLOW\n*ELSET, ELSET=Y\nX\n*SURFACE, NAME=A\nY, S2\n*SURFACE, NAME=B\n2, S1\n",
    "*SURFACE, NAME=P\nLOW, S2\n*SURFACE, NAME=A, COMBINE=UNION\nP\n*SURFACE, NAME=B\nHIGH,\n",
    "*ELEMENT, TYPE=S4, ELSET=A\n7, 5, 6, 8, 7\n*ELEMENT, TYPE=S4, ELSET=B\n8, 9, 10, 12, 11\n",
])
def test_names_of_solids(tmp_path: Path, text: str) -> None:
    """A square of 1 by faces, by nodes, by sets of sets, by unions, by shells on them."""
    assert abs(area(written(tmp_path, CUBES + SOLIDS + text), "a", "B") - 1.0) <= AREA


def test_names_in_quotes(tmp_path: Path) -> None:
    path = written(tmp_path, CUBES + SOLIDS + '*Surface, name="my, face"\nLow, S2\n'
                   "*Surface, name='Other Face'\n\"High\", S1\n"
                   '*Surface Interaction, name="Rub 1"\n*Friction\n0.25, 1e4\n'
                   '*Contact Pair, interaction="rub 1"\n"MY, FACE", "other face"\n')
    deck = read_named(path)
    couple, = deck.couples
    assert (couple.one, couple.two, couple.mu) == ("MY, FACE", "OTHER FACE", 0.25)
    assert abs(area(path, couple.one, couple.two) - 1.0) <= AREA


def test_includes_amid_data(tmp_path: Path) -> None:
    """Included files go on with the data of the keyword before them, and come from the folder of
    the deck, one from another."""
    head, *lines = CUBES.splitlines()
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "first.txt").write_text(
        "\n".join([*lines[:9], "*INCLUDE, INPUT=sub/2.txt"]))
    (tmp_path / "sub" / "2.txt").write_text("\n".join(lines[9:]))
    path = written(tmp_path, f"{head}\n*Include, Input=sub/first.txt\n{SOLIDS}"
                   "*SURFACE, NAME=A\nLOW, S2\n*SURFACE, NAME=B\nHIGH, S1\n")
    assert abs(area(path, "A", "B") - 1.0) <= AREA
    assert read_deck(path).node_sets["ALL"] == list(range(1, 17))


def test_one_instance_where_it_is(tmp_path: Path) -> None:
    """Sets of the assembly and of the part, called by the name of the instance before them."""
    text = ("*PART, NAME=P\n" + CUBES + SOLIDS + "*END PART\n*ASSEMBLY, NAME=ASM\n"
            "*INSTANCE, NAME=P-1, PART=P\n{moved}*END INSTANCE\n"
            "*NSET, NSET=TOP, INSTANCE=P-1\n13, 14, 15, 16\n"
            "*SURFACE, NAME=A\nP-1.Low, S2\n*SURFACE, NAME=B\nP-1.2, S1\n*END ASSEMBLY\n"
            "*BOUNDARY\nP-1.TOP, 3, 3\n")
    path = written(tmp_path, text.format(moved=""))
    assert abs(area(path, "A", "B") - 1.0) <= AREA
    assert read_deck(path).supports == {(node, 3) for node in (13, 14, 15, 16)}
    for changed, words in (
            (text.format(moved="1.0, 0.0, 0.0\n"), "an instance that is moved"),
            (text.format(moved="") + "*INSTANCE, NAME=P-2, PART=P\n*END INSTANCE\n",
             r"a second \*INSTANCE"),
            (text.format(moved="").replace("\n16, 1, 1, 2", "\n19, 1, 1, 2").replace(
                "16,", "19,").replace(", 16", ", 19"), "number its nodes anew")):
        with pytest.raises(InputError, match=words):
            read_deck(written(tmp_path, changed))


def test_edges_of_plane_cells(tmp_path: Path) -> None:
    """Of plane cells S1, S2, ... are edges; as sets of nodes they are those of the edge alone."""
    nodes = [(0, 0), (2, 0), (2, 1), (0, 1), (1, 0), (2, 0.5), (1, 1), (0, 0.5),
             (0, 1.25), (2, 1.25), (2, 2), (0, 2)]
    path = written(tmp_path, "*NODE\n" + "".join(
        f"{k}, {x}, {y}\n" for k, (x, y) in enumerate(nodes, 1))
        + "*ELEMENT, TYPE=CPS8R, ELSET=LOW\n1, 1, 2, 3, 4, 5, 6, 7, 8\n"
        "*ELEMENT, TYPE=CPS4, ELSET=HIGH\n2, 9, 10, 11, 12\n"
        "*SURFACE, NAME=A\nLOW, S3\n*SURFACE, NAME=B\nHIGH, S1\n")
    deck = read_deck(path)
    assert sorted(deck.node_sets["A"]) == [3, 4, 7] and sorted(deck.node_sets["B"]) == [9, 10]
    named = read_named(path)
    pairs = contact_pairs(named.surface("A"), named.surface("B"), thickness=3.0)
    assert abs(pairs.area.sum() - 6.0) <= AREA and np.abs(pairs.gap + 0.25).max() > 0.4


@pytest.mark.parametrize(("text", "words"), [
    ("*SURFACE, NAME=A\nLOW, SPOS\n", "'SPOS' is no face of a hexahedron"),
    ("*SURFACE, NAME=A\nLOW, S7\n", "'S7' is no face"),
    ("*SURFACE, NAME=A\nNOBODY, S1\n", "no element set NOBODY"),
    ("*SURFACE, NAME=A, COMBINE=DIFFERENCE\nLOW, HIGH\n", "COMBINE=DIFFERENCE is not read"),
    ("*NSET, NSET=A, ELSET=NOBODY\n", "no element set NOBODY"),
    ("*CONTACT PAIR\nA\n", "must name two surfaces"),
    ("*NODE\n3, 9.0, 0, 0\n", "names node 3 twice, at different places"),
    ("*ELEMENT, TYPE=C3D8, ELSET=X\n2, 1, 2, 4, 3, 5, 6, 8, 7\n", "element 2 is there twice"),
    ("*ELEMENT, TYPE=S4, ELSET=X\n3, 1, 2, 4, 3\n*SURFACE, NAME=A\nX, S4\n", "no face of a shell"),
])
def test_names_that_are_wrong(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputError, match=words.replace("*", r"\*")):
        read_named(written(tmp_path, CUBES + SOLIDS + text))


def test_what_is_listed_again_or_left_out(tmp_path: Path) -> None:
    """The same node at the same place is one; an analytical surface is told."""
    path = written(tmp_path, CUBES + SOLIDS + CUBES + SOLIDS.splitlines()[0] + "\n" + ROWS[0]
                   + "\n*SURFACE, NAME=ROLL, TYPE=REVOLUTION\nSTART, 0., 1.\n")
    deck = read_deck(path)
    assert len(deck.nodes) == 16
    assert abs(area(path, "LOW", "HIGH") - 1.0) <= AREA
    assert any("of type REVOLUTION is left out" in note for note in deck.notes)
