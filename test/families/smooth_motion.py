"""Laws that act at once, integrated in time and followed by perturbations, against an integration
of the judge's own."""
import subprocess

import h5py
import numpy as np
from histories import projected
from normal_laws import pressure, row
from scipy.integrate import solve_ivp

TITLE = "Smooth friction and curved pressures in time"
TEXT = """
Chains of one to four masses with one or two pairs that act at once: `regularised` friction under a
constant load or on a normal dof that presses along a spring or a curve, some weakening with the
speed or on a moving side; pairs of `penalty` without friction that press along a curve. One
frequency, 15 harmonics, 2,048 instants, with `stability`; and the same by `analysis = 'time'` with
2,000 steps.

The judge integrates the equations of motion itself (DOP853, tolerance 1e-10), from the answer of
the balance on, and closes the period by Newton's method with the matrix of a perturbation of each
state, which differences give. The motion in time has to be his within 0.3 %, the multipliers those
of his matrix within 1 % of the largest, or of 1, or within the error that the result says. Cases
whose period he cannot close are not judged.
"""
COUNT = 100
SMALL = (0, 1, 2, 3, 5, 8)
COLUMNS = {"judged": "judged", "failed": "ended in words", "open": "not closed by the judge",
           "unstable": "unstable", "motion": "motion off", "multipliers": "multipliers off"}
ZERO = ("motion", "multipliers")

MOTION, MULTIPLIERS, STEP = 3e-3, 1e-2, 1e-6
SAMPLES = 256


def drawn(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 5))
    springs = random.uniform(0.5, 2.0, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) \
        - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    mass = np.diag(random.uniform(0.5, 2.0, n))
    damping = random.uniform(0.02, 0.06) * mass + random.uniform(0.01, 0.05) * stiffness
    free = list(random.permutation(n) + 1)
    rubs = random.random() < 0.75
    pairs = []
    for _ in range(int(random.integers(1, 3))):
        if not free:
            break
        normal = not rubs or (len(free) > 1 and random.random() < 0.5)
        word = str(random.choice(("power", "exponential", "table"))) if not rubs else \
            str(random.choice(("unilateral", "power", "exponential")))
        pairs.append({
            "word": word if normal else "unilateral", "t": int(free.pop()) if rubs else 0,
            "n": int(free.pop()) if normal else 0, "mu": random.uniform(0.1, 0.5) * rubs,
            "load": 0.0 if normal else random.uniform(0.2, 1.5), "gap": random.uniform(-0.3, 0.1),
            "kn": random.uniform(0.5, 3.0), "v0": random.uniform(0.2, 0.6),
            "c": random.uniform(0.5, 3.0), "e": random.uniform(1.3, 3.0),
            "p0": random.uniform(0.1, 0.8), "h": random.uniform(0.2, 0.5),
            "speed": random.normal() * 0.3 if random.random() < 0.3 else 0.0,
            "fall": random.uniform(0.5, 1.0), "weakening": random.uniform(0.4, 1.0)})
    first = np.sqrt(np.linalg.eigvalsh(np.linalg.solve(mass, stiffness)).real.clip(1e-6).min())
    table = [np.array([0.0, 0.2, 0.5, 0.9]), np.cumsum([0.0, *random.uniform(0.1, 0.8, 3)])]
    return {"mass": mass, "damping": damping, "stiffness": stiffness, "pairs": pairs,
            "rubs": rubs, "table": table, "cosine": random.normal(size=n),
            "sine": random.normal(size=n), "static": -0.3 * random.random(n),
            "omega": first * random.uniform(0.5, 2.0)}


def text(case, analysis):
    pairs = case["pairs"]

    def of(key):
        return ", ".join(f"{p[key]!r}" for p in pairs)

    words = {p["word"] for p in pairs if p["n"]}
    lines = ["&case", f"analysis = '{analysis}'", "/", "&model", f"n_dof = {len(case['mass'])}"]
    lines += [f"{key} = {row(case[key])}" for key in ("mass", "damping", "stiffness")]
    lines += ["/", "&contact", f"n_pairs = {len(pairs)}",
              f"law = '{'regularised' if case['rubs'] else 'penalty'}'",
              "side_1 = " + ", ".join(f"{p['t']}, 0, {p['n']}" for p in pairs),
              f"gap = {of('gap')}"]
    if words:
        lines.append(f"normal_law = {of('word')}")
    if case["rubs"]:
        fallen = ", ".join(f"{p['mu'] * p['fall']!r}" for p in pairs)
        lines += [f"mu = {of('mu')}", f"slip_speed = {of('v0')}", f"mu_dynamic = {fallen}",
                  f"weakening_speed = {of('weakening')}", f"speed_1 = {of('speed')}"]
        if any(p["n"] == 0 for p in pairs):
            lines.append(f"normal_load = {of('load')}")
    for word, keys in {"power": (("normal_coefficient", "c"), ("normal_exponent", "e")),
                       "exponential": (("reference_force", "p0"), ("decay_length", "h")),
                       "unilateral": (("normal_stiffness", "kn"),)}.items():
        if word in words:
            lines += [f"{key} = {of(name)}" for key, name in keys]
    if "table" in words:
        d, p = case["table"]
        lines += [f"n_table = {len(d)}", f"overclosure = {row(d)}", f"force = {row(p)}"]
    lines += ["/", "&load"] + [f"{key} = {row(case[key])}" for key in ("cosine", "sine", "static")]
    lines += ["/", "&harmonics", "n_harmonics = 15", "n_time = 2048", "parity = 'all'", "/",
              "&sweep", f"start = {float(case['omega'])!r}"]
    if analysis == "point":
        lines.append("stability = .true.")
    lines += ["/", "&solver", "tolerance = 1e-9", "/", "&time", "steps_per_period = 2000", "/"]
    return "\n".join(lines) + "\n"


