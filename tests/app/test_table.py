"""Interface 1.2 to 1.4 as reducers: several rows selected, copied, moved, pasted, counted."""

from __future__ import annotations

from dataclasses import replace

import pytest

import pgraph_core as pg
from pgraph_app.core.events import Event
from pgraph_app.core.state import State, initial
from pgraph_app.features import update
from pgraph_app.model.update import Edit, NewModel, OpenText, Undo
from pgraph_app.model.view import toolbar
from pgraph_app.session.update import Connected, Select, SelectBodies, ToggleBody
from pgraph_app.table.paste import copied
from pgraph_app.table.update import (
    AddBody,
    CountBodies,
    DeleteBodies,
    Duplicate,
    MirrorBranch,
    MoveRows,
    Paste,
    SetParent,
)

pytestmark = pytest.mark.fast

ME, OTHER = 1, 2


@pytest.fixture
def state() -> State:
    """Fig. 1's seven bodies, looked at by two pages."""
    model = pg.Model.serial(7).edit("4", parent="2").edit("5", parent="3").edit("6", parent="2")
    return after(initial(model), Connected(ME), Connected(OTHER))


def after(state: State, *happened: Event) -> State:
    for event in happened:
        state = update(state, event)
    return state


# -- 1.2: one selection, of several rows -------------------------------------------------------


def test_several_rows_are_selected_in_the_table_s_order(state):
    state = after(state, SelectBodies(ME, "2", ("5", "2", "5", "nobody")))
    assert (state.clients[ME].selection, state.clients[ME].selected) == ("2", ("2", "5"))
    assert state.clients[OTHER].selected == ()
    assert after(state, Select(ME, "3")).clients[ME].selected == ("3",)
    assert after(state, Select(ME, None)).clients[ME].selected == ()


def test_clicks_with_ctrl_join_and_leave_in_their_order_however_late_the_answers(state):
    state = after(state, Select(ME, "1"), *(ToggleBody(ME, name) for name in "34524"))
    assert (state.clients[ME].selection, state.clients[ME].selected) == ("5", ("1", "2", "3", "5"))
    none = after(state, *(ToggleBody(ME, name) for name in "1235"))
    assert (none.clients[ME].selection, none.clients[ME].selected) == (None, ())


def test_what_is_selected_follows_names_and_goes_with_its_body(state):
    state = after(state, SelectBodies(ME, "5", ("3", "5")))
    renamed = after(state, Edit(OTHER, 1, "5", "name", (), "knee"))
    assert (renamed.clients[ME].selection, renamed.clients[ME].selected) == ("knee", ("3", "knee"))
    gone = after(state, DeleteBodies(OTHER, ("5",), "delete"))
    assert (gone.clients[ME].selection, gone.clients[ME].selected) == ("3", ("3",))


# -- 1.4: rows added, duplicated, mirrored, deleted, moved, counted -----------------------------


def names(state: State) -> list[str]:
    return [body.name for body in state.model.bodies]


def notice(state: State) -> str:
    said = state.clients[ME].notice
    return f"{said.title}: {said.text}" if said else ""


def reply(state: State) -> str:
    said = state.clients[ME].reply
    assert said is not None
    return said.text


def test_a_branch_is_duplicated_and_its_copies_are_selected(state):
    twice = after(state, Duplicate(ME, ("3",), True))
    assert names(twice) == ["1", "2", "3", "4", "5", "8", "9", "6", "7"]
    assert twice.model.body("9").parent == "8"
    assert twice.clients[ME].selected == ("8", "9")
    assert len(twice.undo) == 1
    alone = after(state, Duplicate(ME, ("3",), False))
    assert names(alone) == ["1", "2", "3", "8", "4", "5", "6", "7"]
    nested = after(state, Duplicate(ME, ("5", "3"), True))
    assert len(names(nested)) == 9  # 5 goes along with 3, once


def test_a_branch_is_mirrored_and_what_is_wrong_is_said(state):
    state = after(state, Edit(ME, 1, "6", "name", (), "left_leg"))
    state = after(state, MirrorBranch(ME, "left_leg", "y"))
    assert "right_leg" in names(state)
    assert state.clients[ME].selection == "right_leg"
    assert "nobody" in notice(after(state, MirrorBranch(ME, "nobody", "y")))


