"""Random worn joints by Rosenbrock's method, BDF and the implicit scheme, against small steps and
against an integration in time."""
import subprocess

import h5py
import numpy as np
import wear_joints
from archard_march import rate_by_time, worn_by_time
from cases import merged, write_namelist

TITLE = "Schemes of wear"
TEXT = """
One to three masses in the plane that press and rub, coupled, preloaded or with gaps, by every law
that wear serves and both laws of wear, with one to five harmonics. Each joint is worn by
Rosenbrock's method, by BDF and by the implicit scheme, until nothing wears any more. Half of the
joints come to where the vibration has a fold on the way: beyond it the joint vibrates otherwise,
all at once.

The judges are the implicit scheme with a fiftieth of the tolerance, up to where it first jumps, and
for every tenth joint, with elastic pairs and 15 harmonics, one that shares no code with the
program: contact and friction of its own integrated in time until the motion repeats, and Archard's
law over the cycles by a Runge-Kutta method. It may leave a vibration that repels it: where the one
of the program repeats in it too, with the rates of the program, that is *another vibration*. Depths
may differ by 2 % of the largest, or by what 5 % of the cycles make. *Unsaid* is an end without a
steady state that names neither a vibration that is missing nor the key to change, or one that the
implicit scheme does not come to.
"""
COUNT = 100
SMALL = (3, 8, 9, 41)
COLUMNS = {"reached": "steady", "jumps": "with a jump", "implicit": "with implicit steps",
           "ended": "ended in words", "unsaid": "ended, unsaid", "crawled": "out of steps",
           "judged": "judged by small steps", "off": "off", "timed": "judged in time",
           "off_time": "off", "several": "another vibration"}
ZERO = ("unsaid", "off", "off_time")

SCHEMES = {
    "implicit": {"wear": {"scheme": "implicit"}},
    "Rosenbrock": {"wear": {"scheme": "pseudo_time"}, "pseudo_time": {"scheme": "rosenbrock"}},
    "BDF": {"wear": {"scheme": "pseudo_time"}, "pseudo_time": {"scheme": "bdf"}},
}
#: Of the largest depth, and of the cycles.
SAME, SHIFT = 0.02, 0.05
#: The judge's steps, and how much before its jump a depth is compared: there the frequency of the
#: fold itself is what steps decide.
SMALL_STEPS, BEFORE_JUMP = {"error_tolerance": 2e-5, "max_steps": 4000}, 0.98
MOST_STEPS, TIMED = 600, 10


def draw(seed):
    """Groups of a case without its scheme."""
    size = np.random.default_rng(7300 + seed)
    groups = wear_joints.own(size, gaps=True)
    law = "penalty" if seed % TIMED == 0 else str(size.choice(wear_joints.LAWS))
    if law == "penalty":
        wear_joints.elastic(size, groups)
    return merged(groups, {"contact": {"law": law}, "wear": {"max_steps": MOST_STEPS},
                           "harmonics": {"n_harmonics": int(size.integers(1, 6))}})


def worn(groups, program, folder, name):
    """Rows and words of a run; None where nothing was written."""
    write_namelist(folder / f"{name}.nml", groups)
    subprocess.run([str(program), "-q", f"{name}.nml"], cwd=folder, check=False,
                   capture_output=True, timeout=600)
    with h5py.File(folder / f"{name}.h5") as file:
        if "wear" not in file or len(file["wear/depth"]) == 0:
            return None
        known = {key: int(file["wear"].attrs.get(key, 0)) for key in ("n_implicit", "n_jumps")}
        return {"cycles": file["wear/cycles"][()], "depth": file["wear/depth"][()],
                "rate": file["wear/rate"][()],
                "motion": file["coefficients"][()].transpose(0, 2, 1),
                "amplitude": file["amplitude"][()], "end": str(file["wear"].attrs["ending"]),
                "steady": str(file["wear"].attrs["steady_state"]) != "not reached", **known}


