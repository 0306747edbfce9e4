"""Signals that are not a part of the state: forces, lengths of struts, inputs of drives, gaps.

Forces of contacts and constraints are measured where samples are taken.

A force follows from all forces at its instant, so no expression that a force follows from reads it.
A sample acts after its instant and reads the force that a frame there would record, with time
stepping that of the last step.
"""

import math

from ...forces.cable import length_of_chain, rate_of_chain
from ...forces.path import measured as measured_path
from ...tolerances import TINY
from .. import layout as at
from ..arrays import CONTACTS, TAU
from ..compiler.address import stored
from ..compiler.jit import kernel, part, sweep
from ..compiler.kinds import F1, F2, f8, i8, void
from ..constraints.constraints import wrenches
from ..contact.touches import HOLDING, next_touch, relative_velocity, touching
from ..drives import acting, own_torque
from ..loads import tension_of_load
from ..motion import call_acceleration, locate_points, opened
from ..records import FROZEN, columns
from ..signals import ABS, HELD_FROM, NUMBER, SAMPLE, SIDE, sample_time
from ..tree.kinematics import outboard
from ..vec import add_scaled, dot, load, scale, set_xyz, store, sub, xyz

_, contacts_at = stored(CONTACTS)

# operands of a measured NUMBER: what is measured, plus the entry (0: its size, 1 to 3: along an
# axis); the first block or pair; how many. `Program` writes the number of the part as the second.
MEASURE = columns("operation", "what", "first", "count", "value")
# the length or its rate of row `first` of the struts or of the cables (`count`), and the target
# (`count` 0) or torque (1) of drive `first`
OF_LENGTH, OF_SPEED, OF_INPUT = 1, 2, 3
OF_STRUTS, OF_CABLES = 0, 1
# a NUMBER at which a force bends: a bound of a drive (0: low, 1: high), or the knot of a strut or
# of a cable
BOUND, BEND = -1, -2
TOUCH = -3  # the least gap of soft and penalty contacts that are open
CONSTRAINT, CONTACT = 4, 8
TENSION = 12  # the tension in row `first` of all loads along paths
LENGTH_RATE = 5  # column in the row of a length
GAP_RANGE = 5  # column in the row of a gap: larger gaps are not sought [m]
KINK_COLUMN = 3  # column of a comparison: the value at which a force has a kink


@sweep
def measures(signals, t, near):
    """Check whether a sample within `near` of t follows from a force."""
    code, _, states = signals
    due = False
    for n in range(states.shape[0]):
        if states[n, SAMPLE] >= 0:
            apart = sample_time(code, states, n)
            due = due or abs(apart * math.floor(t / apart + 0.5) - t) <= near
    if due:
        for i in range(0, code.shape[0], 2):
            if code[i, 0] == NUMBER and code[i, MEASURE.what] >= CONSTRAINT:
                return True
    return False


@sweep
def measure(scene, accelerate, t, q, v, vdot, flow, forces):
    """Write the forces at a state into the program, overwriting `vdot`, `flow` and `forces`."""
    data = opened(scene)
    tau = data.space.vectors[TAU, : v.shape[0]]
    call_acceleration(accelerate, (scene, t, q, v, tau, vdot, flow))
    for i in range(forces.shape[0]):
        for k in range(6):
            forces[i, k] = 0.0
    if data.blocks.active[0] > 0:
        wrenches(data.rows, data.blocks, data.work, data.space, forces)
    code = data.loads.signals[0]
    for i in range(0, code.shape[0], 2):
        what = int(code[i, MEASURE.what])
        if code[i, 0] == NUMBER and what == TENSION:
            row, linear = int(code[i, MEASURE.first]), data.space.linear
            code[i, MEASURE.value] = tension_of_load(data.loads, data.work, linear, q, t, row)
        elif code[i, 0] == NUMBER and what >= CONSTRAINT:
            flow[0] = flow[1] = flow[2] = 0.0  # the force
            for k in range(
                int(code[i, MEASURE.first]), int(code[i, MEASURE.first] + code[i, MEASURE.count])
            ):
                for axis in range(3):
                    if what < CONTACT:
                        flow[axis] += forces[k, 3 + axis]
                    elif data.links.contacts != 0:
                        flow[axis] += contacts_at(data.links.contacts).pairs[k].force[axis]
            entry = what % CONSTRAINT
            size = math.sqrt(flow[0] * flow[0] + flow[1] * flow[1] + flow[2] * flow[2])
            code[i, MEASURE.value] = size if entry == 0 else flow[entry - 1]


@kernel(void(i8, i8, f8, F1, F1, F1, F1, F2), later=True)
def measured(scene, accelerate, t, q, v, vdot, flow, forces):
    """Write the forces at a state into a scene's program."""
    measure(scene, accelerate, t, q, v, vdot, flow, forces)


@sweep
def average(scene):
    """Include the last time step in the mean forces since the last frame."""
    data = opened(scene)
    contacts, blocks_f = contacts_at(data.links.contacts), data.blocks.blocks_f
    tally = contacts.tally[0]
    tally.elapsed += tally.width
    share = tally.width / tally.elapsed
    for k in range(contacts.pairs.shape[0]):
        pair = contacts.pairs[k]
        set_xyz(pair.mean_force, mixed(share, xyz(pair.mean_force), xyz(pair.force)))
        set_xyz(pair.mean_torque, mixed(share, xyz(pair.mean_torque), xyz(pair.torque)))
    for i in range(tally.first_limit - tally.frictions):
        for c in (0, 3):
            pull = scale(1.0 / tally.width, load(blocks_f, i, at.PULL + c))
            store(
                blocks_f,
                i,
                at.MEAN_PULL + c,
                mixed(share, load(blocks_f, i, at.MEAN_PULL + c), pull),
            )


