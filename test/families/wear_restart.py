"""Wear runs cut at random and continued, against those that were not cut."""
import os
import signal
import subprocess

import h5py
import numpy as np
import wear_joints
from cases import merged, write_namelist

TITLE = "Wear continued"
TEXT = """
Random worn joints of one to three pairs on two to six coupled masses, with every law, scheme and
order, some at their resonance. Each run is made whole, and cut by `max_steps`, by `max_seconds` or
by an interrupt and then continued by `--restart`. The judge compares all datasets and attributes of
the two files, bit for bit, but for what the clock and the name of the result say.
"""
COUNT = 200
SMALL = range(12)
COLUMNS = {"continued": "continued", "differs": "not bit for bit", "refused": "refused",
           "uncut": "ended before the cut"}
ZERO = ("differs", "refused")

SCHEMES = {
    "explicit": {"wear": {"scheme": "explicit"}},
    "implicit": {"wear": {"scheme": "implicit"}},
    "Euler": {"wear": {"scheme": "pseudo_time"}},
    "Rosenbrock": {"wear": {"scheme": "pseudo_time"}, "pseudo_time": {"scheme": "rosenbrock"}},
    "BDF": {"wear": {"scheme": "pseudo_time"}, "pseudo_time": {"scheme": "bdf"}},
}
CUTS = ("max_steps", "max_seconds", "interrupt")
STEPS = 40
#: What no continued run can repeat.
OTHERWISE = {"seconds", "namelist", "created", "command"}


def draw(seed):
    """(groups of the whole run, scheme, cut, steps before the cut)."""
    size = np.random.default_rng(5100 + seed)
    scheme = list(SCHEMES)[seed % len(SCHEMES)]
    groups = wear_joints.own(size, gaps=True)
    law = str(size.choice(wear_joints.LAWS))
    if law == "penalty":
        wear_joints.elastic(size, groups)
    groups = merged(groups, {"contact": {"law": law}, "wear": {"max_steps": STEPS}})
    groups = merged(groups, SCHEMES[scheme])
    if scheme in ("explicit", "implicit"):
        groups["wear"]["order"] = int(size.integers(0, 3 if scheme == "explicit" else 5))
    if scheme != "BDF" and size.random() < 0.4:
        groups["wear"]["follow_resonance"] = True
    if size.random() < 0.3:
        groups["wear"]["max_depth_step"] = float(10.0 ** size.uniform(-3.0, -1.5))
    return groups, scheme, CUTS[seed // len(SCHEMES) % len(CUTS)], int(size.integers(1, 30))


def start(folder, program, groups, name, *arguments):
    write_namelist(folder / f"{name}.nml", groups)
    return subprocess.Popen([str(program), "-v", f"{name}.nml", *arguments], cwd=folder, text=True,
                            stderr=subprocess.PIPE, stdout=subprocess.DEVNULL,
                            env={**os.environ, "OMP_NUM_THREADS": "1"})


def run_whole(folder, program, groups, name, *arguments):
    with start(folder, program, groups, name, *arguments) as process:
        process.communicate()
    return process.returncode


def run_cut(folder, program, groups, cut, steps, seconds):
    """The run `part`, cut; where its steps come too fast it may come to its own end."""
    if cut == "max_steps":
        groups = merged(groups, {"wear": {"max_steps": steps}})
    elif cut == "max_seconds":
        groups = merged(groups, {"case": {"max_seconds": seconds}})
    with start(folder, program, groups, "part") as process:
        if cut == "interrupt":
            for line in process.stderr:
                if line.startswith("point ") and int(line.split()[1].rstrip(":")) >= min(steps, 5):
                    process.send_signal(signal.SIGINT)
                    break
        process.communicate()


def contents(path):
    found = {}
    with h5py.File(path) as file:
        def take(name, item):
            if isinstance(item, h5py.Dataset):
                value = item[()]
                found[name] = value.tolist() if value.dtype == object else value.tobytes()
            for key, value in item.attrs.items():
                found[f"{name}@{key}"] = np.asarray(value).tolist()
        file.visititems(take)
        for key in ("status", "steady_state"):
            found[key] = str(file.attrs.get(key))
        steps = len(file["omega"])
    return {name: value for name, value in found.items()
            if name.split("/")[-1].split("@")[0] not in OTHERWISE}, steps


def trial(seed, program, folder):
    groups, scheme, cut, steps = draw(seed)
    counts = {"kind": scheme, "continued": 0, "differs": 0, "refused": 0, "uncut": 0, "notes": []}
    run_whole(folder, program, groups, "whole")
    if not (folder / "whole.h5").exists():
        return {**counts, "notes": ["no whole run"]}
    whole, n_whole = contents(folder / "whole.h5")
    with h5py.File(folder / "whole.h5") as file:
        spent = float(np.sum(file["seconds"][()]))
    run_cut(folder, program, groups, cut, steps, max(0.5 * spent, 2e-3))
    if not (folder / "part.h5").exists():
        counts["uncut"] = 1
        return counts
    with h5py.File(folder / "part.h5") as file:
        n_part = len(file["omega"]) if "restart/control" in file else 0
    if n_part in (0, n_whole):
        counts["uncut"] = 1
        return counts
    run_whole(folder, program, groups, "again", "--restart", "part.h5")
    if not (folder / "again.h5").exists():
        counts["refused"] = 1
        return counts
    counts["continued"] = 1
    again, _ = contents(folder / "again.h5")
    other = sorted(name for name in set(whole) | set(again) if whole.get(name) != again.get(name))
    if other:
        counts["differs"] = 1
        counts["notes"].append(f"{scheme}, cut by {cut} at {n_part} of {n_whole}: {other[:6]}")
    return counts
