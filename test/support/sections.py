"""Sections of documents that a command writes: what stands between two marks with its name."""
from __future__ import annotations

from pathlib import Path

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "robustness.md"


def write_section(name, lines, document=DOCUMENT):
    """Replace what stands between the two marks of a part of the document."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    before, rest = document.read_text(encoding="utf-8").split(begin)
    after = rest.split(end)[1]
    document.write_text("\n".join([before + begin, *lines, end]) + after, encoding="utf-8")
