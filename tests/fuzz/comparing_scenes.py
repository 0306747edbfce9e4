"""Scenes whose forces compare the motion: windows, thresholds, clamps, grazing, moving bounds.

SciPy integrates them from one change of a side to the next. A law has a text, its margins, and its
force by their sides.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from pgraph_core.model import Body, Motor
from pgraph_core.packing import Array

from .scene import INTEGRATED, NONE, KnownRun, Rng, numbers, scale, without_gravity

Margin = Callable[[float, float, float], float]  # of t, q, v
AT_ONCE = 1e-11  # of a run: changes that follow each other within it make no motion to judge
MOST_CHANGES = 400
PLACES = 9  # of a step at which margins are looked at


class Law(NamedTuple):
    """A force that compares, for a mass of 1 kg whose motion is about 1 m and 1 rad/s."""

    text: str
    margins: Sequence[Margin]
    force: Callable[[float, float, float, Sequence[bool]], float]  # t, q, v, positive margins


def laws(rng: Rng) -> list[Law]:
    """One of each kind, with random numbers."""
    a, c, k, f = rng.uniform(-1, 1), rng.uniform(-1, 1), scale(rng, 0.1, 30.0), rng.uniform(-1, 1)
    w, n, s, p = scale(rng, 1e-6, 1.0), rng.uniform(1, 30), rng.uniform(-1, 1), rng.uniform(0.3, 3)
    b = a + w

    def at(x: float) -> Margin:
        return lambda t, q, v: q - x

    def fast(x: float) -> Margin:
        return lambda t, q, v: v - x

    return [
        Law(f"if(q.m > {a} and q.m < {b}, {f}, 0)", [at(a), at(b)],
            lambda t, q, v, on: f * (on[0] and not on[1])),
        Law(f"if(abs(q.m - {a}) < {w}, {f}, 0)", [at(a - w), at(a + w)],
            lambda t, q, v, on: f * (on[0] and not on[1])),
        Law(f"if(v.m > {c}, {f}, 0)", [fast(c)], lambda t, q, v, on: f * on[0]),
        Law(f"min(max(-{k}*(q.m - {a}), -{w}), {w})", [at(a - w / k), at(a + w / k)],
            lambda t, q, v, on: (-w if on[1] else -k * (q - a)) if on[0] else w),
        Law(f"-{k}*max(q.m - {a}, 0)", [at(a)], lambda t, q, v, on: -k * (q - a) * on[0]),
        Law(f"if(sin({n}*q.m) > {s}, {f}, 0)", [lambda t, q, v: np.sin(n * q) - s],
            lambda t, q, v, on: f * on[0]),
        Law(f"if(q.m > {a}*cos({p}*t), {f}, 0)", [lambda t, q, v: q - a * np.cos(p * t)],
            lambda t, q, v, on: f * on[0]),
        Law(f"if(not q.m < {b} or v.m > {c}, {f}, 0)", [at(b), fast(c)],
            lambda t, q, v, on: f * (on[0] or on[1])),
        Law(f"-{w}*v.m*abs(v.m)", [fast(0.0)], lambda t, q, v, on: -w * v * abs(v)),
        Law(f"if(q.m^2 + (v.m*1)^2 > {a * a + w}, {f}, 0)",
            [lambda t, q, v: q * q + v * v - (a * a + w)], lambda t, q, v, on: f * on[0]),
        Law(f"if(q.m > {1 - w * w}, {f}, 0)", [at(1 - w * w)], lambda t, q, v, on: f * on[0]),
    ]  # fmt: skip


def comparing(rng: Rng) -> KnownRun:
    """A mass on a spring with one to three laws."""
    every, count = laws(rng), int(rng.integers(1, 4))
    chosen = [every[i] for i in rng.choice(len(every), count, replace=False)]
    if count > 1:
        other = laws(rng)
        chosen[-1] = other[int(rng.integers(len(other)))]
    loss, push, rate = rng.choice([0.0, 0.1]), rng.choice([0.0, 0.3]), rng.uniform(0.3, 3)
    start, span = [float(rng.choice([1.0, rng.uniform(-1, 1)])), 0.0], float(rng.uniform(1, 15))
    if start[0] == 1.0:
        start = [0.0, 1.0]
    text = f"={push}*cos({rate}*t)" + "".join(f" + {law.text}" for law in chosen)
    body = Body(
        name="m", joint="prismatic", axes=((1, 0, 0),), mass=1.0, inertia=NONE, stiffness=(1.0,),
        damping=(loss,), q=(start[0],), v=(start[1],),
    )  # fmt: skip

    def smooth(t: float, q: float, v: float) -> float:
        return -q - loss * v + push * np.cos(rate * t)

    def known(t: Array) -> Array:
        return by_sides(smooth, chosen, start, t)[:, :1]

    model = without_gravity(body, forces=(Motor(name="f", body="m", torque=text),))
    told = numbers(loss=loss, push=push, rate=rate, q=start[0], v=start[1]) + "; " + text
    return KnownRun("comparing", told, model, span, known, floor=INTEGRATED)


def by_sides(
    smooth: Callable[[float, float, float], float], chosen: Sequence[Law], start: Sequence[float],
    t: Array,
) -> Array:  # fmt: skip
    """Return (q, v) at times t (n, 2), nan from where sides change again at once."""
    from scipy.integrate import DOP853, solve_ivp

    margins = [m for law in chosen for m in law.margins]
    found = np.full((len(t), 2), np.nan)
    now, y = float(t[0]), np.array(start, dtype=float)
    soon = AT_ONCE * float(t[-1] - t[0])

    def rates(on: Sequence[bool]) -> Callable[[float, Array], list[float]]:
        def rate(t: float, y: Array) -> list[float]:
            total, first = smooth(t, y[0], y[1]), 0
            for law in chosen:
                last = first + len(law.margins)
                total += law.force(t, y[0], y[1], on[first:last])
                first = last
            return [y[1], total]

        return rate

    given: dict[str, Any] = {"rtol": 1e-13, "atol": 1e-14}
    on = [m(now, *y) > 0 for m in margins]
    for _ in range(MOST_CHANGES):
        rate, begun = rates(on), now  # past the change, where it is certain which side it is on
        y = solve_ivp(rate, (now, now + soon), y, method="DOP853", **given).y[:, -1]
        now += soon
        on = [m(now, *y) > 0 for m in margins]
        solver: Any = DOP853(rates(on), now, y, t[-1], max_step=0.02, **given)
        met, way = None, solver
        while solver.status == "running" and met is None:
            solver.step()
            way = solver.dense_output()
            met = first_change(margins, on, way)
            end = solver.t if met is None else met[0]
            mine = (t >= (begun if way.t_old == now else way.t_old)) & (t <= end)
            found[mine] = way(t[mine]).T
        if met is None or met[0] - now < soon:
            return found
        y, now = way(met[0]), met[0]
        on = [side != (i == met[1]) for i, side in enumerate(on)]
    return found


def first_change(
    margins: Sequence[Margin], on: Sequence[bool], way: Any
) -> tuple[float, int] | None:
    """Return (time, number) of the first margin that changes its sign on the way of a step.

    A margin is at its least between two of PLACES, where it may be negative for a short time.
    """
    from scipy.optimize import brentq, minimize_scalar

    places, changes = np.linspace(way.t_old, way.t, PLACES), []
    for i, (margin, side) in enumerate(zip(margins, on)):

        def beyond(t: Any, margin: Margin = margin, side: bool = side) -> Any:
            return (1.0 if side else -1.0) * margin(t, *way(t))

        at, values = list(places), beyond(places)
        falls = np.diff(values) < 0.0
        for k in np.flatnonzero(np.append(True, falls) & ~np.append(falls, False)).tolist():
            bounds = places[max(k - 1, 0)], places[min(k + 1, PLACES - 1)]
            exact: Any = {"bounds": bounds, "method": "bounded", "options": {"xatol": 1e-12}}
            least: Any = minimize_scalar(beyond, **exact)
            at.append(float(least.x))
        at.sort()
        k = int((beyond(np.array(at)) < 0.0).argmax())
        if beyond(at[k]) < 0.0:
            changes.append((brentq(beyond, at[k - 1], at[k], xtol=1e-15) if k else at[0], i))
    return min(changes, default=None)


FAMILIES: dict[str, Callable[[Rng], KnownRun]] = {"comparing": comparing}
