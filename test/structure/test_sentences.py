"""The documents a user reads: sentences that are read once.

Prose alone counts: tables, code, headings and pictures are left out, links are their text, a span
of code is one word. Items of lists and colons that end a line end a sentence.
"""
import re

import pytest
from project import ROOT

PAGES = ["README.md", *(f"docs/{name}.md" for name in (
    "design", "files", "glossary", "keys", "limits", "messages", "models", "python",
    "shrouded_disk", "studies", "user-guide"))]
#: Words of a sentence in the mean of a page.
MEAN = 20.0
#: Words of the user guide with its generated tables, cells' bars included: it may only become
#: shorter, but for what a new feature adds.
GUIDE = {"user-guide": 2100, "keys": 6850, "files": 3500, "messages": 2200}


def sentences(text: str) -> list[int]:
    """Words of each sentence of a page."""
    text = re.sub(r"```.*?```|<!--.*?-->", "", text, flags=re.DOTALL)
    blocks, block = [], []
    for line in [*text.splitlines(), ""]:
        body = line.strip()
        item = re.match(r"(?:[*+-]|\d+\.) +", body)
        fixed = not body or re.match(r"\||#|!\[|<|---|\$\$", body)
        code = line.startswith("    ") and not block
        if fixed or code or item:
            blocks.append(" ".join(block))
            block = []
        if not fixed and not code:
            block.append(body[item.end():] if item else body)
    blocks.append(" ".join(block))
    found = []
    for prose in blocks:
        prose = re.sub(r"`[^`]+`", "code", prose)
        prose = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", prose)
        found += [len(part.split()) for part in re.split(r"(?<=[.!?])[)*]*\s+(?=[A-Z(*\[]|code)",
                                                         prose) if len(part.split()) > 1]
    return found


@pytest.mark.parametrize("name", PAGES)
def test_sentences_are_short(name):
    counts = sentences((ROOT / name).read_text())
    assert sum(counts) <= MEAN * len(counts), f"{sum(counts) / len(counts):.1f} words in the mean"


@pytest.mark.parametrize(("name", "limit"), GUIDE.items())
def test_the_guide_stays_short(name, limit):
    assert len((ROOT / "docs" / f"{name}.md").read_text().split()) <= limit


def test_what_counts_as_a_sentence():
    page = ("# A title of many words. Not one of them counts\n\nOne two three. Four `five six` "
            "seven.\n\n| a | table. |\n\n    code of a page\n\n* an item of [five words](x.md#y)\n"
            "* and\n  four more words\n")
    assert sentences(page) == [3, 3, 5, 4]
