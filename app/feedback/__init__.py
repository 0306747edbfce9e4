"""State feedback by LQR or pole placement: specification, gains and closed loop (pure).

Weights follow Bryson's rule, one over the square of the largest deviation or input that is allowed
[Bryson and Ho, Applied Optimal Control, 1975].
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Self

import numpy as np
from scipy.linalg import expm

import pgraph_core as pg
from pgraph_core.forces import OnJoint
from pgraph_core.model.editing import free_name
from pgraph_core.model.expressions import wanted
from pgraph_core.signals import parsed, written
from pgraph_core.signals.meaning import unit

from .. import model as model_
from .. import pose
from ..constraints.parts import unit_of_signal
from ..core.cells import Display, Refusal, quantity, quantity_in
from ..core.edit import edited
from ..core.events import Entries, FromPage, Text, TypedText
from ..core.state import display_of, with_client
from ..model import ErrandDone, Found, sent
from ..pose.solving import shown_q
from ..signals import known_of

NEAR = {"angle": 0.2, "length": 0.1}  # [rad], [m] deviations that a person means by small
CONSTANTS_OF_TIME, POINTS = 5.0, 120  # span of a response, and its points
Method = Literal["lqr", "poles"]
WORDS = {  # about the arguments of a call
    "inputs": "No input is allowed: add a motor, servo or actuator in Connections, or allow one.",
    "q": "At this pose {}. Pose the bodies where they can stay at rest first.",
    "Q, R": "The allowed values {}.", "poles": "The poles {}.", "states": "The coordinates {}.",
}  # fmt: skip


@dataclass(frozen=True)
class Asked:
    """Request of a page: a method, the permitted values, and the coordinates to feed back."""

    method: Method = "lqr"
    largest: Mapping[str, float | None] = field(default_factory=dict)  # None: left out
    states: tuple[str, ...] | None = None  # coordinates that the others follow
    poles: tuple[complex, ...] | None = None  # [1/s]
    step: str = ""  # state whose setpoint steps in the response


@dataclass(frozen=True)
class Design:
    """The feedback shown on a page, or the reason why there is none. It is being computed if
    `busy`."""

    model: pg.Model
    q: np.ndarray
    asked: Asked = Asked()
    largest: Mapping[str, float] = field(default_factory=dict)  # asked for or usual, by name
    found: pg.Feedback | None = None
    problem: str = ""
    busy: bool = True


@dataclass(frozen=True)
class Client(model_.Client, pose.Client):
    design: Design | None = None
    response: Any = None  # a `Response`

    def afresh(self) -> Self:
        return replace(super().afresh(), design=None, response=None)


@dataclass(frozen=True)
class State(model_.State, pose.State):
    clients: Mapping[int, Client] = field(default_factory=dict)


def drives(model: pg.Model) -> list[str]:
    """Return the motors, servos and actuators that a feedback may drive."""
    return [f.name for f in model.forces if isinstance(f, OnJoint) and not f.has_state]


def computed(design: Design) -> Design:
    """Return the design with its gains. Raises PgraphError."""
    model, asked = design.model, design.asked
    used = [name for name in drives(model) if asked.largest.get(name, 1.0) is not None]
    how: dict[str, Any] = {"inputs": used, "states": asked.states, "q": design.q}
    plain = pg.lqr(model, 1.0, 1.0, **how)
    given = {name: x for name, x in asked.largest.items() if x is not None}
    largest = usual(plain, model) | given
    if asked.method == "poles" and asked.poles is not None:
        found = pg.place_poles(model, np.array(asked.poles), **how)
    else:
        Q = {s: largest[s] ** -2.0 for s in plain.states if asked.largest.get(s, 1.0) is not None}
        found = pg.lqr(model, Q, {u: largest[u] ** -2.0 for u in plain.inputs}, **how)
    return replace(design, largest=largest, found=found, problem="", busy=False)


def in_words(error: pg.InputError) -> str:
    """Return an error message for the page, without the advice for programmers."""
    problem = error.problems[0]
    text = problem.text.partition("; ")[0].partition(", got ")[0]
    return WORDS.get(problem.field, "{}.").format(text)


def usual(plain: pg.Feedback, model: pg.Model) -> dict[str, float]:
    """Return the default largest deviations and inputs.

    Deviations are NEAR, and rates are NEAR times the fastest rate of the plant. The largest input
    produces the corresponding acceleration of the state that it affects most.
    """
    n = len(plain.positions)
    fastest = float(np.abs(np.linalg.eigvals(plain.A)).max()) or 1.0
    near = np.array([NEAR.get(unit_of(model, name), 1.0) for name in plain.positions])
    found = dict.fromkeys(plain.states, 1.0) | dict(zip(plain.states, (*near, *(near * fastest))))
    for k, name in enumerate(plain.inputs):
        moved = np.abs(plain.B[n : 2 * n, k]) > 0
        needed = near[moved] * fastest**2 / np.abs(plain.B[n : 2 * n, k][moved])
        found[name] = float(needed.min()) if len(needed) else 1.0
    return {name: float(f"{x:.2g}") for name, x in found.items()}


def unit_of(model: pg.Model, name: str) -> str:
    """Return the unit of a state or an input. "angle" and "length" follow the page's units."""
    known = known_of(model)
    force = next((f for f in model.forces if f.name == name), None)
    if isinstance(force, OnJoint):
        dim = wanted(force, force.INPUT, known.bodies)
        return "" if dim is None else unit(dim)
    return unit_of_signal(model, name)


