"""The example of the measured beam without its record: methods, calibration, scatter."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la

from fretwear.beam import BeamParameters, ReducedBeam, generate

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "example" / "brake_reuss"))

import attempts
import fit
import hammer
import methods
from record import MASS, Level, Repeatability, repeatability

#: Of two methods whose harmonics are the same, where the shape changes with the amplitude.
METHODS = 1e-3
#: Splines between forces, and straight lines between frequencies 0.05 Hz apart.
BETWEEN = 1e-2
#: Of two reductions to four modes, with other coordinates held.
REDUCED = 1e-5


@pytest.fixture(scope="module", name="coarse")
def generate_coarse() -> ReducedBeam:
    """Eight pairs, for what needs many runs."""
    return generate(BeamParameters(arm_elements=6, lap_elements=16, n_modes=4))


def levels_of(beam: ReducedBeam, accelerations: list[float]) -> list[Level]:
    """Phase resonances of a beam, as a record has them."""
    near = [Level(f"RC {k}", 80.2, one, 1.0) for k, one in enumerate(accelerations)]
    found = fit.predict(beam, near)
    n = len(near)
    return [Level(one.name, f, one.displacement * (2.0 * np.pi * f)**2,
                  2.0 * MASS * d * one.displacement * (2.0 * np.pi * f)**2)
            for one, f, d in zip(near, found[:n], found[n:])]


def test_methods_agree(coarse: ReducedBeam) -> None:
    levels = levels_of(coarse, [40.0, 60.0, 80.0])
    mode, resonance, control = (method(coarse, levels) for method in methods.METHODS.values())
    assert mode[3] < 0.8 * mode[5]
    for other in (resonance, control):
        assert other[:3] == pytest.approx(mode[:3], rel=METHODS)
        assert other[3:] == pytest.approx(mode[3:], rel=BETWEEN)


def test_calibration_finds_what_is_known(coarse: ReducedBeam) -> None:
    """Without noise: limit and spring by `fw.calibrate` at the true exponent and stiffness, and all
    four by Gauss-Newton steps from elsewhere."""
    truth = coarse.changed(stiffness=1.002, limit=1.1 * coarse.full.parameters.limit, exponent=0.45,
                           cubic=1.3e11)
    noise = Repeatability(0.03, 0.03)
    levels = levels_of(truth, [20.0, 50.0, 80.0])
    p = truth.full.parameters
    expected = np.array([p.limit, p.cubic, p.exponent, 1.002])
    search = fit.Search(coarse, levels, noise, expected * np.array([0.95, 1.1, 1.0, 1.0]))
    inner = search.at(np.log(expected[2:]))
    assert inner.converged and inner.chi_square < 1e-6
    assert search.guess == pytest.approx(expected, rel=1e-4)
    off = fit.Fitted(coarse, coarse, expected * np.array([1.03, 0.97, 1.02, 0.9995]), [0, 1, 2, 3],
                     np.zeros((4, 4)), inner, np.inf, 2, 0)
    found = fit.refine(off, levels, noise)
    assert found.squares < 1e-6
    assert found.values == pytest.approx(expected, rel=1e-3)
    # Four numbers of six tell nothing better than each of the six alone.
    assert (found.errors > 0.0).all()
    assert (found.deviations(levels)[:3] < 1.01 * noise.frequency).all()


def test_repeatability_is_the_scatter_that_was_put_in() -> None:
    """Runs of the second kind that stand off by a constant: a half of its square is each run's."""
    held = [Level(f"RC {k}", 80.0, a, 1e-3 * a) for k, a in enumerate((10.0, 20.0, 40.0))]
    others = [replace(one, name=f"FC {k}", frequency=80.1, acceleration=15.0 + k,
                      force=1e-3 * (15.0 + k) * np.exp(0.04))
              for k, one in enumerate(held)]
    found = repeatability(held + others)
    assert found.frequency == pytest.approx(0.1 / np.sqrt(2.0), rel=1e-9)
    assert found.damping == pytest.approx(0.04 / np.sqrt(2.0), rel=1e-9)


def test_pairs_with_normal_motion_are_the_same_joint() -> None:
    """What was taken from the stiffness comes back by springs in the pairs."""
    p = BeamParameters(arm_elements=6, lap_elements=16, n_modes=4)
    opened = attempts.Opened.of(p)
    n = len(opened.cell)
    stiffness = opened.stiffness + np.diag(np.concatenate((
        p.tangential_stiffness * opened.cell, p.normal_stiffness * opened.cell,
        np.zeros(len(opened.mass) - 2 * n))))
    values = la.eigh(stiffness, opened.mass, eigvals_only=True)
    expected = generate(p).modes(1)[0][0]
    assert np.sqrt(values[3]) / (2.0 * np.pi) == pytest.approx(expected, rel=REDUCED)


def test_peaks_of_a_decay() -> None:
    """Two modes and noise: frequencies and damping ratios that were put in."""
    time = np.arange(-128, 5 * 12800) / 12800.0
    after = np.maximum(time, 0.0)
    rng = np.random.default_rng(4)
    known = ((80.0, 1.5e-3, 30.0), (300.0, 1e-3, 50.0))
    channel = sum(size * np.exp(-ratio * 2.0 * np.pi * f * after)
                  * np.cos(2.0 * np.pi * f * after) * (time >= 0.0) for f, ratio, size in known)
    found = hammer.peaks(time, np.array([channel + 0.01 * rng.standard_normal(len(time))]))
    assert len(found) == 2
    for one, (f, ratio, size) in zip(found, known):
        assert one.frequency == pytest.approx((f, f), rel=1e-4)
        assert one.damping == pytest.approx((ratio, ratio), rel=0.02)
        assert one.acceleration == pytest.approx(size, rel=0.2)
