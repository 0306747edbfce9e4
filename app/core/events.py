"""Events of the page, each with its own handler.

Each feature declares its events in its `update.py`:

    class Pause(FromPage):
        def applied(self, state: State) -> State: ...

Every event is a frozen dataclass. A `ModelEdit` creates a new model, `TypedText` is the content of
a cell that does not change the model, and a `Request` is a single request to a view. The fields of
a page's events are validated by their annotations (`from_page`).
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from inspect import isabstract
from typing import Annotated, Any, ClassVar, dataclass_transform

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

import pgraph_core as pg
from pgraph_core.errors import PgraphError

from .cells import Refusal
from .edit import as_now, edited
from .rows import refuse_moved
from .state import Notice, S, State, replied, told, with_client

Text = Annotated[str, Field(max_length=20_000)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Bodies = Annotated[tuple[Text, ...], Field(min_length=1, max_length=10_000)]
Chosen = Annotated[tuple[Text, ...], Field(max_length=10_000)]  # (): those selected on the page
Index = Annotated[tuple[Annotated[int, Field(ge=0, le=10**9)], ...], Field(max_length=3)]
Entries = Annotated[tuple[tuple[Index, Text], ...], Field(min_length=1, max_length=12)]


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
class Event(ABC):
    """An event on a page or in the server."""

    # several in a row are drawn once, as the last leaves them, when the pages show what they have
    collapses: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True)(cls)

    @abstractmethod
    def applied(self, state: Any) -> Any:
        """Return the new state (pure)."""


class Tick(Event):
    """Wall-clock time that has passed while something was moving [s]."""

    collapses = True
    dt: float

    def applied(self, state: State) -> State:
        return state.ticked(self.dt)


class FromPage(Event):
    """An event sent by an open page."""

    __pydantic_config__ = ConfigDict(extra="forbid")
    client: int
    seen: int | None = field(default=None, kw_only=True)  # version of the model on the page
    typed: int | None = field(default=None, kw_only=True)  # the same, when typing began


class OfBodies(FromPage):
    """An event for its `bodies`, by default those selected on its page."""


class OfScenario(FromPage):
    """An event for a scenario, given by its number. None selects the current scenario."""

    scenario: int | None = field(default=None, kw_only=True)


class Request(FromPage):
    """A request of its page, which a view answers once (`views.requests`)."""

    def applied(self, state: S) -> S:
        return with_client(state, self.client, asked=self)


class TypedText(FromPage):
    """Text typed into a cell, with a reply to its page.

    A `Refusal` or an error of the core is shown next to the cell.
    """

    serial: int

    def applied(self, state: Any) -> Any:
        try:
            state = self.taken(state)
        except (Refusal, PgraphError) as refusal:
            return replied(state, self.client, self.serial, str(refusal))
        return replied(state, self.client, self.serial)

    @abstractmethod
    def taken(self, state: Any) -> Any:
        """Return the state with the text. Raises Refusal, PgraphError."""


class ModelEdit(FromPage):
    """An edit of the model that can be undone in one step.

    A refusal is shown next to the cell if the event has a `serial`, with a button for the repair
    that `offer` names, otherwise as a notice.
    """

    def applied(self, state: Any) -> Any:
        serial = getattr(self, "serial", None)
        make, offer = lambda: self.edit(state), lambda: self.offer(state)
        after = edited(state, self.client, make, serial, offer)
        return after if after.model is state.model else self.then(state, after)

    @abstractmethod
    def edit(self, state: Any) -> tuple[pg.Model, str]:
        """Return the new model and a description of the change. Raises Refusal, PgraphError."""

    def then(self, before: Any, after: Any) -> Any:
        """Return the state after the edit, including the next display of its page."""
        return after

    def offer(self, state: Any) -> str:
        """Return the label of a repair for a rejected edit, or "" if there is none."""
        return ""


def update(state: S, event: Event) -> S:
    """Return the state after `event` (pure). Invalid and stale events only add notices."""
    event = as_now(state.renames, event)
    try:
        refuse_moved(event, state.moved)
        event = of_selection(state, event)
    except (Refusal, PgraphError) as gone:
        client, serial = getattr(event, "client", 0), getattr(event, "serial", None)
        if serial is None:
            return told(state, client, Notice("Not done", str(gone), bad=True))
        return replied(state, client, serial, str(gone))
    return event.applied(state)


def failed(state: S, event: Event, error: Exception) -> S:
    """Return the state after an event that raised an error by a fault of the program.

    Its page is told at the cell that was typed into, which shows the value of the model again, or
    by a notice. All pages are told about an event of the server.
    """
    cause = " ".join(f"{type(error).__name__}: {error}".split())[:200]
    text = (
        f"a fault of Pgraph prevented this ({type(event).__name__}, {cause}); nothing was changed. "
        "The log has the details: please report them"
    )
    client, serial = getattr(event, "client", None), getattr(event, "serial", None)
    if serial:
        return replied(state, client or 0, serial, text, failed=True)
    notice = Notice("Not done", f"{text[0].upper()}{text[1:]}.", bad=True)
    for page in state.clients if client is None else (client,):
        state = told(state, page, notice)
    return state


class Undrawn(Event):
    """A view of the page, or a worker, has failed on the newest state."""

    view: str
    error: Exception

    def applied(self, state: S) -> S:
        cause = " ".join(f"{type(self.error).__name__}: {self.error}".split())[:200]
        text = (
            f"A fault of Pgraph prevented the view {self.view} ({cause}), so parts of the page may "
            "show earlier values. The log has the details: please report them."
        )
        for page in state.clients:
            state = told(state, page, Notice("Not drawn", text, bad=True))
        return state


def of_selection(state: State, event: Any) -> Any:
    """Apply an event without bodies to those currently selected on its page.

    A page therefore sends text that is typed after a click, before the form of the clicked object
    is displayed.
    """
    if not isinstance(event, OfBodies) or event.bodies:  # type: ignore[attr-defined]
        return event
    page = state.clients.get(event.client)
    if page is None or not page.selected:
        raise Refusal("no body is selected")
    return replace(event, bodies=page.selected)


class Misread(FromPage):
    """A message from a page that is not a valid event."""

    text: str

    def applied(self, state: State) -> State:
        notice = Notice("The page sent an unknown message", self.text, bad=True)
        return told(state, self.client, notice)


class OfServer(FromPage):
    """An event about a page that can only be sent by the server."""


class Leaving(OfServer):
    """A page has gone. Its events that still wait are dropped, `lost` of them edits.

    Nobody waits for what it asked for any more. What was answered has been done before, and a page
    that waits for an answer asks before it closes (`beforeunload` in bridge.js).
    """

    lost: int = 0


def kinds(of: type[Event] = Event) -> Iterator[type[Any]]:
    """Yield the kinds of events that can happen, of all features."""
    for kind in of.__subclasses__():
        if not isabstract(kind):
            yield kind
        yield from kinds(kind)


@cache
def page_events() -> dict[str, TypeAdapter[Any]]:
    """Return the events that pages may send, by name."""
    ours = (Misread, OfServer)
    known = [k for k in kinds(FromPage) if not issubclass(k, ours) and k is not Request]
    return {k.__name__: TypeAdapter(k) for k in known}


def from_page(client: int, text: str) -> FromPage:
    """Convert a message `{"event": name, ...fields}` of a page into an event, or Misread if it is
    invalid."""
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
