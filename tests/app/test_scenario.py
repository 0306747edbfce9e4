"""The scenario editor: its events, and its switches in a run."""

from dataclasses import replace

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.core.cells import Display
from pgraph_app.run import Run
from pgraph_app.scenario import conditions
from pgraph_app.scenario.view import events, scenario

from . import store
from .store import ME, begun, do, notice


def after(state, *happened):
    """Return the state after these events, none of which is refused."""
    for event in happened:
        state = store.after(state, event)
        said = state.clients[ME].reply
        assert said is None or not said.text, said
    return state


@pytest.fixture
def slider():
    """Return 2 kg on a rail along x at 3 m/s without gravity, with two points that may hold it."""
    body = pg.Body(name="b", joint="prismatic", axes=((1, 0, 0),), mass=2.0, v=(3.0,))
    held = tuple(
        pg.Constraint(name=n, kind="point", body="b", active=False) for n in ("lock", "other")
    )
    return begun(pg.Model(bodies=(body,), constraints=held, gravity=(0.0, 0.0, 0.0)))


INDEX = {"constraint": (0,), "active": (1,), "side": (0,), "value": (1,)}


def switch(number, **fields):
    """Return the events that set cells of a switch, by what they hold."""
    return [cell(number, field, text) for field, text in fields.items()]


def cell(number, field, text, *index):
    name = {"active": "constraint"}.get(field, field)
    return do.EditSwitch(ME, 1, number, name, ((index or INDEX.get(field, ()), text),))


def given(field, text, *index):
    return do.EditScenario(ME, 2, field, ((index, text),))


def lasting(t_end):
    return do.SetRun(ME, 4, "t_end", t_end), do.KeepSettings(ME)


def motor(torque):
    drive = do.EditDrive(ME, 3, "motor", "torque", (((), torque),))
    return [do.AddDrive(ME, "motor", "b"), drive, given("bodies", "b"), given("v", "0", 0, 0)]


def run_of(state):
    state = after(state, do.Simulate(ME))
    assert state.job is not None, state.run_problem
    return state.job.work(lambda _: 1)


def test_a_scenario_is_made_named_set_copied_and_taken_away(slider):
    state = after(slider, do.NewScenario(ME), given("name", "throw"))
    assert (state.request.scenario, [s.name for s in state.model.scenarios]) == ("throw", ["throw"])
    state = after(state, given("bodies", "b"), given("v", "1.5", 0, 0), *lasting("3/2"))
    assert (state.request.t_end, state.model.scenario("throw").v) == (1.5, {"b": (1.5,)})
    assert run_of(state).q[-1, 0] == pytest.approx(1.5 * 1.5)
    copied = after(state, do.CopyScenario(ME))
    assert copied.request.scenario == "throw_2"
    left = after(copied, do.DeleteScenario(ME))
    assert left.request.scenario == "throw"
    assert after(left, do.DeleteScenario(ME)).model.scenarios == ()
    assert after(copied, do.Undo(ME)).model == state.model
    bare = store.after(begun(pg.Model.serial(2)), do.AddSwitch(ME, None))
    assert "constraint" in notice(bare)  # there is nothing to switch


def test_all_scenarios_are_listed_with_the_one_that_is_edited(slider):
    state = after(slider, do.NewScenario(ME), given("name", "throw"), do.NewScenario(ME))
    shown = scenario(state, Display())
    number = state.rows.named(state.model, "scenarios")
    assert {s["name"]: s["number"] for s in shown["scenarios"][:-1]} == number
    assert [*number] == ["throw", state.request.scenario]
    assert shown["name"] == state.request.scenario
    assert (shown["start"], shown["held"]) == ([], [])
    started = scenario(after(state, given("bodies", "b")), Display())
    assert started["held"] == ["b"]
    free = scenario(after(state, do.SetScenario(ME, 5, "")), Display())
    assert free["none"]
    assert free["scenarios"][-1]["value"] == free["name"] == ""
    assert [s["length"] for s in free["scenarios"]] == ["2 s", "2 s", ""]


