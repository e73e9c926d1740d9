"""The paper as a gallery: every figure and table of its numerical part, on the sector.

    python -m bench.paper.gallery [PART ...] [--build build/release] [--quick] [-o docs/paper]

Parts: response, wear, cost, effects, path; without any, all of them. A part replaces its section
of the page and leaves the others. --quick runs everything once and coarse, into
build/bench/paper: it tries the scripts.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from pathlib import Path

from bench.common.document import update_document
from bench.common.measure import ROOT, Bench, describe_machine
from bench.paper.gallery_cost import measure_cost, write_cost
from bench.paper.gallery_effects import measure_effects, write_effects
from bench.paper.gallery_path import measure_path, write_path
from bench.paper.gallery_response import measure_response, write_response
from bench.paper.gallery_wear import measure_wear, write_wear

#: Parts in the order of the page, each from its runs and the folder of its pictures.
PARTS: dict[str, Callable[[Bench, Path], str]] = {
    "response": lambda bench, folder: write_response(folder, measure_response(bench)),
    "wear": lambda bench, folder: write_wear(folder, measure_wear(bench)),
    "cost": lambda bench, folder: write_cost(folder, measure_cost(bench)),
    "effects": lambda bench, folder: write_effects(measure_effects(bench)),
    "path": lambda bench, folder: write_path(folder, measure_path(bench)),
}
HEAD = """# The paper as a gallery

Written by `make paper` (bench/paper/gallery.py): do not edit.

The numerical part of L. Salles, L. Blanc, F. Thouverez, A. M. Gouskov and P. Jean, *Dual Time \
Stepping Algorithms with the High Order Harmonic Balance Method for Contact Interfaces with \
Fretting-Wear*, ASME Turbo Expo 2011 ([arXiv:1405.3615](https://arxiv.org/abs/1405.3615)), on the \
blade sector of `example/blade_sector`. The mesh of the paper is not public: curves, trends and \
ratios can be compared, displacements and depths in millimetres cannot. Each table says what the \
paper reports, what comes out here, and whether the two agree.

Linear solutions do not depend on the load of the machine, processor times (of whole programs, in \
one thread) a little. Times of frequencies are those of the clock, of each the fastest of several \
runs: where the load stated with a part is above 2, their ratios are rough."""


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Regenerate docs/paper.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)} (all)")
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release",
                        help="folder of the CMake build whose fw_run is used")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "bench",
                        help="folder for results")
    parser.add_argument("--quick", action="store_true", help="only try the scripts")
    parser.add_argument("-o", "--output", type=Path, help="folder of the page")
    options = parser.parse_args()
    unknown = [part for part in options.parts if part not in PARTS]
    if unknown:
        parser.error(f"no part {unknown[0]!r}; choose from {', '.join(PARTS)}")
    work, build = options.work.absolute(), options.build.absolute()
    folder = options.output or (work / "paper" if options.quick else ROOT / "docs" / "paper")
    folder.mkdir(parents=True, exist_ok=True)
    bench = Bench(build / "fw_run", work / "gallery", options.quick)
    start = time.perf_counter()
    for part in options.parts or PARTS:
        print(f"{time.perf_counter() - start:6.1f} s  {part}", flush=True)
        machine = describe_machine(build)
        text = PARTS[part](bench, folder)
        machine["load after"] = f"{os.getloadavg()[0]:.1f} (the measurement itself makes 1 to 2)"
        update_document(folder / "README.md", part, text, machine, tuple(PARTS), HEAD)
    print(f"{time.perf_counter() - start:6.1f} s  written: {folder / 'README.md'}")


if __name__ == "__main__":
    main()
