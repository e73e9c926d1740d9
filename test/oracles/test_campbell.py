"""Speed that follows the frequency along an engine order, and the Campbell diagram.

test/reference/blades/b5_speed.json is a sector with Coriolis forces, stiffening and loads that grow
with the speed, by a dense harmonic balance of other origin.
"""
import json

import h5py
import numpy as np
import pytest
from cases import run, with_model, write_parts
from project import ROOT

REFERENCE = json.loads((ROOT / "test/reference/blades/b5_speed.json").read_text())


def differences(path, expect):
    """Largest difference of each dataset, over its limit times its largest value."""
    with h5py.File(path) as file:
        for row in expect:
            values = np.array(row["value"], dtype=float)
            error = np.abs(file[row["dataset"]][()] - values).max()
            limit = row["limit"] * np.abs(values).max()
            yield row["dataset"], error, limit


@pytest.mark.parametrize("number", range(len(REFERENCE["runs"])))
def test_along_an_order(tmp_path, number):
    write_parts(tmp_path / "model.h5", REFERENCE["file"])
    wanted = REFERENCE["runs"][number]
    run(tmp_path, with_model(wanted["case"]))
    for name, error, limit in differences(tmp_path / "case.h5", wanted["expect"]):
        assert error <= limit, name


@pytest.mark.parametrize("number", [0, 1])
def test_a_row_of_an_order_line_is_a_point_of_that_speed(tmp_path, number):
    write_parts(tmp_path / "model.h5", REFERENCE["file"])
    case = with_model(REFERENCE["runs"][number]["case"])
    run(tmp_path, case)
    with h5py.File(tmp_path / "case.h5") as file:
        rows, speeds = file["coefficients"][()], file["speed"][()]
    order = case["sweep"]["speed_order"]
    for k, omega in enumerate(case["sweep"]["frequencies"]):
        assert speeds[k] == pytest.approx(omega / order, rel=1e-14)
        fixed = {**case, "case": {"analysis": "point"}, "sweep": {"start": omega},
                 "model": {**case["model"], "rotation_speed": omega / order}}
        run(tmp_path, fixed)
        with h5py.File(tmp_path / "case.h5") as file:
            point = file["coefficients"][0]
        assert np.abs(rows[k] - point).max() <= 1e-10 * np.abs(point).max()


@pytest.mark.parametrize("law", ["penalty", "rigid", "dlft"])
def test_a_branch_leaves_in_the_direction_of_its_points(tmp_path, law):
    """dR/d omega with normal loads that grow with the speed: tangents against differences."""
    datasets = {"mass": np.diag([1.0, 0.6]), "stiffness": [[2.0, -0.8], [-0.8, 1.4]],
                "damping": 0.06 * np.eye(2), "stiffness_rotation": np.diag([0.1, 0.2]),
                "load/cosine": [1.0, 0.0], "contact/side_1": np.array([[2, 0, 0]], np.int32),
                "contact/side_2": np.array([[0, 0, 0]], np.int32), "contact/mu": 0.3,
                "contact/normal_load": 0.4, "contact/normal_load_rotation": 0.9}
    if law == "penalty":
        datasets["contact/tangential_stiffness"] = 1.5
    write_parts(tmp_path / "model.h5", datasets)
    case = with_model({"contact": {"law": law}, "harmonics": {"n_harmonics": 3, "n_time": 256}
                       if law == "dlft" else {"n_harmonics": 3}, "solver": {"tolerance": 1e-12}})
    run(tmp_path, {**case, "sweep": {"start": 0.7, "end": 0.8, "n_points": 6, "speed_order": 2,
                                     "continuation": "arclength"}})
    with h5py.File(tmp_path / "case.h5") as file:
        omega = file["omega"][()]
        tangents = file["tangent/coefficients"][()] / file["tangent/omega"][()][:, None, None]
    step = 1e-4
    at = np.array([w + sign * step for w in omega[1:-1] for sign in (-1.0, 1.0)])
    run(tmp_path, {**case, "sweep": {"values": at.tolist(), "speed_order": 2}})
    with h5py.File(tmp_path / "case.h5") as file:
        points = file["coefficients"][()]
    wanted = (points[1::2] - points[::2]) / (2.0 * step)
    # Truncation of the difference, step**2, and 1e-12 over the step.
    assert np.abs(tangents[1:-1] - wanted).max() <= 1e-4 * np.abs(wanted).max()


def small_sector(path, **others):
    """Six sectors of two masses with stiffening and Coriolis forces."""
    write_parts(path, {
        "mass": np.diag([1.0, 0.4, 1.0]) + 0.0, "stiffness":
        [[3.0, -1.0, -0.5], [-1.0, 1.6, 0.0], [-0.5, 0.0, 1.0]],
        "damping": 0.01 * np.eye(3), "stiffness_rotation": np.diag([0.1, 0.3, 0.1]),
        "coriolis": [[0.0, 0.4, 0.0], [-0.4, 0.0, 0.0], [0.0, 0.0, 0.0]],
        "load/cosine": [0.0, 1.0, 0.0],
        "cyclic@n_sectors": 6, "cyclic/left": np.array([1], dtype=np.int32),
        "cyclic/right": np.array([3], dtype=np.int32)} | others)


