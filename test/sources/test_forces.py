"""What the sources may name of the forces: the layers of CONTRIBUTING, counted."""

import re
from pathlib import Path

SRC = Path(__file__).resolve().parents[2] / "src"
EVENTS = SRC / "force" / "event"
#: The one module of the located events that the rest may name.
INTERFACE = "fw_event_contact"


def uses(path: Path) -> set[str]:
    """The modules of this project that a source uses."""
    return set(re.findall(r"^\s*use (fw_\w+)", path.read_text(), re.MULTILINE))


def kernels() -> set[str]:
    """The modules of the located events behind their interface."""
    names = set()
    for path in EVENTS.glob("*.f90"):
        names |= set(re.findall(r"^module (fw_\w+)", path.read_text(), re.MULTILINE))
    assert INTERFACE in names
    return names - {INTERFACE}


def test_nothing_outside_names_a_kernel_of_the_events() -> None:
    behind = kernels()
    assert len(behind) > 10
    named = {
        str(path.relative_to(SRC)): sorted(uses(path) & behind)
        for path in SRC.rglob("*.f90")
        if EVENTS not in path.parents and uses(path) & behind
    }
    assert named == {}


def test_the_events_know_no_law_and_no_balance() -> None:
    allowed = {"fw_fourier", "fw_kinds", "fw_lapack", "fw_settling", "fw_threads"} | kernels()
    for path in EVENTS.glob("*.f90"):
        assert uses(path) - {INTERFACE} <= allowed, path.name
