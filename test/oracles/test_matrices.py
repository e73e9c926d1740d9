"""Matrices of the trade: hysteretic damping, Coriolis and circulatory forces, unsymmetric bearings,
and a rotation speed that follows the frequency.

Solutions from elsewhere (`test/reference/laws/matrices.json`: harmonic balance to round-off,
integration in time by DOP853), and equivalences: what is the same structure in other words has the
same motion.
"""
import json

import h5py
import numpy as np
import pytest
import scipy.linalg as la
from cases import run
from oracle_runs import run_case
from project import ROOT

ORACLE = json.loads((ROOT / "test" / "reference" / "laws" / "matrices.json").read_text())
#: Solver tolerance of all runs; and what two runs of one problem may differ by: the tolerance times
#: the condition of these structures (below 100) with a margin of ten.
TOLERANCE, WITHIN = 1e-12, 1e-9
#: Closed forms and dense solves.
EXACT = 1e-11


def write_model(path, matrices, load=None):
    """A model file; matrices by the names of their datasets."""
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        for name, values in {**matrices, **(load or {})}.items():
            file[name] = np.array(values, dtype=float)
    return path


def solve(folder, matrices, load, keys=None, omega=(1.0,), n_harmonics=3, **groups):
    """A sweep over some frequencies; the result and the datasets of its file."""
    write_model(folder / "model.h5", matrices, {f"load/{name}": f for name, f in load.items()})
    case = {"case": {"analysis": "frf"},
            "model": {"source": "hdf5", "file": "model.h5", **(keys or {})},
            "harmonics": {"n_harmonics": n_harmonics, "parity": "all"},
            "sweep": {"values": list(omega)}, "solver": {"tolerance": TOLERANCE}}
    for name, more in groups.items():
        case.setdefault(name, {}).update(more)
    found = run_case(folder, case)
    with h5py.File(folder / "case.h5") as file:
        more = {name: file[name][()] for name in ("structural/dissipation", "speed")
                if name in file}
        if "remarks" in file:
            more["remarks"] = [text.decode() for text in file["remarks/name"][()]]
        if "floquet/multipliers" in file:
            more["multipliers"] = file["floquet/multipliers"][()] @ [1.0, 1.0j]
    return found, more


def row_of(solution, n_harmonics):
    """(0, c1, s1, ..) of a dof of the reference."""
    row = [solution["x0"]]
    for c, s in list(zip(solution["xc"], solution["xs"]))[:n_harmonics]:
        row += [c, s]
    return np.array(row)


def amplitude(coefficients, n=1):
    return coefficients[..., 2 * n - 1, :] - 1j * coefficients[..., 2 * n, :]


def chain(seed, n=3, damped=True):
    random = np.random.default_rng(seed)
    k = random.uniform(0.8, 1.6, n + 1)
    stiffness = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    mass = np.diag(random.uniform(0.7, 1.3, n))
    return {"mass": mass, "stiffness": stiffness,
            **({"damping": 0.02 * mass + 0.01 * stiffness} if damped else {})}


def skew(seed, n=3):
    matrix = np.random.default_rng([7, seed]).normal(size=(n, n))
    return matrix - matrix.T


# ---------------------------------------------------------------- solutions from elsewhere

@pytest.mark.parametrize(("name", "errors"), [
    ("hysteretic_element", {3: 1e-5, 7: 1e-9}), ("hysteretic_proportional", {3: 1e-5, 7: 1e-9})])
@pytest.mark.parametrize("as_factor", [False, True])
def test_hysteretic_damping_with_a_cubic_spring(tmp_path, name, errors, as_factor):
    case = ORACLE["cases"][name]
    p = case["params"]
    if as_factor and name != "hysteretic_proportional":
        return
    keys = {"loss_factor": 0.02} if as_factor else {}
    matrices = {"mass": p["M"], "stiffness": p["K"], "damping": p["C"]}
    if not as_factor:
        matrices["structural_damping"] = p["D"]
    spring = {"n_springs": 1, "coefficient": p["alpha"], "power": 3}
    spring |= {"side_1": 1, "side_2": 2} if p["spring_row"][1] < 0 else {"side_1": 2}
    for n, limit in errors.items():
        found, more = solve(tmp_path, matrices, {"static": p["F0"], "cosine": p["F"]}, keys,
                            [p["omega"]], n, spring=spring)
        for dof in (0, 1):
            wanted = row_of(case[f"u{dof + 1}"], n)
            error = np.linalg.norm(found.coefficients[0, :, dof] - wanted)
            assert error < limit * np.linalg.norm(wanted), (n, dof, error)
        assert more["structural/dissipation"][0] == pytest.approx(
            case["structural_work"], rel=3 * limit)


