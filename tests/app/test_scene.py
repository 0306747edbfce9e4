"""What stands in the 3D view, and bodies moved by hand: pure functions and events."""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
import pgraph_models
from pgraph_app.core.events import Misread, from_page
from pgraph_app.core.state import Kernels, initial, poses
from pgraph_app.features import update
from pgraph_app.model.update import Edit, Undo
from pgraph_app.playback.update import Scrub
from pgraph_app.pose import solving as posing
from pgraph_app.pose.solving import WEIGHTS, pull_force
from pgraph_app.pose.update import Gripped, HomePose, MoveJoint, Pull, UsePose
from pgraph_app.run.update import Simulate, Simulated
from pgraph_app.scene import camera, marks
from pgraph_app.scene.update import Unreadable
from pgraph_app.session.update import Connected
from pgraph_core.show import shapes

ME = 1


def opened(model: pg.Model):
    """A state with one page, the fast code compiled."""
    state = update(initial(model), Connected(ME))
    return dataclasses.replace(state, kernels=Kernels(ready=True))


def built_in(name: str):
    return opened(pg.Model.load(pgraph_models.path(name)))


@pytest.fixture
def quadruped():
    return built_in("quadruped")


def pose(state, body, index, value, serial=0):
    return update(state, MoveJoint(ME, serial, body, index, str(value)))


# -- pivots ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "points"),
    [
        ("four_bar", [(0, 0, 0), (1, 0, 0)]),
        ("double_pendulum", [(0, 0, 2.2)]),
        ("quadruped", []),
    ],
)
def test_each_pivot_on_the_ground_has_a_bracket_along_its_axis(name, points):
    found = marks.pivots(built_in(name))
    assert found.ends[:, 1] == pytest.approx(np.reshape(points, (-1, 3)), abs=1e-9)
    R = shapes.to_matrix(found.wxyz)
    assert np.linalg.det(R) == pytest.approx(1.0)
    model = pg.Model.load(pgraph_models.path(name))
    axes = [b.axes[-1] for b in model.bodies if b.parent == "ground" and b.joint == "revolute"]
    assert np.abs(R[:, :, 1]) == pytest.approx(np.abs(np.reshape(axes, (-1, 3))), abs=1e-9)


def test_a_loop_closed_on_the_ground_has_a_bracket_too():
    arm = pg.Body(name="arm", tip=(1, 0, 0), com=(0.5, 0, 0), axes=((0, 0, 1),))
    pin = pg.Constraint(kind="point", name="pin", body="arm", point=(1, 0, 0))
    both = marks.pivots(opened(pg.Model(bodies=(arm,), constraints=(pin,), up="y")))
    assert both.ends[:, 1] == pytest.approx(np.array([(0, 0, 0), (1, 0, 0)]), abs=1e-12)


# -- joint sliders -----------------------------------------------------------------------------


def test_a_slider_poses_the_mechanism_without_changing_the_model(quadruped):
    after = pose(quadruped, "left_femur", 0, 0.5)
    assert after.model is quadruped.model
    assert after.undo == ()
    k = after.derived.number["left_femur"]
    q = posing.shown_q(after)
    assert q[posing._first(after.model, after.model.body("left_femur"))] == 0.5
    expected, _ = pg.Mechanism(after.model).poses(q)
    assert poses(after)[0] == pytest.approx(expected, abs=1e-12)
    assert not np.allclose(poses(after)[0][k], quadruped.derived.positions[k])


def test_use_as_initial_state_is_one_undo_step_and_keeps_the_picture(quadruped):
    after = pose(quadruped, "left_femur", 0, 0.5)
    used = update(after, UsePose(ME))
    assert len(used.undo) == 1
    assert used.model.body("left_femur").q == (0.5,)
    assert poses(used)[0] == pytest.approx(poses(after)[0], abs=1e-12)
    assert update(used, Undo(ME)).model == quadruped.model


@pytest.mark.parametrize("name", ["four_bar", "andrews", "bricard", "slider_crank"])
def test_loops_stay_closed_while_a_slider_moves(name):
    state = built_in(name)
    body = state.model.bodies[0]
    for k in range(1, 6):
        state = pose(state, body.name, 0, body.q[0] + 0.1 * k)
    q = posing.shown_q(state)
    assert state.pose_problem == ""
    assert q[0] == pytest.approx(body.q[0] + 0.5, abs=1e-6)  # the joint in hand is where it was put
    mech = pg.Mechanism(state.model)
    _, _, report = mech.assemble(q, np.zeros(mech.nv))
    assert report.moved < 1e-6


