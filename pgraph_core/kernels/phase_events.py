"""Runs with events: a step that ends a phase is taken again, shorter, until it ends there.

What is watched (`layout`, watched) falls below zero where a phase ends. The first such instant of
a step is bracketed and closed in on by secants and bisection over the width of the step: any
method of one step can be located in, and needs no dense output.
"""

import math

from numba import types

from . import layout as at
from ._jit import kernel, part, sweep
from .motion import F1, F2, I1, OUT, call_record
from .phases import LINK_HELD, LINK_OBSERVE, opened_phased, slides, way
from .run import LINKS, TABLEAU, call_step, fail, finish, keep, restore
from .sites import call_observe
from .vec import dot, load, store

WIDTH = 1e-14  # s: a bracket this narrow is an instant
TRIALS = 80
FORCE_TOLERANCE = 1e-11  # of the largest contact force: rounding of the solution for them
PIVOT_TOLERANCE = 1e-9
NEARLY = 0.02  # of how far a gap falls and rises in a step: what the cubic may be off
NOTHING = 1.0  # what a monitor that watches nothing shows


@sweep
def watch(sites, row, w):
    """Fill row `row` of `watched` a time w after the step's start, from what was observed."""
    _, sites_i, sites_f, _, watched, _, _, _, _ = sites
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
                    b += 1e-4 * sites_f[s, at.S_STILL] - sites_f[s, at.S_START]
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
    _, sites_i, sites_f, _, _, _, _, _, _ = sites
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


@sweep
def accepted(sites):
    """After a step: points that have left the ground or slide notably are watched plainly."""
    _, sites_i, sites_f, _, _, _, _, _, _ = sites
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
    _, sites_i, sites_f, _, _, _, _, _, _ = sites
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


@sweep
def trial(scene, held, links, sites, tableau, stabilised, t, w, q, v, stages, flow, ledger,
          before, counters):  # fmt: skip
    """A step of width w from the state kept, observed; a status code."""
    step = links[3]
    row = stages.shape[0] - 2
    restore(q, v, stages, row)
    ledger[0] = before[0]
    ledger[1] = before[1]
    arguments = (scene, links[0], tableau, t, w, q, v, stages, flow, ledger)
    counters[at.N_ITERATE] += call_step(step, arguments)
    counters[at.N_EVAL] += max(tableau[1].shape[0], 1) + 1
    code = finish(held, links[1], stabilised, t + w, q, v, counters)
    if code == at.DONE:
        vdot = stages[4, : v.shape[0]]
        call_observe(sites[0][LINK_OBSERVE], (scene, t + w, q, v, vdot, flow))
        watch(sites, at.W_NOW, w)
    return code


@part
def copy_row(watched, a, b):
    for n in range(watched.shape[1]):
        watched[b, n] = watched[a, n]


@sweep
def locate_event(scene, held, links, sites, tableau, stabilised, t, h, q, v, stages, flow, ledger,
                 before, counters):  # fmt: skip
    """The first width at which a phase ends, its state in q and v, what ended in W_NOW."""
    watched = sites[4]
    copy_row(watched, at.W_START, at.W_LOW)
    copy_row(watched, at.W_NOW, at.W_HIGH)
    lo = 0.0
    hi = h
    last = 0
    sides = (1.0, 1.0)
    at_hi = True
    for n in range(TRIALS):
        width = hi - lo
        if width <= WIDTH or width <= 1e-15 * h:
            break
        w = lo + urgent(watched, width, sides)
        if n % 3 == 2:
            w = 0.5 * (lo + hi)
        w = min(max(w, lo + 0.3 * WIDTH), hi - 0.3 * WIDTH)
        code = trial(scene, held, links, sites, tableau, stabilised, t, w, q, v, stages, flow,
                     ledger, before, counters)  # fmt: skip
        at_hi = code != at.DONE or over(watched, at.W_NOW)
        if at_hi:
            hi = w
            copy_row(watched, at.W_NOW, at.W_HIGH)
            sides = (0.5 * sides[0], 1.0) if last == 1 else (1.0, 1.0)
            last = 1
        else:
            lo = w
            copy_row(watched, at.W_NOW, at.W_LOW)
            sides = (1.0, 0.5 * sides[1]) if last == -1 else (1.0, 1.0)
            last = -1
    if not at_hi:
        trial(scene, held, links, sites, tableau, stabilised, t, hi, q, v, stages, flow, ledger,
              before, counters)  # fmt: skip
    return hi


