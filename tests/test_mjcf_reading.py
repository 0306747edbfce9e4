"""MJCF files are read as MuJoCo reads them, and omissions are reported."""

import itertools

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.formats.mjcf_compiled import ACTUATORS, KNOWN, newer
from pgraph_core.mesh_files import load_mesh
from pgraph_core.rotation import matrix

mujoco = pytest.importorskip("mujoco")


def read(tmp_path, text, name="model.xml"):
    path = tmp_path / name
    path.write_text(text)
    return pg.read_mjcf(path)


def world(inside, *, option="", rest=""):
    return f"<mujoco><option {option}/><worldbody>{inside}</worldbody>{rest}</mujoco>"


def left_out(report):
    return " ".join(str(entry) for entry in report.of("left out") if entry.acts)


ARM = '<geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass="1"/>'
BOX = '<geom type="box" size=".1 .1 .1" mass="1"/>'
POSES = [  # of the first body, of the second in it, and an anchor in the second
    ((0.0, 0.0, 0.0), (1, 0, 0, 0), (0.0, 0.0, 0.0)),
    ((0.3, 0.0, 0.1), (1, 0, 0, 0), (0.1, 0.2, 0.3)),
    ((0.3, -0.2, 0.1), (1, 1, 0, 0), (0.1, 0.0, -0.3)),
    ((1.0, 2.0, 3.0), (1, 2, 3, 4), (-0.5, 0.2, 0.7)),
    ((0.0, 0.0, 1e-3), (0, 0, 1, 0), (1e-3, 0.0, 2e-3)),
]


def numbers(values):
    return " ".join(repr(float(x)) for x in values)


@pytest.mark.parametrize("kind", ["weld", "connect"])
@pytest.mark.parametrize(("place", "turn", "anchor"), POSES)
def test_an_equality_that_is_met_at_first_moves_nothing(tmp_path, kind, place, turn, anchor):
    """The anchor is a point of both bodies, so the points of the constraint coincide at first."""
    bodies = f"""<body name="a" pos="0.1 0 0"><joint axis="0 1 0"/>{ARM}</body>
      <body name="b" pos="{numbers(place)}" quat="{numbers(turn)}"><freejoint/>{BOX}</body>"""
    tied = f"<equality><{kind} body1='a' body2='b' anchor='{numbers(anchor)}'/></equality>"
    model, report = read(tmp_path, world(bodies, option='gravity="0 0 0"', rest=tied))
    assert report.loaded
    mech = pg.Mechanism(model)
    q, _ = mech.home()
    assert np.abs(mech.assemble(q)[0] - q).max() < 1e-12


