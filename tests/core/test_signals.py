"""Expressions in fields of forces and motions: what they mean, and that every run obeys them."""

import contextlib
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import pgraph_core as pg
from pgraph_core.signals import Node, Unreadable, parsed, with_names
from pgraph_core.signals.meaning import constant

from ..nights import combined

X, Y, Z = np.eye(3)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("=-2^2", -4.0),
        ("=2^3^2", 512.0),
        ("=2^-1", 0.5),
        ("=7 - 2 - 1", 4.0),
        ("=12/3/2", 2.0),
        ("=1 + 2 < 4 and not 3 > 5", 1.0),
        ("=if(2 >= 2, 3, 4)*2", 6.0),
        ("=min(3, 1, 2) + max(1, -5)", 2.0),
        ("=smoothstep(0.25, 0, 1)", 0.15625),
        ("=table(1.5, 0, 1, 1, 3, 2, 4)", 3.5),
        ("=table(9, 0, 1, 1, 3)", 3.0),
        ("=0x10 + 1_000", 1016.0),
    ],
)
def test_operators_bind_as_in_mathematics(text, value):
    assert float(constant(parsed(text), {})) == value


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("=2*sin(3*t", 11), ("=q.", 4), ("=2*foo(3)", 4), ("=1 < 2 < 3", 8), ("=a b", 4),
        ("=(1", 4), ("=1)", 3), ("=2 $ 3", 4), ("=sin(1, 2)", 2), ("=q.a[x]", 6), ("=", 2),
        ("=table(t, 0, 1, 2)", 2), ("=q[arm]", 4),
    ],
)  # fmt: skip
def test_what_is_no_expression_is_refused_at_its_column(text, column):
    with pytest.raises(Unreadable) as refused:
        parsed(text)
    assert refused.value.column == column


@pytest.mark.parametrize(
    "text", ["=" + "1+" * 500_000 + "1", "=" + "(" * 10_000 + "1" + ")" * 10_000, "=" + "-" * 1900]
)
def test_size_and_depth_are_bounded(text):
    with pytest.raises(pg.ModelError, match="column"):
        pg.Motor(name="m", body="a", torque=text)


@given(st.text(max_size=80))
def test_any_text_is_read_or_refused(text):
    with contextlib.suppress(Unreadable):
        assert isinstance(parsed(f"={text}"), Node)


def test_names_are_exchanged_where_they_are_meant():
    text = '=q.a + q["a"] + v.a[0]*out.a + a'
    new = with_names(text, {"a": "left leg"}, ("q", "v"))
    assert new == '=q["left leg"] + q["left leg"] + v["left leg"][0]*out.a + a'
    assert with_names(new, {"left leg": "a"}, ("q", "v")) == "=q.a + q.a + v.a[0]*out.a + a"


def pendulum(**force):
    arm = pg.Body(
        name="arm", joint="revolute", axes=[Z], mass=2.0, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.2)
    )
    forces = [pg.Force(name="push", body="arm", **force)] if force else []
    return pg.Model(bodies=[arm], gravity=(0, -9.81, 0), parameters={"k": 3.0}, forces=forces)


def moved(law, q=0.4, v=0.0, t_end=1.5):
    """(q, v) of the pendulum at t_end under a torque law(t, q, v)."""

    def rate(t, y):
        return y[1], (law(t, *y) - 9.81 * np.cos(y[0])) / 0.7

    return solve_ivp(rate, (0, t_end), (q, v), rtol=1e-12, atol=1e-13, method="DOP853").y[:, -1]


