"""Cost of a point of a cyclic structure: of one sector of a disk of 36, against a plain structure
with the same dofs, against annuli of the same sectors as one structure, and against all sectors
with contact that differs from one to the next.

    python -m bench.speed.sectors [--program build/release/fw_run] [--most 9] [--disk disk.h5]
    python -m bench.speed.sectors --roots --before OTHER [--folder FOLDER] [--pairs 16 48 96]

Engine order 4 of 36 sectors moves as order 1 of 9, 2 of 18. Times are of the processor, of a sweep
less that of its first point alone, so that reading and the condensation do not count; the smallest
of several runs. Writes the table between its marks in docs/benchmarks/sectors.md.

With --roots another table: blade roots of more and more pairs in a disk of 47 sectors
(`bench.common.wave_sector`), by this program and by one of before, by turns. Models are made in
the folder, which takes minutes for each, unless they stand there.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from bench.common.sector import COARSE
from bench.common.wave_sector import ENGINE_ORDER as ROOT_ORDER
from bench.common.wave_sector import patterns, wave_file
from fretwear._namelist import write_namelist
from fretwear.model_file import write_model_file

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "benchmarks" / "sectors.md"
BEGIN, END = "<!-- sector cost: begin -->", "<!-- sector cost: end -->"
ROOT_BEGIN, ROOT_END = "<!-- root cost: begin -->", "<!-- root cost: end -->"
#: Blade roots: pairs and harmonics, and frequencies through the first bending mode [Hz].
ROOT_PAIRS, ROOT_HARMONICS = (16, 48, 96), (3, 7)
ROOT_START, ROOT_SPAN, ROOT_POINTS = 990.0, 40.0, 81
N_SECTORS, ENGINE_ORDER = 36, 4
#: Above the resonance of the closed shrouds [Hz], where no maximum is looked for: of the wave, and
#: of the plain structure, which moves as all sectors alike do.
START, PLAIN_START, SPAN, N_POINTS = 1292.0, 660.0, 20.0, 201
#: Instants: a whole number for each sector, so that those of an annulus are as good as alike.
N_TIME = 144
REPEATS = 3
#: Condensation of an annulus is not measured, but has to be done.
POINTS_OF_ANNULUS = 5
#: Of all sectors with contact that differs by up to such a part of friction and interference; above
#: the resonances of the sectors, and without a search for the maxima of each.
POINTS_OF_ALL, SPREADS, ALL_START = 11, (0.0, 0.1), 1400.0


@dataclass(frozen=True)
class Cost:
    """Of a structure: dofs, unknowns, processor time of a point [ms], Newton steps of a point,
    largest memory [MB], sectors that are solved for."""

    name: str
    dofs: int
    unknowns: int
    milliseconds: float
    steps: float
    memory: float
    sectors: int = 1


def read_disk(path: Path) -> dict[str, Any]:
    """Every dataset of a model file of a sector."""
    found: dict[str, Any] = {}
    with h5py.File(path) as file:
        for name in ("mass", "stiffness", "damping", "cyclic/left", "cyclic/right",
                     "contact/side_1", "contact/side_2", "contact/sector_2", "load/cosine"):
            if name in file:
                found[name] = file[name][()]
    found.setdefault("damping", 0.0 * found["mass"])
    return found


class Ring:
    """Sectors of a disk as one structure; one sector alone is tied to itself."""

    def __init__(self, disk: dict[str, Any], n: int) -> None:
        self.disk, self.n = disk, n
        right = {abs(r) - 1: (left - 1, int(np.sign(r)))
                 for left, r in zip(disk["cyclic/left"], disk["cyclic/right"])}
        size = len(disk["mass"])
        inner = [i for i in range(size) if i not in right]
        self.width, self.size = len(inner), size
        #: Place in a sector, sign, and whether it is that of the next sector, of each dof.
        self.place = np.zeros(size, int)
        self.place[inner] = np.arange(len(inner))
        self.sign, self.next = np.ones(size), np.zeros(size, int)
        for i, (source, sign) in right.items():
            self.place[i], self.sign[i], self.next[i] = self.place[source], sign, 1

    def dofs(self, sector: int) -> np.ndarray:
        return ((sector + self.next) % self.n) * self.width + self.place

    def matrix(self, name: str) -> np.ndarray:
        whole = np.zeros((self.n * self.width,) * 2)
        part = self.sign[:, None] * self.disk[name] * self.sign
        for sector in range(self.n):
            at = self.dofs(sector)
            np.add.at(whole, (at[:, None], at[None, :]), part)
        return whole

    def signed(self, sector: int, dof: int) -> int:
        if dof == 0:
            return 0
        i = abs(dof) - 1
        return int(np.sign(dof) * self.sign[i]) * (int(self.dofs(sector % self.n)[i]) + 1)

    def datasets(self, order: int) -> dict[str, np.ndarray]:
        found = {name: self.matrix(name) for name in ("mass", "stiffness", "damping")}
        load = np.zeros(len(found["mass"]), complex)
        for sector in range(self.n):
            force = self.sign * self.disk["load/cosine"]
            np.add.at(load, self.dofs(sector),
                      force * np.exp(-2j * np.pi * sector * order / self.n))
        found |= {"load/cosine": load.real, "load/sine": -load.imag}
        for side in ("side_1", "side_2"):
            shift = self.disk["contact/sector_2"] if side == "side_2" else 0
            shift = np.broadcast_to(shift, len(self.disk["contact/side_1"]))
            found[f"contact/{side}"] = np.array(
                [[self.signed(j + s, int(d)) for d in pair] for j in range(self.n)
                 for pair, s in zip(self.disk[f"contact/{side}"], shift)])
        return found


def groups(model: Path, n_harmonics: int, observed: int) -> dict[str, dict[str, Any]]:
    """The case but for its sweep: the damping of the disk, shrouds pressed on."""
    omega = 2.0 * np.pi * 1288.3
    return {
        "model": {"source": "hdf5", "file": str(model), "rayleigh_mass": 0.0005 * omega,
                  "rayleigh_stiffness": 0.0005 / omega},
        "contact": {"law": "penalty", "mu": 0.3, "gap": -0.04, "tangential_stiffness": 5e4,
                    "normal_stiffness": 5e4},
        "load": {"harmonic_scale": 10.0},
        "harmonics": {"n_harmonics": n_harmonics, "n_time": N_TIME, "sampling": "uniform"},
        "output": {"observe": [observed], "contact": False}}


def mistuned(case: dict[str, dict[str, Any]], pairs: int, spread: float) -> dict[str, Any]:
    """The case of one sector for all sectors, contact data at random about their mean."""
    rng = np.random.default_rng(36)
    contact = dict(case["contact"])
    for key in ("mu", "gap"):
        factors = 1.0 + spread * rng.uniform(-1.0, 1.0, N_SECTORS * pairs)
        contact[key] = (contact[key] * factors).tolist()
    return case | {"contact": contact, "cyclic": case["cyclic"] | {"mistuned": True},
                   "sweep": {"refine": False}}


def run(program: Path, folder: Path, case: dict[str, dict[str, Any]],
        points: int, start: float) -> tuple[float, float]:
    """Processor time of a sweep [s] and its largest memory [MB]."""
    sweep = {"values": np.linspace(start, start + SPAN, N_POINTS)[:points].tolist(),
             "unit": "Hz"}
    return execute(program, folder, case | {"sweep": case.get("sweep", {}) | sweep})


def spent(program: Path, folder: Path, case: dict[str, dict[str, Any]]) -> float:
    """Processor time of a run [s]."""
    return execute(program, folder, case)[0]


def execute(program: Path, folder: Path, case: dict[str, dict[str, Any]]) -> tuple[float, float]:
    """Processor time of a run [s] and its largest memory [MB]."""
    (folder / "case.nml").write_text(write_namelist(case))
    process = subprocess.Popen([program, "-q", "case.nml"], cwd=folder, env={
        **os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
    memory, done = 0.0, 0
    while not done:
        memory = max(memory, memory_of(process.pid))
        time.sleep(0.002)
        done, status, used = os.wait4(process.pid, os.WNOHANG)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"fw_run ended with status {process.returncode}")
    return used.ru_utime + used.ru_stime, memory


def memory_of(process: int) -> float:
    """Largest memory of a process so far [MB]; that of its end also counts what started it."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return 0.0
    found = [line.split()[1] for line in status.splitlines() if line.startswith("VmHWM")]
    return float(found[0]) / 1024.0 if found else 0.0


