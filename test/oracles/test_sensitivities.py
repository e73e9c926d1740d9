"""Derivatives of the program: against another program, against differences of its own runs, what
they cost, and what is refused."""
from __future__ import annotations

import json
import re
import subprocess

import h5py
import numpy as np
import pytest
from cases import merged, run, write_namelist
from project import PATIENT, PROGRAM, ROOT

REFERENCE = json.loads((ROOT / "test" / "reference" / "sensitivities.json").read_text())["cases"]
#: The names of the reference for ours.
PARAMETERS = {"mu": "contact%mu", "tangential_stiffness": "contact%tangential_stiffness",
              "normal_stiffness": "contact%normal_stiffness", "gap": "contact%gap",
              "normal_load": "contact%normal_load", "force": "load%harmonic_scale",
              "static": "load%static_scale"}
QUANTITIES = {"first": "first_harmonic", "maximum": "largest", "dissipation": "dissipation"}
#: What the reference says of itself, of derivatives of order 1.
REFERENCE_TOLERANCE = 1e-9
#: Differences of runs of 1e-13 with steps of 1e-5, of fourth order.
DIFFERENCE_TOLERANCE = 1e-7


def datasets(path):
    """Every derivative of a result by (quantity, parameter)."""
    found = {}
    with h5py.File(path) as file:
        file["sensitivity"].visititems(
            lambda name, item: found.update({tuple(name.split("/")): item[()]})
            if isinstance(item, h5py.Dataset) else None)
    return found


def groups_of(case):
    """A case of the reference."""
    pair = case["pairs"][0]
    contact = {"n_pairs": 1, "law": "penalty", "side_1": pair["side_1"], "mu": pair["mu"],
               **{key: pair[key] for key in ("tangential_stiffness", "normal_stiffness", "gap",
                                             "normal_load") if key in pair}}
    load = {"cosine": case["cosine"]}
    if "static" in case:
        load["static"] = case["static"]
    return {"case": {"analysis": "point"},
            "model": {"n_dof": 2, **{key: np.ravel(case[key]).tolist()
                                     for key in ("mass", "stiffness", "damping")}},
            "contact": contact, "load": load, "solver": {"tolerance": 1e-12}}


@pytest.mark.parametrize(("case", "point"), [
    pytest.param(case, point, id=f"{case['model']['pairs'][0]['side_1']} {point['omega']}")
    for case in REFERENCE for point in case["points"]])
def test_another_program(case, point, tmp_path):
    wanted = {s["parameter"] for s in point["sensitivity"]["first"]} & set(PARAMETERS)
    groups = merged(groups_of(case["model"]), {
        "harmonics": {"n_harmonics": case["n_harmonics"]}, "sweep": {"start": point["omega"]},
        "sensitivity": {"parameters": [PARAMETERS[name] for name in sorted(wanted)]}})
    run(tmp_path, groups)
    found = datasets(tmp_path / "case.h5")
    compared = 0
    for name, rows in point["sensitivity"].items():
        quantity = QUANTITIES[name]
        for row in rows:
            if row["parameter"] not in wanted:
                continue
            values = found[quantity, PARAMETERS[row["parameter"]].replace("%", "_")][0]
            if quantity != "dissipation":
                values = values[case["observed_dof"] - 1]
            assert np.ravel(values)[0] == pytest.approx(row["value"], abs=REFERENCE_TOLERANCE)
            compared += 1
    assert compared == 3 * len(wanted) >= 12


def chain(n, law="penalty"):
    """Masses in a row that rub on the ground, one pair each; all of them slip."""
    stiffness = 2.2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    contact = {"n_pairs": n, "law": law, "side_1": [d for i in range(n) for d in (i + 1, 0, 0)],
               "mu": [0.3 + 0.02 * i for i in range(n)],
               "normal_load": [0.5 + 0.03 * i for i in range(n)]}
    if law == "penalty":
        contact["tangential_stiffness"] = [1.0 + 0.05 * i for i in range(n)]
    spring = {"n_springs": n, "side_1": list(range(1, n + 1)),
              "coefficient": [0.05 + 0.01 * i for i in range(n)]}
    return {"case": {"analysis": "point", "threads": 1},
            "model": {"n_dof": n, "mass": np.eye(n).ravel().tolist(),
                      "stiffness": stiffness.ravel().tolist(), "modal_damping": 0.01,
                      "rayleigh_mass": 0.01, "rayleigh_stiffness": 0.02},
            "contact": contact, "spring": spring, "load": {"cosine": [0.0] * (n - 1) + [1.5]},
            "harmonics": {"n_harmonics": 5}, "sweep": {"start": 0.9},
            "solver": {"tolerance": 1e-13}, "output": {"observe": [n]}}


