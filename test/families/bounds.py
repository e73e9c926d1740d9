"""Ranges over residual tractions, against random shares and all corners that a balance of its own
solves."""
import itertools
import subprocess

import h5py
import numpy as np
from bodies import RADIUS, SPEED, blades, complex_rows, drawn, model_of, points_of
from residual_balance import Balance
from scipy.optimize import nnls

from fretwear._namelist import write_namelist as namelist_text

TITLE = "Ranges over residual tractions"
TEXT = """
Wedges between two blades, as of [the bodies](bodies.md), with one to three points on each flank,
and with rotation where the normals hold it; loads reach from pairs that all stick to pairs that
lift off. `analysis = 'bounds'` at one frequency, of the first harmonic of the first blade; 3
harmonics, 64 instants.

The judge has a balance of its own (`test/support/residual_balance.py`), with the places of contact
and the angles of the case. From the central solution of the result it walks to 200 random shares
and to all corners. No amplitude may lie outside of the range by more than 1e-6 of it; what does is
walked to once more, in steps that change the vibration by 3 % at most: no jump to another branch
counts, and a share behind a fold has no answer. The central solution has to balance, and both ends
to have the amplitudes that the result says, by such a walk or from a solution nearby.
"""
COUNT = 100
SMALL = (0, 3, 4, 7, 36)
COLUMNS = {"solved": "solved", "refused": "refused", "failed": "ended in words",
           "wide": "wider than 1 %", "inside": "ends that are no corners",
           "lost": "shares that the judge did not reach", "centre": "centre off",
           "ends": "ends off", "outside": "shares outside"}
ZERO = ("centre", "ends", "outside")

HARMONICS, INSTANTS, SHARES, WITHIN = 3, 64, 200, 1e-6


def case_of(seed):
    # Every third is a wedge.
    case = drawn(3 * seed)
    places = [p[:3] for p in case["places"]]
    n = sum(map(len, places))
    case |= {"wave": False, "compliance": None, "places": places} | {
        key: case[key][:n] for key in ("mu", "kt", "kn")}
    # In the middle friction carries little: without it the normals have to hold the body.
    normals = np.array([[*normal, 1e3 * (at[0] * normal[1] - at[1] * normal[0])]
                        for at, _, normal, _, _ in points_of(case)]).T
    load = -np.array([0.0, case["pressing"], 0.0])
    if np.linalg.matrix_rank(normals) < 3 or nnls(normals, load)[1] > 1e-9 * case["pressing"]:
        case["inertia"] = None
    return case | {"kind": f"{n} points"}


def balance_of(case):
    n = 6 + (case["inertia"] is not None)
    M, K = np.zeros((2, n, n))
    M[:4, :4], K[:4, :4] = blades(case)
    C = case["damping"] * K
    M[4:6, 4:6] = np.eye(2) * case["pressing"] / RADIUS / SPEED**2
    if n == 7:
        M[6, 6] = case["inertia"]
    load = np.zeros((2 * HARMONICS + 1, n))
    load[0, 5] = case["pressing"]
    load[1, :4], load[2, :4] = case["cosine"], case["sine"]
    rows = []
    for at, tangent, normal, first, _ in points_of(case):
        both = np.zeros((2, n))
        for row, along in zip(both, (tangent, normal)):
            row[4:6] = along
            row[first:first + 2] -= along
            if n == 7:
                row[6] = at[0] * along[1] - at[1] * along[0]
        rows.append(both)
    rows = np.array(rows)
    return Balance(M, C, K, rows[:, 0], rows[:, 1], case["mu"], case["kt"], case["kn"], load,
                   INSTANTS)


def trial(seed, program, folder):
    case = case_of(seed)
    model_of(case | {"kind": "wedge"}).to_hdf5(folder / "model.h5")
    (folder / "case.nml").write_text(namelist_text({
        "case": {"analysis": "bounds"},
        "model": {"source": "hdf5", "file": "model.h5", "rotation_speed": SPEED},
        "harmonics": {"n_harmonics": HARMONICS, "n_time": INSTANTS, "sampling": "uniform"},
        "sweep": {"values": [case["omega"]]}, "solver": {"tolerance": 1e-11},
        "bounds": {"n_starts": 4}}))
    done = subprocess.run([program, "-q", "case.nml"], cwd=folder, capture_output=True, text=True,
                          check=False)
    found = dict.fromkeys(COLUMNS, 0) | {"kind": case["kind"], "notes": []}
    if done.returncode == 3 and "cannot hold it" in done.stderr:
        return {**found, "refused": 1}
    if done.returncode == 4:
        return {**found, "failed": 1, "notes": [f"not converged: {done.stderr.strip()[-200:]}"]}
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / "case.h5") as file:
        u = np.asarray(file["coefficients"][0])
        low, high, centre = (float(file[f"bounds/{key}"][0]) for key in ("lowest", "highest",
                                                                         "centre"))
        ends = [np.asarray(file[f"bounds/residual_{key}"][0]) for key in ("lowest", "highest")]
    found["solved"] = 1
    found["wide"] = int(high > 1.01 * low)
    found["inside"] = sum(bool(((np.abs(end) < 1.0) & (end != 0.0)).any()) for end in ends)
    judged(case, u, (low, high, centre), ends, seed, found)
    return found


def judged(case, u, values, ends, seed, found):
    low, high, centre = values
    judge, omega = balance_of(case), case["omega"]
    pairs = len(case["mu"])
    middle = np.zeros(pairs)
    own = judge.solve(omega, middle, u)
    if own is None or abs(amplitude(own) / centre - 1.0) > WITHIN:
        found["centre"] = 1
        return
    random = np.random.default_rng(1000 + seed)
    shares = [*random.uniform(-1.0, 1.0, (SHARES, pairs)),
              *map(np.array, itertools.product((-1.0, 1.0), repeat=pairs))]
    reached = [(middle, own)]
    for share in shares:
        there = judge.walk(omega, middle, own, share)
        if there is not None and off(amplitude(there), low, high) > WITHIN:
            there = judge.follow(omega, own, share)
        if there is None:
            found["lost"] += 1
            continue
        reached.append((share, there))
        if off(amplitude(there), low, high) > WITHIN:
            found["outside"] += 1
            found["notes"].append(f"{amplitude(there):.9e} outside of {low:.9e} {high:.9e}: "
                                  f"{np.round(share, 3).tolist()}")
    for end, value in zip(ends, (low, high)):
        found["ends"] += not is_answer(judge, omega, reached, end, value)


def is_answer(judge, omega, reached, end, value):
    """Whether the way from the middle, or a solution nearby, leads to a value at an end."""
    nearest = sorted(reached, key=lambda known: np.abs(known[0] - end).max())
    middle, own = reached[0]
    ways = (lambda: judge.follow(omega, own, end), lambda: judge.walk(omega, middle, own, end),
            *(lambda u=u: judge.solve(omega, end, u) for _, u in nearest[:40]))
    return any(there is not None and abs(amplitude(there) / value - 1.0) <= WITHIN
               for there in (way() for way in ways))


def amplitude(u):
    return float(np.abs(complex_rows(u)[1, 0]))


def off(value, low, high):
    """How far outside of the range, beside its end."""
    return max(1.0 - value / low, value / high - 1.0)
