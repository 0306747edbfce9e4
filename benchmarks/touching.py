"""The search for contact points between balls."""

from __future__ import annotations

from typing import Any

import numpy as np

from pgraph_core.contact import solids
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
from .timing import Case

RADIUS = 0.5


def balls(count: int, apart: float) -> Case:
    """Balls on a cubic grid `apart` from each other, each shaken by 2 % of that.

    Every two may touch. One diameter apart is a heap; farther, the search is all there is.
    """
    rng = np.random.default_rng(0)
    side = round(count ** (1 / 3) + 0.5)
    places = np.indices((side, side, side)).reshape(3, -1).T[:count] + 0.0
    places = apart * (places + rng.uniform(-0.02, 0.02, (count, 3)))
    found, ours = pgraph(places)
    sides: dict[str, Any] = {"pgraph": ours}
    agreement = f"{found} contacts"
    if has("mujoco"):
        theirs, number = mujoco(places)
        if number != found:
            raise SystemExit(f"balls: {found} contacts here, {number} in MuJoCo; nothing is timed")
        sides["mj_collision"] = theirs
        agreement += ", mujoco as many"
    where = "in a heap" if apart <= 2 * RADIUS else "apart"
    return Case(f"contacts of {count} balls {where}", sides, "search", agreement=agreement)


def pgraph(places: np.ndarray) -> tuple[int, Any]:
    """(the number of contacts, the call of the search)."""
    count = len(places)
    ball = solids.sphere(RADIUS)
    geometry = solids.packed([solids.Placed(ball, i, i) for i in range(1, count + 1)])
    poses = table(POSE, count)
    poses["position"], poses["rotation"] = places, np.eye(3).ravel()
    search = solids.search_space(geometry, count)
    members = rows_of(MEMBER, [(i, 0) for i in range(count)])
    none = (rows_of(kind, ()) for kind in (GROUND_PAIR, SHAPE_PAIR))
    touch = Candidates(*none, members, rows_of(APART, ()))
    out, ground = table(CONTACT, 6 * count), solids.ground((0, 0, 1))

    def call() -> int:
        return kernels.contacts(geometry, ground, touch, poses, search, 0.0, out)

    return call(), call


def mujoco(places: np.ndarray) -> tuple[Any, int]:
    """(the call of mj_collision on the same balls, the number of contacts that it finds)."""
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
    return lambda: mujoco.mj_collision(model, data), data.ncon
