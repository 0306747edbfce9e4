"""Scenes with contacts and joint limits: bounces, slides, stacks, rows of balls."""

from __future__ import annotations

from collections.abc import Callable
from math import gamma
from typing import Any

import numpy as np

from pgraph_core.model import Body, Contact, Ground, Model
from pgraph_core.packing import Array

from .scene import (
    INTEGRATED,
    NONE,
    SOLVED,
    TOUCHING,
    KnownRun,
    Rng,
    integrated,
    numbers,
    scale,
    without_gravity,
)

# -- contacts and limits -------------------------------------------------------------------------


def bounce(rng: Rng) -> KnownRun:
    """A ball dropped on hard ground, or a slider on its limit."""
    r, m = scale(rng, 1e-9, 1e9), scale(rng, 1e-9, 1e9)
    g = r * scale(rng, 1e-1, 1e4)
    h, e = r * scale(rng, 0.1, 1e2), float(rng.choice([0.0, 0.3, 0.5, 0.8, 0.95, 1.0]))
    body = Body(
        name="b", joint="prismatic", axes=((0, 0, 1),), mass=m, q=(r + h,), inertia=NONE,
        shape={"kind": "sphere", "radius": r},
    )  # fmt: skip
    floor = Contact(name="c", body="b", law="complementarity", restitution=e, friction=0.0)
    limited = bool(rng.random() < 0.3)
    if limited:
        body = body.unchecked_copy({"limits": ((r, None),), "limit_restitution": (e,)})
    contacts = () if limited else (floor,)
    model = Model(bodies=(body,), contacts=contacts, gravity=(0, 0, -g))
    fall = np.sqrt(2 * h / g)
    span = fall * float(rng.uniform(0.5, 6.0))

    def known(t: Array) -> Array:
        x, v = np.zeros(len(t)), 0.0
        place, begin = h, 0.0
        ends = fall
        for _ in range(2000):
            now = (t >= begin) & (t < ends)
            x[now] = place + v * (t[now] - begin) - 0.5 * g * (t[now] - begin) ** 2
            v = e * (g * (ends - begin) - v)
            place, begin = 0.0, ends
            ends = begin + 2 * v / g
            if begin > t[-1] or v < 1e-12 * np.sqrt(g * h):
                break
        return (r + x)[:, None]

    return KnownRun(
        "bounce", numbers(r=r, m=m, g=g, h=h, e=e), model, span, known, TOUCHING, SOLVED
    )


def slide(rng: Rng) -> KnownRun:
    """A block pushed over the ground until friction stops it, a ball until it rolls, or a block up
    an incline, where it stays or turns.
    """
    if rng.random() < 1 / 3:
        return turning(rng)
    m, g, mu = scale(rng, 1e-6, 1e6), scale(rng, 1e-1, 1e2), scale(rng, 1e-2, 2.0)
    r = scale(rng, 1e-6, 1e6)
    g, v0 = r * g, r * scale(rng, 1.0, 1e2)
    ball = bool(rng.random() < 0.5)
    floor = Contact(name="c", body="b", law="complementarity", friction=mu, restitution=0.0)
    stop = (2 / 7 if ball else 1.0) * v0 / (mu * g)
    span = stop * float(rng.uniform(0.3, 3.0))
    if ball:
        body = Body(
            name="b", joint="free", mass=m, inertia=np.eye(3) * (0.4 * m * r * r),
            q=(0, 0, r, 1, 0, 0, 0), v=(0, 0, 0, v0, 0, 0), shape={"kind": "sphere", "radius": r},
        )  # fmt: skip
    else:
        body = Body(
            name="b", joint="compound", mass=m, v=(v0, 0.0), inertia=NONE,
            motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1))),
        )  # fmt: skip
        floor = floor.unchecked_copy({"points": ((0.0, 0.0, 0.0),)})
    model = Model(bodies=(body,), contacts=(floor,), gravity=(0, 0, -g))

    def known(t: Array) -> Array:
        s = np.minimum(t, stop)
        x = v0 * s - 0.5 * mu * g * s * s
        if not ball:
            return np.column_stack((x, 0 * x))
        x = x + 5 / 7 * v0 * (t - s)
        angle = (1.25 * mu * g * s * s + 5 / 7 * v0 * (t - s)) / r
        q = np.zeros((len(t), 7))
        q[:, 0], q[:, 2] = x, r
        q[:, 3], q[:, 5] = np.cos(angle / 2), np.sin(angle / 2)
        return q

    return KnownRun(
        "ball" if ball else "slide", numbers(m=m, g=g, mu=mu, r=r, v=v0), model, span, known,
        TOUCHING, SOLVED,
    )  # fmt: skip


