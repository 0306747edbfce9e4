"""The axes of the stability map. Each axis varies one property of a model up to extreme values.

An axis is a pure function (model, value) -> model and a line in `TABLE`. The functions raise
InputError if the model does not have the varied property.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from ..errors import InputError, PgraphError, refusal
from ..fields import GROUND, fields_of
from ..joints import SIZE
from ..model import Body, Force, Model, Spring, Torsion
from ..topology import Topology


class Axis(NamedTuple):
    """A quantity that is varied to make a scene extreme."""

    name: str
    what: str  # meaning of a value
    unit: str
    values: tuple[float, ...]  # usual ones
    applied: Callable[[Model, float], Model] = lambda model, value: model
    of_steps: bool = False  # the values are the steps themselves
    own: Callable[[Model], float | None] = lambda model: None  # value of a model as it is


def changed(body: Body, **fields: object) -> Body:
    """Create a validated body with some fields changed, and derived values as numbers."""
    own = {**fields_of(body), "derived": (), "density": None}
    return Body(**{**own, **fields})


def lacking(axis: str, what: str) -> InputError:
    """Return the error for a model that lacks the quantity varied by the axis."""
    return refusal("stability_map", "axis", f"{axis} varies {what}; the model has none")


def stiffness(model: Model, value: float) -> Model:
    """Set the stiffest spring to `value` and scale the others in proportion.

    The initial force of a joint spring is kept constant. As the stiffness increases, the joint
    starts closer to the rest position, and the motion approaches that of a rigid joint.
    """
    stiffest = own_stiffness(model)
    if stiffest is None:
        raise lacking("stiffness", "springs of joints and between bodies")
    by = value / stiffest
    forces = tuple(
        f.unchecked_copy({"stiffness": k * by}) if (k := _stiffness(f)) is not None else f
        for f in model.forces
    )
    bodies = tuple(_stiffened(b, by) if any(b.stiffness) else b for b in model.bodies)
    return model.replace(bodies=bodies, forces=forces)


def own_stiffness(model: Model) -> float | None:
    """Return the stiffness of the model's stiffest spring."""
    springs = [k for f in model.forces if (k := _stiffness(f)) is not None]
    return max((*springs, *(x for body in model.bodies for x in body.stiffness)), default=0) or None


def _stiffness(f: Force) -> float | None:
    """Return the stiffness of a spring between bodies, or None if it has none or it varies."""
    found = f.stiffness if isinstance(f, (Spring, Torsion)) else None
    return None if isinstance(found, str) else found


def _stiffened(body: Body, by: float) -> Body:
    q, first = list(body.q), 0
    for motion, k, rest in zip(body.sequence, body.stiffness, body.rest):
        if k and SIZE[motion.kind] == (1, 1):
            q[first] = rest + (q[first] - rest) / by
        first += SIZE[motion.kind][0]
    return changed(body, stiffness=tuple(k * by for k in body.stiffness), q=tuple(q))


def contact_stiffness(model: Model, value: float) -> Model:
    """Set the stiffness of every soft or penalty contact to `value`."""
    if not any(c.law != "complementarity" for c in model.contacts):
        raise lacking("contact_stiffness", "contacts of law 'soft' or 'penalty'")
    return model.replace(
        contacts=tuple(
            c if c.law == "complementarity" else c.unchecked_copy({"stiffness": float(value)})
            for c in model.contacts
        )
    )


def mass_ratio(model: Model, value: float) -> Model:
    """Set the mass of the last tip body to `value` times its parent's, and its inertia."""
    tip = _carried_tip(model)
    if tip is None:
        raise lacking("mass_ratio", "mass of a tip body divided by the mass of its parent")
    by = value * model.body(tip.parent).mass / tip.mass
    inertia = tuple(tuple(by * x for x in row) for row in tip.inertia)
    return _with_body(model, tip, changed(tip, mass=by * tip.mass, inertia=inertia))


