"""Runs at steps chosen by their error, with output and events on dense output.

What makes one step of a method, an *attempt*, is called by address; accepting it, the next
width, corners of tables, projection, frames and events are the same for all methods. A state y is
a row of `stages`; see `layout`. Errors are measured against the machine's own scales: one radian,
its length, its speeds so far, so that no tolerance has a unit.
"""

import math

from numba import types

from . import layout as at
from ._jit import kernel, part, sweep
from .handle import caller
from .motion import F1, F2, I1, OUT, call_acceleration, call_projection, call_record, opened
from .moving import normalise_all, rate
from .run import STEP_ROUNDS, call_settle, fastest_row
from .vec import add_scaled, cross, dot, finite, store3

f8, i8, u1 = types.float64, types.int64, types.boolean
C2 = types.complex128[:, ::1]
LINKS = types.UniTuple(i8, 4)  # acceleration, projection, record, attempt
SIZE = types.UniTuple(i8, 2)  # nq, nv
TABLEAU = types.Tuple((F2, F1, F1, F2, F2))  # a, b, c, error, dense
CONTROL = types.Tuple((F1, I1, I1))  # control, flags, counters
MATRICES = types.Tuple((F2, C2))  # of implicit methods: four n by n, and one
# scene, accelerate, tableau, size, h, stages, control, matrices, flow
ATTEMPT = f8(i8, i8, TABLEAU, SIZE, f8, F2, CONTROL, MATRICES, F1)
# addresses of `look_back` (0: no events) and of EVENT, numbers now, then: their signs, wanted
# directions (0: both), the one that fired
EVENTS = types.Tuple((i8, i8, F1, I1, I1, I1))
LOOK_BACK = types.void(i8, i8, TABLEAU, SIZE, F2, CONTROL, F1, EVENTS)
# safety, exponents of this error and the last one, least and largest change of width
CONTROLLER = types.UniTuple(f8, 5)
call_attempt = caller(ATTEMPT)
call_look_back = caller(LOOK_BACK)

EPS = 2.220446049250313e-16
KEPT = 1.2  # a change of width below it is not worth factoring a matrix anew
NOT_SOLVED = -1.0  # what an attempt gives where its equations were not solved


@sweep
def copied(stages, a, b, n):
    """Row b becomes row a."""
    for i in range(n):
        stages[b, i] = stages[a, i]


@sweep
def combine(stages, base, weights, count, h, out):
    """Row `out` = row `base` (-1: zero) + h Σ weights k over the first `count` stages."""
    n = stages.shape[1]
    for i in range(n):
        stages[out, i] = 0.0
    for r in range(count):
        x = weights[r]
        if x != 0.0:
            for i in range(n):
                stages[out, i] += x * stages[at.STAGE + r, i]
    for i in range(n):
        stages[out, i] *= h
    if base >= 0:
        for i in range(n):
            stages[out, i] += stages[base, i]


@sweep
def slope(scene, accelerate, t, size, stages, row, out, flow, counters):
    """y' at the state in `row` into row `out`."""
    nq, nv = size
    q = stages[row, :nq]
    v = stages[row, nq : nq + nv]
    rate(opened(scene)[0], q, v, stages[out, :nq])
    tau = stages[at.TORQUE, :nv]
    call_acceleration(accelerate, (scene, t, q, v, tau, stages[out, nq : nq + nv], flow))
    stages[out, nq + nv] = flow[0]
    stages[out, nq + nv + 1] = flow[1]
    counters[at.N_EVAL] += 1
    counters[at.N_ITERATE] += int(flow[2])


