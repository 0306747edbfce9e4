"""What is typed into properties becomes the model: SI, exact, one undo step (interface.md 1.5)."""

from __future__ import annotations

import base64
import math
import time
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
from pgraph_app.core import cells
from pgraph_app.core.cells import Display
from pgraph_app.core.state import Client, initial
from pgraph_app.features import update
from pgraph_app.model import Errand, Found
from pgraph_app.model.update import ErrandDone
from pgraph_app.model.worker import Errands, answer
from pgraph_app.properties.body_cells import (
    axis_of,
    euler_of,
    from_axis,
    from_euler,
    held,
    moments,
    possible,
    shifted,
)
from pgraph_app.properties.update import Check, EditBodies, FillFromShape, Mend, UploadMesh, shaped
from pgraph_app.properties.view import physical, properties
from pgraph_app.properties.world import DeleteParameter, EditParameter, EditWorld, RenameParameter
from pgraph_app.session.update import Connected, Select, SelectBodies, SetDisplay
from pgraph_core.model.shape import mass_properties_of
from pgraph_core.rotation import matrix

pytestmark = pytest.mark.fast

ME = 1
ROD = pg.Body(name="rod")


@pytest.fixture
def state():
    return update(initial(pg.Model.serial(4)), Connected(ME))


def edit(state, field, *entries, bodies=("2",), kind=EditBodies):
    return update(state, kind(ME, 7, bodies, field, tuple(entries)))


def told(state) -> str:
    return state.clients[ME].reply.text


def show(state, what, value):
    return update(state, SetDisplay(ME, what, value))


# -- numbers and units -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("field", "index", "text", "value"),
    [
        ("mass", (), "1e-6", 1e-6),
        ("link", (1,), "0.1", 0.1),
        ("com", (0,), "5 mm", 0.005),
        ("q", (0,), "30 deg", math.pi / 6),
        ("v", (0,), "-2", -2.0),
        ("damping", (0,), "0.25", 0.25),
        ("limit_restitution", (0,), "0.5", 0.5),
        ("friction", (0,), "2", 2.0),
        ("armature", (0,), "1e-3", 1e-3),
        ("rest", (0,), "0.3", 0.3),
        ("stiffness", (0,), "40", 40.0),
    ],
)
def test_a_number_typed_is_the_number_used(state, field, index, text, value):
    after = edit(state, field, (index, text))
    found = getattr(after.model.body("2"), field)
    for i in index:
        found = found[i]
    assert found == pytest.approx(value, rel=1e-15)
    assert told(after) == ""
    assert len(after.undo) == 1


@given(st.floats(-1e6, 1e6), st.sampled_from(("angle", "length")))
def test_display_units_lose_no_digit(x, quantity):
    display = Display("deg", "mm")
    assert display.si(display.shown(x, quantity), quantity) == pytest.approx(x, rel=3e-16)


@given(st.decimals(-1000, 1000, places=3))
def test_what_was_typed_in_degrees_or_millimetres_is_shown_again(x):
    display = Display("deg", "mm")
    for quantity in ("angle", "length"):
        assert display.shown(display.si(float(x), quantity), quantity) == float(x)


def test_what_names_no_body_is_of_those_that_its_page_has_selected(state):
    typed = EditBodies(ME, 1, (), "mass", (((), "3.5"),))
    refused = update(update(state, Select(ME, None)), typed)
    assert refused.model is state.model
    assert "no body is selected" in refused.clients[ME].reply.text
    done = update(update(state, SelectBodies(ME, "2", ("1", "2"))), typed)
    assert [body.mass for body in done.model.bodies][:2] == [3.5, 3.5]
    assert done.model.bodies[2:] == state.model.bodies[2:]


