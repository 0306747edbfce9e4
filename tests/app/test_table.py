"""The table: rows selected, copied, moved, pasted and counted (interface 1.2 to 1.4)."""

import math
from dataclasses import replace

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app import table
from pgraph_app.features import initial
from pgraph_app.model.view import toolbar
from pgraph_app.table import paste as pasting
from pgraph_app.table.paste import copied

from ..refusals import assert_names
from .store import ME, OTHER, after, begun, do, notice, reply, seven

pytestmark = pytest.mark.quick


@pytest.fixture
def state():
    """Fig. 1's seven bodies, looked at by two pages."""
    return begun(seven(), ME, OTHER)


def test_several_rows_are_selected_in_the_table_s_order(state):
    state = after(state, do.SelectBodies(ME, "2", ("5", "2", "5", "nobody")))
    assert (state.clients[ME].selection, state.clients[ME].selected) == ("2", ("2", "5"))
    assert state.clients[OTHER].selected == ()
    assert after(state, do.Select(ME, "3")).clients[ME].selected == ("3",)
    assert after(state, do.Select(ME, None)).clients[ME].selected == ()
    assert after(state, do.Select(ME, "nobody"), do.Select(99, "3")) is state


def test_ctrl_clicks_join_and_leave_in_their_order(state):
    state = after(state, do.Select(ME, "1"), *(do.ToggleBody(ME, name) for name in "34524"))
    assert (state.clients[ME].selection, state.clients[ME].selected) == ("5", ("1", "2", "3", "5"))
    none = after(state, *(do.ToggleBody(ME, name) for name in "1235"))
    assert (none.clients[ME].selection, none.clients[ME].selected) == (None, ())


def test_a_selection_follows_renames_and_deletions(state):
    state = after(state, do.SelectBodies(ME, "5", ("3", "5")))
    renamed = after(state, do.EditBodies(OTHER, 1, ("5",), "name", (((), "knee"),)))
    assert (renamed.clients[ME].selection, renamed.clients[ME].selected) == ("knee", ("3", "knee"))
    assert after(renamed, do.Undo(OTHER)).clients[ME].selection == "5"
    gone = after(state, do.DeleteBodies(OTHER, ("5",), "delete"))
    assert (gone.clients[ME].selection, gone.clients[ME].selected) == ("3", ("3",))


def names(state):
    return [body.name for body in state.model.bodies]


def test_a_branch_is_duplicated_and_its_copies_are_selected(state):
    twice = after(state, do.Duplicate(ME, ("3",), True))
    assert names(twice) == ["1", "2", "3", "4", "5", "8", "9", "6", "7"]
    assert twice.model.body("9").parent == "8"
    assert twice.clients[ME].selected == ("8", "9")
    assert len(twice.undo) == 1
    alone = after(state, do.Duplicate(ME, ("3",), False))
    assert names(alone) == ["1", "2", "3", "8", "4", "5", "6", "7"]
    nested = after(state, do.Duplicate(ME, ("5", "3"), True))
    assert len(names(nested)) == 9  # 5 goes along with 3, once


def test_several_rows_are_deleted_in_one_step(state):
    left = after(state, do.DeleteBodies(ME, ("3", "6"), "attach"))
    assert names(left) == ["1", "2", "4", "5", "7"]
    assert left.model.body("7").parent == "2"
    assert after(left, do.Undo(ME)).model is state.model
    assert names(after(state, do.DeleteBodies(ME, ("2",), "delete"))) == ["1"]


def test_d1_the_number_of_bodies_may_be_changed_later(state):
    more = after(state, do.CountBodies(ME, 1, "9"))
    assert [(b.name, b.parent) for b in more.model.bodies[7:]] == [("8", "7"), ("9", "8")]
    fewer = after(state, do.CountBodies(ME, 1, "5"))
    assert names(fewer) == ["1", "2", "3", "4", "5"]
    assert after(fewer, do.Undo(ME)).model is state.model
    assert after(state, do.CountBodies(ME, 3, "7")).undo == ()


def paste(text, rows=(), column=0, under=None):
    return do.Paste(ME, 1, text, rows, column, under)


def line(joint, heading, cell, order=1):
    """Return a table of one body, with the joint before or after the field."""
    head, row = ["name", "joint", heading][::order], ["a", joint, cell][::order]
    return "\t".join(head) + "\n" + "\t".join(row)


