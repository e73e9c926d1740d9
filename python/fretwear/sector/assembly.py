"""Finite-element matrices of the sector.

Triquadratic displacements (27 nodes) on trilinear hexahedra. Vector degrees of freedom are
numbered 3 * node + component. All element matrices are formed at once as batched products of
the gradients that scikit-fem provides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from skfem import Basis, ElementHex2, FacetBasis, MeshHex1

from .parameters import Material, ParameterError

__all__ = ["Assembly", "FacetMeans", "facet_means", "lame"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Elements = NDArray[Any] | slice

# Three Gauss points per direction: exact for mass and stiffness of a parallelepiped.
INTEGRATION_ORDER = 5


class Assembly:
    """Matrices on all degrees of freedom, before any is held.

    Attributes
    ----------
    nodes : (3, n_nodes)
        Positions of the 27-node grid [mm].
    cell_nodes : (n_elements, 27) int
        Nodes of each element.
    weight : (n_elements, n_points)
        Volumes of the integration points [mm^3].
    """

    def __init__(self, mesh: MeshHex1, material: Material) -> None:
        self.mesh, self.material = mesh, material
        self._basis = Basis(mesh, ElementHex2(), intorder=INTEGRATION_ORDER)
        self.nodes: Floats = self._basis.doflocs
        self.cell_nodes: Ints = self._basis.element_dofs.T.astype(np.int64)
        if (self._basis.mapping.detDF(self._basis.X) <= 0.0).any():
            raise ParameterError("Geometry: the parameters fold at least one element; move them "
                                 "towards the defaults")
        # Gradients (element, point, component, node): products over points become matmuls.
        self._grad = np.ascontiguousarray(
            np.array([np.asarray(b[0].grad) for b in self._basis.basis]).transpose(2, 3, 1, 0))
        self.weight: Floats = self._basis.dx

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return self.nodes.shape[1]

    def scalar_mass(self, elements: Elements = slice(None)) -> sp.csr_array:
        """Mass matrix of one displacement component [tonne], (n_nodes, n_nodes), of some elements
        (a mask or numbers) or of all."""
        shape = np.array([np.broadcast_to(np.asarray(b[0]), self.weight.shape)
                          for b in self._basis.basis]).transpose(1, 2, 0)[elements]
        weighted = shape * (self.material.density * self.weight[elements])[:, :, None]
        return self._scatter(np.matmul(shape.transpose(0, 2, 1), weighted), 1, elements)

    def stiffness(self, elements: Elements = slice(None)) -> sp.csr_array:
        """Linear elastic stiffness [N/mm], (3 n_nodes, 3 n_nodes), likewise."""
        first, shear = lame(self.material)
        gradients = self._grad[elements]
        n_cells, n_points, _, n_local = gradients.shape
        flat = gradients.reshape(n_cells, n_points, 3 * n_local)
        # products[e, i, a, j, b] = integral of d_i phi_a d_j phi_b
        products = np.matmul(flat.transpose(0, 2, 1), flat * self.weight[elements][:, :, None])
        products = products.reshape(n_cells, 3, n_local, 3, n_local)
        trace = shear * np.einsum("eiaib->eab", products)
        cells = np.empty((n_cells, n_local, 3, n_local, 3))
        for i in range(3):
            for j in range(3):
                cells[:, :, i, :, j] = first * products[:, i, :, j] + shear * products[:, j, :, i]
            cells[:, :, i, :, i] += trace
        return self._scatter(cells.reshape(n_cells, 3 * n_local, 3 * n_local), 3, elements)

    def geometric_stiffness(self, displacement: Floats) -> sp.csr_array:
        """Stress stiffening by the linear elastic stress of a displacement field.

        Parameters
        ----------
        displacement : (3 n_nodes,)
            Static displacement [mm], or mm per (rad/s)^2.

        Returns
        -------
        (3 n_nodes, 3 n_nodes) matrix [N/mm], or N/mm per (rad/s)^2
        """
        first, shear = lame(self.material)
        local = displacement.reshape(-1, 3)[self.cell_nodes]
        gradient = np.einsum("eqia,eaj->eqij", self._grad, local, optimize=True)
        strain = 0.5 * (gradient + gradient.swapaxes(-1, -2))
        stress = 2.0 * shear * strain
        stress += first * np.einsum("eqii->eq", strain)[..., None, None] * np.eye(3)
        pulled = np.matmul(stress * self.weight[:, :, None, None], self._grad)
        n_cells, n_points, _, n_local = self._grad.shape
        flat = self._grad.reshape(n_cells, 3 * n_points, n_local)
        cells = np.matmul(flat.transpose(0, 2, 1), pulled.reshape(n_cells, 3 * n_points, n_local))
        return sp.csr_array(sp.kron(self._scatter(cells, 1), sp.identity(3)))

    def _scatter(self, cells: Floats, n_components: int,
                 elements: Elements = slice(None)) -> sp.csr_array:
        """Sum element matrices into a sparse matrix that is symmetric to the last bit."""
        number = (n_components * self.cell_nodes[elements][:, :, None] + np.arange(n_components))
        number = number.reshape(len(cells), -1)
        rows = np.repeat(number, number.shape[1], axis=1).ravel()
        columns = np.tile(number, (1, number.shape[1])).ravel()
        n = n_components * self.n_nodes
        matrix = sp.csr_array(sp.coo_array((cells.ravel(), (rows, columns)), shape=(n, n)))
        return sp.csr_array(0.5 * (matrix + matrix.T))


def lame(material: Material) -> tuple[float, float]:
    """Lame's constants [MPa]."""
    shear = material.young / (2.0 * (1.0 + material.poisson))
    return 2.0 * shear * material.poisson / (1.0 - 2.0 * material.poisson), shear


