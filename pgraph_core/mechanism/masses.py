"""Centre of mass and momentum of a whole mechanism."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..system import Array
from .bodies import turned

if TYPE_CHECKING:
    from .mechanism import Mechanism


def centre_of_mass(mech: Mechanism, q: Array) -> Array:
    """(3,) of the whole mechanism in the world [m]."""
    mass, place, _, _ = _masses(mech, q, mech.rest)
    return mass @ place / mass.sum()


def momentum(mech: Mechanism, q: Array, v: Array) -> Array:
    """(6,) momentum, world axes: angular about the centre of mass, then linear [kg m/s]."""
    mass, place, velocity, spin = _masses(mech, q, v)
    arm = place - mass @ place / mass.sum()
    linear = mass @ velocity
    angular = spin.sum(axis=0) + np.cross(arm, mass[:, None] * velocity).sum(axis=0)
    return np.concatenate((angular, linear))


def _masses(mech: Mechanism, q: Array, v: Array) -> tuple[Array, Array, Array, Array]:
    """Masses, centres of mass, their velocities, and spins I ω of all bodies."""
    motion = mech.body_motion(q, v)
    bodies = [mech.model.body(name) for name in mech.names]
    mass = np.array([b.mass for b in bodies])
    turn = motion.pose[:, 3:]
    arm = turned(turn, np.array([b.com for b in bodies]).reshape(-1, 3))
    omega = motion.velocity[:, :3]
    back = turn * np.array([1.0, -1.0, -1.0, -1.0])
    inertia = np.array([b.inertia for b in bodies]).reshape(-1, 3, 3)
    spin = turned(turn, np.einsum("bij,bj->bi", inertia, turned(back, omega)))
    velocity = motion.velocity[:, 3:] + np.cross(omega, arm)
    return mass, motion.pose[:, :3] + arm, velocity, spin
