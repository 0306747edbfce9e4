"""Live runs, computed in short parts at the pace of the clock with the current model."""

from __future__ import annotations

import gc
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.show.shapes import to_matrix

from ..core.events import Event
from ..pose.solving import pull_force
from ..pose.update import Pull
from ..run import Advanced, Joined, Live, Stuck, joined
from . import LASTS, PUSH, SIDES, Offer, State, Walking, offered

PICTURES = 60  # a second
LONGEST_PART = 0.1  # [s] longest part of motion, so that slow models show progress
PATIENCE = 0.2  # [s] behind the clock before it is set back
USUAL_STEP = 1e-3  # [s]
CROWDED, CALM = 0.5, 1 / 15  # below this share of a processor, parts of this length [s]
MOST_WAITING = 3  # parts that the store has not taken yet: then the run waits for it


class LiveRunner:
    """Computes the live run in a thread, following changes of model, speed and pause."""

    def __init__(self, send: Callable[[Event], None]):
        self._send = send
        self._state: State | None = None
        self._running = self._over = 0  # ids of the live runs that were started and joined last

    def render(self, old: State, new: State) -> None:
        self._state = new
        live = new.live
        if live is None:
            return
        if live.over and live.id != self._over:
            self._over = live.id
            _begin(self._join, new)
        elif live.id != self._running and not live.over:
            self._running = live.id
            _begin(self._run, live.id)

    def _wanted(self, id: int) -> tuple[State, Live] | None:
        """Return the current state without stopping this live run."""
        state = self._state
        if state is None or state.going is None or state.going.id != id:
            return None
        return state, state.going

    def _join(self, state: State) -> None:
        assert state.live is not None
        try:
            found = joined(state)
            if found.run is not None:  # views read it first
                _ = found.run.usual_force, found.run.travels
        except Exception as error:  # said on the page: the session goes on
            found = Joined(state.live.id, None, problem=f"The live run is lost: {error!r}")
        self._send(found)

    def _run(self, id: int) -> None:
        with only_young_garbage():
            self._computed(id)

    def _computed(self, id: int) -> None:
        clock, ends, share = Clock(), deque[float](), Share()
        motion: Motion | None = None
        while (wanted := self._wanted(id)) is not None:
            state, live = wanted
            motion = motion or Motion(live.start)
            while ends and live.parts and ends[0] <= live.parts[-1].t[-1]:
                ends.popleft()
            if len(ends) >= MOST_WAITING:
                time.sleep(1 / PICTURES)
                continue
            if not live.running or not state.kernels.ready:
                clock = Clock()
                time.sleep(1 / PICTURES)
                continue
            due = clock.due(motion.time, state.playback.speed)
            if due < max(motion.least(live), share.least):
                time.sleep(0.25 / PICTURES)
                continue
            try:
                with share:
                    part = motion.advanced(
                        state.model, live, min(due, LONGEST_PART), state.pull, state.walking
                    )
            except Exception as error:  # said on the page: the session goes on
                said = str(error) if isinstance(error, pg.PgraphError) else repr(error)
                self._send(Stuck(id, f"The live run stopped: {said}"))
                return
            if len(part.t) > 1:
                ends.append(float(part.t[-1]))
                self._send(Advanced(id, part, clock.pace))
            if (over := motion.over(part)) is not None:
                self._send(Stuck(id, over, motion.fell))
                return


USUAL = gc.get_threshold()
NEVER = 10**9


@contextmanager
def only_young_garbage() -> Iterator[None]:
    """Suspend full garbage collections inside the context.

    A full collection visits every object of the process while holding the GIL. This takes 0.1 s of
    processor time during which the server does not respond, or seconds if the processor is busy.
    """
    gc.set_threshold(*USUAL[:2], NEVER)
    try:
        yield
    finally:
        gc.set_threshold(*USUAL)


def _begin(work: Callable[[Any], None], of: Any) -> None:
    threading.Thread(target=work, args=(of,), name="pgraph-live", daemon=True).start()


