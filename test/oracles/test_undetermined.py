"""Modes without damping that a harmonic meets, beside a part with a joint: dense solutions."""
import subprocess
from fractions import Fraction

import numpy as np
import pytest
from cases import read, run
from project import PROGRAM

#: Motions are of the order of one: far above round-off, far below a motion that it would make.
CLOSE = 1e-7
#: What stands on the first dof, which belongs to the part that is not met.
JOINTS = {
    "nothing": {},
    "spring": {"spring": {"n_springs": 1, "side_1": 1, "coefficient": 1.0, "power": 3}},
    "pair": {"contact": {"n_pairs": 1, "law": "penalty", "tangential_stiffness": 1.0,
                         "side_1": [1, 0, 0], "mu": 1.0, "normal_load": 0.5}}}
SEEDS = range(8)


def add_chain(stiffness, dofs, random):
    """Springs from the ground to the first dof and from each to the next."""
    for before, dof in zip([None, *dofs], dofs):
        value = random.uniform(0.5, 2.0)
        stiffness[dof, dof] += value
        if before is not None:
            stiffness[before, before] += value
            stiffness[dof, before] = stiffness[before, dof] = -value


def structure(seed):
    """Two chains that nothing joins: matrices, dofs of the second, a mode of it and the rest."""
    random = np.random.default_rng(seed)
    sizes = random.integers(1, 4), random.integers(2, 5)
    n = sum(sizes)
    others = 1 + random.permutation(n - 1)
    first, second = [0, *others[:sizes[0] - 1]], others[sizes[0] - 1:]
    stiffness, mass = np.zeros((n, n)), random.uniform(0.5, 2.0, n)
    add_chain(stiffness, first, random)
    add_chain(stiffness, second, random)
    root = np.sqrt(mass[second])
    squares, shapes = np.linalg.eigh(stiffness[np.ix_(second, second)] / np.outer(root, root))
    met = random.integers(len(second))
    shapes /= root[:, None]
    load = np.zeros(n)
    load[0] = 0.5
    return stiffness, mass, second, squares, shapes, met, load


def solve(folder, stiffness, mass, load, omega, joint, status=0):
    """Coefficients of the response, and names of remarks."""
    n = len(mass)
    run(folder, {
        "case": {"analysis": "point"},
        "model": {"n_dof": n, "mass": np.diag(mass).ravel().tolist(),
                  "stiffness": stiffness.ravel().tolist()},
        "load": {"cosine": load.tolist()}, "sweep": {"start": float(omega)},
        "harmonics": {"n_harmonics": 3, "parity": "all"}, **joint}, status=status)
    found = read(folder / "case.h5")
    names = [name.decode() for name in found.get("remarks/name", [])]
    return found["coefficients"][0], names


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("harmonic", [1, 2, 3])
def test_a_mode_that_nothing_drives_is_at_rest(tmp_path, joint, harmonic):
    """Also one that the load does not reach for it is orthogonal: the others answer alone."""
    for seed in SEEDS:
        stiffness, mass, second, squares, shapes, met, load = structure(seed)
        kept = np.arange(len(second)) != met
        push = np.random.default_rng(seed + 100).normal(size=len(second)) * (seed % 2)
        # What is left of a load moves no longer the mode that is met.
        push -= mass[second] * shapes[:, met] * (shapes[:, met] @ push)
        load[second] = push
        omega = np.sqrt(squares[met]) / harmonic
        weights = (shapes.T @ push)[kept] / (squares[kept] - omega**2)
        found, names = solve(tmp_path, stiffness, mass, load, omega, JOINTS[joint])
        expected = np.zeros((7, len(second)))
        expected[1] = shapes[:, kept] @ weights
        assert found[:, second] == pytest.approx(expected, abs=CLOSE), seed
        assert "undetermined mode" in names, seed


@pytest.mark.parametrize("joint", JOINTS)
def test_a_mode_that_a_load_drives_is_no_solution(tmp_path, joint):
    """However small the load is."""
    for seed in SEEDS:
        stiffness, mass, second, squares, _, met, load = structure(seed)
        load[second] = np.random.default_rng(seed).normal(size=len(second)) * 10.0**(-seed)
        _, names = solve(tmp_path, stiffness, mass, load, np.sqrt(squares[met]), JOINTS[joint],
                         status=4)
        assert "undetermined mode" not in names, seed
    done = subprocess.run([PROGRAM, "case.nml"], cwd=tmp_path, text=True, capture_output=True,
                          check=False)
    assert "grows without bound" in done.stderr + done.stdout


