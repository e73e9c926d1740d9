"""docs/architecture.md names files and procedures that are there."""
import re

from project import ROOT

PAGE = (ROOT / "docs" / "architecture.md").read_text()
SOURCES = {path.relative_to(ROOT / "src").as_posix(): path.read_text()
           for path in (ROOT / "src").rglob("*.f90")}


def test_named_files_are_there():
    named = set(re.findall(r"`(?:driver/|src/)?([\w/]+\.f90)`", PAGE))
    assert len(named) > 30
    missing = [name for name in named
               if not any(path == name or path.endswith(f"/{name}") for path in SOURCES)]
    assert missing == []


def test_named_procedures_and_types_are_there():
    named = set(re.findall(r"`([a-z]+_[a-z_]+)`", PAGE))
    assert len(named) > 10
    text = "\n".join(SOURCES.values())
    assert [name for name in named if not re.search(rf"\b{name}\b", text)] == []


def test_the_page_stays_short():
    assert len(PAGE.split()) <= 1470
