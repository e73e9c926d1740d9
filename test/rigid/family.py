#!/usr/bin/env python3
"""Errors of rigid friction over 500 random structures, into docs/robustness.md.

    family.py [-n CASES] [--with OTHER_PROGRAM] [--print]
    family.py --orders [--print]     error against H of four structures, into docs/theory.md

Judge: motions from event to event (event_motion.py). Laws: rigid with its tail, dlft_velocity, dlft
and stiff penalty of this build, and dlft_velocity and dlft of another program if one is given. A
false solution counts as converged and differs from the motion by more than half of its vibration.
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
    LOADED,
    ONE,
    STOPPING,
    THREE,
    TWO,
    answer,
    error,
    random_structure,
    reference_of,
)
from sections import DOCUMENT, write_section

HARMONICS = (3, 9)
TAIL = 255
#: Stiffness of `penalty`, some 40 times that of the springs.
STIFF = {"tangential_stiffness": 50.0}
FALSE = 0.5
#: Structures of the whole family.
ALL = 500
#: Section of docs/theory.md; those of docs/robustness.md are named where they are written.
ORDERS = "rigid-orders"


def measure(n_cases, laws):
    """Errors and convergence of each law and H (case), and the number of cases without a judge."""
    rows = {(n, name): [] for n in HARMONICS for name in laws}
    skipped = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(n_cases):
            structure = random_structure(seed)
            reference = reference_of(structure)
            if reference is None:
                skipped += 1
                continue
            for n, name in rows:
                law, tail, program, contact = laws[name]
                coefficients, converged, iterations = answer(Path(folder), structure, law, n, tail,
                                                             program, **contact)
                rows[n, name].append((error(coefficients, reference), converged, iterations,
                                      structure.n))
    return {key: np.array(values) for key, values in rows.items()}, skipped


def table(rows, skipped, n_cases):
    """Lines of the section."""
    count = n_cases - skipped
    lines = [f"{n_cases} random structures of one to three masses, one or two of which rub; "
             f"{count} have a motion in which each of these slips. Root mean square error of the "
             "worst mass, as a part of its vibration.", "",
             "| H | law | median | nine of ten below | largest | not converged | false, counted as "
             "converged | iterations, median |", "|---|---|---|---|---|---|---|---|"]
    for (n, name), values in rows.items():
        errors, converged = values[:, 0], values[:, 1] > 0
        good = errors[converged]
        lines.append(f"| {n} | {name} | {np.median(good):.1e} | {np.quantile(good, 0.9):.1e} "
                     f"| {good.max():.1e} | {np.count_nonzero(~converged)} "
                     f"| {np.count_nonzero(good > FALSE)} | {np.median(values[:, 2]):.0f} |")
    more = rows[max(HARMONICS), "`rigid`"]
    several = more[more[:, 3] > 1, 0]
    lines += ["", f"Of the {len(several)} structures with more than one mass, `rigid` has the "
                  f"median {np.median(several):.1e} and nine of ten below "
                  f"{np.quantile(several, 0.9):.1e} at H = {max(HARMONICS)}; the others are exact "
                  f"but for the harmonics above {TAIL}."]
    return lines


def orders(laws, harmonics=(1, 3, 7, 15, 31)):
    """Lines of the table of errors against H."""
    names = {"one mass": ONE, "two masses, the second rubs": TWO, "two masses, both rub": BOTH,
             "three masses, the second rubs": THREE, "three masses, with a static load": LOADED,
             "two masses, stops within a period": STOPPING}
    lines = ["| structure | law | " + " | ".join(f"H = {n}" for n in harmonics) + " |",
             "|---|---|" + "---|" * len(harmonics)]
    with tempfile.TemporaryDirectory() as folder:
        for title, structure in names.items():
            reference = reference_of(structure)
            for name, (law, tail, program, contact) in laws.items():
                cells = []
                for n in harmonics:
                    coefficients, converged, _ = answer(Path(folder), structure, law, n, tail,
                                                        program, **contact)
                    cells.append(f"{error(coefficients, reference):.1e}" if converged else "-")
                lines.append(f"| {title} | {name} | " + " | ".join(cells) + " |")
    return lines


def main():
    """Measure and write, or print."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", type=int, default=ALL, metavar="CASES")
    parser.add_argument("--with", dest="other", metavar="PROGRAM")
    parser.add_argument("--orders", action="store_true")
    parser.add_argument("--print", action="store_true", help="do not write the document")
    options = parser.parse_args()
    laws = {"`rigid`": ("rigid", TAIL, PROGRAM, {}),
            "`dlft_velocity`": ("dlft_velocity", 0, PROGRAM, {}),
            "`dlft`": ("dlft", 0, PROGRAM, {}), "`penalty`, stiff": ("penalty", 0, PROGRAM, STIFF)}
    if options.orders:
        for scale in (0.7, 1.3):
            laws[f"`rigid`, {scale:g} of its m, c, k"] = ("rigid", TAIL, PROGRAM,
                                                          {"penalty_scale": scale})
        lines = orders(laws)
        if not options.print:
            write_section(ORDERS, ["", *lines, ""], DOCUMENT.with_name("theory.md"))
            return
        print("\n".join(lines))
        return
    if options.other:
        for law in ("dlft_velocity", "dlft"):
            laws[f"`{law}`, the program before"] = (law, 0, options.other, {})
    lines = table(*measure(options.n, laws), options.n)
    if options.print:
        print("\n".join(lines))
    else:
        # The count of all and that of a part stand beside each other.
        write_section("rigid" if options.n >= ALL else "rigid-part", ["", *lines, ""])


if __name__ == "__main__":
    main()
