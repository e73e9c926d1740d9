"""Builds with other flags, and the tests run with them."""
from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("src", "app", "include", "cmake", "test", "python", "example", "CMakeLists.txt")
#: Builds that look closer are slower than the one that limits of time of the tests are made for.
SLOWER = "10"
WARNING = re.compile(r"\bwarning:", re.IGNORECASE)


@dataclass(frozen=True)
class Setting:
    """Where builds go, and with which interpreter the tests run."""

    builds: Path
    python: str
    jobs: int


@dataclass(frozen=True)
class Counts:
    """Cases of a run of the tests."""

    passed: int
    failed: int
    skipped: int

    @property
    def good(self):
        return self.passed > 0 and self.failed == 0

    def row(self):
        return f"{self.passed} | {self.failed} | {self.skipped}"


def build(setting, name, *options, targets=()):
    """Configure and build; the directory and the number of warnings of the compiler.

    The build type None leaves the flags to the options: those of Release are set by the project.
    """
    directory = setting.builds / name
    run(["cmake", "-S", ROOT, "-B", directory, "-G", "Ninja",
         "-DCMAKE_BUILD_TYPE=None", f"-DPython3_EXECUTABLE={setting.python}", *options])
    done = run(["cmake", "--build", directory, "-j", setting.jobs,
                *(["--target", *targets] if targets else [])])
    return directory, len(WARNING.findall(done.stdout))


def run(command, check=True, **options):
    """Run a command in the project's directory and keep what it says; show it if it fails."""
    done = subprocess.run([str(word) for word in command], cwd=ROOT, text=True, check=False,
                          errors="replace", stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          **options)
    if check and done.returncode != 0:
        print(done.stdout, flush=True)
        raise SystemExit(f"{command[0]} ended with status {done.returncode}")
    return done


def run_tests(setting, directory, *tests, environment=None):
    """The counts of run_tests.py on a build: of all tests, or of these directories of pytest.

    `environment` holds variables on top of those of this process.
    """
    done = run([setting.python, "test/support/run_tests.py", "--build", directory,
                "--python", setting.python, *tests], check=False,
               env={**os.environ, "FW_SLOWER": SLOWER, **(environment or {})})
    found = re.search(r"(\d+) passed, (\d+) failed(?:, (\d+) skipped)?\s*\Z", done.stdout)
    if not found:
        print(done.stdout, flush=True)
        return Counts(0, 1, 0)
    counts = Counts(*(int(number or 0) for number in found.groups()))
    if not counts.good:
        print(done.stdout, flush=True)
    return counts


def checksum():
    """Of everything that the tests are made of."""
    total = hashlib.sha256()
    for name in SOURCES:
        for path in sorted([ROOT / name, *(ROOT / name).rglob("*")]):
            if path.is_file() and "__pycache__" not in path.parts:
                total.update(path.relative_to(ROOT).as_posix().encode() + path.read_bytes())
    return total.hexdigest()[:16]


def report(text):
    """A line of progress."""
    print(text, file=sys.stderr, flush=True)
