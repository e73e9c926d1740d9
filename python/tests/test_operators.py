"""Operators of the library against the formulas they stand for, written out in NumPy."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fretwear as fw
from fretwear import operators as op

EXAMPLES = Path(__file__).resolve().parents[2] / "example"
RNG = np.random.default_rng(7)
# Sums of some tens of products of numbers of order one.
ROUND_OFF = 1e-12
# Central differences of step 1e-6 of a piecewise linear map.
DIFFERENCE = 1e-7


def base(n_harmonics: int, n_time: int, odd_only: bool) -> np.ndarray:
    """Base functions at the instants, one per row."""
    tau = 2.0 * np.pi * np.arange(n_time) / n_time
    rows = [] if odd_only else [np.ones(n_time)]
    for n in range(1, n_harmonics + 1, 2 if odd_only else 1):
        rows += [np.cos(n * tau), np.sin(n * tau)]
    return np.array(rows)


@pytest.mark.parametrize("odd_only", [False, True])
@pytest.mark.parametrize(("n_harmonics", "n_time"), [(1, 4), (5, 11), (7, 64)])
def test_harmonic_operators_are_their_definition(n_harmonics: int, n_time: int,
                                                 odd_only: bool) -> None:
    synthesis, analysis = op.harmonic_operators(n_harmonics, n_time, odd_only=odd_only)
    expected = base(n_harmonics, n_time, odd_only)
    assert np.allclose(synthesis, expected, rtol=0, atol=ROUND_OFF)
    if n_time % 2 == 0 or not odd_only:
        assert np.allclose(analysis @ synthesis.T, np.eye(len(expected)), rtol=0, atol=ROUND_OFF)
    coefficients = RNG.normal(size=(3, op.coefficient_count(n_harmonics, odd_only)))
    values = op.to_time(coefficients, n_time, odd_only=odd_only)
    assert np.allclose(values, coefficients @ expected, rtol=0, atol=ROUND_OFF)
    back = op.to_coefficients(values, n_harmonics, odd_only=odd_only)
    assert np.allclose(back, values @ analysis.T, rtol=0, atol=ROUND_OFF)


def test_the_derivative_is_that_of_the_series() -> None:
    coefficients = RNG.normal(size=(2, 7))
    derivative = op.differentiate(coefficients)
    expected = np.zeros_like(coefficients)
    for n in (1, 2, 3):
        expected[:, 2 * n - 1] = n * coefficients[:, 2 * n]
        expected[:, 2 * n] = -n * coefficients[:, 2 * n - 1]
    assert np.array_equal(derivative, expected)
    odd = RNG.normal(size=(2, 4))  # harmonics 1 and 3
    assert np.array_equal(op.differentiate(odd, odd_only=True),
                          np.stack([odd[:, 1], -odd[:, 0], 3 * odd[:, 3], -3 * odd[:, 2]], axis=1))


def test_the_amplitude_is_the_largest_value_of_a_fine_grid() -> None:
    coefficients = RNG.normal(size=(5, 9))
    grid = np.abs(op.to_time(coefficients, 200_000)).max(axis=1)
    # A grid of this spacing misses a maximum by (H spacing)^2/2 of the largest value.
    assert np.allclose(op.amplitude(coefficients), grid, rtol=1e-8, atol=0)


def test_histories_recovered_from_a_result_are_those_it_holds() -> None:
    result = fw.run(fw.Case.from_file(EXAMPLES / "gap" / "gap.nml", sweep={"n_points": 3},
                                      output={"histories": True}))
    stored = result["history/observed"]
    for k in range(result.n_points):
        values = op.to_time(result.coefficients[k].T, stored.shape[1])
        assert np.allclose(values, stored[k].T, rtol=0, atol=ROUND_OFF * np.abs(stored).max())
        assert op.amplitude(result.coefficients[k].T) == pytest.approx(result.amplitude[k],
                                                                       rel=0, abs=0)


def structure(n: int = 6) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A held chain with some damping."""
    stiffness = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    return np.diag(np.linspace(1.0, 2.0, n)), 0.01 * stiffness + 0.02 * np.eye(n), stiffness


def test_dynamic_stiffness_is_its_formula() -> None:
    mass, damping, stiffness = structure()
    z = op.dynamic_stiffness(mass, damping, stiffness, 0.7, (0, 1, 3))
    for h, n in enumerate((0, 1, 3)):
        s = n * 0.7
        expected = stiffness - s**2 * mass + 1j * s * damping
        assert np.allclose(z[:, :, h], expected, rtol=1e-15, atol=0)


