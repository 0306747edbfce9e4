"""Errors against the machine's own scales: one radian, its length, its speeds so far.

No tolerance then has a unit.
"""

import math

from .. import layout as at
from ..compiler.jit import part, sweep
from .state import EPS


@sweep
def extremes(rows, size, stages, row, spin, speed, length):
    """Largest rotation speed, linear speed and displacement, of the state in `row` and given."""
    nq = size[0]
    for k in range(1, rows.shape[0]):
        i = rows[k, at.QI]
        j = nq + rows[k, at.VI]
        kind = rows[k, at.KIND]
        if kind == at.TRANSLATE:
            speed = max(speed, abs(stages[row, j]))
            length = max(length, abs(stages[row, i]))
            continue
        spin = max(spin, abs(stages[row, j]))
        if kind >= at.BALL:
            spin = max(spin, abs(stages[row, j + 1]), abs(stages[row, j + 2]))
        if kind == at.FREE:
            for n in range(3):
                speed = max(speed, abs(stages[row, j + 3 + n]))
                length = max(length, abs(stages[row, i + n]))
    return spin, speed, length


@sweep
def weigh(rows, size, stages, control):
    """One over the tolerance of every number of y into WEIGHT; the ledger has none.

    The scales are one radian, the mechanism's length, and the fastest of all joints so far, at
    least one scale per run.
    """
    nq, nv = size
    found = extremes(rows, size, stages, at.Y, control.spin, control.speed, control.length)
    control.spin, control.speed, control.length = found
    spin, speed, length = extremes(rows, size, stages, at.CANDIDATE, found[0], found[1], found[2])
    spin = max(spin, 1.0 / control.span)
    speed = max(speed, length / control.span)
    rtol = control.rtol
    atol = control.atol
    stages[at.WEIGHT, nq + nv] = 0.0
    stages[at.WEIGHT, nq + nv + 1] = 0.0
    for k in range(1, rows.shape[0]):
        i = rows[k, at.QI]
        j = nq + rows[k, at.VI]
        kind = rows[k, at.KIND]
        if kind == at.ROTATE:
            rounding = 8.0 * EPS * abs(stages[at.CANDIDATE, i])
            stages[at.WEIGHT, i] = 1.0 / (rtol + atol + rounding)
            stages[at.WEIGHT, j] = 1.0 / (rtol * spin + atol)
        elif kind == at.TRANSLATE:
            stages[at.WEIGHT, i] = inverse(rtol * length + atol)
            stages[at.WEIGHT, j] = inverse(rtol * speed + atol)
        else:
            if kind == at.FREE:
                for n in range(3):
                    stages[at.WEIGHT, i + n] = inverse(rtol * length + atol)
                    stages[at.WEIGHT, j + 3 + n] = inverse(rtol * speed + atol)
                i += 3
            for n in range(4):
                stages[at.WEIGHT, i + n] = 1.0 / (rtol + atol)
            for n in range(3):
                stages[at.WEIGHT, j + n] = 1.0 / (rtol * spin + atol)


@part
def inverse(x):
    """1/x, or 0 for a coordinate without scale, which has not moved."""
    return 1.0 / x if x > 0.0 else 0.0


@sweep
def size_of(rows, size, stages, row):
    """Largest |error in `row`| over its tolerance; of a quaternion: of the angle it turns by."""
    nq, nv = size
    worst = 0.0
    for k in range(1, rows.shape[0]):
        i = rows[k, at.QI]
        kind = rows[k, at.KIND]
        if kind <= at.TRANSLATE:
            worst = larger(worst, stages[row, i] * stages[at.WEIGHT, i])
            continue
        if kind == at.FREE:
            for n in range(3):
                worst = larger(worst, stages[row, i + n] * stages[at.WEIGHT, i + n])
            i += 3
        along = 0.0
        whole = 0.0
        length = 0.0
        for n in range(4):
            e = stages[row, i + n]
            u = stages[at.CANDIDATE, i + n]
            along += e * u
            whole += e * e
            length += u * u
        across = max(whole - along * along / length, 0.0) + 0.0 * whole
        worst = larger(worst, 2.0 * math.sqrt(across) * stages[at.WEIGHT, i])
    for j in range(nq, nq + nv):
        worst = larger(worst, stages[row, j] * stages[at.WEIGHT, j])
    return worst


@part
def larger(x, y):
    """The larger magnitude; nan where one of the two is."""
    return x if abs(y) <= x or not x >= 0.0 else abs(y)