def response(design: Design) -> list[tuple[str, list[float], list[float]]]:
    """Return (name, times, values) of positions and inputs after a step of a setpoint.

    Each value is relative to the largest allowed value.
    """
    found = design.found
    if found is None or not found.stable:
        return []
    n = len(found.positions)
    k = found.states.index(design.asked.step) if design.asked.step in found.positions else 0
    target = np.zeros(len(found.states))
    target[k] = design.largest[found.states[k]]
    slowest = float(np.abs(found.poles.real).min())
    t = np.linspace(0.0, CONSTANTS_OF_TIME / slowest, POINTS)
    once = expm((found.A - found.B @ found.K) * t[1])
    x = np.empty((len(t), len(target)))
    x[0] = -target
    for i in range(1, len(t)):
        x[i] = once @ x[i - 1]
    names = (*found.positions, *found.inputs)
    values = np.hstack((x[:, :n] + target[:n], -x @ found.K.T))
    return [
        (name, t.tolist(), (y / design.largest[name]).tolist()) for name, y in zip(names, values.T)
    ]


# -- the response of a controlled motion to a step of a controller's setpoint ----------------------


FRAMES = 200  # points of a curve
SETTLED = 0.02  # part of the step within which the signal stays once it has settled
LAST = 0.2  # part of the time over which a settled signal rests, as in the Plots tab


@dataclass(frozen=True)
class Response:
    """The change of a signal, over the size of a step, and of a controller's value."""

    name: str
    size: float = 0.0  # size of the step
    unit: str = ""  # unit of the size: "angle" and "length" follow the page's units
    curves: tuple[tuple[str, list[float], list[float]], ...] = ()  # name, times [s]
    overshoot: float = 0.0  # largest excess over the setpoint
    settled: float | None = None  # time from which on it stays SETTLED near its end [s], if it does
    left: float = 0.0  # error at the end
    problem: str = ""
    busy: bool = True


