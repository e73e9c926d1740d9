"""Result files as arrays, and the command `fretwear`."""

from __future__ import annotations

import pickle
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from project import PROGRAM

import fretwear
from fretwear import AbsentError, InputError, OutputError
from fretwear.cli import COMMANDS, main
from fretwear.result import Result

CASE = Path(__file__).resolve().parents[2] / "example" / "jenkins" / "jenkins.nml"


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """Response of the elastic rubbing oscillator over a few points."""
    target = tmp_path_factory.mktemp("result") / "jenkins.h5"
    subprocess.run([PROGRAM, "-q", "--set", "sweep%n_points=5", "-o", target, CASE], check=True)
    return Result(target)


def test_every_array_has_the_shape_it_states(result: Result) -> None:
    n, h, pairs, observed = 5, result.n_harmonics, result.n_pairs, len(result.observed)
    assert (result.n_points, pairs, result.status) == (n, 1, "complete")
    assert result.coefficients.shape == (n, 2 * h + 1, observed)
    assert result.amplitude.shape == (n, observed)
    assert result.force.shape == (n, 2 * h + 1, pairs, 3)
    assert result.fraction.shape == (n, pairs, 3)
    assert result.dissipation.shape == (n, pairs)
    assert result.converged.dtype == bool and result.converged.all()
    assert result.iterations.shape == result.residual.shape == result.seconds.shape == (n,)
    assert "&sweep" in result.namelist and result.elapsed > 0.0


def test_what_is_read_is_what_the_file_holds(result: Result) -> None:
    with h5py.File(result.path) as file:
        for name in result:
            if name != "observed/name":
                assert np.array_equal(result[name], file[name][()], equal_nan=True)
    assert result.units("omega") == "rad/s"
    with pytest.raises(ValueError, match="read-only"):
        result.omega[0] = 1.0


