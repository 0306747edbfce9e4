"""The reducer: every event, refusals that keep the model, undo, stale results."""

from __future__ import annotations

import sys
import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.core import cells, edit
from pgraph_app.core.events import Event, Misread, from_page
from pgraph_app.core.state import Report, Request, State, initial, poses, with_client
from pgraph_app.core.store import Store
from pgraph_app.features import update
from pgraph_app.model import Found
from pgraph_app.model.derived import derive
from pgraph_app.model.update import (
    Download,
    Edit,
    ErrandDone,
    NewModel,
    OpenBuiltIn,
    OpenText,
    Redo,
    Undo,
    sent,
)
from pgraph_app.playback.update import Loop, Pause, Play, Scrub, Speed, StepFrames, Tick
from pgraph_app.pose.update import MoveJoint, SetGizmo
from pgraph_app.properties.view import without_noise
from pgraph_app.run import FREE_RUN, Run
from pgraph_app.run.update import (
    Cancel,
    Compare,
    Compiled,
    Compiling,
    Failed,
    Progress,
    SetRun,
    SetScenario,
    Simulate,
    Simulated,
)
from pgraph_app.run.view import hints, kept, summary
from pgraph_app.scene.update import Show, Viewport
from pgraph_app.session.update import Connected, Disconnected, Save, Saved, Select, Theme
from pgraph_app.table.update import AddBody, DeleteBodies
from pgraph_core.show.animation import between

pytestmark = pytest.mark.fast

ME, OTHER = 1, 2


@pytest.fixture
def state() -> State:
    """Fig. 1's seven bodies, looked at by two pages."""
    model = pg.Model.serial(7).edit("4", parent="2").edit("5", parent="3").edit("6", parent="2")
    gallery = {"serial": pg.Model.serial(3).to_json()}
    return after(initial(model, gallery), Connected(ME), Connected(OTHER))


def after(state: State, *happened: Event) -> State:
    for event in happened:
        state = update(state, event)
    return state


def typed(body: str, field: str, text: str, index: tuple[int, ...] = (), serial: int = 1):
    return Edit(ME, serial, body, field, index, text)  # type: ignore[arg-type]


def result(t_end: float = 1.0, nb: int = 7) -> SimpleNamespace:
    """A run in which every body moves 1 m along x in t_end."""
    t = np.linspace(0.0, t_end, 11)
    pose = np.zeros((11, nb, 7))
    pose[:, :, 0], pose[:, :, 3] = (t / t_end)[:, None], 1.0
    return SimpleNamespace(t=t, body_pose=pose)


@pytest.fixture
def ran(state: State) -> State:
    """The state after a simulation."""
    return after(state, Simulate(ME), Simulated(1, result()))


# -- pages -------------------------------------------------------------------------------------


def test_each_page_has_its_own_selection(state):
    state = after(state, Select(ME, "3"), Select(OTHER, "5"))
    assert (state.clients[ME].selection, state.clients[OTHER].selection) == ("3", "5")
    assert after(state, Select(ME, None)).clients[ME].selection is None


def test_selecting_what_is_not_there_changes_nothing(state):
    assert after(state, Select(ME, "nobody")) is state
    assert after(state, Select(99, "3")) is state


def test_a_page_that_leaves_is_forgotten(state):
    assert set(after(state, Disconnected(ME)).clients) == {OTHER}


def test_theme_view_and_downloads_are_a_page_s_own(state):
    state = after(
        state, Theme(ME, True), Viewport(ME, 0.6), Download(ME),
        Download(ME),
    )  # fmt: skip
    mine, other = state.clients[ME], state.clients[OTHER]
    assert (mine.dark, mine.aspect, mine.downloads) == (True, 0.6, 2)
    assert (other.dark, other.aspect, other.downloads) == (False, None, 0)


def test_show_switches_are_shared(state):
    assert "names" in after(state, Show(ME, "names", True)).shown
    assert "axes" not in after(state, Show(ME, "axes", False)).shown


def test_an_unreadable_message_is_said(state):
    notice = after(state, Misread(ME, "ValueError: no")).clients[ME].notice
    assert notice is not None
    assert notice.bad


# -- edits -------------------------------------------------------------------------------------


