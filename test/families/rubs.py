"""Obstacles that move, against a march of the judge's own."""
import subprocess

import h5py
import numpy as np

TITLE = "Rubs"
TEXT = """
A body of three dofs carries one to four tips, each on springs of a direction of its own, that face
obstacles: gaps with one to three terms in harmonics 0 to 4, sides that slide along one or two
directions or not at all, on the path or steadily. Tips have mass (`penalty`, `regularised`) or none
(`dlft`). Speeds reach from a tenth of the vibration to a thousand times as much; 3 to 12 harmonics,
128 to 512 instants, or events.

The judge takes the displacements and forces of the result. It marches every pair by itself, with
its anchor carried along, from instant to instant until a turn repeats, and holds the harmonics of
these forces against those of the result (1e-6 of the largest; of events by 32,768 instants 1e-4).
The balance of every harmonic has to hold within 1e-7 of its largest term, the work of loads and
obstacles to be that of friction and damping within 1e-8, and friction not to give energy.
"""
COUNT = 200
SMALL = (0, 1, 2, 3, 4, 5, 6, 7)
COLUMNS = {"solved": "solved", "failed": "ended in words", "force": "force off",
           "balance": "balance off", "work": "work off", "heat": "negative heat"}
ZERO = ("force", "balance", "work", "heat")

LINK, TURNS = 4e4, 400
FORCE, BY_EVENTS, BALANCE, WORK = 1e-6, 1e-4, 1e-7, 1e-8


def drawn(seed):
    random = np.random.default_rng(seed)
    law = ("penalty", "dlft", "regularised", "penalty")[seed % 4]
    events = law == "penalty" and seed % 8 == 7
    pairs = int(random.integers(1, 5))
    two = bool(random.random() < 0.4)
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    body = turn @ np.diag(random.uniform(5e3, 4e4, 3)) @ turn.T
    n = 3 + 3 * pairs
    stiffness, mass = np.zeros((n, n)), np.zeros((n, n))
    stiffness[:3, :3], mass[:3, :3] = body, np.eye(3)
    for i in range(pairs):
        near = np.linalg.qr(np.eye(3) + 0.4 * random.normal(size=(3, 3)))[0]
        rows = np.zeros((3, n))
        rows[:, :3], rows[:, 3 + 3 * i:6 + 3 * i] = -near, np.eye(3)
        stiffness += LINK * rows.T @ rows
        at = slice(3 + 3 * i, 6 + 3 * i)
        mass[at, at] = 0.0 if law == "dlft" else 0.05 * np.eye(3)
    damping = 2e-4 * stiffness + 0.5 * mass
    size = 10.0**random.uniform(-4.0, -3.0)
    harmonics = int(random.integers(4, 13))
    terms = [(int(random.integers(0, pairs + 1)), int(random.integers(0, 5)),
              float(size * random.uniform(0.2, 1.0)), float(random.uniform(-180.0, 180.0)))
             for _ in range(int(random.integers(1, 4)))]
    omega = float(random.uniform(40.0, 160.0))
    fast = size * omega * 10.0**random.uniform(-1.0, 3.0)
    sliding = ("path", "steady")[int(random.random() < 0.4)]
    if events:
        sliding = "steady"
    speed = np.zeros((pairs, 2))
    if events and random.random() < 0.5:
        sliding = "path"
    if events or sliding == "steady" or random.random() < 0.8:
        speed[:, 0] = fast * random.choice([-1.0, 1.0])
        if two:
            speed[:, 1] = fast * random.uniform(-1.0, 1.0)
    gap = size * random.uniform(-0.5, 0.8, pairs)
    return {
        "law": law, "events": events, "two": two, "mass": mass, "damping": damping,
        "stiffness": stiffness, "terms": terms, "omega": omega, "sliding": sliding,
        "speed": speed, "gap": gap, "mu": random.uniform(0.05, 0.5, pairs),
        "kt": random.uniform(5e3, 4e4, pairs), "kn": random.uniform(5e3, 4e4, pairs),
        "v0": size * omega * random.uniform(0.2, 1.0), "harmonics": harmonics,
        "n_time": int(random.choice([128, 256, 512])) if law != "regularised" else 512,
        "cosine": 20.0 * size / 1e-3 * random.normal(size=3),
        "sine": 20.0 * size / 1e-3 * random.normal(size=3)}


def listed(values):
    return ", ".join(repr(float(v)) for v in np.ravel(np.transpose(values)))


