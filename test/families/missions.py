"""Random missions: blocks in their order, by jumps, and cut and continued."""
import signal
import subprocess

import h5py
import numpy as np
import wear_joints
from archard_march import Joint
from cases import merged, write_namelist
from wear_restart import contents

TITLE = "Missions"
TEXT = """
One to three masses in the plane that press and rub, coupled, preloaded or with gaps, by every law
that wear serves and both laws of wear, with coefficients of each pair. Two to four blocks change
load, static load or frequency, some stay at their resonance; two to five flights in their order,
and as many times twelve by jumps under control of the error.

Judges: (i) every block as a run of its own by the implicit scheme with a tenth of the tolerance,
from the depths that the one before has left (`worn`); depths after every flight may differ by 2e-3
of the largest. (ii) For every fifth mission, with elastic pairs and 15 harmonics, contact and
friction of its own integrated in time until the motion repeats, and Archard's law over the cycles
by a Runge-Kutta method, block by block: 2 %. (iii) Jumps against the flights in their order, with
steps of the same tolerance: within what the file says (`jump_error`), and what a step may be off
where the vibration has kinks (the tolerance). (iv) Missions
that were interrupted and continued against whole ones, bit for bit. Missions on whose way the
vibration jumps have several solutions, and those in which a block that stays at its resonance has
another one in the next flight, or as a run of its own (1 %), have several peaks: they are counted
beside.
"""
COUNT = 100
SMALL = (0, 1, 2, 5)
COLUMNS = {"flown": "flown", "several": "several vibrations", "ended": "ended in words",
           "judged": "judged block by block", "off": "off", "timed": "judged in time",
           "off_time": "off", "jumped": "by jumps", "off_jump": "off", "continued": "continued",
           "differs": "not bit for bit", "unsaid": "ended, unsaid"}
ZERO = ("off", "off_time", "off_jump", "differs", "unsaid")
TOLERANCE, SAME, SAME_IN_TIME, TIMED = 1e-4, 2e-3, 2e-2, 5
#: Of the jumps, and of flights in their order beside them.
COARSE = 1e-3
#: Change of a resonance from flight to flight that is one to another peak.
OTHER_PEAK = 1e-2


def draw(seed):
    """(groups without mission, blocks [(cycles, {key: value})], flights)."""
    size = np.random.default_rng(8800 + seed)
    groups = wear_joints.own(size, gaps=True)
    timed = seed % TIMED == 0
    law = "penalty" if timed else str(size.choice(wear_joints.LAWS))
    if law == "penalty":
        wear_joints.elastic(size, groups)
    n_pairs = groups["contact"]["n_pairs"]
    k_w = groups["wear"]["coefficient"] * np.exp(size.uniform(-0.7, 0.7, n_pairs))
    groups = merged(groups, {
        "contact": {"law": law}, "wear": {"coefficient": k_w, "error_tolerance": TOLERANCE},
        "harmonics": {"n_harmonics": 15 if timed else int(size.integers(1, 6))},
        "solver": {"tolerance": 1e-10}})
    if not timed and size.random() < 0.3:
        groups = merged(groups, {"wear": {"scheme": "pseudo_time"},
                                 "pseudo_time": {"scheme": "rosenbrock"}})
    start = groups["sweep"]["start"]
    # Some hundredths of the elastic compression a flight.
    usual = 0.02 * np.min(groups["contact"]["area"] / k_w)
    blocks = []
    for _ in range(int(size.integers(2, 5))):
        change = {"load%harmonic_scale": float(size.uniform(0.3, 1.3))}
        if size.random() < 0.5:
            change["load%static_scale"] = float(size.uniform(0.8, 1.2))
        if size.random() < 0.5:
            change["sweep%start"] = float(start * size.uniform(0.85, 1.15))
        if not timed and size.random() < 0.2:
            change["wear%follow_resonance"] = True
        blocks.append((float(usual * size.uniform(0.2, 2.0)), change))
    return groups, blocks, int(size.integers(2, 6))


def text(value):
    return str(value).replace("True", ".true.")


