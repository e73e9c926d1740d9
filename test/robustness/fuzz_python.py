#!/usr/bin/env python3
"""Hostile arguments for the Python package: every refusal is an exception with a message.

    fuzz_python.py [-n 20000] [--seed 1] [--only K] [--report FILE]

Input k is a function of the seed and k alone: a sound call with one to three arguments replaced.
It may return; or raise an error of the package, a ValueError, TypeError or MemoryError, with a
message. The calls are made in a process of their own, which ends with a crash, after 10 s of
processor time for one call, or at 4 GB; it is started again after the input that ended it.
"""
import argparse
import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path

HERE = Path(__file__).resolve().parent
SECONDS = 10.0
MEGABYTES = 4096
#: MemoryError is NumPy's word for what it cannot hold.
REFUSALS = (ValueError, TypeError, MemoryError)


def mutate(rng, sound):
    """The arguments of a sound call with some of them replaced, left out, or foreign."""
    import fuzz_values
    arguments = dict(sound)
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        name = rng.choice(list(sound))
        kind = rng.random()
        if kind < 0.05:
            arguments.pop(name, None)
        elif kind < 0.07:
            arguments[name + "x"] = 1
        else:
            arguments[name] = fuzz_values.hostile(rng, sound[name])
    return arguments


def holds_nan(result):
    """Whether a result has NaN in a point that it calls converged."""
    import numpy as np

    import fretwear as fw
    if not isinstance(result, fw.Result):
        return False
    return not np.isfinite(result.coefficients[result.converged]).all()


def one(seed, k):
    """Name of the call, how it ended, and what is wrong with that, or nothing."""
    import fuzz_calls

    import fretwear as fw
    rng = random.Random(f"{seed}-{k}")
    name = rng.choice(fuzz_calls.SHARES)
    sound, call = fuzz_calls.CALLS[name]
    arguments = mutate(rng, sound)
    try:
        result = call(arguments)
    except (fw.FretwearError, fw.RunInterrupted, *REFUSALS) as error:
        kind = type(error).__name__
        return name, kind, None if str(error).strip() else f"silent: {kind} without a message"
    except BaseException as error: # whatever else it is, it is a fault
        return name, "other", f"other exception: {type(error).__name__}: {error}"
    return name, "returned", "NaN in a converged point" if holds_nan(result) else None


def child(seed, start, end):
    """Every input from start to end, a line of JSON before and after each."""
    sys.path[:0] = [str(HERE)]
    import numpy as np
    warnings.simplefilter("ignore")
    np.seterr(all="ignore")
    import fuzz_calls
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    with tempfile.TemporaryDirectory(prefix="fretwear-fuzz-") as folder:
        os.chdir(folder)
        fuzz_calls.prepare()
        resource.setrlimit(resource.RLIMIT_AS, (MEGABYTES << 20, MEGABYTES << 20))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        for k in range(start, end):
            out.write(f"{json.dumps([k])}\n")
            signal.setitimer(signal.ITIMER_PROF, SECONDS) # its signal ends this process
            ended = one(seed, k)
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            out.write(f"{json.dumps([k, *ended])}\n")


def name_of(seed, k):
    sys.path[:0] = [str(HERE)]
    import fuzz_calls
    return random.Random(f"{seed}-{k}").choice(fuzz_calls.SHARES)


def run(seed, start, end):
    """Ends of the inputs, counted, and what is wrong."""
    counts, failures, k = Counter(), [], start
    while k < end:
        command = [sys.executable, __file__, "--child", *map(str, (seed, k, end))]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   text=True)
        pending = None
        for line in process.stdout:
            pending, *ended = json.loads(line)
            if not ended:
                continue
            name, kind, bad = ended
            counts[f"{name}|{kind}"] += 1
            if bad:
                failures.append([pending, name, bad])
                print(f"input {pending} ({name}): {bad}", flush=True)
            k, pending = pending + 1, None
        errors = process.stderr.read()
        status = process.wait()
        if pending is None and status == 0:
            break
        if pending is None:
            raise RuntimeError(f"the process of the calls ended with {status}: {errors[-500:]}")
        bad = ("hang" if status == -signal.SIGPROF else
               f"crash: ended with {status}: {errors[-300:]}")
        name = name_of(seed, pending)
        counts[f"{name}|{'hang' if bad == 'hang' else 'crash'}"] += 1
        failures.append([pending, name, bad])
        print(f"input {pending} ({name}): {bad}", flush=True)
        k = pending + 1
    return counts, failures


def main():
    if sys.argv[1:2] == ["--child"]:
        child(*map(int, sys.argv[2:]))
        return 0
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=20000, help="inputs in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="input of this number alone")
    parser.add_argument("--report", type=Path, help="JSON file for what was counted")
    settings = parser.parse_args()
    start = 0 if settings.only is None else settings.only
    end = settings.n if settings.only is None else settings.only + 1
    counts, failures = run(settings.seed, start, end)
    if settings.report:
        settings.report.parent.mkdir(parents=True, exist_ok=True)
        settings.report.write_text(json.dumps(
            {"seed": settings.seed, "n": settings.n, "counts": dict(counts), "failures": failures},
            indent=1) + "\n")
    print(f"{sum(counts.values())} inputs, {len(failures)} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
