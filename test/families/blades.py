"""Random disks whose sectors differ, against the annulus as one structure."""
from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "cyclic"), str(HERE.parent / "support"), str(HERE.parents[1])]

import numpy as np  # noqa: E402
from annulus import random_case  # noqa: E402
from cases import merged, read, run  # noqa: E402
from cyclic_cases import model_groups, run_at  # noqa: E402
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

Where there are elastic pairs one disk in three is followed along a nonlinear mode, one along a
resonance over its load, and one through wear, and the annulus likewise: frequencies, damping,
amplitudes and depths are equal to 1e-6. Rows that only one of both has solved are counted.
"""
COUNT = 200
SMALL = range(10)
COLUMNS = {"points": "points", "equal": "equal", "wrong": "different", "one": "solved in one alone",
           "neither": "in neither", "modes": "natural frequencies", "wrong_modes": "different",
           "refused": "not held, refused",
           "rows": "rows of curves and wear", "wrong_rows": "different",
           "one_row": "solved in one alone"}
ZERO = ("wrong", "wrong_modes", "wrong_rows")
ALSO = [HERE.parent / "cyclic" / name for name in ("annulus.py", "deviations.py")]
EQUAL, SAME_ROW = 1e-9, 1e-6
#: Analyses of curves and of wear, with what is compared of each row.
FURTHER = {
    "mode": ({"mode": {"start": 0.02, "end": 0.5, "n_points": 3, "control": "modal",
                       "continuation": "natural"}},
             ("omega", "mode/damping_ratio", "mode/modal_amplitude")),
    "resonance": ({"sweep": {"start": 0.6, "end": 2.2, "n_points": 33},
                   "resonance": {"parameter": "load%harmonic_scale", "start": 1.0, "end": 2.0,
                                 "n_points": 3}},
                  ("omega", "parameter", "resonance/first_harmonic")),
    "wear": ({"sweep": {"start": 1.1}, "contact": {"area": 1.0},
              "wear": {"coefficient": 1e-3, "n_cycles": 100.0, "scheme": "implicit", "order": 2,
                       "error_tolerance": 1e-4, "max_steps": 50}},
             ("wear/cycles", "wear/depth"))}


def compare_further(kind, folder, groups, whole, program, counts):
    """A curve, or wear, of the sectors and of the annulus."""
    asked, names = FURTHER[kind]
    common = {"case": {"analysis": kind}, "harmonics": {"n_harmonics": 3},
              "solver": {"tolerance": 1e-11}}
    found = []
    for place, base in (("sectors", {key: groups[key] for key in (
            "model", "cyclic", "mistuning", "contact") if key in groups}),
            ("annulus", model_groups(whole.case))):
        run(folder / place, merged(merged(base, common), asked), name=kind, status=(0, 3, 4),
            program=program)
        path = folder / place / f"{kind}.h5"
        found.append(read(path) if path.exists() else None)
    if any(result is None for result in found):
        counts["one_row"] += sum(result is None for result in found) == 1
        return
    length = [len(result["converged"]) for result in found]
    solved = np.logical_and(*(result["converged"][:min(length)].astype(bool) for result in found))
    counts["rows"] += int(solved.sum())
    counts["one_row"] += max(length) - int(solved.sum())
    for name in names:
        a, b = (result[name][:min(length)][solved] for result in found)
        if not len(a):
            continue
        scale = np.abs(b).max() if name == "wear/depth" else np.maximum(np.abs(b), 1e-3)
        error = (np.abs(a - b) / scale).max() if np.abs(b).max() > 0.0 else 0.0
        if error > SAME_ROW:
            counts["wrong_rows"] += 1
            counts["notes"].append(f"{kind}: {name} {error:.1e}")


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
    if n_pairs and law == "penalty":
        compare_further(sorted(FURTHER)[seed // len(WAYS) % 3], folder, groups, whole, program,
                        counts)
    (folder / "modes").mkdir()
    write(folder / "modes" / "model.h5", case, parts)
    done = run(folder / "modes", {key: groups[key] for key in ("model", "mistuning", "contact")
                                  if key in groups} | {
        "case": {"analysis": "modes"}, "cyclic": {"mistuned": True, "n_modes": 2}},
        status=(0, 3), program=program)
    model = whole.case["model"]
    if done.returncode:
        # What no stiffness holds has no frequency, and is refused in words.
        held = np.linalg.eigvalsh(np.array(model["stiffness"])).min() > 0.0
        counts["wrong_modes"] = int(held)
        counts["refused"] = int(not held)
        return counts
    open_modes = read(folder / "modes" / "case.h5")["modes/open"][0]
    # Some rows may be without mass: 1/w^2 is what is found.
    theta = eigh(np.array(model["mass"]), np.array(model["stiffness"]), eigvals_only=True)[::-1]
    wanted = 1.0 / np.sqrt(theta[:len(open_modes)])
    counts["modes"] = len(open_modes)
    counts["wrong_modes"] = int(np.sum(np.abs(open_modes / wanted - 1.0) > EQUAL))
    return counts