# -- errors against scales -----------------------------------------------------------------------


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
    least what would bring it one scale far in the whole run.
    """
    nq, nv = size
    found = extremes(
        rows, size, stages, at.Y, control[at.SPIN], control[at.SPEED], control[at.LENGTH]
    )
    control[at.SPIN], control[at.SPEED], control[at.LENGTH] = found
    spin, speed, length = extremes(rows, size, stages, at.CANDIDATE, found[0], found[1], found[2])
    spin = max(spin, 1.0 / control[at.SPAN])
    speed = max(speed, length / control[at.SPAN])
    rtol = control[at.RTOL]
    atol = control[at.ATOL]
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
    """1/x, or 0: what has no scale has not moved."""
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
    """The larger magnitude; nan where y is."""
    return x if abs(y) <= x else abs(y)


# -- explicit Runge-Kutta ------------------------------------------------------------------------


@sweep
def turn_spins(rows, size, stages, by, row, back):
    """ω of balls and free bodies in `row`, or its rate, into the body's axes, or `back`.

    The body is turned as in row `by`. Stages are added up in its axes: there an error of the
    attitude is no error of ω, which a rotation that is not stable would make grow.
    """
    nq, nv = size
    if nq == nv:
        return
    sign = 2.0 if back else -2.0
    for k in range(1, rows.shape[0]):
        kind = rows[k, at.KIND]
        if kind >= at.BALL:
            i = rows[k, at.QI] + (3 if kind == at.FREE else 0)
            j = nq + rows[k, at.VI]
            w = stages[by, i]
            u = (stages[by, i + 1], stages[by, i + 2], stages[by, i + 3])
            share = 1.0 / (w * w + dot(u, u))
            x = (stages[row, j], stages[row, j + 1], stages[row, j + 2])
            across = cross(u, x)
            x = add_scaled(x, sign * w * share, across)
            store3(stages[row], j, add_scaled(x, 2.0 * share, cross(u, across)))


@kernel(ATTEMPT, nogil=True)
def attempt_runge_kutta(scene, accelerate, tableau, size, h, stages, control, matrices, flow):
    """One step of an explicit method from Y into CANDIDATE; its error over the tolerance."""
    a, b, c, error, _ = tableau
    settings, _, counters = control
    t = settings[at.TIME]
    clip = settings[at.CLIP]
    n = stages.shape[1]
    s = b.shape[0]
    rows = opened(scene)[0]
    copied(stages, at.SLOPE, at.STAGE, n)
    turn_spins(rows, size, stages, at.Y, at.STAGE, False)
    base(rows, size, stages, at.Y)
    for r in range(1, s):
        x = min(t + c[r] * h, clip)
        stage(scene, accelerate, rows, x, size, h, a[r], r, stages, flow, counters)
    combine(stages, at.ERROR, b, s, h, at.CANDIDATE)
    turn_spins(rows, size, stages, at.CANDIDATE, at.CANDIDATE, True)
    if not finite(stages[at.CANDIDATE]):
        return math.inf
    if error.shape[1] > s:
        last_stage(scene, accelerate, rows, min(t + h, clip), size, s, stages, flow, counters)
    weigh(rows, size, stages, settings)
    found = estimate(rows, size, error[0], h, stages)
    if error.shape[0] > 1 and found > 0.0:  # [Hairer, Norsett, Wanner 1993, II.10]
        other = 0.1 * estimate(rows, size, error[1], h, stages)
        found = found * found / math.sqrt(found * found + other * other)
    return found


@sweep
def base(rows, size, stages, row):
    """The state in `row` into ERROR, spins in the bodies' axes."""
    copied(stages, row, at.ERROR, stages.shape[1])
    turn_spins(rows, size, stages, row, at.ERROR, False)


@sweep
def stage(scene, accelerate, rows, t, size, h, weights, r, stages, flow, counters):
    """Stage r from `base` and those before."""
    combine(stages, at.ERROR, weights, r, h, at.TRIAL)
    turn_spins(rows, size, stages, at.TRIAL, at.TRIAL, True)
    slope(scene, accelerate, t, size, stages, at.TRIAL, at.STAGE + r, flow, counters)
    turn_spins(rows, size, stages, at.TRIAL, at.STAGE + r, False)


@sweep
def last_stage(scene, accelerate, rows, t, size, s, stages, flow, counters):
    """The stage at CANDIDATE, which is the first one of the next step."""
    slope(scene, accelerate, t, size, stages, at.CANDIDATE, at.STAGE + s, flow, counters)
    turn_spins(rows, size, stages, at.CANDIDATE, at.STAGE + s, False)


@sweep
def estimate(rows, size, weights, h, stages):
    """h Σ weights k over its tolerance."""
    combine(stages, -1, weights, weights.shape[0], h, at.ERROR)
    return size_of(rows, size, stages, at.ERROR)


# -- dense output --------------------------------------------------------------------------------


