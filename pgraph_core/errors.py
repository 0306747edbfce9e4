"""Errors, with messages written for the person who typed the input."""

from __future__ import annotations

import collections.abc
import inspect
import math
import re
import struct
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, wraps
from importlib import import_module
from typing import Any, TypeVar

from . import hooks, words
from .annotations import fits

Called = TypeVar("Called", bound=Callable[..., Any])

MOST_TOLD = 50  # problems in the text of an error
MOST_NESTED = 100  # lists within lists


@dataclass(frozen=True)
class Problem:
    """A single problem in a description: the part, the field and a message about it."""

    where: str  # "body 'knee'", "constraint 'paw'", "model", "file mine.json, line 3"
    field: str  # "mass", or "" if no single field is at fault
    text: str  # the given value and the allowed values

    def __str__(self) -> str:
        field = self.field if self.field.isprintable() else repr(self.field)
        place = f"{self.where}, {field}" if field else self.where
        place, text = plain(place).replace("\n", r"\n"), plain(self.text)
        return f"{_cut(place, 1000)}: " * bool(place) + _cut(text, 4000)


class PgraphError(Exception):
    """Base class for invalid input. `problems` lists all problems, the message the first one."""

    def __init__(self, problems: Iterable[Problem] | Problem):
        self.problems = (problems,) if isinstance(problems, Problem) else tuple(problems)
        left = len(self.problems) - MOST_TOLD
        more = [f"and {counted(left, 'more problem')}"] if left > 0 else []
        super().__init__("\n".join([*map(str, self.problems[:MOST_TOLD]), *more]))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.problems,)


class ModelError(PgraphError):
    """Raised if a model is invalid."""


class FileError(PgraphError):
    """Raised if a file cannot be read or written, or does not contain a model."""


class InputError(PgraphError):
    """Raised if an argument is invalid."""


class MissingPackage(PgraphError, ImportError):
    """An optional package is missing. The message gives the command that installs it."""


class OutOfMemory(PgraphError, MemoryError):
    """A call that needs more memory than is free: a MemoryError with a helpful message."""


class SetError(InputError, AttributeError):
    """An attribute that cannot be set: an AttributeError with a helpful message."""

    __str__ = Exception.__str__


class Suggests:
    """A mixin that returns our attribute for the same of another program, or names a near one.

    Functions whose first argument is a model or a mechanism can also be called as methods, such as
    `model.linearise()`.
    """

    if not typing.TYPE_CHECKING:

        def __getattr__(self, name):
            """Return our attribute, or raise NoAttribute or the error of a property that failed."""
            kind = type(self)
            ours = words.same_attribute(name)
            if ours != name and hasattr(self, ours):
                return getattr(self, ours)
            if any(name in vars(each) for each in kind.__mro__):
                return object.__getattribute__(self, name)
            try:
                return super().__getattr__(name)  # defined by pydantic
            except AttributeError:
                found = hooks.bound(self, name) if name[0] != "_" else None
                if found is not None:
                    return found
                own = self.__dict__ if hasattr(self, "__dict__") else ()
                raise words.NoAttribute(
                    f"a {kind.__name__}", name, lambda: [*dir(kind), *own], partial(_part, self)
                ) from None


def _part(owner: Any, name: str) -> str:
    """Return the text for an attribute that is the name of a part of a model, or ""."""
    named = hasattr(owner, "part") and name in owner
    return f"the part of this name is model[{name!r}]" if named else ""


def guarded(**advice: str) -> Callable[[Called], Called]:
    """Make a class reject attempts to set public attributes from outside.

    Methods of the class assign them through `vars(self)`. `advice` maps attribute names (several
    are joined by "_or_") to a hint. The key "other" applies to all remaining names. Subclasses
    defined by users add their own attributes.
    """
    told = {name: text for names, text in advice.items() for name in names.split("_or_")}

    def decorate(kind: Called) -> Called:
        owner: Any = kind

        def refuse(self: Any, name: str, value: Any = None) -> None:
            ours = type(self).__module__.startswith("pgraph_")
            if name[0] == "_" or not (name in told or ours or hasattr(type(self), name)):
                object.__setattr__(self, name, value)
                return
            text = told.get(name, told["other"])
            raise SetError(Problem(type(self).__name__, name, f"cannot be set; {text}"))

        owner.__setattr__ = refuse
        return kind

    return decorate


