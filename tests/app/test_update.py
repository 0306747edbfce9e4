"""The reducer: edits, undo, runs, playback and messages of the page."""

import threading
from dataclasses import replace
from itertools import count
from types import SimpleNamespace

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.core import edit
from pgraph_app.core.events import from_page, update
from pgraph_app.core.state import derive, with_client
from pgraph_app.core.store import Store
from pgraph_app.core.views import topic
from pgraph_app.model import LONG, Found, sent
from pgraph_app.model.apart import answer
from pgraph_app.pose import poses
from pgraph_app.report import Report
from pgraph_app.run import FREE_RUN, Playback, Request, Run, Simulation
from pgraph_app.run.trust import summary, trust
from pgraph_app.run.view import hints, keeps
from pgraph_core.show.notebook import between

from .store import ME, OTHER, after, begun, do, notice, reply, seven, until

pytestmark = pytest.mark.quick


@pytest.fixture
def state():
    """Fig. 1's seven bodies, looked at by two pages."""
    return begun(seven(), ME, OTHER, gallery={"serial": pg.Model.serial(3).to_json()})


def typed(body, field, text, *index, serial=1):
    return do.EditBodies(ME, serial, (body,), field, ((index, text),))


def result(t_end=1.0, nb=7):
    """Return a run in which every body moves 1 m along x in t_end."""
    t = np.linspace(0.0, t_end, 11)
    pose = np.zeros((11, nb, 7))
    pose[:, :, 0], pose[:, :, 3] = (t / t_end)[:, None], 1.0
    return SimpleNamespace(t=t, body_pose=pose)


@pytest.fixture
def ran(state):
    return after(state, do.Simulate(ME), do.Done(1, result()))


def test_theme_view_and_downloads_are_a_page_s_own_and_switches_shared(state):
    events = do.Theme(ME, True), do.Viewport(ME, 0.6), do.Download(ME), do.Download(ME)
    state = after(state, *events)
    mine, other = state.clients[ME], state.clients[OTHER]
    assert (mine.dark, mine.aspect, mine.asked) == (True, 0.6, events[-1])
    assert (other.dark, other.aspect, other.asked) == (False, None, None)
    assert "names" in after(state, do.Show(ME, "names", True)).shown
    assert "axes" not in after(state, do.Show(ME, "axes", False)).shown


def test_an_accepted_edit_is_answered_and_the_same_value_is_no_undo_step(state):
    done = after(state, typed("3", "mass", " 1.5e3 ", serial=5))
    assert (done.clients[ME].reply.serial, done.clients[ME].reply.text) == (5, "")
    assert (done.model.body("3").mass, len(done.undo)) == (1500.0, 1)
    assert after(done, typed("3", "mass", "1500")).undo == done.undo
    skew = after(state, typed("3", "inertia", "1e-4", 0, 1), typed("3", "tip", "", 0))
    assert (skew.model.body("3").inertia[1][0], skew.model.body("3").tip) == (1e-4, None)
    assert not after(state, typed("3", "dof", "3")).clients[ME].notice.bad  # what was reset


def test_pgraph_and_jdof_follow_an_edit(state):
    assert state.derived.pgraph == (1, 2, 3, 5, 2, 4, 2, 6, 7)  # fig. 1
    state = after(state, typed("6", "parent", "5"))
    assert state.derived.pgraph == (1, 2, 3, 5, 6, 7, 2, 4)
    assert state.derived.jdof == (1, 1, 1, 1, 1, 1, 0, 1)


def test_a_body_is_added_on_the_given_one_and_is_selected(state):
    added = after(state, do.AddBody(ME, "5"))
    assert added.model.body("8").parent == "5"
    assert added.clients[ME].selection == "8"
    for parent in (None, "nobody"):
        assert after(state, do.AddBody(ME, parent)).model.body("8").parent == "ground"


