"""Cases that usual runs leave to nightly ones."""

import itertools
from typing import Any

import pytest


def at_night(*values: Any) -> list[Any]:
    """Return values of one parameter, or tuples of several, for nightly runs only."""
    return [
        pytest.param(*(v if isinstance(v, tuple) else (v,)), marks=pytest.mark.nightly)
        for v in values
    ]


def combined(*parameters: Any) -> list[Any]:
    """Return all combinations of the values of some parameters, for `parametrize`.

    Usual runs have as many as the longest list has values, and each value occurs. Shorter lists
    start again, from another value each time. Nightly runs have all combinations.
    """
    lists = [list(values) for values in parameters]
    places = [range(len(values)) for values in lists]
    usual = {
        tuple((k + n * (k // len(p))) % len(p) for n, p in enumerate(places))
        for k in range(max(map(len, places)))
    }
    cases = []
    for at in itertools.product(*places):
        marks = () if at in usual else pytest.mark.nightly
        cases.append(pytest.param(*(values[k] for values, k in zip(lists, at)), marks=marks))
    return cases
