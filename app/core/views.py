"""Views, which draw changes in their part of the state, and their positions on the page.

A feature lists its own in `VIEWS` of its `view.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import Any, Literal, TypeVar

from pgraph_core.show.shapes import hue_of

from .bridge import Bridge
from .cells import Display
from .cells import Payload as Payload
from .events import Event, FromPage
from .state import HOSTED, Client, State
from .store import View


def audience(old: State, new: State, changed: bool) -> list[int]:
    """Return the pages to update: all pages after a change, or else only newly opened ones."""
    return [client for client in new.clients if changed or client not in old.clients]


PLAIN = (bool, int, float, str, frozenset, dict, Display)  # compared by value
NOTHING: Any = object()  # drawn where there is nothing to send
OUTDATED = "outdated"  # topic of a hidden view, of which a page shows nothing until it is drawn
Need = str | Callable[[Any], object]  # a field of the state, or a function of it
OfPage = Callable[[Any, Any], tuple[object, ...]]  # (state, page) -> what depends on the page


def same(a: object, b: object) -> bool:
    """Return True for one object, for equal plain values, and for tuples of such."""
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return a is b or (isinstance(a, PLAIN) and a == b)


class Topic:
    """A view that sends its content under a topic when its dependencies change.

    The dependencies are `needs` and the tuple `page(state, page)`. The content is `draw(state)` for
    all pages or, if `page` is given, `draw(state, page)` for each page. With `seen`, the content is
    only drawn for pages on which this view is visible. The others receive OUTDATED after another
    model was opened, or after names or rows changed, so that no tab that is about to be shown
    offers the previous ones.
    """

    def __init__(
        self, topic: str, draw: Callable[..., Any], needs: Sequence[Need], page: OfPage | None,
        seen: str, desk: Desk,
    ):  # fmt: skip
        self._bridge, self._topic, self._draw = desk.bridge, topic, draw
        self.name = f"topic {topic}"  # its name in the log
        self._needs = [attrgetter(need) if isinstance(need, str) else need for need in needs]
        self._page, self._seen = page, seen

    def render(self, old: State, new: State) -> None:
        changed = not all(same(need(old), need(new)) for need in self._needs)
        due = [client for client in new.clients if self._due(old, new, client, changed)]
        clients = [client for client in due if self._in_sight(new.clients[client])]
        for client in (client for client in due if client not in clients):
            self._bridge.send(client, OUTDATED, [self._seen, self._topic])
        shared = self._draw(new) if clients and self._page is None else NOTHING
        for client in clients:
            drawn = shared if self._page is None else self._draw(new, new.clients[client])
            if drawn is not NOTHING:
                self._bridge.send(client, self._topic, drawn)

    def _due(self, old: State, new: State, client: int, changed: bool) -> bool:
        """Check whether the topic is out of date on a page."""
        page, before = new.clients[client], old.clients.get(client)
        if before is None:
            return True
        moved = changed and new.version != old.version
        if self._seen and (moved or new.framed != old.framed):
            return True
        if not self._in_sight(page):
            return False
        if changed or not self._in_sight(before):
            return True
        return self._page is not None and not same(self._page(old, before), self._page(new, page))

    def _in_sight(self, page: Client) -> bool:
        """Check whether this view is visible on a page."""
        return not self._seen or self._seen in page.sees


def topic(
    name: str, draw: Callable[..., Any], *needs: Need, page: OfPage | None = None, seen: str = ""
) -> partial[Topic]:
    """Return a factory for the view of a topic, for its `Place`."""
    return partial(Topic, name, draw, needs, page, seen)


def of_page(field: str, draw: Callable[[Any], Any] = lambda value: value) -> partial[Topic]:
    """Return a factory for the view of a page field."""
    value = attrgetter(field)
    return topic(field, lambda _, page: draw(value(page)), page=lambda _, page: (value(page),))


def news(field: str, draw: Callable[[Any], Any]) -> partial[Topic]:
    """Return a factory for the view that sends each new value of a page field, except None."""
    return of_page(field, lambda value: NOTHING if value is None else draw(value))


R = TypeVar("R", bound=FromPage)


def requests(old: State, new: State, kind: type[R]) -> list[R]:
    """Return the new requests of this kind, which have not been answered."""
    found = []
    for client, page in new.clients.items():
        before = old.clients.get(client)
        if isinstance(page.asked, kind) and not (before and before.asked is page.asked):
            found.append(page.asked)
    return found


def hue(branch: int) -> str:
    """Return the hue for a branch as a CSS variable, which each theme defines."""
    return f"var(--branch-{hue_of(branch)})"


# -- places ----------------------------------------------------------------------------------------


# parts of the page; "display" is the menu of what is drawn, "drawer" the results below the 3D view
Slot = Literal["top", "left", "view", "display", "drawer", "right", "run", "time", "trust"]


@dataclass(frozen=True)
class Desk:
    """The bridge and the store's `send`, passed to views on construction."""

    bridge: Bridge
    send: Callable[[Event], None]


@dataclass(frozen=True)
class Host:
    """The position of a view on the page: its slot, and the tab within "left" or "drawer".

    Hosts of a slot have the order of their places unless they define an order.
    """

    view: str
    slot: Slot
    tab: str = ""
    order: int | None = None


class Place:
    """A view and its hosts. Views without hosts only draw in the 3D view, if at all.

    Views are made, and drawn after each event, by increasing `order`.
    """

    def __init__(self, make: Callable[[Desk], View], order: int, *hosts: Host):
        self.make, self.order = make, order
        self.hosts = [h if h.order is not None else replace(h, order=order) for h in hosts]
        HOSTED.update(host.view for host in hosts)


def made(places: list[Place], desk: Desk) -> tuple[View, ...]:
    """Create all views, and send the page with their hosts."""
    places = sorted(places, key=lambda place: place.order)
    views = tuple(place.make(desk) for place in places)
    hosts = sorted((host for place in places for host in place.hosts), key=lambda h: h.order or 0)
    desk.bridge.publish([(host.view, host.slot, host.tab) for host in hosts])
    return views
