"""Controls: states, filters, PID and sampled controllers obey their equations in every run."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pgraph_core as pg

Z = (0, 0, 1)
ALL = ("rk4", "semi_implicit_euler", "dopri5", "dop853", "radau5", "gauss6")


def pendulum(controls=(), torque=0.0, **fields):
    arm = pg.Body(name="arm", axes=[Z], mass=2.0, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.2))
    drive = [pg.Motor(name="drive", body="arm", torque=torque)]
    return pg.Model(
        bodies=[arm], gravity=(0, -9.81, 0), forces=drive, controls=list(controls),
        parameters={"k": 5.0}, **fields,
    )  # fmt: skip


def followed(law, start, t_end, breaks=()):
    """The state [q, v, controls ...] at t_end, where law(t, y) is (torque, rates ...)."""

    def rate(t, y):
        torque, *others = law(t, y)
        return y[1], (torque - 9.81 * np.cos(y[0])) / 0.7, *others

    y = np.array(start, dtype=float)
    for a, b in zip((0.0, *breaks), (*breaks, t_end)):
        y = solve_ivp(rate, (a, b), y, rtol=1e-13, atol=1e-14, method="DOP853").y[:, -1]
    return y


STATES = (
    pg.State(name="i", rate="=1 - q.arm - 0.2*x.i", start=0.3),
    pg.Filter(name="f", input="=v.arm", lag=0.1),
)
TORQUE = "=k*x.i - 2*x.f"


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


EVERY = (
    *STATES,
    pg.PID(
        name="pid",
        signal="=q.arm",
        setpoint="=x.i",
        kp=4.0,
        ki=3.0,
        low=-2.0,
        high=2.0,
        windup="back",
        tracking=0.2,
    ),
    pg.Sampled(name="u", update="=-3*q.arm + 0.2*x.u", sample=0.05),
)
WHOLE = "=k*x.i - 2*x.f + x.pid + x.u"


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler", "gauss6"])
def test_runs_steppers_batches_and_sweeps_have_the_same_bits(method):
    model = pendulum(EVERY, WHOLE)
    call = {"step": 1e-2, "method": method}
    run = pg.simulate(model, t_end=1.0, q=[0.4], frames=101, **call)
    assert run.status.ok
    stepper = pg.Stepper(pg.Mechanism(model), q=[0.4], **call)
    stepper.step(n=40)
    kept = stepper.save()
    stepper.step(n=7)
    stepper.restore(kept)
    stepper.step(n=60)
    assert np.array_equal(stepper.q, run.q[-1])
    assert np.array_equal(stepper.states, run.states[-1])
    assert stepper.controls == {name: x[-1] for name, x in run.controls.items()}
    stepper.reset(q=[0.4])
    assert np.array_equal(stepper.record_over(1.0, frames=101).states, run.states)
    batch = pg.BatchStepper(pg.Mechanism(model), 3, set={"k": [1.0, 5.0, 7.0]}, **call)
    batch.reset(q=[[0.4]] * 3)
    batch.step(n=100)
    assert np.array_equal(batch.q[1], run.q[-1])
    assert np.array_equal(batch.v[1], run.v[-1])
    metric = {"last": lambda run: float(run.q[-1, 0]), "x": lambda run: float(run.states[-1, 0])}
    swept = pg.sweep(model, {"k": [1.0, 5.0, 7.0]}, metric, t_end=1.0, q=[0.4], **call)
    assert np.array_equal(np.asarray(swept["last"]), batch.q[:, 0])
    assert np.asarray(swept["x"])[1] == run.states[-1, 0]


def test_the_command_line_has_the_same_bits(tmp_path):
    model = pendulum(EVERY, WHOLE)
    model.save(tmp_path / "m.json")
    call = [sys.executable, "-m", "pgraph_app", "run", "m.json", "--t-end", "1", "--step", "0.01"]
    subprocess.run([*call, "--method", "rk4", "--out", "m.npz"], cwd=tmp_path, check=True)
    found = pg.Result.load(tmp_path / "m.npz")
    run = pg.simulate(model, t_end=1.0, step=0.01, method="rk4")
    assert np.array_equal(found.q, run.q[-len(found.q) :])
    assert np.array_equal(found.states, run.states)


def test_runs_with_controls_round_trip_through_files(tmp_path):
    run = pg.simulate(pendulum(EVERY, WHOLE), t_end=0.5, step=0.01, method="rk4")
    run.save(tmp_path / "r.npz")
    again = pg.Result.load(tmp_path / "r.npz")
    assert again == run
    assert all(np.array_equal(again.controls[name], run.controls[name]) for name in run.controls)
    assert '"schema_version": 7' in run.mechanism.model.to_json()


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


@pytest.mark.parametrize("method", ["dop853", "rk4", "radau5"])
@pytest.mark.parametrize("control", FOLLOWING, ids=["filter", "pid"])
@pytest.mark.parametrize("kind", ["q", "v"])
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


def noted(run, name):
    return any(f"'{name}'" in text for text in run.notices)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("v", [0.0, 0.3])
def test_an_error_of_a_state_that_no_force_reads_is_told(size, v):
    rod = pg.Body(name="rod", axes=[Z], v=[v])
    state = pg.State(name="s", rate=f"=100*({size!r}*sin(50*t) - x.s)")
    model = pg.Model(bodies=[rod], gravity=(0, 0, 0), controls=[state])
    coarse, fine = (pg.simulate(model, t_end=1.0, method="rk4", step=step) for step in (2e-2, 2e-3))
    assert noted(coarse, "s")
    assert not noted(fine, "s")
    assert coarse.error_estimate < 1e-12  # of the motion


@pytest.mark.parametrize("options", [{}, {"method": "rk4", "step": 1e-2}])
def test_states_that_are_right_or_at_rest_are_not_told(options):
    resting, moving = pendulum([STATES[1]]), pendulum(EVERY, TORQUE)
    for model, q in ((resting, -np.pi / 2), (moving, 0.4)):
        run = pg.simulate(model, [q], t_end=1.0, **options)
        assert not any("control" in text for text in run.notices)


def test_derivatives_by_what_is_sampled_are_refused():
    with pytest.raises(pg.InputError, match="samples"):
        pg.simulate(pendulum(EVERY[3:], "=x.u"), t_end=0.1, wrt=["k"], step=1e-2, method="rk4")


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
    rod = pg.Body(name="rod", parent="crank", link=(0.3, 0, 0), axes=[Z], mass=1.0, tip=(1, 0, 0))
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


def test_models_without_controls_have_none():
    run = pg.simulate(pendulum(torque="=-3*q.arm"), t_end=0.1)
    assert run.states.shape == (len(run.t), 0)
    assert run.controls == {}


@pytest.mark.parametrize(
    ("control", "facts"),
    [
        (pg.State(name="c", rate="=1/(t - 0.25)"), ("'c'", "=1/(t - 0.25)")),
        (pg.Sampled(name="c", update="=sqrt(0.25 - t)", sample=0.1), ("'c'", "sqrt")),
    ],
)
@pytest.mark.parametrize("how", [{"step": 0.01, "method": "rk4"}, {"rtol": 1e-6}])
def test_a_control_without_a_value_ends_the_run_and_is_named(control, facts, how):
    run = pg.simulate(pendulum([control], "=x.c"), t_end=1.0, **how)
    assert not run.status.ok
    assert all(fact in run.message for fact in facts)


def test_a_sample_time_below_the_step_is_refused():
    control = pg.Sampled(name="c", update="=q.arm", sample=1e-3)
    for call in (
        lambda m: pg.simulate(m, t_end=1.0, step=1e-2, method="rk4"),
        lambda m: pg.Stepper(m, step=1e-2),
        lambda m: pg.BatchStepper(pg.Mechanism(m), 2, step=1e-2),
    ):
        with pytest.raises(pg.InputError) as refused:
            call(pendulum([control], "=x.c"))
        text = str(refused.value)
        assert all(fact in text for fact in ("'c'", "sample", "0.001", "0.01"))


@pytest.mark.parametrize(
    ("control", "facts"),
    [
        (pg.PID(name="c", signal="=x.c"), ("'c'", "loop", "x.c -> x.c")),
        (pg.PID(name="c", signal="=q.arn"), ("'c'", "'arn'", "arm")),
        (pg.PID(name="c", signal="=q.arm", setpoint="=v.arm"), ("setpoint", "rad/s")),
        (pg.PID(name="c", signal="=x.f"), ("'f'",)),
        (pg.State(name="c", rate="=x.c[2]"), ("states from 1 to 1", "2")),
        (pg.State(name="c", rate="=q.arm + v.arm"), ("rad and rad/s",)),
    ],
)
def test_what_does_not_fit_the_model_is_refused(control, facts):
    with pytest.raises(pg.ModelError) as refused:
        pendulum([control])
    assert all(fact in str(refused.value) for fact in facts)


def test_a_loop_is_named_with_its_path():
    names = ("a", "b", "c")
    pids = [pg.PID(name=x, signal=f"=x.{y}") for x, y in zip(names, "bca")]
    with pytest.raises(pg.ModelError, match=r"x.a -> x.b -> x.c -> x.a"):
        pendulum(pids)
    broken = [
        *pids[:2],
        pg.PID(name="c", signal="=x.lag"),
        pg.Filter(name="lag", input="=x.a", lag=1),
    ]
    pendulum(broken)


@pytest.mark.parametrize(
    "fields",
    [
        {"kd": 1.0}, {"windup": "back"}, {"low": 1.0, "high": 1.0}, {"filter": 0.0},
        {"sample": -1.0}, {"windup": "stop"},
    ],
)  # fmt: skip
def test_fields_that_do_not_fit_each_other_are_refused(fields):
    with pytest.raises(pg.ModelError):
        pg.PID(name="c", signal="=q.arm", **fields)


def test_controls_follow_new_names_and_go_with_what_they_read():
    model = pendulum(EVERY, WHOLE)
    assert model.edit("arm", name="leg").controls[0].rate == "=1 - q.leg - 0.2*x.i"
    new = model.edit("i", kind="control", name="sum")
    assert new.controls[0].rate == "=1 - q.arm - 0.2*x.sum"
    assert new.part("pid", "control").setpoint == "=x.sum"
    assert new.forces[0].torque == "=k*x.sum - 2*x.f + x.pid + x.u"
    assert not model.remove("arm").controls
    assert pg.Model.from_json(model.to_json()) == model


def legs():
    bodies = [
        pg.Body(name="trunk", joint="prismatic", axes=[(1, 0, 0)]),
        pg.Body(name="left hip", parent="trunk", axes=[Z], link=(0, 0, 0.1), com=(0.2, 0, 0)),
    ]
    return pg.Model(bodies=bodies, parameters={"k": 2.0})


@pytest.mark.parametrize(
    ("torque", "copied"),
    [
        ('=-3*q["left hip"]', True), ("=-k*v.trunk", False), ("=x.clock", True),
        ("=x.hip", False), ("=x.after", False),
    ],
)  # fmt: skip
def test_a_mirror_image_has_no_terms_of_another_sign(torque, copied):
    controls = [
        pg.State(name="clock", rate=1.0),
        pg.Filter(name="hip", input='=q["left hip"]', lag=0.1),
        pg.Filter(name="after", input="=x.hip", lag=0.1),
    ]
    drive = pg.Motor(name="left drive", body="left hip", torque=torque)
    model = legs().replace(controls=controls, forces=[drive]).mirror("left hip", "x")
    assert [f.name for f in model.forces[1:]] == ["right drive"] * copied
    assert any("'left drive'" in text for text in model.notices) != copied


def test_a_copy_shares_no_control_of_the_original():
    controls = [pg.Filter(name="hip", input='=q["left hip"]', lag=0.1)]
    drive = pg.Motor(name="drive", body="left hip", torque="=x.hip")
    model = legs().replace(controls=controls, forces=[drive]).duplicate("left hip")
    assert len(model.forces) == 1
    assert any("'drive'" in text for text in model.notices)


@pytest.mark.parametrize(
    "text", ["=" + "1+" * 500_000 + "1", "=" + "(" * 10_000 + "1" + ")" * 10_000]
)
@pytest.mark.parametrize("kind", [{"kind": "state"}, {"kind": "sampled", "sample": 0.1}])
def test_size_and_depth_of_expressions_are_bounded(text, kind):
    field = {"state": "rate", "sampled": "update"}[kind["kind"]]
    with pytest.raises(pg.ModelError, match="column"):
        pg.Control(name="c", **kind, **{field: text})


LIMITED = {"limits": [(-9.0, 9.0)]}


@pytest.mark.parametrize("controls", [STATES, (*STATES, *EVERY[2:3])], ids=["states", "pid"])
def test_time_stepping_takes_states_to_the_order_of_its_step(controls):
    torque = TORQUE if len(controls) == 2 else f"{TORQUE} + x.pid"
    plain = pendulum(controls, torque)
    off = []
    for step in (1e-2, 5e-3, 2.5e-3):
        call = {"t_end": 1.0, "q": [0.4], "v": [0.5]}
        run = pg.simulate(plain.edit("arm", **LIMITED), method="moreau_jean", step=step, **call)
        exact = pg.simulate(plain, t_eval=run.t, rtol=1e-12, **call)
        apart = [np.abs(getattr(run, x) - getattr(exact, x)) for x in ("q", "v", "states")]
        off.append(np.concatenate([x.max(axis=0) for x in apart]))
        told = run.state_error_at[-1]
        assert (off[-1][2:] < 2 * told).all()
        assert (told < 2 * off[-1][2:]).all()
    # no force depends on the velocity itself: order two
    assert (off[1] < 0.27 * off[0]).all()
    assert (off[2] < 0.27 * off[1]).all()


def test_states_go_on_through_impacts():
    """The integral of the speed of a bouncing ball is its height, a count of time its time."""
    ball = pg.Body(name="ball", joint="prismatic", axes=[Z], mass=1.0, q=[0.5],
                   shape=pg.Shape(kind="sphere", radius=0.1))  # fmt: skip
    states = [pg.State(name="s", rate="=v.ball"), pg.State(name="t", rate=1.0)]
    floor = pg.Contact(name="floor", body="ball", restitution=0.7)
    model = pg.Model(bodies=[ball], contacts=[floor], controls=states)
    run = pg.simulate(model, t_end=1.5, method="moreau_jean", step=5e-3)
    assert np.allclose(run.states[:, 0], run.q[:, 0] - 0.5, rtol=0, atol=1e-12)
    assert np.allclose(run.states[:, 1], run.t, rtol=0, atol=1e-12)


def test_the_estimate_has_the_states():
    model = pendulum(STATES, TORQUE)
    coarse = pg.simulate(model, t_end=1.0, q=[0.4], step=5e-2, method="rk4")
    exact = pg.simulate(model, t_end=1.0, q=[0.4], rtol=1e-13, t_eval=coarse.t)
    assert coarse.state_error_at.shape == coarse.states.shape
    assert (np.diff(coarse.state_error_at, axis=0) >= 0).all()
    off = np.abs(coarse.states - exact.states).max(axis=0)
    assert (off < 2 * coarse.state_error_at[-1]).all()
    assert (coarse.state_error_at[-1] < 2 * off + 1e-12).all()
    shares = coarse.state_error_at[-1] / np.ptp(coarse.states, axis=0)
    assert coarse.relative_error[-1] >= shares.max()
    assert "x.f[1]" in coarse.accuracy or shares.max() <= coarse.error_estimate
    assert pg.simulate(model, t_end=1.0, step=5e-2, estimate=False).state_error_at.shape[1] == 2


@pytest.mark.parametrize("sample", [1e-300, 1e-17])
@pytest.mark.parametrize("how", [{"rtol": 1e-6}, {"step": 1e-3, "method": "rk4"}])
def test_a_sample_time_below_the_resolution_of_time_is_refused(sample, how):
    control = pg.Sampled(name="c", update="=q.arm", sample=sample)
    with pytest.raises(pg.InputError) as refused:
        pg.simulate(pendulum([control], "=x.c"), t_end=1.0, **how)
    assert all(fact in str(refused.value) for fact in ("'c'", "sample", f"{sample:g}"))


@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau5"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("lag", [1.0, 0.1, 0.01])
def test_frames_between_steps_are_as_good_as_their_ends(method, rtol, lag):
    controls = [pg.Filter(name="f", input="=v.arm + sin(5*t)", lag=lag)]
    model = pendulum(controls, "=-3*x.f")

    def rate(t, y):
        return y[1], (-3 * y[2] - 9.81 * np.cos(y[0])) / 0.7, (y[1] + np.sin(5 * t) - y[2]) / lag

    exact = solve_ivp(rate, (0, 3), (0.4, 0.0, 0.0), rtol=1e-13, atol=1e-14, method="DOP853",
                      dense_output=True)  # fmt: skip
    run = pg.simulate(model, t_end=3.0, q=[0.4], method=method, rtol=rtol, frames=301)
    found = np.column_stack((run.q, run.v, run.states))
    assert np.abs(found - exact.sol(run.t).T).max() < 100 * rtol


@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau5"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_a_state_that_begins_at_zero_is_as_accurate_as_others(method, rtol):
    """Its scale is that of accepted steps; SciPy's DOP853 is off by 2 rtol here."""
    rod = pg.Body(name="rod", axes=[Z], v=[0.3])
    state = pg.State(name="s", rate="=100*(sin(50*t) - x.s)")
    model = pg.Model(bodies=[rod], gravity=(0, 0, 0), controls=[state])
    run = pg.simulate(model, t_end=1.0, method=method, rtol=rtol, frames=1001)
    a, b = 0.8, -0.4  # of the response a sin + b cos
    exact = a * np.sin(50 * run.t) + b * np.cos(50 * run.t) - b * np.exp(-100 * run.t)
    off = np.abs(run.states[:, 0] - exact)
    assert off.max() < 50 * rtol
    assert off.max() < 3 * run.state_error_at[-1, 0] + 1e-12


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


