"""Checks of a model: what is wrong, where, and what to do.

An error stops an import; a warning is likely a mistake; a note is what the user should know.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .build import SKEW, FullModel
from .finding import Finding
from .recovery import check_mesh
from .sectors import check_interfaces, tied_spectrum
from .spectrum import Spectrum, lowest_modes, negative_directions
from .tables import DIRECTIONS, Pairs, contact_rows

__all__ = ["check_model"]

Floats = NDArray[np.float64]

#: Entries may differ from their mirror by this share of the largest one; fw_run refuses more.
SYMMETRY = 1e-10
# Up to here rounding in a file of six digits explains it: made symmetric, with a warning.
_ROUNDED = 1e-5
# First elastic frequencies of machines and their parts [Hz].
_PLAUSIBLE = (0.05, 2e5)
# Speed of sound in metals [L/s] by unit system, for the size of element that a model implies.
_SOUND = {"mm-tonne-s-n": 5e6, "m-kg-s-n": 5e3}
# Edges of elements in edges of contact patches: a patch has one to some tens of them along it.
_EDGE = (0.02, 4.0)
_MODES_OF_ONE_BODY = 6
_LARGE = 3000
_FRICTION = 1.5


Findings = Iterator[Finding]


def check_model(model: FullModel, engine: str = "auto") -> list[Finding]:
    """Check matrices, loads and pairs of a model, before any reduction; `engine` factors."""
    found = [finding for check in (_finite, _symmetric, _diagonals)
             for name, matrix in model.matrices.items()
             for finding in check(model, name, matrix)]
    if model.pairs is not None:
        for check_pairs in _PAIR_CHECKS:
            found += check_pairs(model.pairs)
        if not any(finding.kind == "error" for finding in found):
            found += _dependent(model, model.pairs)
    found += _loads(model)
    if model.mesh is not None:
        found += check_mesh(model)
    # The spectrum means something only where the matrices do.
    if not any(finding.kind == "error" for finding in found):
        found += _spectrum(model, engine)
    return found


# ----------------------------------------------------------------------- matrices


def _finite(model: FullModel, name: str, matrix: sp.csr_array) -> Findings:
    bad = np.flatnonzero(~np.isfinite(matrix.data))
    if len(bad):
        entry = sp.coo_array(matrix)
        i, j = int(entry.row[bad[0]]), int(entry.col[bad[0]])
        yield Finding("error", name, f"{len(bad)} entries are not finite, first "
                      f"{matrix.data[bad[0]]} at {_entry(model, i, j)}")


def _symmetric(model: FullModel, name: str, matrix: sp.csr_array) -> Findings:
    if name == SKEW:
        return
    difference = sp.coo_array(abs(matrix - matrix.T))
    largest = abs(matrix).max()
    if not difference.nnz or not largest > 0.0:
        return
    worst = int(np.nanargmax(difference.data)) if np.isfinite(largest) else 0
    share = difference.data[worst] / largest
    if not share > SYMMETRY:
        return
    i, j = sorted((int(difference.row[worst]), int(difference.col[worst])))
    text = (f"not symmetric: {matrix[i, j]:.9g} at {_entry(model, i, j)}, but {matrix[j, i]:.9g} "
            "mirrored")
    if share <= _ROUNDED:
        yield Finding("warning", name, f"{text}; of the size of rounding, so made symmetric; "
                      "write the file with more digits")
    elif not sp.tril(matrix, -1).nnz or not sp.triu(matrix, 1).nnz:
        yield Finding("error", name, "only one triangle is there, and nothing in the file says "
                      "that the matrix is symmetric; write the full matrix, or say so with "
                      "--mirror")
    else:
        yield Finding("error", name, f"{text}; an unsymmetric stiffness that is meant goes in "
                      "with --unsymmetric, gyroscopic terms do not")


def _diagonals(model: FullModel, name: str, matrix: sp.csr_array) -> Findings:
    if name in ("mass", "stiffness"):
        diagonal = matrix.diagonal()
        negative = np.flatnonzero(diagonal < 0.0)
        if len(negative):
            k = int(negative[0])
            yield Finding("error", name, f"{len(negative)} negative diagonal entries, first "
                          f"{diagonal[k]:.6g} at {model.dofs.name(k)}; check the sign of the "
                          "matrix")
    if name == "stiffness":
        size = abs(matrix).sum(axis=1) + abs(model.matrices["mass"]).sum(axis=1)
        empty = np.flatnonzero(size == 0.0)
        if len(empty):
            yield Finding("error", "mass and stiffness", f"{len(empty)} degrees of freedom have "
                          f"neither, first {model.dofs.name(int(empty[0]))}; leave them out with "
                          "--drop-empty")


def _entry(model: FullModel, i: int, j: int) -> str:
    return f"({i + 1}, {j + 1})" if model.dofs.labels is None else (
        f"({model.dofs.name(i)}, {model.dofs.name(j)})")


# ----------------------------------------------------------------------- loads


def _loads(model: FullModel) -> Findings:
    for name, load in model.loads.items():
        bad = np.flatnonzero(~np.isfinite(load))
        if len(bad):
            yield Finding("error", f"load {name}", "is not finite at "
                          + model.dofs.name(int(bad[0])))
        elif not load.any():
            yield Finding("warning", f"load {name}", "is zero everywhere")
    if not model.loads:
        yield Finding("note", "loads", "none; give &load in the namelist, or --loads")


# ----------------------------------------------------------------------- pairs


def _sides(pairs: Pairs) -> Findings:
    if pairs.rows is not None:
        return
    for where, one, two in zip(pairs.where, pairs.side_1, pairs.side_2):
        if not one.any() and not two.any():
            yield Finding("error", where, "the pair has no degree of freedom on either side")
        for k, direction in enumerate(DIRECTIONS):
            if one[k] != 0 and abs(one[k]) == abs(two[k]):
                yield Finding("error", where, f"both sides of {direction} are dof {abs(one[k])}; "
                              "the relative displacement would "
                              + ("be zero" if one[k] == two[k] else "be twice its motion"))
        for name, side in (("side_1", one), ("side_2", two)):
            used = [abs(int(dof)) for dof in side if dof != 0]
            if len(set(used)) < len(used):
                yield Finding("error", where, f"{name} has one dof in two directions: "
                              + ", ".join(map(str, side)))


def _areas(pairs: Pairs) -> Findings:
    if pairs.area is None:
        yield Finding("note", "pairs", "no areas: wear needs them (&contact area)")
        return
    for where, area in zip(pairs.where, pairs.area):
        if area <= 0.0:
            yield Finding("error", where, f"area = {area:.6g}; must be positive")
    if pairs.position is not None and len(pairs) > 1:
        extent = np.ptp(pairs.position, axis=0)
        span = float(np.linalg.norm(extent))
        total = float(pairs.area.sum())
        if span == 0.0:
            yield Finding("warning", "pairs", "all have the same position")
        elif total > 4.0 * len(pairs) * span**2:
            yield Finding("warning", "pairs", f"the areas add up to {total:.4g}, but the pairs lie "
                          f"within {span:.4g} of each other; one of both is in other units")


def _friction(pairs: Pairs) -> Findings:
    if pairs.mu is None:
        return
    for where, mu in zip(pairs.where, pairs.mu):
        if mu < 0.0:
            yield Finding("error", where, f"mu = {mu:.6g}; must not be negative")
    if pairs.mu.max() > _FRICTION:
        k = int(pairs.mu.argmax())
        yield Finding("warning", pairs.where[k], f"mu = {pairs.mu[k]:.6g} is more than dry "
                      "surfaces show; is it a per cent value?")


def _gaps(pairs: Pairs) -> Findings:
    if pairs.gap is None or pairs.area is None or not (pairs.area > 0.0).all():
        return
    edge = np.sqrt(pairs.area)
    wide = np.flatnonzero(np.abs(pairs.gap) > edge)
    if len(wide):
        k = int(wide[0])
        more = f" (and {len(wide) - 1} more pairs)" if len(wide) > 1 else ""
        yield Finding("warning", pairs.where[k], f"gap = {pairs.gap[k]:.6g} exceeds the edge of "
                      f"the patch, {edge[k]:.6g}{more}; is it in the units of the model?")


def _same_place(pairs: Pairs) -> Findings:
    if pairs.position is None:
        return
    first: dict[tuple[float, ...], int] = {}
    for k, position in enumerate(pairs.position):
        other = first.setdefault(tuple(position), k)
        if other != k:
            yield Finding("warning", pairs.where[k], "has the position of the pair of "
                          + pairs.where[other])


_PAIR_CHECKS: tuple[Callable[[Pairs], Findings], ...] = (
    _sides, _areas, _friction, _gaps, _same_place)


def _dependent(model: FullModel, pairs: Pairs) -> Findings:
    """Pairs whose relative displacement another pair has already."""
    rows, number = contact_rows(pairs, model.dofs.n)
    owner = {int(row): k for k, line in enumerate(number) for row in line if row}
    size = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel())
    gram = sp.coo_array(sp.triu(rows @ rows.T, 1))
    cosine = np.abs(gram.data) / (size[gram.row] * size[gram.col])
    reported: set[tuple[int, int]] = set()
    for k in np.flatnonzero(cosine > 1.0 - 1e-12):
        one, two = owner[int(gram.row[k]) + 1], owner[int(gram.col[k]) + 1]
        if (one, two) not in reported:
            reported.add((one, two))
            what = "twice" if one == two else f"also by the pair of {pairs.where[one]}"
            yield Finding("error", pairs.where[two], f"a relative displacement is given {what}; "
                          "rigid contact forces would not be determined")
    if not reported and rows.shape[0] <= _LARGE:
        rank = int(np.linalg.matrix_rank((rows @ rows.T).toarray() / np.outer(size, size),
                                         hermitian=True))
        if rank < rows.shape[0]:
            yield Finding("error", "pairs", f"{rows.shape[0] - rank} of {rows.shape[0]} relative "
                          "displacements are combinations of others; remove the pairs that close "
                          "a ring of points")


# ----------------------------------------------------------------------- spectrum


def _spectrum(model: FullModel, engine: str) -> Findings:
    mass, stiffness = model.matrices["mass"], model.matrices["stiffness"]
    for name in ("mass", "stiffness"):
        negative = negative_directions(model.matrices[name], engine)
        if negative:
            yield Finding("error" if name == "mass" else "warning", name,
                          f"not positive semidefinite: {negative} negative eigenvalues; "
                          + ("a mass matrix cannot have any" if name == "mass" else
                             "the structure is unstable, or spin softening is in it (which "
                             "belongs in stiffness_rotation)"))
            return
    spectrum = lowest_modes(mass, stiffness, engine)
    if spectrum is None:
        yield Finding("error", "mass and stiffness", "a motion has neither mass nor stiffness (a "
                      "mechanism of massless degrees of freedom); hold it or give it mass")
        return
    if model.interfaces is not None:
        tied = tied_spectrum(model, model.interfaces, engine)
        if tied is None:
            yield Finding("error", "interfaces", "tied in nodal diameter 0 a motion has neither "
                          "mass nor stiffness")
            return
        yield from check_interfaces(model.interfaces, spectrum, tied)
        spectrum = tied
    else:
        yield from _rigid(model, spectrum)
    yield from _units(model, spectrum)


def _rigid(model: FullModel, spectrum: Spectrum) -> Findings:
    n_rigid = spectrum.rigid.shape[1]
    if not n_rigid:
        return
    held = 0
    if model.pairs is not None:
        rows, _ = contact_rows(model.pairs, model.dofs.n)
        size = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel())
        held = int(np.linalg.matrix_rank((rows @ spectrum.rigid) / size[:, None], tol=1e-6))
    if held < n_rigid:
        freest = np.abs(spectrum.rigid).max(axis=1).argmax()
        yield Finding("error" if model.pairs is not None else "warning", "stiffness",
                      f"{n_rigid} rigid-body modes, of which the contact holds {held}; the "
                      f"others move most at {model.dofs.name(int(freest))}: add supports or pairs")
    else:
        yield Finding("note", "stiffness", f"{n_rigid} rigid-body modes, all held by the contact")
    if n_rigid > _MODES_OF_ONE_BODY:
        yield Finding("warning", "stiffness", f"{n_rigid} rigid-body modes are more than one "
                      "body has; are parts or degrees of freedom left without stiffness?")


def _units(model: FullModel, spectrum: Spectrum) -> Findings:
    if not len(spectrum.frequency):
        return
    first = float(spectrum.frequency[0])
    yield Finding("note", "frequencies", "lowest elastic ones with open contact "
                  + ", ".join(f"{value:.5g}" for value in spectrum.frequency[:5]) + " Hz")
    if not _PLAUSIBLE[0] <= first <= _PLAUSIBLE[1]:
        yield Finding("warning", "units", f"a first elastic frequency of {first:.4g} Hz is not "
                      "plausible. Stiffness over mass must be in 1/s^2: N/mm goes with tonnes, "
                      "N/m with kg (a factor of 1000 in mass moves frequencies by 31.6); Nastran "
                      "may write weights. Cure with --mass-factor")
    sound = _SOUND.get(model.unit_system.lower())
    if sound is None:
        return
    # sqrt(K_ii / M_ii) is about 2.5 times the speed of sound over the edge of an element.
    edge = 2.5 * sound / (2.0 * np.pi * spectrum.local)
    yield Finding("note", "units", f"in a metal the matrices imply elements of about {edge:.2g} "
                  f"{model.unit_system.split('-')[0]}")
    if model.pairs is not None and model.pairs.area is not None:
        patch = float(np.sqrt(np.median(model.pairs.area)))
        if not _EDGE[0] <= edge / patch <= _EDGE[1]:
            yield Finding("warning", "units", f"elements of about {edge:.2g} do not fit contact "
                          f"patches of about {patch:.2g} across; are mass, stiffness and area in "
                          f"{model.unit_system}?")
