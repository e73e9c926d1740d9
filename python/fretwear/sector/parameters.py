"""Parameters of the bladed-disk sector.

Units everywhere: mm, tonne, s, N (hence MPa for moduli and pressures); angles in degrees, as
an engineer reads them from a drawing. Axes: x circumferential, y radial at the blade axis,
z along the axis of the disk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

__all__ = ["Discretisation", "Geometry", "Material", "ParameterError", "Retention",
           "SectorParameters", "patch_grid"]


class ParameterError(ValueError):
    """A parameter, or a combination of them, from which no sector can be made."""


def _par(default: float | int, text: str) -> Any:
    """Dataclass field whose meaning also feeds the help of the command line."""
    return field(default=default, metadata={"help": text})


def _require(condition: bool, owner: str, name: str, value: object, accepted: str) -> None:
    if not condition:
        raise ParameterError(f"{owner}: {name} = {value!r} is not accepted; expected {accepted}")


def _check_numbers(obj: object, may_be_negative: tuple[str, ...] = ()) -> None:
    """Reject non-finite and non-positive values of every field."""
    owner = type(obj).__name__
    for item in fields(obj):  # type: ignore[arg-type]
        value = getattr(obj, item.name)
        _require(math.isfinite(value), owner, item.name, value, "a finite number")
        if item.name not in may_be_negative:
            _require(value > 0, owner, item.name, value, "a positive number")


@dataclass(frozen=True)
class Geometry:
    """Shape of blade and disk sector [mm, degrees]."""

    n_sectors: int = _par(47, "number of blades of the disk")
    flank_radius: float = _par(250.0, "radius of the bottom of the flanks [mm]")
    axial_length: float = _par(40.0, "axial length of root and disk [mm]")
    neck_half_width: float = _par(6.0, "half width of the neck [mm]")
    flank_length: float = _par(8.0, "length of a flank along its slope [mm]")
    flank_angle: float = _par(35.0, "angle of the flanks from the horizontal [degrees]")
    root_depth: float = _par(5.0, "root below the flanks [mm]")
    root_taper: float = _par(0.5, "narrowing of the root towards its bottom, per side [mm]")
    neck_height: float = _par(3.0, "height of neck and rim above the flanks [mm]")
    neck_gap: float = _par(0.4, "clearance between neck and rim at the top of the rim [mm]")
    platform_height: float = _par(4.0, "thickness of the platform [mm]")
    platform_half_width: float = _par(16.0, "half width of the platform [mm]")
    platform_gap: float = _par(0.4, "clearance between rim and platform [mm]")
    slot_gap: float = _par(1.0, "clearance between root and slot bottom [mm]")
    disk_depth: float = _par(25.0, "disk below the slot [mm]")
    span: float = _par(80.0, "airfoil span above the platform, fillet included [mm]")
    fillet_height: float = _par(3.0, "transition from the platform to the airfoil [mm]")
    chord_root: float = _par(34.0, "chord at the platform [mm]")
    chord_tip: float = _par(30.0, "chord at the tip [mm]")
    thickness_root: float = _par(8.0, "largest thickness at the platform [mm]")
    thickness_tip: float = _par(3.0, "largest thickness at the tip [mm]")
    edge_thickness: float = _par(0.3, "edge thickness over largest thickness [-]")
    stagger_root: float = _par(5.0, "stagger at the platform [degrees]")
    stagger_tip: float = _par(25.0, "stagger at the tip [degrees]")
    camber: float = _par(0.04, "camber over chord [-]; positive makes +x the suction side")

    def __post_init__(self) -> None:
        _check_numbers(self, may_be_negative=("stagger_root", "stagger_tip", "camber"))
        check = self._check
        check("flank_angle", self.flank_angle < 80.0, "an angle between 0 and 80 degrees")
        check("edge_thickness", self.edge_thickness <= 1.0, "a ratio of at most 1")
        check("fillet_height", self.fillet_height < self.span, "less than the span")
        check("root_taper", self.root_taper < self.root_half_width, "less than the root width")
        check("n_sectors", self.n_sectors >= 3, "at least 3")
        check("disk_depth", self.disk_depth < self.slot_radius, "less than the slot radius")
        for name in ("stagger_root", "stagger_tip"):
            check(name, abs(getattr(self, name)) < 80.0, "an angle between -80 and 80 degrees")
        check("platform_half_width", self.neck_half_width < self.platform_half_width
              <= self.platform_radius * math.sin(self.half_pitch),
              "more than neck_half_width and at most half the pitch")
        check("neck_half_width", self.root_half_width
              < 0.95 * self.slot_radius * math.sin(self.half_pitch),
              "a root narrower than the sector (fewer sectors, a shorter flank or a thinner neck)")

    def _check(self, name: str, condition: bool, accepted: str) -> None:
        _require(condition, "Geometry", name, getattr(self, name), accepted)

    @property
    def half_pitch(self) -> float:
        """Half the angle of the sector [rad]."""
        return math.pi / self.n_sectors

    @property
    def slope(self) -> float:
        """Flank angle [rad]."""
        return math.radians(self.flank_angle)

    @property
    def root_half_width(self) -> float:
        """Half width of the root at the bottom of the flanks [mm]."""
        return self.neck_half_width + self.flank_length * math.cos(self.slope)

    @property
    def root_radius(self) -> float:
        """Radius of the bottom of the root [mm]."""
        return self.flank_radius - self.root_depth

    @property
    def slot_radius(self) -> float:
        """Radius of the slot bottom [mm]."""
        return self.root_radius - self.slot_gap

    @property
    def inner_radius(self) -> float:
        """Radius of the held inner face of the disk sector [mm]."""
        return self.slot_radius - self.disk_depth

    @property
    def flank_top_radius(self) -> float:
        """Radius of the top of the flanks [mm]."""
        return self.flank_radius + self.flank_length * math.sin(self.slope)

    @property
    def rim_radius(self) -> float:
        """Radius of the top of the disk [mm]."""
        return self.flank_top_radius + self.neck_height

    @property
    def platform_radius(self) -> float:
        """Radius of the underside of the platform [mm]."""
        return self.rim_radius + self.platform_gap

    @property
    def airfoil_radius(self) -> float:
        """Radius where the airfoil starts [mm]."""
        return self.platform_radius + self.platform_height

    @property
    def tip_radius(self) -> float:
        """Radius of the blade tip [mm]."""
        return self.airfoil_radius + self.span


@dataclass(frozen=True)
class Material:
    """Isotropic elasticity of blade and disk and friction on the flanks (Ti-6Al-4V)."""

    young: float = _par(114e3, "Young's modulus [MPa]")
    poisson: float = _par(0.33, "Poisson's ratio [-]")
    density: float = _par(4.43e-9, "density [tonne/mm^3]")
    mu: float = _par(0.5, "friction coefficient [-]")

    def __post_init__(self) -> None:
        _check_numbers(self, may_be_negative=("poisson", "mu"))
        _require(-1 < self.poisson < 0.5, "Material", "poisson", self.poisson, "-1 < value < 0.5")
        _require(self.mu >= 0, "Material", "mu", self.mu, "a value of at least 0")


@dataclass(frozen=True)
class Retention:
    """Axial lock of the blade in its slot.

    The flanks hold a blade along its slot by friction alone. Real blades have a lock plate or a
    retention ring as well: here one spring between root and disk, on the difference of the mean
    axial displacements of the bottom of the root and of the bottom of the slot.
    """

    retention: float = _par(0.0, "axial stiffness of the lock between root and disk [N/mm]; 0: no "
                                 "lock, the blade is held by its contact alone")

    def __post_init__(self) -> None:
        _check_numbers(self, may_be_negative=("retention",))
        _require(self.retention >= 0, "Retention", "retention", self.retention,
                 "a stiffness of at least 0")


@dataclass(frozen=True)
class Discretisation:
    """Contact patches per flank, elements per block and number of modes."""

    axial_patches: int = _par(6, "contact patches per flank along the axis")
    slope_patches: int = _par(4, "contact patches per flank along the slope")
    min_axial: int = _par(6, "fewest elements along the axis (rounded up to whole patches)")
    min_slope: int = _par(4, "fewest elements along the slope (rounded up to whole patches)")
    blade_columns: int = _par(4, "elements across neck and airfoil thickness")
    root_rows: int = _par(2, "element rows below the flanks, in root and slot wall")
    neck_rows: int = _par(1, "element rows of the neck and of the rim")
    platform_rows: int = _par(1, "element rows of the platform")
    airfoil_rows: int = _par(6, "element rows of the airfoil above its fillet")
    wing_columns: int = _par(1, "elements across each platform overhang")
    post_columns: int = _par(2, "elements between slot and cut face of the disk")
    slot_columns: int = _par(4, "elements under the slot")
    disk_rows: int = _par(3, "element rows below the slot")
    n_modes: int = _par(20, "bonded modes kept in the reduced model")

    def __post_init__(self) -> None:
        _check_numbers(self)
        for item in fields(self):
            value = getattr(self, item.name)
            _require(value == int(value), "Discretisation", item.name, value, "a whole number")

    @property
    def n_axial(self) -> int:
        """Elements along the axis: the fewest that fill whole patches."""
        return self.axial_patches * math.ceil(self.min_axial / self.axial_patches)

    @property
    def n_slope(self) -> int:
        """Elements along a flank: the fewest that fill whole patches."""
        return self.slope_patches * math.ceil(self.min_slope / self.slope_patches)

    @property
    def n_pairs(self) -> int:
        """Contact pairs on both flanks."""
        return 2 * self.axial_patches * self.slope_patches


@dataclass(frozen=True)
class SectorParameters:
    """Everything that defines one sector model."""

    geometry: Geometry = field(default_factory=Geometry)
    material: Material = field(default_factory=Material)
    discretisation: Discretisation = field(default_factory=Discretisation)
    retention: Retention = field(default_factory=Retention)


def patch_grid(n_pairs: int) -> tuple[int, int]:
    """Most nearly square patch grid of one flank.

    Parameters
    ----------
    n_pairs : int
        Contact pairs on both flanks together.

    Returns
    -------
    (int, int)
        Patches along the axis and along the slope, the first not smaller.
    """
    if n_pairs < 2 or n_pairs % 2:
        raise ParameterError(f"pairs = {n_pairs} is not accepted; expected an even number "
                             "of at least 2")
    per_flank = n_pairs // 2
    slope = next(k for k in range(math.isqrt(per_flank), 0, -1) if per_flank % k == 0)
    return per_flank // slope, slope
