"""Resonances over a parameter with rigid pairs in three dimensions, against residuals of their own
and sweeps around them."""
import re
import subprocess
import sys
from types import SimpleNamespace

import h5py
import numpy as np
from project import ROOT

sys.path.insert(0, str(ROOT / "test" / "stress"))
import stress_check

TITLE = "Resonances of rigid pairs in three dimensions"
TEXT = """
One to three nodes of three dofs each, coupled by springs that are skew too, with one to three pairs
in two tangential directions and a normal one (`law = 'dlft'`): on the masses, or on massless dofs
behind springs; pressed together, or so lightly that they lift off. `analysis = 'resonance'` follows
a resonance over the load, the friction coefficient or the static load, in four points. Impacts of
masses on rigid ground have few solutions in harmonics: many of those that lift off end in words.

The judge knows the matrices of the case. Equilibrium of every dof in every harmonic, and the forces
that a march of Coulomb's law through up to 8192 instants makes of the motion, are formed anew in
NumPy, and have to agree with the file to 3e-3 of the load. Nothing may be higher by 1e-3 beside a
resonance along the branch, followed by arc length, that passes it (other code of the program). A
row that misses is *wrong*; *apart* are resonances that the branch from below does not come to.
*Over budget* is a first point of more than 3000 iterations, its sweep included.
"""
COUNT = 120
SMALL = (1, 6, 10, 14)
COLUMNS = {"right": "right", "wrong": "wrong without a word", "words": "ended in words",
           "nothing": "none in its range", "apart": "on another response", "over": "over budget",
           "iterations": "iterations", "first": "of the first points", "rows": "rows"}
ZERO = ("wrong", "silent")

KINDS = ("masses", "springs", "lifting masses", "lifting springs")
PARAMETERS = ("load%harmonic_scale", "load%static_scale", "contact%mu")
N_TIME = 1024
#: Of the load; of the amplitude (two); of the frequency; of that; iterations.
RESIDUAL, HIGHER, FLAT, BESIDE, NEAR, BUDGET = 3e-3, 1e-3, 1e-5, 5e-3, 0.5, 3000


def chain(random, nodes):
    """Masses and springs of nodes with three dofs, in a row and askew."""
    n = 3 * nodes
    mass, stiffness = np.diag(random.uniform(0.5, 2.0, n)), np.diag(random.uniform(0.5, 2.0, n))
    rows = [np.eye(n)[i] - np.eye(n)[i + 3] for i in range(n - 3)]
    # Springs askew reach every dof, so that all of a pair is moved.
    rows += list(random.uniform(-1.0, 1.0, (int(random.integers(1, 4)), n)))
    for row in rows:
        stiffness += random.uniform(0.3, 1.5) * np.outer(row, row)
    return mass, stiffness


def drawn(seed):
    """Parts of a case."""
    random = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    nodes = int(random.integers(1, 4))
    pairs = int(random.integers(1, nodes + 1))
    mass, stiffness = chain(random, nodes)
    n = 3 * nodes
    ratio = float(np.exp(random.uniform(np.log(0.005), np.log(0.05))))
    root = np.sqrt(np.diag(mass))
    squares, shapes = np.linalg.eigh(stiffness / np.outer(root, root))
    modes, shapes = np.sqrt(squares), shapes * root[:, None]
    damping = shapes @ np.diag(2.0 * ratio * modes) @ shapes.T
    load = np.zeros((3, n))
    loaded = int(random.integers(n))
    load[1, loaded] = 1.0
    if random.random() < 0.5:
        load[2, random.integers(n)] = random.uniform(-1.0, 1.0)
    side = [[3 * k, 3 * k + 1, 3 * k + 2] for k in random.permutation(nodes)[:pairs]]
    if "springs" in kind:
        # Massless dofs behind a spring each.
        mass, damping, stiffness = (np.pad(a, (0, 3 * pairs)) for a in (mass, damping, stiffness))
        for q, dofs in enumerate(side):
            for c, i in enumerate(dofs):
                j, spring = n + 3 * q + c, random.uniform(1.0, 4.0)
                stiffness[[i, j], [i, j]] += spring
                stiffness[[i, j], [j, i]] -= spring
            side[q] = [n + 3 * q + c for c in range(3)]
        load = np.pad(load, ((0, 0), (0, 3 * pairs)))
    press = float(np.exp(random.uniform(np.log(0.5), np.log(3.0))))
    if "lifting" in kind:
        press *= 0.15
    for dofs in side:
        load[0, dofs[2]] -= press * random.uniform(0.5, 1.5)
    parameter = PARAMETERS[int(random.integers(3))]
    return {"kind": kind, "mass": mass, "damping": damping, "stiffness": stiffness, "load": load,
            "side": side, "mu": float(random.uniform(0.1, 0.7)), "gap": 0.0,
            "n_harmonics": int(random.choice([3, 5, 7, 7, 9])), "loaded": loaded,
            "parameter": parameter, "end": float(random.choice([0.5, 2.0])),
            "range": (float(0.6 * modes[0]), float(1.5 * modes[min(2, n - 1)])),
            "n_points": int(random.integers(9, 31))}


