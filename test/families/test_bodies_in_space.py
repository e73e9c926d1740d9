"""Bodies with six dofs, and identities of bodies: points against a copy that is turned, a body
turned with its flanks, matrices of a mesh that is rigid, a ring of one normal direction around a
disk."""
import h5py
import numpy as np
import pytest
from bodies import SPEED, complex_rows
from cases import run, with_model
from test_bodies import read_result

import fretwear as fw

#: Residuals of 1e-12 of the load times the condition of what slips (below 10), margin of ten.
SAME = 1e-10
MASS, RADIUS, ANGLES, MU = 0.05, 0.2, (52.0, 47.0), 0.2
LEFT = np.array([[-0.01, 0.001, -0.003], [-0.01, 0.003, 0.004]])
RIGHT = np.array([[0.011, 0.0, -0.004], [0.009, 0.004, 0.003]])
INERTIA = np.array([[5e-6, 3e-7, 0.0], [3e-7, 4e-6, 5e-7], [0.0, 5e-7, 6e-6]])
STIFF = {"tangential_stiffness": 2e4, "normal_stiffness": 3e4, "law": "penalty"}


def turn_by(vector):
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def blades(n=2, **more):
    """Blades of three dofs each."""
    K = np.diag(np.tile([9e3, 2e4, 1.3e4], n) * (1.0 + 0.07 * np.arange(3 * n)))
    load = np.tile([8.0, 1.0, -3.0], n) * np.repeat((-1.0)**np.arange(n), 3)
    return fw.Model(np.eye(3 * n), 5e-4 * K, K, cosine=load, **more)


def body(model=None, kind="wedge", **more):
    flanks = {"left": fw.Flank([[1, 2, 3]] * 2, LEFT), "right": fw.Flank([[4, 5, 6]] * 2, RIGHT)}
    settings = {"mass": MASS, "inertia": INERTIA, "radius": RADIUS, "mu": MU, **STIFF, **flanks}
    if kind == "wedge":
        settings["angles"] = ANGLES
    return fw.damper(blades() if model is None else model, kind, **settings | more)


def solved(model, folder, omega=110.0, tolerance=1e-12, parts=None, **more):
    """Also with other parts of the model file."""
    folder.mkdir(exist_ok=True)
    model.to_hdf5(folder / "model.h5")
    with h5py.File(folder / "model.h5", "r+") as file:
        for name, values in (parts or {}).items():
            file[name][...] = values
    run(folder, with_model({
        "case": {"analysis": "point"}, "model": {"rotation_speed": SPEED},
        "harmonics": {"n_harmonics": 3, "n_time": 64, "sampling": "uniform"},
        "sweep": {"start": omega}, "solver": {"tolerance": tolerance}, **more}))
    return read_result(folder / "case.h5")


def frames(kind):
    """Rows t1, t2, n of both flanks, by the formulas of the manual."""
    a, b = np.radians(ANGLES if kind in ("wedge", "cylinder") else (90.0, 90.0))
    return (np.array([[np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0], [np.cos(a), -np.sin(a), 0.0]]),
            np.array([[-np.sin(b), np.cos(b), 0.0], [0.0, 0.0, -1.0],
                      [-np.cos(b), -np.sin(b), 0.0]]))


