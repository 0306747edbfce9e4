"""Live runs: events, and the thread that computes them (interface 1.7)."""

import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.core.store import Store
from pgraph_app.gait.live import Clock, LiveRunner, Motion
from pgraph_app.pose import poses
from pgraph_app.run import TOGETHER, grown, joined
from pgraph_app.run.view import measures, run

from .store import ME, after, begun, do, ran, until

STEP = 0.01  # [s]


@pytest.fixture
def live():
    return after(begun(pg.Model.serial(2)), do.GoLive(ME))


def parts(state, n):
    motion = Motion()
    return [motion.advanced(state.model, state.live, STEP) for _ in range(n)]


def fed(state, found):
    return after(state, *(do.Advanced(state.live.id, part, 1.0) for part in found))


def stopped(state, *meanwhile):
    """Return the state after Stop, after what happens while its parts are joined, and the join."""
    over = after(state, do.StopLive(ME))
    return after(over, *meanwhile, joined(over))


def test_a_live_run_shows_its_newest_time(live):
    assert after(live, do.Simulate(ME)).job is None  # while it is live nothing else is simulated
    assert after(live, do.GoLive(ME)).live is live.live
    state = fed(live, parts(live, 3))
    assert state.playback.time == pytest.approx(3 * STEP)
    assert (state.t_start, state.t_end) == pytest.approx((0.0, 3 * STEP))
    whole = pg.simulate(pg.Mechanism(live.model), t_end=3 * STEP, method="rk4", step=1e-3)
    np.testing.assert_allclose(poses(state)[0], whole.body_pose[-1, :, :3], atol=1e-12)


def test_a_live_run_says_how_it_ended_and_keeps_what_was_computed(live):
    state = fed(live, parts(live, 2))
    fallen = do.Stuck(state.live.id, "It fell at t = 27 s; the run is kept.", 27.0)
    for event, how in ((do.StopLive(ME), "stopped"), (fallen, "fell at t = 27 s")):
        over = after(state, event)
        over = after(over, joined(over))
        assert over.last_run.result.t[-1] == pytest.approx(2 * STEP)
        assert how in dict(line[:2] for line in run(over)["summary"])["Status"]
        assert how in measures(over.last_run)["ended"].value
    assert after(state, fallen).run_problem == fallen.text


def test_looking_back_pauses_it_and_play_goes_on(live):
    state = fed(live, parts(live, 4))
    back = after(state, do.Scrub(ME, STEP))
    assert not back.live.running
    assert back.playback.time == pytest.approx(STEP)
    assert after(back, do.StepFrames(ME, 1)).playback.time == pytest.approx(2 * STEP)
    on = after(back, do.Play(ME))
    assert on.live.running
    assert on.playback.time == pytest.approx(4 * STEP)


def test_stopped_it_is_a_run_like_any_other(live):
    state = stopped(fed(live, parts(live, 5)))
    assert state.live is None
    assert state.run.result.t[-1] == pytest.approx(5 * STEP)
    assert np.all(np.diff(state.run.result.t) > 0)
    assert state.playback.time == state.t_end  # what is seen stays what it was
    again = after(state, do.Play(ME)).playback
    assert (again.playing, again.time) == (True, 0.0)


def test_play_computes_again_unless_the_last_run_is_of_these_settings(live):
    recorded = stopped(fed(live, parts(live, 3)))
    assert run(recorded)["outdated"]  # what Live recorded is not the run of the settings
    asked = after(recorded, do.Simulate(ME))
    computed = after(asked, do.Done(asked.job.id, recorded.run.result))
    assert not run(computed)["outdated"]
    for field, text in (("t_end", "0.5"), ("step", "0.002"), ("rtol", "1e-6"), ("method", "rk4")):
        other = after(computed, do.SetRun(ME, 1, field, text))
        assert run(other)["outdated"]
        assert other.run is computed.run  # still shown
        back = getattr(computed.request, field)
        back = after(other, do.SetRun(ME, 2, field, "" if back is None else str(back)))
        assert bool(run(back)["outdated"]) is (back.request != computed.request)
    edited = after(computed, do.EditBodies(ME, 1, ("2",), "mass", (((), "3"),)))
    assert run(edited)["outdated"]
    assert not run(after(edited, do.Undo(ME)))["outdated"]


def test_an_edit_goes_on_from_where_it_is(live):
    first = parts(live, 2)
    state = after(fed(live, first), do.EditBodies(ME, 1, ("2",), "mass", (((), "3"),)))
    assert len(state.live.parts) == 2
    motion = Motion()
    motion.advanced(live.model, live.live, STEP)
    part = motion.advanced(state.model, state.live, STEP)
    assert part.mechanism.model is state.model
    assert part.t[0] == pytest.approx(STEP)
    np.testing.assert_array_equal(part.q[0], first[0].q[-1])