def test_display_units_never_reach_the_file(state):
    state = show(show(state, "angle", "deg"), "length", "mm")
    after = edit(edit(state, "link", ((0,), "150")), "q", ((0,), "90"))
    body = after.model.body("2")
    assert body.link[0] == 0.15
    assert body.q == (math.pi / 2,)
    assert "deg" not in after.model.to_json()
    sent = properties(after, ("2",), after.clients[ME].display)
    fields = {f["field"]: f for g in sent["groups"] for f in g["fields"]}
    assert fields["q"]["cells"][0]["value"] == 90.0
    assert fields["link"]["cells"][0]["value"] == 150.0
    assert (fields["q"]["unit"], fields["link"]["unit"]) == ("deg", "mm")


BAD = ("abc", "1e400", "nan", "inf", "1,5", "<b>1</b>", "🦿", "9" * 10_000, "1 furlong")
NUMBERS = ("mass", "link", "inertia", "q")  # an empty one is refused; an empty limit is an open one


@pytest.mark.parametrize(
    ("field", "text"),
    [*product((*NUMBERS, "limits"), BAD), *((field, "") for field in NUMBERS)],
)
def test_bad_input_leaves_the_model_and_gives_a_sentence(state, field, text):
    index = {"mass": (), "inertia": (0, 0), "limits": (0, 1)}.get(field, (0,))
    after = edit(state, field, (index, text))
    assert after.model is state.model
    assert "2" in told(after)
    assert len(told(after)) < 300


# -- fields ------------------------------------------------------------------------------------


def test_limits_are_typed_one_by_one_and_left_open(state):
    one = edit(state, "limits", ((0, 0), "-1"))
    assert one.model.body("2").limits == ((-1.0, None),)
    two = edit(one, "limits", ((0, 1), "1"))
    assert two.model.body("2").limits == ((-1.0, 1.0),)
    none = edit(two, "limits", ((0, 0), ""), ((0, 1), ""))
    assert none.model.body("2").limits == ()


def test_d8_a_compound_joint_gets_motions_one_by_one(state):
    state = edit(state, "joint", ((), "compound"))
    assert [m for m, _ in state.model.body("2").motions] == ["ball", "translate"]
    state = edit(state, "motions", ((0,), "rotate"))
    state = edit(state, "motions", ((), "translate"))
    assert [m for m, _ in state.model.body("2").motions] == ["rotate", "translate", "translate"]
    state = edit(state, "axes", ((0, 0), "1"), ((0, 2), "0"))
    assert state.model.body("2").axes[0] == (1.0, 0.0, 0.0)
    state = edit(state, "motions", ((1,), ""))
    assert state.model.body("2").dof == 2
    for number in (0, 2):
        state = edit(state, "motions", ((number,), ""))
    assert "weld" in told(state)


