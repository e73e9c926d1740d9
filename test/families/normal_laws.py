"""Pairs that press along curves, against forces of their own and integration in time."""
import subprocess

import h5py
import numpy as np
from histories import INSTANTS, marched, projected, series
from scipy.integrate import solve_ivp

TITLE = "Normal laws"
TEXT = """
Chains of one to six masses with one to four pairs that have a normal dof and press along a curve:
a power of the overclosure (exponents 1 to 3), an exponential, a table; every fifth pair is a
unilateral spring. Some rub along another dof, with `penalty` or `regularised` friction. Loads reach
from a tenth of the preload, where pairs stay closed, to ten times as much. One frequency, 1 to 15
harmonics.

The judge takes displacements and forces of the result. The balance of every harmonic is written
anew and has to hold to 1e-7 of the load. Pressure and friction are computed of the displacements at
8,192 instants and have to be those of the result within 0.5 % of the largest force. Where no pair
has a memory, the motion is integrated over a period from its own start (DOP853, tolerance 1e-9):
with 9 harmonics or more it has to stay as near as its last two harmonics, times 30, or 1 %.
"""
COUNT = 100
SMALL = (0, 1, 2, 3, 5, 8)
COLUMNS = {"solved": "solved", "failed": "ended in words", "open": "with pairs that open",
           "rub": "with friction", "marched": "integrated", "balance": "balance off",
           "force": "forces off", "motion": "motion off"}
ZERO = ("balance", "force", "motion")

#: Of the load; of the largest force; of the largest displacement.
BALANCE, FORCE, MOTION = 1e-7, 5e-3, 1e-2
WORDS = ("power", "exponential", "table")


def drawn(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 7))
    springs = random.uniform(0.5, 2.0, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) \
        - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    mass = np.diag(random.uniform(0.5, 2.0, n))
    damping = random.uniform(0.01, 0.05) * mass + random.uniform(0.005, 0.05) * stiffness
    free = list(random.permutation(n) + 1)
    smooth = random.random() < 0.6
    table = np.cumsum(random.uniform(0.1, 0.5, 3)), np.cumsum(random.uniform(0.05, 0.8, 3))
    table = [np.concatenate([[0.0], column]) for column in table]
    pairs = []
    for i in range(int(random.integers(1, 5))):
        if not free:
            break
        rubs = len(free) > 1 and random.random() < 0.5
        pairs.append({
            "law": "regularised" if smooth else "penalty",
            "word": "unilateral" if i % 5 == 4 else str(random.choice(WORDS)),
            "n": int(free.pop()), "t": int(free.pop()) if rubs else 0,
            "mu": random.uniform(0.1, 0.6), "gap": random.uniform(-0.3, 0.2),
            "kt": random.uniform(0.3, 3.0), "kn": random.uniform(0.5, 4.0),
            "v0": random.uniform(0.1, 0.5), "c": random.uniform(0.5, 4.0),
            "e": random.uniform(1.0, 3.0), "p0": random.uniform(0.05, 1.0),
            "h": random.uniform(0.1, 0.5)})
    first = np.sqrt(np.linalg.eigvalsh(np.linalg.solve(mass, stiffness)).real.clip(1e-6).min())
    preload = random.uniform(0.2, 1.0)
    size = preload * 10.0**random.uniform(-1.0, 1.0)
    return {"mass": mass, "damping": damping, "stiffness": stiffness, "pairs": pairs,
            "table": table, "cosine": size * random.normal(size=n),
            "sine": size * random.normal(size=n), "static": -preload * random.random(n),
            "omega": first * random.uniform(0.5, 2.0), "harmonics": int(random.integers(1, 16))}


def row(values):
    return ", ".join(f"{float(v)!r}" for v in np.ravel(values))


def text(case):
    pairs = case["pairs"]

    def of(key):
        return ", ".join(f"{p[key]!r}" for p in pairs)

    words = {p["word"] for p in pairs}
    rubs = any(p["t"] for p in pairs)
    lines = ["&case", "analysis = 'point'", "/", "&model", f"n_dof = {len(case['mass'])}"]
    lines += [f"{key} = {row(case[key])}" for key in ("mass", "damping", "stiffness")]
    lines += ["/", "&contact", f"n_pairs = {len(pairs)}", f"law = {of('law')}",
              f"normal_law = {of('word')}",
              "side_1 = " + ", ".join(f"{p['t']}, 0, {p['n']}" for p in pairs),
              f"gap = {of('gap')}"]
    if rubs:
        lines.append(f"mu = {of('mu')}")
        smooth = pairs[0]["law"] == "regularised"
        lines.append(f"slip_speed = {of('v0')}" if smooth else f"tangential_stiffness = {of('kt')}")
    for word, keys in {"power": (("normal_coefficient", "c"), ("normal_exponent", "e")),
                       "exponential": (("reference_force", "p0"), ("decay_length", "h")),
                       "unilateral": (("normal_stiffness", "kn"),)}.items():
        if word in words:
            lines += [f"{key} = {of(name)}" for key, name in keys]
    if "table" in words:
        d, p = case["table"]
        lines += [f"n_table = {len(d)}", f"overclosure = {row(d)}", f"force = {row(p)}"]
    lines += ["/", "&load"] + [f"{key} = {row(case[key])}" for key in ("cosine", "sine", "static")]
    lines += ["/", "&harmonics", f"n_harmonics = {case['harmonics']}", "n_time = 2048", "/",
              "&sweep", f"start = {float(case['omega'])!r}", "/",
              "&solver", "tolerance = 1e-10", "/"]
    return "\n".join(lines) + "\n"


