"""Projections of impulses onto what contact laws admit, and their derivatives."""

import math

from ...tolerances import NOTABLE
from .. import layout as at
from ..arrays import (
    LAMBDA,
)
from ..compiler.jit import part
from ..constraints.blocks import before_in_chain, dry, first_of, one_sided, type_of
from .contacts import contacts_at


@part
def bounds_of(data, i):
    """Compute (friction, 0) for a contact, or the bounds of a torque about and across the normal.

    For joint friction, the first entry is the bound, and for that of a cable these are both bounds.
    """
    blocks = data.blocks
    if type_of(blocks.blocks_i, i) == at.T_WRAP:
        tension = max(tension_before(data, i), 0.0)
        return blocks.blocks_f[i, at.WRAP_FALL] * tension, blocks.blocks_f[
            i, at.WRAP_RISE
        ] * tension
    if type_of(blocks.blocks_i, i) == at.T_FRICTION:
        return blocks.blocks_f[i, at.AIM], 0.0
    if type_of(blocks.blocks_i, i) != at.T_TURN:
        return blocks.blocks_f[i, at.FRICTION], 0.0
    contacts = contacts_at(data.links.contacts)
    tally = contacts.tally[0]
    n = i - tally.first_turn
    law = contacts.laws[contacts.found[n].pair]
    push = max(data.space.vectors[LAMBDA, first_of(data.space.slots, tally.first_contact + n)], 0.0)
    return law.spinning * push, law.rolling * push


@part
def tension_before(data, i):
    """Return the impulse of the tension before a wheel of a chain of a cable."""
    total = 0.0
    for n in range(before_in_chain(data.blocks.blocks_i, i)):
        total += data.space.vectors[LAMBDA, first_of(data.space.slots, i - 1 - n)]
    return total


@part
def follows(data, i, z):
    """Return the slope of the projection of z by the tension before a wheel of a cable."""
    least, most = bounds_of(data, i)
    if tension_before(data, i) < 0.0 or least <= z <= most:
        return 0.0
    return data.blocks.blocks_f[i, at.WRAP_FALL if z < least else at.WRAP_RISE]


@part
def admitted(kind, size, z, bounds):
    """Project z onto the admissible impulses. Returns (nearest impulse, its derivative row by row).

    The bounds of a torque are about the normal and across it. The first bound of a contact is for
    friction.
    """
    if kind == at.T_WRAP:
        return turning(z, bounds[0], bounds[1], 0.0)
    if dry(kind):
        return turning(z, -bounds[0], bounds[0], bounds[1])
    if not one_sided(kind):
        return z, diagonal(1.0, 1.0 if size > 1 else 0.0, 1.0 if size > 2 else 0.0)
    if not z[0] > 0.0:
        return (0.0, 0.0, 0.0), diagonal(0.0, 0.0, 0.0)
    if size == 1:
        return (z[0], 0.0, 0.0), diagonal(1.0, 0.0, 0.0)
    pull = math.sqrt(z[1] * z[1] + z[2] * z[2])
    mu = bounds[0]
    rim = mu * z[0]
    if pull <= rim and mu > 0.0:
        return z, diagonal(1.0, 1.0, 1.0)
    x = z[1] / pull if pull > 0.0 else 0.0
    y = z[2] / pull if pull > 0.0 else 0.0
    a = rim / pull if pull > 0.0 else 0.0
    slope = (1.0, 0.0, 0.0, mu * x, a * y * y, -a * x * y, mu * y, -a * x * y, a * x * x)
    return (z[0], rim * x, rim * y), slope


@part
def turning(z, least, most, radius):
    """Do the same as `admitted` for given bounds: a segment along the normal, a disc across it."""
    spin = min(max(z[0], least), most)
    free = 1.0 if spin == z[0] else 0.0
    pull = math.sqrt(z[1] * z[1] + z[2] * z[2])
    if pull <= radius:
        return (spin, z[1], z[2]), diagonal(free, 1.0, 1.0)
    x, y, a = z[1] / pull, z[2] / pull, radius / pull
    slope = (free, 0.0, 0.0, 0.0, a * y * y, -a * x * y, 0.0, -a * x * y, a * x * x)
    return (spin, radius * x, radius * y), slope


@part
def into_cone(z, mu):
    """Project z onto a cone that is notably narrower than |z_t| <= μ z_n. Returns the same as
    `admitted`.

    A contact on the cone is about to slip, which its share of a load is no reason for.
    """
    mu *= 1.0 - 2.0 * NOTABLE
    pull = math.sqrt(z[1] * z[1] + z[2] * z[2])
    if pull <= mu * z[0]:
        return z, diagonal(1.0, 1.0, 1.0)
    if mu * pull <= -z[0]:
        return (0.0, 0.0, 0.0), diagonal(0.0, 0.0, 0.0)
    share = 1.0 / (1.0 + mu * mu)
    push = share * (z[0] + mu * pull)
    x, y, a, b = z[1] / pull, z[2] / pull, mu * push / pull, share * mu
    more = mu * b - a
    across = more * x * y
    slope = (share, b * x, b * y, b * x, a + more * x * x, across, b * y, across, a + more * y * y)
    return (push, mu * push * x, mu * push * y), slope


@part
def diagonal(a, b, c):
    return (a, 0.0, 0.0, 0.0, b, 0.0, 0.0, 0.0, c)


@part
def on_rim(slope):
    """Check whether friction follows the normal impulse, so the contact slides."""
    return slope[3] != slope[1] or slope[6] != slope[2]


@part
def state_of(slope):
    """Encode as a number whether a contact is open, sticks or slides."""
    return slope[0] + (2.0 if slope[4] + slope[8] == 2.0 else 0.0)