DEG = math.pi / 180
IN_UNITS = [
    ("revolute", "q [deg]", "90", "q", (90 * DEG,)),
    ("revolute", "q [rad]", "1.5", "q", (1.5,)),
    ("revolute", "q", "79.05 deg", "q", (79.05 * DEG,)),
    ("revolute", "q [rad]", "79.05 deg", "q", (79.05 * DEG,)),
    ("revolute", "q [deg]", "[90]", "q", (90 * DEG,)),
    ("revolute", "q (deg)", "180/4", "q", (45 * DEG,)),
    ("screw", "q", "90°", "q", (90 * DEG,)),
    ("prismatic", "q [mm]", "5", "q", (0.005,)),
    ("prismatic", "q", "5 mm", "q", (0.005,)),
    ("prismatic", "q [cm]", "1/2", "q", (0.005,)),
    ("cylindrical", "q", "90 deg 5 mm", "q", (90 * DEG, 0.005)),
    ("cylindrical", "q", '["90 deg", "5 mm"]', "q", (90 * DEG, 0.005)),
    ("cylindrical", "q", "[90 deg, 5 mm]", "q", (90 * DEG, 0.005)),
    ("planar", "q", "5 mm, 1 m, 90 deg", "q", (0.005, 1.0, 90 * DEG)),
    ("free", "q", "5 mm 0 0 1 0 0 0", "q", (0.005, 0, 0, 1, 0, 0, 0)),
    ("free", "v", "90 deg 0 0 5 mm 0 0", "v", (90 * DEG, 0, 0, 0.005, 0, 0)),
    ("universal", "q [deg]", "90 -45", "q", (90 * DEG, -45 * DEG)),
    ("spherical", "v [deg/s]", "90 0 45", "v", (90 * DEG, 0, 45 * DEG)),
    ("revolute", "v [deg]", "90", "v", (90 * DEG,)),
    ("revolute", "v [rpm]", "90", "v", (90 * 360 / 60 * DEG,)),
    ("revolute", "v", "90 rpm", "v", (90 * 360 / 60 * DEG,)),
    ("revolute", "v", "90 deg/s", "v", (90 * DEG,)),
    ("prismatic", "v [mm/s]", "5", "v", (0.005,)),
    ("prismatic", "v [m/s]", "5", "v", (5.0,)),
    ("revolute", "limits [deg]", "-90 90", "limits", ((-90 * DEG, 90 * DEG),)),
    ("revolute", "limits [deg]", "[[-90, null]]", "limits", ((-90 * DEG, None),)),
    ("prismatic", "limits", "-5 mm 5 mm", "limits", ((-0.005, 0.005),)),
    ("cylindrical", "limits", '[["-90 deg", 0], [0, "5 mm"]]', "limits",
     ((-90 * DEG, 0), (0, 0.005))),
    ("prismatic", "rest [mm]", "5", "rest", (0.005,)),
    ("universal", "rest [deg]", "90", "rest", (90 * DEG, 90 * DEG)),
    ("screw", "pitch [mm]", "5", "pitch", (0.005,)),
    ("prismatic", "stiffness [N/m]", "5", "stiffness", (5,)),
    ("cylindrical", "stiffness", "5 6", "stiffness", (5, 6)),
    ("spherical", "damping [N m s/rad]", "5", "damping", (5,)),
    ("weld", "mass [g]", "500", "mass", 0.5),
    ("weld", "mass [g]", "1/2", "mass", 0.0005),
    ("weld", "com [mm]", "10/2 0 1 m", "com", "unit behind"),
    ("weld", "tip", "5 mm 0 3 cm", "tip", (0.005, 0, 0.03)),
    ("weld", "link z [mm]", "30/6", "link", (0, 0, 0.005)),
    ("weld", "inertia [kg m^2]", "1 2 2.5", "inertia", ((1, 0, 0), (0, 2, 0), (0, 0, 2.5))),
    ("weld", "inertia [kg·m²]", "1 2 2.5", "inertia", ((1, 0, 0), (0, 2, 0), (0, 0, 2.5))),
    ("weld", "rotation [-]", "0 1 0 0", "rotation", (0, 1, 0, 0)),
    # refused by name
    ("revolute", "q [mm]", "90", "q", "'mm'"),
    ("prismatic", "q [deg]", "90", "q", "'deg'"),
    ("prismatic", "v [rpm]", "90", "v", "'rpm'"),
    ("revolute", "q [rpm]", "90", "q", "'rpm'"),
    ("revolute", "q [turns]", "90", "q", "'turns'"),
    ("revolute", "q", "5 mm", "q", "mm"),
    ("prismatic", "q", "5 deg", "q", "deg"),
    ("cylindrical", "q [deg]", "90 5", "q", "'deg'"),
    ("cylindrical", "rest", "5 mm", "rest", "angle"),
    ("cylindrical", "limits [mm]", "-5 5", "limits", "'mm'"),
    ("free", "q [mm]", "5 0 0 1 0 0 0", "q", "'mm'"),
    ("spherical", "q [deg]", "1 0 0 0", "q", "'deg'"),
    ("planar", "q", "1 2 3 deg", "q", "unit behind"),
    ("revolute", "stiffness [N/m]", "5", "stiffness", "'N/m'"),
    ("revolute", "friction [mN m]", "5", "friction", "'mN m'"),
    ("weld", "inertia [g mm^2]", "1 2 2.5", "inertia", "'g mm^2'"),
    ("weld", "density [g/cm3]", "5", "density", "'g/cm3'"),
    ("weld", "rotation [deg]", "1 0 0 0", "rotation", "'deg'"),
    ("revolute", "axes [mm]", "0 0 1", "axes", "'mm'"),
    ("weld", "link", "1 2 3 mm", "link", "unit behind"),
    ("weld", "shape [mm]", '{"kind": "sphere", "radius": 40}', "shape", "'mm'"),
]  # fmt: skip


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize(("joint", "heading", "cell", "field", "value"), IN_UNITS)
def test_the_unit_of_a_heading_or_a_cell_is_taken_or_refused(
    state, joint, heading, cell, field, value, order
):
    new = after(state, paste(line(joint, heading, cell, order)))
    if isinstance(value, str):
        assert new.model is state.model
        assert value in reply(new)
        assert field in reply(new)
    else:
        found = getattr(new.model.body("a"), field)
        assert np.array(found, object).shape == np.array(value, object).shape
        for x, y in zip(np.ravel(found), np.ravel(value)):
            assert x == y or x == pytest.approx(y, rel=1e-15)


