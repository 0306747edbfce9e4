"""Habits of files of other programs: each is read as its program reads it, or named."""

import base64
import itertools
import json
import os

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core.formats import read_model
from pgraph_core.mesh_files import load_mesh
from pgraph_core.rotation import matrix
from tests.nights import combined
from tests.pairs import touching
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

POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"
STL = bytes(80) + (7).to_bytes(4, "little") + bytes(50 * 7)


def with_mesh(file, role="collision"):
    solid = f'<{role}><geometry><mesh filename="{file}"/></geometry></{role}>'
    return f'<robot name="r"><link name="b">{solid}</link></robot>'


@pytest.mark.parametrize("name", ["part.stl", "part.obj", "part.dae", "part.glb", "part.gltf"])
@pytest.mark.parametrize("role", ["visual", "collision"])
def test_a_mesh_that_stands_for_one_in_git_lfs_is_said_to_be_that(tmp_path, name, role):
    written(tmp_path, POINTER, name)
    _, report = read_model(written(tmp_path, with_mesh(name, role)))
    assert report.loaded == (role == "visual")
    assert_names(str(report), "Git LFS", "git lfs pull", name)


@pytest.mark.parametrize("name", ["robot.urdf", "robot.xml", "robot.json"])
def test_a_model_in_git_lfs_is_said_to_be_that(tmp_path, name):
    with pytest.raises(pg.FileError) as refused:
        pg.load(written(tmp_path, POINTER, name))
    assert_names(str(refused.value), "git lfs pull", name)


@pytest.mark.parametrize("kept", [0, 1, 6])
def test_an_stl_file_that_is_cut_off_says_how_much_there_is(tmp_path, kept):
    written(tmp_path, STL[: 84 + 50 * kept + 3], "part.stl")
    _, report = read_model(written(tmp_path, with_mesh("part.stl")))
    assert_names(str(report), "7 triangles", f"holds {kept}")


CORNERS = np.array([0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3], "<f4").tobytes()
FACES = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], "<u2").tobytes()


def gltf(folder, buffers):
    """Write a tetrahedron with its corners in one buffer and its faces in another one."""
    blobs, uris = (CORNERS, FACES), []
    for k, place in enumerate(buffers):
        if place == "inside":
            uris.append(
                "data:application/octet-stream;base64," + base64.b64encode(blobs[k]).decode()
            )
        else:
            uris.append(place.replace(" ", "%20"))
            written(folder, blobs[k], place)
    sizes = [len(blob) for blob in blobs]
    views = [{"buffer": k, "byteLength": n} for k, n in enumerate(sizes)]
    number = {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}
    place = {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
             "min": [0, 0, 0], "max": [1, 2, 3]}  # fmt: skip
    part = {"attributes": {"POSITION": 0}, "indices": 1, "material": 0}
    data = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [5, 0, 0]}], "meshes": [{"primitives": [part]}],
        "accessors": [place, number], "bufferViews": views, "images": [{"uri": "not-there.png"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}],
        "buffers": [{"byteLength": n, "uri": uri} for n, uri in zip(sizes, uris)],
    }  # fmt: skip
    return written(folder, json.dumps(data), "part.gltf")


@pytest.mark.parametrize(
    "buffers", [*itertools.product(("inside", "a.bin", "bins/b c.bin"), ("inside", "d.bin"))]
)
def test_a_gltf_mesh_is_read_with_its_buffers(tmp_path, buffers):
    path = gltf(tmp_path, buffers)
    mesh = load_mesh(path)
    assert mesh.volume == pytest.approx(1.0)
    np.testing.assert_allclose(mesh.bounds, [[5, 0, 0], [6, 2, 3]])
    model, report = read_model(written(tmp_path, with_mesh("part.gltf", "visual")))
    assert report.loaded
    assert model.body("b").shapes[0].colour == pytest.approx((1.0, 0.0, 0.0))
    (tmp_path / "saved").mkdir()
    model.save(tmp_path / "saved" / "m.json")
    again = pg.load(tmp_path / "saved" / "m.json").body("b").shapes[0]
    assert load_mesh(again.file).volume == pytest.approx(1.0)


@pytest.mark.parametrize("uri", ["../secret.bin", "/etc/hostname", "gone.bin", ""])
def test_a_gltf_mesh_opens_buffers_of_its_folder_only(tmp_path, uri):
    written(tmp_path, CORNERS + FACES, "secret.bin")
    path = gltf(tmp_path / "robot", ("inside", "inside"))
    data = json.loads(path.read_text())
    data["buffers"][0]["uri"] = uri
    path.write_text(json.dumps(data))
    with pytest.raises(pg.FileError) as refused:
        load_mesh(path)
    assert_names(str(refused.value), "buffer", repr(uri))


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


# -- contacts --------------------------------------------------------------------------------------

STATIC = {
    "plane": '<geom type="plane" size="1 1 .1"/>',
    "table": '<geom type="box" size="1 1 .1"/>',
    "shelf": '<body name="s" pos="0 0 .5"><geom type="box" size="1 1 .1"/></body>',
    "wall": '<geom type="plane" size="1 1 .1" euler="0 30 0"/>',
}


