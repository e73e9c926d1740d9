"""What makes a model one of equal sectors around an axis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import array, dofs, whole
from .errors import InputError

__all__ = ["Air", "NodalDiameter", "Sectors", "read_sectors"]

Complexes = NDArray[np.complex128]


@dataclass(frozen=True)
class NodalDiameter:
    """The sector tied to its neighbours, as it moves in one nodal diameter K = 0 .. N/2.

    Parts on the right interface are ``exp(-2 pi i K/N)`` times those on the left: conjugate what
    comes from a program with the other sign. Of K = 0 and N/2 all is real.

    Parameters
    ----------
    M, K : (n, n) complex
        Mass and stiffness, Hermitian; n may differ between nodal diameters.
    C, stiffness_rotation : (n, n) complex, optional
        Viscous damping, and stiffness per square of the rotation speed, Hermitian.
    coriolis : (n, n) complex, optional
        Per rotation speed, skew-Hermitian.
    static, cosine, sine, static_rotation : (n,) complex, optional
        Loads in these coordinates, in place of those of the model; the last per square of the
        rotation speed.
    observe : mapping, optional
        Name of every observed quantity, with a row of factors (n,) complex; then all nodal
        diameters have the same names.
    stress : (p, 6, n) complex, optional
        Stress xx, yy, zz, xy, yz, zx at the points of the model's `stress` per coordinate, in
        place of its `matrix` [force/length^3]; then all nodal diameters have it.
    """

    M: ArrayLike
    K: ArrayLike
    C: ArrayLike | None = None
    stiffness_rotation: ArrayLike | None = None
    coriolis: ArrayLike | None = None
    static: ArrayLike | None = None
    cosine: ArrayLike | None = None
    sine: ArrayLike | None = None
    static_rotation: ArrayLike | None = None
    observe: Mapping[str, ArrayLike] | None = None
    stress: ArrayLike | None = None

    def checked(self, number: int) -> NodalDiameter:
        """The same with arrays that fit each other; raises InputError where they do not."""
        name = f"sectors.diameters[{number}]"
        n = len(array(f"{name}.M", self.M, (None, None), dtype=np.complex128))
        parts: dict[str, Any] = {
            item: array(f"{name}.{item}", value, (n,) if item in _LOADS else (n, n),
                        dtype=np.complex128)
            for item in (*_MATRICES, *_LOADS) if (value := getattr(self, item)) is not None}
        if self.observe is not None:
            parts["observe"] = {
                text: array(f"{name}.observe['{text}']", row, (n,), dtype=np.complex128)
                for text, row in self.observe.items()}
        if self.stress is not None:
            parts["stress"] = array(f"{name}.stress", self.stress, (None, 6, n),
                                    dtype=np.complex128)
        return NodalDiameter(**parts)

    def datasets(self) -> Iterator[tuple[str, NDArray[np.float64]]]:
        """Parts by their names in a model file, real and imaginary part in the last dimension."""
        for item, name in {**_MATRICES, **_LOADS}.items():
            if (value := getattr(self, item)) is not None:
                yield name, _pairs(value)
        if self.observe is not None:
            yield "observe/matrix", _pairs(np.array(list(self.observe.values())))
        if self.stress is not None:
            yield "stress/matrix", _pairs(self.stress)


@dataclass(frozen=True)
class Air:
    """Forces of the air by the motion of the sectors, ``f_0 = W^T sum_m Q_m W u_m``.

    Parameters
    ----------
    by_sector : mapping, optional
        Matrices Q_m (a, a) complex, by the number m of the sector, counted from that which feels
        the force [force/length].
    by_diameter : mapping, optional
        In place of these, their sums for signed nodal diameters.
    modes : (a, n_dof), optional
        Rows W of motion that they are of; every dof without it.
    """

    by_sector: Mapping[int, ArrayLike] | None = None
    by_diameter: Mapping[int, ArrayLike] | None = None
    modes: ArrayLike | None = None

    def checked(self, n_dof: int) -> Air:
        """The same with arrays that fit each other; raises InputError where they do not."""
        if (self.by_sector is None) == (self.by_diameter is None):
            raise InputError("sectors.air: must have one of by_sector and by_diameter")
        kind = "by_sector" if self.by_diameter is None else "by_diameter"
        modes = None if self.modes is None else array("sectors.air.modes", self.modes,
                                                      (None, n_dof))
        a = n_dof if modes is None else len(modes)
        given: Mapping[int, ArrayLike] = getattr(self, kind)
        found: dict[str, Any] = {kind: {
            whole(f"sectors.air.{kind}, a key", m, -2**31 + 1): array(
                f"sectors.air.{kind}[{m}]", matrix, (a, a), dtype=np.complex128)
            for m, matrix in given.items()}}
        return Air(**found, modes=modes)

    def datasets(self) -> Iterator[tuple[str, NDArray[np.float64]]]:
        """Parts by their names in a model file."""
        for group, matrices in (("sector", self.by_sector), ("nodal_diameter", self.by_diameter)):
            for m, matrix in (matrices or {}).items():
                yield f"aero/{group}/{m}", _pairs(matrix)
        if self.modes is not None:
            yield "aero/modes", np.asarray(self.modes)


@dataclass(frozen=True)
class Sectors:
    """What makes a model one of equal sectors around an axis.

    The wave that runs around it is a matter of the case: ``cyclic={"engine_order": 4}``.

    Parameters
    ----------
    n_sectors : int
        Sectors.
    left, right : (n_interface,) int
        Dofs of one interface, counted from 1, and of the other, which moves as the left one of the
        next sector; there a negative number takes the dof with its sign turned. None where only
        contact joins the sectors.
    diameters : mapping of int to NodalDiameter, optional
        In place of the matrices of the model (which are None then) and of both interfaces: those of
        nodal diameters 0 .. n_sectors/2, as far as harmonics need them.
    n_physical : int, optional
        Required with `diameters`: the first coordinates of all of them are displacements of the
        sector, which contact, springs and the loads of the model act on.
    air : Air, optional
        Forces of the air.
    """

    n_sectors: int
    left: ArrayLike = ()
    right: ArrayLike = ()
    diameters: Mapping[int, NodalDiameter] | None = None
    n_physical: int | None = None
    air: Air | None = None

    def checked(self, n_dof: int) -> Sectors:
        """The same with arrays that fit each other; raises InputError where they do not."""
        if not isinstance(self.n_sectors, (int, np.integer)) or self.n_sectors < 1:
            raise InputError(f"sectors.n_sectors = {self.n_sectors!r}: must be a whole number "
                             "from 1")
        left = dofs("sectors.left", _whole(self.left), (None,), n_dof)
        right = dofs("sectors.right", _whole(self.right), (len(left),), n_dof)
        air = None if self.air is None else self.air.checked(n_dof)
        if self.diameters is None:
            return Sectors(int(self.n_sectors), left, right, air=air)
        if len(left) > 0:
            raise InputError("sectors.left: is given beside diameters, which are tied already")
        found = {}
        for number, diameter in self.diameters.items():
            whole("sectors.diameters, a key", number, 0, int(self.n_sectors) // 2)
            if not isinstance(diameter, NodalDiameter):
                raise InputError(f"sectors.diameters[{number}]: is a {type(diameter).__name__}, "
                                 "must be a NodalDiameter")
            found[int(number)] = diameter.checked(number)
            order = len(np.asarray(found[number].M))
            if order < n_dof:
                raise InputError(f"sectors.diameters[{number}].M: is of order {order}, must be "
                                 f"{n_dof}, n_physical, or more")
        rows = {None if one.observe is None else tuple(one.observe) for one in found.values()}
        if len(rows) > 1:
            raise InputError("sectors.diameters: observe must have the same names in all of them")
        return Sectors(int(self.n_sectors), left, right, found, n_dof, air)

    def names(self) -> tuple[str, ...] | None:
        """Observed quantities whose rows stand with the nodal diameters; None without any."""
        for diameter in (self.diameters or {}).values():
            return None if diameter.observe is None else tuple(diameter.observe)
        return None

    def datasets(self) -> dict[str, NDArray[Any]]:
        """Parts by their names in a model file."""
        found: dict[str, NDArray[Any]] = {}
        if len(np.asarray(self.left)) > 0:
            found["cyclic/left"] = np.asarray(self.left)
            found["cyclic/right"] = np.asarray(self.right)
        for number, diameter in (self.diameters or {}).items():
            found.update((f"nodal_diameter/{number}/{name}", values)
                         for name, values in diameter.datasets())
        if self.air is not None:
            found.update(self.air.datasets())
        return found

    def attributes(self) -> dict[str, int]:
        """Attributes of group /cyclic of a model file."""
        found = {"n_sectors": int(self.n_sectors)}
        return found if self.n_physical is None else {**found, "n_physical": self.n_physical}


_MATRICES = {"M": "mass", "K": "stiffness", "C": "damping",
             "stiffness_rotation": "stiffness_rotation", "coriolis": "coriolis"}
_LOADS = {name: f"load/{name}" for name in ("static", "cosine", "sine", "static_rotation")}


def _whole(values: ArrayLike) -> ArrayLike:
    """An empty list holds no numbers of the wrong type."""
    return np.zeros(0, dtype=np.int32) if np.size(values) == 0 else values


def _pairs(values: ArrayLike) -> NDArray[np.float64]:
    """Real and imaginary part in the last dimension."""
    given = np.asarray(values, dtype=np.complex128)
    return np.stack((given.real, given.imag), axis=-1)


def _complexes(values: NDArray[np.float64], turns: bool = False) -> Complexes:
    return np.asarray(values[..., 0] + (-1j if turns else 1j) * values[..., 1])


def read_sectors(file: h5py.File) -> Sectors | None:
    """What a model file says of its sectors."""
    if "cyclic" not in file:
        return None
    group = file["cyclic"]
    n_sectors = int(group.attrs["n_sectors"])
    sides = {name: group[name][()] for name in ("left", "right") if name in group}
    air = _read_air(file["aero"]) if "aero" in file else None
    if "nodal_diameter" not in file:
        return Sectors(n_sectors, **sides, air=air)
    phase = group.attrs.get("phase", "delay")
    turns = (phase.decode() if isinstance(phase, bytes) else str(phase)) == "advance"
    names = ([name.decode() for name in file["observe/name"][()]]
             if "observe/name" in file else [])
    found = {}
    for number, parts in file["nodal_diameter"].items():
        values: dict[str, Any] = {item: _complexes(parts[name][()], turns)
                  for item, name in {**_MATRICES, **_LOADS}.items() if name in parts}
        if "observe/matrix" in parts:
            values["observe"] = dict(zip(names, _complexes(parts["observe/matrix"][()], turns)))
        if "stress/matrix" in parts:
            values["stress"] = _complexes(parts["stress/matrix"][()], turns)
        found[int(number)] = NodalDiameter(**values)
    return Sectors(n_sectors, **sides, diameters=found, n_physical=int(group.attrs["n_physical"]),
                   air=air)


def _read_air(group: h5py.Group) -> Air:
    parts: dict[str, Any] = {
        argument: {int(m): _complexes(matrix[()]) for m, matrix in group[name].items()}
        for argument, name in (("by_sector", "sector"), ("by_diameter", "nodal_diameter"))
        if name in group}
    return Air(**parts, modes=group["modes"][()] if "modes" in group else None)
