"""Loops and histories are those of the law, whatever the result holds."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from program import run

import fretwear as fw
from fretwear.plot import Choices, plot_cycle, plot_hysteresis
from fretwear.report import render_report
from fretwear.rows import synthesis

# A mass that rubs with a friction limit of mu N = 6.
LIMIT = 6.0
RUBBING = fw.Model([[1.0]], [[0.4]], [[100.0]], cosine=[12.0], observe={"x": 1},
                   contact=fw.ContactPairs([[1, 0, 0]], mu=0.3, normal_load=20.0))
# The law gives the limit itself, as a product of two numbers.
ROUNDING = 1e-12
# Least overshoot of the sum of harmonics, which pictures of this case once showed.
OVERSHOOT = 1.05
# The same solution twice, each to the tolerance of its solver.
SOLVED = 1e-6


def sweep(**groups: dict[str, object]) -> fw.Result:
    """Through the resonance of the rubbing mass."""
    return fw.run(fw.Case(RUBBING, harmonics={"n_harmonics": 9},
                          sweep={"start": 6, "end": 14, "n_points": 9}).replace(**groups))


def of_series(result: fw.Result, point: int) -> np.ndarray:
    """Contact forces as the sum of their harmonics."""
    tau = np.linspace(0.0, 2.0 * np.pi, 2001)
    return np.einsum("cij,ct->tij", result.force[point], synthesis(result.force.shape[1], tau))


@pytest.mark.parametrize("harmonics", [
    {}, {"n_time": 512}, {"parity": "all"}, {"method": "tcm"},
    {"accuracy": 1e-2, "n_harmonics": 31}], ids=str)
def test_friction_stays_below_its_limit(harmonics: dict[str, object]) -> None:
    result = sweep(harmonics=harmonics)
    point = result.peak()
    assert np.abs(of_series(result, point)[:, 0, 0]).max() > OVERSHOOT * LIMIT
    force = result.cycle(point).force[:, 0, 0]
    assert np.abs(force).max() == pytest.approx(LIMIT, rel=ROUNDING)
    # At the limit as long as the pair slips, but for the instants beside its events.
    slipping = (np.abs(force[:-1]) > (1.0 - ROUNDING) * LIMIT).mean()
    assert slipping == pytest.approx(result.fraction[point, 0, 1], abs=5.0 / len(force))
    assert slipping > 0.8
    (line,) = plot_hysteresis(result, point).axes[0].lines
    assert np.array_equal(line.get_ydata(), force)


def test_a_cycle_is_the_history_of_the_same_run() -> None:
    """Solved once more or kept by the run: the same period."""
    groups = {"harmonics": {"sampling": "uniform", "n_time": 128}}
    again = sweep(**groups)
    kept = sweep(**groups, output={"histories": True})
    for point in (0, again.peak(), 8):
        one, other = again.cycle(point), kept.cycle(point)
        assert one.force == pytest.approx(other.force, abs=SOLVED * LIMIT)
        assert one.displacement == pytest.approx(other.displacement, abs=SOLVED)
        assert np.array_equal(one.degrees, other.degrees)


def test_a_branch_and_a_file_have_their_law_too(examples: Path, tmp_path: Path) -> None:
    """Normal contact never pulls, along the folds of a branch and for a case of fw_run."""
    result = run(examples.parent / "gap" / "gap.nml", tmp_path / "gap.h5",
                 "sweep%continuation='arclength'")
    point = result.peak()
    assert of_series(result, point)[:, 0, 2].max() > 0.0  # tension
    normal = result.cycle(point).force[:, 0, 2]
    assert normal.max() == 0.0 and normal.min() < 0.0


def test_of_several_solutions_that_of_the_result_is_shown(examples: Path, tmp_path: Path) -> None:
    """On the way down another one than from a start near it; behind a fold of a branch."""
    wave = run(examples.parent / "shrouded_disk" / "wave.nml", tmp_path / "wave.h5")
    stop = fw.ContactPairs([[0, 0, 1]], mu=0.0, gap=0.5, tangential_stiffness=1.0,
                           normal_stiffness=2.0)
    model = fw.Model([[1.0]], [[0.05]], [[1.0]], contact=stop, cosine=[0.1])
    branch = fw.run(fw.Case(model, contact={"law": "penalty"}, harmonics={"n_harmonics": 7},
                            sweep={"start": 0.7, "end": 1.6, "n_points": 61,
                                   "continuation": "arclength"}))
    behind = int(np.flatnonzero(np.diff(branch.omega) < 0.0)[0]) + 2
    for result, point in ((wave, 30), (branch, behind)):
        cycle = result.cycle(point)
        tau = np.radians(cycle.degrees[:-1])
        first = 2.0 * np.einsum("tij,t->ij", cycle.force[:-1],
                                np.cos(tau)) / len(tau)
        stored = result.force[point][1]
        # A sum over instants of a force with kinks; another solution is off by 0.4.
        assert first == pytest.approx(stored, abs=0.03 * np.abs(stored).max())


def test_wear_shows_the_law_of_the_worn_joint(tmp_path: Path) -> None:
    """Each step has its own gap."""
    model = fw.Model.from_hdf5(Path(__file__).resolve().parents[2] / "example" / "blade_sector"
                               / "sector_16.h5")
    result = fw.wear(model, 1022.5, 1e-9, 1e7, unit="Hz",
                     structure={"modal_damping": 1e-3, "rotation_speed": 460.8},
                     contact={"mu": 0.5}, load={"harmonic_scale": 0.5},
                     harmonics={"n_harmonics": 3, "n_time": 128})
    assert result.depth[-1].max() > 0.0
    force = result.cycle(result.n_points - 1).force
    tangential = np.linalg.norm(force[..., :2], axis=2)
    assert (tangential <= 0.5 * -force[..., 2] + ROUNDING * tangential.max()).all()


@pytest.mark.parametrize("groups", [
    {}, {"harmonics": {"n_time": 512}}, {"harmonics": {"method": "tcm"}},
    {"harmonics": {"accuracy": 1e-2, "n_harmonics": 31}},
    {"contact": {"memory": "carried", "law": "dlft"}}, {"sweep": {"continuation": "arclength"}},
    {"case": {"analysis": "time"}, "time": {"steps_per_period": 400}}], ids=str)
def test_a_sweep_keeps_the_period_of_its_peak(groups: dict[str, object]) -> None:
    """The loops of the reported maximum are those of the law, and enclose what is dissipated
    there."""
    result = sweep(**groups)
    cycle = result.peak_cycle
    omega, height = result.maximum()
    assert 2.0 * np.pi * cycle.frequency == pytest.approx(omega, rel=1e-6)
    assert np.abs(cycle.displacement[:, 0, 0]).max() == pytest.approx(height, rel=1e-3)
    assert np.abs(cycle.force[:, 0, 0]).max() == pytest.approx(LIMIT, rel=1e-9)
    # It slips all the way: 4 mu N times the amplitude.
    work = np.trapezoid(cycle.force[:, 0, 0], cycle.displacement[:, 0, 0])
    assert work == pytest.approx(4.0 * LIMIT * height, rel=3e-2)
    (line,) = plot_hysteresis(result).axes[0].lines
    assert np.array_equal(line.get_ydata(), cycle.force[:, 0, 0])
    upper, lower = plot_cycle(result).axes
    assert np.abs(upper.lines[0].get_ydata()).max() == pytest.approx(height, rel=1e-3)
    assert np.array_equal(lower.lines[0].get_ydata(), cycle.displacement[:, 0, 0])


def test_the_pairs_kept_dissipate_most() -> None:
    """Of seven rubbing masses, in the order of what they dissipate at the peak."""
    n = 7
    model = fw.Model(np.eye(n), 0.05 * np.eye(n), np.diag(np.linspace(1.0, 1.3, n)),
                     cosine=np.linspace(1.0, 0.4, n), observe={"x": 4},
                     contact=fw.ContactPairs([[j + 1, 0, 0] for j in range(n)], mu=0.3,
                                             normal_load=0.5))
    result = fw.run(fw.Case(model, harmonics={"n_harmonics": 5},
                            contact={"law": "penalty", "tangential_stiffness": 5.0},
                            sweep={"start": 0.7, "end": 1.6, "n_points": 10}))
    cycle = result.peak_cycle
    work = np.trapezoid(cycle.force[..., 0], cycle.displacement[..., 0], axis=0)
    assert len(cycle.pairs) == 6 and (np.diff(work) <= 0.0).all()
    again = fw.run(result.case.replace(sweep={"start": 2.0 * np.pi * cycle.frequency, "end": 2.0,
                                              "n_points": 2}))
    assert work == pytest.approx(again.dissipation[0][cycle.pairs], rel=1e-2)
    assert (again.dissipation[0][cycle.pairs].min()
            >= np.delete(again.dissipation[0], cycle.pairs).max())
    titles = [axes.get_title().split(",")[0] for axes in plot_hysteresis(result).axes]
    assert titles == [f"pair {pair + 1}" for pair in sorted(cycle.pairs)]


def test_where_the_law_cannot_be_had_it_is_said(tmp_path: Path) -> None:
    """No series in its place, in pictures and in the report."""
    result = sweep()
    saved = fw.Result(result.save(tmp_path / "rubbing.h5").path)  # another program reads it
    with pytest.raises(fw.AbsentError, match="its model was in the memory"):
        saved.cycle(0)
    with pytest.raises(fw.AbsentError, match="its model was in the memory"):
        plot_hysteresis(saved, 0)
    with pytest.raises(fw.AbsentError, match="its model was in the memory"):
        plot_cycle(saved, 0)
    page = re.sub(r"data:image[^\"]*", "", render_report(saved, Choices(point=0)))
    assert page.count("its model was in the memory") == 2  # loops, cycle
    assert "Frequency response" in page
    # At the peak they are kept.
    assert "its model was in the memory" not in re.sub(
        r"data:image[^\"]*", "", render_report(saved, Choices()))
    with pytest.raises(fw.InputError, match="must be an integer from 0 to 8"):
        result.cycle(9)


def test_another_solution_is_not_drawn_for_that_of_the_result(tmp_path: Path) -> None:
    result = sweep()
    point = result.peak()
    other = fw.Result.from_bytes(result.save(tmp_path / "a.h5").path.read_bytes(),
                                 result.case.replace(load={"harmonic_scale": 1.001}))
    with pytest.raises(fw.AbsentError, match=r"leads to another solution\); run with "
                                             "output%histories"):
        other.cycle(point)


def test_a_point_that_failed_has_no_period() -> None:
    result = fw.run(fw.Case(RUBBING, harmonics={"n_harmonics": 9},
                            contact={"law": "dlft"},
                            solver={"max_iterations": 1, "fallback": False},
                            sweep={"start": 9, "end": 11, "n_points": 3}), check=False)
    failed = int(np.flatnonzero(~result.converged)[0])
    with pytest.raises(fw.AbsentError, match="has not converged"):
        result.cycle(failed)