def test_a_slider_says_where_the_loops_cannot_be_closed():
    state = pose(built_in("slider_crank"), "slider", 0, 0.01)
    held = pose(state, "slider", 0, 100.0)
    assert "cannot be moved further: the loops cannot be closed there" in held.pose_problem
    assert held.pose is state.pose


def test_a_coordinate_that_an_edit_took_away_is_said(quadruped):
    """A page may ask before it has heard of the edit."""
    state = pose(quadruped, "left_femur", 1, 0.4)
    assert state.posed is None
    assert state.pose_problem.endswith("its joint has no coordinate 2")


def test_before_the_fast_code_is_there_a_loop_says_so():
    state = dataclasses.replace(built_in("four_bar"), kernels=Kernels())
    assert "still being compiled" in pose(state, "left crank", 0, 1.6).pose_problem


def test_a_pose_goes_when_the_model_changes_and_comes_back_with_undo(quadruped):
    after = pose(quadruped, "left_femur", 0, 0.5)
    edited = update(after, Edit(ME, 7, "pelvis", "mass", (), "9"))
    assert edited.pose is None
    assert update(edited, Undo(ME)).pose is not None
    assert update(after, HomePose(ME)).pose is None


@pytest.mark.parametrize("text", ["", "abc", "1e400", "nan", "1,5", "<b>"])
def test_what_is_typed_beside_a_slider_is_read_strictly(quadruped, text):
    after = pose(quadruped, "left_femur", 0, text, serial=5)
    assert after.pose is None
    assert (
        "must be a number" in after.clients[ME].reply.text
        or "large" in after.clients[ME].reply.text
    )


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from(["spherical", "free", "compound", "universal", "planar", "cylindrical"]),
    st.lists(st.floats(-1.5, 1.5), min_size=6, max_size=6),
)
def test_every_coordinate_of_every_joint_is_a_slider_of_its_own(joint, values):
    motions = {"motions": (("ball", (0, 0, 1)), ("translate", (1, 0, 0)))}
    body = pg.Body(name="a", joint=joint, **(motions if joint == "compound" else {}))
    state = opened(pg.Model(bodies=(body,)))
    count = body.dof
    assert len(posing.coordinates(state)) == count
    for i in range(count):
        state = pose(state, "a", i, values[i])
        assert posing.coordinates(state)[i].value == pytest.approx(values[i], abs=1e-9)


# -- the gizmo ---------------------------------------------------------------------------------


def test_the_gizmo_shows_while_it_is_dragged_and_is_one_undo_step_when_let_go(quadruped):
    state = quadruped
    old = state.model.body("left_femur").link
    for k in range(1, 5):
        moved = (old[0] + 0.01 * k, old[1], old[2])
        state = update(state, Gripped(ME, "left_femur", "link", moved, False))
        assert state.model is quadruped.model
        assert state.clients[ME].grip.vector == pytest.approx(moved)
    assert not np.allclose(poses(state)[0], quadruped.derived.positions)
    shown = poses(state)[0]
    done = update(state, Gripped(ME, "left_femur", "link", moved, True))
    assert len(done.undo) == 1
    assert done.model.body("left_femur").link == pytest.approx(moved)
    assert done.clients[ME].grip is None
    assert poses(done)[0] == pytest.approx(shown)


def test_a_gizmo_let_go_where_it_was_changes_nothing(quadruped):
    com = quadruped.model.body("thorax").com
    assert update(quadruped, Gripped(ME, "thorax", "com", com, True)).undo == ()


def test_what_a_drag_did_not_move_keeps_all_its_digits():
    from pgraph_app.pose.update import rounded

    assert rounded((0.123456789, 0.0, 0.0), (0.123456789, 0.2000012, 0.0), 1.0) == (
        0.123456789, 0.2, 0.0,
    )  # fmt: skip


# -- what is drawn -----------------------------------------------------------------------------


def what(state) -> set[str]:
    return {name for name, _ in marks.showable(state)}


