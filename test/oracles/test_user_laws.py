"""Laws of a user (group &user, `Law`): what is built in, written again as functions, is the same.

Functions in C stand in a library that is built here with the header of the repository. A hundred
hostile ones end in words: none crashes, hangs, or converges on what is no solution.
"""
import ctypes
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import h5py
import numpy as np
import pytest
from cases import run
from oracle_runs import run_case
from project import EXAMPLE, PROGRAM, ROOT

import fretwear as fw

#: Residuals of 1e-11 of the load times the condition of the structures, below 100: what two runs
#: of one problem may differ by, with a margin of ten.
TOLERANCE, WITHIN = 1e-11, 1e-8
MASS, STIFFNESS = np.diag([1.0, 0.8]), np.array([[2.0, -0.7], [-0.7, 1.5]])
DAMPING = 0.04 * MASS + 0.03 * STIFFNESS
MU, LOAD, SPEED = 0.3, 1.0, 0.4

SOURCE = r"""
#include <math.h>
#include <stdlib.h>
#include "fretwear.h"
const int fw_law_interface = 1;

/* c u^3 + d v. */
int spring(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   const double *p = call->parameters;
   for (int k = 0; k < call->n_time; k++) {
      const double u = call->u[k];
      force[k] = p[0] * u * u * u + p[1] * call->v[k];
      if (call->wants_derivative) { du[k] = 3.0 * p[0] * u * u; dv[k] = p[1]; }
   }
   return 0;
}

int friction(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   const double *p = call->parameters;
   for (int k = 0; k < call->n_time; k++) {
      const double t = tanh(call->v[k] / p[1]);
      force[k] = p[0] * t;
      if (call->wants_derivative) dv[k] = p[0] * (1.0 - t * t) / p[1];
   }
   return 0;
}

/* The potential u_1^2 u_2^2/2 of two inputs. */
int coupled(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   for (int k = 0; k < call->n_time; k++) {
      const double a = call->u[2 * k], b = call->u[2 * k + 1];
      force[2 * k] = a * b * b;
      force[2 * k + 1] = a * a * b;
      if (!call->wants_derivative) continue;
      du[4 * k] = b * b;
      du[4 * k + 1] = du[4 * k + 2] = 2.0 * a * b;
      du[4 * k + 3] = a * a;
   }
   return 0;
}

/* What no solution would show: forces of what was asked before, of another instant, of a motion that
   the function has changed, without the symmetry that is promised; and none where instants are many. */
int counting(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   static double last = 0.0;
   for (int k = 0; k < call->n_time; k++) {
      force[k] = call->u[k] + 0.5 * last;
      last = call->u[k];
   }
   return 0;
}

int beside(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   for (int k = 0; k < call->n_time; k++)
      force[k] = call->u[k] + 0.5 * call->u[(k + 1) % call->n_time];
   return 0;
}

int writing(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   double *u = (double *)call->u;
   for (int k = 0; k < call->n_time; k++) {
      u[k] -= 0.1;
      force[k] = u[k];
   }
   return 0;
}

int even(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   for (int k = 0; k < call->n_time; k++) {
      const double u = call->u[k];
      force[k] = 0.1 * u * u;
      if (call->wants_derivative) du[k] = 0.2 * u;
   }
   return 0;
}

int coarse(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   if (call->n_time > 512) return -1;
   for (int k = 0; k < call->n_time; k++) {
      force[k] = call->u[k];
      if (call->wants_derivative) du[k] = 1.0;
   }
   return 0;
}

/* What p[0] says is wrong: beyond |u| = p[1], which the linear solution may not reach. */
int hostile(void *user, const fw_law_call *call, double *force, double *du, double *dv)
{
   const double *p = call->parameters;
   const int what = (int)p[0];
   for (int k = 0; k < call->n_time; k++) {
      const double u = call->u[k];
      const int beyond = fabs(u) > p[1];
      force[k] = 0.5 * u * u * u;
      if (call->wants_derivative) du[k] = 1.5 * u * u;
      if (!beyond) continue;
      if (what == 0) force[k] = NAN;
      if (what == 1) force[k] = INFINITY;
      if (what == 2) return -3;
      if (what == 3) return 7;
      if (what == 4 && call->wants_derivative) du[k] = NAN;
      if (what == 5 && call->wants_derivative) du[k] = -20.0 * du[k];
      if (what == 6) force[k] = 1e300 * u;
      if (what == 7) force[k] = rand();
      if (what == 8 && call->wants_derivative) dv[k] = 1e12;
      if (what == 9) force[k] = u > 0 ? 1e8 : -1e8;
   }
   return 0;
}
"""


