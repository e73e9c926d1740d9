"""Highest peaks of sweeps with pairs that lift off, against periodic motions found in time."""
import ctypes
import json
import os
import re
import subprocess
import tempfile
from collections import Counter
from functools import cache
from pathlib import Path

import h5py
import numpy as np
from project import ROOT
from runner import digest

TITLE = "Peaks of joints that open and close"
TEXT = """
Chains of one to three masses with damping of 0.1 to 2 %, swept over all of their resonances, four
times each, in 21 to 81 points. A pair closes behind a gap, is preloaded, or just touches (as stiff
as a spring of the chain, or up to 20 times stiffer), with a slider or friction of its own beside,
or as a rigid pair on a massless dof behind a spring. All masses are observed.

The judge integrates the same motion in time, with its own contact, and closes periodic motions by
shooting: along the frequency up and down, with steps that shorten where the amplitude changes, and
from starts at rest and far from it at 8 frequencies, whose branches it follows too. Only stable
motions of the period of the load count. A highest peak of a quantity is *missed* where the judge's
own sweep in the direction of the program's comes to one that is more than 2 % higher, and neither
a remark nor the end of the sweep says that it may be so; *elsewhere* where only other starts come
to it. *Lost* are sweeps of which the judge's own has the period of the load for less than 30 %.
"""
HERE, STATE = Path(__file__).resolve().parent, ROOT / "build" / "families"
COUNT = 300
SMALL = (7, 9, 11, 18)
COLUMNS = {"right": "right", "said": "with a remark", "higher": "above the judge's",
           "missed": "missed without a word", "elsewhere": "elsewhere, without a word",
           "lost": "lost", "failed": "failed", "iterations": "iterations of the rows",
           "search": "of the search"}
ZERO = ("missed",)
KINDS = ("gap", "preload", "touching", "beside friction", "rubbing", "rigid")
#: What a peak may be off; what counts as the end of the range.
RIGHT, END = 0.02, 0.01
#: Part of the judge's sweep that has to have the period of the load.
LEAST = 0.3
#: Steps of the judge: shortest over the least damping, longest over the frequency; rows of a curve.
SHORTEST, LONGEST, MOST = 0.3, 5e-3, 6000
STARTS = 8
#: Sweeps of a case, which differ in their points.
SWEEPS = 4


@cache
def kernel():
    """The integration in C, compiled by the compiler that the program needs as well."""
    source = Path(__file__).with_name("lifting_orbit.c")
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "lifting_orbit.so"
        subprocess.run([os.environ.get("CC", "cc"), "-std=c11", "-D_GNU_SOURCE", "-O3",
                        "-ffast-math", "-shared", "-fPIC", "-o", library, source, "-lm"],
                       check=True)
        return ctypes.CDLL(str(library))


