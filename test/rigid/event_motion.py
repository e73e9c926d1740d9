"""Masses with rigid friction integrated from event to event: an independent reference.

    M q'' + C q' + K q + B^T lambda = f0 + Re(f1 exp(i omega t)),   lambda_j in Q_j Sgn(u_j'),

u_j being single dofs. Between events the motion is that of a linear system, in closed form by the
eigenvectors of its matrix; events are bracketed on a fine grid and refined to round-off. The
periodic motion is found by periods, then by Newton's method with differences.
"""
from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import brentq

#: Cells of a period in which an event is bracketed, for each wave of the fastest mode.
CELLS = 400
#: Change of the state over a period, relative to its size, that counts as none.
DRIFT = 1e-10
#: Plain periods before Newton's method, and its steps.
PERIODS, STEPS = 40, 25


@dataclass
class Structure:
    """Matrices, loads, and friction limits by dof."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    static: np.ndarray
    cosine: np.ndarray
    omega: float
    limit: dict[int, float]
    cache: dict = field(default_factory=dict)

    @property
    def n(self):
        """Degrees of freedom."""
        return len(self.mass)

    def linear(self, stuck):
        """The dofs that move: their numbers, eigenvalues, vectors, inverse, answer."""
        if stuck not in self.cache:
            free = [i for i in range(self.n) if i not in stuck]
            m, c, k = (a[np.ix_(free, free)] for a in (self.mass, self.damping, self.stiffness))
            z, one = np.zeros((len(free), len(free))), np.eye(len(free))
            inverse = np.linalg.inv(m)
            values, vectors = np.linalg.eig(np.block([[z, one], [-inverse @ k, -inverse @ c]]))
            answer = np.linalg.solve(k - self.omega**2 * m + 1j * self.omega * c,
                                     self.cosine[free].astype(complex))
            self.cache[stuck] = (free, values, vectors, np.linalg.inv(vectors), answer, k)
        return self.cache[stuck]


class Piece:
    """The motion from an instant on, while no event happens."""

    def __init__(self, structure, start, q, v, direction):
        """Direction: +1, -1, or 0 where it sticks, by dof of friction."""
        self.structure, self.start, self.q = structure, start, q
        self.direction = direction
        stuck = tuple(sorted(i for i, s in direction.items() if s == 0))
        self.stuck = stuck
        self.free, self.values, self.vectors, inverse, self.answer, k = structure.linear(stuck)
        force = structure.static.copy()
        for i, s in direction.items():
            force[i] -= s * structure.limit[i]
        force = force[self.free] - structure.stiffness[np.ix_(self.free, stuck)] @ q[list(stuck)]
        self.mean = np.linalg.solve(k, force) if len(self.free) else np.zeros(0)
        wave = np.exp(1j * structure.omega * start)
        x = np.concatenate([q[self.free] - self.mean - (self.answer * wave).real,
                            v[self.free] - (1j * structure.omega * self.answer * wave).real])
        self.amplitude = inverse @ x

    def at(self, t):
        """q, v, a at instants (3, n, n_t)."""
        t = np.atleast_1d(t)
        omega, n = self.structure.omega, len(self.free)
        parts = self.vectors @ (self.amplitude[:, None] * np.exp(np.outer(self.values,
                                                                         t - self.start)))
        slopes = self.vectors[n:] @ ((self.amplitude * self.values)[:, None]
                                     * np.exp(np.outer(self.values, t - self.start)))
        wave = np.outer(self.answer, np.exp(1j * omega * t))
        out = np.zeros((3, self.structure.n, len(t)))
        out[0] = self.q[:, None]
        out[0, self.free] = self.mean[:, None] + (wave + parts[:n]).real
        out[1, self.free] = (1j * omega * wave + parts[n:]).real
        out[2, self.free] = (-omega**2 * wave + slopes).real
        return out

    def friction(self, i, t):
        """What a stuck dof transmits."""
        s, (q, v, a) = self.structure, self.at(t)
        load = s.static[i] + s.cosine[i] * np.cos(s.omega * np.atleast_1d(t))
        return load - s.stiffness[i] @ q - s.damping[i] @ v - s.mass[i] @ a

    def margins(self, t):
        """One row a dof of friction, above zero until its event: s v, and Q - |lambda|."""
        _, v, _ = self.at(t)
        rows = []
        for i, s in self.direction.items():
            if s == 0:
                rows.append(self.structure.limit[i] - abs(self.friction(i, t)))
            else:
                rows.append(s * v[i])
        return np.array(rows)


def next_direction(structure, t, q, v, direction, dof):
    """Directions behind an event of one dof, where its velocity is zero or its friction at the
    limit."""
    if direction[dof] == 0:
        piece = Piece(structure, t, q, v, direction)
        return {**direction, dof: int(np.sign(piece.friction(dof, t)[0]))}
    held = {**direction, dof: 0}
    force = Piece(structure, t, q, v, held).friction(dof, t)[0]
    if abs(force) <= structure.limit[dof]:
        return held
    return {**direction, dof: int(np.sign(force))}


def turn(structure, q, v, direction, keep=None):
    """One period; the state at its end, and the pieces if a list is given."""
    period = 2 * np.pi / structure.omega
    fastest = np.sqrt(np.linalg.eigvals(np.linalg.solve(structure.mass, structure.stiffness)).real
                      .max())
    cell = period / (CELLS * max(1.0, fastest / structure.omega))
    t, events = 0.0, 0
    q, v = q.copy(), v.copy()
    while t < period:
        events += 1
        assert events < 2000, "chatter"
        piece = Piece(structure, t, q, v, direction)
        root, dof = next_event(piece, t, period, cell)
        if keep is not None:
            keep.append((t, root, piece))
        q, v, _ = piece.at(root)[:, :, 0]
        t = root
        if dof is not None:
            if direction[dof] != 0:
                v[dof] = 0.0
            direction = next_direction(structure, t, q, v, direction, dof)
    return q, v, direction


def next_event(piece, t, period, cell):
    """The first event behind an instant, and its dof."""
    dofs = list(piece.direction)
    start = t
    # Just behind an event the margin of its dof rises from zero.
    skip = 1e-7 * period
    while start < period:
        grid = np.minimum(start + cell * np.arange(65), period)
        if start == t:
            grid[0] = min(t + skip, period)
        margin = piece.margins(grid)
        below = (margin < 0) & (grid > t + 0.5 * skip)
        if below.any():
            column = int(np.argmax(below.any(axis=0)))
            best, found = period, None
            for row in np.flatnonzero(below[:, column]):
                if column == 0:
                    root = grid[0]
                else:
                    root = brentq(lambda s, row=row: piece.margins(s)[row, 0], grid[column - 1],
                                  grid[column], xtol=1e-15, rtol=1e-15)
                if root <= best:
                    best, found = root, dofs[row]
            return best, found
        start = grid[-1]
    return period, None


def periodic(structure):
    """State and directions at the start of the periodic motion, and its drift."""
    q, v = np.zeros(structure.n), np.zeros(structure.n)
    direction = dict.fromkeys(structure.limit, 0)
    for i in structure.limit:
        held = Piece(structure, 0.0, q, v, direction).friction(i, 0.0)[0]
        if abs(held) > structure.limit[i]:
            direction[i] = int(np.sign(held))
    state = pack(q, v, direction)
    for _ in range(PERIODS):
        before = state[0]
        state = step(structure, state)
        if np.linalg.norm(state[0] - before) <= DRIFT * np.linalg.norm(state[0]):
            return state, drift(structure, state)
    for _ in range(STEPS):
        moved = step(structure, state)
        defect = moved[0] - state[0]
        size = np.linalg.norm(moved[0])
        if np.linalg.norm(defect) <= DRIFT * size:
            return moved, np.linalg.norm(defect) / size
        matrix = np.zeros((len(defect), len(defect)))
        for j in range(len(defect)):
            other = state[0].copy()
            other[j] += 1e-6 * size
            matrix[:, j] = (step(structure, (other, state[1]))[0] - moved[0]) / (1e-6 * size)
        change = np.linalg.lstsq(np.eye(len(defect)) - matrix, defect, rcond=1e-10)[0]
        trial = (state[0] + change, moved[1])
        for i, s in trial[1].items():
            if s == 0:
                trial[0][structure.n + i] = 0.0
        after = step(structure, trial)
        better = np.linalg.norm(after[0] - trial[0]) < 0.7 * np.linalg.norm(defect)
        state = trial if better else moved
    return state, drift(structure, state)


def pack(q, v, direction):
    """State as a vector, with directions."""
    return np.concatenate([q, v]), direction


def step(structure, state):
    """A period."""
    n = structure.n
    v = state[0][n:].copy()
    direction = {}
    for i, s in state[1].items():
        direction[i] = s if s == 0 else (int(np.sign(v[i])) or s)
    return pack(*turn(structure, state[0][:n], v, direction))


def drift(structure, state):
    """Relative change over a period."""
    moved = step(structure, state)[0]
    return np.linalg.norm(moved - state[0]) / np.linalg.norm(moved)


def history(structure, state, n_time):
    """Displacements at uniform instants of a period (n, n_time)."""
    pieces = []
    n = structure.n
    turn(structure, state[0][:n], state[0][n:], state[1], pieces)
    t = 2 * np.pi / structure.omega * np.arange(n_time) / n_time
    out = np.zeros((n, n_time))
    for start, end, piece in pieces:
        inside = (t >= start) & (t < end)
        if inside.any():
            out[:, inside] = piece.at(t[inside])[0]
    return out, pieces
