"""Messages to individual pages: selection, theme, answers, notices and downloads."""

from __future__ import annotations

import pgraph_core as pg

from ..core.bridge import Bridge
from ..core.state import Notice
from ..core.views import Host, Payload, Place, audience, requests
from ..model.archive import converted
from ..model.update import Download
from . import Client, State

ACCENT = (47, 111, 208)
PEOPLE = ("#d9730d", "#2f9e6b", "#a33fb5", "#c2255c", "#0c8599")


class SessionView:
    """Drawn last, so that the answer to a cell follows the value it refers to."""

    def __init__(self, bridge: Bridge):
        self._bridge = bridge

    def render(self, old: State, new: State) -> None:
        for client, now in new.clients.items():
            before = old.clients.get(client)
            if before is now:
                continue
            if before is None or before.selection != now.selection:
                self._bridge.send(client, "selection", now.selection)
            if before is None or before.selected != now.selected:
                self._bridge.send(client, "selected", now.selected)
            if before is None or before.dark != now.dark:
                self._theme(client, now.dark)
            self._tell(client, before or Client(), now)
        for asked in requests(old, new, Download):
            self._download(asked.client, new.model, asked.suffix)
        self._others(old, new)
        for client in audience(old, new, new.renamed != old.renamed):
            self._bridge.send(client, "renamed", new.renamed)  # after what shows the new names

    def _others(self, old: State, new: State) -> None:
        """Send each page the selections of the other pages if they have changed."""
        for client in new.clients:
            told = None if client not in old.clients else others(old, client)
            if told != (now := others(new, client)):
                self._bridge.send(client, "others", now)

    def _tell(self, client: int, before: Client, now: Client) -> None:
        if now.reply is not None and now.reply is not before.reply:
            reply = {"serial": now.reply.serial, "text": now.reply.text, "offer": now.reply.offer}
            self._bridge.send(client, "reply", reply)
        if now.notice is not None and now.notice is not before.notice:
            self._notify(client, now.notice)
        if now.conversion is not None and now.conversion is not before.conversion:
            self._bridge.send(client, "conversion", now.conversion.to_dict())
        if now.members is not None and now.members is not before.members:
            self._bridge.send(client, "members", vars(now.members))

    def _download(self, client: int, model: pg.Model, suffix: str) -> None:
        handle = self._bridge.server.get_clients().get(client)
        if handle is None:
            return
        try:
            name, content, report = converted(model, suffix)
            handle.send_file_download(name, content, save_immediately=True)
            if report.entries:
                self._bridge.send(client, "conversion", report.to_dict())
        except pg.PgraphError as error:
            self._notify(client, Notice("Not saved", str(error), bad=True))

    def _notify(self, client: int, notice: Notice) -> None:
        self._bridge.send(client, "notice", vars(notice))

    def _theme(self, client: int, dark: bool) -> None:
        handle = self._bridge.server.get_clients().get(client)
        if handle is not None:
            handle.gui.configure_theme(
                dark_mode=dark, show_logo=False, show_share_button=False, brand_color=ACCENT
            )
        self._bridge.send(client, "theme", {"dark": dark})


def others(state: State, client: int) -> Payload:
    """Return the colours of the other pages that have a body selected, by body."""
    found: dict[str, list[str]] = {}
    for other, page in state.clients.items():
        if other != client:
            for name in page.selected:
                found.setdefault(name, []).append(PEOPLE[other % len(PEOPLE)])
    return found


VIEWS = (Place(lambda desk: SessionView(desk.bridge), 100, Host("session", "top")),)
