"""Residual tractions that are given (`memory = 'residual'`): solutions known from elsewhere, the balance
of test/support/residual_balance.py, derivatives against differences, and the ends of what a wedge can
bear."""
import json

import h5py
import numpy as np
import pytest
from cases import merged, run
from project import ROOT
from residual_balance import of_groups

FOLDER = ROOT / "test" / "reference" / "bodies"
#: Of derivatives against central differences, beside the largest.
DERIVATIVE = 1e-6
#: Two programs that solve one balance to 1e-12 of its loads: times the condition of what the pairs
#: hold (below 1e4), with a margin of ten.
SAME = 1e-7


def reference(name):
    oracle = json.loads((FOLDER / f"{name}_bounds.json").read_text())
    groups = {key: dict(group) for key, group in oracle["groups"].items() if key != "bounds"}
    groups["case"] = {"analysis": "point"}
    return groups, oracle["points"][0], oracle["tolerance"]


def solved(folder, groups, status=0):
    run(folder, groups, status=status)
    with h5py.File(folder / "case.h5") as file:
        assert file["converged"][()].all()
        found = {name: file[name][()] for name in ("coefficients", "amplitude", "contact/force",
                                                   "contact/fraction")}
        for quantity in ("first_harmonic", "largest"):
            for key, values in file.get(f"sensitivity/{quantity}", {}).items():
                if key.startswith("contact_"):
                    found[key] = values[0]
    return found


def amplitude(found):
    return np.hypot(*found["coefficients"][0, 1:3, 0])


def at_shares(groups, omega, shares, **more):
    return merged(groups, {
        "contact": {"memory": "residual", "residual": list(shares)}, "sweep": {"start": omega},
        **more})


BY_SHARES = {"sensitivity": {"parameters": "contact%residual", "quantities": "first_harmonic"}}


@pytest.mark.parametrize("name", ["v8", "v9"])
def test_reference(name, tmp_path):
    """Two blades and a wedge: the assembly, the centre, and drawn shares with their derivative."""
    groups, point, tolerance = reference(name)
    plain = solved(tmp_path, merged(groups, {"sweep": {"start": point["omega"]}}))
    wanted = np.asarray(point["u_assembly"])[:, 0]
    assert np.abs(plain["coefficients"][0, :, 0] - wanted).max() < 1e-8 * np.abs(wanted).max()
    centre = solved(tmp_path, at_shares(groups, point["omega"], np.zeros(4)))
    assert abs(amplitude(centre) - point["centre"]) < tolerance * point["centre"]
    drawn = point["random"]
    found = solved(tmp_path, at_shares(groups, point["omega"], drawn["residual"], **BY_SHARES))
    assert abs(amplitude(found) / drawn["first_harmonic"] - 1.0) < tolerance
    slope = np.asarray(drawn["by_residual"])
    assert np.abs(found["contact_residual"] - slope).max() < tolerance * np.abs(slope).max()
    stuck = found["contact/fraction"][0, :, 0] > 1.0 - 1e-12
    assert (stuck == drawn["stuck"]).all()


@pytest.mark.parametrize("wrong", [False, True])
def test_derivative_of_the_ends_counts(wrong, tmp_path):
    """The balance of the judge, and one that leaves dP out of z where its ends are."""
    groups, point, _ = reference("v8")
    shares = np.array(point["random"]["residual"])
    judge = of_groups(groups)
    u = judge.walk(point["omega"], np.zeros(4), judge.solve(
        point["omega"], np.zeros(4), np.array(point["u_assembly"])), shares)
    du, _ = of_groups(groups, wrong=wrong).slope(point["omega"], shares, u)
    slope = (u[1, 0] * du[1, 0] + u[2, 0] * du[2, 0]) / np.hypot(u[1, 0], u[2, 0])
    found = solved(tmp_path, at_shares(groups, point["omega"], shares, **BY_SHARES))
    off = np.abs(found["contact_residual"] - slope).max() / np.abs(slope).max()
    assert off > 0.1 if wrong else off < SAME


