"""The picture of a free decay."""

from pathlib import Path

import numpy as np
import pytest

import fretwear as fw
from fretwear.errors import AbsentError
from fretwear.plot import plot_ringdown


def test_free_decay(tmp_path: Path) -> None:
    model = fw.Model([[1.0]], [[0.08]], [[4.0]], contact=fw.ContactPairs(
        [[1, 0, 0]], mu=0.3, normal_load=1.0, tangential_stiffness=0.6))
    case = fw.Case(model, case={"analysis": "ringdown"}, ringdown={"amplitude": 2.0},
                   contact={"law": "penalty"})
    result = fw.run(case, tmp_path / "decay.h5")
    left, right, damping = plot_ringdown(result).axes
    assert np.array_equal(left.lines[1].get_xdata(), result["ringdown/extreme/time"])
    assert np.allclose(right.lines[0].get_ydata(), result["ringdown/omega"][1:-1] / (2.0 * np.pi))
    assert damping.lines[0].get_ydata().min() > 0.0
    with pytest.raises(AbsentError, match="ringdown"):
        plot_ringdown(fw.run(case.replace(case={"analysis": "modes"}),
                             tmp_path / "modes.h5"))