@pytest.mark.parametrize("lift", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("gravity", ["0 0 -9.81", "3 0 -9.81", "0 0 0"])
@pytest.mark.parametrize("flag", ["enable", "disable"])
def test_compensation_of_gravity_acts_with_gravity_only(tmp_path, lift, gravity, flag):
    body = f'<body name="a" gravcomp="{lift}"><joint type="slide" axis="0 0 1"/>{BOX}</body>'
    option = f'gravity="{gravity}"><flag gravity="{flag}" contact="disable"/></option><option '
    text = world(body, option=option)
    model, _ = read(tmp_path, text)
    m = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    run = pg.simulate(model, t_end=0.1, step=0.01)
    assert run.q[-1, 0] == pytest.approx(data.qacc[0] * 0.1**2 / 2, abs=1e-12)


CUBE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.mark.parametrize(
    ("compiler", "expected"),
    [
        ('meshdir="meshes"', "meshes/part.obj"),
        ('assetdir="meshes"', "meshes/part.obj"),
        ('meshdir="deep/er"', "deep/er/part.obj"),
        ("", "part.obj"),
        ('meshdir="."', "part.obj"),
    ],
)
def test_a_mesh_is_the_file_that_mujoco_takes(tmp_path, compiler, expected):
    for folder in (".", "meshes", "deep/er"):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        (tmp_path / folder / "part.obj").write_text(CUBE)
    body = '<body name="a"><joint axis="0 1 0"/><geom type="mesh" mesh="part" mass="1"/></body>'
    text = world(body, rest='<asset><mesh name="part" file="part.obj"/></asset>')
    model, _ = read(tmp_path, text.replace("<option", f"<compiler {compiler}/><option"))
    (shape,) = model.bodies[0].shapes
    assert shape.file == str((tmp_path / expected).resolve())


@pytest.mark.parametrize("prefix", ["left_", "right/", "x"])
def test_meshes_of_an_attached_model_are_found(tmp_path, prefix):
    (tmp_path / "part.obj").write_text(CUBE)
    (tmp_path / "part.xml").write_text(
        '<mujoco><asset><mesh name="p" file="part.obj"/></asset><worldbody><body name="tip">'
        '<joint axis="0 1 0"/><geom type="mesh" mesh="p" mass="1"/></body></worldbody></mujoco>'
    )
    base = f'<body name="base"><joint axis="0 1 0"/>{ARM}<frame pos=".3 0 0">'
    base += f'<attach model="m" body="tip" prefix="{prefix}"/></frame></body>'
    model, report = read(
        tmp_path, world(base, rest='<asset><model name="m" file="part.xml"/></asset>')
    )
    assert report.loaded
    assert model.body(f"{prefix}tip").shapes[0].file == str((tmp_path / "part.obj").resolve())


@pytest.mark.parametrize("name", ["../private/x.obj", "..\\private\\x.obj", "{}/private/x.obj"])
@pytest.mark.parametrize("way", ["mesh", "meshdir", "attached"])
def test_no_file_outside_of_the_folder_is_read(tmp_path, name, way):
    for folder in ("model", "private"):
        (tmp_path / folder).mkdir()
    (tmp_path / "private" / "x.obj").write_text(CUBE)
    name = name.format(tmp_path)
    folder, _, file = name.rpartition("\\" if "\\" in name else "/")
    compiler = f'<compiler meshdir="{folder}"/>' if way == "meshdir" else ""
    mesh = f'<asset><mesh name="p" file="{file if compiler else name}"/></asset>'
    inside = '<body name="tip"><joint axis="0 1 0"/><geom type="mesh" mesh="p" mass="1"/></body>'
    text = f"<mujoco>{compiler}{mesh}<worldbody>{inside}</worldbody></mujoco>"
    if way == "attached":
        (tmp_path / "model" / "part.xml").write_text(text)
        attach = '<frame><attach model="m" body="tip" prefix="x"/></frame>'
        text = f"""<mujoco><asset><model name="m" file="part.xml"/></asset>
          <worldbody>{attach}</worldbody></mujoco>"""
    with pytest.raises(pg.FileError, match="outside"):
        read(tmp_path / "model", text)


ODD = [  # an actuator that has no place here
    '<pid name="odd" joint="h" kp="50" kv="5" input="pos vel"/>',
    '<orientation name="odd" joint="ball" kp="10" kv="1"/>',
    '<dcmotor name="odd" joint="h" motorconst=".05" resistance="2" input="none"/>',
    '<dcmotor name="odd" joint="h" motorconst=".05" resistance="2"/>',
    '<muscle name="odd" joint="h" lengthrange="0 1"/>',
]
PLAIN = '<motor name="plain" joint="h" gear="3" ctrllimited="true" ctrlrange="-2 2"/>'


@pytest.mark.parametrize("odd", ODD)
@pytest.mark.parametrize("first", [True, False])
def test_actuators_are_counted_as_actuators_not_as_inputs(tmp_path, odd, first):
    body = f"""<body name="eye"><joint name="ball" type="ball"/>{BOX}
      <body name="lid" pos=".1 0 0"><joint name="h" axis="0 1 0"/>{ARM}</body></body>"""
    two = f"{odd}{PLAIN}" if first else f"{PLAIN}{odd}"
    text = world(body, rest=f"<actuator>{two}</actuator>")
    model, report = read(tmp_path, text)
    (motor,) = model.forces
    assert (motor.name, motor.gear, motor.input_high) == ("plain", 3.0, 2.0)
    assert "odd" in left_out(report)
    assert not report.loaded


@pytest.mark.parametrize(
    "friction", ["1.5 1.5 .1 .01 .01", "0 0 0 0 0", ".3 .3 0 0 0", ".3 .1 0 0 0", "9 9 1 1 1"]
)
def test_an_override_of_friction_holds_for_all(tmp_path, friction):
    bodies = f'<geom type="plane" size="9 9 .1" friction=".05"/><body><freejoint/>{BOX}</body>'
    option = f'o_friction="{friction}"><flag override="enable"/></option><option '
    model, _ = read(tmp_path, world(bodies, option=option))
    assert [c.friction for c in model.contacts] == [float(friction.split()[0])]


@pytest.mark.parametrize("where", ["pair", "option"])
@pytest.mark.parametrize(("friction", "same"), [(".3 .3 0 .1 .1", True), (".3 .1 0 0 0", False)])
def test_friction_that_depends_on_the_direction_is_named(tmp_path, where, friction, same):
    bodies = f'<geom name="f" type="plane" size="9 9 .1"/><body><freejoint/>{BOX}</body>'
    bodies = bodies.replace("<geom type", '<geom name="g" type')
    if where == "pair":
        pair = f'<contact><pair geom1="f" geom2="g" friction="{friction}"/></contact>'
        text = world(bodies, rest=pair)
    else:
        option = f'o_friction="{friction}"><flag override="enable"/></option><option '
        text = world(bodies, option=option)
    _, report = read(tmp_path, text)
    assert ("direction" in left_out(report)) != same


@pytest.mark.parametrize("margin", [0.0, 0.05])
@pytest.mark.parametrize("own", [0.0, 0.03])
def test_an_override_of_margins_is_that_of_all(tmp_path, margin, own):
    bodies = f'<geom type="plane" size="9 9 .1" margin="{own}"/><body><freejoint/>{BOX}</body>'
    option = f'o_margin="{margin}"><flag override="enable"/></option><option '
    _, report = read(tmp_path, world(bodies, option=option))
    assert any("margin" in e.text for e in report.of("approximated")) == bool(margin)


@pytest.mark.parametrize("flags", ["", 'spring="disable"', 'spring="disable" damper="disable"'])
@pytest.mark.parametrize("lift", [-1.0, 1.0])
def test_gravity_is_compensated_where_mujoco_does(tmp_path, flags, lift):
    """Passive forces need springs or dampers, and negative numbers count beside positive ones."""
    body = f'<body name="a" gravcomp="{lift}"><joint type="slide" axis="0 0 1"/>{BOX}</body>'
    text = world(body, option=f'density="9"><flag contact="disable" {flags}/></option><option ')
    model, _ = read(tmp_path, text)
    m = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    assert bool(model.forces) == bool(np.any(data.qfrc_gravcomp) or "damper" not in flags)
    run = pg.simulate(model, t_end=1e-3, step=1e-4)
    assert run.v[-1, 0] == pytest.approx(data.qacc[0] * 1e-3, rel=1e-3, abs=1e-9)


@pytest.mark.parametrize("ref", ['refpos="0 0 .05"', 'refquat="0 1 0 0"', 'refquat="1 1 0 0"'])
def test_a_mesh_whose_file_has_another_frame_is_where_mujoco_has_it(tmp_path, monkeypatch, ref):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))
    (tmp_path / "part.obj").write_text(CUBE)
    asset = f'<asset><mesh name="m" file="part.obj" {ref}/></asset>'
    text = world('<body name="b"><freejoint/><geom type="mesh" mesh="m" mass="1"/></body>')
    text = text.replace("<worldbody>", asset + "<worldbody>")
    model, _ = read(tmp_path, text)
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data = mujoco.MjData(m)
    mujoco.mj_kinematics(m, data)
    theirs = m.mesh_vert @ data.geom_xmat[0].reshape(3, 3).T + data.geom_xpos[0]
    (shape,) = model.body("b").shapes
    ours = load_mesh(shape.file).vertices @ matrix(shape.rotation).T + shape.position
    assert np.sort(ours, 0) == pytest.approx(np.sort(theirs, 0), abs=1e-6)


