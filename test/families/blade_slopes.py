"""Derivatives by what the sectors of random disks differ by, against differences."""
from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "cyclic"), str(HERE.parent / "support"), str(HERE.parents[1])]

import numpy as np  # noqa: E402
from annulus import random_case  # noqa: E402
from cases import read, run  # noqa: E402
from deviations import draw, write  # noqa: E402

TITLE = "Derivatives by the deviations of blades"
TEXT = """
Sectors without symmetry, 2 to 8 of them, engine orders from -N to 2 N, 0 to 2 pairs in a sector
with elastic or regularised friction, 1 to 5 harmonics, deviations up to 10 % of blade frequencies
and damping on random rows, of stiffness and mass of a blade, beside matrices of single sectors.
Derivatives of the first harmonic, the largest displacement and the work of friction of all sectors,
by one value of each kind and by the scale of all. Judge: central differences of fourth order of
solutions at other values, with steps of two lengths. Where these two differ by more than 2e-7 of
the largest derivative something has its corner there, and nothing is judged. Different: by more
than 1e-6.
"""
COUNT = 100
SMALL = range(5)
COLUMNS = {"slopes": "derivatives", "equal": "equal", "wrong": "different",
           "corner": "at a corner", "unsolved": "not solved"}
ZERO = ("wrong",)
ALSO = [HERE.parent / "cyclic" / name for name in ("annulus.py", "deviations.py")]
STEPS = (4e-4, 2e-4)
STENCIL = ((-2, 1.0 / 12.0), (-1, -8.0 / 12.0), (1, 8.0 / 12.0), (2, -1.0 / 12.0))
EXACT, SMOOTH = 1e-6, 2e-7
WORDS = ("frequency", "damping_ratio", "stiffness", "mass", "scale")
QUANTITIES = ("first_harmonic", "largest", "dissipation")


class Disk:
    """A random disk at one frequency, of any deviations."""

    def __init__(self, seed, program, folder):
        self.program, self.folder = program, folder
        self.rng = rng = np.random.default_rng([67, seed])
        n_sectors = int(rng.integers(2, 9))
        self.law = str(rng.choice(["penalty", "regularised"]))
        self.case = random_case(
            rng, law=self.law, n_sectors=n_sectors, n_pairs=int(rng.integers(0, 3)),
            engine_order=int(rng.integers(-n_sectors, 2 * n_sectors + 1)))
        self.parts, self.scale, _ = draw(rng, self.case, "together", float(rng.uniform(0.02, 0.1)))
        self.n_harmonics = int(rng.integers(1, 6))
        self.omega = float(rng.uniform(0.6, 2.2))

    def solve(self, parts, scale, **more):
        write(self.folder / "model.h5", self.case, parts)
        pairs = len(self.case["contact"]["side_1"])
        contact = {"law": self.law} if pairs else {"n_pairs": 0}
        run(self.folder, {
            "case": {"analysis": "point"}, "model": {"source": "hdf5", "file": "model.h5"},
            "cyclic": {"engine_order": self.case["engine_order"], "mistuned": True},
            "mistuning": {"scale": scale}, "contact": contact, "sweep": {"start": self.omega},
            "solver": {"tolerance": 1e-13},
            "harmonics": {"n_harmonics": self.n_harmonics, "sampling": "uniform", "n_time": 96}}
            | more, program=self.program, status=(0, 4))
        return read(self.folder / "case.h5")

    def values(self, parts, scale):
        found = self.solve(parts, scale)
        if not found["converged"].all():
            return None
        c = found["coefficients"][0]
        work = found["contact/dissipation"][0].sum() if "contact/dissipation" in found else 0.0
        return np.concatenate([np.hypot(c[1], c[2]), found["amplitude"][0], [work]])

    def difference(self, word, element, step):
        total = 0.0
        for k, weight in STENCIL:
            moved, scale = dict(self.parts), self.scale
            if word == "scale":
                scale += k * step
            else:
                moved[word] = np.array(moved[word])
                moved[word].reshape(-1)[element] += k * step
            values = self.values(moved, scale)
            if values is None:
                return None
            total = total + weight / step * values
        return total


def slopes_of(found, quantity, word, n_values):
    """Derivatives by the values as they were given (quantities, values)."""
    table = found[f"sensitivity/{quantity}/mistuning_{word}"][0]
    if word == "scale":
        return np.reshape(table, (-1, 1))
    # One value of a sector stands for all rows of it.
    table = np.atleast_2d(table)
    return table.reshape(len(table), n_values, -1).sum(axis=2)


def trial(seed, program, folder):
    disk = Disk(seed, program, folder)
    counts = {"kind": disk.law, "notes": []} | dict.fromkeys(COLUMNS, 0)
    has_pairs = len(disk.case["contact"]["side_1"]) > 0
    asked = QUANTITIES if has_pairs else QUANTITIES[:2]
    found = disk.solve(disk.parts, disk.scale, sensitivity={
        "parameters": [f"mistuning%{word}" for word in WORDS], "quantities": list(asked)})
    if not found["converged"].all():
        counts["unsolved"] += 1
        return counts
    for word in WORDS:
        n_values = 1 if word == "scale" else np.size(disk.parts[word])
        element = int(disk.rng.integers(n_values))
        exact = np.concatenate([slopes_of(found, q, word, n_values)[:, element] for q in asked])
        first, second = (disk.difference(word, element, step) for step in STEPS)
        if first is None or second is None:
            counts["unsolved"] += 1
            continue
        size = np.abs(second).max()
        counts["slopes"] += 1
        if np.abs(first - second).max() > SMOOTH * size:
            counts["corner"] += 1
            continue
        error = np.abs(exact - second[:len(exact)]).max() / size
        counts["equal" if error <= EXACT else "wrong"] += 1
        if error > EXACT:
            counts["notes"].append(f"{error:.1e} by mistuning%{word} {element}")
    return counts
