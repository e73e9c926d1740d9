"""Sectors in the memory of the calling program give the bits of the same model in a file: through
Python, C and Fortran 77, as matrices of a sector and of every nodal diameter."""
import ctypes

import h5py
import numpy as np
import pytest
from annulus import random_case
from nodal_file import tied
from project import BUILD

import fretwear as fw

OMEGAS = [0.8, 1.7]
WANTED = ("coefficients", "contact/force")
#: Residuals of 1e-12 times the condition of these sectors.
SAME = 1e-9
AIR = {-1: [[0.02 + 0.01j]], 0: [[-0.05j]], 1: [[0.01 - 0.02j]]}


def pairs_of(case, place=None):
    """Contact pairs, their dofs at new places where these are given."""
    found = dict(case["contact"])
    if place is not None:
        for side in ("side_1", "side_2"):
            found[side] = [[int(np.sign(d)) * place[abs(d)] if d else 0 for d in row]
                           for row in found[side]]
    return fw.ContactPairs(**found)


def skew(n):
    g = np.arange(n * n).reshape(n, n) / n**2
    return 0.1 * (g - g.T)


def sector_model(case):
    """Kind (a): matrices of the sector, with forces of Coriolis and of the air."""
    parts, n = case["model"], len(case["model"]["mass"])
    return fw.Model(
        parts["mass"], parts["damping"], parts["stiffness"], contact=pairs_of(case),
        coriolis=skew(n), **case["load"],
        sectors=fw.Sectors(case["n_sectors"], parts["left"], parts["right"], air=fw.Air(
            by_sector=AIR, modes=[np.eye(n)[-1]])))


