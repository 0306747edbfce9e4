"""Why a run ended early: its status, with the place and a suggestion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..analysis.singular import blocked, unequal
from ..engine import layout as at
from ..engine.records import SWING
from ..engine.signals import CONTROL, FAILED, LOST, OWNER, V, values
from ..model import Contact, Control, Force
from ..model.expressions import expressions_of
from ..packing import Ints
from ..packing.signals import gated
from ..result import Status
from ..tolerances import EPS, NOTABLE
from .advice import for_failed
from .fastened import parted
from .overpowered import pressed_between
from .running import Running

if TYPE_CHECKING:
    pass

STATUS = {
    at.NOT_FINITE: Status.NOT_FINITE,
    at.NOT_CONVERGED: Status.CANNOT_CLOSE,
    at.TOO_SMALL: Status.STEP_TOO_SMALL,
    at.TOO_MANY: Status.TOO_MANY_STEPS,
    at.NOT_SOLVED: Status.NOT_SOLVED,
}


def failure(record: Running, code: int) -> tuple[Status, str]:
    """Return (status, message) of a kernel's status code, with the place and a suggestion."""
    t, row = record.steps.clock["failed"], int(record.steps.clock["fastest"])
    status = STATUS[code]
    touching, tables = record.scene.touching, record.plan.contacts
    if touching is not None and tables is not None and touching.tally["barred"]:
        when = float(touching.tally["barred_time"])
        why = pressed_between(record.mech, record.active, record.scene, tables)
        return status, f"{status.value} at t = {when:.6g} s: {why}"
    if text := trouble(record, float(t)):
        return status, f"{status.value} at t = {t:.6g} s{text}"
    if text := _parted(record):
        return status, f"{status.value} at t = {t:.6g} s: {text}"
    where = f"at t = {t:.6g} s; {record.mech.packed.moved_fastest(row)}"
    return status, f"{status.value} {where}; {_advice(record, status)}"


def _parted(record: Running) -> str:
    """Return the contact of bodies that a constraint fastens, at the last recorded state, or ""."""
    tables = record.plan.contacts
    if tables is None or record.steps.recorded == 0:
        return ""
    return parted(record.mech, record.active, tables, record.out.q[record.steps.recorded - 1])


def _advice(record: Running, status: Status) -> str:
    given = record.plan.tolerance
    match status:
        case Status.CANNOT_CLOSE:
            torn = "the mechanism may be torn or at a singular position"
            if not len(record.active):
                torn = "contacts and limits at rest are held as constraints, which these steps "
                torn += "cannot follow; try a smaller step, or method 'moreau_jean'"
            heavy = unequal(record.mech, record.active)
            return _contradicted(record) or heavy or _blocking(record) or torn
        case Status.STEP_TOO_SMALL:
            text = "forces may be discontinuous, or the tolerance too small; try a larger one"
            return _steep(record, float(record.steps.clock["failed"])) or text
        case Status.TOO_MANY_STEPS:
            return "give a larger max_steps or rtol, or try radau5 if it is stiff"
    if given is not None:
        return "the motion itself may grow without bound, or forces may jump there"
    return for_failed(record)


def trouble(record: Running, t: float) -> str:
    """Return the fault of a function or expression from time t on, for a message."""
    caller = record.user or record.sampled
    text = caller.trouble(t) if caller is not None else ""
    _, targets, states = record.scene.loads.signals
    owners = targets[targets[:, FAILED] > 0, OWNER], states[states[:, LOST] > 0, CONTROL]
    for part in _parts(record, *owners):  # a control is the cause of what reads it
        value = "friction >= 0" if isinstance(part, Contact) else "finite value"
        text = f"{part.word()} '{part.name}' has no {value} there: {_texts(part)}"
    return f": {text}" if text else ""


def _steep(record: Running, t: float) -> str:
    """Return the expression that changes within the smallest step at t, for an error message."""
    code, targets, states = (array.copy() for array in record.scene.loads.signals)
    seen = np.concatenate((targets[:, 0], states[:, 0]))
    found = []
    for k in (-1.0, 0.0, 1.0):
        values(code, t + k * 16.0 * EPS * abs(t), record.q, record.v)
        found.append(code[2 * seen + 1, 0].copy())
    low, high = np.min(found, axis=0), np.max(found, axis=0)
    sizes = np.maximum(np.abs(low), np.abs(high))
    jumps = ~(high - low <= NOTABLE * sizes)  # even if one is not finite
    owners = targets[jumps[: len(targets)], OWNER], states[jumps[len(targets) :], CONTROL]
    for part in _parts(record, *owners)[-1:]:
        return f"{part.word()} '{part.name}' is discontinuous or unbounded: {_texts(part)}"
    return ""


def readers(record: Running, row: int) -> list[Force | Contact | Control]:
    """Return the parts whose expressions need the instruction in a row."""
    code, targets, states = record.scene.loads.signals
    needs = np.zeros(len(code) // 2, dtype=bool)
    needs[row // 2] = True
    for k in range(row // 2 + 1, len(needs)):
        needs[k] = code[2 * k, 0] > V and needs[code[2 * k, 1:4].astype(int)].any()
    return _parts(
        record, targets[needs[targets[:, 0]], OWNER], states[needs[states[:, 0]], CONTROL]
    )


def _parts(record: Running, owners: Ints, controls: Ints) -> list[Force | Contact | Control]:
    """Return the parts whose expressions have these numbers."""
    known = (*record.plan.varying, *gated(record.plan.acting))
    parts: list[Force | Contact | Control] = [known[i] for i in np.unique(owners).tolist()]
    return parts + [record.mech.model.stateful[i] for i in np.unique(controls).tolist()]


def _contradicted(record: Running) -> str:
    """Return the contacts and limits that constraints drive bodies against, or ""."""
    if record.events is None or record.steps.recorded == 0:
        return ""
    from .overpowered import contradicted

    scene, last = record.events.scene, record.steps.recorded - 1
    closed = np.flatnonzero(scene.phase != SWING).tolist()
    points = [scene.contact_points[s] for s in closed]
    t, q = float(record.steps.times[last]), record.out.q[last]
    return contradicted(record.mech, record.active, points, t, q)


def _blocking(record: Running) -> str:
    """Return why the last recorded state cannot move to second order, or ""."""
    if record.steps.recorded == 0:
        return ""
    last = record.steps.recorded - 1
    t = float(record.steps.times[last])
    q, v = record.out.q[last], record.out.v[last]
    return blocked(record.mech, record.active, t, q, v)


def _texts(part: Force | Contact | Control) -> str:
    return " and ".join(repr(text) for _, _, text in expressions_of(part))


# -- a run in progress -----------------------------------------------------------------------------
