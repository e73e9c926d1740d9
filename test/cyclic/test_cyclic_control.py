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
