"""Random sectors against the whole annulus, judged and counted, into docs/robustness.md.

    python test/cyclic/family.py [--count 300] [--seed 0] [--state FILE] [-o docs/robustness.md]

Every case has a sector without symmetry, 5 to 13 sectors, any engine order from -2N to 2N, one or
two pairs across and inside with one or two tangential directions, and a law; sector and annulus are
solved at three frequencies. Points that converged in both are compared, and those of the sector
held against its equations in NumPy, right and with the usual mistakes (`wave_equations`).

With two tangential directions friction that slips only while it settles depends on where the period
begins, which is another phase for each sector of an annulus: that annulus is no reference. It is
taken for one of these only if the sector alone, begun at the phases of the others, proves it. Where
both are sound and differ, the motion of the sector is put around the annulus: if it solves its
equations and its law too, there are two (`two_solutions`).
"""
from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections import Counter
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "support"), str(HERE.parents[1])]

import numpy as np  # noqa: E402
from annulus import Annulus, random_case  # noqa: E402
from cases import read, run  # noqa: E402
from cyclic_cases import TIGHT, model_groups  # noqa: E402
from sections import write_section  # noqa: E402
from two_solutions import annulus_defect, delayed  # noqa: E402
from wave_equations import VARIANTS, defect, shows  # noqa: E402

import conftest  # noqa: E402, F401  (the package of this source tree)

#: Sectors of an annulus are one another, delayed, within this.
SYMMETRIC = 1e-9
#: What both are to agree in.
EQUAL = 1e-8
#: Balance in NumPy: the program asks 1e-12 of the condensed equations.
BALANCED = 1e-9
LAWS = ("penalty", "dlft", "dlft_velocity", "rigid", "regularised")
N_HARMONICS = 5


def family_case(seed):
    """The case of a number, and the frequencies that it is solved at."""
    rng = np.random.default_rng([29, seed])
    n_sectors = int(rng.integers(5, 14))
    planar = rng.random() < 0.25
    case = random_case(rng, law=LAWS[seed % len(LAWS)], n_sectors=n_sectors, planar=planar,
                       engine_order=int(rng.integers(-2 * n_sectors, 2 * n_sectors + 1)))
    return case, planar, sorted(float(w) for w in rng.uniform(0.5, 2.5, 3))


def solve(folder, case, omegas, sampling):
    """Coefficients and forces; rows that did not converge, or were not come to, are NaN."""
    groups = model_groups(case) | {
        "case": {"analysis": "frf", "threads": 1, "max_seconds": 60.0},
        "sweep": {"values": omegas}, "solver": {"tolerance": TIGHT},
        "harmonics": {"n_harmonics": N_HARMONICS, **sampling}}
    folder.mkdir(exist_ok=True)
    run(folder, groups, status=(0, 4, 6), seconds=300.0)
    found = read(folder / "case.h5")
    bad = ~found["converged"].astype(bool)
    values = []
    for name in ("coefficients", "contact/force"):
        rows = np.full((len(omegas), *found[name].shape[1:]), np.nan)
        rows[:len(bad)] = np.where(bad.reshape(-1, *[1] * (rows.ndim - 1)), np.nan, found[name])
        values.append(rows)
    return values


def asymmetry(annulus, case, coefficients):
    """Largest difference between the sectors of an annulus, brought to the phase of sector 0."""
    phase = 2.0 * np.pi * case["engine_order"] / case["n_sectors"]
    first = annulus.sector(coefficients)
    return max(float(np.abs(delayed(annulus.sector(coefficients, j), -j * phase) - first).max())
               for j in range(1, case["n_sectors"])) / float(np.abs(coefficients).max())


def depends_on_begin(folder, case, omega, sampling, coefficients):
    """Largest difference of a sector alone whose period begins where those of the others do."""
    worst = 0.0
    for j in range(1, case["n_sectors"]):
        angle = 2.0 * np.pi * j / case["n_sectors"]
        load = {key: np.array(values) for key, values in case["load"].items()}
        both = delayed(np.array([load["static"], load["cosine"], load["sine"]]), angle)
        other = {**case, "load": dict(zip(("static", "cosine", "sine"), both.tolist()))}
        found = solve(folder, other, [omega], sampling)[0][0]
        if np.isfinite(found).all():
            worst = max(worst, np.abs(delayed(found, -angle) - coefficients).max())
    return float(worst / np.abs(coefficients).max())


def sampling_of(case, planar):
    """The instants of all sectors are the same where they are a multiple of their number."""
    n = case["n_sectors"]
    if case["law"] == "regularised":
        return {"sampling": "uniform", "n_time": 64 * n}
    if case["law"] == "rigid":
        return {"sampling": "auto"}
    if planar or case["law"] == "dlft_velocity":
        return {"sampling": "uniform", "n_time": (16 if planar else 32) * n}
    return {"sampling": "events"}


