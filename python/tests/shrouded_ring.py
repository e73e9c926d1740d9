"""A ring of hexahedra with cracks between its shrouds: whole, or one sector of it by either of two
cuts, through the cracks or through the blades. Elements and assembly are of this file alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse as sp

N = 6
STEP = 2.0 * np.pi / N
YOUNG, POISSON, DENSITY = 2.0e5, 0.3, 7.8e-9
#: Lamé's.
FIRST, SHEAR = (YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON)),
                0.5 * YOUNG / (1.0 + POISSON))
#: Springs of the bore to the ground, a node of a cell.
SUPPORT = 1.0e5
#: Grid lines of a sector, as parts of its angle from its middle, and radii of disk, blade, shroud.
_PARTS = (-0.5, -0.17, 0.0, 0.14)
_RADII = (20.0, 30.0, 42.0, 50.0)
_LEVELS = (0.0, 2.0, 5.0)
#: Corners of a hexahedron, as parts of its edges.
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0),
                    (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])

#: Grid line around, radius, level, and side of a crack: 1 before it, -1 behind it, else 0.
Node = tuple[int, int, int, int]


def rotation(angle: float) -> np.ndarray:
    """About z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@dataclass
class Ring:
    """Some cells of the ring around.

    Parameters
    ----------
    lines : range
        Grid lines where its cells start; four to a sector, 0 in the middle of a blade.
    closed : bool
        Whether the last line is the first one.
    gap : float
        Of the cracks.
    differ : float
        How far inner nodes of both sides of a crack are from each other, within its plane.
    shift : float
        The same of its outlines.
    wide : bool
        Whether blades touch their neighbours too, so that cracks end at the rim of the disk.
    """

    lines: range
    closed: bool = False
    gap: float = 0.0
    differ: float = 0.0
    shift: float = 0.0
    wide: bool = False
    nodes: list[Node] = field(init=False)

    def __post_init__(self) -> None:
        cells = [[self._node(i, j, k, corner) for corner in CORNERS.tolist()]
                 for i in self.lines for j in range(3) for k in range(2)
                 # Blades are two cells wide.
                 if self.wide or j != 1 or i % 4 in (0, 3)]
        self.nodes = sorted({node for cell in cells for node in cell})
        place = {node: k for k, node in enumerate(self.nodes)}
        self.cells = np.array([[place[node] for node in cell] for cell in cells])
        self.points = np.array([self._place(node) for node in self.nodes])
        n = 3 * len(self.nodes)
        stiffness, mass = sp.lil_array((n, n)), sp.lil_array((n, n))
        for cell, numbers in zip(cells, self.cells):
            dofs = (3 * numbers[:, None] + np.arange(3)).ravel()
            k, m = element(self.points[numbers])
            held = np.repeat([node[1] == 0 for node in cell], 3)
            k[held, held] += SUPPORT
            stiffness[np.ix_(dofs, dofs)] += k
            mass[np.ix_(dofs, dofs)] += m
        self.stiffness, self.mass = sp.csr_array(stiffness), sp.csr_array(mass)

    def _node(self, i: int, j: int, k: int, corner: list[int]) -> Node:
        line, j = i + corner[1], j + corner[0]
        # The third line from the middle of a blade is that of the crack in the shroud.
        side = (1 if corner[1] else -1) if line % 4 == 2 and j >= 2 else 0
        return line % (4 * N) if self.closed else line, j, k + corner[2], side

    def _place(self, node: Node) -> np.ndarray:
        line, j, k, side = node
        sector, part = divmod(line + 2, 4)
        radius, z = _RADII[j], _LEVELS[k]
        if side:
            radius += side * self.shift * (0.7 if j == 2 else -0.4 - 0.3 * k)
            z += side * (self.differ * (0.0, 2.2 - 0.7 * j, 0.0)[k] + self.shift * 0.2 * k)
        angle = (sector + _PARTS[part]) * STEP
        place = rotation(angle) @ [radius, 0.0, z]
        return place + (self.gap * rotation(angle) @ [0.0, 1.0, 0.0] if side == -1 else 0.0)

    def number(self, node: Node) -> int:
        """Of a node in the files, from 1."""
        return self.nodes.index(node) + 1

    def quads(self, side: int, line: int) -> np.ndarray:
        """The faces there, anticlockwise from outside."""
        faces = [[self.nodes.index((line, j, k + step, side if j >= 2 else 0)) for j, step in
                  ((low, 0), (low, 1), (low + 1, 1), (low + 1, 0))]
                 for low in ((1, 2) if self.wide else (2,)) for k in range(2)]
        return np.array(faces if side == 1 else [face[::-1] for face in faces])

    def write(self, folder: Path, loads: dict[str, np.ndarray]) -> list[str]:
        """Matrices, labels, loads and a deck with node sets RIGHT, LEFT (of the crack) and BLADE;
        returns what an import of a sector of it starts with."""
        folder.mkdir(exist_ok=True)
        for name, matrix in (("k", self.stiffness), ("m", self.mass)):
            scipy.io.mmwrite(folder / f"{name}.mtx", sp.coo_array(0.5 * (matrix + matrix.T)),
                             symmetry="symmetric", precision=17)
        (folder / "labels.txt").write_text("\n".join(
            f"{3 * i + c + 1} {i + 1} {c + 1}" for i in range(len(self.nodes)) for c in range(3)))
        any_load = np.any([load != 0.0 for load in loads.values()], axis=0)
        (folder / "loads.csv").write_text("\n".join([f"dof,{','.join(loads)}", *(
            ",".join([f"{k // 3 + 1}:{k % 3 + 1}", *(f"{load[k]:.17g}" for load in loads.values())])
            for k in np.flatnonzero(any_load))]))
        lines = ["*NODE", *(f"{k + 1}, {x:.17g}, {y:.17g}, {z:.17g}"
                            for k, (x, y, z) in enumerate(self.points)),
                 "*ELEMENT, TYPE=C3D8, ELSET=ALL", *(
                     ", ".join(map(str, [k + 1, *(cell + 1)])) for k, cell in
                     enumerate(self.cells))]
        tips = {side: {k for k, node in enumerate(self.nodes) if self.wide and node[1] == 1
                       and any(other[0] == node[0] and other[3] == side for other in self.nodes)}
                for side in (1, -1)}
        for name, chosen in (("RIGHT", [k for k, node in enumerate(self.nodes)
                                        if node[3] == 1 or k in tips[1]]),
                             ("LEFT", [k for k, node in enumerate(self.nodes)
                                       if node[3] == -1 or k in tips[-1]]),
                             ("BLADE", [k for k, node in enumerate(self.nodes)
                                        if node[1] in (1, 2) and node[0] % 4 == 1])):
            lines += [f"*NSET, NSET={name}", ", ".join(str(k + 1) for k in chosen)]
        (folder / "ring.inp").write_text("\n".join(lines) + "\n")
        return ["import", str(folder / "k.mtx"), str(folder / "m.mtx"), "--labels",
                str(folder / "labels.txt"), "--loads", str(folder / "loads.csv"), "--sectors",
                str(N), "--frames", "cartesian", "--mesh", str(folder / "ring.inp"), "-q"]


