"""Parameter studies with real runs of small oscillators."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from project import PROGRAM, ROOT

from fretwear.cli import main
from fretwear.errors import FretwearError, InputError
from fretwear.report import render_study
from fretwear.study import read_dataset, read_plan, read_table, run_study
from fretwear.study.execution import run_job
from fretwear.study.plan import override
from fretwear.study.pool import run_jobs
from fretwear.study.run import Job, identify, recorded

# Two runs solved to 1e-8 each.
SIMILAR = 1e-6
# The steady state is reached where the rate has fallen by 1e-6, and the rest to wear with it.
STEADY = 1e-5
JENKINS = (ROOT / "example" / "jenkins" / "jenkins.nml").read_text()
HEAD = f"""case = "jenkins.nml"
[run]
program = "{PROGRAM}"
workers = 2
[fixed]
"sweep%n_points" = 11
"harmonics%n_harmonics" = 5
"harmonics%n_time" = 128
"""
GRID = """design = "grid"
[values]
"contact%normal_load" = [0.5, 0.8, 1.1]
"load%cosine" = [1.0, 1.5]
[table]
file = "{table}"
quantities = ["max_amplitude", "omega_at_peak[u1]", "dissipation_at_peak", "slip_at_peak",
              "n_converged", "max_wear_depth", "steady_state"]
"""


class Study:
    """A study file in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.path = folder, folder / "study.toml"
        (folder / "jenkins.nml").write_text(JENKINS)

    def write(self, text: str) -> Study:
        top, _, groups = text.partition("\n[")
        head, _, rest = HEAD.partition("\n")
        self.path.write_text(f"{head}\n{top}\n{rest}\n[{groups}")
        return self

    def __call__(self, *options: str) -> int:
        return main(["study", str(self.path), "-q", *options])

    def results(self) -> dict[str, int]:
        """When each result file was written."""
        return {path.name: path.stat().st_mtime_ns
                for path in sorted((self.folder / "study").glob("*.h5"))}

    def table(self, name: str = "study.h5") -> dict[str, Any]:
        return read_table(self.folder / name)


@pytest.fixture(name="study")
def study_fixture(tmp_path: Path) -> Study:
    return Study(tmp_path)


@pytest.mark.parametrize("table", ["study.h5", "study.parquet"])
def test_grid(study: Study, table: str) -> None:
    """Every combination is run, and its quantities are those of a run by hand."""
    if table.endswith("parquet"):
        pytest.importorskip("pyarrow")
    assert study.write(GRID.format(table=table))() == 0
    found = study.table(table)
    assert found["contact%normal_load"].tolist() == [0.5, 0.5, 0.8, 0.8, 1.1, 1.1]
    assert found["load%cosine"].tolist() == [1.0, 1.5, 1.0, 1.5, 1.0, 1.5]
    assert found["status"].tolist() == ["ok"] * 6
    assert found["exit_status"].tolist() == [0] * 6
    assert found["n_converged"].tolist() == [11] * 6
    assert np.isnan(found["max_wear_depth"]).all()
    assert found["steady_state"].tolist() == [""] * 6
    # More normal load: the slider gives way later, and the peak moves to the stuck resonance.
    assert (np.diff(found["omega_at_peak[u1]"][1::2]) >= 0.0).all()
    by_hand = study.folder / "by_hand.h5"
    settings = ["contact%normal_load=0.8", "load%cosine=1.5", "sweep%n_points=11",
                "harmonics%n_harmonics=5", "harmonics%n_time=128", "case%threads=1"]
    subprocess.run([PROGRAM, "-q", "-o", by_hand, study.folder / "jenkins.nml",
                    *(word for text in settings for word in ("--set", text))], check=True)
    with h5py.File(by_hand) as file:
        peak = file["amplitude"][:, 0].argmax()
        # The maximum lies between the eleven points.
        assert file["peak/amplitude"][0] > file["amplitude"][peak, 0]
        assert found["max_amplitude"][3] == file["peak/amplitude"][0]
        assert found["omega_at_peak[u1]"][3] == file["peak/omega"][0]
        assert found["dissipation_at_peak"][3] == file["contact/dissipation"][peak, 0]
        assert found["slip_at_peak"][3] == file["contact/fraction"][peak, 0, 1]


