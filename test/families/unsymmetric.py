"""Structures with matrices that are not symmetric and with hysteretic damping, against a balance
and an integration in time of another origin."""
import subprocess

import h5py
import numpy as np
from scipy.integrate import solve_ivp

TITLE = "Unsymmetric matrices and hysteretic damping"
TEXT = """
Structures of one to six masses with matrices drawn at random: Coriolis and circulatory forces at a
rotation speed, stiffness and damping of any shape, hysteretic damping by a matrix and by a loss
factor, in kinds: `rotor` (no hysteretic damping), `hysteretic` (no other), `both`, and `following`,
whose speed follows the frequency. One to four elements: cubic springs, friction of a constant load
(elastic), smooth friction, elastic stops. 1 to 15 harmonics, loads from linear motion to slip;
a third has a static load. Some rotors are unstable.

The judge takes the displacements of the result alone. Forces are evaluated anew on 8,192 instants,
friction by a march of the judge's own; the balance of every harmonic has to hold to 1e-4 of the
largest force (1e-8 where no element remembers). The work of hysteretic damping has to be that of
the displacements. Every other rotor has springs alone and 15 harmonics: where it is stable it is
integrated in time by DOP853 from the state of the result. After one period that has to be the same,
within what the harmonics above leave (1e-3 of it, or ten times the last two harmonics).
A linear structure that is unstable by its eigenvalues has to be remarked, and no other.
"""
COUNT = 100
SMALL = (0, 1, 2, 3, 4, 7)
COLUMNS = {"solved": "solved", "failed": "ended in words", "slips": "with slip or open stops",
           "unstable": "unstable", "balance": "balance off", "work": "work off",
           "remark": "remark off", "integrated": "integrated", "time": "integration off"}
ZERO = ("balance", "work", "remark", "time")

KINDS = ("rotor", "hysteretic", "both", "following")
INSTANTS, TURNS = 8192, 5
#: Of the largest force: of memoryless elements (8,192 instants alias nothing that counts), and of
#: those with corners.
SMOOTH, CORNERS = 1e-8, 1e-4
WORK, PERIOD = 1e-8, 1e-3
#: Below it a growth is round-off or too near to call.
NEAR = 1e-6


def skew(random, n, size):
    matrix = size * random.normal(size=(n, n))
    return matrix - matrix.T


def drawn(seed):
    random = np.random.default_rng([2026, seed])
    kind = KINDS[seed % 4]
    n = int(random.integers(1, 7))
    springs = random.uniform(0.5, 2.0, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) \
        - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    mass = np.diag(random.uniform(0.5, 2.0, n))
    zero = np.zeros((n, n))
    case = {"kind": kind, "mass": mass, "stiffness": stiffness,
            "damping": random.uniform(0.01, 0.05) * mass + 0.02 * stiffness,
            "coriolis": zero, "circulatory": zero, "stiffness_unsymmetric": zero,
            "damping_unsymmetric": zero, "structural_damping": zero, "stiffness_rotation": zero,
            "loss_factor": 0.0, "speed": 0.0, "order": 0.0}
    if kind != "hysteretic":
        case["coriolis"] = skew(random, n, 0.4)
        case["circulatory"] = 0.03 * random.normal(size=(n, n))
        if random.random() < 0.6:
            case["stiffness_unsymmetric"] = 0.05 * random.normal(size=(n, n))
            case["damping_unsymmetric"] = 0.01 * random.normal(size=(n, n))
        case["speed"] = random.uniform(0.1, 1.5)
    if kind in ("hysteretic", "both", "following"):
        root = random.normal(size=(n, n))
        if random.random() < 0.7:
            case["structural_damping"] = 0.01 * root @ root.T
        if random.random() < 0.7:
            case["loss_factor"] = random.uniform(0.005, 0.1)
        if kind == "hysteretic" and random.random() < 0.5:
            case["damping"] = zero
            case["loss_factor"] = max(case["loss_factor"], 0.02)
    if kind == "following":
        case["order"] = float(random.choice([1.0, 2.0, 5.0]))
        case["stiffness_rotation"] = 0.1 * random.uniform() * np.eye(n)
    first = np.sqrt(np.linalg.eigvalsh(stiffness).min() / np.diag(mass).max())
    case["omega"] = first * random.uniform(0.5, 2.0)
    case["harmonics"] = 15 if seed % 8 == 0 else int(random.choice([1, 3, 5, 9, 15]))
    size = 10.0**random.uniform(-1.5, 0.5)
    case["cosine"], case["sine"] = size * random.normal(size=(2, n))
    case["static"] = size * random.normal(size=n) * (random.random() < 0.35)
    case["springs"], case["pairs"] = [], []
    law = str(random.choice(["penalty", "regularised"]))
    for dof in random.permutation(n)[:int(random.integers(1, 5))] + 1:
        if random.random() < 0.5 or (kind == "rotor" and seed % 8 == 0):
            case["springs"].append((int(dof), random.uniform(0.05, 0.5)))
        else:
            stop = law == "penalty" and random.random() < 0.4
            case["pairs"].append({
                "law": law, "dof": int(dof), "stop": stop, "mu": random.uniform(0.2, 0.6),
                "load": random.uniform(0.1, 1.0), "kt": random.uniform(0.3, 2.0),
                "kn": random.uniform(0.3, 2.0), "gap": random.uniform(0.0, 0.5),
                "v0": random.uniform(0.1, 0.5)})
    return case


