"""The constraints tab: parts on bodies, and the remaining mobility."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.forces import BetweenPoints, Driven, OnJoint
from pgraph_core.joints import slides
from pgraph_core.model.joint_constraint import OfOne, OfTwo

from ..core.cells import (
    Display,
    Quantity,
    button,
    cell,
    choice,
    components,
    field,
    group,
    shown,
)
from ..core.views import Host, Payload, Place, topic
from ..pose.solving import degrees
from ..pose.view import moment
from ..properties import beam_cells, track_cells
from . import (
    CELLS,
    KINDS,
    TITLES,
    WORD,
    Client,
    Part,
    Picking,
    State,
    about,
    arms,
    cables,
    cams,
    curves,
    imperfect_cells,
    of_path,
    optional,
    own_fields,
    parts,
    path_rows,
    pictures,
    places,
    rare,
    relations,
    riding,
    typed_as,
    varies,
)
from .gains import EVERY, GROUND
from .mobility import mobility_report
from .update import allowed, is_way

LISTS: tuple[Part, ...] = ("constraints", "contacts", "forces", "sites", "outputs", "controls")
PARTS = ("derived", "mobility", "mobility_asked", "errands", "request")
RESPONSE = button("step response …", "AskResponse", "Of the signal, to a step of the setpoint")
FEEDBACK = button("feedback …", "Feedback", "Gains that hold the pose shown: LQR, pole placement")
USUAL = (
    ("constraints", "point"), ("constraints", "motion"), ("loops", "revolute"),
    ("contacts", "complementarity"), ("forces", "motor"), ("forces", "servo"),
    ("forces", "spring"), ("limits", "limits"),
)  # fmt: skip
OVER_TIME = "over time: 0 0; 1 0.5 is 0 at 0 s, 0.5 at 1 s; or an expression after ="
MOST_NAMED = 4  # bodies of a new cable that its banner names
OF_SIX = ("x", "y", "z", "about x", "about y", "about z")  # entries of a 6 by 6 matrix
FUNCTIONS = {  # notes on the text of each kind of curve
    **{
        kind: f"x value; x value; ... [{{}}] [{{}}], or with units: 0 0; 90deg 12mm; {text}"
        for kind, text in (
            ("natural", "goes on as straight lines"),
            ("clamped", "without slope at its ends"),
            ("periodic", "repeats its slope"),
            ("quintic", "rests beyond its ends"),
        )
    },
    "hermite": "x value slope; ... [{}] [{}], the slopes in SI units: 0 0 1; 90deg 12mm 0",
    "polynomial": "c0 c1 c2 ... up to c7, of c0 + c1 x + c2 x² + ... [{}] [{}]",
    "expression": "=... of q, the coordinate of the other body: =0.02*(1-cos(q))",
}
Q_OF_T = {
    "sine": ("mean [{}]", "amplitude [{}]", "frequency [rad/s]", "phase [rad]"),
    "polynomial": ("c0 [{}]", "c1 [{}/s]", "c2 [{}/s²]", "c3 [{}/s³]"),
}


def _seen(state: State, page: Client) -> tuple[Any, ...]:
    """Return the part of the client state that this tab depends on."""
    item = pictures.open_relation(state, page)
    window = () if item is None else pictures.window(state, item)
    return (page.picking, page.opened, page.listed, page.called, page.display, window)


def constraints(state: State, page: Client) -> Payload:
    """Return the lists of parts, the opened part's form, the report, and the picking state."""
    return {
        "listed": page.listed,
        "called": page.called,
        "kinds": choices(),
        "lists": [_list(state, page, part) for part in LISTS],
        "limits": _limits(state, page),
        "picking": _picking(state.model, page.picking),
        "mobility": mobility_report(state),
        "assembling": bool(state.errands),
        "display": vars(page.display),
    }


