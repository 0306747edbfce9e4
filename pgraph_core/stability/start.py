"""The model that a map starts from: with a scenario's parts and a given state as its own."""

from __future__ import annotations

from typing import Any

from ..errors import InputError, Problem
from ..joints import nq, nv
from ..mechanism import Mechanism
from ..model import Model
from .axis import changed


def in_scenario(model: Model, name: str | None) -> tuple[Model, float]:
    """(model, duration [s]): a scenario's state, forces and active parts become the model's.

    Raises ModelError naming the scenarios there are, InputError for one with switches.
    """
    if name is None:
        return model, 1.0
    s = model.scenario(name)
    if s.switches:
        text = f"{name} switches constraints on and off, which a map does not follow; "
        text += "choose another, or none"
        raise InputError(Problem("stability_map", "scenario", text))
    bodies = tuple(
        changed(b, q=s.q.get(b.name, b.q), v=s.v.get(b.name, b.v))
        if b.name in s.q or b.name in s.v
        else b
        for b in model.bodies
    )
    constraints, contacts = (
        parts
        if names is None
        else tuple(p.model_copy(update={"active": p.name in names}) for p in parts)
        for parts, names in ((model.constraints, s.constraints), (model.contacts, s.contacts))
    )
    return model.replace(
        bodies=bodies,
        constraints=constraints,
        contacts=contacts,
        forces=(*model.forces, *s.forces),
        scenarios=(),
    ), s.t_end


def started(model: Model, q: Any, v: Any) -> Model:
    """The model with (q, v), in number order, as its initial state. Raises InputError."""
    if q is None and v is None:
        return model
    mech = Mechanism(model)
    start = mech.home()
    at = mech.position(q) if q is not None else start[0]
    speed = mech.finite("v", v, mech.nv) if v is not None else start[1]
    states: dict[str, tuple[list[float], list[float]]] = {}
    first, second = 0, 0
    for name in mech.names:
        motions = model.body(name).sequence
        n, m = nq(motions), nv(motions)
        states[name] = at[first : first + n].tolist(), speed[second : second + m].tolist()
        first, second = first + n, second + m
    bodies = tuple(changed(b, q=states[b.name][0], v=states[b.name][1]) for b in model.bodies)
    return model.replace(bodies=bodies)
