"""Random joints whose friction changes with wear, against Archard's law with friction updated."""
import subprocess

import h5py
import numpy as np
import wear_joints
from archard_march import Joint
from cases import merged, write_namelist
from missions import fly, mission
from scipy.integrate import solve_ivp

TITLE = "Friction that changes with wear"
TEXT = """
One to three masses in the plane that press and rub, coupled, preloaded or with gaps, by every law
that wear serves or by several at once, with both laws of wear, coefficients of each pair, and
friction that falls or rises by the depth or by the friction energy; every third a mission of two or
three blocks of other loads, statics or frequencies, two flights. Implicit, explicit and
Rosenbrock's schemes with an error of 1e-5 a step.

Judges: (i) Archard's law over the cycles by a Runge-Kutta method under control of the error (1e-6),
with depths and energies as states of their own and friction updated at every stage; what a cycle
wears is that of the program for a friction that stays, at depths that are given as gaps: nothing
there knows of `mu_by`. 1e-4 of the largest. (ii) For every eighth joint, with elastic pairs and 15
harmonics, the same with contact and friction integrated in time until the motion repeats, and two
steps of the classical method where these suffice: 2 %. Depths, coefficients and friction energies
at the end are compared; few harmonics have another work of the forces than of the slip, and of that
difference a tenth is allowed. Some joints have several vibrations: those on whose way the vibration
jumps, and of those that are off the ones whose rates the judge finds at the end of the run, but not
everywhere on its way, and the ones for which sweeps from both sides at a friction that stays differ
among themselves. They are counted beside.
"""
COUNT = 100
SMALL = (1, 2, 3, 5)
COLUMNS = {"worn": "worn", "several": "several vibrations", "ended": "ended in words",
           "judged": "judged step by step", "off": "off", "timed": "judged in time",
           "off_time": "off", "hidden": "no judge", "unsaid": "ended, unsaid"}
ZERO = ("off", "off_time", "unsaid")
TOLERANCE, SAME, SAME_IN_TIME, TIMED = 1e-5, 1e-4, 2e-2, 8
#: Error of the judge's steps, and rates that it asks for at most.
CONTROL, MOST = 1e-6, 600
SCHEMES = ({}, {"wear": {"scheme": "explicit"}},
           {"wear": {"scheme": "pseudo_time"}, "pseudo_time": {"scheme": "rosenbrock"}})


def draw(seed):
    """(groups, blocks [(cycles, {key: value})], flights)."""
    size = np.random.default_rng(9400 + seed)
    groups = wear_joints.own(size, gaps=True)
    n_pairs = groups["contact"]["n_pairs"]
    timed = seed % TIMED == 0
    laws = [*wear_joints.LAWS, "rigid"]
    if timed:
        law = "penalty"
    elif n_pairs > 1 and size.random() < 0.25:
        law = [str(word) for word in size.choice(laws[:3], n_pairs)]
    else:
        law = str(size.choice(laws))
    if "penalty" in law:
        wear_joints.elastic(size, groups)
    area = groups["contact"]["area"]
    k_w = groups["wear"]["coefficient"] * np.exp(size.uniform(-0.7, 0.7, n_pairs))
    cycles = size.uniform(0.05, 0.3) * np.min(area / k_w)
    by = str(size.choice(["depth", "energy"]))
    # Depths and energies that such cycles bring with forces and paths of 1.
    usual = (k_w / area if by == "depth" else 0.4) * cycles
    groups = merged(groups, {
        "contact": {"law": law},
        "harmonics": {"n_harmonics": 15 if timed else int(size.integers(1, 6))},
        "solver": {"tolerance": 1e-10},
        "wear": {"coefficient": k_w, "error_tolerance": TOLERANCE, "mu_by": by,
                 "mu_final": size.uniform(0.0, 0.9, n_pairs),
                 "mu_scale": usual * np.exp(size.uniform(-2.0, 1.0, n_pairs)),
                 "steady_tolerance": 1e-12, "max_steps": 20000}})
    groups = merged(groups, SCHEMES[0 if timed else int(size.choice([0, 0, 1, 2]))])
    start, blocks = groups["sweep"]["start"], [(float(cycles), {})]
    if seed % 3 == 0:
        blocks = []
        for _ in range(int(size.integers(2, 4))):
            change = {"load%harmonic_scale": float(size.uniform(0.4, 1.3))}
            if size.random() < 0.5:
                change["load%static_scale"] = float(size.uniform(0.8, 1.2))
            if size.random() < 0.5:
                change["sweep%start"] = float(start * size.uniform(0.9, 1.1))
            blocks.append((float(cycles * size.uniform(0.1, 0.4)), change))
    return groups, blocks, 2 if seed % 3 == 0 else 1


