"""Random families: draw a case of a seed, run it, let an independent judge count, write a page.

A family is a module of this folder, with

    TITLE     heading of docs/robustness/NAME.md (NAME: the module, with - for _)
    TEXT      what is drawn and who judges, in Markdown
    COUNT     cases at full size (seeds 0 to COUNT - 1)
    SMALL     seeds that `make test` runs
    COLUMNS   {key: heading} of the counts, in their order
    ZERO      keys that have to stay 0
    ALSO      files beside program and module whose change makes the counts anew (may be absent)
    trial(seed, program, folder)   the counts of one case: {key: number}, with `kind`, the row of
                                   the table (one row without it), and `notes`, lines for the screen

`make family NAME=whirl` runs one at full size and writes its page; `BEFORE=fw_run` counts another
program beside it. `python test/families/runner.py whirl --count 20 --first 100` tries some seeds.
What was counted is kept in build/families, so that a run goes on where it was stopped; a changed
program or family starts anew.
"""
from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import os
import sys
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "support")]
from project import PROGRAM, ROOT  # noqa: E402
from revision import revision  # noqa: E402

STATE = ROOT / "build" / "families"
#: One thread a run: as many runs at a time as there are processors.
JOBS = len(os.sched_getaffinity(0))


def digest(*paths):
    total = hashlib.sha256()
    for path in paths:
        total.update(Path(path).read_bytes())
    return total.hexdigest()[:16]


def one_trial(name, seed, program):
    family = importlib.import_module(name)
    with tempfile.TemporaryDirectory() as folder:
        found = dict(family.trial(seed, Path(program), Path(folder)))
    return seed, found


def trials(name, seeds, program, jobs=1, state=None):
    """{seed: counts} of a family; those that `state` (a file) holds are not run again."""
    known = {}
    if state is not None and state.exists():
        known = {row["seed"]: row["found"] for row in map(json.loads, state.open())}
    missing = [seed for seed in seeds if seed not in known]
    if jobs == 1:
        rows = (one_trial(name, seed, program) for seed in missing)
        return _kept(rows, known, seeds, state, name)
    with ProcessPoolExecutor(jobs) as pool:
        rows = pool.map(one_trial, [name] * len(missing), missing, [program] * len(missing))
        return _kept(rows, known, seeds, state, name)


def _kept(rows, known, seeds, state, name):
    family = importlib.import_module(name)
    for seed, found in rows:
        known[seed] = found
        if state is not None:
            state.parent.mkdir(parents=True, exist_ok=True)
            with state.open("a") as file:
                file.write(json.dumps({"seed": seed, "found": found}) + "\n")
            for note in found.get("notes", []):
                print(f"{name} {seed}: {note}", flush=True)
            if any(found.get(key) for key in family.ZERO):
                print(f"{name} {seed}: {found}", flush=True)
    return {seed: known[seed] for seed in seeds}


def added_up(found):
    """Counts of each row of the table, and of all."""
    kinds = {}
    for counts in found.values():
        numbers = Counter({key: value for key, value in counts.items()
                           if key not in ("kind", "notes")})
        numbers["cases"] += 1
        kinds.setdefault(str(counts.get("kind", "all")), Counter()).update(numbers)
    if len(kinds) > 1:
        kinds["all"] = sum(kinds.values(), Counter())
    return kinds


def table(family, now, before=None):
    """Rows of Markdown; with another program each cell is `its count -> that of today`."""
    columns = {"cases": "cases", **family.COLUMNS}
    lines = ["| kind | " + " | ".join(columns.values()) + " |",
             "|---|" + "---|" * len(columns)]
    for kind in sorted(now, key=lambda word: (word == "all", word)):
        cells = [str(now[kind][key]) for key in columns]
        if before is not None:
            cells = [f"{before[kind][key]} -> {cell}" if key != "cases" else cell
                     for key, cell in zip(columns, cells)]
        lines.append(f"| {kind} | " + " | ".join(cells) + " |")
    return lines


def command_of(options, family):
    """What runs the same seeds again."""
    if options.first == 0 and options.count in (None, family.COUNT):
        return f"make family NAME={options.name}"
    return (f"python test/families/runner.py {options.name} --first {options.first} "
            f"--count {options.count or family.COUNT} --page")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", help="module of test/families")
    parser.add_argument("--count", type=int, help="cases (those of the full size)")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--before", type=Path, help="another fw_run to count beside this one")
    parser.add_argument("--jobs", type=int, default=JOBS, help="runs at a time")
    parser.add_argument("--page", action="store_true", help="write docs/robustness/NAME.md")
    options = parser.parse_args()
    os.environ["OMP_NUM_THREADS"] = "1"
    family = importlib.import_module(options.name)
    seeds = range(options.first, options.first + (options.count or family.COUNT))

    def counted(program):
        program = program.resolve()
        files = (program, Path(family.__file__), *sorted(getattr(family, "ALSO", ())))
        state = STATE / f"{options.name}-{digest(*files)}.jsonl"
        return added_up(trials(options.name, seeds, program, options.jobs, state))

    before = counted(options.before) if options.before else None
    now = counted(PROGRAM)
    lines = table(family, now, before)
    print("\n".join(lines))
    if options.page:
        told = (f"{len(seeds)} cases, seeds {seeds[0]} to {seeds[-1]}, at commit {revision()}"
                + ("; before -> now." if before else "."))
        page = ROOT / "docs" / "robustness" / f"{options.name.replace('_', '-')}.md"
        page.write_text("\n".join([f"# {family.TITLE}", "", family.TEXT.strip(), "",
                                   f"Made by `{command_of(options, family)}`.", "",
                                   told, "", *lines, ""]), encoding="utf-8")
    return int(any(counts[key] for counts in now.values() for key in family.ZERO))


if __name__ == "__main__":
    sys.exit(main())
