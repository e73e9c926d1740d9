"""Contact pairs between named surfaces of a deck: `fretwear import --contact`, and of neighbouring
sectors: `--contact-neighbour`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...errors import InputError, OutputError
from ...surfaces import RefusedSurfaces, Surface, SurfacePairs, contact_pairs
from ..archive import is_archive
from ..cuts import rotation
from ..deck import Couple
from ..labels import Dofs
from ..tables import Pairs
from .abaqus import read_abaqus_deck
from .across import Facing, facing_neighbour
from .ansys import read_ansys_deck
from .named import NamedMesh
from .other import read_other_deck

__all__ = ["Couple", "NamedMesh", "add_contact_arguments", "pairs_of_options",
           "pairs_of_surfaces", "read_named"]

Floats = NDArray[np.float64]

#: Directions are along held ones to this.
_ALONG = 1e-9


def add_contact_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the subcommand about named surfaces."""
    parser.add_argument("--contact", nargs=2, action="append", default=[],
                        metavar=("SURFACE_1", "SURFACE_2"),
                        help="contact pairs where two surfaces of the mesh face each other, whose "
                             "meshes need not match: names of surfaces, element sets or node "
                             "sets, or tables with the column node; surface 1, the finer one, "
                             "carries the pairs; repeatable")
    parser.add_argument("--contact-neighbour", nargs=2, action="append", default=[],
                        metavar=("SURFACE_1", "SURFACE_2"),
                        help="the same with surface 2 in the next or the previous sector of "
                             "--sectors, as on shrouds: whichever faces surface 1; repeatable")
    parser.add_argument("--deck-contact", action="store_true",
                        help="the same for all contact pairs that the deck declares: *CONTACT PAIR "
                             "with its *FRICTION, contact elements of ANSYS")
    parser.add_argument("--contact-mesh", type=Path, metavar="FILE",
                        help="deck or mesh with these names (default: that of --mesh, or of the "
                             "job of CalculiX)")
    parser.add_argument("--mu", type=float, metavar="X",
                        help="friction coefficient of the pairs of these surfaces")
    parser.add_argument("--reach", type=float, metavar="X",
                        help="gaps and overlaps of surfaces up to here become pairs (default: "
                             "twice the largest distance of a corner from the middle of its face)")
    parser.add_argument("--thickness", type=float, default=1.0, metavar="X",
                        help="of a plane mesh (default: 1)")
    parser.add_argument("--tangent", type=float, nargs=3, metavar=("X", "Y", "Z"),
                        help="direction that t1 of the pairs of these surfaces follows")


def pairs_of_options(options: argparse.Namespace, dofs: Dofs, job: Path | None = None
                     ) -> tuple[Pairs | None, list[str]]:
    """Pairs of named surfaces as told by the command line, with what is said of them; `job` is the
    deck that the matrices are of, where it is known."""
    if not options.contact and not options.contact_neighbour and not options.deck_contact:
        for name in ("contact_mesh", "mu", "reach", "tangent"):
            if getattr(options, name) is not None:
                raise InputError(f"--{name.replace('_', '-')} goes with --contact SURFACE_1 "
                                 "SURFACE_2, --contact-neighbour or --deck-contact")
        return None, []
    if options.pairs is not None:
        raise InputError("--contact does not go with --pairs: take one of both")
    file = next((path for path in (options.contact_mesh, options.mesh, job) if path is not None),
                None)
    if file is None:
        raise InputError("--contact needs --mesh FILE or --contact-mesh FILE: the deck that names "
                         "the surfaces")
    deck = read_named(file)
    turn = None
    if options.sectors is not None and options.sectors > 1:
        turn = rotation(options.axis, 2.0 * np.pi / options.sectors)
    elif options.contact_neighbour:
        raise InputError("--contact-neighbour needs --sectors N, at least 2: surface 2 is that of "
                         "a neighbouring sector")
    couples = [Couple(one, two) for one, two in options.contact]
    if options.deck_contact:
        couples += deck.couples
    n_inside = len(couples)
    couples += [Couple(one, two) for one, two in options.contact_neighbour]
    if not couples:
        raise InputError(f"--deck-contact: {file} declares no contact pairs; name them with "
                         "--contact SURFACE_1 SURFACE_2")
    picture = (Path("contact_refused.png") if options.output is None else
               options.output.with_name(f"{options.output.stem}_contact_refused.png"))
    return pairs_of_surfaces(deck, couples, dofs, mu=options.mu, reach=options.reach,
                             thickness=options.thickness, tangent=options.tangent,
                             picture=picture, n_inside=n_inside, turn=turn)


