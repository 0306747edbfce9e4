"""Questions about an expression that is typed on a page (pure)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

import pgraph_core as pg
from pgraph_core.paper import bodies_of, q_slices, v_slices

from ..constraints import Part
from ..core.events import FromPage, Text
from ..core.state import with_client
from ..pose.solving import shown_q, shown_v
from . import Moment, State, Vocabulary, clicked


class AskHint(FromPage):
    """An expression was typed into a cell of a part, of a switch, or of any other row ("")."""

    serial: int
    part: Part | Literal["switches", ""]
    name: Text
    cell: Text
    text: Text
    caret: Annotated[int, Field(ge=0)]

    def applied(self, state: State) -> State:
        item = _item(state.model, self.part, self.name)
        varies = item is not None or self.part == "switches"
        words = Vocabulary(state.model, moment(state), item, self.cell, varies)
        found = words.hint(self.serial, self.text, self.caret)
        return with_client(state, self.client, hint=found)


def _item(model: pg.Model, part: str, name: str) -> Any:
    """Return the part that an expression belongs to, also a force of a scenario, or None."""
    parts = [*getattr(model, part)] if part not in ("", "switches") else []
    if part == "forces":
        parts += [f for s in model.scenarios for f in s.forces]
    return next((x for x in parts if x.name == name), None)


def moment(state: State) -> Moment:
    """Return the time and the coordinates of the pose shown."""
    bodies = bodies_of(state.model, pg.Topology.of(state.model))
    q, v = shown_q(state).tolist(), shown_v(state)
    rates = [x for body in bodies for x in body.v] if v is None else v.tolist()
    return Moment(
        state.playback.time if state.run is not None else 0.0,
        {body.name: q[place] for body, place in zip(bodies, q_slices(bodies))},
        {body.name: rates[place] for body, place in zip(bodies, v_slices(bodies))},
    )


class PickSignal(FromPage):
    """A part was clicked while an expression is typed in a cell of another part, or of a switch.

    `rate` asks for the speed of a body.
    """

    serial: int
    part: Part | Literal["bodies"]
    name: Text
    rate: bool
    of: Part | Literal["switches", ""]
    owner: Text
    cell: Text

    def applied(self, state: State) -> State:
        item = _item(state.model, self.of, self.owner)
        clicks = self.part, self.name, self.rate
        found = clicked(state.model, self.serial, *clicks, item, self.cell)
        return with_client(state, self.client, hint=found)
