"""Notices about a finished run whose numbers may mislead its reader."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..errors import choices
from ..model.doubts import MOST_ANGLE, in_degrees, several_turns
from ..packing import Array
from ..tolerances import NAMED, VISIBLE
from .running import Running


def remarks(record: Running) -> Iterator[str]:
    """Yield the notices about a run that reached its end."""
    if not (record.out.v.any() or record.out.vdot.any()):
        yield from at_rest(record)
    yield from pulses(record)
    yield from degrees(record)


def at_rest(record: Running) -> Iterator[str]:
    """Yield a notice if gravity acts but moves no joint in any configuration."""
    mech, model = record.mech, record.mech.model
    held = len(record.plan.ever) or record.plan.contacts is not None
    acted = record.tau is not None or len(model.forces) or record.plan.header["forces"]
    if held or acted or not mech.nv or not any(model.gravity):
        return
    rng = np.random.default_rng(0)
    still, q = np.zeros(mech.nv), record.q.copy()
    for joint in mech.joints.values():
        if joint.q.stop - joint.q.start == joint.v.stop - joint.v.start:
            q[joint.q] += rng.uniform(0.5, 2.5, joint.q.stop - joint.q.start)
    if not mech.bias_force(q, still).any():
        why = "gravity does not move any joint, for example if all hinges are about the "
        why += "vertical; check the axes of the joints"
        if not any(b.mass for b in model.bodies):
            why = "no body has mass"
        yield f"nothing moves: {why}"


def degrees(record: Running) -> Iterator[str]:
    """Yield notices for hinges that start as if in degrees, unless the model's own does."""
    mech, q = record.mech, record.began[0]
    if not (np.abs(q) >= MOST_ANGLE).any():
        return
    home = mech.home()[0]
    for name, joint in mech.joints.items():
        k = joint.q.start
        hinge = [m.kind for m in mech.model.body(name).sequence] == ["rotate"]
        if hinge and in_degrees(float(q[k])) and q[k] != home[k]:
            yield f"q of '{name}': {several_turns(float(q[k]))}"


def pulses(record: Running) -> Iterator[str]:
    """Yield a notice if a function's torques change at a frame without affecting the motion.

    A pulse between the evaluations of a step is passed over by any method. Frames are
    evaluated too.
    """
    n, events = record.done, record.plan.contacts is not None or record.plan.changes
    if record.user is None or events or n < 6 or record.steps.counters["steps"] >= n:
        return
    t, v, vdot = record.steps.times[:n, None], record.out.v[:n], record.out.vdot[:n]
    rate = np.diff(v, axis=0) / np.diff(t, axis=0)
    around = 0.5 * (rate[:-3] + rate[3:])  # neighbours of frames 2 to n - 3
    felt = np.maximum(np.abs(rate[1:-2] - around), np.abs(rate[2:-1] - around))
    acts = np.abs(vdot[2:-2] - around)
    missed = (acts > NAMED * np.abs(vdot).max(axis=0)) & (felt < VISIBLE * acts)
    if missed.any():
        when = float(t[2 + np.flatnonzero(missed.any(axis=1))[0], 0])
        yield (
            f"at t = {when:.6g} s the torque function has a pulse shorter than "
            "the steps, which the motion misses; give a step= shorter than the pulse"
        )


def turns_unseen(record: Running, frames: tuple[Array, Array, Array, Array]) -> Iterator[str]:
    """Yield a notice about bodies whose motion reverses between frames."""
    from ..result.dense import TOO_WIDE, unseen

    packed, steps = record.mech.packed, int(record.steps.counters["steps"])
    rows = unseen(packed.system.rows, frames, packed.length)
    if not rows:
        return
    names = list(dict.fromkeys(f"'{packed.body_of(row)}'" for row in rows))
    text = f"{TOO_WIDE} for the motion of {choices(names, 3)}, which reverses between two of "
    text += f"them: curves, ranges and peaks may miss it; give frames={steps + 1}, one per step"
    yield text
