"""Phases of contacts in runs that step over them: from a log of changes, good to one step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contact.tables import Tables, Touch
from ..engine import layout as at
from ..model.names import GROUND
from ..result.contact_record import PHASES, ContactRecord, Event
from ..system import Array

CAUSES = {
    (at.SWING, at.ACCEPTANCE): "it touched down, sliding",
    (at.SWING, at.STANCE): "it touched down",
    (at.ACCEPTANCE, at.STANCE): "its slip came to zero",
    (at.SLIP, at.STANCE): "its slip came to zero",
    (at.STANCE, at.SLIP): "friction did not hold it",
}
LIFTED = "the ground cannot pull"


def stepped_over(
    tables: Tables,
    up: Array,
    t: Array,
    pushes: Array,
    touches: Array,
    changes: Array,
    graze: float,
) -> ContactRecord:
    """What frames and the log of changes say of contacts and limits; `up`: the ground's normal."""
    names = [touch.name for touch in tables.touches]
    forces = np.concatenate((touches[..., 3:6], touches[..., :3]), axis=-1).swapaxes(0, 1)
    phases, events = phases_over(changes, tables.touches, t, graze)
    return ContactRecord(
        force=dict(zip(names, forces)),
        gap=dict(zip(names, touches[..., at.TO_GAP].T)),
        slip=dict(zip(names, touches[..., at.TO_SLIP].T)),
        limit=dict(zip(tables.limits, touches[:, len(names) :, at.TO_FORCE].T)),
        wrench=pushes,
        normal={
            touch.name: force[:, 3:] @ up
            for touch, force in zip(tables.touches, forces)
            if touch.other == GROUND
        },
        phases=phases,
        events=events,
    )


def phases_over(
    changes: Array, touches: Sequence[Touch], t: Array, graze: float = 0.0
) -> tuple[dict[str, NDArray[np.str_]], tuple[Event, ...]]:
    """({touch: (len(t),) phase}, events) from rows [time, touch, phase] in the order of time.

    The phase of a touch's first row is that of the start. Flights shorter than `graze` are none:
    time stepping lets go of a point for a step where what it carries is moved out of the ground.
    Touches of one contact between many bodies together have phases as one.
    """
    phases, events = {}, []
    for k, touch in enumerate(touches):
        own = _without_grazes(changes[changes[:, at.CH_TOUCH] == k], graze)
        if not len(own):
            continue
        codes = own[:, at.CH_PHASE].astype(int)
        now = np.searchsorted(own[1:, at.CH_TIME], t, side="right")
        phases[touch.name] = np.array(PHASES)[codes[now]]
        events += [
            _event(float(time), touch, before, after)
            for time, before, after in zip(own[1:, at.CH_TIME], codes, codes[1:])
        ]
    return phases, tuple(sorted(events, key=lambda event: event.t))


def _without_grazes(own: Array, graze: float) -> Array:
    """Rows of one touch without flights shorter than `graze`, and what then changes nothing."""
    if len(own) < 3:
        return own
    short = np.zeros(len(own), dtype=bool)
    short[1:-1] = (own[1:-1, at.CH_PHASE] == at.SWING) & (np.diff(own[1:, at.CH_TIME]) < graze)
    own = own[~short]
    anew = np.append(True, np.diff(own[:, at.CH_PHASE]) != 0)
    return own[anew]


def _event(t: float, touch: Touch, before: int, after: int) -> Event:
    cause: Any = CAUSES.get((before, after), LIFTED)
    return Event(t, touch.name, touch.body, PHASES[before], PHASES[after], cause)