def choices() -> list[Payload]:
    """Return all kinds that can be added, in titled groups. The usual ones come first."""
    groups = {"Often used": list(USUAL)}
    for part, title in TITLES.items():
        groups[title] = [(part, kind) for kind in KINDS[part] if (part, kind) not in USUAL]
    return [
        {
            "title": title,
            "kinds": [
                {"part": part, "kind": kind, "name": f"{kind} loop" if part == "loops" else kind,
                 "about": KINDS[part][kind]}
                for part, kind in kinds
            ],
        }
        for title, kinds in groups.items() if kinds
    ]  # fmt: skip


def _list(state: State, page: Client, part: Part) -> Payload:
    """Return one line per part (name, kind, bodies), and all fields for the opened one."""
    items = [x for x in getattr(state.model, part) if _touches(x, page.listed, state.model)]
    number, name = state.rows.named(state.model, part), state.request.scenario
    switches = part in ("constraints", "contacts")
    on, there = parts.acting(state.model, part, name) if switches else (None, False)
    lines = [
        {
            "id": number[x.name],
            "name": x.name,
            "kind": parts.kind_of(part, x),
            "between": between(x),
            "bodies": [
                *dict.fromkeys(state.row_of(n) for n in _bodies(x) if n in state.derived.number)
            ],
            "active": None if on is None else x.name in on,
            "form": form(state, page.display, part, x) if page.opened == (part, x.name) else None,
        }
        for x in items
    ]
    return {
        "part": part, "title": part.capitalize(), "items": lines, "of": name if there else "",
    }  # fmt: skip


def _bodies(item: Any) -> tuple[str, ...]:
    """Return the bodies on which a part acts."""
    return item.touches


def _touches(item: Any, name: str | None, model: pg.Model) -> bool:
    if name is None or name in (model.beam_of.get(one, one) for one in _bodies(item)):
        return True
    everyone = isinstance(item, pg.Contact) and EVERY in _bodies(item)
    return everyone and bool(model.body(name).touching)


def between(item: Any) -> str:
    """Return the bodies on which a part acts as text: 'thigh, shin' or 'foot, ground'.

    A path names each body once where several of its points follow each other on it.
    """
    if coefficients := getattr(item, "coefficients", None):
        return ", ".join(coefficients)
    if isinstance(item, pg.Control):
        return f"{getattr(item, item.READS)}".removeprefix("=")
    if isinstance(item, (pg.Site, pg.Output)):
        return item.body if isinstance(item, pg.Site) else item.at
    if "through" in type(item).model_fields:
        return _led(station.body for station in item.through)
    names = {EVERY: "all bodies"}
    first, other = (names.get(name) or name for name in item.pair)
    alone = "other" not in type(item).model_fields or isinstance(item, pg.Skate)
    return first if alone else _led((first, *(place.body for place in item._places), other))


def _led(bodies: Iterable[str]) -> str:
    return ", ".join(name for name, _ in groupby(bodies))


def _limits(state: State, page: Client) -> list[Payload]:
    """Return the joint limits, with one form per body."""
    found = []
    for body in state.model.bodies:
        if not any(body.limits) or page.listed not in (None, body.name):
            continue
        texts = [
            _bounds(pair, "length" if slides(m) else "angle", page.display)
            for pair, m in zip(body.limits, body.sequence) if pair is not None
        ]  # fmt: skip
        found.append({"body": body.name, "text": "; ".join(texts)})
    return found


def _bounds(pair: tuple[float | None, ...], of: Quantity, display: Display) -> str:
    """Format a range such as "-1.5 to 1.5 rad", with "open" for an infinite end."""
    low, high = ("open" if x is None else f"{display.shown(x, of):.4g}" for x in pair)
    return f"{low} to {high} {display.unit(of)}"


def _way(model: pg.Model, picking: Picking) -> Payload:
    """Return the banner of a new cable or rope: its bodies, and what to click next."""
    there = [name for name, _ in picking.way if name == GROUND or name in model.row]
    wheels = [bool(cables.station(model, name).get("radius")) for name in there]
    names = [f"{name} (wheel)" if wheel else name for name, wheel in zip(there, wheels)]
    text = f"A new {picking.kind}: click the body where it begins, in the digraph, the table or "
    text += "the 3D view."
    if names:
        more = "… → " if len(names) > MOST_NAMED else ""
        text = f"{more}{' → '.join(names[-MOST_NAMED:])} → click the next body."
    many = len(names) > 1
    belt = [["Belt", True]] if many and all(wheels) else []
    return {
        "text": text, "names": [[GROUND, "ground"]], "first": None, "back": bool(names),
        "ends": [*belt, *([["Done", False]] if many else [])],
    }  # fmt: skip


