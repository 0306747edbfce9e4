"""Scenes with constraints: loops, gears, rolling, skates, driven joints, clutches, servos."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pgraph_core.model import (
    Body,
    Gear,
    Line,
    Model,
    Motion,
    Motor,
    Polynomial,
    Rolling,
    Servo,
    Sine,
    Skate,
    Switch,
    Table,
    Velocity,
    When,
)
from pgraph_core.packing import Array

from .scene import INTEGRATED, NONE, KnownRun, Rng, integrated, numbers, scale, without_gravity

FIXED: tuple[dict[str, Any], ...] = (
    {"method": "dopri5", "rtol": 1e-6}, {"method": "dop853", "rtol": 1e-10},
    {"method": "rk4", "parts": 400}, {"method": "radau5", "rtol": 1e-6},
)  # fmt: skip


def slider_crank(rng: Rng) -> KnownRun:
    """A crank that turns, its rod on a line: one degree of freedom, by its energy."""
    r, m, g = scale(rng, 1e-6, 1e6), scale(rng, 1e-9, 1e9), float(rng.choice([0.0, 10.0]))
    g = g * r
    rod, spin = r * float(1 + scale(rng, 0.05, 10.0)), float(rng.uniform(-10, 10))
    m1, m2, angle = m * scale(rng, 0.1, 10), m * scale(rng, 0.1, 10), float(rng.uniform(-3, 3))
    inertia = m2 * rod**2 / 12

    def places(q: complex) -> tuple[Any, Any, Any]:
        """(rod's angle, its centre's place along and across the line)."""
        down = np.arcsin(-r / rod * np.sin(q))
        along, across = 0.5 * rod * np.cos(down), 0.5 * rod * np.sin(down)
        return down, r * np.cos(q) + along, r * np.sin(q) + across

    def mass(q: complex) -> Any:
        """Return the effective mass of the crank's kinetic energy, analytic in q."""
        cos = np.cos(np.arcsin(-r / rod * np.sin(q)))
        turn = -r / rod * np.cos(q) / cos
        along = -r * np.sin(q) + 0.5 * turn * r * np.sin(q)
        across = 0.5 * r * np.cos(q)
        return m1 * r * r + m2 * (along**2 + across**2) + inertia * turn**2

    def rate(t: float, y: Array) -> list[float]:
        slope = mass(y[0] + 1e-30j).imag / 1e-30
        weight = g * r * (m1 + 0.5 * m2) * np.cos(y[0])
        return [y[1], float((-0.5 * slope * y[1] ** 2 - weight) / mass(y[0]).real)]

    def known(t: Array) -> Array:
        q = integrated(rate, (angle, spin), t)[:, 0]
        down = np.arcsin(-r / rod * np.sin(q))
        return np.column_stack((q, down - q))

    down = float(np.arcsin(-r / rod * np.sin(angle)))
    turn = float(-r / rod * np.cos(angle) / np.cos(down)) * spin
    crank = Body(name="crank", mass=m1, inertia=NONE, com=(r, 0, 0), q=(angle,), v=(spin,))
    arm = Body(
        name="rod", parent="crank", link=(r, 0, 0), mass=m2, com=(0.5 * rod, 0, 0),
        tip=(rod, 0, 0), inertia=np.diag([0.0, inertia, inertia]), q=(down - angle,),
        v=(turn - spin,),
    )  # fmt: skip
    line = Line(name="line", body="rod", other_point=(0, 0, 0), other_axis=(1, 0, 0))
    model = Model(bodies=(crank, arm), constraints=(line,), gravity=(0, -g, 0))
    what = numbers(r=r, m=m, rod=rod / r, g=g, q=angle, spin=spin)
    return KnownRun(
        "slider-crank", what, model, scale(rng, 0.1, 3.0), known, FIXED, INTEGRATED
    )  # fmt: skip


