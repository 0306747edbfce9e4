"""Errors against the machine's own scales: one radian, its length, its speeds so far.

No tolerance then has a unit.
"""

import math

from .. import layout as at
from ..compiler.jit import part, sweep
from ..rows import BALL, FREE, ROTATE, TRANSLATE, kind_of, q_of, v_of
from .state import EPS


@sweep
def extremes(rows, size, stages, row, spin, speed, length):
    """Largest rotation speed, linear speed and displacement, of the state in `row` and given."""
    nq, state = size[0], stages[row]
    for k in range(1, rows.shape[0]):
        i = q_of(rows, k)
        j = nq + v_of(rows, k)
        kind = kind_of(rows, k)
        if kind == TRANSLATE:
            speed = max(speed, abs(state[j]))
            length = max(length, abs(state[i]))
            continue
        spin = max(spin, abs(state[j]))
        if kind >= BALL:
            spin = max(spin, abs(state[j + 1]), abs(state[j + 2]))
        if kind == FREE:
            for n in range(3):
                speed = max(speed, abs(state[j + 3 + n]))
                length = max(length, abs(state[i + n]))
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
    weights = stages[at.WEIGHT]
    rtol = control.rtol
    atol = control.atol
    weights[nq + nv] = 0.0
    weights[nq + nv + 1] = 0.0
    for k in range(1, rows.shape[0]):
        i = q_of(rows, k)
        j = nq + v_of(rows, k)
        kind = kind_of(rows, k)
        if kind == ROTATE:
            rounding = 8.0 * EPS * abs(stages[at.CANDIDATE, i])
            weights[i] = 1.0 / (rtol + atol + rounding)
            weights[j] = 1.0 / (rtol * spin + atol)
        elif kind == TRANSLATE:
            weights[i] = inverse(rtol * length + atol)
            weights[j] = inverse(rtol * speed + atol)
        else:
            if kind == FREE:
                for n in range(3):
                    weights[i + n] = inverse(rtol * length + atol)
                    weights[j + 3 + n] = inverse(rtol * speed + atol)
                i += 3
            for n in range(4):
                weights[i + n] = 1.0 / (rtol + atol)
            for n in range(3):
                weights[j + n] = 1.0 / (rtol * spin + atol)


@part
def inverse(x):
    """1/x, or 0 for a coordinate without scale, which has not moved."""
    return 1.0 / x if x > 0.0 else 0.0


@sweep
def size_of(rows, size, stages, row):
    """Largest |error in `row`| over its tolerance; of a quaternion: of the angle it turns by."""
    nq, nv = size
    error, state, weights = stages[row], stages[at.CANDIDATE], stages[at.WEIGHT]
    worst = 0.0
    for k in range(1, rows.shape[0]):
        i = q_of(rows, k)
        kind = kind_of(rows, k)
        if kind <= TRANSLATE:
            worst = larger(worst, error[i] * weights[i])
            continue
        if kind == FREE:
            for n in range(3):
                worst = larger(worst, error[i + n] * weights[i + n])
            i += 3
        along = 0.0
        whole = 0.0
        length = 0.0
        for n in range(4):
            e = error[i + n]
            u = state[i + n]
            along += e * u
            whole += e * e
            length += u * u
        across = max(whole - along * along / length, 0.0) + 0.0 * whole
        worst = larger(worst, 2.0 * math.sqrt(across) * weights[i])
    for j in range(nq, nq + nv):
        worst = larger(worst, error[j] * weights[j])
    return worst


@part
def larger(x, y):
    """The larger magnitude; nan where one of the two is."""
    return x if abs(y) <= x or not x >= 0.0 else abs(y)