@sweep
def fill(scene, accelerate, tableau, size, stages, control, flow):
    """The further stages that dense output takes, once a step."""
    a, b, c, _, _ = tableau
    settings, flags, counters = control
    h = settings[at.W_OLD]
    rows = opened(scene)[0]
    base(rows, size, stages, at.Y_OLD)
    for r in range(b.shape[0] + 1, a.shape[0]):
        x = min(settings[at.T_OLD] + c[r] * h, settings[at.CLIP])
        stage(scene, accelerate, rows, x, size, h, a[r], r, stages, flow, counters)
    flags[at.FILLED] = 1


@sweep
def within(scene, accelerate, tableau, size, stages, control, flow, share):
    """y at this share of the last step into TRIAL, quaternions at length one."""
    settings, flags, _ = control
    dense = tableau[4]
    if flags[at.FILLED] == 0:
        fill(scene, accelerate, tableau, size, stages, control, flow)
    n = stages.shape[1]
    for i in range(n):
        stages[at.TRIAL, i] = 0.0
    for r in range(dense.shape[0]):
        x = 0.0
        for power in range(dense.shape[1] - 1, -1, -1):
            x = share * (dense[r, power] + x)
        if x != 0.0:
            for i in range(n):
                stages[at.TRIAL, i] += x * stages[at.STAGE + r, i]
    rows = opened(scene)[0]
    base(rows, size, stages, at.Y_OLD)
    for i in range(n):
        stages[at.TRIAL, i] = stages[at.ERROR, i] + settings[at.W_OLD] * stages[at.TRIAL, i]
    turn_spins(rows, size, stages, at.TRIAL, at.TRIAL, True)
    normalise_all(rows, stages[at.TRIAL, : size[0]])


# -- the run -------------------------------------------------------------------------------------


@sweep
def first_width(scene, accelerate, size, order, stages, control, flow):
    """A width for the first step, from how fast y and y' change, without a unit."""
    settings, _, counters = control
    rows = opened(scene)[0]
    n = stages.shape[1]
    copied(stages, at.Y, at.CANDIDATE, n)
    weigh(rows, size, stages, settings)
    rtol = settings[at.RTOL]
    shrink = (0.01 * rtol) ** (1.0 / (order + 1))
    fastest = max(size_of(rows, size, stages, at.SLOPE) * rtol, 1.0 / settings[at.SPAN])
    h = 0.01 / fastest
    for i in range(n):
        stages[at.CANDIDATE, i] = stages[at.Y, i] + h * stages[at.SLOPE, i]
    t = settings[at.TIME]
    slope(scene, accelerate, t + h, size, stages, at.CANDIDATE, at.ERROR, flow, counters)
    if not finite(stages[at.ERROR]):
        return 0.1 * shrink * h
    weigh(rows, size, stages, settings)
    for i in range(n):
        stages[at.ERROR, i] = (stages[at.ERROR, i] - stages[at.SLOPE, i]) / h
    bend = math.sqrt(size_of(rows, size, stages, at.ERROR) * rtol)
    return shrink / max(fastest, bend)


@sweep
def next_width(settings, flags, corners, stop):
    """(width of the next step, whether it ends at `stop` or a corner of a table, at a corner)."""
    t = settings[at.TIME]
    k = flags[at.KNOT]
    while k < corners.shape[0] and corners[k] <= t:
        k += 1
    flags[at.KNOT] = k
    corner = k < corners.shape[0] and corners[k] <= stop
    end = corners[k] if corner else stop
    left = end - t
    h = (
        settings[at.WIDEST]
        if flags[at.FIXED] == 1
        else min(settings[at.WIDTH], settings[at.WIDEST])
    )
    settings[at.CLIP] = math.inf
    if h * (1.0 + 1e-9) >= left:
        if corner:
            settings[at.CLIP] = end - 2.0 * EPS * abs(end)
        return left, True, corner
    if flags[at.FIXED] == 0 and 2.0 * h > left:
        h = 0.5 * left  # no sliver before the end
    return h, False, False


@part
def widen(settings, flags, controller, error, h):
    """The width to try after a step of width h with this error: PI control."""
    safety, by_error, by_last, least, most = controller
    error = max(error, 1e-10)
    if error > 1.0:
        settings[at.WIDTH] = h * max(least, safety * error**-by_error)
        return
    factor = safety * error**-by_error * settings[at.LAST_ERROR] ** by_last
    most = max(most, settings[at.WIDTH] / h)  # where the step was cut short
    factor = max(least, min(factor, most))
    if flags[at.REJECTED] == 1:
        factor = min(factor, 1.0)
    settings[at.WIDTH] = h * factor
    settings[at.LAST_ERROR] = max(error, 1e-4)