def answered(model: pg.Model, name: str, how: dict[str, Any]) -> Response:
    """Return the difference of two runs, in one of which the setpoint steps at the start.

    `how` contains arguments of `simulate`. Raises PgraphError, Refusal.
    """
    control = next((c for c in model.controls if c.name == name), None)
    if not isinstance(control, pg.PID) or not isinstance(control.signal, str):
        raise Refusal("only a PID controller of a signal has a setpoint that can step")
    unit = unit_of_signal(model, control.signal)
    size = NEAR.get(unit, 1.0)
    names = [c.name for c in model.controls]
    probe, jump = free_name("signal", names), free_name("step", names)
    read = pg.PID(name=probe, signal=0.0, setpoint=control.signal, kp=1.0)
    model = model.replace(controls=(*model.controls, read))
    before = _ran(model, how)
    once = pg.Sampled(name=jump, update=size, sample=2.0 * float(before.t[-1]))  # at t = 0 alone
    given = control.setpoint
    old = given.strip().removeprefix("=") if isinstance(given, str) else repr(given)
    model = model.replace(controls=(*model.controls, once))
    setpoint = f"=({old}) + {written('x', jump)}"
    after = _ran(model.edit(name, kind="control", setpoint=setpoint), how)
    t = before.t[before.t <= after.t[-1]]
    y, u = (
        np.interp(t, after.t, after.controls[x]) - np.interp(t, before.t, before.controls[x])
        for x in (probe, name)
    )
    if not u.any():
        raise Refusal("its value does not change with the setpoint: give it a gain, such as kp")
    y /= size
    read_as = control.signal.strip().removeprefix("=").strip()
    curves = tuple((x, t.tolist(), z.tolist()) for x, z in ((read_as, y), (f"x.{name}", u)))
    overshoot, left = max(float(y.max()) - 1.0, 0.0), 1.0 - float(y[-1])
    return Response(name, size, unit, curves, overshoot, _settled(t, y), left, busy=False)


def _settled(t: np.ndarray, y: np.ndarray) -> float | None:
    """Return the time after which a curve stays near its final mean, if it settles."""
    last = y[t >= t[-1] - LAST * (t[-1] - t[0])]
    if np.ptp(last) > SETTLED:
        return None
    outside = np.flatnonzero(np.abs(y - last.mean()) > SETTLED)
    return float(t[outside[-1] + 1]) if len(outside) else 0.0


def _ran(model: pg.Model, how: dict[str, Any]) -> pg.Result:
    """Return a run to its end. Raises Refusal."""
    run = pg.simulate(model, frames=FRAMES, estimate=False, **how)
    if not run.status.ok or len(run.t) < 2:
        raise Refusal(run.message or run.status.value)
    return run


# -- design of a state feedback by clicks (pure) ---------------------------------------------------


AGAIN = "The model has changed, so the gains were updated. Check them before you add them."


class OpenFeedback(FromPage):
    """Compute a feedback that holds the current pose."""

    def applied(self, state: State) -> State:
        return _begun(state, self.client, Asked())


class CloseFeedback(FromPage):
    """Look for none any more."""

    def applied(self, state: State) -> State:
        return with_client(state, self.client, design=None)


class EditFeedback(TypedText):
    """Text typed into the cells of one field: the allowed values, in the order shown."""

    field: Literal["method", "largest", "states", "poles", "step"]
    entries: Entries

    def taken(self, state: State) -> State:
        page = state.clients.get(self.client)
        if page is None or page.design is None:
            raise Refusal("The feedback no longer exists.")
        design = page.design
        for index, text in self.entries:
            asked = _changed(design, self.field, index, text, display_of(state, self.client))
            design = replace(design, asked=asked)
        return _begun(state, self.client, design.asked, design)


def _changed(
    design: Design, what: str, index: tuple[int, ...], text: str, display: Display
) -> Asked:
    asked, k = design.asked, index[0] if index else 0
    match what:
        case "method" if text in ("lqr", "poles"):
            return replace(asked, method=text, poles=_now(design))
        case "step":
            return replace(asked, step=text)
        case "poles":
            return replace(asked, poles=_poles(text))
        case "states" if k < len(known := coordinates(design)):
            return replace(asked, states=(*known[:k], text, *known[k + 1 :]))
        case "largest" if k < len(names := named(design)):
            name, value = names[k], None
            if text.strip():
                value = quantity(text, quantity_in(unit_of(design.model, name)), display)
                if not value > 0:
                    raise Refusal("must be above 0, or empty to ignore it")
            return replace(asked, largest={**asked.largest, name: value})
    raise Refusal("The feedback no longer has this field.")


