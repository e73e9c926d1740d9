"""Laws of a user with states: steps in C, Fortran and Python against what is known of them.

A relaxing element has a stiffness in closed form, also for the steps that its law takes; a slider
is the elastic pair at the same instants; Bouc and Wen's joint with the exponent 1.5, which no word
has, is test/reference/laws/law_bouc_wen.json.
"""
import json
import shutil
import subprocess

import h5py
import numpy as np
import pytest
from cases import run
from oracle_runs import run_case
from project import EXAMPLE, ROOT
from test_several_laws import coefficients_of, difference

import fretwear as fw

#: Solver tolerance of all runs, and what two runs of one problem may differ by: that times the
#: condition of the structures (below 100), and a margin of ten.
TOLERANCE, WITHIN = 1e-11, 1e-8
MASS, DAMPING, STIFFNESS = 1.0, 0.05, 1.0

SOURCE = r"""
#include <math.h>
#include "fretwear.h"
const int fw_law_interface = 1;

/* f = k (u - z), z relaxes: z_1 = a z + b_0 u_0 + b_1 u_1. */
const int relaxing_states = 1;
int relaxing(void *user, const fw_law_call *call, const double *state, double *state_after,
             double *force, double *dstate, double *dforce)
{
   const double *p = call->parameters;
   state_after[0] = p[1] * state[0] + p[2] * call->u[0] + p[3] * call->u[1];
   force[0] = p[0] * (call->u[1] - state_after[0]);
   if (!call->wants_derivative) return 0;
   dstate[0] = p[1]; dstate[1] = p[2]; dstate[3] = p[3];
   dforce[0] = -p[0]; dforce[1] = p[0];
   return 0;
}

/* The same by time: k, T, and no slope by the frequency, which nobody asks for. */
const int maxwell_states = 1;
int maxwell(void *user, const fw_law_call *call, const double *state, double *state_after,
            double *force, double *dstate, double *dforce)
{
   const double *p = call->parameters;
   const double a = exp(-(call->tau[1] - call->tau[0]) / call->omega / p[1]);
   state_after[0] = a * state[0] + 0.5 * (1.0 - a) * (call->u[0] + call->u[1]);
   force[0] = p[0] * (call->u[1] - state_after[0]);
   if (!call->wants_derivative) return 0;
   dstate[0] = a; dstate[1] = dstate[3] = 0.5 * (1.0 - a);
   dforce[0] = -p[0]; dforce[1] = p[0];
   return 0;
}

/* Two inputs and three states, with rates, in no symmetry at all. */
const int mixed_states = 3;
const double mixed_start[3] = {0.1, -0.2, 0.3};
int mixed(void *user, const fw_law_call *call, const double *z, double *w, double *force,
          double *dstate, double *dforce)
{
   const double h = call->tau[1] - call->tau[0], h_t = h / call->omega;
   const double *u = call->u, *v = call->v;
   w[0] = z[0] + h_t * (v[0] - 0.8 * z[0] * z[0] * z[0] - 0.3 * z[1]);
   w[1] = z[1] + h_t * (0.5 * u[3] - 0.6 * z[1] + 0.2 * z[0] * z[2]);
   w[2] = 0.9 * z[2] + 0.05 * u[1] * v[3] + 0.02 * sin(z[0]);
   force[0] = 0.3 * w[0] + 0.1 * w[1] * u[2] + 0.05 * v[3];
   force[1] = 0.2 * w[2] + 0.1 * u[3] * u[3] * u[3];
   if (!call->wants_derivative) return 0;
   /* Columns: z (3), u, v before (2 + 2), u, v after (2 + 2). */
   dstate[0] = 1.0 - 2.4 * h_t * z[0] * z[0]; dstate[1] = -0.3 * h_t; dstate[5] = h_t;
   double *d = dstate + 11;
   d[0] = 0.2 * h_t * z[2]; d[1] = 1.0 - 0.6 * h_t; d[2] = 0.2 * h_t * z[0]; d[8] = 0.5 * h_t;
   d = dstate + 22;
   d[0] = 0.02 * cos(z[0]); d[2] = 0.9; d[4] = 0.05 * v[3]; d[10] = 0.05 * u[1];
   /* Columns: w (3), u, v after (2 + 2). */
   dforce[0] = 0.3; dforce[1] = 0.1 * u[2]; dforce[3] = 0.1 * w[1]; dforce[6] = 0.05;
   dforce[9] = 0.2; dforce[11] = 0.3 * u[3] * u[3];
   return 0;
}

/* dz/du = 1 - |z|^n (beta sgn(u' z) + 1 - beta) by steps of Runge and Kutta. */
static double slope(double z, double way, const double *p)
{
   return 1.0 - pow(fabs(z), p[2]) * (p[3] * (way * z >= 0.0 ? 1.0 : -1.0) + 1.0 - p[3]);
}
const int bouc_wen_states = 1;
int bouc_wen(void *user, const fw_law_call *call, const double *state, double *state_after,
             double *force, double *dstate, double *dforce)
{
   /* k_t, mu N, n, beta; z is the force over mu N. */
   const double *p = call->parameters, way = call->u[1] - call->u[0];
   const double h = way * p[0] / p[1] / 8.0;
   double z = state[0];
   for (int i = 0; i < 8; i++) {
      const double a = slope(z, way, p), b = slope(z + 0.5 * h * a, way, p);
      const double c = slope(z + 0.5 * h * b, way, p), d = slope(z + h * c, way, p);
      z += h * (a + 2.0 * b + 2.0 * c + d) / 6.0;
   }
   state_after[0] = z;
   force[0] = p[1] * z;
   return 0;
}

/* p[0] says what is wrong, beyond a motion of p[1]. */
const int hostile_states = 2;
int hostile(void *user, const fw_law_call *call, const double *z, double *w, double *force,
            double *dstate, double *dforce)
{
   const double u = call->u[1], beyond = fabs(u) > call->parameters[1];
   const int what = (int)call->parameters[0];
   w[0] = 0.5 * z[0] + 0.1 * u;
   w[1] = z[1];
   force[0] = 0.3 * (u - w[0]) + 0.1 * u * u * u;
   if (call->wants_derivative) {
      dstate[0] = 0.5; dstate[4] = 0.1; dstate[7] = 1.0;
      dforce[0] = -0.3; dforce[2] = 0.3 + 0.3 * u * u;
   }
   if (!beyond) return 0;
   if (what == 0) force[0] = NAN;
   if (what == 1) w[0] = INFINITY;
   if (what == 2) return -3;
   if (what == 3) return 7;
   if (what == 4 && call->wants_derivative) dstate[0] = NAN;
   if (what == 5 && call->wants_derivative) dforce[2] = -20.0;
   if (what == 6) { w[0] = 1.5 * z[0] * z[0] + 3.0; force[0] = w[0]; }   /* grows without end */
   if (what == 7) { w[1] = z[1] + 1.0; force[0] += w[1]; }               /* drifts for ever */
   if (what == 8) w[0] = z[0] > 0.0 ? -1.0 : 1.0;                        /* flips at each step */
   if (what == 9 && call->wants_derivative) dstate[4] = 1e12;
   return 0;
}
"""


