"""Contact of two shapes: signed distance, points, symmetry, continuity, degenerate cases."""

import itertools

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pgraph_core import shapes as solids

from ..nights import combined
from .convex import signed_distance
from .touching import CURVED, KINDS, Scene, Touch, moved, pose, random_pose, random_solid, rounded

PAIRS = list(itertools.product(KINDS, KINDS))
ALL = list(itertools.product((*KINDS, *CURVED), (*KINDS, *CURVED)))
SPREADS = (0.05, 0.3, 1.0)  # deep, touching, apart
ROUNDING = 1e-12  # of shapes about 1 m large
PREFERRED = 3e-9  # a face is taken where two edges overlap less by this: numerics of `solids`

seeds = st.integers(0, 2**32 - 1)


def scene_of(seed: int, kinds: tuple[str, str], *, square: bool = False) -> Scene:
    rng = np.random.default_rng(seed)
    spread = float(rng.choice(SPREADS))
    shapes = [random_solid(rng, kind) for kind in kinds]
    return Scene(shapes, [random_pose(rng, spread, square=square) for _ in kinds])


def true_gap(scene: Scene) -> float:
    a, b = scene.shapes
    return signed_distance(scene.placed(0), scene.placed(1)) - rounded(a) - rounded(b)


@pytest.mark.parametrize(("kinds", "square"), combined(PAIRS, [False, True]), ids=str)
def test_gap_is_the_signed_distance(kinds, square):
    for seed in range(4):
        scene = scene_of(seed, kinds, square=square)
        assert scene.gap() == pytest.approx(true_gap(scene), abs=PREFERRED), seed


@pytest.mark.parametrize("kind", ["box", "capsule", "sphere"])
def test_the_gap_to_a_mesh_in_single_precision(kind):
    """Faces are flat to rounding only, and the other shape is parallel to one of them."""
    for seed in range(14):
        rng = np.random.default_rng(seed)
        angle = np.sort(rng.uniform(0, 2 * np.pi, 9))
        outline = np.column_stack((0.05 * np.cos(angle), 0.03 * np.sin(angle)))
        prism = np.array([(x, y, z) for x, y in outline for z in (-0.01, 0.01)])
        turned = Rotation.random(random_state=seed).apply(prism)
        solid = solids.hull(turned.astype(np.float32).astype(float))
        ring = solid.vertices[list(max(solid.rings, key=len))]
        x, n = ring[1] - ring[0], np.cross(ring[1] - ring[0], ring[2] - ring[0])
        x, n = x / np.linalg.norm(x), n / np.linalg.norm(n)
        axes = np.column_stack((n, x, np.cross(n, x)))  # along the face lies the other shape's z
        turn = Rotation.from_matrix(axes) * Rotation.from_rotvec((rng.uniform(0, 6), 0, 0))
        place = ring.mean(axis=0) + axes @ (rng.uniform(0.02, 0.1), *rng.uniform(-0.06, 0.06, 2))
        other = {
            "box": lambda: solids.box((0.01, 0.02, 0.03)),
            "capsule": lambda: solids.capsule(0.002, 0.04),
            "sphere": lambda: solids.sphere(0.002),
        }[kind]()
        scene = Scene([other, solid], [pose(place, turn), pose()])
        assert scene.gap() == pytest.approx(true_gap(scene), abs=3e-8), seed
        assert scene.gap(1, 0) == pytest.approx(scene.gap(), abs=1e-12), seed


def test_points_have_the_gap_of_the_nearest_of_them():
    for seed, kind in itertools.product(range(5), KINDS):
        scene = scene_of(seed, ("points", kind))
        places = scene.placed(0)
        radius = rounded(scene.shapes[1])
        each = [signed_distance(p[None], scene.placed(1)) - radius for p in places]
        assert scene.gap() == pytest.approx(min(each), abs=ROUNDING)
        touch = scene.pair()
        assert len(touch.gap) >= len(places)
        assert len(set(touch.whose[:, 2])) == len(touch.gap)


def assert_well_formed(scene: Scene, touch: Touch) -> None:
    assert 1 <= len(touch.gap) <= 8
    np.testing.assert_allclose(np.linalg.norm(touch.normal, axis=1), 1, atol=ROUNDING)
    along = ((touch.a - touch.b) * touch.normal).sum(axis=1)
    np.testing.assert_allclose(along, touch.gap, atol=ROUNDING)
    assert touch.gap.min() == scene.gap()
    assert len(set(touch.whose[:, 2])) == len(touch.gap), "features are told apart"
    for side, points in ((0, touch.a), (1, touch.b)):
        shape = scene.shapes[side]
        for p in points:
            beyond = signed_distance(p[None], scene.placed(side)) - rounded(shape)
            assert beyond < PREFERRED, "the point is in the shape"


