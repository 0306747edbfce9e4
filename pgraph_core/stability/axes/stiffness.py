"""Springs: from soft to as stiff as steel, each loaded at first as it was."""

from __future__ import annotations

from ...joints import SIZE
from ...model import Body, Model
from ..axis import Axis, changed, lacking

BETWEEN = ("spring", "torsion")


def stiffened(model: Model, value: float) -> Model:
    """The stiffest spring gets `value`, the others in proportion.

    A spring of a joint keeps its initial force: the joint starts nearer to the spring's rest, so
    that the motion tends to that of a rigid part. Raises InputError without springs.
    """
    springs = [f for f in model.forces if f.kind in BETWEEN and f.stiffness]
    found = [x for body in model.bodies for x in body.stiffness]
    stiffest = max((*found, *(f.stiffness or 0.0 for f in springs)), default=0.0)
    if stiffest == 0.0:
        raise lacking("stiffness", "springs of joints and between bodies")
    by = value / stiffest
    forces = tuple(
        f.model_copy(update={"stiffness": f.stiffness * by}) if f in springs and f.stiffness else f
        for f in model.forces
    )
    bodies = tuple(_sprung(b, by) if any(b.stiffness) else b for b in model.bodies)
    return model.replace(bodies=bodies, forces=forces)


def _sprung(body: Body, by: float) -> Body:
    q, first = list(body.q), 0
    for motion, k, rest in zip(body.sequence, body.stiffness, body.rest):
        if k and SIZE[motion.kind] == (1, 1):
            q[first] = rest + (q[first] - rest) / by
        first += SIZE[motion.kind][0]
    return changed(body, stiffness=tuple(k * by for k in body.stiffness), q=tuple(q))


STIFFNESS = Axis(
    "stiffness",
    "stiffness of the stiffest spring",
    "N/m or N m/rad",
    (1e2, 1e3, 1e4, 1e5, 1e6, 1e8, 1e10, 1e12),
    stiffened,
)
