"""Writing of the model to a file that a page names."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pgraph_core as pg
from pgraph_core.markup import reason_of
from pgraph_core.model.files import shown_path

from ..core.events import Event
from . import State
from .update import Saved


class Files:
    """Writes the model for a page, which must confirm before a foreign file is replaced."""

    def __init__(self, send: Callable[[Event], None]):
        self._send = send
        self._written: dict[Path, bytes] = {}  # last content that this session wrote

    def render(self, old: State, new: State) -> None:
        saving = new.saving
        if saving is None or saving is old.saving:
            return
        path = given = Path(saving.path)
        problem = offer = ""
        try:
            path = given = given.expanduser().absolute()
            path = given.resolve()
            problem, offer = self._refused(path, saving.replace)
            if not Path(saving.path).name.isprintable() or saving.path.endswith(("/", "\\")):
                problem = f"{saving.path!r} is not a usable file name; use one such as arm.json."
            if not problem:
                saving.model.save(path)
                self._written[path] = path.read_bytes()
        except pg.PgraphError as error:
            problem = str(error)
        except (OSError, RuntimeError, ValueError) as error:  # a circle of links, '~nobody', a NUL
            problem = f"{shown_path(path)} could not be written: {reason_of(error)}."
        shown = str(path) if path == given else f"{path}, where {given} points to"
        self._send(Saved(saving.client, saving.serial, shown, problem, offer))

    def _refused(self, path: Path, replace: bool) -> tuple[str, str]:
        """Return the reason why a model is not written to a path, with a remedy, or ""."""
        if path.exists() and not path.is_file():
            return f"{path} is not an ordinary file; give the name of a new one.", ""
        if path.suffix != ".json":
            return f"The name of a model file ends in .json; given {path.name!r}.", ""
        if not path.exists():
            return "", ""
        content = path.read_bytes()
        if replace or content == self._written.get(path):
            return "", ""
        changed = time.strftime("%H:%M on %d %B %Y", time.localtime(path.stat().st_mtime))
        whose = "has changed since" if path in self._written else "exists and is not from"
        said = f"{path} {whose} this session (last written at {changed})."
        return said.replace("since this session", "since it was saved here"), "Replace it"
