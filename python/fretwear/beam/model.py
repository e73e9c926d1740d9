"""Two half beams with a bolted lap joint, reduced to the pairs outside its bolts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from numpy.typing import NDArray

from ..case import Case
from ..model import ContactPairs, Model, Spring
from ..reduction import reduce
from .element import Section, deflection, element_matrices
from .parameters import BeamParameters, ParameterError

__all__ = ["FullBeam", "ReducedBeam", "build_full", "generate", "limits"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FullBeam:
    """Both half beams, and what holds them together.

    Attributes
    ----------
    parameters : BeamParameters
        What it was made of.
    mass, stiffness : (n, n) sparse
        Lap bonded between the outer bolts and in normal direction everywhere, open else.
    rows : (n_pairs, n) sparse
        Relative displacement along x at the pairs.
    position : (n_pairs,)
        Place of the pairs, from the middle of the lap [m].
    cell : (n_pairs,)
        Length of the lap that a pair stands for [m].
    drive : (n,)
        Row of the driven point, along z.
    """

    parameters: BeamParameters
    mass: sp.csr_array
    stiffness: sp.csr_array
    rows: sp.csr_array
    position: Floats
    cell: Floats
    drive: Floats


@dataclass(frozen=True)
class ReducedBeam:
    """The relative displacements, modes with the lap stuck, and one attachment.

    Attributes
    ----------
    full : FullBeam
        What was reduced.
    mass, stiffness : (n, n)
        Pairs come first; the lap is open there.
    drive : (n,)
        Row of the driven point, which is the load too.
    """

    full: FullBeam
    mass: Floats
    stiffness: Floats
    drive: Floats

    @property
    def pair_stiffness(self) -> Floats:
        """Tangential stiffness of the pairs [N/m]."""
        return self.full.parameters.tangential_stiffness * self.full.cell

    def modes(self, n: int) -> tuple[Floats, Floats]:
        """Elastic frequencies [Hz] with all pairs stuck, and the masses of the modes at the driven
        point [kg]."""
        stuck = self.stiffness.copy()
        pairs = np.arange(len(self.full.cell))
        stuck[pairs, pairs] += self.pair_stiffness
        values, shapes = la.eigh(stuck, self.mass)
        frequency = np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi)
        # The beam on its suspension is no elastic mode.
        elastic = np.flatnonzero(frequency > 4.0 * self.full.parameters.suspension)[:n]
        return frequency[elastic], 1.0 / (self.drive @ shapes[:, elastic])**2

    def changed(self, *, stiffness: float = 1.0, **joint: float) -> ReducedBeam:
        """The same reduction with another `limit`, `exponent`, `cubic` or `damping`, and with all
        linear stiffness times a factor, which moves all frequencies by its root."""
        if wrong := set(joint) - {"limit", "exponent", "cubic", "damping"}:
            raise ParameterError(f"ReducedBeam: {', '.join(sorted(wrong))} needs another "
                                 "reduction; call generate()")
        p = self.full.parameters
        others: dict[str, Any] = dict(joint)
        parameters = replace(
            p, **others, young=stiffness * p.young,
            suspension=float(np.sqrt(stiffness)) * p.suspension,
            normal_stiffness=stiffness * p.normal_stiffness,
            tangential_stiffness=stiffness * p.tangential_stiffness)
        full = replace(self.full, parameters=parameters,
                       stiffness=sp.csr_array(stiffness * self.full.stiffness))
        return ReducedBeam(full, self.mass, stiffness * self.stiffness, self.drive)

    def model(self) -> Model:
        """The model that runs: `penalty` pairs in one direction, and the cubic spring where there
        is one."""
        p, n = self.full.parameters, len(self.mass)
        n_pairs = len(self.full.cell)
        sides = np.zeros((n_pairs, 3), dtype=int)
        sides[:, 0] = np.arange(1, n_pairs + 1)
        place = np.zeros((n_pairs, 3))
        place[:, 0] = 0.5 * p.length + self.full.position
        damping = 2.0 * p.damping * 2.0 * np.pi * p.damping_frequency * self.mass
        # mu = 1: the normal load is the limit of friction, which alone the joint depends on.
        return Model(
            self.mass, damping, self.stiffness, cosine=self.drive, rows=self.drive[None],
            contact=ContactPairs(
                sides, mu=1.0, normal_load=limits(self.full, p.limit, p.exponent),
                tangential_stiffness=self.pair_stiffness, position=place, law="penalty",
                patch=["left" if s < 0.0 else "right" for s in self.full.position]),
            springs=[Spring(n + 1, 0, p.cubic, 3)] if p.cubic > 0.0 else (),
            observe={"drive": self.drive}, title="Bolted beam", unit_system="m-kg-s-N")

    def case(self, **settings: object) -> Case:
        """A case of that model."""
        return Case(self.model(), **settings)  # type: ignore[arg-type]


def generate(parameters: BeamParameters | None = None) -> ReducedBeam:
    """The reduced beam; its `model()` runs."""
    full = build_full(parameters or BeamParameters())
    found = reduce(full.mass, full.stiffness, full.rows, loads=full.drive,
                   n_modes=full.parameters.n_modes)
    # The driven point moves by T^T of its row, as the load that works on it.
    return ReducedBeam(full, found.mass, found.stiffness, found.loads[:, 0])


def limits(full: FullBeam, limit: float, exponent: float) -> Floats:
    """Friction limits of the pairs [N]: the mean over the cell of `limit` (d/b)^p, d the distance
    from the end of the lap and b that of the outer bolts, times the length of the cell."""
    p = full.parameters
    reach = 0.5 * p.lap - p.bolt_distance
    distance = 0.5 * p.lap - np.abs(full.position)
    low = np.maximum(distance - 0.5 * p.cell, 0.0)
    high = distance + 0.5 * p.cell
    power = exponent + 1.0
    return limit * reach * ((high / reach)**power - (low / reach)**power) / power


def build_full(parameters: BeamParameters) -> FullBeam:
    """Both half beams with their masses, springs and the bonded part of the lap."""
    p = parameters
    arm = np.linspace(0.0, p.arm, p.arm_elements + 1)
    lap = np.linspace(p.arm, p.arm + p.lap, p.lap_elements + 1)
    left, right = np.concatenate((arm, lap[1:])), np.concatenate((lap, p.length - arm[-2::-1]))
    n = 3 * (len(left) + len(right))
    # Some hundred dofs: dense matrices are made faster than sparse ones.
    mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
    steps = {False: p.arm / p.arm_elements, True: p.cell}
    for places, first, above in ((left, 0, 1.0), (right, 3 * len(left), -1.0)):
        # In the lap the axes of both halves lie a quarter of the thickness off the interface.
        kinds = {thinner: element_matrices(
            Section(p.width, (0.5 if thinner else 1.0) * p.thickness, p.young, p.poisson,
                    p.density), step, 0.25 * p.thickness * above if thinner else 0.0)
            for thinner, step in steps.items()}
        for k, (start, end) in enumerate(zip(places, places[1:])):
            one = kinds[bool(p.arm < 0.5 * (start + end) < p.arm + p.lap)]
            own = slice(first + 3 * k, first + 3 * k + 6)
            mass[own, own] += one[0]
            stiffness[own, own] += one[1]
    return _joined(p, left, mass, stiffness)


def _joined(p: BeamParameters, left: Floats, mass: Floats, stiffness: Floats) -> FullBeam:
    """With what acts at nodes: the lap, bolts, the driven point, the suspension."""
    n, n_lap = mass.shape[0], p.lap_elements + 1
    # First dofs of the nodes of the lap, of the left half and of the right one below them.
    upper = 3 * (p.arm_elements + np.arange(n_lap))
    lower = 3 * (len(left) + np.arange(n_lap))
    place = p.cell * np.arange(n_lap) - 0.5 * p.lap
    cell = np.full(n_lap, p.cell)
    cell[[0, -1]] *= 0.5
    slips = np.abs(place) > p.bolt_distance + 0.5 * p.cell
    for j in range(n_lap):
        _tie(stiffness, upper[j] + 1, lower[j] + 1, p.normal_stiffness * cell[j])
        if not slips[j]:
            _tie(stiffness, upper[j], lower[j], p.tangential_stiffness * cell[j])
    for place_of_bolt in (-p.bolt_distance, 0.0, p.bolt_distance):
        at = int(np.abs(place - place_of_bolt).argmin())
        for node in (upper[at], lower[at]):
            for dof in (node, node + 1):
                mass[dof, dof] += 0.5 * p.bolt_mass
    drive = _row(p, left, n)
    mass += p.drive_mass * np.outer(drive, drive)
    whole = p.density * p.width * p.thickness * p.length + 3.0 * p.bolt_mass + p.drive_mass
    for end in (0, n - 3):
        for dof in (end, end + 1):
            stiffness[dof, dof] += 0.5 * whole * (2.0 * np.pi * p.suspension)**2
    rows = np.zeros((int(slips.sum()), n))
    pairs = np.arange(len(rows))
    rows[pairs, upper[slips]], rows[pairs, lower[slips]] = 1.0, -1.0
    return FullBeam(p, sp.csr_array(mass), sp.csr_array(stiffness), sp.csr_array(rows),
                    place[slips], cell[slips], drive)


def _row(p: BeamParameters, left: Floats, n: int) -> Floats:
    """Displacement of the driven point along z, inside of an element of the left half."""
    row = np.zeros(n)
    k = int(np.searchsorted(left, p.drive_place, side="right")) - 1
    section = Section(p.width, p.thickness, p.young, p.poisson, p.density)
    length = left[k + 1] - left[k]
    row[3 * k:3 * k + 6] = deflection(section, length, (p.drive_place - left[k]) / length)
    return row


def _tie(stiffness: Floats, one: int, other: int, value: float) -> None:
    """A spring between two dofs."""
    stiffness[one, one] += value
    stiffness[other, other] += value
    stiffness[one, other] -= value
    stiffness[other, one] -= value
