"""Forces of MJCF files, read and written, beside MuJoCo: drives, tendons, fluid, lifted weights."""

import numpy as np
import pytest

import pgraph_core as pg
from tests.core.test_mjcf_of_others import differences

from .mjcf_files import (
    DYNAMIC,
    INTEGRATED,
    agree,
    compiled,
    forward,
    loaded,
    mujoco,
    read,
    texts,
    written,
)

pytestmark = pytest.mark.quick


def test_a_spring_is_a_tendon_with_the_same_pull(tmp_path):
    rod = pg.Body(name="rod", joint="spherical", mass=1.0, tip=(0, 0, 1), com=(0, 0, 0.5))
    spring = pg.Spring(name="s", body="rod", other_point=(1, 0.5, 0.3), stiffness=30.0, damping=0.7)
    again, m = written(tmp_path, pg.Model(bodies=[rod], forces=[spring]))
    rest = np.linalg.norm((1, 0.5, -0.7))
    found = again.forces[0]
    assert (found.name, found.body, found.other, found.stiffness) == ("s", "rod", "ground", 30.0)
    np.testing.assert_allclose(found.rest, rest)
    assert agree(again, m)


DRIVEN = """<mujoco><compiler angle="radian"/><worldbody>
<body><joint name="a" axis="0 1 0" ref=".3"/><geom type="capsule" size=".05 .2" mass="2"/>
  <site name="hand" pos="0 0 .4" euler="0 .5 0"/>
  <body pos="0 0 .4"><joint name="b" axis="0 1 0" damping=".1"/>
    <geom type="capsule" size=".05 .2" mass="1"/>
    <body pos="0 0 .4"><joint name="c" type="slide" axis="0 0 1" ref="-.2"/>
      <geom type="box" size=".1 .05 .03" mass=".5"/></body></body></body></worldbody>
<option density="300" viscosity="7"/>
<tendon>
  <fixed name="ab" stiffness="30" damping=".4" range="-3 4" springlength=".2">
    <joint joint="a" coef="1.5"/><joint joint="b" coef="-.5"/></fixed>
  <fixed name="bc"><joint joint="b" coef=".25"/><joint joint="c" coef="2"/></fixed>
</tendon>
<equality><tendon name="held" tendon1="ab" tendon2="bc" polycoef=".1 2 0 0 0" active="false"/>
</equality>
<actuator>
  <motor name="m" joint="a" gear="3" ctrlrange="-2 2" forcerange="-1 1.5"/>
  <position name="p" joint="a" kp="40" kv="2" gear="-2"/>
  <velocity name="v" joint="b" kv="3" ctrlrange="-9 9"/>
  <position name="t" tendon="bc" kp="20"/>
  <general name="g" tendon="ab" gear=".5" gainprm="7" biastype="affine" biasprm="1 2 -.3"/>
</actuator></mujoco>
"""


def test_tendons_drives_and_fluid_give_the_forces_of_mujoco(tmp_path):
    model, report = read(tmp_path, DRIVEN)
    assert report.loaded, report
    shifted = [f"{e.where}: {e.text}" for e in report.of("converted") if "qpos" in e.text]
    for text, joint, ref in zip(shifted, "ac", ("0.3", "-0.2"), strict=True):
        assert f"'{joint}'" in text
        assert ref in text
    m, _ = compiled(tmp_path)
    inputs = {"m": 1.2, "p": 0.4, "v": -2.0, "t": 0.7, "g": 0.3}
    kinds = [type(f).__name__ for f in model.forces[:6]]
    assert " ".join(kinds) == "Motor Servo SpeedServo Servo Actuator Tendon"
    assert (model["ab"].low, model["ab"].high) == pytest.approx((-3.45, 3.55))
    assert agree(model, m)
    given = model
    for name, u in inputs.items():
        given = given.edit(name, **{model[name].INPUT: u})
    assert agree(given, m, [*inputs.values()])
    again, _ = written(tmp_path, model)
    assert agree(again, m)
    assert not differences(model, again)


