#!/usr/bin/env python3
"""Write docs/robustness/inputs.md from what fuzz.py has counted: fuzz_report.py STATE.json"""
import json
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ENTRIES = {"library": "library", "check": "`fw_run --check`", "run": "`fw_run`, run",
           "program": "`fw_run`, command line"}
STATUSES = ["0", "2", "3", "4", "5", "6"]
KINDS = ["crash", "hang", "silent", "NaN"]
TEXT = """# Hostile inputs

Written by `make fuzz N={total}` (seed {seed}). Input k follows from the seed and k alone;
`test/robustness/fuzz.py --only k` makes it again, and a run that was stopped goes on where it was. Inputs are
mutations of sound ones: namelists by group, key and value and by character; model files with other types, shapes, sizes,
links and names, and with damaged bytes; Matrix Market files by token and line; command lines of sound and
unsound words. Most are read by the library, many in one process; command lines, damaged model files and a share of the
others by the program. A case passes if it ends with one of the statuses below, with a message if that is 2, 3 or 5, within 10 s of
processor time and 2 GB of address space, and without NaN in a result marked converged.

| input | read by | {heads} | crash | hang | silent | NaN |
|---|---|{rules}|---|---|---|---|
{rows}

{total} inputs, {ends} ends. The largest process of the library took {peak} MB{after}.

HDF5 itself crashes on some damaged files, or searches them for ever, so `fw_run` tries a model file in a process of its
own before it reads it, and refuses what the trial did not survive. The library, called from other programs, does not: they may have
threads, and then a second process is not safe. Give it files that you trust, or check them with `fw_run --check` first.
"""


def main():
    found = json.loads(Path(sys.argv[1]).read_text())
    bad = Counter((family, entry, next(kind for kind in KINDS if text.startswith(kind)))
                  for _, family, entry, text in found["failures"])
    table = {}
    for key, n in found["counts"].items():
        family, entry, status = key.split("|")
        table.setdefault((family, entry), Counter())[status] += n
    rows = []
    for (family, entry), counts in sorted(table.items()):
        cells = [str(counts[status]) for status in STATUSES]
        cells += [str(bad[family, entry, kind]) for kind in KINDS]
        rows.append(f"| {family} | {ENTRIES[entry]} | {' | '.join(cells)} |")
    path = ROOT / "docs" / "robustness" / "inputs.md"
    path.parent.mkdir(exist_ok=True)
    path.write_text(TEXT.format(
        total=sum(found["done"]), seed=found["seed"], rows="\n".join(rows),
        heads=" | ".join(STATUSES), rules="---|"*(len(STATUSES) - 1) + "---",
        ends=sum(sum(counts.values()) for counts in table.values()), peak=found["peak_mb"],
        after=f"; the slowest input took {found['slowest']:.1f} s of the clock"))


if __name__ == "__main__":
    main()
