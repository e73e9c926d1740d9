"""The mass of bodies as a parameter of a travelling wave: `body%mass` of a sector, against
differences of runs, against the whole annulus, and the best mass against a sweep."""
import h5py
import numpy as np
import pytest
from bodies import model_of
from cases import run, with_model
from test_bodies import SAME, TIGHT, annulus, at, sliding, solved

import fretwear as fw

#: Central differences of a relative step of 1e-4: 1e-8 of curvature, as much of round-off.
STEP, DIFFERENT = 1e-4, 1e-6

BY_MASS = {"parameters": ["body%mass"]}


def slopes(path, quantity="first_harmonic"):
    with h5py.File(path) as file:
        return np.ravel(file[f"sensitivity/{quantity}/body_mass"][0])


def values(path):
    with h5py.File(path) as file:
        return np.hypot(*file["coefficients"][0][1:3])


def against_differences(model, folder, case, **parts):
    """The derivative of a run and that of two runs with other masses; `parts` of the model file in
    place of its own."""
    model.to_hdf5(folder / "model.h5")
    with h5py.File(folder / "model.h5", "r+") as file:
        for name, part in parts.items():
            if name in file:
                del file[name]
            file[name] = part
    mass = float(model.bodies.mass[0])
    run(folder, with_model(case))
    slope = slopes(folder / "case.h5")
    ends = []
    for sign in (-1, 1):
        run(folder, with_model(case | {"body": {"mass": [(1 + sign * STEP) * mass]}}))
        ends.append(values(folder / "case.h5"))
    difference = (ends[1] - ends[0]) / (2 * STEP * mass)
    assert np.abs(difference).max() > 0.0
    return np.abs(slope - difference).max() / np.abs(difference).max()


def held(model, stiffness=2e4):
    """Springs on the body, whose modes have damping then."""
    K = np.array(model.K)
    for dof in (4, 5):
        K[dof, dof] += stiffness
        K[dof, 0] -= 0.3 * stiffness
        K[0, dof] -= 0.3 * stiffness
    return K


@pytest.mark.parametrize("order", [0, 1, 3, 2])
def test_derivative_of_a_wave(order, tmp_path):
    """Nodal diameters of both directions, those that stand, and harmonics of others of them."""
    case = sliding(sectors=4, order=order)
    groups = at(case["omega"], cyclic={"engine_order": order}, solver=TIGHT, sensitivity=BY_MASS)
    groups["model"] |= {"rayleigh_mass": 0.3}
    assert against_differences(model_of(case), tmp_path, groups) < DIFFERENT


@pytest.mark.parametrize("wave", [False, True])
@pytest.mark.parametrize("joint", ["open", "stuck"])
def test_damping_of_modes_follows(joint, wave, tmp_path):
    """A body that springs or stuck pairs hold is in modes, whose damping its mass changes."""
    case = sliding(sectors=5, order=1) | {"wave": wave}
    groups = at(case["omega"], solver=TIGHT, sensitivity=BY_MASS)
    groups["model"] |= {"modal_damping": 0.1, "modal_damping_of": joint}
    if wave:
        groups["cyclic"] = {"engine_order": 1}
    model = model_of(case)
    parts = {"stiffness": held(model)} if joint == "open" else {}
    assert against_differences(model, tmp_path, groups, **parts) < DIFFERENT


def test_derivative_of_a_rotating_wave(tmp_path):
    """Coriolis forces: Z is neither Hermitian nor the same for both directions."""
    case = sliding(sectors=6, order=2)
    model = model_of(case)
    G = np.zeros_like(model.K)
    G[0, 1], G[2, 3] = 0.1, -0.2
    groups = at(case["omega"], cyclic={"engine_order": 2}, solver=TIGHT, sensitivity=BY_MASS)
    assert against_differences(model, tmp_path, groups, coriolis=G - G.T) < DIFFERENT


