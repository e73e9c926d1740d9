"""Motion of the base, and loads by a table of the frequency.

test/reference/laws/load_base.json: structures whose last dof is a support that moves, integrated
in time. And equations of the same motion written in other ways: loads in place of the base, a
ground in place of supports, velocities and accelerations in place of displacements.
"""
import json

import h5py
import numpy as np
import pytest
from cases import merged, run
from oracle_runs import run_case
from project import ROOT
from test_several_laws import coefficients_of, difference

import fretwear as fw

REFERENCE = json.loads((ROOT / "test/reference/laws/load_base.json").read_text())
#: Solver tolerance of all runs; what two runs of one problem may differ by: the tolerance times the
#: condition of the structures (below 100), and a margin of ten. Linear ones: round-off.
TOLERANCE, WITHIN, ROUND_OFF = 1e-11, 1e-8, 1e-11


def on_support(p, n_harmonics):
    """A structure of the reference, as its matrices with the support stand there."""
    n = len(p["M"])
    terms = [*p["base"], *([[0, p["base_static"], 0.0]] if p["base_static"] else [])]
    groups = {
        "case": {"title": "on a support", "analysis": "point"},
        "model": {"n_dof": n, "mass": p["M"], "damping": p["C"], "stiffness": p["K"]},
        "load": {"static": [*p["F0"], 0.0]},
        "base": {"n_terms": len(terms), "dof": n, "harmonic": [t[0] for t in terms],
                 "amplitude": [t[1] for t in terms], "phase": [t[2] for t in terms],
                 "frame": "absolute"},
        "harmonics": {"n_harmonics": n_harmonics}, "output": {"observe": [f"u{k + 1}" for k in
                                                                          range(n)]},
        "sweep": {"start": p["omega"]}, "solver": {"tolerance": TOLERANCE},
    }
    if "alpha" in p:
        groups["spring"] = {"n_springs": 1, "side_1": 1, "side_2": n, "coefficient": p["alpha"],
                            "power": 3}
        groups["contact"] = {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 0],
                             "side_2": [n, 0, 0], "mu": 1.0, "normal_load": p["muN"],
                             "tangential_stiffness": p["kt"]}
    return groups


def base_coefficients(p, n_harmonics):
    row = np.zeros(2 * n_harmonics + 1)
    row[0] = p["base_static"]
    for n, amplitude, phase in p["base"]:
        row[2 * n - 1] += amplitude * np.cos(np.radians(phase))
        row[2 * n] -= amplitude * np.sin(np.radians(phase))
    return row


# Relative errors at H = 3, 7 and 15: round-off of linear structures, else truncation, about twice
# what is measured.
@pytest.mark.parametrize(("name", "bounds"), [
    ("sdof", (1e-12,) * 3), ("linear_two_harmonics", (1e-12,) * 3),
    ("cubic_friction", (4e-3, 6e-5, 4e-6))])
def test_motion_is_as_integrated(tmp_path, name, bounds):
    case = REFERENCE["cases"][name]
    p = case["params"]
    for n_harmonics, bound in zip((3, 7, 15), bounds, strict=True):
        found = run_case(tmp_path, on_support(p, n_harmonics))
        kept = 2 * min(n_harmonics, 7) + 1
        names = [f"u{k + 1}" for k in range(len(p["M"]) - 1)]
        wanted = np.array([coefficients_of(case[u], n_harmonics)[:kept] for u in names]).T
        assert difference(found.coefficients[0][:kept, :-1], wanted) < bound
        # The support moves as it was told, and the result says how.
        base = base_coefficients(p, n_harmonics)
        assert np.allclose(found.coefficients[0][:, -1], base, rtol=0.0, atol=1e-13)
        with h5py.File(tmp_path / "case.h5") as file:
            assert np.allclose(file["base/coefficients"][0], base, rtol=0.0, atol=1e-13)
        if name == "cubic_friction":
            # Of the relative motion: the reference has the work of dof 1, the support takes a part.
            u = coefficients_of(case["u1"], 7) - base_coefficients(p, 7)
            f = coefficients_of(case["force_2"], 7)
            work = sum(np.pi * n * (f[2 * n - 1] * u[2 * n] - f[2 * n] * u[2 * n - 1])
                       for n in range(1, 8))
            assert abs(found.dissipation[0, 0] / work - 1.0) < 10.0 * bound


