"""Import of matrices from every format, tables, checks and the command."""

from __future__ import annotations

import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from import_models import LABELS, matrices
from project import PROGRAM

from fretwear.cli import main
from fretwear.errors import InputError
from fretwear.importer import Dofs, FullModel, check_model, read_matrices, read_pairs
from fretwear.importer.build import drop
from fretwear.importer.spectrum import lowest_modes, negative_directions
from fretwear.sector import FullModel as SectorModel
from fretwear.sector import ReducedModel

FILES = Path(__file__).parent / "import_files"
MASS, STIFFNESS = matrices()
# What one coordinate left out of fifteen changes close to a resonance: 1.6e-4 was found.
TRUNCATION = 3e-4


# ----------------------------------------------------------------------- files of every format


def write_op4(folder: Path, *, binary: bool) -> list[str]:
    op4 = pytest.importorskip("pyyeti.nastran.op4")
    op4.write(str(folder / "model.op4"), ["mgg", "kgg"], [MASS, STIFFNESS], binary=binary,
              sparse="bigmat" if binary else "dense", forms=[6, 6])
    return [str(folder / "model.op4")]


def write_mat(folder: Path) -> list[str]:
    scipy.io.savemat(folder / "model.mat", {"model": {"M": sp.csc_matrix(MASS), "note": "two"},
                                            "K": STIFFNESS})
    return ["--mass", f"{folder}/model.mat#model.M", str(folder / "model.mat")]


