"""Conditions of comparisons, and of a time since a constraint was switched, as located events."""

import numpy as np
import pytest

import pgraph_core as pg

W = 3.0  # rad/s of the slider on its spring


def slider(*switches, **more):
    """A slider on a spring, and a weld that catches it where it is."""
    body = pg.Body(name="mass", joint="prismatic", axes=[(1, 0, 0)], mass=1.0, stiffness=W * W)
    catch = pg.Weld(name="catch", body="mass", active=False)
    return pg.Model(
        bodies=[body],
        constraints=[catch],
        gravity=(0, 0, 0),
        scenarios=[pg.Scenario(name="swing", q={"mass": 1.0}, switches=switches, **more)],
        parameters={"half": 0.5},
    )


def switch(on, **when):
    return pg.Switch(constraint="catch", active=on, when=when)


CAUGHT = [
    ({"rtol": 1e-11}, 1e-9),
    ({"rtol": 1e-9, "method": "dopri5"}, 1e-7),
    ({"step": 1e-3, "method": "rk4"}, 1e-9),
]


@pytest.mark.parametrize(("call", "tolerance"), CAUGHT)
def test_what_is_caught_for_half_a_second_goes_on_as_the_closed_form(call, tolerance):
    model = slider(
        switch(True, holds="=q.mass < -half and v.mass < 0"),
        switch(False, constraint="catch", active=True, after=0.5),
        t_end=3.0,
    )
    assert pg.Model.from_json(model.to_json()) == model
    assert '"schema_version": 6' in model.to_json()
    run = pg.simulate(model, scenario="swing", frames=301, **call)
    assert run.status.ok
    caught = np.arccos(-0.5) / W
    again = caught + 0.5  # from rest
    t, q = run.t, run.q[:, 0]
    wanted = np.where(t < caught, np.cos(W * t), -0.5 * np.cos(W * (t - again)))
    wanted = np.where((t >= caught) & (t < again), -0.5, wanted)
    assert np.abs(q - wanted).max() < tolerance


@pytest.mark.parametrize(
    ("text", "time"),
    [
        ("=v.mass <= -2.4", np.arcsin(0.8) / W),
        ("=q.mass < 0 or v.mass < -2.4", np.arcsin(0.8) / W),
        ("=q.mass < 0 and v.mass < -2.4", np.pi / 2 / W),
        ("=not q.mass > half", np.arccos(0.5) / W),
        ("=q.mass^2 + 0.1*t < 0.1*t + 0.25", np.arccos(0.5) / W),
        ("=t >= 0.3", 0.3),
    ],
)
def test_a_comparison_is_located(text, time):
    model = slider(switch(True, holds=text))
    run = pg.simulate(model, scenario="swing", t_end=1.0, rtol=1e-10)
    at = [event.t for event in run.events]
    assert at == pytest.approx([time], abs=1e-9)


def test_a_latch_has_a_gap_between_on_and_off():
    """Caught where it is fast, let go by the force that the latch has to bear."""
    model = slider(switch(True, holds="=v.mass < -2.4"), switch(False, force="catch", above=5.0))
    run = pg.simulate(model, scenario="swing", t_end=1.0, rtol=1e-10)
    place = W * W * np.cos(np.arcsin(0.8))  # the spring pulls by this, as soon as it is caught
    assert place > 5.0
    assert len(run.events) == 2


def test_expressions_of_conditions_follow_names():
    model = slider(switch(True, holds="=q.mass < -half"))
    named = model.edit("mass", name="the mass")
    assert named.scenarios[0].switches[0].when.holds == '=q["the mass"] < -half'
    assert not named.remove("the mass").scenarios[0].switches


@pytest.mark.parametrize(
    ("when", "facts"),
    [
        ({"holds": "=q.mass"}, ("compare",)),
        ({"holds": "=q.mass < "}, ("column",)),
        ({"holds": "=q.mas < 1"}, ("'mas'", "mass")),
        ({"holds": "=q.mass < v.mass"}, ("m and m/s",)),
        ({"holds": "=q.mass < 1", "above": 1.0}, ("above",)),
        ({"coordinate": "mass", "above": 1.0, "after": 1.0}, ("after",)),
        ({"constraint": "catch", "active": True, "after": -1.0}, ("after", "-1")),
    ],
)
def test_a_condition_that_means_nothing_is_refused(when, facts):
    with pytest.raises(pg.ModelError) as refused:
        slider({"constraint": "catch", "active": True, "when": when})
    assert all(fact in str(refused.value) for fact in facts)


@pytest.mark.parametrize("condition", ["=q.a > 0", "=t >= 0", "=q.a < 0 or q.a > 0"])
def test_a_condition_on_its_limit_at_the_start_is_named(condition):
    slider = pg.Body(name="a", joint="prismatic", axes=[(1, 0, 0)])
    weld = pg.Weld(name="w", body="a", active=False)
    model = pg.Model(bodies=[slider], gravity=(0, 0, 0), constraints=[weld])
    switch = pg.Switch(constraint="w", active=True, when={"holds": condition})
    scenario = pg.Scenario(name="s", t_end=0.2, switches=[switch])
    run = pg.simulate(model.add(scenario), scenario="s", v={"a": 1.0})
    assert any(condition.removeprefix("=") in text for text in run.notices)
