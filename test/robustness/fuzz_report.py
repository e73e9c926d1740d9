#!/usr/bin/env python3
"""Write docs/robustness/inputs.md from what was counted: fuzz_report.py FOLDER

The folder holds fuzz.json and results/fuzz.json of fuzz.py, and python.json of fuzz_python.py.
"""
import json
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ENTRIES = {"library": "library", "check": "`fw_run --check`", "run": "`fw_run`, run",
           "program": "`fw_run`, command line"}
STATUSES = ["0", "2", "3", "4", "5", "6"]
KINDS = ["crash", "hang", "silent", "NaN"]
EXCEPTIONS = ["returned", "InputError", "ConvergenceError", "OutputError", "ValueError",
              "TypeError", "MemoryError"]
PYTHON_KINDS = ["other", "crash", "hang", "silent", "NaN"]
TEXT = """# Hostile inputs

Written by `make fuzz`. Input k follows from the seed ({seed}) and k alone;
`test/robustness/fuzz.py --only k` makes it again, and a run that was stopped goes on where it
was, and tries again what had failed. {total} inputs of the {goal} that `make fuzz` is for, and
{results} damaged results, were read at commit {revision}.

Inputs are mutations of sound ones: namelists by group, key and value and by character; model files
with other types, shapes, sizes, links and names, and with damaged bytes; Matrix Market files by
token and line; results that a run starts from (`--restart`, `contact%worn`) with damaged bytes;
command lines of sound and unsound words. Most are read by the library, many in one process;
command lines, damaged files and a share of the others by the program. A case passes if it ends with
one of the statuses below, with a message if that is 2, 3 or 5, within 10 s of processor time and
2 GB of address space, and without NaN in a result marked converged.

{table}

{total_all} inputs, {ends} ends. The largest process of the library took {peak} MB; the
slowest of its inputs took {slowest:.2f} s of processor time.

HDF5 itself crashes on some damaged files, or searches them for ever, so `fw_run` tries a model file
or a result to start from in a process of its own before it reads it, and refuses what the trial did
not survive. The library, called from other programs, does not: they may have threads, and then a
second process is not safe. Give it files that you trust, or check them with `fw_run --check` first.

## Calls of the Python package

`test/robustness/fuzz_python.py` takes sound calls and puts something else in the place of one to
three arguments: other shapes, types, strides and byte orders, read-only, unaligned and empty
arrays, NaN, infinities, negative and huge numbers, None, texts, containers, objects, and arguments
left out or unknown. {python} calls (seed {python_seed}). A call may return, or raise an error of
the package, a ValueError, a TypeError or a MemoryError, with a message; all else is in the columns
after them.

{python_table}
"""


def row(*cells):
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def rule(n):
    return "|---" * n + "|"


def kind_of(text):
    return next(kind for kind in PYTHON_KINDS if text.startswith(kind))


def table_of_inputs(states):
    table, bad = {}, Counter()
    for state in states:
        bad.update((family, entry, kind_of(text)) for _, family, entry, text in state["failures"])
        for key, n in state["counts"].items():
            family, entry, status = key.split("|")
            table.setdefault((family, entry), Counter())[status] += n
    yield row("input", "read by", *STATUSES, *KINDS)
    yield rule(2 + len(STATUSES) + len(KINDS))
    for (family, entry), counts in sorted(table.items()):
        yield row(family, ENTRIES[entry], *(counts[status] for status in STATUSES),
                  *(bad[family, entry, kind] for kind in KINDS))


def table_of_calls(state):
    table, bad = {}, Counter((name, kind_of(text)) for _, name, text in state["failures"])
    for key, n in state["counts"].items():
        name, kind = key.split("|")
        table.setdefault(name, Counter())[kind] += n
    yield row("call", *EXCEPTIONS, "other exception", *PYTHON_KINDS[1:])
    yield rule(1 + len(EXCEPTIONS) + len(PYTHON_KINDS))
    for name, counts in sorted(table.items()):
        yield row(f"`{name}`", *(counts[kind] for kind in EXCEPTIONS),
                  *(bad[name, kind] for kind in PYTHON_KINDS))


def main():
    folder = Path(sys.argv[1])
    inputs, results, python = (json.loads((folder / name).read_text()) for name in (
        "fuzz.json", "results/fuzz.json", "python.json"))
    states = [inputs, results]
    path = ROOT / "docs" / "robustness" / "inputs.md"
    path.parent.mkdir(exist_ok=True)
    path.write_text(TEXT.format(
        seed=inputs["seed"], total=sum(inputs["done"]), goal=inputs["goal"],
        results=sum(results["done"]), total_all=sum(sum(state["done"]) for state in states),
        revision=" and ".join(sorted({state["revision"] for state in states})),
        table="\n".join(table_of_inputs(states)),
        ends=sum(n for state in states for key, n in state["counts"].items()
                 if key.split("|")[2] in STATUSES), peak=inputs["peak_mb"],
        slowest=max(state["slowest"] for state in states), python=sum(python["counts"].values()),
        python_seed=python["seed"], python_table="\n".join(table_of_calls(python))))


if __name__ == "__main__":
    main()