@settings(max_examples=60)
@given(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_an_orientation_is_the_same_in_every_form(q):
    for there, back in ((euler_of, from_euler), (axis_of, from_axis)):
        assert np.allclose(matrix(back(there(q))), matrix(q), atol=1e-7)


def test_euler_angles_are_roll_pitch_yaw(state):
    state = show(show(state, "turn", "euler"), "angle", "deg")
    after = edit(state, "rotation_euler", ((2,), "90"))
    assert matrix(after.model.body("2").rotation) @ (1, 0, 0) == pytest.approx((0, 1, 0), abs=1e-15)


def test_several_bodies_are_edited_at_once_in_one_undo_step(state):
    after = edit(state, "mass", ((), "3"), bodies=("1", "3", "4"))
    assert [b.mass for b in after.model.bodies] == [3.0, 1.0, 3.0, 3.0]
    assert len(after.undo) == 1
    refused = edit(after, "mass", ((), "-3"), bodies=("1", "3"))
    assert refused.model is after.model
    sent = properties(after, ("1", "2"))
    fields = {f["field"]: f for g in sent["groups"] for f in g["fields"]}
    assert fields["mass"]["cells"][0].get("varied")
    assert not fields["com"]["cells"][0].get("varied")
    assert fields["mass"]["cells"][0]["value"] == ""


# -- inertia -----------------------------------------------------------------------------------


def test_an_inertia_about_the_origin_is_kept_about_the_centre_of_mass(state):
    state = show(state, "about", "origin")
    body = state.model.body("2")
    seen = held(state.model, body, "inertia", state.clients[ME].display)
    assert seen[1][1] == pytest.approx(body.inertia[1][1] + body.mass * body.com[0] ** 2)
    after = edit(state, "inertia", ((0, 1), "1e-5"))
    back = shifted(after.model.body("2").inertia, body.mass, body.com, 1.0)
    assert back[0][1] == back[1][0] == pytest.approx(1e-5)


@settings(max_examples=100)
@given(st.lists(st.floats(-10, 10), min_size=9, max_size=9))
def test_a_repair_is_possible_and_leaves_what_is_possible(values):
    given_ = np.reshape(values, (3, 3))
    given_ = given_ + given_.T
    new = possible(given_)
    assert np.allclose(possible(new), new, atol=1e-12)
    pg.Body(name="rod", inertia=new)


def test_what_is_half_typed_is_judged_and_nothing_changed(state):
    bad = edit(state, "inertia", ((2, 2), "1"), kind=Check)
    assert bad.model is state.model
    assert "triangle inequality" in told(bad)
    assert bad.clients[ME].reply.offer == "Use the nearest possible inertia"
    assert told(edit(bad, "inertia", ((2, 2), "1e"), kind=Check)) == ""
    assert told(edit(bad, "inertia", ((2, 2), "3.5e-3"), kind=Check)) == ""
    mended = edit(bad, "inertia", ((2, 2), "1"), kind=Mend)
    assert mended.model.body("2").inertia[2][2] == 1.0


def test_an_impossible_inertia_is_refused_with_an_offer_that_is_one_step(state):
    refused = edit(state, "inertia", ((2, 2), "1"))
    assert "triangle inequality" in told(refused)
    assert "by 0.99" in told(refused)
    assert refused.clients[ME].reply.offer == "Use the nearest possible inertia"
    mended = edit(refused, "inertia", ((2, 2), "1"), kind=Mend)
    a, b, c = np.linalg.eigvalsh(mended.model.body("2").inertia)
    assert c == pytest.approx(1.0)
    assert a + b == pytest.approx(c)
    assert len(mended.undo) == 1


def test_a_quaternion_is_made_a_unit_one(state):
    ball = edit(state, "joint", ((), "spherical"))
    refused = edit(ball, "q", ((0,), "1"), ((1,), "1"))
    assert "unit quaternion" in told(refused)
    assert refused.clients[ME].reply.offer
    mended = edit(refused, "q", ((0,), "1"), ((1,), "1"), kind=Mend)
    assert math.hypot(*mended.model.body("2").q) == pytest.approx(1.0)


# -- shapes ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "volume"),
    [
        ("box", lambda s: np.prod(s.size)),
        ("sphere", lambda s: 4 / 3 * math.pi * s.radius**3),
        ("cylinder", lambda s: math.pi * s.radius**2 * s.length),
        ("capsule", lambda s: math.pi * s.radius**2 * (s.length + 4 / 3 * s.radius)),
    ],
)
def test_mass_properties_follow_from_shape_and_density(state, kind, volume):
    shaped = edit(state, "shape_kind", ((), kind))
    shape = shaped.model.body("2").shape
    assert np.linalg.norm(shape.position) == pytest.approx(0.1)  # the middle of the rod
    after = update(shaped, FillFromShape(ME, 1, ("2",), "1000"))
    body = after.model.body("2")
    assert body.mass == pytest.approx(1000 * volume(shape))
    assert body.com == pytest.approx(shape.position)
    assert len(after.undo) == 2


@pytest.mark.parametrize(("density", "part"), [("-1", "> 0"), ("x", "number")])
def test_no_mass_without_density(state, density, part):
    after = update(state, FillFromShape(ME, 1, ("2",), density))
    assert part in told(after)
    assert after.model is state.model