def text(case):
    pairs, n = len(case["gap"]), len(case["mass"])
    sides = ", ".join(f"{4 + 3 * i}, {5 + 3 * i if case['two'] else 0}, {6 + 3 * i}"
                      for i in range(pairs))
    contact = [f"n_pairs = {pairs}", f"law = '{case['law']}'", f"side_1 = {sides}",
               f"gap = {listed(case['gap'])}", f"mu = {listed(case['mu'])}",
               f"n_gap_terms = {len(case['terms'])}"]
    contact += [f"{key} = " + ", ".join(repr(term[j]) for term in case["terms"])
                for j, key in enumerate(("gap_pair", "gap_harmonic", "gap_amplitude",
                                         "gap_phase"))]
    if case["law"] != "dlft":
        contact.append(f"normal_stiffness = {listed(case['kn'])}")
    if case["law"] == "penalty":
        contact.append(f"tangential_stiffness = {listed(case['kt'])}")
    if case["law"] == "regularised":
        contact.append(f"slip_speed = {case['v0']!r}")
    if case["speed"].any():
        contact.append(f"speed_1 = {listed(case['speed'][:, 0])}")
        if case["two"]:
            contact.append(f"speed_2 = {listed(case['speed'][:, 1])}")
        contact.append(f"sliding = '{case['sliding']}'")
    sampling = "sampling = 'events'" if case["events"] else \
        f"n_time = {case['n_time']}\nsampling = 'uniform'"
    zeros = "".join(", 0.0" for _ in range(n - 3))
    return "\n".join([
        "&case", "analysis = 'point'", "/", "&model", f"n_dof = {n}",
        *(f"{key} = {listed(case[key])}" for key in ("mass", "damping", "stiffness")), "/",
        "&contact", *contact, "/", "&load",
        *(f"{key} = {listed(case[key])}{zeros}" for key in ("cosine", "sine")), "/",
        "&harmonics", f"n_harmonics = {case['harmonics']}", sampling, "/",
        "&sweep", f"start = {case['omega']!r}", "/", "&solver", "tolerance = 1e-11", "/", ""])


def gaps(case, tau):
    found = np.repeat(case["gap"][:, None], len(tau), axis=1)
    for pair, n, amplitude, phase in case["terms"]:
        wave = amplitude * np.cos(n * tau + np.radians(phase))
        found[slice(None) if pair == 0 else slice(pair - 1, pair)] += wave
    return found


def rigid_stiffness(case):
    """The static stiffness that the structure shows at each pair, alike along t1 and t2."""
    pairs = len(case["gap"])
    joint = [3 + 3 * i + c for i in range(pairs) for c in ((0, 1, 2) if case["two"] else (0, 2))]
    rest = [j for j in range(len(case["mass"])) if j not in joint]
    k = case["stiffness"]
    own = np.diag(k[np.ix_(joint, joint)] - k[np.ix_(joint, rest)] @ np.linalg.solve(
        k[np.ix_(rest, rest)], k[np.ix_(rest, joint)])).reshape(pairs, -1)
    tangential = own[:, :-1].mean(axis=1)
    return np.column_stack([tangential, tangential, own[:, -1]])


def marched(case, i, y, k):
    """Forces of a pair at the instants, from its inputs (instant, t1 t2 n)."""
    n_time, speed, mu = len(y), case["speed"][i], case["mu"][i]
    pressure = np.maximum(-y[:, 2], 0.0)
    force = np.zeros_like(y)
    force[:, 2] = -pressure
    if case["sliding"] == "steady" and speed.any():
        force[:, :2] = -mu * pressure[:, None] * speed / np.hypot(*speed)
        return force
    if case["law"] == "regularised":
        v = y[:, :2] - speed
        size = np.maximum(np.hypot(*v.T), 1e-300)
        force[:, :2] = (mu * pressure * np.tanh(size / case["v0"]) / size)[:, None] * v
        return force
    x = np.zeros(2)
    step = k * speed * 2.0 * np.pi / (case["omega"] * n_time)
    stride = np.linalg.norm(step) * n_time
    if stride > 0.0:
        # Whole turns before anything slips are leapt over.
        room = np.abs(y[:, :2]).max() + mu * pressure.max()
        x = step / np.linalg.norm(step) * (2.0 * room + stride)
    for _ in range(TURNS):
        before = x.copy()
        for j in range(n_time):
            x = x + step
            d, limit = y[j, :2] - x, mu * pressure[j]
            length = np.hypot(*d)
            if length > limit:
                d = d * (limit / length)
                x = y[j, :2] - d
            force[j, :2] = d
        if np.abs(x - before).max() <= 1e-13 * (np.abs(y[:, :2]).max() + stride):
            break
    return force


