"""Obstacles that move, in other units, turned, later, worn: each case against itself."""
import re
import subprocess

import h5py
import numpy as np
from rubs import BY_EVENTS, drawn, gaps, rigid_stiffness, text

TITLE = "Rubs in other words"
TEXT = """
The cases of [rubs](rubs.md) again, each said in other ways: in millimetres, tonnes and Newtons and
in units of no system; with t1 turned round, and the speed with it; with all loads and gaps later by
a whole number of instants (of events by any angle), with the constant gap given as a term of
harmonic 0. The judge is the case itself, to 1e-9 of its largest displacement and force (paths by
events, which two directions follow to a tolerance, later 1e-7).

Then pairs wear for a thousand cycles that take about a tenth of the largest gap: the rate of every
row (of events of the first and the last) is held against what slides under pressure against the
moving surface, by a march of the judge's own from instant to instant, or of steady sliding by the
integral of p (|v| - du/dt . v/|v|) over coefficients (1e-7 of the largest rate; of events by 32,768
instants 1e-4), the work of loads and obstacles against that of friction and damping (1e-8); and the
run is ended after half of its steps and continued (1e-9 of the depths). Laws of smooth friction
wear on sides that slide steadily alone.

Integration in time judges two rubs elsewhere (`test_obstacles.py`): with 25, 49 and 99 harmonics
the balance parts from it by 2.9e-4, 5.0e-5 and 1.5e-5 of the largest displacement under smooth
friction, by 1.2e-3, 5.8e-4 and 1.3e-4 under rigid friction. Those are the harmonics left out: they
fall with their number to the power of 2.1 and 1.6, and balances part from one another by as much.
The march of the rigid law is of first order in its steps: 3e-5 with 16,384.
"""
COUNT = 60
SMALL = (0, 1, 2, 3)
COLUMNS = {"solved": "solved", "failed": "ended in words", "units": "other units off",
           "turned": "turned off", "later": "later off", "constant": "harmonic 0 off",
           "worn": "worn", "rate": "rate off", "work": "work off", "restart": "continued off"}
ZERO = ("units", "turned", "later", "constant", "rate", "work", "restart")

#: Two directions by events: paths to a tolerance, measured 3e-9.
PLANAR = 1e-7
SAME, RATE, WORK, CONTINUED = 1e-9, 1e-7, 1e-8, 1e-9
TURNS = 400
#: Length, mass, time: m, kg, s in mm, t, s, and in units of no system.
UNITS = ((1e3, 1e-3, 1.0), (0.31, 7.3, 11.0))


def scaled(case, length, mass, time):
    force, stiffness = mass * length / time**2, mass / time**2
    factors = {"mass": mass, "damping": mass / time, "stiffness": stiffness, "kt": stiffness,
               "kn": stiffness, "gap": length, "speed": length / time, "v0": length / time,
               "omega": 1.0 / time, "cosine": force, "sine": force}
    found = case | {key: case[key] * factor for key, factor in factors.items()}
    found["terms"] = [(pair, n, size * length, phase) for pair, n, size, phase in case["terms"]]
    return found, length, force


def later(case, angle):
    """All that drives the motion, by an angle of the period."""
    c, s = np.cos(angle), np.sin(angle)
    found = case | {"cosine": c * case["cosine"] - s * case["sine"],
                    "sine": s * case["cosine"] + c * case["sine"]}
    found["terms"] = [(pair, n, size, float(phase - n * np.degrees(angle)))
                      for pair, n, size, phase in case["terms"]]
    return found


