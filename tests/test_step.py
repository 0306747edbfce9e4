"""STEP files: exact mass properties, meshes, and the joints that the shapes leave."""

import math
import sys

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.cli import main
from pgraph_core.children import Child
from pgraph_core.formats import step
from pgraph_core.formats.step_joints import KINDS
from pgraph_core.formats.step_parts import parts_of
from pgraph_core.mesh_files import load_mesh

pytest.importorskip("OCP")
from . import step_files as made
from .step_files import box, cut, fused, moved, rod

MECHANISMS = ("four_bar", "slider_crank", "scissor_lift", "gripper", "stewart")


class Here:
    """Does the work of a child process in this one, which has the library already."""

    def __init__(self, work, longest):
        self._work = work

    def result(self, patience):
        return self._work()


@pytest.fixture(autouse=True)
def meshes_here(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.setattr(step, "Child", Here)


def read(tmp_path, parts, *, joints="accept", density=1000.0, unit="MM", whole=None, **given):
    path = made.write(tmp_path / "a.step", parts, unit=unit, whole=whole)
    return pg.read_step(path, joints=joints, density=density, **given)


# -- mass properties -------------------------------------------------------------------------------


def solids_of_revolution(low, high, *squares):
    """Return (volume, com, inertia) between z = low and high, with r² = sum of squares[k] z^k.

    Several polynomials are several pieces (low, high, coefficients), the last sign is theirs.
    """
    z = np.polynomial.Polynomial(squares).integ()
    first = (np.polynomial.Polynomial((0, 1)) * np.polynomial.Polynomial(squares)).integ()
    second = (np.polynomial.Polynomial((0, 0, 1)) * np.polynomial.Polynomial(squares)).integ()
    fourth = (np.polynomial.Polynomial(squares) ** 2).integ()
    volume, moment, along, across = (
        math.pi * (p(high) - p(low)) for p in (z, first, second, fourth)
    )
    return volume, (0, 0, moment), np.diag([across / 4 + along, across / 4 + along, across / 2])


def prism(corners, height):
    """Return (volume, first moment, inertia about the origin) of a polygon extruded along z."""
    area = x1 = y1 = xx = yy = xy = 0.0
    for (a, b), (c, d) in zip(corners, corners[1:] + corners[:1]):
        n = a * d - b * c
        area += n / 2
        x1, y1 = x1 + n * (a + c) / 6, y1 + n * (b + d) / 6
        xx, yy = xx + n * (a * a + a * c + c * c) / 12, yy + n * (b * b + b * d + d * d) / 12
        xy += n * (a * d + 2 * a * b + 2 * c * d + c * b) / 24
    h, zz = height, area * height**3 / 3
    xx, yy, xy, xz, yz = xx * h, yy * h, xy * h, x1 * h * h / 2, y1 * h * h / 2
    inertia = np.array([[yy + zz, -xy, -xz], [-xy, xx + zz, -yz], [-xz, -yz, xx + yy]])
    return area * h, (x1 * h, y1 * h, area * h * h / 2), inertia


def solids():
    """Return {name: (solid [mm], (volume, first moment, inertia about the origin))}."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCone as Cone
    from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism, BRepPrimAPI_MakeTorus
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere as Sphere
    from OCP.gp import gp_Pnt, gp_Vec

    def extruded(corners, height):
        polygon = BRepBuilderAPI_MakePolygon()
        for x, y in corners:
            polygon.Add(gp_Pnt(float(x), float(y), 0.0))
        polygon.Close()
        face = BRepBuilderAPI_MakeFace(polygon.Wire()).Face()
        return BRepPrimAPI_MakePrism(face, gp_Vec(0, 0, height)).Shape()

    def of(sign, *pieces):
        return tuple(sum(s * np.array(x) for s, x in zip(sign, parts)) for parts in zip(*pieces))

    def flat(*corners):
        return extruded(corners, 12.0), prism([*map(tuple, corners)], 12.0)

    def ring(R, r, part=1.0):
        v, moment = 2 * math.pi**2 * R * r * r, np.zeros(3)
        inertia = v * np.diag([R * R / 2 + 5 / 8 * r * r] * 2 + [R * R + 3 / 4 * r * r])
        if part < 1:
            moment[1] = v * part * 2 / math.pi * (R + r * r / (4 * R))
        return v * part, moment, inertia * part

    z, pi = (0, 0, 1), math.pi
    turned = solids_of_revolution
    square = [(-20, -15), (20, -15), (20, 15), (-20, 15)]
    hexagon = [(20 * math.cos(k * pi / 3), 20 * math.sin(k * pi / 3)) for k in range(6)]
    cross = 16 / 3 * 10**3, (0, 0, 0), np.diag([64 / 45 + 16 / 15] * 2 + [128 / 45]) * 10**5
    tube, block = turned(0, 30, 100), prism(square, 30.0)
    bar = turned(-30, 30, 100)
    return {
        "box": (extruded(square, 30.0), block),
        "cube": flat((0, 0), (12, 0), (12, 12), (0, 12)),
        "wedge": flat((0, 0), (40, 0), (0, 25)),
        "angle": flat((0, 0), (40, 0), (40, 5), (5, 5), (5, 30), (0, 30)),
        "hexagon": flat(*hexagon),
        "cylinder": (rod(10, (0, 0, 0), z, 30), tube),
        "disc": (rod(50, (0, 0, 0), z, 1), turned(0, 1, 2500)),
        "tube": (cut(rod(15, (0, 0, 0), z, 30), rod(10, (0, 0, -1), z, 32)),
                 of((1, -1), turned(0, 30, 225), tube)),
        "shaft": (fused(rod(10, (0, 0, 0), z, 30), rod(5, (0, 0, 30), z, 20)),
                  of((1, 1), tube, turned(30, 50, 25))),
        "cone": (Cone(20, 0, 40).Shape(), turned(0, 40, 400, -20, 1 / 4)),
        "frustum": (Cone(20, 10, 40).Shape(), turned(0, 40, 400, -10, 1 / 16)),
        "sphere": (Sphere(15).Shape(), turned(-15, 15, 225, 0, -1)),
        "hemisphere": (Sphere(15, 0, pi / 2).Shape(), turned(0, 15, 225, 0, -1)),
        "cap": (Sphere(15, pi / 6, pi / 2).Shape(), turned(7.5, 15, 225, 0, -1)),
        "shell": (cut(Sphere(15).Shape(), Sphere(10).Shape()),
                  of((1, -1), turned(-15, 15, 225, 0, -1), turned(-10, 10, 100, 0, -1))),
        "torus": (BRepPrimAPI_MakeTorus(30, 8).Shape(), ring(30, 8)),
        "bend": (BRepPrimAPI_MakeTorus(30, 8, pi).Shape(), ring(30, 8, 1 / 2)),
        "drilled": (cut(extruded(square, 30.0), rod(10, (0, 0, -1), z, 32)),
                    of((1, -1), block, tube)),
        "crossed": (cut(rod(10, (0, 0, -30), z, 60), rod(10, (-30, 0, 0), (1, 0, 0), 60)),
                    of((1, -1), bar, (cross[0], cross[1],
                       cross[2][[1, 2, 0]][:, [1, 2, 0]]))),
        "common": (BRepAlgoAPI_Common(rod(10, (0, 0, -30), z, 60),
                                      rod(10, (-30, 0, 0), (1, 0, 0), 60)).Shape(),
                   (cross[0], cross[1], cross[2][[1, 2, 0]][:, [1, 2, 0]])),
    }  # fmt: skip


def test_mass_properties_of_solids_are_exact(tmp_path):
    """Turned and moved in the file, within 1e-9 of closed forms [kg, m]."""
    known = solids()
    assert len(known) == 20
    turn, step = moved((0, 0, 0), (1, 2, 3), 40), 200
    parts = {
        name: (solid, moved((step * k, 0, 0)).Multiplied(turn))
        for k, (name, (solid, _)) in enumerate(known.items())
    }
    path = made.write(tmp_path / "solids.step", parts)
    for k, part in enumerate(parts_of(path).parts):
        volume, moment, inertia = known[part.name][1]
        com = np.array(moment) / volume
        central = inertia - volume * (com @ com * np.eye(3) - np.outer(com, com))
        size = central.trace()
        R = part.turn
        assert part.volume == pytest.approx(volume * 1e-9, rel=1e-9), part.name
        at = R @ com + (step * k, 0, 0)
        assert part.com * 1e3 == pytest.approx(at, abs=1e-9 * size**0.2 * 100), part.name
        wanted = R @ central @ R.T * 1e-15
        assert np.abs(part.inertia - wanted).max() <= 1e-9 * size * 1e-15, part.name


def test_meshes_are_within_the_stated_error(tmp_path):
    """Points on triangles of a ball, a ring and a shaft, from the exact surfaces."""
    known = {name: solids()[name][0] for name in ("sphere", "torus", "cylinder")}
    far = {
        "sphere": lambda x: np.linalg.norm(x, axis=1) - 0.015,
        "torus": lambda x: np.hypot(np.hypot(x[:, 0], x[:, 1]) - 0.03, x[:, 2]) - 0.008,
        "cylinder": lambda x: np.hypot(x[:, 0], x[:, 1]) - 0.01,
    }
    for part in parts_of(made.write(tmp_path / "a.step", known)).parts:
        mesh = load_mesh(part.file)
        corners = mesh.vertices[mesh.faces]
        weights = np.array(((0.5, 0.5, 0), (1 / 3, 1 / 3, 1 / 3)))
        inside = np.einsum("nij,wi->nwj", corners, weights).reshape(-1, 3)
        off = far[part.name](inside)
        if part.name == "cylinder":  # points of its ends are inside
            off = off[np.abs(inside[:, 2] - 0.015) < 0.0149]
        assert 0 < np.abs(off).max() <= part.chord, part.name
        assert part.chord == pytest.approx(1e-3 * np.ptp(part.box, axis=0).max(), rel=1e-3)
        assert mesh.is_watertight


# -- mechanisms ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_joints_of_a_mechanism_are_found(name, tmp_path):
    """All of them at their places, no other one, and the mobility of the textbook."""
    parts, joints, dof = getattr(made, name)()
    model, report = read(tmp_path, parts, fixed=[next(iter(parts))])
    found = {frozenset(joint.bodies): joint for joint in report.joints}
    assert found.keys() == {frozenset(pair) for pair in joints}
    for pair, (kind, point, axis) in joints.items():
        joint = found[frozenset(pair)]
        assert (joint.kind, joint.selected) == (kind, True)
        axis, off = np.array(axis) / np.linalg.norm(axis), np.subtract(joint.point, point)
        if kind != "spherical":
            assert np.linalg.norm(np.cross(axis, joint.axis)) < 1e-9
            off = np.cross(axis, off)
        assert kind == "prismatic" or np.linalg.norm(off) < 1e-9
    assert pg.Mechanism(model).mobility().dof == dof
    assert report.moved < 1e-12


def test_no_joint_is_accepted_silently(tmp_path):
    parts, joints, _ = made.four_bar()
    model, report = read(tmp_path, parts, joints="propose")
    assert len(report.joints) == len(joints)
    assert {body.joint for body in model.bodies} == {"free"}
    (text,) = (e.text for e in report.of("warning") if "none is accepted" in e.text)
    assert "4 joints" in text
    assert pg.load(tmp_path / "a.step").bodies[0].joint == "free"


def test_a_run_equals_that_of_the_model_made_by_hand(tmp_path):
    parts, joints, _ = made.four_bar()
    model, _ = read(tmp_path, parts, fixed=["base"])
    at = {pair: np.array(point) for pair, (_, point, _) in joints.items()}
    places = {"crank": at["base", "crank"], "coupler": at["crank", "coupler"],
              "rocker": at["base", "rocker"]}  # fmt: skip
    files = {part.name: part for part in parts_of(tmp_path / "a.step").parts}
    bodies = []
    for name, parent in (("crank", "ground"), ("coupler", "crank"), ("rocker", "ground")):
        part, base = files[name], places.get(parent, np.zeros(3))
        bodies.append(
            pg.Body(
                name=name, parent=parent, link=places[name] - base, mass=1000 * part.volume,
                com=part.com - places[name], inertia=1000 * part.inertia,
            )
        )  # fmt: skip
    end = at["coupler", "rocker"]
    loop = pg.Revolute(
        name="loop", body="coupler", other="rocker", point=end - places["coupler"],
        other_point=end - places["rocker"], axis=(0, 0, 1), other_axis=(0, 0, 1),
    )  # fmt: skip
    hand = pg.Model(bodies=bodies, constraints=[loop], up="y")
    runs = [pg.simulate(x, t_end=0.3, dt=1e-3) for x in (model.replace(up="y"), hand)]
    one, other = (np.array([run[name][-1] for name in places]) for run in runs)
    assert np.abs(one) == pytest.approx(np.abs(other), abs=1e-8)
    assert np.abs(one).max() > 0.1


@pytest.mark.parametrize(
    ("unit", "whole", "reverse"),
    [("INCH", None, False), ("M", None, True), ("MM", moved((300, -20, 77), (1, 2, 3), 37), True)],
)
def test_units_places_and_order_change_nothing(unit, whole, reverse, tmp_path):
    parts, joints, dof = made.four_bar()
    given = dict(reversed(parts.items())) if reverse else parts
    model, report = read(tmp_path, given, unit=unit, whole=whole, fixed=["base"])
    plain, _ = read(tmp_path, parts, fixed=["base"])
    assert {frozenset(joint.bodies) for joint in report.joints} == {*map(frozenset, joints)}
    assert {joint.kind for joint in report.joints} == {"revolute"}
    assert pg.Mechanism(model).mobility().dof == dof
    for body in model.bodies:
        same = plain.body(body.name)
        assert body.mass == pytest.approx(same.mass, rel=1e-12)
        moments = (np.linalg.eigvalsh(np.array(x.inertia)) for x in (body, same))
        assert np.allclose(*moments, rtol=1e-10, atol=0)


def test_a_loop_with_a_fault_of_the_drawing_is_closed_and_the_move_stated(tmp_path):
    """As in google-deepmind/mujoco#2172, where 0.1 mm made the loop drift."""
    parts, _, dof = made.four_bar()
    solid, place = parts["rocker"]
    parts["rocker"] = solid, moved((0.1, 0, 0)).Multiplied(place)
    model, report = read(tmp_path, parts, fixed=["base"])
    assert sorted(round(joint.gap, 9) for joint in report.joints) == [0, 0, 1e-4, 1e-4]
    assert report.moved == pytest.approx(1e-4, rel=1e-6)
    assert any("0.1 mm" in e.text for e in report.of("approximated"))
    mech = pg.Mechanism(model)
    assert mech.mobility().dof == dof
    assert mech.assemble()[2].moved < 1e-9


def test_parts_that_are_welded_are_one_body(tmp_path):
    """Two dowels and a contact hold a lid, whose parts then have one mass."""
    pins = [rod(3, (x, 0, -10), (0, 0, 1), 30) for x in (-20, 20)]
    low = cut(box((60, 20, 10), (0, 0, -5)), *pins)
    lid = cut(box((60, 20, 10), (0, 0, 5)), *pins)
    base = fused(low, *(rod(3, (x, 0, -10), (0, 0, 1), 20) for x in (-20, 20)))
    model, report = read(tmp_path, {"base": base, "lid": lid}, density={"lid": 2000.0, "*": 1000.0})
    (joint,) = report.joints
    assert (joint.kind, len(model.bodies)) == ("weld", 1)
    by_name = {part.name: part for part in parts_of(tmp_path / "a.step").parts}
    mass = 1000 * by_name["base"].volume + 2000 * by_name["lid"].volume
    assert model.bodies[0].mass == pytest.approx(mass, rel=1e-12)
    assert len(model.bodies[0].shapes) == 2
    hinged, _ = pg.read_step(tmp_path / "a.step", joints=[joint.changed("revolute")], fixed="base")
    assert [body.joint for body in hinged.bodies] == ["weld", "revolute"]


def test_instances_share_a_mesh_and_mirrored_ones_do_not(tmp_path):
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf

    flip = gp_Trsf()
    flip.SetMirror(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 1, 0)))
    solid = fused(box((40, 10, 10), (20, 10, 5)), box((10, 30, 10), (35, 25, 5)))
    parts = {"a": (solid, None, (1, 0, 0)), "b": (solid, moved((0, 0, 50))), "c": (solid, flip)}
    found = {part.name: part for part in parts_of(made.write(tmp_path / "a.step", parts)).parts}
    assert found["a"].file == found["b"].file != found["c"].file
    assert found["c"].volume == pytest.approx(found["a"].volume, rel=1e-12)
    assert found["c"].com == pytest.approx(found["a"].com * (1, -1, 1), abs=1e-15)
    assert found["b"].colour == pytest.approx((1, 0, 0), abs=1e-6)
    assert load_mesh(found["c"].file).volume == pytest.approx(found["c"].volume, rel=1e-9)


