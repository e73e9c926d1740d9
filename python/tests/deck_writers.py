"""Blocks of `touching_blocks` as archives of ANSYS and as files of Gmsh, written by hand as the
manuals of these programs lay them out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from touching_blocks import Block, Pile

#: Corners of the faces of cells by their number of corners.
FACES = {4: ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)),
         8: ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))}
EDGES = {4: ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
         8: ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5),
             (2, 6), (3, 7))}
#: Type of Gmsh, and where its nodes stand in the order of CalculiX.
GMSH = {"C3D4": (4, [0, 1, 2, 3]), "C3D8": (5, list(range(8))),
        "C3D10": (11, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]),
        "C3D20": (17, [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 9, 17, 10, 18, 19, 12, 15, 13, 14])}
GMSH_FACES = {3: 2, 6: 9, 4: 3, 8: 16}
ANSYS = {"C3D4": 285, "C3D10": 187, "C3D8": 185, "C3D20": 186}


def faces(made: Pile, block: int, height: float) -> list[list[int]]:
    """Faces of a block in the plane z = height, as node numbers: corners, then middles."""
    one: Block = made.blocks[block]
    n = 4 if one.kind in ("C3D4", "C3D10") else 8
    on = np.abs(one.box[:, 2] - height) < 1e-9
    found = []
    for cell in one.cells:
        for face in FACES[n]:
            if not on[cell[list(face)]].all():
                continue
            nodes = [cell[k] for k in face]
            if len(cell) > n:
                nodes += [cell[n + [set(edge) for edge in EDGES[n]].index({a, b})]
                          for a, b in zip(face, face[1:] + face[:1])]
            found.append(made.numbers[made.first[block] + np.array(nodes)].tolist())
    return found


def fixed(values: list[int], width: int = 9) -> str:
    return "".join(f"{value:{width}d}" for value in values)


def component(name: str, kind: str, numbers: list[int]) -> list[str]:
    """CMBLOCK with ranges; their ends are negative."""
    numbers = sorted(numbers)
    items: list[int] = []
    for k, number in enumerate(numbers):
        inner = k and numbers[k - 1] == number - 1
        if inner and len(items) and items[-1] < 0:
            items[-1] = -number
        else:
            items.append(-number if inner else number)
    return [f"CMBLOCK,{name:<8},{kind},{len(items):8d}  ! users component", "(8i10)",
            *(fixed(items[k:k + 8], 10) for k in range(0, len(items), 8))]


def degenerate(nodes: list[int], n: int) -> list[int]:
    """A tetrahedron as the hexahedron that it is a case of."""
    i, j, k, m = nodes[:4]
    corners = [i, j, k, k, m, m, m, m]
    if len(nodes) == 4:
        return corners
    ij, jk, ki, im, jm, km = nodes[4:]
    return [*corners, ij, jk, k, ki, m, m, m, m, im, jm, km, km]


def write_archive(path: Path, made: Pile, *, by_block: bool = False, solid: bool = True,
                  as_hexahedra: bool = False, turned: bool = False, gap: float = 0.0) -> None:
    """An archive: both blocks, named selections TOP and BOTTOM of nodes, LOW of elements, and
    contact elements with real constants 5; `solid` is the form of EBLOCK that these have."""
    kinds = [ANSYS[block.kind] for block in made.blocks]
    if as_hexahedra:
        kinds = [{285: 185, 187: 186}.get(kind, kind) for kind in kinds]
    types = {1: kinds[0], 2: kinds[1], 5: 174, 6: 170}
    lines = ["/COM,ANSYS RELEASE", "/PREP7", "*SET,tid,        6"]
    if by_block:
        lines += [f"ETBLOCK,{len(types):9d},{len(types):9d}", "(2i9,19a9)",
                  *(fixed([number, kind, *[0] * 19]) for number, kind in types.items()),
                  "       -1"]
    else:
        lines += [f"ET,  {number},{kind}" for number, kind in types.items() if number != 6]
        lines += ["et,tid,TARGE170"]
    order = np.argsort(made.numbers)
    lines += [f"NBLOCK,6,SOLID,{made.numbers.max():9d},{len(order):9d}", "(3i9,6e21.13e3)"]
    for k in order:
        values = list(made.points[k])
        while values and values[-1] == 0.0:      # zeros at the end are left out
            values.pop()
        if turned:
            values = [*made.points[k], 30.0]
        lines.append(fixed([made.numbers[k], 0, 0]) + "".join(f"{v:21.13E}" for v in values))
    lines += ["N,R5.3,LOC,       -1,", "EBLOCK,19,SOLID,  999,  999  ", "(19i9)"]
    number, low = 3, []

    def element(kind: int, real: int, nodes: list[int]) -> None:
        nonlocal number
        row = [1, kind, real, 1, 0, 0, 0, 0, len(nodes), 0, number, *nodes]
        lines.append(fixed(row[:19]))
        if len(row) > 19:
            lines.append(fixed(row[19:]))
        number += 2

    for k, block in enumerate(made.blocks):
        for cell in block.cells:
            low += [number] if k == 0 else []
            nodes = made.numbers[made.first[k] + cell].tolist()
            element(k + 1, k + 1, degenerate(nodes, len(nodes)) if as_hexahedra and
                    len(nodes) in (4, 10) else nodes)
    if not solid:
        lines += ["       -1", "eblock,10,,,99", "(15i9)"]
    for kind, block, height in ((6, 0, 1.0), (5, 1, 1.0 + gap)):
        for face in faces(made, block, height):
            if len(face) in (3, 6):
                face = face[:3] + face[2:3] + ([face[3], face[4], face[2], face[5]]
                                               if len(face) == 6 else [])
            if solid:
                element(kind, 5, face)
            else:
                lines.append(fixed([number, kind, 5, 5, 0, *face]))
                number += 2
    lines += ["       -1"]
    for name, nodes in (("TOP", made.nodes(0, 2, 1.0)), ("BOTTOM", made.nodes(1, 2, 1.0 + gap))):
        lines += component(name, "NODE", made.numbers[nodes].tolist())
    lines += [*component("LOW", "ELEM", low), "FINISH"]
    path.write_text("\n".join(lines) + "\n")


def write_gmsh(path: Path, made: Pile, version: str, gap: float = 0.0) -> None:
    """A mesh with the physical groups top and bottom of surfaces and LOW and HIGH of volumes; each
    volume has the number of a surface."""
    groups = [(3, 1, "LOW"), (3, 2, "HIGH"), (2, 1, "top"), (2, 2, "bottom")]
    cells: dict[tuple[int, int], list[tuple[int, list[int]]]] = {}
    for k, block in enumerate(made.blocks):
        kind, order = GMSH[block.kind]
        cells[3, k + 1] = [(kind, made.numbers[made.first[k] + cell[order]].tolist())
                           for cell in block.cells]
        cells[2, k + 1] = [(GMSH_FACES[len(face)], face)
                           for face in faces(made, k, 1.0 if k == 0 else 1.0 + gap)]
    lines = ["$MeshFormat", f"{version} 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(groups)),
             *(f'{dimension} {tag} "{name}"' for dimension, tag, name in groups),
             "$EndPhysicalNames"]
    number = 11
    if version == "2.2":
        lines += ["$Nodes", str(len(made.numbers)), *(
            f"{node} {x:.17g} {y:.17g} {z:.17g}"
            for node, (x, y, z) in zip(made.numbers, made.points)), "$EndNodes", "$Elements",
            str(sum(map(len, cells.values())))]
        for (_, tag), members in cells.items():
            for kind, nodes in members:
                lines.append(" ".join(map(str, [number, kind, 2, tag, tag + 20, *nodes])))
                number += 1
    else:
        lines += ["$Entities", "1 0 2 2", "7 0 0 0 0"]
        lines += [f"{tag + 20} 0 0 0 3 2 1 1 {tag} 0" for tag in (1, 2)]
        lines += [f"{tag + 30} 0 0 0 3 2 1 1 {tag} 1 {tag + 20}" for tag in (1, 2)]
        lines += ["$EndEntities", "$Nodes", f"2 {len(made.numbers)} 1 {made.numbers.max()}"]
        for k in (0, 1):
            own = slice(made.first[k], made.first[k + 1])
            lines += [f"3 {k + 31} 0 {made.first[k + 1] - made.first[k]}",
                      *map(str, made.numbers[own]),
                      *(f"{x:.17g} {y:.17g} {z:.17g}" for x, y, z in made.points[own])]
        lines += ["$EndNodes", "$Elements", f"4 {sum(map(len, cells.values()))} 11 999"]
        for (dimension, tag), members in cells.items():
            entity = tag + (30 if dimension == 3 else 20)
            lines.append(f"{dimension} {entity} {members[0][0]} {len(members)}")
            for _, nodes in members:
                lines.append(" ".join(map(str, [number, *nodes])))
                number += 1
    path.write_text("\n".join([*lines, "$EndElements"]) + "\n")
