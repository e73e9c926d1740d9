"""Solve a case with pyHarm, frequency by frequency: run by sector_and_chain.py, maybe elsewhere.

    python bench/peers/pyharm_chain.py CASE.json

The answer is JSON on stdout: coefficients, seconds and Newton steps of every frequency. The first
frequency is solved once before the clock starts, so that nothing is compiled while it runs.
"""

from __future__ import annotations

import json
import logging
import sys
import time
from pathlib import Path

import numpy as np
import pyHarm


def main() -> None:
    """Read the case, solve it, write the answer."""
    logging.disable(logging.CRITICAL)
    case = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    analysis = new_analysis(case)
    solve(analysis, case["omega"][0], None)
    last, rows = None, []
    for omega in case["omega"]:
        start = time.perf_counter()
        last, iterations = solve(analysis, omega, last)
        rows.append({"seconds": time.perf_counter() - start, "iterations": iterations,
                     "coefficients": last.reshape(2 * case["n_harmonics"] + 1, -1).tolist()})
    json.dump(rows, sys.__stdout__)


def new_analysis(case: dict) -> object:
    """One substructure, an element for each mass, one frequency at a time."""
    n = len(case["mass"])
    matrices = {key: np.array(case[name]) for key, name in
                (("M", "mass"), ("C", "damping"), ("K", "stiffness"))}
    matrices["G"] = np.zeros((n, n))
    connectors: dict[str, dict] = {
        "force": {"type": "CosinusForcing", "connect": {"chain": [n - 1]}, "dirs": [0],
                  "amp": case["force"]}}
    for i in range(n):
        if case["kind"] == "friction":
            element = {"type": "Jenkins", "mu": 1.0, "N0": case["limit"], "k": case["contact"]}
        else:
            element = {"type": "CubicSpring", "k": case["cubic"]}
        connectors[f"joint_{i}"] = element | {"connect": {"chain": [i], "GROUND": [0]},
                                              "dirs": [0]}
    data = {"system": {"type": "Base", "nh": case["n_harmonics"], "nti": case["n_time"]},
            "substructures": {"chain": {"matrix": matrices, "ndofs": 1}},
            "connectors": connectors, "kinematics": {},
            "analysis": {"frf": {"study": "frf", "solver": "NewtonRaphson",
                                 "corrector": "nocontinuation", "verbose": False,
                                 "puls_inf": 0.01, "puls_sup": 100.0,
                                 "solver_options": {"tol_residual": case["tolerance"],
                                                    "tol_delta_x": 1.0, "max_iter": 100}}}}
    sys.stdout = sys.stderr
    return pyHarm.Maestro(data).nls["frf"]


def solve(analysis: object, omega: float, guess: np.ndarray | None) -> tuple[np.ndarray, int]:
    """One frequency, from the last solution or from the linear one."""
    analysis.SolList.clear()
    analysis.analysis_options["puls_start"] = omega
    analysis.initialise(guess)
    solution = analysis.SolList[-1]
    if not solution.flag_accepted:
        raise SystemExit(f"pyHarm did not converge at omega = {omega}")
    return np.array(solution.x[:-1]), int(solution.iter_numb)


if __name__ == "__main__":
    main()
