"""Random cases of given amplitude, judged by equations of a code of its own, into
docs/robustness.md.

    python test/oracles/control_family.py [--count 200] [--seed 0] [-o docs/robustness.md]

All laws, one and two tangential directions, preload and separation, springs, 1 to 6 pairs; three
amplitudes at two frequencies each, from a tenth to ten times that of the load of the case. Judged:
the amplitude; equilibrium of every harmonic under the load that was found; and, of laws whose
instants are given (`penalty`, `dlft`), the force that the law makes of the motion. What has not
converged is counted.
"""
import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
sys.path.insert(0, str(Path(__file__).resolve().parent))
import h5py
import numpy as np
import slow_balance
from cases import merged, run
from sections import write_section
from sensitivity_family import random_case
from slow_balance import automatic_penalty, equilibrium, law_defect, pair_rows

#: Residual over the load: that of the program, and what cancels in a motion much larger than it.
TOLERANCE = 1e-9
#: Instants that both follow, where the law is one of instants.
INSTANTS = 256
#: Turns of the march of that code: slip that turns in two directions settles slowly.
slow_balance.TURNS = 1000


def controlled_case(seed):
    """A random case, every third with two tangential directions, and what it is asked for."""
    rng = np.random.default_rng(1000 + seed)
    groups, _ = random_case(seed)
    n = groups["model"]["n_dof"]
    contact = groups["contact"]
    law = contact["law"]
    side = np.reshape(contact["side_1"], (-1, 3))
    used = int(np.abs(side).max())
    if law in ("penalty", "dlft") and rng.random() < 0.4 and n > used:
        # A second direction on a dof that no pair has.
        side[0, 1] = used + 1
        contact["side_1"] = side.ravel().tolist()
    harmonics = {}
    if law in ("penalty", "dlft"):
        harmonics = {"n_time": INSTANTS, "sampling": "uniform", "parity": "all"}
    omega = groups["sweep"]["start"]
    return merged(groups, {
        "case": {"analysis": "frf"}, "harmonics": harmonics, "output": {"observe": None},
        "sweep": {"start": None, "values": [omega, 1.07 * omega]},
        "load": {"harmonic_scale": 1.0},
        "control": {"observed": int(rng.integers(1, n + 1)),
                    "of": str(rng.choice(["first_harmonic", "first_harmonic", "largest"]))}})


def linear_amplitude(groups):
    """First harmonic of the controlled place with open contact: a size to start from."""
    n = groups["model"]["n_dof"]
    mass, stiffness = (np.reshape(groups["model"][key], (n, n)) for key in ("mass", "stiffness"))
    omega = groups["sweep"]["values"][0]
    damping = 2.0 * groups["model"]["modal_damping"] * omega * mass
    u = np.linalg.solve(stiffness - omega**2 * mass + 1j * omega * damping,
                        np.array(groups["load"]["cosine"]))
    return abs(u[groups["control"]["observed"] - 1])


def modal_damping(mass, stiffness, ratio):
    """Damping matrix of one ratio for all modes."""
    c = np.linalg.cholesky(mass)
    inverse = np.linalg.inv(c)
    values, vectors = np.linalg.eigh(inverse @ stiffness @ inverse.T)
    root = c @ vectors
    return root @ np.diag(2.0 * ratio * np.sqrt(np.maximum(values, 0.0))) @ root.T


def spring_force(groups, displacement):
    """Cubic springs to the ground, all harmonics by 1024 instants."""
    force = np.zeros_like(displacement)
    if "spring" not in groups:
        return force
    tau = 2.0 * np.pi * np.arange(1024) / 1024
    h = len(displacement) // 2
    basis = np.array([np.ones(1024)] + [f(k * tau) for k in range(1, h + 1)
                                        for f in (np.cos, np.sin)])
    dof = groups["spring"]["side_1"][0] - 1
    history = groups["spring"]["coefficient"] * (basis.T @ displacement[:, dof])**3
    force[:, dof] = 2.0 / 1024 * basis @ history
    force[0, dof] /= 2.0
    return force


