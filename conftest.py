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

#: Test files that take longest, in that order: two processes share the files, and one that begins
#: last with minutes to go keeps the other waiting. (`--durations` tells; builds by fpm lead.)
LONGEST = ("test/builds/test_fpm.py", "test/structure/test_toys.py",
           "test/cyclic/test_cyclic_family.py", "test/families/test_families.py")


def pytest_collection_modifyitems(items):
    """The longest files first, the others in the order that they have."""
    rank = {ROOT / name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path, len(rank)))