def test_several_rows_are_deleted_in_one_step(state):
    left = after(state, DeleteBodies(ME, ("3", "6"), "attach"))
    assert names(left) == ["1", "2", "4", "5", "7"]
    assert left.model.body("7").parent == "2"
    assert after(left, Undo(ME)).model is state.model
    assert names(after(state, DeleteBodies(ME, ("2",), "delete"))) == ["1"]


def test_rows_move_before_another_or_to_the_end(state):
    assert names(after(state, MoveRows(ME, ("6", "4"), "2")))[:4] == ["1", "4", "6", "2"]
    assert names(after(state, MoveRows(ME, ("2",), None)))[-1] == "2"
    assert after(state, MoveRows(ME, ("2",), "2")).model is state.model


def test_rows_move_to_another_parent_unless_it_hangs_on_them(state):
    moved = after(state, SetParent(ME, ("3", "6"), "1"))
    assert [moved.model.body(n).parent for n in ("3", "6")] == ["1", "1"]
    refused = after(state, SetParent(ME, ("2",), "5"))
    assert refused.model is state.model
    assert "cycle" in notice(refused)


def test_d1_the_number_of_bodies_may_be_changed_later(state):
    more = after(state, CountBodies(ME, 1, "9"))
    assert [(b.name, b.parent) for b in more.model.bodies[7:]] == [("8", "7"), ("9", "8")]
    fewer = after(state, CountBodies(ME, 1, "5"))
    assert names(fewer) == ["1", "2", "3", "4", "5"]
    assert after(fewer, Undo(ME)).model is state.model
    for text in ("0", "1001", "many", "1e400", "9" * 10_000):
        refused = after(state, CountBodies(ME, 2, text))
        assert refused.model is state.model
        assert "from 1 to 1000" in reply(refused)
    assert after(state, CountBodies(ME, 3, "7")).undo == ()


def test_too_many_bodies_are_refused_with_their_number(state):
    full = after(state, NewModel(ME, 1, "1000"))
    for event in (AddBody(ME, None), Duplicate(ME, ("3",), False)):
        refused = after(full, event)
        assert refused.model is full.model
        assert "1000 at most" in notice(refused)


# -- 1.4: paste from a spreadsheet --------------------------------------------------------------


def paste(text: str, rows: tuple[str, ...] = (), column: int = 0, under: str | None = None):
    return Paste(ME, 1, text, rows, column, under)


def test_lines_become_new_rows_and_speak_of_each_other(state):
    text = "hip\t7\t1 revolute\tholonomic\nknee\thip\t0\nfoot\n"
    new = after(state, paste(text)).model
    assert [(b.name, b.parent, b.joint) for b in new.bodies[7:]] == [
        ("hip", "7", "revolute"), ("knee", "hip", "weld"), ("foot", "knee", "revolute"),
    ]  # fmt: skip
    assert after(state, paste("toe", under="5")).model.body("toe").parent == "5"


def test_a_model_that_nobody_named_has_the_name_of_what_is_pasted_into_it(state):
    assert toolbar(state, ME)["unnamed"]
    assert after(state, paste("hip\nknee")).model.name == state.model.name  # beside seven bodies
    empty = after(state, DeleteBodies(ME, tuple(state.model.row), "delete"))
    named = after(empty, paste("chassis\nwheel"))
    assert named.model.name == "chassis"
    assert not toolbar(named, ME)["unnamed"]
    assert [b.name for b in named.model.bodies] == ["chassis", "wheel"]
    assert after(named, Undo(ME)).model.name == state.model.name
    own = replace(empty, model=empty.model.replace(name="rover"))
    assert after(own, paste("chassis")).model.name == "rover"


