"""The runs that faults are tried on, and what may be wrong with what a fault leaves."""
import subprocess
import sys
import time
from pathlib import Path

import fault_cases

sys.path[:0] = [str(Path(__file__).resolve().parents[1] / name) for name in ("cli", "support")]
import wear_cases  # noqa: E402
from cases import read  # noqa: E402
from project import PROGRAM  # noqa: E402

#: Points of a sweep and limit of the clock [s]; both leave an idle machine much room.
LENGTH, TIME_LIMIT = 300, 120


class Fault(Exception):
    """What is wrong with a try: crash (another end than the one demanded), hang, silent (failed
    without a message), half (a file under the final name that is no whole result), lost (what was
    saved before is gone), numbers (not those of an undisturbed run; NaN is none of them)."""


def demand(condition, kind):
    if not condition:
        raise Fault(kind)


def end(process):
    """Status and messages of a process, which has to end."""
    try:
        errors = process.communicate(timeout=TIME_LIMIT)[1]
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise Fault("hang") from None
    return process.returncode, errors


class Sweep:
    """A sweep beside an earlier result of its name, and the time that it takes."""

    def __init__(self, folder):
        self.case = fault_cases.Case(PROGRAM, folder)
        start = time.monotonic()
        assert self.case.run(length=LENGTH).returncode == 0
        self.seconds = time.monotonic() - start
        self.case.complete()
        self.before = self.case.result.read_bytes()
        self.case.reference()

    def reset(self):
        for part in self.case.folder.glob("x.h5*"):
            part.unlink()
        self.case.result.write_bytes(self.before)

    def start(self, **options):
        return self.case.start(length=LENGTH, **options)

    def is_untouched(self):
        return self.case.result.read_bytes() == self.before

    def check_result(self):
        """The whole result of this run has taken the place of the earlier one."""
        demand(self.case.result.exists(), "lost")
        demand(fault_cases.saved(self.case.result) == LENGTH, "half")
        demand(self.case.equals_reference(), "numbers")

    def complete(self):
        demand(self.case.run(length=LENGTH).returncode == 0, "crash")
        self.check_result()

    def refused(self, process):
        """Status 5 with a message, and the earlier result as it was."""
        status, errors = end(process)
        demand(status == 5, "crash")
        demand("fw_run: error: " in errors, "silent")
        demand(self.is_untouched(), "lost")


class Wear:
    """A wear run that can go on from what it has saved."""

    GROUPS = wear_cases.oscillator(25, error_tolerance=1e-5, n_cycles=50.0)

    def __init__(self, folder):
        self.folder = folder
        start = time.monotonic()
        self.whole = wear_cases.result(folder, self.GROUPS)
        self.seconds = time.monotonic() - start
        self.reset()

    def reset(self):
        for path in self.folder.glob("case.h5*"):
            path.unlink()

    def start(self, restart=None):
        arguments = [] if restart is None else ["--restart", restart.name]
        return subprocess.Popen([PROGRAM, "-q", *arguments, "case.nml"], text=True,
                                cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    def furthest(self):
        """The file with the most steps, and how many; a run that was only begun has none."""
        rows = {path: fault_cases.saved(path) for path in self.folder.glob("case.h5*")}
        best = max(rows, key=rows.get, default=None)
        return (best, rows[best]) if best and rows[best] > 0 else (None, 0)

    def check_result(self):
        demand(fault_cases.saved(self.folder / "case.h5") > 0, "half")
        try:
            wear_cases.assert_same(read(self.folder / "case.h5"), self.whole)
        except AssertionError:
            raise Fault("numbers") from None

    def complete(self):
        """Go on from what is there."""
        path = self.furthest()[0]
        demand(end(self.start(path))[0] == 0, "crash")
        self.check_result()
