"""An axis of the stability map: what is varied, as a pure function from model to model."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ..errors import InputError, Problem
from ..model import Body, Model
from ..model.fields import fields_of


def unchanged(model: Model, value: float) -> Model:
    """The model as it is: for axes that vary the run, not the model."""
    return model


def at_same_pace(value: float) -> float:
    """Steps and durations stay as they are."""
    return 1.0


class Axis(NamedTuple):
    """One way to make a scene extreme; a new one is a file of `axes` and a line in its list."""

    name: str
    what: str  # what a value is
    unit: str
    values: tuple[float, ...]  # usual ones
    applied: Callable[[Model, float], Model] = unchanged
    pace: Callable[[float], float] = at_same_pace  # what multiplies steps and duration
    of_steps: bool = False  # values are the steps themselves


def changed(body: Body, **fields: object) -> Body:
    """A validated body with other fields."""
    return Body(**{**fields_of(body), **fields})


def lacking(axis: str, what: str) -> InputError:
    """What to raise where a model has nothing that the axis could vary."""
    return InputError(Problem("stability_map", "axis", f"{axis} varies {what}; the model has none"))