def test_a_pasted_body_with_a_centre_of_mass_has_no_tip_of_another_one(state):
    text = "name\tcom\tmass\nshin\t0 0 -0.2\t1\n"
    shin = update(state, paste(text)).model.body("shin")
    assert shin.tip is None
    given = "name\tcom\ttip\nshin\t0 0 -0.2\t0 0 -0.5\n"
    assert update(state, paste(given)).model.body("shin").tip == (0, 0, -0.5)


def test_a_pasted_shape_has_its_own_tip_and_is_refused_by_its_own_name(state):
    shape = '{"kind":"sphere","radius":0.04}'
    hub = after(state, paste(f"name\tmass\tshape\nhub\t2\t{shape}")).model.body("hub")
    assert (hub.tip, hub.shape.radius) == (None, 0.04)
    refused = after(state, paste('name\tshape\nhub\t{"kind":"sphere","size":[0.04]}'))
    assert "body 'hub', shape: a sphere has no size: give radius" in refused.clients[ME].reply.text


@pytest.mark.parametrize("mark", [";", ",", "\t", " ; "])
def test_the_text_of_a_csv_file_is_pasted_as_a_table(state, mark):
    lines = (("name", "parent", "mass [g]", "link"), ("a", "ground", "1500", "0 0 0.3"),
             ("b", "a", "2", ""))  # fmt: skip
    new = after(state, paste("\n".join(mark.join(line) for line in lines))).model.bodies[7:]
    assert [(b.name, b.parent, b.mass) for b in new] == [("a", "ground", 1.5), ("b", "a", 0.002)]
    assert new[0].link == (0.0, 0.0, 0.3)


def test_a_table_with_commas_that_no_field_is_called_says_so_and_a_name_may_have_one(state):
    refused = after(state, paste("name;parent;weight\na;ground;1"))
    assert refused.model is state.model
    assert "weight" in refused.clients[ME].reply.text
    named = after(state, paste("arm, left\narm, right")).model.bodies[7:]
    assert [b.name for b in named] == ["arm, left", "arm, right"]


def test_what_was_copied_is_pasted_as_a_second_branch(state):
    copied = "3\t2\t1 revolute\tholonomic\n5\t3\t1 revolute\tholonomic"
    new = after(state, paste(copied))
    assert [(b.name, b.parent) for b in new.model.bodies[7:]] == [("8", "2"), ("9", "8")]
    assert new.clients[ME].selected == ("8", "9")
    assert len(new.undo) == 1


def test_lines_fill_rows_from_a_cell_on(state):
    filled = after(state, paste("1\t2\n\t3", ("4", "5"), 1)).model
    assert [(b.parent, b.dof) for b in filled.bodies[3:5]] == [("1", 2), ("3", 3)]
    swapped = after(state, paste("5\n4", ("4", "5")))
    assert names(swapped)[3:5] == ["5", "4"]
    longer = after(state, paste("six\nseven\neight", ("6", "7"))).model
    assert [b.name for b in longer.bodies[5:]] == ["six", "seven", "eight"]
    assert longer.body("eight").parent == "seven"


def test_headings_choose_the_columns(state):
    text = "Body\tMass\tDoF\tlink z\nrod\t1e-3\t3\t-0.5\n"
    rod = after(state, paste(text)).model.body("rod")
    assert (rod.mass, rod.joint, rod.link[2]) == (1e-3, "spherical", -0.5)


@pytest.mark.parametrize(
    ("text", "rows", "column", "said"),
    [
        ("a\tnobody", (), 0, "no body is named 'nobody'"),
        ("a\t1\t9", (), 0, "line 1, dof: must be a whole number from 0 to 6; given '9'"),
        ("a\t1\nb\t1\tmany", (), 0, "line 2, dof: must be"),
        ("a\t1\t3 compound", (), 0, "line 1, dof: a compound joint of 3 DoF is made in its"),
        ("a\t1\t1\tknot", (), 0, "line 1, constraint: no constraint is called 'knot'"),
        ("a\t1\t1\tholonomic\tmore", (), 0, "line 1 has 5 cells; 4 fit: name, parent, dof"),
        ("Body\tMass\na\t1e400", (), 0, "line 1, mass: '1e400' is too large"),
        ("Body\tMass\na\tnan", (), 0, "line 1, mass: must be a number"),
        ("4\n4", ("2", "3"), 0, "already the name of row"),
        ("1\n2", ("3",), 1, "line 2 has no row; paste into the column Body"),
        ("5", ("2",), 1, "closes a cycle"),
        ("", (), 0, "nothing to paste"),
        ("x" * 5000, (), 0, "at most 100"),
        ("b", ("nobody",), 0, "body 'nobody'"),
        ("\n".join(f"r{k}" for k in range(1000)), (), 0, "1007 bodies; 1000 at most"),
    ],
)
def test_a_refused_paste_changes_nothing_and_says_which_line_and_why(
    state, text, rows, column, said
):
    refused = after(state, paste(text, rows, column))
    assert refused.model is state.model
    assert refused.undo == ()
    assert reply(refused).startswith("Nothing was pasted: ")
    assert said in reply(refused)


