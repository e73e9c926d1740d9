"""Every picture shows the numbers of its result: drawn from runs of a small sector."""

from __future__ import annotations

import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.figure import Figure
from program import run

import fretwear
from fretwear import InputError
from fretwear.cli import main
from fretwear.plot import (
    KINDS,
    Choices,
    fitting,
    plot_convergence,
    plot_cycle,
    plot_flanks,
    plot_harmonics,
    plot_hysteresis,
    plot_response,
    plot_responses,
    plot_table,
    plot_wear_bars,
    plot_wear_evolution,
    plot_wear_maps,
)
from fretwear.plot.flanks import _sizes, find_flanks
from fretwear.plot.style import label_y, new_figure, scale
from fretwear.result import Result
from fretwear.rows import pair_fields, synthesis
from fretwear.study.table import write_table

# What the forces of a result, known to 1e-8, leave of a displacement of 1e-3 mm.
RECOVERED = 1e-7


def _maps(figure: Figure) -> list[np.ndarray]:
    """Values of the maps of a figure, in the order drawn."""
    return [np.asarray(axes.collections[0].get_array()) for axes in figure.axes
            if axes.get_visible() and axes.get_label() != "<colorbar>"]


def _labelled(figure: Figure) -> None:
    """Every number axis says what it shows, with its unit where it has one."""
    texts = [axes.get_xlabel() + axes.get_ylabel() for axes in figure.axes if axes.get_visible()]
    texts += [text.get_text() for text in (figure._supxlabel, figure._supylabel) if text]
    assert any(texts)
    for text in texts:
        assert not {"[1]", "[L]", "[F]", "[]"} & set(re.findall(r"\[.*?\]", text)), text
    # No power of ten stands above a panel, where it would meet the title.
    figure.canvas.draw()
    assert not [axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)
                if axis.get_offset_text().get_text()]


def test_response_of_a_run(coarse: Result) -> None:
    figure = plot_response(coarse)
    upper, lower = figure.axes
    assert np.array_equal(upper.lines[0].get_xdata(), coarse.frequency)
    assert np.array_equal(upper.lines[0].get_ydata(), coarse.amplitude[:, 0])
    assert upper.get_ylabel() == "amplitude of tip [mm]"
    mean = coarse.fraction.mean(axis=1)
    bottoms = [area.get_paths()[0].vertices[1:41, 1] for area in lower.collections]
    assert bottoms[1] == pytest.approx(mean[:, 0])
    assert plot_response(coarse, "tip_x").axes[0].get_ylabel() == "amplitude of tip_x [mm]"
    _labelled(figure)


def test_a_branch_with_unstable_points(examples: Path, tmp_path: Path) -> None:
    result = run(examples.parent / "duffing" / "duffing.nml", tmp_path / "duffing.h5",
                 "sweep%continuation=arclength", "sweep%stability=true", "sweep%end=2.5")
    assert result.stable is not None
    unstable = result.stable == 0
    assert unstable.any() and (~unstable).any()
    (axes,) = plot_response(result).axes
    stable_line, unstable_line = axes.lines[:2]
    shown = np.isfinite(stable_line.get_ydata())
    assert np.array_equal(shown, ~unstable)
    assert unstable_line.get_linestyle() == "--"
    assert set(result.amplitude[unstable, 0]) <= set(unstable_line.get_ydata())
    (ground,) = axes.patches
    low, high = ground.get_x(), ground.get_x() + ground.get_width()
    assert (low, high) == pytest.approx((result.frequency[unstable].min(),
                                         result.frequency[unstable].max()))


def test_hysteresis_is_the_history(sampled: Result) -> None:
    point, pair = sampled.peak(), 3
    figure = plot_hysteresis(sampled, pairs=[pair])
    (line,) = figure.axes[0].lines
    displacement = sampled["history/relative_displacement"][point, :, pair]
    c = int(np.argmax(np.ptp(displacement[:, :2], axis=0)))
    assert np.array_equal(line.get_xdata()[:-1], displacement[:, c])
    assert np.array_equal(line.get_ydata()[:-1], sampled["history/force"][point, :, pair, c])
    assert line.get_xdata()[-1] == line.get_xdata()[0]
    assert figure.axes[0].get_title() == f"pair 4, intrados, {('t1', 't2')[c]}"
    _labelled(figure)


