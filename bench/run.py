"""Measure, and write docs/benchmarks.md with its pictures and pages.

    python -m bench.run [PART ...] [--build build/release] [--before fw_run] [--quick] [-o docs]

Parts: speed, precision, events, solvers, paper, iterations, aliasing, time, joints, scaling, limit,
skips, laws, peers, or all; without any, speed. A part replaces its page, docs/benchmarks/PART.md,
and the first page is made anew.

Uses the fw_run of a CMake build. --quick runs everything once and small, into build/bench/docs: it
tries the scripts and measures nothing.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bench.common.document import ORDER
from bench.common.measure import ROOT, Bench, describe_machine
from bench.common.pages import update_page
from bench.common.programs import build_programs, run_program
from bench.common.sector import measure_crossing, measure_points, measure_sweeps, measure_threads
from bench.paper.aliasing import measure_aliasing, write_aliasing
from bench.paper.filtering import measure_filtering, write_filtering
from bench.paper.methods import measure_methods, write_methods
from bench.peers.branches import BRANCHES, count_again, measure_branches, write_branches
from bench.peers.sector_and_chain import measure_peers, write_peers
from bench.precision.events import measure_events, write_events, write_pairs
from bench.precision.integration import measure_integration, write_integration
from bench.precision.joints_in_time import measure_joints, write_joints
from bench.precision.report import write_precision
from bench.precision.responses import measure_precision
from bench.precision.worn import measure_wear_precision, write_wear_precision
from bench.solvers.iterations import measure_iterations, write_iterations
from bench.solvers.many_starts import measure_solvers
from bench.solvers.report import write_solvers
from bench.speed.laws_together import measure_laws, write_laws
from bench.speed.limit import measure_limit, write_limit
from bench.speed.report import Measurements, write_speed
from bench.speed.scaling import measure_scaling
from bench.speed.scaling_report import write_scaling
from bench.speed.skips import measure_skips, write_skips
from bench.speed.user_laws import measure_user_laws, write_user_laws


@dataclass(frozen=True)
class Job:
    """What a part needs.

    Attributes
    ----------
    bench : runs cases
    build : the CMake build that is measured
    work : folder for results and measuring programs
    images : folder of the pictures
    step : says what is being measured
    peer_python : interpreter that may have pyHarm
    before : another fw_run that is measured beside it, or None
    nlvib : folder of NLvib, whose points are counted again, or None
    """

    bench: Bench
    build: Path
    work: Path
    images: Path
    step: Callable[[str], None]
    peer_python: Path = Path(sys.executable)
    before: Path | None = None
    nlvib: Path | None = None

    def program(self, name: str) -> Path:
        """A measuring program, built if need be."""
        return build_programs(self.build, self.work) / name


def speed(job: Job) -> str:
    """Times of transforms, points, sweeps and threads."""
    steps = {"transforms": lambda: run_program(job.program("transforms")),
             "linear solvers": lambda: measure_crossing(job.bench),
             "points of the sector": lambda: measure_points(job.bench),
             "threads": lambda: measure_threads(job.bench),
             "whole sweeps": lambda: measure_sweeps(job.bench)}
    found = []
    for title, measure in steps.items():
        job.step(title)
        found.append(measure())
    return write_speed(job.images, Measurements(*found))


def precision(job: Job) -> str:
    """Errors against time: responses, and worn profiles."""
    responses = write_precision(job.images, measure_precision(job.bench, job.step))
    job.step("wear")
    return responses + "\n\n" + write_wear_precision(job.images,
                                                     measure_wear_precision(job.bench))


def events(job: Job) -> str:
    """Convergence of events and instants in n_time."""
    found = write_events(job.images, measure_events(job.bench))
    return found + "\n\n" + write_pairs(run_program(job.program("events")))


def solvers(job: Job) -> str:
    """Every solver, flow and scheme."""
    return write_solvers(measure_solvers(job.bench, job.program("starts"), job.step))


def paper(job: Job) -> str:
    """Time of 50 frequencies with every method."""
    return write_methods(measure_methods(job.bench))


def iterations(job: Job) -> str:
    """Iterations against frequency."""
    return write_iterations(job.images, measure_iterations(job.bench))


def aliasing(job: Job) -> str:
    """HDHB against HBM, and the filter."""
    sector = write_aliasing(job.images, measure_aliasing(job.bench))
    filtered = measure_filtering(job.bench, job.program("starts"))
    return sector + "\n\n" + write_filtering(job.images, filtered)


def integration(job: Job) -> str:
    """Harmonic balance against integration in time."""
    return write_integration(measure_integration(job.bench, job.step))


def joints(job: Job) -> str:
    """Joints and a disk against integration in time."""
    return write_joints(measure_joints(job.bench, job.step))


def peers(job: Job) -> str:
    """Other programs on the same problems."""
    points = write_peers(measure_peers(job.bench, job.peer_python))
    job.step("branches")
    other = Bench(job.before, job.work / "before", job.bench.quick) if job.before else None
    branches = BRANCHES
    if job.nlvib:
        branches = tuple(count_again(branch, job.nlvib) for branch in branches)
    return points + "\n\n" + write_branches(measure_branches(job.bench, other, branches))


def scaling(job: Job) -> str:
    """Time and memory against pairs and harmonics."""
    other = Bench(job.before, job.work / "before", job.bench.quick) if job.before else None
    return write_scaling(job.images, measure_scaling(job.bench, job.step, other))


def limit(job: Job) -> str:
    """Where the time goes, against the floor; threads."""
    return write_limit(measure_limit(job.bench, job.program("floor"), job.step))


def skips(job: Job) -> str:
    """What is left out, and what that saves."""
    return write_skips(*measure_skips(job.bench, job.program("floor")))


def laws(job: Job) -> str:
    """What pairs of several laws cost, and laws of a user."""
    own = write_user_laws(measure_user_laws(job.bench.folder, job.bench.quick))
    return write_laws(measure_laws(job.bench)) + "\n\n" + own


PARTS = {"speed": speed, "precision": precision, "events": events, "solvers": solvers,
         "paper": paper, "iterations": iterations, "aliasing": aliasing, "time": integration,
         "joints": joints, "scaling": scaling, "limit": limit, "skips": skips, "laws": laws,
         "peers": peers}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Measure and write docs/benchmarks.md.")
    parser.add_argument("parts", nargs="*", metavar="PART", default=["speed"],
                        help=f"{', '.join(ORDER)}, or all (default: speed)")
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release",
                        help="folder of the CMake build that is measured")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "bench",
                        help="folder for results and measuring programs")
    parser.add_argument("--quick", action="store_true", help="only try the scripts")
    parser.add_argument("--peer-python", type=Path, default=Path(sys.executable),
                        help="Python with pyharm-os, for the part peers")
    parser.add_argument("--before", type=Path,
                        help="another fw_run, for the parts scaling and peers: measured beside "
                        "this one")
    parser.add_argument("--nlvib", type=Path,
                        help="folder of NLvib, for the part peers: counts its points (Octave)")
    parser.add_argument("-o", "--output", type=Path, help="folder of the report (default: docs)")
    options = parser.parse_args()
    parts = list(ORDER) if "all" in options.parts else options.parts
    unknown = [part for part in parts if part not in PARTS]
    if unknown:
        parser.error(f"no part {unknown[0]!r}; choose from {', '.join(ORDER)} or all")
    work, build = options.work.absolute(), options.build.absolute()
    output = options.output or (work / "docs" if options.quick else ROOT / "docs")
    images = output / "images"
    images.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()

    def step(title: str) -> None:
        print(f"{time.perf_counter() - start:6.1f} s  {title}", flush=True)

    job = Job(Bench(build / "fw_run", work, options.quick), build, work, images, step,
              options.peer_python, options.before.absolute() if options.before else None,
              options.nlvib.absolute() if options.nlvib else None)
    for part in parts:
        step(part)
        machine = describe_machine(build)
        text = PARTS[part](job)
        machine["load after"] = f"{os.getloadavg()[0]:.1f} (the measurement itself makes 1 to 2)"
        update_page(output, part, text, machine)
    step(f"written: {output / 'benchmarks.md'}")


if __name__ == "__main__":
    main()
