"""Oscillators of one harmonic whose two folds are about to merge: places of folds in closed form.

With one harmonic the element is a complex stiffness N(A) + i D(A) of the amplitude A (describing
function), and the frequency follows from A: (k + N - w^2)^2 + (c w + D)^2 = (F/A)^2. Loads are next
to the one at which the folds merge (a cusp), above and below.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

KINDS = ("cubic", "friction", "gap")
# Amplitudes of a side of the curve; rounds of a finer look at an extremum.
FINE, ROUNDS = 1001, 5
# Of the frequency, and of the load where folds merge.
PLACE, HALVINGS = 2e-6, 30
# Distance of a load from that of the cusp, over it: decades.
NEAREST, FURTHEST = -4.0, -1.0


@dataclass
class Cusp:
    kind: str
    damping: float
    cubic: float = 0.0
    # Of friction: stiffness and limit; of a gap on either side: stiffness and gap.
    stiffness: float = 0.0
    limit: float = 0.0
    offset: float = 0.0
    load: float = field(default=1.0)

    def element(self, a):
        """N and D at amplitudes a."""
        n = 0.75 * self.cubic * a**2
        if self.kind == "friction":
            share = np.minimum(self.limit / self.stiffness / a, 1.0)
            angle = np.arccos(1 - 2 * share)
            return (n + self.stiffness / np.pi * (angle - 0.5 * np.sin(2 * angle)),
                    4 * self.limit * (1 - share) / (np.pi * a))
        if self.kind == "gap":
            share = np.minimum(self.limit / a, 1.0)
            n = n + self.stiffness * (1 - 2 / np.pi * (np.arcsin(share)
                                                       + share * np.sqrt(1 - share**2)))
        return n, np.zeros_like(a)

    def squares(self, a):
        """w^2 on either side of the resonance (n_a, 2); NaN where there is none. Either c or D is
        0."""
        n, d = self.element(a)
        middle = 1 + n - 0.5 * self.damping**2
        with np.errstate(invalid="ignore"):
            root = np.sqrt(middle**2 - (1 + n)**2 - d**2 + (self.load / a)**2)
        return np.stack([middle - root, middle + root], axis=-1)

    @cached_property
    def top(self):
        """The largest amplitude."""
        low, high = 1e-3, 1e3
        for _ in range(60):
            middle = np.sqrt(low * high)
            inside = np.isfinite(self.squares(np.array([middle]))[0, 0])
            low, high = (middle, high) if inside else (low, middle)
        return low

    @property
    def end(self):
        return float(1.4 * np.sqrt(1 + self.element(np.array([self.top]))[0][0]))

    def folds(self):
        """Frequencies where the curve turns, by the amplitudes of an ever finer look."""
        found = []
        for side in (0, 1):
            # The frequency goes like the root of the distance from the top.
            for k in self.extrema(np.linspace(0, 0.95, FINE), side):
                low, high = k
                for _ in range(ROUNDS):
                    places = np.linspace(low, high, FINE // 10)
                    (low, high), *_ = self.extrema(places, side) or [(low, high)]
                found.append(self.frequency(np.array([0.5 * (low + high)]), side)[0])
        return sorted(w for w in found if 0.5 < w < self.end)

    def frequency(self, u, side):
        return np.sqrt(np.maximum(self.squares(self.top * (1 - u**2))[:, side], 0.0))

    def extrema(self, u, side):
        """Intervals of u that hold an extremum."""
        w = self.frequency(u, side)
        turn = np.flatnonzero((w[1:-1] - w[:-2]) * (w[2:] - w[1:-1]) < 0) + 1
        return [(u[k - 1], u[k + 1]) for k in turn]

    def case(self):
        text = ["&case title = 'cusp' analysis = 'frf' /",
                f"&model n_dof = 1, mass = 1, stiffness = 1, damping = {self.damping!r} /",
                f"&load cosine = {self.load!r} /", "&harmonics n_harmonics = 1 /"]
        if self.cubic:
            text.append(f"&spring n_springs = 1, side_1 = 1, coefficient = {self.cubic!r} /")
        if self.kind == "friction":
            text.append("&contact n_pairs = 1, law = 'penalty', side_1 = 1, 0, 0, mu = 0.5,\n"
                        f"   normal_load = {2 * self.limit!r}, tangential_stiffness = "
                        f"{self.stiffness!r} /")
        if self.kind == "gap":
            text.append("&contact n_pairs = 2, law = 'penalty', side_1 = 0, 0, -1, 0, 0, 1,\n"
                        f"   mu = 0, gap = {self.limit!r}, normal_stiffness = "
                        f"{self.stiffness!r} /")
        text.append(f"&sweep start = 0.5, end = {self.end!r}, n_points = 31, "
                    "continuation = 'arclength' /\n")
        return "\n".join(text)


def random_cusp(seed):
    """Two folds that are about to merge, or have merged: the load is next to the one between."""
    rng = np.random.default_rng(20_000 + seed)
    kind = KINDS[seed % len(KINDS)]
    given = {"kind": kind, "damping": float(rng.uniform(0.02, 0.1))}
    low, high = 1e-3, 3.0
    if kind == "cubic":
        given["cubic"] = float(rng.uniform(0.1, 2))
    elif kind == "friction":
        given |= {"damping": 0.0, "cubic": float(rng.uniform(0.1, 2)),
                  "stiffness": float(rng.uniform(0.2, 1)), "limit": float(rng.uniform(0.2, 1))}
        # Above, friction no longer holds the resonance.
        low, high = 0.3 * given["limit"], 1.26 * given["limit"]
    else:
        given |= {"stiffness": float(rng.uniform(0.3, 2)), "limit": float(rng.uniform(0.3, 1.0))}
        low = 1.01 * given["damping"] * given["limit"]
        high = 20 * low
    for _ in range(HALVINGS):
        load = float(np.sqrt(low * high))
        has_folds = len(Cusp(**given, load=load).folds()) > 0
        low, high = (low, load) if has_folds else (load, high)
    away = float(10 ** rng.uniform(NEAREST, FURTHEST) * rng.choice([1.0, 1.0, -1.0]))
    return Cusp(**given, load=high * (1 + away))


@dataclass
class Verdict:
    there: int = 0
    missed: int = 0
    wrong: int = 0
    open: int = 0
    incomplete: bool = False
    n_points: int = 0


def judge(cusp, status, omega, found):
    """found: (kind, omega) of all that the program names."""
    true = cusp.folds()
    verdict = Verdict(len(true), n_points=len(omega))
    verdict.incomplete = status != 0 or abs(omega[-1] / cusp.end - 1) > 1e-9
    left = list(found)
    for w in true:
        near = [f for f in left if abs(f[1] / w - 1) <= PLACE]
        named = [f for f in near if f[0] == "fold"] or near
        if not named:
            verdict.missed += 1
            continue
        left.remove(named[0])
        verdict.open += named[0][0] != "fold"
    verdict.wrong = sum(kind == "fold" for kind, _ in left)
    verdict.open += sum(kind != "fold" for kind, _ in left)
    return verdict
