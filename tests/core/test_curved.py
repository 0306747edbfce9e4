"""Cylinders and ellipsoids against convex shapes: separations, normals, contact points."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pgraph_core import shapes as solids
from pgraph_core.engine.compiler.jit import kernel
from pgraph_core.engine.compiler.kinds import F1, F2, array_of, f8
from pgraph_core.engine.contact.convex import Side
from pgraph_core.engine.contact.cores import Core
from pgraph_core.engine.contact.curved import FLAT_FACE, straight_edge
from pgraph_core.engine.contact.search import GEOMETRY
from pgraph_core.engine.records import CANDIDATE, CYLINDER, ELLIPSOID, table
from pgraph_core.shapes import Solid

from .touching import CURVED, KINDS, Scene, pose, random_pose, random_solid, rounded

pytestmark = pytest.mark.quick

OTHERS = (*KINDS, *CURVED)
PAIRS = list(product(CURVED, OTHERS))


def reach(solid: Solid, place: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Support function of a solid: the largest n · x for each direction (k, 3)."""
    local = n @ place[3:].reshape(3, 3)
    if solid.kind == ELLIPSOID:
        far = np.linalg.norm(local * np.array(solid.radii), axis=1)
    elif solid.kind == CYLINDER:
        far = solid.radius * np.hypot(local[:, 0], local[:, 1]) + solid.half * abs(local[:, 2])
    else:
        far = (local @ solid.vertices.T).max(axis=1) + rounded(solid)
    return far + n @ place[:3]


def separation(shapes, poses, n: np.ndarray) -> np.ndarray:
    return -reach(shapes[0], poses[0], -n) - reach(shapes[1], poses[1], n)


@pytest.mark.parametrize("kinds", PAIRS, ids=" ".join)
def test_the_distance_is_the_largest_separation(kinds):
    rng = np.random.default_rng([CURVED.index(kinds[0]), OTHERS.index(kinds[1])])
    everywhere = rng.normal(size=(1000, 3))
    everywhere /= np.linalg.norm(everywhere, axis=1)[:, None]
    for trial in range(10):
        shapes = [random_solid(rng, kind) for kind in kinds]
        spread = rng.choice([0.05, 0.3, 1.0])
        poses = [random_pose(rng, spread, square=trial % 3 == 0) for _ in range(2)]
        touch = Scene(shapes, poses).pair()
        k = int(np.argmin(touch.gap))
        n, gap = touch.normal[k], touch.gap[k]
        assert separation(shapes, poses, n[None])[0] == pytest.approx(gap, abs=1e-12)
        assert separation(shapes, poses, everywhere).max() <= gap + 1e-12
        for width in (1e-2, 1e-4, 1e-6):
            near = n + width * rng.normal(size=(100, 3))
            near /= np.linalg.norm(near, axis=1)[:, None]
            assert separation(shapes, poses, near).max() <= gap + 1e-12
        assert np.allclose((touch.a - touch.b) @ n, touch.gap, atol=1e-12)
        assert len(set(touch.whose[:, 2])) == len(touch.gap) <= 8
        for side, points in enumerate((touch.a, touch.b)):
            if gap > -0.02:  # where one lies deep in the other a point may leave it
                far = reach(shapes[side], poses[side], everywhere)
                assert (everywhere @ points.T <= far[:, None] + 1e-9).all()


def test_ellipsoids_on_their_axes():
    a = solids.ellipsoid((0.1, 0.2, 0.3))
    for gap in (0.5, 1e-3, 0.0, -1e-12, -1e-3, -0.05):
        scene = Scene([a, solids.ellipsoid((0.4, 0.5, 0.2))], [pose((0, 0, 0.5 + gap)), pose()])
        touch = scene.pair()
        assert touch.gap == pytest.approx([gap], abs=1e-15)
        assert touch.normal[0] == pytest.approx((0, 0, 1), abs=1e-12)


