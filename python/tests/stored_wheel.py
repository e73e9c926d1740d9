"""A sector of quadratic tetrahedra as a job of CalculiX stores it, and the wheel of all sectors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from skfem import Basis, BilinearForm, ElementTetP2, ElementVector, MeshTet1
from skfem.helpers import ddot, dot, eye, sym_grad, trace
from skfem.models.elasticity import lame_parameters

from fretwear.importer import Dofs

__all__ = ["N_SECTORS", "StoredWheel"]

N_SECTORS = 5
_DENSITY = 7.85e-9
#: Of positions that are the same, in mm.
_PLACE = 6


class StoredWheel:
    """Files sector.inp, .sti, .mas and .dof of a folder.

    Parameters
    ----------
    folder : Path
        Where they are written.
    held : bool
        Whether the bore is held, and has no rows.
    seed : int, optional
        Draws the number of sectors, the shape of the cut faces, the axis and the numbers of nodes.
    """

    def __init__(self, folder: Path, held: bool = True, seed: int | None = None) -> None:
        random = np.random.default_rng(2 if seed is None else seed)
        self.n_sectors, self.axis = N_SECTORS, "z"
        rings, bend, tilt = np.array([20.0, 32.0, 50.0]), 0.004, 0.02
        if seed is not None:
            self.n_sectors, self.axis = int(random.integers(3, 8)), str(random.choice([*"xyz"]))
            rings = np.cumsum([20.0, *random.uniform(6.0, 14.0, 2)])
            bend, tilt = random.uniform(-0.01, 0.01), random.uniform(-0.04, 0.04)
        half = np.pi / self.n_sectors
        plain = MeshTet1.init_tensor(rings, np.linspace(-half, half, 3), np.array([0.0, 9.0]))
        radius, angle, height = plain.p
        # A cut face that is curved, and tilts along the axis: no plane through it.
        angle = angle + bend * (radius - 20.0) + tilt * height
        # The axis and both directions across it, in the order of the right hand.
        places = np.stack((radius * np.cos(angle), radius * np.sin(angle), height))
        mesh = MeshTet1(np.roll(places, "zxy".index(self.axis), axis=0), plain.t)
        basis = Basis(mesh, ElementVector(ElementTetP2()), intorder=4)
        scalar = Basis(mesh, ElementTetP2(), intorder=4)
        lam, mu = lame_parameters(2.1e5, 0.3)

        @BilinearForm
        def stiffness(u, v, w):  # type: ignore[no-untyped-def]
            strain = sym_grad(u)
            return ddot(2.0 * mu * strain + lam * eye(trace(strain), 3), sym_grad(v))

        @BilinearForm
        def mass(u, v, w):  # type: ignore[no-untyped-def]
            return _DENSITY * dot(u, v)

        place = np.zeros((scalar.N, 3), dtype=int)
        for component in range(3):
            place[scalar.element_dofs, component] = basis.element_dofs[component::3]
        rows = place.ravel()
        self.mass, self.stiffness = (sp.csr_array(form.assemble(basis))[rows][:, rows]
                                     for form in (mass, stiffness))
        self.points = scalar.doflocs.T.copy()
        own = np.hypot(*np.roll(self.points, -"zxy".index(self.axis), axis=1)[:, :2].T)
        self.bore = np.flatnonzero(own < 20.0 + 1e-6)
        # Middles of edges of the bore lie on chords.
        at = {tuple(np.round(p, _PLACE)): k for k, p in enumerate(self.points)}
        edges = [(a, b) for a in self.bore for b in self.bore if a < b]
        chords = [at.get(tuple(np.round(0.5 * (self.points[a] + self.points[b]), _PLACE)))
                  for a, b in edges]
        self.bore = np.unique([*self.bore, *(k for k in chords if k is not None)])
        self.corners = scalar.element_dofs[:4].T
        self.cells = [[*cell, *(at[tuple(np.round(0.5 * (self.points[cell[a]]
                                                         + self.points[cell[b]]), _PLACE))]
                                for a, b in ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)))]
                      for cell in self.corners]
        turned = self.points @ self.turn(1).T
        self.left = [k for k, p in enumerate(turned) if tuple(np.round(p, _PLACE)) in at]
        self.right = [at[tuple(np.round(turned[k], _PLACE))] for k in self.left]
        self.n_cut = len(set(self.left) - set(self.bore.tolist()))
        self.nodes = 10 + 3 * random.permutation(len(self.points))
        self._write(folder, held)

    @staticmethod
    def dofs(labels: Sequence[tuple[int, int]],
             sets: Mapping[str, Sequence[int]] | None = None) -> Dofs:
        """Names of rows."""
        return Dofs(len(labels), labels, sets=sets)

    def turn(self, sectors: int) -> np.ndarray:
        """Rotation by so many sectors."""
        angle = 2.0 * np.pi * sectors / self.n_sectors
        c, s = np.cos(angle), np.sin(angle)
        about_z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        k = "zxy".index(self.axis)
        found: np.ndarray = np.roll(np.roll(about_z, k, axis=0), k, axis=1)
        return found

    def whole(self) -> np.ndarray:
        """Frequencies of the wheel of all sectors [rad/s], assembled in global components."""
        index: dict[tuple[float, ...], int] = {}
        wholes = [sp.csr_array((3 * len(self.points) * self.n_sectors,) * 2) for _ in range(2)]
        held: set[int] = set()
        n = wholes[0].shape[0]
        for sector in range(self.n_sectors):
            turn = self.turn(sector)
            at = np.array([index.setdefault(tuple(np.round(p, _PLACE) + 0.0), len(index))
                           for p in self.points @ turn.T])
            held |= {3 * int(at[k]) + c for k in self.bore for c in range(3)}
            rows = (3 * at[:, None] + np.arange(3)).ravel()
            frames = sp.kron(sp.identity(len(self.points)), turn, format="csr")
            for k, matrix in enumerate((self.mass, self.stiffness)):
                part = sp.coo_array(frames @ matrix @ frames.T)
                wholes[k] = wholes[k] + sp.csr_array(
                    (part.data, (rows[part.row], rows[part.col])), (n, n))
        free = np.setdiff1d(np.arange(3 * len(index)), sorted(held))
        mass, stiffness = (matrix[free][:, free].toarray() for matrix in wholes)
        found: np.ndarray = np.sqrt(la.eigh(stiffness, mass, eigvals_only=True))
        return found

    def _write(self, folder: Path, held: bool) -> None:
        names = [(k, c) for k in np.argsort(self.nodes) for c in (1, 2, 3)
                 if not held or k not in self.bore]
        (folder / "sector.dof").write_text("".join(f"{self.nodes[k]}.{c}\n" for k, c in names))
        rows = np.array([3 * k + c - 1 for k, c in names])
        for suffix, matrix in ((".sti", self.stiffness), (".mas", self.mass)):
            part = sp.coo_array(sp.triu(matrix[rows][:, rows]))
            (folder / f"sector{suffix}").write_text("".join(
                f"{i + 1} {j + 1} {value: .14e}\n"
                for i, j, value in zip(part.row, part.col, part.data)))
        corner = set(self.corners.ravel().tolist())

        def named(chosen: Sequence[int]) -> str:
            return "".join(f"{self.nodes[k]},\n" for k in chosen)

        (folder / "sector.inp").write_text("*NODE\n" + "".join(
            f"{node}, {x:.14g}, {y:.14g}, {z:.14g}\n"
            for node, (x, y, z) in zip(self.nodes, self.points))
            + "*ELEMENT, TYPE=C3D10, ELSET=DISK\n" + "".join(
                ", ".join(map(str, [k, *self.nodes[cell]])) + "\n"
                for k, cell in enumerate(self.cells, 1))
            + "*NSET, NSET=LEFT\n" + named([k for k in self.left if k in corner])
            + "*NSET, NSET=RIGHT\n" + named([k for k in self.right if k in corner])
            + "*NSET, NSET=BORE\n" + named(self.bore.tolist())
            + ("*BOUNDARY\nBORE, 1, 3\n" if held else ""))
