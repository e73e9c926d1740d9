"""What changes the damping curve of the shrouded disk, varied with one harmonic.

    python -m bench.disk.variations [--build build/release] [-o docs/shrouded_disk.md]
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

from bench.disk.__main__ import EXAMPLE, ROOT, runner, sweep, write_section

LOADS = (10.0, 30.0, 100.0)
DOWN, UP = sweep(1400, 600, 201), sweep(600, 1400, 201)


def split_friction(path: Path) -> tuple[str, ...]:
    """A model whose tangential directions slip on their own: two pairs for each, which share the
    normal stiffness, with twice the friction coefficient."""
    with h5py.File(path, "r+") as file:
        group = file["contact"]
        parts = {name: group[name][()] for name in group}
        for name, values in parts.items():
            del group[name]
            first, second = values.copy(), values.copy()
            if name.startswith("side"):
                first[:, 1] = 0
                second[:, 0], second[:, 1] = second[:, 1], 0
            group[name] = np.concatenate((first, second)) * (2.0 if name == "mu" else 1) if (
                name != "patch") else np.concatenate((first, second))
    return f"model%file='{path}'", "contact%normal_stiffness=36631.7"


def main() -> int:
    """Run all and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "shrouded_disk.md")
    options = parser.parse_args()
    lines = ["", "| varied | " + " | ".join(f"{load:g} N" for load in LOADS) + " |",
             "|---" * (len(LOADS) + 1) + "|"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = runner(options.build.absolute() / "fw_run", folder)
        split = folder / "split.h5"
        shutil.copy(EXAMPLE / "disk.h5", split)
        for what, settings in {
                "sweep down": DOWN, "sweep up": UP,
                "16 instants, down": (*DOWN, "harmonics%sampling=uniform", "harmonics%n_time=16"),
                "64 instants, down": (*DOWN, "harmonics%sampling=uniform", "harmonics%n_time=64"),
                "friction of both directions apart, down": (*DOWN, *split_friction(split))}.items():
            cells = []
            for load in LOADS:
                found = run("vary", "wave.nml", *settings, "harmonics%n_harmonics=1",
                            "sweep%refine=.false.", f"load%harmonic_scale={load}")
                size = np.abs(found.harmonic(1, "tip")) / load
                at = int(size.argmax())
                cells.append(f"{size[at]:.2e} at {found.omega[at] / (2.0 * np.pi):.0f} Hz")
            lines.append(f"| {what} | {' | '.join(cells)} |")
            print(lines[-1], flush=True)
    write_section("variations", [*lines, ""], options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
