"""Memory of runs long enough for growth to show; `make long` has longer ones, and their times."""
from __future__ import annotations

import long_runs
import pytest


@pytest.mark.parametrize("case", [long_runs.sweep(8000), long_runs.wear(4000)],
                         ids=["sweep", "wear"])
def test_memory_is_flat(case):
    # From half way on: on a busy machine, a tenth of the readings may be those of the start.
    memory, _, _ = long_runs.measure(case)
    assert memory[-1] - memory[len(memory) // 2] < long_runs.MEMORY_GROWTH
