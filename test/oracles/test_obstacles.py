"""Obstacles that move: gaps in harmonics and a side that slides.

test/reference/bodies/v4 .. v7: harmonic balances of a march at stated instants, of other origin:
elastic friction on the path, steady sliding in two directions, smooth and rigid friction.
"""
import copy
import json

import h5py
import numpy as np
import pytest
from cases import merged, run
from oracle_runs import run_case
from project import ROOT

NAMES = ("v4_rub_path", "v5_rub_steady", "v6_rub_regularised", "v7_rub_rigid")


def oracle(name):
    return json.loads((ROOT / f"test/reference/bodies/{name}.json").read_text())


def at(groups, omega, **others):
    """The case at a frequency, with contact keys replaced."""
    case = merged(copy.deepcopy(groups), {"sweep": {"start": omega}})
    for key, value in others.items():
        case["contact"][key] = value
    return case


def distance(found, wanted):
    return np.abs(np.asarray(found) - np.asarray(wanted)).max() / np.abs(wanted).max()


@pytest.mark.parametrize("name", NAMES)
def test_reference_is_met(tmp_path, name):
    reference = oracle(name)
    for point in reference["points"]:
        found = run_case(tmp_path, at(reference["groups"], point["omega"]))
        assert found.converged.all()
        assert distance(found.coefficients[0], point["u"]) < reference["tolerance"]
        assert distance(found.force[0], point["force"]) < reference["tolerance"]


# Wrong variants differ by far more than the tolerance: phases turned, the speed turned or left out.
@pytest.mark.parametrize("name", NAMES)
def test_reference_tells_wrong_variants(tmp_path, name):
    reference = oracle(name)
    contact, point = reference["groups"]["contact"], reference["points"][0]
    for change in ({"gap_phase": [-p for p in contact["gap_phase"]]},
                   {"speed_1": [-v for v in contact["speed_1"]]}):
        found = run_case(tmp_path, at(reference["groups"], point["omega"], **change))
        assert distance(found.coefficients[0], point["u"]) > 1e-3


def test_harmonic_0_is_the_gap(tmp_path):
    groups = oracle("v4_rub_path")["groups"]
    contact = groups["contact"]
    wanted = run_case(tmp_path, at(groups, 100.0, gap=[g + 1e-4 for g in contact["gap"]]))
    found = run_case(tmp_path, at(
        groups, 100.0, n_gap_terms=3, gap_pair=[0, 2, 0], gap_harmonic=[1, 2, 0],
        gap_amplitude=[*contact["gap_amplitude"], 2e-4], gap_phase=[*contact["gap_phase"], 60.0]))
    assert distance(found.coefficients, wanted.coefficients) < 1e-10


# Nothing but the surface moves along the face: the pair stays pressed and the motion is closed form.
@pytest.mark.parametrize("contact", (
    {"sliding": "path"}, {"sliding": "steady"}, {"sliding": "steady", "speed_1": [-5.0]},
    {"sliding": "path", "gap_amplitude": [0.0]}))
def test_a_surface_drags_what_no_load_moves(tmp_path, contact):
    mu, press, omega = 0.3, 0.1, 0.4
    found = run_case(tmp_path, {
        "case": {"analysis": "point"},
        "model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 1.0], "stiffness": [1.0, 0.0, 0.0, 2.0],
                  "damping": [0.04, 0.0, 0.0, 0.04]},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 2], "mu": [mu],
                    "tangential_stiffness": [1.0], "normal_stiffness": [1.0], "gap": [-press],
                    "n_gap_terms": 1, "gap_harmonic": [2], "gap_amplitude": [0.02],
                    "speed_1": [5.0], **contact},
        "harmonics": {"n_harmonics": 3}, "sweep": {"start": omega},
        "output": {"observe": [1, 2]}})

    def stiffness(k):
        return k - (2.0 * omega) ** 2 + 0.04j * 2.0 * omega

    amplitude = contact.get("gap_amplitude", [0.02])[0]
    normal = np.array([press / 3.0, -amplitude / stiffness(3.0)])
    pressure = np.array([press, -amplitude]) - normal
    drag = mu * np.sign(contact.get("speed_1", [5.0])[0]) * pressure
    wanted = np.zeros((7, 2))
    for dof, (mean, wave) in enumerate(((drag[0], drag[1] / stiffness(1.0)), normal)):
        wanted[[0, 3, 4], dof] = np.real(mean), np.real(wave), -np.imag(wave)
    assert distance(found.coefficients[0], wanted) < 1e-9


