"""How a run failed: its status, where it was, and what to try."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..constraints.blocked import blocked
from ..constraints.tied import Tied
from ..constraints.tree import Tree
from ..engine import layout as at
from ..result import Status

if TYPE_CHECKING:
    from .recording import Recording
    from .run_plan import RunPlan

STATUS = {
    at.NOT_FINITE: Status.NOT_FINITE,
    at.NOT_CONVERGED: Status.CANNOT_CLOSE,
    at.TOO_SMALL: Status.STEP_TOO_SMALL,
    at.TOO_MANY: Status.TOO_MANY_STEPS,
    at.NOT_SOLVED: Status.NOT_SOLVED,
}


def failure(record: Recording, code: int) -> tuple[Status, str]:
    """(status, message) of a kernel's status code."""
    t, row = record.steps.failure[0], int(record.steps.failure[1])
    status = STATUS[code]
    where = f"at t = {t:.6g} s; body '{record.mech.body_of(row)}' moved fastest"
    advice = blocking(record) if status is Status.CANNOT_CLOSE else ""
    return status, f"{status.value} {where}; {advice or _advice(status, record.plan)}"


def _advice(status: Status, plan: RunPlan) -> str:
    """What to try after a failure."""
    given = plan.tolerance
    match status:
        case Status.CANNOT_CLOSE:
            return "the mechanism may be torn or at a singular position"
        case Status.STEP_TOO_SMALL:
            return "forces may jump there, or the tolerance may be too small: try a larger one"
        case Status.TOO_MANY_STEPS:
            return "give a larger max_steps or rtol, or try radau5 if it is stiff"
    if given is not None and not given.fixed:
        return "the motion itself may grow without bound, or forces may jump there"
    step = given.widest if given else float(np.max(plan.width, initial=0.0))
    return f"try a step below {step:.3g} s, or less stiffness and damping there"


def blocking(record: Recording) -> str:
    """What blocks the last state recorded to second order; "" where nothing does."""
    if record.done == 0:
        return ""
    mech, last = record.mech, record.done - 1
    held = tuple(mech.model.constraints[i] for i in record.acting.tolist())
    t = float(record.steps.times[last])
    q, v = record.out.q[last], record.out.v[last]
    return blocked(Tied(Tree(mech.model, mech.topology), held, q, v, t))
