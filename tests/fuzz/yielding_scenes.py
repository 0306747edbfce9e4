"""Scenes whose forces bend or jump without an expression: struts, penalty contacts, drives at their
limits, and clutches that conditions switch.

SciPy integrates the forces from one change of a side to the next, as in `comparing_scenes`.
Clutches have closed forms.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pgraph_core.forces import Lines, Servo, Strut
from pgraph_core.model import Body, Contact, Model, Scenario, Velocity
from pgraph_core.packing import Array

from .comparing_scenes import Law, Margin, by_sides
from .scene import INTEGRATED, NONE, KnownRun, Rng, numbers, scale, without_gravity

FAR = 50.0  # m: a strut to there turns little
STEPPED: tuple[dict[str, Any], ...] = (
    {"method": "dopri5", "rtol": 1e-6}, {"method": "dop853", "rtol": 1e-10}, {"rtol": 1e-4},
    {"method": "radau5", "rtol": 1e-6}, {"method": "rk4", "parts": 300},
    {"method": "rk4", "parts": 2000}, {"method": "dop853", "parts": 100},
)  # fmt: skip
FLOORED: tuple[dict[str, Any], ...] = (
    {"method": "rk4", "parts": 3000}, {"rtol": 1e-6}, {"method": "dop853", "rtol": 1e-9},
    {"method": "rk4", "parts": 20000},
)  # fmt: skip


def cart(q: float, v: float, **fields: Any) -> Body:
    """A mass of 1 kg that slides along x."""
    return Body(
        name="m", joint="prismatic", axes=((1, 0, 0),), mass=1.0, inertia=NONE, q=(q,), v=(v,),
        **fields,
    )  # fmt: skip


def bent(x: list[float], slopes: list[float], along: int) -> tuple[Lines, list[Margin], Any]:
    """A table that is zero below its first knot, with these `slopes` beyond each, over q or v.

    Return (table, margins, pull by the state and sides).
    """
    values = np.append(0.0, np.cumsum(np.array(slopes[:-1]) * np.diff(x)))
    ends = x[-1] + 1.0
    lines = Lines(
        x=(x[0] - 1.0, *x, ends), value=(0.0, *values.tolist(), float(values[-1] + slopes[-1]))
    )
    rises = np.diff(np.append(0.0, slopes)).tolist()

    def margin(at: float) -> Margin:
        return lambda t, q, v: (q, v)[along] - at

    def pull(state: tuple[float, float], on: Any) -> float:
        return sum(by * (state[along] - at) * side for by, at, side in zip(rises, x, on))

    return lines, [margin(at) for at in x], pull


def strut(rng: Rng) -> KnownRun:
    """An oscillator with a strut whose damper, spring and stop are reached near its peaks."""
    q0, loss = float(rng.uniform(0.3, 2.0)), float(rng.choice([0.0, 0.05]))
    w, short = float(rng.uniform(0.7, 3.0)), scale(rng, 1e-5, 0.5)
    count, peak = int(rng.integers(1, 4)), w * q0
    first = peak * (1.0 - short)
    knots = [first + k * peak * short / 3 for k in range(count)]
    slopes = [scale(rng, 1.0, 1e3) for _ in knots]
    damper, margins, damped = bent(knots, slopes, 1)
    laws = [Law("damper", margins, lambda t, q, v, on: -damped((q, v), on))]
    given: dict[str, Any] = {"damper": damper}
    if rng.random() < 0.5:
        at = q0 * (1.0 - scale(rng, 1e-5, 0.5))
        spring, margins, sprung = bent([at], [scale(rng, 1.0, 1e4)], 0)
        moved = tuple(x + FAR for x in spring.x)
        given["spring"] = spring.unchecked_copy({"x": moved})
        laws.append(Law("spring", margins, lambda t, q, v, on: -sprung((q, v), on)))
    body = cart(-q0, 0.0, stiffness=(w * w,), damping=(loss,))
    force = Strut(name="s", body="m", point=(0, 0, 0), other_point=(-FAR, 0, 0), **given)

    def known(t: Array) -> Array:
        return by_sides(lambda t, q, v: -w * w * q - loss * v, laws, [-q0, 0.0], t)[:, :1]

    told = numbers(q=-q0, w=w, loss=loss, short=short, knots=count)
    span = float(rng.uniform(2, 15))
    model = without_gravity(body, forces=(force,))
    return KnownRun("strut", told, model, span, known, STEPPED, INTEGRATED)


def penalty(rng: Rng) -> KnownRun:
    """A ball that falls on a penalty contact with a damper, or is thrown at it."""
    r, drop = scale(rng, 0.01, 1.0), float(rng.uniform(0.05, 2.0))
    g, deep = scale(rng, 1.0, 20.0), scale(rng, 1e-4, 1e-1)
    k = g / (r * deep)
    c = 2.0 * np.sqrt(k) * float(rng.choice([0.0, rng.uniform(0.01, 1.2)]))
    v0 = float(rng.choice([0.0, rng.uniform(-3, 3)]))
    height = r * (1.0 + drop)
    body = Body(
        name="m", joint="prismatic", axes=((0, 0, 1),), mass=1.0, inertia=NONE, q=(height,),
        v=(v0,), shape={"kind": "sphere", "radius": r},
    )  # fmt: skip
    floor = Contact(name="c", body="m", law="penalty", stiffness=k, damping=c, friction=0.0)
    inside: list[Margin] = [lambda t, q, v: r - q, lambda t, q, v: k * (r - q) - c * v]
    law = Law("floor", inside, lambda t, q, v, on: (k * (r - q) - c * v) * (on[0] and on[1]))

    def known(t: Array) -> Array:
        return by_sides(lambda t, q, v: -g, [law], [height, v0], t)[:, :1]

    model = Model(bodies=(body,), contacts=(floor,), gravity=(0, 0, -g))
    span = float(rng.uniform(0.7, 5.0)) * (np.sqrt(2.0 * r * drop / g) + abs(v0) / g)
    told = numbers(r=r, g=g, k=k, c=c, height=height, v=v0)
    return KnownRun("penalty", told, model, span, known, FLOORED, INTEGRATED)


def servo(rng: Rng) -> KnownRun:
    """A position servo on a spring, which reaches its limits for a short or a long time."""
    k, w = scale(rng, 1.0, 30.0), float(rng.uniform(0.7, 3.0))
    q0, target = float(rng.uniform(-1.5, 1.5)), float(rng.uniform(-1.0, 1.0))
    kp, kd = scale(rng, 0.3, 100.0), scale(rng, 0.01, 5.0)
    most = kp * abs(target - q0) * float(rng.uniform(0.05, 1.1)) + 1e-3
    body = cart(q0, 0.0, stiffness=(w * w,), damping=(0.02,))
    force = Servo(name="f", body="m", kp=kp, kd=kd, target=target, torque_limit=most)

    def pull(q: float, v: float) -> float:
        return kp * (target - q) - kd * v

    law = Law(
        "servo", [lambda t, q, v: pull(q, v) + most, lambda t, q, v: pull(q, v) - most],
        lambda t, q, v, on: (most if on[1] else pull(q, v)) if on[0] else -most,
    )  # fmt: skip

    def known(t: Array) -> Array:
        return by_sides(lambda t, q, v: -w * w * q - 0.02 * v, [law], [q0, 0.0], t)[:, :1]

    told = numbers(k=k, w=w, q=q0, target=target, kp=kp, kd=kd, most=most)
    model = without_gravity(body, forces=(force,))
    span = float(rng.uniform(2, 15))
    return KnownRun("servo", told, model, span, known, STEPPED, INTEGRATED)


def clutch(rng: Rng) -> KnownRun:
    """A cart that runs up to another one on a spring, is coupled to it by a condition on the
    distance, and may be released after a time."""
    a, b, v0 = (scale(rng, 0.2, 5.0) for _ in range(3))
    w, ahead = float(rng.uniform(0.5, 4.0)), float(rng.uniform(0.2, 1.0))
    gap = float(rng.choice([0.0, rng.uniform(0.01, 0.19)]))
    after, span = float(rng.uniform(0.1, 2.0)), float(rng.uniform(0.5, 4.0)) * ahead / v0
    opens = bool(rng.random() < 0.5)
    axis: dict[str, Any] = {"joint": "prismatic", "axes": ((1, 0, 0),), "inertia": NONE}
    one = Body(name="a", mass=a, v=(v0,), **axis)
    two = Body(name="b", mass=b, q=(ahead,), stiffness=(b * w * w,), rest=(ahead,), **axis)
    held = Velocity(name="w", coefficients={"a": [1.0], "b": [-1.0]}, active=False)
    closes: dict[str, Any] = {"holds": f"=q.a > q.b - {gap}"}
    if opens or rng.random() < 0.5:
        closes["once"] = True
    switches: list[Any] = [{"constraint": "w", "active": True, "when": closes}]
    if opens:
        later = {"constraint": "w", "active": True, "after": after}
        switches.append({"constraint": "w", "active": False, "when": later})
    met = (ahead - gap) / v0
    both, slow = a + b, w * np.sqrt(b / (a + b))

    def known(t: Array) -> Array:
        s = np.clip(t - met, 0.0, after if opens else np.inf)
        v1 = a * v0 / both
        x, v = v1 / slow * np.sin(slow * s), v1 * np.cos(slow * s)
        q = np.column_stack((np.where(t < met, v0 * t, ahead - gap + x), ahead + x))
        if opens:
            rest = np.maximum(t - met - after, 0.0)
            free = rest > 0.0
            q[free, 0] += (v * rest)[free]
            swung = x * np.cos(w * rest) + v / w * np.sin(w * rest)
            q[free, 1] = ahead + swung[free]
        return q

    model = without_gravity(
        one, two, constraints=(held,), scenarios=(Scenario(name="x", switches=tuple(switches)),)
    )
    told = numbers(a=a, b=b, v=v0, w=w, ahead=ahead, gap=gap, after=after if opens else np.inf)
    return KnownRun("clutch", told, model, span, known, STEPPED, INTEGRATED, {"scenario": "x"})


FAMILIES: dict[str, Callable[[Rng], KnownRun]] = {
    "strut": strut, "penalty": penalty, "servo": servo, "clutch": clutch,
}  # fmt: skip
