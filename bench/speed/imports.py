"""Time and memory of bringing a finite-element model in: matrices of 10,000 to 100,000 dofs, read
and reduced to pairs and modes by `fretwear import`, with each engine that is there.

    python -m bench.speed.imports [--most 1000] [--engines superlu cholmod]

The models are blade sectors of `fretwear.sector` with finer meshes; their matrices are written as
Matrix Market files, as other programs hand them over, and the pairs as rows of averages over
patches. Times of the processor and memory of the whole command. Writes the table between its marks
in docs/benchmarks/imports.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io as sio
import scipy.sparse as sp

from bench.common.sector import COARSE
from fretwear.errors import InputError
from fretwear.factors import chosen_engine
from fretwear.sector.assembly import Assembly
from fretwear.sector.contact import contact_rows, held_nodes
from fretwear.sector.mesh import build_mesh
from fretwear.sector.parameters import Discretisation, SectorParameters, patch_grid

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "benchmarks" / "imports.md"
BEGIN, END = "<!-- imports: begin -->", "<!-- imports: end -->"
#: Pairs, and elements of the mesh away from the flanks: 11,000, 37,000 and 100,000 dofs.
SIZES: tuple[tuple[int, dict[str, int]], ...] = (
    (48, {}),
    (384, {key.replace("-", "_"): value for key, value in COARSE.items()}),
    (1000, {"blade_columns": 4, "airfoil_rows": 8, "disk_rows": 4}))
N_MODES = 20
ENGINES = ("superlu", "cholmod", "mumps")


@dataclass(frozen=True)
class Cost:
    """Of an import: dofs, pairs, entries of the stiffness, who factored, seconds, memory [MB]."""

    dofs: int
    pairs: int
    entries: int
    engine: str
    seconds: float
    memory: float


def write_model(folder: Path, pairs: int, mesh: dict[str, Any]) -> tuple[int, int]:
    """Matrices, rows of the pairs and their table; returns dofs and entries of the stiffness."""
    axial, slope = patch_grid(pairs)
    parameters = SectorParameters(discretisation=Discretisation(
        axial_patches=axial, slope_patches=slope, **mesh))
    sector = build_mesh(parameters)
    assembly = Assembly(sector.mesh, parameters.material)
    rows = contact_rows(sector, parameters)
    free = np.flatnonzero(np.repeat(~held_nodes(assembly.nodes, parameters.geometry), 3))
    stiffness = assembly.stiffness()[free][:, free]
    mass = sp.csr_array(sp.kron(assembly.scalar_mass(), sp.identity(3)))[free][:, free]
    for name, matrix in (("stiffness", stiffness), ("mass", mass)):
        sio.mmwrite(folder / f"{name}.mtx", sp.coo_matrix(matrix), symmetry="symmetric")
    sio.mmwrite(folder / "rows.mtx", sp.coo_matrix(rows.matrix[:, free]), symmetry="general")
    lines = ["mu, area, x, y, z"] + [
        f"0.5, {area:.17g}, " + ", ".join(f"{x:.17g}" for x in place)
        for area, place in zip(rows.area, rows.position)]
    (folder / "pairs.csv").write_text("\n".join(lines) + "\n")
    return len(free), stiffness.nnz


def measure(pairs: int, mesh: dict[str, Any], engines: Sequence[str]) -> Iterator[Cost]:
    """An import with each engine, as a user types it."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        # By another process: the memory of this one would count as that of those it begins.
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            dofs, entries = pool.submit(write_model, folder, pairs, mesh).result()
        for engine in engines:
            process = subprocess.Popen(
                [sys.executable, "-m", "fretwear", "import", "--stiffness", "stiffness.mtx",
                 "--mass", "mass.mtx", "--pairs", "pairs.csv", "--contact-rows", "rows.mtx",
                 "--reduce", str(N_MODES), "--factor", engine, "-q", "-o", "model.h5"],
                cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT / "python")})
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            if process.returncode:
                raise RuntimeError(f"fretwear import ended with status {process.returncode}")
            yield Cost(dofs, pairs, entries, engine, used.ru_utime + used.ru_stime,
                       used.ru_maxrss / 1024.0)


def is_there(engine: str) -> bool:
    """Whether it is installed."""
    try:
        chosen_engine(engine)
    except InputError:
        return False
    return True


def table(costs: list[Cost]) -> str:
    """The costs in Markdown."""
    lines = ["| dofs | pairs | entries of the stiffness | factors | seconds | memory [MB] |",
             "|---|---|---|---|---|---|"]
    lines += [f"| {cost.dofs} | {cost.pairs} | {cost.entries} | {cost.engine} | "
              f"{cost.seconds:.0f} | {cost.memory:.0f} |" for cost in costs]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--most", type=int, default=1000, help="pairs of the largest model")
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=ENGINES)
    parser.add_argument("--page", type=Path, default=PAGE)
    arguments = parser.parse_args()
    engines = [engine for engine in arguments.engines if is_there(engine)]
    costs = []
    for pairs, mesh in SIZES:
        if pairs <= arguments.most:
            for cost in measure(pairs, mesh, engines):
                costs.append(cost)
                print(table(costs), flush=True)
    before, rest = arguments.page.read_text().split(BEGIN)
    arguments.page.write_text(f"{before}{BEGIN}\n\n{table(costs)}\n\n{END}{rest.split(END)[1]}")


if __name__ == "__main__":
    main()
