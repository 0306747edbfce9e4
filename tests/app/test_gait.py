"""Walks on the page: events, live parts, reports and payloads."""

import csv
import io
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.export import view
from pgraph_app.features import initial
from pgraph_app.gait import SHOWN, has_feet
from pgraph_app.gait.live import Motion
from pgraph_app.gait.view import gait, phases
from pgraph_app.pose import poses
from pgraph_app.run import Run, joined
from pgraph_app.run.footfalls import changes, prints
from pgraph_app.run.view import differences, keeps
from pgraph_app.scene import marks
from pgraph_core.result.records import PHASES
from pgraph_core.show.shapes import to_matrix
from pgraph_core.show.stage import solid

from .store import ME, after, begun, built_in, do, reply

PART = 0.0167  # [s]


def ready(name="quadruped_hips"):
    return begun(built_in(name))


def walked(state, motion, seconds):
    for _ in range(round(seconds / PART)):
        part = motion.advanced(state.model, state.live, PART, None, state.walking)
        state = after(state, do.Advanced(state.live.id, part, 1.0))
        if (over := motion.over(part)) is not None:
            state = after(state, do.Stuck(state.live.id, over))
            return after(state, joined(state))
    return state


@pytest.fixture(scope="module")
def trotted():
    """Return a second of the trot, a change of speed, and another second."""
    state = walked(after(ready(), do.Walk(ME)), motion := Motion(), 1.0)
    state = walked(after(state, do.SetWalk(ME, 1, "speed", "0.9")), motion, 1.0)
    state = after(state, do.StopLive(ME))
    return after(state, joined(state))


def test_walk_goes_live_with_the_scenario_of_the_gait():
    state = after(ready(), do.SetGait(ME, 1, "crawl"), do.Walk(ME))
    assert (state.live.request.scenario, state.live.request.method) == ("crawl", "auto")
    assert state.shown >= SHOWN
    assert state.clients[ME].follow
    assert after(state, do.Show(ME, "follow", False)).clients[ME].follow is False
    chosen = after(ready(), do.SetScenario(ME, 1, "crawl"), do.GoLive(ME))
    assert gait(chosen)["gait"] == "crawl"


def test_simulate_walks_as_fast_as_is_set():
    plain = after(ready(), do.SetScenario(ME, 1, "trot"), do.Simulate(ME))
    assert plain.job.gait is None
    chosen = after(ready(), do.SetScenario(ME, 1, "trot"), do.SetGait(ME, 2, "trot"))
    faster = after(chosen, do.SetWalk(ME, 3, "speed", "0.9"))
    job = after(faster, do.Simulate(ME)).job
    assert job.model.scenario("trot").gait.speed == 0.9
    assert job.gait is None
    assert faster.model.scenario("crawl") == chosen.model.scenario("crawl")
    gallop = after(faster, do.SetGait(ME, 5, "bound"), do.Simulate(ME)).job.gait
    assert gallop.name == "bound"


def test_a_speed_is_of_the_model_its_file_and_one_undo_step():
    state = after(ready(), do.SetScenario(ME, 1, "trot"))
    slid = after(state, *(do.SetWalk(ME, k, "speed", f"0.{k}") for k in range(4, 9)))
    again = pg.Model.from_json(slid.model.to_json())
    assert again.scenario("trot").gait.speed == gait(slid)["speed"] == 0.8
    assert after(slid, do.Undo(ME)).model == state.model
    assert gait(after(slid, do.Undo(ME)))["speed"] == 0.6


def test_runs_that_are_compared_tell_their_speeds():
    state = after(ready(), do.SetScenario(ME, 1, "trot"))
    faster = after(state, do.SetWalk(ME, 2, "speed", "0.9"))
    untried = after(state, do.SetGait(ME, 3, "bound"), do.SetWalk(ME, 4, "speed", "0.7"))
    runs = [Run(s.model, s.request, None, gait=s.set_gait) for s in (state, faster, untried)]
    found = {name: values for name, *values in differences(runs)}
    assert found["gait"] == ["trot", "trot", "bound"]
    assert found["gait: speed"] == ["0.6", "0.9", "0.7"]