def test_nothing_is_repeated(study: Study) -> None:
    study.write(GRID.format(table="study.h5"))
    assert study() == 0
    before = study.results()
    assert len(before) == 6
    assert study() == 0
    assert study.results() == before
    # One value more: its two runs are added; other quantities and titles run nothing.
    longer = GRID.replace("1.1]", "1.1, 1.4]").replace('"n_converged"', '"iterations"')
    study.write(longer.format(table="study.h5"))
    (study.folder / "jenkins.nml").write_text(JENKINS.replace("Elastic dry friction", "Other"))
    assert study() == 0
    after = study.results()
    assert len(after) == 8
    assert {name: after[name] for name in before} == before
    assert (study.table()["iterations"] > 0).all()
    # Another namelist: other runs.
    (study.folder / "jenkins.nml").write_text(JENKINS.replace("damping = 0.04", "damping = 0.05"))
    assert study() == 0
    assert len(study.results()) == 16


def test_a_model_file_counts_by_its_content(tmp_path: Path) -> None:
    """Moved: the same run. Changed: another one."""
    case = tmp_path / "frf.nml"
    case.write_text("&case analysis = 'frf' /\n&model source = 'matrix_market' file = 'chain' /\n"
                    "&load cosine = 1 0 /\n&harmonics n_harmonics = 1 /\n"
                    "&sweep start = 1 end = 2 n_points = 2 /\n")
    names = []
    for folder, entry in (("one", 2.0), ("two", 2.0), ("three", 3.0)):
        place = tmp_path / folder
        place.mkdir()
        head = "%%MatrixMarket matrix coordinate real symmetric\n"
        (place / "chain_mass.mtx").write_text(head + "2 2 2\n1 1 1.0\n2 2 1.0\n")
        (place / "chain_stiffness.mtx").write_text(
            head + f"2 2 3\n1 1 {entry}\n2 1 -1.0\n2 2 2.0\n")
        (place / "frf.nml").write_text(case.read_text())
        names.append(identify(str(PROGRAM), place / "frf.nml", tmp_path, {}, {}, 0.0).name)
    assert names[0] == names[1] != names[2]


FAILING = """design = "list"
[[points]]
"contact%normal_load" = 0.5
[[points]]
"contact%mu" = -1.0
[[points]]
"solver%max_iterations" = 1
"solver%fallback" = false
[[points]]
"solver%knid" = "newton"
[table]
quantities = ["max_amplitude", "n_converged", "max_amplitude[u7]"]
"""


def test_failures_are_listed_not_lost(study: Study, capsys: pytest.CaptureFixture[str]) -> None:
    assert study.write(FAILING)() == 4
    listed = capsys.readouterr().err
    assert "contact%mu=-1: bad input (exit status 3)" in listed
    assert "must be a finite real of at least 0" in listed
    assert "solver%fallback=False: not converged (exit status 4)" in listed
    assert "knid" in listed
    found = study.table()
    assert found["status"].tolist() == ["ok", "bad input", "not converged", "bad input"]
    assert found["exit_status"].tolist() == [0, 3, 4, 3]
    assert "contact%mu" in found["message"][1]
    assert found["message"][2].startswith("converged 0 of 11 points")
    assert found["n_converged"][2] == 0
    assert np.isnan(found["max_amplitude"][1:]).all()
    assert found["max_amplitude"][0] > 0.0
    assert "'u7' is not observed; available: u1" in found["message"][0]
    assert found["solver%fallback"] == pytest.approx([np.nan, np.nan, 0.0, np.nan], nan_ok=True)
    before = study.results()
    assert study() == 4  # told again, and not run again
    assert study.results() == before


LONG = """design = "grid"
[values]
"contact%normal_load" = [0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2]
[table]
quantities = ["n_converged"]
"""


