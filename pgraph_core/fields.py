"""Field types for descriptions, and the base class of their parts.

`field(...)` declares a field. The description is used in error messages, after "must be ...".
Label, unit and help are displayed in forms. The converter defines which types are accepted, such as
lists, NumPy arrays and dictionaries, and is also understood by type checkers.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from numbers import Integral, Real
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    NamedTuple,
    NoReturn,
    Self,
    TypeGuard,
    TypeVar,
    dataclass_transform,
    overload,
)

import numpy as np
import numpy.typing as npt
from pydantic import (
    AfterValidator,
    AllowInfNan,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    Strict,
    ValidationError,
    WrapValidator,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, PydanticUndefined, core_schema

from . import hooks, words
from .errors import ModelError, Problem, explained, is_deep, nearest, nearest_first, shown
from .portable import Portable
from .sentences import GROUND, PAIR, all_problems, in_our_words
from .signals import Unreadable, is_expression, parsed
from .units import NONE, UNITS, Dim, M, S

Given = TypeVar("Given")
Held = TypeVar("Held")
EVERY = "*"  # every body that has a shape, in a contact


# -- declaring fields ------------------------------------------------------------------------------


class About(NamedTuple):
    """The description of a field for use in forms."""

    label: str
    unit: str = ""  # "length" and "angle" follow the page's units
    help: str = ""


Role = Literal[
    "",
    "point",
    "direction",
    "vector",
    "axial",
    "frame",
    "tensor",
    "screw",
    "joint",
    "track",
    "parts",
]


class Facts(NamedTuple):
    """The dimension, role, first schema version and help text of a field.

    The role determines how the value changes under reflection. A `point`, `direction` or `vector`
    is reflected. An `axial` vector is reflected with the opposite sign. A `frame` is a quaternion,
    a `tensor` has 3 by 3 numbers, a `screw` 6 by 6. A `joint` depends on the motions of a joint. A
    `track` is a curve.
    `parts` have their own fields. Everything else stays. A file that gives the field a value other
    than its default needs the schema version `since`.
    """

    dim: Dim | None  # None: not a number
    over: Dim  # dimension of the first column of a table
    role: Role
    since: int
    help: str


@overload
def field(
    description: str, *, converter: Callable[[Given], Held], default: Any = ...,
    label: str = ..., dim: Dim = ..., over: Dim = ..., role: Role = ..., since: int = ...,
    help: str = ...,
    gt: float = ..., ge: float = ..., lt: float = ..., le: float = ...,
) -> Held: ...  # fmt: skip
@overload
def field(
    description: str, *, default: Any = ...,
    label: str = ..., dim: Dim = ..., over: Dim = ..., role: Role = ..., since: int = ...,
    help: str = ...,
    gt: float = ..., ge: float = ..., lt: float = ..., le: float = ...,
) -> Any: ...  # fmt: skip
def field(
    description: str,
    *,
    converter: Callable[[Any], Any] | None = None,
    default: Any = PydanticUndefined,
    label: str = "",
    dim: Dim | None = None,
    over: Dim = S,
    role: Role = "",
    since: int = 1,
    help: str = "",
    **bounds: Any,
) -> Any:
    """Declare a field. `converter` gives type checkers the accepted and the stored type."""
    found = Field(default, description=description, title=label or None, **bounds)
    found.metadata.append(Facts(dim, over, role, since, help))
    return found


def facts(info: FieldInfo) -> Facts:
    """Return the facts about a field, or empty ones if it was not declared with `field`."""
    return next((x for x in info.metadata if isinstance(x, Facts)), Facts(None, S, "", 1, ""))


def dim_of(part: Frozen, name: str) -> Dim:
    """Return the dimension of the numbers in a field of a part."""
    if isinstance(part, Described):
        return part._dim_of(name)
    return facts(type(part).model_fields[name]).dim or NONE


def about(info: FieldInfo, name: str) -> About:
    """Return the label, unit and help text shown for a field in forms."""
    own = facts(info)
    label = info.title or name.replace("_", " ").capitalize()
    return About(label, UNITS.get(own.dim or NONE, ""), own.help)


PLAIN = frozenset((float, int, str))  # most of what a description holds
MOST_NUMBERS = 10_000_000  # maximum per field; as Python objects they take a gigabyte


def listed(value: Any) -> Any:
    """Convert lists and arrays to tuples and NumPy scalars to numbers. Keep all else."""
    kind = type(value)
    if kind in PLAIN:
        return value
    if kind is list or kind is tuple:
        if PLAIN.issuperset(map(type, value)):
            return tuple(value)
    elif isinstance(value, Portable):  # a part, which is no array
        return value
    elif hasattr(value, "tolist"):
        if getattr(value, "size", 0) > MOST_NUMBERS:
            raise ValueError(f"a field has at most {MOST_NUMBERS} numbers")
        dated = getattr(getattr(value, "dtype", None), "kind", "") in ("m", "M")
        value = str(value) if dated else value.tolist()  # a list of them has nanoseconds
    if not isinstance(value, (list, tuple)):
        return value
    return tuple([x if type(x) in PLAIN else listed(x) for x in value])


def _ordered(value: Any) -> Any:
    """The same as `listed`, but reject sets, which have no order."""
    kind = type(value)
    if (kind is list or kind is tuple) and PLAIN.issuperset(map(type, value)):
        return tuple(value)
    if isinstance(value, (set, frozenset)):
        raise ValueError("sets have no order; give a list")
    return listed(value)


def _rows(value: Any) -> Any:
    """Return a list of vectors. The brackets around a single vector may be left out."""
    value = _ordered(value)
    single = isinstance(value, tuple) and len(value) == 3 and PLAIN.issuperset(map(type, value))
    return (value,) if single else value


def _inertia(value: Any) -> Any:
    """Return an inertia matrix. Three numbers are its diagonal, and 0 is that of a point mass."""
    value = _ordered(value)
    if isinstance(value, (int, float)) and not isinstance(value, bool) and value == 0:
        value = (0.0, 0.0, 0.0)
    if (
        isinstance(value, tuple)
        and len(value) == 3
        and not any(isinstance(x, tuple) for x in value)
    ):
        a, b, c = value
        return ((a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, c))
    return value


def _per_motion(value: Any) -> Any:
    value = _ordered(value)
    return (value,) if isinstance(value, (int, float)) else value


def _readable(text: str) -> str:
    """Return an expression, '=...', with whitespace stripped. Reject one that cannot be parsed."""
    if not is_expression(text):
        raise ValueError("an expression begins with '='")
    text = _storable(text).strip()
    try:
        parsed(text)
    except Unreadable as error:
        refuse([("", f"{shown(text)} is not a valid expression: {error}")])
    return text


def _storable(text: str) -> str:
    """Reject text with lone surrogates, which stand for bytes that are not UTF-8.

    No file or page can hold them. They come from names of files and from escapes in JSON.
    """
    try:
        text.encode()
    except UnicodeEncodeError:
        refuse([("", f"must be text that UTF-8 can hold, got {shown(text)}; rename it")])
    return text


# Strict and finite are annotations of float, so that compiled code checks them.
Finite = Annotated[float, Strict(), AllowInfNan(False)]
Row3 = tuple[Finite, Finite, Finite]
Number = Annotated[Finite, BeforeValidator(listed)]
NotNegative = Annotated[Number, Field(ge=0)]
Vec3 = Annotated[Row3, BeforeValidator(_ordered)]
Quat = Annotated[tuple[Finite, Finite, Finite, Finite], BeforeValidator(_ordered)]
Mat3 = Annotated[tuple[Row3, Row3, Row3], BeforeValidator(_inertia)]
Numbers = Annotated[tuple[Finite, ...], BeforeValidator(_ordered)]
Vec3s = Annotated[tuple[Row3, ...], BeforeValidator(_rows)]
Whole = Annotated[int, Strict(), BeforeValidator(listed)]
Text = Annotated[str, Strict(), AfterValidator(_storable)]
Flag = Annotated[bool, Strict(), BeforeValidator(listed)]
PerMotion = Annotated[tuple[Finite, ...], BeforeValidator(_per_motion)]  # or one number for all
Expression = Annotated[str, Strict(), AfterValidator(_readable)]  # '=...' of time and of the motion
Entry = Finite | Expression
Entries3 = Annotated[tuple[Entry, Entry, Entry], BeforeValidator(_ordered)]

# Converters of `field`, which only type checkers read: what may be given, and the type held.

vector: Callable[[npt.ArrayLike], Vec3] = listed
maybe_vector: Callable[[npt.ArrayLike | None], Vec3 | None] = listed
vectors: Callable[[npt.ArrayLike | Sequence[npt.ArrayLike]], Vec3s] = listed
quaternion: Callable[[npt.ArrayLike], Quat] = listed
inertia_matrix: Callable[[npt.ArrayLike], Mat3] = _inertia
per_motion: Callable[[npt.ArrayLike], PerMotion] = _per_motion
several: Callable[[npt.ArrayLike], Numbers] = listed
names_or_none: Callable[[Sequence[str] | None], tuple[str, ...] | None] = listed


def parts_of(kind: type[Held]) -> Callable[[Iterable[Held | Mapping[str, Any]]], tuple[Held, ...]]:
    """Accept a list of parts of one kind, given as objects or dictionaries of fields."""
    return listed


def part_of(kind: type[Held]) -> Callable[[Held | Mapping[str, Any]], Held]:
    """Accept a part of a kind, as an object or as its fields."""
    return listed


def maybe_part_of(kind: type[Held]) -> Callable[[Held | Mapping[str, Any] | None], Held | None]:
    """Accept a part of a kind, as an object or as its fields, or None."""
    return listed


class Fixed(dict[str, Any]):
    """An immutable dictionary in a part. Changing it raises ModelError."""

    def _refused(self, *args: Any, **named: Any) -> NoReturn:
        text = "cannot be changed in place; make a new model: "
        text += "model = model.edit(name of the part, field={**old, 'key': value})"
        raise ModelError(Problem("a dictionary of a model", shown(args[0]) if args else "", text))

    __setitem__ = __delitem__ = __ior__ = _refused  # pyright: ignore[reportAssignmentType]
    clear = pop = popitem = setdefault = update = _refused  # pyright: ignore[reportAssignmentType]

    def __reduce__(self) -> Any:
        return Fixed, (dict(self),)

    def __deepcopy__(self, memo: Any) -> Self:
        return self  # tuples of numbers serve as they are


def fixed(value: dict[str, Any]) -> dict[str, Any]:
    """Create an immutable dictionary with the same entries."""
    return Fixed(value)


ByName = Annotated[dict[str, PerMotion], AfterValidator(fixed)]
EMPTY = Fixed()


by_name: Callable[[Mapping[str, npt.ArrayLike]], ByName] = listed


def name_problem(name: str) -> str:
    """Return the problem with a part's name, which must be visible in tables and files, or ""."""
    if not name.strip():
        return f"must be non-empty text, got {shown(name)}"
    if name != name.strip():
        return f"must not start or end with a space, got {shown(name)}"
    if not name.isprintable():
        return f"must be text on one line, without control characters, got {shown(name)}"
    return ""


