"""The form of a relation: points with units, polynomials, expressions of the other coordinate."""

import math

import pytest

import pgraph_core as pg
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


def test_a_new_relation_begins_at_the_present_coordinates():
    curve = related().model.constraints[0].curve
    assert (curve.x[0], curve.value[0]) == (0.3, 0.1)


@pytest.mark.parametrize("kind", ["natural", "clamped", "quintic"])
def test_points_are_typed_with_units(kind):
    state = related("0 0; 90deg 12mm; 180deg 20mm", kind)
    curve = state.model.constraints[0].curve
    assert curve.kind == kind
    assert curve.x == pytest.approx((0.0, math.pi / 2, math.pi))
    assert curve.value == pytest.approx((0.0, 0.012, 0.02))
    form = constraints(state, state.clients[ME])["lists"][0]["items"][0]["form"]
    shown = {f["field"]: f for group in form for f in group["fields"]}
    assert {*pg.Relation.model_fields, "function"} - {"active"} == {*shown}
    text = shown["curve"]["cells"][0]["value"]
    assert related(text, kind).model.constraints[0].curve == pg.Curve(
        x=[float(f"{x:.12g}") for x in curve.x], value=curve.value, kind=kind
    )
    drawn = shown["curve"]["curve"]
    assert drawn["value"][0] == 0.0
    assert drawn["value"][-1] == pytest.approx(0.02)


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
