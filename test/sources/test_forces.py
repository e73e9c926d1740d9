"""What the sources may name of the forces: the layers of CONTRIBUTING, counted."""

import re
from pathlib import Path

SRC = Path(__file__).resolve().parents[2] / "src"
EVENTS = SRC / "force" / "event"
#: Paths of an oscillator under friction, which share the roots of the events.
OSCILLATOR = SRC / "force" / "oscillator"
#: Paths of one displacement, of which turning points are such roots.
PATHS = SRC / "force" / "path"
#: The one module of the located events that the rest may name.
INTERFACE = "fw_event_contact"
#: The list of the laws: a word and a line of construction each.
LAWS = SRC / "force" / "laws.f90"


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
        if not {EVENTS, OSCILLATOR, PATHS} & set(path.parents) and uses(path) & behind
    }
    assert named == {}


def test_the_events_know_no_law_and_no_balance() -> None:
    allowed = {"fw_fourier", "fw_kinds", "fw_lapack", "fw_settling", "fw_threads",
               "fw_wave_sums"} | kernels()
    for path in EVENTS.glob("*.f90"):
        assert uses(path) - {INTERFACE} <= allowed, path.name


def law_words() -> list[str]:
    """The words of the laws."""
    (listed,) = re.findall(r":: law_words\(\*\) = &\s*\[(.*?)\]", LAWS.read_text(), re.DOTALL)
    return re.findall(r"'(\w+)'", listed)


def law_modules() -> set[str]:
    """Modules of laws that nobody outside of the laws needs: multipliers follow `fw_friction`, and
    checks ask which pairs have the constants of a normal law."""
    return uses(LAWS) - {"fw_contact_data", "fw_force_law", "fw_pair_law", "fw_friction",
                         "fw_normal_law", "fw_kinds"}


#: Outside of the laws a law is known by its facts and its prediction. A name of one, or a question
#: by its number, is a place more to touch for every new law.
QUESTIONS = re.compile(
    rf"\blaw_({'|'.join(law_words())})\b"
    r"|%law\s*(==|/=)"
    r"|law_words\(.*\)\s*(==|/=)|law_number\("
    rf"|use ({'|'.join(law_modules())}|fw_polynomial_law|fw_friction_events)\b"
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
    assert "fw_regularised" in law_modules()
    for module in law_modules():
        naming = [path.name for path in SRC.rglob("*.f90") if module in uses(path)]
        assert naming == [LAWS.name], module
    lines = [line for line in LAWS.read_text().splitlines() if "regularised" in line]
    # The word, its line of construction, and the `use` of its file.
    assert len(lines) == 3


def test_multipliers_and_integration_in_time_are_promised_for_coulomb_alone() -> None:
    # src/balance/stability_history.f90 and src/time march Coulomb's law whatever law the pairs
    # have, unless it acts at once: any other that promised these facts would get the numbers of
    # that one, without a word. The springs of polynomial_law.f90 have ways of their own.
    promising = {
        path.name for path in (SRC / "force").rglob("*.f90")
        if re.search(r"\b(has_multipliers|is_integrated)\s*=\s*\.true\.", path.read_text())
    }
    assert promising == {"friction.f90", "rigid_law.f90", "polynomial_law.f90", "regularised.f90"}
