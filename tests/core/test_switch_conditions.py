"""Switches that wait for a condition of the state, against closed forms."""

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
from ..refusals import assert_names
from ..worlds import ball, box, on_ground

SETTINGS = [{}, {"method": "rk4", "step": 1e-2}, {"method": "radau5", "rtol": 1e-9}]


def slider(*, forces=(), active=False, q=0.0, v=0.0):
    body = pg.Body(name="b", joint="prismatic", axes=((1, 0, 0),), mass=2.0, q=(q,), v=(v,))
    latches = tuple(pg.Constraint(name=n, kind="point", body="b", active=active and n == "latch")
                    for n in ("latch", "second"))  # fmt: skip
    return pg.Model(bodies=(body,), constraints=latches, forces=forces, gravity=(0, 0, 0))


@pytest.mark.parametrize("options", SETTINGS)
def test_a_coordinate_locks_the_slider_where_it_is(options):
    """Thrown at 3 m/s, caught at 1.234 m."""
    switch = pg.Switch(constraint="latch", active=True, when={"coordinate": "b", "above": 1.234})
    run = pg.simulate(slider(v=3.0), t_end=1.0, switches=[switch], **options)
    assert run.status.ok
    np.testing.assert_allclose(run.q[-1, 0], 1.234, rtol=0, atol=1e-9)
    assert abs(run.v[-1, 0]) < 1e-9
    (event,) = run.events
    np.testing.assert_allclose(event.t, 1.234 / 3.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("options", SETTINGS)
def test_a_latch_breaks_at_a_force(options):
    """Under 10 N/s it breaks at 4 N after 0.4 s. Then a = 5 t."""
    ramp = pg.Motor(name="pull", body="b", torque=pg.Table(t=(0.0, 1.0), value=(0.0, 10.0)))
    mech = slider(forces=(ramp,), active=True)
    switch = pg.Switch(constraint="latch", active=False, when={"force": "latch", "above": 4.0})
    run = pg.simulate(mech, t_end=1.0, switches=[switch], **options)
    a = 0.4
    exact = 5 / 6 * (1 - a**3) - 5 / 2 * a**2 * (1 - a)
    np.testing.assert_allclose(run.q[-1, 0], exact, rtol=0, atol=1e-8)
    np.testing.assert_allclose(run.events[0].t, a, rtol=0, atol=1e-9)


def resting(height, law="complementarity"):
    body = ball(joint="prismatic", axes=((0, 0, 1),), place=(0, 0, 0), q=(height,))
    latch = pg.Constraint(name="latch", kind="point", body="b", active=False)
    return on_ground(body, law=law).replace(constraints=(latch,))


@pytest.mark.parametrize(("law", "options"), [("complementarity", {"rtol": 1e-8}), ("soft", {})])
def test_a_gap_locks_a_falling_ball(law, options):
    model = resting(1.1, law)
    switch = pg.Switch(constraint="latch", active=True, when={"gap": "floor", "below": 0.25})
    run = pg.simulate(model, t_end=1.0, switches=[switch], **options)
    np.testing.assert_allclose(run.q[-1, 0], 0.35, rtol=0, atol=1e-6)


def test_a_constraint_waits_for_another():
    """The second goes on with the latch, and a time switches the latch off."""
    when = {"constraint": "latch", "active": True}
    switches = [
        pg.Switch(constraint="latch", active=True, when={"coordinate": "b", "above": 0.5}),
        pg.Switch(constraint="second", active=True, when=when),
        pg.Switch(constraint="latch", active=False, t=0.8),
    ]
    run = pg.simulate(slider(v=1.0), t_end=1.0, switches=switches)
    assert abs(run.q[-1, 0] - 0.5) < 1e-9
    assert [event.contact for event in run.events] == ["latch", "second", "latch"]


@pytest.mark.parametrize("options", SETTINGS)
def test_a_switch_that_acts_once_catches_an_oscillator_once(options):
    """Let go at its own threshold it comes back there with every period."""
    when = {"coordinate": "b", "above": 0.5, "once": True}
    switches = [
        pg.Switch(constraint="latch", active=True, when=when),
        pg.Switch(constraint="latch", active=False, when={"constraint": "latch", "active": True,
                                                         "after": 0.25}),
    ]  # fmt: skip
    model = slider(v=3.0).edit("b", stiffness=(20.0,))
    run = pg.simulate(model, t_end=6.0, switches=switches, **options)
    assert [event.after for event in run.events] == ["on", "off"]
    let_go = run.events[1].t
    exact = 0.5 * np.cos(np.sqrt(10.0) * (6.0 - let_go))
    np.testing.assert_allclose(run.q[-1, 0], exact, rtol=0, atol=1e-5)
    scenario = pg.Scenario(name="s", switches=switches)
    kept = pg.Model.from_json(model.replace(scenarios=(scenario,)).to_json())
    assert kept.scenarios[0].switches[0].when.once


@pytest.mark.parametrize("options", [{"rtol": 1e-6, "method": "radau5"}, {"step": 3e-3}])
@pytest.mark.parametrize("threshold", [-0.376, -0.5, -0.123])
def test_a_latch_does_not_catch_again_what_leaves_its_threshold(threshold, options):
    """The spring pulls away from the threshold, on which the release leaves the slider."""
    when = {"coordinate": "b", "below": threshold}
    let_go = {"constraint": "latch", "active": True, "after": 0.25}
    switches = [(when, "latch", True), (let_go, "latch", False)]
    model = slider().edit("b", stiffness=(11.52,))
    run = pg.simulate(model, q=[4.7], t_end=2.0, switches=switches, **options)
    assert [event.after for event in run.events] == ["on", "off"]
    rest = run.t[-1] - run.events[1].t
    exact = threshold * np.cos(np.sqrt(11.52 / 2.0) * rest)
    np.testing.assert_allclose(run.q[-1, 0], exact, rtol=0, atol=1e-5)


@pytest.mark.parametrize(
    ("threshold", "options"),
    combined([0.376, 0.5, 0.123], [{"rtol": 1e-6, "method": "radau5"}, {"step": 3e-3}]),
)
def test_a_latch_that_catches_again_at_once_is_reported(threshold, options):
    """A constant force pulls on past the threshold, where rounding decides on the side."""

    def caught(**once):
        when = {"coordinate": "b", "above": threshold, **once}
        let_go = {"constraint": "latch", "active": True, "after": 0.25}
        switches = [(when, "latch", True), (let_go, "latch", False)]
        force = pg.Motor(name="m", body="b", torque=3.0)
        model = slider().edit("b", stiffness=(0.0,)).replace(forces=(force,))
        run = pg.simulate(model, q=[0.0], t_end=3.0, switches=switches, **options)
        told = any("'latch'" in text and "once" in text for text in run.notices)
        return told, bool((np.diff([event.t for event in run.events])[1::2] < 1e-6).any())

    told, at_once = caught()
    assert told == at_once
    assert caught(once=True) == (False, False)


@pytest.mark.parametrize("kind", [pg.Velocity, pg.Coupling])
def test_a_constraint_on_coordinates_that_a_condition_activates_keeps_derivatives(kind):
    """A slider at v stops where q = 0.53, so that its position then depends on neither."""
    held = {} if kind is pg.Velocity else {"value": 0.53}
    latch = kind(name="latch", coefficients={"b": [1.0]}, active=False, **held)
    model = slider(v=1.0).replace(constraints=(latch,))
    switches = [({"coordinate": "b", "above": 0.53}, "latch", True)]
    run = pg.simulate(model, t_end=1.0, frames=5, switches=switches, wrt=["q.b", "v.b"])
    for path, factor in (("q.b", 1.0), ("v.b", run.t)):
        exact = np.where(run.t < 0.53, factor, 0.0)
        np.testing.assert_allclose(run.sensitivity(path)[:, 0], exact, atol=1e-7)
    assert not any("position" in text for text in run.notices)


def test_the_force_of_a_contact_switches_a_latch():
    """1 kg on the ground under 10 N/s: 12 N are passed at (12 - 9.80665) / 10 s."""
    table = pg.Table(t=(0.0, 1.0), value=(0.0, -10.0))
    model = resting(0.1).add(pg.Motor(name="press", body="b", torque=table))
    switch = pg.Switch(constraint="latch", active=True, when={"force": "floor", "above": 12.0})
    run = pg.simulate(model, t_end=1.0, step=1e-3, switches=[switch])
    (event,) = [event for event in run.events if event.contact == "latch"]
    weight = -np.asarray(model.gravity) @ (0.0, 0.0, 1.0)
    np.testing.assert_allclose(event.t, (12.0 - weight) / 10.0, rtol=0, atol=1e-3)
    np.testing.assert_allclose(run.q[-1, 0], 0.1, rtol=0, atol=1e-9)


def torque(t, q, v):
    return np.zeros(len(v))


@pytest.mark.parametrize("options", [{}, {"tau": torque}, {"rtol": 1e-8}])
@pytest.mark.parametrize(
    ("when", "t"),
    [
        ({"force": "floor", "above": 3.0}, 0.0),
        ({"holds": "=force.floor[3] > 9"}, 0.0),
        ({"holds": "=force.floor[1] > -3"}, 1.0 / (0.5 * 9.81)),
    ],
)
def test_a_force_that_acts_from_the_start_is_known_to_conditions(when, t, options):
    """A box slides with friction of mu m g until it stops."""
    sliding = box("b", (0, 0, 0.05), (0.4, 0.3, 0.1), mass=1.0, v=(0, 0, 0, 1, 0, 0))
    latch = pg.Plane(name="latch", body="b", point=(0, 0, 0), other_axis=(1, 0, 0), active=False)
    model = on_ground(sliding, friction=0.5).replace(constraints=[latch])
    switches = [{"constraint": "latch", "active": True, "when": {**when, "once": True}}]
    run = pg.simulate(model, t_end=0.3, switches=switches, **options)
    (event,) = [event for event in run.events if event.contact == "latch"]
    assert event.t == pytest.approx(t, abs=1e-3)
    told = any("switched at the start" in text for text in run.notices)
    assert told == (t == 0.0)


@pytest.mark.parametrize("holds", ["=t > 0.00551", "=force.latch > 5 and t > 5e-4"])
def test_looks_within_a_step_leave_no_residual_of_contacts(holds):
    """A look after 1e-12 s, in which weight has no notable impulse, is not a step of the run."""
    one, other = (
        pg.Body(
            name=name, joint="prismatic", axes=((0, 0, 1),), mass=1.0, q=(q,), link=(x, 0, 0),
            shape={"kind": "sphere", "radius": 0.1},
        )
        for name, q, x in (("b", 1.0, 0.0), ("rests", 0.1, 1.0))
    )  # fmt: skip
    latch = pg.Plane(name="latch", body="b", point=(0, 0, 0), other_axis=(0, 0, 1))
    model = pg.Model(
        bodies=[one, other], constraints=[latch], contacts=[pg.Contact(name="floor", body="rests")]
    )
    switches = [{"constraint": "latch", "active": False, "when": {"holds": holds}}]
    run = pg.simulate(model, t_end=0.01, switches=switches, estimate=False)
    assert not [text for text in run.notices if "did not converge" in text]
    assert run.contacts.residual.max() < 1e-9


def test_a_condition_that_holds_at_the_start_is_reported():
    switch = pg.Switch(constraint="latch", active=True, when={"coordinate": "b", "above": 0.5})
    run = pg.simulate(slider(q=0.7, v=1.0), t_end=1.0, switches=[switch])
    assert abs(run.q[-1, 0] - 0.7) < 1e-9
    assert any("'latch'" in text for text in run.notices)


def scenario(*switches, constraints=None):
    b = ball(joint="prismatic", axes=((1, 0, 0),), limits=((-2.0, 2.0),))
    ties = tuple(
        pg.Constraint(name=n, kind="point", body="b", active=n == "held")
        for n in ("latch", "second", "held")
    )
    given = pg.Scenario(name="s", switches=switches, constraints=constraints)
    bodies = (b, pg.Body(name="plate", joint="planar", parent="b"))
    floor = pg.Contact(name="floor", body="b")
    return pg.Model(bodies=bodies, contacts=(floor,), constraints=ties, scenarios=(given,))


def switch(constraint, active, /, **when):
    return pg.Switch(constraint=constraint, active=active, when=when)


LOOP = [
    switch("latch", True, constraint="second", active=False),
    switch("second", True, constraint="latch", active=True),
    switch("latch", False, constraint="second", active=True),
    switch("second", False, constraint="latch", active=False),
]


@pytest.mark.parametrize(
    ("fields", "key"),
    [
        ({"t": 0.1, "when": {"coordinate": "b", "above": 1}}, "both"),
        ({}, "t or when"),
        ({"when": {"coordinate": "b"}}, "coordinate.*above.*below"),
        ({"when": {"coordinate": "b", "above": 1, "below": 2}}, "above and below"),
        ({"when": {"coordinate": "b", "gap": "c", "above": 1}}, "one of"),
        ({"when": {"above": 1}}, "one of"),
        ({"when": {"constraint": "latch", "above": 1}}, "constraint.*active"),
        ({"when": {"coordinate": "b", "above": float("nan")}}, "above.*nan"),
        ({"when": {"coordinate": "a", "above": 1}}, "coordinate.*'a'.*b, plate 0"),
        ({"when": {"coordinate": "plate", "above": 1}}, "b, plate 0"),
        ({"when": {"gap": "wall", "below": 1}}, "gap.*'wall'"),
        ({"when": {"force": "no", "above": 1}}, "force.*'no'"),
        ({"when": {"constraint": "no", "active": True}}, "constraint.*'no'"),
        ({"when": {"coordinate": "b", "above": 2.0}}, "limit of 'b'.* 2"),
        ({"when": {"coordinate": "b", "below": -3.0}}, "limit of 'b'.* -2"),
        ({"when": {"constraint": "latch", "active": False}}, "itself"),
        ({"when": {"constraint": "second", "active": True}}, "'second' on"),
        ({"when": {"constraint": "held", "active": False}}, "'held' off"),
        ({"when": {"force": "latch", "below": 5}}, "own force"),
        ({"when": {"force": "second", "above": 5}}, "'second'.*off"),
        ({"when": {"force": "floor", "below": 0}}, "below 0"),
        (LOOP, "without end"),
    ],
)
def test_conditions_that_do_not_fit_are_refused_with_the_model(fields, key):
    with pytest.raises(pg.ModelError, match=key):
        scenario(
            *(fields if fields is LOOP else [pg.Switch(constraint="latch", active=True, **fields)])
        )


def test_conditions_follow_renames_and_removals():
    model = scenario(
        switch("latch", True, coordinate="b", above=1),
        switch("second", True, coordinate="plate 1", above=1),
        switch("held", False, force="held", above=3),
        switch("second", False, gap="floor", below=0.2),
        switch("second", True, constraint="latch", active=True),
    )

    def conditions(model):
        return [str(s.when) for s in model.scenarios[0].switches]

    every = conditions(model)
    assert pg.Model.from_json(model.to_json()) == model
    for number, name, new in ((1, "plate", "disc 1"), (3, "floor", "sole"), (4, "latch", "hook")):
        assert new in conditions(model.edit(name, name=new.split()[0]))[number]
    assert conditions(model.remove("plate")) == [every[0], *every[2:]]
    assert conditions(model.remove("floor")) == [*every[:3], every[4]]
    assert conditions(model.remove("latch")) == every[1:4]
    turned = model.edit("plate", joint="revolute")
    assert conditions(turned) == [every[0], *every[2:]]
    assert any("'plate'" in text for text in turned.notices)


def test_conditions_begin_on_the_side_of_each_start():
    """Runs of one mechanism that start on both sides of a bound and that reach it or do not."""
    switch = pg.Switch(constraint="latch", active=True, when={"coordinate": "b", "above": 1.0})
    mech, options = pg.Mechanism(slider()), {"t_end": 1.0, "switches": [switch], "frames": 11}
    for q, v, end in ((0.0, 0.5, 0.5), (0.5, 1.0, 1.0), (2.0, -1.5, 2.0), (0.0, 0.5, 0.5)):
        for _ in range(2):
            run = pg.simulate(mech, [q], [v], **options)
            np.testing.assert_allclose(run.q[-1, 0], end, rtol=0, atol=1e-9)
            assert len(run.events) == (end != 0.5)


@pytest.mark.parametrize("options", SETTINGS)
def test_conditions_are_found_from_every_distance(options):
    """A slider swings within ±1 m. The first crossing of a bound has a closed form."""
    spring = pg.Body(name="b", joint="prismatic", axes=((1, 0, 0),), mass=1.0, stiffness=100.0)
    latch = pg.Constraint(name="latch", kind="point", body="b", active=False)
    mech = pg.Mechanism(pg.Model(bodies=(spring,), constraints=(latch,), gravity=(0, 0, 0)))
    for bound in (-0.999, -0.5, 0.0, 0.7, 0.999, 1.001):
        when = {"coordinate": "b", "below": bound}
        switch = pg.Switch(constraint="latch", active=True, when=when)
        run = pg.simulate(mech, [1.0], [0.0], t_end=2.0, switches=[switch], **options)
        events = [event.t for event in run.events]
        if bound > 1.0:
            np.testing.assert_allclose(run.q[-1, 0], 1.0, rtol=0, atol=1e-9)
            continue
        np.testing.assert_allclose(events, [np.arccos(bound) / 10], rtol=0, atol=1e-5)
        np.testing.assert_allclose(run.q[-1, 0], bound, rtol=0, atol=1e-9)


def test_a_landing_switches_a_latch():
    """A ball falls 0.5 m while its contact is not evaluated, and exceeds 12 N when it lands."""
    switch = pg.Switch(constraint="latch", active=True, when={"force": "floor", "above": 12.0})
    model = resting(0.6)
    run = pg.simulate(model, t_end=0.6, switches=[switch])
    assert "began" in run.header
    (event,) = [event for event in run.events if event.contact == "latch"]
    g = -np.asarray(model.gravity) @ (0.0, 0.0, 1.0)
    np.testing.assert_allclose(event.t, np.sqrt(1.0 / g), rtol=0, atol=2e-3)
    np.testing.assert_allclose(run.q[-1, 0], 0.1, rtol=0, atol=1e-4)


# -- constraints that have a torque and no force ---------------------------------------------------

TURNS, SLIDES, BALL = (
    {"axes": [(0, 0, 1)], "inertia": (0.1, 0.1, 0.2)},
    {"joint": "prismatic", "axes": [(1, 0, 0)], "mass": 1.0},
    {"joint": "spherical", "inertia": (0.1, 0.1, 0.2)},
)
CLUTCHES = {
    "velocity": lambda: pg.Velocity(name="c", coefficients={"a": [1], "b": [-1]}),
    "coupling": lambda: pg.Coupling(name="c", coefficients={"a": [1], "b": [-1]}),
    "gear": lambda: pg.Gear(name="c", body="a", other="b"),
    "motion": lambda: pg.Motion(name="c", body="a", q_of_t="=0.1*t"),
}


def pair(kind, joint, *switches, **parts):
    inertia = {"inertia": (0.25, 0.25, 0.5)} if joint is TURNS else {}
    return pg.Model(
        bodies=[pg.Body(name="a", **{**joint, **inertia}), pg.Body(name="b", **joint)],
        constraints=[CLUTCHES[kind]()], gravity=(0, 0, 0),
        scenarios=[pg.Scenario(name="s", switches=switches)], **parts,
    )  # fmt: skip


WHEN = [{"force": "c", "above": 4.0}, {"holds": "=force.c > 4"}]


@pytest.mark.parametrize("kind", CLUTCHES)
@pytest.mark.parametrize("when", WHEN)
def test_a_condition_on_a_force_that_is_a_torque_is_refused(kind, when):
    switch = pg.Switch(constraint="c", active=False, when=when)
    with pytest.raises(pg.ModelError) as error:
        pair(kind, TURNS, switch)
    assert_names(str(error.value), "'c'", kind, "torque", "f.NAME", "q.NAME")
    with pytest.raises(pg.InputError) as error:
        pg.simulate(pair(kind, TURNS), t_end=0.1, switches=[switch])
    assert_names(str(error.value), "'c'", kind, "torque", "f.NAME")


def test_an_orientation_has_no_force_to_sample():
    body = pg.Body(name="a", joint="free", inertia=(0.1, 0.1, 0.2))
    sample = pg.Sampled(name="x", update="=force.c", sample=0.1)
    with pytest.raises(pg.ModelError) as error:
        pg.Model([body], constraints=[pg.Orientation(name="c", body="a")], controls=[sample])
    assert_names(str(error.value), "'c'", "orientation", "torque")


@pytest.mark.parametrize("kind", ["velocity", "coupling", "gear"])
def test_a_clutch_of_sliders_opens_at_its_force(kind):
    """Two masses of 1 kg: half of the force of the drive is in the clutch, 4 N at 0.8 s."""
    drive = pg.Motor(name="drive", body="a", torque="=10*t")
    switch = pg.Switch(constraint="c", active=False, when=WHEN[0])
    model = pair(kind, SLIDES, switch, forces=[drive])
    run = pg.simulate(model, scenario="s", t_end=1.0, rtol=1e-10, estimate=False)
    assert [event.t for event in run.events] == pytest.approx([0.8], abs=1e-9)


def test_a_clutch_of_hinges_opens_at_the_torque_of_its_drive():
    """The advice of the refusal: 4 N m of the clutch are 14 N m of the drive, at 1.4 s."""
    drive = pg.Motor(name="drive", body="a", torque="=10*t")
    switch = pg.Switch(constraint="c", active=False, when={"holds": "=f.drive > 14"})
    model = pair("velocity", TURNS, switch, forces=[drive])
    run = pg.simulate(model, scenario="s", t_end=2.0, rtol=1e-10, estimate=False, frames=101)
    assert [event.t for event in run.events] == pytest.approx([1.4], abs=1e-9)
    held = run.t < 1.39
    wrench = run.constraint_force["c"][held]
    assert abs(wrench[:, 2]) == pytest.approx(20 / 7 * run.t[held], abs=1e-9)
    assert not wrench[:, 3:].any()


@pytest.mark.parametrize("joint", [TURNS, SLIDES, BALL])
def test_which_constraints_have_forces_follows_from_their_wrenches(joint):
    """As recorded, for each kind of motion."""
    dof = 3 if joint is BALL else 1
    clutch = pg.Velocity(name="c", coefficients={"a": [1] * dof, "b": [-1] * dof})
    bodies = [pg.Body(name="a", **joint), pg.Body(name="b", **joint)]
    model = pg.Model(bodies=bodies, constraints=[clutch], gravity=(0, 0, 0))
    run = pg.simulate(model, tau=np.eye(2 * dof)[0], t_end=0.1, estimate=False)
    pulls = clutch.pulls({body.name: body for body in bodies})
    assert pulls == bool(run.constraint_force["c"][:, 3:].any())
