"""A cylinder pressed on a flat: meshes that do not match, imported, reduced and run, against Hertz.

Plane strain, by one layer of elements that is held across; half of it, by symmetry.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from touching_blocks import POISSON, YOUNG, Block, Pile

import fretwear as fw
from fretwear.cli import main

RADIUS, SIZE, THICK = 20.0, 5.0, 0.1
#: Half width of the contact, and what presses for it (Johnson 1985, line contact).
HALF = 0.4
E_STAR = YOUNG / (2.0 * (1.0 - POISSON**2))
LOAD = np.pi * HALF**2 * E_STAR / (4.0 * RADIUS)
LARGEST = 2.0 * LOAD / (np.pi * HALF)


def graded(fine: float, up_to: float) -> np.ndarray:
    """Lines from 0: even ones, then each distance 1.3 times the one before, up to SIZE."""
    lines = [0.0]
    while lines[-1] < SIZE:
        step = fine if lines[-1] < up_to else 1.3 * (lines[-1] - lines[-2])
        lines.append(lines[-1] + step)
    return np.array(lines) * SIZE / lines[-1]


def cylinder_on_flat(fine: float) -> Pile:
    """The flat has cells of another size than the cylinder."""
    depth = graded(fine, 2.0 * fine)
    flat = Block("C3D8", (1, 1, 1), (0.0, 0.0, -SIZE), (SIZE, THICK, 0.0), 1,
                 lines=(graded(1.17 * fine, 1.6 * HALF), np.array([0.0, THICK]), -depth[::-1]))

    def bent(x: np.ndarray) -> np.ndarray:
        moved = x.copy()
        moved[2] += 0.5 * x[0]**2 / RADIUS * (1.0 - x[2] / SIZE)
        return moved

    round_one = Block("C3D8", (1, 1, 1), (0.0, 0.0, 0.0), (SIZE, THICK, SIZE), 2,
                      lines=(graded(fine, 1.6 * HALF), np.array([0.0, THICK]), depth), move=bent)
    return Pile([flat, round_one])


def run(folder: Path, fine: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place across, pressure and area of every pair."""
    made = cylinder_on_flat(fine)
    y = np.concatenate([made.nodes(k, 1, value) for k in (0, 1) for value in (0.0, THICK)])
    held = np.unique(np.concatenate((3 * y + 1, *(3 * made.nodes(k, 0, 0.0) for k in (0, 1)),
                                     3 * made.nodes(0, 2, -SIZE) + 2)))
    top = made.blocks[1].top
    load = np.concatenate((np.zeros(3 * made.first[1]), 0.5 * LOAD * THICK * top / -top.sum()))
    made.write(folder, held, load, [*made.node_set("ROUND", made.nodes(1, 2, 0.0)),
                                    *made.node_set("FLAT", made.nodes(0, 2, 0.0))])
    # What vibrates: a thousandth of what presses.
    rows = (folder / "loads.csv").read_text().splitlines()
    (folder / "loads.csv").write_text("dof,static,cosine\n" + "".join(
        f"{row},{1e-3 * float(row.split(',')[1]):.17g}\n" for row in rows[1:]))
    assert main(["import", str(folder / "k.mtx"), str(folder / "m.mtx"), "--labels",
                 str(folder / "labels.txt"), "--loads", str(folder / "loads.csv"), "--mesh",
                 str(folder / "blocks.inp"), "-o", str(folder / "model.h5"), "--contact", "ROUND",
                 "FLAT", "--mu", "0.1", "--reduce", "5", "--reach", "1", "-q"]) == 0
    case = fw.Case(folder / "model.h5", case={"analysis": "point"}, contact={"law": "dlft"},
                   sweep={"start": 1.0}, harmonics={"n_harmonics": 1})
    result = fw.run(case, folder / "case.h5")
    assert result.converged.all()
    with h5py.File(folder / "model.h5") as file:
        area, place = file["contact/area"][()], file["contact/position"][()]
    force = -result["contact/force"][0, 0, :, 2]
    return place[:, 0], force / area, area


def test_line_contact(tmp_path: Path) -> None:
    fine = HALF / 12.0
    x, pressure, area = run(tmp_path, fine)
    # Normals of the cylinder lean by x/R, and friction bears some: squares of 0.02.
    assert (pressure * area).sum() == pytest.approx(0.5 * LOAD * THICK, rel=1e-3)
    inside = x < 0.8 * HALF
    wanted = LARGEST * np.sqrt(1.0 - (x[inside] / HALF)**2)
    assert np.abs(pressure[inside] - wanted).max() < 0.02 * LARGEST
    assert (pressure[x > HALF + 2.0 * fine] == 0.0).all()
