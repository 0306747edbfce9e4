"""MJCF in and out: what each element becomes, what MuJoCo says of it, and files that mean harm."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import pgraph_core as pg
import pgraph_models
from pgraph_app.cli.main import main

mujoco = pytest.importorskip("mujoco")

from tests.core.test_mjcf_of_others import (  # noqa: E402 (it needs mujoco too)
    compare_pairs,
    errors_of,
    start_of,
)

ARM = """<mujoco model="arm">
<compiler angle="degree"/><option gravity="0 0 -1.6"/>
<default><geom friction="0.7 0.01 0.001"/><joint damping="0.3"/></default>
<worldbody>
  <geom name="floor" type="plane" size="1 1 1"/><camera name="eye"/>
  <body name="trunk" pos="0 0 1"><freejoint/><geom type="box" size=".1 .2 .3" rgba="1 0 0 1"/>
    <site name="tip" pos="0 0 .3"/>
    <body name="upper" pos="0 0 -.3" euler="0 0 30">
      <joint name="shoulder" type="hinge" axis="0 1 0" pos="0 0 .1" range="-30 60" armature=".2"
             stiffness="4" springref="15" frictionloss=".1"/>
      <geom type="capsule" size=".05 .2" mass="2"/>
      <body name="lower" pos="0 0 -.4">
        <joint name="a" axis="1 0 0"/><joint name="b" type="slide" axis="0 0 1"/>
        <geom type="cylinder" size=".05 .1" contype="0" conaffinity="0"/>
        <geom type="sphere" size=".06" pos="0 0 -.2" group="3"/>
      </body>
    </body>
    <body name="tail" pos="0 -.3 0"><joint name="t" axis="1 0 0"/><geom size=".1"/></body>
  </body>
</worldbody>
<contact><exclude body1="lower" body2="tail"/></contact>
<equality><joint joint1="t" joint2="shoulder" polycoef="0.1 2 0 0 0"/></equality>
<actuator><motor name="m" joint="a" gear="3" ctrlrange="-2 2"/>
  <position name="p" joint="shoulder" kp="50" kv="2" forcerange="-9 9"/></actuator>