def in_block(groups, change):
    """A block as a case: loads and frequency of its own."""
    load = {key: np.array(groups["load"][key]) * change.get(
        "load%static_scale" if key == "static" else "load%harmonic_scale", 1.0)
        for key in ("static", "cosine", "sine")}
    return merged(groups, {"load": load, "sweep": {
        "start": change.get("sweep%start", groups["sweep"]["start"])}})


class Failed(Exception):
    """No vibration for the judge."""


class Rates:
    """Depth of a cycle at given depths and friction, by a run whose friction stays."""

    def __init__(self, groups, program, folder):
        self.program, self.folder, self.asked = program, folder, 0
        self.groups = merged(groups, {
            "wear": {"mu_by": None, "mu_final": None, "mu_scale": None, "n_cycles": 1e-9,
                     "scheme": "implicit"}, "pseudo_time": {}})
        self.gap = np.broadcast_to(groups["contact"].get("gap", 0.0), groups["contact"]["n_pairs"])

    def at(self, depth, mu):
        return merged(self.groups, {"contact": {"mu": mu, "gap": self.gap + depth}})

    def __call__(self, depth, mu):
        self.asked += 1
        found, _ = fly(self.program, self.folder, self.at(depth, mu), "rate")
        if found is None or len(found["rate"]) == 0 or self.asked > MOST:
            raise Failed
        return found["rate"][0], found["work"][0]

    def ways(self, depth, mu):
        """Vibrations that sweeps from both sides come to."""
        case = merged(self.at(depth, mu), {"case": {"analysis": "frf"}})
        del case["wear"], case["pseudo_time"], case["contact"]["area"]
        found, end = [], case["sweep"]["start"]
        for part in (0.7, 0.9, 1.1, 1.4):
            write_namelist(self.folder / "way.nml", merged(case, {"sweep": {
                "start": part * end, "end": end, "n_points": 25}}))
            subprocess.run([str(self.program), "-q", "way.nml"], cwd=self.folder, check=False,
                           stderr=subprocess.DEVNULL)
            with h5py.File(self.folder / "way.h5") as file:
                if file["converged"][-1]:
                    found.append(file["coefficients"][-1])
        return found


class TimedRates:
    """The same by integration in time."""

    def __init__(self, groups, motion):
        self.joint = Joint(merged(groups, {"wear": {"coefficient": 1.0}}))
        self.joint.k_w = groups["wear"]["coefficient"]
        self.joint.start(motion)

    def __call__(self, depth, mu):
        self.joint.mu = mu
        rate = self.joint.rate(depth)
        slid = rate * self.joint.area / self.joint.k_w
        return rate, slid if self.joint.by_energy else mu * slid


def friction(groups, state):
    """At depths and energies."""
    wear, first = groups["wear"], groups["contact"]["mu"]
    worn = state[0] if wear["mu_by"] == "depth" else state[1]
    return wear["mu_final"] + (first - wear["mu_final"]) * np.exp(-worn / wear["mu_scale"])


def wear_on(groups, rates, cycles, state, steps):
    """Depths, friction energies by the slip and by the forces (3, n_pairs) after so many cycles, by
    as many steps, or as many as the error asks for (None)."""
    wear, area = groups["wear"], groups["contact"]["area"]

    def slope(now):
        mu = friction(groups, now)
        rate, work = rates(now[0], mu)
        # A cycle slides S under pressure: dw = k S/A, or k mu S/A, and dE = mu S.
        energy = area * rate / wear["coefficient"]
        return np.array([rate, energy if wear["law"] == "energy" else mu * energy, work])

    if steps is None:
        # Counted in depths and energies of forces and paths of 1.
        usual = cycles * np.array([wear["coefficient"] / area, np.ones(len(area)),
                                   np.ones(len(area))])
        return solve_ivp(lambda _, y: (slope(y.reshape(3, -1) * usual) * cycles / usual).ravel(),
                         (0.0, 1.0), (state / usual).ravel(), rtol=CONTROL,
                         atol=1e-2 * CONTROL).y[:, -1].reshape(3, -1) * usual
    h = cycles / steps
    for _ in range(steps):
        a = slope(state)
        b = slope(state + 0.5 * h * a)
        c = slope(state + 0.5 * h * b)
        d = slope(state + h * c)
        state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return state


