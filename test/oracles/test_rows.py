"""Rows, displacements that are combinations of dofs: solutions known from elsewhere
(test/reference/bodies), rows that are dofs, and dofs turned by an angle."""
import json

import h5py
import numpy as np
import pytest
from cases import merged, run, with_model, write_parts
from oracle_runs import run_case
from project import ROOT

import fretwear as fw

FOLDER = ROOT / "test" / "reference" / "bodies"
#: Two runs of one problem: round-off of the condensation times the condition of the structures
#: (below 1e3), and a margin of ten.
SAME = 1e-11


def far(found, wanted):
    """Largest difference over the largest value."""
    found, wanted = np.asarray(found), np.asarray(wanted)
    return np.abs(found - wanted).max() / np.abs(wanted).max()


@pytest.mark.parametrize("name", ["v1_wedge_rows", "v2_wedge_wave", "v3_wedge_compliance"])
def test_reference(name, tmp_path):
    """A wedge between two blades, one in each sector of a wave, and one with nodes behind springs whose
    rigid pairs are assembled under tension, by an own harmonic balance in numpy."""
    oracle = json.loads((FOLDER / f"{name}.json").read_text())
    for number, point in enumerate(oracle["points"]):
        folder = tmp_path / str(number)
        folder.mkdir()
        found = run_case(folder, merged(oracle["groups"], {"sweep": {"start": point["omega"]}}))
        assert far(found.coefficients[0], point["u"]) < oracle["tolerance"]
        assert far(found.force[0], point["force"]) < oracle["tolerance"]


#: Two masses, each with two dofs, on springs, that rub and press.
MASS = np.diag([1.0, 1.0, 0.6, 0.6])
STIFFNESS = np.array([[900.0, 40.0, -90.0, 0.0], [40.0, 1500.0, 0.0, -60.0],
                      [-90.0, 0.0, 700.0, -30.0], [0.0, -60.0, -30.0, 1100.0]])


def chain(law="penalty", **sweep):
    constants = {"mu": 0.4, "tangential_stiffness": 300.0, "normal_stiffness": 500.0}
    if law != "penalty":
        # Less friction: nothing yields beside it.
        constants = {"mu": 0.05}
    return {
        "case": {"analysis": "frf"},
        "model": {"n_dof": 4, "mass": MASS.ravel(), "stiffness": STIFFNESS.ravel(),
                  "rayleigh_stiffness": 1e-3},
        "contact": {"n_pairs": 2, "law": law, "side_1": [1, 0, 2, 3, 0, -4],
                    "side_2": [3, 0, 4, 0, 0, 0], **constants},
        "spring": {"n_springs": 1, "side_1": 1, "side_2": -3, "coefficient": 20.0},
        "damper": {"n_dampers": 1, "side_1": -2, "coefficient": 0.3},
        "load": {"static": [0.0, -30.0, 0.0, 60.0], "cosine": [6.0, 0.0, 0.0, 1.0],
                 "n_terms": 2, "term_dof": [3, -2], "term_harmonic": [2, 0],
                 "term_amplitude": [0.8, 1.5], "term_phase": [20.0, 0.0]},
        "harmonics": {"n_harmonics": 5},
        "sweep": {"start": 20.0, "end": 40.0, "n_points": 5, **sweep},
        "solver": {"tolerance": 1e-12}, "output": {"observe": [1, 2, 3, 4]},
    }


def as_rows(groups, order=(1, 3, 0, 2)):
    """The same with every dof a row, in another order."""
    rows = np.eye(4)[list(order)]

    def of(numbers):
        numbers = np.asarray(numbers)
        row = {dof + 1: 5 + i for i, dof in enumerate(order)}
        return [int(np.sign(k)) * row.get(abs(int(k)), 0) for k in np.atleast_1d(numbers)]

    return merged(groups, {
        "model": {"n_rows": 4, "row": rows.ravel()},
        "contact": {"side_1": of(groups["contact"]["side_1"]),
                    "side_2": of(groups["contact"]["side_2"])},
        "spring": {"side_1": of(1), "side_2": of(-3)}, "damper": {"side_1": of(-2)},
        "load": {"term_dof": of([3, -2])}, "output": {"observe": [7, 5, "row4", 6]}})


@pytest.mark.parametrize("changes", [
    {}, {"law": "dlft"}, {"law": "rigid", "harmonics": {"n_harmonics": 7}},
    {"cyclic": {"n_sectors": 5, "engine_order": 2}, "contact": {"sector_2": [1, 0]}},
    {"cyclic": {"n_sectors": 3, "engine_order": 1, "mistuned": True}},
    {"case": {"analysis": "time"}, "sweep": {"start": 30.0, "n_points": 1, "end": None}},
    {"solver": {"kind": "pseudo_time"}, "sweep": {"start": 30.0, "end": 31.0, "n_points": 2}},
], ids=["plain", "dlft", "rigid", "wave", "sectors", "time", "pseudo time"])
def test_rows_that_are_dofs(changes, tmp_path):
    """Sides, springs, dampers, terms of loads and observed quantities by rows of one entry."""
    found = []
    plain = chain(changes.get("law", "penalty"))
    for name, groups in (("dofs", plain), ("rows", as_rows(plain))):
        groups = merged(groups, {key: keys for key, keys in changes.items() if key != "law"})
        (tmp_path / name).mkdir()
        run(tmp_path / name, groups)
        with h5py.File(tmp_path / name / "case.h5") as file:
            found.append({key: file[key][()] for key in ("coefficients", "contact/force")})
            names = [text.decode() for text in file["observed/name"][()]]
    if "mistuned" not in str(changes):
        assert names == ["row3", "row1", "row4", "row2"]
    for key, values in found[0].items():
        assert far(found[1][key], values) < (1e-9 if "time" in str(changes) else SAME), key


