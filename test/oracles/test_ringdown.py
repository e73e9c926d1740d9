"""Free decay (analysis = 'ringdown').

test/reference/blades/b9_ringdown.json is a Jenkins oscillator whose turning points follow by hand.
Random structures are judged by an integration of their own: explicit steps, a return map at each.
"""
import json

import numpy as np
import pytest
from cases import read, run, run_reference
from project import ROOT
from scipy.linalg import eigh, expm
from scipy.special import ellipk

REFERENCE = json.loads((ROOT / "test/reference/blades/b9_ringdown.json").read_text())
#: Steps of a period: those of the program, and of the judge, whose scheme is of second order too.
STEPS, FINER = 2000, 4000
#: Both miss the moments of stick, slip and contact by a part of a step: measured 4e-6 to 1.5e-4.
EQUAL = 1.5e-3
#: The linear decay: swings against exp(-zeta omega t), by the square of a step.
LINEAR = 1e-5


@pytest.mark.parametrize("number", range(len(REFERENCE["runs"])))
def test_by_hand(tmp_path, number):
    run_reference(tmp_path, REFERENCE, number)


def structure(seed):
    """Masses in a row, whose pairs rub in one or two directions, under normal forces that change."""
    random = np.random.default_rng([96, seed])
    n = 4
    stiffness = np.diag(random.uniform(1.0, 2.0, n))
    for i in range(n - 1):
        k = random.uniform(0.2, 0.8)
        stiffness[i:i + 2, i:i + 2] += k * np.array([[1.0, -1.0], [-1.0, 1.0]])
    two = bool(seed % 2)
    return {"mass": np.diag(random.uniform(0.5, 1.5, n)), "stiffness": stiffness,
            "damping": 0.004 * stiffness, "static": np.array([0.0, 0.0, 0.0, -random.uniform(
                0.3, 0.6)]),
            "pair": [1, 2 if two else 0, 4], "mu": random.uniform(0.2, 0.5),
            "k_t": random.uniform(0.4, 0.9), "k_n": random.uniform(0.5, 1.5),
            "amplitude": random.uniform(1.0, 2.0), "n_cycles": 5}


def case(model):
    groups = {"case": {"analysis": "ringdown"},
              "model": {"n_dof": 4, **{name: model[name] for name in ("mass", "stiffness",
                                                                     "damping")}},
              "contact": {"n_pairs": 1, "law": "penalty", "side_1": model["pair"],
                          "mu": model["mu"], "tangential_stiffness": model["k_t"],
                          "normal_stiffness": model["k_n"]},
              "load": {"static": model["static"]},
              "ringdown": {"amplitude": model["amplitude"], "n_cycles": model["n_cycles"],
                           "steps_per_period": STEPS},
              "output": {"observe": [1, 4]}}
    return groups


def pair_force(model, u, x):
    """Force on the dofs, and the corrected position after slip."""
    rows = [row - 1 for row in model["pair"][:2] if row > 0]
    normal = model["pair"][2] - 1
    pressure = max(0.0, -model["k_n"] * u[normal])
    force, limit = model["k_t"] * (u[rows] - x), model["mu"] * pressure
    size = np.linalg.norm(force)
    if size > limit:
        force = force * (limit / size)
        x = u[rows] - force / model["k_t"]
    total = np.zeros(len(u))
    total[rows] = force
    total[normal] -= pressure
    return total, x