@pytest.mark.parametrize("name", [name for name in ORACLE["cases"] if "whirl" in name])
def test_whirl_with_circulatory_forces(tmp_path, name):
    case = ORACLE["cases"][name]
    p = case["params"]
    found, more = solve(
        tmp_path, {"mass": p["M"], "stiffness": p["K"], "damping": p["C"], "coriolis": p["G"],
                   "circulatory": p["circulatory"]},
        {"static": p["F0"], "cosine": p["Fc"], "sine": p["Fs"]},
        {"rotation_speed": p["speed"]}, [p["omega"]])
    for dof in (0, 1):
        wanted = row_of(case[f"u{dof + 1}"], 3)
        assert np.linalg.norm(found.coefficients[0, :, dof] - wanted) < 1e-12
    assert "unstable" not in more.get("remarks", [])


def test_whirl_with_a_cubic_spring_and_friction(tmp_path):
    (name,) = [name for name in ORACLE["cases"] if "friction" in name]
    case = ORACLE["cases"][name]
    p = case["params"]
    # Where a slider rests that slipped on its way belongs to the state: here as a load.
    rests = p["kt"] * case["u2"]["x0"] - case["force_2"]["x0"]
    for n, limit in {3: 1e-2, 7: 1e-4, 15: 1e-5}.items():
        found, _ = solve(
            tmp_path, {"mass": p["M"], "stiffness": p["K"], "damping": p["C"], "coriolis": p["G"],
                       "circulatory": p["circulatory"]},
            {"static": [p["F0"][0], p["F0"][1] + rests], "cosine": p["Fc"], "sine": p["Fs"]},
            {"rotation_speed": p["speed"]}, [p["omega"]], n,
            spring={"n_springs": 1, "side_1": 1, "coefficient": p["alpha"], "power": 3},
            contact={"n_pairs": 1, "side_1": [2, 0, 0], "law": "penalty", "mu": 1.0,
                     "normal_load": p["muN"], "tangential_stiffness": p["kt"],
                     "normal_stiffness": 0.0})
        for dof in (0, 1):
            wanted = row_of(case[f"u{dof + 1}"], min(n, 7))
            error = np.linalg.norm(found.coefficients[0, :len(wanted), dof] - wanted)
            assert error < limit * np.linalg.norm(wanted), (n, dof, error)


@pytest.mark.parametrize("case", ORACLE["synchronous"])
def test_a_rotor_in_unbalance(tmp_path, case):
    p, speed = case["params"], case["speed"]
    force = p["me"] * speed**2
    found, more = solve(
        tmp_path, {"mass": p["M"], "stiffness": p["K"], "damping": p["C"], "coriolis": p["G"]},
        {"cosine": [force, 0.0], "sine": [0.0, force]}, omega=[speed], sweep={"speed_order": 1.0})
    u = amplitude(found.coefficients[0])
    assert np.abs(u - np.array(case["u"]) @ [1.0, -1.0j]).max() < 1e-12
    assert more["speed"] == pytest.approx([speed])


# ---------------------------------------------------------------- the same in other words

def test_a_loss_factor_at_one_frequency_is_viscous_damping(tmp_path):
    matrices = chain(1, damped=False)
    load = {"cosine": [0.1, 0.0, 0.05]}
    eta, omega = 0.07, 1.15
    spring = {"n_springs": 1, "side_1": 1, "side_2": 3, "coefficient": 0.4, "power": 3}
    factor, more = solve(tmp_path, matrices, load, {"loss_factor": eta}, [omega], 1, spring=spring)
    viscous, _ = solve(tmp_path, matrices | {"damping": eta / omega * matrices["stiffness"]}, load,
                       {}, [omega], 1, spring=spring)
    matrix, again = solve(
        tmp_path, matrices | {"structural_damping": eta * matrices["stiffness"]}, load, {},
        [omega], 1, spring=spring)
    air, _ = solve(tmp_path, matrices | {"aero/sector/0": np.stack(
        [0.0 * matrices["stiffness"], -eta * matrices["stiffness"]], axis=-1)}, load, {},
        [omega], 1, spring=spring)
    size = np.abs(factor.coefficients).max()
    for other in (viscous, matrix, air):
        assert np.abs(factor.coefficients - other.coefficients).max() < WITHIN * size
    u = amplitude(factor.coefficients[0])
    work = np.pi * eta * (u.conj() @ matrices["stiffness"] @ u).real
    assert more["structural/dissipation"][0] == pytest.approx(work, rel=1e-11)
    assert again["structural/dissipation"][0] == pytest.approx(work, rel=1e-9)