def test_equal_names_are_numbered_and_reserved_ones_changed(tmp_path):
    solid = box((10, 10, 10))
    parts = {
        "pin": (solid, None),
        "pin ": (solid, moved((30, 0, 0))),
        "ground": box((5, 5, 5), (0, 40, 0)),
    }
    model, _ = read(tmp_path, parts, density={"pin": 5.0, "*": 1.0})
    assert [body.name for body in model.bodies] == ["pin 1", "pin 2", "ground 1"]
    assert [body.mass for body in model.bodies] == pytest.approx([5e-6, 5e-6, 1.25e-7])


def test_overlapping_solids_are_read(tmp_path):
    model, report = read(tmp_path, {"a": box((10, 10, 10)), "b": box((10, 10, 10), (5, 5, 5))})
    assert (len(model.bodies), report.joints) == (2, [])


# -- refusals --------------------------------------------------------------------------------------


def shell():
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    return TopExp_Explorer(box((10, 20, 30)), TopAbs_ShapeEnum.TopAbs_SHELL).Current()


def test_surfaces_have_no_mass(tmp_path):
    with pytest.raises(pg.FileError, match=r"holds no solid.*export solids"):
        read(tmp_path, {"skin": shell()})
    model, report = read(tmp_path, {"skin": shell(), "b": box((10, 10, 10))})
    assert [body.name for body in model.bodies] == ["b"]
    assert any("'skin'" in e.text for e in report.of("left out"))


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        (lambda text: "", "not STEP"),
        (lambda text: "a text", "not STEP"),
        (lambda text: "ISO-10303-21;\n", "cut short"),
        (lambda text: text[: len(text) // 2], "cut short"),
        (lambda text: text.replace("CYLINDRICAL_SURFACE('',", "CYLINDRICAL_SURFACE("), "solid"),
    ],
)
def test_a_damaged_file_is_refused(change, fact, tmp_path):
    path = made.write(tmp_path / "a.step", {"a": rod(5, (0, 0, 0), (0, 0, 1), 10)})
    path.write_text(change(path.read_text()))
    with pytest.raises(pg.FileError, match=fact):
        pg.read_step(path)