MATRICES = ("mass", "stiffness", "damping", "coriolis", "circulatory", "stiffness_unsymmetric",
            "damping_unsymmetric", "structural_damping", "stiffness_rotation")
NEEDED = ("mass", "stiffness")


def write(case, folder):
    with h5py.File(folder / "m.h5", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        for name in MATRICES:
            if name in NEEDED or np.any(case[name]):
                file[name] = case[name]
        for name in ("cosine", "sine", "static"):
            file[f"load/{name}"] = case[name]
    lines = ["&case", "analysis = 'point'", "/", "&model source = 'hdf5' file = 'm.h5'",
             f"loss_factor = {case['loss_factor']!r}"]
    if case["speed"] and not case["order"]:
        lines.append(f"rotation_speed = {case['speed']!r}")
    lines.append("/")
    if case["springs"]:
        lines += ["&spring", f"n_springs = {len(case['springs'])}", "power = 3",
                  "side_1 = " + ", ".join(str(dof) for dof, _ in case["springs"]),
                  "coefficient = " + ", ".join(repr(c) for _, c in case["springs"]), "/"]
    pairs = case["pairs"]
    if pairs:
        def of(key):
            return ", ".join(repr(p[key]) for p in pairs)

        lines += ["&contact", f"n_pairs = {len(pairs)}", f"law = '{pairs[0]['law']}'",
                  "side_1 = " + ", ".join(
                      f"0, 0, {p['dof']}" if p["stop"] else f"{p['dof']}, 0, 0" for p in pairs),
                  f"mu = {of('mu')}", f"gap = {of('gap')}", f"normal_stiffness = {of('kn')}"]
        if not all(p["stop"] for p in pairs):
            lines.append(f"normal_load = {of('load')}")
        lines.append(f"tangential_stiffness = {of('kt')}" if pairs[0]["law"] == "penalty"
                     else f"slip_speed = {of('v0')}")
        lines.append("/")
    lines += ["&harmonics", f"n_harmonics = {case['harmonics']}", "parity = 'all'",
              *(["n_time = 4096"] if pairs and pairs[0]["law"] == "regularised" else []), "/",
              "&sweep", f"start = {float(case['omega'])!r}",
              *([f"speed_order = {case['order']!r}"] if case["order"] else []), "/",
              "&solver tolerance = 1e-11 /"]
    (folder / "case.nml").write_text("\n".join(lines) + "\n")


def matrices(case):
    """Stiffness, damping and D as they act."""
    speed = case["omega"] / case["order"] if case["order"] else case["speed"]
    k = case["stiffness"] + speed**2 * case["stiffness_rotation"]
    d = case["structural_damping"] + case["loss_factor"] * k
    return (k + case["stiffness_unsymmetric"] + speed * case["circulatory"],
            case["damping"] + case["damping_unsymmetric"] + speed * case["coriolis"], d)


TAU = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS


def waves(n):
    return np.array([np.ones(INSTANTS)] + [f(h * TAU) for h in range(1, n + 1)
                                           for f in (np.cos, np.sin)])


def forces(case, u):
    """Forces of all elements on the dofs (2H+1, n), and whether any slips or opens."""
    n = case["harmonics"]
    basis = waves(n)
    back = 2.0 * basis / INSTANTS
    back[0] /= 2.0
    rate = np.zeros_like(u)
    for h in range(1, n + 1):
        rate[2 * h - 1], rate[2 * h] = h * u[2 * h], -h * u[2 * h - 1]
    found, slips = np.zeros_like(u), False
    for dof, c in case["springs"]:
        found[:, dof - 1] += back @ (c * (u[:, dof - 1] @ basis)**3)
    for pair in case["pairs"]:
        x = u[:, pair["dof"] - 1] @ basis
        if pair["stop"]:
            # A stop below: it is pressed where the normal displacement closes the gap.
            pressure = pair["kn"] * np.maximum(-(x + pair["gap"]), 0.0)
            slips |= bool(pressure.max() > 0.0)
            force = -pressure
        elif pair["law"] == "penalty":
            limit = pair["mu"] * pair["load"]
            y, rest = pair["kt"] * x, 0.0
            force = np.empty_like(y)
            for _ in range(TURNS):
                for k, value in enumerate(y):
                    force[k] = min(max(value - rest, -limit), limit)
                    rest = value - force[k]
            slips |= bool(np.abs(force).max() >= limit)
        else:
            v = case["omega"] * (rate[:, pair["dof"] - 1] @ basis)
            force = pair["mu"] * pair["load"] * np.tanh(v / pair["v0"])
            slips = True
        found[:, pair["dof"] - 1] += back @ force
    return found, slips


def amplitude(u, h):
    return u[0] + 0j if h == 0 else u[2 * h - 1] - 1j * u[2 * h]


def after_a_period(case, u):
    """How far the state is from that of the result after a period, relative to it."""
    k, c, _ = matrices(case)
    w, inverse = case["omega"], np.linalg.inv(case["mass"])
    n = len(k)

    def slope(t, y):
        force = case["static"] + case["cosine"] * np.cos(w * t) + case["sine"] * np.sin(w * t) \
            - k @ y[:n] - c @ y[n:]
        for dof, coefficient in case["springs"]:
            force[dof - 1] -= coefficient * y[dof - 1]**3
        return np.concatenate((y[n:], inverse @ force))

    order = np.arange(1, case["harmonics"] + 1)
    start = np.concatenate((u[0] + u[1::2].sum(axis=0), w * order @ u[2::2]))
    done = solve_ivp(slope, (0.0, 2.0 * np.pi / w), start, method="DOP853", rtol=1e-10, atol=1e-12)
    return np.abs(done.y[:, -1] - start).max() / np.abs(start).max()


def growth(case):
    """Largest real part of the roots of the linear structure, over its frequency."""
    k, c, d = matrices(case)
    n, inverse = len(k), np.linalg.inv(case["mass"])
    roots = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)],
                                        [-inverse @ (k + 1j * d), -inverse @ c]]))
    roots = roots[roots.imag > 1e-9]
    return (roots.real / np.abs(roots)).max() if len(roots) else -1.0


