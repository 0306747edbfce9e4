"""The Properties tab: exact numbers in SI units and one undo step per edit (interface 1.5)."""

import base64
import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
from pgraph_app.core import cells
from pgraph_app.core.cells import Display
from pgraph_app.features import Client, initial
from pgraph_app.model import Found
from pgraph_app.model.apart import Errands
from pgraph_app.pose.solving import degrees
from pgraph_app.properties import body_cells as forms
from pgraph_app.properties.view import properties
from pgraph_core.model.shape import mass_properties_of
from pgraph_core.rotation import matrix

from .store import ME, after, answered, begun, do, notice, reply, until

pytestmark = pytest.mark.quick


@pytest.fixture
def state():
    return begun(pg.Model.serial(4))


def edit(state, field, *entries, bodies=("2",), kind=do.EditBodies):
    return after(state, kind(ME, 7, bodies, field, tuple(entries)))


def display(state, **units):
    return after(state, *(do.SetDisplay(ME, what, unit) for what, unit in units.items()))


def fields_of(state, *names):
    sent = properties(state, names, state.clients[ME].display)
    return {f["field"]: f for group in sent["groups"] for f in group["fields"]}


@pytest.mark.parametrize(
    ("field", "index", "text", "value"),
    [
        ("mass", (), "1e-6", 1e-6),
        ("link", (1,), "0.1", 0.1),
        ("com", (0,), "5 mm", 0.005),
        ("q", (0,), "30 deg", math.pi / 6),
        ("limit_restitution", (0,), "0.5", 0.5),
    ],
)
def test_a_number_typed_is_the_number_used(state, field, index, text, value):
    now = edit(state, field, (index, text))
    found = getattr(now.model.body("2"), field)
    assert (found[index[0]] if index else found) == pytest.approx(value, rel=1e-15)
    assert (reply(now), len(now.undo)) == ("", 1)


@given(st.floats(-1e6, 1e6), st.decimals(-1000, 1000, places=3))
def test_display_units_lose_no_digit(x, typed):
    display = Display("deg", "mm")
    for quantity in ("angle", "length"):
        assert display.si(display.shown(x, quantity), quantity) == pytest.approx(x, rel=3e-16)
        assert display.shown(display.si(float(typed), quantity), quantity) == float(typed)


def test_an_edit_without_names_is_of_the_selected_bodies(state):
    typed = do.EditBodies(ME, 1, (), "mass", (((), "3.5"),))
    refused = after(state, do.Select(ME, None), typed)
    assert refused.model is state.model
    assert reply(refused)
    done = after(state, do.SelectBodies(ME, "2", ("1", "2")), typed)
    assert [body.mass for body in done.model.bodies][:2] == [3.5, 3.5]
    assert done.model.bodies[2:] == state.model.bodies[2:]


def test_display_units_never_reach_the_file(state):
    state = display(state, angle="deg", length="mm", turn="euler")
    now = edit(edit(state, "link", ((0,), "150")), "q", ((0,), "90"))
    body = now.model.body("2")
    assert (body.link[0], body.q) == (0.15, (math.pi / 2,))
    assert "deg" not in now.model.to_json()
    fields = fields_of(now, "2")
    assert fields["q"]["cells"][0]["value"] == 90.0
    assert fields["link"]["cells"][0]["value"] == 150.0
    assert (fields["q"]["unit"], fields["link"]["unit"]) == ("deg", "mm")
    yawed = edit(state, "rotation_euler", ((2,), "90")).model.body("2")  # roll, pitch, yaw
    assert matrix(yawed.rotation) @ (1, 0, 0) == pytest.approx((0, 1, 0), abs=1e-15)


