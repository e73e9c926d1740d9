#!/usr/bin/env python3
"""Write what faults do into a document: fault_report.py [--tries 30] [-o docs/robustness.md]

A line for each scenario of `faults`, put between the marks of the document. Ends with status 1
where one went wrong.
"""
import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

import faults

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test/support"))
from revision import revision  # noqa: E402
from sections import write_section  # noqa: E402

COLUMNS = {"crash": "crash", "hang": "hang", "silent": "silent", "half": "half file",
           "lost": "lost data", "numbers": "other numbers"}


def row(name, tried, complaints):
    count = Counter(kind for _, kind in complaints)
    cells = [name, faults.SCENARIOS[name][0], tried or "not possible here",
             *(count[kind] if tried else "" for kind in COLUMNS)]
    return "| " + " | ".join(map(str, cells)) + " |"


def tables(tries, seed):
    """Lines of the table, and how many tries went wrong."""
    lines = ["| fault | demanded | tries | " + " | ".join(COLUMNS.values()) + " |",
             "|---"*(3 + len(COLUMNS)) + "|"]
    wrong = 0
    for name in faults.SCENARIOS:
        with tempfile.TemporaryDirectory(prefix="fretwear-faults-") as folder:
            tried, complaints = faults.campaign(name, Path(folder), tries, seed)
        lines.append(row(name, tried, complaints))
        print(lines[-1], *(f"   try {k}: {kind}" for k, kind in complaints), sep="\n", flush=True)
        wrong += len(complaints)
    return lines, wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tries", type=int, default=30, help="of each scenario")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, help="document whose table is replaced")
    arguments = parser.parse_args()
    lines, wrong = tables(arguments.tries, arguments.seed)
    if arguments.output:
        head = f"At commit {revision()}, moments of seed {arguments.seed}."
        write_section("faults", [head, "", *lines], arguments.output)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