def drawn(seed):
    """Masses, springs, damping, pairs, loads and the range of a case."""
    random = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    n = int(random.integers(1, 4))
    mass = np.diag(random.uniform(0.5, 2.0, n))
    springs = random.uniform(0.5, 2.5, n)
    stiffness = np.diag(springs + np.append(springs[1:], 0.0))
    for k in range(1, n):
        stiffness[k, k - 1] = stiffness[k - 1, k] = -springs[k]
    ratio = float(np.exp(random.uniform(np.log(1e-3), np.log(0.02))))
    root = np.sqrt(np.diag(mass))
    squares, shapes = np.linalg.eigh(stiffness / np.outer(root, root))
    modes, shapes = np.sqrt(squares), shapes * root[:, None]
    damping = shapes @ np.diag(2.0 * ratio * modes) @ shapes.T
    cosine, sine = np.zeros(n), np.zeros(n)
    cosine[random.integers(n)] = 1.0
    if random.random() < 0.4:
        sine[random.integers(n)] = random.uniform(-1.0, 1.0)
    dofs = random.permutation(n)
    stiff = float(np.exp(random.uniform(np.log(0.3), np.log(3.0))))
    if kind == "touching":
        stiff = float(np.exp(random.uniform(np.log(3.0), np.log(20.0))))
    gap = float(np.exp(random.uniform(np.log(0.02), np.log(3.0))))
    gap = {"preload": -gap, "touching": 0.0}.get(kind, gap if random.random() < 0.5 else -gap)
    pair = {"t": -1, "n": int(dofs[0]), "kt": 1.0, "kn": stiff, "gap": gap, "load": 0.0, "mu": 0.0}
    pairs = [pair]
    if kind == "rubbing":
        pair.update(t=int(dofs[-1]), mu=float(random.uniform(0.1, 0.8)),
                    kt=float(random.uniform(0.5, 1.0)) * stiff)
        if n == 1:
            kind, pair["t"] = "gap", -1
    if kind == "beside friction":
        pairs.append({"t": int(dofs[-1]), "n": -1, "kt": float(random.uniform(0.3, 2.0)), "kn": 0.0,
                      "gap": 0.0, "mu": 0.5,
                      "load": float(np.exp(random.uniform(np.log(0.02), np.log(2.0))))})
    closed = stiffness.copy()
    for each in pairs:
        for dof, k in ((each["t"], each["kt"]), (each["n"], each["kn"])):
            if dof >= 0:
                closed[dof, dof] += k
    fastest = float(np.sqrt(np.linalg.eigvalsh(closed / np.outer(root, root)).max()))
    return {"kind": kind, "n": n, "mass": mass, "stiffness": stiffness, "damping": damping,
            "cosine": cosine, "sine": sine, "pairs": pairs, "ratio": ratio, "fastest": fastest,
            "observe": n, "rigid": kind == "rigid",
            "points": sorted(int(k) for k in random.integers(21, 82, SWEEPS)),
            "range": (float(random.uniform(0.4, 0.8) * modes[0]), float(1.15 * fastest))}


def listed(values):
    return ", ".join(repr(float(x)) for x in np.ravel(values))


def text(case, points):
    """The namelist. A rigid pair stands on a massless dof behind the spring of its pair."""
    n, pairs = case["n"], case["pairs"]
    mass, stiffness, damping = case["mass"], case["stiffness"], case["damping"]
    side = [(p["t"] + 1, 0, p["n"] + 1) for p in pairs]
    law = "penalty"
    if case["rigid"]:
        law, p = "rigid", pairs[0]
        mass, stiffness, damping = (np.pad(a, (0, 1)) for a in (mass, stiffness, damping))
        i, k = p["n"], p["kn"]
        stiffness[i, i] += k
        stiffness[n, n] += k
        stiffness[i, n] = stiffness[n, i] = -k
        side, n = [(0, 0, n + 1)], n + 1
    load = [np.pad(case[name], (0, n - case["n"])) for name in ("cosine", "sine")]
    lines = [f"gap = {listed([p['gap'] for p in pairs])}",
             f"mu = {listed([p['mu'] for p in pairs])}"]
    if any(p["n"] < 0 for p in pairs):
        lines.append(f"normal_load = {listed([p['load'] for p in pairs])}")
    if law == "penalty":
        lines += [f"normal_stiffness = {listed([p['kn'] or 1.0 for p in pairs])}",
                  f"tangential_stiffness = {listed([p['kt'] for p in pairs])}"]
    own = "\n   ".join(lines)
    return f"""&case analysis = 'frf' /
&model n_dof = {n}
   mass = {listed(mass)}
   stiffness = {listed(stiffness)}
   damping = {listed(damping)} /
&contact n_pairs = {len(pairs)} law = '{law}'
   side_1 = {", ".join(str(x) for row in side for x in row)}
   {own} /
&load cosine = {listed(load[0])} sine = {listed(load[1])} /
&harmonics n_harmonics = 9 /
&sweep start = {case["range"][0]!r} end = {case["range"][1]!r} n_points = {points} /
&output observe = {", ".join(str(k + 1) for k in range(case["observe"]))} /
"""


