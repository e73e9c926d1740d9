"""Random sectors against the whole annulus, counted: `python test/cyclic/family.py --count 300`.

Every case has a sector without symmetry, 5 to 13 sectors, any engine order from -2N to 2N, one or
two pairs across and inside, and a law; both are solved at three frequencies. Of both the points are
compared that converged; frequencies where one of them did not are counted. So are annuli whose own
sectors are not those of sector 0, delayed: with two tangential directions friction that slips while
it settles depends on where the period begins, which is another phase for each sector of an annulus.
"""
from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "support"), str(HERE.parents[1])]

import numpy as np  # noqa: E402
from annulus import Annulus, random_case  # noqa: E402
from cases import read, run  # noqa: E402
from cyclic_cases import TIGHT, model_groups  # noqa: E402

import conftest  # noqa: E402, F401  (the package of this source tree)

#: Sectors of an annulus are one another, delayed, within this.
SYMMETRIC = 1e-9
LAWS = ("penalty", "dlft", "dlft_velocity", "rigid")


def solve(folder, case, omegas, planar):
    """Coefficients and forces; rows that did not converge are NaN."""
    groups = model_groups(case) | {
        "case": {"analysis": "frf", "threads": 1}, "sweep": {"frequencies": omegas},
        "harmonics": {"n_harmonics": 5}, "solver": {"tolerance": TIGHT}}
    if planar:
        # The instants of all sectors are the same: a multiple of their number.
        groups["harmonics"] |= {"sampling": "uniform", "n_time": 16 * planar}
    elif case["law"] == "dlft_velocity":
        groups["harmonics"] |= {"sampling": "uniform", "n_time": 32 * case.get("n_time_of", 1)}
    else:
        groups["harmonics"]["sampling"] = "auto" if case["law"] == "rigid" else "events"
    groups["case"]["max_seconds"] = 60.0
    run(folder, groups, status=(0, 4, 6), seconds=300.0)
    found = read(folder / "case.h5")
    bad = ~found["converged"].astype(bool)
    for name in ("coefficients", "contact/force"):
        found[name][bad] = np.nan
    return found


def asymmetry(annulus, case, coefficients):
    """Largest difference between the sectors of an annulus, brought to the phase of sector 0."""
    def amplitudes(j):
        values = annulus.sector(coefficients, j)
        return values[0], values[1::2] - 1j * values[2::2]

    mean, first = amplitudes(0)
    n = np.arange(1, len(first) + 1)[:, None]
    phase = 2.0 * np.pi * case["engine_order"] / case["n_sectors"]
    worst = 0.0
    for j in range(1, case["n_sectors"]):
        other_mean, other = amplitudes(j)
        worst = max(worst, np.abs(other_mean - mean).max(),
                    np.abs(other * np.exp(1j * n * j * phase) - first).max())
    return worst / np.abs(coefficients).max()


def one(seed):
    """Number of the case: its law and the largest differences, relative; None where not solved."""
    rng = np.random.default_rng([29, seed])
    law = LAWS[seed % len(LAWS)]
    n_sectors = int(rng.integers(5, 14))
    planar = law in ("penalty", "dlft") and rng.random() < 0.25
    case = random_case(rng, law=law, n_sectors=n_sectors, planar=planar,
                       engine_order=int(rng.integers(-2 * n_sectors, 2 * n_sectors + 1)))
    annulus = Annulus(case)
    case["n_time_of"] = annulus.case["n_time_of"] = n_sectors
    omegas = sorted(float(w) for w in rng.uniform(0.5, 2.5, 3))
    with tempfile.TemporaryDirectory() as folder:
        found = []
        for name, what in (("sector", case), ("annulus", annulus.case)):
            (Path(folder) / name).mkdir()
            found.append(solve(Path(folder) / name, what, omegas, n_sectors if planar else 0))
    n = len(case["contact"]["side_1"])
    u, v = found[0]["coefficients"], annulus.sector(found[1]["coefficients"])
    f, g = found[0]["contact/force"], found[1]["contact/force"][:, :, :n]
    differences = []
    for i in range(len(omegas)):
        # A run that ended at its limit of time has fewer rows.
        if i >= min(len(u), len(v)) or np.isnan(u[i]).any() or np.isnan(v[i]).any():
            differences.append(None)
            continue
        if asymmetry(annulus, case, found[1]["coefficients"][i]) > SYMMETRIC:
            differences.append(np.nan)
            continue
        differences.append(max(np.abs(u[i] - v[i]).max() / np.abs(v[i]).max(),
                               np.abs(f[i] - g[i]).max() / np.abs(g[i]).max()))
    return law + (" planar" if planar else ""), differences


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0, help="first case")
    options = parser.parse_args()
    table = {}
    for seed in range(options.seed, options.seed + options.count):
        law, differences = one(seed)
        table.setdefault(law, []).extend(differences)
        if any(d is not None and d > 1e-8 for d in differences):
            print(f"case {seed}, {law}: {differences}", flush=True)
    print("| law | points | not solved | annulus asymmetric | above 1e-8 | largest difference |")
    print("|---|---|---|---|---|---|")
    for law, differences in sorted(table.items()):
        solved = [d for d in differences if d is not None]
        compared = [d for d in solved if not np.isnan(d)]
        print(f"| {law} | {len(differences)} | {len(differences) - len(solved)} "
              f"| {len(solved) - len(compared)} | {sum(d > 1e-8 for d in compared)} "
              f"| {max(compared, default=0.0):.1e} |")


if __name__ == "__main__":
    main()