@sweep
def refuse(settings, flags, counters, controller, error, h):
    """A step that is too wide: a narrower one, or why there is none; a status code."""
    counters[at.N_REJECT] += 1
    flags[at.REJECTED] = 1
    if error >= 0.0 and error < math.inf:
        flags[at.BROKEN] = 0
        widen(settings, flags, controller, error, h)
    else:
        flags[at.BROKEN] = 2 if error == NOT_SOLVED else 1
        settings[at.WIDTH] = 0.25 * h
    floor = max(16.0 * EPS * settings[at.TIME], 1e-18 * settings[at.SPAN])
    if flags[at.FIXED] == 0 and settings[at.WIDTH] > floor:
        return at.DONE
    if flags[at.BROKEN] == 1:
        return at.NOT_FINITE
    return at.NOT_SOLVED if flags[at.BROKEN] == 2 else at.TOO_SMALL


@sweep
def accept(scene, links, tableau, size, h, end, corner, stabilised, stages, control, flow):
    """CANDIDATE becomes Y, on the constraints; the slope there where it is known; a status code."""
    accelerate, project, _, _ = links
    settings, flags, counters = control
    nq, nv = size
    n = stages.shape[1]
    s = tableau[1].shape[0]
    explicit = tableau[4].shape[0] > 0
    rows = opened(scene)[0]
    if explicit and tableau[3].shape[1] == s:
        x = min(settings[at.TIME] + h, settings[at.CLIP])
        last_stage(scene, accelerate, rows, x, size, s, stages, flow, counters)
    copied(stages, at.Y, at.Y_OLD, n)
    copied(stages, at.CANDIDATE, at.Y, n)
    settings[at.T_OLD] = settings[at.TIME]
    settings[at.W_OLD] = h
    settings[at.TIME] = end
    flags[at.FILLED] = 0
    flags[at.REJECTED] = 0
    counters[at.N_STEP] += 1
    q = stages[at.Y, :nq]
    v = stages[at.Y, nq : nq + nv]
    normalise_all(rows, q)
    extra = opened(scene)[6][12]
    if extra[at.THEIR_SETTLE] != 0:
        call_settle(extra[at.THEIR_SETTLE], (scene, end, q, v))
    moved = stabilised and opened(scene)[4][5][0] > 0
    flags[at.FRESH] = 1 if explicit and not moved and not corner else 0
    if flags[at.FRESH] == 1:
        copied(stages, at.STAGE + s, at.SLOPE, n)
        turn_spins(rows, size, stages, at.Y, at.SLOPE, True)
        rate(rows, q, v, stages[at.SLOPE, :nq])
    if not moved:
        return at.DONE
    rounds = call_projection(project, (scene, end, q, v, STEP_ROUNDS))
    counters[at.N_PROJECT] += abs(rounds)
    if not finite(v):
        return at.NOT_FINITE
    return at.NOT_CONVERGED if rounds < 0 else at.DONE


@sweep
def step_once(
    scene, links, tableau, controller, order, size, corners, stop, stabilised, stages, control,
    matrices, flow, events,
):  # fmt: skip
    """One attempt, accepted or not; a status code."""
    accelerate, _, _, attempt = links
    settings, flags, counters = control
    if flags[at.FRESH] == 0:
        t = settings[at.TIME]
        slope(scene, accelerate, t, size, stages, at.Y, at.SLOPE, flow, counters)
        flags[at.FRESH] = 1
        if not finite(stages[at.SLOPE]):
            return at.NOT_FINITE
    if settings[at.WIDTH] == 0.0:
        settings[at.WIDTH] = first_width(scene, accelerate, size, order, stages, control, flow)
    h, ends, corner = next_width(settings, flags, corners, stop)
    error = call_attempt(
        attempt, (scene, accelerate, tableau, size, h, stages, control, matrices, flow)
    )
    good = error >= 0.0 and error < math.inf
    if not good or (error > 1.0 and flags[at.FIXED] == 0):
        return refuse(settings, flags, counters, controller, error, h)
    end = settings[at.TIME] + h
    if ends:
        end = corners[flags[at.KNOT]] if corner else stop
    widen(settings, flags, controller, min(error, 1.0), h)
    if tableau[4].shape[0] == 0 and h < settings[at.WIDTH] < KEPT * h:
        settings[at.WIDTH] = h
    code = accept(scene, links, tableau, size, h, end, corner, stabilised, stages, control, flow)
    if code == at.DONE and events[0] != 0:
        call_look_back(events[0], (scene, accelerate, tableau, size, stages, control, flow, events))
        if flags[at.FIRED] == 1:
            t = settings[at.TIME]
            onto_constraints(scene, links[1], size, stabilised, t, stages, at.Y, counters)
    return code