DIAGRAM = {"case": {"analysis": "campbell"}, "harmonics": {"n_harmonics": 1},
           "cyclic": {"n_modes": 2}, "output": {"observe": 2},
           "campbell": {"start": 0.05, "end": 1.5, "n_speeds": 7, "orders": [2, -1, 5, 8]}}


def test_frequencies_are_those_of_modes_at_each_speed(tmp_path):
    small_sector(tmp_path / "model.h5")
    run(tmp_path, with_model(DIAGRAM))
    with h5py.File(tmp_path / "case.h5") as file:
        diagram = {name: file["campbell"][name][()] for name in ("speed", "open", "closed",
                                                                  "nodal_diameter")}
        crossing = {name: file["campbell/crossing"][name][()] for name in file["campbell/crossing"]}
    for k, speed in enumerate(diagram["speed"]):
        run(tmp_path, with_model({"case": {"analysis": "modes"}, "cyclic": {"n_modes": 2},
                                  "model": {"rotation_speed": speed}}))
        with h5py.File(tmp_path / "case.h5") as file:
            assert file["modes/nodal_diameter"][()].tolist() == diagram["nodal_diameter"].tolist()
            for state in "open", "closed":
                assert diagram[state][k] == pytest.approx(file[f"modes/{state}"][()], rel=1e-12)
    # Orders 2 and 8 excite the same nodal diameter.
    assert set(zip(crossing["order"], crossing["nodal_diameter"], strict=True)) <= {
        (2, 2), (-1, -1), (5, -1), (8, 2)}
    for order, diameter, mode, speed in zip(*(crossing[name] for name in (
            "order", "nodal_diameter", "mode", "speed")), strict=True):
        run(tmp_path, with_model({"case": {"analysis": "modes"}, "cyclic": {"n_modes": 2},
                                  "model": {"rotation_speed": speed}}))
        with h5py.File(tmp_path / "case.h5") as file:
            place = file["modes/nodal_diameter"][()].tolist().index(diameter)
            omega = file["modes/closed"][place, mode - 1]
        assert omega == pytest.approx(abs(order) * speed, rel=1e-10)


def test_loads_of_orders_are_scaled(tmp_path):
    small_sector(tmp_path / "model.h5")
    heights = []
    for scale in 1.0, [1.0, 2.0, 0.5, 3.0]:
        run(tmp_path, with_model({**DIAGRAM, "campbell": {**DIAGRAM["campbell"],
                                                          "order_scale": scale}}))
        with h5py.File(tmp_path / "case.h5") as file:
            heights.append(file["campbell/peak/amplitude"][:, 0])
            factor = np.array([[1.0, 2.0, 0.5, 3.0][[2, -1, 5, 8].index(order)]
                               for order in file["campbell/crossing/order"]])
    assert np.isfinite(heights[0]).all()
    assert heights[1] == pytest.approx(factor * heights[0], rel=1e-7)


@pytest.mark.parametrize(("change", "words"), [
    ({"campbell": {"orders": [2, 0]}}, "engine orders other than 0"),
    ({"campbell": {"end": 0.01}}, "must be above start"),
    ({"campbell": {"order_scale": [1.0, 2.0]}}, "one for each of the 4 orders"),
    ({"model": {"rotation_speed": 1.0}}, "give campbell%start and end"),
    ({"cyclic": {"mistuned": True, "n_modes": 2}}, "along a line of the diagram")])
def test_what_does_not_go_together_is_refused(tmp_path, change, words):
    small_sector(tmp_path / "model.h5")
    case = with_model(DIAGRAM)
    for group, keys in change.items():
        case[group] = {**case.get(group, {}), **keys}
    done = run(tmp_path, case, status=3)
    assert words in done.stderr


def random_sector(seed):
    """A sector with stiffening and Coriolis forces, its loads, and pairs within it."""
    random = np.random.default_rng(seed)
    n_sectors, n = int(random.integers(2, 10)), int(random.integers(4, 9))
    parts = random.normal(size=(2, n, n))
    whirl = 0.3 * random.normal(size=(n, n))
    n_pairs = int(random.integers(0, 3))
    sides = np.zeros((n_pairs, 3), np.int32)
    # Neither on the interface nor twice on a dof.
    sides[:, 0] = 1 + random.permutation(np.arange(1, n - 1))[:n_pairs]
    datasets = {
        "mass": np.eye(n) + 0.05 * parts[0] @ parts[0].T, "coriolis": whirl - whirl.T,
        "stiffness": 2.0 * np.eye(n) + 0.3 * parts[1] @ parts[1].T, "damping": 0.02 * np.eye(n),
        "stiffness_rotation": np.diag(random.uniform(0.0, 0.3, n)),
        "load/cosine": random.normal(size=n), "load/sine": random.normal(size=n),
        "cyclic@n_sectors": n_sectors, "cyclic/left": np.array([1], np.int32),
        "cyclic/right": np.array([n], np.int32)}
    if n_pairs:
        datasets |= {
            "contact/side_1": sides, "contact/side_2": np.zeros_like(sides),
            "contact/mu": np.full(n_pairs, 0.3),
            "contact/normal_load": random.uniform(0.1, 1.0, n_pairs),
            "contact/normal_load_rotation": random.uniform(-0.3, 1.0, n_pairs),
            "contact/tangential_stiffness": random.uniform(0.5, 2.0, n_pairs)}
    return datasets, random


