"""Derivatives of a nonlinear mode by parameters of its case: against differences of runs."""
import sys

import numpy as np
import pytest
from cases import merged, run
from mode_cases import REFERENCES, follow, mode_groups, read_mode
from project import ROOT
from test_mode_judge import SEVERAL

sys.path.insert(0, str(ROOT / "test" / "cyclic"))
from annulus import random_case
from cyclic_cases import model_groups

#: Relative step, where truncation (its square) and solutions to 1e-12 meet.
STEP = 3e-5
#: Of a derivative times the parameter, over the quantity.
CLOSE = 3e-7
#: Springs beside the pairs, and damping by the matrices.
RICH = merged(SEVERAL, {
    "spring": {"n_springs": 1, "side_1": 2, "side_2": 0, "coefficient": 0.3, "power": 3},
    "contact": {"gap": [0.0, -0.1]},
    "model": {"rayleigh_mass": 0.01, "rayleigh_stiffness": 0.005}})


def numbers(value):
    return np.atleast_1d(np.asarray(value, float))


def names_of(name):
    group, key = name.split("%")
    return group, key


def quantities(found, row):
    first = found["mode/first_harmonic"][row]
    return {"mode_omega": found["omega"][row],
            "mode_damping_ratio": found["mode/damping_ratio"][row],
            "first_harmonic": first,
            "dissipation": found["contact/dissipation"][row].sum()}


def check(folder, groups, parameters, start, end, n_harmonics, **mode):
    """Each derivative at the last point, all elements of a parameter one by one."""
    options = {"n_points": 2, "changes": {
        "sensitivity": {"parameters": list(parameters), "deviation": [0.1] * len(parameters)},
        "solver": {"tolerance": 1e-12}}, **mode}
    found = follow(folder, groups, start, end, n_harmonics, **options)
    base, variance = quantities(found, -1), 0.0
    # Something slips or opens.
    assert found["contact/fraction"][-1, :, 0].min() < 0.99
    options["changes"] = {"solver": {"tolerance": 1e-12}}
    for name in parameters:
        group, key = names_of(name)
        value = numbers(groups.get(group, {}).get(key, 1.0))
        share = 0.0
        for element in range(len(value)):
            if value[element] == 0.0:
                continue
            sides = []
            for sign in (1, -1):
                changed = value.copy()
                changed[element] *= 1 + sign * STEP
                case = merged(groups, {group: {key: list(changed)}})
                sides.append(quantities(follow(folder, case, start, end, n_harmonics, **options),
                                        -1))
            for quantity, expected in base.items():
                difference = (sides[0][quantity] - sides[1][quantity]) / (2 * STEP)
                derivative = found[f"sensitivity/{quantity}/{name.replace('%', '_')}"][-1]
                derivative = np.asarray(derivative).reshape((*np.shape(expected), len(value)))
                scaled = derivative[..., element] * value[element]
                assert scaled == pytest.approx(difference, rel=1e-5, abs=CLOSE * np.max(
                    np.abs(expected))), (name, element, quantity)
                if quantity == "mode_omega":
                    share += scaled
        variance += (0.1 * share) ** 2
    assert found["sensitivity/deviation/mode_omega"][-1] == pytest.approx(np.sqrt(variance),
                                                                          rel=1e-4)
    assert found["sensitivity/value/mode_omega"] == pytest.approx(found["omega"])


def test_elastic(tmp_path):
    check(tmp_path, RICH, ["contact%mu", "contact%normal_load", "contact%gap",
                           "contact%tangential_stiffness", "contact%normal_stiffness",
                           "spring%coefficient", "load%static_scale", "model%rayleigh_mass",
                           "model%rayleigh_stiffness"], 2.0, 2.5, 3)


@pytest.mark.parametrize("name", ["rigid_twin", "coulomb"])
def test_rigid(tmp_path, name):
    check(tmp_path, REFERENCES[name]["groups"], ["contact%mu", "contact%normal_load"], 0.9, 1.0, 3)


@pytest.mark.parametrize("control", ["observed", "modal"])
def test_many_unknowns(tmp_path, control):
    """More than LU is taken for: solutions by GMRES."""
    check(tmp_path, REFERENCES["normal"]["groups"], ["contact%mu", "contact%tangential_stiffness"],
          1.0, 1.2, 15, control=control)


