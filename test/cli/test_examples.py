"""Every example runs and gives the number that its README promises."""
from __future__ import annotations

import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from limits import limit
from project import EXAMPLE, PATIENT, PROGRAM

# Namelist: (dataset, rows, column, number, relative tolerance). `rows` is a frequency [rad/s], or
# None for the largest value of the sweep. Numbers of oscillators are exact solutions (see the
# READMEs), tolerances what the harmonics or instants of the example leave; those of the sector are
# the program's own, to the digits that other processors and thread counts reproduce.
NUMBERS = {
    "duffing/duffing.nml": [("amplitude", 1.43, 0, 1.719445704, 5e-7)],
    # Closed by shooting (test/reference/response_control.json).
    "duffing/controlled.nml": [("load/scale", 1.3, Ellipsis, 0.3181727151193959, 1e-7)],
    "coulomb/coulomb.nml": [("amplitude", 0.9, 0, 4.127829467, 1e-2),
                            ("amplitude", 0.9, 0, 4.0902, 2e-5)],
    "jenkins/jenkins.nml": [("amplitude", 1.0, 0, 9.468233129, 1e-6),
                            ("contact/dissipation", 1.0, 0, 17.936466258, 5e-6),
                            ("amplitude", None, 0, 9.784333, 1e-6)],
    # Met by differences of runs to 1e-7 (test/oracles/test_sensitivities.py).
    "sensitivity/sensitivity.nml": [
        ("sensitivity/first_harmonic/contact_mu", 1.0, 0, -15.05893873, 1e-6),
        ("sensitivity/deviation/largest", 1.0, 0, 2.358389, 1e-6)],
    # Between the rows: the search ends within 1e-4 of the height.
    "damper/damper.nml": [("peak/amplitude", None, Ellipsis, 1.205723, 1e-4)],
    # A march of cycles on the same cells has 4.9419e-3 (test/fretting); the steps follow from an
    # estimate of their error.
    "cylinder_on_flat/gross_slip.nml": [("wear/depth", None, 29, 4.95118e-3, 1e-4)],
    # The cell that wears most by the linear problem of the steady state (test/fretting).
    "cylinder_on_flat/partial_slip.nml": [("wear/depth", None, 17, 2.55254e-5, 1e-4)],
    "oval_casing/casing.nml": [("peak/amplitude", None, Ellipsis, 3.373859, 1e-4)],
    "calibration/mode.nml": [("mode/damping_ratio", None, Ellipsis, 0.132967588, 1e-8)],
    "gap/gap.nml": [("amplitude", 1.15, 0, 1.332770444, 5e-6)],
    # Integrated in time to 1e-6 of the motion (test/oracles/test_parallel_pairs.py).
    "parallel_pairs/play.nml": [("amplitude", 1.2, 0, 0.79675388, 2e-6)],
    "parallel_pairs/table.nml": [("amplitude", 1.0, 0, 0.57481404, 2e-6)],
    "parallel_pairs/sliders.nml": [("amplitude", 0.8, 0, 2.8162158, 2e-6)],
    "separation/separation.nml": [("amplitude", 0.9, 0, 2.240312606, 5e-6),
                                  ("contact/dissipation", 0.9, 0, 2.830244154, 2e-5)],
    "bladed_disk/disk.nml": [("amplitude", 2.1885, 5, 0.3722907832442835, 1e-7),
                             ("contact/dissipation", 2.1885, 0, 0.09091664838734204, 1e-6)],
    "shrouded_disk/wave.nml": [("amplitude", 2.0 * np.pi * 1265.0, 0, 0.01984673467, 1e-7)],
    # Depth after 13 steps whose sizes follow from an estimate of their error.
    "shrouded_disk/wear.nml": [("wear/depth", None, 3, 1.01846995e-3, 1e-5)],
    "shrouded_disk/mistuned.nml": [
        ("amplitude", 2.0 * np.pi * 1272.0, 22, 0.02293812546, 1e-5)],
    "nonlinear_mode/mode.nml": [("mode/damping_ratio", None, Ellipsis, 0.1202550647, 1e-8)],
    # The smallest lies between two rows (test/resonance); the ends of the closed form.
    "damper_optimum/optimum.nml": [("resonance/value", None, Ellipsis, 4.737726248968549, 1e-7)],
    "wear/two_pairs.nml": [("wear/depth", None, 0, 0.2, 1e-5),
                           ("wear/depth", None, 1, 0.0, 0.0)],
    "wear/oscillator.nml": [("wear/depth", None, 0, 0.294758, 2e-6),
                            ("omega", None, Ellipsis, 0.996488, 1e-6)],
    # Depth after fifty flights in their order.
    "wear/mission.nml": [("wear/depth", None, 0, 0.1622059, 1e-3)],
    "blade_sector/frf.nml": [("amplitude", None, 0, 0.8830621, 1e-6)],
    "blade_sector/frf_stuck.nml": [("amplitude", None, 0, 1.6722078, 1e-6)],
    # Where pairs begin to slip jumps between 128 instants, which roughens the branch: which of its
    # corners is the highest may turn with round-off.
    "blade_sector/frf_2000rpm.nml": [("peak/amplitude", None, Ellipsis, 0.381145, 1e-3)],
    "blade_sector/frf_48.nml": [("amplitude", None, 0, 0.9286232, 1e-6)],
    # The number of tolerance = 1e-12; damping is a thousandth of the forces that balance to 1e-8.
    "blade_sector/mode.nml": [("mode/damping_ratio", None, Ellipsis, 9.48072086e-4, 1e-5)],
}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Result file of a namelist, computed once."""
    folder, done = tmp_path_factory.mktemp("examples"), {}

    def run(name):
        if name not in done:
            path = folder / (Path(name).stem + ".h5")
            process = subprocess.run(
                [PROGRAM, "-q", "-o", str(path), str(EXAMPLE / name)],
                capture_output=True, text=True, check=False, timeout=limit(120), env=PATIENT)
            assert process.returncode == 0, process.stderr
            done[name] = path
        return done[name]

    return run


#: Run by test/oracles/test_user_laws.py, which builds the library that the case names.
BUILT_BEFORE = {"user_laws/cubic.nml"}


def test_every_example_is_listed():
    found = {str(path.relative_to(EXAMPLE)) for path in EXAMPLE.rglob("*.nml")}
    assert found == set(NUMBERS) | BUILT_BEFORE
    assert all((EXAMPLE / name).with_name("README.md").exists() for name in found)


@pytest.mark.parametrize("name", NUMBERS)
def test_number(results, name):
    with h5py.File(results(name), "r") as file:
        assert file["converged"][()].all()
        omega = file["omega"][()]
        for dataset, at, column, number, tolerance in NUMBERS[name]:
            values = file[dataset][()] if column is Ellipsis else file[dataset][:, column]
            k = np.argmax(values) if at is None else np.argmin(np.abs(omega - at))
            assert at is None or omega[k] == pytest.approx(at, rel=1e-12)
            assert values[k] == pytest.approx(number, rel=tolerance)


@pytest.mark.parametrize("name", ["blade_sector/frf.nml", "blade_sector/frf_2000rpm.nml",
                                  "duffing/duffing.nml"])
def test_the_peak_is_no_lower_than_any_row(results, name):
    """On a branch corners, where pairs begin to slip, stand above what is solved for."""
    with h5py.File(results(name), "r") as file:
        assert file["peak/amplitude"][()].max() >= file["amplitude"][:, 0].max()


def test_gap_is_closed_for_the_share_of_the_exact_orbit(results):
    with h5py.File(results("gap/gap.nml"), "r") as file:
        # Two switches, each off by at most one of 1024 instants.
        assert file["contact/fraction"][-1, 0, 0] == pytest.approx(0.2226257, abs=2.0 / 1024)


def test_friction_lowers_the_peak_of_the_sector(results):
    """Half of the pairs slip, friction takes energy, and the peak comes earlier and lower."""
    with h5py.File(results("blade_sector/frf.nml"), "r") as friction, \
            h5py.File(results("blade_sector/frf_stuck.nml"), "r") as stuck:
        at, linear = (int(np.argmax(file["amplitude"][:, 0])) for file in (friction, stuck))
        assert friction["omega"][at] < stuck["omega"][linear]
        assert friction["amplitude"][at, 0] < 0.6 * stuck["amplitude"][linear, 0]
        assert np.count_nonzero(friction["contact/fraction"][at, :, 1]) == 8
        assert friction["contact/dissipation"][at].sum() > 0.0
        assert np.all(stuck["contact/fraction"][:, :, 0] == 1.0)
        assert np.abs(stuck["contact/dissipation"][()]).max() == 0.0


def test_result_file_of_the_sector_with_48_pairs(results):
    """Shapes and attributes of the contract."""
    n_points, n_coefficients, n_observed, n_pairs = 41, 15, 4, 48
    shapes = {
        "omega": (), "converged": (), "iterations": (), "residual": (), "seconds": (),
        "coefficients": (n_coefficients, n_observed), "amplitude": (n_observed,),
        "contact/force": (n_coefficients, n_pairs, 3), "contact/fraction": (n_pairs, 3),
        "contact/dissipation": (n_pairs,)}
    with h5py.File(results("blade_sector/frf_48.nml"), "r") as file:
        def text(name):
            value = file.attrs[name]
            return value.decode() if isinstance(value, bytes) else str(value)

        for name, shape in shapes.items():
            assert file[name].shape == (n_points, *shape), name
            assert np.all(np.isfinite(file[name][()])), name
        assert text("format") == "fretwear-result"
        assert file.attrs["format_version"] == 1
        assert text("status") == "complete"
        assert text("fretwear_version")
        assert "n_harmonics" in text("namelist")
        assert file.attrs["elapsed"] > 0.0
        names = [name.decode() for name in file["observed/name"][()]]
        assert names == ["tip", "tip_x", "tip_y", "tip_z"]
        assert file["converged"][()].all()
        assert file["omega"][[0, -1]] == pytest.approx(2.0 * np.pi * np.array([1013.0, 1025.0]))
        # Every pair is in some state at every instant.
        assert file["contact/fraction"][()].sum(axis=2) == pytest.approx(1.0, abs=1e-12)
