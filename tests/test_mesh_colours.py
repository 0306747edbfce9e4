"""Colours and sizes of mesh files that a URDF file names."""

import json
import struct

import numpy as np
import pytest
import trimesh

import pgraph_core as pg

FACES = "f 1 3 2\nf 1 2 4\n", "f 1 4 3\nf 2 3 4\n"
VERTICES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
RED, GREEN = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
INERTIAL = '<inertial><mass value="1"/><inertia ixx=".01" iyy=".01" izz=".01"/></inertial>'


def robot(name, scale="", material="", role="visual", link=0.2):
    """Return a URDF file of a base and an arm, whose mesh is `name`."""
    mesh = f'<geometry><mesh filename="{name}" {scale}/></geometry>'
    return f"""<robot name="r"><link name="base"/><link name="arm">{INERTIAL}
      <{role}>{mesh}{material}</{role}></link><link name="tip">{INERTIAL}</link>
      <joint name="j" type="continuous"><parent link="base"/><child link="arm"/></joint>
      <joint name="k" type="continuous"><parent link="arm"/><child link="tip"/>
        <origin xyz="{link} 0 0"/></joint></robot>"""


def read(folder, text):
    (folder / "bot.urdf").write_text(text)
    model, report = pg.read_urdf(folder / "bot.urdf")
    (shape,) = model.body("arm").shapes
    return shape, report


def obj(folder, mtl, first="a", second=None, named="m.mtl"):
    (folder / "m.mtl").write_text(mtl)
    second = "" if second is None else f"usemtl {second}\n"
    text = f"mtllib {named}\n{VERTICES}usemtl {first}\n{FACES[0]}{second}{FACES[1]}f 1 2 3\n"
    (folder / "part.obj").write_text(text)


MTL = "newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 1 0\nd 0.5\n"


@pytest.mark.parametrize(
    ("mtl", "parts", "colour", "opacity", "lost"),
    [
        (MTL, ("a",), RED, 1.0, ""),
        (MTL, ("b",), GREEN, 0.5, ""),
        (MTL.replace("d 0.5", "Tr 0.25"), ("b",), GREEN, 0.75, ""),
        (MTL, ("a", "b"), GREEN, 0.5, "colours"),
        (MTL, ("none",), None, 1.0, "undefined"),
        (MTL, ("a", "none"), RED, 1.0, "undefined"),
        ("", ("a",), None, 1.0, "undefined"),
        ("newmtl a\nNs 5\n", ("a",), None, 1.0, ""),
        (MTL + "map_Kd a.png\n", ("b",), None, 1.0, "texture"),
        ("newmtl a\nKd one two\n", ("a",), None, 1.0, "undefined"),
        ("newmtl a\nKd 2 -1 nan\n", ("a",), (1.0, 0.0, 1.0), 1.0, "2, -1, nan"),
    ],
)
def test_an_obj_file_has_the_colours_of_its_materials(tmp_path, mtl, parts, colour, opacity, lost):
    obj(tmp_path, mtl, *parts)
    shape, report = read(tmp_path, robot("part.obj"))
    assert (shape.colour, shape.opacity) == (colour, opacity)
    told = " ".join(map(str, report.of("approximated")))
    assert (lost in told) if lost else "part.obj" not in told


@pytest.mark.parametrize("named", ["../m.mtl", "{}/m.mtl", "link.mtl", "none.mtl", "."])
def test_no_file_of_materials_is_read_but_one_beside_the_mesh(tmp_path, named):
    folder = tmp_path / "model"
    folder.mkdir()
    (tmp_path / "m.mtl").write_text(MTL)
    (folder / "link.mtl").symlink_to(tmp_path / "m.mtl")
    obj(folder, "", named=named.format(tmp_path))
    assert read(folder, robot("part.obj"))[0].colour is None


