#!/usr/bin/env python3
"""Wrap the prose of the documents, so that no line of it needs scrolling.

    wrap_documents.py [--check] [FILE ...]

Without files: README.md, CHANGELOG.md, CONTRIBUTING.md and every Markdown file in docs. A paragraph
or an item of a list that has a line of more than 120 columns is filled anew; the others stay, and
so do tables, code, headings, pictures and comments. With --check nothing is written, and the status
is 1 where a line is too long.
"""
from __future__ import annotations

import argparse
import re
import sys
import textwrap
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WIDTH = 120
#: Begins what is no prose: tables, headings, pictures, comments and tags, rules.
FIXED = re.compile(r"\||#|!\[|<|---|\$\$")
ITEM = re.compile(r"( *)([*+-]|\d+\.) +")
#: Code within a line, which stays in one, and what holds it together meanwhile.
SPAN = re.compile(r"`[^`]{1,80}`")
HELD = "\0"


def documents() -> list[Path]:
    """What is wrapped."""
    return [ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "CONTRIBUTING.md",
            *sorted((ROOT / "docs").rglob("*.md"))]


def blocks(text: str) -> list[tuple[bool, list[str]]]:
    """Lines in blocks, and whether a block is prose: a paragraph, or an item of a list."""
    found: list[tuple[bool, list[str]]] = []
    fenced, in_list = False, False
    for line in text.split("\n"):
        body = line.strip()
        fence = body.startswith("```")
        indented = len(line) - len(line.lstrip())
        item = ITEM.match(line)
        is_text = bool(body) and not (fence or fenced or FIXED.match(body))
        prose = is_text and (bool(item) or indented < 4 or in_list)
        fenced ^= fence
        if body and not indented:
            in_list = bool(item)
        joins = found and found[-1][0] and prose and not item
        # Two blanks at the end break a line on purpose.
        if joins and not found[-1][1][-1].endswith("  "):
            found[-1][1].append(line)
        else:
            found.append((prose, [line]))
    return found


def filled(lines: list[str]) -> list[str]:
    """A block of prose in lines of `WIDTH`, if one of them is longer."""
    if max(map(len, lines)) <= WIDTH:
        return lines
    item = ITEM.match(lines[0])
    indent = len(item[0]) if item else len(lines[0]) - len(lines[0].lstrip())
    words = SPAN.sub(lambda found: found[0].replace(" ", HELD),
                     " ".join(line.strip() for line in lines))
    first = " " * len(item[1]) if item else " " * indent
    # A line that began with a mark of its own would be read as one: then break elsewhere.
    for width in range(WIDTH, WIDTH // 2, -1):
        done = textwrap.wrap(words, width, initial_indent=first, subsequent_indent=" " * indent,
                             break_long_words=False, break_on_hyphens=False)
        if not any(FIXED.match(line.strip()) or ITEM.match(line) for line in done[1:]):
            return [line.replace(HELD, " ") for line in done]
    return lines


def wrap(text: str) -> str:
    """The document with its prose wrapped."""
    return "\n".join(line for prose, lines in blocks(text)
                     for line in (filled(lines) if prose else lines))


def too_long(text: str) -> list[int]:
    """Numbers of the lines of prose beyond `WIDTH` that could be broken."""
    number, found = 0, []
    for prose, lines in blocks(text):
        for line in lines:
            number += 1
            if prose and len(line) > WIDTH and " " in line.strip()[:WIDTH]:
                found.append(number)
    return found


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="Wrap the prose of the documents.")
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--check", action="store_true", help="say which lines are too long")
    options = parser.parse_args()
    status = 0
    for path in options.files or documents():
        text = path.read_text(encoding="utf-8")
        if not options.check:
            if (done := wrap(text)) != text:
                path.write_text(done, encoding="utf-8")
            text = done
        for number in too_long(text):
            print(f"{path}:{number}: more than {WIDTH} columns")
            status = 1
    return status


if __name__ == "__main__":
    sys.exit(main())
