#!/usr/bin/env python3
"""What an accuracy costs on the example sectors, beside the cheapest setting of H that keeps it,
into docs/robustness.md.

    sector_costs.py [--pairs 16 48] [--points N] [--print]

Three loads at 2500, 3600 and 4400 rpm, frequencies around the peak. The reference is `dlft` with 47
harmonics and located events. Errors are those of the coefficients of the tip, the largest of the
points; costs are processor time of the whole program.
"""
from __future__ import annotations

import argparse
import resource
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import cases
import h5py
import numpy as np
from project import SECTOR
from sections import write_section

#: Speeds [rad/s] by their names in rpm, with the peaks [Hz] of the sectors at 0.5 N.
SPEEDS = {"4400": (460.8, {16: 1022.8, 48: 1017.8}), "3600": (377.0, {16: 1017.2, 48: 1012.4}),
          "2500": (261.8, {16: 1011.5, 48: 1006.9})}
LOADS = (0.25, 0.5, 1.0)
#: Half of the interval around a peak [Hz].
AROUND = 1.5
REFERENCE, LEVELS = 47, (1, 3, 5, 7, 9, 15, 23, 31)
ACCURACIES = (1e-2, 1e-3, 1e-4)


def sector(pairs, speed, load, n_points, law="dlft"):
    """Groups of a sweep."""
    omega, peaks = SPEEDS[speed]
    return {"case": {"analysis": "frf", "threads": 1},
            "model": {"source": "hdf5", "file": str(SECTOR / f"sector_{pairs}.h5"),
                      "rotation_speed": omega, "modal_damping": 1e-3},
            "contact": {"law": law}, "load": {"harmonic_scale": load}, "harmonics": {},
            "sweep": {"start": peaks[pairs] + AROUND, "end": peaks[pairs] - AROUND,
                      "n_points": n_points, "unit": "Hz"},
            "output": {"observe": "tip"}}


def solve(folder, groups, harmonics):
    """Coefficients (point, 2H+1), what counts, the estimate, the levels, and seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    cases.run(folder, cases.merged(groups, {"harmonics": harmonics}), status=(0, 4), seconds=900.0)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    with h5py.File(folder / "case.h5") as file:
        converged = file["converged"][:].astype(bool)
        bound = file["error_estimate"][:] if "error_estimate" in file else np.zeros(len(converged))
        levels = file["harmonics"][:] if "harmonics" in file else None
        return (file["coefficients"][:, :, 0], converged, bound, levels,
                after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def distance(values, reference):
    """Largest distance of the points, relative to the vibration."""
    worst = 0.0
    for a, b in zip(values, reference):
        n = max(len(a), len(b))
        a, b = (np.concatenate([x, np.zeros(n - len(x))]) for x in (a, b))
        d = a - b
        d[0] *= np.sqrt(2.0)
        worst = max(worst, np.linalg.norm(d) / np.linalg.norm(b[1:]))
    return worst


def measure(folder, pairs, speed, load, n_points):
    """Rows (accuracy, most harmonics, kept or not claimed, error, ratio of costs)."""
    groups = sector(pairs, speed, load, n_points)
    exact, solved, *_ = solve(folder, groups, {"n_harmonics": REFERENCE, "sampling": "events"})
    if not solved.all():
        return []
    settings = []
    for n in LEVELS:
        for harmonics in ({"n_harmonics": n}, {"n_harmonics": n, "n_time": 64 * (1 + n // 8)}):
            values, converged, *_, seconds = solve(folder, groups, harmonics)
            if converged.all():
                settings.append((seconds, distance(values, exact)))
    rows = []
    for accuracy in ACCURACIES:
        values, converged, bound, levels, seconds = solve(folder, groups, {"accuracy": accuracy})
        error = distance(values, exact)
        claimed = converged.all() and bound.max() <= accuracy
        cheapest = min((s for s, e in settings if e <= accuracy), default=np.nan)
        rows.append((pairs, speed, load, accuracy, int(levels.max()), claimed, error,
                     seconds, seconds / cheapest))
    return rows


def table(rows):
    """Lines of the section."""
    lines = ["| pairs | rpm | load [N] | accuracy | H | error | | processor time [s] "
             "| times the cheapest |", "|---|---|---|---|---|---|---|---|---|"]
    for pairs, speed, load, accuracy, n, claimed, error, seconds, ratio in rows:
        word = ("kept" if error <= accuracy else "broken") if claimed else "not claimed"
        cost = "-" if np.isnan(ratio) else f"{ratio:.1f}"
        lines.append(f"| {pairs} | {speed} | {load:g} | {accuracy:.0e} | {n} | {error:.1e} "
                     f"| {word} | {seconds:.2f} | {cost} |")
    return lines


def main():
    """Measure and write, or print."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, nargs="*", default=[16, 48])
    parser.add_argument("--speed", choices=SPEEDS, nargs="*", default=list(SPEEDS))
    parser.add_argument("--load", type=float, nargs="*", default=list(LOADS))
    parser.add_argument("--points", type=int, default=5)
    parser.add_argument("--print", action="store_true", help="do not write the document")
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as name:
        for pairs in options.pairs:
            for speed in options.speed:
                for load in options.load:
                    rows += measure(Path(name), pairs, speed, load, options.points)
                    if options.print:
                        print(*rows[-len(ACCURACIES):], sep="\n", flush=True)
    if not options.print:
        write_section("sector-costs", ["", *table(rows), ""])


if __name__ == "__main__":
    main()