def rolling(rng: Rng) -> KnownRun:
    """A ball that rolls on a slope without slip."""
    r, m, g = scale(rng, 1e-6, 1e6), scale(rng, 1e-9, 1e9), scale(rng, 1e-2, 1e2)
    way, slope = float(rng.uniform(0, 2 * np.pi)), float(rng.uniform(0, 1.4))
    speed, part = r * float(rng.uniform(0, 10)), float(rng.uniform(0.01, 0.66))
    along = np.array([np.cos(way), np.sin(way), 0.0])
    axis = np.array([-np.sin(way), np.cos(way), 0.0])
    a = r * g * np.sin(slope) / (1 + part)
    place = r * scale(rng, 1e-3, 1e4) * rng.normal(size=2)
    v = np.concatenate((axis * speed / r, along * speed))
    ball = Body(
        name="b", joint="free", mass=m, inertia=np.eye(3) * (part * m * r * r),
        q=(*place.tolist(), r, 1, 0, 0, 0), v=tuple(v.tolist()),
        shape={"kind": "sphere", "radius": r},
    )  # fmt: skip
    gravity = tuple((r * g * (np.sin(slope) * along - np.cos(slope) * np.eye(3)[2])).tolist())
    roll = Rolling(name="roll", body="b", point=(0, 0, 0), radius=r, other_axis=(0, 0, 1))
    model = Model(bodies=(ball,), constraints=(roll,), gravity=gravity)

    def known(t: Array) -> Array:
        s = speed * t + 0.5 * a * t * t
        q = np.zeros((len(t), 7))
        q[:, :2], q[:, 2] = place + np.outer(s, along[:2]), r
        q[:, 3] = np.cos(0.5 * s / r)
        q[:, 4:] = np.outer(np.sin(0.5 * s / r), axis)
        return q

    what = numbers(r=r, m=m, g=r * g, slope=slope, v=speed, far=float(np.hypot(*place)))
    return KnownRun("rolling", what, model, scale(rng, 0.1, 10.0), known, FIXED)


def skate(rng: Rng) -> KnownRun:
    """A skate on a slope: a cycloid."""
    m, g, size = scale(rng, 1e-9, 1e9), scale(rng, 1e-2, 1e2), scale(rng, 1e-6, 1e6)
    spin, v0 = float(rng.choice([-1, 1])) * scale(rng, 0.1, 20), float(rng.uniform(-3, 3))
    g, v0 = g * size, v0 * size
    inertia = np.eye(3) * (m * size**2 * scale(rng, 1e-2, 1e2))
    body = Body(name="b", joint="planar", mass=m, inertia=inertia, v=(v0, 0.0, spin))
    blade = Skate(name="blade", body="b", point=(0, 0, 0), axis=(0, 1, 0))
    model = Model(bodies=(body,), constraints=(blade,), gravity=(g, 0, 0))

    def known(t: Array) -> Array:
        angle = spin * t
        x = v0 / spin * np.sin(angle) + g / (2 * spin**2) * np.sin(angle) ** 2
        y = v0 / spin * (1 - np.cos(angle)) + g / (2 * spin) * (t - np.sin(2 * angle) / (2 * spin))
        return np.column_stack((x, y, angle))

    span = min(scale(rng, 0.1, 10.0), 100 / abs(spin))
    return KnownRun("skate", numbers(m=m, g=g, v=v0, spin=spin), model, span, known, FIXED)


def gear(rng: Rng) -> KnownRun:
    """Two rotors, geared, one with a motor and the other on a spring."""
    one, two = scale(rng, 1e-6, 1e6), scale(rng, 1e-6, 1e6)
    ratio = float(rng.choice([-1, 1])) * scale(rng, 1e-3, 1e3)
    whole = one + ratio**2 * two
    w, push, offset = scale(rng, 0.01, 10), whole * float(rng.normal()), float(rng.normal())
    bodies = (
        Body(name="a", inertia=np.eye(3) * one, q=(0.0,)),
        Body(name="b", inertia=np.eye(3) * two, stiffness=w * w * whole / ratio**2, q=(offset,)),
    )
    tie = Gear(name="tie", body="b", other="a", ratio=ratio, offset=offset)
    motor = Motor(name="motor", body="a", torque=push)
    model = without_gravity(*bodies, constraints=(tie,), forces=(motor,))

    def known(t: Array) -> Array:
        rest = push / (whole * w * w) - offset / ratio
        a = rest * (1 - np.cos(w * t))
        return np.column_stack((a, ratio * a + offset))

    what = numbers(one=one, two=two, ratio=ratio, w=w, push=push)
    return KnownRun("gear", what, model, scale(rng, 0.1, 30.0) / w, known, FIXED)


