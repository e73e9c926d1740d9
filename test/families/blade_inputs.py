"""Hostile inputs of what makes a disk of blades as they are: each ends in words."""
from __future__ import annotations

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "cyclic"), str(HERE.parent / "support"), str(HERE.parents[1])]

import h5py  # noqa: E402
import numpy as np  # noqa: E402
from annulus import random_case  # noqa: E402
from cases import merged, write_namelist  # noqa: E402
from deviations import write  # noqa: E402

TITLE = "Hostile inputs of blades"
TEXT = """
A sound disk of 4 to 7 sectors with rows of blade modes, matrices of the blade and of a sector,
rows of stress with strengths, stiffening and Coriolis forces, at one of the analyses that take
these. One to three of the refusals below are mixed in at random, with values at random: keys beside
others that they do not go with, lengths, signs, what is not finite, parts of the model file that
are missing, of another shape or named by a sector that is not there. Told: exit status 3, no
result file, and a message that names a key or part of one of them. Silent: the case ran.
"""
COUNT = 400
SMALL = range(24)
COLUMNS = {"told": "told", "unnamed": "told without the name", "silent": "silent",
           "crash": "other ends"}
ZERO = ("unnamed", "silent", "crash")
ALSO = [HERE.parent / "cyclic" / name for name in ("annulus.py", "deviations.py")]


def mistuned(rng, n, n_sectors):
    """What group and file are changed to, and a word that the message has to have."""
    d = [0.01] * n_sectors
    length = int(rng.choice([1, n_sectors - 1, n_sectors + 1, 3 * n_sectors]))
    bad = float(rng.choice([np.nan, np.inf]))
    far = n_sectors + int(rng.integers(0, 5))
    return {
        "sectors alike": ({"cyclic": {"mistuned": False}}, {}, "mistuned"),
        "length of frequency": ({"mistuning": {"frequency": [0.01] * length}}, {}, "frequency"),
        "length of stiffness": ({"mistuning": {"stiffness": [0.01] * length}}, {}, "stiffness"),
        "no rows": ({"mistuning": {"frequency": d}}, {"mistuning/rows": None,
                                                       "mistuning/row_omega": None}, "rows"),
        "no omega": ({}, {"mistuning/row_omega": None}, "row_omega"),
        "omega": ({}, {"mistuning/row_omega": np.array([1.0, -float(rng.random())])}, "row_omega"),
        "no blade stiffness": ({"mistuning": {"stiffness": d}},
                               {"mistuning/blade_stiffness": None}, "blade_stiffness"),
        "below zero": ({"mistuning": {"frequency": [*d[:-1], -1.0 - float(rng.random())]}}, {},
                       "frequency"),
        "negative mass": ({"mistuning": {"mass": [-1e3 * float(rng.uniform(1.0, 9.0)), *d[1:]]}},
                          {}, "sector 0"),
        "sector": ({}, {f"mistuning/sector/{far}/stiffness": np.eye(n)}, f"sector/{far}"),
        "negative sector": ({}, {"mistuning/sector/-1/stiffness": np.eye(n)}, "sector/-1"),
        "shape of a sector": ({}, {"mistuning/sector/0/stiffness": np.eye(n + 1)}, "sector/0"),
        "shape of rows": ({}, {"mistuning/rows": np.ones((2, n + 1))}, "rows"),
        "not finite": ({}, {"mistuning/rows": np.full((2, n), bad)}, "rows"),
        "not symmetric": ({"mistuning": {"stiffness": d}}, {
            "mistuning/blade_stiffness": rng.normal(size=(n, n))}, "blade_stiffness"),
        "stranger": ({}, {"mistuning/frequencies": np.ones(n_sectors)}, "frequencies"),
        "accuracy": ({"harmonics": {"accuracy": 1e-3}}, {}, "accuracy"),
        "time": ({"case": {"analysis": "time"}}, {}, "time"),
        "stability": ({"sweep": {"stability": True}}, {}, "stability"),
        "scale": ({"mistuning": {"scale": bad}}, {}, "scale"),
    }


