"""Laws that are made of parallel elastic pairs: play, tables, sliders.

test/reference/laws/law_normal.json has masses between stops and on a seat with a table, integrated
from event to event. What sliders dissipate is a closed form of the largest displacement.
"""
import json

import numpy as np
import pytest
from oracle_runs import run_case
from project import ROOT
from test_several_laws import coefficients_of, difference

CASES = json.loads((ROOT / "test/reference/laws/law_normal.json").read_text())["cases"]


def groups(p, pairs, n_harmonics):
    """One mass; pairs are (sign of the dof, gap, stiffness)."""
    sign, gap, stiffness = (list(values) for values in zip(*pairs, strict=True))
    return {
        "case": {"title": "parallel pairs", "analysis": "point"},
        "model": {"n_dof": 1, "mass": p["m"], "damping": p["c"], "stiffness": p["k"]},
        "contact": {"n_pairs": len(pairs), "law": "penalty", "gap": gap,
                    "side_1": [dof for s in sign for dof in (0, 0, s)],
                    "normal_stiffness": stiffness},
        "load": {"cosine": p["F"], "static": p["F0"]},
        "harmonics": {"n_harmonics": n_harmonics, "parity": "all"},
        "sweep": {"start": p["omega"]}, "solver": {"tolerance": 1e-11},
    }


def pairs_of_table(overclosure, force, gap):
    """One pair for each change of slope."""
    slopes = np.diff(force) / np.diff(overclosure)
    rises = np.diff(slopes, prepend=0.0)
    return [(1, gap + d, k) for d, k in zip(overclosure[:-1], rises, strict=True)]


# Errors at H = 3, 7 and 15, twice what is measured: what truncation leaves.
@pytest.mark.parametrize(("name", "bounds"), [
    ("bilateral", (1.4e-2, 6e-5, 1.5e-6)), ("bilateral_uneven", (1.4e-2, 6e-5, 1.5e-6)),
    ("table", (4e-3, 4e-5, 4e-7))])
def test_motion_is_as_integrated(tmp_path, name, bounds):
    case = CASES[name]
    p = case["params"]
    if p["kind"] == "table":
        pairs = pairs_of_table(p["overclosure"], p["force"], p["gap"])
    else:
        pairs = [(1, p["gap"], p["kn"]), (-1, p["gap_2"], p["kn"])]
    for n_harmonics, bound in zip((3, 7, 15), bounds, strict=True):
        found = run_case(tmp_path, groups(p, pairs, n_harmonics))
        kept = 2 * min(n_harmonics, len(case["u1"]["xc"])) + 1
        u = coefficients_of(case["u1"], n_harmonics)[:kept]
        assert difference(found.coefficients[0][:kept, 0], u) < bound


def test_sliders_dissipate_what_their_loops_enclose(tmp_path):
    stiffness, limit = np.array([0.5, 0.3, 0.2]), np.array([0.1, 0.15, 0.2])
    case = groups({"m": 1.0, "c": 0.02, "k": 0.4, "F": 0.6, "F0": 0.0, "omega": 0.8},
                  [(0, 0.0, 0.0)] * 3, 15)
    case["contact"] = {"n_pairs": 3, "law": "penalty", "side_1": [1, 0, 0] * 3,
                       "tangential_stiffness": stiffness, "mu": 0.5, "normal_load": 2.0 * limit}
    found = run_case(tmp_path, case)
    loops = 4.0 * limit * (found.amplitude[0, 0] - limit / stiffness)
    # To the tolerance of the solver, with a margin of ten.
    assert found.dissipation[0] == pytest.approx(loops, rel=1e-8)
