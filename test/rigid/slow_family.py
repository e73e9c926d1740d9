"""Slow stick-slip: random chains with massless nodes that rub, driven at a thirtieth of their first
mode, into docs/robustness.md.

    python test/rigid/slow_family.py [--count 200] [--seed 0] [--before OTHER/fw_run]
                                     [-o docs/robustness.md]

Every point that counts as converged is held against its own law, in NumPy: equilibrium of all
harmonics, and forces inside of the friction cone that oppose the sliding (`judge`).
"""
import argparse
import resource
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import h5py
import numpy as np
from cases import run
from project import PROGRAM
from sections import write_section

#: Excitation over the first mode of the chain that slides freely.
SLOW = 1.0 / 30.0
#: A point that takes longer counts as slow [s of processor time].
PATIENCE = 60.0
#: Residual of the equations of motion, as a part of the vibratory load.
BALANCED = 1e-6


def random_case(seed):
    """Two to four masses, one or two of which carry a massless node that rubs behind a spring,
    under a normal load that the vibration changes; friction of 10 to 60 % of what would hold."""
    rng = np.random.default_rng(seed)
    n, n_pairs = int(rng.integers(2, 5)), int(rng.integers(1, 3))
    size = n + 2 * n_pairs
    mass = np.zeros((size, size))
    mass[range(n), range(n)] = rng.uniform(0.3, 1.5, n)
    stiffness = np.zeros((size, size))

    def spring(i, j, value):
        stiffness[i, i] += value
        if j >= 0:
            stiffness[j, j] += value
            stiffness[[i, j], [j, i]] -= value

    for i in range(n):
        spring(i, i - 1, rng.uniform(0.5, 3.0))
    at = rng.permutation(n)[:n_pairs]
    load = np.zeros(size)
    load[rng.integers(n)] = 1.0
    free = stiffness[:n, :n].copy()
    for k, i in enumerate(at):
        t, normal = n + 2 * k, n + 2 * k + 1
        spring(t, int(i), 10.0 ** rng.uniform(0.0, 1.5))
        # Across: the load on the pair follows the motion of its mass.
        spring(normal, int(i), 0.3 * rng.uniform(0.0, 1.0))
        spring(normal, -1, 10.0 ** rng.uniform(0.5, 1.5))
    omega = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass[:n, :n], free)).real.min())
    damping = 2.0 * float(10.0 ** rng.uniform(-3.0, -1.7)) / omega * stiffness
    tangential = n + 2 * np.arange(n_pairs)
    held = np.linalg.inv(stiffness)
    hold = np.abs(np.linalg.solve(held[np.ix_(tangential, tangential)], (held @ load)[tangential]))
    limit = rng.uniform(0.1, 0.6, n_pairs) * np.maximum(hold, 0.05)
    mu = float(rng.uniform(0.2, 0.6))
    static = np.zeros(size)
    static[tangential + 1] = -limit / mu
    harmonics = {"n_harmonics": int(rng.choice([21, 31, 41]))}
    if rng.random() < 0.5:
        harmonics["n_time"] = 1024
    else:
        harmonics["sampling"] = "events"
    contact = {"n_pairs": n_pairs, "law": str(rng.choice(["dlft", "penalty"])), "mu": mu,
               "side_1": [d for t in tangential for d in (int(t) + 1, 0, int(t) + 2)]}
    if contact["law"] == "penalty":
        # Far stiffer than what it stands on, as joints are.
        contact["tangential_stiffness"] = contact["normal_stiffness"] = float(
            10.0 ** rng.uniform(1.5, 3.5))
    return {"case": {"analysis": "point", "threads": 1},
            "model": {"n_dof": size, "mass": mass.ravel().tolist(),
                      "damping": damping.ravel().tolist(),
                      "stiffness": stiffness.ravel().tolist()},
            "contact": contact, "load": {"cosine": load.tolist(), "static": static.tolist()},
            "harmonics": harmonics, "sweep": {"start": float(SLOW * omega)}}


