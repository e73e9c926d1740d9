"""Blades of the shrouded disk: rows of their modes stand for a stiffness that is scaled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.sparse as sp
from program import run

from fretwear.disk import DiskParameters, build_full, reduce_disk
from fretwear.disk.blades import Blade, blade_modes, find_blade
from fretwear.disk.cli import main
from fretwear.disk.model import FullDisk, ReducedDisk, reduced_system

SMALL = DiskParameters(n_sectors=8, disk_rows=2, blade_rows=3, axial_layers=1, n_modes=20)
#: Of the frequency of a blade.
DEVIATION = 0.02


@pytest.fixture(scope="module", name="full")
def build() -> FullDisk:
    return build_full(SMALL)


@pytest.fixture(scope="module", name="reduced")
def reduce_it(full: FullDisk) -> tuple[ReducedDisk, Blade]:
    system = reduced_system(full)
    return reduce_disk(full, system), find_blade(full, system.reduction, 3)


def first_family(disk: ReducedDisk, change: np.ndarray) -> np.ndarray:
    stiffer = replace(disk, stiffness=disk.stiffness + change)
    return np.array([stiffer.frequencies(k, n=1)[0] for k in range(5)])


def test_rows_stand_for_the_stiffness_of_the_blade(
        full: FullDisk, reduced: tuple[ReducedDisk, Blade]) -> None:
    """The shift of the first family by the first row, within a percent of that by the matrix; rows
    by mass are further off by an order."""
    disk, blade = reduced
    part = (1.0 + DEVIATION)**2 - 1.0
    tuned = first_family(disk, 0.0 * disk.stiffness)
    shift = first_family(disk, part * blade.stiffness) - tuned
    assert (shift > 0.9 * DEVIATION * tuned).all()

    def off(row: np.ndarray) -> float:
        found = first_family(disk, part * blade.omega[0]**2 * np.outer(row, row)) - tuned
        return float(np.abs(found / shift - 1.0).max())

    modes = blade_modes(full, 1)
    moved = np.zeros(len(full.free))
    moved[modes.inside] = modes.mass[modes.inside][:, modes.inside] @ modes.shapes[:, 0]
    by_mass = reduced_system(full).reduction.row(sp.csr_array(moved[None]))[0]
    assert off(blade.rows[0]) < 0.01
    assert off(by_mass) > 0.05


def test_matrices_are_those_of_the_blade_alone(full: FullDisk,
                                               reduced: tuple[ReducedDisk, Blade]) -> None:
    """Semidefinite, parts of those of the sector, and no rigid motion strains the blade."""
    disk, blade = reduced
    for part, whole in ((blade.stiffness, disk.stiffness), (blade.mass, disk.mass)):
        size = np.abs(np.linalg.eigvalsh(whole)).max()
        assert np.linalg.eigvalsh(part).min() > -1e-9 * size
        assert np.linalg.eigvalsh(whole - part).min() > -1e-9 * size
    shapes = np.linalg.eigvalsh(blade.stiffness)
    # The root may move as it likes: six rigid motions, and what the disk alone does.
    assert (shapes < 1e-9 * shapes[-1]).sum() >= 6


def test_the_file_serves_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All blades alike by rows and by stiffness: frequencies of the whole disk."""
    path = tmp_path / "disk.h5"
    options = [word for name in ("n_sectors", "disk_rows", "blade_rows", "axial_layers", "n_modes")
               for word in ("--" + name.replace("_", "-"), str(getattr(SMALL, name)))]
    assert main([*options, "--blade", "3", "-o", str(path)]) == 0
    assert "frequencies of the blade alone [Hz]: 202.7, 372.8, 709.8" in capsys.readouterr().out
    with h5py.File(path) as file:
        assert file["mistuning/rows"].shape[0] == len(file["mistuning/row_omega"]) == 3
    case = tmp_path / "case.nml"
    case.write_text("&case analysis = 'modes' /\n&model source = 'hdf5' file = 'disk.h5' /\n"
                    "&cyclic engine_order = 4 mistuned = .true. n_modes = 1 /\n"
                    "&contact law = 'penalty' tangential_stiffness = 1e4\n"
                    "   normal_stiffness = 1e4 /\n")
    found = {}
    for name, key in (("tuned", "scale=0"), ("rows", f"frequency={[DEVIATION] * 8}"),
                      ("stiffness", f"stiffness={[(1.0 + DEVIATION)**2 - 1.0] * 8}")):
        found[name] = run(case, tmp_path / f"{name}.h5",
                          f"mistuning%{key.strip('[]').replace('[', '')}")["modes/open"][0]
    shift = found["stiffness"] - found["tuned"]
    assert np.abs((found["rows"] - found["tuned"]) / shift - 1.0).max() < 0.01


def test_too_many_modes_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--blade", "100000", "-q", "-o", str(tmp_path / "disk.h5")]) == 3
    assert "blade modes = 100000" in capsys.readouterr().err
    assert not (tmp_path / "disk.h5").exists()
