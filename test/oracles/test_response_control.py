"""Responses of given amplitude: against an integration in time, against runs at the load that was
found, and against equations of a code of its own."""
import json
import re
import subprocess

import numpy as np
import pytest
from cases import merged, read, run, write_namelist
from control_family import controlled_case, judged, linear_amplitude
from limits import limit
from project import HAS_EXTENSION, PATIENT, PROGRAM, ROOT
from sensitivity_family import random_case

import fretwear as fw

REFERENCE = json.loads((ROOT / "test" / "reference" / "response_control.json").read_text())["cases"]
#: A balance of 31 harmonics leaves 1e-13 of these orbits; conditioning takes the rest.
ORBIT = 1e-11
#: Residuals of 1e-13, and the condition of the bordered matrix.
SAME = 1e-9
DUFFING = {
    "case": {"analysis": "frf"},
    "model": {"n_dof": 1, "mass": [1.0], "stiffness": [1.0], "damping": [0.05]},
    "spring": {"n_springs": 1, "side_1": 1, "coefficient": 0.5},
    "load": {"cosine": [1.0]}, "harmonics": {"n_harmonics": 31}, "sweep": {"values": [1.3]},
    "solver": {"tolerance": 1e-13}, "control": {"amplitude": [1.0]}}


def first(found, column=0):
    return np.hypot(found["coefficients"][:, 1, column], found["coefficients"][:, 2, column])


def test_loads_of_given_amplitudes(tmp_path):
    """Both sides of the fold, in any order of amplitudes."""
    cases = [REFERENCE[k] for k in (4, 0, 3, 1, 2)]
    wanted = [case["params"]["amplitude"] for case in cases]
    done = run(tmp_path, merged(DUFFING, {"control": {"amplitude": wanted}}))
    found = read(tmp_path / "case.h5")
    assert found["load/scale"] == pytest.approx([case["F"] for case in cases], rel=ORBIT)
    assert first(found) == pytest.approx(wanted, rel=ORBIT)
    assert np.array_equal(found["control/amplitude"], wanted)
    for case, row in zip(cases, found["coefficients"][:, :, 0]):
        exact = np.array([case["u1"]["x0"], *np.ravel(np.column_stack(
            [case["u1"]["xc"], case["u1"]["xs"]]))])
        assert np.abs(row[:len(exact)] - exact).max() < 1e-10
    assert "peak/omega" not in found
    assert not done.stdout or "load scale" in done.stdout


def test_single_valued_past_the_fold(tmp_path):
    """One harmonic in closed form, over frequencies at which a given load has three responses."""
    omega = np.linspace(0.6, 2.2, 33)
    amplitudes = [0.3, 1.0, 2.0]
    run(tmp_path, merged(DUFFING, {"harmonics": {"n_harmonics": 1}, "control": {
        "amplitude": amplitudes}, "sweep": {"values": None, "start": 0.6, "end": 2.2,
                                            "n_points": 33}}))
    found = read(tmp_path / "case.h5")
    assert np.allclose(found["omega"], np.tile(omega, 3))
    for k, a in enumerate(amplitudes):
        f = a * np.hypot(1.0 - omega**2 + 0.375 * a**2, 0.05 * omega)
        assert found["load/scale"][33 * k:33 * (k + 1)] == pytest.approx(f, rel=1e-9)
    assert np.median(found["iterations"]) <= 5


def test_branches_of_given_amplitudes(tmp_path):
    """By arc length: the closed form at every point, and steps that resolve the smallest load."""
    amplitudes = [0.3, 1.0, 2.0]
    run(tmp_path, merged(DUFFING, {
        "harmonics": {"n_harmonics": 1}, "control": {"amplitude": amplitudes}, "model": {
            "damping": [0.002]}, "solver": {"tolerance": 1e-12},
        "sweep": {"values": None, "start": 0.6, "end": 2.2, "n_points": 33,
                  "continuation": "arclength"}}))
    found = read(tmp_path / "case.h5")
    omega, a = found["omega"], found["control/amplitude"]
    assert found["converged"].all()
    assert not found["fold"].any()
    assert found["load/scale"] == pytest.approx(a * np.hypot(1.0 - omega**2 + 0.375 * a**2,
                                                             0.002 * omega), rel=1e-9)
    for one in amplitudes:
        own = a == one
        assert omega[own][[0, -1]] == pytest.approx([0.6, 2.2])
        assert own.sum() < 60
        resonance = np.sqrt(1.0 + 0.375 * one**2)
        assert found["load/scale"][own].min() < 1.2 * one * 0.002 * resonance
    # The direction of the branch: U = a conj(D)/|D| of the dynamic stiffness D.
    def cosine(w):
        d = 1.0 - w**2 + 0.375 * a**2
        return a * d / np.hypot(d, 0.002 * w)

    slope = (cosine(omega + 1e-6) - cosine(omega - 1e-6)) / 2e-6
    assert found["coefficients"][:, 1, 0] == pytest.approx(cosine(omega), abs=1e-7)
    assert (found["tangent/coefficients"][:, 1, 0] / found["tangent/omega"]
            == pytest.approx(slope, abs=1e-4 * np.abs(slope).max()))


