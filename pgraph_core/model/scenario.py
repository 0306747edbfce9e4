"""A named run of a model: initial state, drives, what drives it, active parts, duration, method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from ..errors import choices, shown
from .fields import Described, Number, PerMotion, by_name, field, names_or_none, refuse
from .force import Force
from .gait import Gait

SUBJECTS = ("coordinate", "gap", "force", "constraint")


class When(Described):
    """A condition of the state: one of coordinate, gap, force, constraint, and its bound."""

    coordinate: str | None = field(
        "the name of a body, with a number if it has several: 'a 1'", default=None
    )
    gap: str | None = field("the name of a contact, whose smallest gap counts [m]", default=None)
    force: str | None = field(
        "the name of a contact or constraint, whose force counts [N]", default=None
    )
    constraint: str | None = field("the name of a constraint", default=None)
    above: Number | None = field("a number", default=None)
    below: Number | None = field("a number", default=None)
    active: bool | None = field("true or false, with constraint", default=None)

    @property
    def subject(self) -> tuple[str, str]:
        """(what it watches, its name)."""
        return next((what, getattr(self, what)) for what in SUBJECTS if getattr(self, what))

    def __str__(self) -> str:
        what, name = self.subject
        if self.active is not None:
            return f"constraint {name} {'active' if self.active else 'inactive'}"
        bound = f"above {self.above:g}" if self.above is not None else f"below {self.below:g}"
        return f"{what} of {name} {bound}"

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        given = [what for what in SUBJECTS if getattr(self, what) is not None]
        bounds = [b for b in ("above", "below", "active") if getattr(self, b) is not None]
        if len(given) != 1:
            text = f"name one of {choices(SUBJECTS)}; given {' and '.join(given) or 'none'}"
            refuse([("when", text)])
        wanted = ("active",) if given == ["constraint"] else ("above", "below")
        if len(bounds) != 1 or bounds[0] not in wanted:
            text = f"a {given[0]} needs {' or '.join(wanted)}; given "
            refuse([("when", text + (" and ".join(bounds) or "neither"))])
        return self


def _when_in(value: When | Mapping[str, Any] | None) -> When | None:
    """A condition or its fields."""
    return value  # type: ignore[return-value]


class Switch(Described):
    """A constraint that is switched on or off during a run, at a time or by a condition."""

    t: Annotated[Number, Field(ge=0)] | None = Field(default=None, description="a time >= 0 [s]")
    constraint: str = Field(description="the name of a constraint")
    active: bool = Field(description="true or false")
    when: When | None = field(
        "in place of t a condition: {'coordinate', 'gap', 'force' or 'constraint': name, 'above', "
        "'below': value or 'active': bool}",
        converter=_when_in, default=None,
    )  # fmt: skip

    @model_validator(mode="after")
    def _time_or_condition(self) -> Self:
        if (self.t is None) == (self.when is None):
            refuse([("t", f"give t or when, {'not both' if self.when else 'one of them'}")])
        return self


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
        "constraints switched on or off during the run, {t or when, constraint, active}",
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
    "gauss6": "Gauss 6 (symplectic)",
    "ros2": "Rosenbrock 2 (stiff)",
    "generalised_alpha": "generalised alpha (stiff)",
    "radau5": "Radau 5 (stiff)",
    "moreau_jean": "Moreau-Jean (impacts)",
}
