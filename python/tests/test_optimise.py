"""Optima of parameters by exact gradients, against closed forms and differences."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fretwear as fw
from fretwear.cli import main
from fretwear.design import OBJECTIVES, Evaluation
from fretwear.design.objectives import new_objective
from fretwear.design.parameters import Unknowns
from fretwear.errors import ConvergenceError, InputError

#: Oscillator with an elastic friction element, one harmonic, in closed form: the normal load of
#: the lowest resonance under a force of 0.3, and its amplitude.
BEST_LOAD, BEST_AMPLITUDE = 0.40320249672597236, 0.7903043939637545
#: Derivatives against differences of runs whose residuals are 1e-11.
DIFFERENCES = 2e-6


def jenkins(**groups: Any) -> fw.Case:
    contact = fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=0.5, tangential_stiffness=1.0)
    model = fw.Model([[1.0]], [[0.05]], [[1.0]], contact=contact, cosine=[0.3])
    return fw.Case(model, contact={"law": "penalty"}, harmonics={"n_harmonics": 1},
                   sweep={"start": 0.8, "end": 1.6, "n_points": 41}).replace(**groups)


def rubbing(**groups: Any) -> fw.Case:
    """Two masses, two pairs with unlike values, a spring."""
    contact = fw.ContactPairs([[1, 0, 0], [2, 0, 0]], mu=[0.4, 0.3], normal_load=[1.0, 0.8],
                              tangential_stiffness=[1.5, 1.2])
    model = fw.Model([[1.0, 0.0], [0.0, 2.0]], [[0.06, -0.02], [-0.02, 0.1]],
                     [[3.0, -2.0], [-2.0, 5.0]], cosine=[0.0, 0.9], contact=contact,
                     springs=[fw.Spring(side_1=1, coefficient=0.1, power=3)])
    return fw.Case(model, contact={"law": "penalty"}, harmonics={"n_harmonics": 3},
                   sweep={"start": 0.9, "end": 1.6, "n_points": 36}).replace(**groups)


@pytest.mark.parametrize("start", [0.06, 0.5, 2.0])
def test_best_load_of_a_damper(start: float) -> None:
    told: list[Evaluation] = []
    found = fw.optimise(jenkins(), minimise="max_amplitude", over="contact%normal_load",
                        bounds=(0.05, 5.0), start=start, scan=False, progress=told.append)
    assert found.converged and found.word == "optimum"
    assert found.doubt.startswith("another optimum may exist between")
    assert found.n_evaluations <= 9 and len(told) == len(found.history) == found.n_evaluations
    assert found.values[0] == pytest.approx(BEST_LOAD, rel=1e-6)
    assert found.value == pytest.approx(BEST_AMPLITUDE, rel=1e-10)
    assert abs(found.gradient[0]) <= found.gradient_size[0] < 1e-6 and not found.failures
    assert "contact%normal_load" in str(found)
    # The case at the optimum is a case like any other.
    assert fw.run(found.case).maximum()[1] == pytest.approx(BEST_AMPLITUDE, rel=1e-3)


@pytest.mark.parametrize("start", [0.06, 0.5, 2.0])
def test_the_range_is_scanned(start: float) -> None:
    """Until nothing lower is to be expected anywhere between the bounds."""
    found = fw.optimise(jenkins(), minimise="max_amplitude", over="contact%normal_load",
                        bounds=(0.05, 5.0), start=start)
    assert found.word == "optimum" and not found.doubt and found.n_evaluations <= 20
    assert found.values[0] == pytest.approx(BEST_LOAD, rel=1e-6)


def chain(mass: list[float], springs: list[float], rubs: list[int], stiffness: float,
          sweep: tuple[float, float], observe: int, damping: float, n: int = 121) -> fw.Case:
    """Masses on springs one after the other, forced at the first; pairs that rub at some."""
    matrix = np.diag(np.array([*springs]) + np.array([*springs[1:], 0.0]))
    for k, spring in enumerate(springs[1:]):
        matrix[k, k + 1] = matrix[k + 1, k] = -spring
    contact = fw.ContactPairs([[dof, 0, 0] for dof in rubs], mu=0.5, normal_load=1.0,
                              tangential_stiffness=stiffness)
    model = fw.Model(np.diag(mass), None, matrix, contact=contact,
                     cosine=[1.0] + [0.0] * (len(mass) - 1))
    return fw.Case(model, contact={"law": "penalty"}, harmonics={"n_harmonics": 5},
                   structure={"modal_damping": damping}, output={"observe": [observe]},
                   sweep={"start": sweep[0], "end": sweep[1], "n_points": n})


#: Case, start, load of the optimum, amplitude there (of sweeps in steps of 2 % of the load).
STEPPED_OVER = [
    # A far point on the plateau of sticking ended the search.
    (([0.75566, 1.98903], [0.56272, 0.75101], [2], 0.66722, (0.18872, 3.5121), 1, 0.026574),
     0.18828, 2.063, 9.1832),
    (([0.98412, 0.70842, 1.13726], [0.59563, 1.45607, 0.93946], [3], 1.21079, (0.23945, 2.8436),
      2, 0.008139), 1.0, 1.916, 5.1166),
    # A start on that plateau, and a corner below it.
    (([1.97151, 0.68216, 0.75393], [1.77248, 1.73173, 1.35934], [2], 1.70054, (0.37365, 3.16747),
      3, 0.0055729), 1.0, 0.7153, 20.0564),
    # Minima within one doubling.
    (([0.98113, 0.52275], [0.55748, 1.99706], [2], 0.96822, (0.35892, 0.83748), 1, 0.0064979),
     1.0, 3.453, 2.7877),
    (([1.47685, 0.95508, 0.62187, 0.99993], [0.8556, 1.46517, 0.8099, 0.70433], [2, 3], 0.88924,
      (0.21506, 0.50181), 1, 0.019511), 1.0, 0.669, 0.9357),
]


@pytest.mark.parametrize(("parts", "start", "best", "height"), STEPPED_OVER)
def test_no_minimum_is_stepped_over(parts: Any, start: float, best: float, height: float) -> None:
    found = fw.optimise(chain(*parts), minimise="max_amplitude", over="contact%normal_load",
                        bounds=(0.02, 20.0), start=start)
    assert found.word.startswith("optimum") and not found.doubt
    assert found.values[0] == pytest.approx(best, rel=2e-3)
    assert found.value == pytest.approx(height, rel=2e-4)
    if "corner" in found.word:
        assert found.sides[0].gradient[0] < 0.0 < found.sides[1].gradient[0]
    else:
        assert abs(found.gradient[0]) <= found.gradient_size[0] < 1e-4


def test_a_plateau_is_named() -> None:
    """The largest peak over the load is that of the pair that sticks, from some load on."""
    found = fw.optimise(jenkins(), maximise="omega_at_peak", over="contact%normal_load",
                        bounds=(0.05, 5.0), start=4.0)
    assert found.converged and found.word.startswith("optimum on a plateau: from ")


def test_a_gap_between_bounds_of_any_unit() -> None:
    """A parameter that may be zero is scaled by its bounds."""
    found = []
    for unit in (1.0, 1e-6):
        contact = fw.ContactPairs([[0, 0, 1]], mu=0.0, gap=0.3 * unit, tangential_stiffness=1.0,
                                  normal_stiffness=0.3)
        model = fw.Model([[1.0]], [[0.1]], [[1.0]], contact=contact, cosine=[0.3 * unit])
        case = fw.Case(model, contact={"law": "penalty"}, harmonics={"n_harmonics": 7},
                       sweep={"start": 0.7, "end": 1.6, "n_points": 41})
        best = fw.optimise(case, minimise="max_amplitude", over="contact%gap",
                           bounds=(0.0, 6.0 * unit))
        found.append((best.values[0] / unit, best.value / unit, best.word))
    assert found[0][:2] == pytest.approx(found[1][:2], rel=1e-5)
    assert found[0][2] == found[1][2] and found[0][2].startswith("optimum")


def test_where_all_sticks_the_load_changes_nothing() -> None:
    """At the start the slope vanishes without being that of an optimum."""
    found = fw.optimise(jenkins(), minimise="max_amplitude", over="contact%normal_load",
                        bounds=(0.05, 5.0), start=5.0)
    assert found.converged and found.values[0] == pytest.approx(BEST_LOAD, rel=1e-6)
    flat = fw.optimise(jenkins(), minimise="max_amplitude", over="contact%normal_load",
                       bounds=(20.0, 50.0))
    assert not flat.converged and "does not depend on the parameters" in flat.word


@pytest.mark.parametrize("instants", [64, 256])
def test_slopes_of_instants_are_doubted(instants: int) -> None:
    """They jump where a switch passes an instant, without a corner of the response."""
    case = jenkins(harmonics={"n_harmonics": 3, "n_time": instants, "sampling": "uniform"})
    found = fw.optimise(case, minimise="max_amplitude", over="contact%normal_load",
                        bounds=(0.05, 5.0), start=0.3)
    assert not found.word.startswith("optimum at a corner:")
    assert any(text.startswith("derivatives of instants") for text in found.remarks)


def test_several_parameters() -> None:
    """Two that are at no bound: the slopes vanish, and neighbours are higher."""
    case = rubbing(sweep={"start": 0.9, "end": 2.2, "n_points": 53})
    over = ["contact%normal_load(1)", "contact%normal_load(2)"]
    found = fw.optimise(case, minimise="max_amplitude[u2]", over=over,
                        bounds=[(0.1, 10.0), (0.1, 10.0)])
    assert found.word == "optimum" and np.abs(found.gradient).max() < 1e-6
    _, evaluate = evaluator(case, "max_amplitude[u2]", over)
    for step in ([1.02, 1.0], [0.98, 1.0], [1.0, 1.02], [1.0, 0.98]):
        assert evaluate(found.values * step).value > found.value


def absorber(end: float) -> fw.Case:
    """Two masses, joined by a pair that sticks, in a sweep up to a frequency."""
    contact = fw.ContactPairs([[1, 0, 0]], [[2, 0, 0]], mu=1.0, normal_load=1e6,
                              tangential_stiffness=0.09)
    model = fw.Model([[1.0, 0.0], [0.0, 0.1]], [[0.05, -0.03], [-0.03, 0.03]],
                     [[1.0, 0.0], [0.0, 0.0]], cosine=[1.0, 0.0], contact=contact)
    return fw.Case(model, contact={"law": "penalty"}, harmonics={"n_harmonics": 1},
                   sweep={"start": 0.6, "end": end, "n_points": 81})


def test_two_peaks_of_one_height() -> None:
    """An absorber: its best stiffness makes both peaks equal, where the slope jumps."""
    case = absorber(1.4)
    found = fw.optimise(case, minimise="max_amplitude[u1]", over="contact%tangential_stiffness",
                        bounds=(0.02, 0.5))
    assert found.converged and found.word.startswith("optimum at a corner")
    assert found.n_evaluations <= 32 and not found.doubt
    low, high = found.sides
    assert low.gradient[0] < 0.0 < high.gradient[0]
    assert high.parameters[0] - low.parameters[0] < 1.1e-6 * found.values[0]
    first, second = sorted((peak for peak in fw.run(found.case).peaks if peak.observed == "u1"),
                           key=lambda peak: peak.omega)
    assert first.amplitude == pytest.approx(second.amplitude, rel=1e-3)

    def height(stiffness: float) -> float:
        """The linear structure."""
        omega = np.linspace(0.6, 1.4, 400001)
        z11 = 1.0 + stiffness - omega**2 + 0.05j * omega
        z12 = -stiffness - 0.03j * omega
        z22 = stiffness - 0.1 * omega**2 + 0.03j * omega
        return float(np.abs(z22 / (z11 * z22 - z12**2)).max())

    best = found.values[0]
    assert found.value == pytest.approx(height(best), rel=1e-8)
    assert height(best) < min(height(best * 1.0001), height(best / 1.0001))


def test_a_peak_beyond_the_sweep_is_told() -> None:
    """The end of the sweep stands for the second peak: on one side of the corner at least."""
    found = fw.optimise(absorber(1.03), minimise="max_amplitude[u1]",
                        over="contact%tangential_stiffness", bounds=(0.02, 0.5))
    assert "at an end" in str(found), found.remarks


def test_optimum_at_a_bound() -> None:
    found = fw.optimise(jenkins(), minimise="max_amplitude", over="contact%normal_load",
                        bounds=(0.5, 2.0))
    assert found.converged and found.values[0] == 0.5
    assert found.word == "optimum at a bound: contact%normal_load at its lower one"


def evaluator(case: fw.Case, what: Any, over: list[str], *, factors: bool = False
              ) -> tuple[Unknowns, Callable[[Any], Evaluation]]:
    unknowns = Unknowns(case, over, [(1e-6, 1e6)] * len(over), factors=factors)
    return unknowns, new_objective(what, unknowns, case)


def check_gradient(case: fw.Case, what: Any, over: list[str], *, factors: bool = False) -> None:
    unknowns, evaluate = evaluator(case, what, over, factors=factors)
    here = unknowns.present
    found = evaluate(here)
    for k in range(len(here)):
        step = np.zeros(len(here))
        step[k] = 1e-4 * here[k]
        far = [evaluate(here + m * step).value for m in (-2, -1, 1, 2)]
        slope = (8 * (far[2] - far[1]) - (far[3] - far[0])) / (12 * step[k])
        assert found.gradient[k] == pytest.approx(
            slope, rel=DIFFERENCES, abs=DIFFERENCES * abs(found.value / here[k])), over[k]


@pytest.mark.parametrize("what", ["max_amplitude", "max_first_harmonic", "frequency_at_peak",
                                  "dissipation_at_peak"])
def test_gradient_at_the_peak(what: str) -> None:
    check_gradient(rubbing(), f"{what}[u2]", ["contact%normal_load(1)", "load%harmonic_scale"])


def test_gradient_of_factors_and_of_other_groups() -> None:
    check_gradient(rubbing(structure={"modal_damping": 0.01}), "max_amplitude",
                   ["contact%mu", "model%modal_damping", "spring%coefficient"], factors=True)


def test_gradient_at_a_point() -> None:
    case = rubbing(case={"analysis": "point"}, sweep={"start": 1.3})
    for what in ("largest[u2]", "first_harmonic", "dissipation"):
        check_gradient(case, what, ["contact%mu(2)", "contact%tangential_stiffness(1)"])


def test_gradient_of_a_function() -> None:
    """Two points, the squares of the amplitudes of one, friction energy of the other."""

    def cost(found: Any) -> tuple[float, dict[str, Any]]:
        u, energy = found.value["first_harmonic"], found.value["dissipation"]
        by_u, by_energy = np.zeros_like(u), np.zeros_like(energy)
        by_u[0], by_energy[1] = 2.0 * u[0], -0.5
        return float((u[0]**2).sum() - 0.5 * energy[1]), {"first_harmonic": by_u,
                                                          "dissipation": by_energy}

    case = rubbing(sweep={"start": 1.2, "end": 1.3, "n_points": 2}, solver={"tolerance": 1e-12})
    check_gradient(case, cost, ["contact%normal_load", "load%harmonic_scale"], factors=True)


def test_what_is_refused() -> None:
    def refused(match: str, case: fw.Case | None = None, **changes: Any) -> None:
        arguments: dict[str, Any] = {"minimise": "max_amplitude", "over": "contact%normal_load",
                                     "bounds": (0.1, 1.0)}
        with pytest.raises(InputError, match=match):
            fw.optimise(case or jenkins(), **(arguments | changes))

    refused("no quantity", minimise="amplitude")
    refused("give one of the two", maximise="max_amplitude")
    refused("there are no derivatives by it", over="model%mass")
    refused("lower and a higher", bounds=(1.0, 0.1))
    refused("not the same everywhere", case=rubbing())
    refused("there are 1 of", over="contact%normal_load(2)")
    refused("has no springs", over="spring%coefficient")
    refused("is of case%analysis = 'point'", minimise="largest")
    refused("are of the same number", over=["contact%mu", "contact%mu(1)"],
            bounds=[(0.1, 1), (0.1, 1)])
    refused("is 0 in the case", over="contact%gap", factors=True)
    refused("must be group%key", over="contact%mu[1]")
    assert set(OBJECTIVES) >= {"max_amplitude", "dissipation_at_peak", "largest"}


def test_failed_runs_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs fail above 0.45: the optimum below is found, one above is not called one."""
    from fretwear.design import optimum

    true_objective = new_objective

    def failing(limit: float) -> Any:
        def make(*arguments: Any) -> Any:
            evaluate = true_objective(*arguments)

            def guarded(values: Any) -> Evaluation:
                if values[0] > limit:
                    raise ConvergenceError("1 of 41 points did not converge")
                return evaluate(values)

            return guarded
        return make

    monkeypatch.setattr(optimum, "new_objective", failing(0.45))
    arguments: dict[str, Any] = {"minimise": "max_amplitude", "over": "contact%normal_load",
                                 "bounds": (0.05, 5.0)}
    found = fw.optimise(jenkins(), start=0.3, **arguments)
    assert found.converged and found.values[0] == pytest.approx(BEST_LOAD, rel=1e-6)
    assert found.failures and "did not converge" in found.failures[0]
    assert found.n_evaluations == len(found.history) + len(found.failures)
    monkeypatch.setattr(optimum, "new_objective", failing(0.35))
    short = fw.optimise(jenkins(), start=0.3, **arguments)
    assert not short.converged and short.word.startswith("no optimum")
    with pytest.raises(ConvergenceError, match="the first run failed"):
        fw.optimise(jenkins(), start=0.4, **arguments)


