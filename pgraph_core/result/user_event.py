"""UserEvent: where a function that was given to `simulate` crossed zero."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..packing.system import Array


class UserEvent(NamedTuple):
    """One event of `simulate(events=[...])`, located within a step."""

    t: float  # [s]
    name: str  # of the function
    number: int  # of the function in the list
    q: Array  # (nq,)
    v: Array  # (nv,)

    def __str__(self) -> str:
        """The event as a sentence."""
        return f"t = {self.t:.9g} s: {self.name}"


def event_arrays(events: Sequence[UserEvent]) -> dict[str, Any]:
    """Arrays by names for a file; none where there are no events."""
    if not events:
        return {}
    t, name, number, q, v = zip(*events)
    columns = {"t": t, "name": name, "number": number, "q": q, "v": v}
    return {f"user event {key}": np.array(column) for key, column in columns.items()}


def events_of_arrays(arrays: Mapping[str, Any]) -> tuple[UserEvent, ...]:
    """The way back."""
    if "user event t" not in arrays:
        return ()
    t, name, number, q, v = (arrays[f"user event {key}"] for key in UserEvent._fields)
    return tuple(map(UserEvent, t.tolist(), name.tolist(), number.tolist(), q, v))
