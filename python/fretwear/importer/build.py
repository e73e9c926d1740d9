"""From files to a model file: read, check, reduce, write."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import qr

from ..errors import InputError
from ..factors import chosen_engine
from ..mesh import mesh_datasets
from ..model_file import strings, write_model_file
from ..reduction import Progress, Reduction, reduce
from ..reduction_error import true_error
from .accuracy import Accuracy, mode_options, range_datasets
from .blade import BladeNodes, blade_datasets
from .diameters import reduce_diameters
from .finding import Finding
from .labels import Dofs
from .matrices import read_matrices
from .matrix_file import HELD, MatrixFile, mirrored, one_triangle
from .meshes import ImportedMesh
from .recovery import recovery_mesh
from .sectors import Interfaces
from .stress import StressRows, stress_datasets
from .tables import LOADS, Pairs, contact_rows, rows_by_sector

__all__ = ["ROLES", "SKEW", "Accuracy", "FullModel", "Source", "drop", "gather", "model_datasets",
           "read_rows", "read_speeds", "save"]

Floats = NDArray[np.float64]

#: Matrices of a model file and the names (lower case) under which programs write them.
ROLES = {
    "mass": ("mass", "m", "mgg", "maa", "mxx", "maax", "mmat", "mass_matrix"),
    "stiffness": ("stiffness", "k", "kgg", "kaa", "kxx", "kaax", "kmat", "stif",
                  "stiffness_matrix"),
    "damping": ("damping", "c", "bgg", "baa", "bxx", "baax", "viscous_damping",
                "damping_matrix"),
    "stiffness_rotation": ("stiffness_rotation",),
}
#: Part of a model file for the skew part of a stiffness.
SKEW = "stiffness_unsymmetric"
#: A skew part below this share of the largest entry is rounding.
_SYMMETRIC = 1e-13
#: Beside rest: as many as the library interpolates between.
_MOST_SPEEDS = 3
# fw_run works with full matrices.
_LARGE = 3000
#: Displacements of contact surfaces are combinations of others where less of them is new.
_SPAN = 1e-9


@dataclass(frozen=True)
class Source:
    """Where a matrix is: a file, and its name there if the file has several."""

    path: Path
    name: str | None = None

    @classmethod
    def of(cls, text: str) -> Source:
        """From FILE or FILE#NAME."""
        path, _, name = text.partition("#")
        return cls(Path(path), name.lower() or None)


@dataclass(frozen=True)
class FullModel:
    """Matrices, loads, pairs and observed quantities, before any reduction.

    Attributes
    ----------
    matrices : dict of str to (n, n) sparse array
        'mass' and 'stiffness', perhaps 'damping', 'stiffness_rotation', and the skew part
        'stiffness_unsymmetric'.
    dofs : Dofs
        Their degrees of freedom.
    pairs : Pairs or None
        Contact pairs.
    loads : dict of str to (n,)
        'static', 'cosine', 'sine', 'static_rotation'.
    observe : dict of str to int or list of int
        Signed numbers of observed degrees of freedom by name; the mean of several.
    title, unit_system : str
        Attributes of the model file.
    notes : list of str or Finding
        What was done on the way.
    interfaces : Interfaces or None
        Of one sector of a cyclic structure.
    axis : str
        About which sector numbers grow, by the right hand: 'x' ... '-z'.
    mesh : ImportedMesh or None
        What the motion is shown on.
    in_cylinder : tuple of float or None
        Axis about which the components of the nodes of a sector are radial, tangential, axial.
    blade : BladeNodes or None
        The blade of a sector, by whose modes blades may differ.
    stress : StressRows or None
        Stress at points.
    speeds : dict of float to (n, n) sparse array
        Stiffness at rotation speeds [rad/s], beside that at rest.
    """

    matrices: dict[str, sp.csr_array]
    dofs: Dofs
    pairs: Pairs | None = None
    loads: dict[str, Floats] = field(default_factory=dict)
    observe: Mapping[str, int | Sequence[int]] = field(default_factory=dict)
    title: str = ""
    unit_system: str = ""
    notes: list[str | Finding] = field(default_factory=list)
    interfaces: Interfaces | None = None
    axis: str = "z"
    mesh: ImportedMesh | None = None
    in_cylinder: tuple[float, float, float] | None = None
    blade: BladeNodes | None = None
    stress: StressRows | None = None
    speeds: dict[float, sp.csr_array] = field(default_factory=dict)