def write_mat73(folder: Path) -> list[str]:
    """As MATLAB writes with -v7.3: a user block, arrays by columns, sparse matrices as groups."""
    with h5py.File(folder / "model.mat", "w", userblock_size=512) as file:
        full = file.create_dataset("M", data=MASS.T)
        full.attrs["MATLAB_class"] = np.bytes_("double")
        column = sp.csc_array(STIFFNESS)
        group = file.create_group("K")
        group.attrs["MATLAB_class"] = np.bytes_("double")
        group.attrs["MATLAB_sparse"] = np.uint64(len(STIFFNESS))
        group["data"], group["ir"] = column.data, column.indices.astype(np.uint64)
        group["jc"] = column.indptr.astype(np.uint64)
        file.create_dataset("note", data=np.array([[50]], np.uint16)).attrs[
            "MATLAB_class"] = np.bytes_("char")
    with open(folder / "model.mat", "r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return [str(folder / "model.mat")]


def write_matrix_market(folder: Path) -> list[str]:
    scipy.io.mmwrite(folder / "m.mtx", sp.coo_array(MASS), symmetry="symmetric")
    scipy.io.mmwrite(folder / "k.mtx", STIFFNESS, symmetry="general")
    return [str(folder / "m.mtx"), str(folder / "k.mtx")]


def write_unsymmetric_hb(folder: Path) -> list[str]:
    for name, matrix in (("mass", MASS), ("stiffness", STIFFNESS)):
        scipy.io.hb_write(folder / f"{name}.rua", sp.csc_array(matrix))
    return [str(folder / "mass.rua"), str(folder / "stiffness.rua")]


# K_rr loses digits by cancellation, and another kappa loses others.
GENERATED = 1e-7

FORMATS = {
    "op4 binary": lambda folder: write_op4(folder, binary=True),
    "op4 text": lambda folder: write_op4(folder, binary=False),
    "dmig": lambda _: [str(FILES / "chain.dmig")],
    "mat 5": write_mat,
    "mat 7.3": write_mat73,
    "matrix market": write_matrix_market,
    "harwell-boeing symmetric": lambda _: [
        "--mass", str(FILES / "chain_mass.hb"), "--stiffness", str(FILES / "chain_stiffness.hb")],
    "harwell-boeing unsymmetric": write_unsymmetric_hb,
    "abaqus matrix input": lambda _: [
        "--mass", str(FILES / "chain_MASS2.mtx"), "--stiffness", str(FILES / "chain_STIF2.mtx")],
    "abaqus coordinate": lambda _: [
        "--mass", str(FILES / "chain_MASS2.mtx"),
        "--stiffness", str(FILES / "chain_coordinate_STIF2.mtx")],
    "abaqus substructure": lambda _: [str(FILES / "chain_substructure.mtx")],
}


@pytest.mark.parametrize("name", FORMATS)
def test_round_trip(name: str, tmp_path: Path) -> None:
    """Matrices, pairs and loads of every format arrive in the model file to the last bit."""
    if name == "dmig":
        pytest.importorskip("pyyeti")
    source, target = FORMATS[name](tmp_path), tmp_path / "model.h5"
    labels = ["--labels", str(FILES / "chain.mapping")]
    named = name == "dmig" or (name.startswith("abaqus") and "coordinate" not in name)
    assert main(["import", *source, *([] if named else labels), "-o", str(target), "-q",
                 "--pairs", str(FILES / "pairs_dofs.csv"), "--loads", str(FILES / "loads.csv"),
                 "--observe", "tip=22:1", "--observe", "low=-3", "--title", "chain",
                 "--unit-system", "SI"]) == 0
    with h5py.File(target) as file:
        assert np.array_equal(file["mass"][()], MASS)
        assert np.array_equal(file["stiffness"][()], STIFFNESS)
        assert file["contact/side_1"][()].tolist() == [[10, 11, 12], [13, 14, -15]]
        assert file["contact/side_2"][()].tolist() == [[7, 8, 9], [0, 0, 0]]
        assert file["contact/mu"][()].tolist() == [0.3, 0.4]
        assert file["contact/patch"][()].tolist() == [b"flank", b"tip"]
        assert file["contact/position"][1].tolist() == [10.0, 0.0, 0.0]
        cosine = np.zeros(15)
        cosine[LABELS.index((12, 1))], cosine[LABELS.index((22, 1))] = 1.0, -0.5
        assert np.array_equal(file["load/cosine"][()], cosine)
        assert file["load/static"][14] == -5.0
        assert file["observe/matrix"][1].tolist() == [0.0, 0.0, -1.0] + 12 * [0.0]
        assert file["observe/name"][()].tolist() == [b"tip", b"low"]
        assert bytes(file.attrs["title"]) == b"chain"


def test_ansys_full_file() -> None:
    """The file that ansys-mapdl-reader ships, a beam of 40 hexahedra, as that package reads it."""
    reader = pytest.importorskip("ansys.mapdl.reader")
    from ansys.mapdl.reader import examples

    found = read_matrices(examples.fullfile)
    dofs, stiffness, mass = reader.read_binary(examples.fullfile).load_km(sort=True)
    assert [(int(node), int(c) + 1) for node, c in dofs] == found.labels
    held = found.matrices["k"].diagonal() >= 1e30
    for name, half in (("k", stiffness), ("m", mass)):
        expected = half + sp.triu(half, 1).T + sp.tril(half, -1).T
        own = found.matrices[name] - sp.diags_array(np.where(held, 1e30, 0.0) * (name == "k"))
        assert abs(own - expected).max() == 0.0
    assert found.labels is not None
    assert len(found.labels) == found.matrices["k"].shape[0]
    model = drop(FullModel({"mass": found.matrices["m"], "stiffness": found.matrices["k"]},
                           Dofs(len(found.labels), found.labels)), empty=False)
    assert model.dofs.signed("1:1", "here") == 0  # a node of the clamped face
    assert not [finding for finding in check_model(model) if finding.kind == "error"]


def test_genuine_abaqus_substructures() -> None:
    parser = pytest.importorskip("abaqus_mtx_parser")
    for path in (Path(parser.__file__).parent / "mtx").glob("*/*.mtx"):
        found, expected = read_matrices(path), parser.parse_mtx(str(path))
        assert np.array_equal(found.matrices["stiffness"].toarray(), expected.stiffness), path
        assert found.labels == [(node, dof) for node in expected.nodes
                                for dof in expected.dof[node]], path


def test_genuine_nastran_files() -> None:
    """OUTPUT4 of an external superelement that pyyeti ships: symmetric, massive, held."""
    pyyeti = pytest.importorskip("pyyeti")
    path = Path(pyyeti.__file__).parent / "tests" / "nas2cam_extseout" / "outboard.op4"
    if not path.exists():
        pytest.skip("this pyyeti comes without its test files")
    found = read_matrices(path).matrices
    model = FullModel({"mass": found["mxx"], "stiffness": found["kxx"]},
                      Dofs(found["mxx"].shape[0]))
    kinds = {finding.kind for finding in check_model(model)}
    assert "error" not in kinds


# ----------------------------------------------------------------------- use of the model file


NAMELIST = """&case analysis = 'frf' threads = 1 /
&model source = 'hdf5' file = '{file}' rayleigh_mass = 0.05 rayleigh_stiffness = 0.002 /
&contact law = 'penalty' tangential_stiffness = 200 normal_stiffness = 300 /
&harmonics n_harmonics = 3 /
&sweep start = 2 end = 6 n_points = 5 /
"""


def tip_amplitude(folder: Path, name: str) -> np.ndarray:
    (folder / f"{name}.nml").write_text(NAMELIST.format(file=f"{name}.h5"))
    done = subprocess.run([PROGRAM, "-q", "-o", f"{name}_result.h5", f"{name}.nml"], cwd=folder,
                          text=True, capture_output=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / f"{name}_result.h5") as file:
        return file["amplitude"][:, 0]


def test_imported_and_reduced_models_respond_alike(tmp_path: Path) -> None:
    """With all bonded motions but one the reduced model answers as the full one."""
    common = ["import", str(FILES / "chain_substructure.mtx"), "-q", "--loads",
              str(FILES / "loads.csv"), "--observe", "tip=22:1"]
    assert main([*common, "--pairs", str(FILES / "pairs_dofs.csv"), "-o",
                 str(tmp_path / "full.h5")]) == 0
    assert main([*common, "--pairs", str(FILES / "pairs_dofs.csv"), "--reduce", "5", "-o",
                 str(tmp_path / "reduced.h5")]) == 0
    with h5py.File(tmp_path / "reduced.h5") as file:
        assert file["contact/side_1"][()].tolist() == [[1, 2, 3], [4, 5, 6]]
        assert not file["contact/side_2"][()].any()
    full, reduced = (tip_amplitude(tmp_path, name) for name in ("full", "reduced"))
    assert reduced == pytest.approx(full, rel=TRUNCATION)


def test_the_sector_arrives_as_its_generator_makes_it(
        full: SectorModel, reduced: ReducedModel, tmp_path: Path) -> None:
    """Matrices, patch averages and loads of the sector through files, then reduced."""
    scipy.io.savemat(tmp_path / "full.mat", {
        "M": full.mass, "K": full.stiffness, "G": full.rotation, "B": full.contact})
    positions = "\n".join(",".join(map(repr, (0.5, area, *place))) for area, place in zip(
        full.rows.area.tolist(), full.rows.position.tolist()))
    (tmp_path / "pairs.csv").write_text("mu,area,x,y,z\n" + positions + "\n")
    force = "\n".join(f"{k + 1},{float(full.tip_force[k])!r}"
                      for k in np.flatnonzero(full.tip_force))
    (tmp_path / "loads.csv").write_text(f"dof,cosine\n{force}\n")
    n_modes = full.parameters.discretisation.n_modes
    arguments = ["import", str(tmp_path / "full.mat"), "-q", "-o", str(tmp_path / "model.h5"),
                 "--stiffness-rotation", f"{tmp_path}/full.mat#g", "--pairs",
                 str(tmp_path / "pairs.csv"), "--loads", str(tmp_path / "loads.csv"),
                 "--unit-system", "mm-tonne-s-N", "--reduce", str(n_modes)]
    assert main([*arguments, "--contact-rows", f"{tmp_path}/full.mat#k"]) == 3
    assert main([*arguments, "--contact-rows", f"{tmp_path}/full.mat#b"]) == 0
    with h5py.File(tmp_path / "model.h5") as file:
        for name in ("mass", "stiffness", "stiffness_rotation"):
            expected = getattr(reduced, name)
            assert file[name][()] == pytest.approx(expected, abs=GENERATED * np.abs(expected).max())
        assert file["load/cosine"][()] == pytest.approx(
            reduced.cosine, abs=GENERATED * np.abs(reduced.cosine).max())
        assert file["contact/side_1"][-1].tolist() == [3 * reduced.n_pairs - 2,
                                                       3 * reduced.n_pairs - 1, 3 * reduced.n_pairs]


def test_pairs_by_nodes_and_normals(tmp_path: Path) -> None:
    pairs = read_pairs(FILES / "pairs_nodes.tsv", Dofs(15, LABELS))
    assert pairs.rows is not None
    rows = pairs.rows.toarray()
    place = {label: i for i, label in enumerate(LABELS)}
    assert rows[0, place[21, 1]] == 1.0
    assert rows[0, place[13, 1]] == -1.0
    assert rows[2, [place[21, 3], place[13, 3]]].tolist() == [1.0, -1.0]
    frame = rows[3:, [place[22, c] for c in (1, 2, 3)]]
    assert frame @ frame.T == pytest.approx(np.eye(3))
    assert frame[2] == pytest.approx([0.6, 0.0, 0.8])
    assert np.linalg.det(frame) == pytest.approx(1.0)
    arguments = ["import", str(FILES / "chain_substructure.mtx"), "-q", "--pairs",
                 str(FILES / "pairs_nodes.tsv"), "-o", str(tmp_path / "model.h5")]
    assert main(arguments) == 0  # these are rows behind the degrees of freedom
    with h5py.File(tmp_path / "model.h5") as file:
        assert (file["row/matrix"][()] == rows).all()
        assert file["contact/side_1"][()].tolist() == [[16, 17, 18], [19, 20, 21]]
        assert not file["contact/side_2"][()].any()
    assert main([*arguments, "--reduce", "4"]) == 0


# ----------------------------------------------------------------------- checks


def findings(mass: np.ndarray = MASS, stiffness: np.ndarray = STIFFNESS, *, pairs: str = "",
             unit_system: str = "", folder: Path | None = None) -> list[str]:
    dofs = Dofs(len(mass), LABELS[:len(mass)])
    table = None
    if pairs:
        assert folder is not None
        (folder / "pairs.csv").write_text(pairs)
        table = read_pairs(folder / "pairs.csv", dofs)
    model = FullModel({"mass": sp.csr_array(mass), "stiffness": sp.csr_array(stiffness)}, dofs,
                      table, unit_system=unit_system)
    return [str(finding).replace(str(folder), "") for finding in check_model(model)]


def changed(matrix: np.ndarray, i: int, j: int, value: float) -> np.ndarray:
    other = matrix.copy()
    other[i, j] = value
    return other


@pytest.mark.parametrize(("mass", "stiffness", "expected"), [
    (MASS, changed(STIFFNESS, 0, 3, -100.0),
     "error: stiffness: not symmetric: -100 at (dof 1 (11:1), dof 4 (12:1)), but -100.5 mirrored"),
    (MASS, changed(STIFFNESS, 0, 3, -100.5001), "warning: stiffness: not symmetric"),
    (MASS, np.tril(STIFFNESS), "error: stiffness: only one triangle is there"),
    (MASS, changed(STIFFNESS, 4, 4, np.nan), "error: stiffness: 1 entries are not finite, first "
     "nan at (dof 5 (12:2), dof 5 (12:2))"),
    (-MASS, STIFFNESS, "error: mass: 15 negative diagonal entries, first -1 at dof 1 (11:1)"),
    (changed(changed(MASS, 9, 12, 2.0), 12, 9, 2.0), STIFFNESS,
     "error: mass: not positive semidefinite: 1 negative eigenvalues"),
    (MASS, STIFFNESS - 30.0 * np.eye(15), "warning: stiffness: not positive semidefinite"),
    (changed(MASS, 2, 2, 0.0), changed(STIFFNESS, 2, 2, 0.0) * (np.arange(15) != 2)
     * (np.arange(15) != 2)[:, None],
     "error: mass and stiffness: 1 degrees of freedom have neither, first dof 3 (11:3)"),
    (MASS * (np.arange(15) < 9)[:, None], STIFFNESS,
     "error: mass and stiffness: a motion has neither mass nor stiffness"),
    (MASS, STIFFNESS, "warning: stiffness: 3 rigid-body modes, of which the contact holds 0"),
    (MASS * 1e8, STIFFNESS, "Hz is not plausible. Stiffness over mass must be in 1/s^2"),
])
def test_wrong_matrices_are_named(mass: np.ndarray, stiffness: np.ndarray, expected: str) -> None:
    assert expected in "\n".join(findings(mass, stiffness))


def long_chain(n: int) -> tuple[sp.csr_array, sp.csr_array]:
    """Free chain of n unit masses and springs: omega_k = 2 sin(k pi / 2n)."""
    diagonal = np.full(n, 2.0)
    diagonal[[0, -1]] = 1.0
    springs = sp.diags_array([diagonal, np.full(n - 1, -1.0), np.full(n - 1, -1.0)],
                             offsets=[0, 1, -1])
    return sp.csr_array(sp.eye_array(n)), sp.csr_array(springs)


@pytest.mark.parametrize("n", [300, 700])
def test_spectrum_of_small_and_large_models(n: int) -> None:
    """Dense and sparse algebra: rigid modes, frequencies and negative directions."""
    mass, stiffness = long_chain(n)
    found = lowest_modes(mass, stiffness)
    assert found is not None
    assert found.rigid.shape[1] == 1
    assert np.abs(found.rigid[:, 0]) == pytest.approx(np.full(n, n**-0.5), rel=1e-6)
    exact = 2.0 * np.sin(np.arange(1, 6) * np.pi / (2 * n)) / (2.0 * np.pi)
    assert found.frequency[:5] == pytest.approx(exact, rel=1e-6)
    assert found.local == pytest.approx(np.sqrt(2.0) / (2.0 * np.pi))
    assert negative_directions(stiffness) == 0
    softened = sp.csr_array(stiffness - 1e-3 * mass)
    count = int((2.0 * np.sin(np.arange(n) * np.pi / (2 * n)) < np.sqrt(1e-3)).sum())
    assert negative_directions(softened) == count > 1


HEAD = "side_1_t1,side_1_t2,side_1_n,side_2_t1,side_2_t2,side_2_n,mu,gap,area,x,y,z\n"
GOOD = "21:1,21:2,21:3,13:1,13:2,13:3,0.3,0,4,0,0,0\n22:1,22:2,22:3,,,,0.3,0,4,9,0,0\n"


@pytest.mark.parametrize(("lines", "expected"), [
    (GOOD, "note: stiffness: 3 rigid-body modes, all held by the contact"),
    (GOOD + "21:1,,,13:1,,,0.3,0,4,5,0,0\n",
     "error: /pairs.csv, line 4: a relative displacement is given also by the pair of "
     "/pairs.csv, line 2; rigid contact"),
    (GOOD + "13:1,,,21:1,,,0.3,0,4,5,0,0\n", "also by the pair of /pairs.csv, line 2"),
    (GOOD + "12:1,,,12:1,,,0.3,0,4,5,0,0\n",
     "error: /pairs.csv, line 4: both sides of t1 are dof 4"),
    (GOOD + "12:1,12:1,,,,,0.3,0,4,5,0,0\n", "line 4: side_1 has one dof in two directions"),
    (GOOD + "0,0,0,0,0,0,0.3,0,4,5,0,0\n", "line 4: the pair has no degree of freedom"),
    (GOOD + "12:1,,,,,,0.3,0,0,5,0,0\n", "error: /pairs.csv, line 4: area = 0; must be positive"),
    (GOOD + "12:1,,,,,,-0.3,0,4,5,0,0\n", "error: /pairs.csv, line 4: mu = -0.3"),
    (GOOD + "12:1,,,,,,30,0,4,5,0,0\n", "warning: /pairs.csv, line 4: mu = 30"),
    (GOOD + "12:1,,,,,,0.3,7,4,5,0,0\n", "line 4: gap = 7 exceeds the edge of the patch, 2"),
    (GOOD + "12:1,,,,,,0.3,0,4,9,0,0\n", "has the position of the pair of /pairs.csv, line 3"),
    (GOOD + "12:1,,,13:1,,,1,0,4,1,0,0\n12:1,,,21:1,,,1,0,4,2,0,0\n",
     "error: pairs: 1 of 8 relative displacements are combinations of others"),
    (GOOD.replace(",4,", ",4e6,"), "warning: pairs: the areas add up to 8e+06"),
    ("22:1,22:2,,,,,0.3,0,4,9,0,0\n", "error: stiffness: 3 rigid-body modes, of which the contact "
     "holds 2"),
])
def test_wrong_pairs_are_named(lines: str, expected: str, tmp_path: Path) -> None:
    assert expected in "\n".join(findings(pairs=HEAD + lines, folder=tmp_path))


@pytest.mark.parametrize(("table", "expected"), [
    (HEAD + GOOD.replace("21:1", "99:1"), "line 2, column side_1_t1: 99:1 is not in the matrices; "
     "they have no node 99"),
    (HEAD + GOOD.replace("21:1", "21:6"), "node 21 has the components [1, 2, 3]"),
    (HEAD + GOOD.replace("21:1", "21:q"), "'q' is no component"),
    (HEAD + GOOD.replace("21:1", "16"), "dof 16 is not there; the matrices have 15"),
    (HEAD + GOOD.replace("21:1", "one"), "'one' names no degree of freedom"),
    (HEAD + GOOD.replace("0.3", "inf"), "column mu: 'inf' is not a finite number"),
    (HEAD + GOOD.replace(",4,", ","), "has 11 values; expected 12"),
    (HEAD.replace("mu", "mue") + GOOD, "column 'mue' is not known"),
    (HEAD.replace(",z", ",patch") + GOOD, "column z is missing beside x, y"),
    ("mu\n0.3\n", "names no sides"),
    ("mu\n", "expected a heading and at least one line"),
    ("node_1,node_2,nx,ny,nz\n21,0,0,0,0\n", "line 2: the normal is zero"),
])
def test_wrong_tables_are_named(table: str, expected: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        findings(pairs=table, folder=tmp_path)
    assert expected in str(error.value)


def test_units_of_mass_and_patch_are_compared(tmp_path: Path) -> None:
    """Steel bars between the nodes: with kg where tonnes belong, elements do not fit patches."""
    edge, steel, density = 20.0, 2.1e5, 7.8e-9
    bar = edge * steel
    stiffness = np.kron(np.diag([2.0] * 5) - np.eye(5, k=1) - np.eye(5, k=-1), np.eye(3)) * bar
    mass = np.eye(15) * density * edge**3
    lines = HEAD + GOOD.replace(",4,", ",400,").replace(",9,", ",90,")
    good = findings(mass, stiffness, pairs=lines, folder=tmp_path, unit_system="mm-tonne-s-N")
    assert any("imply elements of about" in line for line in good)
    assert not any(line.startswith("warning: units") for line in good)
    wrong = findings(1e3 * mass, stiffness, pairs=lines, folder=tmp_path,
                     unit_system="mm-tonne-s-N")
    assert any("do not fit contact patches" in line for line in wrong)


def test_held_degrees_of_freedom_are_left_out(tmp_path: Path) -> None:
    """Abaqus marks a boundary condition by 1e36 on the diagonal."""
    held = changed(STIFFNESS, 0, 0, 1e36)
    model = drop(FullModel({"mass": sp.csr_array(MASS), "stiffness": sp.csr_array(held)},
                           Dofs(15, LABELS)), empty=False)
    assert model.dofs.n == 14
    assert model.dofs.name(0) == "dof 1 (11:2)"
    assert model.dofs.signed("11:1", "here") == 0
    assert "1 held" in model.notes[0]
    with pytest.raises(InputError, match="not in the matrices"):
        model.dofs.signed("11:5", "here")


# ----------------------------------------------------------------------- command


def test_check_reports_and_writes_nothing(tmp_path: Path,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["import", str(FILES / "chain_substructure.mtx"), "--check", "--pairs",
                 str(FILES / "pairs_dofs.csv"), "--unit-system", "m-kg-s-N"]
    assert main([*arguments, "--reduce", "4"]) == 0
    out = capsys.readouterr().out
    assert "3 rigid-body modes, all held by the contact" in out
    assert "no errors in 15 degrees of freedom, 2 pairs" in out
    assert main([*arguments, "--reduce", "40"]) == 3
    assert "n_modes = 40 is not accepted" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("arguments", "status", "message"), [
    (["{files}/chain_substructure.mtx"], 3, "nothing to write"),
    (["{files}/chain_substructure.mtx", "-o", "{tmp}/none/model.h5"], 5, "no folder to write"),
    (["{files}/none.op4", "--check"], 5, "cannot be read"),
    (["{files}/chain.mapping", "--check"], 3, "the format is not recognized"),
    (["{files}/chain_MASS2.mtx", "--check"], 3, "no mass matrix: give --mass"),
    (["--mass", "{files}/chain_substructure.mtx#massa", "--check"], 3,
     "holds no matrix 'massa'; there are stiffness, mass"),
    (["--mass", "{files}/chain_mass.hb", "--stiffness", "{files}/chain_substructure.mtx",
      "--observe", "tip", "--check"], 3, "expected NAME=DOF"),
    (["{files}/chain_substructure.mtx", "--check", "--reduce", "4"], 3, "--reduce needs contact"),
    (["{files}/chain_mass.hb", "--format", "abaqus", "--check"], 3, "cannot be read as abaqus"),
    (["{files}/chain_substructure.mtx", "--labels", "{files}/pairs_dofs.csv",
      "--check"], 3, "expected equation, node and component"),
])
def test_wrong_commands(arguments: list[str], status: int, message: str, tmp_path: Path,
                        capsys: pytest.CaptureFixture[str]) -> None:
    words = [word.format(files=FILES, tmp=tmp_path) for word in arguments]
    assert main(["import", *words]) == status
    assert message in capsys.readouterr().err


def test_a_missing_reader_is_named(monkeypatch: pytest.MonkeyPatch,
                                   capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyyeti.nastran.bulk", None)
    assert main(["import", str(FILES / "chain.dmig"), "--check"]) == 3
    assert "pip install pyyeti" in capsys.readouterr().err