@dataclass(frozen=True)
class RootCost:
    """Of a blade root: patterns in which nodal diameters differ by more than 1 and 0.1 %, Newton
    steps of a point, and of either program, that of before first, processor time of the first point
    with all before it [s] and of a later one [ms]."""

    pairs: int
    n_harmonics: int
    patterns: tuple[int, int]
    steps: float
    first: tuple[float, float]
    milliseconds: tuple[float, float]


def measure_root(before: Path, program: Path, folder: Path, pairs: int, n_harmonics: int
                 ) -> RootCost:
    """A sweep and its first point alone, the programs by turns, the smallest of several runs."""
    model = wave_file(pairs, max(ROOT_HARMONICS), folder, COARSE)
    case: dict[str, dict[str, Any]] = {
        "model": {"source": "hdf5", "file": str(model)}, "cyclic": {"engine_order": ROOT_ORDER},
        "contact": {"law": "dlft", "mu": 0.5}, "load": {"harmonic_scale": 0.5},
        "harmonics": {"n_harmonics": n_harmonics, "n_time": 128}, "output": {"contact": False},
        "sweep": {"refine": False, "unit": "Hz", "values": np.linspace(
            ROOT_START, ROOT_START + ROOT_SPAN, ROOT_POINTS).tolist()}}
    first = case | {"sweep": case["sweep"] | {"values": [ROOT_START]}}
    with tempfile.TemporaryDirectory() as place:
        times = [[(spent(one, Path(place), first), spent(one, Path(place), case))
                  for one in (before, program)] for _ in range(REPEATS)]
        with h5py.File(Path(place) / "case.h5") as file:
            assert file["converged"][:].all()
            steps = float(np.mean(file["iterations"][1:]))
    alone, whole = (np.min([[one[i] for one in row] for row in times], axis=0) for i in (0, 1))
    later = 1e3 * (whole - alone) / (ROOT_POINTS - 1)
    differs = patterns(model, n_harmonics, 1e-2), patterns(model, n_harmonics, 1e-3)
    return RootCost(pairs, n_harmonics, differs, steps, (alone[0], alone[1]), (later[0], later[1]))