def slider(law="penalty", **contact):
    """Two masses whose pairs press as they vibrate: residual tractions change the vibration."""
    mass = np.diag([1.0, 0.8, 0.6, 0.0, 0.0, 0.0])
    tie = np.array([[1.0, 0.0, 0.3, -1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, -1.0, 0.0],
                    [0.2, 0.0, 1.0, 0.0, 0.0, -1.0]])
    stiffness = np.diag([800.0, 900.0, 700.0, 1.0, 1.0, 1.0]) + tie.T @ np.diag(
        [300.0, 400.0, 350.0]) @ tie
    return {
        "case": {"analysis": "point"},
        "model": {"n_dof": 6, "mass": mass.ravel(), "stiffness": stiffness.ravel(),
                  "rayleigh_stiffness": 4e-4},
        "contact": {"n_pairs": 1, "law": law, "side_1": [4, 0, 5], "mu": 0.5, "gap": -0.02,
                    **({"tangential_stiffness": 250.0, "normal_stiffness": 300.0}
                       if law == "penalty" else {}), **contact},
        "load": {"static": [0.0, -4.0, 0.0, 0.0, 0.0, 0.0],
                 "cosine": [0.4, 0.7, 0.2, 0.0, 0.0, 0.0], "sine": [0.2, -0.2, 0.3, 0.0, 0.0, 0.0]},
        "harmonics": {"n_harmonics": 3}, "sweep": {"start": 24.0},
        "solver": {"tolerance": 1e-13}, "output": {"observe": [1, 2, 3]}}


INSTANTS = {"harmonics": {"n_harmonics": 3, "n_time": 64, "sampling": "uniform"}}
CURVED = {"normal_law": "power", "normal_coefficient": 900.0, "normal_exponent": 1.3}


@pytest.mark.parametrize(("groups", "more"), [
    (slider(), {}), (slider(), INSTANTS), (slider("dlft"), {}), (slider("dlft"), INSTANTS),
    (slider(**CURVED), {"contact": {"normal_stiffness": None}}),
], ids=["penalty", "penalty at instants", "dlft", "dlft at instants", "curved"])
@pytest.mark.parametrize("key", ["contact%residual", "contact%mu", "contact%gap"])
def test_derivatives_against_differences(groups, more, key, tmp_path):
    groups = merged(groups, more)
    share = 0.37
    name = key.partition("%")[2]
    base = {"residual": share, "mu": groups["contact"]["mu"], "gap": groups["contact"]["gap"]}
    groups = merged(groups, {"contact": {"memory": "residual", "residual": share}})
    found = solved(tmp_path, merged(groups, {"sensitivity": {
        "parameters": key, "quantities": "largest"}}))
    assert found["contact/fraction"][0, 0, 0] > 1.0 - 1e-12
    step = 1e-3 * max(abs(base[name]), 0.02)

    def at(k):
        return solved(tmp_path, merged(groups, {"contact": {
            name: base[name] + k * step}}))["amplitude"][0]

    slope = (8.0 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12.0 * step)
    own = np.reshape(found[key.replace("%", "_")], -1)
    assert np.abs(own - slope).max() < DERIVATIVE * np.abs(slope).max()
    # A residual traction moves the mean, and so does what its ends depend on.
    assert np.abs(slope).max() > 1e-3 * np.abs(found["amplitude"]).max()


def test_share_is_between_the_ends(tmp_path):
    """The mean tangential force goes straight from one end to the other where the pressure does not
    depend on it, and the ends touch the limit of friction."""
    groups = merged(slider(), INSTANTS)
    groups["contact"] |= {"side_1": [4, 0, 0], "normal_load": 3.0}
    del groups["contact"]["normal_stiffness"], groups["contact"]["gap"]
    means = []
    for share in (-1.0, -0.5, 0.0, 1.0):
        found = solved(tmp_path, merged(groups, {"contact": {"memory": "residual",
                                                             "residual": share}}))
        force = found["contact/force"][0, :, 0, 0]
        tau = 2.0 * np.pi * np.arange(64) / 64
        n = np.arange(1, 4)
        history = force[0] + np.cos(np.outer(tau, n)) @ force[1::2] + np.sin(
            np.outer(tau, n)) @ force[2::2]
        means.append(force[0])
        if abs(share) == 1.0:
            # z at the lower end: the force touches its upper limit, and the other way round.
            assert abs(-share * history.max() - 1.5) < 1e-10 or abs(
                -share * history.min() - 1.5) < 1e-10
    steps = np.diff(means)
    assert abs(steps[1] - steps[0]) < 1e-10 and abs(steps[2] - 2.0 * steps[0]) < 1e-10


