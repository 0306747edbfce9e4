"""The form of a relation: points with units, polynomials, expressions of the other coordinate."""

import math
from dataclasses import replace

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.constraints import pictures
from pgraph_app.constraints.view import constraints
from pgraph_app.signals import Moment, Vocabulary

from .store import ME, after, begun, do, reply

BODIES = (
    pg.Body(name="cam", q=(0.3,)),
    pg.Body(name="follower", joint="prismatic", axes=[(0, 0, 1)], q=(0.1,)),
    pg.Body(name="other cam"),
)


def related(text=None, kind=None):
    """The state after a relation was added, with a kind and a text."""
    state = begun(pg.Model(bodies=BODIES))
    state = after(
        state, do.AddPart(ME, "constraints", "relation", "follower"), do.PickName(ME, "cam")
    )
    assert len(state.model.constraints) == 1
    for field, typed in (("function", kind), ("curve", text)):
        if typed is not None:
            edit = do.EditPart(ME, 1, "constraints", "relation", field, (((), typed),))
            state = after(state, edit)
    return state


def fields(state):
    """The rows of the form of the constraint, by field."""
    form = constraints(state, state.clients[ME])["lists"][0]["items"][0]["form"]
    return {f["field"]: f for group in form for f in group["fields"]}


def curve_field(state):
    return fields(state)["curve"]


def test_a_new_relation_begins_at_the_present_coordinates():
    curve = related().model.constraints[0].curve
    assert (curve.x[0], curve.value[0]) == (0.3, 0.1)


def test_points_of_a_hermite_curve_have_slopes_and_begin_with_those_of_the_kind_before():
    state = related("0 0; 90deg 12mm; 180deg 20mm", "natural")
    curve = state.model.constraints[0].curve
    edit = do.EditPart(ME, 1, "constraints", "relation", "function", (((), "hermite"),))
    found = after(state, edit).model.constraints[0].curve
    assert found.values(np.linspace(0, 3, 9)) == pytest.approx(curve.values(np.linspace(0, 3, 9)))
    typed = related("0 0 1; 90deg 12mm 0.5", "hermite").model.constraints[0].curve
    assert (typed.kind, typed.slope) == ("hermite", (1.0, 0.5))


@pytest.mark.parametrize("kind", ["natural", "clamped", "quintic"])
def test_points_are_typed_with_units(kind):
    state = related("0 0; 90deg 12mm; 180deg 20mm", kind)
    curve = state.model.constraints[0].curve
    assert curve.kind == kind
    assert curve.x == pytest.approx((0.0, math.pi / 2, math.pi))
    assert curve.value == pytest.approx((0.0, 0.012, 0.02))
    shown = fields(state)
    assert {*pg.Relation.model_fields, "function"} - {"active"} == {*shown}
    text = shown["curve"]["cells"][0]["value"]
    assert related(text, kind).model.constraints[0].curve == curve
    drawn, slope = shown["curve"]["curve"]["lines"]
    assert (drawn["dots"]["t"], drawn["dots"]["y"]) == ([*curve.x], pytest.approx([*curve.value]))
    assert (drawn["y"][0], drawn["y"][-1]) == pytest.approx((0.0, 0.02))
    rise = np.trapezoid(slope["y"], slope["t"])  # of 121 points, with bends at the knots
    assert rise == pytest.approx(0.02, rel=1e-3)
    assert slope["title"] == "slope [m/rad]"


def test_points_are_shown_in_the_units_of_the_page():
    state = related("0 0; 90deg 12mm; 180deg 20mm")
    state = after(state, do.SetDisplay(ME, "angle", "deg"), do.SetDisplay(ME, "length", "mm"))
    shown = curve_field(state)
    assert shown["cells"][0]["value"] == "0 0; 90 12; 180 20"
    assert "[deg] [mm]" in shown["note"]
    drawn, slope = shown["curve"]["lines"]
    assert (drawn["t"][-1], drawn["y"][-1]) == pytest.approx((180, 20))
    assert shown["curve"]["unit"] == "deg"
    assert max(slope["y"]) == pytest.approx(0.02 / math.pi, rel=0.5)  # in SI
    edit = do.EditPart(ME, 1, "constraints", "relation", "curve", (((), "0 0; 45 5; 90 12"),))
    curve = after(state, edit).model.constraints[0].curve
    assert curve.x == pytest.approx((0.0, math.pi / 4, math.pi / 2))
    assert curve.value == pytest.approx((0.0, 0.005, 0.012))


@pytest.mark.parametrize(
    ("text", "kind", "value", "slope"),
    [("=0.02*(1-cos(q.cam))", None, lambda x: 0.02 * (1 - np.cos(x)), lambda x: 0.02 * np.sin(x)),
     ("0.1 0 0.5", "polynomial", lambda x: 0.1 + 0.5 * x**2, lambda x: x),
     ("=0.1*sqrt(q)", None, lambda x: 0.1 * np.sqrt(x), lambda x: 0.05 / np.sqrt(x))],
)  # fmt: skip
def test_a_formula_is_drawn_over_the_turn_of_now_with_its_slope(text, kind, value, slope):
    shown = curve_field(related(text, kind))
    drawn, rate = ((np.array(one["t"]), np.array(one["y"])) for one in shown["curve"]["lines"])
    low = 0.0 if "sqrt" in text else -math.pi  # a root has no value before 0
    assert (drawn[0][0], drawn[0][-1]) == (low, math.pi)
    assert drawn[1] == pytest.approx(value(drawn[0]), abs=1e-12)
    inner = rate[0] > 0.5  # the slope of a root is steep near 0
    error = 1e-8 * max(abs(rate[1]))  # of differences over eps^(1/3) of the range
    assert rate[1][inner] == pytest.approx(slope(rate[0][inner]), abs=error)


