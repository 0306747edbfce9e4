"""Shapes on the ground: gaps, contact points, slopes and steps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from pgraph_core import shapes as solids
from pgraph_core.contact import packed_shapes
from pgraph_core.engine.records import CYLINDER

from .touching import KINDS, Scene, pose, random_pose, random_solid

pytestmark = pytest.mark.quick

ROUNDING = 1e-13
seeds = st.integers(0, 2**32 - 1)


def lowest(scene: Scene, normal: np.ndarray) -> float:
    shape, place = scene.shapes[0], scene.poses[0]
    if shape.kind == CYLINDER:
        tilt = place[3:].reshape(3, 3)[:, 2] @ normal
        across = shape.radius * np.sqrt(max(1 - tilt**2, 0))
        return float(place[:3] @ normal - abs(tilt) * shape.half - across)
    return float((scene.placed(0) @ normal).min() - shape.radius)


@given(seeds, st.sampled_from((*KINDS, "points")), st.booleans())
def test_gap_is_the_height_of_the_lowest_point(seed, kind, sloping):
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3) if sloping else np.array((0.0, 0.0, 1.0))
    normal /= np.linalg.norm(normal)
    place = random_pose(rng, 1.0)
    scene = Scene([random_solid(rng, kind)], [place], packed_shapes.ground(normal))
    expected = lowest(scene, normal)
    assert scene.gaps(on_ground=[0])[0] == pytest.approx(expected, abs=ROUNDING)
    touch = scene.on_ground()
    assert touch.gap.min() == pytest.approx(expected, abs=ROUNDING)
    np.testing.assert_allclose(touch.b @ normal, 0, atol=ROUNDING)
    np.testing.assert_allclose(touch.a - touch.b, touch.gap[:, None] * touch.normal, atol=ROUNDING)
    np.testing.assert_allclose(touch.normal, [normal] * len(touch.gap), atol=ROUNDING)
    assert (touch.whose[:, 1] == -1).all()
    assert len(set(touch.whose[:, 2])) == len(touch.gap)


COUNTS = [
    (solids.sphere(0.5), (0, 0, 0), 1),
    (solids.capsule(0.5, 1), (0, 90, 0), 2),
    (solids.capsule(0.5, 1), (0, 0, 0), 1),
    (solids.box((1, 1, 1)), (0, 0, 0), 4),
    (solids.cylinder(0.5, 1), (0, 0, 0), 4),  # upright
    (solids.cylinder(0.5, 1), (90, 0, 0), 2),  # lying
    (solids.cylinder(0.5, 0.1), (50, 0, 0), 1),  # a disc on its rim
    (solids.hull(solids.box((1, 1, 1)).vertices), (0, 0, 0), 4),
    (solids.points([(0, 0, -0.5), (1, 0, -0.5), (0, 1, 3)]), (0, 0, 0), 2),
]


@pytest.mark.parametrize(("shape", "turn", "count"), COUNTS)
def test_points_that_touch(shape, turn, count):
    scene = Scene([shape], [pose((0, 0, 0), Rotation.from_euler("xyz", turn, degrees=True))])
    height = -scene.gaps(on_ground=[0])[0]
    scene.poses[0, 2] = height
    touch = scene.on_ground(margin=1e-6)
    assert len(touch.gap) == count
    np.testing.assert_allclose(touch.gap, 0, atol=ROUNDING)


@pytest.mark.parametrize("tilt", [0.0, 1e-14, 1e-9, 1e-4, -1e-4])
def test_an_upright_cylinder_stands_within_its_points(tilt):
    turn = Rotation.from_euler("xyz", (tilt, 0.7 * tilt, 0.3))
    touch = Scene([solids.cylinder(0.5, 1)], [pose((0, 0, 0.5), turn)]).on_ground(margin=1e-3)
    around = np.sort(np.arctan2(touch.a[:, 1], touch.a[:, 0]))
    np.testing.assert_allclose(np.diff(around), np.pi / 2, atol=1e-3)
    np.testing.assert_allclose(np.linalg.norm(touch.a[:, :2], axis=1), 0.5, atol=1e-3)


def test_the_gap_of_a_wobbling_disc_is_that_of_its_edge():
    disc = solids.cylinder(0.3, 0.02)
    for t in np.linspace(0, 1, 31):
        turn = Rotation.from_euler("zxz", (5 * t, np.pi / 2 + 0.4 * np.sin(9 * t), 20 * t))
        scene = Scene([disc], [pose((t, 0, 0.3), turn)])
        axis = turn.as_matrix()[2, 2]
        expected = 0.3 - 0.3 * np.sqrt(1 - axis**2) - 0.01 * abs(axis)
        touch = scene.on_ground(margin=0.02)
        assert touch.gap.min() == pytest.approx(expected, abs=ROUNDING)
        assert 1 <= len(touch.gap) <= 2


def test_a_hull_keeps_the_extent_of_its_many_points():
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    rim = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    base = np.concatenate([np.c_[rim, np.full(60, z)] for z in (0.0, 1.0)])
    touch = Scene([solids.hull(base)]).on_ground(margin=1e-3)
    assert len(touch.gap) == 8
    assert ConvexHull(touch.a[:, :2]).volume > 0.75 * np.pi
