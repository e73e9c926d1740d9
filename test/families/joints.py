"""Chains with hysteretic joints, drawn and judged: what the families `iwan` and `bouc_wen` share.

A joint is {"law", "dof", "other", "limit", "stiffness", "constants"}; `other` is 0 for the ground.
"""
import subprocess

import h5py
import numpy as np

INSTANTS = 8192
COLUMNS = {"solved": "solved", "failed": "ended in words", "static": "with a static load",
           "integrated": "integrated in time", "balance": "balance off", "force": "forces off",
           "limit": "force beyond its limit", "work": "work off", "motion": "motion off"}
ZERO = ("balance", "force", "limit", "work", "motion")
#: Of the load; of the largest force: what sampling leaves.
BALANCE, FORCE = 1e-7, 2e-4
#: Periods that are integrated from the solution on.
PERIODS = 25


def drawn(seed, draw_joint):
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 7))
    springs = random.uniform(0.5, 2.0, n + 1)
    stiffness = np.diag(springs[:-1] + springs[1:]) \
        - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    mass = np.diag(random.uniform(0.5, 2.0, n))
    damping = random.uniform(0.01, 0.05) * mass + random.uniform(0.005, 0.05) * stiffness
    joints = []
    for _ in range(int(random.integers(1, 5))):
        dof = int(random.integers(1, n + 1))
        other = int(random.integers(0, n + 1))
        joints.append({"dof": dof, "other": 0 if other == dof else other,
                       "limit": 10.0**random.uniform(-1.0, 0.5),
                       "mu": random.uniform(0.1, 0.8), "stiffness": random.uniform(0.2, 3.0),
                       **draw_joint(random)})
    first = np.sqrt(np.linalg.eigvalsh(np.linalg.solve(mass, stiffness)).real.clip(1e-6).min())
    size = 10.0**random.uniform(-2.5, 1.5)
    return {"mass": mass, "damping": damping, "stiffness": stiffness, "joints": joints,
            "cosine": size * random.normal(size=n), "sine": size * random.normal(size=n),
            "static": (0.5 * random.normal(size=n) if random.random() < 0.35 else np.zeros(n)),
            "omega": first * random.uniform(0.5, 2.5),
            "harmonics": int(random.choice([1, 2, 3, 5, 7, 9, 12, 15]))}


def text(case, law, constants):
    def row(values):
        return ", ".join(f"{float(v)!r}" for v in np.ravel(values))

    joints = case["joints"]
    lines = ["&case", "analysis = 'point'", "/", "&model", f"n_dof = {len(case['mass'])}"]
    lines += [f"{key} = {row(case[key])}" for key in ("mass", "damping", "stiffness")]
    lines += ["/", "&contact", f"n_pairs = {len(joints)}", f"law = '{law}'",
              "side_1 = " + ", ".join(f"{j['dof']}, 0, 0" for j in joints),
              "side_2 = " + ", ".join(f"{j['other']}, 0, 0" for j in joints),
              "mu = " + row([j["mu"] for j in joints]),
              "normal_load = " + row([j["limit"] / j["mu"] for j in joints]),
              "tangential_stiffness = " + row([j["stiffness"] for j in joints])]
    lines += [f"{name} = {row([j[name] for j in joints])}" for name in constants]
    lines += ["/", "&load"] + [f"{key} = {row(case[key])}" for key in ("cosine", "sine", "static")]
    lines += ["/", "&harmonics", f"n_harmonics = {case['harmonics']}", "parity = 'all'", "/",
              "&sweep", f"start = {float(case['omega'])!r}", "/", "&solver", "tolerance = 1e-10",
              "/"]
    return "\n".join(lines) + "\n"


def waves(n, tau):
    """Base functions of 0..n harmonics at angles (2n+1, tau), and their derivatives."""
    rows, slopes = [np.ones(len(tau))], [np.zeros(len(tau))]
    for h in range(1, n + 1):
        rows += [np.cos(h * tau), np.sin(h * tau)]
        slopes += [-h * np.sin(h * tau), h * np.cos(h * tau)]
    return np.array(rows), np.array(slopes)


def projected(values, base):
    found = 2.0 * base @ values / len(values)
    found[0] *= 0.5
    return found


