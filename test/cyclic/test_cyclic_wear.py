"""Wear of sectors, which all wear alike."""
import numpy as np
from cyclic_cases import TIGHT, read_reference, run_at

#: The reference integrates its depth to 1e-6.
DEPTH = 1e-5


def wear_run(folder, case, **wear):
    reference = case["wear"]
    return run_at(folder, case, [reference["omega"]], analysis="wear", others={
        "contact": {"area": reference["area"]},
        "wear": {"coefficient": reference["coefficient"], "n_cycles": reference["n_cycles"],
                 "max_steps": 2000, **wear}}, solver={"tolerance": TIGHT})


def test_depth_of_the_reference(tmp_path):
    case = read_reference("v2")
    found = wear_run(tmp_path, case, scheme="implicit", order=3,
                     error_tolerance=case["wear"]["error_tolerance"])
    assert np.isclose(found["wear/cycles"][-1], case["wear"]["n_cycles"])
    assert np.allclose(found["wear/depth"][-1], case["wear"]["depth"], rtol=DEPTH)
    assert np.allclose(found["wear/rate"][0], case["wear"]["rate_first"], rtol=1e-8)


def test_other_schemes_come_to_the_same_depth(tmp_path):
    """With steps of some percent of the depth, first and second order."""
    case = read_reference("v2")
    for i, wear in enumerate(({"scheme": "explicit", "order": 2},
                              {"scheme": "pseudo_time"})):
        folder = tmp_path / str(i)
        folder.mkdir()
        found = wear_run(folder, case, max_depth_step=1e-3, **wear)
        assert np.allclose(found["wear/depth"][-1], case["wear"]["depth"], rtol=0.03), wear
