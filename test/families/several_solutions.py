"""Several solutions of one point with one-sided stops, against Newton's method of the judge from
many random starts."""
import subprocess

import h5py
import numpy as np

from fretwear._namelist import write_namelist as namelist_text

TITLE = "Several solutions of a point"
TEXT = """
A chain of one to three masses with one or two stops, each in front of a mass or between two, whose
stiffness is 0.1 to 20 times that of the springs and whose gap 0.1 to 0.9 of the linear amplitude.
Damping ratios of 0.2 to 2 %, one frequency between 0.9 and 1.5 times the first natural one, 5
harmonics, 128 instants; a third of the cases with a load at rest. `solver%n_solutions` is 30.

The judge balances the same harmonics in NumPy with a derivative of its own, by Newton's method from
200 random starts between nothing and three times the linear amplitude. It wants every solution that
four of them or more come to among the rows, each row to solve its own equations within 1e-8, no row
twice, and rows by rising amplitude. Solutions that fewer of its starts come to, most often a single
one, are counted too.
"""
COUNT = 100
SMALL = (0, 1, 2, 3)
COLUMNS = {"solved": "solved", "rows": "solutions", "more": "cases with several",
           "beyond": "solutions that the judge lacks", "missed": "solutions missed",
           "rare": "rare ones missed",
           "wrong": "rows that solve nothing", "twice": "rows twice or out of order",
           "failed": "ended in words"}
#: A search promises nothing of what it does not find: that is counted and shown.
ZERO = ("wrong", "twice")

HARMONICS, INSTANTS, STARTS, MOST = 5, 128, 200, 30
#: Starts of the judge that come to a solution that counts.
SEVERAL = 4
#: Part of the largest coefficient by which two solutions differ, and that rows are off at most.
DIFFERENT, WITHIN = 1e-5, 1e-8


def drawn(seed):
    random = np.random.default_rng(seed)
    n = 1 + seed % 3
    springs = random.uniform(0.5, 1.5, n)
    stiffness = np.diag(springs + np.append(springs[1:], 0.0))
    stiffness -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
    mass = np.diag(random.uniform(0.5, 1.5, n))
    values, shapes = np.linalg.eigh(np.linalg.solve(np.sqrt(mass), np.linalg.solve(
        np.sqrt(mass), stiffness).T))
    ratio = 10.0**random.uniform(-2.7, -1.7)
    shapes = np.sqrt(mass) @ shapes
    damping = shapes @ np.diag(2.0 * ratio * np.sqrt(values)) @ shapes.T
    omega = float(np.sqrt(values[0]) * random.uniform(0.9, 1.5))
    cosine = random.normal(size=n)
    static = random.normal(size=n) * (seed % 3 == 2)
    linear = np.linalg.solve(stiffness - omega**2 * mass + 1j * omega * damping, cosine)
    stops = []
    for _ in range(int(random.integers(1, 3))):
        row = np.zeros(n)
        at = int(random.integers(0, n))
        row[at] = random.choice([-1.0, 1.0])
        if n > 1 and random.random() < 0.3:
            row[(at + 1) % n] = -row[at]
        stops.append((row, float(springs.mean() * 10.0**random.uniform(-1.0, 1.3)),
                      float(abs(row @ linear) * random.uniform(0.1, 0.9))))
    return {"mass": mass, "stiffness": stiffness, "damping": damping, "cosine": cosine,
            "static": static, "omega": omega, "stops": stops,
            "size": float(np.abs(linear).max())}


def groups(case):
    sides = np.zeros((len(case["stops"]), 2, 3), dtype=int)
    for i, (row, _, _) in enumerate(case["stops"]):
        for k in np.flatnonzero(row):
            # A second entry is of the other sign: the other side of the pair.
            side = int(sides[i, 0, 2] != 0)
            sides[i, side, 2] = (k + 1) * int(row[k] if side == 0 else -row[k])
    n = len(case["mass"])
    return {
        "case": {"analysis": "point"},
        "model": {"n_dof": n, **{key: np.ravel(case[key])
                                 for key in ("mass", "damping", "stiffness")}},
        "contact": {"n_pairs": len(sides), "law": "penalty", "mu": 0.0,
                    "side_1": np.ravel(sides[:, 0]), "side_2": np.ravel(sides[:, 1]),
                    "normal_stiffness": [k for _, k, _ in case["stops"]],
                    "gap": [gap for _, _, gap in case["stops"]]},
        "load": {"static": case["static"], "cosine": case["cosine"]},
        "harmonics": {"n_harmonics": HARMONICS, "n_time": INSTANTS, "sampling": "uniform"},
        "sweep": {"start": case["omega"]},
        "solver": {"tolerance": 1e-11, "n_solutions": MOST},
        "output": {"observe": list(range(1, n + 1))}}