def test_harmonic_0_has_no_hysteretic_damping(tmp_path):
    matrices = chain(2)
    for keys, more in (({"loss_factor": 0.3}, {}),
                       ({}, {"structural_damping": 0.3 * matrices["stiffness"]})):
        found, _ = solve(tmp_path, matrices | more, {"static": [0.1, 0.2, 0.0],
                                                     "cosine": [0.0, 0.0, 0.1]}, keys)
        assert found.coefficients[0, 0] == pytest.approx(
            np.linalg.solve(matrices["stiffness"], [0.1, 0.2, 0.0]), rel=EXACT)


@pytest.mark.parametrize("law", ["penalty", "rigid", None])
def test_without_cyclic_is_with_one_sector(tmp_path, law):
    matrices = chain(3) | {"coriolis": skew(3)}
    load = {"cosine": [0.1, 0.0, 0.0], "sine": [0.0, 0.1, 0.05], "static": [0.02, 0.0, 0.01]}
    contact = {} if law is None else {"contact": {
        "n_pairs": 1, "side_1": [2, 0, 0], "law": law, "mu": 0.3, "normal_load": 0.2,
        **({"tangential_stiffness": 0.8, "normal_stiffness": 0.0} if law == "penalty" else {})}}
    found = [solve(tmp_path, matrices, load, {"rotation_speed": 0.6}, [0.7, 1.2], 5, **contact,
                   **more)[0].coefficients
             for more in ({}, {"cyclic": {"n_sectors": 1, "engine_order": 0}})]
    assert np.abs(found[0] - found[1]).max() < WITHIN * np.abs(found[0]).max()


def test_a_linear_rotor_against_a_dense_solve(tmp_path):
    """Every matrix at once, with a static load."""
    random = np.random.default_rng(11)
    n, speed, eta = 4, 0.9, 0.03
    parts = chain(4, n) | {
        "coriolis": 0.3 * skew(4, n), "circulatory": 0.05 * random.normal(size=(n, n)),
        "stiffness_unsymmetric": 0.2 * random.normal(size=(n, n)),
        "damping_unsymmetric": 0.02 * random.normal(size=(n, n)),
        "structural_damping": 0.01 * np.eye(n), "stiffness_rotation": 0.1 * np.eye(n)}
    load = {"static": random.normal(size=n), "cosine": random.normal(size=n),
            "sine": random.normal(size=n)}
    contact = {"n_pairs": 1, "side_1": [2, 0, 0], "law": "penalty", "mu": 0.3,
               "normal_load": 1e6, "tangential_stiffness": 0.5, "normal_stiffness": 0.0}
    omega = np.array([0.5, 1.0, 1.4])
    found, more = solve(tmp_path, parts, load,
                        {"rotation_speed": speed, "loss_factor": eta, "rayleigh_stiffness": 0.01},
                        omega, 1, contact=contact)
    k = parts["stiffness"] + speed**2 * parts["stiffness_rotation"]
    c = parts["damping"] + 0.01 * k + parts["damping_unsymmetric"] + speed * parts["coriolis"]
    d = parts["structural_damping"] + eta * k
    held = np.zeros((n, n))
    held[1, 1] = 0.5
    whole = k + parts["stiffness_unsymmetric"] + speed * parts["circulatory"] + held
    assert found.coefficients[:, 0] == pytest.approx(
        np.tile(np.linalg.solve(whole, load["static"]), (3, 1)), rel=1e-9)
    for i, w in enumerate(omega):
        u = np.linalg.solve(whole - w**2 * parts["mass"] + 1j * w * c + 1j * d,
                            load["cosine"] - 1j * load["sine"])
        assert np.abs(amplitude(found.coefficients[i]) - u).max() < EXACT * np.abs(u).max()
        assert more["structural/dissipation"][i] == pytest.approx(
            np.pi * (u.conj() @ d @ u).real, rel=1e-9)


