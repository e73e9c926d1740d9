"""Where the project is, and the build under test: that of FW_RUN, or build/release."""
import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "example"
SECTOR = EXAMPLE / "blade_sector"
#: fw_run of the build under test.
PROGRAM = (ROOT / os.environ.get("FW_RUN", "build/release/fw_run")).resolve()
#: Its directory: the libraries, and the compiled part of the Python package.
BUILD = PROGRAM.parent
#: Whether it holds that part: builds under sanitizers leave it out.
HAS_EXTENSION = any(BUILD.glob("python/fretwear/_core.*"))
#: Threads that spin while they wait starve each other where other tests run at the same time.
PATIENT = {**os.environ, "OMP_WAIT_POLICY": "passive"}

# The package of this source tree, also for scripts that no conftest.py prepares.
if str(ROOT / "python") not in sys.path:
    sys.path.insert(0, str(ROOT / "python"))


def require_program() -> None:
    """Say what to do where there is no program."""
    assert PROGRAM.exists(), f"{PROGRAM} is not there: build the project, or set FW_RUN"
