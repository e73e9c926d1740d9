"""The steps of docs/new_user.md, timed.

    python -m bench.first_hour [--build build/release] [STEP ...]

Prints the table of the document, with elapsed times too. Processor time is that of the step and of
all that it starts, which is what it takes on a machine that does nothing else (less, where it uses
two cores).
Steps whose packages are not there are left out. STEP: words of the first column.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SECTOR, WEAR = "example/blade_sector/frf.nml", "example/wear/oscillator.nml"
ANIMATE = """import fretwear as fw
fw.Result("frf.h5").animate("blade.gif", frames=12)"""
OWN_MESH = ROOT / "example" / "own_mesh"
WHOLE = """import fretwear as fw
model = fw.Model([[1.0]], [[0.02]], [[1.0]], cosine=[1.0], springs=[fw.Spring(1, coefficient=0.1)],
                 contact=fw.ContactPairs([[1, 0, 0]], mu=0.3, normal_load=1.0))
model.save("model.h5")
open("m.nml", "w").write("&model source = 'hdf5' file = 'model.h5' / "
                         "&sweep start = 0.5 end = 1.5 n_points = 41 /")"""


@dataclass(frozen=True)
class Step:
    """A row: what it is, what the document calls it, its commands."""

    name: str
    shown: str
    commands: tuple[str, ...]
    #: Seconds after which Ctrl-C is pressed.
    stop_after: float = 0.0
    #: Packages and programs that it takes.
    packages: tuple[str, ...] = ()
    programs: tuple[str, ...] = ()


def steps(python: str, build: Path, work: Path) -> list[Step]:
    """All of them, in the order of the document."""
    run, tool = build / "fw_run", f"{python} -m fretwear"
    beam = (f"{python} -m pytest -q -p no:cacheprovider {ROOT}/python/tests/test_import_mesh.py "
            "-k test_reduced_model_keeps_mesh")
    legacy = work / "legacy"
    page = (OWN_MESH / "README.md").read_text()
    model, = re.findall(r"^    fretwear (import disk\.msh .*\n.*)$", page, re.MULTILINE)
    model = " ".join(model.replace("\\", "").split())
    lines, = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    return [
        Step("first response", f"fw_run -o frf.h5 {SECTOR}",
             (f"{run} -q -o frf.h5 {ROOT}/{SECTOR}",)),
        Step("first picture", "fretwear plot frf.h5 --kind response -o frf.png",
             (f"{tool} plot frf.h5 --kind response -o frf.png",)),
        Step("frequencies free and stuck, before a run", f"fretwear modes {SECTOR}",
             (f"{tool} modes {ROOT}/{SECTOR}",)),
        Step("a frame for ParaView", "fretwear export frf.h5 frf.vtu",
             (f"{tool} export frf.h5 frf.vtu",), packages=("meshio",)),
        Step("the blade moves, 12 pictures", 'result.animate("blade.gif", frames=12)',
             (f"{python} -c {shlex.quote(ANIMATE)}",), packages=("pyvista",)),
        Step("a page that answers to clicks", "fretwear report frf.h5 --interactive",
             (f"{tool} report frf.h5 --interactive -o frf.html",), packages=("bokeh",)),
        Step("a model of one's own in one file, springs included, and its run",
             'model.save("model.h5"), fw_run m.nml',
             (f"{python} -c {shlex.quote(WHOLE)}", f"{run} -q m.nml")),
        Step("own mesh: import, run, motion of every node against finite elements",
             "fretwear import ... --mesh beam.inp, as in python/tests/test_import_mesh.py",
             (beam,), packages=("meshio", "skfem", "pytest")),
        Step("own mesh of Gmsh: one of twelve sectors of a disk", "gmsh -3 disk.geo",
             (f"cp {OWN_MESH}/* .", "gmsh -3 disk.geo"), programs=("gmsh",)),
        Step("own mesh: matrices by CalculiX, cut faces, reduction",
             "fretwear import disk.msh --ccx --sectors 12 ...", (f"{tool} {model}",),
             programs=("gmsh", "ccx")),
        Step("own mesh: response, and all sectors as a picture that turns",
             "fw.frf(...).animate(...)", (f"{python} -c {shlex.quote(lines)}",),
             packages=("pyvista",), programs=("gmsh", "ccx")),
        Step("best normal load of a damper, by derivatives",
             "fretwear optimise example/damper/damper.nml --minimise max_amplitude "
             "--over contact%normal_load --bounds 0.05 5",
             (f"{tool} optimise {ROOT}/example/damper/damper.nml --minimise max_amplitude "
              "--over contact%normal_load --bounds 0.05 5",)),
        Step("the same, as a curve", "fw_run example/damper_optimum/optimum.nml",
             (f"{run} -q -o optimum.h5 {ROOT}/example/damper_optimum/optimum.nml",)),
        Step("wear, stopped by Ctrl-C after a second",
             f"fw_run -o wear.h5 --set wear%max_depth_step=2e-4 {WEAR}",
             (f"exec {run} -q -o wear.h5 --set wear%max_depth_step=2e-4 {ROOT}/{WEAR}",),
             stop_after=1.0),
        Step("and continued to 1000 steps", "fw_run --restart wear.h5 -o more.h5 ...",
             (f"{run} -q --restart wear.h5 -o more.h5 --set wear%max_depth_step=2e-4 "
              f"{ROOT}/{WEAR}",)),
        Step("the library installed", "cmake --install build/release --prefix ...",
             (f"cmake --install {build} --prefix {work}/prefix",)),
        Step("programs in C, C++, Fortran 77 and Fortran 2018 built", "example/legacy, CMake",
             (f"cmake -S {ROOT}/example/legacy -B {legacy} -DCMAKE_PREFIX_PATH={work}/prefix",
              f"cmake --build {legacy}")),
        Step("and run, from their own memory", "frf_c",
             (f"{python} {ROOT}/example/legacy/export_model.py "
              f"{ROOT}/example/blade_sector/sector_16.h5 sector.dat",
              f"{legacy}/frf_c sector.dat c.txt")),
    ]


def timed(step: Step, work: Path, environment: dict[str, str]) -> tuple[float, float]:
    """Elapsed and processor time [s] of a step."""
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    for command in step.commands:
        with subprocess.Popen(command, shell=True, cwd=work, env=environment,
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
            if step.stop_after:
                time.sleep(step.stop_after)
                process.send_signal(signal.SIGINT)
            said = process.communicate()[1].decode()
        # A run that was stopped, or came to its max_steps.
        if process.returncode not in (0, 4, 6):
            raise SystemExit(f"{command}: status {process.returncode}\n{said}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (time.perf_counter() - started,
            after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release")
    parser.add_argument("steps", nargs="*", metavar="STEP")
    options = parser.parse_args()
    build = options.build.resolve()
    path = [str(ROOT / "python"), str(build / "python"), os.environ.get("PYTHONPATH", "")]
    environment = dict(os.environ, MPLBACKEND="Agg", FW_RUN=str(build / "fw_run"),
                       PYTHONPATH=os.pathsep.join(filter(None, path)))
    work = Path(tempfile.mkdtemp())
    print("| step | command | seconds | processor time |\n|---|---|---|---|")
    try:
        for step in steps(sys.executable, build, work):
            if options.steps and not any(word in step.name for word in options.steps):
                continue
            if not (all(map(importlib.util.find_spec, step.packages))
                    and all(map(shutil.which, step.programs))):
                continue
            elapsed, spent = timed(step, work, environment)
            print(f"| {step.name} | `{step.shown}` | {elapsed:.1f} | {spent:.1f} |", flush=True)
    finally:
        shutil.rmtree(work)


if __name__ == "__main__":
    main()