@pytest.fixture(scope="module", name="library")
def build_library(tmp_path_factory):
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no compiler for C")
    folder = tmp_path_factory.mktemp("states")
    (folder / "states.c").write_text(SOURCE)
    for name, source in {"states": folder / "states.c",
                         "laws": EXAMPLE / "user_laws" / "laws.c"}.items():
        subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-I", str(ROOT / "include"), "-o",
                        str(folder / f"{name}.so"), str(source), "-lm"], check=True, timeout=60)
    return folder / "states.so"


def groups(n_harmonics, load=1.0, omega=1.1, n_time=0, **more):
    harmonics = {"n_harmonics": n_harmonics} | ({"n_time": n_time} if n_time else {})
    return {
        "case": {"analysis": "point"},
        "model": {"n_dof": 1, "mass": MASS, "damping": DAMPING, "stiffness": STIFFNESS},
        "load": {"cosine": load}, "harmonics": harmonics,
        "sweep": {"start": omega}, "solver": {"tolerance": TOLERANCE}, **more}


def user(library, symbol, parameters, **more):
    keys = {"n_elements": 1, "library": str(library), "symbol": symbol, "side_1": 1}
    if len(parameters):
        keys |= {"n_parameters": len(parameters), "parameters": list(parameters)}
    return keys | more


