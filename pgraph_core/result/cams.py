"""The contacts of followers with their cams in a run: places, forces and pressure angles."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..cams import riding, values
from ..dynamics.states import turned
from ..model import Cam
from ..packing import Array, joint_coordinates
from ..rotation import unit_vector


class CamRecord(NamedTuple):
    """The contact of a follower with its cam, at each of n frames."""

    pressure_angle: Array  # (n,) [rad] from the follower's motion to the normal, about the cam
    normal_force: Array  # (n,) [N] on the follower, negative where a cam would have to pull
    push: Array  # (n,) [N, N m] on the follower along its coordinate
    point: Array  # (n, 3) [m] of contact, in world axes
    force: Array  # (n, 3) [N] on the follower at this point, in world axes

    def wrench(self, origin: Array) -> Array:
        """Return [torque, force] on the follower (n, 6) about points (n, 3)."""
        return np.hstack((np.cross(self.point - origin, self.force), self.force))


def cam_record(c: Cam, mech: Any, q: Array, pose: Array, wrench: Array) -> CamRecord:
    """Return where a cam touches, from poses of bodies (n, nb, 7) and its force in the joint."""
    follower, cam = (mech.model.body(name) for name in (c.body, c.other))
    at, centre = (pose[:, mech.topology.number(name) - 1] for name in (c.body, c.other))
    (motion,), (spin,) = follower.sequence, cam.sequence
    slides = motion.facts.travels
    z = turned(centre[:, 3:], unit_vector(spin.axis))
    along = turned(at[:, 3:], unit_vector(motion.axis))
    y = along
    if not slides:
        y = at[:, :3] - centre[:, :3]
        y = y - z * (y * z).sum(axis=1, keepdims=True)
    y = y / np.linalg.norm(y, axis=1, keepdims=True)
    x = np.cross(y, z)
    column = joint_coordinates(mech.packed.system, mech.topology.number(c.other))[0][1]
    angle = q[:, column]
    found = riding(c.rule, *values(c.lift, angle))
    push = ((wrench[:, 3:] if slides else wrench[:, :3]) * along).sum(axis=1)
    force = push / (found.lever * np.cos(found.pressure))
    contact, normal = (
        place.real[:, None] * x + place.imag[:, None] * y
        for place in (found.contact, force * found.normal)
    )
    return CamRecord(found.pressure, force, push, centre[:, :3] + contact, normal)


def cams_of(run: Any) -> dict[str, CamRecord]:
    """Return the contacts of the cams that act in a run, by name."""
    mech, forces = run.mechanism, run.constraint_force
    return {
        c.name: cam_record(c, mech, run.q, run.body_pose, forces[c.name])
        for c in mech.model.cams
        if c.name in forces
    }
