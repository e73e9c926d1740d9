"""The workflows are read by the tool that runs their steps, which does what a runner does."""
from __future__ import annotations

import subprocess
import sys

import pytest
from project import ROOT

TOOL = ROOT / "tools" / "run_workflow.py"
SMALL = """\
on: push
jobs:
  small:
    runs-on: ubuntu-latest
    strategy:
      matrix:
        word: ["one", "two"]
    defaults:
      run:
        shell: bash
    steps:
      - uses: actions/checkout@v4
      - name: Make
        run: |
          test -f there && test -z "$(ls -A "$HOME")" && test -z "${SECRET:-}"
          mkdir made && echo ${{ matrix.word }} >made/word
      - name: Status of a pipe
        run: |
          STATEMENT
          echo reached >made/reached
      - uses: actions/upload-artifact@v4
        with:
          path: made/PATTERN
          if-no-files-found: error
"""


def run(*words, **options):
    return subprocess.run([sys.executable, TOOL, *map(str, words)], capture_output=True, text=True,
                          check=False, **options)


@pytest.fixture
def repository(tmp_path):
    """A repository with one file, and a function that gives it a workflow."""
    folder = tmp_path / "repository"
    (folder / ".github" / "workflows").mkdir(parents=True)
    (folder / "there").write_text("")

    def git(*words):
        subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b.c", *words], cwd=folder,
                       check=True, capture_output=True)

    git("init", "-q")
    git("add", "there")
    git("commit", "-qm", "One file")

    def with_workflow(statement="true", pattern="word"):
        text = SMALL.replace("STATEMENT", statement).replace("PATTERN", pattern)
        (folder / ".github" / "workflows" / "small.yml").write_text(text)
        return folder

    return with_workflow


@pytest.mark.parametrize("name", ["tests.yml", "wheels.yml"])
def test_every_step_of_a_workflow_is_known(name):
    done = run(name, "--list")
    assert done.returncode == 0, done.stderr
    kinds = [line.split()[0] for line in done.stdout.splitlines()[1:]]
    assert kinds[0] == "clone" and "run" in kinds
    assert not [line for line in done.stdout.splitlines() if line.startswith("  left out")]


def test_steps_run_in_a_clean_clone(repository, monkeypatch):
    monkeypatch.setenv("SECRET", "of the caller")
    done = run("small.yml", "--source", repository(), "--matrix", "word=two")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "word two" in done.stdout and "made/word" in done.stdout


def test_a_step_that_fails_ends_the_job(repository):
    done = run("small.yml", "--source", repository("false | cat"))
    assert done.returncode == 1
    assert "status 1" in done.stdout and "upload" not in done.stdout


def test_a_file_that_is_missing_fails(repository):
    done = run("small.yml", "--source", repository(pattern="nothing-*"))
    assert done.returncode == 1


@pytest.mark.parametrize(("words", "said"), [
    (["none.yml"], "no such workflow"), (["tests.yml", "--job", "night"], "no job 'night'"),
    (["wheels.yml", "--matrix", "python=2.7"], "the matrix has python=")])
def test_what_is_not_there_is_said(words, said):
    done = run(*words)
    assert done.returncode == 3 and said in done.stderr
