"""Nonlinear modes and resonances of disks whose sectors differ, against the annulus as one
structure; random ones and wear are in the family `blades`."""
import numpy as np
import pytest
from annulus import random_case
from cases import merged, read, run
from cyclic_cases import difference, model_groups
from deviations import annulus, draw, write

#: Curves of residuals of 1e-11, with the condition of a resonance.
SAME = 1e-6


def disk(seed=3, n_sectors=4, law="penalty", way="together"):
    rng = np.random.default_rng([61, seed])
    case = random_case(rng, law=law, n_sectors=n_sectors, n_pairs=1, engine_order=1)
    parts, scale, change = draw(rng, case, way, 0.08)
    return case, parts, scale, change


def sectors(folder, case, parts, scale, groups):
    write(folder / "model.h5", case, parts)
    run(folder, merged({
        "model": {"source": "hdf5", "file": "model.h5"},
        "cyclic": {"engine_order": case["engine_order"], "mistuned": True},
        "contact": {"law": case["law"]}, "mistuning": {"scale": scale},
        "harmonics": {"n_harmonics": 3}, "solver": {"tolerance": 1e-11}}, groups))
    return read(folder / "case.h5")


def whole_disk(folder, case, change, groups):
    whole = annulus(case, change)
    run(folder, merged(model_groups(whole.case) | {
        "harmonics": {"n_harmonics": 3}, "solver": {"tolerance": 1e-11}}, groups), name="whole")
    return whole, read(folder / "whole.h5")


@pytest.mark.parametrize("number", [1, 2])
def test_modes_of_the_annulus(tmp_path, number):
    case, parts, scale, change = disk()
    mode = {"case": {"analysis": "mode"}, "mode": {
        "number": number, "start": 0.02, "end": 40.0, "n_points": 7, "control": "modal",
        "continuation": "natural"}}
    found = sectors(tmp_path, case, parts, scale, mode)
    ring, wanted = whole_disk(tmp_path, case, change, mode)
    assert found["converged"].all() and wanted["converged"].all()
    for name in ("omega", "mode/damping_ratio", "mode/modal_amplitude"):
        assert np.allclose(found[name], wanted[name], rtol=SAME), name
    # Friction acts: the damping grows.
    assert np.ptp(found["mode/damping_ratio"]) > 1e-3 * found["mode/damping_ratio"].max()
    moved = np.concatenate([ring.sector(wanted["coefficients"], j)
                            for j in range(case["n_sectors"])], axis=-1)
    size = np.hypot(moved[:, 1], moved[:, 2])
    assert difference(found["mode/first_harmonic"], size) < SAME


@pytest.mark.parametrize("condition", ["amplitude", "phase"])
def test_resonances_of_the_annulus(tmp_path, condition):
    case, parts, scale, change = disk(seed=4)
    groups = {"case": {"analysis": "resonance"},
              "sweep": {"start": 0.6, "end": 1.6, "n_points": 41},
              "resonance": {"parameter": "load%harmonic_scale", "start": 1.0, "end": 2.5,
                            "n_points": 4, "condition": condition}}
    found = sectors(tmp_path, case, parts, scale, groups)
    _, wanted = whole_disk(tmp_path, case, change, groups)
    assert len(found["omega"]) == 4 and found["converged"].all()
    for name in ("omega", "resonance/first_harmonic"):
        assert np.allclose(found[name], wanted[name], rtol=SAME), name


def test_resonances_over_the_scale(tmp_path):
    """From the tuned disk to the one as it is: at each scale that of a case of its own."""
    case, parts, _, _ = disk(seed=4)
    groups = {"case": {"analysis": "resonance"},
              "sweep": {"start": 0.6, "end": 1.6, "n_points": 41}}
    found = sectors(tmp_path, case, parts, 1.0, groups | {"resonance": {
        "parameter": "mistuning%scale", "start": 0.0, "end": 0.5, "n_points": 3}})
    for k, scale in enumerate(found["parameter"]):
        near = float(found["omega"][k])
        alone = sectors(tmp_path, case, parts, float(scale), merged(groups, {
            "sweep": {"start": 0.997 * near, "end": 1.003 * near, "n_points": 13},
            "resonance": {"parameter": "load%harmonic_scale", "start": 1.0, "end": 1.01,
                          "n_points": 2}}))
        assert np.allclose(alone["omega"][0], near, rtol=SAME)
        assert np.allclose(alone["resonance/first_harmonic"][0],
                           found["resonance/first_harmonic"][k], rtol=SAME)


def slopes(folder, case, parts, scale, groups, names):
    """Derivatives by the scale, and central differences."""
    step = 1e-5
    exact = sectors(folder, case, parts, scale, merged(groups, {
        "sensitivity": {"parameters": ["mistuning%scale"]}}))
    moved = [sectors(folder, case, parts, scale + side * step, groups) for side in (1, -1)]
    for name, value in names.items():
        found = exact[f"sensitivity/{name}/mistuning_scale"]
        wanted = (value(moved[0]) - value(moved[1])) / (2.0 * step)
        # Solutions of 1e-11 over the step, and its square.
        assert difference(found, wanted) < 1e-5, name


def first_harmonic(result):
    return np.hypot(result["coefficients"][:, 1], result["coefficients"][:, 2])


def test_derivatives_along_curves(tmp_path):
    case, parts, scale, _ = disk(way="rows")
    mode = {"case": {"analysis": "mode"}, "mode": {
        "start": 10.0, "end": 20.0, "n_points": 2, "control": "modal",
        "continuation": "natural"}}
    slopes(tmp_path, case, parts, scale, mode, {
        "mode_omega": lambda r: r["omega"],
        "mode_damping_ratio": lambda r: r["mode/damping_ratio"], "first_harmonic": first_harmonic})
    slopes(tmp_path, case, parts, scale, {
        "case": {"analysis": "resonance"}, "sweep": {"start": 0.6, "end": 1.6, "n_points": 41},
        "resonance": {"parameter": "load%harmonic_scale", "start": 1.0, "end": 1.2,
                      "n_points": 2}},
        {"resonance_omega": lambda r: r["omega"], "first_harmonic": first_harmonic})


def test_a_mass_that_measures_stays(tmp_path):
    case, parts, scale, _ = disk()
    write(tmp_path / "model.h5", case, parts)
    done = run(tmp_path, {
        "case": {"analysis": "mode"}, "model": {"source": "hdf5", "file": "model.h5"},
        "cyclic": {"engine_order": 1, "mistuned": True}, "contact": {"law": "penalty"},
        "mistuning": {"scale": scale}, "harmonics": {"n_harmonics": 1},
        "mode": {"start": 1.0, "end": 2.0, "control": "modal"},
        "sensitivity": {"parameters": ["mistuning%scale"]}}, status=3)
    assert "use 'observed'" in done.stderr
