"""Error against run time: the measurement, its reference, its text, figure and page."""

import json
from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.simulation import loop
from pgraph_core.study import precision
from pgraph_core.study.measures import Errors, angles, measured, spread
from pgraph_core.study.reference import finest, horizon
from pgraph_core.study.report import seconds_at
from pgraph_core.study.task import Task

from ..worlds import ball, built_in, on_ground

ONE = {"methods": "rk4", "steps": 0.01, "rounds": 1}  # a study of one run


@pytest.fixture(scope="module")
def study() -> pg.Study:
    return pg.work_precision(
        built_in("double_pendulum"),
        t_end=0.5,
        methods=("semi_implicit_euler", "rk4", "dop853"),
        steps=(0.02, 0.01, 0.005),
        tolerances=(1e-4, 1e-7, 1e-13),
        rounds=2,
        frames=11,
        target=1e-5,
        longest=60,
    )


def test_every_method_runs_at_every_setting(study: pg.Study):
    found = [(row.method, row.step, row.rtol) for row in study.rows]
    steps = [(m, h, None) for m in ("semi_implicit_euler", "rk4") for h in (0.02, 0.01, 0.005)]
    assert found == steps + [("dop853", None, rtol) for rtol in (1e-4, 1e-7, 1e-13)]
    assert all(row.ok and row.seconds and row.error for row in study.rows)
    assert [row.counters["steps"] for row in study.rows if row.method == "rk4"] == [30, 50, 100]
    assert study.reference["accuracy"] < 1e-12
    assert study.reference["limit"] == 10 * study.reference["accuracy"]


def test_errors_are_distances_of_tips(study: pg.Study):
    """Hinges turn by small angles: the tips are where the angles put them."""
    mech, t = built_in("double_pendulum"), np.linspace(0, 0.5, 11)
    fine = pg.simulate(mech, t_end=0.5, t_eval=t, method="dop853", rtol=1e-13)
    rough = pg.simulate(mech, t_end=0.5, t_eval=t, method="rk4", step=0.02)
    turned = np.abs(np.cumsum(rough.q - fine.q, axis=1)).max()
    row = next(row for row in study.rows if row.method == "rk4" and row.step == 0.02)
    assert turned * 0.99 < row.error_max < 10 * turned


def test_the_error_does_not_depend_on_the_place_of_the_mechanism():
    """1e4 m away a point's distance from the origin would make every error 1e4 times smaller."""
    model = built_in("double_pendulum").model
    away = model.edit(model.bodies[0].name, link=(1e4, 0.0, 0.0))
    here, there = (pg.work_precision(m, t_end=0.3, frames=11, **ONE) for m in (model, away))
    assert here.rows[0].error == pytest.approx(there.rows[0].error, rel=0.2)


def test_angles_between_rotations_and_norms_of_errors():
    q = np.array([[1.0, 0, 0, 0]])
    for a in (1e-12, 1e-6, 1.0, 3.0):
        p = np.array([[np.cos(a / 2), 0, np.sin(a / 2), 0]])
        assert angles(p, q)[0] == pytest.approx(a, rel=1e-9)
        assert angles(-p, q)[0] == pytest.approx(a, rel=1e-9)
    e = np.array([[0.0, 0.0], [3.0, 4.0], [1.0, 2.0]])
    assert Errors.of(e) == Errors(pytest.approx(np.sqrt(30 / 6)), 4.0)
    assert Errors.of(np.array([[np.nan]])).rms == np.inf


def test_corners_of_tables_inside_steps_cost_no_order():
    pull = pg.Motor(name="pull", body="1", torque=pg.Table(t=(0.0, 0.33, 0.55), value=(0, 5, -5)))
    options = {**ONE, "frames": 3, "steps": [1 / n for n in (32, 64, 128, 256)]}
    found = pg.work_precision(pg.Model.serial(1).add(pull), t_end=1.0, **options)
    steps, errors = np.log([(row.step, row.error) for row in found.rows]).T
    assert np.polyfit(steps, errors, 1)[0] == pytest.approx(4, abs=0.5)


def test_errors_below_the_limit_of_the_reference_are_marked():
    mech, t = built_in("double_pendulum"), np.linspace(0, 0.3, 7)
    rough = pg.simulate(mech, t_end=0.3, t_eval=t, method="rk4", step=0.01)
    options = {"methods": "dop853", "tolerances": 1e-9, "rounds": 1}
    (row,) = pg.work_precision(mech, t_end=0.3, reference=rough, **options).rows
    assert row.limited
    assert row.error == pytest.approx(3 * rough.error_estimate)


