"""Views: each draws its part of the state, and only what changed."""

from __future__ import annotations

from typing import Any

from pgraph_core.show.shapes import Color

from .state import State


def audience(old: State, new: State, changed: bool) -> list[int]:
    """The pages to send to: all where something changed, else those that have just come."""
    return [client for client in new.clients if changed or client not in old.clients]


def css(color: Color) -> str:
    """A colour as the page writes it."""
    return "#{:02x}{:02x}{:02x}".format(*color)


def plural(n: int, one: str, many: str = "") -> str:
    """'1 body', '2 bodies'."""
    return f"{n} {one if n == 1 else many or one + 's'}"


def count(state: State) -> str:
    """'16 bodies, 21 DoF'."""
    return f"{plural(len(state.derived.names), 'body', 'bodies')}, {state.derived.dof} DoF"


Payload = dict[str, Any]