def needed(module: str, extra: str = "") -> Any:
    """Import `module` and return it.

    Raises MissingPackage naming the `extra` of pgraph-dynamics that brings it. By default, the
    package belongs to the browser interface and is only missing in lean installations.
    """
    try:
        return import_module(module)
    except ImportError as error:
        package = module.split(".")[0]
        text = "is not part of a lean installation; install pgraph-dynamics without PGRAPH_LEAN"
        if extra:
            text = f"is not installed; type: pip install 'pgraph-dynamics[{extra}]'"
        raise MissingPackage(Problem(f"package '{package}'", "", text)) from error


def choices(names: Iterable[str], limit: int = 60) -> str:
    """Return at most `limit` valid names, separated by commas, to complete a sentence."""
    listed = [name if name.isprintable() else repr(name) for name in names]
    more = f" and {len(listed) - limit} more" if len(listed) > limit else ""
    return ", ".join(_cut(name, 100) for name in listed[:limit]) + more


def one_of(names: Iterable[str]) -> str:
    """Return 'choose one of a, b', or 'there is none', to complete a sentence."""
    known = choices(names)
    return f"choose one of {known}" if known else "there is none"


def nearest_first(name: str, known: Iterable[str]) -> list[str]:
    """Return the names sorted so that those most similar to `name` come first."""
    names = list(dict.fromkeys(known))
    close = words.similar(name, names)
    return [*close, *(x for x in names if x not in close)]


def nearest(name: str, known: Iterable[str], about: Callable[[str], str] = lambda _: "") -> str:
    """Return 'did you mean mass? choose from ...' for a mistyped name.

    `about` returns the accepted values of a suggested name.
    """
    names = list(known)
    return f"{meant(name, names, about)}choose from {choices(names)}"


def nearest_name(name: str, known: Iterable[str]) -> str:
    """Return 'did you mean knee? choose from ...' for a mistyped name that a user gave to a part.

    Words of other programs say nothing about such names. They are compared by spelling only.
    """
    names = list(known)
    close = words.similar(name, names, n=1, cutoff=0.7)
    suggested = f"did you mean {close[0]}? " if close else ""
    return f"{suggested}choose from {choices(names)}"


def meant(
    name: str,
    known: Iterable[str],
    about: Callable[[str], str] = lambda _: "",
    given: Iterable[Any] = (),
    around: Iterable[str] = (),
) -> str:
    """Return 'did you mean mass? mass takes ...; ' for a mistyped name, or "".

    `given` are the other arguments of the call, and `around` the names of its object.
    """
    known = list(known)
    if told := words.advice(name, known, around):
        return told + "; "
    close = words.hint(name, known)
    meaning = about(close) if close else ""
    suggested = f"did you mean {close}? " if close else ""
    if not close and (taken := hooks.taken(name, given)):
        suggested = f"it belongs to {taken}; "
    return suggested + (f"{close} takes {meaning}; " if meaning else "")


def no_method(name: Any, known: Iterable[str]) -> str:
    """Return a message about an unknown integration method."""
    names = list(known)
    text = f"no method is named {shown(name)}; choose one of {choices(names)}"
    return text + words.choice(name, names)


def to_read(text: Any) -> str:
    """Return a hint for text passed in place of a model."""
    if not isinstance(text, str):
        return ""
    if text.lstrip().startswith("{"):
        return "; to read it: pg.Model.from_json(text)"
    return f"; to read a file or a built-in model: pg.load({shown(text)})"


