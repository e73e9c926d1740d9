"""Sweeps in pieces: joined they are the sweep of one process."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from project import EXAMPLE
from rubbing import RUBBING

import fretwear as fw
from fretwear._native import Session, raise_status
from fretwear._progress import CONTROL, WANTED
from fretwear.cli import main
from fretwear.pieces import cutting, running
from fretwear.pieces.cutting import OVERLAP, cut
from fretwear.pieces.overlap import Part
from fretwear.pieces.sharing import Board
from fretwear.settings import Groups

#: Two solutions to 1e-8 of the load each, near a resonance of 1e-3 of critical damping.
SAME = 1e-6
#: The search for a maximum ends at 1e-4 of its height; widths are read between other samples then.
SAME_WIDTH = 1e-3
#: Of iterations, residuals and estimates from them nothing is asked: they depend on the way.
OF_THE_WAY = ("iterations", "residual", "floquet/error", "seconds", "served_by", "peak/bandwidth")

SECTOR = fw.Case.from_file(EXAMPLE / "blade_sector" / "frf.nml", harmonics={"n_time": 64},
                           output={"observe": ["tip", "tip_x"]})
HARDENING = fw.Model([[1.0]], [[0.1]], [[1.0]], cosine=[0.25],
                     springs=[fw.Spring(side_1=1, coefficient=0.5, power=3)])
DUFFING = fw.Case(HARDENING, harmonics={"n_harmonics": 5},
                  sweep={"start": 0.3, "end": 1.8, "n_points": 101})
PENALTY: Groups = {"contact": {"law": "penalty"}}
SLIDING_SWEEP: Groups = {**PENALTY, "sweep": {"start": 0.4, "end": 2.0, "n_points": 65}}
SLIDING = fw.Case(RUBBING, **SLIDING_SWEEP, harmonics={"n_harmonics": 3, "n_time": 64})


def assert_same_result(one: fw.Result, other: fw.Result) -> None:
    """Names, declarations and numbers."""
    assert list(one) == list(other)
    for name in one:
        assert one.declared(name) == other.declared(name)
        if one[name].dtype.kind == "U":
            assert list(one[name]) == list(other[name])
        elif name not in OF_THE_WAY:
            size = np.nanmax(np.abs(one[name]), initial=0.0)
            assert np.allclose(one[name], other[name], rtol=0.0, atol=SAME * size,
                               equal_nan=True), name
    widths = "peak/bandwidth"
    if widths in one:
        assert np.allclose(one[widths], other[widths], rtol=SAME_WIDTH, equal_nan=True)
    assert set(one.attributes) == set(other.attributes)
    for name in ("namelist", "status", "title", "sampling"):
        assert one.attributes.get(name) == other.attributes.get(name)


def test_pieces_share_the_points_and_the_cost() -> None:
    for n_points in (1, 40, 101, 401, 1000):
        for n_pieces in (1, 2, 3, 8, 64):
            pieces = cut(n_points, n_pieces)
            rows = [k for piece in pieces for k in range(piece.first, piece.last + 1)]
            assert rows == list(range(1, n_points + 1))
            assert len(pieces) <= n_pieces
            if n_points >= 100 and len(pieces) > 1:
                # To the rounding of cuts and of leads.
                cost = [piece.last - piece.first + 2.0 * piece.lead for piece in pieces]
                assert max(cost) - min(cost) < 8.0


@pytest.mark.parametrize(("case", "workers"), [
    (SECTOR, 2),
    (SECTOR.replace(sweep={"start": 1029, "end": 1017}, output={"observe": ["tip"]}), 3),
    (DUFFING.replace(sweep={"stability": True}), 3),
    (SLIDING.replace(sweep={"refine": True}), 2),
    (SLIDING.replace(sweep={"parameter": "contact%mu", "frequency": 1.1, "start": 0.1}), 2),
    (fw.Case(RUBBING, **PENALTY, sweep={"values": np.geomspace(0.4, 2.0, 40)},
             harmonics={"accuracy": 1e-3}), 2),
], ids=["sector", "downwards", "stability", "refine", "parameter", "list"])
def test_the_result_is_that_of_one_process(case: fw.Case, workers: int) -> None:
    one, pieces = fw.run(case, in_memory=True), fw.run(case, workers=workers, in_memory=True)
    if "harmonics" in one:  # they depend on the points before: so do rows, within the accuracy
        assert np.allclose(one.coefficients, pieces.coefficients, rtol=0.0,
                           atol=2e-3 * np.abs(one.coefficients).max())
        return
    assert_same_result(one, pieces)


def random_chain(rng: np.random.Generator) -> fw.Case:
    """Two to four masses of which some rub, on the ground or on each other, swept up or down."""
    n = int(rng.integers(2, 5))
    springs = rng.uniform(0.3, 2.0, n + 1)
    stiffness = (np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1)
                 - np.diag(springs[1:-1], -1))
    rubbing = rng.permutation(n)[:int(rng.integers(1, n + 1))]
    joint = fw.ContactPairs([[dof + 1, 0, 0] for dof in rubbing], mu=1.0,
                            normal_load=rng.uniform(0.1, 1.0, len(rubbing)),
                            tangential_stiffness=float(rng.uniform(0.5, 3.0)))
    model = fw.Model(np.eye(n), stiffness * float(rng.uniform(0.005, 0.03)), stiffness,
                     contact=joint, cosine=rng.uniform(-1.0, 1.0, n))
    ends = np.sort(rng.uniform(0.3, 2.4, 2)) if rng.random() < 0.7 else rng.uniform(0.3, 2.4, 2)
    return fw.Case(model, **PENALTY, harmonics={"n_harmonics": int(rng.choice([1, 3, 5])),
                                                "n_time": 64},
                   sweep={"start": ends[0], "end": ends[1], "n_points": int(rng.integers(40, 200))})


def test_random_sweeps_in_pieces_are_those_of_one_process() -> None:
    rng = np.random.default_rng(20)
    for _ in range(30):
        case, workers = random_chain(rng), int(rng.integers(2, 5))
        one = fw.run(case, in_memory=True, check=False)
        pieces = fw.run(case, workers=workers, in_memory=True, check=False)
        assert (one.converged == pieces.converged).all()
        solved = one.converged.astype(bool)
        assert np.allclose(one.coefficients[solved], pieces.coefficients[solved], rtol=0.0,
                           atol=1e-5 * np.abs(one.coefficients).max())


def test_maxima_at_round_off_do_not_depend_on_pieces() -> None:
    """A rigid pair that sticks holds a mass, of which nothing but round-off is observed: where it
    rises towards an end of the sweep depends on the way to it."""
    rng = np.random.default_rng(3)
    for _ in range(12):
        stiffness = np.diag(rng.uniform(1.5, 4.0, 3)) - 0.7 * (np.eye(3, k=1) + np.eye(3, k=-1))
        model = fw.Model(np.eye(3), 0.02 * stiffness, stiffness, cosine=rng.uniform(-1.0, 1.0, 3),
                         contact=fw.ContactPairs([[1, 0, 0]], mu=1.0, normal_load=50.0))
        ends = np.sort(rng.uniform(0.3, 2.4, 2))
        case = fw.Case(model, contact={"law": "rigid"},
                       harmonics={"n_harmonics": 3},
                       sweep={"start": ends[0], "end": ends[1], "n_points": 48})
        one, pieces = fw.run(case, in_memory=True), fw.run(case, workers=3, in_memory=True)
        assert list(one["peak/observed"]) == list(pieces["peak/observed"])
        assert list(one["peak/found_by"]) == list(pieces["peak/found_by"])


def test_pieces_on_different_branches_are_found_and_solved_as_one(
        monkeypatch: pytest.MonkeyPatch) -> None:
    """Without points that lead to it, the second piece begins on the lower branch."""
    case = DUFFING.replace(sweep={"end": 2.4})
    one = fw.run(case)
    monkeypatch.setattr(cutting, "_LEADS", 1e-6)
    monkeypatch.setattr(cutting.Piece, "lead", 0)
    pieces = fw.run(case, workers=2)
    assert any("pieces of the sweep found different solutions" in remark
               for remark in pieces.remarks)
    assert "several solutions" in list(pieces["remarks/name"])
    assert np.allclose(one.coefficients, pieces.coefficients, rtol=0.0, atol=SAME)
    assert (pieces["peak/found_by"] == one["peak/found_by"]).all()


def test_a_worker_that_is_ready_takes_half_of_what_another_has_left() -> None:
    piece = cutting.Piece(101, 400, 401)
    leads = []
    for solved in (0, 102, 300):
        kept, taken = cutting.divided(piece, 200, solved) or (piece, piece)
        assert (kept.first, kept.last + 1, taken.last) == (101, taken.first, 400)
        # It goes on from what it has solved before these rows.
        assert taken.start == (102 if solved == 102 else 0)
        # What leads the other one to its rows counts.
        to_come = kept.last - 200 + OVERLAP
        assert abs(to_come - (taken.last - kept.last + 2 * OVERLAP + 2 * taken.lead)) <= OVERLAP + 4
        leads.append(taken.lead)
    assert leads[1] < leads[0] == leads[2]
    assert cutting.divided(piece, 350) is None and cutting.divided(piece, 400) is None

    board = Board()
    with board.solving(piece) as work, board.solving(cutting.Piece(1, 100, 401)) as ready:
        work.control[1], ready.control[1] = 50, 102
        given = board.take()
        assert given is not None and given.last == 400 and work.piece.last == given.first - 1
        # Its run ends after its own rows and those beyond the cut.
        assert work.control[WANTED] == work.piece.solved[1] - work.piece.solved[0] + 1
        board.is_shared = False
        assert board.take() is None
    assert len(board.states) == 2


def test_rows_that_were_taken_over_are_those_of_one_process(
        monkeypatch: pytest.MonkeyPatch) -> None:
    case = SLIDING.replace(sweep={"n_points": 2000})
    monkeypatch.setattr(running, "cut", lambda n, _: [cutting.Piece(1, 20, n),
                                                      cutting.Piece(21, n, n)])
    was_asked, both_begun = threading.Event(), threading.Barrier(2)
    take, run_piece = Board.take, Session.run_piece

    def asked(board: Board, solved: int) -> cutting.Piece | None:
        given = take(board, solved)
        was_asked.set()
        return given

    def second_waits(session: Session, points: tuple[int, int], *arguments: Any) -> int:
        first = points[0]
        if first <= 21:
            both_begun.wait(60.0)
        assert first != 21 - OVERLAP or was_asked.wait(60.0)
        return run_piece(session, points, *arguments)

    monkeypatch.setattr(Board, "take", asked)
    monkeypatch.setattr(Session, "run_piece", second_waits)
    seen: list[Part] = []
    result, _ = running.run_in_pieces(case, 2, "threads", None, None, in_memory=True,
                                      see=seen.extend)
    pieces = [part.piece for part in seen]
    assert len(pieces) > 2
    assert [piece.first for piece in pieces[1:]] == [piece.last + 1 for piece in pieces[:-1]]
    # Of long sweeps the search for maxima keeps few rows, and reads widths between them.
    one = fw.run(case, in_memory=True)
    assert one.omega.tobytes() == result.omega.tobytes()
    for name in ("coefficients", "peak/omega", "peak/amplitude"):
        size = np.abs(one[name]).max()
        assert np.allclose(one[name], result[name], rtol=0.0, atol=SAME * size), name


def test_workers_of_a_cluster(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=1, threads_per_worker=2, processes=False,
                                  dashboard_address=None) as cluster:
        pieces = fw.run(SLIDING, tmp_path / "pieces.h5", scheduler=cluster.scheduler_address)
    assert pieces.path == tmp_path / "pieces.h5"
    case = SLIDING.replace(output={"file": str(tmp_path / "pieces.h5")})
    assert_same_result(fw.run(case, in_memory=True), pieces)


def test_rows_before_a_stop_are_kept() -> None:
    asked: list[int] = []

    def stop() -> bool:
        asked.append(1)
        return len(asked) > 2

    case = SLIDING.replace(sweep={"n_points": 200000})
    with pytest.raises(fw.RunStopped) as interrupted:
        fw.run(case, workers=2, stop=stop)
    result = interrupted.value.result
    assert result is not None and result.status == "stopped"
    # Of both pieces.
    assert 0 < result.n_points < 200000 and result.omega[0] < 1.0 < result.omega[-1]
    assert (np.diff(result.omega) > 0.0).all()


def test_progress_counts_all_pieces() -> None:
    told: list[tuple[int, int]] = []
    fw.run(SECTOR, workers=2, in_memory=True, progress=lambda done, total: told.append(
        (done, total)))
    assert all(0 <= done <= total == 121 for done, total in told)


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"sweep": {"continuation": "arclength"}}, "natural"),
    ({"case": {"analysis": "point"}}, "analysis = 'point'"),
    ({"contact": {"memory": "carried"}}, "contact%memory"),
    ({"control": {"amplitude": [0.5]}}, "&control"),
]


@pytest.mark.parametrize(("change", "told"), REFUSED)
def test_what_does_not_go_in_pieces_is_refused(change: dict[str, Any], told: str) -> None:
    with pytest.raises(fw.InputError, match=told):
        fw.run(SLIDING.replace(**change), workers=2)


def test_lists_in_no_order_and_negative_numbers_are_refused() -> None:
    case = fw.Case(RUBBING, **PENALTY, sweep={"values": [0.5, 0.9, 0.7]})
    with pytest.raises(fw.InputError, match="sort them"):
        fw.run(case, workers=2)
    with pytest.raises(fw.InputError, match="workers = -1"):
        fw.run(SLIDING, workers=-1)


def run_piece(case: fw.Case, first: int, last: int, leads: int) -> fw.Result:
    """Rows `first` to `last` of a sweep, by a session."""
    with case.open() as given, Session(given) as session:
        status = session.run_piece((first, last), leads, 0, np.zeros(CONTROL, dtype=np.int64))
        if status:
            raise_status(status, session.text("message"))
        return fw.Result.from_bytes(session.image(), case)


def test_a_piece_has_the_rows_of_its_sweep() -> None:
    whole = fw.run(SLIDING)
    for leads in (0, 1, 4, 19, 400):
        piece = run_piece(SLIDING, 20, 30, leads)
        assert piece.omega.tobytes() == whole.omega[19:30].tobytes()
        assert np.allclose(piece.coefficients, whole.coefficients[19:30], rtol=0.0, atol=SAME)
    for first, last, told in ((66, 66, "first point of a piece = 66: must be one of the 65"),
                              (9, 8, "must be from its first = 9 to 65")):
        with pytest.raises(fw.InputError, match=told):
            run_piece(SLIDING, first, last, 0)


@pytest.mark.parametrize("harmonics", [{"n_harmonics": 3}, {"accuracy": 1e-2}],
                         ids=["as given", "to an accuracy"])
@pytest.mark.parametrize("leads", [0, 1, 5, 400])
def test_a_piece_goes_on_from_the_one_before(harmonics: Any, leads: int) -> None:
    case = fw.Case(RUBBING, **SLIDING_SWEEP, harmonics=harmonics)
    whole = fw.run(case)
    same = max(SAME, 2.0 * harmonics.get("accuracy", 0.0) * np.abs(whole.coefficients).max())
    with case.open() as given, Session(given) as session:
        # From the start, behind the rows before, and from the start again.
        for first, last, solved in ((1, 12, 0), (13, 20, 12), (45, 50, 20), (5, 9, 0)):
            control = np.zeros(CONTROL, dtype=np.int64)
            assert session.run_piece((first, last), leads, solved, control) == 0
            piece = fw.Result.from_bytes(session.image(), case)
            assert piece.omega.tobytes() == whole.omega[first - 1:last].tobytes()
            n = min(piece.coefficients.shape[1], whole.coefficients.shape[1])
            assert np.allclose(piece.coefficients[:, :n], whole.coefficients[first - 1:last, :n],
                               rtol=0.0, atol=same)


def test_a_session_is_of_the_whole_sweep_behind_a_piece() -> None:
    with SLIDING.open() as given, Session(given) as session:
        control = np.zeros(CONTROL, dtype=np.int64)
        assert session.run_piece((13, 20), 3, 0, control) == 0
        assert session.run(control, in_memory=True) == 0
        whole = fw.Result.from_bytes(session.image(), SLIDING)
    assert whole.omega.tobytes() == fw.run(SLIDING).omega.tobytes()


def test_what_a_piece_remarks_is_not_said_of_the_next() -> None:
    # A mode without damping that nothing reaches, at the second row.
    model = fw.Model(np.eye(2), np.diag([0.1, 0.0]), np.diag([1.3, 1.0]), cosine=[1.0, 0.0])
    case = fw.Case(model, harmonics={"n_harmonics": 1},
                   sweep={"start": 0.5, "end": 4.5, "n_points": 9})
    told = []
    with case.open() as given, Session(given) as session:
        for first, last, solved in ((1, 3, 0), (4, 9, 3)):
            assert session.run_piece((first, last), 1, solved,
                                     np.zeros(CONTROL, dtype=np.int64)) == 0
            piece = fw.Result.from_bytes(session.image(), case)
            told.append("undetermined mode" in list(piece["remarks/name"]))
    assert told == [True, False]


def test_a_sweep_ends_after_the_points_that_are_wanted() -> None:
    control = np.zeros(CONTROL, dtype=np.int64)
    control[WANTED] = 9
    with SLIDING.open() as session:
        assert session.run(control, in_memory=True) == 0
        part = fw.Result.from_bytes(session.image(), SLIDING)
    assert part.status == "complete" and control[1] == 9
    assert part.coefficients.tobytes() == fw.run(SLIDING).coefficients[:9].tobytes()


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "duffing.h5"
    words = ["run", str(EXAMPLE / "duffing" / "duffing.nml"), "-o", str(target), "--workers", "2"]
    assert main([*words, "--set", "sweep%n_points=40"]) == 0
    out = capsys.readouterr().out
    assert "converged         40 of 40 points" in out and "peak u1" in out
    assert fw.Result(target).n_points == 40
    assert main([*words, "-q", "--set", "solver%max_iterations=1", "--set",
                 "solver%fallback=.false."]) == 4
    assert main(["run", *words[1:4], "-q", "--set", "sweep%n_points=3"]) == 0
    assert fw.Result(target).n_points == 3
