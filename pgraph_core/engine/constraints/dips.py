"""Dips of pivots during a run: where its constraints are nearly dependent, for a look afterwards.

The pivots of Ω's factor are what each row adds to those before it. One that falls far below its
largest so far marks a position at or beside which the row says nothing new; a row that never says
anything has no dip. What dips only because rows take each other's place is sorted out afterwards.
"""

from .. import layout as at
from ..arrays import opened
from ..compiler.jit import sweep

LEAST = 13  # row of `vectors`: the smallest inverse pivots so far
DIP = 100.0  # times smaller than its largest: a pivot in a dip
OVER = 25.0  # times smaller: where the dip ends
ROUNDING = 1e-12  # of the time: evaluations at one instant
TOGETHER = 4.0  # times the way between evaluations: stages of one step see one dip


@sweep
def watch(scene, t, q, v):
    """Count dips after a factorisation; keep the deepest place of the first ones."""
    space = opened(scene).space
    factor, dips, least = space.factor, space.dips, space.vectors[LEAST]
    deepest = OVER
    gap = abs(t - dips[0, at.DIP_TIME])
    if gap > ROUNDING * abs(t):
        dips[0, at.DIP_APART] = gap
        dips[0, at.DIP_TIME] = t
    for r in range(int(dips[0, at.DIP_ROWS])):
        x = factor[r, r]
        if 0.0 < x < least[r]:
            least[r] = x
        elif x > deepest * least[r]:
            deepest = x / least[r]
    if deepest <= OVER:
        dips[0, at.DIP_INSIDE] = 0.0
        return
    if dips[0, at.DIP_INSIDE] == 0.0:
        if deepest <= DIP:
            return
        dips[0, at.DIP_INSIDE] = 1.0
        n = min(int(dips[0, at.DIP_COUNT]), dips.shape[0] - 1)
        again = abs(t - dips[n, at.DIP_TIME]) <= TOGETHER * dips[0, at.DIP_APART]
        if n == 0 or not again:
            dips[0, at.DIP_COUNT] += 1.0
    n = int(dips[0, at.DIP_COUNT])
    if n < dips.shape[0] and deepest > dips[n, at.DIP_DEPTH]:
        dips[n, at.DIP_DEPTH] = deepest
        dips[n, at.DIP_TIME] = t
        dips[n, at.DIP_APART] = dips[0, at.DIP_APART]
        nq = q.shape[0]
        for i in range(nq):
            dips[n, at.DIP_STATE + i] = q[i]
        for j in range(v.shape[0]):
            dips[n, at.DIP_STATE + nq + j] = v[j]
