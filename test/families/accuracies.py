"""Claims of an accuracy, against a march in time with its own contact."""
import subprocess
import time

import h5py
import march
import numpy as np
from cases import write_namelist

TITLE = "Claims of an accuracy"
TEXT = """
Two to four coupled masses (chains, some held to the ground, or full matrices) with damping of 0.2
to 3 %, near a mode, near a third, a fifth or a seventh of one, or at low frequency. One or two
pairs: friction on nodes without mass behind springs, with one or two tangential directions, under a
constant load or one that varies up to lift-off; elastic friction, with lift-off too; gaps; friction
on the masses (some with two directions or given instants); smooth friction; springs of power 3 or
5. Friction is 2 to 120 % of what would hold the pair, and accuracies are 1e-2, 1e-3 and 1e-4.

The judge (`test/families/march.c`, which shares no code with the program) marches the masses in
time, with contact of its own: exact matrices between instants, forces linear in time, steps halved
down to 1/2048 where a pair changes its state, and the periodic motion by Newton's method on the map
of a period, from the answer of the program. The number of steps is doubled until they leave less
than a twentieth of the accuracy. A claim is *broken* where the error of the root mean square over
the period, of the worst dof, is above the accuracy by more than the judge's own. Where the judge
comes to another motion, or a pair rests at another place that bears it as well, nothing is judged.
*Not resolved* are claims where no periodic motion was found, or the error of the march is above 0.3
of the accuracy. Iterations and milliseconds are sums.
"""
COUNT = 2000
SMALL = (1, 2, 8, 303, 408, 463, 554, 610, 680)
KINDS = ("massless nodes", "massless nodes, two directions", "massless nodes that lift off",
         "massless nodes that lift off, two directions", "elastic", "elastic, two directions",
         "elastic, lift-off", "gaps", "rubbing masses", "regularised", "cubic springs")
COLUMNS = {"claimed": "claimed", "resolved": "judged", "broken": "broken",
           "unresolved": "not resolved", "other": "other solutions",
           "rests": "other places of rest",
           "failed": "not converged", "iterations": "iterations", "milliseconds": "ms"}
ZERO = ("broken",)

#: The judge's own error as a part of the accuracy: wanted, and up to which it judges.
WANTED, RESOLVES = 0.05, 0.3
#: A distance above this part of the vibration is another solution.
OTHER = 0.3


def structure(random, n):
    """Masses, damping, stiffness of n coupled masses."""
    mass = np.diag(random.uniform(0.3, 2.0, n))
    stiffness = np.zeros((n, n))
    if random.random() < 0.3:
        turn, _ = np.linalg.qr(random.normal(size=(n, n)))
        stiffness = turn @ np.diag(np.exp(random.uniform(np.log(0.5), np.log(8.0), n))) @ turn.T
        mass = mass + 0.2 * np.minimum.outer(np.diag(mass), np.diag(mass)) \
            * random.uniform(-1.0, 1.0) * (1.0 - np.eye(n)) / n
    else:
        for i, spring in enumerate(random.uniform(0.3, 3.0, n)):
            stiffness[i, i] += spring
            if i:
                stiffness[i - 1, i - 1] += spring
                stiffness[i, i - 1] -= spring
                stiffness[i - 1, i] -= spring
        if random.random() < 0.5:
            stiffness += np.diag(random.uniform(0.2, 2.0, n))
    values, vectors = np.linalg.eigh(np.linalg.solve(np.linalg.cholesky(mass), np.linalg.solve(
        np.linalg.cholesky(mass), stiffness).T))
    ratio = float(np.exp(random.uniform(np.log(0.002), np.log(0.03))))
    back = np.linalg.cholesky(mass) @ vectors
    damping = back @ np.diag(2.0 * ratio * np.sqrt(values)) @ back.T
    return mass, damping, stiffness


def with_nodes(random, mass, damping, stiffness, carriers):
    """A node without mass behind a spring on each carrier; two may be coupled, or held twice."""
    n, extra = len(mass), len(carriers)
    wider = [np.zeros((n + extra, n + extra)) for _ in range(3)]
    for target, source in zip(wider, (mass, damping, stiffness)):
        target[:n, :n] = source
    mass, damping, stiffness = wider

    def tie(i, j, spring):
        stiffness[i, i] += spring
        stiffness[j, j] += spring
        stiffness[i, j] -= spring
        stiffness[j, i] -= spring

    for k, i in enumerate(carriers):
        tie(i, n + k, float(np.exp(random.uniform(np.log(0.4), np.log(30.0)))))
    if extra > 1 and random.random() < 0.4:
        tie(n, n + 1, random.uniform(0.1, 1.0))
    if n > extra and random.random() < 0.2:
        tie(n, int(random.integers(n)), random.uniform(0.3, 3.0))
    return mass, damping, stiffness