@pytest.mark.parametrize(("heading", "joint", "cell", "q"), [
    ("joint", "prismatic", "5 mm", (0.005,)),
    ("dof", "1 prismatic", "5 mm", (0.005,)),
    ("dof", "1", "90 deg", (90 * DEG,)),
    ("motions", '"[[""translate"", [0, 0, 1]], [""rotate"", [0, 0, 1]]]"', "5 mm 90 deg",
     (0.005, 90 * DEG)),
])  # fmt: skip
def test_units_are_those_of_the_joint_that_the_line_gives(state, heading, joint, cell, q):
    for rows in ((), ("4",)):
        for text in (f"q\t{heading}\n{cell}\t{joint}", f"{heading}\tq\n{joint}\t{cell}"):
            new = after(state, paste(text, rows)).model
            assert (new.body("4") if rows else new.bodies[-1]).q == q


def sphere(x):
    return f'"{{""kind"": ""sphere"", ""radius"": 0.04, ""position"": [{x}, 0, 0]}}"'


def test_a_centre_that_is_not_pasted_is_in_the_middle_of_the_shape_or_the_rod(state):
    empty = after(state, do.DeleteBodies(ME, tuple(state.model.row), "delete"))
    for start in (state, empty):
        new = after(start, paste(
            "name\tparent\tlink [mm]\ttip\tshape\tcom\n"
            "base\tground\t\t\t\t\n"
            "rod\tbase\t250 0 0\t\t\t\n"
            "end\trod\t0 0 -300\t0 400 mm 0\t\t\n"
            f"ball\tground\t\t\t{sphere(0.5)}\t\n"
            f"own\tground\t\t1 0 0\t{sphere(0.5)}\t0 0 2 cm\n"
            "alone\tground\t1 0 0\t\t\t\n"
        ))  # fmt: skip
        coms = {b.name: b.com for b in new.model.bodies}
        assert coms["base"] == (0.125, 0, 0)
        assert coms["rod"] == (0, 0, -0.15)
        assert coms["end"] == (0, 0.2, 0)
        assert coms["ball"] == pytest.approx((0.5, 0, 0), abs=1e-15)
        assert coms["own"] == (0, 0, 0.02)
        assert coms["alone"] == pg.Body(name="x").com
        assert all(f"'{x}'" in notice(new) for x in ("base", "rod", "end", "ball", "alone"))
        assert "'own'" not in notice(new)