def test_open_replaces_the_model(state, ran):
    assert len(after(state, do.OpenBuiltIn(ME, "serial")).model.bodies) == 3
    assert after(state, do.OpenBuiltIn(ME, "nothing")).model is state.model
    new = after(state, do.NewModel(ME, 1, "4"))
    assert [body.name for body in new.model.bodies] == ["1", "2", "3", "4"]
    assert new.framed == 1
    assert after(new, do.Undo(ME)).model is state.model
    again = after(ran, do.OpenText(ME, "same", ran.model.to_json()))
    assert (again.model.to_json(), again.run) == (ran.model.to_json(), None)
    assert len(again.undo) == len(ran.undo) + 1


def test_save_asks_for_a_file_and_the_outcome_is_reported(state):
    assert after(state, do.Save(ME, 4, "/tmp/x.json")).saving.model is state.model
    assert notice(after(state, do.Saved(ME, 4, "/tmp/x.json", "")))
    assert reply(after(state, do.Saved(ME, 4, "/no/x.json", "No."))) == "No."


def test_undo_and_redo_a_hundred_and_fifty_deep(state):
    first = state.model
    state = after(state, *(typed("3", "mass", str(k + 2)) for k in range(150)))
    last = state.model
    state = after(state, *[do.Undo(ME)] * 150)
    assert state.model is first
    assert after(state, do.Undo(ME)) is state
    state = after(state, *[do.Redo(ME)] * 150)
    assert state.model is last
    assert after(state, do.Redo(ME)) is state
    edited = after(state, do.Undo(ME), typed("3", "mass", "0.5"))
    assert (edited.redo, edited.undo[-1].label) == ((), "mass of 3")


def test_the_result_of_an_errand_is_an_undo_step(state):
    asked = sent(state, ME, "fit", lambda _: Found("", {"3": {"mass": 9.0}}))
    done = after(asked, do.ErrandDone(1, Found("done", {"3": {"mass": 9.0}})))
    assert done.model.body("3").mass == 9.0
    assert after(done, do.Undo(OTHER)).model.body("3").mass == 1.0


def test_a_run_is_asked_for_once_and_comes_back(state):
    before = replace(state)
    asked = after(state, do.Simulate(ME))
    assert state == before
    assert after(asked, do.Simulate(OTHER)) is asked
    assert after(asked, do.Progress(1, {"fraction": 0.5})).job.fraction == 0.5
    done = after(asked, do.Done(1, result()))
    assert (done.job, done.t_end) == (None, 1.0)
    failed = after(asked, do.Failed(1, "why"))
    assert (failed.job, failed.run_problem) == (None, "why")
    assert after(failed, do.Simulate(ME)).run_problem == ""
    compiling = after(state, do.Compiling(2, 5, "step")).kernels
    assert (compiling.done, compiling.total, compiling.ready) == (2, 5, False)
    assert after(state, do.Compiled("no compiler")).kernels.problem == "no compiler"


def test_a_run_that_is_cancelled_keeps_what_there_is(state):
    """A decision of a person was a red cross, and the frames were thrown away."""
    state = after(state, do.SetRun(ME, 1, "step", "1e-4"), do.SetRun(ME, 2, "t_end", "20"))
    asked = after(state, do.Simulate(ME), do.Cancel(ME))
    assert asked.job.cancelled
    part = Simulation.work(asked.job, lambda fraction: fraction < 0.05)
    assert part.status is pg.Status.CANCELLED
    done = after(asked, do.Done(asked.job.id, part))
    assert done.job is None
    assert done.run_problem == ""
    assert 0.0 < done.t_end < asked.job.request.t_end
    seal = trust(done, None, None, None)
    assert seal["level"] == "unknown"
    assert seal["said"] == f"Stopped at {done.t_end:.3g} s"


def test_a_stale_result_is_dropped(state):
    cancelled = after(state, do.Simulate(ME), do.Cancel(ME), do.Cancel(ME))
    assert cancelled.job is None
    assert cancelled.run_problem
    assert after(cancelled, do.OpenBuiltIn(ME, "serial")).run_problem == ""
    assert after(cancelled, do.Done(1, result())) is cancelled
    again = after(cancelled, do.Simulate(ME))
    for stale in (do.Done(1, result()), do.Progress(1, {"fraction": 0.9}), do.Failed(1, "no")):
        assert after(again, stale) is again


