"""Settings of a run that calls, scenarios, the command line and the page have in common."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, ClassVar

from pydantic import ValidatorFunctionWrapHandler, field_validator

from .. import words
from ..errors import ModelError, choices, no_method
from ..fields import Frozen, Number, Text, Whole, field, refuse
from ..tolerances import EPS
from ..units import S

AUTO = "auto"  # chosen for the scene
STEP = 1e-3  # [s] fixed steps where nothing is given
LONGEST = 1_000_000_000  # [s] thirty years: longer runs do not end
MOST_FRAMES = 100_000_000  # gigabytes
LEAST_RTOL = 4 * EPS  # the error of a step is rounding below it
METHOD_NAMES = {  # names in calls and files -> labels
    AUTO: "automatic",
    "rk4": "Runge-Kutta 4",
    "semi_implicit_euler": "semi-implicit Euler",
    "dopri5": "Dormand-Prince 5",
    "dop853": "Dormand-Prince 8",
    "gauss6": "Gauss 6 (symplectic)",
    "radau5": "Radau 5 (stiff)",
    "moreau_jean": "Moreau-Jean (impacts)",
}
ADAPTIVE = ("dopri5", "dop853", "radau5")  # methods that can choose their steps by their error


def no_tolerance(method: str) -> str:
    """Return the message about a tolerance for a method whose steps are given."""
    return f"{method} takes a step, not a tolerance; for one choose {choices(ADAPTIVE)}"


class Settings(Frozen):
    """Settings of a run, with None for the usual value.

    Each field is an argument of `simulate`, a field of scenarios, a flag of the command line and a
    cell on the page. Text, bounds, unit, label and help in all of them are those of the field.
    """

    CHOICES: ClassVar[Mapping[str, Mapping[str, str]]] = {"method": METHOD_NAMES}  # -> labels
    TIMES: ClassVar[tuple[str, ...]] = ("t_end", "frames")  # those that say what is recorded

    t_end: Number | None = field(
        "a finite number > 0, at most 1e9 [s]", default=None, gt=0, le=LONGEST, dim=S,
        label="Duration", help="length of the run",
    )  # fmt: skip
    step: Number | None = field(
        "a finite number > 0 [s]", default=None, gt=0, dim=S,
        help="size of the steps, or the largest one if a tolerance is given",
    )  # fmt: skip
    method: Text | None = field(
        "the name of an integrator", default=None,
        help="integration method; automatic gives the reason for its choice",
    )  # fmt: skip
    rtol: Number | None = field(
        "a number from 1e-15, above rounding, to 0.1", default=None, ge=LEAST_RTOL, le=0.1,
        label="Tolerance", since=9, help="largest relative error of a step of adaptive methods",
    )  # fmt: skip

    frames: Whole | None = field(
        f"a whole number from 2 to {MOST_FRAMES}", default=None, ge=2, le=MOST_FRAMES, since=9,
        help="number of recorded frames; default: about 1000",
    )  # fmt: skip

    @field_validator("method", mode="wrap")
    @classmethod
    def _known_method(cls, value: Any, checked: ValidatorFunctionWrapHandler) -> Any:
        name = words.chosen(value, METHOD_NAMES) or value
        if name is not None and not (isinstance(name, str) and name in METHOD_NAMES):
            refuse([("method", no_method(name, METHOD_NAMES))])
        return checked(name)

    @classmethod
    def read(cls, name: str, text: str) -> Any:
        """Return the value of a setting from text. Raises ModelError."""
        readings: list[Callable[[str], Any]] = [int, float]
        for reading in readings:
            with suppress(ValueError, ModelError):
                return cls.checked(name, reading(text))
        return cls.checked(name, text)

    @classmethod
    def checked(cls, name: str, value: Any) -> Any:
        """Return the value of a setting if it is allowed. Raises ModelError."""
        return getattr(cls(**{name: value}), name)


OF = Settings.model_fields  # for classes that have another usual value


def settings_of(given: Settings) -> dict[str, Any]:
    """Return the settings of a run by name."""
    return {name: getattr(given, name) for name in OF}
