"""xacro files are expanded with their arguments, and only for a user who names them."""

import sys

import numpy as np
import pytest
import trimesh

import pgraph_core as pg
from pgraph_app.cli.main import main
from pgraph_app.core.cells import Refusal
from pgraph_app.model.archive import read_text
from pgraph_core.errors import MissingPackage
from pgraph_core.formats import read_model

from .refusals import assert_names

NAMED = '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">'
MACRO = """<xacro:macro name="part" params="name parent length mass:=1">
  <link name="${name}"><inertial><mass value="${mass}"/>
    <inertia ixx="${mass*length**2/12}" iyy="1" izz="1"/></inertial></link>
  <joint name="to_${name}" type="revolute"><parent link="${parent}"/><child link="${name}"/>
    <origin xyz="0 0 ${length/2 + 0.05}"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="2" velocity="3"/></joint></xacro:macro>"""
BODY = """<xacro:arg name="length" default="0.4"/><xacro:arg name="two" default="true"/>
<link name="base"/><xacro:property name="long" value="$(arg length)"/>
<xacro:part name="a" parent="base" length="${long}"/>
<xacro:if value="$(arg two)">
  <xacro:part name="b" parent="a" length="${2*long}" mass="3"/></xacro:if>"""


@pytest.fixture
def package(tmp_path):
    """Return a function that writes files of a package `my_arm`, and the file of the robot."""
    pytest.importorskip("xacro")

    def write(include="", inside=MACRO, body=BODY):
        folder = tmp_path / "my_arm"
        (folder / "urdf").mkdir(parents=True, exist_ok=True)
        (folder / "urdf" / "part.xacro").write_text(f"{NAMED}{inside}</robot>")
        path = folder / "urdf" / "arm.urdf.xacro"
        first = f'<xacro:include filename="{include}"/>' if include else inside
        path.write_text(f"{NAMED}{first}{body}</robot>")
        return path

    return write


INCLUDES = ["", "part.xacro", "$(find my_arm)/urdf/part.xacro"]


@pytest.mark.parametrize("include", INCLUDES)
@pytest.mark.parametrize("load", [read_model, pg.read_urdf])
def test_macros_properties_and_includes_are_expanded(package, include, load):
    model, report = load(package(include))
    assert report.loaded
    assert [(b.name, b.mass) for b in model.bodies] == [("base", 0.0), ("a", 1.0), ("b", 3.0)]
    assert model.body("a").link == pytest.approx((0.0, 0.0, 0.25))
    assert model.body("b").link == pytest.approx((0.0, 0.0, 0.45))
    assert model.body("a").inertia[0][0] == pytest.approx(0.4**2 / 12)


@pytest.mark.parametrize(
    ("arguments", "link", "count"),
    [
        ({"length": "0.8"}, 0.45, 3),
        ({"length": 0.8}, 0.45, 3),
        ({"two": False}, 0.25, 2),
        ({"two": np.bool_(False), "length": np.int64(2)}, 0.25 + 0.8, 2),
        ({"two": "false", "length": 2}, 1.05, 2),
        ({}, 0.25, 3),
    ],
)
def test_arguments_are_those_given(package, arguments, link, count):
    model = pg.load(package(), arguments=arguments)
    assert len(model.bodies) == count
    assert model.body("a").link[2] == pytest.approx(link)


def test_the_terminal_takes_arguments(package, capsys):
    path = package("$(find my_arm)/urdf/part.xacro")
    assert main(["info", str(path), "--argument", "two=false", "--argument", "length=1"]) == 0
    assert "2 bodies" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["info", str(path), "--argument", "two"])


def test_a_package_elsewhere_is_found_in_a_root(package, tmp_path):
    path = package("$(find other)/part.xacro")
    with pytest.raises(pg.FileError, match="other"):
        read_model(path)
    (tmp_path / "elsewhere" / "other").mkdir(parents=True)
    (path.parent / "part.xacro").rename(tmp_path / "elsewhere" / "other" / "part.xacro")
    for root in (tmp_path / "elsewhere", tmp_path / "elsewhere" / "other"):
        assert len(read_model(path, [root])[0].bodies) == 3


