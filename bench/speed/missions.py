"""Missions of wear on the blade sector with 48 pairs: flights in their order, the same blocks as
runs one by one, and a thousand flights by jumps, written to a page.

    python -m bench.speed.missions [--program build/release/fw_run] [--flights 1000]
        [--page docs/benchmarks/missions.md]
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from bench.common.layout import table, wrapped
from bench.common.measure import ROOT
from bench.common.pages import write_overview
from fretwear._namelist import write_namelist
from fretwear.result import Result

PAGE = ROOT / "docs" / "benchmarks" / "missions.md"
#: Wall times [s] of ten flights of four blocks, and of a thousand by jumps; and what the depths of
#: the same blocks as runs of their own may differ by, over the largest.
FEW, MANY, SAME = 10.0, 120.0, 1e-7
TOLERANCES = (1e-2, 1e-3, 1e-4)
TEXT = """# Missions

Wear of the blade sector with 48 pairs (4400 rpm, 3 harmonics, 64 instants) over flights of four
blocks: near the peak, beside it, at a lower load, and at half of it with less static load. Wall
times of `fw_run` in one thread. Wanted: ten flights in {few:.0f} s, with the depths of the same
blocks as runs of their own; a thousand by jumps in {many:.0f} s, off the flights in their order by
no more than `jump_error` says, at the end of every jump. Differences are parts of the largest
depth; flights in their order have the tolerance of the default (1e-3), the last rows that of the
row. `python -m bench.speed.missions`.
"""

Groups = dict[str, dict[str, Any]]
CASE: Groups = {
    "case": {"analysis": "wear", "threads": 1},
    "model": {"source": "hdf5", "rotation_speed": 460.8, "modal_damping": 1e-3,
              "file": str(ROOT / "example" / "blade_sector" / "sector_48.h5")},
    "load": {"harmonic_scale": 0.5},
    "harmonics": {"n_harmonics": 3, "n_time": 64},
    "sweep": {"start": 1022.0, "unit": "Hz"},
    "output": {"observe": "tip"},
    "wear": {"coefficient": 1e-6}}
#: (cycles, change) of each block.
BLOCKS = ((2e4, ""), (1e4, "sweep%start = 1010"), (1e4, "load%harmonic_scale = 0.35"),
          (5e3, "load%harmonic_scale = 0.25; load%static_scale = 0.9"))


def execute(program: Path, folder: Path, groups: Groups, name: str,
            *options: str) -> tuple[Result, float]:
    """A run, and its wall time [s]."""
    (folder / f"{name}.nml").write_text(write_namelist(groups))
    start = time.perf_counter()
    subprocess.run([str(program), "-q", f"{name}.nml", *options], cwd=folder, check=True)
    return Result(folder / f"{name}.h5"), time.perf_counter() - start


def mission(n_flights: int, per_jump: int, tolerance: float = 1e-3) -> Groups:
    return CASE | {"wear": CASE["wear"] | {"error_tolerance": tolerance}, "mission": {
        "n_blocks": len(BLOCKS), "cycles": [cycles for cycles, _ in BLOCKS],
        "change": [change for _, change in BLOCKS], "n_flights": n_flights,
        "flights_per_jump": per_jump}}


def one_by_one(program: Path, folder: Path, n_flights: int) -> tuple[Any, float]:
    """The last depth of the blocks as runs of their own, and the time of all."""
    total, last = 0.0, ""
    for flight in range(n_flights):
        for number, (cycles, change) in enumerate(BLOCKS):
            name = f"block_{flight}_{number}"
            groups = CASE | {"wear": CASE["wear"] | {"n_cycles": cycles}}
            if last:
                groups = groups | {"contact": {"worn": f"{last}.h5"}}
            options = [word for item in change.split(";") if item.strip()
                       for word in ("--set", item.strip().replace(" ", ""))]
            result, seconds = execute(program, folder, groups, name, *options)
            total, last = total + seconds, name
    return result["wear/depth"][-1], total


def judged(value: float, limit: float) -> str:
    return "met" if value <= limit else "missed"


def measure(program: Path, folder: Path, many: int) -> list[str]:
    """The table."""
    ordered, seconds = execute(program, folder, mission(10, 1), "ordered")
    depth = ordered["wear/depth"][-1]
    rows = [("flights in their order", "10", str(marches(ordered)),
             f"{seconds:.1f}: {judged(seconds, FEW)}", "", "")]
    single, seconds = one_by_one(program, folder, 10)
    off = np.abs(single - depth).max() / depth.max()
    rows.append(("blocks as runs of their own", "10", str(10 * len(BLOCKS)), f"{seconds:.1f}",
                 f"{off:.1e}: {judged(off, SAME)}", ""))
    ordered, seconds = execute(program, folder, mission(many, 1), "many")
    flights = ordered["mission/depth"]
    rows.append(("flights in their order", str(many), str(marches(ordered)), f"{seconds:.1f}", "",
                 ""))
    for tolerance in TOLERANCES:
        jumps, seconds = execute(program, folder, mission(many, 0, tolerance), "jumps")
        found = jumps["mission/depth"]
        flown = np.isfinite(found).all(axis=1)
        off = np.abs(found - flights)[flown].max() / flights.max()
        stated = attribute(jumps, "jump_error") / flights.max()
        rows.append((f"by jumps, {tolerance:.0e}", str(many), str(marches(jumps)),
                     f"{seconds:.1f}: {judged(seconds, MANY)}",
                     f"{off:.1e}: {judged(off, stated)}", f"{stated:.1e}"))
    return table(["run", "flights", "marches of a block", "wall time [s]", "difference",
                  "stated"], rows)


def attribute(result: Result, name: str) -> float:
    """An attribute of /mission."""
    with h5py.File(result.path) as file:
        return float(file["mission"].attrs[name])


def marches(result: Result) -> int:
    return int(attribute(result, "n_marches"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=Path, default=ROOT / "build" / "release" / "fw_run")
    parser.add_argument("--flights", type=int, default=1000)
    parser.add_argument("--page", type=Path, default=PAGE)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        lines = measure(options.program.resolve(), Path(folder), options.flights)
    print("\n".join(lines))
    text = TEXT.format(few=FEW, many=MANY)
    options.page.write_text(wrapped("\n".join([text, *lines])) + "\n", encoding="utf-8")
    if options.page == PAGE:
        write_overview(PAGE.parent.parent)


if __name__ == "__main__":
    main()