def test_a_plane_of_a_mocap_body_carries(tmp_path):
    floor = '<body name="floor" mocap="true"><geom type="plane" size="5 5 .1"/></body>'
    ball = '<body name="ball" pos="0 0 .2"><freejoint/><geom size=".1" mass="1"/></body>'
    model, report = read(tmp_path, world(floor + ball))
    assert report.loaded
    assert [c.other for c in model.contacts] == ["ground"]


@pytest.mark.parametrize("where", ["geom", "default", "class"])
@pytest.mark.parametrize("kind", ["box", "plane"])
@pytest.mark.parametrize("does", ['adhesion="50"', 'surfacevel=".5 0 0 0 0 0"'])
def test_what_a_surface_does_is_read_or_named(tmp_path, does, kind, where):
    """A belt moves as in MuJoCo. The ground does not move, and nothing sticks."""
    attribute = does
    own = {"geom": attribute, "default": "", "class": 'class="c"'}[where]
    default = {
        "geom": "",
        "default": f"<default><geom {attribute}/></default>",
        "class": f'<default><default class="c"><geom {attribute}/></default></default>',
    }[where]
    belt = f'<geom name="belt" type="{kind}" size="2 .5 .1" pos="0 0 -.1" {own}/>'
    loose = BOX.replace("<geom", '<geom adhesion="0" surfacevel="0 0 0 0 0 0"', 1)
    text = world(f"{belt}<body><freejoint/>{loose}</body>").replace("<option", f"{default}<option")
    model, report = read(tmp_path, text)
    moved = [
        shape.surface_velocity for body in model.bodies for shape in body.shapes if shape.moves
    ]
    if kind == "box" and "surfacevel" in does:
        assert report.loaded
        assert moved == [(0.5, 0.0, 0.0)]
        return
    assert not moved
    assert not report.loaded
    assert does.partition("=")[0] in left_out(report)
    assert "belt" in left_out(report)


