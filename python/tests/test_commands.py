"""What a newcomer types: words that are no subcommands, pictures without a kind."""
import subprocess
import sys

import pytest

import fretwear
from fretwear.cli import _GENERATORS, main


@pytest.mark.parametrize("name", _GENERATORS)
def test_a_generator_is_named_where_it_is_typed_as_a_command(name, capsys):
    with pytest.raises(SystemExit) as ended:
        main([name, "-o", "model.h5"])
    assert ended.value.code == 2
    assert f"python -m fretwear.{name}" in capsys.readouterr().err


@pytest.mark.parametrize("name", _GENERATORS)
def test_every_generator_runs_under_the_name_that_is_said(name):
    done = subprocess.run([sys.executable, "-m", f"fretwear.{name}", "--help"],
                          capture_output=True, text=True, check=True)
    assert f"usage: python -m fretwear.{name} " in done.stdout


def test_near_words_are_still_named(capsys):
    with pytest.raises(SystemExit):
        main(["plott"])
    assert "did you mean plot?" in capsys.readouterr().err


#: A pair on a wedge that sticks, so that it has a range of answers.
WEDGE = """
    &model   n_dof = 2, mass = 1.0, 0.0, 0.0, 1.0, stiffness = 2.0, 0.3, 0.3, 2.0,
             damping = 0.04, 0.0, 0.0, 0.04 /
    &contact n_pairs = 1, law = 'penalty', tangential_stiffness = 1.0, normal_stiffness = 1.0,
             side_1 = 1, 0, 2, mu = 0.5, gap = -1.0 /
    &load    cosine = 0.02, 0.02 /
    &output  observe = 1 /
"""


@pytest.mark.parametrize(("analysis", "group", "title"), [
    ("ringdown", "&ringdown amplitude = 0.01, n_cycles = 4 /", "ringdown"),
    ("bounds", "&sweep start = 1.6, end = 2.0, n_points = 3 /", "bounds")])
def test_a_result_is_drawn_without_a_kind(analysis, group, title, tmp_path):
    case = fretwear.Case.from_text(f"&case analysis = '{analysis}' /{WEDGE}{group}")
    result = fretwear.run(case, tmp_path / "case.h5")
    assert len(result.plot().axes) == len(result.plot(title).axes)
    assert [line.get_xydata().tolist() for axes in result.plot().axes for line in axes.lines] == [
        line.get_xydata().tolist() for axes in result.plot(title).axes for line in axes.lines]
