"""A notice about followers that a cam would have to pull."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..cams import rounded_up
from ..dynamics.scene import forces_of
from ..dynamics.states import bodies_over
from ..engine.motion import MEANS
from ..result.cams import cam_record
from ..tolerances import NOTABLE
from .running import Running


def lifted(record: Running) -> Iterator[str]:
    """Yield a notice about the first follower that would leave its cam, in the frames."""
    mech, n = record.mech, record.steps.recorded
    nq, nv = mech.nq, mech.nv
    q, v, vdot = record.out.q[:n, :nq], record.out.v[:n, :nv], record.out.vdot[:n, :nv]
    none = np.zeros((n, mech.nb, 6))
    pose = bodies_over(mech.packed.system, q.copy(), v.copy(), vdot.copy(), none).pose
    forces = forces_of(record.scene.blocks, record.plan.ever, record.out.wrenches[:n, :, -MEANS:])
    first, text = n, ""
    for c in mech.model.cams:
        if c.name not in forces:
            continue
        push = np.nan_to_num(cam_record(c, mech, q, pose, forces[c.name]).push)
        lifts = push < -NOTABLE * np.abs(push).max(initial=0.0)
        i = int(np.argmax(lifts)) if lifts.any() else n
        if i < first:
            unit = ("N m", "N")[mech.model.body(c.body).sequence[0].facts.travels]
            first = i
            text = (
                f"the follower '{c.body}' would leave its cam '{c.name}' at "
                f"t = {record.steps.times[i]:.6g} s, where the cam would have to pull; press it on "
                f"with {rounded_up(-push.min()):.4g} {unit} or more in its joint, as by a spring"
            )
    if text:
        yield text
