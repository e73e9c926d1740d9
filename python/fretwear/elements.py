"""Elements that are neither pairs nor springs: a group of a model file for each kind.

A kind is a dataclass here, whose fields are the datasets of its group (a text: an attribute), and
a line in `KINDS`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar, cast

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import array
from .errors import InputError

__all__ = ["Damper", "Elements", "Polynomial"]

#: Factors of a term.
MOST_FACTORS = 8


@dataclass(frozen=True)
class Elements:
    """What all kinds have: the name of their group, and their fields as datasets."""

    #: Group of the model file.
    group: ClassVar[str] = ""

    def checked(self, n_dof: int) -> Elements:
        """The same with arrays, of a model of n_dof dofs."""
        raise NotImplementedError

    def datasets(self) -> dict[str, NDArray[Any]]:
        """Arrays by their path."""
        return {f"{self.group}/{field.name}": np.asarray(value) for field in fields(self)
                if (value := getattr(self, field.name)) is not None
                and not isinstance(value, str)}

    def attributes(self) -> dict[str, str]:
        """Words by their name."""
        return {field.name: value for field in fields(self)
                if isinstance(value := getattr(self, field.name), str)}


@dataclass(frozen=True)
class Polynomial(Elements):
    """Forces that are polynomials of several dofs, term by term.

    Parameters
    ----------
    factors : sequence of sequences of int
        Signed dofs, counted from 1, that each term is the product of, repeated for powers: up to 8.
        ``[1, 1, 2]`` is u1^2 u2.
    coefficient : (n_terms,) float
        Of each term.
    of : str
        'energy': the terms are a potential, whose gradient the forces are; 'force': a force on one
        dof each, on the side of the stiffness.
    dof : (n_terms,) int, optional
        The dofs of these.
    """

    group: ClassVar[str] = "polynomial"
    factors: ArrayLike
    coefficient: ArrayLike
    of: str = "energy"
    dof: ArrayLike | None = None

    @classmethod
    def from_tensors(cls, dofs: ArrayLike, quadratic: ArrayLike | None = None,
                     cubic: ArrayLike | None = None) -> Polynomial:
        """Forces of full tensors, ``f_i = q_ijk u_j u_k + c_ijkl u_j u_k u_l``, term by term.

        Parameters
        ----------
        dofs : (n,) int
            Signed dofs, counted from 1, that the tensors are of.
        quadratic : (n, n, n) float, optional
            q, of any symmetry or none.
        cubic : (n, n, n, n) float, optional
            c.
        """
        numbers = np.asarray(dofs)
        if numbers.ndim != 1 or numbers.dtype.kind not in "iu" or not numbers.all():
            raise InputError("polynomial.dofs: must be a list of dof numbers, none of them 0")
        n = len(numbers)
        summed: dict[tuple[int, ...], float] = {}
        for name, tensor, rank in (("quadratic", quadratic, 3), ("cubic", cubic, 4)):
            if tensor is None:
                continue
            values = array(f"polynomial.{name}", tensor, (n,) * rank)
            # What differs by the order of the factors alone is one term.
            for at in zip(*np.nonzero(values), strict=True):
                row, *columns = (int(k) for k in at)
                key = (row, *sorted(columns))
                summed[key] = summed.get(key, 0.0) + float(values[at])
        terms = [(key, value) for key, value in sorted(summed.items()) if value]
        return cls([[int(numbers[k]) for k in key[1:]] for key, _ in terms],
                   [value for _, value in terms], "force",
                   np.array([int(numbers[key[0]]) for key, _ in terms], dtype=np.int32))

    def checked(self, n_dof: int) -> Polynomial:
        """The same with arrays, factors (n_terms, 8)."""
        if self.of not in ("energy", "force"):
            raise InputError(f"polynomial.of: is {self.of!r}, must be 'energy' or 'force'")
        try:
            rows = [list(row) for row in cast("Iterable[Iterable[int]]", self.factors)]
        except TypeError:
            raise InputError("polynomial.factors: must be a list of dofs for each term") from None
        if any(len(row) > MOST_FACTORS for row in rows):
            raise InputError(f"polynomial.factors: must be {MOST_FACTORS} dofs for a term at most")
        filled = np.array([row + [0] * (MOST_FACTORS - len(row)) for row in rows] or
                          np.zeros((0, MOST_FACTORS)))
        factors = _dofs("polynomial.factors", filled, n_dof)
        n = len(rows)
        dof = None if self.dof is None else _dofs("polynomial.dof", np.asarray(self.dof), n_dof)
        if dof is not None and dof.shape != (n,):
            raise InputError(f"polynomial.dof: has shape {dof.shape}, must be ({n},)")
        return Polynomial(factors, array("polynomial.coefficient", self.coefficient, (n,)),
                          self.of, dof)


@dataclass(frozen=True)
class Damper(Elements):
    """Nonlinear dampers: force ``coefficient * u**position_power * |v|**(power - 1) * v``.

    u is u(side_1) - u(side_2), v its rate. One value may stand for all dampers, but for side_1.

    Parameters
    ----------
    side_1 : (n_dampers,) int
        Signed dofs, counted from 1.
    coefficient : float or (n_dampers,)
        c [force time^p/length^(p + q)].
    side_2 : int or (n_dampers,), optional
        Dofs of the other side; 0 is the ground.
    power : float or (n_dampers,), optional
        p, 1 or more: 1 is viscous, 2 drag.
    position_power : int or (n_dampers,), optional
        q, 0 or more.
    sector_2 : int or (n_dampers,), optional
        Of cyclic structures: sector of side 2, counted from that of side 1.
    """

    group: ClassVar[str] = "damper"
    side_1: ArrayLike
    coefficient: ArrayLike
    side_2: ArrayLike | None = None
    power: ArrayLike | None = None
    position_power: ArrayLike | None = None
    sector_2: ArrayLike | None = None

    def checked(self, n_dof: int) -> Damper:
        """The same with arrays (n_dampers)."""
        side_1 = np.atleast_1d(np.asarray(self.side_1))
        n = len(side_1)
        values: dict[str, Any] = {
            name: array(f"damper.{name}", np.broadcast_to(np.asarray(value, dtype=float), (n,)),
                        (n,))
            for name in ("coefficient", "power") if (value := getattr(self, name)) is not None}
        for name in ("side_2", "position_power", "sector_2"):
            if (value := getattr(self, name)) is not None:
                values[name] = np.array(np.broadcast_to(np.asarray(value), (n,)), dtype=np.int32)
        if "side_2" in values:
            _dofs("damper.side_2", values["side_2"], n_dof)
        return Damper(_dofs("damper.side_1", side_1, n_dof), **values)


#: Every kind by the name of its group.
KINDS: dict[str, type[Elements]] = {kind.group: kind for kind in (Polynomial, Damper)}


def _dofs(name: str, values: NDArray[Any], n_dof: int) -> NDArray[np.int32]:
    if values.size and (values.dtype.kind not in "iu" or np.abs(values).max() > n_dof):
        raise InputError(f"{name}: must be dof numbers from -{n_dof} to {n_dof}")
    return values.astype(np.int32)


def checked_elements(elements: Iterable[Elements], n_dof: int) -> tuple[Elements, ...]:
    """Elements of a model, each kind once."""
    found: dict[str, Elements] = {}
    for number, one in enumerate(elements):
        if not isinstance(one, Elements):
            raise InputError(f"elements[{number}]: is a {type(one).__name__}, must be one of "
                             f"{', '.join(kind.__name__ for kind in KINDS.values())}")
        if one.group in found:
            raise InputError(f"elements[{number}]: is a second {type(one).__name__}, must be one")
        found[one.group] = one.checked(n_dof)
    return tuple(found.values())


def read_elements(file: h5py.File) -> list[Elements]:
    """Those of a model file."""
    found = []
    for group, kind in KINDS.items():
        if group not in file:
            continue
        values: dict[str, Any] = {name: data[()] for name, data in file[group].items()}
        values |= _words(file[group].attrs)
        known = {field.name for field in fields(kind)}
        found.append(kind(**{name: value for name, value in values.items() if name in known}))
    return found


def _words(attributes: Mapping[str, Any]) -> dict[str, str]:
    return {name: value.decode() if isinstance(value, bytes) else str(value)
            for name, value in attributes.items() if isinstance(value, (bytes, str))}
