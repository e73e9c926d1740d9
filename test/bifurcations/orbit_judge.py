"""Periodic orbits of small oscillators by shooting, and the bifurcations of their branches.

Shares nothing with the program. The motion, its monodromy matrix and its derivative by the
frequency are integrated in time, and a branch is followed in the state at the start of a period
and the frequency. Forces are continuous, so that a stop adds no jump to the monodromy matrix.
"""
from __future__ import annotations

import ctypes
import os
import subprocess
import tempfile
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import stop_judge

FOLD, DOUBLING, TORUS = "fold", "period doubling", "Neimark-Sacker"
SYMMETRY, BRANCH = "symmetry breaking", "branch point"
# Steps of a period (Runge-Kutta of order 4).
STEPS = 600
# Longest step along the branch, over its scales; corrections; shortest step; points.
LONGEST, CORRECTIONS, SHORTEST, MAX_POINTS = 0.03, 8, 1e-6, 4000
# Of a corrected point, over the size of the motion; of a root, in its interval.
CLOSED, ROOT = 1e-8, 1e-7
TRANSIENT = 40


@dataclass
class Oscillator:
    """M u'' + C u' + K u + springs + stops = static + cosine cos(omega t).

    Springs are (dof, other dof or -1, coefficient, power), stops (dof, side, gap, stiffness): a
    stop pushes back where side * u exceeds the gap; one mass with one stop has closed forms.
    """

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    cosine: np.ndarray
    static: np.ndarray
    springs: list = field(default_factory=list)
    stops: list = field(default_factory=list)

    @property
    def n(self):
        return len(self.cosine)

    def period(self, state, omega):
        """After a period: state, monodromy, derivative by omega; largest |u|, state at half."""
        if self.stops:
            return stop_judge.period(self, state, omega)
        size = 2 * self.n
        given = np.array(state, dtype=float)
        end, largest, half = np.empty((size + 2, size)), np.empty(self.n), np.empty(size)
        kernel().period(self.n, len(self.springs), STEPS, ctypes.c_double(omega),
                        *map(address, (*self.arrays, given, end, largest, half)))
        return end[0], end[1:-1].T, end[-1], largest, half

    @cached_property
    def arrays(self):
        """What the integration takes, divided by the mass."""
        inverse = np.linalg.inv(self.mass)
        direction = np.zeros((len(self.springs), self.n))
        for k, (i, j, _, _) in enumerate(self.springs):
            direction[k, i] = 1.0
            if j >= 0:
                direction[k, j] = -1.0
        values = [inverse @ self.damping, inverse @ self.stiffness, inverse @ self.cosine,
                  inverse @ self.static, direction, direction @ inverse.T,
                  [spring[2] for spring in self.springs]]
        return [*(np.ascontiguousarray(v, dtype=float) for v in values),
                np.array([spring[3] for spring in self.springs], dtype=np.int32)]


def address(array):
    return array.ctypes.data_as(ctypes.c_void_p)


@cache
def kernel():
    """The integration in C, compiled by the compiler that the program needs as well."""
    source = Path(__file__).with_name("orbit_period.c")
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "orbit_period.so"
        subprocess.run([os.environ.get("CC", "cc"), "-std=c11", "-O2", "-shared", "-fPIC", "-o",
                        library, source, "-lm"], check=True)
        return ctypes.CDLL(str(library))


@dataclass
class Point:
    state: np.ndarray
    omega: float
    tangent: np.ndarray
    monodromy: np.ndarray
    by_omega: np.ndarray
    amplitude: np.ndarray
    half: np.ndarray
    iterations: int = 0

    @property
    def multipliers(self):
        return np.linalg.eigvals(self.monodromy)

    def unstable(self):
        """Real multipliers above 1 and below -1, complex ones outside the circle."""
        m = self.multipliers
        real = np.abs(m.imag) < 1e-9
        return (int((real & (m.real > 1.0)).sum()), int((real & (m.real < -1.0)).sum()),
                int((~real & (np.abs(m) > 1.0)).sum()))

    def test(self, kind):
        """A function whose sign changes at a bifurcation of a kind."""
        m = self.multipliers
        if kind == FOLD:
            return float(self.tangent[-1])
        if kind == DOUBLING:
            return float(np.real(np.prod(m + 1.0)))
        if kind == TORUS:
            pair = m[np.abs(m.imag) >= 1e-9]
            if not len(pair):
                return -1.0
            return float(np.abs(pair).max() - 1.0)
        return float(np.real(np.prod(m - 1.0)))

    def is_symmetric(self):
        return np.abs(self.half + self.state).max() < 1e-5 * np.abs(self.state).max()


@dataclass
class Bifurcation:
    kind: str
    omega: float
    amplitude: np.ndarray


