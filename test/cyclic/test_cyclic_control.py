"""Sectors at given amplitudes and over a load: what runs at the loads that were found give."""
import numpy as np
import pytest
from cases import read, run
from cyclic_cases import TIGHT, model_groups, read_reference, run_at

#: Residuals of 1e-12, and the condition of the bordered matrix.
SAME = 1e-8


@pytest.mark.parametrize("name", ["v1", "v2", "v3", "v4"])
@pytest.mark.parametrize("linear", ["lu", "krylov"])
def test_the_amplitude_of_a_run_returns_its_load(tmp_path, name, linear):
    case = read_reference(name)
    omega = [case["points"][0]["omega"]]
    given = run_at(tmp_path, case, omega)
    a = np.hypot(given["coefficients"][0, 1, 0], given["coefficients"][0, 2, 0])
    found = run_at(tmp_path, case, omega, solver={"linear": linear},
                   others={"control": {"amplitude": [float(a)]}})
    assert found["load/scale"][0] == pytest.approx(1.0, rel=SAME)
    size = np.abs(given["coefficients"]).max()
    assert np.abs(found["coefficients"] - given["coefficients"]).max() < SAME * size


def test_loads_one_by_one(tmp_path):
    case = read_reference("v1")
    omega = case["points"][0]["omega"]
    run(tmp_path, model_groups(case) | {
        "case": {"analysis": "frf"}, "harmonics": {"n_harmonics": 7, "sampling": "events"},
        "solver": {"tolerance": TIGHT},
        "sweep": {"parameter": "load%harmonic_scale", "frequency": omega,
                  "values": [0.5, 1.0, 1.5]}})
    swept = read(tmp_path / "case.h5")
    for scale, row in zip([0.5, 1.0, 1.5], swept["coefficients"]):
        load = run_at(tmp_path, case, [omega], n_harmonics=7,
                      others={"load": {"harmonic_scale": scale}})
        assert np.abs(row - load["coefficients"][0]).max() < SAME * np.abs(row).max()


@pytest.mark.parametrize(("name", "place"), [("v1", 0), ("v3", 4)])
def test_a_branch_of_given_amplitudes(tmp_path, name, place):
    """Points of the branch are natural ones, and runs under the loads that were found."""
    case = read_reference(name)
    omega = case["points"][0]["omega"]
    given = run_at(tmp_path, case, [omega])
    a = float(np.hypot(given["coefficients"][0, 1, place], given["coefficients"][0, 2, place]))
    groups = model_groups(case) | {
        "case": {"analysis": "frf"}, "solver": {"tolerance": TIGHT},
        "harmonics": {"n_harmonics": 5, "sampling": "events"},
        "control": {"amplitude": [0.5 * a, a], "observed": place + 1}}
    run(tmp_path, groups | {"sweep": {"start": 0.95 * omega, "end": 1.05 * omega, "n_points": 7,
                                      "continuation": "arclength"}})
    branch = read(tmp_path / "case.h5")
    assert branch["converged"].all()
    size = np.abs(branch["coefficients"]).max()
    for amplitude in (0.5 * a, a):
        own = branch["control/amplitude"] == amplitude
        assert branch["omega"][own][[0, -1]] == pytest.approx([0.95 * omega, 1.05 * omega])
        groups["control"]["amplitude"] = [amplitude]
        run(tmp_path, groups | {"sweep": {"values": branch["omega"][own].tolist()}})
        natural = read(tmp_path / "case.h5")
        assert natural["load/scale"] == pytest.approx(branch["load/scale"][own], rel=SAME)
        assert np.abs(natural["coefficients"] - branch["coefficients"][own]).max() < SAME * size
    k = int(branch["load/scale"].argmin())
    alone = run_at(tmp_path, case, [float(branch["omega"][k])], n_harmonics=5,
                   others={"load": {"harmonic_scale": float(branch["load/scale"][k])}})
    assert np.abs(alone["coefficients"][0] - branch["coefficients"][k]).max() < SAME * size