class Share:
    """Fraction of a processor available to this thread, averaged over the latest parts.

    On a busy processor, many short segments would block the GIL for other threads, because a
    preempted thread does not release it.
    """

    def __init__(self) -> None:
        self._mean = 1.0
        self._began = (0.0, 0.0)

    def __enter__(self) -> None:
        self._began = time.perf_counter(), time.thread_time()

    def __exit__(self, *_: object) -> None:
        wall, used = time.perf_counter() - self._began[0], time.thread_time() - self._began[1]
        self._mean += 0.1 * (min(used / max(wall, 1e-9), 1.0) - self._mean)

    @property
    def least(self) -> float:
        """The minimum duration of a part [s]."""
        return CALM if self._mean < CROWDED else 0.0


class Clock:
    """A clock that computes how much motion is due."""

    def __init__(self) -> None:
        self._start: tuple[float, float, float] | None = None  # wall, motion, speed
        self.pace = 1.0

    def due(self, reached: float, speed: float) -> float:
        """Return the seconds of motion that are due. The clock waits if the run is far behind."""
        now = time.perf_counter()
        if self._start is None or self._start[2] != speed:
            self._start = now, reached, speed
        wall, motion, _ = self._start
        due = motion + (now - wall) * speed - reached
        late = due > PATIENCE * speed
        if now - wall > 1.0 or late:
            self.pace = min(1.0, (reached - motion) / max((now - wall) * speed, 1e-9))
            self._start = now, reached, speed
        return due


