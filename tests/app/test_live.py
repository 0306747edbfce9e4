"""Live runs: what the events do to them, and the thread that computes them (interface 1.7)."""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.core.events import Event
from pgraph_app.core.state import Kernels, State, initial, poses
from pgraph_app.core.store import Store
from pgraph_app.features import update
from pgraph_app.gait.update import Push
from pgraph_app.model.update import Edit, OpenText, Undo
from pgraph_app.playback.update import Play, Scrub, StepFrames
from pgraph_app.pose.update import Pull, UsePose
from pgraph_app.run.live import (
    CALM,
    NEVER,
    USUAL,
    Clock,
    LiveRunner,
    Motion,
    Share,
    only_young_garbage,
)
from pgraph_app.run.update import (
    Advanced,
    Compare,
    Continue,
    GoLive,
    SetRun,
    Simulate,
    Simulated,
    StopLive,
    Stuck,
    joined,
)
from pgraph_app.run.view import measures, run
from pgraph_app.session.update import Connected
from pgraph_app.table.update import AddBody

from .conftest import until

ME = 1
STEP = 0.01  # [s]


def after(state: State, *happened: Event) -> State:
    for event in happened:
        state = update(state, event)
    return state


@pytest.fixture
def live() -> State:
    """A live run of two rods, begun."""
    state = replace(initial(pg.Model.serial(2)), kernels=Kernels(ready=True))
    return after(state, Connected(ME), GoLive(ME))


def parts(state: State, n: int) -> list[pg.Result]:
    """The next parts of the live run of a state."""
    motion, found = Motion(), []
    for _ in range(n):
        assert state.live is not None
        found.append(motion.advanced(state.model, state.live, STEP))
    return found


def grown(state: State, found: list[pg.Result]) -> State:
    assert state.live is not None
    return after(state, *(Advanced(state.live.id, part, 1.0) for part in found))


def stopped(state: State, *meanwhile: Event) -> State:
    """A live run stopped, what happens while its parts are joined, and then joined."""
    over = after(state, StopLive(ME))
    return after(over, *meanwhile, joined(over))


def test_a_live_run_shows_its_newest_time(live):
    state = grown(live, parts(live, 3))
    assert state.playback.time == pytest.approx(3 * STEP)
    assert (state.t_start, state.t_end) == pytest.approx((0.0, 3 * STEP))
    whole = pg.simulate(pg.Mechanism(live.model), t_end=3 * STEP, method="rk4", step=1e-3)
    np.testing.assert_allclose(poses(state)[0], whole.body_pose[-1, :, :3], atol=1e-12)


def test_looking_back_pauses_it_and_play_goes_on(live):
    state = grown(live, parts(live, 4))
    back = after(state, Scrub(ME, STEP))
    assert not back.live.running
    assert back.playback.time == pytest.approx(STEP)
    assert after(back, StepFrames(ME, 1)).playback.time == pytest.approx(2 * STEP)
    on = after(back, Play(ME))
    assert on.live.running
    assert on.playback.time == pytest.approx(4 * STEP)


def test_stopped_it_is_a_run_like_any_other(live):
    state = stopped(grown(live, parts(live, 5)))
    assert state.live is None
    assert state.run.result.t[-1] == pytest.approx(5 * STEP)
    assert np.all(np.diff(state.run.result.t) > 0)
    assert state.playback.time == state.t_end  # what is seen stays what it was
    again = after(state, Play(ME)).playback
    assert (again.playing, again.time) == (True, 0.0)


def test_an_edit_goes_on_from_where_it_is(live):
    first = parts(live, 2)
    state = after(grown(live, first), Edit(ME, 1, "2", "mass", (), "3"))
    assert len(state.live.parts) == 2
    motion = Motion()
    motion.advanced(live.model, live.live, STEP)
    part = motion.advanced(state.model, state.live, STEP)
    assert part.mechanism.model is state.model
    assert part.t[0] == pytest.approx(STEP)
    np.testing.assert_array_equal(part.q[0], first[0].q[-1])


