"""A resonance over a parameter in Python, its optimum, its derivatives and its picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fretwear as fw
from fretwear.cli import main
from fretwear.plot import fitting, plot_resonance

#: The closed form of one harmonic: best normal load and its amplitude.
BEST = (0.40320249672597236, 0.7903043939637545)
#: What the polynomial through five rows 0.02 apart leaves of them.
POLYNOMIAL = (2e-4, 1e-6)
#: Solutions of the tolerance of the case, through the condition of the peak.
SAME = 1e-6


def follow(**resonance: Any) -> fw.Result:
    """The damper of the example."""
    contact = fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=0.35, tangential_stiffness=1.0)
    model = fw.Model([[1.0]], [[0.05]], [[1.0]], cosine=[0.3], contact=contact)
    keys = {"parameter": "contact%normal_load", "start": 0.35, "end": 0.47, "n_points": 7}
    return fw.run(fw.Case(
        model, case={"analysis": "resonance"}, contact={"law": "penalty"},
        harmonics={"n_harmonics": 1}, sweep={"start": 0.5, "end": 2.0, "n_points": 60},
        sensitivity={"parameters": ["contact%normal_load"], "deviation": [0.1]},
        resonance=keys | resonance))


@pytest.fixture(scope="module")
def damper() -> fw.Result:
    return follow()


def test_track(damper: fw.Result) -> None:
    track = damper.resonance
    assert (track.name, track.by_factor) == ("contact%normal_load", False)
    assert (track.condition, track.quantity) == ("amplitude", "first_harmonic")
    assert track.converged.all()
    np.testing.assert_allclose(track.parameter, np.linspace(0.35, 0.47, 7))
    assert track.amplitude[0] == pytest.approx(0.8059371676716807, rel=SAME)
    assert track.omega[0] == pytest.approx(1.1868958212206784, rel=SAME)
    np.testing.assert_allclose(track.frequency, track.omega / (2 * np.pi))
    assert (track.curvature < 0.0).all()


def test_by_the_function(damper: fw.Result) -> None:
    contact = fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=0.35, tangential_stiffness=1.0)
    model = fw.Model([[1.0]], [[0.05]], [[1.0]], cosine=[0.3], contact=contact)
    shared: Any = {"contact": {"law": "penalty"}, "harmonics": {"n_harmonics": 1}}
    again = fw.resonance(model, "contact%normal_load", 0.35, 0.47, 7, between=(0.5, 2.0),
                         n_sweep=60, **shared).resonance
    np.testing.assert_allclose(again.amplitude, damper.resonance.amplitude, rtol=SAME)
    factors = fw.resonance(model, "contact%normal_load", 1.0, 1.2, 2, between=(0.5, 2.0),
                           by_factor=True, **shared).resonance
    assert factors.by_factor and factors.amplitude[0] == pytest.approx(again.amplitude[0], rel=SAME)


def test_it_prints_as_a_table(damper: fw.Result) -> None:
    assert "resonance_omega" in repr(damper.sensitivities)


def test_optimum(damper: fw.Result) -> None:
    best = damper.resonance.optimum()
    assert best is not None
    assert best[0] == pytest.approx(BEST[0], rel=POLYNOMIAL[0] * 10)
    assert best[1] == pytest.approx(BEST[1], rel=POLYNOMIAL[1] * 10)
    assert follow(end=0.38).resonance.optimum() is None


def test_derivatives(damper: fw.Result) -> None:
    slopes = damper.sensitivities
    assert slopes["first_harmonic"]["contact%normal_load"][0, 0, 0] == pytest.approx(
        -0.673214206405968, rel=SAME)
    assert slopes["resonance_omega"]["contact%normal_load"][0, 0] == pytest.approx(
        0.852251637367204, rel=1e-4)
    assert slopes.deviation["resonance_omega"][0] == pytest.approx(
        0.1 * 0.35 * 0.852251637367204, rel=1e-4)


def test_factors() -> None:
    track = follow(**{"as": "factor", "start": 1.0, "end": 1.2, "n_points": 2}).resonance
    assert track.by_factor
    assert track.amplitude[0] == pytest.approx(0.8059371676716807, rel=SAME)


def test_picture(damper: fw.Result, tmp_path: Path) -> None:
    assert "resonance" in fitting(damper) and "response" not in fitting(damper)
    figure = plot_resonance(damper)
    assert len(figure.axes) == 2
    damper.save(tmp_path / "track.h5")
    assert main(["plot", "--kind", "resonance", str(tmp_path / "track.h5"),
                 "-o", str(tmp_path / "track.png")]) == 0
    assert (tmp_path / "track.png").exists()


def test_other_results_have_none() -> None:
    model = fw.Model([[1.0]], [[0.05]], [[1.0]], cosine=[0.3])
    with pytest.raises(fw.AbsentError, match="case%analysis = 'resonance'"):
        _ = fw.frf(model, 0.5, 1.5, 5).resonance
