"""Parameters of the bolted beam.

Units everywhere: m, kg, s, N. x runs along the beam, z along the axes of the bolts; the interface
of the lap is the plane z = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

from ..sector.parameters import ParameterError

__all__ = ["BeamParameters", "ParameterError"]


def _par(default: float | int, text: str) -> Any:
    """Dataclass field whose meaning also feeds the help of the command line."""
    return field(default=default, metadata={"help": text})


@dataclass(frozen=True)
class BeamParameters:
    """Shape, material, joint and discretisation of two half beams with a bolted lap joint.

    The defaults are those of the Brake-Reuss beam that bends along its bolts, with the joint that
    was calibrated on three measured levels. What is measured, inferred and fitted is said in
    docs/brake_reuss.md.
    """

    length: float = _par(0.72, "length of the whole beam [m]")
    lap: float = _par(0.12, "length of the lap in its middle [m]")
    width: float = _par(0.0254, "width, across the bolts [m]")
    thickness: float = _par(0.0127, "thickness outside the lap, along the bolts [m]")
    young: float = _par(1.9193e11, "Young's modulus [N/m^2]")
    poisson: float = _par(0.29, "Poisson's ratio [-]")
    density: float = _par(7900.0, "density [kg/m^3]")
    bolt_distance: float = _par(0.03, "from one of the three bolts to the next [m]")
    bolt_mass: float = _par(0.045, "a bolt with nut and washers [kg]")
    drive_place: float = _par(0.0805, "driven point, from one end [m]")
    drive_mass: float = _par(0.019, "what moves there with the beam [kg]")
    suspension: float = _par(1.5, "frequency on the soft springs at the ends [Hz]")
    normal_stiffness: float = _par(1e12, "of the closed lap, for each metre of it [N/m^2]")
    tangential_stiffness: float = _par(7.349e8, "of the lap where it sticks, for each metre "
                                                   "[N/m^2]")
    limit: float = _par(9002.0, "friction limit at a bolt where the exponent is 0 and at the "
                                     "outer bolts else, for each metre [N/m]")
    exponent: float = _par(0.3801, "p of the limit: it grows with the p-th power of the distance "
                                     "from the end of the lap [-]")
    cubic: float = _par(1.529e11, "cubic spring at the driven point, which is empirical "
                                     "[N/m^3]")
    damping: float = _par(1.45e-3, "damping ratio where everything sticks [-]")
    damping_frequency: float = _par(80.17, "frequency that it is of [Hz]")
    arm_elements: int = _par(24, "elements of a half beam outside the lap")
    lap_elements: int = _par(48, "elements of a half beam in the lap")
    n_modes: int = _par(10, "modes with the lap stuck, kept in the reduced model")

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            _require(math.isfinite(value), item.name, value, "a finite number")
            if isinstance(item.default, int):
                _require(value == int(value) and value > 0, item.name, value,
                         "a whole number of at least 1")
            elif item.name in ("bolt_mass", "drive_mass", "cubic", "damping", "exponent"):
                _require(value >= 0.0, item.name, value, "a number from 0 up")
            elif item.name != "poisson":
                _require(value > 0.0, item.name, value, "a positive number")
        _require(-1.0 < self.poisson < 0.5, "poisson", self.poisson, "-1 < value < 0.5")
        _require(self.lap < self.length, "lap", self.lap, f"less than {self.length:g}")
        _require(2.0 * self.bolt_distance < self.lap, "bolt_distance", self.bolt_distance,
                 f"less than half of the lap, {0.5 * self.lap:g}")
        _require(self.drive_place < self.arm, "drive_place", self.drive_place,
                 f"less than {self.arm:g}, where the lap begins")
        bolts = self.bolt_distance / self.cell
        _require(self.lap_elements % 2 == 0 and abs(bolts - round(bolts)) < 1e-6, "lap_elements",
                 self.lap_elements, "an even number, with which bolts stand at nodes")

    @property
    def arm(self) -> float:
        """Length of a half beam outside the lap [m]."""
        return 0.5 * (self.length - self.lap)

    @property
    def cell(self) -> float:
        """Length of an element of the lap [m]."""
        return self.lap / self.lap_elements


def _require(condition: bool, name: str, value: object, accepted: str) -> None:
    if not condition:
        raise ParameterError(f"BeamParameters: {name} = {value!r} is not accepted; expected "
                             f"{accepted}")
