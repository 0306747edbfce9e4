"""URDF files of other programs: what they mean is read, what is doubtful is named or refused."""

import itertools

import pytest

import pgraph_core as pg
from pgraph_core.formats import read_model
from tests.refusals import assert_names

INERTIAL = """<inertial><origin xyz="0.1 0 0"/><mass value="1"/>
  <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>"""
LIMIT = '<limit lower="-1" upper="1" effort="5" velocity="1"/>'


def joint(name="j", parent="base", child="a", inside=LIMIT, origin="0 0 0"):
    return f"""<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
      <origin xyz="{origin}"/><axis xyz="0 1 0"/>{inside}</joint>"""


def robot(link="", joints=None, more=""):
    joints = joint() if joints is None else joints
    links = f'<link name="base"/><link name="a">{INERTIAL}{link}</link>'
    return f'<robot name="r">{links}{joints}{more}</robot>'


@pytest.fixture
def read(tmp_path):
    def reader(text, name="robot.urdf"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_model(path)

    return reader


def solid(role, geometry, material=""):
    return f"<{role}><geometry>{geometry}</geometry>{material}</{role}>"


@pytest.mark.parametrize("given", ["0,1 0", "0,1,0", "0, 1, 0", "1,5 2,5 3,5", "0,1 0 0", ",1 2 3"])
def test_a_comma_is_no_part_of_numbers(read, given):
    with pytest.raises(pg.FileError, match="xyz") as refused:
        read(robot(joints=joint(origin=given)))
    assert given in str(refused.value)
    assert "comma" in str(refused.value)


@pytest.mark.parametrize(
    "given", ["1_0 0 0", "0x1 0 0", "\u0661 0 0", "1f 0 0", "1;0;0", "1mm 0 0"]
)
def test_only_numbers_that_all_readers_know_are_read(read, given):
    with pytest.raises(pg.FileError, match="xyz"):
        read(robot(joints=joint(origin=given)))


ORANGE = '<material name="orange"><color rgba="1 .5 0 1"/></material>'
BALL = '<sphere radius=".1"/>'


@pytest.mark.parametrize("defined", ["first", "last", "robot", "itself"])
def test_a_material_is_known_to_all_links_wherever_it_is_defined(read, defined):
    own = solid("visual", BALL, ORANGE if defined == "itself" else '<material name="orange"/>')
    links = [
        f'<link name="b">{own}</link>',
        f'<link name="c">{solid("visual", BALL, ORANGE)}</link>',
    ]
    links += (["", ORANGE][defined == "robot"],)
    order = links if defined == "last" else links[::-1]
    joints = joint() + joint("k", "a", "b") + joint("l", "a", "c")
    model, report = read(robot(joints="", more=joints + "".join(order)))
    assert report.loaded
    assert model.body("b").shapes[0].colour == (1.0, 0.5, 0.0)


PLACEHOLDERS = [
    '<box size="0 0 0"/>',
    '<box size="1 0 1"/>',
    '<sphere radius="0"/>',
    '<cylinder radius="0" length="1"/>',
    '<cylinder radius="0" length="0"/>',
    '<cylinder radius="0.1" length="0"/>',
    '<capsule radius="0" length="1"/>',
]


@pytest.mark.parametrize("geometry", PLACEHOLDERS)
@pytest.mark.parametrize("role", ["visual", "collision"])
def test_a_solid_of_size_zero_is_left_out_and_named(read, geometry, role):
    model, report = read(robot(solid(role, geometry)))
    assert model.body("a").shapes == ()
    assert any("'a'" in entry.where for entry in report.of("left out"))
    assert report.loaded == (role == "visual")


@pytest.mark.parametrize("geometry", ['<box size="-1 1 1"/>', '<sphere radius="-1"/>'])
def test_a_solid_of_negative_size_is_refused_where_it_touches(read, geometry):
    with pytest.raises(pg.FileError, match="'a'"):
        read(robot(solid("collision", geometry)))
    model, report = read(robot(solid("visual", geometry)))
    assert model.body("a").shapes == ()
    assert any("'a'" in entry.where for entry in report.of("left out"))


WRONG_TO_LOOK_AT = [
    solid("visual", BALL, '<material name="m"><color rgba="1 0 0"/></material>'),
    solid("visual", BALL, '<material name="m"><color rgba="red"/></material>'),
    solid("visual", '<mesh filename="part.obj" scale="1 0 1"/>'),
    solid("visual", '<mesh filename="part.obj" scale="1 2"/>'),
    solid("visual", "<sphere/>"),
    solid("visual", '<box size="1 1"/>'),
    solid("visual", BALL + '</geometry><origin xyz="0 0"/><geometry>'),
    solid("visual", BALL, '<material name="m"><color rgb="1 0 0"/></material>'),
]


@pytest.mark.parametrize("visual", WRONG_TO_LOOK_AT)
def test_what_is_only_seen_refuses_no_robot(read, tmp_path, visual):
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    model, report = read(robot(visual))
    assert report.loaded
    assert model.body("a").mass == 1.0
    assert [*report.of("left out")]


def test_one_number_scales_a_mesh_in_all_directions(read, tmp_path):
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    model, _ = read(robot(solid("visual", '<mesh filename="part.obj" scale="0.001"/>')))
    assert model.body("a").shapes[0].scale == 0.001


@pytest.mark.parametrize(
    ("lower", "upper", "expected"),
    [
        ("-inf", "inf", ()),
        ("-INF", "1", ((None, 1.0),)),
        ("-1", "+inf", ((-1.0, None),)),
        ("0.5", "inf", ((0.5, None),)),
        ("-1", "1", ((-1.0, 1.0),)),
    ],
)
@pytest.mark.parametrize(("effort", "velocity"), [("inf", "inf"), ("5", "inf"), ("5", "2")])
def test_infinite_limits_are_no_limits(read, lower, upper, expected, effort, velocity):
    limit = f'<limit lower="{lower}" upper="{upper}" effort="{effort}" velocity="{velocity}"/>'
    model, _ = read(robot(joints=joint(inside=limit)))
    assert tuple(pair for pair in model.body("a").limits if pair) == expected
    assert model.forces[0].torque_limit == (None if effort == "inf" else 5.0)


@pytest.mark.parametrize("field", ["lower", "upper", "effort", "velocity"])
@pytest.mark.parametrize("given", ["nan", "one", ""])
def test_what_is_no_number_is_refused(read, field, given):
    values = {"lower": "-1", "upper": "1", "effort": "5", "velocity": "1", field: given}
    limit = "<limit " + " ".join(f'{key}="{value}"' for key, value in values.items()) + "/>"
    with pytest.raises(pg.FileError, match=field):
        read(robot(joints=joint(inside=limit)))


ENCODINGS = ["latin-1", "cp1252", "utf-16", "utf-8-sig", "utf-8"]


@pytest.mark.parametrize("encoding", [*ENCODINGS, "koi8-r", "gb2312"])
def test_a_declared_encoding_is_read(read, encoding):
    letter = {"koi8-r": "й", "gb2312": "中"}.get(encoding, "é")
    declared = encoding.removesuffix("-sig")
    text = f'<?xml version="1.0" encoding="{declared}"?>{robot()}'.replace('"r"', f'"{letter}"')
    assert read(text.encode(encoding))[0].name == letter


@pytest.mark.parametrize("encoding", ["utf-7", "rot13", "none", "base64", "cp037", "hz"])
def test_an_encoding_in_which_markup_is_another_is_refused(read, encoding):
    with pytest.raises(pg.FileError, match="line 1"):
        read(f'<?xml version="1.0" encoding="{encoding}"?>{robot()}')


def test_an_mjcf_file_in_letters_of_several_bytes_is_refused(read):
    pytest.importorskip("mujoco")
    with pytest.raises(pg.FileError, match="gb2312"):
        read(f'<?xml version="1.0" encoding="gb2312"?>{MJCF}')


@pytest.mark.parametrize("encoding", ["latin-1", "cp1252", "gb2312"])
def test_an_encoding_that_is_not_declared_is_named(read, encoding):
    text = robot(more="<!-- é -->" if encoding != "gb2312" else "<!-- 中 -->")
    with pytest.raises(pg.FileError, match="UTF-8"):
        read(text.encode(encoding))


MACROS = [
    '<xacro:property name="len" value="1"/>',
    '<xacro:include filename="$(find my_robot)/arm.xacro"/>',
    '<xacro:arm prefix="left_"/>',
    joint("k", "a", "b", origin="0 0 ${len/2}") + '<link name="b"/>',
    '<link name="$(arg prefix)b"/>',
]


@pytest.mark.parametrize("inside", MACROS)
def test_macros_that_are_left_are_named_with_what_to_do(read, inside):
    text = robot(more=inside).replace("<robot", '<robot xmlns:xacro="http://wiki.ros.org/xacro"')
    with pytest.raises(pg.FileError, match="xacro"):
        read(text)
    plain = robot().replace("<robot", '<robot xmlns:xacro="http://wiki.ros.org/xacro"')
    assert read(plain)[1].loaded  # the name space alone is what xacro leaves behind


STL = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
UNREAD = {  # fact of the answer -> files: (name, content)
    "SDF": [("w.sdf", b"x"), ("w.world", b"x"), ("w.xml", b"<sdf version='1.9'/>"),
            ("w.json", b"<?xml version='1.0'?><!-- <robot/> --><sdf/>")],
    "USD": [("s.usda", b"x"), ("s.usdc", b"PXR-USDC\0\xff"), ("s.json", b"#usda 1.0")],
    "CAD": [("p.step", b"x"), ("p.stp", b"ISO-10303-21;"), ("P.SLDPRT", b"\0\xff"),
            ("p.json", b"ISO-10303-21;\nHEADER;")],
    "MuJoCo": [("m.mjb", b"\0\xff")],
    "Webots": [("arm.proto", b"#VRML_SIM R2023b utf8"), ("w.wbt", b"x"),
               ("arm.txt", b"#VRML_SIM R2023b utf8")],
    "not XML": [("leg.osim", b"x")],
    "OpenSim": [("leg.xml", b"<OpenSimDocument Version='4'/>")],
    "pg.Shape(": [("a.stl", STL), ("A.STL", bytes(80) + b"\1\0\0\0" + bytes(50)), ("a.obj", b"x"),
                  ("a.json", STL), ("a.dae", b"<COLLADA/>"), ("a.xml", b"<COLLADA/>"),
                  ("a.glb", b"glTF\2"), ("a.json", b"v 0 0 0\nf 1 1 1\n"),
                  ("a.gltf", b'{ "asset": {} }')],
    "convert": [("a.fbx", b"Kaydara FBX Binary"), ("a.json", b"; FBX 7.3.0"),
                ("a.blend", b"BLENDER")],
    "pg.Result.load": [("r.npz", b"PK\3\4")],
    "unpack": [("bot.zip", b"PK\3\4"), ("bot.json", b"PK\3\4")],
    ".urdf": [("notes.txt", b"x"), ("a.png", b"\x89PNG"), ("t.csv", b"t,q"), ("a.what", b"\0\xff"),
              ("a.json", b"")],
}  # fmt: skip
GIVEN = [(fact, name, content) for fact, files in UNREAD.items() for name, content in files]


@pytest.mark.parametrize("load", [read_model, pg.load, pg.Model.load])
@pytest.mark.parametrize(("fact", "name", "content"), GIVEN)
def test_a_file_that_holds_no_model_is_named_with_what_to_do(tmp_path, load, fact, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(pg.FileError) as refused:
        load(tmp_path / name)
    assert_names(str(refused.value), name)
    other = content.startswith(b"ISO-10303-21") or name.endswith((".xml", ".osim", ".step"))
    if load != pg.Model.load or not other:  # which says that pg.load converts it
        assert_names(str(refused.value), fact)


MJCF = '<mujoco><worldbody><body><joint/><geom size="1"/></body></worldbody></mujoco>'


@pytest.mark.parametrize("name", ["m.json", "m.txt", "m.md", "m.yaml", "m.stl", "m.gltf", "m"])
def test_a_model_in_json_is_read_whatever_its_name(tmp_path, name):
    model = pg.Model.serial(2)
    (tmp_path / name).write_text(f"\n {model.to_json()}")
    assert pg.load(tmp_path / name) == pg.Model.load(tmp_path / name) == model


@pytest.mark.parametrize("before", ["", '<?xml version="1.0"?>\n', "<!-- <mujoco/> -->\n\n"])
@pytest.mark.parametrize("suffix", ["urdf", "xml", "mjcf", "json", "robot", "txt"])
def test_the_first_element_decides_between_urdf_and_mjcf(read, before, suffix):
    assert read(before + robot(), f"model.{suffix}")[0].body("a").mass == 1.0
    pytest.importorskip("mujoco")
    assert len(read(before.replace("mujoco", "robot") + MJCF, f"other.{suffix}")[0].bodies) == 1


@pytest.mark.parametrize(
    "given",
    ['friction="0.2" damping="0.6"', 'friction="0.2"', 'friction="0" damping="6"', 'stiction="1"',
     'friction="0.0" damping="0"', ""],
)  # fmt: skip
def test_friction_in_an_element_of_an_exporter_is_something_that_acts(read, given):
    _, report = read(robot(joints=joint(inside=f"{LIMIT}<joint_properties {given}/>")))
    assert report.loaded != any(x in given for x in "126")
    assert "joint_properties" in str(report)


@pytest.mark.parametrize(("ratio", "offset"), [*itertools.product((1.0, -2.0, 0.5), (0.0, 0.1))])
def test_a_follower_starts_where_its_leader_puts_it(read, ratio, offset):
    """The leader's limits leave 0 out, so that it starts at the nearer one."""
    lead = joint(inside='<limit lower="0.3" upper="1" effort="1" velocity="1"/>')
    follow = f'<mimic joint="j" multiplier="{ratio}" offset="{offset}"/>'
    again = '<mimic joint="k" multiplier="2"/>'
    joints = lead + joint("k", "base", "b", follow) + joint("l", "base", "c", again)
    links = "".join(f'<link name="{name}">{INERTIAL}</link>' for name in "bc")
    model, _ = read(robot(joints=joints, more=links))
    expected = ratio * 0.3 + offset
    assert model.body("a").q == (0.3,)
    assert model.body("b").q == pytest.approx((expected,), abs=1e-15)
    assert model.body("c").q == pytest.approx((2 * expected,), abs=1e-15)


@pytest.mark.parametrize("offset", [0.2, 0.7])
def test_a_start_that_is_said_is_that_of_the_model(read, offset):
    follow = '<limit lower="0.5" upper="1" effort="2" velocity="1"/>'
    follow += f'<mimic joint="j" offset="{offset}"/>'
    joints = joint().replace("revolute", "continuous") + joint("k", "base", "b", follow)
    model, report = read(robot(joints=joints, more=f'<link name="b">{INERTIAL}</link>'))
    (said,) = [e for e in report.of("warning") if "limits" in e.text]
    assert model["b"].q == (offset,)
    assert f"{offset:g}" in said.text
    assert "outside the limits [0.5, 1.0]" in said.text
    assert ("mimic" in said.text) == (offset < 0.5)
    assert any("effort" in e.text for e in report.of("converted"))  # the follower has no motor
    assert any("continuous" in e.text for e in report.of("converted"))


@pytest.mark.parametrize(
    "scheme", ["package://bot", "package:///bot", "model://bot", "..", "../../bot", "{}"]
)
@pytest.mark.parametrize("role", ["visual", "collision"])
def test_a_mesh_of_a_package_without_a_manifest_is_found_or_said_to_lie_outside(
    tmp_path, scheme, role
):
    for name in ("urdf", "meshes"):
        (tmp_path / "bot" / name).mkdir(parents=True)
    (tmp_path / "bot/meshes/part.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    file = f"{scheme.format(tmp_path / 'bot')}/meshes/part.obj"
    text = robot(solid(role, f'<mesh filename="{file}"/>'))
    path = tmp_path / "bot/urdf/bot.urdf"
    path.write_text(text)
    (entry,) = (e for e in pg.read_urdf(path)[1].of("left out") if "mesh" in e.text)
    assert_names(entry.text, "outside", "roots=", "--root")
    model, report = pg.read_urdf(path, roots=[tmp_path / "bot"])
    assert report.loaded
    assert model.body("a").shapes[0].file == str(tmp_path / "bot/meshes/part.obj")


@pytest.mark.parametrize(
    ("link", "said"),
    [
        (solid("visual", '<box size="1 1 1"/><sphere radius="2"/>'), ("solid", "<sphere>")),
        (solid("collision", '<sphere radius="1"/><sphere radius="2"/>'), ("solid", "<sphere>")),
        ("<visual><geometry><box size='1 1 1'/></geometry><geometry/></visual>", ("<geometry>",)),
        ("<visual><origin/><origin xyz='0 0 2'/><geometry><box size='1 1 1'/></geometry></visual>",
         ("<origin>", "<visual>")),
        (INERTIAL, ("<inertial>", "<link>")),
    ],
)  # fmt: skip
def test_what_an_element_has_once_and_is_given_twice_is_reported(read, link: str, said):
    model, report = read(robot(link))
    assert report.loaded == link.startswith("<visual")
    assert_names(str(report), "second", "robot.urdf, line", *said)
    assert any("second" in text for text in model.lost) == (not report.loaded)


def test_a_joint_has_one_axis(read):
    twice = robot(joints=joint(inside=LIMIT + '<axis xyz="1 0 0"/>'))
    assert_names(str(read(twice)[1]), "second <axis> in <joint>")


@pytest.mark.parametrize("suffix", ["srdf", "xml", "urdf"])
@pytest.mark.parametrize("inside", [
    '<group name="arm"><chain base_link="a" tip_link="b"/></group>',
    '<disable_collisions link1="a" link2="b" reason="Adjacent"/>',
    '<virtual_joint name="v" type="fixed" parent_frame="world" child_link="a"/>',
])  # fmt: skip
def test_a_file_of_moveit_is_named_as_such(tmp_path, suffix, inside):
    path = tmp_path / f"arm.{suffix}"
    path.write_text(f'<?xml version="1.0"?><robot name="arm">{inside}</robot>')
    with pytest.raises(pg.FileError) as refused:
        pg.load(path)
    assert_names(str(refused.value), path.name, "SRDF", "give the URDF")


def test_an_empty_file_of_moveit_is_known_by_its_suffix(tmp_path):
    path = tmp_path / "arm.srdf"
    path.write_text('<robot name="arm"/>')
    with pytest.raises(pg.FileError) as refused:
        pg.load(path)
    assert_names(str(refused.value), path.name, "SRDF", "give the URDF")