def test_the_loop_encloses_the_dissipation(coarse: Result) -> None:
    point = coarse.peak()
    cycle = coarse.cycle(point)
    work = np.trapezoid(cycle.force[..., :2], cycle.displacement[..., :2], axis=0).sum(axis=1)
    # The trapezoidal rule over 64 instants, of a force with corners.
    assert work == pytest.approx(coarse.dissipation[point], rel=2e-2,
                                 abs=2e-2 * coarse.dissipation[point].max())


def test_the_pairs_drawn_dissipate_most(coarse: Result) -> None:
    figure = plot_hysteresis(coarse)
    names = [axes.get_title().split(",")[0] for axes in figure.axes if axes.get_visible()]
    drawn = [int(name.split()[1]) - 1 for name in names]
    loss = coarse.dissipation[coarse.peak()]
    # Pairs that stick are left with round-off, which has no order.
    assert len(drawn) == 6 and drawn == sorted(drawn)
    assert set(np.flatnonzero(loss > 1e-9 * loss.max())) <= set(drawn)
    with pytest.raises(InputError, match="pair 9: there are 8, counted from 1"):
        plot_hysteresis(coarse, pairs=[8])


def test_cycle_of_the_tip_and_of_pairs(coarse: Result) -> None:
    point = 5
    figure = plot_cycle(coarse, point, [0, 7])
    upper, lower = figure.axes
    tau = np.radians(upper.lines[0].get_xdata())
    expected = coarse.coefficients[point, :, 0] @ synthesis(7, tau)
    assert upper.lines[0].get_ydata() == pytest.approx(expected, rel=1e-12)
    assert np.abs(expected).max() == pytest.approx(coarse.amplitude[point, 0], rel=1e-3)
    assert [line.get_label().split(",")[0] for line in lower.lines] == ["pair 1", "pair 8"]
    _labelled(figure)


def test_a_normal_contact_shows_its_normal(examples: Path, tmp_path: Path) -> None:
    result = run(examples.parent / "gap" / "gap.nml", tmp_path / "gap.h5", "sweep%n_points=4")
    figure = plot_hysteresis(result)
    assert figure.axes[0].get_title() == "pair 1, n"
    assert np.ptp(figure.axes[0].lines[0].get_xdata()) > 0.1


def test_harmonics(coarse: Result) -> None:
    point = coarse.peak()
    (axes,) = plot_harmonics(coarse).axes
    heights = [bar.get_height() for bar in axes.patches]
    assert heights == pytest.approx([abs(coarse.harmonic(n)[point]) for n in range(4)], rel=1e-12)


def test_harmonics_end_where_those_of_the_point_do(examples: Path, tmp_path: Path) -> None:
    """With an accuracy the file has room for more harmonics than a point takes."""
    result = run(examples.parent / "gap" / "gap.nml", tmp_path / "gap.h5", "sweep%n_points=4",
                 "harmonics%n_harmonics=53", "harmonics%n_time=0", "harmonics%accuracy=0.1")
    point = result.peak()
    highest = result["harmonics"][point]
    assert highest < result.n_harmonics
    (axes,) = plot_harmonics(result).axes
    assert axes.get_xlim()[1] == pytest.approx(highest + 0.6)
    assert plot_hysteresis(result, point).axes[0].lines


def test_flanks_are_laid_out_by_position(coarse: Result) -> None:
    first, second = find_flanks(coarse)
    assert (first.name, second.name) == ("intrados", "extrados")
    assert np.concatenate((first.pairs, second.pairs)).tolist() == list(range(8))
    for flank in (first, second):
        assert flank.size.prod(axis=1) == pytest.approx(coarse["contact/area"][flank.pairs])
        position = coarse["contact/position"][flank.pairs]
        assert flank.axes == ("z", "slope, rising in y")
        assert flank.place[:, 0] == pytest.approx(position[:, 2])
        # Higher on the map is further out on the disk.
        assert (np.diff(flank.place[:, 1]) * np.diff(position[:, 1]) >= 0.0).all()


def test_cells_of_a_leaning_grid_have_no_slivers() -> None:
    """Rows that lean against the directions of a picture are rows all the same."""
    across, along = np.meshgrid(np.arange(3.0), np.arange(4.0))
    place = np.column_stack((across.ravel() + 0.05 * along.ravel(),
                             along.ravel() - 0.08 * across.ravel()))
    assert _sizes(place) == pytest.approx(np.ones((12, 2)), abs=0.01)
    scattered = np.random.default_rng(3).random((9, 2))
    assert np.isnan(_sizes(scattered)).all()
    # A grid with a hole keeps its cells.
    assert _sizes(np.delete(np.column_stack((across.ravel(), along.ravel())), 5, axis=0)
                  ) == pytest.approx(np.ones((11, 2)))


