"""The model itself: new, open, save, undo, redo, and derived data."""

from __future__ import annotations

import base64
import binascii
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

from pydantic import Field

import pgraph_core as pg
from pgraph_core.errors import choices, counted
from pgraph_core.file_kinds import HEAD, first_element
from pgraph_core.formats import READERS, ROOTS, SAVED
from pgraph_core.mesh_files import load_mesh
from pgraph_core.model import files, links
from pgraph_core.model.checks import PARTS

from .. import run
from ..core import cells, edit, state
from ..core.cells import Refusal
from ..core.edit import MOST_BODIES, attempted, showing
from ..core.events import Event, FromPage, Request, Text
from ..core.state import Notice, replied, told, with_client
from ..run.keeping import kept
from .archive import Several, folder_of, mesh_folder, own, read_text, unpacked


@dataclass(frozen=True)
class Found:
    """The result of an errand: changes to bodies, or a whole model, and a message."""

    text: str = ""
    changes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)  # body -> fields
    opened: pg.Model | None = None
    report: pg.Report | None = None  # report on a file of another format
    members: tuple[str, ...] = ()  # models of an archive, one of which is to be chosen
    value: Any = None  # for `Errand.then`


@dataclass(frozen=True)
class Members:
    """The models in an archive that are offered to the user."""

    file: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class Errand:
    """Background work with a result that may change bodies of `model`.

    It runs in a thread or, if `apart` is set, in a child process, which receives `work` without a
    model.
    """

    id: int
    client: int
    model: pg.Model
    label: str
    work: Callable[[pg.Model], Found]  # raises PgraphError, Refusal, OSError
    compiled: bool = False  # waits until the kernels are compiled
    file: str = ""  # name of the model file that is read
    apart: bool = False
    leaves: Path | None = None  # a folder that `work` makes
    then: Callable[[Any, Any], Any] | None = None  # (state, ErrandDone) -> state, for its result


@dataclass(frozen=True)
class Kept:
    """The model of a terminated session, read from its file."""

    path: Path
    given: str  # the model that the session was started with
    time: float  # time of the last edit [s since 1970]
    text: str  # JSON
    ended: bool  # the server was stopped, not killed
    name: str  # name of the model


@dataclass(frozen=True)
class Client(state.Client):
    conversion: pg.Report | None = None  # report on the last file of another format that it opened
    members: Members | None = None  # models of the last archive, of which it is to choose one

    def again(self, fresh: Any) -> Self:
        again = super().again(fresh)
        return replace(again, conversion=fresh.conversion, members=fresh.members)


@dataclass(frozen=True)
class State(run.State):
    clients: Mapping[int, Client] = field(default_factory=dict)
    gallery: Mapping[str, str] = field(default_factory=dict)  # built-in name -> JSON text
    kept: Mapping[str, Kept] = field(default_factory=dict)  # by what it is called in a list
    saved: tuple[int, pg.Model] | None = None  # document and model that were written last by Save
    errands: tuple[Errand, ...] = ()  # under way, in order
    errand_count: int = 0  # number of errands sent, the id of the last one


# -- new, open, undo, redo, and errands, which run in a thread and then edit the model (pure) ------


LONG = 100_000  # characters that are read at once, in 0.1 s at most
SUFFIXES = (".json", *SAVED)  # suffixes of models that are downloaded
MOST_HEIGHTS = 100_000  # limit on the heights of all heightfields, which are drawn
MOST_PARTS = 2000  # limit on the parts of any other kind, which are listed
MOST_NAMED = 5  # models of earlier sessions that the greeting names


S = TypeVar("S", bound=State)


class Undo(FromPage):
    """Undo the last edit, no matter who made it. Also restore the run of this model."""

    def applied(self, state: State) -> State:
        return _gone(state, "undo", "redo")


class Redo(FromPage):
    """Redo the edit that was undone last."""

    def applied(self, state: State) -> State:
        return _gone(state, "redo", "undo")


