"""Derivatives of random cases against differences of the program's own runs, into
docs/robustness.md.

    python test/oracles/sensitivity_family.py [--count 200] [--seed 0] [-o docs/robustness.md]

Differences of fourth order with two steps: where the two disagree, the response has a corner within
the step (a pair begins to slip, a peak changes), and the case is counted as such, not judged.
"""
import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import h5py
import numpy as np
from cases import merged, run
from project import PROGRAM
from sections import write_section

#: Of derivatives relative to the largest of their quantity, and of the two differences.
TOLERANCE, SMOOTH = 1e-6, 2e-7
#: Relative steps of the parameters.
STEPS = (4e-5, 2e-5)
STENCIL = ((-2, 1.0 / 12.0), (-1, -8.0 / 12.0), (1, 8.0 / 12.0), (2, -1.0 / 12.0))
LAWS = ("penalty", "penalty", "dlft", "dlft_velocity", "rigid", "regularised")


def random_case(seed):
    """A random structure with one to six pairs, some with normal dofs under preload, springs, and
    the parameters that its law has."""
    rng = np.random.default_rng(seed)
    law = str(rng.choice(LAWS))
    closes = bool(rng.random() < 0.4) and law != "rigid"
    n_pairs = int(rng.integers(1, 4 if closes else 7))
    size = n_pairs * (2 if closes else 1) + int(rng.integers(1, 4))
    a, b = rng.normal(size=(2, size, size))
    mass = np.eye(size) * 0.7 + a @ a.T / (3.0 * size)
    stiffness = np.eye(size) + 2.0 * b @ b.T / size
    first = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real.min())
    load = rng.normal(size=size)
    static = np.zeros(size)
    side = np.zeros((n_pairs, 3), dtype=int)
    side[:, 0] = np.arange(1, n_pairs + 1)
    if closes:
        side[:, 2] = np.arange(n_pairs + 1, 2 * n_pairs + 1)
        static[n_pairs:2 * n_pairs] = -rng.uniform(0.3, 2.0, n_pairs)
    contact = {"n_pairs": n_pairs, "law": law, "side_1": side.ravel().tolist(),
               "mu": rng.uniform(0.2, 0.6, n_pairs).tolist()}
    parameters = ["contact%mu", "load%harmonic_scale", "model%modal_damping"]
    if law in ("dlft", "dlft_velocity", "rigid"):
        # eps follows the stiffness (of 'rigid' the damping too), and derivatives hold it.
        parameters = parameters[:2 if law == "rigid" else 3]
    if closes:
        contact["gap"] = rng.uniform(-0.2, 0.1, n_pairs).tolist()
        parameters += ["contact%gap", "load%static_scale"]
    else:
        contact["normal_load"] = rng.uniform(0.2, 1.5, n_pairs).tolist()
        parameters += ["contact%normal_load"]
    if law == "penalty":
        contact["tangential_stiffness"] = rng.uniform(0.5, 4.0, n_pairs).tolist()
        parameters += ["contact%tangential_stiffness"]
    if closes and law in ("penalty", "regularised"):
        contact["normal_stiffness"] = rng.uniform(1.0, 5.0, n_pairs).tolist()
        parameters += ["contact%normal_stiffness"]
    if law == "regularised":
        contact["slip_speed"] = rng.uniform(0.3, 1.0, n_pairs).tolist()
    groups = {"case": {"analysis": "point", "threads": 1},
              "model": {"n_dof": size, "mass": (0.5 * (mass + mass.T)).ravel().tolist(),
                        "stiffness": (0.5 * (stiffness + stiffness.T)).ravel().tolist(),
                        "modal_damping": float(rng.uniform(0.01, 0.06))},
              "contact": contact,
              "load": {"cosine": load.tolist(), "static": static.tolist(), "static_scale": 1.0,
                       "harmonic_scale": float(10.0 ** rng.uniform(-0.5, 0.5))},
              "harmonics": {"n_harmonics": int(rng.choice([3, 5, 7]))},
              "sweep": {"start": float(first * rng.uniform(0.6, 1.5))},
              "solver": {"tolerance": 1e-13}, "output": {"observe": [size]}}
    if rng.random() < 0.5:
        groups["spring"] = {"n_springs": 1, "side_1": [size],
                            "coefficient": float(rng.uniform(0.1, 0.5))}
        parameters += ["spring%coefficient"]
    return groups, parameters