def test_what_a_damaged_file_has_left_out_is_named(tmp_path):
    parts = {f"p{n}": box((10, 10 + n, 10), (20 * n, 0, 0)) for n in range(4)}
    path = made.write(tmp_path / "a.step", parts)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[: len(lines) // 3] + lines[len(lines) // 2 :]))
    model, report = pg.read_step(path, density=1000)
    assert len(model.bodies) < 4
    assert not report.loaded
    assert any("errors in the text" in line for line in model.lost)


@pytest.mark.parametrize(
    ("given", "facts"),
    [
        ({"density": 0}, "density.*> 0.*got 0"),
        ({"density": {"pn": 7850}}, "density.*'pn'.*pin"),
        ({"density": "7850"}, "density.*got '7850'"),
        ({"fixed": ["pn"]}, "fixed.*'pn'.*pin"),
        ({"joints": "all"}, "joints.*'accept'.*got 'all'"),
        ({"joints": [3]}, "joints.*got"),
        ({"tolerance": 0}, "tolerance.*> 0"),
        ({"seconds": 0}, "seconds.*>= 1"),
    ],
)
def test_wrong_arguments_are_refused(given, facts, tmp_path):
    path = made.write(tmp_path / "a.step", {"pin": rod(5, (0, 0, 0), (0, 0, 1), 10)})
    with pytest.raises(pg.InputError, match=facts):
        pg.read_step(path, **given)


@pytest.mark.parametrize("given", [{"density": -1}, {"joints": "all"}, {"seconds": 0}, {}])
def test_no_process_starts_for_what_is_refused_without_reading(given, tmp_path, monkeypatch):
    path = made.write(tmp_path / "a.step", {"pin": rod(5, (0, 0, 0), (0, 0, 1), 10)})
    monkeypatch.setattr(step, "Child", None)
    with pytest.raises((pg.InputError, pg.FileError)):
        pg.read_step(path if given else tmp_path / "nowhere.step", **given)


def test_a_file_is_read_apart_and_within_limits(tmp_path, monkeypatch):
    path = made.write(tmp_path / "a.step", {"pin": rod(5, (0, 0, 0), (0, 0, 1), 10)})
    monkeypatch.setattr(step, "Child", Child)
    model, _ = pg.read_step(path, density=1000)
    assert model.bodies[0].mass == pytest.approx(250e-6 * math.pi, rel=1e-12)
    monkeypatch.setattr(step, "looked_at", endless)
    with pytest.raises(pg.FileError, match=r"takes more than 2 s.*seconds=20"):
        pg.read_step(path, seconds=2)


def endless(path, tolerance):
    while True:
        pass


def test_the_extra_is_named_where_it_is_missing(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "OCP", None)
    with pytest.raises(pg.PgraphError, match=r"pip install 'pgraph-dynamics\[cad\]'"):
        parts_of(tmp_path / "a.step")


def test_materials_of_the_file_give_densities(tmp_path):
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.TCollection import TCollection_ExtendedString, TCollection_HAsciiString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    document = TDocStd_Document(TCollection_ExtendedString("t"))
    label = XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).AddShape(box((10, 10, 10)), False)
    words = [TCollection_HAsciiString(x) for x in ("steel", "", "density measure", "RATIO_MEASURE")]
    tool = XCAFDoc_DocumentTool.MaterialTool_s(document.Main())
    tool.SetMaterial(label, *words[:2], 7.85, *words[2:])
    writer = STEPCAFControl_Writer()
    writer.SetMaterialMode(True)
    writer.Transfer(document)
    writer.Write(str(tmp_path / "a.step"))
    model, report = pg.read_step(tmp_path / "a.step")
    assert model.bodies[0].mass == pytest.approx(7.85e-3)
    assert any("7850" in e.text for e in report.of("read"))


