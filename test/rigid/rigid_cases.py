"""Structures with rigid friction on their masses, as cases of fw_run, and errors of its answers."""
from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import cases
from event_motion import Piece, Structure, history, periodic
from project import PROGRAM

#: Instants at which motions are compared.
N_TIME = 4096
#: A reference that drifts more over a period is none.
GOOD_DRIFT = 1e-9
TOLERANCE = 1e-11
#: Vibration, as a part of the largest, that is none.
AT_REST = 1e-6


def groups(structure, law, n_harmonics, tail=0, **contact):
    """A case of analysis 'point'; dlft at its best, with located events."""
    pairs = list(structure.limit)
    result = {
        "case": {"analysis": "point", "threads": 1},
        "model": {"n_dof": structure.n, "mass": structure.mass, "damping": structure.damping,
                  "stiffness": structure.stiffness},
        "contact": {"n_pairs": len(pairs), "law": law,
                    "side_1": [d for i in pairs for d in (i + 1, 0, 0)],
                    "mu": [1.0] * len(pairs),
                    "normal_load": [structure.limit[i] for i in pairs], **contact},
        "load": {"static": structure.static, "cosine": structure.cosine},
        "harmonics": {"n_harmonics": n_harmonics, "sampling": "events"},
        "sweep": {"start": structure.omega},
        "solver": {"tolerance": TOLERANCE},
    }
    if tail:
        result["output"] = {"tail": tail}
    return result


def answer(folder, structure, law, n_harmonics, tail=0, program=PROGRAM, **contact):
    """Coefficients (2H+1, n), whether they converged, and the iterations."""
    case = groups(structure, law, n_harmonics, tail, **contact)
    cases.run(folder, case, status=(0, 4), program=program)
    with h5py.File(folder / "case.h5") as file:
        return file["coefficients"][0], bool(file["converged"][0]), int(file["iterations"][0])


def synthesis(coefficients, n_time):
    """Motions (n, n_time) from coefficients (2H+1, n)."""
    tau = 2 * np.pi * np.arange(n_time) / n_time
    n_harmonics = (len(coefficients) - 1) // 2
    waves = [np.ones(n_time)]
    for n in range(1, n_harmonics + 1):
        waves += [np.cos(n * tau), np.sin(n * tau)]
    return coefficients.T @ np.array(waves)


def error(coefficients, reference):
    """Root mean square over the period, relative to the vibration, of the worst dof."""
    vibration = reference - reference.mean(axis=1, keepdims=True)
    difference = synthesis(coefficients, reference.shape[1]) - reference
    return (np.linalg.norm(difference, axis=1) / np.linalg.norm(vibration, axis=1)).max()


def reference_of(structure):
    """One period of the motion (n, N_TIME); None where the judge is not sure, or where a pair that
    never slips leaves the position to the way there."""
    try:
        state, drift = periodic(structure)
    except AssertionError:
        return None
    if drift > GOOD_DRIFT:
        return None
    motion, pieces = history(structure, state, N_TIME)
    slips = {i for _, _, piece in pieces for i, s in piece.direction.items() if s != 0}
    moved = np.ptp(motion, axis=1)
    # Having come to rest, a pair may still slip by round-off.
    rests = any(moved[i] < AT_REST * moved.max() for i in structure.limit)
    return None if slips != set(structure.limit) or rests or moved.max() < AT_REST else motion


def chain(masses, springs, dampers, cosine, static, omega, limit):
    """Masses one after another from the ground on."""
    n = len(masses)
    stiffness, damping = np.zeros((n, n)), np.zeros((n, n))
    for matrix, values in ((stiffness, springs), (damping, dampers)):
        for i, value in enumerate(values):
            matrix[i, i] += value
            if i > 0:
                matrix[i - 1, i - 1] += value
                matrix[[i - 1, i], [i, i - 1]] -= value
    return Structure(np.diag(np.asarray(masses, dtype=float)), damping, stiffness,
                     np.asarray(static, dtype=float), np.asarray(cosine, dtype=float), omega,
                     limit)


#: One mass; two, the second or both of which rub; three, the second of which does.
ONE = chain([1.0], [1.0], [0.1], [1.0], [0.0], 0.3, {0: 0.5})
TWO = chain([1.0, 0.5], [1.0, 1.0], [0.02, 0.02], [1.0, 0.0], [0.0, 0.0], 0.6, {1: 0.35})
BOTH = chain([1.0, 0.5], [1.0, 1.0], [0.02, 0.02], [1.0, 0.3], [0.0, 0.1], 0.6, {0: 0.3, 1: 0.25})
THREE = chain([1.0, 0.5, 0.7], [1.0, 1.0, 1.0], [0.02, 0.02, 0.02], [1.0, 0.3, 0.0],
              [0.0, 0.1, 0.0], 0.4, {1: 0.3})
#: Static loads push what rubs off its middle; a slow load lets the mass stop and start again.
LOADED = chain([1.0, 0.5, 0.7], [1.0, 1.0, 1.0], [0.02, 0.02, 0.02], [1.0, 0.3, 0.0],
               [0.3, 0.2, -0.1], 0.5, {2: 0.35})
STOPPING = chain([1.0, 0.2], [1.0, 2.0], [0.02, 0.02], [1.0, 0.0], [0.0, 0.0], 0.17, {1: 0.3})


def random_structure(seed):
    """One to three masses, one or two of which rub, near and off resonance, some with a static
    load; friction from 15 to 85 % of what would hold the masses."""
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 4))
    masses, springs = random.uniform(0.3, 1.5, n), random.uniform(0.5, 2.0, n)
    dampers = random.uniform(0.01, 0.05, n) * springs
    cosine = random.uniform(-1.0, 1.0, n)
    rub = random.permutation(n)[:int(random.integers(1, min(n, 2) + 1))]
    static = np.where(random.uniform() < 0.3, random.uniform(-0.4, 0.4, n), 0.0)
    structure = chain(masses, springs, dampers, cosine, static, 1.0, {})
    first = np.sqrt(np.linalg.eigvals(structure.stiffness / masses[:, None]).real.min())
    structure.omega = float(first * random.uniform(0.3, 1.4))
    structure.limit = dict.fromkeys(map(int, rub), 0.0)
    held = Piece(structure, 0.0, np.zeros(n), np.zeros(n), dict.fromkeys(map(int, rub), 0))
    t = 2 * np.pi / structure.omega * np.arange(64) / 64
    for i in map(int, rub):
        amplitude = np.ptp(steady_friction(structure, held, i, t)) / 2
        structure.limit[i] = float(amplitude * random.uniform(0.15, 0.85)
                                   + abs(static[i]) * random.uniform(0.0, 1.2))
    return structure


def steady_friction(structure, held, i, t):
    """What a dof that sticks transmits when all else has settled."""
    held.amplitude = np.zeros_like(held.amplitude)
    return held.friction(i, t) - structure.static[i]
