"""What one page is told alone: its selection, its theme, answers, notices and downloads."""

from __future__ import annotations

from typing import Any

import pgraph_core as pg

from ..core.bridge import Bridge
from ..core.state import Client, Notice, State
from ..core.views import Payload, Place, audience
from ..model.archive import converted

ACCENT = (47, 111, 208)
PEOPLE = ("#d9730d", "#2f9e6b", "#a33fb5", "#c2255c", "#0c8599")


class SessionView:
    """Drawn last: an answer to a cell comes after the value it is about."""

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
            self._tell(client, before or Client(), now, new)
        self._others(old, new)
        for client in audience(old, new, new.renamed != old.renamed):
            self._bridge.send(client, "renamed", new.renamed)  # after what shows the new names

    def _others(self, old: State, new: State) -> None:
        """Where everybody else is, to each page; again only where somebody moved."""
        for client in new.clients:
            told = None if client not in old.clients else others(old, client)
            if told != (now := others(new, client)):
                self._bridge.send(client, "others", now)

    def _tell(self, client: int, before: Client, now: Client, state: State) -> None:
        if now.reply is not None and now.reply is not before.reply:
            reply = {"serial": now.reply.serial, "text": now.reply.text, "offer": now.reply.offer}
            self._bridge.send(client, "reply", reply)
        if now.notice is not None and now.notice is not before.notice:
            self._notify(client, now.notice)
        if now.conversion is not None and now.conversion is not before.conversion:
            self._bridge.send(client, "conversion", now.conversion.to_dict())
        if now.members is not None and now.members is not before.members:
            self._bridge.send(client, "members", vars(now.members))
        handle = self._bridge.server.get_clients().get(client)
        if now.downloads != before.downloads and handle is not None:
            try:
                name, content, report = converted(state.model, now.download)
                handle.send_file_download(name, content, save_immediately=True)
                if report.entries:
                    self._bridge.send(client, "conversion", report.to_dict())
            except pg.PgraphError as error:
                self._notify(client, Notice("Not saved", str(error), bad=True))

    def _notify(self, client: int, notice: Notice) -> None:
        said = {"title": notice.title, "text": notice.text, "bad": notice.bad}
        self._bridge.send(client, "notice", said)

    def _theme(self, client: int, dark: bool) -> None:
        handle = self._bridge.server.get_clients().get(client)
        if handle is not None:
            handle.gui.configure_theme(
                dark_mode=dark, show_logo=False, show_share_button=False, brand_color=ACCENT
            )
        self._bridge.send(client, "theme", {"dark": dark})


def others(state: State, client: int) -> Payload:
    """Colours of the other pages that have a body selected, by body."""
    found: dict[str, list[str]] = {}
    for other, page in state.clients.items():
        if other != client:
            for name in page.selected:
                found.setdefault(name, []).append(PEOPLE[other % len(PEOPLE)])
    return found


# -- palette ---------------------------------------------------------------------------------------


COMMANDS: tuple[tuple[str, str, str], ...] = (  # what the page runs, its name, its keys or use
    ("new", "New model", "how many bodies, or from a built-in one"),
    ("open", "Open a model", "Ctrl+O"),
    ("save", "Save the model", "Ctrl+S"),
    ("download", "Download the model", "as one file"),
    ("undo", "Undo", "Ctrl+Z"),
    ("redo", "Redo", "Ctrl+Shift+Z"),
    ("find", "Find a body", "Ctrl+F"),
    ("add", "Add a body", "Ctrl+Enter"),
    ("simulate", "Simulate", "runs in the background, then plays"),
    ("live", "Live", "plays while it computes"),
    ("play", "Play or pause", "Space"),
    ("view:fit", "Fit view", "F"),
    ("view:front", "View from front", "1"),
    ("view:side", "View from the side", "2"),
    ("view:top", "View from the top", "3"),
    ("view:isometric", "Isometric view", "0"),
    ("view:centre", "Turn the view about the selection", "C"),
    ("measure", "Measure", "distance and angle between two points (M)"),
    ("theme", "Dark or light", "the theme of this page"),
    ("tab:Digraph", "Show the digraph", "the tree of bodies"),
    ("tab:Constraints", "Show constraints", "loops, contacts, forces"),
    ("tab:Operators", "Show operators", "mass matrix, Jacobian"),
    ("tab:Plots", "Show plots", "quantities over time"),
    ("tab:Report", "Show the report", "error against run time"),
    ("tab:Report", "Stability map", "in the report: which methods hold where"),
    ("tab:Properties", "Show properties", "of the selected body"),
    ("tab:Pose", "Show the pose", "sliders of the joints"),
    ("tab:Show", "What is drawn in 3D", "axes, names, forces"),
    ("tab:Gait", "Show the gait", "walk and steer"),
    ("tour", "Take the tour", "five steps"),
    ("keys", "Help and keys", "?"),
)


class PaletteView:
    """Commands, and the built-in models to be opened; the same for every model."""

    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        self._models: set[str] = set()
        for command in COMMANDS:
            self._add(*command)

    def _add(self, run: str, label: str, description: str) -> None:
        command = self._bridge.server.gui.add_command(label, description=description)

        @command.on_trigger
        async def _(event: Any) -> None:
            if event.client is not None:
                self._bridge.send(event.client.client_id, "command", {"run": run})

    def render(self, old: State, new: State) -> None:
        for name in new.gallery.keys() - self._models:
            self._models.add(name)
            self._add(f"model:{name}", f"Open {name}", "a built-in model")


VIEWS = (
    Place(lambda desk: PaletteView(desk.bridge), 99),
    Place(lambda desk: SessionView(desk.bridge), 100),
)
