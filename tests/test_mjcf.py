"""MJCF in and out: the part for each element, MuJoCo's numbers for it, and hostile files."""

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.cli.main import main
from pgraph_core import errors

mujoco = pytest.importorskip("mujoco")

from tests.core.test_mjcf_of_others import (  # noqa: E402 (it needs mujoco too)
    differences,
    errors_of,
    start_of,
)

pytestmark = pytest.mark.quick

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


def read(tmp_path, text=ARM):
    path = tmp_path / "arm.xml"
    path.write_text(text)
    return pg.read_mjcf(path)


def loaded(tmp_path, text):
    """Return the model of a text, nothing of which is omitted."""
    model, report = read(tmp_path, text)
    assert report.loaded, report
    return model


def compiled(tmp_path, name="arm.xml"):
    m = mujoco.MjModel.from_xml_path(str(tmp_path / name))
    return m, mujoco.MjData(m)


def forward(tmp_path, name="arm.xml"):
    m, data = compiled(tmp_path, name)
    mujoco.mj_forward(m, data)
    return m, data


def written(tmp_path, model):
    """Return the model of a file written without omissions, and MuJoCo's model of it."""
    assert pg.write_mjcf(model, tmp_path / "out.xml").loaded
    return pg.read_mjcf(tmp_path / "out.xml")[0], compiled(tmp_path, "out.xml")[0]


def agree(model, m, ctrl=0.0) -> bool:
    rng = np.random.default_rng(0)
    return all(max(errors_of(model, m, rng, ctrl).values()) < 1e-12 for _ in range(2))


def texts(report, kind):
    return "\n".join(f"{entry.where}: {entry.text}" for entry in report.of(kind))


def test_bodies_joints_and_forces_in_and_out(tmp_path):
    model, report = read(tmp_path)
    trunk, upper, lower, tail = model.bodies
    (gear,), (motor, servo), (floor, *pairs), (tip,) = (
        model.constraints, model.forces, model.contacts, model.sites
    )  # fmt: skip
    np.testing.assert_allclose(upper.limits, [np.radians((-30, 60))])
    for found, expected in (
        ((model.name, *model.gravity), ("arm", 0.0, 0.0, -1.6)),
        ((trunk.joint, upper.joint, lower.joint), ("free", "revolute", "compound")),
        ((trunk.q, trunk.shapes[0].colour), ((0, 0, 1, 1, 0, 0, 0), (1, 0, 0))),
        ([kind for kind, _ in lower.motions], ["rotate", "translate"]),
        ([s.role for s in lower.shapes], ["visual", "collision"]),
        ((gear.body, gear.other, gear.ratio, gear.offset), ("tail", "upper", 2.0, 0.1)),
        ((motor.body, motor.coordinate, motor.gear, motor.inputs), ("lower", 0, 3.0, (-2, 2))),
        ((servo.kp, servo.kd, servo.target, servo.torque_limit), (50.0, 2.0, 0.0, 9.0)),
        (model.scenarios[0].q["tail"], (0.3,)),
        ((floor.body, floor.other, floor.friction), ("*", "ground", 0.7)),
        ({(c.body, c.other) for c in pairs}, {("trunk", "lower"), ("upper", "tail")}),
        ((tip.name, tip.body, tip.point), ("tip", "trunk", (0, 0, 0.3))),
    ):
        assert found == expected
    assert report.loaded
    assert "camera" in texts(report, "left out")
    assert "solref" in texts(report, "approximated")
    m, _ = compiled(tmp_path)
    assert agree(model, m)
    again, _ = written(tmp_path, model)
    assert not differences(model, again)
    assert [[s.role for s in b.shapes] for b in again.bodies] == [
        [s.role for s in b.shapes] for b in model.bodies
    ]


def test_hinges_at_several_places_are_bodies_in_between(tmp_path):
    text = """<mujoco><worldbody><body name="b" pos="1 0 0" quat="1 1 0 0">
    <joint axis="0 0 1"/><joint type="slide" axis="1 0 0"/><joint axis="0 1 0" pos="0 0 1"/>
    <joint type="ball" pos="0.3 0 0"/>
    <geom type="box" size="1 2 3"/></body></worldbody></mujoco>"""
    model, report = read(tmp_path, text)
    assert [b.name for b in model.bodies] == ["b/1", "b/2", "b"]
    assert agree(model, compiled(tmp_path)[0])
    _, m = written(tmp_path, model)  # one body again
    assert m.nbody == 2
    assert agree(model, m)


