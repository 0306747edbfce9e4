"""Impulses of an impact in event-driven runs, by the contact law of time stepping."""

import math

from ...tolerances import SOLVED
from ..arrays import BEFORE, DINV, LAMBDA, RHS, SPEEDS, opened
from ..compiler.jit import kernel
from ..compiler.kinds import F1, i8, void
from ..constraints.blocks import first_of, one_sided, type_of
from ..constraints.constraints import number_rows
from ..constraints.paths import unspread
from ..vec import largest
from .contacts import contacts_at
from .impulse import solve_impulses
from .sweeps import own_block


@kernel(void(i8, F1), later=True)
def strike(scene, v):
    """Compute λ of the active rows at the velocities v, after `points.impulse_rows`.

    An impact has no duration, so no velocity is negligible in it. Where several solutions exist,
    rounding must not choose one: a point at rest starts as one that closes, with an impulse that
    stops the SOLVED part of the largest velocity.
    """
    data = opened(scene)
    blocks, space, vectors = data.blocks, data.space, data.space.vectors
    contacts_at(data.links.contacts).tally[0].share = 0.0
    m = number_rows(blocks, space.slots)
    for r in range(m):
        vectors[BEFORE, r] = vectors[RHS, r]
        vectors[LAMBDA, r] = 0.0
    slow = SOLVED * largest(vectors[RHS], m)
    for j in range(1, blocks.active[0] + 1):
        i = blocks.active[j]
        r = first_of(space.slots, i)
        own_block(space.y, space.slots, vectors[DINV], i, space.own)
        if one_sided(type_of(blocks.blocks_i, i)) and abs(vectors[RHS, r]) < slow:
            vectors[LAMBDA, r] = slow / space.own[i, 0] if space.own[i, 0] > 0.0 else 0.0
    for j in range(v.shape[0]):
        vectors[SPEEDS, j] = v[j]
    unspread(data.rows, data.const, data.work, vectors[SPEEDS])
    solve_impulses(scene, math.inf, False, True)