def test_pgraph_and_jdof_follow_an_edit(state):
    assert state.derived.pgraph == (1, 2, 3, 4, 2, 5, 2, 6, 7)  # fig. 1, renumbered
    state = after(state, typed("6", "parent", "5"))
    assert state.derived.pgraph == (1, 2, 3, 4, 5, 6, 2, 7)
    assert state.derived.jdof == (1, 1, 1, 1, 1, 1, 0, 1)


def test_a_rename_is_followed_by_the_selection_of_all_pages(state):
    state = after(state, Select(ME, "3"), Select(OTHER, "3"))
    state = after(state, typed("3", "name", "knee"))
    assert [c.selection for c in state.clients.values()] == ["knee", "knee"]
    assert state.model.body("5").parent == "knee"
    assert after(state, Undo(ME)).clients[ME].selection == "3"


@pytest.mark.parametrize(
    ("field", "index", "text", "value"),
    [
        ("mass", (), "1e-6", 1e-6),
        ("mass", (), " 1.5e3 ", 1500.0),
        ("com", (2,), "-.25", -0.25),
        ("link", (0,), "+2", 2.0),
    ],
)
def test_the_number_typed_is_the_number_used(state, field, index, text, value):
    body = after(state, typed("3", field, text, index)).model.body("3")
    got = getattr(body, field)
    assert (got[index[0]] if index else got) == value


def test_an_off_diagonal_moment_is_typed_once(state):
    state = after(state, typed("3", "inertia", "1e-4", (0, 1)))
    assert state.model.body("3").inertia[1][0] == 1e-4


def test_an_empty_tip_is_the_centre_of_mass(state):
    state = after(state, typed("3", "tip", "", (0,)))
    assert state.model.body("3").tip is None
    state = after(state, typed("3", "tip", "0.5", (1,)))
    assert state.model.body("3").tip == (state.model.body("3").com[0], 0.5, 0.0)


@pytest.mark.parametrize(
    ("body", "field", "index", "text", "said"),
    [
        ("3", "mass", (), "-1", "mass"),
        ("3", "mass", (), "heavy", "must be a number such as"),
        ("3", "mass", (), "1,5", "decimal point"),
        ("3", "mass", (), "nan", "must be a number"),
        ("3", "mass", (), "1e400", "too large"),
        ("3", "mass", (), "1_000", "must be a number"),
        ("3", "mass", (), "0x10", "must be a number"),
        ("3", "name", (), "4", "name"),
        ("3", "name", (), "", "name"),
        ("3", "name", (), "x" * 10_000, "at most 100"),
        ("3", "name", (), "ground", "ground"),
        ("3", "parent", (), "5", "parent"),
        ("3", "parent", (), "nobody", "nobody"),
        ("3", "dof", (), "7", "from 0 to 6"),
        ("3", "dof", (), "1.5", "from 0 to 6"),
        ("3", "axes", (0, 1), "0", "zero"),
        ("3", "com", (5,), "1", "no such entry"),
        ("3", "inertia", (0, 0), "-1", "inertia"),
        ("nobody", "mass", (), "1", "nobody"),
    ],
)
def test_a_refused_edit_says_why_and_keeps_the_model(state, body, field, index, text, said):
    refused = after(state, typed(body, field, text, index, serial=7))
    assert refused.model is state.model
    assert refused.undo == state.undo
    reply = refused.clients[ME].reply
    assert reply is not None
    assert reply.serial == 7
    assert said in reply.text
    assert refused.clients[OTHER].reply is None


def test_an_accepted_edit_is_answered_with_nothing(state):
    reply = after(state, typed("3", "mass", "2", serial=5)).clients[ME].reply
    assert reply is not None
    assert (reply.serial, reply.text) == (5, "")


def test_typing_the_same_value_is_no_undo_step(state):
    mass = str(state.model.body("3").mass)
    assert after(state, typed("3", "mass", mass)).undo == ()


def test_a_new_joint_says_what_it_reset(state):
    notice = after(state, typed("3", "dof", "3")).clients[ME].notice
    assert notice is not None
    assert not notice.bad