def test_chaotic_motion_is_cut_where_two_references_part():
    apart = np.full((50, 2), 1e-12)
    apart[30:] = 1e-3
    assert horizon(apart) == 30
    assert horizon(apart[:20]) == 20
    mech = built_in("double_pendulum").edit("upper", q=3.0)
    found = pg.work_precision(mech, t_end=30.0, **{**ONE, "steps": 0.3})
    assert found.t_end < found.asked == 30.0
    assert any("two references still agree" in note for note in found.notes)


def test_a_motion_that_is_impossible_is_refused_with_its_cause():
    model = pg.Model.serial(1).add(pg.Point(name="a", body="1", point=(1, 0, 0)))
    model = model.add(pg.Point(name="bad", body="1", point=(1, 0, 0), other_point=(3, 3, 3)))
    with pytest.raises(pg.InputError, match="'bad'"):
        pg.work_precision(model, t_end=0.1, rounds=1)
    options = {"values": (1.0,), "steps": (1e-2,), "methods": ("rk4", "radau5")}
    found = pg.stability_map(model, axis="speed", t_end=0.1, **options)
    assert not any(cell.status == "OK" for cell in found.cells)
    assert "bad" in found.advice


def test_a_run_that_fails_or_takes_too_long_stays_with_its_reason():
    stiff = pg.Model.serial(1).edit("1", stiffness=1e6, q=1.0)
    options = {**ONE, "steps": (1e-2, 2e-4), "frames": 5}
    bad, good = pg.work_precision(stiff, t_end=0.5, **options).rows
    assert (bad.ok, bad.error, good.ok) == (False, None, True)
    assert "t = " in bad.reason
    options = {**ONE, "steps": (1e-2, 5e-3, 1e-9), "longest": 60, "frames": 5}
    *done, left = pg.work_precision(built_in("quadruped"), t_end=0.1, **options).rows
    assert [row.ok for row in (*done, left)] == [True, True, False]
    assert "60 s" in left.reason


def test_a_study_tells_its_progress_and_can_be_stopped():
    seen: list[float] = []
    mech, options = built_in("double_pendulum"), {"t_end": 0.5, "methods": "rk4", "rounds": 2}
    found = pg.work_precision(mech, progress=lambda x: seen.append(x) or len(seen) < 8, **options)
    assert found.cancelled
    assert len(seen) == 8
    assert seen == sorted(seen)


def test_a_study_ends_in_time_and_names_what_it_left_out(monkeypatch):
    """The clock says that the time is over after the first timed run. Short runs come first."""
    clock, honest = [0.0], precision.measured

    def measured(runs, *given, **options):
        def timed(run):
            clock[0] = 1e3
            return run()

        return honest([lambda run=run: timed(run) for run in runs], *given, **options)

    monkeypatch.setattr(precision, "measured", measured)
    monkeypatch.setattr(precision, "time", SimpleNamespace(perf_counter=lambda: clock[0]))
    options = {"t_end": 0.1, "methods": "rk4", "steps": (0.01, 0.005), "rounds": 1, "within": 30}
    rows = pg.work_precision(built_in("double_pendulum"), **options).rows
    assert sorted(row.seconds is not None for row in rows) == [False, True]
    assert all(row.error for row in rows)
    (left,) = (row for row in rows if row.seconds is None)
    assert "30 s" in left.reason
    with pytest.raises(pg.InputError, match=r"within.*0\.0"):
        pg.work_precision(built_in("double_pendulum"), **{**options, "within": 0.0})


class Slow:
    """A machine on which no run comes farther than this [s of motion] in time, by any clock."""

    def __init__(self, monkeypatch, farthest: float):
        self.farthest, self.task = farthest, None
        honest = Task.run

        def run(task, *given, **options):
            self.task = task
            return honest(task, *given, **options)

        monkeypatch.setattr(Task, "run", run)

    def watch(self, sure: bool):
        return lambda fraction: sure or fraction * self.task.t_end < self.farthest


@pytest.mark.parametrize("farthest", [0.1, 1e-3, 1e-9])
def test_a_slow_machine_shortens_the_motion_to_what_runs_reach(monkeypatch, farthest):
    """However slow it is, if a run takes a step. It was refused at a 1024th part."""
    mech = built_in("double_pendulum")
    times = np.linspace(0.0, 10.0, 101)
    task = Task(mech, np.array([1.0, 0.5]), np.zeros(2), times, asked=10.0)
    known, part = finest(task, 10.0, 1e-3, Slow(monkeypatch, farthest).watch)
    assert 0.0 < part.t_end < 10.0
    assert known.t[-1] == part.t_end
    assert known.accuracy < 1e-9