def test_another_tree_keeps_the_joints_it_has_and_starts_a_record(live):
    state = after(grown(live, parts(live, 2)), AddBody(ME, "2"))
    assert state.live.parts == ()
    assert grown(state, parts(live, 1)).live.parts == ()  # of the old tree: too late
    motion = Motion()
    old = motion.advanced(live.model, live.live, STEP)
    part = motion.advanced(state.model, state.live, STEP)
    np.testing.assert_array_equal(part.q[0, :2], old.q[-1])


def test_while_it_is_live_nothing_else_is_simulated(live):
    assert after(live, Simulate(ME)).job is None
    assert after(live, GoLive(ME)).live is live.live


def test_what_stops_it_is_said_and_what_was_computed_is_kept(live):
    state = grown(live, parts(live, 2))
    state = after(state, Stuck(state.live.id, "The live run stopped: no."))
    assert state.run_problem == "The live run stopped: no."
    assert update(state, joined(state)).last_run is not None


def test_a_live_run_says_how_it_ended_and_not_that_it_reached_its_end(live):
    state = grown(live, parts(live, 2))
    fallen = Stuck(state.live.id, "It fell at t = 27 s; the run is kept.", 27.0)
    for event, how in ((StopLive(ME), "stopped by hand"), (fallen, "it fell at t = 27 s")):
        over = after(state, event)
        over = update(over, joined(over))
        assert dict(line[:2] for line in run(over)["summary"])["Status"] == how
        assert measures(over.last_run)["ended"] == how


def test_a_live_run_collects_young_garbage_alone():
    with only_young_garbage():
        assert gc.get_threshold() == (*USUAL[:2], NEVER)
    assert gc.get_threshold() == USUAL


def test_stop_acts_before_the_parts_are_joined(live):
    """What was computed stays in view and plays; another run may be asked for at once."""
    state = grown(live, found := parts(live, 4))
    over = after(state, StopLive(ME))
    assert over.going is None
    assert over.run.result is found[-1]
    assert update(over, Advanced(over.live.id, parts(state, 1)[0], 1.0)) is over
    assert after(over, Play(ME)).playback.playing
    assert after(over, StepFrames(ME, -1)).playback.time < over.playback.time
    assert run(over)["live"]["text"].startswith("stopped at 0.0 s")
    again = stopped(state, GoLive(ME))
    assert again.going is not None
    assert again.going.id != over.live.id
    assert after(over, Simulate(ME)).job is not None
    assert stopped(state, Simulate(ME)).last_run is not None
    newer = pg.simulate(pg.Mechanism(state.model), t_end=0.2)
    shown = stopped(state, Simulate(ME), Simulated(over.jobs + 1, newer))
    assert shown.last_run.result is newer  # what came first is not shown over it


def test_an_edit_right_after_stop_leaves_the_run_of_the_model_before_it(live):
    state = grown(live, parts(live, 3))
    named = stopped(state, Edit(ME, 1, "2", "name", (), "tip"))
    assert named.run.result.mechanism.names[1] == "tip"
    heavier = stopped(state, Edit(ME, 1, "2", "mass", (), "3"))
    assert heavier.run is None
    assert heavier.earlier.model is state.model
    longer = stopped(state, AddBody(ME, "2"))
    assert longer.earlier.model is state.model
    other = stopped(state, OpenText(ME, "other", pg.Model.serial(3).to_json()))
    assert (other.run, other.earlier) == (None, None)


def test_a_run_whose_parts_do_not_join_says_so(live):
    first, _, third = parts(live, 3)
    over, told = after(grown(live, [first, third]), StopLive(ME)), list[Event]()
    runner = LiveRunner(told.append)
    runner.render(over, over)
    until(lambda: told, "the runner's word")
    state = update(over, told[0])
    assert state.live is None
    assert "a run from 0.02 s after one to 0.01 s" in state.run_problem


