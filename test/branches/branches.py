"""Branches by arc-length against independent solutions: random families of fixed seeds.

    branches.py [--chains N] [--joints N] [--cusps N] [--before FW_RUN] [--jobs N] [-o]

Chains that are linear but for a spring of nothing, from four first steps each, are judged by
NumPy's solution of their matrices; structures with friction, a gap or a cubic spring by fine natural
sweeps in both directions; oscillators of one harmonic whose folds are about to merge by a closed
form. Ends with status 1 where a branch turned back, passed over a resonance, left
the curve or missed a fold. With -o the tables go into docs/robustness.md; --before gives them
another program as well.
"""
from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import branch_chains
import branch_cusps
import branch_joints
import h5py
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from limits import limit
from project import PATIENT, PROGRAM
from revision import revision
from sections import write_section

# Points asked for, which set the first step, and seeds of each family.
FIRST_STEPS = (11, 21, 41, 101)
CHAINS, JOINTS, CUSPS = 500, 300, 150
# A cubic through the rows may miss this much of the response.
TRUE = 5e-3
SECONDS = 120


def solve(program, text, folder, name):
    """Status, and frequencies, converged, coefficients, folds and perhaps tangents of a case."""
    (folder / f"{name}.nml").write_text(text)
    return run(program, folder, name, f"{name}.nml")


def run(program, folder, name, *words):
    """The same of a namelist on the command line."""
    done = subprocess.run([program, "-q", "-o", f"{name}.h5", *words], cwd=folder,
                          env={**PATIENT, "OMP_NUM_THREADS": "1"}, capture_output=True, text=True,
                          timeout=limit(SECONDS), check=False)
    with h5py.File(folder / f"{name}.h5") as file:
        omega = file["omega"][:]
        fold = file["fold"][:] if "fold" in file else np.zeros(len(omega))
        found = (omega, file["converged"][:].astype(bool), file["coefficients"][:],
                 fold.astype(bool))
        if "tangent" in file:
            found += (np.column_stack([file["tangent/omega"][:],
                                       file["tangent/coefficients"][:].reshape(len(omega), -1)]),)
        return done.returncode, found


def judge_chain(program, seed, n_points):
    chain = branch_chains.random_chain(seed)
    with tempfile.TemporaryDirectory() as folder:
        status, found = solve(program, chain.case(n_points), Path(folder), "chain")
    return branch_chains.judge(chain, found[0], found[2], status)


def judge_joint(program, seed, n_points=31):
    joint = branch_joints.random_joint(seed)
    fine = branch_joints.FINE
    with tempfile.TemporaryDirectory() as folder:
        status, branch = solve(program, joint.case(n_points, "arclength"), Path(folder), "branch")
        # The natural sweeps are those of the program under test for both: the judge is one.
        sweeps = [solve(PROGRAM, joint.case(fine, "natural", backwards), Path(folder), "sweep")[1]
                  for backwards in (False, True)]
    return joint.kind, branch_joints.judge(joint, branch, sweeps, status)


def judge_cusp(program, seed):
    cusp = branch_cusps.random_cusp(seed)
    with tempfile.TemporaryDirectory() as folder:
        status, found = solve(program, cusp.case(), Path(folder), "cusp")
        with h5py.File(Path(folder) / "cusp.h5") as file:
            named = [("fold", omega) for omega in found[0][found[3]]]
            if "bifurcation" in file:
                group = file["bifurcation"]
                words = [str(word) for word in group["kind"].attrs["names"]]
                named = [(words[kind], float(omega)) for kind, omega in
                         zip(group["kind"][:], group["omega"][:], strict=True)]
    return cusp.kind, branch_cusps.judge(cusp, status, found[0], named)


def table_of_chains(pool, programs, number):
    yield ("| program | n_points | branches | turned back | resonances passed over in | unfinished "
           "| rows off | cubic misses more than 0.5 % in | mean points |")
    yield "|---" * 9 + "|"
    for name, program in programs:
        for n_points in FIRST_STEPS:
            every = list(pool.map(lambda seed, p=program, n=n_points: judge_chain(p, seed, n),
                                  range(number)))
            yield (f"| {name} | {n_points} | {len(every)} | {sum(v.turned for v in every)} "
                   f"| {sum(v.skipped > 0 for v in every)} | {sum(v.incomplete for v in every)} "
                   f"| {sum(v.off for v in every)} "
                   f"| {sum(v.turned or v.interpolation > TRUE for v in every)} "
                   f"| {np.mean([v.n_points for v in every]):.0f} |")


def table_of_joints(pool, programs, number):
    yield "| program | element | branches | unfinished | off the curve | fold missed | mean points |"
    yield "|---" * 7 + "|"
    for name, program in programs:
        every = list(pool.map(lambda seed, p=program: judge_joint(p, seed), range(number)))
        for kind in branch_joints.KINDS:
            of_kind = [v for k, v in every if k == kind]
            yield (f"| {name} | {kind} | {len(of_kind)} | {sum(v.incomplete for v in of_kind)} "
                   f"| {sum(v.off > 0 for v in of_kind)} | {sum(v.missed > 0 for v in of_kind)} "
                   f"| {np.mean([v.n_points for v in of_kind]):.0f} |")


def table_of_cusps(pool, programs, number):
    yield ("| program | element | branches near a cusp | unfinished | folds there | missed | wrong "
           "| left open | mean points |")
    yield "|---" * 9 + "|"
    for name, program in programs:
        every = list(pool.map(lambda seed, p=program: judge_cusp(p, seed), range(number)))
        for kind in branch_cusps.KINDS:
            of_kind = [v for k, v in every if k == kind]
            yield (f"| {name} | {kind} | {len(of_kind)} | {sum(v.incomplete for v in of_kind)} "
                   f"| {sum(v.there for v in of_kind)} | {sum(v.missed for v in of_kind)} "
                   f"| {sum(v.wrong for v in of_kind)} | {sum(v.open for v in of_kind)} "
                   f"| {np.mean([v.n_points for v in of_kind]):.0f} |")


def is_bad(line):
    """Whether a row of this program's counts a branch that is wrong."""
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    wrong = cells[3:7] if len(cells) == 9 else cells[3:6]
    if cells[1] in branch_cusps.KINDS and len(cells) == 9:
        wrong = [cells[3], *cells[5:7]]
    return cells[0] == "this" and any(int(count) for count in wrong)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--chains", type=int, default=CHAINS, help="seeds of the first family")
    parser.add_argument("--joints", type=int, default=JOINTS, help="seeds of the second")
    parser.add_argument("--cusps", type=int, default=CUSPS, help="seeds of the third")
    parser.add_argument("--before", type=Path, help="another fw_run to compare with")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time")
    parser.add_argument("-o", "--output", action="store_true", help="write docs/robustness.md")
    arguments = parser.parse_args()
    programs = [("this", PROGRAM)]
    if arguments.before:
        programs.append(("before", arguments.before.resolve()))
    lines = [f"At commit {revision()}.", ""]
    with ThreadPoolExecutor(arguments.jobs) as pool:
        for part in (table_of_chains(pool, programs, arguments.chains), [""],
                     table_of_joints(pool, programs, arguments.joints), [""],
                     table_of_cusps(pool, programs, arguments.cusps)):
            for line in part:
                print(line, flush=True)
                lines.append(line)
    if arguments.output:
        write_section("branches", lines)
    return int(any(is_bad(line) for line in lines if line.startswith("| this")))


if __name__ == "__main__":
    sys.exit(main())
