"""Missions of wear on the blade sector with 48 pairs: flights in their order, the same blocks as
runs one by one, and a thousand flights by jumps.

    python -m bench.speed.missions [--program build/release/fw_run] [--flights 1000]

The table goes to the screen.
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

from bench.common.measure import ROOT
from fretwear._namelist import write_namelist
from fretwear.result import Result

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


def mission(n_flights: int, per_jump: int) -> Groups:
    return CASE | {"mission": {
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


def measure(program: Path, folder: Path, many: int) -> list[str]:
    """The lines of the table."""
    ordered, seconds = execute(program, folder, mission(10, 1), "ordered")
    depth = ordered["wear/depth"][-1]
    lines = ["| run | flights | marches of a block | wall time [s] | difference of the depth |",
             "|---|---|---|---|---|",
             f"| flights in their order | 10 | {marches(ordered)} | {seconds:.1f} | |"]
    single, seconds = one_by_one(program, folder, 10)
    lines.append(f"| blocks as runs of their own | 10 | {10 * len(BLOCKS)} | {seconds:.1f} | "
                 f"{np.abs(single - depth).max() / depth.max():.1e} |")
    ordered, seconds = execute(program, folder, mission(many, 1), "many")
    depth = ordered["wear/depth"][-1]
    lines.append(f"| flights in their order | {many} | {marches(ordered)} | {seconds:.1f} | |")
    jumps, seconds = execute(program, folder, mission(many, 0), "jumps")
    off = np.abs(jumps["wear/depth"][-1] - depth).max() / depth.max()
    stated = attribute(jumps, "jump_error") / depth.max()
    lines.append(f"| by jumps | {many} | {marches(jumps)} | {seconds:.1f} | {off:.1e}, stated "
                 f"{stated:.1e} |")
    return lines


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
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        lines = measure(options.program.resolve(), Path(folder), options.flights)
    print("\n".join(lines))


if __name__ == "__main__":
    main()