def frame(n_harmonics=5, **base):
    """Two masses on two supports, dofs 3 and 4 (turned round), with friction at the first."""
    stiffness = np.array([[2.6, -0.9, -1.0, 0.7], [-0.9, 1.9, -0.4, 0.6],
                          [-1.0, -0.4, 1.4, 0.0], [0.7, 0.6, 0.0, 1.3]])
    mass = np.diag([1.0, 0.7, 0.2, 0.1])
    return {
        "case": {"title": "on two supports", "analysis": "point"},
        "model": {"n_dof": 4, "mass": mass, "damping": 0.04 * stiffness,
                  "stiffness": stiffness},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 0], "side_2": [3, 0, 0],
                    "mu": 0.4, "normal_load": 0.8, "tangential_stiffness": 1.0},
        "base": {"n_terms": 2, "dof": [3, -4], "harmonic": [1, 2], "amplitude": [0.5, 0.1],
                 "phase": [20.0, -50.0], **base},
        "harmonics": {"n_harmonics": n_harmonics},
        "sweep": {"start": 1.3}, "solver": {"tolerance": TOLERANCE},
    }


def test_a_velocity_and_an_acceleration_are_a_displacement(tmp_path):
    plain = run_case(tmp_path, frame())
    for k, motion in enumerate(("velocity", "acceleration"), 1):
        # u = a cos(w t + phi): the k-th derivative is a w**k cos(w t + phi + 90 k).
        speed = 1.3 * np.array([1.0, 2.0])
        other = run_case(tmp_path, frame(motion=motion,
                                         amplitude=list(np.array([0.5, 0.1]) * speed**k),
                                         phase=[20.0 + 90.0 * k, -50.0 + 90.0 * k]))
        assert difference(other.coefficients, plain.coefficients) < WITHIN


def test_frames_differ_by_what_the_base_carries(tmp_path):
    """R is 1 at the supports and at the dof that the pair joins to one of them."""
    relative = run_case(tmp_path, frame())
    absolute = run_case(tmp_path, frame(frame="absolute"))
    base = np.zeros(11)
    for n, amplitude, phase in ((1, 0.5, 20.0), (2, 0.1, -50.0)):
        base[2 * n - 1] = amplitude * np.cos(np.radians(phase))
        base[2 * n] = -amplitude * np.sin(np.radians(phase))
    moved = absolute.coefficients[0] - relative.coefficients[0]
    assert np.abs(moved - np.outer(base, [1.0, 0.0, 1.0, -1.0])).max() < 1e-12


def rigid(n_harmonics=5):
    """Three masses in a row, the last a support without mass: no force where all move alike."""
    k = np.array([[1.2, -1.2, 0.0], [-1.2, 2.7, -1.5], [0.0, -1.5, 1.5]])
    return {
        "case": {"title": "a row", "analysis": "point"},
        "model": {"n_dof": 3, "mass": np.diag([1.0, 0.8, 0.0]), "damping": 0.05 * k,
                  "stiffness": k},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 0], "side_2": [2, 0, 0],
                    "mu": 0.4, "normal_load": 0.5, "tangential_stiffness": 0.7},
        "base": {"n_terms": 1, "dof": 3, "amplitude": 0.4},
        "harmonics": {"n_harmonics": n_harmonics},
        "sweep": {"start": 0.8}, "solver": {"tolerance": TOLERANCE},
    }


def test_a_ground_that_moves_is_supports_that_move_alike(tmp_path):
    """Without a support the row stands on the ground."""
    check_on_ground(tmp_path, {})
    # Dampers of broken powers between the masses, and to what moves.
    check_on_ground(tmp_path, {"n_dampers": 2, "coefficient": [0.3, 0.2], "power": [2.0, 1.5]})