def test_ends_of_a_wedge(tmp_path):
    """A wedge under its centrifugal force alone: shares of -1 and 1 are the ends of the normal force
    that friction allows, Fc/2/(sin a + mu cos a) and Fc/2/(sin a - mu cos a)."""
    groups, _, _ = reference("v8")
    for angle, mu in ((40.0, 0.3), (50.0, 0.5), (30.0, 0.2)):
        a = np.radians(angle)
        t = np.array([[np.sin(a), np.cos(a)], [-np.sin(a), np.cos(a)]])
        n = np.array([[np.cos(a), -np.sin(a)], [-np.cos(a), -np.sin(a)]])
        rows = np.zeros((4, 3))
        rows[0::2, :2], rows[1::2, :2] = t, n
        wedge = {
            "case": {"analysis": "point"},
            "model": {"n_dof": 3, "mass": np.diag([0.05, 0.05, 1.0]).ravel(),
                      "stiffness": np.diag([0.0, 0.0, 900.0]).ravel(), "n_rows": 4,
                      "row": rows.ravel(), "rayleigh_stiffness": 1e-3},
            "contact": {"n_pairs": 2, "law": "penalty", "side_1": [4, 0, 5, 6, 0, 7], "mu": mu,
                        "tangential_stiffness": 2e4, "normal_stiffness": 3e4},
            "load": {"static": [0.0, 20.0, 0.0], "cosine": [0.0, 0.0, 1.0]},
            "harmonics": groups["harmonics"], "sweep": {"start": 20.0},
            "solver": {"tolerance": 1e-10}, "output": {"observe": [3]}}
        ends = []
        for share in (-1.0, 1.0):
            found = solved(tmp_path, merged(wedge, {"contact": {"memory": "residual",
                                                                "residual": share}}))
            ends.append(-found["contact/force"][0, 0, :, 2])
        low, high = (10.0 / (np.sin(a) + side * mu * np.cos(a)) for side in (1.0, -1.0))
        both = sorted(ends, key=np.sum)
        assert np.abs(both[0] / low - 1.0).max() < 1e-6
        assert np.abs(both[1] / high - 1.0).max() < 1e-6


def test_a_sweep_moves_a_slider_from_0(tmp_path):
    """Nothing else moves the face: each point is that of the case with its slider, at rest there by
    (k_u + k) u = k s."""
    k_u, k = 1.0, 0.5
    groups = {
        "model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 1.0], "stiffness": [k_u, 0.0, 0.0, 2.0],
                  "damping": [0.04, 0.0, 0.0, 0.04]},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 2], "mu": 0.3, "gap": -0.1,
                    "tangential_stiffness": k, "normal_stiffness": 1.0, "slider_1": 0.0},
        "load": {"cosine": [0.0, 0.02]}, "harmonics": {"n_harmonics": 3},
        "sweep": {"frequency": 0.9, "parameter": "contact%slider_1", "start": 0.0, "end": 0.02,
                  "n_points": 3},
        "output": {"observe": [1]}}
    found = solved(tmp_path, groups)["coefficients"][:, 0, 0]
    assert np.abs(found - k * np.array([0.0, 0.01, 0.02]) / (k_u + k)).max() < 1e-10


def test_slider_parameter(tmp_path):
    """A pair that never slips follows its slider, a pair that slips forgets it."""
    groups = merged(slider(), {"contact": {"slider_1": 1e-4}})
    asked = {"sensitivity": {"parameters": ["contact%slider_1", "contact%tangential_stiffness"],
                             "quantities": "largest"}}
    for law_groups in (groups, merged(groups, INSTANTS)):
        found = solved(tmp_path, merged(law_groups, asked))
        for name, value, step in (("slider_1", 1e-4, 1e-5), ("tangential_stiffness", 250.0, 0.5)):
            side = [solved(tmp_path, merged(law_groups, {"contact": {name: value + k * step}}))[
                "amplitude"][0] for k in (-2, -1, 1, 2)]
            slope = (8.0 * (side[2] - side[1]) - (side[3] - side[0])) / (12.0 * step)
            own = np.reshape(found[f"contact_{name}"], -1)
            assert np.abs(own - slope).max() < DERIVATIVE * np.abs(slope).max(), name
    slips = merged(groups, {"load": {"cosine": [9.0, 0.7, 0.2, 0.0, 0.0, 0.0]}})
    found = solved(tmp_path, merged(slips, asked))
    assert np.abs(found["contact_slider_1"]).max() < 1e-12


