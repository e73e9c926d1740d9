"""Cost of a point of all sectors of a disk whose blades differ, beside contact that differs alone.

    python -m bench.speed.blades [--program build/release/fw_run] [--only WORDS]

The shrouded disk of 36 sectors with 16 pairs in each, all sectors solved for: with one shroud
apart, with friction and interference that differ by 10 %, with frequencies of 1 and 2 modes of
a sector held at its interfaces that differ by 3 %, and with both. Times are those of the points of
a sweep without its first, in parts that the run had of the processor; Krylov steps those that a run
counts. A run is ended with its last point: it would look for maxima between them.
Writes the table between its marks in docs/benchmarks/blades.md.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.linalg import eigh

from bench.speed.sectors import (
    ALL_START,
    ENGINE_ORDER,
    N_SECTORS,
    ROOT,
    groups,
    mistuned,
    read_disk,
    write,
)
from fretwear._namelist import write_namelist
from fretwear.disk.cli import main as generate

PAGE = ROOT / "docs" / "benchmarks" / "blades.md"
BEGIN, END = "<!-- blade cost: begin -->", "<!-- blade cost: end -->"
#: Frequencies of a sweep, above the resonances of blades that are alike [Hz].
N_POINTS, SPAN = 6, 10.0
MESH = ("--radial-patches", "2", "--axial-patches", "8", "--axial-layers", "4")
#: Pairs of the disk whose faces `groups` has the stiffness of.
PAIRS_OF_DISK = 4
DEVIATION, APART, SPREAD = 0.03, -1.0, 0.1


def modes(disk: dict[str, Any], r: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the first modes of a sector with its interfaces held, and their frequencies."""
    sides = np.unique(np.abs(np.concatenate((disk["cyclic/left"], disk["cyclic/right"])))) - 1
    inner = np.setdiff1d(np.arange(len(disk["mass"])), sides)
    squares, shapes = eigh(disk["stiffness"][np.ix_(inner, inner)],
                           disk["mass"][np.ix_(inner, inner)], subset_by_index=[0, r - 1])
    omega = np.sqrt(squares)
    rows = np.zeros((r, len(disk["mass"])))
    rows[:] = (shapes / omega).T @ disk["stiffness"][inner]
    return rows, omega


def rows_of(disk: dict[str, Any], r: int) -> dict[str, Any]:
    """Keys of &mistuning: frequencies of so many modes."""
    rows, omega = modes(disk, r)
    rng = np.random.default_rng(r)
    return {"n_rows": r, "rows": rows.tolist(), "row_omega": omega.tolist(), "frequency": (
        DEVIATION * rng.uniform(-1.0, 1.0, (N_SECTORS, r))).ravel().tolist()}


def solve(program: Path, folder: Path, case: dict[str, Any], n_points: int
          ) -> tuple[float, int, float]:
    """Processor time of the later points of a run [s each], its Krylov steps, Newton steps of a
    point."""
    (folder / "case.nml").write_text(write_namelist(case))
    started = time.perf_counter()
    process = subprocess.Popen([program, "case.nml"], cwd=folder, text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                               env={**os.environ, "OMP_NUM_THREADS": "1",
                                    "OPENBLAS_NUM_THREADS": "1"})
    assert process.stdout is not None
    text = ""
    for line in process.stdout:
        text += line
        if line.startswith(f"point {n_points} of"):
            process.send_signal(signal.SIGTERM)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    share = (used.ru_utime + used.ru_stime) / (time.perf_counter() - started)
    found = re.search(r"(\d+) Krylov", text)
    with h5py.File(folder / "case.h5") as file:
        assert file["converged"].shape[0] == n_points and file["converged"][:].all()
        later = [file[name][1:] if file[name].shape[0] > 1 else np.zeros(1)
                 for name in ("seconds", "iterations")]
    krylov = int(found.group(1)) if found else 0
    return share * float(np.mean(later[0])), krylov, float(np.mean(later[1]))


def measure(program: Path, folder: Path, case: dict[str, Any]) -> str:
    """Of a point: time [s], Newton and Krylov steps, without the first."""
    values = np.linspace(ALL_START, ALL_START + SPAN, N_POINTS).tolist()
    sweep = case.get("sweep", {}) | {"refine": False, "unit": "Hz"}
    _, krylov_one, _ = solve(program, folder, case | {"sweep": sweep | {"values": values[:1]}}, 1)
    seconds, krylov, steps = solve(program, folder, case | {"sweep": sweep | {"values": values}},
                                   N_POINTS)
    return f"{seconds:.2f} | {steps:.1f} | {(krylov - krylov_one) / (N_POINTS - 1):.0f}"


def cases(disk: dict[str, Any], path: Path, n_harmonics: int) -> dict[str, Any]:
    """Every case by what differs."""
    loaded = int(np.abs(disk["load/cosine"]).argmax()) + 1
    pairs = len(disk["contact/side_1"])
    plain = groups(path, n_harmonics, loaded) | {
        "cyclic": {"n_sectors": N_SECTORS, "engine_order": ENGINE_ORDER}}
    # A face is as stiff with more pairs.
    for direction in ("tangential", "normal"):
        plain["contact"][f"{direction}_stiffness"] *= PAIRS_OF_DISK / pairs
    alike = mistuned(plain, pairs, 0.0)
    apart = {key: dict(value) for key, value in alike.items()}
    gap = apart["contact"]["gap"]
    apart["contact"]["gap"] = [APART * g for g in gap[:pairs]] + gap[pairs:]
    spread = mistuned(plain, pairs, SPREAD)
    found = {"one shroud apart": apart, "contact 10 %": spread}
    for r in (1, 2):
        blades = f"blades 3 %, {r} mode{'s' * (r > 1)}"
        found[blades] = alike | {"mistuning": rows_of(disk, r)}
    for r in (1, 2):
        blades = f"blades 3 %, {r} mode{'s' * (r > 1)}"
        found[f"{blades}, one shroud apart"] = apart | {"mistuning": rows_of(disk, r)}
    found["blades 3 %, 1 mode, contact 10 %"] = spread | {"mistuning": rows_of(disk, 1)}
    return found


def main() -> None:
    """Measure all and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=Path, default=ROOT / "build" / "release" / "fw_run")
    parser.add_argument("--disk", type=Path, help="in place of the disk with 16 pairs")
    parser.add_argument("--only", default="", help="cases whose names hold this")
    parser.add_argument("--harmonics", type=int, default=3)
    parser.add_argument("--page", type=Path, default=PAGE)
    arguments = parser.parse_args()
    lines = ["| differs | processor s a point | Newton steps | Krylov steps |", "|---" * 4 + "|"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / "disk.h5"
        if arguments.disk is None:
            generate([*MESH, "-q", "-o", str(path)])
        else:
            path.write_bytes(arguments.disk.read_bytes())
        disk = read_disk(path)
        for what, case in cases(disk, path, arguments.harmonics).items():
            if arguments.only not in what:
                continue
            lines.append(f"| {what} | {measure(arguments.program.resolve(), folder, case)} |")
            print(lines[-1], flush=True)
    if not arguments.only:
        write(arguments.page, BEGIN, END, "\n".join(lines))


if __name__ == "__main__":
    main()