# -- bases of parts --------------------------------------------------------------------------------


if TYPE_CHECKING:  # a type checker reads the parameters of a part from its converters

    @dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field, Field))
    class _Base(Portable):
        model_fields: ClassVar[dict[str, FieldInfo]]
        model_fields_set: set[str]
        model_config: ClassVar[ConfigDict]

        def model_copy(
            self, *, update: Mapping[str, Any] | None = None, deep: bool = False
        ) -> Self: ...
        def model_dump(self, **how: Any) -> dict[str, Any]: ...
        def model_dump_json(self, **how: Any) -> str: ...
        @classmethod
        def model_validate(cls, data: Any) -> Self: ...
        def __copy__(self) -> Self: ...
        @classmethod
        def model_construct(cls, _fields_set: set[str] | None = None, **values: Any) -> Self: ...
        @classmethod
        def __pydantic_init_subclass__(cls, **kwargs: Any) -> None: ...

else:

    class _Sentences(type(BaseModel)):
        """A metaclass that converts pydantic validation errors in constructor calls to ModelError.

        Not in `__init__`: pydantic would call that for values inside others, too, and their place
        in the whole would be lost.
        """

        def __call__(cls, *args, **data):
            if args:
                first = next((x for x in FIRST if x in cls.model_fields and x not in data), "")
                taken = {*data, *(words.ours(x, cls.model_fields) for x in data)}
                body = cls.model_fields.get("body")
                alone = len(args) == 1 and "body" not in taken
                if body and body.is_required() and alone:
                    first = "body" if first == "name" else first  # one word is the body
                places = [first, *(x for x in BODIES if x in cls.model_fields)]
                words_only = all(isinstance(x, str) for x in args) and not data.keys() & places
                if words_only and len(args) == len(places) > 1:  # a name and all bodies
                    return cls(**dict(zip(places, args)), **data)
                ends = [getattr(x, "name", x) for x in args]
                both = len(ends) == 2 and places[1:] == [*PAIR] and not data.keys() & {*places}
                if both and all(isinstance(x, str) for x in ends):
                    return cls(**dict(zip(PAIR, ends)), **data)
                if len(args) > 1 or not first:
                    own = ", ".join(x for x in cls.model_fields if x != first)
                    text = f"takes {first or 'no field'} first, then fields by name; fields: {own}"
                    raise ModelError(Problem(f"pg.{cls.__name__}", "", text))
                data = {first: args[0], **data}
            try:
                return super().__call__(**data)
            except RecursionError:
                deep = [name for name, value in data.items() if is_deep(value)]
                if not deep:
                    raise
                text = "is nested too deeply, or holds itself"
                raise ModelError(Problem(cls.__name__.lower(), deep[0], text)) from None
            except ValidationError as error:
                if ours := in_our_words(cls, data):
                    return cls(**ours)
                where = cls.__name__.lower()
                moot = getattr(cls, "FOLLOWERS", {})
                raise ModelError(all_problems(cls, data, error, where, moot)) from None

        def __getattr__(cls, name):
            """Raise NoAttribute for a name that the class does not have."""
            try:
                return super().__getattr__(name)
            except AttributeError:
                if name[0] != "_" and (found := hooks.bound(cls, name)) is not None:
                    return found
                raise words.NoAttribute(f"pg.{cls.__name__}", name, lambda: dir(cls)) from None

        def __dir__(cls):
            """Return the fields and the names defined by our own classes."""
            ours = [vars(c) for c in cls.__mro__ if not c.__module__.startswith(FOREIGN)]
            named = {name for each in ours for name in each if not name.startswith(("_", "model_"))}
            return sorted({name for name in named if not name.isupper()} | cls.model_fields.keys())

    FOREIGN = ("pydantic", "builtins", "abc")
    FIRST = ("bodies", "name", "kind", "body")  # the field that may be given without its name
    BODIES = ("parent", *PAIR)  # those that may be, if all are given

    class _Base(Portable, BaseModel, metaclass=_Sentences):
        pass


