"""Marks in the 3D view, joint sliders and the gizmo."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
import viser
from hypothesis import given, settings
from hypothesis import strategies as st

import pgraph_core as pg
import pgraph_models
from pgraph_app.digraph.view import digraph
from pgraph_app.pose import poses
from pgraph_app.pose import solving as posing
from pgraph_app.pose.solving import WEIGHTS, pull_force
from pgraph_app.pose.update import rounded
from pgraph_app.pose.view import joints
from pgraph_app.run.runs import TRAVELS, led
from pgraph_app.scene import camera, marks, ties
from pgraph_app.scene.nodes import BatchedBodies, SeparateBodies
from pgraph_app.table.view import table
from pgraph_core.show import shapes, stage
from pgraph_core.show.bodies import extent, looks

from ..nights import at_night
from .store import ME, after, begun, built_in, do, notice, ran


@pytest.fixture
def quadruped():
    return begun(built_in("quadruped"))


def pose(state, body, index, value, serial=0):
    return after(state, do.MoveJoint(ME, serial, body, index, str(value)))


def simulated(state, t_end):
    result = pg.simulate(pg.Mechanism(state.model), t_end=t_end, step=1e-3)
    return after(ran(state, result), do.Scrub(ME, t_end))


def touching(*balls):
    return begun(pg.Model(bodies=balls, contacts=(pg.Contact(name="c", body="*"),)))


@pytest.mark.parametrize(
    ("name", "points"),
    [("four_bar", [(0, 0, 0), (1, 0, 0)]), ("double_pendulum", [(0, 0, 2.2)]), ("quadruped", [])],
)
def test_each_pivot_on_the_ground_has_a_bracket_along_its_axis(name, points):
    model = built_in(name)
    found = ties.pivots(begun(model))
    assert found.ends[:, 1] == pytest.approx(np.reshape(points, (-1, 3)), abs=1e-9)
    R = shapes.to_matrix(found.wxyz)
    assert np.linalg.det(R) == pytest.approx(1.0)
    axes = [b.axes[-1] for b in model.bodies if b.parent == "ground" and b.joint == "revolute"]
    assert np.abs(R[:, :, 1]) == pytest.approx(np.abs(np.reshape(axes, (-1, 3))), abs=1e-9)


def test_a_loop_closed_on_the_ground_has_a_bracket_too():
    arm = pg.Body(name="arm", tip=(1, 0, 0), com=(0.5, 0, 0), axes=((0, 0, 1),))
    pin = pg.Constraint(kind="point", name="pin", body="arm", point=(1, 0, 0))
    both = ties.pivots(begun(pg.Model(bodies=(arm,), constraints=(pin,), up="y")))
    assert both.ends[:, 1] == pytest.approx(np.array([(0, 0, 0), (1, 0, 0)]), abs=1e-12)


def test_a_slider_poses_the_mechanism_and_use_sets_the_initial_state(quadruped):
    now = pose(quadruped, "left_femur", 0, 0.5)
    assert now.model is quadruped.model
    assert now.undo == ()
    k = now.derived.number["left_femur"]
    q = posing.shown_q(now)
    assert q[posing._first(now.model, now.model.body("left_femur"))] == 0.5
    expected, _ = pg.Mechanism(now.model).poses(q)
    assert poses(now)[0] == pytest.approx(expected, abs=1e-12)
    assert not np.allclose(poses(now)[0][k], quadruped.derived.positions[k])
    used = after(now, do.UsePose(ME))
    assert len(used.undo) == 1
    assert used.model.body("left_femur").q == (0.5,)
    assert poses(used)[0] == pytest.approx(poses(now)[0], abs=1e-12)
    assert after(used, do.Undo(ME)).model == quadruped.model
    typed = begun(pg.Model.serial(2).edit("2", joint="prismatic"))
    typed = pose(pose(typed, "1", 0, "-90 deg", serial=1), "2", 0, "5 mm", serial=2)
    assert typed.posed.q == pytest.approx((-np.pi / 2, 0.005))


@pytest.mark.parametrize("name", ["four_bar", "andrews", "bricard", "slider_crank"])
def test_loops_stay_closed_while_a_slider_moves(name):
    state = begun(built_in(name))
    body = state.model.bodies[0]
    for k in range(1, 6):
        state = pose(state, body.name, 0, body.q[0] + 0.1 * k)
    q = posing.shown_q(state)
    assert state.pose_problem == ""
    assert q[0] == pytest.approx(body.q[0] + 0.5, abs=1e-6)  # the joint in hand is where it was put
    mech = pg.Mechanism(state.model)
    _, _, report = mech.assemble(q, np.zeros(mech.nv))
    assert report.moved < 1e-6


def test_a_slider_says_what_it_cannot_do(quadruped):
    state = pose(begun(built_in("slider_crank")), "slider", 0, 0.01)
    held = pose(state, "slider", 0, 100.0)
    assert "loops" in held.pose_problem
    assert held.pose is state.pose
    early = pose(begun(built_in("four_bar"), compiled=False), "left crank", 0, 1.6)
    assert "compiled" in early.pose_problem


def test_a_pose_goes_when_the_model_changes_and_comes_back_with_undo(quadruped):
    now = pose(quadruped, "left_femur", 0, 0.5)
    edited = after(now, do.EditBodies(ME, 7, ("pelvis",), "mass", (((), "9"),)))
    assert edited.pose is None
    assert after(edited, do.Undo(ME)).pose is not None
    assert after(now, do.HomePose(ME)).pose is None


@settings(max_examples=12)
@given(
    st.sampled_from(["spherical", "free", "compound", "universal", "planar", "cylindrical"]),
    st.lists(st.floats(-1.5, 1.5), min_size=6, max_size=6),
)
def test_every_coordinate_of_every_joint_is_a_slider_of_its_own(joint, values):
    motions = {"motions": (("ball", (0, 0, 1)), ("translate", (1, 0, 0)))}
    body = pg.Body(name="a", joint=joint, **(motions if joint == "compound" else {}))
    state = begun(pg.Model(bodies=(body,)))
    assert len(posing.coordinates(state)) == body.dof
    for i in range(body.dof):
        state = pose(state, "a", i, values[i])
        assert posing.coordinates(state)[i].value == pytest.approx(values[i], abs=1e-9)


def hand(state, body, point, target, times=12):
    for _ in range(times):
        state = after(state, do.DragBody(ME, body, tuple(point), tuple(target)))
    return state


def place_of(state, body, point):
    positions, wxyz = poses(state)
    k = state.derived.number[body] - 1
    return positions[k] + shapes.to_matrix(wxyz)[k] @ np.asarray(point)


@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e2])
def test_a_body_that_is_dragged_goes_to_the_hand_or_as_near_as_it_can(scale):
    rods = [pg.Body(name=n, parent=p, joint="revolute", axes=((0, 0, 1),), link=(x, 0, 0),
                    tip=(scale, 0, 0), com=(scale / 2, 0, 0))
            for n, p, x in (("a", "ground", 0), ("b", "a", scale), ("c", "b", scale))]  # fmt: skip
    state = begun(pg.Model(bodies=tuple(rods), gravity=(0, 0, 0)))
    tip = (scale, 0, 0)
    near = hand(state, "c", tip, (1.2 * scale, 1.1 * scale, 0))
    assert place_of(near, "c", tip) == pytest.approx(
        np.array((1.2, 1.1, 0)) * scale, abs=1e-3 * scale
    )
    far = hand(state, "c", tip, (0, 10 * scale, 0), 40)
    assert place_of(far, "c", tip) == pytest.approx((0, 3 * scale, 0), abs=0.05 * scale)
    assert far.undo == ()
    assert after(far, do.HomePose(ME)).pose is None


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "andrews"])
def test_loops_stay_closed_while_a_body_is_dragged(name):
    state = begun(built_in(name))
    body = state.model.bodies[0]
    grip = np.asarray(body.tip_point)
    start = place_of(state, body.name, grip)
    about = state.derived.positions[state.derived.number[body.name] - 1]
    arm = np.roll(start - about, 1)
    for part in (0.1, 0.2, 0.3):
        state = hand(state, body.name, grip, start + part * arm, 3)
        mech = pg.Mechanism(state.model)
        _, _, report = mech.assemble(posing.shown_q(state), np.zeros(mech.nv))
        assert report.moved < 1e-6
        assert state.pose_problem == ""


def test_what_floats_stays_where_it_is_while_a_leg_is_dragged_and_limits_hold(quadruped):
    posed = pose(pose(quadruped, "left_femur", 0, 0.3), "left_tibia", 0, -0.2)
    paw = place_of(posed, "left_hind_paw", (0, 0, 0))
    moved = hand(quadruped, "left_hind_paw", (0, 0, 0), paw)
    assert place_of(moved, "left_hind_paw", (0, 0, 0)) == pytest.approx(paw, abs=1e-3)
    assert place_of(moved, "pelvis", (0, 0, 0)) == pytest.approx(
        place_of(quadruped, "pelvis", (0, 0, 0)), abs=1e-9
    )
    home = place_of(quadruped, "pelvis", (0, 0, 0))
    lower = home + np.array((0.05, -0.03, 0))
    whole = hand(quadruped, "pelvis", (0, 0, 0), lower)
    assert place_of(whole, "pelvis", (0, 0, 0)) == pytest.approx(lower, abs=1e-3)
    rod = pg.Body(name="a", axes=((0, 0, 1),), tip=(1, 0, 0), limits=((-0.3, 0.5),))
    stopped = hand(begun(pg.Model(bodies=(rod,))), "a", (1, 0, 0), (0, 1, 0))
    assert posing.shown_q(stopped) == pytest.approx((0.5,), abs=1e-9)


def test_the_gizmo_shows_while_it_is_dragged_and_is_one_undo_step_when_let_go(quadruped):
    state = quadruped
    old = state.model.body("left_femur").link
    for k in range(1, 5):
        moved = (old[0] + 0.01 * k, old[1], old[2])
        state = after(state, do.Gripped(ME, "left_femur", "link", moved, False))
        assert state.model is quadruped.model
        grip = state.clients[ME].grip
        assert (grip.body, grip.what) == ("left_femur", "link")
        assert grip.vector == pytest.approx(moved)
    assert not np.allclose(poses(state)[0], quadruped.derived.positions)
    shown = poses(state)[0]
    done = after(state, do.Gripped(ME, "left_femur", "link", moved, True))
    assert len(done.undo) == 1
    assert done.model.body("left_femur").link == pytest.approx(moved)
    assert done.clients[ME].grip is None
    assert poses(done)[0] == pytest.approx(shown)
    com = quadruped.model.body("thorax").com  # let go where it was
    assert after(quadruped, do.Gripped(ME, "thorax", "com", com, True)).undo == ()
    kept = rounded((0.123456789, 0.0, 0.0), (0.123456789, 0.2000012, 0.0), 1.0)
    assert kept == (0.123456789, 0.2, 0.0)  # what did not move has all its digits


def test_switches_that_a_scene_cannot_use_are_not_there():
    def what(state):
        return {name for name, _ in marks.showable(state)}

    pendulum = begun(pg.Model(bodies=(pg.Body(name="rod", tip=(1, 0, 0)),)))
    assert {"shapes", "axes", "links", "coms", "frames", "names"} <= what(pendulum)
    assert not {"points", "forces", "cones"} & what(pendulum)
    assert {"points", "forces", "cones"} <= what(touching(BALL))
    smooth = pg.Contact(name="c", body="ball", friction=0.0)
    assert "cones" not in what(begun(pg.Model(bodies=(BALL,), contacts=(smooth,))))


def ball(**fields):
    return BALL.model_copy(update=fields)


BALL = pg.Body(
    name="ball", joint="free", mass=2.0, q=(0, 0, 0.1, 1, 0, 0, 0),
    inertia=((0.008, 0, 0), (0, 0.008, 0), (0, 0, 0.008)),
    shape=pg.Shape(kind="sphere", radius=0.1),
)  # fmt: skip


def test_values_of_forces_are_those_of_the_selection_or_the_largest():
    balls = [ball(name=f"b{i}", mass=1.0 + i, q=(i, 0, 0.1, 1, 0, 0, 0)) for i in range(7)]
    state = simulated(touching(*balls), 0.05)
    positions, wxyz = poses(state)
    found = marks.pushes(state, positions, shapes.to_matrix(wxyz))

    def places(*selected):
        return [round(value[0]) for value in marks.values(state, found, selected)]

    assert len(found) == 7
    assert places() == [6, 5, 4, 3, 2]
    assert places("b1") == [1]
    assert len(places(*(body.name for body in balls))) == 7


def test_forces_of_contacts_act_on_the_ground_and_stay_in_their_cones():
    """One ball lies, and the other touches nothing."""
    state = simulated(touching(BALL, ball(name="high", q=(0.5, 0, 9.0, 1, 0, 0, 0))), 0.05)
    positions, wxyz = poses(state)
    pushes, metres = marks.pushes(state, positions, shapes.to_matrix(wxyz)), marks.scale(state)
    assert pushes[0].at == pytest.approx((0, 0, 0), abs=1e-6)
    assert pushes[0].force == pytest.approx((0, 0, 2 * 9.81), rel=1e-3)
    at, size = marks.cones(pushes, metres, np.array((0.0, 0, 1)))
    (arrow,) = marks.arrows(pushes, metres)
    assert at == pytest.approx(np.zeros((1, 3)), abs=1e-6)
    assert arrow[0] == pytest.approx(at[0], abs=1e-6)
    assert np.linalg.norm(arrow[1] - arrow[0]) == pytest.approx(size[0, 2], rel=1e-3)
    assert size[0, 0] / 2 / size[0, 2] == pytest.approx(state.model.ground.friction)
    cone = shapes.cone()  # opens upwards from its apex, its faces outwards
    assert cone.bounds[1] == pytest.approx((0.5, 0.5, 1.0), abs=0.01)
    assert cone.volume > 0


@pytest.mark.parametrize("name", ["quadruped", "four_bar", "chain_10", "fig1_tree"])
def test_a_branch_has_one_hue_in_the_table_the_digraph_and_in_3d(name):
    state = begun(built_in(name))
    d, hues = state.derived, digraph(state)["colors"]
    rows = {row["number"]: row["color"] for row in table(state)["rows"]}
    assert [rows[k] for k in range(1, len(d.names) + 1)] == hues
    drawn = [look.color for look in marks.looks(state)]
    for k, hue in enumerate(hues):
        number = int(hue.removeprefix("var(--branch-").removesuffix(")"))
        assert drawn[k] == shapes.COATS[number]
        assert (number == 0) == (d.branches[k] == 0)
    for k, p in enumerate(d.parent):
        only = p > 0 and len(d.children[p]) == 1
        assert not only or d.branches[k] == d.branches[p - 1]


# -- the camera ------------------------------------------------------------------------------------


def pictured(state, drawn, at, moved, aspect):
    """The share of the corners of all bodies that a camera, moved by a vector, has in its view."""
    positions, wxyz = poses(state)
    corners = extent(drawn, positions, shapes.to_matrix(wxyz))
    seen = stage.Viewpoint(at.position + moved, at.target + moved)
    return stage.in_picture(corners, np.array(stage.GRID[state.model.up][1]), seen, aspect).mean()


@pytest.mark.parametrize(
    "name", [*(x for x in pgraph_models.names() if x != "andrews"), *at_night("andrews")]
)
def test_the_camera_never_loses_the_motion_whenever_the_page_was_opened(name):
    """Every scenario that is built in, at 8 moments, in wide and narrow views."""
    model = built_in(name)
    for scenario in (*(s.name for s in model.scenarios), ""):
        state = after(begun(model), do.SetScenario(ME, 1, scenario))
        request = state.request
        options = {"t_end": request.t_end, "estimate": False}
        if scenario:
            options["scenario"] = scenario
        result = pg.simulate(pg.Mechanism(model), **options)
        state = ran(state, result)
        t, drawn = np.asarray(result.t), marks.looks(state)
        for aspect, opened in ((0.6, t[0]), (1.0, t[-1]), (2.0, t[len(t) // 3])):
            first = after(state, do.Scrub(ME, float(opened), True))
            at = camera.viewpoint(first, aspect)
            for time in np.linspace(t[0], t[-1], 8):
                now = after(state, do.Scrub(ME, float(time), True))
                moved = camera.travelled(now) * (camera.middle(now) - camera.middle(first))
                assert pictured(now, drawn, at, moved, aspect) >= 0.6, (scenario, aspect, time)
            rest = after(state, do.Scrub(ME, float(opened)))
            assert pictured(rest, drawn, camera.viewpoint(rest, aspect), 0.0, aspect) == 1.0


@pytest.mark.parametrize("speed", [0.0, 2.0, 30.0])
def test_a_camera_goes_along_with_what_travels_more_than_its_size(speed):
    state = simulated(touching(ball(v=(0, 0, 0, speed, 0, 0))), 0.5)
    far = 0.5 * speed > TRAVELS * 0.2 * 3**0.5
    assert camera.travelled(state).tolist() == [far, 0, 0]


@pytest.mark.parametrize(("speed", "whole"), [(2.0, True), (1e3, False)])
def test_a_view_holds_the_whole_run_unless_the_mechanism_leaves(speed, whole):
    """A slider along x for 1 s: 2 m of way fit a view of a model of 1 m, 1 km does not."""
    rail = pg.Body(name="rail", mass=1.0, tip=(1, 0, 0), joint="weld")
    slider = pg.Body(name="a", joint="prismatic", axes=(1, 0, 0), mass=1.0, v=speed)
    state = begun(pg.Model(bodies=(rail, slider), gravity=(0, 0, 0)))
    before = np.ptp(camera.extent(state)[:, 0])
    state = ran(state, pg.simulate(pg.Mechanism(state.model), t_end=1.0, step=1e-2))
    assert np.ptp(camera.extent(after(state, do.Scrub(ME, 0.0)))[:, 0]) == pytest.approx(before)
    state = after(state, do.Scrub(ME, 0.0, True))
    now = np.ptp(camera.extent(state)[:, 0])
    assert (now > max(before, 0.99 * speed)) == whole
    assert len(camera.passed(state)) > 0 or not whole


@pytest.mark.parametrize(
    ("height", "low", "whole"), [(0, 0.4, False), (0.42, 0, True), (50, 0, False)]
)
def test_the_floor_below_a_model_is_in_the_first_view_within_reach(height, low, whole):
    """Two rods of 0.2 m hang, stand over the floor, or are far above it."""
    model = pg.Model.serial(2)
    state = begun(model.edit("1", link=(0, 0, height)))
    assert state.derived.low == pytest.approx(low)
    assert (camera.extent(state)[:, 2].min() == pytest.approx(-low)) == whole


def test_the_floor_is_just_below_the_motion_of_the_last_run():
    """Two rods reach 2 m down, and swing by a little in the stretched position of their start."""
    rod = {
        "axes": (0, 1, 0),
        "mass": 1.0,
        "com": (0.5, 0, 0),
        "tip": (1, 0, 0),
        "inertia": (1, 1, 1),
    }
    rods = pg.Body(name="a", **rod), pg.Body(name="b", parent="a", link=(1, 0, 0), **rod)
    state = begun(pg.Model(bodies=rods))
    clear = camera.CLEAR * state.derived.size
    assert clear < camera.ground(state) < 0.5 < 2.0 <= state.derived.low  # in sight before a run
    state = simulated(state, 0.2)
    assert camera.ground(state) == pytest.approx(clear - state.run.swept[:, 2].min())
    assert 0 < camera.ground(state) < 0.5
    posed = after(state, do.MoveJoint(ME, 1, "a", 0, "1.5 rad"))
    assert camera.ground(posed) > 1.5


def test_an_angle_without_limits_is_shown_and_set_within_its_turn():
    """A slider at a fifth of its way stood beside 970.9 degrees."""
    for turns, more in ((-1, "− 1 turn"), (0, ""), (3, "+ 3 turns")):
        whole = 2 * math.pi * turns
        state = begun(pg.Model.serial(1).edit("1", q=whole - 1.25))
        shown = joints(state, "1")["rows"][0]
        assert shown["shown"] == pytest.approx(-1.25)
        assert shown["more"] == more
        assert shown["low"] <= shown["value"] <= shown["high"]
        assert pose(state, "1", 0, 0.5, serial=1).pose.q == pytest.approx([whole + 0.5])
        assert pose(state, "1", 0, 30.0, serial=1).pose.q == pytest.approx([30.0])
        for half in (math.pi, -math.pi):
            found = pose(state, "1", 0, f"{half!r} rad", serial=1).pose.q
            assert found == pytest.approx([whole + half])
    limited = pg.Model.serial(1).edit("1", q=7.0, limits=(0.0, 9.0))
    assert joints(begun(limited), "1")["rows"][0]["shown"] == 7.0


def test_the_pose_of_a_run_has_the_digits_that_its_error_supports(monkeypatch):
    monkeypatch.setattr(pg.Result, "error_estimate", 0.0021)
    state = simulated(begun(pg.Model.serial(1)), 0.1)
    row = joints(state, "1")["rows"][0]
    assert row["shown"] == round(row["value"], 3)
    assert row["shown"] != row["value"]


def test_arrows_of_resting_bodies_stay_visible_after_an_impact():
    state = simulated(touching(ball(q=(0, 0, 0.6, 1, 0, 0, 0))), 2.0)
    assert state.run.result.contact_force["c[ball]"][:, 5].max() > 50 * 2 * 9.81
    assert marks.scale(state) * 2 * 9.81 > 0.1 * state.derived.size


@settings(max_examples=10)
@given(st.tuples(*(st.floats(0.05, 2.0),) * 3))
def test_the_ellipsoid_of_a_solid_ellipsoid_is_itself(half):
    a, b, c = half
    m = 3.0
    inertia = np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) * m / 5
    body = pg.Body(name="e", mass=m, inertia=inertia.tolist())
    point = pg.Body(name="p", mass=1.0, inertia=((0, 0, 0),) * 3, tip=(1, 0, 0))
    solids = marks.ellipsoids(begun(pg.Model(bodies=(body, point))))
    assert sorted(solids.size[0]) == pytest.approx(sorted(2 * x for x in half), rel=1e-6)
    assert len(solids.owner) == 1  # a point mass has none


@pytest.mark.parametrize("name", ["none.stl", "broken.stl", "a.txt"])
def test_a_mesh_that_cannot_be_read_has_a_stand_in_and_is_reported(tmp_path, name):
    if name != "none.stl":
        (tmp_path / name).write_bytes(b"solid \xff\x00 this is no mesh")
    mesh = pg.Shape(kind="mesh", file=str(tmp_path / name))
    body = pg.Body(name="a", shape=mesh, inertia=(1, 1, 1))
    (piece,) = shapes.pieces(body, ())
    (own,) = shapes.pieces(pg.Body(name="a"), ())
    assert shapes.mesh((piece,)).volume == shapes.mesh((own,)).volume
    assert (piece.color, piece.opacity < 1) == (shapes.STAND_IN, True)
    assert own.color != piece.color
    (sentence,) = shapes.unreadable([body])
    assert name in sentence
    state = after(begun(pg.Model(bodies=(body,))), do.Unreadable((sentence,)))
    assert state.clients[ME].notice.bad
    assert sentence in notice(state)


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


def test_a_pull_is_towards_the_mouse_is_damped_and_has_a_bound(quadruped):
    rest, far = np.zeros(3), np.array((100.0, 0, 0))
    near = pull_force(rest, rest, 0.01 * far / 100, mass=10.0)
    assert near[0] > 0
    assert near[1:] == pytest.approx(0.0)
    assert pull_force(rest, 0.01 * far, rest, mass=10.0)[0] < 0
    assert np.linalg.norm(pull_force(rest, rest, far, 10.0)) == pytest.approx(WEIGHTS * 98.1)
    pulled = after(quadruped, do.Pull(ME, "thorax", (0, 0, 0), (1.0, 0, 0)))
    assert pulled.pull.target == (1.0, 0, 0)
    assert after(pulled, do.Pull(ME, "thorax", (0, 0, 0), None)).pull is None


@pytest.mark.parametrize(("typed", "angle"), [(31.0, 30.0), (38.0, 38.0), (-44.0, -45.0)])
@pytest.mark.parametrize("axis", [(0, 1, 0), (2 / 3, -1 / 3, 2 / 3)])
@pytest.mark.parametrize("first", [(1.0, 0.0, 0.0, 0.0), (0.8, 0.4, -0.2, 0.4)])
def test_the_gizmo_turns_a_body_about_an_axis_and_goes_to_notches(typed, angle, axis, first):
    """About an axis of the parent, from an orientation that may be turned already."""
    state = begun(pg.Model(bodies=(pg.Body(name="a", rotation=first, tip=(1, 0, 0), mass=1.0),)))

    def turned(degrees):
        half = math.radians(degrees) / 2
        turn = np.array([math.cos(half), *(math.sin(half) * np.array(axis))])
        return shapes.times(turn[None], np.array([first]))[0]

    now = after(state, do.Gripped(ME, "a", "rotation", tuple(turned(typed).tolist()), True))
    found, wanted = np.asarray(now.model.body("a").rotation), turned(angle)
    np.testing.assert_allclose(found * np.sign(found @ wanted), wanted, atol=1e-9)


class Drawn:
    """A scene of viser that keeps what is added to it."""

    def __init__(self):
        self.scene, self.nodes = self, []

    def _added(self, name, vertices, faces, *, opacity=None, **more):
        node = SimpleNamespace(
            name=name, opacity=opacity, wxyz=np.array((1.0, 0, 0, 0)), position=np.zeros(3),
            on_click=lambda act: act, on_drag=lambda *_, **__: lambda act: act, **more,
        )  # fmt: skip
        self.nodes.append(node)
        return node

    add_mesh_simple = add_batched_meshes_simple = _added


@pytest.mark.parametrize("kind", [SeparateBodies, BatchedBodies])
@pytest.mark.parametrize("opacity", [0.0, 0.25, 1.0])
def test_what_is_transparent_is_so_among_faded_bodies_too(kind, opacity):
    """The opacities of a shape and of all bodies are multiplied. Opacity 0 is not drawn."""
    solid = pg.Shape(kind="box", size=(1, 1, 1), colour="#00ff00")
    veil = pg.Shape(kind="box", size=(2, 2, 2), colour="#00ff00", opacity=opacity)
    body = pg.Body(name="a", shapes=(solid, veil))
    scene = Drawn()
    drawn = kind(scene, lambda *_: None, lambda *_: None)
    drawn.show(looks([body], [[1], []], [(0, 0, 0)]))
    expected = {0.0: [None], 0.25: [None, 0.25], 1.0: [None]}[opacity]
    assert [node.opacity for node in scene.nodes] == expected
    drawn.fade(0.5, True)
    assert [node.opacity for node in scene.nodes] == [0.5 * (x or 1.0) for x in expected]
    drawn.fade(None, True)
    assert [node.opacity for node in scene.nodes] == expected


@pytest.fixture
def server():
    served = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield served
    served.stop()


def test_shapes_are_drawn_in_their_own_colours(server):
    plain, own = (1, 2, 3), (255, 0, 0)
    box = {"kind": "box", "size": (0.1, 0.1, 0.1)}
    ball = {"kind": "sphere", "radius": 0.1, "colour": "#ff0000"}
    nodes = server.scene._handle_from_node_name
    drawn = SeparateBodies(server, lambda *_: None, lambda *_: None)
    first = looks([pg.Body(name="1", shapes=(box, ball))], ((1,), ()), [plain])
    drawn.show(first)
    assert [nodes[name].color for name in ("/bodies/1", "/bodies/1/1")] == [plain, own]
    other = pg.Body(name="1", shapes=({**box, "colour": "#00ff00"},))
    drawn.show(looks([other], ((1,), ()), [plain]))
    assert nodes["/bodies/1"].color == (0, 255, 0)
    assert "/bodies/1/1" not in nodes
    drawn.remove()
    BatchedBodies(server, lambda *_: None, lambda *_: None).show(first)
    np.testing.assert_array_equal(nodes["/bodies/box"].batched_colors, [plain])
    np.testing.assert_array_equal(nodes["/bodies/sphere"].batched_colors, [own])


def test_a_camera_follows_the_heaviest_free_tree_alone():
    """One hinge on the ground halved the way of the camera, and the dog left the middle."""
    round_ = {"inertia": (0.01, 0.01, 0.01)}
    ball = pg.Body(
        name="ball", joint="free", mass=2.0, v=(0, 0, 0, 5, 0, 0), tip=(0.1, 0, 0), **round_
    )
    tail = pg.Body(name="tail", parent="ball", mass=0.1, link=(0.1, 0, 0), **round_)
    light = pg.Body(name="dust", joint="free", mass=0.1, **round_)
    hinge = pg.Body(name="door", mass=9.0, **round_)
    alone = pg.Model(bodies=(ball, tail), gravity=(0, 0, 0))
    model = pg.Model(bodies=(hinge, light, ball, tail), gravity=(0, 0, 0))
    assert [pg.Topology.of(model).names[k] for k in led(model)] == ["ball", "tail"]
    assert len(led(pg.Model.serial(3))) == 3
    ways = []
    for each in (alone, model):
        done = pg.simulate(each, t_end=1.0, step=1e-2)
        state = after(ran(begun(each), done), do.Scrub(ME, 1.0))
        ways.append(camera.followed(state))
    assert ways[0][0] == pytest.approx(5.0, abs=0.1)
    assert ways[1] == pytest.approx(ways[0])
