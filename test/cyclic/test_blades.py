"""Sectors that differ (&mistuning).

test/reference/blades/b1.., b2.., b3.. and b8.. are annuli by a dense harmonic balance of other
origin. Random disks are judged by the program itself on the annulus as one structure.
"""
import json

import h5py
import numpy as np
import pytest
from annulus import Annulus, random_case
from cases import read, run
from cyclic_cases import difference, run_at
from project import ROOT

FILES = ["b1_frequency", "b2_matrices", "b3_stiffness_mass", "b8_rigid"]
REFERENCE = {name: json.loads((ROOT / f"test/reference/blades/{name}.json").read_text())
             for name in FILES}
RUNS = [(name, number) for name in FILES for number in range(len(REFERENCE[name]["runs"]))
        if "sensitivity" not in REFERENCE[name]["runs"][number]["case"]]
#: Both are solved to residuals of 1e-12; conditioning takes the rest.
EQUAL = 1e-9
#: Only round-off tells two ways to say the same.
SAME = 1e-11


def write_model(path, datasets):
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        for name, values in datasets.items():
            group, _, attribute = name.partition("@")
            if attribute:
                file.require_group(group or "/").attrs[attribute] = values
            else:
                file[name] = np.array(values)


def groups_of(case):
    groups = {group: dict(keys) for group, keys in case.items()}
    sweep = groups.get("sweep", {})
    if "frequencies" in sweep:
        sweep["values"] = sweep.pop("frequencies")
    return groups | {"model": {"source": "hdf5", "file": "model.h5"} | groups.get("model", {})}


@pytest.mark.parametrize(("name", "number"), RUNS)
def test_other_programs(tmp_path, name, number):
    write_model(tmp_path / "model.h5", REFERENCE[name]["file"])
    wanted = REFERENCE[name]["runs"][number]
    run(tmp_path, groups_of(wanted["case"]))
    with h5py.File(tmp_path / "case.h5") as file:
        for row in wanted["expect"]:
            values = np.array(row["value"])
            error = np.abs(file[row["dataset"]][()] - values).max() / np.abs(values).max()
            assert error <= row["limit"], row["dataset"]
