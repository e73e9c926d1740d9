"""A mesh of another program goes through import and reduction: what is shown is what finite
elements say."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
import scipy.sparse.linalg as spl
from skfem import Basis, BilinearForm, ElementHex1, ElementVector, MeshHex1
from skfem.helpers import ddot, dot, eye, sym_grad, trace
from skfem.models.elasticity import lame_parameters

import fretwear as fw
from fretwear._native import unread_parts
from fretwear.cli import main
from fretwear.export import export_mesh

# A steel beam, mm-tonne-s-N, on soft springs and a friction foot below its left part.
YOUNG, POISSON, DENSITY = 2.1e5, 0.3, 7.85e-9
SPRING, FORCE, OMEGA = 2e4, 5.0, 2.0e4
# The mesh is kept in single precision.
STORED = 2e-6
# Corners of scikit-fem's hexahedron in the order of VTK.
VTK = [0, 3, 6, 2, 1, 5, 7, 4]


class Beam:
    """Matrices, positions and node numbers that follow no order."""

    def __init__(self) -> None:
        lines = np.linspace(0.0, 60.0, 7), np.linspace(0.0, 10.0, 3), np.linspace(0.0, 8.0, 2)
        self.mesh = MeshHex1.init_tensor(*lines)
        basis = Basis(self.mesh, ElementVector(ElementHex1()))
        lam, mu = lame_parameters(YOUNG, POISSON)

        @BilinearForm
        def stiffness(u, v, w):  # type: ignore[no-untyped-def]
            strain = sym_grad(u)
            return ddot(2.0 * mu * strain + lam * eye(trace(strain), 3), sym_grad(v))

        @BilinearForm
        def mass(u, v, w):  # type: ignore[no-untyped-def]
            return DENSITY * dot(u, v)

        place = basis.nodal_dofs.T.ravel()     # node after node, x y z
        self.stiffness, self.mass = (sp.csr_array(form.assemble(basis))[place][:, place]
                                     for form in (stiffness, mass))
        self.points = self.mesh.p.T.copy()
        self.cells = self.mesh.t[VTK].T.copy()
        n = len(self.points)
        self.nodes = 100 + 7 * np.random.default_rng(5).permutation(n)
        self.foot = np.flatnonzero((self.points[:, 2] < 1e-6) & (self.points[:, 0] < 25.0))
        far = (self.points[:, 0] > 59.0) & (self.points[:, 2] > 7.9) & (self.points[:, 1] > 9.0)
        self.tip = int(np.flatnonzero(far)[0])
        soft = np.zeros((n, 3))
        soft[self.foot] = SPRING
        self.stiffness = sp.csr_array(self.stiffness + sp.diags_array(soft.ravel()))

    def row(self, point: int, component: int) -> int:
        return 3 * point + component

    def write(self, folder: Path) -> None:
        """Matrices, labels, pairs and a load."""
        scipy.io.mmwrite(folder / "k.mtx", sp.coo_array(self.stiffness), symmetry="symmetric")
        scipy.io.mmwrite(folder / "m.mtx", sp.coo_array(self.mass), symmetry="symmetric")
        (folder / "labels.txt").write_text("\n".join(
            f"{3 * i + c + 1} {node} {c + 1}" for i, node in enumerate(self.nodes)
            for c in range(3)))
        (folder / "pairs.csv").write_text(
            "side_1_t1,side_1_t2,side_1_n,mu,area,x,y,z\n" + "".join(
                f"{self.nodes[k]}:1,{self.nodes[k]}:2,-{self.nodes[k]}:3,0.3,50,"
                f"{self.points[k, 0]},{self.points[k, 1]},0\n" for k in self.foot))
        (folder / "loads.csv").write_text(f"dof,cosine\n{self.nodes[self.tip]}:3,{FORCE}\n")

    def write_abaqus(self, path: Path) -> None:
        lines = ["*HEADING", "beam", "** nodes", "*NODE, NSET=ALL"]
        lines += [f"{node}, {x:.12g}, {y:.12g}, {z:.12g}"
                  for node, (x, y, z) in zip(self.nodes, self.points)]
        lines += ["*ELEMENT, TYPE=C3D8"]
        lines += [", ".join(map(str, [k, *self.nodes[cell]]))
                  for k, cell in enumerate(self.cells, 1)]
        path.write_text("\n".join(lines) + "\n")

    def write_nastran(self, path: Path) -> None:
        lines = ["BEGIN BULK"]
        lines += [f"GRID    {node:<8d}{'':8s}{x:<8.4f}{y:<8.4f}{z:<8.4f}"
                  for node, (x, y, z) in zip(self.nodes, self.points)]
        for k, cell in enumerate(self.cells, 1):
            words = [f"{word:<8d}" for word in (k, 1, *self.nodes[cell])]
            lines += ["CHEXA   " + "".join(words[:8]), "+       " + "".join(words[8:])]
        path.write_text("\n".join([*lines, "ENDDATA"]) + "\n")


@pytest.fixture(scope="module")
def beam(tmp_path_factory: pytest.TempPathFactory) -> tuple[Beam, Path]:
    folder = tmp_path_factory.mktemp("beam")
    made = Beam()
    made.write(folder)
    made.write_abaqus(folder / "beam.inp")
    made.write_nastran(folder / "beam.bdf")
    return made, folder


def _import(folder: Path, target: str, *options: str) -> Path:
    inputs = [str(folder / name) for name in ("k.mtx", "m.mtx")]
    tables = [word for name, file in (("labels", "labels.txt"), ("pairs", "pairs.csv"),
                                      ("loads", "loads.csv"))
              for word in (f"--{name}", str(folder / file))]
    path = folder / target
    assert main(["import", *inputs, *tables, "-o", str(path), *options]) == 0
    assert unread_parts(str(path)) == []
    return path


def _run(path: Path, file: Path) -> fw.Result:
    """Pairs that stay open: the answer is that of a linear structure on its springs."""
    return fw.frf(path, OMEGA, OMEGA, 1, file=file, harmonics={"n_harmonics": 1},
                  structure={"rayleigh_stiffness": 1e-7},
                  contact={"law": "penalty", "tangential_stiffness": SPRING,
                           "normal_stiffness": SPRING, "gap": 100.0})


def _linear(beam: Beam) -> np.ndarray:
    """First harmonic of every node (n_points, 3), by sparse factors of the full structure."""
    load = np.zeros(beam.mass.shape[0])
    load[beam.row(beam.tip, 2)] = FORCE
    matrix = (1.0 + 1e-7j * OMEGA) * beam.stiffness - OMEGA**2 * beam.mass
    return spl.spsolve(sp.csc_matrix(matrix), load).reshape(-1, 3)


@pytest.mark.parametrize("mesh", ["beam.inp", "beam.bdf"])
def test_motion_of_the_mesh_is_that_of_the_structure(beam: tuple[Beam, Path], mesh: str) -> None:
    made, folder = beam
    path = _import(folder, f"{mesh[5:]}.h5", "--mesh", str(folder / mesh))
    shown = export_mesh(_run(path, folder / f"{mesh[5:]}_frf.h5"), 0)
    exact = _linear(made)
    moved = shown.point_data["displacement_cosine"] - 1j * shown.point_data["displacement_sine"]
    order = [int(np.argmin(np.linalg.norm(shown.points - point, axis=1))) for point in made.points]
    assert np.abs(moved[order] - exact).max() <= STORED * np.abs(exact).max()


def test_reduced_model_keeps_mesh_and_static_motion(beam: tuple[Beam, Path]) -> None:
    """The reduced static answer, spread over the mesh, is that of the full structure, held."""
    made, folder = beam
    path = _import(folder, "reduced.h5", "--mesh", str(folder / "beam.inp"), "--reduce", "6")
    with h5py.File(path) as file:
        basis, points = file["mesh/basis"][()], file["mesh/points"][()]
        load, stiffness = file["load/cosine"][()], file["stiffness"][()]
        n_rows = int(file["contact/side_1"][()].max())
        assert len(file["mesh/facets"]) > 0
    free = slice(n_rows, None)                 # the contact coordinates held
    answer = np.zeros(len(stiffness))
    answer[free] = np.linalg.solve(stiffness[free, free], load[free])
    moved = (basis @ answer).reshape(-1, 3)
    held = np.setdiff1d(np.arange(made.mass.shape[0]),
                        [made.row(k, c) for k in made.foot for c in range(3)])
    force = np.zeros(made.mass.shape[0])
    force[made.row(made.tip, 2)] = FORCE
    exact = np.zeros(made.mass.shape[0])
    exact[held] = spl.spsolve(sp.csc_matrix(made.stiffness[held][:, held]), force[held])
    order = [int(np.argmin(np.linalg.norm(points - point, axis=1))) for point in made.points]
    assert np.abs(moved[order] - exact.reshape(-1, 3)).max() <= 1e-5 * np.abs(exact).max()


def test_facets_share_the_foot(beam: tuple[Beam, Path]) -> None:
    """Each node of the foot has the part of the faces around it: areas add up, a corner has a
    quarter of a face."""
    made, folder = beam
    path = _import(folder, "facets.h5", "--mesh", str(folder / "beam.inp"))
    with h5py.File(path) as file:
        corners = file["mesh/points"][()][file["mesh/facets"][()]].astype(float)
        pair = file["mesh/pair"][()]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0],
                                         corners[:, 3] - corners[:, 1]), axis=1)
    by_pair = np.bincount(pair, area, len(made.foot))
    assert area.sum() == pytest.approx(20.0 * 10.0, rel=STORED)
    corner = np.flatnonzero((made.points[made.foot, 0] < 1.0) & (made.points[made.foot, 1] < 1.0))
    assert by_pair[corner] == pytest.approx(10.0 * 5.0 / 4.0, rel=STORED)


def test_wrong_numbers_and_units_are_told(beam: tuple[Beam, Path],
                                          capsys: pytest.CaptureFixture[str]) -> None:
    """A mesh whose nodes are numbered otherwise strains the matrices when it is moved."""
    made, folder = beam
    text = (folder / "beam.inp").read_text()
    (folder / "good.inp").write_text(text)
    _import(folder, "good.h5", "--mesh", str(folder / "good.inp"))
    assert "strains" not in capsys.readouterr().err
    other = Beam()
    other.nodes = np.sort(made.nodes)
    other.write_abaqus(folder / "other.inp")
    _import(folder, "other.h5", "--mesh", str(folder / "other.inp"))
    assert "moved as a rigid body, the mesh strains" in capsys.readouterr().err
    other.nodes = made.nodes + 10**6
    other.write_abaqus(folder / "strange.inp")
    with pytest.raises(AssertionError):
        _import(folder, "strange.h5", "--mesh", str(folder / "strange.inp"))
    assert "no node of" in capsys.readouterr().err
    other.nodes, other.cells = made.nodes, made.cells[:, [4, 5, 6, 7, 0, 1, 2, 3]]
    other.write_abaqus(folder / "turned.inp")
    _import(folder, "turned.h5", "--mesh", str(folder / "turned.inp"))
    assert "12 of 12 cells have no positive volume" in capsys.readouterr().err


def test_other_cells_come_to_the_picture(beam: tuple[Beam, Path]) -> None:
    """Tetrahedra with nodes in the middle of their edges: shown by their corners."""
    import meshio

    folder = beam[1]
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    middle = [0.5 * (corner[i] + corner[j])
              for i, j in ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))]
    meshio.Mesh(np.vstack([corner, middle]), [("tetra10", np.arange(10)[None])]).write(
        folder / "one.vtu")
    from fretwear.importer import read_mesh_file

    found = read_mesh_file(folder / "one.vtu")
    assert found.nodes.tolist() == [1, 2, 3, 4]
    assert found.cells[0].tolist() == [0, 1, 2, 3, -1, -1, -1, -1]
    assert found.kind.tolist() == [10]


def test_ansys_archives_name_their_nodes(beam: tuple[Beam, Path]) -> None:
    """What mapdl-archive writes of the beam is read back: numbers, places and corners."""
    archive = pytest.importorskip("mapdl_archive")
    pyvista = pytest.importorskip("pyvista")
    from fretwear.importer import read_mesh_file

    made, folder = beam
    cells = np.column_stack((np.full(len(made.cells), 8), made.cells)).ravel()
    grid = pyvista.UnstructuredGrid(cells, np.full(len(made.cells), 12), made.points)
    grid.point_data["ansys_node_num"] = made.nodes
    archive.save_as_archive(str(folder / "beam.cdb"), grid)
    found = read_mesh_file(folder / "beam.cdb")
    place = dict(zip(made.nodes.tolist(), made.points))
    expected = [place[node] for node in found.nodes.tolist()]
    assert found.points == pytest.approx(np.array(expected), abs=1e-6)
    assert found.kind.tolist() == [12] * len(made.cells)
    assert {tuple(sorted(found.nodes[cell])) for cell in found.cells} == {
        tuple(sorted(made.nodes[cell])) for cell in made.cells}


def test_a_period_moves_in_a_picture(beam: tuple[Beam, Path]) -> None:
    pytest.importorskip("pyvista")
    from PIL import Image, ImageSequence

    _, folder = beam
    path = _import(folder, "moving.h5", "--mesh", str(folder / "beam.inp"))
    shown = _run(path, folder / "moving_frf.h5").animate(
        folder / "beam.gif", scalars="open", frames=2, size=(160, 120))
    with Image.open(folder / "beam.gif") as image:
        assert image.size == (160, 120) and image.n_frames == 2
    # The scene moves; below it colours and factor stand still, where no part comes.
    _run(path, folder / "moving_frf.h5").animate(folder / "beam.png", scalars="open", frames=2,
                                                 size=(160, 120))
    with Image.open(folder / "beam.png") as image:
        first, last = (np.asarray(frame.convert("RGB"), dtype=int)
                       for frame in ImageSequence.Iterator(image))
    assert (first[:101] != last[:101]).any() and (first[101:] == last[101:]).all()
    assert first[101:].min() < 128
    assert "data:image/gif;base64" in shown._repr_html_()
