"""Jobs of CalculiX in one command: stored matrices, mesh, sets, supports and loads of the deck, and
sectors whose cut faces are found.

The frequencies that judge the sector are those of CalculiX itself, with its own cyclic symmetry
(`wheel_cyclic.inp`), which shares no matrix with the import.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from project import PROGRAM
from stored_wheel import N_SECTORS, StoredWheel

from fretwear.cli import main
from fretwear.importer import read_loads, read_matrices, read_mesh_file
from fretwear.importer.calculix import deck_loads
from fretwear.importer.deck import read_deck

FILES = Path(__file__).parent / "import_files" / "calculix"
WHEEL = FILES / "wheel.inp"
#: Lowest two of each nodal diameter [rad/s], as CalculiX 2.20 writes them.
BY_CALCULIX = np.array([[0.6982245e5, 0.1058464e6], [0.6049342e5, 0.1593687e6],
                        [0.5660892e5, 0.2441161e6], [0.1233298e6, 0.3250210e6],
                        [0.1699984e6, 0.3989347e6]])
#: Seven digits of a frequency, and fourteen of a stored matrix.
WRITTEN = 5e-7
#: The same matrices on two ways.
SAME = 1e-10
#: Modes of the same matrices by two solvers.
EXACT = 1e-9


def run_import(*words: str | Path) -> int:
    return main(["import", *map(str, words)])


def frequencies(folder: Path, model: Path, n_modes: int = 2) -> np.ndarray:
    """Of all nodal diameters [rad/s], by the program."""
    (folder / "modes.nml").write_text(
        f"&case analysis = 'modes' /\n&model source = 'hdf5' file = '{model}' /\n"
        f"&cyclic n_modes = {n_modes} /\n")
    subprocess.run([PROGRAM, "-q", "-o", folder / "modes.h5", folder / "modes.nml"], check=True)
    with h5py.File(folder / "modes.h5") as file:
        found: np.ndarray = file["modes/open"][()]
        return found


def datasets(path: Path) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.update({name: item[()]})
                        if isinstance(item, h5py.Dataset) else None)
    return found


def test_stored_matrices_are_read() -> None:
    found = read_matrices(WHEEL.with_suffix(".sti"))
    assert found.labels is not None and len(found.labels) == 24
    assert found.labels[:4] == [(2, 1), (2, 2), (2, 3), (3, 1)]
    for name, suffix in (("stiffness", ".sti"), ("mass", ".mas")):
        full = found.matrices[name].toarray()
        assert np.array_equal(full, full.T)
        for line in WHEEL.with_suffix(suffix).read_text().splitlines():
            row, column, value = line.split()
            assert full[int(row) - 1, int(column) - 1] == float(value)


def test_components_are_global_with_a_transform() -> None:
    """Turned about the disk's axis, the free sector of the deck strains nothing but at its bore: in
    global components, though *TRANSFORM turns the supports of its rim."""
    found = read_matrices(WHEEL.with_suffix(".dof"))
    deck = read_deck(WHEEL)
    place = dict(zip(deck.nodes.tolist(), deck.points))
    assert found.labels is not None
    turned = np.array([np.cross([0.0, 0.0, 1.0], place[node])[c - 1] for node, c in found.labels])
    stiffness = found.matrices["stiffness"]
    rim = [k for k, (node, _) in enumerate(found.labels) if node in (3, 6, 9, 12)]
    force, terms = stiffness @ turned, abs(stiffness) @ np.abs(turned)
    assert np.abs(force[rim]).max() < 1e-12 * terms[rim].max()


def test_one_command_reads_all_of_a_job(tmp_path: Path,
                                        capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "wheel.h5"
    assert run_import(WHEEL, "--observe", "tip=TIP:3", "--observe", "rim=RIM:uz", "-o",
                      target) == 0
    said = capsys.readouterr().err
    assert "sine load of *CLOAD in step 2" in said and "12 nodes and 2 cells" in said
    data = datasets(target)
    labels = read_matrices(WHEEL.with_suffix(".dof")).labels
    assert labels is not None
    # Loads along the turned axes of the rim: radially at the tip, tangentially all around.
    expected = {"cosine": np.zeros(24), "sine": np.zeros(24)}
    angle = np.pi / 8
    for node, sign in ((3, -1), (9, -1), (6, 1), (12, 1)):
        radial = np.array([np.cos(angle), sign * np.sin(angle), 0.0])
        tangent = np.array([-radial[1], radial[0], 0.0])
        for c in (1, 2, 3):
            at = labels.index((node, c))
            # Re((F_re + i F_im) exp(i w t)) = F_re cos - F_im sin
            expected["sine"][at] -= tangent[c - 1]
            if node == 12:
                expected["cosine"][at] += 0.5 * radial[c - 1] + (2.0 if c == 3 else 0.0)
    for name, vector in expected.items():
        assert data[f"load/{name}"] == pytest.approx(vector, abs=1e-14)
    assert np.flatnonzero(data["observe/matrix"][0]).tolist() == [labels.index((12, 3))]
    row = data["observe/matrix"][1]
    assert row[[labels.index((node, 3)) for node in (3, 6, 9, 12)]] == pytest.approx(4 * [0.25])
    assert row.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("named", [[], ["--left", "LEFT", "--right", "RIGHT"],
                                   ["--left", "RIGHT", "--right", "LEFT"]])
def test_a_sector_in_one_command_has_the_frequencies_of_calculix(named: list[str],
                                                                 tmp_path: Path) -> None:
    target = tmp_path / "wheel.h5"
    assert run_import(WHEEL, "-q", "--sectors", 8, *named, "-o", target) == 0
    assert frequencies(tmp_path, target) == pytest.approx(BY_CALCULIX, rel=WRITTEN)


def test_the_sector_by_hand_is_the_same(tmp_path: Path) -> None:
    """Matrices, labels, faces and loads through tables, as they go without a deck."""
    found, deck = read_matrices(WHEEL.with_suffix(".dof")), read_deck(WHEEL)
    labels = found.labels
    assert labels is not None
    for name, matrix in found.matrices.items():
        scipy.io.mmwrite(tmp_path / f"{name}.mtx", sp.coo_array(matrix), symmetry="symmetric",
                         precision=17)
    (tmp_path / "labels.txt").write_text("\n".join(
        f"{k} {node} {c}" for k, (node, c) in enumerate(labels, 1)))
    place = dict(zip(deck.nodes.tolist(), deck.points.tolist()))
    # Nodes of the bore are held: they have no rows that could be tied.
    for side, nodes in (("left", (9, 8, 3, 2)), ("right", (5, 6, 11, 12))):
        (tmp_path / f"{side}.csv").write_text("node, x, y, z\n" + "".join(
            f"{node}, {', '.join(map(repr, place[node]))}\n" for node in nodes))
    loads, _ = deck_loads(deck, StoredWheel.dofs(labels))
    (tmp_path / "loads.csv").write_text("dof, cosine, sine\n" + "".join(
        f"{node}:{c}, {float(loads['cosine'][k])!r}, {float(loads['sine'][k])!r}\n"
        for k, (node, c) in enumerate(labels)))
    assert run_import(tmp_path / "stiffness.mtx", tmp_path / "mass.mtx", "-q", "--labels",
                      tmp_path / "labels.txt", "--sectors", 8, "--left", tmp_path / "left.csv",
                      "--right", tmp_path / "right.csv", "--frames", "cartesian", "--loads",
                      tmp_path / "loads.csv", "--observe", "tip=12:3", "-o",
                      tmp_path / "hand.h5") == 0
    assert run_import(WHEEL, "-q", "--sectors", 8, "--observe", "tip=TIP:3", "-o",
                      tmp_path / "job.h5") == 0
    hand, job = datasets(tmp_path / "hand.h5"), datasets(tmp_path / "job.h5")
    assert set(hand) == {name for name in job if not name.startswith("mesh/")}
    ties = [dict(zip(data["cyclic/left"].tolist(), data["cyclic/right"].tolist()))
            for data in (hand, job)]
    assert ties[0] == ties[1]
    for name in set(hand) - {"cyclic/left", "cyclic/right", "observe/name"}:
        assert hand[name] == pytest.approx(job[name], rel=SAME,
                                           abs=SAME * np.abs(job[name]).max()), name
    assert frequencies(tmp_path, tmp_path / "hand.h5") == pytest.approx(
        frequencies(tmp_path, tmp_path / "job.h5"), rel=SAME)


@pytest.mark.parametrize("sets", [[], ["--left", "LEFT", "--right", "RIGHT"]])
@pytest.mark.parametrize("seed", [None, 1, 2, 3])
def test_quadratic_sector_against_the_whole_wheel(tmp_path: Path, seed: int | None,
                                                  sets: list[str]) -> None:
    """Tetrahedra with middle nodes, which sets of corners do not name: all nodal diameters are
    those of the wheel of all sectors, assembled without any symmetry. About each axis, in either
    direction, with any number of sectors."""
    wheel = StoredWheel(tmp_path, seed=seed)
    target = tmp_path / "sector.h5"
    # Sets come in either order; which face is left follows from the direction of the axis.
    axis = ("-" if seed and seed % 2 else "") + wheel.axis
    assert run_import(tmp_path / "sector.inp", "-q", "--sectors", wheel.n_sectors,
                      f"--axis={axis}", *sets, "-o", target) == 0
    data = datasets(target)
    assert len(data["cyclic/left"]) == 3 * wheel.n_cut
    rows = frequencies(tmp_path, target, 6)
    # Of each nodal diameter but 0 and N/2 there are two waves.
    found = np.sort(np.concatenate([np.tile(row, 1 if 2 * k % wheel.n_sectors == 0 else 2)
                                    for k, row in enumerate(rows)]))
    whole = wheel.whole()
    # Of each nodal diameter the lowest six: all below the lowest of the sixth ones.
    below = min(row[-1] for row in rows)
    found, whole = (values[values < below * (1.0 - EXACT)] for values in (found, whole))
    assert len(whole) > 8
    assert found == pytest.approx(whole, rel=EXACT)


def test_every_nodal_diameter_on_its_own_of_a_job(tmp_path: Path) -> None:
    """The mesh of the deck finds the cut faces and is left out then: none belongs to all."""
    (tmp_path / "pairs.csv").write_text("side_1_t1, side_1_t2, side_1_n\n3:1, 3:2, 3:3\n")
    assert run_import(WHEEL, "-q", "--sectors", 8, "--pairs", tmp_path / "pairs.csv", "--reduce",
                      4, "--by-diameter", "-o", tmp_path / "wheel.h5") == 0
    with h5py.File(tmp_path / "wheel.h5") as file:
        assert sorted(map(int, file["nodal_diameter"])) == list(range(5)) and "mesh" not in file


def test_a_set_names_the_blade(tmp_path: Path) -> None:
    (tmp_path / "rim.csv").write_text("node\n3\n6\n9\n12\n")
    found = []
    for name in ("RIM", tmp_path / "rim.csv"):
        assert run_import(WHEEL, "-q", "--sectors", 8, "--blade", name, "--blade-modes", 2, "-o",
                          tmp_path / "wheel.h5") == 0
        found.append(datasets(tmp_path / "wheel.h5")["mistuning/rows"])
    assert np.array_equal(*found) and np.abs(found[0]).max() > 0.0


def test_the_same_nodes_held_by_name(tmp_path: Path) -> None:
    """--fix on a free sector: the matrices of the held one."""
    StoredWheel(tmp_path, held=False)
    (tmp_path / "free").mkdir()
    for suffix in (".inp", ".sti", ".mas", ".dof"):
        (tmp_path / f"sector{suffix}").rename(tmp_path / "free" / f"sector{suffix}")
    StoredWheel(tmp_path)
    for folder, more in ((tmp_path / "free", ["--fix", "BORE"]), (tmp_path, [])):
        assert run_import(folder / "sector.inp", "-q", "--sectors", N_SECTORS, *more, "-o",
                          folder / "model.h5") == 0
    one, other = datasets(tmp_path / "free" / "model.h5"), datasets(tmp_path / "model.h5")
    for name in ("mass", "stiffness"):
        assert one[name] == pytest.approx(other[name], abs=SAME * np.abs(other[name]).max())


def test_loads_of_a_deck_belong_to_its_job(tmp_path: Path,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    """A deck that only gives the mesh gives no loads: those are of the command line."""
    shutil.copy(WHEEL, tmp_path / "mesh.inp")
    for suffix in (".sti", ".mas", ".dof"):
        shutil.copy(WHEEL.with_suffix(suffix), tmp_path)
    assert run_import("--stiffness", tmp_path / "wheel.sti", "--mass", tmp_path / "wheel.mas",
                      "--mesh", tmp_path / "mesh.inp", "--observe", "tip=TIP:3", "-o",
                      tmp_path / "wheel.h5") == 0
    assert "loads: none" in capsys.readouterr().err
    assert not any(name.startswith("load/") for name in datasets(tmp_path / "wheel.h5"))


def test_sets_name_pairs_and_loads(tmp_path: Path) -> None:
    """A line of the table for the rim, one pair for each of its nodes, as by their numbers."""
    (tmp_path / "sets.csv").write_text(
        "side_1_t1, side_1_t2, side_1_n, mu\nrim:1, RIM:2, -RIM:uz, 0.3\n")
    (tmp_path / "nodes.csv").write_text("side_1_t1, side_1_t2, side_1_n, mu\n" + "".join(
        f"{k}:1, {k}:2, -{k}:3, 0.3\n" for k in (3, 6, 9, 12)))
    (tmp_path / "loads.csv").write_text("dof, static\nRIM:1, 2\n-TIP:2, 3\n")
    found = []
    for name in ("sets", "nodes"):
        assert run_import(WHEEL, "-q", "--pairs", tmp_path / f"{name}.csv", "--load", "TIP:3=5",
                          "--load=-RIM:2=1", "-o", tmp_path / f"{name}.h5") == 0
        found.append(datasets(tmp_path / f"{name}.h5"))
    for name in ("contact/side_1", "contact/side_2", "contact/mu"):
        assert np.array_equal(found[0][name], found[1][name])
    labels = read_matrices(WHEEL.with_suffix(".dof")).labels
    assert labels is not None
    dofs = StoredWheel.dofs(labels, read_deck(WHEEL).node_sets)
    expected = np.zeros(24)
    expected[labels.index((12, 3))] = 5.0
    expected[[labels.index((node, 2)) for node in (3, 6, 9, 12)]] = -1.0
    assert np.array_equal(found[0]["load/cosine"], expected)
    static = read_loads(tmp_path / "loads.csv", dofs)["static"]
    assert static[labels.index((12, 1))] == 2.0 and static[labels.index((12, 2))] == -3.0


def refused(capsys: pytest.CaptureFixture[str], *words: str | Path) -> str:
    capsys.readouterr()
    assert run_import(*words, "--check") == 3
    return capsys.readouterr().err


def test_what_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "alone.inp").write_text(WHEEL.read_text())
    assert "SOLVER=MATRIXSTORAGE, and run ccx alone" in refused(capsys, tmp_path / "alone.inp")
    for suffix in (".inp", ".sti", ".mas"):
        shutil.copy(WHEEL.with_suffix(suffix), tmp_path)
    (tmp_path / "wheel.dof").write_text("2.1\n2.2\n")
    assert "so they are of different runs" in refused(capsys, tmp_path / "wheel.sti")
    (tmp_path / "wheel.dof").write_text("2.1\n2\n")
    assert "line 2: expected node.component, found '2'" in refused(capsys, tmp_path / "wheel.sti")
    said = refused(capsys, WHEEL, "--sectors", 9)
    assert "no node, turned by 40 degrees about z, lies on another" in said
    said = refused(capsys, WHEEL, "--sectors", 9, "--left", "LEFT", "--right", "RIGHT")
    assert "node 9 at (46.194, -19.1342, 4)" in said or "node 3 at (46.194, -19.1342, 0)" in said
    assert "6 of 6 nodes of RIGHT have no partner" in said
    assert "8 sectors would make a whole" in said
    said = refused(capsys, WHEEL, "--sectors", 8, "--left", "LEFT", "--right", "NOBODY")
    assert "no set of nodes of this name: there are ALL, BORE, LEFT, RIGHT, RIM, TIP" in said
    assert "--left needs --right" in refused(capsys, WHEEL, "--sectors", 8, "--left", "LEFT")
    assert "leave --frames out" in refused(capsys, WHEEL, "--sectors", 8, "--frames",
                                           "cylindrical")
    assert "4 nodes of RIM against one" in refused(
        capsys, WHEEL, "--pairs", _pairs(tmp_path, "5:1", "RIM:1"))
    assert "from the nearest of RIM; sets on both sides" in refused(
        capsys, WHEEL, "--pairs", _pairs(tmp_path, "LEFT:1", "RIM:1"))
    assert "there is no set of nodes HUB" in refused(capsys, WHEEL, "--observe", "hub=HUB:1")
    assert "the ground does not move" in refused(capsys, WHEEL, "--observe", "hub=BORE:1")


def _pairs(folder: Path, one: str, two: str) -> Path:
    path = folder / "pairs.csv"
    path.write_text(f"side_1_n, side_2_n\n{one}, {two}\n")
    return path


def test_meshes_that_do_not_match_are_told_where(tmp_path: Path,
                                                 capsys: pytest.CaptureFixture[str]) -> None:
    """A node of one cut face slides along it: found by turning, and by named sets."""
    for suffix in (".sti", ".mas", ".dof"):
        shutil.copy(WHEEL.with_suffix(suffix), tmp_path)
    text = WHEEL.read_text()
    moved = next(line for line in text.splitlines() if line.startswith("2, "))
    radius = 36.0
    (tmp_path / "wheel.inp").write_text(text.replace(
        moved, f"2, {radius * np.cos(np.pi / 8):.12f}, {-radius * np.sin(np.pi / 8):.12f}, 0.0"))
    said = refused(capsys, tmp_path / "wheel.inp", "--sectors", 8)
    assert "lies in a face of the surface" in said and "node 2 at (33.2597, -13.7766, 0)" in said
    said = refused(capsys, tmp_path / "wheel.inp", "--sectors", 8, "--left", "LEFT", "--right",
                   "RIGHT")
    assert "1 of 6 nodes of LEFT have no partner: 2 at (33.2597, -13.7766, 0)" in said
    assert "1 of 6 nodes of RIGHT have no partner: 5 at (32.3358, 13.3939, 0)" in said


def test_sets_that_leave_nodes_out_are_told(tmp_path: Path,
                                            capsys: pytest.CaptureFixture[str]) -> None:
    for suffix in (".sti", ".mas", ".dof"):
        shutil.copy(WHEEL.with_suffix(suffix), tmp_path)
    text = WHEEL.read_text().replace("NSET=LEFT, GENERATE\n1, 3\n7, 9", "NSET=LEFT\n1, 2, 7, 8")
    (tmp_path / "wheel.inp").write_text(text.replace("4, 5, 6,\n10, 11, 12", "4, 5, 10, 11"))
    assert run_import(tmp_path / "wheel.inp", "--sectors", 8, "--left", "LEFT", "--right", "RIGHT",
                      "--check") == 0
    assert "2 nodes outside of LEFT lie on others when they are turned" in capsys.readouterr().out


def test_loads_on_both_faces_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All around the rim: once by each of two sectors. At the tip alone: once."""
    for load, told in (("RIM:3=1", True), ("TIP:3=1", False)):
        assert run_import(WHEEL, "--sectors", 8, "--load", load, "--check") == 0
        assert ("the loads of two sectors add up" in capsys.readouterr().out) == told


