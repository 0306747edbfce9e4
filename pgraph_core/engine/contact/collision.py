"""From poses of shapes to contact points: which pairs, and where they touch.

`place` puts shapes where their rows are, `find_contacts` gives all contact points, `find_gaps` the
signed distances alone, for event functions. What a scene does not ask for is a loop of length zero.
"""

from numba import types

from .. import layout as at
from ..arrays import (
    CANDIDATES,
    F1,
    F2,
    FOUND,
    GEOMETRY,
    I2,
    SEARCH,
)
from ..compiler.jit import kernel, part, sweep
from ..vec import dot, load
from .broad import member_contacts
from .ground import ground_contacts, ground_gap, top
from .pairs import pair_contacts, pair_gap
from .shapes import far_apart, label, place


@part
def find_contacts(geometry, ground, touch, poses, search, margin, out):
    """All contact points within `margin` [m] of what may touch; how many there are.

    More than `out` holds are counted but not written: make it larger and call again. Order:
    ground, pairs, members; `poses` come from `place`.
    """
    on_ground, pairs = touch.on_ground, touch.pairs
    shapes_f = geometry.shapes_f
    room = search.room
    n = 0
    highest = top(ground) + margin if on_ground.shape[0] > 0 else 0.0
    for k in range(on_ground.shape[0]):
        i = on_ground[k, 0]
        altitude = dot(load(poses, i, at.PO_POS), load(ground, 0, at.GR_NORMAL))
        if altitude - shapes_f[i, at.SH_REACH] <= highest:
            first = n
            n = ground_contacts(geometry, ground, poses, i, margin, room, out, n)
            label(out, first, n, i, -1, on_ground[k, 1])
    for k in range(pairs.shape[0]):
        i, j, contact = pairs[k, 0], pairs[k, 1], pairs[k, 2]
        if not far_apart(shapes_f, poses, i, j, margin):
            n = pair_contacts(geometry, poses, i, j, contact, margin, room, out, n)
    return member_contacts(geometry, touch, poses, search, margin, out, n)


@sweep
def find_gaps(geometry, ground, touch, poses, room, probe, gaps):
    """Signed distance of every shape from the ground, then of every pair [m]; not of members.

    `probe` is `out` for the points of one touch: scratch.
    """
    on_ground, pairs = touch.on_ground, touch.pairs
    count = on_ground.shape[0]
    for k in range(count):
        gaps[k] = ground_gap(geometry, ground, poses, on_ground[k, 0])
    for k in range(pairs.shape[0]):
        gaps[count + k] = pair_gap(geometry, poses, pairs[k, 0], pairs[k, 1], room, probe)


# Entry points: for Python, and by address for what steps


@kernel(types.int64(GEOMETRY, F2, CANDIDATES, F2, SEARCH, types.float64, FOUND))
def contacts(geometry, ground, touch, poses, search, margin, out):
    """`find_contacts`."""
    return find_contacts(geometry, ground, touch, poses, search, margin, out)


@kernel(types.void(GEOMETRY, F2, CANDIDATES, F2, F2, FOUND, F1))
def gaps(geometry, ground, touch, poses, room, probe, found):
    """`find_gaps`."""
    find_gaps(geometry, ground, touch, poses, room, probe, found)


@kernel(types.void(I2, F2, F2, F2))
def shape_poses(shapes_i, shapes_f, work, poses):
    """`place`."""
    place(shapes_i, shapes_f, work, poses)
