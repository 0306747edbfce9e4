"""Back ends: three ways to the same dynamics (checklist C10), for all that a Mechanism answers.

| back end | forward dynamics | M; C and τ | cost |
|---|---|---|---|
| `articulated` | articulated bodies, three sweeps | composite bodies; Newton-Euler | O(n) |
| `composite` | factor of M along the tree | composite bodies; Newton-Euler | O(n depth²) |
| `operators` | eq. (26), dense | eq. (25); eqs. (22)-(24) | O(n³), plain NumPy |
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from ..engine import layout as at
from ..engine.tree import dynamics
from ..errors import InputError, Problem, choices
from ..system import Array

if TYPE_CHECKING:
    from .mechanism import Mechanism

NO_EXTERNAL = np.zeros((0, 6))
BackEnd = Literal["articulated", "composite", "operators"]


def dense(back_end: str) -> bool:
    """Whether a back end is the operators. Raises InputError where there is none of this name."""
    if back_end not in get_args(BackEnd):
        text = f"is {back_end!r:.60}; choose one of {choices(get_args(BackEnd))}"
        raise InputError(Problem("back_end", "", text))
    return back_end == "operators"


def accelerated(
    mech: Mechanism,
    back_end: str,
    state: tuple[Array, Array, Array],
    external: Array | None,
    vdot: Array,
) -> int:
    """v' of (q, v, tau) into `vdot` by a back end; a kernel's status code. Raises InputError."""
    wrench = NO_EXTERNAL if external is None else external
    if dense(back_end):
        return by_operators(mech, *state, wrench, vdot)
    if back_end == "composite":
        return by_composite(mech, *state, wrench, vdot)
    if external is None:
        return dynamics.forward_dynamics(*mech.tree, *state, mech.work, vdot)
    return dynamics.forward_dynamics_external(*mech.system[:4], *state, wrench, mech.work, vdot)


def by_composite(
    mech: Mechanism, q: Array, v: Array, tau: Array, external: Array, vdot: Array
) -> int:
    """v' into `vdot` by composite bodies; a kernel's status code."""
    n, rows = mech.nv, len(mech.system.rows)
    space = np.zeros(n), np.zeros((rows, at.WORK)), np.empty(n, np.int64), np.empty((n, n))
    return dynamics.forward_dynamics_composite(*mech.system[:4], q, v, tau, external, *space, vdot)


def by_operators(
    mech: Mechanism, q: Array, v: Array, tau: Array, external: Array, vdot: Array
) -> int:
    """v' into `vdot` by eq. (26); a status code as kernels give it."""
    from ..paper import Operators  # SciPy takes a while to import

    op = Operators(mech.model, mech.topology, mech.position(q), mech.finite("v", v, mech.nv))
    loads = mech.finite("tau", tau, mech.nv), mech.finite("external", external, *external.shape)
    wrench = loads[1] if len(external) else None
    try:
        vdot[:] = op.forward_dynamics(loads[0], wrench)
    except np.linalg.LinAlgError:  # M is not positive definite: the sweeps find out at which joint
        work = np.zeros((len(mech.system.rows), at.WORK))
        return dynamics.forward_dynamics(*mech.tree, q, v, tau, work, vdot)
    return 0 if np.isfinite(vdot).all() else -1