<keyframe><key name="bent" qpos="0 0 2 1 0 0 0 .5 .1 .2 .3"/></keyframe>
</mujoco>
"""  # fmt: skip


def read(tmp_path, text=ARM, **options):
    path = tmp_path / "arm.xml"
    path.write_text(text)
    return pg.read_mjcf(path, **options)


def test_bodies_joints_and_what_acts(tmp_path):
    model, report = read(tmp_path)
    trunk, upper, lower, tail = model.bodies
    assert (model.name, model.gravity) == ("arm", (0.0, 0.0, -1.6))
    assert (trunk.joint, upper.joint, lower.joint) == ("free", "revolute", "compound")
    assert trunk.q == (0, 0, 1, 1, 0, 0, 0)
    np.testing.assert_allclose(upper.link, (0, 0, -0.2), atol=1e-15)  # at the hinge's anchor
    np.testing.assert_allclose(upper.com, (0, 0, -0.1), atol=1e-15)
    np.testing.assert_allclose(lower.link, (0, 0, -0.5), atol=1e-15)
    np.testing.assert_allclose(upper.limits, [np.radians((-30, 60))])
    assert (upper.armature, upper.stiffness, upper.friction) == ((0.2,), (4.0,), (0.1,))
    np.testing.assert_allclose(upper.rest, np.radians(15))
    assert [kind for kind, _ in lower.motions] == ["rotate", "translate"]
    assert [s.role for s in lower.shapes] == ["visual", "collision"]
    assert trunk.shapes[0].colour == (1, 0, 0)
    gear = model.constraints[0]
    assert (gear.body, gear.other, gear.ratio, gear.offset) == ("tail", "upper", 2.0, 0.1)
    motor, servo = model.forces
    assert (motor.body, motor.coordinate, motor.gear, motor.inputs) == ("lower", 0, 3.0, (-2, 2))
    assert (servo.kp, servo.kd, servo.target, servo.torque_limit) == (50.0, 2.0, 0.0, 9.0)
    assert model.scenarios[0].q["tail"] == (0.3,)
    floor, *pairs = model.contacts
    assert (floor.body, floor.other, floor.friction) == ("*", "ground", 0.7)
    assert {(c.body, c.other) for c in pairs} == {("trunk", "lower"), ("upper", "tail")}
    assert report.loaded
    assert "1 cameras" in {e.text for e in report.of("left out")}
    (tip,) = model.sites
    assert (tip.name, tip.body, tip.point) == ("tip", "trunk", (0, 0, 0.3))
    assert any("softer" in e.text or "solref" in e.text for e in report.of("approximated"))


def test_motion_is_that_of_mujoco(tmp_path):
    model, _ = read(tmp_path)
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    rng = np.random.default_rng(0)
    for _ in range(3):
        assert max(errors_of(model, m, rng).values()) < 1e-12


def test_hinges_at_several_places_are_bodies_in_between(tmp_path):
    text = """<mujoco><worldbody><body name="b" pos="1 0 0" quat="1 1 0 0">
    <joint axis="0 0 1"/><joint type="slide" axis="1 0 0"/><joint axis="0 1 0" pos="0 0 1"/>
    <joint type="ball" pos="0.3 0 0"/>
    <geom type="box" size="1 2 3"/></body></worldbody></mujoco>"""
    model, report = read(tmp_path, text)
    assert [b.name for b in model.bodies] == ["b/1", "b/2", "b"]
    assert report.loaded
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    assert max(errors_of(model, m, np.random.default_rng(1)).values()) < 1e-12
    pg.write_mjcf(model, tmp_path / "again.xml")  # one body again
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "again.xml"))
    assert m.nbody == 2
    assert max(errors_of(model, m, np.random.default_rng(1)).values()) < 1e-12


def test_out_and_in_again_is_the_same_model(tmp_path):
    model, _ = read(tmp_path)
    report = pg.write_mjcf(model, tmp_path / "again.xml")
    assert report.loaded
    again, _ = pg.read_mjcf(tmp_path / "again.xml")
    for one, two in zip(model.bodies, again.bodies):
        for field in ("link", "com", "inertia", "q", "rest", "mass"):
            np.testing.assert_allclose(getattr(one, field), getattr(two, field), atol=1e-12)
        for field in ("name", "parent", "joint", "limits", "friction", "armature"):
            assert getattr(one, field) == getattr(two, field)
        assert [s.role for s in one.shapes] == [s.role for s in two.shapes]
    assert [c.pair for c in again.contacts] == [c.pair for c in model.contacts]
    assert {c.friction for c in again.contacts} == {0.7}
    assert [f.name for f in again.forces] == ["m", "p"]
    assert again.scenarios == model.scenarios
    assert again.sites == model.sites
    assert [(f.gear, f.law, f.inputs, f.torques) for f in again.forces] == [
        (f.gear, f.law, f.inputs, f.torques) for f in model.forces
    ]


def test_loops_hold_in_mujoco_as_here(tmp_path):
    model = pg.Model.load(pgraph_models.path("four_bar"))
    model = model.replace(gravity=(2.0, -5.0, -9.81))
    report = pg.write_mjcf(model, tmp_path / "loop.xml")
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "loop.xml"))
    assert m.neq == 1
    data, mech = mujoco.MjData(m), pg.Mechanism(model)
    mujoco.mj_resetDataKeyframe(m, data, 0)
    mujoco.mj_forward(m, data)
    assert np.abs(data.efc_pos).max() < 1e-12  # the loop is closed
    m.eq_solref[:], m.eq_solimp[:] = (-1e9, -1e5), (0.9999, 0.9999, 1, 0.5, 1)
    mujoco.mj_forward(m, data)
    expected, _ = mech.constrained_dynamics(*mech.home())
    np.testing.assert_allclose(data.qacc, expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max())
    assert report.loaded


def test_a_spring_is_a_tendon_with_the_same_pull(tmp_path):
    rod = pg.Body(name="rod", joint="spherical", mass=1.0, tip=(0, 0, 1), com=(0, 0, 0.5))
    spring = pg.Spring(name="s", body="rod", other_point=(1, 0.5, 0.3), stiffness=30.0, damping=0.7)
    model = pg.Model(bodies=[rod], forces=[spring])
    pg.write_mjcf(model, tmp_path / "s.xml")
    again, report = pg.read_mjcf(tmp_path / "s.xml")
    assert report.loaded
    rest = np.linalg.norm((1, 0.5, -0.7))
    found = again.forces[0]
    assert (found.name, found.body, found.other, found.stiffness) == ("s", "rod", "ground", 30.0)
    np.testing.assert_allclose(found.rest, rest)
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "s.xml"))
    assert max(errors_of(again, m, np.random.default_rng(2)).values()) < 1e-12


def test_what_mjcf_does_not_have_is_told_or_refused(tmp_path):
    rod = pg.Body(name="rod", tip=(1, 0, 0), mass=1.0)
    model = pg.Model(bodies=[rod], constraints=[pg.Line(name="rail", body="rod", axis=(0, 1, 0))],
                     forces=[pg.Torsion(name="twist", body="rod", stiffness=1.0)])  # fmt: skip
    report = pg.write_mjcf(model, tmp_path / "a.xml")
    assert {e.where for e in report.of("left out")} == {"constraint 'rail'", "force 'twist'"}
    assert not report.loaded
    free = model.add(pg.Body(name="loose", parent="rod", joint="free"))
    with pytest.raises(pg.ModelError, match="'loose', joint"):
        pg.write_mjcf(free, tmp_path / "b.xml")
    assert not (tmp_path / "b.xml").exists()


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
    shifted = {e.where: e.text for e in report.of("converted") if "qpos" in e.text}
    assert ["0.3" in text for where, text in shifted.items() if "'a'" in where] == [True]
    assert ["-0.2" in text for where, text in shifted.items() if "'c'" in where] == [True]
    assert len(shifted) == 2
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    inputs = {"m": 1.2, "p": 0.4, "v": -2.0, "t": 0.7, "g": 0.3}
    assert [type(f).__name__ for f in model.forces[:6]] == [
        "Motor", "Servo", "SpeedServo", "Servo", "Actuator", "Tendon",
    ]  # fmt: skip
    assert (model["ab"].low, model["ab"].high) == pytest.approx((-3.45, 3.55))
    rng = np.random.default_rng(3)
    assert max(errors_of(model, m, rng).values()) < 1e-12
    given = model
    for name, u in inputs.items():
        given = given.edit(name, **{model[name].INPUT: u})
    for _ in range(5):
        assert max(errors_of(given, m, rng, [*inputs.values()]).values()) < 1e-12


def test_tendons_and_drives_go_out_and_in_again(tmp_path):
    model, _ = read(tmp_path, DRIVEN)
    report = pg.write_mjcf(model, tmp_path / "again.xml")
    assert report.loaded, report
    again, report = pg.read_mjcf(tmp_path / "again.xml")
    assert report.loaded, report
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    assert max(errors_of(again, m, np.random.default_rng(4)).values()) < 1e-12
    assert again.sites == model.sites
    for one, two in zip(model.forces, again.forces, strict=True):
        assert type(one) is type(two)
        assert one.name == two.name
    (one,), (two,) = model.constraints, again.constraints
    assert (one.name, one.value, one.active) == (two.name, two.value, two.active)
    assert [x for *_, x in one.terms] == pytest.approx([x for *_, x in two.terms])


def test_limits_and_couplings_of_tendons_hold_in_runs(tmp_path):
    text = """<mujoco><option gravity="0 0 0"/><worldbody>
    <body><joint name="a" axis="0 1 0"/><geom type="capsule" size=".05 .2" mass="2"/>
    <body pos="0 0 .4"><joint name="b" axis="0 1 0"/><geom type="capsule" size=".05 .2" mass="1"/>
    </body></body></worldbody><tendon><fixed name="t" limited="true" range="-.2 .3">
    <joint joint="a" coef="1"/><joint joint="b" coef=".5"/></fixed></tendon>
    <equality><tendon name="held" tendon1="t" active="false"/></equality>
    <actuator><motor name="m" joint="b" ctrlrange="-3 3"/></actuator></mujoco>"""
    model, report = read(tmp_path, text)
    assert report.loaded
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
    assert np.abs(run.q @ (1, 0.5)).max() < 1e-9
    assert np.ptp(run.q[:, 1]) > 0.1
    assert run.header["inputs"]["m"]["value"] == (0, 1)
    with pytest.raises(pg.InputError, match=r"'m'.*-3 to 3"):
        pg.simulate(model, inputs={"m": 4.0})
    with pytest.raises(pg.InputError, match=r"no motor.*'n'"):
        pg.Stepper(model, inputs={"n": 0.0})
    with pytest.raises(pg.InputError, match=r"'t', low.*add the tendon to the model"):
        pg.simulate(model.replace(forces=[]), forces=[model["t"]])
    with pytest.raises(pg.InputError, match=r"tendons.*moreau_jean"):
        pg.simulate(model, method="dop853", t_end=0.1)


def test_a_filter_is_a_lag_of_the_input(tmp_path):
    text = """<mujoco><worldbody><body><joint name="x" type="slide" axis="1 0 0"/>
    <geom size=".1" mass="2"/></body></worldbody><actuator><general name="m" joint="x"
    dyntype="filter" dynprm=".2" gainprm="3" ctrlrange="-9 9"/></actuator></mujoco>"""
    model, report = read(tmp_path, text)
    assert report.loaded
    assert model["m"].lag == 0.2
    x = lambda t: 1.5 * (t**2 / 2 - 0.2 * t + 0.04 * (1 - np.exp(-t / 0.2)))  # noqa: E731
    run = pg.simulate(model, t_end=1.0, inputs={"m": 1.0}, frames=11)
    np.testing.assert_allclose(run.q[:, 0], x(run.t), atol=1e-9)
    ramp = pg.Table(t=[0, 0.5, 1.0], value=[0, 1, 0])
    run = pg.simulate(model, t_end=1.0, inputs={"m": ramp}, step=1e-3, method="rk4")
    act, acts = 0.0, [0.0]
    for k in range(200000):  # y' = (u - y) / lag by the midpoint rule
        t = 5e-6 * (k + 0.5)
        act += 5e-6 * (np.interp(t, ramp.t, ramp.value) - act) / (0.2 + 2.5e-6)
        acts.append(act)
    expected = np.interp(run.t, np.linspace(0, 1, 200001), acts)
    np.testing.assert_allclose(run.vdot[:, 0], 1.5 * expected, atol=1e-8)
    stepper = pg.Stepper(model, step=1e-3)
    stepper.step(inputs={"m": 1.0}, n=300)
    stepper.step(inputs={"m": 1.0}, n=200)  # the same again changes nothing
    assert stepper.q[0] == pytest.approx(x(0.5), abs=1e-9)
    pg.write_mjcf(model, tmp_path / "again.xml")
    assert pg.read_mjcf(tmp_path / "again.xml")[0].forces == model.forces


INTEGRATED = """<mujoco><worldbody><body><joint name="x" type="slide" axis="1 0 0"/>
<geom size=".1" mass="2"/></body></worldbody><actuator><general name="m" joint="x"
dyntype="integrator" gainprm="3" ctrlrange="-9 9" actrange="-.5 .6"/></actuator></mujoco>"""


def test_an_integrator_is_the_integral_of_the_input(tmp_path):
    model, report = read(tmp_path, INTEGRATED)
    assert report.loaded
    ramp = pg.Table(t=[0, 2], value=[1, -1])  # integral t - t^2 / 2, at most 0.5
    run = pg.simulate(model, t_end=2.0, inputs={"m": ramp}, frames=21)
    expected = 1.5 * (run.t - run.t**2 / 2)
    np.testing.assert_allclose(run.vdot[:, 0], expected, atol=1e-13)
    run = pg.simulate(model, t_end=1.0, inputs={"m": 1.0}, frames=11)  # 0.6 from t = 0.6 on
    np.testing.assert_allclose(run.vdot[:, 0], 1.5 * np.minimum(run.t, 0.6), atol=1e-13)
    stepper = pg.Stepper(model, step=1e-3)
    stepper.step(inputs={"m": 2.0}, n=400)  # 0.6 from t = 0.3 on
    stepper.step(inputs={"m": -1.0}, n=200)
    assert stepper.vdot[0] == pytest.approx(1.5 * 0.4, abs=1e-12)
    pg.write_mjcf(model, tmp_path / "again.xml")
    assert pg.read_mjcf(tmp_path / "again.xml")[0].forces == model.forces
    m = mujoco.MjModel.from_xml_string(INTEGRATED)
    data = mujoco.MjData(m)
    m.opt.timestep, data.ctrl[0] = 1e-4, 1.0
    while data.time < 1.0 - 1e-9:
        mujoco.mj_step(m, data)
    assert run.q[-1, 0] == pytest.approx(data.qpos[0], abs=2e-4)  # its steps of first order


@pytest.mark.parametrize("t_start", [0.0, 5.0])
def test_what_acts_first_is_of_the_start_of_the_run(t_start):
    body = pg.Body(name="a", joint="prismatic", axes=(1, 0, 0), mass=1.0)
    table = pg.Table(t=[0, 4, 6, 10], value=[3, 3, 3, 3])

    def lagging(**fields):
        return pg.Motor(**{"name": "m", "body": "a", "torque": 3.0, "lag": 0.5} | fields)

    drives = (
        (lagging(start=1.0), lambda s: 3 - 2 * np.exp(-2 * s)),
        (lagging(start=1.0, torque=table), lambda s: 3 - 2 * np.exp(-2 * s)),
        (lagging(), lambda s: 3 + 0 * s),
        (pg.Motor(name="m", body="a", torque=3.0, integrates=True, start=1.0), lambda s: 1 + 3 * s),
    )
    for drive, expected in drives:
        model = pg.Model(bodies=[body], gravity=(0, 0, 0), forces=[drive])
        given = {"m": drive.torque} if drive.start is not None else None
        for inputs in (None, given):
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
        ('tendon="two" forcerange="-4 4"', None),
        ('tendon="two"', None),
    ],
)
def test_limits_of_joints_and_tendons_bound_what_drives_them(tmp_path, motor, torques):
    model, report = read(tmp_path, LIMITED.format(motor))
    assert report.loaded == (torques is not None)
    if torques is None:
        assert any("joint 'x'" in e.text and "'m'" in e.where for e in report.of("left out"))
    else:
        assert model["m"].torques == pytest.approx(torques)


def test_what_a_keyframe_holds_besides_a_state_is_told(tmp_path):
    text = INTEGRATED.replace("</mujoco>", '<keyframe><key act=".3"/></keyframe></mujoco>')
    report = read(tmp_path, text)[1]
    assert any("activations" in e.text for e in report.of("left out"))


AXES = ("framepos", "framequat", "framelinvel", "frameangvel")
OWN = ("gyro", "velocimeter", "accelerometer", "force", "torque")
SENSED = """<mujoco><option gravity="1 2 -9"/><default><geom contype="0" conaffinity="0"/></default>
<worldbody><site name="w" pos="1 2 3" euler="9 8 7"/>
<body name="a" pos="0 0 1"><joint name="x" axis="0 1 0" damping=".1"/>
<geom type="capsule" fromto="0 0 0 .4 0 0" size=".05"/>
<site name="imu" pos=".2 .1 0" euler="1 2 3"/>
<body name="b" pos=".4 0 0"><joint name="y" axis="0 0 1" stiffness="3"/>
<geom name="box" type="box" size=".1 .2 .1" pos=".1 0 0" euler="0 4 5"/>
<site name="hand" pos="0 .1 .2" euler="0 0 70"/></body></body>
<body name="f" pos="2 0 0"><freejoint/><geom size=".2 .1 .1" type="ellipsoid"/>
<site name="s" pos=".1 0 0" euler="5 6 7"/></body></worldbody>
<actuator><motor name="m" joint="y"/></actuator><sensor><jointpos name="jx" joint="x"/>
<jointvel name="jy" joint="y"/><framepos name="b" objtype="xbody" objname="b"/><clock/>{}
</sensor></mujoco>"""  # fmt: skip


def test_outputs_are_what_sensors_of_mujoco_read(tmp_path):
    given = [f'objtype="site" objname="{s}"' for s in ("imu", "hand", "s", "w")]
    given += ['objtype="body" objname="a"', 'objtype="xbody" objname="f"']  # a's inertial frame
    given += ['objtype="geom" objname="box"']
    sensors = [f'<{kind} name="{kind} {k}" {x}/>' for kind in AXES for k, x in enumerate(given)]
    sites = ("imu", "hand", "s", "w")
    sensors += [f'<{kind} name="{kind} {s}" site="{s}"/>' for kind in OWN[:3] for s in sites]
    sensors += [f'<{kind} name="{kind} {s}" site="{s}"/>' for kind in OWN[3:] for s in sites[:3]]
    model, report = read(tmp_path, SENSED.format("".join(sensors)))
    assert [e.text for e in report.of("left out")] == ["of kind clock: 'clock 4'"]
    mech, rng = pg.Mechanism(model), np.random.default_rng(0)
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    q, v, qpos, qvel, _ = start_of(mech, m, rng)
    data = mujoco.MjData(m)
    data.qpos[:], data.qvel[:], data.ctrl[0] = qpos, qvel, 0.7
    mujoco.mj_forward(m, data)
    stepper = pg.Stepper(mech, q=q, v=v, inputs={"m": 0.7}, method="rk4")
    assert list(stepper.outputs) == [m.sensor(k).name for k in range(m.nsensor) if k != 3]
    for name, found in stepper.outputs.items():
        expected = data.sensor(name).data
        if model.part(name, "output").kind == "rotation" and found @ expected < 0:
            expected = -expected
        np.testing.assert_allclose(np.ravel(found), expected, atol=1e-12, err_msg=name)
    pg.write_mjcf(model, tmp_path / "again.xml")
    again, _ = pg.read_mjcf(tmp_path / "again.xml")
    assert again.outputs == model.outputs
    assert {site.name for site in again.sites} == {site.name for site in model.sites}
    for site in model.sites:
        twin = again.part(site.name, "site")
        assert twin.body == site.body
        np.testing.assert_allclose(twin.point, site.point, atol=1e-15)
        np.testing.assert_allclose(twin.rotation, site.rotation, atol=1e-15)


def written(tmp_path, model):
    """(the model of a written file, what MuJoCo makes of it)"""
    pg.write_mjcf(model, tmp_path / "out.xml")
    compiled = mujoco.MjModel.from_xml_path(str(tmp_path / "out.xml"))
    return pg.read_mjcf(tmp_path / "out.xml")[0], compiled


def test_names_that_meet_and_ends_that_are_one_are_written(tmp_path):
    ball = {"kind": "sphere", "radius": 0.1}
    model = pg.Model(
        up="z",
        bodies=[
            pg.Body(name="a", joint="universal", mass=1, inertia=np.eye(3), shape=ball),
            pg.Body(name="a 2", parent="a", link=(1, 0, 0), mass=1, inertia=np.eye(3)),
            pg.Body(name="a 1", parent="a", joint="weld", mass=0.1),  # a point
        ],
        constraints=[pg.Coupling(name="c", coefficients={"a": (1, 1)})],
        forces=[
            pg.Tendon(name="c tendon", coefficients={"a": (1, 2)}, low=0.0, high=0.0),
            pg.Motor(name="m", body="a 2", input_low=0.0, input_high=0.0),
        ],
    )
    again, compiled = written(tmp_path, model)
    assert len({compiled.joint(k).name for k in range(3)}) == 3
    assert again.body("a 1").inertia == model.body("a 1").inertia
    assert again.part("c tendon", "force").low == pytest.approx(0.0, abs=1e-8)


def test_each_pair_keeps_its_friction(tmp_path):
    ball = {"kind": "sphere", "radius": 0.1}
    names = ("a", "b", "c")
    bodies = [
        pg.Body(name=x, joint="free", mass=1, inertia=np.eye(3), shape=ball, link=(k, 0, 1))
        for k, x in enumerate(names)
    ]
    bodies.append(pg.Body(name="d", parent="a", mass=1, inertia=np.eye(3), shape=ball))
    contacts = [
        pg.Contact(name="a floor", body="a", friction=0.9),
        pg.Contact(name="b floor", body="b", friction=0.1, rolling_friction=0.01),
        pg.Contact(name="a, b", body="a", other="b", friction=0.0),
        pg.Contact(name="b, c", body="b", other="c", friction=0.5, spinning_friction=0.02),
        pg.Contact(name="a, d", body="a", other="d", friction=0.3),  # neighbours
    ]
    again, _ = written(tmp_path, pg.Model(up="z", bodies=bodies, contacts=contacts))

    def laws(parts):
        kinds = ("friction", "spinning_friction", "rolling_friction")
        return {frozenset(c.pair): [getattr(c, k) or 0.0 for k in kinds] for c in parts}

    assert laws(again.contacts) == laws(contacts)


NO_MASKS = 'contype="0" conaffinity="0"'
PAIR = '<contact><pair geom1="g" geom2="h" friction="0.3 0.3 0.01 0 0"/></contact>'


BALLS = """<mujoco><worldbody>
<body name="a"><freejoint/><geom name="g" size=".1" {g}/>{more}</body>
<body name="b" pos=".15 0 0"><freejoint/><geom name="h" size=".1" {h}/></body>
</worldbody>{parts}</mujoco>"""


@pytest.mark.parametrize(
    ("g", "more", "h", "parts", "touch"),
    [
        (NO_MASKS, "", NO_MASKS, PAIR, True),
        (NO_MASKS, "", NO_MASKS, "", False),
        ("", "", NO_MASKS, PAIR, True),
        (NO_MASKS, "", NO_MASKS, PAIR + '<option><flag contact="disable"/></option>', False),
        (NO_MASKS, "", NO_MASKS, PAIR + '<option><flag constraint="disable"/></option>', False),
    ],
)
def test_pairs_touch_whatever_their_masks(tmp_path, g, more, h, parts, touch):
    """A file may switch off all masks and name the pairs that touch."""
    text = BALLS.format(g=g, more=more, h=h, parts=parts)
    model, _ = read(tmp_path, text)
    theirs = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(theirs)
    mujoco.mj_forward(theirs, data)
    assert bool(data.ncon) is touch
    assert len(model.contacts) is int(touch)
    assert not touch or model.contacts[0].friction == 0.3
    assert all(s.role == ("both" if touch else "visual") for b in model.bodies for s in b.shapes)


def test_shapes_that_touch_more_than_in_the_file_are_named(tmp_path):
    """Contacts are between bodies; masks may leave some of their geoms out."""
    other = '<geom type="box" size=".1 .1 .1" {}/>'
    masks = 'contype="4" conaffinity="4"'
    said = {}
    for name, more in {"same": other.format(""), "less": other.format(masks), "one": ""}.items():
        _, report = read(tmp_path, BALLS.format(g="", more=more, h="", parts=""))
        said[name] = [e.text for e in report.of("approximated") if "all of their shapes" in e.text]
    assert said["same"] == said["one"] == []
    assert len(said["less"]) == 1
    assert said["less"][0].startswith("'a' and 'b' touch with all")


HOSTILE = {
    "<robot/>": "read_urdf",
    "<!DOCTYPE a [<!ENTITY b 'c'>]><mujoco/>": "document type",
    '<mujoco><include file="/etc/passwd"/></mujoco>': "line 1, include, file.*outside",
    '<mujoco><include file="arm.xml"/></mujoco>': "line 1, include.*twice",
    '<mujoco><include file="../../x.xml"/></mujoco>': "line 1, include, file",
    '<mujoco><asset><mesh file="/etc/passwd"/></asset></mujoco>': "line 1, mesh, file.*outside",
    '<mujoco><compiler meshdir="/etc"/></mujoco>': "line 1, compiler, meshdir.*outside",
    '<mujoco><asset><hfield file="../../../etc/x.png"/></asset></mujoco>': "hfield, file.*outside",
    "<mujoco><worldbody><bod/></worldbody></mujoco>": "MuJoCo refuses it.*bod",
    "<mujoco><worldbody><body><joint/></body></worldbody></mujoco>": "MuJoCo refuses it.*mass",
}


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_what_is_wrong_is_told_with_its_place(tmp_path, text):
    with pytest.raises(pg.FileError, match=f"arm.xml.*({HOSTILE[text]})"):
        read(tmp_path, text)


def test_meshes_keep_their_place(tmp_path):
    import trimesh

    box = trimesh.creation.box((0.2, 0.4, 0.6))
    box.apply_translation((1.0, 2.0, 3.0))
    box.apply_transform(trimesh.transformations.rotation_matrix(0.5, (1, 2, 3)))
    box.export(tmp_path / "part.stl")
    text = """<mujoco><asset><mesh name="p" file="part.stl" scale="1 2 1"/></asset><worldbody>
    <body pos="0 0 1"><joint pos="0 1 0"/>
    <geom type="mesh" mesh="p" pos=".1 .2 .3" euler="10 20 30"/></body></worldbody></mujoco>"""
    model, report = read(tmp_path, text)
    assert report.loaded
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    theirs = data.geom_xpos[0] + m.mesh_vert @ data.geom_xmat[0].reshape(3, 3).T
    from pgraph_core.mesh_files import load_mesh
    from pgraph_core.rotation import matrix

    shape = model.bodies[0].shapes[0]
    place, turn = pg.Mechanism(model).pose(pg.Mechanism(model).home()[0], model.bodies[0].name)
    own = load_mesh(shape.file, shape.scale).vertices @ matrix(shape.rotation).T
    ours = place + (own + np.array(shape.position)) @ turn.T
    for points in (theirs, ours):
        points[:] = points[np.lexsort(np.round(points, 5).T)]
    np.testing.assert_allclose(ours, theirs, atol=1e-6)  # STL has single precision


def test_convert_goes_both_ways(tmp_path):
    (tmp_path / "arm.xml").write_text(ARM)
    assert main(["convert", str(tmp_path / "arm.xml"), str(tmp_path / "arm.json")]) == 0
    model = pg.Model.load(tmp_path / "arm.json")
    assert model.bodies == pg.Model.load(tmp_path / "arm.xml").bodies
    assert main(["convert", str(tmp_path / "arm.json"), str(tmp_path / "back.xml")]) == 0
    assert pg.Model.load(tmp_path / "back.xml").bodies[0].name == "trunk"


@pytest.mark.parametrize(
    ("low", "high", "value"),
    [(1.0, 2.0, 1.5), (1.0, 2.0, 1.0), (-1.0, 1.0, 0.5), (-3.0, -1.0, -2.0)],
)
def test_a_written_drive_starts_at_its_input(tmp_path, low, high, value):
    """MuJoCo starts at control 0, or the nearest that its range has."""
    arm = pg.Body(name="arm", tip=(1, 0, 0))
    motor = pg.Motor(name="motor", body="arm", torque=value, input_low=low, input_high=high)
    pg.write_mjcf(pg.Model(bodies=[arm], forces=[motor]), tmp_path / "arm.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.actuator_force[0] == pytest.approx(value, rel=1e-12)
    assert model.actuator_ctrlrange[0, 1] - model.actuator_ctrlrange[0, 0] == pytest.approx(
        high - low
    )


def test_wrenches_that_cannot_be_written_are_said(tmp_path):
    """Two that carry half of the weight each are one compensation; another force is left out."""
    arm = pg.Body(name="arm", mass=2.0, com=(0.5, 0, 0), tip=(1, 0, 0))
    half = [
        pg.Wrench(name=name, body="arm", point=(0.5, 0, 0), force=(0, 0, 9.81))
        for name in ("a", "b")
    ]
    push = pg.Wrench(name="push", body="arm", force=(1, 0, 0))
    report = pg.write_mjcf(pg.Model(bodies=[arm], forces=[*half, push]), tmp_path / "arm.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    assert model.body_gravcomp.max() == pytest.approx(1.0, rel=1e-12)
    assert "push" in str(report)


SWINGS = """<mujoco><option actuatorgroupdisable="1"{option}/><worldbody>
<body name="a"><joint name="j" type="slide" axis="1 0 0" range="-1 1" margin="{margin}"/>
  <geom size=".1" mass="2" contype="0" conaffinity="0"/></body>