def root_table(costs: list[RootCost]) -> str:
    lines = ["| pairs | harmonics | unknowns | patterns over 1 % | over 0.1 % | Newton steps "
             "| ms a point before | now | ratio | s to the end of the first before | now |",
             "|---|---|---|---|---|---|---|---|---|---|---|"]
    for row in costs:
        lines.append(f"| {row.pairs} | {row.n_harmonics} | "
                     f"{3 * row.pairs * (2 * row.n_harmonics + 1)} | {row.patterns[0]} | "
                     f"{row.patterns[1]} | {row.steps:.1f} | "
                     f"{row.milliseconds[0]:.1f} | {row.milliseconds[1]:.1f} | "
                     f"{row.milliseconds[1] / row.milliseconds[0]:.2f} | "
                     f"{row.first[0]:.2f} | {row.first[1]:.2f} |")
    return "\n".join(lines)


def measure(program: Path, name: str, case: dict[str, dict[str, Any]], dofs: int, pairs: int,
            points: int, repeats: int, start: float = START,
            sectors: int = 1) -> tuple[Cost, np.ndarray]:
    """The cost of a point, and the response."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        times = []
        for _ in range(repeats):
            one, _ = run(program, folder, case, 1, start)
            all_of_them, memory = run(program, folder, case, points, start)
            times.append((all_of_them - one) / (points - 1))
        with h5py.File(folder / "case.h5") as file:
            steps = float(np.mean(file["iterations"][1:points]))
            response = file["coefficients"][:points, :, 0]
            assert file["converged"][:points].all()
    unknowns = 3 * pairs * (2 * case["harmonics"]["n_harmonics"] + 1)
    return Cost(name, dofs, unknowns, 1e3 * min(times), steps, memory, sectors), response


def measure_all(program: Path, disk: Path, n_harmonics: int, most: int) -> list[Cost]:
    """Plain sector, cyclic sector, and rings up to `most` sectors."""
    parts = read_disk(disk)
    pairs = len(parts["contact/side_1"])
    loaded = int(np.abs(parts["load/cosine"]).argmax()) + 1
    costs = []
    with tempfile.TemporaryDirectory() as place:
        model = Path(place) / "model.h5"

        def ring_of(n: int) -> tuple[dict[str, dict[str, Any]], Ring]:
            ring = Ring(parts, n)
            order = ENGINE_ORDER * n // N_SECTORS if n > 1 else 0
            write_model_file(model, ring.datasets(order), title="", unit_system="", groups={})
            return groups(model, n_harmonics, abs(ring.signed(0, loaded))), ring

        case, ring = ring_of(1)
        costs.append(measure(program, "plain structure", case, ring.width, pairs, N_POINTS,
                             REPEATS, PLAIN_START)[0])
        case = groups(disk.resolve(), n_harmonics, loaded) | {
            "cyclic": {"n_sectors": N_SECTORS, "engine_order": ENGINE_ORDER}}
        cost, _ = measure(program, f"sector of {N_SECTORS}", case, ring.width, pairs, N_POINTS,
                             REPEATS)
        costs.append(cost)
        for spread in SPREADS if most > 1 else ():
            cost, _ = measure(program, f"all {N_SECTORS}, contact +-{100.0 * spread:.0f} %",
                              mistuned(case, pairs, spread), N_SECTORS * ring.width,
                              N_SECTORS * pairs, POINTS_OF_ALL, 1, ALL_START, N_SECTORS)
            costs.append(cost)
        for n in (9, 18, 36):
            if n > most:
                continue
            case, ring = ring_of(n)
            cost, _ = measure(program, f"annulus of {n}", case, n * ring.width, n * pairs,
                                  POINTS_OF_ANNULUS, 1, sectors=n)
            costs.append(cost)
    return costs


def table(costs: dict[int, list[Cost]]) -> str:
    lines = ["| harmonics | structure | dofs | unknowns | Newton steps | ms a point "
             "| to the plain one | a sector, to the wave | memory [MB] |",
             "|---|---|---|---|---|---|---|---|---|"]
    for n_harmonics, rows in costs.items():
        for row in rows:
            lines.append(f"| {n_harmonics} | {row.name} | {row.dofs} | {row.unknowns} | "
                         f"{row.steps:.1f} | {row.milliseconds:.2f} | "
                         f"{row.milliseconds / rows[0].milliseconds:.2f} | "
                         f"{row.milliseconds / row.sectors / rows[1].milliseconds:.2f} | "
                         f"{row.memory:.0f} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=Path, default=ROOT / "build" / "release" / "fw_run")
    parser.add_argument("--disk", type=Path,
                        default=ROOT / "example" / "shrouded_disk" / "disk.h5")
    parser.add_argument("--most", type=int, default=9, help="sectors of an annulus")
    parser.add_argument("--harmonics", type=int, nargs="+", default=[3, 7, 15])
    parser.add_argument("--page", type=Path, default=PAGE)
    parser.add_argument("--roots", action="store_true", help="blade roots instead")
    parser.add_argument("--before", type=Path, help="the program that --roots compares with")
    parser.add_argument("--folder", type=Path, help="where --roots keeps its models")
    parser.add_argument("--pairs", type=int, nargs="+", default=list(ROOT_PAIRS))
    arguments = parser.parse_args()
    if arguments.roots:
        if arguments.before is None:
            parser.error("--roots needs --before")
        with tempfile.TemporaryDirectory() as place:
            roots = [measure_root(arguments.before.resolve(), arguments.program.resolve(),
                                  arguments.folder or Path(place), pairs, n)
                     for pairs in arguments.pairs for n in ROOT_HARMONICS]
        print(root_table(roots))
        write(arguments.page, ROOT_BEGIN, ROOT_END, root_table(roots))
        return
    costs = {}
    for position, n_harmonics in enumerate(arguments.harmonics):
        # Annuli and sectors that differ once: with more harmonics they take minutes.
        most = arguments.most if position == 0 else 1
        costs[n_harmonics] = measure_all(arguments.program.resolve(), arguments.disk, n_harmonics,
                                         most)
        print(table({n_harmonics: costs[n_harmonics]}), flush=True)
    write(arguments.page, BEGIN, END, table(costs))


def write(page: Path, begin: str, end: str, found: str) -> None:
    """A table between its marks."""
    before, rest = page.read_text().split(begin)
    page.write_text(f"{before}{begin}\n\n{found}\n\n{end}{rest.split(end)[1]}")


if __name__ == "__main__":
    main()
