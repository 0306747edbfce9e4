"""The quadruped on its four feet: what holds it, and where its joints go in the push.

All hinges turn about z and all axes are world axes at q = 0, so this is plane geometry: complex
numbers x + i y stand for vectors, and a turn by an angle is a factor exp(i angle).
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping, Sequence

import numpy as np

import pgraph_core as pg
from pgraph_core.rotation import Array, skew

GRAVITY = np.array([0.0, -9.81, 0.0])  # [m/s^2]
FEET = ("left_front_paw", "right_front_paw", "left_hind_paw", "right_hind_paw")

# The push, as the end of a smooth motion from q = 0.
PELVIS = complex(0.04, 0.03)  # how far its origin moves [m]
TRUNK = {"pelvis": 0.06, "lumbar": -0.1, "thorax": -0.08, "shoulder_neck_head": 0.1}  # [rad]
PAW = {"front": -0.05, "hind": -0.25}  # turn of the paw itself in the world [rad]


def origins(bodies: Sequence[pg.Body]) -> dict[str, Array]:
    """Origins of the body frames at q = 0, world axes [m]."""
    found: dict[str, Array] = {"ground": np.zeros(3)}
    for body in bodies:
        found[body.name] = found[body.parent] + body.link
    return found


def path(bodies: Sequence[pg.Body], name: str) -> list[str]:
    """Names from a body to its root."""
    parent = {body.name: body.parent for body in bodies}
    names = [name]
    while parent[names[-1]] != "ground":
        names.append(parent[names[-1]])
    return names


def holding_torques(bodies: Sequence[pg.Body]) -> dict[str, float]:
    """Torques of the hinges that hold the body still at q = 0 [N m].

    tau = C - Jᵀ lam, with C the weight's share and lam the forces on the feet: those of least
    norm that leave the free root without torque and force.
    """
    at = origins(bodies)
    weight = np.zeros(6)
    feet = np.zeros((6, 3 * len(FEET)))
    for body in bodies:
        weight += _wrench(at[body.name] + body.com - at["pelvis"]) @ (body.mass * GRAVITY)
    for i, foot in enumerate(FEET):
        feet[:, 3 * i : 3 * i + 3] = _wrench(_sole(bodies, at, foot) - at["pelvis"])
    lam = (np.linalg.pinv(feet) @ -weight).reshape(-1, 3)
    torque = {body.name: 0.0 for body in bodies if body.dof == 1}
    for body in bodies:
        _share(torque, bodies, body.name, at[body.name] + body.com, body.mass * GRAVITY, at)
    for foot, force in zip(FEET, lam):
        _share(torque, bodies, foot, _sole(bodies, at, foot), force, at)
    return torque


def _wrench(arm: Array) -> Array:
    """(6, 3) from a force to its [torque; force] about a point `arm` away from it."""
    return np.vstack((skew(arm), np.eye(3)))


def _sole(bodies: Sequence[pg.Body], at: Mapping[str, Array], foot: str) -> Array:
    tip = next(body.tip_point for body in bodies if body.name == foot)
    return at[foot] + tip


def _share(
    torque: dict[str, float],
    bodies: Sequence[pg.Body],
    name: str,
    point: Array,
    force: Array,
    at: Mapping[str, Array],
) -> None:
    """Take off what a force on a body does about the hinges inboard of it."""
    for inboard in path(bodies, name):
        if inboard in torque:
            torque[inboard] -= float(np.cross(point - at[inboard], force)[2])


def push(bodies: Sequence[pg.Body]) -> dict[str, float]:
    """Angles of the hinges at the end of the push, all four feet in place [rad]."""
    link = {body.name: complex(*body.link[:2]) for body in bodies}
    angle = {name: turn for name, turn in TRUNK.items() if name != "pelvis"}
    heading, origin = TRUNK["pelvis"], link["pelvis"] + PELVIS
    angle |= _leg(bodies, link, origin, heading, ("left_femur", "left_tibia", "left_hind_paw"))
    for name in ("lumbar", "thorax", "shoulder_neck_head"):
        origin += link[name] * cmath.exp(1j * heading)
        heading += TRUNK[name]
    angle |= _leg(bodies, link, origin, heading, ("left_humerus", "left_radius", "left_front_paw"))
    return {b.name: angle[b.name.replace("right", "left")] for b in bodies if b.name != "pelvis"}


def _leg(
    bodies: Sequence[pg.Body],
    link: Mapping[str, complex],
    origin: complex,
    heading: float,
    names: tuple[str, str, str],
) -> dict[str, float]:
    """Angles of a leg whose girdle stands at `origin` and whose foot stays where it was."""
    upper, lower, paw = names
    at = origins(bodies)
    turn = PAW["hind" if "hind" in paw else "front"]
    sole = complex(*_sole(bodies, at, paw)[:2])
    tip = sole - complex(*at[paw][:2])
    reach = sole - tip * cmath.exp(1j * turn) - origin - link[upper] * cmath.exp(1j * heading)
    a, b = link[lower], link[paw]
    # |a + b e^{i knee}| = |reach|: the knee's bend, on the side on which it bends already.
    cosine = (abs(reach) ** 2 - abs(a) ** 2 - abs(b) ** 2) / (2 * abs(a) * abs(b))
    bend, side = cmath.acos(cosine).real, cmath.phase(b / a)
    knee = (bend if side > 0 else -bend) - side
    hip = cmath.phase(reach / (a + b * cmath.exp(1j * knee)))
    return {upper: hip - heading, lower: knee, paw: turn - hip - knee}
