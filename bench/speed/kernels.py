"""Points on the kernels that OpenBLAS has for older processors, written to a page.

    python -m bench.speed.kernels [--program fw_run] [--page docs/benchmarks/kernels.md]

A kernel that the processor cannot run ends a program, and is left out.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from pathlib import Path

from bench.common.layout import table
from bench.common.measure import ROOT, Bench, Groups
from bench.common.sector import COARSE, PEAKS, case, near_peak, sector_file
from bench.peers.sector_and_chain import chain, namelist
from bench.speed.sector_modes import write
from bench.speed.small import FIRST

PAGE = ROOT / "docs" / "benchmarks" / "kernels.md"
MARKS = ("<!-- kernels: begin -->", "<!-- kernels: end -->")
#: From the oldest on: SSE2, SSE4, AVX, AVX2, AVX2, AVX-512, AVX-512.
KERNELS = ("Prescott", "Nehalem", "Sandybridge", "Haswell", "Zen", "SkylakeX", "Cooperlake")
#: Runs of each kernel by turns, and of sweeps shorter than that [s]; the fastest counts.
TURNS, MORE_TURNS, SHORT = 5, 25, 0.1
WANTED = 1.3


def cases() -> dict[str, Groups]:
    """From one pair to 192."""
    events = FIRST | {"harmonics": {"n_harmonics": 15, "sampling": "events"}}
    large = {f"{pairs} pairs, H = 7": case(
        pairs, 7, near_peak(pairs) if pairs in PEAKS else
        {"start": 1031.0, "end": 1032.0, "n_points": 5, "unit": "Hz"},
        file=sector_file(pairs, ROOT / "build" / "bench", COARSE)) for pairs in (48, 96, 192)}
    return {"one mass, H = 15, events": events, "chain of 8, H = 3": namelist(chain(8, 3)),
            "chain of 48, H = 17": namelist(chain(48, 17)),
            "16 pairs, H = 3": case(16, 3, near_peak(16))} | large


def runs_with(program: Path, kernel: str) -> bool:
    """Whether the processor has the instructions of a kernel, and OpenBLAS the kernel."""
    done = subprocess.run([program, "--version"], env=os.environ | {"OPENBLAS_CORETYPE": kernel},
                          capture_output=True, text=True, check=False)
    return done.returncode == 0 and f"kernel {kernel}" in done.stdout


def fastest(bench: Bench, groups: Groups, kernels: list[str]) -> tuple[list[float], list[int]]:
    """Time of all points [s] by each kernel, and Newton steps."""
    least, steps = [float("inf")] * len(kernels), [0] * len(kernels)
    for turn in range(MORE_TURNS):
        if turn >= TURNS and min(least) > SHORT:
            break
        for i, kernel in enumerate(kernels):
            os.environ["OPENBLAS_CORETYPE"] = kernel
            run, cost = bench.run_and_weigh(groups)
            if not run.converged.all():
                raise RuntimeError(f"kernel {kernel}: a point did not converge")
            seconds = float(run.seconds.sum())
            # What other programs took meanwhile; of short sweeps the fastest was alone.
            least[i] = min(least[i], seconds * (cost.share if seconds > SHORT else 1.0))
            steps[i] = int(run.iterations.sum())
    return least, steps


def row_of(name: str, times: list[float], steps: list[int]) -> tuple[str, ...]:
    """Times over the best; where kernels take other paths, with their steps, and judged by them."""
    best = min(times)
    cells = [f"{time / best:.2f}" for time in times]
    of_a_step = times
    if len(set(steps)) > 1:
        cells = [f"{cell} ({n})" for cell, n in zip(cells, steps)]
        of_a_step = [time / n for time, n in zip(times, steps)]
    worst = max(of_a_step) / min(of_a_step)
    return (name, *cells, f"{1e3 * best:.3g}", f"{worst:.2f}: "
            + ("met" if worst < WANTED else "missed"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=Path, default=ROOT / "build" / "release" / "fw_run")
    parser.add_argument("--page", type=Path, default=PAGE)
    arguments = parser.parse_args()
    program = arguments.program.resolve()
    kernels = [kernel for kernel in KERNELS if runs_with(program, kernel)]
    rows = []
    with tempfile.TemporaryDirectory() as place:
        bench = Bench(program, Path(place))
        for name, groups in cases().items():
            rows.append(row_of(name, *fastest(bench, groups, kernels)))
            print(*rows[-1], sep=" | ", flush=True)
    write(arguments.page, MARKS, table(
        ["case", *kernels, "best [ms]", f"of a step, at most {WANTED}"], rows))


if __name__ == "__main__":
    main()