<body name="b" gravcomp=".5"><joint name="k" axis="0 1 0"/>
  <geom size=".1" pos=".3 0 0" mass="1" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor name="off" joint="k" group="1"/><motor name="on" joint="k" group="2"/></actuator>
</mujoco>"""


def test_an_actuator_of_a_group_that_is_switched_off_does_not_act(tmp_path):
    model, report = read(tmp_path, SWINGS.format(option="", margin=0))
    assert [f.name for f in model.forces if isinstance(f, pg.Motor)] == ["on"]
    assert any("'off'" in e.where and "group 1" in e.text for e in report.of("left out"))
    assert report.loaded  # it does not act in MuJoCo either


def test_the_margin_of_a_limit_moves_its_ends(tmp_path):
    """MuJoCo: at 1 m/s towards the limit at 1 m with a margin of 0.3 m it turns at 0.7 m."""
    model, report = read(tmp_path, SWINGS.format(option=' gravity="0 0 0"', margin=0.3))
    assert model.body("a").limits == ((-0.7, 0.7),)
    assert report.loaded
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data = mujoco.MjData(m)
    data.qvel[0] = 1.0
    reached = 0.0
    for _ in range(600):
        mujoco.mj_step(m, data)
        reached = max(reached, data.qpos[0])
    assert reached == pytest.approx(0.7, abs=0.01)  # its limit is soft
    model, report = read(tmp_path, SWINGS.format(option="", margin=1.5))
    assert model.body("a").limits == ((-1, 1),)
    assert not report.loaded


def test_the_report_says_where_gravcomp_acts(tmp_path):
    """Half of the weight: in a run, and as `external` in a query, v' is half of the free one."""
    model, report = read(tmp_path, SWINGS.format(option="", margin=0))
    (text,) = (e.text for e in report.of("converted") if "gravcomp" in e.text)
    assert "'b'" in text
    assert "`forward_dynamics`" in text
    mech = pg.Mechanism(model)
    (lift,) = (f for f in model.forces if isinstance(f, pg.Wrench))
    q = v = np.zeros(2)
    free = mech.forward_dynamics(q, v)
    external = mech.external_at(q, "b", (0, 0, 0, *lift.force), point=lift.point)
    np.testing.assert_allclose(
        mech.forward_dynamics(q, v, external=external)[1], free[1] / 2, rtol=1e-12
    )


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
    for kind, where, words in (
        ("left out", "tendon 'idle'", "without spring"),
        ("left out", "geom 'far'", "touches nothing"),
        ("warning", "key 'far'", "beyond the limits of x"),
        ("converted", "arm.xml", "ball or free joints"),
    ):
        assert any(words in e.text and where in e.where for e in report.of(kind)), words
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
    assert any("actuatorgravcomp" in e.text for e in report.of("left out")) != lifted
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    run = pg.simulate(model, t_end=1e-3)
    np.testing.assert_allclose(run.vdot[0, 0], data.qacc[0], atol=1e-12)


