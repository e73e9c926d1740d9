"""Bifurcations that the program names, against shooting in time: random branches of fixed seeds.

    bifurcations.py [--count N] [--seed S] [--families ...] [--jobs N] [-o]

N branches of each family from seed S on. Ends with status 1 where a kind is named that is not
there, or one that is there is missing. With -o the table goes into docs/robustness.md. A program
that names no bifurcations has nothing to compare.
"""
from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from bifurcation_cases import FAMILIES, random_sample
from orbit_judge import FOLD

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from limits import limit
from project import PATIENT, PROGRAM
from revision import revision
from sections import write_section

COUNT = 40
# Of the frequency: harmonics that are left out move a place, most at a stop (H**-2.5).
PLACE = {"stop": 3e-3}
SMOOTH_PLACE = 5e-4
# Of the amplitude there, which the judge takes at instants.
HEIGHT = 2e-2
OPEN = ("undecided", "nonsmooth")
SECONDS = 120
# Status of a run that takes longer: unfinished.
OUT_OF_TIME = -1


@dataclass
class Verdict:
    expected: int = 0
    missed: list = field(default_factory=list)
    wrong: list = field(default_factory=list)
    undecided: int = 0
    worst: float = 0.0


def named(program, sample):
    """Status, and (kind, omega, amplitude) of everything that the program names."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "case.nml").write_text(sample.case())
        try:
            done = subprocess.run([program, "-q", "-o", "case.h5", "case.nml"], cwd=folder,
                                  env={**PATIENT, "OMP_NUM_THREADS": "1"}, capture_output=True,
                                  text=True, timeout=limit(SECONDS), check=False)
        except subprocess.TimeoutExpired:
            return OUT_OF_TIME, []
        with h5py.File(Path(folder) / "case.h5") as file:
            if "bifurcation" not in file:
                return done.returncode, []
            group = file["bifurcation"]
            words = [str(word) for word in group["kind"].attrs["names"]]
            return done.returncode, [
                (words[kind], float(omega), float(amplitude[0]))
                for kind, omega, amplitude in zip(group["kind"][:], group["omega"][:],
                                                  group["amplitude"][:])]


def known(sample):
    """What the judge finds: (kind, omega, amplitude), or None where it did not reach the end."""
    branch = sample.branch()
    with np.errstate(over="ignore", invalid="ignore"):
        branch.follow()
    found = [(b.kind, float(b.omega), float(b.amplitude[0])) for b in branch.bifurcations]
    return found if branch.complete else None


def compare(family, true, found):
    """Pair what is there with what is named, by kind and place."""
    verdict = Verdict(len(true))
    place = PLACE.get(family, SMOOTH_PLACE)
    left = list(found)
    for kind, omega, amplitude in true:
        near = [f for f in left if abs(f[1] / omega - 1.0) <= place
                and abs(f[2] / amplitude - 1.0) <= HEIGHT]
        same = [f for f in near if f[0] == kind] or [f for f in near if f[0] in OPEN]
        if not same:
            verdict.missed.append((kind, omega, amplitude))
            continue
        best = min(same, key=lambda f, at=omega: abs(f[1] - at))
        left.remove(best)
        if best[0] == kind:
            verdict.worst = max(verdict.worst, abs(best[1] / omega - 1.0))
        else:
            verdict.undecided += 1
    verdict.undecided += sum(f[0] in OPEN for f in left)
    verdict.wrong = [f for f in left if f[0] not in OPEN]
    return verdict


def in_words(family, seed, verdict):
    for what, places in (("missed", verdict.missed), ("wrong", verdict.wrong)):
        for kind, omega, amplitude in places:
            print(f"   {family} {seed}: {what}: {kind} at {omega:.7g} rad/s, {amplitude:.5g}",
                  flush=True)


def row(pool, family, seeds, truths):
    """Counts of a family."""
    samples = [random_sample(family, seed) for seed in seeds]
    runs = list(pool.map(lambda sample: named(PROGRAM, sample), samples))
    whole = [(seed, true, found) for seed, true, (status, found) in zip(seeds, truths, runs)
             if true is not None and status == 0]
    verdicts = [compare(family, true, found) for _, true, found in whole]
    for (seed, _, _), verdict in zip(whole, verdicts):
        in_words(family, seed, verdict)
    kinds = [kind for _, true, _ in whole for kind, _, _ in true]
    folds = kinds.count(FOLD)
    missed, wrong = (sum(len(getattr(v, what)) for v in verdicts) for what in ("missed", "wrong"))
    unfinished = sum(status != 0 for status, _ in runs)
    not_judged = sum(true is None for true in truths)
    text = (f"| {family} | {len(samples)} | {unfinished} | {not_judged} | {len(whole)} | {folds} "
            f"| {len(kinds) - folds} | {missed} | {wrong} | {sum(v.undecided for v in verdicts)} "
            f"| {max((v.worst for v in verdicts), default=0.0):.1e} |")
    return text, missed + wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=COUNT, help="branches of each family")
    parser.add_argument("--seed", type=int, default=0, help="the first")
    parser.add_argument("--families", nargs="+", choices=FAMILIES, default=FAMILIES)
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time")
    parser.add_argument("-o", "--output", action="store_true", help="write docs/robustness.md")
    arguments = parser.parse_args()
    seeds = range(arguments.seed, arguments.seed + arguments.count)
    lines = [f"At commit {revision()}.", "",
             "| family | branches | unfinished | not judged | compared | folds there "
             "| others there | missed | wrong | open | worst place |", "|---" * 11 + "|"]
    bad = 0
    with ThreadPoolExecutor(arguments.jobs) as pool:
        for family in arguments.families:
            truths = [known(random_sample(family, seed)) for seed in seeds]
            text, wrong = row(pool, family, seeds, truths)
            print(text, flush=True)
            lines.append(text)
            bad += wrong
    if arguments.output:
        write_section("bifurcations", lines)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