def test_switches_that_a_scene_cannot_use_are_not_there():
    pendulum = opened(pg.Model(bodies=(pg.Body(name="rod", tip=(1, 0, 0)),)))
    assert {"shapes", "axes", "links", "coms", "frames", "names"} <= what(pendulum)
    assert not {"points", "forces", "cones"} & what(pendulum)
    touching = opened(pg.Model(bodies=(BALL,), contacts=(pg.Contact(name="c", body="ball"),)))
    assert {"points", "forces", "cones"} <= what(touching)
    smooth = pg.Contact(name="c", body="ball", friction=0.0)
    assert "cones" not in what(opened(pg.Model(bodies=(BALL,), contacts=(smooth,))))


BALL = pg.Body(
    name="ball", joint="free", mass=2.0, q=(0, 0, 0.1, 1, 0, 0, 0),
    inertia=((0.008, 0, 0), (0, 0.008, 0), (0, 0, 0.008)),
    shape=pg.Shape(kind="sphere", radius=0.1),
)  # fmt: skip


def test_forces_of_contacts_act_on_the_ground_and_stay_in_their_cones():
    state = opened(pg.Model(bodies=(BALL,), contacts=(pg.Contact(name="c", body="ball"),)))
    result = pg.simulate(pg.Mechanism(state.model), t_end=0.05, step=1e-3)
    state = update(update(state, Simulate(ME)), Simulated(1, result))
    state = update(state, Scrub(ME, 0.05))
    positions, wxyz = poses(state)
    (push,) = marks.pushes(state, positions, shapes.to_matrix(wxyz))
    assert push.at == pytest.approx((0, 0, 0), abs=1e-6)
    assert push.force == pytest.approx((0, 0, 2 * 9.81), rel=1e-3)
    metres = marks.scale(state)
    _, size = marks.cones([push], metres, np.array((0.0, 0, 1)))
    (arrow,) = marks.arrows([push], metres)
    tall = size[0, 2]
    assert np.linalg.norm(arrow[1] - arrow[0]) == pytest.approx(tall, rel=1e-3)
    assert size[0, 0] / 2 / tall == pytest.approx(state.model.ground.friction)


def test_what_touches_nothing_has_no_arrow_and_no_cone():
    high = BALL.model_copy(update={"name": "high", "q": (0.5, 0, 9.0, 1, 0, 0, 0)})
    state = opened(pg.Model(bodies=(BALL, high), contacts=(pg.Contact(name="c", body="*"),)))
    result = pg.simulate(pg.Mechanism(state.model), t_end=0.05, step=1e-3)
    state = update(update(state, Simulate(ME)), Simulated(1, result))
    state = update(state, Scrub(ME, 0.05))
    positions, wxyz = poses(state)
    found = marks.pushes(state, positions, shapes.to_matrix(wxyz))
    at, _ = marks.cones(found, marks.scale(state), np.array((0.0, 0, 1)))
    assert at == pytest.approx(np.zeros((1, 3)), abs=1e-6)
    assert marks.arrows(found, marks.scale(state))[:, 0] == pytest.approx(at, abs=1e-6)


def test_a_run_that_leaves_the_picture_is_told_from_one_that_stays():
    """At its start the ball is in the middle; at its end it has fallen out, or rests."""
    thrown = BALL.model_copy(update={"v": (0, 0, 0, 30.0, 0, 0)})
    at = camera.viewpoint(opened(pg.Model(bodies=(BALL,))), 1.0)
    handle = SimpleNamespace(camera=SimpleNamespace(position=at.position, look_at=at.target))
    for ball, left in ((BALL, False), (thrown, True)):
        state = opened(pg.Model(bodies=(ball,), contacts=(pg.Contact(name="c", body="ball"),)))
        result = pg.simulate(pg.Mechanism(state.model), t_end=0.5, step=1e-3)
        state = update(update(state, Simulate(ME)), Simulated(1, result))
        state = update(state, Scrub(ME, 0.5))
        page = dataclasses.replace(state.clients[ME], aspect=1.0)
        assert camera.went(handle, state, page) == left