def named(design: Design) -> list[str]:
    """Return the inputs and states that need a largest value."""
    return [*drives(design.model), *(design.found.states if design.found else ())]


def coordinates(design: Design) -> tuple[str, ...]:
    """Return the labels of the coordinates that are fed back."""
    if design.asked.states is not None:
        return design.asked.states
    found = design.found
    if found is None:
        return ()
    named = (parsed(name).signal for name in found.positions)
    several = {body.name: body.dof > 1 for body in design.model.bodies}
    return tuple(f"{name}[{k}]" if several[name] else name for _, name, k in named)


def _now(design: Design) -> tuple[complex, ...] | None:
    return None if design.found is None else tuple(complex(x) for x in design.found.poles)


def _poles(text: str) -> tuple[complex, ...]:
    """Parse poles such as -2, -3+1i, -3-1i. Raises Refusal."""
    typed = [one for one in re.split(r"[,;\s]+", re.sub(r"\s*([+-])\s+", r"\1", text)) if one]
    try:
        return tuple(complex(one.replace("i", "j")) for one in typed)
    except ValueError:
        raise Refusal("must be numbers such as -2, -3+1i, -3-1i [1/s]") from None


def _begun(state: State, client: int, asked: Asked, before: Design | None = None) -> State:
    """Compute a design in the background. The previous result is shown until the new one is
    available."""
    design = Design(state.model, shown_q(state), asked)
    if before is not None:
        same = before.model is state.model
        design = replace(design, q=before.q if same else design.q, largest=before.largest,
                         found=before.found if same else None)  # fmt: skip
    state = with_client(state, client, design=design)

    def work(_: pg.Model) -> Found:
        try:
            return Found(value=computed(design))
        except pg.InputError as error:
            raise Refusal(in_words(error)) from None

    def then(now: State, done: ErrandDone) -> State:
        page = now.clients.get(client)
        if page is None or page.design is not design:
            return now  # the page has sent another request, or none
        failed = replace(design, problem=done.problem, busy=False)
        return with_client(now, client, design=done.found.value or failed)

    return sent(state, client, "feedback", work, compiled=True, then=then)


class AddFeedback(FromPage):
    """Put the feedback into the drives of the model."""

    def applied(self, state: State) -> State:
        page = state.clients.get(self.client)
        design = page.design if page is not None else None
        if design is None or design.found is None or design.busy or design.problem:
            return state
        found = design.found
        if design.model is not state.model:
            again = _begun(state, self.client, design.asked, design)
            return edited(again, self.client, lambda: _refused(AGAIN))
        label = f"feedback of {', '.join(found.inputs)}"
        state = edited(state, self.client, lambda: (found.model, label))
        return with_client(state, self.client, design=None)


def _refused(text: str) -> tuple[pg.Model, str]:
    raise Refusal(text)


class AskResponse(FromPage):
    """Compute the response to a step of a controller's setpoint, in the chosen run."""

    name: Text

    def applied(self, state: State) -> State:
        client, asked, request = self.client, Response(self.name), state.request
        state = with_client(state, client, response=asked)

        def work(model: pg.Model) -> Found:
            how = {**request.options(model), "t_end": request.t_end}
            return Found(value=answered(model, self.name, how))

        def then(now: State, done: ErrandDone) -> State:
            page = now.clients.get(client)
            if page is None or page.response is not asked:
                return now
            failed = replace(asked, problem=done.problem, busy=False)
            return with_client(now, client, response=done.found.value or failed)

        return sent(state, client, "step response", work, compiled=True, then=then)
