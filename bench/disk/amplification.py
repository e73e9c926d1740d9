"""What friction does to the amplification of a mistuned disk, over load and mistuning.

    python -m bench.disk.amplification [--disks 12] [-o docs/mistuned_disk.md]

Twelve blades of the shrouded disk, of a coarse mesh, with a soft pair between neighbours that is
pressed by a constant force. Each field of the picture is the median of the same drawn disks.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test" / "support"), str(ROOT / "python"), str(ROOT)]

from sections import write_section  # noqa: E402

import fretwear as fw  # noqa: E402
from fretwear.disk import DiskParameters, build_full, reduce_disk  # noqa: E402
from fretwear.disk.blades import find_blade  # noqa: E402
from fretwear.disk.model import reduced_system  # noqa: E402
from fretwear.disk.model_file import write_model  # noqa: E402
from fretwear.plot.style import PALETTE, new_figure, tidy  # noqa: E402

Floats = NDArray[np.float64]
DISK = DiskParameters(n_sectors=12, blade_angle=6.0, disk_rows=2, blade_rows=3, axial_layers=1,
                      radial_patches=1, axial_patches=1, n_modes=10)
#: Of a pair [N/mm], the force that presses it [N].
STIFFNESS, PRESS, MU, ORDER = 100.0, 10.0, 0.3, 3
LOADS = (0.1, 0.3, 1.0, 2.0, 4.0, 10.0, 30.0, 100.0)
DEVIATIONS = (0.005, 0.01, 0.02, 0.04)


def disk(folder: Path) -> fw.Case:
    """The case, of a load of 1 N."""
    full = build_full(DISK)
    system = reduced_system(full)
    write_model(reduce_disk(full, system), folder / "disk.h5",
                blade=find_blade(full, system.reduction, 1))
    return fw.Case(
        folder / "disk.h5", cyclic={"engine_order": ORDER, "mistuned": True},
        structure={"rayleigh_stiffness": 4e-7},
        contact={"law": "penalty", "tangential_stiffness": STIFFNESS, "mu": MU,
                 "normal_stiffness": STIFFNESS, "gap": -PRESS / STIFFNESS},
        harmonics={"n_harmonics": 1, "n_time": 64},
        sweep={"start": 770.0, "end": 870.0, "n_points": 51, "unit": "Hz"})


def measure(case: fw.Case, disks: int) -> tuple[Floats, Floats, list[int]]:
    """Median amplification and largest tip per load (deviations, loads); points solved, of all."""
    drawn = np.random.default_rng(1).standard_normal((disks, DISK.n_sectors))
    factor = np.empty((len(DEVIATIONS), len(LOADS)))
    size, points = np.empty_like(factor), [0, 0]
    for i, deviation in enumerate(DEVIATIONS):
        for k, load in enumerate(LOADS):
            found = fw.population(case.replace(load={"harmonic_scale": load}), deviation * drawn)
            factor[i, k] = np.median(found.amplification[:, 0])
            size[i, k] = np.median(found.amplitude[:, 0]) / load
            points[0] += int(found.converged.sum())
            points[1] += int(found.solved.sum())
        print(f"deviation {deviation}: {np.round(factor[i], 2)}", flush=True)
    return factor, size, points


def draw(factor: Floats, size: Floats) -> Figure:
    """Amplification as a map over both, and the largest tip beside it."""
    figure = new_figure(9.6, 4.2)
    left, right = figure.subplots(1, 2)
    image = left.imshow(factor, origin="lower", aspect="auto", cmap="viridis")
    for i in range(len(DEVIATIONS)):
        for k in range(len(LOADS)):
            left.text(k, i, f"{factor[i, k]:.2f}", ha="center", va="center", fontsize=7,
                      color="w" if factor[i, k] < 0.5 * (factor.min() + factor.max()) else "k")
    left.set_xticks(range(len(LOADS)), [f"{load:g}" for load in LOADS])
    left.set_yticks(range(len(DEVIATIONS)), [f"{100.0 * d:g}" for d in DEVIATIONS])
    left.set_xlabel("load [N]")
    left.set_ylabel("deviation of blade frequencies [%]")
    left.set_title("median amplification", fontsize=11)
    figure.colorbar(image, ax=left, shrink=0.9)
    for i, deviation in enumerate(DEVIATIONS):
        right.loglog(LOADS, size[i], "o-", color=PALETTE[i], markersize=3, linewidth=1.2,
                     label=f"{100.0 * deviation:g} %")
    right.set_xlabel("load [N]")
    right.set_ylabel("largest tip / load [mm/N]")
    right.set_title("median of the largest amplitude", fontsize=11)
    tidy(right)
    right.legend(frameon=False, fontsize=8)
    return figure


def main() -> int:
    """Measure, and write table and picture."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--disks", type=int, default=12)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "mistuned_disk.md")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        factor, size, points = measure(disk(Path(name)), options.disks)
    lines = ["", "| deviation \\ load [N] | " + " | ".join(f"{load:g}" for load in LOADS) + " |",
             "|---" * (len(LOADS) + 1) + "|"]
    for deviation, row in zip(DEVIATIONS, factor):
        lines.append(f"| {100.0 * deviation:g} % | " + " | ".join(f"{x:.2f}" for x in row) + " |")
    lines += ["", f"Medians of {options.disks} disks; {points[0]} of {points[1]} points were "
                  "solved.", ""]
    write_section("amplification", lines, options.output)
    draw(factor, size).savefig(options.output.parent / "images" / "mistuned_friction.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
