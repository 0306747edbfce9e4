"""The immutable state of the app: the model, the open pages, and the state of each feature.

A feature declares what it adds in its `__init__.py`: a `State` and, for what differs between pages,
a `Client`, each with fields of its own on top of those of the features it looks at. `features.py`
puts all of them together. The effects of edits and of opening a model on the added fields are
defined there as well, in methods that call the methods of their base classes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, wraps
from typing import Any, ClassVar, NamedTuple, Self, TypeVar

import numpy as np

import pgraph_core as pg
from pgraph_core.errors import counted
from pgraph_core.model.segments import segment
from pgraph_core.numbering import children_of
from pgraph_core.show.digraph import Layout, layout
from pgraph_core.show.shapes import branches, reach, to_wxyz
from pgraph_core.show.stage import WHOLE, Free, depth
from pgraph_core.topology import Loop, loops_of

from .cells import Display
from .rows import Rows


@dataclass(frozen=True)
class Reply:
    """The reply for a typed cell: "" if it was accepted, or else the error message."""

    serial: int
    text: str
    offer: str = ""  # label of a repair button, e.g. "use the nearest possible"
    failed: bool = False  # the cell shows the value of the model again


@dataclass(frozen=True)
class Notice:
    """A transient notification for one user."""

    title: str
    text: str = ""
    bad: bool = False
    withdrawn: bool = False  # the notices of this title are no longer true


@dataclass(frozen=True)
class Rename:
    """A rename that pages may not yet know, so that they may briefly use the old name."""

    number: int  # `State.version` after it
    kind: str  # "bodies", "parameters", "constraints", "contacts" or "forces"
    old: str
    new: str


Names = Mapping[tuple[str, str], str]  # (list, old name) -> new name, of what was renamed


@dataclass(frozen=True)
class Step:
    """A user action as an undo step, with the model before it and a description."""

    model: pg.Model
    label: str
    document: int = 0  # `State.document` of that model


HOSTED: set[str] = set()  # names of the views that have a place on the page


@dataclass(frozen=True)
class Client:
    """An open page with its selection and its last notice."""

    page: str = ""  # name of the page, kept when it reconnects
    selection: str | None = None  # the body that was selected last
    selected: tuple[str, ...] = ()  # all selected bodies in the table's order
    dark: bool = False
    aspect: float | None = None  # width over height of its 3D view, once known
    free: Free = WHOLE  # the part of that view which no toolbar covers
    reply: Reply | None = None
    notice: Notice | None = None
    asked: Any = None  # the last event that asked for something to be sent once, or shown
    sees: frozenset[str] = frozenset()  # the views of hidden tabs that it has in sight
    display: Display = field(default_factory=Display)

    def afresh(self) -> Self:
        """Return the page without its choices for the previous model."""
        return replace(self, selection=None, selected=())

    def followed(self, old: pg.Model, new: pg.Model, names: Names) -> Self:
        """Return the page after an edit. Its selection follows names, or the row of a rename."""
        if not self.selected:
            return self
        before, now = ([b.name for b in (*m.bodies, *m.beams)] for m in (old, new))
        row = {name: k for k, name in enumerate(now)}
        if len(before) == len(now):
            kept = {a: b if a not in row else a for a, b in zip(before, now)}
        else:
            kept = {name: name for name in now}
        chosen = sorted((kept[n] for n in self.selected if n in kept), key=row.__getitem__)
        last = kept.get(self.selection or "", chosen[-1] if chosen else None)
        return replace(self, selection=last, selected=tuple(chosen))

    @property
    def aims(self) -> bool:
        """True if clicks in the 3D view do not select bodies."""
        return False

    def choosing(self, body: str | None, bodies: tuple[str, ...]) -> Self:
        """Return the page with these bodies selected, the last one being `body`."""
        return replace(self, selection=body, selected=bodies)

    def escaped(self) -> Self | None:
        """Return the page after Escape was pressed, or None to clear the selection."""
        return None

    def again(self, fresh: Any) -> Self:
        """Return the unchanged page after reconnecting as `fresh`. Its request is not repeated."""
        return replace(
            self, aspect=fresh.aspect, free=fresh.free, notice=fresh.notice, asked=fresh.asked,
            selection=None, selected=(),
        )  # fmt: skip


@dataclass(frozen=True)
class State:
    """State of the server."""

    CLIENT: ClassVar[type[Client]] = Client
    model: pg.Model
    clients: Mapping[int, Client] = field(default_factory=dict)
    left: Mapping[str, Client] = field(default_factory=dict)  # pages that went, by their names
    undo: tuple[Step, ...] = ()
    redo: tuple[Step, ...] = ()
    renames: tuple[Rename, ...] = ()  # the most recent renames
    rows: Rows = field(default_factory=Rows)
    version: int = 0  # number of edits that changed names or rows
    moved: int = 0  # the version at the last change of rows
    greeting: Notice | None = None  # to pages that open, until the model is changed
    framed: int = 0  # number of opened models, for each of which the camera is framed
    document: int = 0  # `framed` when the present model was opened, changed by Undo and Redo
    jobs: int = 0  # number of requested jobs, the id of the last one

    def opened(self, before: Any) -> Self:
        """Return the state at the beginning of another model, which was opened after `before`."""
        clients = {number: client.afresh() for number, client in self.clients.items()}
        return replace(self, clients=clients, renames=before.renames, rows=Rows())

    def followed(self, before: Any, names: Names) -> Self:
        """Return the state after an edit of the model, keeping the data that remain valid."""
        clients = {
            key: client.followed(before.model, self.model, names)
            for key, client in self.clients.items()
        }
        return replace(self, clients=clients)

    @property
    def whole(self) -> pg.Model:
        """The model with the segments of its beams as bodies, which is drawn, posed and run."""
        return self.model.expanded

    @property
    def derived(self) -> Derived:
        """Data derived from the whole model."""
        return derive(self.whole)

    @property
    def graph(self) -> Graph:
        """Data derived from the rows of the table, one for each body and each beam."""
        return self.derived if self.whole is self.model else graph_of(self.model)

    @property
    def ids(self) -> dict[str, int]:
        """The ids of the rows of the table by name, of beams below 0."""
        beams = self.rows.named(self.model, "beams")
        return {**self.rows.named(self.model, "bodies"), **{x: -1 - k for x, k in beams.items()}}

    def drawn_as(self, rows: Iterable[str]) -> tuple[str, ...]:
        """Return the bodies that are drawn for these rows: the segments of beams."""
        counts, found = self.whole.segments, list[str]()
        for name in rows:
            n = sum(counts.get(name, ()))
            found += [segment(name, k) for k in range(n + 1)] if n else [name]
        return tuple(found)

    def row_of(self, name: str) -> str:
        """Return the row of a body that is drawn: that of its beam for a segment."""
        return self.whole.beam_of.get(name, name)

    @property
    def moves(self) -> bool:
        """True if time is advancing, so that the store ticks."""
        return False

    def ticked(self, dt: float) -> Self:
        """Return the state after this time [s], while it moves."""
        return self

    @property
    def ready(self) -> bool:
        """True once background jobs can begin."""
        return True

    @property
    def scenario(self) -> str:
        """The name of the scenario to which events without one apply."""
        return ""

    @property
    def freedom(self) -> str:
        """The degrees of freedom as text."""
        return f"{self.derived.dof} DoF"

    @property
    def counts(self) -> str:
        """A text with the number of bodies and degrees of freedom."""
        return f"{counted(len(self.graph.names), 'body', 'bodies')}, {self.freedom}"


S = TypeVar("S", bound=State)


def with_client(state: S, client: int, **changes: Any) -> S:
    """Return `state` with one page's own fields changed. Unknown pages are ignored."""
    if client not in state.clients:
        return state
    changed = replace(state.clients[client], **changes)
    return replace(state, clients={**state.clients, client: changed})