def test_a_gait_that_was_not_tried_is_kept_by_its_scenario():
    state = after(ready(), do.SetScenario(ME, 1, "trot"), do.SetGait(ME, 2, "bound"))
    assert keeps(state)
    kept = after(state, do.KeepSettings(ME))
    assert kept.model.scenario("trot").gait.name == "bound"
    assert not keeps(kept)
    assert not kept.outdated


def test_a_run_of_another_speed_is_not_played_as_that_of_this_one():
    state = after(ready(), do.SetScenario(ME, 1, "trot"))
    for gait_name, speed in (("trot", "0.9"), ("bound", "0.7")):
        chosen = after(state, do.SetGait(ME, 1, gait_name))
        ended = Run(chosen.model, chosen.request, None, gait=chosen.set_gait)
        ended = replace(chosen, last_run=ended, run_framed=chosen.framed)
        assert not ended.outdated
        faster = after(ended, do.SetWalk(ME, 2, "speed", speed))
        assert faster.outdated
        again = Run(faster.model, faster.request, None, gait=faster.set_gait)
        assert not replace(faster, last_run=again).outdated


def test_parts_of_a_walk_make_one_walk(trotted):
    run = trotted.last_run.result
    assert run.status.ok
    assert not run.notices  # of a fall
    assert np.all(np.diff(run.t) > 0)
    way = run.q[-1, 0] - run.q[np.searchsorted(run.t, 1.5), 0]
    assert way / (run.t[-1] - run.t[np.searchsorted(run.t, 1.5)]) > 0.65  # it became faster
    for foot in ("left_front_foot", "right_hind_foot"):  # none changes because a part begins
        lifts = [e.t for e in run.events if e.contact == foot and e.after == "swing"]
        assert np.all(np.diff(lifts) > 0.3)  # one per stride of 0.38 s
        chain = [(e.before, e.after) for e in run.events if e.contact == foot]
        assert all(a[1] == b[0] for a, b in pairwise(chain))
    whole = changes(run)  # known when it is over
    assert trotted.last_run.falls == trotted.last_run.walked == whole
    assert {change.foot for change in whole} == set(run.phases)
    assert len(changes(run, whole)) == len(whole) - len(run.phases)  # a part adds to what is known


def test_phases_and_arrows_are_those_of_the_csv(trotted):
    head, *rows = csv.reader(io.StringIO(view.table(trotted.last_run).decode()))
    table = {name: [row[k] for row in rows] for k, name in enumerate(head)}
    shown = phases(trotted.falls, trotted)
    for number, foot in enumerate(shown["feet"]):
        own = [(t, code) for k, t, code in shown["changes"] if k == number]
        column = table[f"phases.{foot}"]
        assert len(own) == 1 + sum(a != b for a, b in pairwise(column))
        for t, phase in zip(map(float, table["t [s]"]), column):
            now = [code for at, code in own if at <= t + 1e-9]
            assert PHASES[now[-1]] == phase
    k = len(rows) // 2
    state = after(trotted, do.Scrub(ME, float(rows[k][0])))
    positions, wxyz = poses(state)
    arrows = marks.pushes(state, positions, to_matrix(wxyz))
    for name, push in zip(state.last_run.result.contact_force, arrows):
        force = [float(table[f"contact_force.{name}.{axis} [N]"][k]) for axis in "xyz"]
        assert push.force.tolist() == pytest.approx(force)


def test_footprints_lie_on_the_ground_where_feet_came_down(trotted):
    at = prints(trotted.falls, trotted.t_end, 100)
    assert len(at) > 12
    assert np.abs(at[:, 1]).max() < 2e-3
    assert at[-1, 0] > at[0, 0]
    assert len(prints(trotted.falls, 0.0, 100)) == 2  # the diagonal that does not swing


def test_a_fall_ends_the_run_and_keeps_it():
    state, motion = after(ready(), do.Walk(ME)), Motion()
    state = walked(state, motion, 0.4)
    for _ in range(12):
        state = walked(after(state, do.Push(ME, "left")), motion, 2 * PART)
    state = walked(state, motion, 3.0)
    assert state.live is None
    assert "t = " in state.run_problem
    assert state.last_run.result.t[-1] > 0.5
    assert len([x for x in state.last_run.result.notices if "fell" in x]) == 1