def test_the_picture_moves_on_with_a_wheel_that_turns_and_stays_at_limits():
    state = related("=0.1*q")
    turned = after(state, do.MoveJoint(ME, 1, "cam", 0, "7"))
    assert pictures.window(turned, turned.model.constraints[0]) == pytest.approx(
        (math.pi, 3 * math.pi)
    )
    limited = replace(state, model=state.model.edit("cam", limits=(-0.5, 0.5)))
    assert pictures.window(limited, limited.model.constraints[0]) == (-0.5, 0.5)


def mark(state):
    """The place of the mark of the open relation, None without positions or an open relation."""
    found = pictures.present(state, state.clients[ME])
    return found["at"] if isinstance(found, dict) else None


def test_a_mark_shows_both_joints_at_the_pose_shown():
    state = related("0 0; 90deg 12mm; 180deg 0", "periodic")
    assert mark(state) == pytest.approx([0.3, 0.1])
    assert mark(replace(state, model=state.model.replace(constraints=()))) is None
    turned = pg.Model(bodies=[pg.Body(name="cam", q=(7.0,)), *BODIES[1:]])
    turned = turned.replace(constraints=state.model.constraints)
    at = mark(replace(state, model=turned))
    assert at == pytest.approx([7.0 - 2 * math.pi, 0.1])  # two periods of half a turn each
    assert mark(after(state, do.OpenPart(ME, "constraints", None))) is None


def test_the_banner_asks_for_what_follows_and_then_for_what_it_follows():
    state = after(begun(pg.Model(bodies=BODIES)), do.AddPart(ME, "constraints", "relation", None))
    texts = []
    for name in ("follower", "cam"):
        texts.append(constraints(state, state.clients[ME])["picking"]["text"])
        state = after(state, do.Select(ME, name))
    assert "click the body that follows" in texts[0]
    assert "'follower': click the body that it follows" in texts[1]
    (relation,) = state.model.constraints
    assert (relation.body, relation.other) == ("follower", "cam")


def test_motions_of_both_joints_are_chosen_by_their_axes():
    state = begun(pg.Model(bodies=(*BODIES[:2], pg.Body(name="arm", joint="universal"))))
    state = after(state, do.AddPart(ME, "constraints", "gear", "follower"), do.PickName(ME, "arm"))
    shown = fields(state)
    assert shown["coordinate"]["options"] == [("0", "along z")]
    assert [text for _, text in shown["other_coordinate"]["options"]] == ["about x", "about y"]
    edit = do.EditPart(ME, 1, "constraints", "gear", "other_coordinate", (((), "1"),))
    assert after(state, edit).model.constraints[0].other_coordinate == 1


def test_every_kind_of_curve_is_chosen_and_typed():
    assert related("0 1 -0.5", "polynomial").model.constraints[0].curve == pg.Polynomial(
        coefficients=(0, 1, -0.5)
    )
    assert related("=0.02*(1-cos(q.cam))").model.constraints[0].curve == "=0.02*(1-cos(q.cam))"
    state = related(None, "periodic")
    assert state.model.constraints[0].curve.kind == "periodic"
    for kind in ("natural", "polynomial", "expression", "quintic"):
        edit = do.EditPart(ME, 1, "constraints", "relation", "function", (((), kind),))
        state = after(state, edit)
        assert reply(state) == ""


@pytest.mark.parametrize(
    ("text", "fact"),
    [("0 0 1", "0 0; 90deg 12mm"), ("0 0; 0 1", "ascend"), ("0 0; 1 3deg", "deg"),
     ("=t", "q.cam"), ("=max(q, 0)", "corner"), ("0", "90deg 12mm"), ("", "x")],
)  # fmt: skip
def test_a_text_that_is_no_curve_is_refused(text, fact):
    state = related(text)
    assert fact in reply(state)
    assert state.model == related().model


def test_an_expression_follows_its_other_body():
    state = related("=0.1*sin(q.cam)")
    edit = do.EditPart(ME, 1, "constraints", "relation", "other", (((), "other cam"),))
    (relation,) = after(state, edit).model.constraints
    assert relation.curve == '=0.1*sin(q["other cam"])'
    (renamed,) = state.model.edit("cam", name="wheel").constraints
    assert (renamed.other, renamed.curve) == ("wheel", "=0.1*sin(q.wheel)")


def test_completions_are_the_other_coordinate_and_the_value_is_of_now():
    model = related("=0.1*q").model
    q = {"cam": (0.3,), "follower": (0.1,), "other cam": (0.0,)}
    words = Vocabulary(model, Moment(0.0, q, q), model.constraints[0], "curve", True)
    assert words.hint(1, "=c", 2).words[0].text == "q.cam"
    assert not any(word.text.startswith("v") for word in words.hint(1, "=v", 2).words)
    assert words.hint(1, "=2*q", 4).value.startswith("0.6")
    assert "q.cam" in words.hint(1, "=q.follower", 11).problem