def test_a_run_belongs_to_the_model_it_was_asked_for(state, ran):
    edited = after(ran, typed("3", "mass", "2"))
    assert edited.run is None
    assert edited.earlier is edited.plotted is ran.last_run
    undone = after(edited, do.Undo(ME))
    assert (undone.run, undone.earlier) == (ran.last_run, None)
    assert after(edited, do.OpenBuiltIn(ME, "serial")).plotted is None
    meanwhile = after(state, do.Simulate(ME), typed("3", "mass", "2"), do.Done(1, result()))
    assert meanwhile.run is None
    assert meanwhile.run_problem
    assert after(meanwhile, do.Undo(ME)).run is not None


def test_the_end_loops_or_stops_and_scrubbing_stays_within_the_run(ran):
    playing = after(ran, do.Play(ME), do.Scrub(ME, 0.95))
    assert after(playing, do.Tick(0.1)).playback.time == pytest.approx(0.05)
    stopped = after(playing, do.Loop(ME, False), do.Tick(0.1))
    assert (stopped.playback.time, stopped.playback.playing) == (1.0, False)
    assert after(stopped, do.Play(ME)).playback.time == 0.0
    for given, shown in ((7.0, 1.0), (-7.0, 0.0)):
        assert after(ran, do.Scrub(ME, given)).playback.time == shown
    stepped = after(ran, do.Scrub(ME, 0.5), do.StepFrames(ME, 1)).playback
    assert stepped.time == pytest.approx(0.6)
    assert after(ran, do.StepFrames(ME, -1)).playback.time == 0.0


def test_settings_and_scenarios(state):
    state = after(state, do.SetRun(ME, 1, "t_end", "0.5"), do.SetRun(ME, 2, "method", "rk4"))
    assert state.request == Request(t_end=0.5, method="rk4")
    state = after(state, do.SetRun(ME, 1, "step", " "), do.SetRun(ME, 2, "rtol", "1e-9"))
    assert (state.request.step, state.request.rtol) == (None, 1e-9)
    assert after(state, do.SetScenario(ME, 1, "no such")).request == state.request
    assert after(state, do.SetScenario(ME, 1, FREE_RUN)).request == Request()


@pytest.mark.parametrize(
    ("settings", "step", "rtol", "acts"),
    [
        ({"method": "rk4"}, None, None, (True, False)),  # the usual step, and no tolerance
        ({"method": "radau5"}, None, None, (True, True)),  # chosen by the error
        ({"method": "dopri5", "rtol": "1e-7", "step": ""}, None, 1e-7, (True, True)),
        ({"rtol": "1e-7"}, None, 1e-7, (True, True)),  # automatic takes either
    ],
)
def test_a_method_is_asked_for_what_it_takes(state, settings, step, rtol, acts):
    events = [do.SetRun(ME, k, field, text) for k, (field, text) in enumerate(settings.items())]
    state = after(state, *events)
    assert (state.request.step, state.request.rtol) == (step, rtol)
    shown = hints(state.request)
    assert (shown["step"][2], shown["rtol"][2]) == acts
    model = pg.Model.serial(1)
    done = pg.simulate(model, t_end=0.01, step=step, rtol=rtol, method=state.request.method)
    assert done.status.ok


def test_a_scenario_brings_its_settings_and_changes_of_them_are_shown():
    scenario = pg.Scenario(name="short", t_end=0.25, step=1e-3, method="rk4")
    state = begun(pg.Model.serial(2).replace(scenarios=(scenario,)))
    assert after(state, do.SetScenario(ME, 1, FREE_RUN)).request.scenario == FREE_RUN
    state = after(state, do.SetScenario(ME, 1, "short"))
    assert (state.request, keeps(state)) == (
        Request(scenario="short", t_end=0.25, step=1e-3, method="rk4"),
        False,
    )
    changed = after(state, do.SetRun(ME, 2, "t_end", "3"))
    assert keeps(changed)
    assert changed.model.scenarios == (scenario,)
    assert not keeps(after(changed, do.SetRun(ME, 3, "t_end", "0.25")))
    assert after(state, do.NewModel(ME, 1, "3")).request.scenario == FREE_RUN