def test_a_renamed_scenario_keeps_its_row(slider):
    """Its number changed with its name, so that what was sent for it meanwhile was refused."""
    state = after(slider, do.NewScenario(ME), do.NewScenario(ME))
    number = scenario(state, Display())["id"]
    state = after(state, do.EditScenario(ME, 1, "name", (((), "throw"),), scenario=number))
    assert scenario(state, Display())["id"] == number
    late = after(state, do.EditScenario(ME, 2, "bodies", (((), "b"),), scenario=number))
    assert [*late.model.scenario("throw").q] == ["b"]


def test_the_pose_that_is_shown_starts_a_scenario(slider):
    state = store.ran(slider, run_of(slider))
    state = replace(after(state, do.Scrub(ME, 1.0), do.NewScenario(ME)), posed=None)
    state = replace(state, last_run=replace(state.last_run, model=state.model))
    taken = after(state, do.Scrub(ME, 1.0), do.TakePose(ME, True))
    s = taken.model.scenarios[0]
    assert (s.q["b"][0], s.v["b"][0]) == pytest.approx((3.0, 3.0))
    assert after(taken, do.TakePose(ME, False)).model.scenarios[0].q == {}


def test_a_force_of_a_scenario_acts_in_it_alone(slider):
    state = after(slider, do.NewScenario(ME), *motor("4")[:2])
    assert state.model.forces == ()
    assert run_of(state).q[-1, 0] == pytest.approx(3 * 2 + 4 / 2 * 2**2 / 2)
    assert scenario(state, Display())["drives"][0]["name"] == "motor"
    assert after(state, do.DeleteDrive(ME, "motor")).model.scenarios[0].forces == ()


def test_a_cut_at_a_time(slider):
    """Held at rest under 4 N and let go at 0.8 s: s = a t² / 2 from there."""
    state = after(slider, do.AddSwitch(ME, "lock"), *switch(0, active="off", value="0.8"))
    run = run_of(after(state, given("constraints", "on", 0), *motor("4")))
    np.testing.assert_allclose(run.q[-1, 0], 4 / 2 * (2 - 0.8) ** 2 / 2, rtol=0, atol=1e-9)
    assert [(e.t, e.contact, e.after) for e in run.events] == [(0.8, "lock", "off")]


def test_a_latch_opens_at_a_force(slider):
    """50 N are reached at 0.5 s under 100 N/s. Then a = 50 t."""
    state = after(slider, do.NewScenario(ME), given("constraints", "on", 0))
    state = after(state, do.AddSwitch(ME, "lock"), *switch(0, what="force"), *lasting("1"))
    state = after(state, *motor("0 0; 1 100"))
    assert str(state.model.scenarios[0].switches[0].when) == "force of lock above 50"
    run, a = run_of(state), 0.5
    exact = 50 / 6 * (1 - a**3) - 50 / 2 * a**2 * (1 - a)
    np.testing.assert_allclose(run.events[0].t, a, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.q[-1, 0], exact, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    ("when", "said"),
    [("touches", "gap of k below 0"), ("leaves", "gap of k above 0"),
     ("passes", "coordinate of b above 0.1"), ("exceeds", "force of k above 50")],
)  # fmt: skip
def test_what_a_body_does_switches_a_constraint(slider, when, said):
    """A click on a body and on what it does, and a constraint of that body changes over."""
    refused = after(slider, do.AddSwitch(ME, None, body="b", when="touches"))
    assert "'b'" in notice(refused)
    model = slider.model.add(pg.Contact(name="k", body="b", points=((0, 0, 0),)))
    state = after(begun(model), do.AddSwitch(ME, None, body="b", when=when))
    (switch,) = state.model.scenarios[0].switches
    assert (switch.constraint, str(switch.when)) == ("lock", said)
    (again,) = after(state, do.Undo(ME)).model.scenarios
    assert again.switches == ()


def test_a_foot_sticks_at_a_gap():
    """A ball that falls from 1 m is held 0.25 m above the ground, after √(2 · 0.65 / g)."""
    sphere = {"kind": "sphere", "radius": 0.1}
    ball = pg.Body(name="ball", joint="prismatic", axes=((0, 0, 1),), q=(1.0,), shape=sphere)
    model = pg.Model(
        bodies=(ball,), contacts=(pg.Contact(name="floor", body="ball"),),
        constraints=(pg.Constraint(name="foot", kind="point", body="ball", active=False),),
    )  # fmt: skip
    state = after(begun(model), do.AddSwitch(ME, "foot"), *switch(0, what="gap", value="250 mm"))
    run = run_of(state)
    np.testing.assert_allclose(run.q[-1, 0], 0.35, rtol=0, atol=1e-6)
    g = -model.gravity[2]
    stuck = next(e for e in run.events if e.contact == "foot")
    np.testing.assert_allclose(stuck.t, np.sqrt(2 * 0.65 / g), rtol=0, atol=1e-6)