def test_a_material_makes_the_rod_as_which_a_body_is_drawn_its_shape(state):
    """Also of several bodies, of which one has a shape that it keeps."""
    box = edit(state, "shape_kind", ((), "box"), bodies=("3",))
    after = update(box, FillFromShape(ME, 1, ("2", "3"), "7850"))
    rod, kept = after.model.body("2"), after.model.body("3")
    assert rod.shape.kind == "capsule"
    assert rod.mass == pytest.approx(mass_properties_of(rod.shapes, 7850).mass)
    assert kept.shape == box.model.body("3").shape
    rows = [f for g in properties(state, ("2",))["groups"] for f in g["fields"]]
    (note,) = [f["note"] for f in rows if f["field"].endswith("shape_kind")]
    assert note.startswith("drawn as a plain rod")


CUBE = "solid a\n" + "\n".join(
    "facet normal 0 0 0\nouter loop\n"
    + "\n".join(f"vertex {x} {y} {z}" for x, y, z in face)
    + "\nendloop\nendfacet"
    for face in (
        ((0, 0, 0), (0, 1, 0), (1, 0, 0)), ((0, 0, 0), (1, 0, 0), (0, 0, 1)),
        ((0, 0, 0), (0, 0, 1), (0, 1, 0)), ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    )
)  # fmt: skip


def upload(state, name: str, content: bytes):
    text = base64.b64encode(content).decode()
    after = update(state, UploadMesh(ME, ("2",), name, text))
    (errand,) = after.errands
    return update(after, answer(errand))