@pytest.mark.parametrize("method", ["moreau_jean", "semi_implicit_euler", "rk4"])
@pytest.mark.parametrize(("drift", "small"), [(0.009, True), (0.02, False), (0.3, False)])
def test_an_error_or_a_drift_above_one_percent_is_bad(method, drift, small):
    result = SimpleNamespace(
        energy_drift=drift, relative_error=np.array([drift]), accuracy=f"{drift} rad",
        error_estimate=drift,
        message="done",
        status=pg.Status.DONE, header={"method": method, "step": 1e-3}, counters={}, timing={},
        notices=(), constraint_drift=(),
    )  # fmt: skip
    lines = {line[0]: line[1:] for line in summary(Run(pg.Model.serial(1), Request(), result))}
    assert lines["Energy drift"][1] == (small or method != "rk4")  # of first order by nature
    assert lines["Error estimate"][1] == small
    assert ("step" in lines["Energy drift"][0]) == (not small)  # advice


def test_playing_moves_with_the_clock_and_the_speed(state, ran):
    pressed = after(state, do.Play(ME))  # by a page that still showed the run of another model
    assert (pressed.job is None) == (not state.model.bodies)
    assert after(state, do.Tick(0.1)) is state
    state = after(ran, do.Play(ME), do.Tick(0.1), do.Speed(ME, 2.0), do.Tick(0.1))
    assert state.playback.time == pytest.approx(0.3)
    positions, wxyz = poses(state)
    assert positions[:, 0] == pytest.approx(0.3)
    assert np.linalg.norm(wxyz, axis=1) == pytest.approx(1.0)
    assert after(state, do.Pause(ME), do.Tick(0.1)).playback.time == pytest.approx(0.3)


def test_poses_between_frames_take_the_short_way_round():
    pose = np.zeros((2, 1, 7))
    pose[0, 0, 3], pose[1, 0, 3] = 1.0, -1.0  # the same orientation, written with either sign
    _, wxyz = between(np.array([0.0, 1.0]), pose, 0.5)
    assert abs(wxyz[0, 0]) == pytest.approx(1.0)
    assert between(np.array([0.0]), pose[:1], 3.0)[0].shape == (1, 3)  # a single frame


EDIT = '{"event": "EditBodies", "serial": 3, "bodies": ["a"], "field": %s, "entries": [[%s, "1"]]}'


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '{"event": "Connected"}',
        '{"event": "Select", "body": 5}',
        '{"event": "Select", "body": "a", "more": 1}',
        EDIT % ('"bodies"', "[]"),
        '{"event": "Scrub", "time": NaN}',
        '{"event": "Show", "what": "everything", "on": true}',
        '{"event": "Gripped", "body": "a", "what": "mass", "vector": [0, 0, 0], "done": true}',
        '{"event": "Pull", "body": "a", "point": [0, 0], "target": [0, 0, 0]}',
        "[" * 100_000,
    ],
)
def test_an_unknown_message_is_misread(state, text):
    misread = from_page(ME, text)
    assert isinstance(misread, do.Misread)
    assert after(state, misread).clients[ME].notice.bad


def test_a_page_speaks_for_itself():
    assert from_page(ME, EDIT % ('"inertia"', "[0, 1]") + "  ") == do.EditBodies(
        ME, 3, ("a",), "inertia", (((0, 1), "1"),)
    )
    assert from_page(ME, '{"event": "Undo", "client": 2}') == do.Undo(ME)