def read_named(path: str | Path) -> NamedMesh:
    """Sets, surfaces and contact pairs of Abaqus and CalculiX input (.inp), ANSYS archives (.cdb)
    and meshes that meshio reads, such as those of Gmsh."""
    path = Path(path)
    if not path.is_file():
        raise OutputError(f"{path}: cannot be read: there is no such file")
    if path.suffix.lower() == ".inp":
        return read_abaqus_deck(path)
    if path.suffix.lower() in (".cdb", ".dat") and is_archive(path):
        return read_ansys_deck(path)
    return read_other_deck(path)


def pairs_of_surfaces(deck: NamedMesh, couples: Sequence[Couple], dofs: Dofs, *,
                      mu: float | None = None, reach: float | None = None,
                      thickness: float = 1.0, tangent: Sequence[float] | None = None,
                      picture: Path | None = None, n_inside: int | None = None,
                      turn: Floats | None = None) -> tuple[Pairs, list[str]]:
    """Contact pairs of couples of named surfaces, on the degrees of freedom of matrices.

    Parameters
    ----------
    deck : NamedMesh
        Which names them.
    couples : sequence of Couple
        Surface 1 of each carries the pairs.
    dofs : Dofs
        With the nodes of the deck; components 1, 2, 3 are along its axes.
    mu : float, optional
        Friction coefficient, before that of the couples.
    reach, thickness, tangent
        As `fretwear.surfaces.contact_pairs` takes them.
    picture : Path, optional
        File that refused surfaces are drawn into.
    n_inside : int, optional
        So many couples are of one sector, the others of neighbours; all of one without it.
    turn : (3, 3), optional
        Rotation from a sector to the next, of a model of a sector.

    Returns
    -------
    pairs : Pairs
        With rows of relative displacements.
    notes : list of str
        What faces each other, and what does not.

    Raises
    ------
    RefusedSurfaces
        Surfaces of a couple do not face each other; the picture says where.
    InputError
        The matrices name no nodes, or the deck has no surface of such a name.
    """
    if dofs.labels is None:
        raise InputError("--contact: the files name no nodes, which tie the surfaces to the "
                         "matrices; give a label table (--labels)")
    found, notes = [], []
    for number, couple in enumerate(couples):
        one, two = deck.surface(couple.one), deck.surface(couple.two)
        along = None if one.is_plane else tangent

        def make(first: Surface, second: Surface,
                 along: Sequence[float] | None = along) -> SurfacePairs:
            return contact_pairs(first, second, reach=reach, thickness=thickness, tangent=along)

        inside = turn is None or n_inside is None or number < n_inside
        try:
            facing = _facing(one, two, None if inside else turn, make)
        except RefusedSurfaces as error:
            seen = "" if picture is None else f"; see {error.save(picture)}"
            error.args = (f"{error}{_elsewhere(one, two, turn, make) if inside else ''}{seen}",)
            raise
        notes.append(_said(facing.pairs))
        found.append(facing)
    return _joined(deck, couples, found, dofs, mu, notes), notes


def _facing(one: Surface, two: Surface, turn: Floats | None,
            make: Callable[[Surface, Surface], SurfacePairs]) -> Facing:
    """Pairs of surfaces of one sector, or of neighbours by the rotation between them."""
    if turn is not None:
        return facing_neighbour(one, two, turn, make)
    pairs = make(one, two)
    return Facing(pairs, pairs.matrix, sp.csr_array(pairs.matrix.shape), 0)


def _elsewhere(one: Surface, two: Surface, turn: Floats | None,
               make: Callable[[Surface, Surface], SurfacePairs]) -> str:
    """Where refused surfaces of a sector face each other, if it is in neighbouring ones."""
    if turn is None:
        return ""
    try:
        names = facing_neighbour(one, two, turn, make).pairs.names
    except InputError:
        return ""
    return f"; {names[0]} faces {names[1]}: --contact-neighbour {one.name} {two.name}"


def _said(pairs: SurfacePairs) -> str:
    one, two = pairs.names
    total = float(pairs.area.sum())
    text = (f"{one} and {two}: {len(pairs)} pairs, area {total:.6g}, gaps {pairs.gap.min():.3g} to "
            f"{pairs.gap.max():.3g}")
    left = [f"{area:.3g} of {name}" for name, area in zip(pairs.names, pairs.outside)
            if area > 1e-9 * total]
    return text + (f"; area without a partner: {', '.join(left)}" if left else "")


