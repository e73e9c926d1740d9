"""`fretwear import MESH.msh --ccx`: the deck of a mesh of Gmsh, the run of CalculiX and the model.

Here a program of the tests stands for ccx: it reads the deck and stores matrices of elements of its
own. `test_own_mesh.py` runs CalculiX itself where it is installed.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import shrouded_ring
from shrouded_ring import DENSITY, POISSON, YOUNG, N, Ring, through_cracks

from fretwear.cli import main
from fretwear.errors import InputError
from fretwear.importer.ccx import materials_of, write_deck
from fretwear.importer.deck import read_deck

#: What stands for CalculiX.
CCX = """#!{python}
import sys
from pathlib import Path
sys.path[:0] = {path}
import numpy as np
import scipy.sparse as sp
import shrouded_ring
from fretwear.importer.deck import read_deck
job = Path(sys.argv[1])
assert job.name == str(job), "runs where the deck is"
deck = read_deck(job.with_suffix(".inp"))
((kind, table),) = deck.blocks
n = 3 * len(deck.nodes)
found = [sp.lil_array((n, n)), sp.lil_array((n, n))]
for cell in table:
    dofs = (3 * np.asarray(cell)[:, None] + np.arange(3)).ravel()
    for whole, part in zip(found, shrouded_ring.element(deck.points[cell])):
        whole[np.ix_(dofs, dofs)] += part
for end, matrix in zip((".sti", ".mas"), found):
    half = sp.coo_array(sp.triu(matrix))
    job.with_suffix(end).write_text("".join(
        f"{{i + 1}} {{j + 1}} {{x:.17e}}\\n" for i, j, x in zip(half.row, half.col, half.data)))
job.with_suffix(".dof").write_text("".join(
    f"{{node}}.{{c}}\\n" for node in deck.nodes for c in (1, 2, 3)))
"""
MATERIAL = f"{YOUNG},{POISSON},{DENSITY}"


@pytest.fixture
def ccx(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The only program on the PATH, in a folder of its own."""
    folder = tmp_path / "bin"
    folder.mkdir()
    program = folder / "ccx"
    program.write_text(CCX.format(python=sys.executable, path=sys.path))
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))
    return program


def write_mesh(ring: Ring, path: Path) -> None:
    """Format 2.2: solids in DISK, faces of the crack in RIGHT and LEFT, nodes of the bore in BORE.
    """
    names = {"DISK": (3, 1), "RIGHT": (2, 2), "LEFT": (2, 3), "BORE": (0, 4)}
    cells = [(5, 1, row) for row in ring.cells.tolist()]
    cells += [(3, tag, row) for side, line, tag in ((1, 2, 2), (-1, -2, 3))
              for row in ring.quads(side, line).tolist()]
    cells += [(15, 4, [k]) for k, node in enumerate(ring.nodes) if node[1] == 0]
    path.write_text("\n".join([
        "$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names)),
        *(f'{dimension} {tag} "{name}"' for name, (dimension, tag) in names.items()),
        "$EndPhysicalNames", "$Nodes", str(len(ring.nodes) + 1), "7000 0 0 0",
        # Numbers with gaps; a node of no cell before them.
        *(f"{number(k)} {x:.17g} {y:.17g} {z:.17g}" for k, (x, y, z) in enumerate(ring.points)),
        "$EndNodes", "$Elements", str(len(cells)),
        *(f"{k} {kind} 2 {tag} {tag} " + " ".join(str(number(place)) for place in row)
          for k, (kind, tag, row) in enumerate(cells, 1)), "$EndElements"]) + "\n")


def number(k: int) -> int:
    return 3 * k + 11


