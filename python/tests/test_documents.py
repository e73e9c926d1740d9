"""The code in the README and in docs/python.md runs as it stands there."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder from which the examples can be seen."""
    (tmp_path / "example").symlink_to(ROOT / "example")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    return tmp_path


#: Blocks of docs/python.md that stand for what a reader has, and one that needs PyVista.
SKETCHES = ("sectors = fw.Sectors(36", "grid = result.to_pyvista")


def blocks(path: Path) -> list[str]:
    """Indented blocks of a page that are Python: all that its parser takes."""
    found = re.findall(r"(?:^    .*\n|^\n(?=    ))+", path.read_text(), re.MULTILINE)
    unindented = [re.sub(r"^    ", "", block, flags=re.MULTILINE).strip() for block in found]
    return [block for block in unindented if is_python(block)]


def is_python(text: str) -> bool:
    try:
        ast.parse(text)
    except SyntaxError:
        return False
    return True


def test_the_ten_lines_of_the_readme_draw_a_response(here: Path) -> None:
    code = next(block for block in blocks(ROOT / "README.md") if "fw.frf" in block)
    assert len(code.splitlines()) <= 10
    scope: dict[str, Any] = {}
    exec(code, scope)
    assert (here / "tip.png").stat().st_size > 10_000
    result = scope["result"]
    # The numbers of the README's picture: half of the stuck peak, near 1022 Hz.
    assert result.converged.all()
    assert 1020.0 < result.frequency[result.peak("tip")] < 1025.0


@pytest.mark.usefixtures("here")
def test_the_page_on_python_runs_from_top_to_bottom(capsys: pytest.CaptureFixture[str]) -> None:
    """Every block in order, in one scope: none may spoil what a later one takes."""
    every = blocks(ROOT / "docs" / "python.md")
    code = [block for block in every if not block.startswith(SKETCHES)]
    assert len(code) == len(every) - len(SKETCHES) and len(code) >= 11
    scope: dict[str, Any] = {}
    for block in code:
        exec(block, scope)
    assert "&harmonics" in capsys.readouterr().out
    assert scope["u"].shape == scope["v"].shape == (1, 256)
