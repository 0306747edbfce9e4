"""Controls that do not fit a model, a run or each other are refused by name."""

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.signals import signals_in
from tests.controlled import EVERY, WHOLE, Z, pendulum
from tests.refusals import assert_names, assert_problems


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
        (pg.State(name="c", rate="=x.c[2]"), ("states 1 to 1", "2")),
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


QUOTED = ['a"b', "a'b", "a\"b'c", '"', "'\"'", '""', "größe 😀", "a]b", "1", "sin", "arm"]


@pytest.mark.parametrize("name", QUOTED)
def test_any_name_can_be_written_in_an_expression(name):
    model = pendulum([pg.Filter(name="old", input="=q.arm", lag=0.1)], "=2*x.old[1]")
    new = model.edit("old", kind="control", name=name)
    (signal,) = signals_in(new.forces[0].torque)
    assert signal == ("x", name, 1)
    assert pg.Model.from_json(new.to_json()) == new
    assert new.edit(name, kind="control", name="old") == model


@pytest.mark.parametrize("count", [3, 2000])
def test_a_long_loop_is_told_by_its_ends(count):
    controls = [pg.PID(name=f"c{i}", signal=f"=x.c{(i + 1) % count}", kp=1.0) for i in range(count)]
    with pytest.raises(pg.ModelError) as refused:
        pendulum(controls)
    assert_names(str(refused.value), "x.c0 -> x.c1", f"x.c{count - 1} -> x.c0", "loop")
    assert len(str(refused.value)) < 200
    assert len(pendulum([*controls[:-1], pg.PID(name=f"c{count - 1}", signal="=q.arm")]).controls)


def test_an_invalid_control_is_the_only_problem_of_what_reads_it():
    with pytest.raises(pg.ModelError) as refused:
        pendulum([{"kind": "filter", "name": "f", "input": "=q.arm"}], "=x.f")
    (problem,) = refused.value.problems
    assert_problems([problem], [("control 'f', lag", "missing")])


def test_implicit_steps_of_a_clamped_control_end_where_it_is_clamped():
    pid = pg.PID(name="hold", signal="=q.arm", setpoint=-1.2, kp=10.0, ki=60.0, low=-14, high=14)
    model = pendulum([pid], "=x.hold")
    run = pg.simulate(model, t_end=2.0, q=[0.5], step=1e-3, method="gauss6")
    other = pg.simulate(model, t_end=2.0, q=[0.5], rtol=1e-12)
    assert run.status.ok
    assert other.status.ok
    assert np.allclose(run.q, other.q, rtol=0, atol=1e-9)


@pytest.mark.parametrize("sample", [1e-300, 1e-17])
@pytest.mark.parametrize("how", [{"rtol": 1e-6}, {"step": 1e-3, "method": "rk4"}])
def test_a_sample_time_below_the_resolution_of_time_is_refused(sample, how):
    control = pg.Sampled(name="c", update="=q.arm", sample=sample)
    with pytest.raises(pg.InputError) as refused:
        pg.simulate(pendulum([control], "=x.c"), t_end=1.0, **how)
    assert all(fact in str(refused.value) for fact in ("'c'", "sample", f"{sample:g}"))


def test_derivatives_by_what_is_sampled_are_refused():
    with pytest.raises(pg.InputError, match="sampled"):
        pg.simulate(pendulum(EVERY[3:], "=x.u"), t_end=0.1, wrt=["k"], step=1e-2, method="rk4")