def test_a_mesh_file_becomes_the_shape_and_gives_the_mass(state, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    after = upload(state, "tetra.stl", f"{CUBE}\nendsolid a\n".encode())
    assert after.model.body("2").shape.kind == "mesh"
    assert "4 faces" in after.clients[ME].notice.text
    asked = update(after, FillFromShape(ME, 1, ("2",), "600"))
    filled = update(asked, answer(asked.errands[0]))
    assert filled.model.body("2").mass == pytest.approx(100.0)
    assert filled.model.body("2").com == pytest.approx((0.25, 0.25, 0.25))


@pytest.mark.parametrize(
    ("name", "content", "part"),
    [
        ("a.exe", b"MZ", "no mesh is read from .exe files"),
        ("broken.stl", b"solid nothing here", "broken.stl"),
        ("../../etc/x.obj", b"v 0 0", "x.obj"),
        ("empty.ply", b"", "empty.ply"),
    ],
)
def test_a_broken_mesh_is_a_sentence(state, tmp_path, monkeypatch, name, content, part):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    after = upload(state, name, content)
    assert after.model is state.model
    assert part in after.clients[ME].notice.text
    assert not any(p.is_file() for p in tmp_path.rglob("*"))


def test_an_open_mesh_is_drawn_and_said_to_have_no_volume(state, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    one_less = CUBE[: CUBE.rindex("facet normal")]
    after = upload(state, "open.stl", f"{one_less}\nendsolid a\n".encode())
    assert "not closed" in after.clients[ME].notice.text
    assert after.model.body("2").shape.kind == "mesh"


def test_an_errand_for_another_model_is_dropped_with_a_word(state):
    asked = update(state, UploadMesh(ME, ("2",), "a.stl", ""))
    edited_ = edit(asked, "mass", ((), "2"))
    after = update(edited_, ErrandDone(1, Found(changes={"2": {"mass": 9.0}})))
    assert after.model is edited_.model
    assert "changed meanwhile" in after.clients[ME].notice.text


def test_errands_are_answered_beside_the_store(state):
    heard = []
    worker = Errands(heard.append)
    work = lambda _: shaped(("2",), "a.txt", b"")  # noqa: E731
    errand = Errand(1, ME, state.model, "mesh file", work)

    worker.render(state, replace(state, errands=(errand,)))
    end = time.monotonic() + 5
    while not heard and time.monotonic() < end:
        time.sleep(0.01)
    assert "no mesh is read" in heard[0].problem


# -- the model and its parameters --------------------------------------------------------------


@pytest.mark.parametrize(
    ("field", "index", "text", "value"),
    [
        ("name", (), "crane", lambda m: m.name == "crane"),
        ("gravity", (2,), "-1.62", lambda m: m.gravity == (0, 0, -1.62)),
        ("up", (), "y", lambda m: m.up == "y" and m.gravity == (0, -9.81, 0)),
        ("friction", (), "0.8", lambda m: m.ground.friction == 0.8),
        ("restitution", (), "0.1", lambda m: m.ground.restitution == 0.1),
        ("static_friction", (), "0.9", lambda m: m.ground.static_friction == 0.9),
        ("rolling_friction", (), "0.01", lambda m: m.ground.rolling_friction == 0.01),
        ("slope", (), "10 deg", lambda m: m.ground.slope == pytest.approx(math.pi / 18)),
        ("uphill", (1,), "1", lambda m: m.ground.uphill == (1.0, 1.0, 0.0)),
        ("steps", (), "", lambda m: len(m.ground.steps) == 1),
    ],
)
def test_properties_of_the_model(state, field, index, text, value):
    after = update(state, EditWorld(ME, 1, field, ((index, text),)))
    assert told(after) == ""
    assert value(after.model)
    assert len(after.undo) == 1


def test_steps_of_the_ground_are_edited_and_taken_out(state):
    state = update(state, EditWorld(ME, 1, "steps", (((), ""),)))
    state = update(state, EditWorld(ME, 1, "steps", (((0, 4), "0.25"),)))
    assert state.model.ground.steps[0].height == 0.25
    bad = update(state, EditWorld(ME, 1, "steps", (((0, 0), "99"),)))
    assert "low must be less" in told(bad)
    state = update(state, EditWorld(ME, 1, "steps", (((0,), ""),)))
    assert state.model.ground.steps == ()


def test_one_parameter_for_four_legs(state):
    state = update(state, EditParameter(ME, 1, "thigh", "0.3"))
    state = edit(state, "link", ((0,), "=thigh"), bodies=("2", "3", "4"))
    state = edit(state, "com", ((0,), "=thigh/2"), bodies=("2",))
    assert state.model.body("3").link == (0.3, 0, 0)
    state = edit(state, "link", ((1,), "0.1"), bodies=("3",))  # the formula beside it stays
    longer = update(state, EditParameter(ME, 1, "thigh", "0.4"))
    assert longer.model.body("3").link == (0.4, 0.1, 0)
    assert longer.model.body("2").com[0] == 0.2
    assert len(longer.undo) == len(state.undo) + 1
    renamed = update(longer, RenameParameter(ME, 1, "thigh", "femur"))
    assert renamed.model.parameters == {"femur": 0.4}
    assert {f.text for f in renamed.model.formulas} == {"=femur", "=femur/2"}
    gone = update(renamed, DeleteParameter(ME, "femur"))
    assert gone.model.formulas == ()
    assert gone.model.body("3").link[0] == 0.4


@pytest.mark.parametrize(
    ("text", "part"),
    [("=thig", "no parameter is named 'thig'"), ("=1/0", "divides by zero"), ("=(", "no formula")],
)
def test_a_bad_formula_is_a_sentence(state, text, part):
    state = update(state, EditParameter(ME, 1, "thigh", "0.3"))
    after = edit(state, "mass", ((), text))
    assert part in told(after)
    assert after.model is state.model


def test_a_refusal_of_the_model_s_own_cells_names_the_field(state):
    for field, text, said in (
        ("gravity", "x", "The gravity must be a number such as 0.25 or 1e-6; given 'x'"),
        ("name", " ", "The name must have 1 to 100 characters; given 0"),
        ("slope", "1e400", "The slope '1e400' is too large for a number"),
    ):
        index = (0,) if field == "gravity" else ()
        after = update(state, EditWorld(ME, 1, field, ((index, text),)))
        assert told(after).startswith(said)
        assert after.model is state.model


def test_a_length_that_no_picture_can_hold_is_refused(state):
    after = edit(state, "link", ((0,), "1e308"))
    assert "link vector: is too long to be drawn; use at most 1e+15 m" in told(after)
    assert edit(state, "link", ((0,), "1e12")).model.body("2").link[0] == 1e12


@pytest.mark.parametrize(
    ("text", "of", "value"),
    [("0.2/2", "length", 0.1), ("2*(1 + 0.5)", "number", 3.0), ("2 t", "mass", 2000.0),
     ("250 g", "mass", 0.25), ("15 deg", "angle", math.radians(15)), ("100/4 mm", "length", 0.025),
     ("pi/2", "angle", math.pi / 2), ("2^3", "number", 8.0), ("-(1e-3)", "number", -1e-3)],
)  # fmt: skip
def test_arithmetic_and_units_in_a_cell(text, of, value):
    assert cells.quantity(text, of, Display()) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "word"),
    [("1/0", "divides by zero"), ("2*", "cannot be calculated"), ("9^9^9^9", "too large"),
     ("1,5", "'.'"), ("", "must be a number"), ("x+1", "must be a number")],
)  # fmt: skip
def test_what_cannot_be_calculated_is_refused_in_a_sentence(text, word):
    with pytest.raises(cells.Refusal, match=word):
        cells.quantity(text, "length", Display())