def solved(folder, name, case):
    (folder / name).mkdir(exist_ok=True)
    return run_case(folder / name, case)


@pytest.mark.parametrize("forgets", [0.0, 0.5, 0.99, 0.9999])
@pytest.mark.parametrize("derivative", ["given", "difference"])
def test_a_relaxing_element_is_its_stiffness(tmp_path, library, forgets, derivative):
    """Of a linear law the steps have a stiffness, which the balance must find to round-off."""
    k, a, before, after, omega, n_time = 0.8, forgets, 0.3 * (1.0 - forgets), 0.0, 1.1, 64
    after = 1.0 - a - before
    own = user(library, "relaxing", [k, a, before, after], derivative=derivative, odd=True)
    found = solved(tmp_path, "own", groups(3, omega=omega, n_time=n_time, user=own))
    turn = np.exp(-2j * np.pi / n_time)
    z = (before * turn + after) / (1.0 - a * turn)
    stiffness = STIFFNESS - MASS * omega**2 + 1j * omega * DAMPING + k * (1.0 - z)
    u = 1.0 / stiffness
    exact = np.array([u.real, -u.imag])
    assert np.abs(found.coefficients[0, 1:3, 0] - exact).max() < WITHIN * abs(u)
    with h5py.File(tmp_path / "own" / "case.h5") as file:
        f = k * (1.0 - z) * u
        assert file["user/force"][0, 1:3, 0, 0] == pytest.approx([f.real, -f.imag], rel=1e-7)
        # Work per cycle, pi |u|^2 Im(stiffness).
        work = np.pi * abs(u) ** 2 * (k * (1.0 - z)).imag
        assert file["user/work"][0, 0] == pytest.approx(work, rel=1e-6)


@pytest.mark.parametrize("load", [0.3, 1.0, 3.0])
def test_a_slider_is_the_elastic_pair(tmp_path, library, load):
    """At the same instants the pair of the program does the same: sticking, in part, sliding."""
    contact = {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 0], "mu": 0.5, "normal_load": 0.8,
               "tangential_stiffness": 1.2}
    own = user(library.with_name("laws.so"), "slider", [1.2, 0.4], odd=True)
    one = solved(tmp_path, "own", groups(7, load, n_time=256, user=own))
    case = groups(7, load, n_time=256, contact=contact)
    case["harmonics"]["sampling"] = "uniform"
    other = solved(tmp_path, "other", case)
    assert difference(one.coefficients[0], other.coefficients[0]) < WITHIN
    with h5py.File(tmp_path / "own" / "case.h5") as file:
        assert file["user/work"][0, 0] == pytest.approx(other.dissipation[0, 0], rel=1e-6,
                                                        abs=1e-9)


# What is left at H = 3, 7, 15, about twice of what is measured: truncation, and turning points
# between instants.
@pytest.mark.parametrize(("n_harmonics", "bound"), [(3, 1e-2), (7, 4e-4), (15, 1e-4)])
def test_bouc_wen_with_an_exponent_of_its_own(tmp_path, library, n_harmonics, bound):
    known = json.loads((ROOT / "test/reference/laws/law_bouc_wen.json").read_text())
    case = next(c for c in known["cases"].values() if c["params"]["n"] == 1.5)
    p = case["params"]
    own = user(library, "bouc_wen", [p["kt"], p["mu"] * p["normal_load"], p["n"], p["beta"]],
               derivative="difference", odd=True)
    keys = groups(n_harmonics, p["F"], p["omega"], 1024, user=own)
    keys["model"] |= {"mass": p["m"], "damping": p["c"], "stiffness": p["k"]}
    found = solved(tmp_path, "own", keys)
    kept = 2 * min(n_harmonics, len(case["u1"]["xc"])) + 1
    u = coefficients_of(case["u1"], n_harmonics)[:kept]
    assert difference(found.coefficients[0][:kept, 0], u) < bound
    with h5py.File(tmp_path / "own" / "case.h5") as file:
        assert file["user/work"][0, 0] == pytest.approx(case["work_per_cycle"][0], rel=4 * bound)


