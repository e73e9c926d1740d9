"""Wear under stress: whatever the scheme, formulation, law and input, a run ends with numbers that
hold, or says what is wrong. Sliding at the end is checked by a path that shares no code with the
program.
"""
import subprocess

import h5py
import numpy as np
import pytest
from cases import merged, run
from limits import limit
from project import PROGRAM, ROOT
from wear_cases import oscillator, prescribed_slip, result, shared_load

N_PAIRS = 3
TANGENTIAL, NORMAL = 20.0, 30.0
PENALTY = {"law": "penalty", "tangential_stiffness": TANGENTIAL, "normal_stiffness": NORMAL}

SCHEMES = {
    "explicit": {"wear": {"scheme": "explicit"}},
    "implicit": {"wear": {"scheme": "implicit"}},
    "implicit_euler": {"wear": {"scheme": "pseudo_time"},
                       "pseudo_time": {"scheme": "implicit_euler"}},
    "rosenbrock": {"wear": {"scheme": "pseudo_time"}, "pseudo_time": {"scheme": "rosenbrock"}},
    "bdf": {"wear": {"scheme": "pseudo_time"}, "pseudo_time": {"scheme": "bdf"}},
}
METHODS = {
    "hbm": {"n_time": 64}, "tcm": {"method": "tcm", "n_time": 64},
    "tcm_least_squares": {"method": "tcm_least_squares", "n_collocation": 11, "n_time": 64},
    "hdhb": {"method": "hdhb", "n_time": 7},
}
GAPS = {"closed": 0.0, "mixed": [0.0, 0.3, -0.2]}


#: At the end of the joint `folded`, by implicit steps of a tolerance of 1e-5.
FOLDED_DEPTH = 0.71119


def folded():
    """A mass that presses and rubs near resonance, of which less and less is held as it wears."""
    return {
        "case": {"analysis": "wear", "threads": 1},
        "model": {"n_dof": 2, "mass": [[1.138, 0.0], [0.0, 1.012]],
                  "stiffness": [[1.705, -0.112], [-0.112, 1.474]],
                  "damping": [[0.0264, -0.001], [-0.001, 0.0231]]},
        "contact": {"law": "penalty", "n_pairs": 1, "side_1": [1, 0, 2], "mu": 0.661,
                    "tangential_stiffness": 0.875, "normal_stiffness": 2.09, "area": 0.101},
        "load": {"static": [0.0, -0.767], "cosine": [-0.0771, -0.186], "sine": [0.0544, 0.0]},
        "harmonics": {"n_harmonics": 9}, "sweep": {"start": 1.55},
        "wear": {"coefficient": 4.56e-6}}


def planar_joint(changes, contact=None, seed=5, **load):
    """Three pairs in two tangential directions; one of them may be open at first."""
    random = np.random.default_rng(seed)
    n = 3 * N_PAIRS
    root = 0.3 * random.standard_normal((n, n))
    force = 4.0 * np.tile([1.0, 1.0, 0.1], N_PAIRS)
    groups = {
        "case": {"analysis": "wear", "threads": 1},
        "model": {"n_dof": n, "mass": np.eye(n), "stiffness": root @ root.T + 3.0 * np.eye(n),
                  "rayleigh_stiffness": 0.05},
        "contact": {"n_pairs": N_PAIRS, "side_1": np.arange(1, n + 1), "mu": 0.4,
                    "area": [1.0, 1.5, 2.0], **(contact or {})},
        "load": {"static": [0.0, 0.0, -3.0] * N_PAIRS,
                 "cosine": force * random.standard_normal(n),
                 "sine": force * random.standard_normal(n), **load},
        "harmonics": {"n_harmonics": 3}, "sweep": {"start": 0.5},
        "wear": {"coefficient": 1e-3}, "output": {"histories": True}}
    return merged(groups, changes)


def own_rates(groups, found, step):
    """Archard's rates of one step from forces and displacements over the period.

    With an elastic law the contact slides by what the spring does not take; a rigid one slides by
    all of the relative displacement.
    """
    force = found["history/force"][step]
    place = found["history/relative_displacement"][step, :, :, :2]
    if groups["contact"].get("law") == "penalty":
        place = place - force[:, :, :2] / TANGENTIAL
    way = np.linalg.norm(place - np.roll(place, 1, axis=0), axis=2)
    pressure = np.maximum(-force[:, :, 2], 0.0)
    work = (0.5 * (pressure + np.roll(pressure, 1, axis=0)) * way).sum(axis=0)
    return groups["wear"]["coefficient"] * work / np.array(groups["contact"]["area"])


def check_march(found):
    for name in ("cycles", "depth", "rate", "energy", "volume"):
        assert np.isfinite(found[f"wear/{name}"]).all(), name
    depth = found["wear/depth"]
    assert np.all(np.diff(found["wear/cycles"]) > 0.0)
    assert np.all(found["wear/rate"] >= 0.0)
    # What wore stays worn, but for the tolerance of the solver.
    assert np.diff(depth, axis=0).min() >= -1e-8 * depth.max()


