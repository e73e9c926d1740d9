"""The code in the README and in docs/python.md runs as it stands there."""

from __future__ import annotations

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


def blocks(path: Path) -> list[str]:
    """Indented blocks of a page that are Python."""
    found = re.findall(r"(?:^    .*\n|^\n(?=    ))+", path.read_text(), re.MULTILINE)
    unindented = [re.sub(r"^    ", "", block, flags=re.MULTILINE).strip() for block in found]
    return [block for block in unindented
            if re.match(r"import|from|model|case|worn", block) and "\n" in block]


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
    code = blocks(ROOT / "docs" / "python.md")
    assert len(code) == 7
    scope: dict[str, Any] = {}
    for block in code:
        exec(block, scope)
    assert "&harmonics" in capsys.readouterr().out
    assert scope["u"].shape == scope["v"].shape == (1, 256)