def test_symmetric_parts_stay_what_they_are(tmp_path):
    """A symmetric matrix under the name of one of any shape is the stiffness itself, and no
    sector."""
    matrices = chain(5)
    added = 0.2 * np.eye(3)
    load = {"cosine": [0.1, 0.0, 0.0]}
    one, _ = solve(tmp_path, matrices | {"stiffness_unsymmetric": added,
                                         "damping_unsymmetric": 0.01 * added}, load)
    other, _ = solve(tmp_path, matrices | {"stiffness": matrices["stiffness"] + added,
                                           "damping": matrices["damping"] + 0.01 * added}, load)
    assert np.array_equal(one.coefficients, other.coefficients)


def test_inline_matrices_are_those_of_a_file(tmp_path):
    matrices = chain(6, 2) | {"stiffness_unsymmetric": [[0.1, 0.2], [-0.3, 0.05]],
                              "circulatory": [[0.0, 0.1], [-0.1, 0.0]],
                              "damping_unsymmetric": [[0.01, 0.0], [0.02, 0.01]],
                              "structural_damping": [[0.02, 0.01], [0.01, 0.02]]}
    load = {"static": [0.05, 0.0], "cosine": [0.1, 0.0]}
    of_file, _ = solve(tmp_path, matrices, load, {"rotation_speed": 0.5})
    text = {name: np.array(values) for name, values in matrices.items()}
    case = {"case": {"analysis": "point"}, "model": {"n_dof": 2, "rotation_speed": 0.5, **text},
            "load": load, "harmonics": {"n_harmonics": 3, "parity": "all"}, "sweep": {"start": 1.0},
            "solver": {"tolerance": TOLERANCE}}
    inline = run_case(tmp_path, case)
    assert inline.coefficients == pytest.approx(of_file.coefficients, rel=1e-13, abs=1e-16)


def test_turned_coriolis_forces_exchange_the_whirls(tmp_path):
    p = ORACLE["cases"]["gyroscopic_whirl_0.85"]["params"]
    matrices = {"mass": p["M"], "stiffness": p["K"], "damping": p["C"]}
    found = {}
    for turn in (1.0, -1.0):
        for way in (1.0, -1.0):
            found[turn, way] = solve(
                tmp_path, matrices | {"coriolis": turn * np.array(p["G"])},
                {"cosine": [0.1, 0.0], "sine": [0.0, 0.1 * way]}, {"rotation_speed": 0.8},
                [0.85, 1.17])[0].amplitude
    assert found[1.0, 1.0] == pytest.approx(found[-1.0, -1.0], rel=1e-12)
    assert found[1.0, -1.0] == pytest.approx(found[-1.0, 1.0], rel=1e-12)
    assert np.abs(found[1.0, 1.0] / found[1.0, -1.0] - 1.0).min() > 0.1


def test_coriolis_forces_do_no_work(tmp_path):
    """What the load gives is what the damping takes."""
    matrices = chain(7)
    load = {"cosine": [0.1, 0.0, 0.0], "sine": [0.0, 0.1, 0.05]}
    found, _ = solve(tmp_path, matrices | {"coriolis": skew(7)}, load, {"rotation_speed": 0.7},
                     [0.9])
    u = amplitude(found.coefficients[0])
    f = np.array(load["cosine"]) - 1j * np.array(load["sine"])
    given = np.pi * (u.conj() @ f).imag
    taken = np.pi * 0.9 * (u.conj() @ matrices["damping"] @ u).real
    work = np.pi * 0.9 * 0.7 * (u.conj() @ skew(7) @ u).real
    assert given == pytest.approx(taken, rel=1e-12)
    assert abs(work) < 1e-14 * taken + 1e-16


