#!/usr/bin/env python3
"""Accuracies claimed over 2,000 random cases of every law, judged independently, into
docs/robustness.md.

    claims.py [--count CASES] [--seed FIRST] [--with OTHER_PROGRAM] [--rows FILE] [--print]

Judges: motions from event to event for friction on masses (event_motion.py); for rigid friction
on nodes without mass behind a spring, which is elastic friction of that spring on the mass, and
for all others, the law `penalty`, springs or `regularised` with 61 harmonics given and 4,096
instants (32,768 with lift-off) where the claim followed events, or events where it was sampled. A
claim is kept where the true error of the root mean square over the period, of the worst quantity,
is within the accuracy asked for. With --rows each case is kept in a file, and what is there is not
computed again.
"""
from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import cases
import h5py
import numpy as np
from project import PROGRAM
from rigid_cases import AT_REST, chain, error, groups, random_structure, reference_of, synthesis
from sections import write_section

#: Harmonics and instants of a judge; instants at which answers are compared.
BEYOND, INSTANTS, COMPARED = 61, 4096, 1024
#: An error above this part of the vibration is another solution than that of the judge.
OTHER = 0.3
#: Cases of the whole family.
ALL = 2000
KINDS = ("dlft on mass", "dlft_velocity on mass", "rigid on mass", "dlft on massless nodes",
         "rigid on massless nodes", "penalty", "penalty, sampled", "penalty with lift-off",
         "penalty, two directions", "dlft, two directions", "springs", "regularised")


def behind_spring(structure, stiffness):
    """Every dof that rubs gets a node without mass behind a spring, which rubs in its place."""
    n, rubbing = structure.n, list(structure.limit)
    total = n + len(rubbing)
    wider = chain(np.ones(total), np.ones(total), np.zeros(total), np.zeros(total),
                  np.zeros(total), structure.omega, {})
    for name in ("mass", "damping", "stiffness"):
        matrix = np.zeros((total, total))
        matrix[:n, :n] = getattr(structure, name)
        setattr(wider, name, matrix)
    for name in ("static", "cosine"):
        setattr(wider, name, np.concatenate([getattr(structure, name), np.zeros(total - n)]))
    for k, (i, spring) in enumerate(zip(rubbing, stiffness)):
        j = n + k
        wider.stiffness[i, i] += spring
        wider.stiffness[j, j] += spring
        wider.stiffness[i, j] = wider.stiffness[j, i] = -spring
        wider.limit[j] = structure.limit[i]
    return wider


def friction_case(kind, structure, random):
    """The case, that of its judge (None: event to event), and the dofs that are compared."""
    stiffness = random.uniform(0.5, 6.0, len(structure.limit))
    elastic = groups(structure, "penalty", 1, tangential_stiffness=stiffness)
    if kind.endswith("on mass"):
        return groups(structure, kind.split()[0], 1), None
    if kind.endswith("massless nodes"):
        return groups(behind_spring(structure, stiffness), kind.split()[0], 1), elastic
    if kind == "regularised":
        speed = structure.omega * random.uniform(0.02, 0.2)
        smooth = groups(structure, kind, 1, slip_speed=[speed] * len(structure.limit))
        return smooth, smooth
    return elastic, elastic


