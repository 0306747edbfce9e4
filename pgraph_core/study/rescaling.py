"""A model in other units: every number times the factor of its dimension."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from ..errors import refusal
from ..joints import Motion
from ..model import (
    Body,
    Constraint,
    Contact,
    Drag,
    Force,
    Ground,
    Model,
    Spring,
    Table,
    Tendon,
    Torsion,
    VectorTable,
    Wrench,
)
from ..model.constraint import InJoints
from ..model.fields import fields_of
from ..model.force import OnJoint


def changed(body: Body, **fields: object) -> Body:
    """Return a validated body with other fields, whose derived values become plain numbers."""
    own = {**fields_of(body), "derived": (), "density": None}
    return Body(**{**own, **fields})


class Scale(NamedTuple):
    """Factors on lengths, masses and times."""

    length: float
    mass: float
    time: float

    def of(self, length: float = 0, mass: float = 0, time: float = 0) -> float:
        """The factor of a quantity with these exponents."""
        return self.length**length * self.mass**mass * self.time**time


SPRING, DAMPER, TORQUE = (0, 1, -2), (0, 1, -1), (2, 1, -2)  # exponents of length, mass, time
FORCE = (1, 1, -2)
# of a joint's fields: of rotations, and of translations
OF_JOINT: dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "stiffness": (TORQUE, SPRING),
    "damping": ((2, 1, -1), DAMPER),
    "rest": ((0, 0, 0), (1, 0, 0)),
    "friction": (TORQUE, FORCE),
    "armature": ((2, 1, 0), (0, 1, 0)),
}
Q = {"rotate": (0,), "translate": (1,), "ball": (0,) * 4, "free": (1, 1, 1, 0, 0, 0, 0)}
V = {"rotate": (0,), "translate": (1,), "ball": (0,) * 3, "free": (0, 0, 0, 1, 1, 1)}


def rescaled(model: Model, *, length: float = 1.0, mass: float = 1.0, time: float = 1.0) -> Model:
    """The model with the same motion whose lengths, masses and times are scaled by these factors.

    Scenarios are dropped. Raises InputError for constraints whose numbers have their own units.
    """
    s = Scale(float(length), float(mass), float(time))
    fixed = [c.name for c in model.constraints if isinstance(c, InJoints)]
    if fixed:
        text = f"constraint '{fixed[0]}' acts on coordinates, whose numbers are not rescaled; "
        raise refusal("stability_map", "axis", f"{text}choose another axis")
    return model.replace(
        bodies=tuple(_body(b, s) for b in model.bodies),
        constraints=tuple(_constraint(c, s) for c in model.constraints),
        contacts=tuple(_contact(c, s) for c in model.contacts),
        forces=tuple(_force(f, model, s) for f in model.forces),
        gravity=_times(model.gravity, s.of(1, 0, -2)),
        ground=_ground(model.ground, s),
        scenarios=(),
        sites=tuple(x.unchecked_copy({"point": _times(x.point, s.length)}) for x in model.sites),
    )


def _times(value: Any, by: float) -> Any:
    """Multiply nested numbers by a factor, keeping None."""
    if value is None:
        return None
    return tuple(_times(x, by) for x in value) if isinstance(value, (tuple, list)) else by * value


def _body(body: Body, s: Scale) -> Body:
    found: dict[str, Any] = {
        "link": _times(body.link, s.length),
        "com": _times(body.com, s.length),
        "tip": _times(body.tip, s.length),
        "mass": body.mass * s.mass,
        "inertia": _times(body.inertia, s.of(2, 1)),
        "q": _coordinates(body.sequence, body.q, Q, s.length),
        "v": _times(_coordinates(body.sequence, body.v, V, s.length), 1 / s.time),
    }
    for name, (turning, sliding) in OF_JOINT.items():
        by = [s.of(*(sliding if m.kind == "translate" else turning)) for m in body.sequence]
        found[name] = tuple(x * f for x, f in zip(getattr(body, name), by))
    sizes = [s.length if m.kind == "translate" else 1.0 for m in body.sequence]
    found["limits"] = tuple(_times(pair, f) for pair, f in zip(body.limits, sizes))
    shapes = []
    for shape in body.shapes:
        lengths = {
            "size",
            "radius",
            "radii",
            "length",
            "end_radius",
            "heights",
            "scale",
            "position",
        }
        named = lengths & type(shape).model_fields.keys()
        sizes = {x: _times(getattr(shape, x), s.length) for x in named}
        shapes.append(shape.unchecked_copy(sizes))
    found |= {"shape": shapes[0] if shapes else None, "shapes": tuple(shapes)}
    return changed(body, **found)


def _coordinates(
    motions: Sequence[Motion], values: Sequence[float], powers: dict[Any, Any], length: float
) -> tuple[float, ...]:
    each = (power for m in motions for power in powers[m.kind])
    return tuple(x * length**power for x, power in zip(values, each))


def _constraint(c: Constraint, s: Scale) -> Constraint:
    named = {"point", "other_point", "length", "radius"} & type(c).model_fields.keys()
    return c.unchecked_copy({x: _times(getattr(c, x), s.length) for x in named})


def _contact(c: Contact, s: Scale) -> Contact:
    soft = c.law == "soft"
    stiffness = s.of(-0.5, 1, -2) if soft else s.of(*SPRING)
    damping = s.of(-1, 0, 1) if soft else s.of(*DAMPER)
    return c.unchecked_copy(
        {
            "points": _times(c.points, s.length),
            "rolling_friction": _times(c.rolling_friction, s.length),
            "spinning_friction": _times(c.spinning_friction, s.length),
            "stiffness": _times(c.stiffness, stiffness),
            "damping": _times(c.damping, damping),
        }
    )


def _force(f: Force, model: Model, s: Scale) -> Force:
    """A motor's torque, a servo's and its gains have the dimension of the coordinate."""
    force, torque = s.of(*FORCE), s.of(*TORQUE)
    match f:
        case OnJoint() | Tendon():
            found = _along_joints(f, model, s)
        case Wrench():
            found = {
                "torque": _curve(f.torque, torque, s),
                "force": _curve(f.force, force, s),
                "point": _times(f.point, s.length),
            }
        case Spring():
            found = {
                "point": _times(f.point, s.length),
                "other_point": _times(f.other_point, s.length),
                "stiffness": f.stiffness * s.of(*SPRING),
                "damping": f.damping * s.of(*DAMPER),
                **{x: _times(getattr(f, x), s.length) for x in ("rest", "low", "high")},
            }
        case Torsion():
            found = {"stiffness": f.stiffness * torque, "damping": f.damping * torque * s.time}
        case Drag():
            found = {
                "size": _times(f.size, s.length),
                "point": _times(f.point, s.length),
                "density": f.density * s.of(-3, 1, 0),
                "viscosity": f.viscosity * s.of(-1, 1, -1),
            }
        case _:
            raise TypeError(f"no units are known for a force of kind '{f.kind}'")
    return f.unchecked_copy(found)


def _along_joints(f: OnJoint | Tendon, model: Model, s: Scale) -> dict[str, Any]:
    """Scale a force along joints. A sum of rotations and slides stays in rad.

    Its slides get other coefficients instead.
    """
    bodies = {name: model.body(name) for name, _, _ in f.terms}
    slides = {(name, k): _slides(bodies[name], k) for name, k, _ in f.terms}
    all_slide = all(slides.values())
    per = s.length if all_slide else 1.0
    acts = s.of(*FORCE) if all_slide else s.of(*TORQUE)
    found: dict[str, Any] = {}
    if f.coefficients and not all_slide:
        found["coefficients"] = {
            name: tuple(x / s.length if slides.get((name, k)) else x for k, x in enumerate(row))
            for name, row in f.coefficients.items()
        }
    if isinstance(f, Tendon):
        spring = {"stiffness": f.stiffness * acts / per, "damping": f.damping * acts / per * s.time}
        lengths = {x: _times(getattr(f, x), per) for x in ("rest", "low", "high")}
        return found | spring | lengths | {"friction": f.friction * acts}
    found |= {"torque": _curve(f.torque, acts, s)}
    found |= {x: _times(getattr(f, x), acts) for x in ("torque_limit", "torque_low")}
    gains = {"kp": acts / per, "kd": acts / per * s.time, "gain": acts}
    found |= {x: getattr(f, x) * by for x, by in gains.items() if x in type(f).model_fields}
    of_state = {"torque": acts, "target": per, "speed": per / s.time, "input": 1.0}[f.INPUT]
    of_input = of_state / s.time if f.integrates else of_state
    found |= {x: _times(getattr(f, x), of_state) for x in ("start", "state_low", "state_high")}
    found |= {f.INPUT: _curve(getattr(f, f.INPUT), of_input, s), "lag": f.lag * s.time}
    return found | {x: _times(getattr(f, x), of_input) for x in ("input_low", "input_high")}


def _slides(body: Body, coordinate: int) -> bool:
    each = [m.kind == "translate" or power > 0 for m in body.sequence for power in V[m.kind]]
    return each[coordinate]


def _curve(value: Any, by: float, s: Scale) -> Any:
    if isinstance(value, (Table, VectorTable)):
        times = _times(value.t, s.time)
        return type(value)(t=times, value=_times(value.value, by))
    return _times(value, by)


def _ground(ground: Ground, s: Scale) -> Ground:
    steps = tuple(
        step.unchecked_copy(
            {x: _times(getattr(step, x), s.length) for x in ("low", "high", "height")}
        )
        for step in ground.steps
    )
    update: dict[str, Any] = {"steps": steps}
    for name in ("rolling_friction", "spinning_friction"):
        update[name] = _times(getattr(ground, name), s.length)
    return ground.unchecked_copy(update)