def test_maps_hold_the_states_and_pressures(coarse: Result) -> None:
    point = coarse.peak()
    figure = plot_flanks(coarse)
    maps = _maps(figure)
    loss, stick = coarse.dissipation[point], coarse.fraction[point, :, 0]
    # What a pair that sticks all the period dissipates is nothing; the file has round-off of it.
    assert (stick == 1.0).any() and np.abs(loss[stick == 1.0]).max() < 1e-9 * loss.max()
    expected = [values[pairs] for values in (
        *coarse.fraction[point].T,
        -coarse.force[point, 0, :, 2] / coarse["contact/area"],
        np.where(stick == 1.0, 0.0, loss) / coarse["contact/area"])
        for pairs in (range(4), range(4, 8))]
    assert len(maps) == 10
    # Panels come row by row, fields column by column.
    for wanted in expected:
        assert any(np.array_equal(found, wanted) for found in maps)
    assert pair_fields(coarse, point)["pressure"][1] == "N/mm^2"
    _labelled(figure)


def test_wear_pictures(worn: Result) -> None:
    last = len(worn.depth) - 1
    maps = _maps(plot_wear_maps(worn))
    def shown(depth: np.ndarray) -> np.ndarray:
        """Round-off of pairs that do not wear is drawn as the zero that it stands for."""
        return np.where(np.abs(depth) < 1e-9 * depth.max(), 0.0, depth)

    assert np.array_equal(np.concatenate((maps[0], maps[2])), shown(worn.depth[last]))
    bars = plot_wear_bars(worn, 7)
    heights = [bar.get_height() for axes in bars.axes for bar in axes.patches]
    assert np.array_equal(heights, shown(worn.depth[7]))
    evolution = plot_wear_evolution(worn)
    depth, rate, amplitude = evolution.axes
    for line in depth.lines:
        pair = int(str(line.get_label()).split(",")[0].split()[1]) - 1
        assert np.array_equal(line.get_xdata(), worn.cycles)
        assert np.array_equal(line.get_ydata(), worn.depth[:, pair])
    assert rate.lines[0].get_ydata() == pytest.approx(worn.rate.max(axis=1))
    assert np.array_equal(amplitude.lines[0].get_ydata(), worn.amplitude[:, 0])
    assert "steady state reached" in evolution.get_suptitle()
    for figure in (bars, evolution):
        _labelled(figure)


def test_convergence(coarse: Result) -> None:
    figure = plot_convergence(coarse)
    iterations, residual, seconds = figure.axes
    assert np.array_equal(iterations.lines[0].get_ydata(), coarse.iterations)
    assert np.array_equal(residual.lines[0].get_ydata(), coarse.residual)
    assert np.array_equal(seconds.lines[0].get_ydata(), 1e3 * coarse.seconds)
    assert [line.get_ydata()[0] for line in residual.lines if line.get_label() == "tolerance"] == [
        1e-8]
    _labelled(figure)


def test_a_residual_of_nothing_leaves_the_others_their_room(
        coarse: Result, tmp_path: Path) -> None:
    path = tmp_path / "vanished.h5"
    path.write_bytes(Path(coarse.path).read_bytes())
    with h5py.File(path, "r+") as file:
        file["residual"][3] = 1e-140
    _, residual, _ = plot_convergence(path).axes
    assert residual.get_ylim()[0] == pytest.approx(1e-18)


def test_kinds_that_fit(coarse: Result, worn: Result, examples: Path, tmp_path: Path) -> None:
    assert fitting(coarse) == ["response", "cycle", "hysteresis", "harmonics", "flanks",
                               "convergence"]
    assert {"wear_maps", "wear_bars", "wear_evolution"} <= set(fitting(worn))
    point = run(examples.parent / "coulomb" / "coulomb.nml", tmp_path / "a.h5")
    assert fitting(point) == ["cycle", "hysteresis", "harmonics", "convergence"]
    for result in (coarse, worn, point):
        for name in fitting(result):
            figure = KINDS[name].draw(result, Choices())
            assert any(axes.has_data() for axes in figure.axes), name


def test_nothing_has_converged(coarse: Result, tmp_path: Path) -> None:
    path = tmp_path / "failed.h5"
    path.write_bytes(coarse.path.read_bytes())
    with h5py.File(path, "r+") as file:
        file["converged"][...] = False
    result = Result(path)
    for name in fitting(result):
        KINDS[name].draw(result, Choices()).savefig(tmp_path / "a.svg")


