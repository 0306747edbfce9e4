"""Wrenches on bodies, as `external` of the dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..engine import motion
from ..loads import TYPES as LOADS
from ..model import Force
from ..system import Array
from .bodies import shifted
from .scene import Scene

if TYPE_CHECKING:
    from .mechanism import Mechanism

NO_CONSTRAINTS = np.zeros(0, dtype=np.int64)


def external_at(
    mech: Mechanism,
    q: Array,
    name: str,
    wrench: Sequence[float] | Array,
    point: Sequence[float] | Array | None = None,
) -> Array:
    """(nb, 6) of one wrench (6,) at `point` of a body, its `tip` unless given."""
    number = mech.topology.number(name)
    external, wrench = np.zeros((mech.nb, 6)), mech.finite("wrench", wrench, 6)
    if number > 0:  # the ground takes any force
        point = mech.model.body(name).tip_point if point is None else point
        arm = mech.pose(q, name)[1] @ mech.finite("point", point, 3)
        external[number - 1] = shifted(wrench, arm)
    return external


def external_at_tips(mech: Mechanism, q: Array, wrench: Array) -> Array:
    """(nb, 6) of wrenches (n_t, 6) on the tips, at their `tip` points."""
    wrench = mech.finite("wrench", wrench, len(mech.tips), 6)
    tips = mech.tips - 1
    points = np.array([mech.model.body(mech.names[k]).tip_point for k in tips])
    arm = np.einsum("tij,tj->ti", mech.poses(q)[1][tips], points.reshape(-1, 3))
    external = np.zeros((mech.nb, 6))
    external[tips] = shifted(wrench, arm)
    return external


def load_wrenches(
    mech: Mechanism, forces: tuple[Force, ...], t: Array, q: Array, v: Array
) -> Array:
    """(n, nb, 6) of what wrenches and springs in `forces` do in n states at times t."""
    external = np.zeros((len(t), mech.nb, 6))
    acting = [f for f in forces if f.kind in LOADS]
    if acting:
        number = mech.topology.number
        carriers = np.array([(number(f.body), number(f.other)) for f in acting])
        scene = Scene(mech, mech.passive, mech.loads(forces), NO_CONSTRAINTS)
        for i in range(len(t)):
            state = (t[i], q[i], v[i], external[i])
            motion.load_wrenches(scene.address, carriers, *mech.system[2:4], *state)
    return external
