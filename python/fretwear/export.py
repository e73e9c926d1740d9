"""`fretwear export`: the mesh of a model with the deformation of a result, for ParaView."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .errors import InputError, OutputError
from .export_mesh import RecoveryMesh, read_mesh
from .export_recovery import model_path, recover_displacement
from .result import STATES, Result

if TYPE_CHECKING:
    import meshio

__all__ = ["Fields", "add_arguments", "choose_point", "export_mesh", "main", "pair_areas",
           "pair_fields", "synthesis"]

Floats = NDArray[np.float64]

#: Instants on which extremes over a period are looked for.
_INSTANTS = 256


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `fretwear export`."""
    parser.add_argument("result", help="result file")
    parser.add_argument("output", help="file to write, .vtu (or another format of meshio)")
    parser.add_argument("--point", type=int, metavar="N",
                        help="solution point or wear step, from 1; -1 is the last (default: the "
                             "largest amplitude, or the last wear step)")
    parser.add_argument("--phase", type=float, metavar="DEGREES",
                        help="instant of the period for `displacement` (default: where the first "
                             "observed quantity is largest)")
    parser.add_argument("--frames", type=int, metavar="N",
                        help="write N instants of a period as OUTPUT_000.vtu, ..., and OUTPUT.pvd "
                             "that plays them")


def main(options: argparse.Namespace) -> int:
    """Run `fretwear export`."""
    result, output = Result(options.result), Path(options.output)
    point = choose_point(result, options.point)
    if options.frames is None:
        written = [(output, options.phase)]
    elif options.frames < 1:
        raise InputError(f"--frames {options.frames}: must be at least 1")
    else:
        written = [(output.with_name(f"{output.stem}_{k:03d}{output.suffix}"),
                    360.0 * k / options.frames) for k in range(options.frames)]
    fields = Fields(result, point)
    for path, phase in written:
        _write(fields.at(phase), path)
    if options.frames is not None:
        _write_collection(output.with_suffix(".pvd"), [path for path, _ in written])
    print(fields.summary())
    return 0


def choose_point(result: Result, number: int | None) -> int:
    """Index from 0 of a point or wear step counted from 1, or from the end where negative.

    Without a number: the largest amplitude (where nothing converged, the smallest residual), or
    the last wear step.
    """
    n = len(result.depth) if "wear/depth" in result else result.n_points
    if n == 0:
        raise InputError(f"{result.path}: holds no points")
    if number is None:
        if "wear/depth" in result:
            return n - 1
        return result.peak() if result.converged.any() else int(np.nanargmin(result.residual))
    if number == 0 or abs(number) > n:
        raise InputError(f"{result.path}: point {number}: there are {n}, counted from 1")
    return number - 1 if number > 0 else n + number


