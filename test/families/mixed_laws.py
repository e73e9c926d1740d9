"""Pairs of several laws in one case, beside other elements, against forces of their own."""
import subprocess
from pathlib import Path

import bouc_wen
import h5py
import histories
import iwan
import normal_laws
import numpy as np
import user_steps
from histories import INSTANTS, marched, projected, series

TITLE = "Pairs of several laws"
TEXT = """
Chains of two to six masses with two to four pairs, each with a law of its own of `penalty`,
`regularised`, `dlft`, `dlft_velocity`, `iwan` and `bouc_wen`; some have a normal dof that opens and
closes under a preload, in half of those of the first two along a curve (power, exponential, table);
some stick; half of the smooth ones weaken and grow with the sliding speed, a third slides on a
moving side. Beside them stand, each in a third of the cases, a cubic spring, a damper of power 3,
a potential of two dofs and a slider that a user wrote in C. One frequency, 3 to 15 harmonics, 2,048
instants; in half of the cases without joints all pairs are sampled, in the others elastic ones
follow their events. Not drawn are `rigid` and sweeps over parameters, of which the tests have
single cases.

The judge takes the displacements and the forces of the result. The balance of every harmonic is
written anew, with forces of springs, dampers and potentials of the judge's own at 8,192 instants,
and has to hold to 1e-7 of the load. The forces of elastic pairs, and of the slider, are marched
over these instants of the displacement, those of smooth friction and of curves follow from the
motion at these, joints are 2,000 elements in parallel or their differential equation: all have to
be those of the result within 0.5 % of the largest force of the case. Rigid friction is marched with
a stiffness of the judge's own, on which an exact solution does not depend: what a few harmonics
leave is allowed for (30 % of the largest force with 3, 6 % with 15).
"""
COUNT = 100
SMALL = (0, 1, 2, 3, 5, 8)
COLUMNS = {"solved": "solved", "failed": "ended in words", "mixed": "with rigid and elastic pairs",
           "open": "with pairs that open", "curved": "with curves", "joints": "with joints",
           "others": "with other elements", "balance": "balance off",
           "elastic": "elastic forces off", "smooth": "smooth forces off",
           "rigid": "rigid forces off", "joint": "forces of joints off", "user": "slider off"}
ZERO = ("balance", "elastic", "smooth", "rigid", "joint", "user")
ALSO = [Path(module.__file__) for module in (
    bouc_wen, histories, iwan, normal_laws, user_steps)] + [bouc_wen.SOURCE, user_steps.SOURCE]

