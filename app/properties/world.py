"""Properties of the model itself (name, ground, ...), shown if no body is selected."""

from __future__ import annotations

from typing import Any, Literal

import pgraph_core as pg
from pgraph_core.errors import counted
from pgraph_core.fields import about
from pgraph_core.model.editing import in_expressions
from pgraph_core.model.expressions import texts_of
from pgraph_core.model.parameters import evaluated
from pgraph_core.signals.grammar import names_in, with_names

from ..core import cells
from ..core.cells import (
    Display,
    Payload,
    Quantity,
    Refusal,
    button,
    cell,
    choice,
    components,
    field,
    group,
    quantity_in,
    shown,
)
from ..core.events import Entries, ModelEdit, Text
from ..core.rows import GONE
from ..core.state import display_of
from . import State

# -- the form --------------------------------------------------------------------------------------


GROUND = {name: f for name, f in pg.Ground.model_fields.items() if name != "steps"}
AXES = {"x": ("y", "z"), "y": ("x", "z"), "z": ("x", "y")}  # those that are not up


def world(state: State, display: Display) -> Payload:
    """Return the form that is shown if no body is selected."""
    return {
        "title": state.model.name,
        "subtitle": "Model",
        "groups": [_general(state), *_ground(state, display), _parameters(state)],
    }


def _general(state: State) -> Payload:
    model = state.model
    gravity = components(cell((i,), x) for i, x in enumerate(model.gravity))
    up = choice("up", "Up", model.up, ("x", "y", "z"), help="which axis points up")
    return group("World", [
        field("name", "Name", [cell((), model.name)], kind="text"),
        field("gravity", "Gravity", gravity, unit="m/s²", help="x, y, z in world axes"), up,
    ])  # fmt: skip


def _ground(state: State, display: Display) -> list[Payload]:
    """Return the form of the ground, if something may touch it or it has been changed."""
    model, ground = state.model, state.model.ground
    if not model.contacts and ground == pg.Ground():
        return []
    implied = {
        "static_friction": (ground.least_to_slide, ground.static_friction is None),
        "uphill": (ground.uphill or level(model), ground.uphill is None),
    }
    fields = []
    for name in sorted(GROUND, key=("slope", "uphill").__contains__):  # those of the plane last
        value, empty = implied.get(name, (getattr(ground, name), False))
        several, shows = isinstance(value, tuple), about(GROUND[name], name)
        quantity = quantity_in(shows.unit)
        row = [
            cell((i,) if several else (), shown(x, quantity, display), implied=empty)
            for i, x in enumerate(value if several else (value,))
        ]
        fields.append(field(name, shows.label, row, unit=display.unit(quantity), help=shows.help,
                            direction=name == "uphill"))  # fmt: skip
    a, b = AXES[model.up]
    for i, step in enumerate(ground.steps):
        values = (*step.low, *step.high, step.height)
        names = (f"{a} ≥", f"{b} ≥", f"{a} ≤", f"{b} ≤", "height")
        cells = [cell((i, k), shown(x, "length", display), names[k]) for k, x in enumerate(values)]
        out = button("×", "", "take this step out", field="steps", index=[i], text="")
        fields.append(field("steps", f"Step {i + 1}", cells, unit=display.length, columns=2,
                            help="a rectangle at another height", buttons=[out]))  # fmt: skip
    more = button("+ step", "", "a rectangle at another height", field="steps", index=[], text="")
    fields[-1] = {**fields[-1], "buttons": [*fields[-1]["buttons"], more]}
    special = [f"slope {shown(ground.slope, 'angle', display):.4g} {display.angle}"] * bool(
        ground.slope
    )
    special += [counted(len(ground.steps), "step")] * bool(ground.steps)
    return [group("Ground", fields, bool(special), ", ".join(special) or "level")]


def _parameters(state: State) -> Payload:
    """Return each parameter with its value and number of uses, and an empty row for a new one."""
    model = state.model
    used = dict.fromkeys(model.parameters, 0)
    texts = [f.text for f in model.formulas]
    texts += texts_of(model)
    for text in texts:
        for name in names_in(text):
            if name in used:
                used[name] += 1
    ids = state.rows.named(model, "parameters")
    rows = [
        {"id": ids[name], "name": name, "value": value, "used": used[name]}
        for name, value in model.parameters.items()
    ]
    help = "named numbers, used in cells as =name or =name/2"
    parameters = field("parameters", "", [], kind="parameters", rows=rows, help=help)
    return group("Parameters", [parameters], bool(rows), str(len(rows) or "none"))


# -- edits -----------------------------------------------------------------------------------------


WorldField = Literal[
    "name", "up", "gravity", "friction", "static_friction", "rolling_friction",
    "spinning_friction", "restitution", "slope", "uphill", "steps",
]  # fmt: skip


STEP = ("low", "low", "high", "high", "height")  # fields of the numbers of a ground step


class EditWorld(ModelEdit):
    """Text typed into the cells of one model field."""

    serial: int
    field: WorldField
    entries: Entries

    def edit(self, state: State) -> tuple[pg.Model, str]:
        display = display_of(state, self.client)
        try:
            model = _world(state.model, display, self.field, self.entries)
        except Refusal as refusal:
            raise Refusal(f"The {self.field} {refusal}") from None
        return model, f"{self.field} of the model"


