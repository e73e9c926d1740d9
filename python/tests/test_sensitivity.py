"""Derivatives of a result in Python, and their picture."""

from __future__ import annotations

import numpy as np
import pytest

import fretwear as fw
from fretwear.cli import main
from fretwear.plot import Choices, fitting, plot_response, plot_sensitivity
from fretwear.report import render_report


@pytest.fixture(scope="module")
def slipping() -> fw.Result:
    """Two masses that rub, one of them on the ground."""
    contact = fw.ContactPairs([[1, 0, 0], [2, 0, 0]], mu=[0.4, 0.3], normal_load=[1.0, 0.8],
                              tangential_stiffness=[1.5, 1.2])
    model = fw.Model([[1.0, 0.0], [0.0, 2.0]], [[0.03, -0.01], [-0.01, 0.05]],
                     [[3.0, -2.0], [-2.0, 5.0]], cosine=[0.0, 0.9], contact=contact)
    return fw.frf(model, 1.1, 1.5, 9, contact={"law": "penalty"}, harmonics={"n_harmonics": 5},
                  sensitivity={"parameters": ["contact%mu", "load%harmonic_scale"],
                               "deviation": [0.05, 0.0]})


def test_derivatives_by_name(slipping: fw.Result) -> None:
    found = slipping.sensitivities
    assert set(found) == {"first_harmonic", "largest", "dissipation"} and len(found) == 3
    assert found["largest"]["contact%mu"].shape == (9, 2, 2)
    assert found["dissipation"]["contact%mu"].shape == (9, 2)
    assert found["largest"]["load%harmonic_scale"].shape == (9, 2)
    np.testing.assert_array_equal(found.value["contact%mu"][3], [0.4, 0.3])
    np.testing.assert_allclose(found.value["largest"], slipping.amplitude, rtol=1e-12)
    np.testing.assert_allclose(found.value["dissipation"], slipping.dissipation.sum(axis=1),
                               rtol=1e-9, atol=1e-14)


def test_deviation_is_that_of_the_derivatives(slipping: fw.Result) -> None:
    found = slipping.sensitivities
    expected = 0.05 * np.abs(found["largest"]["contact%mu"] @ [0.4, 0.3])
    np.testing.assert_allclose(found.deviation["largest"], expected, rtol=1e-12)


def test_relative(slipping: fw.Result) -> None:
    found = slipping.sensitivities
    k = slipping.peak()
    by_mu = found.relative("largest", "contact%mu", k, 1)
    np.testing.assert_allclose(by_mu, found["largest"]["contact%mu"][k, 1] * [0.4, 0.3]
                               / slipping.amplitude[k, 1], rtol=1e-12)
    # Friction is of degree 1 in loads and limits together: so is the response.
    by_load = found.relative("largest", "load%harmonic_scale", k, 1)
    assert by_mu.sum() + by_load.sum() == pytest.approx(1.0, abs=1e-6)
    with pytest.raises(fw.InputError):
        found.relative("largest", "contact%gap", k)


def test_it_prints_as_a_table(slipping: fw.Result) -> None:
    found = slipping.sensitivities
    lines = repr(found).splitlines()
    assert len(lines) == 2 + 5 and lines[1].split() == [
        "quantity", "value", "deviation", "contact%mu", "load%harmonic_scale"]
    row = next(line for line in lines if line.startswith("largest[u2]")).split()
    k = int(np.argmax(slipping.amplitude[:, 1]))
    assert float(row[1]) == pytest.approx(slipping.amplitude[k, 1], rel=1e-4)
    assert float(row[3]) == pytest.approx(
        found.relative("largest", "contact%mu", k, 1).sum(), abs=1e-4)
    assert "<td>largest[u2]</td>" in found._repr_html_()


def test_what_is_missing_is_said(slipping: fw.Result) -> None:
    found = slipping.sensitivities
    with pytest.raises(fw.AbsentError, match="there are by contact%mu, load%harmonic_scale"):
        found["largest"]["contact%gap"]
    with pytest.raises(fw.AbsentError, match="there are of dissipation, first_harmonic, largest"):
        found["wear_volume"]
    assert "wear_volume" not in found and "contact%gap" not in found["largest"]


def test_absent(tmp_path) -> None:  # type: ignore[no-untyped-def]
    linear = fw.frf(fw.Model([[1.0]], [[0.1]], [[1.0]], cosine=[1.0]), 0.5, 1.5, 3)
    with pytest.raises(fw.AbsentError, match="sensitivity%parameters"):
        _ = linear.sensitivities
    assert "sensitivity" not in fitting(linear)


def test_picture(slipping: fw.Result, tmp_path) -> None:  # type: ignore[no-untyped-def]
    figure = plot_sensitivity(slipping, observe="u2")
    panels = figure.axes
    assert len(panels) == 3
    assert [label.get_text() for label in panels[0].get_yticklabels()] == [
        "contact%mu", "load%harmonic_scale"]
    # Bars are the relative derivatives, pairs one below the other.
    found = slipping.sensitivities
    widths = [bar.get_width() for bar in panels[2].patches]
    expected = np.concatenate([found.relative("largest", name, slipping.peak("u2"), 1)
                               for name in found["largest"]])
    np.testing.assert_allclose(widths, expected, rtol=1e-12)
    slipping.save(tmp_path / "slipping.h5")
    assert main(["plot", str(tmp_path / "slipping.h5"), "--kind", "sensitivity", "-o",
                 str(tmp_path / "bars.png")]) == 0
    assert (tmp_path / "bars.png").stat().st_size > 5000


def test_band_of_the_deviation(slipping: fw.Result) -> None:
    upper = plot_response(slipping, "u2").axes[0]
    (band,) = upper.collections
    heights = band.get_paths()[0].vertices[:, 1]
    spread = slipping.sensitivities.deviation["largest"][:, 1]
    assert heights.max() == pytest.approx((slipping.amplitude[:, 1] + spread).max())
    assert heights.min() == pytest.approx((slipping.amplitude[:, 1] - spread).min())
    peak = slipping.peak("u1")
    page = render_report(slipping, Choices())
    assert f"standard deviation of the amplitude, at point {peak + 1}" in page
    assert f"{slipping.sensitivities.deviation['largest'][peak, 0]:.6g}" in page