def _gone(state: State, back: str, onto: str) -> State:
    """Apply the last step of one list, and put its inverse onto the other."""
    if not (steps := getattr(state, back)):
        return state
    *left, step = steps
    inverse = replace(step, model=state.model, document=state.document)
    there = replace(showing(state, step.model), document=step.document)
    if step.document != state.document:  # the choices were for another model
        clients = {number: client.afresh() for number, client in there.clients.items()}
        there = replace(there, clients=clients)
    for client in state.clients:
        there = told(there, client, Notice(edit.ALSO, withdrawn=True))
    return replace(there, **{back: tuple(left), onto: (*getattr(state, onto), inverse)})


# -- new and open ----------------------------------------------------------------------------------


class NewModel(FromPage):
    """Create a serial chain with the given number of bodies, as in Sec. 4.1."""

    serial: int
    bodies: Text

    def applied(self, state: State) -> State:
        try:
            model = pg.Model.serial(cells.whole(self.bodies, 1, MOST_BODIES))
        except Refusal as refusal:
            return replied(state, self.client, self.serial, f"The number of bodies {refusal}")
        state = edit.replaced(state, model, f"new model of {len(model.bodies)} bodies")
        return replied(state, self.client, self.serial)


class ShowGallery(Request):
    """Request pictures of the models that can be opened."""


class OpenBuiltIn(FromPage):
    name: Text

    def applied(self, state: State) -> State:
        if self.name not in state.gallery:
            return state
        return opened(state, self.client, self.name, state.gallery[self.name])


class OpenKept(FromPage):
    """Open a model left by an earlier session. An unreadable one remains on offer."""

    name: Text

    def applied(self, state: State) -> State:
        if self.name not in state.kept:
            return state
        name, client = self.name, self.client
        try:
            model = own(state.kept[name].text)
        except pg.PgraphError as error:
            return shown_model(state, client, name, None, str(error))
        state = shown_model(state, client, name, model)
        return DiscardKept(client, name).applied(state) if state.model is model else state


class DiscardKept(FromPage):
    """Delete a model left by an earlier session. Autosave deletes its file."""

    name: Text

    def applied(self, state: State) -> State:
        left = {key: kept for key, kept in state.kept.items() if key != self.name}
        return replace(state, kept=left)


class OpenText(FromPage):
    """Open a file whose content was read by the page. Long ones are read in an errand."""

    name: Text
    content: Annotated[str, Field(max_length=8_000_000)]

    def applied(self, state: State) -> State:
        name, content = self.name, self.content
        foreign = _is_foreign(name, content)
        if len(content) <= LONG and not foreign:
            return opened(state, self.client, name, content)

        work = partial(_found_in_text, name, content)
        return sent(state, self.client, "open", work, file=name, apart=True)


class OpenLink(FromPage):
    """Open the model that a link carries."""

    link: Annotated[str, Field(max_length=2 * links.MOST)]

    def applied(self, state: State) -> State:
        try:
            return shown_model(state, self.client, "The link", links.linked(self.link))
        except pg.PgraphError as error:
            return shown_model(state, self.client, "The link", None, str(error))


def _found_in_text(name: str, content: str, _: Any) -> Found:
    """Parse the model in a text. Raises PgraphError, Refusal."""
    if _is_foreign(name, content):
        return _small_enough(*read_text(name, content))
    return Found(opened=_read(name, content))


def _is_foreign(name: str, content: str) -> bool:
    """Return True for the text of a model in another format."""
    return (
        Path(name).suffix.lower() in READERS
        or first_element(content[:HEAD].encode(errors="replace")) in ROOTS
    )


def _small_enough(model: pg.Model, report: pg.Report) -> Found:
    """Check that pages can show a model and its meshes. Raises Refusal, MemoryError."""
    if problem := too_many(vars(model)):
        raise Refusal(problem)
    files_of_meshes = {shape.file for body in model.bodies for shape in body.shapes if shape.file}
    together = []
    for file in files_of_meshes:
        try:
            together.append(load_mesh(file))
        except pg.FileError as error:  # a stand-in is drawn for it
            if isinstance(error.__cause__, MemoryError):
                raise MemoryError from None
    return Found(opened=model, report=report)


