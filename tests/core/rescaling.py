"""Rescaling of a model to other units by a factor for each dimension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pgraph_core import Body, Force, Model
from pgraph_core.fields import Frozen, OfSums, dim_of, facts, fields_of
from pgraph_core.joints import KINDS, PER_MOTION, Motion
from pgraph_core.study.axes import changed
from pgraph_core.units import Dim, M, S

# powers of a length in the coordinates and velocities of a motion
Q = {kind: tuple(int(unit == "m") for unit in k.q) for kind, k in KINDS.items()}
V = {kind: tuple(int(unit == "m") for unit in k.v) for kind, k in KINDS.items()}


@dataclass(frozen=True)
class Scale:
    """Scale factors for length, mass and time."""

    length: float
    mass: float
    time: float

    def of(self, dim: Dim, slides: bool = False) -> float:
        """Return the scale factor of a dimension. Sliding coordinates count as lengths."""
        return dim.factor(self.length, self.mass, self.time, self.length if slides else 1.0)

    def fields(self, part: Frozen, slides: bool = False) -> dict[str, Any]:
        """Return the dimensional fields of a part, converted to the other units."""
        found: dict[str, Any] = {}
        for name, info in type(part).model_fields.items():
            own, value = facts(info), getattr(part, name)
            if own.dim is None or value is None or own.role == "joint":
                continue
            dim = dim_of(part, name)
            if own.role == "screw":
                found[name] = self.screw(value, dim)
            elif isinstance(value, Frozen):  # a table: its first column, and its values
                by = self.of(own.over), self.of(dim, slides)
                columns = zip(fields_of(value).items(), by)
                found[name] = type(value)(**{k: self.times(x, f) for (k, x), f in columns})
            elif any(dim):
                found[name] = self.times(value, self.of(dim, slides))
        return found

    def screw(self, rows: Any, dim: Dim) -> Any:
        """Rescale a (6, 6) matrix that relates translations, with this dimension, and rotations."""
        turns = (0, 0, 0, 1, 1, 1)
        return tuple(
            tuple(x * self.of(dim * M ** (a + b)) for b, x in zip(turns, row))
            for a, row in zip(turns, rows)
        )

    def times(self, value: Any, by: float) -> Any:
        """Multiply nested numbers by a factor, leaving None unchanged."""
        if value is None:
            return None
        several = isinstance(value, (tuple, list))
        return tuple(self.times(x, by) for x in value) if several else by * value


def rescaled(model: Model, *, length: float = 1.0, mass: float = 1.0, time: float = 1.0) -> Model:
    """Return a model with the same motion, with lengths, masses and times scaled by given factors.

    Scenarios are dropped. Numbers of constraints on coordinates and of expressions stay.
    """
    s = Scale(float(length), float(mass), float(time))
    steps = tuple(x.unchecked_copy(s.fields(x)) for x in model.ground.steps)
    return model.replace(
        bodies=tuple(_body(b, s) for b in model.bodies),
        constraints=tuple(c.unchecked_copy(s.fields(c)) for c in model.constraints),
        contacts=tuple(c.unchecked_copy(s.fields(c)) for c in model.contacts),
        forces=tuple(_force(f, model, s) for f in model.forces),
        gravity=s.times(model.gravity, s.of(M / S**2)),
        ground=model.ground.unchecked_copy({**s.fields(model.ground), "steps": steps}),
        scenarios=(),
        sites=tuple(x.unchecked_copy(s.fields(x)) for x in model.sites),
    )


def _body(body: Body, s: Scale) -> Body:
    found = s.fields(body)
    found.pop("density", None)  # derived from shapes
    for name in (*PER_MOTION, "limits"):
        dim = dim_of(body, name)
        by = [s.of(dim, m.kind == "translate") for m in body.sequence]
        found[name] = tuple(s.times(x, f) for x, f in zip(getattr(body, name), by))
    found["q"] = _coordinates(body.sequence, body.q, Q, s.length)
    found["v"] = s.times(_coordinates(body.sequence, body.v, V, s.length), 1 / s.time)
    shapes = tuple(
        # the numbers in a mesh file stay, so that its scale is a length
        x.unchecked_copy({**s.fields(x), "scale": s.times(x.scale, s.length)})
        for x in body.shapes
    )
    return changed(body, **found, shape=shapes[0] if shapes else None, shapes=shapes)


def _coordinates(
    motions: Sequence[Motion], values: Sequence[float], powers: dict[Any, Any], length: float
) -> tuple[float, ...]:
    each = (power for m in motions for power in powers[m.kind])
    return tuple(x * length**power for x, power in zip(values, each))


def _force(f: Force, model: Model, s: Scale) -> Force:
    """Rescale a force. In a mixed sum, the coefficients of sliding coordinates are rescaled too."""
    if not isinstance(f, OfSums):
        places = {
            name: tuple(x.unchecked_copy(s.fields(x)) for x in getattr(f, name))
            for name in f.PLACES
        }
        return f.unchecked_copy({**s.fields(f), **places})
    bodies = {name: model.body(name) for name, _, _ in f.terms}
    slides = {(name, k): _slides(bodies[name], k) for name, k, _ in f.terms}
    all_slide = all(slides.values())
    found = s.fields(f, slides=all_slide)
    if f.coefficients and not all_slide:
        found["coefficients"] = {
            name: tuple(x / s.length if slides.get((name, k)) else x for k, x in enumerate(row))
            for name, row in f.coefficients.items()
        }
    return f.unchecked_copy(found)


def _slides(body: Body, coordinate: int) -> bool:
    each = [m.kind == "translate" or power > 0 for m in body.sequence for power in V[m.kind]]
    return each[coordinate]