def driven(rng: Rng) -> KnownRun:
    """A pendulum whose support follows a sine, a polynomial, or a spline through a table."""
    from scipy.interpolate import CubicSpline

    length, m = scale(rng, 1e-6, 1e6), scale(rng, 1e-9, 1e9)
    g, total, angle = 10 * length, scale(rng, 0.1, 10.0), float(rng.uniform(-3, 3))
    size = length * scale(rng, 0.01, 3.0)
    kind = str(rng.choice(["sine", "polynomial", "table"]))
    knots = np.zeros(0)
    if kind == "sine":
        w, phase = scale(rng, 0.1, 30.0), float(rng.uniform(0, 6))
        curve: Any = Sine(amplitude=size, frequency=w, phase=phase)
        support: Any = lambda t, n: size * w**n * np.sin(w * t + phase + 0.5 * np.pi * n)  # noqa: E731
    elif kind == "polynomial":
        c = size * rng.normal(size=4)
        curve = Polynomial(coefficients=tuple(c.tolist()))
        power = np.polynomial.Polynomial(c)
        support = lambda t, n: power.deriv(n)(t) if n else power(t)  # noqa: E731
    else:
        inner = np.sort(rng.uniform(0.02, 0.98, int(rng.integers(1, 8)))) * total
        knots = np.concatenate(([0.0], inner, [total]))
        values = size * rng.normal(size=len(knots))
        curve = Table(t=tuple(knots.tolist()), value=tuple(values.tolist()))
        spline = CubicSpline(knots, values, bc_type="clamped")
        support = lambda t, n: spline(t, n)  # noqa: E731
    start, speed = float(support(0.0, 0)), float(support(0.0, 1))
    bodies = (
        Body(name="cart", joint="prismatic", axes=((1, 0, 0),), mass=m, inertia=NONE, q=(start,),
             v=(speed,)),
        Body(name="b", parent="cart", mass=m, inertia=NONE, com=(0, 0, -length),
             axes=((0, 1, 0),), q=(angle,)),
    )  # fmt: skip
    drive = Motion(name="drive", body="cart", q_of_t=curve)
    model = Model(bodies=bodies, constraints=(drive,), gravity=(0, 0, -g))

    def rate(t: float, y: Array) -> list[float]:
        pull = float(support(t, 2)) * np.cos(y[0]) - g * np.sin(y[0])
        return [y[1], float(pull / length)]

    def known(t: Array) -> Array:
        q = integrated(rate, (angle, 0.0), t, knots)[:, 0]
        return np.column_stack((support(t, 0), q))

    what = f"{kind}, {numbers(l=length, m=m, x=size, q=angle)}"
    return KnownRun("driven", what, model, total, known, FIXED, INTEGRATED)


