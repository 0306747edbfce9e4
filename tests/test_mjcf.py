"""MJCF in and out: the part for each element, MuJoCo's numbers for it, and hostile files."""

import numpy as np
import pytest

import pgraph_core as pg
import pgraph_models
from pgraph_app.cli.main import main
from pgraph_core import errors
from tests.core.test_mjcf_of_others import differences, start_of

from .mjcf_files import (
    BALL,
    BALLED,
    BALLS,
    FOUR,
    INTEGRATED,
    NO_MASKS,
    OTHER,
    agree,
    compiled,
    mujoco,
    read,
    texts,
    written,
)

pytestmark = pytest.mark.quick


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


def test_the_state_of_a_joint_of_three_motions_is_written_in_their_order(tmp_path):
    body = pg.Body(name="a", joint="planar", q=(0.1, 0.2, 0.3), v=(1, 2, 3), **BALLED)
    again, m = written(tmp_path, pg.Model(bodies=[body]))
    np.testing.assert_allclose(m.key(0).qvel, body.v)
    assert (again.body("a").q, again.body("a").v) == (body.q, body.v)


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


def test_imus_of_random_motions_equal_those_of_mujoco(tmp_path):
    sites = ("imu", "hand", "s")
    sensors = [
        f'<{k} name="{k} {s}" site="{s}"/>' for k in ("gyro", "accelerometer") for s in sites
    ]
    model, _ = read(tmp_path, SENSED.format("".join(sensors)))
    mech, rng = pg.Mechanism(model), np.random.default_rng(65)
    m, data = compiled(tmp_path)
    for _ in range(20):
        q, v, qpos, qvel, _ = start_of(mech, m, rng)
        data.qpos[:], data.qvel[:], data.ctrl[0] = qpos, qvel, rng.normal()
        mujoco.mj_forward(m, data)
        stepper = pg.Stepper(mech, q=q, v=v, inputs={"m": data.ctrl[0]}, method="rk4")
        for k in ("gyro", "accelerometer"):
            for s in sites:
                off = np.ravel(stepper.outputs[f"{k} {s}"]) - data.sensor(f"{k} {s}").data
                assert np.abs(off).max() < 1e-9, (k, s)


def test_noise_cutoff_and_delay_of_sensors_become_imperfections(tmp_path):
    imu = 'site="imu" noise=".2" cutoff="3" interval=".01" nsample="4" delay=".004"'
    sensors = f'<gyro name="g" {imu}/><velocimeter name="v" site="imu" noise=".2" cutoff="3"/>'
    sensors += '<framequat name="r" objtype="site" objname="imu" noise=".2" interval=".01"/>'
    model, report = read(tmp_path, SENSED.format(sensors))
    outputs = {o.name: o.imperfect for o in model.outputs}
    wanted = pg.Imperfect(sample=0.01, latency=0.004, density=0.2 * 0.1, low=-3, high=3)
    assert outputs["g"].density == pytest.approx(wanted.density, rel=1e-12)
    assert outputs["g"].model_copy(update={"density": wanted.density}) == wanted
    assert outputs["v"] is None
    assert outputs["r"] is None
    text = texts(report, "left out")
    for word in ("cutoff", "noise", "interval"):
        assert word in text


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