def frequency(random, mass, stiffness):
    """Near a mode or a part 1/3, 1/5, ... of it, or anywhere from low frequencies on."""
    live = np.any(mass, axis=1)
    inner = stiffness[np.ix_(live, live)]
    if not live.all():
        inner = inner - stiffness[np.ix_(live, ~live)] @ np.linalg.solve(
            stiffness[np.ix_(~live, ~live)], stiffness[np.ix_(~live, live)])
    modes = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass[np.ix_(live, live)], inner)).real)
    if random.random() < 0.5:
        part = random.choice([1, 1, 1, 2, 3, 5, 7])
        return float(random.choice(modes) / part * (1.0 + 0.04 * random.normal()))
    return float(modes.min() * np.exp(random.uniform(np.log(0.07), np.log(2.0))))


def held_force(groups, dof):
    """Amplitude of what holds a dof still."""
    model = groups["model"]
    omega = groups["sweep"]["start"]
    z = model["stiffness"] - omega**2 * model["mass"] + 1j * omega * model["damping"]
    load = groups["load"]["cosine"] - 1j * groups["load"]["sine"]
    free = [i for i in range(len(z)) if i != dof]
    answer = np.linalg.solve(z[np.ix_(free, free)], load[free])
    return float(abs(z[dof, free] @ answer - load[dof])) + 1e-6