def test_another_tree_keeps_the_joints_it_has_and_starts_a_record(live):
    state = after(fed(live, parts(live, 2)), do.AddBody(ME, "2"))
    assert state.live.parts == ()
    assert fed(state, parts(live, 1)).live.parts == ()  # of the old tree: too late
    motion = Motion()
    old = motion.advanced(live.model, live.live, STEP)
    part = motion.advanced(state.model, state.live, STEP)
    np.testing.assert_array_equal(part.q[0, :2], old.q[-1])


def test_stop_acts_before_the_parts_are_joined(live):
    """Computed motion stays in view and plays. Another run may be requested at once."""
    state = fed(live, found := parts(live, 4))
    over = after(state, do.StopLive(ME))
    assert over.going is None
    assert over.run.result is found[-1]
    assert after(over, do.Advanced(over.live.id, parts(state, 1)[0], 1.0)) is over  # too late
    assert after(over, do.Play(ME)).playback.playing
    assert after(over, do.StepFrames(ME, -1)).playback.time < over.playback.time
    again = stopped(state, do.GoLive(ME))
    assert again.going.id != over.live.id
    assert after(over, do.Simulate(ME)).job is not None
    assert stopped(state, do.Simulate(ME)).last_run is not None
    newer = pg.simulate(pg.Mechanism(state.model), t_end=0.2)
    shown = stopped(state, do.Simulate(ME), do.Done(over.jobs + 1, newer))
    assert shown.last_run.result is newer  # what came first is not shown over it


def test_an_edit_right_after_stop_leaves_the_run_of_the_model_before_it(live):
    state = fed(live, parts(live, 3))
    named = stopped(state, do.EditBodies(ME, 1, ("2",), "name", (((), "tip"),)))
    assert named.run.result.mechanism.names[1] == "tip"
    for edit in (do.EditBodies(ME, 1, ("2",), "mass", (((), "3"),)), do.AddBody(ME, "2")):
        edited = stopped(state, edit)
        assert edited.run is None
        assert edited.earlier.model is state.model
    other = stopped(state, do.OpenText(ME, "other", pg.Model.serial(3).to_json()))
    assert (other.run, other.earlier) == (None, None)


def test_a_gap_between_parts_of_a_live_run_is_reported(live):
    first, _, third = parts(live, 3)
    over, heard = after(fed(live, [first, third]), do.StopLive(ME)), []
    LiveRunner(heard.append).render(over, over)
    state = after(over, until(lambda: heard, "the runner's word")[0])
    assert state.live is None
    assert all(time in state.run_problem for time in ("0.02", "0.01"))


def test_the_thread_follows_edits_and_ends(live):
    state, count, one_at_a_time = live, 0, threading.RLock()

    def send(event):  # from this thread and the runner's, as a store takes them
        nonlocal state, count
        with one_at_a_time:
            state, count = after(state, event), count + 1
            runner.render(state, state)

    def mass():
        return state.run.result.mechanism.model.body("1").mass if state.run else 0.0

    runner = LiveRunner(send)
    runner.render(state, state)
    try:
        until(lambda: state.t_end >= 0.1 and count >= 3, "a tenth of a second of the run")
        send(do.EditBodies(ME, 2, ("1",), "mass", (((), "7"),)))
        until(lambda: mass() == 7, "parts of the heavier body")
    finally:
        send(do.StopLive(ME))
    until(lambda: state.live is None, "the end of the run")
    assert isinstance(state.run.result, pg.Result)
    until(lambda: "pgraph-live" not in {t.name for t in threading.enumerate()}, "its end")


@pytest.fixture
def finished():
    state = begun(pg.Model.serial(2))
    return ran(state, pg.simulate(pg.Mechanism(state.model), t_end=0.2))


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


def test_continue_asks_for_a_run_from_the_end(finished):
    state = after(finished, do.Continue(ME))
    assert state.job.before is finished.run.result
    request = state.job.request.model_copy(update={"t_end": 0.2})
    whole = replace(state.job, request=request).work(lambda _: True)
    assert (whole.t[0], whole.t[-1]) == pytest.approx((0.0, 0.4))
    done = after(state, do.Done(state.job.id, whole))
    assert done.playback.time == pytest.approx(0.2)


def test_a_run_that_ends_before_its_first_frame_says_why(finished):
    plain = finished.run.result
    message = "the motion stopped being finite at t = 0 s"
    empty = replace(plain, t=plain.t[:0], status=pg.Status.NOT_FINITE, message=message)
    done = ran(finished, empty)
    assert done.job is None
    assert done.run is finished.run
    assert message in done.run_problem
    assert (done.t_start, done.t_end) == (finished.t_start, finished.t_end)


