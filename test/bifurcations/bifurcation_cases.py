"""Random oscillators whose branches have bifurcations, as cases and as oscillators of the judge."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from orbit_judge import Branch, Oscillator

# A cubic spring that folds; a strong one, whose symmetric vibrations lose their symmetry; a static
# load beside a cubic spring, which doubles periods; a stop; two equal masses in phase, whose
# vibration modulates the stiffness against each other; two masses, one of twice the frequency of
# the other, with a square spring between them: where the slower one is driven, both exchange energy
# in a rhythm of their own (Nayfeh, Mook 1979, Nonlinear oscillations, section 6.5).
FAMILIES = ("folds", "symmetry", "doubling", "stop", "parametric", "torus")
HARMONICS = {"folds": 15, "symmetry": 31, "doubling": 31, "stop": 21, "parametric": 15,
             "torus": 15}


@dataclass
class Sample:
    family: str
    seed: int
    oscillator: Oscillator
    start: float
    finish: float
    stability: bool = True

    def branch(self):
        return Branch(self.oscillator, self.start, self.finish)

    def case(self):
        """The namelist."""
        o = self.oscillator
        text = ["&case analysis = 'frf' /",
                f"&model n_dof = {o.n}, mass = {numbers(o.mass)}",
                f"   stiffness = {numbers(o.stiffness)}, damping = {numbers(o.damping)} /",
                f"&load cosine = {numbers(o.cosine)}, static = {numbers(o.static)} /"]
        if o.springs:
            i, j, coefficient, power = zip(*o.springs)
            text.append(f"&spring n_springs = {len(i)}, side_1 = {numbers(np.array(i) + 1)}, "
                        f"side_2 = {numbers(np.array(j) + 1)},\n   coefficient = "
                        f"{numbers(coefficient)}, power = {numbers(power)} /")
        for i, side, gap, stiffness in o.stops:
            # The normal displacement opens: a stop above has it with the other sign.
            text.append(f"&contact law = 'penalty', n_pairs = 1, side_1 = 0, 0, {-side * (i + 1)}, "
                        f"side_2 = 0, 0, 0,\n   mu = 0, gap = {gap!r}, normal_stiffness = "
                        f"{stiffness!r}, tangential_stiffness = 1 /")
        text += [f"&harmonics n_harmonics = {HARMONICS[self.family]} /",
                 f"&sweep start = {self.start!r}, end = {self.finish!r}, n_points = 41",
                 "   continuation = 'arclength', max_points = 3000, "
                 f"stability = .{str(self.stability).lower()}. /",
                 "&output observe = 1 /", ""]
        return "\n".join(text)


def numbers(values):
    return ", ".join(repr(value.item()) for value in np.ravel(values))


def rounded(value):
    return float(f"{value:.4g}")


def random_sample(family, seed):
    """A case of a family; the same for the same seed."""
    rng = np.random.default_rng([FAMILIES.index(family), seed])
    one, zero = np.eye(1), np.zeros(1)

    def uniform(low, high):
        return rounded(rng.uniform(low, high))

    if family == "folds":
        c, cubic = uniform(0.03, 0.15), uniform(0.2, 2.0)
        load = uniform(1.0, 4.0) * rounded(c * np.sqrt(c / cubic) * 2.0)
        return Sample(family, seed, Oscillator(one, c * one, one, np.array([rounded(load)]), zero,
                                               [(0, -1, cubic, 3)]), 0.5, 3.0)
    if family == "symmetry":
        c, load, cubic = uniform(0.2, 0.4), uniform(1.0, 4.0), uniform(0.5, 2.0)
        # The upper branch ends where damping takes the load: start above that.
        top = rounded(1.2 * np.sqrt(1.0 + 0.87 * load * np.sqrt(cubic) / c))
        return Sample(family, seed, Oscillator(one, c * one, uniform(0.05, 1.0) * one,
                                               np.array([load]), zero, [(0, -1, cubic, 3)]),
                      top, 0.6)
    if family == "doubling":
        return Sample(family, seed, Oscillator(
            one, uniform(0.08, 0.2) * one, one, np.array([uniform(0.5, 2.0)]),
            np.array([uniform(0.3, 1.0)]), [(0, -1, uniform(0.5, 1.5), 3)]), 4.0, 0.9)
    if family == "stop":
        side, damping = int(rng.choice([-1, 1])), uniform(0.06, 0.15)
        # Near its stop it doubles periods; from further away the resonance runs into it and folds.
        gap, load = uniform(-0.1, 0.3), uniform(0.2, 0.6)
        if seed % 2:
            gap, load = uniform(0.4, 1.2), uniform(0.1, 0.3)
        return Sample(family, seed, Oscillator(one, damping * one, one, np.array([load]), zero,
                                               stops=[(0, side, gap, uniform(1.0, 8.0))]),
                      2.6, 0.75)
    if family == "torus":
        ratio = np.diag([1.0, rounded(4.0 * (1.0 + rng.uniform(-0.03, 0.05)))])
        return Sample(family, seed, Oscillator(
            np.eye(2), uniform(0.015, 0.03) * np.eye(2), ratio,
            np.array([uniform(0.05, 0.12), 0.0]), np.zeros(2), [(0, 1, uniform(0.2, 0.35), 2)]),
                      1.4, 0.85)
    c, cubic = uniform(0.02, 0.08), uniform(0.3, 1.0)
    square = uniform(0.0, 0.5) if rng.random() < 0.5 else 0.0
    coupling = uniform(0.02, 0.3)
    stiffness = np.array([[1.0 + coupling, -coupling], [-coupling, 1.0 + coupling]])
    springs = [(i, -1, cubic, 3) for i in (0, 1)]
    if square > 0.0:
        springs += [(i, -1, square, 2) for i in (0, 1)]
    load = uniform(0.1, 0.4)
    return Sample(family, seed, Oscillator(np.eye(2), c * np.eye(2), stiffness,
                                           np.array([load, load]), np.zeros(2), springs), 2.6, 0.6)
