"""Answers that take a moment, beside the store: mobility reports, assembly, meshes from files.

One thread each for reports and errands; both follow the state like a view and answer with events.
"""

from __future__ import annotations

import hashlib
import re
import threading
from collections.abc import Callable
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pgraph_core as pg
from pgraph_core.constraints.mobility import mobility
from pgraph_core.mesh_files import FORMATS, load_mesh
from pgraph_core.shapes.meshes import mass_properties

from ..constraints.events import ErrandDone, MobilityFound
from ..core.cells import Refusal
from ..core.intents import Assemble, Errand, FillMass, ReadArchive, ReadMesh
from ..core.state import State
from ..events import Event
from ..properties.update import mass_of
from .archive import mesh_folder, unpacked

BY_ITSELF = 300  # degrees of freedom up to which the report comes unasked: it costs O(n³)
LARGEST_MESH = 10_000_000  # [bytes]
LARGE = 5.0  # [m] a mesh beyond this is likely not in metres

Send = Callable[[Event], None]


class Reports:
    """The mobility report of the model as it stands, while a page looks at its constraints."""

    def __init__(self, send: Send):
        self._send = send
        self._asked: pg.Model | None = None  # whose report was asked for last
        self._newest: SimpleQueue[pg.Model] = SimpleQueue()
        threading.Thread(target=self._work, name="pgraph-reports", daemon=True).start()

    def render(self, old: State, new: State) -> None:
        if new.model is not self._asked and wanted(new):
            self._asked = new.model
            self._newest.put(new.model)

    def _work(self) -> None:
        while True:
            model = self._newest.get()
            while not self._newest.empty():  # only the newest is of interest
                model = self._newest.get()
            self._send(report(model))


def wanted(state: State) -> bool:
    """Whether somebody looks at constraints whose report is not there yet."""
    if not state.model.constraints or not any(c.watching for c in state.clients.values()):
        return False
    if state.mobility is not None and state.mobility.model is state.model:
        return False
    return state.derived.dof <= BY_ITSELF or state.mobility_asked is state.model


def report(model: pg.Model) -> MobilityFound:
    """Degrees of freedom and redundant rows in the initial state, or the sentence why not."""
    try:
        return MobilityFound(model, mobility(model, pg.Topology.of(model)))
    except pg.PgraphError as error:
        return MobilityFound(model, None, str(error))
    except Exception as error:  # said on the page: the session goes on
        return MobilityFound(model, None, f"No report: {type(error).__name__}: {error}")


class Errands:
    """Does what pages ask for, one after the other, once the kernels are there."""

    def __init__(self, send: Send):
        self._send = send
        self._begun = 0  # id of the last errand that was queued
        self._queue: SimpleQueue[Errand] = SimpleQueue()
        threading.Thread(target=self._work, name="pgraph-errands", daemon=True).start()

    def render(self, old: State, new: State) -> None:
        for errand in new.errands:
            if isinstance(errand.what, Assemble) and not new.kernels.ready:
                return  # those behind it wait too: they were asked for later
            if errand.id > self._begun:
                self._begun = errand.id
                self._queue.put(errand)

    def _work(self) -> None:
        while True:
            self._send(answer(self._queue.get()))


def answer(errand: Errand) -> ErrandDone:
    """What an errand finds, or the sentence why it finds nothing."""
    try:
        match errand.what:
            case Assemble():
                changes, text = assembled(errand.model)
            case ReadMesh() as read:
                changes, text = shaped(read)
            case ReadArchive(_, content):
                return ErrandDone(errand.id, opened=unpacked(content, mesh_folder()))
            case FillMass(bodies, density):
                changes = mass_of([errand.model.body(name) for name in bodies], density)
                text = "Mass, centre of mass and inertia follow from the shape."
        return ErrandDone(errand.id, changes, text)
    except (pg.PgraphError, Refusal, OSError) as error:
        return ErrandDone(errand.id, problem=str(error))
    except Exception as error:  # said on the page: the session goes on
        return ErrandDone(errand.id, problem=f"{type(error).__name__}: {error}")


def assembled(model: pg.Model) -> tuple[dict[str, dict[str, Any]], str]:
    """The initial state moved onto the constraints, and how far. Raises PgraphError."""
    mech = pg.Mechanism(model)
    q, v, found = mech.assemble()
    if not found.notable:
        return {}, f"{str(found).capitalize()} already: nothing moved."
    changes, at, speed = {}, 0, 0
    for name in mech.names:
        body = model.body(name)
        new = {"q": tuple(q[at : at + len(body.q)].tolist()),
               "v": tuple(v[speed : speed + len(body.v)].tolist())}  # fmt: skip
        at, speed = at + len(body.q), speed + len(body.v)
        if new != {"q": body.q, "v": body.v}:
            changes[name] = new
    return changes, f"{str(found).capitalize()}. Undo takes it back."


# -- meshes ------------------------------------------------------------------------------------


def shaped(read: ReadMesh) -> tuple[dict[str, dict[str, Any]], str]:
    """The uploaded file kept, read, and made the shape. Raises PgraphError, Refusal, OSError."""
    suffix = Path(read.file).suffix.lower().lstrip(".")
    if suffix not in FORMATS:
        raise Refusal(f"no mesh is read from .{suffix} files; give one of {', '.join(FORMATS)}")
    if len(read.content) > LARGEST_MESH:
        size = len(read.content) / 1e6
        raise Refusal(f"{read.file} has {size:.1f} MB; a mesh file has at most 10 MB")
    stem = re.sub(r"[^\w-]+", "_", Path(read.file).stem)[:60] or "mesh"
    path = mesh_folder() / f"{stem}-{hashlib.sha256(read.content).hexdigest()[:8]}.{suffix}"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(read.content)
    try:
        mesh = load_mesh(path)
    except pg.PgraphError as error:
        path.unlink(missing_ok=True)
        raise Refusal(str(error).replace(str(path), read.file)) from None
    shape = pg.Shape(kind="mesh", file=str(path))
    text = f"{read.file}: {len(mesh.faces)} faces, {_size(mesh)}."
    if max(mesh.extents) > LARGE:
        text += " If its numbers are millimetres, set the scale to 0.001."
    try:
        mass_properties(shape, 1.0)
    except pg.PgraphError as error:
        text += f" It is drawn and touches, but has no volume: {_after(error)}."
    return {name: {"shape": shape} for name in read.bodies}, text


def _size(mesh: Any) -> str:
    x, y, z = (float(e) for e in mesh.extents)
    return f"{x:.3g} × {y:.3g} × {z:.3g} m"


def _after(error: pg.PgraphError) -> str:
    """The sentence of a problem without where it is."""
    return str(error).split(": ", 1)[-1]
