"""Several solutions of one point: those of a balance solved elsewhere (test/reference/bodies), of a
cubic spring in one harmonic, whose amplitudes are the roots of a polynomial, and of a joint that has
one only."""
import json

import h5py
import numpy as np
import pytest
from cases import merged, run
from oracle_runs import run_case
from project import ROOT

ORACLE = json.loads((ROOT / "test/reference/bodies/v10_several.json").read_text())
#: Amplitudes of balances of residual 1e-12, near folds of condition up to 1e5.
SAME = 1e-7


def test_reference(tmp_path):
    """A stop and a rubbing pair: every solution that 130 random starts had found, once each."""
    point = ORACLE["points"][0]
    found = run_case(tmp_path, merged(ORACLE["groups"], {"sweep": {"start": point["omega"]}}))
    wanted = [np.array(solution["u"]) for solution in point["solutions"]]
    assert len(found.coefficients) == len(wanted)
    for row, force, solution in zip(found.coefficients, found.force, point["solutions"],
                                    strict=True):
        u, f = np.array(solution["u"]), np.array(solution["force"])
        assert np.abs(row - u).max() < ORACLE["tolerance"] * np.abs(u).max()
        assert np.abs(force - f).max() < ORACLE["tolerance"] * np.abs(f).max()
    assert np.all(np.diff(found.amplitude[:, 0]) > 0.0)


def duffing(omega, gamma, force, damping=0.04, **solver):
    return {
        "case": {"analysis": "point"},
        "model": {"n_dof": 1, "mass": 1.0, "damping": damping, "stiffness": 1.0},
        "spring": {"n_springs": 1, "side_1": 1, "coefficient": gamma, "power": 3},
        "load": {"cosine": force}, "harmonics": {"n_harmonics": 1, "parity": "odd"},
        "sweep": {"start": omega}, "solver": {"tolerance": 1e-12, "n_solutions": 10} | solver}


def amplitudes(omega, gamma, force, damping=0.04):
    """Of one harmonic: ((1 - w^2 + 3/4 gamma a^2)^2 + (c w)^2) a^2 = F^2, a cubic in a^2."""
    linear = 1.0 - omega**2
    roots = np.roots([9.0 / 16.0 * gamma**2, 1.5 * linear * gamma,
                      linear**2 + (damping * omega)**2, -force**2])
    return np.sort(np.sqrt(roots[(abs(roots.imag) < 1e-12) & (roots.real > 0.0)].real))


@pytest.mark.parametrize("seed", range(6))
def test_cubic_spring(seed, tmp_path):
    """One or three solutions, in front of, within and behind the range of folds."""
    random = np.random.default_rng(seed)
    for number in range(4):
        gamma, force = random.uniform(0.2, 2.0), random.uniform(0.05, 0.4)
        omega = random.uniform(0.8, 2.2)
        wanted = amplitudes(omega, gamma, force)
        folder = tmp_path / str(number)
        folder.mkdir()
        found = run_case(folder, duffing(omega, gamma, force))
        assert len(found.amplitude) == len(wanted)
        assert np.abs(found.amplitude[:, 0] - wanted).max() < SAME * wanted.max()


@pytest.mark.parametrize("solver", [
    {"deflation_power": 1.0}, {"deflation_power": 4.0}, {"deflation_shift": 0.1},
    {"deflation_shift": 10.0}, {"linear": "krylov"}, {"skips": False}])
def test_power_and_shift(solver, tmp_path):
    """How solutions repel is no part of what is found."""
    found = run_case(tmp_path, duffing(1.5, 1.0, 0.2, **solver))
    wanted = amplitudes(1.5, 1.0, 0.2)
    assert len(wanted) == 3
    assert np.abs(found.amplitude[:, 0] - wanted).max() < SAME * wanted.max()


def test_as_many_as_asked_for(tmp_path):
    """n_solutions ends the search; one row is that of a point as ever, to the bit."""
    for n in (1, 2):
        folder = tmp_path / str(n)
        folder.mkdir()
        found = run_case(folder, duffing(1.5, 1.0, 0.2, n_solutions=n))
        assert len(found.amplitude) == n
    plain = duffing(1.5, 1.0, 0.2)
    plain["solver"] = {"tolerance": 1e-12}
    (tmp_path / "plain").mkdir()
    alone = run_case(tmp_path / "plain", plain)
    one = run_case(tmp_path / "1", duffing(1.5, 1.0, 0.2, n_solutions=1))
    assert np.array_equal(alone.coefficients, one.coefficients)


def test_summary_and_linear_case(tmp_path):
    """What has no unknowns has one solution; the summary says that no search proves anything."""
    text = run(tmp_path, duffing(1.5, 1.0, 0.2), quiet=False).stdout
    (line,) = [line for line in text.splitlines() if line.split()[:1] == ["solutions"]]
    assert "3 found" in line and "there may be others" in line
    linear = duffing(1.5, 1.0, 0.2)
    del linear["spring"]
    assert len(run_case(tmp_path, linear).amplitude) == 1


def test_everything_of_a_row(tmp_path):
    """Stability and derivatives of each: the middle solution is the unstable one, and the amplitude
    by the cubic coefficient from the polynomial."""
    groups = duffing(1.5, 1.0, 0.2)
    groups["sweep"]["stability"] = True
    groups["sensitivity"] = {"parameters": ["spring%coefficient"]}
    found = run_case(tmp_path, groups)
    with h5py.File(tmp_path / "case.h5") as file:
        stable = file["floquet/stable"][()].ravel()
        slope = np.ravel(file["sensitivity/first_harmonic/spring_coefficient"][()])
    assert stable.tolist() == [1, 0, 1]
    step = 1e-6
    difference = amplitudes(1.5, 1.0 + step, 0.2) - amplitudes(1.5, 1.0 - step, 0.2)
    assert np.abs(slope - difference / (2 * step)).max() < 1e-5 * np.abs(slope).max()
    assert len(found.amplitude) == 3


def test_waves_hold_several(tmp_path):
    """A sector with the cubic spring and its neighbours tied by nothing: the same three."""
    groups = merged(duffing(1.5, 1.0, 0.2), {"cyclic": {"n_sectors": 5, "engine_order": 2}})
    found = run_case(tmp_path, groups)
    wanted = amplitudes(1.5, 1.0, 0.2)
    assert np.abs(found.amplitude[:, 0] - wanted).max() < SAME * wanted.max()


@pytest.mark.parametrize(("changes", "wanted"), [
    ({"case": {"analysis": "frf"}, "sweep": {"end": 2.0, "n_points": 3}}, "analysis"),
    ({"case": {"analysis": "time"}}, "analysis"),
    ({"solver": {"kind": "powell"}}, "solver%kind"),
    ({"harmonics": {"accuracy": 1e-2, "n_harmonics": 9}}, "accuracy"),
    ({"control": {"amplitude": 0.3}}, "control"),
    ({"solver": {"n_solutions": 0}}, "n_solutions"),
    ({"solver": {"n_solutions": 1001}}, "n_solutions"),
    ({"solver": {"deflation_power": 0.5}}, "deflation_power"),
    ({"solver": {"deflation_shift": -1.0}}, "deflation_shift"),
])
def test_refusals(changes, wanted, tmp_path):
    message = run(tmp_path, merged(duffing(1.5, 1.0, 0.2), changes), status=3).stderr
    assert wanted in message
