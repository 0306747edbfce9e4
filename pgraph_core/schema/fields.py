"""Field types of the description, and pydantic's complaints turned into sentences.

Every field carries a `description` that completes "must be ..."; a refused value is answered
with it, whatever the reason, so that the reader learns what would do.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any

from pydantic import AllowInfNan, BaseModel, BeforeValidator, ConfigDict, Strict, ValidationError
from pydantic_core import PydanticCustomError

from ..errors import ModelError, Problem, choices


class Frozen(BaseModel):
    """Base of every description: immutable, unknown fields refused by name."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def listed(value: Any) -> Any:
    """Lists and NumPy arrays as tuples, NumPy scalars as numbers; anything else unchanged."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    return tuple(map(listed, value)) if isinstance(value, (list, tuple)) else value


def _per_motion(value: Any) -> Any:
    value = listed(value)
    return (value,) if isinstance(value, (int, float)) else value


Number = Annotated[float, BeforeValidator(listed), Strict(), AllowInfNan(False)]
Vec3 = Annotated[tuple[Number, Number, Number], BeforeValidator(listed)]
Quat = Annotated[tuple[Number, Number, Number, Number], BeforeValidator(listed)]
Mat3 = Annotated[tuple[Vec3, Vec3, Vec3], BeforeValidator(listed)]
Numbers = Annotated[tuple[Number, ...], BeforeValidator(listed)]
PerMotion = Annotated[tuple[Number, ...], BeforeValidator(_per_motion)]  # or one number for all


def refuse(problems: Sequence[tuple[str, str]]) -> None:
    """Raise what a validator found, (field, text) each, so that all of it is reported."""
    if problems:
        raise PydanticCustomError("problems", "refused", {"problems": list(problems)})


class Described(Frozen):
    """A part with a name of its own: refused with every problem found, as sentences."""

    def __init__(self, **data: Any):
        """Validated. Raises ModelError."""
        try:
            super().__init__(**data)
        except ValidationError as error:
            where = f"{type(self).__name__.lower()} {shown(data.get('name', ''))}"
            raise ModelError(dict.fromkeys(_problems(type(self), error, where))) from None


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


def _problems(kind: type[Frozen], error: ValidationError, where: str) -> Iterable[Problem]:
    seen: set[str] = set()
    for item in error.errors(include_url=False):
        field = next((part for part in item["loc"] if isinstance(part, str)), "")
        if item["type"] == "problems":
            for inner, text in item.get("ctx", {})["problems"]:
                yield Problem(where, field or inner, text)
        elif field not in seen:
            seen.add(field)
            yield Problem(where, field, _sentence(item, field, kind.model_fields))


def _sentence(item: Any, field: str, known: Mapping[str, Any]) -> str:
    if item["type"] == "extra_forbidden" and len(item["loc"]) == 1:
        return f"no such field; {nearest(field, known)}"
    expected = known[field].description if field in known else None
    if item["type"] == "missing" and len(item["loc"]) == 1:
        return f"is missing; give {expected or 'a value'}"
    if expected is None:
        return f"{item['msg']}; given {shown(item.get('input'))}"
    return f"must be {expected}; given {shown(item.get('input'))}"


def nearest(name: str, known: Iterable[str]) -> str:
    """'did you mean mass? Choose from ...' for a mistyped name."""
    names = list(known)
    close = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {close[0]}? " if close else ""
    return f"{hint}choose from {choices(names, limit=40)}"


def shown(value: Any, limit: int = 60) -> str:
    """A given value as it may stand in a sentence: short, and nan and inf spelled out."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    text = repr(list(value) if isinstance(value, tuple) else value)
    return text if len(text) <= limit else text[: limit - 3] + "..."
