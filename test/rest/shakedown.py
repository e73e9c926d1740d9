"""Where pairs of the velocity law come to rest, over random structures: docs/robustness.md.

    python test/rest/shakedown.py [--count 200] [--seed 0] [--before OTHER/fw_run]
                                  [-o docs/robustness.md]

Each structure is solved in many ways that must not matter: by solvers, by linear solvers, with and
without skips, from both ends of a sweep, and by integration in time from there.
"""
import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import h5py
import numpy as np
from cases import run
from project import PROGRAM
from rest_cases import groups, judged, random_rest
from sections import write_section

#: Changes that must not change the answer.
WAYS = {
    "newton": {},
    "krylov": {"solver": {"linear": "krylov"}},
    "powell": {"solver": {"kind": "powell"}},
    "kinsol": {"solver": {"kind": "kinsol"}},
    "pseudo_time": {"solver": {"kind": "pseudo_time"}},
    "no skips": {"solver": {"skips": False}},
    "sweep up": {"sweep": {"first": 0.8}},
    "sweep down": {"sweep": {"first": 1.25}},
}
IN_TIME = {"case": {"analysis": "time"}}
#: Differences that count as one, as a part of the largest position: of ways, and from the judge;
#: of the integration, which sees the load also between the instants of the balance.
ONE_ANSWER = 1e-8
SAME_IN_TIME = 3e-3


def answer(folder, case, changes, program):
    """Mean positions of the rows, and whether they count as converged."""
    changes = {name: dict(keys) for name, keys in changes.items()}
    first = changes.get("sweep", {}).pop("first", None)
    if first:
        changes["sweep"] = {"start": first * case.omega, "end": case.omega, "n_points": 4}
        changes["case"] = {"analysis": "frf"}
    run(folder, groups(case, changes), status=(0, 4), program=program)
    with h5py.File(folder / "case.h5") as file:
        return file["coefficients"][-1, 0, :][case.rows], bool(file["converged"][-1])


def verdict(folder, case, true, program):
    """Spread over the ways, distance from the judge, change in time, and ways not converged."""
    found = [answer(folder, case, changes, program) for changes in WAYS.values()]
    scale = np.abs(true).max()
    good = np.array([q for q, converged in found if converged])
    missed = len(found) - len(good)
    if not len(good):
        return np.inf, np.inf, np.inf, missed
    in_time, _ = answer(folder, case, IN_TIME, program)
    return (np.ptp(good, axis=0).max() / scale, np.abs(good - true).max() / scale,
            np.abs(in_time - true).max() / scale, missed)


def measure(seeds, programs):
    """Verdicts of each program (case, 4), and how many structures do not come to rest."""
    rows = {label: [] for label in programs}
    left_out = 0
    with tempfile.TemporaryDirectory() as name:
        for seed in seeds:
            case = random_rest(seed)
            true = judged(case)
            if true is None:
                left_out += 1
                continue
            for label, program in programs.items():
                rows[label].append(verdict(Path(name), case, true, program))
    return {label: np.array(values) for label, values in rows.items()}, left_out


def table(rows, left_out):
    """Lines of the section."""
    count = len(next(iter(rows.values())))
    lines = [f"{count} random structures that come to rest ({left_out} more do not), each in "
             f"{len(WAYS)} ways and in time.", "",
             "| program | ways differ by more than 1e-8 | largest difference | off the judge by "
             "more than 1e-8 | largest | off in time by more than 3e-3 | ways not converged |",
             "|---|---|---|---|---|---|---|"]
    for label, values in rows.items():
        spread, off, in_time, missed = values.T
        lines.append(f"| {label} | {np.count_nonzero(spread > ONE_ANSWER)} | {spread.max():.1e} "
                     f"| {np.count_nonzero(off > ONE_ANSWER)} | {off.max():.1e} "
                     f"| {np.count_nonzero(in_time > SAME_IN_TIME)} | {missed.sum():.0f} |")
    return ["", *lines, ""]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200, help="structures that come to rest")
    parser.add_argument("--seed", type=int, default=0, help="the first")
    parser.add_argument("--before", help="program to compare with")
    parser.add_argument("-o", "--output", type=Path, help="document with the section `rest`")
    options = parser.parse_args()
    programs = {"now": PROGRAM} | ({"before": options.before} if options.before else {})
    lines = table(*measure(range(options.seed, options.seed + options.count), programs))
    print("\n".join(lines))
    if options.output:
        write_section("rest", lines, options.output)


if __name__ == "__main__":
    main()
