"""Consistent states from inconsistent ones by damped least squares; what contradicts what."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import Problem
from ..rotation import Array
from .tied import ANGLE, Tied

ROUNDS = 150
ROUNDING = 1e-13  # relative to the mechanism's size: a gap that is none
CLOSED = 1e-9  # relative to it: what is left open after all rounds
LONGEST = 0.5  # rad, or of the mechanism's size: one step
STALLED = 1e-6  # of the gap gained in a step that gains nothing
IDLE = 8  # such steps in a row, and it ends
TRIES = 3  # from other starts, where the first ends in a valley
SUSPECT = 1e-3  # of the largest gap: what may contradict
SPEED = 1e-9  # relative: a velocity that is met


class Closing(NamedTuple):
    """Where damped least squares ended."""

    tied: Tied  # at the state it ended
    rounds: int
    closed: bool


def closed(tied: Tied) -> Closing:
    """Positions that meet all constraints, near those given in the mass metric.

    Steps are damped by the gap itself ([Fan and Yuan 2005]): quadratic where the gap is small,
    also where rows are redundant, and downhill where it is not. Where it ends with a gap it tries
    again from places around; of all the best is given.
    """
    best = descended(tied)
    random = np.random.default_rng(0)
    for n in range(TRIES if not best.closed else 0):
        turned = random.normal(size=tied.nv) * (0.3 + 0.4 * n)
        other = descended(tied.at(tied.tree.advanced(tied.q, turned * _longest(tied) / LONGEST)))
        if other.closed:
            return other
        best = min(best, other, key=lambda c: _gap(c.tied))
    return best


def descended(tied: Tied, enough: float = ROUNDING, rounds: int = ROUNDS) -> Closing:
    """`closed` from this start alone, down to a gap of `enough` times the mechanism's size."""
    damping = 0.1
    idle = 0
    for taken in range(rounds):
        gap = _gap(tied)
        if gap <= enough * tied.size:
            return Closing(tied, taken, True)
        trial = tied.at(tied.tree.advanced(tied.q, _step(tied, damping)))
        gained = 1.0 - _gap(trial) / gap
        if gained > 0.0:
            tied, damping = trial, damping / 4
        else:
            damping *= 8
        idle = 0 if gained > STALLED else idle + 1
        if idle > IDLE:
            break
    return Closing(tied, rounds, _gap(tied) <= CLOSED * tied.size)


def _step(tied: Tied, damping: float) -> Array:
    left, sizes, right = tied.parts
    most = float(np.max((left * sizes) ** 2 @ np.ones(len(sizes)), initial=0.0))
    mu = damping * _gap(tied) / tied.size * most
    share = np.divide(sizes, sizes**2 + mu, out=np.zeros(len(sizes)), where=sizes > 0)
    y = -right.T @ (share * (left.T @ tied.gap[tied.holonomic]))
    step = tied.step(y)
    over = float(np.max(np.abs(step) / _longest(tied), initial=0.0))
    return step / max(over, 1.0)


def _longest(tied: Tied) -> Array:
    return np.where(tied.tree.turns, LONGEST, LONGEST * tied.size)


def _gap(tied: Tied) -> float:
    return float(np.linalg.norm(tied.gap))


def stopped(tied: Tied) -> tuple[Array, float]:
    """(v, missed): velocities that meet all rows, nearest in the mass metric, and by how much not.

    `missed` is relative to the speeds at hand.
    """
    y = np.linalg.lstsq(tied.scaled, -tied.slip, rcond=1e-10)[0].astype(float, copy=False)
    v = tied.speeds + tied.step(y)
    left = tied.slip + tied.scaled @ y
    scale = float(np.max(np.abs(tied.slip), initial=0.0)) or 1.0
    return v, float(np.max(np.abs(left), initial=0.0)) / scale


def contradiction(ended: Closing) -> Problem:
    """Which constraints cannot be met, alone or together, and by how much.

    Of those that are missed one after the other is left out; what still cannot be met without is
    not to blame.
    """
    tied = ended.tied
    for name in reversed(_missed(tied)):
        without = closed(tied.without(name))
        if not without.closed:
            tied = without.tied
    by, unit = _worst(tied)
    return _sentence(_missed(tied), f"{by:.3g} {unit}", "position")


def speed_contradiction(tied: Tied) -> Problem:
    """As `contradiction`, of the velocities that the constraints ask for."""
    for c in reversed(tied.held):
        if stopped(tied.without(c.name))[1] > SPEED:
            tied = tied.without(c.name)
    v, _ = stopped(tied)
    left = tied.at(tied.q, v).slip
    return _sentence(
        [c.name for c in tied.held], f"{float(np.abs(left).max()):.3g} rad/s or m/s", "velocity"
    )


def _missed(tied: Tied) -> list[str]:
    largest = SUSPECT * float(np.max(np.abs(tied.gap), initial=0.0))
    names = [g.constraint.name for g in tied.groups if np.abs(tied.gap[g.rows]).max() > largest]
    return list(dict.fromkeys(names))


def _worst(tied: Tied) -> tuple[float, str]:
    """The largest gap with its unit."""
    turns = tied.tree.turns
    found: list[tuple[float, float, str]] = []
    for group in tied.groups:
        gap = float(np.abs(tied.gap[group.rows]).max())
        moved = np.abs(tied.J[group.rows]).max(axis=0)
        angular = group.nature == ANGLE
        if group.nature == "coordinate":
            unit = "rad" if turns[moved.argmax()] else "m"
        else:
            unit = "rad" if angular else "m"
        found.append((gap, gap / tied.length if angular else gap, unit))
    _, by, unit = max(found)
    return by, unit


def _sentence(names: list[str], by: str, what: str) -> Problem:
    *others, last = names
    where = f"constraint '{last}'"
    if not others:
        text = f"cannot be met: it misses by {by} at the nearest {what} that the joints allow"
        return Problem(where, "", f"{text}; move its points or change a length")
    listed = " and ".join(f"'{name}'" for name in others)
    text = f"contradicts {listed}: at best they miss by {by}; change one of them, or make it"
    return Problem(where, "", f"{text} inactive")
