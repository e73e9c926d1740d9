"""A command replaces its own section of a document and nothing else."""
import re
import sys
from pathlib import Path

import pytest
from project import ROOT
from sections import DOCUMENT, page_of, write_section

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "verify"))
from verify import PARTS

#: Of the scripts that write a section, and of the parts of `make verify`.
#: A script may write one section of a whole family and another one of a part of it.
CALL = re.compile(r'write_section\("([^"]+)"(?: if [^"]* else "([^"]+)")?')
NAMES = [*sorted({name for path in (ROOT / "test").rglob("*.py")
                  for call in CALL.findall(path.read_text()) for name in call if name}), *PARTS]


#: The counts with their pages, and the page whose trials stand beside what they are about.
PAGES = [DOCUMENT, *sorted(DOCUMENT.with_suffix("").glob("*.md")), ROOT / "docs" / "design.md"]
#: Pages whose sections are those of the table of their own script.
WHOLE = ["thresholds.md"]


@pytest.mark.parametrize("name", NAMES)
def test_a_section_replaces_itself_and_nothing_else(tmp_path, name):
    page = tmp_path / "page.md"
    before = next(text for text in (one.read_text(encoding="utf-8") for one in PAGES)
                  if f"<!-- {name}: begin -->" in text)
    page.write_text(before, encoding="utf-8")
    write_section(name, ["new", "lines"], page)
    after = page.read_text(encoding="utf-8")
    section = re.compile(rf"(<!-- {name}: begin -->)(.*?)(<!-- {name}: end -->)", re.DOTALL)
    assert section.search(after)[2] == "\nnew\nlines\n"
    assert section.sub(r"\1\3", after) == section.sub(r"\1\3", before)


def test_every_section_has_its_command():
    marks = [mark for page in PAGES if page.name not in WHOLE
             for mark in re.findall(r"<!-- (.*): begin -->", page.read_text(encoding="utf-8"))]
    assert sorted(marks) == sorted(NAMES)


def test_a_section_is_found_on_a_page_beside_the_document(tmp_path):
    """Commands name the document; its tables may stand in the folder of its name."""
    name, document, folder = "one", tmp_path / "page.md", tmp_path / "page"
    folder.mkdir()
    document.write_text("No table.\n", encoding="utf-8")
    beside = folder / "one.md"
    beside.write_text("<!-- one: begin -->\nold\n<!-- one: end -->\n", encoding="utf-8")
    write_section(name, ["new"], document)
    assert beside.read_text(encoding="utf-8") == "<!-- one: begin -->\nnew\n<!-- one: end -->\n"
    assert document.read_text(encoding="utf-8") == "No table.\n"
    (folder / "two.md").write_text("<!-- one: begin -->\n<!-- one: end -->\n", encoding="utf-8")
    with pytest.raises(ValueError, match="stands on 2 pages"):
        page_of("one", document)
