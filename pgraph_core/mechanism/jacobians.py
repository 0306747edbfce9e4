"""Jacobians of points of bodies, and what they miss of accelerations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..engine import layout as at
from ..engine.tree import dynamics
from ..system import Array, point_in_row

if TYPE_CHECKING:
    from .mechanism import Mechanism


def jacobian(mech: Mechanism, q: Array, name: str, point: Sequence[float]) -> Array:
    """J (6, nv) of `point` (body axes) of a body, eq. (20)."""
    number = mech.topology.number(name)
    q = mech.position(q)
    return _of_body(mech, q, number, mech.finite("point", point, 3))


def jacobian_bias(mech: Mechanism, q: Array, v: Array, name: str, point: Sequence[float]) -> Array:
    """J' v (6,) of `point` (body axes) of a body (R6)."""
    q, v = mech.position(q), mech.finite("v", v, mech.nv)
    number = mech.topology.number(name)
    row, place = _place(mech, number, mech.finite("point", point, 3))
    bias = np.empty(6)
    dynamics.jacobian_bias(*mech.tree, q, v, mech.rest, row, place, mech.work, bias)
    return bias


def tip_jacobian(mech: Mechanism, q: Array) -> Array:
    """J (6 n_t, nv), eqs. (18)-(20), one block row a tip body."""
    q = mech.position(q)
    blocks = [
        _of_body(mech, q, int(tip), mech.model.body(mech.names[tip - 1]).tip_point)
        for tip in mech.tips
    ]
    return np.concatenate(blocks) if blocks else np.zeros((0, mech.nv))


def _of_body(mech: Mechanism, q: Array, number: int, point: Any) -> Array:
    jac = np.zeros((6, mech.nv))
    row, place = _place(mech, number, point)
    dynamics.jacobian(*mech.tree, q, mech.rest, row, place, mech.work, jac)
    return jac


def _place(mech: Mechanism, number: int, point: Any) -> tuple[int, Array]:
    """(row, point in its axes) of a point of a body."""
    return int(mech.system.bodies_i[number, at.ROW]), point_in_row(mech.system, number, point)
