"""Figures of docs/good_for.md and docs/paper/claims.md stand on the pages that their rows name."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = ("good_for.md", "paper/claims.md")
#: A number as a reader sees one, with its sign and a sign of percent.
NUMBER = r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:e[+-]\d+)?(?: %)?(?![\w%]|\.\d)"


def rows(path: Path) -> list[tuple[str, str]]:
    """Figure and page of each row of the tables that have both."""
    found, columns = [], None
    for line in path.read_text(encoding="utf-8").splitlines():
        # What a measurement has written is no citation.
        if "measured*" in line.lower() or not line.startswith("|"):
            columns = None
            continue
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if columns is None:
            heads = {"figure": "page", "its size": "where it is measured"}
            name = next((head for head in heads if head in cells), None)
            columns = (cells.index(name), cells.index(heads[name])) if name else (-1, -1)
        elif columns[0] >= 0 and not set(line) <= set("|- "):
            found.append((cells[columns[0]], cells[columns[1]]))
    return found


@pytest.mark.parametrize("name", PAGES)
def test_figures_are_those_of_the_pages(name: str) -> None:
    path = DOCS / name
    cited = rows(path)
    assert len(cited) > 10
    for figure, page in cited:
        numbers = re.findall(NUMBER, figure)
        link = re.search(r"\]\(([^)#]+)|`(test/[^`]+)`", page)
        assert link or not numbers, f"{figure}: from nowhere"
        if link:
            source = path.parent / link[1] if link[1] else DOCS.parent / link[2]
            known = re.findall(NUMBER, source.read_text(encoding="utf-8"))
            for number in numbers:
                assert number in known, f"{number} is not on {source}"


def test_numbers_are_found_as_they_are_written() -> None:
    """Or the test above would pass by itself."""
    text = "met: +1.016 % of 2390 cases, 3.0e-11, 0.8830621, H7, and -0.009 %."
    assert re.findall(NUMBER, text) == ["+1.016 %", "2390", "3.0e-11", "0.8830621", "-0.009 %"]
