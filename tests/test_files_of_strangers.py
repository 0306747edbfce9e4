"""Habits of files of other programs: each is read as its program reads it, or named."""

import os

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.formats import read_model
from pgraph_core.rotation import matrix
from tests.refusals import assert_names

INERTIA = '<inertia ixx=".01" iyy=".02" izz=".025" ixy="0" ixz="0" iyz="0"/>'
MASS = f'<inertial><mass value="1"/>{INERTIA}</inertial>'


def written(folder, text, name="robot.urdf"):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def pair(kind="continuous", inside="", inertial=MASS, more=""):
    """Return a URDF of links b and c, with a joint of this kind between them."""
    return f"""<robot name="r"><link name="b"/><link name="c">{inertial}{more}</link>
      <joint name="j" type="{kind}"><parent link="b"/><child link="c"/>{inside}</joint></robot>"""


# -- URDF ------------------------------------------------------------------------------------------

AXES = ["0 0 1", "0 0 2", "0 0 -1", "0 1 0", "-1 0 0", "1 1 1", "0.3 -0.2 0.8", "0 .01 -1"]


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("origin", ["", '<origin xyz="1 2 3" rpy=".3 -.2 1"/>'])
def test_a_planar_joint_has_the_coordinates_of_mujoco(tmp_path, axis, origin):
    mujoco = pytest.importorskip("mujoco")
    path = written(tmp_path, pair("planar", f'{origin}<axis xyz="{axis}"/>'))
    m = mujoco.MjModel.from_xml_path(str(path))
    mech = pg.Mechanism(pg.load(path))
    for q in (*np.eye(3), np.array([0.3, -0.7, 1.1])):
        data = mujoco.MjData(m)
        data.qpos[:] = q
        mujoco.mj_kinematics(m, data)
        place, turn = mech.pose(q, "c")
        np.testing.assert_allclose(place, data.body("c").xpos, atol=1e-12)
        np.testing.assert_allclose(turn, data.body("c").xmat.reshape(3, 3), atol=1e-12)


@pytest.mark.parametrize("kind", ["planar", "floating"])
@pytest.mark.parametrize(
    ("inside", "said"),
    [
        ('<dynamics damping="2"/>', "damping"),
        ('<dynamics friction=".1" damping="0"/>', "friction"),
        ('<limit lower="-1" upper="1" effort="1" velocity="1"/>', "lower and upper"),
        ('<dynamics damping="0.0"/>', ""),
    ],
)
def test_dynamics_of_several_motions_are_named(tmp_path, kind, inside, said):
    _, report = read_model(written(tmp_path, pair(kind, inside)))
    assert report.loaded == (not said)
    assert said in str(report)


@pytest.mark.parametrize(
    ("inside", "word"),
    [
        (INERTIA, "no <mass"),
        (f"<mass/>{INERTIA}", "no <mass"),
        (f'<mass val="2"/>{INERTIA}', "'val' of <mass>"),
        (f'<masse value="2"/>{INERTIA}', "did you mean <mass>"),
        (f'<weight value="2"/>{INERTIA}', "<weight>"),
        ('<origin xyz="0 0 1"/>', "no <mass"),
    ],
)
def test_an_inertia_without_mass_is_named_in_the_report_and_in_runs(tmp_path, inside, word):
    model, report = read_model(written(tmp_path, pair(inertial=f"<inertial>{inside}</inertial>")))
    assert not report.loaded
    assert model.body("c").mass == 0.0
    assert_names(str(report), word, "line 1", "'c'")
    assert any("no <mass" in text for text in model.lost)