def point_errors(groups, matrices, omega, row, force, scale, held_by=None):
    """Residual of the equilibrium, and defect of the law (nan where it is not judged); `held_by` is
    the stiffness that gives rigid pairs their eps, where it is another."""
    n = groups["model"]["n_dof"]
    contact = groups["contact"]
    side = np.reshape(contact["side_1"], (-1, 3))
    rows = [pair_rows(one, (0, 0, 0), n) for one in side]
    load = np.zeros_like(row)
    load[0] = groups["load"]["static"]
    load[1] = scale * np.array(groups["load"]["cosine"])
    total = spring_force(groups, row)
    for k, one in enumerate(rows):
        total = total + force[:, k] @ one
    # Relative to the forces that balance, which near a resonance are many times the load.
    mass, _, stiffness = matrices
    inner = np.linalg.norm(stiffness @ row.T) + omega**2 * np.linalg.norm(mass @ row[1:3].T)
    error = equilibrium(matrices, omega, row, total, load) * np.linalg.norm(load) / inner
    law = contact["law"]
    if law not in ("penalty", "dlft"):
        return error, float("nan")
    if law == "dlft":
        held = list(rows)
        spring = groups.get("spring", {"side_1": [0]})["side_1"][0]
        if spring and not np.any(np.abs(side) == spring):
            # The elongation of a spring is a coordinate too: it rests where others are moved.
            # Where a pair moves that dof, the two are one coordinate.
            held.append(pair_rows((spring, 0, 0), (0, 0, 0), n))
        held_by = matrices[2] if held_by is None else held_by
        stiffnesses = automatic_penalty(held_by, np.concatenate(held)).reshape(-1, 3)
    else:
        stiffnesses = np.zeros((len(side), 3))
        stiffnesses[:, :2] = np.array(contact["tangential_stiffness"])[:, None]
        stiffnesses[:, :2] *= side[:, :2] != 0
        if "normal_stiffness" in contact:
            stiffnesses[:, 2] = np.array(contact["normal_stiffness"])
    gap = contact.get("gap", [0.0] * len(side))
    pressed = contact.get("normal_load", [0.0] * len(side))
    defects = [0.0]
    for k, one in enumerate(rows):
        if np.abs(force[:, k]).max() <= 1e-9 * np.abs(load).max():
            continue
        defects.append(law_defect(force[:, k], row @ one.T, gap[k], contact["mu"][k],
                                  stiffnesses[k], INSTANTS, law == "dlft", pressed[k]))
    return error, max(defects)


def judged(folder, seed, *, along=None):
    """What became of a case: counts by word, and the worst error; `along` up to a frequency that is
    so many times the first, by arc length."""
    groups = controlled_case(seed)
    a = linear_amplitude(groups) * groups["load"]["harmonic_scale"]
    groups = merged(groups, {"control": {"amplitude": [0.1 * a, a, 10.0 * a]}})
    if along is not None:
        start = groups["sweep"]["values"][0]
        groups = merged(groups, {"control": {"amplitude": [0.3 * a, 2.0 * a]}, "sweep": {
            "values": None, "start": start, "end": along * start, "n_points": 9,
            "continuation": "arclength", "max_points": 100}})
    found = Counter(cases=1)
    done = run(folder, groups, status=(0, 4), seconds=300)
    n = groups["model"]["n_dof"]
    mass, stiffness = (np.reshape(groups["model"][key], (n, n)) for key in ("mass", "stiffness"))
    matrices = mass, modal_damping(mass, stiffness, groups["model"]["modal_damping"]), stiffness
    worst = 0.0
    with h5py.File(folder / "case.h5") as file:
        column = groups["control"]["observed"] - 1
        for k in range(len(file["omega"])):
            if not file["converged"][k]:
                found["not converged"] += 1
                continue
            row = file["coefficients"][k]
            reached = (np.hypot(*row[1:3, column]) if groups["control"]["of"] == "first_harmonic"
                       else file["amplitude"][k, column])
            scale = file["load/scale"][k]
            errors = [abs(reached / file["control/amplitude"][k] - 1.0), *point_errors(
                groups, matrices, file["omega"][k], row, file["contact/force"][k], scale)]
            found["judged"] += 1
            found["by its law"] += int(np.isfinite(errors[2]))
            error = np.nanmax(errors)
            worst = max(worst, error)
            found["off"] += int(not error <= TOLERANCE or scale < 0.0)
    assert done.returncode == 0 or found["not converged"]
    return found, worst


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", dest="document", type=Path)
    options = parser.parse_args()
    laws, worst = {}, Counter()
    with tempfile.TemporaryDirectory() as name:
        for seed in range(options.seed, options.seed + options.count):
            law = controlled_case(seed)["contact"]["law"]
            found, error = judged(Path(name), seed)
            laws.setdefault(law, Counter()).update(found)
            worst[law] = max(worst[law], error)
            if found["off"] or found["not converged"]:
                print(f"seed {seed}: {law}, {found['off']} off, {found['not converged']} not "
                      f"converged, {error:.1e}")
    lines = [f"{options.count} cases (seeds {options.seed} to {options.seed + options.count - 1}), "
             "six points each.", "",
             "| law | cases | points judged | of these by the law | off | worst error | "
             "not converged |", "|---|---|---|---|---|---|---|"]
    for law in sorted(laws):
        found = laws[law]
        lines.append(f"| `{law}` | {found['cases']} | {found['judged']} | {found['by its law']} | "
                     f"{found['off']} | {worst[law]:.1e} | {found['not converged']} |")
    print("\n".join(lines))
    if options.document:
        write_section("controlled responses", lines, options.document)
    return int(any(found["off"] for found in laws.values()))


if __name__ == "__main__":
    sys.exit(main())
