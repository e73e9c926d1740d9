"""Parameters of the shrouded disk.

Units everywhere: mm, tonne, s, N; angles in degrees. Axes: x radial at the blade axis, y
circumferential there, towards the next sector, z along the axis of the disk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

from ..sector.parameters import Material, ParameterError

__all__ = ["DiskParameters", "Material", "ParameterError"]


def _par(default: float | int, text: str) -> Any:
    """Dataclass field whose meaning also feeds the help of the command line."""
    return field(default=default, metadata={"help": text})


@dataclass(frozen=True)
class DiskParameters:
    """Shape, material, contact and discretisation of one sector."""

    n_sectors: int = _par(36, "number of blades of the disk")
    inner_radius: float = _par(60.0, "radius at which the disk is clamped [mm]")
    rim_radius: float = _par(120.0, "radius of the rim, where the blade begins [mm]")
    shroud_radius: float = _par(200.0, "radius at which the blade ends in its shroud [mm]")
    tip_radius: float = _par(206.0, "outer radius of the shroud [mm]")
    axial_length: float = _par(20.0, "axial length of disk, blade and shroud [mm]")
    blade_angle: float = _par(2.4, "angle that the blade takes of the pitch [degrees]")
    twist: float = _par(35.0, "angle of the shroud from the axis; 0 at the rim [degrees]")
    young: float = _par(210000.0, "Young's modulus [MPa]")
    poisson: float = _par(0.3, "Poisson's ratio [-]")
    density: float = _par(7.85e-9, "density [tonne/mm^3]")
    mu: float = _par(0.3, "friction coefficient of the shrouds [-]")
    interference: float = _par(0.04, "by which the shrouds are pressed on each other [mm]")
    contact_stiffness: float = _par(2000.0, "of the shroud faces, along and across [N/mm^3]")
    load_height: float = _par(0.6, "where the load acts, as a share of the blade [-]")
    disk_rows: int = _par(3, "element rows of the disk")
    blade_rows: int = _par(5, "element rows of the blade")
    axial_layers: int = _par(2, "elements along the axis")
    side_columns: int = _par(2, "elements of disk and shroud on either side of the blade")
    radial_patches: int = _par(2, "contact patches of a shroud face along the radius")
    axial_patches: int = _par(2, "contact patches of a shroud face along the axis")
    n_modes: int = _par(30, "modes with interfaces and patches held, kept in the reduced model")

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            _require(math.isfinite(value), item.name, value, "a finite number")
            if isinstance(item.default, int):
                _require(value == int(value) and value > 0, item.name, value,
                         "a whole number of at least 1")
            elif item.name not in ("twist", "poisson", "mu", "interference"):
                _require(value > 0.0, item.name, value, "a positive number")
        _require(self.n_sectors >= 3, "n_sectors", self.n_sectors, "at least 3")
        _require(self.mu >= 0.0, "mu", self.mu, "a value of at least 0")
        _require(-1.0 < self.poisson < 0.5, "poisson", self.poisson, "-1 < value < 0.5")
        _require(abs(self.twist) < 80.0, "twist", self.twist, "an angle between -80 and 80")
        _require(self.blade_angle < self.pitch_degrees, "blade_angle", self.blade_angle,
                 f"less than the pitch of {self.pitch_degrees:g} degrees")
        _require(self.load_height <= 1.0, "load_height", self.load_height, "a share up to 1")
        # A face has three nodes along the radius, and a patch one of its own at least.
        for name, most in (("radial_patches", 3), ("axial_patches", 2 * self.axial_layers + 1)):
            _require(getattr(self, name) <= most, name, getattr(self, name), f"at most {most}")
        radii = (self.inner_radius, self.rim_radius, self.shroud_radius, self.tip_radius)
        names = ("rim_radius", "shroud_radius", "tip_radius")
        for name, low, high in zip(names, radii, radii[1:]):
            _require(low < high, name, high, f"more than {low:g}")

    @property
    def n_patches(self) -> int:
        """Contact patches of a shroud face."""
        return self.radial_patches * self.axial_patches

    @property
    def pitch_degrees(self) -> float:
        """Angle of a sector [degrees]."""
        return 360.0 / self.n_sectors

    @property
    def material(self) -> Material:
        """Elastic constants and density."""
        return Material(young=self.young, poisson=self.poisson, density=self.density, mu=self.mu)


def _require(condition: bool, name: str, value: object, accepted: str) -> None:
    if not condition:
        raise ParameterError(f"DiskParameters: {name} = {value!r} is not accepted; expected "
                             f"{accepted}")
