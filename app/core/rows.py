"""Rows of lists that keep their numbers whatever is put in, taken out, moved or renamed.

A list that was not changed since the model was opened counts its rows from 0. Inserted rows get a
new number. Pages use row numbers: text typed into a row belongs to that row, even if it has moved
by then.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate
from typing import Any

import pgraph_core as pg
from pgraph_core.joints import AXIAL, SIZE
from pgraph_core.model.checks import PARTS

from .cells import Payload, Refusal

Key = tuple[Any, ...]  # ("bodies",), ("contacts", number of a contact, "points")
LISTS = (*PARTS, "parameters")  # lists of a model whose rows have names
MORE = "more"  # stands for the number of a new row
OF_MOTIONS = {"axes": "axes", "q": "q", "v": "v", **dict.fromkeys((
    "motions", "limits", "stiffness", "damping", "rest", "friction", "armature",
    "limit_restitution", "pitch",
), "motions")}  # fmt: skip


@dataclass(frozen=True)
class Rows:
    """The row numbers for every list that was changed."""

    known: Mapping[Key, tuple[int, ...]] = field(default_factory=dict)
    given: Mapping[Key, int] = field(default_factory=dict)  # numbers below were given to a row

    def of(self, key: Key, count: int) -> tuple[int, ...]:
        """Return the row numbers for a list of this length, in order."""
        known = self.known.get(key)
        return known if known is not None and len(known) == count else tuple(range(count))

    def named(self, model: pg.Model, part: str) -> dict[str, int]:
        """Return a mapping from the names of bodies, constraints, ... to their row numbers."""
        names = names_of(model, part)
        return dict(zip(names, self.of((part,), len(names))))


def names_of(model: pg.Model, part: str) -> tuple[str, ...]:
    found = getattr(model, part)
    return tuple(found) if part == "parameters" else tuple(x.name for x in found)


GONE = "The row was deleted meanwhile, so the typed value was not used."
UNLIKE = "The selected bodies now have different shapes: select one of them."
# Field of a shape: its number, or one for each selected body if they differ; its name.
SHAPE = re.compile(r"shape_(?:((?:\d+|more)(?:\.(?:\d+|more))*)_)?([a-z_]+)")


def numbers(
    rows: Rows, model: pg.Model, part: str, name: str, field: str, among: Sequence[Any] = ()
) -> tuple[int, ...] | None:
    """Return the row numbers for the first index of a field, or None.

    `part` is also "ground", or "scenario" for the cells of a scenario, whose forces are `among`.
    Raises Refusal, or PgraphError if the part no longer exists.
    """
    match part, field:
        case "ground", "steps":
            return rows.of(("ground", "steps"), len(model.ground.steps))
        case "scenario", "q" | "v":
            return rows.of(("bodies",), len(model.bodies))
        case "scenario", "constraints" | "contacts":
            return rows.of((field,), len(getattr(model, field)))
        case "bodies", _ if field in OF_MOTIONS or field == "shapes":
            body, inner = model.body(name), OF_MOTIONS.get(field, field)
            if field != "shapes" and body.joint != "compound":
                return None
            number = rows.of(("bodies",), len(model.bodies))[model.row[name]]
            key = ("bodies", number, inner)
            return rows.of(key, len(getattr(body, inner)))
        case _, "points" | "coefficients":
            item = next((x for x in among or getattr(model, part) if x.name == name), None)
            if item is None:
                raise Refusal(GONE)
            if field == "points":
                key = (part, rows.named(model, part)[name], field)
                return rows.of(key, len(item.points))
            bodies = rows.named(model, "bodies")
            return tuple(bodies[body] for body in item.coefficients)
    return None


def by_number(
    groups: list[Payload], rows: Rows, model: pg.Model, part: str, name: str = "",
    among: Sequence[Any] = (),
) -> list[Payload]:  # fmt: skip
    """Return a form whose rows are identified by row number instead of position."""
    for f in (f for g in groups for f in g["fields"]):
        known = numbers(rows, model, part, name, f["field"], among)
        for one in [*f["cells"], *(b["fields"] for b in f["buttons"])]:
            at = one.get("index")
            if known and at and at[0] < len(known):
                one |= {"index": [known[at[0]], *at[1:]], "at": at}
        first = {c["index"][0] for c in f["cells"] if c["index"]}
        if known and len(first) == 1:
            f["row"] = first.pop()
    return shapes_by_number(groups, rows, model, (name,)) if part == "bodies" else groups


def shapes_by_number(
    groups: list[Payload], rows: Rows, model: pg.Model, names: Sequence[str]
) -> list[Payload]:
    """Return a body form whose shapes are identified by row number instead of position."""
    lists = [numbers(rows, model, "bodies", name, "shapes") or () for name in names]
    for f in (f for g in groups for f in g["fields"]):
        for one in [f, *(b["fields"] for b in f["buttons"])]:
            if (found := SHAPE.fullmatch(one.get("field", ""))) and any(lists):
                at = int(found[1] or 0)
                each = [str(known[at]) if at < len(known) else MORE for known in lists]
                number = each[0] if len(set(each)) == 1 else ".".join(each)
                one["field"] = (
                    "shape_" + found[2] if number == "0" else f"shape_{number}_{found[2]}"
                )
    for g in groups:
        if g["fields"][0]["field"].startswith("shape_"):
            g["id"] = g["fields"][0]["field"]
    return groups


def placed(rows: Rows, model: pg.Model, chosen: str, event: Any) -> Any:
    """Replace row numbers in a page's event by current positions. Raises Refusal, PgraphError.

    `chosen` is the scenario of an event that names none.
    """
    fields, among, part, name = vars(event), (), "", ""
    typed = {"serial", "field"} <= fields.keys() and ({"entries", "index"} & fields.keys())
    if not typed and "number" not in fields:
        return event
    if not isinstance(fields.get("scenario", ""), str):
        called = scenario(rows, model, chosen, event)
        s = next((s for s in model.scenarios if s.name == called), None)
        if s is None:
            return event
        if "number" in fields:
            key = ("scenarios", rows.named(model, "scenarios")[called], "switches")
            return replace(event, number=_place(rows.of(key, len(s.switches)), event.number))
        part, among = "scenario", s.forces
        if "name" in fields:
            part, name = "forces", event.name
    elif "bodies" in fields and len(event.bodies) == 1:
        part, name = "bodies", event.bodies[0]
    elif "bodies" in fields and SHAPE.fullmatch(event.field):
        return replace(event, field=_shape_field(rows, model, event.bodies, event.field))
    elif "part" in fields:
        part, name = event.part, event.name
    elif not {"bodies", "body"} & fields.keys():
        part = "ground"
    if not part:
        return event
    if "index" in fields:
        field, index = place_of(rows, model, part, name, event.field, event.index, among)
        return replace(event, field=field, index=index)
    found = [place_of(rows, model, part, name, event.field, at, among) for at, _ in event.entries]
    entries = tuple((index, text) for (_, index), (_, text) in zip(found, event.entries))
    return replace(event, field=found[0][0], entries=entries)


def place_of(
    rows: Rows, model: pg.Model, part: str, name: str, field: str, index: tuple[int, ...],
    among: Sequence[Any] = (),
) -> tuple[str, tuple[int, ...]]:  # fmt: skip
    """Translate a page's field and index to current positions.

    Raises Refusal, PgraphError.
    """
    if part == "bodies" and SHAPE.fullmatch(field):
        return _shape_field(rows, model, (name,), field), index
    known = numbers(rows, model, part, name, field, among)
    return field, (_place(known, index[0]), *index[1:]) if known is not None and index else index


def _shape_field(rows: Rows, model: pg.Model, names: Sequence[str], field: str) -> str:
    """Translate a shape field to its current position, which must agree for all these bodies."""
    found = SHAPE.fullmatch(field)
    assert found
    each = (found[1] or "0").split(".")
    places = set[int]()
    for name, number in zip(names, each if len(each) > 1 else each * len(names)):
        known = numbers(rows, model, "bodies", name, "shapes") or ()
        places.add(len(known) if number == MORE or not known else _place(known, int(number)))
    if len(places) != 1 or len(each) not in (1, len(names)):
        raise Refusal(UNLIKE)
    at = places.pop()
    return f"shape_{at}_{found[2]}" if at else f"shape_{found[2]}"


def _place(known: tuple[int, ...], number: int) -> int:
    if number not in known:
        raise Refusal(GONE)
    return known.index(number)


def scenario(rows: Rows, model: pg.Model, chosen: str, event: Any) -> str:
    """Return the scenario that an event names by its number, or `chosen` if it names none.

    Raises Refusal if it is gone.
    """
    if event.scenario is None:
        return chosen
    known = {number: name for name, number in rows.named(model, "scenarios").items()}
    if event.scenario not in known:
        raise Refusal("The scenario was deleted meanwhile.")
    return known[event.scenario]


def touched(event: Any) -> int | None:
    """Return the position of the row that an edit affects, as needed by `followed`."""
    if (number := getattr(event, "number", None)) is not None:
        return number
    entries = getattr(event, "entries", ())
    index = entries[0][0] if entries else getattr(event, "index", ())
    if found := SHAPE.fullmatch(getattr(event, "field", "")):
        return int(found[1] or 0)
    return index[0] if index else None


# -- rows after an edit ----------------------------------------------------------------------------

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
