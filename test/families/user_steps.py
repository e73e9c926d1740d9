"""Laws of a user that remember (&user with states), against forces of the judge's own."""
import subprocess
from pathlib import Path

import bouc_wen
import h5py
import joints
import numpy as np
from project import ROOT

TITLE = "Laws of a user with states: forces of another origin"
TEXT = """
Chains of one to six masses with one to four joints, between masses or to the ground, each a
function in C that is stepped from instant to instant: a slider on a spring, Bouc and Wen's joint
with any exponent from 1 to 2.5, a spring that relaxes (with a state that never moves beside it),
and a slider beside such a spring. Relaxation takes 0.1 to 10 over the frequency, limits span one
and a half decades, loads four; there is a static load in a third. Slopes come from the function or
from differences; 1 to 15 harmonics, 1,024 instants, one frequency from half to 2.5 times the lowest
one without joints, twenty seconds at most.

The judge takes the displacements and the forces of the result. The balance of every harmonic is
written anew, and has to hold to 1e-7 of the load. Forces are made anew over 8,192 instants: sliders
are marched in NumPy, Bouc and Wen's equation is integrated (Runge and Kutta), relaxation follows
from the response of each harmonic. Coefficients have to agree within 5e-3 of the largest force, and
the work. Where there are 5 harmonics or more in a third of the cases the whole structure is
integrated for 25 periods from the solution on, by central differences: it stays there, but for what
the harmonics leave (0.5/H**2 of the largest amplitude).
"""
COUNT = 100
SMALL = (0, 1, 2, 5)
COLUMNS = {"solved": "solved", "failed": "ended in words", "static": "with a static load",
           "differences": "by differences", "integrated": "integrated in time",
           "balance": "balance off", "force": "forces off", "work": "work off",
           "motion": "motion off"}
ZERO = ("balance", "force", "work", "motion")
SOURCE = Path(__file__).with_suffix(".c")
ALSO = [Path(joints.__file__), Path(bouc_wen.__file__), bouc_wen.SOURCE, SOURCE]
LAWS = ("slider", "bouc_wen", "maxwell", "both")
INSTANTS, N_TIME, STEPS = joints.INSTANTS, 1024, 2048
#: Of a run: differences of many steps take long, and a point that is not found by then is not.
SECONDS = 20.0
#: Of the load; of the largest force: what 1,024 instants leave of 15 harmonics, (15 pi/1024)^2.
BALANCE, FORCE = 1e-7, 5e-3


def draw_joint(random):
    return {"law": str(random.choice(LAWS)), "bouc_wen_exponent": random.uniform(1.0, 2.5),
            "bouc_wen_beta": float(random.choice([0.5, random.uniform(0.5, 1.0)])),
            "relaxes": 10.0**random.uniform(-1.0, 1.0)}


def text(case, library, derivative):
    def row(values):
        return ", ".join(f"{float(v)!r}" for v in np.ravel(values))

    found = case["joints"]
    constants = [[j["stiffness"], j["limit"],
                  j["bouc_wen_exponent"] if j["law"] == "bouc_wen" else j["relaxes"],
                  j["bouc_wen_beta"]] for j in found]
    lines = ["&case", "analysis = 'point'", f"max_seconds = {SECONDS}", "/", "&model",
             f"n_dof = {len(case['mass'])}"]
    lines += [f"{key} = {row(case[key])}" for key in ("mass", "damping", "stiffness")]
    lines += ["/", "&user", f"n_elements = {len(found)}", f"library = '{library}'",
              "symbol = " + ", ".join(f"'{j['law']}'" for j in found),
              "side_1 = " + ", ".join(str(j["dof"]) for j in found),
              "side_2 = " + ", ".join(str(j["other"]) for j in found),
              "n_parameters = 4", f"parameters = {row(constants)}", f"derivative = '{derivative}'"]
    lines += ["/", "&load"] + [f"{key} = {row(case[key])}" for key in ("cosine", "sine", "static")]
    lines += ["/", "&harmonics", f"n_harmonics = {case['harmonics']}", f"n_time = {N_TIME}",
              "parity = 'all'", "/", "&sweep", f"start = {float(case['omega'])!r}", "/", "&solver",
              "tolerance = 1e-10", "/"]
    return "\n".join(lines) + "\n"


class Slider:
    """Friction of a predicted force, from the unstrained position on."""

    def __init__(self, limit):
        self.limit, self.position = limit, 0.0

    def __call__(self, y):
        force = min(max(y - self.position, -self.limit), self.limit)
        self.position = y - force
        return force


class Relaxing:
    """A force that decays towards zero, over steps of dt in which y is linear."""

    def __init__(self, time, dt, y, force):
        self.kept = np.exp(-dt / time)
        self.gain = time / dt * (1.0 - self.kept)
        self.y, self.force = y, force

    def __call__(self, y):
        self.force = self.kept * self.force + self.gain * (y - self.y)
        self.y = y
        return self.force


