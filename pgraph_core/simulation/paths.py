"""A number in a model's description by its path, which sweeps and batches vary."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel

from ..curves import Table
from ..dynamics.arguments import names_in
from ..errors import InputError, ModelError, Problem, nearest, nearest_name, shown
from ..fields import about, is_number
from ..forces import Driven, OnJoint
from ..joints import KINDS as JOINTS
from ..joints import home
from ..model import Body, Model

KINDS = {  # group of parts in a path -> the kind that `Model.edit` takes
    "bodies": "body",
    "beams": "beam",
    "constraints": "constraint",
    "contacts": "contact",
    "forces": "force",
    "scenarios": "scenario",
    "sites": "site",
    "outputs": "output",
    "controls": "control",
}
WORLD = ("gravity", "ground")  # fields of the model itself
AXES = ("x", "y", "z")
START = ("q", "v")  # fields of bodies: q.NAME is bodies.NAME.q


def distinct(paths: Sequence[Path], call: str) -> None:
    """Raise InputError if two paths refer to the same number."""
    for i, path in enumerate(paths):
        if any(path.leads_to(other) for other in paths[:i]):
            raise InputError(Problem(call, path.text, "is given twice"))


def counting(
    paths: Sequence[Path], model: Model, call: str, scenario: str | None, given: Mapping[str, Any]
) -> None:
    """Raise InputError for a path whose numbers something else of the call replaces."""
    for path in paths:
        if instead := path.replaced_by(model, scenario, given):
            text = f"its values have no effect: {instead}"
            text += "" if "give scenario" in instead else " replaces it; leave one out"
            raise InputError(Problem(call, path.text, text))


def with_numbers(model: Model, paths: Sequence[Path], values: Sequence[float]) -> Model:
    """Return the model with new values at the paths, by one `Model.edit` per part.

    All numbers of a part change together, as an inertia or a pair of limits must. The segments of
    beams stay as many. Raises ModelError.
    """
    expanded, model = model, model.described
    parts = dict[tuple[str, str], dict[str, Any]]()
    for path, value in zip(paths, values, strict=True):
        fields = parts.setdefault((path.group, "" if path.group in WORLD else path.name), {})
        if not path.group:
            fields[path.name] = value
            continue
        field, *rest = map(str, path.inside)
        present = fields[field] if field in fields else _field(path.owner(model), field)
        fields[field] = _replaced(present, rest, value)
    for (group, name), fields in parts.items():
        if not group:
            model = model.replace(parameters={**model.parameters, **fields})
        elif group in WORLD:
            model = model.replace(**fields)
        else:
            model = model.edit(name, kind=KINDS[group], **fields)
    return model.with_segments(expanded.segments) if expanded.segments else model


def edited(model: Model, path: Any, number: tuple[Any, ...], fields: Mapping[str, Any]) -> Model:
    """Return the model with a new number at a path, or with those of {path: number}.

    Raises InputError for other values and paths, and ModelError.
    """
    given = path if isinstance(path, Mapping) else {path: number[0] if number else None}
    if fields or len(number) > (0 if given is path else 1):
        text = "takes (name, **changes), as edit('NAME', mass=2.0), or numbers at paths, "
        text += "edit('bodies.NAME.mass', 2.0) or edit({PATH: 2.0})"
        raise InputError(Problem("Model.edit", "", text))
    paths = [Path(model, each, "edit") for each in given]
    distinct(paths, "edit")
    values = list[float]()
    for one, value in zip(paths, given.values(), strict=True):
        if not is_number(value):
            part, field = (one.name, one.inside[0]) if one.group in KINDS else ("NAME", "field")
            text = f"must be a number, got {shown(value)}; other values are given by the name of "
            text += f"their field: edit({part!r}, {field}=...)"
            raise InputError(Problem("edit", one.text, text))
        values.append(float(value))
    return with_numbers(model, paths, values)


class Path:
    """A number in a model's description: `bodies.shin.mass`, `bodies.shin.link.0`, `q.shin`,
    `gravity.1`, `ground.friction`, `scenarios.trot.gait.gains.height.0`, a parameter.

    The path is a string, or a tuple if a name contains dots. Raises InputError, with the name of
    `call`, if the model has no such number.
    """

    def __init__(self, model: Model, given: str | Sequence[Any], call: str = "sweep"):
        holder, word, value = self._find(model, given, call)
        if _listed(value) and len(value) == 1 and not _listed(value[0]):
            self.inside, value = (*self.inside, 0), value[0]  # a list of one number
        if value is None and _takes_number(holder, word):
            value = math.nan  # left out, so that the model works it out: a number replaces it
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            kind = f"is {shown(value)}, not one number"
            kind = "has no value: give it one in the model first" if value is None else kind
            to = _to_number(value)
            hint = f"; name one of its numbers, as in {'.'.join([self.text, *to])}" if to else ""
            raise self._refused(f"{kind}{hint}")
        self.present = float(value)

    def _find(self, model: Model, given: Any, call: str) -> tuple[Any, str | int, Any]:
        """Return the value of a path, together with its parent object and its name."""
        words = given if isinstance(given, (tuple, list)) else [given]
        self.text, self._call = ".".join(map(str, words)), call
        self.given = given
        self.group, self.name, self.inside = self._split(model.described, given)
        if self.group == "bodies" and self.inside[0] == "shape" and len(self.inside) > 1:
            self.inside = "shapes", 0, *self.inside[1:]  # the first: others of the body stay
        word, holder = "", None
        value = self.owner(model)
        for word in self.inside:
            holder, value = value, self._entry(value, word)
        return holder, word, value

    @classmethod
    def each(cls, model: Model, given: Any, call: str) -> list[Path]:
        """Return the paths of all numbers at a path: one number, a list, or a table over time."""
        whole = cls.__new__(cls)
        _, _, value = whole._find(model, given, call)
        table = isinstance(value, Table)
        numbers = value.value if table else value
        if not table and (not _listed(value) or len(value) < 2 or any(map(_listed, value))):
            return [cls(model, given, call)]
        inside = (*whole.inside, *("value",) * table)
        first = (whole.group, whole.name) if whole.group in KINDS else ()
        return [cls(model, (*first, *inside, i), call) for i in range(len(numbers))]

    def leads_to(self, other: Path) -> bool:
        """True if another path refers to the same number."""
        mine = (self.group, self.name, self.inside)
        return mine == (other.group, other.name, other.inside)

    def set(self, model: Model, value: float) -> Model:
        """The model with another number there."""
        return with_numbers(model, [self], [value])

    def replaced_by(self, model: Model, scenario: str | None, given: Mapping[str, Any]) -> str:
        """Return the argument of a call that overrides this number, or "".

        `given` are the other arguments of the call, None if not given.
        """
        field, *rest = (str(word) for word in self.inside)
        given = {name: value for name, value in given.items() if value is not None}
        body = self.name if self.group == "bodies" else ""
        if self.group == "scenarios":
            if self.name != scenario:
                return f"the run is not of that scenario; give scenario={self.name!r}"
            if field in given and field not in ("q", "v", "forces"):
                return f"{field}={shown(given[field])} of the call"
            if field == "gait" and "tau" in given:
                return "tau of the call"
            body = rest[0] if field in ("q", "v") and rest else ""
        if body and field in ("q", "v"):
            if field in given and (names_in(given[field]) is None or body in given[field]):
                return f"{field}= of the call"
            own = model.scenario(scenario) if scenario and self.group == "bodies" else None
            if own is not None and body in getattr(own, field):
                return f"{field} of '{body}' in scenario '{scenario}'"
        inputs = given.get("inputs")
        if self.group == "forces" and isinstance(inputs, Mapping) and self.name in inputs:
            force = model.part(self.name, "force")
            if isinstance(force, Driven) and field == force.INPUT:
                return f"inputs[{self.name!r}] of the call"
        return ""

    def owner(self, model: Model) -> Any:
        """Return the object whose field is the first word inside."""
        if not self.group:
            return model.parameters
        model = model.described
        return model if self.group in WORLD else model.part(self.name, KINDS[self.group])

    def unit(self, model: Model) -> str:
        """Return the SI unit of the number, or "" if it has none or is of several motions."""
        if self.group == "gravity":
            return "m/s²"
        if self.group in ("", "ground", "scenarios"):
            return ""
        part, field = self.owner(model), str(self.inside[0])
        unit = about(type(part).model_fields[field], field).unit
        turning, either, sliding = unit.partition(", ")
        if not either:
            return {"length": "m", "angle": "rad"}.get(unit, unit)
        motions = (part if isinstance(part, Body) else model.body(part.body)).sequence
        rates = [rate for motion in motions for rate in JOINTS[motion.kind].v]
        if isinstance(part, OnJoint) and not part.coefficients:
            rates = rates[part.coordinate : part.coordinate + 1]
        slides = {rate == "m" for rate in rates}
        return (sliding if slides.pop() else turning) if len(slides) == 1 else ""

    def _entry(self, value: Any, word: str | int) -> Any:
        """A field of a part, or an entry of a list."""
        if isinstance(value, Mapping):
            if str(word) not in value:
                do = (
                    nearest_name(str(word), [*value]) if value else "give it one in the model first"
                )
                raise self._refused(f"has no {str(word)!r}; {do}")
            return value[str(word)]
        if isinstance(value, BaseModel):
            fields = [x for x in type(value).model_fields if x != "name"]
            if word not in fields:
                what = f"{KINDS[self.group]} {self.name!r}" if self.group in KINDS else self.group
                raise self._refused(f"{what} has no field {word!r}; {nearest(str(word), fields)}")
            return _field(value, str(word))
        if not isinstance(word, int):
            text = f"after the field, give the number of an entry, got {word!r}"
            if word in AXES and _listed(value) and len(value) == len(AXES):
                text += f"; the numbers of x, y and z are 0, 1 and 2: here {AXES.index(word)}"
            raise self._refused(text)
        if not _listed(value) or not 0 <= word < len(value):
            do = f"; the value there is {shown(value)}"
            do = ": give it a value in the model first" if value in (None, ()) else do
            raise self._refused(f"has no number {word}{do}")
        return value[word]

    def _split(self, model: Model, given: Any) -> tuple[str, str, tuple[str | int, ...]]:
        """Return (group, name, words inside). A parameter has no group, the world no name."""
        if isinstance(given, str):
            if given in model.parameters:
                return "", given, (given,)
            groups = [g for g in KINDS for p in getattr(model, g) if given.startswith(f"{p.name}.")]
            if given.split(".")[0] not in (*KINDS, *WORLD) and len(set(groups)) == 1:
                given = f"{groups[0]}.{given}"  # the name of a part says of which group it is
            group, _, rest = given.partition(".")
            held = "bodies" if group in START else group
            names = [p.name for p in getattr(model, held)] if held in KINDS else []
            name = max((n for n in names if f"{rest}.".startswith(f"{n}.")), key=len, default=None)
            name = rest.split(".")[0] if name is None else name
            fields = rest[len(name) + 1 :]
            words: list[Any] = [group, name, *(fields.split(".") if fields else [])]
            words = given.split(".") if group in WORLD else words
        else:
            words = list(given) if isinstance(given, (tuple, list)) else [given]
        if words and words[0] in START:
            joints = [body.name for body in model.bodies if body.dof]
            if (name := [*words, ""][1]) not in joints:
                raise self._refused(no_joint(words[0], name, joints))
            words = ["bodies", name, words[0], *words[2:]]
        inside = tuple(int(w) if str(w).isdecimal() else w for w in words[1:])
        if words and words[0] in WORLD:
            return words[0], "", (words[0], *inside)
        if not words or words[0] not in KINDS:
            known = [
                *model.parameters,
                *(f"{group}.NAME.FIELD" for group in KINDS),
                "q.NAME",
                "v.NAME",
            ]
            hint = nearest(self.text, [*known, *(f"gravity.{i}" for i in range(3)), "ground.FIELD"])
            raise self._refused(f"is not a path in the model; {hint}")
        if len(words) < 3:
            parts = getattr(model, words[0])
            parts = [p for p in parts if p.name == words[-1]] or parts
            to = [".".join([words[0], p.name, *to]) for p in parts if (to := _to_number(p))]
            as_in = to[0] if to else f"{words[0]}.NAME.FIELD"
            raise self._refused(f"must name a part and its field, as in {as_in}")
        try:
            model.part(words[1], KINDS[words[0]])
        except ModelError as error:
            raise self._refused(error.problems[0].text) from None
        return words[0], words[1], inside[1:]

    def _refused(self, text: str) -> InputError:
        return InputError(Problem(self._call, self.text, text))


def started(model: Model, given: Any, scenario: str | None) -> Any:
    """Return the path of q.NAME or v.NAME in a run of a scenario, which may give that start."""
    group, _, name = given.partition(".") if isinstance(given, str) else ("", "", "")
    if group not in START or given in model.parameters or scenario is None:
        return given
    body, _, entry = name.rpartition(".")
    rest = [entry] if body and entry.isdecimal() and body in model else []
    body = body if rest else name
    own = model.scenario(scenario)
    return ("scenarios", scenario, group, body, *rest) if body in getattr(own, group) else given


def no_joint(start: str, name: str, joints: Iterable[str]) -> str:
    """Return a sentence about a path q.NAME or v.NAME whose name is of no body that moves."""
    known = [*joints]
    if not name:
        return (
            f"must name a body with a moving joint, as in {start}.{known[0] if known else 'NAME'}"
        )
    return f"no body with a moving joint is named {name!r}; {nearest_name(name, known)}"


def _field(part: Any, field: str) -> Any:
    """Return the value of a field. A start that a body leaves out is the home of its joint."""
    value = getattr(part, field)
    if isinstance(part, Body) and field in START and not value:
        return home(part.sequence) if field == "q" else (0.0,) * part.dof
    return value


def _to_number(value: Any) -> list[str]:
    """Return the words of a path from a value to its first number, or [] if it holds none.

    Numbers of the value itself come before those of its parts.
    """
    held: list[tuple[Any, Any]] = []
    if isinstance(value, BaseModel):
        held = [(name, getattr(value, name)) for name in type(value).model_fields]
    elif isinstance(value, Mapping):
        held = [*value.items()]
    elif _listed(value):
        held = [*enumerate(value)]
    own = [str(word) for word, x in held if isinstance(x, (int, float)) and not isinstance(x, bool)]
    if own:
        return own[:1]
    inside = ([str(word), *to] for word, x in held if (to := _to_number(x)))
    return next(inside, [])


def _takes_number(part: Any, field: str | int) -> bool:
    """True if a field of a part may be one number."""
    known = type(part).model_fields if isinstance(part, BaseModel) else {}
    return str(field) in known and _is_number(known[str(field)].annotation)


def _is_number(kind: Any) -> bool:
    inside = get_args(kind) if get_origin(kind) in (Annotated, Union, UnionType) else ()
    return kind is float or any(map(_is_number, inside))


def _listed(value: Any) -> bool:
    return isinstance(value, (tuple, list))


def _replaced(old: Any, inside: Sequence[str | int], value: float) -> Any:
    """A field's value with another number in it."""
    if not inside:
        return value
    word, *rest = inside
    if isinstance(old, BaseModel):
        new = _replaced(getattr(old, str(word)), rest, value)
        return old.model_copy(update={str(word): new})
    if isinstance(old, Mapping):
        return {**old, word: _replaced(old[word], rest, value)}
    at = int(word)
    return (*old[:at], _replaced(old[at], rest, value), *old[at + 1 :])
