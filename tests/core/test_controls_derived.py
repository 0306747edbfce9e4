"""Derivatives, linearisation and feedback go through the states of controls."""

import numpy as np
import pytest

import pgraph_core as pg
from tests.controlled import EVERY, STATES, TORQUE, WHOLE, pendulum

from ..nights import combined


@pytest.mark.parametrize("path", ["k", "controls.f.lag", "controls.i.start", "bodies.arm.mass"])
def test_derivatives_go_through_states(path):
    model = pendulum(STATES, TORQUE)
    call = {"t_end": 0.5, "q": [0.4], "v": [0.3], "step": 5e-3, "method": "rk4"}
    run = pg.simulate(model, wrt=[path], **call)

    def end(change):
        words = path.split(".")
        if path == "k":
            return pg.simulate(model.replace(parameters={"k": 5.0 + change}), **call)
        kind = {"controls": "control", "bodies": "body"}[words[0]]
        present = getattr(model.part(words[1], kind), words[2])
        return pg.simulate(model.edit(words[1], kind=kind, **{words[2]: present + change}), **call)

    h = 1e-4
    runs = [end(k * h) for k in (-2, -1, 1, 2)]
    weights = np.array([1, -8, 8, -1]) / (12 * h)
    by = sum(w * np.column_stack((r.q, r.v)) for w, r in zip(weights, runs))
    assert np.allclose(run.sensitivity(path), by, rtol=1e-7, atol=1e-9)
    slope = run.gradient(lambda r: r.states[-1, 0])[path]
    assert np.isclose(slope, sum(w * r.states[-1, 0] for w, r in zip(weights, runs)), rtol=1e-6)
    assert np.array_equal(run.q, pg.simulate(model, **call).q)


SLIDER = pg.Body(name="s", joint="prismatic", axes=[(1, 0, 0)], q=[0.5], v=[1.0])


FOLLOWING = (
    pg.Filter(name="c", input="=v.s + sin(3*q.s)", lag=1.0),
    pg.PID(name="c", signal="=q.s*v.s", setpoint=0.3, kp=2.0, ki=1.0, kd=0.5, filter=0.2),
)


def slider(control, **fields):
    drive = pg.Motor(name="p", body="s", torque="=x.c")
    return pg.Model(bodies=[SLIDER], gravity=(0, 0, 0), controls=[control], forces=[drive])


@pytest.mark.parametrize(
    ("kind", "control", "method"), combined("qv", FOLLOWING, ["dop853", "rk4", "radau5"])
)
def test_states_start_from_what_a_run_is_differentiated_by(kind, control, method):
    path = f"{kind}.s"
    call = {"t_end": 1.0, "method": method, "frames": 11, "estimate": False, "wrt": [path]}
    run = pg.simulate(slider(control), **call)
    again = pg.simulate(slider(control), **call | {"wrt": [f"bodies.s.{kind}.0"]})
    expected = again.sensitivity(f"bodies.s.{kind}.0")
    assert np.allclose(run.sensitivity(path), expected, rtol=1e-9, atol=1e-11)
    by = run.gradient(lambda r: r.states[0, -1])[path]  # at the start, where it has no memory yet
    assert np.isclose(by, again.gradient(lambda r: r.states[0, -1])[f"bodies.s.{kind}.0"])
    assert abs(by) > 0.1


def test_a_filter_that_starts_at_its_input_has_its_closed_form():
    """Of v' = x, x' = v - x with x = v at first, whose rates are those of r^2 + r = 1."""
    run = pg.simulate(
        slider(pg.Filter(name="c", input="=v.s", lag=1.0)), t_end=1.0, rtol=1e-11, wrt=["v.s"]
    )
    slow, fast = (-1 + np.sqrt(5)) / 2, (-1 - np.sqrt(5)) / 2
    a = (1 - fast) / (slow - fast)
    v = a * np.exp(slow) + (1 - a) * np.exp(fast)
    q = a * np.expm1(slow) / slow + (1 - a) * np.expm1(fast) / fast
    assert np.allclose(run.sensitivity("v.s")[-1], [q, v], rtol=1e-9)


def test_starts_by_name_are_those_of_the_bodies_alone():
    model = slider(FOLLOWING[0])
    call = {"t_end": 0.5, "wrt": ["v.s"]}
    named, plain = (pg.simulate(model, v=v, **call) for v in ({"s": 2.0}, [2.0]))
    assert named == plain
    assert np.array_equal(named.sensitivity("v.s"), plain.sensitivity("v.s"))
    assert pg.simulate(model, {"s": 0.1}, {"s": 2.0}, t_end=0.5) == pg.simulate(
        model, [0.1], [2.0], t_end=0.5
    )


