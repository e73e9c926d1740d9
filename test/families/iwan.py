"""Joints of Iwan, against Jenkins elements in parallel."""
from pathlib import Path

import joints
import numpy as np

TITLE = "Joints of Iwan"
TEXT = """
Chains of one to six masses with one to four joints, between masses or to the ground: exponents chi
from -0.9 to 1, beta from 0 to 3, limits over one and a half decades, loads over four, a static load
in a third; 1 to 15 harmonics, one frequency from half to 2.5 times the lowest one without joints.

The judge takes the displacements and the forces of the result. The balance of every harmonic is
written anew, and has to hold to 1e-7 of the load. Each joint is 2,000 Jenkins elements in parallel,
marched over 8,192 instants of two periods from the assembly: coefficients within 2e-4 of the
largest force, and the work. Where there are 5 harmonics or more in a third of the cases the
structure with
600 elements a joint is integrated for 25 periods from the solution on, by central differences: it
stays there, but for what the harmonics leave (0.5/H**2 of the largest amplitude).
"""
COUNT = 100
SMALL = (0, 1, 3, 4)
COLUMNS, ZERO = joints.COLUMNS, joints.ZERO
ALSO = [Path(joints.__file__)]
SLIDERS = 2000


def draw_joint(random):
    return {"iwan_chi": random.uniform(-0.9, 1.0),
            "iwan_beta": float(random.choice([0.0, random.uniform(0.0, 3.0)]))}


def elements(joint, n):
    """Stiffnesses (of y = k u: they add up to 1) and limits of Jenkins elements."""
    chi, beta, limit = joint["iwan_chi"], joint["iwan_beta"], joint["limit"]
    ratio = (chi + 1.0) / (chi + 2.0)
    largest = limit * (1.0 + beta) / (beta + ratio)
    edges = np.linspace(0.0, 1.0, n + 1)**2
    stiffness = np.diff(edges**(chi + 1.0)) / (1.0 + beta)
    bounds = largest * ratio * np.diff(edges**(chi + 2.0)) / (1.0 + beta)
    return (np.append(stiffness, beta / (1.0 + beta)),
            np.append(bounds, largest * beta / (1.0 + beta)))


class Sliders:
    """Jenkins elements that are taken along by a displacement, from the assembly on."""

    def __init__(self, joint, n):
        self.stiffness, self.limit = elements(joint, n)
        self.force = np.zeros_like(self.limit)
        self.y = 0.0

    def __call__(self, y):
        self.force += self.stiffness * (y - self.y)
        np.clip(self.force, -self.limit, self.limit, out=self.force)
        self.y = y
        return self.force.sum()


def march(joint, y):
    sliders = Sliders(joint, SLIDERS)
    for _ in range(2):
        values = np.array([sliders(value) for value in y])
    return values


def integrate(case, u, base):
    if case["harmonics"] < 5 or int(1e6 * case["omega"]) % 3 or case["omega"] < 0.1:
        return None
    answers = []
    for joint in case["joints"]:
        answers.append(Sliders(joint, 600))
        for value in joint["stiffness"] * joints.elongation(joint, u) @ base[:, ::8]:
            answers[-1](value)
    return joints.stepped(case, u, base, answers, 2048)


def trial(seed, program, folder):
    return joints.judged(joints.drawn(seed, draw_joint), "iwan", ("iwan_chi", "iwan_beta"), march,
                         integrate, program, folder)
