"""How often calibration finds the parameters of noisy data within its standard errors, into
docs/design.md.

    python test/design/calibration_trials.py [--count 100] [--seed 0] [-o docs/design.md]

The case that is calibrated makes the data: noise is all that is wrong with them.
"""
import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
import numpy as np
from sections import write_section

import fretwear as fw
from fretwear.design import ModeData, ResponseData, calibrate

#: Friction limit, contact stiffness, and where the search begins.
TRUTH, START = (0.6, 1.2), (0.5, 1.0)
OVER = ["contact%normal_load", "contact%tangential_stiffness"]
BOUNDS = [(0.1, 3.0), (0.2, 5.0)]
AMPLITUDES = np.geomspace(0.3, 4.0, 12)
#: Deviations: of frequencies [Hz], of damping ratios, and of amplitudes of a response.
NOISE = {"frequency": 1e-3, "damping": 3e-3, "response": 0.05}
SOLVER = {"tolerance": 1e-12}


def oscillator(values, **groups):
    """A mass with an elastic friction element."""
    contact = fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=values[0],
                              tangential_stiffness=values[1])
    model = fw.Model([[1.0]], [[0.05]], [[1.0]], contact=contact, cosine=[1.0])
    return fw.Case(model, contact={"law": "penalty"}, solver=SOLVER).replace(**groups)


def mode_case(values):
    return oscillator(values, case={"analysis": "mode"}, harmonics={"n_harmonics": 7},
                      mode={"start": 0.1, "end": 10.0})


def response_case(values, load):
    return oscillator(values, load={"harmonic_scale": load}, harmonics={"n_harmonics": 5},
                      sweep={"start": 0.8, "end": 1.8, "n_points": 21})


class ModeTrials:
    """Frequency and damping over amplitude."""

    name = "frequency and damping of a mode at 12 amplitudes"

    def __init__(self):
        self.frequency, self.damping = np.array([self._row(a) for a in AMPLITUDES]).T

    def _row(self, amplitude):
        case = mode_case(TRUTH).replace(mode={
            "start": amplitude, "end": 1.01 * amplitude, "n_points": 2, "continuation": "natural"})
        mode = fw.run(case).mode
        return mode.frequency[0], mode.damping_ratio[0]

    def calibrated(self, rng):
        data = ModeData(
            AMPLITUDES, self.frequency + rng.normal(0.0, NOISE["frequency"], len(AMPLITUDES)),
            self.damping + rng.normal(0.0, NOISE["damping"], len(AMPLITUDES)),
            frequency_deviation=NOISE["frequency"], damping_deviation=NOISE["damping"])
        return calibrate(mode_case(START), data, over=OVER, bounds=BOUNDS)


class ResponseTrials:
    """Two response curves."""

    name = "responses at 21 frequencies under two loads"
    loads = (0.3, 0.7)

    def __init__(self):
        self.curves = []
        for load in self.loads:
            result = fw.run(response_case(TRUTH, load))
            first = np.hypot(result.coefficients[:, 1, 0], result.coefficients[:, 2, 0])
            self.curves.append((result.frequency, first))

    def calibrated(self, rng):
        data = [ResponseData(frequency,
                             amplitude + rng.normal(0.0, NOISE["response"], len(frequency)),
                             deviation=NOISE["response"], case=response_case(START, load))
                for load, (frequency, amplitude) in zip(self.loads, self.curves, strict=True)]
        return calibrate(response_case(START, self.loads[0]), data, over=OVER, bounds=BOUNDS)


def judge(trials, count, seed):
    """Standard errors between truth and answer (count, 2), squares of both together over their
    covariance (count), and whether each search converged."""
    rng = np.random.default_rng(seed)
    off, squares, done = [], [], []
    for _ in range(count):
        found = trials.calibrated(rng)
        miss = found.values - TRUTH
        off.append(miss / found.errors)
        squares.append(miss @ np.linalg.solve(found.covariance, miss))
        done.append(found.converged)
    return np.array(off), np.array(squares), np.array(done)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-o", dest="document", type=Path)
    options = parser.parse_args()
    lines = [f"Of {options.count} trials each (95 %: of both parameters together):", "",
             "| data | converged | normal load within 1, 2 standard errors | stiffness within 1, 2 "
             "| both within 95 % |", "|---|---|---|---|---|"]
    for trials in (ModeTrials(), ResponseTrials()):
        off, squares, done = judge(trials, options.count, options.seed)
        inside = [(np.abs(off) <= k).sum(axis=0) for k in (1, 2)]
        # -2 ln 0.05: chi-square of two parameters.
        both = int((squares <= -2.0 * np.log(0.05)).sum())
        lines.append(f"| {trials.name} | {done.sum()} | {inside[0][0]}, {inside[1][0]} | "
                     f"{inside[0][1]}, {inside[1][1]} | {both} |")
        print(lines[-1], flush=True)
    if options.document:
        write_section("calibration", lines, options.document)


if __name__ == "__main__":
    main()
