"""Slow stick-slip: easier balances of the same case lead to points that nothing else reaches.

Which of these cases are reached turns with the round-off of the processor: they are counted.
"""
import subprocess

from cases import merged, write_namelist
from limits import limit
from project import PATIENT, PROGRAM
from slow_family import random_case, verdict

#: Of the family that docs/robustness.md counts; 0 is reached from fewer harmonics or not at all.
SEEDS = (0, 1, 2, 3)
FEWEST = 2


def test_what_is_reached_is_a_solution(tmp_path):
    """Judged by its own equations."""
    found = []
    for seed in SEEDS:
        folder = tmp_path / str(seed)
        folder.mkdir()
        converged, right, _, _ = verdict(folder, random_case(seed), PROGRAM)
        assert right or not converged, seed
        found.append(converged)
    assert sum(found) >= FEWEST


def test_the_message_names_time(tmp_path):
    """Where no balance is reached."""
    hopeless = {"solver": {"max_iterations": 1, "fallback": False}}
    write_namelist(tmp_path / "case.nml", merged(random_case(SEEDS[1]), hopeless))
    done = subprocess.run([PROGRAM, "case.nml"], cwd=tmp_path, text=True, capture_output=True,
                          timeout=limit(120), check=False, env=PATIENT)
    assert done.returncode == 4
    assert "analysis = 'time'" in done.stdout + done.stderr
