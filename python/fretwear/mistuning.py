"""How the sectors of a disk differ from the tuned one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import array
from .errors import InputError

__all__ = ["Mistuning", "read_mistuning"]

_MATRICES = {"K": "stiffness", "M": "mass", "C": "damping"}
_KINDS = ("deviation", "full")


@dataclass(frozen=True)
class Mistuning:
    """Deviations of the sectors, each multiplied by the key ``mistuning%scale`` of a case.

    Parameters
    ----------
    rows : (n_rows, n_dof), optional
        Rows of blade modes: ``W = (K_bb Phi)^T [1, K_bb^-1 K_br] / row_omega`` on the dofs of the
        blade and those that it stands on.
    row_omega : (n_rows,), optional
        Their frequencies, blade alone [rad/s].
    frequency, damping_ratio : (n_sectors,) or (n_sectors, n_rows), optional
        By which part the frequencies of each blade are above the tuned ones, and by how much its
        damping ratios are.
    stiffness, mass : (n_sectors,), optional
        By which part blade_stiffness and blade_mass of each sector are above the tuned ones.
    blade_stiffness, blade_mass : (n_dof, n_dof), optional
        Of the blade alone, symmetric.
    sectors : mapping, optional
        Number of a sector, from 0, with its matrices "K", "M", "C" (n_dof, n_dof): what is added to
        the tuned ones, or, with "kind": "full", what stands in their place.
    patterns : (n_patterns, n_sectors) or (n_patterns, n_sectors, n_rows), optional
        Of ``analysis = 'population'``: each stands in place of `frequency`.

    Raises
    ------
    InputError
        A shape does not fit.
    """

    rows: ArrayLike | None = None
    row_omega: ArrayLike | None = None
    frequency: ArrayLike | None = None
    damping_ratio: ArrayLike | None = None
    stiffness: ArrayLike | None = None
    mass: ArrayLike | None = None
    blade_stiffness: ArrayLike | None = None
    blade_mass: ArrayLike | None = None
    sectors: Mapping[int, Mapping[str, Any]] | None = None
    patterns: ArrayLike | None = None

    def checked(self, n_dof: int, n_sectors: int) -> Mistuning:
        """The same with arrays."""
        found: dict[str, Any] = {}
        n_rows = None
        if self.rows is not None:
            found["rows"] = np.ascontiguousarray(array("mistuning.rows", self.rows, (None, n_dof)))
            n_rows = len(found["rows"])
        if self.row_omega is not None:
            found["row_omega"] = array("mistuning.row_omega", self.row_omega, (n_rows,))
        for name, before in (("frequency", ()), ("damping_ratio", ()), ("patterns", (None,))):
            if (value := getattr(self, name)) is None:
                continue
            if n_rows is None:
                raise InputError(f"mistuning.{name}: is given without rows, must have rows and "
                                 "row_omega beside it")
            if np.ndim(value) == len(before) + 1:
                each = array(f"mistuning.{name}", value, (*before, n_sectors))
                value = np.repeat(each[..., None], n_rows, axis=-1)
            found[name] = np.ascontiguousarray(
                array(f"mistuning.{name}", value, (*before, n_sectors, n_rows)))
        for name in ("stiffness", "mass"):
            if (value := getattr(self, name)) is not None:
                found[name] = array(f"mistuning.{name}", value, (n_sectors,))
            if (value := getattr(self, f"blade_{name}")) is not None:
                found[f"blade_{name}"] = array(f"mistuning.blade_{name}", value, (n_dof, n_dof))
        if self.sectors is not None:
            found["sectors"] = {number: _sector(number, matrices, n_dof, n_sectors)
                                for number, matrices in self.sectors.items()}
        return Mistuning(**found)

    def datasets(self) -> dict[str, NDArray[Any]]:
        """As a model file has them."""
        found = {f"mistuning/{name}": np.asarray(value) for name, value in vars(self).items()
                 if value is not None and name != "sectors"}
        for number, matrices in sorted((self.sectors or {}).items()):
            found.update((f"mistuning/sector/{number}/{_MATRICES[name]}", value)
                         for name, value in matrices.items() if name != "kind")
        return found

    def attributes(self) -> dict[str, str]:
        """Group of a model file with the kind of its matrices."""
        return {f"mistuning/sector/{number}": str(matrices["kind"])
                for number, matrices in sorted((self.sectors or {}).items()) if "kind" in matrices}


def _sector(number: int, matrices: Mapping[str, Any], n_dof: int, n_sectors: int) -> dict[str, Any]:
    name = f"mistuning.sectors[{number}]"
    if not 0 <= number < n_sectors:
        raise InputError(f"{name}: must be a sector from 0 to {n_sectors - 1}")
    found: dict[str, Any] = {}
    for key, value in matrices.items():
        if key == "kind":
            if value not in _KINDS:
                raise InputError(f"{name}: kind is '{value}', must be 'deviation' or 'full'")
            found[key] = value
        elif key in _MATRICES:
            found[key] = array(f"{name}.{key}", value, (n_dof, n_dof))
        else:
            raise InputError(f"{name}: has '{key}', must be 'K', 'M', 'C' or 'kind'")
    return found


def read_mistuning(file: h5py.File) -> Mistuning | None:
    """The deviations of a model file; None where it has none."""
    if "mistuning" not in file:
        return None
    group = file["mistuning"]
    found: dict[str, Any] = {name: item[()] for name, item in group.items()
                             if isinstance(item, h5py.Dataset)}
    if "sector" in group:
        found["sectors"] = {}
        for number, item in group["sector"].items():
            own = {name: item[of][()] for name, of in _MATRICES.items() if of in item}
            if "kind" in item.attrs:
                kind = item.attrs["kind"]
                own["kind"] = kind.decode() if isinstance(kind, bytes) else str(kind)
            found["sectors"][int(number)] = own
    return Mistuning(**found)
