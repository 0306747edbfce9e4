"""Energy loss in compliant contacts, with the same fraction of the impact speed at any speed.

The points between two shapes push with p, the sum of k d^1.5 (soft) or k d (penalty), and store
E, the sum of 2/5 k d^2.5 or 1/2 k d². Let w be the inverse of the mass that their resultant moves:

    soft:    k d^1.5 (1 + χ d' / V),  V² = d'² + 2 E w
    penalty: k d + c d',  c = 2 ζ sqrt(k / (N w)),  N = p² / (2 k E)

V is the impact speed that corresponds to the remaining energy, and N is the number of points that
would produce the same total force at equal depth. The restitution therefore only depends on χ or ζ.
"""

import math

from ...tolerances import TINY
from ..compiler.jit import part, sweep
from ..motions import feeling, mobility
from ..records import SOFT
from ..rows import (
    origin_of,
)
from ..tree.articulated import inboard
from ..vec import add, add_cross, scale, sub, xyz


@part
def elastic_force(law, depth):
    """Return the force k d^1.5 of a soft contact or k d of a penalty contact at depth d [m]."""
    if law.law == SOFT:
        return law.stiffness * depth * math.sqrt(depth + TINY)  # its slope is finite at depth 0
    return law.stiffness * depth


@part
def lost_share(law, speed, stored):
    """Return χ d' / V of a contact point closing at `speed` [m/s], with `stored` = 2 E w."""
    return law.loss * speed / math.sqrt(speed * speed + stored + TINY)


@sweep
def factor_tree(contacts, rows, const, work, tau):
    """Compute the articulated factors for `inverse_mass`, after `outboard` and `positions`."""
    factored = contacts.factored
    for k in range(factored.shape[0]):
        for n in range(factored.shape[1]):
            factored[k, n] = work[k, n]
    inboard(rows, const, factored, tau)


@sweep
def loss_of_touch(contacts, rows, n, count):
    """Compute (2 E w [m²/s²] or c [N s/m], next point) of the two shapes at contact point n.

    Contact points of the same shapes follow each other. `factor_tree` must have been called.
    """
    found = contacts.found
    first = found[n]
    law = contacts.laws[first.pair]
    place = xyz(first.point_a)
    force = moment = (0.0, 0.0, 0.0)
    push, energy = 0.0, 0.0
    end = n
    while end < count and same_shapes(found[end], first):
        point = found[end]
        depth = max(-point.gap, 0.0)
        size = elastic_force(law, depth)
        pushed = scale(size, xyz(point.normal))
        force = add(force, pushed)
        moment = add_cross(moment, sub(xyz(point.point_a), place), pushed)
        push += size
        energy += (0.4 if law.law == SOFT else 0.5) * size * depth
        end += 1
    if not push > 0.0:
        return 0.0, end
    shapes = contacts.geometry.shapes
    a = shapes[first.shape_a].row
    b = shapes[first.shape_b].row if first.shape_b >= 0 else 0
    force, moment = scale(1.0 / push, force), scale(1.0 / push, moment)
    w = inverse_mass(rows, contacts.factored, a, b, place, moment, force)
    if law.law == SOFT:
        return 2.0 * energy * w, end
    together = push * push / (2.0 * law.stiffness * energy)
    return law.loss * math.sqrt(law.stiffness / (together * w)) if w > 0.0 else 0.0, end


@part
def same_shapes(point, other):
    """Check whether two contact points belong to the same shapes and contact pair."""
    same = point.shape_a == other.shape_a and point.shape_b == other.shape_b
    return same and point.pair == other.pair


@sweep
def inverse_mass(rows, factored, a, b, place, moment, force):
    """Return the relative speed along a unit impulse on row a and its opposite on row b [1/kg].

    The impulse is `force`, with the `moment` [m] about `place`. Its effect is propagated to the
    ground as in `constraints.paths`. The result is the sum over all joints on both paths.
    """
    w = 0.0
    k, x, y = a, at_origin(factored, a, place, moment, force), force
    other, u, v = b, scale(-1.0, at_origin(factored, b, place, moment, force)), scale(-1.0, force)
    while k > 0 or other > 0:
        if other > k:
            k, x, y, other, u, v = other, u, v, k, x, y
        if k == other:
            x, y = add(x, u), add(y, v)
            other = 0
        taken, x, y = mobility(rows, factored, k, x, y)
        w += taken
        k = feeling(rows, k)
    return w


@part
def at_origin(factored, k, place, moment, force):
    """Return the moment about row k's origin of a wrench at a given point."""
    return add_cross(moment, sub(place, origin_of(factored, k)), force)
