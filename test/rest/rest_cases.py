"""Random structures whose pairs shake down: they slip while the load comes on, and never again.

The judge shares no code with the program: the structure with its pairs held is linear, and a pair
is swept by its discs (Moreau's catching-up scheme) until none of them moves it, in NumPy alone. Of
the program it takes two numbers: the instants, and that a march is measured in the mean of the
static stiffnesses of the directions of a pair, which are those of the balance reduced to the pairs.
"""
from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import numpy as np
from cases import merged

#: Instants of uniform sampling.
N_TIME = 128
N_HARMONICS = 3
#: Sweeps of a pair, and movement in one, as a part of its forces, that is round-off.
MAX_SWEEPS = 200_000
AT_REST = 1e-15
#: Movement of the means that ends the outer iteration, and what a disc may be violated by.
SETTLED = 1e-13
INSIDE = 1e-9


@dataclass
class Rest:
    """Matrices, loads, and pairs as lists of one or two dofs with their limits mu N."""
    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    static: np.ndarray
    cosine: np.ndarray
    sine: np.ndarray
    omega: float
    pairs: list = field(default_factory=list)
    limit: list = field(default_factory=list)

    @property
    def rows(self):
        """Dofs of the pairs, one after the other."""
        return np.concatenate(self.pairs)


def random_rest(seed):
    """Two to four dofs; one or two pairs with one or two directions, whose static load is one to
    three times what they hold, and whose vibration is below it."""
    rng = np.random.default_rng(seed)
    shape = [[2], [2], [2, 1], [1], [2, 2], [1, 1]][int(rng.integers(6))]
    used = sum(shape)
    n = used + int(rng.integers(0, 3))
    root = rng.uniform(-1.0, 1.0, (n, n))
    stiffness = 0.3 * root @ root.T + np.diag(rng.uniform(0.5, 2.0, n))
    mass = np.diag(rng.uniform(0.5, 1.5, n))
    damping = 0.02 * stiffness
    omega = float(rng.uniform(0.1, 0.6))
    dofs = rng.permutation(n)[:used]
    pairs = np.split(dofs, np.cumsum(shape)[:-1])
    limit = [float(rng.uniform(0.5, 2.0)) for _ in pairs]
    loads = np.zeros((3, n))
    for pair, bound in zip(pairs, limit, strict=True):
        direction = rng.normal(size=len(pair))
        loads[0, pair] = bound * rng.uniform(1.1, 3.0) * direction / np.linalg.norm(direction)
        loads[1:, pair] = 0.5 * bound * rng.uniform(-1.0, 1.0, (2, len(pair)))
    return Rest(mass, damping, stiffness, *loads, omega, list(pairs), limit)


def groups(case, changes, law="dlft_velocity"):
    """The case of `fw_run`, with changes to some keys."""
    pairs = case.pairs
    result = {
        "case": {"analysis": "point", "threads": 1},
        "model": {"n_dof": len(case.mass), "mass": case.mass.ravel().tolist(),
                  "damping": case.damping.ravel().tolist(),
                  "stiffness": case.stiffness.ravel().tolist()},
        "contact": {"n_pairs": len(pairs), "law": law,
                    "side_1": [d for p in pairs for d in [*[*(p + 1).tolist(), 0, 0][:2], 0]],
                    "mu": 1.0, "normal_load": case.limit},
        "load": {"static": case.static.tolist(), "cosine": case.cosine.tolist(),
                 "sine": case.sine.tolist()},
        "harmonics": {"n_harmonics": N_HARMONICS, "n_time": N_TIME},
        "sweep": {"start": case.omega}, "solver": {"tolerance": 1e-11}}
    return merged(result, changes)


def reaction(case, n_time):
    """Forces that hold the pairs at zero (rows, n_time), and what a mean position of them adds:
    the static stiffness of the rows."""
    rows = case.rows
    free = np.setdiff1d(np.arange(len(case.mass)), rows)
    tau = 2 * np.pi * np.arange(n_time) / n_time
    held = np.zeros((len(rows), n_time))
    condensed = None
    for n, load in ((0, case.static.astype(complex)), (1, case.cosine - 1j * case.sine)):
        s = n * case.omega
        z = case.stiffness - s**2 * case.mass + 1j * s * case.damping
        inner = np.linalg.solve(z[np.ix_(free, free)], np.column_stack(
            [load[free], z[np.ix_(free, rows)]])) if len(free) else np.zeros((0, 1 + len(rows)))
        force = load[rows] - z[np.ix_(rows, free)] @ inner[:, 0]
        held += np.real(force[:, None] * np.exp(1j * n * tau))
        if n == 0:
            condensed = np.real(z[np.ix_(rows, rows)] - z[np.ix_(rows, free)] @ inner[:, 1:])
    return held, condensed


def swept(y, limit):
    """Where a pair that starts at zero is left by the discs of radius `limit` about y
    (directions, n_time)."""
    x = np.zeros(len(y))
    scale = np.abs(y).max()
    for _ in range(MAX_SWEEPS):
        before = x.copy()
        for centre in y.T:
            d = centre - x
            length = np.sqrt(d @ d)
            if length > limit:
                x = centre - limit * d / length
        if np.abs(x - before).max() <= AT_REST * scale:
            return x
    return None


def judged(case, n_time=N_TIME):
    """Mean positions of the rows where the pairs come to rest; None where they do not."""
    held, stiffness = reaction(case, n_time)
    parts = np.split(np.arange(len(case.rows)), np.cumsum([len(p) for p in case.pairs])[:-1])
    measure = np.concatenate([np.full(len(p), np.diag(stiffness)[p].mean()) for p in parts])

    def move(q):
        y = held + (measure * q - stiffness @ q)[:, None]
        x = [swept(y[p], bound) for p, bound in zip(parts, case.limit, strict=True)]
        return None if any(v is None for v in x) else np.concatenate(x) / measure

    q = np.zeros(len(case.rows))
    for _ in range(500):
        after = move(q)
        if after is None:
            return None
        change = after - q
        q = q + 0.5 * change
        if np.abs(change).max() <= SETTLED * np.abs(q).max():
            break
    else:
        return None
    force = held - (stiffness @ q)[:, None]
    worst = max(np.linalg.norm(force[p], axis=0).max() / bound
                for p, bound in zip(parts, case.limit, strict=True))
    return q if worst <= 1.0 + INSIDE and np.abs(q).max() > 0.0 else None
