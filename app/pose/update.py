"""Moving bodies with sliders and the gizmo. Poses are previewed before the edit is made (pure)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

import pgraph_core as pg
from pgraph_core.dynamics.states import with_initial
from pgraph_core.rotation import matrix, unit

from ..core import cells
from ..core.cells import Refusal
from ..core.edit import attempted
from ..core.events import Finite, FromPage, ModelEdit, Text
from ..core.state import display_of, replied, with_client
from . import Grip, State, solving

Vector = tuple[Finite, Finite, Finite]
NOTCH = math.radians(15)  # dragged rotations snap to multiples of it
NEAR = 0.15  # snapping distance relative to NOTCH
FINE = 4  # decimals that a gizmo gives a model of the size of 1 m


class MoveJoint(FromPage):
    """A joint coordinate was changed to `text`, either by a slider or by typing.

    A typed value has a `serial` for the reply. The serial of a slider is 0.
    """

    serial: int
    body: Text
    index: Annotated[int, Field(ge=0, le=5)]
    text: Text

    def applied(self, state: State) -> State:
        client, serial, problem = self.client, self.serial, ""
        try:
            state.model.body(self.body)
            typed, turns = (
                measured(state, self) if serial else ("angle", 0.0)
            )  # a slider's is in SI
            display = display_of(state, client) if serial else cells.Display()
            value = cells.quantity(self.text, typed, display)
            value += turns if abs(value) <= math.pi else 0.0
            pose = solving.posed(state, self.body, self.index, value)
            state = replace(
                state, posed=pose, playback=replace(state.playback, playing=False, preview=False)
            )
        except Refusal as refusal:
            problem = f"body '{self.body}', q: {refusal}"
        except pg.PgraphError as error:
            problem = str(error)
        state = replace(state, pose_problem="" if serial else problem)
        return replied(state, client, serial, problem) if serial else state


def measured(state: State, event: MoveJoint) -> tuple[cells.Quantity, float]:
    """Return the quantity of a coordinate, and the turns [rad] that its cell does not show.

    Units such as 90 deg and 5 mm can therefore be typed, and an angle stays within its turn.
    """
    all_of = solving.coordinates(state, (event.body,))
    if event.index >= len(all_of):
        return "angle", 0.0
    found = all_of[event.index]
    return "length" if found.unit == "m" else "angle", found.turns


class HomePose(FromPage):
    """Show the model's initial state, or the run, again."""

    def applied(self, state: State) -> State:
        return replace(state, posed=None, pose_problem="")


class UsePose(ModelEdit):
    """Set the displayed pose as the model's initial state."""

    def edit(self, state: State) -> tuple[pg.Model, str]:
        q, v = solving.shown_q(state), solving.shown_v(state)
        return with_initial(state.model, q, v), "initial pose"


class SetGizmo(FromPage):
    """Select the vector of the selected body that this page's gizmo moves or rotates in 3D."""

    what: Literal["", "link", "com", "rotation"]

    def applied(self, state: State) -> State:
        return with_client(state, self.client, gizmo=self.what)


class Gripped(FromPage):
    """The gizmo was dragged to `vector` [m] in the axes of the field, or rotated to a quaternion.

    Its release is one undo step.
    """

    body: Text
    what: Literal["link", "com", "rotation"]
    vector: Vector | tuple[Finite, Finite, Finite, Finite]
    done: bool

    def applied(self, state: State) -> State:
        if self.body not in state.model.row:
            return state
        body, client = state.model.body(self.body), self.client
        turns = self.what == "rotation"
        if len(self.vector) != (4 if turns else 3) or (turns and not any(self.vector)):
            return state
        old = getattr(body, self.what)
        near = snapped if turns else partial(rounded, size=state.derived.size)
        vector = near(old, self.vector)
        if self.done:
            state = with_client(replace(state, posed=None), client, grip=None)
            model, change = state.model, {self.what: vector}
            label = f"{'orientation' if turns else self.what} of {self.body}"
            return attempted(state, client, lambda: model.edit(self.body, **change), label)
        state = with_client(state, client, grip=Grip(self.body, self.what, vector))
        return state if self.what == "com" else _drafted(state, self.body, self.what, vector)


def _drafted(state: State, name: str, what: str, vector: tuple[float, ...]) -> State:
    """Return the state with the pose for another link vector or orientation previewed."""
    try:
        draft = state.model.edit(name, **{what: vector})
    except pg.PgraphError:
        return state
    q = solving.shown_q(state)
    pose = solving.pose_at(replace(state, model=draft), q)
    return replace(state, posed=replace(pose, model=state.model))


def rounded(old: Sequence[float], new: Sequence[float], size: float) -> tuple[float, ...]:
    """Round `new` to the drag resolution for a model of this size. Unmoved numbers are kept."""
    decimals = FINE - math.ceil(math.log10(size))
    least = 0.5 * 10.0**-decimals
    return tuple(a if abs(b - a) < least else round(b, decimals) for a, b in zip(old, new))


def snapped(old: Sequence[float], new: Sequence[float]) -> tuple[float, ...]:
    """Return `new` as a unit quaternion, snapped to multiples of NOTCH away from `old`."""
    q, r = unit(old), unit(new)
    turn = matrix(r) @ matrix(q).T
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine = float(np.linalg.norm(axis)) / 2
    angle = math.atan2(sine, (float(np.trace(turn)) - 1) / 2)
    notch = NOTCH * round(angle / NOTCH)
    if sine < 1e-9 or abs(angle - notch) > NEAR * NOTCH:
        return r
    w, (x, y, z) = math.cos(notch / 2), (math.sin(notch / 2) * axis / (2 * sine)).tolist()
    a, b, c, d = q  # the turn, and then what was there
    found = (w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c,
             w * c - x * d + y * a + z * b, w * d + x * c - y * b + z * a)  # fmt: skip
    return tuple(round(v, 15) + 0.0 for v in found)


class DragBody(FromPage):
    """The mouse drags a body's `point`, in its own axes, towards `target`, in world axes [m].

    The pose closes all loops and respects the limits.
    """

    body: Text
    point: Vector
    target: Vector
    collapses = True

    def applied(self, state: State) -> State:
        if self.body not in state.derived.number:
            return state
        try:
            pose = solving.dragged(state, self.body, self.point, self.target)
        except pg.PgraphError as error:
            return replace(state, pose_problem=str(error))
        playback = replace(state.playback, playing=False, preview=False)
        return replace(state, posed=pose, playback=playback, pose_problem="")


class Pull(FromPage):
    """A mouse force on `point` of a body, in body axes, towards `target` [m]."""

    body: Text
    point: Vector
    target: Vector | None  # None: let go
    collapses = True

    def applied(self, state: State) -> State:
        if self.body not in state.derived.number:
            return state
        return replace(state, pull=self if self.target is not None else None)