def gather(sources: Mapping[str, Source], files: Sequence[Path] = (), *,
           format: str | None = None, mirror: bool = False, mass_factor: float = 1.0,
           labels: Sequence[tuple[int, int]] | None = None,
           unsymmetric: bool = False) -> FullModel:
    """Read the matrices of a model.

    Parameters
    ----------
    sources : mapping of role to Source
        Roles as in `ROLES`.
    files : sequence of Path
        Files that are searched for the roles without a source, by the usual names.
    format : str, optional
        Format of all files.
    mirror : bool
        Whether a matrix with one triangle only is meant to be symmetric.
    mass_factor : float
        Multiplies the mass, such as 1e-3 from kg to tonnes.
    labels : sequence of (node, component), optional
        Of the rows, where the files have none.
    unsymmetric : bool
        Whether an unsymmetric stiffness is meant, where its file does not say so.
    """
    cache: dict[Path, MatrixFile] = {}

    def read(path: Path) -> MatrixFile:
        if path not in cache:
            cache[path] = read_matrices(path, format)
        return cache[path]

    found: dict[str, tuple[sp.csr_array, list[tuple[int, int]] | None]] = {}
    for role in ROLES:
        if role in sources:
            matrix_file = read(sources[role].path)
            found[role] = _pick(matrix_file, sources[role].name, role), matrix_file.labels
            continue
        for path in files:
            matrix_file = read(path)
            name = next((name for name in ROLES[role] if name in matrix_file.matrices), None)
            if name is not None:
                found[role] = matrix_file.matrices[name], matrix_file.labels
                break
    for role in ("mass", "stiffness"):
        if role not in found:
            names = [f"{path}: {', '.join(read(path).matrices)}" for path in files]
            raise InputError(f"no {role} matrix: give --{role} FILE or FILE#NAME"
                             + (f"; there are {'; '.join(names)}" if names else ""))
    dofs, matrices = _align(found, labels)
    for role, matrix in matrices.items():
        if mirror and one_triangle(matrix):
            matrices[role] = mirrored(matrix)
    matrices["mass"] = matrices["mass"] * mass_factor
    notes: list[str | Finding] = [note for file in cache.values() for note in file.notes]
    if unsymmetric or any(file.unsymmetric for file in cache.values()):
        notes += _split(matrices)
    return FullModel(matrices, dofs, notes=notes)


def _split(matrices: dict[str, sp.csr_array]) -> list[Finding]:
    """Leave the symmetric part of the stiffness, and its skew part as a matrix of its own."""
    whole = matrices["stiffness"]
    skew = sp.csr_array(0.5 * (whole - whole.T))
    size = float(abs(skew).max() / max(float(abs(whole).max()), np.finfo(float).tiny))
    if size <= _SYMMETRIC:
        return []
    skew.eliminate_zeros()
    matrices["stiffness"] = sp.csr_array(0.5 * (whole + whole.T))
    matrices[SKEW] = skew
    return [Finding("warning", "stiffness", f"not symmetric, as its file says: the skew part, up "
                    f"to {size:.2g} of the largest entry, goes into {SKEW}; it feeds or takes "
                    "energy, as friction that slides at rest does")]


def read_rows(source: Source, format: str | None = None,
              role: str = "contact_rows") -> sp.csr_array:
    """The matrix of relative displacements of a file, or another whose rows are none of degrees of
    freedom."""
    return _pick(read_matrices(source.path, format), source.name, role)


