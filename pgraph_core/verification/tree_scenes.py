"""Scenes of several bodies whose motion a far finer run knows: trees, springs, chaos."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..model import Body, Force, Model, Servo, Spring, Torsion
from .scene import NONE, Rng, Scene, numbers, scale

JOINTS = {
    "revolute": (1, 0), "prismatic": (0, 1), "universal": (2, 0), "spherical": (3, 0),
    "cylindrical": (1, 1), "planar": (1, 2), "compound": (2, 1),
}  # fmt: skip
FIXED_AXES = ("spherical", "universal", "planar", "compound")


def tree(rng: Rng) -> Scene:
    """A random tree of joints of all kinds, some of them damped, here or far from the origin."""
    count, size, m = int(rng.integers(1, 7)), scale(rng, 1e-6, 1e6), scale(rng, 1e-9, 1e9)
    far = size * (10.0 ** float(rng.integers(1, 6)) if rng.random() < 0.3 else 0.0)
    bodies = _bodies(rng, count, size, m, far)
    model = Model(bodies=bodies, gravity=(0, 0, -10 * size))
    what = numbers(n=count, l=size, m=m, far=far)
    return Scene("tree", what, model, scale(rng, 0.1, 5.0), None)


def springs(rng: Rng) -> Scene:
    """A random tree with springs, torsion springs and servos, some of them stiff."""
    count, size, m = int(rng.integers(2, 6)), scale(rng, 1e-3, 1e3), scale(rng, 1e-6, 1e6)
    bodies = _bodies(rng, count, size, m, 0.0)
    forces: list[Force] = []
    for i in range(1, count):
        w, zeta = scale(rng, 1.0, 300.0), float(rng.choice([0.0, 0.1, 1.0]))
        k, d = m * w * w, 2 * zeta * m * w
        kind = int(rng.integers(3))
        if kind == 0:
            ends = size * rng.normal(size=(2, 3))
            forces.append(Spring(
                name=f"f{i}", body=f"b{i}", point=tuple(ends[0].tolist()), stiffness=k, damping=d,
                other_point=tuple((ends[1] + 3 * size).tolist()),
            ))  # fmt: skip
        elif kind == 1:
            stiff: dict[str, Any] = {"stiffness": k * size**2, "damping": d * size**2}
            forces.append(Torsion(name=f"f{i}", body=f"b{i}", rest=0.3, **stiff))
        elif bodies[i].joint in ("revolute", "prismatic"):
            unit = size**2 if bodies[i].joint == "revolute" else 1.0
            forces.append(Servo(name=f"f{i}", body=f"b{i}", kp=k * unit, kd=d * unit, target=0.1))
    model = Model(bodies=bodies, gravity=(0, 0, -10 * size), forces=tuple(forces))
    what = numbers(n=count, l=size, m=m) + f", {[f.kind for f in forces]}"
    return Scene("springs", what, model, scale(rng, 0.1, 2.0), None)


def _bodies(rng: Rng, count: int, size: float, m: float, far: float) -> tuple[Body, ...]:
    found = []
    for i in range(count):
        kind = str(rng.choice(list(JOINTS)))
        turns, slides = JOINTS[kind]
        mass = m * scale(rng, 0.1, 10.0)
        given: dict[str, Any] = {"joint": kind}
        if kind == "compound":
            ways = ("rotate", "translate", "rotate")
            given["motions"] = tuple((way, tuple(rng.normal(size=3).tolist())) for way in ways)
        elif kind not in FIXED_AXES:
            given["axes"] = (tuple(rng.normal(size=3).tolist()),) * (turns + slides)
        if kind == "revolute":
            given["damping"] = (m * size**2 * float(rng.choice([0.0, 0.0, 0.3])),)
        turned, slid = rng.normal(0, 1, turns).tolist(), (size * rng.normal(0, 1, slides)).tolist()
        v = (turned[0], slid[0], turned[1]) if kind == "compound" else (*turned, *slid)
        v = (*slid, *turned) if kind == "planar" else v
        away = far * rng.normal(size=3) if i == 0 else np.zeros(3)
        found.append(Body(
            name=f"b{i}", parent="ground" if i == 0 else f"b{rng.integers(i)}",
            link=tuple((away + size * rng.normal(0, 0.5, 3)).tolist()), mass=mass,
            com=tuple((size * rng.normal(0, 0.3, 3)).tolist()),
            inertia=np.diag(mass * size**2 * rng.uniform(0.1, 0.17, 3)), v=v, **given,
        ))  # fmt: skip
    return tuple(found)


def chaos(rng: Rng) -> Scene:
    """A double pendulum from anywhere, for long."""
    bodies = tuple(
        Body(name=f"b{i}", parent="ground" if i == 0 else "b0", axes=((0, 1, 0),), mass=1.0,
             inertia=NONE, com=(0, 0, -1), link=(0, 0, -i), q=(float(rng.uniform(-3, 3)),))
        for i in range(2)
    )  # fmt: skip
    return Scene("chaos", "", Model(bodies=bodies), float(rng.uniform(2, 30)), None)


FAMILIES: dict[str, Callable[[Rng], Scene]] = {
    "tree": tree, "springs": springs, "chaos": chaos,
}  # fmt: skip