def shifted(groups, parameter, element, step):
    """The same with one number moved."""
    group, key = parameter.split("%")
    value = groups[group].get(key, 1.0)
    if isinstance(value, list):
        value = [v + step * (i == element) for i, v in enumerate(value)]
    else:
        value = value + step
    return merged(groups, {group: {key: value}})


@pytest.mark.parametrize("law", ["penalty", "dlft_velocity"])
def test_differences_of_runs(law, tmp_path):
    """Of every word that the case has, through the namelist."""
    parameters = ["contact%mu", "contact%normal_load", "spring%coefficient", "load%harmonic_scale",
                  "model%modal_damping", "model%rayleigh_mass"]
    if law == "penalty":
        parameters += ["contact%tangential_stiffness", "model%rayleigh_stiffness"]
    groups = chain(2, law)
    quantities = ["first_harmonic", "largest", "dissipation", "wear_volume"]
    wanted = {"sensitivity": {"parameters": parameters, "quantities": quantities},
              "wear": {"coefficient": 0.3}}
    run(tmp_path, merged(groups, wanted))
    found = datasets(tmp_path / "case.h5")

    def values(case):
        run(tmp_path, case, name="moved")
        with h5py.File(tmp_path / "moved.h5") as file:
            coefficients = file["coefficients"][0, :, 0]
            work = file["contact/dissipation"][0]
            return np.array([np.hypot(*coefficients[1:3]), file["amplitude"][0, 0], work.sum(),
                             0.3 * (work / case["contact"]["mu"]).sum()])

    step = 1e-5
    for parameter in parameters:
        for element in range(2 if parameter.split("%")[0] in ("contact", "spring") else 1):
            difference = sum(w / step * values(shifted(groups, parameter, element, k * step))
                             for k, w in ((-2, 1 / 12), (-1, -8 / 12), (1, 8 / 12), (2, -1 / 12)))
            for number, quantity in zip(difference, quantities, strict=True):
                exact = np.ravel(found[quantity, parameter.replace("%", "_")])[element]
                assert exact == pytest.approx(number, rel=DIFFERENCE_TOLERANCE,
                                              abs=DIFFERENCE_TOLERANCE), (parameter, quantity)