def turning(rng: Rng) -> KnownRun:
    """A block thrown up an incline: it stops, and stays or slides down."""
    m, size = scale(rng, 1e-6, 1e6), scale(rng, 1e-6, 1e6)
    g, v0 = size * scale(rng, 1e-1, 1e2), size * scale(rng, 1.0, 1e2)
    slope, mu = float(rng.uniform(0.1, 1.2)), scale(rng, 1e-2, 1.0)
    way = np.array([np.cos(slope), np.sin(slope)])
    up, down = g * (way[1] + mu * way[0]), max(g * (way[1] - mu * way[0]), 0.0)
    body = Body(
        name="b", joint="compound", mass=m, v=tuple((v0 * way).tolist()), inertia=NONE,
        motions=(("translate", (1, 0, 0)), ("translate", (0, 0, 1))),
    )  # fmt: skip
    floor = Contact(name="c", body="b", points=((0.0, 0.0, 0.0),), friction=mu)
    model = Model(bodies=(body,), contacts=(floor,), ground=Ground(slope=slope), gravity=(0, 0, -g))

    def known(t: Array) -> Array:
        rising = np.minimum(t, v0 / up)
        x = v0 * rising - 0.5 * up * rising**2 - 0.5 * down * (t - rising) ** 2
        return np.outer(x, way)

    span = v0 / up * scale(rng, 0.5, 200.0)  # it may turn in the first step
    return KnownRun(
        "incline", numbers(m=m, g=g, mu=mu, v=v0, slope=slope), model, span, known, TOUCHING, SOLVED
    )


def limits(rng: Rng) -> KnownRun:
    """A slider or hinge that flies between its limits."""
    m, size = scale(rng, 1e-9, 1e9), scale(rng, 1e-9, 1e9)
    speed = size * scale(rng, 0.1, 1e3)
    e = float(rng.choice([0.0, 0.5, 0.9, 1.0]))
    hinge = bool(rng.random() < 0.5)
    size = min(size, 3.0) if hinge else size
    body = Body(
        name="b", joint="revolute" if hinge else "prismatic", axes=((0, 0, 1),), mass=m,
        inertia=np.eye(3) * m, limits=((-size, size),), limit_restitution=e, v=(speed,),
    )  # fmt: skip
    span = size / speed * float(rng.uniform(0.5, 12.0))

    def known(t: Array) -> Array:
        x, place, begin, v = np.zeros(len(t)), 0.0, 0.0, speed
        while True:
            ends = begin + (size * np.sign(v) - place) / v if v != 0.0 else np.inf
            now = (t >= begin) & (t <= ends)
            x[now] = place + v * (t[now] - begin)
            if ends > t[-1]:
                return x[:, None]
            place, begin, v = size * np.sign(v), ends, -e * v

    return KnownRun(
        "limits", numbers(m=m, x=size, v=speed, e=e), without_gravity(body), span, known, TOUCHING,
        SOLVED,
    )  # fmt: skip


def head_on(rng: Rng) -> KnownRun:
    """Two balls on one line that meet, a hard or a soft contact of them."""
    m1, m2 = scale(rng, 1e-3, 1e3), scale(rng, 1e-3, 1e3)
    r, e = scale(rng, 1e-6, 1e6), float(rng.uniform(0, 1))
    v0 = r * scale(rng, 1.0, 1e4)
    gap = r * scale(rng, 0.5, 50.0)
    shape = {"kind": "sphere", "radius": r}
    line: dict[str, Any] = {
        "joint": "prismatic",
        "axes": ((1, 0, 0),),
        "shape": shape,
        "inertia": NONE,
    }
    one = Body(name="a", mass=m1, v=(v0,), **line)
    two = Body(name="b", mass=m2, link=(2 * r + gap, 0, 0), **line)
    pair = Contact(name="c", body="a", other="b", law="complementarity", restitution=e)
    model = Model(bodies=(one, two), contacts=(pair,), gravity=(0, 0, 0))
    span, hit = gap / v0 * float(rng.uniform(0.5, 5.0)), gap / v0

    def known(t: Array) -> Array:
        push = (1 + e) * v0 / (1 / m1 + 1 / m2)
        after = np.maximum(t - hit, 0.0)
        before = np.minimum(t, hit)
        return np.column_stack((v0 * before + (v0 - push / m1) * after, push / m2 * after))

    others = ({"parts": 300}, {"parts": 3000})
    return KnownRun(
        "head on", numbers(m1=m1, m2=m2, r=r, v=v0, gap=gap, e=e), model, span, known, others,
        SOLVED,
    )  # fmt: skip


