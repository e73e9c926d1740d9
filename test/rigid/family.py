#!/usr/bin/env python3
"""Errors of rigid friction over 500 random structures, into docs/robustness.md.

    family.py [-n CASES] [--with OTHER_PROGRAM] [--print]
    family.py --orders [--print]     error against H of four structures, into docs/theory.md

Judge: motions from event to event (event_motion.py). Laws: rigid with its tail, dlft_velocity and
dlft of this build, and dlft_velocity of another program if one is given. A false solution counts as
converged and differs from the motion by more than half of its vibration.
"""
from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import numpy as np
from project import PROGRAM
from rigid_cases import (
    BOTH,
    ONE,
    THREE,
    TWO,
    answer,
    error,
    random_structure,
    reference_of,
)
from sections import DOCUMENT, write_section

N_HARMONICS = 9
TAIL = 255
FALSE = 0.5
#: Section of docs/theory.md; those of docs/robustness.md are named where they are written.
ORDERS = "rigid-orders"


def measure(n_cases, laws):
    """Errors and convergence of each law (law, case), and the number of cases without a judge."""
    rows = {name: [] for name in laws}
    skipped = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(n_cases):
            structure = random_structure(seed)
            reference = reference_of(structure)
            if reference is None:
                skipped += 1
                continue
            for name, (law, tail, program) in laws.items():
                coefficients, converged, iterations = answer(Path(folder), structure, law,
                                                             N_HARMONICS, tail, program)
                rows[name].append((error(coefficients, reference), converged, iterations,
                                   structure.n))
    return {name: np.array(values) for name, values in rows.items()}, skipped


def table(rows, skipped, n_cases):
    """Lines of the section."""
    count = n_cases - skipped
    lines = [f"{n_cases} random structures of one to three masses, one or two of which rub; "
             f"{count} have a motion in which each of these slips. H = {N_HARMONICS}; root mean "
             "square error of the worst mass, as a part of its vibration.", "",
             "| law | median | nine of ten below | largest | not converged | false, counted as "
             "converged | iterations, median |", "|---|---|---|---|---|---|---|"]
    for name, values in rows.items():
        errors, converged = values[:, 0], values[:, 1] > 0
        good = errors[converged]
        lines.append(f"| {name} | {np.median(good):.1e} | {np.quantile(good, 0.9):.1e} "
                     f"| {good.max():.1e} | {np.count_nonzero(~converged)} "
                     f"| {np.count_nonzero(good > FALSE)} | {np.median(values[:, 2]):.0f} |")
    more = next(iter(rows.values()))
    several = more[more[:, 3] > 1, 0]
    lines += ["", f"Of the {len(several)} structures with more than one mass, `rigid` has the "
                  f"median {np.median(several):.1e} and nine of ten below "
                  f"{np.quantile(several, 0.9):.1e}; the others are exact but for the harmonics "
                  f"above {TAIL}."]
    return lines


def orders(laws, harmonics=(1, 3, 7, 15, 31)):
    """Lines of the table of errors against H."""
    names = {"one mass": ONE, "two masses, the second rubs": TWO, "two masses, both rub": BOTH,
             "three masses, the second rubs": THREE}
    lines = ["| structure | law | " + " | ".join(f"H = {n}" for n in harmonics) + " |",
             "|---|---|" + "---|" * len(harmonics)]
    with tempfile.TemporaryDirectory() as folder:
        for title, structure in names.items():
            reference = reference_of(structure)
            for name, (law, tail, program) in laws.items():
                cells = []
                for n in harmonics:
                    coefficients, converged, _ = answer(Path(folder), structure, law, n, tail,
                                                        program)
                    cells.append(f"{error(coefficients, reference):.1e}" if converged else "-")
                lines.append(f"| {title} | {name} | " + " | ".join(cells) + " |")
    return lines


def main():
    """Measure and write, or print."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", type=int, default=500, metavar="CASES")
    parser.add_argument("--with", dest="other", metavar="PROGRAM")
    parser.add_argument("--orders", action="store_true")
    parser.add_argument("--print", action="store_true", help="do not write the document")
    options = parser.parse_args()
    laws = {"`rigid`": ("rigid", TAIL, PROGRAM),
            "`dlft_velocity`": ("dlft_velocity", 0, PROGRAM), "`dlft`": ("dlft", 0, PROGRAM)}
    if options.other:
        laws["`dlft_velocity`, the program before"] = ("dlft_velocity", 0, options.other)
    if options.orders:
        lines = orders(laws)
        if not options.print:
            write_section(ORDERS, ["", *lines, ""], DOCUMENT.with_name("theory.md"))
            return
        print("\n".join(lines))
        return
    lines = table(*measure(options.n, laws), options.n)
    if options.print:
        print("\n".join(lines))
    else:
        write_section("rigid", ["", *lines, ""])


if __name__ == "__main__":
    main()