@pytest.mark.parametrize("order", [1.0, 3.0])
@pytest.mark.parametrize("law", ["penalty", "dlft", "rigid"])
def test_a_speed_that_follows_is_point_by_point(tmp_path, order, law):
    n = 3
    matrices = chain(8) | {"coriolis": 0.4 * skew(8), "stiffness_rotation": 0.2 * np.eye(n),
                           "circulatory": 0.05 * np.random.default_rng(8).normal(size=(n, n)),
                           "damping_unsymmetric": 0.02 * skew(9)}
    if law != "penalty":
        # Rigid pairs have a number of the method, that of the symmetric stiffness: the same here.
        matrices["stiffness_rotation"], matrices["circulatory"] = np.zeros((n, n)), 0.05 * skew(8)
    load = {"static": [0.05, 0.0, 0.0], "cosine": [0.1, 0.0, 0.05],
            "static_rotation": [0.0, 0.1, 0.0]}
    keys = {"loss_factor": 0.02, "rayleigh_stiffness": 0.01}
    contact = {"n_pairs": 1, "side_1": [2, 0, 0], "law": law, "mu": 0.3, "normal_load": 0.1,
               **({"tangential_stiffness": 0.8, "normal_stiffness": 0.0} if law == "penalty"
                  else {})}
    omega = [0.6, 1.0, 1.3]
    followed, more = solve(tmp_path, matrices, load, keys, omega, 3, contact=contact,
                           sweep={"speed_order": order})
    assert more["speed"] == pytest.approx(np.array(omega) / order, rel=1e-15)
    for i, w in enumerate(omega):
        one, other = solve(tmp_path, matrices, load, keys | {"rotation_speed": w / order}, [w], 3,
                           contact=contact)
        size = np.abs(one.coefficients).max()
        assert np.abs(followed.coefficients[i] - one.coefficients[0]).max() < 1e-8 * size
        assert more["structural/dissipation"][i] == pytest.approx(
            other["structural/dissipation"][0], rel=1e-7)


def test_a_branch_with_a_speed_that_follows(tmp_path):
    """By arc length the derivative by the frequency holds that by the speed."""
    matrices = chain(9) | {"coriolis": 0.4 * skew(9), "stiffness_rotation": 0.2 * np.eye(3)}
    load = {"cosine": [0.2, 0.0, 0.05], "static_rotation": [0.0, 0.1, 0.0]}
    spring = {"n_springs": 1, "side_1": 1, "coefficient": 0.5, "power": 3}
    write_model(tmp_path / "model.h5", matrices, {f"load/{k}": v for k, v in load.items()})
    case = {"case": {"analysis": "frf"}, "model": {"source": "hdf5", "file": "model.h5"},
            "spring": spring, "harmonics": {"n_harmonics": 3},
            "sweep": {"start": 0.8, "end": 1.6, "n_points": 30, "continuation": "arclength",
                      "speed_order": 1.0}, "solver": {"tolerance": TOLERANCE}}
    branch = run_case(tmp_path, case)
    assert branch.converged.all() and len(branch.omega) > 20
    with h5py.File(tmp_path / "case.h5") as file:
        tangent = file["tangent/coefficients"][()] / file["tangent/omega"][()][:, None, None]
    for i in range(2, len(branch.omega) - 2, 5):
        w, h = branch.omega[i], 1e-5
        points, _ = solve(tmp_path, matrices, load, {}, [w - h, w, w + h], 3, spring=spring,
                          sweep={"speed_order": 1.0})
        size = np.abs(branch.coefficients[i]).max()
        if np.abs(points.coefficients[1] - branch.coefficients[i]).max() > 1e-6 * size:
            continue  # Another solution at this frequency.
        slope = (points.coefficients[2] - points.coefficients[0]) / (2.0 * h)
        assert np.abs(slope - tangent[i]).max() < 1e-5 * np.abs(slope).max() + 1e-7


def test_multipliers_of_a_rotor(tmp_path):
    p = ORACLE["cases"]["gyroscopic_whirl_1.17"]
    matrices, omega = p["params"], 1.17
    _, more = solve(
        tmp_path, {"mass": matrices["M"], "stiffness": matrices["K"], "damping": matrices["C"],
                   "coriolis": matrices["G"], "circulatory": matrices["circulatory"]},
        {"cosine": [0.1, 0.0]}, {"rotation_speed": 0.8}, [omega], sweep={"stability": True},
        spring={"n_springs": 1, "side_1": 1, "coefficient": 1e-12, "power": 3})
    wanted = np.exp(np.array(p["eigenvalues"]) @ [1.0, 1.0j] * 2.0 * np.pi / omega)
    assert sorted(more["multipliers"][0], key=lambda z: (z.real, z.imag)) == pytest.approx(
        sorted(wanted, key=lambda z: (z.real, z.imag)), abs=1e-8)


