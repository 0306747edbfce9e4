"""Pydantic errors as sentences, with our terms for those used by other programs."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from . import words
from .errors import Problem, nearest, shown
from .signals import is_expression
from .signals.meaning import varies

GROUND = "ground"
PAIR = ("body", "other")  # the fields of a part that name bodies


def all_problems(
    kind: type[BaseModel],
    data: Mapping[str, Any],
    error: ValidationError,
    where: str,
    followers: Mapping[str, tuple[str, ...]],
) -> list[Problem]:
    """Return all problems in a part, including those found after the invalid fields are removed.

    An invalid field hides problems of the whole part, so validation is repeated without it.
    `followers` have no meaning without their field and are dropped with it.
    """
    found: list[Problem] = []
    refused: set[str] = set()
    while True:
        now = [p for p in _problems(kind, data, error, where) if p.field not in refused]
        moot = {name for p in now for name in followers.get(p.field, ()) if name != p.field}
        found += [p for p in now if p.field not in moot]
        if {p.field for p in found} <= refused:
            return found
        refused |= {p.field for p in found}
        refused |= {name for field in refused for name in followers.get(field, ())}
        left = {"name": "unnamed"} if "name" in kind.model_fields else {}
        left |= {key: value for key, value in data.items() if key not in refused}
        try:
            BaseModel.__init__(kind.__new__(kind), **left)
        except ValidationError as more:
            error = more
        else:
            return found


def _problems(
    kind: type[BaseModel], data: Mapping[str, Any], error: ValidationError, where: str
) -> list[Problem]:
    """Return one Problem per refused field, or all problems found by our validator."""
    items: dict[str, list[Any]] = {}
    for item in error.errors(include_url=False):
        field = next((part for part in item["loc"] if isinstance(part, str)), "")
        items.setdefault(field, []).append(item)
    found: dict[Problem, None] = {}
    for field, about in items.items():
        ours = [pair for item in about for pair in item.get("ctx", {}).get("problems", ())]
        if ours:
            found |= {_of_validator(where, field, inner, text): None for inner, text in ours}
        else:  # the most specific of a union's errors
            found_in = (_of_whole(item, data.get(field, item.get("input"))) for item in about)
            _, text = max((_sentence(x, kind.model_fields) for x in found_in), key=lambda s: s[0])
            found[Problem(where, field, text)] = None
    return list(found)


def _of_validator(where: str, field: str, inner: str, text: str) -> Problem:
    """Return the problem that a validator found, by the name of its field in a nested part."""
    named = not field or not inner or inner in text
    return Problem(where, field or inner, text if named else f"{inner}: {text}")


def _of_whole(item: Any, value: Any) -> Any:
    """Return the error about a whole value if a number was confused with a list of numbers."""
    inside = item["loc"][1:]
    row = "tuple" in item["type"] or isinstance(item.get("input"), (tuple, list))
    rows = inside and all(isinstance(part, int) for part in inside) and row
    return {**item, "input": value} if rows else item


def _sentence(item: Any, known: Mapping[str, FieldInfo]) -> tuple[bool, str]:
    """Return (whether the error concerns only a part of the value, sentence)."""
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
        return False, no_such_field(field, known)
    if within is not None:
        return True, f"{place} {_expected(item, within)}"
    if field not in known:
        return False, f"{item['msg']}, got {shown(item.get('input'))}"
    return False, _expected(item, known[field])


def no_such_field(name: str, known: Mapping[str, FieldInfo]) -> str:
    """Return a sentence about an unknown field that suggests a nested or a similar field."""
    for own, info in known.items():
        parts = {} if get_origin(info.annotation) is tuple else _parts_of(info.annotation)
        inner = name if name in parts else words.ours(name, parts)
        if inner in parts and not words.hint(name, known, alike=False):
            return f"no such field; it belongs to the {own}: {own}={{..., {inner!r}: ...}}"
    about = lambda own: known[own].description or ""  # noqa: E731
    return f"no such field; {nearest(name, known, about)}"


def _expected(item: Any, field: FieldInfo) -> str:
    if item["type"] == "missing" and isinstance(item["loc"][-1], str):
        return f"is missing; give {field.description}"
    given = item.get("input")
    if any(isinstance(x, str) and is_expression(x) and varies(x) for x in _leaves(given)):
        return f"must be {field.description}, constant, got {shown(given)}, which varies"
    if any(map(is_expression, _leaves(given))):
        do = "a formula is given to an edit, model.edit(name, ...), or stands in a file"
        return f"must be {field.description}, got {shown(given)}; {do}"
    return f"must be {field.description}, got {shown(given)}{_meant(item, given, field)}"


def _meant(item: Any, given: Any, field: FieldInfo) -> str:
    """Return our equivalent for a value that other programs accept."""
    name = item["loc"][0] if item["loc"] else ""
    if name == "gravity" and isinstance(given, float | int) and 0 < abs(given) < math.inf:
        return f"; write (0, 0, {-abs(given)}) if z is up"
    if name == "ground" and isinstance(given, bool):
        return "; the plane is always there, and contacts=[pg.Contact(body='*')] rest on it"
    if name in ("axis", "other_axis", "axes"):
        return along(given)
    if name == "rotation" and getattr(given, "shape", ()) == (3, 3):
        return "; write scipy's Rotation.from_matrix(R).as_quat(scalar_first=True)"
    if name == "inertia" and isinstance(given, (list, tuple)) and len(given) == 6:
        return "; of six moments write the matrix ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))"
    if callable(given) and "expression" in (field.description or ""):
        return "; write it, as '=2*sin(3*t)'; of functions simulate takes tau=f(t, q, v)"
    if isinstance(given, (list, tuple)) and "table" in (field.description or ""):
        return "; values over time are pg.Table(t=[...], value=[...])"
    if isinstance(given, str) and "expression" in (field.description or ""):
        return f"; an expression begins with '=': '={given.strip()}'" * given.isprintable()
    if isinstance(given, str) and re.match(r"\s*[-+.\deE]*\d[.\deE]*\s*(?=[^\d\s])", given):
        unit = re.search(r"\[[^\]]+\]", field.description or "")
        return f"; write a number in {unit[0] if unit else 'SI units'}, without a unit"
    if item["type"] == "literal_error":
        return words.choice(given, re.findall(r"'([^']+)'", item["ctx"]["expected"]))
    return words.synonym(given, re.findall(r"\w+", field.description or ""))


def along(given: Any) -> str:
    """Return the hint "write (0, 1, 0)" if an axis is given as "y"."""
    letter = given.removeprefix("-") if isinstance(given, str) else ""
    if letter not in ("x", "y", "z"):
        return ""
    sign = 1 if given == letter else -1
    return f"; write {tuple(sign * (letter == x) for x in 'xyz')}"


def _leaves(value: Any) -> Iterator[Any]:
    if isinstance(value, (list, tuple)):
        for x in value:
            yield from _leaves(x)
    else:
        yield value


def _parts_of(annotation: Any) -> Mapping[str, FieldInfo]:
    """Return the fields of the objects that a value may be, such as a shape's, or {} otherwise."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation.model_fields
    return {name: f for a in get_args(annotation) for name, f in _parts_of(a).items()}


