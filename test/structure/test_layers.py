"""The layers of CONTRIBUTING: which folders of the sources use which."""
import re

import pytest
from project import ROOT

#: Folders that each may use beside itself and the ones before it; solve and model do not meet.
LAYERS = ("base", "math", "solve", "model", "force", "balance", "time", "wear", "case", "io",
          "driver", "capi")
APART = {("model", "solve"), ("force", "solve"), ("wear", "time"), ("time", "wear")}


@pytest.fixture(scope="module", name="folders")
def read_sources():
    """{module: folder}, {folder: [(file, modules it uses)]}."""
    of, uses = {}, {}
    for path in sorted((ROOT / "src").rglob("*.[fF]90")):
        folder = path.relative_to(ROOT / "src").parts[0]
        text = path.read_text()
        for module in re.findall(r"^ *module (fw_\w+)", text, re.M):
            of[module] = folder
        used = re.findall(r"^ *use (fw_\w+)", text, re.M)
        uses.setdefault(folder, []).append((path.name, used))
    return of, uses


@pytest.mark.parametrize("folder", LAYERS)
def test_nothing_above_is_used(folders, folder):
    of, uses = folders
    allowed = {name for name in LAYERS[:LAYERS.index(folder) + 1] if (folder, name) not in APART}
    wrong = [(file, module) for file, used in uses[folder] for module in used
             if of.get(module, folder) not in allowed]
    assert not wrong


def test_every_folder_is_a_layer(folders):
    assert set(folders[1]) - {"fretwear.f90"} == set(LAYERS)
