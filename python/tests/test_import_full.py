"""Files .full of ANSYS, written here as the program lays them out: unsymmetric stiffness, lumped
and consistent mass, constrained degrees of freedom, nodes in any order."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

from fretwear.cli import main
from fretwear.errors import InputError
from fretwear.importer import Dofs, FullModel, drop, read_matrices
from fretwear.importer.build import SKEW, model_datasets
from fretwear.importer.tables import Pairs, contact_rows
from fretwear.reduction import reduce

#: Sums of a few products.
ROUNDING = 1e-12


def record(values: np.ndarray) -> bytes:
    """Words, flags, values, words."""
    integer = values.dtype.kind == "i"
    data = values.astype("<i4" if integer else "<f8").tobytes()
    n = np.array([len(data) // 4], dtype="<u4").tobytes()
    return n + np.array([0x80000000 if integer else 0], dtype="<u4").tobytes() + data + n


def integers(*values: int) -> np.ndarray:
    return np.array(values, dtype=int)


def write_full(path: Path, stiffness: np.ndarray, mass: np.ndarray, nodes: list[int],
               held: list[int], *, lumped: bool = False, by_rows: bool = False) -> None:
    """A file of nodes with three components; `held` are equations from 0."""
    n = len(stiffness)
    unsymmetric = not np.array_equal(stiffness, stiffness.T)
    head = np.zeros(160, dtype=int)
    head[[0, 1, 4, 7, 10, 13, 32]] = -4, n, 2, 3, lumped, unsymmetric, len(nodes)
    body = [record(np.zeros(100, dtype=int)), b"", record(integers(1, 2, 3)),
            record(np.array(nodes))]
    place = sum(map(len, body)) // 4 + 163

    def append(item: int, *parts: bytes) -> None:
        nonlocal place
        head[item] = place
        body.extend(parts)
        place += sum(map(len, parts)) // 4

    def rows(matrix: np.ndarray) -> tuple[list[bytes], int]:
        parts, terms = [], 0
        for i, values in enumerate(matrix):
            column = np.flatnonzero(values)
            if not unsymmetric:
                column = column[column > i]
            column = np.append(column[column != i], i)   # the diagonal is the last
            parts += [record(column + 1), record(values[column])]
            terms += len(column)
        return parts, terms

    parts, head[8] = rows(stiffness)
    append(18, *parts)
    if lumped and not by_rows:
        append(26, record(np.diag(mass).copy()))
        head[33] = n
    else:
        parts, head[33] = rows(mass)
        append(26, *parts)
    component = np.tile([1, 2, 3], len(nodes))
    component[held] *= -1
    append(35, record(np.full(len(nodes), 3)), record(component))
    body[1] = record(head)
    path.write_bytes(b"".join(body))


def drawn(unsymmetric: bool, seed: int = 4) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    n = 12
    factor = random.normal(size=(n, n)) * (random.uniform(size=(n, n)) < 0.4)
    stiffness = factor @ factor.T + 5.0 * np.eye(n)
    if unsymmetric:
        stiffness[2, 7] += 1.5
        stiffness[9, 4] -= 0.5
    mass = np.diag(random.uniform(1.0, 2.0, n))
    mass[0, 6] = mass[6, 0] = 0.25
    return stiffness, mass


NODES = [7, 3, 11, 5]
HELD = [3, 4, 5]   # node 3


@pytest.mark.parametrize("lumped", [False, True])
@pytest.mark.parametrize("unsymmetric", [False, True])
def test_matrices_are_read(tmp_path: Path, unsymmetric: bool, lumped: bool) -> None:
    stiffness, mass = drawn(unsymmetric)
    if lumped:
        mass = np.diag(np.diag(mass))
    order = [NODES.index(node) for node in sorted(NODES)]
    rows = (3 * np.array(order)[:, None] + np.arange(3)).ravel()
    for by_rows in (False, True):
        write_full(tmp_path / "a.full", stiffness, mass, NODES, HELD, lumped=lumped,
                   by_rows=by_rows)
        found = read_matrices(tmp_path / "a.full")
        assert found.labels == [(node, c) for node in sorted(NODES) for c in (1, 2, 3)]
        assert found.unsymmetric == (frozenset("km") if unsymmetric else frozenset())
        model = drop(FullModel({"mass": found.matrices["m"], "stiffness": found.matrices["k"]},
                               Dofs(12, found.labels)), empty=False)
        free = rows[~np.isin(rows, HELD)]
        assert np.array_equal(model.matrices["stiffness"].toarray(), stiffness[np.ix_(free, free)])
        assert np.array_equal(model.matrices["mass"].toarray(), mass[np.ix_(free, free)])
        assert model.dofs.signed("3:2", "here") == 0


def test_an_unsymmetric_stiffness_goes_in_two_parts(tmp_path: Path,
                                                    capsys: pytest.CaptureFixture[str]) -> None:
    stiffness, mass = drawn(True)
    write_full(tmp_path / "a.full", stiffness, mass, sorted(NODES), [])
    assert main(["import", str(tmp_path / "a.full"), "-o", str(tmp_path / "a.h5")]) == 0
    assert f"goes into {SKEW}" in capsys.readouterr().err
    with h5py.File(tmp_path / "a.h5") as file:
        one, other = file["stiffness"][()], file[SKEW][()]
    assert np.array_equal(one, one.T) and np.array_equal(other, -other.T)
    assert one + other == pytest.approx(stiffness, abs=ROUNDING)
    # Another format says nothing of the kind: an error, or the word that it is meant.
    for name, matrix in (("k", stiffness), ("m", mass)):
        scipy.io.mmwrite(tmp_path / f"{name}.mtx", matrix)
    files = [str(tmp_path / f"{name}.mtx") for name in "km"]
    assert main(["import", *files, "--check"]) == 3
    assert "goes in with --unsymmetric" in capsys.readouterr().err
    assert main(["import", *files, "--unsymmetric", "-q", "-o", str(tmp_path / "b.h5")]) == 0
    with h5py.File(tmp_path / "b.h5") as file:
        assert file[SKEW][()] == pytest.approx(other, abs=ROUNDING)


def test_the_skew_part_is_reduced_by_the_same_basis() -> None:
    """T^T A T with the basis T written out."""
    stiffness, mass = drawn(True)
    skew, whole = 0.5 * (stiffness - stiffness.T), 0.5 * (stiffness + stiffness.T)
    sides = np.array([[1, 2, 3]], dtype=np.int32)
    pairs = Pairs(sides, np.zeros_like(sides), None, None, None, None, None, None, ["pair"])
    model = FullModel({"mass": sp.csr_array(mass), "stiffness": sp.csr_array(whole),
                       SKEW: sp.csr_array(skew)}, Dofs(12), pairs=pairs)
    data = model_datasets(model, 5)
    rows, _ = contact_rows(pairs, 12)
    basis = reduce(model.matrices["mass"], model.matrices["stiffness"], rows,
                   n_modes=5).reduction.expand(np.eye(8))
    assert data["stiffness"] == pytest.approx(basis.T @ whole @ basis, abs=1e-9)
    assert data[SKEW] == pytest.approx(basis.T @ skew @ basis, abs=1e-9)
    assert np.abs(data[SKEW]).max() > 0.01 and np.array_equal(data[SKEW], -data[SKEW].T)
    with pytest.raises(InputError, match="does not go with --by-diameter"):
        model_datasets(model, 5, by_diameter=True)


def test_files_that_are_something_else(tmp_path: Path) -> None:
    stiffness, mass = drawn(False)
    path = tmp_path / "a.full"
    write_full(path, stiffness, mass, NODES, HELD)
    whole = np.frombuffer(path.read_bytes(), dtype="<i4").copy()

    def refused(words: str, **changes: int) -> None:
        data = whole.copy()
        for place, value in changes.items():
            data[105 + int(place[1:])] = value
        path.write_bytes(data.tobytes())
        with pytest.raises(InputError, match=words):
            read_matrices(path)

    refused("no .full file of a symbolic assembly", h0=4)
    refused("degrees of freedom of 4 nodes, where its header says 9", h1=9)
    refused("has no record at word 105", h18=105)
    refused("where its header says 7", h8=7)
    refused("ends within its records", h26=len(whole) + 9)
    path.write_bytes(whole[:len(whole) // 2].tobytes())
    with pytest.raises(InputError, match="use HBMAT"):
        read_matrices(path)
    unsymmetric, _ = drawn(True)
    write_full(path, unsymmetric, mass, NODES, HELD)
    whole = np.frombuffer(path.read_bytes(), dtype="<i4").copy()
    refused("both triangles", h13=0)
    packed = whole.copy()
    packed[int(whole[105 + 18]) + 1] |= 1 << 29
    path.write_bytes(packed.tobytes())
    with pytest.raises(InputError, match="compressed"):
        read_matrices(path)