class Balance:
    """Coefficients (start, dof, 0 c1 s1 ..) of all starts at once."""

    def __init__(self, case):
        self.case, n = case, len(case["mass"])
        tau = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
        columns = [np.ones(INSTANTS)]
        for h in range(1, HARMONICS + 1):
            columns += [np.cos(h * tau), np.sin(h * tau)]
        self.back = np.array(columns)
        self.forth = 2.0 * self.back.T / INSTANTS
        self.forth[:, 0] /= 2.0
        m = len(self.back)
        self.linear = np.zeros((n, m, n, m))
        self.linear[:, 0, :, 0] = case["stiffness"]
        for h in range(1, HARMONICS + 1):
            w, c, s = h * case["omega"], 2 * h - 1, 2 * h
            still = case["stiffness"] - w**2 * case["mass"]
            self.linear[:, c, :, c] = self.linear[:, s, :, s] = still
            self.linear[:, c, :, s] = w * case["damping"]
            self.linear[:, s, :, c] = -w * case["damping"]
        self.load = np.zeros((n, m))
        self.load[:, 0], self.load[:, 1] = case["static"], case["cosine"]
        self.shape = (n, m)

    def residual(self, x):
        size = self.shape[0] * self.shape[1]
        r = (x.reshape(len(x), size) @ self.linear.reshape(size, size).T).reshape(x.shape)
        r -= self.load
        for row, k, gap in self.case["stops"]:
            closing = np.minimum(self.opening(x, row) + gap, 0.0)
            r += k * row[None, :, None] * (closing @ self.forth)[:, None, :]
        return r

    def opening(self, x, row):
        """At the instants (start, instant)."""
        return np.tensordot(x, row, (1, 0)) @ self.back

    def slope(self, x):
        found = np.repeat(self.linear[None], len(x), axis=0)
        for row, k, gap in self.case["stops"]:
            closed = self.opening(x, row) + gap < 0.0
            part = self.forth.T @ (closed[:, :, None] * self.back.T)
            found += k * np.outer(row, row)[None, :, None, :, None] * part[:, None, :, None, :]
        size = self.shape[0] * self.shape[1]
        return found.reshape(len(x), size, size)

    def solved(self, x, steps=60):
        """Newton's method with halved steps; those that converge."""
        done, within = [], 1e-10 * np.abs(self.load).max()
        r = self.residual(x)
        norm = np.linalg.norm(r.reshape(len(x), -1), axis=1)
        for _ in range(steps):
            done += list(x[norm < within])
            x, r, norm = (values[norm >= within] for values in (x, r, norm))
            if len(x) == 0:
                break
            step = -np.linalg.solve(self.slope(x), r.reshape(len(x), -1, 1)).reshape(x.shape)
            best, x_best, r_best = np.full(len(x), np.inf), x.copy(), r.copy()
            for fraction in 0.5**np.arange(6):
                # The first that decreases, or else the best of all.
                left = np.flatnonzero(~(best < norm))
                if len(left) == 0:
                    break
                trial = x[left] + fraction * step[left]
                r_trial = self.residual(trial)
                value = np.linalg.norm(r_trial.reshape(len(left), -1), axis=1)
                take = left[value < best[left]]
                better = value < best[left]
                best[take], x_best[take], r_best[take] = value[better], trial[better], \
                    r_trial[better]
            x, r, norm = x_best, r_best, best
        return np.array(done + list(x[norm < within])).reshape(-1, *self.shape)


def different(solutions):
    """Each once."""
    kept = []
    for x in solutions:
        if all(np.abs(x - other).max() > DIFFERENT * np.abs(other).max() for other in kept):
            kept.append(x)
    return kept


def trial(seed, program, folder):
    case = drawn(seed)
    (folder / "case.nml").write_text(namelist_text(groups(case)))
    done = subprocess.run([program, "-q", "case.nml"], cwd=folder, capture_output=True, text=True,
                          timeout=300, check=False)
    kind = f"{len(case['mass'])} masses"
    if done.returncode != 0:
        return {"kind": kind, "failed": 1, "notes": [done.stderr[-200:]]}
    with h5py.File(folder / "case.h5") as file:
        rows = file["coefficients"][()].transpose(0, 2, 1)
        amplitude = file["amplitude"][()][:, 0]
    balance = Balance(case)
    random = np.random.default_rng(seed + 10**6)
    fall = np.concatenate([[1.0], np.repeat(1.0 / np.arange(1, HARMONICS + 1)**2, 2)])
    starts = random.normal(size=(STARTS, *balance.shape)) * fall * case["size"] * random.uniform(
        0.0, 3.0, (STARTS, 1, 1))
    reached = balance.solved(starts)
    wanted = different(reached)
    size = np.abs(balance.load).max()
    wrong = int((np.abs(balance.residual(rows)).max(axis=(1, 2)) > WITHIN * size).sum())
    twice = len(rows) - len(different(rows)) + int((np.diff(amplitude) < 0.0).sum())

    def lacks(x, others):
        return all(np.abs(x - other).max() > DIFFERENT * np.abs(x).max() for other in others)

    hits = [sum(not lacks(x, [other]) for other in reached) for x in wanted if lacks(x, rows)]
    missed = sum(n >= SEVERAL for n in hits)
    found = {"kind": kind, "solved": 1, "rows": len(rows), "more": int(len(rows) > 1),
             "beyond": sum(lacks(x, wanted) for x in rows), "missed": missed,
             "rare": len(hits) - missed, "wrong": wrong, "twice": twice}
    if missed or wrong or twice:
        found["notes"] = [f"{len(rows)} rows, {len(wanted)} of the judge, {missed} missed, {wrong} "
                          f"wrong, {twice} twice"]
    return found
