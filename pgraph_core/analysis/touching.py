"""Contacts and joint limits about a state: soft and penalty forces, and closed contacts.

A force of a soft or penalty contact is a function of (q, v), whose slopes are differences with
steps below its depth. What is rigid and shut has no slope: it is named.
"""

from __future__ import annotations

import numpy as np

from ..dynamics import Dynamics
from ..dynamics.scene import NO_CONSTRAINTS, Scene, contact_tables
from ..engine import motion
from ..engine.records import CREEP
from ..fields import GROUND
from ..forces import ends_of
from ..forces.spring import points_of
from ..joints import SIZE
from ..model import Contact, Force, Spring, Tendon
from ..packing import Array, Drives, Loads
from ..packing.forces import length_at, terms_of
from ..tolerances import EPS, SOLVED

DEPTHS = (0.1, 1e-2, 1e-3)  # steps of finite differences relative to the least depth


def length_of(mech: Dynamics, f: Force, q: Array) -> float:
    """Return the length bounded by a tendon or spring [m, rad]."""
    if isinstance(f, Spring):
        return float(np.linalg.norm(between(mech, f, q)[0]))
    assert isinstance(f, Tendon)
    return length_at(terms_of(f, mech.topology, mech.packed.system), q)


def between(mech: Dynamics, f: Spring, q: Array) -> tuple[Array, Array]:
    """Return (vector from a spring's other end to its own (3,) [m], its slope in v (3, nv))."""
    own, other = points_of(f, mech.model.body(f.body))
    apart, slopes = np.zeros(3), np.zeros((3, mech.nv))
    for sign, name, point in ((1.0, f.body, own), (-1.0, f.other, other)):
        if name == GROUND:
            apart += sign * np.array(point)
            continue
        place, turn = mech.pose(q, name)
        apart += sign * (place + turn @ np.array(point))
        slopes += sign * mech.jacobian(q, name, point)[3:]
    return apart, slopes


class Touching:
    """The closed contacts at the state (q, v) at which a run starts."""

    def __init__(
        self,
        mech: Dynamics,
        contacts: tuple[Contact, ...],
        forces: tuple[Drives, Loads],
        state: tuple[Array, Array],
        own: Array,
    ):
        """Find the closed contacts among active `contacts` and limits, under active `forces`.

        `own` (nx,) are the states of controls, on which no contact force depends.
        """
        self.mech, (q, v), self.own = mech, state, own
        self.shut: list[str] = []  # names of closed rigid contacts and limits, for sentences
        self.depth = 0.0  # least depth of a soft or penalty contact [m], 0 if none pushes
        self._limits(q)
        tables = contact_tables(mech.packed, contacts) if contacts else None
        if tables is None or not tables.touches:
            return
        from ..engine.contact import contacts as kernels  # compiled only if something touches

        self.scenes = [
            Scene(mech.packed, *forces, NO_CONSTRAINTS, contacts=with_contacts)
            for with_contacts in (None, tables)
        ]
        address, none = self.scenes[1].address, np.zeros(0)
        touching = self.scenes[1].touching
        assert touching is not None
        motion.residuals(address, 0.0, *self._whole(q, v), none, none)  # places the bodies
        reach = SOLVED * max(1.0, mech.packed.length)
        depths = []
        for one in touching.found[: kernels.find(address, reach, 0)]:
            contact = tables.touches[int(one["pair"])].contact
            if contact.law == "complementarity":
                if one["gap"] <= reach and (name := f"contact '{contact.name}'") not in self.shut:
                    self.shut.append(name)
            elif one["gap"] < 0:
                depths.append(-float(one["gap"]))
        self.depth = min(depths, default=0.0)
        kernels.settle_contacts(address, 0.0, *self._whole(q, v))  # friction holds where it is

    def _whole(self, q: Array, v: Array) -> tuple[Array, Array]:
        return np.append(q, np.zeros_like(self.own)), np.append(v, self.own)

    def _limits(self, q: Array) -> None:
        for name, joint in self.mech.joints.items():
            at, body = joint.q.start, self.mech.model.body(name)
            for (kind, _), pair in zip(body.motions, body.limits):
                low, high = pair or (None, None)
                below = low is not None and q[at] <= low + SOLVED
                if below or (high is not None and q[at] >= high - SOLVED):
                    self.shut.append(f"the limit of joint '{name}'")
                at += SIZE[kind][0]
        for f in self.mech.model.forces:
            low, high = ends_of(f)
            if low is None and high is None:
                continue
            length = length_of(self.mech, f, q)
            below = low is not None and length <= low + SOLVED
            if below or (high is not None and length >= high - SOLVED):
                self.shut.append(f"the limit of {f.kind} '{f.name}'")

    def torque(self, q: Array, v: Array) -> Array:
        """Return τ (nv,) of soft and penalty contacts, computed as M times their part of v'."""
        if not self.depth:
            return np.zeros(self.mech.nv)
        found = []
        for scene in self.scenes:
            state = self._whole(q, v)
            vdot, tau, flow = np.zeros_like(state[1]), np.zeros_like(state[1]), np.zeros(3)
            motion.acceleration(scene.address, 0.0, *state, tau, vdot, flow)
            found.append(vdot[: self.mech.nv])
        return self.mech.mass_matrix(q) @ (found[1] - found[0])

    @property
    def steps(self) -> tuple[float, ...]:
        """Return finite-difference steps in q [rad, m] that preserve contact."""
        return tuple(share * self.depth / max(1.0, self.mech.packed.length) for share in DEPTHS)

    def slopes_in_v(self, q: Array, v: Array) -> Array:
        """Return the (nv, nv) derivatives of `torque` in v, by fourth-order differences.

        Their best step is EPS^(1/5) of the slip at which regularised friction bends.
        """
        h = EPS ** (1 / 5) * CREEP / max(1.0, self.mech.packed.length)

        def odd(step: Array) -> Array:
            return self.torque(q, v + step) - self.torque(q, v - step)

        found = [8 * odd(h * e) - odd(2 * h * e) for e in np.eye(self.mech.nv)]
        return np.array(found).T / (12 * h)
