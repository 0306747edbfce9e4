"""Parts with states that are integrated with the motion, and are named in expressions."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from .signals import Node, parsed

STATE = "state"  # the group of signals that names the states of a part, within its own trees


class Quantity(NamedTuple):
    """The quantity of a state whose usual size is 1.

    Results show the state times `scale` as the column WORD.NAME.
    """

    word: str
    unit: str
    scale: float = 1.0


class Own(NamedTuple):
    """A state of a part.

    `change` is its rate, or its new value at multiples of `sample` [s] if that is not 0, or None
    for a state whose rate is computed with the loads on the bodies. `start` is its first value.
    `column` is that of the knot of its load which gets it, or None. `given` is the constant input
    that it follows, if the part has one. `quantity` names it in results. `at_rest(places, before)`
    returns the first value from the places of bodies and the state before it, where `start` is NaN.
    """

    change: Node | None
    start: Node
    sample: float = 0.0
    column: int | None = None
    given: Node | None = None
    quantity: Quantity | None = None
    at_rest: Callable[[Any, float], float] | None = None


class Stateful:
    """A part with states: trees that name its states and numbers."""

    name: str

    @property
    @abstractmethod
    def own(self) -> tuple[Own, ...]:
        """The states, in the order of their numbers."""

    @property
    @abstractmethod
    def value(self) -> Node:
        """The value, as an expression of the states and the inputs of the part."""

    if TYPE_CHECKING:

        @classmethod
        def word(cls) -> str: ...

    def _state(self, k: int) -> Node:
        return Node("signal", signal=(STATE, self.name, k))

    def _number(self, name: str) -> Node:
        """Return the value of a field, with a separate instruction so that it can vary."""
        return Node("name", signal=("", f"{self.name} {name}", 0))

    def _read(self, name: str) -> Node:
        value = getattr(self, name)
        return parsed(value) if isinstance(value, str) else self._number(name)

    def _numbers(self) -> Iterator[tuple[str, Any]]:
        for name in type(self).model_fields:  # type: ignore[attr-defined]
            value = getattr(self, name)
            if isinstance(value, float):
                yield f"{self.name} {name}", value

    @property
    def numbers(self) -> dict[str, float]:
        """The fields that are numbers, by the names that the trees use."""
        return dict(self._numbers())