class Joint:
    """Bouc and Wen's joint from a force on."""

    def __init__(self, joint, y, force):
        self.joint, self.y, self.z = joint, y, force / joint["limit"]

    def __call__(self, y):
        self.z = bouc_wen.library().one_step(
            self.joint["bouc_wen_exponent"], self.joint["bouc_wen_beta"],
            (y - self.y) / self.joint["limit"], self.z)
        self.y = y
        return self.joint["limit"] * self.z


def relaxed(joint, y, case):
    """Coefficients of a relaxing spring from those of y = k u."""
    force = np.zeros_like(y)
    for h in range(1, case["harmonics"] + 1):
        turn = 1j * h * case["omega"] * joint["relaxes"]
        answer = turn / (1.0 + turn) * (y[2 * h - 1] - 1j * y[2 * h])
        force[2 * h - 1:2 * h + 1] = answer.real, -answer.imag
    return force


def marched(joint, y, base, case):
    """Force at the instants, and what goes on from the first of them for a step of 1/STEPS."""
    values = y @ base
    force, parts = np.zeros(len(values)), []
    dt = 2.0 * np.pi / case["omega"] / STEPS
    if joint["law"] in ("slider", "both"):
        slider = Slider(joint["limit"])
        # One step strains the element to where the first turn begins.
        slider(values[-len(values) // N_TIME])
        for _ in range(8):
            force = np.array([slider(value) for value in values.tolist()])
        parts.append(slider)
    if joint["law"] == "bouc_wen":
        force = bouc_wen.march(joint, values)
        parts.append(Joint(joint, values[-1], force[-1]))
    if joint["law"] in ("maxwell", "both"):
        own = relaxed(joint, y, case) @ base
        force = force + own
        back = -len(values) // STEPS
        parts.append(Relaxing(joint["relaxes"], dt, values[back], own[back]))
    return force, lambda value: sum(part(value) for part in parts)


def build(folder):
    library = folder / "steps.so"
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-I", ROOT / "include", "-o", library, SOURCE,
                    "-lm"], check=True, timeout=60)
    return library


def trial(seed, program, folder):
    case = joints.drawn(seed, draw_joint)
    for joint in case["joints"]:
        joint["relaxes"] /= case["omega"]
    derivative = ("given", "difference")[seed % 2]
    build(folder)
    (folder / "case.nml").write_text(text(case, "steps.so", derivative))
    done = subprocess.run([program, "case.nml"], cwd=folder, capture_output=True, text=True,
                          check=False, timeout=300)
    found = dict.fromkeys(COLUMNS, 0)
    if done.returncode in (4, 6):
        return {**found, "kind": "not solved", "failed": 1,
                "notes": [line for line in done.stderr.splitlines() if line][-1:]}
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / "case.h5") as file:
        u, force, work = file["coefficients"][0], file["user/force"][0], file["user/work"][0]
    base, slopes = joints.waves(case["harmonics"], 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS)
    load = np.linalg.norm([case["cosine"], case["sine"], case["static"]])
    found.update(solved=1, static=int(np.any(case["static"])),
                 differences=int(derivative == "difference"),
                 balance=int(joints.balance_of(case, u, force) > BALANCE * load))
    answers, reach, notes = [], 0.0, []
    for i, joint in enumerate(case["joints"]):
        e = joints.elongation(joint, u)
        y = joint["stiffness"] * e
        values, answer = marched(joint, y, base, case)
        answers.append(answer)
        if joint["law"] != "maxwell":
            reach = max(reach, np.ptp(y @ base) / (2.0 * joint["limit"]))
        largest = np.abs(values).max()
        off = np.abs(joints.projected(values, base) - force[:, i, 0]).max() / largest
        done_work = 2.0 * np.pi * np.mean(values * (e @ slopes))
        lost = abs(done_work - work[i]) / (largest * np.ptp(e) * 4.0)
        found["force"] |= int(off > FORCE)
        found["work"] |= int(lost > FORCE)
        if max(off, lost) > FORCE:
            notes.append(f"{joint['law']}: force off by {off:.1e}, work by {lost:.1e}")
    if case["harmonics"] >= 5 and not int(1e6 * case["omega"]) % 3 and case["omega"] >= 0.1:
        later = joints.stepped(case, u, base, answers, STEPS)
        moved = np.abs(later - u).max() / np.abs(u[1:]).max()
        found.update(integrated=1, motion=int(moved > 0.5 / case["harmonics"]**2))
        if found["motion"]:
            notes.append(f"the motion moves by {moved:.1e}")
    kind = "micro-slip" if reach < 0.5 else "partial slip" if reach < 2.0 else "gross slip"
    return {**found, "kind": kind, "notes": notes}
