"""Runs that go on from other runs, with `start=`: the parts of a run are the run."""

from typing import Any, cast

import numpy as np
import pytest

import pgraph_core as pg
from tests.refusals import assert_names

from ..nights import combined

SMOOTH = [
    {"method": "rk4", "step": 0.01}, {"method": "semi_implicit_euler", "step": 1e-3},
    {"method": "gauss6", "step": 0.01}, {"method": "dop853"}, {"method": "dopri5", "rtol": 1e-9},
    {"method": "radau5", "rtol": 1e-9}, {"method": "moreau_jean", "step": 1e-3},
]  # fmt: skip
STEPPED = [{"step": 1e-3}, {"step": 4e-3}]


def arm(*forces, **fields):
    body = pg.Body(name="arm", axes=(0, 0, 1), inertia=(0.5,) * 3, **fields)
    return pg.Model(bodies=[body], forces=forces)


def slider(name="s", **fields):
    return pg.Body(name=name, joint="prismatic", axes=[(1, 0, 0)], **fields)


def goes_on(model, how, t_end=2.0, parts=2, **call):
    """Return a run, and the runs of its parts."""
    whole = pg.simulate(model, t_end=t_end, **how, **call)
    ends = np.linspace(0.0, t_end, parts + 1)[1:]
    runs = [pg.simulate(model, t_end=ends[0], **how, **call)]
    for end in ends[1:]:
        runs.append(pg.simulate(model, start=runs[-1], t_end=end, **how, **call))
    return whole, runs


def apart(whole, runs):
    """Return the largest difference of q at the ends, or of v / 30 if it is larger."""
    last = runs[-1]
    if last.status is not whole.status:
        return np.inf
    return max(np.abs(last.q[-1] - whole.q[-1]).max(), np.abs(last.v[-1] - whole.v[-1]).max() / 30)


TARGET = pg.Table(t=[0, 0.5, 1.5], value=[0, 1, -1])
DRIVES = {
    "lag": pg.Servo(name="d", body="arm", kp=20, kd=1, lag=0.3, target=TARGET),
    "late": pg.Motor(name="d", body="arm", torque=TARGET, lag=0.4, start=0.7),
    "integral": pg.Motor(name="d", body="arm", torque=TARGET, integrates=True),
    "bounded": pg.Actuator(
        name="d", body="arm", gain=2.0, input=TARGET, integrates=True, state_low=-0.2,
        state_high=0.3,
    ),
}  # fmt: skip


@pytest.mark.parametrize(("drive", "how"), combined(DRIVES, SMOOTH), ids=str)
def test_drives_with_a_lag_or_an_integral_go_on(drive, how):
    limits: dict[str, Any] = {"limits": [(-9.0, 9.0)]} if how["method"] == "moreau_jean" else {}
    near = 1e-5 if how["method"] == "semi_implicit_euler" else 1e-7
    assert apart(*goes_on(arm(DRIVES[drive], **limits), how, parts=3)) < near


def test_saved_runs_batches_and_steppers_go_on(tmp_path):
    model, how = arm(DRIVES["lag"]), {"method": "rk4", "step": 0.01}
    whole, (half, more) = goes_on(model, how)
    assert apart(whole, [more]) < 1e-7
    half.save(tmp_path / "half.npz")
    loaded = pg.Result.load(tmp_path / "half.npz")
    again = pg.simulate(model, start=loaded, t_end=2.0, **how)
    assert np.array_equal(again.q, more.q)
    runs = pg.simulate_batch(model, start=[half, loaded], t_end=2.0, **how)
    assert all(np.array_equal(run.q, more.q) for run in runs)
    stepper = pg.Stepper(model, start=half, **how)
    second = stepper.record(100)
    np.testing.assert_allclose(second.q[-1], whole.q[-1], rtol=0, atol=1e-12)
    stepper.reset()
    assert stepper.t == 1.0
    first = pg.Stepper(model, **how).record(100)
    np.testing.assert_allclose(
        pg.simulate(model, start=first, t_end=2.0, **how).q[-1], whole.q[-1], rtol=0, atol=1e-12
    )
    np.testing.assert_array_equal(pg.joined([half, more]).q[-1], more.q[-1])
    third = pg.simulate(model, start=pg.joined([half, more]), t_end=3.0, **how)
    assert third.t[0] == 2.0


