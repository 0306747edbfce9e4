"""A muscle along a path, which pulls by its activation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import AfterValidator, model_validator

from ..curves import Table
from ..engine.compiler.lane import numbers_alone
from ..errors import choices, nearest_name, shown
from ..fields import EMPTY, Expression, Number, field, fixed, listed, refuse
from ..muscles import MODELS, TENDON, VELOCITY, MuscleModel
from ..signals import Node
from ..signals.grammar import filled
from ..stateful import Own, Quantity
from ..units import NONE, RAD, Dim, M, N, S
from .base import KIND, Activated, Array, InKnots, Load, Places, over_time, tree_of
from .hill import (
    ACTIVATION,
    COLUMNS,
    FIBRE,
    ROW,
    energy,
    equilibrium,
    pull,
    tension_of_rigid,
)
from .path import BetweenPoints, on_path, pack_points

STEEPEST = math.acos(0.1)  # rad: pennation at the shortest fibre, as in OpenSim


def of_model(accepted: str, help: str, dim: Dim, **bounds: Any) -> Any:
    """Declare a number that the model of a muscle has, too."""
    text = f"{help}; default: of the model"
    return field(f"{accepted}, or None", default=None, dim=dim, help=text, **bounds)


Shape = Annotated[dict[str, Number], AfterValidator(fixed)]
shaped: Callable[[Mapping[str, float]], Shape] = listed


class Muscle(BetweenPoints, Activated):
    """A muscle of Hill's type along a path, with the dynamics of its activation.

    Its activation follows the `excitation` and is `x.NAME` in expressions. A muscle with an elastic
    tendon has the length of its fibre over the optimal one as a second state, `x.NAME[2]`, and
    begins in equilibrium. Its force is a tension: a muscle does not push.

    Examples
    --------
    >>> import pgraph_core as pg
    >>> pg.Muscle("biceps", body="forearm", other="arm", f_max=600, l_opt=0.12, l_slack=0.2).model
    'degroote2016'
    """

    ABOUT: ClassVar[str] = "a muscle that pulls along a path, by its excitation"
    PASSIVE: ClassVar[bool] = False
    INPUT: ClassVar[str] = "excitation"
    FIRST: ClassVar[tuple[str, ...]] = (
        INPUT, "f_max", "l_opt", "l_slack", "pennation", "model", "tendon",
    )  # fmt: skip
    VARIES: ClassVar[tuple[str, ...]] = (INPUT,)
    SCALES: ClassVar[tuple[str, ...]] = ("f_max",)
    SINCE: ClassVar[int] = 9
    NEW: ClassVar[dict[str, Any]] = {"f_max": 500.0, "l_opt": 0.1, "l_slack": 0.1}

    kind: Literal["muscle"] = field(KIND, default="muscle")
    model: Literal["degroote2016", "thelen2003", "millard2012", "mujoco"] = field(
        f"one of {', '.join(MODELS)}", default="degroote2016",
        help="model of its curves and its activation",
    )  # fmt: skip
    f_max: Number = field("a force > 0 [N]", gt=0, dim=N, help="largest isometric force")
    l_opt: Number = field("a length > 0 [m]", gt=0, dim=M, help="optimal length of the fibre")
    l_slack: Number = field(
        "a length >= 0 [m], > 0 if its tendon is elastic", dim=M, help="slack length of the tendon"
    )
    pennation: Number = field(
        "an angle from 0 to less than pi/2 [rad]", default=0.0, ge=0, lt=math.pi / 2, dim=RAD,
        help="angle between the fibre at its optimal length and the tendon",
    )  # fmt: skip
    tendon: Literal["elastic", "rigid"] | None = field(
        "'elastic', 'rigid' or None", default=None,
        help="whether the tendon stretches; default: as far as the model has a curve for it",
    )  # fmt: skip
    excitation: Number | Table | Expression = field(
        "a number from 0 to 1, a table over time, or an expression",
        converter=over_time, default=0.0, dim=NONE,
        help="a number, a table t value; t value; ..., or =0.5 + 0.5*sin(3*t)",
    )  # fmt: skip
    start: Number | None = field(
        "a number from 0 to 1, or None", default=None, ge=0, le=1, dim=NONE,
        help="initial activation; default: the initial excitation",
    )  # fmt: skip
    rise: Number | None = of_model("a time > 0 [s]", "time constant of activation", S, gt=0)
    fall: Number | None = of_model("a time > 0 [s]", "time constant of deactivation", S, gt=0)
    fastest: Number | None = of_model(
        "a number > 0 [1/s]", "largest speed of shortening in optimal lengths", NONE / S, gt=0
    )
    damping: Number | None = of_model(
        "a number >= 0", "damping of the fibre over f_max and its largest speed", NONE, ge=0
    )
    weakest: Number | None = of_model(
        "a number from 0 to 1", "smallest activation", NONE, ge=0, le=1
    )
    shape: Shape = field(
        "names of numbers of the model's curves with numbers",
        converter=shaped, default=EMPTY, dim=NONE, help="further numbers of the model's curves",
    )  # fmt: skip

    @model_validator(mode="after")
    def _possible(self) -> Self:
        known = self.kind_of.shape
        for name, value in self.shape.items():
            if name not in known:
                text = f"has no number {shown(name)}; {nearest_name(name, known)}"
                refuse([("shape", f"model '{self.model}' {text}")])
            if not math.isfinite(value):
                refuse([("shape", f"{name} must be a finite number, got {shown(value)}")])
        if text := self.kind_of.problem(self.shape):
            refuse([("shape", text)])
        if self.tendon == "elastic" and self._rows[TENDON] is None:
            text = f"model '{self.model}' has a rigid tendon; leave this out, or choose "
            refuse([("tendon", text + choices(k for k, m in MODELS.items() if k != self.model))])
        if self.is_elastic and not self.l_slack > 0.0:
            text = f"must be > 0 for an elastic tendon, got {shown(self.l_slack)}; or give "
            refuse([("l_slack", f"{text}tendon='rigid'")])
        if self.is_elastic and not self.of_model("damping") > 0.0 and self._ends_flat():
            text = f"must be > 0 with an elastic tendon: the force of model '{self.model}' does "
            text += "not change beyond the largest speed; or give tendon='rigid'"
            refuse([("damping", text)])
        refuse(self._input_problems())
        return self

    @property
    def kind_of(self) -> MuscleModel:
        """The model of its curves."""
        return MODELS[self.model]

    @property
    def _rows(self) -> tuple[Array | None, ...]:
        """The polynomials of its curves."""
        return self.kind_of.rows(self.shape, COLUMNS)

    def _ends_flat(self) -> bool:
        """Check whether the curve over speed has no slope before or behind its ends."""
        curve = self._rows[VELOCITY]
        return curve is not None and not (curve[0, 2] > 0.0 and curve[-2, 2] > 0.0)

    @property
    def is_elastic(self) -> bool:
        """True if its tendon stretches."""
        return self.tendon != "rigid" and self._rows[TENDON] is not None

    def of_model(self, name: str) -> float:
        """Return a number of the muscle, or that of its model."""
        own = getattr(self, name)
        return float(getattr(self.kind_of, name) if own is None else own)

    @property
    def own(self) -> tuple[Own, ...]:
        """The activation, and the length of a fibre with an elastic tendon."""
        a, u = self._state(0), self._driven()
        shape = {**self.kind_of.shape, **self.shape}
        rate = self.kind_of.activation(a, u, self._number("rise"), self._number("fall"), shape)
        start = u if self.start is None else self._number("start")
        constant = self._number(self.INPUT) if isinstance(self.excitation, float) else None
        activation = Own(rate, start, column=ACTIVATION, given=constant,
                         quantity=Quantity("activation", "1"))  # fmt: skip
        if not self.is_elastic:
            return (activation,)
        fibre = Own(None, Node("number", value=math.nan), column=FIBRE,
                    quantity=Quantity("fibre", "m", self.l_opt),
                    at_rest=partial(fibre_at_rest, self))  # fmt: skip
        return activation, fibre

    @property
    def value(self) -> Node:
        """The activation."""
        return self._state(0)

    @property
    def inputs(self) -> tuple[float, float]:
        """The minimum and maximum of the excitation."""
        return 0.0, 1.0

    @property
    def strength(self) -> float:
        """The largest isometric force [N]."""
        return self.f_max

    @property
    def least(self) -> float:
        """The smallest activation."""
        return self.of_model("weakest")

    def tension_with_rigid_tendon(self, activation: float, length: float, rate: float) -> float:
        """Return the tension [N] along a path with this length and its rate [m, m/s]."""
        one = np.zeros(1, ROW)
        knots = write_numbers(self, one[0])
        return float(tension_of_rigid(one, knots, activation, length, rate))

    def _driven(self) -> Node:
        """Return the excitation within its bounds."""
        given = self.excitation
        u = self._number(self.INPUT) if isinstance(given, float) else tree_of(given)
        return filled("min(max(u, least), 1)", u=u, least=self._number("weakest"))

    def _varying(self, at: Places) -> Iterator[InKnots]:
        """Yield nothing: its knot gets its states."""
        yield from ()

    @property
    def numbers(self) -> dict[str, float]:
        """The fields that are numbers, by the names that the trees use."""
        found = dict(self._numbers())
        return found | {f"{self.name} {x}": self.of_model(x) for x in ("rise", "fall", "weakest")}


def pack(f: Muscle, one: Any, at: Places) -> Array:
    """Write the numbers of a muscle, and return a knot for its states and the curves."""
    pack_points(f, one, at)
    return write_numbers(f, one)


def write_numbers(f: Muscle, one: Any) -> Array:
    """Write the numbers of a muscle without those of its path, and return its knots."""
    one["f_max"], one["l_opt"], one["l_slack"] = f.f_max, f.l_opt, f.l_slack
    one["width"] = math.sin(f.pennation)
    one["least"] = max(f.kind_of.least, math.sin(f.pennation) / math.sin(STEEPEST))
    one["fastest"], one["damping"] = f.of_model("fastest"), f.of_model("damping")
    one["speed"], one["rigid"] = f.kind_of.speed, not f.is_elastic
    found = [np.array([[math.nan] * (FIBRE + 2) + [0.0] * (COLUMNS - FIBRE - 2)])]
    found += [x for x in f._rows if x is not None]
    one["pieces"] = [len(x) - 1 for x in found[1:]] + [0] * (1 + TENDON + 1 - len(found))
    return np.concatenate(found)


def fibre_at_rest(f: Muscle, at: Places, activation: float) -> float:
    """Return the length of a fibre at rest over the optimal one, with the bodies at `at`."""
    one = np.zeros(1, ROW)
    knots, length = write_numbers(f, one[0]), pack_points(f, one[0], at)
    return float(equilibrium(one, knots, activation, length))


def linear(table: Any) -> bool:
    """Check whether there is no muscle, whose force bends over its speed."""
    return len(table) == 0


ALONG = on_path(pull, energy)
# states of muscles are in no lanes
LOAD = Load(
    Muscle, ROW, pack, ALONG._replace(onto=lambda push: numbers_alone(ALONG.onto(push))),
    columns=COLUMNS, linear=linear,
)  # fmt: skip
