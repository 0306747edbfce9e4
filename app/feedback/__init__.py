"""State feedback by LQR or pole placement: what is asked, the gains, and the closed loop (pure).

Weights follow Bryson's rule, one over the square of the largest deviation or input that is allowed
[Bryson and Ho, Applied Optimal Control, 1975].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Self

import numpy as np
from scipy.linalg import expm

import pgraph_core as pg
from pgraph_core.forces import OnJoint
from pgraph_core.model.expressions import wanted
from pgraph_core.signals import parsed
from pgraph_core.signals.meaning import unit
from pgraph_core.units import UNITS

from .. import model as model_
from .. import pose
from ..signals import known_of

NEAR = {"angle": 0.2, "length": 0.1}  # [rad], [m] deviations that a person means by small
CONSTANTS_OF_TIME, POINTS = 5.0, 120  # span of a response, and its points
Method = Literal["lqr", "poles"]


@dataclass(frozen=True)
class Asked:
    """Request of a page: a method, the permitted values, and the coordinates to feed back."""

    method: Method = "lqr"
    largest: Mapping[str, float | None] = field(default_factory=dict)  # None: left out
    states: tuple[str, ...] | None = None  # coordinates that the others follow
    poles: tuple[complex, ...] | None = None  # [1/s]
    step: str = ""  # state whose setpoint steps in the response


@dataclass(frozen=True)
class Design:
    """The feedback that a page looks at, or why there is none. It is being computed if `busy`."""

    model: pg.Model
    q: np.ndarray
    asked: Asked = Asked()
    largest: Mapping[str, float] = field(default_factory=dict)  # asked for or usual, by name
    found: pg.Feedback | None = None
    problem: str = ""
    busy: bool = True


@dataclass(frozen=True)
class Client(model_.Client, pose.Client):
    design: Design | None = None
    response: Any = None  # a `Response`

    def afresh(self) -> Self:
        return replace(super().afresh(), design=None, response=None)


@dataclass(frozen=True)
class State(model_.State, pose.State):
    clients: Mapping[int, Client] = field(default_factory=dict)


def drives(model: pg.Model) -> list[str]:
    """Return the motors, servos and actuators that a feedback may drive."""
    return [f.name for f in model.forces if isinstance(f, OnJoint) and not f.has_state]


def computed(design: Design) -> Design:
    """Return the design with its gains. Raises PgraphError."""
    model, asked = design.model, design.asked
    used = [name for name in drives(model) if asked.largest.get(name, 1.0) is not None]
    how: dict[str, Any] = {"inputs": used, "states": asked.states, "q": design.q}
    plain = pg.lqr(model, 1.0, 1.0, **how)
    given = {name: x for name, x in asked.largest.items() if x is not None}
    largest = usual(plain, model) | given
    if asked.method == "poles" and asked.poles is not None:
        found = pg.place_poles(model, np.array(asked.poles), **how)
    else:
        Q = {s: largest[s] ** -2.0 for s in plain.states if asked.largest.get(s, 1.0) is not None}
        found = pg.lqr(model, Q, {u: largest[u] ** -2.0 for u in plain.inputs}, **how)
    return replace(design, largest=largest, found=found, problem="", busy=False)


def usual(plain: pg.Feedback, model: pg.Model) -> dict[str, float]:
    """Return the largest deviations and inputs to begin with.

    Deviations are NEAR, and rates what the fastest motion of the plant makes of them. An input is
    what accelerates the state that it moves most as that motion does.
    """
    n = len(plain.positions)
    fastest = float(np.abs(np.linalg.eigvals(plain.A)).max()) or 1.0
    near = np.array([NEAR.get(unit_of(model, name), 1.0) for name in plain.positions])
    found = dict.fromkeys(plain.states, 1.0) | dict(zip(plain.states, (*near, *(near * fastest))))
    for k, name in enumerate(plain.inputs):
        moved = np.abs(plain.B[n : 2 * n, k]) > 0
        needed = near[moved] * fastest**2 / np.abs(plain.B[n : 2 * n, k][moved])
        found[name] = float(needed.min()) if len(needed) else 1.0
    return {name: float(f"{x:.2g}") for name, x in found.items()}


def unit_of(model: pg.Model, name: str) -> str:
    """Return the unit of a state or an input. "angle" and "length" follow the page's units."""
    known = known_of(model)
    force = next((f for f in model.forces if f.name == name), None)
    if isinstance(force, OnJoint):
        dim = wanted(force, force.INPUT, known.bodies)
        return "" if dim is None else unit(dim)
    dim = known.dim(parsed(name))
    return "" if dim is None else UNITS.get(dim, "")


def response(design: Design) -> list[tuple[str, list[float], list[float]]]:
    """Return (name, times, values) of positions and inputs after a step of a setpoint.

    Each value is a part of the largest one that is allowed.
    """
    found = design.found
    if found is None or not found.stable:
        return []
    n = len(found.positions)
    k = found.states.index(design.asked.step) if design.asked.step in found.positions else 0
    target = np.zeros(len(found.states))
    target[k] = design.largest[found.states[k]]
    slowest = float(np.abs(found.poles.real).min())
    t = np.linspace(0.0, CONSTANTS_OF_TIME / slowest, POINTS)
    once = expm((found.A - found.B @ found.K) * t[1])
    x = np.empty((len(t), len(target)))
    x[0] = -target
    for i in range(1, len(t)):
        x[i] = once @ x[i - 1]
    names = (*found.positions, *found.inputs)
    values = np.hstack((x[:, :n] + target[:n], -x @ found.K.T))
    return [
        (name, t.tolist(), (y / design.largest[name]).tolist()) for name, y in zip(names, values.T)
    ]