def pressure(pair, table, d):
    """Of overclosures."""
    closed = np.maximum(d, 0.0)
    if pair["word"] == "power":
        return pair["c"] * closed**pair["e"]
    if pair["word"] == "exponential":
        return pair["p0"] * np.exp(np.minimum(d / pair["h"], 30.0))
    if pair["word"] == "unilateral":
        return pair["kn"] * closed
    x, p = table
    last = (p[-1] - p[-2]) / (x[-1] - x[-2])
    return np.interp(d, x, p) + last * np.maximum(d - x[-1], 0.0)


def smooth_friction(pair, p, v):
    return pair["mu"] * p * np.tanh(v / pair["v0"])


def own_forces(case, pair, u):
    """Tangential and normal force of a pair (2, 2H+1) from the coefficients of all dofs."""
    tau = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
    size = len(u)
    p = pressure(pair, case["table"], -series(u[:, pair["n"] - 1], tau)[0] - pair["gap"])
    tangential = np.zeros(INSTANTS)
    if pair["t"]:
        displacement, rate = series(u[:, pair["t"] - 1], tau)
        if pair["law"] == "regularised":
            tangential = smooth_friction(pair, p, case["omega"] * rate)
        else:
            tangential = marched(pair["kt"] * displacement, pair["mu"] * p)
    return np.array([projected(tangential, tau, size), -projected(p, tau, size)]), p


def integrated(case, u):
    """The motion over a period from the start of that of u, and that of u (64, n_dof)."""
    n = len(case["mass"])
    tau = 2.0 * np.pi * np.arange(64) / 64
    motion = [series(u[:, j], tau) for j in range(n)]
    inverse = 1.0 / np.diag(case["mass"])

    def slope(t, y):
        x, v = y[:n], y[n:]
        f = case["static"] + case["cosine"] * np.cos(case["omega"] * t) \
            + case["sine"] * np.sin(case["omega"] * t) - case["stiffness"] @ x - case["damping"] @ v
        for pair in case["pairs"]:
            p = pressure(pair, case["table"], -x[pair["n"] - 1] - pair["gap"])
            f[pair["n"] - 1] += p
            if pair["t"]:
                f[pair["t"] - 1] -= smooth_friction(pair, p, v[pair["t"] - 1])
        return np.concatenate([v, inverse * f])

    start = [m[0][0] for m in motion] + [case["omega"] * m[1][0] for m in motion]
    found = solve_ivp(slope, (0.0, 2.0 * np.pi / case["omega"]), start, "DOP853",
                      tau / case["omega"], rtol=1e-9, atol=1e-10)
    return found.y[:n].T, np.array([m[0] for m in motion]).T


def trial(seed, program, folder):
    case = drawn(seed)
    (folder / "case.nml").write_text(text(case))
    done = subprocess.run([program, "-q", "case.nml"], cwd=folder, capture_output=True, text=True,
                          check=False)
    found = dict.fromkeys(COLUMNS, 0)
    if done.returncode == 4:
        return {**found, "failed": 1}
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / "case.h5") as file:
        u, force = file["coefficients"][0], file["contact/force"][0]
    omega, pairs, notes = case["omega"], case["pairs"], []
    found.update(solved=1, rub=int(any(p["t"] for p in pairs)))
    worst = 0.0
    for h in range(case["harmonics"] + 1):
        at = slice(0, 1) if h == 0 else slice(2 * h - 1, 2 * h + 1)
        turn = np.array([1.0]) if h == 0 else np.array([1.0, -1.0j])
        z = case["stiffness"] - (h * omega)**2 * case["mass"] + 1j * h * omega * case["damping"]
        rest = z @ (turn @ u[at])
        for i, pair in enumerate(pairs):
            lam = turn @ force[at, i]
            rest[pair["n"] - 1] += lam[2]
            if pair["t"]:
                rest[pair["t"] - 1] += lam[0]
        rest -= {0: case["static"], 1: case["cosine"] - 1j * case["sine"]}.get(h, 0.0)
        worst = max(worst, np.abs(rest).max())
    found["balance"] = int(worst > BALANCE * np.linalg.norm([case["cosine"], case["static"]]))
    largest = max(np.abs(force).max(), 1e-12)
    for i, pair in enumerate(pairs):
        own, p = own_forces(case, pair, u)
        found["open"] |= int(p.min() <= 0.0)
        off = np.abs(own - force[:, i, [0, 2]].T).max() / largest
        if off > FORCE:
            found["force"] = 1
            notes.append(f"pair {i} ({pair['word']}): forces off by {off:.1e}")
    if pairs[0]["law"] == "regularised" or not found["rub"]:
        found["marched"] = 1
        moved, said = integrated(case, u)
        off = np.abs(moved - said).max() / np.abs(said).max()
        left = np.abs(u[-4:]).max() / np.abs(u).max()
        if case["harmonics"] >= 9 and off > max(MOTION, 30.0 * left):
            found["motion"] = 1
            notes.append(f"motion off by {off:.1e}, last harmonics {left:.1e}")
    return {**found, "notes": notes}
