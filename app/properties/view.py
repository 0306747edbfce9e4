"""Properties of the selected bodies, or of the model if no body is selected."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np

import pgraph_core as pg
from pgraph_core.joints import AXIAL, COMBINED, KINDS, slides
from pgraph_core.shapes import Sized

from ..core.cells import (
    WXYZ,
    XYZ,
    Display,
    button,
    cell,
    choice,
    components,
    field,
    group,
    merged,
    quantity_in,
    shown,
)
from ..core.views import Host, Payload, Place, hue, topic
from . import Client, State, beam_cells, track_cells
from .body_cells import (
    ALL,
    DERIVED,
    NO_SHAPE,
    SHAPES,
    held,
    letter_of,
    moments,
    quantity_of,
    shows,
)
from .length import end_of
from .world import world

JOINTS = get_args(pg.Body.model_fields["joint"].annotation)
Q_NAMES = {"free": (*XYZ, *(f"q{x}" for x in WXYZ)), "spherical": WXYZ}
V_NAMES = {"free": ("ωx", "ωy", "ωz", *XYZ), "spherical": ("ωx", "ωy", "ωz")}
# short labels of fields
SHORT = {"link": "Position", "com": "Centre", "q": "Position", "v": "Velocity"}
STAND_IN = "drawn as a rod or box if there is no shape"
MOST_SHAPES = 12  # limit on shapes with a form
DENSITIES = (
    ("1000", "water, 1000"), ("7850", "steel, 7850"), ("2700", "aluminium, 2700"),
    ("700", "wood, 700"),
)  # fmt: skip
ROLES = {
    "both": "drawing and contact", "visual": "drawing only", "collision": "contact only",
}  # fmt: skip
ROTATIONS = {
    "quaternion": ("rotation", WXYZ),
    "euler": ("rotation_euler", ("roll", "pitch", "yaw")),
    "axis": ("rotation_axis", (*XYZ, "angle")),
}


def _seen(state: State, page: Client) -> tuple[tuple[str, ...], Display]:
    """Return the part of a page that its form depends on."""
    return page.selected, page.display


def properties(state: State, names: tuple[str, ...], display: Display | None = None) -> Payload:
    """Return the properties of these bodies, or of the model if there are none."""
    display = display or Display()
    beams = {beam.name: beam for beam in state.model.beams}
    known = [name for name in names if name in state.model.row or name in beams]
    if not known:
        return {"bodies": [], "ids": [], "display": vars(display), **world(state, display)}
    bodies = [beams.get(name) or state.model.body(name) for name in known]
    several = len(bodies) > 1
    number = state.graph.number[known[0]]
    ids = state.ids
    forms = [form_of(state.model, row, display) for row in bodies]
    return {
        "bodies": known,
        "ids": [ids[name] for name in known],
        "title": f"{len(bodies)} bodies" if several else known[0],
        "color": hue(state.graph.branches[number - 1]),
        "number": None if several else number,
        "subtitle": "An edit changes all of them" if several else "on",
        "parent": None if several else bodies[0].parent,
        "groups": merged(forms),
        "display": vars(display),
        "parameters": sorted(state.model.parameters),
    }


def form_of(model: pg.Model, row: pg.Body | pg.Beam, display: Display) -> list[Payload]:
    """Return the fields of a row of the table, a body or a beam."""
    if isinstance(row, pg.Beam):
        return beam_cells.form(model, row, display, ROTATIONS[display.turn])
    return groups(model, row, display)


def groups(model: pg.Model, body: pg.Body, display: Display) -> list[Payload]:
    """Return the fields in the order of building a body: joint, mass, initial state."""
    form = _Form(model, body, display)
    turn, names = ROTATIONS[display.turn]
    joint = [
        choice("joint", "Type", body.joint, [(j, j.capitalize()) for j in JOINTS],
               help=shows("joint").help, heads=True),
        *form.motions(), *form.track(), *([form.vector("pitch")] if any(body.pitch) else []),
        *beam_cells.place_row(model, "place", body.parent),
        form.vector("link"),
    ]  # fmt: skip
    frame = [form.text("name"), form.vector(turn, names), form.follows(form.tip())]
    mass = [form.follows(form.vector("mass")) | {"heads": True}, form.follows(form.vector("com"))]
    inertia = [form.follows(form.inertia())]
    (mass if "mass" in body.derived else inertia).append(form.material())
    state = [form.vector("q", Q_NAMES.get(body.joint, ())),
             form.vector("v", V_NAMES.get(body.joint, ()))]  # fmt: skip
    shape = form.shape(0)
    placed = (k for k, row in enumerate(shape) if row["field"] == "shape_position")
    first = next(placed, len(shape))
    kind_and_size, look = shape[:first], shape[first:]
    limited = any(body.limits)
    limits = [form.limits(), *([form.vector("limit_restitution")] if limited else [])]
    limits.append(form.vector("speed_limit"))
    springs = [form.vector(f) for f in ("stiffness", "rest", "damping", "friction", "armature")]
    sprung = any(body.stiffness + body.damping + body.friction + body.armature)
    moving, turned = any(body.v), any(body.rotation[1:])
    found = [
        group("Joint", joint),
        group("Mass", mass),
        group("Shape", [*kind_and_size, form.length()]),
        group("Appearance", look, False, ROLES[body.shapes[0].role] if look else ""),
        *(
            group(f"Shape {k + 1}", form.shape(k), False, body.shapes[k].kind)
            for k in range(1, min(len(body.shapes), MOST_SHAPES))
        ),
        group("Inertia", inertia, False, "from shapes" if "inertia" in body.derived else "given"),
        group(
            "Limits, springs",
            [*limits, *springs],
            limited or sprung,
            "given" if limited or sprung else "none",
        ),
        group("Initial state", state, moving, "moving" if moving else "at rest"),
        group("Frame", frame, False, "turned" if turned else "aligned"),
    ]
    found = [{**g, "fields": [f for f in g["fields"] if f["cells"]]} for g in found]
    return [g for g in found if g["fields"]]


class _Form:
    """The fields of one body as displayed on one page."""

    def __init__(self, model: pg.Model, body: pg.Body, display: Display):
        self.model, self.body, self.display = model, body, display

    def value(self, name: str) -> Any:
        return held(self.model, self.body, name, self.display)

    def text(self, name: str) -> Payload:
        return field(name, shows(name).label, [cell((), self.body.name)], kind="text")

    def cells(self, name: str, names: tuple[str, ...] = ()) -> list[Payload]:
        """Return one cell per number, with names for components other than x, y and z."""
        value = self.value(name)
        if not isinstance(value, (tuple, list)):
            return [cell((), self.shown(value, name, ()))]
        names = names or ("",) * len(value)
        found = [
            cell((i,), self.shown(x, name, (i,)), names[i] if i < len(names) else "")
            for i, x in enumerate(value)
        ]
        # a free body's orientation, below its place, in two rows of two
        return [{**c, "span": 3} if len(found) == 7 and i > 2 else c for i, c in enumerate(found)]

    def shown(self, value: Any, name: str, index: tuple[int, ...]) -> Any:
        return shown(value, quantity_of(self.body, name, index), self.display)

    def unit(self, name: str) -> str:
        """Return the units of a field's cells, which depend on the motions of the joint."""
        given = shows(name).unit
        turning, _, sliding = given.partition(", ")
        if sliding:
            of_motions = [sliding if slides(m) else turning for m in self.body.sequence]
            found = [self.display.of_unit(unit)[0] for unit in of_motions]
        elif given and quantity_in(given) == "number":
            return given
        else:
            value = self.value(name)
            count = len(value) if isinstance(value, (tuple, list)) else 0
            places = [(i,) for i in range(count)] or [()]
            per = "/s" if name == "v" else ""
            units = [self.display.unit(quantity_of(self.body, name, at)) for at in places]
            found = [u + per for u in units if u]
        return ", ".join(dict.fromkeys(found))

    def vector(self, name: str, names: tuple[str, ...] = ()) -> Payload:
        about, cells = shows(name), self.cells(name, names)
        pick = "point" if name in ("link", "com", "tip") or name.endswith("_position") else ""
        if name.endswith("_scale"):
            cells = components(cells)
        label = SHORT.get(name, about.label)
        return field(name, label, cells, unit=self.unit(name), help=about.help, pick=pick)

    def motions(self) -> list[Payload]:
        """Return one row per axis, or per selectable motion of a compound joint."""
        body = self.body
        if body.joint != "compound":
            several = len(body.axes) > 1
            rows = [self._axis(i, i, f"Axis {i + 1}" if several else "Axis")
                    for i in range(len(body.axes))]  # fmt: skip
            cells = [c for row in rows for c in row["cells"]]
            if len(rows) == len(cells) == 2:  # letters, which one row holds
                one = {"label": "Axes", "cells": cells, "columns": 2}
                return [rows[0] | one | {"pick": "", "direction": False}]
            return rows
        found, axis = [], 0
        for i, (kind, _) in enumerate(body.motions):
            out = button("×", "", "take this motion out", field="motions", index=[i], text="")
            row = field("motions", f"Motion {i + 1}", [cell((i,), kind)], kind="choice",
                        options=[(m, m) for m in COMBINED], buttons=[out])  # fmt: skip
            found.append(row)
            if KINDS[kind].directed:
                found.append(self._axis(axis, axis, ""))
                axis += 1
        more = button("+ motion", "", "one more motion", field="motions",
                      index=[], text="rotate")  # fmt: skip
        found[-1] = {**found[-1], "buttons": [*found[-1]["buttons"], more]}
        return found

    def track(self) -> list[Payload]:
        """Return the rows of a curve's track."""
        if self.body.track is None:
            return []
        found = track_cells.rows(self.body.track, self.display)
        return [
            field(name, label, [cell((), text)], kind="text", help=track_cells.HELP[name])
            for name, label, text in found
        ]

    def _axis(self, i: int, at: int, label: str) -> Payload:
        letter = letter_of(self.body.axes[at]) if self.body.joint != "compound" else ""
        if letter:  # another direction is typed as three numbers
            return field("axes", label, [cell((at,), letter)], kind="text",
                         help=shows("axes").help,
                         pick="axis" if at == len(self.body.axes) - 1 else "")  # fmt: skip
        cells = components(cell((i, j), x) for j, x in enumerate(self.body.axes[at]))
        last = i == len(self.body.axes) - 1  # the others are in the axes of the parent
        return field("axes", label, cells, help=shows("axes").help, columns=3,
                     pick="axis" if last else "")  # fmt: skip

    def inertia(self) -> Payload:
        rows = without_noise(self.value("inertia"))
        cells = [
            cell((i, j), x, mark=XYZ[i] + XYZ[j])
            for i, row in enumerate(rows)
            for j, x in enumerate(row)
        ]
        about = {"com": "about the centre of mass", "origin": "about the frame's origin"}
        help = f"{about[self.display.about]}, {shows('inertia').help}"
        return field("inertia", "Inertia", cells, unit="kg m²", help=help, columns=3,
                     note=physical(self.body), live=True)  # fmt: skip

    def tip(self) -> Payload:
        found = self.vector("tip")
        implied = self.body.tip is None
        return {**found, "cells": [{**c, "implied": implied} for c in found["cells"]]}

    def limits(self) -> Payload:
        motions = self.body.sequence
        cells = [
            cell((i, k), self.shown(x, "limits", (i, k)), ("≥", "≤")[k])
            for i, pair in enumerate(self.value("limits"))
            if motions[i].kind in AXIAL
            for k, x in enumerate(pair)
        ]
        return field("limits", "Limits", cells, unit=self.unit("limits"),
                     help=shows("limits").help, columns=2)  # fmt: skip

    def follows(self, row: Payload) -> Payload:
        """Return the row of the mass, with a badge if it is derived from the shapes, or a button to
        derive it."""
        name = row["field"]
        if name in self.body.derived:
            note = "; ".join(
                filter(None, (row["note"], "derived from the shapes until another value is typed"))
            )
            return {**row, "note": note}
        if name != next(one for one in DERIVED if one not in self.body.derived):
            return row  # one button for all of them
        source = "the shapes" if self.body.shapes else "a rod along the body, its shape from now on"
        title = f"let mass, centre, inertia and tip follow from {source}"
        derive = button("From shape", "", title, field="derived", index=[], text=ALL)
        return {**row, "buttons": [*row["buttons"], derive]}

    def shape(self, at: int) -> list[Payload]:
        """Return the kind, sizes and pose of a shape, and the fields that follow from it."""
        shapes, prefix = self.body.shapes, f"shape_{at}_" if at else "shape_"
        shape = shapes[at] if at < len(shapes) else None
        kind = NO_SHAPE if shape is None else shape.kind
        kinds = [(NO_SHAPE, NO_SHAPE.capitalize())]
        made = (k for k, x in SHAPES.items() if isinstance(x, Sized) or kind == k)
        kinds += [(k, k.capitalize()) for k in made]
        upload = {"upload": True, "help": "visual shapes and collision shapes"}
        if not at:
            kinds.append(("file", "Mesh file …"))  # STL, OBJ, PLY, OFF or GLB, 10 MB at most
        found = [choice(prefix + "kind", "Kind", kind, kinds, heads=True, **({} if at else upload))]
        if shape is None:
            found[0]["note"] = "" if at else STAND_IN
            return found
        if shape.file:
            name = (shape.file or "").replace("\\", "/").rsplit("/", 1)[-1]
            found[0]["note"] = name
        own = SHAPES[kind]
        found += [
            self.vector(prefix + f, XYZ if isinstance(getattr(shape, f), tuple) else ())
            for f in (*(own.cells or own.needs), *own.optional(shape))
        ]
        found.append(self.vector(prefix + "position"))
        turn, names = ROTATIONS[self.display.turn]
        found.append(self.vector(prefix + turn, names))
        found.append(choice(prefix + "role", "Role", shape.role, list(ROLES.items()),
                            help=shows("shape_role").help))  # fmt: skip
        colour = [cell((), held(self.model, self.body, prefix + "colour", self.display))]
        found.append(field(prefix + "colour", "Colour", colour, kind="text",
                           help=shows("shape_colour").help))  # fmt: skip
        found.append(self.vector(prefix + "opacity"))
        if shape.role != "visual":
            found += [self.vector(prefix + f, XYZ) for f in ("surface_velocity", "surface_spin")]
        if at == len(shapes) - 1 < MOST_SHAPES - 1:
            more = button("+ shape", "", "one more shape", field=f"shape_{at + 1}_kind",
                          index=[], text="sphere")  # fmt: skip
            found[-1] = {**found[-1], "buttons": [more]}
        return found

    def length(self) -> Payload:
        """Return the length from joint to tip as one number. Editing it stretches the body."""
        length = float(np.linalg.norm(end_of(self.body)))
        cells = [cell((), shown(length, "length", self.display))] if length > 1e-9 else []
        help = (
            "from the joint to the tip: shape, tip, centre of mass, inertia, and the joints and "
            "points at the tip go with it"
        )
        unit = self.display.unit("length")
        return field("body_length", "Body length", cells, unit=unit, help=help)

    def material(self) -> Payload:
        """Return the density that determines the mass, as a number or a material."""
        value = "" if self.body.density is None else self.body.density
        help = (
            "mass, centre of mass and inertia of a body that fills its shapes evenly; they follow "
            "until you type other values"
        )
        return field("density", "Density", [cell((), value)], unit="kg/m³", kind="density",
                     options=DENSITIES, help=help)  # fmt: skip


