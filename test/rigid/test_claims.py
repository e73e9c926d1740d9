"""Claims of accuracy are kept: a part of the family that docs/robustness.md counts."""
import claims
import numpy as np
from project import PROGRAM

#: Every kind of case five times: within 20 s.
COUNT = 5 * len(claims.KINDS)
#: Of 2,000 claims at most 0.5 % may be broken, by 1.5 times: of sixty, none.
LEAST_CLAIMED = 0.9


def test_claims_are_kept():
    """Every law, judged independently; and most cases do get a claim."""
    rows = claims.measure(0, COUNT, {"this": PROGRAM})["this"]
    ratio = np.array([row[1] for row in rows])
    assert len(rows) > 0.8 * COUNT
    assert np.count_nonzero(~np.isnan(ratio)) > LEAST_CLAIMED * len(rows)
    assert np.nanmax(ratio) <= 1.0, [row for row in rows if row[1] > 1.0]


def test_every_judge_is_another():
    """A judge never asks for an accuracy itself, and the kinds are all there."""
    kinds = set()
    for seed in range(len(claims.KINDS)):
        kind, claim, judge, _, accuracy = claims.make_case(seed)
        kinds.add(kind)
        assert claim["harmonics"]["accuracy"] == accuracy
        assert judge is None or "accuracy" not in judge["harmonics"]
    assert kinds == set(claims.KINDS)