def judged(model):
    """Time and displacements by steps of the judge, from a position at rest of its own; how often
    the pair slipped."""
    rows = [row - 1 for row in model["pair"][:2] if row > 0]
    normal = model["pair"][2] - 1
    u, x = np.zeros(4), np.zeros(len(rows))
    # Pressed from where nothing is strained: springs of the pair hold, and it does not slip.
    joined = model["stiffness"].copy()
    joined[rows, rows] += model["k_t"]
    joined[normal, normal] += model["k_n"]
    u = np.linalg.solve(joined, model["static"])
    assert np.linalg.norm(pair_force(model, u, x)[1] - x) == 0.0
    squares, shapes = eigh(joined, model["mass"])
    shape = model["amplitude"] / shapes[0, 0] * shapes[:, 0]
    for share in np.linspace(0.0, 1.0, 1001)[1:]:
        _, x = pair_force(model, u + share * shape, x)
    u = u + shape
    h = 2.0 * np.pi / np.sqrt(squares[0]) / FINER
    n, n_slips = FINER * model["n_cycles"], 0
    found, v = np.empty((n, 4)), np.zeros(4)
    inverse = np.linalg.inv(model["mass"] + 0.5 * h * model["damping"])
    for k in range(n):
        found[k] = u
        force, moved = pair_force(model, u, x)
        n_slips += bool(np.any(moved != x))
        x = moved
        pull = model["static"] - model["stiffness"] @ u - force
        if k == 0:
            half = 0.5 * h * np.linalg.solve(model["mass"], pull)
        else:
            half = inverse @ ((model["mass"] - 0.5 * h * model["damping"]) @ v + h * pull)
        v = half
        u = u + h * v
    return h * np.arange(n), found, n_slips


@pytest.mark.parametrize("seed", range(6))
def test_random_structures(tmp_path, seed):
    model = structure(seed)
    run(tmp_path, case(model))
    result = read(tmp_path / "case.h5")
    time, wanted, n_slips = judged(model)
    size = np.abs(wanted).max()
    for column, dof in enumerate((0, 3)):
        other = np.interp(result["ringdown/time"], time, wanted[:, dof])
        assert np.abs(result["ringdown/observed"][:, column] - other).max() < EQUAL * size
    assert n_slips > FINER / 10


def test_nothing_slips(tmp_path):
    """Stuck by a high mu, the swings are those of the linear structure, by its exponential."""
    model = structure(0) | {"mu": 1e3, "amplitude": 0.01}
    run(tmp_path, case(model))
    result = read(tmp_path / "case.h5")
    joined = model["stiffness"] + np.diag([model["k_t"], 0.0, 0.0, model["k_n"]])
    rest = np.linalg.solve(joined, model["static"])
    shape = eigh(joined, model["mass"])[1][:, 0]
    shape *= model["amplitude"] / shape[0]
    inverse = np.linalg.inv(model["mass"])
    generator = np.block([[np.zeros((4, 4)), np.eye(4)],
                          [-inverse @ joined, -inverse @ model["damping"]]])
    for time, value in zip(result["ringdown/extreme/time"],
                           result["ringdown/extreme/value"], strict=True):
        wanted = rest + (expm(time * generator) @ np.concatenate([shape, np.zeros(4)]))[:4]
        assert value == pytest.approx(wanted[[0, 3]], abs=LINEAR * np.abs(shape).max())


def test_duffing(tmp_path):
    """Without friction energy stays, and the period is that of the cubic spring (Jacobi's cn)."""
    amplitude, cubic = 2.0, 0.5
    run(tmp_path, {"case": {"analysis": "ringdown"},
                   "model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0},
                   "spring": {"n_springs": 1, "side_1": 1, "power": 3, "coefficient": cubic},
                   "ringdown": {"amplitude": amplitude, "n_cycles": 6,
                                "steps_per_period": STEPS}})
    result = read(tmp_path / "case.h5")
    square = 1.0 + cubic * amplitude**2
    omega = 0.5 * np.pi * np.sqrt(square) / ellipk(0.5 * cubic * amplitude**2 / square)
    assert result["ringdown/omega"] == pytest.approx(omega, rel=LINEAR)
    assert np.abs(result["ringdown/extreme/value"][:, 0]) == pytest.approx(amplitude, rel=LINEAR)
    assert np.abs(result["ringdown/damping_ratio"]).max() < LINEAR