@pytest.fixture(scope="module", name="library")
def build_library(tmp_path_factory):
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no compiler for C")
    folder = tmp_path_factory.mktemp("laws")
    (folder / "laws.c").write_text(SOURCE)
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-I", str(ROOT / "include"), "-o",
                    "laws.so", "laws.c", "-lm"], cwd=folder, check=True, timeout=60)
    return folder / "laws.so"


def groups(n_harmonics=7, **more):
    return {
        "case": {"analysis": "point"},
        "model": {"n_dof": 2, "mass": MASS, "damping": DAMPING, "stiffness": STIFFNESS},
        "load": {"cosine": [0.6, 0.1]}, "harmonics": {"n_harmonics": n_harmonics},
        "sweep": {"start": 1.1}, "solver": {"tolerance": TOLERANCE}, **more}


def user(library, symbol, side_1, parameters=(), **more):
    keys = {"n_elements": 1, "library": str(library), "symbol": symbol, "side_1": side_1, **more}
    if parameters:
        keys |= {"n_parameters": len(parameters), "parameters": list(parameters)}
    return keys


def coefficients(folder, name, case):
    (folder / name).mkdir()
    return run_case(folder / name, case).coefficients


@pytest.mark.parametrize("derivative", ["given", "difference"])
def test_a_spring_in_c_is_the_spring(tmp_path, library, derivative):
    spring = {"n_springs": 1, "side_1": 1, "side_2": 2, "coefficient": 0.5, "power": 3}
    own = user(library, "spring", [1], [0.5, 0.0], side_2=[2], odd=True, derivative=derivative)
    one = coefficients(tmp_path, "own", groups(user=own))
    other = coefficients(tmp_path, "other", groups(spring=spring))
    assert np.abs(one - other).max() < WITHIN * np.abs(other).max()
    with h5py.File(tmp_path / "own" / "case.h5") as file:
        assert file["user/force"].shape == (1, 15, 1, 1)
        # A spring takes no work.
        assert abs(file["user/work"][0, 0]) < 1e-9


def test_smooth_friction_in_c_is_that_law(tmp_path, library):
    contact = {"n_pairs": 1, "law": "regularised", "side_1": [1, 0, 0], "mu": MU,
               "normal_load": LOAD, "slip_speed": SPEED}
    own = user(library, "friction", [1], [MU * LOAD, SPEED], odd=True)
    time = {"n_harmonics": 9, "n_time": 512}
    one = coefficients(tmp_path, "own", groups(user=own, harmonics=time))
    other = coefficients(tmp_path, "other", groups(contact=contact, harmonics=time))
    assert np.abs(one - other).max() < WITHIN * np.abs(other).max()
    with h5py.File(tmp_path / "own" / "case.h5") as a, h5py.File(
            tmp_path / "other" / "case.h5") as b:
        assert a["user/work"][0, 0] == pytest.approx(b["contact/dissipation"][0, 0], rel=1e-7)


def test_several_inputs_are_a_polynomial(tmp_path, library):
    own = user(library, "coupled", [1, 2], n_in=2, odd=True)
    terms = {"n_terms": 1, "coefficient": 0.5, "factors": [1, 1, 2, 2, 0, 0, 0, 0]}
    one = coefficients(tmp_path, "own", groups(user=own))
    other = coefficients(tmp_path, "other", groups(polynomial=terms))
    assert np.abs(one - other).max() < WITHIN * np.abs(other).max()