@pytest.mark.parametrize("kind", ["box", "mesh"])
@pytest.mark.parametrize("turn", ["1 0 0 0", "0.8 0 0 0.6", "0.9 0.1 -0.2 0.3"])
def test_a_moving_surface_survives_export_and_import(tmp_path, kind, turn):
    """The velocity of its surface at any point of the world is that of MuJoCo's own field."""
    asset = (
        '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 2 0 0 0 1 1 2 .5"/></asset>'
        if kind == "mesh"
        else ""
    )
    own = 'mesh="m"' if kind == "mesh" else 'size="1 2 .3"'
    geom = f'<geom type="{kind}" {own} pos="1 2 3" quat="{turn}" surfacevel="1 2 3 4 5 6"/>'
    text = world(f'<body name="b" pos="0 1 0">{geom}</body>')
    text = text.replace("<worldbody>", asset + "<worldbody>")
    model, report = read(tmp_path, text)
    assert report.loaded
    points = np.random.default_rng(3).normal(size=(5, 3))

    def field(text):
        m = mujoco.MjModel.from_xml_string(text)
        d = mujoco.MjData(m)
        mujoco.mj_kinematics(m, d)
        (g,) = np.flatnonzero(m.geom_surfacevel.any(axis=1))
        axes = d.geom_xmat[g].reshape(3, 3)
        u, w = axes @ m.geom_surfacevel[g, :3], axes @ m.geom_surfacevel[g, 3:]
        return u + np.cross(w, points - d.geom_xpos[g])

    (shape,) = [s for s in model.body("b").shapes if s.moves]
    axes = matrix(shape.rotation)
    at = np.array((0, 1, 0)) + shape.position
    here = axes @ shape.surface_velocity
    here = here + np.cross(axes @ shape.surface_spin, points - at)
    assert here == pytest.approx(field(text), abs=1e-6)
    if kind == "box":
        path = tmp_path / "again.xml"
        pg.write_mjcf(model, path)
        assert field(path.read_text()) == pytest.approx(here, abs=1e-9)


@pytest.mark.parametrize("pos", ["0 0 0", "0 0 -.5", "1 2 .3"])
@pytest.mark.parametrize("turn", ["1 0 0 0", "0.9 0.1 0 0"])
def test_a_plane_of_a_body_that_stands_still_carries(tmp_path, pos, turn):
    """A box that is dropped on it stays above its surface, as on a plane of the world."""
    floor = (
        f'<body name="floor" pos="{pos}" quat="{turn}"><geom type="plane" size="5 5 .1"/></body>'
    )
    ball = '<body name="ball" pos="0 0 2"><freejoint/><geom size=".1" mass="1"/></body>'
    for bodies in (floor + ball, ball + floor):
        model, report = read(tmp_path, world(bodies))
        assert report.loaded
        gap = pg.simulate(model, t_end=1.0, step=2e-3).contact_gap
        assert min(np.nanmin(each) for each in gap.values()) > -1e-6