@pytest.mark.parametrize("density", [500, 7850.0])
@pytest.mark.parametrize("solids", [["box"], ["box", "sphere"]])
def test_a_density_gives_the_mass_of_the_collision_shapes(tmp_path, density, solids):
    geometry = {"box": '<box size=".1 .2 .3"/>', "sphere": '<sphere radius=".1"/>'}
    shapes = "".join(
        f'<collision><origin xyz="{k} 0 0"/><geometry>{geometry[x]}</geometry></collision>'
        for k, x in enumerate(solids)
    )
    drawn = '<visual><geometry><box size="9 9 9"/></geometry></visual>'
    inertial = f'<inertial><density value="{density}"/></inertial>'
    body = read_model(written(tmp_path, pair(inertial=inertial, more=shapes + drawn)))[0].body("c")
    volumes = {"box": 0.1 * 0.2 * 0.3, "sphere": 4 / 3 * np.pi * 0.1**3}
    masses = [density * volumes[x] for x in solids]
    assert body.mass == pytest.approx(sum(masses))
    assert body.com[0] == pytest.approx(np.arange(len(solids)) @ masses / sum(masses))
    assert np.linalg.eigvalsh(body.inertia)[0] > 0.0


@pytest.mark.parametrize(
    "shapes", ["", '<collision><geometry><box size="1 1 1"/></geometry></collision>']
)
def test_a_density_without_effect_is_named(tmp_path, shapes):
    number = 0 if shapes else 500
    inertial = f'<inertial><density value="{number}"/></inertial>'
    _, report = read_model(written(tmp_path, pair(inertial=inertial, more=shapes)))
    assert not report.loaded
    assert "density" in str(report)


@pytest.mark.parametrize(
    ("inside", "acts"),
    [
        ('<limit lower="-1" uper="1" effort="1" velocity="1"/>', True),
        ('<limit lower="-1" upper="1" effort="1" velocity="1" jerk="5"/>', False),
        ('<dynamics dampin="1"/>', True),
        ('<axis x="0" y="1" z="0"/>', True),
        ('<origin xyz="0 0 1" rpi="0 0 1"/>', True),
    ],
)
def test_an_attribute_that_is_not_read_is_named(tmp_path, inside, acts):
    kind = "revolute" if "limit" in inside else "continuous"
    _, report = read_model(written(tmp_path, pair(kind, inside)))
    assert report.loaded != acts
    assert "attribute" in str(report)


def test_the_world_of_drake_is_the_ground(tmp_path):
    text = pair("prismatic", '<axis xyz="1 0 0"/>').replace('<link name="b"/>', "")
    text = text.replace('link="b"', 'link="world"')
    model, report = read_model(written(tmp_path, text))
    assert [(b.name, b.parent, b.joint) for b in model.bodies] == [("c", "ground", "prismatic")]
    assert_names(str(report), "'world'", "Drake")
    with pytest.raises(pg.FileError) as refused:
        read_model(written(tmp_path, text.replace('"world"', '"hand"')))
    assert_names(str(refused.value), "'hand'", '<link name="hand"/>', "'j'", "parent")


# -- XML -------------------------------------------------------------------------------------------

COMMENTS = [
    "<!-- a -- b -->",
    "<!----- a\n -- \n---->",
    "<!-- </robot> -- <link/> -->",
    "<!--\n\n-- -->",
]


@pytest.mark.parametrize("comment", COMMENTS)
def test_dashes_in_comments_are_read_and_lines_stay(tmp_path, comment):
    text = f'{comment}<robot name="r">{comment}<link name="b">{comment}</link>{comment}'
    assert [b.name for b in pg.load(written(tmp_path, f"{text}</robot>")).bodies] == ["b"]
    with pytest.raises(pg.FileError) as refused:
        pg.load(written(tmp_path, f"{text}\n<link/></robot>"))
    line = 2 + text.count("\n")
    assert_names(str(refused.value), f"line {line}")


def test_a_comment_in_characters_is_text(tmp_path):
    text = '<robot name="r"><link name="b"/><gazebo><![CDATA[<!-- -- ]]></gazebo></robot>'
    assert len(pg.load(written(tmp_path, text)).bodies) == 1
    with pytest.raises(pg.FileError, match="not XML"):
        pg.load(written(tmp_path, '<robot name="r"><!-- a -- b <link name="b"/></robot>'))