def two(own, **more):
    return {
        "case": {"analysis": "point"},
        "model": {"n_dof": 2, "mass": np.diag([1.0, 0.8]), "damping": 0.1 * np.eye(2),
                  "stiffness": np.array([[2.0, -0.7], [-0.7, 1.5]])},
        "load": {"cosine": [0.6, 0.3]}, "harmonics": {"n_harmonics": 5},
        "sweep": {"start": 1.1}, "solver": {"tolerance": TOLERANCE}, "user": own, **more}


def test_states_inputs_and_rates_in_any_mixture(tmp_path, library):
    """The derivative that is given passes the test before the run, and leads where differences
    do."""
    own = user(library, "mixed", [], n_in=2, side_1=[1, 2])
    given = solved(tmp_path, "given", two(own))
    other = solved(tmp_path, "other", two(own | {"derivative": "difference"}))
    assert difference(given.coefficients[0], other.coefficients[0]) < WITHIN


def test_resonances_take_forces_that_follow_from_the_frequency(tmp_path, library):
    """Of an element that relaxes in time, whose steps are shorter at higher frequencies."""
    k, time, n_time = 0.8, 2.0, 64
    own = user(library, "maxwell", [k, time], odd=True)
    case = groups(1, n_time=n_time, user=own) | {
        "case": {"analysis": "resonance"}, "sweep": {"start": 0.8, "end": 1.6, "n_points": 17},
        "resonance": {"parameter": "load%harmonic_scale", "start": 1.0, "end": 1.1, "n_points": 2}}
    run(tmp_path, case, seconds=300.0)
    with h5py.File(tmp_path / "case.h5") as file:
        omega, level = file["omega"][0], file["amplitude"][0, 0]

    def amplitude(w):
        a = np.exp(-2.0 * np.pi / n_time / w / time)
        turn = np.exp(-2j * np.pi / n_time)
        z = 0.5 * (1.0 - a) * (1.0 + turn) / (1.0 - a * turn)
        return 1.0 / np.abs(STIFFNESS - MASS * w**2 + 1j * w * DAMPING + k * (1.0 - z))

    grid = np.linspace(omega - 0.02, omega + 0.02, 4001)
    assert level == pytest.approx(amplitude(omega), rel=1e-8)
    # The spacing of the grid, at whose best point the maximum is.
    assert grid[np.argmax(amplitude(grid))] == pytest.approx(omega, abs=2e-5)


def test_branches_and_resonances_take_states(tmp_path, library):
    own = user(library.with_name("laws.so"), "slider", [1.2, 0.4], odd=True)
    sweep = {"start": 0.8, "end": 1.9, "n_points": 23}
    case = groups(5, 1.0, n_time=128, user=own) | {"case": {"analysis": "frf"}, "sweep": sweep}
    run(tmp_path, case, seconds=300.0)
    with h5py.File(tmp_path / "case.h5") as file:
        omega, level = file["omega"][()], file["amplitude"][:, 0]
    run(tmp_path, case | {"sweep": sweep | {"continuation": "arclength"}}, seconds=300.0)
    with h5py.File(tmp_path / "case.h5") as file:
        assert file["converged"][()].all()
        along = np.interp(omega, file["omega"][()], file["amplitude"][:, 0])
    # Points of a branch lie between those of the sweep: interpolation.
    assert np.abs(along - level).max() < 0.03 * level.max()


def test_a_wrong_slope_of_a_step_is_told(tmp_path, library):
    own = user(library, "hostile", [9.0, 0.0])
    assert "derivative of user law hostile (element 1) is wrong" in run(
        tmp_path, groups(3, user=own), status=3).stderr


@pytest.mark.parametrize(("key", "told"), [
    ({"case": {"analysis": "time"}}, "states of a law of a user does not go with "
                                     "case%analysis = 'time'"),
    ({"sweep": {"start": 1.1, "stability": True}}, "states of a law of a user does not go with "
                                                   "sweep%stability")])
def test_what_states_do_not_go_with_is_said(tmp_path, library, key, told):
    own = user(library, "relaxing", [0.8, 0.5, 0.25, 0.25])
    assert told in run(tmp_path, groups(3, user=own) | key, status=3).stderr