def read_speeds(texts: Sequence[str], format: str | None, model: FullModel,
                mirror: bool = False) -> dict[float, sp.csr_array]:
    """Stiffness at speeds from texts SPEED=FILE[#NAME], on the degrees of freedom of the model."""
    found: dict[float, sp.csr_array] = {}
    for text in texts:
        number, equals, file = text.partition("=")
        try:
            speed = float(number)
        except ValueError:
            equals = ""
        if not equals or not file:
            raise InputError(f"--at-speed {text}: must be SPEED=FILE[#NAME], such as 500=k500.op4")
        if not (np.isfinite(speed) and speed > 0.0):
            raise InputError(f"--at-speed {text}: must be a speed above 0 in rad/s; at rest it is "
                             "--stiffness")
        if speed in found:
            raise InputError(f"--at-speed {text}: this speed is there twice")
        source = Source.of(file)
        matrix_file = read_matrices(source.path, format)
        matrix = _pick(matrix_file, source.name, "stiffness")
        where = f"--at-speed {text}"
        if matrix.shape != (model.dofs.n,) * 2:
            raise InputError(f"{where}: the matrix is {matrix.shape[0]} x {matrix.shape[1]}; "
                             f"expected {model.dofs.n} x {model.dofs.n}, as --stiffness")
        if matrix_file.labels is not None and model.dofs.labels is not None:
            place = {label: i for i, label in enumerate(matrix_file.labels)}
            if set(place) != set(model.dofs.labels):
                raise InputError(f"{where}: its degrees of freedom are not those of --stiffness")
            order = np.array([place[label] for label in model.dofs.labels])
            matrix = sp.csr_array(matrix[order][:, order])
        found[speed] = mirrored(matrix) if mirror and one_triangle(matrix) else matrix
    if len(found) > _MOST_SPEEDS:
        raise InputError(f"--at-speed: {len(found)} speeds; expected at most {_MOST_SPEEDS} beside "
                         "rest")
    return found


def _pick(file: MatrixFile, name: str | None, role: str) -> sp.csr_array:
    """The matrix of that name, or the only one, or the one with a usual name."""
    names = list(file.matrices)
    if name is None:
        usual = [known for known in ROLES.get(role, ()) if known in names]
        if len(names) > 1 and not usual:
            raise InputError(f"{file.path}: holds {', '.join(names)}; say which is the "
                             f"{role.replace('_', ' ')} with {file.path}#NAME")
        name = names[0] if len(names) == 1 else usual[0]
    if name not in names:
        raise InputError(f"{file.path}: holds no matrix '{name}'; there are {', '.join(names)}")
    return file.matrices[name]


def _align(found: Mapping[str, tuple[sp.csr_array, list[tuple[int, int]] | None]],
           given: Sequence[tuple[int, int]] | None) -> tuple[Dofs, dict[str, sp.csr_array]]:
    """The matrices on common degrees of freedom: by their labels where they have them."""
    for role, (matrix, _) in found.items():
        if matrix.shape[0] != matrix.shape[1]:
            raise InputError(f"{role} is {matrix.shape[0]} x {matrix.shape[1]}; expected a "
                             "square matrix")
    if all(labels is not None for _, labels in found.values()):
        union = sorted({label for _, labels in found.values() for label in labels or ()})
        lists = [labels for _, labels in found.values()]
        if all(labels == lists[0] for labels in lists):
            union = list(lists[0] or ())  # the order of the file
        place = {label: i for i, label in enumerate(union)}
        matrices = {}
        for role, (matrix, labels) in found.items():
            number = np.array([place[label] for label in labels or ()])
            part = sp.coo_array(matrix)
            matrices[role] = sp.csr_array((part.data, (number[part.row], number[part.col])),
                                          (len(union),) * 2)
        return Dofs(len(union), union), matrices
    sizes = {role: matrix.shape[0] for role, (matrix, _) in found.items()}
    if len(set(sizes.values())) > 1:
        raise InputError("the matrices do not have one size: "
                         + ", ".join(f"{role} {size}" for role, size in sizes.items()))
    n = next(iter(sizes.values()))
    known = given or next((labels for _, labels in found.values() if labels is not None), None)
    if known is not None and len(known) != n:
        raise InputError(f"{len(known)} labels for {n} degrees of freedom")
    return Dofs(n, known), {role: matrix for role, (matrix, _) in found.items()}


