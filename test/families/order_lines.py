"""Random lines of an engine order, along which the rotation speed follows the frequency."""
from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "cyclic"), str(HERE.parent / "support"), str(HERE.parents[1])]

import h5py  # noqa: E402
import numpy as np  # noqa: E402
from annulus import random_case  # noqa: E402
from cases import read, run  # noqa: E402
from deviations import draw, write  # noqa: E402

TITLE = "Lines of an engine order"
TEXT = """
Disks of 2 to 8 sectors without symmetry, alike or different by themselves, 0 to 2 pairs in a sector
with elastic or regularised friction, 1 to 3 harmonics, waves both ways, hysteretic damping in one
half; Coriolis forces, stiffness and static load that grow with the square of the speed, by matrices
or by a table of two to four speeds, gaps and normal loads that grow with it. Four frequencies
along a line `speed_order`. Judge: the program at each frequency with the fixed speed there, which
follows nothing. Equal: 1e-9 of the largest coefficient with joints, 1e-11 without. Then the line
by arc length, whose rows are solved for again at their frequencies: the derivative by the frequency
has to hold all that follows the speed.
"""
COUNT = 100
SMALL = range(8)
COLUMNS = {"rows": "rows", "equal": "equal", "wrong": "different", "failed": "not solved in one",
           "branch": "rows by arc length", "off": "off the line", "ended": "branches that ended"}
ZERO = ("wrong", "off")
ALSO = [HERE.parent / "cyclic" / name for name in ("annulus.py", "deviations.py")]
EQUAL, LINEAR = 1e-9, 1e-11
#: Of a branch and of a sweep beside each other, solved to 1e-12.
ON_LINE = 1e-8


def grown(rng, case, path):
    """Write what grows with the speed; the largest speed that the model knows, else None."""
    stiffness = np.array(case["model"]["stiffness"])
    n, most = len(stiffness), None
    with h5py.File(path, "a") as file:
        if rng.random() < 0.7:
            skew = 0.05 * rng.normal(size=(n, n))
            file["coriolis"] = skew - skew.T
        a = rng.normal(size=(3, n, n)) / n
        powers, loads = [0.3 * x @ x.T for x in a], 0.05 * rng.normal(size=(3, n))
        if rng.random() < 0.5:
            values = np.linspace(0.0, 1.0, int(rng.integers(2, 5)))
            most = 1.0
            del file["stiffness"]
            file["speed/value"] = values
            for k, speed in enumerate(values):
                shares = speed ** (2 * np.arange(1, len(values)))
                file[f"speed/{k}/stiffness"] = stiffness + sum(
                    share * matrix for share, matrix in zip(shares, powers))
                file[f"speed/{k}/static"] = sum(
                    share * load for share, load in zip(shares, loads))
        else:
            file["stiffness_rotation"], file["load/static_rotation"] = powers[0], loads[0]
        pairs = len(case["contact"]["side_1"])
        if pairs and rng.random() < 0.7:
            file["contact/gap_rotation"] = rng.uniform(-0.05, 0.02, pairs)
    return most


def trial(seed, program, folder):
    rng = np.random.default_rng([73, seed])
    law = str(rng.choice(["penalty", "regularised"]))
    n_pairs = int(rng.integers(0, 3))
    case = random_case(rng, n_sectors=int(rng.integers(2, 9)), n_pairs=max(n_pairs, 1), law=law)
    if n_pairs == 0:
        case["contact"] = {"side_1": [], "side_2": [], "sector_2": []}
    mistuned = bool(rng.random() < 0.5)
    parts, scale = {}, 1.0
    if mistuned:
        way = str(rng.choice(["rows", "blade", "sectors", "together"]))
        parts, scale, _ = draw(rng, case, way, 0.08)
    write(folder / "model.h5", case, parts)
    most = grown(rng, case, folder / "model.h5")
    order = float(rng.choice([1.0, 2.0, 3.0]))
    groups = {"model": {"source": "hdf5", "file": "model.h5", "rayleigh_stiffness": 2e-3},
              "cyclic": {"engine_order": case["engine_order"], "mistuned": mistuned},
              "solver": {"tolerance": 1e-12},
              "harmonics": {"n_harmonics": int(rng.integers(1, 4)), "sampling": "uniform",
                            "n_time": 96}}
    if mistuned:
        groups["mistuning"] = {"scale": scale}
    if rng.random() < 0.5:
        groups["model"]["loss_factor"] = 0.01
    if n_pairs:
        groups["contact"] = {"law": law}
    low, high = order * np.array([0.2, 0.9] if most else [0.2, 1.2])
    omegas = np.sort(rng.uniform(low, high, 4))
    counts = {"kind": ("mistuned" if mistuned else "alike")
              + (", table" if most else ", squares"), "notes": []} | dict.fromkeys(COLUMNS, 0)

    def solved(name, sweep, analysis="frf", **model):
        run(folder, groups | {"case": {"analysis": analysis}, "sweep": sweep,
                              "model": groups["model"] | model}, name=name, status=(0, 4),
            program=program)
        return read(folder / f"{name}.h5")

    line = solved("line", {"values": omegas.tolist(), "speed_order": order})
    for k, omega in enumerate(omegas):
        one = solved("point", {"start": omega}, "point", rotation_speed=omega / order)
        counts["rows"] += 1
        if not (one["converged"][0] and line["converged"][k]):
            counts["failed"] += 1
            continue
        error = (np.abs(line["coefficients"][k] - one["coefficients"][0]).max()
                 / np.abs(one["coefficients"][0]).max())
        counts["equal" if error <= (EQUAL if n_pairs else LINEAR) else "wrong"] += 1
        if error > (EQUAL if n_pairs else LINEAR):
            counts["notes"].append(f"{error:.1e} at {omega:.4f}")
    branch = solved("branch", {"start": omegas[0], "end": omegas[-1], "n_points": 9,
                               "continuation": "arclength", "speed_order": order})
    counts["ended"] += int(abs(branch["omega"][-1] / omegas[-1] - 1.0) > 1e-6)
    rows = np.flatnonzero(branch["converged"])[1::4]
    if len(rows) == 0:
        return counts
    again = solved("again", {"values": branch["omega"][rows].tolist(), "speed_order": order})
    for k, row in enumerate(rows):
        if not again["converged"][k]:
            continue
        counts["branch"] += 1
        error = (np.abs(again["coefficients"][k] - branch["coefficients"][row]).max()
                 / np.abs(branch["coefficients"][row]).max())
        if error > ON_LINE:
            counts["off"] += 1
            counts["notes"].append(f"off by {error:.1e} at {branch['omega'][row]:.4f}")
    return counts
