"""What might stiffen the joint in place of the cubic spring, and what came of each.

    python attempts.py ForcedFrequencyResponses.mat [--document docs/brake_reuss.md]

Without any spring: Iwan's pairs; ends of the lap whose gaps close; friction that follows a normal
force which the vibration changes, with springs that stiffen under pressure.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from fit import N_HARMONICS, NEAR
from record import MASS, Level, read_record

import fretwear as fw
from fretwear.beam import BeamParameters, build_full, generate, limits
from fretwear.reduction import reduce

__all__ = ["Opened", "main"]

ROOT = Path(__file__).resolve().parents[2]
#: Runs between which the beam softens, and then stiffens.
RUNS = ("RC 1", "RC 3", "RC 7")
MU = 0.2
#: Of the lap in normal direction, for each metre of it [N/m^2]: of the order of the tangential one.
NORMAL = 2e9


@dataclass(frozen=True)
class Opened:
    """The beam whose pairs have a normal coordinate beside the tangential one.

    Attributes
    ----------
    parameters : BeamParameters
        Of the beam.
    mass, stiffness : (n, n)
        Reduced; tangential coordinates first, then the normal ones.
    drive : (n,)
        Row of the driven point.
    limit, distance, cell : (n_pairs,)
        Friction limits [N], distances from the end of the lap [m], cells [m].
    """

    parameters: BeamParameters
    mass: np.ndarray
    stiffness: np.ndarray
    drive: np.ndarray
    limit: np.ndarray
    distance: np.ndarray
    cell: np.ndarray

    @classmethod
    def of(cls, parameters: BeamParameters) -> Opened:
        """Takes the bond of the outer stations away."""
        full = build_full(parameters)
        # A normal dof follows the one along the beam.
        shift = sp.eye_array(full.rows.shape[1], k=1, format="csr")
        normal = sp.csr_array(full.rows @ shift)
        bond = sp.diags_array(parameters.normal_stiffness * full.cell)
        reduced = reduce(full.mass, full.stiffness - normal.T @ bond @ normal,
                         sp.vstack([full.rows, normal]), loads=full.drive,
                         n_modes=parameters.n_modes)
        return cls(parameters, reduced.mass, reduced.stiffness, reduced.loads[:, 0],
                   limits(full, parameters.limit, parameters.exponent),
                   0.5 * parameters.lap - np.abs(full.position), full.cell)

    def case(self, levels: list[Level], pressure: np.ndarray, gap: np.ndarray,
             **contact: Any) -> fw.Case:
        """Pairs that the bolts press with given forces, over gaps [m]."""
        p, n = self.parameters, len(self.cell)
        static = np.zeros(len(self.mass))
        static[n:2 * n] = -pressure
        sides = np.stack((np.arange(1, n + 1), np.zeros(n, int), np.arange(n + 1, 2 * n + 1)), 1)
        words = {"normal_stiffness": NORMAL * self.cell} | contact
        model = fw.Model(
            self.mass, 4.0 * np.pi * p.damping * p.damping_frequency * self.mass, self.stiffness,
            cosine=self.drive, static=static, observe={"drive": self.drive},
            contact=fw.ContactPairs(sides, mu=MU, gap=gap, law="penalty",
                                    tangential_stiffness=p.tangential_stiffness * self.cell,
                                    **words))
        return fw.Case(model, case={"analysis": "mode"}, harmonics={"n_harmonics": N_HARMONICS},
                       mode={"amplitudes": [one.displacement for one in levels], "near": NEAR,
                             "unit": "Hz"})


def attempts(levels: list[Level]) -> Iterator[tuple[str, fw.Case]]:
    """Name and case of each."""
    base = BeamParameters(cubic=0.0)
    settings: Any = {"case": {"analysis": "mode"}, "harmonics": {"n_harmonics": N_HARMONICS},
                     "mode": {"amplitudes": [one.displacement for one in levels], "near": NEAR,
                              "unit": "Hz"}}
    beam = generate(base)
    yield "friction, constant normal load", beam.case(**settings)
    for chi in (0.0, 0.7):
        model = beam.model()
        assert model.contact is not None
        contact = replace(model.contact, law="iwan", iwan_chi=chi)
        yield (f"Iwan pairs, chi = {chi:g}",
               fw.Case(fw.Model(model.M, model.C, model.K, contact=contact, cosine=model.cosine,
                                observe={"drive": beam.drive}), **settings))
    opened = Opened.of(base)
    pressed, closed = opened.limit / MU, np.zeros(len(opened.limit))
    yield "normal motion, linear springs", opened.case(levels, pressed, closed)
    for reach, most in ((0.01, 1e-6), (0.01, 3e-6), (0.02, 3e-6), (0.02, 1e-5)):
        end = np.maximum(1.0 - opened.distance / reach, 0.0)
        yield (f"ends open over {1e3 * reach:g} mm by {1e6 * most:g} um",
               opened.case(levels, np.where(end > 0.0, 0.0, pressed), most * end))
    for exponent in (1.5, 2.0):
        # As stiff as the linear springs under the force of the bolts.
        depth = exponent * pressed / (NORMAL * opened.cell)
        yield (f"springs stiffen with the closure to the power {exponent:g}",
               opened.case(levels, pressed, closed, normal_stiffness=None, normal_law="power",
                           normal_coefficient=pressed / depth**exponent,
                           normal_exponent=exponent))


def table(levels: list[Level]) -> list[str]:
    """Changes of frequency, and damping over the measured one."""
    own = sorted((one for one in levels if one.name in RUNS), key=lambda one: one.acceleration)
    ends = [f"{one.acceleration:.0f}" for one in own]
    lines = [f"| what acts | frequency, {ends[0]} to {ends[1]} m/s^2 [Hz] | {ends[1]} to {ends[2]} "
             "m/s^2 [Hz] | damping over the measured one at these |", "|---|---|---|---|",
             _line("*measured*", np.array([one.frequency for one in own]), np.ones(3))]
    for name, case in attempts(own):
        try:
            mode = fw.run(case, in_memory=True).mode
        except fw.FretwearError as error:
            lines.append(f"| {name} | no solution: {str(error)[:100]} | | |")
            continue
        lines.append(_line(name, mode.frequency, mode.forced_damping_ratio(MASS)
                           / np.array([one.damping for one in own])))
    return ["", *lines, ""]


def _line(name: str, frequency: np.ndarray, damping: np.ndarray) -> str:
    first, second = np.diff(frequency)
    return (f"| {name} | {first:+.3f} | {second:+.3f} | "
            + ", ".join(f"{one:.2f}" for one in damping) + " |")


def main() -> int:
    """Try, print, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("record", type=Path)
    parser.add_argument("--document", type=Path)
    options = parser.parse_args()
    lines = table(read_record(options.record))
    print("\n".join(lines))
    if options.document is not None:
        sys.path.insert(0, str(ROOT / "test" / "support"))
        from sections import write_section
        write_section("attempts", lines, options.document)
    return 0


if __name__ == "__main__":
    sys.exit(main())