REFUSED = [
    ({"ringdown": {"amplitude": 0.0}}, "&ringdown amplitude = 0.0"),
    ({"ringdown": {"amplitude": 1.0, "number": 9}}, "&ringdown number = 9"),
    ({"contact": {"speed_1": 0.1}}, "leave the speeds out"),
    ({"cyclic": {"n_sectors": 4, "engine_order": 1, "left": [1], "right": [4]}}, "&cyclic"),
    ({"model": {"loss_factor": 0.01}}, "loss_factor"),
    ({"output": {"observe": [2]}, "ringdown": {"number": 2}}, None)]


@pytest.mark.parametrize(("changes", "words"), REFUSED)
def test_refused(tmp_path, changes, words):
    groups = case(structure(2))
    for name, keys in changes.items():
        groups[name] = {key: value for key, value in (groups.get(name, {}) | keys).items()
                        if value is not None}
    done = run(tmp_path, groups, status=3 if words else 0)
    assert words is None or words in done.stderr


def stop(law, side, amplitude=0.4):
    """A mass on a spring, 0.5 before a stop: in front of it (side -1) or behind it (side 1)."""
    groups = {"case": {"analysis": "ringdown"},
              "model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0, "damping": 0.01},
              "contact": {"n_pairs": 1, "law": law, "side_1": [0, 0, side], "mu": 0.0, "gap": 0.5},
              "ringdown": {"amplitude": amplitude, "n_cycles": 3}}
    if law == "penalty":
        groups["contact"] |= {"normal_stiffness": 50.0, "tangential_stiffness": 1.0}
    return groups


@pytest.mark.parametrize("law", ("dlft", "dlft_velocity", "rigid", "penalty"))
def test_nothing_is_released_behind_a_rigid_surface(tmp_path, law):
    if law == "penalty":
        run(tmp_path, stop(law, -1, 1.0))
    else:
        told = run(tmp_path, stop(law, -1, 1.0), status=3).stderr
        for words in ("&ringdown amplitude = 1", "pair 1", "take at most 0.5", "'penalty'"):
            assert words in told
        # As far as the surface itself.
        run(tmp_path, stop(law, -1, 0.4999999))
    # Away from it, the mass meets it on its way.
    run(tmp_path, stop(law, 1, 1.0))
    lowest = read(tmp_path / "case.h5")["ringdown/observed"].min()
    assert lowest == pytest.approx(-0.5, abs=1e-3) or (law == "penalty" and lowest < -0.5)


@pytest.mark.parametrize(("n_cycles", "swings"), [(1, 1), (2, 3), (3, 5)])
def test_few_cycles(tmp_path, n_cycles, swings):
    """One cycle ends before its second turn: no damping ratio, and a result all the same."""
    groups = stop("penalty", -1)
    groups["ringdown"]["n_cycles"] = n_cycles
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")
    assert found["ringdown/omega"].shape == (swings,)
    assert found["ringdown/damping_ratio"] == pytest.approx([0.005] * max(0, swings - 2), rel=1e-4)


def test_large_damping(tmp_path):
    """d/sqrt(4 pi^2 + d^2) of the decrement d: the ratio of one mass, however large."""
    run(tmp_path, {"case": {"analysis": "ringdown"},
                   "model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0, "damping": 0.8},
                   "ringdown": {"amplitude": 1.0, "n_cycles": 3, "steps_per_period": STEPS}})
    found = read(tmp_path / "case.h5")["ringdown/damping_ratio"]
    assert found == pytest.approx(0.4, rel=20.0 * LINEAR)


@pytest.mark.parametrize("joined", [0.0, 0.01])
def test_repeated_modes_are_remarked(tmp_path, joined):
    run(tmp_path, {"case": {"analysis": "ringdown"},
                   "model": {"n_dof": 2, "mass": np.eye(2), "stiffness": np.eye(2) + joined,
                             "damping": 0.02 * np.eye(2)},
                   "ringdown": {"amplitude": 1.0, "n_cycles": 3, "steps_per_period": 200},
                   "output": {"observe": [2]}})
    remarks = read(tmp_path / "case.h5").get("remarks/name", [])
    assert (b"repeated mode" in list(remarks)) == (joined == 0.0)