@pytest.mark.parametrize("method", ["rk4", "semi_implicit_euler"])
def test_a_figure_begins_and_steps_as_a_run(method):
    """The memory that a figure takes over, stepped by the kernels that the module has too."""
    from pgraph_core.live.run import LiveRun, Setup

    model = pendulum(EVERY, WHOLE).edit("arm", q=[0.4])
    live = LiveRun(pg.Mechanism(model), Setup(step=1e-2), method)
    steps = live.record.steps
    steps.advance(100)
    run = pg.simulate(model, t_end=1.0, step=1e-2, method=method, frames=101)
    assert np.array_equal(steps.q[:1], run.q[-1])
    assert np.array_equal(steps.v, np.append(run.v[-1], run.states[-1]))


def test_a_figure_of_a_model_with_controls_leaves_fields_open():
    from pgraph_core.live.opened import follows, opened
    from pgraph_core.live.run import LiveRun, Setup

    def make(mech, method):
        return LiveRun(mech, Setup(step=1e-2), method)

    model = pendulum(EVERY, WHOLE).edit("arm", v=[0.5])
    runs = {method: make(pg.Mechanism(model), method) for method in ("rk4", "dopri5")}
    for path in ("controls.pid.kp=1:9", "controls.i.start=0:1", "k", "bodies.arm.mass=1:3"):
        ((field, of),) = follows(model, runs, [opened(model, path)], make)
        if "bodies" in path:
            assert field.number > 2  # some values, each with its numbers
        else:
            assert field.number == 0  # any value, by a rule
            assert all(of[method].copies for method in runs)
