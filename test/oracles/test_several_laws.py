"""Pairs of several laws in one case.

What two structures do that are not joined is what each does by itself, whatever laws their pairs
have; the order of the pairs does not matter; and joined ones are compared with an exact solution
(`test/reference/laws`: Jenkins' element, tanh, a stop and a cubic spring on two dofs) and by a
residual that shares no code.
"""
import itertools
import json

import h5py
import numpy as np
import pytest
from cases import run
from oracle_runs import run_case
from project import ROOT

import fretwear as fw

LAWS = ("dlft", "dlft_velocity", "penalty", "rigid", "regularised")
#: Solver tolerance of all runs, and what two runs of one problem may differ by: residuals of 1e-11
#: of the load times the condition of the structures (below 100), and a margin of ten.
TOLERANCE, WITHIN = 1e-11, 1e-8


def chain(seed, n=2):
    """Mass, damping and stiffness of masses in a row that stand on the ground."""
    random = np.random.default_rng(seed)
    k = random.uniform(0.8, 1.6, n + 1)
    stiffness = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    mass = np.diag(random.uniform(0.7, 1.3, n))
    return mass, 0.05 * mass + 0.03 * stiffness, stiffness


def joined(*matrices):
    """One structure of several that do not touch."""
    n = sum(len(m) for m in matrices)
    all_of = np.zeros((n, n))
    first = 0
    for m in matrices:
        all_of[first:first + len(m), first:first + len(m)] = m
        first += len(m)
    return all_of


def groups(structures, pairs, load, n_harmonics=7, **more):
    """A case: pairs are (law, dof of t1, of n, normal load); dofs from 1."""
    mass, damping, stiffness = (joined(*parts) for parts in zip(*structures, strict=True))
    contact = {
        "n_pairs": len(pairs), "law": [p[0] for p in pairs],
        "side_1": [dof for _, t, n, _ in pairs for dof in (t, 0, n)], "mu": 0.4,
        "normal_load": [p[3] for p in pairs],
    }
    laws = {p[0] for p in pairs}
    if laws & {"penalty", "regularised"}:
        contact["normal_stiffness"] = [3.0 * (n > 0) for _, _, n, _ in pairs]
    if "penalty" in laws:
        contact["tangential_stiffness"] = [1.0 * (t > 0) for _, t, _, _ in pairs]
    if "regularised" in laws:
        contact["slip_speed"] = 0.2
    if not any(p[2] == 0 for p in pairs):
        del contact["normal_load"]
    return {
        "case": {"title": "several laws", "analysis": "point"},
        "model": {"n_dof": len(mass), "mass": mass, "damping": damping, "stiffness": stiffness},
        "contact": contact,
        "load": load,
        "harmonics": {"n_harmonics": n_harmonics, "parity": "all", **more},
        "sweep": {"start": 0.8}, "solver": {"tolerance": TOLERANCE},
    }


def difference(found, wanted):
    return np.linalg.norm(found - wanted) / np.linalg.norm(wanted)


@pytest.mark.parametrize("sampling", ["events", "uniform"])
@pytest.mark.parametrize("laws", list(itertools.combinations(LAWS, 2)))
def test_two_structures_are_as_by_themselves(tmp_path, laws, sampling):
    if sampling == "events" and "regularised" in laws:
        sampling = "auto"
    if sampling == "uniform" and "rigid" in laws:
        pytest.skip("the law of high order follows events")
    more = {"sampling": sampling}
    if sampling != "events":
        more["n_time"] = 1024
    structures = [chain(1), chain(2)]
    loads = [{"cosine": [0.9, 0.0], "static": [0.0, 0.4]}, {"cosine": [0.3, 0.8]}]
    pairs = [[(laws[0], 1, 0, 0.7), (laws[0], 2, 0, 0.3)], [(laws[1], 1, 0, 0.6)]]
    for name in ("0", "1", "both"):
        (tmp_path / name).mkdir()
    alone = [run_case(tmp_path / str(k), groups([structures[k]], pairs[k], loads[k], **more))
             for k in range(2)]
    both = pairs[0] + [(law, t + 2, n, load) for law, t, n, load in pairs[1]]
    # Pairs of one law need not stand side by side.
    order = [0, 2, 1]
    together = run_case(tmp_path / "both", groups(
        structures, [both[i] for i in order],
        {"cosine": [0.9, 0.0, 0.3, 0.8], "static": [0.0, 0.4, 0.0, 0.0]}, **more))
    for k, columns in enumerate([[0, 1], [2, 3]]):
        assert difference(together.coefficients[0][:, columns], alone[k].coefficients[0]) < WITHIN
    force = np.concatenate([alone[0].force, alone[1].force], axis=2)[:, :, order]
    assert difference(together.force, force) < WITHIN


def mixed(seed, n_harmonics=5, **more):
    """Three masses in a row with rubbing, elastic, viscous and stopping pairs."""
    pairs = [("penalty", 1, 0, 0.6), ("dlft", 2, 0, 0.4), ("regularised", 3, 0, 0.5),
             ("penalty", 2, 3, 0.0)]
    case = groups([chain(seed, 3)], pairs, {"cosine": [1.0, 0.2, 0.0], "static": [0.0, 0.0, -0.3]},
                  n_harmonics, **more)
    case["contact"]["gap"] = [0.0, 0.0, 0.0, 0.2]
    return case


