"""Dampers, polynomials and laws of a user in the integration in time, against periodic orbits that
SciPy finds by shooting."""
import shutil
import subprocess

import numpy as np
import pytest
from cases import merged, read, run
from project import ROOT
from scipy.integrate import solve_ivp
from test_element_stability import CASE, ELEMENTS, MASS, OMEGA, STIFFNESS, force

import fretwear as fw

#: Of the largest coefficient: both integrate to 1e-11 and repeat to 1e-8 or better, which weak
#: damping (1 % of a period) makes a hundred times as much.
WITHIN = 1e-6
HARMONICS = 7
LAWS = r"""
#include <math.h>
#include "fretwear.h"
const int fw_law_interface = 1;
int drag(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   for (int k = 0; k < call->n_time; k++) {
      force[k] = 0.4 * fabs(call->v[k]) * call->v[k];
      if (call->wants_derivative) dv[k] = 0.8 * fabs(call->v[k]);
   }
   return 0;
}
/* Of time and frequency: the load once more. */
int pushing(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   for (int k = 0; k < call->n_time; k++) force[k] = -0.2 * call->omega * sin(call->tau[k]);
   return 0;
}
int bound(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   for (int k = 0; k < call->n_time; k++) {
      if (call->n_time == 1 && call->tau[k] > 3.0) return call->parameters[0];
      force[k] = 0.1 * call->u[k];
      if (call->wants_derivative) du[k] = 0.1;
   }
   return 0;
}
const int kept_states = 1;
int kept(void *user, const fw_law_call *call, const double *state, double *state_after,
         double *force, double *dstate, double *dforce) { return 0; }
"""


def user(folder, symbol, **more):
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no compiler for C")
    (folder / "laws.c").write_text(LAWS)
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-I", str(ROOT / "include"), "-o",
                    "laws.so", "laws.c", "-lm"], cwd=folder, check=True, timeout=60)
    return {"user": {"n_elements": 1, "library": "laws.so", "symbol": symbol, "side_1": 1, **more}}


def in_time(folder, elements, **more):
    case = merged(CASE, elements)
    case["case"] = {"analysis": "time"}
    case["sweep"] = {"start": OMEGA}
    case["harmonics"] = {"n_harmonics": HARMONICS}
    return run(folder, merged(case, {"time": {"steps_per_period": 256, "n_periods": 400}}), **more)


def orbit(start, extra):
    """Coefficients (2H+1, 2) of the periodic solution that Newton's method comes to from others."""
    def rate(t, x):
        load = np.array([0.8, 0.3]) * np.cos(OMEGA * t)
        a = load - STIFFNESS @ x[:2] - 0.03 * STIFFNESS @ x[2:] - extra(t, x[:2], x[2:])
        return np.concatenate([x[2:], np.linalg.solve(MASS, a)])

    def period(x, **more):
        return solve_ivp(rate, (0.0, 2.0 * np.pi / OMEGA), x, method="DOP853", rtol=1e-11,
                         atol=1e-12, **more)

    order = np.arange(1, HARMONICS + 1)[:, None]
    x = np.concatenate([start[0] + start[1::2].sum(axis=0),
                        (OMEGA * order * start[2::2]).sum(axis=0)])
    for _ in range(4):
        end, step = period(x).y[:, -1], 1e-6
        slope = np.stack([(period(x + step * e).y[:, -1] - end) / step for e in np.eye(4)], axis=1)
        x = x - np.linalg.solve(slope - np.eye(4), end - x)
    n = 256
    t = 2.0 * np.pi / OMEGA * np.arange(n) / n
    u = period(x, t_eval=t).y[:2]
    waves = np.fft.rfft(u, axis=1).T / n
    found = [waves[0].real]
    for h in range(1, HARMONICS + 1):
        found += [2.0 * waves[h].real, -2.0 * waves[h].imag]
    return np.array(found)


def same(folder, extra):
    found = read(folder / "case.h5")
    assert found["converged"][0]
    is_near(found["coefficients"][0], extra)


def is_near(found, extra):
    wanted = orbit(found, extra)
    assert np.abs(found - wanted).max() < WITHIN * np.abs(wanted).max()


