"""Resonances and their derivatives against closed forms and balances solved elsewhere."""
import numpy as np
import pytest
from resonance_cases import REFERENCES, slope, track

#: References are solved to 1e-10; curvatures are of another difference.
SAME = 1e-9
#: Derivatives of amplitudes, and of frequencies, which references took from second differences.
AMPLITUDE, FREQUENCY = 1e-8, 1e-5
ROWS = [(name, k) for name, case in REFERENCES.items() for k in range(len(case["rows"]))]


def run_row(folder, name, k, **options):
    case = REFERENCES[name]
    row = case["rows"][k]
    changes = {"contact": {"normal_load": [row["normal_load"]]}} if "normal_load" in row else {}
    found = track(folder, case["groups"], "load%harmonic_scale", row["load"], 1.01 * row["load"],
                  slopes=row["slopes"], changes=changes, **options)
    return row, found


@pytest.mark.parametrize(("name", "k"), ROWS)
def test_amplitude_resonance(tmp_path, name, k):
    row, found = run_row(tmp_path, name, k)
    assert found["resonance/first_harmonic"][0] == pytest.approx(row["amplitude"], rel=SAME)
    assert found["omega"][0] == pytest.approx(row["omega"], rel=SAME)
    for parameter, (amplitude, omega) in row["slopes"].items():
        size = abs(row["amplitude"])
        assert slope(found, "first_harmonic", parameter) == pytest.approx(
            amplitude, rel=AMPLITUDE, abs=AMPLITUDE * size), parameter
        assert slope(found, "resonance_omega", parameter) == pytest.approx(
            omega, rel=FREQUENCY, abs=FREQUENCY), parameter
    if "curvature" in row:
        assert found["resonance/curvature"][0] == pytest.approx(row["curvature"], rel=1e-4)
        assert found["amplitude"][0, 0] == pytest.approx(row["largest"], rel=1e-8)
        assert found["contact/dissipation"][0, 0] == pytest.approx(row["dissipation"][0], rel=1e-8)


@pytest.mark.parametrize(("name", "k"), ROWS)
def test_phase_resonance(tmp_path, name, k):
    row, found = run_row(tmp_path, name, k, condition="phase")
    assert found["omega"][0] == pytest.approx(row["phase"][0], rel=SAME)
    assert found["resonance/first_harmonic"][0] == pytest.approx(row["phase"][1], rel=SAME)
    if name == "jenkins":
        assert found["resonance/phase"][0] == pytest.approx(np.pi / 2, abs=SAME)


def test_the_best_normal_load(tmp_path):
    """The resonance is smallest where the load of the closed form is."""
    case = REFERENCES["jenkins"]
    load, best, smallest = case["best"]
    found = track(tmp_path, case["groups"], "contact%normal_load", 0.39, 0.42, n_points=31,
                  changes={"load": {"harmonic_scale": load}}, slopes=["contact%normal_load"])
    values = found["sensitivity/first_harmonic/contact_normal_load"].ravel()
    # The zero of the derivative, which the parabola of four points gives to the sixth digit.
    near = np.argsort(np.abs(values))[:4]
    zero = np.polyval(np.polyfit(values[near], found["parameter"][near], 3), 0.0)
    assert zero == pytest.approx(best, rel=2e-6)
    assert found["resonance/value"].min() == pytest.approx(smallest, rel=1e-5)
