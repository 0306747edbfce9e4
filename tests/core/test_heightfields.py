"""Bodies on heightfields, on steps with side faces, and on meshes by convex parts."""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg
from pgraph_core import shapes as solids
from pgraph_core.model.shape import mass_properties

from ..nights import combined
from .touching import Scene, pose, random_pose, random_solid

STEP = {"low": (-1, -1), "high": (1, 1)}


def body(shape: dict[str, Any], place, velocity=(0.0,) * 6) -> pg.Body:
    inertia = mass_properties(pg.Shape(**shape), 1000.0)
    return pg.Body(
        name="b", joint="free", mass=inertia.mass, inertia=inertia.inertia, shape=shape,
        q=(*place, 1, 0, 0, 0), v=velocity,
    )  # fmt: skip


def field(heights, size=(4, 4, 0.5)) -> pg.Body:
    shape = {"kind": "heightfield", "size": size, "heights": heights}
    return pg.Body(name="field", joint="weld", mass=1, inertia=np.eye(3), shape=shape)


def run(*bodies: pg.Body, ground: Any = None, other="ground", t_end=1.0, friction=0.5) -> pg.Result:
    contact = pg.Contact(name="c", body="b", other=other, friction=friction)
    model = pg.Model(bodies=bodies, contacts=[contact], ground=ground or pg.Ground())
    return pg.simulate(model, t_end=t_end, method="moreau_jean", step=1e-3, estimate=False)


SOLIDS = [
    {"kind": "sphere", "radius": 0.1},
    {"kind": "box", "size": (0.3, 0.2, 0.2)},
    {"kind": "cylinder", "radius": 0.1, "length": 0.2},
    {"kind": "ellipsoid", "radii": (0.2, 0.15, 0.1)},
]


@pytest.mark.parametrize("shape", SOLIDS, ids=lambda s: s["kind"])
def test_a_body_on_a_flat_heightfield_rests_as_on_the_plane(shape):
    result = run(body(shape, (0.013, 0.02, 0.15)), field(np.zeros((21, 21))), other="field")
    assert result.q[-1, :3] == pytest.approx((0.013, 0.02, 0.1), abs=3e-6)
    assert abs(result.v[-1]).max() < 1e-9


def test_a_ball_does_not_feel_inner_edges_of_a_flat_heightfield():
    ball = body(SOLIDS[0], (-1.5, 0.013, 0.1), (0, 10, 0, 1, 0, 0))
    result = run(ball, field(np.zeros((41, 37))), other="field", t_end=2.0)
    assert np.ptp(result.q[:, 2]) < 1e-12
    assert result.v[-1] == pytest.approx((0, 10, 0, 1, 0, 0), abs=1e-12)


def test_a_block_slides_down_a_slope_of_heights_as_down_an_incline():
    """a = g (sin - mu cos) on a plane that is not level, in the middle of its triangles."""
    slope, mu = 0.3, 0.2
    x = np.linspace(-2, 2, 21)
    heights = np.repeat(-np.tan(slope) * x[:, None], 21, axis=1)
    shape = {"kind": "box", "size": (0.3, 0.2, 0.2)}
    turn = (np.cos(slope / 2), 0, np.sin(slope / 2), 0)
    up = 0.1 * np.array((np.sin(slope), 0, np.cos(slope)))
    start = np.array((-1.0, 0.013, np.tan(slope))) + up
    block = body(shape, start).model_copy(update={"q": (*start, *turn)})
    result = run(block, field(heights), other="field", t_end=0.5, friction=mu)
    down = 9.81 * (np.sin(slope) - mu * np.cos(slope))
    path = np.linalg.norm(result.q[-1, :3] - start)
    assert path == pytest.approx(0.5 * down * 0.5**2, rel=3e-3)
    assert abs(result.v[-1, :3]).max() < 1e-3