def test_what_a_pasted_line_leaves_out_has_the_default_of_a_model_file(state):
    new = after(state, paste("name\tmass\na\t2")).model.body("a")
    assert new == pg.Body(name="a", mass=2.0)
    text = f'name\tdensity\tderived\tshape\na\t100\t"[""mass"", ""com""]"\t{sphere(0.5)}'
    steel = after(state, paste(text)).model.body("a")
    assert steel.com == pytest.approx((0.5, 0, 0), abs=1e-15)
    solid = after(state, paste(f"name\tmass\tshape\na\t2\t{sphere(0.5)}")).model.body("a")
    assert solid.inertia == pg.Body(name="a", mass=2.0, shape=solid.shape).inertia != steel.inertia


@pytest.mark.parametrize("event", [do.NewModel(ME, 1, "4"), paste("a\nb\nc\nd"),
                                   do.CountBodies(ME, 1, "9")])  # fmt: skip
def test_rods_that_are_only_counted_or_named_have_their_centre_in_the_middle(state, event):
    for body in after(state, event).model.bodies[-2:]:
        assert body.tip is not None
        assert np.linalg.norm(body.tip) == pytest.approx(np.linalg.norm(body.link))
        assert body.com == tuple(x / 2 for x in body.tip)


def test_a_pasted_body_with_a_com_or_a_shape_takes_no_tip_of_another(state):
    text = "name\tcom\tmass\nshin\t0 0 -0.2\t1\n"
    assert after(state, paste(text)).model.body("shin").tip is None
    given = "name\tcom\ttip\nshin\t0 0 -0.2\t0 0 -0.5\n"
    assert after(state, paste(given)).model.body("shin").tip == (0, 0, -0.5)
    shape = 'name\tshape\nhub\t{"kind":"sphere","radius":0.04}'
    hub = after(state, paste(shape)).model.body("hub")
    assert (hub.tip, hub.shape.radius) == (None, 0.04)


def test_lines_become_new_rows_and_speak_of_each_other(state):
    text = "hip\t7\t1 revolute\tholonomic\nknee\thip\t0\nfoot\n"
    new = after(state, paste(text)).model
    assert [(b.name, b.parent, b.joint) for b in new.bodies[7:]] == [
        ("hip", "7", "revolute"), ("knee", "hip", "weld"), ("foot", "knee", "revolute"),
    ]  # fmt: skip
    assert after(state, paste("toe", under="5")).model.body("toe").parent == "5"
    lines = "3\t2\t1 revolute\tholonomic\n5\t3\t1 revolute\tholonomic"  # copied: a second branch
    new = after(state, paste(lines))
    assert [(b.name, b.parent) for b in new.model.bodies[7:]] == [("8", "2"), ("9", "8")]
    assert new.clients[ME].selected == ("8", "9")
    assert len(new.undo) == 1
    for name in ("<b>bold</b>", "🦿 leg", '"quoted"', "=SUM(A1)", "a b", "arm, left"):
        quoted = '"' + name.replace('"', '""') + '"'  # as spreadsheets write them
        assert name in names(after(state, paste(quoted if '"' in name else name)))
    pin = pg.Constraint(name="pin", kind="point", body="7")
    pasted = after(begun(state.model.replace(constraints=(pin,))), paste("a\t7\t1\tpin"))
    assert pasted.model.body("a").parent == "7"
    assert "constraints" in notice(pasted)  # which are not pasted


def test_an_unnamed_model_takes_the_name_of_the_pasted_rows(state):
    assert toolbar(state, ME)["unnamed"]
    assert after(state, paste("hip\nknee")).model.name == state.model.name  # beside seven bodies
    empty = after(state, do.DeleteBodies(ME, tuple(state.model.row), "delete"))
    named = after(empty, paste("chassis\nwheel"))
    assert named.model.name == "chassis"
    assert not toolbar(named, ME)["unnamed"]
    assert [b.name for b in named.model.bodies] == ["chassis", "wheel"]
    assert after(named, do.Undo(ME)).model.name == state.model.name
    own = replace(empty, model=empty.model.replace(name="rover"))
    assert after(own, paste("chassis")).model.name == "rover"