def test_without_places_there_is_no_map(coarse: Result, tmp_path: Path) -> None:
    path = tmp_path / "placeless.h5"
    path.write_bytes(coarse.path.read_bytes())
    with h5py.File(path, "r+") as file:
        del file["contact/position"]
    assert "flanks" not in fitting(Result(path))
    with pytest.raises(InputError, match="no /contact/position"):
        plot_flanks(path)


def test_command_line(coarse: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                      capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plot", str(coarse.path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {
        f"coarse_{name}.png" for name in fitting(coarse)}
    assert main(["plot", str(coarse.path), "--kind", "hysteresis", "--pairs", "1,2", "--point",
                 "-1", "-o", "one.svg"]) == 0
    assert "<svg" in Path("one.svg").read_text()
    capsys.readouterr()


@pytest.mark.parametrize(("options", "status", "message"), [
    (["--kind", "respons"], 3, "must be among response, cycle"),
    (["--kind", "respons"], 3, "; did you mean response?"),
    (["--point", "41"], 3, "point 41: there are 40, counted from 1"),
    (["--pairs", "one"], 3, "must be numbers"),
    (["--observe", "tpi"], 3, "available: tip, tip_x"),
    (["--observe", "tpi"], 3, "; did you mean tip?"),
    (["--kind", "wear_bars"], 3, "case%analysis = 'wear'"),
    (["--kind", "response", "-o", "a.xyz"], 3, "xyz"),
    (["-o", "none/a.png"], 5, "there is no folder"),
])
def test_command_line_refuses(coarse: Result, options: list[str], status: int, message: str,
                              tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                              capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plot", str(coarse.path), *options]) == status
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(("words", "meant"), [
    (["plto", "a.h5"], "plot"), (["plot", "a.h5", "--knid", "response"], "--kind"),
    (["study", "study.toml", "--worker=2"], "--workers")])
def test_the_nearest_command_and_option_are_named(words: list[str], meant: str,
                                                  capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(words)
    assert f"did you mean {meant}?" in capsys.readouterr().err


def test_values_are_shown_in_a_readable_unit() -> None:
    """The data stay; the numbers at the ticks are those of the unit."""
    assert scale(0.88, "mm") == (1.0, "mm")
    assert scale(4.2e-4, "mm") == (pytest.approx(1e6), "nm")
    assert scale(4.2e-3, "mm") == (pytest.approx(1e3), "µm")
    assert scale(3e5, "N") == (pytest.approx(1e-3), "kN")
    assert scale(2e-3, "N mm") == (pytest.approx(1e3), "10⁻³ N mm")
    assert scale(2e-8, "") == (pytest.approx(1e9), "10⁻⁹")
    assert scale(0.0, "mm") == (1.0, "mm")
    figure = new_figure()
    axes = figure.subplots()
    axes.plot([0.0, 1.0], [0.0, 4e-3])
    label_y(axes, "depth", "mm")
    figure.canvas.draw()
    assert axes.get_ylabel() == "depth [µm]"
    shown = {tick.get_text() for tick in axes.get_yticklabels()}
    assert {"0", "1", "2", "3", "4"} <= shown or {"0.0", "1.0", "2.0", "3.0", "4.0"} <= shown


def test_a_notebook_shows_the_picture(coarse: Result) -> None:
    assert plot_response(coarse)._repr_png_().startswith(b"\x89PNG")
    assert fretwear.plot_response is plot_response  # without an import of fretwear.plot
    with pytest.raises(AttributeError, match="no attribute 'plot_nothing'"):
        _ = fretwear.plot_nothing


def test_responses_of_several_results(coarse: Result, examples: Path, tmp_path: Path,
                                      monkeypatch: pytest.MonkeyPatch) -> None:
    other = run(examples.parent / "jenkins" / "jenkins.nml", tmp_path / "slick.h5",
                "contact%mu=0.5", "sweep%n_points=5")
    elastic = run(examples.parent / "jenkins" / "jenkins.nml", tmp_path / "elastic.h5",
                  "sweep%n_points=5")
    figure = plot_responses([elastic, other.path])
    axes, = figure.axes
    for line, result in zip(axes.lines, (elastic, other)):
        assert np.array_equal(line.get_ydata(), result.amplitude_of(0), equal_nan=True)
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["elastic", "slick"]
    _labelled(figure)
    with pytest.raises(InputError, match="is not observed"):
        plot_responses([coarse, other])
    monkeypatch.chdir(tmp_path)
    assert main(["plot", "elastic.h5", "slick.h5", "-o", "both.png"]) == 0
    assert Path("both.png").read_bytes().startswith(b"\x89PNG")
    assert main(["plot", "elastic.h5", "slick.h5", "--kind", "hysteresis"]) == 3
    assert main(["plot", "elastic.h5", "slick.h5", "--point", "1"]) == 3


def test_the_table_of_a_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                              capsys: pytest.CaptureFixture[str]) -> None:
    mu = np.array([0.1, 0.2, 0.1, 0.2, 0.3, 0.3])
    height = np.array([3.0, 2.0, 5.0, 4.0, 1.0, np.nan])
    table = {"run": np.array(list("abcdef")), "contact%mu": mu,
             "load%harmonic_scale": np.array([1.0, 1.0, 2.0, 2.0, 1.0, 2.0]),
             "exit_status": np.zeros(6, dtype=int), "status": np.array(["complete"] * 6),
             "message": np.array([""] * 6), "seconds": np.ones(6), "result": np.array([""] * 6),
             "max_amplitude[tip]": height, "frequency_at_peak": 1000.0 + height,
             "steady_state": np.array(["reached"] * 6)}
    write_table(table, tmp_path / "study.h5", "study")
    monkeypatch.chdir(tmp_path)
    figure = plot_table("study.h5")
    assert [axes.get_ylabel() for axes in figure.axes] == ["max_amplitude\nof tip",
                                                           "frequency_at_peak [Hz]"]
    assert figure.axes[-1].get_xlabel() == "contact%mu"
    first, second = figure.axes[0].lines
    assert np.array_equal(first.get_xydata(), [[0.1, 3.0], [0.2, 2.0], [0.3, 1.0]])
    # The run without a number is left out.
    assert np.array_equal(second.get_xydata(), [[0.1, 5.0], [0.2, 4.0]])
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["1.0", "2.0"]
    many = np.repeat(np.arange(1.0, 9.0), 3)
    write_table({**{name: np.resize(column, 24) for name, column in table.items()},
                 "contact%mu": np.tile([0.1, 0.2, 0.3], 8), "load%harmonic_scale": many,
                 "max_amplitude[tip]": many}, tmp_path / "grid.h5", "study")
    # More values than colours are curves all the same, each with its name.
    grid = plot_table("grid.h5", ["max_amplitude[tip]"]).axes[0]
    names = [text.get_text() for text in grid.get_legend().get_texts()]
    # Along the number that varies most, a curve for each of the three others.
    assert names == ["0.1", "0.2", "0.3"] and len(grid.lines) == 3
    write_table({**{name: np.resize(column, 24) for name, column in table.items()},
                 "contact%mu": np.linspace(0.1, 0.3, 24),
                 "load%harmonic_scale": np.linspace(2.0, 1.0, 24),
                 "max_amplitude[tip]": many}, tmp_path / "sample.h5", "study")
    sample, bar = plot_table("sample.h5", ["max_amplitude[tip]"]).axes
    assert bar.get_ylabel() == "load%harmonic_scale"
    assert len(sample.collections[0].get_array()) == 24
    assert main(["plot", "study.h5"]) == 0
    assert Path("study.png").read_bytes().startswith(b"\x89PNG")
    assert main(["plot", "study.h5", "--kind", "response"]) == 3
    assert "does not go with the table of a study" in capsys.readouterr().err
    write_table({**table, "contact%mu": np.full(6, 0.1), "load%harmonic_scale": np.ones(6)},
                tmp_path / "same.h5", "study")
    assert main(["plot", "same.h5"]) != 0
    assert "no number varies" in capsys.readouterr().err


def test_held_amplitudes_are_curves_of_their_own() -> None:
    """Nothing joins the end of one to the beginning of the next, and none has a peak."""
    model = fretwear.Model([[1.0]], [[0.1]], [[1.0]], cosine=[1.0])
    result = fretwear.frf(model, 0.5, 1.5, 3, control={"amplitude": [0.5, 1.0]})
    axes = plot_response(result).axes[0]
    heights = np.asarray(axes.lines[0].get_ydata(), dtype=float)
    np.testing.assert_allclose(heights, [0.5, 0.5, 0.5, np.nan, 1.0, 1.0, 1.0], rtol=1e-6)
    assert not axes.texts
