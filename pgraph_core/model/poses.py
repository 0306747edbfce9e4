"""Body frames of a description at its initial or any other coordinates, in plain NumPy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from .. import joints, words
from ..fields import GROUND
from ..joints import Motion
from ..rotation import Array, matrix, quaternion_of
from .body import Body

Numbers: TypeAlias = "Sequence[float] | Array"


class Pose(NamedTuple):
    """The pose of a body frame in the world or in its parent, `position, rotation = pose`.

    NumPy functions and two indices, as in `pose[:3, 3]`, use the homogeneous transformation matrix.
    """

    position: Array  # (3,) [m]
    rotation: Array  # (3, 3)

    @property
    def matrix(self) -> Array:
        """The homogeneous transformation (4, 4)."""
        found = np.zeros((*self.position.shape[:-1], 4, 4))
        found[..., :3, :3], found[..., :3, 3], found[..., 3, 3] = self.rotation, self.position, 1.0
        return found

    @property
    def quaternion(self) -> Array:
        """The rotation as a unit quaternion [w, x, y, z]."""
        found = [quaternion_of(R) for R in self.rotation.reshape(-1, 3, 3)]
        return np.reshape(found, (*self.position.shape[:-1], 4))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return self.matrix if dtype is None else self.matrix.astype(dtype)

    if not TYPE_CHECKING:

        def __getattr__(self, name):
            ours = words.same_attribute(name)
            if ours in ("position", "rotation", "matrix", "quaternion"):
                return getattr(self, ours)
            raise words.NoAttribute("a pose", name, lambda: dir(self))

        def __getitem__(self, key):
            return self.matrix[key] if isinstance(key, tuple) else tuple.__getitem__(self, key)

        def __matmul__(self, other):
            """Return where a point (3,) is, or the product of the matrix with another."""
            other = np.asarray(other)
            return self.place(other) if other.shape == (3,) else self.matrix @ other

    def place(self, point: Numbers) -> Array:
        """Return the position of a body point [m]."""
        return self.position + self.rotation @ np.asarray(point, dtype=float)


# -- the motions of a joint ------------------------------------------------------------------------


def half_reach(model: Any, name: str) -> float:
    """Return half of the usual reach of the first motion of a joint: a quarter turn, or 0.5 m."""
    motions = model.body(name).sequence if name != GROUND else ()
    reach = joints.KINDS[motions[0].kind].reach if motions else None
    return 0.5 * (reach or 2.0)


def elementary(body: Body, q: Numbers) -> Iterator[tuple[Motion, Numbers]]:
    """Yield the motions of a joint in order, each with its own coordinates."""
    start = 0
    for motion in body.sequence:
        end = start + joints.SIZE[motion.kind][0]
        yield motion, q[start:end]
        start = end


def turn(motion: Motion, home: Array, q: Numbers) -> Array:
    """Return the rotation matrix (3, 3) of a motion, in the preceding axes."""
    return joints.KINDS[motion.kind].rotation(motion, home, q)


def displacement(motion: Motion, turned: Array, home: Array, q: Numbers) -> Array:
    """Return a motion's displacement of the origin (3,) in world axes, after axes `turned`."""
    return turned @ joints.KINDS[motion.kind].displacement(motion, home, q)


def columns(motion: Motion, turned: Array, home: Array, q: Numbers) -> Array:
    """Return H (6, dof) of a motion in world axes, after axes `turned`, eqs. (6), (7)."""
    own = joints.KINDS[motion.kind].columns(motion, home, q)
    return np.vstack((turned @ own[:3], turned @ own[3:]))


def bends(motion: Motion, turned: Array, home: Array, q: Numbers) -> Array:
    """Return the derivative of `columns` in the coordinate of a motion that has one."""
    own = joints.KINDS[motion.kind].bends(motion, home, q)
    return np.vstack((turned @ own[:3], turned @ own[3:]))


# -- bodies ----------------------------------------------------------------------------------------


def carried(parent: Pose, body: Body, q: Numbers) -> Pose:
    """Return the pose of a body at the coordinates q of its joint."""
    turned, home = parent.rotation, matrix(body.rotation)
    at = parent.place(body.link)
    for motion, x in elementary(body, q):
        at = at + displacement(motion, turned, home, x)
        turned = turned @ turn(motion, home, x)
    return Pose(at, turned @ home)


def at_home(body: Body) -> Pose:
    """Return the pose in the parent's frame at the initial q, computed once per body.

    After an edit all other bodies are the same objects, so the rest of the table is not computed
    again.
    """
    known = vars(body)
    if "at_home" not in known:
        known["at_home"] = carried(Pose(np.zeros(3), np.eye(3)), body, body.q)
    return known["at_home"]


def poses(bodies: Sequence[Body]) -> dict[str, Pose]:
    """Return the poses of all bodies and the ground in the initial state, by name."""
    found = {GROUND: Pose(np.zeros(3), np.eye(3))}
    by_name = {body.name: body for body in bodies}

    for body in bodies:
        chain = [body.name]
        while chain[-1] not in found:
            chain.append(by_name[chain[-1]].parent)
        for name in chain[-2::-1]:
            parent, own = found[by_name[name].parent], at_home(by_name[name])
            found[name] = Pose(parent.place(own.position), parent.rotation @ own.rotation)
    return found


def home_poses(bodies: Sequence[Body]) -> Array:
    """Return the position and quaternion of each body in the initial state as an (nb, 7) array."""
    found = poses(bodies)
    rows = [(*found[b.name].position, *quaternion_of(found[b.name].rotation)) for b in bodies]
    return np.array(rows).reshape(-1, 7)
