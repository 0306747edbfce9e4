"""Fixed steps with events: a step that ends a phase is repeated with the width up to there.

The first such instant of a step is bracketed and closed in on by secants and bisection over the
width of the step: any method of one step can be located in, and needs no dense output.
"""

from numba import types

from .. import layout as at
from ..compiler.jit import kernel, sweep
from ..contact.phases import opened_events
from ..contact.points import (
    NOW,
    TRIALS,
    WIDTH,
    accepted,
    bracket_of,
    call_observe,
    lowest,
    narrowed,
    next_try,
    over,
    start,
    watch,
)
from ..motion import F1, F2, I1, OUT, call_record
from ..records import CLOCK, COUNTERS, CURSOR, array_of
from .run import LINKS, TABLEAU, call_step, fail, finish, keep, restore


@sweep
def trial(scene, held, links, contact, tableau, stabilised, t, w, q, v, stages, flow, ledger,
          before, counters):  # fmt: skip
    """A step of width w from the state kept, observed; a status code."""
    step = links[3]
    row = stages.shape[0] - 2
    restore(q, v, stages, row)
    ledger[0] = before[0]
    ledger[1] = before[1]
    arguments = (scene, links[0], tableau, t, w, q, v, 0, stages, flow, ledger)
    counters.solver_iterations += call_step(step, arguments)
    counters.evaluations += max(tableau[1].shape[0], 1) + 1
    code = finish(held, links[1], stabilised, t + w, q, v, counters)
    if code == at.DONE:
        vdot = stages[4, : v.shape[0]]
        call_observe(contact.links.observe, (scene, t + w, q, v, vdot, flow))
        watch(contact, NOW, w)
    return code


@sweep
def locate_event(scene, held, links, contact, tableau, stabilised, t, h, q, v, stages, flow, ledger,
                 before, counters):  # fmt: skip
    """The first width at which a phase ends, its state in q and v; W_NOW tells which."""
    watched = contact.watched
    bracket = bracket_of(watched, h)
    ended = True
    for n in range(TRIALS):
        width = bracket[1] - bracket[0]
        if width <= WIDTH or width <= 1e-15 * h:
            break
        w = next_try(watched, bracket, n)
        code = trial(scene, held, links, contact, tableau, stabilised, t, w, q, v, stages, flow,
                     ledger, before, counters)  # fmt: skip
        ended = code != at.DONE or over(watched, NOW)
        bracket = narrowed(watched, bracket, w, ended)
    if not ended:
        trial(scene, held, links, contact, tableau, stabilised, t, bracket[1], q, v, stages, flow,
              ledger, before, counters)  # fmt: skip
    return bracket[1]


@kernel(
    types.int64(types.int64, LINKS, TABLEAU, types.Tuple((F1, I1, F1)), array_of(CURSOR),
       types.int64, types.boolean, F1, F1, F2, F1, F1, array_of(COUNTERS), F1, OUT,
       array_of(CLOCK)),
    nogil=True,
    later=True,
)  # fmt: skip
def run_events(
    scene, links, tableau, schedule, cursor, budget, stabilised, q, v, stages, flow, ledger,
    counters, failure, out, clock,
):  # fmt: skip
    """As `run`; EVENT where a phase ends: `clock` is there, W_NOW tells which.

    Points have been observed at the state it starts from.
    """
    record = links[2]
    cursor, counters, clock = cursor[0], counters[0], clock[0]
    times, substeps, width = schedule
    contact = opened_events(scene).contact
    held = contact.links.held
    kept = stages.shape[0] - 2
    for _ in range(budget):
        i = cursor.frame
        if i == times.shape[0]:
            return at.DONE
        taken = cursor.taken
        if i == 0 or taken == substeps[i - 1]:
            if not call_record(record, (scene, links[0], times[i], q, v, flow, ledger, i, out)):
                fail(scene, times[i], v, failure)
                return at.NOT_FINITE
            cursor.frame = i + 1
            cursor.taken = 0
            continue
        h = width[i - 1] - clock.done
        t = times[i - 1] + taken * width[i - 1] + clock.done
        keep(q, v, stages, kept)
        start(contact, h)
        saved = (ledger[0], ledger[1])
        code = trial(scene, held, links, contact, tableau, stabilised, t, h, q, v, stages, flow,
                     ledger, saved, counters)  # fmt: skip
        counters.steps += 1
        if code != at.DONE:
            restore(q, v, stages, kept)
            fail(scene, t, v, failure)
            if taken > 0 or clock.done > 0.0:
                times[i] = t
                frame = (scene, links[0], t, q, v, flow, ledger, i, out)
                cursor.frame = i + call_record(record, frame)
            return code
        end = h
        if not over(contact.watched, NOW):
            end = lowest(contact, h)
            if end < h:
                trial(scene, held, links, contact, tableau, stabilised, t, end, q, v, stages, flow,
                      ledger, saved, counters)  # fmt: skip
                if not over(contact.watched, NOW):
                    trial(scene, held, links, contact, tableau, stabilised, t, h, q, v, stages,
                          flow, ledger, saved, counters)  # fmt: skip
        if over(contact.watched, NOW):
            w = locate_event(scene, held, links, contact, tableau, stabilised, t, end, q, v, stages,
                             flow, ledger, saved, counters)  # fmt: skip
            clock.event = t + w
            clock.done += w
            if width[i - 1] - clock.done <= 1e-12 * width[i - 1]:
                cursor.taken = taken + 1
                clock.done = 0.0
            return at.EVENT
        accepted(contact)
        cursor.taken = taken + 1
        clock.done = 0.0
    return at.DONE if cursor.frame == times.shape[0] else at.RUNNING
