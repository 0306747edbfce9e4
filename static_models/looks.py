"""Looks of the built-in models: an animal of tapered limbs, machines with hubs and pins.

Those parts have the role "visual". Plain shapes from mass properties have their body's inertia.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np

import pgraph_core as pg
from pgraph_core.rotation import Quaternion

Vector: TypeAlias = "tuple[float, float, float]"
Point = Sequence[float] | np.ndarray

COAT, PALE, DARK, EYE = "#c99858", "#ead5b2", "#5c422c", "#1e1814"
GRAPHITE, STEEL = "#454c55", "#aeb6c0"
SIDES = (("left", -1.0), ("right", 1.0))


def ball(at: Point, radius: float, colour: str) -> pg.Shape:
    return pg.Shape(
        kind="sphere", radius=radius, position=_vector(at), role="visual", colour=colour
    )


def limb(start: Point, radius: float, end: Point, end_radius: float, colour: str) -> pg.Shape:
    """The hull of two balls."""
    way = np.subtract(end, start)
    length = float(np.linalg.norm(way))
    return pg.Shape(
        kind="capsule",
        radius=radius,
        end_radius=end_radius,
        length=rounded(length),
        position=_vector(np.add(start, end) / 2),
        rotation=turn_from_z(*(way / length)),
        role="visual",
        colour=colour,
    )


def chain(colour: str, *balls: tuple[Point, float]) -> tuple[pg.Shape, ...]:
    """Limbs from each (centre, radius) to the next."""
    return tuple(limb(*a, *b, colour) for a, b in pairwise(balls))


def hub(axis: Point, radius: float, length: float, colour: str = GRAPHITE,
        at: Point = (0, 0, 0)) -> pg.Shape:  # fmt: skip
    """A pin along a joint's axis."""
    way = np.asarray(axis) / np.linalg.norm(axis)
    return pg.Shape(
        kind="cylinder", radius=rounded(radius), length=rounded(length), position=_vector(at),
        rotation=turn_from_z(*way), role="visual", colour=colour,
    )  # fmt: skip


def spots(axis: Sequence[float], radius: float, length: float) -> tuple[pg.Shape, ...]:
    """Return the hub of a wheel and four bolts that make its rotation visible."""
    way = np.asarray(axis, float)
    across = np.cross(way, (0.0, 0.0, 1.0) if way[2] == 0 else (1.0, 0.0, 0.0))
    arms = (across, np.cross(way, across))
    at = [sign * radius * arm for arm in arms for sign in (1, -1)]
    return (hub(axis, 0.3 * radius, 1.3 * length),
            *(hub(axis, 0.2 * radius, 1.1 * length, STEEL, at=a) for a in at))  # fmt: skip


def racket() -> tuple[pg.Shape, ...]:
    """A head with its frame across z, and a handle along x."""
    head = (0.2, 0.0, 0.0)
    return (
        hub((0, 0, 1), 0.3, 0.03, "#c2473f", at=head),
        hub((0, 0, 1), 0.26, 0.034, "#efe9dc", at=head),
        limb((-0.5, 0, 0), 0.032, (-0.24, 0, 0), 0.03, GRAPHITE),
        limb((-0.24, 0, 0), 0.022, (-0.06, 0, 0), 0.02, "#c2473f"),
    )


def machine(model: pg.Model) -> pg.Model:
    """The model with a pin in each of its hinges, and in the hinges that close its loops."""
    pins: dict[str, list[pg.Shape]] = {body.name: [] for body in model.bodies}
    for body in model.bodies:
        if body.joint in ("revolute", "cylindrical", "universal") and body.shape is not None:
            radius = body.shape.radius or 0.03
            pins[body.name].append(hub(body.axes[-1], 0.8 * radius, 2.9 * radius))
    for c in model.constraints:
        body = model.body(c.body)
        if not isinstance(c, pg.Point | pg.Revolute) or body.shape is None or not body.axes:
            continue
        radius = body.shape.radius or 0.03
        axis = (c.axis if isinstance(c, pg.Revolute) else None) or body.axes[-1]
        pins[c.body].append(hub(axis, 0.8 * radius, 2.9 * radius, at=c.point or body.tip_point))
    for name, added in pins.items():
        body = model.body(name)
        if added:
            model = model.edit(name, shapes=(*body.shapes, *added))
    return model


