"""Whether a converged point is one: equations, contact law and energy, formed anew in NumPy.

The displacements of every dof and the contact forces come from the result file; nothing else of
the program is used. The residual is split in two, as the unknowns are: equilibrium of the whole
structure under the forces of the file, and the forces that the contact law makes of the motion.
"""
from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "oracles"))
import slow_balance as slow

# On the residual over the vibratory load. The program asks 1e-8 of the condensed equations; the
# norms of condensed and whole loads differ by the flexibility of the structure.
RESIDUAL = 1e-6
#: Times a residual that is stated: of the condensed equations, where this one is of the whole.
LAG = 2.0
# A static load of this many times the vibratory one counts as much, as in the program.
STATIC_SHARE = 1e-5
# Round-off of the terms of an equation, of the size of the largest of them: 4500 epsilon.
ROUND_OFF = 1e-12
# Beyond this share of the load round-off leaves nothing to verify.
UNKNOWN = 1e-2
# Turns of the march; where it creeps, Newton steps on the position after a turn go on from there.
TURNS, NEWTON_STEPS = 30, 40


def pair_matrix(joint):
    """Relative displacements, three rows a pair, from the dofs."""
    return np.vstack([slow.pair_rows(side, (0, 0, 0), joint.n_dof) for side in joint.side_1])


def modal_damping(mass, stiffness, ratio):
    """C = sum of 2 ratio omega_j (M phi_j)(M phi_j)^T over the modes of unit mass."""
    from scipy.linalg import eigh
    # The massless dofs follow the others.
    has_mass = np.diag(mass) > 0.0
    kept, free = np.flatnonzero(has_mass), np.flatnonzero(~has_mass)
    reduced = stiffness[np.ix_(kept, kept)]
    if len(free):
        reduced = reduced - stiffness[np.ix_(kept, free)] @ np.linalg.solve(
            stiffness[np.ix_(free, free)], stiffness[np.ix_(free, kept)])
    squares, modes = eigh(reduced, mass[np.ix_(kept, kept)])
    shapes = mass[np.ix_(kept, kept)] @ modes
    damping = np.zeros_like(mass)
    damping[np.ix_(kept, kept)] = shapes * (2 * ratio * np.sqrt(np.maximum(squares, 0))) @ shapes.T
    return damping


def condensed_diagonal(matrix, rows):
    """Diagonal of the matrix condensed to the relative displacements of these rows."""
    from scipy.linalg import null_space
    lift = np.linalg.pinv(rows)
    inner = null_space(rows)
    coupling = lift.T @ matrix @ inner
    block = lift.T @ matrix @ lift - coupling @ np.linalg.solve(inner.T @ matrix @ inner,
                                                                inner.T @ matrix @ lift)
    return np.diag(block)


def penalties(joint, matrices, rows, omega):
    """eps of the pairs (n_pairs, 3): static stiffness, dynamic where there is none."""
    mass, damping, stiffness = matrices
    used = np.flatnonzero(np.any(rows != 0.0, axis=1))
    eps = np.zeros(len(rows))
    static = np.abs(condensed_diagonal(stiffness, rows[used]))
    dynamic = np.abs(condensed_diagonal(stiffness - omega**2 * mass + 1j * omega * damping,
                                        rows[used]))
    eps[used] = np.where(static <= 1e-6 * dynamic, dynamic, static)
    eps = eps.reshape(-1, 3)
    there = np.any(rows != 0.0, axis=1).reshape(-1, 3)[:, :2]
    mean = eps[:, :2].sum(1) / np.maximum(there.sum(1), 1)
    eps[:, :2] = np.where(there.any(1), mean, 0.0)[:, None]
    return eps


def turn(prediction, bound, x, force=None):
    """Positions (n_pairs, 2) after one turn of the march; forces are kept where asked for."""
    for k, predicted in enumerate(prediction[:, :, :2]):
        trial = predicted - x
        size = np.hypot(trial[:, 0], trial[:, 1])
        slips = size > bound[k]
        trial = trial * np.where(slips, bound[k] / np.where(slips, size, 1.0), 1.0)[:, None]
        x = np.where(slips[:, None], predicted - trial, x)
        if force is not None:
            force[k, :, :2] = trial
    return x


def march(prediction, mu, scale):
    """Forces (instant, pair, component) of all pairs at once; whether they repeat."""
    bound = mu * np.maximum(-prediction[:, :, 2], 0.0)
    x = np.zeros((prediction.shape[1], 2))
    for _ in range(TURNS):
        before, x = x, turn(prediction, bound, x)
        if np.abs(x - before).max() <= 1e-12 * scale:
            break
    else:
        x = limit(prediction, bound, x, scale)
    force = np.zeros_like(prediction)
    after = turn(prediction, bound, x, force)
    force[:, :, 2] = -np.maximum(-prediction[:, :, 2], 0.0)
    return force, np.abs(after - x).max() <= 1e-9 * scale


