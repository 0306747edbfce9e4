"""Forces of contacts and constraints as signals, measured where samples are taken.

A force follows from all forces at its instant, so no expression that a force follows from reads it.
A sample acts after its instant and reads the force that a frame there would record.
"""

import math

from ..arrays import CONTACTS, TAU
from ..compiler.address import stored
from ..compiler.jit import kernel, sweep
from ..compiler.kinds import F1, F2, f8, i8, void
from ..constraints.constraints import wrenches
from ..motion import call_acceleration, opened
from ..signals import NUMBER, SAMPLE, sample_time

_, contacts_at = stored(CONTACTS)

# operands of a measured NUMBER: what is measured, plus the entry (0: its size, 1 to 3: along an
# axis); the first block or pair; how many. `Program` writes the number of the part as the second.
WHAT, FIRST, COUNT, VALUE = 1, 2, 3, 4
CONSTRAINT, CONTACT = 4, 8


@sweep
def measures(signals, t, near):
    """Return whether a sample within `near` of t follows from a force."""
    code, _, states = signals
    due = False
    for n in range(states.shape[0]):
        if states[n, SAMPLE] >= 0:
            apart = sample_time(code, states, n)
            due = due or abs(apart * math.floor(t / apart + 0.5) - t) <= near
    if due:
        for i in range(0, code.shape[0], 2):
            if code[i, 0] == NUMBER and code[i, WHAT] != 0.0:
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
        what = int(code[i, WHAT])
        if code[i, 0] == NUMBER and what != 0:
            flow[0] = flow[1] = flow[2] = 0.0  # the force
            for k in range(int(code[i, FIRST]), int(code[i, FIRST] + code[i, COUNT])):
                for axis in range(3):
                    if what < CONTACT:
                        flow[axis] += forces[k, 3 + axis]
                    elif data.links.contacts != 0:
                        flow[axis] += contacts_at(data.links.contacts).pairs[k].force[axis]
            entry = what % CONSTRAINT
            size = math.sqrt(flow[0] * flow[0] + flow[1] * flow[1] + flow[2] * flow[2])
            code[i, VALUE] = size if entry == 0 else flow[entry - 1]


@kernel(void(i8, i8, f8, F1, F1, F1, F1, F2), later=True)
def measured(scene, accelerate, t, q, v, vdot, flow, forces):
    """Write the forces at a state into a scene's program."""
    measure(scene, accelerate, t, q, v, vdot, flow, forces)