def _picking(model: pg.Model, picking: Picking | None) -> Payload | None:
    """Return the picking banner, with instructions and alternatives to clicking."""
    if picking is None:
        return None
    if is_way(picking):
        return _way(model, picking)
    slots = {"body": "the body", "other": "the other body"}
    word = WORD.get(picking.part, "limit")
    what = f"{picking.kind} {word}" if picking.part not in ("loops", "limits") else word
    if picking.part == "loops":
        what = f"loop, cut at a {picking.kind} joint,"
        slots = {"body": "the body", "other": "its second parent"}
    elif picking.part == "constraints" and issubclass(pg.Constraint.KINDS[picking.kind], OfTwo):
        slots = {"body": "the body that follows", "other": "the body that it follows"}
    of = f"'{picking.name}'" if picking.name else f"A new {what}"
    if picking.part == "limits":
        of = "A joint limit"
    bodies = f"'{picking.body}'"
    if picking.more:
        of, bodies = f"{of} each", f"{len(picking.more) + 1} bodies"
    about = f"{of} on {bodies}" if picking.body else of.rstrip(",")
    text = f"{about}: click {slots[picking.slot]} in the digraph, the table or the 3D view."
    labels = {
        GROUND: "ground",
        EVERY: "every body with a shape",
        parts.ALL_ON_GROUND: "all bodies with the ground",
    }
    names = [[name, labels[name]] for name in allowed(picking)]
    return {"text": text, "names": names, "first": picking.body}


# -- the form of one part ----------------------------------------------------------------------


def form(state: State, display: Display, part: Part, item: Any) -> list[Payload]:
    """Return the relevant fields of a part."""
    at = places.at_home(state.derived.names, state.derived.positions, state.derived.wxyz)
    cells, kind = state.model.cells(item, part), parts.kind_of(part, item)
    found, more = [field("name", "Name", [cell((), item.name)], kind="text")], []
    if problem := cables.faults(state.model).get(item.name) if cables.leads(kind) else "":
        text = f"{problem[:1].upper()}{problem[1:]}."
        found.append(field("through", "", [], note=text, bad=True))
    points = of_path(item)
    for name in own_fields(item):
        if name not in points:
            here = more if rare(item, name) else found
            here += _field(state, part, item, name, cells, display, at)
    if isinstance(item, pg.PID):
        found.append(field("response", "", [], buttons=[RESPONSE]))
    path = [one for name in points for one in _field(state, part, item, name, cells, display, at)]
    return [
        group("", found),
        *([group("More", more, False)] if more else []),
        *([path_rows.grouped(item, path)] if path else []),
        *([imperfect_cells.grouped(item)] if isinstance(item, pg.Output) else []),
        *(
            arms.grouped(state.model, item, state.derived.size, display)
            if isinstance(item, BetweenPoints)
            else []
        ),
    ]


