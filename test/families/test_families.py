"""Some seeds of every random family: what its judge counts as wrong stays at zero."""
import importlib
import sys
from pathlib import Path

import pytest
from project import PROGRAM, require_program

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from runner import added_up, trials  # noqa: E402

#: Modules of this folder that are families: those that draw and judge.
FAMILIES = sorted(path.stem for path in HERE.glob("*.py") if "\ndef trial(" in path.read_text())


@pytest.mark.parametrize("name", FAMILIES)
def test_family(name):
    require_program()
    family = importlib.import_module(name)
    found = trials(name, family.SMALL, PROGRAM)
    wrong = {seed: counts for seed, counts in found.items()
             if any(counts.get(key) for key in family.ZERO)}
    assert not wrong
    # A judge that reached nothing proves nothing: the first column counts what was reached.
    reached = next(iter(family.COLUMNS))
    assert sum(counts[reached] for counts in added_up(found).values()) > 0
