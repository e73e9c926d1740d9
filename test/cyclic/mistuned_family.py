"""Random sectors whose contact differs, against the whole annulus, counted into docs/robustness.md.

    python test/cyclic/mistuned_family.py [--count 60] [--seed 0] [--state FILE] [-o FILE]

Every case has a sector without symmetry, 3 to 7 sectors, any engine order from -N to N, one or two
pairs across and inside with one or two tangential directions, a law, and contact data that differ
from sector to sector by up to 5, 30 or 80 %; all sectors and the annulus are solved at three
frequencies. All marches start at the same instant in both, so that no case has to be left out.
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
from annulus import Annulus, mistuned, random_case  # noqa: E402
from family import EQUAL, LAWS, solve  # noqa: E402
from sections import write_section  # noqa: E402

SPREADS = (0.05, 0.3, 0.8)


def sampling_of(law, planar):
    """As each law needs it; both have the same instants."""
    if law == "regularised":
        return {"sampling": "uniform", "n_time": 256}
    if law == "rigid":
        return {"sampling": "auto"}
    if planar or law == "dlft_velocity":
        return {"sampling": "uniform", "n_time": 96}
    return {"sampling": "events"}


def one(seed):
    """The points of a case: what came of each, and its difference."""
    rng = np.random.default_rng([37, seed])
    n_sectors, law = int(rng.integers(3, 8)), LAWS[seed % len(LAWS)]
    planar, spread = rng.random() < 0.25, SPREADS[seed // len(LAWS) % len(SPREADS)]
    case = mistuned(rng, random_case(
        rng, law=law, planar=planar, n_sectors=n_sectors,
        engine_order=int(rng.integers(-n_sectors, n_sectors + 1))), spread)
    omegas = sorted(float(w) for w in rng.uniform(0.5, 2.5, 3))
    annulus, sampling, points = Annulus(case), sampling_of(law, planar), []
    with tempfile.TemporaryDirectory() as name:
        u, f = solve(Path(name) / "sectors", case, omegas, sampling)
        whole, g = solve(Path(name) / "annulus", annulus.case, omegas, sampling)
    v = np.concatenate([annulus.sector(whole, j) for j in range(n_sectors)], axis=-1)
    for i in range(len(omegas)):
        solved = [bool(np.isfinite(x[i]).all()) for x in (u, v)]
        difference = float(max(np.abs(a[i] - b[i]).max() / np.abs(b[i]).max()
                               for a, b in ((u, v), (f, g))))
        what = ("equal" if difference <= EQUAL else "different") if all(solved) else (
            "neither" if not any(solved) else "annulus only" if solved[1] else "sectors only")
        points.append({"what": what, "difference": difference})
    return f"{law}{', two directions' if planar else ''}, {100.0 * spread:.0f} %", points


def table(found):
    """One row for each law and spread, and one of all."""
    lines = ["", "| law, contact differs by | points | equal | largest difference | different "
             "| all sectors only | annulus only | neither |", "|---|---|---|---|---|---|---|---|"]
    for law, points in [*sorted(found.items()),
                        ("all", [point for group in found.values() for point in group])]:
        count = Counter(point["what"] for point in points)
        equal = max((p["difference"] for p in points if p["what"] == "equal"), default=0.0)
        lines.append(f"| {law} | {len(points)} | {count['equal']} | {equal:.1e} | "
                     f"{count['different']} | {count['sectors only']} | {count['annulus only']} | "
                     f"{count['neither']} |")
    return [*lines, ""]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0, help="first case")
    parser.add_argument("--state", type=Path, help="goes on where a run with this file stopped")
    parser.add_argument("-o", "--output", type=Path, help="document with the section `mistuned`")
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
            if point["what"] == "different":
                print(f"case {seed}, {law}, point {i + 1}: {point}", file=sys.stderr, flush=True)
    lines = table(found)
    print("\n".join(lines))
    if options.output:
        write_section("mistuned", lines, options.output)


if __name__ == "__main__":
    main()