def test_loops_hold_in_mujoco_as_here(tmp_path):
    model = pg.Model.load(pgraph_models.path("four_bar"))
    model = model.replace(gravity=(2.0, -5.0, -9.81))
    _, m = written(tmp_path, model)
    data, mech = mujoco.MjData(m), pg.Mechanism(model)
    assert m.neq == 1
    mujoco.mj_resetDataKeyframe(m, data, 0)
    mujoco.mj_forward(m, data)
    assert np.abs(data.efc_pos).max() < 1e-12  # the loop is closed
    m.eq_solref[:], m.eq_solimp[:] = (-1e9, -1e5), (0.9999, 0.9999, 1, 0.5, 1)
    mujoco.mj_forward(m, data)
    expected, _ = mech.constrained_dynamics(*mech.home())
    np.testing.assert_allclose(data.qacc, expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max())


def test_a_spring_is_a_tendon_with_the_same_pull(tmp_path):
    rod = pg.Body(name="rod", joint="spherical", mass=1.0, tip=(0, 0, 1), com=(0, 0, 0.5))
    spring = pg.Spring(name="s", body="rod", other_point=(1, 0.5, 0.3), stiffness=30.0, damping=0.7)
    again, m = written(tmp_path, pg.Model(bodies=[rod], forces=[spring]))
    rest = np.linalg.norm((1, 0.5, -0.7))
    found = again.forces[0]
    assert (found.name, found.body, found.other, found.stiffness) == ("s", "rod", "ground", 30.0)
    np.testing.assert_allclose(found.rest, rest)
    assert agree(again, m)


def test_parts_that_mjcf_does_not_have_are_left_out_or_refused(tmp_path):
    rod = pg.Body(name="rod", tip=(1, 0, 0), mass=1.0)
    model = pg.Model(bodies=[rod], constraints=[pg.Line(name="rail", body="rod", axis=(0, 1, 0))],
                     forces=[pg.Torsion(name="twist", body="rod", stiffness=1.0)])  # fmt: skip
    report = pg.write_mjcf(model, tmp_path / "a.xml")
    assert {e.where for e in report.of("left out")} == {"constraint 'rail'", "force 'twist'"}
    assert not report.loaded
    controls = [
        pg.PID(name="pid", signal="=q.rod", kp=1.0), pg.State(name="sum", rate=1.0),
        pg.Sampled(name="held", update="=q.rod", sample=0.1),
        pg.Filter(name="slow", input="=v.rod", lag=1.0),
    ]  # fmt: skip
    drives = [pg.Motor(name="m", body="rod", torque="=x.pid"),
              pg.Actuator(name="a", body="rod", input="=q.rod")]  # fmt: skip
    driven = pg.Model(bodies=[rod], controls=controls, forces=drives)
    left = [e for e in pg.write_mjcf(driven, tmp_path / "c.xml").of("left out") if e.acts]
    named = {f"control '{c.name}'" for c in controls} | {"force 'm'", "force 'a'"}
    assert {e.where for e in left} == named
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


DYNAMIC = """<mujoco><worldbody><body><joint name="x" type="slide" axis="1 0 0"/>
<geom size=".1" mass="2"/></body></worldbody><actuator><general name="m" joint="x"
gainprm="3" ctrlrange="-9 9" {}/></actuator></mujoco>"""
INTEGRATED = DYNAMIC.format('dyntype="integrator" actrange="-.5 .6"')


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


def test_outputs_equal_the_sensors_of_mujoco(tmp_path):
    sites = ("imu", "hand", "s", "w")
    frames = [f'objtype="site" objname="{s}"' for s in sites]
    frames += ['objtype="body" objname="a"', 'objtype="xbody" objname="f"']  # a's inertial frame
    frames += ['objtype="geom" objname="box"']
    sensors = [(kind, k, x) for kind in AXES for k, x in enumerate(frames)]
    sensors += [(kind, s, f'site="{s}"') for kind in OWN[:3] for s in sites]
    sensors += [(kind, s, f'site="{s}"') for kind in OWN[3:] for s in sites[:3]]
    sensors = [f'<{kind} name="{kind} {name}" {x}/>' for kind, name, x in sensors]
    model, report = read(tmp_path, SENSED.format("".join(sensors)))
    assert "clock" in texts(report, "left out")
    mech, rng = pg.Mechanism(model), np.random.default_rng(0)
    m, data = compiled(tmp_path)
    q, v, qpos, qvel, _ = start_of(mech, m, rng)
    data.qpos[:], data.qvel[:], data.ctrl[0] = qpos, qvel, 0.7
    mujoco.mj_forward(m, data)
    stepper = pg.Stepper(mech, q=q, v=v, inputs={"m": 0.7}, method="rk4")
    assert list(stepper.outputs) == [m.sensor(k).name for k in range(m.nsensor) if k != 3]
    for name, found in stepper.outputs.items():
        expected = data.sensor(name).data
        if model.part(name, "output").kind == "rotation" and found @ expected < 0:
            expected = -expected
        np.testing.assert_allclose(np.ravel(found), expected, atol=1e-12, err_msg=name)
    again, _ = written(tmp_path, model)
    assert not differences(model, again)