def in_our_words(kind: type[BaseModel], data: Mapping[str, Any]) -> dict[str, Any]:
    """Return invalid fields under our names and choices, or {} if nothing changes."""
    found = _ours(kind.model_fields, data)
    if "name" in kind.model_fields and "name" not in found and isinstance(found.get("body"), str):
        found["name"] = _name_of(kind, found)
    return {} if _same(found, data) else found


def _same(a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    """Check whether two mappings contain the same objects."""
    return a.keys() == b.keys() and all(a[name] is b[name] for name in a)


def _ours(fields: Mapping[str, FieldInfo], data: Mapping[str, Any]) -> dict[str, Any]:
    found = words.renamed(data, fields) or dict(data)
    for name, value in found.items():
        if name in (*PAIR, "parent") and isinstance(value, BaseModel):
            value = found[name] = getattr(value, "name", value)  # a body for its name
        annotation = fields[name].annotation if name in fields else None
        if isinstance(value, Mapping) and (parts := _parts_of(annotation)):
            inner = _ours(parts, value)
            found[name] = value if _same(inner, value) else inner
        elif get_origin(annotation) is Literal:
            found[name] = words.chosen(value, get_args(annotation)) or value
    return found


def _name_of(kind: Any, data: Mapping[str, Any]) -> str:
    """Return a name for an unnamed part, from its bodies and its kind."""
    ends = [x for x in map(data.get, PAIR) if isinstance(x, str) and x != GROUND]
    what = getattr(kind, "own_kind", kind.word)()
    return f"{'-'.join(ends)} {what}"
