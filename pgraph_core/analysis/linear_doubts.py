"""Warnings of a linearisation: forces that have no slope, and states that do not stay."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..engine import motion
from ..engine.records import CREEP
from ..engine.signals import TIME
from ..errors import choices
from ..packing import Array
from ..tolerances import EPS, NOTABLE, ROUNDING

if TYPE_CHECKING:
    from .balance import Balance

NONE = np.zeros(0)


def notices(here: Balance, names: list[str], states: tuple[str, ...]) -> tuple[str, ...]:
    """Return warnings about forces without a slope and about a state that is not an equilibrium."""
    found: list[str] = []
    joints = here.mech.joints
    if here.touching is not None and here.touching.shut:
        shut = choices(here.touching.shut, 6)
        text = f"{shut}: left out, because a rigid contact has no stiffness; law 'soft' or "
        found.append(f"{text}'penalty' gives a contact one, a constraint of kind 'motion' a limit")
    at_rest = {name: np.abs(here.v[j.v]).max(initial=0.0) < CREEP for name, j in joints.items()}
    if rubs := [b.name for b in here.mech.model.bodies if any(b.friction) and at_rest[b.name]]:
        text = f"{choices(rubs, 6)}: joint friction holds what rests and has no slope there; it is "
        found.append(f"{text}taken for a damper, as below a speed of {CREEP:g} in a run")
    if len(here.loads.signals[1]) and (bent := _bent(here, names)):
        text = "a force has a corner or a jump here, where the slopes of its sides differ"
        found.append(f"{bent}: {text}")
    if (here.loads.signals[0][::2, 0] == TIME).any():
        found.append("expressions of time have their values at t = 0")
    vdot = here.vdot
    forces = np.abs(here.M) @ np.abs(vdot)
    whole, load = here.torque(here.q, here.v), here.load_torque(here.q, here.v)
    size = np.abs(here.mech.bias_force(here.q, here.v)) + np.abs(whole - load) + np.abs(load)
    if not np.any(here.v) and forces.max(initial=0.0) > NOTABLE * size.max(initial=1e-300):
        k = int(np.argmax(np.abs(vdot)))
        text = f"no equilibrium: v' of '{names[k]}' is {vdot[k]:.3g}, and `drift` is x' there; "
        found.append(f"{text}the eigenvalues are of motion near a state that does not stay")
    rates, size = (np.abs(x) for x in (here.unrest[0], here.s)) if states else (NONE, NONE)
    if not np.any(here.v) and (rates > NOTABLE * np.maximum(size, 1.0)).any():
        k = int(np.argmax(rates))
        text = f"no equilibrium: {states[k]} changes at {here.unrest[0][k]:.3g}/s, and `drift` is "
        found.append(f"{text}x' there")
    return tuple(found)


def _bent(here: Balance, names: list[str]) -> str:
    """Return the coordinates along which the forces of expressions have a corner or a jump, or "".

    f(h) + f(-h) - 2 f(0) is of order h^2 for a smooth force, of a lower one at a corner or jump.
    """
    rows = here.mech.packed.rows

    def placed(e: Array, h: float) -> Array:
        moved = here.q.copy()
        motion.move(rows, moved, e, h)
        return here.torque(moved, here.v)

    found = []
    for name, e in zip(names, np.eye(len(here.v))):
        along: tuple[Callable[[float], Array], ...] = (
            lambda h, e=e: placed(e, h), lambda h, e=e: here.torque(here.q, here.v + h * e),
        )  # fmt: skip
        if any(map(_is_bent, along)):
            found.append(name)
    return choices(found, 6) if found else ""


def _is_bent(of: Callable[[float], Array]) -> bool:
    """Return True if a function has a corner or a jump at 0."""
    step = EPS**0.25  # where rounding and curvature weigh alike in a second difference
    values = [(of(h), of(-h)) for h in (10.0 * step, step)]
    here = of(0.0)
    far, near = (np.abs(a + b - 2.0 * here).max(initial=0.0) for a, b in values)
    size = max(np.abs(x).max(initial=0.0) for pair in (*values, (here,)) for x in pair)
    return bool(near > 0.05 * far and near > ROUNDING * size)  # of order 1.3 at most