def test_the_constraint_column_names_contacts_and_limits():
    ball = {"kind": "sphere", "radius": 0.1}
    model = pg.Model.serial(3).edit("1", shape=ball).edit("2", limits=(-1, 1))
    contacts = (
        pg.Contact(name="floor", body="*"),
        pg.Contact(name="tip", body="3", points=((0, 0, 0),)),
        pg.Contact(name="3", body="3", points=((0, 0, 1),)),
    )
    column = derive(model.replace(contacts=contacts)).constraints
    assert column == {"1": ("floor",), "2": ("limits",), "3": ("tip", "contact")}


def test_a_long_file_is_read_as_an_errand_and_a_bad_one_is_refused_there(state):
    """Other pages need not wait. Small files open within the event."""
    good = pg.Model.serial(3).to_json()
    for text, opens in ((good, True), (good.replace('"1"', "1"), False)):
        sent = after(state, do.OpenText(ME, "long", text + " " * LONG))
        assert sent.model is state.model
        now = after(sent, answer(sent.errands[0]))
        assert (len(now.model.bodies) == 3) is opens
        assert (now.clients[ME].notice is None) is opens


def test_a_rename_and_a_colour_keep_the_run_and_where_it_plays(ran):
    moved = after(ran, do.Scrub(ME, 0.4))
    renamed = after(moved, typed("3", "name", "knee"))
    assert renamed.run is not None
    assert renamed.playback.time == 0.4
    assert after(renamed, do.Undo(ME)).run is not None
    drawn = pg.Shape(kind="sphere", radius=0.1, role="visual", colour="#ff0000")
    looks = edit.with_model(moved, moved.model.edit("3", shape=drawn), "look")
    assert looks.run is not None
    touching = pg.Shape(kind="sphere", radius=0.1)
    assert edit.with_model(moved, moved.model.edit("3", shape=touching), "shape").run is None


def test_waiting_news_of_the_server_is_drawn_once_and_a_person_passes_it(state):
    drawn, gate = [], threading.Event()

    def slowly(state, event):
        gate.wait()
        part = "framed" if isinstance(event, do.Select) else "jobs"
        return replace(state, **{part: getattr(state, part) + 1})

    store = Store(state, slowly)
    store.start([SimpleNamespace(render=lambda old, new: drawn.append((new.jobs, new.framed)))])
    for _ in range(200):
        store.send(do.Progress(1, {"fraction": 0.5}))
    store.send(do.Select(ME, None))
    gate.set()
    until(lambda: drawn[-1] == (200, 1), "all of it drawn")
    store.stop()
    assert len(drawn) <= 4  # at first, what was under way, what waited, the person's
    assert drawn.index(next(x for x in drawn if x[1])) <= 3


def test_an_event_that_raises_is_told_at_its_cell_or_as_a_notice_and_changes_nothing(state):
    def broken(now, event):
        raise KeyError("filter")

    store = Store(state, broken)
    store.start([])
    for event in (typed("3", "mass", "2", serial=5), do.AddBody(OTHER, None)):
        store.send(event)
    store.stop()
    mine, other = store.state.clients[ME], store.state.clients[OTHER]
    assert (mine.reply.serial, mine.reply.failed) == (5, True)
    for text in (mine.reply.text, other.notice.text):
        assert all(word in text for word in ("fault of Pgraph", "KeyError", "nothing was changed"))
    assert mine.notice is None
    assert other.notice.bad
    assert store.state.model is state.model


def test_a_failed_view_is_told_once_on_all_pages(state):
    def broken(old, new):
        if new.jobs:
            raise RuntimeError("no paint")

    def counted(now, event):
        return update(now, event) if type(event) is do.Undrawn else replace(now, jobs=now.jobs + 1)

    store = Store(state, counted)
    store.start([SimpleNamespace(render=broken, name="table")])
    for body in ("1", "2", "3"):
        store.send(do.Select(ME, body))
        until(lambda: not store.waiting, "the events")
    store.stop()
    notices = [page.notice for page in store.state.clients.values()]
    assert all(one.bad and "table" in one.text and "no paint" in one.text for one in notices)
    assert notices[0] is not None