class Frozen(_Base):
    """The base class of all descriptions: immutable, and rejecting unknown fields by name."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    def __setattr__(self, name: str, value: Any) -> None:
        """Reject assignment: parts are immutable and edits create new ones. Raises ModelError."""
        own = getattr(self, "name", None)
        where = type(self).__name__.lower() + (f" {shown(own)}" if own else "")
        if name not in type(self).model_fields:
            text = f"no such field; {nearest(name, type(self).model_fields)}"
            raise ModelError(Problem(where, name, text))
        text = "cannot be changed in place; make a new model: model = "
        if own is None:
            text += f"model.edit(...), with a {type(self).__name__} that has another {name}"
        elif "bodies" in type(self).model_fields:
            text += f"model.replace({name}={shown(value)})"
        else:
            text += f"model.edit({shown(own)}, {name}={shown(value)})"
        raise ModelError(Problem(where, name, text))

    @explained
    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a validated copy with modified fields. Raises ModelError."""
        if not update:
            return super().model_copy(deep=deep)
        known = type(self).model_fields
        if name := next((name for name in update if name not in known), None):
            where = f"{type(self).__name__}.model_copy"
            raise ModelError(Problem(where, shown(name), f"no such field; {nearest(name, known)}"))
        return type(self)(**{**self._kept(update), **update})

    def _kept(self, update: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fields retained by a validated copy."""
        return fields_of(self)

    def copy(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, *, update: Mapping[str, Any] | None = None, deep: bool = False
    ) -> Self:
        """Call `model_copy`, which validates the copy."""
        return self.model_copy(update=update, deep=deep)

    @classmethod
    def model_construct(cls, _fields_set: set[str] | None = None, **values: Any) -> Self:
        """Return a validated instance, like calling the class."""
        return cls(**values)

    def unchecked_copy(self, update: Mapping[str, Any]) -> Self:
        """Return a copy with modified fields, without validation."""
        return super().model_copy(update=update)

    def __copy__(self) -> Self:
        """Copy the fields but not the cached values, which may not fit the copy."""
        copy = super().__copy__()
        for name in vars(copy).keys() - type(self).model_fields.keys():
            object.__delattr__(copy, name)
        return copy

    def __eq__(self, other: object) -> bool:
        """Compare the fields, ignoring cached values."""
        if not isinstance(other, Frozen) or type(self) is not type(other):
            return NotImplemented
        mine, others = vars(self), vars(other)
        return all(mine[name] == others[name] for name in type(self).model_fields)

    def __hash__(self) -> int:
        mine = vars(self)
        return hash((type(self), *(_hashed(mine[name]) for name in type(self).model_fields)))

    def __delattr__(self, name: str) -> None:
        """Refuse. Raises ModelError."""
        text = "cannot be deleted; use `edit` to change it"
        raise ModelError(Problem(type(self).__name__.lower(), name, text))

    def __dir__(self) -> list[str]:
        """Return fields and methods defined by our own classes, for completion."""
        return dir(type(self))

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Give the class a readable signature, with its annotations as written."""
        super().__pydantic_init_subclass__(**kwargs)
        written: dict[str, str] = {}
        for base in cls.__mro__[::-1]:
            written |= vars(base).get("__annotations__", {})
        parameters = [
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if info.is_required() else info.get_default(),
                annotation=_Written(written.get(name, "")),
            )
            for name, info in cls.model_fields.items()
        ]
        cls.__signature__ = inspect.Signature(parameters)
        lines = (f"    {name}: {info.description}" for name, info in cls.model_fields.items())
        own = inspect.cleandoc(vars(cls).get("__doc__") or "")
        cls.__doc__ = "\n".join((own, "", "Fields:", *lines))