@pytest.mark.parametrize("end", ["", "</robot>", "\n</robot>\n </mujoco>\n"])
@pytest.mark.parametrize("between", [" ", ""])
def test_touching_attributes_and_closed_roots_are_read_as_by_mujoco(tmp_path, end, between):
    solid = '<box size=".1 .2 .3"/>'
    shape = f"<collision name='a'{between}group=\"b\"><geometry>{solid}</geometry></collision>"
    text = f'<robot name="r"><link name="b">{shape}</link></robot>{end}'
    (body,) = pg.load(written(tmp_path, text)).bodies
    assert body.shape.size == (0.1, 0.2, 0.3)
    mjcf = f'<mujoco><worldbody><body><geom type="box"{between}size=".1 .2 .3"/></body></worldbody>'
    mujoco = pytest.importorskip("mujoco")
    path = written(tmp_path, f"{mjcf}</mujoco>{end}", "m.xml")
    assert mujoco.MjModel.from_xml_path(str(path)).nbody == len(pg.load(path).bodies) + 1


def test_a_bare_ampersand_is_read_as_by_mujoco(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    geom = '<geom type="sphere" size=".1"/>'
    text = f'<mujoco><worldbody><body name="a & b &amp; c">{geom}</body></worldbody></mujoco>'
    path = written(tmp_path, text, "m.xml")
    names = [body.name for body in pg.load(path).bodies]
    assert names == ["a & b & c"] == [mujoco.MjModel.from_xml_path(str(path)).body(1).name]
    with pytest.raises(pg.FileError, match=r"line 1: not XML.*column 15"):
        pg.load(written(tmp_path, '<robot name="a<b"/>'))


def test_a_mesh_that_is_missing_is_named_with_its_line(tmp_path):
    pytest.importorskip("mujoco")
    mesh = '<asset>\n<mesh name="m" file="no.stl"/></asset>'
    geom = '<worldbody><geom type="mesh" mesh="m"/></worldbody>'
    with pytest.raises(pg.FileError) as refused:
        pg.load(written(tmp_path, f"<mujoco>{mesh}{geom}</mujoco>", "m.xml"))
    assert_names(str(refused.value), "m.xml, line 2, mesh, file", "'no.stl'", str(tmp_path))


@pytest.mark.parametrize("end", ["<robot/>", "text", "</robot", "</robot>x", "<"])
def test_what_follows_the_root_is_not_lost(tmp_path, end):
    with pytest.raises(pg.FileError, match="line 1: not XML"):
        pg.load(written(tmp_path, f'<robot name="r"><link name="b"/></robot>{end}'))


# -- files that a model names ----------------------------------------------------------------------


def with_mesh(file, role="collision"):
    solid = f'<{role}><geometry><mesh filename="{file}"/></geometry></{role}>'
    return f'<robot name="r"><link name="b">{solid}</link></robot>'


# -- packages and folders --------------------------------------------------------------------------


def package(folder, name):
    written(
        folder, f'<?xml version="1.0"?><package><name> {name}\n</name></package>', "package.xml"
    )


MACRO = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:macro name="part" params="n">
  <link name="${n}"/></xacro:macro></robot>"""
USE = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:include filename="$(find %s)/urdf/part.xacro"/><xacro:part n="b"/></robot>"""


@pytest.mark.parametrize(
    ("folder", "roots"),
    [
        ("arm_ros2-main", ()),
        ("arm_ros2-main", ("arm_ros2-main",)),
        ("src/other/arm_ros2-main", (".",)),
        ("arm_description", ()),
    ],
)
def test_a_package_is_found_by_the_name_in_its_manifest(tmp_path, folder, roots):
    pytest.importorskip("xacro")
    package(tmp_path / folder, "arm_description")
    written(tmp_path / folder, MACRO, "urdf/part.xacro")
    own = not roots or roots != (".",)
    at = tmp_path / folder if own else tmp_path / "src/mine"
    path = written(at, USE % "arm_description", "urdf/arm.urdf.xacro")
    model = pg.load(path, roots=[tmp_path / root for root in roots])
    assert [b.name for b in model.bodies] == ["b"]
    written(tmp_path / folder, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "meshes/part.obj")
    robot = written(at, with_mesh("package://arm_description/meshes/part.obj"))
    assert pg.read_urdf(robot, [tmp_path / root for root in roots])[1].loaded


def test_a_package_that_is_not_there_is_named_once_with_a_remedy(tmp_path):
    pytest.importorskip("xacro")
    package(tmp_path / "robot", "robot_description")
    path = written(tmp_path / "robot", USE % "arm_description")
    path = path.rename(path.with_suffix(".xacro"))
    with pytest.raises(pg.FileError) as refused:
        pg.load(path)
    text = str(refused.value)
    assert_names(text, "'arm_description'", "package.xml", "roots=", str(tmp_path / "robot"))
    assert text.count("cannot find") == 1
    assert "class" not in text
    package(tmp_path / "elsewhere", "arm_description")
    written(tmp_path / "elsewhere", MACRO, "urdf/part.xacro")
    assert len(pg.load(path, roots=[tmp_path / "elsewhere"]).bodies) == 1


@pytest.mark.parametrize("used", ["declared", "read", "inside", "evaluated"])
def test_an_argument_that_a_file_does_not_have_is_refused(tmp_path, used):
    pytest.importorskip("xacro")
    declared = '<xacro:arg name="length" default="1"/>' if used != "read" else ""
    value = "$(eval length)" if used == "evaluated" else "$(arg length)"
    box = f'<visual><geometry><box size="{value} 1 1"/></geometry></visual>'
    head = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    if used == "inside":
        written(tmp_path, f"{head}{declared}</robot>", "own.xacro")
        declared = '<xacro:include filename="own.xacro"/>'
    path = written(tmp_path, f'{head}{declared}<link name="b">{box}</link></robot>', "r.xacro")
    model, _ = pg.read_urdf(path, arguments={"length": 2})
    assert model["b"].shapes[0].size[0] == 2.0
    with pytest.raises(pg.InputError) as refused:
        pg.read_urdf(path, arguments={"length": 2, "lenght": 3})
    assert_names(str(refused.value), "arguments", "lenght", "length")


def test_a_file_of_macros_is_said_to_be_included_by_others(tmp_path):
    pytest.importorskip("xacro")
    with pytest.raises(pg.FileError) as refused:
        pg.load(written(tmp_path, MACRO, "part.xacro"))
    assert_names(str(refused.value), "macros", "'part'", "includes")


@pytest.mark.parametrize("name", ["../meshes/part.obj", "part.obj", "/no/such/part.obj"])
@pytest.mark.parametrize("there", [True, False])
def test_a_missing_file_is_not_said_to_be_outside(tmp_path, name, there):
    here = tmp_path / "model"
    path = written(here, with_mesh(name))
    if there and not name.startswith("/"):
        written(here, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", name)
    (text,) = (e.text for e in pg.read_urdf(path)[1].of("left out")) if not (
        there and name == "part.obj"
    ) else ("",)  # fmt: skip
    if there and name.startswith(".."):
        assert_names(text, "outside", str(tmp_path / "meshes"), "roots=")
        assert pg.read_urdf(path, roots=[tmp_path / "meshes"])[1].loaded
    elif text:
        assert_names(text, "does not exist")
        assert "roots" not in text


# -- MJCF ------------------------------------------------------------------------------------------

KNUCKLE = '<mujoco><joint axis="0 1 0"/><geom size=".1" pos=".3 0 0"/></mujoco>'


def hand(*files):
    bodies = "".join(
        f'<body name="f{k}" pos="{k} 0 1"><include file="{file}"/></body>'
        for k, file in enumerate(files)
    )
    return f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"


@pytest.mark.parametrize("suffix", ["xml", "mjcf"])
@pytest.mark.parametrize("folder", ["", "parts/"])
def test_a_file_is_included_again_through_links(tmp_path, suffix, folder):
    pytest.importorskip("mujoco")
    written(tmp_path, KNUCKLE, f"{folder}knuckle.xml")
    for k in (2, 3):
        os.symlink("knuckle.xml", tmp_path / f"{folder}knuckle_{k}.xml")
    names = [f"{folder}knuckle{end}.xml" for end in ("", "_2", "_3")]
    model = pg.load(written(tmp_path, hand(*names), f"hand.{suffix}"))
    assert [b.joint for b in model.bodies] == ["revolute"] * 3
    with pytest.raises(pg.FileError) as refused:
        pg.load(written(tmp_path, hand(names[0], names[0])))
    assert_names(str(refused.value), "twice", "link", names[0])


def test_links_that_lead_out_or_round_are_refused(tmp_path):
    pytest.importorskip("mujoco")
    written(tmp_path, KNUCKLE, "knuckle.xml")
    here = tmp_path / "hand"
    path = written(here, hand("out.xml"), "hand.xml")
    os.symlink("../knuckle.xml", here / "out.xml")
    with pytest.raises(pg.FileError, match="outside"):
        pg.load(path)
    (here / "out.xml").unlink()
    os.symlink("hand.xml", here / "out.xml")
    with pytest.raises(pg.FileError, match=r"twice|more than"):
        pg.load(path)
    (here / "out.xml").unlink()
    written(here, "knuckle.xml", "out.xml")
    with pytest.raises(pg.FileError) as refused:
        pg.load(path)
    assert_names(str(refused.value), "out.xml", "'knuckle.xml'", "link")


@pytest.mark.parametrize("kind", ["filter", "filterexact", "integrator"])
@pytest.mark.parametrize("early", ["true", "false"])
def test_an_activation_of_the_next_step_is_named(tmp_path, kind, early):
    pytest.importorskip("mujoco")
    drive = f'<general joint="h" dyntype="{kind}" dynprm=".1" actearly="{early}"/>'
    text = f"""<mujoco><worldbody><body><joint name="h"/><geom size=".1"/></body></worldbody>
      <actuator>{drive}</actuator></mujoco>"""
    _, report = read_model(written(tmp_path, text, "a.xml"))
    assert report.loaded == (early == "false")
    assert ("actearly" in str(report)) == (early == "true")


# -- speeds, friction and sensors ------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "unit"), [("revolute", "rad/s"), ("prismatic", "m/s")])
@pytest.mark.parametrize("velocity", [0.5, 3.0])
@pytest.mark.parametrize("speed", [0.4, 2.0, -2.0])
def test_a_run_names_the_joint_that_exceeds_its_speed_limit(tmp_path, kind, unit, velocity, speed):
    limit = f'<axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="1" velocity="{velocity}"/>'
    model, report = read_model(written(tmp_path, pair(kind, limit)))
    assert report.loaded
    assert model.body("c").speed_limit == (velocity,)
    still = model.replace(gravity=(0, 0, 0))
    run = pg.simulate(still.edit("c", v=speed), t_end=0.1)
    (text,) = [x for x in run.notices if "speed_limit" in x] or [""]
    assert bool(text) == (abs(speed) > velocity)
    if text:
        assert_names(text, "'c'", f"2 {unit}", f"{velocity:g} {unit}", "t = 0 s")
    pg.write_urdf(model, tmp_path / "again.urdf")
    assert pg.load(tmp_path / "again.urdf").body("c").speed_limit == (velocity,)
    assert pg.Model.from_json(model.to_json()) == model


def test_the_largest_excess_of_several_joints_is_told():
    bodies = [
        pg.Body("a", v=1.0, speed_limit=0.9, inertia=(1, 1, 1)),
        pg.Body("b", v=3.0, speed_limit=1.0, inertia=(1, 1, 1)),
        pg.Body("c", v=9.0, speed_limit=0.0, inertia=(1, 1, 1)),
        pg.Body("d", joint="cylindrical", v=(1.0, 8.0), speed_limit=(5.0, 4.0), inertia=(1, 1, 1)),
    ]
    run = pg.simulate(pg.Model(bodies, gravity=(0, 0, 0)), t_end=0.1)
    (text,) = [x for x in run.notices if "speed_limit" in x]
    assert_names(text, "the joint of 'b' reaches 3 rad/s", "'a', 'b', 'd'")
    assert "'c'" not in text


GAZEBO = """<gazebo reference="b"><mu1>0.2</mu1><mu2>0.2</mu2></gazebo>
<gazebo reference="c"><mu1>{}</mu1><mu2>{}</mu2><kp>1e6</kp><kd>7</kd>{}</gazebo>"""
BULLET = '<contact><lateral_friction value="{}"/><rolling_friction value="0.01"/>{}</contact>'
SURFACE = "<collision><surface><friction><ode><mu>0.2</mu></ode></friction></surface></collision>"


@pytest.mark.parametrize(
    ("gazebo", "bullet", "friction", "said"),
    [
        (GAZEBO.format(0.2, 0.2, ""), "", 0.2, ("stiffness", "1e+06", "damping", "'c'")),
        (GAZEBO.format(0.2, 0.3, ""), "", 0.2, ("mu2", "0.3 of 'c'")),
        (GAZEBO.format(0.9, 0.9, "<plugin/>"), "", 0.2, ("0.9 of 'c'", "<plugin>", "friction=")),
        (GAZEBO.format("high", "", ""), "", 0.2, ("<mu1>",)),
        ("", BULLET.format(0.7, '<contact_cfm value="0"/>'), 0.7, ("<contact_cfm>", "0.01")),
        (f'<gazebo reference="c">{SURFACE}</gazebo>', "", 0.2, ("0.2",)),
        ("", "", 0.5, ()),
    ],
)
def test_friction_of_links_is_the_default_of_contacts(tmp_path, gazebo, bullet, friction, said):
    text = pair(more=bullet).replace("</robot>", f"{gazebo}</robot>")
    model, report = read_model(written(tmp_path, text))
    assert model.ground.friction == friction
    assert report.loaded
    assert_names(str(report), *said)
    assert model.ground.rolling_friction == (0.01 if bullet else 0.0)


@pytest.mark.parametrize("given", ["true", "1", "false", "0"])
def test_a_link_without_gravity_does_not_fall(tmp_path, given):
    text = pair("prismatic", '<axis xyz="0 0 1"/><limit lower="-9" upper="9" effort="1"/>')
    off = f'<gazebo reference="c"><turnGravityOff>{given}</turnGravityOff></gazebo>'
    model, report = read_model(written(tmp_path, text.replace("</robot>", f"{off}</robot>")))
    assert report.loaded
    fall = float(pg.simulate(model, t_end=0.5)["c"][-1])
    expected = 0.0 if given in ("true", "1") else -9.81 / 2 * 0.5**2
    assert fall == pytest.approx(expected, abs=1e-9)


TREE = """<mujoco><worldbody><body name="a" pos="0 0 1"><freejoint/><geom size=".1" mass="2"/>
<body name="b" pos=".3 0 0"><joint axis="0 1 0" pos=".1 0 0"/><joint axis="1 0 0"/>
<geom type="box" size=".1 .2 .3" mass="1"/><body name="c" pos="0 .3 .1"><joint type="ball"/>
<geom type="capsule" size=".05 .2" mass=".7"/></body></body></body>
<body name="d" pos="1 0 0"><joint/><geom size=".1" mass="3"/></body></worldbody><sensor>{}</sensor>
</mujoco>"""
SUBTREE = {"subtreecom": "com", "subtreelinvel": "speed", "subtreeangmom": "spin"}


@pytest.mark.parametrize("body", ["world", "a", "b", "c", "d"])
def test_sensors_of_subtrees_read_as_in_mujoco(tmp_path, body):
    mujoco = pytest.importorskip("mujoco")
    sensors = "".join(f'<{kind} name="{n}" body="{body}"/>' for kind, n in SUBTREE.items())
    path = written(tmp_path, TREE.format(sensors), "tree.xml")
    model, report = read_model(path)
    assert "sensor" not in " ".join(str(e) for e in report.of("left out"))
    rng = np.random.default_rng(3)
    for text in (path, tmp_path / "again.xml"):
        m = mujoco.MjModel.from_xml_path(str(text))
        mech = pg.Mechanism(model)
        data = mujoco.MjData(m)
        data.qpos[:] = m.qpos0 + rng.normal(size=m.nq)
        mujoco.mj_normalizeQuat(m, data.qpos)
        data.qvel[:] = rng.normal(size=m.nv)
        mujoco.mj_forward(m, data)
        stepper = pg.Stepper(model)
        q, v = states_of(model, mech, m, data)
        stepper.reset(q=q, v=v)
        for name in SUBTREE.values():
            np.testing.assert_allclose(
                stepper.outputs[name], data.sensor(name).data, rtol=1e-10, atol=1e-10
            )
        pg.write_mjcf(model, tmp_path / "again.xml")


FOOT = """<mujoco><option {}/><worldbody><geom type="plane" size="9 9 1"/>{}
<body name="b" pos="0 0 .099"><joint type="slide" axis="0 0 1"/><joint type="slide" axis="1 0 0"/>
<geom type="box" size=".1 .1 .1" mass="2"/><site name="s" type="box" size=".2 .2 .2"/></body>
</worldbody><sensor><touch name="t" site="s"/><jointpos name="x" joint="j"/></sensor></mujoco>"""
OTHER = """<body name="o" pos="2 0 .5"><joint name="j" axis="0 1 0"/>
<geom size=".1" mass="1" contype="0" conaffinity="0"/></body>"""


@pytest.mark.parametrize("gravity", [9.81, 1.62])
@pytest.mark.parametrize("settings", [{"step": 1e-3}, {"rtol": 1e-6}])
def test_a_touch_sensor_reads_the_force_on_its_body(tmp_path, gravity, settings):
    mujoco = pytest.importorskip("mujoco")
    text = FOOT.format(f'gravity="0 0 -{gravity}"', OTHER)
    model, report = read_model(written(tmp_path, text, "foot.xml"))
    assert_names(str(report), "friction", "within the site")
    assert report.loaded
    run = pg.simulate(model, t_end=0.2, **settings)
    for said in (run.notices, model.lost, pg.load(tmp_path / "foot.xml").notices):
        assert any("sensor 't'" in text for text in said)
    assert run.outputs["t"][-1] == pytest.approx(2 * gravity, rel=1e-6)
    np.testing.assert_allclose(run.outputs["x"], run["o"])  # its column is its own
    stepper = pg.Stepper(model)
    stepper.step(n=100)
    assert stepper.outputs["t"] == pytest.approx(2 * gravity, rel=1e-6)
    batch = pg.BatchStepper(model, 2)
    batch.step(n=100)
    np.testing.assert_allclose(batch.outputs["t"], stepper.outputs["t"], rtol=1e-12)
    pg.write_mjcf(model, tmp_path / "again.xml")
    for file in ("foot.xml", "again.xml"):
        m = mujoco.MjModel.from_xml_path(str(tmp_path / file))
        data = mujoco.MjData(m)
        for _ in range(1000):
            mujoco.mj_step(m, data)
        assert data.sensor("t").data[0] == pytest.approx(2 * gravity, rel=1e-3)


def test_a_touch_sensor_without_contacts_reads_zero_and_needs_a_body():
    ball = pg.Body(name="b", joint="free", shape=pg.Shape("sphere", radius=0.1))
    model = pg.Model(bodies=[ball], outputs=[pg.Output(name="t", kind="touch", at="b")])
    assert not pg.simulate(model, t_end=0.1).outputs["t"].any()
    assert pg.Stepper(model).outputs["t"] == 0.0
    with pytest.raises(pg.ModelError) as refused:
        model.add(pg.Output(name="u", kind="touch", at="ground"))
    assert_names(str(refused.value), "output 'u', at", "ground", "body")


def states_of(model, mech, m, data):
    """Return q and v of MuJoCo's state, of which all turns start without rotation."""
    q, v = mech.home()
    names = {"a": 0, "b/1": 1, "b": 2, "c": 3, "d": 4}
    for name, joint in mech.joints.items():
        j = names[name]
        at, dof = int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j])
        nq, nv = joint.q.stop - joint.q.start, joint.v.stop - joint.v.start
        q[joint.q], v[joint.v] = data.qpos[at : at + nq], data.qvel[dof : dof + nv]
        if nv > 1:  # the rate of rotation is in the body's axes there, and in the parent's here
            turn = matrix(q[joint.q][-4:])
            spin = turn @ data.qvel[dof + nv - 3 : dof + nv]
            v[joint.v] = spin if nv == 3 else (*spin, *data.qvel[dof : dof + 3])
    return q, v
