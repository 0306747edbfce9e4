"""Walks on the page, without a browser: events, parts that go on, what is said, what is sent."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.core.events import Event
from pgraph_app.core.state import Kernels, State, initial, poses
from pgraph_app.features import update
from pgraph_app.gait import Change, changes, has_feet, prints, since
from pgraph_app.gait.update import SHOWN, Push, SetGait, SetGround, SetWalk, Walk
from pgraph_app.gait.view import Window, gait, phases
from pgraph_app.model.update import OpenText, Undo
from pgraph_app.playback.update import Scrub
from pgraph_app.run import view
from pgraph_app.run.live import Motion, Seam
from pgraph_app.run.update import (
    Advanced,
    GoLive,
    SetScenario,
    Simulate,
    Simulated,
    StopLive,
    Stuck,
    joined,
)
from pgraph_app.run.worker import simulated
from pgraph_app.scene import marks
from pgraph_app.scene.update import Show
from pgraph_app.session.update import Connected
from pgraph_core.result import records
from pgraph_core.show.shapes import to_matrix
from pgraph_core.show.stage import solid

ME = 1
PART = 0.0167  # [s]


@cache
def ready(name: str = "quadruped_hips") -> Any:
    model = pg.Model.load(pgraph_models.path(name))
    return after(replace(initial(model), kernels=Kernels(ready=True)), Connected(ME))


def after(state: State, *happened: Event) -> Any:
    for event in happened:
        state = update(state, event)
    return state


def walked(state: State, motion: Motion, seconds: float) -> Any:
    """A live run further by parts, as its thread does it."""
    for _ in range(round(seconds / PART)):
        assert state.live is not None
        part = motion.advanced(state.model, state.live, PART, None, state.walking)
        state = after(state, Advanced(state.live.id, part, 1.0))
        if (over := motion.over(part)) is not None:
            assert state.live is not None
            state = after(state, Stuck(state.live.id, over))
            return update(state, joined(state))
    return state


@cache
def trotted() -> Any:
    """A second of the trot, a change of speed, a second more; over."""
    state = walked(after(ready(), Walk(ME)), motion := Motion(), 1.0)
    state = walked(after(state, SetWalk(ME, 1, "speed", "0.9")), motion, 1.0)
    state = after(state, StopLive(ME))
    return update(state, joined(state))


def test_walk_goes_live_with_the_scenario_of_the_gait():
    state = after(ready(), SetGait(ME, 1, "crawl"), Walk(ME))
    assert state.live is not None
    assert (state.live.request.scenario, state.live.request.method) == ("crawl", "auto")
    assert state.shown >= SHOWN
    assert state.clients[ME].follow
    assert after(state, Show(ME, "follow", False)).clients[ME].follow is False


def test_live_of_a_scenario_with_a_gait_walks_by_it():
    state = after(ready(), SetScenario(ME, 1, "crawl"), GoLive(ME))
    assert state.live is not None
    assert gait(state)["gait"] == "crawl"


def test_simulate_walks_as_fast_as_is_set():
    plain = after(ready(), SetScenario(ME, 1, "trot"), Simulate(ME))
    assert plain.job is not None
    assert plain.job.gait is None
    chosen = after(ready(), SetScenario(ME, 1, "trot"), SetGait(ME, 2, "trot"))
    faster = after(chosen, SetWalk(ME, 3, "speed", "0.9"), Simulate(ME))
    assert faster.job is not None
    assert faster.job.gait is not None
    assert faster.job.gait.speed == 0.9
    other = after(chosen, SetWalk(ME, 3, "speed", "0.9"), SetScenario(ME, 4, "crawl"), Simulate(ME))
    assert other.job is not None
    assert other.job.gait is None  # what is set is of the trot


def test_parts_of_a_walk_make_one_walk():
    run = trotted().last_run.result
    assert run.status.ok
    assert not run.notices  # of a fall
    assert np.all(np.diff(run.t) > 0)
    way = run.q[-1, 0] - run.q[np.searchsorted(run.t, 1.5), 0]
    assert way / (run.t[-1] - run.t[np.searchsorted(run.t, 1.5)]) > 0.65  # it became faster
    foot = "left_hind_foot"
    down = run.phases[foot] == "stance"
    load = run.contact_normal[foot]
    assert np.mean(load[down][1:] > 0) > 0.9
    assert np.all(load[run.phases[foot] == "swing"] < 1.0)


def test_no_foot_changes_because_a_part_begins():
    run = trotted().last_run.result
    for foot in ("left_front_foot", "right_hind_foot"):
        lifts = [e.t for e in run.events if e.contact == foot and e.after == "swing"]
        assert np.all(np.diff(lifts) > 0.3)  # one a stride of 0.38 s
        chain = [(e.before, e.after) for e in run.events if e.contact == foot]
        assert all(a[1] == b[0] for a, b in pairwise(chain))


def test_what_the_page_shows_is_what_the_csv_says():
    state = trotted()
    head, *rows = csv.reader(io.StringIO(view.table(state.last_run).decode()))
    table = {name: [row[k] for row in rows] for k, name in enumerate(head)}
    shown = phases(state.falls, state)
    for number, foot in enumerate(shown["feet"]):
        own = [(t, code) for k, t, code in shown["changes"] if k == number]
        counted = sum(e.contact == foot for e in state.last_run.result.events)
        assert len(own) == counted + 1
        for t, phase in zip(map(float, table["t [s]"]), table[f"phases.{foot}"]):
            now = [code for at, code in own if at <= t + 1e-9]
            assert shown["phases"][now[-1]] == phase


def test_a_run_that_is_stopped_keeps_what_its_feet_did():
    """It is known by then; to find it again took seconds after ten minutes, and Stop as long."""
    run = trotted().last_run
    assert run.walked is not None
    assert run.falls == run.walked == changes(run.result)


def test_the_arrows_are_the_forces_of_the_csv():
    state = trotted()
    head, *rows = csv.reader(io.StringIO(view.table(state.last_run).decode()))
    k = len(rows) // 2
    state = after(state, Scrub(ME, float(rows[k][0])))
    positions, wxyz = poses(state)
    arrows = marks.pushes(state, positions, to_matrix(wxyz))
    names = list(state.last_run.result.contact_force)
    for name, push in zip(names, arrows):
        said = [float(rows[k][head.index(f"contact_force.{name}.{axis} [N]")]) for axis in "xyz"]
        assert push.force.tolist() == pytest.approx(said)


def test_footprints_lie_on_the_ground_where_feet_came_down():
    state = trotted()
    at = prints(state.falls, state.t_end, 100)
    assert len(at) > 12
    assert np.abs(at[:, 1]).max() < 2e-3
    assert at[-1, 0] > at[0, 0]
    assert len(prints(state.falls, 0.0, 100)) == 2  # the diagonal that does not swing


def test_a_long_record_is_sent_from_where_it_is_shown():
    found = [Change("a", t, k % 2) for k, t in enumerate((0.0, 1.0, 2.0, 3.0))]
    assert [change.t for change in since(found, 1.5)] == [1.0, 2.0, 3.0]


def test_a_fall_is_said_and_the_run_kept():
    state, motion = after(ready(), Walk(ME)), Motion()
    state = walked(state, motion, 0.4)
    for _ in range(12):
        state = walked(after(state, Push(ME, "left")), motion, 2 * PART)
    state = walked(state, motion, 3.0)
    assert state.live is None
    assert state.run_problem.startswith("It fell at t = ")
    assert state.run_problem.endswith("; the run is kept.")
    assert state.last_run.result.t[-1] > 0.5
    assert len([x for x in state.last_run.result.notices if "fell" in x]) == 1


def test_a_speed_out_of_reach_is_refused_with_what_the_legs_can():
    state = after(ready(), SetWalk(ME, 7, "speed", "9"))
    assert state.walking.changes == {}
    assert state.clients[ME].reply.serial == 7
    assert state.clients[ME].reply.text.startswith(
        "gait 'trot', speed: 9 m/s is more than 'left_front_foot' can follow, 3.31 m/s"
    )
    typed = after(state, SetWalk(ME, 8, "speed", "fast")).clients[ME].reply.text
    assert typed.startswith("The speed ")


def test_only_models_with_feet_have_a_gait_tab_and_without_a_gait_it_says_what_to_give():
    walker = ready().model
    bare = walker.replace(scenarios=())
    three = bare.replace(contacts=bare.contacts[:3])
    assert [has_feet(m) for m in (walker, bare, three, pg.Model.serial(2))] == [
        True,
        True,
        False,
        False,
    ]
    assert gait(initial(bare))["why"] == (
        "No scenario of 'quadruped_hips' has a gait: give one a 'gait' (docs/gaits.md)."
    )


def test_a_gait_that_is_untried_on_the_model_is_said_so():
    state = after(ready("quadruped"), SetGait(ME, 1, "trot"))
    assert (gait(state)["walks"], "untried on 'quadruped'" in gait(state)["why"]) == (True, True)
    assert gait(after(ready(), SetGait(ME, 1, "trot")))["why"] == ""


def test_hinges_all_about_z_do_not_turn():
    assert gait(ready("quadruped"))["gait"] == "bound"
    assert not gait(ready("quadruped"))["turns"]
    assert gait(ready())["turns"]


def test_the_ground_is_the_model_s_and_each_change_one_undo_step():
    state = after(ready(), SetGround(ME, 1, "slope", "5"))
    state = after(state, SetGround(ME, 2, "friction", "0.4"))
    state = after(state, SetGround(ME, 3, "steps", "0.05"))
    state = after(state, SetGround(ME, 4, "law", "penalty"))
    assert len(state.undo) == len(ready().undo) + 4
    shown = gait(state)
    assert (shown["slope"], shown["friction"], shown["steps"]) == (5.0, 0.4, 0.05)
    assert after(state, Walk(ME)).live.request.method == "rk4"
    walking = after(state, Walk(ME), SetGround(ME, 5, "slope", "0"))
    assert walking.clients[ME].reply.text == (
        "The slope is set before a walk: stop this one first."
    )


def test_changes_of_a_part_add_to_what_is_known():
    run = trotted().last_run.result
    whole = changes(run)
    assert {change.foot for change in whole} == set(run.phases)
    assert len(changes(run, whole)) == len(whole) - len(run.phases)


def test_steps_are_drawn_on_the_plane_of_the_ground_and_as_high_as_they_are():
    state = after(ready(), SetGround(ME, 1, "slope", "8"))
    state = after(state, SetGround(ME, 2, "steps", "0.05"))
    corners = solid(state.model, state.model.ground.steps[0])
    off = corners @ np.asarray(state.model.ground_normal)
    np.testing.assert_allclose(off, [0.0] * 4 + [0.05] * 4, atol=1e-12)


def test_parts_that_begin_with_a_graze_are_sewn_without_it():
    run = pg.simulate(mechanism(), scenario="trot", t_end=0.1, estimate=False)
    foot = "left_hind_foot"
    stands = np.full(len(run.t), "stance")
    first = replace(run, contacts=replace(run.contacts, phases={foot: stands}, events=()))
    late = 0.1 + run.t
    graze = np.where(late < 0.102, "swing", "stance")
    came = records.Event(0.102, foot, "left_hind_paw", "swing", "stance", "it touched down")
    second = replace(
        first, t=late, contacts=replace(first.contacts, phases={foot: graze}, events=(came,))
    )
    seam = Seam()
    seam.sewn(first)
    sewn = seam.sewn(second)
    assert sewn.events == ()
    assert set(sewn.phases[foot]) == {"stance"}
    np.testing.assert_array_equal(sewn.contact_force[foot][0], run.contact_force[foot][-1])


@cache
def mechanism() -> pg.Mechanism:
    return pg.Mechanism(ready().model)


def asked_speed(motion: Motion) -> float:
    """What the controller is asked for now [m/s]."""
    assert motion._walker is not None
    s, t = motion._walker._walk.controller.settings[0], motion.time
    most = s["speed_rate"] * max(t - s["speed_time"], 0.0)
    return s["speed_from"] + float(np.clip(s["speed_to"] - s["speed_from"], -most, most))


def test_the_speed_asked_for_follows_every_edit_as_fast_as_the_gait_allows():
    """Whatever sets it: the slider, another gait, the scenario's gait itself, undo."""
    state, motion = after(ready(), Walk(ME)), Motion()
    model, name = state.model, state.live.request.scenario

    def other(speed: float) -> str:
        scenarios = tuple(
            s.model_copy(update={"gait": s.gait.edit(speed=speed)}) if s.name == name else s
            for s in model.scenarios
        )
        return model.replace(scenarios=scenarios).to_json()

    edits = (
        SetWalk(ME, 1, "speed", "0.9"), SetGait(ME, 1, "crawl"),
        SetGait(ME, 1, "trot"), OpenText(ME, "slow", other(0.1)),
        OpenText(ME, "fast", other(1.1)), Undo(ME),
    )  # fmt: skip
    asked = []
    for edit in edits:
        for _ in range(3):
            state = walked(state, motion, PART)
            asked.append(asked_speed(motion))
        state = after(state, edit)
    fastest = max(s.gait.acceleration for s in model.scenarios if s.gait is not None)
    assert np.abs(np.diff(asked)).max() <= fastest * 1.01 * PART
    assert np.ptp(asked) > 0.05


