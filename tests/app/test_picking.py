"""Picking in the 3D view: spots on exact solids, what fields take from them, what is measured."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_app.core.state import Client, State, initial
from pgraph_app.features import update
from pgraph_app.picking import GROUND, Aim, Spot
from pgraph_app.picking.spots import Ray, met
from pgraph_app.picking.spots import spot as spot_or_none
from pgraph_app.picking.update import ClickSpot, StartAim, in_axes_of
from pgraph_app.picking.view import measured
from pgraph_app.scene import marks
from pgraph_core.show import shapes

ME = 7
STEP = pg.Shape(kind="box", size=(0.2, 0.4, 0.6), position=(0.1, 0.0, 0.0))


def spot(state: State, ray: Ray) -> Any:
    return spot_or_none(state, ray)


def aim_of(state: State) -> Any:
    return state.clients[ME].aim


def state_of(model: pg.Model) -> State:
    return replace(initial(model), clients={ME: Client()})


@pytest.fixture
def boxes() -> State:
    """A box on the ground, and one that hangs on it, turned by 90 degrees about z."""
    turned = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    first = pg.Body(name="a", shape=STEP, mass=1.0)
    second = pg.Body(
        name="b", parent="a", link=(1, 0, 0), rotation=turned, shape=STEP, mass=1.0, tip=(0, 0, 1)
    )
    return state_of(pg.Model(bodies=(first, second)))


def towards(point: tuple[float, ...], way: tuple[float, ...], slack: float = 0.0) -> Ray:
    """A ray from 5 m along `way` to a point."""
    u = np.asarray(way) / np.linalg.norm(way)
    return Ray(np.asarray(point) + 5.0 * u, -u, slack)


def test_a_ray_meets_a_box_where_its_face_is_and_takes_the_normal(boxes):
    found = spot(boxes, towards((0.15, 0.2, 0.05), (0, 1, 0)))
    assert found == Spot("a", (0.15, 0.2, 0.05), (0.0, 1.0, 0.0), "flat face")


def test_a_site_is_drawn_along_its_axes_and_is_picked_inside_its_body(boxes):
    turned = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # its x along the body's y
    grip = pg.Site(name="grip", body="b", point=(0.1, 0.0, 0.2), rotation=turned)
    goal = pg.Site(name="goal", body="ground", point=(2, 0, 0))
    state = state_of(boxes.model.add(grip).add(goal))
    lines, number = marks.sites(state), state.derived.number["b"]
    assert set(lines) == {0, number}
    ways = np.diff(lines[number], axis=1)[:, 0]
    np.testing.assert_allclose(ways / np.linalg.norm(ways, axis=1)[:, None],
                               [(0, 1, 0), (-1, 0, 0), (0, 0, 1)], atol=1e-12)  # fmt: skip
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


def test_points_of_a_turned_body_are_in_its_own_axes(boxes):
    """Box b stands at x = 1, its x along the world's y: the world's (1, 0.2) is its (0.2, 0)."""
    found = spot(boxes, towards((1.0, 0.2, 0.0), (0, 1, 0)))
    assert found.body == "b"
    np.testing.assert_allclose(found.point, (0.2, 0, 0), atol=1e-12)
    np.testing.assert_allclose(found.direction, (1, 0, 0), atol=1e-12)


@pytest.mark.parametrize(
    "shape",
    [
        {"kind": "box", "size": (0.2, 0.3, 0.5)},
        {"kind": "sphere", "radius": 0.2},
        {"kind": "ellipsoid", "radii": (0.1, 0.2, 0.3)},
        {"kind": "cylinder", "radius": 0.1, "length": 0.5},
        {"kind": "capsule", "radius": 0.1, "length": 0.5},
        {"kind": "capsule", "radius": 0.15, "length": 0.5, "end_radius": 0.05, "role": "visual"},
        {"kind": "cylinder", "radius": 0.15, "length": 0.5, "end_radius": 0.05, "role": "visual"},
    ],
)
def test_exact_solids_are_met_where_their_meshes_are(shape):
    """An independent road: the same rays against the triangles that are drawn."""
    turn = (0.8, 0.1, -0.2, 0.5)
    body = pg.Body(name="a", shape=pg.Shape(position=(0.3, -0.1, 0.2), rotation=turn, **shape))
    (piece,) = shapes.pieces(body, ())
    solid = shapes.mesh((piece,))
    rng, hits = np.random.default_rng(3), 0
    for _ in range(60):
        origin = np.asarray(piece.position) + 2 * _unit(rng)
        target = np.asarray(piece.position) + 0.05 * _unit(rng)
        ray = Ray(origin, (target - origin) / np.linalg.norm(target - origin), 0.0)
        found, far = met(piece, ray), _first(solid, ray)
        assert found is not None
        hits += far is not None
        assert found.far == pytest.approx(far, abs=0.012)  # the mesh has flat faces
    assert hits == 60


def _unit(rng: np.random.Generator) -> np.ndarray:
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def _first(solid, ray: Ray) -> float | None:
    """Where a ray meets the first of a mesh's triangles: by solving for each."""
    p, q, r = np.moveaxis(np.asarray(solid.triangles), 1, 0)
    way = np.broadcast_to(ray.direction, p.shape)
    matrices = np.stack((way, p - q, p - r), axis=-1)
    fine = np.abs(np.linalg.det(matrices)) > 1e-14
    t, u, v = np.linalg.solve(matrices[fine], (p - ray.origin)[fine][..., None])[..., 0].T
    inside = (t > 0) & (u >= 0) & (v >= 0) & (u + v <= 1)
    return t[inside].min() if inside.any() else None


