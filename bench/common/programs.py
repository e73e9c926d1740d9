"""Build the measuring programs of bench/ against an installation of the build, and run them."""

from __future__ import annotations

import csv
import io
import os
import subprocess
from pathlib import Path

from bench.common.measure import ROOT

__all__ = ["build_programs", "run_program"]


def build_programs(build: Path, work: Path) -> Path:
    """Install the build and compile bench/*.f90 against it; the folder of the programs."""
    prefix, target = work / "install", work / "cmake"
    # Anew: CMake does not see that modules of the installation have changed.
    for command in (["cmake", "--install", build, "--prefix", prefix],
                    ["cmake", "-S", ROOT / "bench", "-B", target, "-G", "Ninja",
                     f"-DCMAKE_PREFIX_PATH={prefix}"],
                    ["cmake", "--build", target, "--clean-first"]):
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return target


def run_program(program: Path, *arguments: str | Path, separator: str = ",",
                timeout: float | None = None) -> list[dict[str, str]]:
    """Rows of the table that a program writes, in one thread.

    Raises
    ------
    RuntimeError
        Where the program ends with an error; its own words are the message.
    subprocess.TimeoutExpired
        Where it takes longer than `timeout` [s].
    """
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([program, *arguments], check=False, capture_output=True, text=True,
                          env=environment, timeout=timeout)
    if done.returncode != 0:
        raise RuntimeError(f"{program.name} ended with {done.returncode}:\n{done.stderr}")
    return list(csv.DictReader(io.StringIO(done.stdout), delimiter=separator))
