"""Plots: what can be drawn of a run, and what is sent (interface 1.8)."""

from __future__ import annotations

import json

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.core.state import initial
from pgraph_app.features import update
from pgraph_app.gait.view import phases
from pgraph_app.plots import (
    KINDS,
    MANY,
    POINTS,
    POSES,
    Signal,
    components,
    curves,
    of_body,
    of_scene,
    of_several,
    strip,
    thinned,
    title,
    unit,
)
from pgraph_app.plots.update import Plot
from pgraph_app.plots.view import plots, signals
from pgraph_app.run.update import Compare, Simulate, Simulated
from pgraph_app.session.update import Connected
from pgraph_core.show.notebook import pictures
from pgraph_core.show.shapes import to_matrix

pytestmark = pytest.mark.fast

ME = 1


@pytest.fixture(scope="module")
def run(quadruped) -> pg.Result:
    return pg.simulate(pg.Mechanism(quadruped), scenario="stance", t_end=0.02)


def test_every_signal_of_a_body_is_its_column_of_the_result(run, quadruped):
    signals = {s.kind: curves(run, s) for s in of_body(quadruped, "left_tibia")}
    k = run.mechanism.topology.number("left_tibia") - 1
    assert signals["position"][1].y == run.body_pose[:, k, 1].tolist()
    assert signals["angular_acceleration"][2].y == run.body_acceleration[:, k, 2].tolist()
    assert signals["joint_torque"][2].y == run.joint_force[:, k, 2].tolist()
    assert [len(signals[kind]) for kind in ("q", "v", "vdot")] == [1, 1, 1]
    assert signals["q"][0].y == run.q[:, 6 + k].tolist()
    assert {len(c.t) for found in signals.values() for c in found} == {len(run.t)}


def test_signals_of_the_scene_are_what_it_has(run):
    found = of_scene(run)
    assert Signal("constraint_force", "left_hind_paw") in found
    assert not any(s.kind.startswith("contact") for s in found)
    force = curves(run, Signal("constraint_force", "left_hind_paw"))
    assert force[1].y == run.constraint_force["left_hind_paw"][:, 4].tolist()
    assert [c.label for c in curves(run, Signal("energy", ""))][2] == "total"


def test_a_signal_that_the_run_lacks_has_no_curves(run):
    assert curves(run, Signal("contact_gap", "nothing")) == []
    assert curves(run, Signal("position", "nobody")) == []


def test_titles_read_like_words():
    assert title(Signal("joint_torque", "knee")) == "joint torque of knee"
    assert title(Signal("constraint_force", "loop")) == "force of loop"
    assert title(Signal("energy", "")) == "energy"
    assert title(Signal("velocity.z", "knee\nankle")) == "velocity z of 2 bodies"
    assert all(kind.unit for name, kind in KINDS.items() if name != POSES)


def test_one_component_of_many_bodies_is_one_chart_as_figs_11_and_12(run):
    """Every body in one chart, in its own column of the run; the others' components on demand."""
    names = list(run.mechanism.names)
    signal = Signal("angular_acceleration.z", MANY.join(names))
    found = curves(run, signal)
    assert [curve.label for curve in found] == names
    for k, curve in enumerate(found):
        assert curve.y == run.body_acceleration[:, k, 2].tolist()
    assert components(run, signal) == ["x", "y", "z"]
    assert unit(run.mechanism.model, signal) == "rad/s²"
    assert of_several(run.mechanism.model, names[:2])[0].component == "1"


def test_six_poses_over_the_run_share_one_scale_as_fig_10(run):
    found = strip(run)
    assert [t for t, _ in found] == pytest.approx(np.linspace(run.t[0], run.t[-1], 6).tolist())
    alone = pictures(run.mechanism.model, *_tree(run), [_pose(run, 0)])[0]
    assert found[0][1].count("<polygon") == alone.count("<polygon") > 10
    assert found[0][1] != found[-1][1]


def _tree(run):
    top = run.mechanism.topology
    return tuple(top.parent.tolist()), tuple(top.names)


def _pose(run, frame):
    return run.body_pose[frame, :, :3], to_matrix(run.body_pose[frame, :, 3:])


@pytest.mark.parametrize(
    ("joint", "units"),
    [
        ("revolute", ("rad", "rad/s", "rad/s²")), ("prismatic", ("m", "m/s", "m/s²")),
        ("universal", ("rad", "rad/s", "rad/s²")), ("spherical", ("rad, m", "rad/s", "rad/s²")),
        ("cylindrical", ("rad, m", "rad/s, m/s", "rad/s², m/s²")),
    ],
)  # fmt: skip
def test_units_are_those_of_the_joint(joint, units):
    model = pg.Model(bodies=(pg.Body(name="a", joint=joint),))
    assert tuple(unit(model, Signal(kind, "a")) for kind in ("q", "v", "vdot")) == units
    assert unit(model, Signal("energy", "")) == "J"


