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
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test" / "support")]

from sections import write_section  # noqa: E402

JOB = ROOT / "example" / "mistuned_disk" / "job.py"
PICTURES = ("campbell", "blades", "content", "population", "haigh")


def main() -> int:
    """Run the job and write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "mistuned_disk.md")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        subprocess.run([sys.executable, JOB, "--folder", folder], check=True)
        seconds = time.perf_counter() - started
        lines = (Path(folder) / "report.txt").read_text(encoding="utf-8").splitlines()
        for name in PICTURES:
            shutil.copy(Path(folder) / f"{name}.png",
                        options.output.parent / "images" / f"mistuned_{name}.png")
    write_section("report", ["", *(f"* {line}" for line in lines), "",
                             f"The job took {seconds:.0f} s with {len(os.sched_getaffinity(0))} "
                             "processors in use by others too.", ""], options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
