"""Structures with joints for the stress suite: small, random where a seed says so, in any units."""
from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np


@dataclass(frozen=True)
class Joint:
    """A structure, its contact pairs and loads; SI units unless scaled."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    static: np.ndarray
    cosine: np.ndarray
    sine: np.ndarray
    side_1: np.ndarray = field(default_factory=lambda: np.zeros((0, 3), int))
    mu: float = 0.4
    gap: np.ndarray | float = 0.0
    normal_load: np.ndarray | float = 0.0
    contact_stiffness: float = 1.0
    modal_damping: float = 0.0

    @property
    def n_dof(self):
        return len(self.mass)

    @property
    def n_pairs(self):
        return len(self.side_1)

    def with_(self, **changes):
        """The same joint with other properties."""
        return replace(self, **changes)

    def in_units(self, length, mass, time=1.0):
        """The same joint written in units that many times smaller than its own."""
        force = mass * length / time**2
        stiff = force / length
        return self.with_(
            mass=self.mass * mass, damping=self.damping * stiff * time,
            stiffness=self.stiffness * stiff, static=self.static * force,
            cosine=self.cosine * force, sine=self.sine * force,
            gap=np.asarray(self.gap) * length, normal_load=np.asarray(self.normal_load) * force,
            contact_stiffness=self.contact_stiffness * stiff)


def interface(n_pairs, seed=1, directions=2, n_masses=3, preload=1.0, massive=0.0, loss=0.02):
    """Masses in a chain that stands on n_pairs contacts with the ground.

    Each pair has its own node behind springs of random size to two of the masses, and a soft one
    to the ground, so that it has a place where it is open. directions: tangential ones. preload:
    mean compressive force of the pairs over the amplitude of the excitation. massive: mass of the
    nodes over that of the chain.
    """
    rng = np.random.default_rng(seed)
    n = n_masses * 3 + n_pairs * 3
    stiffness, mass = np.zeros((n, n)), np.zeros((n, n))

    def connect(i, j, k):
        stiffness[i, i] += k
        if j is None:
            return
        stiffness[j, j] += k
        stiffness[i, j] -= k
        stiffness[j, i] -= k

    for m in range(n_masses):
        for axis in range(3):
            i = 3 * m + axis
            mass[i, i] = rng.uniform(0.5, 1.5)
            connect(i, i + 3 if m + 1 < n_masses else None, rng.uniform(0.5, 1.5))
            connect(i, None, 0.05)
    side_1 = np.zeros((n_pairs, 3), int)
    static, cosine = np.zeros(n), np.zeros(n)
    for p in range(n_pairs):
        first = 3 * (n_masses + p)
        for axis in range(3):
            i, a, b = first + axis, rng.integers(n_masses), rng.integers(n_masses)
            connect(i, 3 * a + axis, rng.uniform(0.5, 1.5) / np.sqrt(n_pairs))
            # Rubbing pushes: the normal of a pair feels the tangential motion a little.
            connect(i, 3 * b + (axis + 1) % 3, 0.1 * rng.uniform() / np.sqrt(n_pairs))
            connect(i, None, 0.02)
            mass[i, i] = massive * rng.uniform(0.5, 1.5)
            side_1[p, axis] = i + 1
        static[first + 2] = -preload * rng.uniform(0.5, 1.5)
    if directions == 1:
        side_1[:, 1] = 0
    cosine[0], cosine[1] = 1.0, 0.3
    sine = np.roll(cosine, 1)
    return Joint(mass, stiffness, loss * stiffness, static, cosine, sine, side_1)


def slider(normal_load=0.4, damping=0.1):
    """One mass on a spring, rubbing on rigid ground under a constant load."""
    one = np.ones((1, 1))
    return Joint(one, one, damping * one, np.zeros(1), np.ones(1), np.zeros(1),
                 np.array([[1, 0, 0]]), normal_load=normal_load)


def stop(gap=0.5, damping=0.05, preload=0.0):
    """One mass against a stop, behind a massless node."""
    stiffness = np.array([[2.0, -1.0], [-1.0, 1.0 + 1e-2]])
    return Joint(np.diag([1.0, 0.0]), stiffness, damping * np.diag([1.0, 0.0]),
                 np.array([preload, 0.0]), np.array([1.0, 0.0]), np.zeros(2),
                 np.array([[0, 0, 2]]), gap=gap)


def frequencies(joint):
    """Natural frequencies with every pair open [rad/s]."""
    flexibility = np.linalg.solve(joint.stiffness, joint.mass)
    values = np.sort(np.linalg.eigvals(flexibility).real)[::-1]
    return np.sort(1.0 / np.sqrt(values[values > 1e-10 * values[0]]))
