"""Back ends: three ways to the same dynamics (checklist C10), for all that a Mechanism answers.

| back end | forward dynamics | M; C and τ | cost |
|---|---|---|---|
| `articulated` | articulated bodies, three sweeps | composite bodies; Newton-Euler | O(n) |
| `composite` | factor of M along the tree | composite bodies; Newton-Euler | O(n depth²) |
| `operators` | eq. (26), dense | eq. (25); eqs. (22)-(24) | O(n³), plain NumPy |
"""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np

from ..engine.tree import dynamics
from ..errors import InputError, Problem, choices
from ..packing.packed import Packed
from ..packing.system import Array
from ..paper import Operators
from .arguments import finite, position

NO_EXTERNAL = np.zeros((0, 6))
BackEnd = Literal["articulated", "composite", "operators"]


def dense(back_end: str) -> bool:
    """Whether a back end is the operators. Raises InputError where there is none of this name."""
    if back_end not in get_args(BackEnd):
        text = f"is {back_end!r:.60}; choose one of {choices(get_args(BackEnd))}"
        raise InputError(Problem("back_end", "", text))
    return back_end == "operators"


def operators(packed: Packed, q: Any, v: Any) -> Operators:
    """The paper's operators at (q, v). Raises InputError."""
    q, v = position(packed, q), finite("v", v, packed.nv)
    return Operators(packed.model, packed.topology, q, v)


def accelerated(
    packed: Packed,
    back_end: str,
    state: tuple[Array, Array, Array],
    external: Array | None,
    work: Array,
    vdot: Array,
) -> int:
    """v' of (q, v, tau) into `vdot` by a back end; a kernel's status code. Raises InputError."""
    wrench = NO_EXTERNAL if external is None else external
    if dense(back_end):
        return _by_operators(packed, *state, wrench, work, vdot)
    tables = packed.system[:4]
    if back_end == "composite":
        n = packed.nv
        space = np.zeros(n), np.zeros_like(work), np.empty(n, np.int64), np.empty((n, n))
        return dynamics.forward_dynamics_composite(*tables, *state, wrench, *space, vdot)
    if external is None:
        return dynamics.forward_dynamics(*packed.tree, *state, work, vdot)
    return dynamics.forward_dynamics_external(*tables, *state, wrench, work, vdot)


def _by_operators(
    packed: Packed, q: Array, v: Array, tau: Array, external: Array, work: Array, vdot: Array
) -> int:
    """v' into `vdot` by eq. (26); a status code as kernels give it."""
    op = operators(packed, q, v)
    tau, wrench = finite("tau", tau, packed.nv), finite("external", external, *external.shape)
    try:
        vdot[:] = op.forward_dynamics(tau, wrench if len(external) else None)
    except np.linalg.LinAlgError:  # M is not positive definite: the sweeps find out at which joint
        return dynamics.forward_dynamics(*packed.tree, q, v, tau, work, vdot)
    return 0 if np.isfinite(vdot).all() else -1