def observed(case):
    """Every dof, the loaded one first."""
    return [case["loaded"]] + [k for k in range(len(case["mass"])) if k != case["loaded"]]


def listed(values):
    return ", ".join(repr(float(x)) for x in np.ravel(values))


def text(case, sweep, mu=None, scales=(1.0, 1.0), resonance=True):
    """The namelist: a resonance over its parameter, or a sweep; scales: static, vibratory load."""
    n, static = len(case["mass"]), scales[0] * case["load"][0]
    cosine, sine = scales[1] * case["load"][1:]
    low, high, points = sweep
    own = (f"&resonance parameter = '{case['parameter']}' as = 'factor' start = 1.0 "
           f"end = {case['end']!r} n_points = 4 /\n" if resonance else "")
    return f"""&case analysis = '{"resonance" if resonance else "frf"}' /
&model n_dof = {n}
   mass = {listed(case["mass"])}
   stiffness = {listed(case["stiffness"])}
   damping = {listed(case["damping"])} /
&contact n_pairs = {len(case["side"])} law = 'dlft'
   side_1 = {", ".join(str(x + 1) for row in case["side"] for x in row)}
   mu = {case["mu"] if mu is None else mu!r} gap = {case["gap"]!r} /
&load static = {listed(static)}
   cosine = {listed(cosine)} sine = {listed(sine)} /
&harmonics n_harmonics = {case["n_harmonics"]} /
&sweep start = {low!r} end = {high!r} n_points = {points} /
{own}&output observe = {", ".join(str(k + 1) for k in observed(case))} /
"""


def run(program, folder, name, words):
    (folder / f"{name}.nml").write_text(words)
    return subprocess.run([program, f"{name}.nml"], cwd=folder, check=False, capture_output=True,
                          text=True, timeout=600)


def at_value(case, factor):
    """What a factor of the parameter makes of the loads and of the friction coefficient."""
    static, vibratory, mu = 1.0, 1.0, case["mu"]
    if case["parameter"] == "load%static_scale":
        static = factor
    elif case["parameter"] == "load%harmonic_scale":
        vibratory = factor
    else:
        mu = factor * mu
    return static, vibratory, mu


def complaints(case, row, factor, n_time):
    """What a row misses of equilibrium, of the contact law and of energy."""
    static, vibratory, mu = at_value(case, factor)
    n_pairs = len(case["side"])
    joint = SimpleNamespace(
        n_dof=len(case["mass"]), n_pairs=n_pairs, mass=case["mass"], damping=case["damping"],
        stiffness=case["stiffness"], modal_damping=0.0, static=static * case["load"][0],
        cosine=vibratory * case["load"][1], sine=vibratory * case["load"][2],
        side_1=np.array(case["side"]) + 1, mu=np.full(n_pairs, mu),
        gap=np.full(n_pairs, case["gap"]), normal_load=np.zeros(n_pairs))
    whole = SimpleNamespace(joint=joint, law="dlft", penalty_scale=1.0, n_time=n_time,
                            first_omega=row["omega"], groups={"harmonics": {}})
    motion = np.zeros_like(row["coefficients"])
    motion[:, observed(case)] = row["coefficients"]
    return stress_check.verify(whole, row["omega"], motion, row["force"], row["dissipation"],
                               lag=RESIDUAL / stress_check.LAG)