def test_a_dashpot_is_damping(tmp_path, library):
    """Along a sweep, a branch, a mode and derivatives by the frequency take the rates too."""
    own = user(library, "spring", [1], [0.4, 0.05], odd=True)
    spring = {"n_springs": 1, "side_1": 1, "coefficient": 0.4, "power": 3}
    damped = DAMPING + np.diag([0.05, 0.0])
    for name, changes in {
        "sweep": {"case": {"analysis": "frf"},
                  "sweep": {"start": 1.0, "end": 1.4, "n_points": 9}},
        "branch": {"case": {"analysis": "frf"},
                   "sweep": {"start": 1.0, "end": 1.4, "n_points": 9,
                             "continuation": "arclength"}},
        "resonance": {"case": {"analysis": "resonance"},
                      "sweep": {"start": 1.0, "end": 1.5, "n_points": 21},
                      "resonance": {"parameter": "load%harmonic_scale", "start": 1.0, "end": 1.2,
                                    "n_points": 2}},
    }.items():
        one = groups(user=own) | changes
        other = groups(spring=spring) | changes
        other["model"] = other["model"] | {"damping": damped}
        found = [{}, {}]
        for k, (label, case) in enumerate({"own": one, "other": other}.items()):
            folder = tmp_path / f"{name}_{label}"
            folder.mkdir()
            run(folder, case, seconds=300.0)
            with h5py.File(folder / "case.h5") as file:
                found[k] = {key: file[key][()] for key in ("omega", "amplitude")}
        if name == "branch":
            # Where its rows stand follows from the length of its steps: the other case is solved
            # at the same frequencies.
            other["sweep"] = {"values": found[0]["omega"].tolist()}
            run(tmp_path, other, seconds=300.0)
            with h5py.File(tmp_path / "case.h5") as file:
                found[1] = {key: file[key][()] for key in ("omega", "amplitude")}
            # Between the folds the sweep stands on one of two solutions.
            apart = np.abs(found[0]["amplitude"] - found[1]["amplitude"]).max(axis=1)
            alike = apart < 1e-5 * found[1]["amplitude"].max()
            assert alike.sum() > 0.6 * len(alike)
            found = [{key: values[alike] for key, values in one.items()} for one in found]
        assert found[0]["omega"].shape == found[1]["omega"].shape, name
        for key in ("omega", "amplitude"):
            assert np.abs(found[0][key] - found[1][key]).max() < 1e-5 * np.abs(
                found[1][key]).max(), (name, key)


@pytest.mark.parametrize(("changes", "status", "told"), [
    ({"library": "nothing.so"}, 5, "nothing.so"),
    ({"symbol": "sprung"}, 3, "there is no such function"),
    ({"symbol": ["spring", "spring"]}, 3, "has 2 names"),
    ({"side_2": [1]}, 3, "must differ"),
    ({"side_1": [3]}, 3, "side_1"),
    ({"n_parameters": 0, "parameters": None, "n_elements": None}, 3, "n_elements is missing"),
    ({"n_parameters": None}, 3, "n_parameters is missing"),
])
def test_wrong_input_ends_in_words(tmp_path, library, changes, status, told):
    keys = user(library, "spring", [1], [0.5, 0.0]) | changes
    keys = {key: value for key, value in keys.items() if value is not None}
    assert told in run(tmp_path, groups(user=keys), status=status).stderr


def test_odd_harmonics_need_a_promise(tmp_path, library):
    own = user(library, "spring", [1], [0.5, 0.0])
    case = groups(user=own)
    case["harmonics"]["parity"] = "odd"
    assert "even" in run(tmp_path, case, status=3).stderr
    own["odd"] = True
    run(tmp_path, case)


@pytest.mark.parametrize(("symbol", "more", "told"), [
    ("counting", {"derivative": "difference"}, "come in another order"),
    ("beside", {"derivative": "difference"}, "come in another order"),
    ("writing", {"derivative": "difference"}, "writes into u or v"),
    ("even", {"odd": True}, "promised to be odd")])
def test_what_no_solution_would_show_is_refused(tmp_path, library, symbol, more, told):
    own = user(library, symbol, [1], **more)
    said = run(tmp_path, groups(user=own), status=3).stderr
    assert told in said and f"user law {symbol} (element 1)" in said
    # Whoever wants it has it.
    run(tmp_path, groups(user=own | {"check": False}), status=(0, 4))


