"""Body poses in the initial state of a description, computed with plain NumPy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import joints
from ..fields import GROUND
from ..rotation import Array, matrix, quaternion_of, rodrigues, unit_vector
from .body import Body


@dataclass(frozen=True)
class Pose:
    """The pose of a body frame in the world."""

    position: Array  # (3,) [m]
    rotation: Array  # (3, 3)

    def place(self, point: Any) -> Array:
        """Return the world position of a body point [m]."""
        return self.position + self.rotation @ np.asarray(point, dtype=float)


def poses(bodies: Sequence[Body]) -> dict[str, Pose]:
    """Return the poses of all bodies and the ground, by name."""
    found = {GROUND: Pose(np.zeros(3), np.eye(3))}
    by_name = {body.name: body for body in bodies}

    def pose(name: str) -> Pose:
        if name not in found:
            found[name] = _carried(pose(by_name[name].parent), by_name[name])
        return found[name]

    for name in by_name:
        pose(name)
    return found


def home_poses(bodies: Sequence[Body]) -> Array:
    """Return the position and quaternion of each body in the initial state as an (nb, 7) array."""
    found = poses(bodies)
    rows = [(*found[b.name].position, *quaternion_of(found[b.name].rotation)) for b in bodies]
    return np.array(rows).reshape(-1, 7)


def _carried(parent: Pose, body: Body) -> Pose:
    """Return the pose of a body moved by its joint."""
    R, home, i = parent.rotation, matrix(body.rotation), 0
    x = parent.position + R @ np.array(body.link)
    for motion in body.sequence:
        nq = joints.SIZE[motion.kind][0]
        a = np.array(body.q[i : i + nq], dtype=float)
        axis = R @ home @ unit_vector(motion.axis)
        if motion.kind in joints.AXIAL:
            if motion.kind != "translate":
                R = rodrigues(axis, float(a[0])) @ R
            slide = 1.0 if motion.kind == "translate" else motion.pitch / (2 * np.pi)
            x = x + axis * slide * a[0]
        else:
            if motion.kind == "free":
                x = x + R @ a[:3]
            R = R @ matrix(a[-4:].tolist())
        i += nq
    return Pose(x, R @ home)