def jacobian_by_hand(q):
    """Of [q, v, i, f] of the pendulum with STATES, at rest."""
    motion = [9.81 * np.sin(q) / 0.7, 0, 5 / 0.7, -2 / 0.7]
    return np.array([[0, 1, 0, 0], motion, [-1, 0, -0.2, 0], [0, 10, 0, -10]])


def test_linearisation_has_the_states():
    mech = pg.Mechanism(pendulum(STATES, TORQUE))
    q = mech.equilibrium([0.4])
    i = (1 - q[0]) / 0.2
    assert abs(5 * i - 9.81 * np.cos(q[0])) < 1e-8
    found = mech.linearise(q)
    assert found.states == ("x.i[1]", "x.f[1]")
    assert np.allclose(found.s, [i, 0.0], atol=1e-9)
    assert np.allclose(found.A, jacobian_by_hand(q[0]), rtol=0, atol=1e-8)
    assert np.allclose(found.B[:, 0], [0, 1 / 0.7, 0, 0], rtol=0, atol=1e-10)
    assert np.abs(found.drift).max() < 1e-8
    assert not found.notices
    A, B, C, D = found.state_space()
    assert C.shape == (1, 4)


def test_a_small_motion_with_states_is_that_of_its_linearisation():
    from scipy.linalg import expm

    model = pendulum(STATES, TORQUE)
    mech = pg.Mechanism(model)
    q = mech.equilibrium([0.4])
    found = mech.linearise(q)
    started = model.edit("i", kind="control", start=found.s[0])
    runs = [
        pg.simulate(started, t_end=0.5, q=q + h, rtol=1e-12).q[-1, 0] for h in (1e-4, -1e-4)
    ]  # fmt: skip
    assert np.isclose((runs[0] - runs[1]) / 2e-4, expm(0.5 * found.A)[0, 0], rtol=1e-6)


@pytest.mark.parametrize("windup", ["none", "clamp"])
def test_the_integral_of_a_pid_holds_the_load(windup):
    pid = pg.PID(name="c", signal="=q.arm", setpoint=0.3, kp=40.0, ki=30.0, kd=9.0, filter=0.01,
                 low=-50.0, high=50.0, windup=windup)  # fmt: skip
    mech = pg.Mechanism(pendulum([pid], "=x.c"))
    q = mech.equilibrium()
    assert np.isclose(q[0], 0.3, rtol=0, atol=1e-8)
    found = mech.linearise(q)
    assert np.allclose(found.s, [9.81 * np.cos(0.3), 0.0], atol=1e-7)
    assert np.abs(found.drift).max() < 1e-6
    k = 9.81 * np.sin(0.3)
    motion = [(k - 40 - 900) / 0.7, 0, 1 / 0.7, -900 / 0.7]
    A = np.array([[0, 1, 0, 0], motion, [-30, 0, 0, 0], [-100, 0, 0, -100]])
    assert np.allclose(found.A, A, rtol=1e-7, atol=1e-6)


def test_lqr_feeds_an_integral_back():
    from scipy.linalg import solve_continuous_are

    body = pg.Body(name="s", joint="prismatic", axes=[(1, 0, 0)], mass=2.0)
    model = pg.Model(
        bodies=[body], gravity=(0, 0, 0), controls=[pg.State(name="sum", rate="=q.s - 0.5")],
        forces=[pg.Motor(name="p", body="s"), pg.Wrench(name="load", body="s", force=[-7.0, 0, 0])],
    )  # fmt: skip
    found = pg.lqr(model, [1.0, 1.0, 4.0], 0.5, q=[0.5])
    assert found.states == ("q.s", "v.s", "x.sum[1]")
    A, B = np.array([[0, 1, 0], [0, 0, 0], [1, 0, 0.0]]), np.array([[0], [0.5], [0.0]])
    P = solve_continuous_are(A, B, np.diag([1.0, 1.0, 4.0]), [[0.5]])
    assert np.allclose(found.K, B.T @ P / 0.5, rtol=1e-10)
    heavier = found.model.edit("load", force=[-9.0, 0, 0])  # a load that nobody told it
    run = pg.simulate(heavier, t_end=20.0, rtol=1e-9)
    assert np.isclose(run.q[-1, 0], 0.5, atol=1e-6)
    assert pg.place_poles(model, [-1, -2, -3], q=[0.5]).stable


def test_linearisation_by_samples_is_refused():
    for call in (
        lambda m: pg.Mechanism(m).linearise(),
        lambda m: pg.Mechanism(m).equilibrium(),
        lambda m: pg.lqr(m, 1.0),
    ):
        with pytest.raises(pg.InputError, match="'u'"):
            call(pendulum(EVERY, WHOLE))
