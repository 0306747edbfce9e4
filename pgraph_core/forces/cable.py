"""An elastic cable over points and wheels, which only pulls.

The segments of a chain, between wheels with friction, share the stretch e of the whole chain. The
mean of their tensions is T = stiffness e + damping e', as their rows have the same part of e. The
cable slips over wheel k at the speed s, by which the segments behind it lengthen more than their
part of e'. With r = s / √(s² + creep²), the tension changes there by the factor e^(r μθ), which
dissipates what it takes from the motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import model_validator

from ..engine.cables import GRIP, cable_length, cable_rate, hold_of, over_spans
from ..engine.compiler import elementary
from ..engine.compiler.jit import part, sweep
from ..engine.compiler.lane import in_each
from ..engine.compiler.masks import chosen, larger, more
from ..engine.records import CREEP, INTEGER, REAL
from ..engine.vec import scale
from ..fields import Number, field, refuse
from ..pulleys import AlongPulleys
from ..units import M, N, S
from .base import KIND, Action, Array, Load, OnBody, Places, opposed, row
from .strut import above

exp = in_each(elementary.exp)


class Cable(AlongPulleys, OnBody):
    """An elastic cable or belt that leads through points and over wheels, and only pulls.

    A wheel that it grips divides it into segments, each of which has its own tension: `stiffness`
    times its stretch, plus `damping` times the rate of that while it is taut. Segments between
    wheels with friction share the stretch of all of them. With `closed` it is a belt, which returns
    to its first wheel.

    Examples
    --------
    >>> import pgraph_core as pg
    >>> through = [("hook", (0, 0, 0)), pg.Pulley("drum", radius=0.1, side=1)]
    >>> pg.Cable(name="hoist", through=through, stiffness=1e5).body
    'hook'
    """

    ABOUT: ClassVar[str] = "an elastic cable or belt over wheels and points, which only pulls"
    PASSIVE: ClassVar[bool] = True
    SCALES: ClassVar[tuple[str, ...]] = ("stiffness",)
    SINCE: ClassVar[int] = 9

    kind: Literal["cable"] = field(KIND, default="cable")
    stiffness: Number | None = field(
        "a number > 0 [N/m], or None if it does not stretch",
        default=None, gt=0, dim=N / M,
        help="stiffness of each segment between two grips; default: it does not stretch",
    )  # fmt: skip
    damping: Number = field(
        "a number >= 0 [N s/m]", default=0.0, ge=0, dim=N * S / M,
        help="damping of each segment while it is taut",
    )  # fmt: skip
    length: Number | None = field(
        "a length > 0 without force [m]; default: as in the initial state",
        default=None, gt=0, dim=M, help="length without force; default: as in the initial state",
    )  # fmt: skip
    tension: Number = field(
        "a force >= 0 in the initial state [N]",
        default=0.0, ge=0, dim=N, help="tension in the initial state",
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.tension and self.length is not None:
            text = "give either `length` or the tension in the initial state, which determines it"
            refuse([("tension", text)])
        given = [x for x in ("damping", "tension") if getattr(self, x)]
        if self.stiffness is None and given:
            text = "needs a stiffness [N/m]; a cable without it does not stretch"
            refuse([(given[0], text)])
        return self

    @property
    def _slips(self) -> bool:
        """Return True if it stretches, and may slip on a wheel."""
        return bool(self.stiffness) and any(x.friction for x in self.through)

    @property
    def _bounds(self) -> bool:
        return self.stiffness is None

    @property
    def _bends(self) -> bool:
        return bool(self.stiffness)

    def _stops(self, body_of: Callable[[str], Any]) -> Iterator[tuple[float, dict[str, Any]]]:
        """Yield the rope that it is while it is taut, and slides where friction would hold it."""
        if self._bounds:
            loose: dict[str, Any] = {"friction": None, "grip": False}
            through = [p.unchecked_copy(loose) if p.friction else p for p in self.through]
            fields = {"through": through, "closed": self.closed, "length": self.length}
            yield 1.0, {"kind": "rope", **fields}


class Part(NamedTuple):
    """A segment of a cable, which is a row of its table."""

    cable: Cable
    segment: Any  # a Segment of `packing.cables`

    @property
    def pair(self) -> tuple[str, str]:
        """The bodies of its first and last station."""
        first, *_, last = self.segment.stations
        return first.pulley.body, last.pulley.body


def split(f: Cable, at: Places) -> list[Part]:
    """Return the segments of a cable."""
    return [] if f.stiffness is None else [Part(f, segment) for segment in at.segments(f)]


def longest_of(cable: Cable, segment: Any) -> float:
    """Return the `cable_length` at which the chain of a segment has the given length, or the
    initial one."""
    chain = segment.chain
    longer = 0.0 if cable.length is None else cable.length - chain.length
    return float(chain.value + longer)


def pack(f: Part, one: Any, at: Places) -> Array:
    """Write the stiffness, damping and rest length, and return the knot of its bend."""
    cable, segment = f
    assert cable.stiffness is not None
    one["stiffness"], one["damping"] = cable.stiffness, cable.damping
    one["rest"] = longest_of(cable, segment) - cable.tension / cable.stiffness
    chain, k, last = segment.chain, segment.number, len(segment.chain.rows) - 1
    one["begin"], one["end"] = (*chain.starts, last)[k : k + 2]
    one["segments"], one["creep"] = len(chain.starts), CREEP
    pushing = 0.0 if cable.damping else -np.inf
    return np.array([[0.0, 0.0, 0.0, np.inf], [0.0, 0.0, pushing, np.inf]])


@part
def pull(one, knots, length, rate, t):
    """Compute the tension stiffness × stretch + damping × rate, if it is taut and this pulls."""
    slack, pushing = knots[one.first_knot], knots[one.first_knot + 1]
    beyond = length - one.rest
    elastic = one.stiffness * above(beyond, slack)
    taut = chosen(more(beyond, slack[2]), 1.0, 0.0)
    tension = above(elastic + taut * one.damping * rate, pushing)
    return tension, 0.0, (tension - elastic) * rate


@part
def ends_of_chain(one):
    """Return the first and the last station of the chain of a segment."""
    return one.first_via, one.first_via + one.vias - 1


@part
def length_of_chain(one, vias, work, q):
    first, last = ends_of_chain(one)
    return cable_length(vias, work, q, first, last)


@part
def rate_of_chain(one, vias, work, linear):
    first, last = ends_of_chain(one)
    return cable_rate(linear, vias, work, first, last)


@part
def ends_of_segment(one):
    """Return the first and the last station of a segment."""
    return one.first_via + one.begin, one.first_via + one.end


@sweep
def share_of(one, vias, work, linear, rate):
    """Return the tension of a segment over the mean of its chain, which lengthens at this rate."""
    first, last = ends_of_chain(one)
    now = own = total = 1.0 + 0.0 * rate
    behind = one.segments
    for n in range(first + 1, last):
        if vias[n].shape == GRIP:
            behind -= 1
            slip = cable_rate(linear, vias, work, n, last) - behind * rate / one.segments
            held = slip / math.sqrt(slip * slip + one.creep * one.creep)
            now = now * exp(held * hold_of(vias, work, n))
            total = total + now
            own = now if n == first + one.begin else own
    return one.segments * own / total


@part
def pulled(one, knots, vias, work, linear, q, t):
    """Return (tension, length, rate, power put in, power lost) of a segment."""
    length, rate = length_of_chain(one, vias, work, q), rate_of_chain(one, vias, work, linear)
    tension, put_in, lost = pull(one, knots, length, rate, t)
    if one.segments > 1:
        elastic = (tension * rate - lost) / one.segments
        tension = tension * share_of(one, vias, work, linear, rate)
        first, last = ends_of_segment(one)
        length = cable_length(vias, work, q, first, last)
        rate = cable_rate(linear, vias, work, first, last)
        lost = tension * rate - elastic
    return tension, length, rate, put_in, lost


def onto(push: Any) -> Any:
    """Return the function that applies the tension of a segment to its bodies."""
    both = opposed(push)

    @part
    def shorten(to_it, vias, work, n, p, q, along):
        """Pull both ends of a span towards each other."""
        to, tension = to_it
        a, b, none = vias[n - 1], vias[n], (0.0, 0.0, 0.0)
        both(to, a.row, a.body, p, b.row, b.body, q, none, scale(tension, along))
        return 0.0

    shorten_spans = over_spans(shorten)

    @part
    def exert(one, knots, vias, work, linear, q, t, to):
        first, last = ends_of_segment(one)
        tension, _, _, put_in, lost = pulled(one, knots, vias, work, linear, q, t)
        shorten_spans((to, tension), vias, work, first, last)
        return put_in, lost

    return exert


@part
def tension(one, knots, vias, work, linear, q, t):
    """Return (tension, length, rate) of a segment."""
    force, length, rate, _, _ = pulled(one, knots, vias, work, linear, q, t)
    return force, length, rate


@part
def stored(one, knots, vias, work, q):
    """Return the stored energy ½ stiffness stretch², or the part of a segment in it."""
    stretch = larger(length_of_chain(one, vias, work, q) - one.rest, 0.0)
    return 0.5 * one.stiffness * stretch * stretch / one.segments


def linear(table: Any) -> bool:
    """Check whether no cable has a damper, which acts in taut ones only, or friction."""
    return not (table["damping"].any() or (table["segments"] > 1).any())


# stations of the segment in those of its chain, and how many segments share its stretch; `creep`:
# the speed below which friction is regularised [m/s]
ROW = row(
    stiffness=REAL, damping=REAL, rest=REAL, begin=INTEGER, end=INTEGER, segments=INTEGER,
    creep=REAL,
)  # fmt: skip
# knots: the stretch from which it pulls, and the tension below which it would push, with the least
# and most that a run holds there
LOAD = Load(Cable, ROW, pack, Action(onto, stored, tension), columns=4, linear=linear, split=split)
