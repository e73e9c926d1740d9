"""Random structures that once misled a nonlinear mode: a position that moves before anything slips,
paths that depend on where the period starts, folds that long steps passed over."""
import numpy as np
import pytest
from cases import merged, run
from mode_cases import mode_groups, read_mode
from mode_family import draw, unbalanced
from test_mode_judge import SEVERAL


def follow(folder, groups, start, end, n_points, **mode):
    keys = {"start": start, "end": end, "n_points": n_points, **mode}
    run(folder, merged(groups, {"mode": keys}), status=(0, 4))
    return read_mode(folder)


@pytest.mark.parametrize("seed", [28, 31])
def test_onset_about_a_position_that_moves(tmp_path, seed):
    """Rigid pairs slip on the way to the cycle and shake down to another position, about which the
    motion departs 3 % below the onset about the position at rest."""
    groups = draw(seed)[2]
    onset = follow(tmp_path, groups, 0.05, 0.2, 8)["attributes of mode"]["onset_amplitude"]
    found = follow(tmp_path, groups, 0.999 * onset, 1.01 * onset, 2)
    lost = found["contact/dissipation"].sum(axis=1)
    assert abs(lost[0]) < 1e-12 < 1e-8 < lost[1]
    assert found["attributes of mode"]["onset_amplitude"] == pytest.approx(onset, rel=2e-4)


def test_paths_that_depend_on_the_start_of_the_period(tmp_path):
    """Two directions near the onset: a motion that was turned to its phase is solved for again."""
    case, ring, groups = draw(11)
    found = follow(tmp_path, groups, 0.025, 0.045, 5)
    assert found["converged"].all()
    assert np.abs(found["coefficients"][:, 2, 0]).max() < 1e-9
    assert max(unbalanced(ring, case, found, k) for k in range(5)) < 1e-9


def test_natural_steps_end_at_a_fold(tmp_path):
    """They used to land on another part of the curve, and which one was up to the steps."""
    groups = draw(3)[2]
    few, many = (follow(tmp_path, groups, 0.08, 0.12, n) for n in (5, 17))
    # Arc length turns back there.
    fold = 0.09414
    for found in (few, many):
        assert found["converged"].all()
        assert found["mode/modal_amplitude"].max() < fold
    assert many["mode/damping_ratio"][:5:4] == pytest.approx(few["mode/damping_ratio"][:2],
                                                             rel=1e-7)


def test_fold_below_the_start(tmp_path):
    """Two masses with a stop fold at 1.567 under the modal control: beyond, a start is a jump."""
    for start, jumps in ((1.4, False), (2.0, True)):
        run(tmp_path, mode_groups(SEVERAL, start, start * 1.1, 3))
        found = read_mode(tmp_path)
        assert (b"fold below the start" in found.get("remarks/name", [])) == jumps
