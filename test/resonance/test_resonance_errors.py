"""What has no resonance, or is refused, says so."""
import pytest
from cases import merged, read, run
from resonance_cases import REFERENCES, track, track_groups

CHAIN = REFERENCES["chain"]["groups"]
NORMAL = REFERENCES["normal"]["groups"]

REFUSED = [
    ({"resonance": {"parameter": None}}, "parameter"),
    ({"resonance": {"start": None}}, "start"),
    ({"resonance": {"end": 0.4}}, "differ"),
    ({"resonance": {"end": -0.4}}, "at least 0"),
    ({"resonance": {"spacing": "log", "start": 0.0}}, "log"),
    ({"resonance": {"continuation": "arclength"}}, "phase"),
    ({"resonance": {"parameter": "contact%gap"}}, "no pair has a normal dof"),
    ({"resonance": {"parameter": "spring%coefficient"}}, "no springs"),
    ({"resonance": {"parameter": "model%rotation_speed"}}, "stiffness_rotation"),
    ({"resonance": {"as": "factor", "parameter": "model%modal_damping"}}, "factor"),
    ({"harmonics": {"method": "tcm"}}, "hbm"),
    ({"harmonics": {"accuracy": 1e-3, "n_harmonics": None}}, "accuracy"),
    ({"contact": {"memory": "carried"}}, "carried"),
    ({"solver": {"kind": "powell"}}, "newton"),
    ({"sweep": {"continuation": "arclength"}}, "natural"),
    ({"sweep": {"end": None}}, "end"),
    ({"load": {"cosine": [0.0, 0.0]}}, "load"),
    ({"contact": {"law": "dlft", "tangential_stiffness": None},
      "resonance": {"parameter": "contact%tangential_stiffness"}}, "rigid"),
]


@pytest.mark.parametrize(("changes", "word"), REFUSED)
def test_refusals(tmp_path, changes, word):
    groups = merged(track_groups(CHAIN, "contact%mu", 0.4, 0.6), changes)
    done = run(tmp_path, groups, status=3)
    assert word in done.stderr


def test_values_that_differ_from_pair_to_pair(tmp_path):
    groups = merged(CHAIN, {"contact": {"n_pairs": 2, "side_1": [1, 0, 0, 2, 0, 0],
                                        "side_2": [0] * 6, "mu": [0.4, 0.3],
                                        "tangential_stiffness": [1.5, 1.0],
                                        "normal_load": [1.0, 0.5]}})
    done = run(tmp_path, track_groups(groups, "contact%mu", 0.4, 0.6), status=3)
    assert "factor" in done.stderr
    found = track(tmp_path, groups, "contact%mu", 1.0, 1.2, **{"as": "factor"})
    assert found["converged"].all()


def test_no_load_in_the_first_harmonic(tmp_path):
    groups = merged(CHAIN, {"load": {"cosine": None, "n_terms": 1, "term_dof": [2],
                                     "term_harmonic": [2], "term_amplitude": [0.2]}})
    done = run(tmp_path, track_groups(groups, "contact%mu", 0.4, 0.6, condition="phase"), status=3)
    assert "harmonic 1" in done.stderr


def test_a_response_that_falls_all_the_way(tmp_path):
    groups = merged(CHAIN, {"sweep": {"start": 3.0, "end": 4.0, "n_points": 20}})
    run(tmp_path, track_groups(groups, "contact%mu", 0.4, 0.6), status=4)
    found = read(tmp_path / "case.h5")
    assert not found["converged"].any()
    assert "no resonance" in dict(remarks(found))


def test_a_resonance_that_leaves_the_range(tmp_path):
    """What was found until then stays, and the message says where it was lost."""
    groups = merged(CHAIN, {"sweep": {"start": 1.28, "end": 1.3, "n_points": 20}})
    run(tmp_path, track_groups(groups, "load%harmonic_scale", 1.0, 4.0, n_points=10), status=4)
    found = read(tmp_path / "case.h5")
    assert 1 < len(found["omega"]) < 10
    assert found["converged"].all()
    assert "lost beyond load%harmonic_scale" in dict(remarks(found))["lost resonance"]


def test_another_peak_becomes_the_largest(tmp_path):
    """Two masses, the second peak damped by friction at first: with less of it, it is higher."""
    groups = {"model": {"n_dof": 2, "mass": [1.0, 0.0, 0.0, 1.0],
                        "stiffness": [2.0, -0.3, -0.3, 3.0], "damping": [0.06, 0.0, 0.0, 0.02]},
              "load": {"cosine": [0.05, 1.0]}, "harmonics": {"n_harmonics": 1},
              "contact": {"n_pairs": 1, "side_1": [2, 0, 0], "law": "penalty", "mu": [1.0],
                          "tangential_stiffness": [1.0], "normal_load": [1.0]},
              "sweep": {"start": 1.0, "end": 2.4, "n_points": 240}}
    found = track(tmp_path, groups, "contact%normal_load", 1.0, 0.05, n_points=12)
    assert found["converged"].all()
    # On the first peak all the way, which the remark says is not the largest any more.
    assert (found["omega"] < 1.5).all()
    (text,) = [text for name, text in remarks(found) if name == "another peak"]
    assert "1.7" in text


def remarks(found):
    return [(name.decode(), text.decode())
            for name, text in zip(found.get("remarks/name", []), found.get("remarks/text", []),
                                  strict=True)]