def test_peaks_are_those_of_the_file(result: Result) -> None:
    peaks = result.peaks
    assert [peak.omega for peak in peaks] == result["peak/omega"].tolist()
    assert [peak.amplitude for peak in peaks] == result["peak/amplitude"].tolist()
    assert {peak.observed for peak in peaks} == set(result.observed)
    highest = max(peaks, key=lambda peak: peak.amplitude)
    assert (highest.omega, highest.amplitude) == result.maximum(highest.observed)
    assert highest.found_by in ("row", "search")
    assert highest.frequency == pytest.approx(highest.omega / (2.0 * np.pi), rel=1e-15)
    # The amplitude is that of the coefficients, static part and all harmonics included.
    tau = np.linspace(0.0, 2.0 * np.pi, 4096)
    wave = np.full_like(tau, highest.coefficients[0])
    for n in range(1, len(highest.coefficients) // 2 + 1):
        wave += highest.coefficients[2 * n - 1] * np.cos(n * tau)
        wave += highest.coefficients[2 * n] * np.sin(n * tau)
    # A grid of 4096 angles misses the top by less than (H pi/4096)**2/2.
    assert np.abs(wave).max() == pytest.approx(highest.amplitude, rel=1e-4)


def test_the_width_of_a_peak_is_its_damping() -> None:
    zeta = 0.01
    model = fretwear.Model([[1.0]], [[2.0 * zeta]], [[1.0]], cosine=[1.0])
    peak, = (one for one in fretwear.frf(model, 0.8, 1.2, 81).peaks
             if one.found_by != "end of the sweep")
    # 1/sqrt(2) of a peak is met at 2 zeta, less terms of the order of zeta**2; samples beside it.
    assert peak.damping_ratio == pytest.approx(zeta, rel=2e-2)
    point = fretwear.Model([[1.0]], [[0.1]], [[1.0]], cosine=[1.0])
    with pytest.raises(fretwear.AbsentError, match="run a sweep"):
        _ = fretwear.run(fretwear.Case(point, case={"analysis": "point"},
                                       sweep={"start": 0.5})).peaks


def test_harmonics_follow_the_convention(result: Result) -> None:
    first = result.harmonic(1)
    assert np.array_equal(first.real, result.coefficients[:, 1, 0])
    assert np.array_equal(first.imag, -result.coefficients[:, 2, 0])
    assert result.peak() == int(np.argmax(result.amplitude[:, 0]))
    with pytest.raises(InputError, match="0 to"):
        result.harmonic(result.n_harmonics + 1)


def test_wrong_names_are_answered_with_the_right_ones(result: Result) -> None:
    with pytest.raises(InputError, match="available: u1"):
        result.index("tip")
    with pytest.raises(InputError, match="/contact/force"):
        result["contact/forces"]


def test_a_result_can_be_pickled(result: Result) -> None:
    again = pickle.loads(pickle.dumps(result))
    assert np.array_equal(again.omega, result.omega)


def test_xarray_names_every_axis(result: Result) -> None:
    data = result.to_xarray()
    assert data["contact_force"].dims == ("point", "coefficient", "pair", "direction")
    assert data["omega"].attrs["units"] == "rad/s"
    assert list(data["coefficient"].values[:3]) == ["0", "c1", "s1"]
    assert data["coefficients"].sel(coefficient="s1", observed="u1").values == pytest.approx(
        result.coefficients[:, 2, 0], rel=0, abs=0)


def test_xarray_finds_the_nearest_frequency(result: Result) -> None:
    data = result.to_xarray()
    wanted = 0.5 * (result.frequency[1] + result.frequency[2]) * 1.01
    nearest = int(np.abs(result.frequency - wanted).argmin())
    for name, value in (("frequency", wanted), ("omega", 2.0 * np.pi * wanted)):
        point = data.sel({name: value}, method="nearest")
        assert float(point["omega"]) == result.omega[nearest]
        assert point["amplitude"].values == pytest.approx(result.amplitude[nearest], rel=0, abs=0)


def test_every_quantity_of_the_points_is_in_xarray(result: Result) -> None:
    """What the file declares, is there: nothing has to be listed twice."""
    data = result.to_xarray()
    declared = [name for name in result if result.declared(name).dimensions[:1] == ("point",)]
    assert {"coefficients", "contact/force", "served_by"} <= set(declared)
    for name in declared:
        found = data[name.replace("/", "_")]
        assert found.shape == result.declared(name).shape
        if name not in ("omega", "frequency"):
            assert found.attrs["long_name"] == result.declared(name).long_name


def test_a_dataset_is_what_its_file_declares(result: Result) -> None:
    force = result.declared("/contact/force")
    assert force.dimensions == ("point", "coefficient", "pair", "direction")
    assert force.shape == result.force.shape and force.name == "contact/force"
    assert force.long_name == "Fourier coefficients of the contact forces t1, t2, n"
    assert result.declared("omega").units == "rad/s"


def test_the_maximum_is_that_of_the_curve_not_of_its_points(tmp_path: Path, result: Result) -> None:
    """Between five points the peak is higher than at any of them."""
    assert result.maximum()[1] >= result.amplitude.max()
    path = result.save(tmp_path / "a.h5").path
    with h5py.File(path, "r+") as file:
        if "peak" in file:
            del file["peak"]
    point = result.peak()
    assert Result(path).maximum() == (result.omega[point], result.amplitude[point, 0])
    with h5py.File(path, "r+") as file:
        file["peak/omega"], file["peak/amplitude"] = [1.1, 1.2, 1.3], [2e3, 1e3, 9e9]
        file["peak/observed"] = [0, 0, 1]
    assert Result(path).maximum("u1") == (1.1, 2e3)


def test_a_notebook_shows_a_table(result: Result) -> None:
    page = result._repr_html_()
    assert page.startswith("<table>") and "complete" in page and "5, 5 converged" in page
    omega, height = result.maximum()
    peak = f"{height:.6g} at {omega / (2.0 * np.pi):.6g} Hz"
    assert "largest u1" in page and peak in page
    assert "<script" not in page and "data:image/png;base64," in page


def test_pictures_of_a_result(result: Result) -> None:
    """The whole run without a kind; what does not fit is refused with what does."""
    axes = result.plot().axes[-1]
    assert axes.get_xlabel() == "frequency [Hz]"
    assert len(result.plot("harmonics", point=2).axes) > 0
    with pytest.raises(AbsentError, match=r"'wear_maps' does not fit; of this result response, .*"):
        result.plot("wear_maps")


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="no such file"):
        Result(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("no HDF5")
    with pytest.raises(OutputError, match="cannot be read"):
        Result(tmp_path / "text.h5")
    with h5py.File(tmp_path / "model.h5", "w") as file:
        file.attrs["format"] = "fretwear-model"
    with pytest.raises(InputError, match="format is 'fretwear-model'"):
        Result(tmp_path / "model.h5")


def test_the_command_names_its_version_and_refuses_what_it_does_not_know(
        capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"fretwear {fretwear.__version__}\n"
    with pytest.raises(SystemExit) as ended:
        main(["plto"])
    assert ended.value.code == 2
    assert "plto" in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
def test_every_subcommand_explains_itself(command: str,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([command, "--help"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.startswith(f"usage: fretwear {command}")


def test_a_file_that_cannot_be_read_is_a_message_and_a_status(
        capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["plot", str(tmp_path / "none.h5")]) == OutputError.exit_status
    assert capsys.readouterr().err.startswith("fretwear plot: error: ")


def test_served_by_names_what_gave_the_points(coarse: Result) -> None:
    assert len(coarse.served_by) == coarse.n_points
    assert set(coarse.served_by) <= {"newton", "other guess", "pseudo-time", "smaller steps"}
    assert coarse.served_by[0] == "newton"