@kernel(
    types.int64(types.int64, LINKS, TABLEAU, types.Tuple((F1, I1, F1)), I1, types.int64,
       types.boolean, F1, F1, F2, F1, F1, I1, F1, OUT, F1),
    nogil=True,
    later=True,
)  # fmt: skip
def run_phased(
    scene, links, tableau, schedule, cursor, budget, stabilised, q, v, stages, flow, ledger,
    counters, failure, out, clock,
):  # fmt: skip
    """As `run`; EVENT where a phase ends: `clock` is there, W_NOW says which of what is watched.

    Sites have been observed at the state it starts from.
    """
    record = links[2]
    times, substeps, width = schedule
    sites = opened_phased(scene)[10]
    held = sites[0][LINK_HELD]
    kept = stages.shape[0] - 2
    for _ in range(budget):
        i = cursor[at.FRAME]
        if i == times.shape[0]:
            return at.DONE
        taken = cursor[at.TAKEN]
        if i == 0 or taken == substeps[i - 1]:
            if not call_record(record, (scene, links[0], times[i], q, v, flow, ledger, i, out)):
                fail(scene, times[i], v, failure)
                return at.NOT_FINITE
            cursor[at.FRAME] = i + 1
            cursor[at.TAKEN] = 0
            continue
        h = width[i - 1] - clock[at.CL_DONE]
        t = times[i - 1] + taken * width[i - 1] + clock[at.CL_DONE]
        keep(q, v, stages, kept)
        start(sites, h)
        watch(sites, at.W_START, 0.0)
        saved = (ledger[0], ledger[1])
        code = trial(scene, held, links, sites, tableau, stabilised, t, h, q, v, stages, flow,
                     ledger, saved, counters)  # fmt: skip
        counters[at.N_STEP] += 1
        if code != at.DONE:
            restore(q, v, stages, kept)
            fail(scene, t, v, failure)
            if taken > 0 or clock[at.CL_DONE] > 0.0:
                times[i] = t
                frame = (scene, links[0], t, q, v, flow, ledger, i, out)
                cursor[at.FRAME] = i + call_record(record, frame)
            return code
        end = h
        if not over(sites[4], at.W_NOW):
            end = lowest(sites, h)
            if end < h:
                trial(scene, held, links, sites, tableau, stabilised, t, end, q, v, stages, flow,
                      ledger, saved, counters)  # fmt: skip
                if not over(sites[4], at.W_NOW):
                    trial(scene, held, links, sites, tableau, stabilised, t, h, q, v, stages, flow,
                          ledger, saved, counters)  # fmt: skip
        if over(sites[4], at.W_NOW):
            w = locate_event(scene, held, links, sites, tableau, stabilised, t, end, q, v, stages,
                             flow, ledger, saved, counters)  # fmt: skip
            clock[at.CL_EVENT] = t + w
            clock[at.CL_DONE] += w
            if width[i - 1] - clock[at.CL_DONE] <= 1e-12 * width[i - 1]:
                cursor[at.TAKEN] = taken + 1
                clock[at.CL_DONE] = 0.0
            return at.EVENT
        accepted(sites)
        cursor[at.TAKEN] = taken + 1
        clock[at.CL_DONE] = 0.0
    return at.DONE if cursor[at.FRAME] == times.shape[0] else at.RUNNING