def test_what_follows_from_the_shapes_goes_on_following_until_it_is_typed(state):
    shaped = edit(state, "shape_kind", ((), "box"))
    filled = update(shaped, FillFromShape(ME, 1, ("2",), "1000"))
    body = filled.model.body("2")
    assert body.derived == ("mass", "com", "inertia")
    longer = edit(filled, "shape_size", ((2,), "0.5"))
    ratio = 0.5 / body.shape.size[2]
    now = longer.model.body("2")
    assert now.mass == pytest.approx(ratio * body.mass)
    assert moments(now.inertia)[2] > moments(body.inertia)[2] * ratio
    heavy = edit(longer, "mass", ((), "2 t")).model.body("2")
    assert heavy.mass == 2000
    assert heavy.derived == ("com", "inertia")
    np.testing.assert_allclose(
        np.array(heavy.inertia), np.array(now.inertia) * 2000 / now.mass, rtol=1e-12
    )
    again = edit(edit(longer, "mass", ((), "2 t")), "derived", ((), "mass")).model.body("2")
    assert again.mass == pytest.approx(2000)
    assert set(again.derived) == {"mass", "com", "inertia"}


def test_a_body_without_a_shape_gets_a_rod_that_its_inertia_follows(state):
    after = edit(state, "derived", ((), "inertia")).model.body("2")
    assert after.shape.kind == "capsule"
    assert after.derived == ("inertia",)
    m, (a, b, c) = after.mass, moments(after.inertia)
    length = after.shape.length + 2 * after.shape.radius
    assert m * length**2 / 14 < c < m * length**2 / 11  # a rod with round ends
    assert b == pytest.approx(c)
    assert a < 0.1 * c


@pytest.mark.parametrize("text", ["5 mm", "0.03", "0.0999"])
def test_a_rod_from_joint_to_tip_stays_one_with_another_radius(state, text):
    rod = edit(state, "derived", ((), "inertia"))
    whole = float(np.linalg.norm(rod.model.body("2").tip))
    thin = edit(rod, "shape_radius", ((), text)).model.body("2").shape
    assert thin.radius == pytest.approx(cells.quantity(text, "length", Display()))
    assert thin.length + 2 * thin.radius == pytest.approx(whole, rel=1e-12)


