"""A gait: when each foot touches the ground and for how long, how the body moves, how stiffly."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from ..errors import shown
from .fields import Described, Frozen, Number, Numbers, listed, refuse

Positive = Annotated[Number, Field(gt=0)]
AtLeast0 = Annotated[Number, Field(ge=0)]
Pair = tuple[AtLeast0, AtLeast0]
HARMONICS = 4  # of a wave


class Footfall(Frozen):
    """When one foot is on the ground."""

    foot: str = Field(description="the name of a contact that is one point of a paw")
    offset: Annotated[Number, Field(ge=0, lt=1)] = Field(
        description="a number from 0 to below 1: the part of the stride at which it touches down"
    )
    duty: Annotated[Number, Field(gt=0, le=1)] = Field(
        description="a number above 0, at most 1: the part of the stride that it is on the ground"
    )
    ahead: Number = Field(
        default=0.0, description="a finite number: how far ahead of its place at home it lands [m]"
    )


class Gains(Frozen):
    """Virtual springs and dampers of trunk and legs, as accelerations an error asks for."""

    speed: AtLeast0 = Field(default=8.0, description="a number >= 0 [1/s]")
    drift: AtLeast0 = Field(default=5.0, description="a number >= 0 [1/s]")
    sway: AtLeast0 = Field(default=0.0, description="a number >= 0 [1/s^2]")
    surge: AtLeast0 = Field(default=0.0, description="a number >= 0 [1/s^2]")
    height: Pair = Field(default=(150.0, 20.0), description="two numbers >= 0 [1/s^2, 1/s]")
    roll: Pair = Field(default=(120.0, 40.0), description="two numbers >= 0 [1/s^2, 1/s]")
    pitch: Pair = Field(default=(150.0, 25.0), description="two numbers >= 0 [1/s^2, 1/s]")
    yaw: Pair = Field(default=(60.0, 12.0), description="two numbers >= 0 [1/s^2, 1/s]")
    swing: Pair = Field(default=(1600.0, 80.0), description="two numbers >= 0 [1/s^2, 1/s]")
    spine: Pair = Field(default=(400.0, 18.0), description="two numbers >= 0 [1/s^2, 1/s]")
    paw: Pair = Field(default=(400.0, 40.0), description="two numbers >= 0 [1/s^2, 1/s]")
    place: Number = Field(default=0.03, description="a step's change by an error of speed [s]")
    place_drift: Number = Field(default=0.15, description="the same to the side [s]")
    place_roll: Number = Field(default=-0.08, description="the same by roll [m/rad]")
    tight_torque: Positive = Field(default=15.0, description="a number > 0: its torque's weight")
    tight_force: Positive = Field(default=5.0, description="a number > 0: its force's weight")

    @model_validator(mode="before")
    @classmethod
    def _of_lists(cls, data: Any) -> Any:
        return {key: listed(x) for key, x in data.items()} if isinstance(data, dict) else data


class Gait(Described):
    """How a quadruped walks. Waves are (a1, b1, a2, b2, ...): Σ a cos 2πk p + b sin 2πk p at the
    fraction p of a stride.
    """

    name: str = Field(description="text that is not empty")
    description: str = Field(default="", description="a sentence")
    feet: tuple[Footfall, ...] = Field(
        description="a list of {'foot': contact, 'offset': 0 to 1, 'duty': 0 to 1}"
    )
    stride: Positive = Field(default=0.4, description="the time of a stride > 0 [s]")
    speed: Number = Field(default=0.5, description="a finite number: forward speed [m/s]")
    acceleration: Positive = Field(
        default=0.5, description="a number > 0: how fast its speed may change [m/s^2]"
    )
    drift: Number = Field(default=0.0, description="a finite number: speed to the right [m/s]")
    turn: Number = Field(default=0.0, description="a finite number: turning to the left [rad/s]")
    height: Positive = Field(
        default=0.5, description="a height > 0 of the centre of mass over the ground [m]"
    )
    width: Number = Field(
        default=0.0, description="a finite number: how far outside of its hip a foot lands [m]"
    )
    clearance: AtLeast0 = Field(default=0.06, description="a height >= 0 of a swinging foot [m]")
    landing: AtLeast0 = Field(
        default=0.2, description="a speed >= 0 of a foot down at its end [m/s]"
    )
    loading: Annotated[Number, Field(gt=0, le=0.5)] = Field(
        default=0.1,
        description="above 0, at most 0.5: the fraction of a stance in which its load builds up",
    )
    push: Positive = Field(default=1.0, description="a number > 0: a factor on the planned loads")
    rise: Number = Field(default=0.0, description="a number: share of the rise that they cause")
    nod: Number = Field(default=0.0, description="a number: share of the pitching that they cause")
    sway: Numbers = Field(default=(), description="a wave of up to 8 numbers, to the side [m]")
    surge: Numbers = Field(default=(), description="a wave of up to 8 numbers, forward [m]")
    flexion: Numbers = Field(
        default=(), description="a wave of up to 8 numbers, of the spine [rad]"
    )
    grip: Positive = Field(
        default=0.55, description="a number > 0: friction coefficient that planned forces may use"
    )
    least: AtLeast0 = Field(default=5.0, description="a number >= 0: the least load of a foot [N]")
    leg_torque: Positive = Field(
        default=150.0, description="a number > 0: a leg hinge's limit [N m]"
    )
    spine_torque: Positive = Field(default=200.0, description="a number > 0: a spine hinge's [N m]")
    gains: Gains = Field(default=Gains(), description="an object of gains")

    @model_validator(mode="after")
    def _possible(self) -> Self:
        found = []
        names = [fall.foot for fall in self.feet]
        if len(names) != 4:
            text = f"must be four; given {shown(names)}"
            found.append(("feet", text))
        found += [
            ("feet", f"'{name}' stands there twice")
            for i, name in enumerate(names)
            if name in names[:i]
        ]
        for wave in ("sway", "surge", "flexion"):
            given = getattr(self, wave)
            if len(given) > 2 * HARMONICS or len(given) % 2:
                text = f"must be pairs of numbers, {HARMONICS} at most; given {shown(given)}"
                found.append((wave, text))
        refuse(found)
        return self

    def edit(self, /, **changes: Any) -> Self:
        """A new gait with the changed fields. Raises ModelError."""
        return type(self)(**{**self.model_dump(), **changes})
