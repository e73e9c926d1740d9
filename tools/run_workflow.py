#!/usr/bin/env python3
"""Run the steps of a workflow of .github/workflows in a clean clone, one after the other.

    run_workflow.py FILE [--job NAME] [--matrix KEY=VALUE] [--root DIRECTORY] [--skip TEXT]
                    [--only TEXT] [--list]

The last commit is cloned into a new folder, where the home is empty and the environment holds
nothing but a path. `--root` is a bare system (debootstrap bookworm DIRECTORY), in which the steps
run as root and may install what they like. `--only` and `--skip` take parts of names of steps.

Steps that `use` an action: the checkout is the clone, files to upload are looked for, a cache is
empty. What else an action does is said to be left out. Ends with the status of the first step that
fails, after which none runs.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
#: What a runner gives a step to find programs by.
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
#: Folder of the clone inside a bare system.
INSIDE = "checkout"
#: How a step runs by its word `shell`. Without the word a container has no more than sh.
SHELLS = {"bash": ("bash", "--noprofile", "--norc", "-eo", "pipefail"), "sh": ("sh", "-e")}
#: What a bare system takes from this one to reach a network.
NETWORK = ("/etc/resolv.conf", "/etc/ssl/certs/ca-certificates.crt")


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="Run the steps of a workflow in a clean clone.")
    parser.add_argument("file", help="workflow, of .github/workflows where it is a bare name")
    parser.add_argument("--job", help="its only job without it")
    parser.add_argument("--matrix", action="append", default=[], metavar="KEY=VALUE",
                        help="value of a matrix, the first without it")
    parser.add_argument("--root", type=Path, help="bare system to run in")
    parser.add_argument("--only", action="append", default=[], metavar="TEXT")
    parser.add_argument("--skip", action="append", default=[], metavar="TEXT")
    parser.add_argument("--list", action="store_true", help="say what would run")
    parser.add_argument("--source", type=Path, default=ROOT, help="repository to clone")
    options = parser.parse_args()
    try:
        job = read_job(options.file, options.job, options.source)
        values = matrix_of(job, options.matrix)
    except ValueError as error:
        print(f"run_workflow: {error}", file=sys.stderr)
        return 3
    image = filled(container_of(job), values)
    where = f"in {options.root}" if options.root else "on this system"
    print(f"job for {image}, {where}" + "".join(f", {k} {v}" for k, v in values.items()))
    if options.list:
        for name, step in named_steps(job, values):
            print(f"  {'skip' if is_left_out(name, options) else kind_of(step):8} {name}")
        return 0
    place = options.root or Path(tempfile.mkdtemp(prefix="workflow-"))
    try:
        return run_steps(job, values, place, options)
    finally:
        if not options.root:
            shutil.rmtree(place, ignore_errors=True)


def read_job(file: str, name: str | None, source: Path) -> dict[str, Any]:
    """A job of a workflow, with the words of the workflow that hold for it."""
    path = Path(file) if "/" in file else source / ".github" / "workflows" / file
    if not path.exists():
        raise ValueError(f"{path}: no such workflow")
    workflow = yaml.safe_load(path.read_text(encoding="utf-8"))
    jobs = workflow["jobs"]
    if name is None and len(jobs) > 1:
        raise ValueError(f"{path}: choose a job by --job: {', '.join(jobs)}")
    name = name or next(iter(jobs))
    if name not in jobs:
        raise ValueError(f"{path}: no job {name!r}; there are {', '.join(jobs)}")
    job: dict[str, Any] = jobs[name]
    job["env"] = {**(workflow.get("env") or {}), **(job.get("env") or {})}
    return job


def container_of(job: dict[str, Any]) -> str:
    """The image of a job."""
    container = job.get("container", job.get("runs-on", ""))
    return str(container["image"] if isinstance(container, dict) else container)


def matrix_of(job: dict[str, Any], chosen: list[str]) -> dict[str, str]:
    """A value of each key of the matrix."""
    matrix = (job.get("strategy") or {}).get("matrix") or {}
    values = {key: str(given[0]) for key, given in matrix.items() if isinstance(given, list)}
    for word in chosen:
        key, _, value = word.partition("=")
        if value not in map(str, matrix.get(key, [])):
            raise ValueError(f"--matrix {word}: the matrix has "
                             + (", ".join(f"{k}={v}" for k, v in matrix.items()) or "nothing"))
        values[key] = value
    return values


def filled(text: str, values: dict[str, str]) -> str:
    """A text with its expressions of the matrix put in; others stay as they are."""
    return re.sub(r"\$\{\{\s*matrix\.([\w-]+)\s*\}\}",
                  lambda found: values.get(found[1], found[0]), text)


def named_steps(job: dict[str, Any], values: dict[str, str]) -> list[tuple[str, dict[str, Any]]]:
    """Every step with what it is called by."""
    return [(filled(str(step.get("name") or step.get("uses") or step["run"].split("\n")[0]),
                    values), step) for step in job["steps"]]


def kind_of(step: dict[str, Any]) -> str:
    """What becomes of a step."""
    if "run" in step:
        return "run"
    action = step["uses"].partition("@")[0]
    return {"actions/checkout": "clone", "actions/upload-artifact": "look",
            "actions/cache": "empty"}.get(action, "left out")


def is_left_out(name: str, options: argparse.Namespace) -> bool:
    """Whether the command line leaves a step out."""
    return (any(text in name for text in options.skip)
            or (bool(options.only) and not any(text in name for text in options.only)))


def run_steps(job: dict[str, Any], values: dict[str, str], place: Path,
              options: argparse.Namespace) -> int:
    """One after the other, until one fails."""
    checkout = place / INSIDE
    shutil.rmtree(checkout, ignore_errors=True)
    subprocess.run(["git", "clone", "--quiet", "--no-local", str(options.source), str(checkout)],
                   check=True)
    home = place / "home"
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir()
    for name, step in named_steps(job, values):
        kind = kind_of(step)
        # What others made is looked for wherever one of them ran.
        if kind == "run" and is_left_out(name, options):
            print(f"== {name}: skipped", flush=True)
            continue
        started = time.monotonic()
        print(f"== {name}: {kind}", flush=True)
        status = 0
        if kind == "run":
            status = run_step(job, step, values, place, options.root)
        elif kind == "look" and not (options.only or options.skip):
            status = look_for(step["with"], checkout)
        print(f"== {name}: {'done' if status == 0 else f'status {status}'} after "
              f"{time.monotonic() - started:.0f} s", flush=True)
        if status:
            return status
    return 0


def run_step(job: dict[str, Any], step: dict[str, Any], values: dict[str, str], place: Path,
             root: Path | None) -> int:
    """The status of a step of commands."""
    text = filled(step["run"], values)
    if "${{" in text:
        print(f"an expression that only the service knows: {text}", file=sys.stderr)
        return 3
    default = ((job.get("defaults") or {}).get("run") or {}).get("shell")
    shell = SHELLS[step.get("shell") or default or ("sh" if "container" in job else "bash")]
    base = Path("/") if root else place
    environment = {"HOME": str(base / "home"), "PATH": PATH, "CI": "true", "LANG": "C.UTF-8",
                   "GITHUB_WORKSPACE": str(base / INSIDE)}
    # Of this system only where its Python is, for steps that call it outside a bare system.
    if not root:
        environment["PATH"] = f"{Path(sys.executable).parent}:{PATH}"
    limits = {key: os.environ[key] for key in ("CMAKE_BUILD_PARALLEL_LEVEL", "OMP_NUM_THREADS")
              if key in os.environ}
    given = {**(job.get("env") or {}), **(step.get("env") or {})}
    words = [f"{key}={filled(str(value), values)}"
             for key, value in {**environment, **limits, **given}.items()]
    if not root:
        return subprocess.run(["env", "-i", *words, *shell, "-c", text],
                              cwd=place / INSIDE).returncode
    for name in NETWORK:
        if Path(name).exists():
            (root / name[1:]).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(name, root / name[1:])
    # The mounts end with the step: they belong to it alone.
    inside = ('mount -t proc proc "$0/proc" && mount --rbind /dev "$0/dev" && exec chroot "$0" '
              'env -i "${@:2}" sh -c \'cd "$1" && shift && exec "$@"\' sh "$1"')
    script = f'{inside} {" ".join(shell)} -c "$STEP"'
    return subprocess.run(["unshare", "--mount", "bash", "-c", script, str(root),
                           f"/{INSIDE}", *words], env={**os.environ, "STEP": text}).returncode


def look_for(wanted: dict[str, Any], checkout: Path) -> int:
    """Whether there is what would be uploaded."""
    found = [path for pattern in wanted["path"].split("\n") if pattern.strip()
             for path in checkout.glob(pattern.strip())]
    for path in found:
        print(f"   {path.relative_to(checkout)}, {path.stat().st_size / 1e6:.1f} MB")
    return 1 if not found and wanted.get("if-no-files-found") == "error" else 0


if __name__ == "__main__":
    sys.exit(main())