def test_a_capsule_that_ends_elsewhere_keeps_its_length(state):
    rod = edit(edit(state, "derived", ((), "inertia")), "shape_length", ((), "0.05"))
    before = rod.model.body("2").shape
    after = edit(rod, "shape_radius", ((), "5 mm")).model.body("2").shape
    assert (before.length, after.length, after.radius) == (0.05, 0.05, 0.005)


def test_a_contact_at_points_is_told_when_its_body_gets_a_shape(state):
    """Made without one it touches at the tip, and goes on to do so."""
    points = pg.Contact(name="grip", body="2", points=((0, 0, 0.5),))
    other = pg.Contact(name="floor", body="3", points=((0, 0, 0.5),))
    state = replace(state, model=state.model.add(points).add(other))
    shaped = edit(state, "shape_kind", ((), "box"))
    said = shaped.clients[ME].notice.text
    assert "grip" in said
    assert "1 point" in said
    assert "floor" not in said
    quiet = replace(shaped, clients={ME: replace(shaped.clients[ME], notice=None)})
    assert edit(quiet, "shape_size", ((0,), "0.3")).clients[ME].notice is None


def test_every_shape_of_a_body_has_a_form(state):
    state = edit(state, "shape_kind", ((), "box"))
    state = edit(state, "shape_more_kind", ((), "sphere"))
    state = edit(state, "shape_1_radius", ((), "0.2/2"))
    state = edit(state, "shape_1_role", ((), "visual"))
    state = edit(state, "shape_1_colour", ((), "#ff8000"))
    state = edit(state, "shape_1_position", ((1,), "30 mm"))
    box, ball = state.model.body("2").shapes
    assert (box.kind, box.role) == ("box", "both")
    assert (ball.kind, ball.radius, ball.role, ball.position[1]) == ("sphere", 0.1, "visual", 0.03)
    assert ball.colour == pytest.approx((1, 128 / 255, 0))
    titles = [g["title"] for g in properties(state, ("2",))["groups"]]
    assert "Shape 2" in titles
    turned = replace(state, clients={ME: replace(state.clients[ME], display=Display(turn="euler"))})
    angles = (((0,), "90 deg"), ((1,), "0"), ((2,), "0"))
    turned = edit(turned, "shape_rotation_euler", *angles).model.body("2").shape
    assert turned.rotation == pytest.approx((math.sqrt(0.5), math.sqrt(0.5), 0, 0))
    assert len(edit(state, "shape_1_kind", ((), "none")).model.body("2").shapes) == 1
    refused = update(state, EditBodies(ME, 9, ("2",), "shape_4_radius", (((), "1"),)))
    assert "taken out meanwhile" in refused.clients[ME].reply.text


def test_an_inertia_far_too_small_for_its_body_is_doubted(state):
    heavy = edit(state, "mass", ((), "1200"))
    (note,) = (f["note"] for g in properties(heavy, ("2",))["groups"] for f in g["fields"]
               if f["field"] == "inertia")  # fmt: skip
    assert "too small" in note
    assert "too" not in physical(state.model.body("2"))


# -- the length as one number ------------------------------------------------------------------


