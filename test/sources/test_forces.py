"""What the sources may name of the forces: the layers of CONTRIBUTING, counted."""

import re
from pathlib import Path

SRC = Path(__file__).resolve().parents[2] / "src"
EVENTS = SRC / "force" / "event"
#: Paths of an oscillator under friction, which share the roots of the events.
OSCILLATOR = SRC / "force" / "oscillator"
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
        if not {EVENTS, OSCILLATOR} & set(path.parents) and uses(path) & behind
    }
    assert named == {}


def test_the_events_know_no_law_and_no_balance() -> None:
    allowed = {"fw_fourier", "fw_kinds", "fw_lapack", "fw_settling", "fw_threads"} | kernels()
    for path in EVENTS.glob("*.f90"):
        assert uses(path) - {INTERFACE} <= allowed, path.name


#: Outside of the laws a law is known by its facts and its prediction. A name of one, or a question
#: by its number, is a place more to touch for every new law.
QUESTIONS = re.compile(
    r"\blaw_(dlft|dlft_velocity|penalty|regularised)\b"
    r"|%law\s*(==|/=)"
    r"|law_words\(.*\)\s*(==|/=)|law_number\("
    r"|use fw_(regularised|polynomial_law|friction_events)\b"
    r"|%(rigid|velocity_level)\b")
#: The law of wear is another matter.
OTHERS = re.compile(r"wear%law")


def questions_by_kind(path: Path) -> list[str]:
    """Lines of code that ask which law it is."""
    return [
        line.strip() for line in path.read_text().splitlines()
        if not line.strip().startswith("!") and QUESTIONS.search(OTHERS.sub("", line))
    ]


def test_the_search_finds_questions(tmp_path) -> None:
    path = tmp_path / "old.f90"
    path.write_text("if (contact%law == law_penalty) return\nif (self%rigid) return\n"
                    "! self%rigid\nif (case%wear%law /= wear_energy) a = b\n")
    assert len(questions_by_kind(path)) == 2


def test_nothing_outside_of_the_laws_asks_for_a_law_by_kind() -> None:
    found = {
        str(path.relative_to(SRC)): questions_by_kind(path)
        for path in SRC.rglob("*.f90")
        if SRC / "force" not in path.parents and questions_by_kind(path)
    }
    assert found == {}


def test_a_law_is_one_file_one_word_and_one_line() -> None:
    naming = [
        path.name for path in SRC.rglob("*.f90")
        if re.search(r"regularised_friction|fw_regularised", path.read_text())
    ]
    assert sorted(naming) == ["laws.f90", "regularised.f90"]
    registry = (SRC / "force" / "laws.f90").read_text()
    lines = [line for line in registry.splitlines() if "regularised" in line]
    # The word, its line of construction, and the `use` of its file.
    assert len(lines) == 3
