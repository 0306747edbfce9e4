"""Outputs over the frames of a run: what its sensors would read."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .. import joints
from ..dynamics.states import BodyMotion, shifted, turned
from ..mechanism import Mechanism
from ..model import Output, Site
from ..model.fields import GROUND
from ..model.output import OF_JOINT
from ..packing.system import Array
from ..rotation import unit

BACK = np.array([1.0, -1.0, -1.0, -1.0])  # of a quaternion: the opposite turn


def outputs(
    mech: Mechanism, q: Array, v: Array, motion: Callable[[], BodyMotion]
) -> dict[str, Array]:
    """{name: (n,), (n, 3) or (n, 4)} of every output of the model, over n frames.

    `motion` gives that of the bodies, and is called where an output reads it.
    """
    wanted = mech.model.outputs
    names = list(dict.fromkeys(o.at for o in wanted if o.kind not in OF_JOINT))
    frames = _frames(mech, motion(), names) if names else None
    found: dict[str, Array] = {}
    for o in wanted:
        if o.kind in OF_JOINT or frames is None:
            found[o.name] = _coordinate(mech, q, v, o)
        else:
            found[o.name] = _read(frames, names.index(o.at), o.kind, mech.model.gravity)
    return found


def _coordinate(mech: Mechanism, q: Array, v: Array, o: Output) -> Array:
    """(n,) of a joint."""
    joint = mech.joints[o.at]
    if o.kind == "joint_velocity":
        return v[:, joint.v.start + o.coordinate]
    place = joints.places(mech.model.body(o.at).sequence)[o.coordinate]
    assert place is not None
    return q[:, joint.q.start + place]


class _Frames(NamedTuple):
    """k frames of bodies and sites over the frames of a run, world axes, at their origins."""

    place: Array  # (n, k, 3)
    turn: Array  # (n, k, 4)
    spin: Array  # (n, k, 3)
    velocity: Array
    acceleration: Array
    load: Array  # (n, k, 6)


def _frames(mech: Mechanism, motion: BodyMotion, names: list[str]) -> _Frames:
    n = len(motion[0])
    sites = {s.name: s for s in mech.model.sites}
    sites = [sites.get(name) or Site(name=f"{name} frame", body=name) for name in names]
    fixed = [np.zeros((n, 1, width)) for width in (7, 6, 6, 6)]  # the ground
    fixed[0][..., 3] = 1.0
    bodies = [0 if s.body == GROUND else mech.topology.number(s.body) for s in sites]
    moving = zip(fixed, motion)
    parts = (np.concatenate((still, part), axis=1)[:, bodies] for still, part in moving)
    pose, velocity, acceleration, load = parts
    turn, own = pose[..., 3:], np.array([unit(s.rotation) for s in sites])
    arm = turned(turn, np.array([s.point for s in sites]))
    spin = velocity[..., :3]
    across = np.cross(spin, arm)
    more = np.cross(acceleration[..., :3], arm) + np.cross(spin, across)
    return _Frames(
        pose[..., :3] + arm, _product(turn, own), spin, velocity[..., 3:] + across,
        acceleration[..., 3:] + more, shifted(load, -arm),
    )  # fmt: skip


def _product(p: Array, q: Array) -> Array:
    """(..., 4) quaternions: the turn q, then p."""
    real = p[..., :1] * q[..., :1] - (p[..., 1:] * q[..., 1:]).sum(axis=-1, keepdims=True)
    rest = p[..., :1] * q[..., 1:] + q[..., :1] * p[..., 1:] + np.cross(p[..., 1:], q[..., 1:])
    return np.concatenate((real, rest), axis=-1)


def _read(frames: _Frames, k: int, kind: str, gravity: tuple[float, ...]) -> Array:
    """(n, 3) or (n, 4): what an output of frame k reads."""
    place, turn, spin, velocity, acceleration, load = (part[:, k] for part in frames)
    in_world = {
        "position": place, "rotation": turn, "velocity": velocity, "angular_velocity": spin
    }  # fmt: skip
    if kind in in_world:
        return in_world[kind]
    in_own = {
        "velocimeter": velocity, "gyro": spin, "accelerometer": acceleration - np.array(gravity),
        "force": load[:, 3:], "torque": load[:, :3],
    }  # fmt: skip
    return turned(turn * BACK, in_own[kind])