class Motion:
    """The state of a live run, advanced part by part."""

    def __init__(self, start: tuple[float, np.ndarray, np.ndarray] | None = None) -> None:
        self.time = start[0] if start else 0.0
        self._model: pg.Model | None = None
        self._mech: Any = None
        # (q, v), None for the start of the scenario
        self._state: tuple[Any, Any] = start[1:] if start else (None, None)
        self._before: pg.Result | None = None  # the last part
        self._touches = False  # whether there are contacts
        self._walker: Walker | None = None
        self._stepper: pg.Stepper | None = None  # stepper of the next part with given steps
        self._stepped: tuple[Any, ...] = ()  # arguments of the stepper

    def step(self, live: Live) -> float:
        """Return the step size [s], or the frame interval if the method chooses its steps."""
        chosen = live.request.rtol is not None and live.request.step is None
        return 1 / PICTURES if chosen else live.request.step or USUAL_STEP

    def least(self, live: Live) -> float:
        """Return the minimum part [s]: a step, or a frame if each part must detect contacts."""
        return 1 / PICTURES if self._touches else self.step(live)

    def advanced(
        self,
        model: pg.Model,
        live: Live,
        due: float,
        pull: Pull | None = None,
        walking: Walking | None = None,
    ) -> pg.Result:
        """Advance by about `due` seconds in whole steps on `model`, including the mouse's pull."""
        self._follow(model)
        walking = walking or Walking()
        step = self.step(live)
        span = step * max(1, math.floor(due / step + 1e-9))
        if (offer := gait_of(model, live, walking)) is None:
            part = self._simulated(live, step, span, pull)
        else:
            self._walker = self._walker or Walker(walking.pushes)
            now = (self.time, *self._state)
            if (grip := self._grip(pull)) is not None:
                self._walker.pull(grip[1], pull.body if pull else "")
            part = self._walker.advanced(self._mech, offer, live, walking, now, span)
        part = self._before = sewn(self._before, part)
        self._touches = bool(part.contact_force)
        if len(part.t):
            self.time, self._state = float(part.t[-1]), (part.q[-1], part.v[-1])
        return part

    def over(self, part: pg.Result) -> str | None:
        """Return the reason why the run cannot continue, or None if it can."""
        if not part.status.ok:
            return f"The live run stopped: {part.message}."
        fell = self.fell
        if fell is None or self.time - fell < LYING:
            return None
        return f"It fell at t = {fell:.3g} s; the run is kept."

    @property
    def fell(self) -> float | None:
        """The time of the fall [s]."""
        return self._walker.fell if self._walker is not None else None

    def _simulated(self, live: Live, step: float, span: float, pull: Pull | None) -> pg.Result:
        request, tau = live.request, self._torque(pull)
        frames = 1 + max(1, round(span * PICTURES))
        if self._stepper is not None and self._stepped == (self._mech, request):
            return self._stepper.record_over(span, frames, tau=tau)
        known = {s.name for s in self._mech.model.scenarios}
        options = request.options(self._mech.model)
        if request.scenario not in known:
            options["scenario"] = None
        if request.step is not None or request.rtol is None:
            options["step"] = step
        part = pg.simulate(
            self._mech,
            *self._state,
            t_start=self.time,
            t_end=self.time + span,
            frames=frames,
            tau=tau,
            estimate=False,
            **options,
        )
        if part.status.ok:
            self._stepper = self._stepper_after(part, step)
            self._stepped = self._mech, request
        return part

    def _stepper_after(self, part: pg.Result, step: float) -> pg.Stepper | None:
        """Return the stepper for the next parts, or None if the method requires whole runs."""
        header = part.header
        if header["step"] is None:
            return None
        try:
            stepper = pg.Stepper(
                self._mech,
                step=step,
                method=header["method"],
                scenario=header["scenario"],
                q=part.q[-1],
                v=part.v[-1],
                t_start=float(part.t[-1]),
            )
            stepper.because(header["why"])
            return stepper
        except pg.InputError:  # a method that goes from event to event
            return None

    def _torque(self, pull: Pull | None) -> np.ndarray | None:
        """Return the generalised force Jᵀ F (nv,) of the mouse's pull, eq. (24), or None."""
        grip = self._grip(pull)
        return None if grip is None else grip[0].T @ grip[1]

    def _grip(self, pull: Pull | None) -> tuple[np.ndarray, np.ndarray] | None:
        """Return (Jacobian (3, nv), force (3,) [N]) for the mouse's pull, or None."""
        if pull is None or pull.target is None or pull.body not in self._mech.names:
            return None
        mech = self._mech
        q, v = mech.home() if self._state[0] is None else self._state
        position, rotation = mech.pose(q, pull.body)
        J = mech.jacobian(q, pull.body, point=pull.point)[3:]
        mass = sum(body.mass for body in mech.model.bodies)
        at = position + rotation @ np.asarray(pull.point)
        return J, pull_force(at, J @ v, np.asarray(pull.target), mass)

    def _follow(self, model: pg.Model) -> None:
        """Switch to another model. Bodies of the same name keep their positions and velocities."""
        if model is self._model:
            return
        mech = pg.Mechanism(model)
        if self._mech is not None and self._state[0] is not None:
            q, v, _ = mech.state_from(self._mech, *self._state)
            self._state = q, v
        self._model, self._mech = model, mech


def sewn(before: pg.Result | None, part: pg.Result) -> pg.Result:
    """Return a part whose first frame is the last frame of the previous part, including its forces.

    The contact forces and accelerations at its start are taken from the preceding step.
    """
    if before is None or not (len(part.t) and part.contacts.force and before.contacts.force):
        return part
    was, now = before.contacts, part.contacts
    wrench = now.wrench
    if wrench.shape[1:] == was.wrench.shape[1:] and len(wrench) and len(was.wrench):
        wrench = _from(was.wrench, wrench)
    kinds = ("force", "gap", "slip", "limit", "normal", "phases")
    begun = {kind: _begun(getattr(was, kind), getattr(now, kind)) for kind in kinds}
    same = before.vdot.shape[1:] == part.vdot.shape[1:]
    known = {name: str(phase[-1]) for name, phase in was.phases.items() if len(phase)}
    events = []
    for event in now.events:  # a part that begins with new forces may tell its phases again
        if known.get(event.contact) != event.after or event.before == event.after:
            events.append(event)
        known[event.contact] = event.after
    return replace(
        part,
        contacts=replace(now, **begun, wrench=wrench, events=tuple(events)),
        vdot=_from(before.vdot, part.vdot) if same else part.vdot,
    )