def population(rng, n, n_sectors):
    length = int(rng.choice([1, n_sectors - 1, n_sectors + 1]))
    return {
        "no patterns": ({}, {"mistuning/patterns": None}, "patterns"),
        "length": ({"population": {"patterns": [0.01] * length}}, {}, "patterns"),
        "arclength": ({"sweep": {"continuation": "arclength"}}, {}, "arclength"),
        "too many": ({"population": {"n_patterns": int(rng.integers(4, 99))}}, {}, "patterns"),
        "negative": ({"population": {"n_patterns": -int(rng.integers(1, 99))}}, {}, "n_patterns"),
        "quantity": ({"population": {"quantity": "mean"}}, {}, "quantity"),
        "below zero": ({}, {"mistuning/patterns": np.full((3, n_sectors), -1.5)}, "patterns"),
        "shape": ({}, {"mistuning/patterns": np.ones((3, n_sectors + 1))}, "patterns"),
        "not finite": ({}, {"mistuning/patterns": np.full((3, n_sectors), np.nan)}, "patterns"),
    }


def speeds(rng, n, n_sectors):
    value = float(rng.uniform(0.1, 0.9))
    still = {"stiffness_rotation": None, "coriolis": None}
    return {
        "both speeds": ({"model": {"rotation_speed": value}}, {}, "speed_order"),
        "nothing that rotates": ({}, still | {"stress/static_rotation": None}, "speed_order"),
        "negative order": ({"sweep": {"speed_order": -value}}, {}, "speed_order"),
        "beside a table": ({}, {"speed/value": np.array([0.0, 1.0])}, "speed"),
        "one speed": ({}, still | table([value], n), "speed/value"),
        "five speeds": ({}, still | table(np.arange(5.0), n), "/speed/4"),
        "not ascending": ({}, still | table([1.0, value], n), "speed/value"),
        "negative speed": ({}, still | table([-value, 1.0], n), "speed/value"),
        "a speed is missing": ({}, still | table([0.0, value], n) | {"speed/1/stiffness": None},
                               "speed"),
        "shape at a speed": ({}, still | table([0.0, value], n) | {
            "speed/1/stiffness": np.eye(n + 1)}, "speed/1"),
        "coriolis": ({}, {"coriolis": np.eye(n)}, "coriolis"),
        "given": ({"sweep": {"speed_order": float("nan")}}, {}, "speed_order"),
    }


def table(values, n):
    found = {"speed/value": np.array(values, dtype=float)}
    return found | {f"speed/{k}/stiffness": (2.0 + k) * np.eye(n) for k in range(len(values))}


def campbell(rng, n, n_sectors):
    return {
        "mistuned": ({"cyclic": {"mistuned": True}}, {}, "mistuned"),
        "an order of 0": ({"campbell": {"orders": [int(rng.integers(1, 9)), 0]}}, {}, "orders"),
        "no orders": ({"campbell": {"orders": None}}, {}, "orders"),
        "backwards": ({"campbell": {"start": 3.0, "end": float(rng.uniform(0.1, 2.9))}}, {},
                      "campbell"),
        "speeds": ({"campbell": {"n_speeds": int(rng.integers(-3, 2))}}, {}, "n_speeds"),
        "modes": ({"cyclic": {"n_modes": -int(rng.integers(1, 9))}}, {}, "n_modes"),
        "points": ({"campbell": {"n_points": int(rng.integers(-3, 1))}}, {}, "n_points"),
    }


def stress(rng, n, n_sectors):
    value = -float(rng.uniform(0.0, 9.0))
    none = {f"stress/{name}": None for name in ("matrix", "static", "static_rotation", "endurance",
                                                "ultimate")}
    return {
        "no rows": ({"stress": {"endurance": 2.0, "ultimate": 3.0}}, none, "stress"),
        "endurance": ({"stress": {"endurance": value}}, {}, "endurance"),
        "ultimate": ({}, {"stress/ultimate": np.array([1.0, value])}, "ultimate"),
        "one of both": ({}, {"stress/ultimate": None}, "ultimate"),
        "length": ({"stress": {"endurance": [1.0, 2.0, 3.0]}}, {}, "endurance"),
        "shape": ({}, {"stress/matrix": np.ones((2, 5, n))}, "stress/matrix"),
        "shape of what stands": ({}, {"stress/static": np.ones((2, 5))}, "stress/static"),
        "not finite": ({}, {"stress/matrix": np.full((2, 6, n), np.nan)}, "stress/matrix"),
        "word": ({"stress": {"method": "tresca"}}, {}, "method"),
        "diagram": ({"stress": {"diagram": "soderberg"}}, {}, "diagram"),
        "hdhb": ({"harmonics": {"method": "hdhb"}}, {}, "hdhb"),
        "stranger": ({}, {"stress/rows": np.ones(2)}, "stress/rows"),
    }


KINDS = {"mistuned": mistuned, "population": population, "speeds": speeds, "campbell": campbell,
         "stress": stress}


