"""Floquet multipliers of structures with nonlinear dampers and polynomials.

A damper of power 1 is viscous damping, whose multipliers are exponentials of eigenvalues;
polynomials that are springs have the multipliers of these, by Hill's method; others those of an
integration over the period by SciPy, with a perturbation of each state in turn.
"""
import numpy as np
import pytest
from cases import merged, read, run
from scipy.integrate import solve_ivp

#: Of a march of 1,024 steps: its phase, (w step)**3/12 a step, 1e-4 of them all with the fastest
#: mode of these; a margin of ten.
MARCHED = 1e-3
#: What 15 harmonics leave of the motion under the drag |v| v, 1e-4; a margin of ten.
TRUNCATED = 1e-3

MASS = np.diag([1.0, 0.8])
STIFFNESS = np.array([[3.0, -1.0], [-1.0, 2.0]])
OMEGA = 1.3
CASE = {
    "case": {"analysis": "point"},
    "model": {"n_dof": 2, "mass": MASS, "stiffness": STIFFNESS, "damping": 0.03 * STIFFNESS},
    "load": {"cosine": [0.8, 0.3]}, "harmonics": {"n_harmonics": 15},
    "sweep": {"start": OMEGA, "stability": True}, "solver": {"tolerance": 1e-11},
}


def result(folder, groups):
    run(folder, groups)
    found = read(folder / "case.h5")
    return found, found["floquet/multipliers"][0] @ [1.0, 1.0j]


def same(found, wanted):
    """Each of the one beside its own of the other."""
    left = list(wanted)
    for value in found:
        near = min(left, key=lambda other: abs(other - value))
        assert abs(near - value) < MARCHED, (found, wanted)
        left.remove(near)


def test_linear_dampers_have_exponentials(tmp_path):
    groups = merged(CASE, {"damper": {"n_dampers": 2, "side_1": [1, 2], "side_2": [2, 0],
                                      "coefficient": [0.15, 0.1]}})
    damping = 0.03 * STIFFNESS + [[0.15, -0.15], [-0.15, 0.25]]
    state = np.block([[np.zeros((2, 2)), np.eye(2)],
                      [-np.linalg.solve(MASS, STIFFNESS), -np.linalg.solve(MASS, damping)]])
    same(result(tmp_path, groups)[1], np.exp(np.linalg.eigvals(state) * 2.0 * np.pi / OMEGA))


def test_polynomials_as_springs(tmp_path):
    springs = {"spring": {"n_springs": 2, "side_1": [1, 2], "coefficient": [0.5, 0.3],
                          "power": [3, 2]}}
    terms = {"polynomial": {"n_terms": 2, "coefficient": [0.125, 0.1],
                            "factors": [1, 1, 1, 1, 0, 0, 0, 0, 2, 2, 2, 0, 0, 0, 0, 0]}}
    hill = result(tmp_path, merged(CASE, springs))[1]
    same(result(tmp_path, merged(CASE, terms))[1], hill)


ELEMENTS = {
    "drag": {"damper": {"n_dampers": 1, "side_1": 1, "side_2": 2, "coefficient": 0.4,
                        "power": 2.0}},
    "grip": {"damper": {"n_dampers": 1, "side_1": 1, "coefficient": 0.5, "position_power": 2}},
    "coupled": {"polynomial": {"n_terms": 1, "coefficient": [0.3],
                               "factors": [1, 1, 2, 2, 0, 0, 0, 0]}},
    "follower": {"polynomial": {"n_terms": 1, "of": "force", "coefficient": [0.4],
                                "factors": [2, 2, 2, 0, 0, 0, 0, 0], "dof": [1]}},
}


def force(name, u, v):
    if name == "drag":
        f = 0.4 * abs(v[0] - v[1]) * (v[0] - v[1])
        return np.array([f, -f])
    if name == "grip":
        return np.array([0.5 * u[0]**2 * v[0], 0.0])
    if name == "coupled":
        return np.array([0.6 * u[0] * u[1]**2, 0.6 * u[0]**2 * u[1]])
    return np.array([0.4 * u[1]**3, 0.0])


@pytest.mark.parametrize("name", ELEMENTS)
def test_multipliers_are_as_integrated(tmp_path, name):
    found, multipliers = result(tmp_path, merged(CASE, ELEMENTS[name]))
    c = found["coefficients"][0]
    order = np.arange(1, 16)[:, None]
    start = np.concatenate([c[0] + c[1::2].sum(axis=0), (OMEGA * order * c[2::2]).sum(axis=0)])

    def rate(t, x):
        load = np.array([0.8, 0.3]) * np.cos(OMEGA * t)
        a = load - STIFFNESS @ x[:2] - 0.03 * STIFFNESS @ x[2:] - force(name, x[:2], x[2:])
        return np.concatenate([x[2:], np.linalg.solve(MASS, a)])

    def period(x):
        return solve_ivp(rate, (0.0, 2.0 * np.pi / OMEGA), x, method="DOP853", rtol=1e-11,
                         atol=1e-12).y[:, -1]

    # The balance has found a period of the equations of motion.
    assert np.abs(period(start) - start).max() < TRUNCATED
    step = 1e-5
    matrix = np.stack([(period(start + step * e) - period(start - step * e)) / (2.0 * step)
                       for e in np.eye(4)], axis=1)
    same(multipliers, np.linalg.eigvals(matrix))
    assert bool(found["floquet/stable"][0]) == bool(max(abs(np.linalg.eigvals(matrix))) < 1.0)


def test_a_damper_on_a_dof_without_mass_is_refused(tmp_path):
    groups = merged(CASE, ELEMENTS["grip"])
    groups["model"] = groups["model"] | {"mass": np.diag([0.0, 0.8]), "damping": np.zeros((2, 2))}
    done = run(tmp_path, groups, status=3)
    assert "without mass and other damping" in done.stderr
