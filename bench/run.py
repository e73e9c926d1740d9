"""Measure and write docs/benchmarks.md with its pictures.

    python bench/run.py [--build build/release] [--quick] [-o docs]

Uses the fw_run of a CMake build. Every time is the median of repeated runs in one thread, unless
it is said otherwise. --quick runs everything once and small, into build/bench/docs: it tries the
scripts and measures nothing.
"""

from __future__ import annotations

import argparse
import csv
import io
import os
import subprocess
import time
from pathlib import Path

from measure import ROOT, Bench, describe_machine
from oscillators import measure_oscillators
from report import Measurements, write_report
from sector import measure_crossing, measure_points, measure_sweeps, measure_threads


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Measure and write docs/benchmarks.md.")
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release",
                        help="folder of the CMake build that is measured")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "bench",
                        help="folder for results and measuring programs")
    parser.add_argument("--quick", action="store_true", help="only try the scripts")
    parser.add_argument("-o", "--output", type=Path, help="folder of the report (default: docs)")
    options = parser.parse_args()
    output = options.output or (options.work / "docs" if options.quick else ROOT / "docs")
    build = options.build.absolute()
    bench = Bench(build / "fw_run", options.work.absolute(), options.quick)
    machine = describe_machine(build)
    start = time.perf_counter()

    def step(title: str) -> None:
        print(f"{time.perf_counter() - start:6.1f} s  {title}", flush=True)

    step("transforms")
    transforms = measure_transforms(build, options.work.absolute())
    step("oscillators")
    oscillators = measure_oscillators(bench)
    step("linear solvers")
    crossing = measure_crossing(bench)
    step("points of the sector")
    points = measure_points(bench)
    step("threads")
    threads = measure_threads(bench)
    step("whole sweeps")
    sweeps = measure_sweeps(bench)
    machine["load at the end"] = f"{os.getloadavg()[0]:.1f} (the measurement itself makes 1 to 2)"
    write_report(output, Measurements(machine, transforms, oscillators, crossing, points, threads,
                                      sweeps))
    step(f"written: {output / 'benchmarks.md'}")


def measure_transforms(build: Path, work: Path) -> list[dict[str, str]]:
    """Build bench/transforms.f90 against an installation and run it."""
    prefix, target = work / "install", work / "cmake"
    for command in (["cmake", "--install", build, "--prefix", prefix],
                    ["cmake", "-S", ROOT / "bench", "-B", target, "-G", "Ninja",
                     f"-DCMAKE_PREFIX_PATH={prefix}"],
                    ["cmake", "--build", target]):
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    text = subprocess.run([target / "transforms"], check=True, capture_output=True, text=True,
                          env=environment).stdout
    return list(csv.DictReader(io.StringIO(text)))


if __name__ == "__main__":
    main()