def _from(was: np.ndarray, now: np.ndarray) -> np.ndarray:
    return np.concatenate((was[-1:], now[1:]))


def _begun(was: Mapping[str, np.ndarray], now: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: _from(was[name], x) if name in was else x for name, x in now.items()}


# -- walking: one controller for all parts of a run, which follows changes of settings -------------


LYING = 0.8  # [s] duration for which a fall is shown


class Walker:
    """The walk of a live run. Its clock continues across changes of gait, ground and method."""

    def __init__(self, pushes: int) -> None:
        self.fell: float | None = None  # when [s]
        self._walk: Any = None
        self._made_for: tuple[Any, ...] = ()
        self._pushes = pushes  # number of pushes done, earlier ones included
        self._pull: tuple[Any, str] | None = None  # pull of the next part

    def advanced(
        self, mech: pg.Mechanism, offer: Offer, live: Live, walking: Walking, now: Any, span: float
    ) -> pg.Result:
        """Simulate `span` seconds from `now`, given as (t, q, v). q and v are None at the start."""
        t, q, v = now
        walk = self._prepared(mech, offer, live, t, (q, v))
        if offer.gait != walk.gait:
            walk.change(**offer.gait.model_dump())
        if walking.pushes != self._pushes:
            self._pushes = walking.pushes
            force = pushed(mech.model, walk.q, walking.push, walking.strength)
            body = walking.pushed if walking.pushed in mech.names else None
            walk.push(force, LASTS, **({} if body is None else {"body": body}))
        if self._pull is not None:
            force, body = self._pull
            walk.push(force, span, body=body)
            self._pull = None
        part = walk.step(span, frames=1 + max(1, round(span * 60)))
        return self._said_once(part)

    def pull(self, force: np.ndarray, body: str) -> None:
        """Apply a mouse force [N] to a body during the next part."""
        self._pull = tuple(map(float, force)), body

    def _prepared(
        self, mech: pg.Mechanism, offer: Offer, live: Live, t: float, state: tuple[Any, Any]
    ) -> Any:
        made_for = (mech, live.request)
        if made_for != self._made_for:
            old, request = self._walk, live.request
            walk = pg.Walk(
                mech, offer.scenario, gait=offer.gait, q=state[0], v=state[1], step=request.step,
                method=request.method,
            )  # fmt: skip
            walk.t = t
            if old is not None and old.mech.nv == mech.nv:
                walk.controller = old.controller
            self._walk, self._made_for = walk, made_for
        return self._walk

    def _said_once(self, part: pg.Result) -> pg.Result:
        """Report a fall only once, although every part detects it."""
        if not self._walk.fell:
            return part
        if self.fell is None:
            self.fell = float(part.t[0])
            return part
        return replace(part, notices=tuple(x for x in part.notices if "fell" not in x))


def gait_of(model: pg.Model, live: Live, walking: Walking) -> Offer | None:
    """Return the gait of a live run, or None if its scenario has none."""
    scenario = next((s for s in model.scenarios if s.name == live.request.scenario), None)
    if scenario is None or scenario.gait is None:
        return None
    offer = offered(model, walking)
    fits = offer is not None and offer.scenario == scenario.name
    return offer if fits else Offer(scenario.gait, scenario.name, True)


def pushed(
    model: pg.Model, q: np.ndarray, side: str, strength: float = PUSH
) -> tuple[float, float, float]:
    """Return a horizontal push on one side of the trunk, of `strength` times the weight [N]."""
    along, right = SIDES[side]
    R = to_matrix(np.asarray(q[3:7]))
    x, _, z = along * R[:, 0] + right * R[:, 2]
    size = strength * 9.81 * sum(body.mass for body in model.bodies) / float(np.hypot(x, z))
    return size * float(x), 0.0, size * float(z)
