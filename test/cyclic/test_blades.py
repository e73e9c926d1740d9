"""Sectors that differ (&mistuning).

test/reference/blades/b1.., b2.., b3.. and b8.. are annuli by a dense harmonic balance of other
origin. Random disks are judged by the program itself on the annulus as one structure.
"""
import json

import numpy as np
import pytest
from annulus import mistuned, random_case
from cases import read, run, run_reference
from cyclic_cases import difference
from deviations import annulus, draw, write
from project import ROOT
from scipy.linalg import eigh

FILES = ["b1_frequency", "b2_matrices", "b3_stiffness_mass", "b8_rigid"]
REFERENCE = {name: json.loads((ROOT / f"test/reference/blades/{name}.json").read_text())
             for name in FILES}
RUNS = [(name, number) for name in FILES for number in range(len(REFERENCE[name]["runs"]))]
#: Both are solved to residuals of 1e-12; conditioning takes the rest.
EQUAL = 1e-9
#: Only round-off tells two ways to say the same.
SAME = 1e-11


@pytest.mark.parametrize(("name", "number"), RUNS)
def test_other_programs(tmp_path, name, number):
    run_reference(tmp_path, REFERENCE[name], number)


def solve(folder, case, parts, omegas=(0.7, 1.3, 1.9), **more):
    """Rows of all sectors of a case with parts of /mistuning."""
    folder.mkdir()
    write(folder / "model.h5", case, parts)
    run(folder, {"case": {"analysis": "frf"}, "model": {"source": "hdf5", "file": "model.h5"},
                 "cyclic": {"engine_order": case["engine_order"], "mistuned": True},
                 "contact": {"law": case["law"]}, "sweep": {"values": list(omegas)},
                 "solver": {"tolerance": 1e-12},
                 "harmonics": {"n_harmonics": 3, "sampling": "uniform", "n_time": 80}} | more)
    return read(folder / "case.h5")["coefficients"]


def sector(seed=7, n_sectors=5):
    rng = np.random.default_rng([59, seed])
    case = random_case(rng, n_sectors=n_sectors, n_pairs=1, engine_order=2)
    case["model"]["left"], case["model"]["right"] = [1], [2]
    return rng, case


def with_rows(rng, case, r=2):
    n = len(case["model"]["mass"])
    return {"rows": 0.5 * rng.normal(size=(r, n)), "row_omega": rng.uniform(0.8, 3.0, r),
            "frequency": 0.05 * rng.uniform(-1.0, 1.0, (case["n_sectors"], r))}


def test_deviations_of_nothing_change_no_bit(tmp_path):
    rng, case = sector()
    parts = with_rows(rng, case)
    plain = solve(tmp_path / "plain", case, {})
    parts["frequency"] *= 0.0
    assert np.array_equal(solve(tmp_path / "zero", case, parts), plain)


def test_rows_and_matrices_say_the_same(tmp_path):
    """Rows; the stiffness of a blade with one row; matrices of sectors, added or whole."""
    rng, case = sector()
    parts = with_rows(rng, case, 1)
    w, d, rows = parts["row_omega"], parts["frequency"], parts["rows"]
    found = solve(tmp_path / "rows", case, parts)
    blade = rows.T @ np.diag(w**2) @ rows
    part = (1.0 + d[:, 0])**2 - 1.0
    ways = {"blade": {"blade_stiffness": blade, "stiffness": part},
            "sectors": {f"sector/{j}/stiffness": e * blade for j, e in enumerate(part)}}
    ways["whole"] = {name: value + np.array(case["model"]["stiffness"])
                     for name, value in ways["sectors"].items()}
    ways["whole"] |= {f"sector/{j}@kind": "full" for j in range(len(part))}
    for way, parts_of in ways.items():
        assert difference(solve(tmp_path / way, case, parts_of), found) < EQUAL, way


def test_a_turned_pattern_turns_the_answer(tmp_path):
    rng, case = sector()
    parts = with_rows(rng, case)
    found = solve(tmp_path / "one", case, parts)
    parts["frequency"] = np.roll(parts["frequency"], 1, axis=0)
    turned = solve(tmp_path / "two", case, parts)
    n = case["n_sectors"]
    amplitude = found[:, 1::2] - 1j * found[:, 2::2]
    phase = np.exp(-2j * np.pi * case["engine_order"] / n * np.arange(1, 4))[None, :, None]
    wanted = np.roll(amplitude.reshape(3, 3, n, -1), 1, axis=2).reshape(amplitude.shape) * phase
    assert difference(turned[:, 1::2] - 1j * turned[:, 2::2], wanted) < EQUAL