def judged(groups, blocks, n_flights, all_rates, steps):
    """Depths, energies by the forces, coefficients, and energies by the slip (4, n_pairs)."""
    state = np.zeros((3, groups["contact"]["n_pairs"]))
    for _ in range(n_flights):
        for rates, (cycles, _) in zip(all_rates, blocks):
            state = wear_on(groups, rates, cycles, state, steps)
    return np.array([state[0], state[2], friction(groups, state), state[1]])


def is_confirmed(found, rates, row):
    """Whether a vibration of the run is the one of the judge."""
    rates.asked = 0
    try:
        rate, _ = rates(found["depth"][row], found["mu"][row])
    except Failed:
        return False
    return np.abs(rate - found["rate"][row]).max() <= 1e-5 * rate.max()


def has_others(found, rates):
    """Whether there are several vibrations on the way: the last one is one that the judge knows,
    and one before is not; or ways to them differ."""
    last = len(found["depth"]) - 1
    block = found.get("block", np.ones(last + 1, int))
    rows = np.unique(np.linspace(0, last, 24).astype(int))
    known = [is_confirmed(found, rates[max(1, block[row]) - 1], row) for row in rows]
    if known[-1] and not all(known):
        return True
    for row in rows[::3]:
        ways = rates[max(1, block[row]) - 1].ways(found["depth"][row], found["mu"][row])
        if any(np.abs(way - ways[0]).max() > 1e-5 * np.abs(way).max() for way in ways):
            return True
    return False


def trial(seed, program, folder):
    groups, blocks, n_flights = draw(seed)
    counts = dict.fromkeys(COLUMNS, 0)
    counts.update(kind=f"{groups['wear']['mu_by']}, {groups['wear']['law']}", notes=[])
    if n_flights > 1:
        found, words = fly(program, folder, mission(groups, blocks, n_flights, 1), "whole")
    else:
        found, words = fly(program, folder, merged(groups, {
            "wear": {"n_cycles": blocks[0][0]}}), "whole")
    if found is None:
        counts["ended" if "error" in words or "converge" in words else "unsaid"] = 1
        return {**counts, "notes": [f"no result: {words[-200:]}"]}
    ending = str(found["attributes"]["ending"])
    if ending not in ("n_flights reached", "n_cycles reached") and not ending.startswith(
            ("no pair slips", "steady state", "the whole joint")):
        counts["ended"] = 1
        return {**counts, "notes": [ending]}
    if ending.startswith("the whole joint"):
        # Gross slip ends a run before its cycles: friction is at its end by then.
        counts["ended"] = 1
        return counts
    counts["worn"] = 1
    if found["attributes"]["n_jumps"] > 0:
        counts["several"] = 1
        return counts
    last = np.array([found["depth"][-1], found["energy"][-1], found["mu"][-1]])

    # Of pairs that stick, round-off: what forces and paths of 1e-9 would leave.
    cycles = n_flights * sum(count for count, _ in blocks)
    each = np.max(groups["wear"]["coefficient"] / groups["contact"]["area"])
    nothing = 1e-9 * np.array([[cycles * each], [cycles], [1.0]])

    def distance_of(other, that):
        """Largest difference over the largest depth, energy and coefficient."""
        size = np.maximum(np.abs(other[:3]).max(axis=1, keepdims=True), nothing)
        off = np.abs(other[:3] - that[:3])
        off[1] = np.maximum(0.0, off[1] - 0.1 * np.abs(other[1] - other[3]))
        return (off / size).max()

    def distance(other):
        return distance_of(other, last)

    cases = [in_block(groups, change) for _, change in blocks]
    rates = [Rates(case, program, folder) for case in cases]
    try:
        alone = judged(groups, blocks, n_flights, rates, None)
        off = distance(alone)
        two = distance_of(judged(groups, blocks, n_flights, rates, 2), alone)
    except Failed:
        counts["several" if has_others(found, rates) else "hidden"] = 1
        return counts
    if off > SAME and has_others(found, rates):
        counts["several"] = 1
        return counts
    counts["judged"] = 1
    counts["off"] = int(off > SAME)
    if counts["off"]:
        counts["notes"].append(f"off by {off:.2e}")
    if seed % TIMED == 0 and two < 0.1 * SAME_IN_TIME:
        motions = [found["motion"][0]] * len(blocks)
        if n_flights > 1:
            motions = [found["motion"][np.flatnonzero(found["block"] == k + 1)[0]]
                       for k in range(len(blocks))]
        other = judged(groups, blocks, n_flights, [
            TimedRates(case, motion) for case, motion in zip(cases, motions)], 2)
        counts["timed"] = 1
        counts["off_time"] = int(distance(other) > SAME_IN_TIME)
        if counts["off_time"]:
            counts["notes"].append(f"off by {distance(other):.2e} in time")
    return counts