@pytest.mark.parametrize("program", [f'program = "{PROGRAM}"\n', ""])
def test_interrupted_and_taken_up_again(study: Study, program: str) -> None:
    """Ctrl-C ends the runs at work, keeps what is complete, and leaves no process behind."""
    study.write(LONG)
    text = study.path.read_text().replace("n_points\" = 11", "n_points\" = 16001")
    text = text.replace(f'program = "{PROGRAM}"\n', program)
    study.path.write_text(text)
    process = subprocess.Popen(
        [sys.executable, "-m", "fretwear", "study", str(study.path), "-q", "--workers", "2"],
        stderr=subprocess.PIPE, text=True, start_new_session=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})
    ends = time.monotonic() + 60.0
    while not list((study.folder / "study").glob("*.json")) and time.monotonic() < ends:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "interrupted" in errors
    # A run that ends while it is killed leaves a result without a record, and is repeated.
    kept = {name: written for name, written in study.results().items()
            if (study.folder / "study" / name).with_suffix(".json").exists()}
    assert 0 < len(kept) < 8
    assert not list((study.folder / "study").glob("*.part*"))
    found = study.table()
    assert (found["status"] == "ok").sum() in range(1, len(kept) + 1)
    assert (found["status"] == "not run").sum() >= 8 - len(kept)
    assert study() == 0
    again = study.results()
    assert len(again) == 8
    assert {name: again[name] for name in kept} == kept
    assert study.table()["n_converged"].tolist() == [16001] * 8


def test_a_run_that_was_killed_is_repeated(study: Study) -> None:
    """A record without its result, or of a run that a signal ended, counts for nothing."""
    study.write(GRID.format(table="study.h5"))
    assert study() == 0
    records = sorted((study.folder / "study").glob("*.json"))
    content = json.loads(records[0].read_text())
    records[0].write_text(json.dumps({**content, "exit_status": -9, "status": "failed"}))
    records[1].write_text("{")
    records[2].with_suffix(".h5").unlink()
    before = study.results()
    assert study() == 0
    after = study.results()
    changed = {name for name in after if before.get(name) != after[name]}
    assert changed == {path.with_suffix(".h5").name for path in records[:3]}


def test_in_process_as_by_program(study: Study) -> None:
    """Runs of the library in this process give the table that started programs give."""
    study.write(GRID.format(table="study.h5"))
    assert study() == 0
    by_program, before = study.table(), study.results()
    text = study.path.read_text().replace(f'program = "{PROGRAM}"\n', "")
    study.path.write_text(text)
    assert study() == 0
    assert study.results() == before, "the runs are the same, whoever carries them out"
    for path in (study.folder / "study").iterdir():
        path.unlink()
    assert study() == 0
    here = study.table()
    assert here.keys() == by_program.keys()
    for name in here.keys() - {"seconds"}:
        np.testing.assert_array_equal(here[name], by_program[name])


@pytest.mark.parametrize("program", [f'program = "{PROGRAM}"\n', ""])
def test_time_limit(study: Study, program: str) -> None:
    study.write(LONG)
    text = study.path.read_text().replace("n_points\" = 11", "n_points\" = 1000001")
    text = text.replace(f'program = "{PROGRAM}"\n', program)
    study.path.write_text(text.replace("workers = 2", "workers = 2\ntimeout = 0.3"))
    plan = read_plan(study.path)
    records = run_study(type(plan)(**{**vars(plan), "points": plan.points[:2]}))
    assert [record.status for record in records if record] == ["time limit"] * 2
    assert [record.exit_status for record in records if record] == [124] * 2
    assert all("after 0.3 s" in record.message for record in records if record)
    assert not list((study.folder / "study").glob("*.h5*"))


def test_dask_cluster_on_this_machine(study: Study) -> None:
    """The same file, the same table; and a restart finds the runs of the other scheduler."""
    pytest.importorskip("distributed")
    study.write(GRID.format(table="study.h5"))
    assert study("--scheduler", "dask") == 0
    on_dask, before = study.table(), study.results()
    assert len(before) == 6
    assert study() == 0
    assert study.results() == before
    for name, column in study.table().items():
        assert np.array_equal(column, on_dask[name], equal_nan=column.dtype.kind == "f"), name


