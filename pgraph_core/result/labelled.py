"""Arrays whose columns have names: `run.q["knee"]`, `run.position["hand"]`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..errors import NameLookupError, Problem, choices, nearest_first
from ..packing import Array


class Labelled(np.ndarray[Any, np.dtype[Any]]):
    """An array that a name of a joint or body indexes too.

    Its parts and the results of arithmetic are plain arrays.
    """

    # below that of arrays, so that it becomes one when it is joined with others
    __array_priority__ = -1.0  # pyright: ignore[reportAssignmentType, reportIncompatibleMethodOverride]
    # what an error calls it, and the function with its argument that returns {name: index}
    _names: tuple[str, Callable[[Any], Mapping[str, Any]], Any] = ("array", dict, ())

    def __getitem__(self, key: Any) -> Any:
        """Return the columns of a name, or what an array returns. Raises NameLookupError."""
        if isinstance(key, str):
            word, of, given = self._names
            places = of(given)
            if key not in places:
                text = f"no entry is named {key!r}; choose one of "
                text += choices(nearest_first(key, places))
                raise NameLookupError(Problem(f"run.{word}", "", text))
            key = places[key]
        return self.view(np.ndarray)[key]

    def __call__(self, name: str) -> Any:
        """Return the columns of a name, like `array[name]`."""
        return self[name]

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        return array[()] if return_scalar else array.view(np.ndarray)

    def __repr__(self) -> str:
        return repr(self.view(np.ndarray))


def labelled(
    array: Array, word: str, of: Callable[[Any], Mapping[str, Any]], given: Any
) -> Labelled:
    """Return a view of `run.word` that the names in `of(given)`, {name: index}, also index."""
    found = array.view(Labelled)
    found._names = word, of, given  # pyright: ignore[reportPrivateUsage]
    return found


def by_position(joints: Mapping[str, Any]) -> dict[str, Any]:
    """Return {joint: index} of coordinates along the last axis: one number, or several."""
    return {name: _one_or_more(joint.q) for name, joint in joints.items()}


def by_velocity(joints: Mapping[str, Any]) -> dict[str, Any]:
    """Return {joint: index} of velocities along the last axis: one number, or several."""
    return {name: _one_or_more(joint.v) for name, joint in joints.items()}


def _one_or_more(place: slice) -> Any:
    return ..., place.start if place.stop == place.start + 1 else place


def by_body(names: tuple[str, ...]) -> dict[str, Any]:
    """Return {body: index} along the second axis."""
    return {name: (slice(None), k) for k, name in enumerate(names)}