def test_limits_and_couplings_of_tendons_hold_in_runs(tmp_path):
    text = """<mujoco><option gravity="0 0 0"/><worldbody>
    <body><joint name="a" axis="0 1 0"/><geom type="capsule" size=".05 .2" mass="2"/>
    <body pos="0 0 .4"><joint name="b" axis="0 1 0"/><geom type="capsule" size=".05 .2" mass="1"/>
    </body></body></worldbody><tendon><fixed name="t" limited="true" range="-.2 .3">
    <joint joint="a" coef="1"/><joint joint="b" coef=".5"/></fixed></tendon>
    <equality><tendon name="held" tendon1="t" active="false"/></equality>
    <actuator><motor name="m" joint="b" ctrlrange="-3 3"/></actuator></mujoco>"""
    model = loaded(tmp_path, text)
    stepper = pg.Stepper(model)
    lengths = []
    for k in range(600):
        assert stepper.step(inputs={"m": 1.0 if k < 300 else -3.0}).ok
        lengths.append(stepper.q[0] + 0.5 * stepper.q[1])
    assert max(lengths) == pytest.approx(0.3, abs=1e-4)
    assert min(lengths) == pytest.approx(-0.2, abs=1e-4)
    held = model.edit("held", active=True)
    run = pg.simulate(held, t_end=0.5, inputs={"m": pg.Table(t=[0, 0.5], value=[0, 1])})
    assert run.status.ok
    assert np.abs(run.q @ (1, 0.5)).max() < 1e-9 < 0.1 < np.ptp(run.q[:, 1])
    assert run.header["inputs"]["m"]["value"] == (0, 1)
    for call, fact in (
        (lambda: pg.simulate(model, inputs={"m": 4.0}), "'m'.*-3 to 3"),
        (lambda: pg.Stepper(model, inputs={"n": 0.0}), "'n'"),
        (lambda: pg.simulate(model.replace(forces=[]), forces=[model["t"]]), "'t', low"),
        (lambda: pg.simulate(model, method="dop853", t_end=0.1), "moreau_jean"),
    ):
        with pytest.raises(pg.InputError, match=fact):
            call()


def test_a_filter_is_a_lag_and_an_integrator_the_integral_of_the_input(tmp_path):
    model = loaded(tmp_path, DYNAMIC.format('dyntype="filter" dynprm=".2"'))
    assert model["m"].lag == 0.2
    x = lambda t: 1.5 * (t**2 / 2 - 0.2 * t + 0.04 * (1 - np.exp(-t / 0.2)))  # noqa: E731
    run = pg.simulate(model, t_end=1.0, inputs={"m": 1.0}, frames=11)
    np.testing.assert_allclose(run.q[:, 0], x(run.t), atol=1e-9)
    stepper = pg.Stepper(model, step=1e-3)
    for n in (300, 200):  # the same again changes nothing
        stepper.step(inputs={"m": 1.0}, n=n)
    assert stepper.q[0] == pytest.approx(x(0.5), abs=1e-9)
    assert written(tmp_path, model)[0].forces == model.forces

    model = loaded(tmp_path, INTEGRATED)
    run = pg.simulate(model, t_end=1.0, inputs={"m": 1.0}, frames=11)  # 0.6 from t = 0.6 on
    np.testing.assert_allclose(run.vdot[:, 0], 1.5 * np.minimum(run.t, 0.6), atol=1e-13)
    stepper = pg.Stepper(model, step=1e-3)
    for u, n in ((2.0, 400), (-1.0, 200)):  # 0.6 from t = 0.3 on
        stepper.step(inputs={"m": u}, n=n)
    assert stepper.vdot[0] == pytest.approx(1.5 * 0.4, abs=1e-12)
    assert written(tmp_path, model)[0].forces == model.forces
    m, data = compiled(tmp_path)
    m.opt.timestep, data.ctrl[0] = 1e-4, 1.0
    mujoco.mj_step(m, data, 10_000)
    assert run.q[-1, 0] == pytest.approx(data.qpos[0], abs=2e-4)  # its steps of first order


@pytest.mark.parametrize("t_start", [0.0, 5.0])
def test_drives_with_a_memory_start_with_the_run(t_start):
    body = pg.Body(name="a", joint="prismatic", axes=(1, 0, 0), mass=1.0)
    table = pg.Table(t=[0, 4, 6, 10], value=[3, 3, 3, 3])
    ramp = pg.Table(t=[0, 10], value=[0, 10])
    lag, integral = {"lag": 0.5}, {"integrates": True, "start": 1.0}
    for given, torque, expected in (
        ({**lag, "start": 1.0}, 3.0, lambda s: 3 - 2 * np.exp(-2 * s)),
        ({**lag, "start": 1.0}, table, lambda s: 3 - 2 * np.exp(-2 * s)),
        (lag, 3.0, lambda s: 3 + 0 * s),
        (integral, 3.0, lambda s: 1 + 3 * s),
        ({**lag, "start": 0.0}, ramp,
         lambda s: t_start + s - 0.5 + (0.5 - t_start) * np.exp(-2 * s)),
        (integral, ramp, lambda s: 1 + t_start * s + s**2 / 2),
    ):  # fmt: skip
        drive = pg.Motor(name="m", body="a", torque=torque, **given)
        model = pg.Model(bodies=[body], gravity=(0, 0, 0), forces=[drive])
        for inputs in (None, {"m": torque} if drive.start is not None else None):
            run = pg.simulate(model, t_start=t_start, t_end=t_start + 1, inputs=inputs, frames=5)
            np.testing.assert_allclose(run.vdot[:, 0], expected(run.t - t_start), atol=1e-12)