@pytest.mark.parametrize(("speed", "whole"), [(2.0, True), (1e3, False)])
def test_a_view_holds_what_a_mechanism_does_in_its_run_unless_it_leaves_its_place(speed, whole):
    """A slider along x for 1 s: 2 m of way fit a view of a model of 1 m, 1 km does not."""
    rail = pg.Body(name="rail", mass=1.0, tip=(1, 0, 0), joint="weld")
    slider = pg.Body(name="a", joint="prismatic", axes=(1, 0, 0), mass=1.0, v=speed)
    state = opened(pg.Model(bodies=(rail, slider), gravity=(0, 0, 0)))
    before = np.ptp(camera.extent(state)[:, 0])
    result = pg.simulate(pg.Mechanism(state.model), t_end=1.0, step=1e-2)
    state = update(update(state, Simulate(ME)), Simulated(1, result))
    after = np.ptp(camera.extent(state)[:, 0])
    assert (after > max(before, 0.99 * speed)) == whole
    assert len(camera.passed(state)) > 0 or not whole


@pytest.mark.parametrize("aspect", [0.4, 1.0, 2.0])
def test_an_empty_model_is_seen_from_as_far_as_a_body_of_its_size(aspect):
    """From 2 cm away the squares of the ground, half a metre wide, filled the picture."""
    state = opened(pg.Model(bodies=()))
    position, target = camera.viewpoint(state, aspect)
    assert state.derived.size < np.linalg.norm(position - target) < 10 * state.derived.size


def test_an_impact_leaves_the_arrows_of_what_stands_to_be_seen():
    fallen = BALL.model_copy(update={"q": (0, 0, 0.6, 1, 0, 0, 0)})
    state = opened(pg.Model(bodies=(fallen,), contacts=(pg.Contact(name="c", body="ball"),)))
    result = pg.simulate(pg.Mechanism(state.model), t_end=2.0, step=1e-3)
    forces = result.contact_force["c"][:, 5]
    assert forces.max() > 50 * 2 * 9.81
    state = update(update(state, Simulate(ME)), Simulated(1, result))
    assert marks.scale(state) * 2 * 9.81 > 0.1 * state.derived.size


@settings(max_examples=20, deadline=None)
@given(st.tuples(*(st.floats(0.05, 2.0),) * 3))
def test_the_ellipsoid_of_a_solid_ellipsoid_is_itself(half):
    a, b, c = half
    m = 3.0
    inertia = np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) * m / 5
    body = pg.Body(name="e", mass=m, inertia=inertia.tolist())
    solids = marks.ellipsoids(opened(pg.Model(bodies=(body,))))
    assert sorted(solids.size[0]) == pytest.approx(sorted(2 * x for x in half), rel=1e-6)


def test_a_point_mass_has_no_ellipsoid():
    body = pg.Body(name="p", mass=1.0, inertia=((0, 0, 0),) * 3, tip=(1, 0, 0))
    assert len(marks.ellipsoids(opened(pg.Model(bodies=(body,)))).owner) == 0


def test_a_friction_cone_opens_upwards_from_its_apex():
    solid = shapes.cone()
    low = solid.vertices[np.isclose(solid.vertices[:, 2], 0.0)]
    assert low == pytest.approx(np.zeros((len(low), 3)), abs=1e-12)
    assert solid.bounds[1] == pytest.approx((0.5, 0.5, 1.0), abs=0.01)
    assert solid.volume > 0  # faces look outwards


# -- meshes ------------------------------------------------------------------------------------


def test_a_mesh_is_drawn_as_itself_alone_and_in_batches(tmp_path):
    file = tmp_path / "wedge.stl"
    trimesh.creation.cone(radius=1.0, height=2.0).export(file)
    body = pg.Body(name="a", shape=pg.Shape(kind="mesh", file=str(file), scale=0.5))
    (piece,) = shapes.pieces(body, ())
    alone = shapes.mesh((piece,))
    batched = shapes.unit("mesh", str(file))
    batched.apply_scale(piece.size)
    assert alone.bounds == pytest.approx(batched.bounds)
    assert alone.bounds[1][0] == pytest.approx(0.5, rel=0.02)
    assert shapes.unreadable([body]) == ()