def _hashed(value: Any) -> Any:
    """Return a hashable substitute for a value."""
    if isinstance(value, dict):
        return frozenset((key, _hashed(x)) for key, x in value.items())
    return tuple(map(_hashed, value)) if isinstance(value, tuple) else value


class _Written(str):
    """An annotation displayed exactly as written, without quotes."""

    def __repr__(self) -> str:
        return str(self)


def refuse(problems: Sequence[tuple[str, str]]) -> None:
    """Report all problems found by a validator, as (field, text) pairs."""
    if problems:
        raise PydanticCustomError("problems", "refused", {"problems": list(problems)})


def refuse_no_direction(**axes: Vec3 | None) -> None:
    """Reject directions that are too short to normalise, by field name."""
    refuse([
        (name, f"a direction must not be zero, got {shown(axis)}")
        for name, axis in axes.items()
        if axis is not None and not 1e-9 < math.hypot(*axis) < 1e9
    ])  # fmt: skip


def _validated_once(value: Any, validate: Callable[[Any], Any]) -> Any:
    """Accept a validated part unchanged, but validate a copy with modified fields."""
    if type(value) is dict or not isinstance(value, Frozen) or "checked" not in vars(value):
        value = validate(value)
        value.__dict__["checked"] = True  # not a field: `__copy__` leaves it out
    return value


