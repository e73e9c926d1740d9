"""Calibration: derivatives of what is compared, what is found, and how sure it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fretwear as fw
from fretwear.cli import main
from fretwear.design import ControlData, ModeData, ResponseData, calibrate
from fretwear.design.parameters import Unknowns
from fretwear.errors import ConvergenceError, InputError
from fretwear.plot.found import plot_calibration

TRUTH = (0.6, 1.2)
OVER = ["contact%normal_load", "contact%tangential_stiffness"]
BOUNDS = [(0.1, 3.0), (0.2, 5.0)]


def oscillator(values: Any = (0.5, 1.0), **groups: Any) -> fw.Case:
    contact = fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=values[0],
                              tangential_stiffness=values[1])
    model = fw.Model([[1.0]], [[0.05]], [[1.0]], contact=contact, cosine=[1.0])
    return fw.Case(model, contact={"law": "penalty"}, solver={"tolerance": 1e-12},
                   harmonics={"n_harmonics": 3}).replace(**groups)


def mode_case(values: Any = (0.5, 1.0)) -> fw.Case:
    return oscillator(values, case={"analysis": "mode"}, mode={"start": 0.1, "end": 10.0})


def response_case(values: Any = (0.5, 1.0), load: float = 0.7) -> fw.Case:
    return oscillator(values, load={"harmonic_scale": load},
                      sweep={"start": 0.8, "end": 1.8, "n_points": 21})


def response(values: Any, load: float = 0.7) -> tuple[Any, Any]:
    result = fw.run(response_case(values, load))
    return result.frequency, np.hypot(result.coefficients[:, 1, 0], result.coefficients[:, 2, 0])


def test_exact_responses_give_the_truth() -> None:
    data = [ResponseData(*response(TRUTH, load), deviation=0.05, case=response_case(load=load))
            for load in (0.3, 0.7)]
    found = calibrate(response_case(), data, over=OVER, bounds=BOUNDS)
    assert found.converged and found.is_exact and found.word == "solution"
    np.testing.assert_allclose(found.values, TRUTH, rtol=1e-6)
    assert found.chi_square < 1e-8 and found.freedom == 40
    assert [len(part) for part in found.predicted] == [21, 21]
    # The covariance is that of the derivatives: here by differences.
    unknowns = Unknowns(response_case(), OVER, BOUNDS)
    slopes = []
    for k in range(2):
        step = np.zeros(2)
        step[k] = 1e-4
        ends = [np.concatenate([one.predict(unknowns, np.array(TRUTH) + sign * step,
                                            response_case(load=load), slopes=False).values
                                for one, load in zip(data, (0.3, 0.7))]) for sign in (1, -1)]
        slopes.append((ends[0] - ends[1]) / 2e-4 / 0.05)
    expected = np.linalg.inv(np.array(slopes) @ np.array(slopes).T)
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-5)
    np.testing.assert_allclose(found.errors, np.sqrt(np.diag(expected)), rtol=1e-5)
    low, high = found.interval(0.6826894921370859)[0]
    assert high / found.values[0] == pytest.approx(np.exp(found.errors[0] / found.values[0]))
    assert low * high == pytest.approx(found.values[0]**2)
    assert "+-" in str(found) and "exact" in str(found)


def mode_data(**deviations: Any) -> ModeData:
    """Exact values at single amplitudes."""
    amplitude, rows = np.geomspace(0.3, 4.0, 8), []
    for a in amplitude:
        mode = fw.run(mode_case(TRUTH).replace(mode={
            "start": a, "end": 1.01 * a, "n_points": 2, "continuation": "natural"})).mode
        rows.append((mode.frequency[0], mode.damping_ratio[0]))
    frequency, damping = np.array(rows).T
    return ModeData(amplitude, frequency, damping, **deviations)


def test_exact_modes_give_the_truth() -> None:
    data = mode_data(frequency_deviation=1e-3, damping_deviation=3e-3)
    found = calibrate(mode_case(), data, over=OVER, bounds=BOUNDS)
    assert found.converged and found.is_exact
    np.testing.assert_allclose(found.values, TRUTH, rtol=1e-6)
    assert found.chi_square < 1e-8


def test_unknown_deviations_come_from_the_residuals() -> None:
    """Twice the noise gives twice the errors, whatever scale the numbers have."""
    frequency, amplitude = response(TRUTH)
    noise = np.random.default_rng(3).normal(size=len(amplitude))
    found = [calibrate(response_case(), ResponseData(frequency, amplitude + size * noise),
                       over=OVER, bounds=BOUNDS) for size in (1e-3, 2e-3)]
    np.testing.assert_allclose(found[1].errors, 2.0 * found[0].errors, rtol=0.05)
    assert (np.abs(found[0].values - TRUTH) < 4.0 * found[0].errors).all()
    # Student's distribution of 19 is wider than the normal one.
    assert np.ptp(np.log(found[0].interval()[0])) > 2 * 1.96 * (
        found[0].errors / found[0].values)[0] * 1.05


def test_recovers_noisy_data() -> None:
    """A short form of test/design/calibration_trials.py: 8 trials, 16 parameters."""
    frequency, amplitude = response(TRUTH)
    rng = np.random.default_rng(5)
    off = []
    for _ in range(8):
        data = ResponseData(frequency, amplitude + rng.normal(0.0, 0.05, len(amplitude)),
                            deviation=0.05)
        found = calibrate(response_case(), data, over=OVER, bounds=BOUNDS)
        off.append(np.abs(found.values - TRUTH) / found.errors)
    # Of 16 numbers 0.7 are further off than two errors; 4 or more are once in 200 times.
    assert (np.array(off) > 2.0).sum() <= 3 and (np.array(off) < 1.0).sum() >= 5


def test_loads_of_given_amplitudes() -> None:
    """Controlled tests: the load over the frequency at amplitudes beyond the onset of slip (0.5),
    in any order."""
    frequency, amplitude = np.tile([0.22, 0.16, 0.19], 2), np.repeat([2.0, 0.9], 3)
    truth = np.concatenate([fw.run(oscillator(TRUTH, control={"amplitude": [a]}, sweep={
        "values": [0.22, 0.16, 0.19], "unit": "Hz"})).load_scale for a in (2.0, 0.9)])
    case, data = oscillator(sweep={"values": [1.0]}), ControlData(frequency, amplitude, truth)
    found = calibrate(case, data, over=OVER, bounds=BOUNDS)
    assert found.converged and not found.is_exact
    np.testing.assert_allclose(found.values, TRUTH, rtol=1e-5)
    axes = plot_calibration(found, data).axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("frequency [Hz]", "load factor")
    # One by one, where the case has no list of frequencies.
    alone = data.predict(Unknowns(response_case(), OVER, BOUNDS), np.array(TRUTH), response_case(),
                         slopes=False)
    np.testing.assert_allclose(alone.values, truth, rtol=1e-9)
    with pytest.raises(InputError, match="must be positive"):
        ControlData([0.2], -1.0, [0.3])


def test_bounds_and_blind_data_are_told() -> None:
    data = ResponseData(*response(TRUTH), deviation=0.05)
    found = calibrate(response_case(), data, over=OVER, bounds=[(0.1, 0.5), (0.2, 5.0)])
    assert found.at_bound.tolist() == [1, 0] and np.isnan(found.errors[0])
    assert "contact%normal_load is at its upper bound and has no error" in found.word
    assert "residuals are larger than their deviations" in found.word
    assert np.isfinite(found.errors[1])
    # Friction limit and normal load are one number.
    twins = calibrate(response_case(), data, over=["contact%normal_load", "contact%mu"],
                      bounds=[(0.1, 3.0), (0.1, 3.0)])
    assert "do not tell apart contact%normal_load, contact%mu" in twins.word
    # A pair that sticks does not tell where it would slip.
    stuck = ResponseData(*response((50.0, 1.2)), deviation=0.05)
    blind = calibrate(response_case((40.0, 1.0)), stuck, over=OVER,
                      bounds=[(20.0, 90.0), (0.2, 5.0)])
    assert "the data do not depend on contact%normal_load" in blind.word


def test_failed_runs_are_told() -> None:
    """A case that has no answer at stiffnesses above 1.3: a smaller step is taken."""
    data = ResponseData(*response(TRUTH), deviation=0.05)
    predict = data.predict

    def guarded(unknowns: Any, values: Any, case: Any, *, slopes: bool) -> Any:
        if values[1] > 1.3:
            raise ConvergenceError("the point at 1 rad/s did not converge")
        return predict(unknowns, values, case, slopes=slopes)

    data.predict = guarded  # type: ignore[method-assign]
    found = calibrate(response_case(), data, over=OVER, bounds=BOUNDS, start=[1.5, 0.5])
    np.testing.assert_allclose(found.values, TRUTH, rtol=1e-4)
    assert found.n_evaluations == len(found.history) + len(found.failures)
    with pytest.raises(ConvergenceError, match="the first run failed"):
        calibrate(response_case(), data, over=OVER, bounds=BOUNDS, start=[0.5, 2.0])


def test_what_is_refused() -> None:
    frequency, amplitude = response(TRUTH)

    def refused(match: str, data: Any, **changes: Any) -> None:
        with pytest.raises(InputError, match=match):
            calibrate(response_case(), data, **({"over": OVER, "bounds": BOUNDS} | changes))

    refused("must lie within the sweep", ResponseData(2.0 * frequency, amplitude))
    refused("cannot tell 2 parameters", ResponseData(frequency[:2], amplitude[:2]))
    refused("must be ModeData", "data.csv")
    refused("for some and not for others", [ResponseData(frequency, amplitude, deviation=0.1),
                                            ResponseData(frequency, amplitude)])
    refused("must be among u1", ResponseData(frequency, amplitude, observe="tip"))
    with pytest.raises(InputError, match="must be positive"):
        ResponseData(frequency, amplitude, deviation=0.0)
    with pytest.raises(InputError, match="give one of them"):
        ModeData([1.0, 2.0])
    with pytest.raises(InputError, match="shape"):
        ModeData([1.0, 2.0], [1.0])
    with pytest.raises(InputError, match="for some numbers and not for others"):
        ModeData([1.0], [1.0], [0.1], frequency_deviation=0.1)


def test_example(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The command of example/calibration gives the numbers of its README."""
    example = Path(__file__).resolve().parents[2] / "example" / "calibration"
    assert main(["calibrate", str(example / "mode.nml"), "--data", str(example / "measured.csv"),
                 "--over", OVER[0], "--bounds", "0.1", "3", "--over", OVER[1], "--bounds", "0.2",
                 "5", "-q", "--picture", str(tmp_path / "fit.svg")]) == 0
    text, readme = capsys.readouterr().out, (example / "README.md").read_text()
    for name in OVER:
        value, _, error = text.split(name)[1].split()[:3]
        assert f"**{float(value):.4f}**" in readme and f"{float(error):.4f}" in readme
    assert (tmp_path / "fit.svg").stat().st_size > 5000


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    namelist = tmp_path / "case.nml"
    namelist.write_text("""&case analysis = 'mode' /
&model n_dof = 1 mass = 1.0 stiffness = 1.0 damping = 0.05 /
&contact n_pairs = 1 law = 'penalty' side_1 = 1, 0, 0 mu = 1.0 normal_load = 0.5
   tangential_stiffness = 1.0 /
&harmonics n_harmonics = 3 /
&mode start = 0.1 end = 10.0 /
""")
    data = mode_data()
    table = tmp_path / "measured.csv"
    rows = zip(data.amplitude, data.values[:8], data.values[8:])
    table.write_text("# measured on the bench\namplitude, frequency, damping_ratio\n" + "".join(
        f"{a:.9g}, {f:.9g}, {z:.9g}\n" for a, f, z in rows))
    best = tmp_path / "best.nml"
    arguments = ["calibrate", str(namelist), "--data", str(table), "--over", OVER[0], "--bounds",
                 "0.1", "3", "--over", OVER[1], "--bounds", "0.2", "5", "-o", str(best)]
    assert main(arguments) == 0
    text = capsys.readouterr().out
    assert "contact%normal_load" in text and "+-" in text and best.exists()
    found = float(text.split("contact%normal_load  ")[1].split()[0])
    assert found == pytest.approx(TRUTH[0], rel=1e-3)
    table.write_text("amplitude, frequenzy\n1, 2\n")
    assert main(arguments) == 3
    assert "frequenzy" in capsys.readouterr().err