def test_an_unstable_rotor_is_remarked_once(tmp_path):
    matrices = {"mass": np.eye(2), "stiffness": np.eye(2), "damping": 0.02 * np.eye(2),
                "circulatory": [[0.0, 0.1], [-0.1, 0.0]]}
    _, more = solve(tmp_path, matrices, {"cosine": [0.1, 0.0]}, {"rotation_speed": 0.1}, [0.8, 0.9])
    assert more["remarks"].count("unstable") == 0
    _, more = solve(tmp_path, matrices, {"cosine": [0.1, 0.0]}, {"rotation_speed": 1.0}, [0.8, 0.9])
    assert more["remarks"].count("unstable") == 1
    _, more = solve(tmp_path, matrices, {"cosine": [0.1, 0.0]}, {"rotation_speed": 1.0}, [0.8],
                    sweep={"stability": True})
    roots = la.eigvals(np.block([
        [np.zeros((2, 2)), np.eye(2)],
        [-np.eye(2) - np.array(matrices["circulatory"]), -0.02 * np.eye(2)]]))
    assert np.abs(more["multipliers"][0]).max() == pytest.approx(
        np.exp(roots.real.max() * 2.0 * np.pi / 0.8), rel=1e-8)


# ---------------------------------------------------------------- the parameter

def test_sweeps_and_derivatives_by_the_loss_factor(tmp_path):
    matrices = chain(10)
    load = {"static": [0.05, 0.0, 0.0], "cosine": [0.1, 0.0, 0.05]}
    contact = {"n_pairs": 1, "side_1": [2, 0, 0], "law": "penalty", "mu": 0.3, "normal_load": 0.1,
               "tangential_stiffness": 0.8, "normal_stiffness": 0.0}
    keys = {"loss_factor": 0.04}

    def at(eta):
        return solve(tmp_path, matrices, load, {"loss_factor": eta}, [0.9], 3,
                     contact=contact)[0].coefficients[0]

    values = [0.0, 0.04, 0.1]
    write_model(tmp_path / "model.h5", matrices, {f"load/{k}": v for k, v in load.items()})
    case = {"case": {"analysis": "frf"}, "model": {"source": "hdf5", "file": "model.h5", **keys},
            "contact": contact, "harmonics": {"n_harmonics": 3, "parity": "all"},
            "sweep": {"parameter": "model%loss_factor", "values": values, "frequency": 0.9},
            "solver": {"tolerance": TOLERANCE}}
    swept = run_case(tmp_path, case)
    for eta, row in zip(values, swept.coefficients, strict=True):
        assert row == pytest.approx(at(eta), abs=WITHIN * np.abs(row).max())
    case["sweep"] = {"values": [0.9]}
    case["sensitivity"] = {"parameters": "model%loss_factor", "quantities": "first_harmonic"}
    run(tmp_path, case)
    with h5py.File(tmp_path / "case.h5") as file:
        slope = file["sensitivity/first_harmonic/model_loss_factor"][()].ravel()
    h = 1e-4
    size = [np.abs(amplitude(at(0.04 + step))) for step in (-h, h)]
    assert slope == pytest.approx((size[1] - size[0]) / (2.0 * h), rel=1e-5)