@pytest.mark.parametrize(
    ("text", "words"), [("9", "speed 'trot' 9 3.53"), ("fast", "speed 'fast'")]
)
def test_a_speed_out_of_reach_is_refused(text, words):
    state = after(ready(), do.SetWalk(ME, 7, "speed", text))
    assert (state.walking.changes, state.clients[ME].reply.serial) == ({}, 7)
    assert [word for word in words.split() if word not in reply(state)] == []


def test_a_model_with_feet_has_a_gait_tab_which_reports_what_is_missing():
    walker, plain = ready().model, ready("quadruped")
    bare = walker.replace(scenarios=())
    three = bare.replace(contacts=bare.contacts[:3])
    found = [has_feet(m) for m in (walker, bare, three, pg.Model.serial(2))]
    assert found == [True, True, False, False]
    assert "'quadruped_hips'" in gait(initial(bare))["why"]
    untried = gait(after(plain, do.SetGait(ME, 1, "trot")))
    assert (untried["walks"], "not tried" in untried["why"]) == (True, True)
    assert gait(after(ready(), do.SetGait(ME, 1, "trot")))["why"] == ""
    assert (gait(plain)["gait"], gait(plain)["turns"]) == ("bound", False)  # hinges all about z
    assert gait(ready())["turns"]


def test_the_ground_is_the_model_s_and_each_change_one_undo_step():
    state = ready()
    for field, text in (("slope", "5"), ("friction", "0.4"), ("steps", "0.05"), ("law", "penalty")):
        state = after(state, do.SetGround(ME, 1, field, text))
    assert len(state.undo) == 4
    shown = gait(state)
    assert (shown["slope"], shown["friction"], shown["steps"]) == (5.0, 0.4, 0.05)
    assert after(state, do.Walk(ME)).live.request.method == "rk4"
    walking = after(state, do.Walk(ME), do.SetGround(ME, 5, "slope", "0"))
    assert "slope" in reply(walking)  # it is set before a walk
    assert gait(walking)["slope"] == 5.0


def test_steps_are_drawn_on_the_plane_of_the_ground_and_as_high_as_they_are():
    state = after(ready(), do.SetGround(ME, 1, "slope", "8"))
    state = after(state, do.SetGround(ME, 2, "steps", "0.05"))
    corners = solid(state.model, state.model.ground.steps[0])
    off = corners @ np.asarray(state.model.ground_normal)
    np.testing.assert_allclose(off, [0.0] * 4 + [0.05] * 4, atol=1e-12)


def test_the_speed_asked_for_follows_every_edit_as_fast_as_the_gait_allows():
    """Whatever sets it: the slider, another gait, the scenario's gait itself, undo."""
    state, motion = after(ready(), do.Walk(ME)), Motion()
    model, name = state.model, state.live.request.scenario

    def asked_now():
        s = motion._walker._walk.controller.settings[0]
        most = s["speed_rate"] * max(motion.time - s["speed_time"], 0.0)
        return s["speed_from"] + float(np.clip(s["speed_to"] - s["speed_from"], -most, most))

    slow = model.scenario(name).gait.edit(speed=0.1)
    other = [s.model_copy(update={"gait": slow}) if s.name == name else s for s in model.scenarios]
    edits = (
        do.SetWalk(ME, 1, "speed", "0.9"), do.SetGait(ME, 1, "crawl"), do.SetGait(ME, 1, "trot"),
        do.OpenText(ME, "slow", model.replace(scenarios=other).to_json()), do.Undo(ME),
    )  # fmt: skip
    asked = []
    for edit in edits:
        for _ in range(3):
            state = walked(state, motion, PART)
            asked.append(asked_now())
        state = after(state, edit)
    fastest = max(s.gait.acceleration for s in model.scenarios if s.gait is not None)
    assert np.abs(np.diff(asked)).max() <= fastest * 1.01 * PART
    assert np.ptp(asked) > 0.05