@pytest.mark.parametrize(("name", "said"), [
    ("none.stl", "there is no such file"), ("broken.stl", "cannot be read"), ("a.txt", "no mesh"),
])  # fmt: skip
def test_a_mesh_that_cannot_be_read_is_a_box_and_is_said(tmp_path, name, said):
    if name != "none.stl":
        (tmp_path / name).write_bytes(b"solid \xff\x00 this is no mesh")
    body = pg.Body(name="a", shape=pg.Shape(kind="mesh", file=str(tmp_path / name)))
    assert shapes.mesh(shapes.pieces(body, ())).volume > 0
    (sentence,) = shapes.unreadable([body])
    assert name in sentence
    state = opened(pg.Model(bodies=(body,)))
    notice = update(state, Unreadable((sentence,))).clients[ME].notice
    assert notice is not None
    assert notice.bad
    assert sentence in notice.text


# -- pulling -----------------------------------------------------------------------------------


def test_a_pull_is_towards_the_mouse_is_damped_and_has_a_bound():
    rest, far = np.zeros(3), np.array((100.0, 0, 0))
    near = pull_force(rest, rest, 0.01 * far / 100, mass=10.0)
    assert near[0] > 0
    assert near[1:] == pytest.approx(0.0)
    assert pull_force(rest, 0.01 * far, rest, mass=10.0)[0] < 0
    assert np.linalg.norm(pull_force(rest, rest, far, 10.0)) == pytest.approx(WEIGHTS * 98.1)


def test_a_pull_is_kept_until_it_lets_go(quadruped):
    pulled = update(quadruped, Pull(ME, "thorax", (0, 0, 0), (1.0, 0, 0)))
    assert pulled.pull.target == (1.0, 0, 0)
    assert update(pulled, Pull(ME, "thorax", (0, 0, 0), None)).pull is None


@pytest.mark.parametrize("message", [
    '{"event": "Gripped", "body": "a", "what": "mass", "vector": [0, 0, 0], "done": true}',
    '{"event": "Gripped", "body": "a", "what": "com", "vector": [0, 0, 1e999], "done": true}',
    '{"event": "Pull", "body": "a", "point": [0, 0], "target": [0, 0, 0]}',
    '{"event": "MoveJoint", "serial": 1, "body": "a", "index": 9, "text": "1"}',
    '{"event": "Drop", "serial": 1, "body": "a", "parent": null, "loop": false}',
])  # fmt: skip
def test_unfit_messages_of_a_page_are_refused(message):
    assert isinstance(from_page(ME, message), Misread)


@pytest.mark.parametrize(("typed", "angle"), [(31.0, 30.0), (38.0, 38.0), (-44.0, -45.0)])
def test_the_gizmo_turns_a_body_about_an_axis_and_goes_to_notches(typed, angle):
    """About the parent's y, from an orientation that is turned about x already."""
    first = (math.cos(0.2), math.sin(0.2), 0.0, 0.0)
    model = pg.Model(bodies=(pg.Body(name="a", rotation=first, tip=(1, 0, 0), mass=1.0),))
    state = update(initial(model), Connected(1))

    def turned(degrees: float) -> np.ndarray:
        half = math.radians(degrees) / 2
        y = np.array([math.cos(half), 0.0, math.sin(half), 0.0])
        return shapes.times(y[None], np.array([first]))[0]

    after = update(state, Gripped(1, "a", "rotation", tuple(turned(typed).tolist()), True))
    found = np.asarray(after.model.body("a").rotation)
    wanted = turned(angle)
    np.testing.assert_allclose(found * np.sign(found @ wanted), wanted, atol=1e-9)
    assert after.undo[-1].label == "orientation of a"


def test_a_copy_of_a_body_has_the_solid_of_the_first_and_neither_changes_the_other():
    shape = pg.Shape(kind="capsule", radius=0.1, end_radius=0.05, length=0.4, role="visual")
    moved = shape.model_copy(update={"position": (0.0, 0.0, 0.3)})
    here, there = (shapes.pieces(pg.Body(name="a", shape=s), ()) for s in (shape, moved))
    first = shapes.mesh(here)
    before = first.vertices.copy()
    second = shapes.mesh(there)
    np.testing.assert_allclose(second.vertices, before + np.array((0.0, 0.0, 0.3)), atol=1e-12)
    np.testing.assert_array_equal(second.faces, first.faces)
    second.vertices *= 2.0
    np.testing.assert_array_equal(shapes.mesh(here).vertices, before)