def drop(model: FullModel, *, empty: bool, fixed: Collection[int] = ()) -> FullModel:
    """Leave out held degrees of freedom, those to be `fixed` (from 1), and those without mass and
    stiffness if `empty`.

    A held one is the ground wherever its node is named; plain numbers count what is left.
    """
    stiffness = model.matrices["stiffness"]
    held = stiffness.diagonal() >= HELD
    held[np.array(sorted(fixed), dtype=np.int64) - 1] = True
    size = abs(stiffness).sum(axis=1) + abs(model.matrices["mass"]).sum(axis=1)
    out = held | ((size == 0.0) if empty else np.zeros(model.dofs.n, dtype=bool))
    if not out.any():
        return model
    kept = np.flatnonzero(~out)
    labels = model.dofs.labels
    return replace(
        model, matrices={role: sp.csr_array(matrix[kept][:, kept])
                         for role, matrix in model.matrices.items()},
        dofs=Dofs(len(kept), None if labels is None else [labels[k] for k in kept],
                  held=model.dofs.held if labels is None else model.dofs.held | {
                      labels[k] for k in np.flatnonzero(held)}, sets=model.dofs.sets),
        stress=None if model.stress is None else replace(
            model.stress, rows=sp.csr_array(model.stress.rows[:, kept])),
        speeds={speed: sp.csr_array(matrix[kept][:, kept])
                for speed, matrix in model.speeds.items()},
        notes=[*model.notes, f"{int(held.sum())} held and {int((out & ~held).sum())} empty "
               f"degrees of freedom are left out; {len(kept)} remain"])


def model_datasets(model: FullModel, n_modes: int | Accuracy | None, by_diameter: bool = False,
                   progress: Progress | None = None,
                   factor: str = "auto") -> dict[str, NDArray[Any]]:
    """Datasets of the model file by name.

    Parameters
    ----------
    model : FullModel
        The model, checked.
    n_modes : int or Accuracy or None
        Reduce to the contact coordinates, so many bonded modes (or those that an accuracy takes)
        and the attachment vectors of the loads; None: leave the degrees of freedom as they are.
    by_diameter : bool
        Reduce a sector on its own in every nodal diameter.
    progress : callable, optional
        Told how far a reduction is.
    factor : str
        Who factors, as `fretwear.reduction.reduce` takes it.
    """
    symmetric = {role: _symmetric(matrix) for role, matrix in model.matrices.items()
                 if role != SKEW}
    observed = _observed(model)
    cyclic = model.interfaces is not None
    for name, given in (("--blade", model.blade), ("--stress-rows and --stress-table",
                        model.stress), ("--at-speed", model.speeds)):
        if by_diameter and given:
            raise InputError(f"{name} does not go with --by-diameter: leave that out, so that one "
                             "set of coordinates serves all nodal diameters")
    if by_diameter and SKEW in model.matrices:
        raise InputError("an unsymmetric stiffness does not go with --by-diameter")
    if by_diameter:
        return _by_diameter(model, symmetric, n_modes, factor)
    reduction: Reduction | None = None
    if n_modes is None:
        data: dict[str, NDArray[Any]] = {role: matrix.toarray()
                                         for role, matrix in symmetric.items()}
        data.update({f"load/{name}": load for name, load in model.loads.items()})
        if model.pairs is not None:
            data |= _sides_as_given(model.pairs, model.dofs.n)
        if model.interfaces is not None:
            data |= {"cyclic/left": model.interfaces.left, "cyclic/right": model.interfaces.right}
    else:
        data, reduction = (_reduced_sector if cyclic else _reduced)(model, symmetric, n_modes,
                                                                    progress, factor)
        observed = reduction.row(observed)
    if SKEW in model.matrices:
        data[SKEW] = _skew(model.matrices[SKEW], reduction)
    if model.mesh is not None:
        data |= mesh_datasets(recovery_mesh(model, reduction))
    if model.blade is not None:
        data |= blade_datasets(model, symmetric, reduction)
    if model.stress is not None:
        data |= stress_datasets(model.stress, reduction)
    if model.speeds:
        data |= _at_speeds(model, data, reduction)
    if model.pairs is not None:
        data.update(_pair_values(model.pairs))
    if model.observe:
        data["observe/name"] = strings(model.observe)
        data["observe/matrix"] = observed if n_modes is not None else observed.toarray()
    return data


def _sides_as_given(pairs: Pairs, n: int) -> dict[str, NDArray[Any]]:
    """Sides of pairs of a model that is not reduced; relative displacements that are combinations
    of degrees of freedom have their numbers behind these."""
    if pairs.rows is None:
        return {"contact/side_1": pairs.side_1, "contact/side_2": pairs.side_2}
    one, two, number, _ = rows_by_sector(pairs, n)
    return _combinations(one.toarray(), two, two.toarray(), number)