def told(state: S, client: int, notice: Notice) -> S:
    """Return `state` with a notice for one page."""
    return with_client(state, client, notice=notice)


def replied(
    state: S, client: int, serial: int, text: str = "", offer: str = "", failed: bool = False
) -> S:
    """Return `state` with a reply to one page's typed cell, where "" accepts it."""
    return with_client(state, client, reply=Reply(serial, text, offer, failed))


def display_of(state: State, client: int) -> Display:
    """Return the units and number formats for one page."""
    page = state.clients.get(client)
    return page.display if page is not None else Display()


# -- data derived from a model alone, for use by the page ------------------------------------------


CONTACT = "contact"  # text in the constraint column
KEPT = 8  # models of which it is known


@dataclass(frozen=True)
class Graph:
    """Data derived from the tree and its loops, in the order of the numbers of the rows unless
    stated otherwise."""

    names: tuple[str, ...]  # from body 1
    number: Mapping[str, int]  # name -> 1..nb
    parent: tuple[int, ...]  # numbers, 0 is the ground
    children: tuple[tuple[int, ...], ...]  # children of body 0 (ground), 1, ...
    pgraph: tuple[int, ...]
    jdof: tuple[int, ...]
    tips: frozenset[int]
    separation: frozenset[int]
    dof: int
    constraints: Mapping[str, tuple[str, ...]]  # body name -> names of what touches it
    loops: tuple[Loop, ...]  # constraints drawn in addition to the tree
    layout: Layout
    branches: tuple[int, ...]


