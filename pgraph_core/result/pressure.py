"""The centre of pressure and the zero moment point of a run."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..dynamics.states import BodyMotion, turned
from ..packing import Array
from ..tolerances import ROUNDING
from .records import ContactRecord

if TYPE_CHECKING:
    from ..mechanism import Mechanism


class Pressing:
    """The points of the ground plane at which a run presses on it."""

    mechanism: Mechanism
    t: Array
    body_motion: cached_property[BodyMotion]
    contacts: ContactRecord

    @cached_property
    def centre_of_pressure(self) -> Array:
        """The point of the ground plane about which all contacts together exert no moment along the
        plane [m], (n, 3), in world axes.

        It is nan where nothing presses on the ground. Contacts between bodies cancel.
        """
        wrench, places = self.contacts.wrench, self.body_motion.pose[..., :3]
        if not wrench.size:
            return np.full((len(self.t), 3), np.nan)
        force, torque = wrench[..., 3:], wrench[..., :3]
        moment = (torque + np.cross(places, force)).sum(axis=1)
        return _on_plane(moment, force.sum(axis=1), np.array(self.mechanism.model.ground_normal))

    @cached_property
    def zero_moment_point(self) -> Array:
        """The point of the ground plane about which gravity and inertia together exert no moment
        along the plane [m], (n, 3), in world axes.

        It is the centre of pressure where contacts with the ground are the only other forces on the
        model. Inertias of rotors are not included. It is nan in free fall.
        """
        motion, model = self.body_motion, self.mechanism.model
        force, moment = np.zeros((len(self.t), 3)), np.zeros((len(self.t), 3))
        for k, name in enumerate(self.mechanism.names):
            body = model.body(name)
            place, turn = motion.pose[:, k, :3], motion.pose[:, k, 3:]
            spin, bend = motion.velocity[:, k, :3], motion.acceleration[:, k, :3]
            arm = turned(turn, np.array(body.com))
            felt = motion.acceleration[:, k, 3:] + np.cross(bend, arm)
            felt = felt + np.cross(spin, np.cross(spin, arm))
            axes = np.stack([turned(turn, axis) for axis in np.eye(3)], axis=2)
            inertia = axes @ np.array(body.inertia) @ axes.swapaxes(1, 2)
            own = np.einsum("nij,nj->ni", inertia, bend)
            own = own + np.cross(spin, np.einsum("nij,nj->ni", inertia, spin))
            push = body.mass * (np.array(model.gravity) - felt)
            force, moment = force + push, moment + np.cross(place + arm, push) - own
        return _on_plane(-moment, -force, np.array(model.ground_normal))


def _on_plane(moment: Array, force: Array, normal: Array) -> Array:
    """Return the point (n, 3) of the plane through the origin at which a wrench acts.

    Its moment about the point is along the normal. It is nan where the force does not press.
    """
    press = force @ normal
    acts = press > ROUNDING * np.abs(force).max(initial=0.0)
    return np.where(
        acts[:, None], np.cross(normal, moment) / np.where(acts, press, 1.0)[:, None], np.nan
    )
