"""Nonlinear modes of a result in Python, and their picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fretwear as fw
from fretwear.cli import main
from fretwear.plot import fitting, plot_backbone, plot_mode

#: Limit cycles of the exact motion (test/modes/mode_references.json): amplitude, frequency.
UNSTABLE_ABOVE = [(0.7164337865536, 1.3226517322658298, True),
                  (2.3530734382268554, 1.0740437114068488, False)]
#: What 7 harmonics leave out.
SEVEN_HARMONICS = 2e-4


def follow(damping: float, **mode: Any) -> fw.Result:
    """An oscillator with an elastic friction element that slips from 0.5 on."""
    contact = fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=0.5, tangential_stiffness=1.0)
    case = fw.Case(fw.Model([[1.0]], [[damping]], [[1.0]], contact=contact),
                   case={"analysis": "mode"}, contact={"law": "penalty"},
                   harmonics={"n_harmonics": 7},
                   mode={"start": 0.1, "end": 10.0, "n_points": 41, "continuation": "natural"}
                   | mode)
    return fw.run(case)


@pytest.fixture(scope="module")
def fluttering() -> fw.Result:
    return follow(-0.2)


def test_curve(fluttering: fw.Result) -> None:
    mode = fluttering.mode
    assert (mode.number, mode.control) == (1, "observed")
    assert mode.converged.all() and mode.amplitude.shape == (41,)
    np.testing.assert_allclose(mode.amplitude, np.geomspace(0.1, 10.0, 41), rtol=1e-9)
    stuck = mode.amplitude < 0.5
    np.testing.assert_allclose(mode.omega[stuck], np.sqrt(2.0), rtol=1e-9)
    assert mode.stuck_omega == pytest.approx(np.sqrt(2.0), rel=1e-12)
    assert mode.stuck_damping_ratio == pytest.approx(-0.2 / (2 * np.sqrt(2.0)), rel=1e-12)
    assert mode.onset == pytest.approx(0.5, rel=1e-12)
    assert mode.onset_known_by in {"bound", "solutions", "stuck"}
    np.testing.assert_allclose(mode.frequency, mode.omega / (2 * np.pi))


def test_limit_cycles(fluttering: fw.Result) -> None:
    cycles = fluttering.mode.limit_cycles
    assert len(cycles) == 2
    for cycle, (amplitude, omega, stable) in zip(cycles, UNSTABLE_ABOVE):
        assert cycle.amplitude == pytest.approx(amplitude, rel=SEVEN_HARMONICS)
        assert cycle.omega == pytest.approx(omega, rel=SEVEN_HARMONICS)
        assert cycle.stable is stable


def test_modal_amplitudes() -> None:
    """Without slip there is no onset, and without a change of sign no limit cycle."""
    mode = follow(0.02, control="modal", end=0.4, n_points=3).mode
    np.testing.assert_allclose(mode.amplitude, np.geomspace(0.1, 0.4, 3), rtol=1e-9)
    assert mode.control == "modal"
    assert np.isnan(mode.onset) and mode.limit_cycles == ()


def test_by_the_function(fluttering: fw.Result) -> None:
    contact = fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=0.5, tangential_stiffness=1.0)
    again = fw.mode(fw.Model([[1.0]], [[-0.2]], [[1.0]], contact=contact), 0.1, 10.0, 41,
                    continuation="natural", contact={"law": "penalty"},
                    harmonics={"n_harmonics": 7})
    np.testing.assert_array_equal(again.omega, fluttering.omega)
    with pytest.raises(fw.InputError, match="set by an argument of the function already"):
        fw.mode(fw.Model([[1.0]], [[0.1]], [[1.0]]), 0.1, 1.0, mode={"start": 0.2})


def test_absent() -> None:
    linear = fw.frf(fw.Model([[1.0]], [[0.1]], [[1.0]], cosine=[1.0]), 0.5, 1.5, 3)
    with pytest.raises(fw.AbsentError, match="case%analysis = 'mode'"):
        _ = linear.mode
    assert "mode" not in fitting(linear)


def test_no_period_of_the_contact(fluttering: fw.Result) -> None:
    """Solved again as a response it would be another motion: refused, and no picture of it."""
    with pytest.raises(fw.AbsentError, match="nonlinear mode keeps no histories"):
        fluttering.cycle(20)
    assert set(fitting(fluttering)) == {"mode", "backbone", "harmonics", "convergence"}


def test_picture(fluttering: fw.Result, tmp_path: Path) -> None:
    upper, lower = plot_mode(fluttering).axes
    assert upper.get_xscale() == "log"
    np.testing.assert_array_equal(upper.lines[0].get_ydata(), fluttering.mode.frequency)
    np.testing.assert_array_equal(lower.lines[0].get_ydata(), fluttering.mode.damping_ratio)
    assert upper.lines[1].get_xdata()[0] == pytest.approx(0.5)
    assert [text.get_text() for text in lower.get_legend().get_texts()] == [
        "onset, 0.5", "stable limit cycle, 0.716", "unstable limit cycle, 2.35"]
    fluttering.save(tmp_path / "mode.h5")
    assert main(["plot", str(tmp_path / "mode.h5"), "--kind", "mode", "-o",
                 str(tmp_path / "mode.png")]) == 0
    assert (tmp_path / "mode.png").stat().st_size > 5000


def test_backbone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Responses put together from the mode have their tops on it, sweeps near it."""
    contact = fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=0.5, tangential_stiffness=1.0)
    model = fw.Model([[1.0]], [[0.02]], [[1.0]], contact=contact, cosine=[0.1])
    shared: Any = {"contact": {"law": "penalty"}, "harmonics": {"n_harmonics": 3}}
    curve = fw.mode(model, 0.1, 10.0, 81, continuation="natural", mode={"synthesis": [1.0, 5.0]},
                    **shared)
    swept = fw.frf(model, 0.8, 1.6, 41, load={"harmonic_scale": 5.0}, **shared)
    (axes,) = plot_backbone([swept, curve]).axes
    dashed = [line for line in axes.lines if line.get_linestyle() == "--"]
    assert len(dashed) == 2 and axes.get_yscale() == "log"
    x, y = dashed[1].get_xdata(), dashed[1].get_ydata()
    top = int(np.argmax(y))
    assert y[top] == pytest.approx(np.exp(np.interp(
        0.0, np.log(curve["mode/resonant_scale"][20:] / 5.0), np.log(curve.mode.amplitude[20:]))),
        rel=1e-2)
    assert np.isfinite(x).all() and (np.diff(x[:top]) > -1e-3).all()
    peak = np.abs(swept.harmonic(1)).max()
    assert y[top] == pytest.approx(peak, rel=0.03)
    # Alone, by the command, and refused without a mode.
    curve.save(tmp_path / "mode.h5")
    swept.save(tmp_path / "swept.h5")
    out = str(tmp_path / "backbone.png")
    paths = [str(tmp_path / "mode.h5"), str(tmp_path / "swept.h5")]
    assert main(["plot", *paths, "--kind", "backbone", "-o", out]) == 0
    assert main(["plot", paths[0], "--kind", "backbone", "-o", out]) == 0
    assert main(["plot", paths[1], paths[1], "--kind", "backbone", "-o", out]) == 3
    assert "no result is of a mode" in capsys.readouterr().err