@pytest.mark.parametrize("mark", [";", ",", "\t", " ; "])
def test_the_text_of_a_csv_file_is_pasted_as_a_table(state, mark):
    lines = (("name", "parent", "mass [g]", "link"), ("a", "ground", "1500", "0 0 0.3"),
             ("b", "a", "2", ""))  # fmt: skip
    new = after(state, paste("\n".join(mark.join(line) for line in lines))).model.bodies[7:]
    assert [(b.name, b.parent, b.mass) for b in new] == [("a", "ground", 1.5), ("b", "a", 0.002)]
    assert new[0].link == (0.0, 0.0, 0.3)


def test_lines_fill_rows_from_a_cell_on(state):
    filled = after(state, paste("1\t2\n\t3", ("4", "5"), 1)).model
    assert [(b.parent, b.dof) for b in filled.bodies[3:5]] == [("1", 2), ("3", 3)]
    swapped = after(state, paste("5\n4", ("4", "5")))
    assert names(swapped)[3:5] == ["5", "4"]
    longer = after(state, paste("six\nseven\neight", ("6", "7"))).model
    assert [b.name for b in longer.bodies[5:]] == ["six", "seven", "eight"]
    assert longer.body("eight").parent == "seven"


def test_copied_rows_keep_all_fields_when_pasted(state):
    steel = {"shape": pg.Shape(kind="box", size=(0.2, 0.1, 0.3)), "density": 7850.0,
             "derived": ("mass", "com", "inertia")}  # fmt: skip
    model = state.model.edit("4", name="steel", **steel)
    model = model.edit("5", name="ball", joint="free", q=(1, 2, 3, 1, 0, 0, 0), tip=None, mass=3.0)
    model = model.edit("6", name="slide", joint="prismatic", axes=((0, 0, 1),), limits=((-1, 2),))
    model = model.edit("7", name="long", dof=5).edit("long", stiffness=(0, 2, 3))
    text = copied(model, [body.name for body in model.bodies])
    new = after(initial(pg.Model()), do.Connected(ME), paste(text)).model
    assert new.bodies == model.bodies


def test_headings_name_any_field_in_any_order_with_their_units(state):
    text = (
        "mass [kg]\tname\tlink [mm]\tinertia\tparent\tshape\tcom z (cm)\tdensity\n"
        "2.5\tcup\t0, 20 300\t1 2 2.5\tground\t"
        '"{""kind"": ""sphere"", ""radius"": 0.1}"\t4\t\n'
        "500 g\tlid\t[0, 0, 90]\t\tcup\t\t\t\n"
    )
    model = after(state, paste(text)).model
    cup, lid = model.body("cup"), model.body("lid")
    assert (cup.mass, cup.parent, cup.com[2]) == (2.5, "ground", 0.04)
    assert cup.link == (0.0, 0.02, 0.3)
    assert cup.inertia == ((1, 0, 0), (0, 2, 0), (0, 0, 2.5))
    assert (cup.shape.kind, cup.shape.radius) == ("sphere", 0.1)
    assert (lid.mass, lid.link, lid.parent) == (0.5, (0, 0, 0.09), "cup")
    short = "Body\tMass\tDoF\tlink z\nrod\t1e-3\t3\t-0.5\n"
    rod = after(state, paste(short)).model.body("rod")
    assert (rod.mass, rod.joint, rod.link[2]) == (1e-3, "spherical", -0.5)


def test_the_first_body_of_an_empty_table_swings_and_can_be_saved(state):
    """A free one would fall out of the view in its first run."""
    empty = after(state, do.DeleteBodies(ME, ("1",), "delete"))
    for event in (do.AddBody(ME, None), do.CountBodies(ME, 1, "2")):
        model = after(empty, event).model
        assert (model.bodies[0].joint, model.bodies[0].axes) == ("revolute", ((0, 1, 0),))
        assert pg.Model.from_json(model.to_json()) == model


def test_pasted_rows_have_the_joint_of_the_description_where_they_name_none(state):
    """The first one on the ground too: lines of a table are a description."""
    empty = after(state, do.DeleteBodies(ME, tuple(state.model.row), "delete"))
    for start in (state, empty):
        rows = after(start, paste("name\tparent\tmass\naa\tground\t1\nbb\taa\t2")).model
        assert [(b.name, b.joint) for b in rows.bodies[-2:]] == [
            ("aa", "revolute"), ("bb", "revolute"),
        ]  # fmt: skip
        turned = after(start, paste("name\tparent\taxes\naa\tground\tx\nbb\taa\t-y")).model
        assert [b.axes for b in turned.bodies[-2:]] == [((1, 0, 0),), ((0, -1, 0),)]
        both = after(start, paste("name\tjoint\taxes\nu\tuniversal\tz x")).model
        assert both.bodies[-1].axes == ((0, 0, 1), (1, 0, 0))