# Every scheme with the plain balance; the others where schemes step from inexact states.
WAYS = [(scheme, "hbm", gap) for scheme in SCHEMES for gap in GAPS]
WAYS += [(scheme, method, "closed") for scheme in ("implicit", "rosenbrock", "bdf")
         for method in METHODS if method != "hbm"]
WAYS += [("rosenbrock", "tcm_least_squares", "mixed")]


@pytest.mark.parametrize("law", [{"law": "dlft"}, {"law": "dlft_velocity"}, PENALTY],
                         ids=lambda law: law["law"])
@pytest.mark.parametrize(("scheme", "method", "gap"), WAYS)
def test_march_to_rest(tmp_path, scheme, method, law, gap):
    """Every way ends where no pair slides under pressure, and none is worn back on the way."""
    groups = planar_joint({"harmonics": METHODS[method], **SCHEMES[scheme]},
                          contact={**law, "gap": GAPS[gap]}, seed=5 if gap == "closed" else 6)
    found = result(tmp_path, groups)
    assert found["wear"]["steady_state"] == "reached", found["wear"]
    check_march(found)
    if law["law"] == "dlft_velocity":
        return  # Its series is not periodic stick: the rate is that of the projection.
    rates = own_rates(groups, found, -1)
    assert rates.max() <= 1e-4 * own_rates(groups, found, 0).max()


@pytest.mark.parametrize("scheme", ["explicit", "implicit"])
def test_rates_of_an_elastic_joint(tmp_path, scheme):
    """Every rate of a march against the path of the history."""
    groups = planar_joint({"harmonics": METHODS["hbm"], **SCHEMES[scheme]}, contact=PENALTY)
    found = result(tmp_path, groups)
    for step, rate in enumerate(found["wear/rate"]):
        # Forces and displacements leave by way of their series: round-off of many instants.
        own = own_rates(groups, found, step)
        assert own == pytest.approx(rate, rel=1e-6, abs=1e-9 * found["wear/rate"].max())


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("case", [prescribed_slip, shared_load, oscillator])
def test_a_joint_that_unloads_is_never_in_gross_slip(tmp_path, case, scheme):
    groups = merged(case(), SCHEMES[scheme])
    found = result(tmp_path, groups)
    assert found["wear"]["steady_state"] == "reached"
    check_march(found)


@pytest.mark.parametrize("coefficient", [1e-300, 1e-20, 1e10, 1e100])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_coefficient_only_scales_the_cycles(tmp_path, scheme, coefficient):
    case = merged(prescribed_slip(), SCHEMES[scheme])
    plain = result(tmp_path, case)
    found = result(tmp_path, merged(case, {"wear": {"coefficient": coefficient}}))
    scale = case["wear"]["coefficient"] / coefficient
    assert found["wear/cycles"][1] == pytest.approx(scale * plain["wear/cycles"][1], rel=1e-9)
    assert found["wear/depth"][1] == pytest.approx(plain["wear/depth"][1], rel=1e-9)
    assert found["wear"]["steady_state"] == "reached"


@pytest.mark.parametrize("scheme", ["rosenbrock", "bdf", "implicit_euler", "implicit"])
def test_steps_keep_to_the_largest_growth(tmp_path, scheme):
    largest = 0.005
    groups = merged(prescribed_slip(max_depth_step=largest), SCHEMES[scheme])
    found = result(tmp_path, groups)
    assert np.diff(found["wear/depth"], axis=0).max() <= largest
    assert found["wear"]["steady_state"] == "reached"


def test_linearly_implicit_steps_have_a_size_of_their_own(tmp_path):
    """Without an error estimate, and none asked for, steps are a part of the compression."""
    found = result(tmp_path, merged(prescribed_slip(), SCHEMES["implicit_euler"]))
    assert np.diff(found["wear/depth"], axis=0).max() <= 0.05 * 0.2 * (1.0 + 1e-9)


def test_energy_law_without_friction(tmp_path):
    found = result(tmp_path, merged(prescribed_slip(law="energy"), {"contact": {"mu": 0.0}}))
    assert found["wear"]["steady_state"] == "reached"
    assert "friction" in found["wear"]["ending"]


@pytest.mark.parametrize(("wear", "words"), [
    ({"max_depth_step": 1e-300, "max_steps": 20}, ["max_steps = 20"]),
    ({"error_tolerance": 1e-16, "scheme": "pseudo_time"}, ["error_tolerance"])])
def test_what_cannot_come_to_an_end_says_so(tmp_path, wear, words):
    groups = merged(prescribed_slip(**wear), {"pseudo_time": {"scheme": "bdf"}})
    found = result(tmp_path, groups, status=4)
    assert found["wear"]["steady_state"] == "not reached"
    for word in words:
        assert word in found["wear"]["ending"]


