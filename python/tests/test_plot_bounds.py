"""The picture of a range over residual tractions, and what Python optimises over them."""
import json

import matplotlib
import numpy as np
import pytest
from cases import merged, run
from project import ROOT

import fretwear as fw
from fretwear.errors import AbsentError
from fretwear.plot import fitting, plot_bounds

matplotlib.use("Agg")


@pytest.fixture(scope="module", name="folder")
def run_once(tmp_path_factory):
    oracle = json.loads((ROOT / "test/reference/bodies/v9_bounds.json").read_text())
    folder = tmp_path_factory.mktemp("bounds")
    run(folder, merged(oracle["groups"], {"sweep": {"values": [186.0, 190.0]}}))
    run(folder, merged(oracle["groups"], {"case": {"analysis": "point"}, "bounds": {
        "quantity": None}, "sweep": {"start": 190.0}, "contact": {"memory": "residual"}}),
        name="point")
    return folder


def test_band_is_between_the_ends(folder):
    result = fw.Result(folder / "case.h5")
    assert "bounds" in fitting(result)
    figure = plot_bounds(result)
    band = figure.axes[0].collections[0].get_paths()[0].vertices
    assert band[:, 1].max() == pytest.approx(result["bounds/highest"].max())
    assert band[:, 1].min() == pytest.approx(result["bounds/lowest"].min())
    assert "first harmonic of u1" in figure.axes[0].get_ylabel()
    assert len(figure.axes[1].lines) == 4
    with pytest.raises(AbsentError, match="holds no range"):
        plot_bounds(fw.Result(folder / "point.h5"))


def test_optimise_over_a_residual_traction(folder):
    """The lowest amplitude over the one traction that matters is that of the range."""
    found = fw.optimise(fw.Case.from_file(folder / "point.nml"), over="contact%residual(1)",
                        minimise="first_harmonic", bounds=(-1.0, 1.0))
    lowest = fw.Result(folder / "case.h5")["bounds/lowest"][1]
    assert found.value == pytest.approx(lowest, rel=1e-4)
    assert np.abs(found.values).max() <= 1.0