@pytest.mark.parametrize(("kinds", "square"), combined(PAIRS, [False, True]), ids=str)
def test_contact_points_lie_in_the_shapes(kinds, square):
    for seed in range(4):
        scene = scene_of(seed, kinds, square=square)
        if true_gap(scene) > -0.02:  # where one lies deep in the other a point may leave it
            assert_well_formed(scene, scene.pair())


@given(seeds, st.sampled_from(ALL), st.booleans())
def test_exchange_turns_the_normal(seed, kinds, square):
    scene = scene_of(seed, kinds, square=square)
    there, back = scene.gap(0, 1), scene.gap(1, 0)
    assert there == pytest.approx(back, abs=PREFERRED)
    first, second = scene.pair(0, 1), scene.pair(1, 0)
    only = not square and len(first.gap) == 1 == len(second.gap)
    if there > 1e-6 and only:  # one nearest pair, one direction
        np.testing.assert_allclose(first.normal, -second.normal, atol=1e-8)
        np.testing.assert_allclose(first.a, second.b, atol=1e-8)


@given(seeds, st.sampled_from(ALL), st.sampled_from((0.0, 1.0, 1e4)))
def test_a_common_motion_changes_nothing(seed, kinds, far):
    scene = scene_of(seed, kinds)
    before = scene.pair()
    rng = np.random.default_rng(seed)
    turn, shift = Rotation.random(rng=rng), far * rng.normal(size=3)
    scene.poses = moved(scene.poses, shift, turn)
    after = scene.pair()
    slack = 1e-11 + 1e-15 * far  # rounding of places
    assert after.gap.min() == pytest.approx(before.gap.min(), abs=PREFERRED)
    if len(before.gap) == 1 == len(after.gap) and before.gap[0] > 1e-3:
        np.testing.assert_allclose(turn.apply(before.normal), after.normal, atol=1e4 * slack)


@given(seeds, st.sampled_from(ALL))
def test_the_gap_changes_no_faster_than_the_shapes_move(seed, kinds):
    """No jump where the feature changes, or from apart to penetrating."""
    scene = scene_of(seed, kinds)
    rng = np.random.default_rng(seed)
    away = scene.poses[0, :3] - scene.poses[1, :3]
    axis = rng.normal(size=3)
    start = scene.poses.copy()
    reach = scene.shapes[0].reach
    steps, size = 60, 0.05
    last = scene.gap()
    for k in range(1, steps):
        turn = Rotation.from_rotvec(size * k * axis / np.linalg.norm(axis))
        turned = turn * Rotation.from_matrix(start[0, 3:].reshape(3, 3))
        scene.poses[0] = pose(start[0, :3] - away * 2 * k / steps, turned)
        now = scene.gap()
        most = np.linalg.norm(away) * 2 / steps + size * reach
        assert abs(now - last) <= most + PREFERRED
        last = now


@pytest.mark.parametrize("kinds", ALL, ids="-".join)
def test_shapes_at_one_place_penetrate_by_a_finite_depth(kinds):
    rng = np.random.default_rng(3)
    scene = Scene([random_solid(rng, kind) for kind in kinds])
    touch = scene.pair()
    assert np.isfinite([touch.a, touch.b]).all()
    assert touch.gap.min() < 0
    if not set(kinds) & set(CURVED):
        assert touch.gap.min() == pytest.approx(true_gap(scene), abs=PREFERRED)
    np.testing.assert_allclose(np.linalg.norm(touch.normal, axis=1), 1, atol=ROUNDING)


LYING = Rotation.from_euler("x", 90, degrees=True)


@pytest.mark.parametrize("shift", [0.0, 0.3, 0.9])
@pytest.mark.parametrize("turn", [0.0, 1e-12, 1e-7, 1e-2])
def test_parallel_capsules_touch_where_their_overlap_ends(shift, turn):
    """Nearly parallel capsules keep both points."""
    poses = [pose((0, shift, 0.4), Rotation.from_euler("z", turn) * LYING), pose(rotation=LYING)]
    touch = Scene([solids.capsule(0.2, 1), solids.capsule(0.2, 1)], poses).pair(margin=0.05)
    assert touch.gap.min() == pytest.approx(0, abs=ROUNDING if shift < 0.9 else 1e-4)
    assert np.ptp(touch.a[:, 1]) > 0.9 * (1 - shift)
    if not turn:
        np.testing.assert_allclose(touch.gap, [0, 0], atol=ROUNDING)
        np.testing.assert_allclose(touch.normal, [[0, 0, 1]] * 2, atol=ROUNDING)
        np.testing.assert_allclose(np.sort(touch.a[:, 1]), [shift - 0.5, 0.5], atol=ROUNDING)