def servo(rng: Rng) -> KnownRun:
    """A servo that follows a target through knots, stiff or soft."""
    from scipy.linalg import expm

    m, total = scale(rng, 1e-6, 1e6), scale(rng, 0.01, 10.0)
    w, zeta, push = scale(rng, 0.1, 300.0) / total, scale(rng, 0.05, 3.0), float(rng.normal())
    hinge = bool(rng.random() < 0.5)
    size = 1.0 if hinge else scale(rng, 1e-6, 1e6)
    steps = rng.exponential(size=int(rng.integers(2, 12))) * 10 ** rng.uniform(-3, 0, 1)
    knots = total * np.append(0.0, np.cumsum(steps) / max(1.0, float(steps.sum())))
    values = size * rng.normal(size=len(knots))
    target = Table(t=tuple(knots.tolist()), value=tuple(values.tolist()))
    joint: dict[str, Any] = {"joint": "revolute" if hinge else "prismatic"}
    body = Body(name="b", mass=m, inertia=np.eye(3) * m, **joint)
    force = Servo(
        name="s", body="b", target=target, kp=m * w * w, kd=2 * zeta * m * w,
        torque=push * size * m * w * w,
    )  # fmt: skip
    model = without_gravity(body, forces=(force,))
    one = np.array([[0, 1, 0, 0], [-1, -2 * zeta, 1, 0], [0, 0, 0, 1], [0.0, 0, 0, 0]])

    def known(t: Array) -> Array:
        """Return the motion by matrix exponentials in units of 1/w, for linear targets."""
        ends = np.append(knots, np.inf)
        values_, slopes = values + push * size, np.append(np.diff(values) / np.diff(knots), 0.0)
        found, y = np.zeros(len(t)), np.zeros(2)
        for a, b, value, slope in zip(ends, ends[1:], values_, slopes):
            begin = np.array([*y, value, slope / w])
            for i in np.flatnonzero((t >= a) & (t < b)):
                found[i] = (expm(one * (w * (t[i] - a))) @ begin)[0]
            if np.isfinite(b):
                y = (expm(one * (w * (b - a))) @ begin)[:2]
        return found[:, None]

    what = numbers(m=m, w=w, zeta=zeta, knots=len(knots), size=size)
    return KnownRun("servo", what, model, total, known)


def clutch(rng: Rng) -> KnownRun:
    """Two rotors under motors that are coupled for a while, at times or by where they are."""
    one, two = scale(rng, 1e-3, 1e3), scale(rng, 1e-3, 1e3)
    v, push = rng.normal(size=2), rng.normal(size=2)
    total = scale(rng, 0.1, 10.0)
    on, off = np.sort(rng.uniform(0.05, 0.95, 2)) * total
    waits = bool(rng.random() < 0.5)
    if waits:  # for a place that is passed once
        v, push = abs(v) + 0.1, abs(push)
    bodies = tuple(
        Body(name=name, inertia=np.eye(3) * i, v=(float(speed),))
        for name, i, speed in zip("ab", (one, two), v)
    )
    motors = tuple(
        Motor(name=f"m{k}", body=name, torque=float(i * a))
        for k, (name, i, a) in enumerate(zip("ab", (one, two), push))
    )
    tie = Velocity(name="tie", coefficients={"a": (1.0,), "b": (-1.0,)}, active=False)
    first: Any = Switch(t=float(on), constraint="tie", active=True)
    if waits:
        above = float(v[0] * on + 0.5 * push[0] * on**2)
        first = Switch(when=When(coordinate="a", above=above), constraint="tie", active=True)
    switches = (first, Switch(t=float(off), constraint="tie", active=False))
    model = without_gravity(*bodies, constraints=(tie,), forces=motors)
    shares = np.array([one, two]) / (one + two)

    def known(t: Array) -> Array:
        q, speed = np.zeros((len(t), 2)), v.copy()
        place, begin = np.zeros(2), 0.0
        for k, end in enumerate((on, off, np.inf)):
            a = np.full(2, shares @ push) if k == 1 else push
            if k == 1:
                speed = np.full(2, shares @ speed)
            now = (t >= begin) & (t <= end)
            s = (t[now] - begin)[:, None]
            q[now] = place + speed * s + 0.5 * a * s * s
            if np.isfinite(end):
                s = end - begin
                place, speed = place + speed * s + 0.5 * a * s * s, speed + a * s
            begin = end
        return q

    what = numbers(one=one, two=two, on=on, off=off) + (", waits" if waits else "")
    return KnownRun("clutch", what, model, total, known, FIXED, given={"switches": switches})


FAMILIES: dict[str, Callable[[Rng], KnownRun]] = {
    "slider-crank": slider_crank, "rolling": rolling, "skate": skate, "gear": gear,
    "driven": driven, "servo": servo, "clutch": clutch,
}  # fmt: skip
