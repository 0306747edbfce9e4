"""Picking in the 3D view: spots on exact solids, the fields that take them, measures."""

import math

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.picking import GROUND, Spot
from pgraph_app.picking.spots import Ray, met, spot
from pgraph_app.picking.view import measured
from pgraph_app.scene import View, marks
from pgraph_core.show import shapes

from .store import ME, after, begun, do, notice

pytestmark = pytest.mark.quick

TURNED = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # by 90 degrees about z
STEP = pg.Shape(kind="box", size=(0.2, 0.4, 0.6), position=(0.1, 0.0, 0.0))


@pytest.fixture
def boxes():
    """A box on the ground, and one that hangs on it, turned by 90 degrees about z."""
    first = pg.Body(name="a", shape=STEP, mass=1.0)
    second = pg.Body(
        name="b", parent="a", link=(1, 0, 0), rotation=TURNED, shape=STEP, mass=1.0, tip=(0, 0, 1)
    )
    return begun(pg.Model(bodies=(first, second)))


def towards(point: tuple[float, ...], way: tuple[float, ...], slack: float = 0.0) -> Ray:
    u = np.asarray(way) / np.linalg.norm(way)
    return Ray(np.asarray(point) + 5.0 * u, -u, slack)


def test_a_ray_meets_a_box_where_its_face_is_and_takes_the_normal(boxes):
    found = spot(boxes, towards((0.15, 0.2, 0.05), (0, 1, 0)))
    assert found == Spot("a", (0.15, 0.2, 0.05), (0.0, 1.0, 0.0), "flat face")
    # Box b stands at x = 1, its x along the world's y: the world's (1, 0.2) is its (0.2, 0).
    found = spot(boxes, towards((1.0, 0.2, 0.0), (0, 1, 0)))
    assert found.body == "b"
    np.testing.assert_allclose(found.point, (0.2, 0, 0), atol=1e-12)
    np.testing.assert_allclose(found.direction, (1, 0, 0), atol=1e-12)


def test_a_site_is_drawn_along_its_axes_and_is_picked_inside_its_body(boxes):
    grip = pg.Site(name="grip", body="b", point=(0.1, 0.0, 0.2), rotation=TURNED)
    goal = pg.Site(name="goal", body="ground", point=(2, 0, 0))
    state = begun(boxes.model.add(grip).add(goal))
    lines, number = marks.sites(state), state.derived.number["b"]
    assert set(lines) == {0, number}
    ways = np.diff(lines[number], axis=1)[:, 0]
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    np.testing.assert_allclose(ways, [(0, 1, 0), (-1, 0, 0), (0, 0, 1)], atol=1e-12)
    np.testing.assert_array_equal(lines[0][:, 0], [(2, 0, 0)] * 3)
    found = spot(state, towards((1.0, 0.1, 0.2), (1, 0, 0), slack=0.01))
    assert (found.body, found.point, found.what) == ("b", (0.1, 0.0, 0.2), "site grip")


@pytest.mark.parametrize(
    ("near", "point", "what"),
    [
        ((0.198, 0.2, 0.297), (0.2, 0.2, 0.3), "corner"),
        ((0.102, 0.2, 0.003), (0.1, 0.2, 0.0), "centre of a face"),
        ((0.198, 0.2, 0.003), (0.2, 0.2, 0.0), "middle of an edge"),
    ],
)
def test_near_a_corner_an_edge_or_a_centre_it_snaps_exactly(boxes, near, point, what):
    found = spot(boxes, towards(near, (0, 1, 0), slack=0.002))
    assert (found.body, found.point, found.what) == ("a", point, what)


@pytest.mark.parametrize(
    "shape",
    [
        {"kind": "box", "size": (0.2, 0.3, 0.5)},
        {"kind": "ellipsoid", "radii": (0.1, 0.2, 0.3)},
        {"kind": "cylinder", "radius": 0.1, "length": 0.5},
        {"kind": "capsule", "radius": 0.15, "length": 0.5, "end_radius": 0.05, "role": "visual"},
        {"kind": "cylinder", "radius": 0.15, "length": 0.5, "end_radius": 0.05, "role": "visual"},
    ],
)
def test_exact_solids_are_met_where_their_meshes_are(shape):
    """The same rays against the triangles that are drawn, as an independent method."""
    turn = (0.8, 0.1, -0.2, 0.5)
    body = pg.Body(name="a", shape=pg.Shape(position=(0.3, -0.1, 0.2), rotation=turn, **shape))
    (piece,) = shapes.pieces(body, ())
    solid = shapes.mesh((piece,))
    rng = np.random.default_rng(3)
    for _ in range(20):
        outer, inner = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        origin = np.asarray(piece.position) + 2 * outer
        way = np.asarray(piece.position) + 0.05 * inner - origin
        ray = Ray(origin, way / np.linalg.norm(way), 0.0)
        # the mesh has flat faces
        assert met(piece, ray).far == pytest.approx(_first(solid, ray), abs=0.012)


def _first(solid, ray):
    """Return where a ray meets the first of a mesh's triangles, by solving for each."""
    p, q, r = np.moveaxis(np.asarray(solid.triangles), 1, 0)
    way = np.broadcast_to(ray.direction, p.shape)
    matrices = np.stack((way, p - q, p - r), axis=-1)
    fine = np.abs(np.linalg.det(matrices)) > 1e-14
    t, u, v = np.linalg.solve(matrices[fine], (p - ray.origin)[fine][..., None])[..., 0].T
    return t[(t > 0) & (u >= 0) & (v >= 0) & (u + v <= 1)].min()


