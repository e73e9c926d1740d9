"""Figures of the shrouded disk: tables and pictures of docs/shrouded_disk.md.

    python -m bench.disk [--build build/release] [--pictures] [-o docs/shrouded_disk.md]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "test" / "support"), str(ROOT / "python"), str(ROOT)]

from sections import write_section  # noqa: E402

from fretwear import Result  # noqa: E402
from fretwear.plot import (  # noqa: E402
    plot_campbell,
    plot_damping,
    plot_nodal_diameters,
    plot_safe,
    plot_wave,
    plot_wear_evolution,
    read_damping,
)

EXAMPLE = ROOT / "example" / "shrouded_disk"
#: An early sketch of this disk [Hz]: first family open, closed, second open.
DRAWN = {0: (387.9, 657.9, 852.1), 1: (388.5, 863.7, 851.7), 2: (388.8, 898.8, 869.4),
         3: (388.9, 1037.3, 929.2), 4: (388.8, 1288.3, 1000.5), 6: (388.7, 2090.3, 1087.7),
         9: (388.5, 3894.0, 1138.7), 12: (388.4, 3904.0, 1159.8), 18: (388.3, 3478.9, 1172.1)}
LOADS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 50.0, 100.0, 200.0, 300.0)
#: A load that moves nothing but a linear structure, under a preload that no friction lets go.
TINY = ("load%harmonic_scale=1e-3", "contact%mu=100")
SPEEDS = (0.0, 250.0, 500.0, 750.0, 1000.0)

Run = Callable[..., Result]


def runner(program: Path, folder: Path) -> Run:
    """What runs a namelist of the example with settings."""
    def run(name: str, case: str, *settings: str) -> Result:
        target = folder / f"{name}.h5"
        words = [word for setting in settings for word in ("--set", setting)]
        done = subprocess.run([program, "-q", *words, "-o", target, EXAMPLE / case],
                              capture_output=True, text=True, check=False)
        if done.returncode not in (0, 4):
            raise SystemExit(f"{name}: {done.stderr}")
        return Result(target)
    return run


def sweep(first: float, last: float, n: int) -> tuple[str, ...]:
    """Settings of a sweep [Hz]."""
    return f"sweep%start={first}", f"sweep%end={last}", f"sweep%n_points={n}"


def frequencies(result: Result) -> list[str]:
    """The nodal-diameter diagram against the drawing."""
    lines = ["", "| nodal diameter | first, open | drawn | first, closed | drawn | second, open "
             "| drawn |", "|---" * 7 + "|"]
    opened, closed = (result[f"modes/{state}"] / (2.0 * np.pi) for state in ("open", "closed"))
    worst = np.zeros(3)
    for k, drawn in DRAWN.items():
        found = (opened[k, 0], closed[k, 0], opened[k, 1])
        worst = np.maximum(worst, np.abs(np.array(found) / np.array(drawn) - 1.0))
        cells = [f"{value:.1f}" for pair in zip(found, drawn) for value in pair]
        lines.append(f"| {k} | {' | '.join(cells)} |")
    lines.append("| largest difference | " + " | ".join(
        f"{100.0 * share:.2f} % | " for share in worst) + " |")
    return [*lines, ""]


def window(load: float, *, is_up: bool = False) -> tuple[str, ...]:
    """Settings of the sweep under a load; down, from where the shrouds are shut. Narrow peaks
    need more points."""
    first, last, n = (1300.0, 1240.0, 241) if load < 5.0 else (1400.0, 600.0, 401)
    return sweep(last, first, n) if is_up else sweep(first, last, n)


def limits(run: Run) -> tuple[Result, Result]:
    """Linear sweeps, with all pairs closed and with all open."""
    return (run("linear", "wave.nml", *sweep(1280, 1292, 241), *TINY),
            run("open", "wave.nml", *sweep(386, 390, 161), *TINY, "contact%gap=1"))


def sweeps_of(run: Run, n_harmonics: int, *, is_up: bool = False) -> list[Result]:
    """One sweep for each load."""
    way = "up" if is_up else "down"
    return [run(f"{way}_{n_harmonics}_{load:g}", "wave.nml", *window(load, is_up=is_up),
                f"harmonics%n_harmonics={n_harmonics}", f"load%harmonic_scale={load}")
            for load in LOADS]


def draw_damping(run: Run, down: list[Result]) -> Figure:
    """Peaks with one harmonic of sweeps down and up, between the linear limits."""
    names = "pairs closed", "pairs open"
    return plot_damping(down, upwards=sweeps_of(run, 1, is_up=True),
                        linear=list(zip(names, limits(run))))


def damping(run: Run) -> tuple[list[str], list[Result]]:
    """Peaks with one and with five harmonics, and the sweeps with one."""
    rows = {n: sweeps_of(run, n) for n in (1, 5)}
    linear, opened = limits(run)
    lines = ["", "| load [N] | H = 1: tip/load [mm/N] | at [Hz] "
             "| H = 5: tip/load | at [Hz] | converged |", "|---" * 6 + "|"]
    size, at = read_damping([linear])[0, 2:4]
    lines.append(f"| linear, closed | {size:.2e} | {at:.1f} |  |  |  |")
    for one, five in zip(rows[1], rows[5]):
        first, second = read_damping([one])[0], read_damping([five])[0]
        lines.append(f"| {first[0]:g} | {first[2]:.2e} | {first[3]:.0f} "
                     f"| {second[2]:.2e} | {second[3]:.0f} "
                     f"| {five.converged.sum()} of {five.n_points} |")
    size, at = read_damping([opened])[0, 2:4]
    lines.append(f"| linear, open | {size:.2e} | {at:.1f} |  |  |  |")
    return [*lines, ""], rows[1]


def wear(run: Run, folder: Path) -> tuple[list[str], Result]:
    """The resonance as the shrouds wear."""
    worn = run("wear", "wear.nml")
    lines = ["", "| cycles | depth, inner patches [mm] | outer ones | preload, inner [N] "
             "| outer | resonance [Hz] | tip/load [mm/N] |", "|---" * 7 + "|"]
    n = len(worn.cycles)
    for row in sorted({0, n // 4, n // 2, 3 * n // 4, n - 1}):
        found = run(f"worn_{row}", "wave.nml", *sweep(1300, 1100, 401),
                    f"contact%worn='{folder / 'wear.h5'}'", f"contact%worn_step={row + 1}")
        size, at = read_damping([found])[0, 2:4]
        depth, press = worn.depth[row], -worn.force[row, 0, :, 2]
        lines.append(f"| {worn.cycles[row]:.2e} | {depth[:2].mean():.1e} | {depth[2:].mean():.1e} "
                     f"| {press[:2].sum():.0f} | {press[2:].sum():.0f} | {at:.1f} | {size:.2e} |")
    return [*lines, ""], worn


def main() -> int:
    """Run everything and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "shrouded_disk.md")
    parser.add_argument("--pictures", action="store_true",
                        help="draw the pictures again and leave the tables")
    options = parser.parse_args()
    images = options.output.parent / "images"

    def draw(name: str, figure: Figure) -> None:
        figure.savefig(images / f"disk_{name}.png")

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = runner(options.build.absolute() / "fw_run", folder)
        modes = [run(f"modes_{speed:g}", "wave.nml", "case%analysis=modes",
                     f"model%rotation_speed={speed}") for speed in SPEEDS]
        if not options.pictures:
            write_section("frequencies", frequencies(modes[0]), options.output)
        draw("nodal_diameters", plot_nodal_diameters(modes[0]))
        draw("safe", plot_safe(modes[1]))
        draw("campbell", plot_campbell(modes, 4))
        if options.pictures:
            down = sweeps_of(run, 1)
        else:
            lines, down = damping(run)
            write_section("damping", lines, options.output)
        draw("damping", draw_damping(run, down))
        wave = run("wave", "wave.nml")
        draw("wave", plot_wave(wave, int(np.abs(wave.harmonic(1)).argmax())))
        if options.pictures:
            worn = run("wear", "wear.nml")
        else:
            lines, worn = wear(run, folder)
            write_section("wear", lines, options.output)
        draw("wear", plot_wear_evolution(worn))
    return 0


if __name__ == "__main__":
    sys.exit(main())
