"""Figures of a wedge between two blades: tables and picture of docs/damper.md.

    python -m bench.dampers [--build build/release] [-o docs/damper.md]
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "test" / "support"), str(ROOT / "python"), str(ROOT)]

from sections import write_section  # noqa: E402

import fretwear as fw  # noqa: E402
from fretwear._namelist import write_namelist  # noqa: E402
from fretwear.plot import plot_damper  # noqa: E402

#: Loads of the body over that of its mass at the speed, and the masses of the sweep.
SCALES = (0.005, 0.03, 0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 10.0, 100.0)
MASSES = np.geomspace(0.007, 0.02, 101)
STIFFNESS = np.diag([9e3, 2e4, 1e4, 1.9e4])
TANGENTIAL, NORMAL = 2e4, 3e4


def blades(**more: object) -> fw.Model:
    """Two blades of two dofs, excited out of phase."""
    return fw.Model(np.eye(4), 1e-3 * STIFFNESS, STIFFNESS, cosine=[8.0, 0.0, -5.6, 1.6],
                    observe={"blade 1": 1, "blade 2": 3}, **more)  # type: ignore[arg-type]


def wedge(mass: float) -> fw.Model:
    """The blades with a wedge at 50 degrees, two points on each flank."""
    return fw.damper(
        blades(), "wedge", mass=mass, inertia=1e-5 * mass, radius=0.2, angles=(50.0, 50.0),
        left=fw.Flank([[1, 2], [1, 2]], [[-0.01, 0.0], [-0.01, 0.004]]),
        right=fw.Flank([[3, 4], [3, 4]], [[0.01, 0.0], [0.01, 0.004]]), mu=0.3,
        tangential_stiffness=TANGENTIAL, normal_stiffness=NORMAL, law="penalty")


def stuck(model: fw.Model) -> fw.Model:
    """Linear springs in place of the pairs."""
    assert model.contact is not None
    sides = zip(np.asarray(model.contact.side_1), np.asarray(model.contact.side_2))
    springs = [fw.Spring(int(one), int(other), NORMAL if c == 2 else TANGENTIAL, 1)
               for first, second in sides for c, (one, other) in enumerate(zip(first, second))
               if one != 0]
    return fw.Model(model.M, model.C, model.K, rows=model.rows, springs=springs,
                    bodies=model.bodies, cosine=model.cosine, observe=model.observe)


class Runs:
    """Sweeps in a folder."""

    def __init__(self, program: Path, folder: Path) -> None:
        self._program, self._folder = program, folder

    def __call__(self, model: fw.Model, speed: float, *settings: str) -> fw.Result:
        model.to_hdf5(self._folder / "model.h5")
        case = {"case": {"analysis": "frf"},
                "model": {"source": "hdf5", "file": "model.h5", "rotation_speed": speed},
                "harmonics": {"n_harmonics": 5},
                "sweep": {"start": 85.0, "end": 105.0, "n_points": 101},
                "solver": {"tolerance": 1e-9}}
        (self._folder / "case.nml").write_text(write_namelist(case))
        words = [word for setting in settings for word in ("--set", setting)]
        done = subprocess.run([self._program, "-q", *words, "case.nml"], cwd=self._folder,
                              capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise SystemExit(f"{settings}: {done.stderr}")
        return fw.Result(self._folder / "case.h5")


def peak(result: fw.Result) -> tuple[float, float]:
    """Largest first harmonic of blade 1 and its frequency [rad/s], of a parabola of three rows."""
    size = np.abs(result.harmonic(1, "blade 1"))
    i = int(np.clip(size.argmax(), 1, len(size) - 2))
    curve = np.polynomial.Polynomial.fit(result.omega[i - 1:i + 2], size[i - 1:i + 2], 2)
    top = float(curve.deriv().roots()[0].real)
    return float(curve(top)), top


def performance(run: Runs) -> list[str]:
    """Peaks over the load that presses the body, between those of linear structures."""
    light = wedge(2e-5)
    free, held = peak(run(blades(), 0.0)), peak(run(stuck(light), 1000.0))
    rows = [("no body", *free)]
    rows += [(f"{scale:g}", *peak(run(light, 1000.0, f"load%static_scale={scale}")))
             for scale in SCALES]
    rows += [("springs", *held)]
    lines = ["| load of the body | peak of blade 1 | at [rad/s] |", "|---|---|---|"]
    lines += [f"| {name} | {top:.6f} | {omega:.3f} |" for name, top, omega in rows]
    ends = [abs(rows[k][1] / rows[j][1] - 1.0) for k, j in ((1, 0), (-2, -1))]
    return ["", *lines, "", f"The ends differ from the linear results by {ends[0]:.1e} and "
                            f"{ends[1]:.1e}.", ""]


def optimum(run: Runs, folder: Path) -> list[str]:
    """The mass of the smallest peak, by its derivative and by a sweep over masses."""
    tops = [peak(run(wedge(mass), 100.0))[0] for mass in MASSES]
    best = int(np.argmin(tops))
    run(wedge(0.02), 100.0)
    case = fw.Case.from_file(folder / "case.nml")
    found = fw.optimise(case, over="body%mass", minimise="max_first_harmonic[blade 1]",
                        bounds=(float(MASSES[0]), float(MASSES[-1])))
    return ["", f"The smallest peak of {len(MASSES)} masses is {tops[best]:.5e} at a mass of "
                f"{MASSES[best]:.5f}.", "`fretwear optimise --over body%mass` comes to "
                f"{float(found.value):.5e} at {float(found.values[0]):.5f}.", ""]


def sector(nodes: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass, stiffness and load of a blade in a sector: nodes of its left and its right side."""
    n = 2 * nodes
    along = 2e4 * (n * np.eye(n) - np.ones((n, n)))
    stiffness = np.kron(along, np.eye(2))
    stiffness += np.kron(np.diag(1.0 + 0.02 * np.arange(n)), np.diag([9e3, 2e4])) / n
    return np.eye(2 * n) / n, stiffness, np.tile([8.0 / n, 0.0], n)


