"""Model files beside the table of their parts: what is written is known, what is known is read."""

from __future__ import annotations

import json
import re
import subprocess
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from project import EXAMPLE, PROGRAM

import fretwear as fw
from fretwear._native import Session, unread_parts
from fretwear.dampers import LAWS
from fretwear.model import _CONTACT, _IN_NAMELIST, _LOADS, _SPRING
from fretwear.sectors import _LOADS as OF_DIAMETERS
from fretwear.sectors import _MATRICES

PAIRS = fw.ContactPairs(
    [[1, 2, 3]], [[4, 5, 6]], mu=0.3, gap=0.0, area=1.0, normal_load=0.0, position=[[0, 0, 0]],
    gap_rotation=0.0, normal_load_rotation=0.0, slider_1=0.0, slider_2=0.0, residual=0.0,
    tangential_stiffness=1.0, normal_stiffness=1.0, slip_speed=1.0, patch=["a"], sector_2=[0],
    mu_dynamic=0.2, weakening_speed=1.0, weakening_exponent=1.0, mu_viscous=0.0, speed_1=0.0,
    speed_2=0.0, iwan_chi=-0.5, iwan_beta=0.0, bouc_wen_exponent=1.0, bouc_wen_beta=0.5,
    normal_coefficient=1.0, normal_exponent=1.5, reference_force=1.0,
    decay_length=1.0, table=[[0.0, 0.0], [1.0, 2.0]], normal_law="power",
    law="penalty", sliding="path", gap_harmonic={2: (0.1, 0.0)})
EYE = np.eye(6)


def whole(**more: Any) -> fw.Model:
    """A model with every part that one of its kind can have."""
    more = {"contact": PAIRS, **more}
    return fw.Model(EYE, 0.1 * EYE, 2.0 * EYE, springs=[fw.Spring(1, 2, 0.5)],
                    elements=[fw.Polynomial([[1, -2, 2]], [0.1], of="force", dof=[3]),
                              fw.Damper([1], [0.1], [2], [1.5], [2], [0])],
                    static=EYE[0], cosine=EYE[1], sine=EYE[2], static_rotation=EYE[3],
                    stiffness_rotation=EYE, coriolis=0.0 * EYE, structural_damping=0.01 * EYE,
                    circulatory=0.0 * EYE, stiffness_unsymmetric=EYE, damping_unsymmetric=EYE,
                    harmonic={2: (EYE[0], EYE[1])},
                    observe={"tip": 1}, title="all", unit_system="mm-tonne-s-N",
                    load_table=[[1.0, 0.5], [2.0, 1.5]], rows=EYE[:2], bodies=fw.Bodies(
                        ["wedge"], [0.1], [[4, 5, 0, 0, 0, 6]], [np.eye(6)], [1.0], [[0, 1, 0]],
                        [[0.0, 1.0, 0.0]], [0], [0]),
                    stress=fw.Stress(np.ones((2, 6, 6)), np.ones((2, 6)), np.ones((2, 6)),
                                     [1.0, 2.0], [2.0, 3.0], np.zeros((2, 3)), [0, 1]), **more)


def mistuned() -> fw.Model:
    rows = np.ones((2, 6))
    return whole(sectors=fw.Sectors(3, [1], [-4]), mistuning=fw.Mistuning(
        rows, [1.0, 2.0], [0.1, 0.0, -0.1], np.zeros((3, 2)), [0.1, 0.0, 0.0], [0.0, 0.0, 0.1],
        EYE, EYE, {0: {"K": EYE, "M": EYE, "C": EYE}, 2: {"K": EYE, "kind": "full"}},
        np.zeros((4, 3, 2))))


def nodal() -> fw.Model:
    one = fw.NodalDiameter(EYE, EYE, EYE, EYE, 0.0 * EYE, EYE[0], EYE[0], EYE[0], EYE[0],
                           observe={"tip": EYE[0]}, stress=np.zeros((2, 6, 6)))
    return fw.Model(None, None, None, contact=PAIRS,
                    sectors=fw.Sectors(3, diameters={0: one, 1: one}, n_physical=6,
                                       air=fw.Air(by_diameter={0: EYE})))


MODELS = {
    "plain": whole,
    "laws": lambda: whole(contact=replace(PAIRS, law=["penalty"],
                                            normal_law=["power"])),
    "sector": lambda: whole(sectors=fw.Sectors(3, [1], [-4], air=fw.Air({0: np.eye(2)},
                                                                        modes=EYE[:2]))),
    "mistuned": mistuned,
    "supports": lambda: whole(base_dof=[1, -2], reduction=(900.0, 1e-4)),
    "ground": lambda: whole(base_direction=EYE[0]),
    "speeds": lambda: fw.Model(EYE, None, None, speeds={0.0: (EYE, EYE[0]),
                                                       2.0: (2.0 * EYE, EYE[1])}),
    "nodal": nodal}