def _carried_tip(model: Model) -> Body | None:
    """Find the last tip body with a massive parent."""
    topology = Topology.of(model)
    tips = [model.body(topology.names[n - 1]) for n in topology.tips]
    tips = [b for b in tips if b.parent != GROUND and b.mass and model.body(b.parent).mass]
    return tips[-1] if tips else None


def own_mass_ratio(model: Model) -> float | None:
    """Return the mass ratio of the model itself."""
    tip = _carried_tip(model)
    return None if tip is None else tip.mass / model.body(tip.parent).mass


def speed(model: Model, value: float) -> Model:
    """Set the largest initial velocity to `value` and scale the others in proportion.

    If the model is at rest, the speed is applied to the first coordinate of the first movable
    joint.
    """
    fastest = max((abs(x) for b in model.bodies for x in b.v), default=None)
    if fastest is None:
        raise lacking("speed", "initial velocities")
    if fastest == 0.0:
        mover = next(b for b in model.bodies if b.v)
        return _with_body(model, mover, changed(mover, v=(float(value), *mover.v[1:])))
    by = value / fastest
    bodies = tuple(changed(b, v=tuple(by * x for x in b.v)) if b.v else b for b in model.bodies)
    return model.replace(bodies=bodies)


def friction(model: Model, value: float) -> Model:
    """Set the friction coefficient of every contact to `value`."""
    if not model.contacts:
        raise lacking("friction", "contacts")
    return model.replace(
        contacts=tuple(c.unchecked_copy({"friction": float(value)}) for c in model.contacts)
    )


def _with_body(model: Model, old: Body, new: Body) -> Model:
    return model.replace(bodies=tuple(new if b is old else b for b in model.bodies))


def _shared(values: Iterable[float | None]) -> float | None:
    """Return the value that all share, or None if they differ."""
    found = {*values}
    return found.pop() if len(found) == 1 else None


# fmt: off
TABLE = (
    Axis("stiffness", "stiffness of the stiffest spring", "N/m or N m/rad",
         (1e2, 1e3, 1e4, 1e5, 1e6, 1e8, 1e10, 1e12), stiffness, own=own_stiffness),
    Axis("contact_stiffness", "stiffness of soft and penalty contacts", "N/m^1.5 or N/m",
         (1e3, 1e4, 1e5, 1e6, 1e7, 1e8), contact_stiffness, own=lambda model:
         _shared(c.stiffness for c in model.contacts if c.law != "complementarity")),
    Axis("mass_ratio", "mass of the last tip body over its parent's", "",
         (1e-12, 1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9), mass_ratio, own=own_mass_ratio),
    Axis("speed", "largest initial velocity", "rad/s or m/s",
         (0.1, 1.0, 1e1, 1e2, 1e3, 1e4), speed,
         own=lambda model: max((abs(x) for b in model.bodies for x in b.v), default=0.0) or None),
    Axis("friction", "Coulomb friction coefficient of all contacts", "",
         (0, 0.01, 0.1, 0.3, 0.5, 1, 3, 10), friction,
         own=lambda model: _shared(None if c._varies else c.friction for c in model.contacts)),
    Axis("step", "step of the run", "s",
         (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5), of_steps=True),
)
# fmt: on
AXES: dict[str, Axis] = {axis.name: axis for axis in TABLE}


def applicable(model: Model) -> tuple[str, ...]:
    """Return the axes that apply to the model, of which "step" always does."""
    return tuple(name for name, axis in AXES.items() if axis.of_steps or _applies(axis, model))


def _applies(axis: Axis, model: Model) -> bool:
    try:
        axis.applied(model, axis.values[0])
    except PgraphError:  # the model lacks what the axis varies, or does not allow the value
        return False
    return True


def first_axis(model: Model) -> str:
    """Return the first axis that applies to the model, the default for a map."""
    return applicable(model)[0]
