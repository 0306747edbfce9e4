"""Model settings other than the parts: name, vertical axis, gravity and ground."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, Self

import numpy.typing as npt
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from ..errors import shown
from ..fields import (
    EMPTY,
    Described,
    Frozen,
    Number,
    Text,
    Vec3,
    field,
    fixed,
    listed,
    maybe_vector,
    part_of,
    parts_of,
    refuse,
)
from ..units import NONE, RAD, M, S
from .parameters import name_problems

DOWN: dict[str, Vec3] = {"x": (-9.81, 0.0, 0.0), "y": (0.0, -9.81, 0.0), "z": (0.0, 0.0, -9.81)}
AXES = ("x", "y", "z")

Pair = Annotated[tuple[Number, Number], BeforeValidator(listed)]


class Step(Frozen):
    """A rectangular area raised above or sunk below the ground plane."""

    low: Pair = field(
        "the least coordinates of the rectangle along the two axes that are not up [m]", dim=M
    )
    high: Pair = field(
        "the greatest coordinates of it along the two axes that are not up [m]", dim=M
    )
    height: Number = field("a finite number: how far it lies above the plane [m]", dim=M)

    @model_validator(mode="after")
    def _wide(self) -> Self:
        if any(a >= b for a, b in zip(self.low, self.high)):
            given = f"given {shown(self.low)} and {shown(self.high)}"
            refuse([("ground", f"a step's low must be less than its high; {given}")])
        return self


class Ground(Frozen):
    """The ground plane through the origin, normal to `up` or tilted, with its steps."""

    slope: Number = field(
        "an angle within -pi/2 to pi/2 by which it rises [rad]", default=0.0,
        gt=-math.pi / 2, lt=math.pi / 2, dim=RAD, help="slope angle of the plane",
    )  # fmt: skip
    uphill: Vec3 | None = field(
        "the direction [x, y, z] in which it rises; default: the first axis not up",
        converter=maybe_vector, default=None, role="direction",
        help="uphill direction; default: the first axis that is not up",
    )  # fmt: skip
    friction: Number = field(
        "a Coulomb friction coefficient >= 0, the default of contacts", default=0.5, dim=NONE, ge=0,
        help="default Coulomb friction coefficient of contacts",
    )  # fmt: skip
    static_friction: Number | None = field(
        "a coefficient >= friction, without sliding; default: friction",
        default=None, dim=NONE, since=2, ge=0,
        help="coefficient for sticking; default: same as friction",
    )  # fmt: skip
    rolling_friction: Number = field(
        "a length >= 0 [m]: torque against rolling over normal force", default=0.0, ge=0,
        dim=M, since=2, help="rolling torque divided by normal force",
    )  # fmt: skip
    spinning_friction: Number = field(
        "a length >= 0 [m]: torque about the normal over normal force", default=0.0, ge=0,
        dim=M, since=2, help="spinning torque divided by normal force",
    )  # fmt: skip
    restitution: Number = field(
        "a number from 0 to 1, the default of contacts", default=0.0, dim=NONE, ge=0, le=1,
        help="default restitution of contacts, 0 to 1",
    )  # fmt: skip
    steps: tuple[Step, ...] = field(
        "a list of {'low': [a, b], 'high': [a, b], 'height': h}",
        converter=parts_of(Step),
        default=(),
        role="parts",
    )

    @property
    def least_to_slide(self) -> float:
        """The static friction coefficient, by default the kinetic one."""
        return self.friction if self.static_friction is None else self.static_friction

    @model_validator(mode="after")
    def _holds_before_it_slides(self) -> Self:
        refuse(below_kinetic("ground", self.least_to_slide, self.friction, "static_friction "))
        return self


def below_kinetic(
    name: str, static: float, kinetic: float, what: str = ""
) -> list[tuple[str, str]]:
    """Return a problem if the static friction is below the kinetic friction."""
    if static >= kinetic:
        return []
    text = f"{what}must be at least the kinetic friction {shown(kinetic)}, got {shown(static)}"
    return [(name, text)]


_gravity_in: Callable[[npt.ArrayLike | None], Vec3] = listed
_parameters_in: Callable[[Mapping[str, float]], dict[str, Number]] = listed


class World(Described):
    """Settings for the surroundings. Gravity points down along `up` by default."""

    name: Text = Field(default="model", description="text")
    up: Literal["x", "y", "z"] = Field(default="z", description="'x', 'y' or 'z'")
    gravity: Vec3 = field(
        "three finite numbers [x, y, z] [m/s^2], or one for a gravity that points down",
        converter=_gravity_in,
        default=DOWN["z"],
        dim=M / S**2,
        role="vector",
    )
    ground: Ground = field(
        "the ground: {'slope': ..., 'steps': ...}", converter=part_of(Ground), default=Ground()
    )
    parameters: Annotated[dict[str, Number], AfterValidator(fixed)] = field(
        "names and finite numbers, for formulas such as '=thigh/2'",
        converter=_parameters_in, default=EMPTY,
    )  # fmt: skip

    @model_validator(mode="before")
    @classmethod
    def _gravity_points_down(cls, data: Any) -> Any:
        """Set the default gravity, or convert a single number to a vector that points down."""
        given = data.get("gravity") if isinstance(data, dict) else ()
        if given is None or (isinstance(given, (int, float)) and not isinstance(given, bool)):
            down = DOWN.get(str(data.get("up", "z")), DOWN["z"])
            of_size = [-abs(given) if x else 0.0 for x in down] if given is not None else down
            data = {**data, "gravity": of_size}
        return data

    @model_validator(mode="after")
    def _level_direction(self) -> Self:
        uphill = self.ground.uphill
        if uphill is not None and not 1e-9 < math.hypot(*_level(self.up, uphill)) < 1e9:
            text = f"uphill must not be parallel to up ({self.up})"
            refuse([("ground", f"{text}, got {shown(uphill)}")])
        return self

    @model_validator(mode="after")
    def _parameters_usable(self) -> Self:
        refuse(name_problems(self.parameters))
        return self

    @property
    def ground_normal(self) -> tuple[float, float, float]:
        """The unit normal of the ground plane in world axes."""
        first = (1.0, 0.0, 0.0) if self.up != "x" else (0.0, 1.0, 0.0)
        level = _level(self.up, self.ground.uphill or first)
        length = math.hypot(*level)
        rise, run = math.sin(self.ground.slope), math.cos(self.ground.slope)
        x, y, z = (run * (a == self.up) - rise * c / length for a, c in zip(AXES, level))
        return (x, y, z)


def _level(up: str, x: Vec3) -> tuple[float, ...]:
    """Return the component of a direction normal to `up`."""
    return tuple(0.0 if axis == up else c for axis, c in zip(AXES, x))