def test_new_model(state):
    state = after(state, NewModel(ME, 1, "4"))
    assert [body.name for body in state.model.bodies] == ["1", "2", "3", "4"]
    assert state.framed == 1
    assert len(after(state, Undo(ME)).model.bodies) == 7


@pytest.mark.parametrize("text", ["0", "-3", "many", "1001", "2.5", ""])
def test_a_new_model_of_no_sensible_size_is_refused(state, text):
    refused = after(state, NewModel(ME, 3, text))
    assert refused.model is state.model
    assert refused.clients[ME].reply is not None
    assert "from 1 to 1000" in refused.clients[ME].reply.text


def test_add_body_hangs_on_the_given_one_and_is_selected(state):
    added = after(state, AddBody(ME, "5"))
    assert added.model.body("8").parent == "5"
    assert added.clients[ME].selection == "8"
    assert after(state, AddBody(ME, None)).model.body("8").parent == "ground"
    assert after(state, AddBody(ME, "nobody")).model.body("8").parent == "ground"


def test_the_last_body_can_go_and_another_come(state):
    state = after(state, DeleteBodies(ME, ("1",), "delete"))
    assert state.derived.names == ()
    assert after(state, AddBody(ME, None)).derived.names == ("1",)


def test_delete_attaches_children_or_takes_them_along(state):
    attached = after(state, Select(ME, "3"), DeleteBodies(ME, ("3",), "attach"))
    assert attached.model.body("5").parent == "2"
    assert attached.clients[ME].selection is None
    assert after(state, DeleteBodies(ME, ("2",), "delete")).derived.names == ("1",)
    assert after(state, DeleteBodies(ME, ("nobody",), "attach")).model is state.model


def test_open_replaces_the_model_and_a_bad_file_says_why(state):
    assert len(after(state, OpenBuiltIn(ME, "serial")).model.bodies) == 3
    assert after(state, OpenBuiltIn(ME, "nothing")).model is state.model
    refused = after(state, OpenText(ME, "x.json", "{"))
    assert refused.model is state.model
    assert refused.clients[ME].notice is not None
    assert refused.clients[ME].notice.bad


def test_save_asks_for_a_file_and_the_outcome_is_said(state):
    saving = after(state, Save(ME, 4, "/tmp/x.json")).saving
    assert saving is not None
    assert saving.model is state.model
    saved = after(state, Saved(ME, 4, "/tmp/x.json", ""))
    assert saved.clients[ME].notice is not None
    refused = after(state, Saved(ME, 4, "/no/x.json", "No."))
    assert refused.clients[ME].reply is not None
    assert refused.clients[ME].reply.text == "No."


def test_undo_and_redo_a_hundred_and_fifty_deep(state):
    first = state.model
    for k in range(150):
        state = after(state, typed("3", "mass", str(k + 2)))
    last = state.model
    for _ in range(150):
        state = after(state, Undo(ME))
    assert state.model is first
    assert after(state, Undo(ME)) is state
    for _ in range(150):
        state = after(state, Redo(ME))
    assert state.model is last
    assert after(state, Redo(ME)) is state


def test_an_edit_after_undo_forgets_what_was_undone(state):
    state = after(state, typed("3", "mass", "2"), Undo(ME), typed("3", "mass", "3"))
    assert state.redo == ()
    assert state.undo[-1].label == "mass of 3"


def test_an_edit_passes_few_files(state):
    """From the event to the new state: 12 files of ours at most."""
    state, files = after(state, typed("3", "mass", "1.5")), set()
    root = str(Path(edit.__file__).parents[2])

    def seen(frame, event, _):
        if event == "call" and frame.f_code.co_filename.startswith(root):
            files.add(frame.f_code.co_filename)

    sys.setprofile(seen)
    try:
        after(state, typed("3", "mass", "2"))
    finally:
        sys.setprofile(None)
    files = {name for name in files if "/.venv/" not in name and "/tests/" not in name}
    assert 5 < len(files) <= 12, sorted(files)


