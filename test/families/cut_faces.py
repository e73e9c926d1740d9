"""Random sectors whose cut faces are found in the mesh, and meshes where they must not be found."""
from __future__ import annotations

import contextlib
import io
import shutil
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT / "python" / "tests"), str(HERE.parent / "support")]

import numpy as np  # noqa: E402
from cases import read, run  # noqa: E402
from stored_wheel import StoredWheel  # noqa: E402

from fretwear.cli import main  # noqa: E402

TITLE = "Cut faces of a sector"
TEXT = """
Wheels of 3 to 7 sectors of quadratic tetrahedra, cut faces bent and tilted, about each axis in
either direction, nodes numbered at random; as files that CalculiX stores. The faces are found by
turning the mesh, named by sets of corners, and by sets exchanged. Judge: the whole wheel, assembled
without symmetry; frequencies below the lowest of the sixth ones of each nodal diameter, to 1e-9.
Then what has to be refused: another number of sectors, another axis, a node of one face moved along
it, with the faces found and named. And what has to be remarked: sets that leave out a node of both
faces.
"""
COUNT = 60
SMALL = range(2)
COLUMNS = {"tied": "wheels tied", "wrong": "different from the whole", "refused": "refused",
           "taken": "wrong ones taken", "said": "left out, remarked", "unsaid": "left out, unsaid"}
ZERO = ("wrong", "taken", "unsaid")
ALSO = [ROOT / "python" / "tests" / "stored_wheel.py",
        *(ROOT / "python" / "fretwear" / "importer" / name for name in (
            "calculix.py", "cuts.py", "deck.py", "sectors.py"))]
SAME = 1e-9
NAMED = ("--left", "LEFT", "--right", "RIGHT")


def imported(*words):
    """Status and all that is said."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = main(["import", *map(str, words)])
    return status, said.getvalue()


def is_whole(wheel, folder, model, program):
    """Whether the frequencies of the nodal diameters are those of the wheel."""
    run(folder, {"case": {"analysis": "modes"}, "model": {"source": "hdf5", "file": model.name},
                 "cyclic": {"n_modes": 6}}, name="modes", program=program)
    rows = read(folder / "modes.h5")["modes/open"]
    found = np.sort(np.concatenate([np.tile(row, 1 if 2 * k % wheel.n_sectors == 0 else 2)
                                    for k, row in enumerate(rows)]))
    whole, below = wheel.whole(), min(row[-1] for row in rows) * (1.0 - SAME)
    found, whole = found[found < below], whole[whole < below]
    return len(found) == len(whole) and np.abs(found / whole - 1.0).max() < SAME


def trial(seed, program, folder):
    rng = np.random.default_rng(seed)
    wheel = StoredWheel(folder, seed=seed)
    counts = dict.fromkeys(COLUMNS, 0) | {"notes": []}
    deck, sign = folder / "sector.inp", str(rng.choice(["", "-"]))
    right = ["--sectors", wheel.n_sectors, f"--axis={sign}{wheel.axis}"]
    for faces in ((), NAMED, ("--left", "RIGHT", "--right", "LEFT")):
        status, said = imported(deck, "-q", *right, *faces, "-o", folder / "sector.h5")
        is_right = status == 0 and is_whole(wheel, folder, folder / "sector.h5", program)
        counts["tied" if is_right else "wrong"] += 1
        if not is_right:
            counts["notes"].append(f"{faces}: {said}")

    def refuse(what, *words):
        status, _ = imported(*words, "--check")
        counts["refused" if status == 3 else "taken"] += 1
        if status != 3:
            counts["notes"].append(f"{what} taken")

    other = wheel.n_sectors + int(rng.choice([-1, 1, 2]))
    across = next(axis for axis in rng.permutation([*"xyz"]) if axis != wheel.axis)
    for faces in ((), NAMED):
        refuse("number", deck, "--sectors", other, right[2], *faces)
        refuse("axis", deck, *right[:2], f"--axis={across}", *faces)
    moved(wheel, folder, rng)
    for faces in ((), NAMED):
        refuse("moved node", folder / "moved.inp", *right, *faces)
    left_out(wheel, folder, rng)
    status, said = imported(folder / "fewer.inp", *right, *NAMED, "--check")
    told = status == 3 or "they are not tied" in said
    counts["said" if told else "unsaid"] += 1
    return counts


def corners_of_faces(wheel):
    """Corners of the left face away from the bore, with their partners."""
    corner = set(wheel.corners.ravel().tolist())
    return [(k, q) for k, q in zip(wheel.left, wheel.right)
            if k in corner and k not in wheel.bore]


def beside(folder, name, text):
    """A deck of another text with the same matrices."""
    (folder / f"{name}.inp").write_text(text)
    for suffix in (".sti", ".mas", ".dof"):
        shutil.copy(folder / f"sector{suffix}", folder / f"{name}{suffix}")


def moved(wheel, folder, rng):
    """A corner of one face goes a part of the way to another one of it."""
    pairs = corners_of_faces(wheel)
    first, second = rng.permutation(len(pairs))[:2]
    k, other = pairs[first][0], pairs[second][0]
    place = wheel.points[k] + rng.uniform(0.03, 0.3) * (wheel.points[other] - wheel.points[k])
    lines = (folder / "sector.inp").read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith(f"{wheel.nodes[k]}, "))
    lines[at] = f"{wheel.nodes[k]}, " + ", ".join(f"{x:.14g}" for x in place)
    beside(folder, "moved", "\n".join(lines) + "\n")


def left_out(wheel, folder, rng):
    """Sets without a corner and its partner."""
    pairs = corners_of_faces(wheel)
    k, partner = pairs[int(rng.integers(len(pairs)))]
    parts = (folder / "sector.inp").read_text().split("*NSET, NSET=")
    for i, part in enumerate(parts):
        node = {"LEFT": k, "RIGHT": partner}.get(part.split("\n")[0])
        if node is not None:
            parts[i] = part.replace(f"\n{wheel.nodes[node]},\n", "\n")
    beside(folder, "fewer", "*NSET, NSET=".join(parts))