def permuted(case, order):
    """The same pairs in another order."""
    contact = dict(case["contact"])
    n = len(order)
    for name, values in case["contact"].items():
        if isinstance(values, list) and len(values) == n:
            contact[name] = [values[i] for i in order]
    contact["side_1"] = [d for i in order for d in case["contact"]["side_1"][3 * i:3 * i + 3]]
    return {**case, "contact": contact}


@pytest.mark.parametrize("linear", ["lu", "krylov"])
def test_order_of_pairs_and_linear_solver_do_not_matter(tmp_path, linear):
    case = mixed(3, n_time=512)
    case["solver"]["linear"] = linear
    order = [2, 3, 1, 0]
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    first = run_case(tmp_path / "a", case)
    second = run_case(tmp_path / "b", permuted(case, order))
    assert difference(second.coefficients, first.coefficients) < WITHIN
    assert difference(second.force, first.force[:, :, order]) < WITHIN


def test_one_word_is_one_for_each_pair(tmp_path):
    case = groups([chain(4)], [("penalty", 1, 0, 0.5), ("penalty", 2, 0, 0.4)],
                  {"cosine": [1.0, 0.0]})
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    each = run_case(tmp_path / "a", case)
    case["contact"]["law"] = "penalty"
    one = run_case(tmp_path / "b", case)
    assert np.array_equal(each.coefficients, one.coefficients)
    assert np.array_equal(each.force, one.force)


def test_the_result_says_which_law_a_pair_has(tmp_path):
    pairs = [("penalty", 1, 0, 0.5), ("dlft", 2, 0, 0.4)]
    run_case(tmp_path, groups([chain(4)], pairs, {"cosine": [1.0, 0.0]}))
    with h5py.File(tmp_path / "case.h5") as file:
        assert list(file["contact/law"].asstr()[:]) == ["penalty", "dlft"]


REFERENCE = json.loads((ROOT / "test" / "reference" / "laws" / "law_several.json").read_text())


def coefficients_of(quantity, n_harmonics):
    """0, c1, s1, ... of a quantity of the reference, as far as both know it."""
    row = np.zeros(2 * n_harmonics + 1)
    row[0] = quantity["x0"]
    for n in range(min(n_harmonics, len(quantity["xc"]))):
        row[2 * n + 1], row[2 * n + 2] = quantity["xc"][n], quantity["xs"][n]
    return row


def four_elements(p, n_harmonics):
    """Jenkins' element on dof 1, tanh between the dofs, two stops and a cubic spring on dof 2."""
    return {
        "case": {"title": "four elements", "analysis": "point"},
        "model": {"n_dof": 2, "mass": p["M"], "damping": p["C"], "stiffness": p["K"]},
        "contact": {
            "n_pairs": 4, "law": ["penalty", "regularised", "penalty", "penalty"],
            "side_1": [1, 0, 0, 1, 0, 0, 0, 0, 2, 0, 0, -2],
            "side_2": [0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0],
            "mu": [1.0, 1.0, 0.0, 0.0], "normal_load": [p["muN"], p["muN_2"], 0.0, 0.0],
            "gap": [0.0, 0.0, p["gap"], p["gap_2"]],
            "tangential_stiffness": [p["kt"], 0.0, 0.0, 0.0],
            "normal_stiffness": [0.0, 0.0, p["kn"], p["kn"]], "slip_speed": p["v0"],
        },
        "spring": {"n_springs": 1, "side_1": 2, "coefficient": p["cubic"], "power": 3},
        "load": {"cosine": [p["F"], 0.0]},
        "harmonics": {"n_harmonics": n_harmonics},
        "sweep": {"start": p["omega"]}, "solver": {"tolerance": 1e-10},
    }


# Relative errors at H = 3, 7 and 15, about twice what is measured. In case b Jenkins' element sticks
# where the integration left its slider, one of many positions of rest: a static load moves it there.
@pytest.mark.parametrize(("name", "bounds"), [
    ("a", (0.02, 3e-3, 4e-4)), ("b", (6e-3, 6e-4, 2e-4))])
def test_four_elements_are_as_integrated(tmp_path, name, bounds):
    case = REFERENCE["cases"][name]
    p = case["params"]
    for n_harmonics, bound in zip((3, 7, 15), bounds, strict=True):
        asked = four_elements(p, n_harmonics)
        if name == "b":
            asked["load"]["static"] = [p["kt"] * case["state_at_0"][-1], 0.0]
            asked["contact"]["normal_load"][0] = 10.0
        found = run_case(tmp_path, asked)
        kept = 2 * min(n_harmonics, len(case["u1"]["xc"])) + 1
        wanted = np.array([coefficients_of(case[u], n_harmonics)[:kept] for u in ("u1", "u2")]).T
        assert difference(found.coefficients[0][:kept], wanted) < bound
        works = np.array(case["work_per_cycle"][:2])
        assert difference(found.dissipation[0][:2], works) < bound