def test_what_an_errand_changes_is_a_step_of_the_page_that_asked(state):
    """Its answer comes from the server; the page's own Undo takes it back, no other page's."""
    for client, page in ((ME, "me"), (OTHER, "other")):
        state = replace(
            state, clients={**state.clients, client: replace(state.clients[client], page=page)}
        )
    asked = sent(state, ME, "fit", lambda _: Found("", {"3": {"mass": 9.0}}))
    done = after(asked, ErrandDone(1, Found("done", {"3": {"mass": 9.0}})))
    assert done.undo[-1].by == "me"
    assert done.model.body("3").mass == 9.0
    assert after(done, Undo(OTHER)).model is done.model
    assert after(done, Undo(ME)).model.body("3").mass == 1.0


def test_a_refused_edit_leaves_undo_and_redo_alone(state):
    state = after(state, typed("3", "mass", "2"), Undo(ME))
    refused = after(state, typed("3", "mass", "-2"))
    assert (refused.undo, refused.redo) == (state.undo, state.redo)


# -- runs --------------------------------------------------------------------------------------


def test_a_run_is_asked_for_once_and_comes_back(state):
    asked = after(state, Simulate(ME))
    assert asked.job is not None
    assert after(asked, Simulate(OTHER)) is asked
    assert after(asked, Progress(1, 0.5)).job.fraction == 0.5  # type: ignore[union-attr]
    done = after(asked, Simulated(1, result()))
    assert done.job is None
    assert done.t_end == 1.0


def test_a_stale_result_is_dropped(state):
    cancelled = after(state, Simulate(ME), Cancel(ME))
    assert cancelled.job is None
    assert after(cancelled, Simulated(1, result())) is cancelled
    again = after(cancelled, Simulate(ME))
    for stale in (Simulated(1, result()), Progress(1, 0.9), Failed(1, "no")):
        assert after(again, stale) is again


def test_a_failed_run_says_why_and_the_page_goes_on(state):
    failed = after(state, Simulate(ME), Failed(1, "the step fell below 1e-12 s"))
    assert failed.job is None
    assert failed.run_problem == "the step fell below 1e-12 s"
    assert after(failed, Simulate(ME)).run_problem == ""


def test_a_run_belongs_to_the_model_it_was_asked_for(ran):
    edited = after(ran, typed("3", "mass", "2"))
    assert edited.run is None
    assert after(edited, Undo(ME)).run is ran.last_run


def test_a_model_changed_meanwhile_is_said(state):
    state = after(state, Simulate(ME), typed("3", "mass", "2"))
    done = after(state, Simulated(1, result()))
    assert done.run is None
    assert "undo" in done.run_problem
    assert after(done, Undo(ME)).run is not None


@pytest.mark.parametrize(
    ("field", "text", "said"),
    [
        ("t_end", "0", "above 0"),
        ("step", "-1", "above 0"),
        ("t_end", "1e9", "at most"),
        ("step", "fast", "must be a number"),
        ("method", "magic", "one of"),
    ],
)
def test_a_refused_setting_says_why(state, field, text, said):
    refused = after(state, SetRun(ME, 1, field, text))
    assert refused.request == state.request
    assert refused.clients[ME].reply is not None
    assert said in refused.clients[ME].reply.text


def test_settings_and_scenarios(state):
    state = after(state, SetRun(ME, 1, "t_end", "0.5"), SetRun(ME, 2, "method", "rk4"))
    assert state.request == Request(FREE_RUN, 0.5, 1e-3, "rk4")
    assert after(state, SetScenario(ME, 1, "no such")).request == state.request
    assert after(state, SetScenario(ME, 1, FREE_RUN)).request == Request()


@pytest.mark.parametrize(
    ("settings", "step", "rtol", "acts"),
    [
        ({"method": "rk4"}, 1e-3, None, (True, False)),  # a step, and no tolerance
        ({"rtol": "1e-7", "method": "rk4"}, 1e-3, None, (True, False)),
        ({"method": "radau5"}, None, None, (True, True)),  # chosen by the error
        ({"method": "radau5", "rtol": "1e-7"}, None, 1e-7, (True, True)),
        ({"method": "radau5", "rtol": "1e-7", "step": "0.1"}, 0.1, 1e-7, (True, True)),
        ({"method": "dopri5", "step": "0.1"}, 0.1, None, (True, True)),
        ({"method": "dopri5", "rtol": "1e-7", "step": ""}, None, 1e-7, (True, True)),
        ({"rtol": "1e-7"}, 1e-3, 1e-7, (True, True)),  # automatic takes either
    ],
)
def test_a_method_is_asked_for_what_it_takes(state, settings, step, rtol, acts):
    events = [SetRun(ME, k, field, text) for k, (field, text) in enumerate(settings.items())]
    state = after(state, *events)
    assert (state.request.step, state.request.rtol) == (step, rtol)
    told = hints(state.request)
    assert (told["step"][2], told["rtol"][2]) == acts
    assert ("not used" in told["rtol"][0]) == (settings == {"method": "dopri5", "step": "0.1"})
    model = pg.Model.serial(1)
    done = pg.simulate(model, t_end=0.01, step=step, rtol=rtol, method=state.request.method)
    assert done.status.ok