class Judge:
    """Stable periodic motions by shooting."""

    def __init__(self, case):
        self.case, n = case, case["n"]
        inverse = np.linalg.inv(case["mass"])
        pairs = case["pairs"]
        self.size = 2 * n + len(pairs)
        arrays = ([inverse @ case["damping"], inverse @ case["stiffness"], inverse],
                  [inverse @ case["cosine"], inverse @ case["sine"], np.zeros(n)])
        self.arrays = [np.ascontiguousarray(a, dtype=float) for a in arrays]
        self.dofs = np.array([[p["t"] for p in pairs], [p["n"] for p in pairs]], dtype=np.int32)
        self.pairs = np.array([[p[key] for p in pairs] for key in
                               ("kt", "kn", "gap", "load", "mu")])

    def given(self):
        return [self.case["n"], len(self.case["pairs"]),
                *(a.ctypes.data_as(ctypes.c_void_p) for a in (*self.arrays, self.dofs, self.pairs)),
                ctypes.c_double(self.case["fastest"])]

    def find(self, omega, state):
        """The largest |u| of each mass of the motion that a march from a state comes to; None where
        that has not the period."""
        top = np.zeros(self.case["n"])
        good = kernel().find(*self.given(), ctypes.c_double(omega), 6, 100,
                             state.ctypes.data_as(ctypes.c_void_p),
                             top.ctypes.data_as(ctypes.c_void_p))
        return top if good else None

    def follow(self, state, start, finish, stop):
        """Rows (frequency, periodic or not, largest |u| of each mass)."""
        rows = np.zeros((MOST, 2 + self.case["n"]))
        count = kernel().follow(*self.given(), *map(ctypes.c_double, (
            start, finish, SHORTEST * self.case["ratio"], LONGEST)), int(stop), MOST,
            state.ctypes.data_as(ctypes.c_void_p), rows.ctypes.data_as(ctypes.c_void_p))
        return rows[:count]

    def sweep(self, start, finish):
        state = np.zeros(self.size)
        self.find(start, state)
        return self.follow(state, start, finish, stop=False)

    def others(self, known):
        """Branches that other starts come to."""
        random, found = np.random.default_rng(1), []
        low, high = self.case["range"]
        for omega in np.geomspace(low, high, STARTS + 2)[1:-1]:
            for far in (0.0, 10.0):
                state = np.zeros(self.size)
                state[:2 * self.case["n"]] = far * random.normal(size=2 * self.case["n"])
                top = self.find(omega, state)
                if top is None or any(near(rows, omega, top) for rows in known + found):
                    continue
                for end in (low, high):
                    found.append(self.follow(state.copy(), float(omega), end, stop=True))
        return found


def near(rows, omega, top):
    """Whether a curve has a motion at a frequency."""
    order = np.argsort(rows[:, 0])
    omegas = rows[order, 0]
    if not omegas[0] <= omega <= omegas[-1]:
        return False
    values = [np.interp(omega, omegas, rows[order, 2 + i]) for i in range(len(top))]
    return bool(np.abs(np.array(values) - top).max() < 0.05 * top.max())


def highest(curves, n):
    """The highest amplitude of each mass, and where."""
    best = np.zeros((n, 2))
    for rows in curves:
        good = rows[rows[:, 1] > 0.0]
        for i in range(n):
            if len(good) and good[:, 2 + i].max() > best[i, 0]:
                k = good[:, 2 + i].argmax()
                best[i] = top_of(good, k, i), good[k, 0]
    return best


def top_of(rows, k, i):
    """The top of a parabola of 1/A**2 in omega**2, where the neighbours of a row make one."""
    height = rows[k, 2 + i]
    if not 0 < k < len(rows) - 1:
        return height
    s, g = rows[k - 1:k + 2, 0]**2, rows[k - 1:k + 2, 2 + i]**-2.0
    if g.max() > 1.5 * g[1] or not (np.diff(s) != 0.0).all():
        return height
    a, b, _ = np.polyfit(s - s[1], g, 2)
    least = g[1] - 0.25 * b * b / a if a > 0.0 else 0.0
    return max(height, least**-0.5) if least > 0.0 else height