def test_events_stay_located_while_a_parameter_moves(tmp_path):
    """Beside a law without events, in a sweep over a stiffness: each point as by itself."""
    case = groups([chain(5)], [("penalty", 1, 0, 0.5), ("regularised", 2, 0, 0.4)],
                  {"cosine": [1.0, 0.3]}, n_harmonics=5)
    values = [0.6, 1.0, 1.7]
    swept = {**case, "case": {"title": "swept", "analysis": "frf"},
             "sweep": {"frequency": 0.8, "parameter": "contact%tangential_stiffness",
                       "as": "factor", "values": values}}
    for name in ("swept", *map(str, values)):
        (tmp_path / name).mkdir()
    found = run_case(tmp_path / "swept", swept)
    for k, value in enumerate(values):
        alone = {**case, "contact": {**case["contact"], "tangential_stiffness": [
            value * stiffness for stiffness in case["contact"]["tangential_stiffness"]]}}
        one = run_case(tmp_path / str(value), alone)
        assert difference(found.coefficients[k], one.coefficients[0]) < WITHIN


def test_derivatives_are_those_of_pairs_that_take_the_constant(tmp_path):
    """By differences; of pairs whose law has no stiffness it is exactly zero."""
    case = groups([chain(6, 3)], [("penalty", 1, 0, 0.4), ("dlft", 2, 0, 0.3),
                                  ("regularised", 3, 0, 0.3)],
                  {"cosine": [1.0, 0.4, -0.5]}, n_harmonics=5)
    case["contact"]["tangential_stiffness"] = [1.0, 0.7, 0.9]
    key = "contact%tangential_stiffness"
    for name in ("a", "b", "c"):
        (tmp_path / name).mkdir()
    run_case(tmp_path / "a", {**case, "sensitivity": {"parameters": key}})
    with h5py.File(tmp_path / "a" / "case.h5") as file:
        found = file["sensitivity/largest/contact_tangential_stiffness"][0].ravel()
    ends = []
    for name, step in (("b", 1e-4), ("c", -1e-4)):
        moved = {**case, "contact": {**case["contact"],
                                     "tangential_stiffness": [1.0 + step, 0.7, 0.9]}}
        ends.append(run_case(tmp_path / name, moved).amplitude[0, 0])
    # Differences of the second order, of solutions known to 1e-8.
    assert abs(found[0] - (ends[0] - ends[1]) / 2e-4) < 1e-3 * abs(found[0])
    assert found[1] == 0.0 and found[2] == 0.0


def test_an_elastic_pair_needs_a_stiffness_of_its_own(tmp_path):
    case = groups([chain(7)], [("penalty", 2, 0, 0.4), ("regularised", 2, 0, 0.3)],
                  {"cosine": [1.0, 0.4]})
    case["contact"]["tangential_stiffness"] = [0.0, 1.0]
    assert "= 0 for pair 1" in run(tmp_path, case, status=3).stderr


def model_of(case):
    """The pairs of a case in a model file, and what is left of the case."""
    contact, n = case["contact"], len(case["model"]["mass"])
    pairs = fw.ContactPairs(np.reshape(contact["side_1"], (-1, 3)), mu=contact["mu"],
                            normal_load=contact["normal_load"], law=contact["law"],
                            tangential_stiffness=contact["tangential_stiffness"],
                            slip_speed=contact["slip_speed"],
                            normal_stiffness=contact["normal_stiffness"])
    m = case["model"]
    model = fw.Model(m["mass"], m["damping"], m["stiffness"], contact=pairs)
    return model, {**{k: v for k, v in case.items() if k != "contact"},
                   "model": {"source": "hdf5", "file": "m.h5"}}, n


def test_a_model_file_says_the_law_of_each_pair(tmp_path):
    case = groups([chain(6, 3)], [("penalty", 1, 0, 0.4), ("regularised", 3, 0, 0.3)],
                  {"cosine": [1.0, 0.4, -0.5]}, n_harmonics=5)
    by_keys = run_case(tmp_path, case)
    model, rest, _ = model_of(case)
    model.save(tmp_path / "m.h5")
    of_file = run_case(tmp_path, rest)
    assert np.array_equal(of_file.coefficients, by_keys.coefficients)
    again = fw.Model.from_hdf5(tmp_path / "m.h5")
    assert list(again.contact.law) == ["penalty", "regularised"]
    in_memory = fw.run(fw.Case(again, **{k: v for k, v in rest.items() if k != "model"}))
    assert np.array_equal(in_memory.coefficients, by_keys.coefficients)
    with h5py.File(tmp_path / "m.h5", "r+") as file:
        file["contact"].attrs["law"] = "penalty"
    assert "stands beside /contact/law" in run(tmp_path, rest, status=3).stderr
    with h5py.File(tmp_path / "m.h5", "r+") as file:
        del file["contact"].attrs["law"]
        file["contact/law"][1] = "penalti"
    assert 'holds "penalti", expected' in run(tmp_path, rest, status=3).stderr
