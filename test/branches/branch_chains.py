"""Random chains that are linear but for a spring of nothing, and what NumPy makes of them."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# A spring so weak that the response is linear to the last digit, but a branch is followed.
NOTHING = 1e-16
# Of a row, over the load: the solver's tolerance, and what the coordinates of the program make
# of a norm.
EQUILIBRIUM = 1e-7
# Points of the fine sweep within a half-power width, and in how many of them it is fine.
PER_WIDTH, WIDTHS = 60, 12
# A maximum counts as a resonance where the amplitude falls by this part of it on both sides.
PROMINENCE = 0.1
# ... and where it is this part of the norm of the response there: a branch is true to the whole
# response, to 0.5 % of it.
SHARE = 0.05
# Part of the true maximum that the branch has to reach, as a resonance that is not skipped.
REACHED = 0.6


@dataclass
class Chain:
    """Masses in a row, between walls; modal damping."""

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    force: np.ndarray
    start: float
    end: float
    omega: np.ndarray
    width: np.ndarray

    def response(self, omega):
        """Complex amplitudes (n_omega, n_dof) and their slopes by omega."""
        omega = np.atleast_1d(omega)[:, None, None]
        dynamic = self.stiffness - omega**2 * self.mass + 1j * omega * self.damping
        force = np.broadcast_to(self.force[:, None], (len(omega), len(self.force), 1))
        u = np.linalg.solve(dynamic, force.astype(complex))
        slope = -np.linalg.solve(dynamic, (1j * self.damping - 2 * omega * self.mass) @ u)
        return u[..., 0], slope[..., 0]

    def residual(self, omega, u):
        """Of the equation of motion, over the load (n_omega)."""
        omega = omega[:, None, None]
        dynamic = self.stiffness - omega**2 * self.mass + 1j * omega * self.damping
        left = (dynamic @ u[..., None])[..., 0] - self.force
        return np.linalg.norm(left, axis=1) / np.linalg.norm(self.force)

    def fine(self):
        """Frequencies that miss nothing of the response."""
        around = [w + b * np.sinh(np.linspace(-6, 6, 2 * PER_WIDTH * WIDTHS)) for w, b
                  in zip(self.omega, self.width, strict=True)]
        omega = np.concatenate([np.linspace(self.start, self.end, 4000), *around])
        return np.unique(omega[(omega >= self.start) & (omega <= self.end)])

    def case(self, n_points, extra=""):
        def row(matrix):
            return ", ".join(repr(float(x)) for x in np.ravel(matrix))
        return f"""&case title = 'chain' analysis = 'frf' /
&model n_dof = {len(self.force)}, mass = {row(self.mass)},
   stiffness = {row(self.stiffness)},
   damping = {row(self.damping)} /
&spring n_springs = 1, side_1 = 1, coefficient = {NOTHING} /
&load cosine = {row(self.force)} /
&harmonics n_harmonics = 1 /
&sweep start = {self.start!r}, end = {self.end!r}, n_points = {n_points},
   continuation = 'arclength' {extra} /
"""


def random_chain(seed):
    """2 to 4 masses, damping of 0.1 to 2 % of critical in every mode."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    mass = np.diag(rng.uniform(0.5, 2, n))
    springs = rng.uniform(0.2, 2, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) \
        - np.diag(springs[1:-1], -1)
    root = np.sqrt(np.diag(mass))
    square, modes = np.linalg.eigh(stiffness / np.outer(root, root))
    omega, modes = np.sqrt(square), modes / root[:, None]
    ratio = 10 ** rng.uniform(-3, np.log10(0.02), n)
    left = mass @ modes
    damping = left @ np.diag(2 * ratio * omega) @ left.T
    force = np.where(rng.random(n) < 0.6, rng.uniform(-1, 1, n), 0)
    force[rng.integers(n)] = 1.0
    return Chain(mass, stiffness, damping, force, float(0.4 * omega[0]),
                 float(1.3 * omega[-1]), omega,
                 2 * ratio * omega)


def resonances(amplitude):
    """Indices of the local maxima that stand out."""
    top = np.flatnonzero((amplitude[1:-1] > amplitude[:-2])
                         & (amplitude[1:-1] >= amplitude[2:])) + 1
    found = []
    for k in top:
        floor = (1 - PROMINENCE) * amplitude[k]
        left = amplitude[:k][::-1]
        right = amplitude[k + 1:]
        higher = [np.flatnonzero(side > amplitude[k]) for side in (left, right)]
        reach = [side[:h[0]] if len(h) else side
                 for side, h in zip((left, right), higher, strict=True)]
        if all(len(side) and side.min() < floor for side in reach):
            found.append(k)
    return found


def extent(fine, amplitude, k):
    """Where the amplitude around a maximum is above the part that has to be reached."""
    below = np.flatnonzero(amplitude < REACHED * amplitude[k])
    left, right = below[below < k], below[below > k]
    return (fine[left[-1]] if len(left) else fine[0], fine[right[0]] if len(right) else fine[-1])


@dataclass
class Verdict:
    """What is wrong with a branch."""

    n_points: int = 0
    turned: bool = False
    incomplete: bool = False
    skipped: int = 0
    off: bool = False
    interpolation: float = 0.0


def judge(chain, omega, coefficients, status):
    """Compare the rows of a result (n_points, 3, n_dof) with the linear response."""
    verdict = Verdict(len(omega))
    verdict.incomplete = status != 0 or abs(omega[-1] / chain.end - 1) > 1e-12
    verdict.turned = bool((np.diff(omega) <= 0).any())
    u = coefficients[:, 1] - 1j * coefficients[:, 2]
    exact, slope = chain.response(omega)
    verdict.off = bool((chain.residual(omega, u) > EQUILIBRIUM).any())
    fine = chain.fine()
    truth = chain.response(fine)[0]
    for dof in range(len(chain.force)):
        amplitude = np.abs(truth[:, dof])
        for k in resonances(amplitude):
            if amplitude[k] < SHARE * np.linalg.norm(truth[k]):
                continue
            low, high = extent(fine, amplitude, k)
            near = (omega >= low) & (omega <= high)
            verdict.skipped += np.abs(u[near, dof]).max(initial=0.0) < REACHED * amplitude[k]
    if not verdict.turned:
        verdict.interpolation = cubic_error(fine, truth, omega, exact, slope)
    return verdict


def cubic_error(fine, truth, omega, u, slope):
    """What cubics through points and slopes miss, of the norm of the response there."""
    inside = (fine >= omega[0]) & (fine <= omega[-1])
    fine, truth = fine[inside], truth[inside]
    k = np.clip(np.searchsorted(omega, fine) - 1, 0, len(omega) - 2)
    h = (omega[k + 1] - omega[k])[:, None]
    s = (fine - omega[k])[:, None] / h
    cubic = ((1 + 2 * s) * (1 - s)**2 * u[k] + s**2 * (3 - 2 * s) * u[k + 1]
             + h * s * (1 - s) * ((1 - s) * slope[k] - s * slope[k + 1]))
    error = np.linalg.norm(cubic - truth, axis=1) / np.linalg.norm(truth, axis=1)
    return float(error.max())
