"""Scenes that move smoothly: springs, pendulums, flights, tables, friction, trees, chaos."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pgraph_core.model import (
    Body,
    Force,
    Model,
    Motor,
    Servo,
    Spring,
    Table,
    Torsion,
    VectorTable,
    Wrench,
)
from pgraph_core.packing import Array

from .scene import NONE, KnownRun, Rng, numbers, scale, without_gravity

# -- one degree of freedom -----------------------------------------------------------------------


def oscillator(rng: Rng) -> KnownRun:
    """A slider or a hinge on its spring, from undamped to overdamped."""
    m, w, size = scale(rng, 1e-9, 1e9), scale(rng, 1e-4, 1e4), scale(rng, 1e-6, 1e3)
    zeta = float(rng.choice([0.0, 0.1, 0.9, 2.0, 30.0, scale(rng, 1e-3, 1e3)]))
    hinge = bool(rng.random() < 0.5)
    size = min(size, 1.0) if hinge else size
    joint: dict[str, Any] = {"joint": "revolute" if hinge else "prismatic"}
    joint["inertia"] = np.eye(3) * m if hinge else NONE
    body = Body(
        name="b", mass=m, stiffness=m * w * w, damping=2 * zeta * m * w, q=(size,),
        axes=((0, 0, 1),), **joint,
    )  # fmt: skip

    def known(t: Array) -> Array:
        root = np.sqrt(abs(zeta * zeta - 1.0))
        if zeta < 1.0:
            turn = np.cos(root * w * t) + zeta * w * t * np.sinc(root * w * t / np.pi)
            return (size * np.exp(-zeta * w * t) * turn)[:, None]
        a = -w * (zeta + root)
        b = w * w / a  # the product of the roots, without cancellation
        x = (a * np.exp(b * t) - b * np.exp(a * t)) / (a - b)
        return (size * x)[:, None]

    span = scale(rng, 0.1, 30.0) / w
    return KnownRun(
        "oscillator", numbers(m=m, w=w, zeta=zeta, x=size), without_gravity(body), span, known
    )


def pendulum(rng: Rng) -> KnownRun:
    """A point mass from rest, by elliptic functions."""
    from scipy.special import ellipj, ellipk

    length, m, g = scale(rng, 1e-6, 1e6), scale(rng, 1e-9, 1e9), scale(rng, 1e-3, 1e3)
    angle = float(rng.uniform(0.01, 3.1))
    body = Body(name="b", mass=m, com=(0, 0, -length), inertia=NONE, axes=((0, 1, 0),), q=(angle,))
    w, k = np.sqrt(g / length), np.sin(angle / 2)

    def known(t: Array) -> Array:
        sn, *_ = ellipj(ellipk(k * k) + w * t, k * k)
        return (2 * np.arcsin(k * sn))[:, None]

    span = scale(rng, 0.1, 20.0) / w
    model = Model(bodies=(body,), gravity=(0, 0, -g))
    return KnownRun("pendulum", numbers(m=m, l=length, g=g, angle=angle), model, span, known)


def pulse(rng: Rng) -> KnownRun:
    """A motor that pushes for a short while: a table with four knots."""
    m, total, push = scale(rng, 1e-3, 1e3), scale(rng, 1e-2, 1e2), scale(rng, 1e-3, 1e3)
    wide, at, rise = scale(rng, 1e-4, 0.3), float(rng.uniform(0.1, 0.6)), 1e-6
    knots = total * np.array([0.0, at, at + rise, at + rise + wide, at + 2 * rise + wide, 1.0])
    torque = push * m / (wide * total) / total
    table = Table(t=tuple(knots.tolist()), value=(0.0, 0.0, torque, torque, 0.0, 0.0))
    body = Body(name="b", joint="prismatic", mass=m, inertia=NONE, axes=((1, 0, 0),))
    model = Model(
        bodies=(body,), gravity=(0, 0, 0), forces=(Motor(name="f", body="b", torque=table),)
    )

    def known(t: Array) -> Array:
        return _pushed(t, knots, np.array(table.value) / m)[:, None]

    return KnownRun("pulse", numbers(m=m, t=total, wide=wide, at=at), model, total, known)


def flight(rng: Rng) -> KnownRun:
    """A free body thrown, which spins about a principal axis."""
    m, speed, spin = scale(rng, 1e-9, 1e9), scale(rng, 1e-6, 1e4), scale(rng, 1e-6, 1e3)
    size, g, span = scale(rng, 1e-6, 1e3), scale(rng, 1e-3, 1e3), scale(rng, 1e-2, 10.0)
    axis, way = int(rng.integers(3)), rng.normal(size=3)
    principal = m * size**2 * np.array([1.0, 1.4, 1.9])
    v = np.zeros(6)
    v[axis], v[3:] = spin, speed * way
    body = Body(name="b", joint="free", mass=m, inertia=np.diag(principal), v=tuple(v.tolist()))

    def known(t: Array) -> Array:
        q = np.zeros((len(t), 7))
        q[:, :3] = np.outer(t, v[3:])
        q[:, 2] -= 0.5 * g * t * t
        q[:, 3], q[:, 4 + axis] = np.cos(0.5 * spin * t), np.sin(0.5 * spin * t)
        return q

    span = min(span, 300.0 / spin)
    model = Model(bodies=(body,), gravity=(0, 0, -g))
    return KnownRun("flight", numbers(m=m, v=speed, spin=spin, r=size, g=g), model, span, known)


def knots(rng: Rng) -> KnownRun:
    """A body in space or on a slider under a force through many knots, near each other or far."""
    m, total, push = scale(rng, 1e-9, 1e9), scale(rng, 1e-3, 1e3), scale(rng, 1e-3, 1e3)
    steps = rng.exponential(size=int(rng.integers(2, 40)))
    steps = steps * 10.0 ** rng.uniform(-float(rng.uniform(0, 4)), 0, len(steps))
    times = total * np.append(0.0, np.cumsum(steps) / steps.sum()) * float(rng.uniform(0.3, 2.0))
    force = m * push / total**2 * rng.normal(size=len(times)) * (rng.random(len(times)) < 0.6)
    free = bool(rng.random() < 0.5)
    if free:
        body = Body(name="b", joint="free", mass=m, inertia=np.eye(3) * m)
        pulls = tuple((float(f), 0.0, 0.0) for f in force)
        load: Force = Wrench(
            name="f", body="b", force=VectorTable(t=tuple(times.tolist()), value=pulls)
        )
    else:
        body = Body(name="b", joint="prismatic", mass=m, inertia=NONE, axes=((1, 0, 0),))
        table = Table(t=tuple(times.tolist()), value=tuple(force.tolist()))
        load = Motor(name="f", body="b", torque=table)
    model = Model(bodies=(body,), gravity=(0, 0, 0), forces=(load,))

    def known(t: Array) -> Array:
        x = _pushed(t, times, force / m)
        if not free:
            return x[:, None]
        q = np.zeros((len(t), 7))
        q[:, 0], q[:, 3] = x, 1.0
        return q

    what = numbers(m=m, t=total, push=push, knots=len(times))
    return KnownRun("knots", what, model, total, known)


def _pushed(t: Array, knots: Array, a: Array) -> Array:
    """x(t) from rest under an acceleration that is straight between knots, constant outside."""
    fine = np.union1d(t, knots)
    at = np.interp(fine, knots, a)
    h = np.diff(fine)
    v = np.append(0.0, np.cumsum(0.5 * h * (at[1:] + at[:-1])))
    x = np.append(0.0, np.cumsum(h * v[:-1] + h * h * (2 * at[:-1] + at[1:]) / 6))
    return x[np.searchsorted(fine, t)]


def coast(rng: Rng) -> KnownRun:
    """A hinge or slider that its own friction brings to rest."""
    m, v0, total = scale(rng, 1e-6, 1e6), scale(rng, 1e-2, 1e2), scale(rng, 1e-2, 1e2)
    pull = v0 / total
    hinge = bool(rng.random() < 0.5)
    joint: dict[str, Any] = {"joint": "revolute" if hinge else "prismatic"}
    body = Body(name="b", mass=m, inertia=np.eye(3) * m, v=(v0,), friction=pull * m, **joint)

    def known(t: Array) -> Array:
        s = np.minimum(t, total)
        return (v0 * s - 0.5 * pull * s * s)[:, None]

    span = total * float(rng.uniform(0.3, 2.0))
    model = without_gravity(body)
    return KnownRun("coast", numbers(m=m, v=v0, t=total), model, span, known, floor=1e-10)


# -- several bodies, whose motion a far finer run knows --------------------------------------------

JOINTS = {
    "revolute": (1, 0), "prismatic": (0, 1), "universal": (2, 0), "spherical": (3, 0),
    "cylindrical": (1, 1), "planar": (1, 2), "compound": (2, 1),
}  # fmt: skip
FIXED_AXES = ("spherical", "universal", "planar", "compound")


def tree(rng: Rng) -> KnownRun:
    """A random tree of joints of all kinds, some of them damped, here or far from the origin."""
    count, size, m = int(rng.integers(1, 7)), scale(rng, 1e-6, 1e6), scale(rng, 1e-9, 1e9)
    far = size * (10.0 ** float(rng.integers(1, 6)) if rng.random() < 0.3 else 0.0)
    bodies = _bodies(rng, count, size, m, far)
    model = Model(bodies=bodies, gravity=(0, 0, -10 * size))
    what = numbers(n=count, l=size, m=m, far=far)
    return KnownRun("tree", what, model, scale(rng, 0.1, 5.0), None)


def springs(rng: Rng) -> KnownRun:
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
    return KnownRun("springs", what, model, scale(rng, 0.1, 2.0), None)


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


def chaos(rng: Rng) -> KnownRun:
    """A double pendulum from anywhere, for long."""
    bodies = tuple(
        Body(name=f"b{i}", parent="ground" if i == 0 else "b0", axes=((0, 1, 0),), mass=1.0,
             inertia=NONE, com=(0, 0, -1), link=(0, 0, -i), q=(float(rng.uniform(-3, 3)),))
        for i in range(2)
    )  # fmt: skip
    return KnownRun("chaos", "", Model(bodies=bodies), float(rng.uniform(2, 30)), None)


FAMILIES: dict[str, Callable[[Rng], KnownRun]] = {
    "oscillator": oscillator, "pendulum": pendulum, "pulse": pulse, "flight": flight,
    "knots": knots, "coast": coast, "tree": tree, "springs": springs, "chaos": chaos,
}  # fmt: skip