def soft_meeting(rng: Rng) -> KnownRun:
    """Two soft balls that meet without losses, and press each other in by up to a tenth.

    Hertz's law: in depths and times of the impact z'' = -1.25 z^1.5 [Hertz 1882].
    """
    scene = head_on(rng)
    one, two = scene.model.bodies
    m1, m2, v0 = one.mass, two.mass, float(one.v[0])
    r = float(one.shapes[0].radius or 0.0)
    gap, deep = float(two.link[0]) - 2 * r, r * scale(rng, 1e-3, 0.1)
    hit, unit, mass = gap / v0, deep / v0, 1 / (1 / m1 + 1 / m2)
    half = np.sqrt(np.pi) * gamma(1.4) / gamma(0.9)  # its time to the deepest point
    stiffness = 1.25 * mass * v0**2 / deep**2.5
    model = scene.model.edit("c", law="soft", restitution=None, damping=0.0, stiffness=stiffness)

    def depth(s: Array) -> Array:
        inwards = np.where(s < half, s, 2 * half - s)  # the way out is the way in
        order = np.argsort(inwards)
        times = np.concatenate(([0.0], inwards[order], [half]))
        found = np.zeros(len(s))
        found[order] = integrated(lambda _, z: (z[1], -1.25 * abs(z[0]) ** 1.5), (0, 1), times)[
            1:-1, 0
        ]
        return found

    def known(t: Array) -> Array:
        apart, s = gap - v0 * t, (t - hit) / unit
        touching, after = (s > 0.0) & (s < 2 * half), s >= 2 * half
        apart[touching] = -deep * depth(s[touching])
        apart[after] = deep * (s[after] - 2 * half)
        first = (m1 * v0 * t - m2 * (apart - gap)) / (m1 + m2)
        return np.column_stack((first, first + apart - gap))

    return scene._replace(
        family="soft meeting", model=model, known=known, floor=INTEGRATED,
        what=f"{scene.what}, {numbers(deep=deep / r)}",
        others=({"method": "dopri5", "rtol": 1e-5}, {"method": "dop853", "rtol": 1e-10}),
    )  # fmt: skip


# -- several contacts ----------------------------------------------------------------------------


def brick(rng: Rng) -> KnownRun:
    """Return a pushed flat box on a slope that stays, slides to a stop, or slides on."""
    m, g, mu = scale(rng, 1e-9, 1e9), scale(rng, 1e-1, 1e2), scale(rng, 1e-2, 2.0)
    a = scale(rng, 1e-6, 1e4)
    high = a * scale(rng, 1e-2, 1.0) * min(1.0, 0.3 / mu)
    g *= a
    slope = float(np.arctan(mu * rng.choice([0.0, 0.5, 0.999, 1.001, 1.5])))
    rest = bool(rng.random() < 0.3)
    v0 = 0.0 if rest else np.sqrt(g * a) * scale(rng, 1e-2, 10.0)
    away = a * 10.0 ** float(rng.integers(-3, 5)) * rng.normal(size=2)
    size, i = (a, a, high), m * (a * a + high * high) / 12
    body = Body(
        name="b", joint="free", mass=m, inertia=np.diag([i, i, m * a * a / 6]),
        q=(*away.tolist(), 0.5 * high, 1, 0, 0, 0), v=(0, 0, 0, v0, 0, 0),
        shape={"kind": "box", "size": size},
    )  # fmt: skip
    floor = Contact(name="c", body="b", law="complementarity", friction=mu, restitution=0.0)
    down, press = g * np.sin(slope), g * np.cos(slope)
    model = Model(bodies=(body,), contacts=(floor,), gravity=(float(down), 0, float(-press)))
    moving = down - mu * press  # acceleration of a box that slides
    total = 5 * np.sqrt(a / g) * float(rng.uniform(0.1, 2.0))

    def known(t: Array) -> Array:
        s = t
        if v0 == 0.0 and moving <= 0:
            s = 0 * t
        elif moving < 0:
            s = np.minimum(t, -v0 / moving)
        q = np.zeros((len(t), 7))
        q[:, 0], q[:, 1] = away[0] + v0 * s + 0.5 * moving * s * s, away[1]
        q[:, 2], q[:, 3] = 0.5 * high, 1.0
        return q

    what = numbers(m=m, a=a, high=high / a, g=g, mu=mu, tan=np.tan(slope) / mu, v=v0, far=away[0])
    others = ({"parts": 100}, {"rtol": 1e-8}, {"method": "dopri5", "rtol": 1e-5})
    return KnownRun("brick", what, model, float(total), known, others, SOLVED)


