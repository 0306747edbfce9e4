"""States, filters, PID and sampled controllers obey their equations in every method."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pgraph_core as pg
from tests.controlled import EVERY, STATES, TORQUE, WHOLE, Z, pendulum

ALL = ("rk4", "semi_implicit_euler", "dopri5", "dop853", "radau5", "gauss6")


def followed(law, start, t_end, breaks=()):
    """The state [q, v, controls ...] at t_end, where law(t, y) is (torque, rates ...)."""

    def rate(t, y):
        torque, *others = law(t, y)
        return y[1], (torque - 9.81 * np.cos(y[0])) / 0.7, *others

    y = np.array(start, dtype=float)
    for a, b in zip((0.0, *breaks), (*breaks, t_end)):
        y = solve_ivp(rate, (a, b), y, rtol=1e-13, atol=1e-14, method="DOP853").y[:, -1]
    return y


def law_of_states(t, y):
    q, v, i, f = y
    return 5 * i - 2 * f, 1 - q - 0.2 * i, (v - f) / 0.1


@pytest.mark.parametrize("method", ALL)
def test_states_are_integrated_by_every_method_to_its_order(method):
    model = pendulum(STATES, TORQUE)
    run = pg.simulate(model, t_end=1.0, q=[0.4], v=[0.5], step=1e-3, method=method)
    end = followed(law_of_states, (0.4, 0.5, 0.3, 0.5), 1.0)  # a filter starts at its input
    found = [run.q[-1, 0], run.v[-1, 0], *run.states[-1]]
    order = 1e-2 if method == "semi_implicit_euler" else 1e-8
    assert np.allclose(found, end, rtol=0, atol=order)
    assert run.q.shape == run.v.shape == run.vdot.shape == (len(run.t), 1)
    assert np.array_equal(run.controls["i"], run.states[:, 0])
    assert np.array_equal(run.columns()["x.f"], run.states[:, 1])


def test_states_have_no_energy():
    run = pg.simulate(pendulum(STATES, TORQUE), t_end=1.0, q=[0.4], rtol=1e-11)
    assert np.allclose(run.kinetic_energy, 0.35 * run.v[:, 0] ** 2, rtol=1e-12)
    assert np.ptp(run.energy - run.work) < 1e-8


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_large_state_does_not_loosen_the_tolerance_of_the_motion(size):
    other = pg.State(name="large", rate=f"={size!r}*(1 + cos(9*t))")
    run = pg.simulate(pendulum([*STATES, other], TORQUE), t_end=1.0, q=[0.4], rtol=1e-9)
    end = followed(law_of_states, (0.4, 0.0, 0.3, 0.0), 1.0)
    assert abs(run.q[-1, 0] - end[0]) < 1e-8
    assert np.isclose(run.states[-1, 2], size * (1 + np.sin(9) / 9), rtol=1e-8)
    assert run.error_estimate < 1e-8


LIMIT = 14.0


PIDS = {  # fields, and the rate of the integral i with its rate ki e where free - u is cut off
    "none": ({"windup": "none"}, lambda i, rate, cut: rate),
    "clamp": ({}, lambda i, rate, cut: 0.0 if abs(i) >= LIMIT and i * rate > 0 else rate),
    "back": ({"windup": "back", "tracking": 0.3}, lambda i, rate, cut: rate - cut / 0.3),
}


@pytest.mark.parametrize("windup", PIDS)
def test_a_pid_with_limits_follows_its_equations(windup):
    fields, integral = PIDS[windup]
    pid = pg.PID(
        name="hold", signal="=q.arm", setpoint="=if(t < 0.8, -1.2, 0.5)", kp=10.0, ki=60.0, kd=4.0,
        filter=0.02, low=-LIMIT, high=LIMIT, **fields,
    )  # fmt: skip

    def law(t, y):
        q, _, i, d = y
        e = (-1.2 if t < 0.8 else 0.5) - q
        free = 10 * e + i + 4 * (e - d) / 0.02
        u = min(max(free, -LIMIT), LIMIT)
        return u, integral(i, 60 * e, free - u), (e - d) / 0.02

    run = pg.simulate(pendulum([pid], "=x.hold"), t_end=2.0, q=[0.5], rtol=1e-12)
    end = followed(law, (0.5, 0.0, 0.0, -1.7), 2.0, breaks=(0.8,))
    assert np.allclose([run.q[-1, 0], run.v[-1, 0], *run.states[-1]], end, rtol=0, atol=1e-8)
    assert run.controls["hold"].min() == -LIMIT  # it was at its limit, and left it
    assert (np.abs(run.controls["hold"]) < LIMIT).any()
    assert (np.abs(run.states[:, 0]).max() > 1.01 * LIMIT) == (windup != "clamp")
    assert {"x.hold", "x.hold.1", "x.hold.2"} <= set(run.columns())


def test_a_pid_that_reads_another_one_is_a_cascade():
    outer = pg.PID(name="outer", signal="=q.arm", setpoint=0.3, kp=4.0)
    inner = pg.PID(name="inner", signal="=v.arm", setpoint="=x.outer", kp=8.0, ki=20.0)
    run = pg.simulate(pendulum([inner, outer], "=x.inner"), t_end=1.0, rtol=1e-11)

    def law(t, y):
        e = 4 * (0.3 - y[0]) - y[1]
        return 8 * e + y[2], 20 * e, 0.0

    end = followed(law, (0.0, 0.0, 0.0, 0.0), 1.0)
    assert np.allclose([run.q[-1, 0], run.states[-1, 0]], end[[0, 2]], rtol=0, atol=1e-9)


def sampled_by_hand(period, t_end, law, start, values):
    """The end of a motion whose controls change to law(t, y, values) at samples."""
    y, t, k = np.array(start, dtype=float), 0.0, 0
    while t < t_end - 1e-12:
        values = law(t, y, values)
        k, t = k + 1, min((k + 1) * period, t_end)
        rate = lambda t, y, u=values[0]: (y[1], (u - 9.81 * np.cos(y[0])) / 0.7)  # noqa: E731
        y = solve_ivp(rate, ((k - 1) * period, t), y, rtol=1e-12, atol=1e-13, method="DOP853").y[
            :, -1
        ]
    return y, law(t, y, values)


@pytest.mark.parametrize("how", [{"rtol": 1e-10}, {"step": 1e-3, "method": "rk4"}])
@pytest.mark.parametrize("period", [0.05, 0.037])
def test_sampled_values_are_held_between_samples_at_which_steps_end(how, period):
    controls = [pg.Sampled(name="u", update="=-20*q.arm - 3*v.arm + 0.1*x.u", sample=period)]
    run = pg.simulate(pendulum(controls, "=x.u"), t_end=period * 20, q=[0.4], **how)
    law = lambda t, y, u: (-20 * y[0] - 3 * y[1] + 0.1 * u[0],)  # noqa: E731
    end, u = sampled_by_hand(period, period * 20, law, (0.4, 0.0), (0.0,))
    assert np.allclose([run.q[-1, 0], run.v[-1, 0]], end, rtol=0, atol=1e-9)
    assert np.isclose(run.states[-1, 0], u[0], rtol=0, atol=1e-7)
    assert len(np.unique(run.states[:, 0])) == 21


def test_all_samples_of_an_instant_read_the_values_before_it():
    a = pg.Sampled(name="a", update="=x.a + 1", sample=0.1)
    b = pg.Sampled(name="b", update="=x.a", sample=0.1)
    run = pg.simulate(pendulum([a, b]), t_end=0.45, step=0.01, method="rk4")
    assert run.states[-1].tolist() == [5.0, 4.0]


def test_a_pid_with_samples_is_the_difference_equation():
    h, lag = 0.02, 0.05
    pid = pg.PID(
        name="hold", signal="=q.arm", setpoint=0.3, kp=40.0, ki=50.0, kd=5.0, filter=lag,
        low=-12.0, high=12.0, sample=h,
    )  # fmt: skip

    def law(t, y, x):
        _, i, d = x
        e = 0.3 - y[0]
        d = e if d is None else d
        free = 40 * e + i + 5 * (e - d) / (lag + h)
        u = min(max(free, -12.0), 12.0)
        i = min(max(i + h * 50 * e, -12.0), 12.0)
        return u, i, d + h * (e - d) / (lag + h)

    run = pg.simulate(pendulum([pid], "=x.hold"), t_end=1.0, rtol=1e-11)
    end, _ = sampled_by_hand(h, 1.0, law, (0.0, 0.0), (0.0, 0.0, None))
    assert np.allclose([run.q[-1, 0], run.v[-1, 0]], end, rtol=0, atol=1e-8)


def test_events_and_torque_functions_see_the_motion_alone():
    seen = []

    def event(t, q, v):
        seen.append((len(q), len(v)))
        return q[0]

    def torque(t, q, v):
        return -3 * q - v

    given = pg.simulate(
        pendulum(EVERY, WHOLE), t_end=0.5, q=[0.4], rtol=1e-9, events=event, tau=torque
    )
    law = f"{WHOLE} - 3*q.arm - v.arm"
    same = pg.simulate(pendulum(EVERY, law), t_end=0.5, q=[0.4], rtol=1e-9)
    assert set(seen) == {(1, 1)}
    assert np.allclose(given.q[-1], same.q[-1], rtol=0, atol=1e-7)


def test_conditions_may_name_controls():
    count = pg.State(name="time", rate=1.0)
    weld = pg.Weld(name="catch", body="arm", active=False)
    model = pendulum([count], constraints=[weld])
    switch = {"constraint": "catch", "active": True, "when": {"holds": "=x.time > 0.25"}}
    run = pg.simulate(model, t_end=0.5, rtol=1e-10, switches=[pg.Switch(**switch)])
    after = run.t > 0.2501
    assert np.abs(run.v[after]).max() < 1e-12
    assert np.abs(run.v[~after]).max() > 1.0
    assert abs(run.q[-1, 0] - pg.simulate(pendulum(), t_end=0.25, rtol=1e-10).q[-1, 0]) < 1e-9


def test_a_loop_with_constraints_keeps_its_states():
    slider = pg.Body(name="slider", joint="prismatic", axes=[(1, 0, 0)], mass=1.0)
    crank = pg.Body(name="crank", axes=[Z], mass=1.0, com=(0.1, 0, 0), tip=(0.3, 0, 0))
    rod = pg.Body(
        name="rod", parent="crank", link=(0.3, 0, 0), axes=[Z], inertia=(0.01,) * 3, tip=(1, 0, 0)
    )  # fmt: skip
    tie = pg.Point(name="pin", body="rod", other="slider")
    model = pg.Model(
        bodies=[slider, crank, rod], gravity=(0, -9.81, 0), constraints=[tie],
        forces=[pg.Motor(name="m", body="crank", torque="=x.speed")],
        controls=[pg.PID(name="speed", signal="=v.crank", setpoint=3.0, kp=5.0, ki=20.0)],
    )  # fmt: skip
    run = pg.simulate(model, q=[1.25, 0.1, -0.1], t_end=4.0, rtol=1e-9)
    assert run.status.ok
    assert abs(run.energy[-1] - run.energy[0] - run.work[-1]) < 1e-6
    assert run.constraint_drift.max() < 1e-8


@pytest.mark.parametrize("method", ["auto", "dop853"])
def test_controls_run_beside_contacts(method):
    ball = pg.Body(
        name="ball", joint="prismatic", axes=[Z], mass=1.0, q=[0.5],
        shape=pg.Shape(kind="sphere", radius=0.1),
    )  # fmt: skip
    lag = pg.Filter(name="lag", input="=q.ball", lag=0.2)
    floor = pg.Contact(name="floor", body="ball", restitution=0.5)
    model = pg.Model(bodies=[ball], contacts=[floor], controls=[lag])
    call = {"t_end": 1.0, "method": method} | ({"rtol": 1e-9} if method == "dop853" else {})
    run = pg.simulate(model, **call)
    bare = pg.simulate(model.replace(controls=[]), **call)
    assert run.status.ok
    assert np.allclose(run.q[-1], bare.q[-1], rtol=0, atol=1e-6)
    x = solve_ivp(
        lambda t, x: (np.interp(t, run.t, run.q[:, 0]) - x) / 0.2, (0, 1), [0.5], rtol=1e-8,
        max_step=1e-3,
    ).y[0, -1]  # fmt: skip
    assert abs(run.states[-1, 0] - x) < 2e-3


def test_a_controller_that_nothing_follows_rests_with_what_it_controls():
    """A run at rest looked at the states of the control as positions, and failed."""
    wheel = pg.Body("wheel", axes=[(0, 0, 1)], inertia=(0.01,) * 3)
    control = pg.PID(name="hold", signal="=q.wheel")
    run = pg.simulate(pg.Model([wheel], controls=[control], up="z"), t_end=0.01)
    assert run.status.ok
    assert any("nothing moves" in text for text in run.notices)
