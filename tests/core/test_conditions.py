"""Conditions of comparisons, and of a time since a constraint was switched, as located events."""

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import at_night, combined

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


@pytest.mark.parametrize(
    ("condition", "acts"),
    [
        ("=q.a > 0", True), ("=q.a < 0 or q.a > 0", True), ("=q.a < 0", False), ("=v.a > 1", True),
        *at_night(("=t >= 0", True), ("=q.a*q.a < 0", False), ("=not q.a <= 0", True),
                  ("=v.a < 1", False)),
    ],
)  # fmt: skip
def test_a_condition_on_its_limit_at_the_start_acts_where_it_is_about_to_hold(condition, acts):
    slider = pg.Body(name="a", joint="prismatic", axes=[(1, 0, 0)])
    weld = pg.Weld(name="w", body="a", active=False)
    model = pg.Model(bodies=[slider], gravity=(0, 0, 0), constraints=[weld])
    switch = pg.Switch(constraint="w", active=True, when={"holds": condition})
    scenario = pg.Scenario(name="s", t_end=0.2, switches=[switch])
    model = model.add(scenario).add(pg.Motor(name="m", body="a", torque=0.5))
    run = pg.simulate(model, scenario="s", v={"a": 1.0})
    assert np.isclose(run.q[-1, 0], 0.0 if acts else 0.2 + 0.25 * 0.04, atol=1e-9)
    assert any(condition.removeprefix("=") in text for text in run.notices) == acts


@pytest.mark.parametrize("down", [1.0, 4.0])
def test_a_latch_with_a_threshold_of_force_is_the_closed_form(down):
    """A weld holds a slider against a force that grows by 10 N/s, until it bears 5 N.

    It catches again where the spring has brought the slider back to less than `down` rad/s.
    """
    body = pg.Body(name="a", joint="prismatic", axes=[(1, 0, 0)], mass=2.0)
    latch = pg.Weld(name="latch", body="a")
    push = pg.Motor(name="push", body="a", torque="=if(t < 0.5, 10*t, -5)")
    switches = [
        pg.Switch(constraint="latch", active=False, when={"force": "latch", "above": 4.0}),
        pg.Switch(constraint="latch", active=True, when={"holds": f"=v.a < -0.1*{down}"}),
    ]
    scenario = pg.Scenario(name="s", switches=switches, t_end=2.0)
    model = pg.Model(
        bodies=[body], gravity=(0, 0, 0), constraints=[latch], forces=[push], scenarios=[scenario]
    )
    run = pg.simulate(model, scenario="s", rtol=1e-11)
    # off at 0.4 s; a = 5 t until 0.5 s, then -2.5; caught where v = -down/10, bears 5 N: off again
    at = [event.t for event in run.events]
    v = 2.5 * (0.5**2 - 0.4**2)
    assert at[0] == pytest.approx(0.4, abs=1e-9)
    assert at[1] == pytest.approx(0.5 + (v + 0.1 * down) / 2.5, abs=1e-8)


@pytest.mark.parametrize(
    ("text", "corner", "jump"),
    [
        ("=if(t < 0.3, 0, 2*(t - 0.3))", 0.3, 2.0),
        ("=abs(t - 0.61)", 0.61, 2.0),
        ("=max(0, sin(3*t))*0 + min(t, 0.25)", 0.25, -1.0),
        ("=table(t, 0, 0, 0.4, 1, 1, 1)", 0.4, -2.5),
    ],
)
@pytest.mark.parametrize("method", ["rk4", "dop853"])
def test_a_corner_of_a_prescribed_motion_is_named(text, corner, jump, method):
    body = pg.Body(name="a", joint="prismatic", axes=[(1, 0, 0)])
    follow = pg.Motion(name="follow", body="a", q_of_t=text)
    model = pg.Model(bodies=[body], gravity=(0, 0, 0), constraints=[follow])
    how = {"step": 0.01, "method": "rk4"} if method == "rk4" else {"rtol": 1e-9}
    run = pg.simulate(model, t_end=0.9, **how)
    told = [text for text in run.notices if "'follow'" in text]
    assert len(told) == 1
    assert f"{corner:g} s" in told[0]
    assert f"{jump:.4g}" in told[0]


@pytest.mark.parametrize(
    "text", ["=smoothstep(t, 0.2, 0.7)", "=sin(9*t)", "=min(t, 5)", "=t*abs(t)"]
)
def test_a_smooth_prescribed_motion_has_no_corner(text):
    body = pg.Body(name="a", joint="prismatic", axes=[(1, 0, 0)])
    follow = pg.Motion(name="follow", body="a", q_of_t=text)
    model = pg.Model(bodies=[body], gravity=(0, 0, 0), constraints=[follow])
    run = pg.simulate(model, t_end=0.9, step=0.01, method="rk4")
    assert not any("'follow'" in text for text in run.notices)


@pytest.mark.parametrize(
    ("call", "text", "after"),
    combined(
        [{}, {"step": 0.125, "method": "rk4"}],
        ["=t > 0.5", "=t >= 0.5", "=not t < 0.5", "=x.clock >= 0.5"],
        [None, 0.25],
    ),
)
def test_at_one_instant_switches_by_time_act_before_conditions(call, text, after):
    """The latch is closed at 0.5 s, and opened at once or for good 0.25 s later."""
    body = pg.Body(name="rod", axes=[(0, 0, 1)], inertia=(1, 1, 1), v=[1.0])
    latch = pg.Weld(name="latch", body="rod", active=False)
    opens = {"holds": text}
    if after:
        opens = {"constraint": "latch", "active": True, "after": after}
    switches = [
        {"constraint": "latch", "active": True, "t": 0.5},
        {"constraint": "latch", "active": False, "when": opens},
    ]
    model = pg.Model(
        bodies=[body], gravity=(0, 0, 0), constraints=[latch],
        controls=[pg.Sampled(name="clock", update="=t", sample=0.25)],
        scenarios=[pg.Scenario(name="s", switches=switches)],
    )  # fmt: skip
    run = pg.simulate(model, scenario="s", t_end=1.0, **call)
    assert [event.t for event in run.events] == pytest.approx([0.5, 0.5 + (after or 0.0)])
    assert run.q[-1, 0] == pytest.approx(0.5)
    assert not run.constraint_force["latch"][-1].any()
