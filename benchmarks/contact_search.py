"""The search for contact points among balls against MuJoCo's mj_collision."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from pgraph_core import shapes as solids
from pgraph_core.contact import packed_shapes
from pgraph_core.engine.arrays import Candidates
from pgraph_core.engine.contact import search as kernels
from pgraph_core.engine.records import (
    APART,
    CONTACT,
    GROUND_PAIR,
    MEMBER,
    POSE,
    SHAPE_PAIR,
    rows_of,
    table,
)

from .machine import has
from .measure import Disagreement, Effort, Row, compared

MINUTES = 0.2
PEERS = ("mujoco",)
RADIUS = 0.5
Search = tuple[int, Callable[[], object]]  # the number of contacts, and the call that finds them


def rows(effort: Effort) -> Iterator[Row]:
    """Balls one diameter apart are a heap; farther, the search is all there is."""
    count = effort.pick(1000, 27)
    for where, apart in (("in a heap", 0.98), ("apart", 3.0)):
        rng = np.random.default_rng(0)
        side = round(count ** (1 / 3) + 0.5)
        places = np.indices((side, side, side)).reshape(3, -1).T[:count] + 0.0
        places = apart * (places + rng.uniform(-0.02, 0.02, (count, 3)))
        found, ours = in_pgraph(places)
        sides, agrees = {"pgraph": ours}, f"{found} contacts"
        if has("mujoco"):
            number, sides["mj_collision"] = in_mujoco(places)
            if number != found:
                raise Disagreement(f"balls: {found} contacts here, {number} in MuJoCo")
            agrees += ", mujoco as many"
        name = f"contacts of {count} balls {where}"
        yield from compared(effort, name, sides, unit="search", agrees=agrees)


def in_pgraph(places: np.ndarray) -> Search:
    """Balls of which every two may touch."""
    count = len(places)
    ball = solids.sphere(RADIUS)
    geometry = packed_shapes.packed([packed_shapes.Placed(ball, i, i) for i in range(1, count + 1)])
    poses = table(POSE, count)
    poses["position"], poses["rotation"] = places, np.eye(3).ravel()
    space = packed_shapes.search_space(geometry, count)
    members = rows_of(MEMBER, [(i, 0) for i in range(count)])
    none = (rows_of(kind, ()) for kind in (GROUND_PAIR, SHAPE_PAIR))
    touch = Candidates(*none, members, rows_of(APART, ()))
    out, ground = table(CONTACT, 6 * count), packed_shapes.ground((0, 0, 1))

    def call() -> int:
        return kernels.contacts(geometry, ground, touch, poses, space, 0.0, out)

    return call(), call


def in_mujoco(places: np.ndarray) -> Search:
    """The same balls."""
    import mujoco

    spec = mujoco.MjSpec()
    spec.memory = 1 << 30
    for place in places:
        body = spec.worldbody.add_body(pos=place)
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[RADIUS, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    return data.ncon, lambda: mujoco.mj_collision(model, data)
