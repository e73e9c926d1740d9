"""Every notebook of docs/notebooks runs from top to bottom, and is kept with what it shows."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))

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
def test_it_is_kept_with_what_it_shows(path: Path) -> None:
    """As `make notebooks` leaves it: small, every cell run in its order, no error, no folder of
    the machine that ran it."""
    text = path.read_text()
    code = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    shown = [output for cell in code for output in cell["outputs"]]
    assert any("image/png" in output.get("data", {}) for output in shown)
    assert all(output["output_type"] != "error" for output in shown)
    assert len(text) < 600_000 and str(ROOT) not in text
    # Names that every run draws anew would make each run a change.
    assert not re.search(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}", text)
    assert not any("id" in cell for cell in json.loads(text)["cells"])


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