def check_on_ground(tmp_path, damper):
    on_support = {**rigid(), **({"damper": {**damper, "side_1": [1, 2], "side_2": [2, 3]}}
                                if damper else {})}
    on_ground = merged(rigid(), {"base": {"dof": None, "direction": [1.0, 1.0, 0.0]}})
    if damper:
        on_ground["damper"] = {**damper, "side_1": [1, 2], "side_2": [2, 0]}
    on_ground["model"]["stiffness"] = np.array([[1.2, -1.2, 0.0], [-1.2, 2.7, 0.0],
                                                [0.0, 0.0, 1.0]])
    on_ground["model"]["damping"] = 0.05 * np.array([[1.2, -1.2, 0.0], [-1.2, 2.7, 0.0],
                                                     [0.0, 0.0, 0.0]])
    ground = run_case(tmp_path, on_ground)
    absolute = run_case(tmp_path, merged(on_support, {"base": {"frame": "absolute"}}))
    base = np.zeros(11)
    base[1] = 0.4
    moved = absolute.coefficients[0][:, :2] - base[:, None]
    assert difference(ground.coefficients[0][:, :2], moved) < WITHIN
    shaken = run_case(tmp_path, merged(on_ground, {"base": {
        "motion": "acceleration", "amplitude": 0.4 * 0.8**2, "phase": 180.0}}))
    assert difference(shaken.coefficients, ground.coefficients) < WITHIN


def test_a_base_is_the_load_that_it_makes(tmp_path):
    """-M R u_b'' of the ground as terms of power 2; a constant acceleration as a static load."""
    plain = {key: keys for key, keys in frame().items() if key != "base"}
    plain["contact"]["side_2"] = [2, 0, 0]
    # Without its supports it stands on springs.
    plain["model"]["stiffness"] = plain["model"]["stiffness"] + np.diag([0.5, 0.0, 0.0, 0.0])
    direction = np.array([1.0, 0.5, 0.0, -1.0])
    force = np.diag(plain["model"]["mass"]) * direction * 0.3
    one = run_case(tmp_path, {**plain, "base": {
        "n_terms": 1, "direction": direction, "amplitude": 0.3, "harmonic": 2, "phase": 40.0}})
    two = run_case(tmp_path, {**plain, "load": {
        "n_terms": 4, "term_dof": [1, 2, 3, 4], "term_harmonic": 2, "term_amplitude": force,
        "term_phase": 40.0, "term_power": 2}})
    assert difference(two.coefficients, one.coefficients) < WITHIN
    one = run_case(tmp_path, {**plain, "load": {"cosine": [1.0, 0.0, 0.0, 0.0]}, "base": {
        "n_terms": 1, "direction": direction, "amplitude": 0.3, "harmonic": 0,
        "motion": "acceleration"}})
    two = run_case(tmp_path, {**plain, "load": {"cosine": [1.0, 0.0, 0.0, 0.0],
                                                "static": -force}})
    assert difference(two.coefficients, one.coefficients) < WITHIN


def test_integration_in_time_is_the_same(tmp_path):
    case = frame(n_harmonics=15)
    balance = run_case(tmp_path, case)
    marched = run_case(tmp_path, merged(case, {"case": {"analysis": "time"}}))
    # The tolerance of an integration and the truncation at H = 15.
    assert difference(marched.coefficients, balance.coefficients) < 2e-3


@pytest.mark.parametrize("motion", ["displacement", "velocity", "acceleration"])
def test_a_branch_has_the_points_of_a_sweep(tmp_path, motion):
    """Arc length takes dR/domega, which has that of the load."""
    case = merged(frame(motion=motion), {
        "case": {"analysis": "frf"}, "sweep": {"start": 0.9, "end": 1.6, "n_points": 15}})
    sweep = run_case(tmp_path, case)
    branch = run_case(tmp_path, merged(case, {"sweep": {"continuation": "arclength"}}))
    assert sweep.converged.all() and branch.converged.all()
    assert abs(branch.omega[-1] - 1.6) < 1e-9
    at = np.argmin(abs(branch.omega - 1.2))
    one = run_case(tmp_path, merged(case, {"case": {"analysis": "point"}, "sweep": {
        "start": float(branch.omega[at]), "end": None, "n_points": None}}))
    assert difference(branch.coefficients[at], one.coefficients[0]) < WITHIN