def test_slider_of_two_directions(tmp_path):
    """A pair that shakes down on the way that its start decides on."""
    groups = merged(slider(), INSTANTS)
    groups = merged(groups, {"contact": {"side_1": [4, 6, 5], "slider_1": 0.008,
                                         "slider_2": -0.005}, "solver": {"tolerance": 1e-12}})
    found = solved(tmp_path, merged(groups, {"sensitivity": {
        "parameters": ["contact%slider_1", "contact%slider_2"], "quantities": "largest"}}))
    assert found["contact/fraction"][0, 0, 0] > 0.9
    for name, value, step in (("slider_1", 0.008, 2e-6), ("slider_2", -0.005, 2e-6)):
        side = [solved(tmp_path, merged(groups, {"contact": {name: value + k * step}}))[
            "amplitude"][0] for k in (-2, -1, 1, 2)]
        slope = (8.0 * (side[2] - side[1]) - (side[3] - side[0])) / (12.0 * step)
        own = np.reshape(found[f"contact_{name}"], -1)
        assert np.abs(own - slope).max() < 1e-5 * np.abs(slope).max(), name


@pytest.mark.parametrize(("change", "words"), [
    ({"contact": {"memory": "residual", "residual": 1.2}}, "1.2: must be a finite real from -1"),
    ({"contact": {"residual": 0.5}}, "set memory = 'residual'"),
    ({"contact": {"memory": "residual", "side_1": [4, 6, 5]}}, "slider"),
    ({"contact": {"memory": "residual", "law": "rigid"}}, "use 'penalty' or 'dlft'"),
    ({"contact": {"memory": "residual"}, "case": {"analysis": "time"}}, "use 'frf' or 'point'"),
    ({"contact": {"memory": "residual"}, "sweep": {"stability": True}}, "leave stability out"),
    ({"sensitivity": {"parameters": "contact%residual"}}, "memory is not 'residual'"),
    ({"sensitivity": {"parameters": "contact%slider_1"}},
     "contact%slider_1 is not given: give it (values of 0 serve), or leave it out"),
])
def test_refusals(change, words, tmp_path):
    groups = merged(slider(), change)
    if change.get("contact", {}).get("law") == "rigid":
        for key in ("tangential_stiffness", "normal_stiffness"):
            del groups["contact"][key]
    message = run(tmp_path, groups, status=3).stderr
    assert words in message
    # One mistake is told once.
    assert message.count("error:") == 1


def test_sweep_over_shares(tmp_path):
    """A sweep over the share goes through what the points give one by one."""
    groups = merged(slider(), {"contact": {"memory": "residual"}})
    run(tmp_path, merged(groups, {"case": {"analysis": "frf"}, "sweep": {
        "parameter": "contact%residual", "frequency": 24.0, "start": -1.0, "end": 1.0,
        "n_points": 5}}))
    with h5py.File(tmp_path / "case.h5") as file:
        along = file["amplitude"][:, 0]
    for share, value in zip(np.linspace(-1.0, 1.0, 5), along):
        one = solved(tmp_path, merged(groups, {"contact": {"residual": float(share)}}))
        assert abs(one["amplitude"][0, 0] / value - 1.0) < 1e-9
    assert abs(along[-1] / along[0] - 1.0) > 1e-3


def bounds(folder, groups, **more):
    run(folder, merged(merged(groups, {"case": {"analysis": "bounds"}}), more))
    with h5py.File(folder / "case.h5") as file:
        return {name: np.asarray(values) for name, values in file["bounds"].items()}


