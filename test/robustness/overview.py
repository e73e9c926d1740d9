#!/usr/bin/env python3
"""Add up the counts of the pages in docs/robustness in the table of docs/robustness.md."""
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test/stress"), str(ROOT / "test/support")]
from long_runs import MEMORY_GROWTH, TIME_GROWTH  # noqa: E402
from sections import DOCUMENT, write_section  # noqa: E402

PAGES = DOCUMENT.with_suffix("")
INPUTS = PAGES / "inputs.md"
KINDS = ["crash", "hang", "NaN", "false convergence", "lost data", "other"]
CALLS = ["returned", "InputError", "ConvergenceError", "OutputError", "ValueError", "TypeError",
         "MemoryError"]
CRASH_HANG = {"crash": ["crash"], "hang": ["hang"]}
# Part, document, what stands before its table, word and columns of its size, columns of a kind.
PARTS = [
    ("[stress suite](robustness/stress-suite.md)", PAGES / "stress-suite.md",
     "<!-- stress suite: begin -->", "cases", ["cases"],
     {**CRASH_HANG, "NaN": ["NaN"], "false convergence": ["false"], "other": ["silent"]}),
    ("[faults](robustness/faults.md)", PAGES / "faults.md", "<!-- faults: begin -->", "tries",
     ["tries"],
     {**CRASH_HANG, "lost data": ["lost data", "half file"], "other": ["silent", "other numbers"]}),
    ("[hostile inputs](robustness/inputs.md)", INPUTS, "# Hostile inputs", "ends", list("023456"),
     {**CRASH_HANG, "NaN": ["NaN"], "other": ["silent"]}),
    ("[Python calls](robustness/inputs.md#calls-of-the-python-package)", INPUTS,
     "## Calls of the Python package", "calls", CALLS,
     {**CRASH_HANG, "NaN": ["NaN"], "other": ["silent", "other exception"]}),
    ("[long runs](robustness/long-runs.md)", PAGES / "long-runs.md", "<!-- long runs: begin -->",
     "points", ["points"],
     {"other": ["grows"]})]


def rows_behind(text, mark):
    """The first table behind a mark: rows by heading, without the one that adds up the others."""
    lines = text.split(mark)[1].split("\n|", 1)[1].split("\n\n")[0].splitlines()
    table = [[cell.strip() for cell in line.strip("|").split(" | ")]
             for line in lines if " | " in line]
    return [dict(zip(table[0], cells)) for cells in table[1:] if cells[0] != "all"]


def grows(row):
    """What long_runs.py judges by: memory, or the time of a point, grows from begin to end."""
    early, late, first, last = (float(value) for value in list(row.values())[3:])
    return int(late - early > MEMORY_GROWTH or last > TIME_GROWTH * first)


def table():
    yield "| part | size | " + " | ".join(KINDS) + " |"
    yield "|---" * (2 + len(KINDS)) + "|"
    for name, document, mark, word, size, columns in PARTS:
        rows = [{**row, "grows": grows(row) if word == "points" else 0}
                for row in rows_behind(document.read_text(), mark)]
        total = {kind: sum(int(row[column] or 0) for row in rows for column in chosen)
                 for kind, chosen in [*columns.items(), (word, size)]}
        yield f"| {name} | {total[word]} {word} | " + " | ".join(
            str(total.get(kind, "")) for kind in KINDS) + " |"


if __name__ == "__main__":
    write_section("overview", table())
