"""Legs, spine, mass and standing pose of a model, for the walking controller.

Vectors in a leg's plane are complex numbers x + i y. A rotation by an angle is exp(i angle).
"""

from __future__ import annotations

import cmath
import math
from typing import Any, NamedTuple

import numpy as np

from ..engine import layout as at
from ..engine.gait.legs import STRAIGHT
from ..engine.gait.tables import LEG
from ..engine.motions import facts
from ..engine.records import table
from ..errors import InputError, Problem, choices
from ..mechanism import Mechanism
from ..model import Contact, Footfall, Gait, Model
from ..model.checks import soles_among
from ..packing import Array, Ints
from ..tolerances import SOLVED
from .footing import height_under

Z, X = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)


class Anatomy(NamedTuple):
    """Data for four legs at q = 0 in world axes, front before hind and left before right."""

    feet: tuple[Footfall, ...]
    legs: Any  # records of type LEG, whose `share` the controller fills in
    hips: Array  # (4, 3) [m]
    soles: Array  # (4, 3) [m]
    spine: Ints  # (ns, 2) places in q and v
    mass: float  # [kg]
    centre: Array  # (3,) centre of mass [m]
    inertia: Array  # (3,) about it [kg m²]

    @property
    def longest(self) -> Array:
        """The maximum reach of the legs [m], of shape (4,)."""
        a = self.legs["long"]
        b = self.legs["shank"]
        bend = STRAIGHT * np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
        return np.sqrt((a**2).sum(axis=1) + (b**2).sum(axis=1) + 2 * bend)


def anatomy(mech: Mechanism, gait: Gait) -> Anatomy:
    """Find the legs above the feet of a gait. Raises InputError if the model cannot walk."""
    model = mech.model
    if model.up != "y":
        raise _refused(gait, f"walks where up is 'y' and legs swing about z; up is '{model.up}'")
    if not -model.gravity[1] > 0:
        raise _refused(gait, f"needs gravity that pulls down along y; it is {model.gravity}")
    q0 = np.zeros(mech.nq)
    root = model.bodies[mech.topology.row[0]]
    if not root.floats or facts("transmits")[mech.packed.system.rows[1, at.KIND]]:
        raise _refused(gait, f"needs a trunk that is free; the joint of '{root.name}' is not")
    q0[3] = 1.0
    position, _ = mech.poses(q0)
    legs = [_leg(mech, gait, fall, position) for fall in gait.feet]
    legs.sort(key=lambda leg: (-round(leg.hip[0], 6), leg.hip[2]))
    if not legs[1].hip[0] > legs[2].hip[0]:
        raise _refused(gait, "needs two feet in front and two behind")
    front, hind = legs[0].girdle, legs[2].girdle
    mass, centre, inertia = whole(mech, q0)
    return Anatomy(
        feet=tuple(leg.fall for leg in legs),
        legs=np.concatenate([leg.table for leg in legs], dtype=LEG),
        hips=np.array([leg.hip for leg in legs]),
        soles=np.array([leg.sole for leg in legs]),
        spine=_spine(mech, gait, front, hind),
        mass=mass,
        centre=centre,
        inertia=inertia,
    )


class _Leg(NamedTuple):
    fall: Footfall
    girdle: str
    table: Any  # one LEG
    hip: Array
    sole: Array


def _refused(gait: Gait, text: str) -> InputError:
    return InputError(Problem(f"gait '{gait.name}'", "", text))


def _foot(model: Model, gait: Gait, name: str) -> Contact:
    """Return the contact for a foot, a single point over the ground."""
    known = {contact.name: contact for contact in model.contacts}
    if name not in known:
        feet = soles_among(model.contacts) or known
        do = f"choose one of {choices(feet)}" if known else "the model has no contact"
        raise _refused(gait, f"no contact is named '{name}'; {do}")
    contact = known[name]
    if len(contact.points) != 1 or contact.other != "ground":
        raise _refused(gait, f"a foot is one point over the ground, contact '{name}' is not")
    return contact