NAMESAKES = {
    "tendon": '<tendon><fixed name="{}" stiffness="3"><joint joint="h" coef="1"/></fixed></tendon>',
    "actuator": '<actuator><motor name="{}" joint="h"/></actuator>',
    "equality": '<equality><joint name="{}" joint1="h" active="false"/></equality>',
    "sensor": '<sensor><jointpos name="{}" joint="h"/></sensor>',
    "pair": '<contact><pair name="{}" geom1="g" geom2="floor"/></contact>',
    "key": '<keyframe><key name="{}" qpos=".1"/></keyframe>',
}


@pytest.mark.parametrize("name", ["x", "h", "g", "knee/1", "body"])
@pytest.mark.parametrize(("one", "two"), [*itertools.combinations(NAMESAKES, 2)])
def test_parts_of_two_kinds_may_have_one_name(tmp_path, one, two, name):
    arm = ARM.replace("<geom", '<geom name="g"')
    body = f'<body name="x"><joint name="h" axis="0 1 0" damping=".1"/>{arm}</body>'
    floor = '<geom name="floor" type="plane" size="1 1 .1"/>'
    rest = "".join(NAMESAKES[kind].format(name) for kind in (one, two))
    model, report = read(tmp_path, world(floor + body, rest=rest))
    assert report.loaded
    parts = len(model.forces) + len(model.constraints) + len(model.outputs) + len(model.scenarios)
    assert parts == 2 - ("pair" in (one, two))


@pytest.mark.parametrize("suffix", ["xml", "mjcf", "urdf"])
def test_meshes_and_includes_are_found_whatever_the_suffix(tmp_path, suffix):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "part.obj").write_text(CUBE)
    inside = '<geom type="mesh" mesh="part" mass="1"/>'
    (tmp_path / "inside.xml").write_text(f"<mujoco>{inside}</mujoco>")
    body = '<body name="a"><joint axis="0 1 0"/><include file="inside.xml"/></body>'
    text = world(body, rest='<asset><mesh name="part" file="part.obj"/></asset>')
    text = text.replace("<option", '<compiler meshdir="meshes"/><option')
    model, report = read(tmp_path, text, f"model.{suffix}")
    assert report.loaded
    assert model.bodies[0].shapes[0].file == str((tmp_path / "meshes" / "part.obj").resolve())


@pytest.mark.parametrize("kind", ["hinge", "slide"])
@pytest.mark.parametrize("axes", [("0 1 0", "0 1 0"), ("0 1 0", "0 -2 0"), ("1 2 3", "1 2 3")])
def test_two_joints_along_one_axis_move_as_in_mujoco(tmp_path, kind, axes):
    """A motor and its backlash: armature makes the mass matrix regular."""
    first, second = axes
    body = f"""<body name="a"><joint name="motor" type="{kind}" axis="{first}" armature=".05"/>
      <joint name="play" type="{kind}" axis="{second}" armature=".001"/>{ARM}</body>"""
    text = world(body)
    model, report = read(tmp_path, text)
    m = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    mech = pg.Mechanism(model)
    assert report.loaded
    np.testing.assert_allclose(mech.forward_dynamics(*mech.home()), data.qacc, rtol=1e-9)


@pytest.mark.parametrize("child", ["arm/1", "arm/2", "arm/1'", "arm2"])
def test_names_that_are_made_here_avoid_those_of_the_file(tmp_path, child):
    body = f"""<body name="arm"><joint axis="0 1 0"/><joint axis="1 0 0" pos=".1 0 0"/>{ARM}
      <body name="{child}" pos=".3 0 0"><joint axis="0 1 0"/>{ARM}</body></body>"""
    model, _ = read(tmp_path, world(body))
    assert len({b.name for b in model.bodies}) == 3
    assert {"arm", child} < {b.name for b in model.bodies}


