"""The base class for forces, and the interface between loads and kernels."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from ..curves import Table, VectorTable
from ..engine.cables import STATION
from ..engine.compiler.jit import part
from ..engine.records import INTEGER, REAL, record
from ..engine.vec import scale
from ..errors import shown
from ..fields import (
    EMPTY,
    GROUND,
    Entries3,
    Expression,
    NotNegative,
    Number,
    OfKinds,
    Text,
    WithOther,
    field,
    listed,
    refuse,
)
from ..signals import Node, parsed
from ..signals.grammar import filled
from ..signals.meaning import TIME
from ..stateful import Stateful
from .obstacles import OBSTACLE

KIND = "the name of a kind of force"
Array = npt.NDArray[np.float64]


Varying = Number | Table | Expression
Vectors = npt.ArrayLike | VectorTable | Sequence[float | str] | Mapping[str, Any]
over_time: Callable[[float | Table | str | Mapping[str, npt.ArrayLike]], Varying] = listed
number_or_law: Callable[[float | str], NotNegative | Expression] = listed
vector_over_time: Callable[[Vectors], Entries3 | VectorTable] = listed


class Force(OfKinds):
    """A force on `body`. See the class for each kind.

    The available classes are listed in `pgraph_core.forces`.
    """

    PASSIVE: ClassVar[bool] = False  # acts in every question, others and what varies in runs only
    VARIES: ClassVar[tuple[str, ...]] = ()  # fields that take expressions
    VARIES_SINCE: ClassVar[int] = 6  # schema version of files in which they do
    ANY_UNIT: ClassVar[tuple[str, ...]] = ()  # fields of any unit, since another one is a gain
    FIRST: ClassVar[
        tuple[str, ...]
    ] = ()  # first fields of a form, which hides others at their defaults
    KINDS: ClassVar[dict[str, type[OfKinds]]] = {}
    WORD: ClassVar[str] = "force"
    NOTHING: ClassVar[Mapping[str, Any]] = {
        "other": GROUND, "coordinate": 0, "torque": 0.0, "kp": 0.0, "kd": 0.0, "target": 0.0,
        "gear": 1.0, "coefficients": {},
    }  # fmt: skip

    name: Text = field("a non-empty string", label="Name")
    kind: Text = field(KIND, label="Kind")
    body: Text = field("the name of a body", label="Body")

    def __init__(self, /, **data: Any):
        """Create a force of the given kind. Raises ModelError."""
        super().__init__(**data)

    @property
    def _varies(self) -> bool:
        """Return True if it contains an expression in time and the motion."""
        values = [getattr(self, name) for name in self.VARIES]
        return any(type(x) is str or (type(x) is tuple and str in map(type, x)) for x in values)

    @property
    def _bends(self) -> bool:
        """Return True if its law has bends, which the motion may pass at any time."""
        return False

    @property
    def _bounds(self) -> bool:
        """Return True if it bounds a length or a sum of coordinates by impulses."""
        return False

    def _stops(self, body_of: Callable[[str], Any]) -> Iterator[tuple[float, dict[str, Any]]]:
        """Yield a sign, 1 for an upper bound and -1 for a lower one, and the fields of the
        constraint that holds where the bound acts."""
        return iter(())

    @property
    def _idle(self) -> str:
        """Return the reason why the force has no effect in any motion, or ""."""
        return ""


def tree_of(value: float | str | Table) -> Node:
    """Return a number, a table over time or an expression as a tree."""
    if isinstance(value, str):
        return parsed(value)
    if isinstance(value, Table):
        knots = [Node("number", value=y) for x in zip(value.t, value.value) for y in x]
        return Node("table", args=(Node("name", signal=("", TIME, 0)), *knots))
    return Node("number", value=value)


def held(x: Node, low: float, high: float) -> Node:
    """Return a tree that is clamped to its finite bounds."""
    if math.isfinite(low):
        x = filled("max(x, low)", x=x, low=tree_of(low))
    return filled("min(x, high)", x=x, high=tree_of(high)) if math.isfinite(high) else x


class Driven(Force):
    """A force with one field that is its input, which runs and steppers can give."""

    INPUT: ClassVar[str]  # the field that is the input

    if TYPE_CHECKING:
        input_low: float | None = None
        input_high: float | None = None

    @property
    def inputs(self) -> tuple[float, float]:
        """The minimum and maximum of the input."""
        low, high = self.input_low, self.input_high
        return (-math.inf if low is None else low), (math.inf if high is None else high)

    @property
    def given(self) -> Node:
        """The input as a tree. An expression is held within its bounds."""
        value = getattr(self, self.INPUT)
        return held(parsed(value), *self.inputs) if isinstance(value, str) else tree_of(value)

    def input_problem(self, value: float | Table | str) -> str:
        """Return the reason why a value or table is invalid as an input, or ""."""
        low, high = self.inputs
        if isinstance(value, str):  # held within them while it runs
            return ""
        values = value.value if isinstance(value, Table) else (value,)
        bad = next((x for x in values if not low <= x <= high), None)
        return "" if bad is None else f"must be from {low:g} to {high:g}, got {shown(bad)}"

    def _input_problems(self) -> list[tuple[str, str]]:
        """Return the problems with the input and its bounds."""
        low, high = self.inputs
        if low > high:
            text = f"must be at most input_high, {shown(high)}, got {shown(low)}"
            return [("input_low", text)]
        text = self.input_problem(getattr(self, self.INPUT))
        return [(self.INPUT, text)] if text else []


# -- limits `low` and `high` of a length or of a sum of coordinates, or None -----------------------


def refuse_crossed_ends(f: Any) -> None:
    """Reject a minimum length that exceeds the maximum."""
    if f.low is not None and f.high is not None and f.low > f.high:
        refuse([("low", f"must be at most high, {shown(f.high)}, got {shown(f.low)}")])


def limits(f: Any) -> bool:
    """Check whether a force has a limit."""
    return f.low is not None or f.high is not None


def stops_of(f: Any, at: str, **held: Any) -> Iterator[tuple[float, dict[str, Any]]]:
    """Yield what `Force._stops` yields. `held` are the fields of a constraint that holds the length
    or the sum at the value of its field `at`.
    """
    for sign, bound in ((-1.0, f.low), (1.0, f.high)):
        if bound is not None:
            yield sign, {**held, at: bound}


class DrivenByKnots(Driven):
    """A force on bodies whose input is in its knots while it is a constant."""

    @abstractmethod
    def put_input(self, knots: Array, u: float) -> None:
        """Write an input into its knots."""

    @abstractmethod
    def input_in(self, knots: Array) -> float:
        """Return the input in its knots."""

    @abstractmethod
    def slope_of_input(self, u: float) -> float:
        """Return the rate of change of the second number of its first knot with the input."""


class Activated(Stateful, Driven):
    """A force along a path that pulls by its activation, which is its first state."""

    @property
    @abstractmethod
    def strength(self) -> float:
        """The largest isometric force [N]."""

    @property
    @abstractmethod
    def least(self) -> float:
        """The smallest activation. The largest one is 1."""

    @abstractmethod
    def tension_with_rigid_tendon(self, activation: float, length: float, rate: float) -> float:
        """Return the tension [N] along a path with this length and its rate [m, m/s]."""


class Places(Protocol):
    """Poses and rows for the bodies of a mechanism, used for packing."""

    def home(self, name: str) -> Array:
        """Return the home orientation (3, 3) of a body."""
        ...

    def in_row(self, name: str, point: npt.ArrayLike) -> Array:
        """Convert a point from body axes to the axes of its row at q = 0 (3,) [m]."""
        ...

    def at_start(self, name: str, point: npt.ArrayLike) -> Array:
        """Return the position of a point on a body in the initial state (3,) [m]."""
        ...

    def turn_at_start(self, name: str) -> Array:
        """Return the orientation (3, 3) of a body in the initial state."""
        ...

    def coordinate_at_start(self, name: str, k: int) -> float:
        """Return coordinate k of the joint of a body in the initial state [rad, m]."""
        ...

    def body(self, name: str) -> Any:
        """Return the description of a body."""
        ...

    def segments(self, cable: Any) -> Sequence[Any]:
        """Return the segments of a cable between the stations that hold it."""
        ...

    def vias(self, part: Any) -> Sequence[tuple[Any, ...]]:
        """Return the fields of VIA for each point of a row besides its two ends."""
        ...


class InKnots(NamedTuple):
    """A number that varies in the knots of a force: its column and its value.

    It is the same in every knot, or is that of the first one only.
    """

    column: int
    value: Node
    everywhere: bool = True


class OnBody(Force):
    """A force acting on `body` itself."""

    SCALES: ClassVar[tuple[str, ...]] = ()  # fields; if all are zero, it exerts nothing

    @property
    def _exerts(self) -> bool:
        """Return True if the force may act in a run."""
        values = (getattr(self, name) for name in self.SCALES)
        return any(any(x) if isinstance(x, tuple) else bool(x) for x in values)

    def _varying(self, at: Places) -> Iterator[InKnots]:
        """Yield the numbers that vary in its knots."""
        for column, name in enumerate(self.VARIES):
            if isinstance(value := getattr(self, name), str):
                yield InKnots(column, parsed(value))

    @property
    def _idle(self) -> str:
        if self._exerts or self._bounds:
            return ""
        return f"its {' and '.join(self.SCALES)} are 0"


class Between(WithOther, OnBody):
    """A force acting between `body` and `other`."""

    PASSIVE: ClassVar[bool] = True


class Sprung(Between):
    """A spring and damper, whose stiffness and damping may be expressions.

    If one of them is an expression, they are the columns of a separate knot. Such a spring does not
    store energy. Its power is counted as work.
    """

    SCALES: ClassVar[tuple[str, ...]] = ("stiffness", "damping")
    VARIES: ClassVar[tuple[str, ...]] = SCALES
    VARIES_SINCE: ClassVar[int] = 8

    if TYPE_CHECKING:
        stiffness: float | str
        damping: float | str


def pack_rates(f: Sprung, one: Any) -> Array | None:
    """Write the stiffness and damping into the row, or return them as a knot if one varies."""
    rates = [0.0 if isinstance(x, str) else x for x in (f.stiffness, f.damping)]
    one["stiffness"], one["damping"] = rates
    return np.array([rates]) if f._varies else None


@part
def rates_of(one, knots):
    """Return the present (stiffness, damping) of a spring."""
    if one.knots == 0:
        return one.stiffness, one.damping
    return knots[one.first_knot, 0], knots[one.first_knot, 1]


HEADER = {
    "row_a": INTEGER,  # the row that gets the force
    "row_b": INTEGER,  # the row that gets the opposite, 0: the ground
    "body_a": INTEGER,  # numbers of their bodies
    "body_b": INTEGER,
    "first_knot": INTEGER,
    "knots": INTEGER,
    "first_via": INTEGER,  # its points between the first and the last one
    "vias": INTEGER,
    "room": INTEGER,  # the first row of the workspace behind those of the tree
}
# a point of a path, the centre of an obstacle in it, or a station of a cable; home axes of the row
VIA = record(row=INTEGER, body=INTEGER, point=(REAL, 3), **OBSTACLE, **STATION)


def row(**fields: Any) -> np.dtype[Any]:
    """Return the record type for a kind of load: bodies acted on, knots and its own fields.

    Points and directions are in the home axes of their rows.
    """
    return record(**HEADER, **fields)


def _always(table: Any) -> bool:
    return True


def _whole(f: Any, at: Places) -> Sequence[Any]:
    return (f,)


class Action(NamedTuple):
    """The wrenches and the energy of a kind of load.

    `onto(push)` returns the function `exert(one, knots, vias, work, linear, q, t, to)`, which
    returns the powers (put in, lost) [W]. For each of its wrenches it calls `push(to, k, body, p,
    torque, force)`: torque and force [N m, N] on a body and its row k at p, world axes.
    `energy(one, knots, vias, work, q)` returns the stored energy [J]. `tension(one, knots, vias,
    work, linear, q, t)` returns (tension, length, rate) of a path [N, m, m/s]. `unit(push)` returns
    the function `pulled(one, vias, work, to)`, which pushes as a tension of 1 N would, and returns
    the length. A kind has None for what it lacks.
    """

    onto: Callable[[Any], Any]
    energy: Any = None
    tension: Any = None
    unit: Any = None


def opposed(push: Any) -> Any:
    """Return the function that pushes a wrench on A at p, and the opposite one on B at q."""

    @part
    def both(to, a, body_a, p, b, body_b, q, torque, force):
        push(to, a, body_a, p, torque, force)
        push(to, b, body_b, q, scale(-1.0, torque), scale(-1.0, force))

    return both


def on_pair(law: Any, energy: Any = None) -> Action:
    """Return the wrenches of a law between two bodies.

    `law(one, knots, work, linear, t)` returns (p, torque, force, end, power put in, power lost):
    torque and force on A at p, the opposite on B at `end`. `energy(one, knots, work)` returns the
    stored energy.
    """

    def onto(push):
        both = opposed(push)

        @part
        def exert(one, knots, vias, work, linear, q, t, to):
            p, torque, force, end, put_in, lost = law(one, knots, work, linear, t)
            both(to, one.row_a, one.body_a, p, one.row_b, one.body_b, end, torque, force)
            return put_in, lost

        return exert

    if energy is None:
        return Action(onto)

    @part
    def stored(one, knots, vias, work, q):
        return energy(one, knots, work)

    return Action(onto, stored)


class Load(NamedTuple):
    """A kind of force on bodies, in kernel form.

    `pack(f, one, at)` writes the numbers of a force into its row, and returns its knots or None.
    `others` are parts with the same law, which the same table holds, and how to pack them.
    """

    part: type[OnBody]
    row: np.dtype[Any]
    pack: Callable[[Any, Any, Places], Array | None]
    action: Action
    columns: int = 1  # number of columns of its knots
    linear: Callable[[Any], bool] = _always  # whether the loads of a table are linear in speeds
    split: Callable[[Any, Places], Sequence[Any]] = _whole  # its rows, with the `pair` of each
    others: Mapping[Any, Callable[[Any, Any, Places], Array | None]] = EMPTY

    @property
    def kind(self) -> str:
        """The name of this kind."""
        return self.part.own_kind()

    @property
    def parts(self) -> tuple[type[OnBody], ...]:
        """The parts that its table holds."""
        return self.part, *self.others