def test_pasted_headings_that_repeat_are_refused_and_new_names_are_listed(state):
    doubled = after(state, paste("name\tmass\tname\na\t1\tb"))
    assert doubled.model is state.model
    assert "'name'" in reply(doubled)
    again = after(state, paste("name\n7\n7\nnew"))
    assert [b.name for b in again.model.bodies[-3:]] == ["8", "9", "new"]
    assert "'7' became '8', '7' became '9'" in notice(again)


def test_several_branches_are_mirrored_as_one_step_each_once():
    limbs = pg.Model(bodies=(
        pg.Body(name="trunk", tip=(1, 0, 0)),
        pg.Body(name="left_arm", parent="trunk", link=(1, 1, 0)),
        pg.Body(name="left_hand", parent="left_arm", link=(0, 1, 0)),
        pg.Body(name="left_leg", parent="trunk", link=(0, 1, 0)),
    ))  # fmt: skip
    state, chosen = begun(limbs), ("left_arm", "left_hand", "left_leg")
    done = after(state, do.MirrorBranch(ME, "left_leg", "y", chosen))
    assert sorted(names(done)) == sorted(
        ["trunk", *chosen, *(name.replace("left", "right") for name in chosen)]
    )
    assert len(done.undo) == 1
    one = after(state, do.MirrorBranch(ME, "left_leg", "y"))
    assert names(one)[-1] == one.clients[ME].selection == "right_leg"


def test_rows_move_before_another_to_the_end_or_to_another_parent(state):
    assert names(after(state, do.MoveRows(ME, ("6", "4"), "2")))[:4] == ["1", "4", "6", "2"]
    assert names(after(state, do.MoveRows(ME, ("2",), None)))[-1] == "2"
    assert after(state, do.MoveRows(ME, ("2",), "2")).model is state.model
    moved = after(state, do.SetParent(ME, ("3", "6"), "1"))
    assert [moved.model.body(n).parent for n in ("3", "6")] == ["1", "1"]


def test_a_table_may_have_exactly_as_many_bodies_as_allowed(state, monkeypatch):
    monkeypatch.setattr(table, "MOST_BODIES", 8)
    state = after(state, do.AddBody(ME, "3"))
    assert len(state.model.bodies) == len(after(state, do.AddBody(ME, "3")).model.bodies) == 8


def test_what_is_pasted_is_counted_before_it_is_read(state, monkeypatch):
    """A column of data, pasted by mistake, would hold up other pages while each line is read."""
    monkeypatch.setattr(pasting, "_change", lambda *_: pytest.fail("a line was read"))
    rows = "\n".join(f"{k}\t{k}.5" for k in range(1000))
    assert_names(reply(after(state, do.Paste(ME, 1, rows))), "1007 bodies", "1000")


def test_suggestions_are_given_for_the_problems_that_are_shown_alone():
    """Each takes a time that grows with the table."""
    bodies = [{"name": str(k), "parent": f"p{k}"} for k in range(200)]
    with pytest.raises(pg.ModelError) as refused:
        pg.Model(bodies=bodies)
    problems = refused.value.problems
    assert len(problems) == 200
    assert ["choose one of" in problem.text for problem in problems] == [k < 50 for k in range(200)]


@pytest.mark.parametrize(
    ("text", "facts"),
    [
        ("\n".join(["1"] * 80_000), ["80000 lines", "10000 lines"]),
        ("1" + "\t" * 1_000_000, ["1000001 cells", "100000 cells"]),
        ("\n".join(["a"] * 5_000), ["5003 bodies", "1000"]),
    ],
)
def test_a_paste_of_too_many_lines_is_refused_before_it_is_read(text, facts):
    """Reading it would hold up the edits of other pages."""
    state = begun(pg.Model.serial(3))
    new = after(state, do.Paste(ME, 1, text))
    assert new.model is state.model
    assert_names(reply(new), "Nothing was pasted", *facts)