def balance_of(case, u, force):
    """Largest residual of all harmonics, in complex amplitudes."""
    omega, worst = case["omega"], 0.0
    for h in range(case["harmonics"] + 1):
        at = slice(0, 1) if h == 0 else slice(2 * h - 1, 2 * h + 1)
        turn = np.array([1.0]) if h == 0 else np.array([1.0, -1.0j])
        z = case["stiffness"] - (h * omega)**2 * case["mass"] + 1j * h * omega * case["damping"]
        rest = z @ (turn @ u[at])
        for i, joint in enumerate(case["joints"]):
            lam = turn @ force[at, i, 0]
            rest[joint["dof"] - 1] += lam
            if joint["other"]:
                rest[joint["other"] - 1] -= lam
        rest -= {0: case["static"], 1: case["cosine"] - 1j * case["sine"]}.get(h, 0.0)
        worst = max(worst, np.abs(rest).max())
    return worst


def elongation(joint, u):
    """Relative displacement of a joint in columns of dofs."""
    own = u[..., joint["dof"] - 1]
    return own - u[..., joint["other"] - 1] if joint["other"] else own


def judged(case, law, constants, march, integrate, program, folder):
    """Counts of a case. march(joint, y): the force of a period of y = k u, from the assembly or the
    one that repeats; integrate(case, u, base): the motion after some periods, or None."""
    (folder / "case.nml").write_text(text(case, law, constants))
    done = subprocess.run([program, "-q", "case.nml"], cwd=folder, capture_output=True, text=True,
                          check=False)
    found = dict.fromkeys(COLUMNS, 0)
    if done.returncode == 4:
        return {**found, "kind": "not solved", "failed": 1}
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / "case.h5") as file:
        u, force = file["coefficients"][0], file["contact/force"][0]
        dissipation = file["contact/dissipation"][0]
    tau = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
    base, slopes = waves(case["harmonics"], tau)
    load = np.linalg.norm([case["cosine"], case["sine"], case["static"]])
    found.update(solved=1, static=int(np.any(case["static"])),
                 balance=int(balance_of(case, u, force) > BALANCE * load))
    reach = 0.0
    for i, joint in enumerate(case["joints"]):
        e = elongation(joint, u)
        y = joint["stiffness"] * e @ base
        reach = max(reach, np.ptp(y) / (2.0 * joint["limit"]))
        values = march(joint, y)
        largest = np.abs(values).max()
        found["force"] |= int(np.abs(projected(values, base) - force[:, i, 0]).max()
                              > FORCE * largest)
        # No coefficient of a force within its limit is larger than that of the square wave.
        square = 4.0 / np.pi * joint["limit"]
        found["limit"] |= int(np.abs(force[:, i, 0]).max() > square * (1.0 + 1e-9))
        work = 2.0 * np.pi * np.mean(values * (e @ slopes))
        found["work"] |= int(abs(work - dissipation[i]) > FORCE * largest * np.ptp(e) * 4.0)
    later = integrate(case, u, base)
    if later is not None:
        moved = np.abs(later - u).max() / np.abs(u[1:]).max()
        # What a few harmonics leave: 0.02 of it with 5, 2e-3 with 15; static loads of Bouc and
        # Wen's joint creep on.
        found.update(integrated=1, motion=int(moved > 0.5 / case["harmonics"]**2))
    found["kind"] = ("micro-slip" if reach < 0.5 else "partial slip" if reach < 2.0 else
                     "gross slip")
    return found


def stepped(case, u, base, answers, steps):
    """Coefficients of the last of PERIODS by central differences from a solution on; answers[i](y):
    force of joint i as its displacement goes on."""
    period = 2.0 * np.pi / case["omega"]
    dt = period / steps
    tau = 2.0 * np.pi * np.arange(-1, steps) / steps
    rows, _ = waves(case["harmonics"], tau)
    before, now = u.T @ rows[:, 0], u.T @ rows[:, 1]
    left = np.linalg.inv(case["mass"] / dt**2 + case["damping"] / (2.0 * dt))
    right = case["mass"] / dt**2 - case["damping"] / (2.0 * dt)
    twice = 2.0 * case["mass"] / dt**2 - case["stiffness"]
    kept = np.empty((steps, len(now)))
    for k in range(PERIODS * steps):
        angle = 2.0 * np.pi * (k % steps) / steps
        rest = case["static"] + case["cosine"] * np.cos(angle) + case["sine"] * np.sin(angle)
        for joint, answer in zip(case["joints"], answers, strict=True):
            lam = answer(joint["stiffness"] * elongation(joint, now))
            rest[joint["dof"] - 1] -= lam
            if joint["other"]:
                rest[joint["other"] - 1] += lam
        kept[k % steps] = now
        before, now = now, left @ (rest + twice @ now - right @ before)
    rows, _ = waves(case["harmonics"], 2.0 * np.pi * np.arange(steps) / steps)
    return np.array([projected(kept[:, d], rows) for d in range(kept.shape[1])]).T
