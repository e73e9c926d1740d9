"""Joints of Bouc and Wen, against their differential equation."""
import ctypes
import os
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import joints
import numpy as np
from scipy.integrate import DOP853

TITLE = "Joints of Bouc and Wen"
TEXT = """
Chains of one to six masses with one to four joints, between masses or to the ground: n = 1 and 2,
beta from 0.5 to 1, limits over one and a half decades, loads over four, a static load in a third;
1 to 15 harmonics, one frequency from half to 2.5 times the lowest one without joints.

The judge takes the displacements and the forces of the result. The balance of every harmonic is
written anew, and has to hold to 1e-7 of the load. The differential equation of each joint is
integrated over 8,192 instants (Runge and Kutta), with the start that repeats between those of both
limits: coefficients within 2e-4 of the largest force, and the work. Where there are 5 harmonics or
more in a third of the cases the whole structure is integrated for 25 periods from the solution on
(DOP853, 1e-9): it stays there, but for what the harmonics leave (0.5/H**2 of the largest
amplitude).
"""
COUNT = 100
SMALL = (0, 1, 3, 4)
COLUMNS, ZERO = joints.COLUMNS, joints.ZERO
SOURCE = Path(__file__).with_suffix(".c")
ALSO = [Path(joints.__file__), SOURCE]


def draw_joint(random):
    return {"bouc_wen_exponent": int(random.integers(1, 3)),
            "bouc_wen_beta": float(random.choice([0.5, random.uniform(0.5, 1.0)]))}


class Chain(ctypes.Structure):
    """struct chain of bouc_wen.c."""

    _fields_ = [("n", ctypes.c_int), ("m", ctypes.c_int), ("omega", ctypes.c_double)] + [
        (name, ctypes.c_void_p) for name in (
            "inverse_mass", "damping", "stiffness", "constant", "cosine", "sine", "rows", "pull",
            "limit", "exponent", "beta")]


@cache
def library():
    """bouc_wen.c, compiled once in a process."""
    target = Path(tempfile.mkdtemp()) / "bouc_wen.so"
    subprocess.run([os.environ.get("CC", "cc"), "-O2", "-shared", "-fPIC", SOURCE, "-o", target,
                    "-lm"], check=True)
    made, real, array = ctypes.CDLL(str(target)), ctypes.c_double, ctypes.c_void_p
    made.one_step.restype = made.turned.restype = real
    made.one_step.argtypes = [real] * 4
    made.turned.argtypes = [real, real, ctypes.c_int, array, real, array]
    made.follow.argtypes = [array] * 6 + [real, real, array, ctypes.c_int, array, array]
    return made


def turned(joint, steps, z, kept=None):
    """z after a period of steps of y over the limit, by the classical method."""
    return library().turned(joint["bouc_wen_exponent"], joint["bouc_wen_beta"], len(steps),
                            steps.ctypes.data, z, None if kept is None else kept.ctypes.data)


def march(joint, y):
    """Force at the instants: z that repeats lies where a turn neither rises nor falls."""
    steps = np.diff(np.append(y, y[0])) / joint["limit"]
    low, high = -1.0, 1.0
    gain = [turned(joint, steps, low) - low, turned(joint, steps, high) - high]
    side = 0
    for _ in range(60):
        # Regula falsi of Illinois.
        z = low if gain[0] == gain[1] else (low * gain[1] - high * gain[0]) / (gain[1] - gain[0])
        rise = turned(joint, steps, z) - z
        if abs(rise) < 1e-13 or high - low < 1e-12:
            break
        if rise > 0.0:
            low, gain[0] = z, rise
            gain[1] *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            high, gain[1] = z, rise
            gain[0] *= 0.5 if side == -1 else 1.0
            side = -1
    kept = np.empty(len(y))
    last = turned(joint, steps, z, kept)
    return joint["limit"] * np.roll(np.append(kept[:-1], last), 1)


def integrate(case, u, base):
    if case["harmonics"] < 5 or int(1e6 * case["omega"]) % 3:
        return None
    all_joints, n = case["joints"], len(case["mass"])
    limit = np.array([j["limit"] for j in all_joints])
    rows = np.zeros((len(all_joints), n))
    for i, joint in enumerate(all_joints):
        rows[i, joint["dof"] - 1] = 1.0
        if joint["other"]:
            rows[i, joint["other"] - 1] = -1.0
    arrays = [np.ascontiguousarray(part, float) for part in (
        np.linalg.inv(case["mass"]), case["damping"], case["stiffness"], case["static"],
        case["cosine"], case["sine"], rows,
        np.array([j["stiffness"] for j in all_joints]) / limit, limit,
        [j["bouc_wen_exponent"] for j in all_joints], [j["bouc_wen_beta"] for j in all_joints])]
    chain = Chain(n, len(all_joints), case["omega"], *(part.ctypes.data for part in arrays))
    steps = 256
    period = 2.0 * np.pi / case["omega"]
    _, slopes = joints.waves(case["harmonics"], np.zeros(1))
    first, _ = joints.waves(case["harmonics"], np.zeros(1))
    z = [march(j, j["stiffness"] * joints.elongation(j, u) @ base)[0] / j["limit"]
         for j in all_joints]
    start = np.concatenate([u.T @ first[:, 0], case["omega"] * u.T @ slopes[:, 0], z])
    times = period * (joints.PERIODS - 1 + np.arange(steps) / steps)
    tables = [np.ascontiguousarray(part, float) for part in (
        DOP853.A, DOP853.B, DOP853.C, DOP853.E3, DOP853.E5)]
    moved = np.empty((steps, n))
    wrong = library().follow(ctypes.byref(chain), *(part.ctypes.data for part in tables), 1e-9,
                             1e-11, start.ctypes.data, steps, times.ctypes.data,
                             moved.ctypes.data)
    assert not wrong, "the integration in time breaks off"
    rows_of, _ = joints.waves(case["harmonics"], 2.0 * np.pi * np.arange(steps) / steps)
    return np.array([joints.projected(moved[:, d], rows_of) for d in range(n)]).T


def trial(seed, program, folder):
    return joints.judged(joints.drawn(seed, draw_joint), "bouc_wen",
                         ("bouc_wen_exponent", "bouc_wen_beta"), march, integrate, program, folder)