def test_decks(tmp_path: Path) -> None:
    """Includes, ranges, sets of sets, surfaces of element faces, lines that go on."""
    (tmp_path / "nodes.inc").write_text("** nodes\n*Node, nset=All\n" + "".join(
        f"{k + 1}, {x}, {y}, {z}\n" for k, (x, y, z) in enumerate(
            [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2),
             (0, 2, 2), (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2),
             (1, 2, 2), (0, 1, 2), (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1), (9, 9, 9)])))
    (tmp_path / "cube.inp").write_text(
        "*heading\nsomething, else\n*INCLUDE,\n INPUT=nodes.inc\n"
        "*ELEMENT, TYPE=C3D20R, ELSET=CUBE\n7, 1,2,3,4,5,6,7,8,9,10,\n11,12,13,14,15,16,17,18,19,"
        "20\n*ELEMENT, TYPE=SPRINGA, ELSET=SPRING\n8, 1, 21\n"
        "*NSET, NSET=ODD, GENERATE\n1, 7, 2\n*NSET, NSET=BOTH\nODD, 8\n"
        "*SURFACE, NAME=TOP, TYPE=ELEMENT\nCUBE, S2\n*SURFACE, NAME=SIDE\n7, S6\n"
        "*NSET, NSET=WHOLE, ELSET=CUBE\n"
        "*BOUNDARY\nODD, PINNED\n8, 2\n*STEP\n*STATIC\n*CLOAD\n8, 1, 2.\n8, 1, 1.5\n*DLOAD\nCUBE, "
        "P1, 3.\n*END STEP\n")
    deck = read_deck(tmp_path / "cube.inp")
    assert deck.node_sets["BOTH"] == [1, 3, 5, 7, 8]
    assert sorted(deck.node_sets["TOP"]) == [5, 6, 7, 8, 13, 14, 15, 16]
    assert sorted(deck.node_sets["SIDE"]) == [1, 4, 5, 8, 12, 16, 17, 20]
    assert deck.node_sets["WHOLE"] == list(range(1, 21))
    assert deck.supports == {(node, c) for node in (1, 3, 5, 7) for c in (1, 2, 3)} | {(8, 2)}
    assert [load.direction[0] for load in deck.loads] == [2.0, 1.5]
    assert {load.kind for load in deck.loads} == {"static"}
    assert deck.notes == [f"{tmp_path / 'cube.inp'}: loads of *DLOAD are left out; loads of nodes "
                          "(*CLOAD) are read"]
    mesh = read_mesh_file(tmp_path / "cube.inp")
    assert mesh.nodes.tolist() == list(range(1, 9)) and mesh.kind.tolist() == [12]
    middles = {node: mesh.all_points[node - 1] for node in mesh.middles[:, 2].tolist()}
    assert sorted(middles) == list(range(9, 21))
    for one, two, middle in mesh.middles.tolist():
        assert 0.5 * (mesh.all_points[one - 1] + mesh.all_points[two - 1]) == pytest.approx(
            middles[middle])


