#!/usr/bin/env python3
"""All pictures of the documents on one sheet, to be looked at together.

    contact_sheet.py [-o build/pictures.png] [--columns 5] [FOLDER ...]

Below each its name, its size in pixels and the day of the commit that made it; of a moving picture
the first frame is shown.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
SUFFIXES = {".png", ".gif", ".jpg", ".webp"}
#: Width and height of a place on the sheet [inch].
PLACE = (3.0, 2.7)


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="All pictures of the documents on one sheet.")
    parser.add_argument("folders", nargs="*", type=Path, default=[ROOT / "docs"])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "build" / "pictures.png")
    parser.add_argument("--columns", type=int, default=5)
    options = parser.parse_args()
    paths = pictures(options.folders)
    if not paths:
        print(f"contact_sheet: no picture in {', '.join(map(str, options.folders))}",
              file=sys.stderr)
        return 3
    options.output.parent.mkdir(parents=True, exist_ok=True)
    draw(paths, options.columns, options.output)
    print(f"{len(paths)} pictures: {options.output}")
    return 0


def pictures(folders: list[Path]) -> list[Path]:
    """Every picture below the folders, sorted by its path."""
    return sorted({path for folder in folders for path in folder.rglob("*")
                   if path.suffix.lower() in SUFFIXES})


def day_of(path: Path) -> str:
    """Day of the last commit that changed a picture; "new" where there is none."""
    found = subprocess.run(["git", "log", "-1", "--format=%as", "--", path.name], cwd=path.parent,
                           capture_output=True, text=True)
    return found.stdout.strip() or "new"


def draw(paths: list[Path], columns: int, target: Path) -> None:
    """The sheet."""
    n_rows = math.ceil(len(paths) / columns)
    figure = Figure(figsize=(PLACE[0] * columns, PLACE[1] * n_rows), dpi=100, layout="constrained")
    places = figure.subplots(n_rows, columns, squeeze=False)
    for axes, path in zip(places.flat, paths):
        with Image.open(path) as image:
            axes.imshow(image.convert("RGB"))
            frames = getattr(image, "n_frames", 1)
            moving = f", {frames} frames" if frames > 1 else ""
            axes.set_title(f"{path.parent.name}/{path.name}\n{image.size[0]} x {image.size[1]}"
                           f"{moving}, {day_of(path)}", fontsize=7)
    for axes in places.flat:
        axes.set_axis_off()
    figure.savefig(target)


if __name__ == "__main__":
    sys.exit(main())