def test_one_command(ccx: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The model is that of the same matrices by files; surfaces are those of the mesh."""
    monkeypatch.setattr(shrouded_ring, "SUPPORT", 0.0)
    ring = through_cracks(0.02, 0.8, 0.9)
    bore = ",".join(str(k + 1) for k, node in enumerate(ring.nodes) if node[1] == 0)
    files = ring.write(tmp_path / "files", {"cosine": np.eye(3 * len(ring.nodes))[-1]})
    with open(tmp_path / "files" / "ring.inp", "a") as deck:
        deck.write(f"*NSET, NSET=BORE\n{bore.replace(',', ',' + chr(10))}\n")
    write_mesh(ring, tmp_path / "ring.msh")
    end = ["--fix", "BORE", "--contact-neighbour", "RIGHT", "LEFT", "--reduce", "12",
           "--by-diameter"]
    assert main([*files, *end, "-o", str(tmp_path / "files.h5")]) == 0
    assert main(["import", str(tmp_path / "ring.msh"), "--ccx", "-q", "--material", MATERIAL,
                 "--sectors", str(N), "--load", f"{number(len(ring.nodes) - 1)}:3=1", *end,
                 "-o", str(tmp_path / "mesh.h5")]) == 0
    assert not (tmp_path / "ring_ccx.frd").exists()
    with h5py.File(tmp_path / "files.h5") as one, h5py.File(tmp_path / "mesh.h5") as two:
        assert two["contact/area"][()] == pytest.approx(one["contact/area"][()], rel=1e-12)
        for k in range(N // 2 + 1):
            mass, stiffness = (complexes(one[f"nodal_diameter/{k}/{name}"][()])
                               for name in ("mass", "stiffness"))
            other = complexes(two[f"nodal_diameter/{k}/stiffness"][()])
            assert len(other) == len(stiffness)
            squares = [np.sort(np.linalg.eigvals(np.linalg.solve(
                complexes(file[f"nodal_diameter/{k}/mass"][()]), matrix)).real)[:10]
                for file, matrix in ((one, stiffness), (two, other))]
            assert squares[1] == pytest.approx(squares[0], rel=1e-7)
            assert len(mass) == len(other)


def complexes(values: np.ndarray) -> np.ndarray:
    return np.asarray(values[..., 0] + 1j * values[..., 1])


def test_deck_of_a_mesh(tmp_path: Path) -> None:
    """Read again it has the nodes of cells, elements, sets, and a material for each."""
    ring = through_cracks()
    ring.points += [0.0, 0.0, -8.881784197001252e-16]
    write_mesh(ring, tmp_path / "ring.msh")
    path = write_deck(tmp_path / "ring.msh", {"": (1.0, 0.2, 3.0)})
    deck = read_deck(path)
    assert len(deck.nodes) == len(ring.nodes) and 7000 not in deck.nodes
    order = {int(node): k for k, node in enumerate(deck.nodes)}
    place = [order[number(k)] for k in range(len(ring.nodes))]
    assert np.abs(deck.points[place] - ring.points).max() <= 1e-11
    # CalculiX reads 20 characters of a number.
    assert max(len(word.strip()) for line in path.read_text().splitlines()
               if line[0].isdigit() for word in line.split(",")) <= 20
    ((_, table),) = deck.blocks
    assert (deck.nodes[table] == np.vectorize(number)(ring.cells)).all()
    assert sorted(deck.node_sets["RIGHT"]) == [
        number(k) for k, node in enumerate(ring.nodes) if node[3] == 1]
    assert len(deck.element_sets["DISK"]) == len(ring.cells)
    text = path.read_text()
    assert text.count("*SOLID SECTION") == 1 and "SOLVER=MATRIXSTORAGE" in text
    write_deck(tmp_path / "ring.msh", materials_of(["disk=2,0.3,1"]))
    assert "\n2, 0.3\n" in path.read_text()
    path.write_text("** mine\n")
    with pytest.raises(InputError, match="was not written by"):
        write_deck(tmp_path / "ring.msh", {"": (1.0, 0.2, 3.0)})


@pytest.mark.parametrize(("options", "words"), [
    (["--material", "1,2"], "expected"),
    (["--material", "1,0.5,1"], "Poisson"),
    (["--material", MATERIAL, "--material", MATERIAL], "second one"),
    (["--material", f"BLADE={MATERIAL}"], "no such group of volumes; it has DISK"),
    ([], "needs --material"),
])
def test_what_is_refused(options: list[str], words: str, tmp_path: Path,
                         capsys: pytest.CaptureFixture[str]) -> None:
    write_mesh(through_cracks(), tmp_path / "ring.msh")
    assert main(["import", str(tmp_path / "ring.msh"), "--ccx", *options, "--check"]) == 3
    assert words in capsys.readouterr().err
    assert main(["import", str(tmp_path / "ring.msh"), "other.inp", "--ccx", "--check"]) == 3
    assert "needs one FILE" in capsys.readouterr().err


def test_without_calculix_the_deck_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                            capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    write_mesh(through_cracks(), tmp_path / "ring.msh")
    assert main(["import", str(tmp_path / "ring.msh"), "--ccx", "--material", MATERIAL,
                 "--check"]) == 3
    assert "apt install calculix-ccx" in capsys.readouterr().err
    assert (tmp_path / "ring_ccx.inp").is_file()
    assert main(["import", str(tmp_path / "ring.msh"), "--material", MATERIAL, "--check"]) == 3
    assert "goes with --ccx" in capsys.readouterr().err


def test_run_that_fails(ccx: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What CalculiX says is quoted; old matrices do not stand in for it, and are not lost."""
    ccx.write_text("#!/bin/sh\necho ' *ERROR in e_c3d: nonpositive jacobian'\nexit 201\n")
    write_mesh(through_cracks(), tmp_path / "ring.msh")
    for end in ("sti", "mas", "dof"):
        (tmp_path / f"own.{end}").write_text("of before")
    (tmp_path / "own.inp").write_text("*NODE\n1, 0, 0, 0\n")
    for command in (["ring.msh", "--material", MATERIAL], ["own.inp"]):
        assert main(["import", str(tmp_path / command[0]), "--ccx", *command[1:], "--check"]) == 3
        said = capsys.readouterr().err
        assert "status 201" in said and "nonpositive jacobian" in said
    ccx.write_text("#!/bin/sh\nexit 0\n")
    assert main(["import", str(tmp_path / "own.inp"), "--ccx", "--check"]) == 3
    assert "SOLVER=MATRIXSTORAGE" in capsys.readouterr().err
    ccx.write_text("no program")
    assert main(["import", str(tmp_path / "own.inp"), "--ccx", "--check"]) == 3
    assert "cannot be started" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.glob("own.*")) == [
        "own.dof", "own.inp", "own.mas", "own.sti"]
    assert (tmp_path / "own.sti").read_text() == "of before"
    assert os.environ["PATH"] == str(ccx.parent)