def judge(groups, file):
    """Whether the point balances in every harmonic, and its friction stays within its limits but
    for the ripple of the series."""
    model, n = groups["model"], groups["model"]["n_dof"]
    mass, damping, stiffness = (np.array(model[name]).reshape(n, n)
                                for name in ("mass", "damping", "stiffness"))
    coefficients, force = file["coefficients"][0], file["contact/force"][0]
    omega = file["omega"][0]
    side = np.array(groups["contact"]["side_1"]).reshape(-1, 3)
    off, tau = 0.0, 2.0 * np.pi * np.arange(4096) / 4096
    history = np.repeat(force[0][:, :, None], len(tau), axis=2)
    for k in range((len(coefficients) + 1) // 2):
        z = stiffness - (k * omega)**2 * mass + 1j * k * omega * damping
        u, f = (c[0] if k == 0 else c[2 * k - 1] - 1j * c[2 * k] for c in (coefficients, force))
        reaction = np.zeros(n, dtype=complex)
        for pair, dofs in enumerate(side):
            for c in (0, 2):
                reaction[dofs[c] - 1] += f[pair, c]
        load = {0: groups["load"]["static"], 1: groups["load"]["cosine"]}.get(k, np.zeros(n))
        off = max(off, np.abs(z @ u + reaction - load).max())
        if k > 0:
            history += np.real(f[:, :, None] * np.exp(1j * k * tau))
    limit = groups["contact"]["mu"] * np.abs(history[:, 2]).max(axis=1)
    # Gibbs: the series of a square wave overshoots by 18 %.
    return off <= BALANCED and (np.abs(history[:, 0]).max(axis=1) <= 1.25 * limit).all()


def verdict(folder, groups, program):
    """Whether it converged, whether the judge agrees, seconds, and what served."""
    begin = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    run(folder, groups, status=(0, 4), program=program, seconds=400)
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - begin
    with h5py.File(folder / "case.h5") as file:
        good = bool(file["converged"][0])
        names = [x.decode() if isinstance(x, bytes) else str(x)
                 for x in file["served_by"].attrs["names"]]
        right = not good or bool(judge(groups, file))
        return good, right, seconds, names[int(file["served_by"][0])]


def measure(seeds, programs):
    """Verdicts of each program."""
    rows = {label: [] for label in programs}
    with tempfile.TemporaryDirectory() as name:
        for seed in seeds:
            groups = random_case(seed)
            for label, program in programs.items():
                rows[label].append(verdict(Path(name), groups, program))
                if not rows[label][-1][0]:
                    print(f"seed {seed}, {label}: not converged, {rows[label][-1][2]:.1f} s "
                          f"{groups['contact']['law']} {groups['harmonics']}", file=sys.stderr)
    return rows


def table(rows):
    """Rows of the document."""
    lines = ["", "| program | points | converged | false, counted as converged | above 60 s "
             "| longest [s] | served by |", "|---|---|---|---|---|---|---|"]
    for label, verdicts in rows.items():
        served = [v[3] for v in verdicts if v[0]]
        words = ", ".join(f"{word} {served.count(word)}" for word in sorted(set(served)))
        lines.append(f"| {label} | {len(verdicts)} | {len(served)} "
                     f"| {sum(not v[1] for v in verdicts)} "
                     f"| {sum(v[2] > PATIENCE for v in verdicts)} "
                     f"| {max(v[2] for v in verdicts):.0f} | {words} |")
    return [*lines, ""]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="the first")
    parser.add_argument("--before", help="program to compare with")
    parser.add_argument("-o", "--output", type=Path, help="document with the section `slow`")
    options = parser.parse_args()
    programs = {"now": PROGRAM} | ({"before": options.before} if options.before else {})
    lines = table(measure(range(options.seed, options.seed + options.count), programs))
    print("\n".join(lines))
    if options.output:
        write_section("slow", lines, options.output)


if __name__ == "__main__":
    main()
