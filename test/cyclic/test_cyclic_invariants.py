"""What leaves a travelling wave as it is, what must not, and its balance of work."""
import copy

import numpy as np
import pytest
from annulus import Annulus, random_case
from cases import run, write_parts
from cyclic_cases import TIGHT, difference, read, read_reference, run_at
from nodal_file import tied, write_nodal_file

#: Solutions of the same equations, which are formed in another order: round-off of 1e-16 times the
#: condition of these sectors, below 1e3 (measured 5e-15 at most with three kernels of OpenBLAS).
SAME = 1e-12
#: Of stress, what rows add up loses a factor of 100. The mean is taken at the two instants that are
#: furthest apart, which a flat maximum fixes to the root of round-off alone (measured 8e-12, and
#: 8e-10 with another kernel of OpenBLAS).
STRESS = {"coefficients": 1e-10, "amplitude": 1e-10, "mean": 1e-7}
#: Work of the load against what is dissipated: residuals of 1e-12 times quotients of both.
BALANCE = 1e-10
OMEGAS = [0.8, 1.7]


def some_case(seed, **options):
    return random_case(np.random.default_rng([5, seed]), **options)


def run_both(tmp_path, first, second, **options):
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
    return (run_at(tmp_path / "first", first, OMEGAS, **options),
            run_at(tmp_path / "second", second, OMEGAS, **options))


def assert_same(a, b):
    assert difference(a["coefficients"], b["coefficients"]) < SAME
    assert difference(a["contact/force"], b["contact/force"]) < SAME


def assert_bit_for_bit(a, b):
    for name in ("coefficients", "contact/force", "contact/fraction", "contact/dissipation"):
        assert np.array_equal(a[name], b[name]), name


@pytest.mark.parametrize("shift", [1, -3])
def test_engine_orders_that_differ_by_the_sectors(tmp_path, shift):
    case = some_case(1, n_sectors=7, engine_order=2)
    other = {**case, "engine_order": 2 + 7 * shift}
    assert_bit_for_bit(*run_both(tmp_path, case, other))


def test_fewer_sectors_with_the_same_wave(tmp_path):
    case = some_case(2, n_sectors=12, engine_order=-9, n_pairs=1)
    assert_bit_for_bit(*run_both(tmp_path, case, {**case, "n_sectors": 4, "engine_order": -3}))


@pytest.mark.parametrize("law", ["penalty", "dlft"])
def test_a_pair_from_its_other_sector(tmp_path, law):
    case = some_case(3, n_pairs=1, law=law)
    other = copy.deepcopy(case)
    contact = other["contact"]
    contact["side_1"], contact["side_2"] = (
        [[-d for d in side] for side in contact[name]] for name in ("side_2", "side_1"))
    contact["sector_2"] = [-s for s in contact["sector_2"]]
    a, b = run_both(tmp_path, case, other)
    assert difference(a["coefficients"], b["coefficients"]) < SAME
    assert np.allclose(a["contact/dissipation"], b["contact/dissipation"], rtol=SAME)


def test_sectors_numbered_backwards(tmp_path):
    case = some_case(4)
    other = copy.deepcopy(case)
    model = other["model"]
    model["left"] = [abs(r) for r in case["model"]["right"]]
    model["right"] = [int(np.sign(r)) * left
                      for left, r in zip(case["model"]["left"], case["model"]["right"])]
    other["contact"]["sector_2"] = [-s for s in case["contact"]["sector_2"]]
    other["engine_order"] = -case["engine_order"]
    assert_same(*run_both(tmp_path, case, other))


@pytest.mark.parametrize("law", ["penalty", "dlft"])
def test_one_sector_is_a_plain_structure(tmp_path, law):
    case = some_case(19, law=law, n_sectors=1, engine_order=0)
    case["contact"]["sector_2"] = [0] * len(case["contact"]["sector_2"])
    annulus = Annulus(case)
    a, b = run_both(tmp_path, case, annulus.case, status=(0, 4))
    solved = a["converged"].astype(bool)
    assert np.array_equal(solved, b["converged"].astype(bool)) and solved.any()
    assert difference(a["coefficients"][solved],
                      annulus.sector(b["coefficients"][solved])) < SAME
    assert difference(a["contact/force"][solved], b["contact/force"][solved]) < SAME