def drawn(seed):
    """Kind, groups, accuracy."""
    random = np.random.default_rng([31, seed])
    kind = KINDS[seed % len(KINDS)]
    n = int(random.integers(2 + (kind.endswith("off, two directions")), 5))
    mass, damping, stiffness = structure(random, n)
    planar = "two directions" in kind
    lifts = "lift" in kind or kind == "gaps"
    massless = kind.startswith("massless")
    pairs = int(random.integers(1, 3)) if n > 2 or not (planar or lifts) else 1
    if kind == "rubbing masses":
        planar = random.random() < 0.25
    each = (1 + planar if kind != "gaps" else 0) + lifts
    pairs = max(1, min(pairs, n // each))
    carriers = random.permutation(n)[:pairs * each]
    if massless:
        mass, damping, stiffness = with_nodes(random, mass, damping, stiffness, carriers)
        dofs = n + np.arange(len(carriers)) + 1
    else:
        dofs = carriers + 1
    total = len(mass)
    static, cosine, sine = np.zeros((3, total))
    for values, share in ((cosine, 0.6), (sine, 0.3)):
        for i in range(n):
            if random.random() < share:
                values[i] = random.normal()
    cosine[int(random.integers(n))] += 1.0
    if random.random() < 0.3 and not lifts:
        static[:n] = random.normal(size=n) * 0.4
    groups = {"case": {"analysis": "point", "threads": 1},
              "model": {"n_dof": total, "mass": mass, "stiffness": stiffness, "damping": damping},
              "load": {"static": static, "cosine": cosine, "sine": sine},
              "sweep": {"start": frequency(random, mass, stiffness)}}
    if kind == "cubic springs":
        dof = int(random.integers(1, n + 1))
        groups["spring"] = {"n_springs": 1, "side_1": [dof], "power": [int(random.choice([3, 5]))],
                            "coefficient": [float(random.uniform(0.05, 0.8))]}
        groups["model"]["damping"] = 4.0 * damping
        if random.random() < 0.5:
            carriers, dofs, pairs = carriers[:0], dofs[:0], 0
    side, limits, loads = [], [], []
    for p in range(pairs):
        own = list(map(int, dofs[p * each:(p + 1) * each]))
        if planar:
            one = [own[0], own[1], own[2] if lifts else 0]
        elif kind == "gaps":
            one = [0, 0, own[0]]
        else:
            one = [own[0], 0, own[1] if lifts else 0]
        side += one
        force = max(held_force(groups, d - 1) for d in one[:2] + one[2:] if d)
        limits.append(force * float(np.exp(random.uniform(np.log(0.02), np.log(1.2)))))
        if lifts:
            loads.append(one[2])
    if pairs:
        mu = random.uniform(0.2, 0.8, pairs)
        contact = {"n_pairs": pairs, "side_1": side, "mu": mu}
        if lifts:
            contact["gap"] = random.uniform(-0.1, 0.1, pairs) if random.random() < 0.4 \
                else np.zeros(pairs)
            for dof, limit, m in zip(loads, limits, mu):
                carrier = carriers[list(dofs).index(dof)]
                static[carrier] -= limit / m * random.uniform(0.3, 1.5)
            if kind == "gaps":
                contact["mu"] = np.zeros(pairs)
        else:
            contact["normal_load"] = np.array(limits) / mu
        law = {"massless nodes": ("dlft", "rigid", None), "rubbing masses":
               ("dlft", "dlft_velocity", "rigid"), "regularised": ("regularised",)}
        words = law.get(kind, ("dlft", None) if planar and massless else
                        ("dlft", "rigid", None) if massless else ("penalty",))
        word = words[int(random.integers(len(words)))]
        if kind == "rubbing masses" and planar and word == "rigid":
            word = "dlft"
        if word:
            contact["law"] = word
        if word == "penalty":
            if kind != "gaps":
                contact["tangential_stiffness"] = np.exp(random.uniform(np.log(0.3), np.log(20.0),
                                                                        pairs))
            if lifts:
                contact["normal_stiffness"] = np.exp(random.uniform(np.log(0.3), np.log(5.0),
                                                                    pairs))
        if word == "regularised":
            held = np.linalg.solve(stiffness - groups["sweep"]["start"]**2 * mass
                                   + 1j * groups["sweep"]["start"] * damping, cosine - 1j * sine)
            speed = groups["sweep"]["start"] * np.abs(held).max()
            contact["slip_speed"] = speed * np.exp(random.uniform(np.log(0.01), np.log(0.3), pairs))
        if planar and not lifts and random.random() < 0.2:
            contact["mu"] = contact["mu"] * 0.3
        groups["contact"] = contact
    accuracy = float(random.choice([1e-2, 1e-3, 1e-4]))
    groups["harmonics"] = {"accuracy": accuracy}
    if kind in ("elastic", "rubbing masses") and random.random() < 0.2:
        groups["harmonics"]["sampling"] = "uniform"
        if groups["contact"].get("law") == "rigid":
            groups["contact"]["law"] = "dlft"
    return kind, groups, accuracy


def trial(seed, program, folder):
    """What one case claims, and whether that is kept."""
    kind, groups, accuracy = drawn(seed)
    write_namelist(folder / "case.nml", groups)
    began = time.process_time()
    try:
        done = subprocess.run([program, "-q", "-o", "case.h5", "case.nml"], cwd=folder, check=False,
                              capture_output=True, text=True, timeout=600)
    except subprocess.TimeoutExpired:
        return {"kind": kind, "failed": 1, "notes": ["600 s"]}
    if done.returncode not in (0, 4):
        return {"kind": kind, "failed": 1, "notes": [done.stderr[-300:]]}
    with h5py.File(folder / "case.h5") as file:
        answer, converged = file["coefficients"][-1], bool(file["converged"][-1])
        estimate, harmonics = float(file["error_estimate"][-1]), int(file["harmonics"][-1])
        seconds = float(file["seconds"][-1]) if "seconds" in file else time.process_time() - began
        counts = {"kind": kind, "iterations": int(file["iterations"][-1]),
                  "milliseconds": round(1e3 * seconds)}
    if not converged:
        return {**counts, "failed": 1}
    counts.update(claimed=int(estimate <= accuracy), estimate=estimate, accuracy=accuracy,
                  harmonics=harmonics)
    if not counts["claimed"]:
        return counts
    judge = march.March(groups)
    found = judge.periodic(answer, WANTED * accuracy)
    if found is None or found[1] > RESOLVES * accuracy:
        return {**counts, "unresolved": 1}
    true = march.error(march.synthesis(answer), found[0])
    counts["true"] = true
    if true > OTHER or (judge.rests and true > accuracy):
        # Where a pair rests all positions balance that it can hold.
        return {**counts, "rests" if judge.rests else "other": 1}
    counts.update(resolved=1, broken=int(true > accuracy + found[1]))
    if counts["broken"]:
        counts["notes"] = [f"{kind}: {true:.2e} with {harmonics} harmonics, claimed {estimate:.1e}"
                           f" of {accuracy:.0e}"]
    return counts