def test_a_constraint_waits_for_another(slider):
    """The second goes on where the first does, at 1.5 m."""
    state = after(slider, do.AddSwitch(ME, "lock"), *switch(0, what="coordinate", value="1.5"))
    state = after(state, do.AddSwitch(ME, "other"), *switch(1, what="constraint"))
    run = run_of(state)
    assert [(e.contact, e.after) for e in run.events] == [("lock", "on"), ("other", "on")]
    np.testing.assert_allclose(run.q[-1, 0], 1.5, rtol=0, atol=1e-9)
    shown = replace(state, last_run=Run(state.model, state.request, run))
    log = events(shown)
    assert [line["part"] for line in log] == ["lock", "other"]
    left = after(state, do.DeleteSwitch(ME, 1), do.DeleteSwitch(ME, 0))
    assert left.model.scenarios[0].switches == ()


def test_a_slider_is_caught_for_half_a_second(slider):
    """What goes on may wait for itself: the page refused it, as there was no other constraint."""
    state = after(slider, do.AddSwitch(ME, "lock"), *switch(0, what="coordinate", value="1.2"))
    state = after(state, do.AddSwitch(ME, "lock"), *switch(1, what="constraint"))
    assert condition(state, 1) == "constraint lock active for 0.2 s"  # a tenth of the run
    run = run_of(after(state, cell(1, "after", "0.5")))
    assert [(e.contact, e.after) for e in run.events][:2] == [("lock", "on"), ("lock", "off")]
    assert run.events[1].t - run.events[0].t == pytest.approx(0.5, abs=1e-9)
    alone = store.after(slider, do.AddSwitch(ME, "lock"), *switch(0, what="constraint"))
    assert "switch" in store.reply(alone)


def condition(state, number=0):
    return str(state.model.scenarios[0].switches[number].when)


def test_a_slider_is_caught_where_it_is_fast_and_another_follows_after_a_time(slider):
    """At 3 m/s it is caught at 1.2 m, after 0.4 s. 0.5 s later the other constraint goes on."""
    state = after(slider, do.AddSwitch(ME, "lock"), *switch(0, what="holds"))
    state = after(state, cell(0, "clause", "1200 mm", 0, 2), cell(0, "and", ""))
    state = after(state, cell(0, "clause", "2", 1, 2))
    assert condition(state) == "q.b > 1.2 and v.b > 2.0"
    state = after(state, do.AddSwitch(ME, "other"), *switch(1, what="constraint"))
    state = after(state, cell(1, "after", "0.5"))
    assert condition(state, 1) == "constraint lock active for 0.5 s"
    assert pg.Model.from_json(state.model.to_json()) == state.model
    run = run_of(after(state, *lasting("2")))
    assert [(e.contact, e.after) for e in run.events] == [("lock", "on"), ("other", "on")]
    np.testing.assert_allclose([e.t for e in run.events], [0.4, 0.9], rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.q[-1, 0], 1.2, rtol=0, atol=1e-9)


def test_a_switch_that_acts_once_stays_so_while_its_condition_is_edited(slider):
    state = after(slider, do.AddSwitch(ME, "lock"), *switch(0, what="coordinate", value="1.5"))
    for event in switch(0, once="once", value="1.25"):
        state = after(state, event)
    (made,) = state.model.scenarios[0].switches
    assert (made.when.once, made.when.above) == (True, 1.25)
    state = after(state, cell(0, "once", ""))
    assert not state.model.scenarios[0].switches[0].when.once


