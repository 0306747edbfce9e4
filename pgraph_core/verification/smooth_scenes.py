"""Scenes of one body that moves smoothly: springs, pendulums, flights, tables, friction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..model import Body, Force, Model, Motor, Table, VectorTable, Wrench
from ..packing.system import Array
from .scene import NONE, Rng, Scene, numbers, scale, without_gravity

# -- one degree of freedom -----------------------------------------------------------------------


def oscillator(rng: Rng) -> Scene:
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
    return Scene(
        "oscillator", numbers(m=m, w=w, zeta=zeta, x=size), without_gravity(body), span, known
    )


def pendulum(rng: Rng) -> Scene:
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
    return Scene("pendulum", numbers(m=m, l=length, g=g, angle=angle), model, span, known)


def pulse(rng: Rng) -> Scene:
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

    return Scene("pulse", numbers(m=m, t=total, wide=wide, at=at), model, total, known)


def flight(rng: Rng) -> Scene:
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
    return Scene("flight", numbers(m=m, v=speed, spin=spin, r=size, g=g), model, span, known)


def knots(rng: Rng) -> Scene:
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
    return Scene("knots", what, model, total, known)


def _pushed(t: Array, knots: Array, a: Array) -> Array:
    """x(t) from rest under an acceleration that is straight between knots, constant outside."""
    fine = np.union1d(t, knots)
    at = np.interp(fine, knots, a)
    h = np.diff(fine)
    v = np.append(0.0, np.cumsum(0.5 * h * (at[1:] + at[:-1])))
    x = np.append(0.0, np.cumsum(h * v[:-1] + h * h * (2 * at[:-1] + at[1:]) / 6))
    return x[np.searchsorted(fine, t)]


def coast(rng: Rng) -> Scene:
    """A hinge or slider that its own friction brings to rest."""
    from scipy.optimize import brentq

    m, v0, total = scale(rng, 1e-6, 1e6), scale(rng, 1e-2, 1e2), scale(rng, 1e-2, 1e2)
    c, pull = 1e-3, v0 / total
    hinge = bool(rng.random() < 0.5)
    joint: dict[str, Any] = {"joint": "revolute" if hinge else "prismatic"}
    body = Body(name="b", mass=m, inertia=np.eye(3) * m, v=(v0,), friction=pull * m, **joint)

    def after(log: float) -> float:
        """The time, times the deceleration, until log(v)."""
        v = np.exp(log)
        to = np.hypot(v, c) - c * (np.log(c + np.hypot(v, c)) - log)
        return float(np.hypot(v0, c) - c * np.arcsinh(c / v0) - to)

    def path(v: Array) -> Array:
        return 0.5 * (v * np.hypot(v, c) + c * c * np.arcsinh(v / c))

    def known(t: Array) -> Array:
        v = [v0]
        for s in (pull * t[1:]).tolist():
            least = np.log(v0) - 2 * (s + v0) / c - 5
            found: Any = brentq(lambda log, s=s: after(log) - s, least, np.log(v0), xtol=1e-14)
            v.append(float(np.exp(found)))
        return (path(np.array(v0)) - path(np.array(v)))[:, None] / pull

    span = total * float(rng.uniform(0.3, 2.0))
    model = without_gravity(body)
    return Scene("coast", numbers(m=m, v=v0, t=total), model, span, known, floor=1e-10)


FAMILIES: dict[str, Callable[[Rng], Scene]] = {
    "oscillator": oscillator, "pendulum": pendulum, "pulse": pulse, "flight": flight,
    "knots": knots, "coast": coast,
}  # fmt: skip
