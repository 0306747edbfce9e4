"""A notice about joints that creep although dry friction should hold them."""

from __future__ import annotations

import numpy as np

from ..engine import layout as at
from ..engine.records import CREEP
from ..mechanism import Mechanism
from ..packing import Array, Drives, row_of_velocity
from ..packing.forces import acting_on
from ..tolerances import NOTABLE, VISIBLE


def crept(mech: Mechanism, drives: Drives, t: Array, v: Array) -> list[str]:
    """Return a notice about the joint that moves farthest at a steady speed that friction should
    stop.

    `t` (n,) and `v` (n, nv) are the frames. Time stepping gives drives without friction.
    """
    worst, text = NOTABLE, ""
    slow = CREEP / np.sqrt(2.0 * VISIBLE)  # below it, friction is visibly less than Coulomb's
    system = mech.packed.system
    for one in drives.table[drives.table["friction"] > 0.0]:
        own, factors = acting_on(drives, one)
        row = row_of_velocity(system.rows, int(own[0]))
        slides = system.rows[row, at.KIND] == at.TRANSLATE
        speed = v[:, own] @ factors
        mean = 0.5 * (speed[:-1] + speed[1:])
        steady = (np.abs(mean) <= slow) & (np.abs(np.diff(speed)) <= np.abs(mean))
        way = float(np.abs(steady * mean * np.diff(t)).sum())
        size = way / mech.packed.length if slides and mech.packed.length else way
        if size > worst:
            body, unit = mech.topology.names[system.body_of_row[row] - 1], "m" if slides else "rad"
            worst = size
            text = (
                f"the joint of '{body}' creeps by {way:.3g} {unit}, although its friction should "
                f"hold it, because this method regularises friction below {CREEP:g} {unit}/s; "
                "use method 'moreau_jean' for sticking"
            )
    return [text] if text else []