def trial(seed, program, folder):
    case = drawn(seed)
    write(case, folder)
    done = subprocess.run([program, "-q", "case.nml"], cwd=folder, capture_output=True, text=True,
                          check=False)
    found = {"kind": case["kind"], **dict.fromkeys(COLUMNS, 0)}
    if done.returncode == 4:
        return {**found, "failed": 1}
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / "case.h5") as file:
        u = file["coefficients"][0]
        work = file["structural/dissipation"][0] if "structural" in file else 0.0
        remarks = [name.decode() for name in file["remarks/name"][()]] if "remarks" in file else []
    own, slips = forces(case, u)
    k, c, d = matrices(case)
    w = case["omega"]
    worst, taken = 0.0, 0.0
    largest = max(np.abs(own).max(), np.abs(case["cosine"]).max(), np.abs(case["sine"]).max())
    for h in range(case["harmonics"] + 1):
        z = k - (h * w)**2 * case["mass"] + 1j * h * w * c + (1j * d if h else 0.0)
        q = amplitude(u, h)
        load = {0: case["static"], 1: case["cosine"] - 1j * case["sine"]}.get(h, 0.0)
        worst = max(worst, np.abs(z @ q + amplitude(own, h) - load).max())
        taken += h * np.pi * (q.conj() @ d @ q).real
    corners = any(p["stop"] or p["law"] == "penalty" for p in case["pairs"])
    found.update(solved=1, slips=int(slips),
                 balance=int(worst > (CORNERS if corners and slips else SMOOTH) * largest),
                 work=int(abs(work - taken) > WORK * max(taken, 1e-6 * largest**2)))
    rate = growth(case)
    # Where a matrix that is no part of a sector makes it: the plain structure is not looked at.
    if abs(rate) > NEAR and case["kind"] != "hysteretic":
        found["unstable"] = int(rate > 0.0)
        found["remark"] = int((rate > 0.0) != ("unstable" in remarks))
    found["notes"] = [f"balance {worst / largest:.1e}, slips {slips}, corners {corners}, "
                      f"H {case['harmonics']}"] if found["balance"] else []
    if seed % 8 == 0 and rate < -NEAR and not case["pairs"]:
        found["integrated"] = 1
        change = after_a_period(case, u)
        # Ten times the last two harmonics: what those above leave.
        left = 10.0 * np.abs(u[-4:]).max() / np.abs(u).max()
        found["time"] = int(change > max(PERIOD, left))
        if found["time"]:
            found["notes"].append(f"after a period {change:.3e}")
    return found
