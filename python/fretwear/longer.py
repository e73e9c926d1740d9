"""A model with dofs behind those that it has."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .elements import Damper, Elements, Polynomial
from .errors import InputError
from .mistuning import Mistuning
from .model import ContactPairs, Model
from .sectors import NodalDiameter, Sectors

__all__ = ["longer_parts", "padded"]

_MATRICES = ("coriolis", "structural_damping", "circulatory", "stiffness_unsymmetric",
             "damping_unsymmetric", "stiffness_rotation")
_LOADS = ("static", "cosine", "sine", "static_rotation")
#: What stands per dof, and is not made longer.
_LEFT_OUT = ("laws", "stress")


def padded(values: ArrayLike, n: int, at: int, *axes: int) -> NDArray[Any]:
    """An array with n zeros behind the first `at` entries of some axes."""
    found = np.asarray(values)
    for axis in axes:
        found = np.insert(found, [at] * n, 0.0, axis=axis)
    return found


def longer_parts(model: Model, n: int) -> dict[str, Any]:
    """Arguments of a `Model` with n dofs more, which nothing moves yet: those of the model.

    Numbers of rows move on behind the dofs.
    """
    for name in _LEFT_OUT:
        if getattr(model, name):
            raise InputError(f"model.{name}: is given, must be added behind the bodies")
    at = model.n_dof
    if any(name.startswith(("speed/", "base/")) for name in model._datasets()):
        raise InputError("model: has matrices at several speeds or a base that moves, must be "
                         "without")

    def side(numbers: ArrayLike) -> NDArray[np.int64]:
        found = np.asarray(numbers, dtype=np.int64)
        return np.where(np.abs(found) > at, found + np.sign(found) * n, found)

    parts: dict[str, Any] = {"title": model.title, "unit_system": model.unit_system}
    nodal = model.sectors is not None and model.sectors.diameters is not None
    for argument, name in (("M", "mass"), ("C", "damping"), ("K", "stiffness")):
        given = model._matrices.get(name)
        parts[argument] = None if given is None or nodal else padded(given, n, at, 0, 1)
    for name in _MATRICES:
        if (value := getattr(model, name)) is not None:
            parts[name] = padded(value, n, at, 0, 1)
    for name in _LOADS:
        if name in model._loads:
            parts[name] = padded(model._loads[name], n, at, 0)
    if model.harmonic:
        parts["harmonic"] = {key: tuple(padded(part, n, at, 0) for part in pair)
                             for key, pair in model.harmonic.items()}
    if model.observe is not None:
        parts["observe"] = {name: padded(row, n, at, 0) for name, row in model.observe.items()}
    if "load/table" in model._moved:
        parts["load_table"] = model._moved["load/table"]
    if "reduction/error" in model._moved:
        parts["reduction"] = tuple(float(model._moved[f"reduction/{key}"][0])
                                   for key in ("frequency", "error"))
    parts["rows"] = padded(model.rows, n, at, 1)
    parts["contact"] = model.contact and _pairs(model.contact, side)
    parts["springs"] = [replace(spring, side_1=int(side(spring.side_1)),
                                side_2=int(side(spring.side_2))) for spring in model.springs]
    parts["elements"] = [_elements(one, side) for one in model.elements]
    parts["sectors"] = model.sectors and _sectors(model.sectors, n, at)
    parts["mistuning"] = model.mistuning and _mistuning(model.mistuning, n, at)
    parts["bodies"] = model.bodies
    return parts


def _pairs(pairs: ContactPairs, side: Callable[[ArrayLike], Any]) -> ContactPairs:
    return replace(pairs, side_1=side(pairs.side_1),
                   side_2=None if pairs.side_2 is None else side(pairs.side_2))


def _elements(one: Elements, side: Callable[[ArrayLike], Any]) -> Elements:
    if isinstance(one, Damper):
        return replace(one, side_1=side(one.side_1),
                       side_2=None if one.side_2 is None else side(one.side_2))
    if isinstance(one, Polynomial):
        return replace(one, factors=side(one.factors),
                       dof=None if one.dof is None else side(one.dof))
    return one


def _sectors(sectors: Sectors, n: int, at: int) -> Sectors:
    air = sectors.air
    if air is not None and air.modes is not None:
        air = replace(air, modes=padded(air.modes, n, at, 1))
    elif air is not None:
        # Every dof moved it; those that follow do not.
        air = replace(air, modes=np.eye(at, at + n))
    found = None
    if sectors.diameters is not None:
        found = {number: _diameter(one, n, at) for number, one in sectors.diameters.items()}
    return replace(sectors, air=air, diameters=found,
                   n_physical=None if found is None else at + n)


def _diameter(one: NodalDiameter, n: int, at: int) -> NodalDiameter:
    changed: dict[str, Any] = {}
    for name, value in vars(one).items():
        if isinstance(value, Mapping):
            changed[name] = {key: padded(row, n, at, 0) for key, row in value.items()}
        elif value is not None:
            changed[name] = padded(value, n, at, *range(np.ndim(value)))
    return NodalDiameter(**changed)


def _mistuning(mistuning: Mistuning, n: int, at: int) -> Mistuning:
    changed: dict[str, Any] = {}
    if mistuning.rows is not None:
        changed["rows"] = padded(mistuning.rows, n, at, 1)
    for name in ("blade_stiffness", "blade_mass"):
        if (value := getattr(mistuning, name)) is not None:
            changed[name] = padded(value, n, at, 0, 1)
    if mistuning.sectors is not None:
        changed["sectors"] = {
            number: {key: value if key == "kind" else padded(value, n, at, 0, 1)
                     for key, value in matrices.items()}
            for number, matrices in mistuning.sectors.items()}
    return replace(mistuning, **changed)
