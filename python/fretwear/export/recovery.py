"""Displacement of every degree of freedom from what a result file holds.

A result file has the observed quantities and the contact forces. With the structure of its
case, as the program reads it, that is enough: ``U_n = Z_n^-1 (F_n - B^T lambda_n)`` for every
harmonic, whatever the contact law. The observed quantities, recovered the same way, must come out
as they stand in the file; otherwise the model file is not the one that was run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from .._native import Session, namelist_values
from ..errors import AbsentError, InputError
from ..result import Result
from .wave import Wave, Whirl, delayed, read_wave, read_whirl

__all__ = ["Structure", "read_structure", "recover_displacement", "relative_displacement"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

#: Largest difference between recovered and stored observed quantities, over the largest of them,
#: and in multiples of the tolerance of the solver; the greater one holds.
CONSISTENCY, CONSISTENCY_OF_SOLVER = 1e-6, 100.0


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
    sides : tuple of (3 n_pairs, n)
        Both sides of the pairs: contact is their difference within one sector.
    wave : Wave or None
        Of a cyclic structure: then the structure is one sector.
    whirl : Whirl or None
        Of a cyclic structure: Coriolis forces, those of the air, modal damping.
    waves : tuple
        Further loads: harmonic, power of its frequency, cosine and sine part (n,) of each.
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
    sides: tuple[Floats, Floats]
    wave: Wave | None = None
    whirl: Whirl | None = None
    waves: tuple[tuple[int, int, Floats, Floats], ...] = ()


def read_structure(result: Result) -> Structure:
    """Structure that a result was computed with, as the program has it.

    Raises
    ------
    AbsentError
        The model file is missing, or the model has nonlinear springs.
    """
    with result.case.open() as session:
        if session.part("n_springs")[0] > 0:
            raise AbsentError(f"{result.name}: the case has nonlinear springs, whose forces are "
                              "not in the result; observe every degree of freedom instead")
        if session.part("speed_order")[0] > 0.0:
            raise AbsentError(f"{result.name}: the rotation speed follows the frequency "
                              "(sweep%speed_order), and with it the matrices; observe every "
                              "degree of freedom instead")
        static = session.part("load/static")
        n = len(static)
        mass, stiffness, damping = (session.part(name).reshape(n, n)
                                    for name in ("mass", "stiffness", "damping"))
        first, second = (_signed_rows(session.part(f"contact/{side}"), n)
                         for side in ("side_1", "side_2"))
        wave = read_wave(result, len(first) // 3)
        return Structure(
            mass, stiffness, damping, static, session.part("load/cosine"),
            session.part("load/sine"), first - second, session.part("contact/gap"),
            session.part("observe/matrix").reshape(-1, n), (first, second),
            wave, read_whirl(session, n, n if wave is None else n - len(wave.right)),
            _waves(session, n))


def _waves(session: Session, n: int) -> tuple[tuple[int, int, Floats, Floats], ...]:
    parts = session.part("load/wave").reshape(-1, 2, n)
    return tuple((int(harmonic), int(power), cosine, sine) for harmonic, power, (cosine, sine)
                 in zip(session.part("load/wave_harmonic"), session.part("load/wave_power"), parts))


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
    load = np.broadcast_to(load, (result.n_points, n_coefficients, n)).copy()
    for harmonic, power, cosine, sine in s.waves:
        grows = ((harmonic * result.omega) ** power)[:, None]
        load[:, 2 * harmonic - 1] += grows * cosine
        load[:, 2 * harmonic] += grows * sine
    force = np.zeros((result.n_points, n_coefficients, 0))
    if len(s.contact):
        if "contact/force" not in result:
            raise AbsentError(f"{result.name}: holds no contact forces; run with output%contact = "
                              ".true.")
        force = result.force.reshape(result.n_points, n_coefficients, -1)
    displacement = np.full((result.n_points, n_coefficients, n), np.nan)
    known = np.isfinite(force).all(axis=(1, 2)) & np.isfinite(result.coefficients).all(axis=(1, 2))
    if points is not None:
        known &= np.isin(np.arange(result.n_points), points)
    position = _known_positions(result, namelist_values(result.namelist), s.gap)
    still, tie, _ = _of_harmonic(s, 0)
    for point in np.flatnonzero(known):
        right = tie.T.real @ load[point, 0] - force[point, 0] @ still.contact
        displacement[point, 0] = tie.real @ _static_part(
            still, right, result.coefficients[point, 0], position[point])
    for h in range(1, (n_coefficients - 1) // 2 + 1):
        _, tie, rows = _of_harmonic(s, h)
        outer = (load[:, 2 * h - 1] - 1j * load[:, 2 * h]) @ tie.conj()
        for point in np.flatnonzero(known):
            w = h * result.omega[point]
            z = s.stiffness - w**2 * s.mass + 1j * w * s.damping
            inner = (force[point, 2 * h - 1] - 1j * force[point, 2 * h]) @ rows.conj()
            tied = tie.conj().T @ z @ tie
            if s.whirl is not None:
                tied += s.whirl.added(h, result.omega[point], tie)
            u = tie @ la.solve(tied, outer[point] - inner)
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
    moved = recover_displacement(result, structure, points)
    first, second = structure.sides
    relative = moved @ first.T
    if structure.wave is None:
        relative -= moved @ second.T
    else:
        for sector in np.unique(structure.wave.sector_2):
            rows = np.repeat(structure.wave.sector_2 == sector, 3)
            there = delayed(moved, sector * structure.wave.phase)
            relative[:, :, rows] -= there @ second[rows].T
    return relative.reshape(*relative.shape[:2], -1, 3)


def _of_harmonic(s: Structure, harmonic: int) -> tuple[Structure, Complexes, Complexes]:
    """What a harmonic moves: the structure of its free dofs (of the static part), the tie to all
    dofs, and the rows of the relative displacements on the free ones."""
    skew = None if s.whirl is None else s.whirl.circulatory
    if harmonic == 0 and skew is not None:
        s = replace(s, stiffness=s.stiffness + skew)
    if s.wave is None:
        return s, np.eye(len(s.stiffness), dtype=complex), s.contact.astype(complex)
    tie = s.wave.tie(harmonic, len(s.stiffness))
    rows = s.wave.rows(harmonic, *s.sides) @ tie
    if harmonic > 0:
        return s, tie, rows
    still = tie.real
    return replace(s, stiffness=still.T @ s.stiffness @ still, observe=s.observe @ still,
                   contact=rows.real), tie, rows


def _known_positions(result: Result, values: dict[str, list[str]], gap: Floats) -> Floats:
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
    solved = float(namelist_values(result.namelist).get("solver%tolerance", ["0"])[0])
    if error > max(CONSISTENCY, CONSISTENCY_OF_SOLVER * solved) * np.abs(stored).max():
        raise InputError(
            f"{result.name}: what it observes does not follow from its contact forces and its "
            f"model (largest difference {error:.2g}); has the model file changed since the run?")


def _signed_rows(dofs: Floats, n: int) -> Floats:
    """Rows that pick signed dof numbers from 1; 0 picks nothing."""
    flat = dofs.astype(np.int64)
    rows = np.zeros((len(flat), n))
    used = np.flatnonzero(flat)
    rows[used, np.abs(flat[used]) - 1] = np.sign(flat[used])
    return rows