LIMITED = """<mujoco><worldbody><body><joint name="x" type="slide" actuatorfrcrange="-3 3"/>
<geom size=".1" mass="2"/><body><joint name="y" type="slide" axis="0 1 0" actuatorfrcrange="-9 9"/>
<geom size=".1" mass="1"/></body></body></worldbody><tendon>
<fixed name="one" actuatorfrcrange="-7 5"><joint joint="x" coef="2"/></fixed>
<fixed name="two"><joint joint="x" coef="1"/><joint joint="y" coef="1"/></fixed></tendon>
<actuator><motor name="m" {}/></actuator></mujoco>"""


@pytest.mark.parametrize(
    ("motor", "torques"),
    [
        ('tendon="one"', (-1.5, 1.5)),  # the joint's limit over the tendon's coefficient
        ('tendon="one" gear=".1"', (-7.0, 5.0)),
        ('tendon="two" forcerange="-2 2"', (-2.0, 2.0)),  # never beyond what the joints take
        *((f'tendon="two"{more}', None) for more in (' forcerange="-4 4"', "")),
    ],
)
def test_limits_of_joints_and_tendons_bound_their_drives(tmp_path, motor, torques):
    model, report = read(tmp_path, LIMITED.format(motor))
    assert report.loaded == (torques is not None) == ("'m'" not in texts(report, "left out"))
    assert torques is None or model["m"].torques == pytest.approx(torques)


@pytest.mark.parametrize(
    ("low", "high", "value"),
    [(1.0, 2.0, 1.5), (1.0, 2.0, 1.0), (-1.0, 1.0, 0.5), (-3.0, -1.0, -2.0)],
)
def test_a_written_drive_starts_at_its_input(tmp_path, low, high, value):
    """MuJoCo starts at control 0, or the nearest that its range has."""
    arm = pg.Body(name="arm", tip=(1, 0, 0))
    motor = pg.Motor(name="motor", body="arm", torque=value, input_low=low, input_high=high)
    pg.write_mjcf(pg.Model(bodies=[arm], forces=[motor]), tmp_path / "arm.xml")
    m, data = forward(tmp_path)
    assert data.actuator_force[0] == pytest.approx(value, rel=1e-12)
    assert np.ptp(m.actuator_ctrlrange[0]) == pytest.approx(high - low)


SWINGS = """<mujoco><option actuatorgroupdisable="1"/><worldbody>
<body name="a"><joint name="j" type="slide" axis="1 0 0" range="-1 1" margin="{margin}"/>
  <geom size=".1" mass="2" contype="0" conaffinity="0"/></body>
<body name="b" gravcomp=".5"><joint name="k" axis="0 1 0"/>
  <geom size=".1" pos=".3 0 0" mass="1" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor name="off" joint="k" group="1"/><motor name="on" joint="k" group="2"/></actuator>
</mujoco>"""


@pytest.mark.parametrize(("margin", "limits"), [(0.3, (-0.7, 0.7)), (1.5, (-1, 1)), (0, (-1, 1))])
def test_margins_move_the_ends_of_limits_and_disabled_actuators_are_left_out(
    tmp_path, margin, limits
):
    model, report = read(tmp_path, SWINGS.format(margin=margin))
    assert model.body("a").limits == (limits,)
    assert report.loaded == (margin <= 1)  # the disabled one does not act in MuJoCo either
    assert [f.name for f in model.forces if isinstance(f, pg.Motor)] == ["on"]
    assert "'off'" in texts(report, "left out")
    assert "gravcomp" in texts(report, "converted")


DRIFTING = """<mujoco><compiler angle="radian"/>
<option density="9" viscosity=".1" gravity="0 0 -9"/>
<worldbody><geom name="far" type="plane" size="1 1 1" contype="0" conaffinity="0"/>
<body name="still" mocap="true"><geom size=".1"/></body>
<body name="a" gravcomp="1"><joint name="x" axis="0 1 0" range="-1 1" {}/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".05"/></body>
<body name="b" pos="0 1 0"><joint name="y" axis="0 1 0"/><geom size=".1" pos=".1 0 0"/></body>
<body name="c" pos="0 3 0"><joint type="ball"/><geom size=".1" pos=".1 0 0"/></body></worldbody>
<tendon><fixed name="idle"><joint joint="x" coef="1"/></fixed></tendon>
<keyframe><key name="far" qpos="1.25 0 1 0 0 0"/></keyframe></mujoco>"""