def reported(path, n):
    """Highest reported peaks, whether the file says of each that it may not be the highest."""
    with h5py.File(path) as file:
        peaks, rows = file["peak"], file["amplitude"][:]
        names = [str(word, "utf-8") if isinstance(word, bytes) else str(word)
                 for word in peaks["found_by"].attrs["names"]]
        said = {str(name, "utf-8") for name in file["remarks/name"][:]} if "remarks" in file else ()
        top, doubt = np.zeros(n), np.zeros(n, dtype=bool)
        for i in range(n):
            own = np.flatnonzero(peaks["observed"][:] == i)
            if not len(own):
                top[i] = rows[:, i].max()
                continue
            k = own[peaks["amplitude"][:][own].argmax()]
            top[i] = peaks["amplitude"][k]
            doubt[i] = names[peaks["found_by"][k]] == "end of the sweep"
        doubt |= bool({"peak not resolved", "another peak"} & set(said))
        return top, doubt


def judged(seed, case):
    """Highest amplitudes and places of the judge's own sweep and of all its motions (2, n, 2), and
    the part of its sweep that has the period of the load. Kept for other programs."""
    kept = STATE / f"lifting-judge-{digest(__file__, HERE / 'lifting_orbit.c')}.jsonl"
    if kept.exists():
        for row in map(json.loads, kept.open()):
            if row["seed"] == seed:
                return np.array(row["best"]), row["share"]
    judge, n, (low, high) = Judge(case), case["n"], case["range"]
    up, down = judge.sweep(low, high), judge.sweep(high, low)
    best = np.array([highest([up], n), highest([up, down, *judge.others([up, down])], n)])
    share = float((up[:, 1] > 0.0).mean())
    kept.parent.mkdir(parents=True, exist_ok=True)
    with kept.open("a") as file:
        file.write(json.dumps({"seed": seed, "best": best.tolist(), "share": share}) + "\n")
    return best, share


def trial(seed, program, folder):
    case = drawn(seed)
    best, share = judged(seed, case)
    counts, notes = Counter(kind=case["kind"]), []
    if share < LEAST:
        return {"kind": case["kind"], "lost": SWEEPS}
    for points in case["points"]:
        (folder / "case.nml").write_text(text(case, points))
        done = subprocess.run([program, "case.nml"], cwd=folder, check=False, capture_output=True,
                              text=True, timeout=600)
        if done.returncode:
            counts["failed"] += 1
            notes.append(done.stderr.strip()[-160:])
            continue
        of_rows = int(re.search(r"^iterations +(\d+)", done.stdout, re.M)[1])
        more = re.search(r"^peaks +\d+ more points, (\d+)", done.stdout, re.M)
        counts["iterations"] += of_rows
        counts["search"] += int(more[1]) if more else 0
        word, told = verdict(case, best, *reported(folder / "case.h5", case["n"]))
        counts[word] += 1
        notes += [f"{points} points, damping {case['ratio']:.2g}: {line}" for line in told]
    return {**counts, "notes": notes}


def verdict(case, best, top, doubt):
    """The word for a sweep, of its worst quantity, and lines on what it misses."""
    low, high = case["range"]
    words, told = {"right"}, []
    for i, (own, every) in enumerate(zip(*best)):
        for name, (height, omega) in (("missed", own), ("elsewhere", every)):
            if height <= (1.0 + RIGHT) * top[i] or min(omega / low, high / omega) < 1.0 + END:
                continue
            words.add("said" if doubt[i] else name)
            told.append(f"u{i + 1} {top[i]:.5g}{' (said)' if doubt[i] else ''}, {name} "
                        f"{height:.5g} at {omega:.5g}")
            break
        if top[i] > (1.0 + RIGHT) * every[0] > 0.0:
            words.add("higher")
    word = next(name for name in ("missed", "elsewhere", "said", "higher", "right")
                if name in words)
    return word, told
