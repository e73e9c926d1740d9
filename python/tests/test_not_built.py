"""The package in a source tree whose compiled part has not been built: pictures of files all the
same, and words for what needs it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from program import run
from project import ROOT

#: What needs the compiled part says so in this line.
WORDS = "the compiled part of fretwear cannot be loaded"


def fretwear(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The command without anything of a build on its path."""
    place = {**os.environ, "PYTHONPATH": str(ROOT / "python")}
    return subprocess.run([sys.executable, "-m", "fretwear", *arguments], cwd=folder, text=True,
                          capture_output=True, check=False, env=place)


@pytest.mark.parametrize(("settings", "pictures"), [
    (["wear%n_cycles=1e4"], {"harmonics", "wear_bars", "wear_evolution", "convergence"}),
    (["case%analysis='modes'"], {"nodal_diameters"})], ids=["wear", "modes"])
def test_files_are_drawn_without_the_compiled_part(
        tmp_path: Path, settings: list[str], pictures: set[str]) -> None:
    namelist = ROOT / "example" / "shrouded_disk" / "wear.nml"
    run(namelist, tmp_path / "r.h5", *settings)
    done = fretwear(tmp_path, "plot", "r.h5")
    assert done.returncode == 0 and "Traceback" not in done.stderr
    drawn = {line[len("r_"):-len(".png")] for line in done.stdout.split()}
    assert pictures <= drawn
    assert all(WORDS in line for line in done.stderr.splitlines() if line)
    page = fretwear(tmp_path, "report", "r.h5")
    assert page.returncode == 0, page.stderr
    text = (tmp_path / "r.html").read_text()
    assert ("Natural frequencies" in text) == ("modes" in settings[0])
    case = fretwear(tmp_path, "run", str(namelist))
    assert case.returncode == 3 and WORDS in case.stderr and "Traceback" not in case.stderr