WAYS = {
    "motor": (
        {"torque": "=2*sin(3*t) - k*q.arm - 0.3*v.arm*abs(v.arm)"},
        lambda t, q, v: 2 * np.sin(3 * t) - 3 * q - 0.3 * v * abs(v),
    ),
    "geared": (
        {"kind": "motor", "torque": "=exp(-t) + k*q.arm", "gear": -2.0},
        lambda t, q, v: -2 * (np.exp(-t) + 3 * q),
    ),
    "servo": (
        {"kp": 30.0, "kd": 2.0, "target": "=0.5*cos(2*t)", "torque": "=k*v.arm"},
        lambda t, q, v: 30 * (0.5 * np.cos(2 * t) - q) - 2 * v + 3 * v,
    ),
    "speed_servo": (
        {"kd": 4.0, "speed": "=table(t, 0, 0, 1, k)", "torque": pg.Table(t=[0, 2], value=[0, 6])},
        lambda t, q, v: 3 * t + 4 * (3 * min(t, 1) - v),
    ),
    "actuator": (
        {"gain": 5.0, "kp": 10.0, "kd": 1.0, "input": "=k*t", "input_high": 2.0},
        lambda t, q, v: 5 * min(3 * t, 2.0) - 10 * q - v,
    ),
    "wrench": (
        {"torque": [0, 0, "=k*cos(t)"], "force": [0, "=-2*v.arm", 1.0], "point": (1.0, 0, 0)},
        lambda t, q, v: 3 * np.cos(t) - 2 * v * np.cos(q),
    ),
    "in body": (
        {"kind": "wrench", "force": ["=7*t", "=k - v.arm", 0], "frame": "body", "point": X},
        lambda t, q, v: 3 - v,
    ),
}


@pytest.mark.parametrize("name", WAYS)
def test_a_run_obeys_the_law_that_is_written(name):
    force, law = WAYS[name]
    model = pendulum(**{"kind": name, **force})
    run = pg.simulate(model, t_end=1.5, q=[0.4], rtol=1e-10)
    assert run.status.ok
    assert np.allclose((run.q[-1, 0], run.v[-1, 0]), moved(law), rtol=0, atol=2e-8)
    assert pg.Model.from_json(model.to_json()) == model


@pytest.mark.parametrize("base", [-3.0, -0.5, 0.7, 2.0])
@pytest.mark.parametrize("power", [-21, -9, -3, -1, 0, 1, 2, 5, 8, 9, 14, 31])
def test_a_whole_power_of_any_number_is_its_product(base, power):
    size = base**power
    body = pg.Body(name="arm", axes=[Z], inertia=(1, 1, 1))
    push = pg.Motor(name="push", body="arm", torque=f"=({base} + 0*t)^{power}/{abs(size)!r}")
    model = pg.Model(bodies=[body], gravity=(0, 0, 0), forces=[push])
    run = pg.simulate(model, t_end=1.0, step=0.1, method="rk4")
    assert run.status.ok
    assert np.isclose(run.v[-1, 0], np.sign(size), rtol=1e-13)


def test_a_wrench_in_a_body_that_stands_turned_is_in_its_own_axes():
    quarter = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    body = pg.Body(name="b", joint="free", rotation=quarter, mass=2.0, inertia=(1, 2, 3))
    push = {"name": "p", "kind": "wrench", "body": "b", "frame": "body"}
    runs = [
        pg.simulate(
            pg.Model(bodies=[body], forces=[pg.Force(**push, force=force, torque=torque)]),
            t_end=1.0, v=[0.1, 0.2, 0.3, 0, 0, 0], step=1e-2, method="rk4",
        )
        for force, torque in (
            ((1.0, 2.0, 3.0), (0.3, -0.2, 0.1)),
            (("=1+0*t", "=2", 3.0), ("=0.3", -0.2, "=0.1+0*t")),
        )
    ]  # fmt: skip
    assert np.allclose(runs[0].q, runs[1].q, rtol=0, atol=1e-14)


def limited(model, method):
    """The model, for time stepping with a limit that it does not reach."""
    return model.edit("arm", limits=[(-9.0, 9.0)]) if method == "moreau_jean" else model


