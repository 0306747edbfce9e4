"""Assembly: find a consistent state near an inconsistent one, and identify conflicting
constraints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from ..dynamics import Dynamics
from ..dynamics.arguments import finite, position
from ..dynamics.scene import Scene
from ..engine import motion
from ..errors import InputError, Problem, Suggests, explained, one_of
from ..model.doubts import unlinked
from ..packing import Array, Ints
from ..packing.forces import NO_LOADS
from ..tolerances import FAINT, LONGEST_STEP, NOTABLE, ROUNDING, SOLVED
from .rows import ANGLE, Rows, apart, turns

ASSEMBLY_ROUNDS = 50  # limit on projections, enough from a nearby state
CLOSING_ROUNDS = 150
IDLE = 8  # steps in a row that gain nothing notable, and the search ends
TRIES = 3  # from other starts, where the first ends in a valley


class Configuration(Suggests, np.ndarray):
    """A configuration q (nq,) that was found, as an array. A failed search raises InputError."""

    success = True

    @property
    def q(self) -> Array:
        """The configuration as a plain array."""
        return np.asarray(self)


@explained
@dataclass(frozen=True)
class Assembly(Suggests):
    """The changes made while assembling a state."""

    moved: float  # largest move of a joint [rad or m]
    joint: str  # the body whose joint moved most, "" if none moved notably
    turned: bool  # whether that move is an angle
    speed_change: float  # largest change of a joint velocity [rad/s or m/s]

    @property
    def notable(self) -> bool:
        """Return True if anything moved by more than rounding error."""
        return max(self.moved, self.speed_change) > NOTABLE

    def __str__(self) -> str:
        unit = "rad" if self.turned else "m"
        parts: list[str] = []
        if self.moved > NOTABLE:
            parts.append(f"joints were moved by up to {self.moved:.3g} {unit} ('{self.joint}')")
        if self.speed_change > NOTABLE:
            parts.append(f"velocities were changed by up to {self.speed_change:.3g} rad/s or m/s")
        if not parts:
            return "the state meets its constraints"
        return f"{' and '.join(parts)} to meet the constraints"

    def to_dict(self) -> dict[str, Any]:
        """Return the fields as a dictionary."""
        return asdict(self)


def assemble(
    mech: Dynamics,
    q: Array | None = None,
    v: Array | None = None,
    active: Sequence[str] | None = None,
) -> tuple[Array, Array, Assembly]:
    """Return (q, v, report) near (q, v) that satisfies the constraints. Defaults to the initial
    state.

    `active` names constraints, the model's active ones by default. Raises InputError.
    """
    home_q, home_v = mech.home()
    q = home_q if q is None else position(mech.packed, q)
    v = home_v if v is None else finite("v", v, mech.nv, of=mech.packed)
    chosen = indices(mech, active)
    return assembled(mech, q, v, chosen, Scene(mech.packed, mech.packed.passive, NO_LOADS, chosen))


def indices(mech: Dynamics, names: Sequence[str] | None) -> Ints:
    """Return the indices of the named constraints, or of the active ones by default.

    Raises InputError for unknown names.
    """
    if names is None:
        return mech.packed.active
    known = [c.name for c in mech.model.constraints]
    if isinstance(names, str):
        text = f"must be a list of names; write [{names!r}]"
        raise InputError(Problem("assemble", "active", text))
    for name in names:
        if name not in known:
            text = f"no constraint is named '{name}'; {one_of(known)}"
            raise InputError(Problem("assemble", "active", text))
    return np.array(sorted(known.index(name) for name in names), dtype=np.int64)


def assembled(
    mech: Dynamics, q: Array, v: Array, active: Ints, scene: Scene, t: float = 0.0
) -> tuple[Array, Array, Assembly]:
    """Compute (q, v, report) near (q, v) that satisfies the `active` constraints in `scene`.

    Nearness is measured in the mass metric. The projection of runs is tried first, then damped
    least squares. Raises InputError with the constraints that cannot be met and their residuals.
    """
    new_q, new_v = q.copy(), v.copy()
    rounds = (
        motion.projection(scene.address, t, new_q, new_v, ASSEMBLY_ROUNDS) if len(active) else 0
    )
    moves = [float(np.max(np.abs(b - a), initial=0.0)) for a, b in ((q, new_q), (v, new_v))]
    if rounds >= 0 and max(moves) <= NOTABLE:
        return new_q, new_v, Assembly(moves[0], "", True, moves[1])
    own_q, own_v = q[mech.nq :], v[mech.nv :]  # states of controls, which no constraint touches
    q, v, new_q, new_v = q[: mech.nq], v[: mech.nv], new_q[: mech.nq], new_v[: mech.nv]
    rows = Rows.of(mech, active, q, v, t)
    far = rounds < 0 or float(np.abs(apart(mech, q, new_q)).max(initial=0.0)) > LONGEST_STEP
    if far or not np.isfinite(new_v).all():
        ended = closed(rows)
        if not ended.closed and rounds < 0:
            raise InputError(contradiction(mech, ended))
        new_q = ended.rows.q if ended.closed else new_q
        new_v = _speeds(rows.at(new_q))
    elif len(active):
        _speeds(rows.at(new_q, new_v))
    report = changes(mech, q, v, new_q, new_v)
    return np.append(new_q, own_q), np.append(new_v, own_v), report


def changes(mech: Dynamics, q: Array, v: Array, new_q: Array, new_v: Array) -> Assembly:
    """Compute the changes from one state to another."""
    step = np.abs(apart(mech, q, new_q))
    moves = [(float(step[joint.v].max()), name, joint.v) for name, joint in mech.joints.items()]
    most, name, span = max(moves, key=lambda m: m[0], default=(0.0, "", slice(0, 0)))
    turned = bool(turns(mech)[span][step[span].argmax()]) if most > 0 else True
    change = float(np.max(np.abs(new_v - v), initial=0.0))
    return Assembly(most, name if most > NOTABLE else "", turned, change)


def followed(mech: Dynamics, q: Array) -> Array | None:
    """Compute the configuration (nq,) to which motions over time from 0 to 1 lead from an assembled
    q, or None.

    Each step goes along the velocities and is then assembled. The step is halved until the assembly
    moves less than half as far. The solution then stays on the same branch ([Allgower and Georg
    1990]). There is no configuration if notable steps do not achieve this, at a dead end of a joint
    for example.
    """
    t, width, active = 0.0, 1.0, mech.packed.active
    scene = Scene(mech.packed, mech.packed.passive, NO_LOADS, active)
    q, v, _ = assembled(mech, q, np.zeros(mech.nv), active, scene)
    rows = Rows.of(mech, active, q)
    sizes = np.where(rows.turns, 1.0, rows.size)
    while t < 1.0:
        speed = float((np.abs(v) / sizes).max(initial=0.0))
        width = min(width, 1.0 - t, LONGEST_STEP / max(speed, LONGEST_STEP))
        ahead = q.copy()
        motion.move(mech.packed.rows, ahead, v, width)
        try:
            new_q, new_v, _ = assembled(mech, ahead, v, active, scene, t + width)
        except InputError:
            new_q, new_v = q, v
        missed = float((np.abs(apart(mech, ahead, new_q)) / sizes).max(initial=0.0))
        if missed <= width * speed / 2:
            q, v, t, width = new_q, new_v, t + width, 2 * width
        elif width * speed <= NOTABLE:
            return None
        else:
            width /= 2
    return q


def _speeds(rows: Rows) -> Array:
    v, missed = stopped(rows)
    if missed > SOLVED and float(np.abs(rows.at(rows.q, v).slip).max()) > NOTABLE:
        raise InputError(speed_contradiction(rows))
    return v


# -- damped least squares ------------------------------------------------------------------


class Closing(NamedTuple):
    """The result of a damped least-squares iteration."""

    rows: Rows  # at the state it ended
    rounds: int
    closed: bool


def closed(rows: Rows) -> Closing:
    """Find the positions closest to the given ones that satisfy all constraints, in the mass
    metric.

    Steps are damped by the gap itself ([Fan and Yuan 2005]): quadratic if the gap is small, even if
    rows are redundant, and downhill if it is not. If a gap remains, the search is repeated from
    nearby positions, and the best result is returned.
    """
    best = descended(rows)
    random = np.random.default_rng(0)
    for n in range(TRIES if not best.closed else 0):
        turned = random.normal(size=rows.nv) * (0.3 + 0.4 * n)
        other = descended(rows.at(rows.advanced(turned * _longest(rows) / LONGEST_STEP)))
        if other.closed:
            return other
        best = min(best, other, key=lambda c: _gap(c.rows))
    return best


def descended(rows: Rows, enough: float = ROUNDING, rounds: int = CLOSING_ROUNDS) -> Closing:
    """Run `closed` from this start until the gap is below `enough` times the mechanism's size."""
    damping = 0.1
    idle = 0
    for taken in range(rounds):
        gap = _gap(rows)
        if gap <= enough * rows.size:
            return Closing(rows, taken, True)
        trial = rows.at(rows.advanced(_step(rows, damping)))
        gained = 1.0 - _gap(trial) / gap
        if gained > 0.0:
            rows, damping = trial, damping / 4
        else:
            damping *= 8
        idle = 0 if gained > NOTABLE else idle + 1
        if idle > IDLE:
            break
    return Closing(rows, rounds, _gap(rows) <= SOLVED * rows.size)


