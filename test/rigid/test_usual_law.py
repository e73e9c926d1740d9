"""The law of a case that names none, and what is said where another law is solved."""
import subprocess

import cases
import numpy as np
import pytest
from claims import spring_case
from project import PATIENT, PROGRAM
from rigid_cases import BOTH, TWO, groups, random_structure

#: One mass in two directions.
PLANAR = {
    "case": {"analysis": "point", "threads": 1},
    "model": {"n_dof": 2, "mass": np.eye(2), "stiffness": np.eye(2), "damping": 0.1 * np.eye(2)},
    "contact": {"n_pairs": 1, "side_1": [1, 2, 0], "mu": 1.0, "normal_load": 0.3},
    "load": {"cosine": [1.0, 0.3]}, "harmonics": {"n_harmonics": 5}, "sweep": {"start": 0.7}}
#: What asks for instants, with the sampling that `groups` sets taken out.
INSTANTS = [{"sampling": None, "n_time": 256}, {"sampling": "uniform"},
            {"sampling": None, "method": "tcm"}]


def solve(folder, case):
    """Every dataset, and the remarks by name."""
    cases.run(folder, case)
    result = cases.read(folder / "case.h5")
    names = [name.decode() for name in result.get("remarks/name", [])]
    return result, dict(zip(names, [text.decode() for text in result.get("remarks/text", [])]))


def with_law(case, law):
    """The case under a law; None: without a word."""
    return cases.merged(case, {"contact": {"law": law}})


def same(folder, case, law):
    """Whether no word gives the numbers of a law; the remarks of no word."""
    named, said = solve(folder, with_law(case, law))
    assert "law chosen" not in said
    result, remarks = solve(folder, with_law(case, None))
    assert f"'{law}'" in remarks["law chosen"]
    assert f"'{law}'" in result["attributes"]["namelist"].split("law = ")[1].split("\n")[0]
    return np.array_equal(result["coefficients"], named["coefficients"])


def test_a_sweep_gives_the_same_rows_in_both_directions(tmp_path):
    """Which modes follow the motion and which are springs is asked of the highest frequency, not of
    the first."""
    case = {"model": {"n_dof": 2, "mass": np.eye(2), "stiffness": [[2.0, -1.0], [-1.0, 2.0]],
                      "damping": 0.05 * np.eye(2)},
            "contact": {"n_pairs": 1, "side_1": [1, 0, 0], "mu": 0.5, "normal_load": 0.4},
            "load": {"cosine": [0.6, 0.3]}, "harmonics": {"n_harmonics": 3},
            "solver": {"tolerance": 1e-10}}
    rows = {}
    for name, ends in (("up", (0.3, 2.4)), ("down", (2.4, 0.3))):
        (tmp_path / name).mkdir()
        rows[name], _ = solve(tmp_path / name, case | {"sweep": dict(zip(
            ("start", "end", "n_points"), (*ends, 22)))})
        assert rows[name]["converged"].all()
    difference = np.abs(rows["up"]["amplitude"] - rows["down"]["amplitude"][::-1])
    assert difference.max() < 1e-7


@pytest.mark.parametrize("structure", [TWO, BOTH])
def test_events_take_the_law_of_high_order(tmp_path, structure):
    """Constant normal load, one direction: `rigid`, bit for bit, and not `dlft`."""
    case = groups(structure, "rigid", 5)
    assert same(tmp_path, case, "rigid")
    rigid, _ = solve(tmp_path, with_law(case, None))
    dlft, _ = solve(tmp_path, with_law(case, "dlft"))
    assert not np.allclose(rigid["coefficients"], dlft["coefficients"], rtol=1e-3)


@pytest.mark.parametrize("asked", INSTANTS)
def test_instants_keep_the_displacement_law(tmp_path, asked):
    """What `rigid` would refuse or not follow is solved as before, and said."""
    assert same(tmp_path, cases.merged(groups(TWO, "dlft", 5), {"harmonics": asked}), "dlft")


def test_two_directions_keep_the_displacement_law(tmp_path):
    """Slip in two directions has no law of high order."""
    assert same(tmp_path, PLANAR, "dlft")