def test_parts_of_a_run_that_is_over_are_dropped(live):
    found = parts(live, 1)
    over = after(live, StopLive(ME))
    assert update(over, Advanced(live.live.id, found[0], 1.0)) is over


def test_the_thread_keeps_the_clock_follows_edits_and_ends(live):
    state, count, one_at_a_time = live, 0, threading.RLock()

    def send(event: Any) -> None:  # from this thread and the runner's, as a store takes them
        nonlocal state, count
        with one_at_a_time:
            state, count = update(state, event), count + 1
            runner.render(state, state)

    def wait(until: Callable[[], bool]) -> None:
        end = time.monotonic() + 60
        while not until():
            assert time.monotonic() < end
            time.sleep(0.01)

    def mass() -> float:
        return state.run.result.mechanism.model.body("1").mass if state.run else 0.0

    runner = LiveRunner(send)
    runner.render(state, state)
    try:
        wait(lambda: state.t_end >= 0.1 and count >= 3)
        send(Edit(ME, 2, "1", "mass", (), "7"))
        wait(lambda: mass() == 7)
    finally:
        send(StopLive(ME))
    wait(lambda: state.live is None)
    assert isinstance(state.run.result, pg.Result)
    wait(lambda: not any(thread.name == "pgraph-live" for thread in threading.enumerate()))


def test_parts_are_longer_where_the_processor_is_taken_away(monkeypatch):
    wall, used, share = [0.0], [0.0], Share()
    monkeypatch.setattr(time, "perf_counter", lambda: wall[0])
    monkeypatch.setattr(time, "thread_time", lambda: used[0])

    def part(of: float) -> float:
        with share:
            wall[0] += 0.01
            used[0] += 0.01 * of
        return share.least

    assert not any(part(1.0) for _ in range(10))
    assert [part(0.1) for _ in range(20)][-1] == CALM
    assert [part(1.0) for _ in range(20)][-1] == 0.0
    assert part(0.1) == 0.0  # one alone says nothing


