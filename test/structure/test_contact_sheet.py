"""The sheet shows every picture of the documents."""
import subprocess
import sys

from PIL import Image
from project import ROOT

TOOL = ROOT / "tools" / "contact_sheet.py"


def test_every_picture_is_on_the_sheet(tmp_path):
    for k, name in enumerate(("a.png", "b.png", "c.gif")):
        Image.new("RGB", (40, 30), [(255, 0, 0), (0, 255, 0), (0, 0, 255)][k]).save(tmp_path / name)
    target = tmp_path / "sheet" / "all.png"
    done = subprocess.run([sys.executable, TOOL, tmp_path, "-o", target, "--columns", "2"],
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0 and done.stdout.startswith("3 pictures"), done.stderr
    with Image.open(target) as image:
        colours = {colour for _, colour in image.convert("RGB").getcolors(1 << 24)}
    assert {(255, 0, 0), (0, 255, 0), (0, 0, 255)} <= colours


def test_an_empty_folder_is_said(tmp_path):
    done = subprocess.run([sys.executable, TOOL, tmp_path], capture_output=True, text=True,
                          check=False)
    assert done.returncode == 3 and "no picture" in done.stderr
