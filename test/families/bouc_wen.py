"""Joints of Bouc and Wen, against their differential equation."""
from pathlib import Path

import joints
import numpy as np
from scipy.integrate import solve_ivp

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
ALSO = [Path(joints.__file__)]


def draw_joint(random):
    return {"bouc_wen_exponent": int(random.integers(1, 3)),
            "bouc_wen_beta": float(random.choice([0.5, random.uniform(0.5, 1.0)]))}


def turned(joint, steps, z, kept=None):
    """z after a period of steps of y over the limit, by the classical method."""
    n, beta = joint["bouc_wen_exponent"], joint["bouc_wen_beta"]

    def rate(z, ds):
        w = z if ds > 0.0 else -z
        return 1.0 - abs(z)**n * (1.0 if w > 0.0 else 1.0 - 2.0 * beta)

    for k, ds in enumerate(steps):
        a = rate(z, ds)
        b = rate(z + 0.5 * ds * a, ds)
        c = rate(z + 0.5 * ds * b, ds)
        z += ds * (a + 2.0 * b + 2.0 * c + rate(z + ds * c, ds)) / 6.0
        if kept is not None:
            kept[k] = z
    return z


def march(joint, y):
    """Force at the instants: z that repeats lies where a turn neither rises nor falls."""
    steps = (np.diff(np.append(y, y[0])) / joint["limit"]).tolist()
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
    inverse = np.linalg.inv(case["mass"])
    limit = np.array([j["limit"] for j in all_joints])
    exponent = np.array([j["bouc_wen_exponent"] for j in all_joints])
    beta = np.array([j["bouc_wen_beta"] for j in all_joints])
    rows = np.zeros((len(all_joints), n))
    for i, joint in enumerate(all_joints):
        rows[i, joint["dof"] - 1] = 1.0
        if joint["other"]:
            rows[i, joint["other"] - 1] = -1.0
    pull = np.array([j["stiffness"] for j in all_joints]) / limit

    def slope(t, x):
        displacement, velocity, z = x[:n], x[n:2 * n], x[2 * n:]
        load = case["static"] + case["cosine"] * np.cos(case["omega"] * t) \
            + case["sine"] * np.sin(case["omega"] * t)
        load = load - case["stiffness"] @ displacement - case["damping"] @ velocity \
            - rows.T @ (limit * z)
        ds = pull * (rows @ velocity)
        shape = np.where(z * ds > 0.0, 1.0, 1.0 - 2.0 * beta)
        return np.concatenate([velocity, inverse @ load, ds * (1.0 - np.abs(z)**exponent * shape)])

    steps = 256
    period = 2.0 * np.pi / case["omega"]
    _, slopes = joints.waves(case["harmonics"], np.zeros(1))
    first, _ = joints.waves(case["harmonics"], np.zeros(1))
    z = [march(j, j["stiffness"] * joints.elongation(j, u) @ base)[0] / j["limit"]
         for j in all_joints]
    start = np.concatenate([u.T @ first[:, 0], case["omega"] * u.T @ slopes[:, 0], z])
    times = period * (joints.PERIODS - 1 + np.arange(steps) / steps)
    run = solve_ivp(slope, (0.0, times[-1]), start, method="DOP853", rtol=1e-9, atol=1e-11,
                    t_eval=times)
    rows_of, _ = joints.waves(case["harmonics"], 2.0 * np.pi * np.arange(steps) / steps)
    return np.array([joints.projected(run.y[d], rows_of) for d in range(n)]).T


def trial(seed, program, folder):
    return joints.judged(joints.drawn(seed, draw_joint), "bouc_wen",
                         ("bouc_wen_exponent", "bouc_wen_beta"), march, integrate, program, folder)
