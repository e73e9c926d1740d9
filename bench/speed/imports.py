"""Time and memory of bringing a finite-element model in: matrices of 20,000 to 115,000 dofs, read
and reduced to pairs and modes by `fretwear import`, with each engine that is there.

    python -m bench.speed.imports [MODEL ...] [--engines superlu cholmod mumps pardiso]
    python -m bench.speed.imports --choices
    python -m bench.speed.imports --damping [--folder build/bench]

The models are blade sectors of `fretwear.sector` with finer meshes, and bricks: two blocks of
8-node elements, one upon the other and held below, whose pairs are patches of 2 x 2 elements. Their
matrices are written as Matrix Market files, as other programs hand them over, and the pairs as rows
of averages over patches. Times of the processor, with one thread in products, and the largest
memory of the process. Models and engines that are measured replace their rows between the marks in
docs/benchmarks/imports.md; the others stay. --choices measures what the reduction might do
otherwise: solutions that are kept, wider blocks of them, MUMPS without its Python package.
--damping measures a run of two points on the sector with 768 pairs, whose set-up is most of it,
with modal damping of none, of the lowest and of all modes.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io as sio
import scipy.sparse as sp
from numpy.typing import NDArray

from bench.common.sector import COARSE, sector_file
from fretwear import factors, reduction, schur
from fretwear.errors import InputError
from fretwear.factors import chosen_engine, factor
from fretwear.sector.assembly import Assembly
from fretwear.sector.contact import contact_rows, held_nodes
from fretwear.sector.mesh import build_mesh
from fretwear.sector.parameters import Discretisation, SectorParameters, patch_grid

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "benchmarks" / "imports.md"
COARSE_MESH = {key.replace("-", "_"): value for key, value in COARSE.items()}
#: Pairs of a sector with the elements of its mesh away from the flanks; elements of the blocks of a
#: brick across, and through each block.
SECTORS: dict[str, tuple[int, dict[str, int]]] = {
    "sector-48": (48, {}), "sector-384": (384, COARSE_MESH), "sector-768": (768, COARSE_MESH),
    "sector-1536": (1536, COARSE_MESH)}
BRICKS = {"brick-32": (32, 7), "brick-40": (40, 10)}
MODELS = (*SECTORS, *BRICKS)
N_MODES = 20
ENGINES = ("superlu", "cholmod", "mumps", "pardiso")
#: Right-hand sides that factors are tried with.
N_SOLUTIONS = 64
#: Steel [N/mm^2, -, t/mm^3], and edge of an element of a brick [mm].
YOUNG, POISSON, DENSITY, EDGE = 2.1e5, 0.3, 7.8e-9, 1.0
SETTINGS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Model:
    """Matrices of a model on its free dofs, rows of the pairs, their areas and places."""

    stiffness: sp.csr_array
    mass: sp.csr_array
    rows: sp.csr_array
    area: Floats
    place: Floats

    def write(self, folder: Path) -> tuple[int, int]:
        """As files; returns dofs and pairs."""
        for name, matrix in (("stiffness", self.stiffness), ("mass", self.mass)):
            sio.mmwrite(folder / f"{name}.mtx", sp.coo_matrix(matrix), symmetry="symmetric")
        sio.mmwrite(folder / "rows.mtx", sp.coo_matrix(self.rows), symmetry="general")
        lines = ["mu, area, x, y, z"] + [
            f"0.5, {area:.17g}, " + ", ".join(f"{x:.17g}" for x in place)
            for area, place in zip(self.area, self.place)]
        (folder / "pairs.csv").write_text("\n".join(lines) + "\n")
        return self.stiffness.shape[0], len(self.area)


def sector(pairs: int, mesh: dict[str, Any]) -> Model:
    """A blade in its slot."""
    axial, slope = patch_grid(pairs)
    parameters = SectorParameters(discretisation=Discretisation(
        axial_patches=axial, slope_patches=slope, **mesh))
    meshed = build_mesh(parameters)
    assembly = Assembly(meshed.mesh, parameters.material)
    rows = contact_rows(meshed, parameters)
    free = np.flatnonzero(np.repeat(~held_nodes(assembly.nodes, parameters.geometry), 3))
    return Model(assembly.stiffness()[free][:, free],
                 sp.csr_array(sp.kron(assembly.scalar_mass(), sp.identity(3)))[free][:, free],
                 sp.csr_array(rows.matrix)[:, free], rows.area, rows.position)


def element_matrices() -> tuple[Floats, Floats]:
    """Stiffness (24, 24) and mass (8, 8) of one component of a cube with 8 nodes, by 2 x 2 x 2
    points; nodes by x, then y, then z."""
    ends = np.array([[i, j, k] for k in (-1, 1) for j in (-1, 1) for i in (-1, 1)], dtype=float)
    shear = YOUNG / (2.0 * (1.0 + POISSON))
    lame = 2.0 * shear * POISSON / (1.0 - 2.0 * POISSON)
    law = np.diag([2.0 * shear] * 3 + [shear] * 3)
    law[:3, :3] += lame
    stiffness, mass = np.zeros((24, 24)), np.zeros((8, 8))
    for point in ends / np.sqrt(3.0):
        parts = 1.0 + ends * point
        values = parts.prod(axis=1) / 8.0
        slopes = np.stack([ends[:, c] * np.delete(parts, c, axis=1).prod(axis=1) / 8.0
                           for c in range(3)]) * 2.0 / EDGE
        strain = np.zeros((6, 8, 3))
        for c in range(3):
            strain[c, :, c] = slopes[c]
        for row, (a, b) in enumerate(((0, 1), (1, 2), (0, 2)), 3):
            strain[row, :, a], strain[row, :, b] = slopes[b], slopes[a]
        moved = strain.reshape(6, 24)
        stiffness += moved.T @ law @ moved * (EDGE / 2.0)**3
        mass += DENSITY * np.outer(values, values) * (EDGE / 2.0)**3
    return stiffness, mass


def scattered(local: Floats, dofs: NDArray[np.int64], n: int) -> sp.csr_array:
    """The same element matrix at the dofs of each element (n_elements, n_local)."""
    shape = (len(dofs), *local.shape)
    return sp.csr_array(sp.coo_array(
        (np.broadcast_to(local, shape).ravel(),
         (np.broadcast_to(dofs[:, :, None], shape).ravel(),
          np.broadcast_to(dofs[:, None, :], shape).ravel())), shape=(n, n)))


def brick(across: int, through: int) -> Model:
    """Two blocks of across x across x through elements; the lower one is held below."""
    n, layers = across + 1, through + 1
    corners = np.array([i + n * (j + n * k) for k in (0, 1) for j in (0, 1) for i in (0, 1)])
    first = np.array([i + n * (j + n * k) for k in range(through) for j in range(across)
                      for i in range(across)])
    elements = first[:, None] + corners
    cells = np.vstack((elements, elements + n * n * layers))
    n_nodes = 2 * n * n * layers
    stiffness, mass = element_matrices()
    dofs = (3 * cells[:, :, None] + np.arange(3)).reshape(len(cells), 24)
    free = np.arange(3 * n * n, 3 * n_nodes)
    patches = across // 2
    # Means over 2 x 2 elements: products of 1/4, 1/2, 1/4 along both edges.
    line = sp.lil_array((patches, n))
    for patch in range(patches):
        line[patch, 2 * patch:2 * patch + 3] = [[0.25, 0.5, 0.25]]
    means = sp.csr_array(sp.kron(line, line))
    upper, lower = (sp.csr_array((np.ones(n * n), (np.arange(n * n), np.arange(at, at + n * n))),
                                 (n * n, n_nodes)) for at in (n * n * layers, n * n * (layers - 1)))
    # t1, t2, n of a pair, one pair after the other: along x, y and z.
    rows = sp.csr_array(sp.kron(means @ (upper - lower), sp.identity(3)))
    middle = EDGE * (2.0 * np.arange(patches) + 1.0)
    x, y = np.meshgrid(middle, middle)
    place = np.stack((x.ravel(), y.ravel(), np.full(patches**2, EDGE * through)), axis=1)
    return Model(scattered(stiffness, dofs, 3 * n_nodes)[free][:, free],
                 sp.csr_array(sp.kron(scattered(mass, cells, n_nodes), sp.identity(3)))[free][
                     :, free],
                 rows[:, free], np.full(patches**2, 4.0 * EDGE**2), place)


def write_model(name: str, folder: Path) -> tuple[int, int]:
    """Files of a model; returns dofs and pairs."""
    made = sector(*SECTORS[name]) if name in SECTORS else brick(*BRICKS[name])
    return made.write(folder)


@dataclass(frozen=True)
class Cost:
    """Of a model and an engine: dofs, pairs; processor seconds and largest memory [MB] of the
    import; seconds of the factors alone, of solutions with them, and their memory."""

    model: str
    dofs: int
    pairs: int
    engine: str
    seconds: float
    memory: float
    factor: float
    solutions: float
    beyond: float

    @property
    def row(self) -> str:
        """Of the table."""
        return (f"| {self.model} | {self.dofs} | {self.pairs} | {self.engine} | "
                f"{self.seconds:.0f} | {self.memory:.0f} | {self.factor:.1f} | "
                f"{self.solutions:.2f} | {self.beyond:.0f} |")


HEAD = ("| model | dofs | pairs | factors by | import [s] | memory [MB] | factors alone [s] "
        f"| {N_SOLUTIONS} solutions [s] | their memory [MB] |", "|---|---|---|---|---|---|---|---|"
        "---|")


def factor_alone(folder: Path, engine: str) -> dict[str, float]:
    """Seconds and memory of factors of the stiffness with springs in its pairs; in a process that
    has read the matrices and does nothing else."""
    matrix, rows = (sp.csr_array(sio.mmread(folder / f"{name}.mtx"))
                    for name in ("stiffness", "rows"))
    held = sp.csc_matrix(matrix + float(matrix.diagonal().mean()) * (rows.T @ rows))
    load = np.cos(np.arange(float(held.shape[0] * N_SOLUTIONS))).reshape(-1, N_SOLUTIONS)
    del matrix, rows
    before, started = resident(), time.process_time()
    factors = factor(held, engine)
    made = time.process_time()
    factors.solve(load)
    return {"factor": made - started, "solutions": time.process_time() - made,
            "beyond": (largest() - before) / 1e6}


#: What a reduction might do otherwise: engine, memory below which solutions are kept [bytes],
#: right-hand sides at once, in words.
CHOICES = (("superlu", 0.0, 64, "superlu, each solution twice"),
           ("superlu", 1e10, 64, "superlu, solutions kept"),
           ("cholmod", 0.0, 64, "cholmod, blocks of 64"),
           ("cholmod", 0.0, 128, "cholmod, blocks of 128"),
           ("mumps", 1e8, 64, "mumps"))
CHOSEN_ON = "sector-48"


def reduce_otherwise(folder: Path, engine: str, kept: float, width: int) -> dict[str, float]:
    """Seconds and memory of a reduction, and of these seconds those within MUMPS."""
    stiffness, mass, rows = (sp.csr_array(sio.mmread(folder / f"{name}.mtx"))
                             for name in ("stiffness", "mass", "rows"))
    reduction._KEPT, reduction._BLOCK = kept, width
    inside = 0.0
    plain = factors.run_mumps

    def timed(*arguments: Any) -> str:
        nonlocal inside
        started = time.process_time()
        answer = plain(*arguments)
        inside += time.process_time() - started
        return answer

    factors.run_mumps = schur.run_mumps = timed
    started = time.process_time()
    reduction.reduce(mass, stiffness, rows, n_modes=N_MODES, factor=engine)
    return {"seconds": time.process_time() - started, "memory": largest() / 1e6, "inside": inside}


def measure_choices() -> str:
    """Of all that can be had here, in Markdown."""
    lines = [f"| reduction of {CHOSEN_ON} | seconds | memory [MB] | seconds in MUMPS |",
             "|---|---|---|---|"]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            pool.submit(write_model, CHOSEN_ON, folder).result()
        for engine, kept, width, words in CHOICES:
            if not is_there(engine):
                continue
            done = subprocess.run(
                [sys.executable, "-m", "bench.speed.imports", "--otherwise", str(kept), str(width),
                 "--alone", str(folder), "--engines", engine], env=surroundings(), check=True,
                capture_output=True, text=True)
            cost = json.loads(done.stdout)
            within = f"{cost['inside']:.1f}" if engine == "mumps" else ""
            lines.append(f"| {words} | {cost['seconds']:.1f} | {cost['memory']:.0f} | {within} |")
            print(lines[-1], flush=True)
    return "\n".join(lines)


#: Two points that stick, far below the first mode.
TWO_POINTS = """&case analysis = 'frf' /
&model source = 'hdf5', file = '{file}', rotation_speed = 460.8{damping} /
&load harmonic_scale = 1.0e-3 /
&harmonics n_harmonics = 1, n_time = 16 /
&sweep start = 200.0, end = 201.0, n_points = 2, unit = 'Hz' /
&output file = '{folder}/two.h5' /
"""
DAMPINGS = (("none", ""), ("below 30 kHz", ", modal_damping = 1.0e-3, modal_damping_up_to = 3.0e4"),
            ("all modes", ", modal_damping = 1.0e-3"))
DAMPED_PAIRS, TIMES = 768, 3


def measure_damping(kept: Path) -> str:
    """The least of three runs each, in Markdown."""
    program = os.environ.get("FW_RUN", str(ROOT / "build" / "release" / "fw_run"))
    lines = ["| modal damping | seconds | memory [MB] |", "|---|---|---|"]
    file = sector_file(DAMPED_PAIRS, kept, COARSE)
    with tempfile.TemporaryDirectory() as folder:
        costs: dict[str, list[tuple[float, float]]] = {words: [] for words, _ in DAMPINGS}
        for _ in range(TIMES):
            for words, damping in DAMPINGS:
                case = Path(folder) / "two.nml"
                case.write_text(TWO_POINTS.format(file=file, damping=damping, folder=folder))
                process = subprocess.Popen([program, "-q", str(case)], env=surroundings())
                _, status, used = os.wait4(process.pid, 0)
                process.returncode = os.waitstatus_to_exitcode(status)
                if process.returncode:
                    raise RuntimeError(f"fw_run ended with status {process.returncode}")
                costs[words].append((used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0))
    for words, _ in DAMPINGS:
        seconds, memory = min(costs[words])
        lines.append(f"| {words} | {seconds:.1f} | {memory:.0f} |")
    print("\n".join(lines), flush=True)
    return "\n".join(lines)


def surroundings() -> dict[str, str]:
    """Of a process that is measured."""
    return os.environ | SETTINGS | {"PYTHONPATH": f"{ROOT}:{ROOT / 'python'}"}


def resident() -> float:
    """Memory of this process [bytes]."""
    return float(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def largest() -> float:
    """The most it was [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024.0


def measure(name: str, engines: Sequence[str]) -> Iterator[Cost]:
    """An import with each engine, as a user types it, and its factors alone."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        # By another process: the memory of this one would count as that of those it begins.
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            dofs, pairs = pool.submit(write_model, name, folder).result()
        for engine in engines:
            process = subprocess.Popen(
                [sys.executable, "-m", "fretwear", "import", "--stiffness", "stiffness.mtx",
                 "--mass", "mass.mtx", "--pairs", "pairs.csv", "--contact-rows", "rows.mtx",
                 "--reduce", str(N_MODES), "--factor", engine, "-q", "-o", "model.h5"],
                cwd=folder, env=surroundings())
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            if process.returncode:
                raise RuntimeError(f"fretwear import ended with status {process.returncode}")
            alone = subprocess.run(
                [sys.executable, "-m", "bench.speed.imports", "--alone", str(folder), "--engines",
                 engine], env=surroundings(), check=True, capture_output=True, text=True)
            yield Cost(name, dofs, pairs, engine, used.ru_utime + used.ru_stime,
                       used.ru_maxrss / 1024.0, **json.loads(alone.stdout))


def is_there(engine: str) -> bool:
    """Whether it is installed."""
    try:
        chosen_engine(engine)
    except InputError:
        return False
    return True


def with_cost(page: str, cost: Cost) -> str:
    """The page with a row in the place of an older one of the same model and engine."""
    rows = {}
    for line in [*between(page, "imports")[1].splitlines(), cost.row]:
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) > 4 and cells[1] in MODELS and cells[4] in ENGINES:
            rows[MODELS.index(cells[1]), ENGINES.index(cells[4])] = line
    return with_table(page, "imports", "\n".join([*HEAD, *(rows[key] for key in sorted(rows))]))


def between(page: str, mark: str) -> list[str]:
    """What is before the marks, between them and behind."""
    before, rest = page.split(f"<!-- {mark}: begin -->")
    return [before, *rest.split(f"<!-- {mark}: end -->")]


def with_table(page: str, mark: str, table: str) -> str:
    """The page with another table between the marks."""
    before, _, after = between(page, mark)
    return f"{before}<!-- {mark}: begin -->\n\n{table}\n\n<!-- {mark}: end -->{after}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("models", nargs="*", metavar="MODEL",
                        help=f"of {', '.join(MODELS)}; without any, all")
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=ENGINES)
    parser.add_argument("--page", type=Path, default=PAGE)
    parser.add_argument("--choices", action="store_true", help="what might be done otherwise")
    parser.add_argument("--damping", action="store_true", help="two points, by modal damping")
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "bench",
                        help="where the generated model of --damping is kept")
    parser.add_argument("--alone", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--otherwise", type=float, nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.otherwise:
        kept, width = arguments.otherwise
        print(json.dumps(reduce_otherwise(arguments.alone, arguments.engines[0], kept,
                                          int(width))))
        return
    if arguments.choices or arguments.damping:
        mark, table = ("choices", measure_choices()) if arguments.choices else (
            "damping", measure_damping(arguments.folder))
        arguments.page.write_text(with_table(arguments.page.read_text(), mark, table))
        return
    if arguments.alone:
        print(json.dumps(factor_alone(arguments.alone, arguments.engines[0])))
        return
    for name in set(arguments.models) - {*MODELS}:
        parser.error(f"there is no model {name}: {', '.join(MODELS)}")
    engines = [engine for engine in arguments.engines if is_there(engine)]
    for name in arguments.models or MODELS:
        for cost in measure(name, engines):
            print(cost.row, flush=True)
            arguments.page.write_text(with_cost(arguments.page.read_text(), cost))


if __name__ == "__main__":
    main()