@pytest.mark.parametrize(
    ("static", "count", "own", "child"),
    combined(
        STATIC, [1, 2], ["", 'friction=".3"'],
        ["", '<geom size=".2"/>', '<joint/><geom size=".2" pos="0 0 .3"/>'],
    ),
)  # fmt: skip
def test_mocap_bodies_touch_what_moves_only(tmp_path, static, count, own, child):
    mujoco = pytest.importorskip("mujoco")
    child = f'<body name="k">{child}</body>' if child else ""
    inside = [f'<geom size=".1" {own}/>{child}', f'<geom size=".1" {own}/>']
    mocap = "".join(
        f'<body name="m{k}" pos="{3 * k} 0 1" mocap="true">{inside[k]}</body>' for k in range(count)
    )
    ball = '<body name="a" pos="0 0 1.19"><freejoint/><geom size=".1" friction=".4"/></body>'
    path = written(
        tmp_path, f"<mujoco><worldbody>{STATIC[static]}{mocap}{ball}</worldbody></mujoco>", "m.xml"
    )
    model = pg.load(path)
    run = pg.simulate(model, t_end=0.01)
    assert run.success
    m = mujoco.MjModel.from_xml_path(str(path))
    assert touching(model) == mujocos(mujoco, m)


def mujocos(mujoco, m):
    """Return the pairs of bodies that MuJoCo lets touch, of which one moves."""
    still = [0 if m.body_mocapid[w] >= 0 else int(w) for w in m.body_weldid]
    above = [int(m.body_weldid[p]) for p in m.body_parentid]
    out = {frozenset((int(s) >> 16, int(s) & 0xFFFF)) for s in m.exclude_signature}
    found = set()
    for g, h in itertools.combinations(range(m.ngeom), 2):
        a, b = int(m.geom_bodyid[g]), int(m.geom_bodyid[h])
        p, q = int(m.body_weldid[a]), int(m.body_weldid[b])
        related = (p and p == above[q]) or (q and q == above[p])
        able = (
            m.geom_contype[g] & m.geom_conaffinity[h] or m.geom_contype[h] & m.geom_conaffinity[g]
        )
        if still[a] != still[b] and able and not related and frozenset((a, b)) not in out:
            flat = [m.geom_type[x] == 0 and not m.geom_quat[x][1:].any() for x in (g, h)]
            ends = [m.body(x).name if x else "world" for x in (a, b)]
            found.add(frozenset("ground" if f else end for f, end in zip(flat, ends)))
    return found


def legs(n, rules, friction=".7"):
    own = [f'friction="{friction}"', *[""] * (n - 1)]
    bodies = "".join(
        f"""<body name="a{i}" pos="{i} 0 1"><freejoint/><geom size=".1"/>
        <body name="b{i}" pos=".2 0 0"><joint axis="0 1 0"/><geom size=".1"/>
        <body name="c{i}" pos=".2 0 0"><joint axis="0 1 0"/><geom size=".1" {own[i]}/></body>
        </body></body>"""
        for i in range(n)
    )
    return f"""<mujoco><worldbody><geom type="plane" size="9 9 1"/>{bodies}</worldbody>
      <contact>{rules}</contact></mujoco>"""


@pytest.mark.parametrize(
    ("rule", "n", "friction"),
    combined(["none", "one", "each", "across", "world"], [2, 5, 12], ["1", "1.5"]),
)
def test_contacts_are_as_many_as_the_exceptions_to_one_law(tmp_path, n, friction, rule):
    """The law of '*' holds for all pairs but those that a file excludes or gives other friction."""
    mujoco = pytest.importorskip("mujoco")
    out = {
        "none": [], "one": [("a0", "c0")], "each": [(f"a{i}", f"c{i}") for i in range(n)],
        "across": [("a0", "b1"), ("c1", "c0")], "world": [("world", "a1")],
    }[rule]  # fmt: skip
    rules = "".join(f'<exclude body1="{a}" body2="{b}"/>' for a, b in out)
    path = written(tmp_path, legs(n, rules, friction), "m.xml")
    model = pg.load(path)
    assert touching(model) == mujocos(mujoco, mujoco.MjModel.from_xml_path(str(path)))
    odd = 0 if friction == "1" else 3 * n  # the pairs of one body, and the floor
    assert len(model.contacts) <= 2 + len(out) + odd
    frictions = {c.friction for c in model.contacts if c.active}
    assert frictions == {1.0, float(friction)}
    pg.write_mjcf(model, tmp_path / "again.xml")
    assert touching(pg.load(tmp_path / "again.xml")) == touching(model)