@pytest.mark.parametrize("kind", ["sphere", "capsule", "box", "hull", "cylinder"])
def test_distances_to_a_heightfield_are_those_to_its_prisms(kind):
    """Above a hill the gap is the least of the gaps to the two hulls of every cell."""
    rng = np.random.default_rng(4)
    heights = rng.uniform(0, 0.3, (4, 5))
    hill = solids.heightfield((2.0, 2.0, 0.5), heights)
    nodes = hill.vertices.reshape(4, 5, 3)
    for _ in range(3):
        shape, place = random_solid(rng, kind, 0.3), random_pose(rng, 0.3)
        place[2] = rng.uniform(0.5, 1.0)
        gap = Scene([shape, hill], [place, pose()]).gap()
        least = np.inf
        for i, j in np.ndindex(3, 4):
            a, b, c, d = nodes[i, j], nodes[i + 1, j], nodes[i + 1, j + 1], nodes[i, j + 1]
            for corners in ((a, b, c), (a, c, d)):
                top = np.array(corners)
                prism = solids.hull(np.concatenate((top, top * (1, 1, 0) - (0, 0, 0.5))))
                least = min(least, Scene([shape, prism], [place, pose()]).gap())
        assert gap == pytest.approx(least, abs=1e-12)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("height", [1.0, 1e2, 1e4, 1e6])
@pytest.mark.parametrize("radius", [0.0, 1e-6, 1e-2, 10.0])
def test_the_gap_to_a_heightfield_is_found_at_any_distance(size, height, radius):
    hill = solids.heightfield((size, size, size), np.zeros((9, 9)))
    ball = solids.sphere(radius * size)
    far = height * size + radius * size
    gap = Scene([ball, hill], [pose((0.1 * size, 0.0, far)), pose()]).gap()
    assert gap == pytest.approx(height * size, rel=1e-9)


@pytest.mark.parametrize("order", [("b", "field"), ("field", "b")])
def test_a_heightfield_carries_the_weight_in_either_order(order):
    bodies = [body(SOLIDS[0], (0.3, 0.2, 0.1)), field(np.zeros((9, 9)))]
    contact = pg.Contact(name="c", body=order[0], other=order[1])
    result = pg.simulate(pg.Model(bodies=bodies, contacts=[contact]), t_end=0.1, step=1e-3)
    weight = 9.81 * bodies[0].mass
    force = result.contact_force["c"][-1, 5]
    assert force == pytest.approx(weight if order[0] == "b" else -weight, rel=1e-6)


@pytest.mark.parametrize(("height", "low", "wall"), [(0.2, -2.0, -1.1), (-0.2, 0.0, 0.9)])
def test_a_ball_stops_at_the_side_of_a_step_and_of_a_pit(height, low, wall):
    ground = pg.Ground(steps=[pg.Step(**STEP, height=height)])
    level = min(height, 0.0)
    ball = body(SOLIDS[0], (low, 0, 0.1 + level), (0, 0, 0, 3, 0, 0))
    result = run(ball, ground=ground)
    assert result.q[:, 0].max() < wall + 2e-3
    assert result.q[-1, 2] == pytest.approx(0.1 + level, abs=1e-4)


def test_where_steps_overlap_the_last_one_counts():
    rng = np.random.default_rng(7)
    low = rng.uniform(-1, 0.5, (6, 2))
    high = low + rng.uniform(0.2, 1, (6, 2))
    steps = [
        pg.Step(low=a, high=b, height=h)
        for a, b, h in zip(low, high, rng.choice([-0.1, 0.0, 0.1, 0.2], 6))
    ]
    places = rng.uniform(-1.5, 1.5, (60, 2))
    edges = np.concatenate((low, high))
    places = places[np.abs(places[:, None] - edges).min(axis=(1, 2)) > 0.01]
    heights = np.zeros(len(places))
    for step in steps:
        heights[((step.low <= places) & (places <= step.high)).all(axis=1)] = step.height
    bodies = [
        pg.Body(name=f"b{k}", joint="free", link=(*place, height + 0.005), inertia=(0.01,) * 3)
        for k, (place, height) in enumerate(zip(places, heights))
    ]
    contacts = [pg.Contact(name=b.name, body=b.name, points=[(0, 0, 0)]) for b in bodies]
    model = pg.Model(bodies=bodies, contacts=contacts, ground=pg.Ground(steps=steps))
    gaps = pg.simulate(model, t_end=1e-9, step=1e-9, frames=2, estimate=False).contact_gap
    assert [gap[0] for gap in gaps.values()] == pytest.approx([0.005] * len(bodies), abs=1e-6)


