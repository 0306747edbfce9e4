"""The form of a cam: segments and points with units, and lengths that belong to its follower."""

import math

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.constraints import pictures
from pgraph_app.constraints.view import constraints
from pgraph_app.plots import Signal, curves, of_scene
from pgraph_app.pose import poses
from pgraph_app.scene import camera, marks
from pgraph_core.show import shapes

from .store import ME, after, begun, do, ran, reply

BODIES = (
    pg.Body(name="cam", axes=[(0, 1, 0)]),
    pg.Body(name="follower", joint="prismatic", axes=[(0, 0, 1)], link=(0, 0, 0.1)),
    pg.Body(name="arm", axes=[(0, 1, 0)], link=(0.12, 0.05, 0)),
)


def added(body="follower"):
    """The state after a cam was added."""
    state = begun(pg.Model(bodies=BODIES))
    return after(state, do.AddPart(ME, "constraints", "cam", body), do.PickName(ME, "cam"))


def typed(state, field, text):
    return after(state, do.EditPart(ME, 1, "constraints", "cam", field, (((), text),)))


def shown(state):
    form = constraints(state, state.clients[ME])["lists"][0]["items"][0]["form"]
    return {f["field"]: f for group in form for f in group["fields"]}


@pytest.mark.parametrize("body", ["follower", "arm"])
def test_a_new_cam_is_of_the_size_of_the_model(body):
    state = added(body)
    (cam,) = state.model.constraints
    far = 0.1 if body == "follower" else 0.12
    assert cam.base_radius == pytest.approx(0.5 * far)
    assert cam.distance == (None if body == "follower" else pytest.approx(far))
    assert cam.motion[0].lift > 0.0


@pytest.mark.parametrize(
    ("text", "fields"),
    [
        ("90deg 20mm cycloidal; 60deg 0.02; 90deg 0 modified sine; rest 0",
         [(math.pi / 2, 0.02, "cycloidal"), (math.pi / 3, 0.02, "3-4-5"),
          (math.pi / 2, 0.0, "modified sine"), (None, 0.0, "3-4-5")]),
        ("3 0.01; rest 0 4-5-6-7", [(3.0, 0.01, "3-4-5"), (None, 0.0, "4-5-6-7")]),
    ],
)  # fmt: skip
def test_segments_are_typed_with_units(text, fields):
    state = typed(added(), "motion", text)
    (cam,) = state.model.constraints
    assert [(one.lift, one.law) for one in cam.motion] == [(h, law) for _, h, law in fields]
    for one, (angle, *_) in zip(cam.motion, fields):
        assert one.angle == (None if angle is None else pytest.approx(angle))
    found = shown(state)
    assert not found.keys() & {"roller_radius", "arm", "distance", "coordinate"}
    again = typed(state, "motion", found["motion"]["cells"][0]["value"])
    assert reply(again) == ""
    for one, other in zip(again.model.constraints[0].motion, cam.motion):
        assert one.angle == (None if other.angle is None else pytest.approx(other.angle))
        assert (one.lift, one.law) == (other.lift, other.law)
    (lift, pressure) = found["motion"]["curve"]["lines"]
    assert max(lift["y"]) == pytest.approx(max(h for _, h, _ in fields))
    assert max(pressure["y"]) > 0.0


def test_a_lift_by_segments_becomes_one_by_points_and_back():
    state = typed(added(), "lift_is", "points")
    assert isinstance(state.model.constraints[0].motion, pg.Curve)
    state = typed(state, "motion", "0 0; 90deg 12mm; 180deg 20mm; 270deg 12mm; 360deg 0")
    (cam,) = state.model.constraints
    assert cam.motion.value == pytest.approx((0.0, 0.012, 0.02, 0.012, 0.0))
    assert shown(state)["motion"]["cells"][0]["value"].endswith("; 6.283185307179586 0")
    state = typed(state, "lift_is", "segments")
    assert [one.lift for one in state.model.constraints[0].motion] == [0.02, 0.0]


@pytest.mark.parametrize("body", ["follower", "arm"])
@pytest.mark.parametrize("kind", ["knife", "roller", "flat"])
@pytest.mark.parametrize("before", ["knife", "roller", "flat"])
def test_each_follower_is_chosen_with_its_lengths(body, kind, before):
    lift = "150deg 5mm; rest 0" if body == "follower" else "150deg 3deg; rest 0"
    state = typed(typed(typed(added(body), "motion", lift), "follower", before), "follower", kind)
    assert reply(state) == ""
    (cam,) = state.model.constraints
    assert cam.follower == kind
    assert ("roller_radius" in shown(state)) == (kind == "roller")
    assert ("arm" in shown(state)) == (kind != "flat" and body == "arm")


@pytest.mark.parametrize(
    ("text", "fact"),
    [("90deg 20mm; 60deg 0", "360 degrees"), ("rest 0.02", "lift=0"), ("90deg; rest 0", "law"),
     ("90deg 20mm sine; rest 0", "3-4-5"), ("90mm 20mm; rest 0", "mm"), ("", "90deg 20mm")],
)  # fmt: skip
def test_a_text_that_is_no_lift_is_refused(text, fact):
    state = typed(added(), "motion", text)
    assert fact in reply(state)
    assert state.model == added().model


def test_a_profile_and_a_roller_are_drawn_on_their_bodies():
    state = typed(added(), "follower", "roller")
    (cam,) = state.model.constraints
    lines = marks.tracks(state)
    numbers = [state.derived.number[name] for name in ("cam", "follower")]
    assert [*lines] == numbers
    assert ("tracks", "tracks of curves, profiles of cams") in marks.showable(state)
    assert lines[numbers[0]][:, 0] == pytest.approx(cam.profile(state.model))
    circle = lines[numbers[1]][:, 0]
    assert np.linalg.norm(circle - circle.mean(axis=0), axis=1) == pytest.approx(cam.roller_radius)


def test_the_view_holds_the_profile_that_is_drawn():
    """A new cam, larger than its bodies, reached out of the picture."""
    state = typed(added(), "base_radius", "5")
    (cam,) = state.model.constraints
    reach = np.abs(cam.profile(state.model)).max()
    assert reach > 5.0
    hidden = after(state, do.Show(ME, "tracks", False))
    assert np.ptp(camera.extent(state), axis=0).max() > 2 * reach - 1.0
    assert np.ptp(camera.extent(hidden), axis=0).max() < 5.0


def test_the_force_is_drawn_at_the_contact_and_plotted():
    state = typed(added(), "follower", "roller")
    model = state.model.remove("arm").edit("cam", v=10.0, inertia=(0.1, 0.1, 0.1))
    run = pg.simulate(model, t_end=0.3, frames=31, estimate=False)
    state = ran(begun(model), run)
    positions, wxyz = poses(state)
    (push,) = marks.pushes(state, positions, shapes.to_matrix(wxyz))
    assert push.at == pytest.approx(run.cams["cam"].point[0])
    signals = [Signal("pressure_angle", "cam"), Signal("normal_force", "cam")]
    assert [one for one in of_scene(run) if one.of == "cam"][-2:] == signals
    angle, force = (curves(run, one)[0] for one in signals)
    assert (angle.unit, force.unit) == ("rad", "N")
    assert max(force.y) == pytest.approx(run.cams["cam"].normal_force.max())


def test_the_picture_marks_the_pose_shown_within_one_turn():
    state = added()
    state = after(state, do.MoveJoint(ME, 0, "cam", 0, str(2 * math.pi + 1.0)))
    found = pictures.present(state, state.clients[ME])
    assert found is not None
    assert found["at"][0] == pytest.approx(1.0)