def shifted(coefficients, angle):
    """The motion of tau - angle."""
    moved = np.array(coefficients)
    for n in range(1, (len(moved) + 1) // 2):
        c, s = np.cos(n * angle), np.sin(n * angle)
        a, b = coefficients[2 * n - 1], coefficients[2 * n]
        moved[2 * n - 1], moved[2 * n] = c * a - s * b, s * a + c * b
    return moved


# By whole instants, so that the march meets the same values: 32 of 256.
@pytest.mark.parametrize("name", ("v4_rub_path", "v5_rub_steady", "v7_rub_rigid"))
def test_a_shift_of_all_phases_shifts_the_motion(tmp_path, name):
    groups = oracle(name)["groups"]
    angle = 2.0 * np.pi * 32 / 256
    plain = run_case(tmp_path, at(groups, 100.0))
    load = {"cosine": np.zeros(9), "sine": np.zeros(9)}
    for i in range(9):
        load["cosine"][i], load["sine"][i] = shifted(
            np.array([0.0, groups["load"]["cosine"][i], groups["load"]["sine"][i]]), angle)[1:]
    contact = groups["contact"]
    phase = [p - n * np.degrees(angle)
             for p, n in zip(contact["gap_phase"], contact["gap_harmonic"], strict=True)]
    moved = at(groups, 100.0, gap_phase=phase)
    moved["load"] |= {key: list(value) for key, value in load.items()}
    found = run_case(tmp_path, moved)
    assert distance(found.coefficients[0], shifted(plain.coefficients[0], angle)) < 1e-9


def test_the_speed_turns_with_its_direction(tmp_path):
    groups = oracle("v4_rub_path")["groups"]
    wanted = run_case(tmp_path, at(groups, 100.0))
    found = run_case(tmp_path, at(groups, 100.0, side_1=[-4, 0, 6, -7, 0, 9],
                                  speed_1=[-0.05, -0.05]))
    assert distance(found.coefficients, wanted.coefficients) < 1e-10


def work(force, motion):
    """Of coefficients of a force and of a displacement, over a period."""
    return sum(np.pi * n * np.sum(force[2 * n - 1] * motion[2 * n] -
                                  force[2 * n] * motion[2 * n - 1])
               for n in range(1, (len(force) + 1) // 2))


@pytest.mark.parametrize("name", NAMES)
def test_loads_and_obstacle_feed_friction_and_damping(tmp_path, name):
    groups = oracle(name)["groups"]
    n_dof = groups["model"]["n_dof"]
    for omega in (60.0, 140.0):
        found = run_case(tmp_path, at(groups, omega))
        u = found.coefficients[0]
        load = np.zeros_like(u)
        load[1], load[2] = groups["load"]["cosine"], groups["load"]["sine"]
        damping = np.reshape(groups["model"]["damping"], (n_dof, n_dof))
        lost = sum(np.pi * n**2 * omega * a @ damping @ a
                   for n in range(1, (len(u) + 1) // 2) for a in (u[2 * n - 1], u[2 * n]))
        brought = work(load, u) + found.obstacle_work.sum()
        assert abs(found.obstacle_work).max() > 1e-3 * abs(found.dissipation).max()
        assert abs(brought - lost - found.dissipation.sum()) < 1e-9 * (abs(lost) + abs(
            found.dissipation).sum())


# Heat of steady sliding: mu p times the sliding velocity |v| - du/dt . v/|v|.
def test_heat_of_steady_sliding(tmp_path):
    groups = oracle("v5_rub_steady")["groups"]
    omega = 100.0
    found = run_case(tmp_path, at(groups, omega))
    direction = np.array([30.0, -8.0]) / np.hypot(30.0, 8.0)
    for pair in range(2):
        pressure = -found.force[0][:, pair, 2]
        along = found.coefficients[0][:, 3 + 3 * pair:5 + 3 * pair] @ direction
        mu = groups["contact"]["mu"][pair]
        heat = mu * (2.0 * np.pi / omega * np.hypot(30.0, 8.0) * pressure[0] -
                     work(pressure, along))
        # What 256 instants leave of the work of normal forces, which is none: 4e-6 here.
        assert abs(found.dissipation[0, pair] / heat - 1.0) < 5e-5
        assert np.allclose(found.fraction[0, pair, 0], 0.0)


# Friction in two directions turns with the vibration: the difference falls with 1/v.
def test_steady_sliding_is_the_limit_of_the_path(tmp_path):
    groups = oracle("v5_rub_steady")["groups"]
    errors = []
    for speed in (1.0, 10.0, 100.0):
        path, steady = (run_case(tmp_path, at(groups, 100.0, speed_1=[speed, speed],
                                              speed_2=[-0.3 * speed, -0.3 * speed],
                                              sliding=word)).coefficients
                        for word in ("path", "steady"))
        errors.append(distance(path, steady))
    assert errors[0] < 0.05
    assert errors[1] < 0.3 * errors[0] and errors[2] < 0.3 * errors[1]


def test_a_speed_of_nothing_changes_nothing(tmp_path):
    groups = oracle("v4_rub_path")["groups"]
    without = at(groups, 100.0)
    del without["contact"]["speed_1"]
    found = run_case(tmp_path, at(groups, 100.0, speed_1=[0.0, 0.0])).coefficients
    assert np.array_equal(found, run_case(tmp_path, without).coefficients)


# A branch needs dR/d omega: on the way a wrong one would cost steps or fail.
@pytest.mark.parametrize("name", NAMES)
def test_a_branch_goes_through_the_points(tmp_path, name):
    reference = oracle(name)
    point = reference["points"][1]
    groups = merged(copy.deepcopy(reference["groups"]), {
        "case": {"analysis": "frf"},
        "sweep": {"start": point["omega"], "end": point["omega"] + 10.0,
                  "continuation": "arclength"}})
    found = run_case(tmp_path, groups)
    assert found.converged.all() and len(found.omega) > 3
    assert distance(found.coefficients[0], point["u"]) < reference["tolerance"]


@pytest.mark.parametrize("law", ("penalty", "dlft", "rigid"))
def test_orders_and_harmonics_agree(tmp_path, law):
    groups = oracle("v4_rub_path")["groups"]
    contact = groups["contact"]
    del contact["speed_1"]
    if law != "penalty":
        del contact["tangential_stiffness"], contact["normal_stiffness"]
        groups["harmonics"]["sampling"] = "auto"
        del groups["harmonics"]["n_time"]
    contact["law"] = law
    wanted = run_case(tmp_path, at(groups, 100.0))
    del contact["gap_harmonic"]
    contact["gap_order"] = [1, 2]
    found = run_case(tmp_path, at(groups, 100.0))
    assert np.array_equal(found.coefficients, wanted.coefficients)


def by_events(groups):
    events = merged(copy.deepcopy(groups), {"harmonics": {"sampling": "events"}})
    del events["harmonics"]["n_time"]
    return events


# Events decide between the instants: 4096 of them come near, whatever the surface does. From slow,
# where a pair sticks for most of a turn, to fast, where it never does.
@pytest.mark.parametrize("speed", [0.0, 1e-4, -0.01, 0.05, -0.3, 5.0])
@pytest.mark.parametrize("law", ("penalty", "dlft", "dlft_velocity"))
def test_events_agree_with_many_instants(tmp_path, law, speed):
    groups = oracle("v4_rub_path")["groups"]
    groups["contact"] |= {"law": law, "speed_1": [speed, -0.3 * speed]}
    if law != "penalty":
        del groups["contact"]["tangential_stiffness"], groups["contact"]["normal_stiffness"]
    fine = at(groups, 100.0)
    fine["harmonics"]["n_time"] = 4096
    found, wanted = run_case(tmp_path, by_events(at(groups, 100.0))), run_case(tmp_path, fine)
    assert distance(found.coefficients, wanted.coefficients) < 1e-5
    assert distance(found.force, wanted.force) < 1e-4
    assert distance(found.dissipation, wanted.dissipation) < 1e-4
    assert distance(found.fraction, wanted.fraction) < 2e-3


# Both tangential directions, where instants come near in the first order: extrapolated they agree.
@pytest.mark.parametrize("speed", [1e-3, -0.05, 2.0])
@pytest.mark.parametrize("law", ("penalty", "dlft", "dlft_velocity"))
def test_events_in_two_directions_are_the_limit_of_instants(tmp_path, law, speed):
    groups = oracle("v4_rub_path")["groups"]
    groups["contact"] |= {"law": law, "side_1": [4, 5, 6, 7, 8, 9], "speed_1": [speed, -speed],
                          "speed_2": [0.4 * speed, 0.7 * speed]}
    if law != "penalty":
        del groups["contact"]["tangential_stiffness"], groups["contact"]["normal_stiffness"]
    found = run_case(tmp_path, by_events(at(groups, 100.0)))
    few, many = (run_case(tmp_path, merged(at(groups, 100.0), {"harmonics": {"n_time": n}}))
                 for n in (2048, 4096))
    assert found.converged.all()
    for name, near in (("coefficients", 1e-5), ("force", 1e-4), ("dissipation", 1e-4)):
        limit = 2.0 * np.asarray(getattr(many, name)) - np.asarray(getattr(few, name))
        assert distance(getattr(found, name), limit) < near
    # Loads and obstacle feed friction and damping.
    u = found.coefficients[0]
    load = np.zeros_like(u)
    load[1], load[2] = groups["load"]["cosine"], groups["load"]["sine"]
    damping = np.reshape(groups["model"]["damping"], (9, 9))
    lost = sum(np.pi * n**2 * 100.0 * a @ damping @ a
               for n in range(1, (len(u) + 1) // 2) for a in (u[2 * n - 1], u[2 * n]))
    brought = work(load, u) + found.obstacle_work.sum()
    assert abs(brought - lost - found.dissipation.sum()) < 1e-6 * (abs(lost) + abs(
        found.dissipation).sum())


# A surface that slides changes forces by itself with the frequency: a branch needs dR/d omega.
@pytest.mark.parametrize("law", ("penalty", "dlft", "dlft_velocity"))
def test_a_branch_by_events(tmp_path, law):
    groups = oracle("v4_rub_path")["groups"]
    groups["contact"] |= {"law": law}
    if law != "penalty":
        del groups["contact"]["tangential_stiffness"], groups["contact"]["normal_stiffness"]
    case = merged(by_events(groups), {"case": {"analysis": "frf"}, "sweep": {
        "start": 100.0, "end": 105.0, "continuation": "arclength"}})
    found = run_case(tmp_path, case)
    assert found.converged.all() and len(found.omega) > 3
    # Newton's method takes few steps with the exact derivative of such a path.
    with h5py.File(tmp_path / "case.h5") as file:
        assert file["iterations"][1:].max() <= 8


@pytest.mark.parametrize("law", ("penalty", "dlft"))
def test_wear_by_events(tmp_path, law):
    groups = oracle("v4_rub_path")["groups"]
    groups["contact"] |= {"law": law, "area": 2.0}
    if law != "penalty":
        del groups["contact"]["tangential_stiffness"], groups["contact"]["normal_stiffness"]
    worn = merged(at(groups, 100.0), {"case": {"analysis": "wear"}, "wear": {
        "coefficient": 1e-5, "n_cycles": 2, "error_tolerance": 1e-3}})
    depths = []
    for case in (by_events(worn), merged(worn, {"harmonics": {"n_time": 4096}})):
        run_case(tmp_path, case)
        with h5py.File(tmp_path / "case.h5") as file:
            depths.append(file["wear/depth"][-1])
    assert depths[0].min() > 1e-9
    assert distance(depths[0], depths[1]) < 1e-4


# Paths have no instants: a shift by any angle is exact.
@pytest.mark.parametrize("law", ("penalty", "dlft", "dlft_velocity"))
def test_paths_by_events_shift(tmp_path, law):
    groups = oracle("v4_rub_path")["groups"]
    contact = groups["contact"]
    contact["law"] = law
    if law != "penalty":
        del contact["tangential_stiffness"], contact["normal_stiffness"]
    angle = 1.234
    plain = run_case(tmp_path, by_events(at(groups, 100.0)))
    moved = by_events(at(groups, 100.0, gap_phase=[
        p - n * np.degrees(angle) for p, n in zip(contact["gap_phase"], contact["gap_harmonic"],
                                                  strict=True)]))
    c, s = (np.array(groups["load"][key]) for key in ("cosine", "sine"))
    moved["load"] |= {"cosine": np.cos(angle) * c - np.sin(angle) * s,
                      "sine": np.sin(angle) * c + np.cos(angle) * s}
    found = run_case(tmp_path, moved)
    assert distance(found.coefficients[0], shifted(plain.coefficients[0], angle)) < 1e-9


# Central differences of solutions to 1e-13 with a step of 1e-5: 1e-8 at worst, with a margin of ten.
@pytest.mark.parametrize("sliding", [{}, {"speed_1": 0.7}, {"speed_1": 3.0, "sliding": "steady"}])
@pytest.mark.parametrize(("law", "sampling"), [
    ({"law": "penalty", "tangential_stiffness": 1.5, "normal_stiffness": 2.0}, "uniform"),
    ({"law": "penalty", "tangential_stiffness": 1.5, "normal_stiffness": 2.0}, "events"),
    ({"law": "regularised", "slip_speed": 0.2, "normal_stiffness": 2.0}, "uniform")])
def test_derivatives_are_those_of_differences(tmp_path, law, sampling, sliding):
    case = {
        "case": {"analysis": "point"},
        "model": {"n_dof": 2, "mass": np.diag([1.0, 1.3]), "damping": np.diag([0.1, 0.12]),
                  "stiffness": np.array([[4.0, -1.0], [-1.0, 5.0]])},
        "contact": {"n_pairs": 1, "side_1": [1, 0, 2], "mu": 0.3, "gap": 0.1, "n_gap_terms": 2,
                    "gap_harmonic": [1, 2], "gap_amplitude": [0.15, 0.05],
                    "gap_phase": [30.0, -20.0], **law, **sliding},
        "load": {"cosine": [1.0, 0.6], "static": [0.0, -0.8]},
        "harmonics": {"n_harmonics": 9, "n_time": 1024, "sampling": "uniform"},
        "sweep": {"start": 1.9}, "solver": {"tolerance": 1e-13}}
    if sampling == "events":
        case["harmonics"] = {"n_harmonics": 9, "sampling": "events"}
    quantities = ["first_harmonic", "dissipation"]
    told = merged(case, {"sensitivity": {"parameters": ["contact%mu", "contact%gap"],
                                         "quantities": quantities}})
    run(tmp_path, told)
    with h5py.File(tmp_path / "case.h5") as file:
        slopes = {(q, key): file[f"sensitivity/{q}/contact_{key}"][()].ravel()
                  for q in quantities for key in ("mu", "gap")}
    step = 1e-5
    for key in ("mu", "gap"):
        ends = [run_case(tmp_path, at(case, 1.9, **{key: case["contact"][key] + by}))
                for by in (-step, step)]
        first = [np.hypot(*end.coefficients[0][1:3]) for end in ends]
        assert distance(slopes["first_harmonic", key], (first[1] - first[0]) / (2 * step)) < 1e-7
        heat = [end.dissipation.sum() for end in ends]
        assert distance(slopes["dissipation", key], (heat[1] - heat[0]) / (2 * step)) < 1e-7


# Another program part, which shares the pairs alone: 7e-6 with H = 25. Where friction turns round
# within v_0 it is 2.9e-4 with H = 25, 6.2e-5 with 49 and 1.5e-6 with 99, whatever the steps and
# instants: harmonics that are left out.
@pytest.mark.parametrize(("name", "n_harmonics", "n_steps"), [
    ("v4_rub_path", 25, 2048), ("v6_rub_regularised", 49, 1024)])
def test_integration_in_time_agrees(tmp_path, name, n_harmonics, n_steps):
    groups = oracle(name)["groups"]
    balance = at(groups, 100.0)
    balance["harmonics"] |= {"n_harmonics": n_harmonics, "n_time": 2048}
    march = merged(balance, {"case": {"analysis": "time"}, "solver": {"tolerance": 1e-8},
                             "time": {"steps_per_period": n_steps, "n_periods": 400}})
    march["harmonics"] = {"n_harmonics": n_harmonics}
    found, wanted = run_case(tmp_path, balance), run_case(tmp_path, march)
    assert distance(found.coefficients, wanted.coefficients) < 1e-4
    assert distance(found.dissipation, wanted.dissipation) < 1e-3
    assert distance(found.obstacle_work, wanted.obstacle_work) < 1e-3


# What parts balance and march is the harmonics that are left out: it falls with their number, by the
# order of forces that turn within v_0 (measured 2.1), and of rigid friction, which sticks and slips
# with kinks in its force (measured 1.6); and balances differ from one another as from the march. That
# of the rigid law is of first order in its steps: 3e-5 by 16,384, a quarter of the last difference.
@pytest.mark.parametrize(("name", "n_steps", "n_time", "order"), [
    ("v6_rub_regularised", 4096, 4096, 2.0), ("v7_rub_rigid", 16384, 8192, 1.3)])
def test_harmonics_left_out_part_balance_and_march(tmp_path, name, n_steps, n_time, order):
    groups, numbers = at(oracle(name)["groups"], 100.0), (25, 49, 99)
    march = merged(groups, {"case": {"analysis": "time"}, "solver": {"tolerance": 1e-8},
                            "time": {"steps_per_period": n_steps, "n_periods": 400}})
    march["harmonics"] = {"n_harmonics": 25}
    wanted = run_case(tmp_path, march).coefficients
    found = []
    for n in numbers:
        groups["harmonics"] |= {"n_harmonics": n, "n_time": n_time}
        found.append(run_case(tmp_path, groups).coefficients[:, :51])
    apart = [distance(one, wanted) for one in found]
    assert np.log(apart[0] / apart[2]) / np.log(numbers[2] / numbers[0]) > order
    # The balances know nothing of the march: what is left of it is within their own difference.
    assert distance(found[0], found[2]) > 0.7 * apart[0]
    assert apart[2] < distance(found[1], found[2])


# Harmonics that are chosen, against twice the most of them at many instants.
@pytest.mark.parametrize(("name", "sliding"), [
    ("v4_rub_path", "path"), ("v5_rub_steady", "steady"), ("v7_rub_rigid", "path")])
def test_the_error_is_within_its_bound(tmp_path, name, sliding):
    groups = at(oracle(name)["groups"], 100.0, sliding=sliding)
    groups["solver"]["tolerance"] = 1e-10
    chosen, fine = copy.deepcopy(groups), copy.deepcopy(groups)
    chosen["harmonics"] = {"accuracy": 1e-2, "n_harmonics": 61}
    fine["harmonics"] |= {"n_harmonics": 121, "n_time": 4096}
    found = run_case(tmp_path, chosen)
    with h5py.File(tmp_path / "case.h5") as file:
        bound = file["error_estimate"][0]
    wanted = run_case(tmp_path, fine).coefficients[0]
    low = np.zeros_like(wanted)
    low[:len(found.coefficients[0])] = found.coefficients[0]
    assert distance(low, wanted) < bound <= 1e-2


# A wave is that of all sectors, each with its gap later than the one before: by 128 of 320 instants.
def test_a_wave_is_that_of_all_sectors(tmp_path):
    case = {
        "case": {"analysis": "point"},
        "model": {"n_dof": 3, "mass": np.diag([0.5, 1.0, 0.5]), "stiffness": np.array(
            [[2.0, -1.0, -0.5], [-1.0, 2.0, -1.0], [-0.5, -1.0, 2.0]]),
            "damping": 0.05 * np.eye(3)},
        "cyclic": {"n_sectors": 5, "engine_order": 2, "n_interface": 1,
                   "left": 1, "right": 3},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [0, 0, 2], "gap": 0.2,
                    "normal_stiffness": 1.5, "n_gap_terms": 2, "gap_harmonic": [1, 3],
                    "gap_amplitude": [0.5, 0.3], "gap_phase": [0.0, 70.0]},
        "load": {"cosine": [0.0, 0.5, 0.0]},
        "harmonics": {"n_harmonics": 7, "n_time": 320, "sampling": "uniform"},
        "sweep": {"start": 1.1}, "solver": {"tolerance": 1e-12}}
    wave = run_case(tmp_path, case)
    disk = run_case(tmp_path, merged(case, {"cyclic": {"mistuned": True}}))
    assert distance(disk.force[0][:, 0], wave.force[0][:, 0]) < 1e-9
    later = shifted(wave.force[0][:, 0, 2], 2.0 * np.pi * 2 / 5)
    assert distance(disk.force[0][:, 1, 2], later) < 1e-9


def bad(**contact):
    return {"contact": contact}


@pytest.mark.parametrize(("change", "message"), [
    (bad(n_gap_terms=0), "n_gap_terms"),
    (bad(gap_pair=[3, 1]), "gap_pair of term 1 is 3: must be 0, for all, to 2"),
    (bad(gap_harmonic=[1, 12]), "harmonics%n_harmonics = 9, but a gap"),
    (bad(gap_order=[2, 4], gap_harmonic=None), "multiples of 2, beside loads of order 1"),
    (bad(gap_order=[1, 2]), "given beside gap_harmonic"),
    (bad(sliding="steady", speed_1=None), "give speed_1 or speed_2"),
    (bad(law="rigid", tangential_stiffness=None, normal_stiffness=None), "'steady'"),
    (bad(sliding="along"), "sliding"),
    (bad(memory="carried"), "contact%memory = 'carried' does not go with"),
    ({"case": {"analysis": "mode"}, "mode": {"start": 1e-4, "end": 1e-3},
      "sweep": {"start": None}}, "a mode is a motion without excitation"),
    ({"sweep": {"stability": True}}, "sweep%stability = .true. does not go with a side 2 that slides"),
    ({"harmonics": {"parity": "odd"}}, "a moving side")])
def test_refusals(tmp_path, change, message):
    groups = at(oracle("v4_rub_path")["groups"], 100.0)
    for group, keys in change.items():
        for key, value in keys.items():
            if value is None:
                groups[group].pop(key, None)
            else:
                groups.setdefault(group, {})[key] = value
    if change.get("contact", {}).get("n_gap_terms") == 0:
        del groups["contact"]["n_gap_terms"]
    done = run(tmp_path, groups, status=3)
    assert message in done.stderr, done.stderr




# Of a tuned disk all sectors have the mean of their gaps, and what moves them later by its wave.
def test_a_tuned_population_is_the_wave(tmp_path):
    case = {
        "case": {"analysis": "frf"},
        "model": {"n_dof": 3, "mass": np.diag([0.5, 1.0, 0.5]), "stiffness": np.array(
            [[2.0, -1.0, -0.5], [-1.0, 2.0, -1.0], [-0.5, -1.0, 2.0]]),
            "damping": 0.05 * np.eye(3)},
        "cyclic": {"n_sectors": 5, "engine_order": 2, "n_interface": 1,
                   "left": 1, "right": 3},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [0, 0, 2], "gap": 0.2,
                    "normal_stiffness": 1.5, "n_gap_terms": 2, "gap_harmonic": [1, 3],
                    "gap_amplitude": [0.5, 0.3], "gap_phase": [0.0, 70.0]},
        "load": {"cosine": [0.0, 0.5, 0.0]}, "output": {"observe": 2},
        "harmonics": {"n_harmonics": 7, "n_time": 320, "sampling": "uniform"},
        "sweep": {"start": 1.0, "end": 1.2, "n_points": 5}, "solver": {"tolerance": 1e-12}}
    wave = run_case(tmp_path, case)
    assert wave.obstacle_work.any()
    gaps = [0.2, 0.25, 0.15, 0.3, 0.1]
    many = merged(case, {
        "case": {"analysis": "population"}, "cyclic": {"mistuned": True}, "contact": {"gap": gaps},
        "mistuning": {"n_rows": 1, "rows": [0.0, 1.0, 0.0], "row_omega": 1.3},
        "population": {"patterns": [0.02, -0.01, 0.0, 0.01, -0.02], "n_patterns": 1,
                       "peaks": False, "quantity": "largest"}})
    run(tmp_path, many)
    with h5py.File(tmp_path / "case.h5") as file:
        tuned = file["population/tuned"][()]
    assert np.max(tuned) == pytest.approx(wave.amplitude.max(), rel=1e-9)
