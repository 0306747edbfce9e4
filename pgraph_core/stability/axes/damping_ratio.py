"""Dampers beside springs: from none over critical to ten times critical."""

from __future__ import annotations

import math

import numpy as np

from ...constraints.tied import home
from ...joints import nv
from ...model import Force, Model
from ...paper import Operators
from ...topology import Topology
from ..axis import Axis, changed, lacking


def damped(model: Model, value: float) -> Model:
    """Every spring gets the damper c = 2 ζ √(k m), with the mass that it alone would move.

    That is the joint's own entry of the mass matrix in the initial state, and between bodies the
    mass of the lighter. Raises InputError without springs.
    """
    springs = [f for f in model.forces if f.kind in ("spring", "torsion") and f.stiffness]
    if not springs and not any(any(b.stiffness) for b in model.bodies):
        raise lacking("damping_ratio", "the dampers of springs")
    topology = Topology.of(model)
    q = home(model, topology)
    seen = np.diag(Operators(model, topology, q, np.zeros(sum(topology.dof))).mass_matrix)
    first = dict(zip(topology.names, np.cumsum([0, *topology.dof])))
    bodies = []
    for body in model.bodies:
        own = seen[first[body.name] : first[body.name] + nv(body.sequence)]
        found = tuple(
            2 * value * math.sqrt(k * m) if k else c
            for k, c, m in zip(body.stiffness, body.damping, own)
        )
        bodies.append(changed(body, damping=found) if any(body.stiffness) else body)
    forces = tuple(_with_damper(model, f, value) if f in springs else f for f in model.forces)
    return model.replace(bodies=tuple(bodies), forces=forces)


def _with_damper(model: Model, force: Force, value: float) -> Force:
    joined = [model.body(name) for name in (force.body, force.other) if name in model.row]
    seen = min(b.mass if force.kind == "spring" else max(max(r) for r in b.inertia) for b in joined)
    damping = 2 * value * math.sqrt((force.stiffness or 0.0) * seen)
    return force.model_copy(update={"damping": damping})


DAMPING_RATIO = Axis(
    "damping_ratio", "damping over critical damping", "", (0, 0.01, 0.1, 0.5, 1, 2, 5, 10), damped
)