@pytest.mark.parametrize(
    "method", ["rk4", "semi_implicit_euler", "dopri5", "radau5", "gauss6", "moreau_jean"]
)
def test_every_method_evaluates_at_its_own_times_and_states(method):
    law = {"kind": "motor", "torque": "=2*sin(3*t) - 20*q.arm - k*v.arm"}
    same = {"kind": "servo", "kp": 20.0, "kd": 3.0, "torque": "=2*sin(3*t)"}
    runs = [
        pg.simulate(limited(pendulum(**f), method), t_end=0.5, q=[0.4], step=1e-3, method=method)
        for f in (law, same)
    ]
    order = {"semi_implicit_euler": 1e-2, "moreau_jean": 1e-2}.get(method, 1e-8)
    assert np.allclose(runs[0].q, runs[1].q, rtol=0, atol=order)
    assert np.allclose(runs[0].q[-1], moved(lambda t, q, v: 2 * np.sin(3 * t) - 20 * q - 3 * v,
                                            t_end=0.5)[0], rtol=0, atol=order)  # fmt: skip


CURVES = {  # of time t, and value, rate, second rate by hand
    "=1 + 2*t - 3*t^2": lambda t: (1 + 2 * t - 3 * t * t, 2 - 6 * t, -6.0),
    "=sin(2*t + 0.1)": lambda t: (
        math.sin(2 * t + 0.1), 2 * math.cos(2 * t + 0.1), -4 * math.sin(2 * t + 0.1)),
    "=exp(-t)*cos(t)": lambda t: (
        math.exp(-t) * math.cos(t), -math.exp(-t) * (math.cos(t) + math.sin(t)),
        2 * math.exp(-t) * math.sin(t)),
    "=sqrt(1 + t)": lambda t: ((1 + t) ** 0.5, 0.5 * (1 + t) ** -0.5, -0.25 * (1 + t) ** -1.5),
    "=log(1 + t)/(1 + t)": lambda t: (
        math.log(1 + t) / (1 + t), (1 - math.log(1 + t)) / (1 + t) ** 2,
        (2 * math.log(1 + t) - 3) / (1 + t) ** 3),
    "=tan(t/2)": lambda t: (
        math.tan(t / 2), 0.5 / math.cos(t / 2) ** 2, 0.5 * math.tan(t / 2) / math.cos(t / 2) ** 2),
    "=atan(t)": lambda t: (math.atan(t), 1 / (1 + t * t), -2 * t / (1 + t * t) ** 2),
    "=asin(t/2)": lambda t: (
        math.asin(t / 2), 0.5 / (1 - t * t / 4) ** 0.5, t / 8 / (1 - t * t / 4) ** 1.5),
    "=acos(t/2)": lambda t: (
        math.acos(t / 2), -0.5 / (1 - t * t / 4) ** 0.5, -t / 8 / (1 - t * t / 4) ** 1.5),
    "=(1 + t)^2.5": lambda t: (
        (1 + t) ** 2.5, 2.5 * (1 + t) ** 1.5, 3.75 * (1 + t) ** 0.5),
    "=(1 + t)^(1 + t)": lambda t: (
        (1 + t) ** (1 + t), (1 + t) ** (1 + t) * (math.log(1 + t) + 1),
        (1 + t) ** (1 + t) * ((math.log(1 + t) + 1) ** 2 + 1 / (1 + t))),
    "=min(t, 5)*max(t, -1) + abs(-t - 1)": lambda t: (t * t + t + 1, 2 * t + 1, 2.0),
    "=if(t < 9, t^3, 0)": lambda t: (t**3, 3 * t * t, 6 * t),
    "=smoothstep(t, -1, 3)": lambda t: (
        ((t + 1) / 4) ** 2 * (3 - (t + 1) / 2), 3 / 8 * (t + 1) - 3 / 32 * (t + 1) ** 2,
        3 / 8 - 3 / 16 * (t + 1)),
    "=k": lambda t: (0.7, 0.0, 0.0),
}  # fmt: skip


