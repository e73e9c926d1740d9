"""Frequency responses of synthetic result files with known peaks."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from fretwear import InputError
from fretwear.plot.response import (
    friction_damping,
    half_power_damping,
    plot_response,
    read_response,
)

# The sweeps put about 100 points into the half-power width.
RESOLUTION = 2e-3


def _write(path: Path, natural: float, damping: float, *, failed: int | None = None,
           contact: bool = True) -> Path:
    """Result of an oscillator of unit mass under a unit force, natural frequency in Hz."""
    frequency = np.linspace(0.98, 1.02, 2001) * natural
    omega, omega_n = 2.0 * np.pi * frequency, 2.0 * np.pi * natural
    amplitude = 1.0 / np.abs(omega_n**2 - omega**2 + 2j * damping * omega_n * omega)
    converged = np.ones(len(omega), dtype=np.int32)
    if failed is not None:
        converged[failed], amplitude[failed] = 0, 1e6
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "fretwear-result"
        file.attrs["format_version"] = 1
        file["omega"] = omega
        file["amplitude"] = np.column_stack((amplitude, 3.0 * amplitude))
        file["converged"] = converged
        file["observed/name"] = np.array([b"tip", b"other"])
        if contact:
            slip = amplitude / np.max(amplitude[converged == 1])
            states = np.stack((1.0 - 0.6 * slip, 0.5 * slip, 0.1 * slip), axis=-1)
            file["contact/fraction"] = np.repeat(states[:, None, :], 4, axis=1)
            # Loss of a viscous damper, shared by four pairs.
            loss = np.pi * 2.0 * damping * omega_n * omega * amplitude**2
            file["contact/dissipation"] = np.repeat(loss[:, None] / 4.0, 4, axis=1)
    return path


def test_half_power_damping_of_a_linear_peak(tmp_path: Path) -> None:
    response = read_response(_write(tmp_path / "a.h5", 1000.0, 1e-3))
    assert half_power_damping(response) == pytest.approx(1e-3, rel=RESOLUTION)


def test_half_power_damping_needs_both_flanks(tmp_path: Path) -> None:
    path = _write(tmp_path / "a.h5", 1000.0, 0.2)
    assert np.isnan(half_power_damping(read_response(path)))


def test_friction_damping_from_the_stuck_peak(tmp_path: Path) -> None:
    stuck = read_response(_write(tmp_path / "stuck.h5", 1000.0, 1e-3))
    response = read_response(_write(tmp_path / "slip.h5", 998.0, 1.6e-3))
    assert friction_damping(response, stuck) == pytest.approx(0.6e-3, rel=2 * RESOLUTION)
    assert friction_damping(response) is None


def test_friction_damping_from_the_dissipation(tmp_path: Path) -> None:
    """Loss per cycle 2 pi zeta m omega_n omega A^2 against 4 pi zeta (m omega^2 A^2 / 2)."""
    response = read_response(_write(tmp_path / "a.h5", 1000.0, 1.6e-3))
    assert friction_damping(response, modal_mass=1.0) == pytest.approx(1.6e-3, rel=1e-5)


def test_a_failed_point_is_no_peak(tmp_path: Path) -> None:
    response = read_response(_write(tmp_path / "a.h5", 1000.0, 1e-3, failed=300))
    assert response.frequency[response.peak] == pytest.approx(1000.0, abs=0.1)


def test_observed_quantity_by_name(tmp_path: Path) -> None:
    path = _write(tmp_path / "a.h5", 1000.0, 1e-3)
    assert read_response(path, "other").amplitude == pytest.approx(
        3.0 * read_response(path, "tip").amplitude)
    with pytest.raises(ValueError, match="available: tip, other"):
        read_response(path, "tpi")


def test_the_curve_is_the_result(tmp_path: Path) -> None:
    """Points that failed leave a gap in the curve and a cross within the picture."""
    stuck = _write(tmp_path / "stuck.h5", 1000.0, 1e-3)
    path = _write(tmp_path / "slip.h5", 998.0, 1.6e-3, failed=700)
    response = read_response(path)
    upper, lower = plot_response(path, linear=stuck).axes
    lines = {line.get_label(): line for line in upper.lines}
    curve = lines["amplitude of tip"]
    assert np.array_equal(curve.get_xdata(), response.frequency)
    expected = np.where(response.converged, response.amplitude, np.nan)
    assert np.array_equal(curve.get_ydata(), expected, equal_nan=True)
    cross = lines["not converged (1)"]
    assert cross.get_xdata() == pytest.approx([response.frequency[700]])
    assert cross.get_ydata()[0] <= upper.get_ylim()[1]
    assert np.array_equal(lines["stuck (linear)"].get_ydata(), read_response(stuck).amplitude)
    assert "shift -0.200 %" in upper.texts[0].get_text()
    assert lower.get_xlabel() == "frequency [Hz]"
    assert upper.get_ylabel() == "amplitude of tip [10⁻⁶]"
    tops = [area.get_paths()[0].vertices[:, 1].max() for area in lower.collections]
    keep = response.converged
    assert tops == pytest.approx([response.fraction[keep].cumsum(axis=1)[:, k].max()
                                  for k in range(3)])


def test_without_contact_there_is_one_panel(tmp_path: Path) -> None:
    figure = plot_response(_write(tmp_path / "a.h5", 1000.0, 1e-3, contact=False))
    assert [axes.get_xlabel() for axes in figure.axes] == ["frequency [Hz]"]


def test_nothing_converged(tmp_path: Path) -> None:
    path = _write(tmp_path / "a.h5", 1000.0, 1e-3)
    with h5py.File(path, "r+") as file:
        file["converged"][:] = 0
    (axes,) = plot_response(path).axes
    assert "not converged (2001)" in [line.get_label() for line in axes.lines]
    with pytest.raises(InputError, match="no converged point"):
        read_response(path).peak  # noqa: B018


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "model.h5", "w") as file:
        file.attrs["format"] = np.bytes_("fretwear-model")
    with pytest.raises(ValueError, match="expected 'fretwear-result'"):
        read_response(tmp_path / "model.h5")