def repeated(case, parts, times):
    """The disk of so many times the sectors, with the same pattern again and again."""
    n = case["n_sectors"]
    contact = {key: values if key in ("side_1", "side_2", "sector_2") else values * times
               for key, values in case["contact"].items()}
    larger = {**case, "n_sectors": times * n, "engine_order": times * case["engine_order"],
              "contact": contact}
    return larger, parts | {"frequency": np.tile(parts["frequency"], (times, 1))}


def test_a_pattern_again_and_again_is_that_of_a_small_disk(tmp_path):
    """More coordinates than matrices of all sectors are factored of: contact of each sector in the
    preconditioner, and its transpose."""
    rng, case = sector()
    parts = with_rows(rng, case)
    # Waves that take the mean of the contact need over 30 steps of GMRES here.
    case["model"]["damping"] = (0.03 * np.array(case["model"]["damping"])).tolist()
    case = mistuned(rng, case, 0.8)
    asked = {"sensitivity": {"parameters": ["mistuning%frequency"], "quantities": ["dissipation"]},
             "solver": {"tolerance": 1e-12}}
    times = 80
    found = []
    for name, disk in (("small", (case, parts)), ("large", repeated(case, parts, times))):
        solve(tmp_path / name, *disk, omegas=(0.8,), **asked)
        found.append(read(tmp_path / name / "case.h5"))
    small, large = found
    n = case["n_sectors"] * len(case["model"]["mass"])
    assert difference(large["coefficients"][..., :n], small["coefficients"]) < EQUAL
    assert difference(large["coefficients"][..., -n:], small["coefficients"]) < EQUAL
    # The work of all sectors by the frequency of one blade, of all repetitions together.
    name = "sensitivity/dissipation/mistuning_frequency"
    by_blade = large[name].reshape(times, -1).sum(axis=0) / times
    assert difference(by_blade, small[name].ravel()) < 1e-7


def test_many_modes_are_those_of_the_annulus(tmp_path):
    """More unknowns than are solved for at once."""
    rng, case = sector(n_sectors=70)
    parts, scale, change = draw(rng, case, "rows", 0.05)
    write(tmp_path / "model.h5", case, parts)
    run(tmp_path, {"case": {"analysis": "modes"}, "mistuning": {"scale": scale},
                   "model": {"source": "hdf5", "file": "model.h5"},
                   "cyclic": {"mistuned": True, "n_modes": 2}})
    result = read(tmp_path / "case.h5")
    whole = annulus(case, change).case["model"]
    assert len(whole["mass"]) > 500
    theta = eigh(np.array(whole["mass"]), np.array(whole["stiffness"]), eigvals_only=True)[::-1]
    wanted = 1.0 / np.sqrt(theta[:140])
    assert np.abs(result["modes/open"][0] / wanted - 1.0).max() < EQUAL
    assert np.abs(result["modes/closed_content"].sum(axis=1) - 1.0).max() < SAME


@pytest.mark.parametrize(("groups", "told"), [
    ({"cyclic": {"engine_order": 2}}, "mistuned = .false., but the sectors differ"),
    ({"mistuning": {"frequency": [0.1, 0.2]}}, "must be 5, one for each sector, or 10"),
    ({"mistuning": {"stiffness": [0.1] * 5}}, "is given without blade_stiffness"),
    ({"mistuning": {"mass": [0.1] * 4}}, "must be 5, one for each sector"),
    ({"mistuning": {"frequency": [-1.5] + [0.0] * 4}}, "of sector 0, times scale"),
    ({"mistuning": {"mass": [0.0] * 4 + [-99.0], "blade_mass": []}},
     "of sector 4 makes its mass matrix"),
    ({"mistuning": {"n_rows": 3}}, "give rows and row_omega of as many")])
def test_wrong_deviations_are_refused(tmp_path, groups, told):
    rng, case = sector()
    write(tmp_path / "model.h5", case, with_rows(rng, case))
    for keys in groups.values():
        if "blade_mass" in keys:
            keys["blade_mass"] = np.eye(len(case["model"]["mass"])).tolist()
    done = run(tmp_path, {"case": {"analysis": "frf"},
                          "model": {"source": "hdf5", "file": "model.h5"},
                          "cyclic": {"engine_order": 2, "mistuned": True},
                          "contact": {"law": "penalty"}, "sweep": {"values": [0.7]},
                          "harmonics": {"n_harmonics": 1}} | groups, status=3)
    assert told in done.stderr