def test_peak_at_the_end_of_the_sweep_is_said() -> None:
    _, evaluate = evaluator(jenkins(sweep={"end": 1.1, "n_points": 16}), "max_amplitude",
                            ["contact%normal_load"])
    found = evaluate(np.array([0.5]))
    assert found.omega == pytest.approx(1.1) and any("end of the sweep" in t for t in found.remarks)


def test_a_jump_is_no_peak() -> None:
    """A hardening spring: the response falls, or is lost, where the upper branch ends."""
    model = fw.Model([[1.0]], [[0.05]], [[1.0]], cosine=[0.3],
                     springs=[fw.Spring(side_1=1, coefficient=0.5, power=3)])
    case = fw.Case(model, harmonics={"n_harmonics": 3},
                   sweep={"start": 0.5, "end": 3.5, "n_points": 121})
    with pytest.raises(ConvergenceError, match="the first run failed"):
        fw.optimise(case, minimise="max_amplitude", over="spring%coefficient", bounds=(0.1, 1.0))


def test_example(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The command of example/damper gives the numbers of its README."""
    example = Path(__file__).resolve().parents[2] / "example" / "damper"
    assert main(["optimise", str(example / "damper.nml"), "--minimise", "max_amplitude", "--over",
                 "contact%normal_load", "--bounds", "0.05", "5", "-q", "--picture",
                 str(tmp_path / "best.png")]) == 0
    text, readme = capsys.readouterr().out, (example / "README.md").read_text()
    found = float(text.split("contact%normal_load")[1].split()[0])
    height = float(text.split("max_amplitude")[1].split()[0])
    assert f"**{found:.7f}**" in readme and f"**{height:.7f}**" in readme
    assert (tmp_path / "best.png").stat().st_size > 5000
    assert main(["optimise", str(example / "damper.nml"), "--minimise", "max_amplitude", "--over",
                 "contact%normal_load", "--bounds", "0.05", "5", "--picture",
                 str(tmp_path / "none" / "best.png")]) == 5


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "case.nml"
    path.write_text("""&case analysis = 'frf' /
&model n_dof = 1 mass = 1.0 stiffness = 1.0 damping = 0.05 /
&contact n_pairs = 1 law = 'penalty' side_1 = 1, 0, 0 mu = 1.0 normal_load = 0.5
   tangential_stiffness = 1.0 /
&load cosine = 0.3 /
&harmonics n_harmonics = 1 /
&sweep start = 0.8 end = 1.6 n_points = 21 /
""")
    best = tmp_path / "best.nml"
    assert main(["optimise", str(path), "--minimise", "max_amplitude", "--over",
                 "contact%normal_load", "--bounds", "0.05", "5", "--set", "sweep%n_points=41", "-o",
                 str(best)]) == 0
    text = capsys.readouterr().out
    assert "0.40320249" in text and "0.790304394" in text and "evaluations" in text
    assert fw.Case.from_file(best).namelist() == best.read_text()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["best.nml", "case.nml"]
    assert main(["optimise", str(path), "--over", "contact%mu", "--bounds", "1", "2"]) == 3
    assert main(["optimise", str(path), "--minimise", "max_amplitude"]) == 3
    assert main(["optimise", str(path), "--minimise", "max_amplitude", "--over",
                 "contact%normal_load", "--bounds", "20", "50", "-q"]) == 4
    assert main(["optimise", "--quantities"]) == 0