def test_a_view_that_failed_draws_the_whole_change_next_time(state):
    seen, fails = [], [True]

    def render(old, new):
        if new.jobs and fails and fails.pop():
            raise RuntimeError
        seen.append((old.jobs, new.jobs))

    def counted(now, event):
        return now if type(event) is do.Undrawn else replace(now, jobs=now.jobs + 1)

    store = Store(state, counted)
    store.start([SimpleNamespace(render=render)])
    store.send(do.Select(ME, None))
    store.send(do.Select(ME, None))
    until(lambda: len(seen) == 2, "the second picture")
    store.stop()
    assert seen == [(0, 0), (0, 2)]


@pytest.mark.parametrize("event", [do.Select(ME, None), do.Progress(1, {}), do.Tick(0.1)])
def test_an_event_of_any_length_is_no_news_for_the_terminal(state, event, caplog, monkeypatch):
    clock = SimpleNamespace(perf_counter=count(step=1000.0).__next__)
    monkeypatch.setattr("pgraph_app.core.store.time", clock)
    store = Store(state, lambda state, event: replace(state, jobs=state.jobs + 1))
    store.start([])
    store.send(event)
    until(lambda: store.state.jobs, "the event")
    store.stop()
    assert caplog.records == []


def test_the_log_has_the_time_of_all_views_and_names_the_topic(state, caplog, monkeypatch):
    """Each look at the clock takes 1 s. Topics are of one class."""
    clock = SimpleNamespace(perf_counter=count(step=1.0).__next__)
    monkeypatch.setattr("pgraph_app.core.store.time", clock)
    caplog.set_level("INFO", "pgraph_app.core.store")
    store = Store(state, lambda state, event: replace(state, jobs=state.jobs + 1))
    desk = SimpleNamespace(bridge=None, send=None)
    views = [topic(name, str, "jobs")(desk) for name in ("first", "second", "second")]
    for view in views:
        monkeypatch.setattr(view, "render", lambda old, new: None)
    store.start(views)
    store.send(do.Select(ME, None))
    until(lambda: caplog.records, "the line of the event")
    store.stop()
    assert "4000.0 ms, of which topic second 2000.0 ms" in caplog.text


@pytest.mark.parametrize(
    "event", [do.NewModel(ME, 1, "3"), do.OpenText(ME, "a", pg.Model.serial(2).to_json())]
)
def test_nothing_of_a_model_stays_with_another_one(ran, event):
    state = after(ran, do.KeepRun(ME), do.Select(ME, "1"), do.SetGizmo(ME, "com"))
    state = with_client(state, ME, plots=(("position", "1"),))
    state = replace(state, report=Report("precision", state.model, None))
    state = after(state, event)
    page = state.clients[ME]
    assert state.report is state.run is state.plotted is None
    assert state.runs == ()
    assert (page.selection, page.selected, page.gizmo, page.plots) == (None, (), "", ())


def test_the_first_motion_waits_for_a_page_that_can_show_it(ran):
    assert ran.playback.preview
    assert not ran.playback.moves  # no page has said what shape its 3D view has
    seen = after(ran, do.Viewport(ME, 1.5))
    assert seen.playback.moves
    assert seen.playback.time == 0.0


def test_a_preview_ends_with_the_run(ran):
    state = replace(ran, playback=Playback(0.5, preview=True))
    for time, preview in ((0.75, True), (1.0, False)):
        state = after(state, do.Tick(0.25))
        assert (state.playback.time, state.playback.preview) == (time, preview)


def test_a_run_of_one_instant_has_no_frames_to_step_through(state):
    one = result()
    one.t, one.body_pose = one.t[:1], one.body_pose[:1]
    state = after(state, do.Simulate(ME), do.Done(1, one))
    state = replace(state, playback=replace(state.playback, playing=True))
    assert after(state, do.StepFrames(ME, 1)) is state