class Branch:
    """Periodic orbits from one frequency to another, and where their stability changes."""

    def __init__(self, oscillator, start, finish):
        self.oscillator, self.start, self.finish = oscillator, start, finish
        self.span = abs(finish - start)
        self.scale = 1.0
        self.points, self.bifurcations = [], []
        self.complete = False

    def weights(self, omega):
        """Displacements and velocities over their sizes, frequency over a third of the range."""
        n = self.oscillator.n
        return np.concatenate([np.full(n, 1.0 / self.scale), np.full(n, 1.0 / (self.scale * omega)),
                               [3.0 / self.span]])

    def correct(self, state, omega, tangent=None):
        """Newton's method across the tangent, or at a fixed frequency."""
        w = self.weights(omega)
        row = np.zeros(len(w))
        row[-1] = 1.0
        if tangent is not None:
            row = tangent
        for k in range(CORRECTIONS):
            end, monodromy, by_omega, amplitude, half = self.oscillator.period(state, omega)
            rest = np.append(state - end, 0.0)
            if not np.isfinite(rest).all():
                return None
            matrix = np.vstack([np.column_stack([monodromy - np.eye(len(end)), by_omega]) / w, row])
            if np.abs(rest[:-1] * w[:-1]).max() < CLOSED:
                break
            step = np.linalg.solve(matrix, rest) / w
            state, omega = state + step[:-1], omega + step[-1]
            if not 0.3 * min(self.start, self.finish) < omega < 3.0 * max(self.start, self.finish):
                return None
        else:
            return None
        new = np.linalg.solve(matrix, np.append(np.zeros(len(end)), 1.0))
        return Point(state, omega, new / np.linalg.norm(new), monodromy, by_omega, amplitude, half,
                     k)

    def at(self, a, b, share):
        """The point of the branch at a share of the way between two."""
        w = self.weights(a.omega)
        first, last = np.append(a.state, a.omega) * w, np.append(b.state, b.omega) * w
        chord = np.linalg.norm(last - first)
        s = share
        z = ((1 + 2 * s) * (1 - s) ** 2 * first + s**2 * (3 - 2 * s) * last
             + chord * (s * (1 - s) ** 2 * self.tangent(a, w)
                        - s**2 * (1 - s) * self.tangent(b, w)))
        return self.correct((z / w)[:-1], (z / w)[-1], (last - first) / chord)

    @staticmethod
    def tangent(point, w):
        """The tangent in the present scales."""
        size = len(point.state)
        matrix = np.column_stack([point.monodromy - np.eye(size), point.by_omega]) / w
        new = np.linalg.svd(matrix)[2][-1]
        return new * np.sign(new @ point.tangent)

    def begin(self):
        """From the linear response through transients to an orbit."""
        o = self.oscillator
        dynamic = o.stiffness - self.start**2 * o.mass + 1j * self.start * o.damping
        u = np.linalg.solve(dynamic, o.cosine)
        guess = np.concatenate([u.real + np.linalg.solve(o.stiffness, o.static),
                                -self.start * u.imag])
        for _ in range(TRANSIENT):
            guess, _, _, amplitude, _ = o.period(guess, self.start)
        self.scale = amplitude.max()
        here = self.correct(guess, self.start)
        if here is not None and here.tangent[-1] * (self.finish - self.start) < 0.0:
            here.tangent = -here.tangent
        return here

    def follow(self):
        """All points, until the end of the range or where no step leads on."""
        here = self.begin()
        ds = 0.01
        while here is not None and len(self.points) < MAX_POINTS:
            self.points.append(here)
            new = None
            while new is None:
                w = self.weights(here.omega)
                here.tangent = self.tangent(here, w)
                z = np.append(here.state, here.omega) + ds * here.tangent / w
                new = self.correct(z[:-1], z[-1], here.tangent)
                if new is not None and (new.tangent @ here.tangent < 0.97 or new.iterations > 5):
                    new = None
                if new is None:
                    ds *= 0.5
                    if ds < SHORTEST:
                        return
            self.look(here, new)
            self.complete = (new.omega - self.finish) * (self.finish - self.start) > 0.0
            if self.complete or (new.omega - self.start) * (self.finish - self.start) < 0.0:
                return
            ds = min(LONGEST, ds * (1.5 if new.tangent @ here.tangent > 0.995 else 1.0))
            here = new
            self.scale = max(0.5 * self.scale, new.amplitude.max())

    def look(self, a, b):
        """Locate what lies between two neighbours (Illinois)."""
        for kind in self.between(a, b):
            low, high, at_low, at_high = 0.0, 1.0, a.test(kind), b.test(kind)
            point = a
            for _ in range(50):
                share = 0.5 * (low + high)
                if at_low * at_high < 0.0:
                    share = (low * at_high - high * at_low) / (at_high - at_low)
                point = self.at(a, b, share)
                if point is None or high - low < ROOT:
                    break
                value = point.test(kind)
                if abs(value) < 1e-9:
                    break
                if value * a.test(kind) > 0.0:
                    low, at_low, at_high = share, value, 0.5 * at_high
                else:
                    high, at_high, at_low = share, value, 0.5 * at_low
            if point is None:
                continue
            # At the place itself the response across the tangent is free.
            if kind == BRANCH and a.is_symmetric():
                kind = SYMMETRY
            if min(self.start, self.finish) < point.omega < max(self.start, self.finish):
                self.bifurcations.append(Bifurcation(kind, point.omega, point.amplitude))

    @staticmethod
    def between(a, b):
        kinds = []
        before, after = a.unstable(), b.unstable()
        if a.test(FOLD) * b.test(FOLD) < 0.0:
            kinds.append(FOLD)
        if (before[0] - after[0]) % 2 != len(kinds):
            kinds.append(BRANCH)
        if (before[1] - after[1]) % 2:
            kinds.append(DOUBLING)
        if before[2] != after[2] and sum(before) != sum(after):
            kinds.append(TORUS)
        return kinds