def test_a_written_file_that_mujoco_refuses_says_so_first_and_how_to_repair_it(tmp_path, capsys):
    flat = ((1.0, 0, 0), (0, 0.1, 0), (0, 0, 0.1))
    arm = pg.Body(name="arm", mass=1.0, inertia=flat, any_inertia=True, tip=(1, 0, 0))
    model, path = pg.Model(bodies=[arm]), tmp_path / "arm.xml"
    report = pg.write_mjcf(model, path)
    first = str(report).splitlines()[0]
    for part in ("MuJoCo will refuse it", "'arm'", "report.repaired(model)", "--repair"):
        assert part in first
    with pytest.raises(ValueError, match="inertia"):
        mujoco.MjModel.from_xml_path(str(path))
    assert not pg.write_mjcf(report.repaired(model), path).refused
    mujoco.MjModel.from_xml_path(str(path))
    model.save(tmp_path / "arm.json")
    assert main(["convert", str(tmp_path / "arm.json"), str(path), "--repair"]) == 0
    mujoco.MjModel.from_xml_path(str(path))
    assert "refuse" not in capsys.readouterr().out


@pytest.mark.parametrize(("margin", "gap", "named"), [(0.02, 0.0, True), (0.02, 0.02, False)])
def test_contacts_that_push_before_they_touch_are_named(tmp_path, margin, gap, named):
    text = f"""<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body pos="0 0 1"><freejoint/><geom size="0.1" margin="{margin}" gap="{gap}"/></body>
</worldbody></mujoco>"""
    _, report = read(tmp_path, text)
    assert ("margin" in str(report)) == named


