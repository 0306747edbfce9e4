"""Model edits: each is one undo step with a reply to its page (pure).

Selections and opened parts of pages follow the names of bodies and parts. Each message carries the
rename count that its page has seen, and older names are translated. Rows keep their numbers, bodies
their colours.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import accumulate
from typing import Any

import pgraph_core as pg
from pgraph_core.errors import counted
from pgraph_core.joints import AXIAL, SIZE
from pgraph_core.model.model import TOLD

from ..gait import Walking
from ..model import Step
from ..plots import MANY
from ..run import FREE_RUN, Live, Run, first_request
from .cells import LISTS, Key, Refusal, Rows, names_of
from .state import Client, Notice, Rename, State, replied, told

UNDO_DEPTH = 200
MOST_BODIES = 1000
MOST_RENAMES = 1000  # limit on remembered renames
NAMED = ("constraints", "contacts", "forces", "sites", "outputs")  # named parts besides bodies
STAND_IN = re.compile(r"serial \d+|model")  # names that nobody has given
OF_BODIES = ("body", "bodies", "parent", "before", "rows", "under")  # fields of events
IN_CELLS = ("parent", "body", "other", "frame", "at")  # cells with the name of a body as text


def edited(
    state: State,
    client: int,
    make: Callable[[], tuple[pg.Model, str]],
    serial: int | None = None,
    offer: Callable[[], str] = lambda: "",
    at: int | None = None,
) -> State:
    """Apply the new model from `make() -> (model, what was done)` as one undo step.

    What it refuses stands next to the cell that was typed into, the one of `serial`, with a button
    for the repair that `offer` names; without a cell it is a notice. `at` is the place of the row
    that is edited.
    """
    try:
        model, label = make()
    except (Refusal, pg.PgraphError) as problem:
        if serial is None:
            return told(state, client, Notice("Not done", str(problem), bad=True))
        return replied(state, client, serial, str(problem), offer())
    said = [*model.notices, *_pointed(state.model, model)]
    state = with_model(state, model, label, at)
    if serial is not None:
        state = replied(state, client, serial)
    return _noticed(state, client, said)


def attempted(state: State, client: int, make: Callable[[], pg.Model], label: str) -> State:
    """Apply the new model from `make()`, or notify the page about the reason for its failure."""
    return edited(state, client, lambda: (make(), label))


def _pointed(before: pg.Model, now: pg.Model) -> Iterator[str]:
    """Yield a message for each contact that still uses points although its body now has a shape."""
    for contact in now.contacts:
        name = contact.body
        bare = name in before.row and not before.body(name).shapes
        if contact.points and bare and name in now.row and now.body(name).shapes:
            points = counted(len(contact.points), "point")
            yield (
                f"contact '{contact.name}' still touches at {points} of '{name}' alone; "
                "delete them to let the shape touch"
            )


def _noticed(state: State, client: int, said: Sequence[str]) -> State:
    """Notify the page about side effects of the edit, and about parts that it did not change."""
    first, *more = said or ("",)
    text = f"{first}; and {len(more)} more" if len(more) > 1 else "; ".join((first, *more))
    return told(state, client, Notice("Also changed", text)) if text else state


def with_model(state: State, model: pg.Model, label: str, at: int | None = None) -> State:
    """Replace the current model by `model`, as one undo step. Do nothing if it is the same."""
    if model is state.model:
        return state
    vars(model).pop(TOLD, None)  # the page shows notices at each edit, so no run repeats them
    step = Step(state.model, label, state.rows, state.document)
    undo = (*state.undo, step)[-UNDO_DEPTH:]
    return replace(showing(state, model, at), undo=undo, redo=(), greeting=None)


def replaced(state: State, model: pg.Model, label: str) -> State:
    """Open a different model as one undo step, with its own run settings and camera view.

    What was selected, drawn, plotted and measured of the one before goes with it.
    """
    after = with_model(state, model, label)
    at_start = replace(after.playback, time=0.0, playing=False, preview=False)
    return replace(
        after,
        last_run=state.last_run,  # not of this model, also where it is the same once more
        playback=after.playback if after.live else at_start,
        renames=state.renames,  # the bodies of its rows are others, not renamed ones
        rows=Rows(),
        request=first_request(model),
        framed=state.framed + 1,
        document=state.framed + 1,
        walking=Walking(),
        run_problem="",
        clients={number: _afresh(client) for number, client in after.clients.items()},
        runs=(),
        report=None,
        analysis=None,
        analysis_problem="",
        posed=None,
        pull=None,
    )


def _afresh(client: Client) -> Client:
    """Return the page with all choices for the previous model reset."""
    none = Client()
    of_model = ("selection", "selected", "plots", "walk", "gizmo", "grip", "picking", "aim",
                "opened", "listed")  # fmt: skip
    looked = client.inspected  # its tab may be in sight: the same operator, all of it
    whole = None if looked is None else replace(looked, rows=None, columns=None)
    return replace(client, inspected=whole, **{name: getattr(none, name) for name in of_model})


def showing(
    state: State, model: pg.Model, at: int | None = None, earlier: Step | None = None
) -> State:
    """Show `model`. Selections follow names or rows, and the playback is reset to its start.

    `at` is the place of the row that was edited; `earlier` is the step that comes back.
    """
    changed = list(renamed(state.model, model))
    names = {(kind, old): new for kind, old, new in changed}
    if earlier is not None and earlier.model is model:
        rows = replace(earlier.rows, given=state.rows.given)
    else:
        back = earlier and (earlier.model, earlier.rows)
        rows = followed(state.rows, state.model, model, changed, at, back)
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
        last_run=state.last_run and run_on(state.last_run, state.model, model),
        live=live,
        model=model,
        rows=rows,
        renames=remembered(state.renames, changed),
        clients=clients,
        request=request,
        playback=state.playback
        if live or (state.run is not None and _same_motion(state.model, model))
        else replace(state.playback, time=0.0, playing=False, preview=False),
    )


def run_on(run: Run, old: pg.Model, new: pg.Model) -> Run:
    """Carry a run over to the new model if an edit changed only names or appearance."""
    if run.model is not old or not _same_motion(old, new):
        return run
    result = run.result
    if hasattr(result, "mechanism"):
        result = replace(result, mechanism=pg.Mechanism(new))
    return replace(run, model=new, result=result)


def _same_motion(old: pg.Model, new: pg.Model) -> bool:
    """Return True if two models have the same motion, ignoring body names and visual shapes."""
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
    """Return a body without its purely visual parts."""
    touching = tuple(s.unchecked_copy({"role": "collision", "colour": None}) for s in body.touching)
    return body.unchecked_copy({"shapes": touching})


def _live_on(live: Live, old: pg.Model, new: pg.Model) -> Live:
    """Continue the live run of an edited model if its joints are unchanged, or else restart it."""

    def joints(model: pg.Model) -> list[tuple[str, str, int]]:
        return [(body.name, body.parent, len(body.q)) for body in model.bodies]

    return live if joints(old) == joints(new) else replace(live, parts=(), joined=(), falls=())


def _follows(client: Client, old: pg.Model, new: pg.Model) -> Client:
    """Transfer the page's selection to the new model, by name, or by row if a body was renamed."""
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
    """Rename the parts that a page has opened, listed or plotted."""
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
    """Return `state` with these bodies selected on one page, or unchanged if `body` is unknown."""
    if body is not None and body not in state.model.row:
        return state
    page, wanted = state.clients.get(client), {*bodies, body}
    if page is None:
        return state
    known = tuple(b.name for b in state.model.bodies if b.name in wanted)
    changed = replace(page, selection=body, selected=known, opened=None)
    return replace(state, clients={**state.clients, client: changed})