@pytest.mark.parametrize("alpha", [0.0, 0.25, 1.0])
@pytest.mark.parametrize("touches", [0, 1])
def test_what_is_transparent_in_the_file_is_transparent(tmp_path, alpha, touches):
    zone = f'<geom size=".5" rgba="1 0 0 {alpha}" contype="{touches}" conaffinity="{touches}"/>'
    model, report = read(tmp_path, world(f"<body><joint/>{BOX}{zone}</body>"))
    (sphere,) = [s for s in model.bodies[0].shapes if s.kind == "sphere"]
    assert sphere.role == ("both" if touches else "visual")
    assert (sphere.opacity, sphere.colour) == (alpha, (1.0, 0.0, 0.0))
    assert report.loaded
    pg.write_mjcf(model, tmp_path / "again.xml")
    again = pg.read_mjcf(tmp_path / "again.xml")[0].bodies[0].shapes
    assert [s.opacity for s in again] == [s.opacity for s in model.bodies[0].shapes]


TETRAHEDRON = 'vertex="0 0 0  .2 0 0  0 .2 0  0 0 .2"'
INLINE = [
    TETRAHEDRON,
    TETRAHEDRON + ' face="0 2 1  0 1 3  0 3 2  1 2 3" inertia="exact"',
    TETRAHEDRON + ' scale="1 2 -.5"',
    TETRAHEDRON + ' refpos=".1 .2 .3" refquat="1 1 0 0"',
    'builtin="sphere" params="2" scale=".1 .1 .1"',
    'file="m.msh"',  # MuJoCo's own format: how many vertices, normals, places, faces, then these
    'file="m.msh" scale=".5 2 -1"',
]
CORNERS = np.array([0, 0, 0, 0.2, 0, 0, 0, 0.2, 0, 0, 0, 0.2], "<f4").tobytes()
SIDES = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], "<i4").tobytes()
MSH = np.array([4, 0, 0, 4], "<i4").tobytes() + CORNERS + SIDES


@pytest.mark.parametrize("mesh", INLINE)
@pytest.mark.parametrize("turn", ["1 0 0 0", ".5 .5 -.5 .1"])
def test_a_mesh_that_is_kept_is_where_mujoco_has_it(tmp_path, monkeypatch, mesh, turn):
    (tmp_path / "m.msh").write_bytes(MSH)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    geom = f'<geom type="mesh" mesh="m" mass="1" pos=".1 0 .2" quat="{turn}"/>'
    body = f'<body name="a" pos="1 2 3"><joint pos="0 .5 0" axis="0 1 0"/>{geom}</body>'
    text = world(body, rest=f'<asset><mesh name="m" {mesh}/></asset>')
    model, report = read(tmp_path, text)
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data = mujoco.MjData(m)
    mujoco.mj_kinematics(m, data)
    there = m.mesh_vert @ data.geom_xmat[0].reshape(3, 3).T + data.geom_xpos[0]
    (shape,) = model.bodies[0].shapes
    place, axes = pg.Mechanism(model).poses(pg.Mechanism(model).home()[0])
    here = np.asarray(load_mesh(shape.file, shape.scale).vertices) @ matrix(shape.rotation).T
    here = (here + shape.position) @ axes[0].T + place[0]
    gaps = np.linalg.norm(here[:, None] - there[None], axis=2)
    assert gaps.min(axis=0).max() < 1e-6
    assert gaps.min(axis=1).max() < 1e-6
    assert report.loaded
    (tmp_path / "saved").mkdir()
    model.save(tmp_path / "saved" / "m.json")
    saved = pg.Model.load(tmp_path / "saved" / "m.json").bodies[0].shapes[0]
    np.testing.assert_array_equal(load_mesh(saved.file).vertices, load_mesh(shape.file).vertices)


def test_a_mesh_that_cannot_be_kept_is_named(tmp_path, monkeypatch):
    (tmp_path / "data").write_text("a file where a folder should be")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    body = '<body name="a"><joint/><geom type="mesh" mesh="m" mass="1"/></body>'
    text = world(body, rest=f'<asset><mesh name="m" {TETRAHEDRON}/></asset>')
    _, report = read(tmp_path, text)
    assert not report.loaded
    assert "'m'" in left_out(report)