def test_direction_of_a_branch_over_a_parameter(tmp_path):
    """Of given amplitude over the stiffness of the spring: the closed form's own slope."""
    run(tmp_path, merged(DUFFING, {
        "harmonics": {"n_harmonics": 1}, "sweep": {
            "values": None, "parameter": "spring%coefficient", "frequency": 1.1, "start": 0.2,
            "end": 1.0, "n_points": 9, "continuation": "arclength"}}))
    found = read(tmp_path / "case.h5")
    alpha = found["parameter"]

    def cosine(at):
        d = 1.0 - 1.1**2 + 0.75 * at
        return d / np.hypot(d, 0.05 * 1.1)

    slope = (cosine(alpha + 1e-6) - cosine(alpha - 1e-6)) / 2e-6
    assert found["coefficients"][:, 1, 0] == pytest.approx(cosine(alpha), abs=1e-7)
    assert (found["tangent/coefficients"][:, 1, 0] / found["tangent/parameter"]
            == pytest.approx(slope, abs=1e-4 * np.abs(slope).max()))
    assert "tangent/omega" not in found


def test_a_branch_through_folds_of_an_internal_resonance(tmp_path):
    """Where the third harmonic meets another mode a given amplitude has three loads: natural steps
    jump there. Their points are those of the branch, and of runs under the loads found."""
    groups = merged(DUFFING, {
        "model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 1.0], "damping": [0.01, 0.0, 0.0, 0.02],
                  "stiffness": [1.2, -0.2, -0.2, 10.6]},
        "load": {"cosine": [1.0, 0.0]}, "harmonics": {"n_harmonics": 5},
        "spring": {"side_1": 1, "side_2": 2}, "control": {"amplitude": [0.8]},
        "solver": {"tolerance": 1e-10}})
    run(tmp_path, merged(groups, {"sweep": {"values": None, "start": 0.9, "end": 1.5,
                                            "n_points": 61, "continuation": "arclength"}}))
    found = read(tmp_path / "case.h5")
    omega, folds = found["omega"], np.flatnonzero(found["fold"])
    assert len(folds) == 2
    assert found["bifurcation/omega"] == pytest.approx(omega[folds])
    assert omega[folds[0]] > omega[folds[1]]
    assert (np.diff(omega[:folds[0] + 1]) > 0.0).all()
    assert (np.diff(omega[folds[0]:folds[1] + 1]) < 0.0).all()
    assert first(found) == pytest.approx(np.full(len(omega), 0.8), rel=1e-8)
    outside = (omega < omega[folds[1]]) | (omega > omega[folds[0]])
    run(tmp_path, merged(groups, {"sweep": {"values": omega[outside].tolist()}}), name="own")
    alone = read(tmp_path / "own.h5")
    assert np.abs(alone["coefficients"] - found["coefficients"][outside]).max() < 1e-8
    assert alone["load/scale"] == pytest.approx(found["load/scale"][outside], rel=1e-8)
    # Loads of one frequency within the folds.
    at = 0.5 * (omega[folds[0]] + omega[folds[1]])
    crossed = np.flatnonzero(np.diff(np.sign(omega - at)))
    assert len(crossed) == 3
    assert np.ptp(found["load/scale"][crossed]) > 0.01 * found["load/scale"][crossed].max()


@pytest.mark.parametrize("seed", [8, 19, 24])
def test_random_branches_satisfy_their_equations(tmp_path, seed):
    words, error = judged(tmp_path, seed, along=1.2)
    assert words["off"] == 0, error
    assert words["judged"] > 20


