"""Random asymmetric sectors against the whole annulus, which is solved as one structure."""
import numpy as np
import pytest
from annulus import Annulus, random_case
from cyclic_cases import difference, run_at

#: Both are solved to residuals of 1e-13; conditioning near resonances takes the rest.
EQUAL = 1e-9
OMEGAS = [0.7, 1.3, 1.9]


def compare(tmp_path, case, **options):
    """Largest differences of the response and of the forces, of the load."""
    annulus = Annulus(case)
    for name in ("sector", "annulus"):
        (tmp_path / name).mkdir()
    sector = run_at(tmp_path / "sector", case, OMEGAS, status=(0, 4), **options)
    whole = run_at(tmp_path / "annulus", annulus.case, OMEGAS, status=(0, 4), **options)
    # What five harmonics do not solve, they solve for neither.
    solved = sector["converged"].astype(bool)
    assert np.array_equal(solved, whole["converged"].astype(bool)) and solved.any()
    n = len(case["contact"]["side_1"])
    return (difference(sector["coefficients"][solved],
                       annulus.sector(whole["coefficients"][solved])),
            difference(sector["contact/force"][solved], whole["contact/force"][solved, :, :n]))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("law", ["penalty", "dlft"])
def test_sector_is_the_annulus(tmp_path, law, seed):
    case = random_case(np.random.default_rng([17, seed]), law=law)
    response, force = compare(tmp_path, case, sampling="events")
    assert response < EQUAL and force < EQUAL