@pytest.mark.parametrize("name", ELEMENTS)
def test_elements_in_time(tmp_path, name):
    in_time(tmp_path, ELEMENTS[name])
    same(tmp_path, lambda t, u, v: force(name, u, v))


@pytest.mark.parametrize("derivative", ["given", "difference"])
def test_a_law_of_a_user_in_time(tmp_path, derivative):
    in_time(tmp_path, user(tmp_path, "drag", side_2=2, derivative=derivative))
    same(tmp_path, lambda t, u, v: force("drag", u, v))


def test_a_law_of_time_and_frequency(tmp_path):
    in_time(tmp_path, user(tmp_path, "pushing"))
    same(tmp_path, lambda t, u, v: np.array([-0.2 * OMEGA * np.sin(OMEGA * t), 0.0]))


def test_a_law_in_python_in_time(tmp_path):
    law = fw.Law(lambda u, v, t, omega: 0.4 * np.abs(v) * v, 1, 2)
    model = fw.Model(MASS, 0.03 * STIFFNESS, STIFFNESS, cosine=[0.8, 0.3], laws=[law])
    found = fw.run(fw.Case(model, case={"analysis": "time"}, sweep={"start": OMEGA},
                           harmonics={"n_harmonics": HARMONICS},
                           time={"steps_per_period": 256, "n_periods": 400}))
    is_near(found.coefficients[0], lambda t, u, v: force("drag", u, v))


@pytest.mark.parametrize("number", [5, -5])
def test_a_law_that_has_no_force_is_named(tmp_path, number):
    own = user(tmp_path, "bound", n_parameters=1, parameters=[float(number)])
    assert f"integration in time: user law bound (element 1) returned {number}" in in_time(
        tmp_path, own, status=1).stderr


#: A pair at the second mass, which slips, and opens and closes nothing.
PAIR = {"contact": {"n_pairs": 1, "law": "penalty", "side_1": [2, 0, 0], "mu": 0.3,
                    "normal_load": 1.0, "tangential_stiffness": 1.0}}


@pytest.mark.parametrize("derivative", ["given", "difference"])
def test_a_law_of_a_user_beside_contact_is_the_built_in_one(tmp_path, derivative):
    found = []
    for own in (user(tmp_path, "drag", side_2=2, derivative=derivative),
                {"damper": {"n_dampers": 1, "side_1": 1, "side_2": 2, "coefficient": 0.4,
                            "power": 2.0}}):
        in_time(tmp_path, {**own, **PAIR})
        found.append(read(tmp_path / "case.h5"))
    for name in ("coefficients", "contact/force"):
        one, other = (result[name] for result in found)
        assert np.abs(one - other).max() < WITHIN * np.abs(other).max()
    assert 0.0 < found[0]["contact/fraction"][0, 0, 1] < 1.0


def test_a_law_beside_contact_is_told_time_and_frequency(tmp_path):
    """As a load: in the middle of a step, where a load is the mean of both ends."""
    found = []
    for own in (user(tmp_path, "pushing"), {"load": {"sine": [0.2 * OMEGA, 0.0]}}):
        in_time(tmp_path, {**own, **PAIR})
        found.append(read(tmp_path / "case.h5")["coefficients"])
    assert np.abs(found[0] - found[1]).max() < 1e-3 * np.abs(found[1]).max()


@pytest.mark.parametrize("number", [5, -5])
def test_a_law_beside_contact_that_has_no_force_is_named(tmp_path, number):
    own = user(tmp_path, "bound", n_parameters=1, parameters=[float(number)])
    assert f"integration in time: user law bound (element 1) returned {number}" in in_time(
        tmp_path, {**own, **PAIR}, status=1).stderr


def test_what_is_not_integrated_is_said(tmp_path):
    assert "states of a law of a user does not go with" in in_time(
        tmp_path, user(tmp_path, "kept"), status=3).stderr
    massless = {"model": {"mass": [[1.0, 0.0], [0.0, 0.0]]}}
    assert "element 1 of &user acts on a dof without mass" in in_time(
        tmp_path, {**user(tmp_path, "drag", side_2=2), **massless}, status=3).stderr