@pytest.mark.parametrize("name", ["v8", "v9"])
def test_range(name, tmp_path):
    """Both ends of the reference, which is of all corners and of descents from random shares, in
    few solutions."""
    groups, point, tolerance = reference(name)
    found = bounds(tmp_path, groups, sweep={"values": [point["omega"]]})
    for key in ("lowest", "highest", "centre"):
        assert abs(found[key][0] / point[key] - 1.0) < tolerance, key
    assert found["failed"][0] == 0
    assert found["solved"][0] <= 60
    # The response at the tractions of an end is the end.
    for key in ("lowest", "highest"):
        there = solved(tmp_path, at_shares(groups, point["omega"], found[f"residual_{key}"][0]))
        assert abs(amplitude(there) / found[key][0] - 1.0) < tolerance


def test_range_over_frequencies(tmp_path):
    """A row of several is what a run of its frequency alone gives, and the points are the centre."""
    groups, point, tolerance = reference("v8")
    sweep = {"start": 0.97 * point["omega"], "end": point["omega"], "n_points": 3}
    found = bounds(tmp_path, groups, sweep=sweep)
    with h5py.File(tmp_path / "case.h5") as file:
        along = np.hypot(file["coefficients"][:, 1, 0], file["coefficients"][:, 2, 0])
    assert np.abs(along / found["centre"] - 1.0).max() < 1e-12
    assert abs(found["highest"][-1] / point["highest"] - 1.0) < tolerance
    assert abs(found["lowest"][-1] / point["lowest"] - 1.0) < tolerance
    assert (found["lowest"] <= found["centre"]).all()
    assert (found["centre"] <= found["highest"]).all()


def test_range_of_friction_energy(tmp_path):
    groups, point, _ = reference("v9")
    found = bounds(tmp_path, groups, sweep={"values": [point["omega"]]},
                   bounds={"quantity": "dissipation"})
    for key in ("lowest", "highest"):
        run(tmp_path, at_shares(groups, point["omega"], found[f"residual_{key}"][0]))
        with h5py.File(tmp_path / "case.h5") as file:
            assert abs(file["contact/dissipation"][0].sum() / found[key][0] - 1.0) < 1e-6


@pytest.mark.parametrize(("change", "words"), [
    ({"contact": {"n_pairs": 0}}, "without contact pairs"),
    ({"contact": {"memory": "carried"}}, "use 'assembly'"),
    ({"bounds": {"quantity": "wear_volume"}}, "needs wear%coefficient"),
    ({"bounds": {"n_starts": 2}}, "n_starts"),
    ({"sweep": {"parameter": "contact%mu", "start": 0.1, "end": 0.2, "frequency": 24.0}},
     "sweep over the frequency"),
    ({"contact": {"law": "rigid", "tangential_stiffness": None, "normal_stiffness": None}},
     "use 'penalty' or 'dlft'"),
])
def test_refusals_of_ranges(change, words, tmp_path):
    groups = merged(slider(), {"case": {"analysis": "bounds"}, "sweep": {"end": 25.0, "n_points": 3}})
    assert words in run(tmp_path, merged(groups, change), status=3).stderr


def test_traction_moves_what_no_load_moves(tmp_path):
    """A mass beside the one that vibrates, which only the residual traction of its pair moves."""
    groups = {
        "case": {"analysis": "point"},
        "model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 1.0], "stiffness": [900.0, 0.0, 0.0, 400.0],
                  "rayleigh_stiffness": 1e-3},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [2, 0, 0], "mu": 0.5,
                    "normal_load": 4.0, "tangential_stiffness": 100.0},
        "load": {"cosine": [1.0, 0.0]}, "harmonics": {"n_harmonics": 1},
        "sweep": {"start": 20.0}, "solver": {"tolerance": 1e-12}, "output": {"observe": [1, 2]}}
    # u k_t - z = -k u with z at the end of P - mu N .. P + mu N.
    for share in (-1.0, 0.5):
        found = solved(tmp_path, merged(groups, {"contact": {"memory": "residual",
                                                             "residual": share}}))
        assert abs(found["coefficients"][0, 0, 1] - share * 2.0 / 400.0) < 1e-12
    found = solved(tmp_path, merged(groups, {"contact": {"slider_1": 0.01}}))
    assert abs(found["coefficients"][0, 0, 1] - 1.0 / 500.0) < 1e-12