def test_the_vibration_scales_with_the_load(tmp_path):
    """By the key, along a sweep over it, and by its derivative."""
    case = merged(frame(frame="absolute"), {"load": {"harmonic_scale": 1.5}})
    scaled = run_case(tmp_path, case)
    more = run_case(tmp_path, frame(frame="absolute", amplitude=[0.75, 0.15]))
    assert difference(scaled.coefficients, more.coefficients) < WITHIN
    swept = run_case(tmp_path, merged(frame(frame="absolute"), {
        "case": {"analysis": "frf"}, "sweep": {
            "start": None, "frequency": 1.3, "parameter": "load%harmonic_scale",
            "values": [1.0, 1.5]}}))
    assert difference(swept.coefficients[1], scaled.coefficients[0]) < WITHIN
    run_case(tmp_path, merged(case, {"sensitivity": {"parameters": "load%harmonic_scale"}}))
    with h5py.File(tmp_path / "case.h5") as file:
        found = file["sensitivity/largest/load_harmonic_scale"][0].ravel()
    ends = [run_case(tmp_path, merged(case, {"load": {"harmonic_scale": 1.5 + step}})).amplitude[0]
            for step in (1e-5, -1e-5)]
    assert np.allclose(found, (ends[0] - ends[1]) / 2e-5, rtol=1e-5, atol=1e-7)


def test_a_model_file_says_what_moves(tmp_path):
    case = frame()
    by_keys = run_case(tmp_path, case)
    m, c = case["model"], case["contact"]
    pairs = fw.ContactPairs([[1, 0, 0]], [[3, 0, 0]], mu=c["mu"], normal_load=c["normal_load"],
                            tangential_stiffness=c["tangential_stiffness"], law="penalty")
    model = fw.Model(m["mass"], m["damping"], m["stiffness"], contact=pairs, base_dof=[3, -4])
    model.save(tmp_path / "m.h5")
    rest = {key: keys for key, keys in case.items() if key not in ("model", "contact")}
    rest["base"] = {key: value for key, value in rest["base"].items() if key != "dof"}
    of_file = run_case(tmp_path, {**rest, "model": {"source": "hdf5", "file": "m.h5"}})
    assert np.array_equal(of_file.coefficients, by_keys.coefficients)
    in_memory = fw.run(fw.Case(fw.Model.from_hdf5(tmp_path / "m.h5"), **rest))
    assert np.array_equal(in_memory.coefficients, by_keys.coefficients)


def test_dampers_see_the_motion_beside_the_base(tmp_path):
    """One of power 1 between a support and what the pair joins to it is viscous damping there."""
    viscous = frame()
    damping = np.array(viscous["model"]["damping"])
    damping[np.ix_([0, 2], [0, 2])] += 0.3 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    viscous["model"]["damping"] = damping
    one = run_case(tmp_path, viscous)
    damper = {"n_dampers": 1, "side_1": 1, "side_2": 3, "coefficient": 0.3}
    two = run_case(tmp_path, {**frame(), "damper": damper})
    assert difference(two.coefficients, one.coefficients) < WITHIN


@pytest.mark.parametrize("frame_of", ["relative", "absolute"])
def test_stress_is_that_of_the_whole_motion(tmp_path, frame_of):
    """S u of all dofs, the supports among them, whatever frame is observed."""
    random = np.random.default_rng(5)
    rows = random.normal(size=(2, 6, 4))
    case = frame(harmonic=[1, 0], frame=frame_of)
    case["load"] = {"static": [0.1, 0.2, 0.0, 0.0]}
    observed = run_case(tmp_path, merged(case, {"base": {"frame": "absolute"}}))
    with h5py.File(tmp_path / "m.h5", "w") as file:
        file.attrs.update(format="fretwear-model", format_version=1)
        for name in ("mass", "stiffness", "damping"):
            file[name] = case["model"][name]
        file["load/static"] = case["load"]["static"]
        file["stress/matrix"] = rows
    filed = {**case, "model": {"source": "hdf5", "file": "m.h5"}, "load": {},
             "stress": {"output": "tensor"}}
    run(tmp_path, filed)
    with h5py.File(tmp_path / "case.h5") as file:
        found = file["stress/coefficients"][0]
        amplitude = file["stress/amplitude"][0]
    u = observed.coefficients[0]
    wanted = np.einsum("pcn,hn->hpc", rows, u)
    assert np.abs(found - wanted).max() < WITHIN * np.abs(wanted).max()
    assert (amplitude > 0.01).all()


