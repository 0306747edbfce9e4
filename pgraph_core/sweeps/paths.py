"""What a sweep varies: a path into the description, and the values along it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..errors import InputError, ModelError, Problem, choices, nearest, shown
from ..model import Model

Array = np.ndarray
KINDS = {  # group of parts in a path -> the kind that `Model.edit` takes
    "bodies": "body",
    "constraints": "constraint",
    "contacts": "contact",
    "forces": "force",
    "scenarios": "scenario",
}
SAMPLES = ("grid", "latin", "sobol", "random")
MOST_POINTS = 10_000_000


class Path:
    """A number in a model's description: `bodies.shin.mass`, `bodies.shin.link.0`, a parameter.

    Given as text, or as a tuple where a name contains dots. Raises InputError if the model has no
    such number.
    """

    def __init__(self, model: Model, given: str | Sequence[Any]):
        words = given if isinstance(given, (tuple, list)) else [given]
        self.text = ".".join(map(str, words))
        self.group, self.name, self.field, self.index = _split(model, given)
        at = self._value(model)
        if isinstance(at, bool) or not isinstance(at, (int, float)):
            kind = "has no value" if at is None else f"is {shown(at)}, not one number"
            hint = f"; name one of its numbers, as in {self.text}.0" if _numbers(at) else ""
            raise _refused(self.text, f"{kind}{hint}")
        self.present = float(at)

    def _value(self, model: Model) -> Any:
        if not self.group:
            return model.parameters[self.name]
        value = getattr(model.part(self.name, KINDS[self.group]), self.field)
        for i in self.index:
            if not _numbers(value) or not 0 <= i < len(value):
                raise _refused(self.text, f"has no number {i}; {self.field} is {shown(value)}")
            value = value[i]
        return value

    def set(self, model: Model, value: float) -> Model:
        """The model with another number there: `Model.edit`, so nothing else follows."""
        if not self.group:
            return model.replace(parameters={**model.parameters, self.name: value})
        old = getattr(model.part(self.name, KINDS[self.group]), self.field)
        return model.edit(
            self.name, kind=KINDS[self.group], **{self.field: _replaced(old, self.index, value)}
        )


def _split(model: Model, given: Any) -> tuple[str, str, str, tuple[int, ...]]:
    """(group, name, field, index); a parameter has no group."""
    if isinstance(given, str):
        if given in model.parameters:
            return "", given, "", ()
        group, _, rest = given.partition(".")
        names = [p.name for p in getattr(model, group)] if group in KINDS else []
        name = max((n for n in names if rest.startswith(f"{n}.")), key=len, default=None)
        fields = rest[len(name) + 1 :].split(".") if name is not None else rest.split(".")[1:]
        words: list[Any] = [group, rest.split(".")[0] if name is None else name, *fields]
    else:
        words = list(given) if isinstance(given, (tuple, list)) else [given]
    text = ".".join(map(str, words))
    if not words or words[0] not in KINDS:
        known = [*model.parameters, *(f"{group}.NAME.FIELD" for group in KINDS)]
        raise _refused(text, f"is no path in the model; {nearest(str(text), known)}")
    if len(words) < 3:
        raise _refused(text, f"must name a part and its field, as in {words[0]}.NAME.FIELD")
    group, name, field, *index = words
    try:
        part = model.part(name, KINDS[group])
    except ModelError as error:
        raise _refused(text, error.problems[0].text) from None
    fields = [x for x in type(part).model_fields if x != "name"]
    if field not in fields:
        raise _refused(
            text, f"{KINDS[group]} {name!r} has no field {field!r}; {nearest(field, fields)}"
        )
    try:
        return group, name, field, tuple(int(i) for i in index)
    except (TypeError, ValueError):
        raise _refused(
            text, f"after the field comes the number of an entry; given {index}"
        ) from None


def _numbers(value: Any) -> bool:
    return isinstance(value, (tuple, list))


def _replaced(old: Any, index: tuple[int, ...], value: float) -> Any:
    if not index:
        return value
    i, *rest = index
    return (*old[:i], _replaced(old[i], tuple(rest), value), *old[i + 1 :])


def points_of(values: Mapping[str, Any], samples: str, n: int | None, seed: int) -> Array:
    """The points of a design, shape (points, paths).

    "grid": every combination of the values given for each path. "latin", "sobol" and "random": `n`
    points, each path given as (low, high) or as a frozen distribution of `scipy.stats`.
    Raises InputError.
    """
    if samples not in SAMPLES:
        raise _refused("samples", f"must be one of {choices(SAMPLES)}; given {shown(samples)}")
    if samples == "grid":
        lists = [_listed(path, given) for path, given in values.items()]
        count = math.prod(map(len, lists))
        if count > MOST_POINTS:
            raise _refused("set", f"has {count} points; {MOST_POINTS} at most")
        return np.array(list(itertools.product(*lists)), dtype=float)
    if isinstance(n, bool) or not isinstance(n, int) or not 1 <= n <= MOST_POINTS:
        raise _refused("n", f"must be the number of points, 1 to {MOST_POINTS}; given {shown(n)}")
    units = _unit_points(samples, len(values), n, seed)
    columns = [_stretched(path, given, u) for (path, given), u in zip(values.items(), units.T)]
    return np.stack(columns, axis=1)


def _unit_points(samples: str, dimensions: int, n: int, seed: int) -> Array:
    """(n, dimensions) numbers within (0, 1)."""
    from scipy.stats import qmc

    if samples == "latin":
        points = qmc.LatinHypercube(dimensions, rng=seed).random(n)
    elif samples == "sobol":
        points = qmc.Sobol(dimensions, rng=seed).random_base2(max(n - 1, 0).bit_length())[:n]
    else:
        points = np.random.default_rng(seed).random((n, dimensions))
    return np.clip(points, np.finfo(float).tiny, 1.0 - np.finfo(float).epsneg)


def _stretched(path: str, given: Any, unit: Array) -> Array:
    if hasattr(given, "ppf"):
        return np.asarray(given.ppf(unit), dtype=float)
    pair = _listed(path, given)
    if len(pair) != 2 or not pair[0] < pair[1]:
        text = f"must be (low, high) or a distribution of scipy.stats; given {shown(given)}"
        raise _refused(path, text)
    return pair[0] + (pair[1] - pair[0]) * unit


def _listed(path: str, given: Any) -> Array:
    try:
        values = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        values = np.empty((0, 0))
    if values.ndim == 0:
        values = values[None]
    if values.ndim != 1 or not len(values):
        raise _refused(path, f"must be a list of numbers, not empty; given {shown(given)}")
    if not np.isfinite(values).all():
        raise _refused(path, f"must be finite numbers; given {shown(given)}")
    return values


def _refused(what: str, text: str) -> InputError:
    return InputError(Problem("sweep", what, text))
