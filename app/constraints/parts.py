"""Events that create and edit constraints, contacts, forces, sites, outputs and controls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pgraph_core as pg
from pgraph_core import joints
from pgraph_core.fields import PAIR
from pgraph_core.joints import SIZE
from pgraph_core.model.editing import free_name
from pgraph_core.model.expressions import Known
from pgraph_core.model.parameters import evaluated
from pgraph_core.signals import is_expression, parsed, with_names, written
from pgraph_core.signals.meaning import dim_of
from pgraph_core.units import NONE, UNITS

from ..core.cells import (
    Display,
    Quantity,
    Refusal,
    content,
    number,
    quantity_in,
    replaced,
    valid_name,
    whole,
)
from ..properties import beam_cells, track_cells
from . import (
    KINDS,
    WORD,
    Part,
    about,
    cables,
    cams,
    curves,
    imperfect_cells,
    optional,
    own_fields,
    places,
    relations,
    riding,
    takes_other,
    typed_as,
)
from .gains import GROUND, gains
from .muscles import lengths
from .places import Places

ALL_ON_GROUND = "* on ground"  # picked: a contact of every body with the ground
Item = Any  # pg.Constraint | pg.Contact | pg.Force | pg.Site | pg.Output

ON_BEAM = "_on_beam"  # ends the names of cells with the place of a body along a beam
FLAG = ("no", "yes")  # texts of false and true in a form
KIND_FIELD = {"constraints": "kind", "contacts": "law", "forces": "kind", "outputs": "kind",
              "controls": "kind"}  # fmt: skip
MAKE: dict[str, Any] = {
    "constraints": pg.Constraint, "contacts": pg.Contact, "forces": pg.Force,
}  # fmt: skip
# numbers of a new part that fit the place where it is put
FITTED = {"servo": lambda model, body, _: gains(model, body), "muscle": lengths}
CONTROLS: dict[str, Any] = pg.Control.KINDS


def item_of(model: pg.Model, part: Part, name: str) -> Item:
    """Return the part with that name. Raises Refusal."""
    found = next((x for x in getattr(model, part) if x.name == name), None)
    if found is None:
        raise Refusal(f"the {WORD[part]} '{name}' no longer exists")
    return found


def kind_of(part: Part, item: Item) -> str:
    """Return the kind of a constraint, force or output, or the law of a contact."""
    return "site" if part == "sites" else getattr(item, KIND_FIELD[part])


def quantity_of(model: pg.Model, item: Item, field: str) -> Quantity:
    """Return the physical quantity of a field. A setpoint has the quantity of its signal."""
    return quantity_in(unit_of(model, item, field))


def unit_of(model: pg.Model, item: Item, field: str) -> str:
    """Return the unit of a field. "angle" and "length" follow the units of the page."""
    if isinstance(item, pg.PID) and field == "setpoint" and is_expression(item.signal):
        return unit_of_signal(model, str(item.signal))
    return about(item, field).unit


def unit_of_signal(model: pg.Model, text: str) -> str:
    """Return the unit of an expression. "angle" and "length" follow the units of the page."""
    dim = dim_of(parsed(text), known_of(model).dim)
    return UNITS.get(NONE if dim is None else dim, "")


def known_of(model: pg.Model) -> Known:
    """Return the names that expressions in a model may use."""
    bodies = {b.name: b for b in model.standing}
    exerting = [c.name for c in model.constraints], [c.name for c in model.contacts]
    known = model.outputs, model.controls, model.parameters, model.forces
    return Known(bodies, *known, exerting, constraints=model.constraints)


# -- making ------------------------------------------------------------------------------------


def added(model: pg.Model, part: str, kind: str, body: str, other: str) -> tuple[pg.Model, str]:
    """Add a part with its required fields. Return (model, part's name). Raises PgraphError."""
    if part == "loops":
        model = model.close_loop(body, other, joint=kind)
        return model, model.constraints[-1].name
    if part == "limits":
        return model.edit(body, limits=_wide(model.body(body))), body
    called = "contact" if part == "contacts" else kind
    name = free_name(called, [x.name for x in getattr(model, part)])
    if part == "sites":
        return model.add(pg.Site(name=name, body=body)), name
    if part == "outputs":
        return model.add(pg.Output(name=name, kind=kind, at=body)), name  # type: ignore[arg-type]
    if part == "controls":
        made = pg.Control(name=name, kind=kind, **_reading(model, kind, body))
        return model.add(made), name
    data = {"name": name, KIND_FIELD[part]: kind, "body": body}  # type: ignore[index]
    if takes_other(part, kind):
        data["other"] = other
    item = MAKE[part](**data, **needed(model, part, kind, body, other))
    return model.add(item), name


def led(
    model: pg.Model, part: str, kind: str, way: Sequence[Any], closed: bool
) -> tuple[pg.Model, str]:
    """Add a cable or rope along bodies and points on them. Return (model, its name).

    Raises PgraphError.
    """
    name = free_name(kind, [x.name for x in getattr(model, part)])
    stations = [cables.station(model, body, point) for body, point in way]
    own = cables.begun(model, kind, stations, closed)
    return model.add(MAKE[part](**{"name": name, KIND_FIELD[part]: kind}, **own)), name  # type: ignore[index]


def needed(model: pg.Model, part: str, kind: str, body: str, other: str) -> dict[str, Any]:
    """Return the required fields for a new part, chosen so that the motion does not jump."""
    if cables.leads(kind):
        return cables.begun(model, kind, [cables.station(model, x) for x in (body, other)])
    own = MAKE[part].begun if part == "contacts" else MAKE[part].KINDS[kind].begun
    fitted = FITTED.get(kind)
    return {**own(model, body, other), **(fitted(model, body, other) if fitted else {})}


def _reading(model: pg.Model, kind: str, body: str) -> dict[str, Any]:
    """Return the required fields of a control, which reads the joint of `body` or the first one.

    Raises Refusal.
    """
    first = next((b for b in model.bodies if b.dof), None)
    of = model.body(body) if body in model.row and model.body(body).dof else first
    if of is None:
        raise Refusal("No joint to measure: add a body first.")
    group, own = "q" if joints.places(of.sequence)[0] is not None else "v", CONTROLS[kind]
    return {own.READS: "=" + written(group, of.name, 0 if of.dof > 1 else None), **own.NEW}


def _wide(body: pg.Body) -> tuple[Any, ...]:
    """Return limits of the usual reach to either side of the start. Raises Refusal."""
    bounds, start = [], 0
    for m in body.sequence:
        reach, q = joints.KINDS[m.kind].reach, body.q[start]
        bounds.append(None if reach is None else (min(-reach, q - reach), max(reach, q + reach)))
        start += SIZE[m.kind][0]
    if not any(bounds):
        text = f"the {body.joint} joint of '{body.name}' has no motion that a limit could bound"
        raise Refusal(f"{text}; choose a body that turns or slides")
    return tuple(bounds)


# -- reading -----------------------------------------------------------------------------------


# -- changing ----------------------------------------------------------------------------------


def changed(
    model: pg.Model,
    part: Part,
    name: str,
    field: str,
    entries: Sequence[tuple[tuple[int, ...], str]],
    display: Display,
    at: Places,
) -> pg.Model:
    """Return the model with typed text applied to a part's cells. Raises Refusal, PgraphError."""
    item = item_of(model, part, name)
    data = model.cells(item, part)
    if field == "name":
        return renamed(model, part, name, entries[0][1].strip())
    if field.endswith(ON_BEAM):
        slot = field.removesuffix(ON_BEAM)
        field, entries = slot, [((), beam_cells.placed(model, data[slot], entries[0][1]))]
    if field in ("kind", "law"):
        return _put(model, part, name, rekinded(model, part, item, entries[0][1]))
    if field == "follower" and isinstance(item, pg.Cam):
        return _put(model, part, name, cams.followed(data, entries[0][1]))
    if field in (*PAIR, "at") or typed_as(item, field)[0] == "choice":
        chosen = entries[0][1] or (None if optional(item, field) else "")
        return _put(model, part, name, on_joint(model, item, data, {field: chosen}))
    for index, text in entries:
        data = _typed(model, item, data, field, index, text, display, at)
    return _put(model, part, name, data)


def on_joint(
    model: pg.Model, item: Item, data: dict[str, Any], changes: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the fields of a part with another body, other body, site or coordinate.

    References to the joint are updated to the new one. Prescribed motions and servo targets start
    at the current position of that joint, unless they are expressions.
    """
    data = {**data, **changes}
    if isinstance(item, pg.Relation) and "other" in changes and isinstance(item.curve, str):
        data["curve"] = with_names(item.curve, {item.other: changes["other"]}, ("q",))
    body: str = data.get("body", "")
    if body not in model.row or not {"body", "coordinate"} & changes.keys():
        return data
    if "body" in changes and data.get("coefficients"):
        row = next(iter(data["coefficients"].values()))
        fits = len(row) == model.body(body).dof
        data["coefficients"] = {body: row if fits else _unit_row(model, body)}
    for field in ("q_of_t", "target"):
        curve = data.get(field)
        if curve is not None and not isinstance(curve, str):
            terms = [(body, data.get("coordinate", 0), 1.0)]
            if rows := data.get("coefficients"):
                terms = [(name, k, by) for name, row in rows.items() for k, by in enumerate(row)]
            data[field] = curves.moved(curve, model, terms)
    return data


def _typed(
    model: pg.Model,
    item: Item,
    data: dict[str, Any],
    field: str,
    index: tuple[int, ...],
    text: str,
    display: Display,
    at: Places,
) -> dict[str, Any]:
    of = quantity_of(model, item, field)
    form, bounds = typed_as(item, field)
    match field:
        case _ if form == "whole":
            return on_joint(model, item, data, {field: whole(text, *bounds)})
        case _ if form == "flag":
            return {**data, field: text == FLAG[True]}
        case "lift_is":
            return {**data, "motion": cams.given_as(item, text)}
        case "motion":
            return {**data, "motion": cams.motion_of(model, item, text, display)}
        case "function":
            return {**data, "curve": relations.rekinded(item.curve, text)}
        case _ if field.startswith("track_") and isinstance(item, pg.CurvePoint):
            return {**data, "curve": track_cells.changed(item.curve, field, text, display)}
        case _ if field.startswith(imperfect_cells.PREFIX):
            return {**data, "imperfect": imperfect_cells.changed(item.imperfect, field, text)}
        case "curve" if isinstance(item, pg.Relation):
            return {**data, "curve": relations.curve_of(model, item, text, display)}
        case "curve":
            return {**data, "q_of_t": curves.timed(item.q_of_t, text)}
        case "table" | "expression":
            typed = field == "expression" or is_expression(text)
            return {**data, "q_of_t": text.strip() if typed else curves.table_of(text, 1)}
        case "sine":
            key = ("mean", "amplitude", "frequency", "phase")[index[0]]
            value = number(text) if index[0] > 1 else curves.moved_by(model, item, text)
            return {**data, "q_of_t": {**dict(curves.plain(data["q_of_t"])), key: value}}
        case "polynomial":
            k = index[0]
            old = (*curves.plain(data["q_of_t"])["coefficients"], 0.0, 0.0, 0.0, 0.0)[:4]
            value = number(text) if k > 1 else curves.moved_by(model, item, text, rate=k == 1)
            new = replaced(old, index, value)
            return {**data, "q_of_t": {"kind": "polynomial", "coefficients": new}}
        case "torque_over" | "force_over":
            return {**data, field[:-5]: curves.over(getattr(item, field[:-5]), text)}
        case "torque" | "force" if not index and getattr(item, "kind", "") == "wrench":
            return {**data, field: curves.table_of(text, 3)}
        case "shape":
            return {**data, field: shape_of(text)}
        case "torque" | "target" | "speed" | "input" | "excitation" if not index:
            if is_expression(text):
                return {**data, field: text.strip()}
            if ";" in text or len(text.split()) > 1:
                return {**data, field: curves.table_of(text, 1)}
            return {**data, field: content(text, of, display)}
        case "points":
            return {**data, "points": places.points(model, item, data, index, text, display)}
        case "coefficients":
            return _coefficients(model, data, index, text)
        case "through":
            return {**data, field: cables.changed(model, data, index, text, display)}
        case "shifts" | "other_shifts":
            return {**data, field: riding.shifts_of(model, text)}
        case _ if field in getattr(item, "PLACES", ()):
            return {**data, field: places.path(model, item, data[field], index, text, display, at)}
        case _ if form == "rows":
            return {**data, field: curves.rows_of(getattr(item, field), text)}
    if not text.strip():
        return {**data, field: None}
    new = content(text, of, display)
    if field == "kd" and isinstance(item, pg.PID) and item.filter is None and item.kp:
        data["filter"] = abs(valued(model, new) / (10 * item.kp)) or None  # a common value
    if not index:
        return {**data, field: new}
    old = data.get(field) or places.implied(model, item, field, at) or (0.0, 0.0, 0.0)
    return {**data, field: replaced(tuple(old), index, new)}


def valued(model: pg.Model, given: float | str) -> float:
    """Return a number, or the value of a formula. Raises Refusal."""
    try:
        return evaluated(given, model.parameters) if isinstance(given, str) else given
    except ValueError as problem:
        raise Refusal(str(problem)) from None


def shape_of(text: str) -> dict[str, float]:
    """Return names with numbers from a text such as 'tendon_strain 0.04; active_width 0.5'."""
    found = dict[str, float]()
    for one in filter(None, map(str.strip, text.split(";"))):
        name, _, value = one.replace("=", " ").partition(" ")
        found[name] = number(value)
    return found


def _coefficients(
    model: pg.Model, data: dict[str, Any], index: tuple[int, ...], text: str
) -> dict[str, Any]:
    """Set a coefficient in a sum over joints. Without an index, add or remove a body.

    A part that acts on the only joint of its body keeps it when the body gets another joint.
    """
    rows = dict(data["coefficients"])
    if not index:
        if text in rows:
            del rows[text]
        else:
            rows = rows or {data["body"]: _unit_row(model, data["body"], data["coordinate"])}
            rows[text] = _unit_row(model, text)
    elif index[0] >= len(rows):
        raise Refusal("no longer has this body")
    else:
        name = list(rows)[index[0]]
        rows[name] = replaced(tuple(rows[name]), index[1:], content(text, "number", Display()))
    if not rows and data["kind"] in ("velocity", "coupling", "tendon"):
        raise Refusal("needs at least one body")
    if not rows:
        return {**data, "coefficients": {}}
    return {**data, "coefficients": rows, "body": next(iter(rows))}


def _unit_row(model: pg.Model, body: str, coordinate: int = 0) -> tuple[float, ...]:
    """Return coefficients that select one coordinate of a joint."""
    return tuple(float(i == coordinate) for i in range(model.body(body).dof))


def rekinded(model: pg.Model, part: Part, item: Item, kind: str) -> dict[str, Any]:
    """Convert a part's fields to another kind, keeping compatible ones and adding required ones."""
    if kind not in KINDS[part]:
        raise Refusal(f"must be one of {', '.join(KINDS[part])}")
    if kind == kind_of(part, item):
        return model.cells(item, part)
    if part == "outputs":
        return {"name": item.name, "kind": kind, "at": item.at, "imperfect": item.imperfect}
    if part == "controls":
        cells, names = model.cells(item, part), pg.Control.KINDS[kind].model_fields
        kept = {k: x for k, x in cells.items() if k in names and x is not None}
        read = {CONTROLS[kind].READS: cells[item.READS]}
        return {**CONTROLS[kind].NEW, **kept, **read, "kind": kind}
    other = getattr(item, "other", GROUND)
    fresh = {"name": item.name, KIND_FIELD[part]: kind, "body": item.body}
    if takes_other(part, kind):
        fresh["other"] = other
    old = model.cells(item, part)
    own = needed(model, part, kind, item.body, other)
    draft = MAKE[part](**fresh, **own)
    same = {
        key: old[key]
        for key in own_fields(draft)
        if old.get(key) not in (None, {}) and key not in (*fresh, "rest", "torque", "stiffness")
    }
    if kind in ("line", "plane") and "axis" in same:  # one direction of the two
        (same if "other_axis" in same else own).pop(
            "axis" if "other_axis" in same else "other_axis", None
        )
    if kind == "universal" and ("axis" in same) != ("other_axis" in same):
        same = {k: x for k, x in same.items() if k not in ("axis", "other_axis")}
    if part == "contacts":
        same["points"] = old["points"]
    active = {"active": item.active} if hasattr(item, "active") else {}
    return {**own, **fresh, **same, **active}


def _put(model: pg.Model, part: Part, name: str, data: Mapping[str, Any]) -> pg.Model:
    """Return the model with one part replaced by the given fields."""
    items = tuple(dict(data) if x.name == name else x for x in getattr(model, part))
    return model.replace(**{part: items})


def acting(model: pg.Model, part: Part, scenario: str) -> tuple[frozenset[str], bool]:
    """Return the initially active constraints or contacts, and whether they are selected by a
    scenario."""
    chosen = next((s for s in model.scenarios if s.name == scenario), None)
    listed = getattr(chosen, part, None)
    if listed is None:
        return frozenset(x.name for x in getattr(model, part) if x.active), False
    return frozenset(listed), True


def switched(model: pg.Model, part: Part, name: str, on: bool, scenario: str) -> pg.Model:
    """Return the model with a constraint or contact on or off at the start.

    The scenario is changed if it has a list of active elements. Otherwise the model is changed.
    """
    item_of(model, part, name)
    now, of_scenario = acting(model, part, scenario)
    if not of_scenario:
        return model.edit(name, kind=WORD[part], active=on)
    now = now | {name} if on else now - {name}
    kept = tuple(x.name for x in getattr(model, part) if x.name in now)
    return model.edit(scenario, kind="scenario", **{part: kept})


def renamed(model: pg.Model, part: Part, name: str, new: str) -> pg.Model:
    """Rename a part in the model and its scenarios. Raises Refusal, PgraphError."""
    return model.edit(item_of(model, part, name).name, kind=WORD[part], name=valid_name(new))


def removed(model: pg.Model, part: Part, name: str) -> pg.Model:
    """Return the model without a part and everything that refers to it."""
    return model.remove(item_of(model, part, name).name, kind=WORD[part])


def duplicated(model: pg.Model, part: Part, name: str) -> pg.Model:
    """Return the model with a copy of a part below the original."""
    item = item_of(model, part, name)
    new = free_name(name, [x.name for x in getattr(model, part)])
    copy = {**model.cells(item, part), "name": new}
    items = getattr(model, part)
    i = items.index(item) + 1
    return model.replace(**{part: (*items[:i], copy, *items[i:])})