@pytest.mark.parametrize("joint", JOINTS)
def test_equal_parts_that_move_against_each_other(tmp_path, joint):
    """The frequency of each blade alone: their common motion moves the hub, the others do not."""
    for n_blades in (2, 3, 5):
        random = np.random.default_rng(n_blades)
        k, m = random.uniform(0.5, 2.0, 2)
        n = n_blades + 1
        stiffness = np.diag([1.0 + n_blades * k] + n_blades * [k])
        stiffness[0, 1:] = stiffness[1:, 0] = -k
        mass = np.array([1.0] + n_blades * [m])
        load = np.zeros(n)
        load[0] = 0.5
        found, names = solve(tmp_path, stiffness, mass, load, np.sqrt(k / m), JOINTS[joint])
        # The hub stands still, and the blades carry its load.
        assert found[1, 0] == pytest.approx(0.0, abs=CLOSE)
        assert found[1, 1:] == pytest.approx(np.full(n_blades, -0.5 / (n_blades * k)), abs=CLOSE)
        assert "undetermined mode" in names


def test_damping_determines_the_mode(tmp_path):
    """The remedy of the remark."""
    stiffness, mass, _, squares, _, met, load = structure(3)
    damped = {"model": {"n_dof": len(mass), "mass": np.diag(mass).ravel().tolist(),
                        "stiffness": stiffness.ravel().tolist(), "modal_damping": 1e-3}}
    _, names = solve(tmp_path, stiffness, mass, load, np.sqrt(squares[met]), damped)
    assert "undetermined mode" not in names


def exact(matrix, load):
    """Solution in rational numbers, of which those given are exact ones."""
    n = len(load)
    rows = [[Fraction(value) for value in [*row, f]] for row, f in zip(matrix, load, strict=True)]
    for k in range(n):
        pivot = next(i for i in range(k, n) if rows[i][k])
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [value / rows[k][k] for value in rows[k]]
        for i in range(n):
            if i != k:
                rows[i] = [a - rows[i][k] * b for a, b in zip(rows[i], rows[k], strict=True)]
    return np.array([float(row[-1]) for row in rows])


@pytest.mark.parametrize("joining", [1e-9, 1e-10])
def test_equal_parts_that_a_weak_spring_joins_are_coupled(tmp_path, joining):
    """At a mode of both their coupling is all that counts, however little it is beside K and M."""
    springs = [0.02447313091633785, 0.004846333174229288, 19.656211347790872, 0.07290039396017745]
    mass = [0.53843651611629, 0.7495319524489236, 1.871346884381871, 1.7560745361382053]
    part = np.diag(np.add(springs, [*springs[1:], 0.0]))
    part -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
    stiffness, masses = np.kron(np.eye(2), part), np.tile(mass, 2)
    stiffness[[3, 4, 3, 4], [3, 4, 4, 3]] += np.array([1.0, 1.0, -1.0, -1.0]) * joining
    load, omega = np.array([0.01, *np.zeros(7)]), 6.061699624303173
    found, names = solve(tmp_path, stiffness, masses, load, omega, JOINTS["pair"])
    assert "undetermined mode" not in names
    # The pair sticks: a spring.
    stiffness[0, 0] += JOINTS["pair"]["contact"]["tangential_stiffness"]
    square = Fraction(omega)**2
    expected = exact([[Fraction(k) - (i == j) * square * Fraction(masses[i])
                       for j, k in enumerate(row)] for i, row in enumerate(stiffness)], load)
    # A part of 1e-14 of the frequency makes 1.5e-4 of it, and what was lost of the coupling 0.5.
    assert found[1] == pytest.approx(expected, abs=1e-2 * np.abs(expected).max())


def held_part(joint, **keys):
    """A damped part that rubs, and a mass of frequency 3 beside it, held by what `joint` says."""
    return {"model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 1.0],
                      "stiffness": [1.25, 0.0, 0.0, keys.pop("stiffness", 0.0)],
                      "damping": [0.0625, 0.0, 0.0, keys.pop("damping", 0.0)]},
            "load": {"cosine": [1.0, keys.pop("load", 0.0)]},
            "harmonics": {"n_harmonics": 3, "parity": "all"}, **HELD[joint]}


