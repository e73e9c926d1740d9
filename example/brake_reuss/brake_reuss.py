"""The measured Brake-Reuss beam: calibration on three levels, prediction of eight others.

    python brake_reuss.py ForcedFrequencyResponses.mat [--folder .] [--document docs/brake_reuss.md]

Prints tables, and writes brb.h5 (the calibrated model) and brake_reuss.png into the folder; with a
document its sections are replaced.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from fit import NAMES, Fitted, calibrate, calibrate_friction, predict, refine
from methods import METHODS
from record import (
    CALIBRATED,
    PREDICTED,
    Level,
    Repeatability,
    read_record,
    repeatability,
)

from fretwear.beam import BeamParameters, ReducedBeam, generate
from fretwear.beam.cli import write_model

__all__ = ["NOMINAL", "Study", "coverage"]

ROOT = Path(__file__).resolve().parents[2]
#: Before the calibration: steel from the table, the stiffness of the lap from the lowest level, and
#: a guess of the joint.
NOMINAL = BeamParameters(young=1.93e11, tangential_stiffness=7.39e8, limit=9e3, exponent=0.4,
                         cubic=1.5e11)
#: What is asked of the predictions, relative: frequency and damping, with the spring and without.
WANTED, WANTED_FRICTION = (2e-3, 0.15), (7e-3, 0.10)
#: Of two standard deviations, as many as 95 % of a normal distribution take.
WIDTH = 1.96
N_RECORDS, SEED = 50, 1


class Study:
    """The record, both calibrations, and what they say of all levels."""

    def __init__(self, levels: list[Level], beam: ReducedBeam | None = None) -> None:
        self.levels = levels
        self.noise = repeatability(levels)
        beam = generate(NOMINAL) if beam is None else beam
        self.calibrated = [one for one in levels if one.name in CALIBRATED]
        self.predicted = [one for one in levels if one.name in PREDICTED]
        self.fitted = calibrate(beam, self.calibrated, self.noise)
        self.friction = calibrate_friction(beam, self.calibrated, self.noise)

    def errors(self, found: np.ndarray, levels: list[Level]) -> np.ndarray:
        """Of frequency and damping, relative (2, n)."""
        return (found / _measured(levels) - 1.0).reshape(2, -1)

    def bands(self, levels: list[Level]) -> np.ndarray:
        """Half widths of 95 %, relative, from the covariance and from repeatability (2, n)."""
        return _half_widths(self.fitted, self.noise, levels) / _measured(levels).reshape(2, -1)


def _measured(levels: list[Level]) -> np.ndarray:
    return np.array([one.frequency for one in levels] + [one.damping for one in levels])


def _half_widths(fitted: Fitted, noise: Repeatability, levels: list[Level]) -> np.ndarray:
    repeat = np.concatenate((np.full(len(levels), noise.frequency),
                             noise.damping * np.array([one.damping for one in levels])))
    return WIDTH * np.hypot(fitted.deviations(levels), repeat).reshape(2, -1)


def levels_table(study: Study) -> list[str]:
    """What was measured."""
    lines = ["| run | frequency [Hz] | acceleration [m/s^2] | force [N] | damping [1e-3] | used |",
             "|---|---|---|---|---|---|"]
    for one in study.levels:
        used = ("calibration" if one.name in CALIBRATED
                else "prediction" if one.name in PREDICTED else "damping without slip")
        lines.append(f"| {one.name} | {one.frequency:.3f} | {one.acceleration:.2f} | "
                     f"{one.force:.4f} | {1e3 * one.damping:.3f} | {used} |")
    return ["", *lines, "",
            f"Repeatability (one standard deviation of a run): {study.noise.frequency:.3f} Hz and "
            f"{100 * study.noise.damping:.1f} % of the damping.", ""]


def fit_table(study: Study) -> list[str]:
    """What was fitted."""
    meaning = {"limit": "friction limit at the outer bolts [N/m]",
               "cubic": "cubic spring, empirical [N/m^3]", "exponent": "p",
               "stiffness": "factor of all linear stiffness"}
    fitted, friction = study.fitted, study.friction
    lines = ["| number | value | standard error | friction alone |", "|---|---|---|---|"]
    for k, name in enumerate(NAMES):
        lines.append(f"| {meaning[name]} | {fitted.values[k]:.5g} | {100 * fitted.errors[k]:.2g} % "
                     f"| {friction.values[k]:.5g} |")
    correlation = fitted.covariance / np.outer(fitted.errors, fitted.errors)
    pairs = ", ".join(f"{NAMES[i]} and {NAMES[j]} {correlation[i, j]:+.2f}"
                      for i in range(4) for j in range(i))
    inner = fitted.inner
    return ["", *lines, "",
            f"Six numbers, four fitted: squares over freedom {fitted.squares:.2f} / "
            f"{fitted.freedom}. Correlations: {pairs}.", "",
            "`fw.calibrate` at this exponent and stiffness: factors of limit and spring "
            f"{inner.values[0]:.4f} +- {inner.errors[0]:.4f} and {inner.values[1]:.4f} +- "
            f"{inner.errors[1]:.4f}, derivatives "
            f"{'exact' if inner.is_exact else 'by differences'}.", ""]


def prediction_table(study: Study) -> list[str]:
    """Errors of both models, with bands, and what they come to."""
    levels = study.levels
    errors = study.errors(METHODS["controlled sweep"](study.fitted.beam, levels), levels)
    bands = study.bands(levels)
    friction = study.errors(predict(study.friction.beam, levels), levels)
    lines = ["| run | frequency | band | damping | band | friction alone: frequency | damping |",
             "|---|---|---|---|---|---|---|"]
    for k, one in enumerate(levels):
        mark = " C" if one.name in CALIBRATED else ""
        lines.append(
            f"| {one.name}{mark} | {100 * errors[0, k]:+.3f} % | {100 * bands[0, k]:.3f} % | "
            f"{100 * errors[1, k]:+.1f} % | {100 * bands[1, k]:.1f} % | "
            f"{100 * friction[0, k]:+.2f} % | {100 * friction[1, k]:+.1f} % |")
    own = [k for k, one in enumerate(levels) if one.name in PREDICTED]
    worst, alone = (np.abs(values[:, own]).max(axis=1) for values in (errors, friction))
    inside = (np.abs(errors[:, own]) <= bands[:, own]).sum(axis=1)
    return ["", *lines, "",
            f"Predicted runs, at worst: {100 * worst[0]:.3f} % in frequency and "
            f"{100 * worst[1]:.1f} % in damping ({_verdict(worst, WANTED)}). Friction alone: "
            f"{100 * alone[0]:.2f} % and {100 * alone[1]:.1f} % "
            f"({_verdict(alone, WANTED_FRICTION)}). Inside their bands of 95 %: {inside[0]} of "
            f"{len(own)} frequencies, {inside[1]} of {len(own)} dampings.", ""]


def _verdict(worst: np.ndarray, wanted: tuple[float, float]) -> str:
    words = " and ".join(f"{100 * one:g} %" for one in wanted)
    return f"{'within' if (worst <= wanted).all() else 'not within'} the {words} that were asked"


def methods_table(study: Study) -> list[str]:
    """How far the three ways to the same numbers differ."""
    levels = study.levels
    found = {name: method(study.fitted.beam, levels) for name, method in METHODS.items()}
    lines = ["| run | frequency of the mode [Hz] | phase resonance | controlled sweep | "
             "damping of the mode [1e-3] | phase resonance | controlled sweep |",
             "|---|---|---|---|---|---|---|"]
    base, n = found["mode"], len(levels)
    off = {name: values / base - 1.0 for name, values in found.items()}
    for k, one in enumerate(levels):
        cells = [f"{base[k]:.4f}", *(f"{100 * off[name][k]:+.3f} %" for name in list(off)[1:]),
                 f"{1e3 * base[n + k]:.4f}",
                 *(f"{100 * off[name][n + k]:+.2f} %" for name in list(off)[1:])]
        lines.append(f"| {one.name} | {' | '.join(cells)} |")
    return ["", *lines, ""]


def coverage(fitted: Fitted, noise: Repeatability, calibrated: list[Level],
             predicted: list[Level], n_records: int = N_RECORDS) -> tuple[int, int, int]:
    """Synthetic records of the fitted model with the noise of the record: how many predicted
    numbers lie in their bands, of how many, and how many of the true ones in those of the
    covariance alone. Each record is calibrated anew, by steps of all four numbers."""
    rng = np.random.default_rng(SEED)
    slopes = fitted.slopes(calibrated)
    truth = {group: predict(fitted.beam, levels)
             for group, levels in (("c", calibrated), ("p", predicted))}
    of_covariance = WIDTH * fitted.deviations(predicted)
    inside, true_inside, of = 0, 0, 0
    for _ in range(n_records):
        drawn = _noisy(calibrated, truth["c"], noise, rng)
        new = _noisy(predicted, truth["p"], noise, rng)
        again = refine(fitted, drawn, noise, slopes)
        says = predict(again.beam, new)
        n = len(new)
        repeat = WIDTH * np.concatenate((np.full(n, noise.frequency), noise.damping * says[n:]))
        inside += int((np.abs(says - _measured(new)) <= np.hypot(of_covariance, repeat)).sum())
        true_inside += int((np.abs(predict(again.beam, predicted) - truth["p"])
                            <= of_covariance).sum())
        of += 2 * n
    return inside, of, true_inside


def _noisy(levels: list[Level], truth: np.ndarray, noise: Repeatability,
           rng: np.random.Generator) -> list[Level]:
    """The levels as another record would have them, at the same amplitudes of displacement."""
    n = len(levels)
    frequency = truth[:n] + noise.frequency * rng.standard_normal(n)
    damping = truth[n:] * (1.0 + noise.damping * rng.standard_normal(n))
    found = []
    for one, f, d in zip(levels, frequency.tolist(), damping.tolist()):
        acceleration = one.displacement * (2.0 * np.pi * f)**2
        found.append(Level(one.name, f, acceleration, d * one.force / one.damping
                           * acceleration / one.acceleration))
    return found


def coverage_lines(study: Study) -> list[str]:
    """How often bands hold where the model is right."""
    inside, of, true_inside = coverage(study.fitted, study.noise, study.calibrated,
                                       study.predicted)
    return ["", f"{N_RECORDS} synthetic records, the fitted model with the scatter of the record, "
                f"each calibrated anew on the same three levels: {inside} of {of} predicted "
                f"numbers ({100 * inside / of:.1f} %) lie in their bands of 95 %, and "
                f"{true_inside} of {of} ({100 * true_inside / of:.1f} %) of the true ones in the "
                "bands of the covariance alone.", ""]


def picture(study: Study, path: Path) -> None:
    """Frequency and damping over the amplitude."""
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained")
    a = np.geomspace(5.0, 82.0, 60)
    fine = [Level("", 80.3, float(one), 1.0) for one in a]
    n = len(fine)
    for name, fitted, colour in (("friction and cubic spring", study.fitted, "#0072b2"),
                                 ("friction alone", study.friction, "#d55e00")):
        curve = predict(fitted.beam, fine)
        for axis, values, factor in zip(axes, (curve[:n], curve[n:]), (1.0, 1e3)):
            axis.plot(a, factor * values, color=colour, label=name)
        if fitted is study.fitted:
            repeat = np.concatenate((np.full(n, study.noise.frequency),
                                     study.noise.damping * curve[n:]))
            wide = WIDTH * np.hypot(fitted.deviations(fine), repeat)
            for axis, part, factor in zip(axes, (slice(0, n), slice(n, None)), (1.0, 1e3)):
                axis.fill_between(a, factor * (curve - wide)[part], factor * (curve + wide)[part],
                                  color=colour, alpha=0.15, lw=0.0, label="95 %")
    for kind, marker in (("calibration", "s"), ("RC", "o"), ("FC", "^")):
        own = [one for one in study.levels
               if (one.name in CALIBRATED if kind == "calibration"
                   else one.name.startswith(kind) and one.name not in CALIBRATED)]
        x = [one.acceleration for one in own]
        axes[0].plot(x, [one.frequency for one in own], "k" + marker, ms=4, label=kind)
        axes[1].plot(x, [1e3 * one.damping for one in own], "k" + marker, ms=4, label=kind)
    for axis, text in zip(axes, ("frequency [Hz]", "damping F/(2 m a) [1e-3]")):
        axis.set_xlabel("acceleration [m/s²]")
        axis.set_ylabel(text)
    axes[0].legend(fontsize=7, loc="lower left")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def main() -> int:
    """Calibrate, predict, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("record", type=Path, help="ForcedFrequencyResponses.mat")
    parser.add_argument("--folder", type=Path, default=Path())
    parser.add_argument("--document", type=Path)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    study = Study(read_record(options.record))
    write_model(study.fitted.beam, options.folder / "brb.h5")
    sections = {"levels": levels_table, "fit": fit_table, "prediction": prediction_table,
                "methods": methods_table, "coverage": coverage_lines}
    if options.document is not None:
        sys.path.insert(0, str(ROOT / "test" / "support"))
    for name, make in sections.items():
        lines = make(study)
        print("\n".join(lines), flush=True)
        if options.document is not None:
            from sections import write_section
            write_section(name, lines, options.document)
    picture(study, options.folder / "brake_reuss.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