def test_a_given_amplitude_on_a_base(tmp_path):
    """The motion of the base that it takes, and a run with that motion."""
    case = merged(frame(), {"control": {"amplitude": 0.4, "of": "largest"},
                            "output": {"observe": 2}})
    run(tmp_path, case)
    with h5py.File(tmp_path / "case.h5") as file:
        scale, base = file["load/scale"][0], file["base/coefficients"][0]
    assert np.ravel(scale)[0] > 0.0
    free = {key: keys for key, keys in case.items() if key != "control"}
    one = run_case(tmp_path, merged(free, {"load": {"harmonic_scale": float(np.ravel(scale)[0])}}))
    assert abs(one.amplitude[0, 0] - 0.4) < 1e-7
    with h5py.File(tmp_path / "case.h5") as file:
        assert np.allclose(file["base/coefficients"][0], base, rtol=1e-12, atol=1e-14)


def rotor(random, n):
    """Matrices of every kind, none of them symmetric that need not be."""
    def root():
        return random.normal(size=(n, n))

    skew, full, spread = root(), root(), root()
    return {"coriolis": 0.3 * (skew - skew.T), "circulatory": 0.05 * root(),
            "stiffness_rotation": 0.05 * spread @ spread.T,
            "structural_damping": 0.05 * full @ full.T,
            "stiffness_unsymmetric": 0.1 * root(), "damping_unsymmetric": 0.02 * root()}


def write_matrices(path, matrices):
    with h5py.File(path, "w") as file:
        file.attrs.update(format="fretwear-model", format_version=1)
        for name, matrix in matrices.items():
            file[name] = matrix


def dynamic_stiffness(m, speed, loss, s):
    """Of all dofs at a frequency s of a harmonic, with the speed that goes with it."""
    k = m["stiffness"] + speed**2 * m["stiffness_rotation"]
    d = m["structural_damping"] + loss * k if s > 0.0 else 0.0 * k
    c = m["damping"] + m["damping_unsymmetric"] + speed * m["coriolis"]
    return k + m["stiffness_unsymmetric"] + speed * m["circulatory"] - s**2 * m["mass"] \
        + 1j * s * c + 1j * d


@pytest.mark.parametrize("order", [None, 1.5])
@pytest.mark.parametrize("motion", ["displacement", "velocity", "acceleration"])
def test_supports_of_a_rotor_move_as_its_equations_say(tmp_path, motion, order):
    """Coriolis, circulatory, unsymmetric and hysteretic parts, at a speed or along an order."""
    random = np.random.default_rng(11)
    of_frame = frame()["model"]
    m = {name: np.array(of_frame[name]) for name in ("mass", "damping", "stiffness")}
    m.update(rotor(random, 4))
    write_matrices(tmp_path / "m.h5", m)
    loss, speed, omegas = 0.07, 0.6, [0.7, 1.3, 1.9]
    constant = motion == "displacement" and order is None
    terms = [(1, 0.5, 20.0), (2, 0.1, -50.0), *([(0, 0.3, 0.0)] if constant else [])]
    found = run_case(tmp_path, {
        "case": {"title": "a rotor on two supports", "analysis": "frf"},
        "model": {"source": "hdf5", "file": "m.h5", "loss_factor": loss,
                  **({} if order else {"rotation_speed": speed})},
        "base": {"n_terms": len(terms), "dof": [3, -4], "harmonic": [t[0] for t in terms],
                 "amplitude": [t[1] for t in terms], "phase": [t[2] for t in terms],
                 "motion": motion, "frame": "absolute"},
        "harmonics": {"n_harmonics": 2}, "output": {"observe": [f"u{k + 1}" for k in range(4)]},
        "sweep": {"values": omegas, **({"speed_order": order} if order else {})},
        "solver": {"tolerance": TOLERANCE}})
    power = ("displacement", "velocity", "acceleration").index(motion)
    for omega, coefficients in zip(omegas, found.coefficients, strict=True):
        for n, amplitude, phase in terms:
            base = amplitude * np.exp(1j * np.radians(phase))
            base = base / (1j * n * omega)**power if n else base
            z = dynamic_stiffness(m, omega / order if order else speed, loss, n * omega)
            u = np.array([0.0, 0.0, 1.0, -1.0]) * base
            u[:2] = -np.linalg.solve(z[:2, :2], z[:2, 2:] @ u[2:])
            has = coefficients[2 * n - 1] - 1j * coefficients[2 * n] if n else coefficients[0]
            assert np.abs(has - u).max() < ROUND_OFF * np.abs(u).max()


