"""Every notebook of docs/notebooks runs from top to bottom, and is kept without outputs."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "docs" / "notebooks").glob("*.ipynb"))

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")


def printed(notebook: nbformat.NotebookNode) -> str:
    """What its cells have printed."""
    return "".join(output.text for cell in notebook.cells if cell.cell_type == "code"
                   for output in cell.outputs if output.output_type == "stream")


def test_there_is_a_notebook() -> None:
    assert "blade_sector.ipynb" in [path.name for path in NOTEBOOKS]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_holds_no_outputs(path: Path) -> None:
    code = [cell for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code"]
    assert code
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


def test_the_notebook_of_the_sector_shows_what_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cell that fails ends the run with its traceback."""
    # What other tests ask of matplotlib is not for the kernel, which shows pictures in line.
    monkeypatch.delenv("MPLBACKEND", raising=False)
    path = next(path for path in NOTEBOOKS if path.stem == "blade_sector")
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3",
                            resources={"metadata": {"path": path.parent}}).execute()
    text = printed(notebook)
    # The case is that of example/blade_sector/frf.nml on every other of its frequencies.
    assert re.search(r"^0\.88\d\d mm at 1022\.\d Hz, \d of 16 pairs slip$", text, re.MULTILINE)
    taken = re.search(r"work of the force (\S+), friction (\S+) ", text)
    assert taken is not None
    work, friction = map(float, taken.groups())
    assert 0.0 < friction < work
    assert "steady state: not reached" in text
    pictures = [output for cell in notebook.cells if cell.cell_type == "code"
                for output in cell.outputs if "image/png" in output.get("data", {})]
    assert len(pictures) == 4
    assert any("wear_volume" in output.data["text/plain"] for output in notebook.cells[-1].outputs)