def _leg(mech: Mechanism, gait: Gait, fall: Footfall, position: Array) -> _Leg:
    model, number = mech.model, mech.topology.number
    contact = _foot(model, gait, fall.foot)
    paw = model.body(contact.body)
    chain = [paw]
    while len(chain) < 4 and chain[-1].parent != "ground":
        chain.append(model.body(chain[-1].parent))
    axes = [tuple(m.axis for m in body.sequence if m.facts.pivots) for body in chain[:3]]
    fine = len(chain) == 4 and axes[:2] == [(Z,), (Z,)] and axes[2] in ((Z,), (X, Z))
    if not fine:
        text = "three hinges about z, of which the hip's may follow a hinge about x"
        raise _refused(gait, f"a leg has {text}; that of '{fall.foot}' has not")
    _, shank, thigh, girdle = chain
    found = table(LEG, 1)
    lengths = found[0]
    tip = np.array(contact.points[0])
    parts = np.array([shank.link, paw.link, tip])
    if np.abs(parts[:, 2]).max() > SOLVED:
        raise _refused(gait, f"a leg lies in a plane across z; that of '{fall.foot}' does not")
    for name, part in zip(("thigh", "shank", "paw"), parts):
        lengths[name] = part[:2]
    lengths["long"] = (parts[0] + parts[2])[:2]
    lengths["tip"] = tip
    hip = position[number(thigh.name) - 1]
    sole = position[number(paw.name) - 1] + tip
    lengths["ahead"] = sole[0] - hip[0] + fall.ahead
    lengths["side"] = np.sign(hip[2])
    lengths["offset"], lengths["duty"] = fall.offset, fall.duty
    _number(found[0], mech, paw.name, thigh.name, girdle.name)
    return _Leg(fall, girdle.name, found, hip, sole)


def _number(found: Any, mech: Mechanism, paw: str, thigh: str, girdle: str) -> None:
    """Set the rows of a leg and the indices of its joints in q and v."""
    rows = mech.packed.system.bodies_i[:, at.ROW]
    row = {name: int(rows[mech.topology.number(name)]) for name in (paw, thigh, girdle)}
    joint = mech.joints[thigh]
    spreads = len(joint.kinds) == 2
    found["girdle"], found["hip"], found["foot"] = row[girdle], row[thigh] - spreads, row[paw]
    found["q_spread"], found["v_spread"] = (joint.q.start, joint.v.start) if spreads else (0, -1)
    found["q_flex"], found["v_flex"] = joint.q.start + spreads, joint.v.start + spreads


def _spine(mech: Mechanism, gait: Gait, front: str, hind: str) -> Ints:
    """Return the indices of the hinges between the girdles."""
    found, name = [], front
    while name != hind:
        body = mech.model.body(name)
        if body.parent == "ground" or len(mech.joints[name].kinds) != 1:
            text = f"the bodies from '{hind}' to '{front}' must be joined by hinges"
            raise _refused(gait, f"walks where {text}")
        found.append((mech.joints[name].q.start, mech.joints[name].v.start))
        name = body.parent
    return np.array(found[::-1], dtype=np.int64).reshape(-1, 2)


def whole(mech: Mechanism, q: Array) -> tuple[float, Array, Array]:
    """Return the mass, the centre of mass and the inertia about it at q, from a block of M."""
    block = mech.mass_matrix(q)[:6, :6]
    mass = float(block[3, 3])
    arm = np.array([block[5, 1], block[3, 2], block[4, 0]]) / -mass
    about = block[:3, :3] - mass * ((arm @ arm) * np.eye(3) - np.outer(arm, arm))
    return mass, mech.poses(q)[0][0] + arm, np.diag(about).copy()


# -- standing --------------------------------------------------------------------------------------

BENDING_ROUNDS = 6  # bent legs move the centre of mass: a sixth of the way a round


def standing(mech: Mechanism, gait: Gait, a: Anatomy) -> tuple[Array, Array]:
    """Return (q, v) at rest, with each foot on the model's ground below its hip."""
    q, v = np.zeros(mech.nq), np.zeros(mech.nv)
    q[3] = 1.0
    wanted = height_under(mech.model, a.centre[0], a.centre[2]) + gait.height
    high = a.centre[1]
    for _ in range(BENDING_ROUNDS):
        q[1] += wanted - high
        for hip, f in zip(a.hips, a.legs):
            spreads = f["v_spread"] >= 0
            x, z = f["ahead"], f["side"] * gait.width * spreads
            y = height_under(mech.model, hip[0] + x, hip[2] + z) - hip[1] - q[1]
            bend, knee = leg(f, complex(x, -math.hypot(y, z)))
            q[f["q_flex"] : f["q_flex"] + 3] = bend, knee, -knee
            if spreads:
                q[f["q_spread"]] = math.atan2(-z, -y)
        high = whole(mech, q)[1][1]
    return q, v


def leg(f: Any, foot: complex) -> tuple[float, float]:
    """Return the hip and knee angles that place a foot from the hip, as `engine.gait.legs`."""
    a, b = complex(*f["long"]), complex(*f["shank"])
    cosine = (abs(foot) ** 2 - abs(a) ** 2 - abs(b) ** 2) / (2 * abs(a) * abs(b))
    side = cmath.phase(b / a)
    bend = math.copysign(math.acos(min(max(cosine, -1.0), 1.0)), side)
    knee = bend - side
    return cmath.phase(foot / (a + b * cmath.exp(1j * knee))), knee
