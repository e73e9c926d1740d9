"""The comparison of two builds sees a changed number, a changed count and a dataset that is
gone."""
from dataclasses import replace

import numpy as np
from project import PROGRAM, ROOT, require_program

from bench.compare.compare_builds import compare, outcome
from bench.compare.comparison_cases import Case


def changed(found, name, value):
    return replace(found, data={**found.data, name: value})


def test_what_differs_is_seen(tmp_path):
    require_program()
    case = Case("small", ROOT / "example" / "jenkins" / "jenkins.nml", {"sweep%n_points": 5})
    found = outcome(PROGRAM, case, tmp_path)
    assert compare(found, found).wrong == ()
    amplitude = found.data["amplitude"]
    assert compare(changed(found, "amplitude", amplitude*(1.0 + 3e-13)), found).wrong == ()
    moved = compare(changed(found, "amplitude", amplitude*(1.0 + 3e-12)), found)
    assert moved.wrong == ("amplitude differs",)
    lost = np.where(np.arange(5)[:, None] == 2, np.nan, amplitude)
    assert compare(changed(found, "amplitude", lost), found).wrong
    assert compare(changed(found, "iterations", found.data["iterations"] + 1), found).wrong
    gone = replace(found, data={k: v for k, v in found.data.items() if k != "contact/force"})
    assert compare(gone, found).wrong == ("no contact/force",)
    assert compare(found, gone).wrong == ()
    assert compare(replace(found, status=4), found).wrong