def synthesis(n_coefficients: int, tau: Floats) -> Floats:
    """Values of 1, cos tau, sin tau, cos 2 tau, ... (n_coefficients, n_time)."""
    rows = [np.ones_like(tau)]
    for h in range(1, (n_coefficients - 1) // 2 + 1):
        rows += [np.cos(h * tau), np.sin(h * tau)]
    return np.array(rows)


def pair_areas(result: Result) -> Floats | None:
    """Areas of the pairs (n_pairs), None where the file does not hold them."""
    if "contact/area" not in result:
        return None
    return result["contact/area"]


def pair_fields(result: Result, point: int) -> dict[str, tuple[Floats, str]]:
    """What a result says of every pair at one point.

    Returns
    -------
    dict
        Values (n_pairs) and their units by name: stick, slip, open (shares of the period),
        pressure (mean over the period), dissipation (per area and cycle), wear_depth, wear_rate.
    """
    found: dict[str, tuple[Floats, str]] = {}
    area = pair_areas(result)
    if "contact/fraction" in result and point < len(result.fraction):
        for k, state in enumerate(STATES):
            found[state] = result.fraction[point, :, k], "1"
    if "contact/force" in result and point < len(result.force) and area is not None:
        found["pressure"] = (-result.force[point, 0, :, 2] / area,
                             _ratio(result, "contact/force", "contact/area"))
        found["dissipation"] = (result.dissipation[point] / area,
                                _ratio(result, "contact/dissipation", "contact/area"))
    if "wear/depth" in result:
        found["wear_depth"] = result.depth[point], result.units("wear/depth")
        found["wear_rate"] = result.rate[point], result.units("wear/rate")
    return found


def _ratio(result: Result, over: str, under: str) -> str:
    upper, lower = result.units(over), result.units(under)
    return f"{upper}/{lower}" if upper and lower else ""


def export_mesh(result: Result | str | Path, point: int | None = None,
                phase: float | None = None) -> meshio.Mesh:
    """Mesh of the model with the fields of one point of a result.

    Parameters
    ----------
    result : Result or path
        Result of a model file with a mesh, or of a generated sector.
    point : int, optional
        Solution point or wear step from 0; the largest amplitude, or the last wear step without.
    phase : float, optional
        Instant of `displacement` [degrees]; where the first observed quantity is largest without.

    Returns
    -------
    meshio.Mesh
        Hexahedra and the facets of the pairs. Point data: `displacement` (at the instant),
        `displacement_static`, `displacement_cosine`, `displacement_sine` (first harmonic) and
        `vibration`, the largest distance from the static position. Cell data: `body`, `pair`
        (from 1; 0 on hexahedra), and `pair_fields`, NaN on hexahedra.

    Raises
    ------
    InputError
        No mesh belongs to the model, or the displacement cannot be recovered.
    """
    if not isinstance(result, Result):
        result = Result(result)
    return Fields(result, choose_point(result, None) if point is None else point).at(phase)


class Fields:
    """What one point of a result shows on the mesh of its model."""

    def __init__(self, result: Result, point: int) -> None:
        path = model_path(result)
        if path is None:
            raise InputError(f"{result.path}: inline models have no mesh to export")
        self.result, self.point = result, point
        self.mesh: RecoveryMesh = read_mesh(path)
        self.pairs = pair_fields(result, point)
        self.coefficients: Floats | None = None
        if "contact/force" in result or "wear/depth" not in result:
            recovered = recover_displacement(result, points=[point])[point]
            if not np.isfinite(recovered).all():
                raise InputError(f"{result.path}: point {point + 1} holds no solution")
            shape = (len(recovered), *self.mesh.points.shape)
            self.coefficients = (recovered @ self.mesh.basis.T).reshape(shape)

    def _largest_instant(self) -> float:
        """Where in the period the first observed quantity is largest [rad]."""
        tau = 2.0 * np.pi * np.arange(_INSTANTS) / _INSTANTS
        observed = self.result.coefficients[self.point, :, 0]
        return float(tau[np.argmax(np.abs(observed @ synthesis(len(observed), tau)))])

    def _point_data(self, phase: float | None) -> dict[str, Floats]:
        if self.coefficients is None:
            return {}
        c = self.coefficients
        instant = self._largest_instant() if phase is None else np.radians(phase)
        tau = 2.0 * np.pi * np.arange(_INSTANTS) / _INSTANTS
        moving = np.einsum("cpi,ct->tpi", c[1:], synthesis(len(c), tau)[1:])
        return {
            "displacement": np.einsum("cpi,c->pi", c,
                                      synthesis(len(c), np.array([instant]))[:, 0]),
            "displacement_static": c[0], "displacement_cosine": c[1], "displacement_sine": c[2],
            "vibration": np.linalg.norm(moving, axis=2).max(axis=0)}

    def at(self, phase: float | None) -> meshio.Mesh:
        """Mesh with all fields at an instant [degrees]."""
        try:
            import meshio
        except ImportError:
            raise InputError("fretwear export needs meshio: pip install meshio") from None
        mesh = self.mesh
        nowhere = np.full(len(mesh.cells), np.nan)
        # Facets belong to the body of a cell that has their corners.
        owner = np.zeros(int(mesh.cells.max()) + 1, dtype=np.int32)
        owner[mesh.cells] = mesh.body[:, None]
        cell_data: dict[str, list[Any]] = {
            "body": [mesh.body.astype(np.int32), owner[mesh.facets[:, 0]]],
            "pair": [np.zeros(len(mesh.cells), dtype=np.int32), mesh.pair.astype(np.int32) + 1]}
        for name, (values, _) in self.pairs.items():
            cell_data[name] = [nowhere, values[mesh.pair]]
        return meshio.Mesh(np.asarray(mesh.points, dtype=float),
                           [("hexahedron", mesh.cells), ("quad", mesh.facets)],
                           point_data=self._point_data(phase), cell_data=cell_data)

    def summary(self) -> str:
        """Fields with their units and largest values, one line each."""
        length = self.result.units("amplitude")
        lines = [f"{self.result.path}: point {self.point + 1}, {len(self.mesh.points)} points, "
                 f"{len(self.mesh.cells)} hexahedra, {len(self.mesh.facets)} facets in contact"]
        shown = {name: (np.linalg.norm(values, axis=1) if values.ndim == 2 else values, length)
                 for name, values in self._point_data(None).items()}
        for name, (values, units) in {**shown, **self.pairs}.items():
            lines.append(f"  {name:20s} {np.nanmin(values):12.5g} to {np.nanmax(values):12.5g} "
                         f"{units}")
        return "\n".join(lines)


def _write(mesh: meshio.Mesh, path: Path) -> None:
    if not path.absolute().parent.is_dir():
        raise OutputError(f"{path}: there is no folder {path.absolute().parent}")
    import meshio

    try:
        mesh.write(path)
    except (meshio.WriteError, meshio.ReadError, KeyError) as error:
        raise InputError(f"{path}: meshio cannot write this: {error}") from None


def _write_collection(path: Path, files: list[Path]) -> None:
    """ParaView collection of instants; time runs from 0 to 1 over the period."""
    entries = "".join(f'    <DataSet timestep="{k / len(files):.6f}" file="{name.name}"/>\n'
                      for k, name in enumerate(files))
    path.write_text('<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n'
                    f"  <Collection>\n{entries}  </Collection>\n</VTKFile>\n")
