"""CAD assemblies: the parts of a STEP file, and the joints that are proposed between them."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field

import pgraph_core as pg
from pgraph_core.formats.step import assembled, looked_at
from pgraph_core.formats.step_joints import JointOfStep
from pgraph_core.formats.step_model import StepReport, densities_by_name
from pgraph_core.formats.step_parts import Parts

from .. import model
from ..core import cells, edit
from ..core.events import FromPage, Text
from ..core.state import Notice, told, with_client
from ..model import ErrandDone, Found, sent, shown_model

LABEL = "accept joints"


@dataclass(frozen=True)
class Assembly:
    """The content of a STEP file, of which the user accepts joints."""

    file: str
    parts: Parts
    joints: tuple[pg.Proposal, ...]


@dataclass(frozen=True)
class Client(model.Client):
    assembly: Assembly | None = None  # the last one that it opened

    def afresh(self) -> Self:
        return replace(super().afresh(), assembly=None)


@dataclass(frozen=True)
class State(model.State):
    clients: Mapping[int, Client] = field(default_factory=dict)


# -- open ------------------------------------------------------------------------------------------


class OpenAssembly(FromPage):
    """Read a STEP file in a child process, and show its parts, all of them free."""

    name: Text
    content: Annotated[str, Field(max_length=15_000_000)]

    def applied(self, state: State) -> State:
        work = partial(_found, self.name, self.content)
        then = partial(_opened, self.client, self.name)
        return sent(state, self.client, "open", work, file=self.name, apart=True, then=then)


def _found(name: str, content: str, _: Any) -> Found:
    """Return the parts and joints in the text of a STEP file. Raises PgraphError."""
    with tempfile.TemporaryDirectory() as place:
        file = Path(place) / Path(name).name
        file.write_text(content, encoding="utf-8")
        parts, joints = looked_at(file, None)
    found = Assembly(Path(name).name, parts, tuple(joints))
    opened, report = _model(found, (), {}, ())
    return Found(opened=opened, report=report, value=found)


def _opened(client: int, name: str, state: Any, done: ErrandDone) -> Any:
    found, before = done.found.value, state.model
    state = shown_model(state, client, name, done.found.opened, done.problem)
    if found is None or state.model is before or client not in state.clients:
        return state
    return with_client(state, client, assembly=found)


def _model(
    found: Assembly, joints: tuple[pg.Proposal, ...], densities: Any, fixed: tuple[str, ...]
) -> tuple[pg.Model, StepReport]:
    report = StepReport(found.file, joints=[*found.joints])
    made = assembled(found.parts, [*joints], densities, fixed, report)
    return report.attached_to(made), report


# -- accept ----------------------------------------------------------------------------------------


class AcceptJoints(FromPage):
    """Make the model of the parts with these joints: one edit, which can be undone."""

    joints: Annotated[tuple[tuple[int, JointOfStep], ...], Field(max_length=100_000)]
    densities: Annotated[tuple[tuple[Text, Text], ...], Field(max_length=10_000)] = ()
    fixed: Annotated[tuple[Text, ...], Field(max_length=10_000)] = ()

    def applied(self, state: State) -> State:
        page: Any = state.clients.get(self.client)
        if page is None or page.assembly is None:
            return state
        found = page.assembly
        try:
            density = {part: cells.number(text) for part, text in self.densities if text.strip()}
        except cells.Refusal as refusal:
            text = f"The density {refusal}"
            return told(state, self.client, Notice(f"Not done: {LABEL}", text, bad=True))
        numbered = [(found.joints[k], kind) for k, kind in self.joints if k < len(found.joints)]
        joints = tuple(one if one.kind == kind else one.changed(kind) for one, kind in numbered)
        work = partial(_accepted, found, joints, density, self.fixed)
        return sent(
            state, self.client, LABEL, work, compiled=True, then=partial(_made, self.client)
        )


def _accepted(found: Assembly, joints: Any, density: dict[str, float], fixed: Any, _: Any) -> Found:
    """Return the model with its loops closed. Raises PgraphError."""
    opened, report = _model(found, joints, densities_by_name(density), fixed)
    return Found(opened=opened, report=report)


def _made(client: int, state: State, done: ErrandDone) -> State:
    made: Any = done.found.opened
    if made is None:
        notice = Notice(f"Not done: {LABEL}", done.problem, bad=True)
        return told(state, client, notice)
    state = edit.attempted(state, client, lambda: made, LABEL)
    return with_client(state, client, conversion=done.found.report)