def nodal_model(case, observed):
    """Kind (b): an inner displacement stands last as another, complex coordinate, and is none of
    those in front."""
    n_sectors, interface = case["n_sectors"], len(case["model"]["left"])
    whirl = {**case, "model": {**case["model"], "mass": skew(len(case["model"]["mass"]))}}
    diameters = {}
    for k in range(n_sectors // 2 + 1):
        parts, kept = tied(case, k)
        inner = kept.index(2 * interface)
        order = [i for i in range(len(kept)) if i != inner] + [inner]
        turn = np.eye(len(kept), dtype=complex)[:, order]
        turn[inner, -1] = 2.0 + (0.5j if 0 < 2 * k < n_sectors else 0.0)

        def turned(matrix, turn=turn):
            return turn.conj().T @ matrix @ turn

        diameters[k] = fw.NodalDiameter(
            turned(parts["mass"]), turned(parts["stiffness"]), turned(parts["damping"]),
            coriolis=turned(tied(whirl, k)[0]["mass"]),
            **{item: turn.conj().T @ parts[f"load/{item}"] for item in case["load"]},
            observe={f"u{i + 1}": row for i, row in enumerate(parts["observe/matrix"] @ turn)}
            if observed else None)
    n = len(kept) - 1
    place = {kept[i] + 1: p + 1 for p, i in enumerate(order)}
    return fw.Model(None, None, None, contact=pairs_of(case, place), sectors=fw.Sectors(
        n_sectors, diameters=diameters, n_physical=n,
        air=fw.Air(by_diameter={k: [[0.01 * k - 0.03j]] for k in (0, 2, -1, 1, -2)},
                   modes=[np.eye(n)[0]])))


def some_case():
    return random_case(np.random.default_rng([31, 4]), law="dlft", n_sectors=5, engine_order=2)


MODELS = {"sector": sector_model, "diameters": lambda case: nodal_model(case, True),
          "displacements": lambda case: nodal_model(case, False)}


def settings(case):
    return {"cyclic": {"engine_order": case["engine_order"]}, "contact": {"law": "dlft"},
            "structure": {"rotation_speed": 0.7}, "harmonics": {"n_harmonics": 5},
            "sweep": {"values": OMEGAS}}


def from_file(tmp_path, case, structure):
    """The file of a model, and what it gives."""
    structure.to_hdf5(tmp_path / "model.h5")
    result = fw.run(fw.Case(tmp_path / "model.h5", **settings(case)))
    assert result.converged.all()
    return {name: result[name] for name in WANTED}


@pytest.mark.parametrize("kind", MODELS)
def test_python(tmp_path, kind):
    case = some_case()
    structure = MODELS[kind](case)
    expected = from_file(tmp_path, case, structure)
    again = fw.Model.from_hdf5(tmp_path / "model.h5")
    for model in (structure, again):
        result = fw.run(fw.Case(model, **settings(case)))
        for name in WANTED:
            assert np.array_equal(result[name], expected[name])


def without_air(model):
    """The models above have forces of the air of two kinds."""
    return {"contact": model.contact, "coriolis": model.coriolis, "sectors": fw.Sectors(
        model.sectors.n_sectors, model.sectors.left, model.sectors.right, model.sectors.diameters,
        model.sectors.n_physical)}


def test_both_kinds_are_one_structure():
    case = some_case()
    parts, sector = case["model"], without_air(sector_model(case))
    first = fw.Model(parts["mass"], parts["damping"], parts["stiffness"], **case["load"], **sector)
    second = fw.Model(None, None, None, **without_air(nodal_model(case, True)))
    found = [fw.run(fw.Case(model, solver={"tolerance": 1e-12}, **settings(case)))
             for model in (first, second)]
    a, b = (result.coefficients for result in found)
    assert np.abs(a - b).max() < SAME * np.abs(a).max()


class Through:
    """A handle of the library as a C program has it."""

    def __init__(self):
        self.library = ctypes.CDLL(BUILD / "libfretwear.so")
        self.handle = ctypes.c_void_p()
        self.checked(self.library.fw_create(ctypes.byref(self.handle)))

    def checked(self, status):
        text = ctypes.create_string_buffer(1000)
        self.library.fw_get_message(self.handle, text, ctypes.c_size_t(1000))
        assert status == 0, text.value.decode()

    def put(self, name, values):
        kind, call = ((ctypes.c_int, self.library.fw_put_integers) if values.dtype.kind == "i"
                      else (ctypes.c_double, self.library.fw_put_reals))
        flat = (kind * values.size)(*values.ravel())
        self.checked(call(self.handle, name.encode(), ctypes.c_size_t(values.size), flat))

    def new_model(self, n_dof, n_pairs):
        self.checked(self.library.fw_new_model(self.handle, n_dof, n_pairs))

    def observe(self, name):
        self.checked(self.library.fw_observe(self.handle, name, ctypes.c_size_t(0), None))

    def get(self, name, point):
        n = ctypes.c_size_t()
        self.checked(self.library.fw_size(self.handle, name.encode(), point, ctypes.byref(n)))
        values = (ctypes.c_double * n.value)()
        self.checked(self.library.fw_get(self.handle, name.encode(), point, n, values))
        return np.array(values)


class ThroughFortran(Through):
    """The same with the model given as a Fortran 77 program does it."""

    def _call(self, name, *values, text=None):
        """Arguments by reference, the length of a text behind them all."""
        handle, status = ctypes.c_int(self.handle.value), ctypes.c_int()
        middle = [] if text is None else [text]
        getattr(self.library, f"{name}_")(
            ctypes.byref(handle), *middle, *values, ctypes.byref(status),
            *([] if text is None else [ctypes.c_size_t(len(text))]))
        self.checked(status.value)

    def new_model(self, n_dof, n_pairs):
        self._call("fwmodl", ctypes.byref(ctypes.c_int(n_dof)), ctypes.byref(ctypes.c_int(n_pairs)))

    def put(self, name, values):
        kind, call = ((ctypes.c_int, "fwputi") if values.dtype.kind == "i"
                      else (ctypes.c_double, "fwputd"))
        self._call(call, ctypes.byref(ctypes.c_int(values.size)),
                   (kind * values.size)(*values.ravel()), text=name.encode())

    def observe(self, name):
        self._call("fwobs", ctypes.byref(ctypes.c_int(0)), (ctypes.c_double * 1)(), text=name)


@pytest.mark.parametrize("language", [Through, ThroughFortran])
@pytest.mark.parametrize("kind", MODELS)
def test_other_languages(tmp_path, kind, language):
    """Dataset after dataset of a model file, by its name."""
    case = some_case()
    expected = from_file(tmp_path, case, MODELS[kind](case))
    session = language()
    with h5py.File(tmp_path / "model.h5") as file:
        cyclic, n_pairs = dict(file["cyclic"].attrs), len(file["contact/mu"])
        n_dof = int(cyclic["n_physical"]) if kind != "sector" else len(file["mass"])
        session.new_model(n_dof, n_pairs)
        session.put("cyclic/n_sectors", np.array([cyclic["n_sectors"]]))
        names = []
        file.visititems(lambda name, item: names.append(name) if isinstance(
            item, h5py.Dataset) else None)
        # The mass of a nodal diameter gives the order of its other parts.
        for name in sorted(names, key=lambda name: not name.endswith("mass")):
            if name == "observe/name":
                for text in file[name][()]:
                    session.observe(text)
            elif file[name].dtype.kind in "if":
                session.put(name, file[name][()])
    for group, keys in settings(case).items():
        for key, value in keys.items():
            text = ", ".join(map(str, value)) if isinstance(value, list) else (
                f"'{value}'" if isinstance(value, str) else str(value))
            session.checked(session.library.fw_set(
                session.handle, f"{NAMELIST.get(group, group)}%{key}".encode(), text.encode()))
    session.checked(session.library.fw_run_case(session.handle))
    for point in range(len(OMEGAS)):
        for name in WANTED:
            assert np.array_equal(session.get(name, point), expected[name][point].ravel())
    session.checked(session.library.fw_destroy(session.handle))


#: Group &model is `structure` in Python.
NAMELIST = {"structure": "model"}

REFUSED = {
    "nodal_diameter/1/stiffness": (np.zeros(8), "put that first"),
    "nodal_diameter/9/mass": (np.zeros(8), "from 0 to 3"),
    "nodal_diameter/0/mass": (np.zeros(7), "2 n"),
    "nodal_diameter/0/speed": (np.zeros(8), "nodal_diameter/K/mass, "),
    "aero/sector/6": (np.zeros(2), "from -5 to 5"),
    "aero/sectors/1": (np.zeros(2), "must be one of aero/sector/"),
    "aero/modes": (np.zeros(3), "multiple of 2"),
    "cyclic/n_sectors": (np.array([0]), "at least 1"),
    "contact/sector_2": (np.array([0, 0]), "must be 1"),
    "cyclic/speed": (np.array([0]), "cyclic/left"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_parts_that_do_not_fit(name):
    values, words = REFUSED[name]
    session = Through()
    session.new_model(2, 1)
    session.put("cyclic/n_sectors", np.array([6]))
    with pytest.raises(AssertionError, match=words):
        session.put(name, values)


def test_parts_that_lack_something():
    session = Through()
    session.new_model(1, 0)
    session.put("cyclic/n_sectors", np.array([4]))
    session.put("nodal_diameter/0/mass", np.array([1.0, 0.0]))
    with pytest.raises(AssertionError, match="nodal_diameter/0/stiffness"):
        session.checked(session.library.fw_check(session.handle))
    session.put("nodal_diameter/0/stiffness", np.array([1.0, 0.0]))
    session.observe(b"tip")
    with pytest.raises(AssertionError, match="observe/matrix must have a row"):
        session.checked(session.library.fw_check(session.handle))
    session.put("nodal_diameter/0/observe/matrix", np.array([1.0, 0.0]))
    session.put("mass", np.array([1.0]))
    with pytest.raises(AssertionError, match="one of both"):
        session.checked(session.library.fw_check(session.handle))


def test_models_in_python_that_do_not_fit():
    one = fw.NodalDiameter(np.eye(2), np.eye(2))
    refused = {
        "n_physical": fw.Sectors(4, diameters={0: one}),
        "order 2": fw.Sectors(4, diameters={0: one}, n_physical=3),
        "a key": fw.Sectors(4, diameters={3: one}, n_physical=1),
        "same names": fw.Sectors(4, n_physical=1, diameters={
            0: one, 1: fw.NodalDiameter(np.eye(2), np.eye(2), observe={"tip": [1.0, 0.0]})}),
        "one of by_sector": fw.Sectors(4, diameters={0: one}, n_physical=2, air=fw.Air()),
    }
    for words, sectors in refused.items():
        with pytest.raises(fw.InputError, match=words):
            fw.Model(None, None, None, sectors=sectors)
    with pytest.raises(fw.InputError, match="None"):
        fw.Model(np.eye(2), None, np.eye(2), sectors=fw.Sectors(4, diameters={0: one},
                                                                n_physical=2))
    with pytest.raises(fw.InputError, match="must be matrices"):
        fw.Model(None, None, None)