def test_rotation_speed(tmp_path):
    """Stiffness, static load and modal damping turn with it."""
    with h5py.File(tmp_path / "model.h5", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        file["mass"] = np.diag([1.0, 1.5])
        file["stiffness"] = np.array([[3.0, -1.0], [-1.0, 2.5]])
        file["stiffness_rotation"] = np.array([[0.4, 0.1], [0.1, 0.6]])
        file["load/static_rotation"] = np.array([0.0, -0.7])
    groups = {"case": {"analysis": "point"},
              "model": {"source": "hdf5", "file": "model.h5", "modal_damping": 0.02,
                        "rotation_speed": 1.1},
              "contact": {"n_pairs": 1, "law": "penalty", "side_1": [1, 0, 2], "mu": 0.4,
                          "tangential_stiffness": 2.0, "normal_stiffness": 3.0},
              "load": {"cosine": [0.5, 0.1]}, "harmonics": {"n_harmonics": 5},
              "sweep": {"start": 1.4}, "solver": {"tolerance": 1e-13},
              "output": {"observe": [1]}}
    run(tmp_path, merged(groups, {"sensitivity": {"parameters": ["model%rotation_speed"]}}))
    exact = datasets(tmp_path / "case.h5")["largest", "model_rotation_speed"][0, 0]

    def amplitude(speed):
        run(tmp_path, merged(groups, {"model": {"rotation_speed": speed}}), name="moved")
        with h5py.File(tmp_path / "moved.h5") as file:
            return file["amplitude"][0, 0]

    step = 1e-5
    difference = sum(w / step * amplitude(1.1 + k * step)
                     for k, w in ((-2, 1 / 12), (-1, -8 / 12), (1, 8 / 12), (2, -1 / 12)))
    assert exact == pytest.approx(difference, abs=DIFFERENCE_TOLERANCE)


def counts(folder, groups):
    """Lines of the summary, and the seconds of the points behind the first.

    The first pays for what is made once a run, and for memory that is touched first.
    """
    write_namelist(folder / "case.nml", groups)
    done = subprocess.run([PROGRAM, "case.nml"], cwd=folder, text=True, capture_output=True,
                          check=True, env=PATIENT)
    with h5py.File(folder / "case.h5") as file:
        return done.stdout, file["seconds"][1:].sum()


def test_fifty_parameters_cost_less_than_a_solution_and_a_half(tmp_path):
    """Counted in factorizations and solutions; the time too, of the best of paired runs."""
    groups = merged(chain(12), {"sensitivity": {
        "parameters": ["contact%mu", "contact%normal_load", "contact%tangential_stiffness",
                       "spring%coefficient", "load%harmonic_scale", "model%modal_damping"],
        "quantities": ["first_harmonic"]}})
    text, _ = counts(tmp_path, groups)
    n_parameters, n_rows, n_solutions, n_points, n_lu = (
        int(k) for k in re.search(r"derivatives +(\d+) parameters of (\d+) quantities, adjoint: "
                                  r"(\d+) solutions at (\d+) points, (\d+) factor", text).groups())
    assert (n_parameters, n_rows, n_solutions, n_points, n_lu) == (50, 1, 1, 1, 1)
    steps = int(re.search(r"iterations +(\d+)", text).group(1))
    # A step of Newton's method is a factorization (or a preconditioner and a few solutions).
    assert n_lu < 1.5 * steps and n_solutions < 1.5 * steps
    # Far enough apart to take as many steps each as a point by itself.
    several = merged(groups, {"case": {"analysis": "frf"},
                              "sweep": {"start": 0.5, "end": 1.1, "n_points": 7}})
    without = {name: keys for name, keys in several.items() if name != "sensitivity"}
    pairs = [(counts(tmp_path, several)[1], counts(tmp_path, without)[1]) for _ in range(7)]
    with_them, alone = (min(times) for times in zip(*pairs, strict=True))
    assert with_them < 2.5 * alone


def test_deviation(tmp_path):
    """All pairs share the scatter of a parameter; parameters are independent."""
    run(tmp_path, merged(chain(3), {"sensitivity": {
        "parameters": ["contact%mu", "load%harmonic_scale"], "deviation": [0.05, 0.1]}}))
    found = datasets(tmp_path / "case.h5")
    mu = np.array(chain(3)["contact"]["mu"])
    for quantity in ("first_harmonic", "largest", "dissipation"):
        by_mu = (found[quantity, "contact_mu"] * mu).sum()
        by_load = found[quantity, "load_harmonic_scale"].sum()
        assert found["deviation", quantity].sum() == pytest.approx(
            np.hypot(0.05 * by_mu, 0.1 * by_load), rel=1e-12)


def test_branch_with_folds(tmp_path):
    """Along a branch: dQ/dp of a Duffing oscillator, against the equation of its backbone."""
    run(tmp_path, {
        "case": {"analysis": "frf"}, "model": {"n_dof": 1, "mass": 1.0, "stiffness": 1.0,
                                               "damping": 0.05},
        "spring": {"n_springs": 1, "side_1": [1], "coefficient": 0.5}, "load": {"cosine": [0.15]},
        "harmonics": {"n_harmonics": 1},
        "sweep": {"start": 0.5, "end": 2.0, "n_points": 40, "continuation": "arclength"},
        "sensitivity": {"parameters": ["spring%coefficient", "load%harmonic_scale"]},
        "solver": {"tolerance": 1e-12}})
    found = datasets(tmp_path / "case.h5")
    with h5py.File(tmp_path / "case.h5") as file:
        omega, fold = file["omega"][()], file["fold"][()].astype(bool)
        a = np.hypot(file["coefficients"][:, 1, 0], file["coefficients"][:, 2, 0])
    assert fold.sum() == 2
    # One harmonic: ((1 - w^2 + 3/4 c a^2)^2 + (0.05 w)^2) a^2 = F^2.
    k = 1.0 - omega**2 + 0.375 * a**2
    slope = 2.0 * a * (k**2 + (0.05 * omega)**2) + 2.0 * a**2 * k * 0.75 * a
    away = ~fold & (np.abs(slope) > 1e-3)
    assert away.sum() > 20
    by_coefficient = -2.0 * a**2 * k * 0.75 * a**2 / slope
    by_load = 2.0 * 0.15**2 / slope
    for name, exact in (("spring_coefficient", by_coefficient), ("load_harmonic_scale", by_load)):
        numbers = found["first_harmonic", name].reshape(len(omega))
        np.testing.assert_allclose(numbers[away], exact[away], rtol=1e-6, atol=1e-8)
        # The amplitude has no derivative at a fold.
        assert np.isnan(numbers[fold]).all() and np.isfinite(numbers[~fold]).all()


def cyclic(**sensitivity):
    """A sector with friction between neighbours, by the reference of its kind."""
    return {"case": {"analysis": "point"},
            "model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 1.0],
                      "stiffness": [3.0, -1.0, -1.0, 2.0], "damping": [0.06, -0.02, -0.02, 0.04]},
            "cyclic": {"n_sectors": 6, "engine_order": 2},
            "contact": {"n_pairs": 1, "law": "penalty", "side_1": [2, 0, 0], "side_2": [2, 0, 0],
                        "sector_2": [1], "mu": 0.4, "normal_load": 0.6,
                        "tangential_stiffness": 1.5},
            "load": {"cosine": [0.4, 0.2]}, "harmonics": {"n_harmonics": 5},
            "sweep": {"start": 1.2}, "solver": {"tolerance": 1e-13},
            "output": {"observe": [1]}, **sensitivity}


