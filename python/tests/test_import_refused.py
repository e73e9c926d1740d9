"""Surfaces that are refused by `fretwear import`, with a picture; --check beside -o; rows of pairs
in the frames of a sector."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from deck_writers import faces
from stored_wheel import StoredWheel
from test_import_calculix import run_import
from test_import_contact import pile, write

from fretwear.importer import Dofs, FullModel, Interfaces
from fretwear.importer.cuts import rotation
from fretwear.importer.sectors import in_sector_frames
from fretwear.importer.tables import Pairs


def shells(folder: Path) -> Path:
    """Shells at the sides that touch, one of them behind the other of the upper block too."""
    made = pile(("C3D8", "C3D8"))
    write(folder, made)
    middle = next(z for z in np.unique(made.box[made.first[1]:, 2]) if 1.0 < z < 2.0)
    text = "*NODE\n" + "".join(f"{node}, {x:.17g}, {y:.17g}, {z:.17g}\n" for node, (x, y, z) in
                               zip(made.numbers, made.points))
    number = 1
    for name, block, height in (("LOW", 0, 1.0), ("HIGH", 1, 1.0), ("BEHIND", 1, middle)):
        text += f"*ELEMENT, TYPE=S4, ELSET={name}\n"
        for face in {tuple(face) for face in faces(made, block, height)}:
            text += f"{number}, {', '.join(map(str, face))}\n"
            number += 1
    for name in ("LOW", "HIGH"):
        for side in ("SPOS", "SNEG"):
            text += f"*SURFACE, NAME={name}_{side}\n{name}, {side}\n"
    text += "*SURFACE, NAME=TWO_POS\nHIGH, SPOS\nBEHIND, SPOS\n"
    text += "*SURFACE, NAME=TWO_NEG\nHIGH, SNEG\nBEHIND, SNEG\n"
    path = folder / "shells.inp"
    path.write_text(text)
    return path


def test_refused_with_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = shells(tmp_path)
    picture = tmp_path / "x_contact_refused.png"

    def said(one: str, two: str) -> str:
        picture.unlink(missing_ok=True)
        capsys.readouterr()
        status = run_import(tmp_path / "k.mtx", tmp_path / "m.mtx", "-q", "--labels",
                            tmp_path / "labels.txt", "--contact-mesh", mesh, "--contact", one, two,
                            "-o", tmp_path / "x.h5")
        text = capsys.readouterr().err
        assert picture.is_file() == (status == 3)
        assert status == 0 or (status == 3 and str(picture) in text)
        return text

    found = {(one, two): "inside out" in said(f"LOW_{one}", f"HIGH_{two}")
             for one in ("SPOS", "SNEG") for two in ("SPOS", "SNEG")}
    # Two ways of four face each other.
    assert sum(found.values()) == 2
    assert found["SPOS", "SPOS"] == found["SNEG", "SNEG"] != found["SPOS", "SNEG"]
    twice = [said("LOW_SPOS", name) for name in ("TWO_POS", "TWO_NEG")]
    assert sum("face" in text and "twice" in text for text in twice) == 1


def test_check_beside_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wheel = StoredWheel(tmp_path)
    deck = tmp_path / "sector.inp"
    target = tmp_path / "sector.h5"
    words = [deck, "-q", "--sectors", wheel.n_sectors, "-o", target]
    assert run_import(*words, "--check") == 0
    assert "sector.h5 is not written beside --check" in capsys.readouterr().out
    assert not target.exists()
    assert run_import(*words, "--check", tmp_path / "wave.png") == 0
    assert target.is_file() and (tmp_path / "wave.png").is_file()
    assert run_import(*words[:-1], tmp_path / "none" / "x.h5", "--check") == 5


def test_rows_of_pairs_follow_the_frames_of_the_sector() -> None:
    """Relative displacements of a motion are the same, whatever axes the nodes have."""
    random = np.random.default_rng(3)
    labels = [(node, c) for node in (1, 2, 3) for c in (1, 2, 3)]
    rows = sp.csr_array(random.normal(size=(3, 9)))
    pairs = Pairs(np.array([[1, 2, 3]], dtype=np.int32), np.zeros((1, 3), dtype=np.int32), rows,
                  None, None, None, None, None, ["pair"])
    turn = rotation("z", 2.0 * np.pi / 7)
    one = sp.csr_array(np.diag(random.uniform(1.0, 2.0, 9)))
    model = FullModel({"mass": one, "stiffness": one}, Dofs(9, labels), pairs=pairs)
    left, right = np.array([1, 2, 3], dtype=np.int32), np.array([7, 8, 9], dtype=np.int32)
    found = in_sector_frames(model, Interfaces(7, left, right, [1], [3], 0.0, turn))
    motion = random.normal(size=9)
    own = motion.copy()
    own[6:] = turn.T @ motion[6:]
    assert found.pairs is not None and found.pairs.rows is not None
    assert found.pairs.rows @ own == pytest.approx(rows @ motion, rel=1e-12)
    assert own @ found.matrices["mass"] @ own == pytest.approx(motion @ one @ motion, rel=1e-12)