def test_a_capsule_without_length_is_a_ball():
    box = solids.box((1, 2, 3))
    where = [pose((0.8, 0.3, 1.7)), pose()]
    ball = Scene([solids.sphere(0.2), box], where).gap()
    for length in (1e-300, 1e-12):
        thin = solids.capsule(0.2, length)
        assert Scene([thin, box], where).gap() == pytest.approx(ball, abs=1e-11)
        poses = [pose((0.3, 0, 0.1)), pose(rotation=LYING)]
        assert Scene([thin, solids.capsule(0.2, 1)], poses).pair().gap.shape == (1,)


@pytest.mark.parametrize("short", [0, 1])
def test_a_short_capsule_touches_a_long_one_at_one_point(short):
    """Both ends of a segment that is short beside the other are one point, of either shape.

    The two are parallel, so that both ends are equally near.
    """
    rng = np.random.default_rng(short)
    for length in (1.0, 30.0):
        at, radius, gap = rng.uniform(-0.4, 0.4) * length, *rng.uniform(0.01, 0.2, 2)
        solid = [solids.capsule(radius, 1e-12 * length), solids.capsule(radius, length)]
        where = [pose((2 * radius + gap, 0, at)), pose()]
        turned = slice(None, None, -1 if short else 1)
        touch = Scene(solid[turned], where[turned]).pair()
        assert touch.gap == pytest.approx([gap], abs=ROUNDING * length)
        away = (-1.0 if short else 1.0, 0, 0)
        np.testing.assert_allclose(touch.normal, [away], atol=ROUNDING * length / gap)


