"""The program as the tests of the package run it."""

from __future__ import annotations

import subprocess
from pathlib import Path

from project import PROGRAM

from fretwear.result import Result


def run(namelist: Path, target: Path, *settings: str) -> Result:
    """Run a case; settings are for --set."""
    options = [word for setting in settings for word in ("--set", setting)]
    subprocess.run([PROGRAM, "-q", *options, "-o", target, namelist], check=True)
    return Result(target)
