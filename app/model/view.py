"""The model toolbar: new, open, save, undo."""

from __future__ import annotations

import pgraph_core as pg
import pgraph_models
from pgraph_core.formats import READERS, SAVED
from pgraph_core.model.links import SAFE, fragment_of
from pgraph_core.show.notebook import pictures

from ..core.bridge import Bridge
from ..core.edit import STAND_IN
from ..core.state import Notice
from ..core.views import Host, Payload, Place, audience, requests
from . import Kept, ShareLink, ShowGallery, State, reading


class ToolbarView:
    def __init__(self, bridge: Bridge):
        self._bridge = bridge

    def render(self, old: State, new: State) -> None:
        changed = any(
            getattr(old, part) is not getattr(new, part)
            for part in (
                "derived",
                "undo",
                "redo",
                "gallery",
                "kept",
                "errands",
                "saved",
                "mobility",
            )
        )
        for client in audience(old, new, changed):
            self._bridge.send(client, "toolbar", toolbar(new, client))


def toolbar(state: State, client: int) -> Payload:
    """Return the contents of the toolbar for one page."""
    errand = reading(state, client)
    return {
        "name": state.model.name,
        "unnamed": STAND_IN.fullmatch(state.model.name) is not None,
        "count": state.freedom,
        "unsaved": unsaved(state),
        "counts": counts(state.model),
        "undo": state.undo[-1].label if state.undo else None,
        "redo": state.redo[-1].label if state.redo else None,
        "gallery": gallery(state),
        "kept": [(label, _left(kept)) for label, kept in state.kept.items()],
        "formats": list(SAVED.items()),
        "opened": [".json", ".zip", *READERS],
        "reading": errand and (errand.file or errand.label),
    }


def counts(model: pg.Model) -> dict[str, int]:
    """Count the parts in each tab of the model."""
    tied = len(model.constraints) + len(model.contacts) + len(model.forces)
    return {"Bodies": len(model.rows), "Connections": tied, "Scenarios": len(model.scenarios)}


def unsaved(state: State) -> bool:
    """Check whether the model was edited since it was last opened or saved."""
    edited = bool(state.undo) and state.undo[-1].document == state.document
    return edited and state.saved != (state.document, state.model)


def _left(kept: Kept) -> str:
    """Return a message about a model left by an earlier session."""
    how = "stopped" if kept.ended else "killed"
    return f"not saved when Pgraph was {how}" + (f"; started with {kept.given}" * bool(kept.given))


def gallery(state: State) -> list[tuple[str, str]]:
    """Return the built-in models with one-sentence descriptions, walking models first."""
    said = pgraph_models.about()
    names = sorted(state.gallery, key=lambda name: ('"gait"' not in state.gallery[name], name))
    return [(name, said.get(name, "")) for name in names]


class GalleryView:
    """Pictures of the models that can be opened, sent to pages with the gallery open."""

    def __init__(self, bridge: Bridge):
        self._bridge = bridge
        self._pictures: dict[str, str] = {}

    def render(self, old: State, new: State) -> None:
        for asked in requests(old, new, ShowGallery):
            for name, text in new.gallery.items():
                if name not in self._pictures:
                    self._pictures[name] = drawn(pg.Model.from_json(text))
            self._bridge.send(asked.client, "pictures", self._pictures)


class LinkView:
    """Sends the fragment of a link to pages that ask for it."""

    def __init__(self, bridge: Bridge):
        self._bridge = bridge

    def render(self, old: State, new: State) -> None:
        for asked in requests(old, new, ShareLink):
            try:
                found = {"fragment": fragment_of(new.model), "safe": SAFE}
                self._bridge.send(asked.client, "link", found)
            except pg.InputError as error:
                notice = Notice("No link", str(error), bad=True)
                self._bridge.send(asked.client, "notice", vars(notice))


def drawn(model: pg.Model) -> str:
    """Draw a model in its home position, as SVG text."""
    whole = model.expanded
    return pictures(whole, [pg.home_poses(whole)])[0]


VIEWS = (
    Place(lambda desk: ToolbarView(desk.bridge), 30, Host("toolbar", "top"), Host("start", "view")),
    Place(lambda desk: GalleryView(desk.bridge), 32),
    Place(lambda desk: LinkView(desk.bridge), 33),
)
