"""Gains of a new servo, from the load on its joint."""

from __future__ import annotations

import math

import numpy as np

import pgraph_core as pg
from pgraph_core.model.constraint import AtPoints

GROUND, EVERY = "ground", "*"
SAG = 0.05, 0.005  # [rad], [m] under the weight that a servo holds
QUICK = 10.0  # [rad/s] bandwidth of a servo without gravity


def gains(model: pg.Model, name: str) -> dict[str, float]:
    """Return kp and kd for a critically damped servo that holds the load on its joint.

    The weight moves it by SAG at most, at its full lever; the damping is critical.
    """
    model = model.expanded
    kind = next((m.facts for m in model.body(name).sequence), None)
    top, (places, turns) = pg.Topology.of(model), pg.home_poses(model)
    at, mass, lever, inertia = top.names.index(name), 0.0, 0.0, 0.0
    for k in carried(model, top, at + 1):
        one = model.body(top.names[k - 1])
        centre = places[k - 1] + turns[k - 1] @ np.asarray(one.com)
        reach = float(np.linalg.norm(centre - places[at]))
        mass, lever = mass + one.mass, lever + one.mass * reach
        inertia += one.mass * reach**2 + float(np.linalg.norm(one.inertia, 2))
    usual = {"kp": 10.0, "kd": 1.0}
    if kind is None or not kind.flat:
        return usual
    load, moved, sag = (lever, inertia, SAG[0]) if kind.turns else (mass, mass, SAG[1])
    if moved == 0:
        return usual
    kp = max(math.hypot(*model.gravity) * load / sag, moved * QUICK**2)
    return {"kp": float(f"{kp:.2g}"), "kd": float(f"{2 * math.sqrt(kp * moved):.2g}")}


def carried(model: pg.Model, top: pg.Topology, at: int) -> list[int]:
    """Return the numbers of the bodies whose weight may be supported by the joint of body `at`.

    These are the bodies on the outer side of the joint that remain connected through joints and
    loops if it is removed. If only the outer side has contact with the ground, such as a leg, the
    inner side is returned. If both sides have contact, the heavier side is returned.
    """
    free = [model.body(name).floats for name in top.names]
    number = {GROUND: 0} | {name: k for k, name in enumerate(top.names, 1)}
    ties = [(k, int(parent)) for k, parent in enumerate(top.parent, 1)
            if k != at and not free[k - 1]]  # fmt: skip
    ties += [(number[c.body], number[c.other])
             for c in model.constraints
             if c.active and isinstance(c, (AtPoints, pg.CurvePoint))]  # fmt: skip
    floating: set[int] = set()
    for k, parent in enumerate(top.parent, 1):
        if parent in floating or (parent == 0 and free[k - 1]):
            floating.add(k)
    for contact in model.contacts:
        if contact.active and GROUND in contact.pair:
            touching = {n for x in contact.pair for n in (number if x == EVERY else (x,))}
            ties += [(number[n], 0) for n in touching if number[n] in floating]
    inner, outer = int(top.parent[at - 1]), _together(ties, at)
    if inner == 0:
        return sorted(outer - {0})
    other, held = _together(ties, inner), 0 in outer
    if held and 0 in other:
        sides = [outer, other]
        weights = [sum(model.body(top.names[k - 1]).mass for k in s if k) for s in sides]
        return sorted(sides[weights.index(max(weights))] - {0})
    return sorted((other if held else outer) - {0})


def _together(ties: list[tuple[int, int]], start: int) -> set[int]:
    """Return the bodies connected to `start`. Paths may end at the ground (0) but not pass through
    it."""
    near: dict[int, list[int]] = {}
    for a, b in ties:
        near.setdefault(a, []).append(b)
        near.setdefault(b, []).append(a)
    found, left = {start}, [start]
    while left:
        fresh = set(near.get(left.pop(), ())) - found
        found |= fresh
        left += fresh - {0}
    return found
