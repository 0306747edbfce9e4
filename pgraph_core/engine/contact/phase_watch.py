"""What ends a phase: monitors of contact points and limits that fall below zero, and when.

Times within a step are widths from where it starts, or from where a part of it does.
"""

import math

from .. import layout as at
from ..compiler.jit import kernel, part, sweep
from ..vec import dot, load, store
from .phases import opened_phased, slides, way

WIDTH = 1e-14  # s: a bracket this narrow is an instant
TRIALS = 80
FORCE_TOLERANCE = 1e-11  # of the largest contact force: rounding of the solution for them
PIVOT_TOLERANCE = 1e-9
NEARLY = 0.02  # of how far a gap falls and rises in a step: what the cubic may be off
NOTHING = 1.0  # what a monitor that watches nothing shows


@sweep
def watch(sites, row, w):
    """Fill row `row` of `watched` a time w after the step's start, from what was observed."""
    sites_i, sites_f, watched = sites.sites_i, sites.sites_f, sites.watched
    largest = 0.0
    for s in range(sites_i.shape[0]):
        push = sites_f[s, at.S_PUSH]
        largest = max(largest, abs(push), sites_f[s, at.S_DRAG])
    slack = FORCE_TOLERANCE * largest
    for s in range(sites_i.shape[0]):
        phase = sites_i[s, at.S_PHASE]
        fresh = sites_i[s, at.S_FRESH] > 0
        mu = sites_f[s, at.S_FRICTION]
        a = sites_f[s, at.S_PUSH] + slack
        b = NOTHING
        c = NOTHING
        if phase == at.SWING:
            a = sites_f[s, at.S_DISTANCE]
            if fresh:
                a -= sites_f[s, at.S_START]
                if sites_i[s, at.S_FRESH] == 1:
                    a += sites_f[s, at.S_NOISE]
                a = a / w if w > 0.0 else max(sites_f[s, at.S_RATE], 0.0)
        elif phase == at.STANCE:
            if sites_i[s, at.S_LIMIT] == 0:
                b = mu * sites_f[s, at.S_PUSH] - sites_f[s, at.S_DRAG] + slack
        else:
            c = sites_f[s, at.S_PIVOT] + PIVOT_TOLERANCE
            if mu > 0.0:
                b = dot(load(sites_f, s, at.S_SLIP_V), load(sites_f, s, at.S_WAY))
                if fresh:
                    b += sites_f[s, at.S_STILL] - sites_f[s, at.S_START]
                    b = b / w if w > 0.0 else NOTHING
        watched[row, 3 * s] = a
        watched[row, 3 * s + 1] = b
        watched[row, 3 * s + 2] = c


@part
def over(watched, row):
    """Whether a phase has ended."""
    found = False
    for n in range(watched.shape[1]):
        found = found or watched[row, n] < 0.0
    return found


@sweep
def start(sites, h):
    """What a step's start was, for phases that begin with it; how slow slip is turned slowly."""
    sites_i, sites_f = sites.sites_i, sites.sites_f
    rate = 0.0
    for s in range(sites_i.shape[0]):
        if slides(sites_i[s, at.S_PHASE]):
            rate += sites_f[s, at.S_DRAG] * sites_f[s, at.S_EASE]
    for s in range(sites_i.shape[0]):
        sites_f[s, at.S_START] = sites_f[s, at.S_DISTANCE]
        sites_f[s, at.S_BEFORE] = sites_f[s, at.S_RATE]
        if slides(sites_i[s, at.S_PHASE]):
            slip_v = load(sites_f, s, at.S_SLIP_V)
            along = dot(slip_v, load(sites_f, s, at.S_WAY))
            sites_f[s, at.S_START] = along
            if along > 10.0 * sites_f[s, at.S_STILL]:
                sites_i[s, at.S_FRESH] = 0
            sites_f[s, at.S_BLEND] = 0.5 * h * rate
    watch(sites, at.W_START, 0.0)


@kernel("void(i8,f8)", later=True)
def begin(scene, h):
    """What sites were just observed to do is what a step starts from; `h` as in `start`."""
    start(opened_phased(scene).sites, h)


@sweep
def accepted(sites):
    """After a step: points that have left the ground or slide notably are watched plainly."""
    sites_i, sites_f = sites.sites_i, sites.sites_f
    for s in range(sites_i.shape[0]):
        if slides(sites_i[s, at.S_PHASE]):
            u = load(sites_f, s, at.S_SLIP_V)
            if dot(u, u) > (10.0 * sites_f[s, at.S_STILL]) ** 2:
                store(sites_f, s, at.S_WAY, way(sites_f, s, u))
                sites_i[s, at.S_FRESH] = 0
        elif sites_f[s, at.S_DISTANCE] > 2.0 * sites_f[s, at.S_NOISE]:
            sites_i[s, at.S_FRESH] = 0


@sweep
def lowest(sites, h):
    """When within the step a gap may have dipped below zero and recovered; h where none has.

    By the cubic through gaps and rates at both ends; what it leaves above zero by little is
    looked at too.
    """
    sites_i, sites_f = sites.sites_i, sites.sites_f
    first = h
    for s in range(sites_i.shape[0]):
        a = h * sites_f[s, at.S_BEFORE]
        b = h * sites_f[s, at.S_RATE]
        if sites_i[s, at.S_PHASE] != at.SWING or not (a < 0.0 < b):
            continue
        before = sites_f[s, at.S_START]
        rise = sites_f[s, at.S_DISTANCE] - before
        square = 3.0 * rise - 2.0 * a - b
        cube = a + b - 2.0 * rise
        x = -a / (square + math.sqrt(max(square * square - 3.0 * cube * a, 0.0)))
        if 0.0 < x < 1.0 and before + x * (a + x * (square + x * cube)) < NEARLY * (b - a):
            first = min(first, x * h)
    return first


@sweep
def urgent(watched, width, sides):
    """Width from `lo` at which the first monitor crosses zero by secants; `sides` weigh them."""
    best = width
    for n in range(watched.shape[1]):
        low = watched[at.W_LOW, n]
        high = watched[at.W_HIGH, n]
        if high < 0.0:
            low = max(low, 0.0) * sides[0]
            high = high * sides[1]
            best = min(best, width * low / (low - high))
    return best


@part
def copy_row(watched, a, b):
    for n in range(watched.shape[1]):
        watched[b, n] = watched[a, n]


@sweep
def bracket_of(watched, end):
    """(lo, hi, weights of both in a secant, which was moved last): a phase ends in between."""
    copy_row(watched, at.W_START, at.W_LOW)
    copy_row(watched, at.W_NOW, at.W_HIGH)
    return 0.0, end, 1.0, 1.0, 0


@sweep
def next_try(watched, bracket, n):
    """Width to look at next: by secants, every third one in the middle."""
    lo, hi, _, _, _ = bracket
    w = 0.5 * (lo + hi) if n % 3 == 2 else lo + urgent(watched, hi - lo, bracket[2:4])
    return min(max(w, lo + 0.3 * WIDTH), hi - 0.3 * WIDTH)


@sweep
def narrowed(watched, bracket, w, ended):
    """The bracket after a look at w, which W_NOW is of."""
    lo, hi, low, high, last = bracket
    if ended:
        copy_row(watched, at.W_NOW, at.W_HIGH)
        return lo, w, 0.5 * low if last == 1 else 1.0, 1.0, 1
    copy_row(watched, at.W_NOW, at.W_LOW)
    return w, hi, 1.0, 0.5 * high if last == -1 else 1.0, -1
