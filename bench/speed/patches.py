"""Wear of a large patch: 384 pairs of the blade sector to 1e9 cycles, at the resonance of the
unworn joint, by the schemes that a user would choose.

    python -m bench.speed.patches [--program build/release/fw_run] [--seconds 900] [--threads 2]
        [--schemes 1 2 3]

The case is that of the wear runs of bench/common/wear_runs.py; the model is generated into
build/bench where it is not there yet. A run that has not ended after so many seconds is stopped,
and the table says how far it came. Writes the table between its marks in
docs/benchmarks/patches.md.
"""

from __future__ import annotations

import argparse
import re
import time
from pathlib import Path

from bench.common.measure import ROOT, Bench, Groups
from bench.common.sector import COARSE, case, sector_file
from bench.common.wear_runs import COEFFICIENT, FAST
from fretwear.result import Result

PAGE = ROOT / "docs" / "benchmarks" / "patches.md"
BEGIN, END = "<!-- patches: begin -->", "<!-- patches: end -->"
PAIRS, N_HARMONICS, N_CYCLES = 384, 3, 1e9
#: Of the unworn joint at the speed of the wear runs, on the mesh of the scaling page [Hz].
RESONANCE = 1028.0
#: Status of a run that max_seconds ended.
STOPPED = 6
#: Schemes with the tolerances and steps that they choose by themselves.
SCHEMES: tuple[tuple[str, Groups], ...] = (
    ("pseudo-time, order 1", {"wear": {"scheme": "pseudo_time"}}),
    ("pseudo-time, Rosenbrock", {"wear": {"scheme": "pseudo_time"},
                                 "pseudo_time": {"scheme": "rosenbrock"}}),
    ("explicit", {"wear": {"scheme": "explicit"}}))
HEAD = ("| scheme | steps | GMRES iterations | cycles | largest depth [mm] | wall time [s] | "
        "processor time [s] |")


def measure(bench: Bench, name: str, scheme: Groups, threads: int, seconds: float) -> str:
    """One run as a line of the table."""
    groups = case(PAIRS, N_HARMONICS, {"start": RESONANCE, "unit": "Hz"}, speed=FAST.speed,
                  file=sector_file(PAIRS, bench.folder, COARSE))
    groups |= scheme
    groups["case"] = {"title": name, "analysis": "wear", "max_seconds": seconds}
    groups["output"] = {"observe": "tip"}
    groups["wear"] = {"coefficient": COEFFICIENT, "n_cycles": N_CYCLES} | scheme["wear"]
    path = bench.folder / "patches.h5"
    path.unlink(missing_ok=True)
    start = time.perf_counter()
    summary, processor = bench.execute(groups, path, threads, statuses=(0, 4, STOPPED))
    wall = time.perf_counter() - start
    result = Result(path)
    iterations = re.search(r"(\d+) Krylov iterations", summary)
    cycles = float(result["wear/cycles"][-1])
    return (f"| {name} | {len(result.depth) - 1} | {iterations[1] if iterations else '-'} | "
            f"{cycles:.2g} | {result.depth[-1].max():.2e} | {wall:.0f} | {processor:.0f} |")


def write(lines: list[str]) -> None:
    """The table between its marks."""
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    table = "\n".join([HEAD, "|---|---|---|---|---|---|---|", *lines])
    PAGE.write_text(f"{before}{BEGIN}\n\n{table}\n\n{END}{rest.split(END)[1]}", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=Path, default=ROOT / "build" / "release" / "fw_run")
    parser.add_argument("--seconds", type=float, default=900.0, help="after which a run is stopped")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--schemes", type=int, nargs="+", default=[1, 2, 3],
                        help="numbers of those to measure: order 1, Rosenbrock, explicit")
    options = parser.parse_args()
    bench = Bench(options.program.resolve(), ROOT / "build" / "bench")
    lines = []
    for name, scheme in (SCHEMES[number - 1] for number in options.schemes):
        lines.append(measure(bench, name, scheme, options.threads, options.seconds))
        print(lines[-1], flush=True)
    write(lines)


if __name__ == "__main__":
    main()