@pytest.mark.parametrize("kind", ["wedge", "cylinder", "strip", "split_ring"])
def test_points_against_a_turned_copy(kind, tmp_path):
    """What the rows of side 1 say of rotations about x, y and z, and of displacements, against the
    places of a copy of the body that is turned and moved."""
    more = {}
    places = np.vstack([LEFT, RIGHT])
    if kind == "cylinder":
        size = 0.006
        more = {"size": size, "angles": ANGLES,
                "left": fw.Flank([[1, 2, 3]] * 2, LEFT[:, 2:]),
                "right": fw.Flank([[4, 5, 6]] * 2, RIGHT[:, 2:])}
        for k, frame in enumerate(frames(kind)):
            places[2 * k:2 * k + 2, :2] = -size * frame[2, :2]
    model = body(kind=kind, **more)
    rows = np.asarray(model.rows)
    small = 1e-5
    for i, place in enumerate(places):
        frame = frames(kind)[i // 2]
        for axis in range(6):
            unit = np.eye(3)[axis % 3]
            if axis < 3:
                moved = unit
            else:
                moved = (turn_by(small * unit) - turn_by(-small * unit)) @ place / (2.0 * small)
            wanted = frame @ moved
            for c in range(3):
                number = model.contact.side_1[i, c]
                found = np.sign(number) * rows[abs(number) - model.n_dof - 1][6 + axis] if \
                    abs(number) > model.n_dof else float(number == 7 + axis)
                assert abs(found - wanted[c]) < SAME


@pytest.mark.parametrize("space", [False, True], ids=["plane", "space"])
def test_body_turned_with_its_flanks(space, tmp_path):
    """All that a body touches turned about z by an angle, with the load that presses it: the blades
    move as before, the body in the turned directions."""
    angle = 0.31
    c, s = np.cos(angle), np.sin(angle)
    n = 3 if space else 2
    Q = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])[:n, :n]
    inertia = INERTIA if space else 5e-6
    plain = body(inertia=inertia, left=fw.Flank([[1, 2, 3][:n]] * 2, LEFT[:, :n]),
                 right=fw.Flank([[4, 5, 6][:n]] * 2, RIGHT[:, :n]))
    # x and y of both platforms, in the directions of the body.
    rows = np.zeros((2 * n, 6))
    for k in range(2):
        rows[n * k:n * k + n, 3 * k:3 * k + n] = Q
    base = blades(rows=rows)
    turned_inertia = Q @ INERTIA @ Q.T if space else inertia
    turned = body(base, inertia=turned_inertia, angles=(ANGLES[0] - np.degrees(angle),
                                                        ANGLES[1] + np.degrees(angle)),
                  left=fw.Flank([np.arange(7, 7 + n)] * 2, LEFT[:, :n] @ Q.T),
                  right=fw.Flank([np.arange(7 + n, 7 + 2 * n)] * 2, RIGHT[:, :n] @ Q.T))
    one = solved(plain, tmp_path / "plain").coefficients[0]
    two = solved(turned, tmp_path / "turned",
                 parts={"body/direction": [[-s, c, 0.0]]}).coefficients[0]
    size = np.abs(one).max()
    assert np.abs(two[:, :6] - one[:, :6]).max() < SAME * size
    assert np.abs(two[:, 6:6 + n] - one[:, 6:6 + n] @ Q.T).max() < SAME * size
    turn = np.abs(one[:, 6 + n:]).max()
    T = Q if space else np.eye(1)
    assert np.abs(two[:, 6 + n:] - one[:, 6 + n:] @ T.T).max() < SAME * max(turn, size)


def test_mesh_that_is_rigid(tmp_path):
    """Matrices and rows of a free body of six rigid modes, as a wedge of that mass; and the same
    with the modes mixed."""
    plain = body()
    one = solved(plain, tmp_path / "wedge").coefficients[0]
    mass = np.zeros((6, 6))
    mass[:3, :3], mass[3:, 3:] = MASS * np.eye(3), INERTIA
    load = np.array([0.0, MASS * RADIUS, 0.0, 0.0, 0.0, 0.0])

    def rows(places):
        return np.array([np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]])
                         for x, y, z in places])

    mixed = np.linalg.qr(np.random.default_rng(3).normal(size=(6, 6)))[0]
    scale = np.diag([1.0, 1.0, 1.0, 1e2, 1e2, 1e2])
    for name, T in (("same", np.eye(6)), ("mixed", scale @ mixed)):
        model = body(kind="mesh", mass=None, inertia=None, radius=0.0, angles=ANGLES,
                     matrices=(T.T @ mass @ T, np.zeros((6, 6)), None), load=T.T @ load,
                     left=fw.Flank([[1, 2, 3]] * 2, rows=rows(LEFT) @ T),
                     right=fw.Flank([[4, 5, 6]] * 2, rows=rows(RIGHT) @ T))
        two = solved(model, tmp_path / name).coefficients[0]
        size = np.abs(one).max()
        assert np.abs(two[:, :6] - one[:, :6]).max() < SAME * size
        body_of = two[:, 6:] @ T.T
        assert np.abs(body_of[:, :3] - one[:, 6:9]).max() < SAME * size
        # Rotations times the size of the body are displacements.
        assert np.abs(body_of[:, 3:] - one[:, 9:]).max() < SAME * size / np.abs(LEFT).max()