def test_the_window_of_a_run_that_grows_is_that_of_all_its_changes():
    """It goes through each change once, whatever is dropped at the beginning."""
    rng = np.random.default_rng(4)
    times = np.sort(rng.uniform(0, 100, 400))
    every = tuple(Change(f"foot {rng.integers(4)}", t, int(rng.integers(4))) for t in times)
    window = Window()
    for n, dropped in ((50, 0), (50, 0), (200, 0), (330, 0), (330, 120), (400, 120)):
        falls = every[dropped:n]
        start = falls[-1].t - 30
        found, plain = window.of(falls, start), since(falls, start)
        assert sorted(found) == sorted(plain)
        assert window.of((), 0.0) == []


def test_the_first_run_of_what_walks_off_is_followed_by_the_camera():
    model = ready().model.replace(scenarios=tuple(
        s.model_copy(update={"t_end": 3.0}) for s in ready().model.scenarios if s.name == "trot"
    ))  # fmt: skip
    state = after(ready(), OpenText(ME, "trot", model.to_json()), Simulate(ME))
    result = simulated(state.job, lambda _: True)
    state = after(state, Simulated(state.job.id, result))
    assert state.clients[ME].follow
    again = after(state, Show(ME, "follow", False), Simulate(ME))
    again = after(again, Simulated(again.job.id, result))
    assert not again.clients[ME].follow  # a person's own choice stays
    stays = after(ready(), OpenText(ME, "trot", model.to_json()), Simulate(ME))
    short = pg.simulate(pg.Mechanism(model), t_end=0.05)
    assert not after(stays, Simulated(stays.job.id, short)).clients[ME].follow
