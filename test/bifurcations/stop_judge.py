"""Exact periods of one mass at a stop: segments of linear motion between the instants of contact.

m = 1:  u'' + c u' + k u = static + cosine cos(omega t), and beyond the gap a further stiffness. In
each segment the motion is known in closed form; contact begins and ends at roots found to
round-off. The force is continuous, so that the monodromy matrix is the product of the segments'.
"""
from __future__ import annotations

import cmath
import math

import numpy as np

# Instants of a period between which contact changes once at most, and halvings of an interval.
GRID, HALVINGS = 400, 60
# Part of the frequency for its differences: their error is of the order of its square.
DIFFERENCE = 1e-5


class Segment:
    """u = Re(A exp(r1 s) + B exp(r2 s)) + mean + Re(X exp(i omega t)), t = t0 + s."""

    def __init__(self, oscillator, closed, omega, t0, u, v):
        _, side, gap, stop = oscillator.stops[0]
        c, k = oscillator.damping[0, 0], oscillator.stiffness[0, 0] + (stop if closed else 0.0)
        self.omega, self.t0 = omega, t0
        self.mean = (oscillator.static[0] + (side * stop * gap if closed else 0.0)) / k
        self.forced = oscillator.cosine[0] / (k - omega**2 + 1j * omega * c)
        root = cmath.sqrt(0.25 * c * c - k)
        self.r1, self.r2 = -0.5 * c + root, -0.5 * c - root
        phase = self.forced * cmath.exp(1j * omega * t0)
        du, dv = u - self.mean - phase.real, v - (1j * omega * phase).real
        self.b = (dv - self.r1 * du) / (self.r2 - self.r1)
        self.a = du - self.b

    def at(self, s):
        """Displacement at times after the start (array)."""
        return (self.a * np.exp(self.r1 * s) + self.b * np.exp(self.r2 * s)).real + self.mean + (
            self.forced * np.exp(1j * self.omega * (self.t0 + s))).real

    def state(self, s):
        one, two = self.a * cmath.exp(self.r1 * s), self.b * cmath.exp(self.r2 * s)
        phase = self.forced * cmath.exp(1j * self.omega * (self.t0 + s))
        return ((one + two).real + self.mean + phase.real,
                (self.r1 * one + self.r2 * two + 1j * self.omega * phase).real)

    def flow(self, s):
        """How the end follows the start."""
        e1, e2, d = cmath.exp(self.r1 * s), cmath.exp(self.r2 * s), self.r2 - self.r1
        matrix = np.array([[self.r2 * e1 - self.r1 * e2, e2 - e1],
                           [self.r1 * self.r2 * (e1 - e2), self.r2 * e2 - self.r1 * e1]]) / d
        return matrix.real


def motion(oscillator, state, omega):
    """End, monodromy, largest |u| and the state at half of a period."""
    _, side, gap, _ = oscillator.stops[0]
    period = 2.0 * math.pi / omega
    grid = np.linspace(0.0, period, GRID + 1)
    u, v = float(state[0]), float(state[1])
    t, monodromy, largest, half = 0.0, np.eye(2), abs(u), None
    depth = side * u - gap
    closed = depth > 0.0 or (depth == 0.0 and side * v > 0.0)
    while True:
        segment = Segment(oscillator, closed, omega, t, u, v)
        later = grid[grid > t + 1e-9 * period]
        values = segment.at(later - t)
        left = (side * values - gap > 0.0) != closed
        first = int(np.argmax(left)) if left.any() else len(later) - 1
        largest = max(largest, np.abs(values[: first + 1]).max())
        end = period
        if left.any():
            low, high = (t if first == 0 else later[first - 1]), later[first]
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                if (side * segment.state(middle - t)[0] - gap > 0.0) != closed:
                    high = middle
                else:
                    low = middle
            end = high
        if half is None and end >= 0.5 * period:
            half = np.array(segment.state(0.5 * period - t))
        monodromy = segment.flow(end - t) @ monodromy
        u, v = segment.state(end - t)
        if not left.any():
            return np.array([u, v]), monodromy, np.array([largest]), half
        t, closed = end, not closed


def period(oscillator, state, omega):
    """What a branch asks for: end, monodromy, derivative by omega, largest |u|, half."""
    end, monodromy, largest, half = motion(oscillator, state, omega)
    d = DIFFERENCE * omega
    by_omega = (motion(oscillator, state, omega + d)[0]
                - motion(oscillator, state, omega - d)[0]) / (2.0 * d)
    return end, monodromy, by_omega, largest, half