Once = WrapValidator(_validated_once)  # validator of a part inside another


class Described(Frozen):
    """A named part that reports all its problems as readable messages."""

    WORD: ClassVar[str] = ""  # its word in sentences, "" for the class's name
    # field -> fields that mean nothing without it: not reported if it is refused itself
    FOLLOWERS: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    if not TYPE_CHECKING:

        def __init__(self, /, **data: Any):
            """Validate the fields. Raises ModelError."""
            try:
                super().__init__(**data)
            except ValidationError as error:
                kind = type(self)
                if ours := in_our_words(kind, data):
                    self.__init__(**ours)
                    return
                where = f"{kind.word()} {shown(data['name'])}" if "name" in data else kind.word()
                if "name" not in data:
                    where += f" pg.{kind.__name__}(...)"
                found = all_problems(kind, data, error, where, kind._followers())
                raise ModelError(found) from None

    def _dim_of(self, name: str) -> Dim:
        """Return the dimension of the numbers in a field."""
        return facts(type(self).model_fields[name]).dim or NONE

    @classmethod
    def word(cls) -> str:
        """Return the word used in messages for a part of this class."""
        return cls.WORD or cls.__name__.lower()

    @classmethod
    def _followers(cls) -> Mapping[str, tuple[str, ...]]:
        """Return the fields that are not reported if another field is rejected."""
        return cls.FOLLOWERS


