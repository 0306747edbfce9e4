"""Impulses of an impact that are not unique, since others satisfy the contact laws as well.

At a solution, the laws of an island are linear in a change d of its impulses. With the symbols of
`newton`, others satisfy them if d = P' (d - k Y Yᵀ d). Newton's steps with a compliance take
everything else out of a change of all impulses. A change is only noted if it changes the total
force or torque between two bodies: the corners of a face may exchange impulses without effect.
"""

from ...tolerances import NOTABLE, SHARED, SOLVED
from .. import layout as at
from ..arrays import HELD_IMPULSES, LOOSE, REPORT, opened
from ..compiler.jit import part, sweep
from ..constraints.blocks import along, ends_of, first_of, place_a, size_of, type_of
from ..vec import add, add_scaled, cross, dot, load, mul, scale, store, sub
from .contacts import contacts_at
from .island_rows import SCRATCH, clear, felt, fours_of, pull, rows_of, weigh
from .newton import CORRECTIONS, LAWS, direction, look

PRIME = 1013  # squares modulo a prime are in no relation to the places of points


@sweep
def note_loose(scene, n, size):
    """Write the first contact block of island n whose total is not unique, plus 1, into REPORT.

    λ must solve the laws of the island, whose largest velocity is `size`.
    """
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    weigh(scene, n)
    look(scene, n, 0.0, LAWS)
    disturb(data, islands, n, size)
    for taken in range(CORRECTIONS):
        miss_laws(data, islands, n)
        if not direction(scene, n, SHARED, taken == 0, False):
            return
        if take_step(data, islands, n) <= SOLVED * size:
            break
    least = NOTABLE * size
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        if type_of(data.blocks.blocks_i, i) != at.T_CONTACT or continues(data, islands, n, j):
            continue
        if changes_total(data, islands, n, j, least):
            data.space.vectors[REPORT, LOOSE] = i + 1.0
            return


@part
def change_of(data, i):
    """Return the change d of the impulses of a block."""
    r = first_of(data.space.slots, i)
    return rows_of(data.space.vectors[HELD_IMPULSES], r, size_of(data.blocks.blocks_i, i))


@sweep
def disturb(data, islands, n, size):
    """Change all impulses that the laws leave free, without a pattern. Torques keep theirs."""
    d, kept = data.space.vectors[HELD_IMPULSES], islands.slope
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        if type_of(data.blocks.blocks_i, i) == at.T_TURN:
            for c in range(9):
                kept[i, SCRATCH.slope + c] = 0.0
        r = first_of(data.space.slots, i)
        for c in range(size_of(data.blocks.blocks_i, i)):
            share = ((r + c + 1) * (r + c + 1)) % PRIME / PRIME - 0.5
            d[r + c] = kept[i, SCRATCH.slope + 4 * c] * share * size / islands.mobility[i]


@sweep
def miss_laws(data, islands, n):
    """Write P' (d - k Y Yᵀ d) - d of the blocks of island n into SCRATCH.miss."""
    kept = islands.slope
    clear(islands.path, fours_of(islands))
    for j in range(islands.first[n], islands.first[n + 1]):
        pull(islands, j, change_of(data, islands.blocks[j]), islands.path)
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        d = change_of(data, i)
        z = add_scaled(d, -1.0 / islands.mobility[i], felt(islands, j, islands.path))
        slope = (*load(kept, i, 0), *load(kept, i, 3), *load(kept, i, 6))
        store(kept, i, SCRATCH.miss, sub(mul(slope, z), d))


@sweep
def take_step(data, islands, n):
    """Add SCRATCH.move to d. Returns the largest change, as a velocity."""
    d, most = data.space.vectors[HELD_IMPULSES], 0.0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r = first_of(data.space.slots, i)
        for c in range(size_of(data.blocks.blocks_i, i)):
            move = islands.slope[i, SCRATCH.move + c]
            d[r + c] += move
            most = max(most, islands.mobility[i] * abs(move))
    return most


@part
def meets_as(data, i, j):
    """Check whether blocks i and j are contact points of the same two bodies."""
    blocks_i = data.blocks.blocks_i
    a, b = ends_of(blocks_i, i)
    c, d = ends_of(blocks_i, j)
    return type_of(blocks_i, j) == at.T_CONTACT and a == c and b == d


@part
def continues(data, islands, n, j):
    """Check whether the j-th block belongs to the same two bodies as the one before."""
    if j == islands.first[n]:
        return False
    return meets_as(data, islands.blocks[j], islands.blocks[j - 1])


@sweep
def changes_total(data, islands, n, j, least):
    """Check whether d changes the total force, or torque, at the points that follow the j-th.

    Smaller changes than those that move a point by a velocity `least` are rounding.
    """
    first = islands.blocks[j]
    force, torque, pushed, turned = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0
    for m in range(j, islands.first[n + 1]):
        i = islands.blocks[m]
        if not meets_as(data, first, i):
            break
        d = change_of(data, i)
        own = scale(d[0], along(data.space.place, i, 0))
        own = add_scaled(own, d[1], along(data.space.place, i, 1))
        own = add_scaled(own, d[2], along(data.space.place, i, 2))
        arm = sub(place_a(data.space.place, i), place_a(data.space.place, first))
        force, torque = add(force, own), add(torque, cross(arm, own))
        size = dot(own, own)
        pushed = max(pushed, size)
        turned = max(turned, size * dot(arm, arm))
    if pushed * islands.mobility[first] * islands.mobility[first] <= least * least:
        return False
    enough = NOTABLE * NOTABLE
    return dot(force, force) > enough * pushed or dot(torque, torque) > enough * turned