def shaped(values: Any = (0.07, 0.4), **groups: Any) -> fw.Case:
    """Friction at the second mass changes the shape of the mode at the first."""
    contact = fw.ContactPairs([[2, 0, 0]], mu=1.0, normal_load=values[0],
                              tangential_stiffness=values[1])
    model = fw.Model(np.diag([1.0, 0.5]), None, [[1.0, -0.2], [-0.2, 0.8]], contact=contact,
                     cosine=[1.0, 0.0], observe={"drive": 1})
    return fw.Case(model, case={"analysis": "mode"}, contact={"law": "penalty"},
                   structure={"rayleigh_mass": 0.004}, solver={"tolerance": 1e-11},
                   harmonics={"n_harmonics": 3}, mode={"start": 0.1, "end": 10.0}).replace(**groups)


@pytest.mark.parametrize("kind", ["mode", "forced"])
def test_either_damping_gives_the_same_parameters(kind: str) -> None:
    """And damping ratios of the one kind, taken for the other, do not."""
    truth, mass = (0.1, 0.5), 1.05
    amplitude = np.geomspace(0.4, 6.0, 8)
    mode = fw.run(shaped(truth, mode={
        "amplitudes": amplitude.tolist(), "start": 0.4, "end": 6.0, "n_points": 8,
        "continuation": "natural"})).mode
    damping = mode.damping_ratio if kind == "mode" else mode.forced_damping_ratio(mass)
    kinds: dict[str, Any] = {"mode": {}, "forced": {"damping": "forced", "mass": mass}}

    def calibrated(taken_for: str) -> fw.design.Calibration:
        data = ModeData(amplitude, mode.frequency, damping, frequency_deviation=1e-4,
                        damping_deviation=1e-5, **kinds[taken_for])
        return calibrate(shaped(), data, over=OVER, bounds=[(0.02, 0.5), (0.1, 2.0)])

    right = calibrated(kind)
    assert right.converged and right.is_exact is (kind == "mode")
    np.testing.assert_allclose(right.values, truth, rtol=1e-5)
    other = calibrated("forced" if kind == "mode" else "mode")
    assert np.abs(other.values / np.array(truth) - 1.0).max() > 0.02
    assert other.chi_square > 100.0 * other.freedom


def test_which_damping_is_said() -> None:
    for wrong in ({"damping": "forced"}, {"mass": 2.0}, {"damping": "forced", "mass": 0.0}):
        with pytest.raises(InputError, match="mass = "):
            ModeData([1.0], [0.2], [0.01], **wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="'mode' or 'forced'"):
        ModeData([1.0], [0.2], [0.01], damping="viscous")