def _field(
    state: State, part: Part, item: Any, name: str, cells: Any, display: Display, at: Any
) -> list[Payload]:
    model, kind = state.model, parts.kind_of(part, item)
    match name:
        case "kind" | "law":
            options = list(KINDS[part])
            return [choice(name, about(item, name).label, kind, options, help=KINDS[part][kind],
                           note=KINDS[part][kind])]  # fmt: skip
        case "body" | "other" | "at":
            on = beam_cells.place_row(model, name + parts.ON_BEAM, getattr(item, name))
            return [_name_field(model, part, item, name), *on]
        case "q_of_t":
            return _curve(model, item)
        case "curve" if isinstance(item, pg.CurvePoint):
            return _track(item, display)
        case "curve":
            return _function(state, item, display)
        case "motion":
            return _lift(state.model, item, display)
        case "interpolation" if not isinstance(item.q_of_t, pg.Table):
            return []
        case "coefficients":
            return _coefficients(item, cells)
        case "points":
            return _points(item, cells, display)
        case "through":
            return path_rows.stations(model, item, cells[name], display)
        case "shifts" | "other_shifts" if not getattr(item, name):
            return []
        case "shifts" | "other_shifts":
            shows, text = about(item, name), riding.text_of_shifts(getattr(item, name))
            return [field(name, shows.label, [cell((), text)], kind="text",
                          help=f"{shows.help}: {riding.SAYS}")]  # fmt: skip
        case _ if name in getattr(item, "PLACES", ()):
            return path_rows.path(model, item, name, cells, display, at)
        case "shape":
            usual = "; ".join(f"{key} {x:g}" for key, x in item.kind_of.shape.items())
            text = "; ".join(f"{key} {x:g}" for key, x in item.shape.items())
            shows = about(item, name)
            return [field(name, shows.label, [cell((), text)], kind="text", help=shows.help,
                          note=f"names with numbers, of {usual}")]  # fmt: skip
        case _ if name in over_time_of(item):
            shows = about(item, name)
            feeds = isinstance(item, OnJoint) and name == item.INPUT
            found = [field("feedback", "", [], buttons=[FEEDBACK])] if feeds else []
            return [field(name, shows.label, [cell((), curves.knots(cells[name]))],
                          unit=_unit(model, item, shows.unit), help=shows.help, kind="text",
                          note=OVER_TIME, expression=True), *found]  # fmt: skip
        case "coordinate" | "other_coordinate" if isinstance(item, (OnJoint, OfOne)):
            return [_motion_field(model, item, name)]
        case "torque" | "force":
            return _over_time(item, name, cells)
    form, options = typed_as(item, name)
    if form == "choice":
        shows, none = about(item, name), [("", "default")] if optional(item, name) else []
        return [choice(name, shows.label, getattr(item, name), (*none, *options), help=shows.help)]
    if form == "rows":
        shows = about(item, name)
        return [field(name, shows.label, [cell((), curves.rows(cells.get(name)))], unit=shows.unit,
                      help=shows.help, kind="text", note=shows.help)]  # fmt: skip
    if form == "flag":
        shows, value = about(item, name), parts.FLAG[getattr(item, name)]
        return [choice(name, shows.label, value, parts.FLAG, help=shows.help)]
    return [_plain(model, item, name, cells, display, at)]


def over_time_of(item: Any) -> tuple[str, ...]:
    """Return the fields that take a number, a table over time or an expression."""
    if isinstance(item, OnJoint):
        return "torque", item.INPUT
    return (item.INPUT,) if isinstance(item, Driven) else ()


def _name_field(model: pg.Model, part: Part, item: Any, name: str) -> Payload:
    """Return a drop-down list of bodies with a pick button, and of sites for `at`."""
    if name == "at":
        sites = [site.name for site in model.sites]
        return field(name, about(item, name).label, [cell((), item.at)], kind="names",
                     options=[GROUND, *sites])  # fmt: skip
    extra = []
    if name == "other":
        extra = [] if isinstance(item, OfTwo) else [GROUND]
    if part == "contacts":
        extra.append(EVERY)
    if part == "sites":
        extra = [GROUND]
    pick = button("Pick", "Pick", "click the body in the digraph, the table or 3D", slot=name)
    body = getattr(item, name)
    row = [cell((), model.beam_of.get(body, body))]
    return field(name, about(item, name).label, row, kind="names",
                 options=extra, buttons=[pick])  # fmt: skip


def _motion_field(model: pg.Model, item: Any, name: str) -> Payload:
    """Return a drop-down list of the degrees of freedom of a joint."""
    body, label = (item.body, "Motion") if name == "coordinate" else (item.other, "Its motion")
    joint, now = degrees(model.body(body)) if body in model.row else [], getattr(item, name)
    options = [(str(k), text) for k, (text, _) in enumerate(joint)]
    options += [] if now < len(joint) else [(str(now), str(now))]
    return choice(name, label, str(now), options, help=about(item, name).help)