def holding(path, solid):
    """Write a solid into the first link of a file."""
    link = f'<link name="base">{solid}</link>'
    path.write_text(path.read_text().replace('<link name="base"/>', link))


SOLID = """<collision><geometry><mesh filename="{}"/></geometry></collision>"""
WAYS_OUT = ["linked/box.stl", "package://my_arm/urdf/linked/box.stl", "{beside}/box.stl"]


@pytest.mark.parametrize("mesh", WAYS_OUT)
@pytest.mark.parametrize("include", ["linked/part.xacro", "{beside}/part.xacro"])
def test_what_a_xacro_file_includes_and_its_meshes_may_be_anywhere(
    package, tmp_path, mesh, include
):
    """Its code could read them. A URDF file with the same mesh has no code and may not."""
    (beside := tmp_path / "beside").mkdir()
    path = package(include.format(beside=beside))
    (path.parent.parent / "package.xml").write_text("<package><name>my_arm</name></package>")
    (path.parent / "part.xacro").rename(beside / "part.xacro")
    (path.parent / "linked").symlink_to(beside)
    trimesh.creation.box((1, 1, 1)).export(beside / "box.stl")
    solid = SOLID.format(mesh.format(beside=beside))
    holding(path, solid)
    model, report = read_model(path)
    assert report.loaded
    assert model.body("base").shape.file == str(beside / "box.stl")
    plain = path.with_name("plain.urdf")
    plain.write_text(f'<robot name="arm"><link name="base">{solid}</link></robot>')
    assert_names(*read_model(plain)[0].lost, "outside", str(beside), "roots=")
    assert read_model(plain, [beside])[1].loaded


def test_meshes_are_found_in_the_package_that_ros_finds(package, tmp_path, monkeypatch):
    (elsewhere := tmp_path / "elsewhere").mkdir()
    trimesh.creation.box((1, 1, 1)).export(elsewhere / "box.stl")
    path = package("$(find other)/part.xacro")
    (path.parent / "part.xacro").rename(elsewhere / "part.xacro")
    monkeypatch.setattr("xacro.substitution_args._eval_find", lambda name: str(elsewhere))
    solid = SOLID.format("package://other/box.stl")
    holding(path, solid)
    assert read_model(path)[0].body("base").shape.file == str(elsewhere / "box.stl")


WRONG = [
    ("<xacro:no_such/>", "no_such"),
    ('<link name="${1/0}"/>', "zero"),
    ('<link name="${nothing}"/>', "nothing"),
    ('<link name="$(arg nothing)"/>', "--argument"),
    ('<xacro:include filename="nothing.xacro"/>', "nothing.xacro"),
    ('<link name="a"', "arm.urdf.xacro"),
    ('<link name="a"/><link name="a"/>', "expanded"),
]


@pytest.mark.parametrize(("inside", "fact"), WRONG)
def test_what_cannot_be_expanded_is_refused_with_its_name(package, inside, fact):
    with pytest.raises(pg.PgraphError, match=fact) as refused:
        read_model(package(inside="", body=inside))
    assert "arm.urdf.xacro" in str(refused.value)


def test_what_a_program_would_do_is_not_done_for_a_page(package, tmp_path):
    """The macros evaluate Python, so the page refuses them."""
    text = package().read_text()
    with pytest.raises(Refusal, match=r"arm\.urdf\.xacro"):
        read_text("arm.urdf.xacro", text)


@pytest.mark.parametrize("name", ["m.json", "m.urdf", "m.xml"])
def test_arguments_of_other_files_are_refused(tmp_path, name):
    (tmp_path / name).write_text(pg.Model.serial(1).to_json())
    with pytest.raises(pg.InputError, match=name):
        pg.load(tmp_path / name, arguments={"a": 1})


@pytest.mark.parametrize("value", [None, [1], {"a": 1}])
def test_arguments_are_texts_or_numbers(package, value):
    with pytest.raises(pg.InputError, match="length"):
        pg.load(package(), arguments={"length": value})


def test_without_the_package_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    (tmp_path / "a.urdf.xacro").write_text(f"{NAMED}</robot>")
    with pytest.raises(MissingPackage, match=r"pgraph-dynamics\[xacro\]"):
        read_model(tmp_path / "a.urdf.xacro")