def test_derivatives_by_both_ways_hold_the_loss_factor(tmp_path):
    """Many parameters by few quantities (adjoint), with the damping in the factors of all."""
    matrices = chain(12) | {"stiffness_rotation": 0.2 * np.eye(3)}
    load = {"static": [0.05, 0.0, 0.0], "cosine": [0.1, 0.0, 0.05]}
    names = {"model%loss_factor": 0.04, "model%rayleigh_stiffness": 0.01,
             "model%rotation_speed": 0.5, "model%rayleigh_mass": 0.02, "load%harmonic_scale": 1.0,
             "load%static_scale": 1.0, "spring%coefficient": 0.3}
    write_model(tmp_path / "model.h5", matrices, {f"load/{k}": v for k, v in load.items()})
    with h5py.File(tmp_path / "model.h5", "r+") as file:
        file["observe/dof"], file["observe/name"] = [1], np.array([b"tip"])

    def case(**changes):
        values = names | changes
        found = {"case": {"analysis": "point"}, "model": {"source": "hdf5", "file": "model.h5"},
                 "spring": {"n_springs": 1, "side_1": 2, "power": 3}, "load": {},
                 "harmonics": {"n_harmonics": 3, "parity": "all"}, "sweep": {"start": 0.9},
                 "solver": {"tolerance": TOLERANCE}}
        for name, value in values.items():
            group, key = name.split("%")
            found[group][key] = value
        return found

    wanted = case()
    wanted["sensitivity"] = {"parameters": list(names), "quantities": "first_harmonic"}
    run(tmp_path, wanted)
    with h5py.File(tmp_path / "case.h5") as file:
        slopes = {name: float(file["sensitivity/first_harmonic/" + name.replace("%", "_")][()]
                              .ravel()[0]) for name in names}
    for name, value in names.items():
        h = 1e-4 * value
        size = [np.abs(amplitude(run_case(tmp_path, case(**{name: value + step}))
                                 .coefficients[0]))[0] for step in (-h, h)]
        assert slopes[name] == pytest.approx((size[1] - size[0]) / (2.0 * h), rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("as_matrix", [False, True])
def test_a_mode_has_half_the_loss_factor_as_damping_ratio(tmp_path, as_matrix):
    """Proportional hysteretic damping: xi = eta omega."""
    matrices, eta = chain(13, damped=False), 0.03
    keys = {} if as_matrix else {"loss_factor": eta}
    if as_matrix:
        matrices["structural_damping"] = eta * matrices["stiffness"]
    write_model(tmp_path / "model.h5", matrices)
    case = {"case": {"analysis": "mode"}, "model": {"source": "hdf5", "file": "model.h5", **keys},
            "spring": {"n_springs": 1, "side_1": 1, "coefficient": 1e-9, "power": 3},
            "mode": {"number": 2, "start": 0.01, "end": 0.1}, "harmonics": {"n_harmonics": 3}}
    run_case(tmp_path, case)
    with h5py.File(tmp_path / "case.h5") as file:
        omega, ratio = file["omega"][()], file["mode/damping_ratio"][()]
    wanted = np.sqrt(la.eigvalsh(matrices["stiffness"], matrices["mass"]))[1]
    assert omega == pytest.approx(wanted, rel=1e-7)
    assert ratio == pytest.approx(eta / 2.0, rel=1e-6)


def test_a_resonance_over_the_loss_factor(tmp_path):
    """One mass: the largest amplitude is f/(k eta), at the natural frequency."""
    case = {"case": {"analysis": "resonance"},
            "model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0, "loss_factor": 0.05},
            "spring": {"n_springs": 1, "side_1": 1, "coefficient": 1e-12, "power": 3},
            "load": {"cosine": 0.1}, "harmonics": {"n_harmonics": 1},
            "sweep": {"start": 0.8, "end": 1.2, "n_points": 9},
            "resonance": {"parameter": "model%loss_factor", "start": 0.05, "end": 0.1,
                          "n_points": 3}}
    found = run_case(tmp_path, case)
    eta = np.array([0.05, 0.075, 0.1])
    assert found.omega == pytest.approx(np.ones(3), rel=1e-6)
    assert found.amplitude[:, 0] == pytest.approx(0.1 / eta, rel=1e-6)


def test_peaks_of_a_rotor_are_found_between_coarse_rows(tmp_path):
    """A critical speed that no row is near."""
    matrices = {"mass": np.eye(2), "stiffness": np.eye(2), "damping": 0.004 * np.eye(2),
                "coriolis": [[0.0, 0.6], [-0.6, 0.0]]}
    write_model(tmp_path / "model.h5", matrices, {"load/cosine": [0.1, 0.0],
                                                  "load/sine": [0.0, -0.1]})
    case = {"case": {"analysis": "frf"}, "model": {"source": "hdf5", "file": "model.h5"},
            "harmonics": {"n_harmonics": 1},
            "sweep": {"start": 0.3, "end": 1.3, "n_points": 6, "speed_order": 1.0}}
    run(tmp_path, case)
    with h5py.File(tmp_path / "case.h5") as file:
        peaks = file["peak/omega"][()]
    # This load drives the whirl of 1 - w^2 - 0.6 w^2.
    assert np.abs(peaks - 1.0 / np.sqrt(1.6)).min() < 1e-3


def test_wear_with_hysteretic_damping(tmp_path):
    """A matrix in proportion to the stiffness is the loss factor, cycle after cycle."""
    depths = []
    for as_matrix in (False, True):
        stiffness = np.diag([1.0, 2.0])
        case = {"case": {"analysis": "wear"},
                "model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 0.0], "stiffness": stiffness,
                          **({"structural_damping": 0.1 * stiffness} if as_matrix
                             else {"loss_factor": 0.1})},
                "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 2], "mu": 0.3,
                            "area": 1.0, "tangential_stiffness": 2.0, "normal_stiffness": 3.0},
                "load": {"static": [0.0, -1.0], "cosine": [1.0, 0.0]},
                "harmonics": {"n_harmonics": 3}, "sweep": {"start": 0.9},
                "wear": {"coefficient": 1e-3, "n_cycles": 20, "max_depth_step": 0.01},
                "solver": {"tolerance": TOLERANCE}}
        run(tmp_path, case)
        with h5py.File(tmp_path / "case.h5") as file:
            depths.append(file["wear/depth"][()])
            assert (file["structural/dissipation"][()] > 0.0).all()
    assert depths[0] == pytest.approx(depths[1], rel=1e-8)