def test_a_prescribed_motion_has_the_derivatives_of_its_expression():
    bodies = [pg.Body(name=f"b{i}", joint="prismatic") for i in range(len(CURVES))]
    motions = [pg.Motion(name=f"m{i}", body=f"b{i}", q_of_t=text) for i, text in enumerate(CURVES)]
    model = pg.Model(bodies=bodies, constraints=motions, parameters={"k": 0.7})
    assert pg.Model.from_json(model.to_json()) == model
    start = [of(0.0) for of in CURVES.values()]
    run = pg.simulate(
        model, t_end=1.0, step=1e-2, frames=5, method="rk4",
        q=[x for x, _, _ in start], v=[x for _, x, _ in start],
    )  # fmt: skip
    wanted = np.array([[of(t) for of in CURVES.values()] for t in run.t])
    # positions and velocities are projected to a tolerance, accelerations imposed to rounding
    assert np.allclose(run.q, wanted[..., 0], rtol=0, atol=1e-8)
    assert np.allclose(run.v, wanted[..., 1], rtol=0, atol=1e-8)
    assert np.allclose(run.vdot, wanted[..., 2], rtol=1e-9, atol=1e-9)


def test_runs_steppers_batches_and_sweeps_have_the_same_bits():
    force = {"kind": "motor", "torque": "=2*sin(3*t) - k*q.arm*exp(v.arm/9)", "torque_limit": 4.0}
    model = pendulum(**force)
    call = {"step": 1e-2, "method": "rk4"}
    run = pg.simulate(model, t_end=1.0, q=[0.4], frames=101, **call)
    stepper = pg.Stepper(pg.Mechanism(model), q=[0.4], **call)
    stepper.step(n=100)
    assert np.array_equal(stepper.q, run.q[-1])
    batch = pg.BatchStepper(pg.Mechanism(model), 3, set={"k": [1.0, 3.0, 5.0]}, **call)
    batch.reset(q=[[0.4]] * 3)
    batch.step(n=100)
    assert np.array_equal(batch.q[1], run.q[-1])
    metric = {"last": lambda run: float(run.q[-1, 0])}
    sweep = pg.sweep(model, {"k": [1.0, 3.0, 5.0]}, metric, t_end=1.0, q=[0.4], **call)
    assert np.array_equal(np.asarray(sweep["last"]), batch.q[:, 0])
    for i, k in enumerate((1.0, 3.0, 5.0)):
        other = pg.simulate(model.replace(parameters={"k": k}), t_end=1.0, q=[0.4], **call)
        assert np.array_equal(batch.q[i], other.q[-1])


def test_an_expression_that_has_no_value_ends_the_run_and_is_named():
    for torque in ("=1/(t - 0.5)", "=sqrt(0.5 - t)", "=log(q.arm - 9)"):
        model = pendulum(kind="motor", torque=torque, torque_limit=5.0)  # a bound hides nothing
        for call in ({"step": 0.01, "method": "rk4"}, {"rtol": 1e-6}):
            run = pg.simulate(model, t_end=1.0, **call)
            assert not run.status.ok
            assert "'push'" in run.message
            assert torque in run.message


@pytest.mark.parametrize(
    ("field", "text", "facts"),
    [
        ("torque", "=q.arn", ("'arn'", "arm")),
        ("torque", "=kk*t", ("'kk'", "k")),
        ("torque", "=arm", ("'arm'",)),
        ("torque", "=arm*t", ("q.arm",)),
        ("torque", "=q.arm[1]", ("1 degree", "from 0")),
        ("torque", "=q.arm + v.arm", ("rad and rad/s",)),
        ("torque", "=q.arm", ("gives rad, not N m",)),
        ("torque", "=sin(v.arm)", ("rad/s",)),
        ("torque", "=out.felt*2", ("loop",)),
        ("torque", "=out.none", ("'none'",)),
        ("torque", "=table(t, 1, 0, 0, 5)", ("ascend",)),
    ],
)
def test_what_does_not_fit_the_model_is_refused(field, text, facts):
    felt = [pg.Output(name="felt", kind="force", at="arm")]
    with pytest.raises(pg.ModelError) as refused:
        pendulum().replace(
            outputs=felt, forces=[pg.Motor(name="push", body="arm", **{field: text})]
        )
    assert "force 'push'" in str(refused.value)
    assert field in str(refused.value)
    assert all(fact in str(refused.value) for fact in facts)


