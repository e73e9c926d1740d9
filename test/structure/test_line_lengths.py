"""The documents: prose without lines that need scrolling."""
import subprocess
import sys

from project import ROOT

TOOL = ROOT / "tools" / "wrap_documents.py"


def test_no_line_of_prose_needs_scrolling():
    done = subprocess.run([sys.executable, TOOL, "--check"], capture_output=True, text=True,
                          check=False)
    assert done.returncode == 0, done.stdout


def test_what_is_wrapped_stays_the_same_text(tmp_path):
    """Words stay in their order; code, tables and the items of a list stay apart."""
    text = "\n\n".join([
        "# " + "title " * 30, "* first " + "word " * 40 + "`a b c`\n* second", "like",
        "    " + "code " * 30, "| " + "cell " * 40 + "|", "prose " * 50 + "end\n"])
    path = tmp_path / "page.md"
    path.write_text(text)
    subprocess.run([sys.executable, TOOL, path], check=True)
    found = path.read_text()
    assert found.split() == text.split() and "`a b c`" in found
    lines = found.splitlines()
    assert [len(line) > 120 for line in lines].count(True) == 3
    assert sum(line.startswith("* ") for line in lines) == 2
    assert max(len(line) for line in lines if line.startswith(("  word", "prose"))) <= 120