@pytest.mark.parametrize("parts", ["coriolis", "structural_damping"])
def test_matrices_without_sectors(parts, tmp_path):
    """Matrices that are not real and symmetric, which are solved as those of a wave."""
    case = sliding() | {"wave": False}
    model = model_of(case)
    G = np.zeros_like(model.K)
    G[0, 1], G[2, 3] = 0.1, -0.2
    part = {parts: G - G.T if parts == "coriolis" else 0.05 * np.array(model.K)}
    groups = at(case["omega"], solver=TIGHT, sensitivity=BY_MASS)
    assert against_differences(model, tmp_path, groups, **part) < DIFFERENT
    mass = float(model.bodies.mass[0])
    sweep = {"parameter": "body%mass", "frequency": case["omega"], "start": 0.9 * mass,
             "end": 1.2 * mass, "n_points": 3}
    plain = {name: keys for name, keys in groups.items() if name != "sensitivity"}
    run(tmp_path, with_model(plain | {"case": {"analysis": "frf"}, "sweep": sweep}))
    swept = rows_of(tmp_path / "case.h5")
    run(tmp_path, with_model(plain | {"body": {"mass": [1.2 * mass]}}))
    for one, all_of_it in zip(rows_of(tmp_path / "case.h5"), swept):
        assert np.abs(all_of_it[-1] - one[0]).max() < SAME * np.abs(one[0]).max()


def test_derivative_of_the_annulus(tmp_path):
    """All sectors and bodies as one structure have the derivatives of the wave."""
    n = 4
    case = sliding(sectors=n, order=1)
    wave = model_of(case)
    found = []
    for name, model, more in (("wave", wave, {"cyclic": {"engine_order": 1}}),
                              ("whole", annulus(case, wave, n, np.ones(n)), {})):
        (tmp_path / name).mkdir()
        solved(model, tmp_path / name, case["omega"], solver=TIGHT, sensitivity=BY_MASS, **more)
        found.append(slopes(tmp_path / name / "case.h5"))
    m = wave.n_dof
    whole = found[1].reshape(-1)
    for j in range(n):
        of_sector = np.concatenate([whole[4 * j:4 * j + 4],
                                    whole[4 * n + (m - 4) * j:4 * n + (m - 4) * (j + 1)]])
        assert np.abs(of_sector - found[0]).max() < SAME * np.abs(whole).max()


def ring(**more):
    """Blades of a disk with a wedge between each two, and a sweep over their resonance."""
    K = np.diag([13e3, 34e3, 13e3, 34e3]) - 4e3 * np.eye(4)[[2, 3, 0, 1]]
    flanks = {"left": fw.Flank([[3, 4]] * 2, [[-0.01, 0.0], [-0.01, 0.004]]),
              "right": fw.Flank([[1, 2]] * 2, [[0.01, 0.0], [0.01, 0.004]], sector=1)}
    model = fw.damper(fw.Model(np.eye(4), 1e-3 * K, K, cosine=[8.0, 0.0, 0.0, 0.0],
                               sectors=fw.Sectors(6), observe={"blade": 1}),
                      "wedge", mass=0.006, inertia=6e-8, radius=0.2, angles=(50.0, 50.0), mu=0.3,
                      tangential_stiffness=2e4, normal_stiffness=3e4, law="penalty", **flanks)
    case = at(0.0) | {"case": {"analysis": "frf"}, "cyclic": {"engine_order": 1},
                      "harmonics": {"n_harmonics": 3, "sampling": "events"},
                      "sweep": {"start": 92.0, "end": 104.0, "n_points": 13}}
    return model, case | more


def top_of(result):
    """The maximum of a polynomial through five rows about the largest."""
    size = np.abs(result.harmonic(1, "blade"))
    i = int(np.clip(size.argmax(), 2, len(size) - 3))
    curve = np.polynomial.Polynomial.fit(result.omega[i - 2:i + 3], size[i - 2:i + 3], 4)
    return curve(np.linspace(*result.omega[[i - 1, i + 1]], 2001)).max()


