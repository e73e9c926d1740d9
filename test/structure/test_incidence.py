"""Loops over B and B^T are written once: what they run over is named by no other source."""
import re
from pathlib import Path

SOURCES = Path(__file__).resolve().parents[2] / "src"
#: Storage of the rows, where they are made (model/relative.f90) and where loops run over them.
STORAGE = re.compile(r"\brow_(start|coordinate|weight)\b", re.IGNORECASE)
OWNERS = {"model/relative.f90", "model/cyclic_relative.f90", "balance/incidence.f90"}


def naming_rows():
    return {path.relative_to(SOURCES).as_posix() for path in SOURCES.rglob("*.f90")
            if STORAGE.search(path.read_text())}


def test_rows_are_named_by_their_owners_alone():
    assert naming_rows() == OWNERS


def test_the_incidence_keeps_its_rows_to_itself():
    text = (SOURCES / "balance/incidence.f90").read_text()
    for component in ("first", "coordinate", "weight"):
        assert re.search(rf"allocatable, private ::.*\b{component}\(:\)", text)
