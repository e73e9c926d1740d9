"""The tables of keys and the summary in docs/user-guide.md against the reader and the program."""

from __future__ import annotations

import json
import os
import re
import subprocess
import typing
from pathlib import Path

import pytest

from fretwear import settings

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("FW_RUN", str(ROOT / "build" / "release" / "fw_run"))
GUIDE = (ROOT / "docs" / "user-guide.md").read_text()

#: A case that leaves out whatever may be left out.
SMALLEST = """&case analysis = 'point' /
&model n_dof = 1 mass = 1.0 stiffness = 1.0 /
&sweep start = 2.0 /
"""
#: Keys whose default the guide tells in words, because it is none, depends on others, or is a path.
IN_WORDS = {"case%title", "case%analysis", "model%n_dof", "model%mass", "model%stiffness",
            "contact%n_pairs", "sweep%start", "sweep%n_points", "wear%n_cycles", "output%file"}


def read_keys() -> set[str]:
    """Every group%key that the program declares, which is what its reader takes."""
    shown = subprocess.run([PROGRAM, "--keys=json"], check=True, capture_output=True, text=True)
    return {f"{group}%{key}" for group, content in json.loads(shown.stdout).items()
            for key in content["keys"]}


def test_no_key_is_read_that_is_not_listed() -> None:
    """Names in the sources stand in the call that declares the key."""
    declared = {key for path in (ROOT / "src").rglob("*.f90") for key in re.findall(
        r"\b(?:load_)?key\('(\w+)'", path.read_text())}
    assert declared == {name.split("%")[1] for name in read_keys()}


def table_rows() -> dict[str, dict[str, str]]:
    """Every key of the guide with the cells of its row, by the headings of its table."""
    rows = {}
    for group, section in re.findall(r"^### &(\w+)\n(.*?)(?=^##)", GUIDE,
                                     re.DOTALL | re.MULTILINE):
        tables = [line.strip("|").split("|") for line in section.splitlines()
                  if line.startswith("|")]
        heading = [cell.strip() for cell in tables[0]]
        for row in tables[2:]:
            cells = [cell.strip() for cell in row]
            assert len(cells) == len(heading), row
            for number, key in enumerate(re.findall(r"`(\w+)`", cells[0])):
                values = dict(zip(heading, cells))
                # "`side_1`, `side_2` | required; 0": one default for each key, or one for all.
                defaults = values["default"].split("; ")
                values["default"] = defaults[min(number, len(defaults) - 1)]
                rows[f"{group}%{key}"] = values
    return rows


@pytest.fixture(scope="module")
def effective(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[str, str]]:
    """Value of every key of the smallest case, and what the program says that it accepts."""
    case = tmp_path_factory.mktemp("guide") / "smallest.nml"
    case.write_text(SMALLEST)
    shown = subprocess.run([PROGRAM, "--check", case], check=True, capture_output=True,
                           text=True).stdout
    found, group = {}, ""
    for line in shown.splitlines():
        if line.startswith("&"):
            group = line[1:].strip()
        elif match := re.match(r" +(\w+) = (\S+|'.*?') *(?:! (.*))?$", line):
            found[f"{group}%{match[1]}"] = (match[2], match[3] or "")
    return found


def test_the_guide_has_every_key_of_the_reader_and_no_other() -> None:
    keys = read_keys()
    assert len(keys) > 70
    assert set(table_rows()) == keys


def test_the_defaults_are_those_of_the_program(effective: dict[str, tuple[str, str]]) -> None:
    rows = table_rows()
    wrong = []
    for key, (value, _) in effective.items():
        if key in IN_WORDS:
            continue
        default = rows[key]["default"].strip("`").split(", else ")[-1]
        try:
            same = float(default) == float(value)
        except ValueError:
            same = default == value
        if not same:
            wrong.append(f"{key}: the program has {value}, the guide {default!r}")
    assert not wrong
    assert len(effective) > 50


def test_the_accepted_words_are_those_of_the_program(
        effective: dict[str, tuple[str, str]]) -> None:
    rows = table_rows()
    worded = {key: re.findall(r"'[^']*'", accepts) for key, (_, accepts) in effective.items()
              if accepts.startswith("'")}
    assert len(worded) > 12
    for key, words in worded.items():
        assert sorted(re.findall(r"`('[^']*')`", rows[key]["accepts"])) == sorted(words), key


def test_every_key_says_what_it_means() -> None:
    rows = table_rows()
    assert [key for key, cells in rows.items() if len(cells["meaning and advice"]) < 10] == []
    assert [key for key, cells in rows.items() if not cells["default"]] == []
    assert [key for key, cells in rows.items() if not cells["accepts"]] == []


def test_units_stand_where_the_settings_of_the_package_have_them() -> None:
    rows = table_rows()
    source = (ROOT / "python" / "fretwear" / "settings.py").read_text()
    keys = re.findall(r"^    (\w+): .*# \[.*\]$", source, re.MULTILINE)
    assert len(keys) > 8
    for key in keys:
        found = [cells for name, cells in rows.items() if name.endswith("%" + key)]
        assert found, key
        assert all(re.match(r"\[.+\]$", cells.get("unit", "")) for cells in found), key


def test_links_within_the_documents_lead_somewhere() -> None:
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")),
             *sorted((ROOT / "example").glob("*/README.md"))]
    broken = []
    for page in pages:
        text = page.read_text()
        for target in re.findall(r"\]\(([^)\s]+)\)", text):
            if re.match(r"[a-z]+:", target):
                continue
            name, _, anchor = target.partition("#")
            path = (page.parent / name).resolve() if name else page
            headed = path.suffix == ".md" and anchor
            if not path.exists() or (headed and anchor not in anchors(path)):
                broken.append(f"{page.name}: {target}")
    assert not broken


def anchors(page: Path) -> set[str]:
    """Anchors of the headings of a page, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_the_settings_of_the_package_are_the_keys_of_the_reader() -> None:
    groups = typing.get_type_hints(settings.Groups)
    keys = {f"{'model' if group == 'structure' else group}%{key}"
            for group, kind in groups.items() for key in kind.__annotations__}
    assert keys == read_keys()


def test_the_summary_is_that_of_the_example(tmp_path: Path) -> None:
    """Line by line but for the time; numbers to a twentieth, for what compilers differ by."""
    said = re.search(r"^    converged .*?(?=\n\n)", GUIDE, re.DOTALL | re.MULTILINE)
    assert said
    done = subprocess.run([PROGRAM, "-o", str(tmp_path / "frf.h5"),
                           str(ROOT / "example" / "blade_sector" / "frf.nml")],
                          capture_output=True, text=True, check=True)
    number = re.compile(r"\d+(?:\.\d+)?(?:E[+-]\d+)?")
    guide, program = said[0].splitlines(), done.stdout.splitlines()
    assert len(guide) == len(program)
    for expected, shown in zip(guide[:-1], program[:-1]):
        assert number.sub("#", expected.strip()) == number.sub("#", shown)
        assert list(map(float, number.findall(shown))) == pytest.approx(
            list(map(float, number.findall(expected))), rel=0.05)
