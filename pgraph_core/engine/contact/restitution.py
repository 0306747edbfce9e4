"""What a soft contact loses: the same share of the speed of an impact, however fast it is.

Its force is k d^1.5 (1 + χ d' / V) with V² = d'² + 2 E w: E, the sum of 2/5 k d^2.5, is the energy
in the springs between two shapes, and w the inverse of the mass that their resultant moves. So V is
the speed of an impact with the energy that is left. All terms grow alike with the speed, and the
restitution depends on χ alone.
"""

import math

from ..compiler.jit import part, sweep
from ..linear import factor3, solve3
from ..rows import mass_of, origin_of, rotation_of
from ..vec import add, add_cross, dot, mul, rotate_sym, scale, sub, xyz

SLOWEST = 1e-30  # m/s: keeps a quotient finite where nothing moves


@part
def lost_share(law, speed, stored):
    """χ d' / V of a contact point that closes at `speed` [m/s]; `stored` is 2 E w [m²/s²]."""
    return law.loss * speed / max(math.sqrt(speed * speed + stored), SLOWEST)


@sweep
def stored_speed(contacts, rows, const, work, n, count):
    """(2 E w of the two shapes at contact point n [m²/s²], the first point that is not theirs)."""
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
        size = law.stiffness * depth * math.sqrt(depth)
        pushed = scale(size, xyz(point.normal))
        force = add(force, pushed)
        moment = add_cross(moment, sub(xyz(point.point_a), place), pushed)
        push += size
        energy += 0.4 * size * depth
        end += 1
    if not push > 0.0:
        return 0.0, end
    force, moment = scale(1.0 / push, force), scale(1.0 / push, moment)
    w = inverse_mass(contacts, rows, const, work, first.shape_a, place, moment, force)
    w += inverse_mass(contacts, rows, const, work, first.shape_b, place, moment, force)
    return 2.0 * energy * w, end


@part
def same_shapes(point, other):
    """Whether two contact points are between the same shapes, of the same contact pair."""
    same = point.shape_a == other.shape_a and point.shape_b == other.shape_b
    return same and point.pair == other.pair


@part
def inverse_mass(contacts, rows, const, work, i, place, moment, force):
    """Speed along itself that a unit impulse, a wrench at a place, gives shape i [1/kg].

    Exactly of a free body that carries no others; else all of its tree counts as a point mass.
    """
    if i < 0:
        return 0.0
    shape = contacts.geometry.shapes[i]
    k = shape.row
    if shape.alone == 0:
        return dot(force, force) * shape.lightness
    mass, com, inertia = mass_of(const, k)
    r = rotation_of(work, k)
    centre = add(origin_of(work, k), mul(r, com))
    torque = add_cross(moment, sub(place, centre), force)
    turned = solve3(factor3(rotate_sym(r, inertia)), torque)
    return dot(force, force) / mass + dot(torque, turned)