def sound(rng, kind, n_sectors):
    """Groups and parts of the model file of a case that runs, and its sector."""
    case = random_case(rng, n_sectors=n_sectors, n_pairs=1, engine_order=2)
    n = len(case["model"]["mass"])
    if kind == "population":
        case["contact"] = {"side_1": [], "side_2": [], "sector_2": []}
    a = rng.normal(size=(n, n)) / n
    skew = 0.05 * (a - a.T)
    parts = {"stress/matrix": rng.normal(size=(2, 6, n)), "stress/static": rng.normal(size=(2, 6)),
             "stress/static_rotation": rng.normal(size=(2, 6)),
             "stress/endurance": np.array([3.0, 4.0]), "stress/ultimate": np.array([5.0, 6.0]),
             "stiffness_rotation": 0.1 * np.eye(n), "coriolis": skew}
    blade = {"rows": 0.5 * rng.normal(size=(2, n)), "row_omega": rng.uniform(0.8, 3.0, 2),
             "blade_stiffness": a @ a.T, "blade_mass": 0.1 * a @ a.T}
    groups = {"case": {"analysis": "point"}, "model": {"source": "hdf5", "file": "model.h5"},
              "cyclic": {"engine_order": 2}, "sweep": {"start": 1.1},
              "harmonics": {"n_harmonics": 3, "n_time": 32}}
    if kind in ("mistuned", "population"):
        groups["cyclic"]["mistuned"] = True
        parts |= {f"mistuning/{name}": value for name, value in blade.items()}
        parts["mistuning/frequency"] = 0.01 * rng.normal(size=n_sectors)
    if kind == "population":
        groups |= {"case": {"analysis": "population"}, "stress": {"output": "none"},
                   "sweep": {"start": 0.8, "end": 1.4, "n_points": 4}}
        parts["mistuning/patterns"] = 0.01 * rng.normal(size=(3, n_sectors))
        del parts["mistuning/frequency"]
    if kind == "speeds":
        groups |= {"case": {"analysis": "frf"},
                   "sweep": {"start": 0.8, "end": 1.4, "n_points": 4, "speed_order": 2.0}}
    if kind == "campbell":
        groups = {"case": {"analysis": "campbell"}, "model": groups["model"],
                  "campbell": {"start": 0.1, "end": 0.9, "n_speeds": 3, "orders": [2],
                               "peaks": False}, "cyclic": {"n_modes": 1},
                  "harmonics": groups["harmonics"], "stress": {"output": "none"}}
    if case["contact"]["side_1"]:
        groups["contact"] = {"law": case["law"]}
    return case, groups, parts


def solve(program, folder, case, groups, parts):
    """How the program ends."""
    for name in ("model.h5", "case.h5"):
        (folder / name).unlink(missing_ok=True)
    write(folder / "model.h5", case, {})
    with h5py.File(folder / "model.h5", "r+") as file:
        for name, value in parts.items():
            if value is not None:
                file[name] = value
    write_namelist(folder / "case.nml", groups)
    return subprocess.run([program, "-q", folder / "case.nml"], capture_output=True, text=True,
                          cwd=folder, timeout=120, check=False)


def trial(seed, program, folder):
    rng = np.random.default_rng([71, seed])
    kind = list(KINDS)[seed % len(KINDS)]
    n_sectors = int(rng.integers(4, 8))
    case, groups, parts = sound(rng, kind, n_sectors)
    n = len(case["model"]["mass"])
    counts = {"kind": kind, "notes": []} | dict.fromkeys(COLUMNS, 0)
    if seed < 2 * len(KINDS):
        done = solve(program, folder, case, groups, parts)
        if done.returncode not in (0, 4):
            counts["crash"] += 1
            counts["notes"].append(f"the sound case: {done.stderr}")
            return counts
    wrong = KINDS[kind](rng, n, n_sectors)
    chosen = rng.choice(list(wrong), size=min(len(wrong), int(rng.integers(1, 4))), replace=False)
    changed, words = groups, []
    for name in chosen:
        group, part, word = wrong[str(name)]
        changed, parts = merged(changed, group), parts | part
        words.append(word)
    done = solve(program, folder, case, changed, parts)
    if done.returncode == 0 or (folder / "case.h5").exists():
        counts["silent"] += 1
    elif done.returncode != 3:
        counts["crash"] += 1
    else:
        counts["told" if any(word in done.stderr for word in words) else "unnamed"] += 1
    if not counts["told"]:
        counts["notes"].append(f"{', '.join(map(str, chosen))}: {done.returncode} "
                               f"{done.stderr.strip()[:300]}")
    return counts