def test_best_mass_of_a_wave(tmp_path):
    """The smallest peak by the derivative, against those of 100 masses."""
    model, groups = ring()
    model.to_hdf5(tmp_path / "model.h5")
    run(tmp_path, with_model(groups))
    case = fw.Case.from_file(tmp_path / "case.nml")
    found = fw.optimise(case, over="body%mass", minimise="max_first_harmonic[blade]",
                        bounds=(0.004, 0.009))
    masses = np.linspace(0.9, 1.1, 100) * found.values[0]
    tops = [top_of(fw.run(case.replace(body={"mass": [mass]}))) for mass in masses]
    assert abs(found.value / min(tops) - 1.0) < 1e-4
    # Inside: the ends are higher.
    assert 5 < np.argmin(tops) < 94 and min(tops[0], tops[-1]) > 1.001 * found.value


def test_what_does_not_go(tmp_path):
    """Refused in words, with a remedy."""
    case = sliding(sectors=4, order=1)
    model_of(case).to_hdf5(tmp_path / "model.h5")
    wave = {"cyclic": {"engine_order": 1}}
    groups = at(case["omega"], sensitivity=BY_MASS, **wave)
    disk = groups | {"cyclic": {"engine_order": 1, "mistuned": True}}
    message = run(tmp_path, with_model(disk), status=3).stderr
    assert "mistuned disk" in message and "&body mass" in message
    follows = groups | {"case": {"analysis": "frf"}, "model": {},
                        "sweep": {"start": 60.0, "end": 80.0, "n_points": 3, "speed_order": 1.0}}
    message = run(tmp_path, with_model(follows), status=3).stderr
    assert "speed_order" in message and "rotation_speed" in message
    other = groups | {"sensitivity": {"parameters": ["model%modal_damping"]}}
    assert "not served" in run(tmp_path, with_model(other), status=3).stderr


def rows_of(path):
    with h5py.File(path) as file:
        return file["coefficients"][()], file["contact/force"][()]