# -- names that changed ----------------------------------------------------------------------------


def renamed(old: pg.Model, new: pg.Model) -> Iterator[tuple[str, str, str]]:
    """Yield (kind, old name, new name) for each row that has been renamed."""
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


def remembered(
    renames: tuple[Rename, ...], changed: Iterable[tuple[str, str, str]]
) -> tuple[Rename, ...]:
    """Append the renames of an edit, given as (kind, old name, new name)."""
    last = renames[-1].number if renames else 0
    more = [Rename(last + k, *said) for k, said in enumerate(changed, 1)]
    return (*renames, *more)[-MOST_RENAMES:] if more else renames


def as_now(renames: Sequence[Rename], event: Any) -> Any:
    """Translate a page's event to the current names."""
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
    """Yield (field, kind, value) for the event fields that hold names of model parts."""
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


# -- rows that stay themselves ---------------------------------------------------------------------

Places = Sequence[int | None]  # former place of each row of a list, None for a new row


def followed(
    rows: Rows, old: pg.Model, new: pg.Model, renames: Iterable[tuple[str, str, str]],
    at: int | None = None, earlier: tuple[pg.Model, Rows] | None = None,
) -> Rows:  # fmt: skip
    """Return the row numbers after an edit from `old` to `new`.

    `renames` are (part, old name, new name); `at` is the place of the row that was edited, which
    decides between rows that are alike; what comes back is what it was in `earlier`.
    """
    known, given = dict(rows.known), dict(rows.given)

    def put(key: Key, before: int, places: Places, again: Sequence[int | None] = ()) -> None:
        had, found, new = rows.of(key, before), [], max(given.get(key, 0), before)
        for k, place in enumerate(places):
            number = had[place] if place is not None else again[k] if again else None
            if number is None:
                number, new = new, new + 1
            found.append(number)
        given[key] = new
        if tuple(found) == tuple(range(len(found))):
            known.pop(key, None)
        else:
            known[key] = tuple(found)

    said = {(part, now): was for part, was, now in renames}
    for part in LISTS:
        if getattr(old, part) is getattr(new, part):
            continue
        a, b = names_of(old, part), names_of(new, part)
        places: Places = range(len(a))
        if a != b:
            where = {name: k for k, name in enumerate(a)}
            places = [where.get(said.get((part, name), name)) for name in b]
            before = earlier[1].named(earlier[0], part) if earlier else {}
            put((part,), len(a), places, [before.get(name) for name in b])
        for k, place in enumerate(places if part in INNER else ()):
            if place is None:
                continue
            one, other = getattr(old, part)[place], getattr(new, part)[k]
            if one is not other:
                number = rows.of((part,), len(a))[place]
                for name, count, inner in INNER[part](one, other, at):
                    put((part, number, name), count, inner)
    a, b = old.ground.steps, new.ground.steps
    if a != b:
        put(("ground", "steps"), len(a), _kept(a, b, at))
    return Rows(known, given)


