"""Memory of runs long enough for growth to show; `make long` has longer ones, and their times."""
from __future__ import annotations

import long_runs
import pytest


@pytest.mark.parametrize(("make", "n_points"), [(long_runs.sweep, 8000), (long_runs.wear, 4000)])
def test_memory_is_flat(make, n_points):
    memory, _, _ = long_runs.measure(make(n_points), n_points)
    assert memory[-1] - memory[len(memory) // 2] < long_runs.MEMORY_GROWTH