def test_the_pose_shown_becomes_the_initial_state_in_one_step(finished):
    state = after(finished, do.Scrub(ME, 0.2), do.UsePose(ME))
    q, v = pg.Mechanism(state.model).home()
    np.testing.assert_array_equal(q, finished.run.result.q[-1])
    np.testing.assert_array_equal(v, finished.run.result.v[-1])
    assert len(state.undo) == len(finished.undo) + 1
    assert after(state, do.Undo(ME)).model is finished.model
    kept = after(finished, do.KeepRun(ME), do.EditBodies(ME, 1, ("1",), "mass", (((), "5"),)))
    assert [one.run for one in kept.runs] == [finished.run]  # over edits, until it is dropped
    assert after(kept, do.DropRun(ME, 1)).runs == ()


def test_the_mouse_pulls_a_body_towards_it(live):
    model = live.model.replace(gravity=(0.0, 0.0, 0.0))
    target = (0.0, 1.0, 0.5)
    pull = do.Pull(ME, "2", (0.0, 0.0, 0.0), target)
    free, pulled = Motion(), Motion()
    for _ in range(30):
        calm = free.advanced(model, live.live, STEP)
        drawn = pulled.advanced(model, live.live, STEP, pull)
    assert np.abs(calm.v).max() < 1e-12
    start = calm.body_pose[0, 1, :3]
    now = drawn.body_pose[-1, 1, :3]
    assert np.linalg.norm(now - target) < np.linalg.norm(start - target) - 0.01


def test_pictures_wait_for_the_pages_and_the_newest_is_drawn(live):
    """A worker follows every part. A page that has not shown its last picture gets none."""
    store, drawn, taken = Store(live), [], []

    class Watch:
        def __init__(self, times):
            self.render = lambda old, new: times.append(new.t_end)

    ready = threading.Event()
    store.ready = ready.is_set
    store.start([Watch(drawn)], [Watch(taken)])
    found = parts(live, 4)
    for part in found:
        store.send(do.Advanced(live.live.id, part, 1.0))
    until(lambda: taken[-1] == pytest.approx(4 * STEP), "all parts taken")
    assert drawn == [0.0]
    store.send(do.Push(ME, "left"))  # what people do is drawn at once, with the newest picture
    until(lambda: len(drawn) == 2, "the push drawn")
    assert drawn[-1] == pytest.approx(4 * STEP)
    store.send(do.Advanced(live.live.id, parts(fed(live, found), 1)[0], 1.0))
    ready.set()
    store.wake()
    store.stop()


def test_a_long_live_run_keeps_few_parts_and_loses_no_frame(live):
    """400 parts, joined as it goes: its end joins a few, and the run is that of the parts."""
    state, motion, ends = live, Motion(), [0.0]
    for _ in range(400):
        part = motion.advanced(state.model, state.live, 0.002)
        ends.append(float(part.t[-1]))
        state = after(state, do.Advanced(state.live.id, part, 1.0))
    assert len(state.live.parts) <= 1 + 2 * 31
    assert state.live.part_at(0.01).t[0] <= 0.01
    run = stopped(state).run.result
    assert set(np.round(ends, 9)) <= set(np.round(run.t, 9))
    assert np.all(np.diff(run.t) > 0)


def frames(parts):
    return [t for part in parts for t in part.t]


def test_parts_of_a_live_run_are_joined_in_step(monkeypatch):
    """Each count of joins belongs to one part, whatever has been joined."""
    monkeypatch.setattr(pg, "joined", lambda parts: SimpleNamespace(t=frames(parts)))
    live, n = SimpleNamespace(parts=(), joined=()), TOGETHER**2 + 3
    for k in range(n):
        parts, counts = grown(live, SimpleNamespace(t=[k]))
        live = SimpleNamespace(parts=parts, joined=counts)
        assert len(parts) == len(counts)
    assert counts == (2, 0, 0, 0)
    assert frames(parts) == list(range(n))


def test_a_push_while_a_run_plays_takes_it_on_live_from_there():
    state = begun(pg.Model.serial(3))
    result = pg.simulate(pg.Mechanism(state.model), t_end=1.0, step=1e-3)
    state = after(ran(state, result), do.Scrub(ME, 0.6), do.GoLiveHere(ME))
    time, q, v = state.going.start
    assert state.playback.time == time == pytest.approx(0.6, abs=0.02)
    k = int(np.abs(result.t - time).argmin())
    np.testing.assert_array_equal(q, result.q[k])
    part = Motion(state.going.start).advanced(state.model, state.going, 0.1)
    np.testing.assert_allclose(part.q[0], q)
    np.testing.assert_allclose(part.v[0], v)
    assert part.t[0] == time
    later = int(np.abs(result.t - part.t[-1]).argmin())
    np.testing.assert_allclose(part.q[-1], result.q[later], atol=0.05)
