"""A blade sector of 10,000 degrees of freedom with 16 pairs, before any reduction."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import scipy.sparse as sp


@cache
def small_sector() -> dict[str, Any]:
    """Mass, stiffness, rows and a load, as `fretwear.reduction.reduce` takes them."""
    from fretwear.sector.assembly import Assembly
    from fretwear.sector.contact import contact_rows, held_nodes
    from fretwear.sector.mesh import build_mesh
    from fretwear.sector.parameters import Discretisation, SectorParameters, patch_grid

    axial, slope = patch_grid(16)
    parameters = SectorParameters(discretisation=Discretisation(
        axial_patches=axial, slope_patches=slope, blade_columns=2, post_columns=1, slot_columns=2,
        airfoil_rows=4, disk_rows=2))
    mesh = build_mesh(parameters)
    assembly = Assembly(mesh.mesh, parameters.material)
    free = np.flatnonzero(np.repeat(~held_nodes(assembly.nodes, parameters.geometry), 3))
    load = np.zeros(len(free))
    load[-1] = 1.0
    return {"mass": sp.csr_array(sp.kron(assembly.scalar_mass(), sp.identity(3)))[free][:, free],
            "stiffness": assembly.stiffness()[free][:, free],
            "contact": sp.csr_array(contact_rows(mesh, parameters).matrix[:, free]),
            "loads": load}