@pytest.mark.skipif(not HAS_EXTENSION, reason="this build has no extension for Python")
def test_another_load_of_the_same_amplitude_is_told(tmp_path):
    """Where pairs slip under one load and stick under another: runs under both confirm it."""
    groups = controlled_case(69)
    a = linear_amplitude(groups) * groups["load"]["harmonic_scale"]
    groups = merged(groups, {"control": {"amplitude": [0.1 * a, a, 10.0 * a]}})
    write_namelist(tmp_path / "case.nml", groups)
    result = fw.run(tmp_path / "case.nml", in_memory=True)
    told = [text for text in result.remarks if "another load" in text]
    assert len(told) == 1
    assert "at 1 of 6 points" in told[0]
    omega, wanted, *loads = (float(x) for x in re.findall(r"\d\.\d+E[+-]\d+", told[0]))
    column = groups["control"]["observed"] - 1
    for load in loads:
        run(tmp_path, merged(groups, {"control": dict.fromkeys(groups["control"]), "load": {
            "harmonic_scale": load}, "sweep": {"values": [omega]}}), name="given")
        given = read(tmp_path / "given.h5")
        reached = (first(given, column)[0] if groups["control"]["of"] == "first_harmonic"
                   else given["amplitude"][0, column])
        assert reached == pytest.approx(wanted, rel=1e-8)
    # A linear structure has one.
    run(tmp_path, merged(DUFFING, {"spring": {"coefficient": 0.0}}), name="given")
    assert "remarks/name" not in read(tmp_path / "given.h5")


@pytest.mark.parametrize("of", ["first_harmonic", "largest"])
@pytest.mark.parametrize("seed", [0, 2, 3, 5, 7, 12, 14])
def test_the_amplitude_of_a_run_returns_its_load(tmp_path, seed, of):
    groups, _ = random_case(seed)
    run(tmp_path, groups, name="given")
    given = read(tmp_path / "given.h5")
    a = first(given)[0] if of == "first_harmonic" else given["amplitude"][0, 0]
    for linear in ("lu", "krylov"):
        run(tmp_path, merged(groups, {"control": {"amplitude": [float(a)], "of": of},
                                      "load": {"harmonic_scale": 1.0},
                                      "solver": {"linear": linear}}))
        found = read(tmp_path / "case.h5")
        assert found["load/scale"][0] == pytest.approx(groups["load"]["harmonic_scale"], rel=SAME)
        size = np.abs(given["coefficients"]).max()
        assert np.abs(found["coefficients"] - given["coefficients"]).max() < SAME * size


@pytest.mark.parametrize("seed", range(6))
def test_random_cases_satisfy_their_equations(tmp_path, seed):
    words, error = judged(tmp_path, seed)
    assert words["off"] == 0, error
    assert words["judged"] > 0


def test_loads_of_several_harmonics_are_scaled_alike(tmp_path):
    groups = merged(DUFFING, {"load": {"n_terms": 1, "term_dof": [1], "term_harmonic": [3],
                                       "term_amplitude": [0.4], "term_phase": [50.0]},
                              "harmonics": {"n_harmonics": 15}, "sweep": {"values": [2.0]}})
    run(tmp_path, groups)
    found = read(tmp_path / "case.h5")
    run(tmp_path, merged(groups, {"control": {"amplitude": None}, "load": {
        "harmonic_scale": float(found["load/scale"][0])}}), name="given")
    given = read(tmp_path / "given.h5")
    assert first(given) == pytest.approx(1.0, rel=SAME)
    assert np.abs(given["coefficients"] - found["coefficients"]).max() < SAME


def test_stability_of_controlled_points(tmp_path):
    """At amplitudes where the load falls as the response grows, a given load would not hold it."""
    run(tmp_path, merged(DUFFING, {"harmonics": {"n_harmonics": 7}, "sweep": {"stability": True},
                                   "control": {"amplitude": [0.3, 1.2, 2.2]}}))
    assert read(tmp_path / "case.h5")["floquet/stable"].tolist() == [1, 0, 1]


def test_a_place_at_rest_is_told(tmp_path):
    groups = merged(DUFFING, {
        "model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 1.0], "stiffness": [1.0, 0.0, 0.0, 2.0],
                  "damping": [0.05, 0.0, 0.0, 0.05]},
        "load": {"cosine": [1.0, 0.0]}, "harmonics": {"n_harmonics": 3},
        "output": {"observe": [2, 1]}})
    assert "u2 rests under the load (a node)" in told(tmp_path, groups)
    run(tmp_path, merged(groups, {"control": {"observed": 1}}))
    assert first(read(tmp_path / "case.h5"), 1)[0] == pytest.approx(1.0, rel=1e-10)


