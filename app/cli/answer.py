"""What a command answers, for people and for programs."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from pgraph_core.errors import Problem


@dataclass(frozen=True)
class Answer:
    """The same answer twice, and the sentence of a run that failed."""

    data: Mapping[str, Any]  # with --json, under the names of the Python API
    text: str
    problem: str = ""  # said on stderr, exit code 1


def print_answer(answer: Answer, as_json: bool) -> None:
    print(to_json(answer.data) if as_json else answer.text)


def print_problems(problems: Iterable[Problem], as_json: bool) -> None:
    """A sentence a problem on stderr; with --json also one object on stdout."""
    problems = tuple(problems)
    for problem in problems:
        print(problem, file=sys.stderr)
    if as_json:
        print(to_json({"problems": [vars(problem) for problem in problems]}))


def to_json(data: Any) -> str:
    return json.dumps(_plain(data), allow_nan=False)


def _plain(value: Any) -> Any:
    """Arrays as lists and what is not finite as null, which is all that JSON has for it."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)


def aligned(rows: Iterable[Iterable[Any]], header: Iterable[str]) -> str:
    """A table in columns: numbers to the right, text to the left."""
    cells = [[*header], *([*row] for row in rows)]
    numeric = [
        all(isinstance(row[i], (int, float)) for row in cells[1:]) for i in range(len(cells[0]))
    ]
    texts = [[f"{x:g}" if isinstance(x, float) else str(x) for x in row] for row in cells]
    widths = [max(len(row[i]) for row in texts) for i in range(len(texts[0]))]
    lines = (
        "  ".join(
            x.rjust(width) if right else x.ljust(width)
            for x, width, right in zip(row, widths, numeric)
        ).rstrip()
        for row in texts
    )
    return "\n".join(lines)