def mission(groups, blocks, n_flights, per_jump):
    return merged(groups, {"mission": {
        "n_blocks": len(blocks), "cycles": [cycles for cycles, _ in blocks],
        "change": ["; ".join(f"{key} = {text(value)}" for key, value in change.items())
                   for _, change in blocks],
        "n_flights": n_flights, "flights_per_jump": per_jump}})


def start(program, folder, groups, name, *arguments):
    write_namelist(folder / f"{name}.nml", groups)
    return subprocess.Popen([str(program), f"{name}.nml", *arguments], cwd=folder, text=True,
                            stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)


def fly(program, folder, groups, name, *arguments):
    """What a run has left; None where there is no file."""
    with start(program, folder, groups, name, *arguments) as process:
        words = process.communicate(timeout=600)[1]
    if not (folder / f"{name}.h5").exists():
        return None, words
    with h5py.File(folder / f"{name}.h5") as file:
        if "wear" not in file:
            return None, words
        found = {"depth": file["wear/depth"][()], "rate": file["wear/rate"][()],
                 "energy": file["wear/energy"][()], "work": file["contact/dissipation"][()],
                 "attributes": dict(file["wear"].attrs),
                 "omega": file["omega"][()],
                 "motion": file["coefficients"][()].transpose(0, 2, 1), "words": words}
        if "wear/mu" in file:
            found["mu"] = file["wear/mu"][()]
        if "mission/depth" in file:
            found.update(flights=file["mission/depth"][()], block=file["wear/block"][()],
                         stated=float(file["mission"].attrs["jump_error"]))
        return found, words


def one_by_one(program, folder, groups, blocks, n_flights):
    """Depths after every flight, and the frequencies of all blocks; None where a block did not come
    to its end."""
    flights, omegas, last = [], [], None
    fine = merged(groups, {"wear": {"error_tolerance": 0.1 * TOLERANCE, "scheme": "implicit"},
                           "pseudo_time": {}})
    for flight in range(n_flights):
        for number, (cycles, change) in enumerate(blocks):
            name = f"alone_{flight}_{number}"
            case = merged(fine, {"wear": {"n_cycles": cycles, "steady_tolerance": 1e-12}})
            if last:
                case = merged(case, {"contact": {"worn": f"{last}.h5"}})
            options = [word for key, value in change.items()
                       for word in ("--set", f"{key}={text(value)}")]
            found, _ = fly(program, folder, case, name, *options)
            if found is None or found["attributes"]["n_jumps"] > 0 or found["attributes"][
                    "ending"] not in ("n_cycles reached", "no pair slips under pressure: "
                                      "nothing wears"):
                return None
            last = name
            omegas.append(found["omega"][-1])
        flights.append(found["depth"][-1])
    return np.array(flights), np.array(omegas).reshape(n_flights, -1)


def by_time(groups, blocks, n_flights, motions):
    """The same by integration in time; motions: of each block where it is flown first."""
    joints = []
    for (_, change), motion in zip(blocks, motions):
        load = {key: np.array(groups["load"][key]) * change.get(
            "load%static_scale" if key == "static" else "load%harmonic_scale", 1.0)
            for key in ("static", "cosine", "sine")}
        given = merged(groups, {"load": load, "wear": {"coefficient": 1.0}, "sweep": {
            "start": change.get("sweep%start", groups["sweep"]["start"])}})
        joint = Joint(given)
        joint.k_w = np.asarray(groups["wear"]["coefficient"])
        joint.start(motion)
        joints.append(joint)
    depth, flights = np.zeros(joints[0].n_pairs), []
    for _ in range(n_flights):
        for joint, (cycles, _) in zip(joints, blocks):
            # Growth of some hundredths: the midpoint rule.
            middle = depth + 0.5 * cycles * joint.rate(depth)
            depth = depth + cycles * joint.rate(middle)
        flights.append(depth)
    return np.array(flights)


def continued(program, folder, groups, n_rows):
    """None where the run was over before it was cut, else whether it goes on bit for bit."""
    whole, _ = contents(folder / "whole.h5")
    with start(program, folder, groups, "part") as process:
        for line in process.stderr:
            if line.startswith(f"point {n_rows} "):
                process.send_signal(signal.SIGINT)
                break
        process.communicate(timeout=600)
    if not (folder / "part.h5").exists():
        return None
    with h5py.File(folder / "part.h5") as file:
        if str(file.attrs["status"]) != "stopped" or "restart/control" not in file:
            return None
    fly(program, folder, groups, "again", "--restart", "part.h5")
    if not (folder / "again.h5").exists():
        return False
    again, _ = contents(folder / "again.h5")
    return again == whole