def test_condensation_is_the_inverse_of_the_flexibility() -> None:
    mass, damping, stiffness = structure()
    side_1, side_2, omega, harmonics = [2, 5, -6], [3, 0, 0], 0.7, (0, 1, 2)
    rows = np.zeros((3, 6))
    rows[0, 1], rows[0, 2], rows[1, 4], rows[2, 5] = 1.0, -1.0, 1.0, -1.0
    static, cosine, sine = RNG.normal(size=(3, 6))
    force = np.array([static, cosine - 1j * sine, np.zeros(6)])
    loads: dict[str, Any] = {"static": static, "cosine": cosine, "sine": sine}
    z_r, f_r = op.condense(mass, damping, stiffness, side_1, side_2, omega, harmonics, **loads)
    z = op.dynamic_stiffness(mass, damping, stiffness, omega, harmonics)
    q = RNG.normal(size=(3, 3)) + 1j * RNG.normal(size=(3, 3))
    u = op.recover(mass, damping, stiffness, side_1, side_2, omega, q, harmonics, **loads)
    for h in range(3):
        flexibility = rows @ np.linalg.solve(z[:, :, h], rows.T)
        expected = np.linalg.inv(flexibility)
        scale = np.abs(expected).max()
        assert np.allclose(z_r[:, :, h], expected, rtol=0, atol=1e-10 * scale)
        free = rows @ np.linalg.solve(z[:, :, h], force[h])
        assert np.allclose(f_r[:, h], expected @ free, rtol=0, atol=1e-10 * scale)
        assert np.allclose(rows @ u[:, h], q[:, h], rtol=0, atol=1e-10)
        # What is left of the balance is a force of the pairs.
        rest = force[h] - z[:, :, h] @ u[:, h]
        assert np.allclose(rest, rows.T @ np.linalg.lstsq(rows.T, rest, rcond=None)[0], rtol=0,
                           atol=1e-10 * scale)


def test_condensation_says_where_it_cannot_be() -> None:
    mass, stiffness = np.eye(2), np.array([[2.0, -1.0], [-1.0, 2.0]])
    # With dof 1 held, dof 2 swings at sqrt(2) without damping.
    with pytest.raises(fw.InputError, match="undamped"):
        op.condense(mass, None, stiffness, [1], [0], np.sqrt(2.0))
    with pytest.raises(fw.InputError, match="row 2 of side_1 and side_2 follows"):
        op.condense(mass, None, stiffness, [1, -1], [0, 0], 0.3)


