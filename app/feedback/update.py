"""Design of a state feedback by clicks (pure)."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Literal

import pgraph_core as pg
from pgraph_core.signals import parsed

from ..core.cells import Display, Refusal, quantity, quantity_in
from ..core.edit import edited
from ..core.events import Entries, FromPage, Text, TypedText
from ..core.state import display_of, with_client
from ..model import Found
from ..model.update import ErrandDone, sent
from ..pose.solving import shown_q
from . import Asked, Design, State, computed, drives, unit_of
from .setpoint import Response, answered

AGAIN = "The model was changed meanwhile; these are its gains now. Check them, then add them."


class OpenFeedback(FromPage):
    """Look for a feedback that holds the pose shown."""

    def applied(self, state: State) -> State:
        return _begun(state, self.client, Asked())


class CloseFeedback(FromPage):
    """Look for none any more."""

    def applied(self, state: State) -> State:
        return with_client(state, self.client, design=None)


class EditFeedback(TypedText):
    """Text typed into the cells of one field: numbers of what is allowed, in the order shown."""

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
                    raise Refusal("must be above 0, or empty to leave it out")
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
    """Compute a design in the background. What was found before is shown until then."""
    design = Design(state.model, shown_q(state), asked)
    if before is not None:
        same = before.model is state.model
        design = replace(design, q=before.q if same else design.q, largest=before.largest,
                         found=before.found if same else None)  # fmt: skip
    state = with_client(state, client, design=design)

    def work(_: pg.Model) -> Found:
        return Found(value=computed(design))

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
        how = {**request.options, "t_end": request.t_end}
        state = with_client(state, client, response=asked)

        def work(model: pg.Model) -> Found:
            return Found(value=answered(model, self.name, how))

        def then(now: State, done: ErrandDone) -> State:
            page = now.clients.get(client)
            if page is None or page.response is not asked:
                return now
            failed = replace(asked, problem=done.problem, busy=False)
            return with_client(now, client, response=done.found.value or failed)

        return sent(state, client, "step response", work, compiled=True, then=then)