def test_parts_of_a_study_and_their_table(study: Study, capsys: pytest.CaptureFixture[str]) -> None:
    """What a batch array runs, one part each; repeated, a part runs nothing."""
    study.write(GRID.format(table="study.h5"))
    assert study("--part", "1/4") == 0
    first = study.results()
    assert len(first) == 2 and not (study.folder / "study.h5").exists()
    assert study("--part", "1/4") == 0 and study.results() == first
    for k in (2, 3, 4):
        assert study("--part", f"{k}/4") == 0
    assert len(study.results()) == 6
    assert study("--table-only") == 0
    assert set(study.table()["status"]) == {"ok"} and len(study.table()["run"]) == 6
    assert study("--part", "5/4") == 3 and study("--part", "1/4", "--table-only") == 3
    assert "expected K/N, such as 3/16" in capsys.readouterr().err


def test_dask_scheduler_by_its_address(study: Study) -> None:
    distributed = pytest.importorskip("distributed")
    study.write(FAILING)
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False,
                                  dashboard_address=None) as cluster:
        assert study("--scheduler", cluster.scheduler_address) == 4
    assert study.table()["exit_status"].tolist() == [0, 3, 4, 3]


# A scheduler that cannot import the package, wherever that is installed.
BARE_SCHEDULER = """
import sys
sys.modules["fretwear"] = None
from distributed.cli.dask_scheduler import main
main(["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", sys.argv[1]])
"""


def test_a_scheduler_without_the_package_is_one_message(
        study: Study, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("distributed")
    study.write(GRID.format(table="study.h5"))
    told = study.folder / "scheduler.json"
    with subprocess.Popen([sys.executable, "-c", BARE_SCHEDULER, told],
                          stderr=subprocess.DEVNULL) as process:
        try:
            # It is written bit by bit.
            while not (told.exists() and told.read_text().rstrip().endswith("}")):
                assert process.poll() is None
                time.sleep(0.1)
            address = json.loads(told.read_text())["address"]
            assert study("--scheduler", address) == 3
        finally:
            process.kill()
    errors = capsys.readouterr().err.strip().splitlines()
    assert [line for line in errors if "error:" in line] == [
        f"fretwear study: error: run.scheduler = '{address}': the scheduler cannot import "
        "fretwear: install it there, in the same version as here"]
    assert not any("Traceback" in line for line in errors)


HYPERCUBE = """design = "latin_hypercube"
n_samples = 10
seed = 7
[values]
"contact%normal_load" = {min = 0.4, max = 1.4}
"contact%tangential_stiffness" = {min = 0.1, max = 10.0, scale = "log"}
"harmonics%n_harmonics" = {min = 1, max = 5, integer = true}
"""


def test_latin_hypercube(study: Study) -> None:
    text = HYPERCUBE
    study.write(text)
    study.path.write_text(study.path.read_text().replace('"harmonics%n_harmonics" = 5\n', ""))
    plan, again = read_plan(study.path), read_plan(study.path)
    assert plan.points == again.points
    columns = {key: np.array([point[key] for point in plan.points]) for key in plan.keys}
    # One sample in every tenth of each range.
    load = (columns["contact%normal_load"] - 0.4) / 1.0
    stiffness = np.log10(columns["contact%tangential_stiffness"] / 0.1) / 2.0
    for unit in (load, stiffness):
        assert sorted((10.0 * unit).astype(int)) == list(range(10))
    assert sorted(columns["harmonics%n_harmonics"]) == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5]
    assert study() == 0


def test_values_reach_the_program_to_the_last_bit(study: Study) -> None:
    value = 0.1 + 0.2
    job = identify(str(PROGRAM), study.folder / "jenkins.nml", study.folder,
                   {"contact%normal_load": value, "contact%side_1": (1, 0, 0)},
                   {"case%title": "it's", "solver%fallback": False}, 0.0)
    assert isinstance(job, Job)
    assert [override(key, one) for key, one in job.settings.items()] == [
        "case%title='it''s'", "solver%fallback=.false.",
        "contact%normal_load=0.30000000000000004", "contact%side_1=1, 0, 0"]
    assert override("sweep%n_points", 3) == "sweep%n_points=3"
    assert recorded(job) is None
    record = run_job(job)
    assert record.status == "ok"
    assert recorded(job) == record
    with h5py.File(record.result) as file:
        assert "0.30000000000000004" in str(file.attrs["namelist"])


