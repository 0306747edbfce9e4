"""The form of a point on a curve: points with units, functions, closed or not, and its drawing."""

import math

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.constraints.view import constraints
from pgraph_app.scene.marks import tracks

from .store import ME, after, begun, do, reply

BODIES = (
    pg.Body(name="plate", link=(0, 0, 1)),
    pg.Body(name="pin", joint="free", q=(0.1, 0, 0.3, 1, 0, 0, 0)),
)


def slot(*edits):
    """The state after a slot of the plate was added, with what is typed into its rows."""
    state = begun(pg.Model(bodies=BODIES))
    state = after(
        state, do.AddPart(ME, "constraints", "curve_point", "pin"), do.PickName(ME, "plate")
    )
    for field, text in edits:
        edit = do.EditPart(ME, 1, "constraints", "curve_point", field, (((), text),))
        state = after(state, edit)
    return state


def test_a_new_curve_begins_at_the_tip():
    (c,) = slot().model.constraints
    tip = np.array((0.1, 0, 0.3)) + BODIES[1].tip_point - (0, 0, 1)
    assert c.curve.points[0] == pytest.approx(tip)
    assert pg.Mechanism(slot().model).mobility().dof > 0


def test_points_are_typed_with_units_and_may_close():
    state = slot(("track_points", "0 0 0; 10cm 0 0; 0.1 0 50mm"), ("track_closed", "yes"))
    (c,) = state.model.constraints
    assert c.curve == pg.Track(points=((0, 0, 0), (0.1, 0, 0), (0.1, 0, 0.05)), closed=True)
    form = constraints(state, state.clients[ME])["lists"][0]["items"][0]["form"]
    shown = {f["field"]: f for group in form for f in group["fields"]}
    assert {"track_points", "track_closed"} <= {*shown}
    text = shown["track_points"]["cells"][0]["value"]
    assert slot(("track_points", text), ("track_closed", "yes")).model == state.model


def test_functions_are_typed():
    model = slot().model
    (c,) = model.constraints
    ring = pg.Track(x="cos(q)", z="sin(q)", range=(0, 2 * math.pi), closed=True)
    state = begun(model.replace(constraints=[c.model_copy(update={"curve": ring})]))
    edit = do.EditPart(ME, 1, "constraints", "curve_point", "track_x", (((), "2*cos(q)"),))
    (c,) = after(state, edit).model.constraints
    assert c.curve.x == "2*cos(q)"
    assert c.curve.at(0.0)[0] == pytest.approx((2, 0, 0))


@pytest.mark.parametrize(
    ("text", "fact"), [("0 0; 1 0 0", "3 numbers"), ("0 0 0; 0 0 0", "equal"), ("", "3 numbers")]
)
def test_a_text_that_is_no_curve_is_refused(text, fact):
    state = slot(("track_points", text))
    assert fact in reply(state)
    assert state.model == slot().model


def test_the_curve_is_drawn_in_the_frame_of_its_body():
    state = slot(("track_points", "0 0 0; 1 0 0"))
    (number,) = tracks(state)
    assert state.derived.names[number - 1] == "plate"
    assert tracks(state)[number][0, 0] == pytest.approx((0, 0, 0))
    assert tracks(state)[number][-1, 1] == pytest.approx((1, 0, 0))