# -- switches -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("how", "given"), combined([*SMOOTH[:4], {"step": 1e-3}], ["scenario", "call"]), ids=str
)
def test_a_clutch_that_was_closed_stays_where_it_closed(how, given):
    """A weld without a point holds a slider at its distance from another one."""
    limits: dict[str, Any] = {"limits": [(-9.0, 9.0)]} if how == {"step": 1e-3} else {}
    other = slider("b", v=(0.4,), **limits)
    clutch = pg.Weld(name="w", body="s", other="b", active=False)
    push = pg.Motor(name="p", body="s", torque="=sin(3*t)")
    scenario = pg.Scenario(name="x", switches=[{"constraint": "w", "active": True, "t": 0.4}])
    model = pg.Model(
        bodies=[slider(), other], constraints=[clutch], forces=[push], gravity=(0, 0, 0),
        scenarios=[scenario],
    )  # fmt: skip
    call: dict[str, Any] = (
        {"scenario": "x"} if given == "scenario" else {"switches": ((0.4, "w", True),)}
    )
    whole, runs = goes_on(model, how, **call)
    assert apart(whole, runs) < 1e-6
    assert abs(whole["s"][-1] - whole["b"][-1]) > 0.01
    assert len(runs[1].events) == 0


@pytest.mark.parametrize("t", [4.0, 4.5])
@pytest.mark.parametrize("how", [{}, {"method": "rk4", "step": 0.01}], ids=str)
def test_a_latch_that_broke_stays_open(how, t):
    latch = pg.Weld(name="latch", body="s")
    when = {"force": "latch", "above": 40.0}
    scenario = pg.Scenario(
        name="x", switches=[{"constraint": "latch", "active": False, "when": when}]
    )
    push = pg.Motor(name="p", body="s", torque="=10*t")
    model = pg.Model(
        bodies=[slider(mass=2.0)], gravity=(0, 0, 0), constraints=[latch], forces=[push],
        scenarios=[scenario],
    )  # fmt: skip
    half = pg.simulate(model, scenario="x", t_end=t + 0.1, **how)
    more = pg.simulate(model, start=half, scenario="x", t_end=5.0, **how)
    exact = 2.5 * ((125 / 3 - 80) - (64 / 3 - 64))
    assert more["s"][-1] == pytest.approx(exact, abs=2e-6)
    assert not [text for text in more.notices if "moved" in text or "switched" in text]


def test_conditions_act_once_or_after_a_time_as_in_one_run():
    """A brake that closes when the slider passes 0.5, and opens 0.6 s later, whenever that is."""
    brake = pg.Velocity(name="brake", coefficients={"s": [1.0]}, value=0.0, active=False)
    switches = [
        pg.Switch(constraint="brake", active=True, when={"coordinate": "s", "above": 0.5,
                                                          "once": True}),
        pg.Switch(constraint="brake", active=False, when={"constraint": "brake", "active": True,
                                                           "after": 0.6}),
    ]  # fmt: skip
    push = pg.Motor(name="p", body="s", torque=1.0)
    model = pg.Model(
        bodies=[slider(v=(1.0,))], constraints=[brake], forces=[push], gravity=(0, 0, 0)
    )
    whole = pg.simulate(model, t_end=2.0, switches=switches)
    run = pg.simulate(model, t_end=0.2, switches=switches)
    for end in (0.5, 0.7, 1.2, 2.0):  # before it closes, while it holds, after it has opened
        run = pg.simulate(model, start=run, t_end=end, switches=switches)
    assert run["s"][-1] == pytest.approx(whole["s"][-1], abs=1e-8)


# -- contacts -------------------------------------------------------------------------------------


def pushed(law, force, **fields):
    """A box on the ground under a horizontal force that varies."""
    box = pg.Body(
        name="b", joint="free", mass=1.0, link=(0, 0, 0.05), derived=("inertia",),
        shape={"kind": "box", "size": (0.1, 0.1, 0.1)},
    )  # fmt: skip
    push = pg.Wrench(name="f", body="b", force=(force, 0, 0))
    floor = pg.Contact(name="c", body="b", law=law, friction=0.5, **fields)
    return pg.Model(bodies=[box], forces=[push], contacts=[floor])


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler", "gauss6", "moreau_jean"])
def test_the_friction_springs_of_penalty_contacts_stay_stretched(method):
    model = pushed("penalty", "=3*sin(5*t)", stiffness=1e5, damping=100.0)
    how = {"method": method, "step": 1e-4}
    whole, runs = goes_on(model, how, t_end=0.2, estimate=False)
    assert apart(whole, runs) < 1e-12