@dataclass(frozen=True)
class FacetMeans:
    """Averages over groups of facets: rows (n_groups, n_nodes), areas and centroids."""

    rows: sp.csr_array
    area: Floats
    centroid: Floats


def facet_means(mesh: MeshHex1, facets: Ints, group: Ints, n_groups: int) -> FacetMeans:
    """Rows that average a nodal field over groups of facets.

    Parameters
    ----------
    mesh : MeshHex1
        Mesh of the sector.
    facets, group : (n_facets,) int
        Facet numbers and the group of each.
    n_groups : int
        Number of groups.

    Returns
    -------
    FacetMeans
        Rows (n_groups, n_nodes) [-], areas (n_groups) [mm^2], centroids (n_groups, 3) [mm].
    """
    # scikit-fem may order the facets it is given: sort here, so that the groups stay aligned.
    order = np.argsort(facets)
    facets, group = facets[order], group[order]
    # Moved to the origin: finding the facets in their elements needs all digits of the sizes.
    origin = mesh.p[:, mesh.facets[:, facets]].mean(axis=(1, 2))
    near = MeshHex1(mesh.p - origin[:, None], mesh.t)
    basis = FacetBasis(near, ElementHex2(), facets=facets, intorder=INTEGRATION_ORDER)
    shape = np.array([np.broadcast_to(np.asarray(b[0]), basis.dx.shape) for b in basis.basis])
    integral = np.einsum("afq,fq->af", shape, basis.dx)
    rows = np.broadcast_to(group, integral.shape)
    area = np.asarray(np.bincount(group, basis.dx.sum(axis=1), n_groups), dtype=np.float64)
    sums = sp.csr_array(sp.coo_array((integral.ravel(), (rows.ravel(), basis.element_dofs.ravel())),
                                     shape=(n_groups, basis.doflocs.shape[1])))
    means = sp.csr_array(sp.diags_array(1.0 / area) @ sums)
    return FacetMeans(means, area, means @ basis.doflocs.T + origin)