def test_comparisons_are_joined_turned_and_taken_out_by_clicks(slider):
    state = after(slider, do.AddSwitch(ME, "lock"), *switch(0, what="coordinate", value="1.5"))
    steps = [
        (cell(0, "or", ""), "q.b > 1.5 or v.b > 0.0"),
        (cell(0, "not", "", 1), "q.b > 1.5 or not v.b > 0.0"),
        (cell(0, "clause", "below", 1, 1), "q.b > 1.5 or not v.b < 0.0"),
        (cell(0, "clause", "t", 0, 0), "t > 1.5 or not v.b < 0.0"),
        (cell(0, "or", ""), "t > 1.5 or not v.b < 0.0 or v.b > 0.0"),
        (cell(0, "less", "", 1), "t > 1.5 or v.b > 0.0"),
        (cell(0, "holds", "=q.b > 1 and (t > 1 or v.b < 0)"), "q.b > 1 and (t > 1 or v.b < 0)"),
    ]
    for event, said in steps:
        state = after(state, event)
        assert condition(state) == said
    rows = conditions.form(state.model, state.model.scenarios[0].switches[0], Display())
    assert "clause" not in [row["field"] for row in rows]  # it is no single chain
    back = after(state, *[do.Undo(ME)] * len(steps))
    assert condition(back) == "coordinate of b above 1.5"


@pytest.mark.parametrize(
    ("what", "sign"), [("coordinate", 1), ("coordinate", -1), ("force", 1), ("holds", 1)]
)
def test_two_switches_are_a_hysteresis(slider, what, sign):
    state = after(slider, do.AddSwitch(ME, "lock"), given("constraints", "on", 1))
    state = after(state, *switch(0, what=what))
    if what == "holds":
        first = state.model.scenarios[0].switches[0]
        said = store.update(state, cell(0, "back", "")).clients[ME].reply.text
        assert said
        assert state.model.scenarios[0].switches == (first,)
        return
    state = after(state, *switch(0, value=str(10.0 * sign)), cell(0, "back", ""))
    there, back = state.model.scenarios[0].switches
    assert (there.active, back.active) == (True, False)
    assert there.when.above == 10.0 * sign
    assert back.when.below == pytest.approx(10 * sign - 2)
    assert (
        there.when.subject == {"force": ("force", "other"), "coordinate": ("coordinate", "b")}[what]
    )
    assert (there.constraint, there.when.subject) == (back.constraint, back.when.subject)


@pytest.mark.parametrize(
    ("event", "parts"),
    [
        (cell(0, "clause", "fast", 0, 2), ("fast",)),
        (cell(0, "clause", "3 kg", 0, 2), ("length", "kg")),
        (cell(0, "clause", "q.gone", 0, 0), ("gone",)),
        (cell(0, "clause", "1", 7, 2), ("comparison",)),
        (cell(0, "holds", "=q.b"), ("compare",)),
        (cell(0, "holds", "=q.b > v.b"), ("fit",)),
        (cell(0, "holds", "= > "), ("column",)),
        (cell(0, "holds", "x" * 20_000), ("=",)),
        (cell(0, "rest", ""), ("field",)),
        (cell(0, "after", "2"), ("after",)),
    ],
)
def test_a_condition_that_cannot_be_is_refused_beside_its_cell(slider, event, parts):
    state = after(slider, do.AddSwitch(ME, "lock"), *switch(0, what="holds"))
    refused = store.update(state, event)
    assert all(part in store.reply(refused) for part in parts), store.reply(refused)
    assert refused.model is state.model


@pytest.mark.parametrize(
    "hand", [do.Download(ME), do.ShareLink(ME), do.Save(ME, 1, "/nowhere/model.json")]
)
@pytest.mark.parametrize("scenario", [None, pg.Scenario(name="short", t_end=0.25)])
def test_a_model_that_is_handed_over_has_the_settings_of_its_run(hand, scenario):
    """The duration and method of a free run were not in the file, whose reader ran 2 s."""
    model = pg.Model.serial(2).replace(scenarios=filter(None, [scenario]))
    state = after(begun(model), do.SetRun(ME, 1, "t_end", "25"), do.SetRun(ME, 2, "method", "rk4"))
    state = after(state, do.Simulate(ME))
    state = after(state, do.Done(state.job.id, pg.simulate(model, t_end=0.1, step=1e-3)))
    assert not state.outdated
    given = after(state, hand)
    read = begun(pg.Model.from_json(given.model.to_json())).request
    assert (read.t_end, read.method) == (25.0, "rk4")
    assert read == given.request
    assert not given.outdated  # the run is still that of the page
    assert given.t_end == state.t_end
    assert given.model.scenarios[0].name in notice(given)
    assert after(given, do.Undo(ME)).model == model
    assert after(begun(model), hand).model is model
