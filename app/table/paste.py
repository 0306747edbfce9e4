"""Spreadsheet lines as rows of the table (pure)."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, get_args

import pgraph_core as pg
from pgraph_core.errors import choices, nearest
from pgraph_core.joints import PER_MOTION, units_of
from pgraph_core.model.body import following
from pgraph_core.model.editing import free_name
from pgraph_core.model.shape import mass_properties_of

from ..core import cells
from ..core.cells import Refusal
from ..core.edit import MOST_BODIES
from ..core.state import CONTACT
from ..properties.body_cells import quantity_of, shows

COLUMNS = ("name", "parent", "dof", "constraint")
HEADINGS = {
    "#": "", "number": "", "body": "name", "name": "name", "parent": "parent", "dof": "dof",
    "joint": "joint", "constraint": "constraint", "constraints": "constraint",
    "constraint type": "constraint", "mass": "mass",
}  # fmt: skip
UNIT = re.compile(r"[\[(]\s*([^\[\]()]*)[\])]\s*$")  # at the end of a heading: mass [kg]
AXIS = re.compile(r"[+-]?[xyzXYZ]")
VECTOR = re.compile(r"(link|com|tip) ([xyz])")
FIELDS = (*(f for f in pg.Body.model_fields if f not in ("motions", "shapes")), "motions", "shapes")
LENGTHS = ("link", "com", "tip")
OF_JOINT = ("joint", "dof", "motions")  # read first: the units of other cells follow from them
NUMBERS = (
    *LENGTHS, "mass", "density", "inertia", "rotation", "axes", "q", "v", "limits", *PER_MOTION,
)  # fmt: skip
TYPED = {unit + per for units in cells.UNITS.values() for unit in units for per in ("", "/s")}
BETWEEN = re.compile(  # separators of numbers, but not the blank before a unit
    rf"\s*[,;]\s*|\s+(?!(?:{'|'.join(sorted(TYPED | {'rpm'}))})(?:[\s,;]|$))"
)
NONE = "none"
COPIED = 1000  # rows at most with all that they carry
DOF = re.compile(r"([0-6])?\s*([a-z]+(?: \+ [a-z]+)*)?")
ALREADY = ("ball + z", "ball + x + y")  # texts of the DoF column for 4 and 5
MOST_LINES = 10 * MOST_BODIES  # lines that are read, empty ones and those of long cells included
MOST_CELLS = 10 * MOST_LINES
JOINTS = get_args(pg.Body.model_fields["joint"].annotation)
Rod = Callable[[pg.Model, str, str], pg.Body]


def rows_of(
    model: pg.Model, text: str, rows: Sequence[str], column: int, under: str | None, rod: Rod
) -> tuple[pg.Model, tuple[str, ...], str]:
    """Return the model with the pasted lines, their bodies, and notes on changed entries.

    Lines are assigned to `rows` in order. Any additional lines become new rows, with unique names
    if `rows` is empty. A new row with only the columns of the table is a `rod`. If there are other
    columns, the defaults of a model file are used, and the centre of mass is at the centre of the
    shapes or the rod. Raises Refusal or PgraphError, naming the line.
    """
    columns, units, lines = _table(text, column)
    for name in rows:
        model.body(name)
    new = lines[len(rows) :]
    if new and rows and "name" not in columns:
        raise Refusal(f"line {len(rows) + 1} has no row; paste into the Body column to add rows")
    if (bodies := len(model.bodies) + len(new)) > MOST_BODIES:
        raise Refusal(f"it would be {bodies} bodies; from 1 to {MOST_BODIES}")
    before = model
    places = _places(model, len(new))
    described = not {"joint", "", *COLUMNS}.issuperset(columns)
    model = _with_rows(model, places, under, None if described else rod)
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
            if change.get("shape") or change.get("shapes"):
                follow = [x for x in following(change) if x != "com"]  # `_centred` tells of it
                change.setdefault("derived", tuple(follow))
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
    open_ = [now for place, (_, now) in zip(places, names) if "com" not in changes[place]]
    after, centres = _centred(after, open_)
    told = (_renamed(names), _left_out(columns, lines), centres)
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
    text = text.strip("\r\n")
    mark = _separator(text)
    length, count = text.count("\n") + 1, text.count(mark) + 1
    if length > MOST_LINES or count > MOST_CELLS:
        most = f"{MOST_LINES} lines and {MOST_CELLS} cells at most"
        raise Refusal(f"it has {length} lines and {count} cells; {most}, for {MOST_BODIES} bodies")
    try:
        found = list(csv.reader(io.StringIO(text), delimiter=mark, strict=False))
    except csv.Error as error:
        raise Refusal(f"it is not a valid table: {error}") from None
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


def _with_rows(
    model: pg.Model, places: Sequence[str], under: str | None, rod: Rod | None
) -> pg.Model:
    """Add a body on a hinge for each new row, attached to the ground for now."""
    if not places:
        return model
    chain = pg.Model.serial(1)
    on = under if under in model.row else "ground"
    first = rod(model if model.bodies else chain, places[0], str(on)) if rod else None
    more = rod(chain, "more", "1") if rod else pg.Body(name="more")
    new = [first or more, *[more] * (len(places) - 1)]
    named = [b.unchecked_copy({"name": x, "parent": "ground"}) for b, x in zip(new, places)]
    return model.replace(bodies=(*model.bodies, *named))


def _centred(model: pg.Model, names: Sequence[str]) -> tuple[pg.Model, str]:
    """Move the centre of mass of bodies to the centre of their shapes or rods, with a notice."""
    ways: dict[str, list[str]] = {}
    changes: dict[str, dict[str, Any]] = {}
    for body in map(model.body, names):
        if "com" not in body.derived:
            way, com = _centre(model, body)
            ways.setdefault(way, []).append(f"'{body.name}'")
            changes[body.name] = {"com": com}
    found = "; ".join(f"{choices(those, 5)} {way}" for way, those in ways.items())
    text = f"Centres of mass that the lines do not give: {found}." if found else ""
    return model.edit_all(changes) if changes else model, text


def _centre(model: pg.Model, body: pg.Body) -> tuple[str, tuple[float, ...]]:
    """Return the default centre of mass of a body, as a description and in body axes [m].

    A body without shapes is a rod from its joint to its tip, or to the joint of all its children.
    """
    try:
        if body.shapes:
            com = mass_properties_of(body.shapes, 1.0).com
            return "in the middle of the shapes", tuple(map(float, com))
    except pg.PgraphError:  # a shape without a volume
        return "at the joint", pg.Body.model_fields["com"].default
    ends = {body.tip} if body.tip else {c.link for c in model.bodies if c.parent == body.name}
    if len(ends) == 1 and any(end := ends.pop()):
        return "in the middle of the rod", tuple(x / 2 for x in end)
    return "at the joint", pg.Body.model_fields["com"].default


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
    moving: pg.Body | None = None
    for field in sorted(line, key=lambda field: field not in OF_JOINT):
        text, unit = line[field]
        if not text or not field:
            continue
        if moving is None and field not in OF_JOINT:
            moving = _moving(body, line.get("name", ("", ""))[0], found)
        try:
            change = _typed(model, body, moving or body, field, text, unit)
        except Refusal as refusal:
            raise Refusal(f"line {number}, {field}: {refusal}") from None
        body = body.unchecked_copy({k: x for k, x in change.items() if k not in ("dof", "name")})
        found |= change
    if "motions" in found:
        found.pop("dof", None)
        found["joint"] = "compound"
    return found


def _moving(body: pg.Body, name: str, change: Mapping[str, Any]) -> pg.Body:
    """Return a body with the joint that a line gives it. Raises PgraphError."""
    fields = {field: change[field] for field in OF_JOINT if field in change}
    if "motions" in fields:
        fields = {"joint": "compound", "motions": fields["motions"]}
    return pg.Body(name=name or body.name, **fields) if fields else body


def _typed(
    model: pg.Model, body: pg.Body, moving: pg.Body, field: str, text: str, unit: str
) -> dict[str, Any]:
    """Return the fields that a cell changes. The units depend on the joint of `moving`."""
    match = VECTOR.fullmatch(field)
    if unit and not match and field not in NUMBERS:
        raise Refusal(f"takes no unit, got {cells.quoted(unit)}")
    if field == "constraint":
        return _read_only(model, text)
    if field in ("dof", "joint"):
        return _joint(body, text)
    if match:
        at = "xyz".index(match[2])
        old = body.tip_point if match[1] == "tip" else getattr(body, match[1])
        return {match[1]: cells.replaced(old, (at,), _number(moving, match[1], [at], text, unit))}
    if field in ("name", "parent"):
        return {field: cells.valid_name(text) if field == "name" else text}
    return {field: _value(moving, field, text, unit)}


def _number(body: pg.Body, field: str, at: Sequence[int], text: str, unit: str) -> float:
    """Return the SI value of a number, given in its own unit or the unit of its heading.

    The number is the entry `at` of its field, or all entries if several are given. Raises Refusal.
    """
    known = [_units(body, field, k) for k in at] or [{}]
    of: set[cells.Quantity] = {quantity_of(body, field, (k,)) for k in at}
    if unit in ("-", "1") and not any(known):
        unit = ""
    each = {name: x for name, x in known[0].items() if all(x == y.get(name) for y in known)}
    heading = next((name for name in each if _letters(name) == _letters(unit)), "")
    if unit and not heading:
        allowed = f"use {' or '.join(each)}" if each else "a unit is not allowed here"
        where = f" for number {at[0] + 1}" if len(at) == 1 and at[0] else ""
        raise Refusal(f"cannot be in {cells.quoted(unit)}{where}; {allowed}")
    if unit and _is_bare(text):
        text = f"{text} {each[heading]}"
    if len(of) > 1 and not _is_bare(text):
        raise Refusal(f"is for an angle and a length; write one for each, got {text!r}")
    single = of.pop() if len(of) == 1 else "number"
    return cells.quantity(text, single, cells.Display(), rate=field == "v")


def _is_bare(text: str) -> bool:
    """Return True for a number or a calculation without a unit."""
    return bool(cells.NUMBER.fullmatch(text) or cells.ARITHMETIC.fullmatch(text))


def _units(body: pg.Body, field: str, at: int) -> dict[str, str]:
    """Return the heading units of an entry of a field, and the unit to type after its number."""
    typed = {unit: unit for unit in cells.UNITS[quantity_of(body, field, (at,))]}
    if field == "v":
        turns = {"rpm": "rpm"} if "rad" in typed else {}
        return {f"{unit}/s": unit for unit in typed} | typed | turns
    if typed or field == "q":
        return typed
    names = shows(field).unit.split(", ")
    if len(names) > 1:  # separate units for rotation and translation
        motion = body.sequence[at : at + 1]
        names = list({names[x != "rad"] for m in motion for x in units_of(m)[1]})
    return {name: "" for name in names if name and len(names) == 1}


def _letters(unit: str) -> str:
    """Return a unit in one spelling: kgm2 for kg m², kg*m^2 and kg·m2."""
    return re.sub(r"[\s^*·]", "", unit).replace("²", "2").replace("³", "3")


def _value(body: pg.Body, field: str, text: str, unit: str) -> Any:
    """Parse the content of a cell: JSON, or numbers or words separated by blanks. Raises
    Refusal."""
    if text.lower() == NONE:
        return None
    if text[0] in '[{"' or text in ("true", "false"):
        try:
            value = json.loads(text)
        except ValueError:
            if field not in NUMBERS or not (match := re.fullmatch(r"\[([^\[\]]*)\]", text)):
                raise Refusal(f"cannot be read, got {cells.quoted(text)}") from None
            text = match[1].strip()  # [0 mm, 30 mm]
        else:
            return _read(body, field, value, unit) if field in NUMBERS else value
    words = [text] if field in ("mass", "density") else BETWEEN.split(text)
    if field == "derived":
        return tuple(words)
    if field == "axes" and all(AXIS.fullmatch(word) for word in words):
        return tuple(_unit_vector(word) for word in words)
    if field not in NUMBERS:
        numbers = [cells.number(word) for word in words]
        return numbers[0] if len(numbers) == 1 else tuple(numbers)
    single = len(words) == 1 and field in ("mass", "density", *PER_MOTION)
    numbers = _read(body, field, words[0] if single else words, unit)
    if field != "inertia":
        return numbers
    if len(numbers) == 9:
        return tuple(tuple(numbers[k : k + 3]) for k in (0, 3, 6))
    if len(numbers) != 3:
        raise Refusal(f"needs the 3 moments about x, y, z or all 9 numbers, got {len(numbers)}")
    return tuple(tuple(m if i == k else 0.0 for k in range(3)) for i, m in enumerate(numbers))


def _read(body: pg.Body, field: str, value: Any, unit: str) -> Any:
    """Convert nested numbers and strings to SI values. Raises Refusal."""
    motions = len(body.sequence)
    among: list[tuple[str, bool]] = []  # numbers whose unit can be typed: text, whether without

    def read(value: Any, at: Sequence[int]) -> Any:
        if isinstance(value, (list, tuple)):
            one_for_all = field == "limits" and not any(isinstance(x, (list, tuple)) for x in value)
            inner = [at if one_for_all or at is not every else [k] for k in range(len(value))]
            return tuple(read(x, k) for x, k in zip(value, inner))
        if isinstance(value, bool) or not isinstance(value, (int, float, str)):
            return value
        text = value if isinstance(value, str) else repr(value)
        if cells.UNITS[quantity_of(body, field, tuple(at[:1]))]:
            among.append((text, _is_bare(text)))
        return _number(body, field, at, text, unit)

    every = list(range(motions)) if field in ("limits", *PER_MOTION) else [0]
    found = read(value, every)
    bare = [text for text, without in among if without]
    if len(bare) < len(among) and any(map(cells.number, bare)):
        raise Refusal(f"has a unit behind some of its numbers only; {bare[0]} has none")
    return found


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
            raise Refusal(f"a compound joint of {dof} DoF is made in its properties, got '{text}'")
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