def one(seed):
    """The points of a case: what came of each, its difference, its balance by variant."""
    case, planar, omegas = family_case(seed)
    annulus, sampling, points = Annulus(case), sampling_of(case, planar), []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        u, f = solve(folder / "sector", case, omegas, sampling)
        whole, g = solve(folder / "annulus", annulus.case, omegas, sampling)
        v, g = annulus.sector(whole), g[:, :, :len(case["contact"]["side_1"])]
        for i, omega in enumerate(omegas):
            solved = [bool(np.isfinite(x[i]).all()) for x in (u, v)]
            point = {"balance": {}, "difference": np.nan, "asymmetry": np.nan}
            if solved[0]:
                point["balance"] = {name: defect(case, omega, u[i], f[i], name)
                                    for name in VARIANTS
                                    if name == "right" or shows(case, name, u[i])}
            if not all(solved):
                point["what"] = ("neither" if not any(solved) else
                                 "annulus only" if solved[1] else "sector only")
                points.append(point)
                continue
            point["difference"] = float(max(np.abs(a[i] - b[i]).max() / np.abs(b[i]).max()
                                            for a, b in ((u, v), (f, g))))
            point["asymmetry"] = asymmetry(annulus, case, whole[i])
            point["what"] = "equal" if point["difference"] <= EQUAL else "different"
            if point["asymmetry"] > SYMMETRIC:
                point["begin"] = depends_on_begin(folder / "begin", case, omega, sampling, u[i])
                point["what"] = "begin" if point["begin"] > SYMMETRIC else "asymmetric"
            elif point["what"] == "different" and case["law"] == "dlft_velocity":
                point["defect"] = annulus_defect(annulus, case, omega, u[i], f[i],
                                                 sampling["n_time"])
                if point["defect"] <= BALANCED:
                    point["what"] = "two solutions"
            points.append(point)
    return case["law"] + (", two directions" if planar else ""), points


def tables(found):
    """Rows of the document: what came of all points, then the power of the judge."""
    columns = ["law", "points", "equal", "largest difference", "other", "depend on the begin",
               "their difference", "two solutions", "sector only", "annulus only", "neither",
               "largest defect"]
    lines = ["", f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    everything = [point for points in found.values() for point in points]
    for law, points in [*sorted(found.items()), ("all", everything)]:
        count = Counter(point["what"] for point in points)
        equal, begin = (max((p["difference"] for p in points if p["what"] == what), default=0.0)
                        for what in ("equal", "begin"))
        defects = max((p["balance"]["right"] for p in points if p["balance"]), default=0.0)
        cells = [law, len(points), count["equal"], f"{equal:.1e}",
                 count["different"] + count["asymmetric"], count["begin"], f"{begin:.1e}",
                 count["two solutions"], count["sector only"], count["annulus only"],
                 count["neither"], f"{defects:.1e}"]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    lines += ["", "| equations in NumPy | points | defect, least | median | largest "
              f"| above {BALANCED:.0e} |", "|---|---|---|---|---|---|"]
    for name in VARIANTS:
        sizes = np.array([p["balance"][name] for p in everything if name in p["balance"]])
        if len(sizes):
            lines.append(f"| {name} | {len(sizes)} | {sizes.min():.1e} | {np.median(sizes):.1e} "
                         f"| {sizes.max():.1e} | {(sizes > BALANCED).sum()} |")
    return [*lines, ""]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0, help="first case")
    parser.add_argument("--state", type=Path, help="goes on where a run with this file stopped")
    parser.add_argument("-o", "--output", type=Path, help="document with the section `sectors`")
    options = parser.parse_args()
    done, found = {}, {}
    if options.state and options.state.exists():
        for line in options.state.read_text().splitlines():
            seed, law, points = json.loads(line)
            done[seed] = law, points
    for seed in range(options.seed, options.seed + options.count):
        if seed not in done:
            done[seed] = one(seed)
            if options.state:
                with options.state.open("a") as file:
                    file.write(json.dumps([seed, *done[seed]]) + "\n")
        law, points = done[seed]
        found.setdefault(law, []).extend(points)
        for i, point in enumerate(points):
            if point["what"] in ("different", "asymmetric"):
                print(f"case {seed}, {law}, point {i + 1}: {point}", file=sys.stderr, flush=True)
    lines = tables(found)
    print("\n".join(lines))
    if options.output:
        write_section("sectors", lines, options.output)


if __name__ == "__main__":
    main()
