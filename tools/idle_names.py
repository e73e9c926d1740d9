"""Names that a Fortran module shows and nobody else takes: they can be private.

    python tools/idle_names.py

Goes through the `public` statements of src, and through every `use ..., only:` of src, app, tests,
examples, benchmarks and the Python extension. Numbers that stand in one statement are a family:
one that is taken keeps the others. Exit status 1 where a name is left.
"""

from __future__ import annotations

import re
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("src", "app", "test", "bench", "example", "python/extension", "cmake")
#: What programs outside of the tree use.
FACADE = {"fretwear"}


def statements(path: Path) -> list[str]:
    """Statements of a file in lower case, without comments, continued lines joined."""
    text = re.sub(r"!.*", "", path.read_text(encoding="utf-8").lower())
    text = re.sub(r"&\s*\n\s*&?", " ", text)
    return [line.strip() for line in text.splitlines()]


def main() -> int:
    """List them by file."""
    shown: dict[str, dict[str, Path]] = defaultdict(dict)
    taken: dict[str, set[str]] = defaultdict(set)
    families: list[tuple[str, set[str]]] = []
    whole = set()
    for folder in SOURCES:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix.lower() not in (".f90", ".pf") or "build" in path.parts:
                continue
            module = ""
            for line in statements(path):
                if found := re.match(r"module (\w+)$", line):
                    module = found[1]
                elif found := re.match(r"public\s*::\s*(.*)", line):
                    names = re.findall(r"[\w]+(?:\([^)]*\))?", found[1])
                    if folder == "src":
                        shown[module].update(dict.fromkeys(names, path))
                elif found := re.match(r"use\s+(?:,\s*\w+\s*::\s*)?(\w+)\s*,\s*only\s*:\s*(.*)",
                                       line):
                    taken[found[1]].update(re.split(r"\s*,\s*", re.sub(r"\w+\s*=>\s*", "",
                                                                       found[2])))
                elif found := re.match(r"use\s+(\w+)$", line):
                    whole.add(found[1])
                elif folder == "src" and (found := re.match(r"integer, parameter :: (.*)", line)):
                    families.append((module, set(re.findall(r"(\w+) *=", found[1]))))
                elif found := re.match(r"submodule\s*\((\w+)", line):
                    # Compilers of today link a submodule with public procedures only.
                    taken[found[1]].update(re.findall(r"\w+", " ".join(statements(path))))
    for module, family in families:
        if family & taken[module]:
            taken[module] |= family
    idle = [(path, name) for module, names in shown.items()
            if module not in FACADE | whole for name, path in names.items()
            if name not in taken[module] and not name.startswith(("operator", "assignment"))]
    for path, name in sorted(idle):
        print(f"{path.relative_to(ROOT)}: {name}")
    return 1 if idle else 0


if __name__ == "__main__":
    sys.exit(main())
