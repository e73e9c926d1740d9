"""Meshes with the deformation, contact state and wear of a result, for ParaView.

`fretwear export` is in `fretwear.export.command`.
"""

from .animation import Animation, animate
from .command import add_arguments, main
from .fields import Fields, export_mesh
from .mesh import RecoveryMesh, mesh_datasets, read_mesh
from .recovery import Structure, read_structure, recover_displacement, relative_displacement

__all__ = ["Animation", "Fields", "RecoveryMesh", "Structure", "add_arguments", "animate",
           "export_mesh", "main", "mesh_datasets", "read_mesh", "read_structure",
           "recover_displacement", "relative_displacement"]
