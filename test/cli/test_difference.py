"""A derivative by differences finds the solution that the analytic one finds."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

# Both end below a relative residual of 1e-10 of systems of condition 1e2.
SAME = 1e-7

DRY_FRICTION = """
&case title = 'dry friction' analysis = 'frf' /
&model n_dof = 3 mass = 1 0 0  0 0 0  0 0 0 stiffness = 2 -1 0  -1 1 0  0 0 2
       damping = 0.1 0 0  0 0 0  0 0 0 /
&contact n_pairs = 1 law = '{law}' side_1 = 2 0 3 mu = 0.5 gap = -0.2 {stiffness} /
&load cosine = 1 0 0.3 static = 0 0 -1 /
&harmonics n_harmonics = 5 n_time = 256 method = '{method}' /
&sweep start = 0.7 end = 1.2 n_points = 6 /
&solver kind = '{kind}' tolerance = 1e-10 jacobian = '{jacobian}' linear = '{linear}' /
"""


def coefficients(fw_run, **words):
    """The response of the case, all points converged, and the iterations that it took."""
    elastic = "tangential_stiffness = 3 normal_stiffness = 4"
    stiffness = elastic if words["law"] == "penalty" else ""
    fw_run.write(DRY_FRICTION.format(stiffness=stiffness, **words))
    done = fw_run("-q", "case.nml")
    assert done.returncode == 0, done.stderr
    with h5py.File(fw_run.directory / "case.h5") as file:
        assert file["converged"][:].all()
        return file["coefficients"][:], int(file["iterations"][:].sum())


@pytest.mark.parametrize("method", ["hbm", "tcm"])
@pytest.mark.parametrize("law", ["dlft", "penalty"])
@pytest.mark.parametrize("kind, linear", [
    ("newton", "lu"), ("newton", "krylov"), ("powell", "auto"), ("kinsol", "auto")])
def test_same_solution(fw_run, kind, linear, law, method):
    words = {"kind": kind, "linear": linear, "law": law, "method": method}
    exact, exact_iterations = coefficients(fw_run, jacobian="analytic", **words)
    computed, iterations = coefficients(fw_run, jacobian="difference", **words)
    assert np.abs(computed - exact).max() <= SAME * np.abs(exact).max()
    # As fast in steps: the differences are the derivative.
    assert iterations <= 1.5 * exact_iterations + 5


@pytest.mark.parametrize("setting", [
    "sweep%continuation='arclength'", "solver%kind='pseudo_time'"])
def test_refused_where_the_derivative_is_taken_apart(fw_run, setting):
    message = fw_run.refused("--set", "solver%jacobian='difference'", "--set", setting, "case.nml")
    assert "solver%jacobian" in message
    assert "'analytic'" in message
