"""Models shared by the tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fretwear.sector import (
    Discretisation,
    FullModel,
    ReducedModel,
    SectorParameters,
    build_full,
    reduce_model,
)
from fretwear.sector.assembly import Assembly
from fretwear.sector.mesh import BLADE

# Small enough for dense algebra on the full model; two rows per flank keep the root from rocking.
COARSE = Discretisation(
    axial_patches=2, slope_patches=2, min_axial=2, min_slope=2, blade_columns=2, root_rows=1,
    platform_rows=1, airfoil_rows=2, post_columns=1, slot_columns=1, disk_rows=1, n_modes=12)


@pytest.fixture(scope="session")
def full() -> FullModel:
    """Full model on a coarse mesh."""
    return build_full(SectorParameters(discretisation=COARSE))


@pytest.fixture(scope="session")
def assembly(full: FullModel) -> Assembly:
    """Nodes and elements of that mesh."""
    return Assembly(full.sector.mesh, full.parameters.material)


@pytest.fixture(scope="session")
def blade_nodes(full: FullModel, assembly: Assembly) -> np.ndarray:
    """Numbers of the nodes of the blade."""
    return np.unique(assembly.cell_nodes[full.sector.body == BLADE])


@pytest.fixture(scope="session")
def reduced(full: FullModel) -> ReducedModel:
    """Its reduction."""
    return reduce_model(full)


@pytest.fixture(scope="session")
def examples() -> Path:
    """Folder of the committed sector models."""
    return Path(__file__).resolve().parents[2] / "example" / "blade_sector"