@pytest.mark.parametrize("scheme", ["rosenbrock", "bdf", "implicit"])
def test_the_vibration_jumps_as_the_joint_wears(tmp_path, scheme):
    """At a depth of 0.2035 it has a fold: every scheme passes it and comes to one steady state."""
    found = result(tmp_path, merged(folded(), SCHEMES[scheme]))
    assert found["wear"]["steady_state"] == "reached"
    assert found["wear"]["n_jumps"] == 1
    assert b"vibration jumps" in list(found["remarks/name"])
    # The tolerance of the steps, ten times.
    assert found["wear/depth"][-1, 0] == pytest.approx(FOLDED_DEPTH, rel=1e-2)
    # Nothing was worn beyond the fold by a vibration that is not there.
    assert found["converged"].all()


@pytest.mark.parametrize(("changes", "words"), [
    ({"wear": {"steady_tolerance": 1.0}}, ["steady_tolerance", "below 1"]),
    ({"wear": {"scheme": "explicit", "order": 3}}, ["wear%order = 3", "orders 1 and 2"]),
    ({"wear": {"scheme": "pseudo_time", "order": 2}}, ["wear%order = 2", "pseudo_time%scheme"]),
    ({"wear": {"scheme": "pseudo_time", "error_tolerance": 1e-3}},
     ["wear%error_tolerance", "estimates no error", "max_depth_step"]),
    ({"wear": {"scheme": "pseudo_time"}, "pseudo_time": {"scheme": "runge_kutta"}},
     ["runge_kutta", "stiff"])])
def test_options_that_a_scheme_has_not(tmp_path, changes, words):
    message = run(tmp_path, merged(prescribed_slip(), changes), status=3).stderr
    for word in words:
        assert word in message


@pytest.mark.parametrize("spring", [{}, {"spring": {"n_springs": 1, "side_1": 1, "side_2": 0,
                                                   "coefficient": 1.0}}])
def test_nothing_to_wear(tmp_path, spring):
    groups = {name: keys for name, keys in prescribed_slip().items() if name != "contact"}
    message = run(tmp_path, {**groups, **spring}, status=3).stderr
    assert "without contact pairs" in message


@pytest.mark.parametrize("scheme, control", [
    ("implicit_euler", "wear%max_depth_step=1e-4"), ("rosenbrock", "wear%error_tolerance=1e-2")])
def test_pseudo_time_passes_kinks_of_the_sector(tmp_path, scheme, control):
    """At 2500 rpm nearly every pair wears, and linear steps alone go to and fro."""
    done = subprocess.run(
        [PROGRAM, "-q", "-o", tmp_path / "worn.h5", ROOT / "example/blade_sector/frf_48.nml",
         "--set", "case%analysis='wear'", "--set", "model%rotation_speed=261.8",
         "--set", "sweep%start=1006.5", "--set", "sweep%n_points=1",
         "--set", "harmonics%n_harmonics=3", "--set", "wear%scheme='pseudo_time'",
         "--set", "wear%coefficient=1e-12", "--set", f"pseudo_time%scheme='{scheme}'",
         "--set", control], capture_output=True, text=True, check=False, timeout=limit(120))
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "worn.h5") as file:
        assert file["wear"].attrs["steady_state"] == "reached"
        depth = file["wear/depth"][-1]
        assert (depth > 0.01 * depth.max()).sum() >= 40
        assert file["amplitude"][-1, 0] < 0.2 * file["amplitude"][0, 0]


def profile_of_the_sector(path, scheme, tolerance):
    """Depths of the pairs at the end, at 3600 rpm, from steps that follow an error."""
    done = subprocess.run(
        [PROGRAM, "-q", "-o", path, ROOT / "example/blade_sector/frf_48.nml",
         "--set", "case%analysis='wear'", "--set", "model%rotation_speed=376.99",
         "--set", "sweep%start=1012.5", "--set", "sweep%n_points=1",
         "--set", "harmonics%n_harmonics=3", "--set", "wear%scheme='pseudo_time'",
         "--set", "wear%coefficient=1e-8", "--set", f"pseudo_time%scheme='{scheme}'",
         "--set", f"wear%error_tolerance={tolerance}"],
        capture_output=True, text=True, check=False, timeout=limit(120))
    assert done.returncode == 0, done.stderr
    with h5py.File(path) as file:
        assert file["wear"].attrs["steady_state"] == "reached"
        assert np.diff(file["wear/depth"][()], axis=0).min() >= 0.0
        return file["wear/depth"][-1]


@pytest.mark.parametrize("tolerance", [0.1, 0.01])
def test_backward_differences_keep_their_tolerance(tmp_path, tolerance):
    """The error of each pair is meant, not the mean over all unknowns; and a vibration that lags
    behind wears what is never given back. Rosenbrock's method at 3e-3 is exact to 5e-4."""
    exact = profile_of_the_sector(tmp_path / "exact.h5", "rosenbrock", 3e-3)
    found = profile_of_the_sector(tmp_path / "found.h5", "bdf", tolerance)
    assert np.abs(found - exact).max() <= 0.5 * tolerance * exact.max()