def test_points_that_are_the_same_run_once(study: Study) -> None:
    same = """design = "list"
[[points]]
"contact%normal_load" = 0.5
[[points]]
"contact%normal_load" = 0.5
"case%threads" = 2
"""
    assert study.write(same)() == 0
    assert len(study.results()) == 1
    found = study.table()
    assert found["max_amplitude"][0] == found["max_amplitude"][1] > 0.0
    assert found["run"][0] == found["run"][1]


def test_table_of_what_is_there(study: Study) -> None:
    study.write(GRID.format(table="study.h5"))
    assert study("--table-only") == 0
    assert study.table()["status"].tolist() == ["not run"] * 6
    assert not (study.folder / "study").exists()


def test_no_jobs() -> None:
    assert list(run_jobs([], "processes", 1)) == []


@pytest.mark.parametrize(("old", "new", "message"), [
    ('design = "grid"', 'design = "gird"', "design: 'gird' is not known; expected one of grid"),
    ('design = "grid"', 'desing = "grid"', "desing: is not known"),
    ('case = "jenkins.nml"', 'case = "none.nml"', "there is no such file"),
    ('case = "jenkins.nml"', "case = 3", "case: 3 is a int; expected a str"),
    ("[values]", "[points]", "values: is missing or empty"),
    ("contact%normal_load", "normal_load", "'normal_load' is no namelist key"),
    ("[0.5, 0.8, 1.1]", "0.5", "values.contact%normal_load: expected a list of values"),
    ("[0.5, 0.8, 1.1]", "[{a = 1}]", "is no value of a namelist key"),
    ("load%cosine", "sweep%n_points", "fixed: sweep%n_points is varied too"),
    ("max_amplitude", "maximum", "table.quantities: 'maximum' is not known"),
    ("n_converged", "n_converged[u1]", "'n_converged' is not of an observed quantity"),
    ("study.h5", "study.csv", "'study.csv' must end in .h5 or .parquet"),
    ("workers = 2", "workers = -2", "must not be negative"),
    ("workers = 2", "threads = 2", "run.threads: is not known; expected workers"),
    ("[values]", "n_samples = 3\n[values]", "n_samples: has no meaning for the design 'grid'"),
    ("[values]", "[values", "is no valid TOML"),
    (str(PROGRAM), "/no/fw_run", "run.program = '/no/fw_run' cannot be executed"),
])
def test_wrong_study_files_are_refused(study: Study, old: str, new: str, message: str) -> None:
    study.write(GRID.format(table="study.h5"))
    text = study.path.read_text()
    assert old in text
    if new.startswith("n_samples"):
        text, old, new = new.partition("\n")[0] + "\n" + text, "", ""
    study.path.write_text(text.replace(old, new))
    with pytest.raises(FretwearError) as error:
        run_study(read_plan(study.path))
    assert message in str(error.value)


@pytest.mark.parametrize(("old", "new", "message"), [
    ("seed = 7\n", "", "seed: is missing"),
    ("n_samples = 10", "n_samples = 0", "n_samples: 0 is not accepted"),
    ("max = 1.4", "max = 0.4", "0.4 to 0.4 is no range"),
    ("min = 0.1", "min = 0.0", "no range of positive numbers"),
    ('"log"', '"cubic"', "'cubic' is not known; expected one of linear, log"),
    ("{min = 0.4, max = 1.4}", "[0.4, 1.4]", "expected a range such as"),
])
def test_wrong_hypercubes_are_refused(study: Study, old: str, new: str, message: str) -> None:
    study.write(HYPERCUBE)
    text = study.path.read_text()
    assert old in text
    study.path.write_text(text.replace(old, new))
    with pytest.raises(InputError) as error:
        read_plan(study.path)
    assert message in str(error.value)


