"""The scenario editor: its events on the state, and what its switches do in a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.core.cells import Display
from pgraph_app.core.events import Event
from pgraph_app.core.state import Kernels, State, initial
from pgraph_app.features import update
from pgraph_app.model.update import Undo
from pgraph_app.playback.update import Scrub
from pgraph_app.run import Run
from pgraph_app.run.update import Simulate, Simulated
from pgraph_app.run.worker import simulated
from pgraph_app.scenario.update import (
    AddDrive,
    AddSwitch,
    CopyScenario,
    DeleteDrive,
    DeleteScenario,
    DeleteSwitch,
    EditDrive,
    EditScenario,
    EditSwitch,
    NewScenario,
    TakePose,
)
from pgraph_app.scenario.view import scenario
from pgraph_app.session.update import Connected

ME = 1


def after(state: State, *happened: Event) -> State:
    for event in happened:
        state = update(state, event)
        said = state.clients[ME].reply
        assert said is None or not said.text, said
    return state


def begun(model: pg.Model) -> State:
    return update(replace(initial(model), kernels=Kernels(ready=True)), Connected(ME))


@pytest.fixture
def slider() -> State:
    """2 kg on a rail along x at 3 m/s, without gravity; two points may hold it."""
    body = pg.Body(name="b", joint="prismatic", axes=((1, 0, 0),), mass=2.0, v=(3.0,))
    held = tuple(
        pg.Constraint(name=n, kind="point", body="b", active=False) for n in ("lock", "other")
    )
    return begun(pg.Model(bodies=(body,), constraints=held, gravity=(0.0, 0.0, 0.0)))


def typed(number: int, field: str, text: str) -> EditSwitch:
    return EditSwitch(ME, 1, number, field, text)


def ran(state: State) -> pg.Result:
    """What Simulate computes of the state."""
    state = update(state, Simulate(ME))
    assert state.job is not None, state.run_problem
    return simulated(state.job, lambda _: 1)


def test_a_scenario_is_made_named_set_copied_and_taken_away(slider):
    state = after(slider, NewScenario(ME), EditScenario(ME, 1, "name", (((), "throw"),)))
    assert (state.request.scenario, [s.name for s in state.model.scenarios]) == ("throw", ["throw"])
    state = after(
        state,
        EditScenario(ME, 2, "t_end", (((), "3/2"),)),
        EditScenario(ME, 3, "bodies", (((), "b"),)),
        EditScenario(ME, 4, "v", (((0, 0), "1.5"),)),
    )
    assert (state.request.t_end, state.model.scenario("throw").v) == (1.5, {"b": (1.5,)})
    assert ran(state).q[-1, 0] == pytest.approx(1.5 * 1.5)
    copied = after(state, CopyScenario(ME))
    assert copied.request.scenario == "throw 2"
    left = after(copied, DeleteScenario(ME))
    assert left.request.scenario == "throw"
    assert after(left, DeleteScenario(ME)).model.scenarios == ()
    assert update(copied, Undo(ME)).model == state.model


def test_the_pose_that_is_shown_starts_a_scenario(slider):
    state = update(slider, Simulate(ME))
    state = update(state, Simulated(state.job.id, simulated(state.job, lambda _: 1)))
    state = after(state, Scrub(ME, 1.0), NewScenario(ME))
    state = replace(state, posed=None)
    taken = after(replace(state, last_run=replace(state.last_run, model=state.model)),
                  Scrub(ME, 1.0), TakePose(ME, True))  # fmt: skip
    s = taken.model.scenarios[0]
    assert (s.q["b"][0], s.v["b"][0]) == pytest.approx((3.0, 3.0))
    assert after(taken, TakePose(ME, False)).model.scenarios[0].q == {}


def test_a_force_of_a_scenario_acts_in_it_alone(slider):
    state = after(slider, NewScenario(ME), AddDrive(ME, "motor", "b"))
    assert state.model.forces == ()
    state = after(state, EditDrive(ME, 1, "motor", "torque", (((), "4"),)))
    assert ran(state).q[-1, 0] == pytest.approx(3 * 2 + 4 / 2 * 2**2 / 2)
    assert scenario(state, Display())["drives"][0]["name"] == "motor"
    assert after(state, DeleteDrive(ME, "motor")).model.scenarios[0].forces == ()


# -- a conditional constraint of each kind against its closed form ---------------------------------


def test_a_cut_at_a_time(slider):
    """Held at rest under 4 N and let go at 0.8 s: s = a t² / 2 from there."""
    state = after(
        slider, AddSwitch(ME, "lock"), typed(0, "active", "off"), typed(0, "value", "0.8")
    )
    state = after(
        state,
        EditScenario(ME, 2, "constraints", (((0,), "on"),)),
        AddDrive(ME, "motor", "b"), EditDrive(ME, 3, "motor", "torque", (((), "4"),)),
        EditScenario(ME, 4, "bodies", (((), "b"),)), EditScenario(ME, 5, "v", (((0, 0), "0"),)),
    )  # fmt: skip
    run = ran(state)
    np.testing.assert_allclose(run.q[-1, 0], 4 / 2 * (2 - 0.8) ** 2 / 2, rtol=0, atol=1e-9)
    assert [(e.t, e.contact, e.after) for e in run.events] == [(0.8, "lock", "off")]


def test_a_latch_opens_at_a_force(slider):
    """50 N, reached at 0.5 s under 100 N/s; then a = 50 t."""
    state = after(
        slider,
        NewScenario(ME), EditScenario(ME, 1, "constraints", (((0,), "on"),)),
        AddSwitch(ME, "lock"), typed(0, "what", "force"),
        EditScenario(ME, 2, "t_end", (((), "1"),)),
        AddDrive(ME, "motor", "b"), EditDrive(ME, 3, "motor", "torque", (((), "0 0; 1 100"),)),
        EditScenario(ME, 4, "bodies", (((), "b"),)), EditScenario(ME, 5, "v", (((0, 0), "0"),)),
    )  # fmt: skip
    assert str(state.model.scenarios[0].switches[0].when) == "force of lock above 50"
    run, a = ran(state), 0.5
    exact = 50 / 6 * (1 - a**3) - 50 / 2 * a**2 * (1 - a)
    np.testing.assert_allclose(run.events[0].t, a, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.q[-1, 0], exact, rtol=0, atol=1e-8)


def test_a_clutch_engages_at_a_coordinate(slider):
    """Two discs of 1 and 2 kg m²; the first turns at 6 rad/s and grips at 3 rad: both then at 2."""
    inertia = np.diag([1.0, 1.0, 1.0])
    first = pg.Body(name="a", joint="revolute", axes=((1, 0, 0),), inertia=inertia, v=(6.0,))
    second = pg.Body(name="c", joint="revolute", axes=((1, 0, 0),), inertia=2 * inertia)
    clutch = pg.Constraint(
        name="clutch", kind="velocity", body="a", coefficients={"a": (1.0,), "c": (-1.0,)},
        active=False,
    )  # fmt: skip
    model = pg.Model(bodies=(first, second), constraints=(clutch,), gravity=(0.0, 0.0, 0.0))
    state = after(
        begun(model),
        AddSwitch(ME, "clutch"), typed(0, "what", "coordinate"), typed(0, "value", "3"),
    )  # fmt: skip
    run = ran(state)
    np.testing.assert_allclose(run.v[-1], 2.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(run.q[-1], [3 + 2 * 1.5, 2 * 1.5], rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.events[0].t, 0.5, rtol=0, atol=1e-9)


def test_a_foot_sticks_at_a_gap():
    """A ball that falls from 1 m is held 0.25 m above the ground, after √(2 · 0.65 / g)."""
    ball = pg.Body(
        name="ball", joint="prismatic", axes=((0, 0, 1),), q=(1.0,),
        shape={"kind": "sphere", "radius": 0.1},
    )  # fmt: skip
    model = pg.Model(
        bodies=(ball,), contacts=(pg.Contact(name="floor", body="ball"),),
        constraints=(pg.Constraint(name="foot", kind="point", body="ball", active=False),),
    )  # fmt: skip
    state = after(
        begun(model),
        AddSwitch(ME, "foot"), typed(0, "what", "gap"), typed(0, "value", "250 mm"),
    )  # fmt: skip
    run = ran(state)
    np.testing.assert_allclose(run.q[-1, 0], 0.35, rtol=0, atol=1e-6)
    g = -model.gravity[2]
    stuck = next(e for e in run.events if e.contact == "foot")
    np.testing.assert_allclose(stuck.t, np.sqrt(2 * 0.65 / g), rtol=0, atol=1e-6)


def test_a_constraint_waits_for_another(slider):
    """The second goes on where the first does, at 1.5 m."""
    state = after(
        slider,
        AddSwitch(ME, "lock"), typed(0, "what", "coordinate"), typed(0, "value", "1.5"),
        AddSwitch(ME, "other"), typed(1, "what", "constraint"),
    )  # fmt: skip
    run = ran(state)
    assert [(e.contact, e.after) for e in run.events] == [("lock", "on"), ("other", "on")]
    np.testing.assert_allclose(run.q[-1, 0], 1.5, rtol=0, atol=1e-9)
    shown = replace(state, last_run=Run(state.model, state.request, run))
    log = scenario(shown, Display())["events"]
    assert [line["text"] for line in log] == ["lock: off to on", "other: off to on"]
    assert after(state, DeleteSwitch(ME, 1), DeleteSwitch(ME, 0)).model.scenarios[0].switches == ()


@pytest.mark.parametrize(
    ("number", "field", "text", "says"),
    [
        (0, "value", "2", "The run ends at 2 s"),
        (0, "value", "-1", "t"),
        (0, "value", "soon", "The time must be a number"),
        (0, "what", "gap", "There is no contact to wait for"),
        (0, "what", "constraint", "No other constraint is switched"),
        (0, "constraint", "gone", "no constraint is named 'gone'"),
        (1, "value", "1", "taken out meanwhile"),
    ],
)
def test_switches_that_cannot_be_are_refused_beside_the_cell(slider, number, field, text, says):
    state = after(slider, AddSwitch(ME, "lock"))
    refused = update(state, typed(number, field, text))
    assert refused.model is state.model
    assert says in refused.clients[ME].reply.text


def test_without_a_constraint_there_is_nothing_to_switch(slider):
    state = begun(pg.Model.serial(2))
    assert "no constraint" in update(state, AddSwitch(ME, None)).clients[ME].notice.text
