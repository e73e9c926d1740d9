"""What inputs that nobody knows well do to an answer: the table of docs/good_for.md.

    python -m bench.good_for [--build build/release] [-o docs/good_for.md]

The blade in its dovetail at 4400 rpm, 0.5 N at the tip: the peak of the response with friction,
interface stiffness, fit, pairs and harmonics changed one at a time.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from bench.common.document import with_origin
from bench.common.layout import table, wrapped
from bench.common.measure import ROOT, Bench, Groups, describe_machine
from bench.common.sector import case
from bench.precision.joints_in_time import pairs_of, swings

sys.path[:0] = [str(ROOT / "test" / "support")]

from sections import write_section  # noqa: E402

START, END, N_POINTS = 1025.0, 1014.0, 111
#: Friction of dry titanium as tests report it, and the law's stiffness [N/mm^3].
FRICTION, LAYERS = (0.3, 0.4, 0.6, 0.7), (1e4, 1e5, 1e6)
#: Deviations of the flanks from their fit [mm], and how often they are drawn.
FITS, DRAWS = (1e-4, 1e-3), 6
HARMONICS = (1, 7, 15)
#: The spring against which stuck pairs find their place from the unstrained assembly.
SCALES = (0.1, 10.0)


@dataclass(frozen=True)
class Peak:
    """Half the swing of the tip [mm], its frequency [Hz], friction energy of its period [N mm]."""

    swing: float
    hertz: float
    energy: float


def peak(bench: Bench, pairs: int = 16, n_harmonics: int = 3, **contact: object) -> Peak:
    """The row of the largest swing, downwards."""
    sweep = {"start": START, "end": END, "n_points": N_POINTS, "unit": "Hz"}
    groups: Groups = case(pairs, n_harmonics, sweep)
    groups["contact"] = {"mu": 0.5, **contact}
    groups["output"] = {"observe": "tip"}
    result = bench.folder / "case.h5"
    bench.execute(groups, result)
    with h5py.File(result) as file:
        kept = file["converged"][()].astype(bool)
        swing = np.where(kept, swings(file["coefficients"][:, :, 0]), 0.0)
        k = int(np.argmax(swing))
        return Peak(float(swing[k]), float(file["omega"][k] / (2.0 * np.pi)),
                    float(file["contact/dissipation"][k].sum()))


def row(name: str, found: Iterable[Peak], usual: Peak) -> list[str]:
    """What a change does, or the range of several."""
    peaks = list(found)

    def span(values: list[float], unit: str) -> str:
        ends = sorted({f"{value:+.2f}" for value in (min(values), max(values))}, key=float)
        return " to ".join(ends) + f" {unit}"

    return [name, span([100.0 * (p.swing / usual.swing - 1.0) for p in peaks], "%"),
            span([100.0 * (p.hertz / usual.hertz - 1.0) for p in peaks], "%"),
            span([100.0 * (p.energy / usual.energy - 1.0) for p in peaks], "%")]


def spread(bench: Bench) -> list[str]:
    """One input at a time."""
    usual = peak(bench)
    rows = [row(f"friction 0.5 to {mu:g}", [peak(bench, mu=mu)], usual) for mu in FRICTION]
    for layer in LAYERS:
        stiffness = [layer * float(area) for area in pairs_of(16)[1]]
        rows.append(row(f"rigid to {layer:g} N/mm^3", [peak(
            bench, law="penalty", tangential_stiffness=stiffness, normal_stiffness=stiffness)],
            usual))
    rows += [row(f"`penalty_scale` 1 to {scale:g}", [peak(bench, penalty_scale=scale)], usual)
             for scale in SCALES]
    for fit in FITS:
        rng = np.random.default_rng(4400)
        draws = [peak(bench, gap=(fit * rng.standard_normal(16)).tolist()) for _ in range(DRAWS)]
        rows.append(row(f"flanks off by {1e3 * fit:g} µm, one sigma, {DRAWS} draws", draws, usual))
    rows.append(row("16 to 48 pairs", [peak(bench, pairs=48)], usual))
    rows += [row(f"H = 3 to {h}", [peak(bench, n_harmonics=h)], usual) for h in HARMONICS]
    return ["### One input at a time, measured", "",
            f"Peak with 16 pairs, `dlft`, friction 0.5, H = 3: {usual.swing:.4f} mm at "
            f"{usual.hertz:.2f} Hz, where friction takes {usual.energy:.3f} N mm in a period.", "",
            *table(["changed", "peak", "its frequency", "friction energy at it"], rows)]


def main() -> int:
    """Measure, and write the section."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "release")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "docs" / "good_for.md")
    options = parser.parse_args()
    machine = describe_machine(options.build)
    with tempfile.TemporaryDirectory() as name:
        lines = spread(Bench(options.build.resolve() / "fw_run", Path(name)))
    text = wrapped(with_origin("\n".join(lines), machine))
    write_section("spread", ["", *text.split("\n"), ""], options.output)
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