def stack(rng: Rng) -> KnownRun:
    """Boxes or balls on each other at rest."""
    count, a, m = int(rng.integers(2, 9)), scale(rng, 1e-4, 1e3), scale(rng, 1e-6, 1e6)
    ratio, away = float(rng.choice([1.0, 1.0, 0.1, 10.0])), scale(rng, 1e-3, 1e3)
    boxes = bool(rng.random() < 0.7)
    bodies, z = [], 0.0
    for i in range(count):
        mass = m * float(ratio ** (i / (count - 1)))
        side = a * float(rng.uniform(0.7, 1.0))
        shape: dict[str, Any] = {"kind": "box", "size": (side, side, side)}
        if not boxes:
            shape = {"kind": "sphere", "radius": 0.5 * side}
        given: dict[str, Any] = {"joint": "free", "q": (away * a, 0, z + 0.5 * side, 1, 0, 0, 0)}
        if not boxes:  # a column of balls stands on a line only
            given = {"joint": "prismatic", "axes": ((0, 0, 1),), "q": (z + 0.5 * side,)}
        bodies.append(Body(
            name=f"b{i}", mass=mass, inertia=np.eye(3) * (mass * side**2 / 6), shape=shape, **given,
        ))  # fmt: skip
        z += side
    every = Contact(name="c", body="*", other="*", law="complementarity", restitution=0.0)
    floor = Contact(name="g", body="*", law="complementarity", restitution=0.0)
    g = 10 * a
    model = Model(bodies=tuple(bodies), contacts=(every, floor), gravity=(0, 0, -g))
    start = np.concatenate([body.q for body in bodies])

    def known(t: Array) -> Array:
        return np.tile(start, (len(t), 1))

    what = numbers(n=count, a=a, m=m, ratio=ratio, far=away) + (", boxes" if boxes else ", balls")
    others = ({"parts": 100}, {"parts": 1000})
    return KnownRun(
        "stack", what, model, float(rng.uniform(0.2, 2.0)), known, others, SOLVED
    )  # fmt: skip


def row(rng: Rng) -> KnownRun:
    """Balls on a line with gaps between them that hit each other, one after the other."""
    count, r = int(rng.integers(2, 7)), scale(rng, 1e-6, 1e6)
    v0 = r * scale(rng, 1.0, 1e4)
    e = float(rng.choice([1.0, 1.0, 0.9, 0.7]))
    equal = bool(rng.random() < 0.4)
    m = np.array([1.0 if equal else scale(rng, 0.01, 100.0) for _ in range(count)])
    gaps = r * np.array([scale(rng, 1e-3, 10.0) for _ in range(count - 1)])
    v = v0 * (np.arange(count) == 0) if equal else v0 * rng.normal(size=count)
    start = np.append(0.0, np.cumsum(2 * r + gaps))
    line: dict[str, Any] = {"joint": "prismatic", "axes": ((1, 0, 0),), "inertia": NONE}
    bodies = tuple(
        Body(name=f"b{i}", mass=float(m[i]), link=(float(start[i]), 0, 0), v=(float(v[i]),),
             shape={"kind": "sphere", "radius": r}, **line)
        for i in range(count)
    )  # fmt: skip
    pair = Contact(name="c", body="*", other="*", law="complementarity", restitution=e, friction=0)
    model = Model(bodies=bodies, contacts=(pair,), gravity=(0, 0, 0))
    span = float(gaps.sum() / v0 * rng.uniform(0.5, 3.0))
    hits = _hits(m, v, gaps, e, span)
    if len(hits) > 60:  # they may come together without end
        span = 0.5 * (hits[59][0] + hits[60][0])
        hits = hits[:60]

    def known(t: Array) -> Array:
        q, place, begin, speed = np.zeros((len(t), count)), np.zeros(count), 0.0, v
        for end, after in (*hits, (np.inf, v)):
            now = (t >= begin) & (t <= end)
            q[now] = place + np.outer(t[now] - begin, speed)
            if np.isfinite(end):
                place, begin, speed = place + speed * (end - begin), end, after
        return q

    what = numbers(n=count, r=r, v=v0, e=e, hits=len(hits))
    others = ({"parts": 300}, {"parts": 3000})
    return KnownRun("row", what, model, span, known, others, SOLVED)


def _hits(m: Array, v: Array, gaps: Array, e: float, span: float) -> list[tuple[float, Array]]:
    """(time, velocities after it) of impacts of balls in a row."""
    found: list[tuple[float, Array]] = []
    t, gaps, v = 0.0, gaps.copy(), v.copy()
    while len(found) < 100:
        closing = v[:-1] - v[1:]
        wait = np.full(len(gaps), np.inf)
        wait[closing > 0] = gaps[closing > 0] / closing[closing > 0]
        k = int(np.argmin(wait))
        if t + wait[k] > span:
            break
        gaps -= wait[k] * closing
        t, gaps[k] = t + wait[k], 0.0
        push = (1 + e) * closing[k] / (1 / m[k] + 1 / m[k + 1])
        v = v.copy()
        v[k] -= push / m[k]
        v[k + 1] += push / m[k + 1]
        found.append((float(t), v))
    return found


FAMILIES: dict[str, Callable[[Rng], KnownRun]] = {
    "bounce": bounce, "slide": slide, "limits": limits, "head on": head_on,
    "soft meeting": soft_meeting, "brick": brick, "stack": stack, "row": row,
}  # fmt: skip
