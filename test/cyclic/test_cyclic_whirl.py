"""Coriolis forces and forces of the air on cyclic structures: against dense complex solves of the
whole annulus, with and without contact."""
import h5py
import numpy as np
import pytest
from annulus import Annulus, random_case
from cases import merged, run
from cyclic_cases import TIGHT, difference, read

import fretwear
from fretwear import Case, Model, Sectors

#: Complex solves of the whole annulus; conditioning near resonances takes the rest.
LINEAR = 1e-11
#: Of residuals, relative to the largest force: the solver leaves 1e-12 of the load.
BALANCED = 1e-9
OMEGAS = [0.6, 1.1, 1.7]
SPEED = 1.3


def whirling(seed, *, air="sector", speed=SPEED, n_harmonics=3, law="penalty", **options):
    """A random sector with a Coriolis matrix and forces of the air on two rows."""
    rng = np.random.default_rng([71, seed])
    case = random_case(rng, law=law, **options) | {"n_harmonics": n_harmonics}
    n, size = len(case["model"]["mass"]), case["n_sectors"]
    g = 0.1 * rng.normal(size=(n, n))
    case["coriolis"], case["speed"] = g - g.T, speed
    if air is None:
        return case
    inner = slice(2 * len(case["model"]["right"]), n - 4 * len(case["contact"]["mu"]))
    rows = np.zeros((2, n))
    rows[:, inner] = rng.normal(size=rows[:, inner].shape)
    numbers = range(-1, 2) if air == "sector" else range(-((size - 1) // 2), size // 2 + 1)
    case["air"] = {"by": air, "modes": rows, "matrix": {
        k: 0.03 * (rng.normal(size=(2, 2)) + 1j * rng.normal(size=(2, 2))) for k in numbers}}
    return case


def write_sector(path, case):
    """A model file of the sector."""
    model = case["model"]
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "fretwear-model", 1
        for name in ("mass", "stiffness", "damping"):
            file[name] = np.array(model[name])
        file["coriolis"] = case["coriolis"]
        file.create_group("cyclic").attrs["n_sectors"] = case["n_sectors"]
        if len(model["left"]) > 0:
            file["cyclic/left"], file["cyclic/right"] = model["left"], model["right"]
        for name, values in case["load"].items():
            file[f"load/{name}"] = values
        if "air" in case:
            file["aero/modes"] = case["air"]["modes"]
            for k, q in case["air"]["matrix"].items():
                file[f"aero/{case['air']['by']}/{k}"] = np.stack([q.real, q.imag], axis=-1)


def groups_of(sector, **changes):
    groups = {
        "model": {"source": "hdf5", "file": "model.h5", "rotation_speed": sector["speed"]},
        "cyclic": {"engine_order": sector["engine_order"]},
        "harmonics": {"n_harmonics": sector["n_harmonics"], "sampling": "events"},
        "sweep": {"values": OMEGAS}, "solver": {"tolerance": TIGHT}}
    if sector.get("contact"):
        groups["contact"] = {"n_pairs": len(sector["contact"]["mu"]), "law": sector["law"],
                             **sector["contact"]}
    return merged(groups, changes)


def solve(tmp_path, sector, status=0, **changes):
    write_sector(tmp_path / "model.h5", sector)
    done = run(tmp_path, groups_of(sector, **changes), status=status)
    return read(tmp_path / "case.h5") if status == 0 else done.stderr


def modes_of(folder, sector, n_modes):
    """Natural frequencies of all waves."""
    write_sector(folder / "model.h5", sector)
    groups = groups_of(sector, case={"analysis": "modes"},
                       cyclic={"engine_order": None, "n_modes": n_modes})
    run(folder, {name: groups[name] for name in ("case", "model", "cyclic", "contact")})
    return read(folder / "case.h5")


class Whole:
    """Matrices of all sectors, put together sector by sector."""

    def __init__(self, case):
        self.case, self.annulus = case, Annulus(case)
        self.maps, self.n = self.annulus.maps, case["n_sectors"]
        model = case["model"]
        self.m, self.k, self.c = (self.sum(np.array(model[name]))
                                  for name in ("mass", "stiffness", "damping"))
        self.g = case["speed"] * self.sum(case["coriolis"])

    def sum(self, matrix):
        return sum(t.T @ matrix @ t for t in self.maps)

    def air(self, harmonic):
        """Force of the air over motion: by sectors directly, by nodal diameters through those."""
        q = np.zeros_like(self.m, dtype=complex)
        if "air" not in self.case or harmonic == 0:
            return q
        air = self.case["air"]
        by_sector = air["matrix"]
        if air["by"] != "sector":
            by_sector = {j: sum(matrix * np.exp(2j * np.pi * k * j / self.n)
                                for k, matrix in air["matrix"].items()) / self.n
                         for j in range(self.n)}
        for j, t in enumerate(self.maps):
            for shift, matrix in by_sector.items():
                other = self.maps[(j + shift) % self.n]
                q += (air["modes"] @ t).T @ matrix @ (air["modes"] @ other)
        return q

    def stiffness(self, n, omega):
        w = n * omega
        return self.k - w**2 * self.m + 1j * w * (self.c + self.g) - self.air(n)

    def load(self, n):
        load = {key: np.array(values) for key, values in self.case["load"].items()}
        phase = 2.0 * np.pi * self.case["engine_order"] / self.n
        force = {0: load["static"] + 0j, 1: load["cosine"] - 1j * load["sine"]}.get(
            n, 0j * load["static"])
        return sum(t.T @ (force * np.exp(-1j * j * n * phase)) for j, t in enumerate(self.maps))

    def contact(self, row, n):
        """Forces of all pairs on all dofs, from those of the pairs of sector 0 (2H+1, pairs, 3)."""
        phase = 2.0 * np.pi * self.case["engine_order"] / self.n
        force = amplitude(row, n)
        total = np.zeros(len(self.m), complex)
        pairs = self.case["contact"]
        for j in range(self.n):
            turn = np.exp(-1j * j * n * phase)
            for pair in range(len(pairs["mu"])):
                for side, sign, sector in (("side_1", 1, j), (
                        "side_2", -1, j + pairs["sector_2"][pair])):
                    for direction, dof in enumerate(pairs[side][pair]):
                        if dof == 0:
                            continue
                        d = self.annulus.dof(sector, dof)
                        total[abs(d) - 1] += (np.sign(d) * sign * turn * force[pair, direction])
        return total


def amplitude(row, n):
    return row[0].astype(complex) if n == 0 else row[2 * n - 1] - 1j * row[2 * n]


def around(whole, coefficients, n):
    """Motion of all dofs of the annulus from that of sector 0."""
    phase = 2.0 * np.pi * whole.case["engine_order"] / whole.n
    u = amplitude(coefficients, n)
    motion = np.zeros(len(whole.m), complex)
    for j, t in enumerate(whole.maps):
        here = np.abs(t).argmax(axis=1)
        motion[here] = u * t[range(len(t)), here] * np.exp(-1j * j * n * phase)
    return motion


@pytest.mark.parametrize("air", [None, "sector", "nodal_diameter"])
@pytest.mark.parametrize("seed", range(5))
def test_linear_response_of_the_annulus(tmp_path, seed, air):
    case = whirling(seed, air=air)
    free = case | {"contact": {}}
    found = solve(tmp_path, free)
    whole = Whole(case | {"contact": {"side_1": [], "side_2": [], "sector_2": []}})
    for omega, row in zip(OMEGAS, found["coefficients"]):
        for n in (0, 1):
            u = np.linalg.solve(whole.stiffness(n, omega), whole.load(n))
            assert np.abs(amplitude(row, n) - whole.maps[0] @ u).max() < LINEAR * np.abs(u).max()


@pytest.mark.parametrize("mistuned", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_linear_response_with_matrices_of_any_shape(tmp_path, seed, mistuned):
    """Hysteretic damping and unsymmetric matrices of a sector, as a wave and of all sectors."""
    case = whirling(seed, air="sector", n_sectors=5, n_pairs=1) | {"contact": {}}
    rng, n = np.random.default_rng([72, seed]), len(case["model"]["mass"])
    whole = Whole(case | {"contact": {"side_1": [], "side_2": [], "sector_2": []}})
    root = rng.normal(size=(n, n))
    parts = {"structural_damping": 0.01 * root @ root.T,
             "stiffness_unsymmetric": 0.05 * rng.normal(size=(n, n)),
             "damping_unsymmetric": 0.01 * rng.normal(size=(n, n)),
             "circulatory": 0.05 * rng.normal(size=(n, n))}
    write_sector(tmp_path / "model.h5", case)
    with h5py.File(tmp_path / "model.h5", "r+") as file:
        for name, matrix in parts.items():
            file[name] = matrix
    changes = {"model": {"loss_factor": 0.03}}
    if mistuned:
        changes["cyclic"] = {"mistuned": True}
    run(tmp_path, groups_of(case, **changes))
    found = read(tmp_path / "case.h5")
    skew = whole.sum(parts["stiffness_unsymmetric"] + case["speed"] * parts["circulatory"])
    d = whole.sum(parts["structural_damping"] + 0.03 * np.array(case["model"]["stiffness"]))
    for i, (omega, row) in enumerate(zip(OMEGAS, found["coefficients"])):
        work = 0.0
        for h in (0, 1):
            z = whole.stiffness(h, omega) + skew
            if h > 0:
                z = z + 1j * d + 1j * omega * whole.sum(parts["damping_unsymmetric"])
            u = np.linalg.solve(z, whole.load(h))
            wanted = whole.maps[0] @ u
            here = amplitude(row, h)[:len(wanted)]
            assert np.abs(here - wanted).max() < LINEAR * np.abs(u).max()
            work += h * np.pi * (u.conj() @ d @ u).real / whole.n
        if not mistuned:
            assert found["structural/dissipation"][i] == pytest.approx(work, rel=1e-9)


@pytest.mark.parametrize("air", [None, "sector", "nodal_diameter"])
@pytest.mark.parametrize("law", ["penalty", "dlft"])
@pytest.mark.parametrize("seed", range(3))
def test_balance_of_the_annulus_with_contact(tmp_path, seed, law, air):
    """In every harmonic the loads of all sectors are those of structure, air and contact."""
    case = whirling(seed, air=air, law=law)
    found = solve(tmp_path, case)
    whole = Whole(case)
    assert np.abs(found["contact/force"]).max() > 0.0
    for omega, row, force in zip(OMEGAS, found["coefficients"], found["contact/force"]):
        for n in range(case["n_harmonics"] + 1):
            z, u = whole.stiffness(n, omega), around(whole, row, n)
            left = z @ u + whole.contact(force, n) - whole.load(n)
            assert np.abs(left).max() < BALANCED * max(np.abs(whole.load(1)).max(), 1e-3)


def roots_of(whole, held=None):
    """Roots with a frequency above 0 of the annulus, by its companion matrix."""
    m, d, k = whole.m, whole.c + whole.g, whole.k - whole.air(1)
    if held is not None:
        k = k + held
    n = len(m)
    companion = np.block([[np.zeros((n, n)), np.eye(n)],
                          [-np.linalg.solve(m, k), -np.linalg.solve(m, d)]])
    root = np.linalg.eigvals(companion)
    return root[root.imag > 1e-9]


def springs_of(case, whole):
    """Closed elastic pairs of all sectors."""
    total, pairs = np.zeros_like(whole.k), case["contact"]
    for j in range(whole.n):
        for pair in range(len(pairs["mu"])):
            for direction, key in ((0, "tangential_stiffness"), (2, "normal_stiffness")):
                row = np.zeros(len(total))
                for side, sign, sector in (("side_1", 1, j), (
                        "side_2", -1, j + pairs["sector_2"][pair])):
                    dof = whole.annulus.dof(sector, pairs[side][pair][direction])
                    row[abs(dof) - 1] += sign * np.sign(dof)
                total += pairs[key][pair] * np.outer(row, row)
    return total


@pytest.mark.parametrize("air", [None, "sector", "nodal_diameter"])
@pytest.mark.parametrize("seed", range(3))
def test_modes_of_the_annulus(tmp_path, seed, air):
    """Frequencies and damping of waves in both directions are the roots of the annulus."""
    case = whirling(seed, air=air)
    found = modes_of(tmp_path, case, 100)
    n = case["n_sectors"]
    assert found["modes/nodal_diameter"].tolist() == list(range(-((n - 1) // 2), n // 2 + 1))
    whole = Whole(case)
    for name, held in (("open", None), ("closed", springs_of(case, whole))):
        omega, ratio = found[f"modes/{name}"], found[f"modes/{name}_damping"]
        there = np.isfinite(omega)
        ours = omega[there] * (1j - ratio[there] / np.sqrt(1.0 - ratio[there] ** 2))
        exact = roots_of(whole, held)
        assert len(ours) == len(exact)
        nearest = np.abs(ours[:, None] - exact[None, :]).min(axis=0)
        # Roots of a matrix that is not normal: round-off times the condition of each.
        assert nearest.max() < 1e-9 * np.abs(exact).max()
    # Waves the two ways have different frequencies.
    forward, backward = (omega[list(found["modes/nodal_diameter"]).index(k)] for k in (1, -1))
    assert np.abs(forward - backward)[0] > 1e-3 * forward[0]


def test_speed_turned_is_the_other_way(tmp_path):
    """The same waves with G of the other sign and the engine order of the other one, mirrored in
    time: frequencies of k become those of -k."""
    case = whirling(7, air=None)
    other = case | {"coriolis": -case["coriolis"]}
    found = []
    for name, which in (("one", case), ("other", other)):
        (tmp_path / name).mkdir()
        found.append(modes_of(tmp_path / name, which, 5))
    ks = list(found[0]["modes/nodal_diameter"])
    for k in ks:
        if -k in ks:
            a, b = found[0]["modes/open"][ks.index(k)], found[1]["modes/open"][ks.index(-k)]
            assert np.allclose(a, b, rtol=1e-9, equal_nan=True)


def test_without_speed_there_are_no_coriolis_forces(tmp_path):
    case = whirling(8, air=None, speed=0.0)
    still = solve(tmp_path, case)
    with h5py.File(tmp_path / "model.h5", "a") as file:
        del file["coriolis"]
    run(tmp_path, groups_of(case))
    assert np.array_equal(still["coefficients"], read(tmp_path / "case.h5")["coefficients"])


def test_work_of_coriolis_forces_vanishes(tmp_path):
    """Loads pay for damping and friction alone."""
    case = whirling(9, air=None)
    found = solve(tmp_path, case)
    damping = np.array(case["model"]["damping"])
    force = np.array(case["load"]["cosine"]) - 1j * np.array(case["load"]["sine"])
    for row, omega, dissipation in zip(found["coefficients"], OMEGAS,
                                       found["contact/dissipation"]):
        work = np.pi * (np.conj(1j * amplitude(row, 1)) @ force).real
        loss = sum(n**2 * np.pi * omega * (np.conj(amplitude(row, n)) @ damping
                                           @ amplitude(row, n)).real for n in (1, 2, 3))
        assert work == pytest.approx(loss + dissipation.sum(), rel=1e-8)


@pytest.mark.parametrize("air", [None, "sector"])
def test_branch_follows_the_sweep(tmp_path, air):
    """Points of an arc-length branch, which takes the derivative by frequency."""
    case = whirling(1, air=air)
    branch = solve(tmp_path, case, sweep={"values": None, "start": 0.8, "end": 1.2,
                                          "continuation": "arclength"})
    assert branch["converged"].all() and len(branch["omega"]) > 3
    sweep = solve(tmp_path, case, sweep={"values": branch["omega"].tolist()})
    assert difference(branch["coefficients"], sweep["coefficients"]) < 1e-6


@pytest.mark.parametrize("linear", ["lu", "krylov"])
def test_solvers_of_the_step_agree(tmp_path, linear):
    case = whirling(2)
    (tmp_path / "usual").mkdir()
    usual = solve(tmp_path / "usual", case)
    found = solve(tmp_path, case, solver={"linear": linear})
    assert difference(found["coefficients"], usual["coefficients"]) < 1e-10


def test_undamped_sector(tmp_path):
    """Internal modes without damping are coordinates, wherever Coriolis forces move them."""
    case = whirling(3, air=None)
    case["model"] = case["model"] | {"damping": np.zeros_like(case["model"]["damping"])}
    found = solve(tmp_path, case, status=0)
    whole = Whole(case)
    for omega, row, force in zip(OMEGAS, found["coefficients"], found["contact/force"]):
        for n in range(case["n_harmonics"] + 1):
            z, u = whole.stiffness(n, omega), around(whole, row, n)
            left = z @ u + whole.contact(force, n) - whole.load(n)
            assert np.abs(left).max() < 1e-8 * np.abs(whole.load(1)).max()


def test_negative_damping_of_the_air(tmp_path):
    """Flutter is told by analysis 'modes', and friction bounds the response."""
    case = whirling(4, air="sector")
    case["air"]["matrix"] = {0: 0.3j * np.eye(2)}
    found = modes_of(tmp_path, case, 30)
    lowest = np.nanmin(found["modes/open_damping"])
    assert lowest < 0.0
    assert np.nanmin(roots_of(Whole(case)).real * -1.0) < 0.0
    solve(tmp_path, case)


def test_one_sector_is_a_plain_structure(tmp_path):
    """A structure that is no sector: its complex solves."""
    case = whirling(5, air=None, n_sectors=1, engine_order=0) | {"contact": {}}
    case["model"] = case["model"] | {"left": [], "right": []}
    found = solve(tmp_path, case)
    k, m, c = (np.array(case["model"][name]) for name in ("stiffness", "mass", "damping"))
    force = np.array(case["load"]["cosine"]) - 1j * np.array(case["load"]["sine"])
    for omega, row in zip(OMEGAS, found["coefficients"]):
        z = k - omega**2 * m + 1j * omega * (c + case["speed"] * case["coriolis"])
        exact = np.linalg.solve(z, force)
        assert np.abs(amplitude(row, 1) - exact).max() < LINEAR * np.abs(exact).max()


@pytest.mark.parametrize(("spoil", "words"), [
    (lambda case: case["coriolis"].__setitem__((0, 1), 9.0), ["coriolis", "skew"]),
    (lambda case: case["air"].__setitem__("by", "blade"),
     ["/aero/blade", "sector, nodal_diameter"]),
    (lambda case: case["air"].__setitem__("modes", np.zeros((3, 2))), ["/aero/modes", "shape"]),
    (lambda case: case["air"]["matrix"].__setitem__(1, np.zeros((2, 3))), ["square"]),
    (lambda case: case["air"]["matrix"].__setitem__(case["n_sectors"] - 1, np.eye(2)),
     ["the same"]),
    (lambda case: case["air"]["matrix"].__setitem__(1, np.full((2, 2), np.nan)), ["finite"]),
])
def test_refusals(tmp_path, spoil, words):
    case = whirling(6)
    spoil(case)
    message = solve(tmp_path, case, status=3)
    for word in words:
        assert word in message


@pytest.mark.parametrize("name", ["aero/frequency", "aero/matrix"])
def test_air_over_frequency_is_refused(tmp_path, name):
    case = whirling(6)
    write_sector(tmp_path / "model.h5", case)
    with h5py.File(tmp_path / "model.h5", "a") as file:
        file[name] = np.ones(2)
    done = run(tmp_path, groups_of(case), status=3)
    assert f"/{name}" in done.stderr and "do not depend on frequency" in done.stderr
    with pytest.raises(fretwear.InputError, match="do not depend on frequency"):
        Model.from_hdf5(tmp_path / "model.h5")


def test_a_nodal_diameter_that_is_missing(tmp_path):
    case = whirling(6, air="nodal_diameter", n_sectors=7, engine_order=2)
    del case["air"]["matrix"][-3]
    message = solve(tmp_path, case, status=3)
    assert "harmonic 2" in message and "/aero/nodal_diameter/-3" in message


def test_model_in_memory(tmp_path):
    """The Coriolis matrix of a Model, whose order of rows matters, and its file."""
    case = whirling(5, air=None) | {"contact": {}}
    expected = solve(tmp_path, case)["coefficients"]
    model = case["model"]
    given = Model(model["mass"], model["damping"], model["stiffness"], coriolis=case["coriolis"],
                  sectors=Sectors(case["n_sectors"], model["left"], model["right"]),
                  **case["load"])
    given.to_hdf5(tmp_path / "again.h5")
    for which in (given, Model.from_hdf5(tmp_path / "again.h5"), tmp_path / "again.h5"):
        found = fretwear.run(Case(
            which, structure={"rotation_speed": case["speed"]},
            cyclic={"engine_order": case["engine_order"]},
            harmonics={"n_harmonics": case["n_harmonics"]}, sweep={"values": OMEGAS}))
        assert difference(found.coefficients, expected) < LINEAR
