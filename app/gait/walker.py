"""Walking in a live run: one controller for all its parts, which follows changes of settings."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

import pgraph_core as pg
from pgraph_core.show.shapes import to_matrix

from ..run import Live
from . import LASTS, PUSH, SIDES, Offer, Walking, offered

LYING = 0.8  # [s] duration for which a fall is shown


class Walker:
    """The walk of a live run. Its clock continues across changes of gait, ground and method."""

    def __init__(self, pushes: int) -> None:
        self.fell: float | None = None  # when [s]
        self._walk: Any = None
        self._made_for: tuple[Any, ...] = ()
        self._pushes = pushes  # number of pushes done, earlier ones included
        self._pull: tuple[Any, str] | None = None  # pull of the next part

    def advanced(
        self, mech: pg.Mechanism, offer: Offer, live: Live, walking: Walking, now: Any, span: float
    ) -> pg.Result:
        """Simulate `span` seconds from `now`, given as (t, q, v). q and v are None at the start."""
        t, q, v = now
        walk = self._prepared(mech, offer, live, t, (q, v))
        if offer.gait != walk.gait:
            walk.change(**offer.gait.model_dump())
        if walking.pushes != self._pushes:
            self._pushes = walking.pushes
            force = pushed(mech.model, walk.q, walking.push, walking.strength)
            body = walking.pushed if walking.pushed in mech.names else None
            walk.push(force, LASTS, **({} if body is None else {"body": body}))
        if self._pull is not None:
            force, body = self._pull
            walk.push(force, span, body=body)
            self._pull = None
        part = walk.step(span, frames=1 + max(1, round(span * 60)))
        return self._said_once(part)

    def pull(self, force: np.ndarray, body: str) -> None:
        """Apply a mouse force [N] to a body during the next part."""
        self._pull = tuple(map(float, force)), body

    def _prepared(
        self, mech: pg.Mechanism, offer: Offer, live: Live, t: float, state: tuple[Any, Any]
    ) -> Any:
        made_for = (mech, live.request)
        if made_for != self._made_for:
            old, request = self._walk, live.request
            walk = pg.Walk(
                mech, offer.scenario, gait=offer.gait, q=state[0], v=state[1], step=request.step,
                method=request.method,
            )  # fmt: skip
            walk.t = t
            if old is not None and old.mech.nv == mech.nv:
                walk.controller = old.controller
            self._walk, self._made_for = walk, made_for
        return self._walk

    def _said_once(self, part: pg.Result) -> pg.Result:
        """Report a fall only once, although every part detects it."""
        if not self._walk.fell:
            return part
        if self.fell is None:
            self.fell = float(part.t[0])
            return part
        return replace(part, notices=tuple(x for x in part.notices if "fell" not in x))


def gait_of(model: pg.Model, live: Live, walking: Walking) -> Offer | None:
    """Return the gait of a live run, or None if its scenario has none."""
    scenario = next((s for s in model.scenarios if s.name == live.request.scenario), None)
    if scenario is None or scenario.gait is None:
        return None
    offer = offered(model, walking)
    fits = offer is not None and offer.scenario == scenario.name
    return offer if fits else Offer(scenario.gait, scenario.name, True)


def pushed(
    model: pg.Model, q: np.ndarray, side: str, strength: float = PUSH
) -> tuple[float, float, float]:
    """Return a horizontal push on one side of the trunk, of `strength` times the weight [N]."""
    along, right = SIDES[side]
    R = to_matrix(np.asarray(q[3:7]))
    x, _, z = along * R[:, 0] + right * R[:, 2]
    size = strength * 9.81 * sum(body.mass for body in model.bodies) / float(np.hypot(x, z))
    return size * float(x), 0.0, size * float(z)