@pytest.mark.parametrize("damping", [1.0, 0.0])
@pytest.mark.parametrize("order", [1, 3])
def test_sweep_over_the_mass(damping, order, tmp_path):
    """A sweep over masses and the points of these, with damping and without: there all free dofs
    are coordinates."""
    case = sliding(sectors=4, order=order)
    case["damping"] *= damping
    model = model_of(case)
    model.to_hdf5(tmp_path / "model.h5")
    groups = at(case["omega"], cyclic={"engine_order": order}, solver=TIGHT)
    mass = float(model.bodies.mass[0])
    sweep = {"parameter": "body%mass", "frequency": case["omega"], "start": 0.8 * mass,
             "end": 1.3 * mass, "n_points": 4}
    for more in ({}, {"continuation": "arclength"}):
        run(tmp_path, with_model(groups | {"case": {"analysis": "frf"}, "sweep": sweep | more}))
        with h5py.File(tmp_path / "case.h5") as file:
            masses = file["parameter"][()]
        swept = rows_of(tmp_path / "case.h5")
        for k in (0, len(masses) // 2, len(masses) - 1):
            run(tmp_path, with_model(groups | {"body": {"mass": [float(masses[k])]}}))
            for one, all_of_it in zip(rows_of(tmp_path / "case.h5"), swept):
                assert np.abs(all_of_it[k] - one[0]).max() < SAME * np.abs(one[0]).max()


@pytest.mark.parametrize("continuation", ["natural", "arclength"])
def test_resonance_over_the_mass(continuation, tmp_path):
    """Each resonance is the maximum over the frequency, or the phase, of a case of its mass."""
    model, groups = ring()
    model.to_hdf5(tmp_path / "model.h5")
    condition = "phase" if continuation == "arclength" else "amplitude"
    track = groups | {"case": {"analysis": "resonance"}, "solver": TIGHT, "resonance": {
        "parameter": "body%mass", "start": 0.005, "end": 0.008, "n_points": 4,
        "condition": condition, "continuation": continuation}}
    run(tmp_path, with_model(track))
    with h5py.File(tmp_path / "case.h5") as file:
        rows = file["parameter"][()], file["omega"][()], file["coefficients"][()]
    for mass, omega, found in list(zip(*rows))[::3]:
        sizes = []
        for part in (0.999, 1.0, 1.001):
            run(tmp_path, with_model(groups | {
                "case": {"analysis": "point"}, "sweep": {"start": part * float(omega)},
                "body": {"mass": [float(mass)]}, "solver": TIGHT}))
            with h5py.File(tmp_path / "case.h5") as file:
                one = file["coefficients"][0]
            sizes.append(np.hypot(*one[1:3, 0]))
            if part == 1.0:
                assert np.abs(found - one).max() < SAME * np.abs(one).max()
        if condition == "amplitude":
            assert sizes[1] > max(sizes[0], sizes[2])


def test_damping_of_a_mode_by_mass(tmp_path):
    """Self-excitation is in proportion to mass: of a mode that slips the derivative has both."""
    case = sliding() | {"wave": False}
    model = model_of(case)
    model.to_hdf5(tmp_path / "model.h5")
    mass = float(model.bodies.mass[0])
    groups = at(0.0) | {"case": {"analysis": "mode"}, "sweep": {},
                        "mode": {"number": 1, "start": 1e-4, "end": 2e-3, "n_points": 3},
                        "solver": TIGHT, "sensitivity": BY_MASS}
    said = {}
    for part in (0.0, -STEP, STEP):
        run(tmp_path, with_model(groups | {"body": {"mass": [(1.0 + part) * mass]}}))
        with h5py.File(tmp_path / "case.h5") as file:
            said[part] = [[file[f"sensitivity/{where}"][-1] for where in (
                f"value/{of}", f"{of}/body_mass")] for of in ("mode_omega", "mode_damping_ratio")]
    for k in (0, 1):
        difference = (said[STEP][k][0] - said[-STEP][k][0]) / (2 * STEP * mass)
        assert abs(said[0.0][k][1] - difference) < DIFFERENT * abs(difference)


def test_derivative_of_nodal_diameters(tmp_path):
    """Matrices of nodal diameters, with damping of modes of a body that springs hold, have the
    derivatives of the sector that they are of."""
    case = sliding(sectors=4, order=1)
    model = model_of(case)
    groups = at(case["omega"], cyclic={"engine_order": 1}, solver=TIGHT, sensitivity=BY_MASS)
    groups["model"] |= {"modal_damping": 0.1}
    # Without an interface a sector is the same in every nodal diameter.
    parts = {name: np.stack([np.array(matrix), 0.0 * model.M], -1) for name, matrix in (
        ("mass", model.M), ("stiffness", held(model)), ("damping", model.C))}
    model.to_hdf5(tmp_path / "model.h5")
    with h5py.File(tmp_path / "model.h5", "r+") as file:
        for name, part in parts.items():
            del file[name]
            file[name] = part[..., 0]
    run(tmp_path, with_model(groups))
    wanted = slopes(tmp_path / "case.h5")
    with h5py.File(tmp_path / "model.h5", "r+") as file:
        file["cyclic"].attrs["n_physical"] = model.n_dof
        for name, part in parts.items():
            del file[name]
            for k in range(3):
                file[f"nodal_diameter/{k}/{name}"] = part
    run(tmp_path, with_model(groups))
    assert np.abs(slopes(tmp_path / "case.h5") - wanted).max() < SAME * np.abs(wanted).max()
    sweep = {"parameter": "body%mass", "frequency": case["omega"], "start": 0.01, "end": 0.02,
             "n_points": 3}
    moved = groups | {"case": {"analysis": "frf"}, "sweep": sweep}
    del moved["sensitivity"]
    message = run(tmp_path, with_model(moved), status=3).stderr
    assert "nodal diameters do not move" in message and "&body mass" in message
