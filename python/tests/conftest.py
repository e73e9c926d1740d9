"""Models shared by the tests."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from program import run

from fretwear.result import Result
from fretwear.sector import (
    Discretisation,
    FullModel,
    ReducedModel,
    SectorParameters,
    build_full,
    reduce_model,
    write_model,
)
from fretwear.sector.assembly import Assembly
from fretwear.sector.mesh import BLADE
from fretwear.sector.recovery import recovery_mesh

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


#: Fast enough for the flanks to carry the blade, slow enough for them to slip.
SPEED = 460.8
CASE = """&case title = 'Coarse sector' /
&model source = 'hdf5' file = 'model.h5' modal_damping = 1e-3 rotation_speed = {speed} /
&contact law = 'dlft' mu = 0.5 /
&load harmonic_scale = 0.5 /
&harmonics n_harmonics = 3 n_time = 64 /
&sweep start = {start} end = {end} n_points = 40 unit = 'Hz' /
&output observe = 'tip', 'tip_x' /
"""


@pytest.fixture(scope="session")
def coarse_case(full: FullModel, reduced: ReducedModel,
                tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Namelist of the first peak of the coarse sector, beside its model file with a mesh."""
    folder = tmp_path_factory.mktemp("coarse")
    write_model(reduced, folder / "model.h5", mesh=recovery_mesh(full)[0])
    stuck = reduced.frequencies(SPEED)[0]
    case = folder / "case.nml"
    case.write_text(CASE.format(speed=SPEED, start=0.997 * stuck, end=1.002 * stuck))
    return case


@pytest.fixture(scope="session")
def coarse(coarse_case: Path) -> Result:
    """Sweep through the first peak of the coarse sector, without histories."""
    return run(coarse_case, coarse_case.with_name("coarse.h5"))


@pytest.fixture(scope="session")
def sampled(coarse_case: Path) -> Result:
    """The same with histories."""
    return run(coarse_case, coarse_case.with_name("sampled.h5"), "output%histories=true")


@pytest.fixture(scope="session")
def worn(sampled: Result) -> Result:
    """The same with the datasets of a wear analysis: depths that settle, one row a point."""
    path = sampled.path.with_name("worn.h5")
    path.write_bytes(sampled.path.read_bytes())
    cycles = np.concatenate(([0.0], np.geomspace(1e3, 1e9, sampled.n_points - 1)))
    final = 1e-3 * sampled.dissipation[sampled.peak()] / sampled.dissipation.max()
    rate = final * np.exp(-cycles[:, None] / 1e7) / 1e7
    with h5py.File(path, "r+") as file:
        file["wear/cycles"] = cycles
        file["wear/depth"] = final - 1e7 * rate
        file["wear/rate"] = rate
        file["wear/depth"].attrs["units"] = file["wear/rate"].attrs["units"] = "mm"
        file["wear"].attrs["steady_state"] = "reached"
    return Result(path)
