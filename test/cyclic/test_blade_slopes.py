"""Derivatives by what sectors differ by, and their scale as a parameter, on random disks."""
import json

import numpy as np
import pytest
from cases import merged, read, run
from cyclic_cases import difference
from deviations import write
from test_blades import sector, with_rows

#: Differences of fourth order of solutions of 1e-13, with two steps that have to agree.
STEPS = (4e-4, 2e-4)
STENCIL = ((-2, 1.0 / 12.0), (-1, -8.0 / 12.0), (1, 8.0 / 12.0), (2, -1.0 / 12.0))
EXACT, SMOOTH = 1e-6, 2e-7
#: Both solved to residuals of 1e-13; conditioning takes the rest.
EQUAL = 1e-10
WORDS = ("frequency", "damping_ratio", "stiffness", "mass", "scale")
QUANTITIES = ("first_harmonic", "largest", "dissipation")


def disk(n_sectors=5, seed=7):
    """A case and its deviations of all kinds."""
    rng, case = sector(seed=seed, n_sectors=n_sectors)
    parts = with_rows(rng, case)
    n = len(case["model"]["mass"])
    a = rng.normal(size=(2, n, n)) / n
    parts |= {"blade_stiffness": a[0] @ a[0].T, "blade_mass": 0.1 * a[1] @ a[1].T,
              "damping_ratio": 0.002 * rng.uniform(size=(n_sectors, 2)),
              "stiffness": 0.1 * rng.uniform(-1.0, 1.0, n_sectors),
              "mass": 0.1 * rng.uniform(-1.0, 1.0, n_sectors)}
    return case, parts


def solve(folder, case, parts, scale=1.0, /, **groups):
    folder.mkdir(exist_ok=True)
    write(folder / "model.h5", case, parts)
    run(folder, merged(
        {"case": {"analysis": "point"}, "model": {"source": "hdf5", "file": "model.h5"},
         "cyclic": {"engine_order": case["engine_order"], "mistuned": True},
         "mistuning": {"scale": scale}, "contact": {"law": case["law"]},
         "sweep": {"start": 1.3}, "solver": {"tolerance": 1e-13},
         "harmonics": {"n_harmonics": 3, "sampling": "uniform", "n_time": 80}}, groups))
    return read(folder / "case.h5")


def values_of(result):
    c = result["coefficients"][0]
    return np.concatenate([np.hypot(c[1], c[2]), result["amplitude"][0],
                           [result["contact/dissipation"][0].sum()]])


def slope(folder, case, parts, word, element, scale):
    """Differences by one value with each step."""
    found = []
    for step in STEPS:
        total = 0.0
        for k, weight in STENCIL:
            moved, factor = {key: np.array(value) for key, value in parts.items()}, scale
            if word == "scale":
                factor = scale + k * step
            else:
                moved[word].reshape(-1)[element] += k * step
            total = total + weight / step * values_of(solve(folder, case, moved, factor))
        found.append(total)
    return found


@pytest.mark.parametrize("asked", [QUANTITIES, ("dissipation",)])
def test_derivatives_are_those_of_differences(tmp_path, asked):
    """One solution for each parameter where there are fewer of these, else for each quantity."""
    case, parts = disk()
    scale = 0.8
    result = solve(tmp_path, case, parts, scale, sensitivity={
        "parameters": [f"mistuning%{word}" for word in WORDS] + ["contact%mu"],
        "quantities": list(asked)})
    assert result["sensitivity/dissipation/mistuning_frequency"].shape == (1, 10)
    for word, element in (("frequency", 3), ("damping_ratio", 6), ("stiffness", 2), ("mass", 4),
                          ("scale", 0)):
        exact = np.concatenate([
            np.atleast_1d(np.reshape(result[f"sensitivity/{q}/mistuning_{word}"][0], (
                -1, 1 if word == "scale" else len(np.ravel(parts[word]))))[:, element])
            for q in asked])
        first, second = (d[-1:] if asked == ("dissipation",) else d
                         for d in slope(tmp_path / "moved", case, parts, word, element, scale))
        size = np.abs(second).max()
        assert np.abs(first - second).max() < SMOOTH * size, word
        assert np.abs(exact - second).max() < EXACT * size, word


def test_derivatives_at_the_tuned_disk(tmp_path):
    """Values of 0 serve, and so does a scale of 0 for its own derivative."""
    case, parts = disk()
    tuned = {key: value if key in ("rows", "row_omega") else 0.0 * value
             for key, value in parts.items() if key in ("rows", "row_omega", "frequency")}
    asked = {"parameters": ["mistuning%frequency"], "quantities": ["first_harmonic"]}
    by_blade = solve(tmp_path, case, tuned, sensitivity=asked)[
        "sensitivity/first_harmonic/mistuning_frequency"][0]
    tuned["frequency"] = parts["frequency"]
    by_scale = solve(tmp_path, case, tuned, 0.0, sensitivity=asked | {
        "parameters": ["mistuning%scale"]})["sensitivity/first_harmonic/mistuning_scale"][0]
    # The derivative by the scale is that along the pattern.
    assert difference(by_blade @ parts["frequency"].ravel(), by_scale) < EQUAL
    # Each blade does to its neighbours what every other does to its own.
    n = case["n_sectors"]
    table = by_blade.reshape(n, -1, n, 2)
    turned = np.roll(np.roll(table, 1, axis=0), 1, axis=2)
    assert difference(turned, table) < 1e-8