@pytest.mark.parametrize("after", ["dopri5", "gauss6", "moreau_jean"])
@pytest.mark.parametrize("before", ["rk4", "moreau_jean"])
def test_friction_springs_stay_stretched_in_another_method(before, after):
    """The box is held by springs that are stretched by 3 N, and does not move on."""
    model = pushed("penalty", "=min(30*t, 3)", stiffness=1e5, damping=100.0)
    half = pg.simulate(model, t_end=0.2, method=before, step=1e-4, estimate=False)
    way: dict[str, Any] = {} if after == "dopri5" else {"step": 1e-4}
    more = pg.simulate(model, start=half, t_end=0.3, method=after, estimate=False, **way)
    assert half.q[-1, 0] > 5e-6
    assert np.abs(more.q[:, 0] - half.q[-1, 0]).max() < 1e-7


@pytest.mark.parametrize("how", STEPPED, ids=str)
def test_a_box_that_slid_does_not_stick_by_starting_anew(how):
    """Static friction of 0.6 would hold a box that the kinetic one of 0.5 lets slide."""
    model = pushed("complementarity", "=if(t < 0.1, 8, 5.5)", static_friction=0.6)
    whole, (half, more) = goes_on(model, how, t_end=0.6)
    assert apart(whole, [more]) < 1e-12
    assert whole.v[-1, 3] > 0.1
    anew = pg.simulate(model, half.q[-1], np.zeros(6), t_start=0.3, t_end=0.6, **how)
    assert anew.v[-1, 3] < 1e-9
    np.testing.assert_allclose(more.contact_force["c"][0], half.contact_force["c"][-1], rtol=1e-9)


@pytest.mark.parametrize("how", [*STEPPED, {"rtol": 1e-9}], ids=str)
def test_bouncing_and_resting_goes_on(how):
    ball = pg.Body(
        name="b", joint="prismatic", axes=[(0, 0, 1)], mass=1.0, link=(0, 0, 0.4),
        shape={"kind": "sphere", "radius": 0.1},
    )  # fmt: skip
    model = pg.Model(bodies=[ball], contacts=[pg.Contact(name="c", body="b", restitution=0.6)])
    assert apart(*goes_on(model, how, t_end=1.6, parts=4)) < 1e-6


# -- what cannot go on ----------------------------------------------------------------------------


def test_a_call_that_forgets_says_so():
    clutch = pg.Weld(name="w", body="arm", active=False)
    penalty = pushed("penalty", 1.0)
    for model, name in (
        (arm(DRIVES["lag"]), "'d'"),
        (arm().replace(constraints=[clutch]), "'w'"),
        (penalty, "'c'"),
    ):
        half = pg.simulate(model, t_end=0.1, estimate=False)
        anew = pg.simulate(model, half.q[-1], half.v[-1], t_start=0.1, t_end=0.2, estimate=False)
        assert any(name in text and "start=run" in text for text in anew.notices)
        more = pg.simulate(model, start=half, t_end=0.2, estimate=False)
        assert not any("start=run" in text for text in more.notices)


def test_what_cannot_go_on_is_refused():
    model = arm(DRIVES["lag"])
    half = pg.simulate(model, t_end=0.5)
    other = pg.Model.serial(2)
    for call, facts in (
        (lambda: pg.simulate(model, [0.1], start=half), ["start", "q"]),
        (lambda: pg.simulate(model, start=half, t_start=1.0), ["start", "t_start"]),
        (lambda: pg.simulate(other, start=half), ["start", "joints"]),
        (lambda: pg.simulate(model, start=cast(Any, half.q)), ["start", "run"]),
        (lambda: pg.Stepper(model, start=half, q=[0.1]), ["start", "q"]),
        (lambda: pg.simulate(model, start=half, t_end=0.4), ["t_end", "0.5"]),
    ):
        with pytest.raises(pg.InputError) as error:
            call()
        assert_names(str(error.value), *facts)
    weld = pg.Weld(name="w", body="arm", active=False)
    clutch = arm().replace(constraints=[weld])
    with pytest.raises(pg.InputError) as error:
        pg.simulate(clutch, t_start=1.0, t_end=2.0, switches=((0.5, "w", True),))
    assert_names(str(error.value), "'w'", "0.5", "start=run")