def test_a_motion_without_any_step_in_time_is_refused_with_a_remedy(monkeypatch):
    task = Task(built_in("double_pendulum"), None, None, np.linspace(0.0, 9.0, 101), asked=9.0)
    watch = lambda sure: lambda fraction: False  # noqa: E731
    monkeypatch.setattr(loop.Steps, "fraction", lambda steps: 0.0)
    with pytest.raises(pg.InputError) as refused:
        finest(task, 10.0, 1e-3, watch)
    for fact in ("in time", "larger `within`", "`reference`"):
        assert fact in str(refused.value)


def test_contacts_are_measured_too():
    """Rigid contact: moreau_jean and the methods that go from event to event."""
    bouncing = on_ground(ball(place=(0, 0, 0.2)), points=((0, 0, 0),), restitution=0.5)
    found = pg.work_precision(bouncing, t_end=0.3, steps=(0.01, 0.005), rounds=1, frames=7)
    assert found.methods == ("semi_implicit_euler", "rk4", "dopri5", "dop853", "moreau_jean")
    best = min(found.rows, key=lambda row: row.error or np.inf)
    assert best.method in ("dopri5", "dop853", "rk4")
    assert found.recommend(1e-3).ok


def test_rounds_are_interleaved():
    order: list[int] = []
    runs = [lambda i=i: order.append(i) or i + 1.0 for i in range(3)]
    assert measured(runs, [1.0] * 3, 4) == [[1.0] * 4, [2.0] * 4, [3.0] * 4]
    assert [sorted(order[3 * k : 3 * k + 3]) for k in range(4)] == [[0, 1, 2]] * 4
    assert order != [0, 1, 2] * 4
    assert spread([5.0, 1.0, 3.0, 2.0, 4.0]) == (2.0, 3.0, 4.0)


def test_the_cheapest_run_that_meets_the_target_is_recommended(study: pg.Study):
    """Without a target it is the cheapest for 1e-6, and the most accurate where none reaches it."""
    row = study.recommend()
    fit = [r for r in study.rows if (r.error or 1) <= 1e-5]
    assert row in fit
    assert row.time == min(r.time for r in fit)
    assert study.recommend(1e-2).error <= 1e-2
    assert replace(study, target=None).advised().error <= 1e-6
    hard = replace(study, target=1e-30)
    assert hard.advised().error == min(row.error for row in study.rows if row.error)


def test_times_at_equal_error_lie_between_the_points(study: pg.Study):
    row = study.rows[3]
    rows = tuple(replace(row, error=e, seconds=(s, s, s)) for e, s in ((1e-2, 1.0), (1e-4, 4.0)))
    expected = {1e-3: pytest.approx(2.0), 1e-4: 4.0, 1.0: 1.0, 1e-5: np.inf}
    assert {error: seconds_at(rows, error) for error in expected} == expected
    theirs = replace(study.rows[5], method="Peer rk4", peer="Peer", error=1e-9, seconds=(9e9,) * 3)
    found = replace(study, rows=(*study.rows, theirs)).against_peers()
    assert [row["error"] for row in found] == [10.0**-k for k in range(3, 10)]
    assert all(row["peer"] == "Peer rk4" and row["ratio"] > 1 for row in found)


def test_a_study_is_json_a_figure_and_a_page_that_needs_nothing_else(study: pg.Study, tmp_path):
    data = json.loads(study.to_json())
    assert [row["method"] for row in data["rows"]] == [row.method for row in study.rows]
    assert data["rows"][data["recommended"]]["error"] <= 1e-5
    assert data["reference"]["source"] == study.reference["source"]
    ElementTree.fromstring(study.figure())
    for suffix in pg.Study.SUFFIXES:
        study.save(tmp_path / f"report{suffix}")
        text = (tmp_path / f"report{suffix}").read_text(encoding="utf-8")
        assert "dop853" in text
        assert "http" not in text.replace("http://www.w3.org/2000/svg", "")


def test_a_peer_that_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("pgraph_peers.Peer.installed", False)
    (note,) = pg.work_precision(built_in("pendulum"), t_end=0.1, peers="mujoco", **ONE).notes
    assert "pip install mujoco" in note