def test_thinning_keeps_extremes_ends_and_order():
    t = np.linspace(0, 1, 100_000)
    y = np.sin(40 * t)
    y[54_321] = 9.0
    curve = thinned("", t, y)
    assert len(curve.t) <= 2 * POINTS + 2
    assert max(curve.y) == 9.0
    assert (curve.t[0], curve.t[-1]) == (0.0, 1.0)
    assert np.all(np.diff(curve.t) > 0)


def test_what_is_not_finite_is_left_out():
    assert thinned("", np.arange(3.0), np.array([1.0, np.inf, 2.0])).y == [1.0, 2.0]


def test_each_page_has_its_own_plots(run, quadruped):
    state = initial(quadruped)
    for event in (Connected(ME), Connected(2), Simulate(ME)):
        state = update(state, event)
    state = update(state, Simulated(1, run))
    state = update(state, Plot(ME, "energy", "", True))
    state = update(state, Plot(ME, "q", "left_tibia", True))
    assert update(state, Plot(ME, "nonsense", "", True)) is state
    assert state.clients[2].plots == ()
    sent = plots(state, state.clients[ME])["charts"]
    assert [c["title"] for c in sent] == ["energy", "joint position of left_tibia"]
    assert json.dumps(sent, allow_nan=False)
    assert json.dumps(signals(state, state.clients[ME]), allow_nan=False)
    fewer = update(state, Plot(ME, "energy", "", False))
    assert [s[0] for s in fewer.clients[ME].plots] == ["q"]


def test_a_ghost_is_drawn_beside(run, quadruped):
    state = update(initial(quadruped), Connected(ME))
    for event in (
        Simulate(ME), Simulated(1, run), Plot(ME, "energy", "", True),
        Compare(ME),
    ):  # fmt: skip
        state = update(state, event)
    sent = plots(state, state.clients[ME])["charts"][0]
    assert sent["ghost"] == sent["curves"]


def test_the_force_of_what_is_off_is_said_and_no_curve():
    """An axis of 1e-12 looked like a paw that carries nothing."""
    ties = [
        pg.Constraint(name=name, kind="point", body="1", active=name == "on")
        for name in ("on", "off")
    ]
    model = pg.Model.serial(1).replace(constraints=ties)
    state = update(initial(model), Connected(ME))
    state = update(state, Simulate(ME))
    never = {"coordinate": "1", "above": 3.0}
    later = pg.Switch(constraint="off", active=True, when=never)
    result = pg.simulate(pg.Mechanism(model), t_end=0.01, frames=3, step=2e-3, switches=[later])
    state = update(state, Simulated(state.job.id, result))
    for name in ("on", "off"):
        state = update(state, Plot(ME, "constraint_force", name, True))
    on, off = plots(state, state.clients[ME])["charts"]
    assert on["curves"]
    assert on["none"] == ""
    assert off["curves"] == []
    assert "0 throughout" in off["none"]


def test_contacts_that_never_touched_stand_apart_from_what_did():
    """A ball that falls on the ground, and one that hangs above it."""
    ball = pg.Shape(kind="sphere", radius=0.1)
    low = pg.Body(name="low", joint="free", link=(0, 0, 0.2), shape=ball)
    high = pg.Body(name="high", joint="weld", link=(0, 0, 3), shape=ball)
    contacts = [pg.Contact(name=f"of {n}", body=n) for n in ("high", "low")]
    model = pg.Model(bodies=(low, high), contacts=contacts)
    state = update(update(initial(model), Connected(ME)), Simulate(ME))
    state = update(state, Simulated(state.job.id, pg.simulate(model, t_end=0.4)))
    found = signals(state, state.clients[ME])
    kinds = {"contact_force", "contact_gap", "contact_slip"}
    assert {kind for kind, of, _ in found["of_scene"] if of == "of low"} == kinds
    assert {(kind, of) for kind, of, _ in found["idle"]} == {(kind, "of high") for kind in kinds}
    assert found["idle_title"] == "1 contact that never touched"
    shown = phases(state.falls, state)
    assert shown["feet"] == ["of low", "of high"]  # what touches first
    assert shown["phases"] == ["apart", "hits", "slips", "touches"]  # it has no feet
