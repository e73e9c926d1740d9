"""Elements of a model that is handed over in memory, part by part."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fretwear as fw

DAMPER = fw.Damper([1], [0.1], [2], [1.5], [2], [0])


@pytest.mark.parametrize("elements", [
    [fw.Polynomial([[1, 1, 2, 2]], [0.35])],
    [fw.Polynomial([[1, -2, 2]], [0.2], of="force", dof=[1])],
    [fw.Polynomial([[1, 1, 2, 2], [1, 1, 1, 1]], [0.35, 0.1]), DAMPER]])
def test_elements_in_memory_are_those_of_the_file(tmp_path: Path, elements: list[Any]) -> None:
    model = fw.Model(np.eye(2), 0.04 * np.eye(2), [[2.0, -0.7], [-0.7, 1.5]], cosine=[1.0, 0.0],
                     elements=elements)
    model.save(tmp_path / "model.h5")
    groups: dict[str, Any] = {"case": {"analysis": "point"}, "harmonics": {"n_harmonics": 3},
                              "sweep": {"start": 1.0}}
    held = fw.run(fw.Case(model=model, **groups))
    read = fw.run(fw.Case(model=fw.Model.from_hdf5(tmp_path / "model.h5"), **groups))
    assert held.converged.all()
    assert held.amplitude.tolist() == read.amplitude.tolist()