def test_capsules_whose_axes_cross_overlap_across_both():
    """By the sum of the radii, along one of the two units across both axes."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        radii, lengths, turns = (*rng.uniform((0.05, 0.5), (0.3, 2.0), (2, 2)).T,
                                 Rotation.random(2, rng=rng))  # fmt: skip
        axes = turns.apply((0, 0, 1))
        places = (rng.uniform(-0.4, 0.4, 2) * lengths)[:, None] * axes  # they cross at the origin
        shapes = [solids.capsule(*sizes) for sizes in zip(radii, lengths, strict=True)]
        touch = Scene(shapes, [*map(pose, places, turns)]).pair()
        deepest = touch.gap.argmin()
        assert touch.gap[deepest] == pytest.approx(-radii.sum(), abs=ROUNDING)
        across = np.cross(*axes) / np.linalg.norm(np.cross(*axes))
        sign = np.sign(touch.normal[deepest] @ across)
        np.testing.assert_allclose(touch.normal[deepest], sign * across, atol=ROUNDING)


@pytest.mark.parametrize(("turn", "count"), [(0.0, 4), (np.pi / 4, 8), (0.1, 8)])
@pytest.mark.parametrize("gap", [-1e-3, -1e-9, 0.0, 1e-9, 1e-3])
def test_boxes_face_to_face_touch_at_the_corners_of_the_common_area(turn, count, gap):
    poses = [pose((0.0, 0.0, 1 + gap), Rotation.from_euler("z", turn)), pose()]
    touch = Scene([solids.box((1, 1, 1)), solids.box((1, 1, 1))], poses).pair(margin=0.01)
    assert len(touch.gap) == count
    np.testing.assert_allclose(touch.gap, gap, atol=1e-9)
    np.testing.assert_allclose(touch.normal, [[0, 0, 1]] * count, atol=1e-9)
    np.testing.assert_allclose(touch.a.mean(axis=0)[:2], 0, atol=1e-9)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("sizes", [((0.4, 0.4, 0.1), (1e3, 1e3, 1)), ((9, 1, 1), (1, 9, 1))])
def test_nearly_parallel_faces_touch_where_they_overlap(sizes, size):
    """A corner beside the common area touches nothing, however little it is nearer to the face."""
    small, large = (size * np.array(x) for x in sizes)
    area = np.minimum(small, large)[:2] / 2
    rng = np.random.default_rng(5)
    for tilt in 10.0 ** np.arange(-15.0, -6.0, 0.45):
        turn = Rotation.from_rotvec(tilt * rng.uniform(-1, 1, 3))
        for depth in (1e-6, 1e-5):
            above = pose((0, 0, (small[2] + large[2]) / 2 - depth * size), turn)
            shapes = [solids.box(tuple(small)), solids.box(tuple(large))]
            touch = Scene(shapes, [above, pose()]).pair(margin=0.0)
            assert len(touch.gap)
            assert (abs(touch.a[:, :2]) <= area + 1e-5 * size).all()


def test_edges_that_cross_touch_at_one_point():
    up = Rotation.from_euler("y", 45, degrees=True)
    poses = [pose((0, 0, np.sqrt(2) + 0.01), Rotation.from_euler("z", 90, degrees=True) * up)]
    scene = Scene([solids.box((1, 3, 1)), solids.box((1, 3, 1))], [*poses, pose(rotation=up)])
    touch = scene.pair(margin=0.05)
    assert touch.gap == pytest.approx([0.01], abs=ROUNDING)
    np.testing.assert_allclose(touch.a, [[0, 0, np.sqrt(0.5) + 0.01]], atol=ROUNDING)


def test_a_capsule_lies_on_a_box_at_two_points():
    lying = Rotation.from_euler("y", 90, degrees=True)
    shapes = [solids.capsule(0.1, 1), solids.box((2, 2, 1))]
    inside = Scene(shapes, [pose((0, 0.2, 0.6), lying), pose()]).pair(margin=0.01)
    np.testing.assert_allclose(np.sort(inside.b[:, 0]), [-0.5, 0.5], atol=ROUNDING)
    beyond = Scene(shapes, [pose((0.8, 0.2, 0.6), lying), pose()]).pair(margin=0.01)
    np.testing.assert_allclose(np.sort(beyond.b[:, 0]), [0.3, 1.0], atol=ROUNDING)
    along_edge = Scene(shapes, [pose((0, 1.06, 0.58), lying), pose()]).pair(margin=0.01)
    np.testing.assert_allclose(along_edge.gap, 0, atol=ROUNDING)
    np.testing.assert_allclose(np.sort(along_edge.b[:, 0]), [-0.5, 0.5], atol=ROUNDING)


@pytest.mark.parametrize(("kinds", "size"), combined(PAIRS, [1e-9, 1e3]), ids=str)
def test_tiny_and_huge_shapes_are_alike(kinds, size):
    for seed in range(2):
        rng, again = np.random.default_rng(seed), np.random.default_rng(seed)
        shapes = [random_solid(rng, kind) for kind in kinds]
        scaled = [random_solid(again, kind, size) for kind in kinds]
        poses = np.array([random_pose(rng, 0.5) for _ in kinds])
        grown = poses.copy()
        grown[:, :3] *= size
        assert Scene(scaled, grown).gap() == pytest.approx(
            size * Scene(shapes, poses).gap(), abs=PREFERRED * size
        )


@example(1e-9)
@example(-1e-9)
@given(st.floats(-0.2, 0.2))
def test_a_large_box_and_a_small_one(gap):
    poses = [pose((300.0, 20.0, 500.0 + 5e-4 + gap)), pose()]
    touch = Scene([solids.box((1e-3, 1e-3, 1e-3)), solids.box((1e3, 1e3, 1e3))], poses).pair()
    assert touch.gap.min() == pytest.approx(max(gap, -0.5005), abs=PREFERRED * 1e3)
    np.testing.assert_allclose(touch.normal[touch.gap.argmin()], [0, 0, 1], atol=1e-9)


@pytest.mark.parametrize("depth", [0.11, 0.15, 0.3])
@pytest.mark.parametrize(("turn", "shift"), [(0.0, 0.0), (0.3, 0.1), (-0.6, 0.05), (1.0, 0.2)])
def test_a_capsule_whose_axis_is_inside_an_edge_touches_with_its_far_side(depth, turn, shift):
    """It crosses the edge of a box and leans on both faces alike."""
    n = np.array([1, 0, 1]) / np.sqrt(2)
    axis = Rotation.from_rotvec(turn * n).apply(np.cross(n, (0, 1, 0)))
    place = np.array([0.5, shift, 0.5]) + (0.1 - depth) * n
    lies = Rotation.from_matrix(np.column_stack((np.cross(n, axis), n, axis)))
    if np.linalg.det(np.column_stack((np.cross(n, axis), n, axis))) < 0:
        lies = Rotation.from_matrix(np.column_stack((-np.cross(n, axis), n, axis)))
    scene = Scene(
        [solids.box((1.0, 1.0, 1.0)), solids.capsule(0.1, 2.0)], [pose(), pose(place, lies)]
    )
    touch, back = scene.pair(0, 1), scene.pair(1, 0)
    assert touch.gap == pytest.approx([-depth], abs=ROUNDING)
    for b, a in ((touch.b, touch.a), (back.a, back.b)):
        np.testing.assert_allclose(b, [place - 0.1 * n], atol=ROUNDING)
        np.testing.assert_allclose(a, [place - (0.1 - depth) * n], atol=ROUNDING)