@pytest.mark.parametrize("derivative", ["given", "difference"])
def test_multipliers_are_those_of_built_in_elements(tmp_path, library, derivative):
    own = user(library, "spring", [1], [0.5, 0.05], side_2=[2], derivative=derivative)
    found = []
    for name, elements in {
        "own": {"user": own},
        "other": {"damper": {"n_dampers": 1, "side_1": 1, "side_2": 2, "coefficient": 0.05},
                  "spring": {"n_springs": 1, "side_1": 1, "side_2": 2, "coefficient": 0.5,
                             "power": 3}}}.items():
        (tmp_path / name).mkdir()
        case = groups(**elements)
        case["sweep"]["stability"] = True
        run(tmp_path / name, case)
        with h5py.File(tmp_path / name / "case.h5") as file:
            found.append(file["floquet/multipliers"][0] @ [1.0, 1.0j])
    for one in found[0]:
        # The solutions differ by the tolerance, and differences by the square of their step.
        assert np.abs(found[1] - one).min() < (WITHIN if derivative == "given" else 1e-6)


def test_multipliers_of_a_law_that_refuses_are_refused(tmp_path, library):
    case = groups(user=user(library, "coarse", [1]))
    run(tmp_path, case)
    case["sweep"]["stability"] = True
    assert "gives no force at one of the 1024 instants" in run(tmp_path, case, status=3).stderr


@pytest.mark.parametrize("seed", range(100))
def test_hostile_laws_end_in_words(tmp_path, library, seed):
    random = np.random.default_rng(seed)
    what, beyond = seed % 10, float(random.choice([0.0, 0.05, 0.3, 1.0, 30.0]))
    own = user(library, "hostile", [1], [float(what), beyond],
               derivative=str(random.choice(["given", "difference"])),
               check=bool(random.random() < 0.5))
    case = groups(int(random.integers(1, 8)), user=own)
    case["solver"] |= {"max_seconds": 5.0}
    done = run(tmp_path, case, status=(0, 1, 3, 4), seconds=60.0, quiet=False)
    if done.returncode == 0:
        with h5py.File(tmp_path / "case.h5") as file:
            u = file["coefficients"][0]
            assert np.isfinite(u).all()
        assert balanced(case, u, what, beyond), (what, beyond)
    else:
        assert "user law hostile" in done.stderr or "not converged: " in done.stderr
    if done.returncode == 1:
        assert "returned 7" in done.stderr


def balanced(case, u, what, beyond):
    """Whether a point that is said to converge balances forces that are computed anew."""
    n, omega = (len(u) - 1) // 2, case["sweep"]["start"]
    n_time = max(64, 16 * n)
    tau = 2.0 * np.pi * np.arange(n_time) / n_time
    basis = [np.ones(n_time)]
    for h in range(1, n + 1):
        basis += [np.cos(h * tau), np.sin(h * tau)]
    x = np.array(basis).T @ u
    force = 0.5 * x[:, 0] ** 3
    out = np.abs(x[:, 0]) > beyond
    # Wrong slopes, which Newton's method may come past, leave the forces right.
    if what in (0, 1, 2, 3, 6, 7) and out.any():
        return False
    if what == 9:
        force = np.where(out, 1e8 * np.sign(x[:, 0]), force)
    for h in range(1, n + 1):
        z = -(h * omega) ** 2 * MASS + 1j * h * omega * DAMPING + STIFFNESS
        amplitude = u[2 * h - 1] - 1j * u[2 * h]
        f = 2.0 * np.mean(force * np.exp(-1j * h * tau))
        residual = z @ amplitude + np.array([f, 0.0])
        if h == 1:
            residual -= np.array([0.6, 0.1])
        # Instants of the run may be more: what they sample differs by the harmonics above.
        if np.abs(residual).max() > 1e-3:
            return False
    return True


def model(**more):
    return fw.Model(MASS, DAMPING, STIFFNESS, cosine=[0.6, 0.1], **more)


def solved(structure, **more):
    settings = {"case": {"analysis": "point"}, "harmonics": {"n_harmonics": 7},
                "sweep": {"start": 1.1}, "solver": {"tolerance": TOLERANCE}, **more}
    return fw.run(fw.Case(structure, **settings))


def cubic(u, v, t, omega):
    return 0.5 * u**3


def slopes(u, v, t, omega):
    du = 1.5 * u[..., None] ** 2
    return du, np.zeros_like(du)


