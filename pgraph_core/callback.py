"""Stepping with torques from a Python function: the same methods, outside the compiled loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError, Problem
from .kernels import layout as at
from .kernels import step as kernels
from .system import Array

if TYPE_CHECKING:
    from .recording import Recording


class CallbackStepper:
    """Calls f(t, q, v) -> τ at every stage; slower than a run without it, by the calls."""

    def __init__(self, record: Recording, function: Callable[[float, Array, Array], Any]):
        """A stepper that writes into the arrays of a recording."""
        self.record, self.function = record, function

    def advance(self, budget: int) -> int:
        """At most `budget` steps and frames on; a status code, as the kernel's."""
        record = self.record
        for _ in range(budget):
            i, taken = record.cursor.tolist()
            if i == len(record.times):
                return at.DONE
            if i == 0 or taken == record.plan.substeps[i - 1]:
                if not self._record(i, float(record.times[i])):
                    return self._fail(at.NOT_FINITE, float(record.times[i]))
                record.cursor[at.TAKEN] = 0
                continue
            h = float(record.plan.width[i - 1])
            t = float(record.times[i - 1]) + taken * h
            before = record.q.copy(), record.v.copy()
            code = self._step(t, h)
            if code != at.DONE:
                record.q[:], record.v[:] = before
                if taken > 0:
                    record.times[i] = t
                    self._record(i, t)
                return self._fail(code, t)
            record.cursor[at.TAKEN] = taken + 1
        return at.DONE if record.done == len(record.times) else at.RUNNING

    def _record(self, i: int, t: float) -> bool:
        """Frame i from the present state; whether it is finite."""
        record = self.record
        kernels.record_frame(
            *record.arguments(), t, record.q, record.v, self._torque(t, record.q, record.v),
            record.ledger, i, record.out,
        )  # fmt: skip
        good = bool(np.isfinite(record.out[2][i]).all() and np.isfinite(record.out[4][i]).all())
        record.cursor[at.FRAME] = i + good
        return good

    def _fail(self, code: int, t: float) -> int:
        fastest = int(np.argmax(np.abs(self.record.v)))
        self.record.failure[:] = t, self.record.mech.row_of_velocity(fastest)
        return code

    def _step(self, t: float, h: float) -> int:
        """One step of the method; a status code."""
        record, method = self.record, self.record.plan.method
        record.counters[at.N_STEP] += 1
        if method.order == 1:
            _, vdot = self._rates(t, record.q, record.v, h)
            record.v += h * vdot
            kernels.move(record.mech.system.rows, record.q, record.v, h)
        else:
            q0, v0 = record.q.copy(), record.v.copy()
            rates: list[tuple[Array, Array]] = []
            for a, b, c in zip(method.a, method.b, method.c):
                q = q0 + h * sum((x * qdot for x, (qdot, _) in zip(a, rates)), np.zeros_like(q0))
                v = v0 + h * sum((x * vdot for x, (_, vdot) in zip(a, rates)), np.zeros_like(v0))
                rates.append(self._rates(t + c * h, q, v, h * b))
            record.q[:] = q0 + h * sum(b * qdot for b, (qdot, _) in zip(method.b, rates))
            record.v[:] = v0 + h * sum(b * vdot for b, (_, vdot) in zip(method.b, rates))
        return kernels.settle(
            *record.mech.tree, record.plan.tables, record.work, record.space,
            record.plan.project, record.q, record.v, record.counters,
        )  # fmt: skip

    def _rates(self, t: float, q: Array, v: Array, weight: float) -> tuple[Array, Array]:
        """(q', v') with the function's torques; work and dissipation go into the ledger."""
        record = self.record
        qdot, vdot = np.empty_like(q), np.empty_like(v)
        powers = kernels.evaluate(*record.arguments(), t, q, v, self._torque(t, q, v), qdot, vdot)
        record.ledger += weight * np.array(powers)
        record.counters[at.N_EVAL] += 1
        return qdot, vdot

    def _torque(self, t: float, q: Array, v: Array) -> Array:
        """f(t, q, v) on copies. Raises InputError where it raises or has the wrong shape."""
        try:
            given = self.function(t, q.copy(), v.copy())
        except Exception as error:
            text = f"the function raised {type(error).__name__}: {error} (at t = {t:.6g} s)"
            raise InputError(Problem("simulate", "tau", text)) from error
        return self.record.mech.finite("tau", given, len(v))
