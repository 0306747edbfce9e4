"""Field types of the description, and the base of its parts.

Every field carries a `description` that completes "must be ..."; a refused value is answered
with it, whatever the reason, so that the reader learns what would do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Integral
from typing import Annotated, Any, ClassVar, Self

from pydantic import AllowInfNan, BaseModel, BeforeValidator, ConfigDict, Strict, ValidationError
from pydantic_core import PydanticCustomError

from ..errors import ModelError, Problem
from ..portable import Portable
from .sentences import all_problems, shown


class Frozen(Portable, BaseModel):
    """Base of every description: immutable, unknown fields refused by name."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def __copy__(self) -> Self:
        """The same fields; what is cached beside them may not be true of the copy's."""
        copy = super().__copy__()
        for name in vars(copy).keys() - type(self).model_fields.keys():
            object.__delattr__(copy, name)
        return copy

    def __eq__(self, other: object) -> bool:
        """Equal fields; what is cached beside them says nothing."""
        if not isinstance(other, Frozen) or type(self) is not type(other):
            return NotImplemented
        mine, others = vars(self), vars(other)
        return all(mine[name] == others[name] for name in type(self).model_fields)


def listed(value: Any) -> Any:
    """Lists and NumPy arrays as tuples, NumPy scalars as numbers; anything else unchanged."""
    kind = type(value)
    if kind is float or kind is int or kind is str:  # most of what a description holds
        return value
    if hasattr(value, "tolist"):
        value = value.tolist()
    if not isinstance(value, (list, tuple)):
        return value
    return tuple([x if type(x) is float else listed(x) for x in value])


def _per_motion(value: Any) -> Any:
    value = listed(value)
    return (value,) if isinstance(value, (int, float)) else value


# Strict and finite stand beside float, so that compiled code checks them, without a call a number.
Finite = Annotated[float, Strict(), AllowInfNan(False)]
Row3 = tuple[Finite, Finite, Finite]
Number = Annotated[Finite, BeforeValidator(listed)]
Vec3 = Annotated[Row3, BeforeValidator(listed)]
Quat = Annotated[tuple[Finite, Finite, Finite, Finite], BeforeValidator(listed)]
Mat3 = Annotated[tuple[Row3, Row3, Row3], BeforeValidator(listed)]
Numbers = Annotated[tuple[Finite, ...], BeforeValidator(listed)]
PerMotion = Annotated[tuple[Finite, ...], BeforeValidator(_per_motion)]  # or one number for all


def refuse(problems: Sequence[tuple[str, str]]) -> None:
    """Raise what a validator found, (field, text) each, so that all of it is reported."""
    if problems:
        raise PydanticCustomError("problems", "refused", {"problems": list(problems)})


class Described(Frozen):
    """A part with a name of its own: refused with every problem found, as sentences."""

    # field -> fields that mean nothing without it: unsaid where it is refused itself
    FOLLOWERS: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    def __init__(self, /, **data: Any):
        """Validated. Raises ModelError."""
        try:
            super().__init__(**data)
        except ValidationError as error:
            where = f"{type(self).__name__.lower()} {shown(data.get('name', ''))}"
            kind = type(self)
            raise ModelError(all_problems(kind, data, error, where, kind.FOLLOWERS)) from None


def whole(value: Any) -> int | None:
    """A whole number of Python or NumPy as an int; None for anything else, True included."""
    return int(value) if isinstance(value, Integral) and not isinstance(value, bool) else None


def fields_of(part: Frozen) -> dict[str, Any]:
    """The fields of a part by name (`dict(part)` would add what it has cached)."""
    return {name: getattr(part, name) for name in type(part).model_fields}


def part_problems(kind: type[Described], data: Any, where: str) -> list[Problem]:
    """What is wrong with `data` as a `kind`, one Problem a field; none where it is valid."""
    if isinstance(data, kind):
        return []
    if not isinstance(data, Mapping):
        return [Problem(where, "", f"must be an object with fields; given {shown(data)}")]
    try:
        kind(**{str(key): value for key, value in data.items()})
    except ModelError as error:
        return [Problem(where, p.field, p.text) for p in error.problems]
    return []