def _combinations(one: Floats, two: sp.csr_array, moved: Floats, number: NDArray[np.int32]
                  ) -> dict[str, NDArray[Any]]:
    """Sides as numbers of combinations, behind all degrees of freedom: those of side 1, then those
    of side 2 (`moved`, in the coordinates of the model) that `two` has."""
    n = one.shape[1]
    there = np.diff(two.indptr) > 0
    second = np.where(there, n + len(one) + np.cumsum(there), 0)
    # The number 0 of a direction that a pair has not.
    behind = np.concatenate(([0], second))
    return {"contact/side_1": np.where(number != 0, number + n, 0).astype(np.int32),
            "contact/side_2": behind[number].astype(np.int32),
            "row/matrix": np.vstack((one, moved[there]))}


def _at_speeds(model: FullModel, data: dict[str, NDArray[Any]],
               reduction: Reduction | None) -> dict[str, NDArray[Any]]:
    """Stiffness at rest and at the speeds, by one basis; the centrifugal load goes with these."""
    if "stiffness_rotation" in model.matrices:
        raise InputError("--at-speed beside --stiffness-rotation: either says what grows with the "
                         "speed; leave one out")
    found: dict[str, NDArray[Any]] = {"speed/value": np.array([0.0, *sorted(model.speeds)])}
    per_square = data.pop("load/static_rotation", None)
    for number, speed in enumerate(found["speed/value"]):
        if number == 0:
            found["speed/0/stiffness"] = data["stiffness"]
        else:
            whole = _symmetric(model.speeds[float(speed)])
            found[f"speed/{number}/stiffness"] = (whole.toarray() if reduction is None
                                                  else reduction.matrix(whole))
        if per_square is not None:
            found[f"speed/{number}/static"] = speed**2 * per_square
    return found


def _skew(matrix: sp.csr_array, reduction: Reduction | None) -> NDArray[Any]:
    """A skew matrix on the coordinates of a reduction, T^T A T, skew to the last bit."""
    if reduction is None:
        return matrix.toarray()
    product = reduction.row(np.ascontiguousarray(reduction.row(matrix).T)).T
    found: NDArray[Any] = 0.5 * (product - product.T)
    return found


def _symmetric(matrix: sp.csr_array) -> sp.csr_array:
    """The symmetric part: the matrix itself, as most are, without a copy of it."""
    half = (matrix + matrix.T) * 0.5
    return matrix if abs(half - matrix).sum() == 0.0 else half


def _reduced(model: FullModel, matrices: dict[str, sp.csr_array], n_modes: int | Accuracy,
             progress: Progress | None, factor: str) -> tuple[dict[str, NDArray[Any]], Reduction]:
    if model.pairs is None:
        raise InputError("--reduce needs contact pairs (--pairs): the reduction keeps their "
                         "relative displacements")
    rows, number = contact_rows(model.pairs, model.dofs.n)
    data, reduction = _condensed(model, matrices, rows, n_modes, progress, factor)
    data["contact/side_1"] = number.astype(np.int32)
    data["contact/side_2"] = np.zeros_like(data["contact/side_1"])
    return data, reduction


def _reduced_sector(model: FullModel, matrices: dict[str, sp.csr_array], n_modes: int | Accuracy,
                    progress: Progress | None,
                    factor: str) -> tuple[dict[str, NDArray[Any]], Reduction]:
    """Interfaces and both sides of the pairs as they are, and modes with all of them held."""
    assert model.interfaces is not None
    if model.pairs is not None and model.pairs.rows is not None:
        return _reduced_rows(model, model.pairs, model.interfaces, matrices, n_modes, progress,
                             factor)
    sides = np.zeros((2, 0, 3), dtype=np.int32) if model.pairs is None else np.stack(
        (model.pairs.side_1, model.pairs.side_2))
    ends = np.concatenate((model.interfaces.left, model.interfaces.right))
    chosen = np.unique(np.concatenate((ends, np.abs(sides[sides != 0])))) - 1
    kept = np.concatenate((ends - 1, np.setdiff1d(chosen, ends - 1)))
    rows = sp.csr_array((np.ones(len(kept)), (np.arange(len(kept)), kept)),
                        (len(kept), model.dofs.n))
    place = np.zeros(model.dofs.n + 1, dtype=np.int32)
    place[kept + 1] = np.arange(1, len(kept) + 1)
    data, reduction = _condensed(model, matrices, rows, n_modes, progress, factor)
    n = len(model.interfaces.left)
    data["cyclic/left"] = np.arange(1, n + 1, dtype=np.int32)
    data["cyclic/right"] = np.arange(n + 1, 2 * n + 1, dtype=np.int32)
    if model.pairs is not None:
        for name, side in zip(("contact/side_1", "contact/side_2"), sides):
            data[name] = np.sign(side) * place[np.abs(side)]
    return data, reduction