def _step(rows: Rows, damping: float) -> Array:
    left, sizes, right = rows.parts
    most = float(np.max((left * sizes) ** 2 @ np.ones(len(sizes)), initial=0.0))
    mu = damping * _gap(rows) / rows.size * most
    share = np.divide(sizes, sizes**2 + mu, out=np.zeros(len(sizes)), where=sizes > 0)
    y = -right.T @ (share * (left.T @ rows.gap[rows.holonomic]))
    step = rows.step(y)
    over = float(np.max(np.abs(step) / _longest(rows), initial=0.0))
    return step / max(over, 1.0)


def _longest(rows: Rows) -> Array:
    return LONGEST_STEP * np.where(rows.turns, 1.0, rows.size)


def _gap(rows: Rows) -> float:
    return float(np.linalg.norm(rows.gap))


def stopped(rows: Rows) -> tuple[Array, float]:
    """Compute (v, residual). The velocities satisfy all rows and are nearest in the mass metric.

    `missed` is relative to the current speeds.
    """
    y = np.linalg.lstsq(rows.scaled, -rows.slip, rcond=ROUNDING)[0].astype(float, copy=False)
    v = rows.v + rows.step(y)
    left = rows.slip + rows.scaled @ y
    scale = float(np.max(np.abs(rows.slip), initial=0.0)) or 1.0
    return v, float(np.max(np.abs(left), initial=0.0)) / scale


