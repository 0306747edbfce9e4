"""Checks of refusals by their facts, not by their wording."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest

import pgraph_core as pg


def assert_names(text: str, *facts: str) -> None:
    """Assert that a message names all facts."""
    assert [fact for fact in facts if fact not in text] == [], text


def refusal(make: Callable[[], Any], *errors: type[Exception]) -> Any:
    """Return the error of a call, whose text has one line for each problem."""
    with pytest.raises(errors or pg.PgraphError) as refused:
        make()
    problems = getattr(refused.value, "problems", None) or [refused.value]
    assert str(refused.value).split("\n") == [str(p) for p in problems]
    return refused.value


def assert_problems(problems: Iterable[pg.Problem], expected: Iterable[Any]) -> None:
    """Assert that each problem begins with its part and field and names the facts."""
    problems, expected = list(problems), list(expected)
    heads = [", ".join(filter(None, (p.where, p.field))) for p in problems]
    assert heads == [head for head, *_ in expected]
    for problem, (_, *facts) in zip(problems, expected):
        assert_names(problem.text, *facts)