def planar_case(kind, random):
    """One mass that rubs in two directions, elastic or behind two springs."""
    k = random.uniform(0.6, 2.0, 2)
    omega = float(np.sqrt(k.min()) * random.uniform(0.4, 1.3))
    contact = random.uniform(0.5, 4.0)
    damping = 0.03 * k
    load = {"cosine": [random.uniform(0.3, 1.0), 0.0], "sine": [0.0, random.uniform(-1.0, 1.0)]}
    limit = random.uniform(0.1, 0.6)
    common = {"case": {"analysis": "point", "threads": 1}, "sweep": {"start": omega},
              "solver": {"tolerance": 1e-10}, "harmonics": {"sampling": "events"}}
    pair = {"n_pairs": 1, "mu": 1.0, "normal_load": limit}
    elastic = {**common, "load": load,
               "model": {"n_dof": 2, "mass": np.eye(2), "stiffness": np.diag(k),
                         "damping": np.diag(damping)},
               "contact": {**pair, "law": "penalty", "side_1": [1, 2, 0],
                           "tangential_stiffness": contact}}
    if kind.startswith("penalty"):
        return elastic, elastic
    stiffness = np.diag([*(k + contact), contact, contact])
    stiffness[0, 2] = stiffness[2, 0] = stiffness[1, 3] = stiffness[3, 1] = -contact
    rigid = {**common, "load": {name: [*values, 0.0, 0.0] for name, values in load.items()},
             "model": {"n_dof": 4, "mass": np.diag([1.0, 1.0, 0.0, 0.0]), "stiffness": stiffness,
                       "damping": np.diag([*damping, 0.0, 0.0])},
             "contact": {**pair, "law": "dlft", "side_1": [3, 4, 0]}}
    return rigid, elastic


def lift_case(random):
    """A mass that slides and lifts off, pressed by a static load."""
    k = random.uniform(0.5, 2.0, 2)
    case = {
        "case": {"analysis": "point", "threads": 1},
        "model": {"n_dof": 2, "mass": np.eye(2), "stiffness": np.diag(k),
                  "damping": np.diag(0.06 * k)},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 2],
                    "mu": random.uniform(0.2, 0.6),
                    "tangential_stiffness": random.uniform(0.5, 3.0),
                    "normal_stiffness": random.uniform(0.5, 3.0)},
        "load": {"static": [0.0, -random.uniform(0.3, 1.0)],
                 "cosine": [random.uniform(0.2, 0.8), random.uniform(0.0, 0.5)]},
        "harmonics": {"sampling": "events"}, "solver": {"tolerance": 1e-10},
        "sweep": {"start": float(np.sqrt(k[0]) * random.uniform(0.4, 1.5))}}
    return case, case


def spring_case(random):
    """A chain with a cubic spring, hardening."""
    structure = random_structure(int(random.integers(1 << 30)))
    case = groups(structure, "dlft", 1)
    del case["contact"]
    case["spring"] = {"n_springs": 1, "side_1": int(random.integers(structure.n)) + 1,
                      "coefficient": random.uniform(0.02, 0.5), "power": 3}
    case["model"]["damping"] = 4.0 * case["model"]["damping"]
    case["harmonics"] = {}
    return case, case


def make_case(seed):
    """Kind, claim, judge, structure of the event-driven judge, accuracy; None where all is open."""
    random = np.random.default_rng([20, seed])
    kind = KINDS[seed % len(KINDS)]
    accuracy = float(10 ** random.uniform(-3.3, -1.5))
    structure = None
    if kind.endswith("two directions"):
        claim, judge = planar_case(kind, random)
    elif kind == "penalty with lift-off":
        claim, judge = lift_case(random)
    elif kind == "springs":
        claim, judge = spring_case(random)
    else:
        structure = random_structure(int(random.integers(1 << 30)))
        claim, judge = friction_case(kind, structure, random)
    claim = cases.merged(claim, {"harmonics": {"n_harmonics": None, "accuracy": accuracy}})
    if kind in ("penalty, sampled", "regularised"):
        claim["harmonics"]["sampling"] = "uniform"
    return kind, claim, judge, structure, accuracy


def run(folder, case, program):
    """Coefficients (2H+1, n), whether it converged, and the estimate; None where it is refused, by
    a program that does not know the law."""
    if cases.run(folder, case, status=(0, 3, 4), program=program).returncode == 3:
        assert program != PROGRAM
        return None
    with h5py.File(folder / "case.h5") as file:
        estimate = file["error_estimate"][-1] if "error_estimate" in file else np.nan
        return file["coefficients"][-1], bool(file["converged"][-1]), float(estimate)