def shifted(groups, parameter, element, step):
    """The same with one number moved."""
    group, key = parameter.split("%")
    value = groups[group][key]
    if isinstance(value, list):
        value = [v + step * (i == element) for i, v in enumerate(value)]
    else:
        value = value + step
    return merged(groups, {group: {key: value}})


def values(folder, groups):
    """First harmonic, largest displacement, dissipation; None where the run does not converge."""
    done = run(folder, groups, name="moved", status=(0, 4), seconds=300)
    if done.returncode:
        return None
    with h5py.File(folder / "moved.h5") as file:
        coefficients = file["coefficients"][0, :, 0]
        return np.array([np.hypot(*coefficients[1:3]), file["amplitude"][0, 0],
                         file["contact/dissipation"][0].sum()])


def judge(folder, seed):
    """How each derivative of a case compares: a count of words, and the worst error."""
    groups, parameters = random_case(seed)
    found = Counter(cases=1)
    done = run(folder, merged(groups, {"sensitivity": {"parameters": parameters}}), status=(0, 4),
               seconds=300)
    if done.returncode:
        found["not converged"] += 1
        return groups["contact"]["law"], found, 0.0
    names = ("first_harmonic", "largest", "dissipation")
    with h5py.File(folder / "case.h5") as file:
        exact = {p: np.array([file[f"sensitivity/{q}/{p.replace('%', '_')}"][0].ravel()
                              for q in names]) for p in parameters}
        if "remarks" in file and "one-sided derivatives" in list(file["remarks/name"].asstr()[:]):
            found["remarked"] += 1
    scale = np.array([max(np.abs(e[k]).max() for e in exact.values()) for k in range(3)])
    worst = 0.0
    for parameter, table in exact.items():
        for element in range(table.shape[1]):
            differences = []
            for step in STEPS:
                points = [values(folder, shifted(groups, parameter, element, k * step))
                          for k, _ in STENCIL]
                if any(p is None for p in points):
                    break
                differences.append(sum(w / step * p for p, (_, w) in zip(points, STENCIL,
                                                                        strict=True)))
            if len(differences) < len(STEPS):
                found["corner"] += 3
                continue
            for k in range(3):
                size = max(scale[k], 1e-3)
                if abs(differences[0][k] - differences[1][k]) > SMOOTH * size:
                    found["corner"] += 1
                    continue
                error = abs(table[k, element] - differences[1][k]) / size
                worst = max(worst, error)
                found["judged"] += 1
                found["off"] += int(not error <= TOLERANCE)
    return groups["contact"]["law"], found, worst


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", dest="document", type=Path)
    options = parser.parse_args()
    laws, worst = {}, Counter()
    with tempfile.TemporaryDirectory() as name:
        for seed in range(options.seed, options.seed + options.count):
            law, found, error = judge(Path(name), seed)
            laws.setdefault(law, Counter()).update(found)
            worst[law] = max(worst[law], error)
            if found["off"] or error > TOLERANCE:
                print(f"seed {seed}: {law}, {found['off']} off, {error:.1e}")
    lines = [f"{options.count} cases (seeds {options.seed} to {options.seed + options.count - 1}).",
             "", "| law | cases | derivatives judged | off | worst error | at a corner | "
             "not converged |", "|---|---|---|---|---|---|---|"]
    for law in sorted(laws):
        found = laws[law]
        lines.append(f"| `{law}` | {found['cases']} | {found['judged']} | {found['off']} | "
                     f"{worst[law]:.1e} | {found['corner']} | {found['not converged']} |")
    print("\n".join(lines))
    if options.document:
        write_section("sensitivities", lines, options.document)
    assert PROGRAM.exists()
    return int(any(found["off"] for found in laws.values()))


if __name__ == "__main__":
    sys.exit(main())