def slope_of(case):
    """Right-hand side of the equations of motion."""
    n = len(case["mass"])
    inverse = 1.0 / np.diag(case["mass"])

    def slope(t, y):
        x, v = y[:n], y[n:]
        f = case["static"] + case["cosine"] * np.cos(case["omega"] * t) \
            + case["sine"] * np.sin(case["omega"] * t) - case["stiffness"] @ x - case["damping"] @ v
        for pair in case["pairs"]:
            p = pair["load"]
            if pair["n"]:
                p = pressure(pair, case["table"], -x[pair["n"] - 1] - pair["gap"])
                f[pair["n"] - 1] += p
            if pair["t"]:
                speed = v[pair["t"] - 1] - pair["speed"]
                least = pair["mu"] * pair["fall"]
                mu = least + (pair["mu"] - least) * np.exp(-abs(speed) / pair["weakening"])
                f[pair["t"] - 1] -= mu * p * np.tanh(speed / pair["v0"])
        return np.concatenate([v, inverse * f])

    return slope


def period(case, start, samples=None):
    span = 2.0 * np.pi / case["omega"]
    found = solve_ivp(slope_of(case), (0.0, span), start, "DOP853", samples, rtol=1e-10, atol=1e-11)
    return found.y


def closed(case, start):
    """State that repeats after a period, with the matrix of a perturbation; None without one."""
    size = len(start)
    for _ in range(8):
        end = period(case, start)[:, -1]
        matrix = np.empty((size, size))
        for j in range(size):
            ends = [period(case, start + sign * STEP * np.eye(size)[j])[:, -1]
                    for sign in (1.0, -1.0)]
            matrix[:, j] = (ends[0] - ends[1]) / (2.0 * STEP)
        rest = end - start
        if np.abs(rest).max() < 1e-8 * max(1.0, np.abs(start).max()):
            return start, matrix
        start = start + np.linalg.solve(np.eye(size) - matrix, rest)
        if not np.isfinite(start).all() or np.abs(start).max() > 1e3:
            return None
    return None


def trial(seed, program, folder):
    case, found, notes = drawn(seed), dict.fromkeys(COLUMNS, 0), []
    for analysis in ("point", "time"):
        (folder / f"{analysis}.nml").write_text(text(case, analysis))
        done = subprocess.run([program, "-q", f"{analysis}.nml"], cwd=folder, capture_output=True,
                              text=True, check=False)
        if done.returncode == 4:
            return {**found, "failed": 1}
        assert done.returncode == 0, done.stderr
    with h5py.File(folder / "point.h5") as file:
        u = file["coefficients"][0]
        said, error = file["floquet/multipliers"][0] @ [1.0, 1.0j], file["floquet/error"][0]
    with h5py.File(folder / "time.h5") as file:
        marched = file["coefficients"][0]
    h = np.arange(1, 16)[:, None]
    start = np.concatenate([u[0] + u[1::2].sum(axis=0), case["omega"] * (h * u[2::2]).sum(axis=0)])
    orbit = closed(case, start)
    if orbit is None:
        return {**found, "open": 1}
    found["judged"] = 1
    start, matrix = orbit
    own = np.linalg.eigvals(matrix)
    found["unstable"] = int(np.abs(own).max() > 1.0)
    # Each with the nearest that is left.
    rest, least = list(range(len(said))), MULTIPLIERS * max(1.0, np.abs(own).max())
    for value in own[np.argsort(-np.abs(own))]:
        j = rest.pop(int(np.argmin(np.abs(said[rest] - value))))
        off = abs(said[j] - value)
        if off > max(least, error[j] if np.isfinite(error[j]) else np.inf):
            found["multipliers"] = 1
            notes.append(f"multiplier {value:.3f} off by {off:.1e}")
    if not found["unstable"]:
        t = 2.0 * np.pi / case["omega"] * np.arange(SAMPLES) / SAMPLES
        motion = period(case, start, t)[:len(case["mass"])]
        exact = np.array([projected(x, case["omega"] * t, 31) for x in motion]).T
        off = np.linalg.norm(marched - exact) / np.linalg.norm(exact)
        if off > MOTION:
            found["motion"] = 1
            notes.append(f"motion off by {off:.1e}")
    return {**found, "notes": notes}
