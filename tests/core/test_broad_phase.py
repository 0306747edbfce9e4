"""The broad phase finds every pair that touches, and no pair that may not touch."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pgraph_core import shapes as solids

from .touching import Scene, random_pose, random_solid

seeds = st.integers(0, 2**32 - 1)


def found(touch) -> set[tuple[int, int]]:
    return {(int(i), int(j)) for i, j in touch.whose[:, :2]}


def all_pairs(scene: Scene, margin: float) -> set[tuple[int, int]]:
    pairs = list(itertools.combinations(range(len(scene.shapes)), 2))
    return {pair for pair, gap in zip(pairs, scene.gaps(pairs=pairs)) if gap <= margin}


@given(seeds, st.integers(0, 40), st.sampled_from((0.0, 0.2)), st.booleans())
def test_the_grid_finds_every_pair(seed, count, margin, mixed):
    rng = np.random.default_rng(seed)
    sizes = 10.0 ** rng.uniform(-1, 1, count) if mixed else np.full(count, 0.7)
    kinds = rng.choice(["sphere", "capsule", "box"], count)
    shapes = [random_solid(rng, kind, size) for kind, size in zip(kinds, sizes)]
    scene = Scene(shapes, np.array([random_pose(rng, 1.0) for _ in shapes]).reshape(-1, 12))
    touch = scene.among([(i, 0) for i in range(count)] or (), margin=margin)
    assert found(touch) == all_pairs(scene, margin)
    assert (touch.whose[:, 0] < touch.whose[:, 1]).all()


def heap(count: int, seed: int = 0) -> Scene:
    rng = np.random.default_rng(seed)
    scene = Scene([solids.sphere(r) for r in rng.uniform(0.4, 0.5, count)])
    scene.poses[:, :3] = rng.uniform(0, 0.9 * count ** (1 / 3), (count, 3))
    return scene


@pytest.mark.parametrize("where", [1e9, -1e9, 1e300])
def test_a_shape_far_away_changes_nothing(where):
    scene = heap(100)
    expected = {pair for pair in all_pairs(scene, 0.0) if 7 not in pair}
    scene.poses[7, 0] = where
    assert found(scene.among([(i, 0) for i in range(100)])) == expected


def test_a_shape_at_nan_touches_nothing():
    scene = heap(50)
    scene.poses[7] = np.nan
    assert not any(7 in pair for pair in found(scene.among([(i, 0) for i in range(50)])))


def test_members_of_different_contacts_do_not_touch():
    scene = heap(60)
    sides = np.arange(60) % 2
    touch = scene.among([(i, int(sides[i])) for i in range(60)])
    expected = {(i, j) for i, j in all_pairs(scene, 0.0) if sides[i] == sides[j]}
    assert found(touch) == expected
    assert (touch.whose[:, 3] == sides[touch.whose[:, 0]]).all()
