"""Nonlinear modes against exact orbits, closed forms, and harmonic balances solved elsewhere."""
import numpy as np
import pytest
from cases import merged
from mode_cases import REFERENCES, at_amplitude, follow

#: Balances with as many harmonics: their references are solved to 1e-10.
SAME_HARMONICS = 1e-9
#: Linear modes and closed forms are known to round-off; tolerance of the residual times the
#: condition of the bordered matrix.
EXACT = 1e-10
#: What 15 harmonics leave out of the exact orbit: frequency, and damping relative to itself.
TRUNCATION_15 = (1e-6, 1.3e-5)
#: Harmonics of exact orbits and what they leave out.
TRUNCATION = {"duffing": (9, 1e-10), "gap_1": (31, 3e-8), "gap_2": (31, 3e-8), "gap_3": (31, 3e-8),
              "gap_4": (31, 3e-8)}


def errors(tmp_path, name, rows, n_harmonics, **options):
    """Largest relative errors of frequency and damping ratio."""
    groups = REFERENCES[name]["groups"]
    found = np.array([at_amplitude(tmp_path, groups, row[0], n_harmonics, **options)
                      for row in rows])
    return np.max(np.abs(found / np.array(rows)[:, 1:] - 1.0), axis=0)


@pytest.mark.parametrize(("name", "n_harmonics"), [
    (name, int(h)) for name in ("jenkins", "rigid_twin", "chain", "normal", "preload")
    for h in REFERENCES[name]["harmonics"]])
def test_same_harmonics(tmp_path, name, n_harmonics):
    rows = REFERENCES[name]["harmonics"][str(n_harmonics)]
    tolerance = SAME_HARMONICS if name != "preload" else EXACT
    assert np.all(errors(tmp_path, name, rows, n_harmonics) < tolerance)


def test_exact_friction(tmp_path):
    assert np.all(errors(tmp_path, "jenkins", REFERENCES["jenkins"]["exact"], 15) < TRUNCATION_15)


@pytest.mark.parametrize("name", TRUNCATION)
def test_exact_conservative(tmp_path, name):
    n_harmonics, tolerance = TRUNCATION[name]
    assert np.all(errors(tmp_path, name, REFERENCES[name]["exact"], n_harmonics) < tolerance)


def test_rigid_friction_on_mass(tmp_path):
    """No mode starts from a stuck mass: the curve begins where it slides. Law 'rigid' loses its
    errors with the third power of H."""
    worst = [errors(tmp_path, "coulomb", REFERENCES["coulomb"]["exact"], h).max()
             for h in (7, 15, 31)]
    assert worst[0] < 5e-3
    assert worst[1] < worst[0] / 6
    assert worst[2] < worst[1] / 6


def test_a_law_that_is_not_named_is_of_high_order(tmp_path):
    groups = REFERENCES["coulomb"]["groups"]
    unnamed = merged(groups, {"contact": {"law": None}})
    assert at_amplitude(tmp_path, unnamed, 1.0, 7) == at_amplitude(tmp_path, groups, 1.0, 7)


@pytest.mark.parametrize("control", ["modal", "observed"])
def test_shakedown(tmp_path, control):
    """The pair slips on the way to the cycle and not within it: frequency and damping stay, the
    position at rest moves with the amplitude."""
    case = REFERENCES["preload"]
    for row, static in zip(case["harmonics"]["1"], case["static"], strict=True):
        found = follow(tmp_path, case["groups"], row[0], 1.001 * row[0], 1, control=control)
        assert found["omega"][0] == pytest.approx(row[1], rel=EXACT)
        assert found["mode/damping_ratio"][0] == pytest.approx(row[2], rel=EXACT)
        assert found["coefficients"][0, 0, 0] == pytest.approx(static, rel=1e-8)


def test_shakedown_is_no_onset(tmp_path):
    case = REFERENCES["preload"]
    found = follow(tmp_path, case["groups"], 0.1, 2.0, 3, n_points=10)
    assert found["attributes of mode"]["onset_amplitude"] == pytest.approx(
        case["onset"]["first"], rel=1e-9)


@pytest.mark.parametrize("continuation", ["natural", "arclength"])
@pytest.mark.parametrize("n_harmonics", [3, 7, 15])
def test_limit_cycles(tmp_path, n_harmonics, continuation):
    case = REFERENCES["limit_cycle"]
    found = follow(tmp_path, case["groups"], 0.1, 5.0, n_harmonics, n_points=30,
                   continuation=continuation)
    cycles = np.stack([found["mode/limit_cycle/amplitude"], found["mode/limit_cycle/omega"]], 1)
    assert cycles == pytest.approx(np.array(case["harmonics"][str(n_harmonics)]), rel=1e-9)
    assert list(found["mode/limit_cycle/stable"]) == [1, 0]
    if n_harmonics == 15:
        assert cycles == pytest.approx(np.array(case["exact"])[:, :2].astype(float), rel=2e-5)