def test_sectors_by_contact_and_loads(tmp_path):
    """Waves around sectors: the direct way, against differences of runs."""
    parameters = ["contact%mu", "contact%tangential_stiffness", "load%harmonic_scale"]
    run(tmp_path, cyclic(sensitivity={"parameters": parameters}))
    found = datasets(tmp_path / "case.h5")

    def amplitude(case):
        run(tmp_path, case, name="moved")
        with h5py.File(tmp_path / "moved.h5") as file:
            return file["amplitude"][0, 0]

    step = 1e-5
    for parameter in parameters:
        difference = sum(w / step * amplitude(shifted(cyclic(), parameter, 0, k * step))
                         for k, w in ((-2, 1 / 12), (-1, -8 / 12), (1, 8 / 12), (2, -1 / 12)))
        exact = found["largest", parameter.replace("%", "_")].ravel()[0]
        assert abs(difference) > 1e-3
        assert exact == pytest.approx(difference, abs=DIFFERENCE_TOLERANCE)


def test_remarks(tmp_path):
    """Instants and held eps are said."""
    groups = merged(chain(2, "dlft"), {
        "sensitivity": {"parameters": ["model%modal_damping"]},
        "harmonics": {"sampling": "uniform"}})
    run(tmp_path, groups)
    with h5py.File(tmp_path / "case.h5") as file:
        remarks = list(file["remarks/name"].asstr()[:])
    assert {"derivatives of instants", "derivatives at held eps"} <= set(remarks)


REFUSED = [
    ({"sensitivity": {"parameters": ["contact%area"]}}, "must be one of 'load%harmonic_scale'"),
    ({"sensitivity": {"parameters": ["contact%mu", "contact%mu"]}}, "twice"),
    ({"sensitivity": {"quantities": ["largest"]}}, "without parameters"),
    ({"sensitivity": {"deviation": 0.1}}, "without parameters"),
    ({"sensitivity": {"parameters": ["contact%mu"], "deviation": [0.1, 0.2]}}, "deviation"),
    ({"sensitivity": {"parameters": ["contact%gap"]}}, "no pair has a normal dof"),
    ({"sensitivity": {"parameters": ["load%static_scale"]}}, "no static load"),
    ({"sensitivity": {"parameters": ["model%rotation_speed"]}}, "no stiffness_rotation"),
    ({"sensitivity": {"parameters": ["contact%mu"], "quantities": ["wear_volume"]}},
     "wear%coefficient"),
    ({"sensitivity": {"parameters": ["contact%tangential_stiffness"]},
      "contact": {"law": "dlft", "tangential_stiffness": None}}, "is rigid"),
    ({"sensitivity": {"parameters": ["contact%mu"]}, "contact": {"mu": 0.0}}, "friction begins"),
    ({"sensitivity": {"parameters": ["contact%mu"]}, "harmonics": {"n_harmonics": None}},
     "n_harmonics is missing"),
    ({"sensitivity": {"parameters": ["contact%mu"]}, "harmonics": {"accuracy": 1e-2,
                                                                   "n_harmonics": 21}},
     "harmonics%accuracy"),
    ({"sensitivity": {"parameters": ["contact%mu"]}, "harmonics": {"method": "tcm"}},
     "harmonics%method"),
    ({"sensitivity": {"parameters": ["contact%mu"]}, "contact": {"memory": "carried"}}, "memory"),
    ({"sensitivity": {"parameters": ["contact%mu"]}, "solver": {"kind": "powell"}}, "newton"),
    ({"sensitivity": {"parameters": ["contact%mu"]}, "case": {"analysis": "time"}}, "analysis"),
]


def test_wear_by_energy(tmp_path):
    """Under the law of energy the volume is in proportion to the dissipation, whatever mu is."""
    run(tmp_path, merged(chain(2), {
        "wear": {"coefficient": 0.3, "law": "energy"},
        "sensitivity": {"parameters": ["contact%mu"],
                        "quantities": ["wear_volume", "dissipation"]}}))
    found = datasets(tmp_path / "case.h5")
    volume, energy = (found[name, "contact_mu"] for name in ("wear_volume", "dissipation"))
    assert np.abs(energy).max() > 1e-3
    np.testing.assert_allclose(volume, 0.3 * energy, rtol=1e-12)


@pytest.mark.parametrize(("changes", "words"), REFUSED)
def test_refused(changes, words, tmp_path):
    done = run(tmp_path, merged(chain(2), changes), status=3)
    assert words in done.stderr, done.stderr


def test_refused_of_sectors(tmp_path):
    done = run(tmp_path, cyclic(sensitivity={"parameters": ["model%modal_damping"]}), status=3)
    assert "cyclic" in done.stderr
