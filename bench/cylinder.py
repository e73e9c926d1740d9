"""A cylinder on a flat against closed forms and a march of cycles: docs/cylinder_on_flat.md.

    python -m bench.cylinder [PART ...] [--build build/release] [--count 60] [-o docs/...]

Parts: gross, partial, random, large, thousand; the first three without any. A part replaces its
section. The last two are fine grids, which take minutes and many minutes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.common.document import with_origin
from bench.common.layout import new_figure, table, wrapped
from bench.common.measure import ROOT, Bench, Floats, Groups, describe_machine

sys.path[:0] = [str(ROOT / "test" / "support"), str(ROOT / "test" / "fretting")]

from cylinder_family import WORDS, verdict  # noqa: E402
from scar_cases import Scar, groups, led, left_in_the_end, pressed  # noqa: E402
from sections import write_section  # noqa: E402

from fretwear import Model, Result  # noqa: E402
from fretwear.halfplane import Cylinder, PartialSlip, gross_slip, partial_slip  # noqa: E402
from fretwear.plot.style import PALETTE, tidy  # noqa: E402

CYLINDER = Cylinder()
HALF = PartialSlip(CYLINDER, 0.5 * CYLINDER.mu * CYLINDER.load)
AMPLITUDE, REACH, WEAR, DATUM = 0.0125, 0.3, 1e-7, 6.0
CYCLES = (100.0, 1000.0, 5000.0, 18000.0)
#: Cells and harmonics of partial slip; the second list takes minutes.
GRIDS = ((30, 7), (60, 7), (120, 7), (60, 3), (120, 3), (60, 15))
FINE = {"large": ((240, 3), (240, 7), (480, 3), (480, 7)), "thousand": ((996, 3), (996, 7))}
PARTS = ("gross", "partial", "random", *FINE)
MICRO = 1e3


@dataclass(frozen=True)
class Worn:
    """A result, and the processor time that it took [s]."""

    result: Result
    seconds: float

    @property
    def depth(self) -> Floats:
        """Of the last row [length]."""
        found: Floats = self.result["wear/depth"][-1]
        return found

    @property
    def steps(self) -> int:
        """Rows beyond the first."""
        return len(self.result["wear/cycles"]) - 1

    @property
    def remarks(self) -> str:
        """Their names."""
        found = self.result
        if "remarks/name" not in found:
            return "-"
        return ", ".join(sorted({str(name) for name in found["remarks/name"]}))


def run(bench: Bench, name: str, model: Model, scar: Scar, n_harmonics: int,
        **wear: object) -> Worn:
    """A case of which nothing else is chosen."""
    path = bench.folder / f"{name}_model.h5"
    model.to_hdf5(path)
    keys: Groups = groups(scar, n_harmonics, str(path), **wear)
    if "n_cycles" not in wear:
        del keys["wear"]["steady_tolerance"]
    keys["output"] = {"observe": ["approach"]}
    result = bench.folder / f"{name}.h5"
    _, seconds = bench.execute(keys, result)
    return Worn(Result(result), seconds)


def gross(bench: Bench, pictures: Path) -> list[str]:
    """Depth, volume and pressure over the cycles of gross slip."""
    scar = Scar(60, 0.01, CYLINDER.contact_modulus, CYLINDER.radius, CYLINDER.load, CYLINDER.mu,
                0.0, WEAR, datum=DATUM)
    model = gross_slip(CYLINDER, AMPLITUDE, n=scar.n, half_width=REACH, datum=DATUM)
    rows, profiles, balance = [], {}, 0.0
    for n_harmonics, cycles in [(15, cycles) for cycles in CYCLES] + [(7, CYCLES[-1])]:
        worn = run(bench, f"gross_{n_harmonics}_{cycles:g}", model, scar, n_harmonics,
                   n_cycles=cycles)
        true = led(scar, AMPLITUDE, cycles)
        force, _ = pressed(scar.compliance(), scar.gap + true, scar.load)
        pressure = -worn.result["contact/force"][-1, 0, :, 2].min() / scar.cell
        volume, wanted = worn.depth.sum() * scar.cell, true.sum() * scar.cell
        cut = (1.5 * CYLINDER.radius * volume)**(2.0 / 3.0) / (2.0 * CYLINDER.radius)
        whole = 4.0 * AMPLITUDE * WEAR * CYLINDER.load * cycles
        rate = worn.result["wear/rate"].sum(axis=1) * scar.cell * scar.mu
        work = WEAR * worn.result["contact/dissipation"].sum(axis=1)
        balance = max(balance, float(abs(rate / work - 1.0).max()))
        rows.append([n_harmonics, f"{cycles:g}", f"{MICRO * worn.depth.max():.4f}",
                     percent(worn.depth.max() / true.max() - 1.0), f"{volume:.4e}",
                     percent(volume / wanted - 1.0), percent(volume / whole - 1.0),
                     percent(worn.depth.max() / cut - 1.0), f"{pressure:.1f}",
                     percent(pressure / (force.max() / scar.cell) - 1.0), worn.steps,
                     f"{worn.seconds:.1f}"])
        if n_harmonics == 15:
            profiles[cycles] = worn.depth, true
    draw_gross(scar, profiles, pictures / "cylinder_gross.png")
    return ["## Gross slip, measured", "",
            *table(["H", "cycles", "depth [um]", "to the march", "volume [mm^2]", "to the march",
                    "to k P 4 u N", "depth to a flat cut of this volume", "largest pressure [MPa]",
                    "to the march", "steps", "processor time [s]"], rows), "",
            "Rate times area times mu over k times the dissipation, summed over the pairs, is 1 "
            f"within {balance:.1e} in every row of these runs."]


def partial(bench: Bench, grids: tuple[tuple[int, int], ...], title: str
            ) -> Iterator[tuple[list[str], dict[tuple[int, int], Worn]]]:
    """Steady states of grids: the lines so far, and the results."""
    rows: list[list[object]] = []
    runs: dict[tuple[int, int], Worn] = {}
    volume: dict[tuple[int, int], float] = {}
    for n, n_harmonics in grids:
        cell = 6.0 * HALF.stick_half_width / n
        scar = Scar(n, cell, CYLINDER.contact_modulus, CYLINDER.radius, CYLINDER.load, CYLINDER.mu,
                    HALF.tangential_load, WEAR)
        worn = run(bench, f"partial_{n}_{n_harmonics}", partial_slip(HALF, n=n), scar, n_harmonics)
        true, stuck = left_in_the_end(scar)
        runs[n, n_harmonics] = worn
        volume[n, n_harmonics] = worn.depth.sum() * cell
        half = volume.get((n // 2, n_harmonics))
        rows.append([n, n_harmonics, f"{abs(worn.depth - true).max() / true.max():.1e}",
                     int(np.count_nonzero(worn.depth[stuck])),
                     f"{volume[n, n_harmonics] / HALF.volume:.4f}",
                     f"{worn.depth.max() / HALF.largest_depth:.4f}",
                     "-" if half is None else
                     f"{(2.0 * volume[n, n_harmonics] - half) / HALF.volume:.4f}",
                     worn.remarks, worn.steps, f"{worn.seconds:.1f}"])
        yield [title, "",
               *table(["cells", "H", "profile, off by", "stuck cells that wore",
                       "volume to the closed form", "depth to it", "volume of two grids",
                       "remarks", "steps", "processor time [s]"], rows)], runs


def random(bench: Bench, count: int) -> list[str]:
    """Verdicts of the family."""
    rows = []
    for n_harmonics in (3, 7):
        words, worst, told = dict.fromkeys(WORDS, 0), 0.0, set()
        for seed in range(count):
            word, error, remarks = verdict(bench.folder, seed, n_harmonics, bench.program)
            words[word] += 1
            told |= set(remarks)
            if word == WORDS[0]:
                worst = max(worst, error)
            elif word == WORDS[3]:
                print(f"H = {n_harmonics}, seed {seed}: {word}, {error:.1e}", file=sys.stderr)
        rows.append([n_harmonics, *words.values(), f"{worst:.1e}", ", ".join(sorted(told)) or "-"])
    return ["## Random cylinders, measured", "",
            f"{count} cylinders (radius 1 to 50 mm, E 50 to 320 GPa, load 3 to 50 N/mm, mu 0.2 to "
            "1, 20 to 80 % of the load that makes it slide, 48 cells and more) to the steady "
            "state by the defaults. Right: profile and volume within 1e-3 of what the linear "
            "problem leaves.", "",
            *table(["H", *WORDS, "largest error of those that are right without a remark",
                    "remarks"], rows)]


def draw_gross(scar: Scar, profiles: dict[float, tuple[Floats, Floats]], path: Path) -> None:
    """The scar at some cycles, and the march."""
    figure, axes = new_figure()
    for colour, (cycles, (depth, true)) in zip(PALETTE, profiles.items()):
        axes.plot(scar.place, -MICRO * depth, color=colour, label=f"{cycles:g} cycles")
        axes.plot(scar.place, -MICRO * true, "o", color=colour, markersize=2.5)
    axes.set(xlabel="x [mm]", ylabel="scar [µm]")
    tidy(axes)
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=90)


def draw_partial(worn: Worn, n: int, path: Path) -> None:
    """The scar in the end and the pressure, with their closed forms."""
    cell = 6.0 * HALF.stick_half_width / n
    place = (np.arange(n) - 0.5 * (n - 1)) * cell
    fine = np.linspace(-1.8, 1.8, 1200) * HALF.stick_half_width
    figure, axes = new_figure()
    axes.plot(fine, MICRO * HALF.depth(fine), color=PALETTE[0], label="depth, closed form")
    axes.plot(place, MICRO * worn.depth, "o", color=PALETTE[0], markersize=3,
              label=f"depth, {n} cells")
    right = axes.twinx()
    inside = abs(fine) < 0.995 * HALF.stick_half_width
    right.plot(fine[inside], HALF.pressure(fine[inside]), color=PALETTE[1],
               label="pressure, closed form")
    right.plot(place, -worn.result["contact/force"][-1, 0, :, 2] / cell, "s", color=PALETTE[1],
               markersize=3, label=f"pressure, {n} cells")
    axes.set(xlabel="x [mm]", ylabel="depth [µm]", xlim=(-0.047, 0.047))
    right.set(ylabel="pressure [MPa]", ylim=(0.0, None))
    tidy(axes)
    handles = [*axes.lines, *right.lines]
    axes.legend(handles, [line.get_label() for line in handles], frameon=False, fontsize=8,
                loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
    figure.savefig(path, dpi=90)


def percent(value: float) -> str:
    """With its sign."""
    return f"{100.0 * value:+.2f} %"


def main() -> int:
    """Measure, and write the sections of the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", default=list(PARTS[:3]),
                        help=f"{', '.join(PARTS)} (default: the first three)")
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release")
    parser.add_argument("--count", type=int, default=60, help="random cylinders")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "cylinder_on_flat.md")
    options = parser.parse_args()
    unknown = [part for part in options.parts if part not in PARTS]
    if unknown:
        parser.error(f"no part {unknown[0]!r}; choose from {', '.join(PARTS)}")
    pictures = options.output.parent / "images"
    pictures.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        bench = Bench(options.build.resolve() / "fw_run", Path(name))

        def measured(section: str, lines: list[str], machine: dict[str, str]) -> None:
            text = wrapped(with_origin("\n".join(lines), machine))
            write_section(section, ["", *text.split("\n"), ""], options.output)
            print(text, flush=True)

        for part in options.parts:
            machine = describe_machine(options.build)
            if part == "gross":
                measured(part, gross(bench, pictures), machine)
            elif part == "partial":
                *_, (lines, runs) = partial(bench, GRIDS, "## Partial slip, measured")
                draw_partial(runs[120, 7], 120, pictures / "cylinder_partial.png")
                measured(part, lines, machine)
            elif part == "random":
                measured(part, random(bench, options.count), machine)
            else:
                # Kept as they come: the last take longer than all others.
                title = {"large": "## Large grids, measured", "thousand": "## A thousand cells"}
                for lines, _ in partial(bench, FINE[part], title[part]):
                    measured(part, lines, machine)
    return 0


if __name__ == "__main__":
    sys.exit(main())