@settings(max_examples=60)
@given(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_an_orientation_is_the_same_in_every_form(q):
    for there, back in ((forms.euler_of, forms.from_euler), (forms.axis_of, forms.from_axis)):
        assert np.allclose(matrix(back(there(q))), matrix(q), atol=1e-7)


def test_several_bodies_are_edited_at_once_in_one_undo_step(state):
    now = edit(state, "mass", ((), "3"), bodies=("1", "3", "4"))
    assert [b.mass for b in now.model.bodies] == [3.0, 1.0, 3.0, 3.0]
    assert len(now.undo) == 1
    assert edit(now, "mass", ((), "-3"), bodies=("1", "3")).model is now.model
    mass, com = (fields_of(now, "1", "2")[name]["cells"][0] for name in ("mass", "com"))
    assert (mass.get("varied"), mass["value"], com.get("varied")) == (True, "", None)


def test_an_inertia_about_the_origin_is_kept_about_the_centre_of_mass(state):
    state = display(state, about="origin")
    body = state.model.body("2")
    seen = forms.held(state.model, body, "inertia", state.clients[ME].display)
    assert seen[1][1] == pytest.approx(body.inertia[1][1] + body.mass * body.com[0] ** 2)
    now = edit(state, "inertia", ((0, 1), "1e-5"))
    back = forms.shifted(now.model.body("2").inertia, body.mass, body.com, 1.0)
    assert back[0][1] == back[1][0] == pytest.approx(1e-5)


@settings(max_examples=40)
@given(st.lists(st.floats(-10, 10), min_size=9, max_size=9))
def test_a_repair_is_possible_and_leaves_what_is_possible(values):
    given_ = np.reshape(values, (3, 3))
    new = forms.possible(given_ + given_.T)
    assert np.allclose(forms.possible(new), new, atol=1e-12)
    pg.Body(name="rod", inertia=new)


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
    now = after(shaped, do.FillFromShape(ME, 1, ("2", "3"), "1000"))
    body, rod = now.model.body("2"), now.model.body("3")
    assert body.shape == shape
    assert body.mass == pytest.approx(1000 * volume(shape))
    assert body.com == pytest.approx(shape.position)
    assert len(now.undo) == 2
    assert rod.shape.kind == "capsule"  # as which a body without a shape is drawn
    assert rod.mass == pytest.approx(mass_properties_of(rod.shapes, 1000).mass)


def faces(n):
    """Return a tetrahedron in STL, of its first `n` faces."""
    corners, rows = (
        np.vstack((np.zeros(3), np.eye(3))),
        [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    )
    return trimesh.Trimesh(corners, rows[:n]).export(file_type="stl")


@pytest.fixture
def upload(state, tmp_path, monkeypatch):
    """A function (name, content) -> the state after the upload of this mesh for body 2."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    return lambda name, content: answered(
        state, do.UploadMesh(ME, ("2",), name, base64.b64encode(content).decode())
    )


def test_a_mesh_file_becomes_the_shape_and_gives_the_mass(upload):
    now = upload("tetra.stl", faces(4))
    assert now.model.body("2").shape.kind == "mesh"
    assert "4 faces" in notice(now)
    filled = answered(now, do.FillFromShape(ME, 1, ("2",), "600"))
    assert filled.model.body("2").mass == pytest.approx(100.0)
    assert filled.model.body("2").com == pytest.approx((0.25, 0.25, 0.25))
    opened = upload("open.stl", faces(3))  # it has no volume
    assert "closed" in notice(opened)
    assert opened.model.body("2").shape.kind == "mesh"


@pytest.mark.parametrize(("edges", "told"), [((1, 1, 4), False), ((1, 1, 6), True)])
def test_a_mesh_that_is_long_along_any_edge_may_be_in_millimetres(upload, edges, told):
    solid = trimesh.creation.box(edges).export(file_type="stl")
    assert ("millimetres" in notice(upload("a.stl", solid))) == told


@pytest.mark.parametrize(
    ("name", "content", "part"),
    [("broken.stl", b"solid nothing here", "broken.stl"), ("../../etc/x.obj", b"v 0 0", "x.obj")],
)
def test_a_broken_mesh_is_refused_by_name(upload, state, tmp_path, name, content, part):
    now = upload(name, content)
    assert now.model is state.model
    assert part in notice(now)
    assert not any(p.is_file() for p in tmp_path.rglob("*"))


def test_an_errand_is_answered_beside_the_store_and_dropped_for_another_model(state):
    asked = after(state, do.UploadMesh(ME, ("2",), "a.txt", ""))
    heard = []
    Errands(heard.append).render(state, asked)
    assert ".txt" in until(lambda: heard, "the answer")[0].problem
    edited = edit(asked, "mass", ((), "2"))
    late = after(edited, do.ErrandDone(1, Found(changes={"2": {"mass": 9.0}})))
    assert late.model is edited.model
    assert notice(late)


@pytest.mark.parametrize(
    ("field", "index", "text", "value"),
    [
        ("name", (), "crane", lambda m: m.name == "crane"),
        ("gravity", (2,), "-1.62", lambda m: m.gravity == (0, 0, -1.62)),
        ("up", (), "y", lambda m: m.up == "y" and m.gravity == (0, -9.81, 0)),
        ("friction", (), "0.8", lambda m: m.ground.friction == 0.8),
        ("slope", (), "10 deg", lambda m: m.ground.slope == pytest.approx(math.pi / 18)),
        ("uphill", (1,), "1", lambda m: m.ground.uphill == (1.0, 1.0, 0.0)),
        ("steps", (), "", lambda m: len(m.ground.steps) == 1),
    ],
)
def test_properties_of_the_model(state, field, index, text, value):
    now = after(state, do.EditWorld(ME, 1, field, ((index, text),)))
    assert reply(now) == ""
    assert value(now.model)
    assert len(now.undo) == 1
    if field == "steps":
        high, out = (do.EditWorld(ME, 1, field, (e,)) for e in (((0, 4), "0.25"), ((0,), "")))
        assert after(now, high).model.ground.steps[0].height == 0.25
        assert after(now, high, out).model.ground.steps == ()


def summaries(state, *names):
    sent = properties(state, names, state.clients[ME].display)
    return {group["title"]: group["state"] for group in sent["groups"]}


@pytest.mark.parametrize(("angle", "said"), [("rad", "0.3491 rad"), ("deg", "20 deg")])
def test_the_summary_of_the_ground_follows_its_fields(state, angle, said):
    """It read "level" under a slope. What nothing touches is left out."""
    state = display(state, angle=angle)
    assert "Ground" not in summaries(state)
    ball = pg.Shape(kind="sphere", radius=0.1)
    model = pg.Model(bodies=[pg.Body(name="b", shape=ball)], contacts=[pg.Contact(body="b")])
    assert summaries(display(begun(model), angle=angle))["Ground"] == "level"
    sloped = after(state, do.EditWorld(ME, 1, "slope", (((), "20 deg"),)))
    assert said in summaries(sloped)["Ground"]
    stepped = after(sloped, do.EditWorld(ME, 1, "steps", (((), ""),)))
    assert summaries(stepped)["Ground"] not in ("level", summaries(sloped)["Ground"])
    back = after(sloped, do.EditWorld(ME, 1, "slope", (((), "0"),)))
    assert back.model.ground == pg.Ground() or "level" in summaries(back)["Ground"]
    assert summaries(after(state, do.EditParameter(ME, 1, "thigh", "0.3")))["Parameters"] == "1"


@pytest.mark.parametrize(
    ("title", "field", "text"),
    [
        ("Limits, springs", "limits", "-1"), ("Limits, springs", "stiffness", "3"),
        ("Limits, springs", "armature", "0.1"), ("Initial state", "v", "2"),
    ],
)  # fmt: skip
def test_the_summary_of_a_group_follows_its_fields(state, title, field, text):
    index = (0, 0) if field == "limits" else (0,)
    empty = summaries(state, "2")[title]
    now = edit(state, field, (index, text))
    assert reply(now) == ""
    given = summaries(now, "2")[title]
    assert given != empty == summaries(now, "3")[title]
    assert summaries(now, "2", "3")[title] not in (given, empty)


def test_one_parameter_for_four_legs(state):
    state = after(state, do.EditParameter(ME, 1, "thigh", "0.3"))
    state = edit(state, "link", ((0,), "=thigh"), bodies=("2", "3", "4"))
    state = edit(state, "com", ((0,), "=thigh/2"), bodies=("2",))
    assert state.model.body("3").link == (0.3, 0, 0)
    state = edit(state, "link", ((1,), "0.1"), bodies=("3",))  # the formula beside it stays
    longer = after(state, do.EditParameter(ME, 1, "thigh", "0.4"))
    assert longer.model.body("3").link == (0.4, 0.1, 0)
    assert longer.model.body("2").com[0] == 0.2
    assert len(longer.undo) == len(state.undo) + 1
    renamed = after(longer, do.RenameParameter(ME, 1, "thigh", "femur"))
    assert renamed.model.parameters == {"femur": 0.4}
    assert {f.text for f in renamed.model.formulas} == {"=femur", "=femur/2"}
    gone = after(renamed, do.DeleteParameter(ME, "femur"))
    assert gone.model.formulas == ()
    assert gone.model.body("3").link[0] == 0.4


@pytest.mark.parametrize(
    ("text", "of", "value"),
    [("0.2/2", "length", 0.1), ("2*(1 + 0.5)", "number", 3.0), ("2 t", "mass", 2000.0),
     ("250 g", "mass", 0.25), ("15 deg", "angle", math.radians(15)), ("100/4 mm", "length", 0.025),
     ("pi/2", "angle", math.pi / 2), ("2^3", "number", 8.0), ("-(1e-3)", "number", -1e-3)],
)  # fmt: skip
def test_arithmetic_and_units_in_a_cell(text, of, value):
    assert cells.quantity(text, of, Display()) == pytest.approx(value, rel=1e-15)


def test_derived_mass_properties_follow_the_shapes_until_they_are_typed(state):
    shaped = edit(state, "shape_kind", ((), "box"))
    filled = after(shaped, do.FillFromShape(ME, 1, ("2",), "1000"))
    body = filled.model.body("2")
    assert body.derived == ("mass", "com", "inertia")
    longer = edit(filled, "shape_size", ((2,), "0.5"))
    ratio = 0.5 / body.shape.size[2]
    now = longer.model.body("2")
    assert now.mass == pytest.approx(ratio * body.mass)
    assert forms.moments(now.inertia)[2] > forms.moments(body.inertia)[2] * ratio
    heavy = edit(longer, "mass", ((), "2 t")).model.body("2")
    assert heavy.mass == 2000
    assert heavy.derived == ("com", "inertia")
    np.testing.assert_allclose(
        np.array(heavy.inertia), np.array(now.inertia) * 2000 / now.mass, rtol=1e-12
    )


def test_a_body_without_a_shape_gets_a_rod_that_its_inertia_follows(state):
    now = edit(state, "derived", ((), "inertia")).model.body("2")
    assert now.shape.kind == "capsule"
    assert now.derived == ("inertia",)
    m, (a, b, c) = now.mass, forms.moments(now.inertia)
    length = now.shape.length + 2 * now.shape.radius
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
    elsewhere = edit(edit(rod, "shape_length", ((), "0.05")), "shape_radius", ((), "5 mm"))
    assert elsewhere.model.body("2").shape.length == 0.05


def test_a_contact_at_points_is_reported_when_its_body_gets_a_shape(state):
    """Made without one it touches at the tip, and goes on to do so."""
    points = pg.Contact(name="grip", body="2", points=((0, 0, 0.5),))
    other = pg.Contact(name="floor", body="3", points=((0, 0, 0.5),))
    state = replace(state, model=state.model.add(points).add(other))
    shaped = edit(state, "shape_kind", ((), "box"))
    assert "grip" in notice(shaped)
    assert "floor" not in notice(shaped)


def test_every_shape_of_a_body_has_a_form(state):
    state = edit(state, "shape_kind", ((), "box"))
    state = edit(state, "shape_1_kind", ((), "sphere"))
    state = edit(state, "shape_1_radius", ((), "0.2/2"))
    state = edit(state, "shape_1_role", ((), "visual"))
    state = edit(state, "shape_1_colour", ((), "#ff8000"))
    state = edit(state, "shape_1_position", ((1,), "30 mm"))
    box, ball = state.model.body("2").shapes
    assert (box.kind, box.role) == ("box", "both")
    assert (ball.kind, ball.radius, ball.role, ball.position[1]) == ("sphere", 0.1, "visual", 0.03)
    assert ball.colour == pytest.approx((1, 128 / 255, 0))
    assert "shape_1_radius" in fields_of(state, "2")
    angles = (((0,), "90 deg"), ((1,), "0"), ((2,), "0"))
    turned = edit(display(state, turn="euler"), "shape_rotation_euler", *angles)
    half = math.sqrt(0.5)
    assert turned.model.body("2").shape.rotation == pytest.approx((half, half, 0, 0))
    assert len(edit(state, "shape_1_kind", ((), "none")).model.body("2").shapes) == 1


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
    model = after(state, do.EditBodies(ME, 1, ("arm",), "body_length", (((), "1 m"),))).model
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


@pytest.mark.parametrize("tip", [(-0.6, 0, 0), (0, 0, 0.6)])
def test_the_edges_of_a_new_box_are_along_the_axes_of_its_body(state, tip):
    model = state.model.edit("2", tip=tip, com=tuple(x / 2 for x in tip))
    for first in ("none", "capsule", "cylinder"):
        new = edit(replace(state, model=model), "shape_kind", ((), first))
        new = edit(new, "shape_kind", ((), "box"))
        box = new.model.body("2").shape
        assert box.rotation == (1.0, 0.0, 0.0, 0.0)
        longest = max(range(3), key=lambda i: box.size[i])
        assert (longest, box.size[longest]) == (int(np.argmax(np.abs(tip))), pytest.approx(0.6))
        rod = edit(new, "shape_kind", ((), "capsule")).model.body("2").shape
        assert abs(matrix(rod.rotation)[:, 2] @ np.array(tip)) == pytest.approx(0.6)
        assert rod.length + 2 * rod.radius == pytest.approx(0.6)
    oblique = state.model.edit("2", tip=(0.3, 0, 0.4), com=(0.15, 0, 0.2))
    box = edit(replace(state, model=oblique), "shape_kind", ((), "box")).model.body("2").shape
    np.testing.assert_allclose(matrix(box.rotation)[:, 2], (0.6, 0, 0.8), atol=1e-12)
    assert box.size[2] == pytest.approx(0.5)


@pytest.mark.parametrize("motions", [["curve"], ["curve", "rotate"], ["rotate", "curve"]])
def test_a_curve_in_a_compound_joint_has_no_axis_on_the_form(motions):
    track = pg.Track(points=[(0, 0, 0), (1, 0, 0.5)])
    pairs = [(kind, (0, 1, 0)) for kind in motions]
    body = pg.Body(name="a", joint="compound", motions=pairs, track=track)
    groups = properties(begun(pg.Model(bodies=[body])), ("a",), Display())["groups"]
    fields = [f["field"] for group in groups for f in group["fields"]]
    found = [name for name in fields if name in ("motions", "axes")]
    assert found == [x for kind in motions for x in ("motions", *["axes"] * (kind == "rotate"))]


def test_a_compound_joint_gets_motions_one_by_one_and_limits_are_left_open(state):
    limited = state
    for entry, limits in ((((0, 0), "-1"), ((-1.0, None),)), (((0, 1), "1"), ((-1.0, 1.0),))):
        limited = edit(limited, "limits", entry)
        assert limited.model.body("2").limits == limits
    assert edit(limited, "limits", ((0, 0), ""), ((0, 1), "")).model.body("2").limits == ()
    state = edit(state, "joint", ((), "compound"))
    assert [m for m, _ in state.model.body("2").motions] == ["ball", "translate"]
    state = edit(edit(state, "motions", ((0,), "rotate")), "motions", ((), "translate"))
    assert [m for m, _ in state.model.body("2").motions] == ["rotate", "translate", "translate"]
    state = edit(state, "axes", ((0, 0), "1"), ((0, 2), "0"))
    assert state.model.body("2").axes[0] == (1.0, 0.0, 0.0)
    state = edit(state, "motions", ((1,), ""))
    assert state.model.body("2").dof == 2
    for _ in range(2):
        state = edit(state, "motions", ((0,), ""))
    assert "weld" in reply(state)  # the last one stays


def test_a_half_typed_inertia_is_checked_and_a_repair_offered(state):
    bad = edit(state, "inertia", ((2, 2), "1"), kind=do.Check)
    assert bad.model is state.model
    assert bad.clients[ME].reply.offer
    for text in ("1e", "3.5e-3"):
        assert reply(edit(bad, "inertia", ((2, 2), text), kind=do.Check)) == ""
    ball = edit(state, "joint", ((), "spherical"))
    refused = edit(ball, "q", ((0,), "1"), ((1,), "1"))
    assert refused.model is ball.model
    assert refused.clients[ME].reply.offer
    mended = edit(refused, "q", ((0,), "1"), ((1,), "1"), kind=do.Mend)
    assert math.hypot(*mended.model.body("2").q) == pytest.approx(1.0)


def test_a_body_keeps_its_track_with_another_parent(state):
    curved = edit(state, "joint", ((), "curve"))
    moved = edit(curved, "parent", ((), "ground")).model.body("2")
    assert (moved.parent, moved.track) == ("ground", curved.model.body("2").track)


def test_a_curve_begins_with_a_track_whose_points_are_typed(state):
    curved = edit(state, "joint", ((), "curve"))
    assert curved.model.body("2").track.points
    typed = edit(curved, "track_points", ((), "0 0 0; 500mm 0 0.1; 1 0 0"))
    assert typed.model.body("2").track.points == ((0, 0, 0), (0.5, 0, 0.1), (1, 0, 0))
    rows = fields_of(typed, "2")
    assert rows["track_points"]["cells"][0]["value"] == "0 0 0; 0.5 0 0.1; 1 0 0"
    turning = edit(typed, "track_up", ((), "0 0 1"))
    assert turning.model.body("2").track.up == (0, 0, 1)
    assert "3 numbers" in reply(edit(typed, "track_points", ((), "0 0; 1 1")))
    assert "cusp" in reply(edit(typed, "track_points", ((), "0 0 0; 1 0 0; 0 0 0")))
    straight = edit(turning, "joint", ((), "revolute"))
    assert straight.model.body("2").track is None


def test_the_functions_of_a_track_are_typed(state):
    knee = pg.Track(angles=["q"], axes=[(0, 1, 0)], x=[(0, 0), (1, 0.1), (2, 0)])
    two = state.model.edit("2", joint="curve", track=knee)
    state = begun(two)
    rows = fields_of(state, "2")
    assert rows["track_x"]["cells"][0]["value"] == "0 0; 1 0.1; 2 0"
    assert rows["track_angles"]["cells"][0]["value"] == "q"
    changed = edit(state, "track_z", ((), "0.1*sin(q)"))
    assert changed.model.body("2").track.z == "0.1*sin(q)"
    assert "reads only q" in reply(edit(state, "track_z", ((), "sin(w)")))


@pytest.mark.parametrize(
    ("axes", "labels"),
    [
        ([(0, 0, 1)], ["about z"]),
        ([(0, 0, -2)], ["angle"]),
        ([(-0.06, 0.002, 0.998)], ["angle"]),
        ([(1, 0, 0), (0, 1, 1)], ["about x", "axis 2"]),
    ],
)
def test_a_coordinate_is_called_by_its_axis(axes, labels):
    joint = "revolute" if len(axes) == 1 else "universal"
    body = pg.Body(name="a", joint=joint, axes=axes, mass=1.0, inertia=(1, 1, 1))
    assert [label for label, _ in degrees(body)] == labels


def test_a_mass_that_leaves_a_given_inertia_says_so():
    """A mass of 500 kg kept the inertia of 1 kg, folded away and silent."""
    state = begun(pg.Model.serial(2))
    typed = after(state, do.EditBodies(ME, 1, ("2",), "mass", (((), "500"),)))
    assert typed.model.body("2").inertia == state.model.body("2").inertia
    assert all(word in notice(typed) for word in ("'2'", "inertia", "From shape"))
    filled = after(state, do.FillFromShape(ME, 1, ("2",), "1000"))
    heavier = after(filled, do.EditBodies(ME, 2, ("2",), "mass", (((), "500"),)))
    assert notice(heavier) == ""
    assert heavier.model.body("2").inertia != filled.model.body("2").inertia
