"""The properties of the model itself: its name, gravity, the ground, its parameters."""

from __future__ import annotations

from pgraph_core.model.parameters import names_in

from ..core.cells import Display
from ..core.state import State
from ..core.views import Payload
from ..properties.forms import button, cell, choice, field, group, shown

AXES = {"x": ("y", "z"), "y": ("x", "z"), "z": ("x", "y")}  # those that are not up


def world(state: State, display: Display) -> Payload:
    """The form that is shown where no body is selected."""
    return {
        "title": state.model.name,
        "subtitle": "the model: no body is selected",
        "groups": [_general(state), _ground(state, display), _parameters(state)],
    }


def _general(state: State) -> Payload:
    model = state.model
    gravity = [cell((i,), x) for i, x in enumerate(model.gravity)]
    up = choice("up", "Up", model.up, ("x", "y", "z"), help="which axis points up")
    return group("", [
        field("name", "Name", [cell((), model.name)], kind="text"),
        field("gravity", "Gravity", gravity, unit="m/s²", help="x, y, z in world axes"), up,
    ])  # fmt: skip


def _ground(state: State, display: Display) -> Payload:
    model, ground = state.model, state.model.ground
    level = (1.0, 0.0, 0.0) if model.up != "x" else (0.0, 1.0, 0.0)
    uphill = [
        cell((i,), x, implied=ground.uphill is None) for i, x in enumerate(ground.uphill or level)
    ]
    fields = [
        field("friction", "Friction", [cell((), ground.friction)],
              help="Coulomb's coefficient of contacts that give none"),
        field("static_friction", "Static friction",
              [cell((), ground.least_to_slide, implied=ground.static_friction is None)],
              help="of what does not slide yet; empty: as friction"),
        *(field(f"{way}_friction", f"{way.capitalize()} friction",
                [cell((), shown(getattr(ground, f"{way}_friction"), "length", display))],
                unit=display.length, help=f"torque against {way} over normal force")
          for way in ("rolling", "spinning")),
        field("restitution", "Restitution", [cell((), ground.restitution)],
              help="0 to 1, of contacts that give none"),
        field("slope", "Slope", [cell((), display.shown(ground.slope, "angle"))],
              unit=display.angle, help="by which the plane rises"),
        field("uphill", "Uphill", uphill, help="direction in which it rises; empty: the first "
              "axis that is not up"),
    ]  # fmt: skip
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
    special = ground.slope != 0 or bool(ground.steps)
    return group("Ground", fields, special or bool(model.contacts))


def _parameters(state: State) -> Payload:
    """Each parameter with its value and how many cells use it, and an empty row for a new one."""
    model = state.model
    used = dict.fromkeys(model.parameters, 0)
    for formula in model.formulas:
        for name in names_in(formula.text):
            if name in used:
                used[name] += 1
    rows = [
        {"name": name, "value": value, "used": used[name]}
        for name, value in model.parameters.items()
    ]
    help = "numbers with a name: a cell of a body holds =name or =name/2"
    parameters = field("parameters", "", [], kind="parameters", rows=rows, help=help)
    return group("Parameters", [parameters], bool(rows))