def sudden(run):
    """The row before which the vibration first changes by much while depths hardly do."""
    depth = run["depth"].max(axis=1)
    growth = np.diff(depth) / np.maximum(depth[1:], 1e-300)
    change = (np.abs(np.diff(run["amplitude"], axis=0)).max(axis=1)
              / np.maximum(run["amplitude"][:-1].max(axis=1), 1e-300))
    found = np.flatnonzero((growth < 2e-3) & (change > 0.03))
    return int(found[0]) if len(found) else len(depth) - 1


def is_off(run, fine):
    """Whether depths differ, up to the first jump of either."""
    last = BEFORE_JUMP * min(run["cycles"][sudden(run)], fine["cycles"][sudden(fine)])
    rows = np.flatnonzero(run["cycles"] <= last)
    for i in range(run["depth"].shape[1]):
        # Where the rate rises steeply it is the cycles that small errors of before have moved.
        true = [np.interp(shift * run["cycles"][rows], fine["cycles"], fine["depth"][:, i])
                for shift in (1.0 - SHIFT, 1.0, 1.0 + SHIFT)]
        found, room = run["depth"][rows, i], SAME * run["depth"][rows].max()
        if ((found < np.min(true, axis=0) - room) | (found > np.max(true, axis=0) + room)).any():
            return rows[-1] > 0
    return False


def is_said(end):
    return "no other vibration" in end or "raise" in end


def trial(seed, program, folder):
    groups = draw(seed)
    counts = {"kind": groups["contact"]["law"], **dict.fromkeys(COLUMNS, 0)}
    notes = []
    runs = {name: worn(merged(groups, keys), program, folder, name)
            for name, keys in SCHEMES.items()}
    if any(run is None for run in runs.values()):
        return {**counts, "notes": ["no vibration of the unworn joint"]}
    fine = worn(merged(groups, merged(SCHEMES["implicit"], {"wear": SMALL_STEPS})), program, folder,
                "fine")
    for name, run in runs.items():
        counts["reached"] += run["steady"]
        counts["jumps"] += run["n_jumps"] > 0
        counts["implicit"] += run["n_implicit"] > 0
        if "max_steps" in run["end"]:
            counts["crawled"] += 1
        elif not run["steady"]:
            counts["ended"] += 1
            if not is_said(run["end"]) or runs["implicit"]["steady"]:
                counts["unsaid"] += 1
                notes.append(f"{name}: {run['end']}")
        counts["judged"] += 1
        if is_off(run, fine):
            counts["off"] += 1
            notes.append(f"{name} is off")
    if seed % TIMED == 0 and runs["implicit"]["depth"][-1].max() > 0.0:
        off = {name: timed(merged(groups, keys), program, folder) for name, keys in SCHEMES.items()
               if name != "implicit"}
        counts["timed"] = len(off)
        for name, what in off.items():
            if what:
                counts[what] += 1
                notes.append(f"{name}, by the march in time: {COLUMNS[what]}")
    return {**counts, "notes": notes}


def early(run):
    """A row well before any jump, where no rate has changed by much: the march takes few steps."""
    rate, first = run["rate"], run["rate"][0].max()
    much = (np.abs(rate - rate[0]) > 0.5 * first).any(axis=1)
    change = int(np.flatnonzero(much)[0]) if much.any() else len(rate) - 1
    return max(1, min(change, sudden(run)) - 1)


def timed(groups, program, folder):
    """The column of a run whose depths differ from those of the march in time."""
    many = merged(groups, {"harmonics": {"n_harmonics": 15}})
    run = worn(many, program, folder, "timed")
    if run is None or len(run["cycles"]) < 2:
        return None
    row = early(run)
    true = worn_by_time(many, run["cycles"][row], run["motion"][0])
    if np.abs(run["depth"][row] - true).max() <= SAME * true.max():
        return None
    for i in (0, row):
        own = rate_by_time(many, run["depth"][i], run["motion"][i])
        if np.abs(run["rate"][i] - own).max() > SAME * own.max():
            return "off_time"
    return "several"