def plain(text: str) -> str:
    """Sanitise external text for a terminal by spelling out control characters."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)


def _cut(text: str, limit: int) -> str:
    return text if len(text) <= limit else text[: limit - 3] + "..."


def shown(value: Any, limit: int = 60) -> str:
    """Format a value for use in a message: short, with nan and inf spelled out."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    try:
        return _cut(repr(_lists(value, limit, [limit])), limit)
    except RecursionError:
        return f"a {type(value).__name__} nested too deeply"


def _lists(value: Any, most: int, left: list[int]) -> Any:
    """Convert tuples and arrays to lists with at most `left` values."""
    left[0] -= 1
    if hasattr(value, "tolist"):
        if hasattr(value, "ndim") and not isinstance(value, memoryview):
            value = value[(slice(most),) * value.ndim]
            value = value.astype(str) if value.dtype.kind in "mM" else value
        value = value.tolist()
    if not isinstance(value, (list, tuple)):
        return value
    return [_lists(x, most, left) if left[0] > 0 else ... for x in value[:most]]


def counted(n: int, one: str, many: str = "") -> str:
    """Return '1 body' or '2 bodies'."""
    return f"{n} {one if n == 1 else many or one + 's'}"


def percent(share: float) -> str:
    """Return a share as '1.1 %' or '170 %', without exponents of ten above 1."""
    most = 100.0  # a larger multiple says no more
    return f"{float(f'{100 * share:.2g}'):g} %" if share < most else f"more than {100 * most:g} %"


def refusal(call: str, field: str, text: str) -> InputError:
    """Return the error for an invalid function argument."""
    return InputError(Problem(call, field, text))


# -- calls ---------------------------------------------------------------------------------------


class NameLookupError(InputError, KeyError):
    """An unknown name in a table of results: a KeyError with a helpful message."""

    __str__ = Exception.__str__


BARE = (TypeError, ValueError, AttributeError, LookupError, ArithmeticError, struct.error)


def explained(called: Called) -> Called:
    """Wrap a function, or the public methods of a class, to convert exceptions into readable
    messages.

    A call that fails with an error of Python's own is looked at then: arguments that the signature
    does not take, or whose type is not the annotated one, raise InputError. Other exceptions are
    not changed. The overhead of a successful call is 0.1 us.
    """
    owner: Any = called
    if not isinstance(owner, type):
        return _explained(called)
    for name, own in list(vars(owner).items()):
        if name.startswith("_") and name not in ("__init__", "__new__"):
            continue
        if isinstance(own, (classmethod, staticmethod)):
            setattr(owner, name, type(own)(_explained(own.__func__)))
        elif inspect.isfunction(own):
            setattr(owner, name, _explained(own))
    return called


CALLS: set[str] = set()  # names of all calls that are explained


def _explained(function: Any) -> Any:
    CALLS.add(_name_of(function))

    @wraps(function)
    def call(*args: Any, **named: Any) -> Any:
        try:
            return function(*args, **named) if named else function(*args)
        except PgraphError as refused:  # `sweep` passes arguments of other calls on
            if ours := _renamed(function, args, named):
                return call(*args, **ours)
            if problems := _of_inner_calls(refused, function, args, named):
                raise type(refused)(problems) from refused.__cause__
            raise
        except MemoryError as error:
            more = f" ({plain(str(error))})" if str(error) else ""
            text = f"needs more memory than is free{more}; give fewer values, runs or frames"
            raise OutOfMemory(Problem(_called_as(function, args), "", text)) from error
        except RecursionError:
            if not any(map(is_deep, (*args, *named.values()))):
                raise
            text = "has an argument that contains itself or is nested too deeply"
            raise InputError(Problem(_called_as(function, args), "", text)) from None
        except BARE as error:
            if ours := _renamed(function, args, named):
                return call(*args, **ours)
            if placed := _in_free_places(function, args, named):
                return call(**placed)
            found = _problems_of_call(function, args, named)
            if not found:
                raise
            raise InputError(found) from (None if found[0].text.startswith("is ") else error)

    return call