class OpenArchive(FromPage):
    """Start a job that opens a zip file with a model and its meshes."""

    name: Text
    content: Annotated[str, Field(max_length=16_000_000)]  # base64
    member: Text = ""  # the path of one of several models

    def applied(self, state: State) -> State:
        work = partial(_found_in_archive, self.member)
        leaves = lambda content: folder_of(content, mesh_folder())  # noqa: E731
        return sent_file(state, self.client, self.content, "open", work, leaves, self.name)


def _found_in_archive(member: str, content: bytes, _: Any) -> Found:
    """Return the model in an archive, or its models if none is selected. Raises Refusal."""
    try:
        return _small_enough(*unpacked(content, mesh_folder(), member))
    except Several as several:
        return Found(members=several.members)


class CancelReading(FromPage):
    """Cancel the file that is being read for the page, and stop the process that reads it."""

    def applied(self, state: State) -> State:
        errand = reading(state, self.client)
        if errand is None:
            return state
        state = replace(state, errands=tuple(e for e in state.errands if e is not errand))
        text = "Its reading was cancelled."
        return told(state, self.client, Notice(f"{errand.file or errand.label}: not read", text))


def reading(state: State, client: int) -> Errand | None:
    """Return the job that reads a file for a page, if there is one."""
    return next((e for e in state.errands if e.apart and e.client == client), None)


def opened(state: State, client: int, name: str, content: str) -> State:
    """Open the model in a file's text, or report why it cannot be opened."""
    try:
        return shown_model(state, client, name, _read(name, content))
    except (pg.PgraphError, Refusal) as error:
        return shown_model(state, client, name, None, str(error))


def _read(name: str, content: str) -> pg.Model:
    """Parse the model in a text. Raises PgraphError, Refusal."""
    files.refuse_kind(name, content[:HEAD].encode(errors="replace"))
    data = files.parse(content, name)
    if problem := too_many(data):
        raise Refusal(problem)
    return pg.Model(**files.located(data, mesh_folder()))


def too_many(data: Mapping[str, Any]) -> str:
    """Return the reason why a model is too large for pages, or "".

    The fields may be unchecked data of a file.
    """
    counts = {key: len(_of(data, key)) for key in PARTS}
    counts["steps"] = len(_of(data.get("ground"), "steps"))
    shapes = [s for b in _of(data, "bodies") for s in _of(b, "shapes") or [_get(b, "shape")]]
    counts["heights"] = sum(len(row) for s in shapes for row in _of(s, "heights") if _listed(row))
    most = {"bodies": MOST_BODIES, "heights": MOST_HEIGHTS}
    for what, count in counts.items():
        if count > most.get(what, MOST_PARTS):
            return f"it has {count} {what}; the page takes {most.get(what, MOST_PARTS)} at most"
    return ""


def _get(holder: Any, key: str) -> Any:
    return holder.get(key) if isinstance(holder, dict) else getattr(holder, key, None)


def _of(holder: Any, key: str) -> Sequence[Any]:
    found = _get(holder, key)
    return found if _listed(found) else ()


def _listed(value: Any) -> bool:
    return isinstance(value, (list, tuple))


def shown_model(
    state: State, client: int, name: str, model: pg.Model | None, problem: str = ""
) -> State:
    """Replace the current model by one that was read, or report the problem."""
    if model is not None:
        problem = problem or too_many(vars(model))
    if model is None or problem:
        return told(state, client, Notice(f"{name} was not opened", problem, bad=True))
    return edit.replaced(state, model, f"open {name}")


