#!/usr/bin/env python3
"""How the sources are doing as a whole: sizes, and how many files know of one idea.

    house_numbers.py [FOLDER]

FOLDER: the root of another checkout of the project, to compare with. Lines are lines of text;
`files that name` counts sources in which a word stands outside of comments. The ratchet of
test/structure holds these numbers: they may only fall.
"""
from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def sources(root: Path, *folders: str) -> list[Path]:
    """Fortran sources below folders of src (all of it without one)."""
    places = [root / "src" / folder for folder in folders] or [root / "src"]
    return sorted(path for place in places for path in place.rglob("*")
                  if path.suffix.lower() == ".f90")


def code(path: Path) -> str:
    """A source without its comments, in lower case, continued lines joined."""
    text = re.sub(r"!.*", "", path.read_text(encoding="utf-8").lower())
    return re.sub(r"&\s*\n\s*&?", " ", text)


def lines_of(paths: list[Path]) -> int:
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths)


def naming(paths: list[Path], pattern: str) -> int:
    return sum(bool(re.search(pattern, code(path))) for path in paths)


def modules_used(path: Path) -> int:
    """Modules of this project that a source uses."""
    return len(set(re.findall(r"^\s*use\s+(fw_\w+)", code(path), re.MULTILINE)))


def numbers(root: Path) -> dict[str, int]:
    """Every number by its name."""
    src, rooms = sources(root), sources(root, "driver", "io")
    return {
        "lines of src": lines_of(src),
        "files of src": len(src),
        "lines of driver and io": lines_of(rooms),
        "lines of the longest file": max(lines_of([path]) for path in src),
        "modules used by one file, at most": max(map(modules_used, src)),
        "statements `use`": sum(len(re.findall(r"^\s*use\b", code(path), re.MULTILINE))
                                for path in src),
        "files that name forces%pairs": naming(src, r"forces%pairs\b"),
        "files that name case_type": naming(src, r"\bcase_type\b"),
        "files that name an analysis": naming(src, r"\banalysis_\w+"),
        "files with select type": naming(src, r"\bselect type\b"),
    }


def main() -> int:
    now = numbers(ROOT)
    other = numbers(Path(sys.argv[1])) if len(sys.argv) > 1 else None
    print("| what | " + ("before | now |" if other else "now |"))
    print("|---|" + ("---|---|" if other else "---|"))
    for name, value in now.items():
        print(f"| {name} | " + (f"{other[name]} | {value} |" if other else f"{value} |"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
