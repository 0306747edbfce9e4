"""The same rope cut into more and more links."""

from __future__ import annotations

from ...errors import InputError, Problem
from ...model import Body, Model
from ...model.names import GROUND
from ..axis import Axis, changed


def chained(model: Model, value: float) -> Model:
    """A chain of `value` links that are each like the model's first body, cut to 1 / value.

    Lengths and masses are divided by the number, inertias by its cube; the first link has the
    initial state of the body, the others hang on at rest. Raises InputError where the value is not
    a number of links, or the first body does not start with a hinge.
    """
    n, first = int(value), model.bodies[0] if model.bodies else None
    if n != value or n < 1:
        raise InputError(
            Problem("stability_map", "values", f"must be numbers of links; given {value:g}")
        )
    if first is None or first.joint not in ("revolute", "universal", "spherical"):
        text = "chain_length repeats a first body on a revolute, universal or spherical joint"
        raise InputError(Problem("stability_map", "axis", text))
    end = tuple(2 * x for x in first.com) if first.tip is None else first.tip
    if not any(end):
        text = f"the first body '{first.name}' must have a tip or centre of mass off its joint"
        raise InputError(Problem("stability_map", "axis", text))
    links = tuple(_link(first, end, i, n) for i in range(n))
    kept = {"name": f"chain of {n}", "gravity": model.gravity, "up": model.up}
    return Model(bodies=links, **kept)


def _link(body: Body, end: tuple[float, ...], i: int, n: int) -> Body:
    """Link i of n; all but the first hang at the end of the one before, at rest."""

    def part(x: tuple[float, ...], by: int = n) -> tuple[float, ...]:
        return tuple(c / by for c in x)

    rest = {} if i == 0 else {"q": (), "v": (), "rotation": (1.0, 0.0, 0.0, 0.0)}
    return changed(
        body,
        name=str(i + 1),
        parent=str(i) if i else GROUND,
        link=part(end) if i else body.link,
        mass=body.mass / n,
        com=part(body.com),
        tip=None if body.tip is None else part(body.tip),
        inertia=tuple(part(row, n**3) for row in body.inertia),
        stiffness=0.0,
        damping=0.0,
        friction=0.0,
        limits=(),
        shape=None,
        **rest,
    )


CHAIN_LENGTH = Axis(
    "chain_length",
    "links of a chain of the same length and mass",
    "links",
    (2, 5, 10, 20, 50, 100, 200, 500, 1000),
    chained,
)