def _joined(deck: NamedMesh, couples: Sequence[Couple], found: Sequence[Facing], dofs: Dofs,
            mu: float | None, notes: list[str]) -> Pairs:
    """All pairs as one table."""
    pairs = [facing.pairs for facing in found]
    d = pairs[0].frame.shape[1]
    n = sum(len(own) for own in pairs)
    points = np.concatenate([own.points for own in pairs])
    number, rows_kept = _numbered(_free(deck, pairs, points, dofs))
    if len(rows_kept) < d * n:
        notes.append(f"contact: {d * n - len(rows_kept)} tangential directions of pairs whose "
                     "nodes are held along them are left out")
    one, two = (_on_dofs(deck, sp.coo_array(sp.vstack(rows)), d, dofs)[rows_kept]
                for rows in ([facing.rows_1 for facing in found],
                             [facing.rows_2 for facing in found]))
    position = np.zeros((n, 3))
    position[:, :d] = np.concatenate([own.position for own in pairs])
    names = [f"{couple.one}/{couple.two}" for couple, own in zip(couples, pairs)
             for _ in range(len(own))]
    across = np.repeat([facing.sector for facing in found], [len(own) for own in pairs])
    between = bool(across.any())
    return Pairs(
        number, np.zeros_like(number), one, _friction(couples, pairs, mu),
        np.concatenate([own.gap for own in pairs]),
        np.concatenate([own.area for own in pairs]), position, names,
        [f"{name}, node {deck.nodes[point]}" for name, point in zip(names, points)],
        across.astype(np.int32) if between else None, two if between else None)


def _on_dofs(deck: NamedMesh, rows: sp.coo_array, d: int, dofs: Dofs) -> sp.csr_array:
    """Rows by nodes of the deck (d of each) as rows by degrees of freedom; held ones do not move.
    """
    assert dofs.labels is not None
    column = {label: k for k, label in enumerate(dofs.labels)}
    used = np.unique(rows.col)
    place = np.full(rows.shape[1], -1)
    for number in used.tolist():
        label = int(deck.nodes[number // d]), number % d + 1
        if label in column:
            place[number] = column[label]
        elif label not in dofs.held:
            raise InputError(f"{deck.path}: node {label[0]} of a contact surface has no component "
                             f"{label[1]} in the matrices; keep the degrees of freedom of both "
                             "surfaces when they are written")
    turned = sorted(deck.turned & set(deck.nodes[used // d].tolist()))
    if turned:
        raise InputError(f"{deck.path}: node {turned[0]} has a rotated nodal frame; pairs of "
                         "surfaces need components along the global axes: NROTAT none")
    kept = place[rows.col] >= 0
    return sp.csr_array((rows.data[kept], (rows.row[kept], place[rows.col[kept]])),
                        (rows.shape[0], dofs.n))


def _free(deck: NamedMesh, found: Sequence[SurfacePairs], points: NDArray[np.int64], dofs: Dofs
          ) -> NDArray[np.bool_]:
    """Directions (n_pairs, d) that are kept: not tangential ones along which the node of a pair is
    held, where the displacements of its neighbours would be those of several pairs."""
    frame = np.concatenate([pairs.frame for pairs in found])
    d = frame.shape[1]
    held = np.array([[(int(deck.nodes[point]), c) in dofs.held for c in range(1, d + 1)]
                     for point in points])
    along = np.einsum("kic,kc->ki", frame**2, held.astype(float))
    free = along < 1.0 - _ALONG
    free[:, d - 1] = True
    return free


def _numbered(free: NDArray[np.bool_]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Rows (from 1) of t1, t2, n of each pair, 0 for none, and those that are kept (from 0)."""
    n, d = free.shape
    counted = np.where(free, np.cumsum(free).reshape(n, d), 0)
    number = np.zeros((n, 3), dtype=np.int32)
    # t1 and n where the mesh is plane.
    number[:, [0, 2] if d == 2 else [0, 1, 2]] = counted
    return number, np.flatnonzero(free)


def _friction(couples: Sequence[Couple], found: Sequence[SurfacePairs], mu: float | None
              ) -> Floats | None:
    values = [couple.mu if mu is None else mu for couple in couples]
    if any(value is None for value in values):
        if any(value is not None for value in values):
            raise InputError("--contact: some contact pairs of the deck have friction and others "
                             "none; say it for all with --mu")
        return None
    return np.concatenate([np.full(len(pairs), value) for value, pairs in zip(values, found)])