def test_fluid_and_keyframes_beyond_limits_stay_through_a_file_and_idle_parts_are_named(tmp_path):
    model, report = read(tmp_path, DRIFTING.format(""))
    assert all(part in texts(report, "left out") for part in ("tendon 'idle'", "geom 'far'"))
    assert "key 'far'" in texts(report, "warning")
    assert report.loaded
    assert model.scenario("far").q["a"] == (1.25,)
    again, m = written(tmp_path, model)
    assert again.scenario("far").q["a"] == (1.25,)
    assert (m.opt.density, m.opt.viscosity) == (9.0, 0.1)
    assert m.key("far").qpos[0] == 1.25
    run = pg.simulate(model, scenario="far", t_end=0.01)
    assert any("limit" in text and "0.25" in text for text in run.notices)


@pytest.mark.parametrize("lifted", [False, True])
def test_gravcomp_by_actuators_acts_only_where_there_are_some(tmp_path, lifted):
    """MuJoCo adds it to what actuators give, and leaves that out where there are none."""
    text = DRIFTING.format('actuatorgravcomp="true"')
    if lifted:
        text = text.replace("</mujoco>", '<actuator><motor joint="y"/></actuator></mujoco>')
    model, report = read(tmp_path, text)
    assert report.loaded
    assert ("actuatorgravcomp" in texts(report, "left out")) != lifted
    m, data = forward(tmp_path)
    run = pg.simulate(model, t_end=1e-3)
    np.testing.assert_allclose(run.vdot[0, 0], data.qacc[0], atol=1e-12)


@pytest.mark.parametrize("clamped", ["enable", "disable"])
def test_control_ranges_bound_unless_the_file_switches_them_off(tmp_path, clamped):
    model, report = read(
        tmp_path,
        f"""<mujoco><option><flag clampctrl="{clamped}"/></option><worldbody><body name="a">
<joint name="j"/><geom size=".1" pos=".3 0 0"/></body></worldbody>
<actuator><motor name="m" joint="j" ctrlrange="-1 1"/></actuator></mujoco>""",
    )
    (motor,) = model.forces
    assert (motor.input_high == 1.0) == (clamped == "enable")
    assert ("clampctrl" in str(report)) == (clamped == "disable")


@pytest.mark.parametrize(("low", "high"), [(-3, 1), (0, 2), (-3, 0), (-3, -1)])
def test_a_limit_that_leaves_no_force_forwards_is_left_out(tmp_path, low, high):
    text = DYNAMIC.format(f'forcerange="{low} {high}"')
    model, report = read(tmp_path, text)
    assert ("no force forwards" in texts(report, "left out")) == (high <= 0)
    assert model["m"].torques == ((low, high) if high > 0 else (-np.inf, np.inf))


WRAPPED = """<mujoco><option gravity="0 0 -9.81"/><worldbody><site name="hook" pos="{hook}"/>
<body><joint type="hinge" axis="{axis}" pos=".01 .02 0"/>
  <inertial mass="1" pos=".05 0 0" diaginertia=".01 .012 .014"/>
  <geom name="post" type="{kind}" size="{size}" pos="{place}" quat="{turn}" contype="0"
   conaffinity="0" mass="0"/>{site}
  <body pos="0 -.15 .05"><joint axis="0 0 1"/><joint axis="1 0 0"/>
    <inertial mass=".7" pos="0 -.1 0" diaginertia=".01 .012 .014"/><site name="end" pos="{end}"/>
</body></body></worldbody><tendon><spatial name="rope" stiffness="200" damping="3"
 springlength=".1"><site site="hook"/><geom geom="post"{side}/><site site="end"/></spatial></tendon>
</mujoco>"""


def wrapped(rng, kind, sided):
    """Return a chain of two bodies with a tendon past a geom of the first one."""
    text = lambda x: " ".join(f"{y:.6f}" for y in np.atleast_1d(x))  # noqa: E731
    radius, place = rng.uniform(0.02, 0.08), rng.uniform(-0.03, 0.03, 3)
    aside = rng.normal(size=3)
    turn = rng.normal(size=4)
    far = 20.0 if sided != "inside" else 0.5 * radius  # outside in every projection but few
    far = place + far * aside / np.linalg.norm(aside)
    return WRAPPED.format(
        kind=kind, size=text((radius, 0.1) if kind == "cylinder" else radius), place=text(place),
        hook=text((rng.uniform(-0.3, 0.3), 0.25, rng.uniform(-0.3, 0.3))), turn=text(turn),
        axis=text(rng.normal(size=3)),
        end=text((rng.uniform(-0.1, 0.1), -0.2, rng.uniform(-0.1, 0.1))),
        site=f'<site name="side" pos="{text(far)}"/>' if sided else "",
        side=' sidesite="side"' if sided else "",
    )  # fmt: skip