@part
def onto_constraints(scene, project, size, stabilised, t, stages, row, counters):
    """The state in `row` projected, as the ends of steps are."""
    nq, nv = size
    if stabilised and opened(scene)[4][5][0] > 0:
        state = (stages[row, :nq], stages[row, nq : nq + nv])
        rounds = call_projection(project, (scene, t, state[0], state[1], STEP_ROUNDS))
        counters[at.N_PROJECT] += abs(rounds)


@sweep
def frame(scene, links, tableau, size, t, i, stabilised, stages, control, flow, out):
    """Frame i at time t, within the last step or at its end; whether all of it is finite."""
    accelerate, project, record, _ = links
    settings, _, counters = control
    nq, nv = size
    row = at.Y
    if t != settings[at.TIME]:
        share = (t - settings[at.T_OLD]) / settings[at.W_OLD]
        within(scene, accelerate, tableau, size, stages, control, flow, share)
        row = at.TRIAL
        onto_constraints(scene, project, size, stabilised, t, stages, row, counters)
    counters[at.N_EVAL] += 1
    q = stages[row, :nq]
    v = stages[row, nq : nq + nv]
    ledger = stages[row, nq + nv :]
    return call_record(record, (scene, accelerate, t, q, v, flow, ledger, i, out))


@kernel(
    i8(i8, LINKS, TABLEAU, CONTROLLER, i8, SIZE, F1, F1, I1, i8, u1, F2, CONTROL, MATRICES, F1,
       F1, EVENTS, OUT),
    nogil=True,
)  # fmt: skip
def run_adaptive(
    scene, links, tableau, controller, order, size, times, corners, cursor, budget, stabilised,
    stages, control, matrices, flow, failure, events, out,
):  # fmt: skip
    """At most `budget` attempts and frames on from `cursor`; a status code, RUNNING if not over.

    `times` are those of frames, `corners` those where tables bend: steps end there. A method
    without dense output ends its steps at frames too. EVENT is given once for each event, with Y
    there: the caller may change Y, FRESH and the scene, and go on.
    """
    settings, flags, counters = control
    last = times.shape[0]
    dense = tableau[4].shape[0] > 0
    for _ in range(budget):
        i = cursor[at.FRAME]
        if i == last:
            return at.DONE
        t = settings[at.TIME]
        code = at.DONE
        if times[i] <= t:
            if frame(
                scene, links, tableau, size, times[i], i, stabilised, stages, control, flow, out
            ) == 0:  # fmt: skip
                code = at.NOT_FINITE
            else:
                cursor[at.FRAME] = i + 1
        elif flags[at.FIRED] == 1:
            flags[at.FIRED] = 0
            return at.EVENT
        elif counters[at.N_STEP] + counters[at.N_REJECT] >= flags[at.MOST]:
            code = at.TOO_MANY
        else:
            code = step_once(
                scene, links, tableau, controller, order, size, corners,
                times[last - 1] if dense else times[i], stabilised, stages, control, matrices,
                flow, events,
            )  # fmt: skip
        if code != at.DONE:
            give_up(scene, links, tableau, size, times, cursor, t, stages, control, flow, out)
            failure[0] = t
            nq, nv = size
            failure[1] = fastest_row(opened(scene)[0], stages[at.Y, nq : nq + nv])
            return code
    return at.DONE if cursor[at.FRAME] == last else at.RUNNING


@sweep
def give_up(scene, links, tableau, size, times, cursor, t, stages, control, flow, out):
    """The last state that was good becomes the last frame, if it is later than the one before."""
    settings, _, _ = control
    i = cursor[at.FRAME]
    if settings[at.TIME] > t:
        copied(stages, at.Y_OLD, at.Y, stages.shape[1])
        settings[at.TIME] = t
    if i > 0 and i < times.shape[0] and times[i - 1] < t:
        times[i] = t
        cursor[at.FRAME] = i + frame(
            scene, links, tableau, size, t, i, False, stages, control, flow, out
        )
