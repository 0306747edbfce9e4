"""Where the bodies of a description are, and how they move: by its joints, in plain Python."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import joints
from ..rotation import Array, matrix, rodrigues, unit_vector
from .body import Body
from .sentences import GROUND


@dataclass(frozen=True)
class Pose:
    """A body frame in the world, and its velocity."""

    position: Array  # (3,) [m]
    rotation: Array  # (3, 3)
    velocity: Array  # (3,) of the origin [m/s]
    spin: Array  # (3,) [rad/s]

    def place(self, point: Any) -> Array:
        """A point of the body in the world [m]."""
        return self.position + self.rotation @ np.asarray(point, dtype=float)

    def speed(self, point: Any) -> Array:
        """Velocity of a point of the body [m/s]."""
        return self.velocity + np.cross(self.spin, self.place(point) - self.position)


STILL = Pose(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))


def poses(
    bodies: Mapping[str, Body], q: Mapping[str, Any], v: Mapping[str, Any]
) -> dict[str, Pose]:
    """Of all bodies and the ground; q and v by name, the bodies' own where they are left out."""
    found = {GROUND: STILL}

    def pose(name: str) -> Pose:
        if name not in found:
            body = bodies[name]
            found[name] = _carried(
                pose(body.parent), body, q.get(name, body.q), v.get(name, body.v)
            )
        return found[name]

    for name in bodies:
        pose(name)
    return found


def _carried(parent: Pose, body: Body, q: Any, v: Any) -> Pose:
    """A body on its joint."""
    R, home = parent.rotation, matrix(body.rotation)
    arm = R @ np.array(body.link)
    x, u, w = parent.position + arm, parent.velocity + np.cross(parent.spin, arm), parent.spin
    i = j = 0
    for motion in body.sequence:
        nq, nv = joints.SIZE[motion.kind]
        a, b = np.array(q[i : i + nq], dtype=float), np.array(v[j : j + nv], dtype=float)
        axis = R @ home @ unit_vector(motion.axis)
        if motion.kind == "translate":
            x, u = x + axis * a[0], u + np.cross(w, axis * a[0]) + axis * b[0]
        elif motion.kind == "rotate":
            w = w + axis * b[0]
            R = rodrigues(axis, float(a[0])) @ R
        else:
            if motion.kind == "free":
                x, u = x + R @ a[:3], u + np.cross(w, R @ a[:3]) + R @ b[3:]
            w = w + R @ b[:3]
            R = R @ matrix(a[-4:].tolist())
        i, j = i + nq, j + nv
    return Pose(x, R @ home, u, w)


def coordinate(
    joint: str, a: Pose, b: Pose, home: Array, axis: Array, point: Array, other: Array
) -> tuple[Any, Any]:
    """(q, v) of a joint that carries body a on b: `point` of a at `other` of b.

    `home` is the rotation of a against b, and `axis` that of a, where q is 0.
    """
    from scipy.spatial.transform import Rotation

    turned = b.rotation.T @ a.rotation
    spin = a.spin - b.spin
    if joint == "spherical":
        x, y, z, w = Rotation.from_matrix(turned @ home.T).as_quat().tolist()
        return (w, x, y, z), tuple((b.rotation.T @ spin).tolist())
    if joint == "weld":
        return (), ()
    along = a.rotation @ axis
    angle = float(Rotation.from_matrix(home.T @ turned).as_rotvec() @ axis)
    apart = float(along @ (a.place(point) - b.place(other)))
    at_a = b.velocity + np.cross(b.spin, a.place(point) - b.position)
    turn, slide = float(along @ spin), float(along @ (a.speed(point) - at_a))
    if joint == "cylindrical":
        return (angle, apart), (turn, slide)
    return ((angle,), (turn,)) if joint == "revolute" else ((apart,), (slide,))
