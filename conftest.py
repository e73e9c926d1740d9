"""On the path: the package of this source tree, with the compiled part of the build under test, and
what all tests share."""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent
_build = (ROOT / os.environ.get("FW_RUN", "build/release/fw_run")).resolve().parent
_package = [str(ROOT / "python"), str(_build / "python")]

sys.path[:0] = [*_package, str(ROOT / "test" / "support"), str(ROOT)]
os.environ["PYTHONPATH"] = os.pathsep.join([*_package, os.environ.get("PYTHONPATH", "")])