def _of_inner_calls(
    refused: PgraphError, function: Any, args: Sequence[Any], named: Mapping[str, Any]
) -> tuple[Problem, ...]:
    """Return the problems under the name of this call, which passed its arguments on to others.

    Return () if no problem is about an argument of this call.
    """
    given, ours = {*named, *_names(function)}, _called_as(function, args)

    def ours_of(one: Problem) -> Problem:
        if one.where in CALLS and one.field.partition("[")[0] in given:
            return replace(one, where=ours)
        return replace(one, where=ours, field=one.where) if bare(one) else one

    def bare(one: Problem) -> bool:  # "q: must have shape ..."
        return not one.field and one.where in given

    def told(one: Problem) -> Problem:
        """Tell which numbers an array of a wrong shape has, from the docstring."""
        if not re.fullmatch(r"must have shape \([^;]*", one.text):
            return one
        means = meaning_of(function, one.field).removesuffix(".")
        return replace(one, text=f"{one.text}; its numbers: {means}") if means else one

    problems = tuple(told(ours_of(one)) for one in refused.problems)
    return () if problems == refused.problems else problems


def _name_of(function: Any) -> str:
    return function.__qualname__.removesuffix(".__init__").removesuffix(".__new__")


def _called_as(function: Any, args: Sequence[Any]) -> str:
    """Return the name of a call, including the class name for methods."""
    name = _name_of(function)
    owner, _, method = name.rpartition(".")
    kind = args[0] if args and isinstance(args[0], type) else type(args[0] if args else None)
    classes = [known.__qualname__ for known in kind.__mro__]
    if owner in classes:
        return f"{classes[0]}.{method}"
    if name in classes:
        return classes[0]
    known = function.__globals__.get(owner)
    while isinstance(known, type) and len(parts := known.__subclasses__()) == 1:
        known = parts[0]  # a class that only splits another one
    return f"{known.__qualname__}.{method}" if isinstance(known, type) else name


def _names(function: Any) -> list[str]:
    """Return the names that a function accepts as keyword arguments."""
    return [
        p.name
        for p in inspect.signature(function).parameters.values()
        if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)
    ]


def _renamed(function: Any, args: tuple[Any, ...], named: Mapping[str, Any]) -> dict[str, Any]:
    """Return arguments under Pgraph names, or {} if none is renamed, or one is given by position
    too."""
    ours = words.renamed(named, _names(function))
    return {} if ours.keys() - named.keys() & {*_names(function)[: len(args)]} else ours


def _in_free_places(
    function: Any, args: tuple[Any, ...], named: Mapping[str, Any]
) -> dict[str, Any]:
    """Return all arguments by name if some by position are in the place of others given by name.

    Those by position then are the arguments that are left, in their order. {} if that does not fit.
    """
    parameters = inspect.signature(function).parameters
    places = [p.name for p in parameters.values() if p.kind is p.POSITIONAL_OR_KEYWORD]
    free = [name for name in places if name not in named]
    if free[: len(args)] == places[: len(args)] or len(args) > len(free):
        return {}
    placed = dict(zip(free, args))
    moved = {name: x for name, place, x in zip(free, places, args) if name != place}
    strict = not any("Any" in str(parameters[name].annotation) for name in moved)
    fit = strict and not _misfits("", function, parameters, moved)
    return {**placed, **named} if fit and named.keys() <= {*_names(function)} else {}


def is_deep(value: Any) -> bool:
    """Check whether lists and dictionaries are nested deeper than any valid argument."""
    level = [value]
    for _ in range(MOST_NESTED):
        level = [
            x
            for one in level[:MOST_NESTED]
            if isinstance(one, (list, tuple, dict))
            for x in (one.values() if isinstance(one, dict) else one)
            if isinstance(x, (list, tuple, dict))
        ]
    return bool(level)