def judge_of(folder, kind, judge, structure):
    """Motion (n, instants); None where there is none to trust."""
    if judge is None:
        return reference_of(structure)
    harmonics = {"n_harmonics": BEYOND, "sampling": "uniform", "n_time": INSTANTS}
    if kind.endswith("lift-off"):
        # The instant of landing is of first order in the instants.
        harmonics["n_time"] = 8 * INSTANTS
    if kind.endswith("two directions"):
        harmonics = {"n_harmonics": 41, "sampling": "events"}
    elif kind == "penalty, sampled":
        harmonics = {"n_harmonics": BEYOND, "sampling": "events"}
    try:
        coefficients, converged, _ = run(folder, cases.merged(judge, {"harmonics": {
            "n_time": None, **harmonics}}), PROGRAM)
    except subprocess.TimeoutExpired:
        return None
    motion = synthesis(coefficients, COMPARED)
    moves = np.ptp(motion, axis=1)
    return motion if converged and moves.min() > AT_REST * moves.max() else None


def measure(first, count, programs, kept=None):
    """Rows (kind, true error over accuracy or nan where not claimed) of each program."""
    rows = {name: [] for name in programs}
    known = {}
    if kept and kept.exists():
        known = {(seed, which): row for seed, which, row in map(json.loads,
                                                                kept.read_text().splitlines())}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for seed in range(first, first + count):
            wanted = {w: p for w, p in programs.items() if (seed, w) not in known}
            known |= {(seed, w): row for w, row in judged(folder, seed, wanted).items()}
            if kept and wanted:
                with kept.open("a") as file:
                    file.writelines(json.dumps([seed, w, known[seed, w]]) + "\n" for w in wanted)
            for which in programs:
                if known[seed, which]:
                    rows[which].append(tuple(known[seed, which]))
    return rows


def judged(folder, seed, programs):
    """Row of a case by each program; None where there is no judge, or it is refused."""
    rows = dict.fromkeys(programs)
    if not programs:
        return rows
    kind, claim, judge, structure, accuracy = make_case(seed)
    motion = judge_of(folder, kind, judge, structure)
    if motion is None:
        return rows
    for which, program in programs.items():
        found = run(folder, claim, program)
        if found is None:
            continue
        coefficients, converged, estimate = found
        ratio = np.nan
        if converged and estimate <= accuracy:
            ratio = error(coefficients[:, :len(motion)], motion) / accuracy
        rows[which] = (kind, float(ratio), accuracy, seed)
    return rows


def table(rows):
    """Lines of the section."""
    lines = ["| law | program | cases | claimed | broken | worst, times the accuracy "
             "| other solutions |", "|---|---|---|---|---|---|---|"]
    for kind in (*KINDS, "all"):
        for which, values in rows.items():
            here = np.array([(r, a) for k, r, a, _ in values if kind in (k, "all")]).reshape(-1, 2)
            ratio, accuracy = here.T
            other = ratio * accuracy > OTHER
            kept = ratio[~np.isnan(ratio) & ~other]
            worst = f"{kept.max():.2f}" if kept.size else "-"
            lines.append(f"| {kind} | {which} | {len(ratio)} | {kept.size + other.sum()} "
                         f"| {np.count_nonzero(kept > 1)} | {worst} | {np.count_nonzero(other)} |")
    return lines


def main():
    """Measure and write, or print."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=ALL)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--with", dest="other", metavar="PROGRAM")
    parser.add_argument("--rows", type=Path, metavar="FILE")
    parser.add_argument("--print", action="store_true", help="do not write the document")
    options = parser.parse_args()
    programs = {"this": PROGRAM, **({"before": options.other} if options.other else {})}
    rows = measure(options.seed, options.count, programs, options.rows)
    lines = table(rows)
    for which, values in rows.items():
        print(which, [(s, k, f"{r:.2f}", f"{a:.1e}") for k, r, a, s in values if r > 1])
    if options.print:
        print("\n".join(lines))
    else:
        # The count of all and that of a part stand beside each other.
        write_section("claims" if options.count >= ALL else "claims-part", ["", *lines, ""])


if __name__ == "__main__":
    main()
