"""What can go wrong, as sentences for the person who typed."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a description: where, which field, and a sentence that helps."""

    where: str  # "body 'knee'", "constraint 'paw'", "model", "file mine.json, line 3"
    field: str  # "mass", or "" where no single field is at fault
    text: str  # what was given and what would do

    def __str__(self) -> str:
        field = self.field if self.field.isprintable() else repr(self.field)
        place = f"{self.where}, {field}" if field else self.where
        return f"{place}: {self.text}"


class PgraphError(Exception):
    """Bad input. Its text has one sentence per problem; `problems` holds them one by one."""

    def __init__(self, problems: Iterable[Problem] | Problem):
        self.problems = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.problems,)


class ModelError(PgraphError):
    """A description that is not a multibody system."""


class FileError(PgraphError):
    """A file that cannot be read or written, or that holds no model."""


class InputError(PgraphError):
    """An argument of a call that does not fit the mechanism."""


def choices(names: Iterable[str], limit: int = 12) -> str:
    """The valid names, comma-separated, for the end of a sentence; cut after `limit`."""
    listed = list(names)
    more = f" and {len(listed) - limit} more" if len(listed) > limit else ""
    return ", ".join(listed[:limit]) + more


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


def shown(value: Any, limit: int = 60) -> str:
    """A given value as it may stand in a sentence: short, and nan and inf spelled out."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    text = repr(_lists(value))
    return text if len(text) <= limit else text[: limit - 3] + "..."


def _lists(value: Any) -> Any:
    return [_lists(x) for x in value] if isinstance(value, (list, tuple)) else value


def numbers(n: int) -> str:
    return f"{n} number" if n == 1 else f"{n} numbers"


def refusal(call: str, field: str, text: str) -> InputError:
    """The error for an argument of a function that does not fit."""
    return InputError(Problem(call, field, text))