@pytest.mark.parametrize("sided", [False, True], ids=["shorter", "side"])
@pytest.mark.parametrize("kind", ["sphere", "cylinder"])
def test_tendons_around_geoms_pull_as_in_mujoco(tmp_path, kind, sided):
    rng, touching = np.random.default_rng(5), 0
    for _ in range(12):
        xml = wrapped(rng, kind, sided)
        m = mujoco.MjModel.from_xml_string(xml)
        model = loaded(tmp_path, xml)
        again, out = written(tmp_path, model)
        for one, peer in ((model, m), (again, out)):
            mech, data = pg.Mechanism(one), mujoco.MjData(peer)
            for q in rng.uniform(-1.0, 1.0, (4, 3)):
                data.qpos, data.qvel = q, rng.uniform(-2.0, 2.0, 3)
                mujoco.mj_forward(peer, data)
                touching += data.ten_wrapnum[0] > 2
                found = mech.forward_dynamics(q, data.qvel)
                scale = np.abs(data.qacc).max()
                np.testing.assert_allclose(found, data.qacc, rtol=0, atol=1e-9 * scale)
    assert touching > 5


@pytest.mark.parametrize("kind", ["sphere", "cylinder"])
def test_tendons_through_geoms_are_as_long_as_in_mujoco(tmp_path, kind):
    """MuJoCo ends its search at 1e-6, of which the square is in a length, but not in a force."""
    rng, touching = np.random.default_rng(6), 0
    for _ in range(12):
        xml = wrapped(rng, kind, "inside")
        m = mujoco.MjModel.from_xml_string(xml)
        model = loaded(tmp_path, xml)
        assert model["rope"].via[0].inner
        again, out = written(tmp_path, model)
        for one, peer in ((model, m), (again, out)):
            mech, data = pg.Mechanism(one), mujoco.MjData(peer)
            for q in rng.uniform(-1.0, 1.0, (4, 3)):
                data.qpos, data.qvel = q, rng.uniform(-2.0, 2.0, 3)
                mujoco.mj_forward(peer, data)
                touching += data.ten_wrapnum[0] > 2
                assert mech.path_length(q)[0] == pytest.approx(data.ten_length[0], abs=1e-11)
                found = mech.forward_dynamics(q, data.qvel)
                scale = np.abs(data.qacc).max()
                np.testing.assert_allclose(found, data.qacc, rtol=0, atol=1e-5 * scale)
    assert touching > 20


@pytest.mark.quick
@pytest.mark.parametrize(("far", "inner"), [(0.01, True), (0.05, False)])
def test_a_sidesite_is_inside_a_cylinder_by_its_distance_from_the_centre(tmp_path, far, inner):
    """On the axis, too, as MuJoCo decides it."""
    xml = WRAPPED.format(
        kind="cylinder", size="0.03 0.1", place="0 0 0", hook="0.2 0.25 0", turn="1 0 0 0",
        axis="0 0 1", end="0 -0.2 0", site=f'<site name="side" pos="0.001 0 {far}"/>',
        side=' sidesite="side"',
    )  # fmt: skip
    assert loaded(tmp_path, xml)["rope"].via[0].inner == inner


def test_obstacles_in_a_row_are_left_out(tmp_path):
    """MuJoCo needs a site between two geoms of a tendon."""
    ends = {"radius": 0.1, "side": (0, 5, 0)}
    row = [{"body": "ground", "point": (x, 0, 0), **ends} for x in (0.3, 0.6)]
    rope = pg.Spring(name="rope", body="a", point=(1, 0, 0), stiffness=2.0, via=row)
    model = pg.Model(bodies=[pg.Body(name="a", mass=1, inertia=(1, 1, 1))], forces=[rope])
    report = pg.write_mjcf(model, tmp_path / "out.xml")
    assert "'rope'" in str(report)
    assert "without a point between" in str(report)
    assert "<tendon" not in (tmp_path / "out.xml").read_text()


