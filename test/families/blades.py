"""Random disks whose sectors differ, against the annulus as one structure."""
from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "cyclic"), str(HERE.parent / "support"), str(HERE.parents[1])]

import numpy as np  # noqa: E402
from annulus import random_case  # noqa: E402
from cases import read, run  # noqa: E402
from cyclic_cases import run_at  # noqa: E402
from deviations import WAYS, annulus, draw, write  # noqa: E402
from scipy.linalg import eigh  # noqa: E402

TITLE = "Disks whose sectors differ"
TEXT = """
Sectors without symmetry, 2 to 9 of them, engine orders from -N to 2 N, 0 to 3 pairs in a sector
with elastic or regularised friction, 1 to 7 harmonics, and deviations of 0 to 10 %: of blade
frequencies and damping on random rows, of stiffness and mass of a blade, of matrices of single
sectors, as deviations or whole, and all of these together. Judge: the same program on the annulus
that is put together here, which knows no sectors, at three frequencies; natural frequencies are
judged by those of its matrices. Equal: 1e-9 of the largest coefficient.
"""
COUNT = 200
SMALL = range(10)
COLUMNS = {"points": "points", "equal": "equal", "wrong": "different", "one": "solved in one alone",
           "neither": "in neither", "modes": "natural frequencies", "wrong_modes": "different"}
ZERO = ("wrong", "wrong_modes")
ALSO = [HERE.parent / "cyclic" / name for name in ("annulus.py", "deviations.py")]
EQUAL = 1e-9


def trial(seed, program, folder):
    rng = np.random.default_rng([53, seed])
    way = WAYS[seed % len(WAYS)]
    n_sectors, law = int(rng.integers(2, 10)), str(rng.choice(["penalty", "regularised"]))
    n_pairs = int(rng.integers(0, 4))
    case = random_case(rng, law=law, n_sectors=n_sectors, n_pairs=max(1, n_pairs),
                       engine_order=int(rng.integers(-n_sectors, 2 * n_sectors + 1)))
    case["n_harmonics"] = int(rng.integers(1, 8))
    parts, scale, change = draw(rng, case, way, float(rng.uniform(0.0, 0.1)))
    whole = annulus(case, change)
    omegas = sorted(float(w) for w in rng.uniform(0.5, 2.5, 3))
    options = {"sampling": "uniform", "n_time": 256} if law == "regularised" else {}
    if n_pairs == 0:
        options = {"sampling": "uniform", "n_time": 32}
        case["contact"] = {"side_1": []}
        whole.case["contact"] = {}
    (folder / "sectors").mkdir()
    (folder / "annulus").mkdir()
    write(folder / "sectors" / "model.h5", case, parts)
    groups = {
        "case": {"analysis": "frf"}, "model": {"source": "hdf5", "file": "model.h5"},
        "cyclic": {"engine_order": case["engine_order"], "mistuned": True},
        "mistuning": {"scale": scale}, "sweep": {"values": omegas}, "solver": {"tolerance": 1e-12},
        "harmonics": {"n_harmonics": case["n_harmonics"], "sampling": "events", "n_time": 0,
                      **options}}
    if n_pairs:
        groups["contact"] = {"law": law}
    run(folder / "sectors", groups, status=(0, 4), program=program)
    found = read(folder / "sectors" / "case.h5")
    judge = run_at(folder / "annulus", whole.case, omegas, status=(0, 4), **options)
    moved = np.concatenate([whole.sector(judge["coefficients"], j) for j in range(n_sectors)],
                           axis=-1)
    counts = {"kind": way, "points": len(omegas), "notes": []}
    counts |= {key: 0 for key in COLUMNS if key != "points"}
    for k in range(len(omegas)):
        solved = [bool(result["converged"][k]) for result in (found, judge)]
        if not all(solved):
            counts["one" if any(solved) else "neither"] += 1
            continue
        a, b = found["coefficients"][k], moved[k]
        error = np.abs(a - b).max() / np.abs(b).max()
        counts["equal" if error <= EQUAL else "wrong"] += 1
        if error > EQUAL:
            counts["notes"].append(f"{error:.1e} at {omegas[k]}, {law}")
    (folder / "modes").mkdir()
    write(folder / "modes" / "model.h5", case, parts)
    run(folder / "modes", {key: groups[key] for key in ("model", "mistuning", "contact")
                           if key in groups} | {
        "case": {"analysis": "modes"}, "cyclic": {"mistuned": True, "n_modes": 2}}, program=program)
    open_modes = read(folder / "modes" / "case.h5")["modes/open"][0]
    model = whole.case["model"]
    # Some rows may be without mass: 1/w^2 is what is found.
    theta = eigh(np.array(model["mass"]), np.array(model["stiffness"]), eigvals_only=True)[::-1]
    wanted = 1.0 / np.sqrt(theta[:len(open_modes)])
    counts["modes"] = len(open_modes)
    counts["wrong_modes"] = int(np.sum(np.abs(open_modes / wanted - 1.0) > EQUAL))
    return counts
