"""Blocks of solid elements whose meshes do not match, as matrices and a deck with named surfaces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse as sp
from skfem import (
    Basis,
    BilinearForm,
    ElementHex1,
    ElementHexS2,
    ElementTetP1,
    ElementTetP2,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshHex1,
    MeshTet1,
)
from skfem.helpers import ddot, dot, eye, sym_grad, trace
from skfem.models.elasticity import lame_parameters

YOUNG, POISSON, DENSITY = 2.0e5, 0.3, 7.8e-9
#: Corners of scikit-fem's hexahedron in the order of other programs.
_HEX = [0, 3, 6, 2, 1, 5, 7, 4]
_EDGES = {4: ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
          8: ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5),
              (2, 6), (3, 7))}
_KINDS = {"C3D4": (MeshTet1, ElementTetP1), "C3D10": (MeshTet1, ElementTetP2),
          "C3D8": (MeshHex1, ElementHex1), "C3D20": (MeshHex1, ElementHexS2)}
#: A held degree of freedom, as programs write it.
HELD = 1e36


class Block:
    """A box of one kind of elements, inner grid lines at random places or at given ones.

    Parameters
    ----------
    lines : three arrays, optional
        Grid lines along x, y, z.
    move : callable, optional
        Of corners (3, n) of the box, to where they stand.

    Attributes
    ----------
    points : (n, 3)
        Corners, then middles of edges; `box` has them before they are moved.
    cells : (n_cells, n_nodes) int
    stiffness, mass : (3 n, 3 n) sparse
        x, y, z of one node after the other.
    top : (3 n,)
        Consistent load of a unit pressure down on its top.
    """

    def __init__(self, kind: str, n: tuple[int, int, int], low: tuple[float, float, float],
                 high: tuple[float, float, float], seed: int,
                 lines: Sequence[np.ndarray] | None = None,
                 move: Callable[[np.ndarray], np.ndarray] | None = None) -> None:
        random = np.random.default_rng(seed)
        if lines is None:
            lines = []
            for count, a, b in zip(n, low, high):
                line = np.linspace(a, b, count + 1)
                line[1:-1] += 0.25 * (b - a) / count * random.uniform(-1.0, 1.0, count - 1)
                lines.append(line)
        make, element = _KINDS[kind]
        self.kind = kind
        mesh = make.init_tensor(*lines)
        self.box = mesh.p.T.copy()
        if move is not None:
            mesh = make(move(mesh.p), mesh.t)
        basis = Basis(mesh, ElementVector(element()), intorder=4)
        lam, mu = lame_parameters(YOUNG, POISSON)

        @BilinearForm
        def stiffness(u, v, w):  # type: ignore[no-untyped-def]
            strain = sym_grad(u)
            return ddot(2.0 * mu * strain + lam * eye(trace(strain), 3), sym_grad(v))

        @BilinearForm
        def mass(u, v, w):  # type: ignore[no-untyped-def]
            return DENSITY * dot(u, v)

        @LinearForm
        def pressure(v, w):  # type: ignore[no-untyped-def]
            return -v[2]

        quadratic = kind in ("C3D10", "C3D20")
        dofs = np.hstack((basis.nodal_dofs, basis.edge_dofs)) if quadratic else basis.nodal_dofs
        order = dofs.T.ravel()
        self.stiffness, self.mass = (sp.csr_array(form.assemble(basis))[order][:, order]
                                     for form in (stiffness, mass))
        upper = mesh.facets_satisfying(lambda x: np.abs(x[2] - high[2]) < 1e-9)
        self.top = pressure.assemble(FacetBasis(mesh, ElementVector(element()), facets=upper,
                                                intorder=4))[order]
        corner = mesh.t.T if mesh.t.shape[0] == 4 else mesh.t[_HEX].T
        self.points, self.cells = mesh.p.T.copy(), corner
        if quadratic:
            ends = {tuple(sorted(edge)): k for k, edge in enumerate(mesh.edges.T.tolist())}
            middles = np.array([[ends[tuple(sorted((cell[a], cell[b])))]
                                 for a, b in _EDGES[corner.shape[1]]] for cell in corner.tolist()])
            self.cells = np.hstack((corner, len(self.points) + middles))
            self.points = np.vstack((self.points, self.points[mesh.edges].mean(axis=0)))
            self.box = np.vstack((self.box, self.box[mesh.edges].mean(axis=0)))


@dataclass
class Pile:
    """Blocks in one model; the nodes have numbers in no order."""

    blocks: list[Block]
    first: list[int] = field(init=False)

    def __post_init__(self) -> None:
        self.first = np.concatenate(([0], np.cumsum([len(block.points) for block in self.blocks]))
                                    ).tolist()
        self.points = np.concatenate([block.points for block in self.blocks])
        self.box = np.concatenate([block.box for block in self.blocks])
        self.stiffness = sp.csr_array(sp.block_diag([block.stiffness for block in self.blocks]))
        self.mass = sp.csr_array(sp.block_diag([block.mass for block in self.blocks]))
        self.numbers = 10 + 3 * np.random.default_rng(7).permutation(len(self.points))

    def nodes(self, block: int, axis: int, value: float) -> np.ndarray:
        """Points of a block in a plane of its box."""
        own = np.arange(self.first[block], self.first[block + 1])
        return own[np.abs(self.box[own, axis] - value) < 1e-9]

    def write(self, folder: Path, held: np.ndarray, load: np.ndarray, deck: list[str]) -> None:
        """Matrices with held dofs (from 0), labels, static loads, and a deck that ends with `deck`.
        """
        marks = np.zeros(3 * len(self.points))
        marks[held] = HELD
        scipy.io.mmwrite(folder / "k.mtx", sp.coo_array(self.stiffness + sp.diags_array(marks)),
                         symmetry="symmetric", precision=16)
        scipy.io.mmwrite(folder / "m.mtx", sp.coo_array(self.mass), symmetry="symmetric",
                         precision=16)
        (folder / "labels.txt").write_text("\n".join(
            f"{3 * i + c + 1} {node} {c + 1}" for i, node in enumerate(self.numbers)
            for c in range(3)))
        (folder / "loads.csv").write_text("dof,static\n" + "".join(
            f"{self.numbers[k // 3]}:{k % 3 + 1},{load[k]:.17g}\n" for k in np.flatnonzero(load)))
        lines = ["*HEADING", "blocks", "*NODE, NSET=ALL"]
        lines += [f"{node}, {x:.17g}, {y:.17g}, {z:.17g}"
                  for node, (x, y, z) in zip(self.numbers, self.points)]
        number = 1
        for k, block in enumerate(self.blocks):
            lines.append(f"*ELEMENT, TYPE={block.kind}, ELSET=BLOCK{k}")
            for cell in block.cells:
                words = [str(number), *map(str, self.numbers[self.first[k] + cell])]
                # A line that ends with a comma goes on in the next.
                lines += [", ".join(words[:11]) + ("," if len(words) > 11 else "")]
                lines += [", ".join(words[11:])] if len(words) > 11 else []
                number += 1
        (folder / "blocks.inp").write_text("\n".join(lines + deck) + "\n")

    def node_set(self, name: str, nodes: np.ndarray) -> list[str]:
        """Lines of a node set."""
        words = self.numbers[nodes].tolist()
        return [f"*NSET, NSET={name}", *(", ".join(map(str, words[k:k + 10]))
                                         for k in range(0, len(words), 10))]
