"""From blades measured on a bench to the blade that breaks first.

    python job.py [--folder job] [--disks 300] [--starts 3]

Writes results, pictures and report.txt into the folder.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np

import fretwear as fw
from fretwear.plot import (
    plot_blades,
    plot_campbell_result,
    plot_content,
    plot_haigh,
    plot_population,
)

HERE = Path(__file__).resolve().parent
#: Engine order, its load [N] on each blade, and what the material endures and bears [MPa].
ORDER, LOAD, ENDURANCE, ULTIMATE = 4, 2.3, 250.0, 900.0
#: Radii between which the blade lies [mm].
RIM, SHROUD = 120.0, 200.0
#: 0.1 % of damping at 415 Hz [s].
DAMPING = 8e-7
SPEEDS = {"start": 300.0, "end": 1000.0, "n_speeds": 8}
#: Of the frequency of the crossing: where the first family of the disk lies.
AROUND = (0.975, 1.045)


def make_disk(folder: Path) -> Path:
    """The sector with its blade modes and stress, its shrouds worn apart: without pairs. Stress is
    asked for inside of the elements of the blade alone: at corners it is that of the mesh."""
    path = folder / "disk.h5"
    subprocess.run([sys.executable, "-m", "fretwear.disk", "--blade", "3", "--stress", "-q", "-o",
                    path], check=True)
    with h5py.File(path, "r+") as file:
        del file["contact"]
        radius = np.hypot(*file["stress/position"][:, :2].T)
        kept = (file["stress/mesh_point"][()] < 0) & (radius > RIM) & (radius < SHROUD)
        for name in list(file["stress"]):
            values = file[f"stress/{name}"][kept]
            del file[f"stress/{name}"]
            file[f"stress/{name}"] = values
    return path


def read_bench(path: Path, disk: Path) -> Any:
    """By which part the frequencies of every blade are above those of the model (36, 3)."""
    measured = np.genfromtxt(path, delimiter=",", skip_header=2)[:, 1:]
    with h5py.File(disk) as file:
        nominal = file["mistuning/row_omega"][()] / (2.0 * np.pi)
    return measured / nominal - 1.0


class Job:
    """The cases of the job and what they tell, line by line."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.disk = make_disk(folder)
        self.bench = read_bench(HERE / "blades.csv", self.disk)
        self.lines: list[str] = []
        self.facts: dict[str, float] = {}

    def tell(self, name: str, value: float, text: str) -> None:
        """Keep a number and its line."""
        self.facts[name] = value
        self.lines.append(text)
        print(text, flush=True)

    def case(self, analysis: str, **groups: Any) -> fw.Case:
        """A case of the disk."""
        more = {"case": {"analysis": analysis}, "harmonics": {"n_harmonics": 1},
                "load": {"harmonic_scale": LOAD}, "stress": {"output": "none"}} | groups
        more["structure"] = {"rayleigh_stiffness": DAMPING} | groups.get("structure", {})
        return fw.Case(self.disk, **more)

    def run(self, name: str, case: fw.Case) -> fw.Result:
        """The result in the folder."""
        return fw.run(case, self.folder / f"{name}.h5")

    def draw(self, name: str, figure: Any) -> None:
        """A picture in the folder."""
        figure.savefig(self.folder / f"{name}.png")

    def campbell(self) -> float:
        """Where the order meets the first family: frequency of the crossing [rad/s]."""
        found = self.run("campbell", self.case("campbell", campbell={
            **SPEEDS, "orders": [ORDER, 6], "peaks": True, "n_points": 21}, cyclic={"n_modes": 2}))
        self.draw("campbell", plot_campbell_result(found))
        omega = float(found["campbell/crossing/omega"][0])
        speed = float(found["campbell/crossing/speed"][0])
        self.tell("speed", speed, f"order {ORDER} meets the first family at {speed:.1f} rad/s "
                                  f"({30.0 * speed / np.pi:.0f} rpm), {omega / 2 / np.pi:.1f} Hz")
        peak = float(found["campbell/peak/amplitude"][0, 0])
        self.tell("tuned", peak, f"tuned peak of the tip along the order: {peak:.3f} mm")
        return omega

    def around(self, omega: float, n_points: int) -> dict[str, Any]:
        """Groups of all blades at the speed of the crossing."""
        low, high = (factor * omega for factor in AROUND)
        return {"cyclic": {"engine_order": ORDER, "mistuned": True},
                "structure": {"rotation_speed": self.facts["speed"]},
                "sweep": {"start": low, "end": high, "n_points": n_points}}

    def blades(self, omega: float) -> None:
        """All blades over the frequency, and their stress at their highest points."""
        pattern = {"frequency": self.bench.ravel().tolist()}
        groups = self.around(omega, 281)
        found = self.run("blades", self.case("frf", mistuning=pattern, **groups))
        self.draw("blades", plot_blades(found))
        self.draw("content", plot_content(found))
        tips = found["peak/amplitude"] if "peak/amplitude" in found else found["blades/largest"]
        largest = float(tips.max())
        self.tell("largest", largest, f"largest tip of the measured disk: {largest:.3f} mm, "
                                      f"{largest / self.facts['tuned']:.3f} times the tuned one")
        stress = {"endurance": ENDURANCE, "ultimate": ULTIMATE, "output": "points"}
        # Where the five blades that move most do so.
        size = found.sector_amplitude[:, :, 0]
        rows = np.unique(size.argmax(axis=0)[np.argsort(-size.max(axis=0))[:5]])
        groups["sweep"] = {"values": np.sort(found.omega[rows]).tolist()}
        judged = self.run("stress", self.case("frf", mistuning=pattern,
                                              **groups | {"stress": stress}))
        self.draw("haigh", plot_haigh(judged))
        use = judged["stress/utilisation"].reshape(judged.n_points, 36, -1)
        each = use.max(axis=(0, 2))
        blade, point = divmod(int(use.max(axis=0).argmax()), use.shape[2])
        second = int(np.argsort(-each)[1])
        with h5py.File(self.disk) as file:
            place = file["stress/position"][point]
        self.tell("use", float(each.max()), f"blade {blade} breaks first: utilisation "
                  f"{each.max():.3f} at point {point} (x, y, z = {place[0]:.1f}, {place[1]:.1f}, "
                  f"{place[2]:.1f} mm), the next is blade {second} with {each[second]:.3f}")
        self.facts["blade"] = blade
        tuned = self.case("frf", mistuning={"scale": 0.0}, **self.around(omega, 71) | {
            "stress": stress, "sweep": {"start": 0.99 * omega, "end": 1.01 * omega,
                                        "n_points": 41}})
        alone = float(self.run("tuned", tuned)["stress/utilisation"].max())
        self.tell("tuned_use", alone, f"utilisation of the tuned disk: {alone:.3f}")

    def others(self, omega: float, disks: int, starts: int) -> None:
        """Where the measured disk stands among drawn ones, and the worst of a box."""
        case = self.case("population", **self.around(omega, 71))
        deviation = float(self.bench.std())
        file = self.folder / "population.h5"
        found = fw.population(case, disks, seed=1, deviation=deviation, file=file)
        self.draw("population", plot_population(fw.Result(file), "tip"))
        half, most, nearly_all = found.quantiles()[0]
        self.tell("median", float(half[0]), f"{disks} drawn disks with {100 * deviation:.2f} %: "
                  f"amplification {half[0]:.3f} [{half[1]:.3f}, {half[2]:.3f}] at 50 %, "
                  f"{most[0]:.3f} [{most[1]:.3f}, {most[2]:.3f}] at 95 %, "
                  f"{nearly_all[0]:.3f} [{nearly_all[1]:.3f}, {nearly_all[2]:.3f}] at 99 %")
        own = float(fw.population(case, self.bench[None]).amplification[0, 0])
        below = float((found.amplification[:, 0] < own).mean())
        self.tell("below", below, f"{100 * below:.0f} % of them stay below the measured disk "
                                  f"({own:.3f})")
        if starts > 0:
            first = np.clip(found.patterns[np.argsort(-found.amplification[:, 0])[:starts]],
                            -2.0 * deviation, 2.0 * deviation)
            worst = fw.worst_pattern(case, 2.0 * deviation, starts=first)
            self.tell("worst", worst.amplification, f"{worst}; box {200 * deviation:.2f} %, from "
                                                    "the worst of the drawn disks")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("job"))
    parser.add_argument("--disks", type=int, default=300)
    parser.add_argument("--starts", type=int, default=3)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    job = Job(options.folder.absolute())
    omega = job.campbell()
    job.blades(omega)
    job.others(omega, options.disks, options.starts)
    (options.folder / "report.txt").write_text("\n".join(job.lines) + "\n")


if __name__ == "__main__":
    main()
