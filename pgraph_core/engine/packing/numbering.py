"""Depth-first numbers, and Pgraph and jdof on them: O(n), whatever the order of the table."""

from .. import layout as at
from ..compiler.jit import kernel, part


@part
def depth_first(parent, bodies_i):
    """Number the table in pre-order, upper row first; how many rows the ground reaches.

    `parent[i - 1]` is the row of row i's parent, from 1, 0 = ground. Fills BODY_PARENT and TABLE
    by number, NUMBER, CHILD and NEXT by row of `bodies_i` (zero at first).
    """
    for i in range(parent.shape[0], 0, -1):
        p = parent[i - 1]
        bodies_i[i, at.NEXT] = bodies_i[p, at.CHILD]
        bodies_i[p, at.CHILD] = i
    number = 0
    i = bodies_i[0, at.CHILD]
    while i > 0:
        number += 1
        bodies_i[i, at.NUMBER] = number
        bodies_i[number, at.TABLE] = i
        bodies_i[number, at.BODY_PARENT] = bodies_i[parent[i - 1], at.NUMBER]
        if bodies_i[i, at.CHILD] > 0:
            i = bodies_i[i, at.CHILD]
        else:
            while i > 0 and bodies_i[i, at.NEXT] == 0:
                i = parent[i - 1]
            i = bodies_i[i, at.NEXT]  # the ground's is 0: done
    return number


@kernel("i8(i8[:,::1],i8[::1],i8[::1])")
def pgraph(bodies_i, path, jdof):
    """Pgraph and jdof of Fig. 4 for depth-first numbers; their length.

    Where a body's parent is not the body before it, the walk has come back to the parent. Both
    arrays are (2 nb + 1,).
    """
    n = 0
    roots = 0
    for b in range(1, bodies_i.shape[0]):
        roots += bodies_i[b, at.BODY_PARENT] == 0
    if roots > 1:
        path[0] = jdof[0] = 0
        n = 1
    for b in range(1, bodies_i.shape[0]):
        if b > 1 and bodies_i[b, at.BODY_PARENT] != b - 1:
            path[n] = bodies_i[b, at.BODY_PARENT]
            jdof[n] = 0
            n += 1
        path[n] = b
        jdof[n] = bodies_i[b, at.DOF]
        n += 1
    return n
