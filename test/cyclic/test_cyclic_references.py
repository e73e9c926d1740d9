"""Sectors against reference solutions of whole annuli: frequencies of every nodal diameter, and the
response of sector 0."""
import numpy as np
import pytest
from cyclic_cases import difference, read_reference, run_at

NAMES = ["v1", "v2", "v3", "v4", "v5", "v7"]
#: References were solved to residuals of 1e-12 and below; resonances amplify that.
RESPONSE = 1e-8
FREQUENCY = 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_natural_frequencies(tmp_path, name):
    case = read_reference(name)
    found = run_at(tmp_path, case, [], analysis="modes",
                   others={"cyclic": {"n_modes": 20}})
    assert list(found["modes/nodal_diameter"]) == list(range(case["n_sectors"] // 2 + 1))
    for k, linear in enumerate(case["linear"]):
        assert linear["nodal_diameter"] == k
        for state in ("open", "closed"):
            if state not in linear:
                continue
            frequencies = found[f"modes/{state}"][k]
            frequencies = frequencies[np.isfinite(frequencies)]
            assert np.allclose(frequencies, linear[state], rtol=FREQUENCY, atol=0.0), (k, state)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("sampling", ["uniform", "events"])
def test_response(tmp_path, name, sampling):
    case = read_reference(name)
    points = [point for point in case["points"] if sampling in point]
    if not points:
        pytest.skip("the reference has none")
    n_time = points[0][sampling].get("n_time", 0)
    found = run_at(tmp_path, case, [point["omega"] for point in points], sampling=sampling,
                   n_time=n_time)
    assert found["converged"].all()
    order = range(case["n_harmonics"] + 1)
    n, eo = case["n_sectors"], case["engine_order"]
    signed = [k if 2 * k <= n else k - n for k in (h * eo % n for h in order)]
    assert list(found["cyclic/nodal_diameter"]) == signed
    for i, point in enumerate(points):
        expected = point[sampling]
        assert difference(found["coefficients"][i], expected["u"]) < RESPONSE
        assert difference(found["contact/force"][i], expected["force"]) < RESPONSE
        assert np.allclose(found["contact/fraction"][i], expected["fraction"], atol=1e-6)
        assert difference(found["contact/dissipation"][i], expected["dissipation"]) < 1e-7
