#!/usr/bin/env python3
"""Hostile inputs by the thousand: no crash, no hang, bounded memory, each refusal with a message.

    fuzz.py --build BUILD [-n 100000] [--seed 1] [--jobs 2] [--state FOLDER] [--report FILE]

Input k is a function of the seed and k alone, so that a failure is made again with `--only k`, and
a run that was stopped goes on where it was, after another try of what failed. Namelists, model
files and Matrix Market files are read and checked through the C interface, many in one process;
every 20th of them goes through `fw_run --check` as well, which has to end alike, and every 50th is
run. Command lines and model files with damaged bytes all go through the program, which tries such
files in a process of their own: HDF5 itself does not survive all of them. What is demanded:

* a status of 0, 2, 3 or 5 (of a run also 4 and 6), and a message with every status but 0;
* an end within 10 s of processor time, and 10 minutes of the clock (a run is told to stop after
  5 s);
* an address space of 2 GB; no message of the Fortran runtime, no NaN in a result marked converged.
"""
import argparse
import contextlib
import json
import os
import random
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

import fuzz_command
import fuzz_matrix_market
import fuzz_model
import fuzz_namelist
import h5py
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "support"))
import fuzz_result  # noqa: E402
from limited import limited  # noqa: E402
from revision import revision  # noqa: E402

FAMILIES = {"namelist": fuzz_namelist.create, "model file": fuzz_model.create,
            "damaged model file": fuzz_model.damage, "Matrix Market": fuzz_matrix_market.create,
            "command line": fuzz_command.create, "damaged result file": fuzz_result.create}
#: Of 20 inputs in a row.
SHARES = (["namelist"]*8 + ["model file"]*4 + ["damaged model file"]*2 + ["Matrix Market"]*3
          + ["command line"]*3)
TIME_LIMIT = 600.0
PROCESSOR_TIME = 10
RUN_TIME = 5.0
MEGABYTES = 2048
REFUSALS = (2, 3, 5)
RUNTIME_WORDS = ("Fortran runtime", "SIGSEGV", "Backtrace", "HDF5-DIAG", "Traceback",
                 "Error allocating", "malloc", "free()", "terminate called", "ERROR STOP")


class Library:
    """A process that reads inputs through the library, started again where it ends."""

    def __init__(self, path):
        self.path = path
        self.process = None
        self.peak, self.slowest = 0, 0.0

    def start(self):
        environment = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
        self.process = subprocess.Popen(
            [sys.executable, HERE / "library_child.py", self.path, str(MEGABYTES)], text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=1,
            errors="replace", env=environment)

    def stop(self):
        if self.process is not None:
            self.process.kill()
            self.process.communicate()
            self.process = None

    def check(self, folder):
        """Status and message, or a text that says how it failed."""
        if self.process is None:
            self.start()
        self.process.stdin.write(f"{folder}\n")
        self.process.stdin.flush()
        ready, _, _ = select.select([self.process.stdout], [], [], TIME_LIMIT)
        if not ready:
            self.stop()
            return None, "hang"
        answer = self.process.stdout.readline()
        if not answer:
            errors = self.process.communicate()[1]
            code = self.process.returncode
            self.process = None
            if code == -signal.SIGPROF:
                return None, "hang"
            return None, f"crash: ended with {code}: {errors[-300:]}"
        status, message, peak, seconds = json.loads(answer)
        self.peak, self.slowest = max(self.peak, peak), max(self.slowest, seconds)
        return status, message


def run_program(program, folder, arguments, seconds):
    """Exit status, both streams; a status of None means a hang."""
    command = limited([program, *arguments], PROCESSOR_TIME, 1, MEGABYTES)
    process = subprocess.Popen(command, cwd=folder, stdin=subprocess.DEVNULL,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                               env=dict(os.environ, OMP_NUM_THREADS="1"))
    try:
        out, errors = process.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGINT)
        try:
            out, errors = process.communicate(timeout=TIME_LIMIT)
        except subprocess.TimeoutExpired:
            process.kill()
            out, errors = process.communicate()
            return None, out.decode(errors="replace"), errors.decode(errors="replace")
    return process.returncode, out.decode(errors="replace"), errors.decode(errors="replace")


def verdict(status, message, allowed):
    """What is wrong with an end, or nothing."""
    if status in (-signal.SIGXCPU, -signal.SIGKILL):
        return "hang"
    if status is None:
        return "hang" if not message.startswith("crash") else message
    if status < 0 or status not in (0, *allowed):
        return f"crash: status {status}: {message[-300:]}"
    if any(word in message for word in RUNTIME_WORDS):
        return f"crash: words of the runtime: {message[-300:]}"
    if status in REFUSALS and not message.strip():
        return f"silent: status {status} without a message"
    return None


def poisoned(folder):
    """The name of a result that holds NaN in a point marked converged."""
    for path in folder.glob("**/*.h5"):
        with contextlib.suppress(OSError, KeyError, ValueError), h5py.File(path) as file:
            if file.attrs.get("format") not in (b"fretwear-result", "fretwear-result"):
                continue
            converged = file["converged"][:].astype(bool)
            if not np.isfinite(file["coefficients"][:][converged]).all():
                return path.name
    return None


