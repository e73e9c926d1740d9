"""Sides that slide steadily, and wear on sides that slide, against sums of numpy's own."""
import copy
import json

import h5py
import numpy as np
import pytest
from cases import merged, read, run
from oracle_runs import run_case
from project import ROOT

LAWS = ("penalty", "dlft", "dlft_velocity", "rigid", "regularised")
# Of sums over coefficients, with solutions to 1e-12.
ROUND_OFF = 1e-9


def oracle(name):
    return json.loads((ROOT / f"test/reference/bodies/{name}.json").read_text())["groups"]


def steady(law, **contact):
    """The rub of v5 with a law, whose sampling is its own."""
    groups = merged(oracle("v5_rub_steady"), {
        "contact": {"law": law, **contact}, "sweep": {"start": 100.0}})
    if law != "penalty":
        del groups["contact"]["tangential_stiffness"]
        if law != "regularised":
            del groups["contact"]["normal_stiffness"]
        else:
            groups["contact"]["slip_speed"] = 0.02
    if law == "rigid":
        groups["harmonics"] = {"n_harmonics": 9}
    return groups


def worn(groups, n_cycles=3, **wear):
    case = merged(copy.deepcopy(groups), {
        "case": {"analysis": "wear"}, "contact": {"area": 2.0},
        "wear": {"coefficient": 1e-5, "n_cycles": n_cycles, "error_tolerance": 1e-3, **wear}})
    return case


def waves(n, angles):
    return np.array([np.ones_like(angles)] + [f(h * angles) for h in range(1, n + 1)
                                              for f in (np.cos, np.sin)])


def motion(u, sides):
    """Coefficients of the relative displacements of pairs to ground (2H+1, pair, 3)."""
    sides = np.reshape(sides, (-1, 3))
    return np.stack([np.where(pair > 0, u[:, np.abs(pair) - 1], 0.0) for pair in sides], axis=1)