def test_sessions_and_restarts_see_the_choice(tmp_path):
    """The effective input names the law, and gives the same run again without a remark."""
    first, _ = solve(tmp_path, with_law(groups(TWO, "dlft", 5), None))
    (tmp_path / "again.nml").write_text(first["attributes"]["namelist"])

    subprocess.run([PROGRAM, "-q", "again.nml", "--set", "output%file='again.h5'"], cwd=tmp_path,
                   check=True, env=PATIENT)
    again = cases.read(tmp_path / "again.h5")
    assert np.array_equal(again["coefficients"], first["coefficients"])


@pytest.mark.parametrize(("law", "sampling", "told"), [
    ("dlft", "events", True), ("dlft_velocity", "events", True), ("rigid", "events", False),
    ("dlft", "uniform", False), ("penalty", "events", False)])
def test_accuracy_says_which_law_it_solves(tmp_path, law, sampling, told):
    """The swap for the law whose error is known is remarked, and nothing else is."""
    constants = {"tangential_stiffness": 2.0} if law == "penalty" else {}
    case = cases.merged(groups(TWO, law, 1, **constants), {
        "harmonics": {"n_harmonics": 15, "accuracy": 1e-2, "sampling": sampling}})
    _, remarks = solve(tmp_path, case)
    assert ("law under accuracy" in remarks) == told
    if told:
        rigid, _ = solve(tmp_path, with_law(case, "rigid"))
        named, _ = solve(tmp_path, case)
        assert np.array_equal(rigid["coefficients"], named["coefficients"])


@pytest.mark.parametrize(("slip_speed", "told"), [(0.1, False), (0.002, True)])
def test_few_instants_are_remarked(tmp_path, slip_speed, told):
    """The number that is named suffices; an accuracy watches over the instants itself."""
    case = cases.merged(groups(TWO, "regularised", 5, slip_speed=slip_speed),
                        {"harmonics": {"sampling": None}})
    result, remarks = solve(tmp_path, case)
    assert ("few instants" in remarks) == told
    n_time = 8 * speed_of(result) / slip_speed
    assert (n_time > 256) == told
    if told:
        named = int(remarks["few instants"].split("n_time = ")[1].split()[0])
        # The velocity at the instants is at most the largest, and near it.
        assert 0.98 * n_time < named <= np.ceil(n_time)
        # The answer moves with the instants: a little more than named, for the speed moves too.
        finer, remarks = solve(tmp_path, cases.merged(case, {"harmonics": {"n_time": 2 * named}}))
        assert "few instants" not in remarks
        moved = np.abs(finer["coefficients"] - result["coefficients"]).max()
        assert moved > 1e-6 * np.abs(result["coefficients"]).max()
    _, remarks = solve(tmp_path, cases.merged(case, {"harmonics": {
        "n_harmonics": 9, "accuracy": 3e-2}}))
    assert "few instants" not in remarks


def speed_of(result):
    """Largest velocity of the dof that rubs, of the first point."""
    coefficients = result["coefficients"][0][:, next(iter(TWO.limit))]
    tau = 2 * np.pi * np.arange(8192) / 8192
    rate = np.zeros_like(tau)
    for n in range(1, (len(coefficients) + 1) // 2):
        a, b = coefficients[2 * n - 1:2 * n + 1]
        rate += n * (b * np.cos(n * tau) - a * np.sin(n * tau))
    return TWO.omega * np.abs(rate).max()


def test_nothing_is_said_of_springs(tmp_path):
    """A case without pairs has no law."""
    case, _ = spring_case(np.random.default_rng(3))
    _, remarks = solve(tmp_path, cases.merged(case, {"harmonics": {"n_harmonics": 5}}))
    assert not any("law" in name for name in remarks)


@pytest.mark.parametrize("seed", [4, 15])
def test_ripple_is_refused_around_a_disk(tmp_path, seed):
    """Sectors that nothing joins are the structure itself: what is no solution of one is none of
    the disk (seeds as in test_slip_gap)."""
    alone = groups(random_structure(seed), "dlft", 9)
    for case in (alone, alone | {"cyclic": {"n_sectors": 6, "engine_order": 1}}):
        cases.run(tmp_path, case, status=4)
        assert not cases.read(tmp_path / "case.h5")["converged"][0]
