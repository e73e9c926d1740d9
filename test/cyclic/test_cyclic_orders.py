"""Loads in several harmonics: engine orders of one disturbance at rest, its revolution the
period."""
import numpy as np
import pytest
from annulus import Annulus, random_case
from cases import run
from cyclic_cases import TIGHT, difference, model_groups, read, run_at
from nodal_file import tied, write_nodal_file

#: Both are solved to residuals of 1e-12; conditioning near resonances takes the rest.
EQUAL = 1e-9
#: Solutions of the same equations, to residuals of 1e-12.
SAME = 1e-10
OMEGAS = [0.4, 0.9]


def some_orders(seed, orders, **options):
    """A sector under loads in these harmonics of the revolution, engine order 1."""
    rng = np.random.default_rng([43, seed])
    options = {"engine_order": int(rng.choice([-1, 1])), **options}
    case = random_case(rng, **options)
    n = len(case["model"]["mass"])
    first = n - 4 * len(case["contact"]["mu"])
    case["load"]["cosine"] = case["load"]["sine"] = [0.0] * n
    case["waves"] = {
        order: np.concatenate([0.15 * (rng.normal(size=first) + 1j * rng.normal(size=first)),
                               np.zeros(n - first)]) for order in orders}
    return case | {"n_harmonics": max(orders) + 2}


def run_both(tmp_path, first, second, **options):
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
    return (run_at(tmp_path / "first", first, OMEGAS, status=(0, 4), **options),
            run_at(tmp_path / "second", second, OMEGAS, status=(0, 4), **options))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("law", ["penalty", "dlft"])
@pytest.mark.parametrize("orders", [(2, 3), (1, 3, 4)])
def test_orders_at_rest_in_the_annulus(tmp_path, law, seed, orders):
    case = some_orders(seed, orders, law=law, n_sectors=[5, 6, 7][seed % 3], n_pairs=1)
    annulus = Annulus(case)
    sector, whole = run_both(tmp_path, case, annulus.case)
    solved = sector["converged"].astype(bool)
    assert np.array_equal(solved, whole["converged"].astype(bool)) and solved.any()
    assert difference(sector["coefficients"][solved],
                      annulus.sector(whole["coefficients"][solved])) < EQUAL
    assert difference(sector["contact/force"][solved],
                      whole["contact/force"][solved, :, :1]) < EQUAL


def test_several_orders_are_not_one(tmp_path):
    """What the annulus is compared with depends on every order."""
    case = some_orders(1, (1, 3), law="penalty", n_sectors=7, n_pairs=1)
    other = case | {"waves": {1: case["waves"][1], 3: case["waves"][3].conj()}}
    a, b = run_both(tmp_path, case, other)
    assert difference(a["coefficients"], b["coefficients"]) > 1e-2


def test_a_wave_of_one_order_at_both_periods(tmp_path):
    """Order 3 alone: harmonic 3 of the revolution, or harmonic 1 of a third of it."""
    case = some_orders(2, (3,), law="penalty", n_sectors=7, engine_order=1) | {"n_harmonics": 9}
    single = dict(case)
    force = single.pop("waves")[3]
    single |= {"engine_order": 3 * case["engine_order"], "n_harmonics": 3,
               "load": case["load"] | {"cosine": force.real.tolist(),
                                       "sine": (-force.imag).tolist()}}
    for name in ("orders", "one"):
        (tmp_path / name).mkdir()
    a = run_at(tmp_path / "orders", case, OMEGAS)
    b = run_at(tmp_path / "one", single, 3 * np.array(OMEGAS))
    assert difference(a["coefficients"][:, [0, 5, 6, 11, 12, 17, 18]], b["coefficients"]) < SAME


