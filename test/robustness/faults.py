"""Faults at random moments, each judged by what it leaves.

`campaign` tries a scenario with moments that follow from a seed.
"""
import random
import resource
import shutil
import signal
import subprocess
import time

import fault_cases
import h5py
from fault_trials import Fault, Sweep, Wear, demand, end

#: Bytes of a file system that holds an earlier result and not a second one.
SMALL = 256*1024


def killed_sweep(sweep, rng):
    process = sweep.start()
    time.sleep(rng.uniform(0.0, 1.2*sweep.seconds))
    process.kill()
    end(process)
    if not sweep.is_untouched():
        sweep.check_result()
    sweep.complete()


def killed_wear(wear, rng):
    """Up to three times, each run from what the last one left, until one is quicker."""
    rows = 0
    for _ in range(3):
        process = wear.start(wear.furthest()[0])
        time.sleep(rng.uniform(0.0, 1.2*wear.seconds))
        process.kill()
        end(process)
        demand(wear.furthest()[1] >= rows, "lost")
        rows = wear.furthest()[1]
        if (wear.folder / "case.h5").exists():
            break
    wear.complete()


def signalled_wear(wear, rng):
    """Stops with a result that the rest goes on from; before its start, without one."""
    number = rng.choice([signal.SIGINT, signal.SIGTERM])
    process = wear.start()
    time.sleep(rng.uniform(0.0, 1.2*wear.seconds))
    process.send_signal(number)
    status, errors = end(process)
    demand(status in (0, 6, -number), "crash")
    demand(status != 6 or errors.strip(), "silent")
    demand(status == -number or fault_cases.saved(wear.folder / "case.h5") > 0, "lost")
    demand(status != -number or not (wear.folder / "case.h5").exists(), "half")
    wear.complete()


def no_room(sweep, rng):
    """A file that may not grow beyond some size below that of the result."""
    size = rng.randrange(len(sweep.before))
    sweep.refused(sweep.start(
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))))
    sweep.complete()


def mounted(sweep, script):
    """The run on a file system of its own, which holds the earlier result."""
    place = sweep.case.folder / "mounted"
    place.mkdir(exist_ok=True)
    script = (f"mount -t tmpfs -o size={SMALL} none mounted && cp x.h5 mounted && {script}; "
              '"$@"; status=$?; cmp -s x.h5 mounted/x.h5 || status=99; exit $status')
    command = sweep.case.arguments(fault_cases.N_POINTS)
    command[command.index(sweep.case.result)] = "mounted/x.h5"
    return subprocess.Popen(["unshare", "-rm", "sh", "-c", script, "sh", *command], text=True,
                            cwd=sweep.case.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def full_disk(sweep, rng):
    taken = rng.randrange(SMALL//2)
    sweep.refused(mounted(sweep, f"head -c {taken} /dev/zero > mounted/other"))


def read_only(sweep, _):
    sweep.refused(mounted(sweep, "mount -o remount,ro mounted"))


def reader(sweep, rng):
    """A reader keeps what it has open."""
    with h5py.File(sweep.case.result) as file:
        rows = file["coefficients"][:]
        process = sweep.start()
        time.sleep(rng.uniform(0.0, sweep.seconds))
        again = file["coefficients"][:]
        demand(end(process)[0] == 0, "crash")
        demand((again == rows).all() and (file["coefficients"][:] == rows).all(), "lost")
    sweep.check_result()


def writer(sweep, _):
    """What somebody else is writing is not replaced."""
    with h5py.File(sweep.case.result, "r+") as file:
        status, errors = end(sweep.start())
        demand(status == 5, "crash")
        demand("open for writing" in errors, "silent")
        demand(len(file["omega"]) == fault_cases.SHORT, "lost")


def two_runs(sweep, rng):
    first = sweep.start()
    time.sleep(rng.uniform(0.0, 1.2*sweep.seconds))
    second = sweep.start()
    for process in (first, second):
        demand(end(process)[0] == 0, "crash")
        sweep.check_result()
    demand(sweep.case.part() is None, "lost")


def two_runs_one_killed(sweep, rng):
    first, second = sweep.start(), sweep.start()
    time.sleep(rng.uniform(0.0, 1.2*sweep.seconds))
    first.kill()
    end(first)
    demand(end(second)[0] == 0, "crash")
    sweep.check_result()


#: What happens, what is demanded, to which kind of run, how.
SCENARIOS = {
    "kill -9 of a sweep":
        ("the earlier result or the whole new one; the next run gives the same numbers", Sweep,
         killed_sweep),
    "kill -9 of a wear run, up to three times, `--restart`":
        ("saved steps stay; bit for bit the same numbers", Wear, killed_wear),
    "SIGINT or SIGTERM to a wear run, `--restart`":
        ("status 6 and a result; bit for bit the same numbers", Wear, signalled_wear),
    "a file that may not grow":
        ("status 5, a message; the earlier result stays", Sweep, no_room),
    "full disk": ("status 5, a message; the earlier result stays", Sweep, full_disk),
    "read-only file system": ("status 5, a message; the earlier result stays", Sweep, read_only),
    "result open for reading": ("the reader keeps it, the new one takes its name", Sweep, reader),
    "result open for writing": ("status 5, a message; it is not replaced", Sweep, writer),
    "two runs write one name": ("one whole result", Sweep, two_runs),
    "two runs write one name, one is killed": ("the result of the other", Sweep,
                                               two_runs_one_killed),
}
#: Not tried where the system lets nobody mount one.
NEED_FILE_SYSTEM = ("full disk", "read-only file system")


def may_mount():
    return shutil.which("unshare") is not None and subprocess.run(
        ["unshare", "-rm", "mount", "-t", "tmpfs", "none", "/mnt"], check=False,
        capture_output=True).returncode == 0


def campaign(name, folder, tries, seed=1):
    """Number of tries, and [moment's number, kind of fault] of those that went wrong."""
    if name in NEED_FILE_SYSTEM and not may_mount():
        return 0, []
    _, kind, scenario = SCENARIOS[name]
    run, complaints = kind(folder), []
    for k in range(tries):
        run.reset()
        try:
            scenario(run, random.Random(f"{seed}-{k}"))
        except Fault as fault:
            complaints.append((k, str(fault)))
    return tries, complaints
