"""A switch of constraints in a scene under way: places held anew, velocities and gaps closed."""

from __future__ import annotations

import numpy as np

from ..constraints.assembly import ASSEMBLY_ROUNDS
from ..constraints.blocks import values_of
from ..engine import motion
from ..engine.constraints.proximal import RHS
from ..engine.contact import sites as site_kernels
from ..errors import InputError, ModelError, Problem
from ..mechanism.scene import Scene
from ..system import Array
from .switching import Change

FAR = 0.1  # rad, m: a jump of the joints that is no correction
SPEED = 1e-9  # of the velocities: a row that is met


def hold_here(scene: Scene, change: Change, q: Array) -> None:
    """What constraints that go on leave out is as it is now: where a point is, an orientation."""
    if not len(change.on):
        return
    mech = scene.mech
    poses = mech.poses(q)
    for i in change.on.tolist():
        c = mech.model.constraints[i]
        try:
            values = values_of(c, mech.model, mech.topology, mech.system, poses)
        except ModelError as error:
            raise InputError(error.problems) from None
        first = int(scene.blocks.first[i])
        scene.blocks.blocks_f[first : first + len(values)] = values


def closed(scene: Scene, change: Change, q: Array, v: Array) -> float:
    """Move q and v onto what is active, in the mass metric; by how much q moved [rad, m].

    Raises InputError where that cannot be done.
    """
    if scene.active[0] == 0:
        return 0.0
    names = " and ".join(f"'{scene.blocks.names[i]}'" for i in change.on.tolist())
    where = f"constraint {names}"
    old = q.copy()
    fastest = float(np.max(np.abs(v), initial=0.0))
    rounds = motion.projection(scene.held, change.t, q, v, ASSEMBLY_ROUNDS)
    moved = float(np.max(np.abs(q - old), initial=0.0))
    if rounds < 0 or not moved <= FAR:
        text = f"is not met where it goes on, at t = {change.t:g} s: a joint would have to jump by "
        text += f"{moved:.3g}; leave out its other_point, or switch it where it is met"
        raise InputError(Problem(where, "", text))
    m = site_kernels.impulse_rows(scene.held, change.t, q, v)
    left = float(np.max(np.abs(scene.space.vectors[RHS, :m]), initial=0.0))
    if left > SPEED * max(fastest, float(np.max(np.abs(v), initial=0.0))):
        text = f"asks for velocities at t = {change.t:g} s that the others forbid: they miss by "
        raise InputError(Problem(where, "", f"{text}{left:.3g}; switch one of them off"))
    return moved