def march(prediction: np.ndarray, mu: np.ndarray, offset: np.ndarray,
          n_time: int) -> tuple[np.ndarray, np.ndarray]:
    """Forces at the instants and the end of the march, one pair and one instant at a time."""
    n_pairs = len(prediction)
    values = prediction @ base((prediction.shape[2] - 1) // 2, n_time, False)
    values[:, 2] += offset[:, None]
    force, x = np.zeros_like(values), np.zeros((n_pairs, 2))
    for i in range(n_pairs):
        for _ in range(50):  # more turns than any pair needs
            for k in range(n_time):
                d, p = values[i, :2, k] - x[i], max(-values[i, 2, k], 0.0)
                if p == 0.0:
                    force[i, :, k], x[i] = 0.0, values[i, :2, k]
                elif np.linalg.norm(d) <= mu[i] * p:
                    force[i, :, k] = *d, -p
                else:
                    force[i, :, k] = *(mu[i] * p * d / np.linalg.norm(d)), -p
                    x[i] = values[i, :2, k] - force[i, :2, k]
    return force, x


def predictions() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs that stick, slip, lift off now and then, and stay open."""
    prediction = RNG.normal(size=(5, 3, 7))
    offset = np.array([-30.0, -6.0, -3.0, -1.0, 30.0])
    return np.asfortranarray(prediction), np.full(5, 0.3), offset


def test_contact_forces_are_those_of_the_march() -> None:
    prediction, mu, offset = predictions()
    found = op.contact_forces(prediction, mu, 64, offset=offset)
    force, x = march(prediction, mu, offset, 64)
    assert np.allclose(found.force_time, force, rtol=0, atol=1e-10)
    assert np.allclose(found.finish, x, rtol=0, atol=1e-10)
    assert np.allclose(found.force, op.to_coefficients(
        force.reshape(15, 64), 3).reshape(5, 3, 7), rtol=0, atol=1e-10)
    assert found.periodic
    assert found.state.tolist() == [1, 3, 3, 3, 2]
    assert np.allclose(found.fraction.sum(axis=1), 1.0, rtol=0, atol=ROUND_OFF)
    assert found.fraction[0].tolist() == [1.0, 0.0, 0.0]
    assert found.fraction[4].tolist() == [0.0, 0.0, 1.0]
    assert found.jacobian is None


def test_the_jacobian_is_the_derivative_of_the_forces() -> None:
    prediction, mu, offset = predictions()
    found = op.contact_forces(prediction, mu, 64, offset=offset, jacobian=True)
    assert found.jacobian is not None
    assert found.jacobian.shape == (5, 3, 7, 3, 7)
    step = 1e-6
    for component in range(3):
        for coefficient in range(7):
            ends = []
            for sign in (1.0, -1.0):
                moved = prediction.copy(order="F")
                moved[:, component, coefficient] += sign * step
                ends.append(op.contact_forces(moved, mu, 64, offset=offset).force)
            slope = (ends[0] - ends[1]) / (2.0 * step)
            assert np.allclose(found.jacobian[:, :, :, component, coefficient], slope, rtol=0,
                               atol=DIFFERENCE)


def test_directions_that_a_pair_lacks_have_no_derivative() -> None:
    prediction = np.zeros((1, 3, 3), order="F")
    prediction[0, 0, 1] = 2.0
    found = op.contact_forces(prediction, 1.0, 32, offset=-1.0, jacobian=True,
                              present=[[True, False, False]])
    assert found.jacobian is not None
    assert found.jacobian[0, 0].any()
    assert not found.jacobian[0, 1:].any()
    assert not found.jacobian[0, :, :, 1:].any()


# ----------------------------------------------------------------------------- arguments


def test_fortran_ordered_arrays_pass_without_a_copy() -> None:
    """No allocation of the size of the arguments happens on the way to Fortran and back."""
    coefficients = np.asfortranarray(RNG.normal(size=(40_000, 7)))
    out = np.empty((40_000, 16), order="F")
    matrix = np.asfortranarray(np.eye(500))
    z = np.empty((500, 500, 1), dtype=complex, order="F")
    calls: list[tuple[Callable[[], object], int]] = [
        (lambda: op.to_time(coefficients, 16, out=out), coefficients.nbytes),
        (lambda: op.to_coefficients(out, 3, out=coefficients), out.nbytes),
        (lambda: op.dynamic_stiffness(matrix, matrix, matrix, 1.0, out=z), matrix.nbytes),
    ]
    for call, size in calls:
        call()
        tracemalloc.start()
        try:
            call()
            _, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        # What is left are the truth values of the check for finite numbers, an eighth.
        assert peak < size // 4
    result = op.to_time(coefficients, 16, out=out)
    assert np.shares_memory(result, out)


def test_arrays_of_another_order_are_converted() -> None:
    coefficients = RNG.normal(size=(4, 7))
    assert np.array_equal(op.to_time(coefficients, 16), op.to_time(np.asfortranarray(coefficients),
                                                                   16))
    wide = RNG.normal(size=(8, 14))[::2, ::2]
    assert np.array_equal(op.to_time(wide, 16), op.to_time(wide.copy(), 16))


I2 = np.eye(2)


@pytest.mark.parametrize(("argument", "call"), [
    ("n_harmonics = 0", lambda: op.coefficient_count(0)),
    ("n_harmonics = 1.5", lambda: op.coefficient_count(1.5)),  # type: ignore[arg-type]
    ("n_time = 6: must be an integer from 7", lambda: op.harmonic_operators(3, 6)),
    (r"coefficients: its shape is \(7,\)", lambda: op.to_time(np.zeros(7), 16)),
    ("coefficients: has 4 coefficients, must have 2H", lambda: op.to_time(np.zeros((2, 4)), 16)),
    ("coefficients: has 3", lambda: op.to_time(np.zeros((2, 3)), 16, odd_only=True)),
    (r"coefficients\[0, 1\] = nan", lambda: op.to_time([[0.0, np.nan, 0.0]], 16)),
    ("coefficients: its elements are of type complex", lambda: op.to_time([[0j, 0, 0]], 16)),
    ("out: must be a writable, Fortran",
     lambda: op.to_time(np.zeros((2, 3)), 16, out=np.zeros((2, 16)))),
    ("out: must be a writable, Fortran",
     lambda: op.to_time(np.zeros((2, 3)), 16, out=np.zeros((4, 16), order="F")[::2])),
    ("out: is of type float32",
     lambda: op.to_time(np.zeros((2, 3)), 16,
                        out=np.zeros((2, 16), np.float32, order="F"))),
    (r"out: its shape is \(2, 15\)",
     lambda: op.to_time(np.zeros((2, 3)), 16, out=np.zeros((2, 15), order="F"))),
    ("out: is of type list",
     lambda: op.amplitude(np.zeros((2, 3)), out=[0.0, 0.0])),  # type: ignore[arg-type]
    ("n_time, the second length of values, = 5", lambda: op.to_coefficients(np.zeros((2, 5)), 3)),
    (r"M: its shape is \(3, 3\)", lambda: op.dynamic_stiffness(np.eye(3), None, I2, 1.0)),
    (r"K: its shape is \(2, 3\)", lambda: op.dynamic_stiffness(I2, None, np.zeros((2, 3)), 1.0)),
    (r"C\[0, 0\] = inf", lambda: op.dynamic_stiffness(I2, I2 / 0.0, I2, 1.0)),
    ("omega = 0", lambda: op.dynamic_stiffness(I2, None, I2, 0.0)),
    ("harmonics", lambda: op.dynamic_stiffness(I2, None, I2, 1.0, [-1])),
    ("harmonics", lambda: op.dynamic_stiffness(I2, None, I2, 1.0, [])),
    ("side_1: its elements", lambda: op.condense(I2, None, I2, [1.0], [0], 1.0)),
    (r"side_1\[0\] = 3", lambda: op.condense(I2, None, I2, [3], [0], 1.0)),
    (r"side_2: its shape is \(2,\)", lambda: op.condense(I2, None, I2, [1], [0, 0], 1.0)),
    ("joins dof 1 to itself", lambda: op.condense(I2, None, I2, [1], [1], 1.0)),
    (r"cosine: its shape", lambda: op.condense(I2, None, I2, [1], [0], 1.0, cosine=[1.0])),
    (r"q: its shape is \(2, 1\)",
     lambda: op.recover(I2, None, I2, [1], [0], 1.0, np.zeros((2, 1)))),
    ("prediction: its shape", lambda: op.contact_forces(np.zeros((1, 2, 3)), 0.3, 16)),
    ("prediction: holds no pair", lambda: op.contact_forces(np.zeros((0, 3, 3)), 0.3, 16)),
    (r"mu\[0\]: is negative", lambda: op.contact_forces(np.zeros((1, 3, 3)), -0.3, 16)),
    ("start: its shape",
     lambda: op.contact_forces(np.zeros((1, 3, 3)), 0.3, 16, start=np.zeros((2, 2)))),
    ("present: must be truth values",
     lambda: op.contact_forces(np.zeros((1, 3, 3)), 0.3, 16, present=[[1, 1, 1]])),
])
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_wrong_arguments_are_named(argument: str, call: Callable[[], object]) -> None:
    with pytest.raises(fw.InputError, match=argument):
        call()


@pytest.mark.parametrize("odd_only", [1e-320, 0.5, 2, "", None, np.array([True])])
def test_a_truth_value_is_one(odd_only: Any) -> None:
    """0.5 is true to Python and 0 to the library: it wrote five coefficients where two fit."""
    with pytest.raises(fw.InputError, match=r"odd_only: is a .*, must be True or False"):
        op.to_coefficients(np.ones((1, 8)), 2, odd_only=odd_only)


@pytest.mark.parametrize("n_time", [2**31, 10**400, 10**6 + 1, True, 8.0])
def test_more_instants_than_the_library_counts(n_time: Any) -> None:
    with pytest.raises(fw.InputError, match=r"n_time = .* must be an integer from 5 to 1000000"):
        op.harmonic_operators(2, n_time)


def test_dof_numbers_that_no_integer_of_the_library_holds() -> None:
    """The least integer has no absolute value."""
    one = np.eye(1)
    with pytest.raises(fw.InputError, match="must be a dof from 1 to 1"):
        op.condense(one, None, one, [-2**63], [0], 1.0)