def two_masses(**groups: Any) -> fw.Case:
    """Friction at the second mass changes the shape of a mode that is driven at the first."""
    contact = fw.ContactPairs([[2, 0, 0]], mu=1.0, normal_load=0.1, tangential_stiffness=0.5)
    model = fw.Model(np.diag([1.0, 0.5]), None, [[1.0, -0.2], [-0.2, 0.8]], contact=contact,
                     cosine=[1.0, 0.0], observe={"drive": 1})
    return fw.Case(model, contact={"law": "penalty"}, harmonics={"n_harmonics": 5},
                   structure={"rayleigh_mass": 0.004}).replace(**groups)


def test_two_damping_ratios(tmp_path: Path) -> None:
    """F/(2 m a) of phase resonances is the ratio of the mode times its modal mass over m."""
    track = fw.run(two_masses(
        case={"analysis": "resonance"}, sweep={"start": 0.5, "end": 1.5, "n_points": 100},
        resonance={"parameter": "load%harmonic_scale", "start": 0.02, "end": 0.3, "n_points": 9,
                   "condition": "phase"})).resonance
    assert track.converged.all()
    rows = [0.01, *track.first_harmonic.tolist()]
    result = fw.run(two_masses(case={"analysis": "mode"}, mode={
        "amplitudes": rows, "start": rows[0], "end": rows[-1], "n_points": len(rows),
        "continuation": "natural"}))
    mode = result.mode
    # The stuck mode, by its eigenvector.
    root = np.diag([1.0, 0.5**-0.5])
    shape = np.linalg.eigh(root @ np.array([[1.0, -0.2], [-0.2, 1.3]]) @ root)[1][:, 0]
    assert mode.modal_mass[0] == pytest.approx(1.0 / shape[0]**2, rel=1e-9)
    measured = track.parameter / (2.0 * mode.modal_mass[0] * track.omega**2 * track.first_harmonic)
    # Other modes take part where friction damps by a per cent, and less where it is small.
    assert mode.forced_damping_ratio()[1:] == pytest.approx(measured, rel=0.015)
    assert mode.forced_damping_ratio()[-1] == pytest.approx(measured[-1], rel=2e-4)
    assert mode.forced_damping_ratio(2.0 * mode.modal_mass[0])[-1] == pytest.approx(
        0.5 * measured[-1], rel=2e-4)
    assert abs(mode.damping_ratio[-1] / measured[-1] - 1.0) > 0.1
    lower = plot_mode(result).axes[1]
    assert "ξ/(2ω)" in lower.get_ylabel()
    (dashed,) = [line for line in lower.lines if line.get_linestyle() == "--"]
    assert "F/(2ma)" in str(dashed.get_label())
    assert dashed.get_ydata() == pytest.approx(mode.forced_damping_ratio())


def test_one_damping_ratio_has_one_curve(fluttering: fw.Result) -> None:
    """Of one mass the shape stays, and both are the same."""
    np.testing.assert_allclose(fluttering.mode.forced_damping_ratio(),
                               fluttering.mode.damping_ratio, rtol=1e-12)
