"""What one point of a result shows on the mesh of its model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..mesh import RecoveryMesh
from ..result import Result
from ..rows import choose_point, pair_fields, synthesis
from .mesh import read_mesh
from .recovery import recover_displacement
from .wave import delayed, turned

if TYPE_CHECKING:
    import meshio

__all__ = ["Fields", "export_mesh"]

Floats = NDArray[np.float64]

#: Instants on which extremes over a period are looked for.
_INSTANTS = 256


def export_mesh(result: Result | str | Path, point: int | None = None,
                phase: float | None = None, *, sectors: int = 1, axis: str = "z") -> meshio.Mesh:
    """Mesh of the model with the fields of one point of a result.

    Parameters
    ----------
    result : Result or path
        Result of a model file with a mesh, or of a generated sector.
    point : int, optional
        Solution point or wear step from 0; the largest amplitude, or the last wear step without.
    phase : float, optional
        Instant of `displacement` [degrees]; where the first observed quantity is largest without.
    sectors : int
        Sectors of a cyclic structure; 0 are all of them.
    axis : str
        About which the next sector is turned, by the right hand: "x", "y" or "z"; "-x" the other
        way.

    Returns
    -------
    meshio.Mesh
        Cells and the facets of the pairs. Point data: `displacement` (at the instant),
        `displacement_static`, `displacement_cosine`, `displacement_sine` (first harmonic) and
        `vibration`, the largest distance from the static position. Cell data: `body`, `pair`
        (from 1; 0 on others), and `pair_fields`, NaN on others; of several sectors
        `sector`. Where the model has rows of stress at points of the mesh, point data
        `stress_amplitude`, `stress_mean` and `utilisation`, NaN at others.

    Raises
    ------
    InputError
        No mesh belongs to the model, or the displacement cannot be recovered.
    """
    if not isinstance(result, Result):
        result = Result(result)
    point = choose_point(result, None) if point is None else point
    return Fields(result, point, sectors=sectors, axis=axis).at(phase)


class Fields:
    """What one point of a result shows on the mesh of its model."""

    def __init__(self, result: Result, point: int, *, sectors: int = 1, axis: str = "z") -> None:
        self.result, self.point = result, point
        self.turns = _turns(result, sectors, axis)
        self.mesh: RecoveryMesh = read_mesh(result.model_file)
        self.pairs = pair_fields(result, point)
        self.stress = _stress(result, point, len(self.mesh.points))
        self.coefficients: Floats | None = None
        if "contact/force" in result or "wear/depth" not in result:
            recovered = recover_displacement(result, points=[point])[point]
            if not np.isfinite(recovered).all():
                raise InputError(f"{result.name}: point {point + 1} holds no solution")
            shape = (len(recovered), *self.mesh.points.shape)
            alone = recovered @ self.mesh.basis.T
            # Sector after sector: later by its phase, and turned to its place.
            self.coefficients = np.concatenate([
                delayed(alone, phase).reshape(shape) @ turn.T for phase, turn in self.turns],
                axis=1)

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
        mesh, n = self.mesh, len(self.turns)
        shift = len(mesh.points) * np.arange(n)
        # Facets belong to the body of a cell that has their first corner.
        owner = np.zeros(len(mesh.points), dtype=np.int32)
        owner[np.where(mesh.cells >= 0, mesh.cells, mesh.cells[:, :1])] = mesh.body[:, None]
        parts: list[tuple[str, Any, Any, Any]] = [
            (name, mesh.corners(which, name), mesh.body[which], None)
            for name, which in mesh.blocks()]
        parts.append(("quad", mesh.facets, owner[mesh.facets[:, 0]], mesh.pair))
        cell_data: dict[str, list[Any]] = {name: [] for name in ("body", "pair", *self.pairs)}
        if n > 1:
            cell_data["sector"] = []
        for _, corners, body, pair in parts:
            cell_data["body"].append(np.tile(body.astype(np.int32), n))
            number = np.zeros(len(corners)) if pair is None else pair + 1
            cell_data["pair"].append(np.tile(number.astype(np.int32), n))
            if n > 1:
                cell_data["sector"].append(np.repeat(np.arange(n, dtype=np.int32), len(corners)))
            for name, (values, _) in self.pairs.items():
                cell_data[name].append(np.full(n * len(corners), np.nan) if pair is None
                                       else np.tile(values[pair], n))
        points = np.asarray(mesh.points, dtype=float)
        return meshio.Mesh(np.concatenate([points @ turn.T for _, turn in self.turns]),
                           [(name, np.concatenate([corners + k for k in shift]))
                            for name, corners, _, _ in parts],
                           point_data=self._point_data(phase) | {
                               name: np.tile(values, n) for name, (values, _) in
                               self.stress.items()}, cell_data=cell_data)

    def summary(self) -> str:
        """Fields with their units and largest values, one line each."""
        length = self.result.units("amplitude")
        n = len(self.turns)
        lines = [f"{self.result.name}: point {self.point + 1}, {n * len(self.mesh.points)} points, "
                 f"{n * len(self.mesh.cells)} cells, {n * len(self.mesh.facets)} facets in "
                 "contact" + (f", {n} sectors" if n > 1 else "")]
        shown = {name: (np.linalg.norm(values, axis=1) if values.ndim == 2 else values, length)
                 for name, values in self._point_data(None).items()}
        for name, (values, units) in {**shown, **self.stress, **self.pairs}.items():
            lines.append(f"  {name:20s} {np.nanmin(values):12.5g} to {np.nanmax(values):12.5g} "
                         f"{units}")
        return "\n".join(lines)


def _stress(result: Result, point: int, n_points: int) -> dict[str, tuple[Floats, str]]:
    """Stress at the points of the mesh, with units; of several bodies at one point the largest."""
    if "stress/amplitude" not in result or "blades/largest" in result:
        return {}
    with h5py.File(result.model_file, "r") as file:
        if "stress/mesh_point" not in file:
            return {}
        at = file["stress/mesh_point"][()]
    there = np.flatnonzero((at >= 0) & (at < n_points))
    # The last one stays: that of the largest amplitude.
    there = there[np.argsort(result["stress/amplitude"][point, there], kind="stable")]
    found = {}
    for name, shown in (("amplitude", "stress_amplitude"), ("mean", "stress_mean"),
                        ("utilisation", "utilisation")):
        if f"stress/{name}" in result and len(there):
            values = np.full(n_points, np.nan)
            values[at[there]] = result[f"stress/{name}"][point, there]
            found[shown] = values, result.units(f"stress/{name}")
    return found


def _turns(result: Result, sectors: int, axis: str) -> list[tuple[float, Floats]]:
    """Delay [rad] and rotation (3, 3) of every sector that is shown."""
    if sectors == 1:
        return [(0.0, np.eye(3))]
    if "engine_order" not in result.attributes:
        raise InputError(f"{result.name}: has no sectors: give the case &cyclic n_sectors and "
                         "engine_order")
    n = int(result.attributes["n_sectors"])
    if not 0 <= sectors <= n:
        raise InputError(f"{sectors} sectors: there are {n}")
    phase = 2.0 * np.pi * (int(result.attributes["engine_order"]) % n) / n
    return [(j * phase, turned(axis, 2.0 * np.pi * j / n)) for j in range(sectors or n)]
