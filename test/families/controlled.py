"""Given amplitudes, against sweeps over the load at the same frequency."""
import subprocess

import h5py
import numpy as np
from unit_cases import LAWS, drawn_contact, drawn_model
from units import text

TITLE = "Given amplitudes"
TEXT = """
Chains of one to four masses with a pair of every law, in one or two tangential directions, with and
without a normal dof, gap and static load. The pair often rubs the very dof that is driven and
observed. Asked for are three amplitudes from a thousandth to a thousand times that of the linear
structure, at one frequency.

The judge is a sweep over the load at that frequency. *The same*: with the load that was found it
comes to the amplitude, to 1e-6 (*another response*: it comes to another one, or to none; the
responses are several). Of those that were not found *passed by the sweep* lie between two
neighbouring loads of a sweep of 25 loads from a hundredth to a hundred times that of the linear
structure, both found; *wrong reason* are those of them that are said to be out of reach. `words`
are those not found whose reason is told.
"""
COUNT = 200
SMALL = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9)
COLUMNS = {"points": "amplitudes", "found": "found", "same": "of these the same",
           "other": "another response", "words": "not found, with a reason", "lost": "without one",
           "passed": "not found, passed by the sweep", "wrong": "wrong reason",
           "negative": "negative loads in the file"}
ZERO = ("wrong", "negative")

SAME, JUMP = 1e-6, 3.0
REASONS = ("rests under the load", "static loads alone move", "does not move by more than",
           "jumps from")


def drawn(seed):
    """Groups of a case without its amplitudes, and the amplitude of its linear structure."""
    random = np.random.default_rng(seed)
    law = LAWS[seed % len(LAWS)]
    normal = bool(random.random() < 0.3) and law != "dlft_velocity"
    n = int(random.integers(1 + normal, 5))
    model = drawn_model(random, n)
    contact = drawn_contact(random, n, law, normal)
    cosine, static = np.zeros(n), np.zeros(n)
    rubbed = contact["side_1"][0] or contact["side_1"][2]
    driven, observed = (rubbed if random.random() < 0.6 else int(random.integers(1, n + 1))
                        for _ in range(2))
    cosine[driven - 1] = 1.0
    if normal and random.random() < 0.5:
        static[contact["side_1"][2] - 1] = -float(random.uniform(0.2, 1.0))
    shape = (n, n)
    omega = float(random.uniform(0.3, 2.0))
    response = np.linalg.solve(
        model["stiffness"].reshape(shape) - omega**2 * model["mass"].reshape(shape)
        + 1j * omega * model["damping"].reshape(shape), cosine)
    groups = {"case": {"analysis": "frf"}, "model": model, "contact": contact,
              "load": {"cosine": cosine, "static": static},
              "harmonics": {"n_harmonics": int(random.choice([3, 5, 7]))},
              "output": {"observe": observed},
              "sweep": {"values": [omega]}}
    linear = abs(response[observed - 1])
    amplitude = linear * np.sort(np.exp(random.uniform(np.log(1e-3), np.log(1e3), 3)))
    of = str(random.choice(["first_harmonic", "first_harmonic", "largest"]))
    return groups, linear, {"amplitude": list(amplitude), "of": of}


def run(program, folder, groups):
    """Lines that were printed, and the datasets of the result."""
    path, target = folder / "case.nml", folder / "case.h5"
    path.write_text(text(groups))
    done = subprocess.run([program, "-o", target, path.name], cwd=folder, check=False,
                          capture_output=True, text=True, timeout=600)
    data = {}
    if target.exists():
        with h5py.File(target, "r") as file:
            for name in ("converged", "load/scale", "coefficients", "amplitude"):
                data[name] = file[name][()]
        target.unlink()
    return (done.stdout + done.stderr).splitlines(), data


def over_the_load(program, folder, groups, of, loads):
    """Amplitudes of a sweep over loads, NaN where none was found."""
    omega = groups["sweep"]["values"][0]
    swept = {**groups, "sweep": {"parameter": "load%harmonic_scale", "frequency": omega,
                                 "values": [float(load) for load in loads]}}
    swept.pop("control", None)
    _, data = run(program, folder, swept)
    size = (np.hypot(*data["coefficients"][:, 1:3, 0].T) if of == "first_harmonic"
            else data["amplitude"][:, 0])
    return np.where(data["converged"], size, np.nan)


def comes_back(program, folder, groups, control, amplitude, load):
    for first in (1e-2, 30.0):
        loads = np.geomspace(first * load, load, 9)
        reached = over_the_load(program, folder, groups, control["of"], loads)[-1]
        if abs(reached - amplitude) <= SAME * amplitude:
            return True
    return False


def trial(seed, program, folder):
    groups, linear, control = drawn(seed)
    lines, data = run(program, folder, {**groups, "control": control})
    counts = {"kind": groups["contact"]["law"], "points": len(control["amplitude"]), "notes": []}

    def count(word):
        counts[word] = counts.get(word, 0) + 1

    reasons = [line for line in lines if line.startswith("control: at")
               and any(word in line for word in REASONS)]
    counts["words"] = len(reasons)
    for k, amplitude in enumerate(control["amplitude"]):
        load = data["load/scale"][k]
        counts["negative"] = counts.get("negative", 0) + int(load < 0.0)
        if data["converged"][k]:
            count("found")
            count("same" if comes_back(program, folder, groups, control, amplitude, load)
                  else "other")
            continue
        loads = amplitude / linear * np.geomspace(1e-2, 1e2, 25)
        swept = over_the_load(program, folder, groups, control["of"], loads)
        low, high = swept[:-1], swept[1:]
        between = (low < amplitude) & (high >= amplitude) & (high < JUMP * low)
        if between.any():
            count("passed")
            said = len(reasons) == counts["points"] - int(data["converged"].sum())
            counts["wrong"] = counts.get("wrong", 0) + int(said)
            counts["notes"].append(f"amplitude {amplitude:.6g} was not found: {reasons}")
    counts["lost"] = counts["points"] - counts.get("found", 0) - counts["words"]
    return counts
