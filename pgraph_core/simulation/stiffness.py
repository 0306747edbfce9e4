"""How fast a mechanism moves about a state: what an explicit method has to resolve."""

from __future__ import annotations

import numpy as np

from ..engine import motion
from ..engine.compiler.address import address_of
from ..engine.stepping import stiffness
from ..mechanism import Mechanism
from ..mechanism.scene import Scene
from ..system import Array, Drives, Ints, Loads


def fastest_rate(
    mech: Mechanism, forces: tuple[Drives, Loads], active: Ints, q: Array, v: Array
) -> float:
    """Largest rate of the linearised motion, oscillations included, within about 10 % [1/s].

    Contacts are not looked at.
    """
    scene = Scene(mech, *forces, active)
    stages = np.zeros((stiffness.STIFFNESS_ROWS, mech.nq + mech.nv))
    stages[stiffness.STATE, : mech.nq] = q
    stages[stiffness.STATE, mech.nq :] = v
    accelerate = address_of(motion.acceleration)
    size = (mech.nq, mech.nv)
    rate = stiffness.fastest_rate(scene.address, accelerate, size, stages, np.zeros(3))
    return float(rate) if np.isfinite(rate) else 0.0