def rows_of(path):
    with h5py.File(path) as file:
        good = np.flatnonzero(file["converged"][:])
        values = file["resonance/value"][:] if "resonance" in file else np.zeros(len(good))
        factors = file["parameter"][:] if "parameter" in file else np.ones(len(good))
        return [{"omega": float(file["omega"][k]), "coefficients": file["coefficients"][k],
                 "force": file["contact/force"][k], "dissipation": file["contact/dissipation"][k],
                 "value": float(values[k]), "factor": float(factors[k])} for k in good]


def beside(case, row, program, folder, reach=BESIDE):
    """Highest first harmonic beside a resonance along the branch that passes it; None where the
    branch that begins below does not come there."""
    static, vibratory, mu = at_value(case, row["factor"])
    ends = [(1.0 + sign * reach) * row["omega"] for sign in (-1.0, 1.0)]
    words = text(case, (*ends, 21), mu, (static, vibratory), False)
    words = words.replace("n_points = 21", "n_points = 21 continuation = 'arclength'")
    words = words.replace("&harmonics", "&harmonics sampling = 'events'")
    run(program, folder, "beside", words)
    if not (folder / "beside.h5").exists():
        return None
    with h5py.File(folder / "beside.h5") as file:
        omega = file["omega"][:] / row["omega"] - 1.0
        first = np.linalg.norm(file["coefficients"][:, 1:3, 0], axis=1) / row["value"]
    if not len(omega):
        return None
    k = int(np.argmin(np.hypot(omega / reach, first - 1.0)))
    if abs(omega[k]) > 0.1 * reach or abs(first[k] - 1.0) > HIGHER:
        return None
    # Each way as long as it rises: a dip behind a corner is the end of the resonance's own peak.
    highest = 0.0
    for way in (-1, 1):
        i, before = k, first[k]
        while 0 <= i < len(omega) and abs(omega[i]) < NEAR * reach and first[i] >= before - FLAT:
            highest, before = max(highest, first[i]), max(before, first[i])
            i += way
    return float(highest * row["value"])


def trial(seed, program, folder):
    case = drawn(seed)
    counts, notes = {"kind": case["kind"]}, []
    done = run(program, folder, "case", text(case, (*case["range"], case["n_points"])))
    if done.returncode and not done.stderr.strip():
        counts["silent"] = 1
    found = rows_of(folder / "case.h5") if (folder / "case.h5").exists() else []
    with h5py.File(folder / "case.h5") as file:
        spent = file["iterations"][:]
    counts.update(rows=len(found), iterations=int(spent.sum()), first=int(spent[:1].sum()))
    counts["over"] = int(counts["first"] > BUDGET)
    if done.returncode:
        nothing = "largest at a bound" in done.stderr or "amplitude 0," in done.stderr
        counts["nothing" if nothing else "words"] = 1
        notes.append(re.sub(r"\s+", " ", done.stderr)[-200:])
    for row in found:
        # The march is of first order in its instants: what it misses by itself falls.
        missed = complaints(case, row, row["factor"], N_TIME)
        if missed:
            missed = complaints(case, row, row["factor"], 8 * N_TIME)
        around = beside(case, row, program, folder)
        if around is None:
            counts["apart"] = 1
        elif around > (1.0 + HIGHER) * row["value"]:
            # Where it rises at the resonance itself, and not behind a dip that is stepped over.
            closer = beside(case, row, program, folder, BESIDE / 50.0)
            if closer is None:
                counts["apart"] = 1
            elif closer > (1.0 + FLAT) * row["value"]:
                missed.append(f"{around:.6g} beside {row['value']:.6g}")
        if missed:
            counts["wrong"] = 1
            notes.append(f"{row['omega']:.6g}, factor {row['factor']:.4g}: {'; '.join(missed)}")
    counts["right"] = int(not done.returncode and not counts.get("wrong"))
    return {**counts, "notes": notes}
