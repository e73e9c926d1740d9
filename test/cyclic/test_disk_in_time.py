"""A wave around six sectors whose shrouds slip, by one sector and as one structure integrated in
time, as docs/benchmarks/joints.md has it."""
import pytest
from project import PROGRAM

from bench.common.measure import Bench
from bench.precision.joints_in_time import HARMONICS, disk


@pytest.fixture(scope="module", name="joint")
def run_all(tmp_path_factory):
    return disk(Bench(PROGRAM, tmp_path_factory.mktemp("disk")))


def test_balance_comes_to_the_integration(joint):
    """Steps of a thousandth of a period leave some 1e-5, fifteen harmonics 1e-5 and 1e-4."""
    energy, swing = joint.energy, joint.amplitude
    assert energy["time"] > 0.0
    assert swing[15] == pytest.approx(swing["time"], rel=1e-4)
    assert energy[15] == pytest.approx(energy["time"], rel=1e-3)
    assert swing["accuracy"] == pytest.approx(swing["time"], rel=1e-3)
    # More harmonics are nearer.
    off = [abs(energy[h] / energy["time"] - 1.0) for h in HARMONICS]
    assert off[0] > off[1] > off[2]


def test_all_sectors_by_the_balance_are_the_wave(joint):
    """The same equations, solved to the tolerance of the solver."""
    assert joint.amplitude["whole"] == pytest.approx(joint.amplitude[7], rel=1e-5)
    assert joint.energy["whole"] == pytest.approx(joint.energy[7], rel=1e-5)
