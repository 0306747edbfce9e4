"""Shapes of one body that form one solid: found among many without a look at each pair."""

import numpy as np
import pytest

from pgraph_core.contact.packed_shapes import Placed, _near, neighbours_of
from pgraph_core.engine.contact.placing import DEPTH
from pgraph_core.rotation import matrix
from pgraph_core.shapes.boxes import box


def scattered(n, size, rng):
    """Boxes on two bodies, of which some touch fewer partners."""
    turns = rng.normal(size=(n, 4))
    shapes = [
        Placed(
            box(rng.uniform(0.1, 0.5, 3)), k % 2, k % 2, rng.uniform(-size, size, 3).tolist(),
            np.array(matrix(turn / np.linalg.norm(turn))),
        )
        for k, turn in enumerate(turns)
    ]  # fmt: skip
    partners = [{1, 2} if k % 5 else ({1} if k % 3 else set[int]()) for k in range(n)]
    return shapes, partners


def overlap(a, b):
    """Check whether the boxes along the axes around two shapes overlap."""
    (half, middle), (other_half, other) = (
        (abs(s.rotation) @ s.solid.box[0], s.position + s.rotation @ s.solid.box[1]) for s in (a, b)
    )
    slack = DEPTH * min(a.solid.reach, b.solid.reach)
    return bool((abs(middle - other) <= half + other_half + slack).all())


@pytest.mark.parametrize("size", [0.3, 1.0, 4.0])
def test_neighbours_are_all_that_overlap_in_the_order_of_shapes(size):
    shapes, partners = scattered(60, size, np.random.default_rng(3))
    expected = [
        [
            m for m, b in enumerate(shapes)
            if m != k and a.row == b.row and partners[k] and partners[k] <= partners[m]
            and overlap(a, b)
        ]
        for k, a in enumerate(shapes)
    ]  # fmt: skip
    assert neighbours_of(shapes, partners) == expected
    assert any(expected)


def test_only_boxes_near_each_other_are_compared():
    """Of 500 boxes in a row, each is compared with the next one."""
    middle = np.outer(np.random.default_rng(0).permutation(500), (0.0, 1.0, 0.0))
    pairs = [
        sorted((k, int(m))) for k, others in _near(middle, np.full((500, 3), 0.6)) for m in others
    ]
    assert len(pairs) == 499
    assert all(abs(middle[k] - middle[m]).max() == 1.0 for k, m in pairs)


def test_equal_boxes_are_one_solid():
    """Normals, edges and sizes of 3000 equal boxes are computed once."""
    assert box((1, 2, 3)) is box(np.array((1.0, 2.0, 3.0)))
    assert box((1, 2, 3)) is not box((1, 2, 4))