class Acting(Described):
    """A part acting on `body` and, if given, on `other`."""

    PLACES: ClassVar[tuple[str, ...]] = ()  # fields that hold points of further bodies

    def _exchanged(self, start: Any, home: Any) -> dict[str, Any]:
        """Return the fields of the same part with `other` for the ground as `body`, or {}.

        `start` is the pose of `other` in the initial state, and `home` its rotation at q = 0.
        """
        return {}

    @property
    def pair(self) -> tuple[str, str]:
        """Return the names of `body` and `other`, with "ground" for a kind without `other`."""
        own = type(self).model_fields
        body, other = (getattr(self, name) if name in own else GROUND for name in PAIR)
        return body, other

    @property
    def touches(self) -> tuple[str, ...]:
        """Return the names of the bodies on which the part acts, excluding the ground."""
        names = (*self.pair, *(place.body for place in self._places))
        return tuple(name for name in dict.fromkeys(names) if name != GROUND)

    @property
    def _links(self) -> tuple[tuple[str, str], ...]:
        """Return the pairs of bodies that it joins, once each, with a moving body first."""
        return (self.pair,)

    @property
    def _places(self) -> tuple[Any, ...]:
        """Return its points of further bodies, in order."""
        return tuple(place for name in self.PLACES for place in getattr(self, name))

    @property
    def _fits_one_body(self) -> bool:
        """Return True if both its ends may be on one body."""
        return bool(self._places)


