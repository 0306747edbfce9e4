"""Edits of the model: each is one undo step, and the page that asked is answered (pure).

What pages have selected and opened follows the names of bodies and parts. A page may speak of them
by names that changed while its message was on the way: it says how many renames it has heard of,
and what it says is meant of what carries those names now. Undo and redo: each person takes back
what that person did, others' later edits stay.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pgraph_core as pg
from pgraph_core.model.model import TOLD

from ..gait import Walking
from ..model import Step
from ..plots import MANY
from ..run import FREE_RUN, Live, Run, first_request
from .cells import Refusal
from .state import Client, Notice, Rename, State, replied, told

UNDO_DEPTH = 200
MOST_BODIES = 1000
MOST_RENAMES = 1000  # that are remembered
PARTS = ("bodies", "constraints", "contacts", "forces", "scenarios", "sites", "outputs")
NAMED = ("constraints", "contacts", "forces", "sites", "outputs")  # named parts besides bodies
OF_BODIES = ("body", "bodies", "parent", "before", "rows", "under")  # fields of events
IN_CELLS = ("parent", "body", "other", "frame", "at")  # cells with the name of a body as text


def edited(
    state: State,
    client: int,
    make: Callable[[], tuple[pg.Model, str]],
    serial: int | None = None,
    offer: Callable[[], str] = lambda: "",
) -> State:
    """The new model of `make() -> (model, what was done)` as one undo step.

    What it refuses stands next to the cell that was typed into, the one of `serial`, with a button
    for the repair that `offer` names; without a cell it is a notice.
    """
    try:
        model, label = make()
    except (Refusal, pg.PgraphError) as problem:
        if serial is None:
            return told(state, client, Notice("Not done", str(problem), bad=True))
        return replied(state, client, serial, str(problem), offer())
    state = with_model(state, model, label, client)
    if serial is not None:
        state = replied(state, client, serial)
    return _noticed(state, client, model)


def attempted(state: State, client: int, make: Callable[[], pg.Model], label: str) -> State:
    """The new model of `make()`, or a notice why not."""
    return edited(state, client, lambda: (make(), label))


def _noticed(state: State, client: int, model: pg.Model) -> State:
    """Tells the page what else the edit changed."""
    first, *more = model.notices or ("",)
    text = f"{first}; and {len(more)} more" if len(more) > 1 else "; ".join((first, *more))
    return told(state, client, Notice("Also changed", text)) if text else state


def with_model(state: State, model: pg.Model, label: str, client: int | None = None) -> State:
    """`model` in place of the current one, as one undo step of a page, or of the server.

    Nothing if it is the same.
    """
    if model is state.model:
        return state
    vars(model).pop(TOLD, None)  # the page shows notices at each edit; no run repeats them
    page = state.clients.get(client) if client is not None else None
    step = Step(state.model, label, by=page.page if page else "")
    undo = (*state.undo, step)[-UNDO_DEPTH:]
    return replace(showing(state, model), undo=undo, redo=(), greeting=None)


def replaced(state: State, model: pg.Model, label: str, client: int | None = None) -> State:
    """A different model, as one undo step: with its own run settings, and in view.

    What was selected, drawn, plotted and measured of the one before goes with it.
    """
    after = with_model(state, model, label, client)
    at_start = replace(after.playback, time=0.0, playing=False, preview=False)
    return replace(
        after,
        last_run=state.last_run,  # not of this model, also where it is the same once more
        playback=after.playback if after.live else at_start,
        renames=state.renames,  # the bodies of its rows are others, not renamed ones
        request=first_request(model),
        framed=state.framed + 1,
        walking=Walking(),
        run_problem="",
        clients={number: _afresh(client) for number, client in after.clients.items()},
        ghost=None,
        report=None,
        analysis=None,
        analysis_problem="",
        posed=None,
        pull=None,
    )


def _afresh(client: Client) -> Client:
    """A page that has chosen nothing of this model yet."""
    none = Client()
    of_model = ("selection", "selected", "plots", "walk", "gizmo", "grip", "picking", "aim",
                "opened", "listed")  # fmt: skip
    looked = client.inspected  # its tab may be in sight: the same operator, all of it
    whole = None if looked is None else replace(looked, rows=None, columns=None)
    return replace(client, inspected=whole, **{name: getattr(none, name) for name in of_model})


def showing(state: State, model: pg.Model) -> State:
    """`model` shown: selections follow by name or row, the playback is at its start."""
    names = {(kind, old): new for kind, old, new in renamed(state.model, model)}
    clients = {
        key: _named(_follows(client, state.model, model), names)
        for key, client in state.clients.items()
    }
    request = state.request
    if request.scenario != FREE_RUN and all(s.name != request.scenario for s in model.scenarios):
        request = replace(request, scenario=FREE_RUN)
    live = state.live and _live_on(state.live, state.model, model)
    return replace(
        state,
        last_run=state.last_run and _run_on(state.last_run, state.model, model),
        live=live,
        model=model,
        renames=remembered(state.renames, state.model, model),
        clients=clients,
        request=request,
        playback=state.playback
        if live or (state.run is not None and _same_motion(state.model, model))
        else replace(state.playback, time=0.0, playing=False, preview=False),
    )


def _run_on(run: Run, old: pg.Model, new: pg.Model) -> Run:
    """A run of the old model as one of the new, if an edit changed names or looks only."""
    if run.model is not old or not _same_motion(old, new):
        return run
    result = run.result
    if hasattr(result, "mechanism"):
        result = replace(result, mechanism=pg.Mechanism(new))
    return replace(run, model=new, result=result)


def _same_motion(old: pg.Model, new: pg.Model) -> bool:
    """Whether two models move alike: names of bodies, and what is only drawn, are left out."""
    if old is new:
        return True
    if len(old.bodies) != len(new.bodies):
        return False
    alike = old
    for a, b in zip(old.bodies, new.bodies):
        if a is not b and a.name != b.name:
            if b.name in alike.row:
                return False
            alike = alike.edit(a.name, name=b.name)
    others = [field for field in pg.Model.model_fields if field not in ("bodies", "name")]
    return all(getattr(alike, field) == getattr(new, field) for field in others) and all(
        a is b or _bare(a) == _bare(b) for a, b in zip(alike.bodies, new.bodies)
    )


def _bare(body: pg.Body) -> pg.Body:
    """A body without what is only drawn."""
    touching = tuple(s.unchecked_copy({"role": "collision", "colour": None}) for s in body.touching)
    return body.unchecked_copy({"shapes": touching})


def _live_on(live: Live, old: pg.Model, new: pg.Model) -> Live:
    """The live run of an edited model: it goes on if the joints are the same, else starts over."""

    def joints(model: pg.Model) -> list[tuple[str, str, int]]:
        return [(body.name, body.parent, len(body.q)) for body in model.bodies]

    return live if joints(old) == joints(new) else replace(live, parts=(), joined=(), falls=())


def _follows(client: Client, old: pg.Model, new: pg.Model) -> Client:
    """The page with its selection in the new model: by name, or by row where it was renamed."""
    if not client.selected:
        return client
    if len(old.bodies) == len(new.bodies):
        names = {a.name: b.name if a.name not in new.row else a.name
                 for a, b in zip(old.bodies, new.bodies)}  # fmt: skip
    else:
        names = {name: name for name in new.row}
    kept = sorted((names[n] for n in client.selected if n in names), key=new.row.__getitem__)
    last = names.get(client.selection or "", kept[-1] if kept else None)
    return replace(client, selection=last, selected=tuple(kept))


def _named(client: Client, names: Mapping[tuple[str, str], str]) -> Client:
    """What the page has opened, listed and plotted, under its new names."""
    if not names:
        return client
    opened = client.opened and (client.opened[0], names.get(client.opened, client.opened[1]))
    listed = client.listed and names.get(("bodies", client.listed), client.listed)
    plots = tuple(
        (kind, MANY.join(names.get(("bodies", name), name) for name in of.split(MANY)))
        for kind, of in client.plots
    )
    return replace(client, opened=opened, listed=listed, plots=plots)


def selected(state: State, client: int, body: str | None, bodies: tuple[str, ...]) -> State:
    """`state` with these bodies selected on one page; unchanged if `body` is unknown."""
    if body is not None and body not in state.model.row:
        return state
    page, wanted = state.clients.get(client), {*bodies, body}
    if page is None:
        return state
    known = tuple(b.name for b in state.model.bodies if b.name in wanted)
    changed = replace(page, selection=body, selected=known)
    return replace(state, clients={**state.clients, client: changed})


# -- names that changed ----------------------------------------------------------------------------


def renamed(old: pg.Model, new: pg.Model) -> Iterator[tuple[str, str, str]]:
    """(kind, old name, new name) of what stands in its row under another name."""
    for kind in ("bodies", *NAMED):
        for a, b in _pairs(getattr(old, kind), getattr(new, kind)):
            if all(getattr(a, f, None) == getattr(b, f, None) for f in ("mass", "inertia", "kind")):
                yield kind, a.name, b.name
    if len(old.parameters) == len(new.parameters):
        for a, b in zip(old.parameters, new.parameters):
            if a not in new.parameters and b not in old.parameters:
                yield "parameters", a, b


def _pairs(old: Sequence[Any], new: Sequence[Any]) -> list[tuple[Any, Any]]:
    if len(old) != len(new):
        return []
    other = [(a, b) for a, b in zip(old, new) if a.name != b.name]
    before, after = {a.name for a, _ in other}, {b.name for _, b in other}
    return [(a, b) for a, b in other if a.name not in after and b.name not in before]


def remembered(renames: tuple[Rename, ...], old: pg.Model, new: pg.Model) -> tuple[Rename, ...]:
    """With those of an edit from `old` to `new`."""
    last = renames[-1].number if renames else 0
    more = [Rename(last + k, *said) for k, said in enumerate(renamed(old, new), 1)]
    return (*renames, *more)[-MOST_RENAMES:] if more else renames


def as_now(renames: Sequence[Rename], event: Any) -> Any:
    """An event of a page in the names of now."""
    seen = getattr(event, "seen", None)
    if seen is None or not renames or renames[-1].number <= seen:
        return event
    late = [rename for rename in renames if rename.number > seen]

    def now(value: Any, kind: str) -> Any:
        if isinstance(value, tuple):
            return tuple(now(each, kind) for each in value)
        for rename in late:
            if (rename.kind, rename.old) == (kind, value):
                value = rename.new
        return value

    changes = {
        field: (
            now(value, kind)
            if field != "entries"
            else tuple((at, now(text, kind)) for at, text in value)
        )
        for field, kind, value in _names(event, vars(event))
    }
    return replace(event, **changes) if changes else event


def _names(event: Any, fields: Mapping[str, Any]) -> Iterator[tuple[str, str, Any]]:
    """(field, kind, value) of the fields of an event that are names of what there is."""
    for field in OF_BODIES:
        if fields.get(field) is not None:
            yield field, "bodies", fields[field]
    about = type(event).__name__
    if fields.get("field") in IN_CELLS:
        for field in {"text", "entries"} & fields.keys():
            yield field, "bodies", fields[field]
    if fields.get("part") in NAMED and fields.get("name") is not None:
        yield "name", fields["part"], fields["name"]
    elif about == "PickName":
        yield "name", "bodies", fields["name"]
    elif about.endswith("Parameter"):
        yield "name", "parameters", fields["name"]
    elif about == "Plot":
        yield "of", "bodies", fields["of"]


# -- undo and redo ---------------------------------------------------------------------------------


def _last(state: State, steps: Sequence[Step], client: int) -> int | None:
    """The number of the last step that a page may take back: its own, or of a page that is gone."""
    if client not in state.clients:
        return len(steps) - 1 if steps else None
    me = state.clients[client].page
    others = {page.page for page in state.clients.values()} - {me}
    mine = [i for i, step in enumerate(steps) if step.by not in others]
    return mine[-1] if mine else None


def undoable(state: State, client: int) -> Step | None:
    """What Undo of a page would take back."""
    k = _last(state, state.undo, client)
    return None if k is None else state.undo[k]


def redoable(state: State, client: int) -> Step | None:
    """What Redo of a page would do again: only where nobody took back something later."""
    k = _last(state, state.redo, client)
    return state.redo[-1] if state.redo and k == len(state.redo) - 1 else None


def undone(state: State, client: int) -> State:
    """The model without the last step of a page; its run is shown again if it has one."""
    k = _last(state, state.undo, client)
    if k is None:
        return state
    step, later = state.undo[k], state.undo[k + 1 :]
    redo = (*state.redo, Step(state.model, step.label, step.by))
    if not later:
        return replace(showing(state, step.model), undo=state.undo[:k], redo=redo)
    after = later[0].model
    try:
        model = reverted(state.model, step.model, after)
        since = [replace(later[0], model=step.model)]
        since += [replace(x, model=reverted(x.model, step.model, after)) for x in later[1:]]
    except (Refusal, pg.PgraphError) as problem:
        text = f"'{step.label}' cannot be undone any more: {problem}"
        return told(state, client, Notice("Not undone", text, bad=True))
    return replace(showing(state, model), undo=(*state.undo[:k], *since), redo=redo)


def redone(state: State, client: int) -> State:
    """The model that the last undo of a page left."""
    step = redoable(state, client)
    if step is None:
        return state
    undo = (*state.undo, Step(state.model, step.label, step.by))
    return replace(showing(state, step.model), undo=undo, redo=state.redo[:-1])


def reverted(now: pg.Model, before: pg.Model, after: pg.Model) -> pg.Model:
    """`now` with what changed from `before` to `after` taken back; what others changed stays.

    Raises Refusal where the same was changed since, PgraphError where the rest needs it.
    """
    names = [said for said in renamed(after, now) if said[0] in PARTS]
    before, after = _called(before, names), _called(after, names)
    fields: dict[str, Any] = {}
    for key in type(now).model_fields:
        was, then, is_now = (getattr(model, key) for model in (before, after, now))
        if was == then:
            continue
        if key in PARTS:
            fields[key] = _parts(was, then, is_now)
        elif is_now == then:
            fields[key] = was
        else:
            raise Refusal(f"the {key} of the model was changed since")
    return now.replace(**fields)


def _called(model: pg.Model, names: Sequence[tuple[str, str, str]]) -> pg.Model:
    """The model with the names that parts have got since."""
    for kind, old, new in names:
        if any(part.name == old for part in getattr(model, kind)):
            which = {} if kind == "bodies" else {"kind": kind[:-1]}
            model = model.edit(old, **which, name=new)
    return model


def _parts(was: Sequence[Any], then: Sequence[Any], is_now: Sequence[Any]) -> tuple[Any, ...]:
    """Parts by name, each as it is now or as it was; the order follows what is there now."""
    a, b, c = ({part.name: part for part in parts} for parts in (was, then, is_now))
    found: dict[str, Any] = {}
    for name, part in c.items():
        if a.get(name) == b.get(name):
            found[name] = part
        elif name in a and name in b:
            found[name] = _part(a[name], b[name], part)
        elif name in a or part != b[name]:
            raise Refusal(f"'{name}' was changed since by another person")
    for name in a:
        if name in b and name not in c and a[name] != b[name]:
            raise Refusal(f"'{name}' was taken out since by another person")
    if list(b) == list(c):
        return tuple(found.get(name, a[name]) for name in a)
    order, before = list(found), ""
    for name in a:
        if name not in b:
            order.insert(order.index(before) + 1 if before in order else 0, name)
            found[name] = a[name]
        before = name
    return tuple(found[name] for name in order)


def _part(was: Any, then: Any, is_now: Any) -> Any:
    """A part that is there all along: field by field."""
    if is_now == then:
        return was
    if type(was) is not type(is_now):
        raise Refusal(f"'{is_now.name}' was changed since by another person")
    fields = {}
    for key in type(was).model_fields:
        old, changed, current = (getattr(part, key) for part in (was, then, is_now))
        if old == changed:
            continue
        if current != changed:
            raise Refusal(f"the {key} of '{is_now.name}' was changed since by another person")
        fields[key] = old
    return is_now.unchecked_copy(fields)