@pytest.mark.parametrize(("ratio", "told"), [(0.5, ["follows from"]), (3, ["are held"]), (0, [])])
def test_equalities_of_joints_in_a_ring_are_named(tmp_path, ratio, told):
    body = '<body><joint name="{0}"/><geom size=".1"/></body>'
    bodies = "".join(map(body.format, "ab"))
    ring = f"""<joint name="one" joint1="a" joint2="b" polycoef="0 2 0 0 0"/>
      <joint name="two" joint1="b" joint2="a" polycoef="0 {ratio} 0 0 0"/>"""
    text = f"<mujoco><worldbody>{bodies}</worldbody>\n<equality>{ring}</equality></mujoco>"
    _, report = read(tmp_path, text)
    said = [e for e in report.of("warning") if "ring of gears" in e.text]
    assert [word in e.text for e, word in zip(said, told, strict=True)] == [True] * len(told)
    assert all("line 3, joint 'two'" in e.where for e in said)


def test_a_plane_has_no_end_whatever_size_it_is_drawn_with(tmp_path):
    """A plane above or beside z = 0 is a wide box that touches; the size is what is drawn."""
    plane = '<geom name="{}" type="plane" size="{}" pos="{}" zaxis="{}"/>'
    text = f"""<mujoco><worldbody>{plane.format("low", "1 2 .1", "0 0 -.3", "0 0 1")}
      {plane.format("wall", "0 0 .1", "3 0 0", "-1 0 0")}
      {plane.format("far", "70 1 .1", "0 -9 0", "0 1 0")}
      <body name="ball" pos="2.5 5 1"><freejoint/><geom size=".2"/></body></worldbody></mujoco>"""
    model, report = read(tmp_path, text)
    assert report.loaded
    world = model.body("world")
    assert [s.role for s in world.shapes] == ["collision", "visual", "both", "collision", "visual"]
    assert [s.size[0] for s in world.shapes] == [100, 2, 100, 140, 140]
    assert all("100 m wide" in e.text for e in report.of("approximated") if "plane" in e.text)
    for x, y, gap in ((-20.0, 0.0, 1.1), (0.0, 30.0, 1.1), (2.0, -5.0, 0.8), (2.0, 8.0, 0.8)):
        there = model.edit("ball", q=(x, y, 1.0, 1.0, 0.0, 0.0, 0.0))
        (found,) = pg.simulate(there, t_end=1e-3).contact_gap.values()
        assert abs(found[0] - gap) < 1e-12