def test_what_a_run_asks_for_otherwise_than_its_scenario_is_told():
    scenario = pg.Scenario(name="short", t_end=0.25, step=1e-3, method="rk4")
    model = pg.Model.serial(2).replace(scenarios=(scenario,))
    state = after(initial(model), Connected(ME), SetScenario(ME, 1, "short"))
    assert kept(state) == ""
    changed = after(state, SetRun(ME, 2, "t_end", "3"))
    assert "'short' keeps 0.25 s" in kept(changed)
    assert changed.model.scenarios == (scenario,)
    assert kept(after(changed, SetRun(ME, 3, "t_end", "0.25"))) == ""


@pytest.mark.parametrize(
    ("method", "drift", "good", "said"),
    [
        ("moreau_jean", 0.09, True, ": usual for a method of first order; a smaller step"),
        ("moreau_jean", 0.3, False, ": above 0.2; a smaller step"),
        ("moreau_jean", 0.001, True, "of its range"),
        ("rk4", 0.09, False, ": above 0.01; a smaller step"),
        ("radau5", 0.001, True, "of its range"),
    ],
)
def test_a_drift_is_bad_where_it_is_for_its_method(method, drift, good, said):
    result = SimpleNamespace(
        energy_drift=drift, error_estimate=drift, accuracy=f"{drift} rad", message="done",
        status=pg.Status.DONE, header={"method": method}, counters={}, timing={},
        notices=(), constraint_drift=(),
    )  # fmt: skip
    lines = {line[0]: line[1:] for line in summary(Run(pg.Model.serial(1), Request(), result))}
    for what in ("Energy drift", "Error estimate"):
        text, fine = lines[what]
        assert fine == good
        assert said in text or "rad" in text
    assert said in lines["Energy drift"][0]


def test_a_model_s_scenario_brings_its_settings():
    scenario = pg.Scenario(name="short", t_end=0.25, step=1e-3, method="rk4")
    model = pg.Model.serial(2).replace(scenarios=(scenario,))
    state = after(initial(model), Connected(ME), SetScenario(ME, 1, FREE_RUN))
    assert state.request.scenario == FREE_RUN
    state = after(state, SetScenario(ME, 1, "short"))
    assert state.request == Request("short", 0.25, 1e-3, "rk4")
    assert after(state, NewModel(ME, 1, "3")).request.scenario == FREE_RUN


def test_kernels_report_and_become_ready(state):
    compiling = after(state, Compiling(2, 5, "step")).kernels
    assert (compiling.done, compiling.total, compiling.ready) == (2, 5, False)
    assert after(state, Compiled("no compiler")).kernels.problem == "no compiler"


# -- playback ----------------------------------------------------------------------------------


def test_without_a_run_there_is_nothing_to_play(state):
    assert after(state, Play(ME)) is state
    assert after(state, Tick(0.1)) is state


def test_playing_moves_with_the_clock_and_the_speed(ran):
    state = after(ran, Play(ME), Tick(0.1), Speed(ME, 2.0), Tick(0.1))
    assert state.playback.time == pytest.approx(0.3)
    positions, wxyz = poses(state)
    assert positions[:, 0] == pytest.approx(0.3)
    assert np.linalg.norm(wxyz, axis=1) == pytest.approx(1.0)
    assert after(state, Pause(ME), Tick(0.1)).playback.time == pytest.approx(0.3)


