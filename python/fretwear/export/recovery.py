"""Displacement of every degree of freedom from what a result file holds.

A result file has the observed quantities and the contact forces. With the structure of its
namelist or model file that is enough: ``U_n = Z_n^-1 (F_n - B^T lambda_n)`` for every harmonic,
whatever the contact law. The observed quantities, recovered the same way, must come out as they
stand in the file; otherwise the model file is not the one that was run.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union

import h5py
import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from ..errors import InputError, OutputError
from ..result import Result

__all__ = ["Structure", "model_path", "namelist_values", "read_structure",
           "recover_displacement", "relative_displacement"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Value = Union[float, str]

#: Largest difference between recovered and stored observed quantities, over the largest of them,
#: and in multiples of the tolerance of the solver; the greater one holds.
CONSISTENCY, CONSISTENCY_OF_SOLVER = 1e-6, 100.0
#: Eigenvalues below this share of the largest count as zero, as in the solver.
_RANK = 1e-12


def namelist_values(text: str) -> dict[str, list[Value]]:
    """Keys and values of the effective namelist that a result file carries.

    Parameters
    ----------
    text : str
        Attribute `namelist`: one key a line, longer lists on lines that follow.

    Returns
    -------
    dict
        Lists of numbers and texts by "group%key".
    """
    values: dict[str, list[Value]] = {}
    group = key = ""
    for line in text.splitlines():
        opened = re.match(r"\s*&(\w+)\s*$", line)
        assigned = re.match(r"\s+(\w+) = (.*)$", line)
        if opened:
            group, key = opened.group(1), ""
        elif line.strip() == "/":
            key = ""
        elif assigned:
            key = f"{group}%{assigned.group(1)}"
            values[key] = _words(assigned.group(2))
        elif key:
            values[key] += _words(line)
    return values


def _words(text: str) -> list[Value]:
    """Values of one line: quoted texts, logicals as texts, numbers, n*number; no comment."""
    found: list[Value] = []
    for quoted, comment, word in re.findall(r"'((?:[^']|'')*)'|(!.*)|([^\s,'!]+)", text):
        if comment:
            break
        if not word:
            found.append(quoted.replace("''", "'"))
            continue
        count, _, number = word.rpartition("*")
        try:
            found += [float(number)] * (int(count) if count else 1)
        except ValueError:
            found.append(word)
    return found


@dataclass(frozen=True)
class Structure:
    """Linear structure of a run, with everything that the namelist has added or overridden.

    Attributes
    ----------
    mass, stiffness, damping : (n, n)
        Effective matrices.
    static, cosine, sine : (n,)
        Loads, scaled.
    contact : (3 n_pairs, n)
        B: relative displacements u_r = B u, three per pair (t1, t2, n).
    gap : (n_pairs,)
        Initial gap [length].
    observe : (n_observed, n)
        Rows of the quantities that the result observes.
    """

    mass: Floats
    stiffness: Floats
    damping: Floats
    static: Floats
    cosine: Floats
    sine: Floats
    contact: Floats
    gap: Floats
    observe: Floats


def model_path(result: Result) -> Path | None:
    """Model file of a run (HDF5), None for an inline model.

    Raises
    ------
    InputError
        The file is not there, or is no HDF5 model.
    """
    values = namelist_values(result.namelist)
    source = str(values.get("model%source", ["inline"])[0])
    if source == "inline":
        return None
    if source != "hdf5":
        raise InputError(f"{result.path}: model%source = '{source}': the displacement of all "
                         "degrees of freedom can be recovered for 'inline' and 'hdf5' only")
    path = Path(str(values["model%file"][0]))
    if not path.exists():
        # A result that was moved together with its model.
        beside = result.path.parent / path.name
        if not beside.exists():
            raise InputError(f"{result.path}: its model file {path} is not there; put it there, "
                             f"or beside the result as {path.name}")
        path = beside
    return path


def read_structure(result: Result) -> Structure:
    """Structure that a result was computed with, from its namelist and model file.

    Raises
    ------
    InputError
        The model file is missing or lacks a dataset, or the model has nonlinear springs.
    """
    values = namelist_values(result.namelist)
    if float(values.get("spring%n_springs", [0.0])[0]) > 0:
        raise InputError(f"{result.path}: the case has nonlinear springs, whose forces are not in "
                         "the result; observe every degree of freedom instead")
    arrays = _model_arrays(result, values)
    n = len(arrays["stiffness"])
    speed = _number(values, "model%rotation_speed", 0.0)
    stiffness = arrays["stiffness"] + speed**2 * arrays.get("stiffness_rotation", 0.0)
    static = _load(arrays, "static", n) + speed**2 * _load(arrays, "static_rotation", n)
    mass = arrays["mass"]
    damping = (arrays.get("damping", np.zeros((n, n)))
               + _number(values, "model%rayleigh_mass", 0.0) * mass
               + _number(values, "model%rayleigh_stiffness", 0.0) * stiffness)
    ratio = _number(values, "model%modal_damping", 0.0)
    if ratio > 0.0:
        damping = damping + _modal_damping(mass, stiffness, ratio)
    scale = _number(values, "load%harmonic_scale", 1.0)
    contact = _contact_rows(arrays, n)
    gap = np.broadcast_to(arrays.get("contact/gap", np.zeros(1)).ravel(), (len(contact) // 3,))
    return Structure(mass, stiffness, damping, _number(values, "load%static_scale", 1.0) * static,
                     scale * _load(arrays, "cosine", n), scale * _load(arrays, "sine", n),
                     contact, gap, _observe_rows(result, arrays, n))


def recover_displacement(result: Result, structure: Structure | None = None,
                         points: Sequence[int] | None = None) -> Floats:
    """Fourier coefficients of every degree of freedom at every point.

    Parameters
    ----------
    result : Result
        Needs /contact/force (`&output contact`) where the model has contact pairs.
    structure : Structure, optional
        See `read_structure`, which is called without it.
    points : sequence of int, optional
        Points to recover, from 0; all of them without it.

    Returns
    -------
    (n_points, 2H+1, n)
        (0, c1, s1, ...) [length]; NaN at points without contact forces, or not asked for.

    Raises
    ------
    InputError
        The observed quantities of the file do not follow from its forces and the model.
    """
    s = structure or read_structure(result)
    n, n_coefficients = len(s.stiffness), result.coefficients.shape[1]
    load = np.zeros((n_coefficients, n))
    load[0] = s.static
    load[1], load[2] = s.cosine, s.sine
    right = np.broadcast_to(load, (result.n_points, n_coefficients, n)).copy()
    if len(s.contact):
        if "contact/force" not in result:
            raise InputError(f"{result.path}: holds no contact forces; run with output%contact = "
                             ".true.")
        force = result.force.reshape(result.n_points, n_coefficients, -1)
        right -= force @ s.contact
    displacement = np.full_like(right, np.nan)
    known = np.isfinite(right).all(axis=(1, 2)) & np.isfinite(result.coefficients).all(axis=(1, 2))
    if points is not None:
        known &= np.isin(np.arange(result.n_points), points)
    position = _known_positions(result, namelist_values(result.namelist), s.gap)
    for point in np.flatnonzero(known):
        displacement[point, 0] = _static_part(s, right[point, 0], result.coefficients[point, 0],
                                              position[point])
        for h in range(1, (n_coefficients - 1) // 2 + 1):
            w = h * result.omega[point]
            z = s.stiffness - w**2 * s.mass + 1j * w * s.damping
            u = la.solve(z, right[point, 2 * h - 1] - 1j * right[point, 2 * h])
            displacement[point, 2 * h - 1], displacement[point, 2 * h] = u.real, -u.imag
    _check(result, s, displacement, known & result.converged)
    return displacement


def relative_displacement(result: Result, points: Sequence[int] | None = None) -> Floats:
    """Fourier coefficients of the relative displacements, as `recover_displacement`.

    Returns
    -------
    (n_points, 2H+1, n_pairs, 3)
        In the local frame (t1, t2, n) [length].
    """
    structure = read_structure(result)
    relative = recover_displacement(result, structure, points) @ structure.contact.T
    return relative.reshape(*relative.shape[:2], -1, 3)


def _known_positions(result: Result, values: dict[str, list[Value]], gap: Floats) -> Floats:
    """Static relative displacements that rigid contact prescribes, (n_points, 3 n_pairs).

    Pairs that never open stay at their gap (with wear), pairs that only stick at the assembled
    position; NaN elsewhere and for every other law.
    """
    n_pairs = len(gap)
    known = np.full((result.n_points, n_pairs, 3), np.nan)
    rigid = values.get("contact%law") == ["dlft"] and values.get("contact%memory") == ["assembly"]
    if n_pairs and rigid and "contact/fraction" in result:
        worn = np.zeros((result.n_points, n_pairs))
        if "wear/depth" in result and len(result.depth) == result.n_points:
            worn = result.depth
        known[:, :, 2] = np.where(result.fraction[:, :, 2] == 0.0, -(gap + worn), np.nan)
        known[:, :, :2] = np.where(result.fraction[:, :, :1] == 1.0, 0.0, np.nan)
    return known.reshape(result.n_points, -1)


def _static_part(s: Structure, right: Floats, observed: Floats, position: Floats) -> Floats:
    """Static displacement (n,) of one point from K u = f (n,).

    A blade held by its contact alone has a singular or nearly singular K: what is observed
    (n_observed) and the known relative displacements (3 n_pairs) fix the rest.
    """
    # Rows of one size each, so that least squares weighs them by what they mean.
    size = np.sqrt(np.abs(np.diag(s.stiffness)).max())
    known = np.isfinite(position) & s.contact.any(axis=1)
    rows = np.vstack((s.stiffness / size, size * s.observe, size * s.contact[known]))
    values = np.concatenate((right / size, size * observed, size * position[known]))
    scale = np.linalg.norm(rows, axis=0)
    scale[scale == 0.0] = 1.0
    solution: Floats = np.linalg.lstsq(rows / scale, values, rcond=None)[0]
    return solution / scale


def _check(result: Result, s: Structure, displacement: Floats, points: NDArray[np.bool_]) -> None:
    if not points.any():
        return
    stored = result.coefficients[points]
    error = np.abs(displacement[points] @ s.observe.T - stored).max()
    solved = _number(namelist_values(result.namelist), "solver%tolerance", 0.0)
    if error > max(CONSISTENCY, CONSISTENCY_OF_SOLVER * solved) * np.abs(stored).max():
        raise InputError(
            f"{result.path}: what it observes does not follow from its contact forces and its "
            f"model (largest difference {error:.2g}); has the model file changed since the run?")


def _number(values: dict[str, list[Value]], key: str, default: float) -> float:
    return float(values.get(key, [default])[0])


def _load(arrays: dict[str, NDArray[Any]], name: str, n: int) -> Floats:
    found = arrays.get(f"load/{name}", np.zeros(n)).astype(float)
    return np.broadcast_to(found, (n,)) if found.size == 1 else found


def _model_arrays(result: Result, values: dict[str, list[Value]]) -> dict[str, NDArray[Any]]:
    """Datasets of the model by their names in a model file, with what the namelist overrides."""
    arrays: dict[str, NDArray[Any]] = {}
    path = model_path(result)
    if path is not None:
        try:
            with h5py.File(path, "r") as file:
                file.visititems(lambda name, item: arrays.__setitem__(name, item[()])
                                if isinstance(item, h5py.Dataset) and not name.startswith("mesh")
                                else None)
        except OSError as error:
            raise OutputError(f"{path}: cannot be read: {error}") from None
        for name in ("mass", "stiffness"):
            if name not in arrays:
                raise InputError(f"{path}: holds no dataset /{name}")
    else:
        n = int(_number(values, "model%n_dof", 0))
        for key in ("mass", "stiffness", "damping"):
            if f"model%{key}" in values:
                arrays[key] = np.array(values[f"model%{key}"], dtype=float).reshape(n, n)
    for key in ("static", "cosine", "sine"):
        if f"load%{key}" in values:
            arrays[f"load/{key}"] = np.array(values[f"load%{key}"], dtype=float)
    if "contact%gap" in values:
        arrays["contact/gap"] = np.array(values["contact%gap"], dtype=float)
    n_pairs = int(_number(values, "contact%n_pairs", 0))
    for key in ("side_1", "side_2"):
        if f"contact%{key}" in values:
            given = np.array(values[f"contact%{key}"], dtype=np.int64)
            arrays[f"contact/{key}"] = (given.reshape(n_pairs, 3) if given.size > 1 else
                                        np.full((n_pairs, 3), given[0]))
    if n_pairs == 0:
        arrays.pop("contact/side_1", None)
    return arrays


def _signed_rows(dofs: Ints, n: int) -> Floats:
    """Rows that pick signed dof numbers from 1; 0 picks nothing."""
    flat = np.asarray(dofs, dtype=np.int64).ravel()
    rows = np.zeros((len(flat), n))
    used = np.flatnonzero(flat)
    rows[used, np.abs(flat[used]) - 1] = np.sign(flat[used])
    return rows


def _contact_rows(arrays: dict[str, NDArray[Any]], n: int) -> Floats:
    if "contact/side_1" not in arrays:
        return np.zeros((0, n))
    first = arrays["contact/side_1"]
    return _signed_rows(first, n) - _signed_rows(arrays.get("contact/side_2", 0 * first), n)


def _observe_rows(result: Result, arrays: dict[str, NDArray[Any]], n: int) -> Floats:
    """Rows of the observed quantities: names of the model file, or 'u' and a dof number."""
    known: dict[str, Floats] = {}
    if "observe/name" in arrays:
        rows = (arrays["observe/matrix"] if "observe/matrix" in arrays
                else _signed_rows(arrays["observe/dof"], n))
        known = dict(zip((bytes(name).decode().strip() for name in arrays["observe/name"]), rows))
    found = []
    for name in result.observed:
        dof = re.fullmatch(r"u(\d+)", name)
        if name in known:
            found.append(known[name])
        elif dof and 1 <= int(dof.group(1)) <= n:
            found.append(_signed_rows(np.array([int(dof.group(1))]), n)[0])
        else:
            raise InputError(f"{result.path}: its model does not know the observed '{name}'")
    return np.array(found).reshape(-1, n)


def _modal_damping(mass: Floats, stiffness: Floats, ratio: float) -> Floats:
    """C = 2 zeta M Phi diag(omega) Phi^T M over the modes with mass (as in the solver)."""
    diagonal, elastic = np.diag(mass), np.abs(np.diag(stiffness))
    massive = diagonal > 1e-20 * diagonal.max()
    size = np.where(massive, diagonal, np.where(elastic > 0.0, elastic, 1.0))
    scale = 1.0 / np.sqrt(size)
    square = np.outer(scale, scale)
    weight, shapes = np.linalg.eigh(mass * square)
    heavy = weight > _RANK * weight.max()
    k = shapes.T @ (stiffness * square) @ shapes
    free, coupling = k[np.ix_(~heavy, ~heavy)], k[np.ix_(~heavy, heavy)]
    # Massless directions follow statically, where anything holds them.
    k = k[np.ix_(heavy, heavy)] - coupling.T @ np.linalg.pinv(free, rcond=_RANK) @ coupling
    root_mass = np.sqrt(weight[heavy])
    squares, modes = np.linalg.eigh(k / np.outer(root_mass, root_mass))
    omega = np.sqrt(np.where(squares > _RANK * np.abs(squares).max(), squares, 0.0))
    basis = shapes[:, heavy] @ (root_mass[:, None] * modes) / scale[:, None]
    return 2.0 * ratio * (basis * omega) @ basis.T
