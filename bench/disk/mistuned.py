"""Figures and pictures of docs/mistuned_disk.md: what example/mistuned_disk/job.py finds.

    python -m bench.disk.mistuned [-o docs/mistuned_disk.md]
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import textwrap
import time
from pathlib import Path

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test" / "support"), str(ROOT / "python")]

from sections import write_section  # noqa: E402

from fretwear.disk import DiskParameters, FullDisk, build_full  # noqa: E402
from fretwear.disk.model import reduced_system  # noqa: E402
from fretwear.disk.stress import find_stress  # noqa: E402
from fretwear.sector.stress import stress_points  # noqa: E402

JOB = ROOT / "example" / "mistuned_disk" / "job.py"
#: A wave of this order, off and on the first family [Hz], with this loss factor.
ORDER, PLACES, LOSS = 4, (350.0, 388.0, 800.0), 0.002
MODES = (10, 30, 90)
PICTURES = ("campbell", "blades", "content", "population", "haigh")


def errors() -> list[str]:
    """Stress of the reduced sector against that of the full mesh, by modes and frequency."""
    full = build_full(DiskParameters())
    n, n_sectors = full.n_interface, full.parameters.n_sectors
    z = np.exp(-2j * np.pi * ORDER / n_sectors)
    tie = sp.csr_array(full.rows[n:2 * n] - z * full.rows[:n])
    load = np.concatenate((full.rows[[-2]].toarray()[0], np.zeros(n))).astype(complex)
    points = stress_points(full.sector.mesh, full.sector.body, full.parameters.material)
    rows = points.rows[:, full.free]

    def whole(omega: float) -> np.ndarray:
        matrix = (1.0 + 1j * LOSS) * full.stiffness - omega**2 * full.mass
        tied = sp.csc_matrix(sp.block_array([[matrix, tie.conj().T], [tie, None]]))
        found: np.ndarray = rows @ spl.spsolve(tied, load)[:len(full.free)]
        return found

    wanted = {place: whole(2.0 * np.pi * place) for place in PLACES}
    lines = ["", "| modes | " + " | ".join(f"{place:g} Hz" for place in PLACES) + " |",
             "|---" * (len(PLACES) + 1) + "|"]
    for n_modes in MODES:
        kept = FullDisk(**{**vars(full), "parameters": DiskParameters(n_modes=n_modes)})
        system = reduced_system(kept)
        matrix = np.asarray(find_stress(kept, system.reduction).matrix)
        size = len(system.mass)
        left = np.setdiff1d(np.arange(size), np.arange(n, 2 * n))
        alike = np.zeros((size, len(left)), dtype=complex)
        alike[left, np.arange(len(left))] = 1.0
        alike[np.arange(n, 2 * n), np.arange(n)] = z
        right = alike.conj().T[:, full.rows.shape[0] - 2]
        cells = []
        for place, exact in wanted.items():
            small = (1.0 + 1j * LOSS) * system.stiffness - (2.0 * np.pi * place)**2 * system.mass
            moved = alike @ np.linalg.solve(alike.conj().T @ small @ alike, right)
            off = np.abs(matrix.reshape(-1, size) @ moved - exact).max() / np.abs(exact).max()
            cells.append(f"{off:.1e}")
        lines.append(f"| {n_modes} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def main() -> int:
    """Run the job and write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "mistuned_disk.md")
    options = parser.parse_args()
    write_section("errors", errors(), options.output)
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        subprocess.run([sys.executable, JOB, "--folder", folder], check=True)
        seconds = time.perf_counter() - started
        lines = (Path(folder) / "report.txt").read_text(encoding="utf-8").splitlines()
        for name in PICTURES:
            shutil.copy(Path(folder) / f"{name}.png",
                        options.output.parent / "images" / f"mistuned_{name}.png")
    report = [textwrap.fill(f"* {line}", 120, subsequent_indent="  ", break_on_hyphens=False)
              for line in lines]
    write_section("report", ["", *report, "",
                             f"The job took {seconds:.0f} s with {len(os.sched_getaffinity(0))} "
                             "processors in use by others too.", ""], options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
