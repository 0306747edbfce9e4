"""Events missed by less than the error of a run, which leaves open whether they happen.

The error of what is watched is what it differs by in another run of the same motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..dynamics.scene import contact_tables
from ..engine import layout as at
from ..packing import Array, Ints
from .recording import Recording

if TYPE_CHECKING:
    from ..contact.tables import Tables


class Approach(NamedTuple):
    """An event that almost happened."""

    name: str
    value: float  # inf: nowhere near
    t: float  # [s]
    watched: Callable[[float, Array, Array], float]  # function of (t, q, v), zero at the event


def undecided(record: Recording, other: Recording) -> tuple[str, ...]:
    """Return a notice for each limit and event that a run misses by less than its error."""
    ours, theirs = (x.steps.times[: x.done] for x in (record, other))
    shared, i, j = np.intersect1d(ours, theirs, assume_unique=True, return_indices=True)
    found = []
    for near in (*_limits(record), *_events(record)):
        if not np.isfinite(near.value) or len(shared) < 2:
            continue
        k = int(np.clip(np.searchsorted(shared, near.t), 1, len(shared) - 1))
        error = 2.0 * max(  # method of order 1: twice the difference to half the step
            abs(
                near.watched(float(shared[n]), record.out.q[i[n]], record.out.v[i[n]])
                - near.watched(float(shared[n]), other.out.q[j[n]], other.out.v[j[n]])
            )
            for n in (k - 1, k)
        )
        if near.value <= error:
            found.append(
                f"at t = {near.t:.6g} s {near.name} misses it by {near.value:.2g}, and the error "
                f"there is about {error:.2g}: whether it happens is not decided; a smaller step "
                "or rtol may tell"
            )
    return tuple(found)


def _events(record: Recording) -> list[Approach]:
    """Return how close switch conditions and user events came to triggering."""
    if record.watch is None:
        return []
    from ..engine.contact.points import NEAREST, WHEN

    monitors = record.watch.monitors
    rows = record.steps.watched[[NEAREST, WHEN], record.steps.watched.shape[1] - len(monitors) :]
    values, times = rows.tolist()
    parts = zip(monitors, values, times, strict=True)
    return [Approach(f"event '{m.name}'", value, t, m) for m, value, t in parts]


def _limits(record: Recording) -> list[Approach]:
    """Return how close coordinates came to limits that they approached without reaching."""
    plan, n = record.planned, record.done
    tables = plan.contacts if plan.declared is None else plan.declared
    if tables is None:
        tables = contact_tables(record.mech.packed, ())
    if tables is None or not tables.limits or n < 2:
        return []
    out, t, found = record.out, record.steps.times[:n], list[Approach]()
    for limit in limits_on_coordinates(tables):
        rates, curves = (x[:n, limit.at_v] @ limit.weights for x in (out.v, out.vdot))
        near = _least(t, limit.gap(out.q[:n]), rates, curves)
        watched = lambda _t, q, _v, limit=limit: float(limit.gap(q))  # noqa: E731
        found.append(Approach(f"limit '{limit.name}'", *near, watched))
    return found


class LimitGap(NamedTuple):
    """A limit on a weighted sum of coordinates."""

    name: str
    at_v: Ints
    at_q: Ints
    weights: Array
    bound: float

    def gap(self, q: Array) -> Array:
        """Return the gap (...) at states q (..., nq) [rad, m]."""
        return q[..., self.at_q] @ self.weights - self.bound


def limits_on_coordinates(tables: Tables) -> Iterator[LimitGap]:
    """Yield the limits of joints and tendons, excluding lengths between points."""
    ints, floats, terms, factors = tables.limit_blocks
    for name, block, values in zip(tables.limits, ints, floats):
        if block[at.B_TYPE] != at.T_SPAN:
            own = slice(block[at.B_TERM], block[at.B_TERM] + block[at.B_TERMS])
            at_v, at_q = terms[own].T
            yield LimitGap(name, at_v, at_q, factors[own], float(values[at.VALUE]))


@np.errstate(all="ignore")  # huge numbers, of which nothing is known
def _least(t: Array, gap: Array, rate: Array, curve: Array) -> tuple[float, float]:
    """Return (minimum gap where its rate passes zero, time [s]), using cubics between frame times.

    If accelerations do not explain how the rate changes, there is an impact. If polynomials
    of third and fifth degree differ by more than the gap, it is not known.
    """
    h, fall, rise = np.diff(t), rate[:-1], rate[1:]
    unexplained = np.abs(rise - fall - 0.5 * h * (curve[:-1] + curve[1:]))
    turns = np.flatnonzero((fall < 0.0) & (rise > 0.0) & (2.0 * unexplained < rise - fall))
    h, up = h[turns], np.diff(gap)[turns]
    a, b = h * fall[turns], h * rise[turns]
    square, cube = 3.0 * up - 2.0 * a - b, a + b - 2.0 * up
    x = -a / (square + np.sqrt(np.maximum(square * square - 3.0 * cube * a, 0.0)))
    least = gap[turns] + x * (a + x * (square + x * cube))
    bends = (
        h * h * curve[turns] - 2.0 * square,
        h * h * curve[turns + 1] - 2.0 * square - 6.0 * cube,
    )
    more = 0.5 * (x * (1.0 - x)) ** 2 * ((1.0 - x) * bends[0] + x * bends[1])
    least = np.abs(least + more)
    known = np.flatnonzero(np.abs(more) < least)
    if not len(known):
        return np.inf, np.nan
    k = known[np.argmin(least[known])]
    return float(least[k]), float(t[turns[k]] + x[k] * h[k])
