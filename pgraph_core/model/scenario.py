"""A named run of a model: initial state, drives, what drives it, active parts, duration, method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from ..errors import choices, shown
from .fields import Described, Number, PerMotion, by_name, field, names_or_none, refuse
from .force import Force
from .gait import Gait


class Switch(Described):
    """A constraint that is switched on or off during a run."""

    t: Annotated[Number, Field(ge=0)] = Field(description="a time >= 0 [s]")
    constraint: str = Field(description="the name of a constraint")
    active: bool = Field(description="true or false")


def _forces_in(value: Sequence[Force | Mapping[str, Any]]) -> tuple[Force, ...]:
    """Forces or their fields."""
    return value  # type: ignore[return-value]


def _switches_in(value: Sequence[Switch | Mapping[str, Any]]) -> tuple[Switch, ...]:
    """Switches or their fields."""
    return value  # type: ignore[return-value]


def _gait_in(value: Gait | Mapping[str, Any] | None) -> Gait | None:
    """A gait or its fields."""
    return value  # type: ignore[return-value]


class Scenario(Described):
    """What `simulate(mech, scenario=name)` runs."""

    name: str = Field(description="text that is not empty")
    description: str = Field(default="", description="a sentence")
    q: dict[str, PerMotion] = field("body name -> initial q", converter=by_name, default={})
    v: dict[str, PerMotion] = field("body name -> initial v", converter=by_name, default={})
    forces: tuple[Force, ...] = field(
        "a list of forces besides those of the model", converter=_forces_in, default=()
    )
    constraints: tuple[str, ...] | None = field(
        "names of the active constraints; left out: the model's own choice",
        converter=names_or_none, default=None,
    )  # fmt: skip
    switches: tuple[Switch, ...] = field(
        "constraints switched on or off during the run, {t, constraint, active}",
        converter=_switches_in, default=(),
    )  # fmt: skip
    contacts: tuple[str, ...] | None = field(
        "names of the active contacts; left out: the model's own choice",
        converter=names_or_none, default=None,
    )  # fmt: skip
    gait: Gait | None = field(
        "a gait that drives the joints, or nothing: {'name': ...}",
        converter=_gait_in, default=None,
    )  # fmt: skip
    t_end: Annotated[Number, Field(gt=0)] = Field(default=1.0, description="a duration > 0 [s]")
    step: Annotated[Number, Field(gt=0)] = Field(default=1e-3, description="a step > 0 [s]")
    method: str = Field(default="auto", description="the name of an integrator")

    @model_validator(mode="after")
    def _known_method(self) -> Self:
        if self.method not in METHOD_NAMES:
            text = f"no method is called {shown(self.method)}; choose one of "
            refuse([("method", text + choices(METHOD_NAMES))])
        return self


AUTO = "auto"  # chosen for the scene
METHOD_NAMES = {  # as in calls and files -> as a person chooses them
    AUTO: "automatic",
    "rk4": "Runge-Kutta 4",
    "semi_implicit_euler": "semi-implicit Euler",
    "dopri5": "Dormand-Prince 5",
    "dop853": "Dormand-Prince 8",
    "ros2": "Rosenbrock 2 (stiff)",
    "radau5": "Radau 5 (stiff)",
    "moreau_jean": "Moreau-Jean (impacts)",
}