def recovered(state: State, kept: tuple[Kept, ...], given: str) -> State:
    """Return the initial state, given the models that earlier sessions left, newest first.

    The newest model of killed sessions that were started with the same model is restored. The other
    models are offered in the greeting.
    """
    again, title, text = None, "", ""
    for old in (old for old in kept if old.given == given and not old.ended):
        try:
            state = edit.replaced(state, own(old.text), "recover the last session")
        except pg.PgraphError:
            continue  # stays on offer, and opening it gives the reason
        again, title = old, "Recovered"
        text = f"{old.name} as it was at {_at(old)}, when Pgraph stopped. "
        text += f"Undo brings back {given}. "
        break
    offered: dict[str, Kept] = {}
    for old in kept:
        label, n = f"{old.name}, {_at(old)}", 2
        while label in offered:
            label, n = f"{old.name}, {_at(old)} ({n})", n + 1
        if old is not again:
            offered[label] = old
    if offered:
        title = title or "Earlier sessions"
        text += f"{counted(len(offered), 'model')} of earlier sessions can be opened by Open: "
        text += f"{choices(offered, MOST_NAMED)}."
    greeting = Notice(title, text.strip()) if title else state.greeting
    return replace(state, kept=offered, greeting=greeting)


def _at(kept: Kept) -> str:
    return time.strftime("%H:%M:%S on %d %B", time.localtime(kept.time))


class Handed(Request):
    """A request of the model, which then has the settings of the run."""

    def applied(self, state: Any) -> Any:
        return super().applied(kept(state, self.client))


class Download(Handed):
    """Download the model and its meshes as a file."""

    suffix: Annotated[str, Field(pattern=f"^({'|'.join(map(re.escape, SUFFIXES))})$")] = ".json"


class ShareLink(Handed):
    """Send the page a link that carries the model."""


# -- errands ---------------------------------------------------------------------------------------


class ErrandDone(Event):
    """The result of a job, which can be undone in one step, or the reason for its failure."""

    id: int
    found: Found = field(default_factory=Found)
    problem: str = ""

    def applied(self, state: State) -> State:
        errand = next((e for e in state.errands if e.id == self.id), None)
        if errand is None:
            return state
        state = replace(state, errands=tuple(e for e in state.errands if e.id != self.id))
        client, label, found = errand.client, errand.label, self.found
        if errand.then is not None:
            return errand.then(state, self)
        if found.members:
            return with_client(state, client, members=Members(errand.file, found.members))
        if errand.file:
            state = shown_model(state, client, errand.file, found.opened, self.problem)
            if found.report is None or not found.report.entries or client not in state.clients:
                return state
            return with_client(state, client, conversion=found.report)
        if self.problem:
            return told(state, client, Notice(f"Not done: {label}", self.problem, bad=True))
        if errand.model is not state.model:
            text = "The model has changed. Try again."
            return told(state, client, Notice(f"Not done: {label}", text, bad=True))
        changes: dict[str, dict[str, Any]] = {name: dict(x) for name, x in found.changes.items()}
        if changes:
            before = state.model
            state = attempted(state, client, lambda: before.edit_all(changes), label)
            if state.model is before:
                return state
        return told(state, client, Notice(label.capitalize(), found.text))


def sent(state: S, client: int, label: str, work: Callable[[pg.Model], Found], **more: Any) -> S:
    """Start a job for the current model, with `more` fields of an `Errand`.

    A job with `apart` is rejected while another job reads a file for the same page.
    """
    if more.get("apart") and (other := reading(state, client)) is not None:
        text = f"{other.file or other.label} is still being read; cancel it first."
        return told(state, client, Notice(f"Not done: {label}", text, bad=True))
    errand = Errand(state.errand_count + 1, client, state.model, label, work, **more)
    return replace(state, errands=(*state.errands, errand), errand_count=errand.id)


def sent_file(
    state: S,
    client: int,
    content: str,
    label: str,
    work: Callable[[bytes, Any], Found],
    leaves: Callable[[bytes], Path],
    file: str = "",
) -> S:
    """Start a job that reads an uploaded base64 file in a child process.

    `leaves` returns the location at which the result is stored.
    """
    try:
        data = base64.b64decode(content, validate=True)
    except (binascii.Error, ValueError):
        text = "The file did not arrive complete; try again."
        return told(state, client, Notice("Not done", text, bad=True))
    of_data, place = partial(work, data), leaves(data)
    return sent(state, client, label, of_data, file=file, apart=True, leaves=place)