def test_a_length_stretches_the_body_and_takes_along_what_hangs_at_its_tip():
    """A uniform rod of twice the length is the rod of that length: closed forms."""
    rod = pg.Shape(kind="cylinder", radius=0.01, length=0.5, position=(0.25, 0, 0),
                   rotation=(math.sqrt(0.5), 0, math.sqrt(0.5), 0))  # fmt: skip
    thick = np.diag([1e-4, 0.5**2 / 12, 0.5**2 / 12])
    arm = pg.Body(name="arm", mass=1.0, com=(0.25, 0, 0), tip=(0.5, 0, 0), inertia=thick, shape=rod)
    hand = pg.Body(name="hand", parent="arm", link=(0.5, 0, 0), mass=1.0)
    beside = pg.Body(name="beside", parent="arm", link=(0.2, 0, 0), mass=1.0)
    tie = pg.Constraint(name="tie", kind="point", body="arm", point=(0.5, 0, 0))
    state = replace(initial(pg.Model(bodies=(arm, hand, beside), constraints=(tie,))),
                    clients={ME: Client()})  # fmt: skip
    model = update(state, EditBodies(ME, 1, ("arm",), "body_length", (((), "1 m"),))).model
    body = model.body("arm")
    assert (body.tip, body.com, body.mass) == ((1.0, 0, 0), (0.5, 0, 0), 1.0)
    spread = 1e-4 / 2  # of the mass across the rod, which stays
    np.testing.assert_allclose(
        np.diag(body.inertia), (2 * spread, *[4 * (0.5**2 / 12 - spread) + spread] * 2), rtol=1e-12
    )
    assert (body.shape.length, body.shape.position) == (1.0, (0.5, 0, 0))
    assert model.body("hand").link == (1.0, 0, 0)
    assert model.body("beside").link == (0.2, 0, 0)
    assert model.constraints[0].point == (1.0, 0, 0)


def test_a_length_of_what_follows_from_the_shapes_follows_and_nonsense_is_refused(state):
    derived = update(state, EditBodies(ME, 1, ("2",), "derived", (((), "all"),)))
    before = derived.model.body("2")
    after = update(derived, EditBodies(ME, 1, ("2",), "body_length", (((), "0.4"),))).model
    assert after.body("2").mass > 1.5 * before.mass
    assert math.hypot(*after.body("2").tip_point) == pytest.approx(0.4, rel=0.1)
    for text in ("0", "-1", "x", "5 kg"):
        refused = update(derived, EditBodies(ME, 1, ("2",), "body_length", (((), text),)))
        assert refused.model is derived.model
        assert refused.clients[ME].reply.text


@pytest.mark.parametrize("axis", ["x", "y", "z", "-x"])
def test_the_edges_of_a_new_box_are_along_the_axes_of_its_body(state, axis):
    """Also where the rod that it stands for lies along another axis, or was drawn as a capsule."""
    tip = {"x": (0.6, 0, 0), "y": (0, 0.6, 0), "z": (0, 0, 0.6), "-x": (-0.6, 0, 0)}[axis]
    model = state.model.edit("2", tip=tip, com=tuple(x / 2 for x in tip))
    for first in ("none", "capsule", "cylinder"):
        new = edit(replace(state, model=model), "shape_kind", ((), first))
        new = edit(new, "shape_kind", ((), "box"))
        box = new.model.body("2").shape
        assert box.rotation == (1.0, 0.0, 0.0, 0.0)
        longest = max(range(3), key=lambda i: box.size[i])
        assert (longest, box.size[longest]) == (int(np.argmax(np.abs(tip))), pytest.approx(0.6))
        for kind, field in (("ellipsoid", "radii"), ("box", "size")):
            new = edit(new, "shape_kind", ((), kind))
            rows = [f for g in properties(new, ("2",))["groups"] for f in g["fields"]]
            (edges,) = [f for f in rows if f["field"].endswith(f"_{field}")]
            assert [c["name"] for c in edges["cells"]] == ["x", "y", "z"]
        assert new.model.body("2").shape == box
        rod = edit(new, "shape_kind", ((), "capsule")).model.body("2").shape
        along = matrix(rod.rotation)[:, 2]
        assert abs(along @ np.array(tip)) == pytest.approx(0.6)
        assert rod.length + 2 * rod.radius == pytest.approx(0.6)


def test_an_oblique_box_keeps_its_turn(state):
    model = state.model.edit("2", tip=(0.3, 0, 0.4), com=(0.15, 0, 0.2))
    box = edit(replace(state, model=model), "shape_kind", ((), "box")).model.body("2").shape
    np.testing.assert_allclose(matrix(box.rotation)[:, 2], (0.6, 0, 0.8), atol=1e-12)
    assert box.size[2] == pytest.approx(0.5)
