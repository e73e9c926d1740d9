#!/usr/bin/env python3
"""Builds that look for what a run with good numbers does not show, and the tests under them.

    verify.py [PART...] [--again] [--builds build/verify] [--python INTERPRETER] [--jobs N]

Each part (all of them by default) writes its section of docs/robustness.md and says whether it is
clean. A part that was clean with the same sources is left out, unless --again is given.

    traps     floating-point traps, signalling NaN, array bounds: every test
    sanitize  address and undefined-behaviour sanitizers: unit tests, program, reference solutions
    builds    all optimisation: every test, and the results of the examples beside those without
    march     builds for the oldest processor, and without optimisation: numbers of the program
    kernels   every kernel of OpenBLAS that this processor runs: unit tests
    memcheck  a point of the blade sector under valgrind
    flang     a second compiler on the sources without modules of gfortran
    races     handles in threads of their own under the thread sanitizer
    helgrind  the same under helgrind, which watches the libraries below as well
    coverage  no optimisation: tests of the program, and the lines of src that they run

Ends with status 1 where a part is not clean.
"""
import argparse
import json
import os
import signal
import sys
import time
from pathlib import Path

import line_coverage
import memory
import optimisation
import processors
import race_detectors
import second_compiler
from common import ROOT, Setting, checksum, report

sys.path.insert(0, str(ROOT / "test" / "support"))
from revision import revision
from sections import write_section

PARTS = {"traps": memory.traps, "sanitize": memory.sanitize, "builds": optimisation.builds,
         "march": processors.march, "kernels": processors.kernels,
         "memcheck": memory.memcheck, "flang": second_compiler.flang,
         "races": race_detectors.races, "helgrind": race_detectors.helgrind,
         "coverage": line_coverage.coverage}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("part", nargs="*", help=", ".join(PARTS))
    parser.add_argument("--again", action="store_true", help="also what was clean before")
    parser.add_argument("--builds", type=Path, default=ROOT / "build" / "verify")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has pytest")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    arguments = parser.parse_args()
    if unknown := set(arguments.part) - set(PARTS):
        parser.error(f"no part {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}")
    # A shell starts what is in the background with SIGINT ignored, and tests of it inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ["OMP_NUM_THREADS"] = "1"
    setting = Setting(arguments.builds.resolve(), arguments.python, arguments.jobs)
    setting.builds.mkdir(parents=True, exist_ok=True)
    clean = [verify(setting, name, arguments.again) for name in arguments.part or PARTS]
    return 0 if all(clean) else 1


def verify(setting, name, again):
    """Do a part, or find that it is done; whether it is clean."""
    store = setting.builds / "clean.json"
    known = json.loads(store.read_text()) if store.exists() else {}
    sources = checksum()
    if known.get(name) == sources and not again:
        report(f"{name}: clean before, with the same sources")
        return True
    commit, start = revision(), time.monotonic()
    lines, clean = PARTS[name](setting)
    minutes = (time.monotonic() - start) / 60.0
    lines += ["", f"{'Clean' if clean else '**Not clean**'}: sources of {commit}, "
              f"{minutes:.0f} minutes."]
    write_section(name, lines)
    report(f"{name}: {'clean' if clean else 'NOT CLEAN'}, {minutes:.0f} minutes")
    if clean:
        store.write_text(json.dumps({**known, name: sources}))
    return clean


if __name__ == "__main__":
    sys.exit(main())
