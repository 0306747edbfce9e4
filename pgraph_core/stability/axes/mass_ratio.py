"""A last body that weighs next to nothing, or next to everything."""

from __future__ import annotations

from ...model import Model
from ...model.names import GROUND
from ...topology import Topology
from ..axis import Axis, changed, lacking


def weighed(model: Model, value: float) -> Model:
    """The last tip body gets `value` times the mass of its parent, and inertia in proportion.

    Raises InputError without a tip body that is carried by another, both with mass.
    """
    topology = Topology.of(model)
    tips = [model.body(topology.names[n - 1]) for n in topology.tips]
    tips = [b for b in tips if b.parent != GROUND and b.mass and model.body(b.parent).mass]
    if not tips:
        raise lacking("mass_ratio", "a tip body's mass over that of the body that carries it")
    tip = tips[-1]
    by = value * model.body(tip.parent).mass / tip.mass
    inertia = tuple(tuple(by * x for x in row) for row in tip.inertia)
    new = changed(tip, mass=by * tip.mass, inertia=inertia)
    return model.replace(bodies=tuple(new if b is tip else b for b in model.bodies))


MASS_RATIO = Axis(
    "mass_ratio",
    "mass of the last tip body over its parent's",
    "",
    (1e-12, 1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9),
    weighed,
)