NOISE = 1e-12  # rounding of a zero relative to the largest entry


def without_noise(rows: Any) -> Any:
    """Return a matrix with rounding errors replaced by 0. Formulas are kept."""
    numbers = [abs(x) for row in rows for x in row if not isinstance(x, str)]
    least = NOISE * max(numbers, default=0.0)
    return [[x if isinstance(x, str) or abs(x) > least else 0.0 for x in row] for row in rows]


def physical(body: pg.Body) -> str:
    """Describe the validity of an inertia: principal moments, distance from an impossible one."""
    a, b, c = moments(body.inertia)
    if c == 0.0:
        return "a point mass without rotational inertia"
    if a + b - c <= 1e-9 * c:
        return f"principal {a:.4g}, {b:.4g}, {c:.4g}: just possible (all mass in one plane)"
    near = (
        f"as if all mass were {math.sqrt(c / body.mass):.3g} m from the axis" if body.mass else ""
    )
    gyration = near and f"; the largest is {near}"
    return f"principal moments {a:.4g}, {b:.4g}, {c:.4g}{gyration}"


VIEWS = (
    Place(
        topic("properties", lambda state, page: properties(state, *_seen(state, page)), "derived",
              page=_seen), 40,
        Host("heading", "right"), Host("properties", "right", order=42),  # the pose between them
    ),
)  # fmt: skip