def trial(seed, program, folder):
    case = drawn(seed)
    (folder / "case.nml").write_text(text(case))
    done = subprocess.run([program, "-q", "case.nml"], cwd=folder, capture_output=True, text=True,
                          check=False)
    kind = "events" if case["events"] else case["law"]
    found = {**dict.fromkeys(COLUMNS, 0), "kind": f"{kind}, {case['sliding']}"}
    if done.returncode == 4:
        return {**found, "failed": 1}
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / "case.h5") as file:
        u, said = file["coefficients"][0], file["contact/force"][0]
        heat = file["contact/dissipation"][0]
        brought = file["contact/obstacle_work"][0] if "contact/obstacle_work" in file else 0.0
    found["solved"] = 1
    n_time = 32768 if case["events"] else case["n_time"]
    tau = 2.0 * np.pi * np.arange(n_time) / n_time
    waves = np.array([np.ones(n_time)] + [f(h * tau) for h in range(1, case["harmonics"] + 1)
                                          for f in (np.cos, np.sin)])
    rate = np.zeros_like(u)
    for h in range(1, case["harmonics"] + 1):
        rate[2 * h - 1], rate[2 * h] = h * u[2 * h], -h * u[2 * h - 1]
    gap, notes = gaps(case, tau), []
    eps = rigid_stiffness(case) if case["law"] == "dlft" else \
        np.column_stack([case["kt"], case["kt"], case["kn"]])
    scale = np.abs(said).max()
    for i in range(len(case["gap"])):
        motion = u[:, 3 + 3 * i:6 + 3 * i].T @ waves
        y = (eps[i][:, None] * (motion + np.array([0.0, 0.0, 1.0])[:, None] * gap[i])).T
        if case["law"] == "dlft":
            y += (said[:, i].T @ waves).T
        if case["law"] == "regularised":
            y[:, :2] = (case["omega"] * rate[:, 3 + 3 * i:5 + 3 * i].T @ waves).T
        if not case["two"]:
            y[:, 1] = 0.0
        force = marched(case, i, y, eps[i, 0])
        mean = force.T @ waves.T / n_time
        mean[:, 1:] *= 2.0
        if not case["two"]:
            mean[1] = said[:, i, 1]
        off = np.abs(mean.T - said[:, i]).max() / max(scale, 1e-300)
        if off > (BY_EVENTS if case["events"] else FORCE):
            found["force"] = 1
            notes.append(f"pair {i + 1}: force off by {off:.1e}")
    worst, largest = 0.0, 0.0
    given = np.zeros((2, len(case["mass"])))
    given[0, :3], given[1, :3] = case["cosine"], case["sine"]
    lost = 0.0
    for h in range(case["harmonics"] + 1):
        at = slice(0, 1) if h == 0 else slice(2 * h - 1, 2 * h + 1)
        turn = np.array([1.0]) if h == 0 else np.array([1.0, -1.0j])
        s = h * case["omega"]
        q, f = turn @ u[at], np.zeros(len(case["mass"]), complex)
        for i in range(len(case["gap"])):
            f[3 + 3 * i:6 + 3 * i] = turn @ said[at, i]
        terms = [case["stiffness"] @ q, -s**2 * case["mass"] @ q, 1j * s * case["damping"] @ q, f,
                 -(given[0] - 1j * given[1]) * (h == 1)]
        worst = max(worst, np.abs(sum(terms)).max())
        largest = max(largest, max(np.abs(term).max() for term in terms))
        lost += np.pi * h * s * sum(a @ case["damping"] @ a for a in u[at]) if h else 0.0
    if worst > BALANCE * largest:
        found["balance"] = 1
        notes.append(f"balance off by {worst / largest:.1e}")
    load = np.pi * (given[0] @ u[2] - given[1] @ u[1])
    sizes = abs(load) + abs(lost) + np.abs(heat).sum()
    if abs(load + np.sum(brought) - lost - heat.sum()) > WORK * sizes:
        found["work"] = 1
        notes.append(f"work off by {abs(load + np.sum(brought) - lost - heat.sum()) / sizes:.1e}")
    # What truncation leaves of impacts may be a little below zero.
    if case["sliding"] == "path" and heat.sum() < -1e-3 * sizes:
        found["heat"] = 1
        notes.append(f"heat {heat.sum():.2e} of {sizes:.2e}")
    return {**found, "notes": notes}
