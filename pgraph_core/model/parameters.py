"""Named numbers shared between cells, and the formulas that use them, such as '=thigh/2'.

A model only contains numbers. Its formulas are stored separately, with the location of their cells.
In a file, a formula takes the place of the value. A cell that gets another number loses its
formula.
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from keyword import iskeyword
from typing import Any, Literal

from pydantic import Field, ValidationError

from ..errors import ModelError, Problem, shown
from ..fields import Frozen, Text, fields_of, is_expression
from ..signals.grammar import RESERVED, Unreadable, names_in, parsed
from ..signals.meaning import constant, varies

PartKind = Literal["bodies", "beams", "constraints", "contacts", "forces", "controls"]
KINDS: tuple[PartKind, ...] = ("bodies", "beams", "constraints", "contacts", "forces", "controls")
TEXT = {  # fields that hold words, of parts and what is in them
    "name", "parent", "joint", "kind", "body", "other", "law", "frame", "file",
}  # fmt: skip
DIRECTIONS = {"axes", "motions"}  # stand twice in a body, so that a formula would have two places
LONGEST_FORMULA = 200  # characters of a formula
MOST_FORMULAS = 10_000  # formulas of a model: evaluating them takes about a second
LONGEST_NAME = 60
USABLE = re.compile(r"[^\W\d]\w*")  # a name of the grammar
MOST_LISTS = 10  # limit on nested lists with formulas, more than any field has

CURVES = ("q_of_t", "curve")  # fields without a number: '=...' is an expression, even a constant

TRACK = "track"  # a field with functions of q, which are no formulas

NUMBERS = frozenset((float, int, type(None)))  # types that are no formula and hold none
LISTS = frozenset((list, tuple))

Path = tuple[str | int, ...]


class Formula(Frozen):
    """A formula that replaces a number, with the location of its cell."""

    part: PartKind = Field(description="one of " + ", ".join(KINDS))
    name: Text = Field(description="the name of the part")
    path: tuple[str | int, ...] = Field(min_length=1, description="a field and its path")
    text: Text = Field(description="'=' and an expression")

    @property
    def where(self) -> str:
        """The name of the part, for use in a Problem."""
        return f"{_WORD[self.part]} {shown(self.name)}"


_WORD = {
    "bodies": "body",
    "beams": "beam",
    "constraints": "constraint",
    "contacts": "contact",
    "forces": "force",
    "controls": "control",
}


def evaluated(text: str, parameters: Mapping[str, float]) -> float:
    """Return the finite value of a formula '=...'. Raises ValueError with a message."""
    given = shown(text.strip())
    if len(text) > LONGEST_FORMULA:
        raise ValueError(f"a formula has at most {LONGEST_FORMULA} characters, got {len(text)}")
    try:
        tree = parsed(text)
    except Unreadable as error:
        do = "write it as =thigh/2 or =2*(a + b), with + - * / ^ and parentheses"
        raise ValueError(f"{given} is not a valid formula: {error}; {do}") from None
    try:
        result = constant(tree, parameters)
    except Unreadable as error:
        raise ValueError(str(error)) from None
    except ZeroDivisionError:
        raise ValueError(f"{given} divides by zero") from None
    except OverflowError:
        raise ValueError(f"{given} is too large for a number") from None
    except ValueError:
        raise ValueError(f"{given} has no value") from None
    if isinstance(result, complex) or not math.isfinite(result):
        raise ValueError(f"{given} is not a finite number")
    return float(result)


def negated(text: str) -> str:
    """Return the negated formula, removing an earlier negation if there is one."""
    inner = text.strip().removeprefix("=").strip()
    rest = inner.removeprefix("-")
    if rest != inner and (rest.isidentifier() or _enclosed(rest)):
        return "=" + (rest if rest.isidentifier() else rest[1:-1])
    return f"=-{inner}" if inner.isidentifier() else f"=-({inner})"


def _enclosed(text: str) -> bool:
    """Check whether the first parenthesis closes at the last character."""
    depth = [text[:k].count("(") - text[:k].count(")") for k in range(1, len(text))]
    return text[:1] == "(" and text[-1:] == ")" and min(depth, default=0) > 0


def name_problems(parameters: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return problems with names that cannot be used in a formula."""
    found = []
    for name in parameters:
        if name in RESERVED:
            text = f"{shown(name)} is reserved in formulas; choose another name"
        elif not USABLE.fullmatch(name) or len(name) > LONGEST_NAME or iskeyword(name):
            text = f"a parameter's name is one word of letters, digits and _, got {shown(name)}"
        else:
            continue
        found.append(("parameters", text))
    return found


# -- formulas in the fields of a model ---------------------------------------------------------