def test_a_check_lists_frequencies_of_all_sectors(tmp_path):
    rng, case = sector()
    parts, scale, change = draw(rng, case, "rows", 0.05)
    write(tmp_path / "model.h5", case, parts)
    groups = {"case": {"analysis": "frf"}, "model": {"source": "hdf5", "file": "model.h5"},
              "cyclic": {"engine_order": 2, "mistuned": True}, "contact": {"law": "penalty"},
              "sweep": {"start": 1e-3, "end": 9e9, "n_points": 2}, "harmonics": {"n_harmonics": 1},
              "mistuning": {"scale": scale}}
    told = run(tmp_path, groups, "--check").stdout
    assert "natural frequencies [rad/s] of all sectors within the sweep" in told
    (line,) = [line for line in told.splitlines() if line.startswith("!   open")]
    whole = annulus(case, change).case["model"]
    theta = eigh(np.array(whole["mass"]), np.array(whole["stiffness"]), eigvals_only=True)[::-1]
    found = [float(word) for word in line.split()[2:8]]
    assert np.allclose(found, 1.0 / np.sqrt(theta[:6]), rtol=1e-5)


def ring_of(case, change):
    """Mass, stiffness, damping and load of the annulus; dofs and signs of each sector in it."""
    model, n_sectors = case["model"], case["n_sectors"]
    right = {abs(r) - 1: (left - 1, np.sign(r)) for left, r in zip(model["left"], model["right"])}
    inner = [i for i in range(len(model["mass"])) if i not in right]
    place = {i: p for p, i in enumerate(inner)}
    own = [right.get(i, (i, 1)) for i in range(len(model["mass"]))]
    sign = np.array([s for _, s in own], float)
    dofs = np.array([[(j + (i in right)) % n_sectors * len(inner) + place[source]
                      for i, (source, _) in enumerate(own)] for j in range(n_sectors)])
    size = n_sectors * len(inner)
    matrices = [np.zeros((size, size)) for _ in range(3)]
    load = np.zeros(size, complex)
    force = np.array(case["load"]["cosine"]) - 1j * np.array(case["load"]["sine"])
    for j, at in enumerate(dofs):
        for whole, key in zip(matrices, ("mass", "stiffness", "damping")):
            np.add.at(whole, (at[:, None], at), np.outer(sign, sign)
                      * (np.array(model[key]) + change[key][j]))
        np.add.at(load, at, sign * force * np.exp(
            -2j * np.pi * j * case["engine_order"] / n_sectors))
    return matrices, load, dofs, sign


@pytest.mark.parametrize("n_pairs", [0, 1])
def test_more_rows_than_are_factored_together(tmp_path, n_pairs):
    """170 sectors that differ in all of their dofs: waves alone precondition."""
    rng, case = sector(n_sectors=170)
    parts, scale, change = draw(rng, case, "full", 0.05)
    groups = {"case": {"analysis": "point"}, "model": {"source": "hdf5", "file": "model.h5"},
              "cyclic": {"engine_order": case["engine_order"], "mistuned": True},
              "mistuning": {"scale": scale}, "sweep": {"start": 0.95},
              "solver": {"tolerance": 1e-11},
              "harmonics": {"n_harmonics": 1, "sampling": "uniform", "n_time": 64}}
    if n_pairs:
        groups["contact"] = {"law": "penalty"}
    else:
        case["contact"] = {"side_1": []}
    write(tmp_path / "model.h5", case, parts)
    run(tmp_path, groups)
    result = read(tmp_path / "case.h5")
    assert result["converged"].all()
    found = result["coefficients"][0, 1] - 1j * result["coefficients"][0, 2]
    (mass, stiffness, damping), load, dofs, sign = ring_of(case, change)
    residual = load.copy()
    motion = np.zeros(len(load), complex)
    motion[dofs] = sign * found.reshape(dofs.shape)
    if n_pairs:
        # Forces of the pairs as they are written, on the dofs of either side.
        force = result["contact/force"][0, 1] - 1j * result["contact/force"][0, 2]
        for j, at in enumerate(dofs):
            for pair, (a, b, s) in enumerate(zip(case["contact"]["side_1"],
                                                 case["contact"]["side_2"],
                                                 case["contact"]["sector_2"])):
                other = dofs[(j + s) % len(dofs)]
                for c in range(3):
                    for dof, there, side in ((a[c], at, 1), (b[c], other, -1)):
                        if dof:
                            residual[there[abs(dof) - 1]] -= (
                                side * np.sign(dof) * sign[abs(dof) - 1]
                                * force[j * len(case["contact"]["side_1"]) + pair, c])
    residual -= (stiffness - 0.95**2 * mass + 0.95j * damping) @ motion
    # Of the forces before they cancel.
    assert np.abs(residual).max() < EQUAL * np.abs(stiffness @ motion).max()
