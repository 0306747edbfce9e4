"""Phases of contact points and limits in runs whose steps are chosen by their error.

A step is taken as if no phase ended in it. Then the first end of a phase is located on dense
output, and the step ends there.
"""

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
from ..motion import PROJECTION, call_projection
from .adaptive import LOOK_BACK
from .attempt import copied
from .explicit import within

PARTS = 4  # of a step that are looked at for themselves


@kernel(PROJECTION, nogil=True, later=True)
def event_projection(scene, t, q, v, rounds):
    """As `projection`, onto held constraints; rounds taken, -1 where it fails."""
    links = opened_events(scene).contact.links
    return call_projection(links.project, (links.held, t, q, v, rounds))


@sweep
def look(scene, accelerate, tableau, size, stages, control, flow, contact, low, w):
    """The state a time low + w after the last step's start, into TRIAL, observed and watched."""
    settings, counters = control
    nq, nv = size
    h = settings.old_width
    if low + w < h:
        within(scene, accelerate, tableau, size, stages, control, flow, (low + w) / h)
    else:
        copied(stages, at.Y, at.TRIAL, stages.shape[1])
    q = stages[at.TRIAL, :nq]
    v = stages[at.TRIAL, nq : nq + nv]
    vdot = stages[at.ERROR, nq : nq + nv]
    t = settings.old_time + low + w
    call_observe(contact.links.observe, (scene, t, q, v, vdot, flow))
    counters.evaluations += 1
    watch(contact, NOW, w)


@sweep
def seen(scene, accelerate, tableau, size, stages, control, flow, contact, low, width):
    """Width at which a phase has ended in a part of the step from `low`; 0 where none has."""
    watched = contact.watched
    look(scene, accelerate, tableau, size, stages, control, flow, contact, low, width)
    if over(watched, NOW):
        return width
    dip = lowest(contact, width)
    if dip < width:
        look(scene, accelerate, tableau, size, stages, control, flow, contact, low, dip)
        if over(watched, NOW):
            return dip
        look(scene, accelerate, tableau, size, stages, control, flow, contact, low, width)
    return 0.0


@sweep
def locate(scene, accelerate, tableau, size, stages, control, flow, contact, low, end):
    """The first width from `low` at which a phase ends, its state in TRIAL; W_NOW tells which."""
    watched = contact.watched
    bracket = bracket_of(watched, end)
    ended = True
    for n in range(TRIALS):
        if bracket[1] - bracket[0] <= WIDTH:
            break
        w = next_try(watched, bracket, n)
        look(scene, accelerate, tableau, size, stages, control, flow, contact, low, w)
        ended = over(watched, NOW)
        bracket = narrowed(watched, bracket, w, ended)
    if not ended:
        look(scene, accelerate, tableau, size, stages, control, flow, contact, low, bracket[1])
    return bracket[1]


@kernel(LOOK_BACK, nogil=True, later=True)
def look_for_phases(scene, accelerate, tableau, size, stages, control, flow, events):
    """Go back to where the first phase ends within the last step, if one does.

    The first of events' numbers is the time in which friction may turn slow slip around [s].
    """
    settings, _ = control
    contact = opened_events(scene).contact
    h = settings.old_width
    for n in range(PARTS):
        low = h * n / PARTS
        width = h * (n + 1) / PARTS - low
        end = seen(scene, accelerate, tableau, size, stages, control, flow, contact, low, width)
        if end > 0.0:
            w = locate(scene, accelerate, tableau, size, stages, control, flow, contact, low, end)
            copied(stages, at.TRIAL, at.Y, stages.shape[1])
            settings.time = settings.old_time + low + w
            settings.fresh = 0
            settings.fired = 1
            return
        accepted(contact)
        start(contact, events[2][0])