class OfKinds(Acting):
    """A part with one class per kind, selected by its field `kind`.

    They can also be created through the base class. For example, `Force(kind="spring", ...)`
    returns a `Spring`.
    """

    KINDS: ClassVar[dict[str, type[OfKinds]]] = {}  # kinds of each class that names a part
    # field -> its value in files if it has no meaning: older ones give it to every kind
    NOTHING: ClassVar[Mapping[str, Any]] = {}
    ABOUT: ClassVar[str] = ""  # one line about the kind, for a list to choose from
    SINCE: ClassVar[int] = 1  # first schema version that has the kind
    NEW: ClassVar[Mapping[str, Any]] = {}  # fields of a new part that are always the same

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        if kind := cls.own_kind():
            cls.KINDS[kind] = cls

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Raise AttributeError with a list of the fields for this kind."""
            cls = type(self)
            if name not in cls._fields_of_kinds():
                return super().__getattr__(name)
            text = f"a {cls.__name__} has no field '{name}'; its fields: "
            raise AttributeError(text + ", ".join(cls.model_fields), name=name, obj=self)

    @classmethod
    def model_validate(cls, data: Any) -> Self:
        """Create a part from its fields. Raises ModelError."""
        return data if isinstance(data, cls) else cls(**data)

    @classmethod
    def own_kind(cls) -> str:
        """Return the kind of this class, or "" for a class with several kinds."""
        return _own_kind(cls)

    @classmethod
    def class_for(cls, data: Any) -> type[OfKinds]:
        """Return the class for a part or its fields, or the first class for an unknown kind."""
        if isinstance(data, cls):
            return type(data)
        kind = data.get("kind") if isinstance(data, Mapping) else None
        first = next(iter(cls.KINDS.values()))
        return cls.KINDS.get(kind, first) if isinstance(kind, str) else first

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        """Return required fields of a new part, chosen so that the motion does not jump."""
        return dict(cls.NEW)

    def __new__(cls, /, *args: Any, **data: Any) -> Any:
        """Return a part of the given kind, or else of the only one that has most of the fields."""
        if cls.own_kind() or "kind" in data:
            return object.__new__(cls if cls.own_kind() else cls.class_for(data))
        held = {each: len(data.keys() & each.model_fields.keys()) for each in cls.KINDS.values()}
        most = [each for each, count in held.items() if count == max(held.values())]
        return object.__new__(most[0] if len(most) == 1 else cls.class_for(data))

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        """Return a union discriminated by `kind`, for a class with several kinds."""
        if "KINDS" not in vars(cls) or not cls.KINDS:
            return handler(source)
        classes = {kind: handler.generate_schema(each) for kind, each in cls.KINDS.items()}
        return core_schema.tagged_union_schema(classes, lambda x: cls.class_for(x).own_kind())

    @model_validator(mode="before")
    @classmethod
    def _own_fields(cls, data: Any) -> Any:
        """Return the fields without null values, and without empty fields of other kinds."""
        own = cls.own_kind()
        if not isinstance(data, dict) or not own:
            return data
        data = {key: value for key, value in data.items() if value is not None or key == "name"}
        if (kind := data.get("kind", own)) != own:
            refuse([("kind", cls._other_kind(kind))])
        foreign = data.keys() & (cls._fields_of_kinds() - _fields_of((cls,)))
        if not foreign:
            return data
        meant = [key for key in data if key in foreign and not cls._empty(key, data[key])]
        refuse([(key, cls._foreign(key, data[key])) for key in meant])
        return {key: value for key, value in data.items() if key not in foreign}

    @classmethod
    def _other_kind(cls, kind: Any) -> str:
        if isinstance(kind, str) and kind in cls.KINDS:
            own, other = cls.__name__, cls.KINDS[kind].__name__
            return f"a {own} has kind '{cls.own_kind()}', got '{kind}', which is a {other}"
        close = nearest_first(kind, cls.KINDS) if isinstance(kind, str) else cls.KINDS
        return f"must be one of {', '.join(close)}, got {shown(kind)}{words.choice(kind, close)}"

    @classmethod
    def _foreign(cls, field: str, value: Any) -> str:
        kinds = [kind for kind, each in cls.KINDS.items() if field in each.model_fields]
        do = f"it belongs to kind {' or '.join(kinds)}" if len(kinds) < 6 else "leave it out"
        do = words.advice(field, cls.model_fields) or do
        do += f", got {shown(value)}" if isinstance(value, str) else ""
        return f"is not a field of kind '{cls.own_kind()}'; {do}"

    @classmethod
    def _empty(cls, field: str, value: Any) -> bool:
        return field in cls.NOTHING and type(value) is not bool and value == cls.NOTHING[field]

    @classmethod
    def _fields_of_kinds(cls) -> set[str]:
        """Return the fields of all kinds."""
        return _fields_of(tuple(cls.KINDS.values()))

    @classmethod
    def _followers(cls) -> Mapping[str, tuple[str, ...]]:
        return {"kind": tuple(cls._fields_of_kinds() - {"name", "kind", "body", "active"})}


@cache
def _own_kind(kind: type[OfKinds]) -> str:
    default = kind.model_fields["kind"].default if "kind" in kind.model_fields else None
    return default if isinstance(default, str) else ""


@cache
def _fields_of(kinds: tuple[type[OfKinds], ...]) -> set[str]:
    return {name for each in kinds for name in each.model_fields}


class WithOther(Described):
    """A part acting between `body` and another body."""

    other: Text = field("the name of a body, or 'ground'", default=GROUND, label="Other")


def along(rotation: Any, vector: Any) -> Any:
    """Return a vector in the axes that have this rotation (3, 3), or None for None."""
    return None if vector is None else tuple((vector @ rotation + 0.0).tolist())


class AtPoint(Described):
    """A part acting at a point on `body`."""

    point: Vec3 | None = field(
        "three finite numbers in the axes of `body` [m]; default: its tip",
        converter=maybe_vector, default=None, dim=M, role="point",
        help="in body axes; default: the tip",
    )  # fmt: skip


class OfSums(OfKinds):
    """A part acting on a sum of joint coordinates, `coefficients` x q or v."""

    if TYPE_CHECKING:
        name: str
        body: str
        coefficients: dict[str, PerMotion]

    @model_validator(mode="before")
    @classmethod
    def _first_body(cls, data: Any) -> Any:
        """Set `body` from the first entry of `coefficients` unless it is given."""
        named = data.get("coefficients") if isinstance(data, dict) else None
        if isinstance(named, Mapping) and named and data.get("body") is None:
            return {**data, "body": next(iter(named))}
        return data

    @property
    def terms(self) -> tuple[tuple[str, int, float], ...]:
        """Return the nonzero (body, degree of freedom, coefficient) terms of the sum."""
        return tuple(
            (name, k, x) for name, row in self.coefficients.items() for k, x in enumerate(row) if x
        )

    @property
    def touches(self) -> tuple[str, ...]:
        return tuple(name for name in dict.fromkeys((self.body, *self.coefficients)) if name)


class OnSum(OfSums):
    """A part acting only on the sum of `coefficients` x joint coordinates."""

    body: Text = field("the name of a body", default="", label="Body")
    coefficients: ByName = field(
        "body name -> numbers, one per degree of freedom of its joint",
        converter=by_name, label="Coefficient", dim=NONE, help="one per degree of freedom",
    )  # fmt: skip

    @classmethod
    def begun(cls, model: Any, body: str, other: str) -> dict[str, Any]:
        return {"coefficients": {body: (1.0,) + (0.0,) * (model.body(body).dof - 1)}}

    @model_validator(mode="after")
    def _not_all_zero(self) -> Self:
        if not any(any(x) for x in self.coefficients.values()):
            refuse([("coefficients", "at least one must differ from zero")])
        return self


def is_number(value: Any, kind: type = Real) -> TypeGuard[Any]:
    """Return True if `value` is a number of this kind: no truth value, and no duration of NumPy."""
    return isinstance(value, kind) and not isinstance(value, (bool, np.timedelta64))


def whole(value: Any) -> int | None:
    """Convert a Python or NumPy integer to an int. Return None for anything else, and booleans."""
    return int(value) if is_number(value, Integral) else None


def fields_of(part: Frozen) -> dict[str, Any]:
    """Return the fields of a part by name, excluding cached values."""
    return {name: getattr(part, name) for name in type(part).model_fields}


def part_problems(kind: type[Described], data: Any, where: str) -> list[Problem]:
    """Return the problems with `data` as a `kind`, one per field, or [] if it is valid."""
    if isinstance(data, kind):
        return []
    if isinstance(data, Described):
        own, name = type(data).__name__, data.word()
        to = "bodies" if name == "body" else f"{name}s"
        return [Problem(where, "", f"a {own} is a {name}: it goes to {to}=[...]")]
    if not isinstance(data, Mapping):
        return [Problem(where, "", f"must be an object with fields, got {shown(data)}")]
    try:
        kind(**{str(key): value for key, value in data.items()})
    except ModelError as error:
        return [Problem(where, p.field, p.text) for p in error.problems]
    return []