def test_a_ground_that_moves_under_a_rotor_turns_with_it(tmp_path):
    """-M R u_b'' - Omega G R u_b': forces of inertia are those of the whole motion."""
    random = np.random.default_rng(12)
    of_frame = frame()["model"]
    m = {name: np.array(of_frame[name]) + 0.3 * np.eye(4)
         for name in ("mass", "damping", "stiffness")}
    m.update(rotor(random, 4))
    write_matrices(tmp_path / "m.h5", m)
    loss, direction = 0.07, np.array([1.0, 0.4, -0.2, 0.7])
    for order, speed in ((None, 0.6), (1.5, None)):
        omegas = [0.7, 1.3]
        found = run_case(tmp_path, {
            "case": {"title": "a rotor on a ground", "analysis": "frf"},
            "model": {"source": "hdf5", "file": "m.h5", "loss_factor": loss,
                      **({} if order else {"rotation_speed": speed})},
            "base": {"n_terms": 2, "direction": direction, "harmonic": [1, 2],
                     "amplitude": [0.5, 0.1], "phase": [20.0, -50.0]},
            "harmonics": {"n_harmonics": 2}, "output": {"observe": [f"u{k + 1}" for k in range(4)]},
            "sweep": {"values": omegas, **({"speed_order": order} if order else {})},
            "solver": {"tolerance": TOLERANCE}})
        for omega, coefficients in zip(omegas, found.coefficients, strict=True):
            for n, amplitude, phase in ((1, 0.5, 20.0), (2, 0.1, -50.0)):
                s, turns = n * omega, omega / order if order else speed
                base = amplitude * np.exp(1j * np.radians(phase))
                inertia = -s**2 * m["mass"] + 1j * s * turns * m["coriolis"]
                y = -np.linalg.solve(dynamic_stiffness(m, turns, loss, s),
                                     inertia @ direction * base)
                has = coefficients[2 * n - 1] - 1j * coefficients[2 * n]
                assert np.abs(has - y).max() < ROUND_OFF * np.abs(y).max()


def test_a_speed_that_follows_is_that_speed_at_each_point(tmp_path):
    """With friction; along a branch too, whose steps take dR/domega."""
    of_frame = frame()
    m = {name: np.array(of_frame["model"][name]) for name in ("mass", "damping", "stiffness")}
    m.update(rotor(np.random.default_rng(13), 4))
    write_matrices(tmp_path / "m.h5", m)
    case = {key: keys for key, keys in of_frame.items() if key != "model"}
    case = merged(case, {"case": {"analysis": "frf"}, "model": {
        "source": "hdf5", "file": "m.h5", "loss_factor": 0.05}})
    swept = run_case(tmp_path, merged(case, {"sweep": {
        "start": 0.9, "end": 1.5, "n_points": 4, "speed_order": 2.0}}))
    for omega, coefficients in zip(swept.omega, swept.coefficients, strict=True):
        one = run_case(tmp_path, merged(case, {
            "case": {"analysis": "point"}, "sweep": {"start": float(omega)},
            "model": {"rotation_speed": float(omega) / 2.0}}))
        assert difference(coefficients, one.coefficients[0]) < WITHIN
    branch = run_case(tmp_path, merged(case, {"sweep": {
        "start": 0.9, "end": 1.5, "n_points": 8, "speed_order": 2.0,
        "continuation": "arclength"}}))
    at = len(branch.omega) // 2
    omega = float(branch.omega[at])
    one = run_case(tmp_path, merged(case, {
        "case": {"analysis": "point"}, "sweep": {"start": omega},
        "model": {"rotation_speed": omega / 2.0}}))
    assert difference(branch.coefficients[at], one.coefficients[0]) < WITHIN