def test_the_ground_is_met_where_something_may_touch_it(boxes):
    assert spot(boxes, towards((3, 3, 0), (0, 0, 1))) is None
    free = pg.Body(name="a", joint="free", shape=STEP, mass=1.0)
    found = spot(state_of(pg.Model(bodies=(free,))), towards((3, 3, 0), (1, 0, 1)))
    assert (found.body, found.point, found.direction) == (GROUND, (3.0, 3.0, 0.0), (0.0, 0.0, 1.0))


def click(state: State, at: Ray) -> State:
    o, d = (tuple(v.tolist()) for v in at[:2])
    return update(state, ClickSpot(ME, o, d, at.slack))


def test_a_body_s_tip_and_axis_are_taken_from_a_click_as_one_undo_step(boxes):
    aiming = update(boxes, StartAim(ME, "point", "tip", (), ("b",)))
    after = click(aiming, towards((1.2, 0.2, 0.3), (-0.3, 1, 0.2), 0.001))
    np.testing.assert_allclose(after.model.body("b").tip_point, (0.2, -0.2, 0.3), atol=1e-12)
    behind = click(aiming, towards((1.0, 0.2, 0.02), (0, 1, 0), 0.01))  # the joint behind the face
    np.testing.assert_allclose(behind.model.body("b").tip_point, (0, 0, 0), atol=1e-12)
    assert len(after.undo) == len(boxes.undo) + 1
    assert after.clients[ME].aim is None
    aiming = update(boxes, StartAim(ME, "axis", "axes", (0,), ("b",)))
    after = click(aiming, towards((1.0, 0.2, 0.0), (0, 1, 0)))
    np.testing.assert_allclose(after.model.body("b").axes[0], (1, 0, 0), atol=1e-12)


def test_a_link_vector_is_in_the_parent_s_axes(boxes):
    aiming = update(boxes, StartAim(ME, "point", "link", (), ("b",)))
    after = click(aiming, towards((0.199, 0.2, 0.299), (0, 1, 0), 0.001))
    assert after.model.body("b").link == (0.2, 0.2, 0.3)


def test_points_of_constraints_are_in_the_axes_of_the_body_that_each_belongs_to(boxes):
    tie = pg.Constraint(name="tie", kind="point", body="b", point=(0, 0, 0), other="a",
                        other_point=(1, 0, 0))  # fmt: skip
    tied = state_of(boxes.model.add(tie))
    there = towards((0.199, 0.2, 0.299), (0, 1, 0), 0.001)  # a corner of a
    for field, at in (("point", (0.2, 0.8, 0.3)), ("other_point", (0.2, 0.2, 0.3))):
        aiming = update(tied, StartAim(ME, "point", field, (), (), "constraints", "tie"))
        after = click(aiming, there)
        np.testing.assert_allclose(getattr(after.model.constraints[0], field), at, atol=1e-12)


def test_what_is_gone_meanwhile_is_said_and_nothing_changes(boxes):
    aiming = update(boxes, StartAim(ME, "point", "tip", (), ("nobody",)))
    after = click(aiming, towards((0.15, 0.2, 0.05), (0, 1, 0)))
    assert after.model is boxes.model
    assert "nobody" in str(after.clients[ME].notice)
    gone = Aim("point", "point", part="constraints", name="x")
    assert in_axes_of(boxes, gone, Spot("a", (0, 0, 0), None, "")) is None


def test_a_measure_is_the_distance_its_components_and_the_angle_of_the_faces(boxes):
    aiming = update(boxes, StartAim(ME, "measure"))
    once = click(aiming, towards((0.199, 0.2, 0.299), (0, 1, 0), 0.001))
    twice = click(once, towards((1.0, 0.0, 0.3), (0, 0, 1)))
    spots = aim_of(twice).spots
    assert len(spots) == 2
    said = dict(measured(twice, spots, twice.clients[ME].display))
    assert said == {"distance": f"{math.hypot(0.8, 0.2):.6g} m", "Δx": "0.8 m", "Δy": "-0.2 m",
                    "Δz": "0 m", "angle": f"{math.pi / 2:.6g} rad"}  # fmt: skip
    again = click(twice, towards((0.15, 0.2, 0.05), (0, 1, 0)))
    assert len(aim_of(again).spots) == 1
