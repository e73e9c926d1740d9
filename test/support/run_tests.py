#!/usr/bin/env python3
"""Run every test and count each case: `N passed, N failed` (and skipped) is the last line.

    run_tests.py --build BUILD_DIRECTORY [--python INTERPRETER] [--unit-only | TESTS...]

Stages: the self-test of the stand-in, the unit tests (each .pf file in a process of its own under
the stand-in), pytest over test/ and python/tests, or over TESTS. A stage that crashes, or that
counts no test, is a failed case of its own: silence never passes. pytest runs in two processes
(pytest-xdist), each test file in one of them.
"""
import argparse
import os
import re
import signal
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
#: Of tests at a time.
PROCESSES = min(2, len(os.sched_getaffinity(0)))


def run(command, **options):
    """Run a command in the project's directory; show and return its output and its status."""
    done = subprocess.run([str(word) for word in command], cwd=ROOT, text=True, check=False,
                          errors="replace", stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          **options)
    return done.stdout, done.returncode


def verdict(stage, counts, status):
    """The counts of a stage, with a failed case more where they do not explain its end."""
    if status != 0 and not counts["failed"]:
        print(f"{stage}: ended with status {status}")
        counts["failed"] += 1
    elif not counts["passed"] and not counts["failed"]:
        print(f"{stage}: counted no test")
        counts["failed"] += 1
    return counts


def closing_line(text):
    """Counts of the closing line of the stand-in, or of pFUnit's own summary."""
    found = re.findall(r"^(\d+) passed, (\d+) failed$", text, re.MULTILINE)
    if found:
        return Counter(passed=int(found[-1][0]), failed=int(found[-1][1]))
    found = re.findall(r"^ *\((\d+) tests?\b.*\)$", text, re.MULTILINE)
    if found:
        return Counter(passed=int(found[-1]))
    found = re.findall(r"Tests run: *(\d+), Failures: *(\d+), Errors: *(\d+)", text)
    if found:
        tests, failures, errors = map(int, found[-1])
        return Counter(passed=tests - failures - errors, failed=failures + errors)
    return Counter()


def fortran_stage(stage, command):
    text, status = run(command)
    counts = verdict(stage, closing_line(text), status)
    print(f"{text if counts['failed'] else ''}"
          f"{stage}: {counts['passed']} passed, {counts['failed']} failed", flush=True)
    return counts


def unit_stages(programs):
    """Both unit test programs: the self-test of the stand-in first, then the .pf files."""
    source = HERE / "standin" / "must_fail.pf"
    yield fortran_stage("stand-in, assertions that must fail", [
        sys.executable, HERE / "check_must_fail.py", programs / "standin_must_fail", source])
    program = programs / "unit_tests"
    if (programs / "joined").exists() and not (programs / "unit_tests.d").exists():
        yield fortran_stage("unit tests under pFUnit", [program])
        return
    with ThreadPoolExecutor(PROCESSES) as pool:
        yield from pool.map(lambda path: fortran_stage(f"unit/{path.name}", [program, path.stem]),
                            sorted((ROOT / "test" / "unit").glob("*.pf")))


def pytest_stage(python, build, tests):
    """pytest over the directories that hold tests, as many processes as PROCESSES sharing the test
    files; its own report is read, not its text."""
    directories = [path for path in tests if any(path.rglob("test_*.py"))]
    if not directories:
        print("pytest: no test file yet")
        return Counter()
    report = build / "pytest.xml"
    report.unlink(missing_ok=True)
    environment = dict(os.environ, FW_RUN=str(build / "fw_run"), MPLBACKEND="Agg",
                       PYTHONPATH=os.pathsep.join(filter(None, [
                           str(ROOT / "python"), os.environ.get("PYTHONPATH", "")])))
    status = subprocess.run(
        [python, "-m", "pytest", "-q", "-ra", "-p", "no:cacheprovider", f"-n{PROCESSES}",
         "--dist=loadfile", "--no-loadscope-reorder", f"--junitxml={report}",
         *map(str, directories)],
        cwd=ROOT, env=environment, check=False).returncode
    counts = Counter()
    if report.exists():
        suite = next(ElementTree.parse(report).getroot().iter("testsuite")).attrib
        bad = int(suite["failures"]) + int(suite["errors"])
        counts = Counter(failed=bad, skipped=int(suite["skipped"]))
        # A case can fail and end in an error as well; it must not make a passed one vanish twice.
        counts["passed"] = max(int(suite["tests"]) - bad - counts["skipped"], 0)
    return verdict("pytest", counts, status)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=Path, required=True, help="directory of the CMake build")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has pytest")
    parser.add_argument("--unit-only", action="store_true", help="without pytest")
    parser.add_argument("tests", type=Path, nargs="*", help="directories of pytest",
                        default=[ROOT / "test", ROOT / "python" / "tests"])
    arguments = parser.parse_args()
    # A shell starts what is in the background with SIGINT ignored, and tests of it inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Threads that spin while they wait take the time of the process beside them.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    build = arguments.build.resolve()
    total = Counter()
    for counts in unit_stages(build / "test" / "support"):
        total += counts
    if not arguments.unit_only:
        tests = [path.resolve() for path in arguments.tests]
        total += pytest_stage(arguments.python, build, tests)
    line = f"{total['passed']} passed, {total['failed']} failed"
    if total["skipped"]:
        line += f", {total['skipped']} skipped"
    sys.stdout.flush()
    print(line, flush=True)
    return 1 if total["failed"] or not total["passed"] else 0


if __name__ == "__main__":
    sys.exit(main())
