"""A run under way: the compiled frames in chunks, and what has been recorded of them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..constraints.assembly import NOTABLE, assembled
from ..constraints.blocked import blocked
from ..constraints.null_rows import redundancy
from ..constraints.singular import Instant, singular_notice
from ..constraints.tied import Tied
from ..constraints.tree import Tree
from ..errors import InputError
from ..kernels import layout as at
from ..kernels import motion
from ..kernels.handle import address_of
from ..mechanism import Mechanism
from ..mechanism.callback import acting
from ..mechanism.scene import Scene
from ..result import Result, Status
from ..result.contact_record import NOTHING, ContactRecord, Event
from ..system import Array
from .phase_log import stepped_over
from .stepping import Plan, onto_corners, stepping
from .switched_scene import closed, hold_here
from .switching import Change

LOOSER = 32.0  # tolerance of the run that the error estimate compares with
COMPARED = 65  # frames at most, where they cost something beside the steps
CHUNK = 0.02  # s of computation between two looks at `progress`
GRAZE = 2.5  # steps: a shorter flight of a contact is none
LOOSE = 1e-6  # of the velocities: a law missed by more is said
Progress = Callable[[float], Any] | None

STATUS = {
    at.NOT_FINITE: Status.NOT_FINITE,
    at.NOT_CONVERGED: Status.CANNOT_CLOSE,
    at.TOO_SMALL: Status.STEP_TOO_SMALL,
    at.TOO_MANY: Status.TOO_MANY_STEPS,
    at.NOT_SOLVED: Status.NOT_SOLVED,
}
COUNTERS = (
    "steps",
    "evaluations",
    "projections",
    "solver_iterations",
    "rejected_steps",
    "jacobians",
    "factorisations",
    "newton_iterations",
)


class Recording:
    """The arrays of a run, filled frame by frame; each has workspaces of its own."""

    def __init__(self, mech: Mechanism, plan: Plan, q: Array, v: Array, tau: Any):
        """Nothing is computed yet. Raises InputError where `tau` does not fit."""
        self.mech, self.plan = mech, plan
        self.steps = stepping(mech, plan, q, v)
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
        self.out = (
            *(np.zeros((n, k)) for k in (mech.nq, mech.nv, mech.nv)),
            np.zeros((n, blocks, 6)),
            *(np.zeros((n, k)) for k in (4, 2)),
            np.zeros((n if plan.contacts else 0, mech.nb, 6)),
            np.zeros((n if plan.contacts else 0, _touches(plan), at.TOUCH)),
        )
        self.status, self.message = Status.DONE, Status.DONE.value
        self.notices: list[str] = []
        self.log: list[Event] = []
        self._flow = np.zeros(3)
        self._changes = [np.zeros((0, 3))]  # of the phases of contacts, as logged by the kernels
        self._unlogged = 0  # changes that there was no room for
        self._first: Instant | None = None  # the state that constraints are met in
        self._redundant = False  # whether rows say nothing new there

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
        code = self.steps.advance(self.scene.address, budget, self.out)
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
        self._log_change(change, self._energy() - before, moved)
        self.steps.restart()
        self._stop_at_next()
        self._first = change.t, self.q.copy(), self.v.copy()
        return self.status.ok

    def _impulse(self, t: float) -> None:
        """What a change does at once to what is in contact: of time stepping the next step."""

    def _energy(self) -> float:
        return float(sum(motion.energy(self.scene.address, self.q, self.v)))

    def _log_change(self, change: Change, gain: float, moved: float) -> None:
        took = f"; its impulse took {-gain:.4g} J" if gain < 0 else ""
        took = f"; its impulse put in {gain:.4g} J" if gain > 0 else took
        for numbers, (old, new) in ((change.off, ("on", "off")), (change.on, ("off", "on"))):
            for i in numbers.tolist():
                c = self.mech.model.constraints[i]
                cause = f"switched {new}{took if new == 'on' else ''}"
                self.log.append(Event(change.t, c.name, c.body, old, new, cause))
        if moved > NOTABLE:
            text = f"joints were moved by up to {moved:.3g} to meet what goes on"
            self.notices.append(f"at t = {change.t:g} s {text}")

    @property
    def start(self) -> float:
        """When the run begins [s]."""
        return float(self.plan.times[0])

    @property
    def done(self) -> int:
        """Number of frames recorded."""
        return int(self.steps.cursor[at.FRAME])

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
        vdot, wrenches = np.empty(mech.nv), np.empty_like(self.out[3][0])
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
        t, row = self.steps.failure[0], int(self.steps.failure[1])
        status = STATUS[code]
        where = f"at t = {t:.6g} s; body '{self.mech.body_of(row)}' moved fastest"
        self._stop(status, f"{status.value} {where}; {self._advice(status)}")

    def _advice(self, status: Status) -> str:
        """What to try after a failure."""
        given = self.plan.tolerance
        match status:
            case Status.CANNOT_CLOSE:
                torn = "the mechanism may be torn or at a singular position"
                return self._blocked() or torn
            case Status.STEP_TOO_SMALL:
                return "forces may jump there, or the tolerance may be too small: try a larger one"
            case Status.TOO_MANY_STEPS:
                return "give a larger max_steps or rtol, or try radau5 if it is stiff"
        if given is not None and not given.fixed:
            return "the motion itself may grow without bound, or forces may jump there"
        step = given.widest if given else float(np.max(self.plan.width, initial=0.0))
        return f"try a step below {step:.3g} s, or less stiffness and damping there"

    def _blocked(self) -> str:
        """What blocks the last state recorded to second order; "" where nothing does."""
        if self.done == 0:
            return ""
        last, plan = self.done - 1, self.plan
        past = plan.changes[: len(plan.changes) - len(self._ahead)]
        active = past[-1].active if past else plan.active
        held = tuple(self.mech.model.constraints[i] for i in active.tolist())
        t = float(self.steps.times[last])
        q, v = self.out[0][last], self.out[1][last]
        tree = Tree(self.mech.model, self.mech.topology)
        return blocked(Tied(tree, held, q, v, t))

    def _contacts(self, t: Array, pushes: Array, touches: Array) -> ContactRecord:
        """What the recorded frames say of contacts and limits."""
        if not self.plan.contacts:
            return replace(NOTHING, events=tuple(self.log))
        up, changes = self.mech.model.ground_normal, np.concatenate(self._changes)
        impulses = self.plan.method.name == "moreau_jean"
        graze = GRAZE * float(np.max(self.plan.width, initial=0.0)) if impulses else 0.0
        found = stepped_over(self.plan.contacts, np.array(up), t, pushes, touches, changes, graze)
        events = sorted((*found.events, *self.log), key=lambda event: event.t)
        return replace(found, events=tuple(events))

    def _note_singular(self) -> None:
        """A sentence on the singular positions that were passed, if there were any."""
        if not self.done or self._first is None:
            return
        last = self.done - 1
        end = float(self.steps.times[last]), self.out[0][last], self.out[1][last]
        if said := singular_notice(self.scene, self._first, end, self._redundant):
            self.notices.append(said)
        self._redundant = False

    def _contact_counters(self) -> dict[str, int]:
        if self.scene.touching is None:
            return {}
        tally = self.scene.touching.tally
        return {"contact_fallbacks": int(tally[at.N_FALLBACK]), "calmed": int(tally[at.N_CALMED])}

    def contact_notices(self) -> list[str]:
        """What a person should know of how contacts were solved."""
        if self.scene.touching is None:
            return []
        tally, worst = self.scene.touching.tally, self.scene.touching.worst
        found: list[str] = []
        if tally[at.N_CALMED]:
            found.append(
                f"in {tally[at.N_CALMED]} steps the bounce with friction would have gained energy: "
                "they were taken without restitution"
            )
        if worst[at.MISSED] > LOOSE:
            found.append(
                "the contact solver stopped at its cap: laws missed by up to "
                f"{worst[at.MISSED]:.1e} of the velocities; try a smaller step"
            )
        if self._unlogged:
            found.append(f"{self._unlogged} changes of contacts' phases were too many to log")
        if tally[at.N_MISSED]:
            found.append(f"in {tally[at.N_MISSED]} steps there were more contact points than room")
        return found

    def _said(self) -> list[str]:
        return self.user.notices() if self.user is not None else []

    def result(
        self, estimate: float, timing: dict[str, float], header: dict[str, Any], shown: Any
    ) -> Result:
        """What has been recorded in the frames that are `shown`, as a Result."""
        self._note_singular()
        rows = self.rows(shown)
        frames = (a[rows] if len(a) else a for a in self.out)
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
            counters=dict(zip(COUNTERS, self.steps.counters.tolist())) | self._contact_counters(),
            timing=timing,
            error_estimate=estimate,
            header=header,
            notices=(
                *self.notices,
                *self.steps.notices(),
                *self.contact_notices(),
                *self._said(),
            ),
        )

    def rows(self, shown: NDArray[np.bool_]) -> Any:
        """The frames that were asked for of those recorded; where a run failed, its last one."""
        some = shown[: self.done].copy()
        some[-1:] |= not self.status.ok
        return slice(0, self.done) if some.all() else np.flatnonzero(some)


def _touches(plan: Plan) -> int:
    return len(plan.contacts.touches) + len(plan.contacts.limits) if plan.contacts else 0


def _stops(answer: Any) -> bool:
    """Whether what `progress` returned ends the run: False or its like, but not None."""
    return answer is not None and not answer


def error_estimate(record: Recording, q: Array, v: Array, progress: Progress) -> float:
    """Largest error of q over the run [rad, m], from a second, coarser one.

    The difference of both, over what it shrinks by between them: twice the step, or LOOSER times
    the tolerance. A sum of the steps' own errors would miss what an unstable motion makes of
    them. nan where torques come from a function, which is not called a second time, and where
    the second run fails. What tables cost that bend inside steps goes by where in a step they do,
    not by its width alone: it is the difference from a run whose steps end there.
    """
    if record.user is not None:
        return float("nan")
    if len(record.plan.kinks) == 0:
        return _by_coarser(record, q, v, progress)
    bent = _again(record, onto_corners(record.plan), q, v, progress)
    if not bent.status.ok:
        return float("nan")
    theirs = bent.out[0][np.searchsorted(bent.plan.times, record.plan.times)]
    return float(np.max(np.abs(record.out[0] - theirs))) + _by_coarser(bent, q, v, progress)


def _by_coarser(record: Recording, q: Array, v: Array, progress: Progress) -> float:
    """Largest error of q, from the same run at wider steps."""
    found = _coarser(record.plan)
    if found is None:
        return float("nan")
    coarser, ratio = found
    coarse = _again(record, coarser, q, v, progress)
    if not coarse.status.ok:
        return float("nan")
    mine = record.out[0][np.searchsorted(record.plan.times, coarser.times)]
    return float(np.max(np.abs(coarse.out[0] - mine), initial=0.0)) / (ratio - 1.0)


def _again(record: Recording, plan: Plan, q: Array, v: Array, progress: Progress) -> Recording:
    """The run of another plan."""
    again = type(record)(record.mech, plan, q, v, record.tau)
    again.run(progress and (lambda _: progress(1.0)))
    return again


def _coarser(plan: Plan) -> tuple[Plan, float] | None:
    """The same run, cheaper, and how many times larger its error is."""
    power = plan.method.order
    cuts = np.searchsorted(plan.times, [*(change.t for change in plan.changes), *plan.kinks])
    few = np.linspace(0, len(plan.times) - 1, COMPARED).astype(int)
    some = plan.times[np.union1d(few, cuts)]
    if plan.tolerance is not None:
        given = plan.tolerance
        if given.fixed:
            twice = given._replace(widest=2 * given.widest)
            return plan._replace(times=some, tolerance=twice), 2.0**power
        loose = given._replace(rtol=LOOSER * given.rtol, atol=LOOSER * given.atol)
        return plan._replace(times=some, tolerance=loose), LOOSER
    if int(np.sum(plan.substeps)) < 2:
        return None
    if int(np.max(plan.substeps)) == 1:  # every second frame, so that kinks of tables stay steps
        keep = np.union1d(np.arange(0, len(plan.times), 2), [*cuts, len(plan.times) - 1])
        times, count = plan.times[keep], np.ones(len(keep) - 1, dtype=np.int64)
    else:
        times, count = plan.times, -(-plan.substeps // 2)
    width = np.diff(times) / count
    ratio = float(np.max(width) / np.max(plan.width))
    return plan._replace(times=times, substeps=count, width=width), ratio**power