def animal(bodies: Sequence[pg.Body]) -> dict[str, tuple[pg.Shape, ...]]:
    """The parts of the quadruped, by body, in its axes: x ahead, y up."""
    found = {
        "pelvis": (
            *chain(COAT, ((-0.05, -0.005, 0), 0.088), ((0.16, 0.012, 0), 0.09)),
            *chain(
                COAT, ((-0.10, 0.03, 0), 0.042), ((-0.24, 0.0, 0), 0.026),
                ((-0.37, -0.10, 0), 0.019), ((-0.46, -0.16, 0), 0.016), ((-0.55, -0.16, 0), 0.02),
            ),
            ball((-0.562, -0.155, 0), 0.023, DARK),
        ),
        "lumbar": (
            limb((0, 0, 0), 0.09, (0.2, -0.004, 0), 0.1, COAT),
            limb((0.02, -0.03, 0), 0.068, (0.2, -0.045, 0), 0.07, PALE),
        ),
        "thorax": (
            limb((0, -0.004, 0), 0.1, (0.2, -0.02, 0), 0.122, COAT),
            limb((0, -0.045, 0), 0.07, (0.2, -0.07, 0), 0.08, PALE),
        ),
        "shoulder_neck_head": (
            limb((0, -0.02, 0), 0.122, (0.13, -0.035, 0), 0.108, COAT),
            limb((0.02, -0.075, 0), 0.078, (0.15, -0.06, 0), 0.075, PALE),
            *chain(
                COAT, ((0.11, 0.02, 0), 0.092), ((0.23, 0.12, 0), 0.064),
                ((0.315, 0.2, 0), 0.056), ((0.335, 0.215, 0), 0.066), ((0.4, 0.205, 0), 0.05),
            ),
            limb((0.4, 0.195, 0), 0.042, (0.465, 0.172, 0), 0.028, PALE),
            ball((0.489, 0.18, 0), 0.014, DARK),
            *(limb((0.325, 0.265, 0.042 * s), 0.024, (0.308, 0.305, 0.055 * s), 0.009, COAT)
              for _, s in SIDES),
            *(ball((0.386, 0.238, 0.045 * s), 0.012, EYE) for _, s in SIDES),
        ),
    }  # fmt: skip
    link = {body.name: np.asarray(body.link) for body in bodies}
    tip = {body.name: np.asarray(body.tip_point) for body in bodies}
    for side, _ in SIDES:
        for upper, lower, paw, radii in (
            ("humerus", "radius", "front_paw", (0.062, 0.037, 0.024)),
            ("femur", "tibia", "hind_paw", (0.08, 0.044, 0.024)),
        ):
            upper, lower, paw = (f"{side}_{part}" for part in (upper, lower, paw))
            top, knee, ankle = radii
            for name, end, a, b in (
                (upper, link[lower], top, knee), (lower, link[paw], knee, ankle),
            ):  # fmt: skip
                found[name] = chain(COAT, ((0, 0, 0), a), (0.3 * end, 0.97 * a), (end, b))
            sole, toe = tip[paw] + (0, 0.02, 0), np.array((0.036, -0.002, 0))
            found[paw] = (
                limb((0, 0, 0), ankle, 0.85 * sole, 0.02, COAT),
                limb(0.95 * sole, 0.025, sole + toe, 0.018, DARK),
            )
    return found


def _vector(x: Point) -> Vector:
    a, b, c = (rounded(part) for part in x)
    return (a, b, c)


# -- from mass properties: equal inertia -----------------------------------------------------------


def bar(end: Sequence[float], radius: float) -> pg.Shape:
    """A capsule from the body's origin whose rounded end reaches `end` [m]."""
    length = math.hypot(*end)
    x, y, z = (c / length for c in end)
    middle = (length - radius) / 2
    return pg.Shape(
        kind="capsule",
        radius=radius,
        length=rounded(length - radius),
        position=(rounded(x * middle), rounded(y * middle), rounded(z * middle)),
        rotation=turn_from_z(x, y, z),
    )


def segment(body: pg.Body, end: Sequence[float]) -> pg.Shape:
    """A capsule along a leg's segment, as thick as the solid cylinder with the body's inertia."""
    axial = np.linalg.eigvalsh(np.array(body.inertia))[0]
    return bar(end, radius=rounded(math.sqrt(2 * axial / body.mass), 3))


def block(body: pg.Body) -> pg.Shape:
    """The box with the body's mass and inertia, about its centre of mass."""
    moments = np.diag(np.array(body.inertia))
    x, y, z = np.sqrt(12 / body.mass * (moments.sum() / 2 - moments))
    size = (rounded(x, 3), rounded(y, 3), rounded(z, 3))
    return pg.Shape(kind="box", size=size, position=body.com)


def rounded(x: float, digits: int = 6) -> float:
    """Without the last digits, which differ between machines, and without -0."""
    return round(float(x), digits) + 0.0


def turn_from_z(x: float, y: float, z: float) -> Quaternion:
    """The shortest turn from z to a unit direction, as a quaternion [w, x, y, z]."""
    if z < -1 + 1e-12:
        return (0.0, 1.0, 0.0, 0.0)
    w = math.sqrt((1 + z) / 2)
    return (rounded(w, 9), rounded(-y / (2 * w), 9), rounded(x / (2 * w), 9), 0.0)