def test_surface_of_solids_without_a_face(tmp_path: Path) -> None:
    """It is what is free of them: of eight cubes all nodes but the one in the middle."""
    places = [(i, j, k) for k in range(3) for j in range(3) for i in range(3)]
    corners = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1),
               (0, 1, 1))
    cubes = [[1 + i + a + 3 * (j + b) + 9 * (k + c) for a, b, c in corners]
             for i, j, k in places if max(i, j, k) < 2]
    (tmp_path / "cubes.inp").write_text(
        "*NODE\n" + "".join(f"{n}, {x}, {y}, {z}\n" for n, (x, y, z) in enumerate(places, 1))
        + "*ELEMENT, TYPE=C3D8, ELSET=ALL\n"
        + "".join(f"{n}, {', '.join(map(str, cube))}\n" for n, cube in enumerate(cubes, 1))
        + "*SURFACE, NAME=SKIN\nALL,\n*SURFACE, NAME=CORNER\n1\n")
    deck = read_deck(tmp_path / "cubes.inp")
    assert sorted(deck.node_sets["SKIN"]) == [n for n in range(1, 28) if n != 14]
    assert sorted(deck.node_sets["CORNER"]) == sorted(set(cubes[0]) - {14})


@pytest.mark.parametrize(("text", "words"), [
    ("*NODE, SYSTEM=C\n1, 0, 0\n", "*NODE makes nodes"),
    ("*NODE\n1, 0, x\n", "expected numbers"),
    ("*NODE\n1, 0, 0\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n", "names node 2"),
    ("*NODE\n1, 0, 0\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3\n", "has 3 nodes; expected 4"),
    ("*NSET, NSET=A\nB\n", "there is no set B"),
    ("*NSET, NSET=A, GENERATE\n1, 2, 0\n", "a step of 0"),
    ("*BOUNDARY\nFOOT, 1\n", "there is no node set FOOT"),
    ("*INCLUDE, INPUT=wrong.inp\n", "include each other"),
])
def test_decks_that_are_refused(tmp_path: Path, text: str, words: str) -> None:
    from fretwear.errors import InputError

    (tmp_path / "wrong.inp").write_text(text)
    with pytest.raises(InputError, match=words.replace("*", r"\*")):
        read_deck(tmp_path / "wrong.inp")


def test_calculix_itself(tmp_path: Path) -> None:
    """The program stores again what is committed here, and has the same frequencies of its own."""
    program = shutil.which("ccx")
    if program is None:
        pytest.skip("ccx is not installed (apt install calculix-ccx)")
    for name in ("wheel", "wheel_cyclic"):
        shutil.copy(FILES / f"{name}.inp", tmp_path)
        subprocess.run([program, name], cwd=tmp_path, check=True, capture_output=True)
    for suffix in (".sti", ".mas"):
        kept, again = (np.loadtxt(path.with_suffix(suffix)) for path in
                       (WHEEL, tmp_path / "wheel.inp"))
        assert again == pytest.approx(kept, rel=SAME, abs=SAME * np.abs(kept[:, 2]).max())
    table = [line.split() for line in (tmp_path / "wheel_cyclic.dat").read_text().splitlines()]
    values = [(int(words[0]), float(words[3])) for words in table
              if len(words) == 6 and words[0].isdigit() and words[1].isdigit()]
    for k, expected in enumerate(BY_CALCULIX):
        own = np.unique([value for diameter, value in values if diameter == k])
        assert own == pytest.approx(expected, rel=WRITTEN)