def _world(model: pg.Model, display: Display, field: str, entries: Entries) -> pg.Model:
    text = entries[0][1].strip()
    match field:
        case "name":
            if not text:
                raise Refusal(f"must have 1 to {cells.LONGEST_NAME} characters, got 0")
            return model.replace(name=cells.valid_name(text))
        case "up":
            return model.replace(up=text)
        case "gravity":
            return model.replace(gravity=_typed(model.gravity, entries, "number", display))
        case "steps":
            return _grounded(model, steps=_steps(model.ground, entries, display))
    if not text and GROUND[field].default is None:
        return _grounded(model, **{field: None})
    old = getattr(model.ground, field) or (level(model) if field == "uphill" else None)
    of = quantity_in(about(GROUND[field], field).unit)
    return _grounded(model, **{field: _typed(old, entries, of, display)})


def level(model: pg.Model) -> tuple[float, ...]:
    """Return the direction that is uphill unless another one is given."""
    return (1.0, 0.0, 0.0) if model.up != "x" else (0.0, 1.0, 0.0)


def _grounded(model: pg.Model, **fields: Any) -> pg.Model:
    return model.replace(ground={**model.ground.model_dump(), **fields})


def _typed(value: Any, entries: Entries, of: Quantity, display: Display) -> Any:
    """Return a number or a vector from the text of its cells."""
    for index, text in entries:
        value = cells.replaced(value, index, cells.quantity(text, of, display))
    return value


def _steps(ground: pg.Ground, entries: Entries, display: Display) -> list[dict[str, Any]]:
    """Return the ground's steps with numbers edited, or with a step added or removed."""
    steps = [step.model_dump() for step in ground.steps]
    for index, text in entries:
        if not index:
            far = max((s["high"][0] for s in steps), default=0.0)
            return [*steps, {"low": (far, -1.0), "high": (far + 1.0, 1.0), "height": 0.1}]
        i, *rest = index
        if i >= len(steps) or (rest and rest[0] >= len(STEP)):
            raise Refusal("no longer has this step or number")
        if not rest:
            return [*steps[:i], *steps[i + 1 :]]
        key, value = STEP[rest[0]], cells.quantity(text, "length", display)
        old = steps[i][key]
        steps[i][key] = value if key == "height" else cells.replaced(old, (rest[0] % 2,), value)
    return steps


# -- parameters ------------------------------------------------------------------------------------


class EditParameter(ModelEdit):
    """Edit the value of the parameter in a row, or add a parameter if there is no row."""

    serial: int
    name: Text
    text: Text
    row: int | None = None

    def edit(self, state: State) -> tuple[pg.Model, str]:
        name = self.name.strip()
        known = state.rows.named(state.model, "parameters").values()
        if self.row is not None and self.row not in known:
            raise Refusal(GONE)
        return parameter_set(state.model, name, self.text), f"parameter {name}"


class RenameParameter(ModelEdit):
    serial: int
    name: Text
    text: Text

    def edit(self, state: State) -> tuple[pg.Model, str]:
        model = parameter_renamed(state.model, self.name, self.text.strip())
        return model, f"name of parameter {self.name}"


class DeleteParameter(ModelEdit):
    """Delete a parameter. Cells that use it keep their numbers."""

    name: Text

    def edit(self, state: State) -> tuple[pg.Model, str]:
        return parameter_removed(state.model, self.name), f"delete parameter {self.name}"


def parameter_set(model: pg.Model, name: str, text: str) -> pg.Model:
    """Set a parameter's value, which may be an expression of others. Raises Refusal."""
    others = {key: x for key, x in model.parameters.items() if key != name}
    try:
        formula = text.lstrip().startswith("=")
        value = evaluated(text, others) if formula else cells.number(text)
    except ValueError as problem:
        raise Refusal(f"parameter '{name}': {problem}") from None
    return model.replace(parameters={**model.parameters, name: value})


def parameter_renamed(model: pg.Model, old: str, new: str) -> pg.Model:
    """Rename a parameter in all formulas of the model. Raises Refusal, PgraphError."""
    if new in model.parameters and new != old:
        raise Refusal(f"another parameter is named '{new}'; choose another name")
    if not new or not new.isidentifier():
        raise Refusal(f"a parameter's name is one word of letters, digits and _, got {new!r}")
    renamed = {new if key == old else key: x for key, x in model.parameters.items()}
    formulas = tuple(
        f.unchecked_copy({"text": with_names(f.text, {old: new}, ("",))}) for f in model.formulas
    )
    parts = in_expressions(vars(model), {old: new}, "")
    return model.replace(parameters=renamed, formulas=formulas, **parts)


def parameter_removed(model: pg.Model, name: str) -> pg.Model:
    """Return the model without a parameter. Cells that used it keep their numbers."""
    if name not in model.parameters:
        return model
    left = {key: x for key, x in model.parameters.items() if key != name}
    formulas = tuple(f for f in model.formulas if name not in names_in(f.text))
    parts = in_expressions(vars(model), {name: f"({model.parameters[name]!r})"}, "")
    return model.replace(parameters=left, formulas=formulas, **parts)