def contradiction(mech: Dynamics, ended: Closing) -> list[Problem]:
    """Return the constraints that cannot be satisfied, individually or in combination, and their
    residuals.

    Violated constraints are removed one after another. A constraint is not reported if the others
    still cannot be satisfied without it. Joints that may be misplaced follow in the list.
    """
    rows = ended.rows
    for name in reversed(_missed(rows)):
        without = closed(rows.without(name))
        if not without.closed:
            rows = without.rows
    by, unit = _worst(rows)
    model = mech.model
    loose = unlinked(model.bodies, {body.name: body for body in model.bodies})
    doubts = [Problem(f"body '{name}'", "", f"its {text}") for name, text in loose]
    return [_sentence(_missed(rows), f"{by:.3g} {unit}", "position"), *doubts]


def speed_contradiction(rows: Rows) -> Problem:
    """Return the `contradiction` between the velocities prescribed by the constraints."""
    for c in reversed(rows.constraints):
        if stopped(rows.without(c.name))[1] > SOLVED:
            rows = rows.without(c.name)
    v, _ = stopped(rows)
    left = rows.at(rows.q, v).slip
    return _sentence(
        [c.name for c in rows.constraints],
        f"{float(np.abs(left).max()):.3g} rad/s or m/s",
        "velocity",
    )


def _missed(rows: Rows) -> list[str]:
    largest = FAINT * float(np.max(np.abs(rows.gap), initial=0.0))
    names = [g.constraint.name for g in rows.groups if np.abs(rows.gap[g.rows]).max() > largest]
    return list(dict.fromkeys(names))


def _worst(rows: Rows) -> tuple[float, str]:
    """Find the largest gap with its unit."""
    found: list[tuple[float, float, str]] = []
    for group in rows.groups:
        gap = float(np.abs(rows.gap[group.rows]).max())
        moved = np.abs(rows.J[group.rows]).max(axis=0)
        angular = group.nature == ANGLE
        if group.nature == "coordinate":
            unit = "rad" if rows.turns[moved.argmax()] else "m"
        else:
            unit = "rad" if angular else "m"
        found.append((gap, gap / rows.length if angular else gap, unit))
    _, by, unit = max(found)
    return by, unit


def _sentence(names: list[str], by: str, what: str) -> Problem:
    *others, last = names
    where = f"constraint '{last}'"
    if not others:
        text = f"cannot be satisfied: it misses by {by} at the closest {what} that the joints allow"
        return Problem(where, "", f"{text}; move its points or change a length")
    listed = " and ".join(f"'{name}'" for name in others)
    text = f"contradicts {listed}: they miss by {by} at least; change one of them, or make it"
    return Problem(where, "", f"{text} inactive")