def _kept(old: Sequence[Any], new: Sequence[Any], at: int | None) -> Places:
    """Match rows without names: keep those before and after the inserted or removed ones."""
    few = min(len(old), len(new))
    if len(old) == len(new):
        return range(few)
    first = next((k for k in range(few) if old[k] != new[k]), few)
    last = next((k for k in range(few) if old[-1 - k] != new[-1 - k]), few)
    if first + last >= few:  # rows alike next to each other: the edit knows which it was about
        first = at if at is not None and few - last <= at <= first else first
        last = few - first
    return [
        k if k < first else k + len(old) - len(new) if k >= len(new) - last else None
        for k in range(len(new))
    ]


Inner = Iterator[tuple[str, int, Places]]  # name of a list, its length before, its places


def _of_contact(old: pg.Contact, new: pg.Contact, at: int | None) -> Inner:
    if old.points != new.points:
        yield "points", len(old.points), _kept(old.points, new.points, at)


def _of_body(old: pg.Body, new: pg.Body, at: int | None) -> Inner:
    if len(old.shapes) != len(new.shapes):
        yield "shapes", len(old.shapes), _kept(old.shapes, new.shapes, at)
    a, b = (x.motions if x.joint == "compound" else () for x in (old, new))
    if len(a) == len(b):
        return
    if not a or not b:  # a joint of another kind
        yield from ((name, 0, ()) for name in ("motions", "axes", "q", "v"))
        return
    places = _kept(a, b, at)
    yield "motions", len(a), places
    for i, name in enumerate(("q", "v", "axes")):
        before, now = ([(*SIZE[kind], kind in AXIAL)[i] for kind, _ in x] for x in (a, b))
        start = list(accumulate(before, initial=0))
        yield name, start[-1], [
            start[place] + k if place is not None and before[place] == count else None
            for place, count in zip(places, now) for k in range(count)
        ]  # fmt: skip


def _of_scenario(old: pg.Scenario, new: pg.Scenario, at: int | None) -> Inner:
    if old.switches != new.switches:
        yield "switches", len(old.switches), _kept(old.switches, new.switches, at)
    a, b = ([f.name for f in x.forces] for x in (old, new))
    if a != b:
        same = len(a) == len(b)
        where = {name: k for k, name in enumerate(a)}
        gone = [k for k, name in enumerate(a) if name not in b]
        rest = iter(gone if same else ())
        yield "forces", len(a), [where[name] if name in where else next(rest, None) for name in b]


INNER: Mapping[str, Any] = {"bodies": _of_body, "contacts": _of_contact, "scenarios": _of_scenario}