def test_wave(tmp_path):
    case = random_case(np.random.default_rng(71), law="penalty", n_sectors=6, engine_order=-2,
                       n_pairs=1)
    case["load"]["cosine"] = [0.0] * len(case["load"]["cosine"])
    case["load"]["sine"] = [0.0] * len(case["load"]["sine"])
    groups = merged(model_groups(case), {"load": {"static_scale": 1.0}})
    check(tmp_path, groups, ["contact%mu", "contact%gap", "contact%normal_stiffness",
                             "load%static_scale"], 0.1, 0.2, 3)


#: Derivatives of omega and zeta of the chain at H = 3, by amplitude, from a balance with exact
#: switches that is solved in complex form elsewhere; 1e-9.
REFERENCE = {
    0.7: {"contact%mu": (0.32032774023697524, -0.2462569406007499),
          "contact%normal_load": (0.12813109609479012, -0.09850277624029997),
          "contact%tangential_stiffness": (0.01814303047563714, 0.048234540367035623),
          "spring%coefficient": (-0.005190128364778224, 0.012368352370403592)},
    1.5: {"contact%mu": (0.23514372463245828, 0.024586183915374028),
          "contact%normal_load": (0.09405748985298332, 0.009834473566149608),
          "contact%tangential_stiffness": (-0.01454609957400805, 0.017481323722319184),
          "spring%coefficient": (-0.0015207884317946828, -0.0006958852392004835)},
    4.0: {"contact%mu": (0.058459583881311165, 0.054570630426353704),
          "contact%normal_load": (0.023383833552524467, 0.02182825217054149),
          "contact%tangential_stiffness": (-0.004636646604185705, 0.002514213529301929),
          "spring%coefficient": (0.003295129640589552, -0.0015054574748017595)}}


@pytest.mark.parametrize("amplitude", REFERENCE)
def test_references(tmp_path, amplitude):
    groups = REFERENCES["chain"]["groups"]
    # The spring between the masses that the derivative is taken by, taken off the matrix.
    stiffness = np.reshape(groups["model"]["stiffness"], (2, 2)) - 0.1 * np.array([[1, -1],
                                                                                  [-1, 1]])
    groups = merged(groups, {
        "model": {"stiffness": list(stiffness.ravel())},
        "spring": {"n_springs": 1, "side_1": 1, "side_2": 2, "coefficient": 0.1, "power": 1},
        "sensitivity": {"parameters": list(REFERENCE[amplitude])}})
    found = follow(tmp_path, groups, amplitude, 1.001 * amplitude, 3)
    for name, (omega, zeta) in REFERENCE[amplitude].items():
        place = name.replace("%", "_")
        assert found[f"sensitivity/mode_omega/{place}"][0] == pytest.approx(omega, abs=2e-9)
        assert found[f"sensitivity/mode_damping_ratio/{place}"][0] == pytest.approx(zeta, abs=2e-9)


def test_below_the_onset_friction_does_not_matter(tmp_path):
    groups = REFERENCES["jenkins"]["groups"]
    found = follow(tmp_path, groups, 0.1, 0.4, 3, changes={
        "sensitivity": {"parameters": ["contact%mu", "contact%tangential_stiffness"]}})
    assert np.abs(found["sensitivity/mode_omega/contact_mu"]).max() == 0.0
    # omega = sqrt(1 + k_t).
    assert found["sensitivity/mode_omega/contact_tangential_stiffness"] == pytest.approx(
        0.5 / np.sqrt(2.0), rel=1e-9)


@pytest.mark.parametrize(("changes", "words"), [
    ({"parameters": "load%harmonic_scale"}, "no vibratory load acts on a nonlinear mode"),
    ({"parameters": "contact%gap"}, "no pair has a normal dof")])
def test_refusals(tmp_path, changes, words):
    groups = merged(REFERENCES["jenkins"]["groups"], {"load": {"cosine": 1.0}})
    done = run(tmp_path, mode_groups(groups, 0.1, 1.0, 3, changes={"sensitivity": changes}),
               status=3)
    assert words in done.stderr
    assert read_mode
