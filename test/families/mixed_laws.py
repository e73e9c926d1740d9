"""Pairs of several laws in one case, against forces of their own."""
import subprocess

import h5py
import numpy as np

TITLE = "Pairs of several laws"
TEXT = """
Chains of two to six masses with two to four pairs, each with a law of its own of `penalty`,
`regularised`, `dlft` and `dlft_velocity`; some have a normal dof that opens and closes under
a preload, some stick; half of the smooth ones weaken and grow with the sliding speed, a third
slides on a moving side. One frequency, 3 to 15 harmonics, 2,048 instants. Not drawn are
`rigid`, located events and sweeps over parameters, of which the tests have single cases.

The judge takes the displacements and the forces of the result. The balance of every harmonic is
written anew, and has to hold to 1e-7 of the load. The forces of elastic pairs are marched over
8,192 instants of the displacement, those of smooth friction follow from the velocity at these: both
have to be those of the result within 0.5 % of the largest force of the case. Rigid friction is
marched with a stiffness of the judge's own, on which an exact solution does not depend: what a few
harmonics leave is allowed for (30 % of the largest force with 3, 6 % with 15).
"""
COUNT = 100
SMALL = (0, 1, 2, 3, 5, 8)
COLUMNS = {"solved": "solved", "failed": "ended in words", "mixed": "with rigid and elastic pairs",
           "open": "with pairs that open", "balance": "balance off",
           "elastic": "elastic forces off", "smooth": "smooth forces off",
           "rigid": "rigid forces off"}
ZERO = ("balance", "elastic", "smooth", "rigid")

LAWS = ("penalty", "regularised", "dlft", "dlft_velocity")
INSTANTS, TURNS = 8192, 6
#: Of the load; of the largest force.
BALANCE, FORCE, RIGID = 1e-7, 5e-3, 0.9


def drawn(seed):
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 7))
    springs = random.uniform(0.5, 2.0, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) \
        - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    mass = np.diag(random.uniform(0.5, 2.0, n))
    damping = random.uniform(0.01, 0.05) * mass + random.uniform(0.005, 0.05) * stiffness
    free = list(random.permutation(n) + 1)
    pairs = []
    for _ in range(int(random.integers(2, 5))):
        if not free:
            break
        normal = len(free) > 1 and random.random() < 0.4
        pairs.append({
            "law": str(random.choice(LAWS)), "t": int(free.pop()),
            "n": int(free.pop()) if normal else 0, "mu": random.uniform(0.1, 0.6),
            "load": 0.0 if normal else 10.0**random.uniform(-1.0, 0.5),
            "gap": random.uniform(-0.5, 0.2) if normal else 0.0,
            "kt": random.uniform(0.3, 3.0), "kn": random.uniform(0.5, 4.0),
            "v0": random.uniform(0.1, 0.5)})
        fast = random.random() < 0.5
        pairs[-1] |= {"dynamic": pairs[-1]["mu"] * (random.uniform(0.3, 1.0) if fast else 1.0),
                      "weakening": random.uniform(0.2, 1.0), "exponent": random.uniform(1.0, 2.0),
                      "viscous": random.uniform(0.0, 0.2) if fast else 0.0,
                      "speed": random.normal() * 0.3 if random.random() < 0.3 else 0.0}
    first = np.sqrt(np.linalg.eigvalsh(np.linalg.solve(mass, stiffness)).real.clip(1e-6).min())
    return {"mass": mass, "damping": damping, "stiffness": stiffness, "pairs": pairs,
            "cosine": random.normal(size=n), "sine": random.normal(size=n),
            "static": -0.3 * random.random(n), "omega": first * random.uniform(0.5, 2.0),
            "harmonics": int(random.choice([3, 5, 9, 15]))}


def text(case):
    def row(values):
        return ", ".join(f"{float(v)!r}" for v in np.ravel(values))

    def of(key):
        return ", ".join(f"{p[key]!r}" for p in case["pairs"])

    pairs = case["pairs"]
    used = {p["law"] for p in pairs}
    lines = ["&case", "analysis = 'point'", "/", "&model", f"n_dof = {len(case['mass'])}"]
    lines += [f"{key} = {row(case[key])}" for key in ("mass", "damping", "stiffness")]
    lines += ["/", "&contact", f"n_pairs = {len(pairs)}", f"law = {of('law')}",
              "side_1 = " + ", ".join(f"{p['t']}, 0, {p['n']}" for p in pairs), f"mu = {of('mu')}"]
    if any(p["n"] == 0 for p in pairs):
        lines.append(f"normal_load = {of('load')}")
    lines.append(f"gap = {of('gap')}")
    if "penalty" in used:
        lines.append(f"tangential_stiffness = {of('kt')}")
    if "regularised" in used:
        lines.append(f"slip_speed = {of('v0')}")
        lines += [f"{key} = {of(name)}" for key, name in (
            ("mu_dynamic", "dynamic"), ("weakening_speed", "weakening"),
            ("weakening_exponent", "exponent"), ("mu_viscous", "viscous"), ("speed_1", "speed"))]
    if used & {"penalty", "regularised"}:
        lines.append(f"normal_stiffness = {of('kn')}")
    lines += ["/", "&load"] + [f"{key} = {row(case[key])}" for key in ("cosine", "sine", "static")]
    lines += ["/", "&harmonics", f"n_harmonics = {case['harmonics']}", "n_time = 2048",
              "parity = 'all'", "sampling = 'uniform'", "/", "&sweep",
              f"start = {float(case['omega'])!r}", "/", "&solver", "tolerance = 1e-10", "/"]
    return "\n".join(lines) + "\n"