@pytest.mark.parametrize(("groups", "message"), [
    ({"sweep": {"speed_order": 2.0}, "base": {"harmonic": [0, 1]}}, "has a 0, whose force changes"),
    ({"base": {"dof": None, "direction": [1.0] * 4, "harmonic": [0, 1],
               "motion": "acceleration"}, "model": {"rotation_speed": 1.0}}, "grows for ever"),
    ({"base": {"dof": None, "direction": [1.0] * 4}, "model": {"rotation_speed": 1.0},
      "sensitivity": {"parameters": "model%rotation_speed"}}, "change these")])
def test_what_a_rotor_on_a_base_refuses(tmp_path, groups, message):
    of_frame = frame()
    m = {name: np.array(of_frame["model"][name]) for name in ("mass", "damping", "stiffness")}
    write_matrices(tmp_path / "m.h5", m | rotor(np.random.default_rng(13), 4))
    case = {key: keys for key, keys in of_frame.items() if key not in ("model", "contact")}
    case = merged({**case, "model": {"source": "hdf5", "file": "m.h5"}}, groups)
    done = run(tmp_path, case, status=(3,))
    assert message in " ".join(done.stderr.split())


REFUSED = [
    ({"polynomial": {"n_terms": 1, "factors": [1, 1, 1, 1, 0, 0, 0, 0], "coefficient": 0.1}},
     "sees the motion of &base dof itself"),
    ({"damper": {"n_dampers": 1, "side_1": 3, "side_2": -4, "coefficient": 0.1}},
     "joins two supports of &base dof"),
    ({"damper": {"n_dampers": 1, "side_1": 3, "side_2": 0, "coefficient": 0.1}},
     "sees the motion of &base dof itself"),
    ({"base": {"dof": None}}, "dof is missing"),
    ({"base": {"direction": [1.0, 0.0, 0.0, 0.0]}}, "must be one of both"),
    ({"base": {"n_terms": None}}, "n_terms is missing"),
    ({"base": {"dof": [3, -3]}}, "has dof 3 twice"),
    ({"base": {"dof": [3, 5]}}, "dof"),
    ({"base": {"motion": "velocity", "harmonic": [0, 1]}}, "a constant velocity leads away"),
    ({"base": {"motion": "acceleration", "harmonic": [0, 1]}}, "a constant acceleration leads"),
    ({"base": {"motion": "velocity"}, "sweep": {"start": 0.0}}, "start = 0"),
    ({"base": {"dof": None, "direction": [0.0] * 4}}, "is 0 for all dofs"),
    ({"base": {"dof": None, "direction": [1.0] * 4, "frame": "absolute"}}, "goes with dof"),
    ({"base": {"harmonic": [1, 9]}}, "acts in harmonic 9"),
    ({"load": {"cosine": [0.0, 0.0, 1.0, 0.0]}}, "has a load"),
    ({"contact": {"side_1": [3, 0, 0], "side_2": [4, 0, 0]}}, "pair 1 joins two supports"),
    ({"contact": {"side_2": 0}, "base": {"dof": [1, 3]}}, "sees the motion of &base dof itself"),
    ({"spring": {"n_springs": 1, "side_1": 1, "coefficient": 0.3}}, "sees the motion of &base"),
    ({"harmonics": {"parity": "odd"}}, "parity"),
    ({"sensitivity": {"parameters": "model%rayleigh_mass"}, "model": {"rayleigh_mass": 0.01}},
     "change these"),
]


@pytest.mark.parametrize(("change", "told"), REFUSED)
def test_what_does_not_go_is_refused(tmp_path, change, told):
    assert told in run(tmp_path, merged(frame(), change), status=3).stderr


def table(frequency=(0.5, 1.0, 1.5), scale=(1.0, 0.4, 2.0), **sweep):
    """m, c, k = 1, 0.05, 1 under 0.4 t(omega) cos(omega t)."""
    return {
        "case": {"analysis": "frf"},
        "model": {"n_dof": 1, "mass": 1.0, "damping": 0.05, "stiffness": 1.0},
        "load": {"cosine": 0.4, "n_table": len(frequency), "table_frequency": list(frequency),
                 "table_scale": list(scale)},
        "harmonics": {"n_harmonics": 1},
        "sweep": {"start": 0.5, "end": 1.5, "n_points": 21, **sweep},
        "solver": {"tolerance": TOLERANCE},
    }


