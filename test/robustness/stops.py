"""How long a stop takes to act, by the size of the sector, into docs/robustness.md.

    python test/robustness/stops.py [--pairs 16 48 384] [--tries 6] [-o docs/robustness.md]

A sweep of the sector that no tolerance ends is stopped by a signal after a random time within the
points, and one from another thread of Python, and of C. What counts is the processor time that the
run still takes, which other work on the machine does not lengthen; the clock stands beside.
"""
import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from project import EXAMPLE, PATIENT, PROGRAM, ROOT
from sections import write_section

#: Seconds of processor time of points before the stop, at most.
BEFORE = 6.0
TICKS = os.sysconf("SC_CLK_TCK")
WAYS = ("signal", "Python thread", "C thread")
#: Status of a run that was stopped.
STATUS = dict(zip(WAYS, (6, 0, 0)))
PYTHON = """
import sys, threading
import fretwear as fw
stop = threading.Event()
threading.Thread(target=lambda: (sys.stdin.readline(), stop.set()), daemon=True).start()
try:
    fw.run(sys.argv[1], stop=stop, check=False)
    sys.exit(1)
except fw.RunStopped:
    pass
"""


def model(pairs, folder):
    """The model file of the sector."""
    shipped = EXAMPLE / "blade_sector" / f"sector_{pairs}.h5"
    if shipped.exists():
        return shipped
    path = folder / f"sector_{pairs}.h5"
    if not path.exists():
        subprocess.run([sys.executable, "-m", "fretwear.sector", "--pairs", str(pairs), "-q", "-o",
                        path], check=True, env={**PATIENT, "PYTHONPATH": str(ROOT / "python")})
    return path


def c_program(folder):
    """The run of C, compiled with the library of the build."""
    path = folder / "stop_run"
    if not path.exists():
        subprocess.run(["cc", "-O1", Path(__file__).with_name("stop_run.c"), "-o", path,
                        f"-I{ROOT / 'include'}", f"-L{PROGRAM.parent}",
                        f"-Wl,-rpath,{PROGRAM.parent}", "-lfretwear", "-lpthread"], check=True)
    return path


def command_of(way, namelist):
    """What runs it."""
    if way == "signal":
        return [PROGRAM, namelist]
    if way == "C thread":
        return [c_program(namelist.parent), namelist]
    return [sys.executable, "-c", PYTHON, namelist]


def spent(process):
    """Processor time of a process so far [s]."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def stopped(way, namelist, wait):
    """Processor time and seconds from the stop to the end of a run."""
    # An output that nobody reads fills no pipe: the run says next to nothing.
    process = subprocess.Popen(command_of(way, namelist), cwd=namelist.parent, text=True,
                               stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL, env={**PATIENT, "OMP_NUM_THREADS": "1",
                                    "PYTHONPATH": f"{ROOT / 'python'}:{PROGRAM.parent / 'python'}"})
    while spent(process) < wait:
        time.sleep(0.02)
        if process.poll() is not None:
            raise RuntimeError(f"the run ended by itself, status {process.returncode}")
    before, begun = spent(process), time.monotonic()
    if way == WAYS[0]:
        process.send_signal(signal.SIGTERM)
    else:
        process.stdin.write("stop\n")
        process.stdin.flush()
    last = before
    while process.poll() is None:
        try:
            last = max(last, spent(process))
        except (OSError, IndexError):
            break
        time.sleep(0.005)
    if process.wait() != STATUS[way]:
        raise RuntimeError(f"the run ended with status {process.returncode}")
    return last - before, time.monotonic() - begun


def measure(pairs, tries, ways, folder):
    """Rows of the table of a size."""
    random.seed(pairs)
    # Its result is beside it under its name, and must not be the model.
    namelist = folder / f"stops_{pairs}.nml"
    groups = [f"&model source = 'hdf5' file = '{model(pairs, folder)}' rotation_speed = 628.3 "
              "modal_damping = 1e-3 /", "&load harmonic_scale = 0.5 /",
              "&case analysis = 'frf' /", "&harmonics n_harmonics = 7 n_time = 128 /",
              "&solver tolerance = 1e-30 /",
              "&sweep start = 995 end = 1029 unit = 'Hz' n_points = 400 /", ""]
    namelist.write_text("\n".join(groups))
    for way in ways:
        found = [stopped(way, namelist, random.uniform(0.5, BEFORE)) for _ in range(tries)]
        yield (f"| {pairs} | {way} | {tries} | {max(cpu for cpu, _ in found):.2f} "
               f"| {sorted(cpu for cpu, _ in found)[tries // 2]:.2f} "
               f"| {max(clock for _, clock in found):.1f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, nargs="+", default=[16, 48, 384])
    parser.add_argument("--tries", type=int, default=6)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=WAYS)
    parser.add_argument("-o", "--output", type=Path, help="document with the section `stops`")
    options = parser.parse_args()
    lines = ["", "| pairs | stopped by | tries | longest [s of processor time] | middle "
             "| longest by the clock [s] |", "|---" * 6 + "|"]
    with tempfile.TemporaryDirectory() as name:
        for pairs in options.pairs:
            for row in measure(pairs, options.tries, options.ways, Path(name)):
                print(row, flush=True)
                lines.append(row)
    if options.output:
        write_section("stops", [*lines, ""], options.output)


if __name__ == "__main__":
    main()
