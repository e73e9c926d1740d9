"""The equations of the harmonic balance, written for obviousness and sharing no code with it.

A solution is checked, not computed: equilibrium of every harmonic, and the contact forces that
the contact law makes of the displacements and forces of the result file.
"""
from __future__ import annotations

import numpy as np

# Turns of the march at most; a friction element settles within a few.
TURNS = 20
# What is left of the change from turn to turn where it has settled: round-off.
SETTLED = 1e-15


def synthesis(n_harmonics, n_time):
    """Rows 1, cos tau, sin tau, cos 2 tau, .. at the instants."""
    tau = 2.0 * np.pi * np.arange(n_time) / n_time
    rows = [np.ones(n_time)]
    for n in range(1, n_harmonics + 1):
        rows += [np.cos(n * tau), np.sin(n * tau)]
    return np.array(rows)


def analyse(history, n_harmonics):
    """Coefficients 0, c1, s1, .. of a history whose first index is the instant."""
    n_time = len(history)
    coefficients = 2.0 / n_time * synthesis(n_harmonics, n_time) @ history
    coefficients[0] /= 2.0
    return coefficients


def pair_rows(side_1, side_2, n_dof):
    """Matrix of the relative displacement (component, dof) of one pair of signed dof numbers."""
    rows = np.zeros((3, n_dof))
    for sign, side in ((1.0, side_1), (-1.0, side_2)):
        for component, dof in enumerate(side):
            if dof:
                rows[component, abs(dof) - 1] += sign * np.sign(dof)
    return rows


def equilibrium(matrices, omega, displacement, contact, load):
    """Residual of M u'' + C u' + K u + contact - load, relative to the load, all (2H+1, n_dof)."""
    mass, damping, stiffness = matrices
    residual = np.empty_like(displacement)
    residual[0] = stiffness @ displacement[0]
    for n in range(1, (len(displacement) + 1) // 2):
        cosine, sine, w = displacement[2 * n - 1], displacement[2 * n], n * omega
        residual[2 * n - 1] = (stiffness - w**2 * mass) @ cosine + w * damping @ sine
        residual[2 * n] = (stiffness - w**2 * mass) @ sine - w * damping @ cosine
    return np.linalg.norm(residual + contact - load) / np.linalg.norm(load)


def march(prediction, mu):
    """Contact forces (instant, component) of one pair from the predicted ones."""
    force, x = np.zeros_like(prediction), np.zeros(2)
    for _ in range(TURNS):
        before = force.copy()
        for k, predicted in enumerate(prediction):
            pressure, trial = max(-predicted[2], 0.0), predicted[:2] - x
            size = np.hypot(*trial)
            if size > mu * pressure:
                trial = mu * pressure * trial / size
                x = predicted[:2] - trial
            force[k] = [*trial, -pressure]
        if np.abs(force - before).max() <= SETTLED * np.abs(force).max():
            break
    return force


def automatic_penalty(stiffness, rows):
    """Static stiffness of each contact component; both tangential ones share their mean."""
    used = np.flatnonzero(np.any(rows != 0.0, axis=1))
    penalty = np.zeros(len(rows))
    flexibility = rows[used] @ np.linalg.solve(stiffness, rows[used].T)
    penalty[used] = np.abs(np.diag(np.linalg.inv(flexibility)))
    for first in range(0, len(rows), 3):
        tangential = [i for i in (first, first + 1) if i in used]
        penalty[tangential] = np.mean(penalty[tangential]) if tangential else 0.0
    return penalty


def law_defect(force, relative, gap, mu, stiffness, n_time, rigid, normal_load=0.0):
    """What the contact law makes of a solution, less the contact force of that solution.

    force, relative: coefficients (2H+1, 3) of one pair. A rigid law predicts the force itself
    plus penalty times displacement, an elastic one its stiffness times displacement.
    """
    n_harmonics = len(force) // 2
    prediction = stiffness * relative
    prediction[0, 2] += stiffness[2] * gap
    if rigid:
        prediction = prediction + force
    history = synthesis(n_harmonics, n_time).T @ prediction
    if stiffness[2] == 0.0:
        history[:, 2] = -normal_load
    made = analyse(march(history, mu), n_harmonics)
    return np.abs(made - force).max() / np.abs(force).max()
