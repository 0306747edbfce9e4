"""What the views send is plain JSON, with and without a run."""

from __future__ import annotations

import json
from functools import partial

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.core.state import initial
from pgraph_app.digraph.view import digraph
from pgraph_app.features import update
from pgraph_app.model.view import toolbar
from pgraph_app.playback.view import playback
from pgraph_app.properties.view import properties
from pgraph_app.run.update import Compare, Simulate, Simulated
from pgraph_app.run.view import compared, run
from pgraph_app.session.update import Connected
from pgraph_app.table.view import table

pytestmark = pytest.mark.fast


@pytest.fixture
def state(quadruped):
    return update(initial(quadruped), Connected(1))


@pytest.fixture
def ran(state):
    """The state after a hundredth of a second of stance."""
    mech = pg.Mechanism(state.model)
    result = pg.simulate(mech, scenario="stance", t_end=0.01)
    return update(update(state, Simulate(1)), Simulated(1, result))


@pytest.mark.parametrize("view", [table, digraph, playback, partial(toolbar, client=1), run])
def test_payloads_are_json(state, view):
    assert json.loads(json.dumps(view(state), allow_nan=False))


@pytest.mark.parametrize("view", [playback, run])
def test_payloads_of_a_run_are_json(ran, view):
    assert json.loads(json.dumps(view(ran), allow_nan=False))


def test_the_summary_says_how_a_run_ended_how_well_and_at_what_cost(ran):
    lines = {what: value for what, value, _ in run(ran)["summary"]}
    assert {"Status", "Energy drift", "Constraint drift", "Cost", "Method"} <= set(lines)


def test_two_runs_are_compared_in_numbers():
    ball = pg.Body(name="ball", mass=2.0, joint="free", v=(0, 0, 0, 3.0, 0, 4.0))
    model = pg.Model(bodies=(ball,), gravity=(0, 0, 0), up="z")
    state = update(initial(model), Connected(1))
    for t_end in (2.0, 1.0):  # 4 m/s along the vertical are no distance
        state = update(state, Simulate(1))
        state = update(state, Simulated(state.jobs, pg.simulate(model, t_end=t_end, step=0.1)))
        assert bool(run(state)["compared"]) == (t_end == 1.0)
        state = update(state, Compare(1)) if state.ghost is None else state
    ghost, state = state.ghost, update(state, Compare(1))
    assert state.ghost is None
    said = {what: (one, other) for what, one, other in compared(ghost, state.run)}
    assert said["distance"] == ("6 m", "3 m")
    assert said["mean speed"] == ("3 m/s", "3 m/s")
    assert said["duration"] == ("2 s", "1 s")


@pytest.mark.parametrize("joint", pg.Body.model_fields["joint"].annotation.__args__)
def test_every_kind_of_joint_has_all_its_numbers_in_cells(joint):
    state = initial(pg.Model.serial(2).edit("2", joint=joint))
    body = state.model.body("2")
    sent = {}
    for group in properties(state, ("2",))["groups"]:
        for field in group["fields"]:
            sent.setdefault(field["field"], []).extend(cell["value"] for cell in field["cells"])
    for name in ("axes", "link", "rotation", "com", "inertia", "q", "v", "damping"):
        expected = np.ravel(getattr(body, name)).tolist()
        assert sent.get(name, []) == expected


def test_nobody_selected_gives_the_model(state):
    assert properties(state, ())["bodies"] == []
    assert properties(state, ("gone",))["bodies"] == []


def test_what_has_no_body_cannot_be_run_and_says_so(state):
    bare = initial(pg.Model(bodies=()))
    assert (run(bare)["empty"], playback(bare)["blocked"]) == (True, True)
    assert "add one" in playback(bare)["hint"]
    assert (run(state)["empty"], playback(state)["blocked"]) == (False, False)
    assert "simulates first" in playback(state)["hint"]
