"""Metrics for a sweep: functions of a run, or text such as "max knee" or "max(abs(knee))"."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import partial
from itertools import chain
from types import CodeType, FunctionType
from typing import Any

from ..errors import InputError, Problem, choices, nearest, shown
from ..result import Result
from ..result.columns import meant
from ..result.functions import WAYS, read

OF_RUN: dict[str, Callable[[Result], float]] = {
    "energy_drift": lambda run: run.energy_drift,
    "error_estimate": lambda run: run.error_estimate,
    "t_end": lambda run: run.t[-1],
    "steps": lambda run: run.counters["steps"],
}
Metric = Callable[[Result], Any]


def metrics_of(given: Any) -> dict[str, Metric | str]:
    """Return metrics by name from a name, a function, or several of these. Raises InputError."""
    if isinstance(given, Mapping):
        found = dict(given)
    elif isinstance(given, str) or callable(given):
        found = {given if isinstance(given, str) else getattr(given, "__name__", "metric"): given}
    elif isinstance(given, (list, tuple)):
        named = [pair for one in given for pair in metrics_of(one).items()]
        found = dict(named)
        for name, one in named:
            if one is not found[name] and one != found[name]:
                text = f"two are named {name!r}, so their columns would be the same; "
                raise _refused(text + "give each a name: metric={'a': f, 'b': g}")
    else:
        found = {}
    if not found:
        text = f"must be a name such as 'max knee', or a function of a run, got {shown(given)}"
        raise _refused(text)
    for name, one in found.items():
        if isinstance(one, str):
            if is_expression(one):
                read(one)
            else:
                words(one)
        elif not callable(one):
            raise _refused(f"{name!r} must be a function of a run, got {shown(one)}")
    return found


def said_of(metric: Any) -> str:
    """Return text that identifies a metric by its code and the values in its closure."""
    if isinstance(metric, str):
        return metric
    if isinstance(metric, partial):
        return repr((said_of(metric.func), metric.args, sorted(metric.keywords.items())))
    code = getattr(metric, "__code__", None)
    if code is None:
        return f"{type(metric).__module__}.{type(metric).__qualname__} {_name(metric)}"
    return repr(_said_of_function(metric, ()))


def _said_of_function(function: Any, above: tuple[Any, ...]) -> tuple[Any, ...]:
    """Describe a function, with the functions of its module and constants that it uses."""
    held = [_constant(cell.cell_contents) for cell in function.__closure__ or ()]
    values = (function.__defaults__, function.__kwdefaults__, held)
    read = []
    for name in _names(function.__code__):
        x = function.__globals__.get(name)
        ours = isinstance(x, FunctionType) and x.__module__ == function.__module__
        if ours and x not in above:
            read.append((name, _said_of_function(x, (*above, function))))
        elif name in function.__globals__ and not isinstance(x, FunctionType):
            read.append((name, _plain(_constant(x))))
    return _said_of_code(function.__code__), *map(_plain, values), read


def _names(code: CodeType) -> list[str]:
    """Return the names that a function and its nested functions look up."""
    inside = [_names(x) for x in code.co_consts if isinstance(x, CodeType)]
    return sorted({*code.co_names, *chain.from_iterable(inside)})


def _said_of_code(code: CodeType) -> tuple[Any, ...]:
    """Describe code without its location in a file or the addresses of nested functions."""
    inside = [_said_of_code(x) if isinstance(x, CodeType) else repr(x) for x in code.co_consts]
    return code.co_code.hex(), inside, code.co_names, code.co_varnames


def _constant(value: Any) -> Any:
    """Return an immutable value, or the type name of a mutable value."""
    fixed = isinstance(value, (int, float, complex, str, bytes, tuple, frozenset, type(None)))
    return value if fixed else type(value).__qualname__


def _plain(values: Any) -> str:
    """Return the values as text without memory addresses."""
    return re.sub(r" at 0x[0-9a-f]+", "", repr(values))


def measured(run: Result, metric: Metric | str) -> float:
    """Evaluate a metric for one run. Raises InputError if the result is not a number."""
    if not isinstance(metric, str):
        value = metric(run)
        try:
            if isinstance(value, (str, bytes)):
                raise TypeError
            return float(value)
        except (TypeError, ValueError):
            text = f"must return one number; {_name(metric)} returned {shown(value)}"
            raise _refused(text) from None
    if metric in OF_RUN:
        return float(OF_RUN[metric](run))
    if is_expression(metric):
        return run.value(metric)
    way, what = words(metric)
    try:
        found = run[what]
    except InputError as problem:
        raise _refused(problem.problems[0].text) from None
    if found.ndim > 1:
        names = meant(run.columns(bodies=True), what)
        raise _refused(f"{what!r} has {found.shape[1]} columns; choose one of {choices(names)}")
    return float(WAYS[way](run.t, found))


def _name(metric: Any) -> str:
    return getattr(metric, "__name__", "the metric")


def is_expression(metric: str) -> bool:
    """Check whether a metric is a result function, as "max(v.knee) - min(v.knee)", and not "max
    COLUMN"."""
    way, _, what = metric.partition(" ")
    plain = way in WAYS and what.strip() and what.strip()[0] not in "(+-*/^"
    return "(" in metric and not plain


def words(metric: str) -> tuple[str, str]:
    """Split a metric into its reduction and column. The reduction is "" for a metric of the whole
    run.

    Raises InputError.
    """
    if metric in OF_RUN:
        return "", metric
    way, _, what = metric.partition(" ")
    if way not in WAYS or not what:
        known = [*OF_RUN, *(f"{way} COLUMN" for way in WAYS)]
        raise _refused(f"{metric!r} is unknown; {nearest(metric, known)}")
    return way, what


def _refused(text: str) -> InputError:
    return InputError(Problem("sweep", "metric", text))
