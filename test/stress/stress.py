"""The numerical stress suite: every family to its extremes, every end of a case judged.

    stress.py [--short] [--jobs N] [--family NAME ..] [--state FOLDER] [-o docs/robustness.md]

A case ends well in one of two ways: converged, with residual and energy balance verified in NumPy
by `stress_check`; or in words that say what failed, where, and what to try. Ends with status 1
where a case crashed, hung, left a NaN, said nothing, or was no solution.
"""
from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path

import numpy as np
import stress_cases as cases
import stress_run as runs
from stress_store import Store

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from sections import write_section

BAD = ("crash", "hang", "nan", "false", "silent")
# The answer in other units is the same to this part of its largest coefficient.
UNITS_AGREE = 1e-9
# Cases of each family in the short form, spread over the whole list.
SHORT = 12


def spread(items, number):
    """That many of the items, evenly."""
    if len(items) <= number:
        return items
    return [items[i] for i in np.linspace(0, len(items) - 1, number).astype(int)]


def run_family(pool, store, name, every):
    """Ends of the cases in their order; what the store has is not run again."""
    ends = store.ends(name, every)
    pending = [case for case in every if case.title not in ends]
    for end in pool.map(runs.run, pending):
        store.add(name, end)
        ends[end.case.title] = end
    return [ends[case.title] for case in every]


def run_units(pool, store, groups):
    """Ends of groups that have to agree; one that does not is a false answer."""
    every = [case for group in groups for _, case in group]
    ends = store.ends("units", every)
    for group in groups:
        if not all(case.title in ends for _, case in group):
            part = list(pool.map(runs.run, (case for _, case in group)))
            for (unit, _), end in zip(group, part, strict=True):
                compare_units(unit, part[0], end)
            for end in part:
                store.add("units", end)
                ends[end.case.title] = end
    return [ends[case.title] for case in every]


def compare_units(unit, first, end):
    """Mark an end that differs from the first, which is in SI units."""
    if end.verdict in BAD:
        return
    if end.verdict != first.verdict:
        end.text = f"ends as '{end.verdict}', in SI units as '{first.verdict}'\n{end.text}"
        end.verdict = "false"
    elif end.verdict == "converged":
        difference = np.abs(end.coefficients / unit[0] - first.coefficients).max()
        if difference > UNITS_AGREE * np.abs(first.coefficients).max():
            end.verdict = "false"
            end.text = f"differs from SI units by {difference:.1e}"


def outcomes(families, jobs, short, store):
    """Every end, family by family."""
    with ThreadPoolExecutor(jobs) as pool:
        for name, function in cases.FAMILIES.items():
            if families and name not in families:
                continue
            every = list(function())
            yield name, run_family(pool, store, name, spread(every, SHORT) if short else every)
        if not families or "units" in families:
            groups = list(cases.units_groups())
            yield "units", run_units(pool, store, spread(groups, 3) if short else groups)


def share(part, whole):
    return f"{100 * part / whole:.1f} %" if whole else ""


def row(*cells):
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def table_of_families(results):
    yield row("family", "cases", "converged", "in words", "silent", "crash", "hang", "NaN", "false",
              "saved by a fallback")
    yield "|---" * 10 + "|"
    everything = list(chain.from_iterable(results.values()))
    for name, ends in [*results.items(), ("all", everything)]:
        count = Counter(end.verdict for end in ends)
        saved = Counter(word for end in ends for word in end.saved)
        yield row(name.replace("_", " "), len(ends),
                  f"{count['converged']} ({share(count['converged'], len(ends))})",
                  *(count[key] for key in ("words", "silent", "crash", "hang", "nan", "false")),
                  ", ".join(f"{word} ({number})" for word, number in saved.most_common()))


def table_of_solvers(results):
    yield row("family", *cases.SOLVERS)
    yield "|---" * (1 + len(cases.SOLVERS)) + "|"
    everything = list(chain.from_iterable(results.values()))
    for name, ends in [*results.items(), ("all", everything)]:
        by = defaultdict(Counter)
        for end in ends:
            by[end.case.solver][end.verdict] += 1
        yield row(name.replace("_", " "), *(
            f"{share(by[solver]['converged'], by[solver].total())} of {by[solver].total()}"
            if by[solver] else "" for solver in cases.SOLVERS))


def table_of_words(results):
    """What did not converge, in the words of the program."""
    yield row("case", "law and solvers", "what the program says")
    yield "|---" * 3 + "|"
    groups = defaultdict(set)
    for end in chain.from_iterable(results.values()):
        if end.verdict == "words":
            said = [line for line in end.text.splitlines()
                    if line.startswith(("not converged: ", "fw_run: error:", "wear: "))]
            name = f"{end.case.family}: {end.case.name}"
            groups[name, clean(said[-1] if said else "")].add(f"{end.case.law}, {end.case.solver}")
    for (name, said), which in sorted(groups.items()):
        yield row(name, "; ".join(sorted(which)) if len(which) < 4 else f"{len(which)} of them",
                  said)


def clean(text):
    """A message without the path of its run."""
    words = [Path(word).name if word.startswith("/") else word for word in text.split()]
    return " ".join(words)


def write(path, results, short):
    """Put the tables between the marks of the document."""
    ends = list(chain.from_iterable(results.values()))
    hours = sum(end.seconds for end in ends) / 3600
    revisions = ", ".join(sorted({end.revision for end in ends}))
    body = [f"{len(ends)} cases{' (short form)' if short else ''} at commit {revisions}, "
            f"{hours:.2f} hours of runs by the clock.", "",
            *table_of_families(results), "",
            "Share converged by solver, fallbacks included:", "", *table_of_solvers(results), "",
            "Cases that end in words:", "", *table_of_words(results)]
    write_section("stress suite", body, path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--short", action="store_true", help="some cases of each family")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time")
    parser.add_argument("--family", nargs="+", default=[], help="only these families")
    parser.add_argument("--state", type=Path, help="folder where a suite that is stopped goes on")
    parser.add_argument("-o", "--output", type=Path, help="document whose tables are replaced")
    arguments = parser.parse_args()
    results, store = {}, Store(arguments.state, runs.PROGRAM)
    for name, ends in outcomes(arguments.family, arguments.jobs, arguments.short, store):
        results[name] = ends
        count = Counter(end.verdict for end in ends)
        print(f"{name:14s} {len(ends):5d} cases {sum(end.seconds for end in ends):5.0f} s ",
              ", ".join(f"{key} {number}" for key, number in count.most_common()), flush=True)
        for end in ends:
            if end.verdict in BAD:
                print(f"   {end.verdict}: {end.case.title}\n      "
                      + end.text[:600].replace("\n", "\n      "), flush=True)
    if arguments.output:
        write(arguments.output, results, arguments.short)
    return int(any(end.verdict in BAD for ends in results.values() for end in ends))


if __name__ == "__main__":
    sys.exit(main())