@pytest.mark.parametrize(
    ("texture", "mean"),
    [
        ('builtin="flat" rgb1="1 0 0"', (1.0, 0.0, 0.0)),
        ('builtin="checker" rgb1="1 1 1" rgb2="0 0 0"', (0.5, 0.5, 0.5)),
        ('builtin="flat" rgb1=".2 .4 .6"', (0.2, 0.4, 0.6)),
    ],
)
@pytest.mark.parametrize("tint", [(1.0, 1.0, 1.0, 1.0), (0.5, 1.0, 0.25, 0.5)])
def test_what_has_a_texture_is_drawn_in_its_mean_colour(tmp_path, texture, mean, tint):
    asset = f'<asset><texture name="t" type="2d" {texture} width="8" height="8"/>'
    asset += f'<material name="m" texture="t" rgba="{numbers(tint)}"/></asset>'
    body = '<body name="a"><joint/><geom size=".1" material="m"/><geom size=".2"/></body>'
    model, report = read(tmp_path, world(body, rest=asset))
    textured, plain = model.bodies[0].shapes
    assert textured.colour == pytest.approx(np.multiply(mean, tint[:3]), abs=1 / 255)
    assert textured.opacity == tint[3]
    assert plain.colour is None
    assert "texture" in str([*report.of("approximated")])


@pytest.mark.parametrize(
    "turn", ["1 0 0 1", "0 1 0 0", "1 1 0 0", "1 .001 0 0", "1 2 3 4", "1 0 0 0", "2 0 0 0"]
)
@pytest.mark.parametrize("active", ["true", "false"])
def test_a_weld_at_another_orientation_is_not_loaded(tmp_path, turn, active):
    bodies = f'<body name="a"><joint axis="0 1 0"/>{ARM}</body>'
    bodies += f'<body name="b" pos=".5 0 0"><freejoint/>{BOX}</body>'
    tied = f'<weld name="w" body1="a" body2="b" relpose=".5 0 0 {turn}" active="{active}"/>'
    _, report = read(tmp_path, world(bodies, rest=f"<equality>{tied}</equality>"))
    same = turn.endswith("0 0 0") or active == "false"
    assert report.loaded == same
    assert ("weld 'w'" in left_out(report)) != same


@pytest.mark.parametrize("count", [1, 40, 400])
def test_pairs_of_equal_geoms_are_one_contact(tmp_path, count):
    """The number of contacts does not grow with the number of geoms that are alike."""
    boxes = "".join(f'<geom type="box" size=".1 .1 .1" pos="{k} 0 0"/>' for k in range(count))
    model, report = read(tmp_path, world(f"{boxes}<body pos='0 0 9'><freejoint/>{BOX}</body>"))
    assert len(model.contacts) == 1
    assert "do not touch" not in str(report)


@pytest.mark.parametrize("rule", ["<exclude body1='a' body2='b'/>", ""])
@pytest.mark.parametrize("own", ["", 'contype="2" conaffinity="2"', 'contype="0" conaffinity="0"'])
@pytest.mark.parametrize("listed", ["", "<pair geom1='ga' geom2='gb' friction='.7 .7 0 0 0'/>"])
def test_who_touches_whom_is_mujocos_rule(tmp_path, rule, own, listed):
    ball = '<freejoint/><geom size=".1" mass="1" friction=".4" name='
    bodies = f"""<body name="a">{ball}"ga"/></body>
      <body name="b" pos=".15 0 0">{ball}"gb" {own}/></body>"""
    text = world(bodies, rest=f"<contact>{rule}{listed}</contact>")
    model, _ = read(tmp_path, text)
    m = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    found = [c.friction for c in model.contacts]
    assert found == [pytest.approx(x.friction[0]) for x in data.contact[: data.ncon]]


@pytest.mark.nightly
def test_all_attributes_of_mujoco_are_known_to_the_reader():
    """A new version's attributes fail here, until the reader takes them or names them."""
    tag, unknown = "", set()
    for line in mujoco.mj_printSchema(False, False).splitlines():
        head = line[:30].split()
        tag = head[0].replace("(world)", "") if head else tag
        unknown |= {(tag, name) for name in newer(tag, line[30:].split())}
    assert unknown == set()
    assert set(ACTUATORS) <= KNOWN.keys()


