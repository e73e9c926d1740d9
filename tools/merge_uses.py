#!/usr/bin/env python3
"""One `use` statement a module: its names together, wrapped at 100 columns.

    merge_uses.py [--check] [FILES...]

Without files: all of the tree. A block of `use` statements ends at anything else, comments and
lines of the preprocessor among them. The order is that of the first statement of each module, and
of the names within. `--check` changes nothing and lists the files that it would change.
"""
from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("src", "app", "test", "python", "example", "bench", "cmake")
WIDTH = 100
#: A whole statement with its list; renames (`a => b`) and operators are names like others.
STATEMENT = re.compile(
    r"^(\s*)use\b((?:\s*,\s*(?:non_)?intrinsic\s*::)?\s*\w+)\s*,\s*only\s*:(.*)$", re.IGNORECASE)


def statements(lines):
    """(text of a statement on one line, its lines) of consecutive lines."""
    place = 0
    while place < len(lines):
        first, text = place, lines[place]
        while text.rstrip().endswith("&") and "!" not in text and place + 1 < len(lines):
            place += 1
            text = text.rstrip()[:-1].rstrip() + " " + lines[place].strip().lstrip("&").strip()
        place += 1
        yield text, lines[first:place]


def wrapped(indent, module, names):
    """The statement in lines of at most WIDTH columns, continued six columns in."""
    lines, line = [], f"{indent}use{module}, only: "
    for place, name in enumerate(names):
        word = name + (", " if place + 1 < len(names) else "")
        # Room for the mark of continuation, but behind the last name.
        room = WIDTH - (0 if place + 1 == len(names) else 1)
        if len((line + word).rstrip()) + 1 > room and line.strip():
            lines.append(line.rstrip() + " &")
            line = indent + "   "
        line += word
    return [*lines, line.rstrip()]


def merged(text):
    """A source with the names of each module in one statement of a block."""
    result, block = [], {}

    def close():
        for (indent, module), names in block.items():
            result.extend(wrapped(indent, module, names))
        block.clear()

    for statement, lines in statements(text.split("\n")):
        found = STATEMENT.match(statement)
        if found is None or "!" in statement:
            close()
            result.extend(lines)
            continue
        indent, module, listed = found.groups()
        module = module if "," in module else f" {module.strip()}"
        names = block.setdefault((indent, module), [])
        # No comma stands inside a name, but for operator(+) and the like, which hold none.
        names += [name for name in map(str.strip, listed.split(",")) if name not in names]
    close()
    return "\n".join(result)


def main():
    words = sys.argv[1:]
    check = "--check" in words
    paths = [Path(word) for word in words if word != "--check"] or sorted(
        path for folder in FOLDERS for path in (ROOT / folder).rglob("*")
        if path.suffix.lower() in (".f90", ".pf"))
    changed = []
    for path in paths:
        text = path.read_text()
        new = merged(text)
        if new != text:
            changed.append(path)
            if not check:
                path.write_text(new)
    if check:
        for path in changed:
            print(f"{path}: one module in several `use` statements; run tools/merge_uses.py")
    return int(check and bool(changed))


if __name__ == "__main__":
    sys.exit(main())