def test_cylinders_touch_as_circles_and_not_as_prisms():
    for turn in np.linspace(0, 1, 7):
        turned = Rotation.from_euler("z", turn)
        shapes = [solids.cylinder(0.3, 1), solids.cylinder(0.2, 0.6)]
        touch = Scene(shapes, [pose((0.5 + 1e-3, 0, 0), turned), pose()]).pair()
        assert touch.gap == pytest.approx([1e-3, 1e-3], abs=1e-15)
        assert sorted(touch.a[:, 2]) == pytest.approx([-0.3, 0.3])


@pytest.mark.parametrize(
    ("below", "count", "wide"),
    [
        (solids.box((3, 3, 1)), 8, 0.5),
        (solids.box((0.2, 0.2, 1)), 4, 0.1 * np.sqrt(2)),
        (solids.cylinder(0.3, 1), 8, 0.3),
        (solids.cylinder(2, 1), 8, 0.5),
    ],
)
def test_a_cylinder_stands_on_points_all_round(below, count, wide):
    touch = Scene([solids.cylinder(0.5, 1), below], [pose((0, 0, 1 - 1e-9)), pose()]).pair()
    assert touch.gap == pytest.approx([-1e-9] * len(touch.gap), abs=1e-12)
    assert np.allclose(touch.normal, (0, 0, 1))
    assert len(touch.gap) >= min(count, 4)
    around = np.hypot(touch.a[:, 0], touch.a[:, 1])
    assert around.max() == pytest.approx(wide, rel=0.05)
    assert abs(touch.a[:, :2].mean(axis=0)).max() < 0.1 * wide


def test_a_tilted_cylinder_touches_at_its_lowest_point_alone():
    turn = Rotation.from_euler("y", 0.3)
    height = 0.5 * np.cos(0.3) + 0.5 * np.sin(0.3)
    shapes = [solids.cylinder(0.5, 1), solids.box((5, 5, 1))]
    touch = Scene(shapes, [pose((0, 0, height + 0.5), turn), pose()]).pair(margin=1e-3)
    assert touch.gap == pytest.approx([0], abs=1e-15)


UPRIGHT = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@kernel(f8(GEOMETRY, array_of(CANDIDATE), F1, F1, F2))
def edge_of_cylinder(geometry, room, half, n, ends):
    """Write the ends of an upright cylinder's line that is lowest along n. Returns its cosine."""
    side = Side(0, 0, 0, 0, 0, 0, 0, 0)
    core = Core(CYLINDER, (0.0, 0.0, 0.0), UPRIGHT, (half[0], half[1], half[2]), side)
    _, cosine = straight_edge(geometry, room, core, (n[0], n[1], n[2]), 0)
    for k in range(2):
        for c in range(3):
            ends[k, c] = room[k].place[c]
    return cosine


@pytest.mark.parametrize("cosine", [0.0, *np.nextafter(FLAT_FACE, (0, FLAT_FACE, 1)), 0.3])
@pytest.mark.parametrize("sizes", [(0.2, 0.7), (30.0, 1e-2)], ids=str)
def test_each_edge_that_counts_as_straight_has_ends(cosine, sizes):
    """Up to the bound itself, at which the points of two edges are read."""
    radius, half = sizes
    geometry, room = Scene([]).geometry, table(CANDIDATE, 2)
    across, ends = np.sqrt(1.0 - cosine**2), np.empty((2, 3))
    room["place"] = np.nan
    n, size = np.array([0.6 * across, 0.8 * across, cosine]), np.array([radius, radius, half])
    assert edge_of_cylinder(geometry, room, size, n, ends) == cosine
    if cosine > FLAT_FACE:
        assert np.isnan(ends).all()
    else:
        below = [(-0.6 * radius, -0.8 * radius, z) for z in (-half, half)]
        np.testing.assert_allclose(ends, below, atol=1e-12 * max(sizes))