def shifted(coefficients, angle):
    moved = np.array(coefficients)
    for n in range(1, (len(moved) + 1) // 2):
        c, s = np.cos(n * angle), np.sin(n * angle)
        a, b = coefficients[2 * n - 1], coefficients[2 * n]
        moved[2 * n - 1], moved[2 * n] = c * a - s * b, s * a + c * b
    return moved


def side_turned(words):
    """t1 of every pair with the other sign."""
    def turn(found):
        dofs = [int(dof) for dof in found[1].split(",")]
        dofs[::3] = [-dof for dof in dofs[::3]]
        return "side_1 = " + ", ".join(map(str, dofs))
    return re.sub(r"side_1 = (.*)", turn, words)


def run(words, program, folder, *arguments):
    (folder / "case.nml").write_text(words)
    done = subprocess.run([program, "-q", "case.nml", *arguments], cwd=folder, capture_output=True,
                          text=True, check=False)
    assert done.returncode in (0, 4), done.stderr + words
    return done.returncode == 0


def solved(words, program, folder):
    """Displacements and forces, or nothing."""
    if not run(words.replace("tolerance = 1e-11", "tolerance = 1e-12"), program, folder):
        return None
    with h5py.File(folder / "case.h5") as file:
        return file["coefficients"][0], file["contact/force"][0]


def off(found, wanted, factors=(1.0, 1.0)):
    """The largest difference of displacements or of forces, as a part of their largest."""
    return max(np.abs(a / factor - b).max() / max(np.abs(b).max(), 1e-300)
               for a, b, factor in zip(found, wanted, factors, strict=True))


def copies(case, seed, wanted, program, folder, found, notes):
    """Count the copies that are not the case."""
    def judge(key, copy, wanted, factors=(1.0, 1.0)):
        if copy is None:
            notes.append(f"{key}: not solved")
            found[key] = 1
        elif not off(copy, wanted, factors) < (PLANAR if key == "later" and case["events"]
                                               else SAME):
            notes.append(f"{key}: off by {off(copy, wanted, factors):.1e}")
            found[key] = 1

    for units in UNITS:
        copy, length, force = scaled(case, *units)
        judge("units", solved(text(copy), program, folder), wanted, (length, force))
    turned = case | {"speed": case["speed"] * np.array([-1.0, 1.0])}
    copy = solved(side_turned(text(turned)), program, folder)
    if copy is not None:
        copy[1][:, :, 0] *= -1.0
    judge("turned", copy, wanted)
    angle = 2.0 * np.pi * (1 + seed % 7) / (8 if not case["events"] else 7.3)
    judge("later", solved(text(later(case, angle)), program, folder),
          [shifted(values, angle) for values in wanted])
    apart = case | {"gap": 0.0 * case["gap"], "terms": case["terms"] + [
        (i + 1, 0, float(gap), 30.0 * i) for i, gap in enumerate(case["gap"] / np.cos(np.radians(
            30.0 * np.arange(len(case["gap"])))))]}
    if len(case["gap"]) < 4:
        judge("constant", solved(text(apart), program, folder), wanted)


def slides(case, i, y, eps, force, rates):
    """What slides under pressure in a period [force length], of a pair."""
    n_time, speed, mu = len(y), case["speed"][i], case["mu"][i]
    period = 2.0 * np.pi / case["omega"]
    if case["sliding"] == "steady" and speed.any():
        pace = np.hypot(*speed)
        return period * np.mean(-force[:, 2] * (pace - rates @ speed / pace))
    pressure = np.maximum(-y[:, 2], 0.0)
    step, x = eps * speed * period / n_time, np.zeros(2)
    stride = np.linalg.norm(step) * n_time
    if stride > 0.0:
        x = step / np.linalg.norm(step) * (2.0 * np.abs(y).max() + stride)
    for _ in range(TURNS):
        before, total = x.copy(), 0.0
        for j in range(n_time):
            carried = x + step
            d, limit = y[j, :2] - carried, mu * pressure[j]
            length = np.hypot(*d)
            x = carried if length <= limit else y[j, :2] - d * (limit / length)
            total += 0.5 * (pressure[j] + pressure[j - 1]) * np.hypot(*(x - carried))
        if np.abs(x - before).max() <= 1e-13 * (np.abs(y[:, :2]).max() + stride):
            break
    return total / eps


def worn_text(case, coefficient, cycles, steps=100):
    words = text(case).replace("analysis = 'point'", "analysis = 'wear'")
    words = words.replace("&contact\n", "&contact\narea = 2.0\n")
    return words.replace("tolerance = 1e-11", "tolerance = 1e-12") + "\n".join([
        "&wear", f"coefficient = {coefficient!r}", f"n_cycles = {cycles}",
        "error_tolerance = 1e-4", f"max_steps = {steps}", "/", ""])


def judge_wear(case, coefficient, file, found, notes):
    """Rates and works of every row."""
    n_time = 32768 if case["events"] else case["n_time"]
    eps = np.column_stack([case["kt"], case["kt"], case["kn"]])
    if case["law"] == "dlft":
        eps = rigid_stiffness(case)
    harmonics = np.arange(1, case["harmonics"] + 1)
    tau = 2.0 * np.pi * np.arange(n_time) / n_time
    waves = np.array([np.ones(n_time)] + [f(h * tau) for h in harmonics for f in (np.cos, np.sin)])
    gap, works = gaps(case, tau), []
    rows = range(len(file["wear/depth"]))
    # Many instants take long: the first row and the last.
    for row in {rows[0], rows[-1]} if case["events"] else rows:
        u, said = file["coefficients"][row], file["contact/force"][row]
        depth = file["wear/depth"][row]
        rate = np.zeros_like(u)
        for h in harmonics:
            rate[2 * h - 1], rate[2 * h] = h * u[2 * h], -h * u[2 * h - 1]
        wanted = []
        for i in range(len(gap)):
            at = slice(3 + 3 * i, 6 + 3 * i)
            y = (eps[i][:, None] * (u[:, at].T @ waves + np.array([0.0, 0.0, 1.0])[:, None] * (
                gap[i] + depth[i]))).T
            force = (said[:, i].T @ waves).T
            if case["law"] == "dlft":
                y += force
            rates = case["omega"] * (rate[:, at].T @ waves).T[:, :2]
            if not case["two"]:
                y[:, 1], rates[:, 1] = 0.0, 0.0
            wanted.append(coefficient / 2.0 * slides(case, i, y, eps[i, 0], force, rates))
        difference = np.abs(file["wear/rate"][row] - wanted).max() / max(np.abs(wanted).max(),
                                                                         1e-300)
        if not difference < (BY_EVENTS if case["events"] else RATE):
            found["rate"] = 1
            notes.append(f"row {row}: rate off by {difference:.1e}")
        load = np.pi * (case["cosine"] @ u[2, :3] - case["sine"] @ u[1, :3])
        lost = sum(np.pi * h**2 * case["omega"] * a @ case["damping"] @ a for h in harmonics
                   for a in (u[2 * h - 1], u[2 * h]))
        heat = file["contact/dissipation"][row]
        brought = file["contact/obstacle_work"][row] if "contact/obstacle_work" in file else 0.0
        works.append(abs(load + np.sum(brought) - lost - heat.sum()) / (
            abs(load) + abs(lost) + np.abs(heat).sum()))
    if max(works) > WORK:
        found["work"] = 1
        notes.append(f"work off by {max(works):.1e}")


def wear(case, program, folder, found, notes):
    """Worn by a tenth of the largest gap, at once and in two parts."""
    size = np.abs(case["gap"]).max() + max(term[2] for term in case["terms"])
    if not run(worn_text(case, 1e-20, 1), program, folder):
        return
    with h5py.File(folder / "case.h5") as file:
        fastest, slowest = file["wear/rate"][0].max(), file["wear/rate"][0].min()
    # Vibration that is much faster than a steady surface turns its sliding round.
    if not (fastest > 0.0 and slowest >= 0.0):
        return
    coefficient = float(1e-20 * 0.1 * size / (1000.0 * fastest))
    if not run(worn_text(case, coefficient, 1000), program, folder):
        notes.append("wear not solved")
        return
    found["worn"] = 1
    with h5py.File(folder / "case.h5") as file:
        judge_wear(case, coefficient, file, found, notes)
        wanted = file["wear/depth"][()]
    run(worn_text(case, coefficient, 1000, max(1, len(wanted) // 2)), program, folder)
    (folder / "case.h5").rename(folder / "half.h5")
    run(worn_text(case, coefficient, 1000), program, folder, "--restart", "half.h5")
    with h5py.File(folder / "case.h5") as file:
        depth = file["wear/depth"][()]
    difference = np.inf
    if depth.shape == wanted.shape:
        difference = np.abs(depth - wanted).max() / np.abs(wanted).max()
    if not difference < CONTINUED:
        found["restart"] = 1
        notes.append(f"continued: depths off by {difference:.1e}")


def trial(seed, program, folder):
    case = drawn(seed)
    kind = "events" if case["events"] else case["law"]
    found = {**dict.fromkeys(COLUMNS, 0), "kind": f"{kind}, {case['sliding']}"}
    wanted, notes = solved(text(case), program, folder), []
    if wanted is None:
        return {**found, "failed": 1}
    found["solved"] = 1
    copies(case, seed, wanted, program, folder, found, notes)
    if case["law"] != "regularised" or (case["sliding"] == "steady" and
                                        case["speed"].any(axis=1).all()):
        wear(case, program, folder, found, notes)
    return {**found, "notes": notes}