ROPED = """<mujoco><option gravity="0 0 -9.81"/><worldbody><site name="hook" pos=".1 .3 .4"/>
<body><joint axis="0 1 0"/><joint type="slide" axis="1 0 .5"/>
  <inertial mass="1" pos=".05 0 0" diaginertia=".01 .012 .014"/><site name="eye" pos=".1 -.1 .05"/>
  <body pos="0 -.15 .05"><joint axis="0 0 1"/>
    <inertial mass=".7" pos="0 -.1 0" diaginertia=".01 .012 .014"/><site name="end" pos=".2 0 -.3"/>
</body></body></worldbody><tendon><spatial name="rope" stiffness="200" damping="{damping}"
 springlength="{slack}"{limits}><site site="hook"/>{via}<site site="end"/></spatial></tendon>
</mujoco>"""


@pytest.mark.parametrize("via", ["", '<site site="eye"/>'], ids=["straight", "via"])
@pytest.mark.parametrize(("slack", "damping"), [("0 1.1", 0), ("0.9 1.3", 3), ("1.1 1.1", 3)])
def test_tendons_with_a_slack_range_pull_and_push_as_in_mujoco(tmp_path, slack, damping, via):
    """There and back, at lengths within, below and beyond the range."""
    xml = ROPED.format(slack=slack, damping=damping, via=via, limits="")
    m, rng, shortest = mujoco.MjModel.from_xml_string(xml), np.random.default_rng(3), []
    model = loaded(tmp_path, xml)
    assert isinstance(model["rope"], pg.Spring if slack == "1.1 1.1" else pg.Strut)
    again, out = written(tmp_path, model)
    assert not [what for what in differences(model, again) if what[0] == "forces"]
    np.testing.assert_allclose(out.tendon_lengthspring, m.tendon_lengthspring, rtol=1e-14)
    for one, peer in ((model, m), (again, out)):
        mech, data = pg.Mechanism(one), mujoco.MjData(peer)
        for q in rng.uniform(-1.0, 1.0, (20, 3)):
            data.qpos, data.qvel = q, rng.uniform(-2.0, 2.0, 3)
            mujoco.mj_forward(peer, data)
            shortest.append(data.ten_length[0])
            found = mech.forward_dynamics(q, data.qvel)
            scale = np.abs(data.qacc).max()
            np.testing.assert_allclose(found, data.qacc, rtol=0, atol=1e-12 * scale)
    low, high = map(float, slack.split())
    assert min(shortest) < max(low, 0.9)
    assert max(shortest) > high
    assert low == high or any(low < x < high for x in shortest)


def test_limits_of_a_tendon_with_a_slack_range_are_those_of_a_spring_beside_it(tmp_path):
    model = loaded(tmp_path, ROPED.format(
        slack="0 .85", damping=0, via="", limits=' limited="true" range="0.2 1.5"',
    ))  # fmt: skip
    rope, ends = model.forces
    assert (rope.kind, ends.kind, ends.stiffness) == ("strut", "spring", 0.0)
    assert (ends.low, ends.high) == (0.2, 1.5)
    again, m = written(tmp_path, model)
    assert m.ntendon == 2
    assert not differences(model, again)


@pytest.mark.parametrize("fields", [
    {"spring": {"x": (0, 1, 2), "value": (0, 0, 50.0)}},
    {"spring": {"x": (0, 0.5, 1, 3), "value": (-25.0, 0, 0, 100.0)}},
    {"spring": {"x": (0, 1.0, 2.0, 3.0), "value": (0, 0, 50.0, 100.0)}},  # a knot without bend
    {"spring": {"x": (1, 2), "value": (10.0, 60.0)}, "damper": {"x": (0, 1), "value": (0, 2.0)}},
    {"damper": {"x": (-1, 1), "value": (-2.0, 2.0)}},
])  # fmt: skip
def test_a_strut_that_is_a_spring_or_a_rope_is_a_tendon(tmp_path, fields):
    rod = pg.Body("rod", joint="spherical", mass=1.0, inertia=(0.1,) * 3, com=(0, 0, 0.5))
    strut = pg.Strut(name="s", body="rod", point=(0, 0, 1), other_point=(1, 0.5, 0.3), **fields)
    again, m = written(tmp_path, pg.Model([rod], forces=[strut]))
    assert agree(again, m)
    ours, theirs = (pg.Mechanism(x) for x in (pg.Model([rod], forces=[strut]), again))
    rng = np.random.default_rng(2)
    for _ in range(9):
        q, v = rng.normal(size=4), rng.normal(size=3)
        q /= np.linalg.norm(q)
        found = theirs.forward_dynamics(q, v)
        np.testing.assert_allclose(found, ours.forward_dynamics(q, v), rtol=0, atol=1e-11)