def test_the_ground_is_met_where_something_may_touch_it(boxes):
    assert spot(boxes, towards((3, 3, 0), (0, 0, 1))) is None
    free = pg.Body(name="a", joint="free", shape=STEP, mass=1.0)
    model = pg.Model(bodies=(free,), contacts=(pg.Contact(name="c", body="a"),))
    found = spot(begun(model), towards((3, 3, 0), (1, 0, 1)))
    assert (found.body, found.point, found.direction) == (GROUND, (3.0, 3.0, 0.0), (0.0, 0.0, 1.0))


def click(state, at):
    o, d = (tuple(v.tolist()) for v in at[:2])
    return after(state, do.ClickSpot(ME, o, d, at.slack))


def test_a_double_click_selects_the_body_that_it_meets_and_frames_it(boxes):
    model = boxes.model.add(pg.Contact(name="c", body="a"))
    for at, name in (((1.0, 0.0, 0.0), "b"), ((0.1, 0.0, 0.0), "a"), ((9.0, 9.0, 0.0), None)):
        begin, way, slack = towards(at, (0.1, 0.2, 1))
        now = after(begun(model), do.FrameSpot(ME, tuple(begin), tuple(way), slack))
        assert now.clients[ME].selection == name
        assert now.clients[ME].asked == View(ME, "fit")


def test_a_body_s_tip_and_axis_are_taken_from_a_click_as_one_undo_step(boxes):
    aiming = after(boxes, do.StartAim(ME, "point", "tip", (), ("b",)))
    now = click(aiming, towards((1.2, 0.2, 0.3), (-0.3, 1, 0.2), 0.001))
    np.testing.assert_allclose(now.model.body("b").tip_point, (0.2, -0.2, 0.3), atol=1e-12)
    behind = click(aiming, towards((1.0, 0.2, 0.02), (0, 1, 0), 0.01))  # the joint behind the face
    np.testing.assert_allclose(behind.model.body("b").tip_point, (0, 0, 0), atol=1e-12)
    assert len(now.undo) == len(boxes.undo) + 1
    assert now.clients[ME].aim is None
    aiming = after(boxes, do.StartAim(ME, "axis", "axes", (0,), ("b",)))
    now = click(aiming, towards((1.0, 0.2, 0.0), (0, 1, 0)))
    np.testing.assert_allclose(now.model.body("b").axes[0], (1, 0, 0), atol=1e-12)
    aiming = after(boxes, do.StartAim(ME, "point", "link", (), ("b",)))
    now = click(aiming, towards((0.199, 0.2, 0.299), (0, 1, 0), 0.001))
    assert now.model.body("b").link == (0.2, 0.2, 0.3)  # in the parent's axes


def test_points_of_constraints_are_in_the_axes_of_the_body_that_each_belongs_to(boxes):
    tie = pg.Constraint(name="tie", kind="point", body="b", point=(0, 0, 0), other="a",
                        other_point=(1, 0, 0))  # fmt: skip
    tied = begun(boxes.model.add(tie))
    there = towards((0.199, 0.2, 0.299), (0, 1, 0), 0.001)  # a corner of a
    for field, at in (("point", (0.2, 0.8, 0.3)), ("other_point", (0.2, 0.2, 0.3))):
        aiming = after(tied, do.StartAim(ME, "point", field, (), (), "constraints", "tie"))
        now = click(aiming, there)
        np.testing.assert_allclose(getattr(now.model.constraints[0], field), at, atol=1e-12)


def test_a_target_deleted_meanwhile_is_reported(boxes):
    aiming = after(boxes, do.StartAim(ME, "point", "tip", (), ("nobody",)))
    now = click(aiming, towards((0.15, 0.2, 0.05), (0, 1, 0)))
    assert now.model is boxes.model
    assert "nobody" in notice(now)


def test_a_measure_is_the_distance_its_components_and_the_angle_of_the_faces(boxes):
    aiming = after(boxes, do.StartAim(ME, "measure"))
    once = click(aiming, towards((0.199, 0.2, 0.299), (0, 1, 0), 0.001))
    twice = click(once, towards((1.0, 0.0, 0.3), (0, 0, 1)))
    spots = twice.clients[ME].aim.spots
    assert len(spots) == 2
    said = dict(measured(twice, spots, twice.clients[ME].display))
    assert said == {"distance": f"{math.hypot(0.8, 0.2):.6g} m", "Δx": "0.8 m", "Δy": "-0.2 m",
                    "Δz": "0 m", "angle": f"{math.pi / 2:.6g} rad"}  # fmt: skip
    again = click(twice, towards((0.15, 0.2, 0.05), (0, 1, 0)))
    assert len(again.clients[ME].aim.spots) == 1


@pytest.mark.parametrize(("at", "kept"), [((0.1, 0.2, 0.15), ("a",)), ((5.0, 0.2, 5.0), ())])
def test_a_click_beside_all_bodies_clears_the_selection(boxes, at, kept):
    chosen = after(boxes, do.Select(ME, "a"))
    o, d = (tuple(v.tolist()) for v in towards(at, (0, 1, 0))[:2])
    assert after(chosen, do.ClickView(ME, o, d, 0.0)).clients[ME].selected == kept
