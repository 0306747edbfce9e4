"""Spreadsheet lines as rows of the table (pure)."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable, Sequence
from typing import Any, get_args

import pgraph_core as pg
from pgraph_core.errors import nearest
from pgraph_core.model.copies import free_name

from ..core import cells
from ..core.cells import Refusal
from ..core.derived import CONTACT

COLUMNS = ("name", "parent", "dof", "constraint")
HEADINGS = {
    "#": "", "number": "", "body": "name", "name": "name", "parent": "parent", "dof": "dof",
    "joint": "joint", "constraint": "constraint", "constraints": "constraint",
    "constraint type": "constraint", "mass": "mass",
}  # fmt: skip
UNIT = re.compile(r"\s*[\[(]\s*([^\])]*)[\])]\s*$")  # at the end of a heading: mass [kg]
AXIS = re.compile(r"[+-]?[xyzXYZ]")
VECTOR = re.compile(r"(link|com|tip) ([xyz])")
FIELDS = (*(f for f in pg.Body.model_fields if f not in ("motions", "shapes")), "motions", "shapes")
LENGTHS = ("link", "com", "tip")
NONE = "none"
COPIED = 1000  # rows at most with all that they carry
DOF = re.compile(r"([0-6])?\s*([a-z]+(?: \+ [a-z]+)*)?")
ALREADY = ("ball + z", "ball + x + y")  # texts of the DoF column for 4 and 5
JOINTS = get_args(pg.Body.model_fields["joint"].annotation)
Rod = Callable[[pg.Model, str, str], pg.Body]


def rows_of(
    model: pg.Model, text: str, rows: Sequence[str], column: int, under: str | None, rod: Rod
) -> tuple[pg.Model, tuple[str, ...], str]:
    """Return the model with the pasted lines, their bodies, and notes on changed entries.

    Lines fill `rows` one by one; more of them, or all without `rows`, become new rows, whose
    names are made free if `rows` is empty. Raises Refusal or PgraphError, naming the line.
    """
    columns, units, lines = _table(text, column)
    for name in rows:
        model.body(name)
    new = lines[len(rows) :]
    if new and rows and "name" not in columns:
        raise Refusal(f"line {len(rows) + 1} has no row; paste into the column Body to make rows")
    before = model
    places = _places(model, len(new))
    model = _with_rods(model, places, under, rod)
    names = _free_names(before, [_cell(line, columns, "name") for line in new], bool(rows))
    renamed = {old: now for old, now in names if old} if not rows else {}
    changes: dict[str, dict[str, Any]] = {}
    above = under or "ground"
    for k, line in enumerate(lines):
        body = model.body((*rows, *places)[k])
        change = _change(before, body, dict(zip(columns, zip(line, units))), k + 1)
        if k >= len(rows):
            change["name"] = names[k - len(rows)][1]
            parent = change.get("parent", above)
            change["parent"] = renamed.get(parent, parent)
            if not change.keys().isdisjoint(("shape", "shapes", "com")):
                change.setdefault("tip", None)  # drops the tip of the default rod
        above = change.get("name", body.name)
        changes[body.name] = change
    try:
        after = model.edit_all({name: change for name, change in changes.items() if change})
    except pg.PgraphError as error:
        text = str(error)
        for place, (_, name) in zip(places, names):
            text = text.replace(f"'{place}'", f"'{name}'")
        raise Refusal(text) from None
    filled = [changes[name].get("name", name) for name in (*rows[: len(lines)], *places)]
    told = (_renamed(names), _left_out(columns, lines))
    return after, tuple(filled), " ".join(text for text in told if text)


def copied(model: pg.Model, names: Sequence[str]) -> str:
    """Return rows as spreadsheet lines below headings, with all data of the bodies."""
    found = [_carried(model.body(name)) for name in names]
    columns = [field for field in FIELDS if any(field in row for row in found)]
    lines = [columns, *([_written(row.get(field, "")) for field in columns] for row in found)]
    text = io.StringIO()
    csv.writer(text, delimiter="\t", lineterminator="\n").writerows(lines)
    return text.getvalue()


def _carried(body: pg.Body) -> dict[str, Any]:
    """Return the fields of a body that do not follow from others, including defaults."""
    follows = {*body.derived, "axes" if body.joint == "compound" else "motions"}
    data = body.model_dump(mode="json")
    follows.add("shapes" if len(data["shapes"]) < 2 else "shape")
    usual = {name: field.default for name, field in pg.Body.model_fields.items()}
    always = ("name", "parent", "joint", "axes", "link", "mass", "com", "inertia", "tip")
    return {
        name: NONE if value is None else value
        for name, value in data.items()
        if name not in follows
        and (name in always or (getattr(body, name) != usual[name] and _says(value)))
    }


def _says(value: Any) -> bool:
    """Return True for a list with a nonzero entry, or for any other nonempty value."""
    return any(map(_says, value)) if isinstance(value, list) else value not in (0, None, "")


def _written(value: Any) -> str:
    """Return the cell text of a value. Words and numbers are unchanged, lists are JSON."""
    return value if isinstance(value, str) else json.dumps(value)


def _table(text: str, column: int) -> tuple[tuple[str, ...], tuple[str, ...], list[list[str]]]:
    """Return fields and units by column, from headings if there are any, and lines of cells."""
    try:
        mark = _separator(text.strip("\r\n"))
        found = list(csv.reader(io.StringIO(text.strip("\r\n")), delimiter=mark, strict=False))
    except csv.Error as error:
        raise Refusal(f"it is no table: {error}") from None
    lines = [[cell.strip() for cell in line] for line in found]
    if not lines:
        raise Refusal("there is nothing to paste")
    first = tuple(_field(UNIT.sub("", heading)) for heading in lines[0])
    if None not in first and ("name" in first or len(first) > 1):
        units = tuple(m[1].strip() if (m := UNIT.search(x)) else "" for x in lines[0])
        columns, lines = tuple(str(f) for f in first), lines[1:]
        if twice := [f for i, f in enumerate(columns) if f and f in columns[:i]]:
            raise Refusal(f"two columns are headed '{twice[0]}'; leave one of them out")
    else:
        _no_heading(lines[0], first)
        columns = COLUMNS[column:]
        units = ("",) * len(columns)
    for k, line in enumerate(lines, 1):
        if len(line) > len(columns) and any(line[len(columns) :]):
            raise Refusal(f"line {k} has {len(line)} cells; {len(columns)} fit: {_listed(columns)}")
    return columns, units, [line for line in lines if any(line)]


def _separator(text: str) -> str:
    """Return the cell separator: a tab for a spreadsheet, or the separator of a .csv file.

    The headings decide, because a name may contain a comma.
    """
    first = text.partition("\n")[0]
    for mark in ";,":
        cells = first.split(mark)
        known = [_field(UNIT.sub("", cell.strip().strip('"'))) is not None for cell in cells]
        if "\t" not in text and len(cells) > 1 and any(known):
            return mark
    return "\t"


def _no_heading(line: Sequence[str], fields: Sequence[str | None]) -> None:
    """Reject a line of headings in which some name is not a field. Raises Refusal."""
    known = [field for field in fields if field]
    if len(known) < 3 or "name" not in known:
        return
    other = next(text for text, field in zip(line, fields) if field is None)
    raise Refusal(f"no field is named {cells.quoted(other)}; {nearest(other, FIELDS)}")


def _field(heading: str) -> str | None:
    """Return the field named by a heading, or None."""
    text = heading.strip().lower()
    return text if VECTOR.fullmatch(text) or text in FIELDS else HEADINGS.get(text)


def _listed(columns: Sequence[str]) -> str:
    return ", ".join(name or "number" for name in columns)


def _cell(line: Sequence[str], columns: Sequence[str], field: str) -> str:
    """Return the text of a line in the column of `field`, or ""."""
    return dict(zip(columns, line)).get(field, "")


def _places(model: pg.Model, count: int) -> tuple[str, ...]:
    """Return placeholder names for new rows until they get their own."""
    blank = "new row "
    while any(name.startswith(blank) for name in model.row):
        blank = f"a {blank}"
    return tuple(f"{blank}{k}" for k in range(1, count + 1))


def _with_rods(model: pg.Model, places: Sequence[str], under: str | None, rod: Rod) -> pg.Model:
    """Add a rod on a hinge for each new row, attached to the ground for now."""
    if not places:
        return model
    chain = pg.Model.serial(1)
    on = under if under in model.row else "ground"
    first = rod(model if model.bodies else chain, places[0], str(on))
    more = rod(chain, "more", "1")
    new = [first, *(more.unchecked_copy({"name": name}) for name in places[1:])]
    new = [body.unchecked_copy({"parent": "ground"}) for body in new]
    return model.replace(bodies=(*model.bodies, *new))


def _free_names(model: pg.Model, wanted: Sequence[str], as_typed: bool) -> list[tuple[str, str]]:
    """Return (typed, used) names for each new row. Untyped names are the next free numbers."""
    used, found = set(model.row), []
    for name in wanted:
        free = name if name and as_typed else free_name(name or str(len(used) + 1), used)
        used.add(free)
        found.append((name, free))
    return found


def _change(
    model: pg.Model, body: pg.Body, line: dict[str, tuple[str, str]], number: int
) -> dict[str, Any]:
    """Return the body fields that a line changes, ignoring empty cells.

    The line is (text, unit) by field.
    """
    found: dict[str, Any] = {}
    for field, (text, unit) in line.items():
        if not text or not field:
            continue
        try:
            change = _typed(model, body, field, text, unit)
        except Refusal as refusal:
            raise Refusal(f"line {number}, {field}: {refusal}") from None
        body = body.unchecked_copy({k: x for k, x in change.items() if k not in ("dof", "name")})
        found |= change
    if "motions" in found:
        found.pop("dof", None)
        found["joint"] = "compound"
    return found


def _typed(model: pg.Model, body: pg.Body, field: str, text: str, unit: str) -> dict[str, Any]:
    if field == "constraint":
        return _read_only(model, text)
    if field in ("dof", "joint"):
        return _joint(body, text)
    if match := VECTOR.fullmatch(field):
        value = repr(_number(text, unit, "length"))
        return cells.change(body, match[1], ("xyz".index(match[2]),), value)
    if field in ("name", "parent"):
        return cells.change(body, field, (), text)
    if field == "mass" or (field == "density" and text.lower() != NONE):
        return {field: _number(text, unit, "mass" if field == "mass" else "number")}
    return {field: _value(field, text, unit)}


def _number(text: str, unit: str, of: cells.Quantity) -> float:
    """Return the SI value of a cell, in the unit of its heading or its own unit. Raises Refusal."""
    known = cells.UNITS[of]
    if unit and known and unit not in known:
        raise Refusal(f"has the unit {cells.quoted(unit)}; use {' or '.join(known)}")
    if cells.NUMBER.fullmatch(text) and unit in known:
        times, by = known[unit]
        return cells.number(text) * times / by
    return cells.quantity(text, of, cells.Display())


def _value(field: str, text: str, unit: str) -> Any:
    """Parse a field that is not a single number: JSON, or blank-separated numbers or words."""
    if text.lower() == NONE:
        return None
    if text[0] in '[{"' or text in ("true", "false"):
        try:
            value = json.loads(text)
        except ValueError:
            raise Refusal(f"cannot be read; given {cells.quoted(text)}") from None
        text = " ".join(map(str, value)) if field in LENGTHS else ""
        if field not in LENGTHS:
            return value
    words = re.split(r"[\s,;]+", text.strip())
    if field == "derived":
        return tuple(words)
    if field == "axes" and all(AXIS.fullmatch(word) for word in words):
        return tuple(_unit_vector(word) for word in words)
    if field not in (*LENGTHS, "inertia", "rotation", "axes", "q", "v"):
        numbers = [cells.number(word) for word in words]
        return numbers[0] if len(numbers) == 1 else tuple(numbers)
    if field in LENGTHS:
        numbers = [_number(word, unit, "length") for word in words]
    else:
        numbers = [cells.number(word) for word in words]
    if field != "inertia":
        return tuple(numbers)
    if len(numbers) == 9:
        return tuple(tuple(numbers[k : k + 3]) for k in (0, 3, 6))
    if len(numbers) != 3:
        raise Refusal(f"needs the 3 moments about x, y, z or all 9 numbers; given {len(numbers)}")
    return tuple(tuple(m if i == k else 0.0 for k in range(3)) for i, m in enumerate(numbers))


def _unit_vector(axis: str) -> tuple[float, ...]:
    """Return the direction for text such as '-y'."""
    sign = -1.0 if axis[0] == "-" else 1.0
    return tuple(sign if letter == axis[-1].lower() else 0.0 for letter in "xyz")


def _joint(body: pg.Body, text: str) -> dict[str, Any]:
    """Parse `1`, `prismatic` or `1 prismatic`. Returns {} if the joint does not change."""
    match = DOF.fullmatch(text.lower())
    dof, kind = match.groups() if match else (None, text)
    kind = "compound" if kind in ALREADY else kind
    if kind is not None and kind not in JOINTS:
        cells.whole(text, 0, 6)
    if (dof is None or int(dof) == body.dof) and kind in (None, body.joint):
        return {}
    if kind is None or kind == "compound":
        if dof and kind and dof not in "45":
            raise Refusal(
                f"a compound joint of {dof} DoF is made in its properties; given '{text}'"
            )
        return {"dof": int(dof or 4)}
    return {"joint": kind} | ({"dof": int(dof)} if dof else {})


def _read_only(model: pg.Model, text: str) -> dict[str, Any]:
    """Return {}, because the column follows from the lists. Raises Refusal for unknown names."""
    named = {c.name for c in (*model.constraints, *model.contacts)}
    known = {"holonomic", "limits", CONTACT, *named}
    for name in (part.strip() for part in text.split(",")):
        if name and name not in known:
            raise Refusal(
                f"no constraint is called '{name[:40]}'; this column is filled from the list of "
                "constraints: add it there"
            )
    return {}


def _renamed(names: Sequence[tuple[str, str]]) -> str:
    """Return a message that lists the bodies whose typed names were already in use."""
    changed = [f"'{old}' became '{new}'" for old, new in names if old and old != new]
    more = f" and {len(changed) - 5} more" if len(changed) > 5 else ""
    return f"Names are unique: {', '.join(changed[:5])}{more}." if changed else ""


def _left_out(columns: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Return a message if lines name constraints, which are not pasted."""
    named = (_cell(line, columns, "constraint") for line in lines)
    if any(text not in ("", "holonomic") for text in named):
        return "Without constraints: that column is filled from the list of constraints."
    return ""
