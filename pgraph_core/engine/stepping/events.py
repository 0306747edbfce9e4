"""Where events happen within a step: roots of functions of the state on dense output.

Compiled where a run has events. Their functions are called by address, as EVENT says.
"""

from numba import types

from .. import layout as at
from ..compiler.address import caller
from ..compiler.jit import kernel, part, sweep
from ..motion import F1
from .adaptive import LOOK_BACK
from .attempt import EPS, copied
from .explicit import within

# scene, t, q, v; one number an event, which happens where it changes sign
EVENT = types.void(types.int64, types.float64, F1, F1, F1)
call_event = caller(EVENT)

LOOKS = 4  # at events, in one step
BISECTIONS = 100


@part
def look(scene, address, size, stages, row, t, values):
    """Values of all events at the state in `row`."""
    nq, nv = size
    call_event(address, (scene, t, stages[row, :nq], stages[row, nq : nq + nv], values))


@part
def crosses(value, before, wanted):
    """Whether an event of this sign before has happened by now."""
    fell = before > 0 and value <= 0.0
    rose = before < 0 and value >= 0.0
    return (fell and wanted <= 0) or (rose and wanted >= 0)


@sweep
def locate_event(scene, accelerate, tableau, size, stages, control, flow, events, i, low, high):
    """Share of the step, just past the root of event i between `low` and `high`.

    Interpolation, truncation, projection ([Oliveira, Takahashi 2020]), which never takes notably
    more rounds than bisection; to rounding of time.
    """
    _, address, values, _, _, _ = events
    settings = control[0]
    t, h = settings.old_time, settings.old_width
    within(scene, accelerate, tableau, size, stages, control, flow, low)
    look(scene, address, size, stages, at.TRIAL, t + low * h, values)
    y_low = values[i]
    within(scene, accelerate, tableau, size, stages, control, flow, high)
    look(scene, address, size, stages, at.TRIAL, t + high * h, values)
    y_high = values[i]
    tolerance = max(EPS * (t + h) / h, EPS)
    reach = high - low
    for _ in range(BISECTIONS):
        if high - low <= 2.0 * tolerance or y_high == 0.0:
            break
        middle = 0.5 * (low + high)
        chord = middle
        if y_low != y_high:
            chord = (y_high * low - y_low * high) / (y_high - y_low)
        step = 0.2 * (high - low) * (high - low) / reach
        towards = 1.0 if middle > chord else -1.0
        x = chord + towards * step if step < abs(middle - chord) else middle
        slack = max(reach - 0.5 * (high - low), 0.0)
        if abs(x - middle) > slack:
            x = middle - towards * slack
        reach *= 0.5
        x = min(max(x, low + tolerance), high - tolerance)
        within(scene, accelerate, tableau, size, stages, control, flow, x)
        look(scene, address, size, stages, at.TRIAL, t + x * h, values)
        if (values[i] > 0.0) == (y_high > 0.0) or values[i] == 0.0:
            high = x
            y_high = values[i]
        else:
            low = x
            y_low = values[i]
    return high


@sweep
def first_event(scene, accelerate, tableau, size, stages, control, flow, events):
    """Share of the last step at which the first event happens, and which; 2 where none does."""
    _, address, values, signs, wanted, _ = events
    settings = control[0]
    before = 0.0
    for n in range(1, LOOKS + 1):
        share = n / LOOKS
        t = settings.old_time + share * settings.old_width
        row = at.TRIAL
        if n == LOOKS:
            row = at.Y
        else:
            within(scene, accelerate, tableau, size, stages, control, flow, share)
        look(scene, address, size, stages, row, t, values)
        first = 2.0
        which = -1
        for i in range(signs.shape[0]):
            look(scene, address, size, stages, row, t, values)
            if crosses(values[i], signs[i], wanted[i]):
                found = locate_event(
                    scene, accelerate, tableau, size, stages, control, flow, events, i, before,
                    share,
                )  # fmt: skip
                if found < first:
                    first = found
                    which = i
                if n < LOOKS:
                    within(scene, accelerate, tableau, size, stages, control, flow, share)
            elif values[i] != 0.0:
                signs[i] = 1 if values[i] > 0.0 else -1
        if which >= 0:
            return first, which
        before = share
    return 2.0, -1


@kernel(LOOK_BACK, nogil=True, later=True)
def look_back(scene, accelerate, tableau, size, stages, control, flow, events):
    """Go back to the first event within the last step, if there is one."""
    settings, _ = control
    share, which = first_event(scene, accelerate, tableau, size, stages, control, flow, events)
    if which < 0:
        return
    within(scene, accelerate, tableau, size, stages, control, flow, share)
    copied(stages, at.TRIAL, at.Y, stages.shape[1])
    settings.time = settings.old_time + share * settings.old_width
    settings.fresh = 0
    settings.fired = 1
    events[3][which] = -events[3][which]
    events[5][0] = which