HEAP = """<mujoco><asset><mesh name="part" file="part.stl"/></asset><worldbody>
<geom name="floor" type="plane" size="1 1 1"/>
<geom name="wall" type="plane" size="1 1 1" pos="4 0 0" zaxis="-1 0 1"/>
<geom pos="0 3 0" size=".5"/>
<body name="a"><freejoint/><geom type="mesh" mesh="part" contype="2"/></body>
<body name="b"><freejoint/><geom type="ellipsoid" size=".1 .2 .3" conaffinity="2"/></body>
<body><freejoint/><geom name="c" type="cylinder" size=".1 .2" contype="0" conaffinity="0"/>
  <body><joint axis="1 0 0"/><geom name="d" type="box" size=".1 .2 .3"/>
    <body><joint axis="0 1 0"/><geom name="e" type="capsule" size=".1 .2" pos="0 0 1"/></body>
</body></body></worldbody>
<contact><pair geom1="c" geom2="floor"/><pair geom1="c" geom2="e"/><exclude body1="a" body2="b"/>
</contact></mujoco>"""


@pytest.mark.parametrize(
    ("text", "count"),
    [
        (ARM, 6),
        (HEAP, 18),
        (HEAP.replace("<asset>", '<option><flag filterparent="disable"/></option><asset>'), 19),
        (HEAP.replace("<asset>", '<option><flag contact="disable"/></option><asset>'), 0),
    ],
)
def test_the_same_pairs_may_touch_at_the_same_distances(tmp_path, monkeypatch, text, count):
    trimesh.creation.icosphere(subdivisions=2, radius=0.3).export(tmp_path / "part.stl")
    (tmp_path / "model.xml").write_text(text)
    pairs, more, worst = compare_pairs(tmp_path / "model.xml", monkeypatch)
    assert (pairs, more) == (count, 0)
    assert worst < 1e-6