@pytest.mark.parametrize("phase", ["delay", "advance"])
def test_matrices_of_nodal_diameters(tmp_path, phase):
    """All of them, of the unreduced sector, against the sector; loads and rows with them."""
    case = some_case(6, law="dlft")
    diameters = {}
    for k in range(case["n_sectors"] // 2 + 1):
        diameters[k], kept = tied(case, k)
    n = len(case["model"]["mass"])
    place = {i + 1: p + 1 for p, i in enumerate(kept)}
    contact = {name: [[int(np.sign(d)) * place[abs(d)] if d else 0 for d in side]
                      for side in case["contact"][name]] for name in ("side_1", "side_2")}
    contact |= {name: case["contact"][name] for name in ("sector_2", "mu", "gap")}
    write_nodal_file(tmp_path / "model.h5", case["n_sectors"], len(kept), diameters, phase=phase,
                     contact=contact, observe=[f"u{i + 1}" for i in range(n)])
    (tmp_path / "sector").mkdir()
    sector = run_at(tmp_path / "sector", case, OMEGAS)
    run(tmp_path, {"case": {"analysis": "frf"},
                   "model": {"source": "hdf5", "file": "model.h5"},
                   "cyclic": {"engine_order": case["engine_order"]}, "contact": {"law": "dlft"},
                   "harmonics": {"n_harmonics": case["n_harmonics"], "sampling": "events"},
                   "sweep": {"values": OMEGAS}, "solver": {"tolerance": TIGHT}})
    assert_same(read(tmp_path / "case.h5"), sector)


@pytest.mark.parametrize("phase", ["delay", "advance"])
def test_stress_of_nodal_diameters(tmp_path, phase):
    """Rows of stress with the nodal diameters, against the same of the unreduced sector."""
    case = some_case(6, law="dlft")
    n = len(case["model"]["mass"])
    rows = np.random.default_rng(11).normal(size=(3, 6, n))
    diameters = {}
    for k in range(case["n_sectors"] // 2 + 1):
        diameters[k], kept = tied(case, k)
        diameters[k]["stress/matrix"] = rows @ diameters[k].pop("observe/matrix")
    place = {i + 1: p + 1 for p, i in enumerate(kept)}
    contact = {name: [[int(np.sign(d)) * place[abs(d)] if d else 0 for d in side]
                      for side in case["contact"][name]] for name in ("side_1", "side_2")}
    contact |= {name: case["contact"][name] for name in ("sector_2", "mu", "gap")}
    found = []
    for name in ("nodal", "sector"):
        (tmp_path / name).mkdir()
        path = tmp_path / name / "model.h5"
        if name == "nodal":
            write_nodal_file(path, case["n_sectors"], len(kept), diameters, phase=phase,
                             contact=contact)
        else:
            write_parts(path, {key: case["model"][key] for key in (
                "mass", "stiffness", "damping")} | {
                f"load/{key}": values for key, values in case["load"].items()} | {
                f"contact/{key}": case["contact"][key] for key in (
                    "side_1", "side_2", "sector_2", "mu", "gap")} | {
                "cyclic@n_sectors": case["n_sectors"], "cyclic/left": case["model"]["left"],
                "cyclic/right": case["model"]["right"], "stress/matrix": rows})
        run(path.parent, {"case": {"analysis": "frf"},
                          "model": {"source": "hdf5", "file": "model.h5"},
                          "cyclic": {"engine_order": case["engine_order"]},
                          "contact": {"law": "dlft"}, "stress": {"output": "tensor"},
                          "harmonics": {"n_harmonics": case["n_harmonics"], "sampling": "events"},
                          "sweep": {"values": OMEGAS}, "solver": {"tolerance": TIGHT}})
        found.append(read(path.parent / "case.h5"))
    assert np.abs(found[1]["stress/coefficients"]).max() > 0.1
    for name, limit in STRESS.items():
        assert difference(found[0][f"stress/{name}"], found[1][f"stress/{name}"]) < limit
    del diameters[1]["stress/matrix"]
    write_nodal_file(tmp_path / "model.h5", case["n_sectors"], len(kept), diameters,
                     contact=contact)
    done = run(tmp_path, {"case": {"analysis": "frf"},
                          "model": {"source": "hdf5", "file": "model.h5"},
                          "cyclic": {"engine_order": case["engine_order"]},
                          "sweep": {"values": OMEGAS}}, status=3)
    assert "no nodal_diameter/1/stress/matrix" in done.stderr


def test_reference_of_reduced_nodal_diameters(tmp_path):
    case = read_reference("v6")
    model, contact = case["model"], case["contact"]
    n = model["n_physical"]
    write_nodal_file(tmp_path / "model.h5", case["n_sectors"], n, v6_diameters(case),
                     load={key: values[:n] for key, values in case["load"].items()},
                     contact={key: contact[key] for key in ("side_1", "side_2", "sector_2", "mu",
                                                            "gap")})
    for sampling in ("uniform", "events"):
        points = case["points"]
        run(tmp_path, {
            "case": {"analysis": "frf"}, "model": {"source": "hdf5", "file": "model.h5"},
            "cyclic": {"engine_order": case["engine_order"]},
            "contact": {"law": "penalty", **{key: contact[key] for key in
                                             ("tangential_stiffness", "normal_stiffness")}},
            "harmonics": {"n_harmonics": case["n_harmonics"], "sampling": sampling,
                          "n_time": points[0][sampling].get("n_time", 0)},
            "sweep": {"values": [point["omega"] for point in points]},
            "solver": {"tolerance": TIGHT}})
        found = read(tmp_path / "case.h5")
        for i, point in enumerate(points):
            expected = np.array(point[sampling]["u"])
            assert difference(found["coefficients"][i], expected[:, :n]) < 1e-8
            assert difference(found["contact/force"][i], point[sampling]["force"]) < 1e-8


def v6_diameters(case):
    """Complex matrices of every nodal diameter of the reference."""
    return {parts["nodal_diameter"]: {
        key: np.array(parts[key]["real"]) + 1j * np.array(parts[key]["imag"])
        for key in ("mass", "stiffness", "damping")}
        for parts in case["model"]["nodal_diameters"]}


def test_frequencies_of_reduced_nodal_diameters(tmp_path):
    case = read_reference("v6")
    write_nodal_file(tmp_path / "model.h5", case["n_sectors"], case["model"]["n_physical"],
                     v6_diameters(case), contact={key: case["contact"][key] for key in (
                         "side_1", "side_2", "sector_2", "mu", "gap")})
    run(tmp_path, {
        "case": {"analysis": "modes"}, "model": {"source": "hdf5", "file": "model.h5"},
        "cyclic": {"n_modes": 20}, "contact": {"law": "penalty", **{
            key: case["contact"][key] for key in ("tangential_stiffness", "normal_stiffness")}}})
    found = read(tmp_path / "case.h5")
    for k, linear in enumerate(case["linear"]):
        assert found["modes/nodal_diameter"][k] == linear["nodal_diameter"]
        for state in ("open", "closed"):
            frequencies = found[f"modes/{state}"][k]
            assert np.allclose(frequencies[np.isfinite(frequencies)], linear[state], rtol=1e-9,
                               atol=0.0), (k, state)


def test_the_way_of_the_wave_matters(tmp_path):
    """A sector without symmetry tells the sign of the engine order."""
    case = some_case(7, n_sectors=7, engine_order=2)
    a, b = run_both(tmp_path, case, {**case, "engine_order": -2})
    assert difference(a["coefficients"], b["coefficients"]) > 0.05


@pytest.mark.parametrize("law", ["penalty", "dlft"])
def test_work_of_the_load_is_dissipated_in_one_sector(tmp_path, law):
    case = some_case(8, law=law)
    found = run_at(tmp_path, case, OMEGAS, status=(0, 4))
    assert found["converged"].any()
    damping = np.array(case["model"]["damping"])
    cosine, sine = (np.array(case["load"][key]) for key in ("cosine", "sine"))
    for i, omega in enumerate(OMEGAS):
        if not found["converged"][i]:
            continue
        c, s = found["coefficients"][i][1::2], found["coefficients"][i][2::2]
        work = np.pi * (cosine @ s[0] - sine @ c[0])
        n = np.arange(1, len(c) + 1)
        viscous = np.pi * omega * np.sum(n**2 * np.array(
            [u @ damping @ u + v @ damping @ v for u, v in zip(c, s)]))
        friction = found["contact/dissipation"][i].sum()
        assert abs(work - viscous - friction) < BALANCE * abs(work)


@pytest.mark.parametrize("law", ["penalty", "dlft", "dlft_velocity", "rigid"])
def test_linear_solvers_and_threads(tmp_path, law):
    case = some_case(9, law=law)
    found = {}
    for name in ("lu", "krylov"):
        (tmp_path / name).mkdir()
        found[name] = run_at(tmp_path / name, case, OMEGAS,
                             solver={"linear": name, "tolerance": 1e-11})
    (tmp_path / "threads").mkdir()
    found["threads"] = run_at(tmp_path / "threads", case, OMEGAS, others={"case": {"threads": 2}},
                              solver={"linear": "lu", "tolerance": 1e-11})
    assert np.array_equal(found["threads"]["coefficients"], found["lu"]["coefficients"])
    assert difference(found["krylov"]["coefficients"], found["lu"]["coefficients"]) < 1e-10


def test_same_dof_of_neighbours_by_a_rigid_law_is_refused(tmp_path):
    case = some_case(10, law="dlft", n_sectors=6, engine_order=1, n_pairs=1)
    contact = case["contact"]
    contact["side_2"] = copy.deepcopy(contact["side_1"])
    from cyclic_cases import model_groups
    groups = model_groups(case) | {"case": {"analysis": "point"}, "sweep": {"start": 1.0},
                                   "harmonics": {"n_harmonics": 3}}
    done = run(tmp_path, groups, status=3)
    assert "nodal diameter 0" in done.stderr and "penalty" in done.stderr