def _reduced_rows(model: FullModel, pairs: Pairs, interfaces: Interfaces,
                  matrices: dict[str, sp.csr_array], n_modes: int | Accuracy,
                  progress: Progress | None, factor: str
                  ) -> tuple[dict[str, NDArray[Any]], Reduction]:
    """The same where sides of pairs are combinations of degrees of freedom: kept is what spans
    them beside the interfaces, as more than one may share a node."""
    n = model.dofs.n
    one, two, number, _ = rows_by_sector(pairs, n)
    ends = np.concatenate((interfaces.left, interfaces.right)) - 1
    inner = np.ones(n)
    inner[ends] = 0.0
    beside = sp.csc_array(sp.vstack((one, two)) @ sp.diags_array(inner))
    used = np.flatnonzero(abs(beside).sum(axis=0))
    span, triangle, _ = qr(beside[:, used].toarray().T, mode="economic", pivoting=True)
    size = np.abs(np.diag(triangle))
    span = span[:, :int((size > _SPAN * size.max(initial=0.0)).sum())]
    m = len(ends)
    kept = sp.block_array([
        [sp.csr_array((np.ones(m), (np.arange(m), ends)), (m, n))],
        [sp.csr_array(span.T) @ sp.csr_array((np.ones(len(used)), (np.arange(len(used)), used)),
                                             (len(used), n))]], format="csr")
    data, reduction = _condensed(model, matrices, kept, n_modes, progress, factor)
    data["cyclic/left"] = np.arange(1, m // 2 + 1, dtype=np.int32)
    data["cyclic/right"] = np.arange(m // 2 + 1, m + 1, dtype=np.int32)
    return data | _combinations(np.asarray(reduction.row(one)), two,
                                np.asarray(reduction.row(two)), number), reduction


def _condensed(model: FullModel, matrices: dict[str, sp.csr_array], rows: sp.csr_array,
               n_modes: int | Accuracy, progress: Progress | None,
               factor: str) -> tuple[dict[str, NDArray[Any]], Reduction]:
    """Matrices and loads, and the reduction that keeps the given rows."""
    loads = np.column_stack([model.loads[name] for name in model.loads] or
                            [np.zeros(model.dofs.n)])
    attached = np.column_stack((loads, _observed(model).toarray().T))
    system = reduce(matrices["mass"], matrices["stiffness"], rows, **mode_options(n_modes),
                    loads=loads, damping=matrices.get("damping"), attachments=attached,
                    progress=progress, factor=factor)
    data: dict[str, NDArray[Any]] = {"mass": system.mass, "stiffness": system.stiffness}
    if system.damping is not None:
        data["damping"] = system.damping
    if "stiffness_rotation" in matrices:
        data["stiffness_rotation"] = system.reduction.matrix(matrices["stiffness_rotation"])
    data.update({f"load/{name}": system.loads[:, k] for k, name in enumerate(model.loads)})
    if system.error is not None and system.frequency is not None:
        data |= range_datasets(system.frequency, system.error)
    return data, system.reduction


def _observed(model: FullModel) -> sp.csr_array:
    """Rows of the observed degrees of freedom (n_observed, n)."""
    rows = sp.lil_array((len(model.observe), model.dofs.n))
    for k, chosen in enumerate(model.observe.values()):
        signed = np.atleast_1d(np.asarray(chosen, dtype=int))
        for dof in signed.tolist():
            rows[k, abs(dof) - 1] += np.sign(dof) / len(signed)
    return sp.csr_array(rows)


def _by_diameter(model: FullModel, matrices: dict[str, sp.csr_array],
                 n_modes: int | Accuracy | None, factor: str) -> dict[str, NDArray[Any]]:
    """Complex matrices of every nodal diameter; pairs have no sides any more but rows."""
    if n_modes is None:
        raise InputError("--by-diameter goes with --reduce N_MODES")
    if model.mesh is not None:
        raise InputError("--mesh does not go with --by-diameter: every nodal diameter has "
                         "coordinates of its own, which are no motions of one mesh; leave out "
                         "--by-diameter")
    sectors, data = reduce_diameters(model, matrices, n_modes, _observed(model), factor)
    data |= sectors.datasets()
    if model.pairs is not None:
        data |= _pair_values(replace(model.pairs, sector_2=None))
    if model.observe:
        data["observe/name"] = strings(model.observe)
    return data


def _pair_values(pairs: Pairs) -> dict[str, NDArray[Any]]:
    values = {"mu": pairs.mu, "gap": pairs.gap, "area": pairs.area, "position": pairs.position,
              "patch": None if pairs.patch is None else strings(pairs.patch),
              "sector_2": pairs.sector_2}
    return {f"contact/{name}": value for name, value in values.items() if value is not None}


def save(model: FullModel, path: str | Path, n_modes: int | Accuracy | None = None,
         by_diameter: bool = False, progress: Progress | None = None,
         factor: str = "auto", verify: float | None = None) -> list[Finding]:
    """Write the model file of a checked model; returns what is to be known about it, with the
    error of the stiffness of the joint at the frequency `verify` [Hz]."""
    data = model_datasets(model, n_modes, by_diameter, progress, factor)
    groups = {} if model.interfaces is None else {
        "cyclic": {"n_sectors": model.interfaces.n_sectors}}
    if by_diameter:
        groups["cyclic"]["n_physical"] = int(data["contact/side_1"].max())
    write_model_file(path, data, title=model.title or Path(path).stem,
                     unit_system=model.unit_system, groups=groups)
    n = max(len(values) for name, values in data.items() if name.split("/")[-1] == "mass")
    found = [Finding("note", str(path), f"{n} degrees of freedom, "
                     f"{0 if model.pairs is None else len(model.pairs)} pairs, loads "
                     + (", ".join(name for name in LOADS if name in model.loads) or "none"))]
    if model.blade is not None:
        found.append(Finding("note", str(path), "frequencies of the blade alone [Hz]: " + ", ".join(
            f"{omega / (2.0 * np.pi):.6g}" for omega in data["mistuning/row_omega"])))
    if model.stress is not None:
        found.append(Finding("note", str(path), f"stress at {len(model.stress.points)} points"))
    if "reduction/error" in data:
        found.append(Finding("note", str(path), "estimated error of the stiffness of the joint up "
                             f"to {data['reduction/frequency'][0]:.6g} Hz: "
                             f"{data['reduction/error'][0]:.2g}"))
    if verify is not None:
        found.append(Finding("note", str(path), "error of the stiffness of the joint at "
                             f"{verify:.6g} Hz, by the full matrices: "
                             f"{_true_error(model, data, verify, factor):.2g}"))
    if n_modes is not None:
        found.append(Finding("note", str(path), f"factors by {chosen_engine(factor)}"))
    if n > _LARGE:
        found.append(Finding("warning", str(path), f"fw_run works with full matrices of {n} x {n}; "
                             "reduce the model with --reduce N_MODES"))
    return found


def _true_error(model: FullModel, data: Mapping[str, NDArray[Any]], frequency: float,
                factor: str) -> float:
    if model.pairs is None or model.interfaces is not None:
        raise InputError("--verify is for structures with pairs, without --sectors")
    rows, _ = contact_rows(model.pairs, model.dofs.n)
    mass, stiffness = ((matrix + matrix.T) * 0.5 for matrix in
                       (model.matrices["mass"], model.matrices["stiffness"]))
    return true_error(data["mass"], data["stiffness"], mass, stiffness, rows,
                      2.0 * np.pi * frequency, engine=factor)
