"""The commit of the sources that a program is built of, for documents that count what it did."""
from __future__ import annotations

import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("src", "app", "CMakeLists.txt", "cmake")


def git(*arguments):
    done = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True,
                          check=False)
    return done.stdout.strip() if done.returncode == 0 else ""


def revision():
    """Short hash of the last commit that changed a source; 'with changes' where files differ."""
    commit = git("log", "-1", "--format=%h", "--", *SOURCES)
    if not commit:
        return "not known"
    return commit + (" with changes" if git("status", "--porcelain", "--", *SOURCES) else "")