@dataclass(frozen=True)
class Derived(Graph):
    """Data derived from the model, in the order of the body numbers unless stated otherwise."""

    positions: np.ndarray  # (nb, 3) body origins at home, world axes [m]
    wxyz: np.ndarray  # (nb, 4) orientations at home
    center: np.ndarray  # (3,) what the camera looks at [m]
    size: float  # extent of the model from there [m]
    low: float  # depth under its plane that the bodies do not reach [m]

    @property
    def grain(self) -> float:
        """The typical size of one body [m], a reference length for the marks drawn on bodies."""
        return self.size / max(1.0, len(self.names) / 16)


F = TypeVar("F")


def of_model(find: Callable[[pg.Model], F]) -> Callable[[pg.Model], F]:
    """Keep what a function finds about a model while the model is in use.

    Models are compared by identity: the hash of a large one takes longer than a picture.
    """
    recent: tuple[tuple[pg.Model, F], ...] = ()  # newest first

    @wraps(find)
    def known(model: pg.Model) -> F:
        nonlocal recent
        for one, found in recent:
            if one is model:
                return found
        found = find(model)
        recent = ((model, found), *recent)[:KEPT]
        return found

    return known


@of_model
def derive(model: pg.Model) -> Derived:
    """Return the data derived from a model without beams: its graph, home poses and size."""
    graph = graph_of(model)
    bodies = [model.body(name) for name in graph.names]
    positions, rotations = pg.home_poses(model)
    center, size = reach(bodies, positions, rotations)
    return Derived(
        **vars(graph),
        positions=np.asarray(positions, dtype=float),
        wxyz=to_wxyz(np.asarray(rotations, dtype=float)),
        center=center,
        size=size,
        low=depth(model, bodies, graph.parent, positions, size),
    )


@of_model
def graph_of(model: pg.Model) -> Graph:
    """Return the topology of a model, its layout, colours and constraint column."""
    top = pg.Topology.of(model)
    names, parent = tuple(top.names), tuple(top.parent.tolist())
    loops = loops_of(model, top)
    freedom = freedoms(model.expanded)
    dof = [freedom[name] for name in names] if model.beams else top.dof.tolist()
    tree = _tree(parent, tuple(dof))
    ends = tuple((loop.body, loop.other) for loop in loops)
    return Graph(
        names=names,
        number={name: k for k, name in enumerate(names, 1)},
        parent=parent,
        **tree._asdict(),
        tips=frozenset(top.tips.tolist()),
        separation=frozenset(top.separation_bodies.tolist()),
        dof=sum(dof),
        constraints=touching(model),
        loops=loops,
        layout=_layout(parent, tuple(map(len, names)), ends),
    )


def freedoms(whole: pg.Model) -> Counter[str]:
    """Return the degrees of freedom of each row, of a beam those of all its segments."""
    found, of = Counter[str](), whole.beam_of
    for body in whole.bodies:
        found[of.get(body.name, body.name)] += body.dof
    return found


class Tree(NamedTuple):
    """Data that depends on parents and degrees of freedom only, so that most edits preserve it."""

    children: tuple[tuple[int, ...], ...]
    pgraph: tuple[int, ...]
    jdof: tuple[int, ...]
    branches: tuple[int, ...]


@lru_cache(maxsize=16)
def _tree(parent: tuple[int, ...], dof: tuple[int, ...]) -> Tree:
    pgraph = pg.pgraph_of(parent)
    jdof = pg.jdof_of(pgraph, dof)
    walk = tuple(pgraph.tolist()), tuple(jdof.tolist())
    return Tree(children_of(parent), *walk, branches(parent))


_layout = lru_cache(maxsize=16)(layout)


def touching(model: pg.Model) -> dict[str, tuple[str, ...]]:
    """Return the constraint column: constraints and contacts attached to a body, and its limits.

    A contact with the same name as its body is labelled "contact".
    """
    found: dict[str, list[str]] = {body.name: [] for body in model.rows}
    of = {name: beam for name, beam in model.beam_of.items() if name not in found}
    shaped = [body.name for body in model.bodies if body.touching]
    for c in model.constraints:
        for name in dict.fromkeys(of.get(name, name) for name in c.touches):
            found[name].append(c.name)
    for contact in model.contacts:
        ends = {of.get(name, name) for name in (contact.body, contact.other)}
        for name in {*ends, *(shaped if "*" in ends else ())} & found.keys():
            found[name].append(CONTACT if contact.name == name else contact.name)
    for body in model.bodies:
        if any(body.limits):
            found[body.name].append("limits")
    return {name: tuple(names) for name, names in found.items()}
