"""The types of the balance stay small: what belongs together has a type and a file of its own."""
import re
from pathlib import Path

import pytest

SOURCES = Path(__file__).resolve().parents[2] / "src"
#: Below this many public components a type can be kept in mind.
MOST = 15
TYPES = {
    "balance_problem": "balance/balance_problem.f90",
    "balance_state": "balance/balance_state.f90",
    "active_set": "balance/active_set.f90",
    "kept_factors": "balance/kept_factors.f90",
    "balance_scratch": "balance/balance_scratch.f90",
    "formulation_type": "balance/formulation.f90",
    "hdhb_system": "balance/hdhb.f90",
    "flow_system": "balance/flow.f90",
    "wear_system": "wear/wear_system.f90",
    "augmented_system": "solve/augmented_system.f90",
    "plane_system": "solve/plane_system.f90",
    "force_list": "force/force_list.f90",
    "structure_operator": "model/structure_operator.f90",
    "structure_state": "model/structure_operator.f90",
}


def public_components(text: str, name: str) -> list[str]:
    """Names of the components that a type declares itself, without those marked private."""
    body = re.search(rf"^ *type(?:, [^:\n]*)? :: {name}\n(.*?)^ *end type {name}", text,
                     re.DOTALL | re.MULTILINE)
    assert body, f"no type {name}"
    lines = [re.sub(r"!.*", "", line).strip() for line in body[1].splitlines()]
    if "contains" in lines:
        lines = lines[:lines.index("contains")]
    names = []
    for line in filter(None, lines):
        attributes, _, entities = line.partition("::")
        if not entities or re.search(r"\bprivate\b", attributes):
            continue
        entities = re.sub(r"\([^()]*\)", "", entities)
        names += [entity.split("=")[0].strip() for entity in entities.split(",")]
    return names


@pytest.mark.parametrize("name", TYPES)
def test_few_public_components(name):
    components = public_components((SOURCES / TYPES[name]).read_text(), name)
    assert len(components) < MOST, components


def test_components_are_counted_as_they_are_declared():
    text = """
   type, extends(a) :: b
      !> One.
      integer :: n = 0, m = 1 ! two
      real(wp), allocatable :: x(:, :), y(:)
      real(wp), allocatable, private :: hidden(:)
      procedure(f), pointer, nopass :: act => null()
   contains
      procedure :: no_component
   end type b
"""
    assert public_components(text, "b") == ["n", "m", "x", "y", "act"]


def test_only_the_builder_asks_for_the_formulation():
    """Which unknowns are solved for is chosen once, and the values of hdhb are known to one file."""
    for path in SOURCES.glob("driver/*.f90"):
        text = path.read_text()
        assert "fw_hdhb" not in text, path
        if "method_hdhb" in text:
            assert "subroutine build_problem" in text, path
