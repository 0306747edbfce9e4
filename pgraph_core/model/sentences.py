"""Names of parts, and pydantic's complaints turned into sentences."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from ..errors import Problem, choices


def all_problems(
    kind: type[BaseModel],
    data: Mapping[str, Any],
    error: ValidationError,
    where: str,
    followers: Mapping[str, tuple[str, ...]],
) -> list[Problem]:
    """What validation says, and what it says of the other fields once the refused ones are out.

    One refused field hides what a validator of the whole would say of the others. `followers`
    mean nothing without their field: they go with it, unsaid.
    """
    found: list[Problem] = []
    refused: set[str] = set()
    while True:
        found += [p for p in _problems(kind, error, where) if p.field not in refused]
        if {p.field for p in found} <= refused:
            return found
        refused |= {p.field for p in found}
        refused |= {name for field in refused for name in followers.get(field, ())}
        left = {"name": "unnamed"}
        left |= {key: value for key, value in data.items() if key not in refused}
        try:
            BaseModel.__init__(kind.__new__(kind), **left)
        except ValidationError as more:
            error = more
        else:
            return found


def _problems(kind: type[BaseModel], error: ValidationError, where: str) -> list[Problem]:
    """One Problem a refused field, or all that a validator of ours says of it."""
    items: dict[str, list[Any]] = {}
    for item in error.errors(include_url=False):
        field = next((part for part in item["loc"] if isinstance(part, str)), "")
        items.setdefault(field, []).append(item)
    found: dict[Problem, None] = {}
    for field, about in items.items():
        ours = [pair for item in about for pair in item.get("ctx", {}).get("problems", ())]
        if ours:
            found |= {Problem(where, field or inner, text): None for inner, text in ours}
        else:  # of a union's complaints, the one that looks inside the value
            _, text = max(
                (_sentence(item, kind.model_fields) for item in about), key=lambda s: s[0]
            )
            found[Problem(where, field, text)] = None
    return list(found)


def _sentence(item: Any, known: Mapping[str, FieldInfo]) -> tuple[bool, str]:
    """Whether it is about a part of the field's value, and what would do."""
    field, *inside = [part for part in item["loc"] if isinstance(part, str)] or [""]
    parts = _parts_of(known[field].annotation) if field in known else {}
    within, names = None, []
    for name in inside:
        if name in parts:
            within, parts = parts[name], _parts_of(parts[name].annotation) or parts
            names.append(name)
    place = ": ".join(names)
    if item["type"] == "extra_forbidden":
        if parts:
            text = f"has no field '{inside[-1]}'; {nearest(inside[-1], parts)}"
            return True, f"{place} {text}" if place else text
        return False, f"no such field; {nearest(field, known)}"
    if within is not None:
        return True, f"{place} {_expected(item, within)}"
    if field not in known:
        return False, f"{item['msg']}; given {shown(item.get('input'))}"
    return False, _expected(item, known[field])


def _expected(item: Any, field: FieldInfo) -> str:
    if item["type"] == "missing" and isinstance(item["loc"][-1], str):
        return f"is missing; give {field.description}"
    return f"must be {field.description}; given {shown(item.get('input'))}"


def _parts_of(annotation: Any) -> Mapping[str, FieldInfo]:
    """The fields of the objects that a value may be, such as a shape's; else none."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation.model_fields
    return {name: f for a in get_args(annotation) for name, f in _parts_of(a).items()}


def nearest_first(name: str, known: Iterable[str]) -> list[str]:
    """The names, those most like `name` before the others."""
    names = list(dict.fromkeys(known))
    close = difflib.get_close_matches(name, names, n=3)
    return [*close, *(x for x in names if x not in close)]


def nearest(name: str, known: Iterable[str]) -> str:
    """'did you mean mass? Choose from ...' for a mistyped name."""
    names = list(known)
    close = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {close[0]}? " if close else ""
    return f"{hint}choose from {choices(names, limit=40)}"


def _lists(value: Any) -> Any:
    return [_lists(x) for x in value] if isinstance(value, (list, tuple)) else value


def shown(value: Any, limit: int = 60) -> str:
    """A given value as it may stand in a sentence: short, and nan and inf spelled out."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    text = repr(_lists(value))
    return text if len(text) <= limit else text[: limit - 3] + "..."


GROUND = "ground"
EVERY = "*"  # in a contact: every body that has a shape


def name_problem(name: str) -> str:
    """What is wrong with the name of a part: it must show as what it is, in a table and a file."""
    if not name.strip():
        return f"must be text that is not empty; given {shown(name)}"
    if name != name.strip():
        return f"must not start or end with a space; given {shown(name)}"
    if not name.isprintable():
        return f"must be text on one line, without control characters; given {shown(name)}"
    return ""


def numbers(n: int) -> str:
    return f"{n} number" if n == 1 else f"{n} numbers"
