"""`fretwear compare`: numbers, exit status and picture of two runs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from program import run

from fretwear.cli import main
from fretwear.compare import compare, plot_comparison
from fretwear.result import Result


@pytest.fixture(scope="module")
def rough(coarse_case: Path) -> Result:
    """The coarse sector with one harmonic."""
    return run(coarse_case, coarse_case.with_name("rough.h5"), "harmonics%n_harmonics=1")


def _copy(result: Result, path: Path) -> Path:
    path.write_bytes(result.path.read_bytes())
    return path


def test_a_result_equals_itself(coarse: Result, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(coarse.path), str(coarse.path)]) == 0
    assert "the same within 1e-06" in capsys.readouterr().out


def test_a_reader_that_has_seen_enough_is_no_error(coarse: Result) -> None:
    """As in `fretwear compare a.h5 b.h5 | head -1`: nobody reads when the lines come."""
    command = [sys.executable, "-m", "fretwear", "compare", coarse.path, coarse.path]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == ""
        assert process.wait() == 141


def test_every_difference_is_its_number(coarse: Result, rough: Result) -> None:
    found = {item.name: item for item in compare(coarse, rough).differences}
    error = np.abs(coarse.amplitude - rough.amplitude).max()
    assert error > 0.0
    assert found["amplitude"].error == pytest.approx(error)
    assert found["amplitude"].size == max(coarse.amplitude.max(), rough.amplitude.max())
    padded = np.zeros_like(coarse.coefficients)
    padded[:, :3] = rough.coefficients
    assert found["coefficients"].error == np.abs(coarse.coefficients - padded).max()
    assert found["coefficients"].remark == "harmonics up to 3 and 1"
    assert found["omega"].error == 0.0
    assert set(found) == set(coarse) | set(rough)


def test_the_input_that_differs(coarse: Result, rough: Result) -> None:
    lines = compare(coarse, rough).namelist
    assert "- harmonics%n_harmonics = 3" in lines and "+ harmonics%n_harmonics = 1" in lines
    assert not any("output%file" in line for line in lines)


def test_exit_status(coarse: Result, rough: Result, tmp_path: Path,
                     capsys: pytest.CaptureFixture[str]) -> None:
    other = _copy(coarse, tmp_path / "other.h5")
    with h5py.File(other, "r+") as file:
        file["amplitude"][3, 0] *= 1.0 + 1e-5
        file["seconds"][...] = 9.0
    relative = 1e-5 * coarse.amplitude[3, 0] / coarse.amplitude.max()
    for tolerance, status in ((0.9 * relative, 1), (1.1 * relative, 0)):
        assert main(["compare", str(coarse.path), str(other), "-q", "--tolerance",
                     str(tolerance)]) == status
    assert capsys.readouterr().out == ""
    assert main(["compare", str(coarse.path), str(rough.path)]) == 1
    assert "! amplitude" in capsys.readouterr().out
    assert main(["compare", str(coarse.path), str(tmp_path / "none.h5")]) == 5
    assert main(["compare", str(coarse.path), str(coarse.path.with_name("model.h5"))]) == 3


def test_what_only_one_has(coarse: Result, sampled: Result, tmp_path: Path) -> None:
    found = compare(coarse, sampled)
    assert not found.equal(1.0)
    assert "history/force" in found.text(1.0) and f"only in {sampled.path}" in found.text(1.0)
    other = _copy(coarse, tmp_path / "nan.h5")
    with h5py.File(other, "r+") as file:
        file["amplitude"][0, 0] = np.nan
    assert not compare(coarse, other).equal(1e6)


def test_sweeps_of_other_frequencies_are_interpolated(coarse: Result, tmp_path: Path) -> None:
    """Every other point: at these the curves are the same."""
    other = _copy(coarse, tmp_path / "half.h5")
    with h5py.File(other, "r+") as file:
        for name in coarse:
            if name.startswith("peak/"):
                continue  # Rows of peaks are no points.
            if name not in ("observed/name", "contact/position", "contact/area", "contact/patch"):
                kept = file[name][::2]
                del file[name]
                file[name] = kept
    found = {item.name: item for item in compare(other, coarse).differences}
    assert found["amplitude"].remark == "interpolated to 20 common frequencies"
    assert found["amplitude"].error == 0.0


def test_pictures(coarse: Result, rough: Result, worn: Result) -> None:
    upper, lower = plot_comparison(coarse, rough).axes
    assert [line.get_label() for line in upper.lines] == ["coarse.h5", "rough.h5"]
    for line, result in zip(upper.lines, (coarse, rough), strict=True):
        assert np.array_equal(line.get_ydata(), result.amplitude[:, 0])
    assert lower.lines[0].get_ydata() == pytest.approx(
        rough.amplitude[:, 0] - coarse.amplitude[:, 0], abs=1e-15)
    assert lower.get_ylabel() == "difference [µm]"
    upper, lower = plot_comparison(worn, worn).axes
    assert [bar.get_height() for bar in upper.patches] == [*worn.depth[-1]] * 2
    assert [bar.get_height() for bar in lower.patches] == [0.0] * 8


def test_single_points(examples: Path, tmp_path: Path) -> None:
    case = examples.parent / "coulomb" / "coulomb.nml"
    one = run(case, tmp_path / "one.h5")
    two = run(case, tmp_path / "two.h5", "load%harmonic_scale=1.1")
    upper, lower = plot_comparison(one, two).axes
    first, second = (np.asarray(line.get_ydata()) for line in upper.lines)
    assert np.abs(first).max() == pytest.approx(one.amplitude[0, 0], rel=1e-3)
    assert np.array_equal(lower.lines[0].get_ydata(), second - first)