@pytest.mark.parametrize("count", [3, 25])
@pytest.mark.parametrize("first", ["named", "every"])
@pytest.mark.parametrize("active", [True, False])
def test_a_contact_of_two_bodies_takes_the_place_of_that_of_all(count, first, active):
    ball = {"kind": "sphere", "radius": 0.1}
    bodies = [
        pg.Body(f"b{k}", joint="free", q=(0.5 * k, 0, 0, 1, 0, 0, 0), shape=ball)
        for k in range(count)
    ]
    own = pg.Contact("own", body="b1", other="b0", friction=0.1, active=active)
    every = pg.Contact("every", body="*", other="*", friction=0.5)
    contacts = [own, every] if first == "named" else [every, own]
    start = {"b0": (1.0, 0, 0), "b2": (-1.0, 0, 0)}
    bodies = [b.model_copy(update={"v": (0, 0, 0, *start.get(b.name, (0, 0, 0)))}) for b in bodies]
    model = pg.Model(bodies, contacts=contacts, gravity=(0, 0, 0))
    assert (frozenset(("b0", "b1")) in touching(model)) == active
    assert frozenset(("b1", "b2")) in touching(model)
    run = pg.simulate(model, t_end=0.5, step=1e-2)
    assert (run["b0"][-1, 0] > 0.4) != active  # it passes through b1, or stops there
    assert not any("both push" in text for text in model.doubts)


WAYS = [("translate", axis) for axis in np.eye(3).tolist()]
JOINTS = {
    "free": {"joint": "free"},
    "six": {"joint": "compound", "motions": [*WAYS, ("ball", (0, 0, 1))]},
    "five": {"joint": "compound", "motions": [*WAYS[:2], ("ball", (0, 0, 1))]},
    "ball": {"joint": "spherical"},
    "weld": {"joint": "weld"},
}


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("carrier", ["weld", "prismatic"])
@pytest.mark.parametrize("others", [0, 25])
def test_all_bodies_touch_but_those_that_a_joint_restrains(tmp_path, joint, carrier, others):
    """A joint with six degrees of freedom restrains nothing."""
    box, ball = {"kind": "box", "size": (1, 1, 1)}, {"kind": "sphere", "radius": 0.1}
    bodies = [
        pg.Body("table", joint=carrier, shape=box, density=100.0),
        pg.Body("b", "table", link=(0, 0, 0.8), shape=ball, density=100.0, **JOINTS[joint]),
    ]
    bodies += [
        pg.Body(f"o{k}", joint="free", q=(2 + k, 0, 0, 1, 0, 0, 0), shape=ball, density=100.0)
        for k in range(others)
    ]
    model = pg.Model(bodies, contacts=[pg.Contact("all", body="*", other="*")])
    meet = joint in ("free", "six")
    assert (frozenset(("table", "b")) in touching(model)) == meet
    if meet and not others and carrier == "weld":
        run = pg.simulate(model, t_end=0.4, step=1e-3, estimate=False)
        assert run.position("b")[-1][2] == pytest.approx(0.6, abs=1e-6)
    if joint != "free":  # which MuJoCo has on the ground only
        pytest.importorskip("mujoco")
        pg.write_mjcf(model, tmp_path / "out.xml")
        assert touching(pg.load(tmp_path / "out.xml")) == touching(model)


@pytest.mark.parametrize("slides", [2, 3])
@pytest.mark.parametrize("carrier", ["", "<freejoint/>"])
def test_neighbours_with_every_freedom_touch_as_in_mujoco(tmp_path, slides, carrier):
    mujoco = pytest.importorskip("mujoco")
    ways = "".join(f'<joint type="slide" axis="{x}"/>' for x in ("1 0 0", "0 1 0", "0 0 1"))
    ways = ways[: slides * len(ways) // 3] + '<joint type="ball"/>'
    child = f'<body name="b" pos="0 0 1">{ways}<geom size=".1"/></body>'
    text = f'<body name="a">{carrier}<geom size=".2"/>{child}</body>'
    path = written(tmp_path, f"<mujoco><worldbody>{text}</worldbody></mujoco>", "m.xml")
    found = touching(pg.load(path))
    assert found == mujocos(mujoco, mujoco.MjModel.from_xml_path(str(path)))


def test_bodies_that_are_fixed_to_the_ground_do_not_touch_it():
    box = {"kind": "box", "size": (1, 1, 1)}
    bodies = [pg.Body("table", joint="weld", shape=box), pg.Body("b", joint="free", shape=box)]
    model = pg.Model(bodies, contacts=[pg.Contact("floor", body="*")])
    assert touching(model) == {frozenset(("b", "ground"))}


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


@pytest.mark.parametrize("joint", ["", '<joint axis="1 0 0"/>'])
def test_bodies_that_are_fixed_to_a_child_do_not_touch_its_parent(tmp_path, joint):
    """MuJoCo leaves out a body and all that is fixed to its child."""
    mujoco = pytest.importorskip("mujoco")
    ball = '<geom size=".1" mass="1"/>'
    text = f"""<mujoco><worldbody><body name="a"><freejoint/>{ball}<body name="b" pos=".1 0 0">
      <joint axis="0 1 0"/>{ball}<body name="c" pos=".1 0 0">{joint}{ball}</body></body></body>
      <body name="d" pos="0 0 1"><freejoint/>{ball}</body></worldbody></mujoco>"""
    path = written(tmp_path, text, "m.xml")
    model = pg.load(path)
    assert touching(model) == mujocos(mujoco, mujoco.MjModel.from_xml_path(str(path)))
    assert (frozenset("ac") in touching(model)) == bool(joint)