def strip(mass: float, by_rows: bool) -> fw.Model:
    """A strip under four nodes that does not turn, made by `fretwear.damper`, which acts on rows,
    or with dofs alone."""
    M, K, load = sector(2)
    common = {"sectors": fw.Sectors(12), "observe": {"blade": 1}}
    if by_rows:
        return fw.damper(fw.Model(M, 1e-3 * K, K, cosine=load, **common),  # type: ignore[arg-type]
                         "strip", mass=mass, radius=0.2, angles=(90.0, 90.0), mu=0.3,
                         tangential_stiffness=TANGENTIAL, normal_stiffness=NORMAL, law="penalty",
                         left=fw.Flank([[5, 6], [7, 8]], [[-0.01, 0.0], [-0.01, 0.004]]),
                         right=fw.Flank([[1, 2], [3, 4]], [[0.01, 0.0], [0.01, 0.004]], sector=1))
    M, K = (np.pad(matrix, (0, 2)) for matrix in (M, K))
    M[8:, 8:] = mass * np.eye(2)
    pairs = fw.ContactPairs(side_1=[[9, 0, -10]] * 4, mu=0.3, tangential_stiffness=TANGENTIAL,
                            side_2=[[5, 0, -6], [7, 0, -8], [1, 0, -2], [3, 0, -4]],
                            sector_2=[0, 0, 1, 1], normal_stiffness=NORMAL, law="penalty")
    return fw.Model(M, 1e-3 * K, K, cosine=np.append(load, [0.0, 0.0]), contact=pairs,
                    static=np.eye(10)[9] * mass * 0.2 * 100.0**2,
                    **common)  # type: ignore[arg-type]


def shroud() -> fw.Model:
    """Four pairs between neighbouring blades, without a body."""
    M, K, load = sector(4)
    press = np.zeros(16)
    press[9::2], press[1:8:2] = -9.8, 9.8
    pairs = fw.ContactPairs(side_1=[[9 + 2 * i, 0, 10 + 2 * i] for i in range(4)],
                            side_2=[[1 + 2 * i, 0, 2 + 2 * i] for i in range(4)], sector_2=[1] * 4,
                            mu=0.3, tangential_stiffness=TANGENTIAL, normal_stiffness=NORMAL,
                            law="penalty")
    return fw.Model(M, 1e-3 * K, K, cosine=load, static=press, sectors=fw.Sectors(12),
                    observe={"blade": 1}, contact=pairs)


def effort(program: Path, folder: Path) -> list[str]:
    """Work and time of a wave with a body, against the same without rows and a shroud."""
    cases = {"strip, by rows": (strip(0.003, True), 100.0),
             "strip, by dofs": (strip(0.003, False), 0.0),
             "shroud, no body": (shroud(), 0.0)}
    times: dict[str, list[float]] = {name: [] for name in cases}
    counts = {}
    alone = {**os.environ, "OMP_NUM_THREADS": "1"}
    # In turn, so that a busy machine is as busy for each.
    for _ in range(5):
        for name, (model, speed) in cases.items():
            model.to_hdf5(folder / "sector.h5")
            keys = {"case": {"analysis": "frf"},
                    "model": {"source": "hdf5", "file": "sector.h5"}, "cyclic": {"engine_order": 2},
                    "harmonics": {"n_harmonics": 7}, "solver": {"tolerance": 1e-9},
                    "sweep": {"start": 85.0, "end": 125.0, "n_points": 1001}}
            if speed > 0.0:
                keys["model"]["rotation_speed"] = speed
            (folder / "wave.nml").write_text(write_namelist(keys))
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            done = subprocess.run([program, "wave.nml"], cwd=folder, capture_output=True,
                                  text=True, check=False, env=alone)
            if done.returncode != 0:
                raise SystemExit(f"{name}: {done.stderr}")
            times[name].append(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before)
            counts[name] = [re.search(pattern, done.stdout) for pattern in
                            (r"iterations +(\d+)", r"(\d+) Krylov")]
    least = min(times["strip, by dofs"])
    rows = [f"| {name} | {' | '.join(count[1] for count in counts[name] if count)} | "
            f"{min(times[name]) / least:.2f} |" for name in cases]
    return ["", "| 1001 points, 7 harmonics, 4 pairs | steps of Newton | iterations of GMRES | "
                "time |", "|---|---|---|---|", *rows, ""]


def main() -> int:
    """Measure, and write the sections of the document."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "damper.md")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = Runs(options.build.resolve() / "fw_run", folder)
        write_section("performance", performance(run), options.output)
        write_section("optimum", optimum(run, folder), options.output)
        write_section("effort", effort(options.build.resolve() / "fw_run", folder), options.output)
        picture = options.output.parent / "images" / "damper.png"
        plot_damper(run(wedge(0.02), 100.0)).savefig(picture, dpi=90)
    return 0


if __name__ == "__main__":
    sys.exit(main())
