"""A run under way: the compiled frames in chunks, and what has been recorded of them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..constraints.assembly import NOTABLE, assembled
from ..constraints.null_rows import redundancy
from ..constraints.singular import Instant, singular_notice
from ..engine import layout as at
from ..engine import motion
from ..engine.arrays import Frames
from ..engine.compiler.address import address_of
from ..engine.records import by_name
from ..errors import InputError
from ..mechanism import Mechanism
from ..mechanism.callback import acting
from ..mechanism.scene import Scene
from ..result import Result, Status
from ..result.contact_record import ContactRecord, Event
from ..system import Array, Ints
from .contact_words import contact_counters, contact_notices, contacts_of, switched
from .failures import failure
from .run_plan import RunPlan
from .stepping import Stepping, stepping
from .switched_scene import closed, hold_here
from .switching import Change

CHUNK = 0.02  # s of computation between two looks at `progress`
Progress = Callable[[float], Any] | None


class Recording:
    """The arrays of a run, filled frame by frame; each has workspaces of its own."""

    def __init__(self, mech: Mechanism, plan: RunPlan, q: Array, v: Array, tau: Any):
        """Nothing is computed yet. Raises InputError where `tau` does not fit."""
        self.mech, self.plan = mech, plan
        self.steps = self._new_steps(q, v)
        self.q, self.v = self.steps.q, self.steps.v
        self.tau = tau
        self.user = acting(tau, mech.nq, mech.nv)
        self.scene = self._new_scene()
        self._ahead = deque(plan.changes)
        if plan.changes:
            self.scene.switch(plan.active)
            self._stop_at_next()
        if tau is not None and self.user is None:
            self.scene.given[:] = mech.finite("tau", tau, mech.nv)
        n, blocks = len(plan.times), len(self.scene.active) - 1
        self.out = Frames(
            q=np.zeros((n, mech.nq)),
            v=np.zeros((n, mech.nv)),
            vdot=np.zeros((n, mech.nv)),
            wrenches=np.zeros((n, blocks, 6)),
            energies=np.zeros((n, 4)),
            drifts=np.zeros((n, 2)),
            pushes=np.zeros((n if plan.contacts else 0, mech.nb, 6)),
            touches=np.zeros((n if plan.contacts else 0, _touches(plan), at.TOUCH)),
        )
        self.status, self.message = Status.DONE, Status.DONE.value
        self.notices: list[str] = []
        self.log: list[Event] = []
        self._flow = np.zeros(3)
        self._changes = [np.zeros((0, 3))]  # of the phases of contacts, as logged by the kernels
        self._unlogged = 0  # changes that there was no room for
        self._first: Instant | None = None  # the state that constraints are met in
        self._redundant = False  # whether rows say nothing new there

    def _new_steps(self, q: Array, v: Array) -> Stepping:
        return stepping(self.mech, self.plan, q, v)

    def _new_scene(self) -> Scene:
        plan, own = self.plan, self.mech.blocks
        if plan.changes:  # which may hold places that are known only then
            own = own._replace(blocks_f=own.blocks_f.copy())
        return Scene(
            self.mech,
            plan.drives,
            plan.loads,
            plan.ever,
            contacts=plan.contacts,
            gains=plan.gains,
            user=self.user,
            blocks=own,
        )

    def _advance(self, budget: int) -> int:
        """At most `budget` steps and frames on; the kernel's status code."""
        code = self.steps.advance(self.scene.address, budget, tuple(self.out))
        self._take_changes()
        return code

    def _take_changes(self) -> None:
        """Keep the changes of phases that the kernels have logged, and make room for others."""
        if self.scene.touching is not None:
            tally, changes = self.scene.touching.tally, self.scene.touching.changes
            count = int(tally[at.N_LOGGED])
            self._changes.append(changes[:count].copy())
            self._unlogged += max(count - len(changes), 0)
            tally[at.N_LOGGED] = 0

    def run(self, progress: Progress = None) -> None:
        """All frames, or as many as there are before it fails or is cancelled."""
        if not self._begin():
            return
        budget = 1
        while True:
            began = time.perf_counter()
            code = self._advance(budget)
            if code == at.DONE:
                if not self._ahead or not self._switch(self._ahead.popleft()):
                    return
                continue
            if code != at.RUNNING:
                if self.user is not None and self.user.error is not None:
                    raise self.user.error
                self._fail(code)
                return
            faster = CHUNK / (time.perf_counter() - began)
            budget = max(1, int(budget * min(4.0, faster)))
            if progress is not None and _stops(progress(self.steps.fraction())):
                t = self.steps.times[self.done - 1]
                self._stop(Status.CANCELLED, f"{Status.CANCELLED.value}; kept up to t = {t:.6g} s")
                return

    # -- constraints that go on and off ----------------------------------------------------------

    def _stop_at_next(self) -> None:
        """Go on to the next change, or to the end."""
        times = self.plan.times
        to = times[-1] if not self._ahead else self._ahead[0].t
        self.steps.stop = int(np.searchsorted(times, to)) + 1

    def _switch(self, change: Change) -> bool:
        """Make a change effective, between two steps; whether the run goes on."""
        self._note_singular()
        before = self._energy()
        try:
            hold_here(self.scene, change, self.q)
            self.scene.switch(change.active)
            self._impulse(change.t)
            middle = self._energy()
            moved = closed(self.scene, change, self.q, self.v)
        except InputError as refused:
            self._stop(Status.CANNOT_CLOSE, f"{Status.CANNOT_CLOSE.value}: {refused}")
            return False
        gain = self._energy() - middle
        self.steps.ledger[at.WORK_DONE if gain > 0 else at.DISSIPATED] += abs(gain)
        self.log += switched(self.mech, change, self._energy() - before)
        if moved > NOTABLE:
            text = f"joints were moved by up to {moved:.3g} to meet what goes on"
            self.notices.append(f"at t = {change.t:g} s {text}")
        self.steps.restart()
        self._stop_at_next()
        self._first = change.t, self.q.copy(), self.v.copy()
        return self.status.ok

    def _impulse(self, t: float) -> None:
        """What a change does at once to what is in contact: of time stepping the next step."""

    def _energy(self) -> float:
        return float(sum(motion.energy(self.scene.address, self.q, self.v)))

    @property
    def start(self) -> float:
        """When the run begins [s]."""
        return float(self.plan.times[0])

    @property
    def acting(self) -> Ints:
        """Indices of the constraints that are active by now."""
        past = self.plan.changes[: len(self.plan.changes) - len(self._ahead)]
        return past[-1].active if past else self.plan.active

    @property
    def done(self) -> int:
        """Number of frames recorded."""
        return int(self.steps.cursor["frame"])

    def _begin(self) -> bool:
        """Whether the run can start: no joint without inertia, constraints that can be met."""
        mech, plan = self.mech, self.plan
        if len(plan.active) and plan.project:
            try:
                self.q[:], self.v[:], report = assembled(
                    mech, self.q, self.v, plan.active, self.scene, self.start
                )
            except InputError as refused:
                self._stop(Status.CANNOT_CLOSE, f"{Status.CANNOT_CLOSE.value}: {refused}")
                return False
            if report.notable:
                self.notices.append(f"at the start {report}")
        vdot, wrenches = np.empty(mech.nv), np.empty_like(self.out.wrenches[0])
        accelerate = address_of(motion.acceleration)
        code = motion.constrained_dynamics(
            self.scene.address,
            accelerate,
            self.start,
            self.q,
            self.v,
            self.scene.given,
            self._flow,
            vdot,
            wrenches,
        )
        if self.user is not None and self.user.error is not None:
            raise self.user.error
        if code > 0:
            self._stop(Status.SINGULAR, str(mech.singular(code)))
        elif code < 0:
            self._stop(Status.NOT_FINITE, f"{Status.NOT_FINITE.value} at t = {self.start:g} s")
        elif len(plan.active):
            self._first = self.start, self.q.copy(), self.v.copy()
            if said := redundancy(self.scene):
                self._redundant = True
                self.notices.append(said)
        return self.status.ok

    def _stop(self, status: Status, message: str) -> None:
        self.status, self.message = status, message

    def _fail(self, code: int) -> None:
        self._stop(*failure(self, code))

    def _contacts(self, t: Array, pushes: Array, touches: Array) -> ContactRecord:
        """What the recorded frames say of contacts and limits."""
        changes = np.concatenate(self._changes)
        return contacts_of(self.mech, self.plan, (t, pushes, touches), changes, self.log)

    def _note_singular(self) -> None:
        """A sentence on the singular positions that were passed, if there were any."""
        if not self.done or self._first is None:
            return
        last = self.done - 1
        end = float(self.steps.times[last]), self.out.q[last], self.out.v[last]
        if said := singular_notice(self.scene, self._first, end, self._redundant):
            self.notices.append(said)
        self._redundant = False

    def _said(self) -> list[str]:
        return self.user.notices() if self.user is not None else []

    def result(
        self, estimate: float, timing: dict[str, float], header: dict[str, Any], shown: Any
    ) -> Result:
        """What has been recorded in the frames that are `shown`, as a Result."""
        self._note_singular()
        rows = self.rows(shown)
        frames = Frames(*(a[rows] if len(a) else a for a in self.out))
        q, v, vdot, wrenches, energy, drift, pushes, touches = frames
        return Result(
            mechanism=self.mech,
            status=self.status,
            message=self.message,
            t=self.steps.times[rows],
            q=q,
            v=v,
            vdot=vdot,
            kinetic_energy=energy[:, 0],
            potential_energy=energy[:, 1],
            work=energy[:, 2],
            dissipation=energy[:, 3],
            constraint_drift=drift,
            constraint_force=self.scene.forces(wrenches.swapaxes(0, 1).copy(), self.plan.ever),
            contacts=self._contacts(self.steps.times[: self.done][rows], pushes, touches),
            counters=by_name(self.steps.counters) | contact_counters(self.scene),
            timing=timing,
            error_estimate=estimate,
            header=header,
            notices=(
                *self.notices,
                *self.steps.notices(),
                *contact_notices(self.scene, self._unlogged),
                *self._said(),
            ),
        )

    def rows(self, shown: NDArray[np.bool_]) -> Any:
        """The frames that were asked for of those recorded; where a run failed, its last one."""
        some = shown[: self.done].copy()
        some[-1:] |= not self.status.ok
        return slice(0, self.done) if some.all() else np.flatnonzero(some)


def _touches(plan: RunPlan) -> int:
    return len(plan.contacts.touches) + len(plan.contacts.limits) if plan.contacts else 0


def _stops(answer: Any) -> bool:
    """Whether what `progress` returned ends the run: False or its like, but not None."""
    return answer is not None and not answer
