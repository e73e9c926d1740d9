"""Meshes of quadratic and linear cells: the judgement whether they belong to the matrices."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import meshio
import numpy as np
import pytest
import scipy.sparse as sp
from skfem import (
    Basis,
    BilinearForm,
    ElementHex1,
    ElementHex2,
    ElementTetP1,
    ElementTetP2,
    ElementVector,
    MeshHex1,
    MeshTet1,
)
from skfem.helpers import ddot, eye, sym_grad, trace
from skfem.models.elasticity import lame_parameters

from fretwear.importer.meshes import read_mesh_file
from fretwear.importer.recovery import check_mesh

#: Cells as meshio calls them, with the mesh and the element of scikit-fem.
KINDS = {"tetra10": (MeshTet1, ElementTetP2), "hexahedron27": (MeshHex1, ElementHex2),
         "tetra": (MeshTet1, ElementTetP1), "hexahedron": (MeshHex1, ElementHex1)}


def _assembled(mesh: Any, element: Any) -> tuple[sp.csr_array, np.ndarray, np.ndarray]:
    """Stiffness node after node, positions of the nodes, nodes of every cell as scikit-fem orders
    them."""
    basis = Basis(mesh, ElementVector(element), intorder=4)
    scalar = Basis(mesh, element, intorder=4)
    lam, mu = lame_parameters(2.1e5, 0.3)

    @BilinearForm
    def stiffness(u, v, w):  # type: ignore[no-untyped-def]
        strain = sym_grad(u)
        return ddot(2.0 * mu * strain + lam * eye(trace(strain), 3), sym_grad(v))

    place = np.zeros((scalar.N, 3), dtype=int)
    for component in range(3):
        place[scalar.element_dofs, component] = basis.element_dofs[component::3]
    matrix = sp.csr_array(stiffness.assemble(basis))[place.ravel()][:, place.ravel()]
    return matrix, scalar.doflocs.T.copy(), scalar.element_dofs.T.copy()


def _drawn(seed: int, kind: str, path: Path) -> SimpleNamespace:
    """A random body with its mesh in a file, as far as the check asks for it."""
    random = np.random.default_rng(seed)
    lines = [np.cumsum(random.uniform(0.5, 2.0, random.integers(3, 5))) for _ in range(3)]
    first, element = KINDS[kind]
    mesh = first.init_tensor(*lines)
    inside = mesh.p + 0.08 * random.normal(size=mesh.p.shape)
    mesh = first(inside, mesh.t)
    stiffness, points, cells = _assembled(mesh, element())
    nodes = 10 + 3 * random.permutation(len(points))
    # Supports below, as structures have them.
    held = np.zeros((len(points), 3))
    held[points[:, 2] < points[:, 2].min() + 0.2] = 1e5
    corners = cells[:, :8 if "hexa" in kind else 4]
    if "hexa" in kind:
        corners = corners[:, [0, 3, 6, 2, 1, 5, 7, 4]]
    _write(path, kind, points, nodes, corners, cells)
    labels = [(int(node), c) for node in nodes for c in (1, 2, 3)]
    return SimpleNamespace(matrices={"stiffness": sp.csr_array(
        stiffness + sp.diags_array(held.ravel()))}, interfaces=None, in_cylinder=None,
        dofs=SimpleNamespace(labels=labels, n=3 * len(points)), mesh=None)


def _write(path: Path, kind: str, points: np.ndarray, nodes: np.ndarray, corners: np.ndarray,
           cells: np.ndarray) -> None:
    """Abaqus or Nastran by hand, anything else by meshio with the numbers of the nodes."""
    if kind == "tetra10":
        # Middles in the order of every format: 01 12 20 03 13 23.
        middle = {tuple(np.round(points[k], 9)): k for k in range(len(points))}
        pairs = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
        cells = np.array([[*c, *(middle[tuple(np.round((points[c[a]] + points[c[b]]) / 2, 9))]
                                 for a, b in pairs)] for c in corners])
    if path.suffix == ".inp":
        name = {"tetra10": "C3D10", "tetra": "C3D4", "hexahedron": "C3D8"}[kind]
        table = cells if kind == "tetra10" else corners
        path.write_text("\n".join(
            ["*NODE", *(f"{n}, {x:.12g}, {y:.12g}, {z:.12g}" for n, (x, y, z) in
                        zip(nodes, points)), f"*ELEMENT, TYPE={name}",
             *(", ".join(map(str, [k, *nodes[cell]])) for k, cell in enumerate(table, 1))]) + "\n")
    else:
        shown = cells if kind == "tetra10" else corners
        block = "hexahedron" if "hexa" in kind else kind
        # The corners show; nodes of edges, faces and middles stand in the list of points.
        meshio.Mesh(points, [(block, shown)], point_data={"node": nodes}).write(path)


FORMATS = [("tetra10", "inp"), ("tetra10", "vtu"), ("hexahedron27", "vtu"), ("tetra", "inp"),
           ("hexahedron", "inp"), ("hexahedron", "vtu")]


def _warned(model: SimpleNamespace) -> bool:
    return any("moved as a rigid body" in finding.text for finding in check_mesh(model))


@pytest.mark.parametrize(("kind", "form"), FORMATS)
@pytest.mark.parametrize("seed", range(2))
def test_meshes_of_the_matrices_are_believed_and_others_are_not(tmp_path: Path, kind: str,
                                                                form: str, seed: int) -> None:
    path = tmp_path / f"drawn.{form}"
    model = _drawn(seed, kind, path)
    model.mesh = read_mesh_file(path)
    assert not _warned(model)
    random = np.random.default_rng(seed)
    # Two thirds of the labels name other nodes of the mesh.
    nodes = sorted({node for node, _ in model.dofs.labels})
    other = dict(zip(nodes, random.permutation(nodes).tolist()))
    labels = model.dofs.labels
    model.dofs.labels = [(other[node], c) for node, c in labels]
    assert _warned(model)
    # A direction in other units than the rest.
    model.dofs.labels = labels
    path = tmp_path / f"thin.{form}"
    for name in ("points", "all_points"):
        getattr(model.mesh, name)[:, 2] *= 1e-3
    assert _warned(model)
    # Components in another order.
    model.mesh = read_mesh_file(tmp_path / f"drawn.{form}")
    model.dofs.labels = [(node, c % 3 + 1) for node, c in labels]
    assert _warned(model)