def test_a_node_is_told_where_round_off_moves_it(tmp_path):
    """Loads of opposite signs on both sides of the middle of three alike: it moved by 1e-17, and a
    load of 1e16 was found for it."""
    groups = merged(DUFFING, {
        "model": {"n_dof": 3, "mass": [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0], "damping": None,
                  "stiffness": [2.0, -1, 0, -1, 2.0, -1, 0, -1, 2.0], "rayleigh_mass": 0.04},
        "spring": {"side_1": 2}, "harmonics": {"n_harmonics": 5},
        "contact": {"n_pairs": 1, "law": "penalty", "side_1": [2, 0, 0], "mu": 1.0,
                    "tangential_stiffness": 1.0, "normal_load": 0.5},
        "load": {"cosine": [1.0, 0, -1.0]}, "sweep": {"values": [0.9, 1.1, 1.5]},
        "output": {"observe": [2]}})
    assert "u2 rests under the load (a node)" in told(tmp_path, groups)
    # Nearly a node: the load is large, and right.
    run(tmp_path, merged(groups, {"load": {"cosine": [1.0, 0, -1.0 + 1e-6]}}))
    assert first(read(tmp_path / "case.h5")) == pytest.approx(1.0, rel=1e-8)


def told(folder, groups):
    """What a run that fails says."""
    write_namelist(folder / "case.nml", groups)
    done = subprocess.run([PROGRAM, "case.nml"], cwd=folder, text=True, capture_output=True,
                          timeout=limit(60.0), check=False, env=PATIENT)
    assert done.returncode == 4
    return done.stdout + done.stderr


def test_a_static_part_above_the_amplitude_is_told(tmp_path):
    groups = merged(DUFFING, {"load": {"static": [1.0]}, "harmonics": {"n_harmonics": 5},
                              "control": {"amplitude": [0.2], "of": "largest"}})
    assert "static loads alone move u1 by" in told(tmp_path, groups)


def test_half_the_load_and_its_sign(tmp_path):
    """The scale is that of the loads as they are given, and never negative."""
    run(tmp_path, DUFFING)
    one = read(tmp_path / "case.h5")["load/scale"][0]
    for cosine in (2.0, -1.0):
        run(tmp_path, merged(DUFFING, {"load": {"cosine": [cosine], "harmonic_scale": 3.0}}))
        assert read(tmp_path / "case.h5")["load/scale"][0] == pytest.approx(one / abs(cosine),
                                                                            rel=1e-11)


@pytest.mark.parametrize(("changes", "words"), [
    ({"load": {"cosine": [0.0]}}, "without a vibratory load"),
    ({"load": {"harmonic_scale": 0.0}}, "load%harmonic_scale = 0"),
    ({"load": {"cosine": [0.0], "n_terms": 1, "term_dof": [1], "term_harmonic": [2],
               "term_amplitude": [0.4]}}, "use 'largest'"),
    ({"sweep": {"parameter": "load%harmonic_scale", "frequency": 1.0}}, "sweep frequencies"),
    ({"case": {"analysis": "wear"}, "sweep": {"values": None, "start": 1.0},
      "wear": {"coefficient": 1.0}}, "use 'frf' or 'point'"),
    ({"solver": {"kind": "powell"}}, "use 'newton'"),
    ({"harmonics": {"accuracy": 1e-4}}, "give n_harmonics"),
    ({"harmonics": {"method": "hdhb"}}, "use 'hbm'"),
    ({"control": {"amplitude": [0.0]}}, "above 0"),
    ({"control": {"observed": "tip"}}, "must be an observed quantity"),
    ({"control": {"amplitude": None, "of": "largest"}}, "given without amplitude"),
    ({"sensitivity": {"parameters": ["load%harmonic_scale"]}}, "sensitivity%parameters"),
])
def test_what_is_refused(tmp_path, changes, words):
    done = run(tmp_path, merged(DUFFING, changes), status=3)
    assert words in done.stderr


@pytest.mark.skipif(not HAS_EXTENSION, reason="this build has no extension for Python")
def test_python(tmp_path):
    model = fw.Model([[1.0]], [[0.05]], [[1.0]], cosine=[1.0],
                     springs=[fw.Spring(side_1=1, coefficient=0.5, power=3)])
    result = fw.frf(model, 1.2, 1.3, 2, control={"amplitude": [0.5, 2.0]},
                    harmonics={"n_harmonics": 31}, solver={"tolerance": 1e-13})
    assert result.load_scale[[1, 3]] == pytest.approx([REFERENCE[1]["F"], REFERENCE[4]["F"]],
                                                      rel=ORBIT)
    assert np.array_equal(result.control_amplitude, [0.5, 0.5, 2.0, 2.0])
    assert (tmp_path / "case.h5").exists() is False