BALLED = {"mass": 1, "inertia": np.eye(3), "shape": {"kind": "sphere", "radius": 0.1}}


def test_names_that_meet_and_ends_that_are_one_are_written(tmp_path):
    bodies = [pg.Body(name="a", joint="universal", **BALLED),
              pg.Body(name="a 2", parent="a", link=(1, 0, 0), mass=1, inertia=np.eye(3)),
              pg.Body(name="a 1", parent="a", joint="weld", mass=0.1)]  # fmt: skip
    forces = [pg.Tendon(name="c tendon", coefficients={"a": (1, 2)}, low=0.0, high=0.0),
              pg.Motor(name="m", body="a 2", input_low=0.0, input_high=0.0)]  # fmt: skip
    coupling = pg.Coupling(name="c", coefficients={"a": (1, 1)})
    model = pg.Model(up="z", bodies=bodies, constraints=[coupling], forces=forces)
    again, m = written(tmp_path, model)
    assert len({m.joint(k).name for k in range(3)}) == 3
    assert again.body("a 1").inertia == model.body("a 1").inertia  # of a point
    assert again.part("c tendon", "force").low == pytest.approx(0.0, abs=1e-8)


NO_MASKS = 'contype="0" conaffinity="0"'
FOUR = 'contype="4" conaffinity="4"'
OTHER = '<geom type="box" size=".1 .1 .1" {}/>'
BALLS = """<mujoco><worldbody><body name="a"><freejoint/><geom size=".1"/>{}</body>
<body name="b" pos=".15 0 0"><freejoint/><geom size=".1"/></body></worldbody></mujoco>"""
HOSTILE = {
    "<robot/>": "read_urdf",
    "<!DOCTYPE a [<!ENTITY b 'c'>]><mujoco/>": "document type",
    '<mujoco><include file="arm.xml"/></mujoco>': "line 1, include.*twice",
    '<mujoco><asset><hfield file="../../../etc/x.png"/></asset></mujoco>': "hfield, file.*exist",
    "<mujoco><worldbody><bod/></worldbody></mujoco>": "MuJoCo.*bod",
    "<mujoco><worldbody><body><joint/></body></worldbody></mujoco>": "MuJoCo.*mass",
}


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_faults_are_named_with_their_place(tmp_path, text):
    with pytest.raises(pg.FileError, match=f"arm.xml.*({HOSTILE[text]})"):
        read(tmp_path, text)


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


def test_a_written_file_that_mujoco_refuses_is_reported_and_can_be_repaired(tmp_path, capsys):
    flat = ((1.0, 0, 0), (0, 0.1, 0), (0, 0, 0.1))
    arm = pg.Body(name="arm", mass=1.0, inertia=flat, any_inertia=True, tip=(1, 0, 0))
    model, path = pg.Model(bodies=[arm]), tmp_path / "arm.xml"
    report = pg.write_mjcf(model, path)
    assert report.refused
    facts = ("MuJoCo", "'arm'", "repaired", "--repair")
    assert all(fact in str(report).splitlines()[0] for fact in facts)
    with pytest.raises(ValueError, match="inertia"):
        compiled(tmp_path)
    assert not pg.write_mjcf(report.repaired(model), path).refused
    compiled(tmp_path)
    model.save(tmp_path / "arm.json")
    assert main(["convert", str(tmp_path / "arm.json"), str(path), "--repair"]) == 0
    compiled(tmp_path)
    assert main(["convert", str(path), str(tmp_path / "back.json")]) == 0
    assert pg.Model.load(tmp_path / "back.json").bodies == pg.load(path).bodies


NO_MASS = {"mass": 0.0, "inertia": np.zeros((3, 3))}
FULL = {"mass": 1.0, "inertia": np.eye(3)}
WELDED = {"parent": "arm", "joint": "weld"}