def test_a_missing_package_is_named(study: Study, monkeypatch: pytest.MonkeyPatch,
                                    capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    assert study.write(GRID.format(table="study.parquet"))() == 3
    assert "pip install pyarrow" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert study.write(GRID.format(table="study.h5"))("--scheduler", "dask") == 3
    assert "pip install distributed" in capsys.readouterr().err


def test_committed_example(tmp_path: Path) -> None:
    """The friction limit that damps most grows with the force; where limit over force is the same,
    so is amplitude over force."""
    example = ROOT / "example" / "jenkins"
    for name in ("jenkins.nml", "study.toml"):
        (tmp_path / name).write_text((example / name).read_text())
    assert main(["study", str(tmp_path / "study.toml"), "-q"]) == 0
    found = read_table(tmp_path / "study.h5")
    peak = (found["max_amplitude"] / found["load%cosine"]).reshape(6, 3)
    assert (found["status"] == "ok").all()
    page = render_study(tmp_path / "study.h5")
    assert "18 runs, 18 without a complaint" in page and page.count("<tr>") == 19
    data = read_dataset(tmp_path / "study.h5")
    assert dict(data.sizes) == {"contact%normal_load": 6, "load%cosine": 3}
    assert data["max_amplitude"].sel({"contact%normal_load": 2.0, "load%cosine": 1.0}) == (
        found["max_amplitude"].reshape(6, 3)[3, 1])
    best = peak.argmin(axis=0)
    assert (np.diff(best) > 0).all()
    assert peak[0, 0] == pytest.approx(peak[1, 1], rel=SIMILAR)
    assert peak[3, 1] == pytest.approx(peak[4, 2], rel=SIMILAR)


WEAR = """&case analysis = 'wear' /
&model n_dof = 2 mass = 1 0 0 0 stiffness = 1 0 0 10 damping = 0.1 0 0 0 /
&contact n_pairs = 1 side_1 = 1 0 2 law = 'penalty' tangential_stiffness = 5 normal_stiffness = 50
   mu = 0.5 gap = -0.1 area = 2 /
&load cosine = 1 0 /
&harmonics n_harmonics = 3 n_time = 128 /
&sweep start = 0.9 n_points = 1 /
&wear coefficient = 2e-4 n_cycles = 1e4 max_depth_step = 0.01 scheme = 'implicit' /
"""
WEAR_STUDY = """case = "wear.nml"
[values]
"contact%gap" = [-0.1, -0.2]
"wear%n_cycles" = [100.0, 1e5]
[table]
quantities = ["max_wear_depth", "mean_wear_depth", "wear_volume", "cycles", "steady_state",
              "last_amplitude", "max_wear_rate"]
"""


def test_wear(tmp_path: Path) -> None:
    """An interference wears off: in the end the depth is the interference, and no force is left."""
    (tmp_path / "wear.nml").write_text(WEAR)
    (tmp_path / "study.toml").write_text(WEAR_STUDY)
    plan = read_plan(tmp_path / "study.toml")
    run_study(type(plan)(**{**vars(plan), "program": str(PROGRAM)}))
    found = read_table(tmp_path / "study.h5")
    assert found["status"].tolist() == ["ok"] * 4
    assert found["steady_state"].tolist() == ["not reached", "reached"] * 2
    assert found["cycles"][[0, 2]].tolist() == [100.0, 100.0]
    depth = found["max_wear_depth"]
    assert depth[[1, 3]] == pytest.approx([0.1, 0.2], rel=STEADY)
    assert (depth[[0, 2]] < 0.9 * depth[[1, 3]]).all()
    assert found["wear_volume"] == pytest.approx(2.0 * depth)
    assert found["mean_wear_depth"] == pytest.approx(depth)
    assert (found["last_amplitude"][[1, 3]] > found["last_amplitude"][[0, 2]]).all()
    assert (found["max_wear_rate"][[1, 3]] < 1e-4 * found["max_wear_rate"][[0, 2]]).all()


def test_list_of_quantities(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "--quantities"]) == 0
    assert "max_amplitude[observed]" in capsys.readouterr().out