def limit(prediction, bound, x, scale):
    """Fixed point of a turn, by Newton's method with differences, two plain turns in between."""
    step = 1e-7 * scale
    for _ in range(NEWTON_STEPS):
        after = turn(prediction, bound, x)
        move = after - x
        if np.abs(move).max() <= 1e-13 * scale:
            break
        matrix = np.empty((len(x), 2, 2))
        for c in range(2):
            shift = np.zeros(2)
            shift[c] = step
            matrix[:, :, c] = (turn(prediction, bound, x + shift) - after) / step
        newton = np.linalg.solve(np.eye(2) * (1 + 1e-12) - matrix, move[:, :, None])[:, :, 0]
        small = np.linalg.norm(newton, axis=1) <= scale
        x = np.where(small[:, None], x + newton, after)
        x = turn(prediction, bound, turn(prediction, bound, x))
    return x


def project(prediction, mu):
    """Forces of the velocity-level law: no memory."""
    force = prediction.copy()
    bound = mu * np.maximum(-prediction[:, :, 2], 0.0)
    size = np.hypot(force[:, :, 0], force[:, :, 1])
    slips = size > bound
    force[:, :, :2] *= np.where(slips, bound / np.where(slips, size, 1.0), 1.0)[:, :, None]
    force[:, :, 2] = -np.maximum(-prediction[:, :, 2], 0.0)
    return force


