"""Contact pairs of surfaces whose meshes do not match: areas, partition of unity, rigid motions,
constant pressure, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull, HalfspaceIntersection

import fretwear as fw
from fretwear.surfaces import RefusedSurfaces, Surface, contact_pairs

# Sums of some hundred terms of 16 digits.
UNITY = 1e-12
AREA = 1e-10
# Pressure from integrals with points that are exact for distorted faces to this.
PRESSURE = 1e-12


def grid(nx: int, ny: int, size: tuple[float, float], kind: str,
         random: np.random.Generator | None = None) -> tuple[np.ndarray, np.ndarray]:
    """A rectangle of faces of a kind, inner nodes moved at random: places (n, 2) and faces."""
    x, y = np.meshgrid(np.linspace(0.0, size[0], nx + 1), np.linspace(0.0, size[1], ny + 1),
                       indexing="ij")
    places = np.stack((x.ravel(), y.ravel()), axis=1)
    if random is not None:
        inner = ((places > 1e-9) & (places < np.array(size) - 1e-9)).all(axis=1)
        step = np.array(size) / (nx, ny)
        places[inner] += 0.22 * step * random.uniform(-1.0, 1.0, (int(inner.sum()), 2))
    number = np.arange((nx + 1) * (ny + 1)).reshape(nx + 1, ny + 1)
    quads = np.stack((number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]),
                     axis=-1).reshape(-1, 4)
    if kind in ("quad", "quad8"):
        faces = quads
    else:
        faces = np.concatenate((quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]))
    if kind in ("quad", "triangle"):
        return places, faces
    middles: dict[tuple[int, int], int] = {}
    more = []
    for face in faces.tolist():
        more.append([middles.setdefault((min(a, b), max(a, b)), len(places) + len(middles))
                     for a, b in zip(face, face[1:] + face[:1])])
    added = np.array([0.5 * (places[a] + places[b]) for a, b in middles])
    return np.concatenate((places, added)), np.hstack((faces, np.array(more)))


def turned(random: np.random.Generator) -> np.ndarray:
    """A random rotation."""
    q, r = np.linalg.qr(random.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0.0 else q[:, ::-1]


def rigid(points: np.ndarray) -> np.ndarray:
    """Displacements of all points (3 n, 6) of rigid motions."""
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    for k in range(3):
        motions[:, :, 3 + k] = np.cross(np.eye(3)[k], points - points.mean(axis=0))
    return motions.reshape(-1, 6)


def two_sheets(seed: int, *, gap: float = 0.0, same: bool = False) -> tuple[
        Surface, Surface, np.ndarray, np.ndarray]:
    """Two random sheets that lie on each other, turned in space; also their outlines in the
    plane."""
    random = np.random.default_rng(seed)
    kinds = ["triangle", "quad", "triangle6", "quad8"]
    kind_1, kind_2 = random.choice(kinds, 2)
    size = random.uniform(2.0, 5.0, 2)
    flat_1, faces_1 = grid(*random.integers(2, 7, 2), tuple(size), str(kind_1), random)
    other = size if same else random.uniform(2.0, 5.0, 2)
    flat_2, faces_2 = grid(*random.integers(2, 7, 2), tuple(other), str(kind_2), random)
    outline = [np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) * one
               for one in (size, other)]
    if not same:
        angle = random.uniform(0.0, 2.0 * np.pi)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        move = 0.5 * size + random.uniform(-1.0, 1.0, 2) - turn @ (0.5 * other)
        flat_2, outline[1] = flat_2 @ turn.T + move, outline[1] @ turn.T + move
    # Surface 1 lies below: its normal is z; that of surface 2 is against it.
    n = len(flat_1)
    backwards = {"triangle": [0, 2, 1], "quad": [0, 3, 2, 1], "triangle6": [0, 2, 1, 5, 4, 3],
                 "quad8": [0, 3, 2, 1, 7, 6, 5, 4]}[str(kind_2)]
    space = np.zeros((n + len(flat_2), 3))
    space[:n, :2], space[n:, :2] = flat_1, flat_2
    space[n:, 2] = gap
    space = space @ turned(random).T + random.uniform(-3.0, 3.0, 3)
    return (Surface(space, {str(kind_1): faces_1}, "one"),
            Surface(space, {str(kind_2): faces_2[:, backwards] + n}, "two"), *outline)


def common_area(one: np.ndarray, two: np.ndarray) -> float:
    """Area that two convex outlines have in common, by another algorithm: half-planes."""
    sides = []
    for outline in (one, two):
        along = np.roll(outline, -1, axis=0) - outline
        normal = np.stack((along[:, 1], -along[:, 0]), axis=1)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        sides.append(np.column_stack((normal, -np.einsum("ij,ij->i", normal, outline))))
    planes = np.concatenate(sides)
    # A place inside: the middle of the largest circle, by a linear programme.
    from scipy.optimize import linprog

    found = linprog([0.0, 0.0, -1.0], A_ub=np.column_stack((planes[:, :2], np.ones(len(planes)))),
                    b_ub=-planes[:, 2], bounds=[(None, None), (None, None), (0.0, None)])
    return float(ConvexHull(HalfspaceIntersection(planes, found.x[:2]).intersections).volume)


@pytest.mark.parametrize("seed", range(50))
def test_random_meshes(seed: int) -> None:
    """Total area, partition of unity, and no relative displacement of rigid motions."""
    one, two, outline_1, outline_2 = two_sheets(seed)
    pairs = contact_pairs(one, two)
    exact = common_area(outline_1, outline_2)
    assert abs(pairs.area.sum() - exact) <= AREA * exact
    assert (pairs.area > 0.0).all()
    whole = [float(np.prod(np.ptp(one, axis=0))) for one in (outline_1,)]
    assert abs(pairs.outside[0] - (whole[0] - exact)) <= AREA * whole[0]
    for weights in (pairs.weights_1, pairs.weights_2):
        assert np.abs(weights.sum(axis=1) - 1.0).max() <= UNITY
    assert np.abs(pairs.gap).max() <= UNITY * 10.0
    motions = rigid(one.points)
    assert np.abs(pairs.matrix @ motions).max() <= UNITY * np.abs(motions).max()


@pytest.mark.parametrize("seed", range(20))
def test_constant_pressure(seed: int) -> None:
    """Forces of pairs with one pressure are the consistent forces of that pressure on both
    surfaces, which cover each other."""
    one, two, *_ = two_sheets(seed, same=True)
    pairs = contact_pairs(one, two)
    d = 3
    forces = np.zeros(d * len(pairs))
    forces[2::3] = pairs.area
    nodal = (pairs.matrix.T @ forces).reshape(-1, 3)
    normal = pairs.frame[0, 2]
    for surface, sign in ((one, 1.0), (two, -1.0)):
        exact = consistent(surface)
        own = np.flatnonzero(exact)
        got = nodal[own] @ normal * sign
        assert np.abs(got - exact[own]).max() <= PRESSURE * exact.max()


def consistent(surface: Surface) -> np.ndarray:
    """Integrals of the shape functions over a flat surface, by Gauss points of each face."""
    from fretwear.surfaces.shapes import NODES, shape_functions

    found = np.zeros(len(surface.points))
    line, weight = np.polynomial.legendre.leggauss(4)
    for kind, nodes in zip(surface.kind, surface.nodes):
        own = nodes[:NODES[kind]]
        r, s = (grid.ravel() for grid in np.meshgrid(line, line))
        w = np.outer(weight, weight).ravel()
        if kind.startswith("triangle"):
            r, s, w = 0.5 * (1.0 + r), 0.25 * (1.0 - r) * (1.0 + s), w * 0.125 * (1.0 - r)
        at = np.stack((r, s), axis=1)
        step = 1e-3
        places = surface.points[own]
        by_r, by_s = ((shape_functions(kind, at + move) - shape_functions(kind, at - move))
                      @ places / (2.0 * step)
                      for move in (np.array([step, 0.0]), np.array([0.0, step])))
        size = np.linalg.norm(np.cross(by_r, by_s), axis=1)
        np.add.at(found, own, (w * size) @ shape_functions(kind, at))
    return found


def test_rotations_across_a_gap() -> None:
    """Surfaces that are apart: a rotation of both makes no relative displacement either."""
    one, two, *_ = two_sheets(3, gap=0.3, same=True)
    pairs = contact_pairs(one, two)
    assert np.abs(pairs.gap - 0.3).max() <= UNITY * 10.0
    motions = rigid(one.points)
    assert np.abs(pairs.matrix @ motions).max() <= UNITY * np.abs(motions).max()
    # A motion of one of them along the normal is the whole relative displacement.
    away = np.zeros((len(one.points), 3))
    away[np.unique(two.nodes[two.nodes >= 0])] = -pairs.frame[0, 2]
    moved = (pairs.matrix @ away.ravel()).reshape(-1, 3)
    assert np.abs(moved - [0.0, 0.0, 1.0]).max() <= UNITY * 10.0


@pytest.mark.parametrize("kinds", [("line", "line"), ("line3", "line"), ("line3", "line3")])
def test_plane(kinds: tuple[str, str]) -> None:
    """Lines of plane meshes: lengths times the thickness, consistent forces, rotations."""
    random = np.random.default_rng(1)
    points, faces = [], []
    for kind, y, order in zip(kinds, (0.0, 0.25), (-1, 1)):
        corner = np.concatenate(([0.0], np.sort(random.uniform(0.2, 3.8, 5)), [4.0]))[::order]
        n = len(corner)
        first = sum(len(p) for p in points)
        middle = 0.5 * (corner[1:] + corner[:-1])
        x = np.concatenate((corner, middle)) if kind == "line3" else corner
        points.append(np.stack((x, np.full(len(x), y)), axis=1))
        table = np.stack((np.arange(n - 1), np.arange(1, n)), axis=1)
        if kind == "line3":
            table = np.column_stack((table, n + np.arange(n - 1)))
        faces.append(table + first)
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    places = np.concatenate(points) @ turn.T
    one, two = (Surface(places, {kind: table}, name)
                for kind, table, name in zip(kinds, faces, ("one", "two")))
    pairs = contact_pairs(one, two, thickness=3.0)
    assert abs(pairs.area.sum() - 12.0) <= AREA
    assert np.abs(pairs.gap - 0.25).max() <= UNITY * 10.0
    assert np.abs(pairs.frame[:, 1] - turn @ [0.0, -1.0]).max() <= UNITY
    motions = np.zeros((len(places), 2, 3))
    motions[:, 0, 0] = motions[:, 1, 1] = 1.0
    motions[:, :, 2] = places[:, ::-1] * [-1.0, 1.0]
    assert np.abs(pairs.matrix @ motions.reshape(-1, 3)).max() <= UNITY * 4.0
    forces = np.zeros(2 * len(pairs))
    forces[1::2] = pairs.area
    nodal = (pairs.matrix.T @ forces).reshape(-1, 2) @ pairs.frame[0, 1]
    for kind, table, sign in zip(kinds, faces, (1.0, -1.0)):
        exact = np.zeros(len(places))
        share = [1 / 6, 1 / 6, 2 / 3] if kind == "line3" else [0.5, 0.5]
        for face in table:
            length = np.linalg.norm(places[face[1]] - places[face[0]])
            exact[face] += 3.0 * length * np.array(share)
        own = np.unique(table)
        assert np.abs(nodal[own] * sign - exact[own]).max() <= PRESSURE * 12.0


def test_cylinders_turn_about_each_other() -> None:
    """Curved surfaces with different meshes: gaps of the order of their facets, and rotations that
    make no relative displacement; quadratic edges follow the circle closer."""
    gaps = []
    for quadratic in (False, True):
        faces, points = [], []
        for n, order in ((11, 1), (7, -1)):
            angle = np.linspace(0.0, 0.5 * np.pi, 2 * n + 1 if quadratic else n + 1)[::order]
            first = sum(len(p) for p in points)
            layers = [np.stack((10.0 * np.cos(angle), 10.0 * np.sin(angle),
                                np.full(len(angle), z)), axis=1) for z in (0.0, 1.5, 3.0)]
            points.append(np.concatenate(layers))
            m = len(angle)
            k = np.arange(n) * (2 if quadratic else 1) + first
            step = 2 if quadratic else 1
            low = np.stack((k, k + step), axis=1)
            table = np.column_stack((low, low[:, ::-1] + 2 * m))
            if quadratic:
                table = np.column_stack((table, k + 1, k + step + m, k + 1 + 2 * m, k + m))
            faces.append(table)
        places = np.concatenate(points)
        kind = "quad8" if quadratic else "quad"
        one, two = (Surface(places, {kind: table}, name)
                    for table, name in zip(faces, ("inner", "outer")))
        pairs = contact_pairs(one, two)
        assert np.abs(np.linalg.norm(pairs.frame[:, 2], axis=1) - 1.0).max() <= UNITY
        assert (np.einsum("ki,ki->k", pairs.frame[:, 2, :2], pairs.position[:, :2]) < 0.0).all()
        motions = rigid(places)
        assert np.abs(pairs.matrix @ motions).max() <= UNITY * np.abs(motions).max()
        exact = 10.0 * 0.5 * np.pi * 3.0
        assert abs(pairs.area.sum() - exact) <= 0.01 * exact
        gaps.append(np.abs(pairs.gap).max())
    sagitta = 10.0 * (1.0 - np.cos(np.pi / 28.0))
    assert gaps[0] <= 1.2 * sagitta
    assert gaps[1] <= 0.02 * gaps[0]


def refused(surfaces: tuple[Surface, Surface], words: str, tmp_path: object, **options: object
            ) -> None:
    with pytest.raises(RefusedSurfaces, match=words) as found:
        contact_pairs(*surfaces, **options)
    path = found.value.save(f"{tmp_path}/refused.png")
    assert path.stat().st_size > 5000
    assert found.value.exit_status == 3


def test_surfaces_that_are_refused(tmp_path: object) -> None:
    one, two, *_ = two_sheets(5, gap=0.2, same=True)
    far = Surface(one.points + 0.0, {"quad": one.nodes[:, :4]} if one.kind[0] == "quad" else
                  {one.kind[0]: one.nodes[:, :len(one.nodes[0][one.nodes[0] >= 0])]}, "one")
    refused((far, two), "nowhere within reach = 0.1; their nearest corners are 0.2", tmp_path,
            reach=0.1)
    inside_out = Surface(one.points, {"triangle": np.array(
        [face[[0, 2, 1]] for face in one.nodes[:, :3]])}, "one")
    refused((inside_out, two), "inside out", tmp_path)
    # Both sides of a thin plate behind each other.
    flat, faces = grid(3, 3, (3.0, 3.0), "quad")
    n = len(flat)
    space = np.concatenate([np.column_stack((flat, np.full(n, z))) for z in (0.0, 0.1, 0.3)])
    back = faces[:, ::-1]
    refused((Surface(space, {"quad": faces}, "one"),
             Surface(space, {"quad": np.concatenate((back + n, back + 2 * n))}, "two")),
            "9 faces of one face two twice", tmp_path)
    refused((Surface(space, {"quad": np.concatenate((back + n, back + 2 * n))}, "one"),
             Surface(space, {"quad": faces}, "two")), "9 faces of two face one twice", tmp_path)


@pytest.mark.parametrize(("change", "words"), [
    ({"tangent": (0.0, 0.0, 1.0)}, "along the normal"), ({"tangent": (0, 0, 0)}, "not all 0"),
    ({"reach": -1.0}, "reach = -1"), ({"thickness": 0.0}, "thickness = 0")])
def test_options_that_are_wrong(change: dict, words: str) -> None:
    flat, faces = grid(2, 2, (1.0, 1.0), "quad")
    space = np.concatenate([np.column_stack((flat, np.full(9, z))) for z in (0.0, 0.1)])
    with pytest.raises(fw.InputError, match=words):
        contact_pairs(Surface(space, {"quad": faces}, "one"),
                      Surface(space, {"quad": faces[:, ::-1] + 9}, "two"), **change)


@pytest.mark.parametrize(("faces", "words"), [
    ({"hexa": [[0, 1, 2, 3]]}, "kind 'hexa'"), ({"quad": [[0, 1, 2]]}, r"must be \(n, 4\)"),
    ({"triangle": [[0, 1, 2], [2, 0, 1]]}, "same corners"),
    ({"triangle": [[0, 1, 9]]}, "point 9"), ({}, "no faces")])
def test_faces_that_are_wrong(faces: dict, words: str) -> None:
    with pytest.raises(fw.InputError, match=words):
        Surface(np.eye(4, 3), faces)


def test_small_parts_join_their_neighbours() -> None:
    """An overlap that ends a hair behind a line of nodes makes no pairs of hairs."""
    flat, faces = grid(4, 2, (4.0, 2.0), "quad")
    n = len(flat)
    space = np.concatenate((np.column_stack((flat, np.zeros(n))),
                            np.column_stack((flat - [0.999, 0.0], np.zeros(n)))))
    pairs = contact_pairs(Surface(space, {"quad": faces}, "one"),
                          Surface(space, {"quad": faces[:, ::-1] + n}, "two"))
    assert abs(pairs.area.sum() - 3.001 * 2.0) <= AREA
    assert len(pairs) == 12     # of 15 nodes; the three behind the edge have no pair
    assert np.linalg.cond(pairs.matrix.toarray()) < 20.0