DAE = """<COLLADA><library_effects><effect id="e"><profile_COMMON><technique sid="c">
<{kind}><diffuse>{paint}</diffuse></{kind}></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="12">
0 0 0 1 0 0 0 1 0 0 0 1</float_array></source><vertices id="v"><input semantic="POSITION"
source="#p"/></vertices><triangles count="4" material="mm"><input semantic="VERTEX" source="#v"
offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"><bind_material>
<technique_common><instance_material symbol="{symbol}" target="#m"/></technique_common>
</bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


@pytest.mark.parametrize("kind", ["lambert", "phong", "blinn"])
@pytest.mark.parametrize(
    ("paint", "symbol", "colour"),
    [
        ("<color>0 1 0 1</color>", "mm", GREEN),
        ('<color sid="diffuse">0 1 0</color>', "mm", GREEN),
        ("<color>0 1 0 1</color>", "other", None),
        ('<texture texture="t"/>', "mm", None),
    ],
)
def test_a_collada_file_has_the_diffuse_colour(tmp_path, kind, paint, symbol, colour):
    (tmp_path / "part.dae").write_text(DAE.format(kind=kind, paint=paint, symbol=symbol))
    shape, report = read(tmp_path, robot("part.dae"))
    assert shape.colour == colour
    assert ("texture" in str(report)) == ("texture" in paint)
    assert ("undefined" in str(report)) == (symbol == "other")


@pytest.mark.parametrize("suffix", ["ply", "glb", "stl"])
def test_colours_of_other_formats(tmp_path, suffix):
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    if suffix == "glb":
        paint = trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, 128])
        box.visual = trimesh.visual.TextureVisuals(material=paint)
    else:
        box.visual.face_colors = [255, 0, 0, 128]
    box.export(tmp_path / f"part.{suffix}")
    shape, _ = read(tmp_path, robot(f"part.{suffix}"))
    if suffix == "stl":
        assert (shape.colour, shape.opacity) == (None, 1.0)
    else:
        assert shape.colour == pytest.approx(RED)
        assert shape.opacity == pytest.approx(128 / 255)


@pytest.mark.parametrize("damage", [{"materials": []}, {"materials": [{}]}, {"materials": 3}])
def test_damaged_materials_are_no_colours(tmp_path, damage):
    trimesh.creation.box((1, 1, 1)).export(tmp_path / "part.glb")
    content = (tmp_path / "part.glb").read_bytes()
    length = struct.unpack("<I", content[12:16])[0]
    data = json.loads(content[20 : 20 + length]) | damage
    data["meshes"][0]["primitives"][0]["material"] = 0
    text = json.dumps(data).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(content) - 20 - length,
                       len(text), 0x4E4F534A)  # fmt: skip
    (tmp_path / "part.glb").write_bytes(head + text + content[20 + length :])
    shape, report = read(tmp_path, robot("part.glb"))
    assert shape.colour is None or damage == {"materials": [{}]}
    assert ("part.glb" in str(report)) == (damage != {"materials": [{}]})


PAINTED = '<material name="blue"><color rgba="0 0 1 1"/></material>'


@pytest.mark.parametrize(
    ("material", "more", "fact", "colour"),
    [
        ('<material name="blue"/>', "", "'blue'", None),
        ('<material name="blue"/>', PAINTED, "", (0.0, 0.0, 1.0)),
        ('<material name="Blue"/>', PAINTED, "'Blue'", None),
        ('<material name=""/>', "", "", None),
        ('<material name="t"><texture filename="a.png"/></material>', "", "texture", None),
        ('<material name="t"/>', '<material name="t"><texture filename="a"/></material>',
         "texture", None),
        ('<material name="m"><color rgba="2 0 0 1"/></material>', "", "2, 0, 0, 1", RED),
        ('<material name="m"><color rgba="1 -0.5 0 1"/></material>', "", "-0.5", RED),
        ('<material name="m"><color rgba="255 0 0 255"/></material>', "", "255", RED),
        ('<material name="m"/>', '<material name="m"><color rgba="1 0 0 7"/></material>', "7", RED),
        ('<material name="m"><color rgba="1 0 0"/></material>', "", "rgba", None),
    ],
)  # fmt: skip
def test_a_colour_that_a_urdf_file_loses_is_reported_once(tmp_path, material, more, fact, colour):
    text = robot("", material=material).replace('<mesh filename="" />', '<sphere radius="1"/>')
    shape, report = read(
        tmp_path, text.replace('<link name="base"/>', more + '<link name="base"/>')
    )
    assert shape.colour == colour
    told = [str(e) for kind in ("left out", "approximated") for e in report.of(kind)]
    assert [fact in text for text in told] == [True] * bool(fact)
    assert report.loaded


@pytest.mark.parametrize("rgba", ["1 0 0 1", "2 0 0 1", "0 -1 0 1", "0 0 0 1.5", "255 255 255 1"])
@pytest.mark.parametrize("by", ["geom", "material"])
def test_colours_of_mjcf_beyond_0_to_1_are_counted(tmp_path, rgba, by):
    pytest.importorskip("mujoco")
    paint = f'rgba="{rgba}"' if by == "geom" else 'material="m"'
    path = tmp_path / "bot.xml"
    path.write_text(
        f'<mujoco><asset><material name="m" rgba="{rgba}"/></asset><worldbody><body><joint/>'
        f'<geom size="1" {paint}/><geom size="1" {paint}/></body></worldbody></mujoco>'
    )
    model, report = pg.read_mjcf(path)
    beyond = any(not 0 <= float(x) <= 1 for x in rgba.split())
    assert [e.text[0] for e in report.of("approximated") if "colours" in e.text] == ["2"] * beyond
    numbers = [min(max(float(x), 0.0), 1.0) for x in rgba.split()]
    assert [*model.bodies[0].shapes[0].colour, model.bodies[0].shapes[0].opacity] == numbers


@pytest.mark.parametrize("role", ["visual", "collision"])
def test_a_material_of_the_robot_goes_before_those_of_the_mesh(tmp_path, role):
    obj(tmp_path, MTL, "a", "b")
    material = '<material name="x"><color rgba="0 0 1 0.25"/></material>'
    shape, report = read(tmp_path, robot("part.obj", material=material, role=role))
    assert (shape.colour, shape.opacity) == (
        ((0.0, 0.0, 1.0), 0.25) if role == "visual" else (None, 1.0)
    )
    assert "part.obj" not in " ".join(map(str, report.of("approximated")))


@pytest.mark.parametrize("link", [1e-3, 0.2, 50.0])
@pytest.mark.parametrize("length", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("role", ["visual", "collision"])
@pytest.mark.parametrize("unit", ["m", "mm", "scaled"])
def test_a_mesh_in_millimetres_is_told_by_the_size_of_the_robot(tmp_path, link, length, role, unit):
    """The verdict depends on ratios alone: robot and mesh may be of any size."""
    size = length * link * (1.0 if unit == "m" else 1000.0)
    trimesh.creation.box((size, size / 3, size / 3)).export(tmp_path / "part.stl")
    scale = 'scale="0.001 0.001 0.001"' if unit == "scaled" else ""
    text = robot("part.stl", scale, role=role, link=link)
    inertia = 0.01 * link**2
    shape, report = read(tmp_path, text.replace('".01"', f'"{inertia!r}"'))
    told = [e.part for e in report.of("warning") if "part.stl" in e.text]
    assert told == (["arm"] if unit == "mm" else [])
    assert np.all(np.isfinite(shape.position))


@pytest.mark.parametrize(("length", "told"), [(3e-4, False), (0.3, False), (300.0, True)])
def test_a_mesh_in_millimetres_is_told_in_mjcf_by_the_largest_size_of_the_robot(
    tmp_path, length, told
):
    """Its joints are 0.5 m apart; the ball at its end says nothing about its size."""
    pytest.importorskip("mujoco")
    trimesh.creation.box((length / 3, length, length / 3)).export(tmp_path / "part.stl")
    (tmp_path / "bot.xml").write_text("""<mujoco><asset><mesh file="part.stl"/></asset><worldbody>
<body><joint/><geom size=".1" mass="1"/><geom type="mesh" mesh="part" mass="0"/>
<body pos=".5 0 0"><joint/><geom size=".0001" mass="1"/></body></body></worldbody></mujoco>""")
    _, report = pg.read_mjcf(tmp_path / "bot.xml")
    assert any("millimetres" in entry.text for entry in report.of("warning")) == told