def table() -> dict[str, str]:
    """Names of all parts, with their shapes."""
    shown = subprocess.run([PROGRAM, "--parts"], check=True, capture_output=True, text=True)
    found = {}
    for line in shown.stdout.splitlines()[2:]:
        name, _, shape, *_ = line[2:].split(" | ")
        words = re.findall("`/?([^`]*)`", name)
        found["@".join(words)] = shape
    return found


def names_in(path: Path) -> set[str]:
    found: set[str] = set()
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.add(name) if isinstance(item, h5py.Dataset)
                        else None)
        for group in ("", "contact", "cyclic", "polynomial", "mistuning/sector/2"):
            if group in file or not group:
                found |= {f"{group}@{name}" for name in file[group or "/"].attrs}
    found = {re.sub(r"^mistuning/sector/\d+", "mistuning/sector/J", name) for name in found}
    found = {re.sub(r"^speed/\d+", "speed/I", name) for name in found}
    found = {re.sub(r"^nodal_diameter/\d+", "nodal_diameter/K", name) for name in found}
    return {re.sub(r"^(aero/\w+)/-?\d+", r"\1/M", name) for name in found}


@pytest.mark.parametrize("name", MODELS)
def test_a_saved_model_is_read_in_whole(name: str, tmp_path: Path) -> None:
    MODELS[name]().save(tmp_path / "model.h5")
    assert unread_parts(str(tmp_path / "model.h5")) == []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = fw.Model.from_hdf5(tmp_path / "model.h5")
    again.save(tmp_path / "again.h5")
    assert names_in(tmp_path / "again.h5") == names_in(tmp_path / "model.h5")


def test_the_package_knows_every_part(tmp_path: Path) -> None:
    parts = table()
    written: set[str] = set()
    for number, make in enumerate(MODELS.values()):
        make().save(tmp_path / f"{number}.h5")
        written |= names_in(tmp_path / f"{number}.h5")
    assert written <= set(parts)
    # By other programs: dof numbers for rows, the other sign, what generators and imports say.
    others = {"observe/dof", "cyclic@phase", "@parameters", "@disk_parameters"}
    assert {name for name in parts if not name.startswith("mesh/")} - written == others
    given = {f"contact/{name}" for name in _IN_NAMELIST} | {*_CONTACT, *_LOADS}
    given |= {f"spring/{name}" for name in _SPRING}
    given |= {f"nodal_diameter/K/{name}" for name in {**_MATRICES, **OF_DIAMETERS}.values()}
    assert given <= set(parts)


@pytest.mark.parametrize("path", sorted(EXAMPLE.glob("*/*.h5")), ids=lambda path: path.stem)
def test_model_files_of_the_examples_hold_parts_only(path: Path) -> None:
    with h5py.File(path) as file:
        if file.attrs["format"] != b"fretwear-model":
            pytest.skip("no model file")
    assert unread_parts(str(path)) == []


def test_strangers_are_told(tmp_path: Path) -> None:
    path = tmp_path / "model.h5"
    whole().save(path)
    with h5py.File(path, "r+") as file:
        file["notes"] = 1.0
    with pytest.warns(UserWarning, match="holds /notes, which nothing reads"):
        fw.Model.from_hdf5(path)
    with h5py.File(path, "r+") as file:
        file.move("damping", "dampping")
    with pytest.raises(fw.InputError, match=r"/dampping is nothing that is read \(did you mean "
                                            r"/damping\?\)"):
        fw.Model.from_hdf5(path)


@pytest.mark.parametrize(("name", "values", "told"), [
    ("dampping", [1.0], r"no real part .*\(did you mean damping\?\)"),
    ("mu", [1.0], r"\(did you mean contact/mu\?\)"),
    ("cyclic/lefts", [1.0], "'cyclic/lefts' is no real part of a model: must be one of mass"),
    ("aero/mode", [1.0], r"\(did you mean aero/modes\?\)"),
    ("nodal_diameter/0/masses", [1.0], "no real part"),
    ("observe/matrix", [1.0], "no real part"), ("mesh/points", [1.0], "no real part"),
    ("contact/side_3", [1], r"no integer part .*did you mean contact/side_1"),
    ("observe/dof", [1], "no integer part"), ("cyclic/sectors", [3], "no integer part"),
    ("cyclic/n_physical", [3], "no integer part"), ("spring/coefficient", [3], "no integer part")])
def test_unknown_parts_of_a_model_in_memory_are_refused(name: str, values: list[Any],
                                                        told: str) -> None:
    kind = np.int32 if isinstance(values[0], int) else np.float64
    with Session() as session:
        session.new_model(1, 1)
        with pytest.raises(fw.InputError, match=told):
            session.put(name, np.array(values, dtype=kind))
        with pytest.raises(fw.InputError, match=r"'titel' is no text part .*did you mean title"):
            session.put_texts("titel", ["x"])


def test_laws_of_dampers_are_those_of_contact() -> None:
    """The package names them itself, so that no program is asked before a damper is made."""
    shown = subprocess.run([PROGRAM, "--keys=json"], check=True, capture_output=True, text=True)
    assert set(LAWS) == set(json.loads(shown.stdout)["contact"]["keys"]["law"]["words"])