@pytest.mark.parametrize("seed", range(60))
def test_hostile_steps_end_in_words(tmp_path, library, seed):
    random = np.random.default_rng(seed)
    what, beyond = seed % 10, float(random.choice([0.0, 0.1, 0.6, 30.0]))
    own = user(library, "hostile", [float(what), beyond],
               derivative=str(random.choice(["given", "difference"])),
               check=bool(random.random() < 0.5))
    case = groups(int(random.integers(1, 6)), user=own)
    case["solver"] |= {"max_seconds": 5.0}
    done = run(tmp_path, case, status=(0, 1, 3, 4), seconds=60.0, quiet=False)
    if done.returncode:
        assert "user law hostile" in done.stderr or "not converged: " in done.stderr
        if done.returncode == 1:
            assert "returned 7" in done.stderr
        return
    with h5py.File(tmp_path / "case.h5") as file:
        u = file["coefficients"][0, :, 0]
    assert balanced(case, u, what, beyond), (what, beyond)


def balanced(case, u, what, beyond):
    """Whether a point that is said to converge balances forces that are marched anew."""
    n, omega = (len(u) - 1) // 2, case["sweep"]["start"]
    n_time = 16 * max(n, 4)
    tau = 2.0 * np.pi * np.arange(n_time) / n_time
    x = u[0] + sum(u[2 * h - 1] * np.cos(h * tau) + u[2 * h] * np.sin(h * tau)
                   for h in range(1, n + 1))
    out = np.abs(x) > beyond
    if what in (0, 1, 2, 3, 6, 7) and out.any():
        return False
    z, force = 0.0, np.zeros(n_time)
    for _ in range(60):
        for k in range(n_time):
            after = 0.5 * z + 0.1 * x[k]
            # The force is that before the state flips.
            force[k] = 0.3 * (x[k] - after) + 0.1 * x[k] ** 3
            z = after if not (what == 8 and out[k]) else (-1.0 if z > 0 else 1.0)
    for h in range(1, n + 1):
        stiffness = STIFFNESS - MASS * (h * omega) ** 2 + 1j * h * omega * DAMPING
        f = 2.0 * np.mean(force * np.exp(-1j * h * tau))
        residual = stiffness * (u[2 * h - 1] - 1j * u[2 * h]) + f - (h == 1)
        # Instants of the run may be more.
        if abs(residual) > 2e-2:
            return False
    return True


def slider(state, u, v, t, omega, p):
    trial = p[0] * (u[1, 0] - state[0])
    after = state if abs(trial) <= p[1] else u[1] - np.sign(trial) * p[1] / p[0]
    return after, p[0] * (u[1] - after)


def slopes(state, u, v, t, omega, p):
    sticks = abs(p[0] * (u[1, 0] - state[0])) <= p[1]
    return [[sticks, 0.0, 0.0, not sticks, 0.0]], [[-p[0], p[0], 0.0]]


@pytest.mark.parametrize("derivative", [None, slopes])
def test_a_slider_in_python_is_that_in_c(tmp_path, library, derivative):
    own = user(library.with_name("laws.so"), "slider", [1.2, 0.4], odd=True)
    case = groups(3, n_time=64, user=own)
    in_c = solved(tmp_path, "c", case)
    law = fw.Law(slider, 1, parameters=[1.2, 0.4], states=[0.0], derivative=derivative, odd=True)
    model = fw.Model([[MASS]], [[DAMPING]], [[STIFFNESS]], laws=[law], cosine=[1.0])
    del case["user"], case["load"], case["model"]
    in_python = fw.run(fw.Case(model, **case))
    assert difference(in_python.coefficients[0], in_c.coefficients[0]) < WITHIN


def test_what_a_step_in_python_raises_is_raised_again():
    def wrong(state, u, v, t, omega):
        return state, np.zeros(3)

    model = fw.Model([[MASS]], [[DAMPING]], [[STIFFNESS]], cosine=[1.0],
                     laws=[fw.Law(wrong, 1, states=[0.0])])
    with pytest.raises(fw.InputError, match="returned an array of shape"):
        fw.run(fw.Case(model, case={"analysis": "point"}, sweep={"start": 1.1}))
