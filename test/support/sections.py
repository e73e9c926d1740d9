"""Sections of documents that a command writes: what stands between two marks with its name."""
from __future__ import annotations

from pathlib import Path

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "robustness.md"


def page_of(name, document=DOCUMENT):
    """Where a section stands: the document itself, or a page of the folder of its name."""
    mark = f"<!-- {name}: begin -->"
    pages = [document, *sorted(document.with_suffix("").glob("*.md"))]
    found = [page for page in pages if mark in page.read_text(encoding="utf-8")]
    if len(found) != 1:
        raise ValueError(f"{mark} stands on {len(found)} pages of {document}, must be on one")
    return found[0]


def write_section(name, lines, document=DOCUMENT):
    """Replace what stands between the two marks of a part of the document."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    page = page_of(name, document)
    before, rest = page.read_text(encoding="utf-8").split(begin)
    after = rest.split(end)[1]
    page.write_text("\n".join([before + begin, *lines, end]) + after, encoding="utf-8")