def test_work_of_all_orders_is_dissipated(tmp_path):
    case = some_orders(3, (1, 2, 4), law="penalty", n_sectors=6)
    found = run_at(tmp_path, case, OMEGAS)
    damping = np.array(case["model"]["damping"])
    for row, omega, dissipation in zip(found["coefficients"], OMEGAS,
                                       found["contact/dissipation"]):
        work = loss = 0.0
        for n in range(1, case["n_harmonics"] + 1):
            u = row[2 * n - 1] - 1j * row[2 * n]
            force = case["waves"].get(n, 0.0 * u)
            work += n * np.pi * (np.conj(1j * u) @ force).real
            loss += n**2 * np.pi * omega * (np.conj(u) @ damping @ u).real
        assert work == pytest.approx(loss + dissipation.sum(), rel=1e-8)


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_matrices_of_nodal_diameters(tmp_path, scale):
    """Loads of other harmonics than the first act on the displacements in front."""
    case = some_orders(4, (1, 2), law="dlft", n_sectors=6, n_pairs=1)
    n = len(case["model"]["mass"])
    diameters = {}
    for k in range(case["n_sectors"] // 2 + 1):
        diameters[k], kept = tied(case, k)
    # A right interface is no coordinate there.
    inside = np.isin(np.arange(n), kept)
    case["waves"] = {order: np.where(inside, force, 0.0) for order, force in case["waves"].items()}
    place = {i + 1: p + 1 for p, i in enumerate(kept)}
    contact = {name: [[int(np.sign(d)) * place[abs(d)] if d else 0 for d in side]
                      for side in case["contact"][name]] for name in ("side_1", "side_2")}
    contact |= {name: case["contact"][name] for name in ("sector_2", "mu", "gap")}
    rows = np.array([case["waves"][order][kept] for order in (1, 2)])
    write_nodal_file(tmp_path / "model.h5", case["n_sectors"], len(kept), diameters,
                     contact=contact, observe=[f"u{i + 1}" for i in range(n)],
                     load={"harmonic": [1, 2], "harmonic_cosine": rows.real,
                           "harmonic_sine": -rows.imag})
    (tmp_path / "sector").mkdir()
    scaled = case | {"load": case["load"] | {"harmonic_scale": scale}}
    sector = run_at(tmp_path / "sector", scaled, OMEGAS)
    run(tmp_path, {"model": {"source": "hdf5", "file": "model.h5"},
                   "load": {"harmonic_scale": scale}, "contact": {"law": "dlft"},
                   "cyclic": {"engine_order": case["engine_order"]},
                   "harmonics": {"n_harmonics": case["n_harmonics"], "sampling": "events"},
                   "sweep": {"values": OMEGAS}, "solver": {"tolerance": TIGHT}})
    found = read(tmp_path / "case.h5")
    assert difference(found["coefficients"], sector["coefficients"]) < SAME
    assert difference(found["contact/force"], sector["contact/force"]) < SAME


def test_orders_name_the_frequency_of_the_sweep(tmp_path):
    """Orders 4 and 6 of the speed are harmonics 2 and 3 of twice the speed."""
    case = some_orders(5, (2, 3), law="penalty", n_sectors=7, n_pairs=1)
    case["engine_order"] = 2 * case["engine_order"]
    groups = model_groups(case) | {
        "harmonics": {"n_harmonics": 5}, "sweep": {"values": OMEGAS},
        "solver": {"tolerance": TIGHT}}
    by_order = groups | {"load": {**groups["load"]}}
    harmonics = by_order["load"].pop("term_harmonic")
    by_order["load"]["term_order"] = [2 * n for n in harmonics]
    found = []
    for name, which in (("harmonics", groups), ("orders", by_order)):
        (tmp_path / name).mkdir()
        run(tmp_path / name, which)
        found.append(read(tmp_path / name / "case.h5")["coefficients"])
    assert np.array_equal(*found)
    by_order["cyclic"] = by_order["cyclic"] | {"engine_order": 3}
    done = run(tmp_path, by_order, status=3)
    assert "engine_order" in done.stderr and "2 or -2" in done.stderr