def series(coefficients, tau):
    """Values of (2H+1) coefficients at angles, and of the derivative by the angle."""
    value, slope = np.full(len(tau), coefficients[0]), np.zeros(len(tau))
    for h in range(1, (len(coefficients) + 1) // 2):
        c, s = coefficients[2 * h - 1:2 * h + 1]
        value += c * np.cos(h * tau) + s * np.sin(h * tau)
        slope += h * (s * np.cos(h * tau) - c * np.sin(h * tau))
    return value, slope


def projected(values, tau, n):
    """The first n coefficients of a history."""
    rows = [np.ones(len(tau))]
    for h in range(1, (n + 1) // 2):
        rows += [2.0 * np.cos(h * tau), 2.0 * np.sin(h * tau)]
    return np.array(rows) @ values / len(tau)


def marched(predicted, limit, x=0.0):
    """Coulomb's friction of a predicted force less a position x, turn after turn."""
    force = np.empty_like(predicted)
    for _ in range(TURNS):
        for k in range(len(predicted)):
            trial = predicted[k] - x
            force[k] = min(max(trial, -limit[k]), limit[k])
            x = predicted[k] - force[k]
    return force


def own_forces(pair, u, force, stiffness, omega):
    """Tangential and normal force of a pair (2, 2H+1) from the coefficients of all dofs."""
    tau = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
    rigid = pair["law"].startswith("dlft")
    size = len(force)
    pressure, gap = np.full(INSTANTS, pair["load"]), np.zeros(size)
    gap[0] = pair["gap"]
    if pair["n"]:
        y = pair["kn"] * (u[:, pair["n"] - 1] + gap)
        if rigid:
            y = force[:, 2] + stiffness[pair["n"] - 1, pair["n"] - 1] * (u[:, pair["n"] - 1] + gap)
        pressure = np.maximum(-series(y, tau)[0], 0.0)
    limit = pair["mu"] * pressure
    displacement = u[:, pair["t"] - 1]
    if pair["law"] == "regularised":
        speed = omega * series(displacement, tau)[1] - pair["speed"]
        fallen = np.exp(-(abs(speed) / pair["weakening"])**pair["exponent"])
        friction = pair["dynamic"] + (pair["mu"] - pair["dynamic"]) * fallen \
            + pair["viscous"] * abs(speed)
        tangential = friction * pressure * np.tanh(speed / pair["v0"])
    else:
        y = pair["kt"] * displacement
        if rigid:
            y = force[:, 0] + stiffness[pair["t"] - 1, pair["t"] - 1] * displacement
        tangential = marched(series(y, tau)[0], limit)
    return np.array([projected(tangential, tau, size), -projected(pressure, tau, size)]), pressure


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
    omega, pairs = case["omega"], case["pairs"]
    laws = {p["law"].startswith("dlft") for p in pairs}
    found.update(solved=1, mixed=int(len(laws) == 2))
    # The balance of each harmonic, in complex amplitudes.
    worst = 0.0
    for h in range(case["harmonics"] + 1):
        at = slice(0, 1) if h == 0 else slice(2 * h - 1, 2 * h + 1)
        turn = np.array([1.0]) if h == 0 else np.array([1.0, -1.0j])
        z = case["stiffness"] - (h * omega)**2 * case["mass"] + 1j * h * omega * case["damping"]
        rest = z @ (turn @ u[at])
        for i, pair in enumerate(pairs):
            lam = turn @ force[at, i]
            rest[pair["t"] - 1] += lam[0]
            if pair["n"]:
                rest[pair["n"] - 1] += lam[2]
        rest -= {0: case["static"], 1: case["cosine"] - 1j * case["sine"]}.get(h, 0.0)
        worst = max(worst, np.abs(rest).max())
    found["balance"] = int(worst > BALANCE * np.linalg.norm(case["cosine"]))
    largest = np.abs(force).max()
    for i, pair in enumerate(pairs):
        own, pressure = own_forces(pair, u, force[:, i], case["stiffness"], omega)
        found["open"] |= int(pair["n"] > 0 and pressure.min() <= 0.0)
        off = np.abs(own - force[:, i, [0, 2]].T).max() / largest
        if pair["law"] == "dlft_velocity":
            # A stuck pair of rates rests anywhere: its mean is no function of the displacement.
            off = np.abs(own - force[:, i, [0, 2]].T)[:, 1:].max() / largest
        kind = {"penalty": "elastic", "regularised": "smooth"}.get(pair["law"], "rigid")
        allowed = RIGID / case["harmonics"] if kind == "rigid" else FORCE
        found[kind] |= int(off > allowed)
    return found