def test_the_end_loops_or_stops(ran):
    playing = after(ran, Play(ME), Scrub(ME, 0.95))
    assert after(playing, Tick(0.1)).playback.time == pytest.approx(0.05)
    stopped = after(playing, Loop(ME, False), Tick(0.1)).playback
    assert (stopped.time, stopped.playing) == (1.0, False)
    ended = after(playing, Loop(ME, False), Tick(0.1), Play(ME))
    assert ended.playback.time == 0.0


def test_scrubbing_stays_within_the_run_and_steps_are_frames(ran):
    assert after(ran, Scrub(ME, 7.0)).playback.time == 1.0
    assert after(ran, Scrub(ME, -7.0)).playback.time == 0.0
    stepped = after(ran, Scrub(ME, 0.5), StepFrames(ME, 1)).playback
    assert stepped.time == pytest.approx(0.6)
    assert after(ran, StepFrames(ME, -1)).playback.time == 0.0


def test_poses_between_frames_take_the_short_way_round():
    pose = np.zeros((2, 1, 7))
    pose[0, 0, 3], pose[1, 0, 3] = 1.0, -1.0  # the same orientation, written with either sign
    _, wxyz = between(np.array([0.0, 1.0]), pose, 0.5)
    assert abs(wxyz[0, 0]) == pytest.approx(1.0)


def test_a_single_frame_is_shown_as_it_is():
    pose = np.zeros((1, 2, 7))
    pose[..., 3] = 1.0
    positions, _ = between(np.array([0.0]), pose, 3.0)
    assert positions.shape == (2, 3)


# -- the page's messages -----------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "",
        "null",
        "[]",
        '{"event": "Connected"}',
        '{"event": "Tick", "dt": 1}',
        '{"event": "Select"}',
        '{"event": "Select", "body": 5}',
        '{"event": "Select", "body": "a", "more": 1}',
        '{"event": "Edit", "serial": 1, "body": "a", "field": "bodies", "index": [], "text": ""}',
        '{"event": "Edit", "serial": 1, "body": "a", "field": "com", "index": [-1], "text": ""}',
        '{"event": "Scrub", "time": NaN}',
        '{"event": "Speed", "speed": 1e9}',
        '{"event": "Show", "what": "everything", "on": true}',
        "[" * 100_000,
    ],
)
def test_what_is_no_event_is_misread(text):
    assert isinstance(from_page(ME, text), Misread)


def test_a_page_cannot_speak_for_another():
    event = from_page(ME, '{"event": "Undo", "client": 2}')
    assert event == Undo(ME)


def test_what_is_an_event_is_read():
    text = '{"event":"Edit","serial":3,"body":"a","field":"inertia","index":[0,1],"text":"1"}  '
    assert from_page(ME, text) == Edit(ME, 3, "a", "inertia", (0, 1), "1")


def test_update_leaves_the_old_state_as_it_was(state):
    before = replace(state)
    after(state, typed("3", "mass", "2"), Select(ME, "3"), Simulate(ME))
    assert state == before


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


def test_another_model_takes_what_was_said_of_the_last_run_away(state):
    cancelled = after(state, Simulate(ME), Cancel(ME))
    assert cancelled.run_problem
    assert after(cancelled, OpenBuiltIn(ME, "serial")).run_problem == ""


def test_a_model_opened_again_starts_anew(ran):
    again = after(ran, OpenText(ME, "same", ran.model.to_json()))
    assert again.model.to_json() == ran.model.to_json()
    assert again.run is None
    assert len(again.undo) == len(ran.undo) + 1


def test_a_long_file_is_read_as_an_errand_and_a_bad_one_is_refused_there(state):
    """So that other pages do not wait; small files open within the event."""
    from pgraph_app.model.update import LONG, OpenText
    from pgraph_app.model.worker import answer

    good = pg.Model.serial(3).to_json()
    for text, opens in ((good, True), (good.replace('"1"', "1"), False)):
        sent = after(state, OpenText(ME, "long", text + " " * LONG))
        (errand,) = sent.errands
        now = after(sent, answer(errand))
        assert (len(now.model.bodies) == 3) is opens
        notice = now.clients[ME].notice
        assert notice is not None
        assert notice.bad is not opens