@pytest.mark.parametrize(
    ("arm", "hand", "refuses"),
    [
        (FULL, None, False),
        ({"mass": 1.0, "inertia": np.zeros((3, 3))}, None, False),  # has the least inertia
        ({"mass": 1.0, "inertia": np.zeros((3, 3)), "any_inertia": True}, None, True),
        (NO_MASS, None, True),
        ({**NO_MASS, "armature": 1.0}, None, True),
        ({**NO_MASS, "joint": "weld"}, None, False),
        ({"mass": 0.0, "inertia": np.eye(3)}, None, True),  # a rotor
        ({"mass": 1e-16, "inertia": np.eye(3)}, None, True),
        (NO_MASS, {**FULL, **WELDED}, False),
        (NO_MASS, {**NO_MASS, **WELDED}, True),
        (NO_MASS, {**FULL, "parent": "arm"}, False),  # one body with two joints
        (NO_MASS, {**FULL, "parent": "arm", "rotation": (0.8, 0.6, 0, 0)}, True),
    ],
)
def test_moving_bodies_without_mass_are_told_exactly_if_mujoco_refuses_them(
    arm, hand, refuses, tmp_path
):
    bodies = [pg.Body(name="arm", com=(0, 0, 0), **arm)]
    bodies += [] if hand is None else [pg.Body(name="hand", com=(0, 0, 0), **hand)]
    model, path = pg.Model(bodies=bodies), tmp_path / "arm.xml"
    report = pg.write_mjcf(model, path)
    assert bool(report.refused) == refuses
    if not refuses:
        compiled(tmp_path)
        return
    assert "'arm'" in report.refused
    assert [e.part for e in report.of("warning")] == ["arm"]
    with pytest.raises(ValueError, match="inertia"):
        compiled(tmp_path)
    heavy = model.edit("arm", mass=0.01, inertia=(1e-6, 1e-6, 1e-6))
    assert not pg.write_mjcf(heavy, path).refused
    compiled(tmp_path)


RING = """<mujoco><worldbody><body><joint name="a"/><geom size=".1"/></body>
<body><joint name="b"/><geom size=".1"/></body></worldbody><equality>
<joint name="one" joint1="a" joint2="b" polycoef="0 2 0 0 0"/>
<joint name="two" joint1="b" joint2="a" polycoef="0 {} 0 0 0"/></equality></mujoco>"""
BALL = '<geom name="floor" type="plane" size="1 1 1"/><body pos="0 0 1"><freejoint/>{}</body>'


@pytest.mark.parametrize(
    ("text", "kind", "fact"),  # a fact that begins with "no " must not be there
    [
        (BALL.format('<geom size="0.1" margin="0.02"/>'), "approximated", "margin"),
        (BALL.format(f'<geom size="0.1"/><geom size="0.1" margin="0.02" {NO_MASKS}/>'),
         "approximated", "no margin"),
        (BALLS.format(OTHER.format("")), "approximated", "no 'a' and"),
        (BALLS.format(""), "approximated", "no 'a' and"),
        (BALLS.format(OTHER.format(FOUR)), "approximated", "'a' and"),
        *((RING.format(ratio), "warning", fact) for ratio, fact in
          ((0.5, "follows"), (3, "held"), (0, "no ring"))),
        (INTEGRATED.replace("</mujoco>", '<keyframe><key act=".3"/></keyframe></mujoco>'),
         "left out", "activation"),
    ],
)  # fmt: skip
def test_parts_that_differ_are_reported(tmp_path, text, kind, fact):
    """Contacts are between bodies, but masks of a file may exclude some of their geoms."""
    text = text if "<mujoco" in text else f"<mujoco><worldbody>{text}</worldbody></mujoco>"
    found = texts(read(tmp_path, text)[1], kind)
    assert (fact.removeprefix("no ") in found) != fact.startswith("no ")


def test_a_moment_of_inertia_of_a_thin_rod_is_what_mujoco_takes(tmp_path):
    rod = pg.Body(name="rod", mass=1.0, inertia=np.diag([1e-13, 1.0, 1.0]))
    report = pg.write_mjcf(pg.Model(bodies=[rod]), tmp_path / "out.xml")
    assert "'rod'" in texts(report, "approximated")
    m, _ = compiled(tmp_path, "out.xml")
    assert m.body("rod").inertia.min() == pytest.approx(1e-12)


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


def test_reports_of_parts_without_a_name_name_their_bodies(tmp_path):
    _, report = read(
        tmp_path,
        """<mujoco><worldbody><body name="a"><joint type="ball" stiffness="3"/>
<joint type="slide" axis="0 0 1"/><geom name="g" size=".1"/></body>
<body name="b" pos="1 0 0"><freejoint/><geom name="h" size=".1"/></body></worldbody><contact>
<pair geom1="g" geom2="h" condim="3" friction="1 .5 .1 .1 .1"/></contact></mujoco>""",
    )
    told = [e.text for e in report.of("left out")]
    assert any("stiffness" in text and "'a'" in text for text in told)
    assert any("direction" in text and "'a' and 'b'" in text for text in told)


def test_a_problem_without_a_place_begins_with_its_text():
    assert str(pg.FileError(errors.Problem("", "", "is cut off"))) == "is cut off"