L = np.array(((0, 0), (1, 0), (1, 0.2), (0.2, 0.2), (0.2, 1), (0, 1)))


def an_l(path) -> str:
    corners = np.concatenate([np.column_stack((L, np.full(6, z))) for z in (-0.3, 0.3)])
    faces = [(0, k + 1, k) for k in range(1, 5)] + [(6, 6 + k, 7 + k) for k in range(1, 5)]
    for k in range(6):
        m = (k + 1) % 6
        faces += [(k, m, 6 + m), (k, 6 + m, 6 + k)]
    rows = [f"v {x} {y} {z}" for x, y, z in corners]
    rows += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    path.write_text("\n".join(rows))
    return str(path)


def test_a_ball_lies_in_the_corner_of_a_mesh_by_its_parts(tmp_path):
    pytest.importorskip("coacd")
    shape = {"kind": "mesh", "file": an_l(tmp_path / "l.obj"), "hull": "parts"}
    corner = pg.Body(name="l", joint="weld", mass=1, inertia=np.eye(3), shape=shape)
    ball = body({"kind": "sphere", "radius": 0.1}, (0.5, 0.31, 0))
    contact = pg.Contact(name="c", body="b", other="l")
    model = pg.Model(up="y", bodies=[ball, corner], contacts=[contact])
    result = pg.simulate(model, t_end=0.5, method="moreau_jean", step=1e-3)
    assert result.q[-1, :2] == pytest.approx((0.5, 0.3), abs=0.01)


@pytest.mark.parametrize("nodes", [3, 9])
def test_the_bottom_of_a_box_on_a_flat_heightfield_touches_at_its_corners(nodes):
    """No contact point is beside the box, wherever it is among the triangles."""
    rng = np.random.default_rng(nodes)
    field, block = (
        solids.heightfield((4.0, 4.0, 0.5), np.zeros((nodes, nodes))),
        solids.box((0.2,) * 3),
    )
    corners = np.array([(x, y, 0.0) for x in (-0.1, 0.1) for y in (-0.1, 0.1)])
    for x, y in rng.uniform(-0.6, 0.6, (100, 2)).tolist():
        found = Scene([block, field], [pose((x, y, 0.1)), pose()]).pair(margin=1e-6)
        places = found.a - (x, y, 0.0)
        assert abs(places).max() < 0.1 + 1e-9
        assert np.linalg.norm(places[:, None] - corners, axis=2).min(axis=0).max() < 1e-9
        assert found.normal == pytest.approx(np.tile((0.0, 0.0, 1.0), (len(places), 1)), abs=1e-12)


@pytest.mark.parametrize(
    ("seed", "given"),
    combined([1, 3, 5], [{}, {"rtol": 1e-4}, {"method": "dopri5", "rtol": 1e-5}]),
    ids=str,
)
def test_no_step_falls_through_hills(seed, given):
    """Contacts are ignored until bodies come close. A step may end deep in the ground."""
    rng = np.random.default_rng(seed)
    heights = rng.uniform(0.0, 0.6, (8, 8)).tolist()
    hills = pg.Shape(kind="heightfield", size=(30.0, 30.0, 1.0), heights=heights)
    box = pg.Body(
        name="box", joint="free", mass=2.0, derived=("inertia",), rotation=(0.2, 0.4, 0.8, 0.4),
        shape=pg.Shape(kind="box", size=(0.8, 1.4, 1.6)), q=(0.1, 0.2, 2.8, 1, 0, 0, 0),
        v=(*rng.normal(0, 3, 3).tolist(), 0, 0, -7),
    )  # fmt: skip
    ground = pg.Body(name="hills", joint="weld", shape=hills)
    contact = pg.Contact(name="c", body="box", other="hills", friction=0.5, restitution=0.3)
    model = pg.Model(bodies=[box, ground], contacts=[contact])
    run = pg.simulate(model, t_end=0.6, frames=2, estimate=False, **given)
    assert run.q[-1, 2] > 0.0