def turned(angle):
    """Both masses turned: u = T v, v the dofs of `chain`."""
    c, s = np.cos(angle), np.sin(angle)
    return np.kron(np.eye(2), [[c, -s], [s, c]])


@pytest.mark.parametrize("law", ["penalty", "rigid", "dlft"])
def test_dofs_turned_by_an_angle(law, tmp_path):
    """What rubs along dofs rubs along rows of dofs that are turned."""
    T = turned(0.7)
    plain = chain(law)
    plain["output"] = {}
    sides = merged(as_rows(plain, (0, 1, 2, 3)), {"output": {"observe": None}})
    rows = merged(sides, {
        "model": {"mass": (T @ MASS @ T.T).ravel(), "stiffness": (T @ STIFFNESS @ T.T).ravel(),
                  "row": T.T.ravel()},
        "load": {key: T @ plain["load"][key] for key in ("static", "cosine")}})
    found = []
    for name, groups in (("plain", plain), ("turned", rows)):
        (tmp_path / name).mkdir()
        found.append(run_case(tmp_path / name, groups))
    back = np.einsum("ij,pkj->pki", T.T, found[1].coefficients)
    assert far(back, found[0].coefficients) < 1e-9
    assert far(found[1].force, found[0].force) < 1e-9


def test_model_file_and_python(tmp_path):
    """/row/matrix and fw.Model(rows=) say what the keys say; a case may have rows of its own."""
    T = turned(0.4).T
    sides = {"contact/side_1": [[5, 0, 6], [7, 0, -8]], "contact/side_2": [[7, 0, 8], [0, 0, 0]]}
    constants = {"mu": 0.4, "tangential_stiffness": 300.0, "normal_stiffness": 500.0}
    loads = {"static": [0.0, -30.0, 0.0, 60.0], "cosine": [6.0, 0.0, 0.0, 1.0]}
    model = fw.Model(MASS, 1e-3 * STIFFNESS, STIFFNESS, rows=T, contact=fw.ContactPairs(
        *sides.values(), **{key: [value] * 2 for key, value in constants.items()}), **loads,
        observe={"x": 1, "t": 5})
    assert np.array_equal(model.rows, T) and np.array_equal(model.observe["t"], T[0])
    model.to_hdf5(tmp_path / "model.h5")
    again = fw.Model.from_hdf5(tmp_path / "model.h5")
    assert again.identity() == model.identity()
    case = {"harmonics": {"n_harmonics": 3}, "contact": {"law": "penalty"}}
    one, two = (fw.frf(m, 20.0, 40.0, 5, **case) for m in (model, again))
    assert np.array_equal(one["coefficients"], two["coefficients"])
    groups = {"case": {"analysis": "frf"}, "model": {}, **case,
              "sweep": {"start": 20.0, "end": 40.0, "n_points": 5}}
    (tmp_path / "own").mkdir()
    found = run_case(tmp_path, with_model(groups))
    assert far(found.coefficients, one["coefficients"]) < SAME
    # Other rows in the case.
    other = merged(groups, {"model": {"n_rows": 4, "row": np.eye(4).ravel()}})
    changed = run_case(tmp_path, with_model(other))
    assert far(changed.coefficients, one["coefficients"]) > 1e-3


def test_dependent_rows(tmp_path):
    """A rigid law is refused where rows depend on each other; an elastic one runs."""
    groups = merged(chain("rigid"), {
        "model": {"n_rows": 1, "row": [1.0, 0.0, -1.0, 0.0]},
        "contact": {"side_1": [1, 0, 2, 5, 0, -4]}})
    assert "compliance" in run(tmp_path, groups, status=3).stderr
    run(tmp_path, merged(groups, {"contact": {"law": "penalty", "tangential_stiffness": 300.0,
                                              "normal_stiffness": 500.0}}))


@pytest.mark.parametrize(("changes", "wanted"), [
    ({"model": {"n_rows": 1, "row": [0.0, 0.0, 0.0, 0.0]}}, ["row", "1", "zero"]),
    ({"model": {"n_rows": 2, "row": [1.0, 0.0, 0.0, 0.0]}}, ["row", "8"]),
    ({"model": {"row": [1.0, 0.0, 0.0, 0.0]}}, ["n_rows", "missing"]),
    ({"model": {"n_rows": 1}}, ["row", "missing"]),
    ({"model": {"n_rows": 1, "row": [1.0, 0.0, 0.0, "nan"]}}, ["row"]),
    ({"contact": {"side_1": [1, 0, 2, 5, 0, -4]}}, ["side_1", "5"]),
    ({"output": {"observe": [5]}}, ["observe", "5"]),
    ({"load": {"term_dof": [6, 1]}}, ["term_dof", "6"]),
    ({"model": {"n_rows": 1, "row": [1.0, 0.0, 0.0, 0.0]},
      "contact": {"side_1": [1, 0, 2, 5, 0, -4], "side_2": [3, 0, 4, 1, 0, 0]}},
     ["5", "same displacement"]),
])
def test_bad_rows(changes, wanted, tmp_path):
    message = run(tmp_path, merged(chain(), changes), status=3).stderr
    assert all(word in message for word in wanted), message


def test_bad_rows_of_a_file(tmp_path):
    write_parts(tmp_path / "model.h5", {
        "mass": MASS, "stiffness": STIFFNESS, "row/matrix": np.zeros((2, 4))})
    message = run(tmp_path, with_model({"sweep": {"start": 1.0}, "case": {"analysis": "point"}}),
                  status=3).stderr
    assert "row/matrix whose row 1 has no weight" in message