def test_an_attribute_of_a_later_version_is_reported(tmp_path, monkeypatch):
    known = {**KNOWN, "joint": KNOWN["joint"] - {"frictionloss"}}
    monkeypatch.setattr("pgraph_core.formats.mjcf_compiled.KNOWN", known)
    _, report = read(tmp_path, world(f'<body><joint frictionloss="1"/>{ARM}</body>'))
    assert "frictionloss" in left_out(report)


def test_a_run_names_what_its_file_has_and_the_model_lacks(tmp_path):
    body = f'<body name="a"><joint name="h" axis="0 1 0"/>{ARM}</body>'
    text = world(body, rest='<actuator><muscle name="odd" joint="h" lengthrange="0 1"/></actuator>')
    model, _ = read(tmp_path, text)
    assert ["odd" in line for line in model.lost] == [True]
    for changed in (model, model.edit("a", mass=2.0), model.replace(gravity=(0, 0, 0))):
        assert any("odd" in line for line in pg.simulate(changed, t_end=0.1).notices)
    again = pg.load(tmp_path / "model.xml")
    assert again.lost == model.lost


@pytest.mark.parametrize(("scale", "kind"), [("0", "point"), ("1", "weld"), ("0.5", "weld")])
def test_a_weld_without_torques_holds_a_point(scale, kind, tmp_path):
    """In MuJoCo the error of its orientation is multiplied by the scale."""
    pytest.importorskip("mujoco")
    (tmp_path / "a.xml").write_text(
        '<mujoco><worldbody><body name="b" pos="0 0 1"><freejoint/><geom size="0.1"/></body>'
        f'</worldbody><equality><weld body1="b" torquescale="{scale}"/></equality></mujoco>'
    )
    assert [c.kind for c in pg.load(tmp_path / "a.xml").constraints] == [kind]


@pytest.mark.parametrize("stiffness", [0.3, 40.0])
@pytest.mark.parametrize(
    ("joint", "speed"),
    [('<joint type="ball" pos=".1 0 -.2" stiffness="{}" damping=".05"/>', (1, -3, 2)),
     ('<joint type="free" stiffness="{}" damping=".05"/>', (0.3, -0.2, 0.5, 1, -3, 2))],
)  # fmt: skip
def test_springs_of_ball_and_free_joints_pull_as_in_mujoco(tmp_path, joint, speed, stiffness):
    """The body starts at rest of its spring, turned and off the origin, with a velocity."""
    box = '<geom type="box" size=".1 .2 .3" pos=".05 0 .1" mass="2" contype="0" conaffinity="0"/>'
    inside = f'<body name="b" pos=".3 .2 1" quat=".9 .1 .3 -.2">{joint}{box}</body>'
    go = f'<keyframe><key name="go" qvel="{" ".join(map(str, speed))}"/></keyframe>'
    option = 'gravity="0 0 -2" integrator="RK4" timestep="1e-3"'
    text = world(inside, option=option, rest=go).format(stiffness)
    theirs = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(theirs)
    mujoco.mj_resetDataKeyframe(theirs, data, 0)
    mujoco.mj_step(theirs, data, 500)
    mujoco.mj_forward(theirs, data)
    model, report = read(tmp_path, text)
    assert not left_out(report)
    run = pg.simulate(model, scenario="go", t_end=0.5, rtol=1e-9)
    corner = data.xipos[1] + data.ximat[1].reshape(3, 3) @ (0.1, 0.2, 0.3)
    ours = run.position("b", np.add(model.body("b").com, (0.1, 0.2, 0.3)))[-1]
    np.testing.assert_allclose(ours, corner, atol=1e-6)


@pytest.mark.parametrize(
    ("inside", "remedy"),
    [
        ('<joint reach="3"/>' + BOX, "remove the attribute 'reach' of element 'joint'"),
        ("<gizmo/>" + BOX, "remove the element 'gizmo'"),
    ],
)
def test_a_file_of_another_version_is_refused_with_what_to_remove(tmp_path, inside, remedy):
    """Its version of MuJoCo reads it without what the error tells to remove."""
    text = world(f"<body>{inside}</body>")
    with pytest.raises(pg.FileError, match=remedy):
        read(tmp_path, text)
    assert read(tmp_path, text.replace(' reach="3"', "").replace("<gizmo/>", ""))[0].bodies
