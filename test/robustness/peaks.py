"""Counts of reported peaks: right, with a remark, wrong without a word; docs/robustness.md.

    python test/robustness/peaks.py --before OTHER/fw_run [--state FILE] -o docs/robustness.md

What the judge finds goes into the state, line by line: it goes on where it was stopped.
"""
import argparse
import json
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))

import peak_family
from cases import run
from project import PROGRAM
from sections import write_section

WORDS = ("right", "remark", "wrong without a word")


def verdict(folder, groups, true, program):
    """What a program makes of a case whose highest amplitude is known."""
    run(folder, groups, status=(0, 4), program=program)
    peak, remark = peak_family.reported(folder / "case.h5")
    if abs(peak / true - 1.0) <= peak_family.RIGHT:
        return WORDS[0]
    return WORDS[1] if remark else WORDS[2]


def judged(folder, seed, groups, ratio, state):
    """The highest amplitude of a fine sweep, looked up where it is known already."""
    known = {}
    if state and state.exists():
        known = dict(json.loads(line) for line in state.read_text().splitlines())
    if seed not in known:
        known[seed] = peak_family.fine_peak(folder, groups, ratio)
        if state:
            with state.open("a") as file:
                file.write(json.dumps([seed, known[seed]]) + "\n")
    return known[seed]


def count(number, programs, state=None):
    """Verdicts by family and program. Left out are cases whose fine sweep fails, that never move,
    or whose sweep of few points comes to another solution than the fine one."""
    counts = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for seed in range(number):
            if seed % 2 == 0:
                groups, true = peak_family.linear(seed)
                family = "linear chain"
            else:
                groups, family, ratio = peak_family.nonlinear(seed)
                true = judged(folder, seed, groups, ratio, state)
                run(folder, groups, status=(0, 4), program=programs["now"])
                if true and peak_family.stands_elsewhere(folder / "case.h5", true):
                    true = None
            if not true:
                counts[family, "left out"] += 1
                continue
            for label, program in programs.items():
                counts[family, label, verdict(folder, groups, true, program)] += 1
    return counts


def table(counts, programs):
    """Rows of the document."""
    lines = ["", "| family | left out | " + " | ".join(
        f"{label}: {word}" for label in programs for word in WORDS) + " |",
        "|---|" + "---|" * (1 + len(WORDS) * len(programs))]
    for family in sorted({key[0] for key in counts}):
        cells = [counts[family, "left out"]] + [counts[family, label, word]
                                                for label in programs for word in WORDS]
        lines.append(f"| {family} | " + " | ".join(map(str, cells)) + " |")
    return [*lines, ""]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--before", help="program to compare with")
    parser.add_argument("--state", type=Path, help="goes on where a run with this file stopped")
    parser.add_argument("-o", "--output", type=Path, help="document with the section `peaks`")
    options = parser.parse_args()
    programs = {"now": PROGRAM} | ({"before": options.before} if options.before else {})
    lines = table(count(options.count, programs, options.state), programs)
    print("\n".join(lines))
    if options.output:
        write_section("peaks", lines, options.output)


if __name__ == "__main__":
    main()