@pytest.mark.parametrize("seed", range(12))
def test_random_order_lines_are_points_of_their_speeds(tmp_path, seed):
    datasets, random = random_sector(seed)
    n_sectors, n_pairs = datasets["cyclic@n_sectors"], len(datasets.get("contact/mu", []))
    write_parts(tmp_path / "model.h5", datasets)
    order = int(random.choice([e for e in range(-n_sectors, 2 * n_sectors + 1) if e]))
    omega = random.uniform(0.8, 2.0, 3)
    case = with_model({"cyclic": {"engine_order": order}, "harmonics": {"n_harmonics": 3},
                       "solver": {"tolerance": 1e-12}})
    if n_pairs:
        case["contact"] = {"law": "penalty"}
    run(tmp_path, {**case, "sweep": {"values": omega.tolist(), "speed_order": abs(order)}})
    with h5py.File(tmp_path / "case.h5") as file:
        rows = file["coefficients"][()]
    for k, w in enumerate(omega):
        run(tmp_path, {**case, "case": {"analysis": "point"}, "sweep": {"start": w},
                       "model": {**case["model"], "rotation_speed": w / abs(order)}})
        with h5py.File(tmp_path / "case.h5") as file:
            point = file["coefficients"][0]
        # Two solutions to 1e-12 of the load, times the condition of the structures.
        assert np.abs(rows[k] - point).max() <= 1e-9 * np.abs(point).max()


def frequencies(datasets, diameter, speed):
    """Undamped and damped alike: Im of the roots of the tied sector, ascending, by NumPy alone."""
    n = len(datasets["mass"])
    tie = np.eye(n, dtype=complex)[:, :-1]
    tie[-1, 0] = np.exp(-2j * np.pi * diameter / datasets["cyclic@n_sectors"])
    stiffness = datasets["stiffness"] + speed**2 * datasets["stiffness_rotation"]
    damping = datasets["damping"] + speed * datasets["coriolis"]
    mass, stiffness, damping = (tie.conj().T @ a @ tie
                                for a in (datasets["mass"], stiffness, damping))
    roots = np.linalg.eigvals(np.block([
        [np.zeros_like(mass), np.eye(n - 1)],
        [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]])).imag
    return np.sort(roots[roots > 0.0])


@pytest.mark.parametrize("seed", range(12))
def test_random_crossings_by_other_eigenvalues(tmp_path, seed):
    datasets, random = random_sector(100 + seed)
    n_sectors = datasets["cyclic@n_sectors"]
    datasets = {name: part for name, part in datasets.items() if "contact" not in name}
    write_parts(tmp_path / "model.h5", datasets)
    orders = random.choice([e for e in range(-n_sectors, 2 * n_sectors + 1) if e], 2, replace=False)
    ends, n_speeds = (0.05, 2.0), 30
    run(tmp_path, with_model({
        "case": {"analysis": "campbell"}, "harmonics": {"n_harmonics": 1}, "cyclic": {"n_modes": 3},
        "campbell": {"start": ends[0], "end": ends[1], "n_speeds": n_speeds,
                     "orders": orders.tolist(), "peaks": False}}))
    with h5py.File(tmp_path / "case.h5") as file:
        found = np.column_stack([file[f"campbell/crossing/{name}"][()]
                                 for name in ("order", "mode", "speed")])
    wanted = []
    for order in orders:
        speeds = np.linspace(*ends, n_speeds)
        above = np.array([frequencies(datasets, order, s)[:3] - abs(order) * s for s in speeds])
        for mode in range(3):
            changes = np.flatnonzero(above[:-1, mode] * above[1:, mode] < 0.0)
            wanted += [(order, mode + 1, speeds[k], speeds[k + 1]) for k in changes]
    assert len(found) == len(wanted)
    for (order, mode, speed), (e, m, low, high) in zip(found, wanted, strict=True):
        assert (order, mode) == (e, m)
        assert low <= speed <= high
        omega = frequencies(datasets, e, speed)[m - 1]
        # 1e-12 of the search, and round-off of two eigensolvers.
        assert abs(omega - abs(e) * speed) <= 1e-10 * omega