class Worker(threading.Thread):
    """Every `step`-th input from its own start on."""

    def __init__(self, settings, first, done):
        super().__init__()
        self.settings, self.first, self.done = settings, first, done
        self.library = Library(settings.library)
        self.counts = Counter()
        self.failures = []
        self.stopped = False

    def run(self):
        for k in range(self.first + self.done*self.settings.jobs, self.settings.n,
                       self.settings.jobs):
            if self.stopped:
                break
            self.one(k)
            self.done += 1
        self.library.stop()

    def one(self, k):
        rng = random.Random(f"{self.settings.seed}-{k}")
        family = SHARES[k % len(SHARES)] if self.settings.family is None else self.settings.family
        folder = Path(tempfile.mkdtemp(prefix=f"fuzz-{k}-", dir=self.settings.scratch))
        try:
            arguments = FAMILIES[family](rng, folder)
            ends = [*self.ends(k, family, folder, arguments)]
            for entry, status, message, allowed in ends:
                self.counts[f"{family}|{entry}|{status}"] += 1
                bad = verdict(status, message, allowed)
                if bad:
                    self.failures.append([k, family, entry, bad])
                    print(f"input {k} ({family}, {entry}): {bad}", flush=True)
            if any(entry == "run" for entry, *_ in ends) and poisoned(folder):
                self.failures.append([k, family, "run", "NaN in a converged point"])
                print(f"input {k}: NaN in a converged point", flush=True)
        finally:
            if not self.settings.keep:
                shutil.rmtree(folder, ignore_errors=True)

    def ends(self, k, family, folder, arguments):
        program = self.settings.program
        if family == "command line":
            status, _, errors = run_program(program, folder, arguments, RUN_TIME)
            yield "program", status, errors, (2, 3, 4, 5, 6)
            return
        group = k//len(SHARES)
        if family.startswith("damaged"):
            status, _, errors = run_program(program, folder, ["--check", *arguments], TIME_LIMIT)
            yield "check", status, errors, REFUSALS
            return
        status, message = self.library.check(folder)
        yield "library", status, message, REFUSALS
        if group % 20 == k % 20 or self.settings.only is not None:
            code, _, errors = run_program(program, folder, ["--check", *arguments], TIME_LIMIT)
            yield "check", code, errors, REFUSALS
            if status is not None and code is not None and code != status:
                yield "check", None, f"crash: status {code}, of the library {status}", ()
        if group % 50 == k % 20 or self.settings.only is not None:
            code, _, errors = run_program(program, folder, arguments, RUN_TIME)
            yield "run", code, errors, (2, 3, 4, 5, 6)


def summary(settings, workers, earlier):
    counts = Counter(earlier.get("counts", {}))
    failures = list(earlier.get("failures", []))
    for worker in workers:
        counts.update(worker.counts)
        failures += worker.failures
    libraries = [worker.library for worker in workers]
    return {"seed": settings.seed, "goal": settings.n, "jobs": settings.jobs,
            "revision": earlier.get("revision", settings.revision),
            "done": [w.done for w in workers], "counts": dict(counts),
            "failures": sorted(failures),
            "slowest": max([earlier.get("slowest", 0.0), *[lib.slowest for lib in libraries]]),
            "peak_mb": max([earlier.get("peak_mb", 0), *[lib.peak//1024 for lib in libraries]])}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=Path, required=True, help="directory of the CMake build")
    parser.add_argument("-n", type=int, default=100000, help="inputs in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--state", type=Path, help="folder where a run that is stopped goes on")
    parser.add_argument("--family", choices=FAMILIES, help="one kind of input only")
    parser.add_argument("--only", type=int, help="input of this number alone, kept")
    parser.add_argument("--report", type=Path, help="JSON file for what was counted")
    settings = parser.parse_args()
    settings.program = (settings.build / "fw_run").resolve()
    settings.library = (settings.build / "libfretwear.so").resolve()
    settings.keep = settings.only is not None
    fuzz_result.PROGRAM = settings.program
    settings.revision = revision()
    return settings


def main():
    settings = arguments()
    with tempfile.TemporaryDirectory(prefix="fretwear-fuzz-") as scratch:
        settings.scratch = scratch
        return work(settings)


def work(settings):
    if settings.only is not None:
        settings.scratch = tempfile.mkdtemp(prefix="fretwear-fuzz-")
        worker = Worker(settings, 0, 0)
        worker.one(settings.only)
        worker.library.stop()
        print(f"kept in {settings.scratch}", json.dumps(dict(worker.counts)))
        return 1 if worker.failures else 0
    earlier, state = {}, settings.state and settings.state / "fuzz.json"
    if state and state.exists():
        earlier = json.loads(state.read_text())
        if (earlier["seed"], earlier["jobs"]) != (settings.seed, settings.jobs):
            earlier = {}
    done = earlier.get("done", [0]*settings.jobs)
    workers = [Worker(settings, k, done[k]) for k in range(settings.jobs)]
    for k in sorted({k for k, *_ in earlier.pop("failures", [])}):
        workers[0].one(k)
    for worker in workers:
        worker.start()
    try:
        while any(worker.is_alive() for worker in workers):
            time.sleep(0.5)
            if state:
                settings.state.mkdir(parents=True, exist_ok=True)
                save(state, summary(settings, workers, earlier))
    except KeyboardInterrupt:
        for worker in workers:
            worker.stopped = True
    for worker in workers:
        worker.join()
    found = summary(settings, workers, earlier)
    for path in filter(None, (state, settings.report)):
        path.parent.mkdir(parents=True, exist_ok=True)
        save(path, found)
    print(f"{sum(found['done'])} inputs, {len(found['failures'])} failures, slowest "
          f"{found['slowest']:.1f} s, peak {found['peak_mb']} MB")
    return 1 if found["failures"] else 0


def save(path, found):
    part = path.with_suffix(".new")
    part.write_text(json.dumps(found, indent=1) + "\n")
    part.replace(path)


if __name__ == "__main__":
    sys.exit(main())