@pytest.mark.parametrize("derivative", [slopes, None])
def test_a_spring_in_python_is_the_spring(derivative):
    own = solved(model(laws=[fw.Law(cubic, 1, 2, derivative=derivative, odd=True)]))
    other = solved(model(springs=[fw.Spring(1, 2, 0.5)]))
    scale = np.abs(other.coefficients).max()
    assert np.abs(own.coefficients - other.coefficients).max() < WITHIN * scale


def test_parameters_and_several_inputs_in_python():
    def law(u, v, t, omega, p):
        return p[0] * np.stack([u[:, 0] * u[:, 1] ** 2, u[:, 0] ** 2 * u[:, 1]], axis=1)

    own = solved(model(laws=[fw.Law(law, [1, 2], parameters=[0.7], odd=True)]))
    terms = {"n_terms": 1, "coefficient": 0.35, "factors": [1, 1, 2, 2, 0, 0, 0, 0]}
    other = solved(model(), polynomial=terms)
    scale = np.abs(other.coefficients).max()
    assert np.abs(own.coefficients - other.coefficients).max() < WITHIN * scale


def test_what_a_law_raises_is_raised_again():
    def law(u, v, t, omega):
        raise ZeroDivisionError("of mine")

    with pytest.raises(ZeroDivisionError, match="of mine"):
        solved(model(laws=[fw.Law(law, 1)]))
    with pytest.raises(fw.InputError, match="returned an array of shape"):
        solved(model(laws=[fw.Law(lambda u, v, t, omega: u[:3], 1)]))


def written(u, v, t, omega):
    u *= 0.5
    return u


def not_real(u, v, t, omega):
    return np.sqrt(u.astype(complex))


def masked(u, v, t, omega):
    return np.ma.masked_less(u, 0.0)


def texts(u, v, t, omega):
    return np.full(u.shape, "1.0")


@pytest.mark.parametrize(("law", "kind", "told"), [
    (written, ValueError, "read-only"), (not_real, fw.InputError, "must be real numbers"),
    (masked, fw.InputError, "must be real numbers"), (texts, fw.InputError, "must be real")])
def test_what_numpy_would_make_numbers_of_is_refused(law, kind, told):
    with pytest.raises(kind, match=told):
        solved(model(laws=[fw.Law(law, 1)]))


def test_a_derivative_gives_two_arrays():
    with pytest.raises(fw.InputError, match="derivative: returned a ndarray, must be two arrays"):
        solved(model(laws=[fw.Law(cubic, 1, derivative=lambda u, v, t, w: 1.5 * u[..., None]**2)]))


def test_a_law_runs_a_case_of_its_own():
    """What it runs meets nothing of the run that asks."""
    inner = model(springs=[fw.Spring(1, 2, 0.5)])
    wanted = solved(inner).coefficients

    def law(u, v, t, omega):
        assert np.abs(solved(inner).coefficients - wanted).max() < WITHIN
        return 0.5 * u**3

    own = solved(model(laws=[fw.Law(law, 1, derivative=slopes, odd=True)]))
    other = solved(model(laws=[fw.Law(cubic, 1, derivative=slopes, odd=True)]))
    assert np.abs(own.coefficients - other.coefficients).max() < 1e-12


def test_a_wrong_derivative_is_told():
    def wrong(u, v, t, omega):
        du = 1.2 * u[..., None] ** 2
        return du, np.zeros_like(du)

    with pytest.raises(fw.InputError, match=r"derivative of user law cubic \(element 1\) is wrong"):
        solved(model(laws=[fw.Law(cubic, 1, derivative=wrong)]))


def test_arguments_of_laws_are_checked(tmp_path):
    with pytest.raises(fw.InputError, match="must be a function"):
        model(laws=[fw.Law(3, 1)])
    with pytest.raises(fw.InputError, match="dof numbers from -2 to 2"):
        model(laws=[fw.Law(cubic, 3)])
    with pytest.raises(fw.InputError, match="no model file holds"):
        model(laws=[fw.Law(cubic, 1)]).save(tmp_path / "m.h5")