def closed_form(omega):
    load = 0.4 * np.interp(omega, [0.5, 1.0, 1.5], [1.0, 0.4, 2.0])
    return load / (1.0 - omega**2 + 0.05j * omega)


@pytest.mark.parametrize("continuation", ["natural", "arclength"])
def test_a_table_scales_the_load(tmp_path, continuation):
    found = run_case(tmp_path, table(continuation=continuation))
    wanted = closed_form(found.omega)
    u = found.coefficients[:, 1, 0] - 1j * found.coefficients[:, 2, 0]
    assert np.abs(u - wanted).max() < ROUND_OFF * np.abs(wanted).max()
    # Of the reference of loads, at 0.8 rad/s.
    case = table()
    case |= {"case": {"analysis": "point"}, "sweep": {"start": 0.8}}
    one = run_case(tmp_path, case)
    wanted = [0.702439024390244, 0.07804878048780493]
    assert np.abs(one.coefficients[0, 1:, 0] - wanted).max() < 1e-12


@pytest.mark.parametrize("ends", [(0.5, 1.5), (1.5, 0.5)])
@pytest.mark.parametrize(("control", "spring"), [(False, True), (True, True), (True, False)])
def test_a_branch_has_a_row_at_every_point_of_a_table(tmp_path, ends, control, spring):
    """A corner of the response lies between no two rows, whichever way the curve goes."""
    points = (0.5, 0.71, 0.93, 1.0, 1.5)
    case = table(points, (1.0, 0.4, 1.1, 0.6, 2.0), start=ends[0], end=ends[1],
                 continuation="arclength", n_points=4)
    # What is linear is no curve to be followed, unless its amplitude is given.
    if spring:
        case["spring"] = {"n_springs": 1, "side_1": 1, "coefficient": 5e-4, "power": 3}
    if control:
        case["control"] = {"amplitude": 0.5}
    found = run_case(tmp_path, case)
    assert found.converged.all()
    for point in points:
        assert np.abs(found.omega - point).min() < 1e-12
    # Once each, in the order of the sweep.
    assert (np.diff(found.omega) * (ends[1] - ends[0]) > 0.0).all()


def test_a_table_is_one_for_all_loads(tmp_path):
    """Terms of other harmonics and powers, and a base, at one frequency: as the scale."""
    case = merged(frame(), {
        "load": {"cosine": [0.3, 0.1, 0.0, 0.0], "n_terms": 1, "term_dof": 2, "term_harmonic": 3,
                 "term_amplitude": 0.2, "term_power": 2, "static": [0.1, 0.0, 0.0, 0.0]}})
    scaled = run_case(tmp_path, merged(case, {"load": {"harmonic_scale": 0.7}}))
    by_table = run_case(tmp_path, merged(case, {"load": {
        "n_table": 3, "table_frequency": [1.0, 1.2, 1.4], "table_scale": [2.0, 0.8, 0.6]}}))
    assert difference(by_table.coefficients, scaled.coefficients) < WITHIN


def test_a_table_of_a_model_file(tmp_path):
    case = table()
    by_keys = run_case(tmp_path, case)
    points = np.array([case["load"]["table_frequency"], case["load"]["table_scale"]]).T
    model = fw.Model([[1.0]], [[0.05]], [[1.0]], cosine=[0.4], load_table=points)
    model.save(tmp_path / "m.h5")
    rest = {key: keys for key, keys in case.items() if key not in ("model", "load")}
    of_file = run_case(tmp_path, {**rest, "model": {"source": "hdf5", "file": "m.h5"}})
    assert np.array_equal(of_file.coefficients, by_keys.coefficients)


@pytest.mark.parametrize(("change", "told"), [
    ({"sweep": {"end": 1.6}}, "must hold all of it"),
    ({"load": {"table_frequency": [0.5, 0.5, 1.5]}}, "does not rise at point 2"),
    ({"load": {"n_table": 1, "table_frequency": 0.5, "table_scale": 1.0}}, "2 points at least"),
    ({"load": {"n_table": None}}, "n_table is missing"),
    ({"load": {"table_scale": None}}, "table_scale is missing"),
])
def test_a_table_that_does_not_serve_is_refused(tmp_path, change, told):
    assert told in run(tmp_path, merged(table(), change), status=3).stderr
