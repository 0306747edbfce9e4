"""Wrenches and springs between bodies as generalised forces, from the dense operators."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from pgraph_core.joints import home
from pgraph_core.model import Force, VectorTable
from pgraph_core.paper import Operators, frames, home_poses
from pgraph_core.rotation import Array, unit_vector


class Load(NamedTuple):
    """Effect of a force on bodies in a state."""

    tau: Array  # (nv,) generalised force
    energy: float  # stored in its spring [J]
    power: float  # of a wrench, put in [W]
    dissipated: float  # by its damper [W]


def load_of(op: Operators, f: Force, t: float = 0.0) -> Load:
    """The wrench, spring or torsion spring `f` at the state of `op` and time t."""
    return {"wrench": _wrench, "spring": _spring, "torsion": _torsion}[f.kind](op, f, t)


def _wrench(op: Operators, f: Any, t: float) -> Load:
    number = op.topology.number(f.body)
    wrench = np.concatenate((_at(f.torque, t), _at(f.force, t)))
    if f.frame == "body":
        wrench = (wrench.reshape(2, 3) @ op.rotation[number - 1].T).reshape(6)
    J = op.point_jacobian(number, np.array(f.point or (0.0, 0.0, 0.0)))
    return Load(J.T @ wrench, 0.0, float(wrench @ (J @ op.speeds)), 0.0)


def _at(value: Any, t: float) -> Array:
    """A vector, or a table of vectors, at time t."""
    if isinstance(value, VectorTable):
        return np.array([np.interp(t, value.t, column) for column in np.array(value.value).T])
    return np.array(value)


def _spring(op: Operators, f: Any, _: float) -> Load:
    tip = op.bodies[op.topology.number(f.body) - 1].tip_point
    via = [(one.body, one.point) for one in f.via]
    path = [(f.body, f.point or tip), *via, (f.other, f.other_point or (0.0, 0.0, 0.0))]
    length, along = 0.0, np.zeros(op.nv)
    for (a, x), (b, y) in itertools.pairwise(path):
        (x_a, J_a), (x_b, J_b) = _end(op, a, np.array(x)), _end(op, b, np.array(y))
        length += float(np.linalg.norm(x_a - x_b))
        along += unit_vector(x_a - x_b) @ (J_a - J_b)[3:]
    rest = _length_at_home(op, path) if f.rest is None else f.rest
    return _law(f, length - rest, along, op.speeds)


def _length_at_home(op: Operators, path: Any) -> float:
    position, rotation = home_poses(op.model)
    numbers = [op.topology.number(name) - 1 for name, _ in path]
    places = [
        position[k] + rotation[k] @ x if k >= 0 else np.array(x) for k, (_, x) in zip(numbers, path)
    ]
    return sum(float(np.linalg.norm(a - b)) for a, b in itertools.pairwise(places))


def _end(op: Operators, name: str, point: Array) -> tuple[Array, Array]:
    number = op.topology.number(name)
    if number == 0:
        return point, np.zeros((6, op.nv))
    return op.point_position(number, point), op.point_jacobian(number, point)


def _torsion(op: Operators, f: Any, _: float) -> Load:
    """The twist of `body` about `axis`, from the quaternion (w, v) of its rotation from `other`."""
    a, b = op.topology.number(f.body), op.topology.number(f.other)
    origin = np.zeros(3)
    turn_a, turn_b = (_turn_since_zero(op, n) for n in (a, b))
    axis = _turn_at_zero(op, a) @ unit_vector(f.axis or (0.0, 0.0, 1.0))
    *v, w = Rotation.from_matrix(turn_b.T @ turn_a).as_quat()
    u = axis @ v
    slope = turn_b @ (w * w * axis + w * np.cross(v, axis) + u * np.array(v)) / (w * w + u * u)
    angle = 2.0 * np.arctan2(u, w) - f.rest
    angle = float((angle + np.pi) % (2 * np.pi) - np.pi)
    J = _end(op, f.body, origin)[1][:3] - _end(op, f.other, origin)[1][:3]
    return _law(f, angle, slope @ J, op.speeds)


def _turn_at_zero(op: Operators, number: int) -> Array:
    q = [x for body in op.bodies for x in home(body.sequence)]
    return frames(op.model, op.topology, q)[1][number - 1] if number else np.eye(3)


def _turn_since_zero(op: Operators, number: int) -> Array:
    return op.rotation[number - 1] @ _turn_at_zero(op, number).T if number else np.eye(3)


def _law(f: Any, stretch: float, slope: Array, v: Array) -> Load:
    """A linear spring and damper on one coordinate whose rate is slope · v."""
    k, d, rate = f.stiffness, f.damping, float(slope @ v)
    return Load(-(k * stretch + d * rate) * slope, k * stretch**2 / 2, 0.0, d * rate**2)