def rate_of(u):
    """d/dtau."""
    found = np.zeros_like(u)
    for h in range(1, (len(u) + 1) // 2):
        found[2 * h - 1], found[2 * h] = h * u[2 * h], -h * u[2 * h - 1]
    return found


def slides(found, row, groups):
    """int p (|v| - du/dt . v/|v|) dt of each pair [force length]."""
    contact, omega = groups["contact"], found["omega"][row]
    u = motion(found["coefficients"][row], contact["side_1"])
    force = found["contact/force"][row]
    n = (len(u) - 1) // 2
    angles = 2.0 * np.pi * np.arange(8 * n) / (8 * n)
    total = []
    for i in range(u.shape[1]):
        v = np.array([contact["speed_1"][i], contact.get("speed_2", np.zeros(9))[i]])
        pace = np.hypot(*v)
        rate = omega * rate_of(u[:, i, :2] @ v / pace) @ waves(n, angles)
        pressure = -force[:, i, 2] @ waves(n, angles)
        total.append(2.0 * np.pi / omega * np.mean(pressure * (pace - rate)))
    return np.array(total)


@pytest.mark.parametrize("law", LAWS)
def test_wear_of_steady_sliding(tmp_path, law):
    groups = worn(steady(law))
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")
    assert found["converged"].all() and len(found["wear/cycles"]) > 2
    assert (found["wear/depth"][-1] > 1e-6).all()
    for row in range(len(found["wear/cycles"])):
        wanted = 1e-5 / 2.0 * slides(found, row, groups)
        assert found["wear/rate"][row] == pytest.approx(wanted, rel=ROUND_OFF)


# Energy that wears is friction times what slides, also where mu has changed with the depth.
@pytest.mark.parametrize("law", ("penalty", "dlft"))
def test_friction_that_wears_while_it_slides(tmp_path, law):
    groups = worn(steady(law), law="energy", mu_by="depth", mu_final=0.05, mu_scale=5e-5)
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")
    mu = found["wear/mu"]
    assert (mu[-1] < 0.99 * mu[0]).all()
    for row in range(len(mu)):
        force = found["contact/force"][row]
        direction = np.array([30.0, -8.0]) / np.hypot(30.0, 8.0)
        for i in range(2):
            assert np.abs(force[:, i, :2] - mu[row, i] * direction * force[:, i, 2:]).max() < \
                1e-9 * np.abs(force).max()
        wanted = 1e-5 / 2.0 * mu[row] * slides(found, row, groups)
        assert found["wear/rate"][row] == pytest.approx(wanted, rel=ROUND_OFF)


def test_scheme_of_steps_does_not_matter(tmp_path):
    """Steps that know the derivative of what slides, and others that do not."""
    depths = []
    for scheme in ("implicit", "explicit"):
        groups = worn(steady("dlft"), scheme=scheme, error_tolerance=1e-5)
        run(tmp_path, groups)
        depths.append(read(tmp_path / "case.h5")["wear/depth"][-1])
    assert depths[0] == pytest.approx(depths[1], rel=1e-4)


def marched(contact, i, y, k, omega, mu, at_turn=True):
    """What slides under pressure on the path, sum p |x - x_before - k v dt|/k [force length];
    wrongly without what the surface moves from the last instant to the first."""
    n_time = len(y)
    pressure = np.maximum(-y[:, 2], 0.0)
    step = k * np.array([contact["speed_1"][i], 0.0]) * 2.0 * np.pi / (omega * n_time)
    x = np.zeros(2)
    for _ in range(400):
        start, total = x.copy(), 0.0
        for j in range(n_time):
            carried = x + step * (j > 0 or at_turn)
            d, limit = y[j, :2] - carried, mu * pressure[j]
            length = np.hypot(*d)
            x = carried if length <= limit else y[j, :2] - d * (limit / length)
            total += 0.5 * (pressure[j] + pressure[j - 1]) * np.hypot(*(x - carried))
        if np.abs(x - start).max() <= 1e-13 * np.abs(y).max():
            break
    return total / k


@pytest.mark.parametrize("speed", [0.01, -0.05, 0.4])
def test_wear_on_the_path(tmp_path, speed):
    groups = worn(merged(oracle("v4_rub_path"), {
        "sweep": {"start": 100.0}, "contact": {"speed_1": [speed, 0.5 * speed],
                                               # It bears at the turn.
                                               "gap": [-0.002, 0.0009]}}))
    run(tmp_path, groups)
    found, contact = read(tmp_path / "case.h5"), groups["contact"]
    angles = 2.0 * np.pi * np.arange(256) / 256
    for row in range(len(found["wear/cycles"])):
        u = motion(found["coefficients"][row], contact["side_1"])
        wanted, wrong = np.zeros(2), np.zeros(2)
        for i in range(2):
            y = (u[:, i].T @ waves(9, angles)).T
            for pair, n, size, phase in zip(*(contact[f"gap_{key}"] for key in (
                    "pair", "harmonic", "amplitude", "phase")), strict=True):
                if pair in {0, i + 1}:
                    y[:, 2] += size * np.cos(n * angles + np.radians(phase))
            y[:, 2] += contact["gap"][i] + found["wear/depth"][row, i]
            k = contact["tangential_stiffness"][i]
            y *= np.array([k, k, contact["normal_stiffness"][i]])
            wanted[i], wrong[i] = (1e-5 / 2.0 * marched(
                contact, i, y, k, 100.0, contact["mu"][i], right) for right in (True, False))
        assert wanted.max() > 0.0
        assert found["wear/rate"][row] == pytest.approx(wanted, rel=ROUND_OFF)
        assert np.abs(wrong - wanted).max() > 1e3 * ROUND_OFF * wanted.max()


def work(force, moved):
    return sum(np.pi * n * np.sum(force[2 * n - 1] * moved[2 * n] - force[2 * n] * moved[2 * n - 1])
               for n in range(1, (len(force) + 1) // 2))


def balance_of_work(found, row, groups):
    """Loads + obstacle - friction - damping, and the size of its terms."""
    u, omega = found["coefficients"][row], found["omega"][row]
    n_dof = groups["model"]["n_dof"]
    load = np.zeros_like(u)
    load[1], load[2] = groups["load"]["cosine"], groups["load"]["sine"]
    damping = np.reshape(groups["model"]["damping"], (n_dof, n_dof))
    lost = sum(np.pi * n**2 * omega * a @ damping @ a for n in range(1, (len(u) + 1) // 2)
               for a in (u[2 * n - 1], u[2 * n]))
    brought = work(load, u) + found["contact/obstacle_work"][row].sum()
    heat = found["contact/dissipation"][row]
    return brought - lost - heat.sum(), abs(lost) + np.abs(heat).sum()


@pytest.mark.parametrize("law", LAWS)
def test_work_is_balanced_while_it_wears(tmp_path, law):
    cases = [worn(steady(law))]
    if law == "penalty":
        cases.append(worn(merged(oracle("v4_rub_path"), {"sweep": {"start": 100.0}})))
    for groups in cases:
        run(tmp_path, groups)
        found = read(tmp_path / "case.h5")
        for row in range(len(found["omega"])):
            missing, size = balance_of_work(found, row, groups)
            assert abs(missing) < ROUND_OFF * size


def remarks(path):
    with h5py.File(path) as file:
        if "remarks/name" not in file:
            return {}
        return {name.decode(): text.decode() for name, text in zip(
            file["remarks/name"][()], file["remarks/text"][()], strict=True)}


def fastest(found, groups, direction):
    """The largest velocity of each pair along a direction, on a fine grid."""
    u = motion(found["coefficients"][0], groups["contact"]["side_1"])
    angles = 2.0 * np.pi * np.arange(20000) / 20000
    return [found["omega"][0] * np.abs(rate_of(u[:, i, :2] @ direction) @ waves(9, angles)).max()
            for i in range(u.shape[1])]


@pytest.mark.parametrize("law", ("penalty", "dlft"))
def test_remark_where_sliding_may_turn(tmp_path, law):
    """The speed just above and just below the fastest vibration along it, which is that of one pair;
    friction depends on its direction alone."""
    direction = np.array([30.0, -8.0]) / np.hypot(30.0, 8.0)
    groups = steady(law)
    run(tmp_path, groups)
    rates = fastest(read(tmp_path / "case.h5"), groups, direction)
    assert "sliding may turn" not in remarks(tmp_path / "case.h5")
    pair = int(np.argmax(rates))
    for share, said in ((1.0 + 1e-6, False), (1.0 - 1e-6, True)):
        speed = share * rates[pair] * direction
        run(tmp_path, steady(law, speed_1=[speed[0]] * 2, speed_2=[speed[1]] * 2))
        found = remarks(tmp_path / "case.h5")
        assert ("sliding may turn" in found) == said
        if said:
            assert f"at pair {pair + 1}:" in found["sliding may turn"]
            assert "up to 1.00" in found["sliding may turn"] or \
                "up to 1 times" in found["sliding may turn"]
    # On the path friction turns round by itself.
    if law == "penalty":
        run(tmp_path, steady(law, speed_1=[0.1] * 2, speed_2=[0.0] * 2, sliding="path"))
        assert "sliding may turn" not in remarks(tmp_path / "case.h5")


def ahead(n_pairs, ahead_of, speed=0.05):
    """Masses on springs, each with a tangential and a normal dof: the first is pressed most while it
    runs with the surface (ahead_of = 1) or against it (-1), twenty times as fast."""
    n = 2 * n_pairs
    cosine, sine = np.zeros((n_pairs, 2)), np.zeros((n_pairs, 2))
    cosine[:, 0] = [1.0] + [0.01] * (n_pairs - 1)
    sine[:, 1] = 0.9 * ahead_of
    return {"case": {"analysis": "wear"},
            "model": {"n_dof": n, "mass": 1e-3 * np.eye(n).ravel(), "stiffness": np.eye(n).ravel(),
                      "damping": 0.01 * np.eye(n).ravel()},
            "contact": {"n_pairs": n_pairs, "law": "penalty", "mu": 0.1, "area": 1.0,
                        "side_1": [k for i in range(n_pairs) for k in (2 * i + 1, 0, 2 * i + 2)],
                        "tangential_stiffness": 1.0, "normal_stiffness": 1.0,
                        "sliding": "steady", "speed_1": [speed] * n_pairs},
            "load": {"static": [0.0, -1.0] * n_pairs, "cosine": cosine.ravel(),
                     "sine": sine.ravel()},
            "harmonics": {"n_harmonics": 3, "n_time": 256}, "sweep": {"start": 1.0},
            "wear": {"coefficient": 1e-3, "n_cycles": 100}}


@pytest.mark.parametrize("n_pairs", (1, 2))
def test_a_depth_that_falls_is_no_steady_state(tmp_path, n_pairs):
    """What slides by S < 0 would grow: said, and neither a steady state nor an end that was
    reached."""
    groups = ahead(n_pairs, 1.0)
    run(tmp_path, groups, status=4)
    found = read(tmp_path / "case.h5")
    wanted = slides(found, 0, groups)
    assert wanted[0] < 0.0 and all(other > 0.0 for other in wanted[1:])
    assert found["wear/rate"][0, 0] < 0.0 and len(found["wear/cycles"]) == 1
    assert found["wear"]["ending"].startswith("pair 1 would gain")
    assert found["wear"]["steady_state"] == "not reached"
    run(tmp_path, ahead(n_pairs, -1.0))
    found = read(tmp_path / "case.h5")
    assert (np.diff(found["wear/depth"], axis=0) > 0.0).all()
    groups["contact"]["sliding"] = "path"
    run(tmp_path, groups)
    assert (read(tmp_path / "case.h5")["wear/rate"] > 0.0).all()


def test_no_remark_of_a_pair_that_never_touches(tmp_path):
    groups = steady("penalty", gap=[1.0, 1.0], speed_1=[1e-4] * 2, speed_2=[0.0] * 2)
    run(tmp_path, groups)
    assert "sliding may turn" not in remarks(tmp_path / "case.h5")


# Other laws beside those that slide, and what friction does with its speed, are no part of it.
@pytest.mark.parametrize(("change", "message"), [
    ({"law": ["penalty", "iwan"], "iwan_chi": -0.5, "iwan_beta": 1.0, "normal_load": 3.0,
      "side_1": [4, 5, 6, 7, 0, 0], "n_gap_terms": 0},
     "speed_1 = 30.0000 for pair 2 with law = 'iwan', which knows no side that slides"),
    ({"law": "regularised", "slip_speed": 0.02, "mu_dynamic": 0.1, "weakening_speed": 1.0},
     "mu_dynamic beside sliding = 'steady'"),
    ({"law": "regularised", "slip_speed": 0.02, "mu_viscous": 0.1},
     "mu_viscous beside sliding = 'steady'"),
    # Its heat along a direction that is not there would be left out.
    ({"law": "penalty", "side_1": [4, 0, 6, 7, 0, 9]}, "for pair 1, which has no dof of t2"),
    # One law that carries anchors along does not speak for another.
    ({"law": ["regularised", "rigid"], "slip_speed": 0.02, "speed_2": [0.0, 0.0],
      "sliding": "path"}, "a speed of pair 2, whose anchor that law does not carry along")])
def test_refusals(tmp_path, change, message):
    first = change["law"] if isinstance(change["law"], str) else change["law"][0]
    groups = steady(first)
    groups["contact"] |= change
    if "rigid" in change["law"]:
        groups["harmonics"] = {"n_harmonics": 9}
    if groups["contact"]["n_gap_terms"] == 0:
        for key in ("n_gap_terms", "gap_pair", "gap_harmonic", "gap_amplitude", "gap_phase"):
            del groups["contact"][key]
    done = run(tmp_path, groups, status=3)
    assert message in done.stderr, done.stderr


@pytest.mark.parametrize("law", ("penalty", "dlft", "regularised"))
def test_integration_in_time_agrees(tmp_path, law):
    """A program part of its own, which has the direction of the surface from the case."""
    balance, n = steady(law), 25
    if law == "dlft":
        # Of nodes without mass, whose forces fall faster: 3.3e-4 with H = 25, 8.5e-5 with 99.
        balance, n = merged(oracle("v7_rub_rigid"), {
            "contact": {"sliding": "steady"}, "sweep": {"start": 100.0}}), 99
    balance["harmonics"] |= {"n_harmonics": n, "n_time": 1024}
    march = merged(balance, {"case": {"analysis": "time"}, "solver": {"tolerance": 1e-9},
                             "time": {"steps_per_period": 1024, "n_periods": 400}})
    march["harmonics"] = {"n_harmonics": n}
    found = run_case(tmp_path, balance)
    wanted = run_case(tmp_path, march)
    scale = np.abs(wanted.coefficients).max()
    assert np.abs(found.coefficients - wanted.coefficients).max() < 1e-4 * scale
    for name in ("dissipation", "obstacle_work"):
        heat = getattr(wanted, name)
        # Of rigid pairs the steps have it to first order: 6e-3.
        assert np.abs(getattr(found, name) - heat).max() < (
            2e-2 if law == "dlft" else 1e-3) * np.abs(heat).max()


@pytest.mark.parametrize("law", ["penalty", "dlft"])
def test_closed_modes_are_free_along_a_side_that_slides(tmp_path, law):
    stiffness = np.array([[2.0, -1.0], [-1.0, 2.0]])
    groups = {"case": {"analysis": "modes"},
              "model": {"n_dof": 2, "mass": np.eye(2), "stiffness": stiffness},
              "contact": {"n_pairs": 1, "law": law, "side_1": [1, 0, 2], "mu": 0.3,
                          "sliding": "steady", "speed_1": 1.0}}
    if law == "penalty":
        groups["contact"] |= {"tangential_stiffness": 30.0, "normal_stiffness": 4.0}
    run(tmp_path, groups)
    wanted = np.sqrt(np.linalg.eigvalsh(stiffness + np.diag([0.0, 4.0]))[0]) \
        if law == "penalty" else np.sqrt(2.0)
    assert read(tmp_path / "case.h5")["modes/closed"][0, 0] == pytest.approx(wanted, rel=1e-9)