def test_kinds_are_checked_when_a_joint_is_changed(tmp_path):
    _, report = read(tmp_path, made.four_bar()[0], joints=())
    for kind in KINDS:
        assert report.joints[0].changed(kind).kind == kind
    with pytest.raises(pg.InputError, match=r"base and crank.*revolute.*'hinge'"):
        report.joints[0].changed("hinge")


def test_the_command_line_lists_and_accepts_joints(tmp_path, capsys):
    path, out = made.write(tmp_path / "a.step", made.four_bar()[0]), tmp_path / "a.json"
    assert main(["convert", str(path), str(out)]) == 0
    assert "4 revolute between 'coupler' and 'rocker'" in capsys.readouterr().out
    assert {body.joint for body in pg.load(out, roots=[tmp_path]).bodies} == {"free"}
    words = "--accept --joints 4=cylindrical --fixed base --density 2700 --density crank=7850"
    assert main(["convert", str(path), str(out), *words.split()]) == 0
    assert "1 degree of freedom" in capsys.readouterr().out
    model = pg.load(out, roots=[tmp_path])
    assert [c.kind for c in model.constraints] == ["cylindrical"]
    volume = next(part.volume for part in parts_of(path).parts if part.name == "crank")
    assert model.body("crank").mass == pytest.approx(7850 * volume)
    for more, fact in (("--joints 9", "4 joints"), ("--joints 1=hinge", "revolute")):
        assert main(["convert", str(path), str(out), *more.split()]) != 0
        assert fact in capsys.readouterr().err
    assert main(["convert", str(out), str(tmp_path / "b.json"), "--accept"]) != 0
    assert "STEP" in capsys.readouterr().err