def ring(model, own, after, sector, **more):
    """A quarter of a split ring below the platforms of a blade and the next one."""
    arc = np.linspace(-0.02, 0.02, 4)
    places = np.column_stack([arc, -0.5 * arc**2, [0.002, -0.003, 0.003, -0.002]])
    return fw.damper(model, "split_ring", mass=MASS, inertia=[4e-6, 5e-6, 6e-6], radius=RADIUS,
                     left=fw.Flank([own] * 2, places[:2]),
                     right=fw.Flank([after] * 2, places[2:], sector=sector), mu=5.0, **STIFF,
                     **more)


@pytest.mark.parametrize("order", [1, 2])
def test_ring_around_a_disk(order, tmp_path):
    """Points of one normal direction, both ends on neighbours: a wave, with the ring of a sector
    seen from either side, and all sectors and rings as one structure. Nothing but friction holds a
    ring along its arc: it sticks, or lifts off and comes back, so that nothing is left of where the
    march begins; the wave is later from sector to sector by whole instants."""
    n, load = 4, np.array([6.0, 30.0, -4.0])
    K = np.diag([9e3, 2e4, 1.3e4])
    sector = fw.Model(np.eye(3), 5e-4 * K, K, cosine=load, sectors=fw.Sectors(n))
    cyclic = {"cyclic": {"engine_order": order}}
    wave = complex_rows(solved(ring(sector, [1, 2, 3], [1, 2, 3], 1), tmp_path / "wave",
                               **cyclic).coefficients[0])
    phases = np.exp(-2j * np.pi * order * np.arange(n) / n)
    all_loads = np.outer(phases, load).ravel()
    whole = fw.Model(np.eye(3 * n), 5e-4 * np.kron(np.eye(n), K), np.kron(np.eye(n), K),
                     cosine=all_loads.real, sine=-all_loads.imag)
    for j in range(n):
        own, after = 3 * j, 3 * ((j + 1) % n)
        whole = ring(whole, [own + 1, own + 2, own + 3], [after + 1, after + 2, after + 3], 0,
                     name=f"ring {j}")
    found = complex_rows(solved(whole, tmp_path / "whole").coefficients[0])
    size = np.abs(found).max()
    for j in range(n):
        turn = np.exp(-2j * np.pi * order * j * np.arange(len(wave)) / n)[:, None]
        assert np.abs(turn * wave[:, :3] - found[:, 3 * j:3 * j + 3]).max() < SAME * size
        at = 3 * n + 6 * j
        assert np.abs(turn * wave[:, 3:] - found[:, at:at + 6]).max() < SAME * size
    # The ring of the sector before: both ends counted from there.
    arc = ring(sector, [1, 2, 3], [1, 2, 3], 1)
    other = complex_rows(solved(arc, tmp_path / "behind", parts={
        "contact/sector_2": np.asarray(arc.contact.sector_2) - 1}, **cyclic).coefficients[0])
    turn = np.exp(-2j * np.pi * order * np.arange(len(wave)) / n)[:, None]
    assert np.abs(other[:, :3] - wave[:, :3]).max() < SAME * size
    assert np.abs(other[:, 3:] - np.conj(turn) * wave[:, 3:]).max() < SAME * size
