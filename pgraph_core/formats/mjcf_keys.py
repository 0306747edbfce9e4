"""MJCF export of initial states, as keyframes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..fields import GROUND
from ..joints import SIZE
from ..model import Body, Model, Scenario
from ..rotation import matrix, multiply, unit
from .conversion import unused
from .mjcf import INITIAL
from .urdf_out import Tag


def keyframes(model: Model, children: Mapping[str, Sequence[Body]]) -> Iterator[Tag]:
    """Yield keyframes for the initial state, if it is not q = 0 at rest, and for scenarios."""
    start = Scenario(name=INITIAL)
    moved = any(any(b.v) or (not b.floats and any(_away(b.q, b))) for b in model.bodies)
    taken: set[str] = set()
    for s in ((start,) if moved else ()) + tuple(model.scenarios):
        if s is not start and not (s.q or s.v):
            continue
        qpos, qvel = list[float](), list[float]()
        for body in _in_order(children):
            _state(body, s.q.get(body.name, body.q), s.v.get(body.name, body.v), qpos, qvel)
        name = unused(s.name, taken)
        taken.add(name)
        yield Tag("key", name=name, qpos=qpos, qvel=qvel)


def _in_order(children: Mapping[str, Sequence[Body]]) -> Iterator[Body]:
    """Yield the bodies in the order of the file, each before those that it carries."""
    waiting = [*reversed(children.get(GROUND, ()))]
    while waiting:
        body = waiting.pop()
        yield body
        waiting += reversed(children.get(body.name, ()))


def _state(body: Body, q: Any, v: Any, qpos: list[float], qvel: list[float]) -> None:
    """Write the coordinates of a joint into `qpos` and `qvel` in MuJoCo's convention."""
    i = j = 0
    for kind in (m.facts for m in body.sequence):
        if kind.single:
            qpos.append(q[i])
            qvel.append(v[j])
            i, j = i + 1, j + 1
            continue
        if kind.travels:
            qpos += (np.array(q[:3]) + np.array(body.link)).tolist()
            qvel += v[3:6]
            i += 3
        turn, home = unit(q[i : i + 4]), unit(body.rotation)
        w, x, y, z = home
        qpos += multiply(turn, home) if kind.travels else multiply(
            (w, -x, -y, -z), multiply(turn, home)
        )  # fmt: skip
        own = matrix(turn) @ matrix(home)
        qvel += (own.T @ np.array(v[j : j + 3])).tolist()
        i, j = i + 4, j + len(kind.v)


def _away(q: Sequence[float], body: Body) -> Iterator[bool]:
    """Yield for each motion whether its coordinates differ from the zero position."""
    i = 0
    for kind, _ in body.motions:
        size = SIZE[kind][0]
        yield any(q[i : i + size]) if size == 1 else abs(q[i + size - 4]) != 1.0
        i += size