def test_a_rename_and_a_colour_keep_the_run_and_where_it_plays(ran):
    moved = after(ran, Scrub(ME, 0.4))
    renamed = after(moved, typed("3", "name", "knee"))
    assert renamed.run is not None
    assert renamed.playback.time == 0.4
    assert after(renamed, Undo(ME)).run is not None
    drawn = pg.Shape(kind="sphere", radius=0.1, role="visual", colour="#ff0000")
    looks = edit.with_model(moved, moved.model.edit("3", shape=drawn), "look")
    assert looks.run is not None
    touching = pg.Shape(kind="sphere", radius=0.1)
    assert edit.with_model(moved, moved.model.edit("3", shape=touching), "shape").run is None


def test_a_run_of_an_earlier_model_is_kept_and_said_until_another_model_is_opened(ran):
    edited = after(ran, typed("3", "mass", "2"))
    assert edited.earlier is ran.last_run
    assert edited.plotted is ran.last_run
    assert after(edited, Undo(ME)).earlier is None
    assert after(edited, OpenBuiltIn(ME, "serial")).plotted is None


def test_news_of_the_server_that_waits_is_drawn_once_and_what_a_person_does_comes_between(state):
    drawn, gate = [], threading.Event()

    class Watch:
        def render(self, old, new):
            drawn.append((new.jobs, new.framed))

    def slowly(state, event):
        gate.wait()
        part = "framed" if isinstance(event, Select) else "jobs"
        return replace(state, **{part: getattr(state, part) + 1})

    store = Store(state, slowly)
    store.start([Watch()])
    for _ in range(200):
        store.send(Progress(1, 0.5))
    store.send(Select(ME, None))
    gate.set()
    store.stop()
    assert (store.state.jobs, store.state.framed) == (200, 1)
    assert len(drawn) <= 4  # at first, what was under way, what waited, the person's
    assert drawn.index(next(x for x in drawn if x[1])) <= 3


def test_a_view_that_failed_draws_next_time_what_it_left_out(state):
    seen, fails = [], [True]

    class Fails:
        def render(self, old, new):
            if new.jobs and fails and fails.pop():
                raise RuntimeError
            seen.append((old.jobs, new.jobs))

    store = Store(state, lambda state, event: replace(state, jobs=state.jobs + 1))
    store.start([Fails()])
    store.send(Select(ME, None))
    store.send(Select(ME, None))
    store.stop()
    assert seen == [(0, 0), (0, 2)]


@pytest.mark.parametrize(
    "event", [NewModel(ME, 1, "3"), OpenText(ME, "a", pg.Model.serial(2).to_json())]
)
def test_nothing_of_a_model_stays_with_another_one(ran, event):
    state = after(ran, Compare(ME), Select(ME, "1"), SetGizmo(ME, "com"))
    state = with_client(state, ME, plots=(("position", "1"),))
    state = replace(state, report=Report("precision", state.model, None))
    state = update(state, event)
    page = state.clients[ME]
    assert state.ghost is state.report is state.run is state.plotted is None
    assert (page.selection, page.selected, page.gizmo, page.plots) == (None, (), "", ())


def test_a_unit_of_another_quantity_is_named():
    with pytest.raises(cells.Refusal, match=r"is a length.*deg is the unit of an angle"):
        cells.quantity("15 deg", "length", cells.Display())
    with pytest.raises(cells.Refusal, match=r"is an angle.*mm is the unit of a length"):
        cells.quantity("3 mm", "angle", cells.Display())


def test_a_pose_is_typed_in_degrees_and_millimetres():
    model = pg.Model.serial(2).edit("2", joint="prismatic")
    state = after(initial(model), Connected(ME))
    state = after(state, MoveJoint(ME, 1, "1", 0, "-90 deg"))
    assert state.posed.q[0] == pytest.approx(-np.pi / 2)
    state = after(state, MoveJoint(ME, 2, "2", 0, "5 mm"))
    assert state.posed.q[1] == pytest.approx(0.005)


def test_rounding_errors_of_an_inertia_read_zero():
    rows = ((2.0, 3.9e-17, 0.0), (3.9e-17, 1e-6, "=a"), (0.0, "=a", 3.0))
    assert without_noise(rows) == [[2.0, 0.0, 0.0], [0.0, 1e-6, "=a"], [0.0, "=a", 3.0]]