@pytest.mark.parametrize("name", ["<b>bold</b>", "🦿 leg", '"quoted"', "=SUM(A1)", "a b"])
def test_odd_names_are_pasted_as_they_are(state, name):
    quoted = '"' + name.replace('"', '""') + '"'  # as spreadsheets write them
    assert name in names(after(state, paste(quoted if '"' in name else name)))


def test_rows_are_copied_and_pasted_with_all_they_carry(state):
    steel = {"shape": pg.Shape(kind="box", size=(0.2, 0.1, 0.3)), "density": 7850.0,
             "derived": ("mass", "com", "inertia")}  # fmt: skip
    model = state.model.edit("4", name="steel", **steel)
    model = model.edit("5", name="ball", joint="free", q=(1, 2, 3, 1, 0, 0, 0), tip=None, mass=3.0)
    model = model.edit("6", name="slide", joint="prismatic", axes=((0, 0, 1),), limits=((-1, 2),))
    model = model.edit("7", name="long", dof=5).edit("long", stiffness=(0, 2, 3))
    text = copied(model, [body.name for body in model.bodies])
    new = after(initial(pg.Model()), Connected(ME), paste(text)).model
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


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("name\tparent\tmas\tmass\na\tground\t1\t1", "'mas'"),
        ("name\tmass [lb]\na\t1", "'lb'"),
        ("name\tinertia\na\t1 2", "3 moments"),
    ],
)
def test_headings_and_units_that_are_not_known_are_named(state, text, named):
    refused = after(state, paste(text))
    assert refused.model is state.model
    assert named in reply(refused)


def test_constraints_are_not_pasted_and_that_is_said(state):
    pin = pg.Constraint(name="pin", kind="point", body="7")
    state = after(initial(state.model.replace(constraints=(pin,))), Connected(ME))
    state = after(state, paste("a\t7\t1\tpin"))
    assert "list of constraints" in notice(state)


def test_the_first_body_of_an_empty_table_is_free_and_can_be_saved(state):
    empty = after(state, DeleteBodies(ME, ("1",), "delete"))
    for event in (AddBody(ME, None), paste("a\tground"), CountBodies(ME, 1, "2")):
        model = after(empty, event).model
        assert model.bodies[0].joint == "free"
        assert pg.Model.from_json(model.to_json()) == model


def test_several_branches_are_mirrored_as_one_step_each_once(state):
    limbs = pg.Model(bodies=(
        pg.Body(name="trunk", tip=(1, 0, 0)),
        pg.Body(name="left_arm", parent="trunk", link=(1, 1, 0)),
        pg.Body(name="left_hand", parent="left_arm", link=(0, 1, 0)),
        pg.Body(name="left_leg", parent="trunk", link=(0, 1, 0)),
    ))  # fmt: skip
    before = after(state, OpenText(ME, "limbs", limbs.to_json()))
    chosen = ("left_arm", "left_hand", "left_leg")
    done = after(before, MirrorBranch(ME, "left_leg", "y", chosen))
    names = [body.name for body in done.model.bodies]
    assert sorted(names) == sorted(
        [*(b.name for b in limbs.bodies), "right_arm", "right_hand", "right_leg"]
    )
    assert len(done.undo) == len(before.undo) + 1