def test_a_clock_that_is_far_behind_waits(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    clock = Clock()
    assert clock.due(0.0, 1.0) == 0.0
    now[0] = 0.1
    assert clock.due(0.05, 1.0) == pytest.approx(0.05)
    now[0] = 1.1
    assert clock.due(0.11, 1.0) > 0.9
    assert clock.pace == pytest.approx(0.1)
    assert clock.due(0.11, 1.0) == pytest.approx(0.0)


# -- continue, compare, use the pose ---------------------------------------------------------------


@pytest.fixture
def ran() -> State:
    state = replace(initial(pg.Model.serial(2)), kernels=Kernels(ready=True))
    state = after(state, Connected(ME), Simulate(ME))
    return after(state, Simulated(1, pg.simulate(pg.Mechanism(state.model), t_end=0.2)))


def test_continue_asks_for_a_run_from_the_end(ran):
    state = after(ran, Continue(ME))
    assert state.job.before is ran.run.result
    from pgraph_app.run.worker import simulated

    whole = simulated(
        replace(state.job, request=replace(state.job.request, t_end=0.2)), lambda _: 1
    )
    assert (whole.t[0], whole.t[-1]) == pytest.approx((0.0, 0.4))
    done = after(state, Simulated(state.job.id, whole))
    assert done.playback.time == pytest.approx(0.2)


def test_a_run_that_ends_before_its_first_frame_says_why_and_leaves_what_is_shown(ran):
    plain = ran.run.result
    empty = replace(
        plain,
        t=plain.t[:0],
        status=pg.Status.NOT_FINITE,
        message="the motion stopped being finite at t = 0 s",
    )
    state = after(ran, Simulate(ME))
    done = after(state, Simulated(state.job.id, empty))
    assert done.job is None
    assert done.run is ran.run
    assert "stopped being finite at t = 0 s" in done.run_problem
    assert (done.t_start, done.t_end) == (ran.t_start, ran.t_end)


def test_the_pose_shown_becomes_the_initial_state_in_one_step(ran):
    state = after(ran, Scrub(ME, 0.2), UsePose(ME))
    q, v = pg.Mechanism(state.model).home()
    np.testing.assert_array_equal(q, ran.run.result.q[-1])
    np.testing.assert_array_equal(v, ran.run.result.v[-1])
    assert len(state.undo) == len(ran.undo) + 1
    assert after(state, Undo(ME)).model is ran.model


def test_a_ghost_stays_over_edits_until_it_is_taken_away(ran):
    state = after(ran, Compare(ME), Edit(ME, 1, "1", "mass", (), "5"))
    assert state.ghost is ran.run
    assert after(state, Compare(ME)).ghost is None


def test_blank_steps_and_tolerances_are_the_method_s(ran):
    state = after(ran, SetRun(ME, 1, "step", " "), SetRun(ME, 2, "rtol", "1e-9"))
    assert (state.request.step, state.request.rtol) == (None, 1e-9)
    refused = after(state, SetRun(ME, 3, "rtol", "1"))
    assert refused.clients[ME].reply.text == (
        "The tolerance must lie between 1e-15 and 0.1; given 1."
    )


def test_the_mouse_pulls_a_body_towards_it(live):
    model = live.model.replace(gravity=(0.0, 0.0, 0.0))
    target = (0.0, 1.0, 0.5)
    pull = Pull(ME, "2", (0.0, 0.0, 0.0), target)
    free, pulled = Motion(), Motion()
    for _ in range(30):
        calm = free.advanced(model, live.live, STEP)
        drawn = pulled.advanced(model, live.live, STEP, pull)
    assert np.abs(calm.v).max() < 1e-12
    start = calm.body_pose[0, 1, :3]
    now = drawn.body_pose[-1, 1, :3]
    assert np.linalg.norm(now - target) < np.linalg.norm(start - target) - 0.01


# -- pictures and what people do -------------------------------------------------------------------


def test_pictures_wait_for_the_pages_and_the_newest_is_drawn(live):
    """A worker follows every part; a page that has not shown its last picture gets none."""
    store, drawn, taken = Store(live, update), list[float](), list[float]()

    class Watch:
        def __init__(self, times: list[float]):
            self.times = times

        def render(self, old: State, new: State) -> None:
            self.times.append(new.t_end)

    ready = threading.Event()
    store.ready = ready.is_set
    store.start([Watch(drawn)], [Watch(taken)])
    found = parts(live, 4)
    for part in found:
        store.send(Advanced(live.live.id, part, 1.0))
    until(lambda: len(taken) > 1 and taken[-1] == pytest.approx(4 * STEP), "all parts taken")
    assert drawn == [0.0]
    store.send(Push(ME, "left"))  # what people do is drawn at once, with the newest picture
    until(lambda: len(drawn) == 2, "the push drawn")
    assert drawn[-1] == pytest.approx(4 * STEP)
    store.send(Advanced(live.live.id, parts(grown(live, found), 1)[0], 1.0))
    ready.set()
    store.wake()
    store.stop()


def test_a_long_live_run_keeps_few_parts_and_loses_no_frame(live):
    """1100 parts, joined as it goes: its end joins a few, and the run is that of the parts."""
    state, motion, ends = live, Motion(), [0.0]
    for _ in range(1100):
        part = motion.advanced(state.model, state.live, 0.002)
        ends.append(float(part.t[-1]))
        state = update(state, Advanced(state.live.id, part, 1.0))
    assert len(state.live.parts) <= 1 + 2 * 31
    assert state.live.part_at(0.01).t[0] <= 0.01
    run = stopped(state).run.result
    assert set(np.round(ends, 9)) <= set(np.round(run.t, 9))
    assert np.all(np.diff(run.t) > 0)