#: What holds the mass: a spring, or a pair that sticks.
HELD = {
    "spring": {
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 0], "mu": 1.0,
                    "normal_load": 0.5, "tangential_stiffness": 2.0},
        "spring": {"n_springs": 1, "side_1": 2, "coefficient": 9.0, "power": 1}},
    "pair": {
        "contact": {"n_pairs": 2, "law": "penalty", "side_1": [1, 0, 0, 2, 0, 0],
                    "mu": [1.0, 1.0], "normal_load": [0.5, 100.0],
                    "tangential_stiffness": [2.0, 8.0]}}}
#: What the matrix adds to it.
REST = {"spring": 0.0, "pair": 1.0}


def said(folder, case, status=0):
    """Texts of the remark, and whether all points converged."""
    run(folder, case, status=status)
    found = read(folder / "case.h5")
    return [text.decode() for name, text in zip(found.get("remarks/name", []),
                                                found.get("remarks/text", []), strict=True)
            if name == b"undetermined mode"], found


@pytest.mark.parametrize("joint", HELD)
def test_a_mode_that_springs_or_stuck_pairs_hold(tmp_path, joint):
    """The harmonic is named; a bit of damping or of the frequency determines the motion."""
    case = held_part(joint, stiffness=REST[joint])
    told, found = said(tmp_path, {"case": {"analysis": "point"}, **case, "sweep": {"start": 1.0}})
    assert len(told) == 1
    assert "harmonic 3 meets" in told[0]
    assert "linear springs and stuck pairs" in told[0]
    assert found["coefficients"][0][:, 1] == pytest.approx(0.0, abs=CLOSE)
    told, _ = said(tmp_path, {"case": {"analysis": "point"}, **case,
                              "sweep": {"start": 1.0 + 1e-12}})
    assert not told
    damped = held_part(joint, stiffness=REST[joint], damping=1e-12)
    told, _ = said(tmp_path, {"case": {"analysis": "point"}, **damped, "sweep": {"start": 1.0}})
    assert not told


@pytest.mark.parametrize("joint", HELD)
def test_sweeps_and_controls_say_so(tmp_path, joint):
    """The second of three frequencies meets it; an amplitude that is given at the first mass."""
    case = held_part(joint, stiffness=REST[joint])
    sweep = {"sweep": {"start": 0.75, "end": 1.25, "n_points": 3}}
    told, _ = said(tmp_path, {"case": {"analysis": "frf"}, **case, **sweep})
    assert "at 1.00000 rad/s harmonic 3" in told[0]
    told, _ = said(tmp_path, {"case": {"analysis": "frf"}, **case, **sweep,
                              "output": {"observe": [1]},
                              "control": {"of": "largest", "amplitude": 0.5}}, status=(0, 4))
    assert "at 1.00000 rad/s harmonic 3" in told[0]


def test_a_load_on_a_held_mode_fails(tmp_path):
    """As one on a mode of the structure alone."""
    case = held_part("spring", load=1e-3)
    case["model"]["stiffness"][0] = 2.25
    case["spring"]["coefficient"] = 1.0
    told, found = said(tmp_path, {"case": {"analysis": "point"}, **case, "sweep": {"start": 1.0}},
                       status=4)
    assert not told
    assert not found["converged"][0]


def test_wear_says_so_too(tmp_path):
    """A pair that wears on one dof, and an oscillator beside it."""
    run(tmp_path, {
        "case": {"analysis": "wear"},
        "model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 1.0], "stiffness": [2.0, 0.0, 0.0, 1.0],
                  "damping": [0.05, 0.0, 0.0, 0.0]},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 0], "mu": 0.3,
                    "tangential_stiffness": 1.0, "normal_load": 0.5, "area": 1.0},
        "load": {"cosine": [1.0, 0.0]}, "harmonics": {"n_harmonics": 3, "n_time": 64},
        "sweep": {"start": 1.0},
        "wear": {"coefficient": 1e-6, "max_depth_step": 1e-6, "max_steps": 2}}, status=(0, 4))
    assert "undetermined mode" in [name.decode() for name in
                                   read(tmp_path / "case.h5")["remarks/name"]]