def test_a_motion_may_follow_time_alone():
    motion = pg.Motion(name="m", body="arm", q_of_t="=q.arm")
    with pytest.raises(pg.ModelError, match="depend on t"):
        pendulum().replace(constraints=[motion])


def test_a_field_that_cannot_vary_says_so():
    with pytest.raises(pg.ModelError, match="constant"):
        pendulum().edit("arm", mass="=2*sin(t)")
    with pytest.raises(pg.ModelError, match="lag"):
        pg.Motor(name="m", body="arm", torque="=sin(t)", lag=0.1)


def two():
    bodies = [
        pg.Body(name="left hip", joint="revolute", axes=[Z], mass=1.0, inertia=(1, 1, 1)),
        pg.Body(name="left_knee", parent="left hip", joint="revolute", axes=[Z], mass=1.0),
    ]
    outputs = [pg.Output(name="bend", kind="joint_position", at="left_knee")]
    drive = pg.Motor(
        name="drive", body="left_knee", torque='=-3*q["left hip"] - 2*v.left_knee*k + 0*out.bend'
    )
    return pg.Model(bodies=bodies, outputs=outputs, forces=[drive], parameters={"k": 2.0})


def text_of(model, name="drive"):
    return model.part(name, "force").torque


def test_expressions_follow_new_names_and_copies():
    model = two()
    assert "-3*q.hip " in text_of(model.edit("left hip", name="hip"))
    assert "out.angle" in text_of(model.edit("bend", name="angle"))
    twins = model.mirror("left hip", "x")
    new = next(f for f in twins.forces if f.name != "drive")
    assert 'q["right hip"]' in new.torque
    assert "v.right_knee" in new.torque
    assert "out.bend " not in f"{new.torque} "
    assert pg.Model.from_json(twins.to_json()) == twins
    gone = model.edit("drive", body="left hip").remove("left_knee")
    assert not gone.forces
    assert "drive" in "".join(gone.notices)


def test_files_say_from_which_version_they_are():
    assert '"schema_version": 6' in two().to_json()
    assert '"schema_version": 3' in two().replace(forces=()).to_json()
    constant = pendulum().replace(forces=[pg.Motor(name="m", body="arm", torque="=2*k")])
    assert constant.forces[0].torque == 6.0  # a formula of parameters, as it always was
    assert '"schema_version": 2' in constant.to_json()
    assert pg.Model.from_json(constant.to_json()) == constant


def test_a_parameter_that_is_called_t_is_not_the_time():
    model = pendulum().replace(parameters={"t": 2.0}).edit("arm", mass="=3*t")
    assert model.body("arm").mass == 6.0
    assert pg.Model.from_json(model.to_json()).body("arm").mass == 6.0


def test_linearisation_sees_feedback():
    one = pendulum(kind="motor", torque="=-20*q.arm - 3*v.arm")
    other = pendulum(kind="servo", kp=20.0, kd=3.0)
    a, b = (pg.Mechanism(m).linearise(q=[-0.3]) for m in (one, other))
    assert np.allclose(a.A, b.A, rtol=0, atol=1e-9)
    assert np.allclose(a.B, b.B, rtol=0, atol=1e-12)


def test_two_threads_keep_their_own_values():
    from concurrent.futures import ThreadPoolExecutor

    mech = pg.Mechanism(pendulum(kind="motor", torque="=5*sin(9*t) - q.arm*9"))

    def run(q):
        return pg.simulate(mech, t_end=2.0, q=[q], step=1e-3, method="rk4").q

    alone = [run(q) for q in (0.1, 0.9)]
    with ThreadPoolExecutor(2) as pool:
        for _ in range(5):
            together = list(pool.map(run, (0.1, 0.9)))
            assert all(map(np.array_equal, alone, together))


