"""Matrices of a Timoshenko beam element, in a plane.

Dofs of a node: u along x, w along z, and the slope t = dw/dx of a beam without shear, at a
reference line that the axis of the element lies `offset` above: u of the axis is u - offset t.
The shape functions solve the static equations of an unloaded element, so that the stiffness is
exact for forces at nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Section", "deflection", "element_matrices"]

Floats = NDArray[np.float64]

#: Products of the shape functions are of degree 6, which so many points integrate exactly.
_POINTS = 4


@dataclass(frozen=True)
class Section:
    """Rectangular cross section with its material.

    Attributes
    ----------
    width, thickness : float
        Across and along z [m].
    young, poisson, density : float
        Of the material [N/m^2], [-], [kg/m^3].
    """

    width: float
    thickness: float
    young: float
    poisson: float
    density: float

    @property
    def area(self) -> float:
        """[m^2]"""
        return self.width * self.thickness

    @property
    def inertia(self) -> float:
        """Second moment of area [m^4]."""
        return self.area * self.thickness**2 / 12.0

    @property
    def shear(self) -> float:
        """Stiffness in shear, k G A with k = 5/6 [N]."""
        return 5.0 / 6.0 * self.area * self.young / (2.0 * (1.0 + self.poisson))


def element_matrices(section: Section, length: float, offset: float = 0.0
                     ) -> tuple[Floats, Floats]:
    """Mass and stiffness (6, 6) for the dofs u, w, t of both nodes."""
    phi = 12.0 * section.young * section.inertia / (section.shear * length**2)
    mass, stiffness = np.zeros((6, 6)), np.zeros((6, 6))
    places, weights = np.polynomial.legendre.leggauss(_POINTS)
    for place, weight in zip(0.5 * (places + 1.0), 0.5 * length * weights):
        u = np.array([1.0 - place, 0.0, 0.0, place, 0.0, 0.0])
        strain = np.array([-1.0, 0.0, 0.0, 1.0, 0.0, 0.0]) / length
        w, t, bend, shear = _bending(place, length, phi)
        mass += weight * section.density * (section.area * (np.outer(u, u) + np.outer(w, w))
                                            + section.inertia * np.outer(t, t))
        stiffness += weight * (section.young * (section.area * np.outer(strain, strain)
                                                + section.inertia * np.outer(bend, bend))
                               + section.shear * np.outer(shear, shear))
    to_axis = np.eye(6)
    to_axis[0, 2] = to_axis[3, 5] = -offset
    return to_axis.T @ mass @ to_axis, to_axis.T @ stiffness @ to_axis


def deflection(section: Section, length: float, place: float) -> Floats:
    """w at a place of 0 to 1 inside of an element without offset, as a row of its six dofs."""
    phi = 12.0 * section.young * section.inertia / (section.shear * length**2)
    return _bending(place, length, phi)[0]


def _bending(s: float, length: float, phi: float) -> tuple[Floats, Floats, Floats, Floats]:
    """w, rotation, curvature and shear strain at a place of 0 to 1, of the six dofs."""
    c = 1.0 / (1.0 + phi)
    w, t, bend, shear = (np.zeros(6) for _ in range(4))
    own = [1, 2, 4, 5]
    w[own] = c * np.array([
        2.0 * s**3 - 3.0 * s**2 - phi * s + 1.0 + phi,
        length * (s**3 - (2.0 + 0.5 * phi) * s**2 + (1.0 + 0.5 * phi) * s),
        -(2.0 * s**3 - 3.0 * s**2 - phi * s),
        length * (s**3 - (1.0 - 0.5 * phi) * s**2 - 0.5 * phi * s)])
    t[own] = c * np.array([
        6.0 * (s**2 - s) / length, 3.0 * s**2 - (4.0 + phi) * s + 1.0 + phi,
        -6.0 * (s**2 - s) / length, 3.0 * s**2 - (2.0 - phi) * s])
    bend[own] = c / length * np.array([
        6.0 * (2.0 * s - 1.0) / length, 6.0 * s - 4.0 - phi,
        -6.0 * (2.0 * s - 1.0) / length, 6.0 * s - 2.0 + phi])
    # dw/dx less the rotation, which is the same all along the element.
    shear[own] = c * phi * np.array([-1.0 / length, -0.5, 1.0 / length, -0.5])
    return w, t, bend, shear
