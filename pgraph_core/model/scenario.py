"""A named run of a model: initial state, drives, what drives it, active parts, duration, method."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from ..errors import choices
from .fields import Described, Number, PerMotion, refuse
from .force import Force
from .gait import Gait
from .methods import METHOD_NAMES
from .sentences import shown


class Switch(Described):
    """A constraint that is switched on or off during a run."""

    t: Annotated[Number, Field(ge=0)] = Field(description="a time >= 0 [s]")
    constraint: str = Field(description="the name of a constraint")
    active: bool = Field(description="true or false")


class Scenario(Described):
    """What `simulate(mech, scenario=name)` runs."""

    name: str = Field(description="text that is not empty")
    description: str = Field(default="", description="a sentence")
    q: dict[str, PerMotion] = Field(default={}, description="body name -> initial q")
    v: dict[str, PerMotion] = Field(default={}, description="body name -> initial v")
    forces: tuple[Force, ...] = Field(default=(), description="forces beside those of the model")
    constraints: tuple[str, ...] | None = Field(
        default=None,
        description="names of the active constraints; left out: the model's own choice",
    )
    switches: tuple[Switch, ...] = Field(
        default=(), description="constraints switched on or off on the way, {t, constraint, active}"
    )
    contacts: tuple[str, ...] | None = Field(
        default=None,
        description="names of the active contacts; left out: the model's own choice",
    )
    gait: Gait | None = Field(
        default=None, description="a gait that drives the joints, or nothing: {'name': ...}"
    )
    t_end: Annotated[Number, Field(gt=0)] = Field(default=1.0, description="a duration > 0 [s]")
    step: Annotated[Number, Field(gt=0)] = Field(default=1e-3, description="a step > 0 [s]")
    method: str = Field(default="auto", description="the name of an integrator")

    @model_validator(mode="after")
    def _known_method(self) -> Self:
        if self.method not in METHOD_NAMES:
            text = f"no method is called {shown(self.method)}; choose one of "
            refuse([("method", text + choices(METHOD_NAMES))])
        return self
