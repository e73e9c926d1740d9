"""Some cases of the family against the annulus, and equations with a mistake, which must not
balance."""
import family
import pytest
from wave_equations import VARIANTS

#: A mistake leaves more than this of the load in the equations, where it shows at all: five orders
#: above what balances. Harmonics of a thousandth of the motion tell "phi for n phi".
WRONG = 1e-4
SOUND = {"equal", "begin", "two solutions"}


@pytest.mark.parametrize("seed", range(5))
def test_sectors_are_the_annulus_and_mistakes_show(seed):
    """One case of each law."""
    law, points = family.one(seed)
    assert law.split(",")[0] == family.LAWS[seed]
    assert {point["what"] for point in points} <= SOUND, points
    assert any(point["what"] == "equal" for point in points)
    for point in points:
        assert point["balance"]["right"] < family.BALANCED
        for name in VARIANTS[1:]:
            assert point["balance"].get(name, 1.0) > WRONG, (name, point)


def test_every_mistake_was_looked_for():
    """Among these cases each shows at some point."""
    seen = {name for seed in range(5) for point in family.one(seed)[1] for name in point["balance"]}
    assert seen == set(VARIANTS)
