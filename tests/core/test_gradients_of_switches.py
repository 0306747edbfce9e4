"""Derivatives of a run through constraints that are switched on."""

from typing import Any

import numpy as np
import pytest

import pgraph_core as pg

from ..nights import combined
from .test_gradients import missed

RATIO = 1.5
INERTIAL = ["bodies.b.mass", "bodies.b.com.2", "bodies.b.armature.0", "bodies.w.inertia.1.1"]


def joined(**given):
    """A pendulum beside a wheel: the clutch makes its speed that of the wheel times RATIO."""
    b = pg.Body(
        name="b", axes=((0, 1, 0),), mass=2.0, com=(0, 0, -0.5), inertia=(0.02,) * 3,
        armature=0.01, q=(0.1,), v=(4.0,),
    )  # fmt: skip
    w = pg.Body(name="w", axes=((0, 1, 0),), mass=1.0, inertia=(0.1,) * 3, link=(0, 1, 0), v=(0.5,))
    clutch = pg.Velocity(name="c", body="b", coefficients={"b": 1.0, "w": -RATIO}, active=False)
    return pg.Model(bodies=[b, w], constraints=[clutch], **given)


WHEN = {
    "time": [(0.07, "c", True)],
    "angle": [{"constraint": "c", "active": True, "when": {"coordinate": "b", "above": 0.3}}],
}


@pytest.mark.parametrize("when", WHEN)
@pytest.mark.parametrize("options", [{}, {"method": "radau5"}, {"method": "rk4", "step": 1e-3}])
def test_a_clutch_divides_the_momentum_by_the_inertias(when, options):
    """w = (I r v + J w0) / (I r² + J), of the moments of inertia I and J."""
    run = pg.simulate(
        joined(gravity=(0, 0, 0)), t_end=0.1, frames=3, switches=WHEN[when], wrt=INERTIAL, **options
    )
    inertia = np.array([2.0 * 0.5**2 + 0.02 + 0.01, 0.1])
    weights, above = np.array([RATIO**2, 1.0]), np.array([RATIO * 4.0, 0.5])
    total, speed = weights @ inertia, above @ inertia / (weights @ inertia)
    assert run.v[-1] == pytest.approx([RATIO * speed, speed], rel=1e-9)
    slopes = (above - weights * speed) / total
    exact = np.array([0.5**2, 2 * 2.0 * -0.5, 1.0, 0.0]) * slopes[0]
    exact[3] = slopes[1]
    found = [run.sensitivity(path)[-1, 3] for path in INERTIAL]
    assert found == pytest.approx(exact, rel=1e-7)


def pairs_of_links(friction=0.0, **given):
    """Two double pendulums side by side, whose inertias depend on their angles."""
    bodies = []
    for n, (name, q) in enumerate((("a", 0.3), ("b", -0.4))):
        size = {"mass": 1.0 + n, "com": (0, 0, -0.3), "inertia": (0.02,) * 3}
        bodies += [
            pg.Body(name=name, axes=((0, 1, 0),), q=(q,), v=(2.0,), link=(0, n, 0), **size),
            pg.Body(
                name=f"{name}2", parent=name, axes=((0, 1, 0),), q=(0.8,), v=(-1.0,),
                link=(0, 0, -0.5), friction=friction, **size,
            ),
        ]  # fmt: skip
    return pg.Model(bodies=bodies, **given)


SWITCHED = {
    "clutch": pg.Velocity(name="c", body="a", coefficients={"a": 1.0, "b": -1.0}, active=False),
    "points": pg.Distance(
        name="c", body="a2", other="b2", point=(0, 0, -0.5), other_point=(0, 0, -0.5),
        length=1.19, active=False,
    ),
}  # fmt: skip


CHANGED = {
    "bodies.a2.mass": lambda model, h: model.edit("a2", mass=1.0 + h),
    "bodies.b.com.2": lambda model, h: model.edit("b", com=(0, 0, -0.3 + h)),
    "q.a2": lambda model, h: model.edit("a2", q=(0.8 + h,)),
    "v.b": lambda model, h: model.edit("b", v=(2.0 + h,)),
    "constraints.c.value": lambda model, h: model.edit("c", value=h),
    "constraints.c.length": lambda model, h: model.edit("c", length=1.19 + h),
}


PATHS = ["bodies.a2.mass", "bodies.b.com.2", "q.a2", "v.b", "constraints.c"]


@pytest.mark.parametrize(("kind", "path", "friction"), combined(SWITCHED, PATHS, [0.0, 0.05]))
def test_a_constraint_switched_on_has_the_derivatives_of_differences(kind, path, friction):
    """The impulse depends on the inertias at the positions, which meet the constraint then."""
    if path == "constraints.c":
        path += ".value" if kind == "clutch" else ".length"
    model, h = pairs_of_links(friction, constraints=[SWITCHED[kind]]), 1e-4
    call: dict[str, Any] = {"t_end": 0.1, "frames": 3, "switches": [(0.07, "c", True)]}
    call |= {"method": "moreau_jean", "step": 2e-3} if friction else {"rtol": 1e-10}
    run = pg.simulate(model, wrt=[path], estimate=False, **call)
    ends = [pg.simulate(CHANGED[path](model, s * h), estimate=False, **call) for s in (1, -1)]
    a, b = (np.concatenate((end.q[-1], end.v[-1])) for end in ends)
    assert run.status.ok
    assert not [text for text in run.notices if "derivatives" in text]
    assert missed(run.sensitivity(path)[-1], (a - b) / (2 * h)) < 1e-5