LAWS = ("penalty", "regularised", "dlft", "dlft_velocity", "iwan", "bouc_wen")
JOINTS = ("iwan", "bouc_wen")
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
        law = str(random.choice(LAWS))
        normal = len(free) > 1 and random.random() < 0.4 and law not in JOINTS
        pairs.append({
            "law": law, "t": int(free.pop()),
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
        if law != "regularised":
            pairs[-1]["speed"] = 0.0  # Elastic and rigid pairs slide along too: family rubs.
        curved = normal and law in ("penalty", "regularised") and random.random() < 0.5
        pairs[-1] |= {
            "word": str(random.choice(normal_laws.WORDS)) if curved else "unilateral",
            "c": random.uniform(0.5, 4.0), "e": random.uniform(1.0, 3.0),
            "p0": random.uniform(0.05, 1.0), "h": random.uniform(0.1, 0.5),
            "limit": pairs[-1]["mu"] * pairs[-1]["load"],
            "iwan_chi": random.uniform(-0.9, 1.0), "iwan_beta": random.uniform(0.0, 3.0),
            "bouc_wen_exponent": int(random.integers(1, 3)),
            "bouc_wen_beta": random.uniform(0.5, 1.0)}
    table = np.cumsum(random.uniform(0.1, 0.5, 3)), np.cumsum(random.uniform(0.05, 0.8, 3))
    others = {name: random.random() < 1.0 / 3.0 for name in ("spring", "damper", "potential",
                                                               "slider")}
    dofs = [int(dof) for dof in random.permutation(n)[:2] + 1]
    first = np.sqrt(np.linalg.eigvalsh(np.linalg.solve(mass, stiffness)).real.clip(1e-6).min())
    return {"mass": mass, "damping": damping, "stiffness": stiffness, "pairs": pairs,
            "cosine": random.normal(size=n), "sine": random.normal(size=n),
            "static": -0.3 * random.random(n), "omega": first * random.uniform(0.5, 2.0),
            "table": [np.concatenate([[0.0], column]) for column in table],
            "others": [name for name, there in others.items() if there], "dofs": dofs,
            "strength": random.uniform(0.05, 0.5), "slider": [random.uniform(0.3, 2.0),
                                                              random.uniform(0.1, 1.0)],
            "events": bool(random.random() < 0.5) or any(p["law"] in JOINTS for p in pairs),
            "harmonics": int(random.choice([3, 5, 9, 15]))}


def text(case):
    def row(values):
        return ", ".join(f"{float(v)!r}" for v in np.ravel(values))

    def of(key):
        return ", ".join(f"{p[key]!r}" for p in case["pairs"])

    pairs = case["pairs"]
    used = {p["law"] for p in pairs}
    lines = ["&case", "analysis = 'point'", "max_seconds = 60", "/", "&model",
             f"n_dof = {len(case['mass'])}"]
    lines += [f"{key} = {row(case[key])}" for key in ("mass", "damping", "stiffness")]
    lines += ["/", "&contact", f"n_pairs = {len(pairs)}", f"law = {of('law')}",
              "side_1 = " + ", ".join(f"{p['t']}, 0, {p['n']}" for p in pairs), f"mu = {of('mu')}"]
    words = {p["word"] for p in pairs if p["n"]}
    if words - {"unilateral"}:
        lines.append(f"normal_law = {of('word')}")
    if "power" in words:
        lines += [f"normal_coefficient = {of('c')}", f"normal_exponent = {of('e')}"]
    if "exponential" in words:
        lines += [f"reference_force = {of('p0')}", f"decay_length = {of('h')}"]
    if "table" in words:
        d, force = case["table"]
        lines += [f"n_table = {len(d)}", f"overclosure = {row(d)}", f"force = {row(force)}"]
    for law in set(JOINTS) & used:
        lines += [f"{key} = {of(key)}" for key in pairs[0] if key.startswith(law)]
    if any(p["n"] == 0 for p in pairs):
        lines.append(f"normal_load = {of('load')}")
    lines.append(f"gap = {of('gap')}")
    if used & {"penalty", *JOINTS}:
        lines.append(f"tangential_stiffness = {of('kt')}")
    if "regularised" in used:
        lines.append(f"slip_speed = {of('v0')}")
        lines += [f"{key} = {of(name)}" for key, name in (
            ("mu_dynamic", "dynamic"), ("weakening_speed", "weakening"),
            ("weakening_exponent", "exponent"), ("mu_viscous", "viscous"), ("speed_1", "speed"))]
    if any(p["law"] in ("penalty", "regularised") and p["word"] == "unilateral" for p in pairs):
        lines.append(f"normal_stiffness = {of('kn')}")
    lines += ["/", *other_groups(case), "&load"]
    lines += [f"{key} = {row(case[key])}" for key in ("cosine", "sine", "static")]
    lines += ["/", "&harmonics", f"n_harmonics = {case['harmonics']}", "n_time = 2048",
              "parity = 'all'", f"sampling = '{'auto' if case['events'] else 'uniform'}'", "/",
              "&sweep",
              f"start = {float(case['omega'])!r}", "/", "&solver", "tolerance = 1e-10", "/"]
    return "\n".join(lines) + "\n"


def other_groups(case):
    """Groups of the elements beside the pairs, each followed by the end of the one before."""
    a, b = case["dofs"]
    strength = f"coefficient = {case['strength']!r}"
    groups = {
        "spring": ["&spring", "n_springs = 1", f"side_1 = {a}", strength, "power = 3"],
        "damper": ["&damper", "n_dampers = 1", f"side_1 = {b}", f"side_2 = {a}", strength,
                   "power = 3"],
        "potential": ["&polynomial", "n_terms = 1", "of = 'energy'",
                      f"factors = {a}, {a}, {b}, {b}, 0, 0, 0, 0", strength],
        "slider": ["&user", "n_elements = 1", "library = 'steps.so'", "symbol = 'slider'",
                   f"side_1 = {a}", "n_parameters = 4",
                   "parameters = " + ", ".join(f"{v!r}" for v in (*case["slider"], 0.0, 0.0))]}
    return [line for name in case["others"] for line in (*groups[name], "/")]


def other_forces(case, u):
    """What spring, damper and potential add to the balance (2H+1, n_dof)."""
    tau = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
    force = np.zeros_like(u)
    a, b = (dof - 1 for dof in case["dofs"])
    (x, dx), (y, dy) = series(u[:, a], tau), series(u[:, b], tau)
    if "spring" in case["others"]:
        force[:, a] += projected(case["strength"] * x**3, tau, len(u))
    if "damper" in case["others"]:
        drag = projected(case["strength"] * (case["omega"] * (dy - dx))**3, tau, len(u))
        force[:, b] += drag
        force[:, a] -= drag
    if "potential" in case["others"]:
        force[:, a] += projected(2.0 * case["strength"] * x * y**2, tau, len(u))
        force[:, b] += projected(2.0 * case["strength"] * x**2 * y, tau, len(u))
    return force


def own_forces(pair, u, force, stiffness, omega, table):
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
        if pair["word"] != "unilateral":
            pressure = normal_laws.pressure(
                pair, table, -series(u[:, pair["n"] - 1] + gap, tau)[0])
    limit = pair["mu"] * pressure
    displacement = u[:, pair["t"] - 1]
    if pair["law"] == "regularised":
        speed = omega * series(displacement, tau)[1] - pair["speed"]
        fallen = np.exp(-(abs(speed) / pair["weakening"])**pair["exponent"])
        friction = pair["dynamic"] + (pair["mu"] - pair["dynamic"]) * fallen \
            + pair["viscous"] * abs(speed)
        tangential = friction * pressure * np.tanh(speed / pair["v0"])
    elif pair["law"] in JOINTS:
        judge = {"iwan": iwan, "bouc_wen": bouc_wen}[pair["law"]]
        tangential = judge.march(pair, series(pair["kt"] * displacement, tau)[0])
    else:
        y = pair["kt"] * displacement
        if rigid:
            y = force[:, 0] + stiffness[pair["t"] - 1, pair["t"] - 1] * displacement
        tangential = marched(series(y, tau)[0], limit)
    return np.array([projected(tangential, tau, size), -projected(pressure, tau, size)]), pressure


def trial(seed, program, folder):
    case = drawn(seed)
    if "slider" in case["others"]:
        user_steps.build(folder)
    (folder / "case.nml").write_text(text(case))
    done = subprocess.run([program, "-q", "case.nml"], cwd=folder, capture_output=True, text=True,
                          check=False)
    found = dict.fromkeys(COLUMNS, 0)
    if done.returncode in (4, 6):
        return {**found, "failed": 1}
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / "case.h5") as file:
        u, force = file["coefficients"][0], file["contact/force"][0]
        slides = file["user/force"][0, :, 0, 0] if "slider" in case["others"] else np.zeros(len(u))
    omega, pairs = case["omega"], case["pairs"]
    laws = {p["law"].startswith("dlft") for p in pairs}
    found.update(solved=1, mixed=int(len(laws) == 2), others=int(bool(case["others"])),
                 curved=int(any(p["word"] != "unilateral" for p in pairs)),
                 joints=int(any(p["law"] in JOINTS for p in pairs)))
    beside = other_forces(case, u)
    beside[:, case["dofs"][0] - 1] += slides
    # The balance of each harmonic, in complex amplitudes.
    worst = 0.0
    for h in range(case["harmonics"] + 1):
        at = slice(0, 1) if h == 0 else slice(2 * h - 1, 2 * h + 1)
        turn = np.array([1.0]) if h == 0 else np.array([1.0, -1.0j])
        z = case["stiffness"] - (h * omega)**2 * case["mass"] + 1j * h * omega * case["damping"]
        rest = z @ (turn @ u[at]) + turn @ beside[at]
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
        own, pressure = own_forces(pair, u, force[:, i], case["stiffness"], omega, case["table"])
        found["open"] |= int(pair["n"] > 0 and pressure.min() <= 0.0)
        off = np.abs(own - force[:, i, [0, 2]].T).max() / largest
        if pair["law"] == "dlft_velocity":
            # A stuck pair of rates rests anywhere: its mean is no function of the displacement.
            off = np.abs(own - force[:, i, [0, 2]].T)[:, 1:].max() / largest
        kind = {"penalty": "elastic", "regularised": "smooth", "iwan": "joint",
                "bouc_wen": "joint"}.get(pair["law"], "rigid")
        allowed = RIGID / case["harmonics"] if kind == "rigid" else FORCE
        found[kind] |= int(off > allowed)
    if "slider" in case["others"]:
        stiffness, limit = case["slider"]
        tau = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
        y = series(stiffness * u[:, case["dofs"][0] - 1], tau)[0]
        own = projected(marched(y, np.full(INSTANTS, limit)), tau, len(u))
        found["user"] = int(np.abs(own - slides).max() > FORCE * max(largest, limit))
    return found
