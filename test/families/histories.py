"""Histories over a period, of coefficients and back, and friction that is marched along them."""
import numpy as np

INSTANTS, TURNS = 8192, 6


def series(coefficients, tau):
    """Values of (2H+1) coefficients at angles, and of the derivative by the angle."""
    value, slope = np.full(len(tau), coefficients[0]), np.zeros(len(tau))
    for h in range(1, (len(coefficients) + 1) // 2):
        c, s = coefficients[2 * h - 1:2 * h + 1]
        value += c * np.cos(h * tau) + s * np.sin(h * tau)
        slope += h * (s * np.cos(h * tau) - c * np.sin(h * tau))
    return value, slope


def projected(values, tau, n):
    """The first n coefficients of a history."""
    rows = [np.ones(len(tau))]
    for h in range(1, (n + 1) // 2):
        rows += [2.0 * np.cos(h * tau), 2.0 * np.sin(h * tau)]
    return np.array(rows) @ values / len(tau)


def marched(predicted, limit, x=0.0):
    """Coulomb's friction of a predicted force less a position x, turn after turn."""
    force = np.empty_like(predicted)
    for _ in range(TURNS):
        for k in range(len(predicted)):
            trial = predicted[k] - x
            force[k] = min(max(trial, -limit[k]), limit[k])
            x = predicted[k] - force[k]
    return force
