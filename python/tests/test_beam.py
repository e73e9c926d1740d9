"""The bolted beam: exact frequencies and stiffness, a model made elsewhere, and its file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la

import fretwear as fw
from fretwear.beam import BeamParameters, ParameterError, ReducedBeam, build_full, generate, limits
from fretwear.beam.cli import main, read_parameters
from fretwear.beam.element import Section, element_matrices

#: The numbers of a model of the same beam that was made elsewhere, without rotary inertia.
ELSEWHERE = BeamParameters(young=1.93e11, tangential_stiffness=7.391894e8, limit=8832.142387033588,
                           exponent=0.37246849175452285)
FREQUENCIES = (80.41684574, 312.032320, 552.680918, 895.922129)
#: Relative: rotary inertia takes (pi n h/L)^2/24 or so of a frequency, 3e-3 of the fourth.
ROTARY = 3e-3
#: Of 48 elements, the fourth mode.
MESH = 1e-4
#: Of 192 elements: the axes of halves are strained evenly along each.
HALVES = 1e-3


@pytest.fixture(scope="module", name="beam")
def generate_beam() -> ReducedBeam:
    return generate()


@pytest.fixture(scope="module", name="coarse")
def generate_coarse() -> ReducedBeam:
    """Eight pairs, for what needs many runs."""
    return generate(BeamParameters(arm_elements=6, lap_elements=16, n_modes=4))


def timoshenko(p: BeamParameters, n: int) -> np.ndarray:
    """Frequencies [Hz] of a free beam, by its differential equations: w, rotation, moment and shear
    force over the length; both forces vanish at both ends."""
    area = p.width * p.thickness
    inertia = area * p.thickness**2 / 12.0
    shear = 5.0 / 6.0 * area * p.young / (2.0 * (1.0 + p.poisson))

    def residue(frequency: float) -> float:
        square = p.density * (2.0 * np.pi * frequency)**2
        along = np.array([[0.0, 1.0, 0.0, 1.0 / shear], [0.0, 0.0, 1.0 / (p.young * inertia), 0.0],
                          [0.0, -square * inertia, 0.0, -1.0], [-square * area, 0.0, 0.0, 0.0]])
        # Of one size each, or the exponential loses its digits.
        unit = np.array([1.0, 1.0 / p.length, p.young * inertia / p.length**2,
                         p.young * inertia / p.length**3])
        end = la.expm(along * unit[None, :] / unit[:, None] * p.length)
        return float(la.det(end[2:, :2]))

    places = np.arange(20.0, 2000.0, 5.0)
    values = [residue(place) for place in places]
    found = []
    for low, high, one, other in zip(places, places[1:], values, values[1:]):
        if one * other < 0.0:
            while high - low > 1e-9 * high:
                middle = 0.5 * (low + high)
                low, high = (middle, high) if residue(middle) * one > 0.0 else (low, middle)
            found.append(low)
    return np.array(found[:n])


@pytest.mark.parametrize(("offsets", "n", "error"), [
    ((0.0,), 48, MESH), ((0.004,), 48, MESH), ((0.003175, -0.003175), 192, HALVES)])
def test_elements_make_a_beam(offsets: tuple[float, ...], n: int, error: float) -> None:
    """The closed form of a free beam: by its axis, by a line beside it, and by two halves of the
    thickness on one line between them."""
    p = BeamParameters()
    parts = len(offsets)
    section = Section(p.width, p.thickness / parts, p.young, p.poisson, p.density)
    mass, stiffness = np.zeros((3 * n + 3, 3 * n + 3)), np.zeros((3 * n + 3, 3 * n + 3))
    for k in range(n):
        own = slice(3 * k, 3 * k + 6)
        for offset in offsets:
            one = element_matrices(section, p.length / n, offset)
            mass[own, own] += one[0]
            stiffness[own, own] += one[1]
    values = la.eigh(stiffness, mass, eigvals_only=True)
    assert np.sqrt(np.abs(values[:3])).max() < 1.0
    # Of free ends the first motion along the beam is at 3400 Hz, above these.
    assert np.sqrt(values[3:7]) / (2.0 * np.pi) == pytest.approx(timoshenko(p, 4), rel=error)
    along, across = np.tile([1.0, 0.0, 0.0], n + 1), np.tile([0.0, 1.0, 0.0], n + 1)
    whole = p.density * p.width * p.thickness * p.length
    assert [v @ mass @ v for v in (along, across)] == pytest.approx([whole, whole], rel=1e-12)


def test_the_whole_beam_moves_as_a_body(beam: ReducedBeam) -> None:
    """Masses are there once, and without the suspension nothing holds the beam."""
    full, p = beam.full, beam.full.parameters
    across = np.tile([0.0, 1.0, 0.0], full.mass.shape[0] // 3)
    along = np.roll(across, -1)
    whole = (p.density * p.width * p.thickness * p.length + 3.0 * p.bolt_mass + p.drive_mass)
    assert across @ full.mass @ across == pytest.approx(whole, rel=1e-12)
    assert along @ full.mass @ along == pytest.approx(whole - p.drive_mass, rel=1e-12)
    for motion in (across, along):
        assert np.sqrt(motion @ full.stiffness @ motion / whole) == pytest.approx(
            2.0 * np.pi * p.suspension, rel=1e-6)
        assert np.abs(full.rows @ motion).max() == 0.0
    assert full.drive @ across == pytest.approx(1.0, rel=1e-12)


def test_the_open_lap_is_soft_as_two_beams_are(beam: ReducedBeam) -> None:
    """Neighbours that slide by different amounts strain both halves and bend them together: an
    eighth of the axial stiffness of one half, and no force between others."""
    p = beam.full.parameters
    one = p.young * p.width * 0.5 * p.thickness / 8.0 / p.cell
    own = beam.stiffness[:12, :12]
    chain = np.diag(np.full(12, 2.0 * one)) - one * (np.eye(12, k=1) + np.eye(12, k=-1))
    chain[0, 0] = one
    # The last one touches the part that is bonded.
    assert np.abs(own - chain)[:11, :12].max() < 1e-6 * one


def test_a_model_made_elsewhere() -> None:
    beam = generate(ELSEWHERE)
    frequency, mass = beam.modes(4)
    assert frequency == pytest.approx(FREQUENCIES, rel=ROTARY)
    assert frequency[0] == pytest.approx(FREQUENCIES[0], rel=5e-4)
    assert (frequency < FREQUENCIES).all()
    assert mass[0] == pytest.approx(1.95124, rel=1e-3)
    assert len(beam.mass) == 35 and len(beam.full.cell) == 24
    assert beam.stiffness[0, 1] == pytest.approx(-1556448499.999992, rel=1e-9)
    assert limits(beam.full, ELSEWHERE.limit, ELSEWHERE.exponent)[:5] == pytest.approx(
        [2.462569478, 8.660441895, 11.300457602, 13.160871813, 14.656427275], rel=1e-8)


def test_limits_are_means() -> None:
    """Their sum does not depend on the cells but for where the bonded part begins."""
    sums = []
    for n in (24, 48, 96):
        full = build_full(BeamParameters(lap_elements=n))
        p = full.parameters
        end = 0.5 * p.lap - np.abs(full.position).min() + 0.5 * p.cell
        sums.append(limits(full, 1.0, 0.5).sum() / end**1.5)
    assert sums == pytest.approx([sums[0]] * 3, rel=1e-12)


def test_changes_without_another_reduction(coarse: ReducedBeam) -> None:
    changed = coarse.changed(stiffness=0.98, limit=5000.0, exponent=0.6, cubic=0.0)
    anew = generate(changed.full.parameters)
    pairs = slice(0, len(coarse.full.cell))
    assert np.abs(changed.stiffness - anew.stiffness)[pairs, pairs].max() < (
        1e-9 * anew.stiffness.max())
    assert changed.modes(3)[0] == pytest.approx(anew.modes(3)[0], rel=1e-9)
    assert changed.modes(1)[0] == pytest.approx(np.sqrt(0.98) * coarse.modes(1)[0], rel=1e-9)
    assert changed.model().springs == ()
    with pytest.raises(ParameterError, match="lap needs another reduction"):
        coarse.changed(lap=0.1)


def test_the_file_is_the_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "brb.h5"
    assert main(["-o", str(path), "--limit", "8000", "--lap-elements", "16"]) == 0
    assert "frequencies with the lap stuck" in capsys.readouterr().out
    parameters = read_parameters(path)
    assert parameters == BeamParameters(limit=8000.0, lap_elements=16)
    amplitudes = [1e-4, 2e-4]
    settings = {"case": {"analysis": "mode"}, "harmonics": {"n_harmonics": 3},
                "mode": {"amplitudes": amplitudes, "near": 80.0, "unit": "Hz"}}
    found = [fw.run(fw.Case(model, **settings), in_memory=True).mode  # type: ignore[arg-type]
             for model in (generate(parameters).model(), str(path))]
    assert found[0].omega.tolist() == found[1].omega.tolist()
    assert found[0].damping_ratio.tolist() == found[1].damping_ratio.tolist()


@pytest.mark.parametrize(("words", "message"), [
    (["--lap", "0.8"], "lap = 0.8"), (["--lap-elements", "9"], "lap_elements = 9"),
    (["--lap-elements", "14"], "bolts stand at nodes"), (["--poisson", "0.5"], "poisson"),
    (["--drive-place", "0.4"], "drive_place"), (["--young", "nan"], "a finite number"),
    (["--bolt-distance", "0.07"], "bolt_distance"), (["--n-modes", "100000"], "n_modes")])
def test_what_is_refused(tmp_path: Path, words: list[str], message: str,
                         capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["-o", str(tmp_path / "brb.h5"), *words]) == 3
    assert message in capsys.readouterr().err
    assert not (tmp_path / "brb.h5").exists()


def test_no_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["-q", "-o", str(tmp_path / "none" / "brb.h5")]) == 5
    assert "no folder" in capsys.readouterr().err