@pytest.mark.parametrize("fields", [
    {"spring": {"x": (0, 1, 2), "value": (0, 10.0, 50.0)}},  # two stiffnesses
    {"spring": {"x": (0, 1, 2), "value": (1.0, 1.0, 50.0)}},  # never slack
    {"spring": {"x": (0, 1, 2), "value": (-10.0, 0.0, 0.0)}},  # only pushes
    {"spring": {"x": (0, 1), "value": (5.0, 5.0)}},  # a constant
    {"damper": {"x": (-1, 0, 1), "value": (-2.0, 0, 3.0)}},
    {"damper": {"x": (0, 1), "value": (1.0, 2.0)}},
    {"bump_length": 0.5, "bump_stiffness": 9.0},
])  # fmt: skip
def test_other_struts_are_reported(tmp_path, fields):
    rod = pg.Body("rod", joint="spherical", mass=1.0, inertia=(0.1,) * 3, com=(0, 0, 0.5))
    strut = pg.Strut(name="s", body="rod", point=(0, 0, 1), other_point=(1, 0.5, 0.3), **fields)
    report = pg.write_mjcf(pg.Model([rod], forces=[strut]), tmp_path / "out.xml")
    assert not report.loaded
    assert "force 's'" in texts(report, "left out")


PULLED = """<mujoco><worldbody><site name="hook" pos=".1 .3 .4"/>
<body><joint axis="0 1 0"/><inertial mass="1" pos=".05 0 0" diaginertia=".01 .012 .014"/>
  <geom name="post" type="cylinder" size=".05 .1" pos=".02 .1 .1" contype="0" conaffinity="0"/>
  <site name="eye" pos=".1 -.1 .05"/>
  <body pos="0 -.15 .05"><joint axis="0 0 1"/>
    <inertial mass=".7" pos="0 -.1 0" diaginertia=".01 .012 .014"/><site name="end" pos=".2 0 -.3"/>
</body></body></worldbody><tendon><spatial name="rope" stiffness="20"><site site="hook"/>
  <geom geom="post"/><site site="eye"/><site site="end"/></spatial></tendon>
<actuator>
  <motor name="m" tendon="rope" gear="-3" ctrlrange="0 2" forcerange="-1 1.5"/>
  <position name="p" tendon="rope" kp="40" kv="2" gear="-2"/>
  <velocity name="v" tendon="rope" kv="3" ctrlrange="-9 9"/>
  <general name="g" tendon="rope" gear=".5" gainprm="7" biastype="affine" biasprm="1 2 -.3"/>
</actuator></mujoco>"""


BRANCH = '<pulley divisor="2"/><site site="eye"/><site site="end"/></spatial>'


def test_actuators_on_spatial_tendons_push_as_in_mujoco(tmp_path):
    model, report = read(tmp_path, PULLED)
    assert report.loaded, report
    m, _ = compiled(tmp_path)
    kinds = [type(f).__name__ for f in model.forces]
    assert kinds == ["LinearActuator"] * 4 + ["Spring"]
    again, out = written(tmp_path, model)
    assert not [what for what in differences(model, again) if what[0] == "forces"]
    for u in ((0.0, 0.0, 0.0, 0.0), (1.2, 0.4, -2.0, 0.3)):
        given = model
        for f, x in zip(model.forces, u):
            given = given.edit(f.name, input=x)
        assert agree(given, m, u)
        assert agree(given, out, u)
    assert model["m"].forces == pytest.approx((-4.5, 3.0))
    assert (model["p"].gain, model["p"].kp, model["p"].kd) == pytest.approx((-80.0, 160.0, 8.0))


@pytest.mark.parametrize(
    ("old", "new", "fact"),
    [
        ("<position ", '<position timeconst=".1" ', "filter"),
        ('kp="40"', 'kp="40" forcerange="-9 9"', "depends on the length"),
        ("</spatial>", BRANCH, "pulleys"),
    ],
)
def test_actuators_that_no_path_has_are_left_out_by_name(tmp_path, old, new, fact):
    _, report = read(tmp_path, PULLED.replace(old, new))
    assert not report.loaded
    assert fact in texts(report, "left out")
    assert "'p'" in texts(report, "left out")


def test_a_tendon_with_armature_keeps_its_spring(tmp_path):
    xml = ROPED.format(slack="0.9 0.9", damping=3, via="", limits=' armature="2"')
    model, report = read(tmp_path, xml)
    assert not report.loaded
    assert "armature 2" in texts(report, "left out")
    assert (model["rope"].stiffness, model["rope"].rest) == (200.0, 0.9)