def _plain(model: pg.Model, item: Any, name: str, cells: Any, display: Display, at: Any) -> Payload:
    """Return a number or a vector, or the default if the field is not given."""
    shows, of = about(item, name), parts.quantity_of(model, item, name)
    value, implied = cells.get(name), False
    if value is None:
        value, implied = places.implied(model, item, name, at), True
    unit = _unit(model, item, parts.unit_of(model, item, name))
    unit = display.unit(of) if unit in ("length", "angle") else unit
    if typed_as(item, name)[0] == "vector":
        found = value if value is not None else (None, None, None)
        if isinstance(found[0], tuple):
            return _matrix(name, found, shows, unit)
        row = [cell((i,), shown(x, of, display), implied=implied) for i, x in enumerate(found)]
        pick = "" if len(row) == 4 else "axis" if name.endswith("axis") else "point"
        return field(name, shows.label, components(row), unit=unit, help=shows.help, pick=pick)
    one = cell((), shown(value, of, display), implied=implied)
    takes = varies(item, name)
    return field(name, shows.label, [one], unit=unit, help=shows.help, expression=takes)


def _matrix(name: str, rows: Any, shows: Any, unit: str) -> Payload:
    """Return the diagonal of a matrix of displacements along x, y, z and turns about them."""
    row = [cell((i, i), rows[i][i], mark) for i, mark in enumerate(OF_SIX)]
    coupled = np.count_nonzero(np.array(rows)[~np.eye(len(rows), dtype=bool)])
    note = f"{coupled} numbers off the diagonal keep their values" if coupled else ""
    return field(name, shows.label, row, unit=unit, help=shows.help, columns=3, note=note)


def _unit(model: pg.Model, item: Any, given: str) -> str:
    """Return the unit of a drive's field, depending on the joint: "N m/rad, N/m" or one of them."""
    if not isinstance(item, OnJoint) or item.coefficients or ", " not in given:
        return given
    joint = degrees(model.body(item.body))
    slides = joint[item.coordinate][1] == "m" if item.coordinate < len(joint) else False
    return given.split(", ")[slides]


def _curve(model: pg.Model, item: pg.Motion) -> list[Payload]:
    """Return fields for the kind and parameters of a prescribed motion."""
    curve = item.q_of_t
    kind = curve.kind if isinstance(curve, (pg.Sine, pg.Polynomial)) else "table"
    kind = "expression" if isinstance(curve, str) else kind
    found = [choice("curve", "Follows", kind, curves.KINDS, help=CELLS["curve"].help)]
    if kind in ("table", "expression"):
        one, shows = cell((), curves.knots(curve)), CELLS[kind]
        return [*found, field(kind, shows.label, [one], help=shows.help, kind="text",
                              note=shows.help, curve=pictures.of_motion(item),
                              expression=True)]  # fmt: skip
    if isinstance(curve, pg.Sine):
        numbers: Sequence[float] = (curve.mean, curve.amplitude, curve.frequency, curve.phase)
    else:
        assert isinstance(curve, pg.Polynomial)
        numbers = (*curve.coefficients, 0.0, 0.0, 0.0, 0.0)[:4]
    joint = degrees(model.body(item.body))
    unit = joint[item.coordinate][1] if item.coordinate < len(joint) else ""
    names = [name.format(unit) if unit else name.partition(" [")[0] for name in Q_OF_T[kind]]
    row = [cell((i,), x, name) for i, (x, name) in enumerate(zip(numbers, names))]
    shows = CELLS[kind]
    return [*found, field(kind, shows.label, row, help=shows.help, columns=2, note=shows.help)]


def _track(item: pg.CurvePoint, display: Display) -> list[Payload]:
    """Return the rows of the curve of a point, its points or its functions."""
    shows = about(item, "curve")
    found = [
        field(name, label, [cell((), text)], help=track_cells.HELP[name], kind="text",
              unit=display.length if name == "track_points" else "", note=shows.help)
        for name, label, text in track_cells.rows(item.curve, display)
        if name not in ("track_up", "track_angles")
    ]  # fmt: skip
    closed = track_cells.FLAG[item.curve.closed]
    return [*found, choice("track_closed", "Closed", closed, track_cells.FLAG,
                           help="whether the end of the curve is its beginning")]  # fmt: skip


