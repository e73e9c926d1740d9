"""Nonlinear dampers, against forces of the judge's own and integration in time."""
import subprocess

import h5py
import numpy as np
from histories import INSTANTS, projected, series
from normal_laws import row
from scipy.integrate import solve_ivp

TITLE = "Dampers"
TEXT = """
Chains of one to six masses with one to four dampers `c u^q |v|^(p-1) v`, between dofs or to the
ground: powers 1, 1.5, 2, 3 and any between 1 and 3, position powers 0 to 3; some with a cubic
spring beside them and a static load. Forces reach from a hundredth of the viscous ones to ten
times as much. One frequency, 1 to 15 harmonics, the program's own number of instants.

The judge takes the displacements of the result. Forces are computed of these at 8,192 instants; the
balance of every harmonic with them has to hold within 0.2 % of the load (what the program's 512
instants leave of broken powers), and the work of each damper to be that of the result within 0.2 %
of all that the loads give. The motion is integrated over a period from its own start (DOP853,
tolerance 1e-9): with 9 harmonics or more it has to stay as near as its last two harmonics, times
30, or 1 %.
"""
COUNT = 100
SMALL = (0, 1, 2, 3, 5, 8)
COLUMNS = {"solved": "solved", "failed": "ended in words", "balance": "balance off",
           "work": "work off", "motion": "motion off"}
ZERO = ("balance", "work", "motion")

BALANCE, WORK, MOTION = 2e-3, 2e-3, 1e-2


def drawn(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 7))
    springs = random.uniform(0.5, 2.0, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) \
        - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    mass = np.diag(random.uniform(0.5, 2.0, n))
    damping = random.uniform(0.01, 0.05) * mass + random.uniform(0.005, 0.05) * stiffness
    dampers = []
    for _ in range(int(random.integers(1, 5))):
        one = int(random.integers(1, n + 1))
        other = int(random.integers(0, n + 1))
        power = random.choice([1.0, 1.5, 2.0, 3.0, random.uniform(1.0, 3.0)])
        dampers.append({"one": one, "other": 0 if other == one else other, "p": float(power),
                        "q": int(random.choice([0, 0, 1, 2, 3])),
                        "c": float(10.0**random.uniform(-2.0, 0.0))})
        # Forces of odd q feed the motion on one side: weak ones only.
        if dampers[-1]["q"] % 2 == 1:
            dampers[-1]["c"] *= 0.1
    first = np.sqrt(np.linalg.eigvalsh(np.linalg.solve(mass, stiffness)).real.clip(1e-6).min())
    size = 10.0**random.uniform(-1.0, 0.3)
    cubic = float(random.uniform(0.0, 0.3)) if random.random() < 0.4 else 0.0
    static = 0.3 * random.normal(size=n) if random.random() < 0.3 else np.zeros(n)
    return {"mass": mass, "damping": damping, "stiffness": stiffness, "dampers": dampers,
            "cubic": cubic, "cosine": size * random.normal(size=n),
            "sine": size * random.normal(size=n), "static": static,
            "omega": first * random.uniform(0.5, 2.0), "harmonics": int(random.integers(1, 16))}


def text(case):
    def of(key):
        return ", ".join(f"{d[key]!r}" for d in case["dampers"])

    lines = ["&case", "analysis = 'point'", "/", "&model", f"n_dof = {len(case['mass'])}"]
    lines += [f"{key} = {row(case[key])}" for key in ("mass", "damping", "stiffness")]
    lines += ["/", "&damper", f"n_dampers = {len(case['dampers'])}", f"side_1 = {of('one')}",
              f"side_2 = {of('other')}", f"coefficient = {of('c')}", f"power = {of('p')}",
              f"position_power = {of('q')}", "/"]
    if case["cubic"]:
        lines += ["&spring", "n_springs = 1", "side_1 = 1", f"coefficient = {case['cubic']!r}", "/"]
    lines += ["&load"] + [f"{key} = {row(case[key])}" for key in ("cosine", "sine", "static")]
    lines += ["/", "&harmonics", f"n_harmonics = {case['harmonics']}", "/",
              "&sweep", f"start = {float(case['omega'])!r}", "/",
              "&solver", "tolerance = 1e-10", "/"]
    return "\n".join(lines) + "\n"


def relative(damper, x):
    return x[damper["one"] - 1] - (x[damper["other"] - 1] if damper["other"] else 0.0)


def force_of(damper, u, v):
    return damper["c"] * u**damper["q"] * abs(v)**(damper["p"] - 1.0) * v


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
        f[0] -= case["cubic"] * x[0]**3
        for damper in case["dampers"]:
            force = force_of(damper, relative(damper, x), relative(damper, v))
            f[damper["one"] - 1] -= force
            if damper["other"]:
                f[damper["other"] - 1] += force
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
        u, said = file["coefficients"][0], file["damper/dissipation"][0]
    omega, notes, size = case["omega"], [], len(u)
    found["solved"] = 1
    tau = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
    motion = [series(u[:, j], tau) for j in range(u.shape[1])]
    forces = np.zeros_like(u)
    forces[:, 0] += projected(case["cubic"] * motion[0][0]**3, tau, size)
    work = []
    for damper in case["dampers"]:
        x = relative(damper, [m[0] for m in motion])
        v = omega * relative(damper, [m[1] for m in motion])
        force = force_of(damper, x, v)
        work.append(2.0 * np.pi / omega * np.mean(force * v))
        part = projected(force, tau, size)
        forces[:, damper["one"] - 1] += part
        if damper["other"]:
            forces[:, damper["other"] - 1] -= part
    worst = 0.0
    for h in range(case["harmonics"] + 1):
        at = slice(0, 1) if h == 0 else slice(2 * h - 1, 2 * h + 1)
        turn = np.array([1.0]) if h == 0 else np.array([1.0, -1.0j])
        z = case["stiffness"] - (h * omega)**2 * case["mass"] + 1j * h * omega * case["damping"]
        rest = z @ (turn @ u[at]) + turn @ forces[at]
        rest -= {0: case["static"], 1: case["cosine"] - 1j * case["sine"]}.get(h, 0.0)
        worst = max(worst, np.abs(rest).max())
    load = np.linalg.norm([case["cosine"], case["sine"], case["static"]])
    if worst > BALANCE * load:
        found["balance"] = 1
        notes.append(f"balance off by {worst / load:.1e}")
    given = abs(np.pi * (case["cosine"] @ u[2] - case["sine"] @ u[1]))
    off = np.abs(said - work).max() / max(given, 1e-12)
    if off > WORK:
        found["work"] = 1
        notes.append(f"work off by {off:.1e}")
    moved, stood = integrated(case, u)
    off = np.abs(moved - stood).max() / np.abs(stood).max()
    left = np.abs(u[-4:]).max() / np.abs(u).max()
    if case["harmonics"] >= 9 and off > max(MOTION, 30.0 * left):
        found["motion"] = 1
        notes.append(f"motion off by {off:.1e}, last harmonics {left:.1e}")
    return {**found, "notes": notes}
