"""Islands that no velocities satisfy, for example of a body that is driven into the ground.

The velocities u = Y w + g of an island's rows satisfy its constraints, limits and contacts if u = 0
in bilateral rows and u_n ≥ 0 in unilateral ones. By Farkas' lemma there is no such w if and only if
there are impulses λ, with λ_n ≥ 0, that do nothing, Yᵀ λ = 0, although gᵀ λ < 0. The velocities
that violate the rows least show which is the case. They are those of a compliance s that goes to
zero: u = -s λ where λ acts. If they satisfy the rows, λ stays finite and s λ vanishes. Otherwise λ
is such an impulse divided by s. Friction takes no part, since it requires no velocity.
"""

from ...tolerances import NOTABLE, PROXIMAL, SHARED
from .. import layout as at
from ..arrays import IMPULSES_BEFORE, LAMBDA, opened
from ..compiler.jit import sweep
from ..compiler.lane import load_four
from ..constraints.blocks import (
    dry,
    first_of,
    one_sided,
    set_slack,
    size_of,
    slack_of,
    type_of,
)
from ..vec import dot
from .contacts import contacts_at
from .island_rows import copy_impulses, drop_impulses, fours_of, respond, rows_of, weigh
from .newton import HIT, MOST_STEPS, NORMALS, direction, go, look, start_from_here
from .sparse import total


@sweep
def strain(scene, n):
    """Return the rounding of velocities by the impulses of island n [m/s], after `weigh`.

    Impulses without bound are a solution to rounding of any laws.
    """
    data = opened(scene)
    islands = contacts_at(data.links.contacts).islands
    most = 0.0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        r, size = first_of(data.space.slots, i), size_of(data.blocks.blocks_i, i)
        lam = rows_of(data.space.vectors[LAMBDA], r, size)
        most = max(most, islands.mobility[i] * max(abs(lam[0]), max(abs(lam[1]), abs(lam[2]))))
    return HIT * most


@sweep
def barred(scene, n, size):
    """Check whether no velocities satisfy the constraints, limits and gaps of island n.

    The violation must be notable, relative to the velocity `size`, and λ must do less than the
    NOTABLE part of what its violation is worth: |Yᵀ λ|² against Σ s λ². Velocities that satisfy the
    rows would then have to change by more than 1 / NOTABLE times as much as those that violate them
    least. If so, the normal impulses are in the third column of `pushed`. Otherwise λ is unchanged.
    """
    copy_impulses(scene, n, LAMBDA, IMPULSES_BEFORE)
    drop_impulses(scene, n)
    weigh(scene, n)
    respond(scene, n)
    soft = 1.0
    left = look(scene, n, soft, NORMALS)[1]
    for _ in range(MOST_STEPS):
        before = left
        start_from_here(scene, n)
        if not direction(scene, n, soft, True, False):
            break
        go(scene, n, 1.0)
        _, left, noise, changed = look(scene, n, soft, NORMALS)
        if changed == 0 and (left <= noise or not left < before):
            if soft == PROXIMAL:
                break
            soft = max(SHARED * soft, PROXIMAL)
            left = look(scene, n, soft, NORMALS)[1]
    found = is_certain(scene, n, soft, size)
    if not found:
        copy_impulses(scene, n, IMPULSES_BEFORE, LAMBDA)
        respond(scene, n)
    return found


@sweep
def is_certain(scene, n, soft, size):
    """Check whether λ proves that no velocities satisfy island n, and keep it in `pushed` if so."""
    data = opened(scene)
    blocks_i, slots, vectors = data.blocks.blocks_i, data.space.slots, data.space.vectors
    islands = contacts_at(data.links.contacts).islands
    effect, worth, beyond = 0.0, 0.0, 0.0
    for p in range(fours_of(islands)):
        change = load_four(islands.speeds, p, 0) - load_four(islands.free, p, 0)
        effect += total(change * change)
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        kind = type_of(blocks_i, i)
        lam = rows_of(vectors[LAMBDA], first_of(slots, i), size_of(blocks_i, i))
        if not dry(kind) and not (one_sided(kind) and lam[0] < 0.0):
            worth += soft * islands.weight[i] * dot(lam, lam)
            beyond = max(beyond, soft * islands.weight[i] * lam[0] if one_sided(kind) else 0.0)
    if not (beyond > NOTABLE * size and NOTABLE * worth > effect):
        return False
    for i in range(islands.pushed.shape[0]):
        islands.pushed[i, 2] = 0.0
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        lam = rows_of(vectors[LAMBDA], first_of(slots, i), size_of(blocks_i, i))
        islands.pushed[i, 2] = max(abs(lam[0]), max(abs(lam[1]), abs(lam[2])))
    return True


@sweep
def ease(scene, n):
    """Let all gaps of island n close by their tolerated depth in a step, without bounces."""
    data = opened(scene)
    blocks_i, blocks_f = data.blocks.blocks_i, data.blocks.blocks_f
    islands = contacts_at(data.links.contacts).islands
    for j in range(islands.first[n], islands.first[n + 1]):
        i = islands.blocks[j]
        if one_sided(type_of(blocks_i, i)):
            blocks_f[i, at.BOUNCE] = 0.0
            room = max(blocks_f[i, at.ROOM], slack_of(blocks_i, blocks_f, i))
            set_slack(blocks_i, blocks_f, i, room)
