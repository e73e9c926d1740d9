"""The tables of keys and the summary in the user guide against the reader and the program."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import typing
from pathlib import Path

import pytest
from project import PROGRAM, ROOT

from fretwear import settings

GUIDE = "".join((ROOT / "docs" / f"{name}.md").read_text()
                for name in ("user-guide", "keys", "files", "messages"))


def read_keys() -> set[str]:
    """Every group%key that the program declares, which is what its reader takes."""
    shown = subprocess.run([PROGRAM, "--keys=json"], check=True, capture_output=True, text=True)
    return {f"{group}%{key}" for group, content in json.loads(shown.stdout).items()
            for key in content["keys"]}


def test_no_key_is_read_that_is_not_listed() -> None:
    """Names in the sources stand in the call that declares the key."""
    declared = {key for path in (ROOT / "src").rglob("*.f90") for key in re.findall(
        r"\b(?:load_|slider_)?key\('(\w+)'", path.read_text())}
    assert declared == {name.split("%")[1] for name in read_keys()}


#: Letters of the texts of a key (src/base/key.f90), beyond which they are cut without a word.
ROOM = {"help": 160, "shape": 20, "absent": 60, "only": 100, "unit": 20}
#: Letters of the name of an extent (src/io/reader.f90).
EXTENT = 12


def test_no_text_of_a_key_is_cut() -> None:
    """What fills its room may have lost its end, or a blank there and what came behind it."""
    shown = subprocess.run([PROGRAM, "--keys=json"], check=True, capture_output=True, text=True)
    for group, content in json.loads(shown.stdout).items():
        for name, key in content["keys"].items():
            assert len(name) < 24, (group, name)
            for part, room in ROOM.items():
                assert len(key.get(part, "")) < room - 1, (group, name, part)
            assert all(len(word) <= EXTENT for word in key.get("shape", "").split()), (group, name)


def test_the_tables_and_the_settings_of_the_package_are_what_the_program_declares() -> None:
    """And what is compared is there: every group has its table and its class."""
    done = subprocess.run([sys.executable, ROOT / "tools" / "write_keys.py", "--check", PROGRAM],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    table = re.compile(r"<!-- keys of (\w+) -->\n(.*?)<!-- end of keys -->", re.DOTALL)
    tables = dict(table.findall(GUIDE))
    shown = {f"{group}%{key}" for group, rows in tables.items()
             for cell in re.findall(r"^\| (`\w+`(?:, `\w+`)*) \|", rows, re.MULTILINE)
             for key in re.findall(r"\w+", cell)}
    assert shown == read_keys()


def test_links_within_the_documents_lead_somewhere() -> None:
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")),
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