def test_the_example_in_python_is_the_spring():
    done = subprocess.run([sys.executable, EXAMPLE / "user_laws" / "cubic.py"], check=True,
                          capture_output=True, text=True, timeout=60)
    own, built_in = (float(word.strip(",")) for word in done.stdout.split()
                     if word.strip(",")[0].isdigit())
    assert own == pytest.approx(built_in, rel=WITHIN)


def test_the_example_in_c_is_the_duffing_oscillator(tmp_path, library):
    compiler = shutil.which("cc")
    folder = EXAMPLE / "user_laws"
    shutil.copy(folder / "cubic.nml", tmp_path / "cubic.nml")
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-I", str(ROOT / "include"), "-o",
                    str(tmp_path / "laws.so"), str(folder / "laws.c"), "-lm"], check=True,
                   timeout=60)
    own = fw.run(tmp_path / "cubic.nml").amplitude[:, 0]
    text = (tmp_path / "cubic.nml").read_text()
    first, last = text.index("&user"), text.index("&load")
    spring = "&spring n_springs = 1 side_1 = 1 coefficient = 0.5 power = 3 /\n"
    (tmp_path / "spring.nml").write_text(text[:first] + spring + text[last:])
    built_in = fw.run(tmp_path / "spring.nml").amplitude[:, 0]
    assert np.abs(own - built_in).max() < 1e-7 * built_in.max()


BUILD = PROGRAM.parent


@pytest.fixture(name="shared")
def load_shared():
    path = BUILD / "libfretwear.so"
    if not path.exists():
        pytest.skip("no shared library")
    return ctypes.CDLL(str(path))


class CLaw(ctypes.Structure):
    _fields_ = [("size", ctypes.c_size_t), ("n_in", ctypes.c_int), ("n_state", ctypes.c_int),
                ("n_parameters", ctypes.c_int), ("side_1", ctypes.POINTER(ctypes.c_int)),
                ("side_2", ctypes.POINTER(ctypes.c_int)),
                ("parameters", ctypes.POINTER(ctypes.c_double)),
                ("start", ctypes.POINTER(ctypes.c_double)), ("flags", ctypes.c_uint),
                ("force", ctypes.c_void_p), ("step", ctypes.c_void_p), ("user", ctypes.c_void_p)]


TEXT = b"""&case analysis = 'point' / &model n_dof = 1 mass = 1 damping = 0.1 stiffness = 1 /
&load cosine = 0.3 / &harmonics n_harmonics = 9 / &sweep start = 1.2 /
&solver tolerance = 1e-11 /"""


def amplitude_of(shared, laws, more=b""):
    """(status, amplitude, message) of a case with laws."""
    handle = ctypes.c_void_p()
    assert shared.fw_create(ctypes.byref(handle)) == 0
    assert shared.fw_load_text(handle, TEXT + more, b"case") == 0
    for law in laws:
        status = shared.fw_add_law(handle, b"spring", ctypes.byref(law))
        if status:
            break
    else:
        status = shared.fw_run_case(handle)
    message = ctypes.create_string_buffer(500)
    shared.fw_get_message(handle, message, ctypes.c_size_t(500))
    value = ctypes.c_double(0.0)
    if status == 0:
        shared.fw_get(handle, b"amplitude", -1, ctypes.c_size_t(1), ctypes.byref(value))
    assert shared.fw_destroy(handle) == 0
    return status, value.value, message.value.decode()


def c_law(library, symbol, parameters, **more):
    functions = ctypes.CDLL(str(library))
    return CLaw(ctypes.sizeof(CLaw), 1, 0, len(parameters), (ctypes.c_int * 1)(1), None,
                (ctypes.c_double * len(parameters))(*parameters), None, more.get("flags", 1),
                ctypes.cast(getattr(functions, symbol), ctypes.c_void_p), None, None)


def test_laws_of_a_program_in_c(shared, library):
    law = c_law(library, "spring", [0.5, 0.0])
    status, own, _ = amplitude_of(shared, [law])
    _, built_in, _ = amplitude_of(
        shared, [], b"&spring n_springs = 1 side_1 = 1 coefficient = 0.5 power = 3 /")
    assert status == 0
    assert own == pytest.approx(built_in, rel=WITHIN)
    # Two halves beside a dashpot of nothing.
    halves = [c_law(library, "spring", [0.25, 0.0]), c_law(library, "spring", [0.25, 0.0])]
    assert amplitude_of(shared, halves)[1] == pytest.approx(built_in, rel=WITHIN)


