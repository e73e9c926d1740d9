"""Import of what makes a disk of blades as they are: modes of the blade, stress, speeds."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from program import run
from sector_files import SMALL, command, write_sector

from fretwear.blade_modes import mode_rows
from fretwear.cli import main
from fretwear.disk import FullDisk, build_full, reduce_disk
from fretwear.disk.blades import blade_modes, find_blade
from fretwear.disk.model import reduced_system
from fretwear.sector.stress import stress_points

#: Of the same matrices by two ways.
SAME = 1e-9
#: Solutions of full matrices whose condition is 1e7 (measured 4e-8).
SOLVED = 1e-6
#: Of shifts, by the modes that either reduction leaves out.
REDUCED = 5e-3
OMEGA, ORDER, LOSS = 2.0 * np.pi * 900.0, 2, 1e-6


@pytest.fixture(scope="module", name="full")
def build() -> FullDisk:
    return build_full(SMALL)


@pytest.fixture(scope="module", name="folder")
def write(full: FullDisk, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("blades")
    write_sector(full, path)
    nodes = np.unique(full.free[blade_modes(full, 1).inside] // 3) + 1
    (path / "blade.csv").write_text("\n".join(["node", *map(str, nodes)]))
    (path / "loads.csv").write_text(f"dof, cosine, static_rotation\n{nodes[-1]}:2, 0.3, 0\n"
                                    f"{nodes[-1]}:1, 0, 1e-6\n")
    rows = all_stress(full)
    scipy.io.mmwrite(path / "stress.mtx", sp.coo_array(rows))
    lines = ["point, dof, xx, yy, zz, xy, yz, zx", "p1, static, 1, 2, 3, 4, 5, 6",
             "p0, static_rotation, 1e-6, 0, 0, 0, 0, 0"]
    for point in (0, 1):
        own = sp.csc_array(rows[6 * point:6 * point + 6])
        for column in np.flatnonzero(np.diff(own.indptr)):
            node, component = full.free[column] // 3 + 1, full.free[column] % 3 + 1
            values = own[:, [column]].toarray()[:, 0]
            lines.append(f"p{point}, {node}:{component}, " + ", ".join(f"{v:.17g}" for v in values))
    (path / "stress.csv").write_text("\n".join(lines))
    (path / "points.csv").write_text("point, x, y, z, endurance, ultimate\np1, 1, 2, 3, 300, 900\n"
                                     "p0, 4, 5, 6, 250, 800\n")
    return path


def all_stress(full: FullDisk) -> sp.csr_array:
    points = stress_points(full.sector.mesh, full.sector.body, full.parameters.material)
    return sp.csr_array(points.rows[:, full.free])


def imported(folder: Path, target: Path, *more: str) -> None:
    assert main(command(folder, "--frames", "cartesian", "-q", "--loads", str(folder / "loads.csv"),
                        "-o", str(target), *more)) == 0


def test_rows_of_the_blade_are_those_of_the_generator(full: FullDisk, folder: Path, tmp_path: Path,
                                                      capsys: pytest.CaptureFixture[str]) -> None:
    blade = ["--blade", str(folder / "blade.csv"), "--blade-modes", "3"]
    imported(folder, tmp_path / "whole.h5", *blade)
    modes = blade_modes(full, 3)
    wanted = mode_rows(modes.stiffness, modes.inside, modes.squares, modes.shapes).toarray()
    with h5py.File(tmp_path / "whole.h5") as file:
        rows, omega = file["mistuning/rows"][()], file["mistuning/row_omega"][()]
        assert omega == pytest.approx(np.sqrt(modes.squares), rel=SAME)
        assert np.abs(rows - wanted).max() < 1e-7 * np.abs(wanted).max()
        for role, of_blade in (("stiffness", modes.stiffness), ("mass", modes.mass)):
            matrix = file[f"mistuning/blade_{role}"][()]
            size = np.abs(matrix).max()
            assert np.linalg.eigvalsh(matrix).min() > -1e-12 * size * len(matrix)
            inside = np.abs(matrix - of_blade.toarray())[modes.inside]
            assert inside.max() < SAME * size
    assert main(command(folder, "--frames", "cartesian", "--reduce", "20", *blade, "-o",
                        str(tmp_path / "reduced.h5"))) == 0
    assert "frequencies of the blade alone [Hz]: " in capsys.readouterr().err


def test_blades_of_an_import_shift_the_frequencies_as_those_of_the_generator(
        full: FullDisk, folder: Path, tmp_path: Path) -> None:
    """All blades alike by 2 %. The stiffness of the blade lacks what its elements have between the
    nodes that it stands on, which is felt by little."""
    imported(folder, tmp_path / "reduced.h5", "--reduce", "40", "--blade",
             str(folder / "blade.csv"), "--blade-modes", "3")
    case = tmp_path / "case.nml"
    case.write_text("&case analysis = 'modes' /\n&model source = 'hdf5' file = 'reduced.h5' /\n"
                    "&cyclic engine_order = 2 mistuned = .true. n_modes = 1 /\n")

    def first(name: str, setting: str) -> np.ndarray:
        values: np.ndarray = run(case, tmp_path / f"{name}.h5", setting)["modes/open"][0]
        return values[:12]

    tuned = first("tuned", "mistuning%scale=0")
    rows = first("rows", "mistuning%frequency=" + ", ".join(["0.02"] * 12)) - tuned
    stiffness = first("stiffness", "mistuning%stiffness=" + ", ".join(["0.0404"] * 12)) - tuned
    system = reduced_system(full)
    disk, blade = reduce_disk(full, system), find_blade(full, system.reduction, 3)

    def of_disk(change: np.ndarray) -> np.ndarray:
        stiffer = type(disk)(**{**vars(disk), "stiffness": disk.stiffness + change})
        # Twice but nodal diameters 0 and N/2.
        return 2.0 * np.pi * np.sort(np.concatenate([
            np.repeat(stiffer.frequencies(k, n=1), 1 if k in (0, 6) else 2) for k in range(7)]))

    at_rest = of_disk(0.0 * blade.stiffness)
    by_rows = of_disk(0.0404 * blade.rows.T @ np.diag(blade.omega**2) @ blade.rows) - at_rest
    assert np.abs(rows / by_rows - 1.0).max() < REDUCED
    off = np.abs(stiffness / (of_disk(0.0404 * blade.stiffness) - at_rest) - 1.0).max()
    assert REDUCED < off < 0.1


def test_stress_is_that_of_the_full_sector(full: FullDisk, folder: Path, tmp_path: Path) -> None:
    """Rows and table, whole and reduced, where components of the right interface are turned."""
    rows = all_stress(full)
    n = full.n_interface
    z = np.exp(-2j * np.pi * ORDER / SMALL.n_sectors)
    tie = sp.csr_array(full.rows[n:2 * n] - z * full.rows[:n])
    matrix = sp.csr_array((1.0 + 1j * OMEGA * LOSS) * full.stiffness - OMEGA**2 * full.mass)
    node = int((folder / "loads.csv").read_text().splitlines()[1].split(":")[0])
    load = np.zeros(len(full.free) + n, dtype=complex)
    load[np.flatnonzero(full.free == 3 * (node - 1) + 1)] = 0.3
    whole = sp.csc_matrix(sp.block_array([[matrix, tie.conj().T], [tie, None]]))
    wanted = (rows @ spl.spsolve(whole, load)[:len(full.free)]).reshape(-1, 6)
    (tmp_path / "case.nml").write_text(
        "&case analysis = 'point' /\n&model source = 'hdf5' file = 'model.h5'\n"
        f"   rayleigh_stiffness = {LOSS} /\n&cyclic engine_order = {ORDER} /\n"
        f"&harmonics n_harmonics = 1 /\n&sweep start = {OMEGA:.17g} /\n"
        "&stress output = 'tensor' /\n")

    def found(*more: str) -> np.ndarray:
        imported(folder, tmp_path / "model.h5", *more)
        c = run(tmp_path / "case.nml", tmp_path / "case.h5")["stress/coefficients"][0]
        return np.vstack([c[1] - 1j * c[2], c[0]])

    by_rows = found("--stress-rows", str(folder / "stress.mtx"))
    n_points = len(wanted)
    assert np.abs(by_rows[:n_points] - wanted).max() < SOLVED * np.abs(wanted).max()
    table = ["--stress-table", str(folder / "stress.csv"), "--stress-points",
             str(folder / "points.csv")]
    by_table = found(*table)
    # The table names p1 first.
    assert np.abs(by_table[:2] - by_rows[[1, 0]]).max() < SAME * np.abs(wanted).max()
    assert by_table[2].real == pytest.approx([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    with h5py.File(tmp_path / "model.h5") as file:
        assert file["stress/endurance"][()].tolist() == [300.0, 250.0]
        assert file["stress/position"][1].tolist() == [4.0, 5.0, 6.0]
        assert file["stress/static_rotation"][1, 0] == 1e-6
    errors = [np.abs(found("--stress-rows", str(folder / "stress.mtx"), "--reduce", n_modes)[
        :n_points] - wanted).max() / np.abs(wanted).max() for n_modes in ("20", "60")]
    assert errors[0] < 0.1 and errors[1] < 0.3 * errors[0]


@pytest.mark.parametrize("reduced", [[], ["--reduce", "20"]])
def test_matrices_at_speeds(full: FullDisk, folder: Path, tmp_path: Path,
                            reduced: list[str]) -> None:
    """A stiffness that grows with the square of the speed, by its matrix and by those at speeds."""
    scipy.io.mmwrite(tmp_path / "rotation.mtx", sp.coo_array(full.rotation), symmetry="symmetric")
    words = []
    for speed in (300.0, 600.0):
        file = tmp_path / f"at_{speed:g}.mtx"
        scipy.io.mmwrite(file, sp.coo_array(full.stiffness + speed**2 * full.rotation),
                         symmetry="symmetric")
        words += ["--at-speed", f"{speed}={file}"]
    (tmp_path / "case.nml").write_text(
        "&case analysis = 'point' /\n&model source = 'hdf5' file = 'model.h5'\n"
        "   rayleigh_stiffness = 1e-6 rotation_speed = 450.0 /\n&cyclic engine_order = 2 /\n"
        "&harmonics n_harmonics = 1 /\n&sweep start = 5000.0 /\n&stress output = 'tensor' /\n")
    stress = ["--stress-rows", str(folder / "stress.mtx"), *reduced]
    results = []
    for more in (["--stiffness-rotation", str(tmp_path / "rotation.mtx")], words):
        imported(folder, tmp_path / "model.h5", *more, *stress)
        results.append(run(tmp_path / "case.nml", tmp_path / "case.h5")["stress/coefficients"][0])
    assert np.abs(results[1] - results[0]).max() < 1e-7 * np.abs(results[0]).max()
    with h5py.File(tmp_path / "model.h5") as file:
        assert file["speed/value"][()].tolist() == [0.0, 300.0, 600.0]
        assert "load/static_rotation" not in file


@pytest.mark.parametrize(("options", "words"), [
    (["--blade-modes", "3"], "goes with --blade"),
    (["--blade", "none.csv"], "cannot be read"),
    (["--blade", "{}/blade.csv", "--blade-modes", "0"], "must be 1 to"),
    (["--blade", "{}/strange.csv"], "node 99999 is not in the matrices"),
    (["--blade", "{}/labels.csv"], "no node beside those of the blade"),
    (["--blade", "{}/blade.csv", "--by-diameter", "--reduce", "3"], "leave that out"),
    (["--stress-rows", "{}/five.mtx"], "expected 6 rows for each point"),
    (["--stress-rows", "{}/stress.mtx", "--stress-table", "{}/stress.csv"], "one of both"),
    (["--stress-points", "{}/points.csv"], "goes with --stress-rows"),
    (["--stress-table", "{}/points.csv"], "column 'x' is not known"),
    (["--stress-table", "{}/stress.csv", "--stress-points", "{}/few.csv"], "point p1 is missing"),
    (["--stress-table", "{}/stress.csv", "--stress-points", "{}/weak.csv"], "must be above 0"),
    (["--at-speed", "fast={}/stiffness.mtx"], "must be SPEED=FILE"),
    (["--at-speed", "0={}/stiffness.mtx"], "must be a speed above 0"),
    (["--at-speed", "5={}/stiffness.mtx", "--at-speed", "5={}/stiffness.mtx"], "twice"),
    (["--at-speed", "5={}/stress.mtx"], "as --stiffness"),
])
def test_what_is_refused(folder: Path, capsys: pytest.CaptureFixture[str], options: list[str],
                         words: str) -> None:
    (folder / "strange.csv").write_text("node\n99999\n")
    nodes = {line.split()[1] for line in (folder / "labels.txt").read_text().splitlines()[1:]}
    (folder / "labels.csv").write_text("\n".join(["node", *sorted(nodes)]))
    scipy.io.mmwrite(folder / "five.mtx", sp.coo_array(np.ones((5, 3))))
    (folder / "few.csv").write_text("point, x, y, z\np0, 0, 0, 0\n")
    (folder / "weak.csv").write_text("point, endurance, ultimate\np0, 1, 1\np1, 0, 1\n")
    assert main(command(folder, *(word.format(folder) for word in options), "-q", "-o",
                        "never.h5")) in (3, 5)
    assert words in capsys.readouterr().err