def _function(state: State, item: pg.Relation, display: Display) -> list[Payload]:
    """Return fields for the kind and the text of the curve of a relation, with its picture."""
    kind, shows = relations.kind_of(item.curve), about(item, "curve")
    of = relations.quantities(state.model, item)
    si = not isinstance(item.curve, pg.Curve)
    units = [pictures.SI[one] if si else display.unit(one) for one in of]
    note = FUNCTIONS[kind].format(*(unit or "rad, m" for unit in units))
    one = cell((), relations.written(state.model, item, display))
    return [choice("function", CELLS["function"].label, kind, relations.KINDS,
                   help=CELLS["function"].help),
            field("curve", shows.label, [one], help=shows.help, kind="text", note=note,
                  curve=pictures.of_relation(state, item, display),
                  expression=True)]  # fmt: skip


def _lift(model: pg.Model, item: pg.Cam, display: Display) -> list[Payload]:
    """Return fields for the kind and the text of the lift of a cam, with its picture."""
    kind, shows = cams.kind_of(item), about(item, "motion")
    one = cell((), cams.written(model, item, display))
    return [choice("lift_is", CELLS["lift_is"].label, kind, cams.MOTIONS,
                   help=CELLS["lift_is"].help),
            field("motion", shows.label, [one], help=shows.help, kind="text",
                  note=cams.note(model, item, display),
                  curve=cams.picture(model, item, display))]  # fmt: skip


def _coefficients(item: Any, cells: Any) -> list[Payload]:
    found = [
        field("coefficients", name, [cell((i, j), x) for j, x in enumerate(row)],
              help=about(item, "coefficients").help,
              buttons=[button("×", "", "take this body out", field="coefficients", index=[],
                              text=name)])
        for i, (name, row) in enumerate(cells["coefficients"].items())
    ]  # fmt: skip
    more = field(
        "coefficients", "+ body", [cell((), "")], kind="names", options=[path_rows.NO_BODY]
    )
    return [*found, more]


def _points(item: pg.Contact, cells: Any, display: Display) -> list[Payload]:
    if item.body == EVERY:
        return []
    found = [
        field("points", f"Point {i + 1}",
              [cell((i, j), shown(x, "length", display)) for j, x in enumerate(point)],
              unit=display.length, help=about(item, "points").help, pick="point",
              buttons=[button("×", "", "take this point out", field="points", index=[i], text="")])
        for i, point in enumerate(cells["points"])
    ]  # fmt: skip
    more = [button("+ point", "", "a point that touches, at the tip at first", field="points",
                   index=[], text="add")]  # fmt: skip
    said = "" if item.points else "the body's shape touches"
    return [*found, field("points", "Points", [], buttons=more, note=said)]


def _over_time(item: pg.Force, name: str, cells: Any) -> list[Payload]:
    """Return the fields for the vector of a wrench, which is constant or a table over time."""
    shows, constant = about(item, name), isinstance(getattr(item, name), tuple)
    how = "constant" if constant else "over time"
    over = choice(f"{name}_over", CELLS[f"{name}_over"].label, how, ("constant", "over time"))
    if constant:
        row = [cell((i,), x) for i, x in enumerate(cells[name])]
        unit = shows.unit.split(",")[0]
        return [field(name, shows.label, row, unit=unit, expression=True), over]
    row = [cell((), curves.knots(cells[name]))]
    text = "rows: t x y z; t x y z; ..."
    return [field(name, shows.label, row, unit=shows.unit.split(",")[0], kind="text", help=text,
                  note=text), over]  # fmt: skip


VIEWS = (
    Place(
        topic("constraints", constraints, *PARTS, page=_seen),
        21,
        Host("constraints", "left", "Connections"),
        Host("part", "right", order=40),
    ),
    Place(
        topic(
            "present",
            pictures.present,
            "derived",
            "posed",
            moment,
            page=lambda _, page: (page.opened, page.display),
        ),
        42,
    ),
)
