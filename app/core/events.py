"""Events and their handlers.

Each feature declares its events in its `update.py`, with the handler below the event:

    @dataclass(frozen=True)
    class Pause(FromPage):
        ...

    @on(Pause)
    def paused(state: State, event: Pause) -> State: ...

`on_edit` is for events that make a new model, `on_typed` for text typed into a cell that changes no
model. The fields of a page's events are validated by their annotations (`from_page`).
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

import pgraph_core as pg
from pgraph_core.errors import PgraphError

from .cells import Refusal, placed, touched
from .edit import as_now, edited
from .state import Notice, S, State, replied, told, with_client

Text = Annotated[str, Field(max_length=20_000)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Bodies = Annotated[tuple[Text, ...], Field(min_length=1, max_length=10_000)]
Chosen = Annotated[tuple[Text, ...], Field(max_length=10_000)]  # (): those selected on the page
Index = Annotated[tuple[Annotated[int, Field(ge=0, le=10**9)], ...], Field(max_length=3)]
Entries = Annotated[tuple[tuple[Index, Text], ...], Field(min_length=1, max_length=12)]


class Event:
    """An event on a page or in the server."""

    # several in a row are drawn once, as the last leaves them, when the pages show what they have
    collapses: ClassVar[bool] = False


@dataclass(frozen=True)
class Tick(Event):
    """Wall-clock time that passed while something moves [s]."""

    collapses = True
    dt: float


@dataclass(frozen=True)
class FromPage(Event):
    """An event sent by an open page."""

    __pydantic_config__ = ConfigDict(extra="forbid")
    client: int
    seen: int | None = field(default=None, kw_only=True)  # number of renames the page knew of


class OfBodies(FromPage):
    """An event for its `bodies`, by default those selected on its page."""


@dataclass(frozen=True)
class OfScenario(FromPage):
    """An event for a scenario, given by number, or None for the chosen one."""

    scenario: int | None = field(default=None, kw_only=True)


Handler = TypeVar("Handler", bound=Callable[[Any, Any], State])
Edit = TypeVar("Edit", bound=Callable[[Any, Any], tuple[pg.Model, str]])
Kind = TypeVar("Kind", bound=FromPage)
News = TypeVar("News", bound=Callable[[Any, Any, Any], State])
HANDLERS: dict[type[Event], Callable[[Any, Any], Any]] = {}


def on(*kinds: type[Event]) -> Callable[[Handler], Handler]:
    """Register a function (state, event) -> state as the only handler for these kinds of events."""

    def keep(handler: Handler) -> Handler:
        for kind in kinds:
            assert kind not in HANDLERS, f"{kind.__name__} has two handlers"
            HANDLERS[kind] = handler
        return handler

    return keep


def on_news(of: str, *kinds: type[Event]) -> Callable[[News], News]:
    """Like `on`, but for messages from background work, with a handler (state, event, work) ->
    state.

    The work is the field `of` of the state. Messages of other work, by `event.id`, are ignored.
    """

    def keep(handler: News) -> News:
        def heard(state: State, event: Any) -> State:
            work = getattr(state, of)
            late = work is None or work.id != event.id
            return state if late else handler(state, event, work)

        on(*kinds)(heard)
        return handler

    return keep


def on_page(**fields: str) -> Callable[[type[FromPage]], type[FromPage]]:
    """Make a kind of event set fields of its page, given as {page field: event field}."""

    def keep(kind: type[FromPage]) -> type[FromPage]:
        on(kind)(lambda state, event: with_client(
            state, event.client, **{mine: getattr(event, its) for mine, its in fields.items()}
        ))  # fmt: skip
        return kind

    return keep


def on_request(kind: type[Kind]) -> type[Kind]:
    """Make a kind of event a request of its page, which a view answers once (`views.requests`)."""
    on(kind)(lambda state, event: with_client(state, event.client, asked=event))
    return kind


def on_typed(*kinds: type[FromPage]) -> Callable[[Handler], Handler]:
    """Like `on`, but for text typed into a cell, with a reply to its page.

    A Refusal of the handler, or an error of the core, is shown next to the cell.
    """

    def keep(handler: Handler) -> Handler:
        def answered(state: State, event: Any) -> State:
            try:
                state = handler(state, event)
            except (Refusal, PgraphError) as refusal:
                return replied(state, event.client, event.serial, str(refusal))
            return replied(state, event.client, event.serial)

        on(*kinds)(answered)
        return handler

    return keep


def on_edit(
    *kinds: type[FromPage], offer: Callable[[Any, Any], str] = lambda state, event: ""
) -> Callable[[Edit], Edit]:
    """Like `on`, but for edits. A function (state, event) -> (new model, label) makes one undo
    step.

    A refusal is shown next to the cell if the event has a `serial`, with a button for the repair
    that `offer` names, otherwise as a notice.
    """

    def keep(handler: Edit) -> Edit:
        def done(state: State, event: Any) -> State:
            return edited(
                state, event.client, lambda: handler(state, event),
                getattr(event, "serial", None), lambda: offer(state, event), touched(event),
            )  # fmt: skip

        on(*kinds)(done)
        return handler

    return keep


def update(state: S, event: Event) -> S:
    """Return the state after `event` (pure). Invalid and stale events add notices alone."""
    event = as_now(state.renames, event)
    try:
        event = placed(state.rows, state.model, state.scenario, of_selection(state, event))
    except (Refusal, PgraphError) as gone:
        client, serial = getattr(event, "client", 0), getattr(event, "serial", None)
        if serial is None:
            return told(state, client, Notice("Not done", str(gone), bad=True))
        return replied(state, client, serial, str(gone))
    return HANDLERS[type(event)](state, event)


def of_selection(state: State, event: Any) -> Any:
    """Apply an event without bodies to those currently selected on its page.

    So a page sends what is typed after a click and before the form of what was clicked is there.
    """
    if not isinstance(event, OfBodies) or event.bodies:  # type: ignore[attr-defined]
        return event
    page = state.clients.get(event.client)
    if page is None or not page.selected:
        raise Refusal("no body is selected")
    return replace(event, bodies=page.selected)


@dataclass(frozen=True)
class Misread(FromPage):
    """A message from a page that is not a valid event."""

    text: str


@on(Misread)
def misread(state: State, event: Misread) -> State:
    notice = Notice("The page sent an unknown message", event.text, bad=True)
    return told(state, event.client, notice)


class OfServer(FromPage):
    """An event about a page that only the server may send."""


@cache
def page_events() -> dict[str, TypeAdapter[FromPage]]:
    """Return the events that pages may send, by name."""
    ours = (Misread, OfServer)
    kinds = [k for k in HANDLERS if issubclass(k, FromPage) and not issubclass(k, ours)]
    return {kind.__name__: TypeAdapter(kind) for kind in kinds}


def from_page(client: int, text: str) -> FromPage:
    """Parse a page's message `{"event": name, ...fields}` into an event, or Misread if invalid."""
    try:
        fields = json.loads(text)
        adapter = page_events()[fields.pop("event")]
        fields["client"] = client
        return adapter.validate_json(json.dumps(fields), strict=True)
    except ValidationError as invalid:
        first = invalid.errors(include_url=False, include_input=False)[0]
        return Misread(client, f"{'.'.join(map(str, first['loc']))}: {first['msg']}"[:300])
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as problem:
        return Misread(client, f"{type(problem).__name__}: {problem}"[:300])
