#!/usr/bin/env python3
"""Which law is right where none is named: errors of `dlft`, whose eps is the static stiffness, and
of `rigid` over families of random structures, into docs/robustness.md.

    default_law.py [-n CASES] [--print]

On nodes without mass `rigid` is `dlft` with the stiffness of the structure above the harmonics for
eps: these families tell which eps is better. Judges: motions from event to event (event_motion.py)
for friction on masses; for nodes behind springs the law `penalty`, which is the same contact with
these springs for its stiffnesses, with 61 harmonics; for masses that land, integration in time.
"""
from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import cases
import h5py
import numpy as np
from claims import behind_spring, lift_case
from rigid_cases import AT_REST, error, groups, random_structure, reference_of, synthesis
from sections import write_section

HARMONICS = (3, 9)
LAWS = ("dlft", "rigid")
#: Harmonics of judges.
BEYOND = 61
COMPARED = 1024
FALSE = 0.5


def solve(folder, case, status=(0, 4)):
    """Coefficients (2H+1, n), and whether they converged."""
    cases.run(folder, case, status=status, seconds=600.0)
    with h5py.File(folder / "case.h5") as file:
        return file["coefficients"][-1], bool(file["converged"][-1])


def by_balance(folder, case):
    """Motion (n, COMPARED) of many harmonics; None where they do not converge or nothing moves."""
    many = {"n_harmonics": BEYOND, "sampling": "events"}
    coefficients, converged = solve(folder, cases.merged(case, {"harmonics": many}))
    motion = synthesis(coefficients, COMPARED)
    moves = np.ptp(motion, axis=1)
    return motion if converged and moves.min() > AT_REST * moves.max() else None


def on_masses(folder, seed):
    """Friction of constant normal load on masses."""
    structure = random_structure(seed)
    return groups(structure, "dlft", 1), reference_of(structure)


def behind_springs(folder, seed):
    """The same on nodes without mass."""
    random = np.random.default_rng([31, seed])
    structure = random_structure(seed)
    stiffness = random.uniform(0.5, 6.0, len(structure.limit))
    elastic = groups(structure, "penalty", 1, tangential_stiffness=stiffness)
    return (groups(behind_spring(structure, stiffness), "dlft", 1),
            by_balance(folder, elastic))


def landing_behind_springs(folder, seed):
    """A node without mass that slides, lifts off and lands, behind two springs."""
    elastic, _ = lift_case(np.random.default_rng([32, seed]))
    contact, model = elastic["contact"], elastic["model"]
    springs = [contact["tangential_stiffness"], contact["normal_stiffness"]]
    stiffness = np.zeros((4, 4))
    stiffness[:2, :2] = model["stiffness"] + np.diag(springs)
    stiffness[2:, 2:] = np.diag(springs)
    stiffness[:2, 2:] = stiffness[2:, :2] = -np.diag(springs)
    wider = {"n_dof": 4, "mass": np.diag([1.0, 1.0, 0.0, 0.0]), "stiffness": stiffness,
             "damping": np.diag([*np.diag(model["damping"]), 0.0, 0.0])}
    rigid = {**elastic, "model": wider,
             "contact": {"n_pairs": 1, "side_1": [3, 0, 4], "mu": contact["mu"]},
             "load": {name: [*values, 0.0, 0.0] for name, values in elastic["load"].items()}}
    return rigid, by_balance(folder, elastic)


def pressed_masses(folder, seed):
    """A mass that slides under a load of another that the vibration presses, without landing."""
    random = np.random.default_rng([33, seed])
    case, _ = lift_case(random)
    # The normal dof has no mass: its force is the load there, which varies and never vanishes.
    model, load = case["model"], case["load"]
    model["mass"] = np.diag([1.0, 0.0])
    model["damping"] = np.diag([float(model["damping"][0, 0]), 0.0])
    load["static"] = [0.0, -float(random.uniform(0.4, 1.0))]
    load["cosine"] = [load["cosine"][0], float(0.8 * random.uniform() * load["static"][1])]
    case["contact"] = {"n_pairs": 1, "side_1": [1, 0, 2], "mu": case["contact"]["mu"]}
    return case, in_time(folder, case)


def landing_masses(folder, seed):
    """A mass that slides, lifts off and lands."""
    case, _ = lift_case(np.random.default_rng([34, seed]))
    case["contact"] = {"n_pairs": 1, "side_1": [1, 0, 2], "mu": case["contact"]["mu"]}
    return case, in_time(folder, case)


def in_time(folder, case):
    """Motion by integration in time; None where it has no period or nothing moves."""
    timed = cases.merged(case, {"case": {"analysis": "time"},
                                "harmonics": {"n_harmonics": BEYOND, "sampling": None},
                                "solver": {"tolerance": None}, "time": TIME})
    coefficients, converged = solve(folder, timed)
    motion = synthesis(coefficients, COMPARED)
    moves = np.ptp(motion[:1], axis=1)
    return motion if converged and moves.min() > AT_REST else None


#: Steps of a period: the error of the judge is below 1e-3 with them.
TIME = {"steps_per_period": 4000}
FAMILIES = {"masses, constant normal load": on_masses,
            "masses, varying normal load": pressed_masses,
            "nodes behind springs, constant normal load": behind_springs,
            "nodes behind springs, lift-off": landing_behind_springs,
            "masses, lift-off": landing_masses}


def measure(n_cases, families):
    """Rows (family, law, H): errors and convergence."""
    rows = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for family in families:
            for seed in range(n_cases):
                case, motion = FAMILIES[family](folder, seed)
                if motion is None:
                    continue
                for n in HARMONICS:
                    for law in LAWS:
                        asked = cases.merged(case, {
                            "contact": {"law": law},
                            "harmonics": {"n_harmonics": n, "sampling": "events"}})
                        coefficients, converged = solve(folder, asked)
                        moving = [i for i in range(len(motion))
                                  if np.ptp(motion[i]) > AT_REST * np.ptp(motion)]
                        rows.setdefault((family, n, law), []).append(
                            (error(coefficients[:, moving], motion[moving]), converged))
    return {key: np.array(values) for key, values in rows.items()}


def table(rows):
    """Lines of the section."""
    lines = ["| family | H | law | cases | median error | nine of ten below | not converged "
             "| false, counted as converged |", "|---|---|---|---|---|---|---|---|"]
    for (family, n, law), values in rows.items():
        good = values[values[:, 1] > 0, 0]
        lines.append(f"| {family} | {n} | `{law}` | {len(values)} | {np.median(good):.1e} "
                     f"| {np.quantile(good, 0.9):.1e} | {len(values) - len(good)} "
                     f"| {np.count_nonzero(good > FALSE)} |")
    return lines


def main():
    """Measure and write, or print."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", type=int, default=100, metavar="CASES")
    parser.add_argument("--family", choices=FAMILIES, nargs="*", default=list(FAMILIES))
    parser.add_argument("--print", action="store_true", help="do not write the document")
    options = parser.parse_args()
    lines = table(measure(options.n, options.family))
    if options.print:
        print("\n".join(lines))
    else:
        write_section("default-law", ["", *lines, ""])


if __name__ == "__main__":
    main()