def test_adjoint_by_krylov(tmp_path):
    """More unknowns than are factored at once: waves and what they lack, transposed."""
    case, parts = disk(n_sectors=24)
    asked = {"parameters": ["mistuning%frequency", "mistuning%scale", "contact%mu"],
             "quantities": ["dissipation"]}
    adjoint = solve(tmp_path / "adjoint", case, parts, sensitivity=asked)
    # All quantities of all sectors: fewer parameters, one solution for each.
    direct = solve(tmp_path / "direct", case, parts, sensitivity=asked | {
        "quantities": list(QUANTITIES)})
    for name in ("mistuning_frequency", "mistuning_scale", "contact_mu"):
        name = f"sensitivity/dissipation/{name}"
        assert difference(adjoint[name], direct[name]) < 1e-8, name


def test_scale_as_the_parameter_of_a_sweep(tmp_path):
    case, parts = disk()
    scales = [0.0, 0.4, 1.0, -0.6]
    wanted = np.concatenate([solve(tmp_path / f"p{k}", case, parts, scale)["coefficients"]
                             for k, scale in enumerate(scales)])
    over = {"case": {"analysis": "frf"}, "sweep": {
        "parameter": "mistuning%scale", "frequency": 1.3, "start": None, "values": scales}}
    assert difference(solve(tmp_path / "values", case, parts, **over)["coefficients"],
                      wanted) < EQUAL
    over["sweep"] |= {"as": "factor", "values": [2.0 * s for s in scales]}
    assert difference(solve(tmp_path / "factors", case, parts, 0.5, **over)["coefficients"],
                      wanted) < EQUAL
    over["sweep"] = {"parameter": "mistuning%scale", "frequency": 1.3, "start": 0.0, "end": 1.0,
                     "continuation": "arclength"}
    branch = solve(tmp_path / "branch", case, parts, **over)
    assert branch["parameter"][-1] == pytest.approx(1.0, abs=1e-12)
    assert difference(branch["coefficients"][-1], wanted[2]) < 1e-8


def test_friction_of_all_sectors_as_the_parameter(tmp_path):
    case, parts = disk()
    mu = [0.2, 0.5]
    wanted = np.concatenate([solve(tmp_path / f"p{k}", case, parts, contact={"mu": value})[
        "coefficients"] for k, value in enumerate(mu)])
    found = solve(tmp_path / "sweep", case, parts, case={"analysis": "frf"}, contact={"mu": 0.3},
                  sweep={"parameter": "contact%mu", "frequency": 1.3, "start": None, "values": mu})
    assert difference(found["coefficients"], wanted) < EQUAL


def test_blades_beside_each_other(tmp_path):
    case, parts = disk()
    result = solve(tmp_path, case, parts, output={"observe": [5, 6]})
    n = case["n_sectors"]
    amplitude = result["amplitude"][0].reshape(n, 2)
    assert np.array_equal(result["blades/largest"][0], amplitude.max(axis=0))
    assert np.array_equal(result["blades/sector"][0], amplitude.argmax(axis=0))
    k = result["blades/nodal_diameter"]
    assert k.tolist() == [-2, -1, 0, 1, 2]
    u = (result["coefficients"][0, 1] - 1j * result["coefficients"][0, 2]).reshape(n, 2)
    turn = np.exp(2j * np.pi * np.outer(np.arange(n), k) / n)
    assert difference(result["blades/content"][0], np.abs(u.T @ turn) / n) < 1e-13
    # The tuned disk answers in the wave of its load alone.
    tuned = solve(tmp_path / "tuned", case, parts, 0.0, contact={"mu": 0.0})["blades/content"][0]
    folded = (case["engine_order"] + 2) % n - 2
    assert np.all(tuned[:, k != folded] < 1e-10 * tuned[:, k == folded])


@pytest.mark.parametrize(("groups", "told"), [
    ({"sensitivity": {"parameters": ["mistuning%frequency"]}, "cyclic": {"mistuned": False},
      "mistuning": {"scale": 0.0}}, "no sector differs"),
    ({"sensitivity": {"parameters": ["mistuning%mass"]}}, "mistuning%mass is not given"),
    ({"case": {"analysis": "frf"}, "sweep": {"parameter": "mistuning%frequency", "frequency": 1.3,
                                             "values": [0.1], "start": None}},
     "use 'mistuning%scale'"),
    ({"case": {"analysis": "frf"}, "sweep": {"parameter": "mistuning%scale", "frequency": 1.3,
                                             "values": [0.1, 99.0], "start": None}},
     "where 1 + scale*frequency of a blade is not above 0"),
    ({"case": {"analysis": "frf"}, "sweep": {"parameter": "mistuning%scale", "frequency": 1.3,
                                             "values": [0.1, 9.0], "start": None}},
     "is not positive")])
def test_what_no_sector_has_is_refused(tmp_path, groups, told):
    case, parts = disk()
    parts = {key: parts[key] for key in ("rows", "row_omega", "frequency")}
    if told == "is not positive":
        n = len(case["model"]["mass"])
        parts |= {"blade_mass": np.eye(n), "mass": [-0.3] + [0.0] * 4}
    write(tmp_path / "model.h5", case, parts)
    done = run(tmp_path, merged(
        {"case": {"analysis": "point"}, "model": {"source": "hdf5", "file": "model.h5"},
         "cyclic": {"engine_order": 2, "mistuned": True}, "contact": {"law": "penalty"},
         "sweep": {"start": 0.7}, "harmonics": {"n_harmonics": 1}}, groups), status=3)
    assert told in done.stderr, json.dumps(groups)