@pytest.mark.parametrize(("key", "value", "told"), [
    ("size", 8, "must be sizeof(fw_law)"), ("n_in", 0, "must be from 1"),
    ("n_state", 1, "law.step is null"), ("n_state", -1, "must be from 0"),
    ("side_1", None, "law.side_1 is null"), ("force", None, "law.force is null"),
    ("n_parameters", -1, "n_parameters is negative")])
def test_wrong_laws_of_a_program_are_refused(shared, library, key, value, told):
    law = c_law(library, "spring", [0.5, 0.0])
    setattr(law, key, value)
    status, _, message = amplitude_of(shared, [law])
    assert status == 2
    assert told in message


def test_the_number_that_ends_the_run_is_said(shared, library):
    status, _, message = amplitude_of(shared, [c_law(library, "hostile", [3.0, 0.0], flags=5)])
    assert status == 1
    assert "returned 7" in message


def test_eight_handles_with_laws_do_not_meet(shared, library):
    """In threads of their own, each with its spring, for the library is left by ctypes."""
    constants = [0.1 * (k + 1) for k in range(8)]
    laws = [c_law(library, "spring", [c, 0.0]) for c in constants]
    alone = [amplitude_of(shared, [law])[1] for law in laws]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(lambda law: amplitude_of(shared, [law]), laws * 4))
    assert [status for status, _, _ in together] == [0] * 32
    assert [amplitude for _, amplitude, _ in together] == alone * 4
    assert len(set(alone)) == 8


def test_the_example_in_fortran_is_the_spring(tmp_path, shared):
    compiler = shutil.which("gfortran")
    if compiler is None:
        pytest.skip("no compiler for Fortran")
    subprocess.run([compiler, "-I", str(BUILD / "modules"), "-J", str(tmp_path), "-o",
                    str(tmp_path / "cubic"), str(EXAMPLE / "user_laws" / "cubic.f90"),
                    "-L", str(BUILD), "-lfretwear", f"-Wl,-rpath,{BUILD}"], check=True, timeout=120)
    done = subprocess.run([tmp_path / "cubic"], check=True, capture_output=True, text=True,
                          timeout=60)
    _, built_in, _ = amplitude_of(
        shared, [], b"&spring n_springs = 1 side_1 = 1 coefficient = 0.5 power = 3 /")
    assert float(done.stdout.split(":")[1]) == pytest.approx(built_in, rel=WITHIN)


def test_blocks_of_a_mission_keep_the_laws_of_a_program():
    contact = fw.ContactPairs([[2, 0, 3]], mu=0.5, area=1.0, law="penalty",
                              tangential_stiffness=1.0, normal_stiffness=1.0)
    settings = {
        "case": {"analysis": "wear"}, "harmonics": {"n_harmonics": 5}, "sweep": {"start": 1.1},
        "wear": {"coefficient": 1e-3, "error_tolerance": 1e-6},
        "mission": {"n_blocks": 2, "cycles": [10.0, 10.0], "n_flights": 2, "flights_per_jump": 1,
                    "change": ["load%harmonic_scale = 1.0", "load%harmonic_scale = 0.7"]}}
    depths = []
    for parts in ({"laws": [fw.Law(cubic, 1, derivative=slopes, odd=True)]},
                  {"springs": [fw.Spring(1, 0, 0.5)]}):
        structure = fw.Model(np.diag([1.0, 0.8, 0.0]), 0.05 * np.diag([1.0, 1.0, 0.0]),
                             [[2.0, -0.7, 0.0], [-0.7, 1.5, 0.0], [0.0, 0.0, 1.0]],
                             contact=contact, cosine=[0.8, 0.2, 0.0], static=[0.0, 0.0, -1.0],
                             **parts)
        depths.append(fw.run(fw.Case(structure, **settings))["wear/depth"])
    assert depths[1].max() > 0.0
    # Marches of this error over four blocks.
    assert np.abs(depths[0] - depths[1]).max() < 1e-5 * depths[1].max()
