"""Random meshes as programs and people leave them: another unit, far from the origin, warped faces,
a surface of one face, gaps in the numbers; and files that are damaged, which end in words.

The judge of areas is the mesh before it is written: two boxes that touch on a rectangle.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from deck_writers import faces, write_archive, write_gmsh
from test_surfaces import turned
from touching_blocks import Block, Pile

from fretwear.errors import FretwearError
from fretwear.importer import read_mesh_file
from fretwear.importer.contact import read_named
from fretwear.surfaces import contact_pairs

KINDS = ["C3D4", "C3D8", "C3D10", "C3D20"]
#: Digits of coordinates in the files.
DIGITS = {".inp": 1e-16, ".cdb": 1e-13, ".msh": 1e-16}
#: Areas of a hundred faces by coordinates that are known to the digits of the file.
MARGIN = 1e3


def written(folder: Path, made: Pile, suffix: str, seed: int) -> Path:
    path = folder / f"mesh{suffix}"
    if suffix == ".inp":
        made.write(folder, np.zeros(0, dtype=int), np.zeros(3 * len(made.points)), [
            *made.node_set("TOP", made.nodes(0, 2, 1.0)),
            *made.node_set("BOTTOM", made.nodes(1, 2, 1.0))])
        return folder / "blocks.inp"
    if suffix == ".cdb":
        write_archive(path, made, by_block=bool(seed % 2))
    else:
        write_gmsh(path, made, "2.2" if seed % 2 else "4.1")
    return path


@pytest.mark.parametrize("seed", range(12))
def test_right_wherever_the_mesh_is(tmp_path: Path, seed: int) -> None:
    """Areas and gaps in any unit, turned, up to a million away from the origin, with one face."""
    random = np.random.default_rng([61, seed])
    n = [(1, 1, 1) if seed % 4 == k else tuple(random.integers(1, 4, 3)) for k in (1, 2)]
    made = Pile([Block(str(random.choice(KINDS)), n[k], (0.0, 0.0, k), (3.0, 2.0, k + 1.0), seed)
                 for k in (0, 1)])
    scale = float(random.choice([1e-3, 1.0, 25.4]))
    away = scale * float(random.choice([0.0, 1e3, 1e6])) * random.normal(size=3)
    made.points[:] = scale * made.points @ turned(random).T + away
    suffix = list(DIGITS)[seed % 3]
    named = read_named(written(tmp_path, made, suffix, seed))
    pairs = contact_pairs(named.surface("TOP"), named.surface("BOTTOM"))
    near = MARGIN * DIGITS[suffix] * max(1.0, np.abs(made.points).max() / scale)
    assert abs(pairs.area.sum() / (6.0 * scale**2) - 1.0) <= near
    assert np.abs(pairs.gap).max() <= near * scale
    assert np.abs(pairs.matrix.sum(axis=1)).max() <= 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_warped_faces(tmp_path: Path, seed: int) -> None:
    """A saddle of bilinear quadrilaterals that two meshes share: gaps of the order of the square of
    an edge, and the area between that of the plane and that of the saddle."""
    random = np.random.default_rng([62, seed])
    made = Pile([Block("C3D8", (4, 4, 1), (0.0, 0.0, k), (3.0, 2.0, k + 1.0), seed + k)
                 for k in (0, 1)])
    warp = float(random.uniform(0.02, 0.08))
    made.points[:, 2] += warp * made.points[:, 0] * made.points[:, 1]
    named = read_named(written(tmp_path, made, list(DIGITS)[seed % 3], seed))
    pairs = contact_pairs(named.surface("TOP"), named.surface("BOTTOM"))
    x, y = np.meshgrid(np.linspace(0.0, 3.0, 200), np.linspace(0.0, 2.0, 200))
    saddle = 6.0 * float(np.sqrt(1.0 + warp**2 * (x**2 + y**2)).mean())
    # Facets are planes through the middles of the edges: the error is of the order of warp^2.
    assert abs(pairs.area.sum() - saddle) <= 2.0 * (saddle - 6.0)
    assert np.abs(pairs.gap).max() <= warp
    motions = np.tile(np.eye(3), (len(made.points), 1))
    assert np.abs(pairs.matrix @ motions).max() <= 1e-11


@pytest.mark.parametrize(("suffix", "form"), [(".inp", 0), (".cdb", 0), (".cdb", 1), (".msh", 0),
                                              (".msh", 1)])
def test_damaged_files_end_in_words(tmp_path: Path, suffix: str, form: int) -> None:
    """Lines lost, twice, cut short or with a letter for a digit: the right area, another one of the
    faces that are left, or an error of this package; nothing else."""
    made = Pile([Block("C3D8", (2, 2, 1), (0.0, 0.0, k), (3.0, 2.0, k + 1.0), 1) for k in (0, 1)])
    path = written(tmp_path, made, suffix, form)
    lines = path.read_text().splitlines()
    assert len(faces(made, 0, 1.0)) == 4
    refused = 0
    for seed in range(60):
        random = np.random.default_rng([63, seed])
        k, way = int(random.integers(len(lines))), seed % 5
        changed = list(lines)
        if way == 0:
            del changed[k]
        elif way == 1:
            changed.insert(k, lines[k])
        elif way == 2:
            changed[k] = lines[k][:len(lines[k]) // 2]
        elif way == 3:
            at = int(random.integers(max(len(lines[k]), 1)))
            changed[k] = lines[k][:at] + "x" + lines[k][at + 1:]
        else:
            del changed[k:]
        path.write_text("\n".join(changed) + "\n")
        for read in (read_mesh_file, lambda file: contact_pairs(
                read_named(file).surface("TOP"), read_named(file).surface("BOTTOM"))):
            try:
                found = read(path)  # type: ignore[operator]
            except FretwearError:
                refused += 1
            else:
                assert not hasattr(found, "area") or 0.0 < found.area.sum() < 30.0
    assert refused > 20