GIVING = """<mujoco><compiler angle="radian"/><worldbody>
<body name="base"><joint name="under" axis="0 1 0"{under}/>
  <geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass="2"/><site name="o" pos=".03 0 0"/>
<body name="fore" pos="0 0 -.3"><joint name="j" axis="0 1 0"{joint}/>
  <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".02" mass="1"/><site name="e" pos=".03 0 -.06"/>
</body></body></worldbody>
<tendon><spatial name="rope"{tendon}><site site="o"/><site site="e"/></spatial>
<fixed name="sum"><joint joint="j" coef=".5"/><joint joint="under" coef="2"/></fixed></tendon>
<actuator>{actuator}</actuator></mujoco>"""
FORCE = ' actuatorfrcrange="-2 2"'
PULLS = '<{} name="pull" tendon="rope"{}/>'
MUSCLE = ' lengthrange=".2 .4" force="500"'


def giving(actuator, under="", joint="", tendon=""):
    return GIVING.format(actuator=actuator, under=under, joint=joint, tendon=tendon)


@pytest.mark.parametrize(
    ("kind", "own", "parts", "fact"),
    [
        ("muscle", ' forcerange="-50 0"', {}, "-50 to 0"),
        ("muscle", "", {"tendon": FORCE}, "-2 to 2"),
        ("muscle", "", {"joint": FORCE}, "joint 'j'"),
        ("muscle", ' delay=".02" nsample="4"', {}, "delay 0.02"),
        ("muscle", ' armature="3"', {}, "armature 3"),
        ("muscle", ' damping="3 2 1"', {}, "dampingpoly 2 1"),
        ("motor", ' gear="2"', {"joint": FORCE}, "joint 'j'"),
        ("position", ' kp="9"', {"joint": FORCE}, "joint 'j'"),
        ("motor", ' delay=".02" nsample="4"', {}, "delay 0.02"),
    ],
)
def test_numbers_that_a_pull_lacks_are_named_and_it_stays(tmp_path, kind, own, parts, fact):
    own += MUSCLE if kind == "muscle" else ""
    model, report = read(tmp_path, giving(PULLS.format(kind, own), **parts))
    assert not report.loaded
    assert fact in texts(report, "left out")
    assert "pull" in [f.name for f in model.forces]


def test_actearly_of_a_muscle_is_named(tmp_path):
    loaded(tmp_path, giving(PULLS.format("muscle", MUSCLE)))
    numbers = "0.75 1.05 -1 200 0.5 1.6 1.5 1.3 1.2"
    kinds = " ".join(f'{x}type="muscle"' for x in ("dyn", "gain", "bias"))
    own = f' {kinds} gainprm="{numbers}" biasprm="{numbers}" dynprm=".01 .04 0" actearly="true"'
    _, report = read(tmp_path, giving(PULLS.format("general", f'{own} lengthrange=".2 .4"')))
    assert not report.loaded
    assert "actearly" in texts(report, "left out")


@pytest.mark.parametrize("kind", ["muscle", "motor"])
def test_limits_that_a_path_does_not_reach_are_no_loss(tmp_path, kind):
    """The joint under both ends of the path."""
    own = MUSCLE if kind == "muscle" else ""
    model, report = read(tmp_path, giving(PULLS.format(kind, own), under=FORCE))
    assert report.loaded
    assert "pull" in [f.name for f in model.forces]


def test_a_limit_of_a_joint_is_shared_with_a_path_that_moves_it(tmp_path):
    motor = '<motor name="m" joint="j"/>'
    _, report = read(tmp_path, giving(motor + PULLS.format("motor", ""), joint=FORCE))
    assert "'m'" in texts(report, "approximated")
    assert "'pull'" in texts(report, "left out")


@pytest.mark.parametrize(
    ("actuator", "armature"),
    [('joint="j"', "2"), ('tendon="sum"', "0"), ('tendon="rope"', "0")],
)
@pytest.mark.parametrize("parts", [{}, {"tendon": ' stiffness="40" damping="5"'}])
def test_damping_of_actuators_is_that_of_what_they_move(tmp_path, actuator, armature, parts):
    own = f'{actuator} gear="-3" damping=".7" armature="{armature}" forcerange="-.1 .1"'
    own += ' biastype="affine" biasprm=".4"'
    model = loaded(tmp_path, giving(f"<general {own}/>", **parts))
    m, _ = compiled(tmp_path)
    assert agree(model, m)


def test_the_control_of_a_muscle_is_that_beside_an_actuator_with_two_inputs(tmp_path):
    pid = '<pid name="pid" joint="j" kp="50" kv="5" input="pos vel"/>'
    muscle = PULLS.format("muscle", f'{MUSCLE} ctrlrange=".2 1"')
    model, _ = read(tmp_path, giving(pid + muscle))
    assert model["pull"].weakest == 0.2