def driven_pair(first, second, controls=(), **fields):
    """Two arms on the ground, each with a drive."""
    arms = [
        pg.Body(name=name, axes=[Z], mass=2.0, com=(0.5, 0, 0), inertia=(0.1, 0.1, 0.2))
        for name in ("a", "b")
    ]
    forces = [pg.Force(name=name, body=body, **f) for name, body, f in
              (("one", "a", first), ("two", "b", second))]  # fmt: skip
    return pg.Model(bodies=arms, gravity=(0, -9.81, 0), forces=forces, controls=controls, **fields)


SERVO = {
    "kind": "servo", "kp": 30.0, "kd": 2.0, "target": "=0.5*cos(2*t)", "torque": 0.7,
    "torque_limit": 9.0, "input_high": 0.3,
}  # fmt: skip
BY_HAND = "max(-9, min(9, 0.7 + 30*(min(0.5*cos(2*t), 0.3) - q.a) - 2*v.a))"
DRIVES = {  # a drive, and its input and torque by hand
    "servo": (SERVO, "min(0.5*cos(2*t), 0.3)", BY_HAND),
    "motor": ({"kind": "motor", "torque": "=sin(t) - q.a"}, "(sin(t) - q.a)", "(sin(t) - q.a)"),
    "speed": (
        {"kind": "speed_servo", "kd": 4.0, "speed": pg.Table(t=[0, 1], value=[0, 3])},
        "table(t, 0, 0, 1, 3)", "4*(table(t, 0, 0, 1, 3) - v.a)",
    ),
    "actuator": (
        {"kind": "actuator", "gain": 5.0, "kp": 10.0, "kd": 1.0, "input": 2.0, "gear": -2.0},
        "2", "(10 + 20*q.a + 2*v.a)",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("of", "group", "how"),
    combined(DRIVES, ["u", "f"], [{"rtol": 1e-9}, {"method": "rk4", "step": 1e-2}]),
)
def test_the_input_and_the_torque_of_a_drive_are_signals(of, group, how):
    drive, given, pushed = DRIVES[of]
    law = given if group == "u" else pushed
    two = [{"kind": "motor", "torque": f"=0.5*{x}*(1 + 0*t)"} for x in (f"{group}.one", law)]
    runs = [pg.simulate(driven_pair(drive, x), t_end=1.5, q=[0.4, 0.1], **how) for x in two]
    assert np.allclose(runs[0].q, runs[1].q, rtol=0, atol=1e-8)
    assert pg.Model.from_json(runs[0].mechanism.model.to_json()) == runs[0].mechanism.model


@pytest.mark.parametrize("of", DRIVES)
def test_the_power_of_a_drive_adds_up_to_its_work(of):
    drive = DRIVES[of][0]
    work = pg.State(name="work", rate=f"=f.one*v.a*{drive.get('gear', 1.0)}")
    model = driven_pair(drive, {"kind": "motor", "torque": 0.0}, [work])
    run = pg.simulate(model, t_end=1.5, q=[0.4, 0.0], rtol=1e-11)
    assert np.allclose(run.states[:, 0], run.work, rtol=0, atol=1e-9)


def test_a_control_reads_drives_as_they_act_in_a_run():
    pid = pg.PID(name="c", signal="=u.one", setpoint=1.0, kp=1.0)
    one, two = ({"kind": "motor", "torque": x} for x in (2.0, "=x.c"))
    model = driven_pair(one, two, [pid])
    run = pg.simulate(model, t_end=0.1, inputs={"one": 5.0})
    assert np.allclose(run.controls["c"], -4.0)
    stepper = pg.Stepper(pg.Mechanism(model), inputs={"one": 5.0})
    assert stepper.controls["c"] == -4.0
    with pytest.raises(pg.InputError, match="'one'"):  # its number is in an expression
        stepper.input("one", 3.0)


def test_joint_forces_have_wrenches_that_follow_an_input_of_the_call():
    pull = {"kind": "wrench", "force": ["=2*u.one", 0, 0]}
    model = driven_pair({"kind": "motor", "torque": 2.0}, pull)
    run = pg.simulate(model, t_end=0.1, inputs={"one": 5.0}, method="rk4", step=1e-3)
    same = driven_pair({"kind": "motor", "torque": 5.0}, {**pull, "force": [10.0, 0, 0]})
    other = pg.simulate(same, t_end=0.1, method="rk4", step=1e-3)
    assert np.allclose(run.joint_force, other.joint_force, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(
    ("one", "two", "controls", "facts"),
    [
        ("=f.two", "=f.one", [], ("f.two -> f.one -> f.two",)),
        ("=u.one", "=1", [], ("u.one -> u.one",)),
        ("=x.c", "=1", [pg.PID(name="c", signal="=f.one")], ("x.c -> f.one -> x.c",)),
        ("=f.three", "=1", [], ("'three'", "one")),
        ("=f.one[1]", "=1", [], ("entry 1",)),
        ("=q.a + f.two", "=1", [], ("rad and N m",)),
    ],
)
def test_loops_and_names_of_drives_are_refused_by_name(one, two, controls, facts):
    with pytest.raises(pg.ModelError) as refused:
        driven_pair(*({"kind": "motor", "torque": x} for x in (one, two)), controls)
    assert all(fact in str(refused.value) for fact in facts)


def test_a_state_between_two_drives_is_no_loop():
    lag = pg.Filter(name="c", input="=f.two", lag=0.1)
    two = {"kind": "motor", "torque": "=-f.one - 2*v.b"}
    model = driven_pair({"kind": "motor", "torque": "=-x.c - 2*v.a"}, two, [lag])
    assert pg.simulate(model, t_end=0.5).status.ok
    with pytest.raises(pg.ModelError, match="lag"):
        driven_pair({"kind": "motor", "torque": 1.0, "lag": 0.1}, two, [lag])


def test_signals_of_drives_follow_names_and_go_with_them():
    lag = pg.Filter(name="c", input="=u.one", lag=0.1)
    model = driven_pair(SERVO, {"kind": "motor", "torque": "=f.one"}, [lag])
    new = model.edit("one", kind="force", name="hip servo")
    assert text_of(new, "two") == '=f["hip servo"]'
    assert new.controls[0].input == '=u["hip servo"]'
    left = model.remove("a")
    assert not left.forces
    assert not left.controls


def test_a_parameter_of_a_control_or_a_condition_is_used():
    lock = pg.Weld(name="lock", body="arm", active=False)
    switch = {"constraint": "lock", "active": True, "when": {"holds": "=q.arm > bound"}}
    model = pendulum().replace(
        controls=[pg.State(name="s", rate="=rate*t")], constraints=[lock],
        scenarios=[pg.Scenario(name="s", switches=[switch])],
        parameters={"rate": 1.0, "bound": 2.0, "idle": 3.0},
    )  # fmt: skip
    told = [text for text in model.doubts if "parameter" in text]
    assert len(told) == 1
    assert "'idle'" in told[0]


def test_a_drive_that_expressions_read_has_one_meaning_in_every_scenario():
    other = pg.Motor(name="push", body="arm", torque=2.0)
    scenario = pg.Scenario(name="s", forces=[other])
    model = pendulum(torque=1.0).replace(scenarios=[scenario])  # nothing reads it
    with pytest.raises(pg.ModelError) as refused:
        model.replace(controls=[pg.State(name="work", rate="=f.push*v.arm")])
    assert all(fact in str(refused.value) for fact in ("'s'", "'push'"))
