"""Prediction of the higher bending modes of the beam, which the calibration has not seen.

    python higher_modes.py [--document docs/brake_reuss.md]

The bands are those of what is inferred of the beam: lap, bolts, masses, stiffness of the joint, all
drawn anew, with Young's modulus such that the first mode stays where it was measured.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from fit import N_HARMONICS

import fretwear as fw
from fretwear.beam import BeamParameters, ReducedBeam, generate

__all__ = ["draw", "main"]

ROOT = Path(__file__).resolve().parents[2]
N_MODES, N_DRAWS, SEED = 5, 60, 3
#: Standard deviations of what is inferred, relative, and of the driven point [m].
SPREAD = {"lap": 0.03, "bolt_mass": 0.2, "drive_mass": 0.5, "tangential_stiffness": 0.4,
          "thickness": 0.01}
PLACE = 0.003
#: Accelerations of the driven point at which damping is told [m/s^2].
LEVELS = (1.0, 10.0, 100.0)
#: Of two standard deviations.
WIDTH = 1.96


def draw(rng: np.random.Generator, base: BeamParameters, frequency: float) -> ReducedBeam:
    """Another beam that might be this one: its first mode is at the frequency."""
    changes = {name: getattr(base, name) * float(np.exp(size * rng.standard_normal()))
               for name, size in SPREAD.items()}
    changes["bolt_distance"] = base.bolt_distance * changes["lap"] / base.lap
    changes["drive_place"] = base.drive_place + PLACE * float(rng.standard_normal())
    beam = generate(replace(base, lap_elements=24, arm_elements=16, **changes))
    return beam.changed(stiffness=(frequency / float(beam.modes(1)[0][0]))**2)


def damping(beam: ReducedBeam, frequency: float) -> list[float]:
    """Of the mode near a frequency, at the levels; NaN where there is no solution."""
    sizes = [level / (2.0 * np.pi * frequency)**2 for level in LEVELS]
    case = beam.case(case={"analysis": "mode"}, harmonics={"n_harmonics": N_HARMONICS},
                     mode={"amplitudes": sizes, "near": frequency, "unit": "Hz"})
    try:
        return fw.run(case, in_memory=True).mode.damping_ratio.tolist()
    except fw.ConvergenceError:
        return [float("nan")] * len(LEVELS)


def table() -> list[str]:
    """Frequencies with bands, what the stiffness of the lap does to them, damping."""
    base = BeamParameters()
    beam = generate(base)
    frequency, mass = beam.modes(N_MODES)
    stiffer = generate(replace(base, tangential_stiffness=1.1 * base.tangential_stiffness))
    slope = np.log(stiffer.modes(N_MODES)[0] / frequency) / np.log(1.1)
    rng = np.random.default_rng(SEED)
    drawn = np.array([draw(rng, base, float(frequency[0])).modes(N_MODES)[0]
                      for _ in range(N_DRAWS)])
    band = WIDTH * drawn.std(axis=0) / frequency
    words = " | ".join(f"damping at {level:g} m/s^2 [1e-3]" for level in LEVELS)
    lines = ["| mode | frequency [Hz] | band | mass at the driven point [kg] | per cent for one "
             f"per cent of the lap's stiffness | {words} |", "|" + "---|" * (5 + len(LEVELS))]
    for k in range(N_MODES):
        ratios = " | ".join(f"{1e3 * one:.2f}" for one in damping(beam, float(frequency[k])))
        lines.append(f"| {k + 1} | {frequency[k]:.1f} | {100 * band[k]:.1f} % | {mass[k]:.2f} | "
                     f"{slope[k]:.3f} | {ratios} |")
    return ["", *lines, ""]


def main() -> int:
    """Predict, print, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--document", type=Path)
    options = parser.parse_args()
    lines = table()
    print("\n".join(lines))
    if options.document is not None:
        sys.path.insert(0, str(ROOT / "test" / "support"))
        from sections import write_section
        write_section("higher", lines, options.document)
    return 0


if __name__ == "__main__":
    sys.exit(main())