# ---------------------------------------------------------------- refused

@pytest.mark.parametrize(("more", "keys", "groups", "words"), [
    ({"structural_damping": [[1.0, 0.2], [0.1, 1.0]]}, {}, {},
     ["structural_damping", "not symmetric"]),
    ({"stiffness_unsymmetric": [[1.0, np.nan], [0.1, 1.0]]}, {}, {},
     ["stiffness_unsymmetric", "finite"]),
    ({"coriolis": [[0.0, 0.2], [0.2, 0.0]]}, {"rotation_speed": 1.0}, {}, ["coriolis", "skew"]),
    ({}, {"loss_factor": 0.1}, {"case": {"analysis": "time"}}, ["loss_factor", "time"]),
    ({}, {"loss_factor": 0.1}, {"sweep": {"stability": True}}, ["loss_factor", "stability"]),
    ({"structural_damping": np.eye(2)}, {}, {"sweep": {"stability": True}},
     ["structural damping", "stability"]),
    ({"coriolis": [[0.0, 0.2], [-0.2, 0.0]]}, {"rotation_speed": 1.0},
     {"case": {"analysis": "time"}}, ["coriolis", "time"]),
    ({"coriolis": [[0.0, 0.2], [-0.2, 0.0]]}, {"rotation_speed": 1.0},
     {"sweep": {"speed_order": 1.0}}, ["speed_order", "rotation_speed"]),
    ({}, {}, {"sweep": {"speed_order": 1.0}}, ["speed_order", "nothing"]),
    ({"stiffness_rotation": np.eye(2)}, {"modal_damping": 0.01}, {"sweep": {"speed_order": 1.0}},
     ["speed_order", "modal_damping"]),
    ({"stiffness_rotation": np.eye(2)}, {}, {
        "sweep": {"speed_order": 1.0, "parameter": "load%harmonic_scale", "values": [1.0],
                  "frequency": 1.0}}, ["speed_order", "parameter"]),
    ({}, {}, {"sweep": {"speed_order": -1.0}}, ["speed_order", "at least 0"])])
def test_what_is_refused(tmp_path, more, keys, groups, words):
    parts = {"mass": np.eye(2), "stiffness": np.eye(2), "damping": 0.1 * np.eye(2)}
    write_model(tmp_path / "model.h5", parts | more, {"load/cosine": [0.1, 0.0]})
    case = {"case": {"analysis": "frf"},
            "model": {"source": "hdf5", "file": "model.h5", **keys},
            "harmonics": {"n_harmonics": 1}, "sweep": {"values": [1.0]}}
    for name, values in groups.items():
        case.setdefault(name, {}).update(values)
        case[name] = {key: value for key, value in case[name].items() if value is not None}
    told = run(tmp_path, case, status=3).stderr
    for word in words:
        assert word in told, told