def derivative(coefficients):
    """du/dtau."""
    rates = np.zeros_like(coefficients)
    for n in range(1, (len(coefficients) + 1) // 2):
        rates[2 * n - 1] = n * coefficients[2 * n]
        rates[2 * n] = -n * coefficients[2 * n - 1]
    return rates


def analysis_matrix(case, n_coefficients, n_time):
    """Coefficients from values at the instants: projection, or a fit at some of them."""
    synthesis = slow.synthesis(n_coefficients // 2, n_time)
    harmonics = case.groups["harmonics"]
    method = harmonics.get("method", "hbm")
    if method in ("hbm", "hdhb"):
        weights = 2.0 / n_time * synthesis
        weights[0] /= 2.0
        return weights
    points = n_coefficients
    if method == "tcm_least_squares":
        points = min(max(harmonics.get("n_collocation", 0) or 2 * n_coefficients,
                         n_coefficients), n_time)
    instants = (np.arange(points) * n_time) // points
    weights = np.zeros_like(synthesis)
    weights[:, instants] = np.linalg.pinv(synthesis[:, instants]).T
    return weights


class Verdict:
    """Why a point is not what it says; empty where it is."""

    def __init__(self):
        self.complaints = []

    def require(self, size, limit, what):
        if not size <= limit:
            self.complaints.append(f"{what}: {size:.2e} > {limit:.2e}")


def verify(case, omega, displacement, force, dissipation, lag=0.0):
    """Complaints about one converged point (2H+1, n_dof), (2H+1, n_pairs, 3), (n_pairs).

    lag: residual over the vibratory load that the row itself states, where pseudo-time lets the
    vibration lag behind the depth.
    """
    residual = RESIDUAL + LAG * lag
    joint, verdict = case.joint, Verdict()
    stiffness = joint.stiffness
    damping = joint.damping + (modal_damping(joint.mass, stiffness, joint.modal_damping)
                               if joint.modal_damping else 0.0)
    matrices = (joint.mass, damping, stiffness)
    load = np.zeros_like(displacement)
    load[0], load[1], load[2] = joint.static, joint.cosine, joint.sine
    vibratory = np.linalg.norm(load[1:])
    rows = pair_matrix(joint) if joint.n_pairs else np.zeros((0, joint.n_dof))
    eps = np.zeros((joint.n_pairs, 3))
    if joint.n_pairs:
        if case.law == "penalty":
            eps = np.where(np.any(rows != 0.0, axis=1).reshape(-1, 3), joint.contact_stiffness, 0.0)
            there = eps[:, :2].any(1)
            eps[:, :2] = np.where(there, joint.contact_stiffness, 0.0)[:, None]
        else:
            eps = case.penalty_scale * penalties(joint, matrices, rows, case.first_omega)
    static = np.linalg.norm(load[0]) + np.linalg.norm(eps[:, 2] * joint.gap)
    reference = max(vibratory, STATIC_SHARE * (static + np.linalg.norm(joint.normal_load)))
    if reference == 0.0:
        reference = 1.0

    # Equilibrium, and how well these numbers can tell.
    contact = force.reshape(len(force), -1) @ rows if joint.n_pairs else 0.0 * load
    defect = slow.equilibrium(matrices, omega, displacement, contact, load) * np.linalg.norm(load)
    terms = term_size(matrices, omega, displacement) + np.linalg.norm(contact)
    slack = ROUND_OFF * terms
    verdict.require(defect, residual * reference + slack, "equilibrium")
    verdict.require(np.finfo(float).eps * terms, UNKNOWN * max(reference, static,
                                                              np.linalg.norm(contact)),
                    "round-off over the load")

    if joint.n_pairs:
        check_law(case, verdict, rows, eps, displacement, force, reference, slack, residual)
    check_energy(case, verdict, omega, damping, displacement, force, rows, load, dissipation, slack,
                 residual)
    return verdict.complaints


def term_size(matrices, omega, displacement):
    """Norm of |Z| |u|: what cancels in the equations."""
    mass, damping, stiffness = (np.abs(m) for m in matrices)
    total = np.linalg.norm(stiffness @ np.abs(displacement[0])) ** 2
    for n in range(1, (len(displacement) + 1) // 2):
        w = n * omega
        size = np.hypot(displacement[2 * n - 1], displacement[2 * n])
        total += np.linalg.norm((stiffness + w**2 * mass + w * damping) @ size) ** 2
    return np.sqrt(total)


def check_law(case, verdict, rows, eps, displacement, force, reference, slack, residual):
    joint, nc = case.joint, len(displacement)
    relative = (displacement @ rows.T).reshape(nc, -1, 3)
    prediction = eps * relative
    if case.law == "dlft_velocity":
        prediction[:, :, :2] = (eps * derivative(relative.reshape(nc, -1)).reshape(nc, -1, 3)
                                )[:, :, :2]
    prediction[0, :, 2] += eps[:, 2] * joint.gap
    if case.law != "penalty":
        prediction = prediction + force
    n_time = case.n_time
    synthesis = slow.synthesis(nc // 2, n_time)
    history = (synthesis.T @ prediction.reshape(nc, -1)).reshape(n_time, -1, 3)
    without = joint.side_1[:, 2] == 0
    history[:, without, 2] = -np.broadcast_to(joint.normal_load, joint.n_pairs)[without]
    if case.law == "dlft_velocity":
        made, repeats = project(history, joint.mu), True
    else:
        scale = np.abs(prediction[:, :, :2]).sum(axis=(0, 2)).max() + 1e-300
        made, repeats = march(history, joint.mu, scale)
    if not repeats:
        verdict.complaints.append("the march does not repeat")
    weights = analysis_matrix(case, nc, n_time)
    made = (weights @ made.reshape(n_time, -1)).reshape(nc, -1, 3)
    difference = made - force
    # A component that is not there carries nothing; a velocity says nothing of a stuck mean.
    difference[:, ~np.any(rows != 0.0, axis=1).reshape(-1, 3)] = 0.0
    if case.law == "dlft_velocity":
        stuck = np.all(np.hypot(history[:, :, 0], history[:, :, 1])
                       <= joint.mu * np.maximum(-history[:, :, 2], 0.0), axis=0)
        difference[0, stuck, :2] = 0.0
    slack = slack + ROUND_OFF * np.linalg.norm(prediction)
    verdict.require(np.linalg.norm(difference), residual * reference + slack, "contact law")


def check_energy(case, verdict, omega, damping, u, force, rows, load, dissipation, slack,
                 residual):
    """Work of the load = viscous + friction; Galerkin's projection keeps it at any H."""
    if case.groups["harmonics"].get("method", "hbm").startswith("tcm"):
        return
    work_in = np.pi * (load[1] @ u[2] - load[2] @ u[1])
    apparent = np.pi * np.linalg.norm(load[1:3]) * np.linalg.norm(u[1:])
    viscous = friction = 0.0
    relative = u @ rows.T
    lam = force.reshape(len(u), -1) if len(rows) else np.zeros((len(u), 0))
    for n in range(1, (len(u) + 1) // 2):
        viscous += np.pi * n**2 * omega * (u[2 * n - 1] @ damping @ u[2 * n - 1]
                                           + u[2 * n] @ damping @ u[2 * n])
        friction += np.pi * n * (lam[2 * n - 1] @ relative[2 * n]
                                 - lam[2 * n] @ relative[2 * n - 1])
    size = apparent + abs(viscous) + abs(friction)
    limit = 10 * residual * size + 10 * np.pi * len(u) * slack * np.linalg.norm(u)
    verdict.require(abs(work_in - viscous - friction), limit, "energy balance")
    if dissipation is not None:
        verdict.require(abs(dissipation.sum() - friction), limit, "dissipation of the file")
