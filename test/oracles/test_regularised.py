"""Regularised friction against integration in time of the same equation, written for obviousness.

M u'' + C u' + K u + rows^T lambda(rows u') = f cos(omega t), with
lambda = mu N tanh(|v|/v_0) v/|v|, integrated over so many periods that the last repeats.
"""

import numpy as np
import pytest
from oracle_runs import run_case
from scipy.integrate import solve_ivp

MASS = np.diag([1.0, 0.8, 0.6])
STIFFNESS = np.array([[2.5, -1.0, 0.0], [-1.0, 2.2, -0.7], [0.0, -0.7, 1.9]])
DAMPING = 0.12 * MASS + 0.06 * STIFFNESS
#: Two directions move on an ellipse: the load turns.
COSINE, SINE = np.array([1.0, 0.3, 0.0]), np.array([0.0, 0.2, 0.9])
OMEGA, MU, LOAD = 0.9, 0.4, 1.1
#: Free vibrations fall below 1e-10 of themselves: the slowest decays with exp(-0.1 t).
PERIODS = 40


def reference(sides, slip_speed, n_harmonics):
    """Coefficients (2H+1, dof) and the friction work of a period."""
    inverse = np.linalg.inv(MASS)
    sides = list(sides)

    def friction(velocity):
        v = velocity[sides]
        speed = max(np.linalg.norm(v), 1e-300)
        force = np.zeros(3)
        force[sides] = MU * LOAD * np.tanh(speed / slip_speed) * v / speed
        return force

    def slope(t, y):
        force = COSINE * np.cos(OMEGA * t) + SINE * np.sin(OMEGA * t)
        u, v = y[:3], y[3:6]
        acceleration = inverse @ (force - STIFFNESS @ u - DAMPING @ v - friction(v))
        return np.concatenate([v, acceleration, [friction(v) @ v]])

    period = 2.0 * np.pi / OMEGA
    n = 512
    times = (PERIODS - 1) * period + np.arange(n + 1) * period / n
    start = np.zeros(7)
    run = solve_ivp(slope, (0.0, times[-1]), start, method="DOP853", rtol=1e-10, atol=1e-12,
                    t_eval=times)
    u = run.y[:3, :n]
    spectrum = np.fft.rfft(u, axis=1) / n
    coefficients = np.zeros((2 * n_harmonics + 1, 3))
    coefficients[0] = spectrum[:, 0].real
    for k in range(1, n_harmonics + 1):
        coefficients[2 * k - 1] = 2.0 * spectrum[:, k].real
        coefficients[2 * k] = -2.0 * spectrum[:, k].imag
    return coefficients, run.y[6, n] - run.y[6, 0]


def groups(sides, slip_speed, n_harmonics):
    """The same as a namelist."""
    side_1 = [0, 0, 0]
    for c, dof in enumerate(sides):
        side_1[c] = dof + 1
    return {
        "case": {"title": "regularised friction", "analysis": "point"},
        "model": {"n_dof": 3, "mass": MASS, "stiffness": STIFFNESS, "damping": DAMPING},
        "contact": {"n_pairs": 1, "law": "regularised", "side_1": side_1, "mu": MU,
                    "normal_load": LOAD, "slip_speed": slip_speed},
        "load": {"cosine": COSINE, "sine": SINE},
        "harmonics": {"n_harmonics": n_harmonics},
        "sweep": {"start": OMEGA}, "solver": {"tolerance": 1e-10},
    }


# Errors of the coefficients of the motion over their norm, and of the work, at H = 3, 7 and 15: the
# truncation of a force that is smooth on the scale v_0 (first rows), or nearly Coulomb's (last).
# About twice what is measured: 4e-3, 2e-4, 2e-6; 1e-2, 1e-3, 2e-5; 2e-2, 9e-3, 3e-3.
@pytest.mark.parametrize(("sides", "slip_speed", "errors"), [
    ((0,), 0.2, (1e-2, 5e-4, 4e-6)),
    ((1, 2), 0.2, (2.5e-2, 2.5e-3, 5e-5)),
    ((0,), 0.02, (4e-2, 2e-2, 6e-3)),
])
def test_motion_is_that_of_integration_in_time(tmp_path, sides, slip_speed, errors):
    exact, work = reference(sides, slip_speed, 15)
    for n_harmonics, error in zip((3, 7, 15), errors, strict=True):
        expected = exact[:2 * n_harmonics + 1]
        result = run_case(tmp_path, groups(sides, slip_speed, n_harmonics))
        difference = np.linalg.norm(result.coefficients[0] - expected)
        assert difference < error * np.linalg.norm(expected)
        assert abs(result.dissipation[0, 0] - work) < error * work
