#!/usr/bin/env python3
"""Comments in src: their share of the lines that are not blank, folder by folder.

    comment_share.py [--least 0.13]

15 % is the aim (CONTRIBUTING.md); the least share, which `make lint` holds, follows it upwards. A
comment is a line of its own that says something in words: rules, bare marks, directives and code
that is commented out are none. Ends with status 1 where the whole of src has less than the least
share, and names the larger files that have hardly any.
"""
from __future__ import annotations

import argparse
import re
import sys
from collections import defaultdict
from pathlib import Path

SOURCES = Path(__file__).resolve().parents[1] / "src"
#: Two words, of which one has a lower-case letter run of three: no rule, mark or formula alone.
WORDS = re.compile(r"[A-Za-z]{3,}.*\s\S*[A-Za-z]{2,}|[A-Za-z]{3,}\s+\S")
#: What a compiler reads, and statements that were left behind a mark.
DIRECTIVE = re.compile(r"^!(\$|dir\$|gcc\$|dec\$)", re.IGNORECASE)
CODE = re.compile(
    r"^!+\s*(call \w+\s*\(|end (do|if|select|subroutine|function)\b|use \w+, only:"
    r"|\w+(%\w+)*(\(.*\))?\s*=\s*[^=].*[;)]?$|if \(.*\) then$)", re.IGNORECASE)
#: Files of this many lines and more are named when below the share.
LARGE, FEW = 80, 0.05


def is_comment(line: str) -> bool:
    """Whether a stripped line is a comment that says something."""
    if not line.startswith("!") or DIRECTIVE.match(line):
        return False
    return bool(WORDS.search(line)) and not CODE.match(line)


def count(text: str) -> tuple[int, int]:
    """Comments, and lines that are not blank."""
    lines = [line for raw in text.splitlines() if (line := raw.strip())]
    return sum(map(is_comment, lines)), len(lines)


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="Share of comments in src.")
    parser.add_argument("--least", type=float, default=0.13)
    least = parser.parse_args().least
    folders: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    bare = []
    for path in sorted((*SOURCES.rglob("*.f90"), *SOURCES.rglob("*.F90"))):
        comments, lines = count(path.read_text(encoding="utf-8"))
        name = path.relative_to(SOURCES)
        folder = folders[str(name.parent)]
        folder[0] += comments
        folder[1] += lines
        if lines >= LARGE and comments < FEW * lines:
            bare.append(f"{name}: {comments} of {lines}")
    for folder, (comments, lines) in sorted(folders.items()):
        print(f"{folder:16} {comments:6} of {lines:6}  {comments / lines:6.1%}")
    comments, lines = (sum(one[i] for one in folders.values()) for i in (0, 1))
    print(f"{'all':16} {comments:6} of {lines:6}  {comments / lines:6.1%}")
    print("\n".join(["hardly any: " + one for one in bare]))
    return 0 if comments >= least * lines else 1


if __name__ == "__main__":
    sys.exit(main())
