"""What is observed and stays at rest has no peak, and is told so."""
import pytest

import fretwear as fw
from fretwear.errors import AbsentError

CASE = """
&case analysis = 'frf' /
&model n_dof = 2, mass = 1.0, 0.0, 0.0, 1.0, stiffness = 1.0, 0.0, 0.0, 2.0,
       damping = 0.02, 0.0, 0.0, 0.04 /
&load cosine = 1.0, 0.0 /
&output observe = 2 /
&sweep start = 0.7, end = 1.3, n_points = 11 /
"""


def test_peaks_at_rest(tmp_path):
    (tmp_path / "case.nml").write_text(CASE)
    with pytest.raises(AbsentError, match="stays at rest at every point; observe another dof"):
        _ = fw.run(tmp_path / "case.nml").peaks
