"""Stress of a sector of the shrouded disk."""

from __future__ import annotations

from ..reduction import Reduction
from ..sector.stress import reduced_stress, stress_points
from ..stress import Stress
from .model import FullDisk

__all__ = ["find_stress"]


def find_stress(full: FullDisk, reduction: Reduction) -> Stress:
    """Stress inside of the elements and at their vertices, of disk, blade and shroud apart."""
    points = stress_points(full.sector.mesh, full.sector.body, full.parameters.material)
    return reduced_stress(points, full.free, reduction, full.centrifugal)