def whole(*sizes: float) -> Ring:
    """All sectors."""
    return Ring(range(4 * N), True, *sizes)


def through_cracks(*sizes: float) -> Ring:
    """A sector whose shroud meets those of its neighbours; gap, differ, shift."""
    return Ring(range(-2, 2), False, *sizes)


def through_blades(*sizes: float) -> Ring:
    """A sector with the crack inside."""
    return Ring(range(4), False, *sizes)


def element(corner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and mass of a trilinear hexahedron by two points along each edge."""
    strain = np.zeros((6, 24))
    law = np.zeros((6, 6))
    law[:3, :3] = FIRST
    law += SHEAR * np.diag([2.0, 2.0, 2.0, 1.0, 1.0, 1.0])
    k, m = np.zeros((24, 24)), np.zeros((24, 24))
    signs = 2.0 * CORNERS - 1.0
    for point in signs / np.sqrt(3.0):
        factor = 0.5 * (1.0 + signs * point)
        slope = np.stack([0.5 * signs[:, a] * np.delete(factor, a, axis=1).prod(axis=1)
                          for a in range(3)])
        jacobian = slope @ corner
        volume = float(np.linalg.det(jacobian))
        assert volume > 0.0
        gradient = np.linalg.solve(jacobian, slope)
        for c in range(3):
            strain[c, c::3] = gradient[c]
        for row, (a, b) in enumerate(((0, 1), (1, 2), (2, 0)), 3):
            strain[row, a::3], strain[row, b::3] = gradient[b], gradient[a]
        k += volume * strain.T @ law @ strain
        shape = np.kron(factor.prod(axis=1), np.eye(3))
        m += DENSITY * volume * shape.T @ shape
    return k, m


def pressure_load(points: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """Force of a unit pressure on plane faces, against their outward normals."""
    load = np.zeros(points.shape)
    for face in quads:
        corner = points[face]
        for a in (-1, 1):
            for b in (-1, 1):
                s, t = np.array([a, b]) / np.sqrt(3.0)
                u, v = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])
                normal = np.cross(0.25 * u * (1 + v * t) @ corner, 0.25 * v * (1 + u * s) @ corner)
                load[face] -= 0.25 * ((1 + u * s) * (1 + v * t))[:, None] * normal
    return load.ravel()