@part
def steps_in_time(scene):
    """Check whether the last step of a scene was one of time stepping."""
    contacts = opened(scene).links.contacts
    return contacts != 0 and contacts_at(contacts).tally[0].frozen == FROZEN


@part
def mixed(share, a, b):
    """Return (1 - share) a + share b, exactly b if share is 1 or a is b."""
    return add_scaled(b, 1.0 - share, sub(a, b))


@sweep
def observe(scene, code, t, q, v):
    """Write lengths of struts, inputs of drives and gaps at a state into a program."""
    data = opened(scene)
    work, drives, located = data.work, data.drives, False
    for i in range(0, code.shape[0], 2):
        what, n = (
            (int(code[i, MEASURE.what]), int(code[i, MEASURE.first]))
            if code[i, 0] == NUMBER
            else (0, 0)
        )
        if what == OF_INPUT and code[i, MEASURE.count] == 0.0:
            one = drives.table[n]
            code[i, MEASURE.value] = acting(one, drives.knots, one.first_target, one.targets, t)
        elif what == OF_INPUT:
            code[i, MEASURE.value] = own_torque(drives.table[n], drives.knots, t)
        elif what == OF_LENGTH or what == OF_SPEED or what == TOUCH:
            if not located:
                outboard(data.rows, data.const, work, q, v)
                locate_points(data, q, v)
                located = True
            if what == TOUCH:
                code[i, MEASURE.value] = gap_ahead(scene, code[i, GAP_RANGE])
                continue
            if code[i, MEASURE.count] == OF_STRUTS:
                struts, _, vias = data.loads.strut
                length, rate = measured_path(struts[n], vias, work, data.space.linear)
            else:
                cables, _, stations = data.loads.cable
                length = length_of_chain(cables[n], stations, work, q)
                rate = rate_of_chain(cables[n], stations, work, data.space.linear)
            code[i, MEASURE.value] = length if what == OF_LENGTH else rate
            code[i, LENGTH_RATE] = rate


@sweep
def gap_ahead(scene, far):
    """Return the least gap of what may touch, or `far` if it is larger, after `positions` [m]."""
    links = opened(scene).links
    far = max(far, TINY)
    if links.contacts == 0:
        return far
    contacts = contacts_at(links.contacts)
    overflows = contacts.tally[0].overflows
    count = touching(scene, far, 0)
    contacts.tally[0].overflows = overflows  # shapes that are far need no room
    return next_touch(contacts, count, far)


@sweep
def width_of_touch(scene, h):
    """Return the way [m] of what has begun to touch in a step of width h, or 0 if nothing has.

    The forces at the end of the step have found it.
    """
    data = opened(scene)
    if data.links.contacts == 0:
        return 0.0
    contacts, way = contacts_at(data.links.contacts), 0.0
    count = contacts.tally[0].found
    if not next_touch(contacts, count, 0.0) < 0.0:
        return 0.0
    for n in range(count):
        u = relative_velocity(contacts, data.work, data.space.linear, n)
        closing = abs(dot(u, xyz(contacts.found[n].normal)))
        way = max(way, 2.0 * (h * closing - contacts.found[n].gap))
    return way


@sweep
def hold_touches(scene, state):
    """Let steps end where shapes touch, or not. Returns whether they did."""
    links = opened(scene).links
    if links.contacts == 0:
        return False
    tally = contacts_at(links.contacts).tally[0]
    held = tally.frozen == HOLDING
    if held:
        tally.frozen = state
    return held


@sweep
def hold(scene, code):
    """Evaluate drives, struts and cables on the held side of their bounds and bends.

    They take min(max(x, least), most), which is `most` for any x, with its derivatives, if the
    least is infinite.
    """
    data = opened(scene)
    table = data.drives.table
    for i in range(0, code.shape[0], 2):
        if code[i, 0] == NUMBER and code[i, MEASURE.what] == BOUND:
            table[int(code[i, MEASURE.first])].low = -math.inf
            table[int(code[i, MEASURE.first])].high = math.inf
    for i in range(0, code.shape[0], 2):
        k = 2 * int(code[i, KINK_COLUMN])
        if code[i, 0] != HELD_FROM + ABS or code[k, 0] != NUMBER or not code[k, MEASURE.what] < 0.0:
            continue
        n, side = int(code[k, MEASURE.first]), code[i + 1, SIDE]
        if code[k, MEASURE.what] == BEND:
            struts = code[k, MEASURE.count] == OF_STRUTS
            knot = data.loads.strut[1][n] if struts else data.loads.cable[1][n]
            knot[2] = math.inf * side if side != 0.0 else 0.0
            knot[3] = 0.0 if side > 0.0 else math.inf
        elif side > 0.0:
            table[n].low = math.inf
            table[n].high = code[k, MEASURE.value]
        elif side == 0.0 and code[k, MEASURE.count] == 0.0:
            table[n].low = code[k, MEASURE.value]
        elif side == 0.0:
            table[n].high = code[k, MEASURE.value]
