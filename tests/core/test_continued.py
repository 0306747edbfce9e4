"""Runs that begin with given states of controls: parts of a run are the run."""

import numpy as np
import pytest

import pgraph_core as pg
from tests.controlled import EVERY, WHOLE, pendulum
from tests.refusals import assert_names

from ..nights import combined

TIMED = f"{WHOLE} + 0.1*sin(3*t)"


def continued(model, first, **call):
    return pg.simulate(
        model, first.q[-1], first.v[-1], states=first.states[-1], t_start=first.t[-1], **call
    )


@pytest.mark.parametrize(
    ("method", "step", "law"),
    combined(["rk4", "semi_implicit_euler", "gauss6"], [2.0**-7, 0.01], [WHOLE, TIMED]),
)
def test_a_run_in_two_parts_has_the_bits_of_one_run_and_of_steppers(method, step, law):
    model, n = pendulum(EVERY, law), 60
    call = {"step": step, "method": method}
    whole = pg.simulate(model, q=[0.4], t_end=2 * n * step, **call)
    first = pg.simulate(model, q=[0.4], t_end=n * step, **call)
    second = continued(model, first, t_end=2 * n * step, **call)
    stepper = pg.Stepper(model, q=[0.4], **call)
    stepper.step(n=2 * n)
    other = pg.Stepper(
        model, q=first.q[-1], v=first.v[-1], states=first.states[-1], t_start=n * step, **call
    )
    other.step(n=n)
    for one in (second, whole):
        assert np.array_equal(one.states[-1], stepper.states)
        assert np.array_equal(one.q[-1], stepper.q)
    assert np.array_equal(other.states, stepper.states)
    assert np.array_equal(other.q, stepper.q)


@pytest.mark.parametrize(
    ("method", "parts"), combined(["dop853", "radau5", "moreau_jean"], [2, 3, 7])
)
def test_a_run_in_parts_is_as_accurate_as_one_run(method, parts):
    model, stepped = pendulum(EVERY, TIMED), method == "moreau_jean"
    model = model.edit("arm", limits=[(-9.0, 9.0)]) if stepped else model
    how: dict = {"step": 1e-3} if stepped else {"rtol": 1e-10}
    how, near = {"method": method, **how}, 1e-5 if stepped else 1e-7  # steps of other widths
    whole = pg.simulate(model, q=[0.4], t_end=1.0, **how)
    run = pg.simulate(model, q=[0.4], t_end=1.0 / parts, **how)
    for k in range(1, parts):
        run = continued(model, run, t_end=(k + 1) / parts, **how)
    assert np.allclose(run.states[-1], whole.states[-1], rtol=0, atol=near)
    assert np.allclose(run.q[-1], whole.q[-1], rtol=0, atol=near)


def test_a_sample_at_the_start_of_a_control_with_given_states_is_over():
    a = pg.Sampled(name="a", update="=x.a + 1", sample=0.1)
    b = pg.Sampled(name="b", update="=x.a", sample=0.1)
    for states, end in (
        (None, [5.0, 4.0]), ([7.0, 2.0], [11.0, 10.0]), ({"a": 7.0}, [11.0, 10.0]),
        ({"b": 7.0}, [5.0, 4.0]),
    ):  # fmt: skip
        run = pg.simulate(pendulum([a, b]), states=states, t_end=0.45, step=0.01, method="rk4")
        assert run.states[-1].tolist() == end
    run = pg.simulate(pendulum([a, b]), states={"a": 7.0}, t_end=0.05, step=0.01, method="rk4")
    assert run.states[-1].tolist() == [7.0, 7.0]  # that of b was taken, and reads the given value


def test_controls_that_are_not_named_begin_as_the_model_says():
    """A filter begins at its input, which reads the given integral of another one."""
    pid = pg.PID(name="pid", signal="=q.arm", kp=2.0, ki=3.0, kd=1.0, filter=0.1)
    lag = pg.Filter(name="lag", input="=x.pid[1]", lag=0.2)
    model = pendulum([lag, pid], "=x.lag")
    run = pg.simulate(model, states={"pid": [5.0, -0.4]}, q=[0.4], t_end=0.1, rtol=1e-9)
    assert run.states[0].tolist() == [5.0, 5.0, -0.4]
    assert pg.simulate(model, q=[0.4], t_end=0.1, rtol=1e-9).states[0].tolist() == [0, 0, -0.4]


def test_a_stepper_and_a_batch_reset_to_states():
    model, call = pendulum(EVERY, WHOLE), {"step": 2.0**-7, "method": "rk4"}
    start = np.arange(4.0)
    run = pg.simulate(model, states=start, t_end=0.5, **call)
    stepper, batch = pg.Stepper(model, **call), pg.BatchStepper(model, 3, **call)
    stepper.step(n=3)
    stepper.reset(states=start)
    batch.step(n=3)
    batch.reset(states=start)
    assert np.array_equal(batch.states, np.tile(start, (3, 1)))
    for one in (stepper, batch):
        one.step(n=64)
        assert np.array_equal(np.atleast_2d(one.states)[-1], run.states[-1])
        assert np.array_equal(np.atleast_2d(one.q)[-1], run.q[-1])
    batch.reset(q=[0.4], which=[1], states=start)
    batch.step(n=64)
    run = pg.simulate(model, q=[0.4], states=start, t_end=0.5, **call)
    assert np.array_equal(batch.states[1], run.states[-1])


def test_a_model_without_controls_has_no_states_to_give():
    run = pg.simulate(pendulum(), q=[0.4], t_end=0.5, step=0.01, method="rk4")
    assert continued(pendulum(), run, t_end=1.0, step=0.01, method="rk4").status.ok


REFUSED = [
    ({"states": {"pod": 1.0}}, ["'pod'", "pid"]),
    ({"states": [1.0]}, ["(4,)", "(1,)"]),
    ({"states": {"pid": [1.0, 2.0]}}, ["states['pid']", "(1,)", "(2,)"]),
    ({"states": [0.0, 1.0, 2.0, np.nan]}, ["finite", "3", "nan"]),
    ({"states": 3.0}, ["(4,)"]),
    ({"states": "pid"}, ["numbers", "'pid'"]),
    ({"states": np.zeros(3), "wrt": ["k"]}, ["wrt"]),
]


@pytest.mark.parametrize(("call", "facts"), REFUSED)
def test_states_that_do_not_fit_are_refused(call, facts):
    with pytest.raises(pg.InputError) as error:
        pg.simulate(pendulum(EVERY[:3], WHOLE[:-6]) if "wrt" in call else pendulum(EVERY, WHOLE),
                    t_end=0.1, **call)  # fmt: skip
    assert_names(str(error.value), *facts)


@pytest.mark.parametrize("own", [{"lag": 0.5}, {"integrates": True}])
def test_states_of_drives_that_begin_anew_are_named(own):
    cart = pg.Body(name="m", joint="prismatic", axes=[(1, 0, 0)])
    push = pg.Motor(name="push", body="m", torque=1.0, **own)
    model = pg.Model(bodies=[cart], forces=[push], gravity=(0, 0, 0))
    first = pg.simulate(model, t_end=1.0)
    again = pg.simulate(
        model, first.q[-1], first.v[-1], states=first.states[-1], t_start=1.0, t_end=2.0
    )
    assert first.notices == ()
    assert any("push" in text for text in again.notices)
