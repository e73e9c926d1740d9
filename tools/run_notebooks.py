"""Run the notebooks of docs/notebooks and keep them with what they show.

    make notebooks
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[1]
#: Names that no two runs have in common.
RANDOM = re.compile(r"\b[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}\b")


def same_names(text: str) -> str:
    """Numbers for the random names in tables of xarray: the same run leaves the same file."""
    names: dict[str, str] = {}
    return RANDOM.sub(lambda found: names.setdefault(found[0], f"part-{len(names) + 1}"), text)


def main() -> None:
    """Run every notebook in its folder; a cell that fails ends the program."""
    os.environ.pop("MPLBACKEND", None)
    # Notebooks run in their folder.
    os.environ["PYTHONPATH"] = os.pathsep.join(
        os.path.abspath(path) for path in os.environ.get("PYTHONPATH", "").split(os.pathsep))
    for path in sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        NotebookClient(notebook, timeout=600, kernel_name="python3", record_timing=False,
                       resources={"metadata": {"path": path.parent}}).execute()
        for cell in notebook.cells:
            cell.pop("id", None)
        notebook.metadata = {"kernelspec": notebook.metadata.get("kernelspec", {}),
                             "language_info": {"name": "python"}}
        notebook.nbformat_minor = 4
        path.write_text(same_names(nbformat.writes(notebook)) + "\n")
        print(f"{path.relative_to(ROOT)}: {path.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
