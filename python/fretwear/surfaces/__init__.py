"""Contact pairs between two surfaces of a mesh, whose faces need not match.

    upper = fw.surfaces.Surface(points, {"quad": faces_above}, "upper")
    lower = fw.surfaces.Surface(points, {"triangle": faces_below}, "lower")
    pairs = fw.surfaces.contact_pairs(upper, lower)
    pairs.area, pairs.gap, pairs.matrix     # relative displacements t1, t2, n by displacements
"""

from .couples import SurfacePairs, contact_pairs
from .picture import RefusedSurfaces, draw_surfaces
from .surface import Surface

__all__ = ["RefusedSurfaces", "Surface", "SurfacePairs", "contact_pairs", "draw_surfaces"]