def trial(seed, program, folder):
    groups, blocks, n_flights = draw(seed)
    counts = dict.fromkeys(COLUMNS, 0)
    counts.update(kind=groups["contact"]["law"], notes=[])
    ordered = mission(groups, blocks, n_flights, 1)
    whole, words = fly(program, folder, ordered, "whole")
    if whole is None:
        counts["ended" if "error" in words or "converge" in words else "unsaid"] = 1
        return {**counts, "notes": [f"no result: {words[-200:]}"]}
    ending = str(whole["attributes"]["ending"])
    if ending != "n_flights reached" and str(whole["attributes"]["steady_state"]) == "not reached":
        counts["ended" if "flight " in ending or "nothing was worn" in ending else "unsaid"] = 1
        return {**counts, "notes": [ending]}
    counts["flown"] = 1
    # Of the flights that came to their end: a steady state ends a mission before.
    rows = len(whole["omega"]) - 1
    omegas = whole["omega"][1:1 + rows - rows % len(blocks)].reshape(-1, len(blocks))

    def other_peaks(others):
        n = min(len(omegas), len(others))
        return np.any(np.abs(others[:n] / omegas[:n] - 1.0) > OTHER_PEAK)

    alone = one_by_one(program, folder, groups, blocks, n_flights)
    if whole["attributes"]["n_jumps"] > 0 or other_peaks(np.vstack(
            [omegas[1:], omegas[-1:]])) or (alone is not None and other_peaks(alone[1])):
        counts["several"] = 1
        return counts
    flown = np.isfinite(whole["flights"]).all(axis=1)
    flights = whole["flights"][flown][1:]
    # Of pairs that stick, round-off: what forces and paths of 1e-9 would leave.
    largest = max(flights.max(), 1e-9 * n_flights * sum(cycles for cycles, _ in blocks) * np.max(
        groups["wear"]["coefficient"] / groups["contact"]["area"]))

    def is_off(other, allowed):
        n = min(len(other), len(flights))
        off = np.abs(other[:n] - flights[:n]).max() / largest
        if off > allowed:
            counts["notes"].append(f"off by {off:.2e}, allowed {allowed:.1e}")
        return int(off > allowed)

    if alone is not None:
        counts["judged"] = 1
        counts["off"] = is_off(alone[0], SAME)
    if seed % TIMED == 0:
        rows = [int(np.flatnonzero(whole["block"] == k + 1)[0]) for k in range(len(blocks))]
        counts["timed"] = 1
        counts["off_time"] = is_off(by_time(groups, blocks, n_flights, [
            whole["motion"][row] for row in rows]), SAME_IN_TIME)
    further = 12 * n_flights
    slow = [(cycles / 12.0, change) for cycles, change in blocks]
    coarse = merged(groups, {"wear": {"error_tolerance": COARSE}})
    exact, _ = fly(program, folder, mission(coarse, slow, further, 1), "exact")
    jumps, _ = fly(program, folder, mission(coarse, slow, further, 0), "jumps")
    if exact and jumps and not (exact["attributes"]["n_jumps"] or jumps["attributes"]["n_jumps"]):
        both = np.isfinite(exact["flights"]).all(axis=1) & np.isfinite(
            jumps["flights"]).all(axis=1)
        off = np.abs(exact["flights"] - jumps["flights"])[both].max()
        counts["jumped"] = 1
        allowed = jumps["stated"] + COARSE * np.nanmax(exact["flights"])
        if off > allowed:
            counts["off_jump"] = 1
            counts["notes"].append(f"jumps off by {off:.2e}, allowed {allowed:.2e}")
    cut = 2 + seed % max(1, len(whole["depth"]) - 2)
    same = continued(program, folder, ordered, cut)
    if same is not None:
        counts["continued"] = 1
        counts["differs"] = int(not same)
    return counts
