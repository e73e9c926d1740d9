"""Whether the motion of a sector, repeated around the annulus, solves the annulus, in NumPy: then
an annulus that found another motion has two."""
from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "stress"), str(HERE.parent / "oracles")]

import numpy as np  # noqa: E402
import slow_balance as slow  # noqa: E402
import stress_check  # noqa: E402


def delayed(values, angle):
    """Coefficients (2H+1, ..) of the same motion, later by an angle of the period."""
    values = values.copy()
    for n in range(1, (len(values) + 1) // 2):
        u = (values[2 * n - 1] - 1j * values[2 * n]) * np.exp(-1j * n * angle)
        values[2 * n - 1], values[2 * n] = u.real, -u.imag
    return values


def annulus_defect(annulus, case, omega, coefficients, force, n_time):
    """Larger one of the defects of equilibrium and of the law, over load and forces.

    Of ``law = 'dlft_velocity'`` sampled at n_time instants.
    """
    phase = 2.0 * np.pi * case["engine_order"] / case["n_sectors"]
    around = [j * phase for j in range(case["n_sectors"])]
    motion = np.zeros((len(coefficients), annulus.maps[0].shape[1]))
    for t, angle in zip(annulus.maps, around):
        own = t[annulus.inner]
        motion += delayed(coefficients, angle)[:, annulus.inner] @ own
    forces = np.concatenate([delayed(force, angle) for angle in around], axis=1)
    whole = annulus.case
    contact, size = whole["contact"], motion.shape[1]
    rows = np.vstack([slow.pair_rows(*sides, size)
                      for sides in zip(contact["side_1"], contact["side_2"])])
    mass, damping, stiffness = (np.array(whole["model"][name])
                                for name in ("mass", "damping", "stiffness"))
    used, eps = np.any(rows != 0.0, axis=1), np.zeros(len(rows))
    eps[used] = np.abs(stress_check.condensed_diagonal(stiffness, rows[used]))
    eps = eps.reshape(-1, 3)
    relative = motion @ rows.T
    prediction = eps * relative.reshape(forces.shape)
    speed = stress_check.derivative(relative).reshape(forces.shape)
    prediction[:, :, :2] = (eps * speed)[:, :, :2]
    prediction[0, :, 2] += eps[:, 2] * np.array(contact["gap"])
    prediction += forces
    synthesis = slow.synthesis(len(motion) // 2, n_time)
    history = (synthesis.T @ prediction.reshape(len(motion), -1)).reshape(n_time, -1, 3)
    weights = 2.0 / n_time * synthesis
    weights[0] /= 2.0
    made = stress_check.project(history, np.array(contact["mu"])).reshape(n_time, -1)
    law = np.abs((weights @ made).reshape(forces.shape) - forces).max() / np.abs(forces).max()
    load = np.zeros_like(motion)
    load[0], load[1], load[2] = (whole["load"][name] for name in ("static", "cosine", "sine"))
    balance = slow.equilibrium((mass, damping, stiffness), omega, motion,
                               forces.reshape(len(forces), -1) @ rows, load)
    return float(max(law, balance))
