"""Hints of expressions on the page that asks for them."""

from __future__ import annotations

from dataclasses import asdict

from ..core.bridge import Bridge
from ..core.views import Place
from . import Client, State


class SignalsView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge

    def render(self, old: State, new: State) -> None:
        for client, page in new.clients.items():
            before = old.clients.get(client, Client())
            if page.hint is not None and page.hint is not before.hint:
                self._bridge.send(client, "hint", asdict(page.hint))


VIEWS = (Place(lambda desk: SignalsView(desk.bridge), 98),)