def _problems_of_call(
    function: Any, args: tuple[Any, ...], named: Mapping[str, Any]
) -> list[Problem]:
    """Return the problems with the arguments of a failed call, or [] if they fit."""
    signature = inspect.signature(function)
    where = _called_as(function, args)
    parameters, others, around = signature.parameters, [*args, *named.values()], list[str]()
    if next(iter(parameters), "") in ("self", "cls", "_cls"):
        if not (args and hasattr(args[0], function.__name__)):
            return [Problem(where, "", f"is a method of a {where.split('.')[0]}")]
        around = dir(args[0])
        parameters = dict(list(parameters.items())[1:])
        args, signature = args[1:], signature.replace(parameters=list(parameters.values()))
    try:
        given = signature.bind(*args, **named).arguments
    except TypeError as error:
        known = _names(function)
        named = words.renamed(named, known) or named  # by position too, or this would have run
        wrong = [name for name in named if name not in known]
        if any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
            wrong = [name for name in wrong if not hooks.passed(name)]
        if wrong and known:
            about = partial(meaning_of, function)
            texts = [meant(name, parameters, about, others, around) for name in wrong]
            left = f"choose from {choices(parameters)}" if parameters else "there is none to give"
            texts[-1] += left + example_of(function)
            return [
                Problem(where, name, f"is not an argument; {text}".removesuffix("; "))
                for name, text in zip(wrong, texts)
            ]
        twice = [f"{shown(x)} is in the place of {name}, which is given by name too"
                 for name, x in zip(parameters, args) if name in named]  # fmt: skip
        taken = [str(p).split(":")[0] for p in parameters.values()]
        by_name = [i for i, p in enumerate(parameters.values()) if p.kind is p.KEYWORD_ONLY]
        if by_name and by_name[0] > 0 and not taken[by_name[0] - 1].startswith("*"):
            taken.insert(by_name[0], "*")
        takes = ", ".join(taken)
        text = f"{[*twice, error][0]}; it takes ({takes}){example_of(function)}"
        return [Problem(where, "", text)]
    return _misfits(where, function, parameters, given)


def _misfits(
    where: str, function: Any, parameters: Mapping[str, Any], given: Mapping[str, Any]
) -> list[Problem]:
    """Return a problem for each argument whose type does not match its annotation."""
    found: list[Problem] = []
    for name, value in given.items():
        wanted, form = parameters[name].annotation, parameters[name].kind
        try:
            known = {**vars(typing), **vars(collections.abc), **function.__globals__}
            kind = eval(wanted, known) if isinstance(wanted, str) else wanted
        except Exception:
            continue  # a name that only type checkers import
        for x in _each(value, form):
            if not fits(x, kind):
                hint = to_read(x) if "Model" in str(wanted) else example_of(function)
                hint = hint or f"; it takes ({', '.join(parameters)})" * (len(parameters) > 1)
                said = type_of(function, name) or wanted
                found.append(Problem(where, name, f"must be {said}, got {shown(x)}{hint}"))
    return found


def type_of(function: Any, name: str) -> str:
    """Return the type of a parameter in words, from its docstring, or ""."""
    found = re.search(rf"^(?:\w+, )*{name}(?:, \w+)* : (.*)$", inspect.getdoc(function) or "", re.M)
    return found[1].removesuffix(", optional") if found else ""


def meaning_of(function: Any, name: str) -> str:
    """Return the first sentence about a parameter in a docstring, or ""."""
    text = inspect.getdoc(function) or ""
    found = re.search(rf"^(?:\w+, )*{name}(?:, \w+)* :.*\n((?: +.*\n?)+)", text, re.MULTILINE)
    return re.split(r"(?<=[a-z\])])\.\s", " ".join(found[1].split()))[0] if found else ""


def example_of(function: Any) -> str:
    """Return '; for example: ...' with the first call in the examples of a docstring, or ""."""
    _, _, examples = (inspect.getdoc(function) or "").partition("Examples\n--------\n")
    lines = (line.removeprefix(">>>").strip() for line in examples.splitlines())
    return next((f"; for example: {x}" for x in lines if f"{function.__name__}(" in x), "")


def _each(value: Any, form: Any) -> Iterable[Any]:
    """Return the values of a parameter. Only variadic arguments such as `*names` have several
    values."""
    if form is inspect.Parameter.VAR_POSITIONAL:
        return value
    return value.values() if form is inspect.Parameter.VAR_KEYWORD else (value,)