def resolved(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a model with formulas replaced by numbers, and all formulas.

    Formulas are given as values in dictionaries, or under the key "formulas". Raises ModelError
    with every formula that has no value.
    """
    formulas = data.get("formulas", ())
    if not isinstance(formulas, (list, tuple)):
        text = f"must be a list of formulas of cells, got {shown(formulas)}"
        raise ModelError(Problem("model", "formulas", text))
    parts = {kind: data.get(kind, ()) for kind in KINDS}
    named = data.get("parameters")
    named = named if isinstance(named, Mapping) else {}
    cells = (f for kind in KINDS for f in _inline(kind, parts[kind], named))
    inline = list(islice(cells, MOST_FORMULAS + 1))
    if len(formulas) > MOST_FORMULAS or len(inline) > MOST_FORMULAS:
        text = f"are at most {MOST_FORMULAS} in a model; write numbers in the other cells"
        raise ModelError(Problem("model", "formulas", text))
    given = [_formula(item) for item in formulas]
    if not given and not inline:
        return dict(data)
    places = {(f.part, f.name, f.path): f for f in (*given, *inline)}
    parameters = _numbers(data.get("parameters"))
    values: dict[tuple[str, str], dict[Path, float]] = {}
    problems = []
    for (part, name, path), formula in places.items():
        try:
            if path[0] in DIRECTIONS:
                raise ValueError(f"a direction takes numbers, got {shown(formula.text)}")
            values.setdefault((part, name), {})[path] = evaluated(formula.text, parameters)
        except ValueError as error:
            problems.append(Problem(formula.where, str(path[0]), str(error)))
    if problems:
        raise ModelError(problems)
    filled = {
        kind: tuple(_filled(item, values.get((kind, _name(item)), {})) for item in parts[kind])
        for kind in {f.part for f in places.values()}
    }
    return {**data, **filled, "formulas": ordered(places.values())}


def _formula(item: Any) -> Formula:
    try:
        return item if isinstance(item, Formula) else Formula(**item)
    except (ValidationError, ModelError, TypeError):
        text = f"needs part, name, path and text, got {shown(item)}"
        raise ModelError(Problem("model", "formulas", text)) from None


def _numbers(parameters: Any) -> dict[str, float]:
    """Return the numeric parameters. Others are rejected by field validation."""
    if not isinstance(parameters, Mapping):
        return {}
    return {
        key: float(x)
        for key, x in parameters.items()
        if isinstance(x, (int, float)) and not isinstance(x, bool)
    }


def _name(item: Any) -> str:
    name = item.get("name") if isinstance(item, Mapping) else getattr(item, "name", "")
    return name if isinstance(name, str) else ""


def _inline(kind: PartKind, items: Any, parameters: Container[str]) -> Iterator[Formula]:
    for item in items if isinstance(items, (list, tuple)) else ():
        if isinstance(item, Frozen) and kind != "bodies":
            fields: Any = fields_of(item)
        else:
            fields = item
        if isinstance(fields, Mapping) and holds_formula(fields):
            for path, text in formulas_in(fields, (), parameters):
                yield Formula(part=kind, name=_name(item), path=_known(path), text=text)


def _known(path: Path) -> Path:
    """Return the path by which a cell is known: the first of `shapes` is also `shape`."""
    return ("shape", *path[2:]) if path[:2] == ("shapes", 0) else path


def holds_formula(value: Any, depth: int = 0) -> bool:
    """Check whether any cell in a dictionary contains a formula or an expression."""
    if isinstance(value, str):
        return is_expression(value)
    if depth > MOST_LISTS:
        return False
    if isinstance(value, (list, tuple)):
        cells = value
    elif isinstance(value, (dict, Mapping)):  # dict: the check of an abstract class is slow
        cells = [x for key, x in value.items() if key not in TEXT]
    else:
        return False
    for x in cells:
        kind = type(x)
        if kind in NUMBERS or (kind in LISTS and NUMBERS.issuperset(map(type, x))):
            continue
        if holds_formula(x, depth + 1):
            return True
    return False


def texts_in(value: Any) -> Iterator[str]:
    """Yield the texts that start with '=' in the cells of a dictionary."""
    inside = value.values() if isinstance(value, Mapping) else value
    for x in inside if isinstance(value, (Mapping, list, tuple)) else ():
        yield from texts_in(x)
    if isinstance(value, str) and is_expression(value):
        yield value


def formulas_in(
    value: Any, path: Path = (), parameters: Container[str] = ()
) -> Iterator[tuple[Path, str]]:
    """Yield the formulas in the cells of a dictionary, with the paths to their cells."""
    if is_expression(value) and not varies(value, parameters):
        if path[:1] != (TRACK,) or "q" not in names_in(value):
            yield path, value.strip()
    elif len(path) > MOST_LISTS:
        return
    elif isinstance(value, Mapping):
        for key, x in value.items():
            if key not in TEXT and not (key in CURVES and isinstance(x, str)):
                yield from formulas_in(x, (*path, str(key)), parameters)
    elif isinstance(value, (list, tuple)):
        for i, x in enumerate(value):
            yield from formulas_in(x, (*path, i), parameters)


def _filled(item: Any, values: Mapping[Path, float]) -> Any:
    """Return a part with new values in its cells, validated if it was validated before."""
    new = {path: x for path, x in values.items() if not _holds(at(item, path), x)}
    if not new:
        return item
    data = item if isinstance(item, Mapping) else fields_of(item)
    if derived := set(() if data is item else data.get("derived", ())) - {p[0] for p in new}:
        data = {key: value for key, value in data.items() if key not in derived}
    if data.get("shapes"):  # `shape` is the first of `shapes`
        data = {key: value for key, value in data.items() if key != "shape"}
        new = {("shapes", 0, *p[1:]) if p[0] == "shape" else p: x for p, x in new.items()}
    data = put(data, new)
    return data if isinstance(item, Mapping) else type(item)(**data)


def at(value: Any, path: Sequence[str | int]) -> Any:
    """Return the value at a path, or None if there is none."""
    for step in path:
        if isinstance(value, Mapping):
            value = value.get(step)
        elif isinstance(value, (list, tuple)) and isinstance(step, int) and step < len(value):
            value = value[step]
        else:
            value = getattr(value, str(step), None)
    return value


def put(value: Any, new: Mapping[Path, Any]) -> Any:
    """Return `value` with new values at their paths. Parts on the way become dictionaries."""
    if () in new:
        return new[()]
    below: dict[str | int, dict[Path, Any]] = {}
    for (first, *rest), x in new.items():
        below.setdefault(first, {})[tuple(rest)] = x
    if isinstance(value, (list, tuple)) and all(_is_place(value, first) for first in below):
        return tuple(put(x, below[i]) if i in below else x for i, x in enumerate(value))
    data = fields_of(value) if isinstance(value, Frozen) else dict(value or {})
    return {**data, **{str(i): put(data.get(str(i)), inner) for i, inner in below.items()}}


def _is_place(value: Sequence[Any], first: str | int) -> bool:
    return isinstance(first, int) and 0 <= first < len(value)


def probed(value: Any, path: Sequence[str | int], x: float) -> Any:
    """Return `value` with a number at a path, in all entries if shared, unvalidated."""
    if not path:
        return (x,) * len(value) if isinstance(value, tuple) else x
    first, rest = path[0], path[1:]
    if isinstance(first, int):
        return (*value[:first], probed(value[first], rest, x), *value[first + 1 :])
    new = {str(first): probed(at(value, path[:1]), rest, x)}
    return {**value, **new} if isinstance(value, Mapping) else value.unchecked_copy(new)


def inlined(part: Any, formulas: Iterable[Formula]) -> dict[str, Any]:
    """Return the fields of a part as in a file, including formulas."""
    data = dict(part) if isinstance(part, Mapping) else fields_of(part)
    new = {formula.path: formula.text for formula in formulas}
    return put(data, new) if new else data


def cells_of(
    changes: Mapping[str, Mapping[str, Any]],
    parameters: Mapping[str, float],
    part: PartKind = "bodies",
) -> tuple[dict[str, dict[str, Any]], tuple[Formula, ...]]:
    """Return part changes with formulas as numbers, and the formulas. Raises ModelError."""
    rows = tuple({**fields, "name": name} for name, fields in changes.items())
    if not any(any(formulas_in(row, (), parameters)) for row in rows):
        return {name: dict(fields) for name, fields in changes.items()}, ()
    filled = resolved({part: rows, "parameters": parameters})
    numbers = {
        name: {key: row[key] if key != "name" else fields[key] for key in fields}
        for (name, fields), row in zip(changes.items(), filled[part])
    }
    return numbers, filled["formulas"]


def followed(
    formulas: Iterable[Formula],
    new: Iterable[Formula],
    names: Mapping[str, str],
    part: PartKind = "bodies",
) -> tuple[Formula, ...]:
    """Return the formulas after an edit, with parts renamed."""
    cells = {(f.part, f.name, f.path): f for f in (*formulas, *new)}
    return ordered(
        f.unchecked_copy({"name": names.get(f.name, f.name)}) if f.part == part else f
        for f in cells.values()
    )


def still_true(
    formulas: Iterable[Formula], parts: Mapping[str, Sequence[Any]], parameters: Mapping[str, float]
) -> tuple[Formula, ...]:
    """Return the formulas whose cell exists and still has their value."""
    named: dict[str, dict[str, Any]] = {}
    kept = []
    for f in formulas:
        if f.part not in named:
            named[f.part] = {_name(item): item for item in parts[f.part]}
        value = at(named[f.part].get(f.name), f.path)
        if value == f.text or _holds(value, evaluated(f.text, parameters)):
            kept.append(f)
    return ordered(kept)


def ordered(formulas: Iterable[Formula]) -> tuple[Formula, ...]:
    """Return formulas in an order that is independent of the model's history."""
    return tuple(sorted(formulas, key=lambda f: (KINDS.index(f.part), f.name, *map(str, f.path))))


def _holds(value: Any, number: float) -> bool:
    """Check whether a cell, or every entry of a tuple, has this value."""
    if isinstance(value, tuple) and value:
        return all(x == number for x in value)
    return value == number
