"""The wave of a cyclic structure: ties between sectors, pairs across them, motion of the others."""

from __future__ import annotations

from dataclasses import dataclass

import h5py
import numpy as np
from numpy.typing import NDArray

from .._native import Session, namelist_values
from ..errors import InputError
from ..result import Result

__all__ = ["Wave", "Whirl", "delayed", "read_wave", "read_whirl", "turned"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]


def delayed(values: Floats, angle: float) -> Floats:
    """Coefficients (.., 2H+1, n) of the same motion, later by an angle of the period [rad]."""
    found = np.array(values)
    for n in range(1, (values.shape[-2] + 1) // 2):
        c, s = np.cos(n * angle), np.sin(n * angle)
        cosine, sine = values[..., 2 * n - 1, :], values[..., 2 * n, :]
        found[..., 2 * n - 1, :] = c * cosine - s * sine
        found[..., 2 * n, :] = s * cosine + c * sine
    return found


def turned(axis: str, angle: float) -> Floats:
    """Rotation (3, 3) about an axis, "x", "y" or "z", "-x" the other way [rad]."""
    sign, name = (-1.0, axis[1:]) if axis.startswith("-") else (1.0, axis)
    if name not in ("x", "y", "z"):
        raise InputError(f"axis {axis}: must be x, y, z, -x, -y or -z")
    i = "xyz".index(name)
    j, k = (i + 1) % 3, (i + 2) % 3
    c, s = np.cos(sign * angle), np.sin(sign * angle)
    found = np.eye(3)
    found[j, j], found[j, k], found[k, j], found[k, k] = c, -s, s, c
    return found


@dataclass(frozen=True)
class Wave:
    """What makes one sector the whole.

    Attributes
    ----------
    n_sectors, engine_order : int
        Each sector moves as the one before it, engine_order/n_sectors of a period later.
    left, right : (n_interface,) int
        Signed dofs from 1: the right one of a sector is the left one of the next.
    sector_2 : (n_pairs,) int
        Sector of side 2 of each pair.
    """

    n_sectors: int
    engine_order: int
    left: Ints
    right: Ints
    sector_2: Ints

    @property
    def phase(self) -> float:
        """Delay from a sector to the next [rad]."""
        return 2.0 * np.pi * (self.engine_order % self.n_sectors) / self.n_sectors

    def tie(self, harmonic: int, n: int) -> Complexes:
        """All dofs of the sector from those that are free (n, n - n_interface)."""
        right = np.abs(self.right) - 1
        free = np.setdiff1d(np.arange(n), right)
        found = np.zeros((n, len(free)), dtype=complex)
        found[free, np.arange(len(free))] = 1.0
        place = np.searchsorted(free, np.abs(self.left) - 1)
        found[right, place] = (np.sign(self.right) * np.sign(self.left)
                               * np.exp(-1j * harmonic * self.phase))
        return found

    def rows(self, harmonic: int, first: Floats, second: Floats) -> Complexes:
        """Relative displacements (3 n_pairs, n) from the rows of both sides."""
        turn = np.exp(-1j * harmonic * self.phase * np.repeat(self.sector_2, 3))
        found: Complexes = first - turn[:, None] * second
        return found


@dataclass(frozen=True)
class Whirl:
    """Forces of a sector that its mass, damping and stiffness do not hold.

    Attributes
    ----------
    coriolis : (n, n) or None
        At speed, skew.
    modes : (a, n)
        Rows of motion that the air acts on.
    air : (H, a, a)
        Its complex stiffness in each harmonic from 1.
    modal_damping : (H, m, m)
        Damping of the modes of each harmonic from 1, on its free dofs; H = 0 where there is none.
    circulatory, structural : (n, n) or None
        Skew part of the stiffness, and hysteretic damping.
    """

    coriolis: Floats | None
    modes: Floats
    air: Complexes
    modal_damping: Complexes
    circulatory: Floats | None = None
    structural: Floats | None = None

    def added(self, harmonic: int, omega: float, tie: Complexes) -> Complexes:
        """Dynamic stiffness on the free dofs of a harmonic."""
        n = tie.shape[1]
        w = harmonic * omega
        found = np.zeros((n, n), dtype=complex)
        if self.coriolis is not None:
            found += 1j * w * (tie.conj().T @ self.coriolis @ tie)
        if self.circulatory is not None:
            found += tie.conj().T @ self.circulatory @ tie
        if self.structural is not None:
            found += 1j * (tie.conj().T @ self.structural @ tie)
        if len(self.air):
            rows = self.modes @ tie
            found += rows.conj().T @ self.air[harmonic - 1] @ rows
        if len(self.modal_damping):
            found += 1j * w * self.modal_damping[harmonic - 1]
        return found


def _modal_damping(session: Session, free: int) -> Complexes:
    parts = session.part("modal_damping").reshape(-1, free, free, 2)
    found: Complexes = parts[..., 0] + 1j * parts[..., 1]
    return found


def read_whirl(session: Session, n: int, free: int) -> Whirl:
    """What a case has of these forces: of n dofs, and of those that are free."""
    coriolis, modes = session.part("coriolis"), session.part("aero/modes").reshape(-1, n)
    air = session.part("aero/stiffness").reshape(-1, max(1, len(modes)), max(1, len(modes)), 2)
    return Whirl(coriolis.reshape(n, n) if len(coriolis) else None, modes,
                 air[..., 0] + 1j * air[..., 1], _modal_damping(session, free),
                 *(matrix.reshape(n, n) if len(matrix := session.part(name)) else None
                   for name in ("circulatory", "structural_damping")))


def read_wave(result: Result, n_pairs: int) -> Wave | None:
    """The wave of a result; None of a structure without sectors.

    Raises
    ------
    InputError
        The matrices are those of nodal diameters, which have no dofs in common.
    """
    if "engine_order" not in result.attributes:
        return None
    if result.is_mistuned:
        raise InputError(f"{result.name}: its sectors differ (&cyclic mistuned), which are not "
                         "exported yet; result.sector(j) has the motion of each")
    values = namelist_values(result.namelist)
    parts: dict[str, Ints] = {}
    with h5py.File(result.model_file, "r") as file:
        if "nodal_diameter" in file:
            raise InputError(f"{result.name}: its matrices are those of nodal diameters, whose "
                             "coordinates are no displacements of one mesh")
        for key, name in (("cyclic%left", "cyclic/left"), ("cyclic%right", "cyclic/right"),
                          ("contact%sector_2", "contact/sector_2")):
            found = values.get(key) or (file[name][()] if name in file else [])
            parts[key] = np.array([int(value) for value in found], dtype=np.int64)
    across = parts["contact%sector_2"]
    if len(across) != n_pairs:
        across = np.full(n_pairs, across[0] if len(across) else 0)
    return Wave(int(result.attributes["n_sectors"]), int(result.attributes["engine_order"]),
                parts["cyclic%left"], parts["cyclic%right"], across)
