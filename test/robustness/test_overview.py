"""The table over all parts of docs/robustness.md counts what stands in their tables."""
import overview
import pytest

DOCUMENT = """# Page
<!-- part: begin -->
At some commit.

| family | cases | crash | hang | false |
|---|---|---|---|---|
| one | 12 | 0 | 2 | 0 |
| two | 30 | 1 | 0 | 0 |
| three | 5 |  |  |  |
| all | 47 | 1 | 2 | 0 |

| other | cases |
|---|---|
| one | 100 |
<!-- part: end -->
"""


def test_counts_are_added_up(tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    page.write_text(DOCUMENT)
    monkeypatch.setattr(overview, "PARTS", [
        ("part", page, "<!-- part: begin -->", "cases", ["cases"],
         {**overview.CRASH_HANG, "false convergence": ["false"]})])
    assert list(overview.table())[2:] == ["| part | 47 cases | 1 | 2 |  | 0 |  |  |"]


@pytest.mark.parametrize(("values", "expected"), [
    ("3.8 4.3 0.26 0.24", 0), ("3.8 5.0 0.26 0.24", 1), ("3.8 4.3 0.2 0.31", 1)])
def test_a_long_run_that_grows_counts(values, expected):
    row = dict(enumerate(["sweep", "10000", "10000", *values.split()]))
    assert overview.grows(row) == expected


@pytest.mark.parametrize("part", overview.PARTS, ids=lambda part: part[0])
def test_every_part_has_a_table(part):
    rows = overview.rows_behind(part[1].read_text(), part[2])
    wanted = {column for chosen in part[5].values() for column in chosen} - {"grows"}
    assert rows and wanted | set(part[4]) <= set(rows[0])
