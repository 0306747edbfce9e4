"""Messages to individual pages: selection, theme, answers, notices and downloads."""

from __future__ import annotations

import pgraph_core as pg

from ..core.bridge import Bridge
from ..core.state import Notice
from ..core.views import Host, Payload, Place, news, of_page, requests, topic
from ..model import Download
from ..model.archive import converted
from . import State

ACCENT = (47, 111, 208)
PEOPLE = ("#d9730d", "#2f9e6b", "#a33fb5", "#c2255c", "#0c8599")


class SessionView:
    """The theme of each page, the bodies that others have selected, and downloads."""

    def __init__(self, bridge: Bridge):
        self._bridge = bridge

    def render(self, old: State, new: State) -> None:
        for client, now in new.clients.items():
            before = old.clients.get(client)
            if before is None or before.dark != now.dark:
                self._theme(client, now.dark)
            elsewhere = others(new, client)
            if before is None or others(old, client) != elsewhere:
                self._bridge.send(client, "others", elsewhere)
        for asked in requests(old, new, Download):
            self._download(asked.client, new.model, asked.suffix)

    def _download(self, client: int, model: pg.Model, suffix: str) -> None:
        try:
            name, content, report = converted(model, suffix)
            self._bridge.download(client, name, content)
            if report.entries:
                self._bridge.send(client, "conversion", report.to_dict())
        except pg.PgraphError as error:
            self._bridge.send(client, "notice", vars(Notice("Not saved", str(error), bad=True)))

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


VIEWS = (  # drawn last, so that the answer to a cell follows the value it refers to
    Place(of_page("selection"), 100),
    Place(of_page("selected"), 100),
    Place(lambda desk: SessionView(desk.bridge), 100, Host("session", "top")),
    Place(news("reply", vars), 100),
    Place(news("notice", vars), 100),
    Place(news("conversion", pg.Report.to_dict), 100),
    Place(news("members", vars), 100),
    Place(topic("version", lambda state: state.version, "version"), 100),
)
